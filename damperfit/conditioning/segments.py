"""Where a log's motion repeats, and where it moves without repeating: what is to be compared.

How cycles and runs are found stands in `damperfit.conditioning.cycles`.

Where runs hold a third of all cycles or more they are what is compared; else all of the motion is.
Rest never is. The model runs through the whole log, so a run that follows another motion needs no
run-in; only one that stands at the log's own beginning does, for what was before it is not known.
"""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from damperfit.conditioning.cycles import (
    FEWEST,
    MIN_CYCLES,
    TURN,
    Cycles,
    SteadyRun,
    Turns,
    clean_cycles,
    crossings,
    cycles_of,
    ends_in_motion,
    find_cycles,
    run_of,
    runs_of,
    turning_points,
)
from damperfit.conditioning.drive import content_beyond
from damperfit.conditioning.filters import (
    FilteredLog,
    behind_filter,
    fading_samples,
    fitting_corner,
    settling_samples,
)
from damperfit.conditioning.timebase import continue_log
from damperfit.errors import ConditioningError
from damperfit.recording import Finding, Stretch
from damperfit.statistics import median, percentiles

if TYPE_CHECKING:
    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]
    from collections.abc import Sequence

    IntArray = NDArray[np.int64]
    from damperfit.conditioning.options import ConditionOptions
    from damperfit.conditioning.timebase import UniformLog
    from damperfit.recording import Trace

__all__ = ["TRANSIENTS", "ComparedPart", "FoundStretch", "choose_compared", "transients"]


_MOVED = 1.5e-3  # s; a filter of 30 Hz moves a passage so far where the speed doubles
_HYSTERESIS = 0.25  # of the run's amplitude
_SHARE = 1.0 / 3.0  # of all cycles, from which on runs are the test; chance gives far less
_SURELY = 3.0  # cycles: one of run-in, one that is compared, and one for where they are cut
_IN_PLACE = 0.5  # of the amplitude: three quarters are left on the worse side
_NEAR = 0.01  # of a cycle; rigs repeat a period to 0.3 %
_ROUNDING = 0.01  # of a cycle: as many whole ones as were logged, though the length is not exact
_SLOW = 0.02  # of the fastest speed; below is rest
_PAUSE = 0.5  # s; shorter ones are part of a motion
_FEWEST_TURNS = 8  # more than three cycles have
_LONGEST_RUN_IN = 2.0  # s
# Speed beyond half the corner, over all of it: noise behind the filter has 0.95, a random walk
# 0.65, a road up to 15 Hz nothing.
_NOISE = 0.5
_SPLINE_EDGE = 14  # samples; 0.268^14 = 1e-8, how an end condition fades in a cubic spline


class FoundStretch(NamedTuple):
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


class _Motion(NamedTuple):
    """A log behind the filter, its turns and steady runs, and what the filter forgets.

    Where the log is continued, `first` and `stop` are the samples that were logged.
    """

    seen: FilteredLog
    turns: Turns
    runs: Sequence[tuple[int, int]]
    edge: int  # samples after which the filter forgets a break
    first: float | None = None
    stop: float | None = None

    @property
    def interval(self) -> float:
        return self.seen.log.interval

    @property
    def n_cycles(self) -> int:
        return len(self.turns.passages) // 2

    @property
    def repeats(self) -> bool:
        """Whether its runs are the test."""
        passages = sum(stop - first + 2 for first, stop in self.runs)
        return bool(self.runs) and passages >= _SHARE * len(self.turns.passages)

    @property
    def is_one_run(self) -> bool:
        """Whether it is one run without a look at its passages.

        Each stroke of a run whose middle keeps its place passes a quarter of the amplitude on both
        sides of it, so that a run of three cycles beside what is left out has a whole one inside.
        """
        if not self.repeats or len(self.runs) != 1:
            return False
        run = run_of(self.turns, *self.runs[0])
        middles = self.turns.middle[slice(*self.runs[0])]
        keeps_place = float(np.ptp(middles)) <= _IN_PLACE * run.amplitude
        return keeps_place and run.last - run.first >= _SURELY * run.period + 2.0 * self.edge


