"""Where a log's motion repeats, and where it moves without repeating: what is to be compared.

A motion is read as turning points: a turn counts when the way back from it is a fiftieth of the
whole range, so that small strokes beside large ones are seen and noise is not. A cycle runs from
one passage through the middle of its own stroke to the next but one. Cycles whose neighbours have
their period, amplitude and middle within `steadiness` make a run, or several where its level
changes (`damperfit.conditioning.plateaus`).

Where runs hold a third of all cycles or more they are what is compared; else all of the motion is.
Rest never is. The model runs through the whole log, so a run that follows another motion needs no
run-in; only one that stands at the log's own beginning does, for what was before it is not known.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from damperfit.conditioning.cycles import clean_cycles, crossings
from damperfit.conditioning.plateaus import level_parts, like_halves
from damperfit.recording import Stretch

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]
    IntArray = NDArray[np.int64]

__all__ = ["Edges", "Found", "ends_in_motion", "find_runs", "steady_stretch", "turning_points"]

TURN = 0.02  # of the whole range
_MOVED = 1.5e-3  # s; a filter of 30 Hz moves a passage so far where the speed doubles
_HYSTERESIS = 0.25  # of the run's amplitude
_FEWEST = 3  # passages at which a cycle begins: two whole cycles
_SHARE = 1.0 / 3.0  # of all cycles, from which on runs are the test; chance gives less than a tenth
_NEAR = 0.01  # of a cycle; rigs repeat a period to 0.3 %
_CUT = 0.8  # of a cycle may be ahead of a run's first passage: the turn before it, cut
_ALIKE = 0.1  # of the amplitude; the period is rounded to a sample
_ROUNDING = 0.01  # of a cycle: as many whole ones as were logged, though the length is not exact


class Edges(NamedTuple):
    """Samples after which the filter forgets a break, left out at the log's own ends.

    Where the log is continued there, `first` and `stop` are the samples that were logged.
    """

    ends: int
    first: float | None = None
    stop: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """A stretch, in samples of the log, and between which breaks of the motion it lies.

    Attributes
    ----------
    stretch : Stretch
        What is compared.
    begin, end : float
        Where its motion begins and ends; infinite where the log does.
    """

    stretch: Stretch
    begin: float
    end: float


class _Turns(NamedTuple):
    """Cycles that begin at each passage through the middle of a stroke, up or down.

    So many samples from a passage to the next but one; half the stroke and the middle of both
    strokes between.
    """

    at_turns: FloatArray
    passages: FloatArray
    period: FloatArray
    amplitude: FloatArray
    middle: FloatArray


def find_runs(
    displacement: FloatArray,
    velocity: FloatArray,
    *,
    interval: float,
    steadiness: float,
    edges: Edges,
) -> tuple[tuple[Found, ...], int]:
    """Return the steady runs of a log, and how many cycles there are in all.

    Parameters
    ----------
    displacement, velocity : numpy.ndarray
        Shape (n,), behind the filter; m, m/s.
    interval : float
        s.
    steadiness : float
        Share within which neighbours must be alike.
    edges : Edges
        What is left out.

    Returns
    -------
    tuple of Found
        In order of time; none where hardly anything repeats.
    int
        Cycles, steady or not.
    """
    seen = _cycles(displacement)
    n_passages = len(seen.passages)
    if n_passages < _FEWEST:
        return (), n_passages // 2
    runs = list(_runs(seen, steadiness, near=_MOVED / interval))
    if sum(stop - first + 2 for first, stop in runs) < _SHARE * n_passages:
        return (), n_passages // 2
    found: list[Found] = []
    for first, stop in runs:
        run = _run(seen, first, stop)
        one = _of_run(run, displacement, velocity, interval=interval, edges=edges)
        if one is None:
            continue
        # Two runs may both claim the cycle that leads over from one to the other.
        if found and one.stretch.first < found[-1].stretch.stop:
            longer = max(one, found.pop(), key=lambda each: each.stretch.n_samples)
            found.append(longer)
        else:
            found.append(one)
    return tuple(found), n_passages // 2


def _cycles(x: FloatArray) -> _Turns:
    turns = turning_points(x, TURN * float(np.ptp(x)))
    passages = []
    for begin, end in pairwise(turns.tolist()):
        sign = 1.0 if x[end] > x[begin] else -1.0
        stroke = sign * (x[begin : end + 1] - 0.5 * (x[begin] + x[end]))
        at = int(np.argmax(stroke >= 0.0))
        passages.append(begin + at - stroke[at] / (stroke[at] - stroke[at - 1]))
    at_turns = x[turns]
    strokes = np.abs(np.diff(at_turns))
    return _Turns(
        at_turns,
        np.array(passages),
        np.asarray(np.array(passages[2:]) - np.array(passages[: max(len(passages) - 2, 0)])),
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
    steps = np.diff(x)
    places = np.flatnonzero(steps[:-1] * steps[1:] <= 0.0) + 1
    places = np.concatenate([[0], places, [len(x) - 1]])
    values = x[places].tolist()
    turns: list[int] = []
    low = high = 0
    rising = 0
    for k, value in enumerate(values):
        if value > values[high]:
            high = k
        if value < values[low]:
            low = k
        if rising >= 0 and values[high] - value > reach:
            turns.append(high)
            rising, low = -1, k
            high = k
        elif rising <= 0 and value - values[low] > reach:
            turns.append(low)
            rising, high = 1, k
            low = k
    return np.asarray(places[turns], dtype=np.int64)


def _runs(seen: _Turns, steadiness: float, *, near: float) -> Iterator[tuple[int, int]]:
    """Yield first and stop of the cycles of each run."""
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
                period[part], amplitude[part], fewest=_FEWEST, steadiness=steadiness
            ):
                run = like_halves(
                    seen.passages, seen.at_turns, first + begin, first + stop, near=near
                )
                if run[1] - run[0] >= _FEWEST:
                    yield run
            first = k + 1


class _Run(NamedTuple):
    """The run's passages as first found, samples; medians of its cycles, samples and m."""

    first: float
    last: float
    period: float
    amplitude: float
    middle: float


