"""Table to recordings: channels in SI with the project's signs, checked, cut into tests."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from itertools import chain, pairwise
from typing import TYPE_CHECKING

import numpy as np

from damperfit.errors import LogError
from damperfit.io.channels import choose_channels, has_channel, joined_problems
from damperfit.io.labels import (
    LogLabel,
    file_setting,
    place_from_number,
    preamble_setting,
    setting_in_words,
)
from damperfit.io.options import EXTRAS
from damperfit.recording import Recording
from damperfit.statistics import median
from damperfit.tested.identity import identity_in
from damperfit.tested.setting import Setting

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from damperfit.io.channels import ChannelChoice
    from damperfit.io.files import Source
    from damperfit.io.formats import Samples, Table
    from damperfit.io.options import ReadOptions

    FloatArray = NDArray[np.float64]
    IntArray = NDArray[np.intp]

__all__ = [
    "TITLE",
    "join_buffers",
    "make_recordings",
]


# Blocks of one file that are one record: write buffers, whose time runs on from each to the next.
#
# A servo-hydraulic controller heads each buffer that it writes like a test of its own. What tells a
# record from tests is the step in time from the last row of a block to the first of the next.

TITLE = "part: "  # begins the note that says which block a part was
# Steps from block to block, in usual sample intervals; stamps are rounded to few digits.
_LEAST_STEP, _LARGEST_STEP = 0.5, 1.5
_LISTED = 3  # breaks in the record that are listed one by one


def join_buffers(blocks: Sequence[Sequence[Recording]]) -> list[Recording]:
    """Return the tests in blocks, those joined whose time runs on.

    Parameters
    ----------
    blocks : sequence of sequence of Recording
        The tests of each block, in the order of the file; nearly always one.
    """
    runs: list[list[Recording]] = []
    first_blocks: list[int] = []
    for number, block in enumerate(blocks, start=1):
        for i, part in enumerate(block):
            if i == 0 and runs and _runs_on(runs[-1][-1], part):
                runs[-1].append(part)
            else:
                runs.append([part])
                first_blocks.append(number)
    n_joined = sum(len(run) for run in runs if len(run) > 1)
    if not n_joined:
        return [run[0] for run in runs]
    said = f"{n_joined} blocks joined, as time runs on by one step from each to the next"
    if len(runs) > 1:
        said += f", into {sum(len(run) > 1 for run in runs)} of {len(runs)} tests"
    note = f"{said}{_breaks(runs, first_blocks)}"
    return [_joined(run, note) for run in runs]


def _runs_on(before: Recording, after: Recording) -> bool:
    """Say whether a part begins one step after the end of another, at the same rate."""
    if before.setting != after.setting:
        return False
    steps = [median(np.diff(one.time)) for one in (before, after) if len(one.time) > 1]
    if not steps or max(steps) > _LARGEST_STEP * min(steps):
        return False
    between = float(after.time[0] - before.time[-1])
    return all(_LEAST_STEP < between / step < _LARGEST_STEP for step in steps)


def _breaks(runs: Sequence[Sequence[Recording]], first_blocks: Sequence[int]) -> str:
    """Tell where time does not run on: what is missing there, or where it goes back to."""
    breaks = []
    for (before, after), block in zip(pairwise(runs), first_blocks[1:], strict=True):
        end, start = before[-1].time[-1], after[0].time[0]
        how = f"{start - end:.4g} s later" if start > end else f"{end - start:.4g} s earlier"
        breaks.append(f"block {block} begins at {start:.6g} s, {how} than the block before ends")
    if not breaks:
        return ""
    more = f"; and {len(breaks) - _LISTED} more" if len(breaks) > _LISTED else ""
    return f"; {'; '.join(breaks[:_LISTED])}{more}"


def _joined(run: Sequence[Recording], note: str) -> Recording:
    first = run[0]
    if len(run) == 1:
        return replace(first, notes=(*first.notes, note))
    notes = [text for part in run for text in part.notes if not text.startswith(TITLE)]
    title = [text for text in first.notes if text.startswith(TITLE)]

    def extra(name: str) -> np.ndarray | None:
        values = [getattr(part, name) for part in run]
        return None if any(one is None for one in values) else np.concatenate(values)

    return replace(
        first,
        time=np.concatenate([part.time for part in run]),
        displacement=np.concatenate([part.displacement for part in run]),
        force=np.concatenate([part.force for part in run]),
        temperature=extra("temperature"),
        velocity=extra("velocity"),
        notes=tuple(dict.fromkeys([*title, *notes, note])),
        findings=tuple(dict.fromkeys(one for part in run for one in part.findings)),
    )


# A pause begins another test when it is longer than both: shorter ones are samples lost.
_PAUSE = 2.0  # s
_PAUSE_STEPS = 50.0  # usual sample intervals
_MAX_PARTS = 1_000  # more than this is a clock that jumps, not tests


def make_recordings(
    tables: Sequence[Table], source: Source, options: ReadOptions, notes: tuple[str, ...]
) -> tuple[Recording, ...]:
    """Return the tests in a file's tables, in SI.

    Raises
    ------
    LogError
        A channel or unit is missing, a value is no finite number, time does not increase, or
        a setting is none.
    """
    blocks = []
    for table in tables:
        try:
            blocks.append(_table_parts(table, source, options))
        except LogError as error:
            error.says_setting = _says_setting(table, source, options)
            raise
    are_buffers = len(tables) > 1 and all(table.may_run_on for table in tables)
    parts = join_buffers(blocks) if are_buffers else list(chain.from_iterable(blocks))
    where = f"{source.name}: part_settings"
    settings = [
        setting_in_words(str(one), where, options.adjusters) for one in options.part_settings
    ]
    if settings and len(settings) != len(parts):
        raise LogError(
            f"{len(parts)} tests found, but {len(settings)} settings declared for "
            "them (part_settings)",
            subject=source.name,
        )
    if len(parts) > 1:
        notes = (*notes, f"{len(parts)} tests in this file")
    declared = ("setting: as declared",) if settings else ()
    return tuple(
        Recording(
            name=f"{source.name} part {i + 1}" if len(parts) > 1 else source.name,
            path=source.path,
            sha256=source.sha256,
            setting=settings[i] if settings and options.setting is None else part.setting,
            time=part.time,
            displacement=part.displacement,
            force=part.force,
            temperature=part.temperature,
            notes=(*notes, *part.notes, *declared),
            metadata=part.metadata,
            findings=part.findings,
            velocity=part.velocity,
            reverse_displacement=part.reverse_displacement,
            reverse_force=part.reverse_force,
        )
        for i, part in enumerate(parts)
    )


def _table_parts(table: Table, source: Source, options: ReadOptions) -> list[Recording]:
    """Return the tests in one table; their names are still the file's."""
    name = source.name
    rate, rate_notes = _sample_rate(table, options)
    choices, notes = choose_channels(
        table.columns, options, where=name, needs_time=rate == 0.0, hint=table.hint
    )
    samples = table.load({channel: choice.index for channel, choice in choices.items()})
    n = len(samples.channels["force"])
    if not n:
        raise LogError("no data rows", subject=name)
    channels = _si_channels(samples, choices, options, name)
    temperature, temperature_notes = _extra(channels, "temperature")
    velocity, velocity_notes = _extra(channels, "velocity")
    cuts = _cuts(samples, channels, options, name)
    sign_notes = []
    signs: dict[str, bool | None] = {}
    for channel in ("displacement", "force"):
        is_reversed = getattr(options, f"reverse_{channel}")
        signs[channel] = is_reversed if isinstance(is_reversed, bool) else None
        if is_reversed is True:
            channels[channel] = -channels[channel]
            sign_notes.append(f"{channel}: sign reversed, as declared")
    titles = (f"{TITLE}{table.part}",) if table.part else ()
    findings = (*table.findings, *samples.findings)
    said = (*table.notes, *samples.notes, *(finding.sentence for finding in findings))
    notes = (*titles, *said, *notes, *_scale_notes(choices, options))
    notes = (*notes, *sign_notes, *temperature_notes, *velocity_notes)
    parts = []
    for start, stop in cuts:
        part = slice(start, stop)
        label = _setting(samples, part, table.metadata, source, options)
        setting = label.setting(options.adjusters)
        partly = {} if setting else {name: str(place) for name, place in label.places.items()}
        preamble = identity_in(table.metadata).describe() if label.others else {}
        named = {key: text for key, text in label.others.items() if key not in preamble}
        is_own_time = "time" in channels and options.sample_rate == 0.0
        time_notes = () if is_own_time else rate_notes
        time = channels["time"][part] if is_own_time else np.arange(stop - start) / rate
        parts.append(
            Recording(
                name=name,
                path=source.path,
                sha256=source.sha256,
                setting=setting,
                time=time,
                displacement=channels["displacement"][part],
                force=channels["force"][part],
                temperature=None if temperature is None else temperature[part],
                notes=(*notes, *time_notes, *label.notes),
                metadata={**named, **table.metadata, **partly},
                findings=findings,
                velocity=None if velocity is None else velocity[part],
                reverse_displacement=signs["displacement"],
                reverse_force=signs["force"],
            )
        )
    return parts


