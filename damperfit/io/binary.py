"""Parquet and NI TDMS: binary logs that are read in this process.

Parquet (https://parquet.apache.org/docs/file-format/): "PAR1", then pages of values, each behind a
header, then a footer that says where everything is, its length, and "PAR1". Units are in names or
in the metadata of fields. Page checksums are verified by pyarrow only when asked, and writers write
them only when asked (pandas does not): without them a flipped bit changes a value unnoticed, and a
note says so. The footer has no checksum, so what it states twice is compared. A megabyte may hold
10^8 rows: rows are counted before any is read. Times may be stamps.

TDMS (https://www.ni.com/en/support/documentation/supplemental/07/tdms-file-format-internal-structure.html)
through npTDMS, after a check of the file's segments. Each starts with 28 bytes: "TDSm", contents,
version, bytes to the next segment, bytes to its values. Then its channels are described, then come
their values. There are no checksums: a flipped bit in a value is a value. A damaged length moves
the values by some bytes, and npTDMS reads on: so the description of the channels is walked here,
and must end where the values begin, but for zeros that fill up a disk's sector. A rig that stops
while writing leaves a segment whose length is 2^64 - 1. A file cut between two segments looks
whole. npTDMS reads a cut file without an error, so the bytes of the values read are compared with
the segments. A kind of number that is misread, as 8-byte floats for 8-byte integers, gives integers
that no measurement has: beyond 2^53 they are refused. Lengths may be anything up to 2^64.
"""

import io
import struct
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from damperfit.errors import LogError
from damperfit.io.child_process import check_size, load_library, refusing_damage
from damperfit.io.columns import visible
from damperfit.io.files import Source
from damperfit.io.formats import Column, FloatArray, Samples, Table
from damperfit.io.groups import Group, GroupChannel, group_tables
from damperfit.io.options import ReadOptions
from damperfit.problem import warning

_NEXT_NUMBER = b"\x15"
_NO_PAGE_CHECKSUMS = "Parquet without page checksums: a damaged value could not be seen"
_TICKS = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}  # in a second

_LEAD_IN = 28
# Bits of the contents.
_HAS_METADATA, _HAS_VALUES, _IS_BIG_ENDIAN, _IS_DAQMX = 1 << 1, 1 << 3, 1 << 6, 1 << 7
_OPEN = 0xFFFF_FFFF_FFFF_FFFF  # length of a segment that was never closed
_NO_VALUES, _AS_BEFORE = 0xFFFF_FFFF, 0  # length of the description of a channel's values
_TEXT = 0x20
# Kind of a property -> bytes: integers, floats (with a unit), bool, time stamp, complex.
_SIZES = {
    0: 0, 1: 1, 2: 2, 3: 4, 4: 8, 5: 1, 6: 2, 7: 4, 8: 8, 9: 4, 10: 8, 11: 16, 0x19: 4, 0x1A: 8,
    0x1B: 16, 0x21: 1, 0x44: 16, 0x08000C: 8, 0x10000D: 16,
}  # fmt: skip
_MAX_WHOLE = 1 << 53  # the last up to which a float is exact
_UNITS = ("unit_string", "unit", "NI_UnitDescription", "Unit")
_NO_CHECKSUMS = "TDMS has no checksums: a damaged value could not be seen"


# Parquet.


