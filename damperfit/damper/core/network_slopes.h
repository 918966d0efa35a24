/* What a number does to the balances, the states held. */
#ifndef DAMPERFIT_NETWORK_SLOPES_H
#define DAMPERFIT_NETWORK_SLOPES_H

#include "network_balance.h"

/* Whether a number enters the laws of oil and gas; what does not is left out of the sums. */
static inline int moves_pressures(int place)
{
    return place == DF_NUMBER_K || place == DF_NUMBER_PHI || place == DF_NUMBER_P_0 ||
           place == DF_NUMBER_GAMMA || place == DF_NUMBER_V_GAS;
}

/* Derivatives of the three pressures by a number at constant masses. */
void df_pressures_by(const df_network *q, const df_network_balance *b, double s, int place, double P[3]);

/* Friction while it slides. What it has more at rest goes with the speed that the rig drives, not with
 * the piston's own: a friction that falls with that would let a piston without mass jump. */
static inline double rubbing(const df_network *q, double v, double P1)
{
    const double breakaway = q->numbers[DF_NUMBER_BREAKAWAY], v_s = q->numbers[DF_NUMBER_STRIBECK];
    const double sliding = q->numbers[DF_NUMBER_FRICTION] + q->numbers[DF_NUMBER_PRESSED] * P1;
    return breakaway > 0.0 ? sliding + breakaway * exp(-(v / v_s) * (v / v_s)) : sliding;
}

/* The speed up to which Coulomb's friction turns: its own, or what the solver needs. */
static inline double turning_band(const df_network *q, double dead_band)
{
    return larger(q->numbers[DF_NUMBER_TURNING], dead_band);
}

/* Slope of its share by its own. */
static inline double grip_by_turning(const df_network *q, double v, double dead_band)
{
    const double own = q->numbers[DF_NUMBER_TURNING];
    return own > dead_band && fabs(v) < own && !(q->numbers[DF_NUMBER_PRESLIDING] > 0.0) ? -v / (own * own) : 0.0;
}

/* Derivative of friction while it slides by a number, with the pressure held. */
double df_rubbing_by(const df_network *q, double v, double P1, int place);

/* Slope of a way's flow by a number of its law, along the pair. */
DF_FOR_EACH_KIND double flow_by(const df_network *q, const int kind, const df_flows *f, const df_touch *touch)
{
    const double w = f->w[touch->way];
    if (kind & DF_IS_PURDY || q->plan.ways[touch->way].kind != DF_COMPOSED)
        return touch->term == DF_OPENING ? -copysign(f->g[touch->way], w) : touch->times * w;
    if (w == 0.0)
        return 0.0;
    const double slope = f->whole[touch->way].by[touch->term];
    return w > 0.0 ? slope : -slope;
}

/* dF/d(number) at constant masses, and that of the mounting's balance of forces. */
DF_FOR_EACH_KIND void balance_by(const df_network *q, const int kind, const df_network_balance *b, const df_flows *f,
                                 double s, double v, int place, double F[DF_STATES])
{
    double P[3] = {0.0, 0.0, 0.0};
    F[0] = F[1] = F[DF_PISTON] = 0.0;
    if (place >= DF_FIRST_PASSAGE_NUMBER) {
        for (int k = q->plan.touched[place]; k < q->plan.touched[place + 1]; k++) {
            const df_touch *touch = &q->plan.touches[k];
            const double w = flow_by(q, kind, f, touch);
            F[0] += q->plan.ways[touch->way].out[0] * w;
            F[1] += q->plan.ways[touch->way].out[1] * w;
        }
        return; /* all that a passage does at the mounting goes by the oil */
    }
    if (moves_pressures(place)) {
        df_pressures_by(q, b, s, place, P);
        const double w12 = f->G[DF_1_2] * (P[0] - P[1]);
        F[0] = -f->G[DF_1_3] * (P[0] - P[2]) - w12;
        F[1] = kind & DF_HAS_FLOATING_PISTON ? 0.0 : w12 - f->G[DF_2_3] * (P[1] - P[2]);
    }
    if (!(kind & DF_IS_ELASTIC))
        return;
    F[DF_PISTON] = -oil_force(q, P) - q->numbers[DF_NUMBER_PRESSED] * b->grip * P[0];
    F[DF_PISTON] -= b->grip * df_rubbing_by(q, v, b->P[0], place);
    if (place == DF_NUMBER_DRAG)
        F[DF_PISTON] -= b->speed;
    else if (place == DF_NUMBER_TURNING)
        F[DF_PISTON] -= b->rub * b->grip_by_turning;
    else if (place == DF_NUMBER_STIFFNESS)
        F[DF_PISTON] += b->beyond;
    else if (place == DF_NUMBER_PLAY && b->beyond != 0.0)
        F[DF_PISTON] -= 0.5 * copysign(q->numbers[DF_NUMBER_STIFFNESS], b->beyond);
    else if (place == DF_NUMBER_RUBBER)
        F[DF_PISTON] += b->bend;
}

#endif
