"""Cycles of a motion that may change its speed, and the runs of them that repeat.

A motion is read as turning points: a turn counts when the way back from it is a fiftieth of the
whole range, so that small strokes beside large ones are seen and noise is not. A cycle runs from
one passage through the middle of its own stroke to the next but one. Cycles whose neighbours have
their period, amplitude and middle within `steadiness` make a run, or several where its level
changes (`damperfit.conditioning.plateaus`).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from damperfit.compiled_core import compiled_core
from damperfit.conditioning.plateaus import level_parts, like_halves
from damperfit.statistics import median, percentiles

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]
    IntArray = NDArray[np.int64]

__all__ = [
    "FEWEST",
    "TURN",
    "SteadyRun",
    "Turns",
    "cycles_of",
    "ends_in_motion",
    "fastest_frequency",
    "run_of",
    "runs_of",
    "turning_points",
]

TURN = 0.02  # of the whole range
FEWEST = 3  # passages at which a cycle begins: two whole cycles
_CUT = 0.8  # of a cycle may be ahead of a run's first passage: the turn before it, cut
_ALIKE = 0.1  # of the amplitude; the period is rounded to a sample


class Turns(NamedTuple):
    """Cycles that begin at each passage through the middle of a stroke, up or down.

    So many samples from a passage to the next but one; half the stroke and the middle of both
    strokes between.
    """

    at_turns: FloatArray
    passages: FloatArray
    period: FloatArray
    amplitude: FloatArray
    middle: FloatArray


class SteadyRun(NamedTuple):
    """The run's passages as first found, samples; medians of its cycles, samples and m."""

    first: float
    last: float
    period: float
    amplitude: float
    middle: float


def run_of(seen: Turns, first: int, stop: int) -> SteadyRun:
    """Return the facts of a run.

    Parameters
    ----------
    seen : Turns
        Of the whole log.
    first, stop : int
        Its cycles.
    """
    medians = (median(values[first:stop]) for values in (seen.period, seen.amplitude, seen.middle))
    return SteadyRun(float(seen.passages[first]), float(seen.passages[stop + 1]), *medians)


def cycles_of(x: FloatArray) -> Turns:
    """Return the cycles of a motion.

    Parameters
    ----------
    x : numpy.ndarray
        Displacement, shape (n,), m.
    """
    turns = turning_points(x, TURN * float(np.ptp(x)))
    passages = np.empty(max(len(turns) - 1, 0))
    if len(turns):
        compiled_core().passages(np.ascontiguousarray(x, np.float64), turns, passages)
    at_turns = x[turns]
    strokes = np.abs(np.diff(at_turns))
    return Turns(
        at_turns,
        passages,
        np.asarray(passages[2:] - passages[: max(len(passages) - 2, 0)]),
        0.25 * (strokes[:-2] + strokes[1:-1]),
        0.25 * (at_turns[:-3] + 2.0 * at_turns[1:-2] + at_turns[2:-1]),
    )


def turning_points(x: FloatArray, reach: float) -> IntArray:
    """Return the samples at which the motion turns, valleys and peaks by turns.

    Parameters
    ----------
    x : numpy.ndarray
        Shape (n,), m.
    reach : float
        Way back from a turn from which on it counts, m.
    """
    samples = np.ascontiguousarray(x, np.float64)
    turns = np.empty(len(samples), np.int64)
    return turns[: compiled_core().turns(samples, turns, reach)].copy()


def runs_of(seen: Turns, steadiness: float, *, near: float) -> Iterator[tuple[int, int]]:
    """Yield first and stop of the cycles of each run.

    Parameters
    ----------
    seen : Turns
        Of the whole log.
    steadiness : float
        Share within which neighbours must be alike.
    near : float
        Samples by which a filter may move a passage beside a break.
    """
    period, amplitude, middle = seen.period, seen.amplitude, seen.middle
    smaller = np.minimum(amplitude[:-1], amplitude[1:])
    alike = (
        (np.abs(np.log(period[1:] / period[:-1])) <= steadiness)
        & (np.abs(np.log(amplitude[1:] / amplitude[:-1])) <= steadiness)
        & (np.abs(np.diff(middle)) <= steadiness * smaller)
    )
    first = 0
    for k in range(len(period)):
        if k == len(alike) or not alike[k]:
            part = slice(first, k + 1)
            for begin, stop in level_parts(
                period[part], amplitude[part], fewest=FEWEST, steadiness=steadiness
            ):
                run = like_halves(
                    seen.passages, seen.at_turns, first + begin, first + stop, near=near
                )
                if run[1] - run[0] >= FEWEST:
                    yield run
            first = k + 1


def ends_in_motion(
    displacement: FloatArray, steadiness: float
) -> tuple[float | None, float | None]:
    """Return the samples in a cycle of the steady motion a log begins in, and ends in; else None.

    Parameters
    ----------
    displacement : numpy.ndarray
        Shape (n,), as logged: a filter would bend the ends.
    steadiness : float
        Share within which neighbours must be alike.
    """
    seen = cycles_of(displacement)
    if len(seen.passages) < FEWEST:
        return None, None
    runs = [run_of(seen, *run) for run in runs_of(seen, steadiness, near=1.0)]
    if not runs:
        return None, None
    begin, end = runs[0], runs[-1]
    return (
        begin.period if _repeats(displacement, begin.first, begin) else None,
        end.period
        if _repeats(displacement[::-1], len(displacement) - 1.0 - end.last, end)
        else None,
    )


def _repeats(x: FloatArray, ahead: float, run: SteadyRun) -> bool:
    """Whether what is ahead of a run's first passage is of the same motion: no rest, no run-up."""
    n, period = math.ceil(ahead), round(run.period)
    if ahead > _CUT * run.period or n + period >= len(x):
        return False
    return float(np.abs(x[: n + 1] - x[period : period + n + 1]).max()) < _ALIKE * run.amplitude


def fastest_frequency(displacement: FloatArray, steadiness: float) -> float:
    """Return the frequency of a motion's fastest part, cycles per sample; 0 where nothing moves.

    Parameters
    ----------
    displacement : numpy.ndarray
        Shape (n,), as logged.
    steadiness : float
        Share within which neighbours must be alike.
    """
    seen = cycles_of(displacement)
    if len(seen.passages) < FEWEST:
        return 0.0
    runs = [run_of(seen, *run) for run in runs_of(seen, steadiness, near=1.0)]
    if runs:
        return 1.0 / max(runs, key=lambda run: run.amplitude / run.period).period
    return 1.0 / percentiles(seen.period, 5.0)[0]
