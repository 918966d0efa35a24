/* Integration of a network by the method of stepper.c, for any passages between its chambers.
 *
 * stepper.c is the paper's network with everything that this one leaves open written out; a test
 * holds both to the same numbers.
 */
#include "network_balance.h"
#include "tableau.h"

#include <math.h>

#define NEWTON_LIMIT 30
#define NEWTON_FREE 4 /* corrections that are trusted before the residual must fall */
/* As in stepper.c: what a Newton correction may be at the end, of the smallest D across a root. */
#define SHARE_DONE 1e-4
#define PA_DONE 1e-3
#define ROUNDING_SHARE 4e-16 /* of K: what doubles make of a pressure that is K (m/(rho V) - 1) */
#define PULL_DONE 1e-4 /* what the last correction may leave of the forces at the mounting, N */

/* Dahl's friction, dz/dy = (1 - z sgn dy)/sigma, over a way without a turn; `turn` is the sign of a
 * way of no length. */
typedef struct {
    double z, left, turn; /* left: what is left of the start, by which it is forgotten */
} dahl;

static dahl dahl_after(double sigma, double z, double way, double turn)
{
    dahl d;
    d.turn = way != 0.0 ? copysign(1.0, way) : turn;
    d.left = exp(-fabs(way) / sigma);
    d.z = d.turn + (z - d.turn) * d.left;
    return d;
}

/* Its derivative where start, way and distance move. */
static double dahl_by(const dahl *d, double sigma, double z, double way, double z_by, double way_by, double sigma_by)
{
    return d->left * (z_by + (d->turn - z) * (d->turn * way_by / sigma - fabs(way) / (sigma * sigma) * sigma_by));
}

/* What a step begins with, as friction remembers it, and the speed of the rig at a stage. */
typedef struct {
    double y, grip, v;
} memory;

/* The elastic mounting: stretch x - y beyond half the play, and friction by the piston's speed. */
static void hold(const df_network *q, const df_options *o, double x, double y, double speed, const memory *from,
                 df_network_balance *b)
{
    const double stretch = x - y, sigma = q->numbers[DF_NUMBER_PRESLIDING];
    const double k = q->numbers[DF_NUMBER_STIFFNESS], half = 0.5 * q->numbers[DF_NUMBER_PLAY];
    const double beyond = fabs(stretch) - half;
    b->pull = beyond > 0.0 ? copysign(k * beyond, stretch) : 0.0;
    b->pull_slope = beyond > 0.0 ? k : 0.0;
    b->brake = q->numbers[DF_NUMBER_DRAG];
    b->rub = rubbing(q, from->v, b->P[0]);
    b->speed = speed;
    b->caught = 0.0;
    if (sigma > 0.0) {
        dahl d = dahl_after(sigma, from->grip, y - from->y, 0.0);
        if (d.turn == 0.0) /* to where the forces push it from here */
            d.turn = b->pull - oil_force(q, b->P) - q->rod_force - b->rub * d.z < 0.0 ? -1.0 : 1.0;
        b->grip = d.z;
        b->caught = b->rub * (1.0 - d.turn * from->grip) * d.left / sigma;
        return;
    }
    b->grip = df_friction_share(speed, o->dead_band);
    if (fabs(speed) < o->dead_band)
        b->brake += b->rub / o->dead_band;
}

/* Slope of the oil's force, and of the friction that it presses, by a state. */
static double oil_force_by(const df_network *q, const df_network_balance *b, int state)
{
    return b->slope[0][state] * q->a_1 - b->slope[1][state] * q->a_2 +
           q->numbers[DF_NUMBER_PRESSED] * b->grip * b->slope[0][state];
}

/* Inverse of the Newton matrix: I - h diagonal J for the masses and, where the mounting is elastic,
 * the equilibrium 0 = pull - oil - rod - friction as third row. */
typedef struct {
    double a[DF_STATES][DF_STATES];
} inverse3;

