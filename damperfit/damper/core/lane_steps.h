/* The stages and steps of network_stage.h and network_advance.c for the paper's passages, four parts of a
 * motion at once. All take the smallest step that one of them needs.
 */
#ifndef DAMPERFIT_LANE_STEPS_H
#define DAMPERFIT_LANE_STEPS_H

#include "lanes.h"
#include "network_mounting.h"
#include "tableau.h"

#define MOST_LOOKS 8   /* of Newton's; a step that needs more is halved */
#define SHARE_DONE 1e-4 /* these three as in network_stage.h */
#define PA_DONE 1e-3
#define ROUNDING_SHARE 4e-16

enum { MOST_CARRIED = 8 };

typedef struct {
    lanes full[2], inverse[2];
} room;

typedef struct {
    lanes s0, inverse_mass, series[DF_GAS_TERMS];
} gas_points;

typedef struct {
    lanes P[3], own[2], gas, fill[2], F[2], D, w[DF_PAIRS], g[DF_PAIRS];
} balances;

typedef struct {
    lanes y[2], inverse[2][2];
    room c;
    balances b;
} solved;

/* The running state of all parts. */
typedef struct {
    lanes y[2], F[2], fill[2], mid[2], old[2], P[3], own[2];
    lanes S[MOST_CARRIED][2], G[MOST_CARRIED][2];
    gas_points gas;
    double t_mid, t_old, wish;
} parts;

/* A number whose slopes are carried: its place; of a passage's number also the way, and how much the balances of
 * both chambers change with the number, for a flow of 1 on that way. */
typedef struct {
    int place, way;
    double rate[2];
} carried;

/* What does not change in a motion. */
typedef struct {
    const df_network *q;
    const df_options *o;
    int place[MOST_CARRIED];
    carried carried[MOST_CARRIED];
    int n_carried;
} job;

DF_FOR_EACH_KIND lanes to_root(double S, double eps, lanes w)
{
    const lanes flow = size_of(w), s = flow * (S * S * flow);
    return with_sign(root_of(0.5 * s * (s + root_of(s * s + 4.0 * eps * eps))), w);
}

DF_FOR_EACH_KIND int make_room(const df_network *q, lanes x, room *c)
{
    c->full[0] = q->plan.oil[0] - x * q->plan.swept[0];
    c->full[1] = q->plan.oil[1] + x * q->plan.swept[1];
    const lanes inverse = 1.0 / (c->full[0] * c->full[1]);
    c->inverse[0] = c->full[1] * inverse;
    c->inverse[1] = c->full[0] * inverse;
    return !any(~(c->full[0] > 0.0)) && !any(~(c->full[1] > 0.0));
}

/* A check, open for D < 0. */
DF_FOR_EACH_KIND void leak(lanes D, double inverse_R, double eps, lanes *w, lanes *g)
{
    const lanes u = larger_of(-D, all_of(0.0)), square = u * u + eps * eps, inverse_square = 1.0 / square;
    const lanes inverse = root_of(square) * inverse_square, straight = u * inverse_R;
    *w = -(u * straight) * inverse;
    *g = straight * (1.0 + eps * eps * inverse_square) * inverse;
}

/* An orifice, open both ways. */
DF_FOR_EACH_KIND void orifice(lanes D, double inverse_S, double eps, lanes *w, lanes *g)
{
    const lanes root = root_of(D * D + eps * eps), second = 1.0 / root, inverse = root_of(root) * second;
    *w = D * inverse_S * inverse;
    *g = (0.5 + 0.5 * eps * eps * (second * second)) * inverse_S * inverse;
}

