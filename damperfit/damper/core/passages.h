/* The law of a passage between two chambers, with its slopes by everything it depends on.
 *
 *   D       pressure of the chamber it leaves less that of the chamber it enters   Pa
 *   p_open  preload: closed up to here                                             Pa
 *   R       laminar resistance                                                     N s/(m2 kg)
 *   S       orifice, S = 1/(C_d A sqrt(2 rho))                                     s sqrt(N)/(m kg)
 *   width   how gradually a stack of discs lifts off its seat                      Pa
 *   power   of the flow that the pressure beyond the opening goes with; 0: as 1     1
 *   w       mass flow                                                              kg/s
 *
 *   D = p_open + R w + (S w)^2,   w = 0 up to p_open
 *   w = 2 s/(R + r), r = sqrt(R^2 + 4 S^2 s)                       no cancellation; R or S may be 0
 *   s = u^2/sqrt(u^2 + eps^2), u = D - p_open > 0                  the root rounded within eps
 *   s = sp(D - p_open) - sp(-p_open), sp(u) = width ln(1 + e^(u/width))         where width > 0
 *   s_0 (s/s_0)^(1/power) in place of s, s_0 = 10 bar            a stack that stiffens or gives way
 */
#ifndef DAMPERFIT_PASSAGES_H
#define DAMPERFIT_PASSAGES_H

#include <math.h>

/* Its numbers, in the order of a passage's row. */
typedef enum { DF_OPENING, DF_R, DF_S, DF_WIDTH, DF_POWER, DF_TERMS } df_term;

typedef struct {
    double of[DF_TERMS];
    int two_way; /* the same law backwards; otherwise closed for D < 0 */
} df_passage_law;

/* Mass flow and its derivatives. */
typedef struct {
    double w, by_D, by[DF_TERMS];
} df_flow;

df_flow df_passage_flow(const df_passage_law *law, double D, double eps);

/* The D at which a passage that is open would carry w: the inverse of the law, without width. */
double df_passage_drop(const df_passage_law *law, double w, double eps);

#endif
