/* What cycles laid over each other tell, and sums over the strokes of a motion. */
#ifndef DAMPERFIT_REPEATS_H
#define DAMPERFIT_REPEATS_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

enum { DF_LAGS = 4, DF_BESIDE = 4, DF_STROKE_COLUMNS = 7 };

/* Cycles laid over each other: y, n >= 4 samples, read at each phase (0 to 1) of each cycle by the
   cubic through four samples. folded: n_cycles x n_phases; lags: sums over all places of the
   products of weights 0 to 3 samples apart. Returns the mean over the phases of the cycles'
   variance, two cycles at least. */
double df_scatter(size_t n, const double *y, size_t n_cycles, const double *starts, size_t n_phases,
                  const double *phases, double *folded, double *lags);

/* Products, summed over all phases, of what displacement, velocity, its square with its sign, and
   force of each cycle differ by from their means over the cycles. products: 4 x 4; room:
   4 (n_cycles + n). */
void df_beside(size_t n, const double *x, const double *v, const double *f, size_t n_cycles,
               const double *starts, size_t n_phases, double *products, double *room);

/* Products of the columns 1, x/span, sign of v, and v/fastest and its square in rebound and in bump
   apart; and what they are along the force less `found` of each. products: 7 x 7. */
void df_strokes(size_t n, const double *x, const double *v, const double *f, double span,
                double fastest, const double *found, double *products, double *along);

enum { DF_FOLDED = 3 };

/* The mean cycle of displacement, velocity and force, n >= 8 samples each, at n_phases places of a cycle, by
   the polynomial through the eight samples around each place. starts: n_cycles + 1, fractional samples.
   means: 3 x n_phases; beside: squares of the force less its mean, summed over the cycles; room: n_cycles. */
void df_fold(size_t n, const double *const y[DF_FOLDED], size_t n_cycles, const double *starts, size_t n_phases,
             double *means, double *beside, double *room);

/* R of columns of n >= width numbers each, by Householder's reflections, zeros below its diagonal.
   columns: width x n, written over; triangle: width x width. */
void df_triangle(size_t n, size_t width, double *columns, double *triangle);

#ifdef __cplusplus
}
#endif
#endif
