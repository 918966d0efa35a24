"""Delimited text of every dialect: pyarrow.csv behind the sniffer, and a slow twin that explains.

pyarrow refuses ragged rows and text in number columns but does not always say where. What it
refuses is read again field by field, which ends in the exact line and channel.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from damperfit.errors import LogError
from damperfit.readers.channels import visible
from damperfit.readers.dialect import Dialect, fields_of, find_dialect
from damperfit.readers.encoding import to_utf8
from damperfit.readers.table import Column, Table

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from numpy.typing import NDArray

    from damperfit.readers.files import Source
    from damperfit.readers.options import ReadOptions

    FloatArray = NDArray[np.float64]

__all__ = ["read_delimited"]

_BLANK = ["", "nan", "NaN", "NAN"]
_THREADED = 4_000_000  # bytes; below it, starting threads costs more than it saves
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)
_THOUSANDS = re.compile(r"[+-]?\d{1,3}(?:[ ,.'\u00a0]\d{3})+(?:[.,]\d+)?", re.ASCII)
_NOT_FINITE = {"nan", "+nan", "-nan", "inf", "+inf", "-inf", "infinity", "+infinity", "-infinity"}


@dataclass(frozen=True, slots=True, eq=False)
class _Text:
    """Rows of data as UTF-8 bytes, and how to read them."""

    name: str
    rows: bytes
    dialect: Dialect
    n_fields: int
    labels: tuple[str, ...]

    def lines(self) -> Iterator[tuple[int, str]]:
        """Yield number and text of each row that is not blank."""
        number = self.dialect.data_line
        for found in re.finditer(rb"([^\r\n]*)(\r\n|\n|\r|\Z)", self.rows):
            if found[1]:
                yield number, found[1].decode("utf-8", "replace")
            number += 1

    def place(self, index: int) -> str:
        """Return the line of a sample."""
        for i, (number, _) in enumerate(self.lines()):
            if i == index:
                return f"line {number}"
        return f"row {index + 1}"


def read_delimited(source: Source, options: ReadOptions) -> tuple[Table, ...]:
    """Return the table of a delimited text log.

    Raises
    ------
    LogError
        The file is no text, has no rows of numbers, or its rows do not fit its names.
    """
    del options
    name = source.name
    data, notes = to_utf8(source.data, name=name)
    dialect = find_dialect(data, name=name)
    rows = data[dialect.data_offset :]
    rows, cut_notes = _without_cut_row(rows, name)
    if dialect.separator == " ":
        rows = _with_tabs(rows)
        dialect = replace(dialect, separator="\t")
        notes = (*notes, "separator: blanks")
    names, n_fields, width_notes = _width(rows, dialect, name)
    labels = tuple(visible(n) if n else f"number {i + 1}" for i, n in enumerate(names))
    text = _Text(name, rows, dialect, n_fields, labels)
    _check_quotes(text)
    return (
        Table(
            columns=_columns(names, dialect),
            load=lambda wanted: _load(text, wanted),
            place=text.place,
            metadata=dialect.metadata(),
            notes=(*notes, *dialect.notes(), *width_notes, *cut_notes),
        ),
    )


def _without_cut_row(rows: bytes, name: str) -> tuple[bytes, tuple[str, ...]]:
    """Drop a last row without line end: -12 may be what was written of -1234."""
    if rows.endswith((b"\n", b"\r")):
        return rows, ()
    end = max(rows.rfind(b"\n"), rows.rfind(b"\r")) + 1
    if not rows[end:].strip():
        return rows[:end], ()
    if end == 0:
        raise LogError(f"{name}: no data rows; the only one has no line end and may be cut")
    return rows[:end], ("no final newline; the last row may be cut and was dropped",)


def _with_tabs(rows: bytes) -> bytes:
    rows = re.sub(rb"[ \t]+", b"\t", rows)
    return re.sub(rb"(?m)^\t|\t(?=\r?$)", b"", rows)


def _width(
    rows: bytes, dialect: Dialect, name: str
) -> tuple[tuple[str, ...], int, tuple[str, ...]]:
    """Return names, number of fields in a row, and notes; a trailing separator may add one."""
    first = re.match(rb"[^\r\n]*", rows)
    fields = fields_of(first[0].decode("utf-8", "replace") if first else "", dialect.separator)
    names = dialect.names or ("",) * len(fields)
    if dialect.units and len(dialect.units) != len(names):
        raise LogError(
            f"{name}, line {dialect.names_line + 1}: {len(dialect.units)} units for "
            f"{len(names)} names in line {dialect.names_line}"
        )
    if len(fields) == len(names) + 1 and not fields[-1]:
        note = "every row ends in a separator; the empty last column was left out"
        return names, len(names) + 1, (note,)
    return names, len(names), ()


def _columns(names: tuple[str, ...], dialect: Dialect) -> tuple[Column, ...]:
    units = dialect.units or ("",) * len(names)
    return tuple(Column(n, unit or None) for n, unit in zip(names, units, strict=True))


def _check_quotes(text: _Text) -> None:
    if b'"' not in text.rows:
        return
    for number, line in text.lines():
        if line.count('"') % 2:
            raise LogError(
                f"{text.name}, line {number}: a quote opens and does not close in the line"
            )


def _load(text: _Text, wanted: Mapping[str, int]) -> dict[str, FloatArray]:
    """Return columns as floats; fast, and slow where the fast way refuses."""
    from pyarrow import ArrowException

    try:
        columns = _load_fast(text, sorted(set(wanted.values())), text.n_fields - len(text.labels))
    except (ArrowException, ValueError):
        return _load_slow(text, wanted)
    return {channel: columns[index] for channel, index in wanted.items()}


def _load_fast(text: _Text, indices: list[int], n_extra: int) -> dict[int, FloatArray]:
    import pyarrow as pa
    from pyarrow import csv

    names = [f"{i}" for i in range(text.n_fields)]
    wanted = [names[i] for i in indices] + (names[-1:] if n_extra else [])
    types: dict[str, pa.DataType] = {names[i]: pa.float64() for i in indices}
    if n_extra:
        types[names[-1]] = pa.null()  # anything in the column is an error
    table = csv.read_csv(
        pa.BufferReader(text.rows),  # type: ignore[arg-type]  # stubs forget Arrow's own files
        read_options=csv.ReadOptions(column_names=names, use_threads=len(text.rows) > _THREADED),
        parse_options=csv.ParseOptions(delimiter=text.dialect.separator),
        convert_options=csv.ConvertOptions(
            column_types=types,
            include_columns=wanted,
            null_values=_BLANK,
            decimal_point=text.dialect.decimal,
        ),
    )
    return {i: _as_floats(table.column(names[i])) for i in indices}


def _as_floats(column: object) -> FloatArray:
    values = column.to_numpy(zero_copy_only=False)  # type: ignore[attr-defined]
    return np.asarray(values, dtype=np.float64)


def _load_slow(text: _Text, wanted: Mapping[str, int]) -> dict[str, FloatArray]:
    """Read field by field: the values, or the line and channel of the first thing wrong."""
    values: dict[str, list[float]] = {channel: [] for channel in wanted}
    n_names = len(text.labels)
    for number, line in text.lines():
        where = f"{text.name}, line {number}"
        fields = fields_of(line, text.dialect.separator)
        if len(fields) != text.n_fields:
            expected = f"{n_names} fields as in line {text.dialect.names_line}"
            if not text.dialect.names_line:
                expected = f"{n_names} fields as in line {text.dialect.data_line}"
            raise LogError(f"{where}: found {len(fields)} fields, expected {expected}")
        if text.n_fields > n_names and fields[-1]:
            raise LogError(
                f"{where}: found {visible(fields[-1])} after the last named column; "
                f"expected {n_names} fields"
            )
        for channel, index in wanted.items():
            values[channel].append(_number(fields[index], channel, where, text.dialect.decimal))
    if not next(iter(values.values()), None):
        raise LogError(f"{text.name}: no data rows")
    return {channel: np.array(column) for channel, column in values.items()}


def _number(field: str, channel: str, where: str, decimal: str) -> float:
    plain = field
    if decimal == ",":
        plain = "?" if "." in field else field.replace(",", ".")
    if _NUMBER.fullmatch(plain):
        return float(plain)
    if not plain or plain.lower() in _NOT_FINITE:
        return float(plain or "nan")
    hint = "; it looks like a number with thousands separators" * bool(_THOUSANDS.fullmatch(field))
    raise LogError(f"{where}: {channel} is {visible(field)}, expected a number{hint}")
