"""Cycles of a motion: where they begin, which of them are one test, and the runs that repeat.

A cycle runs from one upward crossing of mid-stroke to the next. A crossing counts only when the
displacement goes beyond a quarter of the amplitude on both sides, so noise at rest makes none.
Positions are fractional samples, from the cubic Hermite piece of (x, v).
"""

from __future__ import annotations

import math
from bisect import bisect_left, insort
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from damperfit.compiled_core import compiled_core
from damperfit.statistics import mean_of, median, percentiles

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]
    from damperfit.recording import Stretch

    IntArray = NDArray[np.int64]
    from collections.abc import Iterator

__all__ = [
    "FEWEST",
    "MIN_CYCLES",
    "TURN",
    "Cycles",
    "SteadyRun",
    "Turns",
    "clean_cycles",
    "crossings",
    "cycles_of",
    "ends_in_motion",
    "fastest_frequency",
    "find_cycles",
    "harmonic_powers",
    "level_parts",
    "level_share",
    "like_halves",
    "off_level",
    "run_of",
    "runs_of",
    "turning_points",
]


# Which of a run's cycles are one and the same test: a cycle that leads over to another is not.
#
# Cycles whose neighbours are alike may still drift from one speed to another, or end with a cycle
# of another frequency. So a run is cut where a cycle leaves the level of those before it, by more
# than 1 % of the period or 2 % of the amplitude (rigs repeat a period to 0.3 %), or by what this
# rig's cycles scatter, if that is more. Parts that keep their level are the tests, where they are
# half of the run and more; a part of a sweep uses up its whole allowance by drifting. A run that
# wanders without levels is one test of an unsteady rig as long as it stays within twice the
# steadiness, else a sweep. At last half strokes are taken off both ends that are longer, shorter,
# higher or lower than the others of their direction.

_PERIOD, _AMPLITUDE = 0.01, 0.02
# A quarter of the second differences of normal scatter s are below 0.78 s: 4.4 of them are 3.4 s,
# which is five median deviations.
_USUAL = 4.4
_KEPT = 0.6  # of the allowance; what drifts through more is on its way
_ONE = 0.4  # of the least allowance; 0.6 / 1.5
_SHARE = 0.5  # of the run
_RECENT = 200  # half cycles that say the level; of all of them an hour's log would take minutes


def level_parts(
    period: FloatArray, amplitude: FloatArray, *, fewest: int, steadiness: float
) -> Sequence[tuple[int, int]]:
    """Return first and stop of the parts of a run that are steady tests."""
    if len(period) >= fewest and all(
        _is_one(values, min(least, steadiness))
        for values, least in ((period, _PERIOD), (amplitude, _AMPLITUDE))
    ):
        return ((0, len(period)),)
    allowed = _allowed(period, _PERIOD, steadiness), _allowed(amplitude, _AMPLITUDE, steadiness)
    whole = _trimmed(period, amplitude, 0, len(period), allowed)
    parts = [
        part
        for first, stop in _parts(period, amplitude, allowed)
        if (part := _trimmed(period, amplitude, first, stop, allowed))[1] - part[0] >= fewest
        and _keeps_level(period, *part, allowed[0])
        and _keeps_level(amplitude, *part, allowed[1])
    ]
    if sum(stop - first for first, stop in parts) >= _SHARE * len(period):
        return parts
    inside = period[slice(*whole)]
    if len(inside) < fewest or np.log(inside.max() / inside.min()) > 2.0 * steadiness:
        return ()
    return (whole,)


def like_halves(
    passages: FloatArray, turns: FloatArray, first: int, stop: int, *, near: float
) -> tuple[int, int]:
    """Take off both ends of a part the half strokes that are of another motion."""
    while stop - first > 1:
        halves = np.diff(passages[first : stop + 2])
        tops = turns[first + 1 : stop + 2]
        usual = _by_direction(halves)
        shorter = float(usual.min())
        is_off = np.abs(halves / usual - 1.0) > max(_PERIOD, near / shorter)
        usual = _by_direction(tops)
        swing = max(_AMPLITUDE, 2.0 * near / shorter) * 0.5 * float(np.ptp(usual))
        is_off |= np.abs(tops - usual) > swing
        if is_off[0]:
            first += 1
        elif is_off[-1]:
            stop -= 1
        else:
            break
    return first, stop


def _by_direction(values: FloatArray) -> FloatArray:
    """Return the median of the half strokes of each one's direction."""
    usual = np.empty(len(values))
    for k in (0, 1):
        usual[k::2] = median(values[k::2])
    return usual


