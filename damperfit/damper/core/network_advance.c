/* Integration of a network by an L-stable diagonally implicit Runge-Kutta method with exact forward
 * sensitivities: each converged stage is differentiated with its own Newton matrix.
 *
 * A sample interval is one step, or is cut where the force error estimate asks for it (reversals). The
 * step is compiled for each kind of damper that is common, and once for all others.
 */
#include "network_stage.h"
#include "tableau.h"

typedef struct {
    double x0, x1, v0, v1, interval, inverse_interval;
} piece;

static inline double hermite(const piece *c, double t)
{
    const double u = t * c->inverse_interval, w = 1.0 - u;
    return w * w * ((1.0 + 2.0 * u) * c->x0 + c->interval * u * c->v0) +
           u * u * ((1.0 + 2.0 * w) * c->x1 - c->interval * w * c->v1);
}

/* The speed along it. */
static inline double hermite_speed(const piece *c, double t)
{
    const double u = t * c->inverse_interval, w = 1.0 - u;
    return 6.0 * u * w * (c->x1 - c->x0) * c->inverse_interval + w * (w - 2.0 * u) * c->v0 + u * (u - 2.0 * w) * c->v1;
}

/* Weights at t of the values at t0, t1, t2 on their parabola. */
static inline void parabola(double t, double t0, double t1, double t2, double w[3])
{
    const double r = 1.0 / ((t1 - t0) * (t2 - t0) * (t2 - t1));
    w[0] = (t - t1) * (t - t2) * (t2 - t1) * r;
    w[1] = -(t - t0) * (t - t2) * (t2 - t0) * r;
    w[2] = 1.0 - w[0] - w[1];
}


enum { STEP_TAKEN, STEP_REFUSED };

/* One number's slopes over a stage, by its own Newton matrix: from what is known, `past`, to those of the
 * state and of its rates. */
DF_FOR_EACH_KIND void carry_stage(const stage *s, const int kind, solution *end, int place, const double remembered[2],
                                  const double past[DF_STATES], double S[DF_STATES], double G[DF_STATES])
{
    const int n = kind & DF_IS_ELASTIC ? 3 : 2;
    double slope[DF_STATES], r[DF_STATES];
    balance_by(s->q, kind, &end->b, &end->f, end->taken, s->from.v, place, slope);
    for (int i = 0; i < n; i++)
        r[i] = past[i] + s->hd * slope[i];
    /* Friction is by the speed (y - known)/hd, whose known part has a slope too; and what it remembers
     * has moved. */
    if (kind & DF_IS_ELASTIC)
        r[DF_PISTON] = slope[DF_PISTON] - end->b.rub * remembered[0] +
                       s->q->numbers[DF_NUMBER_RUBBER] * remembered[1] + end->b.brake * s->inverse_hd * past[DF_PISTON];
    apply(kind, end->inverse, r, S);
    for (int i = 0; i < n; i++)
        G[i] = (S[i] - past[i]) * s->inverse_hd;
}

