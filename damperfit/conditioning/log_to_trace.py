"""The chain from a recording to a trace, step by step, and the logs that are refused on the way."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from damperfit.conditioning.cycles import MIN_CYCLES, clean_cycles, harmonic_powers
from damperfit.conditioning.delay import without_delay
from damperfit.conditioning.drive import drive_of_lines, make_drive, unclear_turns
from damperfit.conditioning.filters import FilteredLog, apply_filter, fading_samples, with_corner
from damperfit.conditioning.findings import bridge_spikes, check_velocity, examine
from damperfit.conditioning.measured_characteristics import with_figures
from damperfit.conditioning.options import ConditionOptions
from damperfit.conditioning.polarity import (
    describe_level,
    describe_middle,
    find_delay,
    level_of,
    middle_of,
    put_right,
    rest_of,
)
from damperfit.conditioning.repeatability import with_noise
from damperfit.conditioning.segments import ComparedPart, FoundStretch, choose_compared, transients
from damperfit.conditioning.timebase import UniformLog, make_uniform
from damperfit.errors import ConditioningError, ConfigurationError
from damperfit.recording import Drive, FilterDesign, Recording, Stretch, Trace
from damperfit.statistics import mean_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]

__all__ = ["condition"]

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
        options = replace(options, spikes="keep")
        # A spike may be beyond what a log may hold; what is left when it is gone may not.
        lenient = replace(options, max_force=math.inf)
        recording = bridge_spikes(recording, condition(recording, lenient))
    _refuse_dead(recording)
    options, corner = with_corner(recording, options)
    delay = options.skew if isinstance(options.skew, float | int) else 0.0
    too_large = _oversize(recording, options)
    try:
        traced = _trace(recording, options, delay)
    except ConditioningError:
        if too_large:
            raise ConditioningError(too_large, code="implausible") from None
        raise
    _refuse_small(traced.trace, options)
    _refuse_swapped(traced.trace)
    if too_large:
        raise ConditioningError(too_large, code="implausible")
    level = level_of(traced.trace, options)
    rest = rest_of(traced.logged, traced.trace, recording, options.gas)
    righted, signs = put_right(traced.trace, recording, level, rest)
    if righted is not recording:
        traced = _trace(righted, options, delay)
    skew, skew_findings = find_delay(traced.log, traced.trace, options)
    if skew != 0.0:
        traced = _trace(righted, options, skew)
    if skew != 0.0 or righted is not recording:
        level = level_of(traced.trace, options)
    trace = with_figures(traced.trace)
    _refuse_stroke(trace, options)
    levels = (
        *corner,
        describe_middle(trace, options),
        *describe_level(level, options),
        *skew_findings,
        *check_velocity(trace, righted),
    )
    seen = examine(righted, traced.logged, trace, traced.part.cycles, options)
    found = (*seen, *traced.part.findings, *signs.findings, *levels)
    return replace(trace, findings=found, shows_signs=signs.is_certain)


class _Traced(NamedTuple):
    """A trace, and what it was made from: the log with and without a skew corrected."""

    trace: Trace
    log: UniformLog
    logged: UniformLog
    part: ComparedPart


def _trace(recording: Recording, options: ConditionOptions, delay: float) -> _Traced:
    """Return the trace of a recording with its signs, the force moved ahead by ``delay``."""
    logged = make_uniform(recording)
    log = without_delay(logged, delay) if delay else logged
    part = choose_compared(recording.name, log, options)
    seen, keep = part.seen, part.keep
    displacement = seen.displacement
    seen, drive = _driven(seen, part.found, keep, options)
    stretches = [one.stretch for one in part.found]
    sign = -1.0 if recording.reverse_displacement else 1.0  # the log's own count
    middle = part.cycles.centre if part.cycles else middle_of(displacement, stretches)
    centre = middle if options.centre is None else sign * options.centre
    x, v = displacement[keep] - centre, seen.velocity[keep].copy()
    # One array where both are the same: most logs are steady sines.
    own = Drive(x, v, drive.corner)
    if drive.displacement is not displacement:
        own = drive.part(keep, centre)
    trace = Trace(
        name=recording.name,
        setting=recording.setting,
        start_time=seen.log.start_time + keep.start * log.interval,
        interval=log.interval,
        displacement=x,
        velocity=v,
        force=seen.force[keep].copy(),
        drive=own,
        stretches=tuple(_moved(stretch, -keep.start) for stretch in stretches),
        centre=sign * centre,
        n_cycles_found=part.n_found,
        model_filter=_moved_filter(seen.model_filter, keep),
        temperature=_mean_temperature(recording, seen.log, stretches),
        notes=_notes(options),
        is_filtered_by_rig=options.rig_filter == "zero_phase",
    )
    is_ours = options.rig_filter == "none" and options.filter != "none"
    rest = (seen.log.force - seen.force)[keep] if is_ours else np.empty(0)
    trace = _with_whole(with_noise(trace, rest), part, options, centre)
    return _Traced(trace, log, logged, part)


def _driven(
    seen: FilteredLog, found: Sequence[FoundStretch], part: slice, options: ConditionOptions
) -> tuple[FilteredLog, Drive]:
    """Return what drives the model over a part of the log: lines, where its motion is straight.

    A sample at a jump of the speed may have the friction of before it or of after it, and so may
    one at which a sine turns: it is bridged, of the measured and of the simulated force.
    """
    drive = make_drive(seen.log, seen.displacement, seen.velocity, found, options)
    if options.filter != "zero_phase":
        return seen, drive
    if drive.displacement is seen.displacement:
        stretches = [one.stretch for one in found]
        return _bridged(seen, unclear_turns(drive, seen.log, stretches)), drive
    lines = drive_of_lines(seen.log.displacement, seen.log.interval, part)
    if lines is None:
        return seen, drive
    at = lines.jumps[:, 0]
    return _bridged(seen, at[at == np.rint(at)].astype(np.int64).tolist()), lines


def _bridged(seen: FilteredLog, at: Sequence[int]) -> FilteredLog:
    """Return a log whose force has the mean of its neighbours at some samples."""
    inside = tuple(one for one in at if 0 < one < len(seen.force) - 1)
    if not inside:
        return seen
    design = seen.model_filter._replace(bridged=inside)
    return seen._replace(force=apply_filter(design, seen.log.force), model_filter=design)


def _with_whole(
    trace: Trace, part: ComparedPart, options: ConditionOptions, centre: float
) -> Trace:
    """Keep what was logged beside, where there is more motion in it: one array, two views.

    A jump of the velocity in a run-up must not be smeared: it drives the model as any motion does.
    """
    seen, keep = part.seen, part.keep
    x, v = seen.displacement - centre, seen.velocity
    whole = replace(
        trace,
        start_time=seen.log.start_time,
        displacement=x,
        velocity=v,
        force=seen.force,
        model_filter=seen.model_filter,
        stretches=tuple(_moved(stretch, keep.start) for stretch in trace.stretches),
    )
    beside = transients(whole)
    kept = range(*keep.indices(len(x)))
    if beside is None or all(
        one.first in kept and one.stop - 1 in kept for one in beside.stretches
    ):
        return trace
    # Each part has the corner that errs least there, so far out as the filter reaches.
    reach = fading_samples(trace.model_filter)
    parts = (*(one.stretch for one in part.found), *beside.stretches)
    found = [FoundStretch(one, one.first - reach - 1.0, one.stop + reach + 1.0) for one in parts]
    seen, own = _driven(seen, found, slice(None), options)
    whole = replace(
        whole, force=seen.force, model_filter=seen.model_filter, drive=own.part(slice(None), centre)
    )
    kept_force = trace.force if trace.model_filter.bridged else whole.force[keep]
    return replace(trace, displacement=x[keep], velocity=v[keep], force=kept_force, whole=whole)


def _moved_filter(design: FilterDesign, keep: slice) -> FilterDesign:
    """Return a filter for a part of the log's samples."""
    bridged = (at - keep.start for at in design.bridged if keep.start < at < keep.stop - 1)
    return design._replace(bridged=tuple(bridged))


