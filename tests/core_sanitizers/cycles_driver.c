/* Drives cycles.c at its smallest and its oddest sizes; a sanitizer ends the program. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "cycles.h"
#include "signals.h"

enum { MOST = 40, ODD = 4 };

static const double ODDITIES[ODD] = {NAN, INFINITY, -INFINITY, 1e300};

static double *wave(size_t n, int odd)
{
    double *y = malloc((n ? n : 1) * sizeof *y);
    for (size_t k = 0; k < n; k++)
        y[k] = odd && k % 7 == 3 ? ODDITIES[k / 7 % ODD] : sin(1.3 * (double)k);
    return y;
}

static void marks(size_t n, int odd)
{
    double *x = wave(n, odd), *v = wave(n, 0), *at = malloc((n / 2 + 1) * sizeof *at);
    int64_t *turns = malloc((n ? n : 1) * sizeof *turns);
    if (df_crossings(n, x, v, 0.1, -1.0, 0.1, at) > n / 2 || df_crossings(n, x, v, 0.0, 1.0, 0.1, at) > n / 2)
        abort();
    const size_t n_turns = df_turns(n, x, 0.1, turns);
    if (n_turns > n)
        abort();
    if (n >= 2) {
        const double boundaries[] = {-3.0, 0.5, 0.5, (double)n - 1.0, (double)n + 9.0, NAN, INFINITY};
        double tops[sizeof boundaries / sizeof *boundaries - 1];
        df_tops(n, x, v, 0.1, odd ? -1.0 : 1.0, sizeof tops / sizeof *tops, boundaries, tops);
    }
    free(x);
    free(v);
    free(at);
    free(turns);
}

static void two_filtered(size_t n, size_t pad)
{
    static const double rows[] = {0.1, 0.2, 0.1, 1.0, -1.2, 0.5, 1.0, 1.0, 0.0, 1.0, -0.3, 0.0};
    static const double steady[] = {1.2, -0.4, 2.0, 0.0};
    const df_sections f = {2, rows, steady};
    double *in = wave(2 * n, 0), *out = malloc(2 * n * sizeof *out), *one = malloc(n * sizeof *one);
    double *scratch = malloc(2 * (n + 2 * pad) * sizeof *scratch);
    df_filter_two_both(&f, n, pad, in, out, scratch);
    df_filter_both(&f, n, pad, in + n, one, scratch);
    for (size_t k = 0; k < n; k++)
        if (one[k] != out[n + k])
            abort();
    free(in);
    free(out);
    free(one);
    free(scratch);
}

int main(void)
{
    for (int odd = 0; odd < 2; odd++)
        for (size_t n = 0; n < MOST; n++)
            marks(n, odd);
    for (size_t n = 2; n < MOST; n++)
        for (size_t pad = 0; pad < n; pad++)
            two_filtered(n, pad);
    puts("ok");
    return 0;
}
