/* A damper of valves behind the doors: any passages between its chambers, on a rigid mounting. */
#include "exported.h"

static df_network network_now(const ex_instance *e)
{
    df_network q = e->damper.network;
    for (int k = 0; k < q.n_numbers; k++)
        q.numbers[k] = ex_number(e, k);
    return q;
}

static df_options options_now(const ex_instance *e)
{
    df_options o = e->damper.options;
    o.dead_band = e->s.friction_band;
    return o;
}

int ex_begin_valves(ex_instance *e)
{
    const df_options o = options_now(e);
    e->s.network = network_now(e);
    return df_begin_network(&e->s.network, &o, e->s.x, e->s.v, NULL, 0, &e->s.valves);
}

int ex_retune_valves(ex_instance *e)
{
    const df_network changed = network_now(e);
    const df_options o = options_now(e);
    return df_retune_network(&e->s.network, &changed, &o, &e->s.valves);
}

int ex_step_valves(ex_instance *e, double interval, double x, double v, int is_of_beginning)
{
    const df_network_state before = e->s.valves;
    const df_options o = options_now(e);
    df_work work = {0, 0, 0, 0};
    if (is_of_beginning)
        e->s.valves.v = e->s.v;
    const int code = df_advance_network(&e->s.network, &o, x, v, interval, &e->s.valves, &work);
    if (code != DF_OK)
        e->s.valves = before;
    return code;
}

double ex_output_of_valves(const ex_instance *e, unsigned reference)
{
    const df_options o = options_now(e);
    double none[1];
    if (reference == EX_FORCE)
        return df_force_network(&e->s.network, &o, &e->s.valves, none);
    return e->s.valves.b.P[reference - EX_PRESSURE_1];
}
