/* Where a simulation of a network begins, and where it goes on with other numbers. */
#include "network_mounting.h"

/* Fill all chambers at one pressure P, and the gas for it. */
static int fill_at(const df_network *q, const chambers *c, double P, df_network_state *now, double *growth)
{
    const df_gas spring = gas_of(q);
    const double K = q->numbers[DF_NUMBER_K], P_0 = spring.P_0, phi = q->numbers[DF_NUMBER_PHI];
    const double volume = 1.0 - (P - P_0) / K + phi * (P_0 / P - 1.0);
    const double by_P = 1.0 / K + phi * P_0 / (P * P); /* -d volume/dP */
    *growth = 0.0;
    now->y[1] = q->plan.oil[1];
    for (int i = 0; i < n_oil(q); i++) {
        /* Without free gas the law is in the density, with it in the specific volume. */
        now->y[i] = phi == 0.0 ? c->full[i] * (1.0 + (P - P_0) / K) : c->full[i] / volume;
        *growth += phi == 0.0 ? c->full[i] / K : c->full[i] * by_P / (volume * volume);
    }
    return df_gas_expand(&spring, taken(q, kind_of(q), c, now->y), &now->gas) ? DF_CHAMBER_EMPTY : DF_OK;
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
        const df_law gas = df_gas_pressure(&now->gas, taken(q, kind_of(q), c, now->y));
        const double change = (gas.value - P) / (1.0 - gas.slope * growth);
        P = larger(P + change, 0.1 * P);
        if (fabs(change) <= 1e-12 * P && fabs(now->y[DF_PISTON] - moved) <= 1e-15)
            break;
    }
    return DF_OK;
}

/* The sensitivities of such a start, by the implicit function theorem. */
static void start_slopes(const df_network *q, const chambers *c, const df_flows *f, df_network_state *now)
{
    const df_network_balance *b = &now->b;
    const double k = b->beyond != 0.0 ? q->numbers[DF_NUMBER_STIFFNESS] : 0.0, a_r = q->a_2 - q->a_1, s = taken(q, kind_of(q), c, now->y);
    for (int j = 0; j < now->n_which; j++) {
        double direct[3], slope[DF_STATES], own = 0.0, growth = 0.0, by_y = b->by_y[2];
        df_pressures_by(q, b, s, now->which[j], direct);
        balance_by(q, kind_of(q) | DF_IS_ELASTIC, b, f, s, 0.0, now->which[j], slope);
        for (int i = 0; i < n_oil(q); i++) {
            own += direct[i] / b->own[i];
            growth += 1.0 / b->own[i];
            by_y -= b->gas * b->by_y[i] / b->own[i];
        }
        /* k dy = a_r dP + what the mounting's own numbers do; y moves P in turn. */
        const double pushed = k > 0.0 ? (slope[DF_PISTON] + oil_force(q, direct)) / k : 0.0;
        const double lever = k > 0.0 ? by_y * a_r / k : 0.0;
        const double by_s = b->gas;
        const double change = (direct[2] - by_s * own + by_y * pushed) / (1.0 - by_s * growth - lever);
        now->S[j][1] = 0.0;
        now->S[j][DF_PISTON] = k > 0.0 ? pushed + a_r * change / k : 0.0;
        for (int i = 0; i < n_oil(q); i++)
            now->S[j][i] = (change - direct[i] - b->by_y[i] * now->S[j][DF_PISTON]) / b->own[i];
        for (int i = 0; i < 2; i++)
            now->G[j][i] = b->J[i][0] * now->S[j][0] + b->J[i][1] * now->S[j][1] +
                           b->J[i][DF_PISTON] * now->S[j][DF_PISTON] + slope[i];
        now->G[j][DF_PISTON] = 0.0;
    }
}

/* Balances and flows of a state, with their slopes by the piston's place too. */
static void look(const df_network *q, const chambers *c, df_network_state *now, df_flows *f)
{
    evaluate(q, kind_of(q) | DF_IS_ELASTIC, c, &now->gas, now->y, &now->b, f);
}

/* No past to predict from. */
static void forget(df_network_state *now)
{
    const double guide[DF_STATES] = {now->b.fill[0], now->b.fill[1], now->x - now->y[DF_PISTON]};
    for (int i = 0; i < DF_STATES; i++) {
        now->F[i] = i < 2 ? now->b.F[i] : 0.0;
        now->guide_mid[i] = now->guide_old[i] = guide[i];
    }
    now->t_old = -2.0;
    now->t_mid = -1.0;
}

static int ask(const df_network *q, const int *which, int n_which, df_network_state *now)
{
    if (n_which < 0 || n_which > q->n_numbers)
        return DF_BAD_ARGUMENT;
    now->n_which = n_which;
    now->n_active = 0;
    for (int j = 0; j < n_which; j++) {
        if (which[j] < 0 || which[j] >= q->n_numbers)
            return DF_BAD_ARGUMENT;
        now->which[j] = which[j];
        now->grip_by[j] = now->bend_by[j] = 0.0;
        if (df_moves_the_state(q, which[j]))
            now->active[now->n_active++] = j;
    }
    return DF_OK;
}

