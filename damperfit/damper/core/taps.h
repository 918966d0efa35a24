/* The polynomial through the eight samples around a fractional one. */
#ifndef DAMPERFIT_TAPS_H
#define DAMPERFIT_TAPS_H

#include <stddef.h>

enum { DF_TAPS = 8 };

/* One over the products of the differences of the taps: Lagrange's denominators. */
static const double DF_TAP_SHARE[DF_TAPS] = {-1.0 / 5040.0, 1.0 / 720.0, -1.0 / 240.0, 1.0 / 144.0,
                                             -1.0 / 144.0,  1.0 / 240.0, -1.0 / 720.0, 1.0 / 5040.0};

/* Fills what each tap of n >= 8 samples counts for a place, and returns the first of them. */
static inline size_t df_weigh_taps(size_t n, double at, double weight[DF_TAPS])
{
    /* Written so that a place that is no number ends inside too. */
    const double ahead = at > DF_TAPS / 2 - 1 ? at - (DF_TAPS / 2 - 1) : 0.0, last = (double)(n - DF_TAPS);
    const size_t first = ahead < last ? (size_t)ahead : n - DF_TAPS;
    const double t = at - (double)first;
    double before[DF_TAPS], after = 1.0;
    before[0] = 1.0;
    for (int tap = 1; tap < DF_TAPS; tap++)
        before[tap] = before[tap - 1] * (t - (tap - 1));
    for (int tap = DF_TAPS - 1; tap >= 0; tap--) {
        weight[tap] = DF_TAP_SHARE[tap] * before[tap] * after;
        after *= t - tap;
    }
    return first;
}

static inline double df_weighed(const double weight[DF_TAPS], const double *from)
{
    double sum = 0.0;
    for (int tap = DF_TAPS - 1; tap >= 0; tap--)
        sum += weight[tap] * from[tap];
    return sum;
}

#endif
