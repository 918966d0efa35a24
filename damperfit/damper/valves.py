"""Valves read off the loops: flow against pressure without a law of the valve, and what follows.

In each stroke one valve is pressed through, by a piston of area a, so that its pressure is the
force itself, D = f'/a with f' the force without gas, offset and friction. What the piston displaces
goes through the valve or is taken up by what gives way (oil, hoses, rod ends: a compliance C)::

    a |v| - C dD/dt = c sqrt(D) + sum_j c_j max(0, D - p_j)

Non-negative least squares on a row of knees p_j gives all of them at once, without a start and
without a second minimum. The left side against D is the valve's characteristic: a bleed is its
root, a blow-off the knee where it turns upwards. Friction and offset are tried on a grid, which is
made finer once about the best; beside a fit they are the fit's, as are moving mass, the lag of the
force channel and the drag of the seals. Where the characteristic and the law part, the law is
wrong. The readings, and guesses beside them, are where a fit of valves starts.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from damperfit.damper.load_cell import OF_LOAD_CELL, before_load_cell
from damperfit.damper.network import PARTS, law_flow
from damperfit.damper.valve_dampers import STROKES

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from damperfit.damper.model import Values
    from damperfit.damper.network import Valve
    from damperfit.damper.valve_dampers import ValveDamper
    from damperfit.recording import Trace

    FloatArray = NDArray[np.float64]

# Shares of half the force's range. Seals have 1 to 15 %; a tare is about the rod's gas force.
_FRICTIONS = (0.005, 0.02, 0.05, 0.1, 0.16)
_OFFSETS = (-0.3, -0.15, -0.05, 0.0, 0.05, 0.15, 0.3)
_FINER = (-0.5, -0.25, 0.0, 0.25, 0.5)  # of the distance to the grid's neighbours
# Rows a stroke and log; a few hundred fix sixteen numbers.
_ROWS = 500
_KNEES = 14
_LOWEST_KNEE, _HIGHEST_KNEE = 0.05, 0.95
_AT = np.geomspace(_LOWEST_KNEE, _HIGHEST_KNEE, _KNEES)
# Knees below this share of the largest D are the bleed's: they bend it towards a straight line.
_OPENING_FROM = 0.2
# Without a knee: a blow-off from three quarters of the largest D on, with a tenth of the flow.
_UNSEEN_OPENING, _UNSEEN_SHARE = 0.75, 0.1
# A port through which less of the largest flow could go, without an opening before it, is none.
_LEAST_PORT = 0.05

_POINTS = 120  # of a law's curve

# Openings tried beside those read, in shares of the largest pressure: rebound, compression.
_GUESSES = ((0.35, 0.35), (0.75, 0.35), (0.35, 0.75), (0.75, 0.75))
_HALF = 0.5  # of the flow at the opening goes through the bleed, in a guess
# A bleed never starts with less than this share of its stroke's flow, and a blow-off's conductance
# never with less than this share of what would carry all of it: what is absent at the start cannot
# be found by a descent.
_LEAST = 0.1
# A blow-off whose port was read off the loops: share of the port's pressure at the largest flow.
_BESIDE_A_PORT = 0.1
_FRICTION = 0.01  # of the force's standard deviation, at least
# What few logs tell, where it is freed. A few steps from a turning speed of 1 mm/s do not show one
# of 18 mm/s, for friction that turns so early hardly changes with it.
_RARE = {
    "play": 3e-4, "lag": 5e-3, "moving_mass": 0.5, "drag": 10.0,
    "free_gas": 5e-3, "presliding": 3e-5, "breakaway": 10.0, "stribeck_speed": 0.02,
    "seal_area": 3e-6, "turning_speed": 1e-2, "rubber": 20.0, "rubber_bend": 3e-4,
}  # fmt: skip
# Offset, N, and share of half the force's range that is friction, at which the loops are read. Of
# themselves they take hardly any friction, with which a weak stroke is read wrong: seals have 3 to
# 8 %, at soft settings 15. Without an offset it is the one at which they fit best, but behind a
# nearly closed bleed the preload of one stroke passes for an offset, a fifth of the force.
_READ_AT = ((None, 0.05), (None, 0.025), (0.0, 0.05), (0.0, 0.025), (0.0, 0.15))
# Softest and stiffest mounting, N/m, and oil, Pa, that a start has.
_STIFFNESS, _OIL = (5e4, 5e6), (5e7, 3e9)


class Side(NamedTuple):
    """What presses through a valve."""

    area: float  # displaces the oil and carries the pressure, m2
    drag: float = 0.0  # force by the speed that other passages cost in this stroke, N s/m


class Loop(NamedTuple):
    """Samples of a log that are compared, without the gas's and the ambient pressure's force."""

    force: FloatArray  # shape (n,), N
    force_rate: FloatArray  # N/s
    velocity: FloatArray  # m/s


@dataclass(frozen=True, slots=True, eq=False)
class ValveCurve:
    """One valve as read off the loops."""

    drop: FloatArray  # shape (n,), D at the samples of its stroke, Pa
    flow: FloatArray  # a |v| - C dD/dt there, m3/s
    compliance: float  # C, m3/Pa
    root: float  # c, of the bleed, m3/(s sqrt(Pa))
    opening: float  # p_open of the blow-off, Pa
    conductance: float  # of the blow-off beyond its opening, m3/(s Pa)
    # Whether an opening was found; else it and its conductance are only a place to start from.
    has_knee: bool

    @property
    def highest(self) -> float:
        """Largest pressure across the valve, Pa."""
        return float(np.max(self.drop))

    @property
    def ported(self) -> tuple[float, float, float] | None:
        """The same flow as that of a bleed and of a port behind the opening: c, p_open and c_p.

        a |v| - C dD/dt = c sqrt(D) + sum_j c_j sqrt(max(0, D - p_j)), c_p the sum of the c_j. None
        where no port shows.
        """
        knees = self.highest * _AT
        columns = np.sqrt(np.maximum(self.drop[:, None] - np.append(0.0, knees), 0.0))
        root, *roots = _nonnegative(columns, self.flow)[0]
        port = float(np.sum(roots))
        if not port * math.sqrt(self.highest) > _LEAST_PORT * float(self.flow.max()):
            return None
        return float(root), float(roots @ knees) / port, port


class ValveReading(NamedTuple):
    """Both valves, and the friction and offset, N, at which they explain the loops best."""

    rebound: ValveCurve
    compression: ValveCurve
    friction: float
    offset: float


def loop_of(trace: Trace, level: FloatArray) -> Loop:
    """Return the compared samples of a log.

    The level, shape (n,), N, is what gas and ambient pressure alone do to the force at its samples.
    """
    force = trace.force - level
    rate = np.gradient(force, trace.interval)
    at = np.arange(len(force))[trace.compared]
    at = at[:: max(1, len(at) // (4 * _ROWS))]
    return Loop(force[at], rate[at], trace.velocity[at])


def read_valves(
    loops: Sequence[Loop],
    rebound: Side,
    compression: Side,
    *,
    offset: float | None = None,
    friction: float | None = None,
) -> ValveReading:
    """Return both valves of a setting, with the friction and offset at which its logs fit best.

    Offset and friction are given where they are known, N. A loop tells little of the friction
    beside a blow-off.
    """
    whole = Loop(*map(np.concatenate, zip(*loops, strict=True)))
    half = 0.5 * float(np.ptp(whole.force))
    sides = ((1.0, rebound), (-1.0, compression))

    def misfit(at: tuple[float, float]) -> tuple[float, float, float]:
        """That of the flows, each stroke's in units of its own."""
        rows = [_rows(whole, sign, side, *at) for sign, side in sides]
        return (sum(math.inf if of is None else of.solve()[1] for of in rows), *at)

    def best_of(frictions: Sequence[float], offsets: Sequence[float]) -> tuple[float, float]:
        return min(map(misfit, product(frictions, offsets)))[1:]

    offsets = [half * share for share in _OFFSETS] if offset is None else [offset]
    frictions = [half * share for share in _FRICTIONS] if friction is None else [friction]
    best, width = best_of(frictions, offsets), np.array(_FINER)
    if friction is None:
        frictions = (best[0] * (1.0 + width)).tolist()
    if offset is None:
        offsets = (best[1] + 0.1 * half * width).tolist()
    best = best_of(frictions, offsets)
    curves = [_curve(whole, sign, side, *best) for sign, side in sides]
    return ValveReading(curves[0], curves[1], *best)