DF_FOR_EACH_KIND void evaluate_all(const df_network *q, const room *c, const gas_points *gas, const lanes y[2],
                                   balances *b)
{
    const lanes zero = all_of(0.0), *a = gas->series;
    const double K = q->numbers[DF_NUMBER_K], P_0 = q->numbers[DF_NUMBER_P_0], eps = q->rounding;
    const lanes d = ((y[0] - q->plan.oil[0]) + (y[1] - q->plan.oil[1]) - gas->s0) * gas->inverse_mass, dd = d * d;
    b->P[2] = (a[0] + a[1] * d) + dd * ((a[2] + a[3] * d) + dd * ((a[4] + a[5] * d) + dd * a[6]));
    b->gas = gas->inverse_mass * ((a[1] + 2.0 * a[2] * d) +
                                  dd * ((3.0 * a[3] + 4.0 * a[4] * d) + dd * (5.0 * a[5] + 6.0 * a[6] * d)));
    for (int i = 0; i < 2; i++) {
        b->fill[i] = (y[i] - c->full[i]) * c->inverse[i];
        const lanes P = K * b->fill[i] + P_0;
        b->P[i] = larger_of(P, zero);
        b->own[i] = pick(P > zero, K * c->inverse[i], zero);
    }
    b->D = b->P[0] - b->P[2];
    orifice(b->D, q->plan.ways[0].inverse_S, eps, &b->w[DF_1_3], &b->g[DF_1_3]);
    leak(b->P[0] - b->P[1], q->plan.ways[1].inverse_R, eps, &b->w[DF_1_2], &b->g[DF_1_2]);
    leak(b->P[1] - b->P[2], q->plan.ways[2].inverse_R, eps, &b->w[DF_2_3], &b->g[DF_2_3]);
    b->F[0] = -(b->w[DF_1_3] + b->w[DF_1_2]);
    b->F[1] = b->w[DF_1_2] - b->w[DF_2_3];
}

/* The step of Newton for what a stage leaves, r, by (I - hd J)^-1. The slope of the orifice is known last,
 * and what waits for it is short. */
DF_FOR_EACH_KIND void correct(double hd, const lanes r[2], solved *e, lanes by[2])
{
    const balances *b = &e->b;
    const lanes own0 = b->own[0], own1 = b->own[1], gas = b->gas, beside = own0 - gas;
    const lanes h12 = hd * b->g[DF_1_2], h23 = hd * b->g[DF_2_3], h13 = hd * b->g[DF_1_3];
    const lanes held11 = 1.0 + h12 * own0, held12 = -(h12 * own1);
    const lanes a21 = -(h12 * own0 + h23 * gas), a22 = 1.0 + (h12 * own1 + h23 * (own1 - gas));
    const lanes a11 = held11 + h13 * beside, a12 = held12 - h13 * gas;
    const lanes det = 1.0 / ((held11 * a22 - held12 * a21) + h13 * (beside * a22 + gas * a21));
    by[0] = (a22 * r[0] - a12 * r[1]) * det;
    by[1] = (a11 * r[1] - a21 * r[0]) * det;
    e->inverse[0][0] = a22 * det;
    e->inverse[0][1] = -a12 * det;
    e->inverse[1][0] = -a21 * det;
    e->inverse[1][1] = a11 * det;
}

