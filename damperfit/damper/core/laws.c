/* The laws stand in laws.h, inline, as every step of the integrator asks for them: a new one goes there.
 * Here is what is asked rarely: the gas spring's series around a point. */
#include "laws.h"

/* P3 = P (1 + d)^-gamma. Near the expansion point the binomial series is exact to rounding
 * (7 terms, |d| < 5e-3: remainder below 1e-16) and ten times cheaper than pow. */
int df_gas_expand(const df_gas *gas, double s, df_gas_point *point)
{
    const double ratio = 1.0 + s / (gas->rho_0 * gas->V_0);
    if (!(ratio > 0.0))
        return 1;
    point->s0 = s;
    point->gamma = gas->gamma;
    point->inverse_mass = 1.0 / (gas->rho_0 * gas->V_0 * ratio);
    point->series[0] = gas->P_0 * pow(ratio, -gas->gamma);
    for (int k = 1; k < DF_GAS_TERMS; k++)
        point->series[k] = point->series[k - 1] * ((-gas->gamma - (k - 1)) / k); /* quotients that wait for nothing */
    return 0;
}
