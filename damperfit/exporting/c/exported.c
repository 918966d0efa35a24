#include "exported.h"
#include "reading.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define RANGE_MARGIN 1.01 /* a test's own peaks scatter by less */

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
    free(e->damper.rig);
    e->damper.settings = NULL;
    e->damper.table = e->damper.rig = NULL;
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

df_options ex_options(const ex_instance *e)
{
    df_options o = e->damper.options;
    o.dead_band = e->s.friction_band;
    return o;
}

void ex_swept(const ex_instance *e, double x, double oil[2])
{
    const df_network *q = &e->damper.network;
    oil[0] = q->rho_0 * q->a_1 * x;
    oil[1] = q->has_floating_piston ? 0.0 : -q->rho_0 * q->a_2 * x; /* it has no such state */
}

static void take_states(ex_instance *e)
{
    ex_state *s = &e->s;
    double swept[2];
    ex_swept(e, ex_place_of_piston(e), swept);
    s->y[EX_OIL_1] = s->valves.y[DF_M1] - s->network.rho_0 * s->network.V_1 + swept[0];
    s->y[EX_OIL_2] = s->valves.y[DF_M2] - s->network.rho_0 * s->network.V_2 + swept[1];
    s->y[EX_GRIPS] = s->valves.grip;
}

/* What the rig logs of the force: the mass that moves before the load cell takes its share, and the
 * channel is late by a first order, exact for a force that goes straight through the step. */
static void read_force(ex_instance *e, double acceleration, double interval)
{
    ex_state *s = &e->s;
    const double *rig = e->damper.rig + s->setting * EX_RIG;
    const double lag = s->with_rig ? rig[EX_RIG_LAG] : 0.0;
    double force = ex_output_of_valves(e, EX_FORCE);
    if (s->with_rig)
        force += rig[EX_RIG_MASS] * acceleration;
    if (interval > 0.0 && lag > 1e-3 * interval) {
        const double q = interval / lag, a = exp(-q), mean = -expm1(-q) / q;
        s->read = a * s->read + (1.0 - mean) * force + (mean - a) * s->force_before;
    } else {
        s->read = force;
    }
    s->force_before = force;
}

int ex_begin(ex_instance *e)
{
    const int code = ex_begin_valves(e);
    if (code == DF_OK) {
        take_states(e);
        read_force(e, 0.0, 0.0);
    }
    e->s.is_stale = 0;
    e->s.t_inputs = e->s.time;
    e->s.inputs_are_new = 0;
    return code;
}

int ex_start(ex_instance *e)
{
    const int code = ex_begin(e);
    e->s.has_begun = code == DF_OK;
    return code;
}

double ex_place_now(ex_instance *e)
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
    if (states_moved)
        *states_moved = 0;
    if (!e->s.has_begun)
        return ex_begin(e);
    if (!e->s.is_stale)
        return DF_OK;
    const int code = ex_refresh_valves(e, ex_place_now(e));
    if (code == DF_OK) {
        take_states(e);
        e->s.is_stale = 0;
        if (states_moved)
            *states_moved = 1;
    }
    return code;
}

int ex_has_grip(const ex_damper *d)
{
    for (int i = 0; d->is_network && i < d->n_settings; i++)
        if (d->table[i * d->n_numbers + DF_NUMBER_PRESLIDING] > 0.0)
            return 1;
    return 0;
}

int ex_number_of(const ex_instance *e, unsigned reference)
{
    const unsigned n = (unsigned)e->damper.n_numbers;
    return reference >= EX_NUMBERS && reference < EX_NUMBERS + n ? (int)(reference - EX_NUMBERS) : -1;
}

int ex_is_integer(unsigned reference)
{
    return reference == EX_SETTING || reference == EX_EXTRAPOLATION || reference == EX_CARRIES ||
           reference == EX_WITH_RIG;
}

/* How far beyond the tested range, as a share of it; negative within, -1 where it is not known. */
double ex_beyond(const ex_instance *e, double x, double v)
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
    *value = reference == EX_FORCE && e->s.with_rig ? e->s.read : ex_output_of_valves(e, reference);
    return code;
}