static void invert(const df_network *q, const df_network_balance *b, double hd, inverse3 *i)
{
    const double a11 = 1.0 - hd * b->J[0][0], a12 = -hd * b->J[0][1];
    const double a21 = -hd * b->J[1][0], a22 = 1.0 - hd * b->J[1][1];
    const double r = 1.0 / (a11 * a22 - a12 * a21);
    const double A[2][2] = {{a22 * r, -a12 * r}, {-a21 * r, a11 * r}};
    for (int j = 0; j < DF_STATES; j++)
        i->a[DF_PISTON][j] = i->a[j][DF_PISTON] = 0.0;
    if (!is_elastic(q)) {
        for (int j = 0; j < 2; j++) {
            i->a[j][0] = A[j][0];
            i->a[j][1] = A[j][1];
        }
        return;
    }
    /* By the Schur complement of the masses. */
    const double right[2] = {-hd * b->J[0][DF_PISTON], -hd * b->J[1][DF_PISTON]};
    const double below[2] = {oil_force_by(q, b, 0), oil_force_by(q, b, 1)};
    const double corner = b->pull_slope + oil_force_by(q, b, DF_PISTON) + b->brake / hd + b->caught;
    const double AR[2] = {A[0][0] * right[0] + A[0][1] * right[1], A[1][0] * right[0] + A[1][1] * right[1]};
    const double BA[2] = {below[0] * A[0][0] + below[1] * A[1][0], below[0] * A[0][1] + below[1] * A[1][1]};
    const double s = 1.0 / (corner - below[0] * AR[0] - below[1] * AR[1]);
    for (int j = 0; j < 2; j++) {
        for (int k = 0; k < 2; k++)
            i->a[j][k] = A[j][k] + AR[j] * s * BA[k];
        i->a[j][DF_PISTON] = -AR[j] * s;
        i->a[DF_PISTON][j] = -s * BA[j];
    }
    i->a[DF_PISTON][DF_PISTON] = s;
}

static void apply(const inverse3 *i, const double r[DF_STATES], double e[DF_STATES])
{
    for (int j = 0; j < DF_STATES; j++)
        e[j] = i->a[j][0] * r[0] + i->a[j][1] * r[1] + i->a[j][2] * r[2];
}

static double change_of(const df_network *q, const df_network_balance *b, int k, const double e[DF_STATES])
{
    const int from = q->passages[k].from - 1, to = q->passages[k].to - 1;
    double change = 0.0;
    for (int j = 0; j < DF_STATES; j++)
        change += (b->slope[from][j] - b->slope[to][j]) * e[j];
    return change;
}

/* A passage with an orifice is curved like a root, and plain Newton jumps to and fro across it. The
 * correction is moved so that D follows the flow, in which the law is smooth, for as many passages
 * between different chambers as there are masses; those that turn most come first. */
static void follow_the_roots(const df_network *q, const df_network_balance *b, double e[DF_STATES])
{
    int chosen[2] = {-1, -1}, n_chosen = 0;
    double wanted[2] = {0.0, 0.0};
    for (int turn = 0; turn < n_oil(q); turn++) {
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
        wanted[i] -= change_of(q, b, chosen[i], e); /* what is to be added */
    }
    if (n_chosen == 2) {
        const double det = row[0][0] * row[1][1] - row[0][1] * row[1][0];
        if (fabs(det) > 1e-12 * (fabs(row[0][0] * row[1][1]) + fabs(row[0][1] * row[1][0]))) {
            e[0] += (wanted[0] * row[1][1] - wanted[1] * row[0][1]) / det;
            e[1] += (row[0][0] * wanted[1] - row[1][0] * wanted[0]) / det;
        }
        return;
    }
    const int j = fabs(row[0][0]) >= fabs(row[0][1]) ? 0 : 1;
    if (row[0][j] != 0.0)
        e[j] += wanted[0] / row[0][j];
}

/* Smallest D across an orifice: how near the last correction must come, see SHARE_DONE. */
static double nearest_root(const df_network *q, const df_network_balance *b)
{
    double least = INFINITY;
    for (int k = 0; k < q->n_passages; k++) {
        if (q->passages[k].S >= 0 && b->flow[k].by_D > 0.0)
            least = fmin(least, fabs(fabs(b->drop[k]) - number(q, q->passages[k].p_open)));
    }
    return isfinite(least) ? fmax(least, q->rounding) : 0.0;
}

