/* Scatter of cycles, sums over strokes, steps and runs of a channel. No allocation, re-entrant. */
#include "repeats.h"

#include <math.h>
#include <string.h>

#include "cycles.h"

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

void df_cycle_means(size_t n, const double *y, size_t n_means, const double *boundaries,
                    double *means)
{
    double total = 0.0, before = 0.0;
    size_t reached = 0;
    for (size_t k = 0; k <= n_means; k++) {
        const size_t at = within(boundaries[k], 0, n - 2);
        const double u = boundaries[k] - (double)at;
        if (at < reached) { /* boundaries that do not rise begin anew */
            total = 0.0;
            reached = 0;
        }
        for (; reached < at; reached++)
            total += 0.5 * (y[reached] + y[reached + 1]);
        const double here = total + u * y[at] + 0.5 * u * u * (y[at + 1] - y[at]);
        if (k)
            means[k - 1] = (here - before) / (boundaries[k] - boundaries[k - 1]);
        before = here;
    }
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

double df_rough(size_t n, const double *y, double *scratch)
{
    enum { ORDER = 5 };
    if (n <= ORDER)
        return NAN;
    size_t left = n - 1;
    for (size_t k = 0; k < left; k++)
        scratch[k] = y[k + 1] - y[k];
    for (int order = 1; order < ORDER; order++) {
        left--;
        for (size_t k = 0; k < left; k++)
            scratch[k] = scratch[k + 1] - scratch[k];
    }
    for (size_t k = 0; k < left; k++)
        scratch[k] = fabs(scratch[k]);
    const double above = df_rank(left, scratch, left / 2);
    if (left % 2)
        return above;
    double below = scratch[0];
    for (size_t k = 1; k < left / 2; k++)
        below = scratch[k] > below ? scratch[k] : below;
    return 0.5 * (above + below);
}

enum { DIGIT = 11, DIGITS = 6, PLACES = 1 << DIGIT };

/* Bits that sort as the doubles do: of negative ones all are turned, of others the sign. */
static uint64_t key_of(double value)
{
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    return bits >> 63 ? ~bits : bits | (uint64_t)1 << 63;
}

void df_sort(size_t n, double *values, double *room)
{
    size_t counts[DIGITS][PLACES];
    memset(counts, 0, sizeof counts);
    for (size_t k = 0; k < n; k++) {
        const uint64_t key = key_of(values[k]);
        for (int digit = 0; digit < DIGITS; digit++)
            counts[digit][key >> (DIGIT * digit) & (PLACES - 1)]++;
    }
    double *from = values, *to = room;
    for (int digit = 0; digit < DIGITS; digit++) {
        size_t before = 0, *count = counts[digit];
        if (n && count[key_of(from[0]) >> (DIGIT * digit) & (PLACES - 1)] == n)
            continue; /* the same in all */
        for (int place = 0; place < PLACES; place++) {
            const size_t here = count[place];
            count[place] = before;
            before += here;
        }
        for (size_t k = 0; k < n; k++)
            to[count[key_of(from[k]) >> (DIGIT * digit) & (PLACES - 1)]++] = from[k];
        double *other = from;
        from = to;
        to = other;
    }
    if (from != values)
        memcpy(values, from, n * sizeof *values);
}

double df_step(size_t n, const double *order, double bar, double *scratch)
{
    enum { SHARE = 50 };
    size_t found = 0;
    for (size_t k = 1; k < n; k++) {
        const double step = order[k] - order[k - 1];
        scratch[found] = step;
        found += step > bar;
    }
    return found ? df_rank(found, scratch, found / SHARE) : 0.0;
}

size_t df_equal_runs(size_t n, const double *y, size_t fewest, int64_t *begins, int64_t *ends)
{
    size_t found = 0, first = 0;
    for (size_t k = 1; k <= n; k++) {
        if (k < n && y[k] == y[first])
            continue;
        if (k - first >= fewest) {
            begins[found] = (int64_t)first;
            ends[found++] = (int64_t)k;
        }
        first = k;
    }
    return found;
}
