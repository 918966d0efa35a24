/* The stepping interface: begin, advance, force, retune and evaluate, under sanitizers. */
#include "stepper.h"
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

static const df_geometry PURDY = {3.54411e-4, 6.37940e-4, 2.83529e-4,
                                  4.71367e-5, 8.48460e-5, 6.28319e-5, 770.0};
static const df_parameters SET = {1.8e4, 3.527e6, 2.597e6, 3.65e8, 50.0, 7.0, 4.6e5, 1.4};
static const df_parameters STIFF = {4.9e4, 1.7e7, 2.597e6, 1.08e9, 50.0, 7.0, 4.6e5, 1.4};
static const df_options USUAL = {3e-3, 1e-4, 10000};
static const int ALL[DF_N_PARAMETERS] = {DF_R_M1, DF_R_M2, DF_R_M3, DF_K_E, DF_F_F, DF_F_0, DF_P_0, DF_GAMMA};

static double place(size_t i) { return 0.032 * sin(TWO_PI * 1.5 * 1e-3 * (double)i); }
static double speed(size_t i) { return 0.032 * TWO_PI * 1.5 * cos(TWO_PI * 1.5 * 1e-3 * (double)i); }

static void a_run_is_the_simulation(void)
{
    static double x[SAMPLES], v[SAMPLES], P[3 * SAMPLES], m[2 * SAMPLES], force[SAMPLES];
    static double rows[DF_N_PARAMETERS * SAMPLES];
    for (size_t i = 0; i < SAMPLES; i++)
        x[i] = place(i), v[i] = speed(i);
    const df_motion motion = {SAMPLES, 1e-3, x, v};
    const df_result result = {P, m, force, rows, ALL, DF_N_PARAMETERS};
    df_work work, own = {0, 0, 0, 0};
    df_run run, copy;
    check(df_simulate(&PURDY, &SET, &USUAL, &motion, &result, &work) == DF_OK, "simulate");
    check(df_begin(&PURDY, &SET, &USUAL, ALL, DF_N_PARAMETERS, x[0], v[0], &run) == DF_OK, "begin");
    int same = 1;
    for (size_t i = 1; i < SAMPLES; i++) {
        double slopes[DF_N_PARAMETERS];
        if (i == SAMPLES / 2) { /* a copy of the bytes is the run */
            memcpy(&copy, &run, sizeof run);
            memset(&run, 0, sizeof run);
            memcpy(&run, &copy, sizeof run);
        }
        check(df_advance(&run, 1e-3, x[i], v[i], &own) == DF_OK, "advance");
        same = same && df_force(&run, slopes) == force[i] && run.b.P1 == P[i];
        for (int j = 0; j < DF_N_PARAMETERS; j++)
            same = same && slopes[j] == rows[(size_t)j * SAMPLES + i];
    }
    see(force, SAMPLES);
    see(P, 3 * SAMPLES);
    see(rows, DF_N_PARAMETERS * SAMPLES);
    check(same, "step by step the force and its slopes are those of df_simulate, bit for bit");
    check(own.steps == work.steps && own.newton == work.newton, "as many steps");
}

static void refusals(void)
{
    df_run run;
    df_work work = {0, 0, 0, 0};
    df_parameters wrong = SET;
    const int beyond = DF_N_PARAMETERS;
    wrong.K_e = 0.0;
    check(df_begin(&PURDY, &wrong, &USUAL, NULL, 0, 0.0, 0.0, &run) == DF_BAD_ARGUMENT, "K_e of 0");
    check(df_begin(&PURDY, &SET, &USUAL, &beyond, 1, 0.0, 0.0, &run) == DF_BAD_ARGUMENT, "which");
    check(df_begin(&PURDY, &SET, &USUAL, NULL, 0, 0.5, 0.0, &run) == DF_CHAMBER_EMPTY, "x beyond");
    check(df_begin(&PURDY, &SET, &USUAL, NULL, 0, 0.0, NAN, &run) == DF_NOT_FINITE, "v not a number");
    check(df_begin(&PURDY, &SET, &USUAL, NULL, 0, 0.0, 0.0, &run) == DF_OK, "begin");
    check(df_advance(&run, 0.0, 0.0, 0.0, &work) == DF_BAD_ARGUMENT, "no time");
    check(df_advance(&run, INFINITY, 0.0, 0.0, &work) == DF_BAD_ARGUMENT, "endless time");
    check(df_advance(&run, 1e-3, NAN, 0.0, &work) == DF_NOT_FINITE, "x not a number");
    check(df_retune(&run, &wrong, 1e-4) == DF_BAD_ARGUMENT, "retuned to nothing");
    check(run.q.p.K_e == SET.K_e, "a refused change changes nothing");
    check(df_retune(&run, &SET, 0.0) == DF_BAD_ARGUMENT, "no dead band");
}

