#include "exported.h"
#include "reading.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define RANGE_MARGIN 1.01 /* a test's own peaks scatter by less */
#define BAR 1e5

const double EX_NOMINALS[EX_N_STATES] = {1e-3, 1e-3, 1.0};

static const int ALL[DF_N_PARAMETERS] = {DF_R_M1, DF_R_M2, DF_R_M3, DF_K_E, DF_F_F, DF_F_0, DF_P_0, DF_GAMMA};

int ex_open(ex_instance *e, ex_kind kind, const char *folder, const char *token, char *why)
{
    memset(e, 0, sizeof *e);
    e->kind = kind;
    char *text = damperfit_data[0] ? NULL : ex_read_text(folder);
    if (!text && !damperfit_data[0]) {
        snprintf(why, EX_WHY, "no damper.txt in the resources folder %.120s", folder ? folder : "(none)");
        return 0;
    }
    const int is_good = ex_parse(text ? text : damperfit_data, &e->damper, why);
    free(text);
    if (is_good && (!token || strcmp(token, e->damper.token) != 0)) {
        snprintf(why, EX_WHY, "the token %.80s is not that of the parameters, %.80s", token ? token : "(none)",
                 e->damper.token);
        return 0;
    }
    if (is_good && e->damper.is_network && kind == EX_MODEL_EXCHANGE) {
        snprintf(why, EX_WHY, "a damper of valves is offered for co-simulation only");
        return 0;
    }
    if (is_good && !ex_reset(e)) {
        snprintf(why, EX_WHY, "the parameters in damper.txt are of no damper");
        return 0;
    }
    return is_good;
}

void ex_close(ex_instance *e)
{
    free(e->damper.settings);
    free(e->damper.table);
    e->damper.settings = NULL;
    e->damper.table = NULL;
}

int ex_reset(ex_instance *e)
{
    memset(&e->s, 0, sizeof e->s);
    e->s.setting = e->damper.start;
    e->s.friction_band = e->damper.friction_band;
    e->s.extrapolation = 2;
    return ex_begin(e) == DF_OK;
}

double ex_number(const ex_instance *e, int k)
{
    return e->s.is_own[k] ? e->s.own[k] : e->damper.table[e->s.setting * e->damper.n_numbers + k];
}

static df_parameters parameters_of(const ex_instance *e)
{
    const df_parameters p = {ex_number(e, 0), ex_number(e, 1), ex_number(e, 2), ex_number(e, 3),
                             ex_number(e, 4), ex_number(e, 5), ex_number(e, 6), ex_number(e, 7)};
    return p;
}

static void take_states(ex_instance *e)
{
    e->s.y[0] = e->s.run.m.m1 - e->s.run.q.m_10;
    e->s.y[1] = e->s.run.m.m2 - e->s.run.q.m_20;
}

int ex_begin(ex_instance *e)
{
    if (e->damper.is_network) {
        e->s.is_stale = 0;
        return ex_begin_valves(e);
    }
    const df_parameters p = parameters_of(e);
    df_options o = e->damper.options;
    o.dead_band = e->s.friction_band;
    const int code = df_begin(&e->damper.geometry, &p, &o, ALL, DF_N_PARAMETERS, e->s.x, e->s.v, &e->s.run);
    if (code == DF_OK)
        take_states(e);
    e->s.is_stale = 0;
    e->s.t_inputs = e->s.time;
    e->s.inputs_are_new = 0;
    return code;
}

/* Model exchange: where the piston is now, if the inputs were set some time ago. */
static double place_now(ex_instance *e)
{
    ex_state *s = &e->s;
    if (s->inputs_are_new) {
        s->t_inputs = s->time;
        s->inputs_are_new = 0;
    }
    return s->extrapolation > 0 ? s->x + s->v * (s->time - s->t_inputs) : s->x;
}

int ex_refresh(ex_instance *e, int *states_moved)
{
    int code = DF_OK;
    if (states_moved)
        *states_moved = 0;
    if (!e->s.has_begun)
        return ex_begin(e);
    if (!e->s.is_stale)
        return DF_OK;
    if (e->damper.is_network) {
        code = ex_retune_valves(e);
        e->s.is_stale = code != DF_OK;
        return code;
    }
    const df_parameters p = parameters_of(e);
    if (e->kind == EX_MODEL_EXCHANGE)
        code = df_place(&e->s.run, e->s.y[0], e->s.y[1], place_now(e), e->s.v);
    if (code == DF_OK)
        code = df_retune(&e->s.run, &p, e->s.friction_band);
    if (code == DF_OK) {
        take_states(e);
        e->s.is_stale = 0;
        if (states_moved)
            *states_moved = 1;
    }
    return code;
}

