"""Delimited text of every dialect, in one block or in several (MTS).

Text logs have no format. Names stand above the rows of numbers, units in them, in a row of their
own or nowhere; above that may stand prose, entries ``key: value`` and rows that look like data. MTS
793 heads each test with a line "Data Acquisition", and the file with a line that names language and
decimal mark; Instron's entries have a value and a unit. `dialect` finds how a log is written.

Traps. A rig that is still writing leaves a last line without an end, and -12 of -1234 is a number
too. Every row may end in a separator, which shifts the columns of a careless reader by one. A
column of events may be there in the rows with an event only. Whole numbers of a machine at rest say
nothing of the decimal mark. One dropped byte joins two rows. A controller may write one record in
buffers whose titles alone tell time.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from damperfit.errors import LogError
from damperfit.io.channels import has_channel, visible
from damperfit.io.dialect import LINE, NUMBER, Dialect, fields_of, find_dialect, metadata_of
from damperfit.io.files import Source, to_utf8
from damperfit.io.formats import Column, FloatArray, Samples, Table
from damperfit.io.options import EXTRAS, Declarations, ReadOptions
from damperfit.recording import Finding
from damperfit.statistics import median

__all__ = [
    "Block",
    "clock_seconds",
    "is_stamp",
    "joined_samples",
    "read_block",
    "read_delimited",
    "rows_dropped",
]

# Wall-clock stamps to seconds from the first one. The date is only compared with the one above, so
# that day and month need not be told apart; each change of date is one day.
_DAY = 86_400.0  # s
# In the common subset of Python's and Arrow's regular expressions.
_PATTERN = (
    r"^\s*(?P<date>\d{1,4}[-/.]\d{1,2}[-/.]\d{1,4}[T ]+)?"
    r"(?P<hour>\d{1,2}):(?P<minute>\d{2}):(?P<second>\d{2})(?:[.,](?P<fraction>\d{1,9}))?"
    r"\s*(?P<half>[AaPp]\.?[Mm]\.?)?\s*(?:Z|UTC|[+-]\d{2}:?\d{2})?\s*$"
)
_STAMP = re.compile(_PATTERN, re.ASCII)

_BLANK = ["", "nan", "NaN", "NAN"]
_THREADED = 4_000_000  # bytes; below it, starting threads costs more than it saves
_GROUPED = re.compile(r"[+-]?\d{1,3}(?P<mark>[ ,.'])\d{3}(?:(?P=mark)\d{3})*(?:[.,]\d+)?", re.ASCII)
_NOT_FINITE = re.compile(r"[+-]?(?:nan|inf|infinity)", re.IGNORECASE)
_LINE_END = re.compile(rb"\r\n|\n|\r")
_PIECE = 1_000_000  # bytes

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

_TITLE_TIME = re.compile(
    r"\b(?:Time|Zeit):\s*(\d+(?:[.,]\d+)?)\s*(?:s|sec|seconds?|Sek)\b", re.IGNORECASE
)
_FEWEST = 3  # blocks: one step between two of them could be anything
_STEADY = 0.01  # of a step


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
    stamps : sequence of str or pyarrow.ChunkedArray
        Text, shape (n,).
    """
    import pyarrow as pa
    from pyarrow import compute

    if not isinstance(stamps, pa.ChunkedArray):
        stamps = pa.chunked_array([pa.array(stamps, pa.string())])
    if not len(stamps):
        return np.zeros(0)
    parts = compute.extract_regex(stamps, _PATTERN)

    def texts(field: str) -> NDArray[np.object_]:
        return np.asarray(compute.struct_field(parts, field).to_pylist(), dtype=object)

    def numbers(field: str) -> FloatArray:
        text = compute.struct_field(parts, field)
        filled = compute.if_else(compute.equal(text, ""), "0", text)
        return _column_floats(filled.cast(pa.float64()))

    fraction = compute.struct_field(parts, "fraction")
    digits = _column_floats(compute.utf8_length(fraction).cast(pa.float64()))
    tenths = numbers("fraction") / 10.0**digits
    hour, dates = numbers("hour"), texts("date")
    half = np.array([text[:1].lower() if text else "" for text in texts("half")])
    hour = np.where(half == "", hour, hour % 12.0 + 12.0 * (half == "p"))
    whole = hour * 3600.0 + numbers("minute") * 60.0 + numbers("second")
    is_next = dates[1:] != dates[:-1] if dates[0] else np.diff(whole) < -_DAY / 2.0
    days = np.concatenate(([0.0], np.cumsum(np.asarray(is_next, dtype=np.float64))))
    # Whole seconds first: the difference of large numbers would cost digits of the fraction.
    return np.asarray((whole + days * _DAY - whole[0]) + (tenths - tenths[0]))


