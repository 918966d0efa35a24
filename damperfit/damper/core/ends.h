/* The force beside the ends of a stroke: what jumps there, and what is smooth. */
#ifndef DAMPERFIT_ENDS_H
#define DAMPERFIT_ENDS_H

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Columns of the smooth part: powers of the lag to its third, and two that bend at a kink. */
enum { DF_SMOOTH = 4, DF_BENT = 6 };

/* Takes a smooth curve of the lag (rising) out of a force. columns: n rows of the n_smooth columns,
   each of size 1 and square to the others, and behind them what they leave of the force; a column
   that the others make up is 0. sums: n + 1 rows, the columns added up before each sample. Returns
   the square of what is left. n_smooth: DF_SMOOTH, or DF_BENT with a bend at `kink`; n >= 1. */
double df_without_smooth(size_t n, const double *lag, const double *force, double reach,
                         int n_smooth, double kink, double *columns, double *sums);

/* Steps from -1 to 1 at each delay, of a width (tanh; 0: sharp), laid on what a smooth part leaves:
   what they leave of the power, and their heights. A step whose own power, the smooth part taken
   out, is below `least` a sample has none. scratch: n. */
void df_steps(size_t n, const double *lag, int n_smooth, const double *columns, const double *sums,
              double power, double width, double least, size_t n_delays, const double *delays,
              double *rest, double *heights, double *scratch);

#ifdef __cplusplus
}
#endif
#endif
