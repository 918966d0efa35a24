/* The stepping interface with the paper's damper: begin, advance, force, retune and evaluate, under sanitizers. */
#include "paper.h"
#include "seen.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#define TWO_PI 6.283185307179586
enum { SAMPLES = 900 };

static int failures;

static void check(int holds, const char *what)
{
    if (!holds) {
        printf("FAILED %s\n", what);
        failures += failures < 100;
    }
}

static const paper_numbers SET = {1.8e4, 3.527e6, 2.597e6, 3.65e8, 50.0, 7.0, 4.6e5, 1.4};
static const paper_numbers STIFF = {4.9e4, 1.7e7, 2.597e6, 1.08e9, 50.0, 7.0, 4.6e5, 1.4};
static const df_options USUAL = {3e-3, 1e-4, 10000};
#define ALL PLACES

static double place(size_t i) { return 0.032 * sin(TWO_PI * 1.5 * 1e-3 * (double)i); }
static double speed(size_t i) { return 0.032 * TWO_PI * 1.5 * cos(TWO_PI * 1.5 * 1e-3 * (double)i); }

static void a_run_is_the_simulation(void)
{
    static double x[SAMPLES], v[SAMPLES], P[3 * SAMPLES], m[2 * SAMPLES], force[SAMPLES];
    static double rows[N_PAPER * SAMPLES];
    for (size_t i = 0; i < SAMPLES; i++)
        x[i] = place(i), v[i] = speed(i);
    const df_motion motion = {SAMPLES, 1e-3, x, v, 0, NULL};
    const df_result result = {P, m, force, rows, ALL, N_PAPER};
    df_work work, own = {0, 0, 0, 0};
    df_network q = paper(&SET);
    df_network_state run, copy;
    check(df_simulate_network(&q, &USUAL, &motion, &result, &work) == DF_OK, "simulate");
    check(df_begin_network(&q, &USUAL, x[0], v[0], ALL, N_PAPER, &run) == DF_OK, "begin");
    int same = 1;
    for (size_t i = 1; i < SAMPLES; i++) {
        double slopes[N_PAPER];
        if (i == SAMPLES / 2) { /* a copy of the bytes is the run */
            memcpy(&copy, &run, sizeof run);
            memset(&run, 0, sizeof run);
            memcpy(&run, &copy, sizeof run);
        }
        check(df_advance_network(&q, &USUAL, x[i], v[i], 1e-3, &run, &own) == DF_OK, "advance");
        same = same && df_force_network(&q, &USUAL, &run, slopes) == force[i] && run.b.P[0] == P[i];
        for (int j = 0; j < N_PAPER; j++)
            same = same && slopes[j] == rows[(size_t)j * SAMPLES + i];
    }
    see(force, SAMPLES);
    see(P, 3 * SAMPLES);
    see(rows, N_PAPER * SAMPLES);
    check(same, "step by step the force and its slopes are those of df_simulate_network, bit for bit");
    check(own.steps == work.steps && own.newton == work.newton, "as many steps");
}

static void refusals(void)
{
    df_network q = paper(&SET), wrong = q;
    df_network_state run;
    df_work work = {0, 0, 0, 0};
    df_options no_band = USUAL;
    const int beyond = PAPER_NUMBERS;
    wrong.numbers[DF_NUMBER_K] = 0.0;
    no_band.dead_band = 0.0;
    check(df_begin_network(&wrong, &USUAL, 0.0, 0.0, NULL, 0, &run) == DF_BAD_ARGUMENT, "K_e of 0");
    check(df_begin_network(&q, &USUAL, 0.0, 0.0, &beyond, 1, &run) == DF_BAD_ARGUMENT, "which");
    check(df_begin_network(&q, &USUAL, 0.5, 0.0, NULL, 0, &run) == DF_CHAMBER_EMPTY, "x beyond");
    check(df_begin_network(&q, &USUAL, 0.0, NAN, NULL, 0, &run) == DF_NOT_FINITE, "v not a number");
    check(df_begin_network(&q, &USUAL, 0.0, 0.0, NULL, 0, &run) == DF_OK, "begin");
    check(df_advance_network(&q, &USUAL, 0.0, 0.0, 0.0, &run, &work) == DF_BAD_ARGUMENT, "no time");
    check(df_advance_network(&q, &USUAL, 0.0, 0.0, INFINITY, &run, &work) == DF_BAD_ARGUMENT, "endless time");
    check(df_advance_network(&q, &USUAL, NAN, 0.0, 1e-3, &run, &work) == DF_NOT_FINITE, "x not a number");
    check(df_retune_network(&q, &wrong, &USUAL, &run) == DF_BAD_ARGUMENT, "retuned to nothing");
    check(q.numbers[DF_NUMBER_K] == SET.K_e, "a refused change changes nothing");
    df_network same = paper(&SET);
    check(df_retune_network(&q, &same, &no_band, &run) == DF_BAD_ARGUMENT, "no dead band");
}

static void to_and_fro(df_network *q, size_t from, size_t to, df_network_state *run)
{
    df_work work = {0, 0, 0, 0};
    for (size_t i = from; i < to; i++)
        check(df_advance_network(q, &USUAL, place(i), speed(i), 1e-3, run, &work) == DF_OK, "advance");
}

