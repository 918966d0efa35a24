/* A long motion in parts that run side by side: cut, run in step, written, and held together where they
 * meet.
 */
#include "network_lanes.h"

#if defined(__GNUC__)

#include "lane_steps.h"
#include "network_slopes.h"

#define FEWEST_LEADS 2 /* a motion that is shorter is no sooner done in parts */
#define SLOWEST 10.0 /* 1/s; oil that moves more slowly is not where it would come to rest */
#define SUNK 3 /* times that the pressure of the gas and the oil that has left it are found from each other */
#define MEETS_WITHIN 10.0 /* tolerances; parts whose forces or slopes are further apart have not met */
/* Where nobody asks for the settling: its last part is stepped through as the rest, s; what comes before
 * by leaps, s, each step of which may err by so many tolerances. Forces of the reference set at 1.5 Hz then
 * are within 1 mN of those that settled step by step, slopes within 1e-6. */
#define FINELY 0.09
#define LEAP 0.016
#define ROUGHLY 300.0

/* Where parts begin and how long they are; the last sample that is settled to in long steps, how many samples
 * those are, and the first sample that is asked for.
 */
typedef struct {
    size_t stride, lead, length, rough, leap, asked;
} cut;

/* Keeps the series of each part's gas spring where its oil is. */
DF_FOR_EACH_KIND int follow(const df_network *q, parts *p)
{
    const lanes s = (p->y[0] - q->plan.oil[0]) + (p->y[1] - q->plan.oil[1]);
    const lanes near = size_of((s - p->gas.s0) * p->gas.inverse_mass);
    if (!any(~(near < 0.5 * DF_GAS_REACH)))
        return 1;
    const df_gas spring = {q->numbers[DF_NUMBER_P_0], q->numbers[DF_NUMBER_GAMMA], q->numbers[DF_NUMBER_V_GAS], q->rho_0};
    for (int l = 0; l < DF_LANES; l++) {
        df_gas_point point = {p->gas.s0[l], p->gas.inverse_mass[l], spring.gamma, {0.0}};
        if (near[l] < 0.5 * DF_GAS_REACH)
            continue;
        if (df_gas_expand(&spring, df_gas_ahead(&point, s[l]), &point))
            return 0;
        p->gas.s0[l] = point.s0;
        p->gas.inverse_mass[l] = point.inverse_mass;
        for (int k = 0; k < DF_GAS_TERMS; k++)
            p->gas.series[k][l] = point.series[k];
    }
    return 1;
}

/* A part where `df_begin_network` has it. */
DF_FOR_EACH_KIND void take_over(const job *t, const df_network_state *now, int l, parts *p)
{
    for (int i = 0; i < 2; i++) {
        p->y[i][l] = now->y[i];
        p->F[i][l] = now->F[i];
        p->fill[i][l] = p->mid[i][l] = p->old[i][l] = now->b.fill[i];
        p->own[i][l] = now->b.own[i];
        for (int j = 0; j < t->n_carried; j++) {
            p->S[j][i][l] = now->S[j][i];
            p->G[j][i][l] = now->G[j][i];
        }
    }
    for (int i = 0; i < 3; i++)
        p->P[i][l] = now->b.P[i];
    p->gas.s0[l] = now->gas.s0;
    p->gas.inverse_mass[l] = now->gas.inverse_mass;
    for (int k = 0; k < DF_GAS_TERMS; k++)
        p->gas.series[k][l] = now->gas.series[k];
}

/* All samples intervals of `m`, cut as its hardest part needs it: take_steps of network_advance.c. */
DF_FOR_EACH_KIND int advance_all(const job *t, const way *m, parts *p, df_work *work)
{
    double from = 0.0;
    long tries = 0;
    while (from < m->interval) {
        const double left = m->interval - from, wish = p->wish;
        const int last = wish >= left * (1.0 - 1e-9);
        const double h = last ? left : (2.0 * wish > left ? 0.5 * left : wish);
        double error = INFINITY;
        if (!follow(t->q, p) || ++tries > t->o->max_steps_per_sample)
            return 0;
        if (step_all(t, m, from, h, p, work, &error)) {
            work->steps += DF_LANES;
            from = last ? m->interval : from + h;
            if (wish < m->interval || error > 0.5) {
                const double grow = 0.9 / cbrt(error + 1e-10), next = h * (grow > 5.0 ? 5.0 : grow);
                p->wish = (last && grow > 1.0 && next < wish) ? wish : next;
            }
        } else {
            work->rejected += DF_LANES;
            const double shrink = error < INFINITY ? 0.9 / cbrt(error) : 0.2;
            p->wish = h * (shrink < 0.1 ? 0.1 : shrink);
        }
    }
    return 1;
}

