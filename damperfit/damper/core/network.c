/* Integration of a network by the method of stepper.c, for any passages between its chambers.
 *
 * stepper.c is the paper's network with everything that this one leaves open written out; a test
 * holds both to the same numbers.
 */
#include "network.h"
#include "tableau.h"

#include <math.h>

#define NEWTON_LIMIT 30
#define NEWTON_FREE 4 /* corrections that are trusted before the residual must fall */
/* As in stepper.c: what a Newton correction may be at the end, of the smallest D across a root. */
#define SHARE_DONE 1e-4
#define PA_DONE 1e-3
#define ROUNDING_SHARE 4e-16 /* of K: what doubles make of a pressure that is K (m/(rho V) - 1) */

/* What one instant of the motion gives. */
typedef struct {
    double full[2];    /* rho_0 V: kg at P_0 */
    double inverse[2];
    double swept;      /* oil that the piston's motion itself takes from the gas chamber, kg */
} chambers;

static double number(const df_network *q, int place)
{
    return place < 0 ? 0.0 : q->numbers[place];
}

static df_passage_law law_of(const df_network *q, const df_passage *p)
{
    const df_passage_law law = {number(q, p->p_open), number(q, p->R), number(q, p->S),
                                number(q, p->width), p->two_way};
    return law;
}

static df_geometry gas_geometry(const df_network *q)
{
    const df_geometry g = {q->a_1, q->a_2, q->a_2 - q->a_1, q->V_1, q->V_2,
                           q->numbers[DF_NUMBER_V_GAS], q->rho_0};
    return g;
}

static df_parameters gas_parameters(const df_network *q)
{
    const df_parameters p = {0.0, 0.0, 0.0, q->numbers[DF_NUMBER_K], 0.0, 0.0,
                             q->numbers[DF_NUMBER_P_0], q->numbers[DF_NUMBER_GAMMA]};
    return p;
}

static int n_states(const df_network *q)
{
    return q->has_floating_piston ? 1 : 2;
}

static int fill_chambers(const df_network *q, double x, chambers *c)
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
static double taken(const df_network *q, const chambers *c, const double m[2])
{
    const double first = m[0] - q->rho_0 * q->V_1;
    return q->has_floating_piston ? first + c->swept : first + (m[1] - q->rho_0 * q->V_2);
}

/* Pressure of oil with free gas by its fill e = m/(rho_0 V) - 1, and the slope by e. Without gas
 * eqs (4), (7), (11), (12) with the clamp; with gas it never reaches zero:
 * 1/(1 + e) = 1 - (P - P_0)/K + phi (P_0/P - 1). */
static df_law oil_pressure(const df_network *q, double e)
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
static double oil_pressure_by(const df_network *q, double P, int place)
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

static double gas_pressure_by(const df_network *q, double P3, double s, int place)
{
    const df_geometry g = gas_geometry(q);
    const df_parameters p = gas_parameters(q);
    double by_P_0, by_gamma;
    df_gas_slopes(&g, &p, P3, s, &by_P_0, &by_gamma);
    if (place == DF_NUMBER_P_0)
        return by_P_0;
    if (place == DF_NUMBER_GAMMA)
        return by_gamma;
    if (place == DF_NUMBER_V_GAS) {
        const double V = q->numbers[DF_NUMBER_V_GAS];
        return P3 * q->numbers[DF_NUMBER_GAMMA] * (1.0 / V - 1.0 / (V + s / q->rho_0));
    }
    return 0.0;
}

/* Derivatives of the three pressures by a number at constant masses. */
static void pressures_by(const df_network *q, const df_balance *b, double s, int place, double P[3])
{
    P[0] = oil_pressure_by(q, b->P[0], place);
    P[2] = gas_pressure_by(q, b->P[2], s, place);
    P[1] = q->has_floating_piston ? P[2] : oil_pressure_by(q, b->P[1], place);
}

