"""Table to recordings: channels in SI with the project's signs, checked, cut into tests.

A servo-hydraulic controller heads each buffer that it writes like a test of its own. Buffers of one
record are known by the step in time from the last row of a block to the first of the next.
"""

import math
import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import chain, pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from damperfit.errors import LogError
from damperfit.io.clocks import buffer_ends, on_one_clock, rate_of_stamps, steps_of_level
from damperfit.io.columns import (
    OWN_TIME,
    ChannelChoice,
    choose_channels,
    has_channel,
    joined_problems,
    visible,
)
from damperfit.io.files import Source
from damperfit.io.formats import FloatArray, Samples, Table
from damperfit.io.labels import (
    LogLabel,
    file_setting,
    preamble_setting,
    setting_in_words,
)
from damperfit.io.options import EXTRAS, ReadOptions
from damperfit.problem import Problem, distinct, note, warning
from damperfit.recording import Recording
from damperfit.statistics import median
from damperfit.tested.identity import identity_in
from damperfit.tested.setting import Setting

_TITLE = "part: "  # begins the note that says which block a part was
# Steps from block to block, in usual sample intervals; stamps are rounded to few digits.
_LEAST_STEP, _LARGEST_STEP = 0.5, 1.5
_LISTED = 3  # breaks in the record that are listed one by one
# A pause begins another test when it is longer than both: shorter ones are samples lost.
_PAUSE = 2.0  # s
_PAUSE_STEPS = 50.0  # usual sample intervals
_MAX_PARTS = 1_000  # more than this is a clock that jumps, not tests
_LARGEST = 1e6  # degrees, m/s: no temperature or velocity
_CLOSEST = 1e-9  # s from sample to sample
_CURRENT = "valve by column "
_SINCE_1970 = 3e8  # s; so much no rig runs: the time is a date
_CYCLES = 3  # in a piece between two pauses, the least that are evaluated
_CURRENTS = re.compile(  # or voltages
    r"(?i)current|strom|courant|corrente|corriente|voltage|spannung|valve|ventil|solenoid|magnet"
)
_BY_UNIT = re.compile(r"[_(\[]m?[AV][)\]]?$")  # at the end of a column's name
_MACHINE = re.compile(r"(?i)trig|enable|sync|set.?point|command|demand|soll|motor|drive|supply")
_OTHER_MOTION = 1.1  # times the mean speed
_MOST_VALVES = 8  # columns that are looked at
_RAW = 0.5  # correlation with the force, from which on a voltage is that of a load cell
_RATE_KEYS = ("sampling rate", "sample rate", "sampling frequency", "sample frequency")


def make_recordings(
    source: Source, tables: Sequence[Table], options: ReadOptions, notes: tuple[str, ...]
) -> tuple[Recording, ...]:
    """Return the tests in a file's tables, in SI."""
    blocks = []
    for table in tables:
        try:
            blocks.append(_tests_in(table, source, options))
        except LogError as error:
            error.says_setting = _says_setting(table, source, options)
            raise
    are_buffers = len(tables) > 1 and all(table.may_run_on for table in tables)
    tests = _join_buffers(blocks) if are_buffers else list(chain.from_iterable(blocks))
    subject = f"{source.name}: part_settings"
    settings = [setting_in_words(str(s), subject, options.adjusters) for s in options.part_settings]
    if settings and len(settings) != len(tests):
        raise LogError(
            f"{len(tests)} tests found, but {len(settings)} settings declared for "
            "them (part_settings)",
            code="several-tests",
        )
    is_several = len(tests) > 1
    notes = (*notes, f"{len(tests)} tests in this file") if is_several else notes
    declared = ("setting: as declared",) if settings else ()
    return tuple(
        replace(
            test,
            name=f"{source.name} part {i + 1}" if is_several else source.name,
            setting=settings[i] if settings and options.setting is None else test.setting,
            notes=(*notes, *test.notes, *declared),
        )
        for i, test in enumerate(tests)
    )


def _says_setting(table: Table, source: Source, options: ReadOptions) -> bool:
    """Say whether a log that cannot be read states a setting, right or wrong."""
    if options.setting is not None or options.part_settings:
        return True
    with suppress(LogError):
        stated = preamble_setting(table.metadata, source.name, options.adjusters)
        label = stated.over(file_setting(source.name, options.setting_pattern, options.adjusters))
        return bool(label.places) or has_channel("setting", table.columns, options)
    return True