def read_parquet(source: Source, options: ReadOptions) -> tuple[Table, ...]:
    """Return the table of a Parquet log."""
    import pyarrow as pa
    from pyarrow import parquet, types

    if len(source.data) < 12 or not source.data.endswith(b"PAR1"):
        raise LogError("truncated Parquet; the end of the file is missing", code="truncated")
    with refusing_damage("Parquet"):
        file = parquet.ParquetFile(pa.BufferReader(source.data), page_checksum_verification=True)
        schema = file.schema_arrow
        metadata = _texts(schema.metadata)
        fields = [schema.field(i) for i in range(len(schema))]
    counts = [file.metadata.row_group(i).num_rows for i in range(file.metadata.num_row_groups)]
    n_declared = file.metadata.num_rows
    n_rows = max(n_declared, sum(max(n, 0) for n in counts))
    claimed = max(n_rows, 0) * 8 * 4  # four channels of float64 are all that is ever loaded
    check_size(claimed, limit=options.max_bytes, subject=f"a table of {n_rows} rows")
    columns = []
    for field in fields:
        texts = _texts(field.metadata)
        unit = "s" if types.is_duration(field.type) else texts.get("unit") or texts.get("units")
        columns.append(Column(field.name.strip(), unit, _is_clock(field.type)))

    def load(indices: Mapping[str, int]) -> Samples:
        for channel, index in indices.items():
            kind = fields[index].type
            is_number = types.is_integer(kind) or types.is_floating(kind) or types.is_decimal(kind)
            if not (is_number or _is_clock(kind) or types.is_duration(kind)):
                raise LogError(f"{channel} is of type {kind}, expected numbers", code="bad-row")
        names = {channel: fields[index].name for channel, index in indices.items()}
        with refusing_damage("Parquet"):
            table = file.read(columns=sorted(set(names.values())), use_threads=False)
            # The counts of the columns are not read: asking for a damaged one ends the process.
            if not n_declared == sum(counts) == table.num_rows:
                raise LogError(
                    f"damaged Parquet: {n_declared} rows are declared, {sum(counts)} held and "
                    f"{table.num_rows} read; copy the log again",
                    code="damaged",
                )
            table.validate(full=True)
            return Samples(
                {channel: _numbers(table.column(name)) for channel, name in names.items()}
            )

    notes = () if _has_checksums(source.data) else (_NO_PAGE_CHECKSUMS,)
    return (Table(tuple(columns), load, metadata, notes),)


def _has_checksums(data: bytes) -> bool:
    """Say whether the first page has a checksum; all pages come from one writer."""
    # A page header is in Thrift's compact form: each 32-bit number is 0x15 and the number in groups
    # of seven bits. The first three are kind and two sizes, the fourth is the checksum.
    at = len(b"PAR1")
    for _ in range(3):
        if data[at : at + 1] != _NEXT_NUMBER:
            return False
        at += 1
        while at < len(data) and data[at] & 0x80:
            at += 1
        at += 1
    return data[at : at + 1] == _NEXT_NUMBER


def _is_clock(kind: Any) -> bool:
    import pyarrow as pa

    return bool(pa.types.is_timestamp(kind) or pa.types.is_time(kind))


def _texts(metadata: Mapping[bytes, bytes] | None) -> dict[str, str]:
    """Return the short readable texts, keys in lower case."""
    return {
        key.decode("utf-8", "replace").lower(): value.decode("utf-8", "replace")
        for key, value in (metadata or {}).items()
        if len(value) <= 1000 and not key.startswith((b"ARROW:", b"PARQUET:", b"pandas"))
    }