/* The sensitivities of a step that is taken. */
DF_FOR_EACH_KIND void carry_slopes(const stage *first, const stage *last, const int kind, solution *mid, solution *end,
                                   double h, df_network_state *now)
{
    const df_network *q = first->q;
    const int n = kind & DF_IS_ELASTIC ? 3 : 2;
    const double sigma = q->numbers[DF_NUMBER_PRESLIDING], start = first->from.y, grip = now->grip;
    const double half = mid->y[DF_PISTON] - start, whole = end->y[DF_PISTON] - start;
    const int presliding = kind & DF_IS_ELASTIC && sigma > 0.0;
    const double bend = q->numbers[DF_NUMBER_BEND], held = first->from.bend;
    const double bent[2] = {first->x - mid->y[DF_PISTON] - first->from.stretch,
                            last->x - end->y[DF_PISTON] - first->from.stretch};
    const int is_rubber = kind & DF_IS_ELASTIC && q->numbers[DF_NUMBER_RUBBER] > 0.0;
    dahl turned[2] = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
    dahl by_half = {0.0, 0.0, 0.0}, by_whole = {0.0, 0.0, 0.0}, after = {0.0, 0.0, 0.0};
    if (presliding) {
        by_half = dahl_after(sigma, grip, half, 0.0);
        by_whole = dahl_after(sigma, grip, whole, 0.0);
        after = dahl_after(sigma, grip, whole, 1.0);
    }
    for (int k = 0; is_rubber && k < 2; k++)
        turned[k] = dahl_after(bend, held, bent[k], copysign(1.0, first->from.v));
    for (int a = 0; a < now->n_active; a++) {
        const int j = now->active[a], place = now->which[j];
        const double is_sigma = place == DF_NUMBER_PRESLIDING;
        double *S = now->S[j], *G = now->G[j], *grip_by = &now->grip_by[j];
        double past[DF_STATES], mid_S[DF_STATES], mid_G[DF_STATES], end_S[DF_STATES];
        double kept[2][2] = {{0.0, 0.0}, {0.0, 0.0}}; /* of friction and of rubber, at both stages */
        if (presliding) {
            kept[0][0] = dahl_by(&by_half, sigma, grip, half, *grip_by, -S[DF_PISTON], is_sigma);
            kept[1][0] = dahl_by(&by_whole, sigma, grip, whole, *grip_by, -S[DF_PISTON], is_sigma);
        }
        for (int k = 0; is_rubber && k < 2; k++)
            kept[k][1] = dahl_by(&turned[k], bend, held, bent[k], now->bend_by[j], S[DF_PISTON], place == DF_NUMBER_BEND);
        for (int i = 0; i < n; i++)
            past[i] = S[i] + h * DF_A[1][0] * G[i];
        carry_stage(first, kind, mid, place, kept[0], past, mid_S, mid_G);
        for (int i = 0; i < n; i++)
            past[i] = S[i] + h * DF_A[2][0] * G[i] + h * DF_A[2][1] * mid_G[i];
        carry_stage(last, kind, end, place, kept[1], past, end_S, G);
        if (presliding)
            *grip_by = dahl_by(&after, sigma, grip, whole, *grip_by, end_S[DF_PISTON] - S[DF_PISTON], is_sigma);
        if (is_rubber)
            now->bend_by[j] = dahl_by(&turned[1], bend, held, bent[1], now->bend_by[j], S[DF_PISTON] - end_S[DF_PISTON],
                                      place == DF_NUMBER_BEND);
        for (int i = 0; i < n; i++)
            S[i] = end_S[i];
    }
}

/* What is looked at between steps. */
DF_FOR_EACH_KIND void keep(const int kind, const df_network_balance *from, df_network_balance *to)
{
    for (int i = 0; i < 3; i++)
        to->P[i] = from->P[i];
    for (int i = 0; i < 2; i++) {
        to->own[i] = from->own[i];
        to->fill[i] = from->fill[i];
    }
    to->gas = from->gas;
    if (kind & DF_IS_ELASTIC)
        *to = *from;
}

/* The first guess of a stage, on the parabola through what is known, and its chambers. */
DF_FOR_EACH_KIND int guess_state(const df_network *q, const int kind, const df_network_state *now,
                                 double guide[][DF_STATES], const int place, double x, double h, solution *e)
{
    const double *one = place == 1 ? now->guide_old : now->guide_mid;
    const double *two = place == 1 ? now->guide_mid : guide[0], *three = guide[place - 1];
    double w[3], g[DF_STATES];
    if (place == 1)
        parabola(DF_C[1] * h, now->t_old, now->t_mid, 0.0, w);
    else
        parabola(DF_C[2] * h, now->t_mid, 0.0, DF_C[1] * h, w);
    for (int i = 0; i < (kind & DF_IS_ELASTIC ? 3 : 2); i++)
        g[i] = w[0] * one[i] + w[1] * two[i] + w[2] * three[i];
    e->y[DF_PISTON] = kind & DF_IS_ELASTIC ? x - g[DF_PISTON] : x;
    int code = fill_chambers(q, e->y[DF_PISTON], &e->c);
    if (code != DF_OK && kind & DF_IS_ELASTIC) {
        e->y[DF_PISTON] = now->y[DF_PISTON];
        code = fill_chambers(q, e->y[DF_PISTON], &e->c);
    }
    e->y[0] = e->c.full[0] * (1.0 + g[0]);
    e->y[1] = kind & DF_HAS_FLOATING_PISTON ? now->y[1] : e->c.full[1] * (1.0 + g[1]);
    return code;
}

