"""What the data of a log show of its quality: findings with a severity, never a change of the data.

Limits, and what the faults cost near them (`python -m tests.conditioning.limits`; the largest error
at settings 1, 10 and 20 of the reference set, 500 Hz, no noise):

- Noise of the displacement acts through the velocity and bends K_e: 20 um cost 0.7 %, 37 um 2.4 %,
  67 um 7 %. The bar is the noise of the velocity behind the filter over its peak; 20 um are below
  it.
- Rates down to 66 Hz (44 samples a cycle, half the rate just above the filter's corner) cost
  nothing; what a low rate does cost is the spline's velocity, w^4/180 with w = 2 pi / samples in a
  cycle.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache
from itertools import combinations, pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit.conditioning.channels import Channel, examine_channel, find_spikes, noise_of
from damperfit.conditioning.cycles import clean_cycles, harmonic_powers
from damperfit.conditioning.drive import content_beyond, dwell_lengths
from damperfit.conditioning.filters import fitting_corner, gain_at
from damperfit.conditioning.repeatability import examine_repeatability
from damperfit.recording import Finding
from damperfit.statistics import mean_of, median, percentiles
from damperfit.units.quantities import parse_quantity

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from numpy.typing import NDArray

    from damperfit.conditioning.cycles import Cycles
    from damperfit.conditioning.options import ConditionOptions
    from damperfit.conditioning.timebase import UniformLog
    from damperfit.recording import Trace

    FloatArray = NDArray[np.float64]
    from damperfit.recording import Recording

    IntArray = NDArray[np.int64]

    from damperfit.conditioning.options import NominalTest
    from damperfit.recording import Stretch

__all__ = [
    "bridge_spikes",
    "check_velocity",
    "examine",
    "examine_motion",
    "examine_raw",
    "falls_off",
    "noise_ratio",
]


_VELOCITY_NOISE = 0.35  # % of the peak velocity
_HARMONICS = 8.0
_BEYOND_HALF = 2.0  # % of the speed; noise of 8 um makes far less, a triangle far more
_TELLING = 20.0  # samples in a cycle, from which on noise can be told from motion
_OTHER_FORCE = 0.2  # of the larger; a damper that warms up within a log changes by less
_DECLARED = 0.05  # rigs are 2 % off what is set; more is another test
_SOON, _SAME = 3.0, 0.01  # cycles; of frequency and amplitude
_MANY_ELSEWHERE = 2  # steady cycles beyond a break; one may be chance in a run-up
_LITTLE = 10.0  # N; seal friction alone is more, and 10 kN in the wrong unit is as much
_NEAR = 0.2  # of the nominal test: further off another test was meant
_FREQUENCY_KEYS = ("frequency", "test frequency", "frequency_hz", "frequency (hz)")
_AMPLITUDE_KEYS = ("amplitude", "test amplitude", "amplitude_mm", "amplitude (mm)")


def examine_motion(
    log: UniformLog,
    trace: Trace,
    cycles: Cycles | None,
    options: ConditionOptions,
    *,
    metadata: Mapping[str, str],
) -> Iterator[Finding]:
    """Yield what is remarkable in the steady cycles of a log."""
    yield _sample_rate(trace, options)
    yield from _filter_loss(trace)
    yield from _few_harmonics(trace, options)
    yield from _displacement_noise(log, trace, options)
    yield from _drive(trace, options)
    yield from _rests(trace)
    if cycles is None:
        yield _stretches(trace)
        yield from _broken(trace)
        yield from _another_force(trace)
    else:
        yield _cycles(trace)
        yield from _unsteady(log, trace, cycles)
        yield _frequency(metadata, trace, options)
        yield _amplitude(metadata, trace, options)
    yield _trimmed(log, trace)
    yield from _force_range(trace)
    if trace.fastest.n_cycles:
        yield _harmonics(trace)


def _sample_rate(trace: Trace, options: ConditionOptions) -> Finding:
    rate = 1.0 / trace.interval
    period = rate / trace.frequency
    text = f"sampled at {rate:.4g} Hz, {period:.4g} samples a cycle"
    corner = options.filter_corner if options.rig_filter == "none" else options.rig_filter_corner
    if options.rig_filter != "none" or options.filter != "none":
        text += f", {rate / corner:.3g} times the filter's corner"
    lost = (2.0 * math.pi / period) ** 4 / 180.0
    if lost <= 1e-3:
        return Finding("sample_rate", "note", text, rate, "Hz")
    text += f": velocity is {100.0 * lost:.2g} % low; sample faster"
    return Finding("sample_rate", "warning" if lost > 1e-2 else "note", text, rate, "Hz")


def _filter_loss(trace: Trace) -> Iterator[Finding]:
    lost = 1.0 - gain_at(trace.model_filter, trace.frequency, sample_rate=1.0 / trace.interval)
    if lost > 1e-3:
        text = (
            f"the filter takes {100.0 * lost:.2g} % off the motion at {trace.frequency:.3g} Hz: "
            "parameters will be off by about as much; raise its corner (conditioning.filter_corner "
            "= 'auto' follows the motion)"
        )
        severity = "warning" if lost > 1e-2 else "note"
        yield Finding("filter_loss", severity, text, 100.0 * lost, "%")


def _few_harmonics(trace: Trace, options: ConditionOptions) -> Iterator[Finding]:
    """Say that a fast motion has its knees and play hidden by a corner for slow ones."""
    if options.rig_filter != "none" or options.filter == "none" or not trace.fastest.n_cycles:
        return
    passed = options.filter_corner / trace.frequency
    fits = fitting_corner(trace.frequency, 1.0 / trace.interval)
    if passed < _HARMONICS and fits > 1.5 * options.filter_corner:
        text = (
            f"{options.filter_corner:g} Hz let the first {passed:.1f} harmonics of "
            f"{trace.frequency:.3g} Hz pass: knees of the valves and play may be hidden; "
            f"conditioning.filter_corner = 'auto' takes {fits:g} Hz"
        )
        yield Finding("filter_corner", "note", text, passed)


def _displacement_noise(
    log: UniformLog, trace: Trace, options: ConditionOptions
) -> Iterator[Finding]:
    if options.rig_filter != "none" or 1.0 / (trace.frequency * trace.interval) < _TELLING:
        return  # the rig's filter has taken most of it; at few samples a cycle motion looks alike
    stretch = trace.fastest
    first = round((trace.start_time - log.start_time) / log.interval) + stretch.first
    first = max(first, 0)  # where the log is continued, a few samples of it may lie before
    noise = noise_of(log.displacement[first : first + stretch.n_samples])
    rate = 1.0 / trace.interval
    corner = options.filter_corner if options.filter != "none" else 0.5 * rate
    passed = noise * math.sqrt(2.0 * corner / rate) * corner / math.sqrt(3.0)
    share = 100.0 * passed / (trace.frequency * trace.amplitude)
    text = (
        f"noise of the displacement {1e6 * noise:.3g} um, {share:.2g} % of the peak velocity "
        "behind the filter"
    )
    if share <= _VELOCITY_NOISE:
        yield Finding("displacement_noise", "note", text, 1e6 * noise, "um")
        return
    text += "; K_e comes out too low by more than 1 % at soft settings; use a quieter sensor"
    yield Finding("displacement_noise", "warning", text, 1e6 * noise, "um")


def _drive(trace: Trace, options: ConditionOptions) -> Iterator[Finding]:
    """Say what drives the model where it is not what is compared, or not what the damper saw."""
    if options.rig_filter == "none":
        if trace.drive.displacement is not trace.displacement and trace.drive.corner > (
            options.filter_corner
        ):
            turns = len(trace.drive.jumps)
            if turns:
                text = (
                    "the motion is straight between sharp corners: the model is driven by the "
                    f"lines and turns where they cross, {turns} times"
                )
                yield Finding("drive", "note", text, float(turns))
                return
            text = (
                f"the motion has content beyond {options.filter_corner:g} Hz: the model is driven "
                f"by the displacement with the noise above {trace.drive.corner:.3g} Hz taken off"
            )
            yield Finding("drive", "note", text, trace.drive.corner, "Hz")
        elif turns := len(trace.model_filter.bridged):
            text = (
                "the motion reverses on its samples, where noise decides the sign of friction: "
                f"{turns} of them are bridged, of the measured and of the modelled force"
            )
            yield Finding("drive", "note", text, float(turns))
        return
    half = 0.5 * options.rig_filter_corner
    share = 100.0 * max(
        content_beyond(trace.displacement[stretch.window], trace.interval, half)
        for stretch in trace.stretches
    )
    if share > _BEYOND_HALF:
        text = (
            f"{share:.2g} % of the speed is beyond {half:g} Hz, half the corner of the rig's "
            "filter: the corners of the motion are lost, and the model is driven without them; "
            "log without that filter"
        )
        yield Finding("drive", "warning", text, share, "%")


def _rests(trace: Trace) -> Iterator[Finding]:
    """Say that friction is not known where the compared motion rests."""
    seen = (dwell_lengths(trace.drive.velocity[one.window]) for one in trace.stretches)
    lengths = [n for several in seen for n in several]
    if lengths:
        text = (
            f"the motion rests {len(lengths)} time{'s' * (len(lengths) > 1)} where it is compared, "
            f"for {max(lengths) * trace.interval:.2g} s at most: what friction holds there is not "
            "known, and the model has none"
        )
        yield Finding("rests", "note", text, float(len(lengths)))


def _stretches(trace: Trace) -> Finding:
    parts = ", ".join(
        f"{one.n_cycles} cycles of {one.frequency:.3g} Hz to {one.peak_speed:.3g} m/s"
        if one.n_cycles
        else f"{one.n_samples * trace.interval:.3g} s of motion that does not repeat, to "
        f"{one.peak_speed:.3g} m/s"
        for one in trace.stretches
    )
    n = len(trace.stretches)
    text = f"{n} stretch{'es' * (n > 1)} evaluated: {parts}"
    return Finding("stretches", "note", text, float(n))


def _broken(trace: Trace) -> Iterator[Finding]:
    """Say where a run goes on after a moment as it was before: something broke it."""
    for before, behind in pairwise(trace.stretches):
        gap = (behind.first - before.stop) * trace.interval * before.frequency
        ratios = behind.frequency / before.frequency, behind.amplitude / before.amplitude
        is_same = max(abs(ratio - 1.0) for ratio in ratios) < _SAME
        is_known = _is_other_force(before, behind)
        if before.n_cycles and behind.n_cycles and gap < _SOON and is_same and not is_known:
            time = trace.start_time + 0.5 * (before.stop + behind.first) * trace.interval
            text = (
                f"the steady run is broken: {behind.n_cycles} more steady cycles lie beyond a "
                f"break at time {time:.4g} s; check there for a spike, a pause or another test"
            )
            yield Finding("unsteady_cycles", "warning", text, float(behind.n_cycles))


def _another_force(trace: Trace) -> Iterator[Finding]:
    """Say where a motion comes back with another force: two settings in one record."""
    steady = [one for one in trace.stretches if one.n_cycles]
    for first, other in combinations(steady, 2):
        ratios = other.frequency / first.frequency, other.amplitude / first.amplitude
        if max(abs(ratio - 1.0) for ratio in ratios) < _SAME and _is_other_force(first, other):
            time = trace.start_time + other.first * trace.interval
            forces = [
                f"{one.figures.peak_force_rebound:.4g} and {one.figures.peak_force_bump:.4g} N"
                for one in (other, first)
                if one.figures
            ]
            text = (
                f"the motion of {first.frequency:.4g} Hz comes back at time {time:.4g} s with "
                f"another force, {' for '.join(forces)}: two settings in one record are two tests; "
                "split the log there and name each setting, or repair what changed"
            )
            yield Finding("another_force", "warning", text, time, "s")
            return


def _is_other_force(first: Stretch, other: Stretch) -> bool:
    """Say whether two stretches of one motion are of two settings, and not of a warm damper."""
    if first.figures is None or other.figures is None:
        return False
    pairs = (
        (first.figures.peak_force_rebound, other.figures.peak_force_rebound),
        (first.figures.peak_force_bump, other.figures.peak_force_bump),
    )
    size = max(abs(force) for pair in pairs for force in pair)
    return max(abs(a - b) for a, b in pairs) > _OTHER_FORCE * size


def _cycles(trace: Trace) -> Finding:
    text = (
        f"{trace.n_cycles} of {trace.n_cycles_found} whole cycles evaluated (left out: run-in, "
        "filter edges, unsteady cycles)"
    )
    if trace.n_cycles > 1:
        return Finding("cycles", "note", text, float(trace.n_cycles))
    text += "; one cycle cannot show how well the test repeats; record a longer log"
    return Finding("cycles", "warning", text, float(trace.n_cycles))


def _unsteady(log: UniformLog, trace: Trace, cycles: Cycles) -> Iterator[Finding]:
    steady, found = len(cycles.rising) - 1, cycles.n_found
    if steady + 1 >= 0.5 * found:  # one more: the cycles at the log's ends may be cut
        if cycles.n_elsewhere >= _MANY_ELSEWHERE:
            time = log.start_time + cycles.break_at * log.interval
            text = (
                f"{cycles.n_elsewhere} more steady cycles lie beyond a break at time "
                f"{time:.4g} s and are not evaluated; check there for a spike, a pause or "
                "another test"
            )
            yield Finding("unsteady_cycles", "warning", text, float(cycles.n_elsewhere))
        return
    begin = trace.start_time + trace.fastest.cycle_starts[0] * trace.interval
    text = (
        f"only {steady} of {found} cycles in a row are steady, from time {begin:.6g} s; amplitude "
        "or period wander in the others; hold the test steady, or log one test a file"
    )
    yield Finding("unsteady_cycles", "warning", text, 100.0 * (1.0 - steady / found), "%")


def _trimmed(log: UniformLog, trace: Trace) -> Finding:
    first, last = trace.stretches[0], trace.stretches[-1]
    begin = float(first.cycle_starts[0]) if first.n_cycles else first.first
    end = float(last.cycle_starts[-1]) if last.n_cycles else last.stop
    lead = trace.start_time - log.start_time
    ahead = max(0.0, lead + trace.interval * begin)
    behind = max(0.0, len(log.force) * log.interval - lead - trace.interval * end)
    text = (
        f"{ahead:.3g} s at the beginning and {behind:.3g} s at the end are not evaluated (rest, "
        "run-up, coast-down, run-in, filter edges)"
    )
    return Finding("trimmed", "note", text, ahead + behind, "s")


def _frequency(metadata: Mapping[str, str], trace: Trace, options: ConditionOptions) -> Finding:
    found = trace.frequency
    text = f"{found:.5g} Hz found"
    said = _said(metadata, _FREQUENCY_KEYS, "frequency")
    if said is not None and abs(found / said - 1.0) > _DECLARED:
        text += f", but the log's preamble says {said:.5g} Hz; check clock and sample rate"
        return Finding("frequency", "warning", text, found, "Hz")
    text += _beside_nominal(found, options.nominal.frequency, "Hz")
    return Finding("frequency", "note", text, found, "Hz")


def _amplitude(metadata: Mapping[str, str], trace: Trace, options: ConditionOptions) -> Finding:
    found = 1e3 * trace.amplitude
    text = f"amplitude {found:.5g} mm found"
    said = _said(metadata, _AMPLITUDE_KEYS, "length")
    if said is not None and abs(trace.amplitude / said - 1.0) > _DECLARED:
        text += f", but the log's preamble says {1e3 * said:.5g} mm; check the displacement's unit"
        return Finding("amplitude", "warning", text, found, "mm")
    nominal = options.nominal.amplitude
    text += _beside_nominal(found, None if nominal is None else 1e3 * nominal, "mm")
    return Finding("amplitude", "note", text, found, "mm")


def _force_range(trace: Trace) -> Iterator[Finding]:
    half = 0.5 * float(np.ptp(trace.force[trace.compared]))
    if half < _LITTLE:
        text = f"the force swings by +-{half:.3g} N, little for a damper; was kN read as N?"
        yield Finding("force_range", "warning", text, half, "N")


def _beside_nominal(found: float, nominal: float | None, unit: str) -> str:
    if nominal is None or abs(found / nominal - 1.0) <= 0.005:
        return ""
    off = 100.0 * (found / nominal - 1.0)
    if abs(off) > 100.0 * _NEAR:
        return f", a different test from the {nominal:.5g} {unit} of the configuration"
    side = "above" if off > 0.0 else "below"
    return f", {abs(off):.2g} % {side} the {nominal:.5g} {unit} of the configuration"


def _said(metadata: Mapping[str, str], keys: tuple[str, ...], dimension: str) -> float | None:
    """Return what the log's preamble declares, SI; None where it does not, or not clearly."""
    for key in keys:
        text = metadata.get(key, "").strip()
        if not text:
            continue
        if text[-1:].isdigit():
            if dimension == "length" and "mm" not in key:
                continue  # a bare number of an unknown unit
            text += "mm" if dimension == "length" else "Hz"
        try:
            value = parse_quantity(text, dimension)
        except ValueError:
            continue
        if value > 0.0:
            return value
    return None