/* One implicit stage: y = known + hd F(y), the mounting in equilibrium. Returns 0 when it converged. */
static int solve_stage(const df_network *q, const df_options *o, double x, const df_gas_point *gas,
                       const double known[DF_STATES], double hd, const memory *from, double y[DF_STATES],
                       chambers *c, df_network_balance *b, inverse3 *inverse, df_work *work, int *code)
{
    const double K = q->numbers[DF_NUMBER_K], share_done = fmin(SHARE_DONE, 0.01 * o->tolerance);
    const int elastic = is_elastic(q), presliding = q->numbers[DF_NUMBER_PRESLIDING] > 0.0;
    double before = INFINITY, step[DF_STATES] = {0.0, 0.0, 0.0};
    for (int k = 0; k < NEWTON_LIMIT; k++) {
        if (k == 0 || elastic) {
            *code = fill_chambers(q, y[DF_PISTON], c);
            if (*code != DF_OK)
                return 1;
        }
        evaluate(q, c, gas, y, b);
        work->newton++;
        double r[DF_STATES] = {known[0] + hd * b->F[0] - y[0], known[1] + hd * b->F[1] - y[1], 0.0};
        const double stiff[2] = {K * c->inverse[0], K * c->inverse[1]};
        double speed = 0.0, size = fmax(stiff[0] * fabs(r[0]), stiff[1] * fabs(r[1]));
        if (elastic) {
            speed = (y[DF_PISTON] - known[DF_PISTON]) / hd;
            hold(q, o, x, y[DF_PISTON], speed, from, b);
            r[DF_PISTON] = b->pull - oil_force(q, b->P) - q->rod_force - b->rub * b->grip -
                           q->numbers[DF_NUMBER_DRAG] * speed;
            size = fmax(size, fabs(r[DF_PISTON]) / q->a_2);
        }
        if (!(size < INFINITY))
            return 1;
        if (k > NEWTON_FREE && size > before) { /* half the way back */
            for (int i = 0; i < DF_STATES; i++) {
                step[i] *= 0.5;
                y[i] -= step[i];
            }
            continue;
        }
        before = size;
        invert(q, b, hd, inverse);
        double e[DF_STATES];
        apply(inverse, r, e);
        const double far = fmax(stiff[0] * fabs(e[0]), stiff[1] * fabs(e[1]));
        if (!(far < INFINITY) || !isfinite(e[DF_PISTON]))
            return 1;
        /* Where friction has a corner: at a speed of nothing, or where the step has begun. */
        const double here = presliding ? y[DF_PISTON] - from->y : speed;
        const double then = here + (presliding ? e[DF_PISTON] : e[DF_PISTON] / hd);
        const int crosses = elastic && (presliding || fabs(b->grip) == 1.0) && here * then < 0.0;
        const int converged = far <= PA_DONE + ROUNDING_SHARE * K + share_done * nearest_root(q, b) &&
                              !crosses && q->numbers[DF_NUMBER_STIFFNESS] * fabs(e[DF_PISTON]) <= PULL_DONE;
        if (crosses && b->rub > 0.0) {
            /* Beyond the dead band lies another branch: stop inside and look. */
            const double share = -here / (then - here);
            for (int i = 0; i < DF_STATES; i++)
                e[i] *= share;
            before = INFINITY;
        } else if (!converged) {
            follow_the_roots(q, b, e);
        }
        for (int i = 0; i < DF_STATES; i++) {
            y[i] += e[i];
            step[i] = e[i];
        }
        if (crosses && presliding && b->rub > 0.0)
            y[DF_PISTON] = from->y; /* exactly, for only there the branch is chosen anew */
        if (converged) {
            for (int i = 0; i < DF_STATES; i++)
                b->F[i] = (y[i] - known[i]) / hd;
            for (int i = 0; i < 3; i++)
                b->P[i] = fmax(b->P[i] + b->slope[i][0] * e[0] + b->slope[i][1] * e[1] +
                                   b->slope[i][2] * e[2], 0.0);
            if (elastic) {
                *code = fill_chambers(q, y[DF_PISTON], c);
                if (*code != DF_OK)
                    return 1;
                b->pull -= b->pull_slope * e[DF_PISTON];
            }
            for (int i = 0; i < n_oil(q); i++)
                b->fill[i] = (y[i] - c->full[i]) * c->inverse[i];
            return 0;
        }
    }
    return 1;
}

