/* Models with one state of their own: what follows a motion late, and what it depends on.
 *
 * An elastic dashpot is a spring, with play, in series with a dashpot of any passages; its state is
 * the spring's extension. Bouc and Wen's variable is rate-independent hysteresis between -1 and 1.
 */
#ifndef DAMPERFIT_HYSTERESIS_H
#define DAMPERFIT_HYSTERESIS_H

#include "core.h"

#ifdef __cplusplus
extern "C" {
#endif

#define DF_MOST_PATHS 8
#define DF_MOST_STATE_NUMBERS 24

/* A way through the dashpot, one direction: places of its numbers, -1 for what it has not.
 * Force F > p_open in its direction: F = p_open + R w + (S w)^2, w in m/s. */
typedef struct {
    int is_rebound, p_open, R, S;
} df_path;

typedef struct {
    int stiffness;    /* N/m, place */
    int play;         /* m, place or -1 */
    int half_length;  /* m, place or -1: the spring is two columns of oil, stiffer off the middle */
    int n_paths;
    df_path paths[DF_MOST_PATHS];
    int n_numbers;
    double numbers[DF_MOST_STATE_NUMBERS];
    double rounding;  /* of a path's root, N */
} df_elastic_dashpot;

/* z' = rho (v - sigma |v| |z|^(n-1) z + (sigma - 1) v |z|^n); numbers rho (1/m), sigma, n. */
enum { DF_RHO, DF_SIGMA, DF_EXPONENT, DF_N_BOUC_WEN };

/* Fill n doubles of force (or z), and n rows of their slopes by every number. The state is 0 at the
 * first sample. Returns one of the codes of core.h. */
int df_follow_dashpot(const df_elastic_dashpot *dashpot, const df_motion *motion, double *force,
                      double *slopes, size_t *failed_sample);
int df_follow_bouc_wen(const double numbers[DF_N_BOUC_WEN], const df_motion *motion, double *z,
                       double *slopes, size_t *failed_sample);

#ifdef __cplusplus
}
#endif
#endif