# Write buffers of one record.


def _join_buffers(blocks: Sequence[Sequence[Recording]]) -> list[Recording]:
    """Return the tests in blocks, in the order of the file, those joined whose time runs on."""
    records: list[list[Recording]] = []
    breaks: list[str] = []
    for number, block in enumerate(blocks, start=1):
        for i, test in enumerate(block):
            if i == 0 and records and _runs_on(records[-1][-1], test):
                records[-1].append(test)
                continue
            if records:
                end, start = records[-1][-1].time[-1], test.time[0]
                gap = f"{abs(start - end):.4g} s {'later' if start > end else 'earlier'}"
                breaks.append(
                    f"block {number} begins at {start:.6g} s, {gap} than the block before ends"
                )
            records.append([test])
    joined = [record for record in records if len(record) > 1]
    if not joined:
        return [record[0] for record in records]
    note = f"{sum(map(len, joined))} blocks joined, as time runs on by one step from each to the"
    note += f" next, into {len(joined)} of {len(records)} tests" if breaks else " next"
    remaining = [f"and {len(breaks) - _LISTED} more"] if len(breaks) > _LISTED else []
    note = "; ".join([note, *breaks[:_LISTED], *remaining])
    return [_joined(record, note) for record in records]


def _runs_on(before: Recording, after: Recording) -> bool:
    """Say whether a part begins one step after the end of another, at the same rate."""
    if before.setting != after.setting:
        return False
    steps = [median(np.diff(test.time)) for test in (before, after) if len(test.time) > 1]
    if not steps or max(steps) > _LARGEST_STEP * min(steps):
        return False
    between = float(after.time[0] - before.time[-1])
    return all(_LEAST_STEP < between / step < _LARGEST_STEP for step in steps)


def _joined(record: Sequence[Recording], note: str) -> Recording:
    notes = [text for text in record[0].notes if text.startswith(_TITLE)]
    notes += [text for test in record for text in test.notes if not text.startswith(_TITLE)]
    channels: dict[str, Any] = {}
    for name in ("time", "displacement", "force", *EXTRAS):
        values = [getattr(test, name) for test in record]
        is_complete = all(value is not None for value in values)
        channels[name] = np.concatenate(values) if is_complete else None
    findings = distinct(finding for test in record for finding in test.findings)
    every_note = tuple(dict.fromkeys([*notes, note]))
    return replace(record[0], **channels, notes=every_note, findings=findings)


# One table.


