/* FMI 3.0 for co-simulation and model exchange: what the damper does. With fmi3_absent.c it makes the
 * 75 functions of the standard. */
#include "fmi3_component.h"

#include <stdlib.h>

fmi3Status ex_fmi3_report(component *c, fmi3Status status, const char *what)
{
    if (c->log)
        c->log(c->environment, status, "logStatusError", what);
    return status;
}

fmi3Status ex_fmi3_ended(fmi3Instance c, int code)
{
    return code == DF_OK ? fmi3OK : ex_fmi3_report(c, fmi3Error, ex_sentence(code));
}

static fmi3Instance make(ex_kind kind, fmi3String token, fmi3String resources, fmi3InstanceEnvironment environment,
                         fmi3LogMessageCallback log)
{
    char why[EX_WHY];
    component *c = calloc(1, sizeof *c);
    if (!c)
        return NULL;
    c->environment = environment;
    c->log = log;
    if (!ex_open(&c->e, kind, resources, token, why)) {
        ex_fmi3_report(c, fmi3Error, why);
        ex_close(&c->e);
        free(c);
        return NULL;
    }
    return c;
}

FMI3_DOOR const char *FMI3(GetVersion)(void)
{
    return "3.0";
}

FMI3_DOOR fmi3Status FMI3(SetDebugLogging)(fmi3Instance c, fmi3Boolean on, size_t n, const fmi3String names[])
{
    (void)c, (void)on, (void)n, (void)names;
    return fmi3OK;
}

FMI3_DOOR fmi3Instance FMI3(InstantiateModelExchange)(fmi3String name, fmi3String token, fmi3String resources,
                                                      fmi3Boolean visible, fmi3Boolean logging,
                                                      fmi3InstanceEnvironment environment, fmi3LogMessageCallback log)
{
    (void)name, (void)visible, (void)logging;
    return make(EX_MODEL_EXCHANGE, token, resources, environment, log);
}

FMI3_DOOR fmi3Instance FMI3(InstantiateCoSimulation)(fmi3String name, fmi3String token, fmi3String resources,
                                                     fmi3Boolean visible, fmi3Boolean logging,
                                                     fmi3Boolean uses_events, fmi3Boolean may_return_early,
                                                     const fmi3ValueReference in_between[], size_t n_in_between,
                                                     fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                                     fmi3IntermediateUpdateCallback update)
{
    (void)name, (void)visible, (void)logging, (void)uses_events, (void)may_return_early;
    (void)in_between, (void)n_in_between, (void)update;
    return make(EX_CO_SIMULATION, token, resources, environment, log);
}

FMI3_DOOR void FMI3(FreeInstance)(fmi3Instance c)
{
    if (!c)
        return;
    ex_close(&((component *)c)->e);
    free(c);
}

FMI3_DOOR fmi3Status FMI3(EnterInitializationMode)(fmi3Instance c, fmi3Boolean has_tolerance, fmi3Float64 tolerance,
                                                   fmi3Float64 start, fmi3Boolean has_stop, fmi3Float64 stop)
{
    (void)has_tolerance, (void)tolerance, (void)has_stop, (void)stop;
    return ex_fmi3_ended(c, ex_set(&((component *)c)->e, EX_TIME, start));
}

FMI3_DOOR fmi3Status FMI3(ExitInitializationMode)(fmi3Instance c)
{
    return ex_fmi3_ended(c, ex_start(&((component *)c)->e));
}

/* What changes between modes is of no consequence here. */
#define NOTHING_TO_DO(name)                      \
    FMI3_DOOR fmi3Status FMI3(name)(fmi3Instance c) \
    {                                            \
        (void)c;                                 \
        return fmi3OK;                           \
    }

NOTHING_TO_DO(EnterEventMode)
NOTHING_TO_DO(EnterContinuousTimeMode)
NOTHING_TO_DO(EnterStepMode)
NOTHING_TO_DO(EnterConfigurationMode)
NOTHING_TO_DO(ExitConfigurationMode)
NOTHING_TO_DO(EvaluateDiscreteStates)
NOTHING_TO_DO(Terminate)

FMI3_DOOR fmi3Status FMI3(Reset)(fmi3Instance c)
{
    return ex_reset(&((component *)c)->e) ? fmi3OK : fmi3Error;
}

