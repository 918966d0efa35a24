/* One implicit stage of the network's balances, by Newton: I - h diagonal J for the masses and, where
 * the mounting is elastic, the equilibrium 0 = pull - oil - rod - friction as third row. */
#ifndef DAMPERFIT_NETWORK_STAGE_H
#define DAMPERFIT_NETWORK_STAGE_H

#include "network_mounting.h"

#define NEWTON_LIMIT 30
#define NEWTON_FREE 4 /* corrections that are trusted before the residual must fall */
/* A Newton correction of p Pa leaves p^2/(4 D) behind and turns the sensitivities by p/(2 D), so the
 * last correction may be this share of the smallest D across a root (and no larger than asked for, in N). */
#define SHARE_DONE 1e-4
#define PA_DONE 1e-3
#define ROUNDING_SHARE 4e-16 /* of K: what doubles make of a pressure that is K (m/(rho V) - 1) */
#define PULL_DONE 1e-4 /* what the last correction may leave of the forces at the mounting, N */
#define PULL_STRAIGHT 1.0 /* N; so much of it where play and friction stay on straight pieces: of the oil's
                             pressures its square leaves 1e-3 Pa */

/* What a stage is solved with. */
typedef struct {
    const df_network *q;
    const df_options *o;
    const df_gas_point *gas;
    double x;              /* of the rig */
    double hd, inverse_hd; /* step times the method's diagonal */
    double known[DF_STATES];
    memory from;
} stage;

/* What it ends with. */
typedef struct {
    double y[DF_STATES];
    chambers c;
    df_network_balance b;
    df_flows f;
    double inverse[DF_STATES][DF_STATES];
    double taken; /* from the gas chamber, kg */
} solution;

DF_FOR_EACH_KIND void invert(const stage *s, const int kind, const df_network_balance *b,
                             double inverse[DF_STATES][DF_STATES])
{
    const df_network *q = s->q;
    const double a11 = 1.0 - s->hd * b->J[0][0], a12 = -s->hd * b->J[0][1];
    const double a21 = -s->hd * b->J[1][0], a22 = 1.0 - s->hd * b->J[1][1];
    const double r = 1.0 / (a11 * a22 - a12 * a21);
    const double A[2][2] = {{a22 * r, -a12 * r}, {-a21 * r, a11 * r}};
    if (!(kind & DF_IS_ELASTIC)) {
        inverse[0][0] = A[0][0];
        inverse[0][1] = A[0][1];
        inverse[1][0] = A[1][0];
        inverse[1][1] = A[1][1];
        return;
    }
    /* By the Schur complement of the masses. */
    const double pressed = q->a_1 + q->numbers[DF_NUMBER_PRESSED] * b->grip;
    const int floats = kind & DF_HAS_FLOATING_PISTON;
    const double right[2] = {-s->hd * b->J[0][DF_PISTON], -s->hd * b->J[1][DF_PISTON]};
    const double below[2] = {pressed * b->own[0] - (floats ? q->a_2 * b->gas : 0.0), -q->a_2 * b->own[1]};
    const double oil = pressed * b->by_y[0] - q->a_2 * b->by_y[1];
    const double corner = b->pull_slope + oil + b->brake * s->inverse_hd + b->caught;
    const double AR[2] = {A[0][0] * right[0] + A[0][1] * right[1], A[1][0] * right[0] + A[1][1] * right[1]};
    const double BA[2] = {below[0] * A[0][0] + below[1] * A[1][0], below[0] * A[0][1] + below[1] * A[1][1]};
    const double rest = 1.0 / (corner - below[0] * AR[0] - below[1] * AR[1]);
    for (int j = 0; j < 2; j++) {
        for (int k = 0; k < 2; k++)
            inverse[j][k] = A[j][k] + AR[j] * rest * BA[k];
        inverse[j][DF_PISTON] = -AR[j] * rest;
        inverse[DF_PISTON][j] = -rest * BA[j];
    }
    inverse[DF_PISTON][DF_PISTON] = rest;
}

DF_FOR_EACH_KIND void apply(const int kind, double inverse[DF_STATES][DF_STATES], const double r[DF_STATES],
                            double e[DF_STATES])
{
    e[0] = inverse[0][0] * r[0] + inverse[0][1] * r[1];
    e[1] = inverse[1][0] * r[0] + inverse[1][1] * r[1];
    if (kind & DF_IS_ELASTIC) {
        e[0] += inverse[0][2] * r[2];
        e[1] += inverse[1][2] * r[2];
        e[2] = inverse[2][0] * r[0] + inverse[2][1] * r[1] + inverse[2][2] * r[2];
    }
}

