"""Formats that keep channels in groups: TDMS, MDF and MATLAB, and which groups are tests.

A group whose channels are named like time, displacement and force is a test of its own. Where no
group is, the channels of all groups together are one test.
"""

from __future__ import annotations

import importlib
import io
import math
import struct
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import islice
from typing import TYPE_CHECKING, Any
from warnings import catch_warnings, simplefilter

import numpy as np

from damperfit.errors import LogError
from damperfit.io.channels import choose_channels, split_name, visible, words_of_name
from damperfit.io.child_process import (
    ChildAnswer,
    ChildReader,
    ask_child,
    check_size,
    load_library,
    refusing_damage,
)
from damperfit.io.formats import Column, Samples, Table
from damperfit.problem import Option
from damperfit.recording import Finding

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from damperfit.io.files import Source
    from damperfit.io.options import ReadOptions

    FloatArray = NDArray[np.float64]

__all__ = [
    "Group",
    "GroupChannel",
    "group_tables",
    "read_matlab",
    "read_mdf",
    "read_tdms",
]


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
        raise LogError("no channels of numbers", subject=name)
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
                f"channels of different length: {shown} values; log them together", subject=name
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
            f"{channel}: {column.length} values are declared but {values.size} found; "
            "copy the log again",
            subject=name,
        )
    return values


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
    if first.interval is None or not np.isfinite(first.interval) or first.interval <= 0.0:
        raise LogError(f"the interval between values is {first.interval} s", subject=name)
    return first.start + first.interval * np.arange(n, dtype=np.float64)


def read_groups_in_child(reader: ChildReader, source: Source, options: ReadOptions) -> list[Group]:
    """Return the groups of channels that a child finds in a log; as `ask_child`."""
    answer = ask_child(reader, source, options)
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


# The skeleton of a TDMS file: whether its segments are whole and do not contradict themselves.
#
# Each segment starts with 28 bytes: "TDSm", contents, version, bytes to the next segment, bytes to
# its values. Then it says what its channels are, then come their values.
#
# Traps. A damaged length moves the values by some bytes, and npTDMS reads on: so what a segment
# says of its channels is walked here, and must end where the values begin, but for zeros that fill
# up a disk's sector. A rig that stops while writing leaves a segment whose length is 2^64 - 1. A
# file cut between two segments is whole and cannot be told from one.

