/* Drives signals.c at its smallest and its oddest sizes; a sanitizer ends the program. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "signals.h"

enum { MOST = 64 };

static void filters(size_t n, size_t pad)
{
    static const double rows[] = {0.1, 0.2, 0.1, 1.0, -1.2, 0.5, 1.0, 1.0, 0.0, 1.0, -0.3, 0.0};
    static const double steady[] = {1.2, -0.4, 2.0, 0.0};
    const df_sections f = {2, rows, steady};
    double *in = malloc(n * sizeof *in), *out = malloc(n * sizeof *out);
    double *scratch = malloc((n + 2 * pad) * sizeof *scratch);
    for (size_t k = 0; k < n; k++)
        in[k] = sin(0.3 * (double)k);
    df_filter_both(&f, n, pad, in, out, scratch);
    df_filter_once(&f, n, in, in, 1);
    df_filter_once(&f, 0, in, in, 0);
    free(in);
    free(out);
    free(scratch);
}

static void between(size_t n)
{
    static const double at[] = {-1e300, -0.5, 0.0, 3.5, 6.9999, 7.0, 1e300, NAN, INFINITY, -INFINITY};
    double *y = malloc(n * sizeof *y), values[sizeof at / sizeof *at];
    for (size_t k = 0; k < n; k++)
        y[k] = (double)(k * k);
    df_between(n, 1, y, sizeof at / sizeof *at, at, values);
    if (fabs(values[3] - 12.25) > 1e-9)
        abort();
    free(y);
}

/* In place too. */
static void lags(size_t rows, size_t n)
{
    const df_lag lag = {0.5, 0.3, 0.2};
    double *in = malloc((rows * n + 1) * sizeof *in), *out = malloc((rows * n + 1) * sizeof *out);
    for (size_t k = 0; k < rows * n; k++)
        in[k] = (double)(k % (n ? n : 1));
    df_behind_lag(&lag, rows, n, in, out);
    df_behind_lag(&lag, rows, n, out, out);
    free(in);
    free(out);
}

/* With what is no number among the samples, too. */
static void turns(size_t n, int odd)
{
    static const double oddities[] = {NAN, INFINITY, -INFINITY, 1e300};
    double *x = malloc((n ? n : 1) * sizeof *x);
    int64_t *at = malloc((n ? n : 1) * sizeof *at);
    for (size_t k = 0; k < n; k++)
        x[k] = odd && k % 7 == 3 ? oddities[k / 7 % 4] : sin(1.3 * (double)k);
    if (df_turns(n, x, 0.1, at) > n)
        abort();
    free(x);
    free(at);
}

int main(void)
{
    for (size_t n = 0; n < MOST; n++) {
        turns(n, 0);
        turns(n, 1);
    }
    for (size_t rows = 0; rows < 10; rows++)
        for (size_t n = 0; n < 5; n++)
            lags(rows, n);
    for (size_t n = 2; n < MOST; n++)
        for (size_t pad = 0; pad < n; pad++)
            filters(n, pad);
    for (size_t n = 8; n < MOST; n++)
        between(n);
    for (size_t n = 4; n < MOST; n++) {
        double *y = malloc(n * sizeof *y), *s = malloc(n * sizeof *s), *t = malloc(n * sizeof *t);
        for (size_t k = 0; k < n; k++)
            y[k] = (double)(k * k * k);
        df_spline_slopes(n, y, s, t);
        if (fabs(s[n - 1] - 3.0 * (double)((n - 1) * (n - 1))) > 1e-6)
            abort();
        free(y);
        free(s);
        free(t);
    }
    puts("ok");
    return 0;
}
