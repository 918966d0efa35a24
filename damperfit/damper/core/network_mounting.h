/* The mounting and its friction: what holds the piston, and what friction remembers. */
#ifndef DAMPERFIT_NETWORK_MOUNTING_H
#define DAMPERFIT_NETWORK_MOUNTING_H

#include "network_slopes.h"

/* Dahl's friction, dz/dy = (1 - z sgn dy)/sigma, over a way without a turn; `turn` is the sign of a
 * way of no length. */
typedef struct {
    double z, left, turn; /* left: what is left of the start, by which it is forgotten */
} dahl;

static inline dahl dahl_after(double sigma, double z, double way, double turn)
{
    dahl d;
    d.turn = way != 0.0 ? copysign(1.0, way) : turn;
    d.left = exp(-fabs(way) / sigma);
    d.z = d.turn + (z - d.turn) * d.left;
    return d;
}

/* Its derivative where start, way and distance move. */
static inline double dahl_by(const dahl *d, double sigma, double z, double way, double z_by, double way_by, double sigma_by)
{
    return d->left * (z_by + (d->turn - z) * (d->turn * way_by / sigma - fabs(way) / (sigma * sigma) * sigma_by));
}

/* What a step begins with, as friction remembers it, and the speed of the rig at a stage. */
typedef struct {
    double y, grip, v, stretch, bend;
} memory;

/* The elastic mounting: stretch x - y beyond half the play, beside it what rubber holds, and friction by
 * the piston's speed. */
static inline void hold(const df_network *q, const df_options *o, double x, double y, double speed, const memory *from,
                 df_network_balance *b)
{
    const double stretch = x - y, sigma = q->numbers[DF_NUMBER_PRESLIDING];
    const double k = q->numbers[DF_NUMBER_STIFFNESS], half = 0.5 * q->numbers[DF_NUMBER_PLAY];
    const double rubber = q->numbers[DF_NUMBER_RUBBER], bend = q->numbers[DF_NUMBER_BEND];
    b->beyond = fabs(stretch) > half ? stretch - copysign(half, stretch) : 0.0;
    b->pull = k * b->beyond;
    b->pull_slope = b->beyond != 0.0 ? k : 0.0;
    if (rubber > 0.0) {
        const dahl d = dahl_after(bend, from->bend, stretch - from->stretch, copysign(1.0, from->v));
        b->bend = d.z;
        b->pull += rubber * d.z;
        b->pull_slope += rubber * (1.0 - d.turn * from->bend) * d.left / bend;
    }
    b->brake = q->numbers[DF_NUMBER_DRAG];
    b->rub = rubbing(q, from->v, b->P[0]);
    b->speed = speed;
    b->caught = b->grip_by_turning = 0.0;
    if (sigma > 0.0) {
        dahl d = dahl_after(sigma, from->grip, y - from->y, 0.0);
        if (d.turn == 0.0) /* to where the forces push it from here */
            d.turn = b->pull - oil_force(q, b->P) - q->rod_force - b->rub * d.z < 0.0 ? -1.0 : 1.0;
        b->grip = d.z;
        b->caught = b->rub * (1.0 - d.turn * from->grip) * d.left / sigma;
        return;
    }
    const double band = turning_band(q, o->dead_band);
    b->grip = df_friction_share(speed, band);
    b->grip_by_turning = grip_by_turning(q, speed, o->dead_band);
    if (fabs(speed) < band)
        b->brake += b->rub / band;
}

#endif
