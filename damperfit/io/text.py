"""Delimited text of every dialect, in one block or in several (MTS, LabVIEW).

Text logs have no format. Names stand above the rows of numbers, units in them, in a row of their
own or nowhere; above that may stand prose, entries ``key: value`` and rows that look like data. The
first row of data is where rows of mostly numbers with one count of fields begin. MTS 793 heads each
test with a line "Data Acquisition", and the file with a line that names language and decimal mark;
Instron's entries have a value and a unit; LabVIEW's .lvm
(https://www.ni.com/docs/en-US/bundle/labview/page/labview-measurement-file-format.html) has
segments, each with a header that gives units.

Traps. A rig that is still writing leaves a last line without an end, and -12 of -1234 is a number
too. Every row may end in a separator, which shifts the columns of a careless reader by one. A
column of events may exist only in the rows with an event. The whole numbers of a machine at rest do
not show the decimal mark. One dropped byte joins two rows. A controller may write one record in
buffers whose titles alone give the time.
"""

import csv
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import islice, takewhile
from typing import Any, NamedTuple

import numpy as np

from damperfit.errors import LogError
from damperfit.io.columns import has_channel, mentions_channel, visible
from damperfit.io.files import Source, to_utf8
from damperfit.io.formats import Column, FloatArray, Samples, Table
from damperfit.io.options import EXTRAS, ReadOptions
from damperfit.problem import Problem, counted, distinct, warning
from damperfit.sections import SEPARATORS
from damperfit.statistics import median
from damperfit.tested.identity import names_identity
from damperfit.units.quantities import is_unit

_HEAD_BYTES = 262_144
_HEAD_LINES = (40, 1_000)  # tried in turn: nearly all preambles are short
_MAX_COLUMNS = 2_000
_MARKS = {",": "comma", ";": "semicolon", "\t": "tab", "|": "bar", " ": "blanks"}  # runs of these
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)
_COMMA = re.compile(r"[+-]?(?:\d+,\d*|,\d+)(?:[eE][+-]?\d+)?", re.ASCII)
# A comma that may as well separate thousands. "0,125" may not: no group starts with a zero.
_THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2}(?:,\d{3})+", re.ASCII)
_GROUPED = re.compile(r"[+-]?\d{1,3}(?P<mark>[ ,.'])\d{3}(?:(?P=mark)\d{3})*(?:[.,]\d+)?", re.ASCII)
_NOT_FINITE = re.compile(r"[+-]?(?:nan|inf|infinity)", re.IGNORECASE)
_VALUE = re.compile(
    rf"{_NUMBER.pattern}|{_COMMA.pattern}|[+-]?(?i:nan|inf)|\d+[-/.:]\d+[-/.:]\d(?s:.*)", re.ASCII
)
_ENTRY = re.compile(r"[#%;\s]*(?P<key>[^:=,;\t]{1,60}?)\s*[:=]\s*(?P<value>.*?)[\s;,]*")
_CELLS = re.compile(r"[\s\"]*(?P<key>[^:=,;\t]{1,60}?)\"?\s*[,;\t]\s*(?P<value>[^;\t]*?)[\s;,]*")
_AMOUNT = re.compile(r"[+-]?\d+(?:[.,]\d+)?\s*[^\d,;]*")
_LINE = re.compile(rb"([^\r\n]*)(\r\n|\n|\r|\Z)")
_LINE_END = re.compile(rb"\r\n|\n|\r")
_EVENTS = re.compile(r"events?|markers?|comments?|remarks?|notes?", re.IGNORECASE)

# Wall-clock stamps to seconds from the first one. The date is only compared with the one above, so
# that day and month need not be distinguished; each change of date is one day. In the common subset
# of Python's and Arrow's regular expressions.
_DAY = 86_400.0  # s
_PATTERN = (
    r"^\s*(?P<date>\d{1,4}[-/.]\d{1,2}[-/.]\d{1,4}[T ]+)?"
    r"(?P<hour>\d{1,2}):(?P<minute>\d{2}):(?P<second>\d{2})(?:[.,](?P<fraction>\d{1,9}))?"
    r"\s*(?P<half>[AaPp]\.?[Mm]\.?)?\s*(?:Z|UTC|[+-]\d{2}:?\d{2})?\s*$"
)
_STAMP = re.compile(_PATTERN, re.ASCII)

_BLANK = ["", "nan", "NaN", "NAN"]
_PIECE = 1_000_000  # bytes
_THREADED = 4_000_000  # bytes; below it, starting threads costs more than it saves

