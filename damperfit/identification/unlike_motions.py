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
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from damperfit.arrays import FloatArray
from damperfit.conditioning.duplicates import REPEATS, SCATTERS, are_unlike, share_a_motion
from damperfit.damper.model import Model
from damperfit.damper.temperature_law import WithTemperature
from damperfit.errors import DamperfitError
from damperfit.identification.logs import compare
from damperfit.identification.options import FitOptions
from damperfit.identification.procedures import identify
from damperfit.recording import Trace

Pair = tuple[Trace, Trace]

_WINDOW = (0.75, 0.95)  # of the slower log's peak speed; nearer to it there is one way only
# Of what a fit of both misses. Logs one click apart: 0.000 to 0.07; of a damper of real valves
# under the paper's law: 0.7 and more.
_EXPLAINED = 0.25
_FEWEST = 12  # samples of a stroke in the window


def contradictory_motions(
    traces: Sequence[Trace], damper: Model, options: FitOptions
) -> str | None:
    """A sentence on the first two logs of a setting that contradict each other; None: none do."""
    # Logs of one motion have been compared; these are neighbours by their fastest speed.
    for pair in itertools.pairwise(sorted(traces, key=_top_speed)):
        has_temperature_law = isinstance(damper, WithTemperature)
        if share_a_motion(*pair) or (has_temperature_law and are_unlike(*pair)):
            continue
        forces = _differing(pair, [log.force for log in pair])
        if forces is None or not _is_left_by_fits(pair, damper, options):
            continue
        a, b = forces
        return (
            f"{pair[0].name} and {pair[1].name} contradict each other: both reach "
            f"{0.5 * sum(_WINDOW) * _top_speed(pair[0]):.3g} m/s, where their damping forces are "
            f"{a:.4g} N and {b:.4g} N, {200.0 * abs(a - b) / (abs(a) + abs(b)):.3g} % apart, which "
            "a fit of both does not explain"
        )
    return None


def _top_speed(trace: Trace) -> float:
    """The speed that a log reaches in both strokes, m/s."""
    v = trace.velocity[trace.compared]
    return float(min(np.max(v), -np.min(v)))


def _differing(pair: Pair, forces: Sequence[FloatArray]) -> tuple[float, float] | None:
    """Forces of two logs where their speeds meet; None where noise may explain it all."""
    top = min(map(_top_speed, pair))
    a, b = (_damping(log, force, top) for log, force in zip(pair, forces, strict=True))
    scale = 0.5 * sum(abs(_damping(log, log.force, top)) for log in pair)
    noises = ([x.noise for x in log.segments if math.isfinite(x.noise)] for log in pair)
    noise = math.hypot(*(max(few, default=0.0) for few in noises))
    return (a, b) if abs(a - b) > max(SCATTERS * noise, REPEATS * scale) else None  # NaN is not


def _damping(trace: Trace, force: FloatArray, top: float) -> float:
    """Half the difference of rebound and bump in the middle of the window, N; NaN: too few."""
    v, f = trace.velocity[trace.compared], force[trace.compared]
    strokes = []
    for sign in (1.0, -1.0):
        speed = sign * v
        inside = (speed >= _WINDOW[0] * top) & (speed <= _WINDOW[1] * top)
        if np.count_nonzero(inside) < _FEWEST:
            return math.nan
        # Samples of a slow test lie nearer to its peak than those of a fast one.
        away = speed[inside] - 0.5 * sum(_WINDOW) * top
        line = np.stack([np.ones(len(away)), away], axis=1)
        strokes.append(float(np.linalg.lstsq(line, f[inside], rcond=None)[0][0]))
    return 0.5 * (strokes[0] - strokes[1])


def _is_left_by_fits(pair: Pair, damper: Model, options: FitOptions) -> bool:
    """Whether a fit of both logs leaves that difference over, and fits of each leave nothing."""
    # Where the law does not suit the damper each log is missed too, and nothing is reported.
    plain = replace(options, procedure="plain", share=None, bulk_modulus="free", starts=1)

    def missed(traces: Sequence[Trace]) -> list[FloatArray]:
        (fit,) = identify(traces, damper, plain).fits
        return [
            log.force - compare(fit.parameters, log, damper, solver=plain.solver).force
            for log in traces
        ]

    def power(left: Sequence[FloatArray]) -> float:
        return sum(
            float(np.mean(rest[log.compared] ** 2) / np.var(log.force[log.compared]))
            for log, rest in zip(pair, left, strict=True)
        )

    try:
        both = missed(pair)
        if _differing(pair, both) is None:
            return False
        alone = [missed((log,))[0] for log in pair]
    except DamperfitError:
        return False  # the run itself says why this setting cannot be fitted
    return power(alone) <= _EXPLAINED * power(both)
