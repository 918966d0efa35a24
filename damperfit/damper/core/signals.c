/* Filters, spline slopes and interpolation. No allocation, no globals, re-entrant. */
#include "signals.h"

#include <math.h>

enum { TAPS = 8, LAGGED = 4 };

void df_filter_once(const df_sections *f, size_t n, const double *in, double *out, int backward)
{
    double z[DF_MOST_SECTIONS][2];
    if (!n)
        return;
    const double first = in[backward ? n - 1 : 0];
    for (int k = 0; k < f->n; k++) {
        z[k][0] = f->steady[DF_STEADY_ROW * k] * first;
        z[k][1] = f->steady[DF_STEADY_ROW * k + 1] * first;
    }
    for (size_t step = 0; step < n; step++) {
        const size_t at = backward ? n - 1 - step : step;
        double x = in[at];
        for (int k = 0; k < f->n; k++) {
            const double *s = f->rows + DF_SECTION_ROW * k;
            const double y = s[0] * x + z[k][0];
            z[k][0] = s[1] * x - s[4] * y + z[k][1];
            z[k][1] = s[2] * x - s[5] * y;
            x = y;
        }
        out[at] = x;
    }
}

void df_filter_both(const df_sections *f, size_t n, size_t pad, const double *in, double *out,
                    double *scratch)
{
    for (size_t k = 0; k < pad; k++) {
        scratch[k] = 2.0 * in[0] - in[pad - k];
        scratch[pad + n + k] = 2.0 * in[n - 1] - in[n - 2 - k];
    }
    for (size_t k = 0; k < n; k++)
        scratch[pad + k] = in[k];
    df_filter_once(f, n + 2 * pad, scratch, scratch, 0);
    df_filter_once(f, n + 2 * pad, scratch, scratch, 1);
    for (size_t k = 0; k < n; k++)
        out[k] = scratch[pad + k];
}

/* As df_filter_once, two signals side by side: one waits for its own last sample, two do not. */
static void filter_two(const df_sections *f, size_t n, double *both, int backward)
{
    double z[DF_MOST_SECTIONS][2][2];
    const double *first = both + (backward ? 2 * (n - 1) : 0);
    for (int k = 0; k < f->n; k++)
        for (int one = 0; one < 2; one++) {
            z[k][0][one] = f->steady[DF_STEADY_ROW * k] * first[one];
            z[k][1][one] = f->steady[DF_STEADY_ROW * k + 1] * first[one];
        }
    for (size_t step = 0; step < n; step++) {
        double *at = both + 2 * (backward ? n - 1 - step : step);
        double x[2] = {at[0], at[1]};
        for (int k = 0; k < f->n; k++) {
            const double *s = f->rows + DF_SECTION_ROW * k;
            for (int one = 0; one < 2; one++) {
                const double y = s[0] * x[one] + z[k][0][one];
                z[k][0][one] = s[1] * x[one] - s[4] * y + z[k][1][one];
                z[k][1][one] = s[2] * x[one] - s[5] * y;
                x[one] = y;
            }
        }
        at[0] = x[0];
        at[1] = x[1];
    }
}

void df_filter_two_both(const df_sections *f, size_t n, size_t pad, const double *in, double *out,
                        double *scratch)
{
    for (size_t one = 0; one < 2; one++) {
        const double *y = in + one * n;
        for (size_t k = 0; k < pad; k++) {
            scratch[2 * k + one] = 2.0 * y[0] - y[pad - k];
            scratch[2 * (pad + n + k) + one] = 2.0 * y[n - 1] - y[n - 2 - k];
        }
        for (size_t k = 0; k < n; k++)
            scratch[2 * (pad + k) + one] = y[k];
    }
    filter_two(f, n + 2 * pad, scratch, 0);
    filter_two(f, n + 2 * pad, scratch, 1);
    for (size_t k = 0; k < n; k++) {
        out[k] = scratch[2 * (pad + k)];
        out[n + k] = scratch[2 * (pad + k) + 1];
    }
}