def _run(seen: _Turns, first: int, stop: int) -> _Run:
    medians = (
        float(np.median(values[first:stop]))
        for values in (seen.period, seen.amplitude, seen.middle)
    )
    return _Run(float(seen.passages[first]), float(seen.passages[stop + 1]), *medians)


def _of_run(
    run: _Run,
    displacement: FloatArray,
    velocity: FloatArray,
    *,
    interval: float,
    edges: Edges,
) -> Found | None:
    """Return the stretch of one run; None where no whole cycle is left."""
    period, amplitude = run.period, run.amplitude
    low = max(0, math.floor(run.first - 0.7 * period))
    high = min(len(displacement), math.ceil(run.last + 0.7 * period))
    x, v = displacement[low:high] - run.middle, velocity[low:high] * interval
    rising = low + crossings(x, v, _HYSTERESIS * amplitude)
    falling = low + crossings(-x, -v, _HYSTERESIS * amplitude)
    rising, falling = (
        _belonging(at, run, displacement, moved=_MOVED / interval) for at in (rising, falling)
    )
    marks = np.sort(np.concatenate([rising, falling]))
    if len(marks) < 3:
        return None
    n = len(displacement)
    is_first, is_last = marks[0] <= 0.6 * period, n - 1.0 - marks[-1] <= 0.6 * period
    begin = -math.inf if is_first else float(marks[0])
    end = math.inf if is_last else float(marks[-1])
    inner = _inner(run, n, edges, begin=begin, end=end)
    rising, falling = (
        _unsmeared(at, period, begin + edges.ends, end - edges.ends) for at in (rising, falling)
    )
    starts = _whole(rising, falling, period, inner)
    if starts is None:
        return None
    stretch = steady_stretch(starts, velocity, interval, amplitude)
    smeared = (
        max(0, math.ceil(begin + edges.ends) - stretch.first) if not is_first else 0,
        max(0, stretch.stop - math.floor(end - edges.ends)) if not is_last else 0,
    )
    stretch = replace(stretch, smeared=smeared)
    clean = np.rint(clean_cycles(stretch)).astype(np.int64)
    fastest = float(np.abs(velocity[clean[0] : clean[-1]]).max())
    return Found(replace(stretch, peak_speed=fastest), begin, end)


