/* The equations behind the doors: rates, event indicators and slopes where an instance stands. */
#include "exported.h"

#include <math.h>

#define BAR 1e5

static const double NOMINALS[EX_SLOTS] = {1e-4, 1e-4, 1.0, 1.0};

static void valves_into(ex_point *p)
{
    for (int i = 0; i < 3; i++)
        p->pressures[i] = p->valves.b.P[i];
    for (int i = 0; i < 2; i++) {
        p->rates[i] = p->valves.rates[i];
        p->free[i] = p->valves.free[i];
    }
    p->rates[EX_GRIPS] = p->valves.rates[2];
    p->force = p->valves.force;
}

int ex_evaluate(ex_instance *e, ex_point *p)
{
    int code = ex_refresh(e, NULL);
    if (code != DF_OK)
        return code;
    const ex_state *s = &e->s;
    p->rates[EX_GRIPS] = 0.0;
    if (e->kind == EX_MODEL_EXCHANGE) {
        p->x = ex_place_now(e);
        p->v = s->v;
    } else {
        p->x = ex_place_of_piston(e);
        p->v = s->network.plan.is_elastic ? s->valves.b.speed : s->valves.v;
    }
    double oil[2], pushed[2];
    ex_swept(e, p->x, oil);
    ex_swept(e, p->v, pushed);
    for (int i = 0; i < 2; i++)
        oil[i] = s->y[i] - oil[i];
    code = df_evaluate_network(&s->network, s->friction_band, oil, s->y[EX_GRIPS], p->x, p->v, &p->valves);
    if (code == DF_OK)
        valves_into(p);
    for (int i = 0; i < 2 && code == DF_OK; i++)
        p->rates[i] += pushed[i];
    p->rates[EX_OUTSIDE] = ex_beyond(e, p->x, p->v) > 0.0;
    return code;
}

int ex_get_states(ex_instance *e, double *y, size_t n)
{
    if (n != (size_t)e->damper.n_states)
        return EX_NO_VARIABLE;
    const int code = ex_refresh(e, NULL);
    for (size_t i = 0; i < n; i++)
        y[i] = e->s.y[e->damper.slots[i]];
    return code;
}

int ex_set_states(ex_instance *e, const double *y, size_t n)
{
    if (n != (size_t)e->damper.n_states)
        return EX_NO_VARIABLE;
    for (size_t i = 0; i < n; i++) {
        if (!isfinite(y[i]))
            return DF_NOT_FINITE;
        e->s.y[e->damper.slots[i]] = y[i];
    }
    return DF_OK;
}

int ex_get_rates(ex_instance *e, double *rates, size_t n)
{
    ex_point p;
    if (n != (size_t)e->damper.n_states)
        return EX_NO_VARIABLE;
    const int code = ex_evaluate(e, &p);
    for (size_t i = 0; i < n && code == DF_OK; i++)
        rates[i] = p.rates[e->damper.slots[i]];
    return code;
}

int ex_get_nominals(const ex_instance *e, double *nominals, size_t n)
{
    if (n != (size_t)e->damper.n_states)
        return EX_NO_VARIABLE;
    for (size_t i = 0; i < n; i++)
        nominals[i] = NOMINALS[e->damper.slots[i]];
    return DF_OK;
}

/* Where friction leaves its band, or turns where it pre-slides; where a chamber empties; where the
 * tested range ends. */
int ex_get_indicators(ex_instance *e, double *z, size_t n)
{
    ex_point p;
    if (n != EX_N_INDICATORS)
        return EX_NO_VARIABLE;
    const int code = ex_evaluate(e, &p);
    const int turns = e->s.network.numbers[DF_NUMBER_PRESLIDING] > 0.0;
    if (code != DF_OK)
        return code;
    z[0] = turns ? p.v / p.valves.band : fabs(p.v) / p.valves.band - 1.0;
    z[1] = p.free[0] / BAR;
    z[2] = p.free[1] / BAR;
    z[3] = ex_beyond(e, p.x, p.v);
    return DF_OK;
}

