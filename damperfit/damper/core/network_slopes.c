/* What the body's own numbers do: to the pressures, and to friction. */
#include "network_slopes.h"

/* Derivative of an oil pressure by a number at constant mass. */
static double oil_pressure_by(const df_network *q, double P, int place)
{
    const double K = q->numbers[DF_NUMBER_K], P_0 = q->numbers[DF_NUMBER_P_0];
    const double phi = q->numbers[DF_NUMBER_PHI];
    double slope;
    if (!(P > 0.0))
        return 0.0; /* clamped */
    if (phi == 0.0 && place == DF_NUMBER_K)
        return (P - P_0) * q->plan.inverse_K;
    if (place == DF_NUMBER_K)
        slope = (P - P_0) / (K * K);
    else if (place == DF_NUMBER_PHI)
        slope = P_0 / P - 1.0;
    else if (place == DF_NUMBER_P_0)
        slope = 1.0 / K + phi / P;
    else
        return 0.0;
    return slope / (1.0 / K + phi * P_0 / (P * P));
}

static double gas_pressure_by(const df_network *q, double P3, double s, int place)
{
    const double V = q->numbers[DF_NUMBER_V_GAS];
    if (place == DF_NUMBER_P_0)
        return P3 / q->numbers[DF_NUMBER_P_0];
    if (place == DF_NUMBER_GAMMA)
        return -P3 * log1p(s / (q->rho_0 * V));
    if (place == DF_NUMBER_V_GAS)
        return P3 * q->numbers[DF_NUMBER_GAMMA] * (1.0 / V - 1.0 / (V + s / q->rho_0));
    return 0.0;
}

void df_pressures_by(const df_network *q, const df_network_balance *b, double s, int place, double P[3])
{
    P[0] = oil_pressure_by(q, b->P[0], place);
    P[2] = gas_pressure_by(q, b->P[2], s, place);
    P[1] = q->has_floating_piston ? P[2] : oil_pressure_by(q, b->P[1], place);
}

double df_rubbing_by(const df_network *q, double v, double P1, int place)
{
    const double v_s = q->numbers[DF_NUMBER_STRIBECK];
    if (place == DF_NUMBER_FRICTION)
        return 1.0;
    if (place == DF_NUMBER_PRESSED)
        return P1;
    if ((place != DF_NUMBER_BREAKAWAY && place != DF_NUMBER_STRIBECK) || !(v_s > 0.0))
        return 0.0;
    const double r = v / v_s, rest = exp(-r * r);
    return place == DF_NUMBER_BREAKAWAY ? rest : q->numbers[DF_NUMBER_BREAKAWAY] * rest * 2.0 * r * r / v_s;
}