# A line that begins a block of MTS text. What stands above the first one is the file's preamble.
_BLOCK = re.compile(rb'(?m)^"?Data Acquisition\b[^\r\n]*(?:\r\n|\n|\r|\Z)')
# "MTS793|MPT|ENU|1|2|.|/|:|...": language, ..., decimal mark, marks of date and time.
_MTS793 = re.compile(
    rb"MTS793\|[^|\r\n]*\|(?P<language>[A-Z]{0,8})\|[^|\r\n]*\|[^|\r\n]*\|(?P<decimal>[.,])\|"
)
# What a row of data begins with; stands in no line of names or units.
_DATA = re.compile(rb'(?m)^[ \t"]*[+-]?[.,]?\d')
_MAX_PREAMBLE = 100_000  # bytes; what is longer is no preamble
_TITLE_TIME = re.compile(
    r"\b(?:Time|Zeit):\s*(\d+(?:[.,]\d+)?)\s*(?:s|sec|seconds?|Sek)\b", re.IGNORECASE
)
_FEWEST = 3  # blocks: one step between two of them could be anything
_STEADY = 0.01  # of a step

_LVM_END = re.compile(rb"(?m)^\*\*\*End_of_Header\*\*\*[^\n]*\n")
_LVM_SEGMENT = re.compile(rb"(?m)^(?:Notes|Channels)\b")  # what a segment's header begins with
_LVM_ENTRY = re.compile(r"(?m)^(\w+)\t([^\r\n]*?)\s*$")


# Files: text in one block or in several.


class _Block(NamedTuple):
    """Bytes of one table with its names, and where they stand in the file."""

    data: bytes
    first_line: int
    decimal: str = ""
    title: str = ""
    preamble: tuple[str, ...] = ()  # lines above the first block


def read_delimited(source: Source, options: ReadOptions) -> tuple[Table, ...]:
    """Return the tables of a delimited text log: one, or one for each block."""
    drops = options.bad_rows == "drop"
    data, notes = to_utf8(source.data, encoding=options.encoding, allows_nul=drops)
    if n_lines := options.skip_lines:
        ends = [end for _, end in zip(range(n_lines), _LINE_END.finditer(data), strict=False)]
        if len(ends) < n_lines:
            text = f"fewer lines than the {n_lines} to skip (skip_lines)"
            raise LogError(text, code="wrong-value")
        data = data[ends[-1].end() :]
        notes = (*notes, f"{n_lines} lines skipped, as declared")
    decimal = ""
    if header := _MTS793.match(data):
        decimal = header["decimal"].decode()
        notes = (*notes, f"MTS 793 export, language {header['language'].decode()}")
    has_blocks = data.find(b"Data Acquisition", 0, _MAX_PREAMBLE) >= 0
    starts = list(_BLOCK.finditer(data)) if has_blocks else []
    blocks = [] if starts else [_Block(data, n_lines + 1, decimal)]
    above = data[: starts[0].start()] if starts else b""
    preamble = tuple(above[:_MAX_PREAMBLE].decode("utf-8", "replace").splitlines())
    line = n_lines + 1 + len(_LINE_END.findall(above))
    stops = [begin.start() for begin in starts[1:]] + [len(data)]
    for begin, stop in zip(starts, stops, strict=False):
        piece = data[begin.end() : stop]
        line += 1
        title = begin[0].decode("utf-8", "replace").strip().replace("\t", " ")
        if piece.strip():
            blocks.append(_Block(piece, line, decimal, title, preamble))
        line += len(_LINE_END.findall(piece))
    if not blocks:
        text = f"no data rows after 'Data Acquisition' in line {line - 1}"
        raise LogError(text, code="no-data")
    empty = [block for block in blocks if block.title and not _DATA.search(block.data)]
    if 0 < len(empty) < len(blocks):
        count = f" and {len(empty) - 1} more" if len(empty) > 1 else ""
        notes = (*notes, f"left out: the block in line {empty[0].first_line}{count}, without rows")
        blocks = [block for block in blocks if block not in empty]
    tables = tuple(
        table for block in blocks for table in _tables(block, source.name, notes, options)
    )
    return _with_time_of_titles(tables, options)