/* Once for both stages of a step, of all but the paper's. */
static int solve_rigid(const stage *s, solution *end, df_work *work, int *code)
{
    return solve_stage(s, 0, end, work, code);
}

static int solve_elastic(const stage *s, solution *end, df_work *work, int *code)
{
    return solve_stage(s, DF_IS_ELASTIC, end, work, code);
}

static int solve_any(const stage *s, solution *end, df_work *work, int *code)
{
    return solve_stage(s, kind_of(s->q), end, work, code);
}

DF_FOR_EACH_KIND int solve(const stage *s, const int kind, solution *end, df_work *work, int *code)
{
    if (kind == DF_IS_PURDY)
        return solve_stage(s, DF_IS_PURDY, end, work, code);
    if (kind == 0)
        return solve_rigid(s, end, work, code);
    return kind == DF_IS_ELASTIC ? solve_elastic(s, end, work, code) : solve_any(s, end, work, code);
}

/* What a step has of its beginning, its middle and its end. */
typedef struct {
    double F[DF_STAGES][DF_STATES], guide[DF_STAGES][DF_STATES];
} passage_of_time;

/* Stage k, from its guess to its solution. */
DF_FOR_EACH_KIND int reach(const df_network *q, const int kind, const int k, const piece *motion, double t, double h,
                           const df_network_state *now, passage_of_time *p, stage *s, solution *end, df_work *work,
                           int *code)
{
    const double at = t + DF_C[k] * h;
    s->x = hermite(motion, at);
    if (kind & DF_IS_ELASTIC)
        s->from.v = hermite_speed(motion, at);
    for (int i = 0; i < (kind & DF_IS_ELASTIC ? 3 : 2); i++) {
        s->known[i] = now->y[i] + h * DF_A[k][0] * p->F[0][i];
        if (k == 2)
            s->known[i] += h * DF_A[2][1] * p->F[1][i];
    }
    *code = guess_state(q, kind, now, p->guide, k, s->x, h, end);
    if (*code != DF_OK || solve(s, kind, end, work, code))
        return STEP_REFUSED;
    for (int i = 0; i < 2; i++) {
        p->F[k][i] = end->b.F[i];
        p->guide[k][i] = end->b.fill[i];
    }
    if (kind & DF_IS_ELASTIC) {
        p->F[k][DF_PISTON] = end->b.F[DF_PISTON];
        p->guide[k][DF_PISTON] = s->x - end->y[DF_PISTON];
    }
    return STEP_TAKEN;
}

