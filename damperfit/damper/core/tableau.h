/* TR-BDF2 as an implicit Runge-Kutta method: R. E. Bank et al., IEEE Trans. Electron Devices 32
 * (1985) 1992-2007, with the third-order error estimate of M. E. Hosea, L. F. Shampine, Appl.
 * Numer. Math. 20 (1996) 21-37. Order 2, L-stable, stiffly accurate, one diagonal coefficient.
 *
 * Third and fourth order methods of the same kind were measured on the standard test: they lose
 * their order at the reversals, took longer, and erred as much there.
 */
#ifndef DAMPERFIT_TABLEAU_H
#define DAMPERFIT_TABLEAU_H

#define DF_STAGES 3
#define DF_DIAGONAL 0.29289321881345254 /* 1 - sqrt(2)/2 */
#define DF_W 0.35355339059327379        /* sqrt(2)/4 */

static const double DF_C[DF_STAGES] = {0.0, 2.0 * DF_DIAGONAL, 1.0};
static const double DF_A[DF_STAGES][DF_STAGES] = {
    {0.0, 0.0, 0.0},
    {DF_DIAGONAL, DF_DIAGONAL, 0.0},
    {DF_W, DF_W, DF_DIAGONAL},
};
/* The error estimate, b - bhat, falls with the third power of the step. */
static const double DF_E[DF_STAGES] = {
    DF_W - (1.0 - DF_W) / 3.0,
    DF_W - (3.0 * DF_W + 1.0) / 3.0,
    DF_DIAGONAL - DF_DIAGONAL / 3.0,
};

#endif
