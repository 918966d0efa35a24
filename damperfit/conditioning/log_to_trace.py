"""The chain from a recording to a trace, step by step."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

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
from damperfit.conditioning.refusals import (
    oversize,
    refuse_dead,
    refuse_small,
    refuse_stroke,
    refuse_swapped,
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
            "damperfit.io.read_log(path) returns it"
        )
    options = options or ConditionOptions()
    if options.spikes == "bridge":
        options = replace(options, spikes="keep")
        # A spike may be beyond what a log may hold; what is left when it is gone may not.
        lenient = replace(options, max_force=math.inf)
        recording = bridge_spikes(recording, condition(recording, lenient))
    refuse_dead(recording)
    options, corner = with_corner(recording, options)
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
    refuse_stroke(trace, options)
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
    design = replace(seen.model_filter, bridged=inside)
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
    return replace(design, bridged=tuple(bridged))


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
