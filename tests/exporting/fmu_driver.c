/* Drives the exported damper behind FMI 2.0 under sanitizers: every door, bad values, damaged text.
 * Arguments: a folder with damper.txt and its token. Returns the number of failures. */
#include "exported.h"
#include "fmi2_declarations.h"
#include "reading.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

fmi2Component fmi2Instantiate(fmi2String, fmi2Type, fmi2String, fmi2String, const fmi2CallbackFunctions *, fmi2Boolean,
                              fmi2Boolean);
void fmi2FreeInstance(fmi2Component);

static int failures;

static void check(int holds, const char *what)
{
    if (!holds) {
        printf("FAILED %s\n", what);
        failures += failures < 100;
    }
}

/* Whatever a text says, it is taken or refused; nothing is read or written beyond it. */
static void damaged_texts(const char *text)
{
    const size_t n = strlen(text);
    char why[EX_WHY];
    unsigned long seed = 12345;
    int taken = 0;
    for (int trial = 0; trial < 4000; trial++) {
        char *copy = malloc(n + 1); /* of its exact size, so that a byte too far is seen */
        ex_damper damper;
        memcpy(copy, text, n + 1);
        for (int k = 0; k < 1 + trial % 3; k++) {
            seed = seed * 1103515245u + 12345u;
            const size_t place = (seed >> 8) % n;
            if (trial % 5 == 0)
                copy[place] = '\0';
            else
                copy[place] = (char)("0123456789.-+e \n{}x\xff\x01"[(seed >> 20) % 21]);
        }
        taken += ex_parse(copy, &damper, why);
        free(damper.settings);
        free(damper.table);
        free(damper.rig);
        free(copy);
    }
    check(taken < 4000, "damage is noticed");
}

static void every_reference(ex_instance *e)
{
    for (unsigned r = 0; r < 130; r++) {
        const double bad[] = {NAN, INFINITY, -INFINITY, -1.0, 0.0, 1e300};
        double value;
        int number;
        ex_get(e, r, &value);
        ex_get_integer(e, r, &number);
        for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
            const ex_state kept = e->s;
            if (ex_set(e, r, bad[i]) == DF_OK) {
                ex_get(e, EX_FORCE, &value);
                ex_step(e, 0.0, 1e-3);
            }
            e->s = kept;
        }
        for (unsigned u = 0; u < 130; u += 3)
            ex_slope(e, u, r, &value);
        for (int n = -2; n < 25; n += 9)
            ex_set_integer(e, r, n);
    }
}

static void kept_states(ex_instance *e)
{
    void *state = NULL, *other = NULL;
    const size_t size = ex_serialised_size(e);
    char *bytes = malloc(size);
    check(bytes && ex_keep(e, &state) == DF_OK && ex_serialise(e, state, bytes, size) == DF_OK, "kept");
    check(ex_serialise(e, state, bytes, size - 1) != DF_OK, "no room");
    check(ex_deserialise(e, bytes, size, &other) == DF_OK && ex_return_to(e, other) == DF_OK, "taken up");
    check(ex_deserialise(e, bytes, size - 1, &other) != DF_OK, "cut bytes");
    bytes[2] ^= 1;
    check(ex_deserialise(e, bytes, size, &other) != DF_OK, "another damper's");
    check(ex_return_to(e, NULL) != DF_OK, "none");
    ex_forget(&state);
    ex_forget(&other);
    ex_forget(&other);
    ex_forget(NULL);
    free(bytes);
}

static void endless_and_no_steps(ex_instance *e)
{
    check(ex_step(e, 0.0, NAN) != DF_OK, "a step of NaN");
    check(ex_step(e, 0.0, INFINITY) != DF_OK, "a step without end");
    check(ex_step(e, 0.0, -1e-3) != DF_OK, "a step back");
    check(ex_step(e, 0.0, 1e-3) == DF_OK, "and then a step");
}

/* Leaves numbers where the next call keeps its own. */
static double littered(void)
{
    volatile double litter[4096];
    for (int i = 0; i < 4096; i++)
        litter[i] = 1.5;
    return litter[4095];
}

static void indicators_of_nothing(ex_instance *e)
{
    const ex_state kept = e->s;
    e->s.y[0] = NAN;
    for (unsigned r = EX_INDICATOR_1; r <= EX_INDICATOR_4; r++) {
        double value = littered();
        check(ex_get(e, r, &value) != DF_OK, "an indicator where the equations fail");
        check(value == 0.0, "nothing is read that nobody wrote");
    }
    e->s = kept;
}

int main(int n, char **arguments)
{
    char why[EX_WHY];
    if (n < 3)
        return 2;
    char *text = ex_read_text(arguments[1]);
    check(text != NULL, "the text is there");
    if (!text)
        return failures;
    damaged_texts(text);
    free(text);
    const char *const wrong[] = {"", "file:", "file:/", "file:///nowhere%20at%2", "/", "nowhere", NULL};
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        ex_instance e;
        check(!ex_open(&e, EX_CO_SIMULATION, wrong[i], arguments[2], why), "no folder");
        ex_close(&e);
    }
    for (int kind = 0; kind < 2; kind++) {
        ex_instance e;
        double y[EX_SLOTS], rates[EX_SLOTS], z[EX_N_INDICATORS];
        check(ex_open(&e, (ex_kind)kind, arguments[1], arguments[2], why), why);
        ex_set(&e, EX_VELOCITY, 0.2);
        ex_set_integer(&e, EX_CARRIES, 1);
        check(ex_start(&e) == DF_OK, "begin");
        every_reference(&e);
        endless_and_no_steps(&e);
        const size_t states = (size_t)e.damper.n_states;
        check(ex_get_states(&e, y, states) == DF_OK && ex_set_states(&e, y, states) == DF_OK, "states");
        check(ex_get_rates(&e, rates, states) == DF_OK, "rates");
        check(ex_get_nominals(&e, rates, states) == DF_OK, "nominals");
        check(ex_get_indicators(&e, z, EX_N_INDICATORS) == DF_OK, "indicators");
        check(ex_get_states(&e, y, states + 1) != DF_OK && ex_get_rates(&e, y, 0) != DF_OK, "other numbers of states");
        y[0] = NAN;
        check(ex_set_states(&e, y, states) != DF_OK, "a state that is no number");
        kept_states(&e);
        indicators_of_nothing(&e);
        ex_close(&e);
    }
    const fmi2CallbackFunctions silent = {NULL, NULL, NULL, NULL, NULL};
    check(!fmi2Instantiate(NULL, fmi2CoSimulation, NULL, NULL, &silent, 0, 0), "no names at all");
    fmi2Component c = fmi2Instantiate(NULL, fmi2CoSimulation, arguments[2], arguments[1], NULL, 0, 0);
    check(c != NULL, "no callbacks");
    fmi2FreeInstance(c);
    fmi2FreeInstance(NULL);
    return failures;
}
