"""Where a log's motion repeats, and where it moves without repeating: what is to be compared.

A motion is read as turning points: a turn counts when the way back from it is a fiftieth of the
whole range, so that small strokes beside large ones are seen and noise is not. A cycle runs from
one passage through the middle of its own stroke to the next but one. Cycles whose neighbours have
their period, amplitude and middle within `steadiness` make a run. At both ends of a run, cycles
that differ from its median by more than the cycles inside do are left out: they lead over to
another speed. A run that drifts through a range of frequencies is a sweep and not steady.

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

from damperfit.conditioning.cycles import crossings
from damperfit.recording import Stretch

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]
    IntArray = NDArray[np.int64]

__all__ = ["Edges", "Found", "find_moving", "find_runs", "steady_stretch"]

_TURN = 0.02  # of the whole range
_HYSTERESIS = 0.25  # of the run's amplitude
_FEWEST = 3  # passages at which a cycle begins: two whole cycles
_SHARE = 1.0 / 3.0  # of all cycles, from which on runs are the test; chance gives less than a tenth
# End cycles of a run may be off its median by so much; rigs repeat a period to 0.3 %.
_END_PERIOD, _END_AMPLITUDE = 0.01, 0.02
_USUAL = 5.0  # median deviations
_SLOW = 0.02  # of the fastest speed; below is rest
_PAUSE = 0.5  # s; shorter ones are part of a motion
_FEWEST_TURNS = 8  # more than three cycles have
_LONGEST_RUN_IN = 2.0  # s


class Edges(NamedTuple):
    """Samples that are left out beside a break in the motion, and at the log's own ends."""

    beside: int
    ends: int


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

    turns: IntArray
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
    runs = list(_runs(seen, steadiness))
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
    turns = _turning_points(x, _TURN * float(np.ptp(x)))
    passages = []
    for begin, end in pairwise(turns.tolist()):
        sign = 1.0 if x[end] > x[begin] else -1.0
        stroke = sign * (x[begin : end + 1] - 0.5 * (x[begin] + x[end]))
        at = int(np.argmax(stroke >= 0.0))
        passages.append(begin + at - stroke[at] / (stroke[at] - stroke[at - 1]))
    at_turns = x[turns]
    strokes = np.abs(np.diff(at_turns))
    return _Turns(
        turns,
        np.array(passages),
        np.asarray(np.array(passages[2:]) - np.array(passages[: max(len(passages) - 2, 0)])),
        0.25 * (strokes[:-2] + strokes[1:-1]),
        0.25 * (at_turns[:-3] + 2.0 * at_turns[1:-2] + at_turns[2:-1]),
    )


def _turning_points(x: FloatArray, reach: float) -> IntArray:
    """Return the samples at which the motion turns, valleys and peaks by turns."""
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


def _runs(seen: _Turns, steadiness: float) -> Iterator[tuple[int, int]]:
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
            run = _trimmed(period, amplitude, first, k + 1)
            first = k + 1
            if run[1] - run[0] >= _FEWEST and not _sweeps(period[slice(*run)], steadiness):
                yield run


def _trimmed(period: FloatArray, amplitude: FloatArray, first: int, stop: int) -> tuple[int, int]:
    """Take cycles off both ends of a run that are not like those inside."""
    is_off = np.zeros(stop - first, dtype=bool)
    for values, least in ((period, _END_PERIOD), (amplitude, _END_AMPLITUDE)):
        part = values[first:stop]
        middle = float(np.median(part))
        usual = _USUAL * float(np.median(np.abs(part - middle)))
        is_off |= np.abs(part - middle) > max(usual, least * middle)
    while stop > first and is_off[0]:
        first, is_off = first + 1, is_off[1:]
    while stop > first and is_off[-1]:
        stop, is_off = stop - 1, is_off[:-1]
    return first, stop


