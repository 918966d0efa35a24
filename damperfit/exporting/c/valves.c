/* The network behind the doors: any passages between its chambers, on a rigid mounting. */
#include "exported.h"

static df_network network_now(const ex_instance *e)
{
    df_network q = e->damper.network;
    for (int k = 0; k < e->damper.n_numbers; k++)
        q.numbers[e->damper.places[k]] = ex_number(e, k);
    if (e->s.with_rig) {
        const double *rig = e->damper.rig + e->s.setting * EX_RIG;
        q.numbers[DF_NUMBER_STIFFNESS] = rig[EX_RIG_STIFFNESS];
        q.numbers[DF_NUMBER_PLAY] = rig[EX_RIG_PLAY];
        q.numbers[DF_NUMBER_OFFSET] += rig[EX_RIG_OFFSET];
    }
    return q;
}

/* Slopes by the numbers are carried along where they are asked for: it takes longer. The paper's
 * always are. Model exchange has them of the equations alone. */
int ex_begin_valves(ex_instance *e)
{
    const df_options o = ex_options(e);
    const int carries = e->s.carries || !e->damper.is_network;
    e->s.network = network_now(e);
    const int n = carries && e->kind == EX_CO_SIMULATION ? e->damper.n_numbers : 0;
    return df_begin_network(&e->s.network, &o, e->s.x, e->s.v, e->damper.places, n, &e->s.valves);
}

int ex_refresh_valves(ex_instance *e, double x)
{
    df_network changed = network_now(e);
    const df_options o = ex_options(e);
    double oil[2];
    int code = DF_OK;
    ex_swept(e, x, oil);
    for (int i = 0; i < 2; i++)
        oil[i] = e->s.y[i] - oil[i];
    if (e->kind == EX_MODEL_EXCHANGE)
        code = df_place_network(&e->s.network, oil, e->s.y[EX_GRIPS], x, e->s.v, &e->s.valves);
    return code == DF_OK ? df_retune_network(&e->s.network, &changed, &o, &e->s.valves) : code;
}

int ex_step_valves(ex_instance *e, double interval, double x, double v, int is_of_beginning)
{
    const df_network_state before = e->s.valves;
    const df_options o = ex_options(e);
    df_work work = {0, 0, 0, 0};
    if (is_of_beginning)
        e->s.valves.v = e->s.v;
    const int code = df_advance_network(&e->s.network, &o, x, v, interval, &e->s.valves, &work);
    if (code != DF_OK)
        e->s.valves = before;
    return code;
}

/* An elastic mounting has it elsewhere than the rod's end. */
double ex_place_of_piston(const ex_instance *e)
{
    return e->s.network.plan.is_elastic ? e->s.valves.y[DF_PISTON] : e->s.valves.x;
}

double ex_output_of_valves(const ex_instance *e, unsigned reference)
{
    const df_options o = ex_options(e);
    double slopes[EX_MOST_NUMBERS];
    if (reference == EX_FORCE)
        return df_force_network(&e->s.network, &o, &e->s.valves, slopes);
    return e->s.valves.b.P[reference - EX_PRESSURE_1];
}
