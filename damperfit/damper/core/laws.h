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

/* Valve 1, eq. (18) with the signed root: w sqrt(...) R_m1 as a function of D = P1 - P3. */
df_law df_signed_root(double D);
double df_signed_root_inverse(double z);

/* Valves 2 and 3, eq. (18): opening pressure of a check valve, max(0, D). */
df_law df_check(double D);

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
int df_gas_is_near(const df_gas_point *point, double s);
df_law df_gas_pressure(const df_gas_point *point, double s);
void df_gas_slopes(const df_geometry *g, const df_parameters *p, double P3, double s,
                   double *by_P_0, double *by_gamma);

/* Coulomb friction with dead band DV, as a share of f_f. */
double df_friction_share(double v, double DV);

#endif