def read_lvm(source: Source, options: ReadOptions) -> tuple[Table, ...]:
    """Return a table for each segment of a LabVIEW measurement file."""
    data, notes = to_utf8(source.data, encoding=options.encoding)
    ends = list(_LVM_END.finditer(data))
    facts = dict(_LVM_ENTRY.findall(data[: ends[0].start()].decode() if ends else ""))
    preamble = tuple(f"{key}: {text}" for key, text in facts.items())
    separator = {"Comma": ","}.get(facts.get("Separator", ""), "\t")
    tables: list[Table] = []
    for k, end in enumerate(ends[1:], start=1):
        following = ends[k + 1].start() if k + 1 < len(ends) else len(data)
        begins = _LVM_SEGMENT.search(data, end.end(), following)  # the next segment's header
        stop = begins.start() if begins and following < len(data) else len(data)
        head = data[ends[k - 1].end() : end.start()].decode("utf-8")
        names, _, rows = data[end.end() : stop].partition(b"\n")
        rows = rows.rstrip() + b"\n" if stop < len(data) else rows
        columns = names.decode("utf-8").rstrip("\r").split(separator)
        label = next((line for line in head.splitlines() if line.startswith("Y_Unit_Label")), "")
        units = [unit.strip() for unit in label.split(separator)]
        units += [""] * (len(columns) - len(units))
        for i, name in enumerate(columns):
            if name == "X_Value":
                columns[i], units[i] = "time", "s"
        if columns[-1] == "Comment":  # in the rows that have one
            columns.pop()
            mark, width = separator.encode(), len(columns)
            fields = (row.rstrip(b"\r").split(mark)[:width] for row in rows.split(b"\n"))
            rows = b"\n".join(map(mark.join, fields))
        if facts.get("X_Columns") == "No":  # the header gives the step
            if columns[0] == "time":  # a column that is blank
                columns[0], units[0] = "blank", ""
            else:
                units = [*units[1:], ""]
            step = dict(_LVM_ENTRY.findall(head)).get("Delta_X", "").split(separator)[0]
            with suppress(ValueError, ZeroDivisionError):
                rate = 1.0 / float(step.replace(",", "."))
                preamble = (*preamble, f"sample rate: {rate:.9g}")
        pairs = zip(columns, units, strict=False)
        heading = separator.join(f"{name} ({unit})" if unit else name for name, unit in pairs)
        line, decimal = data.count(b"\n", 0, end.end()) + 1, facts.get("Decimal_Separator", "")
        text = heading.encode() + b"\n" + rows
        block = _Block(text, line, decimal, f"segment {k}", preamble)
        tables += _tables(block, source.name, notes, options)
    if not tables:
        raise LogError("a LabVIEW measurement file without a segment", code="no-data")
    return tuple(tables)


def _with_time_of_titles(tables: tuple[Table, ...], options: ReadOptions) -> tuple[Table, ...]:
    """Return blocks without a column for time as one table, where their titles give its rate."""
    # Whole buffers that follow each other at a steady rate are one record, and its sample rate is
    # their rows by the time between their titles.
    stamps = [match for table in tables if (match := _TITLE_TIME.search(table.part))]
    has_time = any(has_channel("time", table.columns, options) for table in tables)
    if has_time or options.sample_rate > 0.0 or len(stamps) < len(tables):
        return tables
    first, rate, rows = tables[0], 0.0, [0]
    is_same = all((t.columns, t.metadata) == (first.columns, first.metadata) for t in tables)
    with suppress(LogError):  # raised with its place when the channels are read
        rows = [len(table.load({"any": 0}).channels["any"]) for table in tables]
    times = np.array([float(stamp[1].replace(",", ".")) for stamp in stamps])
    # The last buffer may not be full: its step is as long as itself, or as the one before.
    steps = np.diff(times if rows[-1] == rows[0] else times[:-1])
    if is_same and len(rows) >= _FEWEST and len(set(rows[:-1])) == 1 and rows[-1] <= rows[0]:
        step = median(steps)
        if step > 0.0 and np.abs(steps / step - 1.0).max() <= _STEADY:
            rate = rows[0] * len(steps) / float(steps.sum())
    if not rate:
        hint = (
            "only the titles of its blocks give a time, and no steady rate; if the rate is known, "
            "declare rig.sample_rate"
        )
        return tuple(replace(table, hint=table.hint or hint) for table in tables)
    note = f"{len(tables)} blocks joined; time: {rate:g} Hz, by the times in their titles"
    joined = replace(
        first,
        load=lambda indices: _joined([table.load(indices) for table in tables]),
        metadata={**first.metadata, "sample rate": repr(rate)},
        notes=(*first.notes, note),
        findings=distinct(finding for table in tables for finding in table.findings),
        may_run_on=False,
    )
    return (joined,)


# The head: separator, names row, units row, first row of data.


class _Row(NamedTuple):
    """One line of the head that is not blank, split by one separator."""

    number: int  # of the line, from 1, blank lines counted
    offset: int  # byte where it starts
    text: str
    fields: Sequence[str] = ()
    share: float = 0.0  # of the fields that are not blank, those that are values

    @property
    def is_data(self) -> bool:
        return self.share >= 0.5 and len(self.fields) >= 2

    def names_by(self, separator: str) -> list[str]:
        """Return the fields where they may be names of channels."""
        names = _fields(self.text, separator)
        is_row = len(names) >= 2 and ":" not in self.text and mentions_channel(names)
        return names if is_row else []


def _fields(text: str, separator: str) -> list[str]:
    """Return the fields of one line, without quotes and blanks around them."""
    if separator == " ":
        return text.replace('"', "").split()
    if '"' in text:
        try:
            row = next(csv.reader([text], delimiter=separator, skipinitialspace=True))
        except (csv.Error, StopIteration):
            row = text.split(separator)
        return [field.strip().strip('"').strip() for field in row]
    return [field.strip() for field in text.split(separator)]