def _tests_in(  # noqa: C901, PLR0912, PLR0915  # one table from its columns to its tests
    table: Table, source: Source, options: ReadOptions
) -> list[Recording]:
    """Return the tests in one table; their names are still the file's."""
    rate, rate_note = options.sample_rate, f"time: {options.sample_rate:g} Hz, as declared"
    for key in _RATE_KEYS:
        with suppress(KeyError, ValueError):
            stated = float(table.metadata[key].removesuffix("Hz").strip())
            if rate == 0.0 and 0.0 < stated < 1e9:
                rate, rate_note = stated, f"time: {stated:g} Hz, from the preamble"
    choices, notes = choose_channels(
        table.columns, options, needs_time=rate == 0.0, hint=table.hint
    )
    samples = _loaded(table, choices)
    if not options.needs_force:
        motion = samples.channels["displacement"]
        samples = replace(samples, channels={"force": np.zeros_like(motion), **samples.channels})
    if not len(samples.channels["displacement"]):
        raise LogError("no data rows", code="no-data")
    clock = choices.get("time")
    wall_clock = 0.0
    if clock is not None and clock.unit is not None and options.sample_rate == 0.0:
        first = float(samples.channels["time"][0]) * clock.unit.factor
        if table.columns[clock.column].is_clock or first > _SINCE_1970:
            wall_clock = clock.unit.factor
    samples = on_one_clock(samples, wall_clock=wall_clock)
    channels: dict[str, FloatArray] = {}
    problems = []
    for channel, logged in samples.channels.items():
        unit, values = choices[channel].unit if channel in choices else None, logged
        if unit is None:
            continue
        with np.errstate(over="ignore", invalid="ignore"):
            if channel in options.scales or channel in options.offsets:
                values = values * options.scales.get(channel, 1.0)
                values += options.offsets.get(channel, 0.0)
            si = np.ascontiguousarray(unit.to_si(values), dtype=np.float64)
        channels[channel] = si
        if channel not in EXTRAS:
            problem = _not_finite(logged, channel, samples)
            if si is not logged:  # a factor may overflow
                problem = problem or _not_finite(si, channel, samples)
            problems += [problem] if problem else []
    if problems:
        raise joined_problems(problems)
    channels.setdefault("force", samples.channels["force"])
    more_notes = [
        f"{channel}: {options.scales.get(channel, 1.0):g} times the log plus "
        f"{options.offsets.get(channel, 0.0):g}, as declared"
        for channel in sorted({*options.scales, *options.offsets} & choices.keys())
    ]
    signs: dict[str, Any] = {}
    for channel in ("displacement", "force"):
        is_reversed = getattr(options, f"reverse_{channel}")
        signs[f"reverse_{channel}"] = is_reversed if isinstance(is_reversed, bool) else None
        if is_reversed is True:
            channels[channel] = -channels[channel]
            more_notes.append(f"{channel}: sign reversed")
    for channel in EXTRAS:
        values = channels.get(channel, np.empty(0))
        if n_bad := int(np.count_nonzero(~(np.abs(values) < _LARGEST))):  # nor of NaN
            more_notes.append(f"{channel}: left out; {n_bad} of {len(values)} values are missing")
            del channels[channel]
    is_own_time = "time" in channels and options.sample_rate == 0.0
    more_notes += [] if is_own_time else [rate_note]
    cuts = _cuts(samples, channels, options)
    findings = (*table.findings, *samples.findings)
    if len(cuts) == 1:
        cuts, steps = _cut_at_levels(*cuts[0], samples, options)
        findings = (*findings, *steps)
    title = (f"{_TITLE}{table.part}",) if table.part else ()
    sentences = (finding.message() for finding in findings)
    notes = (*title, *table.notes, *samples.notes, *sentences, *notes, *more_notes)
    tests = []
    for start, stop in cuts:
        cut: dict[str, Any] = {channel: values[start:stop] for channel, values in channels.items()}
        if not is_own_time:
            cut["time"] = np.arange(stop - start) / rate
        label = _label(samples, start, table.metadata, source, options)
        setting = label.setting(options.adjusters)
        places = {} if setting else {name: str(place) for name, place in label.places.items()}
        preamble = identity_in(table.metadata).describe() if label.others else {}
        groups = {key: text for key, text in label.others.items() if key not in preamble}
        tests.append(
            Recording(
                name=source.name,
                path=source.path,
                sha256=source.sha256,
                setting=setting,
                notes=(*notes, *label.notes),
                metadata={**groups, **table.metadata, **places},
                findings=findings,
                **cut,
                **signs,
            )
        )
    return tests


def _loaded(table: Table, choices: Mapping[str, ChannelChoice]) -> Samples:
    """Return the channels as logged, and what may be a valve's current by its column's name."""
    indices = {channel: choice.column for channel, choice in choices.items()}
    valves = [
        i
        for i, column in enumerate(table.columns)
        if i not in indices.values()
        and (
            _CURRENTS.search(column.name)
            or _BY_UNIT.search(column.name)
            or column.unit in {"A", "mA", "V"}
        )
    ]
    currents = {f"{_CURRENT}{visible(table.columns[i].name)}": i for i in valves[:_MOST_VALVES]}
    samples = None
    with suppress(LogError):
        samples = table.load({**indices, **currents})
    if samples is None or (currents and samples.findings):
        without = table.load(indices)  # a row without a current is not one to drop
        n_rows = len(without.channels["displacement"])
        if samples is None or len(samples.channels["displacement"]) < n_rows:
            samples = without
    clock = choices.get("time")
    units = {name: choice.unit for name, choice in choices.items() if name.startswith(OWN_TIME)}
    if units and clock is not None and clock.unit is not None:
        times = {
            name.removeprefix(OWN_TIME): unit.to_si(samples.channels[name]) / clock.unit.factor
            for name, unit in units.items()
            if unit is not None
        }
        channels = {name: v for name, v in samples.channels.items() if name not in units}
        samples = replace(samples, channels=channels, times=times)
    return samples


