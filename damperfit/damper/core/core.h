/* damperfit core: what a simulation is asked, and where its results go.
 *
 * No allocation, no globals, no input or output: safe from any number of threads.
 */
#ifndef DAMPERFIT_CORE_H
#define DAMPERFIT_CORE_H

#include <stddef.h>

#include "laws.h"

#ifdef __cplusplus
extern "C" {
#endif

/* How a simulation ended. */
enum {
    DF_OK = 0,
    DF_NOT_FINITE = 1,    /* an input or a state is NaN or infinite */
    DF_STEP_LIMIT = 2,    /* more steps than max_steps_per_sample between two samples */
    DF_CHAMBER_EMPTY = 3, /* chamber 1, chamber 2 or gas volume <= 0 */
    DF_BAD_ARGUMENT = 4   /* a parameter, interval or option out of range */
};

typedef struct {
    double tolerance;          /* force error that one step may make, N */
    double dead_band;          /* friction, m/s */
    long max_steps_per_sample;
} df_options;

typedef struct {
    long steps, rejected, newton;
    size_t failed_sample; /* where it ended, when not DF_OK */
} df_work;

/* A jump of the speed, in order of time; at a sample, that has the speed after it. */
typedef struct {
    double at, x, before, after; /* samples from the first, above 0; m, m/s */
} df_jump;

typedef struct {
    size_t n;
    double interval;      /* s */
    const double *x, *v;  /* n each; between samples and jumps x is the cubic Hermite piece */
    size_t n_jumps;
    const df_jump *jumps;
} df_motion;

/* Where the results go; n doubles a row. */
typedef struct {
    double *pressures;     /* 3 rows: P1, P2, P3 */
    double *masses;        /* 2 rows: m1, m2 */
    double *force;         /* 1 row */
    double *sensitivities; /* one row for each entry of `which`: df/d(parameter) */
    const int *which;
    int n_which;
} df_result;

#ifdef __cplusplus
}
#endif
#endif