/* One step of length h from time t of the piece; a refused step leaves `now` alone. */
DF_FOR_EACH_KIND int take_step(const df_network *q, const df_options *o, const int kind, const piece *motion, double t,
                               double h, df_network_state *now, df_work *work, double *error, int *code)
{
    const int n = kind & DF_IS_ELASTIC ? 3 : 2;
    passage_of_time p;
    solution mid, end;
    stage first = {q, o, &now->gas, 0.0, h * DF_DIAGONAL, 1.0 / (h * DF_DIAGONAL), {0.0, 0.0, 0.0},
                   {now->y[DF_PISTON], now->grip, 0.0, hermite(motion, t) - now->y[DF_PISTON], now->b.bend}};
    for (int i = 0; i < n; i++) {
        p.F[0][i] = now->F[i];
        p.guide[0][i] = i < 2 ? now->b.fill[i] : hermite(motion, t) - now->y[DF_PISTON];
    }
    if (reach(q, kind, 1, motion, t, h, now, &p, &first, &mid, work, code) != STEP_TAKEN)
        return STEP_REFUSED;
    stage last = first;
    if (reach(q, kind, 2, motion, t, h, now, &p, &last, &end, work, code) != STEP_TAKEN)
        return STEP_REFUSED;
    double r[DF_STATES] = {0.0, 0.0, 0.0}, e[DF_STATES];
    for (int i = 0; i < 2; i++)
        r[i] = h * DF_E[0] * p.F[0][i] + h * DF_E[1] * p.F[1][i] + h * DF_E[2] * p.F[2][i];
    apply(kind, end.inverse, r, e);
    const double K = q->numbers[DF_NUMBER_K];
    *error = larger(q->a_1 * K * end.c.inverse[0] * fabs(e[0]), q->a_2 * K * end.c.inverse[1] * fabs(e[1])) /
             o->tolerance;
    if (!(*error <= 1.0))
        return STEP_REFUSED;
    if (now->n_active > 0)
        carry_slopes(&first, &last, kind, &mid, &end, h, now);
    if (kind & DF_IS_ELASTIC && q->numbers[DF_NUMBER_PRESLIDING] > 0.0)
        now->grip = dahl_after(q->numbers[DF_NUMBER_PRESLIDING], now->grip, end.y[DF_PISTON] - first.from.y, 1.0).z;
    if (kind & DF_IS_ELASTIC && q->numbers[DF_NUMBER_RUBBER] > 0.0)
        end.b.bend = dahl_after(q->numbers[DF_NUMBER_BEND], first.from.bend,
                                last.x - end.y[DF_PISTON] - first.from.stretch, copysign(1.0, last.from.v)).z;
    keep(kind, &end.b, &now->b);
    now->y[DF_PISTON] = end.y[DF_PISTON];
    for (int i = 0; i < n; i++) {
        now->y[i] = end.y[i];
        now->F[i] = p.F[2][i];
        now->guide_old[i] = p.guide[0][i];
        now->guide_mid[i] = p.guide[1][i];
    }
    now->t_old = -h;
    now->t_mid = (DF_C[1] - 1.0) * h;
    return STEP_TAKEN;
}

/* Keeps the gas spring's series where the oil is. */
static inline int follow_gas(const df_network *q, double x, df_network_state *now)
{
    const double shift = q->has_floating_piston ? q->plan.swept[1] * x : now->y[1] - q->plan.oil[1];
    const double s = now->y[0] - q->plan.oil[0] + shift;
    const double away = s - now->gas.s0, reach = DF_GAS_REACH / now->gas.inverse_mass;
    if (fabs(away) < 0.5 * reach)
        return 0;
    const df_gas spring = gas_of(q);
    /* Expanded so that most of what the series reaches lies ahead. */
    return df_gas_expand(&spring, s + copysign(0.4 * reach, away), &now->gas);
}

DF_FOR_EACH_KIND int take_steps(const df_network *q, const df_options *o, const int kind, const piece *motion,
                                df_network_state *now, df_work *work)
{
    const double interval = motion->interval;
    double t = 0.0;
    long tries = 0;
    while (t < interval) {
        const double left = interval - t, wish = now->wish;
        const int last = wish >= left * (1.0 - 1e-9);
        const double h = last ? left : (2.0 * wish > left ? 0.5 * left : wish);
        double error = INFINITY;
        int code = DF_OK;
        if (follow_gas(q, kind & DF_IS_ELASTIC ? now->y[DF_PISTON] : hermite(motion, t), now))
            return DF_CHAMBER_EMPTY;
        if (++tries > o->max_steps_per_sample)
            return DF_STEP_LIMIT;
        if (take_step(q, o, kind, motion, t, h, now, work, &error, &code) == STEP_TAKEN) {
            work->steps++;
            t = last ? interval : t + h;
            if (wish < interval || error > 0.5) {
                const double grow = 0.9 / cbrt(error + 1e-10);
                const double next = h * (grow > 5.0 ? 5.0 : grow);
                now->wish = (last && grow > 1.0 && next < wish) ? wish : next;
            }
        } else {
            /* An elastic mounting may throw a guess of the piston out of its chambers. */
            if (code != DF_OK && (!(kind & DF_IS_ELASTIC) || h < 1e-9 * interval))
                return code;
            work->rejected++;
            const double shrink = error < INFINITY ? 0.9 / cbrt(error) : 0.2;
            now->wish = h * (shrink < 0.1 ? 0.1 : shrink);
        }
    }
    return DF_OK;
}