def _not_finite(values: FloatArray, channel: str, samples: Samples) -> LogError | None:
    """Return the error of a channel with values that are no numbers; None without any."""
    with np.errstate(over="ignore", invalid="ignore"):
        if np.isfinite(values.sum()):  # one pass where all is well; a sum keeps NaN and infinity
            return None
    bad = np.flatnonzero(~np.isfinite(values))
    if not len(bad):
        return None
    return LogError(
        f"{channel} is blank, NaN or infinite, in {len(bad)} of {len(values)} rows in all; repair "
        "the log or remove these rows",
        subject=f", {samples.place(int(bad[0]))}",
        code="bad-row",
    )


# Tests in one table.


def _cuts(
    samples: Samples, channels: Mapping[str, FloatArray], options: ReadOptions
) -> list[tuple[int, int]]:
    """Return first and stop of each test: cut at pauses, restarts and changes of setting."""
    n = len(channels["force"])
    is_cut = np.zeros(n + 1, dtype=bool)
    is_cut[[0, n]] = True
    turned = [adjuster for adjuster in options.adjusters if adjuster in samples.channels]
    for adjuster in turned:
        values = samples.channels[adjuster]
        if problem := _not_finite(values, adjuster, samples):
            raise problem
        is_cut[1:n] |= values[1:] != values[:-1]
    start = 0
    if "time" in channels and n > 1:
        steps = np.diff(channels["time"])
        if 0.0 < median(steps) < _CLOSEST:
            raise LogError(
                f"samples are {median(steps):.3g} s apart, closer than any logger takes them; "
                "check the unit of time (rig.units)",
                code="bad-clock",
            )
        if not turned and steps.min() > 0.0 and steps.max() <= (options.pause or _PAUSE):
            ends = buffer_ends(channels["time"]) if options.pause == 0.0 else []
            if ends:
                _check_pieces(ends, channels)
            return list(pairwise([0, *(end + 1 for end in ends), n]))
        late = np.flatnonzero((steps <= 0.0) & ~is_cut[1:n])
        if options.sample_rate == 0.0 and options.restarts == "refuse" and len(late):
            place = f", {samples.place(int(late[0]) + 1)}"
            raise LogError(_backwards(channels, late + 1), subject=place, code="bad-clock")
        if options.restarts != "refuse":
            is_cut[late + 1] = True
        if options.restarts == "last" and len(late):
            start = int(late[-1]) + 1
        forward = steps[steps > 0.0]
        longest = _PAUSE_STEPS * median(forward) if len(forward) else 0.0
        is_cut[1:n] |= steps > (options.pause or max(_PAUSE, longest))
    edges = [int(i) for i in np.flatnonzero(is_cut) if i >= start]
    if len(edges) - 1 > _MAX_PARTS:
        raise LogError(
            f"time jumps {len(edges) - 2} times; these are not tests but a faulty clock: "
            "declare rig.sample_rate",
            code="bad-clock",
        )
    return list(pairwise(edges))


def _check_pieces(ends: Sequence[int], channels: Mapping[str, FloatArray]) -> None:
    """Refuse a record in pieces, between the pauses of its logger, that hold no three cycles."""
    time, x, n = channels["time"], channels["displacement"], ends[0] + 1
    off = x - 0.5 * (float(np.min(x)) + float(np.max(x)))
    sides = np.sign(off[np.abs(off) > 0.25 * float(np.max(off))])
    n_cycles = np.count_nonzero(np.diff(sides)) / 2.0 / (len(ends) + 1)
    if n_cycles < _CYCLES:
        pause, piece = time[n] - time[n - 1], time[n - 1] - time[0]
        raise LogError(
            f"the logger pauses for {pause:.3g} s after every {n} rows, as it writes its buffer: "
            f"{len(ends) + 1} pieces of {piece:.3g} s, about {n_cycles:.1f} cycles each, where "
            f"{_CYCLES} are the least; log with a larger buffer, fewer samples a second or a "
            "faster motion",
            code="short-pieces",
        )


