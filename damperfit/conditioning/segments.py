"""Where a log's motion repeats, and where it moves without repeating: what is to be compared.

How cycles and runs are found stands in `damperfit.conditioning.cycles`.

Where runs hold a third of all cycles or more they are what is compared; else all of the motion is.
Rest never is. The model runs through the whole log, so a run that follows another motion needs no
run-in; only one that stands at the log's own beginning does, for what was before it is not known.

One steady run goes cycle by cycle: a cycle of run-in and the filter's edges are left out. Where
that leaves fewer than three cycles, and where a short run stands at an end of the log, the log
is continued by its own cycles (`damperfit.conditioning.timebase`); one between two rests is
compared from break to break, where that is more.
"""

import math
from dataclasses import replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from damperfit.conditioning.cycles import (
    HYSTERESIS,
    MIN_CYCLES,
    TURN,
    Cycles,
    FoundSegment,
    SteadyRun,
    clean_cycles,
    crossings,
    cycles_in,
    cycles_of,
    ends_in_motion,
    passages_of,
    runs_of,
    turning_points,
)
from damperfit.conditioning.drive import content_beyond
from damperfit.conditioning.filters import FilteredLog, behind_filter, fitting_corner
from damperfit.conditioning.options import ConditionOptions
from damperfit.conditioning.signals import BoolArray, FloatArray, IntArray, parts_where
from damperfit.conditioning.timebase import UniformLog, continue_log
from damperfit.errors import ConditioningError
from damperfit.problem import Problem, note
from damperfit.recording import Segment, Trace
from damperfit.statistics import median, percentiles

_MOVED = 1.5e-3  # s; a filter of 30 Hz moves a passage so far where the speed doubles
_SHARE = 1.0 / 3.0  # of all cycles, from which on runs are the test; chance gives far less
_SURELY = 3.0  # cycles: one of run-in, one that is compared, and one for where they are cut
_IN_PLACE = 0.5  # of the amplitude: three quarters are left on the worse side
_ROUNDING = 0.01  # of a cycle: as many whole ones as were logged, though the length is not exact
_SLOW = 0.02  # of the fastest speed; below is rest
_PAUSE = 0.5  # s; shorter ones are part of a motion
_FEWEST_TURNS = 8  # more than three cycles have
_LONGEST_RUN_IN = 2.0  # s
# Speed beyond half the corner, over all of it: noise behind the filter has 0.95, a random walk
# 0.65, a road up to 15 Hz nothing.
_NOISE = 0.5


class ComparedPart(NamedTuple):
    """What is compared of a log."""

    seen: FilteredLog  # may be longer than what was logged
    parts: tuple[FoundSegment, ...]
    n_found: int  # whole cycles
    cycles: Cycles | None  # None where the log is no single steady run
    keep: slice  # samples that the model runs through
    findings: tuple[Problem, ...] = ()


class _Motion:
    """A log behind the filter, its turns and steady runs."""

    def __init__(
        self,
        name: str,
        log: UniformLog,
        options: ConditionOptions,
        logged: tuple[int | None, int | None] = (None, None),
    ) -> None:
        self.name, self.log, self.options = name, log, options
        self.first, self.stop = logged  # where the log is continued
        self.seen = behind_filter(log, options)
        self.turns = cycles_of(self.seen.displacement)
        self.runs = list(runs_of(self.turns, options.steadiness, near=_MOVED / log.interval))
        passages = sum(run.cycles.stop - run.cycles.start + 2 for run in self.runs)
        n_passages = len(self.turns.passages)
        self.n_cycles = n_passages // 2
        self.repeats = bool(self.runs) and passages >= _SHARE * n_passages

    @cached_property
    def cycles(self) -> Cycles | None:
        """Those about the middle of its longest run."""
        longest = max(self.runs, key=lambda run: run.cycles.stop - run.cycles.start, default=None)
        x, interval, steadiness = self.seen.displacement, self.log.interval, self.options.steadiness
        speed = self.seen.velocity * interval
        return cycles_in(x, speed, longest, steadiness)

    @property
    def is_one_run(self) -> bool:
        """Whether it is one run without a look at its passages."""
        if not self.repeats or len(self.runs) != 1:
            return False
        # Each stroke of a run whose middle keeps its place passes a quarter of the amplitude on
        # both sides of it: three cycles beside what is left out have a whole one inside.
        (run,) = self.runs
        keeps_place = float(np.ptp(self.turns.middle[run.cycles])) <= _IN_PLACE * run.amplitude
        return keeps_place and run.last - run.first >= _SURELY * run.period + 2.0 * self.seen.fading


