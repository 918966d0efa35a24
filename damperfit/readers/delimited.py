"""Delimited text of every dialect, in one block or in several (MTS).

Text logs have no format. Names stand above the rows of numbers, units in them, in a row of their
own or nowhere; above that may stand prose, entries ``key: value`` and rows that look like data. MTS
793 heads each test with a line "Data Acquisition", and the file with a line that names language and
decimal mark; Instron's entries have a value and a unit.

Traps. A rig that is still writing leaves a last line without an end, and -12 of -1234 is a number
too. Every row may end in a separator, which shifts the columns of a careless reader by one. A
column of events may be there in the rows with an event only. Whole numbers of a machine at rest say
nothing of the decimal mark. One dropped byte joins two rows.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from damperfit.errors import LogError
from damperfit.readers.channels import visible
from damperfit.readers.clock import is_stamp
from damperfit.readers.dialect import Dialect, fields_of, metadata_of
from damperfit.readers.encoding import to_utf8
from damperfit.readers.known_dialects import dialect_of
from damperfit.readers.rows import TextRows, load_rows
from damperfit.readers.table import Column, Table
from damperfit.readers.title_time import with_time_of_titles
from damperfit.recording import Finding

if TYPE_CHECKING:
    from damperfit.readers.files import Source
    from damperfit.readers.options import ReadOptions

__all__ = ["read_delimited"]

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
_LINE_END = re.compile(rb"\r\n|\n|\r")


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
            raise LogError(f"{name}: fewer lines than the {n_lines} to skip (skip_lines)")
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
        raise LogError(f"{name}: no data rows after 'Data Acquisition' in line {line - 1}")
    return blocks


def _count_lines(data: bytes) -> int:
    return len(_LINE_END.findall(data))


def _read_block(block: _Block, notes: tuple[str, ...], options: ReadOptions) -> Table:
    name = block.name
    dialect = dialect_of(block.data, options, name=name, first_line=block.first_line)
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
        raise LogError(f"{name}: no data rows; the only one has no line end and may be cut")
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
