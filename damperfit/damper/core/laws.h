/* Constitutive laws of the damper, one function a law, each with its derivatives.
 *
 * Symbols (SI) are the paper's: D. J. Purdy, Proc. IMechE D, 2000; see parameters.py.
 *   s         oil mass that has left chamber 3, -dm3  kg
 */
#ifndef DAMPERFIT_LAWS_H
#define DAMPERFIT_LAWS_H

#include <math.h>

/* What is written once for several kinds of damper and compiled for each: with the kind a constant. */
#if defined(__GNUC__) || defined(__clang__)
#define DF_FOR_EACH_KIND static inline __attribute__((always_inline))
#elif defined(_MSC_VER)
#define DF_FOR_EACH_KIND static __forceinline
#else
#define DF_FOR_EACH_KIND static inline
#endif

typedef struct {
    double P_0, gamma; /* at x = 0: Pa */
    double V_0;        /* m3 */
    double rho_0;      /* of the oil that it gives way to: kg/m3 */
} df_gas;

/* A value and its slope. */
typedef struct {
    double value, slope;
} df_law;

/* Gas spring, eq. (17) corrected, as a series around an expansion point. */
#define DF_GAS_TERMS 7
#define DF_GAS_REACH 5e-3 /* |d| up to which the series is exact to rounding */

typedef struct {
    double s0;                    /* expansion point, kg */
    double inverse_mass;          /* 1/(rho_0 V_g) at s0 */
    double gamma;
    double series[DF_GAS_TERMS];  /* P3 = sum series[k] d^k, d = (s - s0) inverse_mass */
} df_gas_point;

int df_gas_expand(const df_gas *gas, double s, df_gas_point *point);

static inline df_law df_gas_pressure(const df_gas_point *point, double s)
{
    const double d = (s - point->s0) * point->inverse_mass;
    const double *a = point->series;
    df_law law;
    if (fabs(d) < DF_GAS_REACH) {
        const double dd = d * d;
        law.value = (a[0] + a[1] * d) + dd * ((a[2] + a[3] * d) + dd * ((a[4] + a[5] * d) + dd * a[6]));
        law.slope = point->inverse_mass * ((a[1] + 2.0 * a[2] * d) +
                    dd * ((3.0 * a[3] + 4.0 * a[4] * d) + dd * (5.0 * a[5] + 6.0 * a[6] * d)));
    } else {
        law.value = 1.0 + d > 0.0 ? a[0] * pow(1.0 + d, -point->gamma) : NAN;
        law.slope = -point->gamma * law.value * point->inverse_mass / (1.0 + d);
    }
    return law;
}

/* Coulomb friction with dead band DV, as a share of f_f. */
static inline double df_friction_share(double v, double DV)
{
    if (v >= DV)
        return 1.0;
    if (v <= -DV)
        return -1.0;
    return v / DV;
}

#endif