def choose_compared(name: str, log: UniformLog, options: ConditionOptions) -> ComparedPart:
    """Return what of a log is compared with the model."""
    try:
        motion = _Motion(name, log, options)
    except ConditioningError as error:
        raise ConditioningError(f"{error}", subject=name, code="no-cycles") from None
    single = _one_run(motion) if motion.is_one_run else None
    if single and _n_cycles(single.parts) >= MIN_CYCLES:
        return single
    parts, n_found, cycles = _steady_runs(motion), motion.n_cycles, motion.cycles
    if not parts:
        # Noise of a sensor at rest is no motion: nearly all of its speed is far up.
        corner = min(0.5 * options.declared_corner, 0.1 / log.interval)
        if content_beyond(motion.seen.displacement, log.interval, corner) <= _NOISE:
            parts = _moving(motion)
    several = _kept(motion.seen, parts, n_found, None) if parts else None
    is_moving = bool(parts) and parts[0].segment.kind == "moving"
    if single is None:
        if several and is_moving:
            return several
        if several and len(parts) > 1:
            return _continued(motion, parts, n_found, None) or several
        single = _one_run(motion)
    # A run between its breaks may have more cycles than behind a run-in and edges.
    is_longer = len(parts) == 1 and not is_moving and n_found >= MIN_CYCLES
    if single and not (is_longer and _n_cycles(parts) > _n_cycles(single.parts)):
        return single
    if cycles and cycles.n_found >= MIN_CYCLES:
        longer = _continued(motion, (), cycles.n_found, cycles)
        if longer:
            return longer
    # A short run in the middle of a log needs no run-in and no edges of the filter.
    if several is None or n_found < MIN_CYCLES:
        _window(motion)  # says why there is none
    assert several is not None
    return several


def _n_cycles(parts: tuple[FoundSegment, ...]) -> int:
    return sum(part.segment.n_cycles for part in parts)


def _kept(
    seen: FilteredLog, parts: tuple[FoundSegment, ...], n_found: int, cycles: Cycles | None
) -> ComparedPart:
    """Add what the model runs through: from where the motion begins, or a cycle before."""
    first, last = parts[0].segment, parts[-1].segment
    ahead = first.first - math.floor(max(parts[0].begin, 0.0))
    if cycles is not None:
        ahead = math.ceil(cycles.period) + 1
    keep = slice(max(0, first.first - seen.edge - ahead), last.stop + seen.edge + 2)
    return ComparedPart(seen, parts, n_found, cycles, keep)


def _one_run(motion: _Motion) -> ComparedPart | None:
    """Return what is compared of one steady run; None where it leaves no window."""
    cycles = motion.cycles
    try:
        starts = _window(motion)
    except ConditioningError:
        return None
    assert cycles is not None
    _refuse_fast(motion, cycles)
    parts = (FoundSegment(_steady_segment(starts, motion.seen, cycles.amplitude)),)
    longer = None
    if _n_cycles(parts) < MIN_CYCLES:
        longer = _continued(motion, parts, cycles.n_found, cycles)
    return longer or _kept(motion.seen, parts, cycles.n_found, cycles)


