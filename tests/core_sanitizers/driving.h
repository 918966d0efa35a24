/* What both drivers of the network share: motions with buffers of their exact size, and what must hold. */
#ifndef DRIVING_H
#define DRIVING_H

#include "network.h"
#include "seen.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define TWO_PI 6.283185307179586

static int failures;

static void check(int holds, const char *name, const char *what)
{
    if (!holds) {
        printf("FAILED %s: %s\n", name, what);
        failures += failures < 100;
    }
}

static const df_options USUAL = {3e-3, 1e-4, 10000};

/* A motion and the buffers of its results. */
typedef struct {
    size_t n;
    double interval;
    double *x, *v, *pressures, *masses, *force, *sensitivities;
    int *which, n_which;
    df_work work;
} run;

static void *block(size_t bytes)
{
    void *found = malloc(bytes ? bytes : 1);
    if (!found) {
        puts("out of memory");
        exit(101);
    }
    return found;
}

static double *numbers_of(size_t n)
{
    double *found = block(n * sizeof(double));
    for (size_t i = 0; i < n; i++)
        found[i] = NAN; /* what is not written is not finite */
    return found;
}

static run run_of(size_t n, double interval, int n_which)
{
    run r;
    memset(&r, 0, sizeof r);
    r.n = n;
    r.interval = interval;
    r.x = numbers_of(n);
    r.v = numbers_of(n);
    r.pressures = numbers_of(3 * n);
    r.masses = numbers_of(2 * n);
    r.force = numbers_of(n);
    r.n_which = n_which;
    r.which = block((size_t)n_which * sizeof(int));
    for (int k = 0; k < n_which; k++)
        r.which[k] = k;
    r.sensitivities = numbers_of((size_t)n_which * n);
    return r;
}

static void free_run(run *r)
{
    free(r->x);
    free(r->v);
    free(r->pressures);
    free(r->masses);
    free(r->force);
    free(r->sensitivities);
    free(r->which);
}

static void sine(run *r, double amplitude, double frequency, double phase)
{
    for (size_t i = 0; i < r->n; i++) {
        const double angle = TWO_PI * frequency * r->interval * (double)i + phase;
        r->x[i] = amplitude * sin(angle);
        r->v[i] = amplitude * TWO_PI * frequency * cos(angle);
    }
}

static int all_finite(const double *a, size_t n)
{
    for (size_t i = 0; i < n; i++)
        if (!isfinite(a[i]))
            return 0;
    return 1;
}

static int simulate(run *r, df_network *q, const df_options *o)
{
    const df_motion motion = {r->n, r->interval, r->x, r->v, 0, NULL};
    const df_result result = {r->pressures, r->masses, r->force, r->sensitivities, r->which, r->n_which};
    return df_simulate_network(q, o, &motion, &result, &r->work);
}

static void check_result(const run *r, const char *name)
{
    see(r->force, r->n);
    see(r->pressures, 3 * r->n);
    see(r->masses, 2 * r->n);
    see(r->sensitivities, (size_t)r->n_which * r->n);
    see((const double[]){(double)r->work.steps, (double)r->work.newton}, 2);
    check(all_finite(r->force, r->n), name, "a force is not finite");
    check(all_finite(r->pressures, 3 * r->n), name, "a pressure is not finite");
    check(all_finite(r->masses, 2 * r->n), name, "a mass is not finite");
    check(all_finite(r->sensitivities, (size_t)r->n_which * r->n), name, "a sensitivity is not finite");
    for (size_t i = 0; i < 3 * r->n; i++)
        check(!(r->pressures[i] < 0.0), name, "a pressure is negative");
    check(r->work.failed_sample == r->n || r->n == 1, name, "did not reach the last sample");
}

static void expect_of(run *r, df_network *q, const df_options *o, int expected, const char *name)
{
    const int code = simulate(r, q, o);
    if (code != expected) {
        printf("FAILED %s: code %d, expected %d, at sample %zu\n", name, code, expected,
               r->work.failed_sample);
        failures += failures < 100;
    } else if (code == DF_OK) {
        check_result(r, name);
    }
}

static unsigned long long seed = 20000101ULL;

/* Uniform in [0, 1): Knuth's 64-bit linear congruence, upper bits. */
static double chance(void)
{
    seed = seed * 6364136223846793005ULL + 1442695040888963407ULL;
    return (double)(seed >> 11) / 9007199254740992.0;
}

static double spread(double middle, double decades)
{
    return middle * pow(10.0, decades * (2.0 * chance() - 1.0));
}

#endif
