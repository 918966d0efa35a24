"""The chain from a recording to a trace, step by step, and the logs that are refused on the way."""

import sys
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from damperfit.conditioning.channels import bridge_spikes
from damperfit.conditioning.cycles import MIN_CYCLES, FoundSegment, harmonic_powers
from damperfit.conditioning.delay import find_delay
from damperfit.conditioning.drive import drive_of_lines, make_drive, unclear_turns
from damperfit.conditioning.filters import (
    FilteredLog,
    apply_filter,
    fading_samples,
    with_corner,
    with_samples_between,
)
from damperfit.conditioning.findings import Seen, check_velocity, examine, rows_of, samples_a_cycle
from damperfit.conditioning.measured_characteristics import figures_in
from damperfit.conditioning.noise import with_noise
from damperfit.conditioning.options import ConditionOptions
from damperfit.conditioning.polarity import describe_level, find_signs, level_of, rest_of
from damperfit.conditioning.segments import ComparedPart, choose_compared, transients
from damperfit.conditioning.signals import FloatArray
from damperfit.conditioning.timebase import UniformLog, make_uniform, without_delay
from damperfit.errors import ConditioningError, ConfigurationError
from damperfit.problem import Problem, note
from damperfit.recording import Drive, Recording, Segment, Trace
from damperfit.statistics import mean_of

_MIN_SAMPLES = 20
_ABSURD = 1e9  # N or m; no column of any rig, in whatever unit; its squares might overflow
_ANSWERS = 3e-4  # a damper without friction and of one valve law has 1e-4
_MORE = 4.0