def _continued(
    motion: _Motion, parts: tuple[FoundSegment, ...], n_found: int, cycles: Cycles | None
) -> ComparedPart | None:
    """Return what is compared when the log is continued by its cycles; None where no more is."""
    log, options = motion.log, motion.options
    begin, end = ends_in_motion(log.displacement, options.steadiness)
    enough = [part for part in parts if part.segment.n_cycles >= MIN_CYCLES]
    begin = None if any(math.isinf(part.begin) for part in enough) else begin
    end = None if any(math.isinf(part.end) for part in enough) else end
    if begin is None and end is None:
        return None
    longer, first, stop = continue_log(log, begin, end, reach=motion.seen.edge)
    logged = None if begin is None else first, None if end is None else stop
    continued = _Motion(motion.name, longer, options, logged)
    more = _steady_runs(continued)
    if _n_cycles(more) <= _n_cycles(parts):
        return None
    single = None
    if cycles is not None and len(more) == 1:
        _refuse_fast(motion, cycles)
        single = continued.cycles and continued.cycles._replace(n_found=n_found)
    ends = (("beginning", begin), ("end", end))
    where = " and ".join(word for word, at in ends if at is not None)
    text = (
        f"there are few cycles at the {where} of the log: it is continued there by its own cycles "
        "for run-in and filter; only what was logged is compared"
    )
    finding = note("continued", text)
    return _kept(continued.seen, more, n_found, single)._replace(findings=(finding,))


_BRIEF = 0.1  # s; of a shorter log the unit of time is in doubt
_OF_TIME = "if the time is in another unit, declare rig.units.time; else "


def _window(motion: _Motion) -> FloatArray:
    """Return boundaries of the steady cycles that neither run-in nor filter edges touch."""
    cycles, edge = motion.cycles, motion.seen.edge
    n, h = len(motion.log.force), motion.log.interval
    length = f"the log is {n * h:.3g} s long"
    if cycles is None or cycles.n_found < MIN_CYCLES:
        n_cycles, longest = motion.n_cycles * (motion.n_cycles < MIN_CYCLES), 0.0
        if cycles is not None:
            n_cycles, longest = cycles.n_found, cycles.period
        elif n_cycles > 1:
            longest = float(motion.turns.period.max())
        needed = f" ({MIN_CYCLES * longest * h:.3g} s)" if longest else ""
        stroke = 1e3 * float(np.ptp(motion.log.displacement))
        raise ConditioningError(
            f"found {n_cycles} whole steady cycle{'s' * (n_cycles != 1)} in the displacement "
            f"(it spans {stroke:.3g} mm; {length}); expected at least {MIN_CYCLES}{needed}; "
            f"{_OF_TIME * (n * h < _BRIEF)}record a longer log",
            subject=motion.name,
            code="no-cycles",
        )
    period = cycles.period
    # Where the steady cycles do not reach the log's own ends, their first and last crossing count
    # as ends: an abrupt start or stop beside them is smeared by the filter like an end of the log.
    begin, end = float(cycles.rising[0]), float(cycles.rising[-1])
    begin = 0.0 if begin <= 1.1 * period else begin
    end = n - 1.0 if n - 1.0 - end <= 1.1 * period else end
    low, high = max(begin + period + edge, cycles.begin), min(end - edge, cycles.end)
    rising, falling = (
        marks[(marks >= low) & (marks <= high)] for marks in (cycles.rising, cycles.falling)
    )
    # Short logs: half a cycle more may fit when cycles are cut at the other crossing.
    starts = falling if len(rising) <= MIN_CYCLES and len(falling) > len(rising) else rising
    if len(starts) >= 2:
        return starts
    if high - low >= period:  # a whole cycle that starts in mid-cycle
        return low + period * np.arange(math.floor((high - low) / period) + 1, dtype=np.float64)
    raise ConditioningError(
        f"no whole steady cycle is left after the run-in of one cycle ({period * h:.3g} s) and the "
        f"filter's edges ({edge * h:.3g} s at each end); {length} with {cycles.n_found} cycles, "
        f"expected at least {(2.0 * period + 2.0 * edge) * h:.3g} s of steady motion; record a "
        "longer log",
        subject=motion.name,
        code="no-cycles",
    )


