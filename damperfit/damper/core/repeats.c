/* Scatter of cycles, sums over strokes, steps and runs of a channel. No allocation, re-entrant. */
#include "repeats.h"

#include "cycles.h"
#include "taps.h"

#include <math.h>
#include <string.h>

enum { TAPS = 4 };

static size_t within(double value, size_t low, size_t high)
{
    /* So written, what is no number is the lowest. */
    return value > (double)low ? value < (double)high ? (size_t)value : high : low;
}

/* Of the cubic through four samples that stands at a place: the first, and the weights of all. */
static size_t read_at(double at, size_t n, double *w)
{
    const size_t from = within(at, 1, n - 3) - 1;
    const double u = at - (double)from - 1.0;
    w[0] = -u * (u - 1.0) * (u - 2.0) / 6.0;
    w[1] = (u + 1.0) * (u - 1.0) * (u - 2.0) / 2.0;
    w[2] = -(u + 1.0) * u * (u - 2.0) / 2.0;
    w[3] = (u + 1.0) * u * (u - 1.0) / 6.0;
    return from;
}

static void fold(size_t n, const double *y, size_t n_cycles, const double *starts, size_t n_phases,
                 const double *phases, double *folded, double *lags)
{
    for (int lag = 0; lag < DF_LAGS; lag++)
        lags[lag] = 0.0;
    for (size_t cycle = 0; cycle < n_cycles; cycle++) {
        const double length = starts[cycle + 1] - starts[cycle];
        double sums[DF_LAGS] = {0.0, 0.0, 0.0, 0.0}, w[TAPS];
        for (size_t k = 0; k < n_phases; k++) {
            const double *near = y + read_at(starts[cycle] + length * phases[k], n, w);
            sums[0] += w[0] * w[0] + w[1] * w[1] + w[2] * w[2] + w[3] * w[3];
            sums[1] += 2.0 * (w[0] * w[1] + w[1] * w[2] + w[2] * w[3]);
            sums[2] += 2.0 * (w[0] * w[2] + w[1] * w[3]);
            sums[3] += 2.0 * w[0] * w[3];
            folded[cycle * n_phases + k] =
                w[0] * near[0] + w[1] * near[1] + w[2] * near[2] + w[3] * near[3];
        }
        for (int lag = 0; lag < DF_LAGS; lag++)
            lags[lag] += sums[lag];
    }
}

double df_scatter(size_t n, const double *y, size_t n_cycles, const double *starts, size_t n_phases,
                  const double *phases, double *folded, double *lags)
{
    fold(n, y, n_cycles, starts, n_phases, phases, folded, lags);
    double total = 0.0;
    for (size_t k = 0; k < n_phases; k++) {
        double mean = 0.0, sum = 0.0;
        for (size_t cycle = 0; cycle < n_cycles; cycle++)
            mean += folded[cycle * n_phases + k];
        mean /= (double)n_cycles;
        for (size_t cycle = 0; cycle < n_cycles; cycle++) {
            const double off = folded[cycle * n_phases + k] - mean;
            sum += off * off;
        }
        total += sum / (double)(n_cycles - 1);
    }
    return total / (double)n_phases;
}

