/* A network's pressures and flows at one instant, with their slopes.
 *
 * Inline, for they are the innermost of a fit; `kind` is what the damper has beyond oil between two
 * chambers and gas, and a constant where that is known when this is compiled.
 */
#ifndef DAMPERFIT_NETWORK_BALANCE_H
#define DAMPERFIT_NETWORK_BALANCE_H

#include "network.h"

#include <math.h>

#define CORNER_SHARE 5e3 /* times SHARE_DONE: half */

/* The last one has the paper's passages, a two-way orifice 1-3 and leaks 2 to 1 and 3 to 2, and no more. */
enum { DF_IS_ELASTIC = 1, DF_HAS_GAS_IN_OIL = 2, DF_HAS_FLOATING_PISTON = 4, DF_IS_PURDY = 8 };

static inline int kind_of(const df_network *q)
{
    return (q->plan.is_elastic ? DF_IS_ELASTIC : 0) | (q->plan.has_gas_in_oil ? DF_HAS_GAS_IN_OIL : 0) |
           (q->has_floating_piston ? DF_HAS_FLOATING_PISTON : 0) | (q->plan.is_purdy ? DF_IS_PURDY : 0);
}

/* What one position of the piston gives. */
typedef struct {
    double full[2];    /* rho_0 V: kg at P_0 */
    double inverse[2];
    double swept;      /* oil that the piston's motion itself takes from the gas chamber, kg */
} chambers;

static inline double larger(double a, double b)
{
    return a > b ? a : b;
}

static inline double smaller(double a, double b)
{
    return a < b ? a : b;
}

static inline double number(const df_network *q, int place)
{
    return place < 0 ? 0.0 : q->numbers[place];
}

static inline df_gas gas_of(const df_network *q)
{
    const df_gas gas = {q->numbers[DF_NUMBER_P_0], q->numbers[DF_NUMBER_GAMMA], q->numbers[DF_NUMBER_V_GAS], q->rho_0};
    return gas;
}

/* Chambers whose oil is a state. */
static inline int n_oil(const df_network *q)
{
    return q->has_floating_piston ? 1 : 2;
}

static inline int is_elastic(const df_network *q)
{
    return q->plan.is_elastic;
}

static inline int fill_chambers(const df_network *q, double x, chambers *c)
{
    c->full[0] = q->plan.oil[0] - x * q->plan.swept[0];
    c->full[1] = q->plan.oil[1] + x * q->plan.swept[1];
    if (!(c->full[0] > 0.0 && c->full[1] > 0.0))
        return isfinite(x) ? DF_CHAMBER_EMPTY : DF_NOT_FINITE;
    const double inverse = 1.0 / (c->full[0] * c->full[1]);
    c->inverse[0] = c->full[1] * inverse;
    c->inverse[1] = c->full[0] * inverse;
    c->swept = q->plan.swept[1] * x;
    return DF_OK;
}

/* Oil that has left the gas chamber, kg. */
static inline double taken(const df_network *q, int kind, const chambers *c, const double m[2])
{
    const double first = m[0] - q->plan.oil[0];
    return kind & DF_HAS_FLOATING_PISTON ? first + c->swept : first + (m[1] - q->plan.oil[1]);
}

/* Pressure of oil with free gas by its fill e = m/(rho_0 V) - 1, and the slope by e. Without gas
 * eqs (4), (7), (11), (12) with the clamp; with gas it never reaches zero:
 * 1/(1 + e) = 1 - (P - P_0)/K + phi (P_0/P - 1). */