def _motion(
    seen: FilteredLog,
    options: ConditionOptions,
    *,
    first: float | None = None,
    stop: float | None = None,
) -> _Motion:
    turns = cycles_of(seen.displacement)
    runs = runs_of(turns, options.steadiness, near=_MOVED / seen.log.interval)
    is_long = len(turns.passages) >= FEWEST
    edge = max(fading_samples(seen.model_filter), _SPLINE_EDGE)
    return _Motion(seen, turns, list(runs) if is_long else [], edge, first, stop)


def _steady_runs(motion: _Motion) -> tuple[FoundStretch, ...]:
    """Return the steady runs of a log in order of time; none where hardly anything repeats."""
    found: list[FoundStretch] = []
    for ends in motion.runs if motion.repeats else ():
        run = run_of(motion.turns, *ends)
        stretch = _of_run(run, motion)
        if stretch is not None:
            found.append(_without_overlap(stretch, found, run.period) if found else stretch)
    return tuple(found)


def _without_overlap(one: FoundStretch, found: list[FoundStretch], period: float) -> FoundStretch:
    """Return a stretch that shares no sample with the last one; or that one, which is taken."""
    first, stop = one.stretch.first, found[-1].stretch.stop
    if stop - first > 2.0 * _ROUNDING * period + 1.0:
        # Two runs may both claim the cycle that leads over from one to the other.
        return max(one, found.pop(), key=lambda each: each.stretch.n_samples)
    # The same passage may be a little off in both.
    return one._replace(stretch=replace(one.stretch, first=max(first, stop)))


def _of_run(run: SteadyRun, motion: _Motion) -> FoundStretch | None:
    """Return the stretch of one run; None where no whole cycle is left."""
    displacement, velocity = motion.seen.displacement, motion.seen.velocity
    period, n, moved = run.period, len(displacement), _MOVED / motion.interval
    low = max(0, math.floor(run.first - 0.7 * period))
    high = min(n, math.ceil(run.last + 0.7 * period))
    x, v = displacement[low:high], velocity[low:high] * motion.interval
    rising, falling = (
        _belonging(
            low + crossings(x, v, _HYSTERESIS * run.amplitude, level=run.middle, sign=sign),
            run, displacement, moved=moved,
        )
        for sign in (1.0, -1.0)
    )  # fmt: skip
    marks = np.sort(np.concatenate([rising, falling]))
    if len(marks) < 3:
        return None
    is_first, is_last = marks[0] <= 0.6 * period, n - 1.0 - marks[-1] <= 0.6 * period
    begin = -math.inf if is_first else float(marks[0])
    end = math.inf if is_last else float(marks[-1])
    clear = begin + motion.edge, end - motion.edge
    rising, falling = (_unsmeared(at, period, *clear) for at in (rising, falling))
    starts = _whole(rising, falling, period, _inner(run, motion, begin=begin, end=end))
    if starts is None:
        return None
    stretch = _steady_stretch(starts, velocity, motion.interval, run.amplitude)
    smeared = (
        max(0, math.ceil(clear[0]) - stretch.first) if not is_first else 0,
        max(0, stretch.stop - math.floor(clear[1])) if not is_last else 0,
    )
    stretch = replace(stretch, smeared=smeared)
    clean = np.rint(clean_cycles(stretch)).astype(np.int64)
    fastest = float(np.abs(velocity[clean[0] : clean[-1]]).max())
    return FoundStretch(replace(stretch, peak_speed=fastest), begin, end)


def _inner(run: SteadyRun, motion: _Motion, *, begin: float, end: float) -> tuple[float, float]:
    """Return the samples between which a run may be compared."""
    slack = 0.5 * _ROUNDING * run.period
    low, high = begin - slack, end + slack
    if math.isinf(begin):
        low = run.period + motion.edge if motion.first is None else motion.first - slack
    if math.isinf(end):
        last = len(motion.seen.displacement) - 1.0
        high = last - motion.edge if motion.stop is None else motion.stop + slack
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
        low, high = min([here, *near]), max([here, *near])
        part = x[math.ceil(low) : math.ceil(high)] if len(near) else x[:0]
        # Three cycles of 1.5 Hz are as long as one of 0.5 Hz, but none of its own.
        if not len(part) or np.any((at > low) & (at < high)):
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


def _steady_stretch(
    starts: FloatArray, velocity: FloatArray, interval: float, amplitude: float
) -> Stretch:
    """Return the stretch between the first and the last of these boundaries of cycles."""
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