/* The slope of the oil's force by a number that is carried: oil_force of df_pressures_by and the masses. */
DF_FOR_EACH_KIND lanes slope_of_oil(const job *t, const parts *p, int j)
{
    const df_network *q = t->q;
    const lanes P_1 = p->own[0] * p->S[j][0] + oil_by(q, p->P[0], t->carried[j].place);
    const lanes P_2 = p->own[1] * p->S[j][1] + oil_by(q, p->P[1], t->carried[j].place);
    return P_1 * q->a_1 - P_2 * q->a_2;
}

/* Friction as a share of f_f: df_friction_share. */
DF_FOR_EACH_KIND lanes friction_share(lanes v, double band)
{
    return pick(size_of(v) >= band, with_sign(all_of(1.0), v), v / band);
}

/* Puts down sample i of every part, or of one. */
DF_FOR_EACH_KIND void put(double *row, const cut *at, size_t i, int is_of_all, int one, lanes value)
{
    if (is_of_all)
        for (int l = 0; l < DF_LANES; l++)
            row[(size_t)l * at->stride + i] = value[l];
    else
        row[(size_t)one * at->stride + i] = value[one];
}

/* A sample of every part that has settled by then and does not go on beyond its own: before that it is the
 * first part's, if it is asked for, and after that the last one's. */
DF_FOR_EACH_KIND void write_all(const job *t, const parts *p, const cut *at, size_t i, lanes v, size_t n,
                                const df_result *r)
{
    const df_network *q = t->q;
    const double *numbers = q->numbers, band = larger(numbers[DF_NUMBER_TURNING], t->o->dead_band);
    const int is_of_all = i >= at->lead && i < at->lead + at->stride, one = i < at->lead ? 0 : DF_LANES - 1;
    if (i < at->asked)
        return;
    const lanes oil = p->P[0] * q->a_1 - p->P[1] * q->a_2 + q->rod_force, share = friction_share(v, band);
    put(r->force, at, i, is_of_all, one,
        oil + numbers[DF_NUMBER_FRICTION] * share + numbers[DF_NUMBER_DRAG] * v + numbers[DF_NUMBER_OFFSET]);
    for (int c = 0; c < 3; c++)
        put(r->pressures + (size_t)c * n, at, i, is_of_all, one, p->P[c]);
    for (int c = 0; c < 2; c++)
        put(r->masses + (size_t)c * n, at, i, is_of_all, one, p->y[c]);
    for (int j = 0, carried = 0; j < r->n_which; j++) {
        const int place = r->which[j];
        put(r->sensitivities + (size_t)j * n, at, i, is_of_all, one,
            place == DF_NUMBER_OFFSET     ? all_of(1.0)
            : place == DF_NUMBER_FRICTION ? share
                                          : slope_of_oil(t, p, carried++));
    }
}

/* Whether each part ends where the next one had come to there. */
static int do_meet(const job *t, const parts *before, const parts *after)
{
    const df_network *q = t->q;
    const double least = MEETS_WITHIN * t->o->tolerance;
    for (int l = 0; l + 1 < DF_LANES; l++) {
        double off = fabs(q->a_1 * (after->P[0][l] - before->P[0][l + 1])) +
                     fabs(q->a_2 * (after->P[1][l] - before->P[1][l + 1]));
        for (int j = 0; j < t->n_carried; j++) {
            const lanes one = slope_of_oil(t, after, j), other = slope_of_oil(t, before, j);
            off = larger(off, fabs(q->numbers[t->carried[j].place] * (one[l] - other[l + 1])));
        }
        if (!(off <= least))
            return 0;
    }
    return 1;
}

DF_FOR_EACH_KIND lanes samples(const double *from, const cut *at, size_t i)
{
    const double *y = from + i;
    const lanes r = {y[0], y[at->stride], y[2 * at->stride], y[3 * at->stride]};
    return r;
}

/* The first samples of the settling, of which nothing is asked but where they lead. */
DF_FOR_EACH_KIND int settle_all(const job *t, const df_motion *motion, const cut *at, parts *p, df_work *work)
{
    df_options rough = *t->o;
    rough.tolerance *= ROUGHLY;
    job loosely = *t;
    loosely.o = &rough;
    for (size_t i = 0; i < at->rough; i += at->leap) {
        const way m = {samples(motion->x, at, i), samples(motion->x, at, i + at->leap), samples(motion->v, at, i),
                       samples(motion->v, at, i + at->leap), (double)at->leap * motion->interval};
        if (!advance_all(&loosely, &m, p, work))
            return 0;
    }
    return 1;
}