def _moved(stretch: Stretch, by: int) -> Stretch:
    """Return a stretch counted from another sample."""
    return replace(
        stretch,
        first=stretch.first + by,
        stop=stretch.stop + by,
        cycle_starts=stretch.cycle_starts + by,
    )


def _mean_temperature(
    recording: Recording, log: UniformLog, stretches: Sequence[Stretch]
) -> float | None:
    if recording.temperature is None:
        return None
    ends = np.array([stretches[0].first, stretches[-1].stop], dtype=np.float64)
    if stretches[0].n_cycles and len(stretches) == 1:
        ends = stretches[0].cycle_starts[[0, -1]]
    span = log.start_time + ends * log.interval
    first, _ = np.searchsorted(recording.time, span, "left")
    _, stop = np.searchsorted(recording.time, span, "right")
    return mean_of(recording.temperature[first:stop])


def _notes(options: ConditionOptions) -> tuple[str, ...]:
    notes = []
    if options.rig_filter != "none":
        notes.append(
            f"filtered in the rig as declared ({options.rig_filter}, "
            f"{options.rig_filter_corner:g} Hz, order {options.rig_filter_order}); "
            "no filter of our own"
        )
    return tuple(notes)


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


def _oversize(recording: Recording, options: ConditionOptions) -> str:
    """Return why a log is of an impossible size; empty where it is not."""
    if (half := 0.5 * float(np.ptp(recording.displacement))) > options.max_amplitude:
        return (
            f"{recording.name}: displacement swings +-{half:.4g} m, expected at most "
            f"+-{options.max_amplitude:g} m{_chambers(options)}; was mm read as m? "
            "Declare the unit or raise conditioning.max_amplitude"
        )
    peak = float(np.abs(recording.force).max())
    if peak > options.max_force:
        return (
            f"{recording.name}: force reaches {peak:.4g} N, expected at most "
            f"{options.max_force:g} N; was N read as kN? Declare the unit or raise "
            "conditioning.max_force"
        )
    return ""