def _moving_stretch(
    seen: FilteredLog | Trace, first: int, stop: int, interval: float, n_turns: int
) -> Stretch:
    """What lies between two samples, where nothing repeats."""
    part = slice(first, stop)
    return Stretch(
        kind="moving",
        first=first,
        stop=stop,
        cycle_starts=np.empty(0),
        frequency=0.5 * n_turns / ((stop - first) * interval),
        amplitude=0.5 * float(np.ptp(seen.displacement[part])),
        peak_speed=float(np.abs(seen.velocity[part]).max()),
    )


# Motion in which nothing repeats: its parts between rests, each compared as a whole.


def _moving(motion: _Motion) -> tuple[FoundStretch, ...]:
    """Return the parts of a log that move, for one in which nothing repeats."""
    turns, interval = motion.turns.at, motion.interval
    if len(turns) < _FEWEST_TURNS:
        return ()
    speed = np.abs(motion.seen.velocity)
    n, fastest = len(speed), percentiles(speed, 99.0)[0]
    found = []
    for low, high in _parts(speed > _SLOW * fastest, round(_PAUSE / interval)):
        inside = turns[(turns >= low) & (turns < high)]
        if len(inside) < 2:
            continue
        # What went before the log is forgotten after a cycle.
        run_in = min(2.0 * median(np.diff(inside)), _LONGEST_RUN_IN / interval)
        beside = math.ceil(0.25 * motion.edge)
        first = low + (round(run_in) + motion.edge if low == 0 else beside)
        stop = high - (motion.edge if high == n else beside)
        if stop - first > run_in:
            n_turns = max(int(np.count_nonzero((inside >= first) & (inside < stop))), 1)
            stretch = _moving_stretch(motion.seen, first, stop, interval, n_turns)
            begin = -math.inf if low == 0 else float(low)
            found.append(FoundStretch(stretch, begin, math.inf if high == n else float(high)))
    return tuple(found)


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


# The part of a log that nobody fits: run-up, coast-down, changes of speed.
#
# Other speeds and part of a stroke: what a law makes of them it was not bent to. Nearly every log
# has them, so that no further test is needed. Only what moves counts, and no passage from turn to
# turn that has the stroke and the speed of a steady one: more of the same cycles says nothing of
# a law.

TRANSIENTS = "transients"  # their name among what is held out

# s; less tells nothing.
_SHORTEST = 0.25
# Of the highest speed: slower is rest, as the model begins.
_AT_REST = 0.02
_LEAD = 0.05  # s, over which a log's beginning is looked at
# Of the longest stroke: what moves less is rest.
_MOVES = 0.02
# Stroke and speed that differ by less are the steady motion's: rigs repeat both to 1 or 2 %.
_ALIKE = 0.05


def transients(trace: Trace) -> Trace | None:
    """Return a log with what moves beside its stretches as stretches; None where nothing does.

    Parameters
    ----------
    trace : Trace
        A log. What it holds before its first stretch counts only where it begins at rest: else
        the model's state is not yet that of the damper.
    """
    seen = trace if trace.whole is None else trace.whole
    counts = _is_moving(seen)
    if not _begins_at_rest(seen):
        counts[: seen.stretches[0].first] = False
    for one in seen.stretches:
        counts[one.window] = False
    if not _parts_beside_cycles(counts, seen.interval):
        return None
    counts &= ~_is_steady(seen)
    parts = _parts_beside_cycles(counts, seen.interval)
    found = tuple(
        one for one in (_moving_beside_cycles(seen, *part) for part in parts) if one is not None
    )
    if not found:
        return None
    return replace(
        seen,
        name=trace.name,
        setting=trace.setting,
        gas_pressure=trace.gas_pressure,
        temperature=trace.temperature,
        findings=trace.findings,
        stretches=found,
        whole=None,
    )


def _parts_beside_cycles(counts: NDArray[np.bool_], interval: float) -> list[tuple[int, int]]:
    """Return begin and end of what counts, where it lasts."""
    edges = (np.flatnonzero(counts[1:] != counts[:-1]) + 1).tolist()
    edges = [*([0] if counts[0] else []), *edges, *([len(counts)] if counts[-1] else [])]
    parts = zip(edges[::2], edges[1::2], strict=True)
    return [part for part in parts if (part[1] - part[0]) * interval >= _SHORTEST]