def _sweeps(period: FloatArray, steadiness: float) -> bool:
    """Whether a run goes through a range of frequencies."""
    return bool(np.log(period.max() / period.min()) > 2.0 * steadiness)


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
    rising, falling = (_belonging(at, run) for at in (rising, falling))
    marks = np.sort(np.concatenate([rising, falling]))
    if len(marks) < 3:
        return None
    n = len(displacement)
    is_first, is_last = marks[0] <= 0.6 * period, n - 1.0 - marks[-1] <= 0.6 * period
    begin = -math.inf if is_first else float(marks[0])
    end = math.inf if is_last else float(marks[-1])
    inner = (
        period + edges.ends if is_first else begin + edges.beside,
        n - 1.0 - edges.ends if is_last else end - edges.beside,
    )
    starts = _whole(rising, falling, period, inner)
    if starts is None:
        return None
    stretch = steady_stretch(starts, velocity, interval, amplitude)
    smeared = (
        max(0, math.ceil(begin + edges.ends) - stretch.first) if not is_first else 0,
        max(0, stretch.stop - math.floor(end - edges.ends)) if not is_last else 0,
    )
    return Found(replace(stretch, smeared=smeared), begin, end)


def _belonging(at: FloatArray, run: _Run) -> FloatArray:
    """Return the passages of one direction that are a run's, one more at an end if in time."""
    near = 0.02 * run.period
    inside = at[(at >= run.first - near) & (at <= run.last + near)]
    if not len(inside):
        return inside
    steps = inside[0] - run.period, inside[-1] + run.period
    more = [at[np.abs(at - step) <= _END_PERIOD * run.period][:1] for step in steps]
    return np.concatenate([more[0], inside, more[1]])


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


def find_moving(
    displacement: FloatArray, velocity: FloatArray, *, interval: float, edges: Edges
) -> tuple[Found, ...]:
    """Return the parts of a log that move, for one in which nothing repeats.

    Parameters
    ----------
    displacement, velocity : numpy.ndarray
        Shape (n,), behind the filter; m, m/s.
    interval : float
        s.
    edges : Edges
        What is left out.
    """
    turns = _turning_points(displacement, _TURN * float(np.ptp(displacement)))
    if len(turns) < _FEWEST_TURNS:
        return ()
    fastest = float(np.percentile(np.abs(velocity), 99.0))
    found = []
    for low, high in _parts(np.abs(velocity) > _SLOW * fastest, round(_PAUSE / interval)):
        inside = turns[(turns >= low) & (turns < high)]
        if len(inside) < 2:
            continue
        begin = -math.inf if low == 0 else float(low)
        end = math.inf if high == len(velocity) else float(high)
        # What went before the log is forgotten after a cycle.
        run_in = min(2.0 * float(np.median(np.diff(inside))), _LONGEST_RUN_IN / interval)
        first = low + (round(run_in) + edges.ends if low == 0 else edges.beside)
        stop = high - (edges.ends if high == len(velocity) else edges.beside)
        if stop - first > run_in:
            found.append(
                Found(_moving(first, stop, inside, displacement, velocity, interval), begin, end)
            )
    return tuple(found)


def _moving(
    first: int,
    stop: int,
    turns: IntArray,
    displacement: FloatArray,
    velocity: FloatArray,
    interval: float,
) -> Stretch:
    part = slice(first, stop)
    n_turns = max(int(np.count_nonzero((turns >= first) & (turns < stop))), 1)
    return Stretch(
        kind="moving",
        first=first,
        stop=stop,
        cycle_starts=np.empty(0),
        frequency=0.5 * n_turns / ((stop - first) * interval),
        amplitude=0.5 * float(np.ptp(displacement[part])),
        peak_speed=float(np.abs(velocity[part]).max()),
    )


def _parts(is_moving: NDArray[np.bool_], pause: int) -> Sequence[tuple[int, int]]:
    """Return first and stop of the parts that move, short pauses counted in."""
    at = np.flatnonzero(is_moving)
    if not len(at):
        return ()
    breaks = np.flatnonzero(np.diff(at) > pause)
    firsts = at[np.concatenate([[0], breaks + 1])]
    stops = at[np.concatenate([breaks, [len(at) - 1]])] + 1
    # The log's own ends: a turn there is no rest.
    firsts[0] = 0 if firsts[0] <= pause else firsts[0]
    stops[-1] = len(is_moving) if len(is_moving) - stops[-1] <= pause else stops[-1]
    return list(zip(firsts.tolist(), stops.tolist(), strict=True))