def _refuse_fast(motion: _Motion, cycles: Cycles) -> None:
    """Refuse a motion that the filter takes away."""
    options, interval = motion.options, motion.log.interval
    frequency = 1.0 / (cycles.period * interval)
    if frequency < options.passed_corner:
        return
    advice = "the displacement is noise, or rig.filter_corner is another one"
    if options.is_ours:
        fits = f"'{fitting_corner(frequency, 1.0 / interval):g}Hz' or 'auto'"
        advice = "the displacement is noise, or the corner must be raised: "
        advice += f"set conditioning.filter_corner = {fits}"
    raise ConditioningError(
        f"the motion found has {frequency:.3g} Hz, not below the filter corner of "
        f"{options.passed_corner:g} Hz; {advice}",
        subject=motion.name,
        code="corner-too-low",
    )


# Steady runs, from break to break.


def _steady_runs(motion: _Motion) -> tuple[FoundSegment, ...]:
    """Return the steady runs of a log in order of time; none where hardly anything repeats."""
    parts: list[FoundSegment] = []
    for run in motion.runs if motion.repeats else ():
        part = _of_run(run, motion)
        if part is None:
            continue
        if parts:
            first, stop = part.segment.first, parts[-1].segment.stop
            if stop - first > 2.0 * _ROUNDING * run.period + 1.0:
                # Two runs may both claim the cycle that leads over from one to the other.
                part = max(part, parts.pop(), key=lambda each: each.segment.n_samples)
            else:  # the same passage may be a little off in both
                part = part._replace(segment=replace(part.segment, first=max(first, stop)))
        parts.append(part)
    return tuple(parts)


def _of_run(run: SteadyRun, motion: _Motion) -> FoundSegment | None:
    """Return the segment of one run; None where no whole cycle is left."""
    seen, edge = motion.seen, motion.seen.fading
    displacement, velocity = seen.displacement, seen.velocity
    period, n, moved = run.period, len(displacement), _MOVED / motion.log.interval
    low = max(0, math.floor(run.first - 0.7 * period))
    high = min(n, math.ceil(run.last + 0.7 * period))
    x, v = displacement[low:high], velocity[low:high] * motion.log.interval
    directions = [
        passages_of(
            low + crossings(x, v, HYSTERESIS * run.amplitude, level=run.middle, sign=sign),
            run, displacement, moved=moved,
        )
        for sign in (1.0, -1.0)
    ]  # fmt: skip
    marks = np.sort(np.concatenate(directions))
    if len(marks) < 3:
        return None
    is_first, is_last = marks[0] <= 0.6 * period, n - 1.0 - marks[-1] <= 0.6 * period
    begin = -math.inf if is_first else float(marks[0])
    end = math.inf if is_last else float(marks[-1])
    # Between which samples it may be compared.
    slack = 0.5 * _ROUNDING * period
    inner_low, inner_high = begin - slack, end + slack
    if is_first:
        inner_low = period + edge if motion.first is None else motion.first - slack
    if is_last:
        inner_high = n - 1.0 - edge if motion.stop is None else motion.stop + slack
    n_cycles = math.floor((inner_high - inner_low) / period + 1e-9)
    for at in directions:
        # Passages that the filter has moved are put where the nearest of the others says.
        clear = at[(at >= begin + edge) & (at <= end - edge)]
        if len(clear):
            nearest = clear[np.argmin(np.abs(at[:, None] - clear), axis=1)]
            at = nearest + period * np.rint((at - nearest) / period)  # noqa: PLW2901
        starts = at[(at >= inner_low) & (at <= inner_high)]
        if len(starts) > max(n_cycles, 1):
            break
    else:
        if n_cycles < 1:
            return None
        # They fit when they are cut elsewhere: at the same phase of each.
        slack = 0.5 * (inner_high - inner_low - n_cycles * period)
        starts = inner_low + slack + period * np.arange(n_cycles + 1, dtype=np.float64)
    segment = _steady_segment(starts, seen, run.amplitude)
    smeared = (
        0 if is_first else max(0, math.ceil(begin + edge) - segment.first),
        0 if is_last else max(0, segment.stop - math.floor(end - edge)),
    )
    segment = replace(segment, smeared=smeared)
    clean = np.rint(clean_cycles(segment)).astype(np.int64)
    fastest = float(np.abs(velocity[clean[0] : clean[-1]]).max())
    return FoundSegment(replace(segment, peak_speed=fastest), begin, end)


