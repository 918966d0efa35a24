"""What the steady cycles of a log show: rate, motion, drift and scatter of the test.

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
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from damperfit.conditioning.channels import noise_of
from damperfit.conditioning.corner import fitting_corner
from damperfit.conditioning.cycles import clean_cycles
from damperfit.conditioning.drive import content_beyond
from damperfit.conditioning.filters import gain_at
from damperfit.conditioning.harmonics import harmonic_powers
from damperfit.conditioning.rests import samples_at_rest
from damperfit.recording import Finding
from damperfit.units.quantities import parse_quantity

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from numpy.typing import NDArray

    from damperfit.conditioning.cycles import Cycles
    from damperfit.conditioning.options import ConditionOptions
    from damperfit.conditioning.timebase import UniformLog
    from damperfit.recording import Trace

    FloatArray = NDArray[np.float64]

__all__ = ["examine_motion"]

_VELOCITY_NOISE = 0.35  # % of the peak velocity
_HARMONICS = 8.0
_BEYOND_HALF = 2.0  # % of the speed; noise of 8 um makes far less, a triangle far more
_TELLING = 20.0  # samples in a cycle, from which on noise can be told from motion
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
                "the motion turns on its samples, where noise decides which way friction acts: "
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
    seen = (samples_at_rest(trace.drive.velocity[one.window]) for one in trace.stretches)
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
        if before.n_cycles and behind.n_cycles and gap < _SOON and is_same:
            time = trace.start_time + 0.5 * (before.stop + behind.first) * trace.interval
            text = (
                f"the steady run is broken: {behind.n_cycles} more steady cycles lie beyond a "
                f"break at time {time:.4g} s; check there for a spike, a pause or another test"
            )
            yield Finding("unsteady_cycles", "warning", text, float(behind.n_cycles))


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