def _column_floats(column: Any) -> FloatArray:
    """Return a float64 column, nulls as NaN, from its buffers: to_numpy() imports pandas first."""
    parts = [np.empty(0)]
    for chunk in column.chunks:
        validity, data = chunk.buffers()
        rows = slice(chunk.offset, chunk.offset + len(chunk))
        values = np.frombuffer(data, dtype=np.float64)[rows]
        if chunk.null_count:
            bits = np.unpackbits(np.frombuffer(validity, dtype=np.uint8), bitorder="little")[rows]
            values = np.where(bits.astype(np.bool_), values, np.nan)
        parts.append(values)
    return np.concatenate(parts[1:] if len(parts) > 1 else parts)


def rows_dropped(n_bad: int, first_bad: str) -> tuple[Finding, ...]:
    """Return the finding that rows were dropped; none where there were none."""
    if not n_bad:
        return ()
    sentence = f"{n_bad} row{'s' * (n_bad != 1)} that cannot be read dropped; {first_bad}"
    return (Finding("rows_dropped", "warning", sentence, float(n_bad)),)


@dataclass(frozen=True, slots=True, eq=False)
class _Rows:
    """Rows of data as UTF-8 bytes, of which every row ends, and how to read them.

    pyarrow reads them fast, but refuses ragged rows and text in number columns without always
    saying where. What it refuses is read again piece by piece, and a piece that it refuses field by
    field, which ends in the exact line and channel, or drops them.
    """

    name: str  # of the log, for messages
    rows: bytes
    start: int  # of the first row; a copy of a large log without its head would cost time
    dialect: Dialect
    n_names: int
    n_fields: int  # in a row; one more than names when every row ends in a separator
    clocks: frozenset[int]  # columns of wall-clock stamps
    declared: Declarations

    @property
    def drops_bad_rows(self) -> bool:
        return self.declared.bad_rows == "drop"

    @property
    def has_quotes(self) -> bool:
        return self.rows.find(b'"', self.start) >= 0

    def lines(self) -> Iterator[tuple[int, str]]:
        """Yield number and text of each row that is not blank."""
        for number, match in enumerate(
            LINE.finditer(self.rows, self.start), start=self.dialect.data_line
        ):
            if match[1]:
                yield number, match[1].decode("utf-8", "replace")

    def place(self, index: int) -> str:
        """Return the line of a sample when no row was dropped."""
        at = (f"line {number}" for i, (number, _) in enumerate(self.lines()) if i == index)
        return next(at, f"row {index + 1}")

    def load(self, wanted: Mapping[str, int]) -> Samples:
        """Return columns as floats.

        Raises
        ------
        LogError
            A row has too few or too many fields, or text where a number should be.
        """
        if (columns := self._fast(wanted)) is not None:
            return Samples(columns, self.place)
        pieces = []
        for rows in [self] if self.clocks else self._cut():
            columns = None if rows is self else rows._fast(wanted)  # noqa: SLF001  # its own class
            fast = columns and Samples(columns, rows.place)
            pieces.append((fast, 0, "") if fast else rows._slow(wanted))  # noqa: SLF001
        n_bad = sum(n for _, n, _ in pieces)
        first_bad = next((first for _, _, first in pieces if first), "")
        samples = joined_samples([samples for samples, _, _ in pieces])
        if not len(next(iter(samples.channels.values()))):
            raise LogError(
                f"no data rows{'; first: ' * bool(first_bad)}{first_bad}", subject=self.name
            )
        return replace(samples, findings=rows_dropped(n_bad, first_bad))

    def _cut(self) -> Iterator[_Rows]:
        """Yield the rows in pieces of whole lines."""
        start, line, end = self.start, self.dialect.data_line, len(self.rows)
        while start < end:
            last = LINE.match(self.rows, min(start + _PIECE, end))
            stop = last.end() if last else end
            rows = self.rows[start:stop]
            yield replace(self, rows=rows, start=0, dialect=replace(self.dialect, data_line=line))
            line += len(_LINE_END.findall(rows))
            start = stop

    def _fast(self, wanted: Mapping[str, int]) -> dict[str, FloatArray] | None:
        """Return columns as pyarrow reads them; None where it refuses, or rows must be dropped."""
        import pyarrow as pa
        from pyarrow import csv

        names = [f"{i}" for i in range(self.n_fields)]
        extra = names[self.n_names :]  # anything in it is an error
        chosen = dict.fromkeys(names[i] for i in sorted(wanted.values()))
        types = {name: pa.string() if int(name) in self.clocks else pa.float64() for name in chosen}
        try:
            table = csv.read_csv(
                pa.BufferReader(pa.py_buffer(self.rows).slice(self.start)),
                read_options=csv.ReadOptions(
                    column_names=names, use_threads=len(self.rows) > _THREADED
                ),
                parse_options=csv.ParseOptions(
                    delimiter=self.dialect.separator, quote_char='"' if self.has_quotes else False
                ),
                convert_options=csv.ConvertOptions(
                    column_types={**types, **dict.fromkeys(extra, pa.null())},
                    include_columns=[*chosen, *extra],
                    null_values=_BLANK,
                    decimal_point=self.dialect.decimal,
                ),
            )
            columns = {
                name: clock_seconds(table.column(name))
                if int(name) in self.clocks
                else _column_floats(table.column(name))
                for name in chosen
            }
        except (pa.ArrowException, ValueError):
            return None
        read = {channel: columns[names[index]] for channel, index in wanted.items()}
        if self.drops_bad_rows:
            needed = [read[channel] for channel in wanted if channel not in EXTRAS]
            if not all(np.isfinite(values).all() for values in needed):
                return None
        clocks = [columns[name] for name in chosen if int(name) in self.clocks]
        return None if any(np.isnan(values).any() for values in clocks) else read

    def _slow(self, wanted: Mapping[str, int]) -> tuple[Samples, int, str]:
        """Read field by field: the values, how many rows were dropped, and why the first was."""
        lines: list[int] = []
        values: list[list[float | str]] = []
        n_bad, first_bad = 0, ""
        for number, line in self.lines():
            try:
                row = self._values(line, wanted, f"{self.name}, line {number}")
            except LogError as error:
                if not self.drops_bad_rows:
                    raise
                n_bad += 1
                first_bad = first_bad or str(error)
                continue
            lines.append(number)
            values.append(row)
        columns: dict[str, FloatArray] = {}
        for k, (channel, index) in enumerate(wanted.items()):
            column = [row[k] for row in values]
            is_clock = index in self.clocks
            columns[channel] = clock_seconds(column) if is_clock else np.array(column, float)
        return Samples(columns, lambda i: f"line {lines[i]}"), n_bad, first_bad

    def _values(self, line: str, wanted: Mapping[str, int], where: str) -> list[float | str]:
        if line.count('"') % 2:
            raise LogError("a quote opens and does not close in the line", subject=where)
        fields = fields_of(line, self.dialect.separator)
        if len(fields) != self.n_fields:
            has_names = self.dialect.names_line and not self.dialect.is_short
            line_above = self.dialect.names_line if has_names else self.dialect.data_line
            raise LogError(
                f"found {len(fields)} field{'s' * (len(fields) != 1)}, expected "
                f"{self.n_names} fields as in line {line_above}{self._advice}",
                subject=where,
            )
        if self.n_fields > self.n_names and fields[-1]:
            raise LogError(
                f"found {visible(fields[-1])} after the last named column; "
                f"expected {self.n_names} fields",
                subject=where,
            )
        return [
            self._value(fields[index], channel, where, is_clock=index in self.clocks)
            for channel, index in wanted.items()
        ]

    @property
    def _advice(self) -> str:
        drop = "; repair the row, or drop such rows by rig.bad_rows = 'drop'"
        return "" if self.drops_bad_rows else drop

    def _value(self, field: str, channel: str, where: str, *, is_clock: bool) -> float | str:
        shown = f"{channel} is {visible(field)}, expected"
        if is_clock:
            if not is_stamp(field):
                raise LogError(f"{shown} a time of day", subject=where)
            return field
        plain = field
        grouped = _GROUPED.fullmatch(field)
        if self.declared.thousands and grouped and grouped["mark"] == self.declared.thousands:
            plain = plain.replace(self.declared.thousands, "")
        if self.dialect.decimal == ",":
            plain = "?" if "." in plain else plain.replace(",", ".")
        if not plain or NUMBER.fullmatch(plain) or _NOT_FINITE.fullmatch(plain):
            value = float(plain or "nan")
            if self.drops_bad_rows and channel not in EXTRAS and not np.isfinite(value):
                raise LogError(f"{shown} a finite number", subject=where)
            return value
        hint = self._advice
        if grouped:
            hint = "; if it has a mark of thousands, declare rig.thousands"
            if grouped["mark"] == "," != self.dialect.decimal:
                hint += ", if a decimal comma, rig.decimal"
        raise LogError(f"{shown} a number{hint}", subject=where)