def _refuse_small(trace: Trace, options: ConditionOptions) -> None:
    """Refuse a motion that no rig makes: its unit was misread."""
    if trace.amplitude < options.min_amplitude:
        raise ConditioningError(
            f"displacement swings +-{1e3 * trace.amplitude:.4g} mm, expected at "
            f"least +-{1e3 * options.min_amplitude:g} mm; was m read as mm? Declare the unit "
            "(rig.units.displacement) or lower conditioning.min_amplitude",
            subject=trace.name,
            code="too-small",
        )


def _refuse_swapped(trace: Trace) -> None:
    """Refuse a log whose force is driven and whose displacement answers: the wrong columns.

    A machine drives the displacement, near enough a sine. The force answers with harmonics: those
    of the displacement grow in the velocity, and valves and friction add theirs. Measured: 1e-9 to
    0.004 of the displacement's power is in harmonics, 0.15 of the force's share at most.
    """
    if not trace.fastest.n_cycles:
        return  # a random motion has no harmonics
    driven = _harmonic_share(trace, trace.displacement)
    if driven > _ANSWERS and driven > _MORE * (answers := _harmonic_share(trace, trace.force)):
        raise ConditioningError(
            f"force and displacement look swapped: what is read as displacement has "
            f"{100.0 * driven:.2g} % of its power in harmonics, what is read as force "
            f"{100.0 * answers:.1g} %, but it is the displacement that a machine drives; "
            "declare rig.columns = {displacement = ..., force = ...} and rig.units, for files "
            "that differ in a profile each",
            subject=trace.name,
            code="swapped",
        )


def _harmonic_share(trace: Trace, values: FloatArray) -> float:
    """Return the share of a channel's power that is in harmonics 2 to 7 of the motion."""
    stretch = trace.fastest
    first, *_, stop = np.rint(clean_cycles(stretch)).astype(np.int64)
    power = harmonic_powers(values[first:stop], stretch.frequency * trace.interval, 7)
    return float(np.sum(power[1:])) / max(float(np.sum(power)), 1e-300)


def _chambers(options: ConditionOptions) -> str:
    if options.chamber_lengths is None:
        return ""
    l_1, l_2 = options.chamber_lengths
    return f" (chambers l_1 {l_1:g} m, l_2 {l_2:g} m)"


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