/* What friction on a rigid mounting remembers, carried along a way without a turn. */
static void remember(const df_network *q, double way, df_network_state *now)
{
    const double sigma = q->numbers[DF_NUMBER_PRESLIDING];
    const dahl d = dahl_after(sigma, now->grip, way, 1.0);
    for (int j = 0; j < now->n_which; j++)
        now->grip_by[j] = dahl_by(&d, sigma, now->grip, way, now->grip_by[j], 0.0,
                                  now->which[j] == DF_NUMBER_PRESLIDING);
    now->grip = d.z;
}

/* Along a piece of the motion, from turn to turn: the roots of its speed, a parabola. */
static void remember_piece(const df_network *q, const piece *m, df_network_state *now)
{
    const double rise = 6.0 * (m->x1 - m->x0) / m->interval, a = 3.0 * (m->v0 + m->v1) - rise;
    const double b = rise - 4.0 * m->v0 - 2.0 * m->v1, inside = b * b - 4.0 * a * m->v0;
    double at = m->x0, turns[2] = {2.0, 2.0};
    if (inside > 0.0) { /* a u^2 + b u + v0 = 0 without cancellation */
        const double half = -0.5 * (b + copysign(sqrt(inside), b));
        const double one = a != 0.0 ? half / a : 2.0, other = half != 0.0 ? m->v0 / half : 2.0;
        turns[0] = fmin(one, other);
        turns[1] = fmax(one, other);
    }
    for (int k = 0; k < 2; k++) {
        if (!(turns[k] > 0.0 && turns[k] < 1.0))
            continue;
        const double x = hermite(m, turns[k] * m->interval);
        remember(q, x - at, now);
        at = x;
    }
    remember(q, m->x1 - at, now);
}


int df_advance_network(const df_network *q, const df_options *o, double x, double v, double interval,
                       df_network_state *now, df_work *work)
{
    const piece motion = {now->x, x, now->v, v, interval, 1.0 / interval};
    const int kind = kind_of(q);
    if (!(interval > 0.0 && isfinite(interval) && o->tolerance > 0.0 && o->dead_band > 0.0))
        return DF_BAD_ARGUMENT;
    if (!isfinite(x) || !isfinite(v))
        return DF_NOT_FINITE;
    if (now->wish <= 0.0)
        now->wish = 0.05 * interval;
    const int code = kind == DF_IS_PURDY     ? take_steps(q, o, DF_IS_PURDY, &motion, now, work)
                     : kind == 0             ? take_steps(q, o, 0, &motion, now, work)
                     : kind == DF_IS_ELASTIC ? take_steps(q, o, DF_IS_ELASTIC, &motion, now, work)
                                             : take_steps(q, o, kind, &motion, now, work);
    if (code != DF_OK)
        return code;
    if (!is_elastic(q) && q->numbers[DF_NUMBER_PRESLIDING] > 0.0)
        remember_piece(q, &motion, now);
    now->x = x;
    now->v = v;
    return isfinite(now->b.P[0]) && isfinite(now->b.P[1]) && isfinite(now->b.P[2]) ? DF_OK : DF_NOT_FINITE;
}