static void pressures_stay_when_parameters_change(void)
{
    df_run run, alike;
    df_work work = {0, 0, 0, 0};
    double slopes[DF_N_PARAMETERS], before[DF_N_PARAMETERS], after[DF_N_PARAMETERS];
    df_begin(&PURDY, &SET, &USUAL, ALL, DF_N_PARAMETERS, 0.0, speed(0), &run);
    for (size_t i = 1; i < 400; i++)
        df_advance(&run, 1e-3, place(i), speed(i), &work);
    alike = run;
    const double old = df_force(&run, before);
    check(df_retune(&run, &STIFF, 1e-4) == DF_OK, "retune");
    check(fabs(df_force(&run, slopes) - old) < 1e-3, "no jump of the force");
    check(slopes[0] == 0.0 || fabs(slopes[0]) < 1e-9, "what is new had no influence yet");
    check(df_retune(&alike, &SET, 1e-4) == DF_OK, "retuned to the same");
    df_force(&alike, after);
    for (int j = 0; j < DF_N_PARAMETERS; j++)
        check(fabs(after[j] - before[j]) <= 1e-6 * fabs(before[j]) + 1e-12, "slopes stay");
    /* After a cycle nothing is left of the past. */
    df_run other;
    df_begin(&PURDY, &STIFF, &USUAL, ALL, DF_N_PARAMETERS, 0.0, speed(0), &other);
    for (size_t i = 1; i < 400; i++)
        df_advance(&other, 1e-3, place(i), speed(i), &work);
    for (size_t i = 400; i < 1100; i++) {
        df_advance(&run, 1e-3, place(i), speed(i), &work);
        df_advance(&other, 1e-3, place(i), speed(i), &work);
    }
    check(fabs(df_force(&run, slopes) - df_force(&other, after)) < 0.05, "the past is forgotten");
}

/* Central differences of everything that df_evaluate differentiates. */
static void slopes_of_the_rates(double m1, double m2, double x)
{
    df_run run;
    df_rates at, low, high;
    df_begin(&PURDY, &SET, &USUAL, ALL, DF_N_PARAMETERS, 0.0, 0.1, &run);
    check(df_evaluate(&run, m1, m2, x, &at) == DF_OK, "evaluate");
    for (int k = 0; k < 3 + DF_N_PARAMETERS; k++) {
        df_run less = run, more = run;
        double *const of_less[] = {&less.q.p.R_m1, &less.q.p.R_m2, &less.q.p.R_m3, &less.q.p.K_e,
                                   &less.q.p.f_f,  &less.q.p.f_0,  &less.q.p.P_0,  &less.q.p.gamma};
        double d = k < 2 ? 1e-9 : 1e-8, y[3] = {m1, m2, x}, z[3] = {m1, m2, x};
        if (k < 3) {
            y[k] -= d;
            z[k] += d;
        } else {
            df_parameters down = SET, up = SET;
            double *const of_down[] = {&down.R_m1, &down.R_m2, &down.R_m3, &down.K_e,
                                       &down.f_f,  &down.f_0,  &down.P_0,  &down.gamma};
            double *const of_up[] = {&up.R_m1, &up.R_m2, &up.R_m3, &up.K_e,
                                     &up.f_f,  &up.f_0,  &up.P_0,  &up.gamma};
            d = 1e-6 * *of_less[k - 3];
            *of_down[k - 3] -= d;
            *of_up[k - 3] += d;
            df_begin(&PURDY, &down, &USUAL, NULL, 0, 0.0, 0.1, &less);
            df_begin(&PURDY, &up, &USUAL, NULL, 0, 0.0, 0.1, &more);
        }
        df_evaluate(&less, y[0], y[1], y[2], &low);
        df_evaluate(&more, z[0], z[1], z[2], &high);
        for (int i = 0; i < 2; i++) {
            const double exact = k < 2 ? at.by_mass[i][k] : k == 2 ? at.by_x[i] : at.by_parameter[k - 3][i];
            const double found = (high.rates[i] - low.rates[i]) / (2.0 * d);
            check(fabs(found - exact) <= 2e-5 * fabs(exact) + 1e-9 * fabs(at.rates[i]) / d, "slope of a rate");
        }
        for (int i = 0; i < 3; i++) {
            const double exact = k < 2    ? at.pressures_by_mass[i][k]
                                 : k == 2 ? at.pressures_by_x[i]
                                          : at.pressures_by_parameter[k - 3][i];
            const double found = (high.pressures[i] - low.pressures[i]) / (2.0 * d);
            check(fabs(found - exact) <= 2e-5 * fabs(exact) + 1e-2 / d * 1e-7, "slope of a pressure");
        }
    }
}

int main(void)
{
    a_run_is_the_simulation();
    refusals();
    pressures_stay_when_parameters_change();
    slopes_of_the_rates(1e-3, -4e-4, 0.01);  /* valve 1 and check 3 open */
    slopes_of_the_rates(-1e-4, 9e-4, -0.01); /* check 2 open */
    df_run run;
    df_rates rates;
    df_begin(&PURDY, &SET, &USUAL, NULL, 0, 0.0, 0.0, &run);
    check(df_evaluate(&run, 0.0, 0.0, 0.2, &rates) == DF_CHAMBER_EMPTY, "no room");
    check(df_evaluate(&run, NAN, 0.0, 0.0, &rates) == DF_NOT_FINITE, "no mass");
    tell_what_was_seen();
    return failures;
}
