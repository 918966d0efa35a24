"""Where a fit of real valves starts: the valves read off the loops, and guesses beside them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from damperfit.damper.load_cell import before_load_cell
from damperfit.damper.network import BLEEDS, BLOW_OFFS
from damperfit.damper.valve_curves import Side, loop_of, read_valves

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from damperfit.damper.model import Values
    from damperfit.damper.network import Valve
    from damperfit.damper.valve_curves import Loop, ValveCurve, ValveReading
    from damperfit.damper.valve_dampers import ValveDamper
    from damperfit.recording import Trace

__all__ = ["sides", "valve_points", "valve_starts", "within_plausible"]

# Openings tried beside those read, in shares of the largest pressure: rebound, compression.
_GUESSES = ((0.35, 0.35), (0.75, 0.35), (0.35, 0.75), (0.75, 0.75))
_HALF = 0.5  # of the flow at the opening goes through the bleed, in a guess
# A bleed never starts with less than this share of its stroke's flow, and a blow-off's conductance
# never with less than this share of what would carry all of it: what is absent at the start cannot
# be found by a descent.
_LEAST = 0.1
# A blow-off whose port was read off the loops: share of the port's pressure at the largest flow.
_BESIDE_A_PORT = 0.1
# By how much more a blow-off that lifts further lets through at the highest pressure, in a guess.
_LIFTED = 0.3
_PLAY, _LAG, _MASS, _DRAG, _FRICTION = 3e-4, 5e-3, 0.5, 10.0, 0.01
# What few logs tell, where it is freed. A few steps from a turning speed of 1 mm/s do not show one
# of 18 mm/s, for friction that turns so early hardly changes with it.
_RARE = {
    "free_gas": 5e-3, "presliding": 3e-5, "breakaway": 10.0, "stribeck_speed": 0.02,
    "seal_area": 3e-6, "turning_speed": 1e-2,
}  # fmt: skip
# Offset, N, and share of half the force's range that is friction, at which the loops are read. Of
# themselves they take hardly any friction, with which a weak stroke is read wrong: seals have 3 to
# 8 %, at soft settings 15. Without an offset it is the one at which they fit best, but behind a
# nearly closed bleed the preload of one stroke passes for an offset, a fifth of the force.
_READ_AT = ((None, 0.05), (None, 0.025), (0.0, 0.05), (0.0, 0.025), (0.0, 0.15))
# Softest and stiffest mounting, N/m, and oil, Pa, that a start has.
_STIFFNESS, _OIL = (5e4, 5e6), (5e7, 3e9)

# What draws oil through a return check in rebound and in bump: it costs force by the speed.
_FILLED = {
    "twin_tube": ("rod_area", "annulus_area"),
    "through_flow": ("piston_area", "annulus_area"),
}


def valve_starts(
    damper: ValveDamper, traces: Sequence[Trace], fixed: Mapping[str, float]
) -> tuple[Values, ...]:
    """Return starting points for the logs of one setting, that of the loops first.

    Parameters
    ----------
    damper : ValveDamper
        The damper.
    traces : sequence of Trace
        Logs of one setting.
    fixed : mapping of str to float
        What is held.
    """
    return tuple(
        within_plausible(damper, one, fixed) for one in valve_points(damper, traces, fixed)
    )


def valve_points(
    damper: ValveDamper, traces: Sequence[Trace], fixed: Mapping[str, float]
) -> list[dict[str, float]]:
    """Return the same points by name, whatever of it the damper has."""
    loops = _loops(damper, traces)
    half = 0.5 * max(float(np.ptp(loop.force)) for loop in loops)
    readings = [
        read_valves(
            loops,
            *sides(damper, fixed),
            offset=offset,
            friction=friction,
        )
        for offset, friction in dict.fromkeys(
            (fixed.get("f_0", offset), fixed.get("f_f", share * half)) for offset, share in _READ_AT
        )
    ]
    points = [
        _general(damper, one, traces) | _valves(damper, one, traces, None) for one in readings
    ]
    points += [points[0] | _valves(damper, readings[0], traces, guess) for guess in _GUESSES]
    return points


def _loops(damper: ValveDamper, traces: Sequence[Trace]) -> list[Loop]:
    mass = damper.mounting.moving_mass
    known = 0.0 if isinstance(mass, str) else float(mass)
    return [
        loop_of(
            before_load_cell(trace, moving_mass=known),
            damper.filled_to(trace.gas_pressure).rest_force(trace.displacement),
        )
        for trace in traces
    ]


def sides(damper: ValveDamper, fixed: Mapping[str, float]) -> tuple[Side, Side]:
    """Return what presses through the rebound valve and through that of compression."""
    rebound, compression = damper.pressed_areas
    known = {one.name: one.default for one in damper.quantities}.get("return_slope")
    resistance = fixed.get("return_slope", known or 0.0) * damper.oil_density
    filled = [getattr(damper, name) for name in _FILLED.get(damper.name, ())] or [0.0, 0.0]
    return (
        Side(rebound, resistance * filled[0] ** 2),
        Side(compression, resistance * filled[1] ** 2),
    )


def _general(
    damper: ValveDamper, reading: ValveReading, traces: Sequence[Trace]
) -> dict[str, float]:
    """Everything but the valves."""
    force = np.concatenate([trace.force[trace.compared] for trace in traces])
    area, length = damper.annulus_area, damper.chamber_1_length
    give = max(reading.rebound.compliance / area**2, 1e-12)
    oil = length / (area * 1e9)  # what the oil alone gives, m/N
    stiffness = 1.0 / max(give - oil, 0.1 * give)
    return {
        "f_f": max(reading.friction, _FRICTION * float(np.std(force))),
        "f_0": reading.offset,
        "k_e": float(np.clip(length / (area * give), *_OIL)),
        "k_s": float(np.clip(stiffness, *_STIFFNESS)),
        "play": _PLAY,
        "lag": _LAG,
        "moving_mass": _MASS,
        "drag": _DRAG,
        **_RARE,
    }


def _valves(
    damper: ValveDamper,
    reading: ValveReading,
    traces: Sequence[Trace],
    guess: tuple[float, float] | None,
) -> dict[str, float]:
    speed = max(float(np.max(np.abs(t.velocity[t.compared]))) for t in traces)
    found: dict[str, float] = {}
    strokes = (("rebound", damper.rebound), ("compression", damper.compression))
    for k, ((stroke, valve), side) in enumerate(zip(strokes, sides(damper, {}), strict=True)):
        curve = getattr(reading, stroke)
        share = None if guess is None else guess[k]
        parts = _parts(valve, curve, side.area * speed, damper.oil_density, share)
        found |= {f"{stroke}_{part}": value for part, value in parts.items()}
    return found


def _parts(
    valve: Valve, curve: ValveCurve, most: float, density: float, share: float | None
) -> dict[str, float]:
    """Return the numbers of a valve's parts; the largest flow is in m3/s."""
    top = max(curve.highest, 1e4)
    opening = curve.opening if share is None else share * top
    opening = min(max(opening, 0.02 * top), top)
    if share is None:
        root, conductance = curve.root, curve.conductance
    else:
        root = _HALF * most / math.sqrt(opening)
        conductance = _HALF * most / max(top - opening, 0.1 * top)
    if valve.blow_off == "none":  # the bleed carries all
        root = most / math.sqrt(top)
    elif valve.bleed == "none":
        conductance = most / max(top - opening, 0.1 * top)
    root = max(root, _LEAST * most / math.sqrt(top))
    conductance = max(conductance, _LEAST * most / top)
    bleed = 1.0 / (density * root)
    leak = math.sqrt(opening) / (density * root)
    slope = 1.0 / (density * conductance)
    port = math.sqrt(0.1 * slope / (density * most))
    if valve.blow_off == "port" and share is None and (ported := curve.ported):
        through, opening, behind = ported
        bleed = 1.0 / (density * max(through, _LEAST * most / math.sqrt(top)))
        port = 1.0 / (density * behind)
        slope = _BESIDE_A_PORT * port**2 * density * most
    known = {
        "bleed": bleed,
        "leak": leak if valve.bleed == "leak" else 0.3 * leak,
        "opening": opening,
        "slope": slope,
        "port": port,
        "width": 0.1 * opening,
        "lift": _LIFTED / max(top - opening, 0.1 * top),
    }
    return {part: known[part] for part in (*BLEEDS[valve.bleed], *BLOW_OFFS[valve.blow_off])}


def within_plausible(
    damper: ValveDamper, point: Mapping[str, float], fixed: Mapping[str, float]
) -> Values:
    """Return values within the plausible ranges; what the damper has not is left out."""
    found: dict[str, float] = {}
    for one in damper.quantities:
        if one.name in fixed:  # also at 0, where a part is absent
            found[one.name] = fixed[one.name]
        elif one.name in point:
            found[one.name] = float(np.clip(point[one.name], *one.plausible))
        elif one.default is not None:
            found[one.name] = one.default
    return damper.values(found)
