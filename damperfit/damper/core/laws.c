/* The laws stand in laws.h, inline, as every step of the integrator asks for them: a new one goes there.
 * Here is what is asked rarely: the gas spring's series around a point, and its slopes. */
#include "laws.h"

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

void df_gas_slopes(const df_geometry *g, const df_parameters *p, double P3, double s,
                   double *by_P_0, double *by_gamma)
{
    *by_P_0 = P3 / p->P_0;
    *by_gamma = -P3 * log1p(s / (g->rho_0 * g->V_g0));
}