/* A passage with an orifice is curved like a root, and plain Newton jumps to and fro across it. The
 * correction is moved so that D follows the flow, in which the law is smooth, for as many passages
 * between different chambers as there are masses; those that turn most come first. */
void df_follow_the_roots(const df_network *q, const df_network_balance *b, const df_flows *f, double e[DF_STATES]);

/* The same where only one passage has an orifice, between chambers 1 and 3. */
static inline void follow_one_root(const df_network *q, const df_network_balance *b, const df_flows *f,
                                   double e[DF_STATES])
{
    const df_way *way = &q->plan.ways[0];
    const double slope = b->own[0] - b->gas, change = slope * e[0] - b->gas * e[1], D = f->D[DF_1_3];
    if (b->own[0] > 0.0 && fabs(change) > 0.02 * (fabs(D) + q->rounding))
        e[0] += (df_passage_drop(&way->law, f->w[0] + f->g[0] * change, q->rounding) - D - change) / slope;
}

/* The correction of the piston, and whether it takes friction across a corner: at a speed of nothing,
 * or where the step has begun. */
static inline int crosses_a_corner(const stage *s, const df_network_balance *b, double y, double moved, double *share)
{
    const int presliding = s->q->numbers[DF_NUMBER_PRESLIDING] > 0.0;
    const double here = presliding ? y - s->from.y : b->speed;
    const double then = here + (presliding ? moved : moved * s->inverse_hd);
    *share = -here / (then - here);
    return (presliding || fabs(b->grip) == 1.0) && here * then < 0.0;
}

/* Whether a correction leaves play and friction on the straight pieces that it was computed for, so that
 * it leaves nothing behind at the mounting. */
static inline int stays_straight(const stage *s, const df_network_balance *b, double y, double moved)
{
    const df_network *q = s->q;
    const double half = 0.5 * q->numbers[DF_NUMBER_PLAY], stretch = s->x - y - moved;
    const double slope = fabs(stretch) > half ? q->numbers[DF_NUMBER_STIFFNESS] : 0.0; /* rubber: is not straight */
    const double grip = df_friction_share(b->speed + moved * s->inverse_hd, turning_band(q, s->o->dead_band));
    const int slides = fabs(b->grip) == 1.0;
    return slope == b->pull_slope && stretch * b->pull >= 0.0 && !(q->numbers[DF_NUMBER_PRESLIDING] > 0.0) &&
           (slides ? grip == b->grip : fabs(grip) < 1.0);
}

/* Whether the last correction has done it at the mounting. */
static inline int is_held(const stage *s, const df_network_balance *b, double y, double moved)
{
    const double pulled = larger(s->q->numbers[DF_NUMBER_STIFFNESS], b->pull_slope) * fabs(moved);
    return pulled <= PULL_DONE || (pulled <= PULL_STRAIGHT && stays_straight(s, b, y, moved));
}

/* The balances at the last correction, without another look. */
DF_FOR_EACH_KIND int end_stage(const stage *s, const int kind, const double y[DF_STATES], const double e[DF_STATES],
                               df_network_balance *b, solution *end)
{
    const int floats = kind & DF_HAS_FLOATING_PISTON, elastic = kind & DF_IS_ELASTIC;
    double P1 = b->P[0] + b->own[0] * e[0], P2 = b->P[1] + b->own[1] * e[1];
    double P3 = b->P[2] + b->gas * (floats ? e[0] : e[0] + e[1]);
    if (elastic) {
        if (fill_chambers(s->q, y[DF_PISTON], &end->c) != DF_OK)
            return DF_CHAMBER_EMPTY;
        P1 += b->by_y[0] * e[DF_PISTON];
        P2 += b->by_y[1] * e[DF_PISTON];
        P3 += b->by_y[2] * e[DF_PISTON];
        b->pull -= b->pull_slope * e[DF_PISTON];
        b->beyond -= b->beyond != 0.0 ? e[DF_PISTON] : 0.0;
        b->F[DF_PISTON] = (y[DF_PISTON] - s->known[DF_PISTON]) * s->inverse_hd;
    }
    b->P[0] = larger(P1, 0.0);
    b->P[1] = larger(floats ? P3 : P2, 0.0);
    b->P[2] = larger(P3, 0.0);
    b->F[0] = (y[0] - s->known[0]) * s->inverse_hd;
    b->F[1] = (y[1] - s->known[1]) * s->inverse_hd;
    b->fill[0] = (y[0] - end->c.full[0]) * end->c.inverse[0];
    if (!floats)
        b->fill[1] = (y[1] - end->c.full[1]) * end->c.inverse[1];
    end->taken = taken(s->q, kind, &end->c, y);
    return DF_OK;
}

