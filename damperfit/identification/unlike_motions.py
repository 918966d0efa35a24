"""Logs of one setting under different motions that contradict each other where their speeds meet.

A slow test and a fast one of one damper pass through the same speeds. The damping force there,
half the difference of rebound and bump, is what an offset and the gas have no part in; read on
both ways through the speed it does not know the oil's compression either, to first order. Where
it differs, the two logs are fitted together, and what the fit leaves over is read in the same
way. Where fits of each log apart leave hardly any of that over, the logs are of different
dampers or settings.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from damperfit.conditioning.duplicates import REPEATS, SCATTERS, are_unlike, share_a_motion
from damperfit.damper.warmed import Warmed
from damperfit.errors import DamperfitError
from damperfit.identification.procedures import identify
from damperfit.identification.simulated_log import compare

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from damperfit.damper.model import Model
    from damperfit.identification.options import FitOptions
    from damperfit.recording import Trace

    FloatArray = NDArray[np.float64]

__all__ = ["contradictory_motions"]

_WINDOW = (0.75, 0.95)  # of the slower log's peak speed; nearer to it there is one way only
# Of what a fit of both misses. Logs one click apart: 0.000 to 0.07; of a damper of real valves
# under the paper's law: 0.7 and more.
_EXPLAINED = 0.25
_FEWEST = 12  # samples of a stroke in the window


@dataclass(frozen=True, slots=True)
class _Meeting:
    """The damping forces of two logs at a speed that both pass."""

    first: Trace
    second: Trace
    speed: float
    forces: tuple[float, float]
    allowed: float

    @property
    def differs(self) -> bool:
        return abs(self.forces[0] - self.forces[1]) > self.allowed

    @property
    def sentence(self) -> str:
        a, b = self.forces
        return (
            f"{self.first.name} and {self.second.name} contradict each other: both reach "
            f"{self.speed:.3g} m/s, where their damping forces are {a:.4g} N and {b:.4g} N, "
            f"{200.0 * abs(a - b) / (abs(a) + abs(b)):.3g} % apart, which a fit of both "
            "does not explain"
        )


def contradictory_motions(
    traces: Sequence[Trace], damper: Model, options: FitOptions
) -> str | None:
    """Return a sentence on the first two logs that contradict each other; None where none do.

    Parameters
    ----------
    traces : sequence of Trace
        Of one setting; logs of one motion have been compared. Those are that are neighbours by
        their fastest speed.
    damper : Model
        The model.
    options : FitOptions
        How it is fitted.
    """
    for first, second in itertools.pairwise(sorted(traces, key=_top_speed)):
        is_warmed = isinstance(damper, Warmed)
        if share_a_motion(first, second) or (is_warmed and are_unlike(first, second)):
            continue
        met = _meeting(first, second, (first.force, second.force))
        if met is not None and met.differs and _is_left_by_fits(met, damper, options):
            return met.sentence
    return None


def _top_speed(trace: Trace) -> float:
    """Return the speed that a log reaches in both strokes, m/s."""
    v = trace.velocity[trace.compared]
    return float(min(np.max(v), -np.min(v)))


def _meeting(first: Trace, second: Trace, forces: tuple[FloatArray, FloatArray]) -> _Meeting | None:
    """Return what two logs say where their speeds meet; None where they do not."""
    pair = (first, second)
    top = min(map(_top_speed, pair))
    read = [_damping(log, force, top) for log, force in zip(pair, forces, strict=True)]
    scales = [_damping(log, log.force, top) for log in pair]
    if None in read or None in scales:
        return None
    noise = math.hypot(*map(_noise, pair))
    scale = 0.5 * sum(abs(one) for one in scales if one is not None)
    a, b = (float(one) for one in read if one is not None)
    speed = 0.5 * sum(_WINDOW) * top
    return _Meeting(first, second, speed, (a, b), max(SCATTERS * noise, REPEATS * scale))


def _damping(trace: Trace, force: FloatArray, top: float) -> float | None:
    """Return half the difference of rebound and bump in the middle of the window, N."""
    v, f = trace.velocity[trace.compared], force[trace.compared]
    found = []
    for sign in (1.0, -1.0):
        speed = sign * v
        inside = (speed >= _WINDOW[0] * top) & (speed <= _WINDOW[1] * top)
        if np.count_nonzero(inside) < _FEWEST:
            return None
        # Samples of a slow test lie nearer to its peak than those of a fast one.
        away = speed[inside] - 0.5 * sum(_WINDOW) * top
        slope = np.stack([np.ones(len(away)), away], axis=1)
        found.append(float(np.linalg.lstsq(slope, f[inside], rcond=None)[0][0]))
    return 0.5 * (found[0] - found[1])


def _noise(trace: Trace) -> float:
    return max((one.noise for one in trace.stretches if math.isfinite(one.noise)), default=0.0)


def _is_left_by_fits(met: _Meeting, damper: Model, options: FitOptions) -> bool:
    """Whether a fit of both logs leaves that difference over, and fits of each leave nothing.

    Where the law does not suit the damper each log is missed too, and nothing is reported.
    """
    pair = (met.first, met.second)
    try:
        both = _missed(pair, damper, options)
        rest = _meeting(*pair, (both[0], both[1]))
        if rest is None or not rest.differs:
            return False
        apart = [_missed((one,), damper, options)[0] for one in pair]
    except DamperfitError:
        return False  # the run itself tells why this setting cannot be fitted
    missed, explained = (sum(map(_power, pair, left)) for left in (both, apart))
    return explained <= _EXPLAINED * missed


def _missed(traces: Sequence[Trace], damper: Model, options: FitOptions) -> list[FloatArray]:
    """Return what a fit of some logs leaves over of each."""
    plain = replace(options, procedure="plain", share=None, bulk_modulus="free", starts=1)
    (fit,) = identify(traces, damper, plain).fits
    return [
        log.force - compare(fit.parameters, log, damper, solver=plain.solver).force
        for log in traces
    ]


def _power(trace: Trace, left: FloatArray) -> float:
    """Return the mean square of what is left over of a log, of its force's variance."""
    part = trace.compared
    return float(np.mean(left[part] ** 2) / np.var(trace.force[part]))
