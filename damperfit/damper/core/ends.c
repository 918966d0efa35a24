/* Smooth columns and steps beside the ends of a stroke. No allocation, no globals, re-entrant. */
#include "ends.h"

#include <math.h>

static const double MADE_UP = 1e-10; /* of a column's size: the others make it up */
static const double FAR = 20.0;      /* widths; beyond, a tanh is 1 to the last digit */

/* Takes the first `at` columns out of column `at`; twice, so that no rounding of theirs is left. */
static void square_to_others(size_t n, int row, double *columns, int at)
{
    for (int pass = 0; pass < 2; pass++) {
        double along[DF_BENT] = {0.0};
        for (size_t k = 0; k < n; k++)
            for (int one = 0; one < at; one++)
                along[one] += columns[k * row + one] * columns[k * row + at];
        for (size_t k = 0; k < n; k++) {
            double sum = 0.0;
            for (int one = 0; one < at; one++)
                sum += along[one] * columns[k * row + one];
            columns[k * row + at] -= sum;
        }
    }
}

static double power_of(size_t n, int row, const double *columns, int at)
{
    double sum = 0.0;
    for (size_t k = 0; k < n; k++)
        sum += columns[k * row + at] * columns[k * row + at];
    return sum;
}

double df_without_smooth(size_t n, const double *lag, const double *force, double reach,
                         int n_smooth, double kink, double *columns, double *sums)
{
    const int row = n_smooth + 1;
    for (size_t k = 0; k < n; k++) {
        double *to = columns + k * row;
        const double z = lag[k] / reach, bent = z - kink / reach;
        const double all[DF_BENT] = {1.0, z, z * z, z * z * z, fabs(bent), bent * fabs(bent)};
        for (int one = 0; one < n_smooth; one++)
            to[one] = all[one];
        to[n_smooth] = force[k];
    }
    for (int one = 0; one < n_smooth; one++) {
        const double before = sqrt(power_of(n, row, columns, one));
        square_to_others(n, row, columns, one);
        const double size = sqrt(power_of(n, row, columns, one));
        const double by = size > MADE_UP * before ? 1.0 / size : 0.0;
        for (size_t k = 0; k < n; k++)
            columns[k * row + one] *= by;
    }
    square_to_others(n, row, columns, n_smooth);
    for (int one = 0; one < row; one++)
        sums[one] = 0.0;
    for (size_t k = 0; k < n; k++)
        for (int one = 0; one < row; one++)
            sums[(k + 1) * row + one] = sums[k * row + one] + columns[k * row + one];
    return power_of(n, row, columns, n_smooth);
}

/* The first sample whose lag is not below a value, or is above it. */
static size_t first_from(size_t n, const double *lag, double value, int is_above)
{
    size_t low = 0, high = n;
    while (low < high) {
        const size_t at = low + (high - low) / 2;
        if (lag[at] < value || (is_above && lag[at] == value))
            low = at + 1;
        else
            high = at;
    }
    return low;
}

static inline void steps(size_t n, const double *lag, int n_smooth, const double *columns,
                         const double *sums, double power, double width, double least,
                         size_t n_delays, const double *delays, double *rest, double *heights,
                         double *scratch)
{
    const int row = n_smooth + 1;
    /* tanh((lag - delay)/width) = (a - b)/(a + b), with an exponential for each of the two. */
    const double middle = n_delays ? delays[n_delays / 2] : 0.0;
    for (size_t k = 0; width > 0.0 && k < n; k++)
        scratch[k] = exp(2.0 * (lag[k] - middle) / width);
    for (size_t at = 0; at < n_delays; at++) {
        const size_t first = first_from(n, lag, delays[at] - FAR * width, 0);
        const size_t stop = first_from(n, lag, delays[at] + FAR * width, 1);
        const double *low = sums + first * row, *high = sums + stop * row, *all = sums + n * row;
        double size = (double)(n - (stop - first)), along[DF_BENT + 1];
        for (int one = 0; one < row; one++)
            along[one] = all[one] - high[one] - low[one];
        const double here = width > 0.0 ? exp(2.0 * (delays[at] - middle) / width) : 0.0;
        for (size_t k = first; width > 0.0 && k < stop; k++) {
            const double step = (scratch[k] - here) / (scratch[k] + here);
            size += step * step;
            for (int one = 0; one < row; one++)
                along[one] += columns[k * row + one] * step;
        }
        /* What the smooth part takes of the step, by Pythagoras. */
        for (int one = 0; one < n_smooth; one++)
            size -= along[one] * along[one];
        const int is_told = size > least * (double)n;
        const double share = is_told ? along[n_smooth] : 0.0;
        size = is_told ? size : least * (double)n;
        rest[at] = power - share * share / size;
        heights[at] = share / size;
    }
}

void df_steps(size_t n, const double *lag, int n_smooth, const double *columns, const double *sums,
              double power, double width, double least, size_t n_delays, const double *delays,
              double *rest, double *heights, double *scratch)
{
    /* Inner loops of a length that is known are unrolled. */
    if (n_smooth == DF_SMOOTH)
        steps(n, lag, DF_SMOOTH, columns, sums, power, width, least, n_delays, delays, rest,
              heights, scratch);
    else
        steps(n, lag, DF_BENT, columns, sums, power, width, least, n_delays, delays, rest, heights,
              scratch);
}