def off_level(values: FloatArray, kind: str, steadiness: float) -> NDArray[np.bool_]:
    """Return which cycles are off the level of the others."""
    least = _PERIOD if kind == "period" else _AMPLITUDE
    middle = median(values)
    allowed = _allowed(values, least, steadiness, lag=1)
    return np.asarray(np.abs(values - middle) > allowed * middle)


def level_share(periods: FloatArray, steadiness: float) -> float:
    """Return the share by which cycles of one test may differ in period."""
    return _allowed(periods, _PERIOD, steadiness, lag=1)


def _is_one(values: FloatArray, least: float) -> bool:
    """Whether values lie so near to each other that nothing below cuts, trims or tilts them.

    All differ from any of their medians by less than the least allowance; a line through them
    goes over 1.5 times their range at most, and 0.6 of the allowance is what it may.
    """
    return float(values.max() - values.min()) <= _ONE * least * float(values.min())


def _allowed(values: FloatArray, least: float, steadiness: float, *, lag: int = 2) -> float:
    """Return the share by which a cycle may be off the others; steps and drifts do not widen it."""
    bent = values[2 * lag :] - 2.0 * values[lag:-lag] + values[: -2 * lag]
    if not len(bent):
        return least
    rank = (len(bent) - 1) // 4
    scatter = float(np.partition(np.abs(bent), rank)[rank]) / median(values)
    return min(max(least, _USUAL * scatter), steadiness)


def _parts(
    period: FloatArray, amplitude: FloatArray, allowed: tuple[float, float]
) -> list[tuple[int, int]]:
    """Cut a run where a cycle is off the median of the last ones since the last cut."""
    channels = list(zip((period.tolist(), amplitude.tolist()), allowed, strict=True))
    # In order at all times: a median sought anew for each cycle takes far longer.
    recent: list[list[float]] = [[values[0]] for values, _ in channels]
    parts, first = [], 0
    for k in range(1, len(period) + 1):
        if k < len(period) and all(
            abs(values[k] / _middle(order) - 1.0) <= share
            for (values, share), order in zip(channels, recent, strict=True)
        ):
            for (values, _), order in zip(channels, recent, strict=True):
                insort(order, values[k])
                if k - first >= _RECENT:
                    del order[bisect_left(order, values[k - _RECENT])]
            continue
        parts.append((first, k))
        first = k
        recent = [values[k : k + 1] for values, _ in channels]
    return parts


def _middle(order: list[float]) -> float:
    """Return the median of values in order."""
    half = len(order) // 2
    return order[half] if len(order) % 2 else 0.5 * (order[half - 1] + order[half])


def _trimmed(
    period: FloatArray,
    amplitude: FloatArray,
    first: int,
    stop: int,
    allowed: tuple[float, float],
) -> tuple[int, int]:
    """Take cycles off both ends of a run that are not like those inside."""
    is_off = np.zeros(stop - first, dtype=bool)
    for values, share in zip((period, amplitude), allowed, strict=True):
        middle = median(values[first:stop])
        is_off |= np.abs(values[first:stop] - middle) > share * middle
    while stop > first and is_off[0]:
        first, is_off = first + 1, is_off[1:]
    while stop > first and is_off[-1]:
        stop, is_off = stop - 1, is_off[:-1]
    return first, stop


def _keeps_level(values: FloatArray, first: int, stop: int, allowed: float) -> bool:
    """Whether a straight line through a part stays within its allowance."""
    part = values[first:stop]
    place = np.arange(len(part)) - 0.5 * (len(part) - 1)
    slope = float(place @ part) / float(place @ place)
    return abs(slope) * (len(part) - 1) <= _KEPT * allowed * median(part)


_HYSTERESIS = 0.25  # of the amplitude
_NEWTON = 4  # steps, of a crossing
_MIN_SHARE = 0.1  # of all cycles; noise has many, but hardly two alike in a row


class Cycles(NamedTuple):
    """The longest run of steady cycles in a motion.

    Attributes
    ----------
    rising, falling : numpy.ndarray
        Fractional sample positions of the steady upward and downward crossings.
    period : float
        Median, samples.
    centre, amplitude : float
        Mid-stroke and half the stroke, medians over the steady cycles, m.
    n_found : int
        Whole cycles of motion in the log, steady or not.
    n_elsewhere : int
        Steady cycles outside of the longest run of them, beyond a break in the motion.
    break_at : float
        Where the run meets the nearest break, samples; NaN where nothing stands beyond.
    begin, end : float
        Where cycles of another length or size begin, samples; infinite where none do.
    """

    rising: FloatArray
    falling: FloatArray
    period: float
    centre: float
    amplitude: float
    n_found: int
    n_elsewhere: int = 0
    break_at: float = math.nan
    begin: float = -math.inf
    end: float = math.inf


