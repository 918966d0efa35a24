/* What a fit asks at every look, the mean cycle of a log and the triangle of a Jacobian; and of its end, the
   products of scores of several moments. */
#ifndef DAMPERFIT_FITTING_H
#define DAMPERFIT_FITTING_H

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

/* Sums over lags l < n_lags, both ways, of kernel[l] times the products of scores l apart, where a score is a
   residual times the slopes of its phase, which are the same in every cycle. residuals: n_cycles x n_phases, one
   cycle after another; slopes: n_phases x width; products: width x width; room: n_lags * n_phases + width. */
void df_cycle_products(size_t n_cycles, size_t n_phases, size_t width, size_t n_lags, const double *residuals,
                       const double *slopes, const double *kernel, double *products, double *room);

#ifdef __cplusplus
}
#endif
#endif