def _parted_head(  # noqa: C901 - each separator is tried on the same lines
    block: _Block, options: ReadOptions
) -> tuple[str, Sequence[_Row], int]:
    """Return the separator, the first lines of a text split by it, and the first row of data."""
    end = min(len(block.data), _HEAD_BYTES)

    def filled_lines() -> Iterator[_Row]:
        for number, match in enumerate(_LINE.finditer(block.data, 0, end), start=block.first_line):
            if match.end() == end < len(block.data):  # it is cut
                if not lines:
                    text = f"longer than {_HEAD_BYTES} bytes; this is not a log"
                    raise LogError(text, subject=f", line {number}", code="too-large")
                return
            if match[1].strip():
                yield _Row(number, match.start(), match[1].decode("utf-8", "replace"))

    lines: list[_Row] = []
    more_lines = filled_lines()
    for n_lines in _HEAD_LINES:
        lines += islice(more_lines, n_lines - len(lines))
        if not lines:
            raise LogError("nothing but blank lines", code="no-data")
        best, best_score = None, 0.0
        declared = SEPARATORS.get(options.separator)
        for separator in _MARKS if declared is None else (declared,):
            if separator != " " and not any(separator in line.text for line in lines):
                continue
            rows = [_parted(line, separator, options.thousands) for line in lines]
            start = None
            for i, row in enumerate(rows):
                ahead = rows[i : i + 4]
                same = [r for r in ahead if r.is_data and len(r.fields) == len(row.fields)]
                if row.is_data and len(same) >= min(3, len(ahead)):
                    # Rows of numbers right above with another count are refused later as ragged.
                    start = next((j for j in range(i, 0, -1) if not rows[j - 1].is_data), 0)
                    break
            if start is None:
                continue
            # Over all lines, so that a separator that fits only some of them does not win.
            score = sum(row.share for row in rows[start:] if len(row.fields) >= 2)
            if score > best_score + 1e-9:
                best, best_score = (separator, rows, start), score
            if score == len(rows) - start:
                break  # every field of every row is a number
        if best:
            return best
    for row, below in zip(reversed(lines), [None, *reversed(lines)], strict=False):
        if any(row.names_by(separator) for separator in _MARKS):
            problem = f"no {'rows of numbers' if below else 'data rows'} after the names in line"
            following = f"; line {below.number} is {visible(below.text)}" if below else ""
            raise LogError(f"{problem} {row.number}{following}", code="no-rows")
    first = lines[0]
    text = f"no rows of numbers found; line {first.number} is {visible(first.text)}"
    raise LogError(text, code="no-rows")


def _parted(line: _Row, separator: str, thousands: str) -> _Row:
    fields = _fields(line.text, separator)
    filled = [field.replace(thousands or "\0", "") for field in fields if field]
    is_comment = line.text.lstrip().startswith(("#", "%", "//"))
    values = sum(_VALUE.fullmatch(field) is not None for field in filled)
    share = 0.0 if is_comment or not filled else values / len(filled)
    return line._replace(fields=fields, share=share)


def _heading(rows: Sequence[_Row], start: int) -> tuple[int, int | None, int | None]:
    """Return the first row of data, the names row and the units row."""
    # Text rows right above the numbers are names, units, or rows of data with text in them.
    above, n_fields = start, len(rows[start].fields)
    while above > 0 and start - above < 3:
        row = rows[above - 1]
        is_entry = row.text.lstrip().startswith("#") and not mentions_channel(row.fields)
        if len(row.fields) < 2 or abs(len(row.fields) - n_fields) > 1 or is_entry:
            break
        above -= 1
    candidates = [i for i in reversed(range(above, start)) if mentions_channel(rows[i].fields)]
    if candidates:
        # "s;V;V" may be names, but stands below them where there are others.
        names_at = min(candidates, key=lambda i: _is_units_row(rows[i].fields))
        below = names_at + 1
        has_units = below < start and _is_units_row(rows[below].fields)
        if not has_units:
            return below, names_at, None
        others = (i for i in range(below, len(rows)) if rows[i].fields != rows[below].fields)
        return next(others), names_at, below
    if start - above > 1 and _is_units_row(rows[start - 1].fields):
        return start, start - 2, start - 1
    return start, start - 1 if start > above else None, None


def _is_units_row(fields: Sequence[str]) -> bool:
    stripped = [field.strip("()[] ") for field in fields]
    names = [field for field in stripped if not is_unit(field)]
    return len(names) < len(stripped) and not mentions_channel(names)


