#include "laws.h"

#include <math.h>

/* The root is rounded within about 1 Pa of zero, so that its slope stays finite at a reversal.
 * Rounding up to 100 Pa costs 0.01 N on the standard test; 1 Pa cannot be seen. */
#define ROUNDING_PA 1.0

df_law df_signed_root(double D)
{
    const double square = D * D + ROUNDING_PA * ROUNDING_PA;
    const double inverse = 1.0 / sqrt(sqrt(square)); /* |D|^-1/2 away from zero */
    df_law law;
    law.value = D * inverse;
    law.slope = inverse * (1.0 - 0.5 * D * D / square);
    return law;
}

double df_signed_root_inverse(double z)
{
    const double square = z * z;
    const double four = 4.0 * ROUNDING_PA * ROUNDING_PA;
    return copysign(sqrt(0.5 * square * (square + sqrt(square * square + four))), z);
}

df_law df_check(double D)
{
    df_law law = {0.0, 0.0};
    if (D > 0.0) {
        law.value = D;
        law.slope = 1.0;
    }
    return law;
}

/* P3 = P (1 + d)^-gamma. Near the expansion point the binomial series is exact to rounding
 * (7 terms, |d| < 5e-3: remainder below 1e-16) and ten times cheaper than pow. */
int df_gas_expand(const df_geometry *g, const df_parameters *p, double s, df_gas_point *point)
{
    const double ratio = 1.0 + s / (g->rho_0 * g->V_g0);
    if (!(ratio > 0.0))
        return 1;
    point->s0 = s;
    point->gamma = p->gamma;
    point->inverse_mass = 1.0 / (g->rho_0 * g->V_g0 * ratio);
    point->series[0] = p->P_0 * pow(ratio, -p->gamma);
    for (int k = 1; k < DF_GAS_TERMS; k++)
        point->series[k] = point->series[k - 1] * (-p->gamma - (k - 1)) / k;
    return 0;
}

int df_gas_is_near(const df_gas_point *point, double s)
{
    return fabs((s - point->s0) * point->inverse_mass) < 0.5 * DF_GAS_REACH;
}

df_law df_gas_pressure(const df_gas_point *point, double s)
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
                   double *by_P_0, double *by_gamma)
{
    *by_P_0 = P3 / p->P_0;
    *by_gamma = -P3 * log1p(s / (g->rho_0 * g->V_g0));
}

double df_friction_share(double v, double DV)
{
    if (v >= DV)
        return 1.0;
    if (v <= -DV)
        return -1.0;
    return v / DV;
}
