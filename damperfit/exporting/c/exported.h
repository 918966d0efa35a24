/* An exported damper: the model that FMI 2 and FMI 3 are two doors to.
 *
 * The library holds no damper: its parameters stand in resources/damper.txt, or in data.c where the
 * sources of an exported unit were compiled. No globals; one instance, one block of memory.
 */
#ifndef DAMPERFIT_EXPORTED_H
#define DAMPERFIT_EXPORTED_H

#include "network.h"

enum { EX_MOST_NUMBERS = DF_MOST_NUMBERS, EX_TOKEN = 80, EX_WHY = 280 };

/* Value references. A number of the damper is EX_NUMBERS + its place. */
enum {
    EX_TIME,
    EX_DISPLACEMENT,
    EX_VELOCITY,
    EX_FORCE,
    EX_PRESSURE_1,
    EX_PRESSURE_2,
    EX_PRESSURE_3,
    EX_SECONDS_OUTSIDE,
    EX_SETTING,
    EX_FRICTION_BAND,
    EX_EXTRAPOLATION,
    EX_STATE_1,
    EX_STATE_2,
    EX_STATE_3,
    EX_RATE_1,
    EX_RATE_2,
    EX_RATE_3,
    EX_INDICATOR_1, /* FMI 3 names them */
    EX_INDICATOR_2,
    EX_INDICATOR_3,
    EX_INDICATOR_4,
    EX_GRIP, /* of a friction that pre-slides */
    EX_GRIP_RATE,
    EX_CARRIES,
    EX_WITH_RIG,
    EX_NUMBERS = 100
};
/* States by their slots: oil in chambers 1 and 2 beyond what fills them where the piston is, seconds
 * outside, grip. All of the oil would be states too, but in a thousand times as much as its pressure
 * is of, a solver's relative tolerance is one of 100 Pa, and a held displacement that jumps by a
 * micrometre is a jump of the pressure. */
enum { EX_OIL_1, EX_OIL_2, EX_OUTSIDE, EX_GRIPS, EX_SLOTS, EX_N_INDICATORS = 4 };

/* What the rig adds to the force that is logged, of each setting. */
enum { EX_RIG_STIFFNESS, EX_RIG_PLAY, EX_RIG_OFFSET, EX_RIG_LAG, EX_RIG_MASS, EX_RIG };

typedef enum { EX_CO_SIMULATION, EX_MODEL_EXCHANGE } ex_kind;

/* What the exported file says; the same for all instances of it. */
typedef struct {
    char token[EX_TOKEN];
    int is_network;       /* a damper of valves; otherwise the paper's */
    df_network network;   /* its passages; numbers are each setting's */
    int n_numbers;
    int places[EX_MOST_NUMBERS]; /* of its numbers among the network's */
    df_options options;
    double stroke, speed; /* tested range; 0: not known */
    double friction_band;
    int start;            /* place of the setting that is set at the beginning */
    int n_settings;
    int *settings;        /* as people call them */
    double *table;        /* n_numbers a setting, in the order of read_purdy or of the network */
    double *rig;          /* EX_RIG a setting */
    int n_states, slots[EX_SLOTS]; /* those slots that are states of this damper */
} ex_damper;

/* All that changes: a copy of its bytes is a copy of the instance's state. */
typedef struct {
    int setting, extrapolation;                 /* place of the setting; order */
    double friction_band;
    double own[EX_MOST_NUMBERS];
    int is_own[EX_MOST_NUMBERS];                /* set to something else than the setting has */
    double time, x, v;                          /* inputs, as they were set */
    int has_begun, is_stale;                    /* stale: parameters changed since the last use */
    df_network network;                         /* with the numbers as they are now, and its state */
    df_network_state valves;
    double y[EX_SLOTS];
    int carries;                                /* slopes by the numbers, of a network in co-simulation */
    int with_rig;                               /* the force as it was logged, in co-simulation */
    double force_before, read;                  /* before and behind the lag of its channel */
    double v_before, t_before;                  /* inputs of the step before */
    int has_before;
    int inputs_are_new;                         /* model exchange: set since the last use */
    double t_inputs;
} ex_state;

typedef struct {
    ex_kind kind;
    ex_damper damper;
    ex_state s;
} ex_instance;