/* y = known + hd F(y) by Newton along the root, each lane until it is done. */
DF_FOR_EACH_KIND int solve_all(const job *t, const gas_points *gas, double hd, const lanes known[2], solved *e,
                               df_work *work)
{
    const df_network *q = t->q;
    const double K = q->numbers[DF_NUMBER_K], asked = 0.01 * t->o->tolerance, S = q->plan.ways[0].law.S;
    const double share = asked < SHARE_DONE ? asked : SHARE_DONE, least = PA_DONE + ROUNDING_SHARE * K;
    const lanes zero = all_of(0.0);
    balances *b = &e->b;
    for (int k = 0; k < MOST_LOOKS; k++) {
        evaluate_all(q, &e->c, gas, e->y, b);
        work->newton += DF_LANES;
        const lanes r[2] = {known[0] + hd * b->F[0] - e->y[0], known[1] + hd * b->F[1] - e->y[1]};
        lanes by[2];
        correct(hd, r, e, by);
        lanes e0 = by[0];
        const lanes e1 = by[1];
        const lanes done = least + share * larger_of(size_of(b->D), all_of(q->rounding));
        const marks is_done = (K * e->c.inverse[0] * size_of(e0) <= done) & (K * e->c.inverse[1] * size_of(e1) <= done);
        if (any(~is_done)) {
            const lanes slope = b->own[0] - b->gas, change = slope * e0 - b->gas * e1;
            const marks turns = ~is_done & (b->own[0] > zero) &
                                (size_of(change) > 0.02 * (size_of(b->D) + q->rounding));
            if (any(turns)) {
                const lanes to = to_root(S, q->rounding, b->w[DF_1_3] + b->g[DF_1_3] * change);
                e0 += pick(turns, (to - b->D - change) / slope, zero);
            }
            e->y[0] += e0;
            e->y[1] += e1;
            continue;
        }
        e->y[0] += e0;
        e->y[1] += e1;
        b->P[0] = larger_of(b->P[0] + b->own[0] * e0, zero);
        b->P[1] = larger_of(b->P[1] + b->own[1] * e1, zero);
        b->P[2] = larger_of(b->P[2] + b->gas * (e0 + e1), zero);
        for (int i = 0; i < 2; i++) {
            b->F[i] = (e->y[i] - known[i]) * (1.0 / hd);
            b->fill[i] = (e->y[i] - e->c.full[i]) * e->c.inverse[i];
        }
        return 1;
    }
    return 0;
}

/* What a number of the body does to the pressure of a chamber of oil, its mass held. */
DF_FOR_EACH_KIND lanes oil_by(const df_network *q, lanes P, int place)
{
    const lanes zero = all_of(0.0);
    if (place == DF_NUMBER_K)
        return pick(P > zero, (P - q->numbers[DF_NUMBER_P_0]) * q->plan.inverse_K, zero);
    return place == DF_NUMBER_P_0 ? pick(P > zero, all_of(1.0), zero) : zero;
}

/* The same of the gas: P = P_0 (1 + d)^-gamma. */
DF_FOR_EACH_KIND lanes gas_by(const df_network *q, lanes P, int place)
{
    const double inverse = 1.0 / q->numbers[DF_NUMBER_P_0];
    if (place == DF_NUMBER_P_0)
        return P * inverse;
    if (place != DF_NUMBER_GAMMA)
        return all_of(0.0);
    lanes by;
    for (int l = 0; l < DF_LANES; l++)
        by[l] = P[l] * log(P[l] * inverse) / q->numbers[DF_NUMBER_GAMMA];
    return by;
}

/* What a number does to the balances, the masses held. */
DF_FOR_EACH_KIND void by_number(const df_network *q, const balances *b, const carried *one, lanes F[2])
{
    const int place = one->place;
    if (place >= DF_FIRST_PASSAGE_NUMBER) {
        for (int i = 0; i < 2; i++)
            F[i] = one->rate[i] * b->w[one->way];
        return;
    }
    lanes P[2];
    const lanes gas = gas_by(q, b->P[2], place);
    for (int i = 0; i < 2; i++)
        P[i] = oil_by(q, b->P[i], place);
    const lanes w12 = b->g[DF_1_2] * (P[0] - P[1]);
    F[0] = -(b->g[DF_1_3] * (P[0] - gas)) - w12;
    F[1] = w12 - b->g[DF_2_3] * (P[1] - gas);
}

DF_FOR_EACH_KIND void carry_one(const df_network *q, const solved *e, double hd, const carried *one, const lanes past[2],
                                lanes S[2], lanes G[2])
{
    lanes F[2];
    by_number(q, &e->b, one, F);
    const lanes r0 = past[0] + hd * F[0], r1 = past[1] + hd * F[1];
    S[0] = e->inverse[0][0] * r0 + e->inverse[0][1] * r1;
    S[1] = e->inverse[1][0] * r0 + e->inverse[1][1] * r1;
    for (int i = 0; i < 2; i++)
        G[i] = (S[i] - past[i]) * (1.0 / hd);
}

/* The two ends of a sample interval in every part. */
typedef struct {
    lanes x0, x1, v0, v1;
    double interval;
} way;

