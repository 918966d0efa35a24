"""What the data of a log show of its quality: findings with a severity, never a change of the data.

`examine` looks at a log whose cycles are known, `examine_raw` at one that was refused. Findings of
the stamps are made in `damperfit.conditioning.timebase`, of one channel in `channels`, of signs,
tare and skew in `polarity` and `delay`.

Limits, and what the faults cost near them (the largest error at settings 1, 10 and 20 of the
reference set, 500 Hz, no noise; where each finding begins, `tests/test_numbers.py` holds):

- Noise of the displacement acts through the velocity and bends K_e: 20 um cost 0.7 %, 37 um 2.4 %,
  67 um 7 %. The bar is the noise of the velocity behind the filter over its peak; 20 um are below
  it.
- Rates down to 66 Hz (44 samples a cycle, half the rate just above the filter's corner) cost
  nothing; what a low rate does cost is the spline's velocity, w^4/180 with w = 2 pi / samples in a
  cycle.
- A force offset that drifts by 1 % of the peak force costs 1.6 % of K_e, by 3 % 5 %; a mid-stroke
  that drifts by 5 % of the amplitude 0.7 %.

Peaks that fall from the first cycle to the last are no scatter: oil that warms up does that. A
curve of second degree through them is taken off before they are said to scatter.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from functools import lru_cache
from itertools import combinations, pairwise
from typing import NamedTuple

import numpy as np

from damperfit.conditioning.channels import examine_channels
from damperfit.conditioning.cycles import Cycles, clean_cycles, harmonic_powers
from damperfit.conditioning.drive import content_beyond, dwell_lengths
from damperfit.conditioning.filters import fitting_corner, gain_at
from damperfit.conditioning.noise import (
    falls_off,
    noise_floor,
    noise_ratio,
    tone,
)
from damperfit.conditioning.options import ConditionOptions
from damperfit.conditioning.signals import FloatArray, noise_of, parts_where
from damperfit.conditioning.timebase import UniformLog
from damperfit.passed_speeds import cycle_energies
from damperfit.problem import Option, Problem, counted, note, warning
from damperfit.recording import Recording, Segment, Trace
from damperfit.statistics import mean_of, median, percentiles
from damperfit.units.quantities import parse_quantity


class Seen(NamedTuple):
    """A log, and what has become of it."""

    recording: Recording
    log: UniformLog
    trace: Trace
    cycles: Cycles | None  # None: no single steady run
    options: ConditionOptions

    def rows(self, *segments: Segment) -> slice:
        """Return the rows from the beginning of the first segment to the end of the last."""
        return rows_of(self.recording, self.trace.start_time, self.trace.interval, *segments)

    def runs(self, *, fewest: int) -> list[FloatArray]:
        """Return where the cycles of each segment of so many begin, samples of the log."""
        ahead = round((self.trace.start_time - self.log.start_time) / self.log.interval)
        longest_first = sorted(self.trace.segments, key=lambda segment: -segment.n_samples)
        runs = (segment.cycle_starts + ahead for segment in longest_first)
        inside = (starts[starts >= 0.0] for starts in runs)  # a short log is continued before it
        return [starts for starts in inside if len(starts) > fewest]


def rows_of(recording: Recording, start_time: float, interval: float, *segments: Segment) -> slice:
    """Return the rows of a recording that segments, counted from a time, s, reach over."""
    first, last = segments[0], segments[-1]
    ends = np.array([first.first, last.stop], dtype=np.float64)
    if first.n_cycles and last.n_cycles:
        ends = np.array([first.cycle_starts[0], last.cycle_starts[-1]])
    begin, stop = np.searchsorted(recording.time, start_time + interval * ends)
    return slice(int(begin), int(stop) + 1)


def examine(seen: Seen) -> tuple[Problem, ...]:
    """Return what is remarkable in a log, and in its cycles where it is one steady run."""
    recording, log, trace, cycles, _ = seen
    findings = [
        *recording.findings,
        *log.findings,
        *_rows(seen),
        *_rate_and_filter(seen),
        *_drive(seen),
        *(_segments(seen) if cycles is None else _one_run(seen, cycles)),
        *_size(seen),
        *_repetition(trace, recording),
        *_temperature(seen),
        *_filtered_in_the_rig(seen),
        *_lines_off_harmonics(seen),
    ]
    warned = {finding.code for finding in findings if finding.severity == "warning"}
    beside = set().union(*(_MADE_BY[name] for name in warned & _MADE_BY.keys()))
    return tuple(finding for finding in findings if finding.code not in beside)


# What else a fault of the record looks like: it is reported once, by its cause.
_MADE_BY = {
    "values_repeated": {"force_stuck", "displacement_stuck", "force_smoothed"},
    "force_stuck": {"force_smoothed"},
    "frozen_rows": {"unsteady_cycles", "force_smoothed", "rig_filter", "displacement_stuck"},
    "another_force": {"cycle_scatter", "force_trend", "force_drift"},
}


def examine_raw(recording: Recording) -> tuple[Problem, ...]:
    """Return what can be said of a log whose cycles are not known, as it was refused."""
    whole = slice(None)
    return (*recording.findings, *examine_channels(recording, whole, whole, period=0.0))


def samples_a_cycle(trace: Trace) -> float:
    """Return the samples of a cycle; 0 where nothing repeats."""
    return 1.0 / (trace.frequency * trace.interval) if trace.fastest.n_cycles else 0.0


def _judged(name: str, text: str, value: float, unit: str = "", *, fault: str = "") -> Problem:
    """Return a note; with a fault, which the text then ends with, a warning."""
    return (warning if fault else note)(name, text + fault, value=value, unit=unit)


_FROZEN_ROWS, _JUMP = 5, 5.0
_FROZEN, _BACK = 0.2, 0.3  # of a cycle, for one channel; of the range of the other


def _rows(seen: Seen) -> Iterator[Problem]:
    """Both channels; a logger that drops out repeats its last row, or the last value of one."""
    recording, trace, period = seen.recording, seen.trace, samples_a_cycle(seen.trace)
    # The model is driven through what stands between segments, too.
    driven = seen.rows(*trace.segments)
    yield from examine_channels(recording, driven, seen.rows(trace.fastest), period=period)
    steps, holds = np.abs(np.diff(recording.displacement)), np.diff(recording.force) == 0.0
    stands = steps == 0.0
    jump = _JUMP * median(steps[~stands])

    def goes_on(first: int, last: int, beside: FloatArray | None) -> bool:
        """A rest ends in no jump, and in a rest the other channel goes one way."""
        if beside is None:
            return last < len(steps) and bool(steps[last] > jump)
        part = beside[first : last + 1]
        ways = np.maximum.accumulate(part) - part, part - np.minimum.accumulate(part)
        return min(float(way.max()) for way in ways) > _BACK * float(np.ptp(beside))

    for name, is_still, beside, cycles in (
        ("both channels stand", stands & holds, None, 0.0),
        ("the displacement stands", stands, recording.force, _FROZEN),
        ("the force stands", holds, recording.displacement, _FROZEN),
    ):
        ends = np.transpose(parts_where(is_still))
        ends = ends[np.diff(ends)[:, 0] >= max(_FROZEN_ROWS, cycles * period)]
        frozen = np.array([(a, b) for a, b in ends.tolist() if goes_on(a, b, beside)])
        if n := len(frozen):
            lasting = 1e3 * median(np.diff(recording.time[frozen]))
            text = (
                f"rows are frozen: {name} still {counted(n, 'time')}, for {lasting:.3g} ms, while "
                f"the rig moves, first from row {frozen[0, 0] + 1} of the data; the logger drops "
                "out: record again, or cut these parts out"
            )
            yield warning("frozen_rows", text, value=float(n))


# Rate, filter and what drives the model.

_HARMONICS = 8.0
_TELLING = 20.0  # samples in a cycle, from which noise is separable from motion
# % of the peak velocity. It bends K_e alone: 7 % of it move a k_s that is fitted by 0.6 %.
_VELOCITY_NOISE = 0.35
_BEYOND_HALF = 2.0  # % of the speed; noise of 8 um makes far less, a triangle far more


def _rate_and_filter(seen: Seen) -> Iterator[Problem]:
    trace, log, options = seen.trace, seen.log, seen.options
    rate, frequency = trace.sample_rate, trace.frequency
    period = rate / frequency
    text = f"sampled at {rate:.4g} Hz, {period:.4g} samples a cycle"
    if math.isfinite(options.passed_corner):
        text += f", {rate / options.passed_corner:.3g} times the filter's corner"
    lost = (2.0 * math.pi / period) ** 4 / 180.0
    if lost > 1e-3:
        text += f": velocity is {100.0 * lost:.2g} % low; sample faster"
    yield (warning if lost > 1e-2 else note)("sample_rate", text, value=rate, unit="Hz")

    lost = 1.0 - gain_at(trace.model_filter, frequency, 1.0 / trace.interval)
    if lost > 1e-3:
        text = (
            f"the filter takes {100.0 * lost:.2g} % off the motion at {frequency:.3g} Hz: "
            "parameters will be off by about as much; raise its corner (conditioning.filter_corner "
            "= 'auto' follows the motion)"
        )
        yield (warning if lost > 1e-2 else note)("filter_loss", text, value=100.0 * lost, unit="%")

    # A fast motion has its knees and play hidden by a corner for slow ones.
    corner, fits = options.filter_corner, fitting_corner(frequency, rate)
    has_few = corner / frequency < _HARMONICS and fits > 1.5 * corner
    if options.is_ours and trace.fastest.n_cycles and has_few:
        passed = corner / frequency
        text = (
            f"{corner:g} Hz let the first {passed:.1f} harmonics of {frequency:.3g} Hz pass: "
            "knees of the valves and play may be hidden; conditioning.filter_corner = 'auto' takes "
            f"{fits:g} Hz"
        )
        yield note("filter_corner", text, value=passed)

    # The rig's filter has taken most of the noise; at few samples a cycle motion looks alike.
    if options.rig_filter == "none" and 1.0 / (frequency * trace.interval) >= _TELLING:
        first = round((trace.start_time - log.start_time) / log.interval) + trace.fastest.first
        first = max(first, 0)  # where the log is continued, a few samples of it may lie before
        noise = noise_of(log.displacement[first : first + trace.fastest.n_samples])
        corner = min(options.passed_corner, 0.5 * rate)
        passed = noise * math.sqrt(2.0 * corner / rate) * corner / math.sqrt(3.0)
        share = 100.0 * passed / (frequency * trace.amplitude)
        text = (
            f"noise of the displacement {1e6 * noise:.3g} um, {share:.2g} % of the peak velocity "
            "behind the filter"
        )
        fault = "; K_e comes out too low by more than 1 % at soft settings; use a quieter sensor"
        fault *= options.has_free_k_e and not share <= _VELOCITY_NOISE
        yield _judged("displacement_noise", text, 1e6 * noise, "um", fault=fault)


def _drive(seen: Seen) -> Iterator[Problem]:
    """Findings where the model's drive is not the compared motion, or not the damper's."""
    trace, options = seen.trace, seen.options
    corner, drive = options.filter_corner, trace.drive
    n_jumps, n_bridged = len(drive.jumps), len(trace.model_filter.bridged)
    if options.rig_filter != "none":
        half = 0.5 * options.rig_filter_corner
        share = 100.0 * max(
            content_beyond(trace.displacement[segment.window], trace.interval, half)
            for segment in trace.segments
        )
        if share > _BEYOND_HALF:
            text = (
                f"{share:.2g} % of the speed is beyond {half:g} Hz, half the corner of the rig's "
                "filter: the corners of the motion are lost, and the model is driven without them; "
                "log without that filter"
            )
            yield warning("drive", text, value=share, unit="%")
    elif drive.displacement is trace.displacement or drive.corner <= corner:
        if n_bridged:
            text = (
                "the motion reverses on its samples, where noise decides the sign of friction: "
                f"{n_bridged} of them are bridged, of the measured and of the modelled force"
            )
            yield note("drive", text, value=float(n_bridged))
    elif n_jumps:
        text = (
            "the motion is straight between sharp corners: the model is driven by the lines and "
            f"turns where they cross, {n_jumps} times"
        )
        yield note("drive", text, value=float(n_jumps))
    else:
        text = (
            f"the motion has content beyond {corner:g} Hz: the model is driven by the displacement "
            f"with the noise above {drive.corner:.3g} Hz taken off"
        )
        yield note("drive", text, value=drive.corner, unit="Hz")

    rests = [n for x in trace.segments for n in dwell_lengths(drive.velocity[x.window])]
    if rests:
        text = (
            f"the motion rests {len(rests)} time{'s' * (len(rests) > 1)} where it is compared, "
            f"for {max(rests) * trace.interval:.2g} s at most: what friction holds there is not "
            "known, and the model has none"
        )
        yield note("rests", text, value=float(len(rests)))


# What was found of cycles and segments.

_OTHER_FORCE = 0.2  # of the larger; a damper that warms up within a log changes by less
_SOON, _SAME = 3.0, 0.01  # cycles; of frequency and amplitude
_MANY_ELSEWHERE = 2  # steady cycles beyond a break; one may be chance in a run-up
_DECLARED = 0.05  # rigs are 2 % off what is set; more is another test
_NEAR = 0.2  # of the nominal test: further off another test was meant


def _segments(seen: Seen) -> Iterator[Problem]:
    """The segments; a broken steady run; a motion that returns with another force."""
    trace, segments = seen.trace, seen.trace.segments
    parts = ", ".join(
        f"{counted(segment.n_cycles, 'cycle')} of {segment.frequency:.3g} Hz to "
        f"{segment.peak_speed:.3g} m/s"
        if segment.n_cycles
        else f"{segment.n_samples * trace.interval:.3g} s of motion that does not repeat, to "
        f"{segment.peak_speed:.3g} m/s"
        for segment in segments
    )
    n = len(segments)
    yield note("stretches", f"{counted(n, 'segment')} evaluated: {parts}", value=float(n))

    peaks = {
        segment.first: (segment.figures.peak_force_rebound, segment.figures.peak_force_bump)
        for segment in segments
        if segment.figures
    }

    def is_one_motion(first: Segment, other: Segment) -> bool:
        if not first.n_cycles or not other.n_cycles:
            return False
        ratios = other.frequency / first.frequency, other.amplitude / first.amplitude
        return max(abs(ratio - 1.0) for ratio in ratios) < _SAME

    def is_other_force(first: Segment, other: Segment) -> bool:
        """Whether two segments are of two settings, and not of a damper that warms up."""
        pairs = np.array([peaks[first.first], peaks[other.first]])
        return bool(np.abs(pairs[0] - pairs[1]).max() > _OTHER_FORCE * np.abs(pairs).max())

    for before, behind in pairwise(segments):
        gap = (behind.first - before.stop) * trace.interval * before.frequency
        if is_one_motion(before, behind) and gap < _SOON and not is_other_force(before, behind):
            time = trace.start_time + 0.5 * (before.stop + behind.first) * trace.interval
            text = (
                f"the steady run is broken: {behind.n_cycles} more steady cycles lie beyond a "
                f"break at time {time:.4g} s; check there for a spike, a pause or another test"
            )
            yield warning("unsteady_cycles", text, value=float(behind.n_cycles))

    for first, other in combinations(segments, 2):
        if is_one_motion(first, other) and is_other_force(first, other):
            time = trace.start_time + other.first * trace.interval
            forces = ["{:.4g} and {:.4g} N".format(*peaks[x.first]) for x in (other, first)]
            text = (
                f"the motion of {first.frequency:.4g} Hz comes back at time {time:.4g} s with "
                f"another force, {' for '.join(forces)}: two settings in one record are two tests; "
                "split the log there and name each setting, or repair what changed"
            )
            yield warning("another_force", text, value=time, unit="s")
            break


def _one_run(seen: Seen, cycles: Cycles) -> Iterator[Problem]:
    """Its cycles; frequency and amplitude beside the log's preamble and the nominal test."""
    trace, nominal = seen.trace, seen.options.nominal
    n = trace.n_cycles
    text = (
        f"{n} of {trace.n_cycles_found} whole cycles evaluated (left out: run-in, "
        "filter edges, unsteady cycles)"
    )
    fault = "; one cycle cannot show how well the test repeats; record a longer log" * (n <= 1)
    yield _judged("cycles", text, float(n), fault=fault)

    steady, whole = len(cycles.rising) - 1, cycles.n_found
    if steady + 1 < 0.5 * whole:  # one more: the cycles at the log's ends may be cut
        begin = trace.start_time + trace.fastest.cycle_starts[0] * trace.interval
        text = (
            f"only {steady} of {whole} cycles in a row are steady, from time {begin:.6g} s; "
            "amplitude or period wander in the others; hold the test steady, or log one test a file"
        )
        yield warning("unsteady_cycles", text, value=100.0 * (1.0 - steady / whole), unit="%")
    elif cycles.n_elsewhere >= _MANY_ELSEWHERE:
        time = seen.log.start_time + cycles.break_at * seen.log.interval
        text = (
            f"{cycles.n_elsewhere} more steady cycles lie beyond a break at time {time:.4g} s and "
            "are not evaluated; check there for a spike, a pause or another test"
        )
        yield warning("unsteady_cycles", text, value=float(cycles.n_elsewhere))

    for name, value, unit, factor, meant, prefix, doubt in (
        ("frequency", trace.frequency, "Hz", 1.0, nominal.frequency, "", "clock and sample rate"),
        ("amplitude", trace.amplitude, "mm", 1e3, nominal.amplitude, "amplitude ",
         "the displacement's unit"),
    ):  # fmt: skip
        number = factor * value
        text, fault = f"{prefix}{number:.5g} {unit} found", ""
        declared = _declared(seen.recording.metadata, name, unit)
        off = 0.0 if meant is None else number / (factor * meant) - 1.0
        shown = "" if meant is None else f"{factor * meant:.5g} {unit} of the configuration"
        if declared is not None and abs(value / declared - 1.0) > _DECLARED:
            fault = f", but the log's preamble says {factor * declared:.5g} {unit}; check {doubt}"
        elif abs(off) > _NEAR:
            text += f", a different test from the {shown}"
        elif abs(off) > 0.005:
            side = "above" if off > 0.0 else "below"
            text += f", {abs(100.0 * off):.2g} % {side} the {shown}"
        yield _judged(name, text, number, unit, fault=fault)