int ex_number_of(const ex_instance *e, unsigned reference)
{
    const unsigned n = (unsigned)e->damper.n_numbers;
    return reference >= EX_NUMBERS && reference < EX_NUMBERS + n ? (int)(reference - EX_NUMBERS) : -1;
}

int ex_is_integer(unsigned reference)
{
    return reference == EX_SETTING || reference == EX_EXTRAPOLATION;
}

/* The balances where the instance stands. */
static int evaluate_here(ex_instance *e, df_rates *r)
{
    if (e->damper.is_network)
        return EX_NO_VARIABLE;
    const int code = ex_refresh(e, NULL);
    if (code != DF_OK)
        return code;
    const double x = e->kind == EX_MODEL_EXCHANGE ? place_now(e) : e->s.run.x;
    return df_evaluate(&e->s.run, e->s.y[0], e->s.y[1], x, r);
}

static double speed_here(const ex_instance *e)
{
    return e->kind == EX_MODEL_EXCHANGE ? e->s.v : e->s.run.v;
}

static double force_of(const ex_instance *e, const df_rates *r)
{
    const df_problem *q = &e->s.run.q;
    const double friction = df_friction_share(speed_here(e), q->o.dead_band);
    return r->pressures[0] * q->g.a_p1 - r->pressures[1] * q->g.a_p2 + q->p.f_f * friction + q->p.f_0;
}

/* How far beyond the tested range, as a share of it; negative within, -1 where it is not known. */
static double beyond(const ex_instance *e, double x, double v)
{
    const double stroke = e->damper.stroke, speed = e->damper.speed;
    const double by_x = stroke > 0.0 ? fabs(x) / (RANGE_MARGIN * stroke) : 0.0;
    const double by_v = speed > 0.0 ? fabs(v) / (RANGE_MARGIN * speed) : 0.0;
    return fmax(by_x, by_v) - 1.0;
}

/* In co-simulation what the last step ended with, to the last bit that of the core. */
static int output_of_run(ex_instance *e, unsigned reference, double *value)
{
    const int code = ex_refresh(e, NULL);
    if (e->damper.is_network) {
        *value = ex_output_of_valves(e, reference);
        return code;
    }
    const df_run *run = &e->s.run;
    const double P[3] = {run->b.P1, run->b.P2, run->b.P3};
    double slopes[DF_N_PARAMETERS];
    *value = reference == EX_FORCE ? df_force(run, slopes) : P[reference - EX_PRESSURE_1];
    return code;
}

int ex_get(ex_instance *e, unsigned reference, double *value)
{
    const int k = ex_number_of(e, reference);
    df_rates r;
    if (k >= 0) {
        *value = ex_number(e, k);
        return DF_OK;
    }
    switch (reference) {
    case EX_TIME: *value = e->s.time; return DF_OK;
    case EX_DISPLACEMENT: *value = e->s.x; return DF_OK;
    case EX_VELOCITY: *value = e->s.v; return DF_OK;
    case EX_FRICTION_BAND: *value = e->s.friction_band; return DF_OK;
    case EX_STATE_3:
    case EX_SECONDS_OUTSIDE: *value = e->s.y[2]; return DF_OK;
    default: break;
    }
    if (reference > EX_INDICATOR_4)
        return EX_NO_VARIABLE;
    if (e->kind == EX_CO_SIMULATION && reference >= EX_FORCE && reference <= EX_PRESSURE_3)
        return output_of_run(e, reference, value);
    const int code = evaluate_here(e, &r);
    if (code != DF_OK)
        return code;
    if (reference == EX_FORCE) {
        *value = force_of(e, &r);
    } else if (reference >= EX_PRESSURE_1 && reference <= EX_PRESSURE_3) {
        *value = r.pressures[reference - EX_PRESSURE_1];
    } else if (reference == EX_STATE_1 || reference == EX_STATE_2) {
        *value = e->s.y[reference - EX_STATE_1];
    } else if (reference >= EX_RATE_1 && reference <= EX_RATE_3) {
        double rates[EX_N_STATES];
        const int ended = ex_get_rates(e, rates);
        *value = rates[reference - EX_RATE_1];
        return ended;
    } else if (reference >= EX_INDICATOR_1) {
        double z[EX_N_INDICATORS];
        const int ended = ex_get_indicators(e, z);
        *value = z[reference - EX_INDICATOR_1];
        return ended;
    } else {
        return EX_NO_VARIABLE;
    }
    return DF_OK;
}

