"""The chain from a recording to a trace, step by step.

Which filter stands where (C is one causal pass, C* the same pass run backward in time, Z the
zero-phase filter; x and f are what the rig's sensors saw)::

    rig_filter   filter       displacement of the trace   force of the trace   model_filter
    none         none         x                           f                    -
    none         zero_phase   Z x                         Z f                  Z
    none         causal       C* C x                      C* C f               C* C
    zero_phase   (not used)   as logged, C* C x           as logged, C* C f    C* C
    causal       (not used)   C* (logged)  = C* C x       C* (logged)          C* C

A model driven by an already delayed displacement must not be delayed again, and one displacement
cannot be both late (beside the late force) and in time (for the model). So a causal pass, the
rig's or ours, is completed by its backward pass: both channels come back in time, loops are
aligned, and the model's force passes the completed filter. ``filter = "causal"`` thus treats a
raw log exactly as ``rig_filter = "causal"`` treats one that the rig has filtered.

C is the bilinear design at the log's rate. A rig whose filter is analogue, or digital at a much
higher rate, differs from it near half the log's rate. Noise-free, five free parameters at setting
10 of the reference set, that costs 0.02 % of R_m1 and 0.1 % of R_m2 at 500 Hz, and a tenth of it
at 1 kHz.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from damperfit.conditioning.corrections import (
    describe_level,
    describe_middle,
    find_skew,
    level_of,
    put_right,
)
from damperfit.conditioning.cycles import Cycles, find_cycles
from damperfit.conditioning.derivatives import differentiate
from damperfit.conditioning.drive import content_beyond, make_drive
from damperfit.conditioning.filters import (
    apply_filter,
    complete_causal,
    completed,
    design_filter,
    fading_samples,
    settling_samples,
)
from damperfit.conditioning.measured_characteristics import with_figures
from damperfit.conditioning.options import ConditionOptions
from damperfit.conditioning.quality import bridge_spikes, examine
from damperfit.conditioning.refusals import (
    MIN_CYCLES,
    oversize,
    refuse_dead,
    refuse_fast,
    refuse_small,
    refuse_stroke,
    refuse_swapped,
)
from damperfit.conditioning.scatter import with_noise
from damperfit.conditioning.skew import take_back
from damperfit.conditioning.stretches import (
    Edges,
    Found,
    find_moving,
    find_runs,
    steady_stretch,
)
from damperfit.conditioning.timebase import UniformLog, make_uniform
from damperfit.conditioning.velocity import check_velocity
from damperfit.errors import ConditioningError
from damperfit.recording import Drive, FilterDesign, Recording, Stretch, Trace

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]

__all__ = ["condition"]

# Speed beyond half the corner, over all of it: noise behind the filter has 0.95, a random walk
# 0.65, a road up to 15 Hz nothing.
_NOISE = 0.5
_SPLINE_EDGE = 14  # samples; 0.268^14 = 1e-8, how an end condition fades in a cubic spline


def condition(recording: Recording, options: ConditionOptions | None = None) -> Trace:
    """Return the steady whole cycles of a log, filtered, with velocity.

    The trace holds one cycle of run-in and the filter's edges beside the window and no more of
    the log, so that nothing is simulated in vain.

    Parameters
    ----------
    recording : Recording
        As read.
    options : ConditionOptions, optional
        Filter, rig facts, centre.

    Raises
    ------
    ConditioningError
        Constant channel, gap in time, sample rate too low for the filter, too few steady cycles,
        implausible stroke or force, stroke beyond the chambers, a sign that must be declared.
    """
    options = options or ConditionOptions()
    if options.spikes == "bridge":
        options = replace(options, spikes="keep")
        # A spike may be beyond what a log may hold; what is left when it is gone may not.
        lenient = replace(options, max_force=math.inf)
        recording = bridge_spikes(recording, condition(recording, lenient))
    refuse_dead(recording)
    delay = options.skew if isinstance(options.skew, float | int) else 0.0
    too_large = oversize(recording, options)
    try:
        traced = _trace(recording, options, delay)
    except ConditioningError as error:
        raise ConditioningError(too_large or str(error)) from None
    refuse_small(traced.trace, options)
    refuse_swapped(traced.trace)
    if too_large:
        raise ConditioningError(too_large)
    level = level_of(traced.trace, options)
    righted, findings = put_right(traced.trace, recording, level)
    if righted is not recording:
        traced = _trace(righted, options, delay)
    skew, skew_findings = find_skew(traced.log, traced.trace, options)
    if skew != 0.0:
        traced = _trace(righted, options, skew)
    if skew != 0.0 or righted is not recording:
        level = level_of(traced.trace, options)
    trace = with_figures(traced.trace)
    refuse_stroke(trace, options)
    told = (
        describe_middle(trace, options),
        *describe_level(level, options),
        *skew_findings,
        *check_velocity(trace, righted),
    )
    seen = examine(righted, traced.logged, trace, traced.cycles, options)
    return replace(trace, findings=(*seen, *findings, *told))


class _Traced(NamedTuple):
    """A trace, and what it was made from: the log with and without a skew taken back."""

    trace: Trace
    log: UniformLog
    logged: UniformLog
    cycles: Cycles | None


def _trace(recording: Recording, options: ConditionOptions, delay: float) -> _Traced:
    """Return the trace of a recording with its signs, the force moved ahead by ``delay``."""
    logged = make_uniform(recording)
    log = take_back(logged, delay) if delay else logged
    try:
        displacement, force, model_filter = _filtered(log, options)
    except ConditioningError as error:
        raise ConditioningError(f"{recording.name}: {error}") from None
    velocity = differentiate(displacement, log.interval)
    cycles = find_cycles(displacement, velocity * log.interval, steadiness=options.steadiness)
    edge = max(settling_samples(model_filter), _SPLINE_EDGE)
    found, n_found = _several(displacement, velocity, log, model_filter, options)
    # The model starts where the motion does, or a little before it.
    edge_ahead = found[0].stretch.first - math.floor(_begin(found[0])) + edge if found else 0
    starts = None
    if len(found) <= 1 and not (found and found[0].stretch.kind == "moving"):
        try:
            starts = _window(recording, log, cycles, edge)
        except ConditioningError:
            # A short run in the middle of a log needs no run-in and no edges of the filter.
            if not found or n_found < MIN_CYCLES:
                raise
    if starts is not None and cycles is not None:
        refuse_fast(recording, log, cycles, options)
        stretch = steady_stretch(starts, velocity, log.interval, cycles.amplitude)
        found, n_found = (Found(stretch, -math.inf, math.inf),), cycles.n_found
        edge_ahead = edge + math.ceil(cycles.period) + 1
    else:
        cycles = None
    drive = make_drive(log, displacement, velocity, found, options)
    stretches = [one.stretch for one in found]
    keep = slice(max(0, stretches[0].first - edge_ahead), stretches[-1].stop + edge + 2)
    sign = -1.0 if recording.reverse_displacement else 1.0  # the log's own count
    middle = cycles.centre if cycles else _middle(displacement, stretches)
    centre = middle if options.centre is None else sign * options.centre
    x, v = displacement[keep] - centre, velocity[keep].copy()
    # One array where both are the same: most logs are steady sines.
    own = Drive(x, v, drive.corner)
    if drive.displacement is not displacement:
        own = Drive(drive.displacement[keep] - centre, drive.velocity[keep].copy(), drive.corner)
    trace = Trace(
        name=recording.name,
        setting=recording.setting,
        start_time=log.start_time + keep.start * log.interval,
        interval=log.interval,
        displacement=x,
        velocity=v,
        force=force[keep].copy(),
        drive=own,
        stretches=tuple(_moved(stretch, -keep.start) for stretch in stretches),
        centre=sign * centre,
        n_cycles_found=n_found,
        model_filter=model_filter,
        temperature=_mean_temperature(recording, log, stretches),
        notes=_notes(options),
    )
    is_ours = options.rig_filter == "none" and options.filter != "none"
    rest = (log.force - force)[keep] if is_ours else np.empty(0)
    return _Traced(with_noise(trace, rest), log, logged, cycles)


def _several(
    displacement: FloatArray,
    velocity: FloatArray,
    log: UniformLog,
    model_filter: FilterDesign,
    options: ConditionOptions,
) -> tuple[tuple[Found, ...], int]:
    """Return the stretches of a log that is not one steady run, and its cycles; none where it is.

    Noise of a sensor at rest is no motion: nearly all of its speed is far up.
    """
    interval = log.interval
    reach = fading_samples(model_filter)
    edges = Edges(beside=math.ceil(0.25 * reach), ends=max(reach, _SPLINE_EDGE))
    found, n_found = find_runs(
        displacement, velocity, interval=interval, steadiness=options.steadiness, edges=edges
    )
    if found:
        return found, n_found
    half = 0.5 * (
        options.filter_corner if options.rig_filter == "none" else options.rig_filter_corner
    )
    if content_beyond(displacement, interval, min(half, 0.1 / interval)) > _NOISE:
        return (), n_found
    return find_moving(displacement, velocity, interval=interval, edges=edges), n_found


def _begin(one: Found) -> float:
    """Return where the motion of the first stretch begins, samples."""
    return max(one.begin, 0.0)


def _middle(displacement: FloatArray, stretches: Sequence[Stretch]) -> float:
    """Return mid-stroke of the widest stretch."""
    widest = max(stretches, key=lambda stretch: stretch.amplitude)
    part = displacement[widest.window]
    return 0.5 * float(part.max() + part.min())


def _moved(stretch: Stretch, by: int) -> Stretch:
    """Return a stretch counted from another sample."""
    return replace(
        stretch,
        first=stretch.first + by,
        stop=stretch.stop + by,
        cycle_starts=stretch.cycle_starts + by,
    )


def _filtered(
    log: UniformLog, options: ConditionOptions
) -> tuple[FloatArray, FloatArray, FilterDesign]:
    """Return displacement, force, and the filter for the model (table in the module's text)."""
    rate = 1.0 / log.interval
    channels = np.stack([log.displacement, log.force])
    if options.rig_filter == "none" and options.filter != "causal":
        design = design_filter(
            options.filter, options.filter_corner, sample_rate=rate, order=options.filter_order
        )
        channels = apply_filter(design, channels)
        return channels[0], channels[1], design
    if options.rig_filter == "none":
        corner, order = options.filter_corner, options.filter_order
    else:
        corner, order = options.rig_filter_corner, options.rig_filter_order
    design = design_filter("causal", corner, sample_rate=rate, order=order)
    if options.rig_filter == "none":
        channels = apply_filter(design, channels)
    if options.rig_filter != "zero_phase":
        channels = complete_causal(design, channels)
    return channels[0], channels[1], completed(design, corner, order)


def _window(recording: Recording, log: UniformLog, cycles: Cycles | None, edge: int) -> FloatArray:
    """Return boundaries of the steady cycles that neither run-in nor filter edges touch."""
    n, h = len(log.force), log.interval
    length = f"the log is {n * h:.3g} s long"
    if cycles is None or cycles.n_found < MIN_CYCLES:
        found = 0 if cycles is None else cycles.n_found
        stroke = 1e3 * float(np.ptp(log.displacement))
        period = "" if cycles is None else f" ({MIN_CYCLES * cycles.period * h:.3g} s)"
        raise ConditioningError(
            f"{recording.name}: found {found} whole steady cycles in the displacement (it spans "
            f"{stroke:.3g} mm; {length}); expected at least {MIN_CYCLES}{period}; log longer"
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
        f"{recording.name}: no whole steady cycle is left after the run-in of one cycle "
        f"({cycles.period * h:.3g} s) and the filter's edges ({edge * h:.3g} s at each end); "
        f"{length} with {cycles.n_found} cycles, expected at least {needed:.3g} s of steady "
        "motion; log longer"
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
    return begin + cycles.period + edge, end - edge


def _mean_temperature(
    recording: Recording, log: UniformLog, stretches: Sequence[Stretch]
) -> float | None:
    if recording.temperature is None:
        return None
    ends = np.array([stretches[0].first, stretches[-1].stop], dtype=np.float64)
    if stretches[0].n_cycles and len(stretches) == 1:
        ends = stretches[0].cycle_starts[[0, -1]]
    span = log.start_time + ends * log.interval
    inside = (recording.time >= span[0]) & (recording.time <= span[1])
    return float(np.mean(recording.temperature[inside]))


def _notes(options: ConditionOptions) -> tuple[str, ...]:
    notes = []
    if options.rig_filter != "none":
        notes.append(
            f"filtered in the rig as declared ({options.rig_filter}, "
            f"{options.rig_filter_corner:g} Hz, order {options.rig_filter_order}); "
            "no filter of our own"
        )
    return tuple(notes)