def _declared(metadata: Mapping[str, str], name: str, unit: str) -> float | None:
    """Return what the log's preamble declares, SI; None where it does not, or not clearly."""
    dimension = "length" if unit == "mm" else name
    for key in (name, f"test {name}", f"{name}_{unit.lower()}", f"{name} ({unit.lower()})"):
        text = metadata.get(key, "").strip()
        if text[-1:].isdigit():
            if unit == "mm" and "mm" not in key:
                continue  # a bare number of an unknown unit
            text += unit
        with suppress(ValueError):
            if text and (value := parse_quantity(text, dimension)) > 0.0:
                return value
    return None


_LITTLE = 10.0  # N; seal friction alone is more, and 10 kN in the wrong unit is as much


def _size(seen: Seen) -> Iterator[Problem]:
    """Length, size and shape of the evaluated motion."""
    trace, log = seen.trace, seen.log
    first, last = trace.segments[0], trace.segments[-1]
    begin = float(first.cycle_starts[0]) if first.n_cycles else first.first
    end = float(last.cycle_starts[-1]) if last.n_cycles else last.stop
    lead = trace.start_time - log.start_time
    ahead = max(0.0, lead + trace.interval * begin)
    behind = max(0.0, len(log.force) * log.interval - lead - trace.interval * end)
    text = (
        f"{ahead:.3g} s at the beginning and {behind:.3g} s at the end are not evaluated (rest, "
        "run-up, coast-down, run-in, filter edges)"
    )
    yield note("trimmed", text, value=ahead + behind, unit="s")

    half = 0.5 * float(np.ptp(trace.force[trace.compared]))
    if half < _LITTLE:
        text = f"the force swings by ±{half:.3g} N, little for a damper; was kN read as N?"
        yield warning("force_range", text, value=half, unit="N")

    if trace.fastest.n_cycles:
        powers = harmonic_powers(trace.fastest, trace.displacement, 3).tolist()
        second, third = (100.0 * math.sqrt(power / powers[0]) for power in powers[1:])
        shape = ""
        if second < 2.0 and 9.0 < third < 13.0:
            shape = ", as of a triangle wave"
        elif second > 1.0 and third < 0.5 * second:
            shape = ", as of a crank"
        text = (
            f"2nd harmonic of the displacement {second:.2g} %, 3rd {third:.2g} %{shape}; the model "
            "is driven by the measured displacement"
        )
        yield note("harmonics", text, value=max(second, third), unit="%")