def _sample_rate(table: Table, options: ReadOptions) -> tuple[float, tuple[str, ...]]:
    """Return the declared rate, or the preamble's, or 0; Hz."""
    if options.sample_rate > 0.0:
        return options.sample_rate, (f"time: {options.sample_rate:g} Hz, as declared",)
    for key in ("sampling rate", "sample rate", "sampling frequency", "sample frequency"):
        if key in table.metadata:
            text = table.metadata[key].removesuffix("Hz").strip()
            try:
                rate = float(text)
            except ValueError:
                continue
            if 0.0 < rate < 1e9:
                return rate, (f"time: {rate:g} Hz, from the preamble",)
    return 0.0, ()


def _si_channels(
    samples: Samples, choices: Mapping[str, ChannelChoice], options: ReadOptions, name: str
) -> dict[str, FloatArray]:
    channels = {}
    problems = []
    for channel, choice in choices.items():
        logged = values = samples.channels[channel]
        if choice.unit is None:
            continue
        problem = "" if channel in EXTRAS else _not_finite(logged, channel, samples)
        with np.errstate(over="ignore", invalid="ignore"):
            if channel in options.scales or channel in options.offsets:
                values = values * options.scales.get(channel, 1.0)
                values += options.offsets.get(channel, 0.0)
            si = choice.unit.to_si(values)
        channels[channel] = np.ascontiguousarray(si, dtype=np.float64)
        if channel not in EXTRAS and channels[channel] is not logged:  # a factor may overflow
            problem = problem or _not_finite(channels[channel], channel, samples)
        problems += [problem] if problem else []
    if len(problems) == 1:
        raise LogError(f"{name}, {problems[0]}")
    if problems:
        raise joined_problems([LogError(one) for one in problems], name)
    return channels