/* y = known + hd F(y), the mounting in equilibrium; `end` holds the guess and its chambers. Returns 0
 * when it converged. */
DF_FOR_EACH_KIND int solve_stage(const stage *s, const int kind, solution *end, df_work *work, int *code)
{
    const df_network *q = s->q;
    const double K = q->numbers[DF_NUMBER_K], asked = 0.01 * s->o->tolerance;
    const double share_done = asked < SHARE_DONE ? asked : SHARE_DONE, least = PA_DONE + ROUNDING_SHARE * K;
    const int elastic = kind & DF_IS_ELASTIC;
    df_network_balance *b = &end->b;
    double *y = end->y, before = INFINITY, e[DF_STATES] = {0.0, 0.0, 0.0};
    for (int k = 0; k < NEWTON_LIMIT; k++) {
        if (k > 0 && elastic) {
            *code = fill_chambers(q, y[DF_PISTON], &end->c);
            if (*code != DF_OK)
                return 1;
        }
        evaluate(q, kind, &end->c, s->gas, y, b, &end->f);
        work->newton++;
        double r[DF_STATES] = {s->known[0] + s->hd * b->F[0] - y[0], s->known[1] + s->hd * b->F[1] - y[1], 0.0};
        const double stiff1 = K * end->c.inverse[0], stiff2 = K * end->c.inverse[1];
        double size = larger(stiff1 * fabs(r[0]), stiff2 * fabs(r[1]));
        if (elastic) {
            const double speed = (y[DF_PISTON] - s->known[DF_PISTON]) * s->inverse_hd;
            hold(q, s->o, s->x, y[DF_PISTON], speed, &s->from, b);
            r[DF_PISTON] = b->pull - oil_force(q, b->P) - q->rod_force - b->rub * b->grip -
                           q->numbers[DF_NUMBER_DRAG] * speed;
            size = larger(size, fabs(r[DF_PISTON]) / q->a_2);
        }
        if (k > NEWTON_FREE && size > before) { /* half the way back */
            for (int i = 0; i < DF_STATES; i++) {
                e[i] *= 0.5;
                y[i] -= e[i];
            }
            continue;
        }
        before = size;
        invert(s, kind, b, end->inverse);
        apply(kind, end->inverse, r, e);
        const double far1 = stiff1 * fabs(e[0]), far2 = stiff2 * fabs(e[1]);
        if (!(far1 < INFINITY && far2 < INFINITY) || !isfinite(e[DF_PISTON]))
            return 1;
        const double nearest = end->f.nearest < INFINITY ? larger(end->f.nearest, q->rounding) : 0.0;
        const double done = least + share_done * nearest;
        double share = 1.0;
        const int crosses = elastic && crosses_a_corner(s, b, y[DF_PISTON], e[DF_PISTON], &share);
        const int converged = far1 <= done && far2 <= done && !crosses &&
                              (!elastic || is_held(s, b, y[DF_PISTON], e[DF_PISTON]));
        if (crosses && b->rub > 0.0) {
            /* Beyond the dead band lies another branch: stop inside and look. */
            for (int i = 0; i < DF_STATES; i++)
                e[i] *= share;
            before = INFINITY;
        } else if (!converged && kind & DF_IS_PURDY) {
            follow_one_root(q, b, &end->f, e);
        } else if (!converged) {
            df_follow_the_roots(q, b, &end->f, e);
        }
        y[0] += e[0];
        y[1] += e[1];
        if (elastic)
            y[DF_PISTON] += e[DF_PISTON];
        if (crosses && b->rub > 0.0 && q->numbers[DF_NUMBER_PRESLIDING] > 0.0)
            y[DF_PISTON] = s->from.y; /* exactly, for only there the branch is chosen anew */
        if (converged) {
            *code = end_stage(s, kind, y, e, b, end);
            return *code != DF_OK;
        }
    }
    return 1;
}

#endif