/* Samples that nobody has asked for and no part has. */
static void blank(const df_motion *motion, size_t asked, const df_result *r)
{
    double *const rows[] = {r->pressures, r->masses, r->force, r->sensitivities};
    const int n_rows[] = {3, 2, 1, r->n_which};
    for (int kind = 0; kind < 4; kind++)
        for (int j = 0; j < n_rows[kind]; j++)
            for (size_t k = 0; k < asked; k++)
                rows[kind][(size_t)j * motion->n + k] = NAN;
}

DF_FOR_EACH_KIND int run_parts(const job *t, const df_motion *motion, const cut *at, parts *p, const df_result *r,
                               df_work *work)
{
    parts before = *p, after = *p;
    if (!settle_all(t, motion, at, p, work))
        return DF_NOT_IN_PARTS;
    write_all(t, p, at, at->rough, samples(motion->v, at, at->rough), motion->n, r);
    for (size_t i = at->rough + 1; i < at->length; i++) {
        const way m = {samples(motion->x, at, i - 1), samples(motion->x, at, i), samples(motion->v, at, i - 1),
                       samples(motion->v, at, i), motion->interval};
        if (!advance_all(t, &m, p, work))
            return DF_NOT_IN_PARTS;
        if (i + 1 == at->lead)
            before = *p;
        if (i + 1 == at->lead + at->stride)
            after = *p;
        write_all(t, p, at, i, m.v1, motion->n, r);
    }
    return do_meet(t, &before, &after) ? DF_OK : DF_NOT_IN_PARTS;
}

/* The same for what the processor has beyond the least. */
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)
__attribute__((target("avx2"))) static int run_wide(const job *t, const df_motion *motion, const cut *at, parts *p,
                                                    const df_result *r, df_work *work)
{
    return run_parts(t, motion, at, p, r, work);
}

static int has_wide(void)
{
    return __builtin_cpu_supports("avx2");
}
#else
#define run_wide run_plain
static int has_wide(void)
{
    return 0;
}
#endif

static int run_plain(const job *t, const df_motion *motion, const cut *at, parts *p, const df_result *r, df_work *work)
{
    return run_parts(t, motion, at, p, r, work);
}

/* A number of the body, or of one passage that does no more than scale the flow; 0: neither. */
static int carried_number(const df_network *q, int place, carried *one)
{
    one->place = place;
    if (place < DF_FIRST_PASSAGE_NUMBER || place >= q->n_numbers)
        return place == DF_NUMBER_K || place == DF_NUMBER_P_0 || place == DF_NUMBER_GAMMA;
    const int first = q->plan.touched[place];
    if (q->plan.touched[place + 1] != first + 1)
        return 0;
    const df_touch *touch = &q->plan.touches[first];
    one->way = touch->way;
    for (int i = 0; i < 2; i++)
        one->rate[i] = q->plan.ways[touch->way].out[i] * touch->times;
    return touch->term == DF_OF_FLOW;
}

/* The paper's passages without an opening, Coulomb's friction, and numbers whose slopes are here. */
static int is_for_parts(const df_network *q, const df_result *r, job *t)
{
    const double *n = q->numbers;
    const int blank = n[DF_NUMBER_PHI] == 0.0 && n[DF_NUMBER_STIFFNESS] == 0.0 && n[DF_NUMBER_PRESLIDING] == 0.0 &&
                      n[DF_NUMBER_BREAKAWAY] == 0.0 && n[DF_NUMBER_PRESSED] == 0.0;
    if (!blank || !q->plan.is_purdy || r->n_which < 0)
        return 0;
    for (int k = 0; k < 3; k++)
        if (q->plan.ways[k].law.p_open != 0.0)
            return 0;
    for (int j = 0; j < r->n_which; j++) {
        const int place = r->which[j];
        if (place == DF_NUMBER_OFFSET || place == DF_NUMBER_FRICTION)
            continue;
        if (t->n_carried == MOST_CARRIED || !carried_number(q, place, &t->carried[t->n_carried]))
            return 0;
        t->place[t->n_carried++] = place;
    }
    return 1;
}