def _scale_notes(choices: Mapping[str, ChannelChoice], options: ReadOptions) -> tuple[str, ...]:
    scaled = sorted({*options.scales, *options.offsets} & choices.keys())
    return tuple(
        f"{channel}: {options.scales.get(channel, 1.0):g} times the log plus "
        f"{options.offsets.get(channel, 0.0):g}, as declared"
        for channel in scaled
    )


def _not_finite(values: FloatArray, channel: str, samples: Samples) -> str:
    """Return where a channel is no number; empty where all are."""
    with np.errstate(over="ignore", invalid="ignore"):
        if np.isfinite(values.sum()):  # one pass where all is well; a sum keeps NaN and infinity
            return ""
    bad = np.flatnonzero(~np.isfinite(values))
    if not len(bad):
        return ""
    return (
        f"{samples.place(int(bad[0]))}: {channel} is blank, NaN or infinite, in "
        f"{len(bad)} of {len(values)} rows in all; repair the log or remove these rows"
    )


def _cuts(
    samples: Samples, channels: Mapping[str, FloatArray], options: ReadOptions, name: str
) -> list[tuple[int, int]]:
    """Return first and stop of each test: cut at pauses, restarts and changes of setting."""
    n = len(channels["force"])
    is_cut = np.zeros(n + 1, dtype=bool)
    is_cut[[0, n]] = True
    turned = [one for one in options.adjusters if one in samples.channels]
    for one in turned:
        values = samples.channels[one]
        if problem := _not_finite(values, one, samples):
            raise LogError(f"{name}, {problem}")
        is_cut[1:n] |= values[1:] != values[:-1]
    first = 0
    if "time" in channels and n > 1:
        steps = np.diff(channels["time"])
        is_plain = steps.min() > 0.0 and steps.max() <= (options.pause or _PAUSE)
        if is_plain and not turned:
            return [(0, n)]
        late = np.flatnonzero((steps <= 0.0) & ~is_cut[1:n])
        if len(late) and options.restarts == "refuse" and options.sample_rate == 0.0:
            raise LogError(_backwards(channels, late + 1, samples, name))
        if options.sample_rate == 0.0 or options.restarts != "refuse":
            is_cut[late + 1] = True
        if len(late) and options.restarts == "last":
            first = int(late[-1]) + 1
        is_cut[1:n] |= steps > _pause(steps, options)
    edges = [int(i) for i in np.flatnonzero(is_cut) if i >= first]
    if len(edges) - 1 > _MAX_PARTS:
        raise LogError(
            f"time jumps {len(edges) - 2} times; these are not tests but a faulty clock: "
            "declare rig.sample_rate",
            subject=name,
        )
    return list(pairwise(edges))


