/* A network's pressures and flows at one instant, with their slopes.
 *
 * For network.c and network_rates.c; inline, for they are the innermost of a fit.
 */
#ifndef DAMPERFIT_NETWORK_BALANCE_H
#define DAMPERFIT_NETWORK_BALANCE_H

#include "network.h"

#include <math.h>

/* What one position of the piston gives. */
typedef struct {
    double full[2];    /* rho_0 V: kg at P_0 */
    double inverse[2];
    double swept;      /* oil that the piston's motion itself takes from the gas chamber, kg */
} chambers;

static inline double number(const df_network *q, int place)
{
    return place < 0 ? 0.0 : q->numbers[place];
}

static inline df_passage_law law_of(const df_network *q, const df_passage *p)
{
    const df_passage_law law = {number(q, p->p_open), number(q, p->R), number(q, p->S),
                                number(q, p->width), p->two_way};
    return law;
}

static inline df_geometry gas_geometry(const df_network *q)
{
    const df_geometry g = {q->a_1, q->a_2, q->a_2 - q->a_1, q->V_1, q->V_2,
                           q->numbers[DF_NUMBER_V_GAS], q->rho_0};
    return g;
}

static inline df_parameters gas_parameters(const df_network *q)
{
    const df_parameters p = {0.0, 0.0, 0.0, q->numbers[DF_NUMBER_K], 0.0, 0.0,
                             q->numbers[DF_NUMBER_P_0], q->numbers[DF_NUMBER_GAMMA]};
    return p;
}

/* Chambers whose oil is a state. */
static inline int n_oil(const df_network *q)
{
    return q->has_floating_piston ? 1 : 2;
}

static inline int is_elastic(const df_network *q)
{
    return q->numbers[DF_NUMBER_STIFFNESS] > 0.0;
}

static inline int fill_chambers(const df_network *q, double x, chambers *c)
{
    const double V1 = q->V_1 - x * q->a_1, V2 = q->V_2 + x * q->a_2;
    if (!(V1 > 0.0 && V2 > 0.0))
        return isfinite(x) ? DF_CHAMBER_EMPTY : DF_NOT_FINITE;
    c->full[0] = q->rho_0 * V1;
    c->full[1] = q->rho_0 * V2;
    c->inverse[0] = 1.0 / c->full[0];
    c->inverse[1] = 1.0 / c->full[1];
    c->swept = q->has_floating_piston ? q->rho_0 * q->a_2 * x : 0.0;
    return DF_OK;
}

/* Oil that has left the gas chamber, kg. */
static inline double taken(const df_network *q, const chambers *c, const double m[2])
{
    const double first = m[0] - q->rho_0 * q->V_1;
    return q->has_floating_piston ? first + c->swept : first + (m[1] - q->rho_0 * q->V_2);
}

/* Pressure of oil with free gas by its fill e = m/(rho_0 V) - 1, and the slope by e. Without gas
 * eqs (4), (7), (11), (12) with the clamp; with gas it never reaches zero:
 * 1/(1 + e) = 1 - (P - P_0)/K + phi (P_0/P - 1). */
static inline df_law oil_pressure(const df_network *q, double e)
{
    const double K = q->numbers[DF_NUMBER_K], P_0 = q->numbers[DF_NUMBER_P_0];
    const double phi = q->numbers[DF_NUMBER_PHI];
    df_law law = {0.0, 0.0};
    if (phi == 0.0) {
        const double P = K * e + P_0;
        if (P > 0.0) {
            law.value = P;
            law.slope = K;
        }
        return law;
    }
    /* b = P_0/K - phi + e/(1 + e), without the cancellation of 1 - 1/(1 + e) */
    const double volume = 1.0 / (1.0 + e), b = P_0 / K - phi + e * volume;
    const double gas = 4.0 * phi * P_0 / K, root = sqrt(b * b + gas);
    law.value = 0.5 * K * (b >= 0.0 ? b + root : gas / (root - b));
    law.slope = law.value * volume * volume / root;
    return law;
}

