"""ASAM MDF logs of version 4, through asammdf.

The format: https://www.asam.net/standards/detail/mdf/. Blocks "##XX" of a length and links to
others start at byte 64. The chains of links are walked before asammdf sees the file, as a damaged
one may lead back into itself.
"""

from __future__ import annotations

import io
import struct
from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit.errors import LogError
from damperfit.readers.child_process import ChildAnswer
from damperfit.readers.foreign import check_size, refusing_damage
from damperfit.readers.grouping import (
    Group,
    GroupChannel,
    group_tables,
    groups_answer,
    read_groups_in_child,
)

if TYPE_CHECKING:
    from collections.abc import Iterator

    from damperfit.readers.files import Source
    from damperfit.readers.options import ReadOptions
    from damperfit.readers.table import Table

__all__ = ["EXTRA", "IS_MEMORY_SAFE", "READS", "answer", "read_mdf"]

EXTRA, READS = "mdf", "MDF"
IS_MEMORY_SAFE = False

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
        raise LogError(f"{name}: MDF version {version!r}; expected 4, convert the log")
    if source.data.startswith(b"UnFinMF"):
        raise LogError(f"{name}: truncated MDF file: the recording was not finished")
    _check_blocks(source.data, name=name, limit=options.max_bytes)
    groups = read_groups_in_child(__name__, "asammdf", source, options)
    return group_tables(groups, options, name=name)


def answer(data: bytes, limit: int) -> ChildAnswer:
    """Return the channel groups of a file; runs in a process of its own.

    Raises
    ------
    LogError
        The file is damaged or claims more than the limit.
    """
    import asammdf

    with refusing_damage(READS):
        file = asammdf.MDF(io.BytesIO(data), remove_source_from_channel_names=True)
        _check_rows(file, limit)
        return groups_answer([_group(file, index) for index in range(len(file.groups))])


def _check_rows(file: Any, limit: int) -> None:
    for group in file.groups:
        n_rows = int(group.channel_group.cycles_nr)
        n_bytes = n_rows * 8 * max(len(group.channels), 1)
        check_size(n_bytes, limit=limit, what="a channel group")


def _group(file: Any, index: int) -> Group:
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
        raise LogError(f"{name}: damaged MDF file: the block at byte {start} leads to itself")


def _refuse_many(n_blocks: int, name: str) -> None:
    if n_blocks > _MAX_BLOCKS:
        raise LogError(f"{name}: more than {_MAX_BLOCKS} blocks in the MDF file")


_CHAINED = (b"##DG", b"##CG", b"##CN", b"##DL", b"##HL", b"##FH", b"##AT", b"##EV", b"##CH")


def _block(data: bytes, at: int, name: str) -> tuple[bytes, tuple[int, ...]]:
    if at + 24 > len(data):
        raise LogError(f"{name}: truncated MDF file; the end of the file is missing")
    kind = data[at : at + 4]
    length, n_links = struct.unpack_from("<QQ", data, at + 8)
    if not kind.startswith(b"##") or length < 24 + 8 * n_links:
        raise LogError(f"{name}: damaged MDF file: no block at byte {at}; copy the log again")
    if at + length > len(data):
        raise LogError(f"{name}: truncated MDF file; the block at byte {at} is not whole")
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