/* What the equations say where the instance stands. */
static int get_calculated(ex_instance *e, unsigned reference, double *value)
{
    double z[EX_N_INDICATORS] = {0.0}; /* left so where the equations fail */
    ex_point p;
    if (e->kind == EX_CO_SIMULATION && reference >= EX_FORCE && reference <= EX_PRESSURE_3)
        return output_of_run(e, reference, value);
    if (reference >= EX_INDICATOR_1 && reference <= EX_INDICATOR_4) {
        const int code = ex_get_indicators(e, z, EX_N_INDICATORS);
        *value = z[reference - EX_INDICATOR_1];
        return code;
    }
    const int code = ex_evaluate(e, &p);
    if (code != DF_OK)
        return code;
    if (reference == EX_FORCE)
        *value = p.force;
    else if (reference >= EX_PRESSURE_1 && reference <= EX_PRESSURE_3)
        *value = p.pressures[reference - EX_PRESSURE_1];
    else if (reference == EX_STATE_1 || reference == EX_STATE_2)
        *value = e->s.y[reference - EX_STATE_1];
    else if (reference == EX_GRIP)
        *value = e->s.y[EX_GRIPS];
    else if (reference == EX_GRIP_RATE)
        *value = p.rates[EX_GRIPS];
    else
        *value = p.rates[reference - EX_RATE_1];
    return DF_OK;
}

int ex_get(ex_instance *e, unsigned reference, double *value)
{
    const int k = ex_number_of(e, reference);
    *value = 0.0;
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
    case EX_SECONDS_OUTSIDE: *value = e->s.y[EX_OUTSIDE]; return DF_OK;
    default: break;
    }
    if (reference > EX_GRIP_RATE || ex_is_integer(reference))
        return EX_NO_VARIABLE;
    return get_calculated(e, reference, value);
}

int ex_set(ex_instance *e, unsigned reference, double value)
{
    ex_state *s = &e->s;
    const int k = ex_number_of(e, reference);
    if (!isfinite(value))
        return DF_NOT_FINITE;
    if (k >= 0) {
        const int is_offset = e->damper.places[k] == DF_NUMBER_OFFSET;
        if (value < 0.0 && !is_offset)
            return EX_OUT_OF_RANGE;
        if (value == 0.0 && !is_offset && e->damper.places[k] != DF_NUMBER_FRICTION && !e->damper.is_network)
            return EX_OUT_OF_RANGE;
        if (value > 0.0 && e->damper.is_network && k == DF_NUMBER_PRESLIDING && !ex_has_grip(&e->damper))
            return EX_NOT_SETTABLE; /* it would need a state */
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
    case EX_GRIP: s->y[EX_GRIPS] = value; return DF_OK;
    default: return reference <= EX_GRIP_RATE ? EX_NOT_SETTABLE : EX_NO_VARIABLE;
    }
    s->inputs_are_new = 1;
    return DF_OK;
}

int ex_get_integer(const ex_instance *e, unsigned reference, int *value)
{
    if (!ex_is_integer(reference))
        return EX_NO_VARIABLE;
    if (reference == EX_CARRIES || reference == EX_WITH_RIG)
        *value = reference == EX_CARRIES ? e->s.carries : e->s.with_rig;
    else
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
    if (reference == EX_CARRIES || reference == EX_WITH_RIG) {
        int *const choice = reference == EX_CARRIES ? &e->s.carries : &e->s.with_rig;
        if (value < 0 || value > 1)
            return EX_OUT_OF_RANGE;
        if (e->s.has_begun && value != *choice)
            return EX_NOT_SETTABLE;
        if (value && reference == EX_WITH_RIG && e->kind == EX_MODEL_EXCHANGE)
            return EX_NOT_WITH_RIG;
        *choice = value;
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

/* Inputs are of the beginning of the step, and what they will be at its end is guessed from the
 * velocity (1) and its slope since the step before (2), or they are of its end (0). */
int ex_step(ex_instance *e, double time, double interval)
{
    ex_state *s = &e->s;
    double x = s->x, v = s->v;
    const int code = ex_refresh(e, NULL);
    const double v_start = s->extrapolation > 0 ? s->v : s->valves.v;
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
    const int ended = ex_step_valves(e, interval, x, v, is_of_beginning);
    if (ended != DF_OK)
        return ended;
    take_states(e);
    read_force(e, (v - v_start) / interval, interval);
    s->y[EX_OUTSIDE] += ex_beyond(e, x, v) > 0.0 ? interval : 0.0;
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