/* Derivative of an oil pressure by a number at constant mass. */
static inline double oil_pressure_by(const df_network *q, double P, int place)
{
    const double K = q->numbers[DF_NUMBER_K], P_0 = q->numbers[DF_NUMBER_P_0];
    const double phi = q->numbers[DF_NUMBER_PHI];
    double slope;
    if (!(P > 0.0))
        return 0.0; /* clamped */
    if (place == DF_NUMBER_K)
        slope = (P - P_0) / (K * K);
    else if (place == DF_NUMBER_PHI)
        slope = P_0 / P - 1.0;
    else if (place == DF_NUMBER_P_0)
        slope = 1.0 / K + phi / P;
    else
        return 0.0;
    return slope / (1.0 / K + phi * P_0 / (P * P));
}

static inline double gas_pressure_by(const df_network *q, double P3, double s, int place)
{
    const df_geometry g = gas_geometry(q);
    const df_parameters p = gas_parameters(q);
    double by_P_0, by_gamma;
    if (place == DF_NUMBER_P_0 || place == DF_NUMBER_GAMMA) {
        df_gas_slopes(&g, &p, P3, s, &by_P_0, &by_gamma);
        return place == DF_NUMBER_P_0 ? by_P_0 : by_gamma;
    }
    if (place == DF_NUMBER_V_GAS) {
        const double V = q->numbers[DF_NUMBER_V_GAS];
        return P3 * q->numbers[DF_NUMBER_GAMMA] * (1.0 / V - 1.0 / (V + s / q->rho_0));
    }
    return 0.0;
}

/* Whether a number enters the laws of oil and gas; what does not is left out of the sums. */
static inline int moves_pressures(int place)
{
    return place == DF_NUMBER_K || place == DF_NUMBER_PHI || place == DF_NUMBER_P_0 ||
           place == DF_NUMBER_GAMMA || place == DF_NUMBER_V_GAS;
}

/* Derivatives of the three pressures by a number at constant masses. */
static inline void pressures_by(const df_network *q, const df_network_balance *b, double s, int place, double P[3])
{
    P[0] = oil_pressure_by(q, b->P[0], place);
    P[2] = gas_pressure_by(q, b->P[2], s, place);
    P[1] = q->has_floating_piston ? P[2] : oil_pressure_by(q, b->P[1], place);
}

/* Pressures, flows, and the Jacobian of the mass balances. */
static inline void evaluate(const df_network *q, const chambers *c, const df_gas_point *gas,
                     const double y[DF_STATES], df_network_balance *b)
{
    const df_law P3 = df_gas_pressure(gas, taken(q, c, y));
    const double grow[2] = {q->rho_0 * q->a_1 * c->inverse[0], -q->rho_0 * q->a_2 * c->inverse[1]};
    const int n = n_oil(q);
    for (int i = 0; i < 2; i++) {
        b->F[i] = b->J[i][0] = b->J[i][1] = b->J[i][2] = 0.0;
        b->slope[2][i] = i < n ? P3.slope : 0.0;
    }
    b->slope[2][DF_PISTON] = q->has_floating_piston ? P3.slope * q->rho_0 * q->a_2 : 0.0;
    b->P[2] = P3.value;
    for (int i = 0; i < n; i++) {
        b->fill[i] = (y[i] - c->full[i]) * c->inverse[i];
        const df_law P = oil_pressure(q, b->fill[i]);
        b->P[i] = P.value;
        b->slope[i][i] = P.slope * c->inverse[i];
        b->slope[i][1 - i] = 0.0;
        b->slope[i][DF_PISTON] = P.slope * (1.0 + b->fill[i]) * grow[i];
    }
    if (q->has_floating_piston) {
        b->fill[1] = 0.0;
        b->P[1] = b->P[2];
        for (int j = 0; j < DF_STATES; j++)
            b->slope[1][j] = b->slope[2][j];
    }
    for (int k = 0; k < q->n_passages; k++) {
        const df_passage *p = &q->passages[k];
        const df_passage_law law = law_of(q, p);
        const int from = p->from - 1, to = p->to - 1;
        b->drop[k] = b->P[from] - b->P[to];
        b->flow[k] = df_passage_flow(&law, b->drop[k], q->rounding);
        for (int j = 0; j < DF_STATES; j++) {
            const double by_state = b->flow[k].by_D * (b->slope[from][j] - b->slope[to][j]);
            if (from < n)
                b->J[from][j] -= by_state;
            if (to < n)
                b->J[to][j] += by_state;
        }
        if (from < n)
            b->F[from] -= b->flow[k].w;
        if (to < n)
            b->F[to] += b->flow[k].w;
    }
}

