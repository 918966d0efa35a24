/* What is done to sampled signals: recursive filters, slopes of splines, values between samples, turns.
 * Here and not by SciPy, for `scipy.signal` takes 0.7 s to load, and each of these runs at every log or fit. */
#ifndef DAMPERFIT_SIGNALS_H
#define DAMPERFIT_SIGNALS_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Sections of second order: b0 b1 b2 1 a1 a2 of each; steady: its state for a constant 1. */
enum { DF_MOST_SECTIONS = 32, DF_SECTION_ROW = 6, DF_STEADY_ROW = 2 };

typedef struct {
    int n;
    const double *rows, *steady;
} df_sections;

/* Filters n samples once, or back to front where backward is not 0; begins in the steady state of
   the sample that comes first. In place is allowed. */
void df_filter_once(const df_sections *f, size_t n, const double *in, double *out, int backward);

/* Filters forward and backward, both ends continued by odd reflection over pad < n samples.
   scratch: n + 2 pad. */
void df_filter_both(const df_sections *f, size_t n, size_t pad, const double *in, double *out,
                    double *scratch);

/* A first-order lag of each of some signals, one behind the other in memory, at rest before its first
   sample: g(k) = a g(k-1) + b f(k) + c f(k-1). In place is allowed. */
typedef struct {
    double a, b, c;
} df_lag;
void df_behind_lag(const df_lag *lag, size_t rows, size_t n, const double *in, double *out);

/* Slopes of the cubic spline through n >= 4 samples, without a knot at the second from either end;
   by sample. scratch: n. */
void df_spline_slopes(size_t n, const double *y, double *slopes, double *scratch);

/* Values of rows of n samples at fractional ones, through the eight around each; n >= 8. */
void df_between(size_t n, size_t n_rows, const double *y, size_t n_at, const double *at,
                double *values);

/* Samples at which x turns, peaks and valleys by turns; a turn counts where the way back from it is
   more than reach. turns: n; returns how many. */
size_t df_turns(size_t n, const double *x, double reach, int64_t *turns);

#ifdef __cplusplus
}
#endif
#endif