# How well the cycles of a test repeat.

_SCATTER = 1.0  # %
_FALL = 3.0  # %, of the peaks from the first cycle to the last; K_e is off by half of it or more
_FORCE_DRIFT = 1.0  # % of the peak force
_STROKE_DRIFT = 5.0  # % of the amplitude
_SURE, _SURE_OF_FEW = 4.0, 12.0  # standard errors; the second where three cycles give one
_ENOUGH = 4  # cycles, to separate a trend from scatter
_STEP, _STEPS_OVER, _MOST_STEPS = 0.05, 3.0, 20  # of the peak; times what stays level moves
_CURVED = 8  # cycles, from which on a trend may bend
_TREND = 12.0  # F, from which on peaks go with the cycle's number; scatter has it once in 300
_WARMER = 1.0  # K


def _repetition(trace: Trace, recording: Recording) -> Iterator[Problem]:
    starts = clean_cycles(trace.fastest)
    if len(starts) < 3:
        yield from _zero_drift(trace, is_warming=False)
        return
    edges = np.rint(starts).astype(np.int64)

    def extremes(values: FloatArray) -> FloatArray:
        """Return the highest and the lowest value of each cycle, (2, n)."""
        inside = values[: edges[-1]]
        return np.array([each.reduceat(inside, edges[:-1]) for each in (np.maximum, np.minimum)])

    peaks, has_enough = extremes(trace.force), len(starts) > _ENOUGH
    if has_enough:
        yield from _stepped_force(trace, starts, peaks)
    is_trending, warming = False, _warming(trace, recording, starts)
    floor = noise_floor(trace)
    if math.isfinite(floor):
        up, down = map(_peaks, peaks)
        # A smaller one scatters more in per cent, not worse.
        size = max(abs(up.mean), abs(down.mean))
        text = (
            f"peak force scatters by {up.scatter:.2g} % (rebound) and {down.scatter:.2g} % "
            "(compression) over the cycles"
        )
        text += ", their trend taken off" * bool(up.trend or down.trend)
        # The standard deviation of n cycles is itself uncertain by 1/sqrt(2(n-1)).
        sure = _SCATTER * (1.0 + 2.0 / math.sqrt(2.0 * (len(starts) - 2)))
        fault = f"; a good rig has {_SCATTER:g} % or less: check play, temperature, air in the oil"
        worst = 100.0 * max(up.deviation, down.deviation) / size
        yield _judged("cycle_scatter", text, worst, "%", fault=fault * (not worst <= sure))
        # Both move the same way where the zero drifts.
        ends = [peak.trend or (0.0, 0.0) for peak in (up, down)]
        fall = 0.5 * abs(ends[0][1] - ends[0][0] - ends[1][1] + ends[1][0])
        if is_trending := 100.0 * fall / size > _FALL:
            yield _force_trend(up, down, warming)
        text = f"the force differs from cycle to cycle by {floor:.2g} % of its variance"
        text += ": a right model would reach about this MSE, or less where the motion differs too"
        yield note("noise_floor", text, value=floor, unit="%")
    yield from _zero_drift(trace, is_warming=bool(is_trending and warming))
    if not has_enough:
        return

    tops, bottoms = extremes(trace.displacement)
    turns = np.arange(len(tops), dtype=np.float64)
    middle = _drift([(turns, 0.5 * (tops + bottoms))])
    swing = _drift([(turns, 0.5 * (tops - bottoms))])
    text = (
        f"mid-stroke drifts by {1e3 * middle[0]:+.2g} mm and the amplitude by "
        f"{1e3 * swing[0]:+.2g} mm over the cycles"
    )
    drift, error = max(middle, swing, key=lambda pair: abs(pair[0]))
    share = 100.0 * drift / trace.amplitude
    fault = f", {abs(share):.2g} % of the amplitude; check the sensor's fixing"
    is_sound = abs(share) <= _STROKE_DRIFT or abs(drift) <= _SURE * error
    yield _judged("stroke_drift", text, share, "%", fault="" if is_sound else fault)


