/* The paper's damper as the drivers have it: a network of three passages. */
#ifndef PAPER_H
#define PAPER_H

#include "network.h"

#include <string.h>

/* What the paper identifies, then the gas. */
typedef struct {
    double R_m1, R_m2, R_m3, K_e, f_f, f_0, P_0, gamma;
} paper_numbers;

enum { R_M1, R_M2, R_M3, K_E, F_F, F_0, P_0, GAMMA, N_PAPER };
enum { PAPER_NUMBERS = DF_FIRST_PASSAGE_NUMBER + 3 };
#define PAPER_GAS_VOLUME 6.28319e-5

/* Their places among the network's. */
static const int PLACES[N_PAPER] = {DF_FIRST_PASSAGE_NUMBER, DF_FIRST_PASSAGE_NUMBER + 1, DF_FIRST_PASSAGE_NUMBER + 2,
                                    DF_NUMBER_K, DF_NUMBER_FRICTION, DF_NUMBER_OFFSET, DF_NUMBER_P_0,
                                    DF_NUMBER_GAMMA};

static df_network paper(const paper_numbers *p)
{
    const double own[N_PAPER] = {p->R_m1, p->R_m2, p->R_m3, p->K_e, p->f_f, p->f_0, p->P_0, p->gamma};
    const df_passage ways[] = {{1, 3, {-1, -1, DF_FIRST_PASSAGE_NUMBER, -1, -1}, 1},
                               {2, 1, {-1, DF_FIRST_PASSAGE_NUMBER + 1, -1, -1, -1}, 0},
                               {3, 2, {-1, DF_FIRST_PASSAGE_NUMBER + 2, -1, -1, -1}, 0}};
    df_network q;
    memset(&q, 0, sizeof q);
    q.a_1 = 3.54411e-4;
    q.a_2 = 6.37940e-4;
    q.V_1 = 4.71367e-5;
    q.V_2 = 8.48460e-5;
    q.rho_0 = 770.0;
    q.rounding = 1.0;
    q.n_passages = 3;
    memcpy(q.passages, ways, sizeof ways);
    q.n_numbers = PAPER_NUMBERS;
    q.numbers[DF_NUMBER_V_GAS] = PAPER_GAS_VOLUME;
    for (int k = 0; k < N_PAPER; k++)
        q.numbers[PLACES[k]] = own[k];
    return q;
}

#endif