def _odd_names(above: Sequence[_Row], separator: str, data_row: _Row) -> str:
    """Return a sentence on a line of names above the rows, fewer or more than their fields."""
    for row in reversed(above):
        for mark in dict.fromkeys((separator, *_MARKS)):
            if names := row.names_by(mark):
                by, of_rows = (
                    f" (separator: {_MARKS[mark_of]})" * (mark != separator)
                    for mark_of in (mark, separator)
                )
                return (
                    f"line {row.number} has {len(names)} names{by}, "
                    f"line {data_row.number} has {len(data_row.fields)} fields{of_rows}"
                )
    return ""


def _decimal(rows: Sequence[_Row], separator: str, thousands: str, below: bytes) -> str:
    """Return the decimal mark that the first rows show, or without commas those below them."""
    start = rows[0].offset
    if separator != "," and below.find(b".", start) < 0 <= below.find(b",", start):
        return ","  # the first rows may hold whole numbers only, as of a machine at rest
    if thousands:
        return "," if thousands == "." else "."
    fields = [field for row in rows for field in row.fields]
    commas = sum(bool(_COMMA.fullmatch(field)) for field in fields)
    points = sum("." in field and bool(_NUMBER.fullmatch(field)) for field in fields)
    if separator != ",":
        return "," if commas > points else "."
    # Between commas "1,234" in quotes has thousands or decimals, "0,5" and "-12,25" have decimals:
    # more than one in ten of these, so that a damaged field does not decide.
    grouped = sum(bool(_THOUSANDS.fullmatch(field)) for field in fields)
    return "," if not points and commas - grouped > commas / 10 else "."


# The table: names over rows.


def _metadata(preamble: Sequence[str]) -> dict[str, str]:
    """Return the ``key: value`` lines of a preamble, keys in lower case."""
    # The identity of a test, or an amount, may be in two cells: ``Operator;J. Smith``.
    cells = [match for line in preamble if (match := _CELLS.fullmatch(line))]
    pairs = [m for m in cells if names_identity(m["key"]) or _AMOUNT.fullmatch(m["value"])]
    pairs += [match for line in preamble if (match := _ENTRY.fullmatch(line))]
    return {pair["key"].strip("#%\" '").lower(): pair["value"].strip('" ') for pair in pairs}


def _tables(
    block: _Block, name: str, notes: tuple[str, ...], options: ReadOptions
) -> Iterator[Table]:
    """Yield the table of a block, or one for each repetition of its row of names."""
    head = _parted_head(block, options)
    separator, rows, first_row = head
    data_at, names_at, _ = _heading(rows, first_row)
    begin, start = (rows[k].offset for k in (data_at if names_at is None else names_at, data_at))
    second = block.data.find(b"\n" + block.data[begin:start], start) + 1 if begin < start else 0
    if not second or options.bad_rows == "drop":  # what is no row is dropped, names too
        yield _table(block, head, name, notes, options)
        return
    # A preamble of its own may stand above the second names, too.
    above = block.data[max(second - _MAX_PREAMBLE, start) : second].splitlines(keepends=True)[::-1]

    def is_data(line: bytes) -> bool:
        row = _Row(0, 0, line.decode("utf-8", "replace"))
        return _parted(row, separator, options.thousands).is_data

    second -= sum(map(len, takewhile(lambda line: not is_data(line), above)))
    line = block.first_line + len(_LINE_END.findall(block.data, 0, second))
    title = block.title or f"from line {block.first_line}"
    yield _table(block._replace(data=block.data[:second], title=title), head, name, notes, options)
    preamble = (*block.preamble, *(row.text for row in rows[: names_at or 0]))
    following = _Block(block.data[second:], line, block.decimal, f"from line {line}", preamble)
    yield from _tables(following, name, notes, options)