class _Peaks(NamedTuple):
    """Mean of peaks, their deviation about their trend, and the trend's ends; None: no trend."""

    mean: float
    deviation: float
    trend: tuple[float, float] | None = None

    @property
    def scatter(self) -> float:
        """Deviation in % of the mean."""
        return 100.0 * self.deviation / max(abs(self.mean), 1e-300)


def _peaks(peaks: FloatArray) -> _Peaks:
    n, mean, deviation = len(peaks), mean_of(peaks), float(np.std(peaks, ddof=1))
    if n < _ENOUGH:
        return _Peaks(mean, deviation)
    degree = 2 if n >= _CURVED else 1
    basis = _polynomials(n, degree)
    line = basis @ (peaks @ basis)
    rest = float(np.sum((peaks - line) ** 2))
    gain = (float(np.sum((peaks - mean) ** 2)) - rest) / degree
    # A trend goes one way and ends elsewhere: a bend alone is none.
    goes = abs(float(line[-1] - line[0])) > 0.5 * float(np.ptp(line))
    if goes and gain > _TREND * rest / (n - 1 - degree):
        trend = float(line[0]), float(line[-1])
        return _Peaks(mean, math.sqrt(rest / (n - 1 - degree)), trend)
    return _Peaks(mean, deviation)


@lru_cache(maxsize=64)
def _polynomials(n: int, degree: int) -> FloatArray:
    """Return polynomials over so many places, square to each other, (n, degree + 1)."""
    return np.asarray(np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, n), degree + 1))[0])