/* What a known moves. */
typedef struct {
    double rates[EX_SLOTS], pressures[3], force;
} moved;

/* How far the piston goes with the velocity where an importer holds its inputs. */
static double lead(const ex_instance *e)
{
    return e->kind == EX_MODEL_EXCHANGE && e->s.extrapolation > 0 ? e->s.time - e->s.t_inputs : 0.0;
}

static void add(const ex_instance *e, const ex_point *p, int known, double times, moved *d)
{
    df_network_slopes s;
    df_network_by(&e->s.network, &p->valves, known, &s);
    d->rates[EX_OIL_1] += times * s.rates[0];
    d->rates[EX_OIL_2] += times * s.rates[1];
    d->rates[EX_GRIPS] += times * s.rates[2];
    for (int i = 0; i < 3; i++)
        d->pressures[i] += times * s.pressures[i];
    d->force += times * s.force;
}

static void add_piston(const ex_instance *e, const ex_point *p, double x, moved *d)
{
    double swept[2];
    ex_swept(e, x, swept);
    add(e, p, DF_BY_PLACE, x, d);
    add(e, p, DF_BY_OIL_1, -swept[0], d);
    add(e, p, DF_BY_OIL_2, -swept[1], d);
}

static int slopes_by(const ex_instance *e, const ex_point *p, unsigned known, moved *d)
{
    const df_network_state *now = &e->s.valves;
    const int k = ex_number_of(e, known);
    if (k >= 0) {
        add(e, p, DF_BY_NUMBER + e->damper.places[k], 1.0, d);
        if (e->kind == EX_MODEL_EXCHANGE)
            return DF_OK;
        if (now->n_which == 0)
            return EX_NOT_CARRIED;
        add(e, p, DF_BY_OIL_1, now->S[k][DF_M1], d); /* all are asked for, in their order */
        add(e, p, DF_BY_OIL_2, now->S[k][DF_M2], d);
        add(e, p, DF_BY_GRIP, now->grip_by[k], d);
        return DF_OK;
    }
    switch (known) {
    case EX_STATE_1: add(e, p, DF_BY_OIL_1, 1.0, d); break;
    case EX_STATE_2: add(e, p, DF_BY_OIL_2, 1.0, d); break;
    case EX_GRIP: add(e, p, DF_BY_GRIP, 1.0, d); break;
    case EX_DISPLACEMENT: add_piston(e, p, 1.0, d); break;
    case EX_FRICTION_BAND: add(e, p, DF_BY_BAND, 1.0, d); break;
    case EX_VELOCITY:
        add(e, p, DF_BY_SPEED, 1.0, d);
        add_piston(e, p, lead(e), d);
        break;
    default: break;
    }
    return DF_OK;
}

int ex_slope(ex_instance *e, unsigned unknown, unsigned known, double *slope)
{
    moved d = {{0.0}, {0.0}, 0.0};
    ex_point p;
    *slope = 0.0;
    int code = e->s.with_rig ? EX_NOT_WITH_RIG : ex_evaluate(e, &p);
    if (code == DF_OK)
        code = slopes_by(e, &p, known, &d);
    if (known == EX_VELOCITY) {
        double pushed[2];
        ex_swept(e, 1.0, pushed);
        d.rates[EX_OIL_1] += pushed[0];
        d.rates[EX_OIL_2] += pushed[1];
    }
    if (code != DF_OK)
        return code;
    if (unknown == EX_FORCE)
        *slope = d.force;
    else if (unknown >= EX_PRESSURE_1 && unknown <= EX_PRESSURE_3)
        *slope = d.pressures[unknown - EX_PRESSURE_1];
    else if (unknown == EX_RATE_1 || unknown == EX_RATE_2)
        *slope = d.rates[unknown - EX_RATE_1];
    else if (unknown == EX_GRIP_RATE)
        *slope = d.rates[EX_GRIPS];
    else if (unknown == EX_SECONDS_OUTSIDE)
        *slope = known == EX_STATE_3;
    return DF_OK;
}