def condition(recording: Recording, options: ConditionOptions | None = None) -> Trace:
    """Return the steady whole cycles of a log, filtered, with velocity.

    The trace holds one cycle of run-in and the filter's edges beside the window and no more of
    the log, so that nothing is simulated in vain; a run-up and a coast-down stay in its `whole`.

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
    if not isinstance(recording, Recording):
        raise ConfigurationError(
            f"condition: found {type(recording).__name__}; expected a recording, as "
            "damperfit.io.read_log(path) returns it",
            code="not-a-recording",
        )
    options = options or ConditionOptions()
    if options.spikes == "bridge":
        options = options.but(spikes="keep")
        # A spike may be beyond what a log may hold; what is left when it is gone may not.
        lenient = condition(recording, options.but(max_force=sys.float_info.max))
        recording = bridge_spikes(recording, samples_a_cycle(lenient))
    _refuse_dead(recording)
    options, corner = with_corner(recording, options)
    delay = options.skew if isinstance(options.skew, float | int) else 0.0
    too_large = _oversize(recording, options)
    try:
        traced = _trace(recording, options, delay)
    except ConditioningError:
        if too_large is None:
            raise
        raise too_large from None
    if (swing := traced.trace.amplitude) < options.min_amplitude:
        raise ConditioningError(
            f"displacement swings ±{1e3 * swing:.4g} mm, expected at "
            f"least ±{1e3 * options.min_amplitude:g} mm; was m read as mm? Declare the unit "
            "(rig.units.displacement) or lower conditioning.min_amplitude",
            subject=recording.name,
            code="too-small",
        )
    _refuse_swapped(traced.trace)
    if too_large is not None:
        raise too_large
    level = level_of(traced.trace, options)
    rest = rest_of(traced.logged, traced.trace, recording, options.gas)
    signs = find_signs(traced.trace, recording, level, rest)
    for channel in signs.reversed_channels:
        changes = {channel: -getattr(recording, channel), f"reverse_{channel}": True}
        recording = replace(recording, **changes)
    if signs.reversed_channels:
        traced = _trace(recording, options, delay)
    skew, skew_findings = find_delay(traced.log, traced.trace, options)
    if skew != 0.0:
        traced = _trace(recording, options, skew)
    if skew != 0.0 or signs.reversed_channels:
        level = level_of(traced.trace, options)
    trace = traced.trace
    figured = tuple(replace(x, figures=figures_in(trace, x)) for x in trace.segments)
    trace = replace(trace, segments=figured)
    _refuse_stroke(trace, options)
    findings = (
        *examine(Seen(recording, traced.logged, trace, traced.part.cycles, options)),
        *traced.part.findings,
        *signs.findings,
        *corner,
        _describe_middle(trace, options),
        *describe_level(level, options),
        *skew_findings,
        *check_velocity(trace, recording),
    )
    return replace(trace, findings=findings, shows_signs=signs.is_certain)


class _Traced(NamedTuple):
    """A trace, and what it was made from: the log with and without a skew corrected."""

    trace: Trace
    log: UniformLog
    logged: UniformLog
    part: ComparedPart


def _trace(recording: Recording, options: ConditionOptions, delay: float) -> _Traced:
    """Return the trace of a recording with its signs, the force moved ahead by ``delay``."""
    logged = with_samples_between(make_uniform(recording), options)
    log = without_delay(logged, delay) if delay else logged
    part = choose_compared(recording.name, log, options)
    keep, displacement = part.keep, part.seen.displacement
    seen, drive = _driven(part.seen, part.parts, keep, options)
    segments = [part_of.segment for part_of in part.parts]
    sign = -1.0 if recording.reverse_displacement else 1.0  # the log's own count
    middle = part.cycles.centre if part.cycles else _middle_of(displacement, segments)
    centre = middle if options.centre is None else sign * options.centre
    x, v = displacement[keep] - centre, seen.velocity[keep].copy()
    # One array where both are the same: most logs are steady sines.
    own = Drive(x, v, drive.corner)
    if drive.displacement is not displacement:
        own = drive.part(keep, centre)
    start, temperature = seen.log.start_time, None
    if recording.temperature is not None:
        rows = rows_of(recording, start, log.interval, *segments)
        temperature = mean_of(recording.temperature[rows])
    declared = (
        f"filtered in the rig as declared ({options.rig_filter}, {options.rig_filter_corner:g} Hz, "
        f"order {options.rig_filter_order}); no filter of our own on the force"
    )
    inside = range(keep.start + 1, keep.stop - 1)
    bridged = tuple(at - keep.start for at in seen.model_filter.bridged if at in inside)
    trace = Trace(
        name=recording.name,
        setting=recording.setting,
        start_time=start + keep.start * log.interval,
        interval=log.interval,
        displacement=x,
        velocity=v,
        force=seen.force[keep].copy(),
        drive=own,
        segments=tuple(_moved(segment, -keep.start) for segment in segments),
        centre=sign * centre,
        n_cycles_found=part.n_found,
        model_filter=seen.model_filter._replace(bridged=bridged),
        temperature=temperature,
        logged_interval=log.logged_interval,
        notes=() if options.rig_filter == "none" else (declared,),
    )
    left_out = (seen.log.force - seen.force)[keep] if options.is_ours else np.empty(0)
    trace = _with_whole(with_noise(trace, left_out), part, options, centre)
    return _Traced(trace, log, logged, part)


def _driven(
    seen: FilteredLog, parts: Sequence[FoundSegment], part: slice, options: ConditionOptions
) -> tuple[FilteredLog, Drive]:
    """What drives the model over a part of the log: lines, where its motion is straight."""
    drive = make_drive(seen, parts, options)
    if options.rig_filter != "none" or options.filter != "zero_phase":
        return seen, drive  # the force of a rig's filter is not filtered again
    if drive.displacement is seen.displacement:
        at = unclear_turns(drive, seen.log, [part.segment for part in parts])
    else:
        lines = drive_of_lines(seen.log.displacement, seen.log.interval, part)
        if lines is None:
            return seen, drive
        drive = lines
        at = [int(jump) for jump in lines.jumps[:, 0].tolist() if jump == round(jump)]
    # A sample at a jump of the speed may have the friction of before it or of after it, and so may
    # one at which a sine turns: it is bridged, of the measured and of the simulated force.
    inside = tuple(sample for sample in at if 0 < sample < len(seen.force) - 1)
    if not inside:
        return seen, drive
    design = seen.model_filter._replace(bridged=inside)
    return seen._replace(force=apply_filter(design, seen.log.force), model_filter=design), drive


def _with_whole(
    trace: Trace, part: ComparedPart, options: ConditionOptions, centre: float
) -> Trace:
    """Keep what was logged beside, where there is more motion in it: one array, two views."""
    seen, keep = part.seen, part.keep
    x, v = seen.displacement - centre, seen.velocity
    whole = replace(
        trace,
        start_time=seen.log.start_time,
        displacement=x,
        velocity=v,
        force=seen.force,
        model_filter=seen.model_filter,
        segments=tuple(_moved(segment, keep.start) for segment in trace.segments),
    )
    beside = transients(whole)
    first, stop, _ = keep.indices(len(x))
    if beside is None or all(first <= x.first and x.stop <= stop for x in beside.segments):
        return trace
    # Each part has the corner that errs least there, so far out as the filter reaches: of what
    # moves beside the segments, with the breaks at its ends.
    reach, last = fading_samples(trace.model_filter), len(x)
    moving = ((max(y.first - reach, 0), min(y.stop + reach, last), y) for y in beside.segments)
    parts = [replace(segment, first=begin, stop=end) for begin, end, segment in moving]
    parts += [part_of.segment for part_of in part.parts]
    parts_of = [FoundSegment(y, y.first - reach, y.stop + reach) for y in parts]
    seen, own = _driven(seen, parts_of, slice(None), options)
    whole = replace(
        whole, force=seen.force, model_filter=seen.model_filter, drive=own.part(slice(None), centre)
    )
    kept_force = trace.force if trace.model_filter.bridged else whole.force[keep]
    return replace(trace, displacement=x[keep], velocity=v[keep], force=kept_force, whole=whole)


def _moved(segment: Segment, by: int) -> Segment:
    """Return a segment counted from another sample."""
    return replace(
        segment,
        first=segment.first + by,
        stop=segment.stop + by,
        cycle_starts=segment.cycle_starts + by,
    )


# Where the middle of the stroke is.

# Of the whole range: how far the middles of a motion's quarters lie apart. Sweeps have next
# to nothing, roads several times as much as this.
_ONE_MIDDLE = 0.02
_NEAR_ZERO = 1.0 / 3.0  # of the amplitude: a sensor that counts from its end is beyond 1


def _middle_and_wandering(x: FloatArray) -> tuple[float, bool]:
    """Return the middle of a motion's range, and whether it is not the same throughout."""
    middle, *quarters = (
        0.5 * float(part.max() + part.min()) for part in (x, *np.array_split(x, 4))
    )
    return middle, max(quarters) - min(quarters) > _ONE_MIDDLE * float(np.ptp(x))


