/* Drives the network and the models with a state of their own, to be run under sanitizers.
 *
 * Each buffer is allocated to its exact size, so that one double too far is seen. Prints a line a
 * failure and returns their number (at most 100).
 */
#include "driving.h"
#include "hysteresis.h"

enum { R_M1 = DF_FIRST_PASSAGE_NUMBER, R_M2, R_M3, OPENING, SLOPE, BLEED, WIDTH, LIFT, N_NUMBERS };

/* The paper's damper with a blow-off and a leak beside its valves. */
static df_network damper(void)
{
    df_network q;
    memset(&q, 0, sizeof q);
    q.a_1 = 3.54411e-4;
    q.a_2 = 6.37940e-4;
    q.V_1 = 4.71367e-5;
    q.V_2 = 8.48460e-5;
    q.rho_0 = 770.0;
    q.rounding = 1.0;
    const df_passage ways[] = {
        {1, 3, {-1, -1, R_M1, -1, -1}, 1},             /* the adjuster */
        {2, 1, {-1, R_M2, -1, -1, -1}, 0},             /* checks */
        {3, 2, {-1, R_M3, -1, -1, -1}, 0},
        {1, 2, {OPENING, SLOPE, BLEED, WIDTH, LIFT}, 0}, /* a stack of discs */
    };
    q.n_passages = (int)(sizeof ways / sizeof *ways);
    memcpy(q.passages, ways, sizeof ways);
    q.n_numbers = N_NUMBERS;
    const double numbers[N_NUMBERS] = {3.65e8, 0.0, 50.0, 0.0, 4.6e5, 1.4, 6.28319e-5, 0.0, 0.0, 0.0,
                                       0.0, 0.0, 0.0, 0.0, 0.0, 1.8e4, 3.527e6, 2.597e6, 1e6, 2e7, 3e4, 5e4,
                                       1e-6};
    memcpy(q.numbers, numbers, sizeof numbers);
    return q;
}

/* Rigid, elastic, with play, with free gas, with a floating piston, with friction that pre-slides, is
 * larger at rest and pressed: all sensitivities at once. */
static void every_kind(void)
{
    for (int kind = 0; kind < 8; kind++) {
        df_network q = damper();
        q.numbers[DF_NUMBER_STIFFNESS] = kind == 1 || kind == 2 || kind == 6 ? 5e6 : 0.0;
        q.numbers[DF_NUMBER_PRESLIDING] = kind == 5 || kind == 6 ? 3e-5 : 0.0;
        q.numbers[DF_NUMBER_BREAKAWAY] = kind > 5 ? 20.0 : 0.0;
        q.numbers[DF_NUMBER_STRIBECK] = kind > 5 ? 0.02 : 0.0;
        q.numbers[DF_NUMBER_PRESSED] = kind > 5 ? 1e-5 : 0.0;
        q.numbers[DF_NUMBER_TURNING] = kind == 0 || kind == 1 ? 5e-3 : 0.0;
        q.numbers[DF_NUMBER_PLAY] = kind == 2 ? 2e-4 : 0.0;
        q.numbers[DF_NUMBER_DRAG] = kind == 1 ? 100.0 : 0.0;
        q.numbers[DF_NUMBER_PHI] = kind == 3 ? 0.01 : 0.0;
        if (kind == 4) { /* nothing but the valves of the piston between 1 and the gas */
            q.has_floating_piston = 1;
            q.passages[1] = (df_passage){2, 1, {-1, R_M2, -1, -1, -1}, 0};
            q.passages[2] = (df_passage){1, 2, {-1, R_M3, -1, -1, -1}, 0};
            q.passages[0] = (df_passage){1, 2, {-1, -1, R_M1, -1, -1}, 1};
        }
        run r = run_of(700, 1e-3, N_NUMBERS);
        sine(&r, 0.02, 1.5, 0.0);
        expect_of(&r, &q, &USUAL, DF_OK, "every kind");
        free_run(&r);
    }
}