static int moves_the_state(const df_network *q, int place)
{
    if (place == DF_NUMBER_OFFSET)
        return 0;
    return is_elastic(q) || place < DF_NUMBER_FRICTION || place >= DF_FIRST_PASSAGE_NUMBER ||
           moves_pressures(place);
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

/* The speed along it. */
static double hermite_speed(const piece *c, double t)
{
    const double u = t / c->interval, w = 1.0 - u;
    return 6.0 * u * w * (c->x1 - c->x0) / c->interval + w * (w - 2.0 * u) * c->v0 + u * (u - 2.0 * w) * c->v1;
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
static void carry_slopes(const df_network *q, const df_network_state *now, const df_network_balance *b,
                         const inverse3 *inverse, double s, const memory *from, double y, double h, int stage,
                         double S[][DF_STATES], double G[][DF_STAGES][DF_STATES])
{
    const double hd = h * DF_DIAGONAL, sigma = q->numbers[DF_NUMBER_PRESLIDING], way = y - from->y;
    const dahl d = sigma > 0.0 ? dahl_after(sigma, from->grip, way, 0.0) : (dahl){0.0, 0.0, 0.0};
    for (int j = 0; j < now->n_which; j++) {
        if (!moves_the_state(q, now->which[j]))
            continue;
        double slope[DF_STATES], past[DF_STATES], r[DF_STATES];
        balance_by(q, b, s, from->v, now->which[j], slope);
        if (sigma > 0.0) /* what friction remembers has moved too; the way's end is in the matrix */
            slope[DF_PISTON] -= b->rub * dahl_by(&d, sigma, from->grip, way, now->grip_by[j],
                                                 -now->S[j][DF_PISTON], now->which[j] == DF_NUMBER_PRESLIDING);
        for (int i = 0; i < DF_STATES; i++) {
            past[i] = now->S[j][i];
            for (int k = 0; k < stage; k++)
                past[i] += h * DF_A[stage][k] * G[j][k][i];
            r[i] = past[i] + hd * slope[i];
        }
        /* Friction is by the speed (y - known)/hd, whose known part has a slope too. */
        r[DF_PISTON] = is_elastic(q) ? slope[DF_PISTON] + b->brake / hd * past[DF_PISTON] : 0.0;
        apply(inverse, r, S[j]);
        for (int i = 0; i < DF_STATES; i++)
            G[j][stage][i] = (S[j][i] - past[i]) / hd;
    }
}

/* What is predicted from step to step, smoother than the states themselves. */
static void guide_of(const df_network *q, const df_network_balance *b, double x, const double y[DF_STATES],
                     double guide[DF_STATES])
{
    guide[0] = b->fill[0];
    guide[1] = b->fill[1];
    guide[DF_PISTON] = is_elastic(q) ? x - y[DF_PISTON] : 0.0;
}

/* The first guess of a stage, on the parabola through what is known. */
static void guess_state(const df_network *q, const df_network_state *now, double guide[][DF_STATES],
                        int stage, double x, double h, double y[DF_STATES])
{
    double w[3], g[DF_STATES];
    if (stage == 1)
        parabola(DF_C[1] * h, now->t_old, now->t_mid, 0.0, w);
    else
        parabola(DF_C[2] * h, now->t_mid, 0.0, DF_C[1] * h, w);
    for (int i = 0; i < DF_STATES; i++)
        g[i] = stage == 1 ? w[0] * now->guide_old[i] + w[1] * now->guide_mid[i] + w[2] * guide[0][i]
                          : w[0] * now->guide_mid[i] + w[1] * guide[0][i] + w[2] * guide[1][i];
    y[DF_PISTON] = x - g[DF_PISTON];
    chambers c;
    if (fill_chambers(q, y[DF_PISTON], &c) != DF_OK) {
        y[DF_PISTON] = now->y[DF_PISTON];
        if (fill_chambers(q, y[DF_PISTON], &c) != DF_OK)
            return;
    }
    y[0] = c.full[0] * (1.0 + g[0]);
    y[1] = n_oil(q) == 2 ? c.full[1] * (1.0 + g[1]) : now->y[1];
}

/* What friction remembers, carried along a way without a turn; S: the piston's slopes at its end. */
static void remember(const df_network *q, double way, double S[][DF_STATES], df_network_state *now)
{
    const double sigma = q->numbers[DF_NUMBER_PRESLIDING];
    const dahl d = dahl_after(sigma, now->grip, way, 1.0);
    for (int j = 0; j < now->n_which; j++) {
        const int moves = S && moves_the_state(q, now->which[j]);
        const double moved = moves ? S[j][DF_PISTON] - now->S[j][DF_PISTON] : 0.0;
        now->grip_by[j] = dahl_by(&d, sigma, now->grip, way, now->grip_by[j], moved,
                                  now->which[j] == DF_NUMBER_PRESLIDING);
    }
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
        remember(q, x - at, 0, now);
        at = x;
    }
    remember(q, m->x1 - at, 0, now);
}

/* One step of length h from time t of the piece; a refused step leaves `now` alone. */
static int take_step(const df_network *q, const df_options *o, const piece *motion, double t, double h,
                     df_network_state *now, df_work *work, double *error, int *code)
{
    const double hd = h * DF_DIAGONAL;
    double F[DF_STAGES][DF_STATES], guide[DF_STAGES][DF_STATES], y[DF_STATES];
    double G[DF_MOST_NUMBERS][DF_STAGES][DF_STATES], S[DF_MOST_NUMBERS][DF_STATES];
    df_network_balance b = now->b;
    inverse3 inverse = {{{0.0}}};
    chambers c;
    guide_of(q, &now->b, hermite(motion, t), now->y, guide[0]);
    for (int i = 0; i < DF_STATES; i++) {
        F[0][i] = now->F[i];
        for (int j = 0; j < now->n_which; j++)
            G[j][0][i] = now->G[j][i];
    }
    for (int k = 1; k < DF_STAGES; k++) {
        const double x = hermite(motion, t + DF_C[k] * h);
        const memory from = {now->y[DF_PISTON], now->grip, hermite_speed(motion, t + DF_C[k] * h)};
        double known[DF_STATES];
        for (int i = 0; i < DF_STATES; i++) {
            known[i] = now->y[i];
            for (int l = 0; l < k; l++)
                known[i] += h * DF_A[k][l] * F[l][i];
        }
        guess_state(q, now, guide, k, x, h, y);
        if (solve_stage(q, o, x, &now->gas, known, hd, &from, y, &c, &b, &inverse, work, code))
            return STEP_REFUSED;
        for (int i = 0; i < DF_STATES; i++)
            F[k][i] = b.F[i];
        guide_of(q, &b, x, y, guide[k]);
        carry_slopes(q, now, &b, &inverse, taken(q, &c, y), &from, y[DF_PISTON], h, k, S, G);
    }
    double r[DF_STATES] = {0.0, 0.0, 0.0}, e[DF_STATES];
    for (int k = 0; k < DF_STAGES; k++) {
        r[0] += h * DF_E[k] * F[k][0];
        r[1] += h * DF_E[k] * F[k][1];
    }
    apply(&inverse, r, e);
    const double K = q->numbers[DF_NUMBER_K];
    *error = fmax(q->a_1 * K * c.inverse[0] * fabs(e[0]), q->a_2 * K * c.inverse[1] * fabs(e[1])) / o->tolerance;
    if (!(*error <= 1.0))
        return STEP_REFUSED;
    if (is_elastic(q) && q->numbers[DF_NUMBER_PRESLIDING] > 0.0)
        remember(q, y[DF_PISTON] - now->y[DF_PISTON], S, now);
    now->b = b;
    for (int i = 0; i < DF_STATES; i++) {
        now->y[i] = y[i];
        now->F[i] = F[DF_STAGES - 1][i];
        now->guide_old[i] = guide[0][i];
        now->guide_mid[i] = guide[1][i];
    }
    for (int j = 0; j < now->n_which; j++) {
        if (!moves_the_state(q, now->which[j]))
            continue;
        for (int i = 0; i < DF_STATES; i++) {
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
                            n[DF_NUMBER_FRICTION] >= 0.0 && n[DF_NUMBER_STIFFNESS] >= 0.0 &&
                            n[DF_NUMBER_PLAY] >= 0.0 && n[DF_NUMBER_DRAG] >= 0.0 &&
                            n[DF_NUMBER_PRESLIDING] >= 0.0 && n[DF_NUMBER_BREAKAWAY] >= 0.0 &&
                            n[DF_NUMBER_STRIBECK] >= 0.0 && n[DF_NUMBER_PRESSED] >= 0.0 &&
                            (n[DF_NUMBER_BREAKAWAY] == 0.0 || n[DF_NUMBER_STRIBECK] > 0.0) &&
                            q->a_1 > 0.0 && q->a_2 > q->a_1 && q->rho_0 > 0.0))
        return 0;
    for (int k = 0; k < q->n_passages; k++) {
        if (!passage_is_sound(q, &q->passages[k]))
            return 0;
    }
    return 1;
}

/* Fill all chambers at one pressure P, and the gas for it. */
static int fill_at(const df_network *q, const chambers *c, double P, df_network_state *now, double *growth)
{
    const df_geometry g = gas_geometry(q);
    const df_parameters p = gas_parameters(q);
    const double K = q->numbers[DF_NUMBER_K], P_0 = p.P_0, phi = q->numbers[DF_NUMBER_PHI];
    const double volume = 1.0 - (P - P_0) / K + phi * (P_0 / P - 1.0);
    const double by_P = 1.0 / K + phi * P_0 / (P * P); /* -d volume/dP */
    *growth = 0.0;
    now->y[1] = q->rho_0 * q->V_2;
    for (int i = 0; i < n_oil(q); i++) {
        /* Without free gas the law is in the density, with it in the specific volume. */
        now->y[i] = phi == 0.0 ? c->full[i] * (1.0 + (P - P_0) / K) : c->full[i] / volume;
        *growth += phi == 0.0 ? c->full[i] / K : c->full[i] * by_P / (volume * volume);
    }
    return df_gas_expand(&g, &p, taken(q, c, now->y), &now->gas) ? DF_CHAMBER_EMPTY : DF_OK;
}

/* One pressure in all chambers, the mounting in equilibrium without friction; P by Newton. */
static int equalise(const df_network *q, double x, df_network_state *now, chambers *c)
{
    const double k = q->numbers[DF_NUMBER_STIFFNESS];
    double P = q->numbers[DF_NUMBER_P_0], growth = 0.0;
    now->y[DF_PISTON] = x;
    for (int turn = 0; turn < 100; turn++) {
        const double force = (q->a_1 - q->a_2) * P + q->rod_force;
        const double moved = now->y[DF_PISTON];
        if (k > 0.0 && force != 0.0)
            now->y[DF_PISTON] = x - force / k - copysign(0.5 * q->numbers[DF_NUMBER_PLAY], force);
        int code = fill_chambers(q, now->y[DF_PISTON], c);
        if (code == DF_OK)
            code = fill_at(q, c, P, now, &growth);
        if (code != DF_OK)
            return code;
        const df_law gas = df_gas_pressure(&now->gas, taken(q, c, now->y));
        const double change = (gas.value - P) / (1.0 - gas.slope * growth);
        P = fmax(P + change, 0.1 * P);
        if (fabs(change) <= 1e-12 * P && fabs(now->y[DF_PISTON] - moved) <= 1e-15)
            break;
    }
    return DF_OK;
}

/* The sensitivities of such a start, by the implicit function theorem. */
static void start_slopes(const df_network *q, const chambers *c, df_network_state *now)
{
    const df_network_balance *b = &now->b;
    const double k = b->pull_slope, a_r = q->a_2 - q->a_1, s = taken(q, c, now->y);
    for (int j = 0; j < now->n_which; j++) {
        double direct[3], slope[DF_STATES], own = 0.0, growth = 0.0, by_y = b->slope[2][DF_PISTON];
        pressures_by(q, b, s, now->which[j], direct);
        balance_by(q, b, s, 0.0, now->which[j], slope);
        for (int i = 0; i < n_oil(q); i++) {
            own += direct[i] / b->slope[i][i];
            growth += 1.0 / b->slope[i][i];
            by_y -= b->slope[2][i] * b->slope[i][DF_PISTON] / b->slope[i][i];
        }
        /* k dy = a_r dP + what the mounting's own numbers do; y moves P in turn. */
        const double pushed = k > 0.0 ? (slope[DF_PISTON] + oil_force(q, direct)) / k : 0.0;
        const double lever = k > 0.0 ? by_y * a_r / k : 0.0;
        const double by_s = b->slope[2][0];
        const double change = (direct[2] - by_s * own + by_y * pushed) / (1.0 - by_s * growth - lever);
        now->S[j][1] = 0.0;
        now->S[j][DF_PISTON] = k > 0.0 ? pushed + a_r * change / k : 0.0;
        for (int i = 0; i < n_oil(q); i++)
            now->S[j][i] = (change - direct[i] - b->slope[i][DF_PISTON] * now->S[j][DF_PISTON]) / b->slope[i][i];
        for (int i = 0; i < 2; i++)
            now->G[j][i] = b->J[i][0] * now->S[j][0] + b->J[i][1] * now->S[j][1] + slope[i];
        now->G[j][DF_PISTON] = 0.0;
    }
}

int df_begin_network(const df_network *q, const df_options *o, double x, double v, const int *which,
             int n_which, df_network_state *now)
{
    chambers c;
    if (!network_is_sound(q) || n_which < 0 || n_which > q->n_numbers || !(o->tolerance > 0.0 && o->dead_band > 0.0))
        return DF_BAD_ARGUMENT;
    for (int j = 0; j < n_which; j++) {
        if (which[j] < 0 || which[j] >= q->n_numbers)
            return DF_BAD_ARGUMENT;
        now->which[j] = which[j];
    }
    now->n_which = n_which;
    if (!isfinite(v))
        return DF_NOT_FINITE;
    const int code = equalise(q, x, now, &c);
    if (code != DF_OK)
        return code;
    const memory from = {now->y[DF_PISTON], 0.0, v};
    now->grip = 0.0;
    for (int j = 0; j < n_which; j++)
        now->grip_by[j] = 0.0;
    evaluate(q, &c, &now->gas, now->y, &now->b);
    hold(q, o, x, now->y[DF_PISTON], 0.0, &from, &now->b);
    start_slopes(q, &c, now);
    guide_of(q, &now->b, x, now->y, now->guide_mid);
    for (int i = 0; i < DF_STATES; i++) {
        now->F[i] = i < 2 ? now->b.F[i] : 0.0;
        now->guide_old[i] = now->guide_mid[i];
    }
    now->t_old = -2.0;
    now->t_mid = -1.0;
    now->wish = 0.0;
    now->x = x;
    now->v = v;
    return DF_OK;
}

/* The fill of a chamber at a pressure: the inverse of oil_pressure. An empty one stays as it is. */
static double filled_to(const df_network *q, double P, double fill)
{
    const double K = q->numbers[DF_NUMBER_K], P_0 = q->numbers[DF_NUMBER_P_0];
    const double phi = q->numbers[DF_NUMBER_PHI];
    if (phi == 0.0)
        return P > 0.0 ? (P - P_0) / K : fmin(fill, -P_0 / K);
    return 1.0 / (1.0 - (P - P_0) / K + phi * (P_0 / fmax(P, 1e-3) - 1.0)) - 1.0;
}

/* No past to predict from; the rates of the sensitivities are those of here. */
static void restart(const df_network *q, const chambers *c, df_network_state *now)
{
    const double s = taken(q, c, now->y);
    evaluate(q, c, &now->gas, now->y, &now->b);
    guide_of(q, &now->b, now->x, now->y, now->guide_mid);
    for (int i = 0; i < DF_STATES; i++) {
        now->F[i] = i < 2 ? now->b.F[i] : 0.0;
        now->guide_old[i] = now->guide_mid[i];
    }
    for (int j = 0; j < now->n_which; j++) {
        double slope[DF_STATES];
        balance_by(q, &now->b, s, now->v, now->which[j], slope);
        for (int i = 0; i < 2; i++)
            now->G[j][i] = now->b.J[i][0] * now->S[j][0] + now->b.J[i][1] * now->S[j][1] + slope[i];
    }
    now->t_old = -2.0;
    now->t_mid = -1.0;
}

/* The slopes of the oil's pressures, which stay as they are while the numbers change: 1 before, with
 * their sensitivities into `kept`, -1 after, and out of it. */
static void keep_slopes(const df_network *q, const df_network *changed, const chambers *c, int way,
                        double kept[][2], df_network_state *now)
{
    const double s = taken(q, c, now->y);
    for (int j = 0; j < now->n_which; j++) {
        const int place = now->which[j], is_new = q->numbers[place] != changed->numbers[place];
        double direct[3] = {0.0, 0.0, 0.0};
        if (moves_pressures(place))
            pressures_by(q, &now->b, s, place, direct);
        for (int i = 0; i < n_oil(q); i++) {
            const double slope = now->b.slope[i][i];
            if (way > 0)
                kept[j][i] = is_new ? 0.0 : direct[i] + slope * now->S[j][i];
            else if (slope > 0.0) /* of an empty chamber the oil stays */
                now->S[j][i] = (kept[j][i] - direct[i]) / slope;
        }
        if (way > 0 && is_new)
            now->grip_by[j] = 0.0;
    }
}

int df_retune_network(df_network *q, const df_network *changed, const df_options *o, df_network_state *now)
{
    const df_geometry g = gas_geometry(changed);
    const df_parameters p = gas_parameters(changed);
    double kept[DF_MOST_NUMBERS][2] = {{0.0}};
    chambers c;
    if (!network_is_sound(changed) || is_elastic(q) || is_elastic(changed) || !(o->dead_band > 0.0))
        return DF_BAD_ARGUMENT;
    const int code = fill_chambers(changed, now->x, &c);
    if (code != DF_OK)
        return code;
    const double fills[2] = {filled_to(changed, now->b.P[0], now->b.fill[0]),
                             filled_to(changed, now->b.P[1], now->b.fill[1])};
    double y[DF_STATES] = {now->y[0], now->y[1], now->y[DF_PISTON]};
    for (int i = 0; i < n_oil(changed); i++)
        y[i] = c.full[i] * (1.0 + fills[i]);
    df_gas_point gas;
    if (df_gas_expand(&g, &p, taken(changed, &c, y), &gas))
        return DF_CHAMBER_EMPTY;
    keep_slopes(q, changed, &c, 1, kept, now);
    *q = *changed;
    now->gas = gas;
    for (int i = 0; i < 2; i++)
        now->y[i] = y[i];
    evaluate(q, &c, &now->gas, now->y, &now->b);
    keep_slopes(q, q, &c, -1, kept, now);
    restart(q, &c, now);
    return DF_OK;
}

int df_place_network(const df_network *q, const double oil[2], double grip, double x, double v, df_network_state *now)
{
    const df_geometry g = gas_geometry(q);
    const df_parameters p = gas_parameters(q);
    chambers c;
    if (is_elastic(q))
        return DF_BAD_ARGUMENT;
    if (!isfinite(oil[0]) || !isfinite(oil[1]) || !isfinite(grip) || !isfinite(v))
        return DF_NOT_FINITE;
    const int code = fill_chambers(q, x, &c);
    if (code != DF_OK)
        return code;
    now->y[0] = q->rho_0 * q->V_1 + oil[0];
    now->y[1] = q->rho_0 * q->V_2 + oil[1];
    now->y[DF_PISTON] = now->x = x;
    now->v = v;
    now->grip = grip;
    if (df_gas_expand(&g, &p, taken(q, &c, now->y), &now->gas))
        return DF_CHAMBER_EMPTY;
    restart(q, &c, now);
    return DF_OK;
}

int df_advance_network(const df_network *q, const df_options *o, double x, double v, double interval,
               df_network_state *now, df_work *work)
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
        chambers c;
        int code = fill_chambers(q, is_elastic(q) ? now->y[DF_PISTON] : hermite(&motion, t), &c);
        if (code != DF_OK)
            return code;
        const double s = taken(q, &c, now->y);
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
            /* An elastic mounting may throw a guess of the piston out of its chambers. */
            if (code != DF_OK && (!is_elastic(q) || h < 1e-9 * interval))
                return code;
            work->rejected++;
            const double shrink = error < INFINITY ? 0.9 / cbrt(error) : 0.2;
            now->wish = h * (shrink < 0.1 ? 0.1 : shrink);
        }
    }
    if (!is_elastic(q) && q->numbers[DF_NUMBER_PRESLIDING] > 0.0)
        remember_piece(q, &motion, now);
    now->x = x;
    now->v = v;
    return isfinite(now->b.P[0]) && isfinite(now->b.P[1]) && isfinite(now->b.P[2]) ? DF_OK : DF_NOT_FINITE;
}

