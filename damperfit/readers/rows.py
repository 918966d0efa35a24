"""Rows of delimited text to numbers: pyarrow.csv, and a slow twin that explains or drops rows.

pyarrow refuses ragged rows and text in number columns but does not always say where. What it
refuses is read again field by field, which ends in the exact line and channel.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit.errors import LogError
from damperfit.readers.channels import visible
from damperfit.readers.clock import clock_seconds, is_stamp
from damperfit.readers.dialect import fields_of
from damperfit.readers.table import Samples

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from numpy.typing import NDArray

    from damperfit.readers.dialect import Dialect

    FloatArray = NDArray[np.float64]

__all__ = ["TextRows", "load_rows"]

_BLANK = ["", "nan", "NaN", "NAN"]
_THREADED = 4_000_000  # bytes; below it, starting threads costs more than it saves
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)
_THOUSANDS = re.compile(r"[+-]?\d{1,3}(?:[ ,.'\u00a0]\d{3})+(?:[.,]\d+)?", re.ASCII)
_NOT_FINITE = {"nan", "+nan", "-nan", "inf", "+inf", "-inf", "infinity", "+infinity", "-infinity"}
_LINE = re.compile(rb"([^\r\n]*)(\r\n|\n|\r|\Z)")


@dataclass(frozen=True, slots=True, eq=False)
class TextRows:
    """Rows of data as UTF-8 bytes, and how to read them.

    Attributes
    ----------
    name : str
        Log, for messages.
    rows : bytes
        From the first row of data on; every row ends.
    dialect : Dialect
        Separator and decimal mark.
    n_names, n_fields : int
        Named columns; fields in a row (one more when every row ends in a separator).
    clocks : frozenset of int
        Columns of wall-clock stamps.
    drops_bad_rows : bool
        Leave out what cannot be read, and count it.
    """

    name: str
    rows: bytes
    dialect: Dialect
    n_names: int
    n_fields: int
    clocks: frozenset[int]
    drops_bad_rows: bool

    def lines(self) -> Iterator[tuple[int, str]]:
        """Yield number and text of each row that is not blank."""
        number = self.dialect.data_line
        for found in _LINE.finditer(self.rows):
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
    from pyarrow import ArrowException

    try:
        columns = _load_fast(text, sorted(set(wanted.values())))
    except (ArrowException, ValueError):
        return _load_slow(text, wanted)
    needed = [columns[i] for channel, i in wanted.items() if channel != "temperature"]
    if text.drops_bad_rows and not all(np.isfinite(values).all() for values in needed):
        return _load_slow(text, wanted)
    if text.clocks and any(np.isnan(columns[i]).any() for i in text.clocks if i in columns):
        return _load_slow(text, wanted)
    return Samples({channel: columns[index] for channel, index in wanted.items()}, text.place)


def _load_fast(text: TextRows, indices: list[int]) -> dict[int, FloatArray]:
    import pyarrow as pa
    from pyarrow import csv

    names = [f"{i}" for i in range(text.n_fields)]
    extra = names[text.n_names :]
    types: dict[str, pa.DataType] = {
        names[i]: pa.string() if i in text.clocks else pa.float64() for i in indices
    }
    types.update(dict.fromkeys(extra, pa.null()))  # anything in the column is an error
    table = csv.read_csv(
        pa.BufferReader(text.rows),
        read_options=csv.ReadOptions(column_names=names, use_threads=len(text.rows) > _THREADED),
        parse_options=csv.ParseOptions(delimiter=text.dialect.separator),
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
    return np.asarray(column.to_numpy(zero_copy_only=False), dtype=np.float64)


def _load_slow(text: TextRows, wanted: Mapping[str, int]) -> Samples:
    """Read field by field: the values, or the line and channel of the first thing wrong."""
    numbers: list[int] = []
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
        numbers.append(number)
        for channel, value in row.items():
            values[channel].append(value)
    if not numbers:
        raise LogError(f"{text.name}: no data rows{'; first: ' * bool(first_bad)}{first_bad}")
    notes = (f"{n_bad} rows that cannot be read were dropped; {first_bad}",) if n_bad else ()
    return Samples(
        {
            channel: _stamps(column) if wanted[channel] in text.clocks else np.array(column, float)
            for channel, column in values.items()
        },
        lambda index: f"line {numbers[index]}",
        notes,
    )


def _stamps(column: list[float | str]) -> FloatArray:
    import pyarrow as pa

    return clock_seconds(pa.array(column, pa.string()))


def _row(
    text: TextRows, line: str, wanted: Mapping[str, int], where: str
) -> dict[str, float | str]:
    if line.count('"') % 2:
        raise LogError(f"{where}: a quote opens and does not close in the line")
    fields = fields_of(line, text.dialect.separator)
    if len(fields) != text.n_fields:
        line_above = text.dialect.names_line or text.dialect.data_line
        raise LogError(
            f"{where}: found {len(fields)} fields, expected {text.n_names} fields as in "
            f"line {line_above}"
        )
    if text.n_fields > text.n_names and fields[-1]:
        raise LogError(
            f"{where}: found {visible(fields[-1])} after the last named column; "
            f"expected {text.n_names} fields"
        )
    return {
        channel: _field(text, fields[index], channel, index in text.clocks, where)
        for channel, index in wanted.items()
    }


def _field(text: TextRows, field: str, channel: str, is_clock: bool, where: str) -> float | str:  # noqa: FBT001
    if is_clock:
        if not is_stamp(field):
            raise LogError(f"{where}: {channel} is {visible(field)}, expected a time of day")
        return field
    value = _number(field, channel, where, text.dialect.decimal)
    if text.drops_bad_rows and channel != "temperature" and not np.isfinite(value):
        raise LogError(f"{where}: {channel} is {visible(field)}, expected a finite number")
    return value


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