def joined_samples(parts: Sequence[Samples]) -> Samples:
    """Return the rows of several tables behind each other."""
    names = parts[0].channels
    lengths = [len(part.channels[name]) for part in parts for name in [*names][:1]]
    ends = np.cumsum(lengths)

    def place(index: int) -> str:
        k = min(int(np.searchsorted(ends, index, side="right")), len(parts) - 1)
        return parts[k].place(index - int(ends[k]) + lengths[k])

    return Samples(
        {name: np.concatenate([part.channels[name] for part in parts]) for name in names},
        place,
        tuple(dict.fromkeys(note for part in parts for note in part.notes)),
        tuple(dict.fromkeys(finding for part in parts for finding in part.findings)),
    )


class Block(NamedTuple):
    """Bytes of one table with its names, and where they stand in the file."""

    data: bytes
    first_line: int
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
    name, drops = source.name, options.bad_rows == "drop"
    data, notes = to_utf8(source.data, name=name, encoding=options.encoding, allows_nul=drops)
    skipped = 0
    for _ in range(options.skip_lines):
        end = _LINE_END.search(data, skipped)
        if end is None:
            n_lines = options.skip_lines
            raise LogError(f"fewer lines than the {n_lines} to skip (skip_lines)", subject=name)
        skipped = end.end()
    if skipped:
        data = data[skipped:]
        notes = (*notes, f"{options.skip_lines} lines skipped, as declared")
    if header := _MTS793.match(data):
        notes = (*notes, f"MTS 793 export, language {header['language'].decode()}")
    blocks = _blocks(data, options.skip_lines + 1, name)
    empty = [block for block in blocks if block.title and not _DATA.search(block.data)]
    if 0 < len(empty) < len(blocks):
        others = f" and {len(empty) - 1} more" if len(empty) > 1 else ""
        notes = (*notes, f"left out: the block in line {empty[0].first_line}{others}, without rows")
        blocks = [block for block in blocks if block not in empty]
    tables = tuple(read_block(block, name, notes, options) for block in blocks)
    return _with_time_of_titles(tables, options)


