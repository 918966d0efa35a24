"""Formats that keep channels in groups (TDMS, MDF, MATLAB): which groups are tests.

A group whose channels are named like time, displacement and force is a test of its own. Where no
group is, the channels of all groups together are one test.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from damperfit.errors import LogError
from damperfit.io.channels import choose_channels, split_name, visible, words_of_name
from damperfit.io.child_process import ChildAnswer, ChildReader, ask_child, check_size
from damperfit.io.files import Source
from damperfit.io.formats import Column, FloatArray, Samples, Table
from damperfit.io.options import ReadOptions
from damperfit.recording import Finding

__all__ = ["Group", "GroupChannel", "answer_of_groups", "group_tables", "groups_of_child"]

_TIME = frozenset({"time", "t", "zeit"})


class GroupChannel(NamedTuple):
    """One channel of a group."""

    name: str
    unit: str | None
    length: int  # values that the file says it has
    load: Callable[[], FloatArray]
    start: float = 0.0  # time of the first value, s
    interval: float | None = None  # between values, s, where the file says so


@dataclass(frozen=True, slots=True, eq=False)
class Group:
    """Channels of numbers that belong together."""

    name: str
    channels: tuple[GroupChannel, ...]
    metadata: Mapping[str, str] = field(default_factory=dict)  # keys in lower case
    is_cut: bool = False  # the end of the file is missing: what all channels have is kept

    @property
    def makes_time(self) -> bool:
        """Say whether time comes from the interval between values: no channel holds it."""
        names = [words_of_name(split_name(channel.name)[0]) for channel in self.channels]
        has_interval = any(channel.interval is not None for channel in self.channels)
        return has_interval and not any(_TIME.intersection(words) for words in names)

    @property
    def columns(self) -> tuple[Column, ...]:
        """The channels as columns, and behind them the time that the interval makes."""
        columns = [Column(channel.name.strip(), channel.unit) for channel in self.channels]
        return (*columns, *([Column("time", "s")] * self.makes_time))


def group_tables(
    groups: Sequence[Group], options: ReadOptions, *, name: str, notes: tuple[str, ...] = ()
) -> tuple[Table, ...]:
    """Return a table for each test.

    Raises
    ------
    LogError
        There are no channels of numbers.
    """
    filled = [group for group in groups if group.channels]
    if not filled:
        raise LogError("no channels of numbers", subject=name)
    tests = filled if len(filled) == 1 else [group for group in filled if _is_test(group, options)]
    if not tests:
        channels = tuple(channel for group in filled for channel in group.channels)
        metadata = {key: text for group in filled[::-1] for key, text in group.metadata.items()}
        tests = [Group("", channels, metadata, is_cut=any(group.is_cut for group in filled))]
    elif left_out := [group.name for group in filled if group not in tests]:
        names = ", ".join(visible(group) for group in left_out[:10])
        notes = (*notes, f"groups left out, as they are not tests: {names}")
    return tuple(_table(group, options, name, notes) for group in tests)


def _is_test(group: Group, options: ReadOptions) -> bool:
    try:
        choose_channels(group.columns, options, where=group.name)
    except LogError:
        return False
    return True


def _table(group: Group, options: ReadOptions, name: str, notes: tuple[str, ...]) -> Table:
    def load(wanted: Mapping[str, int]) -> Samples:
        n = len(group.channels)
        chosen = {channel: group.channels[i] for channel, i in wanted.items() if i < n}
        if "time" in wanted and "time" not in chosen and not group.is_cut:
            clocks = {(column.interval, column.start) for column in chosen.values()}
            if len(clocks) > 1 and all(interval for interval, _ in clocks):
                return _on_one_clock(chosen, options, name)
        lengths = {channel: column.length for channel, column in chosen.items()}
        n_common = min(lengths.values(), default=0)
        said: tuple[str, ...] = ()
        if len(set(lengths.values())) > 1:
            shown = ", ".join(f"{channel} {n}" for channel, n in lengths.items())
            if not group.is_cut:
                raise LogError(
                    f"channels of different length: {shown} values; log them together", subject=name
                )
            said = (f"kept: the first {n_common} values, which all channels have, of {shown}",)
        claimed = 8 * sum(lengths.values())
        check_size(claimed, limit=options.max_bytes, what="the log", name=name)
        loaded = {
            channel: _values(channel, column, name)[:n_common] for channel, column in chosen.items()
        }
        if "time" in wanted and "time" not in chosen:
            loaded["time"] = _time(chosen, n_common, name)
        return Samples(loaded, lambda index: f"row {index + 1}", said)

    if group.name:
        notes = (*notes, f"group: {visible(group.name)}")
    if group.makes_time:
        notes = (*notes, "time: from the interval between values")
    return Table(group.columns, load, group.metadata, notes)


def _values(channel: str, column: GroupChannel, name: str) -> FloatArray:
    values = np.asarray(column.load(), dtype=np.float64)
    if values.shape != (column.length,):
        raise LogError(
            f"{channel}: {column.length} values are declared but {values.size} found; "
            "copy the log again",
            subject=name,
        )
    return values


def _on_one_clock(chosen: Mapping[str, GroupChannel], options: ReadOptions, name: str) -> Samples:
    """Return channels that start or run differently at the times of the force, where all are."""
    claimed = 8 * sum(column.length for column in chosen.values())
    check_size(claimed, limit=options.max_bytes, what="the log", name=name)
    times = {
        channel: column.start + _interval(column, name) * np.arange(column.length)
        for channel, column in chosen.items()
    }
    shown = ", ".join(
        f"{channel} every {column.interval} s from {column.start:g} s"
        for channel, column in chosen.items()
    )
    time = times["force"]
    first = max(t.min(initial=np.inf) for t in times.values())
    last = min(t.max(initial=-np.inf) for t in times.values())
    tolerance = 1e-6 * _interval(chosen["force"], name)  # starts are differences of stamps
    time = time[(time >= first - tolerance) & (time <= last + tolerance)]
    if 2 * len(time) < chosen["force"].length:
        raise LogError(
            f"channels of different rate or start: {shown}; log them together", subject=name
        )
    channels = {
        channel: np.interp(time, times[channel], _values(channel, column, name))
        for channel, column in chosen.items()
    }
    words = f"channels of different rate or start, read at the times of the force: {shown}"
    finding = Finding("own_rows", "warning", words, is_correction=True)
    channels["time"] = time
    return Samples(channels, lambda index: f"row {index + 1}", findings=(finding,))


def _interval(column: GroupChannel, name: str) -> float:
    interval = column.interval
    if interval is None or not np.isfinite(interval) or interval <= 0.0:
        raise LogError(f"the interval between values is {interval} s", subject=name)
    return interval


def _time(chosen: Mapping[str, GroupChannel], n: int, name: str) -> FloatArray:
    steps = {channel: (column.interval, column.start) for channel, column in chosen.items()}
    if len(set(steps.values())) > 1:
        shown = ", ".join(
            f"{channel} every {step} s from {start:g} s" for channel, (step, start) in steps.items()
        )
        raise LogError(
            f"channels of different rate or start: {shown}; log them together", subject=name
        )
    first = next(iter(chosen.values()))
    return first.start + _interval(first, name) * np.arange(n, dtype=np.float64)


def groups_of_child(reader: ChildReader, source: Source, options: ReadOptions) -> list[Group]:
    """Return the groups of channels that a child finds in a log; as `ask_child`."""
    answer = ask_child(reader, source, options)
    parts = iter(answer.parts)
    return [
        Group(name, tuple(_held(channel, next(parts)) for channel in channels), metadata)
        for name, channels, metadata in answer.said
    ]


def _held(channel: tuple[str, str | None, int], values: bytes) -> GroupChannel:
    name, unit, length = channel
    return GroupChannel(name, unit, length, lambda: np.frombuffer(values, dtype=np.float64))


def answer_of_groups(groups: Sequence[Group]) -> ChildAnswer:
    """Return groups of channels as a child sends them."""
    said = [
        (group.name, [channel[:3] for channel in group.channels], dict(group.metadata))
        for group in groups
    ]
    values = [channel.load() for group in groups for channel in group.channels]
    return ChildAnswer(said, [np.asarray(one, dtype=np.float64).tobytes() for one in values])