_LEAD_IN = 28
# Bits of the contents.
_HAS_METADATA, _HAS_VALUES, _IS_BIG_ENDIAN, _IS_DAQMX = 1 << 1, 1 << 3, 1 << 6, 1 << 7
_OPEN = 0xFFFF_FFFF_FFFF_FFFF  # length of a segment that was never closed
_NO_VALUES, _AS_BEFORE = 0xFFFF_FFFF, 0  # length of what is said of a channel's values
_TEXT = 0x20
# Kind of a property -> bytes: integers, floats (with a unit), bool, time stamp, complex.
_SIZES = {
    0: 0, 1: 1, 2: 2, 3: 4, 4: 8, 5: 1, 6: 2, 7: 4, 8: 8, 9: 4, 10: 8, 11: 16, 0x19: 4, 0x1A: 8,
    0x1B: 16, 0x21: 1, 0x44: 16, 0x08000C: 8, 0x10000D: 16,
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Extent:
    """How much of a file is there.

    Attributes
    ----------
    n_stored : int
        Bytes of values in the file.
    cut_at : int
        Byte where the segment starts that is not whole; -1: all are.
    n_missing : int
        Bytes that are missing of it; -1: nothing tells how many.
    """

    n_stored: int
    cut_at: int = -1
    n_missing: int = 0


def find_extent(data: bytes, *, name: str) -> Extent:
    """Return how many bytes of values the segments hold, and whether the last one is whole.

    Raises
    ------
    LogError
        There is no segment where one should be, or one is inconsistent.
    """
    at = total = 0
    while at < len(data):
        if at and at + _LEAD_IN > len(data) and b"TDSm".startswith(data[at : at + 4]):
            return Extent(total, at, -1)
        if at + _LEAD_IN > len(data) or data[at : at + 4] != b"TDSm":
            raise LogError(f"truncated or damaged TDMS file: no segment at byte {at}", subject=name)
        (contents,) = struct.unpack_from("<I", data, at + 4)
        order = ">" if contents & _IS_BIG_ENDIAN else "<"
        _, n_bytes, n_before_values = struct.unpack_from(f"{order}IQQ", data, at + 8)
        if contents & _IS_DAQMX:
            raise LogError(
                "raw DAQmx values in TDMS are not supported; export as CSV", subject=name
            )
        values_at, end = at + _LEAD_IN + n_before_values, at + _LEAD_IN + n_bytes
        is_sound = values_at <= end if contents & _HAS_VALUES else values_at == end
        if is_sound and values_at <= len(data):
            said_to = _end_of_metadata(data[:values_at], at + _LEAD_IN, order, contents)
            is_sound = 0 <= said_to <= values_at and not any(data[said_to:values_at])
        if n_bytes != _OPEN and not is_sound:
            raise LogError(
                f"damaged TDMS file: the segment at byte {at} is inconsistent", subject=name
            )
        if n_bytes == _OPEN or end > len(data):
            has_values = contents & _HAS_VALUES and values_at <= len(data)
            held = len(data) - values_at if has_values else 0
            is_known = n_bytes != _OPEN and values_at <= len(data)
            return Extent(total + held, at, end - len(data) if is_known else -1)
        total += end - values_at
        at = end
    return Extent(total)


def _end_of_metadata(data: bytes, at: int, order: str, contents: int) -> int:
    """Return the byte after what a segment says of its channels; -1: the data end before."""
    if not contents & _HAS_METADATA:
        return at if at == len(data) else -1
    try:
        at, n_objects = _number(data, at, order)
        for _ in range(n_objects):
            at = _after_text(data, at, order)
            at, n_index = _number(data, at, order)
            # The length counts itself.
            at += n_index - 4 if n_index not in {_NO_VALUES, _AS_BEFORE} else 0
            at, n_properties = _number(data, at, order)
            for _ in range(n_properties):
                at = _after_text(data, at, order)
                at, kind = _number(data, at, order)
                at = _after_text(data, at, order) if kind == _TEXT else at + _SIZES[kind]
    except (struct.error, KeyError):
        return -1
    return at


def _number(data: bytes, at: int, order: str) -> tuple[int, int]:
    return at + 4, struct.unpack_from(f"{order}I", data, at)[0]


def _after_text(data: bytes, at: int, order: str) -> int:
    at, n_bytes = _number(data, at, order)
    return at + n_bytes


# NI TDMS logs, through npTDMS.
#
# The format:
# https://www.ni.com/en/support/documentation/supplemental/07/tdms-file-format-internal-structure.html.
# Traps. There are no checksums: a flipped bit in a value is a value, which a note says. npTDMS
# reads what is left of a cut file without a word, so the bytes of the values read are counted
# against the segments (`damperfit.io.groups`). A kind of number that is misread, as 8-byte floats
# for 8-byte integers, gives integers that no measurement has: beyond 2^53 they are refused. Lengths
# may be anything up to 2^64.

_MAX_WHOLE = 1 << 53  # the last up to which a float is exact
_UNITS = ("unit_string", "unit", "NI_UnitDescription", "Unit")
_NO_CHECKSUMS = "TDMS has no checksums: a damaged value could not be seen"


def read_tdms(source: Source, options: ReadOptions) -> tuple[Table, ...]:
    """Return a table for each group that is a test.

    Raises
    ------
    LogError
        The file is cut (and that is not allowed) or damaged, or claims more than it holds; or
        npTDMS is not installed.
    """
    name = source.name
    extent = find_extent(source.data, name=name)
    nptdms = load_library("nptdms", extra="tdms", reads="TDMS", name=name)
    with refusing_damage("TDMS file", name=name):
        lengths = _lengths(nptdms, source.data)
        n_values = sum(lengths.values())
        check_size(n_values, limit=options.max_bytes, what="the file", name=name)
        if n_values > 8 * extent.n_stored:
            raise LogError(
                f"damaged TDMS file: {n_values} values are declared, but only "
                f"{extent.n_stored} bytes are there; copy the log again",
                subject=name,
            )
        lost = _lost(nptdms, source.data, extent, lengths, limit=options.max_bytes)
        if lost and not options.allow_truncated:
            raise LogError(
                f"truncated TDMS file: {lost}; copy the log again, or keep what all "
                "channels have by {allow_truncated}",
                allow_truncated=Option("allow_truncated"),
                subject=name,
            )
        file = nptdms.TdmsFile.read(io.BytesIO(source.data))
        groups = [_group(group, file, name, is_cut=bool(lost)) for group in file.groups()]
        n_read = sum(_n_bytes(channel) for group in file.groups() for channel in group.channels())
    if n_read > extent.n_stored or (n_read < extent.n_stored and not lost):
        raise LogError(
            f"truncated or damaged TDMS file: {extent.n_stored} bytes of values are "
            f"declared but {n_read} can be read; copy the log again",
            subject=name,
        )
    tables = group_tables(groups, options, name=name, notes=(_NO_CHECKSUMS,))
    if not lost:
        return tables
    cut = Finding("truncated", "warning", f"the end of the file is missing: {lost}")
    return tuple(replace(table, findings=(cut,)) for table in tables)


def _lengths(nptdms: Any, data: bytes) -> dict[tuple[str, str], int]:
    """Return how many values each channel has, by names of group and channel."""
    metadata = nptdms.TdmsFile.read_metadata(io.BytesIO(data))
    return {
        (str(group.name), str(channel.name)): len(channel)
        for group in metadata.groups()
        for channel in group.channels()
    }


def _lost(
    nptdms: Any,
    data: bytes,
    extent: Extent,
    held: Mapping[tuple[str, str], int],
    *,
    limit: int,
) -> str:
    """Return what a cut file has lost, in words; empty when it is whole.

    npTDMS says how long channels were meant to be when the missing bytes are put back as zeros.
    """
    if extent.cut_at < 0:
        return ""
    where = f"the segment at byte {extent.cut_at} is not whole"
    if extent.n_missing < 0:
        found = ", ".join(f"{visible(name)} has {n}" for (_, name), n in [*held.items()][:10])
        return f"{where} and how much is missing is not known; values left: {found or 'none'}"
    if len(data) + extent.n_missing > limit:
        return f"{where}; {extent.n_missing} bytes are missing"
    whole = _lengths(nptdms, data + bytes(extent.n_missing))
    counts = {name: (n - held.get(name, 0), n) for name, n in whole.items()}
    shown = [f"{visible(name)} lost {k} of {n}" for (_, name), (k, n) in counts.items() if k]
    return f"{where}; values: {', '.join(shown[:10]) or 'none lost'}"


def _n_bytes(channel: Any) -> int:
    """Return how many bytes the values of a channel take in the file."""
    values = channel[:]
    size = getattr(channel.data_type, "size", None)
    if size is not None:
        return int(size) * len(values)
    return sum(4 + len(str(text).encode("utf-8")) for text in values)  # an offset and the text


def _group(group: Any, file: Any, name: str, *, is_cut: bool) -> Group:
    metadata = {**_texts(file.properties), **_texts(group.properties)}
    channels = tuple(_channel(channel, name) for channel in group.channels() if _is_number(channel))
    return Group(str(group.name), channels, metadata, is_cut=is_cut)


def _is_number(channel: Any) -> bool:
    return channel.dtype.kind in "fiuM" and len(channel) > 0


def _channel(channel: Any, name: str) -> GroupChannel:
    properties = channel.properties
    units = [str(properties[key]) for key in _UNITS if properties.get(key)]
    interval = properties.get("wf_increment")
    is_stamps = channel.dtype.kind == "M"
    return GroupChannel(
        name=str(channel.name),
        unit="s" if is_stamps else next(iter(units), None),
        length=len(channel),
        load=lambda: _floats(channel[:], f"{name}: {visible(str(channel.name))}"),
        start=float(properties.get("wf_start_offset", 0.0)),
        interval=None if interval is None else float(interval),
    )


def _floats(values: NDArray[Any], where: str) -> FloatArray:
    is_whole = values.dtype.kind in "iu" and values.dtype.itemsize == 8
    if is_whole and len(values) and max(-int(values.min()), int(values.max())) > _MAX_WHOLE:
        raise LogError(
            f"{where} holds whole numbers beyond {_MAX_WHOLE}, which no measurement has; its data "
            "type may be damaged: copy the log again"
        )
    if values.dtype.kind == "M":
        return np.asarray((values - values[0]) / np.timedelta64(1, "ns") * 1e-9, dtype=np.float64)
    return np.asarray(values, dtype=np.float64)


def _texts(properties: Mapping[str, Any]) -> dict[str, str]:
    return {str(key).lower(): str(value)[:1000] for key, value in properties.items()}


# ASAM MDF logs of version 4, through asammdf.
#
# The format: https://www.asam.net/standards/detail/mdf/. Blocks "##XX" of a length and links to
# others start at byte 64. The chains of links are walked before asammdf sees the file, as a damaged
# one may lead back into itself.

_MDF = ChildReader("MDF", "mdf", "asammdf", f"{__name__}:mdf_groups")
_FIRST_BLOCK = 64
_MAX_BLOCKS = 1_000_000
_UNPACKED_SIZE = 24 + 8  # of a ##DZ block: where its unpacked length stands


def read_mdf(source: Source, options: ReadOptions) -> tuple[Table, ...]:
    """Return a table for each channel group that is a test.

    Raises
    ------
    LogError
        The file is cut or damaged, of an older version, or claims more than the limit; or asammdf
        is not installed.
    """
    name = source.name
    if not source.data[8:16].startswith(b"4."):
        version = source.data[8:16].decode("latin-1").strip("\0 ")
        raise LogError(f"MDF version {version!r}; expected 4, convert the log", subject=name)
    if source.data.startswith(b"UnFinMF"):
        raise LogError("truncated MDF file: the recording was not finished", subject=name)
    _check_blocks(source.data, name=name, limit=options.max_bytes)
    groups = read_groups_in_child(_MDF, source, options)
    return group_tables(groups, options, name=name)


def mdf_groups(data: bytes, limit: int) -> ChildAnswer:
    """Return the channel groups of a file; runs in a process of its own.

    Raises
    ------
    LogError
        The file is damaged or claims more than the limit.
    """
    import asammdf

    with refusing_damage(_MDF.reads):
        file = asammdf.MDF(io.BytesIO(data), remove_source_from_channel_names=True)
        _check_rows(file, limit)
        return groups_answer([_mdf_group(file, index) for index in range(len(file.groups))])


def _check_rows(file: Any, limit: int) -> None:
    for group in file.groups:
        n_rows = int(group.channel_group.cycles_nr)
        n_bytes = n_rows * 8 * max(len(group.channels), 1)
        check_size(n_bytes, limit=limit, what="a channel group")


def _mdf_group(file: Any, index: int) -> Group:
    master = file.masters_db.get(index)
    n_rows = int(file.groups[index].channel_group.cycles_nr)
    channels: list[GroupChannel] = []
    for i, channel in enumerate(file.groups[index].channels):
        if i == master:
            continue
        signal = file.get(group=index, index=i)
        if signal.samples.dtype.kind not in "fiu" or signal.samples.ndim != 1:
            continue
        if not channels:
            channels.append(_loaded("time", "s", n_rows, signal.timestamps))
        channels.append(
            _loaded(str(channel.name), str(signal.unit) or None, n_rows, signal.samples)
        )
    name = str(getattr(file.groups[index].channel_group, "acq_name", "") or f"group {index + 1}")
    return Group(name, tuple(channels))


def _loaded(name: str, unit: str | None, length: int, values: Any) -> GroupChannel:
    held = np.asarray(values, dtype=np.float64)
    return GroupChannel(name, unit, length, lambda: held)


def _check_blocks(data: bytes, *, name: str, limit: int) -> None:
    """Walk every block once: whole, in the file, and no chain of successors that bites its tail."""
    successors: dict[int, int] = {}
    waiting = [_FIRST_BLOCK]
    unpacked = 0
    while waiting:
        at = waiting.pop()
        if at in successors:
            continue
        kind, links = _block(data, at, name)
        if kind == b"##DZ":
            unpacked += struct.unpack_from("<Q", data, at + _UNPACKED_SIZE)[0]
        successors[at] = links[0] if links and kind in _CHAINED else 0
        waiting += [link for link in links if link]
        _refuse_many(len(successors), name)
    check_size(unpacked, limit=limit, what="the MDF file", name=name)
    for start in _ring(successors):
        raise LogError(f"damaged MDF file: the block at byte {start} leads to itself", subject=name)


def _refuse_many(n_blocks: int, name: str) -> None:
    if n_blocks > _MAX_BLOCKS:
        raise LogError(f"more than {_MAX_BLOCKS} blocks in the MDF file", subject=name)


_CHAINED = (b"##DG", b"##CG", b"##CN", b"##DL", b"##HL", b"##FH", b"##AT", b"##EV", b"##CH")


def _block(data: bytes, at: int, name: str) -> tuple[bytes, tuple[int, ...]]:
    if at + 24 > len(data):
        raise LogError("truncated MDF file; the end of the file is missing", subject=name)
    kind = data[at : at + 4]
    length, n_links = struct.unpack_from("<QQ", data, at + 8)
    if not kind.startswith(b"##") or length < 24 + 8 * n_links:
        raise LogError(f"damaged MDF file: no block at byte {at}; copy the log again", subject=name)
    if at + length > len(data):
        raise LogError(f"truncated MDF file; the block at byte {at} is not whole", subject=name)
    return kind, struct.unpack_from(f"<{n_links}Q", data, at + 24)


def _ring(successors: dict[int, int]) -> Iterator[int]:
    """Yield a block of each chain that comes back to itself."""
    done: set[int] = set()
    for start in successors:
        chain: dict[int, None] = {}
        at = start
        while at and at not in done and at not in chain:
            chain[at] = None
            at = successors.get(at, 0)
        if at in chain:
            yield at
        done.update(chain)


# MATLAB files: vectors of numbers beside what scripts left over.
#
# Up to version 7 (https://www.mathworks.com/help/pdf_doc/matlab/matfile_format.pdf) SciPy reads
# them, version 7.3, which is HDF5, h5py: both in a child, for one damaged byte ends SciPy's reader
# by a segmentation fault, and makes HDF5 take all memory there is. Sizes are checked before values
# are read: 0.4 MB may unpack to 400 MB, and a data set may claim terabytes of which nothing is
# stored. Only arrays of real numbers at the top are looked at, no cells, structures or objects; a
# link, and the values of a data set, may lead into another file, and neither is followed.

_MAT = ChildReader("MATLAB", "", "scipy", f"{__name__}:matlab_vectors")
_MAT73 = ChildReader("MATLAB 7.3", "mat73", "h5py", f"{__name__}:hdf5_vectors")
_MAX_ITEMS = 10_000
_MAX_COLUMNS = 64  # of a matrix that is read as channels side by side
_MAT_TYPES = {"int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64"}
_MAT_TYPES |= {"single", "double"}
_NO_NUMBERS = (b"char", b"logical", b"cell", b"struct", b"function_handle")


def read_matlab(source: Source, options: ReadOptions) -> tuple[Table, ...]:
    """Return the table of a MATLAB file: its vectors of the commonest length.

    A matrix ``x_F`` of three columns gives the columns ``x_F:1``, ``x_F:2`` and ``x_F:3``.

    Raises
    ------
    LogError
        The file is cut or damaged, claims more than the limit, or holds no vectors of numbers; or
        h5py, which version 7.3 needs, is not installed.
    """
    is_old = source.data.startswith(b"MATLAB 5.0")
    if is_old and not _is_whole(source.data):  # SciPy reads what is left without a word
        raise LogError(
            "truncated MATLAB file; the end is missing, or it is damaged", subject=source.name
        )
    (group,) = read_groups_in_child(_MAT if is_old else _MAT73, source, options)
    others = dict(group.metadata)  # name -> what it is instead
    lengths = [channel.length for channel in group.channels]
    usual = max(set(lengths), key=lambda n: (lengths.count(n), n), default=0)
    if is_old and not lengths:
        held = ", ".join(f"{visible(key)} ({kind})" for key, kind in [*others.items()][:10])
        struct = next((visible(key) for key, kind in others.items() if kind == "struct"), "")
        advice = (
            f"; save its fields as variables: save(file, '-struct', {struct})" if struct else ""
        )
        raise LogError(
            f"no vectors of numbers; the file holds {held or 'nothing'}{advice}",
            subject=source.name,
        )
    used = tuple(channel for channel in group.channels if channel.length == usual)
    rest = {channel.name.partition(":")[0] for channel in group.channels}
    n_others = len(others) + len(rest - {channel.name.partition(":")[0] for channel in used})
    note = f"{n_others} variables left out; they are not vectors of {usual} numbers"
    table = group_tables([Group("", used)], options, name=source.name)
    return tuple(replace(one, notes=(note,) * (n_others > 0) + one.notes) for one in table)


def _is_whole(data: bytes) -> bool:
    """Whether a file up to version 7 ends where its last variable does."""
    order, at = "<" if data[126:128] == b"IM" else ">", 128
    while at + 8 <= len(data):
        kind, n_bytes = struct.unpack_from(f"{order}II", data, at)
        at += 4 + 4 if kind >> 16 else 8 + n_bytes
    return at == len(data)


def matlab_vectors(data: bytes, limit: int) -> ChildAnswer:
    """Return the vectors of a MATLAB file up to version 7, and what else it holds; in a child.

    Raises
    ------
    LogError
        The file is cut or damaged, or claims more than the limit.
    """
    scipy_io: Any = importlib.import_module("scipy.io")

    channels: list[GroupChannel] = []
    others: dict[str, str] = {}
    with refusing_damage("MATLAB file"), catch_warnings():
        simplefilter("error")  # a variable that is there twice
        kinds = {name: (shape, kind) for name, shape, kind in scipy_io.whosmat(io.BytesIO(data))}
        wanted = [
            name
            for name, (shape, kind) in kinds.items()
            if kind in _MAT_TYPES and _columns_of(shape[::-1])
        ]
        n_values = sum(math.prod(kinds[name][0]) for name in wanted)
        check_size(8 * n_values, limit=limit, what="the file")
        held = scipy_io.loadmat(io.BytesIO(data), variable_names=wanted) if wanted else {}
        for name, (_, kind) in kinds.items():
            if name in wanted and held[name].dtype.kind in "fiu":
                channels += _vectors(name, held[name].T)
            else:
                others[name] = "complex numbers" if name in wanted else _kind(kind)
    return groups_answer([Group("", tuple(channels), others)])


def _kind(kind: str) -> str:
    return "numbers" if kind in _MAT_TYPES else kind


def hdf5_vectors(data: bytes, limit: int) -> ChildAnswer:
    """Return the vectors at the top of a MATLAB file of version 7.3; in a child.

    Raises
    ------
    LogError
        The file is damaged or claims more than the limit.
    """
    h5py = importlib.import_module("h5py")
    channels: list[GroupChannel] = []
    with refusing_damage(_MAT73.reads), h5py.File(io.BytesIO(data), "r") as file:
        for key in islice(file, _MAX_ITEMS):
            # A link into another file would read what nobody gave; it must not even be followed.
            is_own = isinstance(file.get(key, getlink=True), h5py.HardLink)
            if (
                is_own
                and file.get(key, getclass=True) is h5py.Dataset
                and _holds_numbers(file[key])
            ):
                n_values = sum(channel.length for channel in channels) + file[key].size
                check_size(8 * n_values, limit=limit, what=f"the file up to {visible(str(key))}")
                channels += _vectors(str(key), file[key][()])
    return groups_answer([Group("", tuple(channels))])


def _holds_numbers(data: Any) -> bool:
    """Whether a data set holds vectors, and holds them itself."""
    kind = data.attrs.get("MATLAB_class", b"")  # text is an array of 16-bit numbers otherwise
    is_number = data.dtype.kind in "fiu" and kind not in _NO_NUMBERS
    if not is_number or data.ndim != 2 or not _columns_of(data.shape):
        return False
    return not (data.id.get_create_plist().get_external_count() or data.is_virtual)


def _columns_of(shape: Sequence[int]) -> int:
    """Return the channels in an array of (columns, rows), as HDF5 has MATLAB's; 0: none."""
    if len(shape) != 2 or min(shape) < 1 or max(shape) < 2:
        return 0
    if min(shape) == 1:
        return 1
    return shape[0] if shape[0] < shape[1] and shape[0] <= _MAX_COLUMNS else 0


def _vectors(name: str, values: NDArray[Any]) -> list[GroupChannel]:
    columns = np.asarray(values, dtype=np.float64).reshape(_columns_of(values.shape), -1)
    names = [name] if len(columns) == 1 else [f"{name}:{i + 1}" for i in range(len(columns))]
    return [
        GroupChannel(label, None, len(column), partial(np.ascontiguousarray, column))
        for label, column in zip(names, columns, strict=True)
    ]
