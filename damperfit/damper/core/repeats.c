/* Mean cycles, what signals are at given speeds, triangles of columns. No allocation, re-entrant. */
#include "repeats.h"

#include "taps.h"

#include <math.h>

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

/* Sums side by side: one waits for its own last sum alone. */
enum { SUMS = 8 };

/* Squares between these have lost no digit. */
#define TINY 1e-250
#define HUGE_SQUARE 1e250

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

void df_at_speeds(size_t n, const double *v, double sign, size_t n_speeds, const double *speeds,
                  size_t n_rows, const double *rows, double *counts, double *means, double *squares)
{
    for (size_t k = 0; k < 2 * n_speeds; k++)
        counts[k] = 0.0;
    for (size_t k = 0; k < 2 * n_speeds * n_rows; k++)
        means[k] = squares[k] = 0.0;
    size_t reached = 0; /* speeds that are not above the last velocity */
    for (size_t at = 0; at < n; at++) {
        const double ahead = sign * v[at];
        size_t now = reached;
        while (now < n_speeds && speeds[now] <= ahead)
            now++;
        while (now > 0 && speeds[now - 1] > ahead)
            now--;
        const int falls = now < reached;
        const size_t end = falls ? reached : now;
        for (size_t one = falls ? now : reached; at > 0 && one < end; one++) {
            const size_t place = (size_t)falls * n_speeds + one;
            const double before = sign * v[at - 1] - speeds[one];
            const double share = before / (before - (ahead - speeds[one]));
            counts[place] += 1.0;
            for (size_t row = 0; row < n_rows; row++) {
                const double *y = rows + row * n + at;
                double *mean = means + place * n_rows + row;
                const double there = y[-1] + share * (y[0] - y[-1]), off = there - *mean;
                *mean += off / counts[place];
                squares[place * n_rows + row] += off * (there - *mean);
            }
        }
        reached = now;
    }
}
