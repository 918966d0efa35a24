/* FMI 3.0 for co-simulation and model exchange: the 75 functions of the standard, also those for what
 * an exported damper has none of, which importers look for all the same. */
#include "exported.h"
#include "fmi3_declarations.h"

#include <stdlib.h>

/* Signatures are the standard's: not every argument matters here. */
#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif

typedef struct {
    ex_instance e;
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
} component;

static fmi3Status report(component *c, fmi3Status status, const char *what)
{
    if (c->log)
        c->log(c->environment, status, "logStatusError", what);
    return status;
}

static fmi3Status ended(fmi3Instance c, int code)
{
    return code == DF_OK ? fmi3OK : report(c, fmi3Error, ex_sentence(code));
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
        report(c, fmi3Error, why);
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
    return fmi3OK;
}

FMI3_DOOR fmi3Instance FMI3(InstantiateModelExchange)(fmi3String name, fmi3String token, fmi3String resources,
                                                      fmi3Boolean visible, fmi3Boolean logging,
                                                      fmi3InstanceEnvironment environment, fmi3LogMessageCallback log)
{
    return make(EX_MODEL_EXCHANGE, token, resources, environment, log);
}

FMI3_DOOR fmi3Instance FMI3(InstantiateCoSimulation)(fmi3String name, fmi3String token, fmi3String resources,
                                                     fmi3Boolean visible, fmi3Boolean logging,
                                                     fmi3Boolean uses_events, fmi3Boolean may_return_early,
                                                     const fmi3ValueReference in_between[], size_t n_in_between,
                                                     fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                                     fmi3IntermediateUpdateCallback update)
{
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
    return ended(c, ex_set(&((component *)c)->e, EX_TIME, start));
}

FMI3_DOOR fmi3Status FMI3(ExitInitializationMode)(fmi3Instance c)
{
    return ended(c, ex_start(&((component *)c)->e));
}

/* What changes between modes is of no consequence here. */
#define NOTHING_TO_DO(name)                         \
    FMI3_DOOR fmi3Status FMI3(name)(fmi3Instance c) \
    {                                               \
        return fmi3OK;                              \
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
    return ended(c, ex_get_all(&((component *)c)->e, r, n, value));
}

FMI3_DOOR fmi3Status FMI3(SetFloat64)(fmi3Instance c, const fmi3ValueReference r[], size_t n,
                                      const fmi3Float64 value[], size_t n_values)
{
    return ended(c, ex_set_all(&((component *)c)->e, r, n, value));
}

FMI3_DOOR fmi3Status FMI3(GetInt32)(fmi3Instance c, const fmi3ValueReference r[], size_t n, fmi3Int32 value[],
                                    size_t n_values)
{
    return ended(c, ex_get_integers(&((component *)c)->e, r, n, value));
}

FMI3_DOOR fmi3Status FMI3(SetInt32)(fmi3Instance c, const fmi3ValueReference r[], size_t n, const fmi3Int32 value[],
                                    size_t n_values)
{
    return ended(c, ex_set_integers(&((component *)c)->e, r, n, value));
}

FMI3_DOOR fmi3Status FMI3(GetFMUState)(fmi3Instance c, fmi3FMUState *state)
{
    return ended(c, ex_keep(&((component *)c)->e, state));
}

FMI3_DOOR fmi3Status FMI3(SetFMUState)(fmi3Instance c, fmi3FMUState state)
{
    return ended(c, ex_return_to(&((component *)c)->e, state));
}

FMI3_DOOR fmi3Status FMI3(FreeFMUState)(fmi3Instance c, fmi3FMUState *state)
{
    ex_forget(state);
    return fmi3OK;
}

FMI3_DOOR fmi3Status FMI3(SerializedFMUStateSize)(fmi3Instance c, fmi3FMUState state, size_t *size)
{
    *size = ex_serialised_size(&((component *)c)->e);
    return fmi3OK;
}