/* The slopes of oil that neither comes nor goes: 0 = J S + what the number does. */
static void rest_slopes(const df_network *q, df_network_state *now)
{
    const df_network_balance *b = &now->b;
    df_flows f;
    chambers c;
    if (fill_chambers(q, now->x, &c) != DF_OK)
        return;
    evaluate(q, DF_IS_PURDY, &c, &now->gas, now->y, &now->b, &f);
    const double J11 = b->J[0][0], J12 = b->J[0][1], J21 = b->J[1][0], J22 = b->J[1][1];
    const double det = J11 * J22 - J12 * J21, inverse = 1.0 / det;
    if (!(det > SLOWEST * SLOWEST))
        return;
    for (int j = 0; j < now->n_which; j++) {
        double F[DF_STATES];
        balance_by(q, DF_IS_PURDY, b, &f, taken(q, DF_IS_PURDY, &c, now->y), now->v, now->which[j], F);
        now->S[j][0] = (J12 * F[1] - J22 * F[0]) * inverse;
        now->S[j][1] = (J21 * F[0] - J11 * F[1]) * inverse;
        now->G[j][0] = now->G[j][1] = 0.0;
    }
}

/* From one pressure everywhere to those at which what the piston sweeps would flow for good: near what a
 * part finds that begins in the middle of a stroke. Not where a chamber would be empty. */
static void let_flow(const df_network *q, df_network_state *now)
{
    const df_way *ways = q->plan.ways;
    const double K = q->numbers[DF_NUMBER_K], P_0 = q->numbers[DF_NUMBER_P_0];
    const double w_1 = q->plan.swept[0] * now->v, w_2 = q->plan.swept[1] * now->v;
    const double root = ways[DF_1_3].law.S * (now->v >= 0.0 ? w_1 : w_1 - w_2);
    const df_gas spring = gas_of(q);
    df_gas_point gas;
    chambers c;
    double P_3 = now->b.P[2], oil[2];
    if (fill_chambers(q, now->x, &c) != DF_OK)
        return;
    for (int k = 0; k < SUNK; k++) {
        const double P_1 = P_3 + root * root;
        const double P_2 = now->v >= 0.0 ? P_3 - ways[DF_2_3].law.R * w_2 : P_1 - ways[DF_1_2].law.R * w_2;
        if (!(P_2 > 0.0 && larger(P_1, P_2) < K))
            return;
        oil[0] = c.full[0] * (1.0 + (P_1 - P_0) / K) - q->plan.oil[0];
        oil[1] = c.full[1] * (1.0 + (P_2 - P_0) / K) - q->plan.oil[1];
        if (df_gas_expand(&spring, oil[0] + oil[1], &gas))
            return;
        P_3 = gas.series[0];
    }
    if (df_place_network(q, oil, 0.0, now->x, now->v, now) == DF_OK)
        rest_slopes(q, now);
}

int df_simulate_in_parts(df_network *q, const df_options *o, const df_motion *motion, size_t lead, int is_unseen,
                         const df_result *r, df_work *work)
{
    df_network_state now;
    parts p = {0};
    job t = {q, o, {0}, {{0, 0, {0.0}}}, 0};
    work->steps = work->rejected = work->newton = 0;
    work->failed_sample = motion->n;
    if (lead < 1 || motion->n_jumps || motion->n < FEWEST_LEADS * lead + DF_LANES || df_plan_network(q) != DF_OK ||
        !is_for_parts(q, r, &t) || !(motion->interval > 0.0))
        return DF_NOT_IN_PARTS;
    const size_t stride = (motion->n - lead) / DF_LANES;
    const double far = larger(floor(LEAP / motion->interval), 1.0);
    const double left = (double)lead - larger(FINELY / motion->interval, 2.0);
    const size_t leap = is_unseen && left > far ? (size_t)far : 0;
    const size_t rough = leap ? (size_t)left / leap * leap : 0;
    const cut at = {stride, lead, motion->n - (DF_LANES - 1) * stride, rough, leap, is_unseen ? lead : 0};
    blank(motion, at.asked, r);
    for (int l = 0; l < DF_LANES; l++) {
        const size_t k = (size_t)l * stride;
        if (df_begin_network(q, o, motion->x[k], motion->v[k], t.place, t.n_carried, &now) != DF_OK)
            return DF_NOT_IN_PARTS;
        if (k > 0 || is_unseen)
            let_flow(q, &now);
        take_over(&t, &now, l, &p);
    }
    p.t_old = -2.0;
    p.t_mid = -1.0;
    p.wish = 0.05 * motion->interval;
    return has_wide() ? run_wide(&t, motion, &at, &p, r, work) : run_plain(&t, motion, &at, &p, r, work);
}

#else

int df_simulate_in_parts(df_network *q, const df_options *o, const df_motion *motion, size_t lead, int is_unseen,
                         const df_result *r, df_work *work)
{
    (void)q, (void)o, (void)motion, (void)lead, (void)is_unseen, (void)r, (void)work;
    return DF_NOT_IN_PARTS;
}

#endif