def _middle_of(displacement: FloatArray, segments: Sequence[Segment]) -> float:
    """What is taken as x = 0 unless it was declared, in the log's own count."""
    # The middle of the widest segment. A motion that wanders, such as a road, has none that is the
    # damper's: the log's own 0 is taken, if it lies anywhere near the middle of the range.
    widest = max(segments, key=lambda segment: segment.amplitude)
    middle, wanders = _middle_and_wandering(displacement[widest.window])
    return 0.0 if wanders and abs(middle) <= _NEAR_ZERO * widest.amplitude else middle


def _describe_middle(trace: Trace, options: ConditionOptions) -> Problem:
    """Return where mid-stroke is in the log, or how far a declared centre is from it."""
    off, _ = _middle_and_wandering(trace.displacement[trace.compared])
    centre, severity = 1e3 * trace.centre, "note"
    widest = max(trace.segments, key=lambda segment: segment.amplitude)
    wanders = _middle_and_wandering(trace.displacement[widest.window])[1]
    if options.centre is not None:
        text = f"x = 0 at {centre:.3f} mm of the log, as declared; "
        text += f"mid-stroke at x = {1e3 * off:.3f} mm"
        return note("mid_stroke", text, value=off, unit="m")
    if widest.n_cycles or not wanders:
        text = f"mid-stroke of the log ({round(centre, 3) + 0.0:.3f} mm) is x = 0 of the model"
        if 0.05 < abs(trace.centre) / trace.amplitude < 0.8:
            text += "; if the log's 0 is the middle of the damper, set rig.centre = '0mm'"
    elif trace.centre == 0.0:
        text = (
            "the motion has no middle of its own: the log's 0 is taken as x = 0 of the model (the "
            f"range's middle is {1e3 * off:.1f} mm); each mm off the damper's middle shifts R_m3 "
            "by about 2 %: set rig.centre if it is elsewhere"
        )
    else:
        severity = "warning"
        text = (
            "the motion has no middle of its own, and the log's 0 is far off: the middle of the "
            f"range ({centre:.1f} mm) is taken as x = 0 of the model; each mm off the damper's "
            "middle shifts R_m3 by about 2 %: set rig.centre"
        )
    return Problem("mid_stroke", text, severity, values={"value": trace.centre, "unit": "m"})


# Logs that cannot be used at all, each refused with the reason and the way out.