int df_begin_network(df_network *q, const df_options *o, double x, double v, const int *which,
                     int n_which, df_network_state *now)
{
    df_flows f;
    chambers c;
    int code = o->tolerance > 0.0 && o->dead_band > 0.0 ? df_plan_network(q) : DF_BAD_ARGUMENT;
    if (code == DF_OK)
        code = ask(q, which, n_which, now);
    if (code == DF_OK && !isfinite(v))
        code = DF_NOT_FINITE;
    if (code == DF_OK)
        code = equalise(q, x, now, &c);
    if (code != DF_OK)
        return code;
    now->grip = now->b.bend = 0.0;
    now->wish = 0.0;
    now->x = x;
    now->v = v;
    const memory from = {now->y[DF_PISTON], 0.0, v, x - now->y[DF_PISTON], 0.0};
    look(q, &c, now, &f);
    hold(q, o, x, now->y[DF_PISTON], 0.0, &from, &now->b);
    start_slopes(q, &c, &f, now);
    forget(now);
    return DF_OK;
}

/* The fill of a chamber at a pressure: the inverse of oil_pressure. An empty one stays as it is. */
static double filled_to(const df_network *q, double P, double fill)
{
    const double K = q->numbers[DF_NUMBER_K], P_0 = q->numbers[DF_NUMBER_P_0];
    const double phi = q->numbers[DF_NUMBER_PHI];
    if (phi == 0.0)
        return P > 0.0 ? (P - P_0) / K : -larger(-fill, P_0 / K);
    return 1.0 / (1.0 - (P - P_0) / K + phi * (P_0 / larger(P, 1e-3) - 1.0)) - 1.0;
}

/* No past to predict from; the rates of the sensitivities are those of here. */
static void restart(const df_network *q, const chambers *c, df_network_state *now)
{
    const double s = taken(q, kind_of(q), c, now->y);
    df_flows f;
    look(q, c, now, &f);
    forget(now);
    for (int j = 0; j < now->n_which; j++) {
        double slope[DF_STATES];
        balance_by(q, kind_of(q), &now->b, &f, s, now->v, now->which[j], slope);
        for (int i = 0; i < 2; i++)
            now->G[j][i] = now->b.J[i][0] * now->S[j][0] + now->b.J[i][1] * now->S[j][1] + slope[i];
    }
}

/* The slopes of the oil's pressures, which stay as they are while the numbers change: 1 before, with
 * their sensitivities into `kept`, -1 after, and out of it. */
static void keep_slopes(const df_network *q, const df_network *changed, const chambers *c, int way,
                        double kept[][2], df_network_state *now)
{
    const double s = taken(q, kind_of(q), c, now->y);
    for (int j = 0; j < now->n_which; j++) {
        const int place = now->which[j], is_new = q->numbers[place] != changed->numbers[place];
        double direct[3] = {0.0, 0.0, 0.0};
        if (moves_pressures(place))
            df_pressures_by(q, &now->b, s, place, direct);
        for (int i = 0; i < n_oil(q); i++) {
            const double slope = now->b.own[i];
            if (way > 0)
                kept[j][i] = is_new ? 0.0 : direct[i] + slope * now->S[j][i];
            else if (slope > 0.0) /* of an empty chamber the oil stays */
                now->S[j][i] = (kept[j][i] - direct[i]) / slope;
        }
        if (way > 0 && is_new)
            now->grip_by[j] = 0.0;
    }
}

int df_retune_network(df_network *q, df_network *changed, const df_options *o, df_network_state *now)
{
    const df_gas spring = gas_of(changed);
    double kept[DF_MOST_NUMBERS][2] = {{0.0}};
    df_flows f;
    chambers c;
    if (df_plan_network(changed) != DF_OK || is_elastic(q) || is_elastic(changed) || !(o->dead_band > 0.0))
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
    if (df_gas_expand(&spring, taken(changed, kind_of(changed), &c, y), &gas))
        return DF_CHAMBER_EMPTY;
    keep_slopes(q, changed, &c, 1, kept, now);
    *q = *changed;
    now->gas = gas;
    for (int i = 0; i < 2; i++)
        now->y[i] = y[i];
    look(q, &c, now, &f);
    keep_slopes(q, q, &c, -1, kept, now);
    restart(q, &c, now);
    return DF_OK;
}

int df_place_network(const df_network *q, const double oil[2], double grip, double x, double v, df_network_state *now)
{
    const df_gas spring = gas_of(q);
    chambers c;
    if (is_elastic(q))
        return DF_BAD_ARGUMENT;
    if (!isfinite(oil[0]) || !isfinite(oil[1]) || !isfinite(grip) || !isfinite(v))
        return DF_NOT_FINITE;
    const int code = fill_chambers(q, x, &c);
    if (code != DF_OK)
        return code;
    now->y[0] = q->plan.oil[0] + oil[0];
    now->y[1] = q->plan.oil[1] + oil[1];
    now->y[DF_PISTON] = now->x = x;
    now->v = v;
    now->grip = grip;
    if (df_gas_expand(&spring, taken(q, kind_of(q), &c, now->y), &now->gas))
        return DF_CHAMBER_EMPTY;
    restart(q, &c, now);
    return DF_OK;
}