/* From sample to sample as an exported model does it: the same numbers. */
static void step_by_step(void)
{
    df_network q = damper();
    run r = run_of(400, 1e-3, N_NUMBERS);
    sine(&r, 0.032, 1.5, 0.0);
    expect_of(&r, &q, &USUAL, DF_OK, "step by step");
    df_network_state *now = block(sizeof *now);
    memset(now, 0, sizeof *now);
    df_work work = {0};
    double *slopes = numbers_of(N_NUMBERS);
    check(df_begin_network(&q, &USUAL, r.x[0], r.v[0], r.which, r.n_which, now) == DF_OK, "step by step", "begin");
    for (size_t i = 0; i < r.n; i++) {
        if (i > 0)
            check(df_advance_network(&q, &USUAL, r.x[i], r.v[i], r.interval, now, &work) == DF_OK,
                  "step by step", "advance");
        check(df_force_network(&q, &USUAL, now, slopes) == r.force[i], "step by step", "another force");
        for (int j = 0; j < r.n_which; j++)
            check(slopes[j] == r.sensitivities[(size_t)j * r.n + i], "step by step", "another slope");
    }
    free(slopes);
    free(now);
    free_run(&r);
}

static void what_is_refused(void)
{
    const double wrong[] = {-1.0, NAN, INFINITY};
    const int positive[] = {DF_NUMBER_K, DF_NUMBER_P_0, DF_NUMBER_GAMMA, DF_NUMBER_V_GAS, R_M1, R_M2, SLOPE,
                            DF_NUMBER_PRESLIDING, DF_NUMBER_BREAKAWAY, DF_NUMBER_STRIBECK, DF_NUMBER_PRESSED,
                            DF_NUMBER_TURNING};
    run r = run_of(30, 1e-3, 3);
    sine(&r, 0.03, 1.5, 0.0);
    for (int k = 0; k < 3; k++)
        for (size_t j = 0; j < sizeof positive / sizeof *positive; j++) {
            df_network q = damper();
            q.numbers[positive[j]] = wrong[k];
            expect_of(&r, &q, &USUAL, DF_BAD_ARGUMENT, "a number out of range");
        }
    df_network q = damper();
    const int counts[] = {0, -1, DF_MOST_PASSAGES + 1};
    for (int k = 0; k < 3; k++) {
        q.n_passages = counts[k];
        expect_of(&r, &q, &USUAL, DF_BAD_ARGUMENT, "a count of passages");
    }
    q = damper();
    q.n_numbers = DF_MOST_NUMBERS + 1;
    expect_of(&r, &q, &USUAL, DF_BAD_ARGUMENT, "too many numbers");
    const int places[] = {0, 4, -1};
    for (int k = 0; k < 3; k++) {
        q = damper();
        q.passages[0].from = places[k];
        expect_of(&r, &q, &USUAL, DF_BAD_ARGUMENT, "no such chamber");
    }
    q = damper();
    q.passages[0].places[DF_S] = DF_MOST_NUMBERS;
    expect_of(&r, &q, &USUAL, DF_BAD_ARGUMENT, "no such number");
    q = damper();
    r.which[1] = N_NUMBERS;
    expect_of(&r, &q, &USUAL, DF_BAD_ARGUMENT, "unknown sensitivity");
    r.which[1] = -1;
    expect_of(&r, &q, &USUAL, DF_BAD_ARGUMENT, "negative sensitivity");
    r.which[1] = 1;
    df_options few = USUAL;
    few.max_steps_per_sample = 0;
    expect_of(&r, &q, &few, DF_STEP_LIMIT, "step limit");
    for (size_t at = 0; at < r.n; at += 7) {
        sine(&r, 0.03, 1.5, 0.0);
        (at % 2 ? r.x : r.v)[at] = at % 3 ? NAN : INFINITY;
        expect_of(&r, &q, &USUAL, DF_NOT_FINITE, "not a number in the motion");
    }
    free_run(&r);
    for (size_t n = 0; n < 3; n++) {
        run brief = run_of(n, 1e-3, N_NUMBERS);
        sine(&brief, 0.03, 1.5, 0.0);
        expect_of(&brief, &q, &USUAL, n ? DF_OK : DF_BAD_ARGUMENT, "a short record");
        free_run(&brief);
    }
}