def _table(  # noqa: PLR0915  # one table from top to bottom: names, units, marks, rows
    block: _Block,
    parted: tuple[str, Sequence[_Row], int],
    name: str,
    notes: tuple[str, ...],
    options: ReadOptions,
) -> Table:
    separator, head, first_row = parted
    if (n := len(head[first_row].fields)) > _MAX_COLUMNS:
        number, text = head[first_row].number, f"{n} columns, more than the limit of {_MAX_COLUMNS}"
        raise LogError(text, subject=f", line {number}", code="bad-row")
    data_at, names_at, units_at = _heading(head, first_row)
    start, names_line = head[data_at].offset, 0 if names_at is None else head[names_at].number
    names = [] if names_at is None else list(head[names_at].fields)
    if names and names[0].startswith("#"):
        names[0] = names[0].lstrip("# ")
    above = [row.text for row in head[: data_at if names_at is None else names_at]]
    hint = "" if names else _odd_names(head[:data_at], separator, head[first_row])
    full_rows = head[data_at:-1] or head[data_at:]  # the last row of the head may be cut
    is_short = 2 * sum(len(row.fields) == len(names) - 1 for row in full_rows) > len(full_rows)
    decimal = options.decimal or block.decimal
    decimal = decimal or _decimal(head[data_at:], separator, options.thousands, block.data)
    foreign = sum(not line.lstrip().startswith("#") for line in above)
    notes += (f"separator: {_MARKS[separator]}",) * (separator != ",")
    notes += ("decimal mark: comma",) * (decimal != ".")
    notes += (f"preamble: {counted(foreign, 'line')} above the names",) * (foreign > 0)
    findings = []
    rows = block.data
    if not rows.endswith((b"\n", b"\r")):  # -12 may be what was written of -1234
        end = max(rows.rfind(b"\n", start), rows.rfind(b"\r", start)) + 1 or start
        if rows[end:].strip():
            if end == start:
                text = "no data rows; the only one has no line end and may be cut"
                raise LogError(text, code="bad-row")
            text = "no final newline; the last row may be cut and was dropped; is the log whole?"
            findings.append(warning("cut_row", text, value=1.0))
        rows = rows[:end]
    if separator == " ":
        rows, start, separator = re.sub(rb"[ \t]+", b"\t", rows[start:]), 0, "\t"
        rows = re.sub(rb"(?m)^\t|\t(?=\r?$)", b"", rows)
    if len(names) >= 2 and _EVENTS.fullmatch(names[-1]) and b'"' not in rows:
        # The last column, which only rows with an event may have, is given to every row.
        n_before, mark = len(names) - 2, separator.encode()
        lines = _LINE_END.sub(b"\n", rows[start:]).split(b"\n")
        rows = b"\n".join(row + mark * (row.count(mark) == n_before) for row in lines)
        is_short, start = False, 0
    match = _LINE.match(rows, start)
    fields = _fields(match[1].decode("utf-8", "replace") if match else "", separator)
    names = names or [""] * len(fields)
    n_fields = len(names) - is_short
    units = [] if units_at is None else [unit.strip("()[] ") for unit in head[units_at].fields]
    if units and len(units) not in (n_fields, len(names)):
        raise LogError(
            f"{len(units)} units for {len(names)} names in line {names_line}",
            subject=f", line {names_line + 1}",
            code="bad-row",
        )
    takes_full = False
    if is_short:
        hint = (
            f"line {names_line} has {len(names)} names and most rows {n_fields} fields: the last, "
            f"{visible(names.pop())}, was taken to have no values"
        )
        findings.insert(0, warning("short_rows", hint))
        counts = [row.count(separator.encode()) for row in rows[start:].splitlines() if row]
        takes_full = 5 * counts.count(n_fields) <= len(counts)  # the majority decides
    elif len(fields) == len(names) + 1 and not fields[-1]:
        n_fields += 1
        note = "every row ends in a separator; the empty last column was left out"
        findings.insert(0, warning("extra_separator", note))
    clocks = frozenset(i for i, field in enumerate(fields[: len(names)]) if is_stamp(field))
    line = head[data_at].number
    like = names_line if names_line and not is_short else line
    text_rows = _Rows(
        name, rows, start, line, like, separator, decimal, len(names), n_fields, takes_full, clocks,
        options.thousands, options.bad_rows == "drop",
    )  # fmt: skip
    text_rows.check_quotes()
    units = units[: len(names)] or [""] * len(names)
    return Table(
        columns=tuple(
            Column(column, unit or None, i in clocks)
            for i, (column, unit) in enumerate(zip(names, units, strict=True))
        ),
        load=text_rows.load,
        metadata=_metadata([*block.preamble, *above]),
        notes=notes,
        part=block.title,
        may_run_on=bool(block.title),
        hint=hint,
        findings=tuple(findings),
    )


# Rows: numbers and stamps.


def is_stamp(text: str) -> bool:
    """Say whether a field is a time of day, with or without a date."""
    return _STAMP.match(text) is not None


def clock_seconds(stamps: Any) -> FloatArray:
    """Return seconds from the first stamp, of text or a pyarrow column; NaN for what is none."""
    import pyarrow as pa
    from pyarrow import compute

    if not isinstance(stamps, pa.ChunkedArray):
        stamps = pa.chunked_array([pa.array(stamps, pa.string())])
    if not len(stamps):
        return np.zeros(0)
    fields = compute.extract_regex(stamps, _PATTERN)

    def numbers(field: str) -> FloatArray:
        text = compute.struct_field(fields, field)
        filled = compute.if_else(compute.equal(text, ""), "0", text)
        return _column_floats(filled.cast(pa.float64()))

    fraction = compute.utf8_length(compute.struct_field(fields, "fraction"))
    tenths = numbers("fraction") / 10.0 ** _column_floats(fraction.cast(pa.float64()))
    dates = np.asarray(compute.struct_field(fields, "date").to_pylist(), dtype=object)
    halves = compute.struct_field(fields, "half").to_pylist()
    half = np.array([text[:1].lower() if text else "" for text in halves])
    hour = numbers("hour")
    hour = np.where(half == "", hour, hour % 12.0 + 12.0 * (half == "p"))
    seconds = hour * 3600.0 + numbers("minute") * 60.0 + numbers("second")
    is_next = dates[1:] != dates[:-1] if dates[0] else np.diff(seconds) < -_DAY / 2.0
    days = np.concatenate(([0.0], np.cumsum(np.asarray(is_next, dtype=np.float64))))
    # Whole seconds first: the difference of large numbers would cost digits of the fraction.
    return np.asarray((seconds + days * _DAY - seconds[0]) + (tenths - tenths[0]))