/* Pressures, flows, and the Jacobian of the mass balances. */
static void evaluate(const df_network *q, const chambers *c, const df_gas_point *gas,
                     const double m[2], df_balance *b)
{
    const df_law P3 = df_gas_pressure(gas, taken(q, c, m));
    const int n = n_states(q);
    for (int i = 0; i < 2; i++) {
        b->F[i] = b->J[i][0] = b->J[i][1] = 0.0;
        b->slope[2][i] = i < n ? P3.slope : 0.0;
    }
    b->P[2] = P3.value;
    for (int i = 0; i < n; i++) {
        b->fill[i] = (m[i] - c->full[i]) * c->inverse[i];
        const df_law P = oil_pressure(q, b->fill[i]);
        b->P[i] = P.value;
        b->slope[i][i] = P.slope * c->inverse[i];
        b->slope[i][1 - i] = 0.0;
    }
    if (q->has_floating_piston) {
        b->fill[1] = 0.0;
        b->P[1] = b->P[2];
        b->slope[1][0] = b->slope[2][0];
        b->slope[1][1] = 0.0;
    }
    for (int k = 0; k < q->n_passages; k++) {
        const df_passage *p = &q->passages[k];
        const df_passage_law law = law_of(q, p);
        const int from = p->from - 1, to = p->to - 1;
        b->drop[k] = b->P[from] - b->P[to];
        b->flow[k] = df_passage_flow(&law, b->drop[k], q->rounding);
        for (int j = 0; j < n; j++) {
            const double by_m = b->flow[k].by_D * (b->slope[from][j] - b->slope[to][j]);
            if (from < n)
                b->J[from][j] -= by_m;
            if (to < n)
                b->J[to][j] += by_m;
        }
        if (from < n)
            b->F[from] -= b->flow[k].w;
        if (to < n)
            b->F[to] += b->flow[k].w;
    }
}

typedef struct {
    double a[2][2]; /* inverse of I - h diagonal J */
} inverse2;

static void invert(const df_balance *b, double hd, inverse2 *i)
{
    const double a11 = 1.0 - hd * b->J[0][0], a12 = -hd * b->J[0][1];
    const double a21 = -hd * b->J[1][0], a22 = 1.0 - hd * b->J[1][1];
    const double r = 1.0 / (a11 * a22 - a12 * a21);
    i->a[0][0] = a22 * r;
    i->a[0][1] = -a12 * r;
    i->a[1][0] = -a21 * r;
    i->a[1][1] = a11 * r;
}

static void apply(const inverse2 *i, const double r[2], double e[2])
{
    e[0] = i->a[0][0] * r[0] + i->a[0][1] * r[1];
    e[1] = i->a[1][0] * r[0] + i->a[1][1] * r[1];
}

static double change_of(const df_network *q, const df_balance *b, int k, const double e[2])
{
    const int from = q->passages[k].from - 1, to = q->passages[k].to - 1;
    return (b->slope[from][0] - b->slope[to][0]) * e[0] + (b->slope[from][1] - b->slope[to][1]) * e[1];
}

/* A passage with an orifice is curved like a root, and plain Newton jumps to and fro across it. The
 * correction is moved so that D follows the flow, in which the law is smooth, for as many passages
 * between different chambers as there are states; those that turn most come first. */
