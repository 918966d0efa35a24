"""Formats that keep channels in groups (TDMS, MDF, HDF5): which groups are tests.

A group whose channels are named like time, displacement and force is a test of its own. Where no
group is, the channels of all groups together are one test.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from damperfit.errors import LogError
from damperfit.readers.channels import choose_channels, split_name, visible, words_of_name
from damperfit.readers.child_process import ChildAnswer, ask_child
from damperfit.readers.foreign import check_size
from damperfit.readers.table import Column, Samples, Table

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from numpy.typing import NDArray

    from damperfit.readers.files import Source
    from damperfit.readers.options import ReadOptions

    FloatArray = NDArray[np.float64]

__all__ = ["Group", "GroupChannel", "group_tables", "groups_answer", "read_groups_in_child"]

_TIME = frozenset({"time", "t", "zeit"})


@dataclass(frozen=True, slots=True, eq=False)
class GroupChannel:
    """One channel of a group.

    Attributes
    ----------
    name : str
        As the file has it.
    unit : str or None
        As the file has it.
    length : int
        Values that the file says it has.
    load : callable
        () -> float array of shape (length,).
    start, interval : float or None
        Time of the first value and between values, s, where the file says so.
    """

    name: str
    unit: str | None
    length: int
    load: Callable[[], FloatArray]
    start: float = 0.0
    interval: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Group:
    """Channels that belong together.

    Attributes
    ----------
    name : str
        As the file has it.
    channels : tuple of GroupChannel
        Numbers only.
    metadata : mapping of str to str
        Keys in lower case.
    is_cut : bool
        The end of the file is missing: what all channels have is kept.
    """

    name: str
    channels: tuple[GroupChannel, ...]
    metadata: Mapping[str, str] = field(default_factory=dict)
    is_cut: bool = False


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
        raise LogError(f"{name}: no channels of numbers")
    tests = [group for group in filled if _is_test(group, options)] if len(filled) > 1 else filled
    if not tests:
        tests = [_merged(filled)]
    left_out = [group.name for group in filled if group not in tests] if len(filled) > 1 else []
    if left_out and len(tests[0].channels) < sum(len(group.channels) for group in filled):
        names = ", ".join(visible(group) for group in left_out[:10])
        notes = (*notes, f"groups left out, as they are not tests: {names}")
    return tuple(_table(group, options, name, notes) for group in tests)


def _is_test(group: Group, options: ReadOptions) -> bool:
    try:
        choose_channels(_columns(group), options, where=group.name)
    except LogError:
        return False
    return True


def _merged(groups: Sequence[Group]) -> Group:
    channels = tuple(channel for group in groups for channel in group.channels)
    metadata = {key: value for group in reversed(groups) for key, value in group.metadata.items()}
    return Group("", channels, metadata, is_cut=any(group.is_cut for group in groups))


def _columns(group: Group) -> tuple[Column, ...]:
    columns = [Column(channel.name.strip(), channel.unit) for channel in group.channels]
    if _makes_time(group):
        columns.append(Column("time", "s"))
    return tuple(columns)


def _makes_time(group: Group) -> bool:
    """Say whether time comes from the interval between values: no channel holds it."""
    has_interval = any(channel.interval is not None for channel in group.channels)
    has_time = any(
        _TIME.intersection(words_of_name(split_name(channel.name)[0])) for channel in group.channels
    )
    return has_interval and not has_time


def _table(group: Group, options: ReadOptions, name: str, notes: tuple[str, ...]) -> Table:
    def load(wanted: Mapping[str, int]) -> Samples:
        channels, said = _load(group, wanted, options, name)
        return Samples(channels, lambda index: f"row {index + 1}", said)

    from_interval = ("time: from the interval between values",) if _makes_time(group) else ()
    said = (f"group: {visible(group.name)}",) if group.name else ()
    return Table(_columns(group), load, group.metadata, (*notes, *said, *from_interval))


def _load(
    group: Group, wanted: Mapping[str, int], options: ReadOptions, name: str
) -> tuple[dict[str, FloatArray], tuple[str, ...]]:
    chosen = {
        channel: group.channels[index]
        for channel, index in wanted.items()
        if index < len(group.channels)
    }
    lengths = {channel: column.length for channel, column in chosen.items()}
    n_common = min(lengths.values(), default=0)
    notes: tuple[str, ...] = ()
    if len(set(lengths.values())) > 1:
        shown = ", ".join(f"{channel} {n}" for channel, n in lengths.items())
        if not group.is_cut:
            raise LogError(
                f"{name}: channels of different length: {shown} values; log them together"
            )
        notes = (f"kept: the first {n_common} values, which all channels have, of {shown}",)
    claimed = 8 * sum(lengths.values())
    check_size(claimed, limit=options.max_bytes, what="the log", name=name)
    loaded = {
        channel: _values(channel, column, name)[:n_common] for channel, column in chosen.items()
    }
    if "time" in wanted and "time" not in chosen:
        loaded["time"] = _time(chosen, n_common, name)
    return loaded, notes


def _values(channel: str, column: GroupChannel, name: str) -> FloatArray:
    values = np.asarray(column.load(), dtype=np.float64)
    if values.shape != (column.length,):
        raise LogError(
            f"{name}: {channel}: {column.length} values are declared but {values.size} found; "
            "copy the log again"
        )
    return values


def _time(chosen: Mapping[str, GroupChannel], n: int, name: str) -> FloatArray:
    steps = {channel: (column.interval, column.start) for channel, column in chosen.items()}
    if len(set(steps.values())) > 1:
        shown = ", ".join(
            f"{channel} every {step} s from {start:g} s" for channel, (step, start) in steps.items()
        )
        raise LogError(f"{name}: channels of different rate or start: {shown}; log them together")
    first = next(iter(chosen.values()))
    if first.interval is None or not np.isfinite(first.interval) or first.interval <= 0.0:
        raise LogError(f"{name}: the interval between values is {first.interval} s")
    return first.start + first.interval * np.arange(n, dtype=np.float64)


def read_groups_in_child(
    module: str, library: str, source: Source, options: ReadOptions
) -> list[Group]:
    """Return the groups of channels that a module finds in a log; as `ask_child`."""
    answer = ask_child(module, library, source, options)
    values = (np.frombuffer(part, dtype=np.float64) for part in answer.parts)
    return [
        Group(
            group["name"],
            tuple(
                GroupChannel(name, unit, length, partial(np.asarray, next(values)))
                for name, unit, length in group["channels"]
            ),
            group["metadata"],
        )
        for group in answer.said
    ]


def groups_answer(groups: Sequence[Group]) -> ChildAnswer:
    """Return groups of channels as a child sends them."""
    said = [
        {
            "name": group.name,
            "channels": [(c.name, c.unit, c.length) for c in group.channels],
            "metadata": dict(group.metadata),
        }
        for group in groups
    ]
    return ChildAnswer(said, [c.load().tobytes() for group in groups for c in group.channels])
