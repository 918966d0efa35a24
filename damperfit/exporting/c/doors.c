/* What the doors of FMI 2 and FMI 3 do alike: lists of variables, derivatives, states, sentences. */
#include "exported.h"

#include <stdlib.h>
#include <string.h>

int ex_get_all(ex_instance *e, const unsigned *references, size_t n, double *values)
{
    int code = DF_OK;
    for (size_t i = 0; i < n && code == DF_OK; i++)
        code = ex_get(e, references[i], &values[i]);
    return code;
}

int ex_set_all(ex_instance *e, const unsigned *references, size_t n, const double *values)
{
    int code = DF_OK;
    for (size_t i = 0; i < n && code == DF_OK; i++)
        code = ex_set(e, references[i], values[i]);
    return code;
}

int ex_get_integers(const ex_instance *e, const unsigned *references, size_t n, int *values)
{
    int code = DF_OK;
    for (size_t i = 0; i < n && code == DF_OK; i++)
        code = ex_get_integer(e, references[i], &values[i]);
    return code;
}

int ex_set_integers(ex_instance *e, const unsigned *references, size_t n, const int *values)
{
    int code = DF_OK;
    for (size_t i = 0; i < n && code == DF_OK; i++)
        code = ex_set_integer(e, references[i], values[i]);
    return code;
}

int ex_directional(ex_instance *e, const unsigned *unknowns, size_t n_unknowns, const unsigned *knowns,
                   size_t n_knowns, const double *seed, double *slopes)
{
    for (size_t i = 0; i < n_unknowns; i++) {
        slopes[i] = 0.0;
        for (size_t k = 0; k < n_knowns; k++) {
            double slope;
            const int code = ex_slope(e, unknowns[i], knowns[k], &slope);
            if (code != DF_OK)
                return code;
            slopes[i] += slope * seed[k];
        }
    }
    return DF_OK;
}

int ex_keep(const ex_instance *e, void **state)
{
    if (!*state && !(*state = malloc(sizeof e->s)))
        return EX_NO_MEMORY;
    memcpy(*state, &e->s, sizeof e->s);
    return DF_OK;
}

int ex_return_to(ex_instance *e, const void *state)
{
    if (!state)
        return EX_NO_STATE;
    memcpy(&e->s, state, sizeof e->s);
    return DF_OK;
}

void ex_forget(void **state)
{
    if (state) {
        free(*state);
        *state = NULL;
    }
}

size_t ex_serialised_size(const ex_instance *e)
{
    return sizeof e->s + sizeof e->damper.token;
}

int ex_serialise(const ex_instance *e, const void *state, char *bytes, size_t size)
{
    if (!state || size < ex_serialised_size(e))
        return EX_NO_STATE;
    memcpy(bytes, e->damper.token, sizeof e->damper.token);
    memcpy(bytes + sizeof e->damper.token, state, sizeof e->s);
    return DF_OK;
}

int ex_deserialise(const ex_instance *e, const char *bytes, size_t size, void **state)
{
    ex_state found;
    if (size != ex_serialised_size(e) || memcmp(bytes, e->damper.token, sizeof e->damper.token) != 0)
        return EX_NO_STATE;
    memcpy(&found, bytes + sizeof e->damper.token, sizeof found);
    if (found.setting < 0 || found.setting >= e->damper.n_settings)
        return EX_NO_STATE;
    if (!*state && !(*state = malloc(sizeof found)))
        return EX_NO_MEMORY;
    memcpy(*state, &found, sizeof found);
    return DF_OK;
}

const char *ex_sentence(int code)
{
    switch (code) {
    case DF_NOT_FINITE: return "an input, a parameter or a state is not a finite number";
    case DF_STEP_LIMIT: return "the integrator needs too many steps; take a shorter communication step";
    case DF_CHAMBER_EMPTY: return "the displacement leaves no volume in a chamber or in the gas";
    case DF_BAD_ARGUMENT: return "a parameter or the step is zero, negative or not finite";
    case EX_NO_SETTING: return "this setting was not identified; the description of 'setting' lists those that were";
    case EX_NO_VARIABLE: return "there is no variable of this type with this value reference";
    case EX_NOT_SETTABLE: return "this variable cannot be set, or not any more";
    case EX_OUT_OF_RANGE: return "the value is out of the range of its variable";
    case EX_NO_STATE: return "this is no state of this damper";
    case EX_NO_MEMORY: return "out of memory";
    case EX_NOT_CARRIED: return "derivatives by parameters are carried along where carry_derivatives is 1 from the beginning";
    case EX_NOT_WITH_RIG: return "with_rig is for co-simulation, and without derivatives";
    default: return "no such ending";
    }
}
