/* Mean cycles, what signals are at given speeds, triangles of columns. */
#ifndef DAMPERFIT_REPEATS_H
#define DAMPERFIT_REPEATS_H

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

enum { DF_FOLDED = 3 };

/* The mean cycle of displacement, velocity and force, n >= 8 samples each, at n_phases places of a cycle, by
   the polynomial through the eight samples around each place. starts: n_cycles + 1, fractional samples.
   means: 3 x n_phases; beside: squares of the force less its mean, summed over the cycles; room: n_cycles. */
void df_fold(size_t n, const double *const y[DF_FOLDED], size_t n_cycles, const double *starts, size_t n_phases,
             double *means, double *beside, double *room);

/* R of columns of n >= width numbers each, by Householder's reflections, zeros below its diagonal.
   columns: width x n, written over; triangle: width x width. */
void df_triangle(size_t n, size_t width, double *columns, double *triangle);

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
