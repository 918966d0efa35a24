"""NI TDMS logs, through npTDMS.

The format: https://www.ni.com/en/support/documentation/supplemental/07/tdms-file-format-internal-structure.html.
A file is a row of segments; each starts with 28 bytes: "TDSm", contents, version, bytes to the
next segment, bytes to its values. The format has no checksums, and npTDMS reads what is left of a
cut file without a word, so the bytes of the values read are counted against the segments.
"""

from __future__ import annotations

import io
import struct
from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit.errors import LogError
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


def read_tdms(source: Source, options: ReadOptions) -> tuple[Table, ...]:
    """Return a table for each group that is a test.

    Raises
    ------
    LogError
        The file is cut or damaged, or claims more than it holds; or npTDMS is not installed.
    """
    name = source.name
    n_stored = _stored_bytes(source.data, name=name)
    nptdms = load_library("nptdms", extra="tdms", reads="TDMS", name=name)
    with refusing_damage("TDMS file", name=name):
        metadata = nptdms.TdmsFile.read_metadata(io.BytesIO(source.data))
        claimed = sum(len(channel) for group in metadata.groups() for channel in group.channels())
        check_size(claimed, limit=min(options.max_bytes, 8 * n_stored), what="values", name=name)
        file = nptdms.TdmsFile.read(io.BytesIO(source.data))
        groups = [_group(group, file.properties) for group in file.groups()]
        n_read = sum(_n_bytes(channel) for group in file.groups() for channel in group.channels())
    if n_read != n_stored:
        raise LogError(
            f"{name}: truncated or damaged TDMS file: {n_stored} bytes of values are announced "
            f"and {n_read} can be read; copy the log again"
        )
    return group_tables(groups, options, name=name)


def _stored_bytes(data: bytes, *, name: str) -> int:
    """Return how many bytes of values the segments hold; refuse segments that are not whole."""
    at = total = 0
    while at < len(data):
        if at + _LEAD_IN > len(data) or data[at : at + 4] != b"TDSm":
            raise LogError(f"{name}: truncated or damaged TDMS file: no segment at byte {at}")
        (contents,) = struct.unpack_from("<I", data, at + 4)
        order = ">" if contents & _IS_BIG_ENDIAN else "<"
        _, n_bytes, n_before_values = struct.unpack_from(f"{order}IQQ", data, at + 8)
        if contents & _IS_DAQMX:
            raise LogError(f"{name}: raw DAQmx values in TDMS are not supported; export as CSV")
        end = at + _LEAD_IN + n_bytes
        if n_bytes == _OPEN or end > len(data) or n_before_values > n_bytes:
            raise LogError(
                f"{name}: truncated TDMS file: the segment at byte {at} is not whole; "
                "copy the log again"
            )
        if contents & _HAS_VALUES:
            total += n_bytes - n_before_values
        elif n_before_values != n_bytes:
            raise LogError(
                f"{name}: damaged TDMS file: the segment at byte {at} contradicts itself"
            )
        at = end
    return total


def _n_bytes(channel: Any) -> int:
    """Return how many bytes the values of a channel take in the file."""
    values = channel[:]
    size = getattr(channel.data_type, "size", None)
    if size is not None:
        return int(size) * len(values)
    return sum(4 + len(str(text).encode("utf-8")) for text in values)  # an offset and the text


def _group(group: Any, properties: Mapping[str, Any]) -> Group:
    metadata = {**_texts(properties), **_texts(group.properties)}
    channels = tuple(_channel(channel) for channel in group.channels() if _is_number(channel))
    return Group(str(group.name), channels, metadata)


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
