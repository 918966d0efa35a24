/* States as bytes, and what endings mean. */
#include "exported.h"

#include <string.h>

size_t ex_serialised_size(const ex_instance *e)
{
    return sizeof(ex_state) + sizeof e->damper.token;
}

int ex_serialise(const ex_instance *e, const void *state, char *bytes, size_t size)
{
    if (!state || size < ex_serialised_size(e))
        return EX_NO_STATE;
    memcpy(bytes, e->damper.token, sizeof e->damper.token);
    memcpy(bytes + sizeof e->damper.token, state, sizeof(ex_state));
    return DF_OK;
}

int ex_deserialise(const ex_instance *e, const char *bytes, size_t size, void *state)
{
    if (size != ex_serialised_size(e) || memcmp(bytes, e->damper.token, sizeof e->damper.token) != 0)
        return EX_NO_STATE;
    memcpy(state, bytes + sizeof e->damper.token, sizeof(ex_state));
    const int setting = ((const ex_state *)state)->setting;
    return setting >= 0 && setting < e->damper.n_settings ? DF_OK : EX_NO_STATE;
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
    case EX_NOT_SETTABLE: return "this variable cannot be set";
    case EX_OUT_OF_RANGE: return "the value is out of the range of its variable";
    case EX_NO_STATE: return "these bytes are no state of this damper";
    default: return "no such ending";
    }
}
