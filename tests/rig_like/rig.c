/* A damper of passages on a rig, in small steps of the classic Runge-Kutta method: slow, obvious,
   and with nothing in common with the core. The rod has a mass, friction is a bristle that bends
   before it slides, oil holds free gas, and a passage may follow any power of its flow. Rubber in
   the mounting is a second bristle beside the spring: what it holds does not ask for the speed.

   State: oil masses of chambers 1 and 2, place and speed of the rod, bends of both bristles. */
#include <math.h>

enum { FROM, TO, TWO_WAY, OPENING, LINEAR, ROOT, COST, POWER, PASSAGE };
enum {
    ROD, BORE, LENGTH_1, LENGTH_2, DENSITY, GAS_PRESSURE, GAS_VOLUME, EXPONENT, AMBIENT, BULK,
    FREE_GAS, STIFFNESS, PLAY, END_DAMPING, MASS, FRICTION, BREAKAWAY, STRIBECK, SEAL, PRESLIDING,
    DRAG, FLOATING, RUBBER, RUBBER_BEND, NUMBERS
};
enum { M1, M2, Y, U, Z, BEND, STATES };

/* The root and the kink at D = p_open are rounded within so many pascals. */
static const double ROUND = 400.0;

static double beyond(double u)
{
    return u > 0.0 ? u * u / sqrt(u * u + ROUND * ROUND) : 0.0;
}

static double flow(const double *one, double drop)
{
    if (drop < 0.0)
        return one[TWO_WAY] > 0.0 ? -flow(one, -drop) : 0.0;
    double s = beyond(drop - one[OPENING]);
    if (s <= 0.0)
        return 0.0;
    if (one[COST] > 0.0)
        return pow(s / one[COST], 1.0 / one[POWER]);
    double a = one[LINEAR], b = one[ROOT];
    return 2.0 * s / (a + sqrt(a * a + 4.0 * b * b * s));
}

static double oil(double mass, double volume, const double *n)
{
    double rest = n[GAS_PRESSURE], bulk = n[BULK], phi = n[FREE_GAS];
    double s = volume * n[DENSITY] / mass;
    if (phi <= 0.0) {
        double p = bulk * (1.0 / s - 1.0) + rest;
        return p > 0.0 ? p : 0.0;
    }
    double b = 1.0 + rest / bulk - phi - s;
    return 0.5 * bulk * (b + sqrt(b * b + 4.0 * phi * rest / bulk));
}

/* Changes of the state, the pressures, and the pull of the mounting. */
static void rates(const double *state, double x, double v, const double *n, const double *ways,
                  int n_ways, double *change, double *p, double *pull)
{
    double a1 = n[BORE] - n[ROD], a2 = n[BORE], w[4] = {0};
    double y = state[Y], u = state[U], left;
    int floats = n[FLOATING] > 0.0;
    p[1] = oil(state[M1], a1 * (n[LENGTH_1] - y), n);
    left = state[M1] / n[DENSITY] - a1 * n[LENGTH_1];
    if (!floats)
        left += state[M2] / n[DENSITY] - a2 * n[LENGTH_2];
    p[3] = n[GAS_PRESSURE] *
           pow(n[GAS_VOLUME] / (n[GAS_VOLUME] + left + (floats ? a2 * y : 0.0)), n[EXPONENT]);
    p[2] = floats ? p[3] : oil(state[M2], a2 * (n[LENGTH_2] + y), n);
    for (int k = 0; k < n_ways; k++) {
        const double *one = ways + k * PASSAGE;
        int from = (int)one[FROM], to = (int)one[TO];
        double through = flow(one, p[from] - p[to]);
        w[from] -= through;
        w[to] += through;
    }
    double stretch = x - y, gap = 0.5 * n[PLAY];
    double over = stretch > gap ? stretch - gap : stretch < -gap ? stretch + gap : 0.0;
    *pull = over != 0.0 ? n[STIFFNESS] * over + n[END_DAMPING] * (v - u) : 0.0;
    change[BEND] = 0.0;
    if (n[RUBBER] > 0.0) {
        *pull += n[RUBBER] / n[RUBBER_BEND] * state[BEND];
        change[BEND] = v - u - fabs(v - u) / n[RUBBER_BEND] * state[BEND];
    }
    double slides = n[FRICTION] + n[SEAL] * p[1];
    if (n[STRIBECK] > 0.0)
        slides += n[BREAKAWAY] * exp(-(u / n[STRIBECK]) * (u / n[STRIBECK]));
    double hard = slides / n[PRESLIDING];
    double bend = u - fabs(u) / n[PRESLIDING] * state[Z];
    double rub = hard * state[Z] + 1.4 * sqrt(hard * n[MASS]) * bend + n[DRAG] * u;
    change[M1] = w[1];
    change[M2] = floats ? 0.0 : w[2];
    change[Y] = u;
    change[U] = (*pull - (p[1] * a1 - p[2] * a2 + n[ROD] * n[AMBIENT]) - rub) / n[MASS];
    change[Z] = bend;
}

/* x and v at n_samples + 1 places `interval` apart; out: pull, P1, P2, P3 at each of them. */
int rig_run(const double *n, const double *ways, int n_ways, const double *x, const double *v,
            int n_samples, double interval, int steps, double *out)
{
    double a1 = n[BORE] - n[ROD], p[4], pull;
    double level = n[ROD] * (n[AMBIENT] - n[GAS_PRESSURE]);
    double y = x[0] - level / n[STIFFNESS] + (level > 0.0 ? -0.5 : 0.5) * n[PLAY];
    double state[STATES] = {n[DENSITY] * a1 * (n[LENGTH_1] - y),
                            n[DENSITY] * n[BORE] * (n[LENGTH_2] + y), y, 0.0, 0.0, 0.0};
    double h = interval / steps, slope[4][STATES], at[STATES];
    for (int k = 0; k <= n_samples; k++) {
        rates(state, x[k], v[k], n, ways, n_ways, slope[0], p, &pull);
        out[4 * k] = pull;
        for (int j = 1; j < 4; j++)
            out[4 * k + j] = p[j];
        if (!(fabs(pull) < 1e8))
            return k + 1;
        if (k == n_samples)
            break;
        for (int step = 0; step < steps; step++) {
            static const double where[4] = {0.0, 0.5, 0.5, 1.0};
            for (int stage = 0; stage < 4; stage++) {
                double t = (step + where[stage]) / steps, r = 1.0 - t;
                /* Cubic Hermite piece of the displacement, straight line of the speed. */
                double place = r * r * (1.0 + 2.0 * t) * x[k] + t * t * (3.0 - 2.0 * t) * x[k + 1] +
                               interval * (t * r * r * v[k] - t * t * r * v[k + 1]);
                for (int j = 0; j < STATES; j++)
                    at[j] = state[j] + (stage ? where[stage] * h * slope[stage - 1][j] : 0.0);
                rates(at, place, r * v[k] + t * v[k + 1], n, ways, n_ways, slope[stage], p, &pull);
            }
            for (int j = 0; j < STATES; j++)
                state[j] += h / 6.0 *
                            (slope[0][j] + 2.0 * slope[1][j] + 2.0 * slope[2][j] + slope[3][j]);
        }
    }
    return 0;
}