def find_cycles(
    displacement: FloatArray, velocity: FloatArray, *, steadiness: float
) -> Cycles | None:
    """Return the steady cycles of a motion, or None when there are none.

    Parameters
    ----------
    displacement, velocity : numpy.ndarray
        Shape (n,); m and metres per sample interval.
    steadiness : float
        Fraction of the medians within which amplitude and period must be.
    """
    speed = np.abs(velocity)
    moving = displacement[speed > 0.5 * np.sqrt(mean_of(velocity**2))]
    if not len(moving):
        return None
    low, level, high = percentiles(moving, 5.0, 50.0, 95.0)
    amplitude = 0.5 * (high - low)
    run = None
    for _ in range(3):  # the first level is a guess; the second is exact to rounding
        run = _steady_run(displacement, velocity, level, _HYSTERESIS * amplitude, steadiness)
        if run is None:
            return None
        level, amplitude = level + run.middle, run.amplitude
        if abs(run.middle) < 1e-6 * amplitude:
            break
    assert run is not None
    rising, falling = (
        crossings(displacement, velocity, _HYSTERESIS * amplitude, level=level, sign=sign)
        for sign in (1.0, -1.0)
    )
    first = max(run.boundaries[0] - 0.75 * run.period, run.begin - 1.0)
    last = min(run.boundaries[-1] + 0.75 * run.period, run.end + 1.0)
    between, begin, end = _of_run(falling[(falling > first) & (falling < last)], run, steadiness)
    return Cycles(
        rising=run.boundaries,
        falling=between,
        period=run.period,
        centre=float(level),
        amplitude=run.amplitude,
        n_found=_whole_cycles(np.sort(np.concatenate([rising, falling])), run.period, len(speed)),
        n_elsewhere=run.n_elsewhere,
        break_at=run.break_at,
        begin=begin,
        end=end,
    )


class _Run(NamedTuple):
    boundaries: FloatArray
    period: float
    middle: float
    amplitude: float
    n_elsewhere: int
    break_at: float
    begin: float
    end: float


def _steady_run(
    x: FloatArray, velocity: FloatArray, level: float, hysteresis: float, steadiness: float
) -> _Run | None:
    boundaries = crossings(x, velocity, hysteresis, level=level)
    if len(boundaries) < 2:
        return None
    periods = np.diff(boundaries)
    tops = _tops(x, velocity, boundaries, level)
    bottoms = -_tops(x, velocity, boundaries, level, sign=-1.0)
    amplitudes = 0.5 * (tops - bottoms)
    is_steady = _near_median(periods, steadiness) & _near_median(amplitudes, steadiness)
    start, stop = _longest(is_steady)
    if stop - start < max(1.0, _MIN_SHARE * len(periods)):
        return None
    before, behind = int(np.sum(is_steady[:start])), int(np.sum(is_steady[stop:]))
    ends = start, stop
    start, stop = _without_others(periods, amplitudes, start, stop, steadiness)
    steady = slice(start, stop)
    nearest = boundaries[stop] if behind >= before else boundaries[start]
    return _Run(
        boundaries=boundaries[start : stop + 1],
        period=median(periods[steady]),
        middle=median(0.5 * (tops + bottoms)[steady]),
        amplitude=median(amplitudes[steady]),
        n_elsewhere=before + behind,
        break_at=float(nearest) if before + behind else math.nan,
        begin=float(boundaries[start]) if start > ends[0] else -math.inf,
        end=float(boundaries[stop]) if stop < ends[1] else math.inf,
    )


def _of_run(falling: FloatArray, run: _Run, steadiness: float) -> tuple[FloatArray, float, float]:
    """Return the falling passages of a run, and where it begins and ends by them.

    The first and the last may stand half a cycle outside of the rising ones: there half of the
    difference that a cycle may have is enough.
    """
    begin, end = run.begin, run.end
    rising = run.boundaries
    allowed = 0.5 * level_share(np.diff(rising), steadiness) * run.period
    inside = falling[(falling > rising[0]) & (falling < rising[-1])]
    if not len(inside):
        return falling, begin, end
    ahead, behind = inside[0] - falling[0], falling[-1] - inside[-1]
    if ahead > 0.0 and abs(ahead - run.period) > allowed:
        falling, begin = falling[1:], float(rising[0])
    if behind > 0.0 and abs(behind - run.period) > allowed:
        falling, end = falling[:-1], float(rising[-1])
    return falling, begin, end