DF_FOR_EACH_KIND lanes between(const way *c, double t)
{
    const double u = t / c->interval, w = 1.0 - u;
    return w * w * ((1.0 + 2.0 * u) * c->x0 + c->interval * u * c->v0) +
           u * u * ((1.0 + 2.0 * w) * c->x1 - c->interval * w * c->v1);
}

DF_FOR_EACH_KIND void guess(const lanes *one, const lanes *two, const lanes *three, const double at[4],
                            solved *e)
{
    const double t = at[0], r = 1.0 / ((at[2] - at[1]) * (at[3] - at[1]) * (at[3] - at[2]));
    const double w0 = (t - at[2]) * (t - at[3]) * (at[3] - at[2]) * r;
    const double w1 = -(t - at[1]) * (t - at[3]) * (at[3] - at[1]) * r, w2 = 1.0 - w0 - w1;
    for (int i = 0; i < 2; i++)
        e->y[i] = e->c.full[i] * (1.0 + (w0 * one[i] + w1 * two[i] + w2 * three[i]));
}

/* One step of all parts; 0 where one of them refuses it. */
DF_FOR_EACH_KIND int step_all(const job *t, const way *m, double from, double h, parts *p, df_work *work, double *error)
{
    const df_network *q = t->q;
    const double hd = h * DF_DIAGONAL, K = q->numbers[DF_NUMBER_K];
    const double mid_at[4] = {DF_C[1] * h, p->t_old, p->t_mid, 0.0}, end_at[4] = {h, p->t_mid, 0.0, DF_C[1] * h};
    solved mid, end;
    lanes known[2];
    if (!make_room(q, between(m, from + DF_C[1] * h), &mid.c))
        return 0;
    guess(p->old, p->mid, p->fill, mid_at, &mid);
    for (int i = 0; i < 2; i++)
        known[i] = p->y[i] + h * DF_A[1][0] * p->F[i];
    if (!solve_all(t, &p->gas, hd, known, &mid, work) || !make_room(q, between(m, from + h), &end.c))
        return 0;
    guess(p->mid, p->fill, mid.b.fill, end_at, &end);
    for (int i = 0; i < 2; i++)
        known[i] = p->y[i] + h * DF_A[2][0] * p->F[i] + h * DF_A[2][1] * mid.b.F[i];
    if (!solve_all(t, &p->gas, hd, known, &end, work))
        return 0;
    lanes r[2];
    for (int i = 0; i < 2; i++)
        r[i] = h * DF_E[0] * p->F[i] + h * DF_E[1] * mid.b.F[i] + h * DF_E[2] * end.b.F[i];
    const lanes off = larger_of(q->a_1 * K * end.c.inverse[0] * size_of(end.inverse[0][0] * r[0] + end.inverse[0][1] * r[1]),
                                q->a_2 * K * end.c.inverse[1] * size_of(end.inverse[1][0] * r[0] + end.inverse[1][1] * r[1]));
    *error = largest(off) / t->o->tolerance;
    if (!(*error <= 1.0))
        return 0;
    for (int j = 0; j < t->n_carried; j++) {
        lanes past[2], S[2], G[2], *mine = p->S[j], *rate = p->G[j];
        for (int i = 0; i < 2; i++)
            past[i] = mine[i] + h * DF_A[1][0] * rate[i];
        carry_one(q, &mid, hd, &t->carried[j], past, S, G);
        for (int i = 0; i < 2; i++)
            past[i] = mine[i] + h * DF_A[2][0] * rate[i] + h * DF_A[2][1] * G[i];
        carry_one(q, &end, hd, &t->carried[j], past, mine, rate);
    }
    for (int i = 0; i < 2; i++) {
        p->old[i] = p->fill[i];
        p->mid[i] = mid.b.fill[i];
        p->fill[i] = end.b.fill[i];
        p->y[i] = end.y[i];
        p->F[i] = end.b.F[i];
        p->own[i] = end.b.own[i];
    }
    for (int i = 0; i < 3; i++)
        p->P[i] = end.b.P[i];
    p->t_old = -h;
    p->t_mid = (DF_C[1] - 1.0) * h;
    return 1;
}

#endif
