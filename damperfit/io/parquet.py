"""Parquet logs: same column names as text, units also from field metadata.

The format: https://parquet.apache.org/docs/file-format/. "PAR1", then pages of values, each behind
a header, then a footer that says where everything is, its length, and "PAR1".

Traps. Page checksums are verified by pyarrow only when asked, and writers write them only when
asked (pandas does not): without them one flipped bit changes a value and nobody can know, which is
said in a note. The footer has no checksum, so what it says twice is compared. A megabyte may hold
10^8 rows: the rows are counted before one is read. Times may be stamps instead of numbers.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit.errors import LogError
from damperfit.io.child_process import check_size, refusing_damage
from damperfit.io.formats import Column, Samples, Table

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from damperfit.io.files import Source
    from damperfit.io.options import ReadOptions

    FloatArray = NDArray[np.float64]

__all__ = ["read_parquet"]

_MAGIC = b"PAR1"
_NEXT_NUMBER = b"\x15"
_NO_CHECKSUMS = "Parquet without page checksums: a damaged value could not be seen"
# Ticks in a second, by Arrow's name of a tick.
_TICKS = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}


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
    groups = (file.metadata.row_group(i) for i in range(file.metadata.num_row_groups))
    n_rows = max(file.metadata.num_rows, sum(max(group.num_rows, 0) for group in groups))
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
    unit = said.get("unit") or said.get("units")
    return Column(field.name.strip(), unit, is_clock=_is_clock(field.type))


def _is_clock(kind: Any) -> bool:
    import pyarrow as pa

    return bool(pa.types.is_timestamp(kind) or pa.types.is_time(kind))


def _texts(metadata: Mapping[bytes, bytes] | None) -> dict[str, str]:
    """Return what is short readable text, keys in lower case."""
    texts = {}
    for key, value in (metadata or {}).items():
        if len(value) <= 1000 and not key.startswith((b"ARROW:", b"PARQUET:", b"pandas")):
            texts[key.decode("utf-8", "replace").lower()] = value.decode("utf-8", "replace")
    return texts


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
        _check_counts(file.metadata, table.num_rows, name)
        table.validate(full=True)
        channels = {
            channel: _floats(table.column(fields[index].name)) for channel, index in wanted.items()
        }
    return Samples(channels, lambda index: f"row {index + 1}")


def _check_counts(metadata: Any, n_read: int, name: str) -> None:
    """Compare what is said twice: the footer has no checksum, and a count may be damaged.

    The counts of the columns are left alone: asking pyarrow for a damaged one ends the process.
    """
    groups = range(metadata.num_row_groups)
    n_held = sum(metadata.row_group(i).num_rows for i in groups)
    if not metadata.num_rows == n_held == n_read:
        raise LogError(
            f"damaged Parquet: {metadata.num_rows} rows are declared, {n_held} held and "
            f"{n_read} read; copy the log again",
            subject=name,
        )


def _floats(column: Any) -> FloatArray:
    import pyarrow as pa

    kind = column.type
    if _is_clock(kind) or pa.types.is_duration(kind):
        return _seconds(column)
    values = column.cast(pa.float64()).to_numpy(zero_copy_only=False)
    return np.asarray(values, dtype=np.float64)


def _seconds(column: Any) -> FloatArray:
    """Return stamps and times of day as seconds from the first, durations as they are.

    The difference is taken in whole ticks: as floats, stamps are good to 0.2 us only.
    """
    import pyarrow as pa

    kind = column.type
    ticks = (
        column.cast(pa.int32()).cast(pa.int64()) if kind.bit_width == 32 else column.cast("int64")
    )
    is_known = np.asarray(column.is_valid().to_numpy(zero_copy_only=False), dtype=np.bool_)
    counts = ticks.fill_null(0).to_numpy().astype(np.int64)
    if not pa.types.is_duration(kind) and is_known.any():
        counts = counts - counts[np.argmax(is_known)]
    if pa.types.is_time(kind):  # each midnight begins the count anew
        day = np.int64(86_400 * _TICKS[kind.unit])
        counts[1:] += day * np.cumsum(np.diff(counts) < -day // 2)
    return np.where(is_known, counts / _TICKS[kind.unit], np.nan)
