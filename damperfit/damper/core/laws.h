/* Constitutive laws of the damper, one function a law, each with its derivatives.
 *
 * Symbols (SI) are the paper's: D. J. Purdy, Proc. IMechE D, 2000; see parameters.py.
 *   m1 m2     oil mass in chambers 1 and 2            kg
 *   V1 V2     chamber volumes                         m3
 *   P1 P2 P3  chamber pressures, absolute             Pa
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
    double a_p1, a_p2, a_r;  /* annulus, full bore, rod: m2 */
    double V_10, V_20, V_g0; /* volumes at x = 0: m3 */
    double rho_0;            /* kg/m3 */
} df_geometry;

typedef struct {
    double R_m1, R_m2, R_m3, K_e, f_f, f_0, P_0, gamma;
} df_parameters;

/* A value and its slope. */
typedef struct {
    double value, slope;
} df_law;

/* Valve 1, eq. (18) with the signed root: w sqrt(...) R_m1 as a function of D = P1 - P3.
 *
 * The root is rounded within about 1 Pa of zero, so that its slope stays finite at a reversal.
 * Rounding up to 100 Pa costs 0.01 N on the standard test; 1 Pa cannot be seen. */
#define ROUNDING_PA 1.0

static inline df_law df_signed_root(double D)
{
    const double square = D * D + ROUNDING_PA * ROUNDING_PA;
    const double inverse = 1.0 / sqrt(sqrt(square)); /* |D|^-1/2 away from zero */
    df_law law;
    law.value = D * inverse;
    /* 1 - D^2/(2 square), with 1/square = inverse^4 */
    law.slope = inverse * (0.5 + 0.5 * ROUNDING_PA * ROUNDING_PA * (inverse * inverse) * (inverse * inverse));
    return law;
}

static inline double df_signed_root_inverse(double z)
{
    const double square = z * z;
    const double four = 4.0 * ROUNDING_PA * ROUNDING_PA;
    return copysign(sqrt(0.5 * square * (square + sqrt(square * square + four))), z);
}

static inline df_law df_check(double D)
{
    df_law law = {0.0, 0.0};
    if (D > 0.0) {
        law.value = D;
        law.slope = 1.0;
    }
    return law;
}

/* Gas spring, eq. (17) corrected, as a series around an expansion point. */
#define DF_GAS_TERMS 7
#define DF_GAS_REACH 5e-3 /* |d| up to which the series is exact to rounding */

typedef struct {
    double s0;                    /* expansion point, kg */
    double inverse_mass;          /* 1/(rho_0 V_g) at s0 */
    double gamma;
    double series[DF_GAS_TERMS];  /* P3 = sum series[k] d^k, d = (s - s0) inverse_mass */
} df_gas_point;

int df_gas_expand(const df_geometry *g, const df_parameters *p, double s, df_gas_point *point);

static inline int df_gas_is_near(const df_gas_point *point, double s)
{
    return fabs((s - point->s0) * point->inverse_mass) < 0.5 * DF_GAS_REACH;
}

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

void df_gas_slopes(const df_geometry *g, const df_parameters *p, double P3, double s,
                   double *by_P_0, double *by_gamma);

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