def _harmonics(trace: Trace) -> Finding:
    starts = clean_cycles(trace.fastest)
    window = slice(round(float(starts[0])), round(float(starts[-1])))
    turns = (len(starts) - 1) / float(starts[-1] - starts[0])
    first, *higher = harmonic_powers(trace.displacement[window], turns, 3).tolist()
    second, third = (100.0 * math.sqrt(power / first) for power in higher)
    shape = ""
    if second < 2.0 and 9.0 < third < 13.0:
        shape = ", as of a triangle wave"
    elif second > 1.0 and third < 0.5 * second:
        shape = ", as of a crank"
    text = (
        f"2nd harmonic of the displacement {second:.2g} %, 3rd {third:.2g} %{shape}; the model is "
        "driven by the measured displacement"
    )
    return Finding("harmonics", "note", text, max(second, third), "%")


# The logged velocity beside the slope of the displacement: checked, never used.
#
# Rigs derive it behind a filter of their own, which makes it late, or write it in another unit
# than they say. Both channels are compared by their fundamental: the lag is that of the phase.

_SCALE = 0.1  # a velocity further off than this has another unit, or the clock has
_FASTEST = 1e6  # m/s; a damaged value beyond it must not overflow
_ALIKE = 0.7  # share of its power that must be in the fundamental


