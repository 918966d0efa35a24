/* Drives fitting.c at its smallest and its oddest sizes; a sanitizer ends the program. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "fitting.h"

enum { MOST = 40, WIDTH = 5, PHASES = 7 };

static void fold(size_t n)
{
    static const double starts[] = {-1e300, -0.5, 3.0, 7.25, 1e300, NAN, INFINITY, -INFINITY};
    enum { CYCLES = sizeof starts / sizeof *starts - 1 };
    double *x = malloc(n * sizeof *x), means[DF_FOLDED * PHASES], beside[PHASES], room[CYCLES];
    for (size_t k = 0; k < n; k++)
        x[k] = (double)(k * k);
    const double *const y[DF_FOLDED] = {x, x, x};
    df_fold(n, y, CYCLES, starts, PHASES, means, beside, room);
    df_fold(n, y, 1, starts + 2, PHASES, means, beside, room);
    if (fabs(means[0] - 9.0) > 1e-9 || beside[0] != 0.0)
        abort();
    free(x);
}

static void triangle(size_t n, size_t width, double size)
{
    double *columns = malloc(n * width * sizeof *columns), *found = malloc(width * width * sizeof *found);
    for (size_t k = 0; k < n * width; k++)
        columns[k] = size * cos(1.7 * (double)(k * k));
    df_triangle(n, width, columns, found);
    if (size == 1.0 && !isfinite(found[0]))
        abort();
    free(columns);
    free(found);
}

int main(void)
{
    for (size_t n = 8; n < MOST; n++)
        fold(n);
    for (size_t width = 1; width <= WIDTH; width++)
        for (size_t n = width; n < MOST; n++)
            for (int odd = 0; odd < 5; odd++)
                triangle(n, width, (const double[]){1.0, 0.0, 1e-300, 1e300, NAN}[odd]);
    puts("ok");
    return 0;
}