void df_beside(size_t n, const double *x, const double *v, const double *f, size_t n_cycles,
               const double *starts, size_t n_phases, double *products, double *room)
{
    double sums[DF_BESIDE][DF_BESIDE] = {{0.0}}, w[TAPS];
    double *read = room, *sampled = room + DF_BESIDE * n_cycles;
    for (size_t k = 0; k < n; k++) { /* side by side, for all four are read at each place */
        double *to = sampled + DF_BESIDE * k;
        to[0] = x[k];
        to[1] = v[k];
        to[2] = v[k] * fabs(v[k]);
        to[3] = f[k];
    }
    for (size_t k = 0; k < n_phases; k++) {
        const double phase = (double)k / (double)n_phases;
        double mean[DF_BESIDE] = {0.0};
        for (size_t cycle = 0; cycle < n_cycles; cycle++) {
            const double at = starts[cycle] + (starts[cycle + 1] - starts[cycle]) * phase;
            const double *near = sampled + DF_BESIDE * read_at(at, n, w);
            double *to = read + DF_BESIDE * cycle;
            for (int one = 0; one < DF_BESIDE; one++) {
                to[one] = w[0] * near[one] + w[1] * near[DF_BESIDE + one] +
                          w[2] * near[2 * DF_BESIDE + one] + w[3] * near[3 * DF_BESIDE + one];
                mean[one] += to[one];
            }
        }
        for (int one = 0; one < DF_BESIDE; one++)
            mean[one] /= (double)n_cycles;
        for (size_t cycle = 0; cycle < n_cycles; cycle++) {
            double off[DF_BESIDE];
            for (int one = 0; one < DF_BESIDE; one++)
                off[one] = read[DF_BESIDE * cycle + one] - mean[one];
            for (int one = 0; one < DF_BESIDE; one++)
                for (int other = 0; other < DF_BESIDE; other++)
                    sums[one][other] += off[one] * off[other];
        }
    }
    memcpy(products, sums, sizeof sums);
}

enum { N_OF, N_X, N_XX, N_U, N_UU, N_UUU, N_UUUU, N_XU, N_XUU, N_R, N_RX, N_RU, N_RUU, N_SUMS };

static int side_of(double v)
{
    return v > 0.0 ? 1 : v < 0.0 ? 2 : 0;
}

void df_strokes(size_t n, const double *x, const double *v, const double *f, double span,
                double fastest, const double *found, double *products, double *along)
{
    double of[3][N_SUMS] = {{0.0}};
    const double by_span = 1.0 / span, by_fastest = 1.0 / fastest;
    for (size_t k = 0; k < n;) {
        const int side = side_of(v[k]);
        const double sign = side == 1 ? 1.0 : side == 2 ? -1.0 : 0.0;
        const double level = found[0] + sign * found[2];
        const double first = side ? found[2 + side] : 0.0, second = side ? found[4 + side] : 0.0;
        double s[N_SUMS] = {0.0};
        for (; k < n && side_of(v[k]) == side; k++) {
            const double a = x[k] * by_span, u = v[k] * by_fastest, uu = u * u;
            const double r = f[k] - (level + found[1] * a + first * u + second * uu);
            s[N_OF] += 1.0;
            s[N_X] += a;
            s[N_XX] += a * a;
            s[N_U] += u;
            s[N_UU] += uu;
            s[N_UUU] += uu * u;
            s[N_UUUU] += uu * uu;
            s[N_XU] += a * u;
            s[N_XUU] += a * uu;
            s[N_R] += r;
            s[N_RX] += r * a;
            s[N_RU] += r * u;
            s[N_RUU] += r * uu;
        }
        for (int one = 0; one < N_SUMS; one++)
            of[side][one] += s[one];
    }
    double p[DF_STROKE_COLUMNS][DF_STROKE_COLUMNS] = {{0.0}};
    memset(along, 0, DF_STROKE_COLUMNS * sizeof *along);
    for (int side = 0; side < 3; side++) {
        const double *s = of[side];
        const double sign = side == 1 ? 1.0 : side == 2 ? -1.0 : 0.0;
        p[0][0] += s[N_OF];
        p[0][1] += s[N_X];
        p[0][2] += sign * s[N_OF];
        p[1][1] += s[N_XX];
        p[1][2] += sign * s[N_X];
        p[2][2] += sign * sign * s[N_OF];
        along[0] += s[N_R];
        along[1] += s[N_RX];
        along[2] += sign * s[N_R];
        if (!side)
            continue;
        const int one = 2 + side, two = 4 + side;
        p[0][one] = s[N_U];
        p[1][one] = s[N_XU];
        p[2][one] = sign * s[N_U];
        p[one][one] = s[N_UU];
        p[0][two] = s[N_UU];
        p[1][two] = s[N_XUU];
        p[2][two] = sign * s[N_UU];
        p[one][two] = s[N_UUU];
        p[two][two] = s[N_UUUU];
        along[one] = s[N_RU];
        along[two] = s[N_RUU];
    }
    for (int a = 0; a < DF_STROKE_COLUMNS; a++)
        for (int b = 0; b < DF_STROKE_COLUMNS; b++)
            products[DF_STROKE_COLUMNS * a + b] = a < b ? p[a][b] : p[b][a];
}

