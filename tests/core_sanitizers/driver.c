/* Drives the paper's damper through everything that the core promises, to be run under sanitizers.
 *
 * Each buffer is allocated to its exact size, so that one double too far is seen. Prints a line a
 * failure and returns their number (at most 100).
 */
#include "driving.h"
#include "paper.h"

#define N_MASKS (1 << N_PAPER)

/* A set of its numbers. */
static const paper_numbers SET = {1.8e4, 3.527e6, 2.597e6, 3.65e8, 50.0, 0.0, 4.6e5, 1.4};

/* With the sensitivities of a mask of PLACES. */
static run new_run(size_t n, double interval, int mask)
{
    int n_which = 0;
    for (int k = 0; k < N_PAPER; k++)
        n_which += (mask >> k) & 1;
    run r = run_of(n, interval, n_which);
    for (int k = 0, j = 0; k < N_PAPER; k++)
        if (mask & 1 << k)
            r.which[j++] = PLACES[k];
    return r;
}

static void expect(run *r, const paper_numbers *p, const df_options *o, int expected, const char *name)
{
    df_network q = paper(p);
    expect_of(r, &q, o, expected, name);
}

/* Velocity jumps at each corner. */
static void triangle(run *r, double amplitude, double frequency)
{
    for (size_t i = 0; i < r->n; i++) {
        const double part = fmod(frequency * r->interval * (double)i, 1.0);
        r->x[i] = amplitude * (1.0 - 4.0 * fabs(part - 0.5));
        r->v[i] = (part < 0.5 ? 4.0 : -4.0) * amplitude * frequency;
    }
}

static void random_smooth(run *r, double reach)
{
    memset(r->x, 0, r->n * sizeof *r->x);
    memset(r->v, 0, r->n * sizeof *r->v);
    for (int k = 0; k < 6; k++) {
        const double amplitude = reach * chance() / 6.0, phase = TWO_PI * chance();
        const double omega = TWO_PI * 8.0 * chance();
        for (size_t i = 0; i < r->n; i++) {
            const double angle = omega * r->interval * (double)i + phase;
            r->x[i] += amplitude * sin(angle);
            r->v[i] += amplitude * omega * cos(angle);
        }
    }
}

/* Force of the fourth cycle by two independent implementations, to the digits known. */
static void standard_test(void)
{
    static const double golden[][2] = {
        {0.1, 673.35}, {0.2, 98.41}, {0.4, -651.20}, {0.6, -769.65}, {0.9, 581.15}};
    run r = new_run(4001, 1.0 / 1500.0, N_MASKS - 1);
    sine(&r, 0.032, 1.5, 0.0);
    expect(&r, &SET, &USUAL, DF_OK, "standard sine");
    for (int k = 0; k < 5; k++) {
        const size_t at = 3000 + (size_t)(1000.0 * golden[k][0] + 0.5);
        check(fabs(r.force[at] - golden[k][1]) < 0.05, "standard sine", "a known force is missed");
    }
    free_run(&r);
}

static void reversals(void)
{
    run r = new_run(1500, 1e-3, N_MASKS - 1);
    triangle(&r, 0.03, 2.0);
    expect(&r, &SET, &USUAL, DF_OK, "triangle");
    sine(&r, 0.032, 1.5, 0.25 * TWO_PI);
    expect(&r, &SET, &USUAL, DF_OK, "start at a reversal");
    sine(&r, 1e-6, 50.0, 0.0);
    expect(&r, &SET, &USUAL, DF_OK, "a micrometre to and fro");
    sine(&r, 0.0, 1.0, 0.0);
    expect(&r, &SET, &USUAL, DF_OK, "rest");
    for (size_t i = 0; i < r.n; i++)
        check(fabs(r.force[i] + 2.83529e-4 * 4.6e5) < 1e-6, "rest", "force is not -a_r P_0");
    free_run(&r);
}

