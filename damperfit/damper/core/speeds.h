/* What signals are where a velocity passes given speeds. */
#ifndef DAMPERFIT_SPEEDS_H
#define DAMPERFIT_SPEEDS_H

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Signals (n_rows of n samples) on the straight lines between samples where sign v passes speeds,
   which rise; on the way up, then on the way down. Of each way and speed: how often (counts, 2 x
   n_speeds), mean, and sum of squares about the mean (means, squares: 2 x n_speeds x n_rows); of what
   is never passed 0. */
void df_at_speeds(size_t n, const double *v, double sign, size_t n_speeds, const double *speeds,
                  size_t n_rows, const double *rows, double *counts, double *means, double *squares);

#ifdef __cplusplus
}
#endif
#endif