static void pressures_stay_when_parameters_change(void)
{
    df_network q = paper(&SET), same = paper(&SET), stiff = paper(&STIFF), of_other = paper(&STIFF);
    df_network_state run, alike, other;
    double slopes[N_PAPER], before[N_PAPER], after[N_PAPER];
    df_begin_network(&q, &USUAL, 0.0, speed(0), ALL, N_PAPER, &run);
    to_and_fro(&q, 1, 400, &run);
    alike = run;
    df_network of_alike = q;
    const double old = df_force_network(&q, &USUAL, &run, before);
    check(df_retune_network(&q, &stiff, &USUAL, &run) == DF_OK, "retune");
    check(fabs(df_force_network(&q, &USUAL, &run, slopes) - old) < 1e-3, "no jump of the force");
    check(fabs(slopes[0]) < 1e-9, "what is new had no influence yet");
    check(df_retune_network(&of_alike, &same, &USUAL, &alike) == DF_OK, "retuned to the same");
    df_force_network(&of_alike, &USUAL, &alike, after);
    for (int j = 0; j < N_PAPER; j++)
        check(fabs(after[j] - before[j]) <= 1e-6 * fabs(before[j]) + 1e-12, "slopes stay");
    /* After a cycle nothing is left of the past. */
    df_begin_network(&of_other, &USUAL, 0.0, speed(0), ALL, N_PAPER, &other);
    to_and_fro(&of_other, 1, 1100, &other);
    to_and_fro(&q, 400, 1100, &run);
    check(fabs(df_force_network(&q, &USUAL, &run, slopes) - df_force_network(&of_other, &USUAL, &other, after)) < 0.05,
          "the past is forgotten");
}

/* Central differences of everything that df_network_by differentiates. */
static void slopes_of_the_rates(double m1, double m2, double x)
{
    static const int knowns[] = {DF_BY_OIL_1, DF_BY_OIL_2, DF_BY_PLACE, DF_BY_SPEED, DF_BY_BAND};
    const double v = 5e-5; /* within the dead band */
    for (int k = 0; k < 5 + N_PAPER; k++) {
        df_network q = paper(&SET), less = q, more = q;
        df_network_rates at, low, high;
        df_network_slopes exact;
        double y[5] = {m1, m2, x, v, USUAL.dead_band}, z[5] = {m1, m2, x, v, USUAL.dead_band};
        double d = k < 2 ? 1e-9 : 1e-8;
        if (k < 5) {
            y[k] -= d;
            z[k] += d;
        } else {
            const int place = PLACES[k - 5];
            d = 1e-6 * q.numbers[place];
            less.numbers[place] -= d;
            more.numbers[place] += d;
        }
        check(df_plan_network(&q) == DF_OK, "plan");
        check(df_plan_network(&less) == DF_OK && df_plan_network(&more) == DF_OK, "plan");
        const double oil[2] = {m1, m2};
        check(df_evaluate_network(&q, USUAL.dead_band, oil, 0.0, x, v, &at) == DF_OK, "evaluate");
        df_network_by(&q, &at, k < 5 ? knowns[k] : DF_BY_NUMBER + PLACES[k - 5], &exact);
        df_evaluate_network(&less, y[4], y, 0.0, y[2], y[3], &low);
        df_evaluate_network(&more, z[4], z, 0.0, z[2], z[3], &high);
        see(exact.rates, 3);
        see(exact.pressures, 3);
        for (int i = 0; i < 2; i++) {
            const double found = (high.rates[i] - low.rates[i]) / (2.0 * d);
            check(fabs(found - exact.rates[i]) <= 2e-5 * fabs(exact.rates[i]) + 1e-9 * fabs(at.rates[i]) / d,
                  "slope of a rate");
        }
        for (int i = 0; i < 3; i++) {
            const double found = (high.b.P[i] - low.b.P[i]) / (2.0 * d);
            check(fabs(found - exact.pressures[i]) <= 2e-5 * fabs(exact.pressures[i]) + 1e-2 / d * 1e-7,
                  "slope of a pressure");
        }
        const double found = (high.force - low.force) / (2.0 * d);
        check(fabs(found - exact.force) <= 2e-5 * fabs(exact.force) + 1e-9 * fabs(at.force) / d, "slope of the force");
    }
}

int main(void)
{
    a_run_is_the_simulation();
    refusals();
    pressures_stay_when_parameters_change();
    slopes_of_the_rates(1e-3, -4e-4, 0.01);  /* valve 1 and check 3 open */
    slopes_of_the_rates(-1e-4, 9e-4, -0.01); /* check 2 open */
    df_network q = paper(&SET);
    df_network_rates rates;
    const double none[2] = {0.0, 0.0}, no_number[2] = {NAN, 0.0};
    check(df_plan_network(&q) == DF_OK, "plan");
    check(df_evaluate_network(&q, 1e-4, none, 0.0, 0.2, 0.0, &rates) == DF_CHAMBER_EMPTY, "no room");
    check(df_evaluate_network(&q, 1e-4, no_number, 0.0, 0.0, 0.0, &rates) == DF_NOT_FINITE, "no mass");
    check(df_evaluate_network(&q, 0.0, none, 0.0, 0.0, 0.0, &rates) == DF_BAD_ARGUMENT, "no band");
    tell_what_was_seen();
    return failures;
}