def _stepped_force(trace: Trace, starts: FloatArray, peaks: FloatArray) -> Iterator[Problem]:
    """The force steps from one steady cycle to the next: another setting begins."""
    size = float(np.abs(peaks).max())
    jumps = np.flatnonzero(np.abs(np.diff(peaks)).max(axis=0) > _STEP * size) + 1
    groups = np.split(np.arange(peaks.shape[1]), jumps)
    steady = [group for group in groups if len(group) > 1]  # a cycle by itself is on its way
    if not 1 < len(steady) <= _MOST_STEPS or len(jumps) >= 2 * len(steady):
        return
    levels = [np.median(peaks[:, group], axis=1) for group in steady]
    moves = [float(np.abs(b - a).max()) for a, b in pairwise(levels)]
    inner = [group[1:-1] if len(group) > 3 else group for group in steady]  # a step takes a cycle
    wander = max(float(np.ptp(peaks[:, group], axis=1).max()) for group in inner)
    if min(moves) < max(_STEP * size, _STEPS_OVER * wander):
        return
    times = [trace.start_time + trace.interval * starts[group[0]] for group in steady]
    forces = "; then ".join(f"{up:.4g} and {down:.4g} N" for up, down in levels)
    text = (
        f"the force steps at time {', '.join(f'{time:.4g} s' for time in times[1:])} while the "
        f"motion goes on, peaks of {forces}: {len(steady)} settings in one record are as many "
        "tests; split the log there and name each setting, or repair what changed"
    )
    yield warning("another_force", text, value=times[1], unit="s")


