/* The mass balances without an integrator, with every first derivative: for a solver that is not
 * ours. The law is balance.h, as in stepper.c. */
#include "balance.h"

int df_evaluate(const df_run *run, double m1, double m2, double x, df_rates *rates)
{
    const df_problem *q = &run->q;
    df_gas_point gas = run->gas;
    chambers c;
    df_balance b;
    c.gas = &gas;
    const int code = chamber_stiffness(q, x, &c);
    if (code != DF_OK)
        return code;
    if (!isfinite(m1) || !isfinite(m2))
        return DF_NOT_FINITE;
    const df_masses m = {q->m_10 + m1, q->m_20 + m2};
    const double s = (m.m1 - q->m_10) + (m.m2 - q->m_20);
    if (!df_gas_is_near(&gas, s) && df_gas_expand(&q->g, &q->p, s, &gas))
        return DF_CHAMBER_EMPTY;
    evaluate(q, &c, m, &b);
    /* At constant mass a chamber that shrinks is pressed: d(k m)/dx = k m (area/V). */
    const double V1 = q->g.V_10 - x * q->g.a_p1, V2 = q->g.V_20 + x * q->g.a_p2;
    const double P1_by_x = b.d1 * m.m1 * (q->g.a_p1 / V1), P2_by_x = -b.d2 * m.m2 * (q->g.a_p2 / V2);
    const double y1 = b.root.slope * q->inverse_R1, y2 = b.check2.slope * q->inverse_R2;
    const double y3 = b.check3.slope * q->inverse_R3, w2_by_x = y2 * (P2_by_x - P1_by_x);
    rates->rates[0] = b.F1;
    rates->rates[1] = b.F2;
    rates->by_mass[0][0] = b.J11;
    rates->by_mass[0][1] = b.J12;
    rates->by_mass[1][0] = b.J21;
    rates->by_mass[1][1] = b.J22;
    rates->by_x[0] = -y1 * P1_by_x + w2_by_x;
    rates->by_x[1] = -w2_by_x - y3 * P2_by_x;
    rates->pressures[0] = b.P1;
    rates->pressures[1] = b.P2;
    rates->pressures[2] = b.P3;
    rates->free[0] = b.free1;
    rates->free[1] = b.free2;
    const double by_mass[3][2] = {{b.d1, 0.0}, {0.0, b.d2}, {b.d3, b.d3}};
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 2; k++)
            rates->pressures_by_mass[i][k] = by_mass[i][k];
    rates->pressures_by_x[0] = P1_by_x;
    rates->pressures_by_x[1] = P2_by_x;
    rates->pressures_by_x[2] = 0.0;
    for (int k = 0; k < DF_N_PARAMETERS; k++) {
        double *P = rates->pressures_by_parameter[k];
        df_masses F = {0.0, 0.0};
        P[0] = P[1] = P[2] = 0.0;
        if (k != DF_F_F && k != DF_F_0) {
            F = balance_slopes(q, &b, s, k);
            pressure_slopes(q, &b, s, k, &P[0], &P[1], &P[2]);
        }
        rates->by_parameter[k][0] = F.m1;
        rates->by_parameter[k][1] = F.m2;
    }
    return DF_OK;
}