def _blocks(data: bytes, first_line: int, name: str) -> list[Block]:
    """Return the whole text, or the pieces that MTS heads with "Data Acquisition"."""
    has_blocks = data.find(b"Data Acquisition", 0, _MAX_PREAMBLE) >= 0
    starts = list(_BLOCK.finditer(data)) if has_blocks else []
    header = _MTS793.match(data)
    decimal = header["decimal"].decode() if header else ""
    if not starts:
        return [Block(data, first_line, decimal)]
    blocks = []
    above = data[: starts[0].start()]
    preamble = tuple(above[:_MAX_PREAMBLE].decode("utf-8", "replace").splitlines())
    line = first_line + len(_LINE_END.findall(above))
    ends = [begin.start() for begin in starts[1:]] + [len(data)]
    for begin, end in zip(starts, ends, strict=True):
        piece = data[begin.end() : end]
        line += 1
        title = begin[0].decode("utf-8", "replace").strip().replace("\t", " ")
        if piece.strip():
            blocks.append(Block(piece, line, decimal, title, preamble))
        line += len(_LINE_END.findall(piece))
    if not blocks:
        raise LogError(f"no data rows after 'Data Acquisition' in line {line - 1}", subject=name)
    return blocks


def read_block(block: Block, name: str, notes: tuple[str, ...], options: ReadOptions) -> Table:
    """Return the table of a block; as `read_delimited`."""
    dialect = find_dialect(block.data, options, name=name, first_line=block.first_line)
    start = dialect.data_offset
    rows, cut = _without_cut_row(block.data, start, name)
    if not options.decimal and block.decimal:
        dialect = replace(dialect, decimal=block.decimal)
    is_open = not options.decimal and not block.decimal and dialect.separator != ","
    if is_open and rows.find(b".", start) < 0 <= rows.find(b",", start):
        # The first rows may hold whole numbers only, as of a machine at rest.
        dialect = replace(dialect, decimal=",")
    notes = (*notes, *dialect.notes())
    if dialect.separator == " ":
        rows, start = re.sub(rb"[ \t]+", b"\t", rows[start:]), 0
        rows = re.sub(rb"(?m)^\t|\t(?=\r?$)", b"", rows)
        dialect = replace(dialect, separator="\t")
    if len(dialect.names) >= 2 and _EVENTS.fullmatch(dialect.names[-1]) and b'"' not in rows:
        rows, start = _with_events(rows[start:], dialect), 0
        dialect = replace(dialect, is_short=False)
    first = _FIRST_LINE.match(rows, start)
    fields = fields_of(first[0].decode("utf-8", "replace") if first else "", dialect.separator)
    names, n_fields, odd = _width(fields, dialect, name)
    clocks = frozenset(i for i, field in enumerate(fields[: len(names)]) if is_stamp(field))
    text = _Rows(name, rows, start, dialect, len(names), n_fields, clocks, options)
    if not text.drops_bad_rows and text.has_quotes:
        for number, line in text.lines():
            if line.count('"') % 2:
                raise LogError(
                    f"{name}, line {number}: a quote opens and does not close in the line"
                )
    units = dialect.units[: len(names)] or ("",) * len(names)
    return Table(
        columns=tuple(
            Column(column, unit or None, i in clocks)
            for i, (column, unit) in enumerate(zip(names, units, strict=True))
        ),
        load=text.load,
        metadata=metadata_of([*block.preamble, *dialect.preamble]),
        notes=notes,
        part=block.title,
        may_run_on=bool(block.title),
        hint=dialect.hint or next((one.sentence for one in odd if one.name == "short_rows"), ""),
        findings=(*odd, *cut),
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


def _with_events(rows: bytes, dialect: Dialect) -> bytes:
    """Give the last column, which only rows with an event may have, to every row."""
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
    is_short = dialect.is_short
    fields = fields[: len(names) - 1] if is_short else fields
    widths = {len(names), len(fields)} if is_short else {len(names)}
    if dialect.units and len(dialect.units) not in widths:
        raise LogError(
            f"{name}, line {dialect.names_line + 1}: {len(dialect.units)} units for "
            f"{len(names)} names in line {dialect.names_line}"
        )
    if is_short:
        note = (
            f"line {dialect.names_line} has {len(names)} names and every row {len(fields)} "
            f"fields: the last, {visible(names[-1])}, was taken to have no values"
        )
        return names[:-1], len(fields), (Finding("short_rows", "warning", note),)
    if len(fields) == len(names) + 1 and not fields[-1]:
        note = "every row ends in a separator; the empty last column was left out"
        return names, len(names) + 1, (Finding("extra_separator", "warning", note),)
    return names, len(names), ()


def _with_time_of_titles(tables: tuple[Table, ...], options: ReadOptions) -> tuple[Table, ...]:
    """Return blocks without a column for time as one table, where their titles tell its rate.

    Where whole buffers follow each other at a steady rate they are one record, and its sample rate
    is their rows by the time between their titles. One title says neither whether it stands for the
    first row or the last, nor how long the block took.
    """
    stamps = [match for table in tables if (match := _TITLE_TIME.search(table.part))]
    has_time = any(has_channel("time", table.columns, options) for table in tables)
    if has_time or options.sample_rate > 0.0 or len(stamps) < len(tables):
        return tables
    rate = _rate(tables, np.array([float(stamp[1].replace(",", ".")) for stamp in stamps]))
    if rate is None:
        hint = (
            "only the titles of its blocks give a time, and no steady rate; if the rate is known: "
            "--rig sample_rate=HZ"
        )
        return tuple(replace(table, hint=table.hint or hint) for table in tables)
    first = tables[0]
    note = f"{len(tables)} blocks joined; time: {rate:g} Hz, by the times in their titles"
    whole = replace(
        first,
        load=lambda wanted: joined_samples([table.load(wanted) for table in tables]),
        metadata={**first.metadata, "sample rate": repr(rate)},
        notes=(*first.notes, note),
        findings=tuple(dict.fromkeys(one for table in tables for one in table.findings)),
        may_run_on=False,
    )
    return (whole,)


def _rate(tables: Sequence[Table], times: FloatArray) -> float | None:
    """Return the sample rate, Hz; None where the blocks are not known to be one record."""
    kinds = [(table.columns, table.metadata) for table in tables]
    if len(tables) < _FEWEST or kinds.count(kinds[0]) < len(kinds):
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