def check_velocity(trace: Trace, recording: Recording) -> tuple[Finding, ...]:
    """Return how a logged velocity compares with ours; nothing where none was logged."""
    if recording.velocity is None or not trace.fastest.n_cycles:
        return ()
    stretch = trace.fastest
    index = np.arange(stretch.first, stretch.stop)
    time = trace.start_time + index * trace.interval
    logged = np.interp(time, recording.time, np.clip(recording.velocity, -_FASTEST, _FASTEST))
    if recording.reverse_displacement:
        logged = -logged
    turn = np.exp(-2j * np.pi * trace.frequency * time)
    ours = complex(np.mean(trace.velocity[stretch.window] * turn))
    theirs = complex(np.mean((logged - np.mean(logged)) * turn))
    share = 2.0 * abs(theirs) ** 2 / max(float(np.var(logged)), 1e-300)
    if not share >= _ALIKE:
        text = "the logged velocity does not follow the displacement; it is not used"
        return (Finding("velocity_channel", "note", text, share),)
    ratio = theirs / ours
    is_opposite = ratio.real < 0.0
    phase = np.angle(-ratio if is_opposite else ratio)
    lag = float(-phase / (2.0 * math.pi * trace.frequency))
    sign = ", with the opposite sign" if is_opposite else ""
    text = (
        f"the logged velocity is {abs(ratio):.3g} times the slope of the displacement and "
        f"{1e3 * lag:.1f} ms late{sign}; it is not used"
    )
    if abs(abs(ratio) - 1.0) <= _SCALE:
        return (Finding("velocity_channel", "note", text, lag, "s"),)
    text += "; a unit or the clock of the log is wrong: check displacement, velocity and time"
    return (Finding("velocity_channel", "warning", text, abs(ratio)),)


