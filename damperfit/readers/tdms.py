"""NI TDMS logs, through npTDMS.

The format: https://www.ni.com/en/support/documentation/supplemental/07/tdms-file-format-internal-structure.html.
Traps. There are no checksums: a flipped bit in a value is a value, which a note says. npTDMS reads
what is left of a cut file without a word, so the bytes of the values read are counted against the
segments (`damperfit.readers.tdms_segments`). A kind of number that is misread, as 8-byte floats for
8-byte integers, gives integers that no measurement has: beyond 2^53 they are refused. Lengths may
be anything up to 2^64.
"""

from __future__ import annotations

import io
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit.errors import LogError
from damperfit.readers.channels import visible
from damperfit.readers.foreign import check_size, load_library, refusing_damage
from damperfit.readers.grouping import Group, GroupChannel, group_tables
from damperfit.readers.tdms_segments import Extent, find_extent
from damperfit.recording import Finding

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from damperfit.readers.files import Source
    from damperfit.readers.options import ReadOptions
    from damperfit.readers.table import Table

    FloatArray = NDArray[np.float64]

__all__ = ["read_tdms"]

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
                f"{name}: damaged TDMS file: {n_values} values are declared, but only "
                f"{extent.n_stored} bytes are there; copy the log again"
            )
        lost = _lost(nptdms, source.data, extent, lengths, limit=options.max_bytes)
        if lost and not options.allow_truncated:
            raise LogError(
                f"{name}: truncated TDMS file: {lost}; copy the log again, or keep what all "
                "channels have by --allow-truncated"
            )
        file = nptdms.TdmsFile.read(io.BytesIO(source.data))
        groups = [_group(group, file, name, is_cut=bool(lost)) for group in file.groups()]
        n_read = sum(_n_bytes(channel) for group in file.groups() for channel in group.channels())
    if n_read > extent.n_stored or (n_read < extent.n_stored and not lost):
        raise LogError(
            f"{name}: truncated or damaged TDMS file: {extent.n_stored} bytes of values are "
            f"declared but {n_read} can be read; copy the log again"
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