def _column_floats(column: Any) -> FloatArray:
    """Return a float64 column, nulls as NaN; its own to_numpy() imports pandas first."""
    filled = column.fill_null(np.nan) if column.null_count else column
    return np.array(np.from_dlpack(filled.combine_chunks()))


def rows_dropped(n_bad: int, first_bad: str) -> tuple[Problem, ...]:
    """Return the finding that rows were dropped; none where there were none."""
    if not n_bad:
        return ()
    sentence = f"{counted(n_bad, 'row')} that cannot be read dropped; {first_bad}"
    return (warning("rows_dropped", sentence, value=float(n_bad)),)


class _Rows(NamedTuple):
    """Complete rows of data as UTF-8 bytes, and how to read them.

    pyarrow is fast, but does not always say where a row is ragged or holds text. What it refuses is
    read again field by field, which names the line and channel, or drops the rows.
    """

    name: str  # of the log, for messages
    rows: bytes
    start: int  # of the first row; a copy of a large log without its head would cost time
    line: int  # of the first row
    like: int  # line that has as many fields as rows should have
    separator: str
    decimal: str
    n_names: int
    n_fields: int  # in a row; one more than names when every row ends in a separator
    takes_full: bool  # a row may have the field that the others lack
    clocks: frozenset[int]  # columns of wall-clock stamps
    thousands: str
    drops: bool  # rows that cannot be read, where they would else be refused

    def check_quotes(self) -> None:
        """Refuse a row whose quote does not close, where rows are not dropped."""
        if self.rows.find(b'"', self.start) >= 0 and not self.drops:
            for number, line in self.lines():
                _check_quotes(line, f"{self.name}, line {number}")

    def lines(self) -> Iterator[tuple[int, str]]:
        """Yield number and text of each row that is not blank."""
        for number, match in enumerate(_LINE.finditer(self.rows, self.start), start=self.line):
            if match[1]:
                yield number, match[1].decode("utf-8", "replace")

    def place(self, index: int) -> str:
        """Return the line of a sample when no row was dropped."""
        at = (f"line {number}" for i, (number, _) in enumerate(self.lines()) if i == index)
        return next(at, f"row {index + 1}")

    def load(self, indices: Mapping[str, int]) -> Samples:
        """Return columns as floats; refuses rows with other fields, or text for a number."""
        if (columns := self._fast(indices)) is not None:
            return Samples(columns, self.place)
        bad: list[str] = []
        pieces = []
        # In pieces of whole lines, as most of a large log is read fast; stamps run on.
        start, line = self.start, self.line
        while start < len(self.rows):
            match = _LINE.match(self.rows, min(start + _PIECE, len(self.rows)))
            stop = match.end() if match and not self.clocks else len(self.rows)
            rows = self._replace(rows=self.rows[start:stop], start=0, line=line)
            columns = None if self.clocks else rows._fast(indices)  # noqa: SLF001  # its own class
            slow = rows._slow  # noqa: SLF001
            pieces.append(Samples(columns, rows.place) if columns else slow(indices, bad))
            line += len(_LINE_END.findall(rows.rows))
            start = stop
        samples = _joined(pieces)
        if not len(next(iter(samples.channels.values()))):
            example = f"; first: {bad[0]}" if bad else ""
            raise LogError(f"no data rows{example}", code="no-data")
        return replace(samples, findings=rows_dropped(len(bad), bad[0] if bad else ""))

    def _slow(self, indices: Mapping[str, int], bad: list[str]) -> Samples:
        """Read field by field; why a row was dropped goes to `bad`."""
        lines: list[int] = []
        rows: list[list[float | str]] = []
        for number, line in self.lines():
            try:
                rows.append(self._values(line, indices, f"{self.name}, line {number}"))
                lines.append(number)
            except LogError as error:
                if not self.drops:
                    raise
                bad.append(str(error) if not bad else "")
        channels = {}
        for k, (channel, index) in enumerate(indices.items()):
            values = [row[k] for row in rows]
            is_clock = index in self.clocks
            channels[channel] = clock_seconds(values) if is_clock else np.array(values, float)
        return Samples(channels, lambda i: f"line {lines[i]}")

    def _fast(self, indices: Mapping[str, int]) -> dict[str, FloatArray] | None:
        """Return columns as pyarrow reads them; None where it refuses, or rows must be dropped."""
        import pyarrow as pa
        from pyarrow import csv as arrow

        names = [f"{i}" for i in range(self.n_fields)]
        extra = names[self.n_names :]  # anything in it is an error
        chosen = dict.fromkeys(names[i] for i in sorted(indices.values()))
        types = {name: pa.string() if int(name) in self.clocks else pa.float64() for name in chosen}
        quote = '"' if self.rows.find(b'"', self.start) >= 0 else False
        is_large = len(self.rows) > _THREADED
        try:
            table = arrow.read_csv(
                pa.BufferReader(pa.py_buffer(self.rows).slice(self.start)),
                read_options=arrow.ReadOptions(column_names=names, use_threads=is_large),
                parse_options=arrow.ParseOptions(delimiter=self.separator, quote_char=quote),
                convert_options=arrow.ConvertOptions(
                    column_types={**types, **dict.fromkeys(extra, pa.null())},
                    include_columns=[*chosen, *extra],
                    null_values=_BLANK,
                    decimal_point=self.decimal,
                ),
            )
            columns = {
                name: (clock_seconds if int(name) in self.clocks else _column_floats)(
                    table.column(name)
                )
                for name in chosen
            }
        except (pa.ArrowException, ValueError):
            return None
        channels = {channel: columns[names[index]] for channel, index in indices.items()}
        complete = [columns[name] for name in chosen if int(name) in self.clocks]
        complete += [
            values for channel, values in channels.items() if self.drops and channel not in EXTRAS
        ]
        is_known = np.isfinite if self.drops else lambda values: ~np.isnan(values)
        return channels if all(is_known(values).all() for values in complete) else None

    def _values(self, line: str, indices: Mapping[str, int], subject: str) -> list[float | str]:
        """Return the fields of a row; text for clocks."""
        _check_quotes(line, subject)
        drop = "; repair the row, or drop such rows by rig.bad_rows = 'drop'"
        advice, problem = "" if self.drops else drop, ""
        fields = _fields(line, self.separator)
        if len(fields) - self.n_fields not in (0, int(self.takes_full)):
            problem = (
                f"found {counted(len(fields), 'field')}, expected {self.n_names} fields as in "
                f"line {self.like}{advice}"
            )
        elif self.n_fields > self.n_names and fields[-1]:
            problem = (
                f"found {visible(fields[-1])} after the last named column; "
                f"expected {self.n_names} fields"
            )
        values: list[float | str] = []
        for channel, index in {} if problem else indices.items():
            expected = f"{channel} is {visible(fields[index])}, expected"
            if index not in self.clocks:
                value = self._number(fields[index], f"{expected} a number", advice, subject)
                values.append(value)
                if self.drops and channel not in EXTRAS and not np.isfinite(value):
                    problem = f"{expected} a finite number"
            elif is_stamp(fields[index]):
                values.append(fields[index])
            else:
                problem = f"{expected} a time of day"
            if problem:
                break
        if problem:
            raise LogError(problem, subject=subject, code="bad-row")
        return values

    def _number(self, field: str, problem: str, advice: str, subject: str) -> float:
        plain, thousands = field, self.thousands
        grouped = _GROUPED.fullmatch(field)
        if grouped and grouped["mark"] == thousands:
            plain = plain.replace(thousands, "")
        if self.decimal == ",":
            plain = "?" if "." in plain else plain.replace(",", ".")
        if not plain or _NUMBER.fullmatch(plain) or _NOT_FINITE.fullmatch(plain):
            return float(plain or "nan")
        if grouped:
            advice = "; if it has a mark of thousands, declare rig.thousands"
            if grouped["mark"] == "," != self.decimal:
                advice += ", if a decimal comma, rig.decimal"
        raise LogError(f"{problem}{advice}", subject=subject, code="bad-row")


def _check_quotes(line: str, subject: str) -> None:
    if line.count('"') % 2:
        raise LogError(
            "a quote opens and does not close in the line", subject=subject, code="bad-row"
        )


def _joined(pieces: Sequence[Samples]) -> Samples:
    """Return the rows of several pieces behind each other."""
    names = pieces[0].channels
    ends = np.cumsum([len(next(iter(piece.channels.values()))) for piece in pieces])

    def place(index: int) -> str:
        k = min(int(np.searchsorted(ends, index, side="right")), len(pieces) - 1)
        return pieces[k].place(index - (int(ends[k - 1]) if k else 0))

    findings = distinct(finding for piece in pieces for finding in piece.findings)
    channels = {name: np.concatenate([piece.channels[name] for piece in pieces]) for name in names}
    return Samples(channels, place, findings=findings)
