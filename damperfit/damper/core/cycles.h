/* What is read off sampled motions: passages, turns, harmonics. */
#ifndef DAMPERFIT_CYCLES_H
#define DAMPERFIT_CYCLES_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

enum { DF_MOST_HARMONICS = 16 };

/* Fractional samples at which y = sign (x - level) rises through 0, from -reach to +reach, by the
   Hermite piece of y and v (by sample). at: n/2 + 1; returns how many. */
size_t df_crossings(size_t n, const double *x, const double *v, double level, double sign,
                    double reach, double *at);

/* The top of y in each cycle between boundaries (in samples, rising, n_tops + 1 of them): of the
   Hermite piece beside its highest sample. n >= 2. */
void df_tops(size_t n, const double *x, const double *v, double level, double sign, size_t n_tops,
             const double *boundaries, double *tops);

/* Samples at which x turns, peaks and valleys by turns; a turn counts where the way back from it is
   more than reach. turns: n; returns how many. */
size_t df_turns(size_t n, const double *x, double reach, int64_t *turns);

/* Where each way from turn to turn passes its middle. turns: rising, below the samples of x;
   at: n_turns - 1. */
void df_passages(const double *x, size_t n_turns, const int64_t *turns, double *at);

/* Each sample less the median of the five around it; 0 at both ends. */
void df_outstanding(size_t n, const double *y, double *outstanding);

/* The value of a rank, 0 the least; reorders values, those before the rank are not above it.
   rank < n, and no value that is no number. */
double df_rank(size_t n, double *values, size_t rank);

/* Square of the mean of y - mean turned by k angles a sample, k = 1 to n_powers. */
void df_harmonics(size_t n, const double *y, double mean, double angle, int n_powers,
                  double *powers);

#ifdef __cplusplus
}
#endif
#endif
