/* FMI 2.0 for co-simulation and model exchange: the 44 functions of the standard. */
#include "exported.h"
#include "fmi2_declarations.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Signatures are the standard's: not every argument matters here. */
#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif

typedef struct {
    ex_instance e;
    fmi2CallbackFunctions host;
    fmi2Boolean is_logging;
    double last_time; /* where the last step that succeeded ended */
    char name[64];
} component;

static fmi2Status report(component *c, fmi2Status status, const char *what)
{
    if (c->host.logger)
        c->host.logger(c->host.componentEnvironment, c->name, status, "logStatusError", "%s", what);
    return status;
}

static fmi2Status ended(component *c, int code)
{
    return code == DF_OK ? fmi2OK : report(c, fmi2Error, ex_sentence(code));
}

FMI2_DOOR const char *FMI2(GetTypesPlatform)(void)
{
    return "default";
}

FMI2_DOOR const char *FMI2(GetVersion)(void)
{
    return "2.0";
}

FMI2_DOOR fmi2Status FMI2(SetDebugLogging)(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String names[])
{
    ((component *)c)->is_logging = on;
    return fmi2OK;
}

FMI2_DOOR fmi2Component FMI2(Instantiate)(fmi2String name, fmi2Type type, fmi2String token, fmi2String resources,
                                          const fmi2CallbackFunctions *functions, fmi2Boolean visible,
                                          fmi2Boolean logging)
{
    char why[EX_WHY];
    component *c = calloc(1, sizeof *c);
    if (!c)
        return NULL;
    if (functions)
        c->host = *functions;
    c->is_logging = logging;
    snprintf(c->name, sizeof c->name, "%.60s", name ? name : "damper");
    const ex_kind kind = type == fmi2CoSimulation ? EX_CO_SIMULATION : EX_MODEL_EXCHANGE;
    if (!ex_open(&c->e, kind, resources, token, why)) {
        report(c, fmi2Error, why);
        ex_close(&c->e);
        free(c);
        return NULL;
    }
    return c;
}

FMI2_DOOR void FMI2(FreeInstance)(fmi2Component c)
{
    if (!c)
        return;
    ex_close(&((component *)c)->e);
    free(c);
}

FMI2_DOOR fmi2Status FMI2(SetupExperiment)(fmi2Component c, fmi2Boolean has_tolerance, fmi2Real tolerance,
                                           fmi2Real start, fmi2Boolean has_stop, fmi2Real stop)
{
    ((component *)c)->last_time = start;
    return ended(c, ex_set(&((component *)c)->e, EX_TIME, start));
}

FMI2_DOOR fmi2Status FMI2(EnterInitializationMode)(fmi2Component c)
{
    return fmi2OK;
}

FMI2_DOOR fmi2Status FMI2(ExitInitializationMode)(fmi2Component c)
{
    return ended(c, ex_start(&((component *)c)->e));
}

FMI2_DOOR fmi2Status FMI2(Terminate)(fmi2Component c)
{
    return fmi2OK;
}

FMI2_DOOR fmi2Status FMI2(Reset)(fmi2Component c)
{
    return ex_reset(&((component *)c)->e) ? fmi2OK : fmi2Error;
}

FMI2_DOOR fmi2Status FMI2(GetReal)(fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2Real value[])
{
    return ended(c, ex_get_all(&((component *)c)->e, r, n, value));
}

FMI2_DOOR fmi2Status FMI2(SetReal)(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Real value[])
{
    return ended(c, ex_set_all(&((component *)c)->e, r, n, value));
}

FMI2_DOOR fmi2Status FMI2(GetInteger)(fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2Integer value[])
{
    return ended(c, ex_get_integers(&((component *)c)->e, r, n, value));
}

FMI2_DOOR fmi2Status FMI2(SetInteger)(fmi2Component c, const fmi2ValueReference r[], size_t n,
                                      const fmi2Integer value[])
{
    return ended(c, ex_set_integers(&((component *)c)->e, r, n, value));
}

static fmi2Status none_of_them(fmi2Component c, size_t n)
{
    return n == 0 ? fmi2OK : ended(c, EX_NO_VARIABLE);
}

FMI2_DOOR fmi2Status FMI2(GetBoolean)(fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2Boolean value[])
{
    return none_of_them(c, n);
}

FMI2_DOOR fmi2Status FMI2(SetBoolean)(fmi2Component c, const fmi2ValueReference r[], size_t n,
                                      const fmi2Boolean value[])
{
    return none_of_them(c, n);
}

FMI2_DOOR fmi2Status FMI2(GetString)(fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2String value[])
{
    return none_of_them(c, n);
}

FMI2_DOOR fmi2Status FMI2(SetString)(fmi2Component c, const fmi2ValueReference r[], size_t n,
                                     const fmi2String value[])
{
    return none_of_them(c, n);
}

FMI2_DOOR fmi2Status FMI2(GetFMUstate)(fmi2Component c, fmi2FMUstate *state)
{
    return ended(c, ex_keep(&((component *)c)->e, state));
}

FMI2_DOOR fmi2Status FMI2(SetFMUstate)(fmi2Component c, fmi2FMUstate state)
{
    component *own = c;
    const int code = ex_return_to(&own->e, state);
    own->last_time = own->e.s.time;
    return ended(c, code);
}

FMI2_DOOR fmi2Status FMI2(FreeFMUstate)(fmi2Component c, fmi2FMUstate *state)
{
    ex_forget(state);
    return fmi2OK;
}

FMI2_DOOR fmi2Status FMI2(SerializedFMUstateSize)(fmi2Component c, fmi2FMUstate state, size_t *size)
{
    *size = ex_serialised_size(&((component *)c)->e);
    return fmi2OK;
}