FMI3_DOOR fmi3Status FMI3(GetFloat64)(fmi3Instance c, const fmi3ValueReference r[], size_t n, fmi3Float64 value[],
                                      size_t n_values)
{
    (void)n_values;
    return ex_fmi3_ended(c, ex_get_all(&((component *)c)->e, r, n, value));
}

FMI3_DOOR fmi3Status FMI3(SetFloat64)(fmi3Instance c, const fmi3ValueReference r[], size_t n,
                                      const fmi3Float64 value[], size_t n_values)
{
    (void)n_values;
    return ex_fmi3_ended(c, ex_set_all(&((component *)c)->e, r, n, value));
}

FMI3_DOOR fmi3Status FMI3(GetInt32)(fmi3Instance c, const fmi3ValueReference r[], size_t n, fmi3Int32 value[],
                                    size_t n_values)
{
    (void)n_values;
    return ex_fmi3_ended(c, ex_get_integers(&((component *)c)->e, r, n, value));
}

FMI3_DOOR fmi3Status FMI3(SetInt32)(fmi3Instance c, const fmi3ValueReference r[], size_t n, const fmi3Int32 value[],
                                    size_t n_values)
{
    (void)n_values;
    return ex_fmi3_ended(c, ex_set_integers(&((component *)c)->e, r, n, value));
}

FMI3_DOOR fmi3Status FMI3(GetFMUState)(fmi3Instance c, fmi3FMUState *state)
{
    return ex_fmi3_ended(c, ex_keep(&((component *)c)->e, state));
}

FMI3_DOOR fmi3Status FMI3(SetFMUState)(fmi3Instance c, fmi3FMUState state)
{
    return ex_fmi3_ended(c, ex_return_to(&((component *)c)->e, state));
}

FMI3_DOOR fmi3Status FMI3(FreeFMUState)(fmi3Instance c, fmi3FMUState *state)
{
    (void)c;
    ex_forget(state);
    return fmi3OK;
}

FMI3_DOOR fmi3Status FMI3(SerializedFMUStateSize)(fmi3Instance c, fmi3FMUState state, size_t *size)
{
    (void)state;
    *size = ex_serialised_size(&((component *)c)->e);
    return fmi3OK;
}

FMI3_DOOR fmi3Status FMI3(SerializeFMUState)(fmi3Instance c, fmi3FMUState state, fmi3Byte bytes[], size_t size)
{
    return ex_fmi3_ended(c, ex_serialise(&((component *)c)->e, state, (char *)bytes, size));
}

FMI3_DOOR fmi3Status FMI3(DeserializeFMUState)(fmi3Instance c, const fmi3Byte bytes[], size_t size,
                                               fmi3FMUState *state)
{
    return ex_fmi3_ended(c, ex_deserialise(&((component *)c)->e, (const char *)bytes, size, state));
}

FMI3_DOOR fmi3Status FMI3(GetDirectionalDerivative)(fmi3Instance c, const fmi3ValueReference unknowns[],
                                                    size_t n_unknowns, const fmi3ValueReference knowns[],
                                                    size_t n_knowns, const fmi3Float64 seed[], size_t n_seed,
                                                    fmi3Float64 slopes[], size_t n_slopes)
{
    (void)n_seed, (void)n_slopes;
    return ex_fmi3_ended(c, ex_directional(&((component *)c)->e, unknowns, n_unknowns, knowns, n_knowns, seed, slopes));
}

FMI3_DOOR fmi3Status FMI3(GetAdjointDerivative)(fmi3Instance c, const fmi3ValueReference unknowns[],
                                                size_t n_unknowns, const fmi3ValueReference knowns[],
                                                size_t n_knowns, const fmi3Float64 seed[], size_t n_seed,
                                                fmi3Float64 slopes[], size_t n_slopes)
{
    (void)n_seed, (void)n_slopes;
    for (size_t k = 0; k < n_knowns; k++) {
        slopes[k] = 0.0;
        for (size_t i = 0; i < n_unknowns; i++) {
            double slope;
            const int code = ex_slope(&((component *)c)->e, unknowns[i], knowns[k], &slope);
            if (code != DF_OK)
                return ex_fmi3_ended(c, code);
            slopes[k] += slope * seed[i];
        }
    }
    return fmi3OK;
}