def _begins_at_rest(trace: Trace) -> bool:
    lead = max(1, round(_LEAD / trace.interval))
    return float(np.max(np.abs(trace.velocity[:lead]))) < _AT_REST * _fastest(trace)


def _fastest(trace: Trace) -> float:
    return max(one.peak_speed for one in trace.stretches)


def _is_moving(trace: Trace) -> NDArray[np.bool_]:
    """Where it moves, turns and short pauses included."""
    moves = np.abs(trace.velocity) > _AT_REST * _fastest(trace)
    edges = np.flatnonzero(moves[1:] != moves[:-1]).tolist()
    # From the last sample that moves to the next one that does.
    for last, at_rest in pairwise(edges):
        if moves[last] and (at_rest + 1 - last) * trace.interval <= _PAUSE:
            moves[last + 1 : at_rest + 1] = True
    return np.asarray(moves)


def _is_steady(trace: Trace) -> NDArray[np.bool_]:
    """Where a passage from turn to turn is one of the steady motion's.

    The first and the last, from rest or to it, may be a part of one.
    """
    last = len(trace.force) - 1
    found = np.zeros(last + 1, dtype=bool)
    turns = turning_points(trace.displacement, TURN * float(np.ptp(trace.displacement)))
    ends = np.concatenate([[0], turns, [last]])
    ends = ends[np.concatenate([[True], np.diff(ends) > 0])]
    strokes = np.abs(np.diff(trace.displacement[ends]))
    speed = np.abs(trace.velocity)
    fastest = np.maximum(np.maximum.reduceat(speed[:last], ends[:-1]), speed[ends[1:]])
    is_part = np.zeros(len(strokes), dtype=bool)
    is_part[[0, -1]] = True
    is_like = np.zeros(len(strokes), dtype=bool)
    for one in trace.stretches:
        if one.n_cycles:
            has_its_stroke = is_part | (np.abs(0.5 * strokes / one.amplitude - 1.0) < _ALIKE)
            is_like |= has_its_stroke & (np.abs(fastest / one.peak_speed - 1.0) < _ALIKE)
    found[:last] = np.repeat(is_like, np.diff(ends))
    return found


def _moving_beside_cycles(trace: Trace, first: int, stop: int) -> Stretch | None:
    """What lies between two samples, where it moves."""
    n_turns = int(np.count_nonzero(np.diff(np.signbit(trace.velocity[first:stop]))))
    stretch = _moving_stretch(trace, first, stop, trace.interval, n_turns)
    longest = max(one.amplitude for one in trace.stretches)
    return None if stretch.amplitude < _MOVES * longest else stretch


# Which part of a log is compared: one steady run, several, or motion that does not repeat.
#
# One steady run goes cycle by cycle: a cycle of run-in and the filter's edges are left out. Where
# that leaves fewer than three cycles, and where a short run stands at an end of the log, the log
# is continued by its own cycles (`damperfit.conditioning.timebase`); one between two rests is
# compared from break to break, where that is more.


class ComparedPart(NamedTuple):
    """What is compared of a log.

    `seen` may be longer than what was logged. `keep` are the samples of it that the model runs
    through; `cycles` is None where the log is no single steady run.
    """

    seen: FilteredLog
    found: tuple[FoundStretch, ...]
    n_found: int
    cycles: Cycles | None
    keep: slice
    findings: tuple[Finding, ...] = ()


def choose_compared(name: str, log: UniformLog, options: ConditionOptions) -> ComparedPart:
    """Return what of a log is compared with the model.

    Raises
    ------
    ConditioningError
        Too few steady cycles, a motion that the filter takes away, a corner beyond half the rate.
    """
    try:
        seen = behind_filter(log, options)
    except ConditioningError as error:
        raise ConditioningError(f"{error}", subject=name, code="no-cycles") from None
    cycles, motion = _cycles(seen, options), _motion(seen, options)
    one = _one_run(name, seen, cycles, options) if motion.is_one_run else None
    if one and _n_cycles(one.found) >= MIN_CYCLES:
        return one
    found, n_found = _several(motion, options), motion.n_cycles
    if one is None:
        if found and found[0].stretch.kind == "moving":
            return _kept(seen, found, n_found, None)
        if len(found) > 1:
            return _continued(name, seen, found, n_found, None, options) or _kept(
                seen, found, n_found, None
            )
        one = _one_run(name, seen, cycles, options)
    if one and not _is_longer_run(found, n_found, one):
        return one
    # A short run in the middle of a log needs no run-in and no edges of the filter.
    of_run = None if n_found < MIN_CYCLES else found
    n_cycles = cycles.n_found if cycles else 0
    longer = n_cycles >= MIN_CYCLES and _continued(name, seen, (), n_cycles, cycles, options)
    if longer:
        return longer
    if not of_run:
        _window(name, log, cycles, _edge(seen))  # says why there is none
    return _kept(seen, found, n_found, None)