def _inner(run: _Run, n: int, edges: Edges, *, begin: float, end: float) -> tuple[float, float]:
    """Return the samples between which a run may be compared."""
    slack = 0.5 * _ROUNDING * run.period
    low = begin - slack
    if math.isinf(begin):
        low = run.period + edges.ends if edges.first is None else edges.first - slack
    high = end + slack
    if math.isinf(end):
        high = n - 1.0 - edges.ends if edges.stop is None else edges.stop + slack
    return low, high


def _unsmeared(at: FloatArray, period: float, first: float, last: float) -> FloatArray:
    """Put passages that the filter has moved where the nearest of the others says."""
    inner = at[(at >= first) & (at <= last)]
    if not len(inner):
        return at
    nearest = inner[np.argmin(np.abs(at[:, None] - inner), axis=1)]
    return np.asarray(nearest + period * np.rint((at - nearest) / period))


def _belonging(at: FloatArray, run: _Run, x: FloatArray, *, moved: float) -> FloatArray:
    """Return the passages of one direction that are a run's, one more at an end if alike.

    `x` is the displacement, `moved` the samples that the filter may move a passage by.
    """
    near = 0.02 * run.period
    inside = at[(at >= run.first - near) & (at <= run.last + near)]
    if not len(inside):
        return inside
    share = max(0.02, 4.0 * moved / run.period)

    def more(here: float, there: float) -> FloatArray:
        near = at[np.abs(at - there) <= max(0.5 * _NEAR * run.period, moved)][:1]
        part = x[math.ceil(min(here, *near)) : math.ceil(max(here, *near))] if len(near) else x[:0]
        if not len(part):
            return near[:0]
        ends = np.array([part.max() - run.middle, run.middle - part.min()])
        return near[: int(np.all(np.abs(ends / run.amplitude - 1.0) <= share))]

    first, last = float(inside[0]), float(inside[-1])
    ends = more(first, first - run.period), more(last, last + run.period)
    return np.concatenate([ends[0], inside, ends[1]])


def _whole(
    rising: FloatArray, falling: FloatArray, period: float, inner: tuple[float, float]
) -> FloatArray | None:
    """Return boundaries of the most whole cycles between two samples; None where none fits."""
    low, high = inner
    n_cycles = math.floor((high - low) / period + 1e-9)
    for marks in (rising, falling):
        inside = marks[(marks >= low) & (marks <= high)]
        if len(inside) > max(n_cycles, 1):
            return inside
    if n_cycles < 1:
        return None
    # They fit when they are cut elsewhere: at the same phase of each.
    slack = 0.5 * (high - low - n_cycles * period)
    return np.asarray(low + slack + period * np.arange(n_cycles + 1, dtype=np.float64))


def steady_stretch(
    starts: FloatArray, velocity: FloatArray, interval: float, amplitude: float
) -> Stretch:
    """Return the stretch between the first and the last of these boundaries of cycles.

    Parameters
    ----------
    starts : numpy.ndarray
        Fractional samples.
    velocity : numpy.ndarray
        Of the log, m/s.
    interval : float
        s.
    amplitude : float
        Half the stroke, m.
    """
    first, stop = round(float(starts[0])), round(float(starts[-1]))
    return Stretch(
        kind="steady",
        first=first,
        stop=stop,
        cycle_starts=starts,
        frequency=(len(starts) - 1) / float(starts[-1] - starts[0]) / interval,
        amplitude=amplitude,
        peak_speed=float(np.abs(velocity[first:stop]).max()),
    )


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
    seen = _cycles(displacement)
    if len(seen.passages) < _FEWEST:
        return None, None
    runs = [_run(seen, *run) for run in _runs(seen, steadiness, near=1.0)]
    if not runs:
        return None, None
    begin, end = runs[0], runs[-1]
    return (
        begin.period if _repeats(displacement, begin.first, begin) else None,
        end.period
        if _repeats(displacement[::-1], len(displacement) - 1.0 - end.last, end)
        else None,
    )


def _repeats(x: FloatArray, ahead: float, run: _Run) -> bool:
    """Whether what is ahead of a run's first passage is of the same motion: no rest, no run-up."""
    n, period = math.ceil(ahead), round(run.period)
    if ahead > _CUT * run.period or n + period >= len(x):
        return False
    return float(np.abs(x[: n + 1] - x[period : period + n + 1]).max()) < _ALIKE * run.amplitude