def _refuse_dead(recording: Recording) -> None:
    """Refuse a log without a test in it: too short, or with a constant channel."""
    n = len(recording.time)
    if n < _MIN_SAMPLES:
        raise ConditioningError(
            f"{n} sample{'s' * (n != 1)}; expected at least {MIN_CYCLES} whole "
            "cycles of a steady test; record a longer log",
            subject=recording.name,
            code="too-short",
        )
    for channel, unit in (("displacement", "m"), ("force", "N")):
        values = getattr(recording, channel)
        middle = float(values[0])
        # A constant that passed a change of units differs by rounding only.
        if float(np.ptp(values)) <= 1e-12 * abs(middle):
            raise ConditioningError(
                f"the {channel} is constant ({middle:g}) in all {n} rows; "
                "expected a steady periodic test; check sensor and column",
                subject=recording.name,
                code="constant",
            )
        if (largest := float(np.abs(values).max())) > _ABSURD:
            raise ConditioningError(
                f"the {channel} reaches {largest:.3g} {unit}, which no rig "
                "reaches; declare its unit, or check sensor and column",
                subject=recording.name,
                code="implausible",
            )


def _oversize(recording: Recording, options: ConditionOptions) -> ConditioningError | None:
    """Return the refusal of a log of an impossible size; None where it is not."""
    half = 0.5 * float(np.ptp(recording.displacement))
    peak = float(np.abs(recording.force).max())
    if half > options.max_amplitude:
        chambers = ""
        if options.chamber_lengths is not None:
            chambers = " (chambers l_1 {:g} m, l_2 {:g} m)".format(*options.chamber_lengths)
        text = (
            f"displacement swings ±{half:.4g} m, expected at most "
            f"±{options.max_amplitude:g} m{chambers}; was mm read as m? "
            "Declare the unit or raise conditioning.max_amplitude"
        )
    elif peak > options.max_force:
        text = (
            f"force reaches {peak:.4g} N, expected at most "
            f"{options.max_force:g} N; was N read as kN? Declare the unit or raise "
            "conditioning.max_force"
        )
    else:
        return None
    return ConditioningError(f"{recording.name}: {text}", code="implausible")


def _refuse_swapped(trace: Trace) -> None:
    """Refuse a log whose force is driven and whose displacement answers: the wrong columns.

    A machine drives the displacement, near enough a sine; the force answers with harmonics.
    Measured: 1e-9 to 0.004 of the displacement's power, 0.15 of the force's share at most.
    """
    if not trace.fastest.n_cycles:
        return  # a random motion has no harmonics
    # The share of each channel's power that is in harmonics 2 to 7 of the motion.
    powers = [
        harmonic_powers(trace.fastest, values, 7) for values in (trace.displacement, trace.force)
    ]
    driven, answers = (
        float(np.sum(power[1:])) / max(float(np.sum(power)), 1e-300) for power in powers
    )
    if driven > _ANSWERS and driven > _MORE * answers:
        raise ConditioningError(
            f"force and displacement look swapped: what is read as displacement has "
            f"{100.0 * driven:.2g} % of its power in harmonics, what is read as force "
            f"{100.0 * answers:.1g} %, but it is the displacement that a machine drives; "
            "declare rig.columns = {displacement = ..., force = ...} and rig.units, for files "
            "that differ in a profile each",
            subject=trace.name,
            code="swapped",
        )


def _refuse_stroke(trace: Trace, options: ConditionOptions) -> None:
    """Refuse a displacement that leaves chamber 1 (x >= l_1) or chamber 2 (x <= -l_2) no volume."""
    if options.chamber_lengths is None:
        return
    l_1, l_2 = options.chamber_lengths
    highest, lowest = float(trace.displacement.max()), float(trace.displacement.min())
    if highest < l_1 and lowest > -l_2:
        return
    x, at = (highest, "below l_1") if highest >= l_1 else (lowest, "above -l_2")
    hint = "mm read as m or inches?"
    if abs(x) < 10.0 * max(l_1, l_2):
        hint = "declare the right unit (rig.units.displacement) or centre (rig.centre)"
    raise ConditioningError(
        f"stroke beyond the chamber: x reaches {x:.4g} m, expected {at} "
        f"(l_1 = {l_1:g} m, l_2 = {l_2:g} m; x = 0 at {trace.centre:.4g} m of the log); {hint}",
        subject=trace.name,
        code="beyond-travel",
    )