def _warming(trace: Trace, recording: Recording, starts: FloatArray) -> tuple[float, float] | None:
    """Return the temperature of the first and of the last cycle, degC, where it changes."""
    if recording.temperature is None:
        return None
    ends = []
    for edges in (starts[:2], starts[-2:]):
        begin, end = trace.start_time + trace.interval * edges
        inside = (recording.time >= begin) & (recording.time <= end)
        ends.append(mean_of(recording.temperature[inside]))
    return (ends[0], ends[1]) if abs(ends[1] - ends[0]) >= _WARMER else None


def _force_trend(up: _Peaks, down: _Peaks, warming: tuple[float, float] | None) -> Problem:
    """Say that the damper itself changed during the test."""
    trends = [
        (*peak.trend, word) for peak, word in ((up, "rebound"), (down, "compression")) if peak.trend
    ]
    ends = [f"from {first:.3g} to {last:.3g} N ({word})" for first, last, word in trends]
    first, last, _ = max(trends, key=lambda trend: abs(trend[0]))
    share = 100.0 * (abs(last) - abs(first)) / max(abs(first), 1e-300)
    text = f"the peak force goes {' and '.join(ends)} over the cycles"
    if warming:
        text += " while the temperature goes from {:.3g} to {:.3g} degC".format(*warming)
    text += ": a trend, not scatter; the parameters are a mean over it: let the damper settle, or "
    text += "fit shorter parts of the log"
    text += ", all of them at once with {covariate}" * bool(warming)
    values = {"covariate": Option("covariate", "temperature")}
    return warning("force_trend", text, value=share, unit="%", **values)


