/* Integration of the two mass balances by an L-stable diagonally implicit Runge-Kutta method with
 * exact forward sensitivities: each converged stage is differentiated with its own Newton matrix.
 *
 * A sample interval is one step, or is cut where the force error estimate asks for it (reversals).
 */
#include "core.h"
#include "tableau.h"

#include <float.h>
#include <math.h>

#define NEWTON_LIMIT 12
#define ODE_PARAMETERS 6 /* R_m1 R_m2 R_m3 K_e P_0 gamma move the state; f_f and f_0 do not */
/* A Newton correction of p Pa leaves p^2/(4 D) behind and turns the sensitivities by p/(2 D), so
 * the last correction may be this share of D = |P1 - P3| (and no larger than asked for, in N). */
#define SHARE_DONE 1e-4
#define PA_DONE 1e-3
/* A pressure is the difference of k m and K_e, which leaves a few of their last digits: no
 * correction can be asked to be smaller. Below a K_e of 1e12 Pa that is less than PA_DONE. */
#define DIGITS_DONE (4.0 * DBL_EPSILON)

typedef struct {
    double m1, m2;
} mass_pair;

/* What does not change during a simulation. */
typedef struct {
    const df_geometry *g;
    const df_parameters *p;
    double m_10, m_20;                   /* oil at x = 0 */
    double inverse_R1, inverse_R2, inverse_R3;
    double inverse_stiffness; /* rho_0/K_e */
    double share_done;
    int active[ODE_PARAMETERS], n_active; /* df parameter index of each sensitivity carried */
} problem;

/* Chamber stiffnesses at one instant. */
typedef struct {
    double k1, k2; /* K_e/(rho_0 V): Pa/kg */
    double inverse_k1, inverse_k2;
    df_gas_point *gas;
} chambers;

/* Pressures, flows and their slopes at one instant. */
typedef struct {
    double P1, P2, P3;       /* as they act: clamped at zero */
    double free1, free2;     /* as the masses alone would have it */
    double d1, d2, d3;       /* dP1/dm1, dP2/dm2, dP3/ds */
    df_law root, check2, check3;
    double F1, F2;
    double J11, J12, J21, J22;
} balance;

typedef struct {
    double a11, a12, a21, a22; /* inverse of I - h diagonal J */
} inverse2;

static int chamber_stiffness(const problem *q, double x, chambers *c)
{
    const double V1 = q->g->V_10 - x * q->g->a_p1;
    const double V2 = q->g->V_20 + x * q->g->a_p2;
    if (!(V1 > 0.0 && V2 > 0.0))
        return isfinite(x) ? DF_CHAMBER_EMPTY : DF_NOT_FINITE;
    const double shared = q->p->K_e / (q->g->rho_0 * V1 * V2);
    c->k1 = shared * V2;
    c->k2 = shared * V1;
    c->inverse_k1 = V1 * q->inverse_stiffness;
    c->inverse_k2 = V2 * q->inverse_stiffness;
    return DF_OK;
}