/* Read the parameters of resources/damper.txt in `folder`, a path or a file URI; 0 where the damper of
 * `token` is not there, with a sentence in `why`. */
int ex_open(ex_instance *e, ex_kind kind, const char *folder, const char *token, char *why);
void ex_close(ex_instance *e);
int ex_reset(ex_instance *e);

int ex_number_of(const ex_instance *e, unsigned reference); /* place of a number, -1: none */
double ex_number(const ex_instance *e, int place);           /* as it is now */
int ex_has_grip(const ex_damper *damper);                    /* friction is a state */
int ex_get(ex_instance *e, unsigned reference, double *value);
int ex_set(ex_instance *e, unsigned reference, double value);
int ex_get_integer(const ex_instance *e, unsigned reference, int *value);
int ex_set_integer(ex_instance *e, unsigned reference, int value);
int ex_is_integer(unsigned reference);

/* The network behind the doors. */
int ex_begin_valves(ex_instance *e);
int ex_refresh_valves(ex_instance *e, double x);
int ex_step_valves(ex_instance *e, double interval, double x, double v, int is_of_beginning);
double ex_place_of_piston(const ex_instance *e);
double ex_output_of_valves(const ex_instance *e, unsigned reference);
df_options ex_options(const ex_instance *e);

int ex_begin(ex_instance *e);
int ex_start(ex_instance *e); /* begin, and inputs and parameters are known from now on */
int ex_step(ex_instance *e, double time, double interval);

/* Model exchange. `ex_refresh` takes up changed parameters and says whether the states moved. */
int ex_refresh(ex_instance *e, int *states_moved);
void ex_set_time(ex_instance *e, double time);
void ex_swept(const ex_instance *e, double x, double oil[2]); /* what the piston pushed out of chambers 1 and 2, kg */
double ex_place_now(ex_instance *e); /* where the piston is, if the inputs were set some time ago */
int ex_get_states(ex_instance *e, double *y, size_t n);
int ex_set_states(ex_instance *e, const double *y, size_t n);
int ex_get_rates(ex_instance *e, double *rates, size_t n);
int ex_get_indicators(ex_instance *e, double *z, size_t n);
int ex_get_nominals(const ex_instance *e, double *nominals, size_t n);

/* The equations where the instance stands. */
typedef struct {
    double x, v;
    double rates[EX_SLOTS], pressures[3], free[2], force;
    df_network_rates valves;
} ex_point;
int ex_evaluate(ex_instance *e, ex_point *point);
double ex_beyond(const ex_instance *e, double x, double v); /* the tested range; negative within */

/* d(unknown)/d(known); 0 where the pair has none. */
int ex_slope(ex_instance *e, unsigned unknown, unsigned known, double *slope);

/* What both doors do alike. A state that is kept is a copy of ex_state, which the importer frees. */
int ex_get_all(ex_instance *e, const unsigned *references, size_t n, double *values);
int ex_set_all(ex_instance *e, const unsigned *references, size_t n, const double *values);
int ex_get_integers(const ex_instance *e, const unsigned *references, size_t n, int *values);
int ex_set_integers(ex_instance *e, const unsigned *references, size_t n, const int *values);
int ex_directional(ex_instance *e, const unsigned *unknowns, size_t n_unknowns, const unsigned *knowns,
                   size_t n_knowns, const double *seed, double *slopes);
int ex_keep(const ex_instance *e, void **state);
int ex_return_to(ex_instance *e, const void *state);
void ex_forget(void **state);

/* A state as bytes that another process may take up, of the same damper and the same build. */
size_t ex_serialised_size(const ex_instance *e);
int ex_serialise(const ex_instance *e, const void *state, char *bytes, size_t size);
int ex_deserialise(const ex_instance *e, const char *bytes, size_t size, void **state);

/* What resources/damper.txt would hold, in a unit that was compiled from its own sources. */
extern const char damperfit_data[];

/* The sentence of a code other than DF_OK. */
const char *ex_sentence(int code);
enum {
    EX_NO_SETTING = 100,
    EX_NO_VARIABLE,
    EX_NOT_SETTABLE,
    EX_OUT_OF_RANGE,
    EX_NO_STATE,
    EX_NO_MEMORY,
    EX_NOT_CARRIED,
    EX_NOT_WITH_RIG
};

#endif
