/* A network on a rigid mounting without an integrator, with every first derivative: for a solver
 * that is not ours. The laws are network_balance.h, as in network.c. */
#include "network_slopes.h"

/* Coulomb's friction turns within the band; one that pre-slides is a state of its own. */
static int slides_by_state(const df_network *q)
{
    return q->numbers[DF_NUMBER_PRESLIDING] > 0.0;
}

int df_evaluate_network(const df_network *q, double dead_band, const double oil[2], double grip, double x, double v,
                        df_network_rates *r)
{
    const df_gas spring = gas_of(q);
    const double m[DF_STATES] = {q->plan.oil[0] + oil[0], q->plan.oil[1] + oil[1], 0.0};
    df_gas_point gas;
    chambers c;
    if (is_elastic(q) || !(dead_band > 0.0))
        return DF_BAD_ARGUMENT;
    if (!isfinite(oil[0]) || !isfinite(oil[1]) || !isfinite(grip) || !isfinite(v))
        return DF_NOT_FINITE;
    const int code = fill_chambers(q, x, &c);
    if (code != DF_OK)
        return code;
    r->taken = taken(q, kind_of(q), &c, m);
    if (df_gas_expand(&spring, r->taken, &gas))
        return DF_CHAMBER_EMPTY;
    const df_network_balance nothing = {0};
    r->b = nothing;
    evaluate(q, kind_of(q) | DF_IS_ELASTIC, &c, &gas, m, &r->b, &r->flows);
    const double sigma = q->numbers[DF_NUMBER_PRESLIDING];
    r->v = v;
    r->band = turning_band(q, dead_band);
    r->b.grip = sigma > 0.0 ? grip : df_friction_share(v, r->band);
    r->b.grip_by_turning = grip_by_turning(q, v, dead_band);
    r->b.rub = rubbing(q, v, r->b.P[0]);
    r->rates[0] = r->b.F[0];
    r->rates[1] = r->b.F[1];
    r->rates[2] = sigma > 0.0 ? (v - fabs(v) * grip) / sigma : 0.0;
    for (int i = 0; i < 2; i++) /* without the clamp where there is one */
        r->free[i] = q->numbers[DF_NUMBER_PHI] == 0.0 && i < n_oil(q)
                         ? q->numbers[DF_NUMBER_K] * r->b.fill[i] + q->numbers[DF_NUMBER_P_0]
                         : r->b.P[i];
    r->force = oil_force(q, r->b.P) + q->rod_force + r->b.rub * r->b.grip + q->numbers[DF_NUMBER_DRAG] * v +
               q->numbers[DF_NUMBER_OFFSET];
    return DF_OK;
}

/* What a known does by way of the pressures. */
static void press(const df_network *q, const df_network_rates *r, const double P[3], df_network_slopes *d)
{
    for (int i = 0; i < 3; i++)
        d->pressures[i] = P[i];
    d->force = oil_force(q, P) + q->numbers[DF_NUMBER_PRESSED] * r->b.grip * P[0];
}

static void by_state(const df_network *q, const df_network_rates *r, int state, df_network_slopes *d)
{
    const double P[3] = {slope_of(q, &r->b, 0, state), slope_of(q, &r->b, 1, state), slope_of(q, &r->b, 2, state)};
    press(q, r, P, d);
    d->rates[0] = r->b.J[0][state];
    d->rates[1] = r->b.J[1][state];
}

static void by_speed(const df_network *q, const df_network_rates *r, df_network_slopes *d)
{
    const double sigma = q->numbers[DF_NUMBER_PRESLIDING], v_s = q->numbers[DF_NUMBER_STRIBECK];
    const double turn = r->v > 0.0 ? 1.0 : r->v < 0.0 ? -1.0 : 0.0;
    d->force = q->numbers[DF_NUMBER_DRAG];
    if (v_s > 0.0) {
        const double s = r->v / v_s;
        d->force -= 2.0 * s / v_s * q->numbers[DF_NUMBER_BREAKAWAY] * exp(-s * s) * r->b.grip;
    }
    if (slides_by_state(q))
        d->rates[2] = (1.0 - turn * r->b.grip) / sigma;
    else if (fabs(r->v) < r->band)
        d->force += r->b.rub / r->band;
}

static void by_number(const df_network *q, const df_network_rates *r, int place, df_network_slopes *d)
{
    double P[3] = {0.0, 0.0, 0.0}, F[DF_STATES];
    if (moves_pressures(place))
        df_pressures_by(q, &r->b, r->taken, place, P);
    press(q, r, P, d);
    balance_by(q, kind_of(q), &r->b, &r->flows, r->taken, r->v, place, F);
    d->rates[0] = F[0];
    d->rates[1] = F[1];
    if (place == DF_NUMBER_PRESLIDING && slides_by_state(q))
        d->rates[2] = -r->rates[2] / q->numbers[DF_NUMBER_PRESLIDING];
    d->force += r->b.grip * df_rubbing_by(q, r->v, r->b.P[0], place);
    if (place == DF_NUMBER_DRAG)
        d->force += r->v;
    else if (place == DF_NUMBER_TURNING)
        d->force += r->b.rub * r->b.grip_by_turning;
    else if (place == DF_NUMBER_OFFSET)
        d->force += 1.0;
}

void df_network_by(const df_network *q, const df_network_rates *r, int known, df_network_slopes *d)
{
    const df_network_slopes nothing = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}, 0.0};
    *d = nothing;
    if (known == DF_BY_OIL_1 || known == DF_BY_OIL_2)
        by_state(q, r, known == DF_BY_OIL_1 ? DF_M1 : DF_M2, d);
    else if (known == DF_BY_PLACE)
        by_state(q, r, DF_PISTON, d);
    else if (known == DF_BY_SPEED)
        by_speed(q, r, d);
    else if (known == DF_BY_BAND && !slides_by_state(q) && r->band > q->numbers[DF_NUMBER_TURNING] &&
             fabs(r->v) < r->band)
        d->force = -r->b.rub * r->v / (r->band * r->band);
    else if (known == DF_BY_GRIP && slides_by_state(q)) {
        d->force = r->b.rub;
        d->rates[2] = -fabs(r->v) / q->numbers[DF_NUMBER_PRESLIDING];
    } else if (known >= DF_BY_NUMBER && known - DF_BY_NUMBER < q->n_numbers) {
        by_number(q, r, known - DF_BY_NUMBER, d);
    }
}
