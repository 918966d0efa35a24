"""Forces at constant speed from the valves' laws alone: the twin of `damper.quasi_static`.

At constant speed each chamber lets out what its piston sweeps, rho_0 a v; the pressures at which
the passages carry that are found by brentq, chamber by chamber. Nothing is integrated, and nothing
is shared with the core.
"""

import math

from scipy.optimize import brentq

from tests.oracles.network import flow_through, law_of

_MOST = 1e9  # Pa


def _root(surplus, most):
    """Pressure at which nothing is left over; 0 where more is let out than the piston sweeps."""
    return 0.0 if surplus(0.0) >= 0 else brentq(surplus, 0.0, most, xtol=1e-3, rtol=1e-13)


def purdy_force(y, damper, v):
    """Force of the paper's damper at x = 0 without offset, N: theory.md, section 2."""
    rod = math.pi * damper.rod_diameter**2 / 4
    bore = math.pi * damper.piston_diameter**2 / 4
    annulus, rho, gas = bore - rod, damper.oil_density, damper.gas_pressure
    if v > 0:
        p1 = gas + (y.r_m1 * rho * annulus * v) ** 2
        p2 = max(0.0, gas - y.r_m3 * rho * bore * v)
    else:
        p1 = gas + (y.r_m1 * rho * rod * v) ** 2
        p2 = p1 - y.r_m2 * rho * bore * v
    return p1 * annulus - p2 * bore + math.copysign(y.f_f, v)


def steady_force(network, values, damper, v, *, ambient=101325.0):
    """Force of a network at x = 0 without offset, N; friction is Coulomb's, drag c v."""
    known = {"": 0.0} | values
    rod, bore = damper.rod_area, damper.piston_area
    gas = values.get("gas_pressure", damper.gas_pressure)
    swept = {1: damper.oil_density * (bore - rod) * v, 2: -damper.oil_density * bore * v}

    def leaving(chamber, pressures):
        total = 0.0
        for way in network.passages:
            if chamber in (way.start, way.end):
                drop = pressures[way.start] - pressures[way.end]
                flow = flow_through(drop, **law_of(way, known))
                total += flow if way.start == chamber else -flow
        return total

    def pressure_1(p2):
        return _root(lambda p: leaving(1, {1: p, 2: p2, 3: gas}) - swept[1], 10 * _MOST)

    def surplus_of_2(p2):
        return leaving(2, {1: pressure_1(p2), 2: p2, 3: gas}) - swept[2]

    p2 = gas if network.has_floating_piston else _root(surplus_of_2, _MOST)
    p1 = pressure_1(p2)
    friction = math.copysign(values.get("f_f", 0.0), v) + values.get("drag", 0.0) * v
    return p1 * (bore - rod) - p2 * bore + rod * ambient + friction
