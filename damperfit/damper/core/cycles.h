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

#ifdef __cplusplus
}
#endif
#endif
