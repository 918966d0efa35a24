/* Drives repeats.c and ends.c at their smallest and oddest sizes; a sanitizer ends the program. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "ends.h"
#include "repeats.h"

enum { MOST = 40, ODD = 4, PHASES_OF_MEAN = 7 };

static const double ODDITIES[ODD] = {NAN, INFINITY, -INFINITY, 1e300};

static double *wave(size_t n, int odd)
{
    double *y = malloc((n ? n : 1) * sizeof *y);
    for (size_t k = 0; k < n; k++)
        y[k] = odd && k % 7 == 3 ? ODDITIES[k / 7 % ODD] : sin(1.3 * (double)k);
    return y;
}

static void jumps(size_t n, int odd)
{
    static const double delays[] = {-1.0, 0.0, 0.3, 9.0};
    enum { DELAYS = sizeof delays / sizeof *delays, ROW = DF_BENT + 1 };
    double *lag = malloc(n * sizeof *lag), *force = wave(n, odd), *scratch = malloc(n * sizeof *scratch);
    double *columns = malloc(ROW * n * sizeof *columns), *sums = malloc(ROW * (n + 1) * sizeof *sums);
    double rest[DELAYS], heights[DELAYS];
    for (size_t k = 0; k < n; k++)
        lag[k] = 0.05 * (double)(k / 2) - 0.7;
    for (int n_smooth = DF_SMOOTH; n_smooth <= DF_BENT; n_smooth += DF_BENT - DF_SMOOTH) {
        const double power = df_without_smooth(n, lag, force, 1.0, n_smooth, 0.1, columns, sums);
        for (int width = 0; width < 3; width++)
            df_steps(n, lag, n_smooth, columns, sums, power, 0.1 * width, 1e-9, DELAYS, delays,
                     rest, heights, scratch);
        df_steps(n, lag, n_smooth, columns, sums, power, 0.1, 1e-9, 0, delays, rest, heights,
                 scratch);
    }
    free(lag);
    free(force);
    free(scratch);
    free(columns);
    free(sums);
}

static void passed(size_t n, int odd)
{
    static const double speeds[] = {-3.0, 0.0, 0.2, 0.2, 9.0};
    enum { SPEEDS = sizeof speeds / sizeof *speeds, ROWS = 2 };
    double counts[2 * SPEEDS], means[2 * SPEEDS * ROWS], squares[2 * SPEEDS * ROWS];
    double *v = wave(ROWS * n, odd);
    for (int sign = -1; sign < 2; sign += 2) {
        df_at_speeds(n, v, sign, SPEEDS, speeds, ROWS, v, counts, means, squares);
        df_at_speeds(n, v, sign, 0, speeds, ROWS, v, counts, means, squares);
    }
    free(v);
}

static void fold(size_t n)
{
    static const double starts[] = {-1e300, -0.5, 3.0, 7.25, 1e300, NAN, INFINITY, -INFINITY};
    enum { CYCLES = sizeof starts / sizeof *starts - 1 };
    double *x = malloc(n * sizeof *x), means[DF_FOLDED * PHASES_OF_MEAN], beside[PHASES_OF_MEAN], room[CYCLES];
    for (size_t k = 0; k < n; k++)
        x[k] = (double)(k * k);
    const double *const y[DF_FOLDED] = {x, x, x};
    df_fold(n, y, CYCLES, starts, PHASES_OF_MEAN, means, beside, room);
    df_fold(n, y, 1, starts + 2, PHASES_OF_MEAN, means, beside, room);
    if (fabs(means[0] - 9.0) > 1e-9 || beside[0] != 0.0)
        abort();
    free(x);
}

int main(void)
{
    for (size_t n = 8; n < MOST; n++)
        fold(n);
    for (int odd = 0; odd < 2; odd++)
        for (size_t n = 1; n < MOST; n++) {
            jumps(n, odd);
            passed(n, odd);
        }
    puts("ok");
    return 0;
}