# Whether a log looks as if the rig had filtered it.
#
# Sensor noise is about as strong just above the motion as near half the sample rate; a low-pass in
# the rig takes it away up there. Of steady cycles noise is what differs from cycle to cycle. The
# ratio of its two levels, as medians over the lines of the spectrum, is 0.1 to 9 in logs that
# nobody filtered, of real rigs too, where the lower band also has the motion's own unrest. A 30 or
# 60 Hz filter makes it 80 to 25 000 in the force and 4 to 1700 in the displacement, by the last
# digit of the log (`python -m tests.conditioning.limits --filters`); a running mean over 50 ms 50.
# A force that is smoothed beside a displacement that is not is told alone; a displacement is not,
# for a heavy actuator is smooth by itself.
#
# Where nothing repeats, motion and force have content just above the motion. There the noise is
# looked at by itself: two bands far above the motion, the upper one twice as high, of which a
# low-pass leaves less: of the force at least 47 times, mostly a thousand times. Of a raw road or
# sweep the force has up to 5 times as much in the lower one (its friction jumps), the
# displacement 1.4 times; where speeds jump, or turn within 20 ms, the force has up to 34 times.

_NEAR_RIG_FILTER = (10.0, 25.0)  # Hz, below any low-pass that a damper rig uses
_BEYOND_MOTION = 3.0  # times its frequency
_FAR = (0.3, 0.45)  # of the sample rate
_LEAST_FAR = 60.0  # Hz
_FEWEST_LINES = 5
_LOUD = 20.0  # times the median power of half a cycle
_FILTERED = 100.0
_SMOOTHED, _NOT_SMOOTHED = 30.0, 10.0
# Hz, and by how much less noise there is: an amplifier's filter of 60 Hz or more does no harm.
_HARMFUL_BAND, _HARMFUL = (50.0, 80.0), 3.0
# Of the sample rate, and by how much more the lower band has of each channel.
_LOWER = (0.15, 0.2)
_UPPER = (0.4, 0.45)
_MORE_DISPLACEMENT, _MORE_FORCE = 4.0, 40.0
_FEWEST_OF_NOISE = 50  # lines of each band