static inline double oil_force(const df_network *q, const double P[3])
{
    return P[0] * q->a_1 - P[1] * q->a_2;
}

/* Friction while it slides. What it has more at rest goes with the speed that the rig drives, not with
 * the piston's own: a friction that falls with that would let a piston without mass jump. */
static inline double rubbing(const df_network *q, double v, double P1)
{
    const double v_s = q->numbers[DF_NUMBER_STRIBECK], r = v_s > 0.0 ? v / v_s : INFINITY;
    return q->numbers[DF_NUMBER_FRICTION] + q->numbers[DF_NUMBER_BREAKAWAY] * exp(-r * r) +
           q->numbers[DF_NUMBER_PRESSED] * P1;
}

/* Derivative of that by a number, with the pressure held. */
static inline double rubbing_by(const df_network *q, double v, double P1, int place)
{
    const double v_s = q->numbers[DF_NUMBER_STRIBECK], r = v_s > 0.0 ? v / v_s : INFINITY;
    if (place == DF_NUMBER_FRICTION)
        return 1.0;
    if (place == DF_NUMBER_PRESSED)
        return P1;
    if (place == DF_NUMBER_BREAKAWAY)
        return exp(-r * r);
    if (place == DF_NUMBER_STRIBECK && v_s > 0.0)
        return q->numbers[DF_NUMBER_BREAKAWAY] * exp(-r * r) * 2.0 * r * r / v_s;
    return 0.0;
}

/* dF/d(number) at constant masses, and that of the mounting's balance of forces. */
static inline void balance_by(const df_network *q, const df_network_balance *b, double s, double v, int place,
                       double F[DF_STATES])
{
    double P[3] = {0.0, 0.0, 0.0};
    const int by_pressure = moves_pressures(place);
    F[0] = F[1] = F[DF_PISTON] = 0.0;
    if (by_pressure) {
        pressures_by(q, b, s, place, P);
        F[DF_PISTON] = -oil_force(q, P) - q->numbers[DF_NUMBER_PRESSED] * b->grip * P[0];
    }
    F[DF_PISTON] -= b->grip * rubbing_by(q, v, b->P[0], place);
    if (place == DF_NUMBER_DRAG)
        F[DF_PISTON] -= b->speed;
    else if (place == DF_NUMBER_STIFFNESS)
        F[DF_PISTON] += b->pull / q->numbers[DF_NUMBER_STIFFNESS];
    else if (place == DF_NUMBER_PLAY && b->pull != 0.0)
        F[DF_PISTON] -= 0.5 * copysign(b->pull_slope, b->pull);
    for (int k = 0; k < q->n_passages; k++) {
        const df_passage *p = &q->passages[k];
        const df_flow *f = &b->flow[k];
        double w = by_pressure ? f->by_D * (P[p->from - 1] - P[p->to - 1]) : 0.0;
        w += p->p_open == place ? f->by_open : 0.0;
        w += p->R == place ? f->by_R : 0.0;
        w += p->S == place ? f->by_S : 0.0;
        w += p->width == place ? f->by_width : 0.0;
        if (p->from <= n_oil(q))
            F[p->from - 1] -= w;
        if (p->to <= n_oil(q))
            F[p->to - 1] += w;
    }
}

#endif