def _steady_segment(starts: FloatArray, seen: FilteredLog, amplitude: float) -> Segment:
    """Return the segment between the first and the last of these boundaries of cycles."""
    first, stop = round(float(starts[0])), round(float(starts[-1]))
    return Segment(
        kind="steady",
        first=first,
        stop=stop,
        cycle_starts=starts,
        frequency=(len(starts) - 1) / float(starts[-1] - starts[0]) / seen.log.interval,
        amplitude=amplitude,
        peak_speed=float(np.abs(seen.velocity[first:stop]).max()),
    )


# Motion in which nothing repeats: its parts between rests, each compared as a whole.


def _moving_segment(
    seen: FilteredLog | Trace, first: int, stop: int, interval: float, n_turns: int
) -> Segment:
    """Return what lies between two samples, where nothing repeats."""
    part = slice(first, stop)
    return Segment(
        kind="moving",
        first=first,
        stop=stop,
        cycle_starts=np.empty(0),
        frequency=0.5 * n_turns / ((stop - first) * interval),
        amplitude=0.5 * float(np.ptp(seen.displacement[part])),
        peak_speed=float(np.abs(seen.velocity[part]).max()),
    )


def _moving_parts(velocity: FloatArray, slow: float, interval: float) -> tuple[IntArray, IntArray]:
    """Return first and stop of the parts that move, turns and short pauses counted in."""
    starts, stops = parts_where(np.abs(velocity) > slow)
    if not len(starts):
        return starts, stops
    is_rest = starts[1:] - stops[:-1] >= round(_PAUSE / interval)
    return starts[np.append(True, is_rest)], stops[np.append(is_rest, True)]


def _moving(motion: _Motion) -> tuple[FoundSegment, ...]:
    """Return the parts of a log that move, for one in which nothing repeats."""
    seen, turns, interval = motion.seen, motion.turns.at, motion.log.interval
    if len(turns) < _FEWEST_TURNS:
        return ()
    n, edge = len(seen.velocity), seen.fading
    fastest = percentiles(np.abs(seen.velocity), 99.0)[0]
    starts, stops = _moving_parts(seen.velocity, _SLOW * fastest, interval)
    pause = round(_PAUSE / interval)
    parts = []
    for start, end in zip(starts.tolist(), stops.tolist(), strict=True):
        # The log's own ends: a turn there is no rest.
        low, high = 0 if start <= pause else start, n if n - end <= pause else end
        inside = turns[(turns >= low) & (turns < high)]
        if len(inside) < 2:
            continue
        # What went before the log is forgotten after a cycle.
        run_in = min(2.0 * median(np.diff(inside)), _LONGEST_RUN_IN / interval)
        beside = math.ceil(0.25 * edge)
        first = low + (round(run_in) + edge if low == 0 else beside)
        stop = high - (edge if high == n else beside)
        if stop - first > run_in:
            n_turns = max(int(np.count_nonzero((inside >= first) & (inside < stop))), 1)
            segment = _moving_segment(seen, first, stop, interval, n_turns)
            begin = -math.inf if low == 0 else float(low)
            parts.append(FoundSegment(segment, begin, math.inf if high == n else float(high)))
    return tuple(parts)