def noise_ratio(
    signal: FloatArray,
    starts: FloatArray,
    interval: float,
    *,
    beyond: tuple[float, float] | None = None,
) -> float:
    """Return the noise just above the motion over that far above it; NaN where none can tell.

    Parameters
    ----------
    signal : numpy.ndarray
        Shape (n,), as logged.
    starts : numpy.ndarray
        Where its cycles begin, samples; two cycles at least.
    interval : float
        Sample interval, s.
    beyond : tuple of float, optional
        The upper band, Hz; 0.3 to 0.45 of the sample rate.
    """
    if len(starts) < 3:
        return math.nan
    period = float(starts[-1] - starts[0]) / (len(starts) - 1)
    at = np.arange(math.ceil(starts[0]), math.floor(starts[-1] - period))
    unlike = np.interp(at + period, np.arange(len(signal)), signal) - signal[at]
    size = round(period / 2.0)
    _without_scatter(unlike, signal[at], size)
    _without_damage(unlike, size)
    low = max(_NEAR_RIG_FILTER[0], _BEYOND_MOTION / (period * interval))
    high = low + _NEAR_RIG_FILTER[1] - _NEAR_RIG_FILTER[0]
    length = len(at) * interval
    far = beyond or (max(_LEAST_FAR, _FAR[0] / interval), _FAR[1] / interval)
    bands = [(low, high), far]
    near_lines, far_lines = (_lines(*band, length, len(at)) for band in bands)
    if high >= far[0] or min(len(near_lines), len(far_lines)) < _FEWEST_LINES:
        return math.nan
    spectrum = np.fft.rfft((unlike - mean_of(unlike)) * _window(len(at)))
    level = median(np.abs(spectrum[far_lines]) ** 2)
    return median(np.abs(spectrum[near_lines]) ** 2) / level if level > 0.0 else math.nan


def _without_scatter(unlike: FloatArray, signal: FloatArray, size: int) -> None:
    """Take off what is another level or size of each half cycle, in place: it is no noise."""
    begins = np.arange(0, len(unlike), size)
    lengths = np.diff([*begins, len(unlike)])

    def middle(values: FloatArray) -> FloatArray:
        return np.repeat(np.add.reduceat(values, begins) / lengths, lengths)

    unlike -= middle(unlike)
    form = signal - middle(signal)
    power = np.maximum(np.add.reduceat(form * form, begins), 1e-300)
    unlike -= np.repeat(np.add.reduceat(form * unlike, begins) / power, lengths) * form


def _without_damage(unlike: FloatArray, size: int) -> None:
    """Take off half cycles that are far louder than most, in place: a blow is no noise."""
    begins = np.arange(0, len(unlike), size)
    lengths = np.diff([*begins, len(unlike)])
    power = np.add.reduceat(unlike * unlike, begins) / lengths
    unlike[np.repeat(power > _LOUD * median(power), lengths)] = 0.0


def falls_off(displacement: FloatArray, force: FloatArray, interval: float) -> bool:
    """Whether the noise of both channels falls off far above a motion that does not repeat."""
    return (
        _more_below(displacement, interval) > _MORE_DISPLACEMENT
        and _more_below(force, interval) > _MORE_FORCE
    )


