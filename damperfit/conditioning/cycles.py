"""Cycles of a motion: where they begin, which of them are one test, and the runs that repeat.

A cycle runs from one upward crossing of mid-stroke to the next. A crossing counts only when the
displacement goes beyond a quarter of the amplitude on both sides, so noise at rest makes none.
Positions are fractional samples, from the cubic Hermite piece of (x, v).
"""

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from damperfit.compiled_core import compiled_core
from damperfit.conditioning.signals import FloatArray, IntArray, parts_where
from damperfit.recording import Segment
from damperfit.statistics import mean_of, median, percentiles

MIN_CYCLES = 3  # whole ones, of a test
HYSTERESIS = 0.25  # of the amplitude
_NEWTON = 4  # steps, of a crossing
_MIN_SHARE = 0.1  # of all cycles; noise has many, but hardly two alike in a row


def crossings(
    x: FloatArray, velocity: FloatArray, hysteresis: float, *, level: float, sign: float = 1.0
) -> FloatArray:
    """Return fractional positions where x rises (sign -1: falls) through a level, from -h to +h."""
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


def tops_of(
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


def clean_cycles(segment: Segment) -> FloatArray:
    """Return boundaries of the cycles in which the filter holds no other motion, samples."""
    starts = segment.cycle_starts
    if segment.smeared == (0, 0):
        return starts
    low, high = segment.first + segment.smeared[0], segment.stop - segment.smeared[1]
    clean = starts[(starts >= low) & (starts <= high)]
    if len(clean) >= 2:
        return clean
    # It holds one in all of them: the cycle that is farthest from both.
    period = float(starts[-1] - starts[0]) / segment.n_cycles
    begin = min(max(0.5 * (low + high - period), float(starts[0])), float(starts[-1]) - period)
    return np.array([begin, begin + period])


def harmonic_powers(segment: Segment, values: FloatArray, n_powers: int) -> FloatArray:
    """Return the power of the harmonics of a motion in a channel, over its clean cycles."""
    starts = clean_cycles(segment)
    part = values[round(float(starts[0])) : round(float(starts[-1]))]
    turns = (len(starts) - 1) / float(starts[-1] - starts[0])
    turned = part - mean_of(part) + 0j
    turn = np.exp(-2j * np.pi * turns * np.arange(len(part)))
    powers = np.empty(n_powers)
    for k in range(n_powers):
        turned *= turn
        powers[k] = abs(complex(turned.sum())) ** 2 / len(part) ** 2
    return powers


# Cycles of a motion that may change its speed, and the runs of them that repeat.
#
# A motion is read as turning points: a turn counts when the way back from it is a fiftieth of the
# whole range, so that small strokes beside large ones are seen and noise is not. A cycle runs
# from one passage through the middle of its own stroke to the next but one. Cycles whose
# neighbours have their period, amplitude and middle within `steadiness` make a run, or several
# where its level changes.

TURN = 0.02  # of the whole range
_NEAR = 0.01  # of a cycle; rigs repeat a period to 0.3 %
_FEWEST = 3  # passages at which a cycle begins: two whole cycles
_CUT = 0.8  # of a cycle may be ahead of a run's first passage: the turn before it, cut
_ALIKE = 0.1  # of the amplitude; the period is rounded to a sample


class Turns(NamedTuple):
    """Cycles that begin at each passage through the middle of a stroke, up or down."""

    at: IntArray  # samples at which the motion turns
    at_turns: FloatArray  # displacement there
    passages: FloatArray  # fractional samples
    period: FloatArray  # so many samples from a passage to the next but one
    amplitude: FloatArray  # half the stroke, and the middle of both strokes between
    middle: FloatArray


class SteadyRun(NamedTuple):
    """A run: its cycles, its passages as first found, and medians of its cycles."""

    cycles: slice
    first: float  # samples
    last: float
    period: float
    amplitude: float  # m
    middle: float


class FoundSegment(NamedTuple):
    """A segment, in samples of the log, and the breaks of the motion between which it lies."""

    segment: Segment
    begin: float = -math.inf  # infinite where its motion begins, and ends, with the log
    end: float = math.inf


def turning_points(x: FloatArray, reach: float) -> IntArray:
    """Return the samples at which the motion turns; a turn counts from a way back, m, on."""
    samples = np.ascontiguousarray(x, np.float64)
    turns = np.empty(len(samples), np.int64)
    return turns[: compiled_core().turns(samples, turns, reach)].copy()


def cycles_of(x: FloatArray) -> Turns:
    """Return the cycles of a displacement, m."""
    turns = turning_points(x, TURN * float(np.ptp(x)))
    at_turns = x[turns]
    passages = np.empty(0)
    if len(turns) > 1:  # where the motion first passes the middle between its turns
        begin, end = turns[:-1], turns[1:]
        sign = np.where(x[end] > x[begin], 1.0, -1.0)
        middle = 0.5 * (x[begin] + x[end])
        own = np.repeat(np.arange(len(begin)), end - begin)  # of each sample behind a turn
        beyond = sign[own] * (x[turns[0] + 1 : turns[-1] + 1] - middle[own])
        passed = np.flatnonzero(beyond >= 0.0)
        at = turns[0] + 1 + passed[np.searchsorted(passed, begin - turns[0])]
        here, before = sign * (x[at] - middle), sign * (x[at - 1] - middle)
        passages = np.asarray(at - here / (here - before))
    strokes = np.abs(np.diff(at_turns))
    return Turns(
        turns,
        at_turns,
        passages,
        period=passages[2:] - passages[:-2],
        amplitude=0.25 * (strokes[:-2] + strokes[1:-1]),
        middle=0.25 * (at_turns[:-3] + 2.0 * at_turns[1:-2] + at_turns[2:-1]),
    )


def runs_of(seen: Turns, steadiness: float, *, near: float) -> Iterator[SteadyRun]:
    """Yield the runs of a motion; a passage may be `near` samples off."""
    period, amplitude, middle = seen.period, seen.amplitude, seen.middle
    smaller = np.minimum(amplitude[:-1], amplitude[1:])
    alike = (
        (np.abs(np.log(period[1:] / period[:-1])) <= steadiness)
        & (np.abs(np.log(amplitude[1:] / amplitude[:-1])) <= steadiness)
        & (np.abs(np.diff(middle)) <= steadiness * smaller)
    )
    ends = [0, *(np.flatnonzero(~alike) + 1).tolist(), len(period)] if len(period) else []
    for begin, end in pairwise(ends):
        for first, stop in _level_parts(period[begin:end], amplitude[begin:end], steadiness):
            cycles = _like_halves(seen, begin + first, begin + stop, near=near)
            if cycles.stop - cycles.start >= _FEWEST:
                yield SteadyRun(
                    cycles,
                    float(seen.passages[cycles.start]),
                    float(seen.passages[cycles.stop + 1]),
                    *(median(values[cycles]) for values in (period, amplitude, middle)),
                )


def passages_of(at: FloatArray, run: SteadyRun, x: FloatArray, *, moved: float) -> FloatArray:
    """The passages of one direction that are a run's, one more at an end if alike."""
    near = 0.02 * run.period
    inside = at[(at >= run.first - near) & (at <= run.last + near)]
    if not len(inside):
        return inside
    share = max(0.02, 4.0 * moved / run.period)

    def more(here: float, there: float) -> FloatArray:
        near = at[np.abs(at - there) <= max(0.5 * _NEAR * run.period, moved)][:1]
        low, high = min([here, *near]), max([here, *near])
        part = x[math.ceil(low) : math.ceil(high)] if len(near) else x[:0]
        # Three cycles of 1.5 Hz are as long as one of 0.5 Hz, but none of its own.
        if not len(part) or np.any((at > low) & (at < high)):
            return near[:0]
        ends = np.array([part.max() - run.middle, run.middle - part.min()])
        return near[: int(np.all(np.abs(ends / run.amplitude - 1.0) <= share))]

    first, last = float(inside[0]), float(inside[-1])
    return np.concatenate([more(first, first - run.period), inside, more(last, last + run.period)])


class Cycles(NamedTuple):
    """The longest run of steady cycles in a motion, cut at the middle of its stroke."""

    rising: FloatArray  # fractional samples of the upward crossings
    falling: FloatArray  # and of the downward ones
    period: float  # median, samples
    centre: float  # mid-stroke and half the stroke, medians over the cycles, m
    amplitude: float
    begin: float  # where cycles of another length or size begin, samples; infinite: none do
    end: float
    n_found: int  # whole cycles of motion in the log, steady or not
    n_elsewhere: int  # steady cycles beyond a break in the motion
    break_at: float  # where the run meets the nearest break, samples


def cycles_in(
    x: FloatArray, speed: FloatArray, run: SteadyRun | None, steadiness: float
) -> Cycles | None:
    """Return the cycles of x, m, with its speed, m per sample, about a run's middle, if any."""
    if run is not None:
        middle, amplitude = run.middle, run.amplitude
    else:  # noise may hide the turns
        moving = x[np.abs(speed) > 0.5 * np.sqrt(mean_of(speed**2))]
        if not len(moving):
            return None
        low, middle, high = percentiles(moving, 5.0, 50.0, 95.0)
        amplitude = 0.5 * (high - low)
    tries = 0
    while True:  # the first middle is a guess; the second is exact to rounding
        tries += 1
        at = crossings(x, speed, HYSTERESIS * amplitude, level=middle)
        if len(at) < 2:
            return None
        tops, bottoms = (sign * tops_of(x, speed, at, middle, sign=sign) for sign in (1.0, -1.0))
        channels = (np.diff(at), _PERIOD), (0.5 * (tops - bottoms), _AMPLITUDE)
        is_steady = np.ones(len(at) - 1, dtype=bool)
        for values, _ in channels:
            is_steady &= np.abs(values - median(values)) <= steadiness * median(values)
        starts, stops = parts_where(is_steady)
        longest = int(np.argmax(stops - starts)) if len(starts) else 0  # the first of equals
        first, stop = (int(ends[longest]) for ends in (starts, stops)) if len(starts) else (0, 0)
        if stop - first < max(1.0, _MIN_SHARE * len(is_steady)):
            return None
        # Cycles at both ends that lead over to another test are left out.
        allowed = [
            (values, _allowed(values[first:stop], least, steadiness, lag=1))
            for values, least in channels
        ]
        begin, end = _trimmed(allowed, first, stop)
        if begin == end:
            begin, end = first, stop
        period, amplitude = (median(values[begin:end]) for values, _ in channels)
        off = median(0.5 * (tops + bottoms)[begin:end])
        middle += off
        if tries == 3 or abs(off) < 1e-6 * amplitude:
            break
    falling = crossings(x, speed, HYSTERESIS * amplitude, level=middle, sign=-1.0)
    # Ahead of the first and behind the last crossing, up to half a cycle is motion that the log's
    # ends cut; more is rest, run-up or coast-down. The last crossing is not seen until the
    # hysteresis behind it is passed, up to a sample later.
    marks = np.sort(np.concatenate([at, falling]))
    ahead, length = float(marks[0]), float(marks[-1] - marks[0])
    length += sum(
        part for part in (ahead, len(x) - float(marks[-1])) if part <= 0.55 * period + 1.0
    )
    low, high = float(at[begin]), float(at[end])
    starts_off, stops_off = begin > first, end < stop
    outer = (
        low - (1.0 if starts_off else 0.75 * period),
        high + (1.0 if stops_off else 0.75 * period),
    )
    falling = falling[(falling > outer[0]) & (falling < outer[1])]
    inside = falling[(falling > low) & (falling < high)]
    if len(inside):
        # The outer ones may stand half a cycle outside of the rising ones: there half of the
        # difference that a cycle may have is enough.
        spare = 0.5 * allowed[0][1] * period
        ahead, behind = inside[0] - falling[0], falling[-1] - inside[-1]
        if ahead > 0.0 and abs(ahead - period) > spare:
            falling, starts_off = falling[1:], True
        if behind > 0.0 and abs(behind - period) > spare:
            falling, stops_off = falling[:-1], True
    before, beyond = int(np.sum(is_steady[:first])), int(np.sum(is_steady[stop:]))
    return Cycles(
        at[begin : end + 1],
        falling,
        period,
        middle,
        amplitude,
        begin=low if starts_off else -math.inf,
        end=high if stops_off else math.inf,
        n_found=int(length / period + 0.02),
        n_elsewhere=before + beyond,
        break_at=high if beyond >= before else low,
    )


def ends_in_motion(
    displacement: FloatArray, steadiness: float
) -> tuple[float | None, float | None]:
    """Return the samples in a cycle of the motion a log begins in, and ends in; None: in none."""
    runs = list(runs_of(cycles_of(displacement), steadiness, near=1.0))
    if not runs:
        return None, None

    def own_period(x: FloatArray, ahead: float, run: SteadyRun) -> float | None:
        """The run's, where what is ahead of its first passage is of the same motion."""
        n, period = math.ceil(ahead), round(run.period)
        if ahead > _CUT * run.period or n + period >= len(x):
            return None
        off = float(np.abs(x[: n + 1] - x[period : period + n + 1]).max())
        return run.period if off < _ALIKE * run.amplitude else None

    behind = len(displacement) - 1.0 - runs[-1].last
    return (
        own_period(displacement, runs[0].first, runs[0]),
        own_period(displacement[::-1], behind, runs[-1]),
    )


def fastest_frequency(displacement: FloatArray, steadiness: float) -> float:
    """Return the frequency of a motion's fastest part, cycles per sample; 0 where nothing moves."""
    seen = cycles_of(displacement)
    if not len(seen.period):
        return 0.0
    runs = runs_of(seen, steadiness, near=1.0)
    fastest = max(runs, key=lambda run: run.amplitude / run.period, default=None)
    return 1.0 / (fastest.period if fastest else percentiles(seen.period, 5.0)[0])


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
_SHARE = 0.5  # of the run
_RECENT = 200  # half cycles that say the level; of all of them an hour's log would take minutes


def _level_parts(
    period: FloatArray, amplitude: FloatArray, steadiness: float
) -> Sequence[tuple[int, int]]:
    """Return first and stop of the parts of a run that are steady tests."""
    n = len(period)
    if n < _FEWEST:
        return ()
    channels = [
        (values, _allowed(values, least, steadiness))
        for values, least in ((period, _PERIOD), (amplitude, _AMPLITUDE))
    ]
    cuts = [0]  # where a cycle is off the median of the last ones since the last cut
    for k in range(1, n):
        recent = slice(max(cuts[-1], k - _RECENT), k)
        if any(abs(row[k] / median(row[recent]) - 1.0) > share for row, share in channels):
            cuts.append(k)

    def keeps_level(part: FloatArray, allowed: float) -> bool:
        """Whether a straight line through a part stays within its allowance."""
        place = np.arange(len(part)) - 0.5 * (len(part) - 1)
        slope = float(place @ part) / float(place @ place)
        return abs(slope) * (len(part) - 1) <= _KEPT * allowed * median(part)

    parts = [_trimmed(channels, *ends) for ends in pairwise([*cuts, n])]
    parts = [
        (first, stop)
        for first, stop in parts
        if stop - first >= _FEWEST
        and all(keeps_level(row[first:stop], allowed) for row, allowed in channels)
    ]
    if sum(stop - first for first, stop in parts) >= _SHARE * n:
        return parts
    whole = _trimmed(channels, 0, n)
    inside = period[slice(*whole)]
    if len(inside) < _FEWEST or np.log(inside.max() / inside.min()) > 2.0 * steadiness:
        return ()
    return (whole,)


def _allowed(values: FloatArray, least: float, steadiness: float, *, lag: int = 2) -> float:
    """Return the share by which a cycle may be off the others; steps and drifts do not widen it."""
    bent = values[2 * lag :] - 2.0 * values[lag:-lag] + values[: -2 * lag]
    if not len(bent):
        return least
    rank = (len(bent) - 1) // 4
    scatter = float(np.partition(np.abs(bent), rank)[rank]) / median(values)
    return min(max(least, _USUAL * scatter), steadiness)


def _trimmed(
    channels: Sequence[tuple[FloatArray, float]], first: int, stop: int
) -> tuple[int, int]:
    """Take cycles off both ends of a run that are not like those inside."""
    is_off = np.zeros(stop - first, dtype=bool)
    for values, share in channels:
        middle = median(values[first:stop])
        is_off |= np.abs(values[first:stop] - middle) > share * middle
    like = np.flatnonzero(~is_off)
    return (first + int(like[0]), first + int(like[-1]) + 1) if len(like) else (stop, stop)


def _like_halves(seen: Turns, first: int, stop: int, *, near: float) -> slice:
    """Take off both ends of a part the half strokes that are of another motion."""

    def by_direction(values: FloatArray) -> FloatArray:
        """The median of the half strokes of each one's direction."""
        usual = np.empty(len(values))
        for k in (0, 1):
            usual[k::2] = median(values[k::2])
        return usual

    while first < stop:
        halves = np.diff(seen.passages[first : stop + 2])
        tops = seen.at_turns[first + 1 : stop + 2]
        usual = by_direction(halves)
        shorter = float(usual.min())
        is_off = np.abs(halves / usual - 1.0) > max(_PERIOD, near / shorter)
        usual = by_direction(tops)
        swing = max(_AMPLITUDE, 2.0 * near / shorter) * 0.5 * float(np.ptp(usual))
        is_off |= np.abs(tops - usual) > swing
        if is_off[0]:
            first += 1
        elif is_off[-1]:
            stop -= 1
        else:
            break
    return slice(first, stop)
