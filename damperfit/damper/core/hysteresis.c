/* One state integrated by an L-stable implicit Runge-Kutta method of two stages (SDIRK, second
 * order), with fixed parts of a sample: the springs here are stiff, the motion is smooth. The
 * sensitivities are those of the scheme itself, so that they are exact for the numbers it gives. */
#include "hysteresis.h"
#include "passages.h"

#include <math.h>

#define PARTS 4      /* of a sample */
#define GAMMA 0.2928932188134525 /* 1 - 1/sqrt(2) */
#define NEWTON_LIMIT 120
#define NEWTON_ALONE 10 /* then every other step halves: on a high power Newton's are short */
#define DONE 1e-13   /* of the speed or slope that is solved for, relative */

/* What drives the state at one instant. */
typedef struct {
    double x, v;
} instant;

/* ds/dt with its slopes by the state and by the numbers. */
typedef struct {
    double rate, by_state;
    double by_number[DF_MOST_STATE_NUMBERS];
} slope;

typedef void law(const void *model, instant at, double state, slope *out);

/* A stage: k with k = f(base + weight k). f falls or hardly rises with the state, so that the
 * difference has one root; bisection guards where the law bends. */
static int solve_stage(law *f, const void *model, instant at, double base, double weight,
                       double guess, slope *out)
{
    double low = -INFINITY, high = INFINITY, k = guess;
    for (int i = 0; i < NEWTON_LIMIT; i++) {
        f(model, at, base + weight * k, out);
        const double gap = k - out->rate;
        if (!isfinite(gap))
            return 0;
        if (fabs(gap) <= DONE * (fabs(k) + fabs(at.v)) || gap == 0.0)
            return 1;
        if (gap > 0.0)
            high = k;
        else
            low = k;
        const double steep = 1.0 - weight * out->by_state;
        double next = steep > 0.0 ? k - gap / steep : k - gap;
        const int is_between = isfinite(low) && isfinite(high);
        if (!(next > low && next < high) || (is_between && i > NEWTON_ALONE && i % 2))
            next = is_between ? 0.5 * (low + high) : k - gap;
        if (next == k)
            return 1;
        k = next;
    }
    return 1; /* what bisection leaves after fifty halvings is rounding */
}

/* dk/d(number) of a solved stage, where the base moves by `moved`. */
static double stage_slope(const slope *s, double weight, double moved, int number)
{
    return (s->by_state * moved + s->by_number[number]) / (1.0 - weight * s->by_state);
}

static int follow(law *f, const void *model, int n_numbers, const df_motion *m, double *states,
                  double *slopes, size_t *failed_sample)
{
    const double h = m->interval / PARTS;
    double s = 0.0, ds[DF_MOST_STATE_NUMBERS] = {0.0};
    slope one, two;
    states[0] = 0.0;
    for (int j = 0; j < n_numbers; j++)
        slopes[j] = 0.0;
    double k_1 = 0.0;
    for (size_t i = 0; i + 1 < m->n; i++) {
        *failed_sample = i;
        for (int part = 0; part < PARTS; part++) {
            const double a = (part + GAMMA) / PARTS, b = (part + 1.0) / PARTS;
            const double x = m->x[i], dx = m->x[i + 1] - x, v = m->v[i], dv = m->v[i + 1] - v;
            const instant first = {x + a * dx, v + a * dv}, last = {x + b * dx, v + b * dv};
            if (!solve_stage(f, model, first, s, GAMMA * h, k_1, &one))
                return DF_NOT_FINITE;
            k_1 = one.rate;
            const double base = s + (1.0 - GAMMA) * h * k_1;
            if (!solve_stage(f, model, last, base, GAMMA * h, k_1, &two))
                return DF_NOT_FINITE;
            s = base + GAMMA * h * two.rate;
            for (int j = 0; j < n_numbers; j++) {
                const double moved =
                    ds[j] + (1.0 - GAMMA) * h * stage_slope(&one, GAMMA * h, ds[j], j);
                ds[j] = moved + GAMMA * h * stage_slope(&two, GAMMA * h, moved, j);
            }
        }
        if (!isfinite(s))
            return DF_NOT_FINITE;
        states[i + 1] = s;
        for (int j = 0; j < n_numbers; j++)
            slopes[(i + 1) * (size_t)n_numbers + (size_t)j] = ds[j];
    }
    return DF_OK;
}

/* ---- elastic dashpot ---- */

static double number(const df_elastic_dashpot *d, int place)
{
    return place < 0 ? 0.0 : d->numbers[place];
}

/* Force of the spring beyond its play, and its slopes by extension and play. */
static double spring(const df_elastic_dashpot *d, double extension, double *by_extension,
                     double *by_stiffness, double *by_play)
{
    const double half = 0.5 * number(d, d->play), k = d->numbers[d->stiffness];
    double beyond = 0.0;
    if (extension > half)
        beyond = extension - half;
    else if (extension < -half)
        beyond = extension + half;
    *by_extension = beyond != 0.0 ? k : 0.0;
    *by_stiffness = beyond;
    *by_play = beyond > 0.0 ? -0.5 * k : beyond < 0.0 ? 0.5 * k : 0.0;
    return k * beyond;
}

/* The columns of oil on both sides of a piston off the middle of a tube are stiffer together. */
static double stiffening(const df_elastic_dashpot *d, double x, double *by_half_length)
{
    *by_half_length = 0.0;
    if (d->half_length < 0)
        return 1.0;
    const double l = d->numbers[d->half_length], q = l * l - x * x;
    *by_half_length = -2.0 * l * x * x / (q * q);
    return l * l / q;
}