def _n_cycles(found: tuple[FoundStretch, ...]) -> int:
    return sum(one.stretch.n_cycles for one in found)


def _is_longer_run(found: tuple[FoundStretch, ...], n_found: int, one: ComparedPart) -> bool:
    """Whether the run between its breaks has more cycles than behind a run-in and edges."""
    if len(found) != 1 or found[0].stretch.kind == "moving" or n_found < MIN_CYCLES:
        return False
    return _n_cycles(found) > _n_cycles(one.found)


def _one_run(
    name: str, seen: FilteredLog, cycles: Cycles | None, options: ConditionOptions
) -> ComparedPart | None:
    """Return what is compared of one steady run; None where it leaves no window."""
    log = seen.log
    try:
        starts = _window(name, log, cycles, _edge(seen))
    except ConditioningError:
        return None
    assert cycles is not None
    _refuse_fast(name, log, cycles, options)
    stretch = _steady_stretch(starts, seen.velocity, log.interval, cycles.amplitude)
    found = (FoundStretch(stretch, -math.inf, math.inf),)
    if stretch.n_cycles < MIN_CYCLES:
        longer = _continued(name, seen, found, cycles.n_found, cycles, options)
        if longer:
            return longer
    return _kept(seen, found, cycles.n_found, cycles)


def _edge(seen: FilteredLog) -> int:
    return max(settling_samples(seen.model_filter), _SPLINE_EDGE)


def _cycles(seen: FilteredLog, options: ConditionOptions) -> Cycles | None:
    speed = seen.velocity * seen.log.interval
    return find_cycles(seen.displacement, speed, steadiness=options.steadiness)


def _kept(
    seen: FilteredLog, found: tuple[FoundStretch, ...], n_found: int, cycles: Cycles | None
) -> ComparedPart:
    """Add what the model runs through: from where the motion begins, or a cycle before."""
    first, last = found[0].stretch, found[-1].stretch
    edge = _edge(seen)
    ahead = edge + first.first - math.floor(max(found[0].begin, 0.0))
    if cycles is not None:
        ahead = edge + math.ceil(cycles.period) + 1
    keep = slice(max(0, first.first - ahead), last.stop + edge + 2)
    return ComparedPart(seen, found, n_found, cycles, keep)


def _continued(
    name: str,
    seen: FilteredLog,
    found: tuple[FoundStretch, ...],
    n_found: int,
    cycles: Cycles | None,
    options: ConditionOptions,
) -> ComparedPart | None:
    """Return what is compared when the log is continued by its cycles; None where no more is."""
    log = seen.log
    begin, end = ends_in_motion(log.displacement, options.steadiness)
    at_begin = found[0].stretch.n_cycles if found and math.isinf(found[0].begin) else 0
    at_end = found[-1].stretch.n_cycles if found and math.isinf(found[-1].end) else 0
    begin = begin if at_begin < MIN_CYCLES else None
    end = end if at_end < MIN_CYCLES else None
    if begin is None and end is None:
        return None
    longer = continue_log(log, begin, end, reach=_edge(seen))
    seen = behind_filter(longer.log, options)
    more = _steady_runs(
        _motion(
            seen,
            options,
            first=None if begin is None else float(longer.first),
            stop=None if end is None else float(longer.stop),
        )
    )
    if _n_cycles(more) <= _n_cycles(found):
        return None
    single = None
    if cycles is not None and len(more) == 1:
        _refuse_fast(name, log, cycles, options)
        steady = _cycles(seen, options)
        single = None if steady is None else steady._replace(n_found=n_found)
    where = " and ".join(
        word for word, at in (("beginning", begin), ("end", end)) if at is not None
    )
    text = (
        f"there are few cycles at the {where} of the log: it is continued there by its own cycles "
        "for run-in and filter; only what was logged is compared"
    )
    finding = Finding("continued", "note", text)
    return _kept(seen, more, n_found, single)._replace(findings=(finding,))


