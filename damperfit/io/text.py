"""Delimited text of every dialect, in one block or in several (MTS).

Text logs have no format. Names stand above the rows of numbers, units in them, in a row of their
own or nowhere; above that may stand prose, entries ``key: value`` and rows that look like data. MTS
793 heads each test with a line "Data Acquisition", and the file with a line that names language and
decimal mark; Instron's entries have a value and a unit. `dialect` finds how a log is written.

Traps. A rig that is still writing leaves a last line without an end, and -12 of -1234 is a number
too. Every row may end in a separator, which shifts the columns of a careless reader by one. A
column of events may be there in the rows with an event only. Whole numbers of a machine at rest say
nothing of the decimal mark. One dropped byte joins two rows.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit.errors import LogError
from damperfit.io.channels import has_channel, visible
from damperfit.io.dialect import LINE, NUMBER, Dialect, fields_of, find_dialect, metadata_of
from damperfit.io.files import to_utf8
from damperfit.io.formats import Column, Samples, Table
from damperfit.io.options import EXTRAS
from damperfit.recording import Finding
from damperfit.statistics import median

if TYPE_CHECKING:
    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]
    from collections.abc import Iterator, Mapping, Sequence

    from damperfit.io.dialect import Dialect
    from damperfit.io.files import Source
    from damperfit.io.options import Declarations, ReadOptions

__all__ = [
    "TextRows",
    "clock_seconds",
    "is_stamp",
    "load_rows",
    "read_delimited",
    "with_time_of_titles",
]


# Wall-clock stamps to seconds from the first one.
#
# The date is only compared with the one above, so that day and month need not be told apart; each
# change of date is one day.

_DAY = 86_400.0  # s
# In the common subset of Python's and Arrow's regular expressions.
_PATTERN = (
    r"^\s*(?P<date>\d{1,4}[-/.]\d{1,2}[-/.]\d{1,4}[T ]+)?"
    r"(?P<hour>\d{1,2}):(?P<minute>\d{2}):(?P<second>\d{2})(?:[.,](?P<fraction>\d{1,9}))?"
    r"\s*(?P<half>[AaPp]\.?[Mm]\.?)?\s*(?:Z|UTC|[+-]\d{2}:?\d{2})?\s*$"
)
_STAMP = re.compile(_PATTERN, re.ASCII)


def is_stamp(text: str) -> bool:
    """Say whether a field is a time of day, with or without a date.

    Examples
    --------
    >>> is_stamp("04/29/2022 11:56:20.699 AM"), is_stamp("2022-04-29"), is_stamp("1.5")
    (True, False, False)
    """
    return _STAMP.match(text) is not None


def clock_seconds(stamps: Any) -> FloatArray:
    """Return seconds from the first stamp; NaN for what is no stamp.

    Parameters
    ----------
    stamps : pyarrow.ChunkedArray or pyarrow.Array
        Text, shape (n,).
    """
    import pyarrow as pa
    from pyarrow import compute

    if isinstance(stamps, pa.ChunkedArray):
        stamps = stamps.combine_chunks()
    if not len(stamps):
        return np.zeros(0)
    parts = compute.call_function(
        "extract_regex", [stamps], compute.ExtractRegexOptions(pattern=_PATTERN)
    )

    def number(field: str) -> FloatArray:
        text = compute.call_function("struct_field", [parts], compute.StructFieldOptions([field]))
        is_blank = compute.call_function("equal", [text, pa.scalar("")])
        filled = compute.call_function("if_else", [is_blank, pa.scalar("0"), text])
        return np.asarray(filled.cast(pa.float64()).to_numpy(zero_copy_only=False))

    def text(field: str) -> Any:
        return compute.call_function("struct_field", [parts], compute.StructFieldOptions([field]))

    digits = compute.call_function("utf8_length", [text("fraction")])
    fraction = number("fraction") / 10.0 ** np.asarray(
        digits.to_numpy(zero_copy_only=False), dtype=np.float64
    )
    hour = number("hour")
    half = compute.call_function("utf8_lower", [text("half")])
    first = compute.call_function("utf8_slice_codeunits", [half], compute.SliceOptions(0, 1))
    letters = np.asarray(first.to_numpy(zero_copy_only=False), dtype=object)
    has_half = (letters == "a") | (letters == "p")
    hour = np.where(has_half, hour % 12.0 + 12.0 * (letters == "p"), hour)
    whole = hour * 3600.0 + number("minute") * 60.0 + number("second")
    days = _days(np.asarray(text("date").to_numpy(zero_copy_only=False), dtype=object), whole)
    # Whole seconds first: the difference of large numbers would cost digits of the fraction.
    return np.asarray((whole + days * _DAY - whole[0]) + (fraction - fraction[0]))


def _days(dates: NDArray[np.object_], whole: FloatArray) -> FloatArray:
    """Return days since the first stamp."""
    if len(dates) and dates[0]:
        steps = np.asarray(dates[1:] != dates[:-1], dtype=np.float64)
    else:
        steps = np.asarray(np.diff(whole) < -_DAY / 2.0, dtype=np.float64)
    return np.concatenate(([0.0], np.cumsum(steps)))


# Rows to numbers: pyarrow.csv, and a slow twin that explains or drops.
#
# pyarrow refuses ragged rows and text in number columns but does not always say where. What it
# refuses is read again field by field, which ends in the exact line and channel.

_BLANK = ["", "nan", "NaN", "NAN"]
_THREADED = 4_000_000  # bytes; below it, starting threads costs more than it saves
_GROUPED = re.compile(r"[+-]?\d{1,3}(?P<mark>[ ,.'])\d{3}(?:(?P=mark)\d{3})*(?:[.,]\d+)?", re.ASCII)
_NOT_FINITE = {"nan", "+nan", "-nan", "inf", "+inf", "-inf", "infinity", "+infinity", "-infinity"}
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
        for found in LINE.finditer(self.rows, self.start):
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
        raise LogError(f"no data rows{'; first: ' * bool(first_bad)}{first_bad}", subject=text.name)

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
            found = LINE.match(text.rows, start)
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
    columns = _parsed(text, indices)
    if columns is None:
        return None
    needed = [columns[i] for channel, i in wanted.items() if channel not in EXTRAS]
    if text.drops_bad_rows and not all(np.isfinite(values).all() for values in needed):
        return None
    if any(np.isnan(columns[i]).any() for i in text.clocks if i in columns):
        return None
    return {channel: columns[index] for channel, index in wanted.items()}


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
        raise LogError("a quote opens and does not close in the line", subject=where)
    fields = fields_of(line, text.dialect.separator)
    if len(fields) != text.n_fields:
        has_names = text.dialect.names_line and not text.dialect.is_short
        line_above = text.dialect.names_line if has_names else text.dialect.data_line
        raise LogError(
            f"found {len(fields)} field{'s' * (len(fields) != 1)}, expected "
            f"{text.n_names} fields as in line {line_above}{_advice(text)}",
            subject=where,
        )
    if text.n_fields > text.n_names and fields[-1]:
        raise LogError(
            f"found {visible(fields[-1])} after the last named column; "
            f"expected {text.n_names} fields",
            subject=where,
        )
    return {
        channel: _stamp(fields[index], channel, where)
        if index in text.clocks
        else _number(text, fields[index], channel, where)
        for channel, index in wanted.items()
    }


def _stamp(field: str, channel: str, where: str) -> str:
    if not is_stamp(field):
        raise LogError(f"{channel} is {visible(field)}, expected a time of day", subject=where)
    return field


def _number(text: TextRows, field: str, channel: str, where: str) -> float:
    plain = field
    is_grouped = _GROUPED.fullmatch(field)
    if text.declared.thousands and is_grouped and is_grouped["mark"] == text.declared.thousands:
        plain = plain.replace(text.declared.thousands, "")
    if text.dialect.decimal == ",":
        plain = "?" if "." in plain else plain.replace(",", ".")
    if NUMBER.fullmatch(plain) or not plain or plain.lower() in _NOT_FINITE:
        value = float(plain or "nan")
        if text.drops_bad_rows and channel not in EXTRAS and not np.isfinite(value):
            raise LogError(
                f"{channel} is {visible(field)}, expected a finite number", subject=where
            )
        return value
    hint = _advice(text)
    if is_grouped:
        hint = "; if it has a mark of thousands, declare rig.thousands"
        if is_grouped["mark"] == "," != text.dialect.decimal:
            hint += ", if a decimal comma, rig.decimal"
    raise LogError(f"{channel} is {visible(field)}, expected a number{hint}", subject=where)


# Blocks of one file whose titles alone tell time: a record without a column for it.
#
# A controller stamps each buffer that it writes. Where whole buffers follow each other at a steady
# rate they are one record, and its sample rate is their rows by the time between their titles. One
# title says neither whether it stands for the first row or the last, nor how long the block took.

_TIME = re.compile(
    r"\b(?:Time|Zeit):\s*(\d+(?:[.,]\d+)?)\s*(?:s|sec|seconds?|Sek)\b", re.IGNORECASE
)
_FEWEST = 3  # blocks: one step between two of them could be anything
_STEADY = 0.01  # of a step


def with_time_of_titles(tables: Sequence[Table], options: ReadOptions) -> tuple[Table, ...]:
    """Return blocks without a column for time as one table, where their titles tell its rate.

    Parameters
    ----------
    tables : sequence of Table
        The blocks of a file in their order; as they are where they have a column for time, or a
        rate is declared.
    options : ReadOptions
        What is declared.
    """
    stamps = [_TIME.search(table.part) for table in tables]
    has_time = any(has_channel("time", table.columns, options) for table in tables)
    if has_time or options.sample_rate > 0.0 or not all(stamps):
        return tuple(tables)
    times = np.array([float(found[1].replace(",", ".")) for found in stamps if found])
    rate = _rate(tables, times)
    if rate is None:
        hint = (
            "only the titles of its blocks give a time, and no steady rate; if the rate is known: "
            "--rig sample_rate=HZ"
        )
        return tuple(replace(table, hint=table.hint or hint) for table in tables)
    n = len(tables)
    note = f"{n} blocks joined; time: {rate:g} Hz, by the times in their titles"
    return (_joined(tables, rate, note),)


def _rate(tables: Sequence[Table], times: np.ndarray) -> float | None:
    """Return the sample rate, Hz; None where the blocks are not known to be one record."""
    first = tables[0]
    is_alike = all(
        (table.columns, table.metadata) == (first.columns, first.metadata) for table in tables
    )
    if len(tables) < _FEWEST or not is_alike:
        return None
    try:
        rows = [len(table.load({"any": 0}).channels["any"]) for table in tables]
    except LogError:  # said with the place when the channels are read
        return None
    # The last buffer may not be full: its step is as long as itself, or as the one before.
    steps = np.diff(times if rows[-1] == rows[0] else times[:-1])
    if len(set(rows[:-1])) > 1 or rows[-1] > rows[0] or not len(steps):
        return None
    usual = median(steps)
    if not usual > 0.0 or np.abs(steps / usual - 1.0).max() > _STEADY:
        return None
    return rows[0] * len(steps) / float(steps.sum())


def _joined(tables: Sequence[Table], rate: float, note: str) -> Table:
    def load(wanted: Mapping[str, int]) -> Samples:
        parts = [table.load(wanted) for table in tables]
        lengths = [len(next(iter(part.channels.values()))) for part in parts]
        ends = np.cumsum(lengths)

        def place(index: int) -> str:
            block = min(int(np.searchsorted(ends, index, side="right")), len(parts) - 1)
            return parts[block].place(index - int(ends[block]) + lengths[block])

        return Samples(
            {name: np.concatenate([part.channels[name] for part in parts]) for name in wanted},
            place,
            tuple(dict.fromkeys(text for part in parts for text in part.notes)),
            tuple(dict.fromkeys(one for part in parts for one in part.findings)),
        )

    first = tables[0]
    return replace(
        first,
        load=load,
        metadata={**first.metadata, "sample rate": repr(rate)},
        notes=(*first.notes, note),
        findings=tuple(dict.fromkeys(one for table in tables for one in table.findings)),
        may_run_on=False,
    )


# A line that begins a block of MTS text. What stands above the first one is the file's preamble.
_BLOCK = re.compile(rb'(?m)^"?Data Acquisition\b[^\r\n]*(?:\r\n|\n|\r|\Z)')
# "MTS793|MPT|ENU|1|2|.|/|:|...": language, ..., decimal mark, marks of date and time.
_MTS793 = re.compile(
    rb"MTS793\|[^|\r\n]*\|(?P<language>[A-Z]{0,8})\|[^|\r\n]*\|[^|\r\n]*\|(?P<decimal>[.,])\|"
)
# What a row of data begins with; stands in no line of names or units.
_DATA = re.compile(rb'(?m)^[ \t"]*[+-]?[.,]?\d')
_EVENTS = re.compile(r"events?|markers?|comments?|remarks?|notes?", re.IGNORECASE)
_MAX_PREAMBLE = 100_000  # bytes; what is longer is no preamble
_FIRST_LINE = re.compile(rb"[^\r\n]*")


@dataclass(frozen=True, slots=True, eq=False)
class _Block:
    """Bytes of one table with its names, and where they stand in the file."""

    data: bytes
    first_line: int
    name: str
    decimal: str = ""
    title: str = ""
    preamble: tuple[str, ...] = ()  # lines above the first block


def read_delimited(source: Source, options: ReadOptions) -> tuple[Table, ...]:
    """Return the tables of a delimited text log: one, or one for each block.

    Raises
    ------
    LogError
        The file is no text, has no rows of numbers, or its rows do not fit its names.
    """
    drops = options.bad_rows == "drop"
    data, notes = to_utf8(
        source.data, name=source.name, encoding=options.encoding, allows_nul=drops
    )
    data, skipped = _without_lines(data, options.skip_lines, source.name)
    if skipped:
        notes = (*notes, f"{skipped} lines skipped, as declared")
    if header := _MTS793.match(data):
        notes = (*notes, f"MTS 793 export, language {header['language'].decode()}")
    blocks = _blocks(data, skipped + 1, source.name)
    empty = [block for block in blocks if block.title and not _DATA.search(block.data)]
    if 0 < len(empty) < len(blocks):
        others = f" and {len(empty) - 1} more" if len(empty) > 1 else ""
        notes = (*notes, f"left out: the block in line {empty[0].first_line}{others}, without rows")
        blocks = [block for block in blocks if block.title and _DATA.search(block.data)]
    tables = tuple(_read_block(block, notes, options) for block in blocks)
    return with_time_of_titles(tables, options)


def _without_lines(data: bytes, n_lines: int, name: str) -> tuple[bytes, int]:
    start = 0
    for _ in range(n_lines):
        end = _LINE_END.search(data, start)
        if end is None:
            raise LogError(f"fewer lines than the {n_lines} to skip (skip_lines)", subject=name)
        start = end.end()
    return data[start:], n_lines


def _blocks(data: bytes, first_line: int, name: str) -> list[_Block]:
    """Return the whole text, or the pieces that MTS heads with "Data Acquisition"."""
    has_blocks = data.find(b"Data Acquisition", 0, _MAX_PREAMBLE) >= 0
    starts = list(_BLOCK.finditer(data)) if has_blocks else []
    header = _MTS793.match(data)
    decimal = header["decimal"].decode() if header else ""
    if not starts:
        return [_Block(data, first_line, name, decimal)]
    blocks = []
    above = data[: starts[0].start()]
    preamble = tuple(above[:_MAX_PREAMBLE].decode("utf-8", "replace").splitlines())
    line = first_line + _count_lines(above)
    ends = [found.start() for found in starts[1:]] + [len(data)]
    for found, end in zip(starts, ends, strict=True):
        piece = data[found.end() : end]
        line += 1
        title = found[0].decode("utf-8", "replace").strip().replace("\t", " ")
        if piece.strip():
            blocks.append(_Block(piece, line, name, decimal, title, preamble))
        line += _count_lines(piece)
    if not blocks:
        raise LogError(f"no data rows after 'Data Acquisition' in line {line - 1}", subject=name)
    return blocks


def _count_lines(data: bytes) -> int:
    return len(_LINE_END.findall(data))


def _read_block(block: _Block, notes: tuple[str, ...], options: ReadOptions) -> Table:
    name = block.name
    dialect = find_dialect(block.data, options, name=name, first_line=block.first_line)
    if block.decimal and not options.decimal and block.decimal != dialect.decimal:
        dialect = replace(dialect, decimal=block.decimal)
    start = dialect.data_offset
    rows, cut = _without_cut_row(block.data, start, name)
    is_open = dialect.separator != "," and not options.decimal and not block.decimal
    if is_open and rows.find(b".", start) < 0 <= rows.find(b",", start):
        # The first rows may hold whole numbers only, as of a machine at rest.
        dialect = replace(dialect, decimal=",")
    notes = (*notes, *dialect.notes())
    if dialect.separator == " ":
        rows, start = _with_tabs(rows[start:]), 0
        dialect = replace(dialect, separator="\t")
    if _lacks_events(rows, dialect):
        rows, start = _with_events(rows[start:], dialect), 0
    first = _FIRST_LINE.match(rows, start)
    fields = fields_of(first[0].decode("utf-8", "replace") if first else "", dialect.separator)
    names, n_fields, extra = _width(fields, dialect, name)
    dialect = replace(dialect, names=names, units=dialect.units[: len(names)])
    clocks = frozenset(i for i, field in enumerate(fields[: len(names)]) if is_stamp(field))
    text = TextRows(name, rows, start, dialect, len(names), n_fields, clocks, options)
    if not text.drops_bad_rows:
        _check_quotes(text)
    return Table(
        columns=_columns(names, dialect, clocks),
        load=lambda wanted: load_rows(text, wanted),
        metadata=metadata_of([*block.preamble, *dialect.preamble]),
        notes=notes,
        part=block.title,
        may_run_on=bool(block.title),
        hint=dialect.hint or next((one.sentence for one in extra if one.name == "short_rows"), ""),
        findings=(*extra, *cut),
    )


def _without_cut_row(text: bytes, start: int, name: str) -> tuple[bytes, tuple[Finding, ...]]:
    """Drop a last row without line end: -12 may be what was written of -1234."""
    if text.endswith((b"\n", b"\r")):
        return text, ()
    end = max(text.rfind(b"\n", start), text.rfind(b"\r", start)) + 1 or start
    if not text[end:].strip():
        return text[:end], ()
    if end == start:
        raise LogError("no data rows; the only one has no line end and may be cut", subject=name)
    words = "no final newline; the last row may be cut and was dropped; is the log whole?"
    return text[:end], (Finding("cut_row", "warning", words, 1.0),)


def _with_tabs(rows: bytes) -> bytes:
    rows = re.sub(rb"[ \t]+", b"\t", rows)
    return re.sub(rb"(?m)^\t|\t(?=\r?$)", b"", rows)


def _lacks_events(rows: bytes, dialect: Dialect) -> bool:
    """Say whether the last column may be one that only rows with an event have."""
    is_named = len(dialect.names) >= 2 and _EVENTS.fullmatch(dialect.names[-1]) is not None
    return is_named and b'"' not in rows


def _with_events(rows: bytes, dialect: Dialect) -> bytes:
    """Give the last column to every row."""
    n_before = len(dialect.names) - 2
    separator = dialect.separator.encode()
    lines = _LINE_END.sub(b"\n", rows).split(b"\n")
    return b"\n".join(
        line + separator if line.count(separator) == n_before else line for line in lines
    )


def _width(
    fields: list[str], dialect: Dialect, name: str
) -> tuple[tuple[str, ...], int, tuple[Finding, ...]]:
    """Return names, number of fields in a row, and findings.

    A separator at the end may add a field; of names one more than fields the last has no values.
    """
    names = dialect.names or ("",) * len(fields)
    is_short = dialect.is_short and len(fields) == len(names) - 1
    widths = {len(names), len(fields)} if is_short else {len(names)}
    if dialect.units and len(dialect.units) not in widths:
        raise LogError(
            f"{name}, line {dialect.names_line + 1}: {len(dialect.units)} units for "
            f"{len(names)} names in line {dialect.names_line}"
        )
    if is_short:
        line = (
            f"line {dialect.names_line} has {len(names)} names and every row {len(fields)} fields"
        )
        note = f"{line}: the last, {visible(names[-1])}, was taken to have no values"
        return names[:-1], len(fields), (Finding("short_rows", "warning", note),)
    if len(fields) == len(names) + 1 and not fields[-1]:
        note = "every row ends in a separator; the empty last column was left out"
        return names, len(names) + 1, (Finding("extra_separator", "warning", note),)
    return names, len(names), ()


def _columns(
    names: tuple[str, ...], dialect: Dialect, clocks: frozenset[int]
) -> tuple[Column, ...]:
    units = dialect.units or ("",) * len(names)
    return tuple(
        Column(name, unit or None, is_clock=i in clocks)
        for i, (name, unit) in enumerate(zip(names, units, strict=True))
    )


def _check_quotes(text: TextRows) -> None:
    if not text.has_quotes:
        return
    for number, line in text.lines():
        if line.count('"') % 2:
            raise LogError(
                f"{text.name}, line {number}: a quote opens and does not close in the line"
            )