def _pause(steps: FloatArray, options: ReadOptions) -> float:
    if options.pause > 0.0:
        return options.pause
    forward = steps[steps > 0.0]
    return max(_PAUSE, _PAUSE_STEPS * median(forward) if len(forward) else 0.0)


def _backwards(
    channels: Mapping[str, FloatArray], late: IntArray, samples: Samples, name: str
) -> str:
    """Return where time does not increase, in rows `late`, and what to do about it."""
    time, i = channels["time"], int(late[0])
    what = "repeats" if time[i] == time[i - 1] else "runs backwards"
    advice = "several tests in one file: declare rig.restarts"
    if all(np.array_equal(one[late], one[late - 1]) for one in channels.values()):
        advice = "these rows are there twice: remove the copies"
    elif 2 * int(np.count_nonzero(np.diff(time) == 0.0)) > len(time):
        advice = "the clock is coarser than the samples: declare rig.sample_rate"
    elif len(time) > 2 and bool(np.all(np.diff(time) < 0.0)):
        advice = "all rows are in reverse: sort them by time"
    return (
        f"{name}, {samples.place(i)}: time {what}: {time[i]:.9g} s after {time[i - 1]:.9g} s; "
        f"time must increase ({len(late)} such row{'s' * (len(late) > 1)}); {advice}"
    )


def _extra(
    channels: Mapping[str, FloatArray], name: str
) -> tuple[FloatArray | None, tuple[str, ...]]:
    if name not in channels:
        return None, ()
    values = channels[name]
    n_bad = int(np.count_nonzero(~np.isfinite(values)))
    if n_bad:
        return None, (f"{name}: left out; {n_bad} of {len(values)} values are missing",)
    return values, ()


def _setting(
    samples: Samples,
    part: slice,
    metadata: Mapping[str, str],
    source: Source,
    options: ReadOptions,
) -> LogLabel:
    """Return the setting from the declaration, the preamble, columns or the file name."""
    named = file_setting(source.name, options.setting_pattern, options.adjusters)
    if options.setting is not None:
        places = dict(Setting.of(options.setting).places)
        return LogLabel(places, named.others, ("setting: as declared",))
    columns = LogLabel(
        {
            one: place_from_number(
                samples.channels[one][part.start], f"{source.name}: column '{one}'"
            )
            for one in options.adjusters
            if one in samples.channels
        }
    )
    preamble = preamble_setting(metadata, source.name, options.adjusters)
    found = preamble.over(columns).over(named)
    return replace(found, notes=(*found.notes, *_other_name(preamble, named)))


def _says_setting(table: Table, source: Source, options: ReadOptions) -> bool:
    """Say whether a log that cannot be read says its setting, or tries to."""
    if options.setting is not None or options.part_settings:
        return True
    if "setting" in table.metadata or any(one in table.metadata for one in options.adjusters):
        return True
    if has_channel("setting", table.columns, options):
        return True
    with suppress(LogError):
        return bool(file_setting(source.name, options.setting_pattern, options.adjusters).places)
    return True


def _other_name(preamble: LogLabel, named: LogLabel) -> tuple[str, ...]:
    """Say that the file's name names another setting than its preamble."""
    return tuple(
        f"{one}: {preamble.places[one]} of the preamble; the file name says {place}: check which "
        "is right"
        for one, place in named.places.items()
        if one in preamble.places and preamble.places[one] != place
    )