FMI3_DOOR fmi3Status FMI3(UpdateDiscreteStates)(fmi3Instance c, fmi3Boolean *again, fmi3Boolean *terminate,
                                                fmi3Boolean *nominals_changed, fmi3Boolean *states_changed,
                                                fmi3Boolean *has_next_event, fmi3Float64 *next_event)
{
    int moved;
    const int code = ex_refresh(&((component *)c)->e, &moved);
    *again = *terminate = *nominals_changed = *has_next_event = false;
    *states_changed = moved != 0;
    *next_event = 0.0;
    return ex_fmi3_ended(c, code);
}

FMI3_DOOR fmi3Status FMI3(CompletedIntegratorStep)(fmi3Instance c, fmi3Boolean no_setting_back,
                                                   fmi3Boolean *enter_event_mode, fmi3Boolean *terminate)
{
    (void)c, (void)no_setting_back;
    *enter_event_mode = *terminate = false;
    return fmi3OK;
}

FMI3_DOOR fmi3Status FMI3(SetTime)(fmi3Instance c, fmi3Float64 time)
{
    ex_set_time(&((component *)c)->e, time);
    return fmi3OK;
}

FMI3_DOOR fmi3Status FMI3(SetContinuousStates)(fmi3Instance c, const fmi3Float64 y[], size_t n)
{
    return ex_fmi3_ended(c, ex_set_states(&((component *)c)->e, y, n));
}

FMI3_DOOR fmi3Status FMI3(GetContinuousStateDerivatives)(fmi3Instance c, fmi3Float64 rates[], size_t n)
{
    return ex_fmi3_ended(c, ex_get_rates(&((component *)c)->e, rates, n));
}

FMI3_DOOR fmi3Status FMI3(GetEventIndicators)(fmi3Instance c, fmi3Float64 z[], size_t n)
{
    return ex_fmi3_ended(c, ex_get_indicators(&((component *)c)->e, z, n));
}

FMI3_DOOR fmi3Status FMI3(GetContinuousStates)(fmi3Instance c, fmi3Float64 y[], size_t n)
{
    return ex_fmi3_ended(c, ex_get_states(&((component *)c)->e, y, n));
}

FMI3_DOOR fmi3Status FMI3(GetNominalsOfContinuousStates)(fmi3Instance c, fmi3Float64 nominals[], size_t n)
{
    return ex_fmi3_ended(c, ex_get_nominals(&((component *)c)->e, nominals, n));
}

FMI3_DOOR fmi3Status FMI3(GetNumberOfEventIndicators)(fmi3Instance c, size_t *n)
{
    (void)c;
    *n = EX_N_INDICATORS;
    return fmi3OK;
}

FMI3_DOOR fmi3Status FMI3(GetNumberOfContinuousStates)(fmi3Instance c, size_t *n)
{
    *n = (size_t)((component *)c)->e.damper.n_states;
    return fmi3OK;
}

/* Importers ask for every output; one that does not tell its derivative has none that is known. */
FMI3_DOOR fmi3Status FMI3(GetOutputDerivatives)(fmi3Instance c, const fmi3ValueReference r[], size_t n,
                                                const fmi3Int32 orders[], fmi3Float64 value[], size_t n_values)
{
    (void)c, (void)r, (void)n, (void)orders;
    for (size_t i = 0; i < n_values; i++)
        value[i] = 0.0;
    return fmi3OK;
}

FMI3_DOOR fmi3Status FMI3(DoStep)(fmi3Instance c, fmi3Float64 time, fmi3Float64 interval, fmi3Boolean no_setting_back,
                                  fmi3Boolean *event_needed, fmi3Boolean *terminate, fmi3Boolean *returned_early,
                                  fmi3Float64 *reached)
{
    (void)no_setting_back;
    *event_needed = *terminate = *returned_early = false;
    *reached = time;
    if (interval != 0.0) {
        const int code = ex_step(&((component *)c)->e, time, interval);
        if (code != DF_OK)
            return ex_fmi3_report(c, fmi3Discard, ex_sentence(code));
        *reached = time + interval;
    }
    return fmi3OK;
}