FMI3_DOOR fmi3Status FMI3(SerializeFMUState)(fmi3Instance c, fmi3FMUState state, fmi3Byte bytes[], size_t size)
{
    return ended(c, ex_serialise(&((component *)c)->e, state, (char *)bytes, size));
}

FMI3_DOOR fmi3Status FMI3(DeserializeFMUState)(fmi3Instance c, const fmi3Byte bytes[], size_t size,
                                               fmi3FMUState *state)
{
    return ended(c, ex_deserialise(&((component *)c)->e, (const char *)bytes, size, state));
}

FMI3_DOOR fmi3Status FMI3(GetDirectionalDerivative)(fmi3Instance c, const fmi3ValueReference unknowns[],
                                                    size_t n_unknowns, const fmi3ValueReference knowns[],
                                                    size_t n_knowns, const fmi3Float64 seed[], size_t n_seed,
                                                    fmi3Float64 slopes[], size_t n_slopes)
{
    return ended(c, ex_directional(&((component *)c)->e, unknowns, n_unknowns, knowns, n_knowns, seed, slopes));
}

FMI3_DOOR fmi3Status FMI3(GetAdjointDerivative)(fmi3Instance c, const fmi3ValueReference unknowns[],
                                                size_t n_unknowns, const fmi3ValueReference knowns[],
                                                size_t n_knowns, const fmi3Float64 seed[], size_t n_seed,
                                                fmi3Float64 slopes[], size_t n_slopes)
{
    for (size_t k = 0; k < n_knowns; k++) {
        slopes[k] = 0.0;
        for (size_t i = 0; i < n_unknowns; i++) {
            double slope;
            const int code = ex_slope(&((component *)c)->e, unknowns[i], knowns[k], &slope);
            if (code != DF_OK)
                return ended(c, code);
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
    return ended(c, code);
}

FMI3_DOOR fmi3Status FMI3(CompletedIntegratorStep)(fmi3Instance c, fmi3Boolean no_setting_back,
                                                   fmi3Boolean *enter_event_mode, fmi3Boolean *terminate)
{
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
    return ended(c, ex_set_states(&((component *)c)->e, y, n));
}

FMI3_DOOR fmi3Status FMI3(GetContinuousStateDerivatives)(fmi3Instance c, fmi3Float64 rates[], size_t n)
{
    return ended(c, ex_get_rates(&((component *)c)->e, rates, n));
}

FMI3_DOOR fmi3Status FMI3(GetEventIndicators)(fmi3Instance c, fmi3Float64 z[], size_t n)
{
    return ended(c, ex_get_indicators(&((component *)c)->e, z, n));
}

FMI3_DOOR fmi3Status FMI3(GetContinuousStates)(fmi3Instance c, fmi3Float64 y[], size_t n)
{
    return ended(c, ex_get_states(&((component *)c)->e, y, n));
}

FMI3_DOOR fmi3Status FMI3(GetNominalsOfContinuousStates)(fmi3Instance c, fmi3Float64 nominals[], size_t n)
{
    return ended(c, ex_get_nominals(&((component *)c)->e, nominals, n));
}

FMI3_DOOR fmi3Status FMI3(GetNumberOfEventIndicators)(fmi3Instance c, size_t *n)
{
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
    for (size_t i = 0; i < n_values; i++)
        value[i] = 0.0;
    return fmi3OK;
}

FMI3_DOOR fmi3Status FMI3(DoStep)(fmi3Instance c, fmi3Float64 time, fmi3Float64 interval, fmi3Boolean no_setting_back,
                                  fmi3Boolean *event_needed, fmi3Boolean *terminate, fmi3Boolean *returned_early,
                                  fmi3Float64 *reached)
{
    *event_needed = *terminate = *returned_early = false;
    *reached = time;
    if (interval != 0.0) {
        const int code = ex_step(&((component *)c)->e, time, interval);
        if (code != DF_OK)
            return report(c, fmi3Discard, ex_sentence(code));
        *reached = time + interval;
    }
    return fmi3OK;
}

/* What there is none of: scheduled execution, other types of variables, clocks, dependencies by element. */
FMI3_DOOR fmi3Instance FMI3(InstantiateScheduledExecution)(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible, fmi3Boolean logging,
    fmi3InstanceEnvironment environment, fmi3LogMessageCallback log, fmi3ClockUpdateCallback update,
    fmi3LockPreemptionCallback lock, fmi3UnlockPreemptionCallback unlock)
{
    if (log)
        log(environment, fmi3Error, "logStatusError", "scheduled execution is not offered: there are no clocks");
    return NULL;
}

typedef fmi3ValueReference reference;
#define NONE(name, ...)                                          \
    FMI3_DOOR fmi3Status FMI3(name)(fmi3Instance c, __VA_ARGS__) \
    {                                                            \
        return ended(c, n ? EX_NO_VARIABLE : DF_OK);             \
    }
#define NONE_OF(type)                                                                           \
    NONE(Get##type, const reference r[], size_t n, fmi3##type value[], size_t n_values)         \
    NONE(Set##type, const reference r[], size_t n, const fmi3##type value[], size_t n_values)

NONE_OF(Float32)
NONE_OF(Int8)
NONE_OF(UInt8)
NONE_OF(Int16)
NONE_OF(UInt16)
NONE_OF(UInt32)
NONE_OF(Int64)
NONE_OF(UInt64)
NONE_OF(Boolean)
NONE_OF(String)
NONE(GetBinary, const reference r[], size_t n, size_t sizes[], fmi3Binary value[], size_t n_values)
NONE(SetBinary, const reference r[], size_t n, const size_t sizes[], const fmi3Binary value[], size_t n_values)
NONE(GetClock, const reference r[], size_t n, fmi3Clock value[])
NONE(SetClock, const reference r[], size_t n, const fmi3Clock value[])
NONE(GetIntervalDecimal, const reference r[], size_t n, fmi3Float64 interval[], fmi3IntervalQualifier kinds[])
NONE(GetIntervalFraction, const reference r[], size_t n, fmi3UInt64 counter[], fmi3UInt64 resolution[],
     fmi3IntervalQualifier kinds[])
NONE(GetShiftDecimal, const reference r[], size_t n, fmi3Float64 shift[])
NONE(GetShiftFraction, const reference r[], size_t n, fmi3UInt64 counter[], fmi3UInt64 resolution[])
NONE(SetIntervalDecimal, const reference r[], size_t n, const fmi3Float64 interval[])
NONE(SetIntervalFraction, const reference r[], size_t n, const fmi3UInt64 counter[], const fmi3UInt64 resolution[])
NONE(SetShiftDecimal, const reference r[], size_t n, const fmi3Float64 shift[])
NONE(SetShiftFraction, const reference r[], size_t n, const fmi3UInt64 counter[], const fmi3UInt64 resolution[])

FMI3_DOOR fmi3Status FMI3(ActivateModelPartition)(fmi3Instance c, reference clock, fmi3Float64 time)
{
    return ended(c, EX_NO_VARIABLE);
}

/* The model description tells them; by element there are none, for every variable is a scalar. */
FMI3_DOOR fmi3Status FMI3(GetNumberOfVariableDependencies)(fmi3Instance c, reference r, size_t *n)
{
    *n = 0;
    return report(c, fmi3Error, "dependencies stand in modelDescription.xml");
}

FMI3_DOOR fmi3Status FMI3(GetVariableDependencies)(fmi3Instance c, reference dependent, size_t elements[],
                                                   reference independents[], size_t elements_of_them[],
                                                   fmi3DependencyKind kinds[], size_t n)
{
    return report(c, fmi3Error, "dependencies stand in modelDescription.xml");
}
