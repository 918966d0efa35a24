/* A damper as a network: two oil chambers, a gas chamber, and passages between any two of them,
 * held by a mounting that may be elastic and may have play.
 *
 * No allocation, no globals, no input or output. The state is a plain struct: a simulation is
 * `df_begin_network` once and `df_advance_network` from sample to sample, and so is an exported model.
 */
#ifndef DAMPERFIT_NETWORK_H
#define DAMPERFIT_NETWORK_H

#include "core.h"
#include "passages.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { DF_MOST_PASSAGES = 16, DF_MOST_NUMBERS = 47 };

/* The numbers that every network has; those of its passages follow. */
enum {
    DF_NUMBER_K,        /* bulk modulus of the oil, Pa */
    DF_NUMBER_PHI,      /* free gas in the oil at P_0, share of the oil's volume */
    DF_NUMBER_FRICTION, /* Coulomb, N */
    DF_NUMBER_OFFSET,   /* N */
    DF_NUMBER_P_0,      /* Pa */
    DF_NUMBER_GAMMA,
    DF_NUMBER_V_GAS,     /* m3 at x = 0 */
    DF_NUMBER_STIFFNESS, /* of rod ends, frame and load cell in series, N/m; 0: rigid */
    DF_NUMBER_PLAY,      /* whole gap of the joints, m */
    DF_NUMBER_DRAG,      /* of the seals, N s/m */
    DF_NUMBER_PRESLIDING, /* distance in which friction builds up, m; 0: at once */
    DF_NUMBER_BREAKAWAY, /* friction at rest above that of sliding, N */
    DF_NUMBER_STRIBECK,  /* speed at which a third of it is left, m/s */
    DF_NUMBER_PRESSED,   /* friction by the pressure on the rod's seal, m2 */
    DF_NUMBER_TURNING,   /* speed up to which friction turns, m/s; below the dead band: at once */
    DF_NUMBER_RUBBER,    /* what an elastic mounting holds whichever way it is bent, N */
    DF_NUMBER_BEND,      /* stretch over which that builds up, m */
    DF_FIRST_PASSAGE_NUMBER
};

/* Chambers 1 and 2 hold oil, 3 the gas; with a floating piston 2 is at the gas pressure too. */
typedef struct {
    int from, to;         /* 1, 2 or 3 */
    int places[DF_TERMS]; /* among the numbers, -1 where the term is absent */
    int two_way;
} df_passage;

/* A passage as the integrator asks for it. Between two chambers oil flows as their pressures differ,
 * whichever way a passage was declared. */
enum { DF_1_3, DF_1_2, DF_2_3, DF_PAIRS };
typedef enum { DF_LEAK, DF_ORIFICE, DF_COMPOSED } df_kind; /* R alone, S alone, more */
typedef struct {
    df_passage_law law;
    df_kind kind;
    int pair;
    double out[2];               /* what its flow does to chambers 1 and 2: -1 takes, 1 fills */
    double turn;                 /* 1 from the pair's first chamber to its second, -1 back, 0 both */
    double opens;                /* least |D| - p_open at which oil flows */
    double inverse_R, inverse_S; /* of a leak, of an orifice */
} df_way;

/* A way that a number is of, and as what. Of a leak or an orifice R and S act as `times` w. */
typedef struct {
    int way;
    df_term term;
    double times;
} df_touch;

/* What follows from a network, the same for all steps; df_begin_network makes it. */
typedef struct {
    int is_elastic, has_gas_in_oil, is_purdy;
    double oil[2];             /* at x = 0, kg */
    double swept[2];           /* rho_0 times the areas, kg/m */
    double inverse_K;
    int first[DF_PAIRS + 1];   /* of each pair's ways, and where the last pair's end */
    df_way ways[DF_MOST_PASSAGES];
    int touched[DF_MOST_NUMBERS + 1]; /* where those of a number begin */
    df_touch touches[DF_TERMS * DF_MOST_PASSAGES];
} df_plan;

typedef struct {
    double a_1, a_2;       /* annulus, full bore: m2 */
    double V_1, V_2;       /* oil in chambers 1 and 2 at x = 0: m3 */
    double rho_0;          /* kg/m3 */
    double rod_force;      /* ambient pressure on the rod, a_r P_amb: N */
    double rounding;       /* of the root at D = 0, Pa */
    int has_floating_piston;
    int n_passages;
    df_passage passages[DF_MOST_PASSAGES];
    int n_numbers;
    double numbers[DF_MOST_NUMBERS];
    df_plan plan;
} df_network;

/* The state: oil in chambers 1 and 2, and where the piston is. A rigid mounting holds it at x. */
enum { DF_M1, DF_M2, DF_PISTON, DF_STATES };

