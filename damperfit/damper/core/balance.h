/* The paper's mass balances at one instant, with their slopes: eqs (4), (7), (11), (12), (17), (18).
 *
 * For stepper.c and rates.c; inline, for they are the innermost of a fit.
 */
#ifndef DAMPERFIT_BALANCE_H
#define DAMPERFIT_BALANCE_H

#include "stepper.h"

/* Chamber stiffnesses at one instant. */
typedef struct {
    double k1, k2; /* K_e/(rho_0 V): Pa/kg */
    double inverse_k1, inverse_k2;
    df_gas_point *gas;
} chambers;

static inline int chamber_stiffness(const df_problem *q, double x, chambers *c)
{
    const double V1 = q->g.V_10 - x * q->g.a_p1;
    const double V2 = q->g.V_20 + x * q->g.a_p2;
    if (!(V1 > 0.0 && V2 > 0.0))
        return isfinite(x) ? DF_CHAMBER_EMPTY : DF_NOT_FINITE;
    const double shared = q->p.K_e / (q->g.rho_0 * V1 * V2);
    c->k1 = shared * V2;
    c->k2 = shared * V1;
    c->inverse_k1 = V1 * q->inverse_stiffness;
    c->inverse_k2 = V2 * q->inverse_stiffness;
    return DF_OK;
}

/* Eqs (4), (7), (11), (12), (17), (18) and the Jacobian of the mass balances. */
static inline void evaluate(const df_problem *q, const chambers *c, df_masses m, df_balance *b)
{
    const df_law gas = df_gas_pressure(c->gas, (m.m1 - q->m_10) + (m.m2 - q->m_20));
    b->P3 = gas.value;
    b->d3 = gas.slope;
    b->free1 = (c->k1 * m.m1 - q->p.K_e) + q->p.P_0;
    b->free2 = (c->k2 * m.m2 - q->p.K_e) + q->p.P_0;
    const int full1 = b->free1 > 0.0, full2 = b->free2 > 0.0;
    b->P1 = full1 ? b->free1 : 0.0;
    b->P2 = full2 ? b->free2 : 0.0;
    b->d1 = full1 ? c->k1 : 0.0;
    b->d2 = full2 ? c->k2 : 0.0;
    b->root = df_signed_root(b->P1 - b->P3);
    b->check2 = df_check(b->P2 - b->P1);
    b->check3 = df_check(b->P3 - b->P2);
    const double w2 = b->check2.value * q->inverse_R2;
    b->F1 = -b->root.value * q->inverse_R1 + w2;
    b->F2 = -w2 + b->check3.value * q->inverse_R3;
    const double y1 = b->root.slope * q->inverse_R1;
    const double y2 = b->check2.slope * q->inverse_R2;
    const double y3 = b->check3.slope * q->inverse_R3;
    b->J11 = -y1 * (b->d1 - b->d3) - y2 * b->d1;
    b->J12 = y1 * b->d3 + y2 * b->d2;
    b->J21 = y2 * b->d1 + y3 * b->d3;
    b->J22 = -y2 * b->d2 + y3 * (b->d3 - b->d2);
}

/* Direct influence of a parameter on the free pressures and on P3. */
static inline void pressure_slopes(const df_problem *q, const df_balance *b, double s, int parameter,
                            double *P1, double *P2, double *P3)
{
    const double full1 = b->free1 > 0.0, full2 = b->free2 > 0.0;
    double by_P_0, by_gamma;
    *P1 = *P2 = *P3 = 0.0;
    if (parameter == DF_K_E) {
        *P1 = full1 * (b->free1 - q->p.P_0) / q->p.K_e;
        *P2 = full2 * (b->free2 - q->p.P_0) / q->p.K_e;
    } else if (parameter == DF_P_0 || parameter == DF_GAMMA) {
        df_gas_slopes(&q->g, &q->p, b->P3, s, &by_P_0, &by_gamma);
        if (parameter == DF_P_0) {
            *P1 = full1;
            *P2 = full2;
            *P3 = by_P_0;
        } else {
            *P3 = by_gamma;
        }
    }
}

/* dF/d(parameter) at constant masses. */
static inline df_masses balance_slopes(const df_problem *q, const df_balance *b, double s, int parameter)
{
    df_masses F = {0.0, 0.0};
    if (parameter == DF_R_M1) {
        F.m1 = b->root.value * q->inverse_R1 * q->inverse_R1;
    } else if (parameter == DF_R_M2) {
        F.m2 = b->check2.value * q->inverse_R2 * q->inverse_R2;
        F.m1 = -F.m2;
    } else if (parameter == DF_R_M3) {
        F.m2 = -b->check3.value * q->inverse_R3 * q->inverse_R3;
    } else {
        double P1, P2, P3;
        pressure_slopes(q, b, s, parameter, &P1, &P2, &P3);
        const double w2 = b->check2.slope * q->inverse_R2 * (P2 - P1);
        F.m1 = -b->root.slope * q->inverse_R1 * (P1 - P3) + w2;
        F.m2 = -w2 + b->check3.slope * q->inverse_R3 * (P3 - P2);
    }
    return F;
}

#endif
