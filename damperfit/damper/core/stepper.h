/* A run of the paper's damper, step by step: what df_simulate stands on, and an exported model.
 *
 * A run is a plain struct: a copy of its bytes is a copy of the run. `df_begin` once, `df_advance`
 * from one moment to the next, `df_force` at any.
 */
#ifndef DAMPERFIT_STEPPER_H
#define DAMPERFIT_STEPPER_H

#include "core.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { DF_ODE_PARAMETERS = 6 }; /* R_m1 R_m2 R_m3 K_e P_0 gamma move the state; f_f and f_0 do not */

typedef struct {
    double m1, m2;
} df_masses;

/* Pressures, flows and their slopes at one instant. */
typedef struct {
    double P1, P2, P3;       /* as they act: clamped at zero */
    double free1, free2;     /* as the masses alone would have it */
    double d1, d2, d3;       /* dP1/dm1, dP2/dm2, dP3/ds */
    df_law root, check2, check3;
    double F1, F2;
    double J11, J12, J21, J22;
} df_balance;

/* What does not change from step to step. */
typedef struct {
    df_geometry g;
    df_parameters p;
    df_options o;
    double m_10, m_20;                   /* oil at x = 0 */
    double inverse_R1, inverse_R2, inverse_R3;
    double inverse_stiffness; /* rho_0/K_e */
    double share_done;
    int which[DF_N_PARAMETERS], n_which; /* sensitivities asked for */
    int active[DF_ODE_PARAMETERS], n_active; /* those of them that are carried */
} df_problem;

typedef struct {
    df_problem q;
    df_masses m;
    df_masses F;                      /* of the last stage */
    df_masses S[DF_ODE_PARAMETERS];   /* dm/d(parameter) */
    df_masses G[DF_ODE_PARAMETERS];   /* dS/dt of the last stage */
    df_balance b;                     /* at m */
    double free_mid1, free_mid2;      /* free pressures in mid-step, for the next prediction */
    double free_old1, free_old2, t_mid, t_old;
    df_gas_point gas;
    double wish;                      /* next step, s */
    double x, v;
} df_run;

/* All chambers at one pressure at x, with the oil mass of the damper at x = 0. */
int df_begin(const df_geometry *geometry, const df_parameters *parameters, const df_options *options,
             const int *which, int n_which, double x, double v, df_run *run);

/* From the run's x and v to those given, a time `interval` later, along the cubic Hermite piece. */
int df_advance(df_run *run, double interval, double x, double v, df_work *work);

/* Eq. (20) and its derivatives by the parameters asked for. */
double df_force(const df_run *run, double *slopes);

/* Go on with other parameters and another dead band, at the pressures of chambers 1 and 2 as they
 * are: the masses follow. A parameter that changes has had no influence on the past. */
int df_retune(df_run *run, const df_parameters *parameters, double dead_band);

/* Put the run where another integrator has it: masses above the oil at x = 0, and the piston. */
int df_place(df_run *run, double m1, double m2, double x, double v);

/* The mass balances as they stand, for an integrator that is not ours. */
typedef struct {
    double rates[2];                               /* dm/dt */
    double by_mass[2][2], by_x[2];                 /* of the rates */
    double by_parameter[DF_N_PARAMETERS][2];
    double pressures[3], free[2];                  /* clamped at zero, and as the masses have it */
    double pressures_by_mass[3][2], pressures_by_x[3];
    double pressures_by_parameter[DF_N_PARAMETERS][3];
} df_rates;

/* Rates at x for masses that are `m1` and `m2` more than the oil at x = 0. */
int df_evaluate(const df_run *run, double m1, double m2, double x, df_rates *rates);

#ifdef __cplusplus
}
#endif
#endif