/* Whatever the numbers and passages are, the core ends with a code of its own and sound results. */
static void anything(void)
{
    df_options o = USUAL;
    o.max_steps_per_sample = 200;
    for (int k = 0; k < 300; k++) {
        df_network q = damper();
        for (int j = 0; j < N_NUMBERS; j++)
            q.numbers[j] = spread(q.numbers[j] > 0.0 ? q.numbers[j] : 1e-3, j == DF_NUMBER_GAMMA ? 0.5 : 3.0);
        q.numbers[DF_NUMBER_PHI] = k % 3 ? 0.0 : 0.1 * chance();
        q.numbers[DF_NUMBER_STIFFNESS] = k % 2 ? 0.0 : spread(1e6, 3.0);
        q.numbers[DF_NUMBER_PRESLIDING] = k % 5 ? 0.0 : spread(3e-5, 3.0);
        q.n_passages = 4 + (int)(12.0 * chance());
        for (int j = 4; j < q.n_passages; j++) {
            const int from = 1 + (int)(3.0 * chance());
            q.passages[j] = (df_passage){from, 1 + from % 3, {chance() < 0.5 ? OPENING : -1, SLOPE,
                                         chance() < 0.5 ? BLEED : -1, -1,
                                         chance() < 0.3 ? LIFT : -1}, chance() < 0.3};
        }
        run r = run_of(40, spread(1e-3, 1.0), (int)((N_NUMBERS + 1) * chance()));
        sine(&r, 0.03 * chance(), spread(5.0, 1.0), 0.0);
        const int code = simulate(&r, &q, &o);
        check(code >= DF_OK && code <= DF_BAD_ARGUMENT, "anything", "an unknown code");
        check(r.work.failed_sample <= r.n, "anything", "a sample beyond the record");
        if (code == DF_OK)
            check_result(&r, "anything");
        free_run(&r);
    }
}

/* A spring and a dashpot, and hysteresis without rate. */
static void states_of_their_own(void)
{
    df_elastic_dashpot d;
    memset(&d, 0, sizeof d);
    d.stiffness = 0;
    d.play = 1;
    d.half_length = 2;
    d.n_paths = 2;
    d.paths[0] = (df_path){1, 3, 4, 5};
    d.paths[1] = (df_path){0, -1, 4, -1};
    d.n_numbers = 6;
    const double numbers[] = {1e6, 2e-4, 0.2, 50.0, 1000.0, 60.0};
    memcpy(d.numbers, numbers, sizeof numbers);
    d.rounding = 0.1;
    for (int k = 0; k < 60; k++) {
        run r = run_of(k < 3 ? (size_t)k + 1 : 200, spread(1e-3, 1.0), 0);
        sine(&r, 0.03 * chance(), spread(3.0, 1.0), 0.0);
        const df_motion motion = {r.n, r.interval, r.x, r.v, 0, NULL};
        double *force = numbers_of(r.n), *slopes = numbers_of(6 * r.n);
        size_t at = 0;
        int code = df_follow_dashpot(&d, &motion, force, slopes, &at);
        check(code == DF_OK, "dashpot", "a code");
        check(all_finite(force, r.n) && all_finite(slopes, 6 * r.n), "dashpot", "not finite");
        free(slopes);
        slopes = numbers_of(DF_N_BOUC_WEN * r.n);
        const double hysteresis[DF_N_BOUC_WEN] = {spread(1000.0, 1.0), 0.5 + chance(), 1.0 + 2.0 * chance()};
        code = df_follow_bouc_wen(hysteresis, &motion, force, slopes, &at);
        check(code == DF_OK, "hysteresis", "a code");
        check(all_finite(force, r.n) && all_finite(slopes, DF_N_BOUC_WEN * r.n), "hysteresis", "not finite");

        free(force);
        free(slopes);
        free_run(&r);
    }
}

int main(void)
{
    every_kind();
    step_by_step();
    what_is_refused();
    anything();
    states_of_their_own();
    if (failures)
        printf("%d failures\n", failures);
    tell_what_was_seen();
    return failures;
}
