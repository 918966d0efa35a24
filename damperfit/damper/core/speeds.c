/* What signals are where a velocity passes given speeds. No allocation, no globals, re-entrant. */
#include "speeds.h"

void df_at_speeds(size_t n, const double *v, double sign, size_t n_speeds, const double *speeds,
                  size_t n_rows, const double *rows, double *counts, double *means, double *squares)
{
    for (size_t k = 0; k < 2 * n_speeds; k++)
        counts[k] = 0.0;
    for (size_t k = 0; k < 2 * n_speeds * n_rows; k++)
        means[k] = squares[k] = 0.0;
    size_t reached = 0; /* speeds that are not above the last velocity */
    for (size_t at = 0; at < n; at++) {
        const double ahead = sign * v[at];
        size_t now = reached;
        while (now < n_speeds && speeds[now] <= ahead)
            now++;
        while (now > 0 && speeds[now - 1] > ahead)
            now--;
        const int falls = now < reached;
        const size_t end = falls ? reached : now;
        for (size_t one = falls ? now : reached; at > 0 && one < end; one++) {
            const size_t place = (size_t)falls * n_speeds + one;
            const double before = sign * v[at - 1] - speeds[one];
            const double share = before / (before - (ahead - speeds[one]));
            counts[place] += 1.0;
            for (size_t row = 0; row < n_rows; row++) {
                const double *y = rows + row * n + at;
                double *mean = means + place * n_rows + row;
                const double there = y[-1] + share * (y[0] - y[-1]), off = there - *mean;
                *mean += off / counts[place];
                squares[place * n_rows + row] += off * (there - *mean);
            }
        }
        reached = now;
    }
}