def _cut_at_levels(
    first: int, stop: int, samples: Samples, options: ReadOptions
) -> tuple[list[tuple[int, int]], tuple[Problem, ...]]:
    """Return a test cut where the current of a valve steps to another setting, and the finding."""
    currents = [channel for channel in samples.channels if channel.startswith(_CURRENT)]
    x, force = samples.channels["displacement"], samples.channels["force"]
    for name in currents:
        values, column = samples.channels[name], name.removeprefix(_CURRENT)
        starts, levels = steps_of_level(values, x)
        if not starts:
            continue
        speeds = [float(np.mean(np.abs(np.diff(part)))) for part in np.split(x, starts)]
        # What steps with the motion is what the machine was told, unless its name says otherwise.
        is_of_machine = _MACHINE.search(column) or max(speeds) > _OTHER_MOTION * min(speeds)
        if is_of_machine and not _CURRENTS.search(column):
            continue
        if np.ptp(force) > 0.0 and abs(np.corrcoef(values, force)[0, 1]) < _RAW:
            break
    else:
        return [(first, stop)], ()
    digit = 10.0 ** (math.floor(math.log10(np.ptp(levels))) - 2)
    listed = ", ".join(f"{round(level / digit) * digit:g}" for level in levels)
    places = ", ".join(samples.place(start) for start in starts)
    is_named = bool(options.part_settings) and options.setting is None
    text = (
        f"column {name.removeprefix(_CURRENT)} steps at {places}: settings of their own, {listed}, "
        f"in one record, read as {len(levels)} tests"
    )
    text += "" if is_named else f"; name them by rig.part_settings = [{listed}]"
    finding = (note if is_named else warning)("level_steps", text, value=float(len(starts)))
    return list(pairwise([first, *starts, stop])), (finding,)


def _backwards(channels: Mapping[str, FloatArray], late: NDArray[np.intp]) -> str:
    """Return a sentence on the rows `late`, in which time does not increase, with advice."""
    time, i = channels["time"], int(late[0])
    verb = "repeats" if time[i] == time[i - 1] else "runs backwards"
    advice = "several tests in one file: declare rig.restarts"
    if all(np.array_equal(values[late], values[late - 1]) for values in channels.values()):
        advice = "these rows are there twice: remove the copies"
    elif rate := rate_of_stamps(time):
        advice = (
            "several rows share a stamp, as the clock is coarser than the samples: declare "
            f"rig.sample_rate = '{rate}Hz', if the rows are evenly spaced"
        )
    elif len(time) > 2 and bool(np.all(np.diff(time) < 0.0)):
        advice = "all rows are in reverse: sort them by time"
    elif not np.any(np.diff(time)):
        advice = "the clock stands still: declare rig.sample_rate, if the rows are evenly spaced"
    return (
        f"time {verb}: {time[i]:.9g} s after {time[i - 1]:.9g} s; "
        f"time must increase ({len(late)} such row{'s' * (len(late) > 1)}); {advice}"
    )


# Its setting.


def _label(
    samples: Samples,
    row: int,
    metadata: Mapping[str, str],
    source: Source,
    options: ReadOptions,
) -> LogLabel:
    """Return the setting from the declaration, the preamble, columns or the file name."""
    from_name = file_setting(source.name, options.setting_pattern, options.adjusters)
    if options.setting is not None:
        places = dict(Setting.of(options.setting).places)
        return LogLabel(places, from_name.others, ("setting: as declared",))
    of_columns = {}
    for adjuster in options.adjusters:
        if adjuster in samples.channels:
            number = f"{samples.channels[adjuster][row]:.15g}"
            stated = setting_in_words(number, f"{source.name}: column '{adjuster}'")
            of_columns[adjuster] = stated.places[0][1]
    preamble = preamble_setting(metadata, source.name, options.adjusters, of_columns)
    label = preamble.over(LogLabel(of_columns)).over(from_name)
    doubts = (
        f"{adjuster}: {preamble.places[adjuster]} of the preamble; the file name says {place}: "
        "check which is right"
        for adjuster, place in from_name.places.items()
        if preamble.places.get(adjuster, place) != place
    )
    return replace(label, notes=(*label.notes, *doubts))
