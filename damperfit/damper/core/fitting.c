/* What a fit asks at every look. No allocation, no globals, re-entrant. */
#include "fitting.h"

#include "taps.h"

#include <math.h>

/* Sums side by side: one waits for its own last sum alone. */
enum { SUMS = 8 };

/* Squares between these have lost no digit. */
#define TINY 1e-250
#define HUGE_SQUARE 1e250

void df_fold(size_t n, const double *const y[DF_FOLDED], size_t n_cycles, const double *starts, size_t n_phases,
             double *means, double *beside, double *room)
{
    for (size_t phase = 0; phase < n_phases; phase++) {
        const double share = (double)phase / (double)n_phases;
        double sums[DF_FOLDED] = {0.0}, squares = 0.0, weight[DF_TAPS];
        for (size_t cycle = 0; cycle < n_cycles; cycle++) {
            const size_t first = df_weigh_taps(n, starts[cycle] + (starts[cycle + 1] - starts[cycle]) * share, weight);
            for (size_t row = 0; row < DF_FOLDED; row++)
                sums[row] += room[cycle] = df_weighed(weight, y[row] + first); /* the last row's, the force, stays */
        }
        for (size_t row = 0; row < DF_FOLDED; row++)
            means[row * n_phases + phase] = sums[row] / (double)n_cycles;
        const double force = means[(DF_FOLDED - 1) * n_phases + phase];
        for (size_t cycle = 0; cycle < n_cycles; cycle++)
            squares += (room[cycle] - force) * (room[cycle] - force);
        beside[phase] = squares;
    }
}

static double product(size_t n, const double *a, const double *b)
{
    double sums[SUMS] = {0.0}, rest = 0.0;
    size_t k = 0;
    for (; k + SUMS <= n; k += SUMS)
        for (int l = 0; l < SUMS; l++)
            sums[l] += a[k + l] * b[k + l];
    for (; k < n; k++)
        rest += a[k] * b[k];
    for (int l = 0; l < SUMS; l++)
        rest += sums[l];
    return rest;
}

/* Also where squares overflow or vanish. */
static double length(size_t n, const double *a)
{
    const double squares = product(n, a, a);
    if (squares != squares || (squares > TINY && squares < HUGE_SQUARE))
        return sqrt(squares);
    double most = 0.0, sum = 0.0;
    for (size_t k = 0; k < n; k++)
        most = fabs(a[k]) > most ? fabs(a[k]) : most;
    if (!(most > 0.0 && most < INFINITY))
        return most;
    for (size_t k = 0; k < n; k++)
        sum += (a[k] / most) * (a[k] / most);
    return most * sqrt(sum);
}

void df_triangle(size_t n, size_t width, double *columns, double *triangle)
{
    for (size_t j = 0; j < width; j++) {
        double *v = columns + j * n + j + 1;
        const size_t below = n - j - 1;
        const double top = v[-1], size = length(below, v);
        const double diagonal = size == 0.0 ? top : -copysign(hypot(top, size), top);
        const double times = size == 0.0 ? 0.0 : (diagonal - top) / diagonal;
        for (size_t c = 0; c < j; c++)
            triangle[j * width + c] = 0.0;
        triangle[j * width + j] = diagonal;
        for (size_t k = 0; k < below && size != 0.0; k++)
            v[k] /= top - diagonal;
        for (size_t c = j + 1; c < width; c++) {
            double *y = columns + c * n + j;
            if (size != 0.0) {
                const double along = times * (y[0] + product(below, v, y + 1));
                y[0] -= along;
                for (size_t k = 0; k < below; k++)
                    y[k + 1] -= along * v[k];
            }
            triangle[j * width + c] = y[0];
        }
    }
}

/* Sums over the cycles of residuals at each phase times those a lag later, which may be in the next cycle. */
static void lagged(size_t n_cycles, size_t n_phases, size_t lag, const double *residuals, double *sums)
{
    const size_t n = n_cycles * n_phases;
    for (size_t phase = 0; phase < n_phases; phase++)
        sums[phase] = 0.0;
    for (size_t first = 0; first + lag < n; first += n_phases) {
        const size_t left = n - lag - first, few = left < n_phases ? left : n_phases;
        const double *now = residuals + first, *later = now + lag;
        for (size_t phase = 0; phase < few; phase++)
            sums[phase] += now[phase] * later[phase];
    }
}

void df_cycle_products(size_t n_cycles, size_t n_phases, size_t width, size_t n_lags, const double *residuals,
                       const double *slopes, const double *kernel, double *products, double *room)
{
    double *ahead = room + n_lags * n_phases; /* slopes of what follows a phase, weighed */
    for (size_t lag = 0; lag < n_lags; lag++)
        lagged(n_cycles, n_phases, lag, residuals, room + lag * n_phases);
    for (size_t k = 0; k < width * width; k++)
        products[k] = 0.0;
    for (size_t phase = 0; phase < n_phases; phase++) {
        for (size_t b = 0; b < width; b++)
            ahead[b] = 0.0;
        for (size_t lag = 0, then = phase; lag < n_lags; lag++) {
            const double share = (lag ? 1.0 : 0.5) * kernel[lag] * room[lag * n_phases + phase];
            const double *slope = slopes + then * width;
            for (size_t b = 0; b < width; b++)
                ahead[b] += share * slope[b];
            then = then + 1 < n_phases ? then + 1 : 0;
        }
        for (size_t a = 0; a < width; a++)
            for (size_t b = 0; b < width; b++)
                products[a * width + b] += slopes[phase * width + a] * ahead[b];
    }
    for (size_t a = 0; a < width; a++) /* the same backwards */
        for (size_t b = 0; b <= a; b++)
            products[a * width + b] = products[b * width + a] = products[a * width + b] + products[b * width + a];
}