def _without_others(
    periods: FloatArray, amplitudes: FloatArray, start: int, stop: int, steadiness: float
) -> tuple[int, int]:
    """Leave out cycles at both ends that lead over to another test."""
    is_off = off_level(periods[start:stop], "period", steadiness)
    is_off |= off_level(amplitudes[start:stop], "amplitude", steadiness)
    like = np.flatnonzero(~is_off)
    return (start + int(like[0]), start + int(like[-1]) + 1) if len(like) else (start, stop)


def _near_median(values: FloatArray, tolerance: float) -> NDArray[np.bool_]:
    middle = median(values)
    return np.abs(values - middle) <= tolerance * middle


def _longest(is_steady: NDArray[np.bool_]) -> tuple[int, int]:
    """Return start and stop of the longest run of True; the first of equals."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], is_steady.astype(np.int8), [0]])))
    if not len(edges):
        return 0, 0
    starts, stops = edges[::2], edges[1::2]
    best = int(np.argmax(stops - starts))
    return int(starts[best]), int(stops[best])


def crossings(
    x: FloatArray, velocity: FloatArray, hysteresis: float, *, level: float = 0.0, sign: float = 1.0
) -> FloatArray:
    """Return fractional positions where x rises through a level, from -h to +h beside it.

    Parameters
    ----------
    x, velocity : numpy.ndarray
        Shape (n,); m and metres per sample interval.
    hysteresis : float
        h, m.
    level : float
        m.
    sign : float
        1; or -1, where x falls.
    """
    y = sign * (x - level)
    beyond = np.flatnonzero(np.abs(y) > hysteresis)
    is_above = y[beyond] > 0.0
    risen = beyond[1:][is_above[1:] & ~is_above[:-1]]
    if not len(risen):
        return np.empty(0)
    is_below = y < 0.0
    rises = np.flatnonzero(is_below[:-1] & ~is_below[1:])
    before = rises[np.searchsorted(rises, risen) - 1]
    y0, c1, c2, c3 = _hermite(y, sign * velocity, before)
    chord = y[before + 1] - y0
    u = -y0 / chord
    for _ in range(_NEWTON):
        # Near a turning point in noise the slope may vanish; the chord's is safe there.
        slope = c1 + u * (2.0 * c2 + 3.0 * c3 * u)
        slope = np.where(slope > 0.2 * chord, slope, chord)
        u = np.clip(u - (y0 + u * (c1 + u * (c2 + c3 * u))) / slope, 0.0, 1.0)
    return np.asarray(before + u)


def _hermite(y: FloatArray, v: FloatArray, at: IntArray) -> tuple[FloatArray, ...]:
    """Return the coefficients of the cubic pieces from samples to the next."""
    y0, y1, v0, v1 = y[at], y[at + 1], v[at], v[at + 1]
    return y0, v0, 3.0 * (y1 - y0) - 2.0 * v0 - v1, 2.0 * (y0 - y1) + v0 + v1


def clean_cycles(stretch: Stretch) -> FloatArray:
    """Return boundaries of the cycles in which the filter holds no other motion, samples.

    Where it holds one in all of them, those of the cycle farthest from both.

    Parameters
    ----------
    stretch : Stretch
        Steady cycles.
    """
    starts = stretch.cycle_starts
    if stretch.smeared == (0, 0):
        return starts
    low, high = stretch.first + stretch.smeared[0], stretch.stop - stretch.smeared[1]
    clean = starts[(starts >= low) & (starts <= high)]
    if len(clean) >= 2:
        return clean
    period = float(starts[-1] - starts[0]) / stretch.n_cycles
    begin = min(max(0.5 * (low + high - period), float(starts[0])), float(starts[-1]) - period)
    return np.array([begin, begin + period])


def _tops(
    x: FloatArray, velocity: FloatArray, boundaries: FloatArray, level: float, *, sign: float = 1.0
) -> FloatArray:
    """Return the top of each cycle: that of the Hermite piece beside its highest sample."""
    y, v = sign * (x - level), sign * velocity
    cuts = np.ceil(boundaries).astype(np.int64).tolist()
    highest = np.array(
        [begin + int(np.argmax(y[begin : max(end, begin + 1)])) for begin, end in pairwise(cuts)]
    )
    left = np.clip(np.where(v[highest] > 0.0, highest, highest - 1), 0, len(y) - 2)
    y0, c1, c2, c3 = _hermite(y, v, left)
    # The slope falls through zero here; this root allows c3 = 0.
    below = np.sqrt(np.maximum(c2 * c2 - 3.0 * c3 * c1, 0.0)) - c2
    u = np.clip(np.divide(c1, below, out=np.zeros_like(c1), where=below > 0.0), 0.0, 1.0)
    return np.asarray(np.maximum(y[highest], y0 + u * (c1 + u * (c2 + c3 * u))))


def _whole_cycles(crossings: FloatArray, period: float, n: int) -> int:
    """Return how many whole cycles fit from the beginning of the motion to its end.

    Ahead of the first and behind the last crossing, up to half a cycle is motion that the log's
    ends cut; more is rest, run-up or coast-down. The last crossing is not seen until the hysteresis
    behind it is passed, up to a sample later.
    """
    ahead, behind = float(crossings[0]), n - float(crossings[-1])
    length = float(crossings[-1] - crossings[0])
    length += sum(part for part in (ahead, behind) if part <= 0.55 * period + 1.0)
    return int(length / period + 0.02)


# Cycles of a motion that may change its speed, and the runs of them that repeat.
#
# A motion is read as turning points: a turn counts when the way back from it is a fiftieth of the
# whole range, so that small strokes beside large ones are seen and noise is not. A cycle runs
# from one passage through the middle of its own stroke to the next but one. Cycles whose
# neighbours have their period, amplitude and middle within `steadiness` make a run, or several
# where its level changes (`damperfit.conditioning.cycles`).

TURN = 0.02  # of the whole range
MIN_CYCLES = 3  # whole ones, of a test
FEWEST = 3  # passages at which a cycle begins: two whole cycles
_CUT = 0.8  # of a cycle may be ahead of a run's first passage: the turn before it, cut
_ALIKE = 0.1  # of the amplitude; the period is rounded to a sample


class Turns(NamedTuple):
    """Cycles that begin at each passage through the middle of a stroke, up or down.

    Samples at which it turns, and the displacement there; so many samples from a passage to the
    next but one; half the stroke and the middle of both strokes between.
    """

    at: IntArray
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
    """Return the facts of a run."""
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
    at_turns = x[turns]
    passages = _passages(x, turns)
    strokes = np.abs(np.diff(at_turns))
    return Turns(
        turns,
        at_turns,
        passages,
        np.asarray(passages[2:] - passages[: max(len(passages) - 2, 0)]),
        0.25 * (strokes[:-2] + strokes[1:-1]),
        0.25 * (at_turns[:-3] + 2.0 * at_turns[1:-2] + at_turns[2:-1]),
    )


def _passages(x: FloatArray, turns: IntArray) -> FloatArray:
    """Return where the motion first passes the middle between its turns, fractional samples."""
    begin, end = turns[:-1], turns[1:]
    if not len(begin):
        return np.empty(0)
    sign = np.where(x[end] > x[begin], 1.0, -1.0)
    middle = 0.5 * (x[begin] + x[end])
    own = np.repeat(np.arange(len(begin)), end - begin)  # of each sample behind a turn
    beyond = sign[own] * (x[turns[0] + 1 : turns[-1] + 1] - middle[own])
    passed = np.flatnonzero(beyond >= 0.0)
    at = turns[0] + 1 + passed[np.searchsorted(passed, begin - turns[0])]
    here, before = sign * (x[at] - middle), sign * (x[at - 1] - middle)
    return np.asarray(at - here / (here - before))


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
    """Return the samples in a cycle of the motion a log begins in, and ends in; None: in none."""
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
    """Return the frequency of a motion's fastest part, cycles per sample; 0 where nothing moves."""
    seen = cycles_of(displacement)
    if len(seen.passages) < FEWEST:
        return 0.0
    runs = [run_of(seen, *run) for run in runs_of(seen, steadiness, near=1.0)]
    if runs:
        return 1.0 / max(runs, key=lambda run: run.amplitude / run.period).period
    return 1.0 / percentiles(seen.period, 5.0)[0]


def harmonic_powers(values: FloatArray, turns: float, n_powers: int) -> FloatArray:
    """Return the power of the harmonics of a motion in whole cycles of a channel.

    Examples
    --------
    >>> angle = 2.0 * np.pi * np.arange(300) / 100
    >>> harmonic_powers(2.0 * np.sin(angle) + 0.2 * np.sin(3.0 * angle), 0.01, 3).round(6)
    array([1.  , 0.  , 0.01])
    """
    turned = values - mean_of(values) + 0j
    turn = np.exp(-2j * np.pi * turns * np.arange(len(values)))
    powers = np.empty(n_powers)
    for k in range(n_powers):
        turned *= turn
        powers[k] = abs(complex(turned.sum())) ** 2 / len(values) ** 2
    return powers
