"""A network of passages in plain words, slow and obvious: the twin of core/network.c.

Nothing is shared with the core: the law of a passage is solved from D = p_open + R w + (S w)^2 by
its quadratic, the state is integrated by SciPy's Radau.
"""

import math

import numpy as np
from scipy.integrate import solve_ivp


def flow_through(drop, *, opening, resistance, orifice, width, is_two_way, power=1.0):
    """Mass flow of one passage, kg/s."""
    if drop < 0 and is_two_way:
        law = {"opening": opening, "resistance": resistance, "orifice": orifice, "width": width}
        return -flow_through(-drop, **law, is_two_way=False, power=power)
    if width > 0:
        left = width * (
            np.logaddexp(0, (drop - opening) / width) - np.logaddexp(0, -opening / width)
        )
    else:
        left = drop - opening
    if left <= 0:
        return 0.0
    left = 1e6 * (left / 1e6) ** (1 / power)
    if orifice == 0:
        return left / resistance
    # S^2 w^2 + R w - left = 0, its positive root
    return (-resistance + math.sqrt(resistance**2 + 4 * orifice**2 * left)) / (2 * orifice**2)


def law_of(way, known):
    """The numbers of a passage, by what they are."""
    terms = ("opening", "resistance", "orifice", "width")
    law = {term: known[getattr(way, term)] for term in terms}
    return law | {"power": known[way.power] or 1.0, "is_two_way": way.is_two_way}


def oil_pressure(mass, volume, values, damper):
    rest, bulk, phi = values["gas_pressure"], values["k_e"], values["free_gas"]
    if phi == 0:
        return max(0.0, bulk * (mass / (damper.oil_density * volume) - 1) + rest)
    # 1 - (P - P_0)/K + phi (P_0/P - 1) = V rho_0/m, times P: a quadratic in P
    s = volume * damper.oil_density / mass
    middle = 1 + rest / bulk - phi - s
    return bulk / 2 * (middle + math.sqrt(middle**2 + 4 * phi * rest / bulk))


def pressures(masses, x, network, values, damper):
    rod, bore = damper.rod_area, damper.piston_area
    volume_1 = damper.chamber_1_length * (bore - rod) - x * (bore - rod)
    volume_2 = damper.chamber_2_length * bore + x * bore
    left_1 = masses[0] - damper.oil_density * damper.chamber_1_length * (bore - rod)
    left_2 = masses[-1] - damper.oil_density * damper.chamber_2_length * bore
    gas = values["gas_volume"]
    if network.has_floating_piston:
        now = gas + bore * x + left_1 / damper.oil_density
    else:
        now = gas + (left_1 + left_2) / damper.oil_density
    p3 = values["gas_pressure"] * (gas / now) ** values["gas_exponent"]
    p1 = oil_pressure(masses[0], volume_1, values, damper)
    p2 = p3 if network.has_floating_piston else oil_pressure(masses[-1], volume_2, values, damper)
    return p1, p2, p3


DEAD_BAND = 1e-4  # m/s, that of the core


def rub(values, v, p1):
    """Friction while it slides, N."""
    speed = values["stribeck_speed"]
    rest = values["breakaway"] * math.exp(-((v / speed) ** 2)) if speed else 0.0
    return values["f_f"] + rest + values["seal_area"] * p1


def speed_of(excess, friction, drag, band):
    """Speed at which friction and drag take the force that is left, m/s; drag must not be 0."""
    within = friction / band + drag
    if abs(excess) <= friction + drag * band:
        return excess / within
    return math.copysign((abs(excess) - friction) / drag, excess)


def pull_of(stretch, values):
    """Force of the mounting, N."""
    beyond = abs(stretch) - values["play"] / 2
    return math.copysign(values["k_s"] * max(0.0, beyond), stretch)


def solve(network, values, damper, motion, time, rtol=1e-9):
    """Force (n,) and pressures (3, n) at `time` for x(t), v(t) = motion, from x(time[0]) = 0."""
    absent = ("free_gas", "f_0", "presliding", "breakaway", "stribeck_speed", "seal_area")
    absent = (*absent, "turning_speed")
    values = dict.fromkeys(absent, 0.0) | values
    known = {"": 0.0} | values
    band = max(DEAD_BAND, values["turning_speed"])
    rod, bore = damper.rod_area, damper.piston_area
    n_oil = 1 if network.has_floating_piston else 2
    is_elastic = values["k_s"] > 0.0

    def oil_force(p):
        return p[0] * (bore - rod) - p[1] * bore + rod * network.ambient_pressure

    def rates(t, state):
        y = state[-1] if is_elastic else motion[0](t)
        p = pressures(state[:n_oil], y, network, values, damper)
        change = [0.0, 0.0, 0.0]
        for way in network.passages:
            w = flow_through(p[way.start - 1] - p[way.end - 1], **law_of(way, known))
            change[way.start - 1] -= w
            change[way.end - 1] += w
        rates = change[:n_oil]
        speed = motion[1](t)
        if is_elastic:
            excess = pull_of(motion[0](t) - y, values) - oil_force(p)
            friction = rub(values, speed, p[0])
            if values["presliding"]:  # what it has built up is known: the drag takes the rest
                speed = (excess - friction * state[n_oil]) / values["drag"]
            else:
                speed = speed_of(excess, friction, values["drag"], band)
        if values["presliding"]:
            grip = state[n_oil]
            rates.append((speed - abs(speed) * grip) / values["presliding"])
        return [*rates, speed] if is_elastic else rates

    start = [
        damper.oil_density * damper.chamber_1_length * (bore - rod),
        damper.oil_density * damper.chamber_2_length * bore,
    ][:n_oil]
    if values["presliding"]:
        start.append(0.0)
    if is_elastic:
        level = rod * (network.ambient_pressure - values["gas_pressure"])
        start.append(-level / values["k_s"] + values["play"] / 2)
    done = solve_ivp(
        rates,
        (time[0], time[-1]),
        start,
        method="Radau",
        t_eval=time,
        rtol=rtol,
        atol=rtol * 1e-2,
        max_step=2e-3,
    )
    assert done.success
    where = done.y[-1] if is_elastic else np.array([motion[0](t) for t in time])
    p = np.array(
        [
            pressures(m, at, network, values, damper)
            for m, at in zip(done.y[:n_oil].T, where, strict=True)
        ]
    ).T
    if is_elastic:
        stretch = [motion[0](t) - y for t, y in zip(time, where, strict=True)]
        return np.array([pull_of(u, values) for u in stretch]), p
    v = np.array([motion[1](t) for t in time])
    grip = done.y[n_oil] if values["presliding"] else np.clip(v / band, -1, 1)
    rubbed = np.array([rub(values, at, p1) for at, p1 in zip(v, p[0], strict=True)])
    return oil_force(p) + rubbed * grip + values["drag"] * v, p