# The part of a log that is not fitted: run-up, coast-down, changes of speed.
#
# Other speeds and part of a stroke: what a law makes of them it was not bent to. Nearly every log
# has them, so that no further test is needed. Only what moves counts, and no passage from turn to
# turn that has the stroke and the speed of a steady one: more of the same cycles says nothing of
# a law.

TRANSIENTS = "transients"  # their name among what is held out

_SHORTEST = 0.25  # s; less shows nothing
_AT_REST = 0.02  # of the highest speed: slower is rest, as the model begins
_LEAD = 0.05  # s, over which a log's beginning is looked at
_MOVES = 0.02  # of the longest stroke: what moves less is rest
# Stroke and speed that differ by less are the steady motion's: rigs repeat both to 1 or 2 %.
_ALIKE = 0.05


def transients(trace: Trace) -> Trace | None:
    """Return a log with what moves beside its segments as segments; None where nothing does."""
    seen = trace if trace.whole is None else trace.whole
    slow = _AT_REST * max(segment.peak_speed for segment in seen.segments)
    longest = max(segment.amplitude for segment in seen.segments)
    counts = np.zeros(len(seen.force), dtype=bool)
    for first, stop in zip(*_moving_parts(seen.velocity, slow, seen.interval), strict=True):
        counts[first:stop] = True
    # What is before the first counts only where the log begins at rest: else the model's state is
    # not yet that of the damper.
    lead = max(1, round(_LEAD / seen.interval))
    if not float(np.max(np.abs(seen.velocity[:lead]))) < slow:
        counts[: seen.segments[0].first] = False
    for segment in seen.segments:
        counts[segment.window] = False
    if not _lasting(counts, seen.interval):  # most logs: no look at each passage
        return None
    parts = []
    for first, stop in _lasting(counts & ~_is_steady(seen), seen.interval):
        n_turns = int(np.count_nonzero(np.diff(np.signbit(seen.velocity[first:stop]))))
        segment = _moving_segment(seen, first, stop, seen.interval, n_turns)
        if segment.amplitude >= _MOVES * longest:
            parts.append(segment)
    if not parts:
        return None
    names = ("name", "setting", "gas_pressure", "temperature", "findings")
    of_trace = {name: getattr(trace, name) for name in names}
    return replace(seen, **of_trace, segments=tuple(parts), whole=None)


def _lasting(counts: BoolArray, interval: float) -> list[tuple[int, int]]:
    """Return first and stop of what counts, where it lasts."""
    parts = zip(*(edges.tolist() for edges in parts_where(counts)), strict=True)
    return [(first, stop) for first, stop in parts if (stop - first) * interval >= _SHORTEST]


def _is_steady(trace: Trace) -> BoolArray:
    """Places where a passage from turn to turn is one of the steady motion's."""
    last = len(trace.force) - 1
    turns = turning_points(trace.displacement, TURN * float(np.ptp(trace.displacement)))
    ends = np.concatenate([[0], turns, [last]])
    ends = ends[np.concatenate([[True], np.diff(ends) > 0])]
    strokes = np.abs(np.diff(trace.displacement[ends]))
    speed = np.abs(trace.velocity)
    fastest = np.maximum(np.maximum.reduceat(speed[:last], ends[:-1]), speed[ends[1:]])
    is_part, is_like = np.zeros((2, len(strokes)), dtype=bool)
    is_part[[0, -1]] = True  # from rest or to it
    for segment in trace.segments:
        if segment.n_cycles:
            has_its_stroke = is_part | (np.abs(0.5 * strokes / segment.amplitude - 1.0) < _ALIKE)
            is_like |= has_its_stroke & (np.abs(fastest / segment.peak_speed - 1.0) < _ALIKE)
    return np.append(np.repeat(is_like, np.diff(ends)), False)
