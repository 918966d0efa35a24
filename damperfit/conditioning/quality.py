"""What the data of a log show of its quality: findings with a severity, never a change of data.

`examine` looks at a log whose steady cycles are known, `examine_raw` at one that was refused. Each
finding has a fixed name, and the modules it comes from say where its limits come from:

=====================================================  ==========================================
names                                                  from
=====================================================  ==========================================
rounded_time, missing_samples, jitter                  `damperfit.conditioning.timebase`
force_clipping, _stuck, _steps, _spikes; displacement  `damperfit.conditioning.channels`
sample_rate, filter_loss, cycles, unsteady_cycles,     `damperfit.conditioning.motion`
stretches, trimmed, frequency, amplitude, harmonics,
rests
cycle_scatter, force_trend, noise_floor, force_drift,  `damperfit.conditioning.repeatability`
stroke_drift
continued                                              `damperfit.conditioning.compared_part`
temperature, temperature_drift, temperature_missing    here
rig_filter                                             `damperfit.conditioning.rig_filter`
=====================================================  ==========================================
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit.conditioning.channels import Channel, examine_channel, find_spikes, noise_of
from damperfit.conditioning.motion import examine_motion
from damperfit.conditioning.repeatability import examine_repeatability
from damperfit.conditioning.rig_filter import falls_off, looks_filtered
from damperfit.recording import Finding
from damperfit.statistics import mean_of, percentiles

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from damperfit.conditioning.cycles import Cycles
    from damperfit.conditioning.options import ConditionOptions, NominalTest
    from damperfit.conditioning.timebase import UniformLog
    from damperfit.recording import Recording, Stretch, Trace

    FloatArray = NDArray[np.float64]

__all__ = ["bridge_spikes", "examine", "examine_raw"]


def examine(
    recording: Recording,
    log: UniformLog,
    trace: Trace,
    cycles: Cycles | None,
    options: ConditionOptions,
) -> tuple[Finding, ...]:
    """Return what is remarkable in a log.

    Parameters
    ----------
    recording : Recording
        As read.
    log : UniformLog
        Uniform, not yet filtered by us.
    trace : Trace
        Its steady cycles.
    cycles : Cycles
        What was found before the ends were trimmed; None where the log is no single steady run.
    options : ConditionOptions
        What was declared of the rig.
    """
    window = _rows(recording, trace, trace.fastest, trace.fastest)
    # The model is driven through what stands between stretches, too.
    driven = _rows(recording, trace, trace.stretches[0], trace.stretches[-1])
    return (
        *recording.findings,
        *log.findings,
        *_channels(recording, window, driven, period=_period(trace)),
        *examine_motion(log, trace, cycles, options, metadata=recording.metadata),
        *examine_repeatability(recording, trace),
        *_temperature(recording, window, options.nominal),
        *_rig_filter(log, trace, options),
    )


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


def _temperature(recording: Recording, window: slice, test: NominalTest) -> Iterator[Finding]:
    is_asked = test.temperature is not None and test.temperature_tolerance < math.inf
    wanted = f"{test.temperature:g} +- {test.temperature_tolerance:g} degC" if is_asked else ""
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
        text += f", more than the window of {wanted}; let the damper settle, or record shorter logs"
    severity = "warning" if is_wide else "note"
    yield Finding("temperature_drift", severity, text, drift, "degC")


def _rig_filter(log: UniformLog, trace: Trace, options: ConditionOptions) -> Iterator[Finding]:
    if options.rig_filter != "none":
        return
    steady = [stretch for stretch in trace.stretches if stretch.n_cycles]
    longest = max(steady or trace.stretches, key=lambda stretch: stretch.n_samples)
    rows = slice(0, len(log.force))
    if len(trace.stretches) > 1 or not steady:
        first = round((trace.start_time - log.start_time) / log.interval)
        rows = slice(max(first + longest.first, 0), first + longest.stop)
    channels = log.displacement[rows], log.force[rows]
    # python -m tests.identification.scatter --in-the-rig causal --declared none
    text = (
        "both channels look as if the rig had filtered them: if so, set rig.filter = "
        "'causal' or 'zero_phase' in the configuration, or parameters are off by up to 3 %"
    )
    if steady and looks_filtered(*channels, log.interval, longest.frequency):
        yield Finding("rig_filter", "warning", text)
    if not steady and falls_off(*channels, log.interval):
        text += ", and errors are too small: noise is read where that filter takes it away"
        yield Finding("rig_filter", "warning", text)
