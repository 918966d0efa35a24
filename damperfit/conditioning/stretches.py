"""Where a log's motion repeats, and where it moves without repeating: what is to be compared.

How cycles and runs are found stands in `damperfit.conditioning.passages`.

Where runs hold a third of all cycles or more they are what is compared; else all of the motion is.
Rest never is. The model runs through the whole log, so a run that follows another motion needs no
run-in; only one that stands at the log's own beginning does, for what was before it is not known.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from damperfit.conditioning.cycles import clean_cycles, crossings
from damperfit.conditioning.passages import FEWEST, SteadyRun, cycles_of, run_of, runs_of
from damperfit.recording import Stretch

if TYPE_CHECKING:
    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]

__all__ = ["Edges", "FoundStretch", "find_runs", "is_one_run", "steady_stretch"]

_MOVED = 1.5e-3  # s; a filter of 30 Hz moves a passage so far where the speed doubles
_HYSTERESIS = 0.25  # of the run's amplitude
_SHARE = 1.0 / 3.0  # of all cycles, from which on runs are the test; chance gives far less
_SURELY = 3.0  # cycles: one of run-in, one that is compared, and one for where they are cut
_IN_PLACE = 0.5  # of the amplitude: three quarters are left on the worse side
_NEAR = 0.01  # of a cycle; rigs repeat a period to 0.3 %
_ROUNDING = 0.01  # of a cycle: as many whole ones as were logged, though the length is not exact


class Edges(NamedTuple):
    """Samples after which the filter forgets a break, left out at the log's own ends.

    Where the log is continued there, `first` and `stop` are the samples that were logged.
    """

    ends: int
    first: float | None = None
    stop: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class FoundStretch:
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


def find_runs(
    displacement: FloatArray,
    velocity: FloatArray,
    *,
    interval: float,
    steadiness: float,
    edges: Edges,
) -> tuple[tuple[FoundStretch, ...], int]:
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
    tuple of FoundStretch
        In order of time; none where hardly anything repeats.
    int
        Cycles, steady or not.
    """
    seen = cycles_of(displacement)
    n_passages = len(seen.passages)
    if n_passages < FEWEST:
        return (), n_passages // 2
    runs = list(runs_of(seen, steadiness, near=_MOVED / interval))
    if sum(stop - first + 2 for first, stop in runs) < _SHARE * n_passages:
        return (), n_passages // 2
    found: list[FoundStretch] = []
    for first, stop in runs:
        run = run_of(seen, first, stop)
        one = _of_run(run, displacement, velocity, interval=interval, edges=edges)
        if one is None:
            continue
        if found:
            one = _without_overlap(one, found, run.period)
        found.append(one)
    return tuple(found), n_passages // 2


def is_one_run(
    displacement: FloatArray, *, interval: float, steadiness: float, edges: Edges
) -> bool:
    """Whether `find_runs` finds one run without a look at its passages.

    Each stroke of a run whose middle keeps its place passes a quarter of the amplitude on both
    sides of it, so that a run of three cycles beside what is left out has a whole one inside.

    Parameters
    ----------
    displacement : numpy.ndarray
        Shape (n,), behind the filter, m.
    interval, steadiness, edges
        As there.
    """
    seen = cycles_of(displacement)
    if len(seen.passages) < FEWEST:
        return False
    runs = list(runs_of(seen, steadiness, near=_MOVED / interval))
    if len(runs) != 1 or runs[0][1] - runs[0][0] + 2 < _SHARE * len(seen.passages):
        return False
    run, middles = run_of(seen, *runs[0]), seen.middle[slice(*runs[0])]
    keeps_place = float(np.ptp(middles)) <= _IN_PLACE * run.amplitude
    return keeps_place and run.last - run.first >= _SURELY * run.period + 2.0 * edges.ends


def _without_overlap(one: FoundStretch, found: list[FoundStretch], period: float) -> FoundStretch:
    """Return a stretch that shares no sample with the last one; or that one, which is taken."""
    first, stop = one.stretch.first, found[-1].stretch.stop
    if stop - first > 2.0 * _ROUNDING * period + 1.0:
        # Two runs may both claim the cycle that leads over from one to the other.
        return max(one, found.pop(), key=lambda each: each.stretch.n_samples)
    # The same passage may be a little off in both.
    return replace(one, stretch=replace(one.stretch, first=max(first, stop)))


def _of_run(
    run: SteadyRun,
    displacement: FloatArray,
    velocity: FloatArray,
    *,
    interval: float,
    edges: Edges,
) -> FoundStretch | None:
    """Return the stretch of one run; None where no whole cycle is left."""
    period, amplitude = run.period, run.amplitude
    low = max(0, math.floor(run.first - 0.7 * period))
    high = min(len(displacement), math.ceil(run.last + 0.7 * period))
    x, v = displacement[low:high], velocity[low:high] * interval
    rising, falling = (
        low + crossings(x, v, _HYSTERESIS * amplitude, level=run.middle, sign=sign)
        for sign in (1.0, -1.0)
    )
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
    return FoundStretch(replace(stretch, peak_speed=fastest), begin, end)


def _inner(
    run: SteadyRun, n: int, edges: Edges, *, begin: float, end: float
) -> tuple[float, float]:
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


def _belonging(at: FloatArray, run: SteadyRun, x: FloatArray, *, moved: float) -> FloatArray:
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