def _zero_drift(trace: Trace, *, is_warming: bool) -> Iterator[Problem]:
    """Drift of the mean force: each speed has its own mean, one slope in time is common to all."""
    half = 0.5 * float(np.ptp(trace.force[trace.compared]))
    means = []
    for segment in trace.segments:
        if segment.n_cycles < 2:
            continue
        starts = clean if len(clean := clean_cycles(segment)) > 2 else segment.cycle_starts
        sums = cycle_energies(np.ones_like(trace.force), trace.force, starts, 1.0)
        means.append((0.5 * (starts[1:] + starts[:-1]), sums / np.diff(starts)))
    # Three cycles of one speed change twice; of several, whose edges disturb them, twice more.
    n_changes = sum(len(values) - 1 for _, values in means)
    if n_changes < (_ENOUGH if len(means) > 1 else _ENOUGH - 2) or not half > 0.0:
        return
    are_few = n_changes == _ENOUGH - 2
    drift, error = _drift(means)
    share = 100.0 * drift / half
    text = f"the mean force drifts by {drift:+.3g} N over the cycles, {abs(share):.2g} % of the "
    text += "peak"
    is_sound = abs(share) <= _FORCE_DRIFT or abs(drift) <= (_SURE, _SURE_OF_FEW)[are_few] * error
    text += ", as the peaks change with the temperature" * (is_warming and not is_sound)
    fault = "; other values take it where no offset is free; check amplifier and temperature"
    fault *= not (is_warming or is_sound)
    if fault or not are_few:
        yield _judged("force_drift", text, share, "%", fault=fault)


def _drift(groups: Sequence[tuple[FloatArray, FloatArray]]) -> tuple[float, float]:
    """Return how far values go over all places, and its error; groups have a level each."""
    place = np.concatenate([places - mean_of(places) for places, _ in groups])
    rest = np.concatenate([values - mean_of(values) for _, values in groups])
    power = float(place @ place)
    slope = float(place @ rest) / power
    rest = rest - slope * place
    degrees = max(len(rest) - len(groups) - 1, 1)
    over = sum(float(places[-1] - places[0]) for places, _ in groups)
    return slope * over, math.sqrt(float(rest @ rest) / degrees / power) * over


# Temperature. K within a log: viscosity falls by about 2 % a kelvin, and one set of parameters is
# fitted.
_WARMS = 5.0


def _temperature(seen: Seen) -> Iterator[Problem]:
    trace, test = seen.trace, seen.options.nominal
    tolerance, nominal = test.temperature_tolerance, test.temperature or 0.0
    pairs = ((trace.frequency, test.frequency), (trace.amplitude, test.amplitude))
    is_other = any(meant and abs(value / meant - 1.0) > _NEAR for value, meant in pairs)
    is_asked = test.temperature is not None and tolerance < math.inf
    is_asked = is_asked and not (test.is_of_motion and is_other)
    wanted = f"{nominal - tolerance:g} to {nominal + tolerance:g} degC"
    if seen.recording.temperature is None:
        if is_asked:
            text = f"no temperature in the log; the test asks for {wanted}; log it, or set "
            text += "rig.temperature_tolerance = inf"
            yield warning("temperature_missing", text)
        return
    values = seen.recording.temperature[seen.rows(trace.fastest)]
    mean, fault = mean_of(values), ""
    if is_asked and not abs(mean - nominal) <= tolerance:
        fault = (
            f", outside {wanted}; forces fall as the oil warms: hold the temperature, or set "
            "rig.temperature to that of this test"
        )
    yield _judged("temperature", f"{mean:.1f} degC on average", mean, "degC", fault=fault)
    low, high = percentiles(seen.recording.temperature, 2.0, 98.0)
    drift = float(high - low)
    is_wide = is_asked and drift > 2.0 * tolerance
    fault = f", more than the window of {wanted}" * is_wide
    if is_wide or drift > _WARMS:
        fault += "; let the damper settle, or record shorter logs"
    text = f"the temperature moves by {drift:.1f} degC within the log"
    yield _judged("temperature_drift", text, drift, "degC", fault=fault)


# A displacement that is smooth by itself is that of a heavy actuator.
_SMOOTHED = 30.0
# Hz, and by how much less noise there is: an amplifier's filter of 60 Hz or more does no harm.
_HARMFUL_BAND, _HARMFUL = (50.0, 80.0), 3.0