def _more_below(signal: FloatArray, interval: float) -> float:
    """Ratio of the noise's level in the lower band to that in the upper; 0 when not known."""
    if _LOWER[0] / interval < _LEAST_FAR:
        return 0.0
    length = len(signal) * interval
    lower, upper = (
        _lines(below / interval, above / interval, length, len(signal))
        for below, above in (_LOWER, _UPPER)
    )
    if min(len(lower), len(upper)) < _FEWEST_OF_NOISE:
        return 0.0
    spectrum = np.fft.rfft((signal - mean_of(signal)) * _window(len(signal)))
    level = median(np.abs(spectrum[upper]) ** 2)
    return median(np.abs(spectrum[lower]) ** 2) / level if level > 0.0 else 0.0


def _lines(above: float, below: float, length: float, n: int) -> IntArray:
    """Return the lines of the spectrum of a log between two frequencies."""
    some = np.arange(int(above * length), min(math.ceil(below * length), n // 2) + 1)
    return some[(some / length > above) & (some / length < below)]


@lru_cache(maxsize=2)
def _window(n: int) -> FloatArray:
    """Blackman's: logs of one rig are of one length, and its cosines cost more than a spectrum."""
    return np.blackman(n)


# What the data of a log show of its quality: findings with a severity, never a change of data.
#
# `examine` looks at a log whose steady cycles are known, `examine_raw` at one that was refused.
# Each finding has a fixed name, and the modules it comes from say where its limits come from:
#
# =====================================================  ==========================================
# names                                                  from
# =====================================================  ==========================================
# rounded_time, missing_samples, jitter                  `damperfit.conditioning.timebase`
# force_clipping, _stuck, _steps, _spikes; displacement  `damperfit.conditioning.channels`
# sample_rate, filter_loss, cycles, unsteady_cycles,     `damperfit.conditioning.findings`
# stretches, trimmed, frequency, amplitude, harmonics,
# rests
# cycle_scatter, force_trend, noise_floor, force_drift,  `damperfit.conditioning.repeatability`
# stroke_drift
# continued                                              `damperfit.conditioning.segments`
# temperature, temperature_drift, temperature_missing    here
# rig_filter, force_smoothed, frozen_rows                here
# =====================================================  ==========================================


def examine(
    recording: Recording,
    log: UniformLog,
    trace: Trace,
    cycles: Cycles | None,
    options: ConditionOptions,
) -> tuple[Finding, ...]:
    """Return what is remarkable in a log."""
    window = _rows(recording, trace, trace.fastest, trace.fastest)
    # The model is driven through what stands between stretches, too.
    driven = _rows(recording, trace, trace.stretches[0], trace.stretches[-1])
    found = (
        *recording.findings,
        *log.findings,
        *_channels(recording, window, driven, period=_period(trace)),
        *frozen_rows(recording),
        *examine_motion(log, trace, cycles, options, metadata=recording.metadata),
        *examine_repeatability(recording, trace),
        *_temperature(recording, window, trace, options.nominal),
        *_rig_filter(log, trace, options),
        *_lines_off_harmonics(log, trace, options),
    )
    names = {one.name for one in found if one.severity == "warning"}
    beside = set().union(*(_MADE_BY[name] for name in names & _MADE_BY.keys()))
    return tuple(one for one in found if one.name not in beside)


# What else a fault of the record looks like: it is told once, by its cause.
_MADE_BY = {
    "values_repeated": {"force_stuck", "displacement_stuck", "force_smoothed"},
    "force_stuck": {"force_smoothed"},
    "frozen_rows": {"unsteady_cycles", "force_smoothed"},
    "another_force": {"cycle_scatter", "force_trend", "force_drift"},
}


def examine_raw(recording: Recording) -> tuple[Finding, ...]:
    """Return what can be said of a log whose cycles are not known, as it was refused."""
    return (*recording.findings, *_channels(recording, slice(None), slice(None), period=0.0))


def _period(trace: Trace) -> float:
    """Return the samples of a cycle; 0 where nothing repeats."""
    return 1.0 / (trace.frequency * trace.interval) if trace.fastest.n_cycles else 0.0


def _rows(recording: Recording, trace: Trace, first: Stretch, last: Stretch) -> slice:
    """Return the rows from the beginning of a stretch to the end of another."""
    ends = np.array([first.first, last.stop], dtype=np.float64)
    if first.n_cycles and last.n_cycles:
        ends = np.array([first.cycle_starts[0], last.cycle_starts[-1]])
    begin, stop = np.searchsorted(recording.time, trace.start_time + trace.interval * ends)
    return slice(int(begin), int(stop) + 1)


# A logger that drops out repeats its last row: both channels stand still for so many rows, and then
# jump by more than so many usual steps of the displacement. A rest ends at a speed, not in a jump.
_FROZEN_ROWS, _JUMP = 5, 5.0


def frozen_rows(recording: Recording) -> Iterator[Finding]:
    """Yield a warning where rows are frozen."""
    x, force = recording.displacement, recording.force
    steps = np.abs(np.diff(x))
    is_still = (steps == 0.0) & (np.diff(force) == 0.0)
    if not is_still.any() or is_still.all():
        return
    edges = np.flatnonzero(np.diff(np.concatenate([[False], is_still, [False]])))
    begins, ends = edges[::2], edges[1::2]
    inside = ends < len(steps)
    begins, ends = begins[inside], ends[inside]
    usual = median(steps[~is_still])
    is_frozen = (ends - begins >= _FROZEN_ROWS) & (steps[ends] > _JUMP * usual)
    if not is_frozen.any():
        return
    count, first = int(is_frozen.sum()), int(begins[is_frozen][0])
    seconds = median(recording.time[ends[is_frozen]] - recording.time[begins[is_frozen]])
    text = (
        f"rows are frozen: both channels stand still {count} time{'s' * (count > 1)}, for "
        f"{1e3 * seconds:.3g} ms, and jump then, first from row {first + 1} of the data; the "
        "logger drops out: record again, or cut these parts out"
    )
    yield Finding("frozen_rows", "warning", text, float(count))


def _channels(
    recording: Recording, window: slice, driven: slice, *, period: float
) -> Iterator[Finding]:
    for name, unit, factor, rows in (
        ("displacement", "mm", 1e3, driven),
        ("force", "N", 1.0, window),
    ):
        channels = {"force": recording.force[rows], "displacement": recording.displacement[rows]}
        values = channels.pop(name)
        (other,) = channels.values()
        first_row = (rows.start or 0) + 1
        yield from examine_channel(
            Channel(name, unit, factor, values, other, recording.time[rows], first_row, period)
        )


def bridge_spikes(recording: Recording, trace: Trace) -> Recording:
    """Return the recording with its spikes replaced by straight lines, and a finding of that.

    Parameters
    ----------
    recording : Recording
        As read.
    trace : Trace
        What became of it; its cycles tell a spike from what happens in each of them.
    """
    period = _period(trace)
    found: list[Finding] = []
    bridged: dict[str, Any] = {}
    for name, other, unit, factor in (
        ("displacement", "force", "mm", 1e3),
        ("force", "displacement", "N", 1.0),
    ):
        values = getattr(recording, name)
        channel = Channel(
            name, unit, factor, values, getattr(recording, other), recording.time, period=period
        )
        low, high = percentiles(values, 1.0, 99.0)
        usual = high - low
        rows = find_spikes(channel, usual, noise=noise_of(values))
        if len(rows):
            good = np.delete(np.arange(len(values)), rows)
            bridged[name] = np.interp(recording.time, recording.time[good], values[good])
            plural = "s" * (len(rows) > 1)
            text = f"{len(rows)} spike{plural} in the {name} bridged as declared, the first in "
            text += channel.place(int(rows[0]))
            found.append(Finding(f"{name}_spikes_bridged", "note", text, float(len(rows))))
    return replace(recording, **bridged, findings=(*recording.findings, *found))


# K within a log: viscosity falls by about 2 % a kelvin, and one set of parameters is fitted.
_WARMS = 5.0


def _is_other_test(trace: Trace, test: NominalTest) -> bool:
    """Whether a log has another motion than the nominal test."""
    pairs = ((trace.frequency, test.frequency), (trace.amplitude, test.amplitude))
    return any(nominal and abs(found / nominal - 1.0) > _NEAR for found, nominal in pairs)


def _temperature(
    recording: Recording, window: slice, trace: Trace, test: NominalTest
) -> Iterator[Finding]:
    is_asked = test.temperature is not None and test.temperature_tolerance < math.inf
    is_asked = is_asked and not (test.is_of_motion and _is_other_test(trace, test))
    wanted = ""
    if is_asked:
        low, high = (
            (test.temperature or 0.0) + sign * test.temperature_tolerance for sign in (-1.0, 1.0)
        )
        wanted = f"{low:g} to {high:g} degC"
    if recording.temperature is None:
        if is_asked:
            text = f"no temperature in the log; the test asks for {wanted}; log it, or set "
            text += "rig.temperature_tolerance = inf"
            yield Finding("temperature_missing", "warning", text)
        return
    values = recording.temperature[window]
    mean = mean_of(values)
    low, high = percentiles(values, 2.0, 98.0)
    drift = float(high - low)
    text = f"{mean:.1f} degC on average"
    is_outside = (
        is_asked and not abs(mean - (test.temperature or 0.0)) <= test.temperature_tolerance
    )
    if is_outside:
        text += f", outside {wanted}; forces fall as the oil warms: hold the temperature, "
        text += "or set rig.temperature to that of this test"
    yield Finding("temperature", "warning" if is_outside else "note", text, mean, "degC")
    text = f"the temperature moves by {drift:.1f} degC within the run"
    is_wide = is_asked and drift > 2.0 * test.temperature_tolerance
    if is_wide:
        text += f", more than the window of {wanted}"
    is_wide = is_wide or drift > _WARMS
    if is_wide:
        text += "; let the damper settle, or record shorter logs"
    severity = "warning" if is_wide else "note"
    yield Finding("temperature_drift", severity, text, drift, "degC")


def _rig_filter(log: UniformLog, trace: Trace, options: ConditionOptions) -> Iterator[Finding]:
    if options.rig_filter != "none":
        return
    steady = [stretch for stretch in trace.stretches if stretch.n_cycles]
    # python -m tests.identification.scatter --in-the-rig causal
    text = (
        "both channels look as if the rig had filtered them: if so, set rig.filter = "
        "'causal' or 'zero_phase' in the configuration, or parameters are off by up to 3 %"
    )
    if not steady:
        if falls_off(log.displacement, log.force, log.interval):
            text += ", and errors are too small: noise is read where that filter takes it away"
            yield Finding("rig_filter", "warning", text)
        return
    longest = max(steady, key=lambda stretch: stretch.n_samples)
    starts = longest.cycle_starts + round((trace.start_time - log.start_time) / log.interval)
    motion, force = (
        noise_ratio(channel, starts, log.interval) for channel in (log.displacement, log.force)
    )
    if math.isnan(motion) or math.isnan(force):
        text = "whether the rig has filtered a channel cannot be judged: "
        text += "too few cycles, or no noise above the motion"
        yield Finding("rig_filter", "note", text)
    elif motion > _SMOOTHED and force > _FILTERED:
        yield Finding("rig_filter", "warning", text, force)
    elif force > _SMOOTHED and motion < _NOT_SMOOTHED:
        if not noise_ratio(log.force, starts, log.interval, beyond=_HARMFUL_BAND) > _HARMFUL:
            return
        text = (
            f"the force is smoothed and the displacement is not: its noise is {force:.0f} times "
            "stronger below 25 Hz than far above, as behind a running mean or an amplifier's "
            "filter; friction, stiffness and forces at low speed are wrong: log it unfiltered"
        )
        yield Finding("force_smoothed", "warning", text, force)


# A line of the spectrum that is no harmonic of the motion: hum of the mains, a pump, a loose
# fixture. What repeats cancels in the difference of one cycle to the next. The highest of a hundred
# lines of white noise is 8 times their median; a tone of 1 % of the force, 8 cycles of 300 lines
# and noise of 0.3 % is 400 times.
_TONE, _TONE_BESIDE, _TONE_SIZE = 60.0, 3, 0.01
_FEW_FOR_TONES, _FEWEST_OF_TONES = 4, 20  # cycles; lines
_TONE_SEEN = 0.35  # of its size, at least, is in that difference


def _lines_off_harmonics(
    log: UniformLog, trace: Trace, options: ConditionOptions
) -> Iterator[Finding]:
    steady = [stretch for stretch in trace.stretches if stretch.n_cycles > _FEW_FOR_TONES]
    if not steady or options.rig_filter != "none":
        return
    longest = max(steady, key=lambda stretch: stretch.n_samples)
    starts = longest.cycle_starts + round((trace.start_time - log.start_time) / log.interval)
    corner = options.filter_corner if options.filter != "none" else _HARMFUL_BAND[0]
    for name, unit, factor, signal in (
        ("displacement", "mm", 1e3, log.displacement),
        ("force", "N", 1.0, log.force),
    ):
        frequency, size = tone(signal, starts, log.interval, corner)
        half = 0.5 * float(np.ptp(signal[longest.window]))
        if size > _TONE_SIZE * half:
            text = (
                f"the {name} has a line at {frequency:.3g} Hz, {factor * size:.2g} {unit}, which "
                "is no harmonic of the motion: hum, a pump or a resonance of the rig; find its "
                "source, for errors of what is fitted count it as noise"
            )
            yield Finding(f"{name}_line", "warning", text, frequency, "Hz")


def tone(
    signal: FloatArray, starts: FloatArray, interval: float, corner: float
) -> tuple[float, float]:
    """Return frequency (Hz) and amplitude of a line off the harmonics; zeros where there is none.

    Parameters
    ----------
    signal : numpy.ndarray
        Shape (n,), as logged.
    starts : numpy.ndarray
        Where its cycles begin, samples.
    interval, corner : float
        Of its samples, s; the highest frequency that counts, Hz.
    """
    period = float(starts[-1] - starts[0]) / (len(starts) - 1)
    at = np.arange(math.ceil(starts[0]), math.floor(starts[-1] - period))
    unlike = np.interp(at + period, np.arange(len(signal)), signal) - signal[at]
    _without_scatter(unlike, signal[at], round(period / 2.0))
    window = _window(len(at))
    spectrum = np.abs(np.fft.rfft((unlike - mean_of(unlike)) * window))
    lines = _lines(_BEYOND_MOTION / (period * interval), corner, len(at) * interval, len(at))
    if len(lines) < _FEWEST_OF_TONES:
        return 0.0, 0.0
    peak = int(lines[np.argmax(spectrum[lines])])
    others = lines[np.abs(lines - peak) > _TONE_BESIDE]
    # Between two lines both have a part of it.
    place = peak + _between(np.log(np.maximum(spectrum[peak - 1 : peak + 2], 1e-300)))
    frequency = place / (len(at) * interval)
    seen = 2.0 * abs(math.sin(math.pi * frequency * period * interval))
    is_clear = spectrum[peak] ** 2 > _TONE * median(spectrum[others] ** 2)
    if not is_clear or seen < _TONE_SEEN:
        return 0.0, 0.0
    return frequency, 2.0 * float(spectrum[peak]) / float(window.sum()) / seen


def _between(near: FloatArray) -> float:
    """Return by how many places the top of a parabola through three is off the middle one."""
    below, at, above = near.tolist()
    bend = below - 2.0 * at + above
    return min(max(0.5 * (below - above) / bend, -0.5), 0.5) if bend < 0.0 else 0.0