int ex_set(ex_instance *e, unsigned reference, double value)
{
    ex_state *s = &e->s;
    const int k = ex_number_of(e, reference);
    if (!isfinite(value))
        return DF_NOT_FINITE;
    if (k >= 0) {
        const int is_offset = k == (e->damper.is_network ? (int)DF_NUMBER_OFFSET : (int)DF_F_0);
        if (value < 0.0 && !is_offset)
            return EX_OUT_OF_RANGE;
        if (value == 0.0 && !is_offset && k != DF_F_F && !e->damper.is_network)
            return EX_OUT_OF_RANGE;
        /* Importers set every parameter to its start value: that is no wish of its own. */
        s->is_own[k] = value != e->damper.table[e->damper.start * e->damper.n_numbers + k];
        s->own[k] = value;
        s->is_stale = 1;
        return DF_OK;
    }
    switch (reference) {
    case EX_TIME: s->time = value; return DF_OK;
    case EX_DISPLACEMENT: s->x = value; break;
    case EX_VELOCITY: s->v = value; break;
    case EX_FRICTION_BAND:
        if (!(value > 0.0))
            return EX_OUT_OF_RANGE;
        s->friction_band = value;
        s->is_stale = 1;
        return DF_OK;
    case EX_STATE_1:
    case EX_STATE_2:
    case EX_STATE_3: s->y[reference - EX_STATE_1] = value; return DF_OK;
    default: return reference <= EX_INDICATOR_4 ? EX_NOT_SETTABLE : EX_NO_VARIABLE;
    }
    s->inputs_are_new = 1;
    return DF_OK;
}

int ex_get_integer(const ex_instance *e, unsigned reference, int *value)
{
    if (!ex_is_integer(reference))
        return EX_NO_VARIABLE;
    *value = reference == EX_SETTING ? e->damper.settings[e->s.setting] : e->s.extrapolation;
    return DF_OK;
}

int ex_set_integer(ex_instance *e, unsigned reference, int value)
{
    if (reference == EX_EXTRAPOLATION) {
        if (value < 0 || value > 2)
            return EX_OUT_OF_RANGE;
        e->s.extrapolation = value;
        return DF_OK;
    }
    if (reference != EX_SETTING)
        return EX_NO_VARIABLE;
    for (int i = 0; i < e->damper.n_settings; i++) {
        if (e->damper.settings[i] == value) {
            e->s.is_stale = e->s.is_stale || i != e->s.setting;
            e->s.setting = i;
            return DF_OK;
        }
    }
    return EX_NO_SETTING;
}

static int step_paper(ex_instance *e, double interval, double x, double v, int is_of_beginning)
{
    const df_run before = e->s.run;
    df_work work = {0, 0, 0, 0};
    if (is_of_beginning)
        e->s.run.v = e->s.v;
    const int code = df_advance(&e->s.run, interval, x, v, &work);
    if (code != DF_OK)
        e->s.run = before;
    else
        take_states(e);
    return code;
}

/* Inputs are of the beginning of the step, and what they will be at its end is guessed from the
 * velocity (1) and its slope since the step before (2), or they are of its end (0). */
int ex_step(ex_instance *e, double time, double interval)
{
    ex_state *s = &e->s;
    double x = s->x, v = s->v;
    const int code = ex_refresh(e, NULL);
    if (code != DF_OK)
        return code;
    const int is_of_beginning = s->extrapolation > 0;
    if (is_of_beginning) {
        double slope = 0.0;
        if (s->extrapolation > 1 && s->has_before && time > s->t_before)
            slope = (s->v - s->v_before) / (time - s->t_before);
        x += interval * (s->v + 0.5 * interval * slope);
        v += interval * slope;
    }
    const int ended = e->damper.is_network ? ex_step_valves(e, interval, x, v, is_of_beginning)
                                           : step_paper(e, interval, x, v, is_of_beginning);
    if (ended != DF_OK)
        return ended;
    s->y[2] += beyond(e, x, v) > 0.0 ? interval : 0.0;
    s->v_before = s->v;
    s->t_before = time;
    s->has_before = 1;
    s->time = time + interval;
    return DF_OK;
}

void ex_set_time(ex_instance *e, double time)
{
    e->s.time = time;
}

int ex_get_states(ex_instance *e, double *y)
{
    const int code = ex_refresh(e, NULL);
    for (int i = 0; i < EX_N_STATES; i++)
        y[i] = e->s.y[i];
    return code;
}

int ex_set_states(ex_instance *e, const double *y)
{
    for (int i = 0; i < EX_N_STATES; i++) {
        if (!isfinite(y[i]))
            return DF_NOT_FINITE;
        e->s.y[i] = y[i];
    }
    return DF_OK;
}