FMI2_DOOR fmi2Status FMI2(SerializeFMUstate)(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size)
{
    return ended(c, ex_serialise(&((component *)c)->e, state, bytes, size));
}

FMI2_DOOR fmi2Status FMI2(DeSerializeFMUstate)(fmi2Component c, const fmi2Byte bytes[], size_t size,
                                               fmi2FMUstate *state)
{
    return ended(c, ex_deserialise(&((component *)c)->e, bytes, size, state));
}

FMI2_DOOR fmi2Status FMI2(GetDirectionalDerivative)(fmi2Component c, const fmi2ValueReference unknowns[],
                                                    size_t n_unknowns, const fmi2ValueReference knowns[],
                                                    size_t n_knowns, const fmi2Real seed[], fmi2Real slopes[])
{
    return ended(c, ex_directional(&((component *)c)->e, unknowns, n_unknowns, knowns, n_knowns, seed, slopes));
}

FMI2_DOOR fmi2Status FMI2(EnterEventMode)(fmi2Component c)
{
    return fmi2OK;
}

FMI2_DOOR fmi2Status FMI2(NewDiscreteStates)(fmi2Component c, fmi2EventInfo *info)
{
    int moved;
    memset(info, 0, sizeof *info);
    const int code = ex_refresh(&((component *)c)->e, &moved);
    info->valuesOfContinuousStatesChanged = moved ? fmi2True : fmi2False;
    return ended(c, code);
}

FMI2_DOOR fmi2Status FMI2(EnterContinuousTimeMode)(fmi2Component c)
{
    return fmi2OK;
}

FMI2_DOOR fmi2Status FMI2(CompletedIntegratorStep)(fmi2Component c, fmi2Boolean no_setting_back,
                                                   fmi2Boolean *enter_event_mode, fmi2Boolean *terminate)
{
    *enter_event_mode = fmi2False;
    *terminate = fmi2False;
    return fmi2OK;
}

FMI2_DOOR fmi2Status FMI2(SetTime)(fmi2Component c, fmi2Real time)
{
    ex_set_time(&((component *)c)->e, time);
    return fmi2OK;
}

FMI2_DOOR fmi2Status FMI2(SetContinuousStates)(fmi2Component c, const fmi2Real y[], size_t n)
{
    return ended(c, ex_set_states(&((component *)c)->e, y, n));
}

FMI2_DOOR fmi2Status FMI2(GetDerivatives)(fmi2Component c, fmi2Real rates[], size_t n)
{
    return ended(c, ex_get_rates(&((component *)c)->e, rates, n));
}

FMI2_DOOR fmi2Status FMI2(GetEventIndicators)(fmi2Component c, fmi2Real z[], size_t n)
{
    return ended(c, ex_get_indicators(&((component *)c)->e, z, n));
}

FMI2_DOOR fmi2Status FMI2(GetContinuousStates)(fmi2Component c, fmi2Real y[], size_t n)
{
    return ended(c, ex_get_states(&((component *)c)->e, y, n));
}

FMI2_DOOR fmi2Status FMI2(GetNominalsOfContinuousStates)(fmi2Component c, fmi2Real nominals[], size_t n)
{
    return ended(c, ex_get_nominals(&((component *)c)->e, nominals, n));
}

FMI2_DOOR fmi2Status FMI2(SetRealInputDerivatives)(fmi2Component c, const fmi2ValueReference r[], size_t n,
                                                   const fmi2Integer order[], const fmi2Real value[])
{
    return n == 0 ? fmi2OK : report(c, fmi2Error, "derivatives of inputs are not taken: the velocity is an input");
}

/* Importers ask for every output; one that does not tell its derivative has none that is known. */
FMI2_DOOR fmi2Status FMI2(GetRealOutputDerivatives)(fmi2Component c, const fmi2ValueReference r[], size_t n,
                                                    const fmi2Integer order[], fmi2Real value[])
{
    for (size_t i = 0; i < n; i++)
        value[i] = 0.0;
    return fmi2OK;
}

FMI2_DOOR fmi2Status FMI2(DoStep)(fmi2Component c, fmi2Real time, fmi2Real interval, fmi2Boolean no_setting_back)
{
    component *own = c;
    if (interval == 0.0)
        return fmi2OK;
    const int code = ex_step(&own->e, time, interval);
    if (code != DF_OK)
        return report(own, fmi2Discard, ex_sentence(code));
    own->last_time = time + interval;
    return fmi2OK;
}

FMI2_DOOR fmi2Status FMI2(CancelStep)(fmi2Component c)
{
    return report(c, fmi2Error, "steps are done when doStep returns: there is none to cancel");
}

FMI2_DOOR fmi2Status FMI2(GetStatus)(fmi2Component c, const fmi2StatusKind kind, fmi2Status *value)
{
    *value = fmi2OK;
    return fmi2Discard;
}

FMI2_DOOR fmi2Status FMI2(GetRealStatus)(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value)
{
    if (kind != fmi2LastSuccessfulTime)
        return fmi2Discard;
    *value = ((component *)c)->last_time;
    return fmi2OK;
}

FMI2_DOOR fmi2Status FMI2(GetIntegerStatus)(fmi2Component c, const fmi2StatusKind kind, fmi2Integer *value)
{
    return fmi2Discard;
}

FMI2_DOOR fmi2Status FMI2(GetBooleanStatus)(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value)
{
    if (kind != fmi2Terminated)
        return fmi2Discard;
    *value = fmi2False;
    return fmi2OK;
}

FMI2_DOOR fmi2Status FMI2(GetStringStatus)(fmi2Component c, const fmi2StatusKind kind, fmi2String *value)
{
    *value = "";
    return fmi2Discard;
}