static double slope_of_force(const df_network *q, const df_network_state *now, int j, double s, double friction)
{
    const df_network_balance *b = &now->b;
    const int place = now->which[j];
    if (place == DF_NUMBER_OFFSET)
        return 1.0;
    if (is_elastic(q)) {
        double own = 0.0;
        if (place == DF_NUMBER_STIFFNESS)
            own = b->pull / q->numbers[DF_NUMBER_STIFFNESS];
        else if (place == DF_NUMBER_PLAY && b->pull != 0.0)
            own = -0.5 * copysign(b->pull_slope, b->pull);
        return own - b->pull_slope * now->S[j][DF_PISTON];
    }
    const double own = friction * rubbing_by(q, now->v, b->P[0], place);
    const double kept = rubbing(q, now->v, b->P[0]) * now->grip_by[j];
    if (place == DF_NUMBER_DRAG)
        return now->v;
    if (!moves_the_state(q, place))
        return own + kept;
    double P[3];
    pressures_by(q, b, s, place, P);
    for (int i = 0; i < 2; i++)
        P[i] += b->slope[i][0] * now->S[j][0] + b->slope[i][1] * now->S[j][1];
    return oil_force(q, P) + q->numbers[DF_NUMBER_PRESSED] * friction * P[0];
}

double df_force_network(const df_network *q, const df_options *o, const df_network_state *now, double *slopes)
{
    const df_network_balance *b = &now->b;
    const int presliding = q->numbers[DF_NUMBER_PRESLIDING] > 0.0;
    const double friction = presliding ? now->grip : df_friction_share(now->v, o->dead_band);
    const double piston = is_elastic(q) ? now->y[DF_PISTON] : now->x;
    const double shift = q->has_floating_piston ? q->rho_0 * q->a_2 * piston : now->y[1] - q->rho_0 * q->V_2;
    const double s = now->y[0] - q->rho_0 * q->V_1 + shift;
    for (int j = 0; j < now->n_which; j++)
        slopes[j] = slope_of_force(q, now, j, s, friction);
    const double offset = q->numbers[DF_NUMBER_OFFSET];
    if (is_elastic(q))
        return b->pull + offset;
    return oil_force(q, b->P) + q->rod_force + rubbing(q, now->v, b->P[0]) * friction +
           q->numbers[DF_NUMBER_DRAG] * now->v + offset;
}

