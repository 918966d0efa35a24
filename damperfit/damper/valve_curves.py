"""A valve read off the loop: its flow against its pressure, without a model of the valve.

In each stroke one valve is pressed through, by a piston of area a, so that its pressure is the
force itself, D = f'/a with f' the force without gas, offset and friction. What the piston displaces
goes through the valve or is taken up by what gives way (oil, hoses, rod ends: a compliance C)::

    a |v| - C dD/dt = c sqrt(D) + sum_j c_j max(0, D - p_j)

Non-negative least squares on a row of knees p_j gives all of them at once, without a start and
without a second minimum. The left side against D is the valve's characteristic: a bleed is its
root, a blow-off the knee where it turns upwards. Friction and offset are tried on a grid, which is
made finer once about the best.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from damperfit.recording import Trace

    FloatArray = NDArray[np.float64]

__all__ = ["Loop", "Side", "ValveCurve", "ValveReading", "loop_of", "read_valves"]

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


@dataclass(frozen=True, slots=True)
class Side:
    """What presses through a valve.

    Attributes
    ----------
    area : float
        Displaces the oil and carries the pressure, m2.
    drag : float
        Force by the speed that other passages cost in this stroke, N s/m.
    """

    area: float
    drag: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Loop:
    """Samples of a log that are compared, without the gas's and the ambient pressure's force.

    Attributes
    ----------
    force, force_rate, velocity : numpy.ndarray
        Shape (n,); N, N/s, m/s.
    """

    force: FloatArray
    force_rate: FloatArray
    velocity: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class ValveCurve:
    """One valve as read off the loops.

    Attributes
    ----------
    drop, flow : numpy.ndarray
        Shape (n,); D in Pa and a |v| - C dD/dt in m3/s at the samples of its stroke.
    compliance : float
        C, m3/Pa.
    root : float
        c, of the bleed, m3/(s sqrt(Pa)).
    opening : float
        p_open of the blow-off, Pa.
    conductance : float
        Of the blow-off beyond its opening, m3/(s Pa).
    has_knee : bool
        Whether an opening was found; else it and its conductance are only a place to start from.
    """

    drop: FloatArray
    flow: FloatArray
    compliance: float
    root: float
    opening: float
    conductance: float
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
        lengths = np.sqrt(np.maximum(np.einsum("ij,ij->j", columns, columns), 1e-300))
        found = _least_squares(columns / lengths, self.flow)[0] / lengths
        roots = found[1:]
        port = float(roots.sum())
        if not port * math.sqrt(self.highest) > _LEAST_PORT * float(self.flow.max()):
            return None
        return float(found[0]), float(roots @ knees) / port, port


@dataclass(frozen=True, slots=True, eq=False)
class ValveReading:
    """Both valves, and the friction and offset at which they explain the loops best.

    Attributes
    ----------
    rebound, compression : ValveCurve
        The valve of each stroke.
    friction, offset : float
        N.
    """

    rebound: ValveCurve
    compression: ValveCurve
    friction: float
    offset: float


def loop_of(trace: Trace, level: FloatArray) -> Loop:
    """Return the compared samples of a log.

    Parameters
    ----------
    trace : Trace
        A log.
    level : numpy.ndarray
        Shape (n,), what gas and ambient pressure alone do to the force at its samples, N.
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
    """Return both valves of a damper, with the friction and offset at which they fit best.

    Parameters
    ----------
    loops : sequence of Loop
        Logs of one setting.
    rebound, compression : Side
        What presses through the valve of each stroke.
    offset, friction : float, optional
        Where they are known, N. A loop tells little of the friction beside a blow-off.
    """
    whole = Loop(*(np.concatenate([getattr(one, k) for one in loops]) for k in Loop.__slots__))
    half = 0.5 * float(np.ptp(whole.force))
    sides = ((1.0, rebound), (-1.0, compression))
    middle = [half * share for share in _OFFSETS] if offset is None else [offset]
    coarse = [half * share for share in _FRICTIONS] if friction is None else [friction]
    best = _best(whole, sides, coarse, middle)
    width = np.array(_FINER)
    frictions = (best[0] * (1.0 + width)).tolist() if friction is None else coarse
    offsets = (best[1] + 0.1 * half * width).tolist() if offset is None else middle
    best = _best(whole, sides, frictions, offsets)
    curves = [_curve(whole, sign, side, *best) for sign, side in sides]
    return ValveReading(curves[0], curves[1], *best)


def _best(
    loop: Loop,
    sides: Sequence[tuple[float, Side]],
    frictions: Sequence[float],
    offsets: Sequence[float],
) -> tuple[float, float]:
    """Friction and offset with the least misfit of the flows, each stroke's in units of its own."""
    found = []
    for friction in frictions:
        for offset in offsets:
            misfit = 0.0
            for sign, side in sides:
                rows = _rows(loop, sign, side, friction, offset)
                misfit += math.inf if rows is None else rows.solve()[1]
            found.append((misfit, friction, offset))
    return min(found)[1:]


@dataclass(frozen=True, slots=True, eq=False)
class _Rows:
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
        lengths = np.sqrt(np.maximum(np.einsum("ij,ij->j", columns, columns), 1e-300))
        columns /= lengths
        found, rest = _least_squares(columns, self.displaced)
        return found / lengths, rest**2 / float(self.displaced @ self.displaced)


def _least_squares(columns: FloatArray, flow: FloatArray) -> tuple[FloatArray, float]:
    """Non-negative least squares: what each column takes, and what is left."""
    from scipy.optimize import nnls

    found, rest = nnls(columns, flow)
    return found, float(rest)


def _rows(loop: Loop, sign: float, side: Side, friction: float, offset: float) -> _Rows | None:
    """Return the rows of a stroke; None where it presses hardly anywhere."""
    moved = loop.force - offset - friction * np.sign(loop.velocity)
    drop = sign * moved / side.area - side.drag * np.maximum(sign * loop.velocity, 0.0) / side.area
    at = np.flatnonzero(drop > 0.0)
    at = at[:: max(1, len(at) // _ROWS)]
    if len(at) < 4 * _KNEES:
        return None
    drop = drop[at]
    top = float(drop.max())
    return _Rows(
        drop,
        sign * loop.force_rate[at] / side.area,
        side.area * sign * loop.velocity[at],
        top * _AT,
    )


def _curve(loop: Loop, sign: float, side: Side, friction: float, offset: float) -> ValveCurve:
    """Return the valve of a stroke at a friction and offset."""
    rows = _rows(loop, sign, side, friction, offset)
    if rows is None:
        nothing = np.zeros(1)
        return ValveCurve(nothing, nothing, 0.0, 0.0, 0.0, 0.0, has_knee=False)
    found, _ = rows.solve()
    compliance, root, turns = found[0], found[1], found[2:]
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
