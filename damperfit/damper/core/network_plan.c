/* What is made of a network before it is stepped: whether it can be, and its passages by the chambers
 * that they join. */
#include "network_balance.h"

#include <float.h>

static df_passage_law law_of(const df_network *q, const df_passage *p)
{
    df_passage_law law = {{0.0}, p->two_way};
    for (int i = 0; i < DF_TERMS; i++)
        law.of[i] = number(q, p->places[i]);
    return law;
}

/* Whether a term beyond opening, R and S acts. */
static int is_bent(const df_passage_law *law)
{
    int n = 0;
    for (int i = DF_S + 1; i < DF_TERMS; i++)
        n += law->of[i] > 0.0;
    return n > 0;
}

static int passage_is_sound(const df_network *q, const df_passage *p)
{
    for (int i = 0; i < DF_TERMS; i++) {
        const int place = p->places[i];
        if (place >= q->n_numbers || (place >= 0 && place < DF_FIRST_PASSAGE_NUMBER))
            return 0;
        if (number(q, place) < 0.0)
            return 0;
    }
    const df_passage_law law = law_of(q, p);
    /* A rounded orifice would have an infinite slope at D = 0; one with a power is a blow-off. */
    if (!(law.of[DF_R] + law.of[DF_S] > 0.0) || (is_bent(&law) && !(law.of[DF_R] > 0.0)))
        return 0;
    if (p->from < 1 || p->from > 3 || p->to < 1 || p->to > 3 || p->from == p->to)
        return 0;
    return !q->has_floating_piston || p->from + p->to != 5; /* 2 and 3 are one */
}

static int is_sound(const df_network *q)
{
    const double *n = q->numbers;
    double all = q->rod_force;
    if (q->n_numbers < DF_FIRST_PASSAGE_NUMBER || q->n_numbers > DF_MOST_NUMBERS ||
        q->n_passages < 1 || q->n_passages > DF_MOST_PASSAGES)
        return 0;
    for (int i = 0; i < q->n_numbers; i++)
        all += n[i];
    if (!isfinite(all) || !(n[DF_NUMBER_K] > 0.0 && n[DF_NUMBER_PHI] >= 0.0 && n[DF_NUMBER_P_0] > 0.0 &&
                            n[DF_NUMBER_GAMMA] > 0.0 && n[DF_NUMBER_V_GAS] > 0.0 && q->rounding > 0.0 &&
                            n[DF_NUMBER_FRICTION] >= 0.0 && n[DF_NUMBER_STIFFNESS] >= 0.0 &&
                            n[DF_NUMBER_PLAY] >= 0.0 && n[DF_NUMBER_DRAG] >= 0.0 &&
                            n[DF_NUMBER_PRESLIDING] >= 0.0 && n[DF_NUMBER_BREAKAWAY] >= 0.0 &&
                            n[DF_NUMBER_STRIBECK] >= 0.0 && n[DF_NUMBER_PRESSED] >= 0.0 &&
                            n[DF_NUMBER_TURNING] >= 0.0 && n[DF_NUMBER_RUBBER] >= 0.0 &&
                            (n[DF_NUMBER_RUBBER] == 0.0 || n[DF_NUMBER_BEND] > 0.0) &&
                            (n[DF_NUMBER_BREAKAWAY] == 0.0 || n[DF_NUMBER_STRIBECK] > 0.0) &&
                            q->a_1 > 0.0 && q->a_2 > q->a_1 && q->rho_0 > 0.0))
        return 0;
    for (int k = 0; k < q->n_passages; k++) {
        if (!passage_is_sound(q, &q->passages[k]))
            return 0;
    }
    return 1;
}

static int pair_of(const df_passage *p)
{
    return p->from + p->to == 4 ? DF_1_3 : p->from + p->to == 3 ? DF_1_2 : DF_2_3;
}