/* Eqs (4), (7), (11), (12), (17), (18) and the Jacobian of the mass balances. */
static void evaluate(const problem *q, const chambers *c, mass_pair m, balance *b)
{
    const df_law gas = df_gas_pressure(c->gas, (m.m1 - q->m_10) + (m.m2 - q->m_20));
    b->P3 = gas.value;
    b->d3 = gas.slope;
    b->free1 = (c->k1 * m.m1 - q->p->K_e) + q->p->P_0;
    b->free2 = (c->k2 * m.m2 - q->p->K_e) + q->p->P_0;
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

static void invert(const balance *b, double hd, inverse2 *i)
{
    const double a11 = 1.0 - hd * b->J11, a12 = -hd * b->J12;
    const double a21 = -hd * b->J21, a22 = 1.0 - hd * b->J22;
    const double r = 1.0 / (a11 * a22 - a12 * a21);
    i->a11 = a22 * r;
    i->a12 = -a12 * r;
    i->a21 = -a21 * r;
    i->a22 = a11 * r;
}

/* Newton in the masses, but moved along the root of P1 - P3, in which valve 1 is smooth: plain
 * Newton jumps to and fro across the singularity at a reversal. Returns 0 when it converged. */
static int solve_stage(const problem *q, const chambers *c, mass_pair known, double hd,
                       double inverse_hd, mass_pair *m, balance *b, inverse2 *inverse, df_work *work)
{
    for (int k = 0; k < NEWTON_LIMIT; k++) {
        evaluate(q, c, *m, b);
        invert(b, hd, inverse);
        work->newton++;
        const double r1 = known.m1 + hd * b->F1 - m->m1;
        const double r2 = known.m2 + hd * b->F2 - m->m2;
        double e1 = inverse->a11 * r1 + inverse->a12 * r2;
        const double e2 = inverse->a21 * r1 + inverse->a22 * r2;
        const double D = b->P1 - b->P3;
        const double p1 = fabs(c->k1 * e1), p2 = fabs(c->k2 * e2);
        const double rounded = DIGITS_DONE * (q->p->K_e + fabs(b->free1) + fabs(b->free2));
        const double done = (rounded > PA_DONE ? rounded : PA_DONE) + q->share_done * fabs(D);
        const int converged = p1 <= done && p2 <= done;
        if (!(p1 < INFINITY && p2 < INFINITY))
            return 1;
        if (!converged && b->d1 > 0.0) {
            const double slope = b->d1 - b->d3;
            const double dD = slope * e1 - b->d3 * e2;
            const double z = b->root.value + b->root.slope * dD;
            if (fabs(dD) > 0.02 * fabs(D))
                e1 += (df_signed_root_inverse(z) - D - dD) / slope;
        }
        m->m1 += e1;
        m->m2 += e2;
        if (converged) {
            b->F1 = (m->m1 - known.m1) * inverse_hd;
            b->F2 = (m->m2 - known.m2) * inverse_hd;
            b->free1 += c->k1 * e1;
            b->free2 += c->k2 * e2;
            b->P1 = b->free1 > 0.0 ? b->free1 : 0.0;
            b->P2 = b->free2 > 0.0 ? b->free2 : 0.0;
            b->P3 += b->d3 * (e1 + e2);
            return 0;
        }
    }
    return 1;
}

/* Direct influence of a parameter on the free pressures and on P3. */
static void pressure_slopes(const problem *q, const balance *b, double s, int parameter,
                            double *P1, double *P2, double *P3)
{
    const double full1 = b->free1 > 0.0, full2 = b->free2 > 0.0;
    double by_P_0, by_gamma;
    *P1 = *P2 = *P3 = 0.0;
    if (parameter == DF_K_E) {
        *P1 = full1 * (b->free1 - q->p->P_0) / q->p->K_e;
        *P2 = full2 * (b->free2 - q->p->P_0) / q->p->K_e;
    } else if (parameter == DF_P_0 || parameter == DF_GAMMA) {
        df_gas_slopes(q->g, q->p, b->P3, s, &by_P_0, &by_gamma);
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
static mass_pair balance_slopes(const problem *q, const balance *b, double s, int parameter)
{
    mass_pair F = {0.0, 0.0};
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

/* The running state between steps. */
typedef struct {
    mass_pair m;
    mass_pair F;                     /* of the last stage */
    mass_pair S[ODE_PARAMETERS];     /* dm/d(parameter) */
    mass_pair G[ODE_PARAMETERS];     /* dS/dt of the last stage */
    balance b;                       /* at m */
    double free_mid1, free_mid2;     /* free pressures in mid-step, for the next prediction */
    double free_old1, free_old2, t_mid, t_old;
} state;

typedef struct {
    double x0, x1, v0, v1, interval, inverse_interval;
} piece;

static double hermite(const piece *c, double t)
{
    const double u = t * c->inverse_interval, w = 1.0 - u;
    return w * w * ((1.0 + 2.0 * u) * c->x0 + c->interval * u * c->v0) +
           u * u * ((1.0 + 2.0 * w) * c->x1 - c->interval * w * c->v1);
}

/* Weights at t of the values at t0, t1, t2 on their parabola. */
static void parabola(double t, double t0, double t1, double t2, double w[3])
{
    const double r = 1.0 / ((t1 - t0) * (t2 - t0) * (t2 - t1));
    w[0] = (t - t1) * (t - t2) * (t2 - t1) * r;
    w[1] = -(t - t0) * (t - t2) * (t2 - t0) * r;
    w[2] = 1.0 - w[0] - w[1];
}

enum { STEP_TAKEN, STEP_REFUSED };

/* One step of length h from time t of the sample interval. `now` becomes the new state and
 * `error` the force error in units of the tolerance; a refused step leaves `now` alone. */
static int step(const problem *q, const piece *motion, double t, double h, double tolerance,
                state *now, df_gas_point *gas, df_work *work, double *error, int *code)
{
    const double hd = h * DF_DIAGONAL, inverse_hd = 1.0 / hd;
    mass_pair F[DF_STAGES], G[ODE_PARAMETERS][DF_STAGES], m = now->m, S[ODE_PARAMETERS];
    double free1[DF_STAGES], free2[DF_STAGES];
    balance b = now->b;
    inverse2 inverse = {0};
    chambers c = {0};
    c.gas = gas;
    F[0] = now->F;
    free1[0] = now->b.free1;
    free2[0] = now->b.free2;
    for (int j = 0; j < q->n_active; j++)
        G[j][0] = now->G[j];
    for (int i = 1; i < DF_STAGES; i++) {
        *code = chamber_stiffness(q, hermite(motion, t + DF_C[i] * h), &c);
        if (*code != DF_OK)
            return STEP_REFUSED;
        mass_pair known = now->m;
        for (int k = 0; k < i; k++) {
            known.m1 += h * DF_A[i][k] * F[k].m1;
            known.m2 += h * DF_A[i][k] * F[k].m2;
        }
        double w[3], guess1, guess2;
        if (i == 1) {
            parabola(DF_C[1] * h, now->t_old, now->t_mid, 0.0, w);
            guess1 = w[0] * now->free_old1 + w[1] * now->free_mid1 + w[2] * free1[0];
            guess2 = w[0] * now->free_old2 + w[1] * now->free_mid2 + w[2] * free2[0];
        } else {
            parabola(DF_C[2] * h, now->t_mid, 0.0, DF_C[1] * h, w);
            guess1 = w[0] * now->free_mid1 + w[1] * free1[0] + w[2] * free1[1];
            guess2 = w[0] * now->free_mid2 + w[1] * free2[0] + w[2] * free2[1];
        }
        m.m1 = (guess1 - q->p->P_0 + q->p->K_e) * c.inverse_k1;
        m.m2 = (guess2 - q->p->P_0 + q->p->K_e) * c.inverse_k2;
        if (solve_stage(q, &c, known, hd, inverse_hd, &m, &b, &inverse, work))
            return STEP_REFUSED;
        F[i].m1 = b.F1;
        F[i].m2 = b.F2;
        free1[i] = b.free1;
        free2[i] = b.free2;
        for (int j = 0; j < q->n_active; j++) {
            const mass_pair slope = balance_slopes(q, &b, m.m1 + m.m2 - q->m_10 - q->m_20, q->active[j]);
            mass_pair past = now->S[j];
            for (int k = 0; k < i; k++) {
                past.m1 += h * DF_A[i][k] * G[j][k].m1;
                past.m2 += h * DF_A[i][k] * G[j][k].m2;
            }
            const double r1 = past.m1 + hd * slope.m1, r2 = past.m2 + hd * slope.m2;
            S[j].m1 = inverse.a11 * r1 + inverse.a12 * r2;
            S[j].m2 = inverse.a21 * r1 + inverse.a22 * r2;
            G[j][i].m1 = (S[j].m1 - past.m1) * inverse_hd;
            G[j][i].m2 = (S[j].m2 - past.m2) * inverse_hd;
        }
    }
    double e1 = 0.0, e2 = 0.0;
    for (int k = 0; k < DF_STAGES; k++) {
        e1 += h * DF_E[k] * F[k].m1;
        e2 += h * DF_E[k] * F[k].m2;
    }
    const double force1 = q->g->a_p1 * c.k1 * fabs(inverse.a11 * e1 + inverse.a12 * e2);
    const double force2 = q->g->a_p2 * c.k2 * fabs(inverse.a21 * e1 + inverse.a22 * e2);
    *error = (force1 > force2 ? force1 : force2) / tolerance;
    if (!(*error <= 1.0))
        return STEP_REFUSED;
    now->m = m;
    now->F = F[DF_STAGES - 1];
    now->b = b;
    for (int j = 0; j < q->n_active; j++) {
        now->S[j] = S[j];
        now->G[j] = G[j][DF_STAGES - 1];
    }
    now->t_old = -h;
    now->t_mid = (DF_C[1] - 1.0) * h;
    now->free_old1 = free1[0];
    now->free_old2 = free2[0];
    now->free_mid1 = free1[1];
    now->free_mid2 = free2[1];
    return STEP_TAKEN;
}

/* All chambers at one pressure at x, with the oil mass of the damper at x = 0. */
static int start(const problem *q, double x, state *now, df_gas_point *gas)
{
    const df_geometry *g = q->g;
    const df_parameters *p = q->p;
    chambers c;
    c.gas = gas;
    const int code = chamber_stiffness(q, x, &c);
    if (code != DF_OK)
        return code;
    const double V = (g->V_10 - x * g->a_p1) + (g->V_20 + x * g->a_p2);
    const double s_P = g->rho_0 * V / p->K_e;
    const double s_0 = g->rho_0 * x * (g->a_p2 - g->a_p1);
    double P = p->P_0, s = s_0;
    df_law gas_law = {0.0, 0.0};
    for (int k = 0; k < 50; k++) {
        s = s_0 + s_P * (P - p->P_0);
        if (df_gas_expand(g, p, s, gas))
            return DF_CHAMBER_EMPTY;
        gas_law = df_gas_pressure(gas, s);
        const double change = (gas_law.value - P) / (1.0 - gas_law.slope * s_P);
        P += change;
        if (fabs(change) <= 1e-12 * P)
            break;
    }
    now->m.m1 = (P - p->P_0 + p->K_e) / c.k1;
    now->m.m2 = (P - p->P_0 + p->K_e) / c.k2;
    evaluate(q, &c, now->m, &now->b);
    now->F.m1 = now->b.F1;
    now->F.m2 = now->b.F2;
    for (int j = 0; j < q->n_active; j++) {
        /* P(theta) by the implicit function theorem, then m(P, theta). */
        double P1, P2, P3;
        pressure_slopes(q, &now->b, s, q->active[j], &P1, &P2, &P3);
        const double change = (P3 - gas_law.slope * s_P * P1) / (1.0 - gas_law.slope * s_P);
        now->S[j].m1 = (change - P1) / c.k1;
        now->S[j].m2 = (change - P2) / c.k2;
        const mass_pair slope = balance_slopes(q, &now->b, s, q->active[j]);
        now->G[j].m1 = now->b.J11 * now->S[j].m1 + now->b.J12 * now->S[j].m2 + slope.m1;
        now->G[j].m2 = now->b.J21 * now->S[j].m1 + now->b.J22 * now->S[j].m2 + slope.m2;
    }
    now->t_old = -2.0;
    now->t_mid = -1.0;
    now->free_old1 = now->free_mid1 = now->b.free1;
    now->free_old2 = now->free_mid2 = now->b.free2;
    return DF_OK;
}

/* Eq. (20) and its sensitivities at sample i. */
static void record(const problem *q, const state *now, const df_result *r, size_t i, size_t n, double friction)
{
    const balance *b = &now->b;
    const double s = now->m.m1 + now->m.m2 - q->m_10 - q->m_20;
    r->pressures[i] = b->P1;
    r->pressures[n + i] = b->P2;
    r->pressures[2 * n + i] = b->P3;
    r->masses[i] = now->m.m1;
    r->masses[n + i] = now->m.m2;
    r->force[i] = b->P1 * q->g->a_p1 - b->P2 * q->g->a_p2 + q->p->f_f * friction + q->p->f_0;
    int carried = 0;
    for (int j = 0; j < r->n_which; j++) {
        double slope;
        if (r->which[j] == DF_F_F) {
            slope = friction;
        } else if (r->which[j] == DF_F_0) {
            slope = 1.0;
        } else {
            double P1, P2, P3;
            pressure_slopes(q, b, s, r->which[j], &P1, &P2, &P3);
            P1 += b->d1 * now->S[carried].m1;
            P2 += b->d2 * now->S[carried].m2;
            slope = P1 * q->g->a_p1 - P2 * q->g->a_p2;
            carried++;
        }
        r->sensitivities[(size_t)j * n + i] = slope;
    }
}

static int prepare(const df_geometry *g, const df_parameters *p, const df_options *o,
                   const df_motion *motion, const df_result *r, problem *q)
{
    const int positive = p->R_m1 > 0.0 && p->R_m2 > 0.0 && p->R_m3 > 0.0 && p->K_e > 0.0 && p->P_0 > 0.0 &&
                         p->gamma > 0.0 && motion->interval > 0.0 && o->tolerance > 0.0 && o->dead_band > 0.0;
    const double all = p->R_m1 + p->R_m2 + p->R_m3 + p->K_e + p->P_0 + p->gamma + p->f_f + p->f_0 + motion->interval;
    if (!positive || !isfinite(all) || motion->n < 1 || r->n_which < 0 || r->n_which > DF_N_PARAMETERS)
        return DF_BAD_ARGUMENT;
    q->g = g;
    q->p = p;
    q->m_10 = g->rho_0 * g->V_10;
    q->m_20 = g->rho_0 * g->V_20;
    q->share_done = fmin(SHARE_DONE, 0.01 * o->tolerance);
    q->inverse_stiffness = g->rho_0 / p->K_e;
    q->inverse_R1 = 1.0 / p->R_m1;
    q->inverse_R2 = 1.0 / p->R_m2;
    q->inverse_R3 = 1.0 / p->R_m3;
    q->n_active = 0;
    for (int j = 0; j < r->n_which; j++) {
        if (r->which[j] < 0 || r->which[j] >= DF_N_PARAMETERS)
            return DF_BAD_ARGUMENT;
        if (r->which[j] != DF_F_F && r->which[j] != DF_F_0) {
            if (q->n_active == ODE_PARAMETERS)
                return DF_BAD_ARGUMENT;
            q->active[q->n_active++] = r->which[j];
        }
    }
    return DF_OK;
}

int df_simulate(const df_geometry *g, const df_parameters *p, const df_options *o,
                const df_motion *motion, const df_result *r, df_work *work)
{
    problem q;
    state now;
    df_gas_point gas;
    work->steps = work->rejected = work->newton = 0;
    work->failed_sample = 0;
    int code = prepare(g, p, o, motion, r, &q);
    if (code == DF_OK && !isfinite(motion->v[0]))
        code = DF_NOT_FINITE;
    if (code == DF_OK)
        code = start(&q, motion->x[0], &now, &gas);
    if (code != DF_OK)
        return code;
    const size_t n = motion->n;
    const double interval = motion->interval;
    double wish = 0.05 * interval;
    record(&q, &now, r, 0, n, df_friction_share(motion->v[0], o->dead_band));
    for (size_t i = 1; i < n; i++) {
        const piece cut = {motion->x[i - 1], motion->x[i], motion->v[i - 1], motion->v[i], interval,
                           1.0 / interval};
        double t = 0.0;
        long tries = 0;
        work->failed_sample = i;
        if (!isfinite(cut.x1) || !isfinite(cut.v0) || !isfinite(cut.v1))
            return DF_NOT_FINITE;
        while (t < interval) {
            const double left = interval - t;
            const int last = wish >= left * (1.0 - 1e-9);
            const double h = last ? left : (2.0 * wish > left ? 0.5 * left : wish);
            double error = INFINITY;
            const double s = now.m.m1 + now.m.m2 - q.m_10 - q.m_20;
            if (!df_gas_is_near(&gas, s) && df_gas_expand(g, p, s, &gas))
                return DF_CHAMBER_EMPTY;
            if (++tries > o->max_steps_per_sample)
                return DF_STEP_LIMIT;
            if (step(&q, &cut, t, h, o->tolerance, &now, &gas, work, &error, &code) == STEP_TAKEN) {
                work->steps++;
                t = last ? interval : t + h;
                if (wish < interval || error > 0.5) {
                    const double grow = 0.9 / cbrt(error + 1e-10);
                    const double next = h * (grow > 5.0 ? 5.0 : grow);
                    wish = (last && grow > 1.0 && next < wish) ? wish : next;
                }
            } else {
                if (code != DF_OK)
                    return code;
                work->rejected++;
                const double shrink = error < INFINITY ? 0.9 / cbrt(error) : 0.2;
                wish = h * (shrink < 0.1 ? 0.1 : shrink);
            }
        }
        if (!isfinite(now.b.P1) || !isfinite(now.b.P2) || !isfinite(now.b.P3))
            return DF_NOT_FINITE;
        record(&q, &now, r, i, n, df_friction_share(motion->v[i], o->dead_band));
    }
    work->failed_sample = n;
    return DF_OK;
}
