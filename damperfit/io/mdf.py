"""ASAM MDF logs of version 4, through asammdf.

The format: https://www.asam.net/standards/detail/mdf/. Blocks "##XX" of a length and links to
others start at byte 64. The chains of links are walked before asammdf sees the file, as a damaged
one may lead back into itself, or end in the middle of a block.
"""

from __future__ import annotations

import io
import struct
from functools import partial
from typing import Any

import numpy as np

from damperfit.errors import LogError
from damperfit.io.child_process import ChildAnswer, ChildReader, check_size, refusing_damage
from damperfit.io.files import Source
from damperfit.io.formats import Table
from damperfit.io.groups import (
    Group,
    GroupChannel,
    answer_of_groups,
    group_tables,
    groups_of_child,
)
from damperfit.io.options import ReadOptions

__all__ = ["read_mdf"]

_MDF = ChildReader("MDF", "mdf", "asammdf", f"{__name__}:mdf_groups")
_FIRST_BLOCK = 64
_MAX_BLOCKS = 1_000_000
_UNPACKED_SIZE = 24 + 8  # of a ##DZ block: where its unpacked length stands
_CHAINED = (b"##DG", b"##CG", b"##CN", b"##DL", b"##HL", b"##FH", b"##AT", b"##EV", b"##CH")


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
    return group_tables(groups_of_child(_MDF, source, options), options, name=name)


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
        for group in file.groups:
            n_bytes = int(group.channel_group.cycles_nr) * 8 * max(len(group.channels), 1)
            check_size(n_bytes, limit=limit, what="a channel group")
        return answer_of_groups([_group(file, index) for index in range(len(file.groups))])


def _group(file: Any, index: int) -> Group:
    held = file.groups[index]
    n_rows = int(held.channel_group.cycles_nr)
    channels: list[GroupChannel] = []
    for i, channel in enumerate(held.channels):
        if i == file.masters_db.get(index):
            continue
        signal = file.get(group=index, index=i)
        if signal.samples.dtype.kind not in "fiu" or signal.samples.ndim != 1:
            continue
        if not channels:
            time = partial(np.asarray, signal.timestamps)
            channels.append(GroupChannel("time", "s", n_rows, time))
        unit, values = str(signal.unit) or None, partial(np.asarray, signal.samples)
        channels.append(GroupChannel(str(channel.name), unit, n_rows, values))
    name = str(getattr(held.channel_group, "acq_name", "") or f"group {index + 1}")
    return Group(name, tuple(channels))


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
        if len(successors) > _MAX_BLOCKS:
            raise LogError(f"more than {_MAX_BLOCKS} blocks in the MDF file", subject=name)
    check_size(unpacked, limit=limit, what="the MDF file", name=name)
    done: set[int] = {0}
    for start in successors:
        chain: set[int] = set()
        at = start
        while at not in done and at not in chain:
            chain.add(at)
            at = successors.get(at, 0)
        if at in chain:
            raise LogError(
                f"damaged MDF file: the block at byte {at} leads to itself", subject=name
            )
        done |= chain


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