static df_way way_of(const df_network *q, const df_passage *p)
{
    const df_passage_law law = law_of(q, p);
    df_way way = {law, DF_COMPOSED, pair_of(p), {-1.0, 0.0}, 0.0, DBL_MIN, 0.0, 0.0};
    if (way.pair == DF_2_3)
        way.out[0] = 0.0;
    if (way.pair != DF_1_3 && !q->has_floating_piston)
        way.out[1] = way.pair == DF_1_2 ? 1.0 : -1.0;
    if (!p->two_way)
        way.turn = p->from < p->to ? 1.0 : -1.0;
    if (law.of[DF_S] == 0.0 && !is_bent(&law)) {
        way.kind = DF_LEAK;
        way.inverse_R = 1.0 / law.of[DF_R];
    } else if (p->places[DF_R] < 0) {
        way.kind = DF_ORIFICE;
        way.inverse_S = 1.0 / law.of[DF_S];
        if (p->two_way && law.of[DF_OPENING] == 0.0)
            way.opens = 0.0; /* where its slope is finite too */
    }
    return way;
}

/* The ways that a number is of. */
static void touch(df_network *q, const int passage_of[DF_MOST_PASSAGES])
{
    df_plan *plan = &q->plan;
    int n = 0;
    for (int place = 0; place < q->n_numbers; place++) {
        plan->touched[place] = n;
        for (int k = 0; k < q->n_passages && place >= DF_FIRST_PASSAGE_NUMBER; k++) {
            const df_passage *p = &q->passages[passage_of[k]];
            const df_way *way = &plan->ways[k];
            for (int i = 0; i < DF_TERMS; i++) {
                const double inverse = i == DF_R ? way->inverse_R : i == DF_S ? way->inverse_S : 0.0;
                const df_touch touched = {k, (df_term)i, -inverse};
                if (p->places[i] == place)
                    plan->touches[n++] = touched;
            }
        }
    }
    plan->touched[q->n_numbers] = n;
}

/* Whether the passages are those of the paper, in whatever order. */
static int is_purdy(const df_network *q)
{
    const df_way *w = q->plan.ways;
    return q->n_passages == 3 && !q->has_floating_piston && w[0].pair == DF_1_3 && w[1].pair == DF_1_2 &&
           w[2].pair == DF_2_3 && w[0].kind == DF_ORIFICE && w[0].turn == 0.0 && w[1].kind == DF_LEAK &&
           w[1].turn < 0.0 && w[2].kind == DF_LEAK && w[2].turn < 0.0;
}

int df_plan_network(df_network *q)
{
    df_plan *plan = &q->plan;
    int passage_of[DF_MOST_PASSAGES] = {0}, n = 0;
    if (!is_sound(q))
        return DF_BAD_ARGUMENT;
    plan->is_elastic = q->numbers[DF_NUMBER_STIFFNESS] > 0.0;
    plan->has_gas_in_oil = q->numbers[DF_NUMBER_PHI] > 0.0;
    plan->oil[0] = q->rho_0 * q->V_1;
    plan->oil[1] = q->rho_0 * q->V_2;
    plan->swept[0] = q->rho_0 * q->a_1;
    plan->swept[1] = q->rho_0 * q->a_2;
    plan->inverse_K = 1.0 / q->numbers[DF_NUMBER_K];
    for (int pair = 0; pair < DF_PAIRS; pair++) {
        plan->first[pair] = n;
        for (int k = 0; k < q->n_passages; k++) {
            if (pair_of(&q->passages[k]) == pair) {
                plan->ways[n] = way_of(q, &q->passages[k]);
                passage_of[n++] = k;
            }
        }
    }
    plan->first[DF_PAIRS] = n;
    touch(q, passage_of);
    plan->is_purdy = is_purdy(q);
    return DF_OK;
}

int df_moves_the_state(const df_network *q, int place)
{
    if (place == DF_NUMBER_OFFSET)
        return 0;
    return is_elastic(q) || place < DF_NUMBER_FRICTION || place >= DF_FIRST_PASSAGE_NUMBER ||
           place == DF_NUMBER_P_0 || place == DF_NUMBER_GAMMA || place == DF_NUMBER_V_GAS;
}