static void cavitation(void)
{
    paper_numbers p = SET;
    p.R_m3 *= 1.5;
    run r = new_run(2000, 1e-3, N_MASKS - 1);
    sine(&r, 0.032, 1.5, 0.0);
    expect(&r, &p, &USUAL, DF_OK, "cavitation");
    size_t empty = 0;
    for (size_t i = 0; i < r.n; i++)
        empty += r.pressures[r.n + i] == 0.0;
    check(empty > 0, "cavitation", "chamber 2 never empties");
    p.R_m3 *= 100.0;
    p.R_m2 *= 100.0;
    expect(&r, &p, &USUAL, DF_OK, "hard cavitation");
    free_run(&r);
}

static void random_motions(void)
{
    for (int k = 0; k < 20; k++) {
        run r = new_run(1000, 1e-3, N_MASKS - 1);
        random_smooth(&r, 0.1);
        expect(&r, &SET, &USUAL, DF_OK, "random smooth motion");
        free_run(&r);
    }
}

static void short_records(void)
{
    for (size_t n = 0; n < 4; n++) {
        run r = new_run(n, 1e-3, N_MASKS - 1);
        sine(&r, 0.032, 1.5, 0.3);
        expect(&r, &SET, &USUAL, n ? DF_OK : DF_BAD_ARGUMENT, "short record");
        if (n) {
            r.v[n - 1] = NAN;
            expect(&r, &SET, &USUAL, DF_NOT_FINITE, "short record without a last velocity");
        }
        free_run(&r);
    }
}

static void bad_motions(void)
{
    const double poison[] = {NAN, INFINITY, -INFINITY};
    for (int k = 0; k < 6; k++) {
        for (size_t at = 0; at < 10; at += 3) {
            run r = new_run(10, 1e-3, 1 << K_E);
            sine(&r, 0.032, 1.5, 0.0);
            (k < 3 ? r.x : r.v)[at] = poison[k % 3];
            expect(&r, &SET, &USUAL, DF_NOT_FINITE, "not a number in the motion");
            check(r.work.failed_sample == at || (at == 0 && r.work.failed_sample <= 1),
                  "not a number in the motion", "another sample is named");
            free_run(&r);
        }
    }
    run r = new_run(400, 1e-3, N_MASKS - 1);
    sine(&r, 0.2, 1.5, 0.0);
    expect(&r, &SET, &USUAL, DF_CHAMBER_EMPTY, "stroke beyond the chamber");
    check(r.work.failed_sample > 0 && r.work.failed_sample < r.n && r.x[r.work.failed_sample] > 0.132,
          "stroke beyond the chamber", "another sample is named");
    sine(&r, 0.2, 1.5, 0.25 * TWO_PI);
    expect(&r, &SET, &USUAL, DF_CHAMBER_EMPTY, "start beyond the chamber");
    free_run(&r);
}

static void step_limit(void)
{
    df_options few = USUAL;
    few.max_steps_per_sample = 1;
    run r = new_run(100, 1e-3, N_MASKS - 1);
    sine(&r, 0.032, 1.5, 0.0);
    expect(&r, &SET, &few, DF_STEP_LIMIT, "step limit");
    check(r.work.failed_sample == 1, "step limit", "another sample is named");
    free_run(&r);
}

/* The count is refused before a buffer is looked at. */
static void too_many_sensitivities(void)
{
    const int counts[] = {-1, PAPER_NUMBERS + 1};
    for (int k = 0; k < 2; k++) {
        run r = new_run(10, 1e-3, N_MASKS - 1);
        sine(&r, 0.032, 1.5, 0.0);
        df_network q = paper(&SET);
        int which[PAPER_NUMBERS + 1] = {0};
        const df_motion motion = {r.n, r.interval, r.x, r.v, 0, NULL};
        const df_result result = {r.pressures, r.masses, r.force, r.sensitivities, which, counts[k]};
        check(df_simulate_network(&q, &USUAL, &motion, &result, &r.work) == DF_BAD_ARGUMENT, "sensitivities",
              "a count is taken");
        free_run(&r);
    }
}