static void follow_the_roots(const df_network *q, const df_balance *b, double e[2])
{
    int chosen[2] = {-1, -1}, n_chosen = 0;
    double wanted[2] = {0.0, 0.0};
    for (int turn = 0; turn < n_states(q); turn++) {
        double most = 0.02;
        int best = -1;
        for (int k = 0; k < q->n_passages; k++) {
            const df_passage *p = &q->passages[k];
            if (p->S < 0 || b->flow[k].by_D == 0.0)
                continue;
            if (n_chosen && p->from + p->to == q->passages[chosen[0]].from + q->passages[chosen[0]].to)
                continue;
            const double u = fabs(b->drop[k]) - number(q, p->p_open);
            const double share = fabs(change_of(q, b, k, e)) / (fabs(u) + q->rounding);
            if (share > most) {
                most = share;
                best = k;
            }
        }
        if (best < 0)
            break;
        const df_passage_law law = law_of(q, &q->passages[best]);
        const double w = b->flow[best].w + b->flow[best].by_D * change_of(q, b, best, e);
        if (law.two_way ? law.p_open > 0.0 && w * b->flow[best].w <= 0.0 : w <= 0.0)
            break; /* about to close: nothing curved on that side */
        chosen[n_chosen] = best;
        wanted[n_chosen++] = df_passage_drop(&law, w, q->rounding) - b->drop[best];
    }
    if (n_chosen == 0)
        return;
    double row[2][2];
    for (int i = 0; i < n_chosen; i++) {
        const int from = q->passages[chosen[i]].from - 1, to = q->passages[chosen[i]].to - 1;
        for (int j = 0; j < 2; j++)
            row[i][j] = b->slope[from][j] - b->slope[to][j];
    }
    if (n_chosen == 2) {
        const double det = row[0][0] * row[1][1] - row[0][1] * row[1][0];
        if (fabs(det) > 1e-12 * (fabs(row[0][0] * row[1][1]) + fabs(row[0][1] * row[1][0]))) {
            e[0] = (wanted[0] * row[1][1] - wanted[1] * row[0][1]) / det;
            e[1] = (row[0][0] * wanted[1] - row[1][0] * wanted[0]) / det;
        }
        return;
    }
    const int j = fabs(row[0][0]) >= fabs(row[0][1]) ? 0 : 1;
    if (row[0][j] != 0.0)
        e[j] += (wanted[0] - change_of(q, b, chosen[0], e)) / row[0][j];
}

/* Smallest D across an orifice: how near the last correction must come, see SHARE_DONE. */
static double nearest_root(const df_network *q, const df_balance *b)
{
    double least = INFINITY;
    for (int k = 0; k < q->n_passages; k++) {
        if (q->passages[k].S >= 0 && b->flow[k].by_D > 0.0)
            least = fmin(least, fabs(fabs(b->drop[k]) - number(q, q->passages[k].p_open)));
    }
    return isfinite(least) ? fmax(least, q->rounding) : 0.0;
}

/* One implicit stage: m = known + hd F(m). Returns 0 when it converged. */
static int solve_stage(const df_network *q, const chambers *c, const df_gas_point *gas,
                       const double known[2], double hd, double share_done, double m[2],
                       df_balance *b, inverse2 *inverse, df_work *work)
{
    const double K = q->numbers[DF_NUMBER_K];
    const double stiff[2] = {K * c->inverse[0], K * c->inverse[1]};
    double before = INFINITY, step[2] = {0.0, 0.0};
    for (int k = 0; k < NEWTON_LIMIT; k++) {
        evaluate(q, c, gas, m, b);
        work->newton++;
        const double r[2] = {known[0] + hd * b->F[0] - m[0], known[1] + hd * b->F[1] - m[1]};
        const double size = fmax(stiff[0] * fabs(r[0]), stiff[1] * fabs(r[1]));
        if (!(size < INFINITY))
            return 1;
        if (k > NEWTON_FREE && size > before) { /* half the way back */
            for (int i = 0; i < 2; i++) {
                step[i] *= 0.5;
                m[i] -= step[i];
            }
            continue;
        }
        before = size;
        invert(b, hd, inverse);
        double e[2];
        apply(inverse, r, e);
        const double far = fmax(stiff[0] * fabs(e[0]), stiff[1] * fabs(e[1]));
        if (!(far < INFINITY))
            return 1;
        const int converged =
            far <= PA_DONE + ROUNDING_SHARE * K + share_done * nearest_root(q, b);
        if (!converged)
            follow_the_roots(q, b, e);
        for (int i = 0; i < 2; i++) {
            m[i] += e[i];
            step[i] = e[i];
        }
        if (converged) {
            for (int i = 0; i < 2; i++)
                b->F[i] = (m[i] - known[i]) / hd;
            for (int i = 0; i < 3; i++)
                b->P[i] = fmax(b->P[i] + b->slope[i][0] * e[0] + b->slope[i][1] * e[1], 0.0);
            for (int i = 0; i < n_states(q); i++)
                b->fill[i] += e[i] * c->inverse[i];
            return 0;
        }
    }
    return 1;
}

