"""Rows of delimited text to numbers: the core, pyarrow.csv, and a slow twin that explains or drops.

Plain numbers of up to 15 digits, as rigs write them, are read by the core, to the same double as
pyarrow's, which need not be loaded for them. Clocks, quotes, more digits and whatever else is no
plain number go to pyarrow. It refuses ragged rows and text in number columns but does not always
say where. What it refuses is read again field by field, which ends in the exact line and channel.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit.compiled_core import compiled_core
from damperfit.errors import LogError
from damperfit.readers.channels import visible
from damperfit.readers.clock import clock_seconds, is_stamp
from damperfit.readers.dialect import fields_of
from damperfit.readers.options import EXTRAS
from damperfit.readers.table import Samples
from damperfit.recording import Finding

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from numpy.typing import NDArray

    from damperfit.readers.dialect import Dialect
    from damperfit.readers.options import Declarations

    FloatArray = NDArray[np.float64]

__all__ = ["TextRows", "load_rows"]

_BLANK = ["", "nan", "NaN", "NAN"]
_THREADED = 4_000_000  # bytes; below it, starting threads costs more than it saves
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)
_GROUPED = re.compile(r"[+-]?\d{1,3}(?P<mark>[ ,.'])\d{3}(?:(?P=mark)\d{3})*(?:[.,]\d+)?", re.ASCII)
_NOT_FINITE = {"nan", "+nan", "-nan", "inf", "+inf", "-inf", "infinity", "+infinity", "-infinity"}
_LINE = re.compile(rb"([^\r\n]*)(\r\n|\n|\r|\Z)")
_LINE_END = re.compile(rb"\r\n|\n|\r")
_PIECE = 1_000_000  # bytes


@dataclass(frozen=True, slots=True, eq=False)
class TextRows:
    """Rows of data as UTF-8 bytes, and how to read them.

    Attributes
    ----------
    name : str
        Log, for messages.
    rows : bytes
        The text; every row ends.
    start : int
        Byte of the first row of data; a copy of a large log without its head would cost time.
    dialect : Dialect
        Separator and decimal mark.
    n_names, n_fields : int
        Named columns; fields in a row (one more when every row ends in a separator).
    clocks : frozenset of int
        Columns of wall-clock stamps.
    declared : Declarations
        Mark of thousands; whether rows that cannot be read are dropped.
    """

    name: str
    rows: bytes
    start: int
    dialect: Dialect
    n_names: int
    n_fields: int
    clocks: frozenset[int]
    declared: Declarations

    @property
    def drops_bad_rows(self) -> bool:
        """Leave out what cannot be read, and count it."""
        return self.declared.bad_rows == "drop"

    @property
    def has_quotes(self) -> bool:
        """Say whether any field may be quoted."""
        return self.rows.find(b'"', self.start) >= 0

    def lines(self) -> Iterator[tuple[int, str]]:
        """Yield number and text of each row that is not blank."""
        number = self.dialect.data_line
        for found in _LINE.finditer(self.rows, self.start):
            if found[1]:
                yield number, found[1].decode("utf-8", "replace")
            number += 1

    def place(self, index: int) -> str:
        """Return the line of a sample when no row was dropped."""
        for i, (number, _) in enumerate(self.lines()):
            if i == index:
                return f"line {number}"
        return f"row {index + 1}"


def load_rows(text: TextRows, wanted: Mapping[str, int]) -> Samples:
    """Return columns as floats; fast, and slow where the fast way refuses.

    Raises
    ------
    LogError
        A row has too few or too many fields, or text where a number should be.
    """
    columns = _load_fast(text, wanted)
    if columns is not None:
        return Samples(columns, text.place)
    return _load_in_pieces(text, wanted)


@dataclass(frozen=True, slots=True, eq=False)
class _Piece:
    """Values of some rows; lines is None when they are all the rows of the text."""

    text: TextRows
    columns: Mapping[str, FloatArray]
    lines: list[int] | None = None
    n_bad: int = 0
    first_bad: str = ""

    @property
    def n(self) -> int:
        return len(next(iter(self.columns.values())))

    def place(self, index: int) -> str:
        return self.text.place(index) if self.lines is None else f"line {self.lines[index]}"


def _load_in_pieces(text: TextRows, wanted: Mapping[str, int]) -> Samples:
    """Read piece by piece, fast where that goes, so that one bad row costs one slow piece."""
    pieces: list[_Piece] = []
    for part in [text] if text.clocks else _cut(text):
        columns = None if part is text else _load_fast(part, wanted)
        pieces.append(_load_slow(part, wanted) if columns is None else _Piece(part, columns))
    n_bad = sum(piece.n_bad for piece in pieces)
    first_bad = next((piece.first_bad for piece in pieces if piece.first_bad), "")
    if not any(piece.n for piece in pieces):
        raise LogError(f"{text.name}: no data rows{'; first: ' * bool(first_bad)}{first_bad}")

    def place(index: int) -> str:
        for piece in pieces:
            if index < piece.n:
                return piece.place(index)
            index -= piece.n
        return f"row {index + 1} after the last"

    columns = {
        channel: np.concatenate([piece.columns[channel] for piece in pieces]) for channel in wanted
    }
    text_of_bad = f"{n_bad} row{'s' * (n_bad != 1)} that cannot be read dropped; {first_bad}"
    found = (Finding("rows_dropped", "warning", text_of_bad, float(n_bad)),) if n_bad else ()
    return Samples(columns, place, findings=found)


def _cut(text: TextRows) -> Iterator[TextRows]:
    """Yield the rows in pieces of whole lines."""
    start, line = text.start, text.dialect.data_line
    while start < len(text.rows):
        end = start + _PIECE
        cut = max(text.rows.rfind(b"\n", start, end), text.rows.rfind(b"\r", start, end)) + 1
        if end >= len(text.rows):
            cut = len(text.rows)
        elif cut == 0:  # a line longer than a piece
            found = _LINE.match(text.rows, start)
            cut = found.end() if found else len(text.rows)
        elif text.rows[cut - 1 : cut + 1] == b"\r\n":
            cut += 1
        rows = text.rows[start:cut]
        yield replace(text, rows=rows, start=0, dialect=replace(text.dialect, data_line=line))
        line += sum(1 for _ in _LINE_END.finditer(rows))
        start = cut


def _load_fast(text: TextRows, wanted: Mapping[str, int]) -> dict[str, FloatArray] | None:
    """Return columns as floats, or None where something is wrong or has to be dropped."""
    indices = sorted(set(wanted.values()))
    columns = _plain(text, indices) or _parsed(text, indices)
    if columns is None:
        return None
    needed = [columns[i] for channel, i in wanted.items() if channel not in EXTRAS]
    if text.drops_bad_rows and not all(np.isfinite(values).all() for values in needed):
        return None
    if any(np.isnan(columns[i]).any() for i in text.clocks if i in columns):
        return None
    return {channel: columns[index] for channel, index in wanted.items()}


def _plain(text: TextRows, indices: list[int]) -> dict[int, FloatArray] | None:
    """Return columns of plain numbers; None where anything else is in them, or in a quote."""
    if text.clocks.intersection(indices) or text.has_quotes or not text.dialect.separator.isascii():
        return None
    n_lines = text.rows.count(b"\n", text.start) or text.rows.count(b"\r", text.start)
    values = np.empty((len(indices), n_lines))
    n = compiled_core().read_numbers(
        *(text.rows, np.array(indices, np.int64), values, text.start, text.dialect.separator),
        *(text.dialect.decimal, text.n_names, text.n_fields),
    )
    return None if n < 0 else dict(zip(indices, values[:, :n], strict=True))


def _parsed(text: TextRows, indices: list[int]) -> dict[int, FloatArray] | None:
    """Return columns as pyarrow reads them; None where it refuses."""
    from pyarrow import ArrowException

    try:
        return _parse(text, indices)
    except (ArrowException, ValueError):
        return None


def _parse(text: TextRows, indices: list[int]) -> dict[int, FloatArray]:
    import pyarrow as pa
    from pyarrow import csv

    names = [f"{i}" for i in range(text.n_fields)]
    extra = names[text.n_names :]
    types: dict[str, pa.DataType] = {
        names[i]: pa.string() if i in text.clocks else pa.float64() for i in indices
    }
    types.update(dict.fromkeys(extra, pa.null()))  # anything in the column is an error
    table = csv.read_csv(
        pa.BufferReader(pa.py_buffer(text.rows).slice(text.start)),
        read_options=csv.ReadOptions(column_names=names, use_threads=len(text.rows) > _THREADED),
        parse_options=csv.ParseOptions(
            delimiter=text.dialect.separator,
            quote_char='"' if text.has_quotes else False,
        ),
        convert_options=csv.ConvertOptions(
            column_types=types,
            include_columns=[names[i] for i in indices] + extra,
            null_values=_BLANK,
            decimal_point=text.dialect.decimal,
        ),
    )
    return {i: _as_floats(table.column(names[i]), is_clock=i in text.clocks) for i in indices}


def _as_floats(column: Any, *, is_clock: bool) -> FloatArray:
    if is_clock:
        return clock_seconds(column)
    parts = [_chunk_floats(chunk) for chunk in column.chunks]
    return np.concatenate(parts) if parts else np.empty(0)


def _chunk_floats(chunk: Any) -> FloatArray:
    """Return a float64 chunk, nulls as NaN, from its buffers: to_numpy() imports pandas first."""
    validity, data = chunk.buffers()
    rows = slice(chunk.offset, chunk.offset + len(chunk))
    values = np.frombuffer(data, dtype=np.float64)[rows]
    if not chunk.null_count:
        return values
    bits = np.unpackbits(np.frombuffer(validity, dtype=np.uint8), bitorder="little")[rows]
    return np.where(bits.astype(np.bool_), values, np.nan)


def _load_slow(text: TextRows, wanted: Mapping[str, int]) -> _Piece:
    """Read field by field: the values, or the line and channel of the first thing wrong."""
    lines: list[int] = []
    values: dict[str, list[float | str]] = {channel: [] for channel in wanted}
    first_bad = ""
    n_bad = 0
    for number, line in text.lines():
        try:
            row = _row(text, line, wanted, f"{text.name}, line {number}")
        except LogError as error:
            if not text.drops_bad_rows:
                raise
            n_bad += 1
            first_bad = first_bad or str(error)
            continue
        lines.append(number)
        for channel, value in row.items():
            values[channel].append(value)
    columns = {
        channel: _stamps(column) if wanted[channel] in text.clocks else np.array(column, float)
        for channel, column in values.items()
    }
    return _Piece(text, columns, lines, n_bad, first_bad)


def _stamps(column: list[float | str]) -> FloatArray:
    import pyarrow as pa

    return clock_seconds(pa.array(column, pa.string()))


def _advice(text: TextRows) -> str:
    if text.drops_bad_rows:
        return ""
    return "; repair the row, or drop such rows by rig.bad_rows = 'drop'"


def _row(
    text: TextRows, line: str, wanted: Mapping[str, int], where: str
) -> dict[str, float | str]:
    if line.count('"') % 2:
        raise LogError(f"{where}: a quote opens and does not close in the line")
    fields = fields_of(line, text.dialect.separator)
    if len(fields) != text.n_fields:
        has_names = text.dialect.names_line and not text.dialect.is_short
        line_above = text.dialect.names_line if has_names else text.dialect.data_line
        raise LogError(
            f"{where}: found {len(fields)} field{'s' * (len(fields) != 1)}, expected "
            f"{text.n_names} fields as in line {line_above}{_advice(text)}"
        )
    if text.n_fields > text.n_names and fields[-1]:
        raise LogError(
            f"{where}: found {visible(fields[-1])} after the last named column; "
            f"expected {text.n_names} fields"
        )
    return {
        channel: _stamp(fields[index], channel, where)
        if index in text.clocks
        else _number(text, fields[index], channel, where)
        for channel, index in wanted.items()
    }


def _stamp(field: str, channel: str, where: str) -> str:
    if not is_stamp(field):
        raise LogError(f"{where}: {channel} is {visible(field)}, expected a time of day")
    return field


def _number(text: TextRows, field: str, channel: str, where: str) -> float:
    plain = field
    is_grouped = _GROUPED.fullmatch(field)
    if text.declared.thousands and is_grouped and is_grouped["mark"] == text.declared.thousands:
        plain = plain.replace(text.declared.thousands, "")
    if text.dialect.decimal == ",":
        plain = "?" if "." in plain else plain.replace(",", ".")
    if _NUMBER.fullmatch(plain) or not plain or plain.lower() in _NOT_FINITE:
        value = float(plain or "nan")
        if text.drops_bad_rows and channel not in EXTRAS and not np.isfinite(value):
            raise LogError(f"{where}: {channel} is {visible(field)}, expected a finite number")
        return value
    hint = _advice(text)
    if is_grouped:
        hint = "; if it has a mark of thousands, declare rig.thousands"
        if is_grouped["mark"] == "," != text.dialect.decimal:
            hint += ", if a decimal comma, rig.decimal"
    raise LogError(f"{where}: {channel} is {visible(field)}, expected a number{hint}")