static inline df_law oil_pressure(const df_network *q, int kind, double e)
{
    const double K = q->numbers[DF_NUMBER_K], P_0 = q->numbers[DF_NUMBER_P_0];
    const double phi = q->numbers[DF_NUMBER_PHI];
    df_law law = {0.0, 0.0};
    if (!(kind & DF_HAS_GAS_IN_OIL)) {
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

/* Flow and slope of a way at D between its chambers, both along the pair, and how near an orifice is to
 * its root. Oil flows as D falls. */
typedef struct {
    double w, g, nearest;
} passed;

DF_FOR_EACH_KIND passed pass(const df_network *q, const df_way *way, const df_kind kind, const double turn, double D,
                             df_flow *whole)
{
    const double u = fabs(D) - way->law.of[DF_OPENING], eps = q->rounding;
    passed p = {0.0, 0.0, INFINITY};
    if (turn * D < 0.0)
        return p;
    if (kind == DF_COMPOSED) {
        *whole = df_passage_flow(&way->law, fabs(D), eps);
        p.w = copysign(whole->w, D);
        p.g = whole->by_D;
        if ((way->law.of[DF_S] > 0.0 || way->law.of[DF_POWER] > 0.0) && p.g > 0.0)
            p.nearest = fabs(u);
    } else if (u >= way->opens) {
        const double square = u * u + eps * eps, root = sqrt(square);
        if (kind == DF_LEAK) {
            const double inverse = 1.0 / root, share = u * inverse, rounded = eps * inverse;
            p.w = copysign(u * share * way->inverse_R, D);
            p.g = share * (1.0 + rounded * rounded) * way->inverse_R;
        } else {
            const double inverse = 1.0 / sqrt(root), second = inverse * inverse;
            p.w = copysign(u * inverse * way->inverse_S, D);
            p.g = inverse * (0.5 + 0.5 * eps * eps * (second * second)) * way->inverse_S;
            p.nearest = u;
        }
    }
    return p;
}

/* How far a correction may lead, as `nearest`, before it crosses the pressure at which a way begins to
 * open: half the way there, for beside it a leak is straight. */
static inline double from_its_corner(const df_network *q, const df_way *way, double D)
{
    const double along = way->turn == 0.0 ? fabs(D) : way->turn * D;
    const double away = fabs(along - way->law.of[DF_OPENING]) - 3.0 * q->rounding;
    const double straight = CORNER_SHARE * larger(away, 0.0);
    const double rounded = way->law.of[DF_WIDTH] > 0.0 ? way->law.of[DF_WIDTH] : straight;
    return smaller(straight, rounded);
}

/* All ways between two chambers. `nearest` tells how a correction of the pressures turns the slope of all
 * flow between them: an orifice that carries little of it turns it little. */
DF_FOR_EACH_KIND void pass_pair(const df_network *q, const int kind, const int pair, double D, df_flows *f)
{
    const df_plan *plan = &q->plan;
    double w = 0.0, g = 0.0;
    f->D[pair] = D;
    if (kind & DF_IS_PURDY) {
        const passed p = pass(q, &plan->ways[pair], pair == DF_1_3 ? DF_ORIFICE : DF_LEAK, pair == DF_1_3 ? 0.0 : -1.0,
                              D, &f->whole[pair]);
        f->w[pair] = f->W[pair] = p.w;
        f->g[pair] = f->G[pair] = p.g;
        f->nearest = p.nearest < f->nearest ? p.nearest : f->nearest;
        return;
    }
    double curved = INFINITY;
    for (int k = plan->first[pair]; k < plan->first[pair + 1]; k++) {
        const df_way *way = &plan->ways[k];
        const passed p = pass(q, way, way->kind, way->turn, D, &f->whole[k]);
        w += f->w[k] = p.w;
        g += f->g[k] = p.g;
        if (p.nearest < curved * p.g)
            curved = p.nearest / p.g;
        if (way->kind != DF_ORIFICE)
            f->nearest = smaller(f->nearest, from_its_corner(q, way, D));
    }
    f->W[pair] = w;
    f->G[pair] = g;
    if (curved < INFINITY)
        f->nearest = smaller(f->nearest, curved * g);
}

DF_FOR_EACH_KIND void fill_one(const df_network *q, const int kind, const chambers *c, const int i, double m,
                            df_network_balance *b)
{
    b->fill[i] = (m - c->full[i]) * c->inverse[i];
    const df_law P = oil_pressure(q, kind, b->fill[i]);
    b->P[i] = P.value;
    b->own[i] = P.slope * c->inverse[i];
    if (kind & DF_IS_ELASTIC)
        b->by_y[i] = (i == 0 ? q->plan.swept[0] : -q->plan.swept[1]) * b->own[i] * (1.0 + b->fill[i]);
}

/* Pressures, flows, and the Jacobian of the mass balances. */
DF_FOR_EACH_KIND void evaluate(const df_network *q, const int kind, const chambers *c, const df_gas_point *gas,
                               const double y[DF_STATES], df_network_balance *b, df_flows *f)
{
    const df_law P3 = df_gas_pressure(gas, taken(q, kind, c, y));
    b->P[2] = P3.value;
    b->gas = P3.slope;
    fill_one(q, kind, c, 0, y[0], b);
    if (kind & DF_HAS_FLOATING_PISTON) {
        b->fill[1] = b->own[1] = 0.0;
        b->P[1] = b->P[2];
        b->by_y[1] = b->by_y[2] = b->gas * q->plan.swept[1];
    } else {
        fill_one(q, kind, c, 1, y[1], b);
        b->by_y[2] = 0.0;
    }
    if (!(kind & DF_IS_ELASTIC))
        b->by_y[0] = b->by_y[1] = 0.0;
    f->nearest = INFINITY;
    pass_pair(q, kind, DF_1_3, b->P[0] - b->P[2], f);
    pass_pair(q, kind, DF_1_2, b->P[0] - b->P[1], f);
    pass_pair(q, kind, DF_2_3, b->P[1] - b->P[2], f);
    const double g13 = f->G[DF_1_3], g12 = f->G[DF_1_2], g23 = f->G[DF_2_3];
    b->F[0] = -(f->W[DF_1_3] + f->W[DF_1_2]);
    if (kind & DF_HAS_FLOATING_PISTON) {
        b->F[1] = b->J[0][1] = b->J[1][0] = b->J[1][1] = b->J[1][DF_PISTON] = 0.0;
        b->J[0][0] = -(g13 + g12) * (b->own[0] - b->gas);
        if (kind & DF_IS_ELASTIC)
            b->J[0][DF_PISTON] = -(g13 + g12) * (b->by_y[0] - b->by_y[2]);
        return;
    }
    b->F[1] = f->W[DF_1_2] - f->W[DF_2_3];
    b->J[0][0] = -g13 * (b->own[0] - b->gas) - g12 * b->own[0];
    b->J[0][1] = g13 * b->gas + g12 * b->own[1];
    b->J[1][0] = g12 * b->own[0] + g23 * b->gas;
    b->J[1][1] = -g12 * b->own[1] - g23 * (b->own[1] - b->gas);
    if (kind & DF_IS_ELASTIC) {
        const double w12 = g12 * (b->by_y[0] - b->by_y[1]);
        b->J[0][DF_PISTON] = -g13 * b->by_y[0] - w12;
        b->J[1][DF_PISTON] = w12 - g23 * b->by_y[1];
    }
}

/* Slope of a pressure by a state. */
static inline double slope_of(const df_network *q, const df_network_balance *b, int i, int state)
{
    if (q->has_floating_piston && i == 1)
        i = 2;
    if (state == DF_PISTON)
        return b->by_y[i];
    if (i == 2)
        return state == 1 && q->has_floating_piston ? 0.0 : b->gas;
    return i == state ? b->own[i] : 0.0;
}

static inline double oil_force(const df_network *q, const double P[3])
{
    return P[0] * q->a_1 - P[1] * q->a_2;
}

#endif
