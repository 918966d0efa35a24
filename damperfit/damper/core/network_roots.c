/* Newton along the roots: what is asked where a correction is far from the last. */
#include "network_stage.h"

/* How D between two chambers goes with the states. */
static void slopes_of_pair(const df_network *q, const df_network_balance *b, int pair, double row[DF_STATES])
{
    const int from = pair == DF_2_3 ? 1 : 0, to = pair == DF_1_2 ? 1 : 2;
    for (int j = 0; j < DF_STATES; j++)
        row[j] = slope_of(q, b, from, j) - slope_of(q, b, to, j);
}

/* What the correction changes of a pair's D. */
static double change_of(const double row[DF_STATES], const double e[DF_STATES])
{
    return row[0] * e[0] + row[1] * e[1] + row[DF_PISTON] * e[DF_PISTON];
}

/* The way with an orifice that the correction turns most, not between the chambers of `but`; -1: none. */
static int most_turned(const df_network *q, const df_flows *f, const double change[DF_PAIRS], int but)
{
    double most = 0.02;
    int best = -1;
    for (int pair = 0; pair < DF_PAIRS; pair++) {
        if (pair == but)
            continue;
        for (int k = q->plan.first[pair]; k < q->plan.first[pair + 1]; k++) {
            const df_passage_law *law = &q->plan.ways[k].law;
            const double u = fabs(f->D[pair]) - law->of[DF_OPENING], share = fabs(change[pair]) / (fabs(u) + q->rounding);
            if (law->of[DF_S] > 0.0 && f->g[k] != 0.0 && share > most) {
                most = share;
                best = k;
            }
        }
    }
    return best;
}

/* By how much more D must change for the flow of a way to change as the correction has it; 0 in
 * `found` where it is about to close, for nothing is curved on that side. */
static double more_along_the_root(const df_network *q, const df_flows *f, int k, double change, int *found)
{
    const df_way *way = &q->plan.ways[k];
    const double D = f->D[way->pair], w = f->w[k] + f->g[k] * change;
    *found = way->turn == 0.0 ? !(way->law.of[DF_OPENING] > 0.0 && w * f->w[k] <= 0.0) : w * way->turn > 0.0;
    return df_passage_drop(&way->law, w, q->rounding) - D - change;
}

void df_follow_the_roots(const df_network *q, const df_network_balance *b, const df_flows *f, double e[DF_STATES])
{
    double row[DF_PAIRS][DF_STATES], change[DF_PAIRS], more[2] = {0.0, 0.0};
    int pairs[2] = {-1, -1}, n = 0;
    for (int pair = 0; pair < DF_PAIRS; pair++) {
        slopes_of_pair(q, b, pair, row[pair]);
        change[pair] = change_of(row[pair], e);
    }
    while (n < n_oil(q)) {
        const int k = most_turned(q, f, change, pairs[0]);
        int found = k >= 0;
        if (found)
            more[n] = more_along_the_root(q, f, k, change[q->plan.ways[k].pair], &found);
        if (!found)
            break;
        pairs[n++] = q->plan.ways[k].pair;
    }
    if (n == 2) {
        const double *one = row[pairs[0]], *two = row[pairs[1]];
        const double det = one[0] * two[1] - one[1] * two[0];
        if (fabs(det) > 1e-12 * (fabs(one[0] * two[1]) + fabs(one[1] * two[0]))) {
            e[0] += (more[0] * two[1] - more[1] * one[1]) / det;
            e[1] += (one[0] * more[1] - two[0] * more[0]) / det;
        }
    } else if (n == 1) {
        const double *one = row[pairs[0]];
        const int j = fabs(one[0]) >= fabs(one[1]) ? 0 : 1;
        if (one[j] != 0.0)
            e[j] += more[0] / one[j];
    }
}