def _numbers(column: Any) -> FloatArray:
    """Return numbers, durations in seconds, stamps and times of day in seconds from the first."""
    import pyarrow as pa

    # Differences are taken in whole ticks: as floats, stamps are good to 0.2 us only.
    kind = column.type
    if not (_is_clock(kind) or pa.types.is_duration(kind)):
        values = column.cast(pa.float64()).to_numpy(zero_copy_only=False)
        return np.asarray(values, dtype=np.float64)
    ticks = (column.cast(pa.int32()) if kind.bit_width == 32 else column).cast(pa.int64())
    is_known = np.asarray(column.is_valid().to_numpy(zero_copy_only=False), dtype=np.bool_)
    counts = ticks.fill_null(0).to_numpy().astype(np.int64)
    if not pa.types.is_duration(kind) and is_known.any():
        counts = counts - counts[np.argmax(is_known)]
    if pa.types.is_time(kind):  # each midnight begins the count anew
        day = np.int64(86_400 * _TICKS[kind.unit])
        counts[1:] += day * np.cumsum(np.diff(counts) < -day // 2)
    return np.where(is_known, counts / _TICKS[kind.unit], np.nan)


# TDMS.


class _Extent(NamedTuple):
    """Bytes of values in a file, and where it is cut."""

    n_stored: int  # of values in the file
    cut_at: int = -1  # where the segment starts that is not whole; -1: all are
    n_missing: int = 0  # of that segment; -1: not known


def read_tdms(source: Source, options: ReadOptions) -> tuple[Table, ...]:
    """Return a table for each group that is a test."""
    data = source.data
    extent = _extent(data)
    nptdms = load_library("nptdms", extra="tdms", reads="TDMS")
    with refusing_damage("TDMS file"):
        lengths = _lengths(nptdms, data)
        n_values = sum(lengths.values())
        check_size(n_values, limit=options.max_bytes, subject="the file")
        if n_values > 8 * extent.n_stored:
            raise LogError(
                f"damaged TDMS file: {n_values} values are declared, but only "
                f"{extent.n_stored} bytes are there; copy the log again",
                code="damaged",
            )
        missing = _lost(nptdms, data, extent, lengths, limit=options.max_bytes)
        if missing and not options.allow_truncated:
            raise LogError(
                f"truncated TDMS file: {missing}; copy the log again, or keep what all "
                "channels have by {--allow-truncated}",
                code="truncated",
            )
        file = nptdms.TdmsFile.read(io.BytesIO(data))
        groups = [_group(group, file, is_cut=bool(missing)) for group in file.groups()]
        n_read = sum(_n_bytes(channel) for group in file.groups() for channel in group.channels())
    if n_read > extent.n_stored or (n_read < extent.n_stored and not missing):
        raise LogError(
            f"truncated or damaged TDMS file: {extent.n_stored} bytes of values are "
            f"declared but {n_read} can be read; copy the log again",
            code="truncated",
        )
    tables = group_tables(groups, options, notes=(_NO_CHECKSUMS,))
    sentence = f"the end of the file is missing: {missing}"
    findings = (warning("truncated", sentence),) if missing else ()
    return tuple(replace(table, findings=findings) for table in tables)


def _extent(data: bytes) -> _Extent:
    """Return the bytes of values in the segments, and whether the last one is whole."""
    at = total = 0
    while at < len(data):
        if at and at + _LEAD_IN > len(data) and b"TDSm".startswith(data[at : at + 4]):
            return _Extent(total, at, -1)
        if at + _LEAD_IN > len(data) or data[at : at + 4] != b"TDSm":
            raise LogError(
                f"truncated or damaged TDMS file: no segment at byte {at}", code="truncated"
            )
        (contents,) = struct.unpack_from("<I", data, at + 4)
        order = ">" if contents & _IS_BIG_ENDIAN else "<"
        _, n_bytes, n_before_values = struct.unpack_from(f"{order}IQQ", data, at + 8)
        if contents & _IS_DAQMX:
            text = "raw DAQmx values in TDMS are not supported; export as CSV"
            raise LogError(text, code="damaged")
        values_at, end = at + _LEAD_IN + n_before_values, at + _LEAD_IN + n_bytes
        is_sound = values_at <= end if contents & _HAS_VALUES else values_at == end
        if is_sound and values_at <= len(data):
            ends_at = _end_of_metadata(data[:values_at], at + _LEAD_IN, order, contents)
            is_sound = 0 <= ends_at <= values_at and not any(data[ends_at:values_at])
        if n_bytes != _OPEN and not is_sound:
            text = f"damaged TDMS file: the segment at byte {at} is inconsistent"
            raise LogError(text, code="damaged")
        if n_bytes == _OPEN or end > len(data):
            has_values = contents & _HAS_VALUES and values_at <= len(data)
            n_present = len(data) - values_at if has_values else 0
            is_known = n_bytes != _OPEN and values_at <= len(data)
            return _Extent(total + n_present, at, end - len(data) if is_known else -1)
        total += end - values_at
        at = end
    return _Extent(total)


def _end_of_metadata(data: bytes, at: int, order: str, contents: int) -> int:
    """Return the byte after a segment's description of its channels; -1: the data end before."""

    def number() -> int:
        nonlocal at
        at += 4
        return int(struct.unpack_from(f"{order}I", data, at - 4)[0])

    def skip_text() -> None:
        nonlocal at
        n_bytes = number()
        at += n_bytes

    if not contents & _HAS_METADATA:
        return at if at == len(data) else -1
    try:
        for _ in range(number()):
            skip_text()
            n_index = number()  # the length counts itself
            at += n_index - 4 if n_index not in {_NO_VALUES, _AS_BEFORE} else 0
            for _ in range(number()):
                skip_text()
                kind = number()
                if kind == _TEXT:
                    skip_text()
                else:
                    at += _SIZES[kind]
    except (struct.error, KeyError):
        return -1
    return at


def _lengths(nptdms: Any, data: bytes) -> dict[tuple[str, str], int]:
    """Return the number of values of each channel, by names of group and channel."""
    groups = nptdms.TdmsFile.read_metadata(io.BytesIO(data)).groups()
    return {
        (str(g.name), str(channel.name)): len(channel) for g in groups for channel in g.channels()
    }


def _lost(
    nptdms: Any, data: bytes, extent: _Extent, lengths: Mapping[tuple[str, str], int], *, limit: int
) -> str:
    """Return a sentence on the values that a cut file lacks; empty when it is whole."""
    if extent.cut_at < 0:
        return ""
    place = f"the segment at byte {extent.cut_at} is not whole"
    if extent.n_missing < 0:
        present = ", ".join(f"{visible(name)} has {n}" for (_, name), n in [*lengths.items()][:10])
        return f"{place} and how much is missing is not known; values left: {present or 'none'}"
    if len(data) + extent.n_missing > limit:
        return f"{place}; {extent.n_missing} bytes are missing"
    # With the missing bytes replaced by zeros npTDMS gives the declared lengths.
    declared = _lengths(nptdms, data + bytes(extent.n_missing))
    counts = {name: (n - lengths.get(name, 0), n) for name, n in declared.items()}
    listed = [f"{visible(name)} lost {k} of {n}" for (_, name), (k, n) in counts.items() if k]
    return f"{place}; values: {', '.join(listed[:10]) or 'none lost'}"


def _n_bytes(channel: Any) -> int:
    """Return the bytes that the values of a channel take in the file."""
    values = channel[:]
    if (size := getattr(channel.data_type, "size", None)) is not None:
        return int(size) * len(values)
    return sum(4 + len(str(text).encode("utf-8")) for text in values)  # an offset and the text


def _group(group: Any, file: Any, *, is_cut: bool) -> Group:
    properties = {**file.properties, **group.properties}
    metadata = {str(key).lower(): str(text)[:1000] for key, text in properties.items()}
    stamps = [channel.properties.get("wf_start_time") for channel in group.channels()]
    start = min((stamp for stamp in stamps if isinstance(stamp, np.datetime64)), default=None)
    channels = tuple(
        _channel(channel, start)
        for channel in group.channels()
        if channel.dtype.kind in "fiuM" and len(channel)
    )
    return Group(str(group.name), channels, metadata, is_cut=is_cut)


def _channel(channel: Any, origin: np.datetime64 | None) -> GroupChannel:
    properties = channel.properties
    units = [str(properties[key]) for key in _UNITS if properties.get(key)]
    interval, stamp = properties.get("wf_increment"), properties.get("wf_start_time")
    start = float(properties.get("wf_start_offset", 0.0))
    if isinstance(stamp, np.datetime64) and origin is not None:
        start += 1e-9 * int(np.subtract(stamp, origin).astype("timedelta64[ns]").astype(np.int64))
    return GroupChannel(
        name=str(channel.name),
        unit="s" if channel.dtype.kind == "M" else next(iter(units), None),
        length=len(channel),
        load=lambda: _floats(channel[:], visible(str(channel.name))),
        start=start,
        interval=None if interval is None else float(interval),
    )


def _floats(values: NDArray[Any], channel: str) -> FloatArray:
    if values.dtype.kind == "M":
        return np.asarray((values - values[0]) / np.timedelta64(1, "ns") * 1e-9, dtype=np.float64)
    is_integer = values.dtype.kind in "iu" and values.dtype.itemsize == 8
    if is_integer and len(values) and max(-int(values.min()), int(values.max())) > _MAX_WHOLE:
        raise LogError(
            f"{channel} holds whole numbers beyond {_MAX_WHOLE}, which no measurement has; its "
            "data type may be damaged: copy the log again",
            code="damaged",
        )
    return np.asarray(values, dtype=np.float64)