/* Few rows side by side: each waits for its own last sample alone. */
static void lag_rows(const df_lag *lag, size_t rows, size_t n, const double *in, double *out)
{
    double f[LAGGED], g[LAGGED];
    for (size_t j = 0; j < rows; j++)
        out[j * n] = f[j] = g[j] = in[j * n];
    for (size_t k = 1; k < n; k++) {
        for (size_t j = 0; j < rows; j++) {
            const double now = in[j * n + k];
            g[j] = lag->a * g[j] + (lag->b * now + lag->c * f[j]);
            f[j] = now;
            out[j * n + k] = g[j];
        }
    }
}

void df_behind_lag(const df_lag *lag, size_t rows, size_t n, const double *in, double *out)
{
    size_t j = 0;
    for (; n && j + LAGGED <= rows; j += LAGGED)
        lag_rows(lag, LAGGED, n, in + j * n, out + j * n);
    for (; n && j < rows; j++)
        lag_rows(lag, 1, n, in + j * n, out + j * n);
}

void df_lag_slope(const df_lag *lag, double by_a, double by_mean, size_t n, const double *in, const double *behind,
                  double *slope)
{
    double s = 0.0;
    for (size_t k = 0; k < n; k++) {
        if (k)
            s = lag->a * s + (by_a * (behind[k - 1] - in[k - 1]) + by_mean * (in[k - 1] - in[k]));
        slope[k] = s;
    }
}

void df_spline_slopes(size_t n, const double *y, double *slopes, double *scratch)
{
    /* s0 + 2 s1 = (5 m0 + m1)/2, s(i-1) + 4 s(i) + s(i+1) = 3 (y(i+1) - y(i-1)), and the first
       row mirrored; eliminated from the top, where no pivot is needed: after the first row the
       diagonal is 2, then above 3. */
    slopes[0] = 0.5 * (5.0 * (y[1] - y[0]) + (y[2] - y[1]));
    scratch[0] = 2.0;
    for (size_t k = 1; k + 1 < n; k++) {
        const double pivot = 4.0 - scratch[k - 1];
        scratch[k] = 1.0 / pivot;
        slopes[k] = (3.0 * (y[k + 1] - y[k - 1]) - slopes[k - 1]) / pivot;
    }
    const double right = 0.5 * (5.0 * (y[n - 1] - y[n - 2]) + (y[n - 2] - y[n - 3]));
    slopes[n - 1] = (right - 2.0 * slopes[n - 2]) / (1.0 - 2.0 * scratch[n - 2]);
    for (size_t k = n - 1; k-- > 0;)
        slopes[k] -= scratch[k] * slopes[k + 1];
}

void df_between(size_t n, size_t n_rows, const double *y, size_t n_at, const double *at,
                double *values)
{
    /* One over the products of the differences of the taps: Lagrange's denominators. */
    static const double SHARE[TAPS] = {-1.0 / 5040.0, 1.0 / 720.0, -1.0 / 240.0, 1.0 / 144.0,
                                       -1.0 / 144.0,  1.0 / 240.0, -1.0 / 720.0, 1.0 / 5040.0};
    const double last = (double)(n - TAPS);
    for (size_t k = 0; k < n_at; k++) {
        /* The comparisons are written so that a position that is no number ends inside too. */
        double first = at[k] > TAPS / 2 - 1 ? at[k] - (TAPS / 2 - 1) : 0.0;
        first = first < last ? (double)(size_t)first : last;
        double before[TAPS], weight[TAPS], after = 1.0;
        before[0] = 1.0;
        for (int tap = 1; tap < TAPS; tap++)
            before[tap] = before[tap - 1] * (at[k] - first - (tap - 1));
        for (int tap = TAPS - 1; tap >= 0; tap--) {
            weight[tap] = SHARE[tap] * before[tap] * after;
            after *= at[k] - first - tap;
        }
        const double *from = y + (size_t)first;
        for (size_t row = 0; row < n_rows; row++, from += n) {
            double sum = 0.0;
            for (int tap = TAPS - 1; tap >= 0; tap--)
                sum += weight[tap] * from[tap];
            values[row * n_at + k] = sum;
        }
    }
}
