"""Parquet logs: same column names as text, units also from field metadata.

The format: https://parquet.apache.org/docs/file-format/. "PAR1", then pages of values, each behind
a header, then a footer that says where everything is, its length, and "PAR1".

Traps. Page checksums are verified by pyarrow only when asked, and writers write them only when
asked (pandas does not): without them one flipped bit changes a value and nobody can know, which is
said in a note. The footer has no checksum, so what it says twice is compared. A megabyte may hold
10^8 rows: the rows are counted before one is read. Times may be stamps instead of numbers.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from damperfit.errors import LogError
from damperfit.io.child_process import check_size, refusing_damage
from damperfit.io.files import Source
from damperfit.io.formats import Column, FloatArray, Samples, Table
from damperfit.io.options import ReadOptions

__all__ = ["read_parquet"]

_MAGIC = b"PAR1"
_NEXT_NUMBER = b"\x15"
_NO_CHECKSUMS = "Parquet without page checksums: a damaged value could not be seen"
_TICKS = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}  # in a second


def read_parquet(source: Source, options: ReadOptions) -> tuple[Table, ...]:
    """Return the table of a Parquet log.

    Raises
    ------
    LogError
        The file is cut or damaged, or says it holds more than the limit.
    """
    import pyarrow as pa
    from pyarrow import parquet

    name = source.name
    if len(source.data) < 12 or not source.data.endswith(_MAGIC):
        raise LogError("truncated Parquet; the end of the file is missing", subject=name)
    with refusing_damage("Parquet", name=name):
        file = parquet.ParquetFile(pa.BufferReader(source.data), page_checksum_verification=True)
        schema = file.schema_arrow
        metadata = _texts(schema.metadata)
        fields = [schema.field(i) for i in range(len(schema))]
    n_rows = max(file.metadata.num_rows, sum(max(n, 0) for n in _rows_of_groups(file)))
    claimed = max(n_rows, 0) * 8 * 4  # four channels of float64 are all that is ever loaded
    check_size(claimed, limit=options.max_bytes, what=f"a table of {n_rows} rows", name=name)
    return (
        Table(
            columns=tuple(_column(field) for field in fields),
            load=lambda wanted: _load(file, fields, wanted, name),
            metadata=metadata,
            notes=() if _has_checksums(source.data) else (_NO_CHECKSUMS,),
        ),
    )


def _rows_of_groups(file: Any) -> list[int]:
    return [file.metadata.row_group(i).num_rows for i in range(file.metadata.num_row_groups)]


def _has_checksums(data: bytes) -> bool:
    """Say whether the first page has a checksum; all pages come from one writer.

    A page header is in Thrift's compact form: each 32-bit number is 0x15 and the number in groups
    of seven bits. The first three are kind and two sizes, the fourth is the checksum.
    """
    at = len(_MAGIC)
    for _ in range(3):
        if data[at : at + 1] != _NEXT_NUMBER:
            return False
        at += 1
        while at < len(data) and data[at] & 0x80:
            at += 1
        at += 1
    return data[at : at + 1] == _NEXT_NUMBER


def _column(field: Any) -> Column:
    import pyarrow as pa

    if pa.types.is_duration(field.type):
        return Column(field.name.strip(), "s")
    said = _texts(field.metadata)
    return Column(field.name.strip(), said.get("unit") or said.get("units"), _is_clock(field.type))


def _is_clock(kind: Any) -> bool:
    import pyarrow as pa

    return bool(pa.types.is_timestamp(kind) or pa.types.is_time(kind))


def _texts(metadata: Mapping[bytes, bytes] | None) -> dict[str, str]:
    """Return what is short readable text, keys in lower case."""
    return {
        key.decode("utf-8", "replace").lower(): value.decode("utf-8", "replace")
        for key, value in (metadata or {}).items()
        if len(value) <= 1000 and not key.startswith((b"ARROW:", b"PARQUET:", b"pandas"))
    }


def _load(file: Any, fields: list[Any], wanted: Mapping[str, int], name: str) -> Samples:
    import pyarrow as pa

    for channel, index in wanted.items():
        kind = fields[index].type
        is_number = pa.types.is_integer(kind) or pa.types.is_floating(kind)
        is_time = _is_clock(kind) or pa.types.is_duration(kind)
        if not (is_number or pa.types.is_decimal(kind) or is_time):
            raise LogError(f"{channel} is of type {kind}, expected numbers", subject=name)
    columns = sorted({fields[index].name for index in wanted.values()})
    with refusing_damage("Parquet", name=name):
        table = file.read(columns=columns, use_threads=False)
        # The counts of the columns are left alone: asking for a damaged one ends the process.
        n_declared, n_held = file.metadata.num_rows, sum(_rows_of_groups(file))
        if not n_declared == n_held == table.num_rows:
            raise LogError(
                f"damaged Parquet: {n_declared} rows are declared, {n_held} held and "
                f"{table.num_rows} read; copy the log again",
                subject=name,
            )
        table.validate(full=True)
        channels = {
            channel: _floats(table.column(fields[index].name)) for channel, index in wanted.items()
        }
    return Samples(channels, lambda index: f"row {index + 1}")


def _floats(column: Any) -> FloatArray:
    """Return numbers, durations in seconds, stamps and times of day in seconds from the first.

    The difference is taken in whole ticks: as floats, stamps are good to 0.2 us only.
    """
    import pyarrow as pa

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