/* dF/d(number) at constant masses. */
static void balance_by(const df_network *q, const df_balance *b, double s, int place, double F[2])
{
    double P[3];
    pressures_by(q, b, s, place, P);
    F[0] = F[1] = 0.0;
    for (int k = 0; k < q->n_passages; k++) {
        const df_passage *p = &q->passages[k];
        const df_flow *f = &b->flow[k];
        double w = f->by_D * (P[p->from - 1] - P[p->to - 1]);
        w += p->p_open == place ? f->by_open : 0.0;
        w += p->R == place ? f->by_R : 0.0;
        w += p->S == place ? f->by_S : 0.0;
        w += p->width == place ? f->by_width : 0.0;
        if (p->from <= n_states(q))
            F[p->from - 1] -= w;
        if (p->to <= n_states(q))
            F[p->to - 1] += w;
    }
}

static int moves_the_state(int place)
{
    return place != DF_NUMBER_FRICTION && place != DF_NUMBER_OFFSET;
}

typedef struct {
    double x0, x1, v0, v1, interval;
} piece;

static double hermite(const piece *c, double t)
{
    const double u = t / c->interval, w = 1.0 - u;
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

/* The sensitivities of a converged stage, by its own Newton matrix. */
static void carry_slopes(const df_network *q, const df_state *now, const df_balance *b,
                         const inverse2 *inverse, double s, double h, int stage,
                         double S[][2], double G[][DF_STAGES][2])
{
    const double hd = h * DF_DIAGONAL;
    for (int j = 0; j < now->n_which; j++) {
        if (!moves_the_state(now->which[j]))
            continue;
        double slope[2], past[2], r[2];
        balance_by(q, b, s, now->which[j], slope);
        for (int i = 0; i < 2; i++) {
            past[i] = now->S[j][i];
            for (int k = 0; k < stage; k++)
                past[i] += h * DF_A[stage][k] * G[j][k][i];
            r[i] = past[i] + hd * slope[i];
        }
        apply(inverse, r, S[j]);
        for (int i = 0; i < 2; i++)
            G[j][stage][i] = (S[j][i] - past[i]) / hd;
    }
}

/* One step of length h from time t of the piece; a refused step leaves `now` alone. */
static int take_step(const df_network *q, const df_options *o, const piece *motion, double t, double h,
                     df_state *now, df_work *work, double *error, int *code)
{
    const double hd = h * DF_DIAGONAL, share_done = fmin(SHARE_DONE, 0.01 * o->tolerance);
    double F[DF_STAGES][2], fill[DF_STAGES][2], m[2] = {now->m[0], now->m[1]};
    double G[DF_MOST_NUMBERS][DF_STAGES][2], S[DF_MOST_NUMBERS][2];
    df_balance b = now->b;
    inverse2 inverse = {{{0.0, 0.0}, {0.0, 0.0}}};
    chambers c;
    for (int i = 0; i < 2; i++) {
        F[0][i] = now->F[i];
        fill[0][i] = now->b.fill[i];
        for (int j = 0; j < now->n_which; j++)
            G[j][0][i] = now->G[j][i];
    }
    for (int k = 1; k < DF_STAGES; k++) {
        *code = fill_chambers(q, hermite(motion, t + DF_C[k] * h), &c);
        if (*code != DF_OK)
            return STEP_REFUSED;
        double w[3], known[2];
        if (k == 1)
            parabola(DF_C[1] * h, now->t_old, now->t_mid, 0.0, w);
        else
            parabola(DF_C[2] * h, now->t_mid, 0.0, DF_C[1] * h, w);
        for (int i = 0; i < 2; i++) {
            known[i] = now->m[i];
            for (int l = 0; l < k; l++)
                known[i] += h * DF_A[k][l] * F[l][i];
            const double guess = k == 1 ? w[0] * now->fill_old[i] + w[1] * now->fill_mid[i] + w[2] * fill[0][i]
                                        : w[0] * now->fill_mid[i] + w[1] * fill[0][i] + w[2] * fill[1][i];
            m[i] = i < n_states(q) ? c.full[i] * (1.0 + guess) : known[i];
        }
        if (solve_stage(q, &c, &now->gas, known, hd, share_done, m, &b, &inverse, work))
            return STEP_REFUSED;
        for (int i = 0; i < 2; i++) {
            F[k][i] = b.F[i];
            fill[k][i] = b.fill[i];
        }
        carry_slopes(q, now, &b, &inverse, taken(q, &c, m), h, k, S, G);
    }
    double r[2] = {0.0, 0.0}, e[2];
    for (int k = 0; k < DF_STAGES; k++) {
        r[0] += h * DF_E[k] * F[k][0];
        r[1] += h * DF_E[k] * F[k][1];
    }
    apply(&inverse, r, e);
    const double K = q->numbers[DF_NUMBER_K];
    *error = fmax(q->a_1 * K * c.inverse[0] * fabs(e[0]), q->a_2 * K * c.inverse[1] * fabs(e[1])) / o->tolerance;
    if (!(*error <= 1.0))
        return STEP_REFUSED;
    now->b = b;
    for (int i = 0; i < 2; i++) {
        now->m[i] = m[i];
        now->F[i] = F[DF_STAGES - 1][i];
        now->fill_old[i] = fill[0][i];
        now->fill_mid[i] = fill[1][i];
    }
    for (int j = 0; j < now->n_which; j++) {
        if (!moves_the_state(now->which[j]))
            continue;
        for (int i = 0; i < 2; i++) {
            now->S[j][i] = S[j][i];
            now->G[j][i] = G[j][DF_STAGES - 1][i];
        }
    }
    now->t_old = -h;
    now->t_mid = (DF_C[1] - 1.0) * h;
    return STEP_TAKEN;
}

static int passage_is_sound(const df_network *q, const df_passage *p)
{
    const int places[4] = {p->p_open, p->R, p->S, p->width};
    for (int i = 0; i < 4; i++) {
        if (places[i] >= q->n_numbers || (places[i] >= 0 && places[i] < DF_FIRST_PASSAGE_NUMBER))
            return 0;
        if (number(q, places[i]) < 0.0)
            return 0;
    }
    const double R = number(q, p->R), S = number(q, p->S);
    /* A rounded orifice would have an infinite slope at D = 0. */
    if (!(R + S > 0.0) || (number(q, p->width) > 0.0 && !(R > 0.0)))
        return 0;
    if (p->from < 1 || p->from > 3 || p->to < 1 || p->to > 3 || p->from == p->to)
        return 0;
    return !q->has_floating_piston || p->from + p->to != 5; /* 2 and 3 are one */
}

static int network_is_sound(const df_network *q)
{
    const double *n = q->numbers;
    double all = q->rod_force;
    if (q->n_numbers < DF_FIRST_PASSAGE_NUMBER || q->n_numbers > DF_MOST_NUMBERS ||
        q->n_passages < 1 || q->n_passages > DF_MOST_PASSAGES)
        return 0;
    for (int i = 0; i < q->n_numbers; i++)
        all += n[i];
    if (!isfinite(all) || !(n[DF_NUMBER_K] > 0.0 && n[DF_NUMBER_PHI] >= 0.0 && n[DF_NUMBER_P_0] > 0.0 &&
                            n[DF_NUMBER_GAMMA] > 0.0 && n[DF_NUMBER_V_GAS] > 0.0 && q->rounding > 0.0 &&
                            q->a_1 > 0.0 && q->a_2 > q->a_1 && q->rho_0 > 0.0))
        return 0;
    for (int k = 0; k < q->n_passages; k++) {
        if (!passage_is_sound(q, &q->passages[k]))
            return 0;
    }
    return 1;
}

/* The pressure that all chambers share at x, by Newton; its masses and sensitivities. */
static int equalise(const df_network *q, const chambers *c, df_state *now)
{
    const df_geometry g = gas_geometry(q);
    const df_parameters p = gas_parameters(q);
    const double K = q->numbers[DF_NUMBER_K], P_0 = p.P_0, phi = q->numbers[DF_NUMBER_PHI];
    const int n = n_states(q);
    double P = P_0, s = 0.0, by_s = 0.0;
    for (int k = 0; k < 60; k++) {
        const double volume = 1.0 - (P - P_0) / K + phi * (P_0 / P - 1.0);
        const double by_P = 1.0 / K + phi * P_0 / (P * P); /* -d volume/dP */
        double growth = 0.0;
        now->m[1] = q->rho_0 * q->V_2;
        for (int i = 0; i < n; i++) {
            /* Without free gas the law is in the density, with it in the specific volume. */
            now->m[i] = phi == 0.0 ? c->full[i] * (1.0 + (P - P_0) / K) : c->full[i] / volume;
            growth += phi == 0.0 ? c->full[i] / K : c->full[i] * by_P / (volume * volume);
        }
        s = taken(q, c, now->m);
        if (df_gas_expand(&g, &p, s, &now->gas))
            return DF_CHAMBER_EMPTY;
        const df_law gas = df_gas_pressure(&now->gas, s);
        by_s = gas.slope;
        const double change = (gas.value - P) / (1.0 - gas.slope * growth);
        P = fmax(P + change, 0.1 * P);
        if (fabs(change) <= 1e-12 * P)
            break;
    }
    evaluate(q, c, &now->gas, now->m, &now->b);
    for (int j = 0; j < now->n_which; j++) {
        double direct[3], slope[2], own = 0.0, growth = 0.0;
        pressures_by(q, &now->b, s, now->which[j], direct);
        for (int i = 0; i < n; i++) {
            own += direct[i] / now->b.slope[i][i];
            growth += 1.0 / now->b.slope[i][i];
        }
        /* P(number) by the implicit function theorem, then m(P, number). */
        const double change = (direct[2] - by_s * own) / (1.0 - by_s * growth);
        now->S[j][1] = 0.0;
        for (int i = 0; i < n; i++)
            now->S[j][i] = (change - direct[i]) / now->b.slope[i][i];
        balance_by(q, &now->b, s, now->which[j], slope);
        for (int i = 0; i < 2; i++)
            now->G[j][i] = now->b.J[i][0] * now->S[j][0] + now->b.J[i][1] * now->S[j][1] + slope[i];
    }
    return DF_OK;
}

int df_begin(const df_network *q, double x, double v, const int *which, int n_which, df_state *now)
{
    chambers c;
    if (!network_is_sound(q) || n_which < 0 || n_which > q->n_numbers)
        return DF_BAD_ARGUMENT;
    for (int j = 0; j < n_which; j++) {
        if (which[j] < 0 || which[j] >= q->n_numbers)
            return DF_BAD_ARGUMENT;
        now->which[j] = which[j];
    }
    now->n_which = n_which;
    if (!isfinite(v))
        return DF_NOT_FINITE;
    int code = fill_chambers(q, x, &c);
    if (code == DF_OK)
        code = equalise(q, &c, now);
    if (code != DF_OK)
        return code;
    for (int i = 0; i < 2; i++) {
        now->F[i] = now->b.F[i];
        now->fill_old[i] = now->fill_mid[i] = now->b.fill[i];
    }
    now->t_old = -2.0;
    now->t_mid = -1.0;
    now->wish = 0.0;
    now->x = x;
    now->v = v;
    return DF_OK;
}

int df_advance(const df_network *q, const df_options *o, double x, double v, double interval,
               df_state *now, df_work *work)
{
    const df_geometry g = gas_geometry(q);
    const df_parameters p = gas_parameters(q);
    const piece motion = {now->x, x, now->v, v, interval};
    double t = 0.0;
    long tries = 0;
    if (!(interval > 0.0 && o->tolerance > 0.0 && o->dead_band > 0.0))
        return DF_BAD_ARGUMENT;
    if (!isfinite(x) || !isfinite(v))
        return DF_NOT_FINITE;
    if (now->wish <= 0.0)
        now->wish = 0.05 * interval;
    while (t < interval) {
        const double left = interval - t, wish = now->wish;
        const int last = wish >= left * (1.0 - 1e-9);
        const double h = last ? left : (2.0 * wish > left ? 0.5 * left : wish);
        double error = INFINITY;
        int code = DF_OK;
        chambers c;
        code = fill_chambers(q, hermite(&motion, t), &c);
        if (code != DF_OK)
            return code;
        const double s = taken(q, &c, now->m);
        if (!df_gas_is_near(&now->gas, s) && df_gas_expand(&g, &p, s, &now->gas))
            return DF_CHAMBER_EMPTY;
        if (++tries > o->max_steps_per_sample)
            return DF_STEP_LIMIT;
        if (take_step(q, o, &motion, t, h, now, work, &error, &code) == STEP_TAKEN) {
            work->steps++;
            t = last ? interval : t + h;
            if (wish < interval || error > 0.5) {
                const double grow = 0.9 / cbrt(error + 1e-10);
                const double next = h * (grow > 5.0 ? 5.0 : grow);
                now->wish = (last && grow > 1.0 && next < wish) ? wish : next;
            }
        } else {
            if (code != DF_OK)
                return code;
            work->rejected++;
            const double shrink = error < INFINITY ? 0.9 / cbrt(error) : 0.2;
            now->wish = h * (shrink < 0.1 ? 0.1 : shrink);
        }
    }
    now->x = x;
    now->v = v;
    return isfinite(now->b.P[0]) && isfinite(now->b.P[1]) && isfinite(now->b.P[2]) ? DF_OK : DF_NOT_FINITE;
}

double df_force(const df_network *q, const df_options *o, const df_state *now, double *slopes)
{
    const df_balance *b = &now->b;
    const double friction = df_friction_share(now->v, o->dead_band);
    const double shift = q->has_floating_piston ? q->rho_0 * q->a_2 * now->x : now->m[1] - q->rho_0 * q->V_2;
    const double s = now->m[0] - q->rho_0 * q->V_1 + shift;
    for (int j = 0; j < now->n_which; j++) {
        const int place = now->which[j];
        if (place == DF_NUMBER_FRICTION) {
            slopes[j] = friction;
        } else if (place == DF_NUMBER_OFFSET) {
            slopes[j] = 1.0;
        } else {
            double P[3];
            pressures_by(q, b, s, place, P);
            for (int i = 0; i < 2; i++)
                P[i] += b->slope[i][0] * now->S[j][0] + b->slope[i][1] * now->S[j][1];
            slopes[j] = P[0] * q->a_1 - P[1] * q->a_2;
        }
    }
    return b->P[0] * q->a_1 - b->P[1] * q->a_2 + q->rod_force +
           q->numbers[DF_NUMBER_FRICTION] * friction + q->numbers[DF_NUMBER_OFFSET];
}

static void write_sample(const df_network *q, const df_options *o, const df_state *now,
                         const df_result *r, size_t i, size_t n)
{
    double slopes[DF_MOST_NUMBERS];
    r->force[i] = df_force(q, o, now, slopes);
    for (int k = 0; k < 3; k++)
        r->pressures[(size_t)k * n + i] = now->b.P[k];
    for (int k = 0; k < 2; k++)
        r->masses[(size_t)k * n + i] = now->m[k];
    for (int j = 0; j < r->n_which; j++)
        r->sensitivities[(size_t)j * n + i] = slopes[j];
}

int df_simulate_network(const df_network *q, const df_options *o, const df_motion *motion,
                        const df_result *r, df_work *work)
{
    df_state now;
    work->steps = work->rejected = work->newton = 0;
    work->failed_sample = 0;
    if (motion->n < 1 || r->n_which < 0 || !(motion->interval > 0.0 && o->tolerance > 0.0 && o->dead_band > 0.0))
        return DF_BAD_ARGUMENT;
    int code = df_begin(q, motion->x[0], motion->v[0], r->which, r->n_which, &now);
    if (code != DF_OK)
        return code;
    write_sample(q, o, &now, r, 0, motion->n);
    for (size_t i = 1; i < motion->n; i++) {
        work->failed_sample = i;
        code = df_advance(q, o, motion->x[i], motion->v[i], motion->interval, &now, work);
        if (code != DF_OK)
            return code;
        write_sample(q, o, &now, r, i, motion->n);
    }
    work->failed_sample = motion->n;
    return DF_OK;
}
