/* Crossings, tops and turns. No allocation, no globals, re-entrant. */
#include "cycles.h"

#include <math.h>

enum { NEWTON = 4 };

static double within(double value, double low, double high)
{
    return value < low ? low : value > high ? high : value;
}

static double larger(double a, double b)
{
    return a > b ? a : b;
}

/* Part of the sample in which the Hermite piece from y0 < 0 to y1 >= 0 is zero. */
static double root(double y0, double y1, double v0, double v1)
{
    const double c2 = 3.0 * (y1 - y0) - 2.0 * v0 - v1, c3 = 2.0 * (y0 - y1) + v0 + v1;
    const double chord = y1 - y0;
    double u = -y0 / chord;
    for (int k = 0; k < NEWTON; k++) {
        /* Near a turning point in noise the slope may vanish; the chord's is safe there. */
        double slope = v0 + u * (2.0 * c2 + 3.0 * c3 * u);
        slope = slope > 0.2 * chord ? slope : chord;
        u = within(u - (y0 + u * (v0 + u * (c2 + c3 * u))) / slope, 0.0, 1.0);
    }
    return u;
}

size_t df_crossings(size_t n, const double *x, const double *v, double level, double sign,
                    double reach, double *at)
{
    size_t found = 0, before = 0;
    int was_below = 0, has_risen = 0;
    double last = 0.0;
    for (size_t k = 0; k < n; k++) {
        const double y = sign * (x[k] - level);
        if (last < 0.0 && !(y < 0.0)) {
            before = k - 1;
            has_risen = 1;
        }
        last = y;
        if (!(fabs(y) > reach))
            continue;
        if (y > 0.0 && was_below && has_risen) {
            const double u = root(sign * (x[before] - level), sign * (x[before + 1] - level),
                                  sign * v[before], sign * v[before + 1]);
            at[found++] = (double)before + u;
        }
        was_below = !(y > 0.0);
    }
    return found;
}

/* A sample of n >= 1, whatever the number: what is no number is the first. */
static size_t sample_of(double at, size_t n)
{
    return at > 0.0 ? at < (double)(n - 1) ? (size_t)at : n - 1 : 0;
}

void df_tops(size_t n, const double *x, const double *v, double level, double sign, size_t n_tops,
             const double *boundaries, double *tops)
{
    for (size_t cycle = 0; cycle < n_tops; cycle++) {
        size_t highest = sample_of(ceil(boundaries[cycle]), n);
        const double last = ceil(boundaries[cycle + 1]);
        const size_t stop = last < (double)n ? last > 0.0 ? (size_t)last : 0 : n;
        double top = sign * x[highest];
        for (size_t k = highest + 1; k < stop; k++)
            if (sign * x[k] > top) {
                highest = k;
                top = sign * x[k];
            }
        size_t left = sign * v[highest] > 0.0 ? highest : highest ? highest - 1 : 0;
        left = left < n - 2 ? left : n - 2;
        const double y0 = sign * (x[left] - level), y1 = sign * (x[left + 1] - level);
        const double v0 = sign * v[left], v1 = sign * v[left + 1];
        const double c2 = 3.0 * (y1 - y0) - 2.0 * v0 - v1, c3 = 2.0 * (y0 - y1) + v0 + v1;
        /* Slope v0 + 2 c2 u + 3 c3 u^2 falls through zero here; this root allows c3 = 0. */
        const double below = sqrt(larger(c2 * c2 - 3.0 * c3 * v0, 0.0)) - c2;
        const double u = below > 0.0 ? within(v0 / below, 0.0, 1.0) : 0.0;
        tops[cycle] = larger(sign * (x[highest] - level), y0 + u * (v0 + u * (c2 + c3 * u)));
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

