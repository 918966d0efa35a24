"""NI TDMS logs, through npTDMS.

The format: https://www.ni.com/en/support/documentation/supplemental/07/tdms-file-format-internal-structure.html.
A file is a row of segments. Each starts with 28 bytes: "TDSm", contents, version, bytes to the
next segment, bytes to its values; then what its channels are, then their values.

Traps. There are no checksums: a flipped bit in a value is a value, which a note says. npTDMS reads
what is left of a cut file without a word, so the bytes of the values read are counted against the
segments; a file cut between two segments is whole and cannot be told from one. A rig that stops
while writing leaves a segment without an end. Lengths may be anything up to 2^64.
"""

from __future__ import annotations

import io
import struct
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit.errors import LogError
from damperfit.readers.channels import visible
from damperfit.readers.foreign import check_size, load_library, refusing_damage
from damperfit.readers.grouping import Group, GroupChannel, group_tables

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from damperfit.readers.files import Source
    from damperfit.readers.options import ReadOptions
    from damperfit.readers.table import Table

    FloatArray = NDArray[np.float64]

__all__ = ["read_tdms"]

_LEAD_IN = 28
_HAS_VALUES, _IS_BIG_ENDIAN, _IS_DAQMX = 1 << 3, 1 << 6, 1 << 7  # bits of the contents
_OPEN = 0xFFFF_FFFF_FFFF_FFFF  # length of a segment that was never closed
_UNITS = ("unit_string", "unit", "NI_UnitDescription", "Unit")
_NO_CHECKSUMS = "TDMS has no checksums: a damaged value could not be seen"


@dataclass(frozen=True, slots=True)
class _Extent:
    """How much of the file is there."""

    n_stored: int  # bytes of values in the file
    cut_at: int = -1  # where the segment starts that is not whole; -1: all are
    n_missing: int = 0  # bytes of that segment; -1: nothing tells how many


def read_tdms(source: Source, options: ReadOptions) -> tuple[Table, ...]:
    """Return a table for each group that is a test.

    Raises
    ------
    LogError
        The file is cut (and that is not allowed) or damaged, or claims more than it holds; or
        npTDMS is not installed.
    """
    name = source.name
    extent = _extent(source.data, name=name)
    nptdms = load_library("nptdms", extra="tdms", reads="TDMS", name=name)
    with refusing_damage("TDMS file", name=name):
        lengths = _lengths(nptdms, source.data)
        limit = min(options.max_bytes, 8 * extent.n_stored)
        check_size(sum(lengths.values()), limit=limit, what="values", name=name)
        lost = _lost(nptdms, source.data, extent, lengths, limit=options.max_bytes)
        if lost and not options.allow_truncated:
            raise LogError(
                f"{name}: truncated TDMS file: {lost}; copy the log again, or keep what all "
                "channels have by --allow-truncated"
            )
        file = nptdms.TdmsFile.read(io.BytesIO(source.data))
        groups = [_group(group, file.properties, is_cut=bool(lost)) for group in file.groups()]
        n_read = sum(_n_bytes(channel) for group in file.groups() for channel in group.channels())
    if n_read > extent.n_stored or (n_read < extent.n_stored and not lost):
        raise LogError(
            f"{name}: truncated or damaged TDMS file: {extent.n_stored} bytes of values are "
            f"announced and {n_read} can be read; copy the log again"
        )
    notes = (_NO_CHECKSUMS, *((f"truncated: {lost}",) if lost else ()))
    return group_tables(groups, options, name=name, notes=notes)


def _extent(data: bytes, *, name: str) -> _Extent:
    """Return how many bytes of values the segments hold, and whether the last one is whole."""
    at = total = 0
    while at < len(data):
        if at + _LEAD_IN > len(data) and b"TDSm".startswith(data[at : at + 4]) and at:
            return _Extent(total, at, -1)
        if at + _LEAD_IN > len(data) or data[at : at + 4] != b"TDSm":
            raise LogError(f"{name}: truncated or damaged TDMS file: no segment at byte {at}")
        (contents,) = struct.unpack_from("<I", data, at + 4)
        order = ">" if contents & _IS_BIG_ENDIAN else "<"
        _, n_bytes, n_before_values = struct.unpack_from(f"{order}IQQ", data, at + 8)
        if contents & _IS_DAQMX:
            raise LogError(f"{name}: raw DAQmx values in TDMS are not supported; export as CSV")
        values_at, end = at + _LEAD_IN + n_before_values, at + _LEAD_IN + n_bytes
        if n_bytes == _OPEN or end > len(data):
            has_values = contents & _HAS_VALUES and values_at <= len(data)
            held = len(data) - values_at if has_values else 0
            is_known = n_bytes != _OPEN and values_at <= len(data)
            return _Extent(total + held, at, end - len(data) if is_known else -1)
        is_sound = values_at <= end if contents & _HAS_VALUES else values_at == end
        if not is_sound:
            raise LogError(
                f"{name}: damaged TDMS file: the segment at byte {at} contradicts itself"
            )
        total += end - values_at
        at = end
    return _Extent(total)


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
    extent: _Extent,
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
        return f"{where} and nothing tells how much is missing; values left: {found or 'none'}"
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


def _group(group: Any, properties: Mapping[str, Any], *, is_cut: bool) -> Group:
    metadata = {**_texts(properties), **_texts(group.properties)}
    channels = tuple(_channel(channel) for channel in group.channels() if _is_number(channel))
    return Group(str(group.name), channels, metadata, is_cut=is_cut)


def _is_number(channel: Any) -> bool:
    return channel.dtype.kind in "fiuM" and len(channel) > 0


def _channel(channel: Any) -> GroupChannel:
    properties = channel.properties
    units = [str(properties[key]) for key in _UNITS if properties.get(key)]
    interval = properties.get("wf_increment")
    is_stamps = channel.dtype.kind == "M"
    return GroupChannel(
        name=str(channel.name),
        unit="s" if is_stamps else next(iter(units), None),
        length=len(channel),
        load=lambda: _floats(channel[:]),
        start=float(properties.get("wf_start_offset", 0.0)),
        interval=None if interval is None else float(interval),
    )


def _floats(values: NDArray[Any]) -> FloatArray:
    if values.dtype.kind == "M":
        return np.asarray((values - values[0]) / np.timedelta64(1, "ns") * 1e-9, dtype=np.float64)
    return np.asarray(values, dtype=np.float64)


def _texts(properties: Mapping[str, Any]) -> dict[str, str]:
    return {str(key).lower(): str(value)[:1000] for key, value in properties.items()}
