/* A long motion of the paper's damper as parts that run side by side, in step.
 *
 * A part begins before the last one ends, and has forgotten how it began where it takes over: both are
 * compared there. What cannot be done so is left to `df_simulate_network`.
 */
#ifndef DAMPERFIT_NETWORK_LANES_H
#define DAMPERFIT_NETWORK_LANES_H

#include "network.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Not for parts: another damper, other numbers to differentiate by, or parts that do not meet. */
enum { DF_NOT_IN_PARTS = -1 };

/* As `df_simulate_network`; `lead`: samples in which a part settles. With `is_unseen` nobody asks for the first
 * `lead` samples: parts settle in long steps at first, and those samples are NaN. */
int df_simulate_in_parts(df_network *network, const df_options *options, const df_motion *motion, size_t lead,
                         int is_unseen, const df_result *result, df_work *work);

#ifdef __cplusplus
}
#endif
#endif