def _filtered_in_the_rig(seen: Seen) -> Iterator[Problem]:
    log = seen.log
    if seen.options.rig_filter != "none":
        return
    runs = seen.runs(fewest=1)
    text = (
        "both channels look as if the rig had filtered them: if so, set rig.filter = "
        "'causal', 'zero_phase' or 'analogue' in the configuration, or parameters are wrong"
    )
    if not runs:
        if falls_off(log.displacement, log.force, log.interval):
            text += ", and errors are too small: noise is read where that filter takes it away"
            yield warning("rig_filter", text)
        return
    motion, force = (
        noise_ratio(channel, runs[0], log.interval) for channel in (log.displacement, log.force)
    )
    if math.isnan(motion) or math.isnan(force):
        text = "a filter in the rig cannot be judged: too few cycles, or no noise above the motion"
        yield note("rig_filter", text)
    elif min(motion, force) > _SMOOTHED:
        yield warning("rig_filter", text, value=force)
    elif (
        force > _SMOOTHED
        and noise_ratio(log.force, runs[0], log.interval, beyond=_HARMFUL_BAND) > _HARMFUL
    ):
        text = (
            f"the force is smoother than the displacement: its noise is {force:.0f} times stronger "
            "below 25 Hz than far above, as behind a running mean or an amplifier's "
            "filter; friction, stiffness and forces at low speed are wrong: log it unfiltered"
        )
        yield warning("force_smoothed", text, value=force)


_TONE_SIZE = 0.01  # of half the range
_FEWEST_FOR_TONES = 3  # cycles


def _lines_off_harmonics(seen: Seen) -> Iterator[Problem]:
    log, options = seen.log, seen.options
    if options.rig_filter != "none":
        return
    corner = options.filter_corner if options.is_ours else _HARMFUL_BAND[0]
    for name, unit, factor in (("displacement", "mm", 1e3), ("force", "N", 1.0)):
        signal = getattr(log, name)
        # A line that is a harmonic of one speed is none of another.
        for starts in seen.runs(fewest=_FEWEST_FOR_TONES):
            run = slice(round(starts[0]), round(starts[-1]))
            frequency, size = tone(signal, starts, log.interval, corner)
            if size > _TONE_SIZE * 0.5 * float(np.ptp(signal[run])):
                text = (
                    f"the {name} has a line at {frequency:.3g} Hz, {factor * size:.2g} {unit}, "
                    "which is no harmonic of the motion: hum, a pump or a resonance of the rig; "
                    "find its source: the intervals count it as noise"
                )
                yield warning(f"{name}_line", text, value=frequency, unit="Hz")
                break


# The logged velocity beside the slope of the displacement: checked, never used.
#
# Rigs derive it behind a filter of their own, which makes it late, or write it in another unit
# than they say. Both channels are compared by their fundamental: the lag is that of the phase.

_SCALE = 0.1  # a velocity further off than this has another unit, or the clock has
_FASTEST = 1e6  # m/s; a damaged value beyond it must not overflow
_ALIKE = 0.7  # share of its power that must be in the fundamental


def check_velocity(trace: Trace, recording: Recording) -> tuple[Problem, ...]:
    """Return how a logged velocity compares with ours; nothing where none was logged."""
    if recording.velocity is None or not trace.fastest.n_cycles:
        return ()
    segment = trace.fastest
    time = trace.start_time + np.arange(segment.first, segment.stop) * trace.interval
    logged = np.interp(time, recording.time, np.clip(recording.velocity, -_FASTEST, _FASTEST))
    if recording.reverse_displacement:
        logged = -logged
    turn = np.exp(-2j * np.pi * trace.frequency * time)
    ours = complex(np.mean(trace.velocity[segment.window] * turn))
    theirs = complex(np.mean((logged - np.mean(logged)) * turn))
    share = 2.0 * abs(theirs) ** 2 / max(float(np.var(logged)), 1e-300)
    if not share >= _ALIKE:
        text = "the logged velocity does not follow the displacement; it is not used"
        return (note("velocity_channel", text, value=share),)
    ratio = theirs / ours
    is_opposite = ratio.real < 0.0
    phase = np.angle(-ratio if is_opposite else ratio)
    lag = float(-phase / (2.0 * math.pi * trace.frequency))
    text = (
        f"the logged velocity is {abs(ratio):.3g} times the slope of the displacement and "
        f"{1e3 * lag:.1f} ms late{', with the opposite sign' * is_opposite}; it is not used"
    )
    if abs(abs(ratio) - 1.0) <= _SCALE:
        return (note("velocity_channel", text, value=lag, unit="s"),)
    text += "; a unit or the clock of the log is wrong: check displacement, velocity and time"
    return (warning("velocity_channel", text, value=abs(ratio)),)
