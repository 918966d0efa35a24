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

/* Mean of the straight lines through samples, n >= 2, between each two of n_means + 1 boundaries. */
void df_cycle_means(size_t n, const double *y, size_t n_means, const double *boundaries,
                    double *means);

/* Products of the columns 1, x/span, sign of v, and v/fastest and its square in rebound and in bump
   apart; and what they are along the force less `found` of each. products: 7 x 7. */
void df_strokes(size_t n, const double *x, const double *v, const double *f, double span,
                double fastest, const double *found, double *products, double *along);

/* Median of the fifth differences' sizes; NaN of five samples and less. scratch: n. */
double df_rough(size_t n, const double *y, double *scratch);

/* Sorts finite values by their bits, eleven at a time: what is compared makes a processor guess.
   room: n. */
void df_sort(size_t n, double *values, double *room);

/* Of the steps above a bar between sorted values the one that a fiftieth of them is not above; 0
   where there is none. scratch: n. */
double df_step(size_t n, const double *order, double bar, double *scratch);

/* Equal samples in a row, `fewest` (2 or more) at least: begins and ends, n/fewest + 1 of each. */
size_t df_equal_runs(size_t n, const double *y, size_t fewest, int64_t *begins, int64_t *ends);

#ifdef __cplusplus
}
#endif
#endif