/* Pressures and their slopes at one instant, the mounting, and what they make of the states. */
typedef struct {
    double P[3];                          /* as they act */
    double own[2], gas;                   /* slopes: of P1 and P2 by their oil, of P3 by what has left */
    double by_y[3];                       /* by the piston's place */
    double fill[2];                       /* m/(rho_0 V) - 1 */
    double F[DF_STATES], J[2][DF_STATES]; /* d(state)/dt; slopes of the masses' */
    double pull, pull_slope;              /* mounting: its force, N, and that by its stretch */
    double beyond, bend;                  /* stretch beyond the play, m; share of what rubber holds */
    double speed;                         /* of the piston, m/s */
    double rub;                           /* friction while it slides, N */
    double grip, grip_by_turning;         /* share of it; that by the speed up to which it turns */
    double brake;                         /* slope of all friction by the piston's speed, N s/m */
    double caught;                        /* slope of friction by the piston's place, N/m */
} df_network_balance;

/* Flows along the pairs, and what they gain by D. */
typedef struct {
    double D[DF_PAIRS], W[DF_PAIRS], G[DF_PAIRS];
    double w[DF_MOST_PASSAGES], g[DF_MOST_PASSAGES]; /* of each way */
    df_flow whole[DF_MOST_PASSAGES];                 /* of those that are composed */
    double nearest;                                  /* Pa; to the next root or corner that a correction turns */
} df_flows;

/* The running state between samples. */
typedef struct {
    int which[DF_MOST_NUMBERS], n_which; /* sensitivities asked for: places among the numbers */
    int active[DF_MOST_NUMBERS], n_active; /* those of them, by their order, that are carried */
    double y[DF_STATES], F[DF_STATES];
    double S[DF_MOST_NUMBERS][DF_STATES], G[DF_MOST_NUMBERS][DF_STATES]; /* dy/d(number), d/dt of it */
    df_network_balance b;
    df_gas_point gas;
    /* For the next prediction: fills of the chambers and the stretch of the mounting. */
    double guide_mid[DF_STATES], guide_old[DF_STATES], t_mid, t_old;
    double wish;                                   /* next step, s */
    double x, v;
    double grip, grip_by[DF_MOST_NUMBERS]; /* of a friction that pre-slides, with its derivatives */
    double bend_by[DF_MOST_NUMBERS];       /* of what rubber holds */
} df_network_state;

/* Whether a network can be, and what follows from it; beginning and retuning do it. */
int df_plan_network(df_network *network);

/* Whether a number moves the oil or the piston, or is of the force alone. */
int df_moves_the_state(const df_network *network, int place);

/* All chambers at one pressure at x, with the oil mass of the damper at x = 0. */
int df_begin_network(df_network *network, const df_options *options, double x, double v,
             const int *which, int n_which, df_network_state *state);

/* From the state's x and v to those given, a time `interval` later, along the cubic Hermite piece. */
int df_advance_network(const df_network *network, const df_options *options, double x, double v,
               double interval, df_network_state *state, df_work *work);

/* The force of a state and its derivatives by the numbers asked for. */
double df_force_network(const df_network *network, const df_options *options, const df_network_state *state,
                double *slopes);

/* Go on with other numbers, at the pressures of the oil chambers as they are: the masses follow. A
 * number that changes has had no influence on the past. */
int df_retune_network(df_network *network, df_network *changed, const df_options *options,
                      df_network_state *state);

/* Put the state where another integrator has it: oil beyond that at x = 0, friction, and the piston. */
int df_place_network(const df_network *network, const double oil[2], double grip, double x, double v,
                     df_network_state *state);

/* The balances as they stand, on a rigid mounting. The third rate is that of a friction that
 * pre-slides: dz/dt = (v - |v| z)/sigma. */
typedef struct {
    df_network_balance b;
    df_flows flows;
    double v, band, taken;
    double rates[3]; /* of the oil in chambers 1 and 2, kg/s, and of the grip, 1/s */
    double free[2];  /* pressures of the chambers without the clamp at zero */
    double force;
} df_network_rates;

int df_evaluate_network(const df_network *network, double dead_band, const double oil[2], double grip, double x,
                        double v, df_network_rates *rates);

/* What a known does to them, all other knowns held. */
enum {
    DF_BY_OIL_1,
    DF_BY_OIL_2,
    DF_BY_GRIP,
    DF_BY_PLACE, /* of the piston */
    DF_BY_SPEED,
    DF_BY_BAND,
    DF_BY_NUMBER /* and the place of the number */
};
typedef struct {
    double rates[3], pressures[3], force;
} df_network_slopes;

void df_network_by(const df_network *network, const df_network_rates *rates, int known, df_network_slopes *slopes);

/* The whole motion; `result->which` names places among the numbers. */
int df_simulate_network(df_network *network, const df_options *options,
                        const df_motion *motion, const df_result *result, df_work *work);

#ifdef __cplusplus
}
#endif
#endif
