"""Formats that keep channels in groups (TDMS, MDF, MATLAB): which groups are tests.

A group whose channels are named like time, displacement and force is a test. Where no group is, the
channels of all groups together are one test, each with the clock of its group.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from damperfit.errors import LogError
from damperfit.io.child_process import check_size
from damperfit.io.columns import choose_channels, split_name, visible, words_of_name
from damperfit.io.formats import Column, FloatArray, Samples, Table
from damperfit.io.options import ReadOptions
from damperfit.units.quantities import find_unit, is_unit

_TIME = frozenset({"time", "t", "zeit"})


class GroupChannel(NamedTuple):
    """One channel of a group."""

    name: str
    unit: str | None
    length: int  # values that the file says it has
    load: Callable[[], FloatArray]
    start: float = 0.0  # time of the first value, s
    interval: float | None = None  # between values, s, where the file says so
    stamps: GroupChannel | None = None  # the times of its values, where its group has them

    @property
    def is_time(self) -> bool:
        """Say whether it is named like time."""
        return bool(_TIME.intersection(words_of_name(split_name(self.name)[0])))

    @property
    def clock(self) -> tuple[object, ...] | None:
        """The source of its times, compared: channels of equal clocks go together."""
        if self.stamps is not None:
            return (self.stamps.name, self.stamps.load)
        return None if self.interval is None else (self.start, self.interval)

    def values(self, channel: str) -> FloatArray:
        """Return its values; refuses another number than declared."""
        values = np.asarray(self.load(), dtype=np.float64)
        if values.shape != (self.length,):
            raise LogError(
                f"{channel}: {self.length} values are declared but {values.size} found; "
                "copy the log again",
                code="damaged",
            )
        return values

    def times(self) -> FloatArray:
        """Return the times of its values, s."""
        if self.stamps is not None:
            unit = self.stamps.unit or split_name(self.stamps.name)[1] or "s"
            seconds = find_unit(unit if is_unit(unit, "time") else "s", "time")
            return seconds.to_si(self.stamps.values("time"))
        step = self.interval
        if step is None or not np.isfinite(step) or step <= 0.0:
            raise LogError(f"the interval between values is {step} s", code="bad-clock")
        return self.start + step * np.arange(self.length, dtype=np.float64)


class Group(NamedTuple):
    """Channels of numbers that belong together."""

    name: str
    channels: tuple[GroupChannel, ...]
    metadata: Mapping[str, str] = {}  # never changed; keys in lower case
    is_cut: bool = False  # the end of the file is missing: what all channels have is kept

    @property
    def makes_time(self) -> bool:
        """Say whether time comes from the clocks of the channels: none of them holds it."""
        has_clock = any(channel.clock is not None for channel in self.channels)
        return has_clock and not any(channel.is_time for channel in self.channels)

    @property
    def columns(self) -> tuple[Column, ...]:
        """The channels as columns, and behind them the time that their clocks make."""
        columns = [Column(channel.name.strip(), channel.unit) for channel in self.channels]
        return (*columns, *([Column("time", "s")] * self.makes_time))


def group_tables(
    groups: Sequence[Group], options: ReadOptions, *, notes: tuple[str, ...] = ()
) -> tuple[Table, ...]:
    """Return a table for each test."""
    filled = [group for group in groups if group.channels]
    if not filled:
        raise LogError("no channels of numbers", code="no-data")
    tests = filled if len(filled) == 1 else [group for group in filled if _is_test(group, options)]
    if not tests:
        tests = [_together(filled)]
    elif left_out := [group.name for group in filled if group not in tests]:
        names = ", ".join(visible(name) for name in left_out[:10])
        notes = (*notes, f"groups left out, as they are not tests: {names}")
    return tuple(_table(group, options, notes) for group in tests)


def _is_test(group: Group, options: ReadOptions) -> bool:
    try:
        choose_channels(group.columns, options)
    except LogError:
        return False
    return True


def _together(groups: Sequence[Group]) -> Group:
    """Return the channels of all groups; where several have stamps, each with its group's."""
    channels = [channel for group in groups for channel in group.channels]
    stamps = [next((c for c in group.channels if c.is_time), None) for group in groups]
    if sum(clock is not None for clock in stamps) > 1:
        channels = [
            channel._replace(stamps=clock)
            for group, clock in zip(groups, stamps, strict=True)
            for channel in group.channels
            if channel is not clock
        ]
    metadata = {key: text for group in groups[::-1] for key, text in group.metadata.items()}
    return Group("", tuple(channels), metadata, is_cut=any(group.is_cut for group in groups))


def _table(group: Group, options: ReadOptions, notes: tuple[str, ...]) -> Table:
    def load(indices: Mapping[str, int]) -> Samples:
        n = len(group.channels)
        chosen = {channel: group.channels[i] for channel, i in indices.items() if i < n}
        lengths = {channel: column.length for channel, column in chosen.items()}
        claimed = 8 * sum(lengths.values())
        check_size(claimed, limit=options.max_bytes, subject="the log")
        makes_time = "time" in indices and "time" not in chosen
        clocks = {column.clock for column in chosen.values()}
        if makes_time and len(clocks) > 1 and None not in clocks and not group.is_cut:
            values = {channel: column.values(channel) for channel, column in chosen.items()}
            times = {channel: column.times() for channel, column in chosen.items()}
            return Samples({**values, "time": times["force"]}, times=times)
        n_common = min(lengths.values(), default=0)
        note: tuple[str, ...] = ()
        if len(set(lengths.values())) > 1:
            listed = ", ".join(f"{channel} {n}" for channel, n in lengths.items())
            if not group.is_cut:
                text = f"channels of different length: {listed} values; log them together"
                raise LogError(text, code="several-groups")
            note = (f"kept: the first {n_common} values, which all channels have, of {listed}",)
        values = {channel: column.values(channel)[:n_common] for channel, column in chosen.items()}
        if makes_time:
            if len(clocks) > 1:
                text = "channels of different rate or start; log them together"
                raise LogError(text, code="several-groups")
            values["time"] = next(iter(chosen.values())).times()[:n_common]
        return Samples(values, notes=note)

    if group.name:
        notes = (*notes, f"group: {visible(group.name)}")
    if group.makes_time:
        has_interval = any(channel.interval is not None for channel in group.channels)
        by = "the interval between values" if has_interval else "each group's own"
        notes = (*notes, f"time: from {by}")
    return Table(group.columns, load, group.metadata, notes)