static void add(double *by_number, int place, double value)
{
    if (place >= 0)
        by_number[place] += value;
}

/* Speed at which the dashpot yields to a force, with its slopes. */
static double yielding(const df_elastic_dashpot *d, double force, double *by_force, double *by_number)
{
    double speed = 0.0;
    *by_force = 0.0;
    for (int k = 0; k < d->n_paths; k++) {
        const df_path *p = &d->paths[k];
        const double sign = p->is_rebound ? 1.0 : -1.0;
        if (sign * force <= 0.0)
            continue;
        const df_passage_law l = {{number(d, p->p_open), number(d, p->R), number(d, p->S)}, 0};
        const df_flow w = df_passage_flow(&l, sign * force, d->rounding);
        speed += sign * w.w;
        *by_force += w.by_D;
        add(by_number, p->p_open, sign * w.by[DF_OPENING]);
        add(by_number, p->R, sign * w.by[DF_R]);
        add(by_number, p->S, sign * w.by[DF_S]);
    }
    return speed;
}

static void dashpot_law(const void *model, instant at, double state, slope *out)
{
    const df_elastic_dashpot *d = model;
    double by_extension, by_stiffness, by_play, by_force, by_length;
    const double force = spring(d, state, &by_extension, &by_stiffness, &by_play);
    for (int j = 0; j < d->n_numbers; j++)
        out->by_number[j] = 0.0;
    const double speed = yielding(d, force, &by_force, out->by_number);
    const double stiffer = stiffening(d, at.x, &by_length);
    for (int j = 0; j < d->n_numbers; j++)
        out->by_number[j] *= -stiffer;
    add(out->by_number, d->stiffness, -stiffer * by_force * by_stiffness);
    add(out->by_number, d->play, -stiffer * by_force * by_play);
    add(out->by_number, d->half_length, by_length * (at.v - speed));
    out->rate = stiffer * (at.v - speed);
    out->by_state = -stiffer * by_force * by_extension;
}

static int is_sound(const df_elastic_dashpot *d, const df_motion *m)
{
    if (d->n_numbers < 1 || d->n_numbers > DF_MOST_STATE_NUMBERS || d->n_paths > DF_MOST_PATHS ||
        !(m->interval > 0.0) || m->n < 1 || !(d->numbers[d->stiffness] > 0.0))
        return 0;
    for (int j = 0; j < d->n_numbers; j++)
        if (!(d->numbers[j] >= 0.0) || !isfinite(d->numbers[j]))
            return 0;
    for (int k = 0; k < d->n_paths; k++)
        if (number(d, d->paths[k].R) + number(d, d->paths[k].S) <= 0.0)
            return 0;
    if (d->half_length >= 0)
        for (size_t i = 0; i < m->n; i++)
            if (!(fabs(m->x[i]) < d->numbers[d->half_length]))
                return 0;
    return 1;
}

int df_follow_dashpot(const df_elastic_dashpot *d, const df_motion *m, double *force,
                      double *slopes, size_t *failed_sample)
{
    *failed_sample = m->n;
    if (!is_sound(d, m))
        return DF_BAD_ARGUMENT;
    const int code = follow(dashpot_law, d, d->n_numbers, m, force, slopes, failed_sample);
    if (code)
        return code;
    const size_t width = (size_t)d->n_numbers;
    for (size_t i = 0; i < m->n; i++) {
        double by_extension, by_stiffness, by_play;
        force[i] = spring(d, force[i], &by_extension, &by_stiffness, &by_play);
        for (size_t j = 0; j < width; j++)
            slopes[i * width + j] *= by_extension;
        add(slopes + i * width, d->stiffness, by_stiffness);
        add(slopes + i * width, d->play, by_play);
    }
    return DF_OK;
}

/* ---- Bouc and Wen ---- */

static void bouc_wen_law(const void *model, instant at, double z, slope *out)
{
    const double *q = model, size = fabs(z), v = at.v;
    const double rho = q[DF_RHO], sigma = q[DF_SIGMA], n = q[DF_EXPONENT];
    const double power = size > 0.0 ? pow(size, n) : 0.0, sign = z < 0.0 ? -1.0 : 1.0;
    const double grip = sigma * fabs(v) * sign - (sigma - 1.0) * v; /* times |z|^n */
    out->rate = rho * (v - grip * power);
    out->by_state = size > 0.0 ? -rho * grip * n * power / z : 0.0;
    out->by_number[DF_RHO] = v - grip * power;
    out->by_number[DF_SIGMA] = -rho * (fabs(v) * sign - v) * power;
    out->by_number[DF_EXPONENT] = size > 0.0 ? -rho * grip * power * log(size) : 0.0;
}

int df_follow_bouc_wen(const double numbers[DF_N_BOUC_WEN], const df_motion *m, double *z,
                       double *slopes, size_t *failed_sample)
{
    *failed_sample = m->n;
    if (!(numbers[DF_RHO] > 0.0) || !(numbers[DF_SIGMA] >= 0.5) || !(numbers[DF_EXPONENT] >= 1.0) ||
        !isfinite(numbers[DF_RHO] + numbers[DF_SIGMA] + numbers[DF_EXPONENT]) ||
        !(m->interval > 0.0) || m->n < 1)
        return DF_BAD_ARGUMENT;
    return follow(bouc_wen_law, numbers, DF_N_BOUC_WEN, m, z, slopes, failed_sample);
}