class _Rows(NamedTuple):
    """The linear system of one stroke."""

    drop: FloatArray
    drop_rate: FloatArray
    displaced: FloatArray
    knees: FloatArray

    def solve(self) -> tuple[FloatArray, float]:
        """Return C, c and the c_j, and the misfit as a share of the flow's mean square."""
        columns = np.empty((len(self.drop), 2 + len(self.knees)))
        columns[:, 0] = self.drop_rate
        np.sqrt(self.drop, out=columns[:, 1])
        beyond = columns[:, 2:]
        np.subtract(self.drop[:, None], self.knees, out=beyond)
        np.maximum(beyond, 0.0, out=beyond)
        weights, rest = _nonnegative(columns, self.displaced)
        return weights, rest**2 / float(self.displaced @ self.displaced)


def _nonnegative(columns: FloatArray, flow: FloatArray) -> tuple[FloatArray, float]:
    """Non-negative least squares: what each column takes, and the length of what is left."""
    from scipy.optimize import nnls

    lengths = np.sqrt(np.maximum(np.einsum("ij,ij->j", columns, columns), 1e-300))
    columns /= lengths
    weights, rest = nnls(columns, flow)
    return weights / lengths, float(rest)


def _rows(loop: Loop, sign: float, side: Side, friction: float, offset: float) -> _Rows | None:
    """Return the rows of a stroke; None where it presses hardly anywhere."""
    moved = loop.force - offset - friction * np.sign(loop.velocity)
    drop = sign * moved / side.area - side.drag * np.maximum(sign * loop.velocity, 0.0) / side.area
    at = np.flatnonzero(drop > 0.0)
    at = at[:: max(1, len(at) // _ROWS)]
    if len(at) < 4 * _KNEES:
        return None
    drop = drop[at]
    rate, displaced = sign * loop.force_rate[at] / side.area, side.area * sign * loop.velocity[at]
    return _Rows(drop, rate, displaced, float(drop.max()) * _AT)


def _curve(loop: Loop, sign: float, side: Side, friction: float, offset: float) -> ValveCurve:
    """Return the valve of a stroke at a friction and offset."""
    rows = _rows(loop, sign, side, friction, offset)
    if rows is None:
        nothing = np.zeros(1)
        return ValveCurve(nothing, nothing, 0.0, 0.0, 0.0, 0.0, has_knee=False)
    weights, _ = rows.solve()
    compliance, root, turns = weights[0], weights[1], weights[2:]
    knees, top = rows.knees, float(np.max(rows.drop))
    is_opening = knees > _OPENING_FROM * top
    conductance = float(turns[is_opening].sum())
    has_knee = conductance > 0.0
    if has_knee:
        opening = float(turns[is_opening] @ knees[is_opening]) / conductance
    else:
        opening = _UNSEEN_OPENING * top
        flow = side.area * float(np.max(np.abs(loop.velocity)))
        conductance = _UNSEEN_SHARE * flow / (top - opening)
    # Up to the opening the lower knees are the bleed's too.
    low = float(turns[~is_opening] @ np.maximum(0.0, opening - knees[~is_opening]))
    return ValveCurve(
        drop=rows.drop,
        flow=rows.displaced - compliance * rows.drop_rate,
        compliance=float(compliance),
        root=float(root) + low / math.sqrt(opening),
        opening=opening,
        conductance=conductance,
        has_knee=has_knee,
    )


class ValveCharacteristic(NamedTuple):
    """One valve of a setting."""

    stroke: str  # "rebound" or "bump"
    area: float  # what presses oil through it, m2: a pressure times this is its force
    drop: FloatArray  # shape (n,), as measured, Pa
    flow: FloatArray  # shape (n,), m3/s
    law_drop: FloatArray  # shape (k,), the fitted law from nothing to the largest pressure measured
    law_flow: FloatArray
    opening: float | None  # p_open of its blow-off, Pa; None without one


def valve_characteristics(
    damper: ValveDamper, values: Values, traces: Sequence[Trace]
) -> tuple[ValveCharacteristic, ...]:
    """Return the valves of a setting by its logs; one that these hardly press is left out."""
    numbers = dict(values)
    of_cell = {name: numbers[name] for name in OF_LOAD_CELL if name in numbers}
    loops = [
        loop_of(before_load_cell(trace, **of_cell), damper.rest_force(trace.displacement))
        for trace in traces
    ]
    both = [Side(side.area, side.drag + numbers["drag"]) for side in _sides(damper, numbers)]
    reading = read_valves(loops, *both, offset=numbers["f_0"], friction=numbers["f_f"])
    read = []
    for stroke, side in zip(STROKES, both, strict=True):
        curve: ValveCurve = getattr(reading, stroke)
        valve: Valve = getattr(damper, stroke)
        if curve.highest <= 0.0:
            continue
        own = {part: numbers[f"{stroke}_{part}"] for part in valve.parts}
        # A bleed rises steeply from nothing: most points stand there.
        drop = curve.highest * np.linspace(0.0, 1.0, _POINTS) ** 2
        opening = own.get("opening")
        if opening is not None and opening < curve.highest:
            drop = np.sort(np.append(drop, opening))
        read.append(
            ValveCharacteristic(
                stroke="bump" if stroke == "compression" else stroke,
                area=side.area,
                drop=curve.drop,
                flow=curve.flow,
                law_drop=drop,
                law_flow=law_flow(own, drop, damper.oil_density),
                opening=opening,
            )
        )
    return tuple(read)


def valve_starts(
    damper: ValveDamper,
    traces: Sequence[Trace],
    fixed: Mapping[str, float],
    readings: Sequence[ValveReading] = (),
) -> tuple[Values, ...]:
    """Return starting points for the logs of one setting, that of the loops first.

    The readings are those of `read_loops`, where they are known.
    """
    points = valve_points(damper, traces, fixed, readings)
    return tuple(within_plausible(damper, point, fixed) for point in points)


def valve_points(
    damper: ValveDamper,
    traces: Sequence[Trace],
    fixed: Mapping[str, float],
    readings: Sequence[ValveReading] = (),
) -> list[dict[str, float]]:
    """Return the same points by name, whatever of it the damper has."""
    readings = readings or read_loops(damper, traces, fixed)
    speed = max(float(np.max(np.abs(t.velocity[t.compared]))) for t in traces)
    force = np.concatenate([trace.force[trace.compared] for trace in traces])
    least_friction = _FRICTION * float(np.std(force))
    area, length = damper.annulus_area, damper.chamber_1_length
    oil = length / (area * 1e9)  # what the oil alone gives, m/N

    def valves(reading: ValveReading, guess: Sequence[float | None]) -> dict[str, float]:
        numbers: dict[str, float] = {}
        for stroke, side, share in zip(STROKES, _sides(damper, {}), guess, strict=True):
            valve, curve = getattr(damper, stroke), getattr(reading, stroke)
            parts = _parts(valve, curve, side.area * speed, damper.oil_density, share)
            numbers |= {f"{stroke}_{part}": value for part, value in parts.items()}
        return numbers

    points = []
    for reading in readings:
        give = max(reading.rebound.compliance / area**2, 1e-12)
        stiffness = 1.0 / max(give - oil, 0.1 * give)
        beside = {
            "f_f": max(reading.friction, least_friction),
            "f_0": reading.offset,
            "k_e": float(np.clip(length / (area * give), *_OIL)),
            "k_s": float(np.clip(stiffness, *_STIFFNESS)),
        }
        points.append(beside | _RARE | valves(reading, (None, None)))
    return points + [points[0] | valves(readings[0], guess) for guess in _GUESSES]


def read_loops(
    damper: ValveDamper, traces: Sequence[Trace], fixed: Mapping[str, float]
) -> list[ValveReading]:
    """Return the valves as the loops show them: the same for every kind of valve in a layout."""
    mass = damper.mounting.moving_mass
    known = 0.0 if isinstance(mass, str) else float(mass)
    loops = []
    for trace in traces:
        level = damper.filled_to(trace.gas_pressure).rest_force(trace.displacement)
        loops.append(loop_of(before_load_cell(trace, moving_mass=known), level))
    half = 0.5 * max(float(np.ptp(loop.force)) for loop in loops)
    at = ((fixed.get("f_0", offset), fixed.get("f_f", share * half)) for offset, share in _READ_AT)
    return [
        read_valves(loops, *_sides(damper, fixed), offset=offset, friction=friction)
        for offset, friction in dict.fromkeys(at)
    ]


def _sides(damper: ValveDamper, fixed: Mapping[str, float]) -> tuple[Side, Side]:
    """Return what presses through the rebound valve and through that of compression."""
    drags = [0.0, 0.0]
    if damper.filled is not None:
        resistance = fixed.get("return_slope", damper.quantity("return_slope").default or 0.0)
        by_area = resistance * damper.oil_density
        drags = [by_area * getattr(damper, area) ** 2 for area in damper.filled]
    rebound, compression = map(Side, damper.pressed_areas, drags)
    return rebound, compression


def _parts(
    valve: Valve, curve: ValveCurve, most: float, density: float, share: float | None
) -> dict[str, float]:
    """Return the numbers of a valve's parts; the largest flow is in m3/s."""
    top = max(curve.highest, 1e4)
    opening = curve.opening if share is None else share * top
    opening = min(max(opening, 0.02 * top), top)
    root, conductance = curve.root, curve.conductance
    if share is not None:
        root = _HALF * most / math.sqrt(opening)
        conductance = _HALF * most / max(top - opening, 0.1 * top)
    least_root = _LEAST * most / math.sqrt(top)
    if valve.blow_off == "none":  # the bleed carries all
        root, opening = most / math.sqrt(top), top
    elif valve.bleed == "none":
        conductance = most / max(top - opening, 0.1 * top)
    root, conductance = max(root, least_root), max(conductance, _LEAST * most / top)
    slope, flow = 1.0 / (density * conductance), density * most
    leak = math.sqrt(opening) / (density * root)
    own = {"bleed": 1.0 / (density * root), "leak": leak if valve.bleed == "leak" else 0.3 * leak}
    if valve.blow_off == "port" and share is None and (ported := curve.ported):
        through, opening, behind = ported
        own["bleed"] = 1.0 / (density * max(through, least_root))
        own["port"] = 1.0 / (density * behind)
        slope = _BESIDE_A_PORT * own["port"] ** 2 * density * most
    return {
        part: own[part] if part in own else PARTS[part].guess(opening, slope, top, flow)
        for part in valve.parts
    }


def within_plausible(
    damper: ValveDamper, point: Mapping[str, float], fixed: Mapping[str, float]
) -> Values:
    """Return values within the plausible ranges; what the damper has not is left out."""
    known = {q.name: q.default for q in damper.quantities if q.default is not None}
    for quantity in damper.quantities:
        if quantity.name in point:
            known[quantity.name] = float(np.clip(point[quantity.name], *quantity.plausible))
    own = {name: value for name, value in fixed.items() if name in damper.names}
    return damper.values(known | own)  # fixed also at 0, where a part is absent
