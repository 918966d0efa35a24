/* Integration of the two mass balances by an L-stable diagonally implicit Runge-Kutta method with
 * exact forward sensitivities: each converged stage is differentiated with its own Newton matrix.
 *
 * A sample interval is one step, or is cut where the force error estimate asks for it (reversals).
 */
#include "balance.h"
#include "tableau.h"

#include <float.h>
#include <math.h>

#define NEWTON_LIMIT 12
/* A Newton correction of p Pa leaves p^2/(4 D) behind and turns the sensitivities by p/(2 D), so
 * the last correction may be this share of D = |P1 - P3| (and no larger than asked for, in N). */
#define SHARE_DONE 1e-4
#define PA_DONE 1e-3
/* A pressure is the difference of k m and K_e, which leaves a few of their last digits: no
 * correction can be asked to be smaller. Below a K_e of 1e12 Pa that is less than PA_DONE. */
#define DIGITS_DONE (4.0 * DBL_EPSILON)

typedef struct {
    double a11, a12, a21, a22; /* inverse of I - h diagonal J */
} inverse2;

static void invert(const df_balance *b, double hd, inverse2 *i)
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
static int solve_stage(const df_problem *q, const chambers *c, df_masses known, double hd,
                       double inverse_hd, df_masses *m, df_balance *b, inverse2 *inverse, df_work *work)
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
        const double rounded = DIGITS_DONE * (q->p.K_e + fabs(b->free1) + fabs(b->free2));
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
static int step(const df_problem *restrict q, const piece *motion, double t, double h, df_run *now,
                df_work *restrict work, double *error, int *code)
{
    const double hd = h * DF_DIAGONAL, inverse_hd = 1.0 / hd;
    df_masses F[DF_STAGES], G[DF_ODE_PARAMETERS][DF_STAGES], m = now->m, S[DF_ODE_PARAMETERS];
    double free1[DF_STAGES], free2[DF_STAGES];
    df_balance b = now->b;
    inverse2 inverse = {0};
    chambers c = {0};
    c.gas = &now->gas;
    F[0] = now->F;
    free1[0] = now->b.free1;
    free2[0] = now->b.free2;
    for (int j = 0; j < q->n_active; j++)
        G[j][0] = now->G[j];
    for (int i = 1; i < DF_STAGES; i++) {
        *code = chamber_stiffness(q, hermite(motion, t + DF_C[i] * h), &c);
        if (*code != DF_OK)
            return STEP_REFUSED;
        df_masses known = now->m;
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
        m.m1 = (guess1 - q->p.P_0 + q->p.K_e) * c.inverse_k1;
        m.m2 = (guess2 - q->p.P_0 + q->p.K_e) * c.inverse_k2;
        if (solve_stage(q, &c, known, hd, inverse_hd, &m, &b, &inverse, work))
            return STEP_REFUSED;
        F[i].m1 = b.F1;
        F[i].m2 = b.F2;
        free1[i] = b.free1;
        free2[i] = b.free2;
        for (int j = 0; j < q->n_active; j++) {
            const df_masses slope = balance_slopes(q, &b, m.m1 + m.m2 - q->m_10 - q->m_20, q->active[j]);
            df_masses past = now->S[j];
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
    const double force1 = q->g.a_p1 * c.k1 * fabs(inverse.a11 * e1 + inverse.a12 * e2);
    const double force2 = q->g.a_p2 * c.k2 * fabs(inverse.a21 * e1 + inverse.a22 * e2);
    *error = (force1 > force2 ? force1 : force2) / q->o.tolerance;
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

/* Flows at the masses, and no past to predict from. */
static void restart(df_run *now, const chambers *c)
{
    evaluate(&now->q, c, now->m, &now->b);
    now->F.m1 = now->b.F1;
    now->F.m2 = now->b.F2;
    now->t_old = -2.0;
    now->t_mid = -1.0;
    now->free_old1 = now->free_mid1 = now->b.free1;
    now->free_old2 = now->free_mid2 = now->b.free2;
}

static void rates_of_slopes(df_run *now, double s)
{
    const df_balance *b = &now->b;
    for (int j = 0; j < now->q.n_active; j++) {
        const df_masses slope = balance_slopes(&now->q, b, s, now->q.active[j]);
        now->G[j].m1 = b->J11 * now->S[j].m1 + b->J12 * now->S[j].m2 + slope.m1;
        now->G[j].m2 = b->J21 * now->S[j].m1 + b->J22 * now->S[j].m2 + slope.m2;
    }
}

/* All chambers at one pressure at x, with the oil mass of the damper at x = 0. */
static int start(double x, df_run *now)
{
    const df_problem *q = &now->q;
    const df_geometry *g = &q->g;
    const df_parameters *p = &q->p;
    df_gas_point *gas = &now->gas;
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
    restart(now, &c);
    for (int j = 0; j < q->n_active; j++) {
        /* P(theta) by the implicit function theorem, then m(P, theta). */
        double P1, P2, P3;
        pressure_slopes(q, &now->b, s, q->active[j], &P1, &P2, &P3);
        const double change = (P3 - gas_law.slope * s_P * P1) / (1.0 - gas_law.slope * s_P);
        now->S[j].m1 = (change - P1) / c.k1;
        now->S[j].m2 = (change - P2) / c.k2;
    }
    rates_of_slopes(now, s);
    return DF_OK;
}

static int prepare(const df_geometry *g, const df_parameters *p, const df_options *o, df_problem *q)
{
    const int positive = p->R_m1 > 0.0 && p->R_m2 > 0.0 && p->R_m3 > 0.0 && p->K_e > 0.0 && p->P_0 > 0.0 &&
                         p->gamma > 0.0 && o->tolerance > 0.0 && o->dead_band > 0.0;
    const double all = p->R_m1 + p->R_m2 + p->R_m3 + p->K_e + p->P_0 + p->gamma + p->f_f + p->f_0;
    if (!positive || !isfinite(all))
        return DF_BAD_ARGUMENT;
    q->g = *g;
    q->p = *p;
    q->o = *o;
    q->m_10 = g->rho_0 * g->V_10;
    q->m_20 = g->rho_0 * g->V_20;
    q->share_done = fmin(SHARE_DONE, 0.01 * o->tolerance);
    q->inverse_stiffness = g->rho_0 / p->K_e;
    q->inverse_R1 = 1.0 / p->R_m1;
    q->inverse_R2 = 1.0 / p->R_m2;
    q->inverse_R3 = 1.0 / p->R_m3;
    return DF_OK;
}

static int ask(const int *which, int n_which, df_problem *q)
{
    if (n_which < 0 || n_which > DF_N_PARAMETERS)
        return DF_BAD_ARGUMENT;
    q->n_which = n_which;
    q->n_active = 0;
    for (int j = 0; j < n_which; j++) {
        if (which[j] < 0 || which[j] >= DF_N_PARAMETERS)
            return DF_BAD_ARGUMENT;
        q->which[j] = which[j];
        if (which[j] != DF_F_F && which[j] != DF_F_0) {
            if (q->n_active == DF_ODE_PARAMETERS)
                return DF_BAD_ARGUMENT;
            q->active[q->n_active++] = which[j];
        }
    }
    return DF_OK;
}

int df_begin(const df_geometry *g, const df_parameters *p, const df_options *o, const int *which,
             int n_which, double x, double v, df_run *run)
{
    int code = prepare(g, p, o, &run->q);
    if (code == DF_OK)
        code = ask(which, n_which, &run->q);
    if (code == DF_OK && !isfinite(v))
        code = DF_NOT_FINITE;
    if (code == DF_OK)
        code = start(x, run);
    run->wish = 0.0;
    run->x = x;
    run->v = v;
    return code;
}

int df_advance(df_run *run, double interval, double x, double v, df_work *work)
{
    const df_problem *q = &run->q;
    const piece cut = {run->x, x, run->v, v, interval, 1.0 / interval};
    double t = 0.0, wish = run->wish > 0.0 ? run->wish : 0.05 * interval;
    long tries = 0;
    int code = DF_OK;
    if (!(interval > 0.0 && isfinite(interval)))
        return DF_BAD_ARGUMENT;
    if (!isfinite(x) || !isfinite(run->v) || !isfinite(v))
        return DF_NOT_FINITE;
    while (t < interval) {
        const double left = interval - t;
        const int last = wish >= left * (1.0 - 1e-9);
        const double h = last ? left : (2.0 * wish > left ? 0.5 * left : wish);
        double error = INFINITY;
        const double s = run->m.m1 + run->m.m2 - q->m_10 - q->m_20;
        if (!df_gas_is_near(&run->gas, s) && df_gas_expand(&q->g, &q->p, s, &run->gas))
            return DF_CHAMBER_EMPTY;
        if (++tries > q->o.max_steps_per_sample)
            return DF_STEP_LIMIT;
        if (step(q, &cut, t, h, run, work, &error, &code) == STEP_TAKEN) {
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
    run->wish = wish;
    run->x = x;
    run->v = v;
    return isfinite(run->b.P1) && isfinite(run->b.P2) && isfinite(run->b.P3) ? DF_OK : DF_NOT_FINITE;
}

double df_force(const df_run *run, double *slopes)
{
    const df_problem *q = &run->q;
    const df_balance *b = &run->b;
    const double friction = df_friction_share(run->v, q->o.dead_band);
    const double s = run->m.m1 + run->m.m2 - q->m_10 - q->m_20;
    int carried = 0;
    for (int j = 0; j < q->n_which; j++) {
        if (q->which[j] == DF_F_F) {
            slopes[j] = friction;
        } else if (q->which[j] == DF_F_0) {
            slopes[j] = 1.0;
        } else {
            double P1, P2, P3;
            pressure_slopes(q, b, s, q->which[j], &P1, &P2, &P3);
            P1 += b->d1 * run->S[carried].m1;
            P2 += b->d2 * run->S[carried].m2;
            slopes[j] = P1 * q->g.a_p1 - P2 * q->g.a_p2;
            carried++;
        }
    }
    return b->P1 * q->g.a_p1 - b->P2 * q->g.a_p2 + q->p.f_f * friction + q->p.f_0;
}

static void record(const df_run *run, const df_result *r, size_t i, size_t n)
{
    double slopes[DF_N_PARAMETERS];
    r->pressures[i] = run->b.P1;
    r->pressures[n + i] = run->b.P2;
    r->pressures[2 * n + i] = run->b.P3;
    r->masses[i] = run->m.m1;
    r->masses[n + i] = run->m.m2;
    r->force[i] = df_force(run, slopes);
    for (int j = 0; j < r->n_which; j++)
        r->sensitivities[(size_t)j * n + i] = slopes[j];
}

int df_simulate(const df_geometry *g, const df_parameters *p, const df_options *o,
                const df_motion *motion, const df_result *r, df_work *work)
{
    df_run run;
    work->steps = work->rejected = work->newton = 0;
    work->failed_sample = 0;
    if (motion->n < 1 || !(motion->interval > 0.0 && isfinite(motion->interval)))
        return DF_BAD_ARGUMENT;
    int code = df_begin(g, p, o, r->which, r->n_which, motion->x[0], motion->v[0], &run);
    if (code != DF_OK)
        return code;
    const size_t n = motion->n;
    record(&run, r, 0, n);
    for (size_t i = 1; i < n; i++) {
        work->failed_sample = i;
        code = df_advance(&run, motion->interval, motion->x[i], motion->v[i], work);
        if (code != DF_OK)
            return code;
        record(&run, r, i, n);
    }
    work->failed_sample = n;
    return DF_OK;
}

int df_place(df_run *run, double m1, double m2, double x, double v)
{
    const df_problem *q = &run->q;
    chambers c;
    if (!isfinite(m1) || !isfinite(m2) || !isfinite(v))
        return DF_NOT_FINITE;
    const int code = chamber_stiffness(q, x, &c);
    if (code != DF_OK)
        return code;
    if (!df_gas_is_near(&run->gas, m1 + m2) && df_gas_expand(&q->g, &q->p, m1 + m2, &run->gas))
        return DF_CHAMBER_EMPTY;
    c.gas = &run->gas;
    run->m.m1 = q->m_10 + m1;
    run->m.m2 = q->m_20 + m2;
    run->x = x;
    run->v = v;
    restart(run, &c);
    return DF_OK;
}

/* What a parameter does to the free pressures at constant masses. */
static df_masses free_slopes(const df_problem *q, const df_balance *b, int parameter)
{
    df_masses slope = {0.0, 0.0};
    if (parameter == DF_K_E) {
        slope.m1 = (b->free1 - q->p.P_0) / q->p.K_e;
        slope.m2 = (b->free2 - q->p.P_0) / q->p.K_e;
    } else if (parameter == DF_P_0) {
        slope.m1 = slope.m2 = 1.0;
    }
    return slope;
}

static double parameter_at(const df_parameters *p, int place)
{
    const double all[DF_N_PARAMETERS] = {p->R_m1, p->R_m2, p->R_m3, p->K_e,
                                         p->f_f,  p->f_0,  p->P_0,  p->gamma};
    return all[place];
}

int df_retune(df_run *run, const df_parameters *p, double dead_band)
{
    df_problem changed = run->q;
    df_options o = run->q.o;
    df_masses kept[DF_ODE_PARAMETERS]; /* slopes of the free pressures, which stay as they are */
    chambers c;
    o.dead_band = dead_band;
    int code = prepare(&run->q.g, p, &o, &changed);
    if (code == DF_OK)
        code = chamber_stiffness(&run->q, run->x, &c);
    if (code != DF_OK)
        return code;
    for (int j = 0; j < changed.n_active; j++) {
        const int place = changed.active[j];
        const int is_new = parameter_at(&run->q.p, place) != parameter_at(p, place);
        const df_masses direct = free_slopes(&run->q, &run->b, place);
        kept[j].m1 = is_new ? 0.0 : direct.m1 + c.k1 * run->S[j].m1;
        kept[j].m2 = is_new ? 0.0 : direct.m2 + c.k2 * run->S[j].m2;
    }
    const double free1 = run->b.free1, free2 = run->b.free2;
    run->q = changed;
    code = chamber_stiffness(&run->q, run->x, &c);
    c.gas = &run->gas;
    run->m.m1 = (free1 - p->P_0 + p->K_e) * c.inverse_k1;
    run->m.m2 = (free2 - p->P_0 + p->K_e) * c.inverse_k2;
    const double s = run->m.m1 + run->m.m2 - run->q.m_10 - run->q.m_20;
    if (df_gas_expand(&run->q.g, p, s, &run->gas))
        return DF_CHAMBER_EMPTY;
    restart(run, &c);
    for (int j = 0; j < changed.n_active; j++) {
        const df_masses direct = free_slopes(&run->q, &run->b, changed.active[j]);
        run->S[j].m1 = (kept[j].m1 - direct.m1) * c.inverse_k1;
        run->S[j].m2 = (kept[j].m2 - direct.m2) * c.inverse_k2;
    }
    rates_of_slopes(run, s);
    return code;
}