enum { DIGIT = 11, DIGITS = 6, PLACES = 1 << DIGIT };

void df_fold(size_t n, const double *const y[DF_FOLDED], size_t n_cycles, const double *starts, size_t n_phases,
             double *means, double *beside, double *room)
{
    for (size_t phase = 0; phase < n_phases; phase++) {
        const double share = (double)phase / (double)n_phases;
        double sums[DF_FOLDED] = {0.0}, squares = 0.0, weight[DF_TAPS];
        for (size_t cycle = 0; cycle < n_cycles; cycle++) {
            const size_t first = df_weigh_taps(n, starts[cycle] + (starts[cycle + 1] - starts[cycle]) * share, weight);
            for (size_t row = 0; row < DF_FOLDED; row++)
                sums[row] += room[cycle] = df_weighed(weight, y[row] + first); /* the last row's, the force, stays */
        }
        for (size_t row = 0; row < DF_FOLDED; row++)
            means[row * n_phases + phase] = sums[row] / (double)n_cycles;
        const double force = means[(DF_FOLDED - 1) * n_phases + phase];
        for (size_t cycle = 0; cycle < n_cycles; cycle++)
            squares += (room[cycle] - force) * (room[cycle] - force);
        beside[phase] = squares;
    }
}

/* Sums side by side: one waits for its own last sum alone. */
enum { SUMS = 8 };

/* Squares between these have lost no digit. */
#define TINY 1e-250
#define HUGE_SQUARE 1e250

static double product(size_t n, const double *a, const double *b)
{
    double sums[SUMS] = {0.0}, rest = 0.0;
    size_t k = 0;
    for (; k + SUMS <= n; k += SUMS)
        for (int l = 0; l < SUMS; l++)
            sums[l] += a[k + l] * b[k + l];
    for (; k < n; k++)
        rest += a[k] * b[k];
    for (int l = 0; l < SUMS; l++)
        rest += sums[l];
    return rest;
}

/* Also where squares overflow or vanish. */
static double length(size_t n, const double *a)
{
    const double squares = product(n, a, a);
    if (squares != squares || (squares > TINY && squares < HUGE_SQUARE))
        return sqrt(squares);
    double most = 0.0, sum = 0.0;
    for (size_t k = 0; k < n; k++)
        most = fabs(a[k]) > most ? fabs(a[k]) : most;
    if (!(most > 0.0 && most < INFINITY))
        return most;
    for (size_t k = 0; k < n; k++)
        sum += (a[k] / most) * (a[k] / most);
    return most * sqrt(sum);
}

void df_triangle(size_t n, size_t width, double *columns, double *triangle)
{
    for (size_t j = 0; j < width; j++) {
        double *v = columns + j * n + j + 1;
        const size_t below = n - j - 1;
        const double top = v[-1], size = length(below, v);
        const double diagonal = size == 0.0 ? top : -copysign(hypot(top, size), top);
        const double times = size == 0.0 ? 0.0 : (diagonal - top) / diagonal;
        for (size_t c = 0; c < j; c++)
            triangle[j * width + c] = 0.0;
        triangle[j * width + j] = diagonal;
        for (size_t k = 0; k < below && size != 0.0; k++)
            v[k] /= top - diagonal;
        for (size_t c = j + 1; c < width; c++) {
            double *y = columns + c * n + j;
            if (size != 0.0) {
                const double along = times * (y[0] + product(below, v, y + 1));
                y[0] -= along;
                for (size_t k = 0; k < below; k++)
                    y[k + 1] -= along * v[k];
            }
            triangle[j * width + c] = y[0];
        }
    }
}