int ex_get_rates(ex_instance *e, double *rates)
{
    df_rates r;
    const int code = evaluate_here(e, &r);
    if (code != DF_OK)
        return code;
    rates[0] = r.rates[0];
    rates[1] = r.rates[1];
    rates[2] = beyond(e, e->kind == EX_MODEL_EXCHANGE ? place_now(e) : e->s.run.x, speed_here(e)) > 0.0;
    return DF_OK;
}

/* Where friction leaves its band, where a chamber empties, where the tested range ends. */
int ex_get_indicators(ex_instance *e, double *z)
{
    df_rates r;
    const int code = evaluate_here(e, &r);
    if (code != DF_OK)
        return code;
    z[0] = fabs(speed_here(e)) / e->s.friction_band - 1.0;
    z[1] = r.free[0] / BAR;
    z[2] = r.free[1] / BAR;
    z[3] = beyond(e, e->kind == EX_MODEL_EXCHANGE ? place_now(e) : e->s.run.x, speed_here(e));
    return DF_OK;
}

/* What a known moves: both rates and the three pressures. */
typedef struct {
    double rates[2], pressures[3];
} moved;

static void move_masses(const df_rates *r, double m1, double m2, moved *d)
{
    for (int i = 0; i < 2; i++)
        d->rates[i] += r->by_mass[i][0] * m1 + r->by_mass[i][1] * m2;
    for (int i = 0; i < 3; i++)
        d->pressures[i] += r->pressures_by_mass[i][0] * m1 + r->pressures_by_mass[i][1] * m2;
}

static void move_piston(const df_rates *r, double x, moved *d)
{
    for (int i = 0; i < 2; i++)
        d->rates[i] += r->by_x[i] * x;
    for (int i = 0; i < 3; i++)
        d->pressures[i] += r->pressures_by_x[i] * x;
}

/* In co-simulation the masses have followed the parameter since the beginning. */
static void move_parameter(const ex_instance *e, const df_rates *r, int k, moved *d)
{
    for (int i = 0; i < 2; i++)
        d->rates[i] = r->by_parameter[k][i];
    for (int i = 0; i < 3; i++)
        d->pressures[i] = r->pressures_by_parameter[k][i];
    if (e->kind == EX_MODEL_EXCHANGE)
        return;
    const df_problem *q = &e->s.run.q;
    for (int j = 0; j < q->n_active; j++)
        if (q->active[j] == k)
            move_masses(r, e->s.run.S[j].m1, e->s.run.S[j].m2, d);
}

static double friction_slope(const ex_instance *e, unsigned known)
{
    const df_problem *q = &e->s.run.q;
    const double v = speed_here(e), band = q->o.dead_band;
    const int slides = fabs(v) >= band;
    if (known == EX_VELOCITY)
        return slides ? 0.0 : q->p.f_f / band;
    if (known == EX_FRICTION_BAND)
        return slides ? 0.0 : -q->p.f_f * v / (band * band);
    if (known == EX_NUMBERS + DF_F_F)
        return df_friction_share(v, band);
    return known == EX_NUMBERS + DF_F_0 ? 1.0 : 0.0;
}

int ex_slope(ex_instance *e, unsigned unknown, unsigned known, double *slope)
{
    moved d = {{0.0, 0.0}, {0.0, 0.0, 0.0}};
    df_rates r;
    *slope = 0.0;
    const int code = evaluate_here(e, &r);
    if (code != DF_OK)
        return code;
    const int k = ex_number_of(e, known);
    if (k >= 0)
        move_parameter(e, &r, k, &d);
    else if (known == EX_STATE_1 || known == EX_STATE_2)
        move_masses(&r, known == EX_STATE_1, known == EX_STATE_2, &d);
    else if (known == EX_DISPLACEMENT)
        move_piston(&r, 1.0, &d);
    else if (known == EX_VELOCITY && e->kind == EX_MODEL_EXCHANGE && e->s.extrapolation > 0)
        move_piston(&r, e->s.time - e->s.t_inputs, &d);
    if (unknown == EX_FORCE)
        *slope = d.pressures[0] * e->s.run.q.g.a_p1 - d.pressures[1] * e->s.run.q.g.a_p2 +
                 friction_slope(e, known);
    else if (unknown >= EX_PRESSURE_1 && unknown <= EX_PRESSURE_3)
        *slope = d.pressures[unknown - EX_PRESSURE_1];
    else if (unknown == EX_RATE_1 || unknown == EX_RATE_2)
        *slope = d.rates[unknown - EX_RATE_1];
    else if (unknown == EX_SECONDS_OUTSIDE)
        *slope = known == EX_STATE_3;
    return DF_OK;
}
