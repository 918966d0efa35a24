/* The force of a network, and a whole simulation. */
#include "network_slopes.h"

static double slope_of_force(const df_network *q, const df_network_state *now, int j, double s, double friction,
                             double by_turning)
{
    const df_network_balance *b = &now->b;
    const int place = now->which[j];
    if (place == DF_NUMBER_OFFSET)
        return 1.0;
    if (is_elastic(q)) {
        const double k = b->beyond != 0.0 ? q->numbers[DF_NUMBER_STIFFNESS] : 0.0;
        double own = q->numbers[DF_NUMBER_RUBBER] * now->bend_by[j];
        if (place == DF_NUMBER_STIFFNESS)
            own += b->beyond;
        else if (place == DF_NUMBER_PLAY)
            own -= 0.5 * copysign(k, b->beyond);
        else if (place == DF_NUMBER_RUBBER)
            own += b->bend;
        return own - k * now->S[j][DF_PISTON];
    }
    if (place == DF_NUMBER_DRAG)
        return now->v;
    if (place == DF_NUMBER_TURNING)
        return rubbing(q, now->v, b->P[0]) * by_turning;
    if (!df_moves_the_state(q, place)) {
        const double own = friction * df_rubbing_by(q, now->v, b->P[0], place);
        return now->grip_by[j] == 0.0 ? own : own + rubbing(q, now->v, b->P[0]) * now->grip_by[j];
    }
    double P[3] = {0.0, 0.0, 0.0};
    if (moves_pressures(place))
        df_pressures_by(q, b, s, place, P);
    P[0] += b->own[0] * now->S[j][0];
    P[1] += q->has_floating_piston ? b->gas * now->S[j][0] : b->own[1] * now->S[j][1];
    return oil_force(q, P) + q->numbers[DF_NUMBER_PRESSED] * friction * P[0];
}

double df_force_network(const df_network *q, const df_options *o, const df_network_state *now, double *slopes)
{
    const df_network_balance *b = &now->b;
    const int presliding = q->numbers[DF_NUMBER_PRESLIDING] > 0.0;
    const double friction = presliding ? now->grip : df_friction_share(now->v, turning_band(q, o->dead_band));
    const double by_turning = grip_by_turning(q, now->v, o->dead_band);
    const double piston = is_elastic(q) ? now->y[DF_PISTON] : now->x;
    const double shift = q->has_floating_piston ? q->plan.swept[1] * piston : now->y[1] - q->plan.oil[1];
    const double s = now->y[0] - q->plan.oil[0] + shift;
    for (int j = 0; j < now->n_which; j++)
        slopes[j] = slope_of_force(q, now, j, s, friction, by_turning);
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

/* To sample i, from jump to jump of its speed: the first that is not passed is *k. */
static int advance_to_sample(const df_network *q, const df_options *o, const df_motion *m, size_t i, size_t *k,
                             df_network_state *now, df_work *work)
{
    double from = (double)i - 1.0;
    for (; *k < m->n_jumps && m->jumps[*k].at <= (double)i; ++*k) {
        const df_jump *c = &m->jumps[*k];
        if (!(c->at > from && isfinite(c->after)))
            return DF_BAD_ARGUMENT;
        const int code = df_advance_network(q, o, c->x, c->before, (c->at - from) * m->interval, now, work);
        if (code != DF_OK)
            return code;
        now->v = c->after;
        from = c->at;
    }
    if (from == (double)i)
        return DF_OK;
    return df_advance_network(q, o, m->x[i], m->v[i], ((double)i - from) * m->interval, now, work);
}

int df_simulate_network(df_network *q, const df_options *o, const df_motion *motion,
                        const df_result *r, df_work *work)
{
    df_network_state now;
    size_t jump = 0;
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
        code = advance_to_sample(q, o, motion, i, &jump, &now, work);
        if (code != DF_OK)
            return code;
        write_sample(q, o, &now, r, i, motion->n);
    }
    work->failed_sample = motion->n;
    return DF_OK;
}