static void bad_arguments(void)
{
    const double wrong[] = {0.0, -1.0, NAN, INFINITY};
    run r = new_run(10, 1e-3, N_MASKS - 1);
    sine(&r, 0.032, 1.5, 0.0);
    for (int k = 0; k < 4; k++) {
        paper_numbers p[] = {SET, SET, SET, SET, SET, SET};
        p[0].R_m1 = p[1].R_m2 = p[2].R_m3 = p[3].K_e = p[4].P_0 = p[5].gamma = wrong[k];
        for (int j = 0; j < 6; j++)
            expect(&r, &p[j], &USUAL, DF_BAD_ARGUMENT, "parameter out of range");
        if (k == 3)
            continue; /* A limit that is never met is no mistake. */
        df_options o[] = {USUAL, USUAL};
        o[0].tolerance = o[1].dead_band = wrong[k];
        for (int j = 0; j < 2; j++)
            expect(&r, &SET, &o[j], DF_BAD_ARGUMENT, "option out of range");
    }
    r.interval = 0.0;
    expect(&r, &SET, &USUAL, DF_BAD_ARGUMENT, "interval of zero");
    r.interval = 1e-3;
    r.which[2] = PAPER_NUMBERS;
    expect(&r, &SET, &USUAL, DF_BAD_ARGUMENT, "unknown sensitivity");
    r.which[2] = -1;
    expect(&r, &SET, &USUAL, DF_BAD_ARGUMENT, "negative sensitivity");
    free_run(&r);
    too_many_sensitivities();
}

/* Each set of sensitivities gives the rows of the full set, bit by bit. */
static void masks(void)
{
    const size_t n = 120;
    run full = new_run(n, 2e-3, N_MASKS - 1);
    sine(&full, 0.032, 1.5, 0.7);
    expect(&full, &SET, &USUAL, DF_OK, "all sensitivities");
    for (int mask = 0; mask < N_MASKS; mask++) {
        run r = new_run(n, 2e-3, mask);
        sine(&r, 0.032, 1.5, 0.7);
        expect(&r, &SET, &USUAL, DF_OK, "some sensitivities");
        check(!memcmp(r.force, full.force, n * sizeof(double)), "some sensitivities", "the force differs");
        for (int k = 0, j = 0; k < N_PAPER; k++)
            if (mask & 1 << k)
                check(!memcmp(r.sensitivities + (size_t)j++ * n, full.sensitivities + (size_t)k * n,
                              n * sizeof(double)),
                      "some sensitivities", "a row differs from that of the full set");
        free_run(&r);
    }
    free_run(&full);
}

/* Whatever the numbers are, the core ends with a code of its own and sound results. */
static void anything(void)
{
    df_options o = USUAL;
    o.max_steps_per_sample = 200;
    for (int k = 0; k < 400; k++) {
        const double volume = spread(PAPER_GAS_VOLUME, 2.0);
        paper_numbers p = {spread(SET.R_m1, 4.0), spread(SET.R_m2, 4.0), spread(SET.R_m3, 4.0),
                           spread(SET.K_e, 4.0),  spread(SET.f_f, 4.0),  0.0,
                           spread(SET.P_0, 4.0),  spread(SET.gamma, 1.0)};
        df_network q = paper(&p);
        q.numbers[DF_NUMBER_V_GAS] = volume;
        run r = new_run(60, spread(1e-3, 2.0), k % N_MASKS);
        random_smooth(&r, 0.3);
        const int code = simulate(&r, &q, &o);
        check(code >= DF_OK && code <= DF_BAD_ARGUMENT, "anything", "an unknown code");
        check(r.work.failed_sample <= r.n, "anything", "a sample beyond the record");
        if (code == DF_OK)
            check_result(&r, "anything");
        free_run(&r);
    }
}

int main(void)
{
    standard_test();
    reversals();
    cavitation();
    random_motions();
    short_records();
    bad_motions();
    step_limit();
    bad_arguments();
    masks();
    anything();
    if (failures)
        printf("%d failures\n", failures);
    tell_what_was_seen();
    return failures;
}