def _several(motion: _Motion, options: ConditionOptions) -> tuple[FoundStretch, ...]:
    """Return the stretches of a log that is not one steady run; none where it is.

    Noise of a sensor at rest is no motion: nearly all of its speed is far up.
    """
    if found := _steady_runs(motion):
        return found
    half = 0.5 * (
        options.filter_corner if options.rig_filter == "none" else options.rig_filter_corner
    )
    corner = min(half, 0.1 / motion.interval)
    if content_beyond(motion.seen.displacement, motion.interval, corner) > _NOISE:
        return ()
    return _moving(motion)


def _window(name: str, log: UniformLog, cycles: Cycles | None, edge: int) -> FloatArray:
    """Return boundaries of the steady cycles that neither run-in nor filter edges touch."""
    n, h = len(log.force), log.interval
    length = f"the log is {n * h:.3g} s long"
    if cycles is None or cycles.n_found < MIN_CYCLES:
        found = 0 if cycles is None else cycles.n_found
        stroke = 1e3 * float(np.ptp(log.displacement))
        period = "" if cycles is None else f" ({MIN_CYCLES * cycles.period * h:.3g} s)"
        raise ConditioningError(
            f"found {found} whole steady cycle{'s' * (found != 1)} in the displacement "
            f"(it spans {stroke:.3g} mm; {length}); expected at least {MIN_CYCLES}{period}; "
            "record a longer log",
            subject=name,
            code="no-cycles",
        )
    low, high = _untouched(cycles, n, edge)
    rising, falling = (
        crossings[(crossings >= low) & (crossings <= high)]
        for crossings in (cycles.rising, cycles.falling)
    )
    # Short logs: half a cycle more may fit when cycles are cut at the other crossing.
    starts = falling if len(rising) <= MIN_CYCLES and len(falling) > len(rising) else rising
    if len(starts) >= 2:
        return starts
    if high - low >= cycles.period:  # a whole cycle that starts in mid-cycle
        n_cycles = math.floor((high - low) / cycles.period)
        return low + cycles.period * np.arange(n_cycles + 1, dtype=np.float64)
    needed = (2.0 * cycles.period + 2.0 * edge) * h
    raise ConditioningError(
        f"no whole steady cycle is left after the run-in of one cycle "
        f"({cycles.period * h:.3g} s) and the filter's edges ({edge * h:.3g} s at each end); "
        f"{length} with {cycles.n_found} cycles, expected at least {needed:.3g} s of steady "
        "motion; record a longer log",
        subject=name,
        code="no-cycles",
    )


def _untouched(cycles: Cycles, n: int, edge: int) -> tuple[float, float]:
    """Return first and last sample that run-in and filter edges leave alone.

    Where the steady cycles do not reach the log's own ends, their first and last crossing count
    as ends: an abrupt start or stop beside them is smeared by the filter like an end of the log.
    """
    reach = 1.1 * cycles.period
    begin, end = float(cycles.rising[0]), float(cycles.rising[-1])
    begin = 0.0 if begin <= reach else begin
    end = n - 1.0 if n - 1.0 - end <= reach else end
    return max(begin + cycles.period + edge, cycles.begin), min(end - edge, cycles.end)


def _refuse_fast(name: str, log: UniformLog, cycles: Cycles, options: ConditionOptions) -> None:
    """Refuse a motion that the filter takes away."""
    is_rig = options.rig_filter != "none"
    corner = options.rig_filter_corner if is_rig else options.filter_corner
    frequency = 1.0 / (cycles.period * log.interval)
    if (is_rig or options.filter != "none") and frequency >= corner:
        raise ConditioningError(
            f"the motion found has {frequency:.3g} Hz, not below the filter "
            f"corner of {corner:g} Hz; {_raised(is_rig, frequency, log)}",
            subject=name,
            code="corner-too-low",
        )


def _raised(is_rig: bool, frequency: float, log: UniformLog) -> str:  # noqa: FBT001
    if is_rig:
        return "the displacement is noise, or rig.filter_corner is another one"
    corner = fitting_corner(frequency, 1.0 / log.interval)
    fits = f"set conditioning.filter_corner = '{corner:g}Hz' or 'auto'"
    return f"the displacement is noise, or the corner must be raised: {fits}"