static void write_sample(const df_network *q, const df_options *o, const df_network_state *now,
                         const df_result *r, size_t i, size_t n)
{
    double slopes[DF_MOST_NUMBERS];
    r->force[i] = df_force_network(q, o, now, slopes);
    for (int k = 0; k < 3; k++)
        r->pressures[(size_t)k * n + i] = now->b.P[k];
    for (int k = 0; k < 2; k++)
        r->masses[(size_t)k * n + i] = now->y[k];
    for (int j = 0; j < r->n_which; j++)
        r->sensitivities[(size_t)j * n + i] = slopes[j];
}

int df_simulate_network(const df_network *q, const df_options *o, const df_motion *motion,
                        const df_result *r, df_work *work)
{
    df_network_state now;
    work->steps = work->rejected = work->newton = 0;
    work->failed_sample = 0;
    if (motion->n < 1 || r->n_which < 0 || !(motion->interval > 0.0))
        return DF_BAD_ARGUMENT;
    int code = df_begin_network(q, o, motion->x[0], motion->v[0], r->which, r->n_which, &now);
    if (code != DF_OK)
        return code;
    write_sample(q, o, &now, r, 0, motion->n);
    for (size_t i = 1; i < motion->n; i++) {
        work->failed_sample = i;
        code = df_advance_network(q, o, motion->x[i], motion->v[i], motion->interval, &now, work);
        if (code != DF_OK)
            return code;
        write_sample(q, o, &now, r, i, motion->n);
    }
    work->failed_sample = motion->n;
    return DF_OK;
}
