/* Filters, spline slopes, interpolation and turns. No allocation, no globals, re-entrant. */
#include "signals.h"
#include "taps.h"

#include <math.h>

enum { USUAL = 2 }; /* sections of a filter of fourth order */

/* A section with its state, which no signal can lie over in memory. With y = b0 x + z0, z0 = b1 x' - a1 y' + z1 of the sample before, only a product and a
   difference wait for the sample before: p = b1 x' + z1 needs no y'. */
typedef struct {
    double b0, b1, b2, a1, a2, p, z1, y;
} section;

/* Returns what leaves a section for what goes in. */
static inline double through(section *s, double x)
{
    const double y = (s->b0 * x + s->p) - s->a1 * s->y;
    s->p = s->b1 * x + s->z1;
    s->z1 = s->b2 * x - s->a2 * y;
    s->y = y;
    return y;
}

/* Fills sections in the steady state of a sample; `first` goes into the first one. */
static inline void settle(const df_sections *f, int sections, double first, section *to)
{
    double x = first;
    for (int k = 0; k < sections; k++) {
        const double *row = f->rows + DF_SECTION_ROW * k, *steady = f->steady + DF_STEADY_ROW * k;
        const double z0 = steady[0] * first, y = row[0] * x + z0;
        to[k] = (section){row[0], row[1], row[2], row[4], row[5], z0 + row[4] * y, steady[1] * first, y};
        x = y;
    }
}

static inline void filter_one(const df_sections *f, int sections, size_t n, const double *in, double *out,
                              int backward)
{
    section own[DF_MOST_SECTIONS];
    settle(f, sections, in[backward ? n - 1 : 0], own);
    for (size_t step = 0; step < n; step++) {
        const size_t at = backward ? n - 1 - step : step;
        double x = in[at];
        for (int k = 0; k < sections; k++)
            x = through(&own[k], x);
        out[at] = x;
    }
}

void df_filter_once(const df_sections *f, size_t n, const double *in, double *out, int backward)
{
    if (!n)
        return;
    if (f->n == USUAL) /* a number that the compiler knows keeps them in registers */
        filter_one(f, USUAL, n, in, out, backward);
    else
        filter_one(f, f->n, n, in, out, backward);
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

void df_behind_lag(const df_lag *lag, size_t rows, size_t n, const double *in, double *out)
{
    for (size_t row = 0; n && row < rows; row++, in += n, out += n) {
        double before = in[0];
        out[0] = before;
        for (size_t k = 1; k < n; k++) {
            const double now = in[k];
            out[k] = lag->a * out[k - 1] + (lag->b * now + lag->c * before);
            before = now;
        }
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
    for (size_t k = 0; k < n_at; k++) {
        double weight[DF_TAPS];
        const double *from = y + df_weigh_taps(n, at[k], weight);
        for (size_t row = 0; row < n_rows; row++, from += n)
            values[row * n_at + k] = df_weighed(weight, from);
    }
}

size_t df_turns(size_t n, const double *x, double reach, int64_t *turns)
{
    size_t found = 0, low = 0, high = 0;
    int rising = 0; /* 1, -1; 0 until the first turn */
    for (size_t k = 0; k < n; k++) {
        const int is_inside = k && k + 1 < n;
        if (is_inside && !((x[k] - x[k - 1]) * (x[k + 1] - x[k]) <= 0.0))
            continue;
        if (x[k] > x[high])
            high = k;
        if (x[k] < x[low])
            low = k;
        if (rising >= 0 && x[high] - x[k] > reach) {
            turns[found++] = (int64_t)high;
            rising = -1;
            low = high = k;
        } else if (rising <= 0 && x[k] - x[low] > reach) {
            turns[found++] = (int64_t)low;
            rising = 1;
            low = high = k;
        }
    }
    return found;
}
