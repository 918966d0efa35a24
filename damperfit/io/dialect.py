"""How a text log is written: separator, decimal mark, names row, units row, first row of data.

Found from the first lines. The first row of data is where rows of mostly numbers with one count
of fields begin; the names stand above it.
"""

from __future__ import annotations

import csv
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from damperfit.errors import LogError
from damperfit.io.channels import mentions_channel, visible
from damperfit.io.options import SEPARATORS, Declarations
from damperfit.units.quantities import is_unit

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from damperfit.io.options import Declarations

__all__ = [
    "LINE",
    "NUMBER",
    "Dialect",
    "HeadLine",
    "fields_of",
    "find_dialect",
    "metadata_of",
]


_HEAD_BYTES = 262_144
_HEAD_LINES = (40, 1_000)  # tried in turn: nearly all preambles are short
_MAX_COLUMNS = 2_000
_SEPARATORS = (",", ";", "\t", "|", " ")  # blank: runs of blanks and tabs
_NAMES = {",": "comma", ";": "semicolon", "\t": "tab", "|": "bar", " ": "blanks"}
NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)
_COMMA = re.compile(r"[+-]?(?:\d+,\d*|,\d+)(?:[eE][+-]?\d+)?", re.ASCII)
# A comma that may as well part thousands. "0,125" may not: no group starts with a zero.
_GROUPED = re.compile(r"[+-]?[1-9]\d{0,2}(?:,\d{3})+", re.ASCII)
_NOT_A_NUMBER = frozenset({"nan", "+nan", "-nan", "inf", "+inf", "-inf"})
_STAMP = re.compile(r"\d+[-/.:]\d+[-/.:]\d.*", re.ASCII | re.DOTALL)
_ENTRY = re.compile(r"[#%;\s]*(?P<key>[^:=,;\t]{1,60}?)\s*[:=]\s*(?P<value>.*?)[\s;,]*")
LINE = re.compile(rb"([^\r\n]*)(\r\n|\n|\r|\Z)")


@dataclass(frozen=True, slots=True)
class HeadLine:
    """One line of the head that is not blank.

    Attributes
    ----------
    number : int
        From 1, blank lines counted.
    offset : int
        Byte where it starts.
    text : str
        Without its end.
    """

    number: int
    offset: int
    text: str


@dataclass(frozen=True, slots=True)
class Dialect:
    """How a text log is written.

    Attributes
    ----------
    separator, decimal : str
        One character each; separator " " is any run of blanks.
    names, units : tuple of str
        Rows above the data; empty when the log has none.
    names_line, data_line : int
        Line numbers from 1; names_line is 0 without names.
    data_offset : int
        Byte where the first row of data starts.
    preamble : tuple of str
        Lines above the names.
    is_short : bool
        All rows have one field less than there are names.
    hint : str
        Why a line that holds names was not taken for them; may be empty.
    """

    separator: str
    decimal: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    names_line: int
    data_line: int
    data_offset: int
    preamble: tuple[str, ...]
    is_short: bool = False
    hint: str = ""

    def notes(self) -> tuple[str, ...]:
        """Return what differs from comma, point and '#' lines."""
        found = []
        if self.separator != ",":
            found.append(f"separator: {_NAMES[self.separator]}")
        if self.decimal != ".":
            found.append("decimal mark: comma")
        foreign = sum(not line.lstrip().startswith("#") for line in self.preamble)
        if foreign:
            lines = "1 line" if foreign == 1 else f"{foreign} lines"
            found.append(f"preamble: {lines} above the names")
        return tuple(found)


def metadata_of(preamble: Iterable[str]) -> dict[str, str]:
    """Return the ``key: value`` lines of a preamble, keys in lower case.

    Examples
    --------
    >>> metadata_of(["# rig log", "# Setting: 10"])
    {'setting': '10'}
    """
    pairs = (_ENTRY.fullmatch(line) for line in preamble)
    return {
        pair["key"].strip("#%\" '").lower(): pair["value"].strip('" ')
        for pair in pairs
        if pair is not None
    }


def find_dialect(data: bytes, declared: Declarations, *, name: str, first_line: int = 1) -> Dialect:
    """Return how a log in UTF-8 is written whose first line has the given number.

    Raises
    ------
    LogError
        There are no rows of numbers.
    """
    lines: list[HeadLine] = []
    for n_lines in _HEAD_LINES:
        lines = _head(data, n_lines, name, first_line)
        best = _best_separator(lines, declared)
        if best is not None:
            return _dialect(best, declared, name)
    raise LogError(_no_data(lines), code="no-rows", subject=name)


def _head(data: bytes, n_lines: int, name: str, first_line: int) -> list[HeadLine]:
    """Return the first lines of UTF-8 text that are not blank.

    Raises
    ------
    LogError
        The first line does not end, or there is no text.
    """
    lines: list[HeadLine] = []
    end = min(len(data), _HEAD_BYTES)
    for number, found in enumerate(LINE.finditer(data, 0, end), start=first_line):
        is_cut = found.end() == end < len(data)
        if is_cut and not lines:
            raise LogError(
                f"{name}, line {number}: longer than {_HEAD_BYTES} bytes; this is not a log"
            )
        if is_cut or len(lines) == n_lines:
            break
        text = found[1].decode("utf-8", "replace")
        if text.strip():
            lines.append(HeadLine(number, found.start(), text))
    if not lines:
        raise LogError("nothing but blank lines", subject=name)
    return lines


def fields_of(text: str, separator: str) -> list[str]:
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


def _is_value(field: str, declared: Declarations) -> bool:
    if declared.thousands:
        field = field.replace(declared.thousands, "")
    return bool(
        NUMBER.fullmatch(field)
        or _COMMA.fullmatch(field)  # between commas only in quotes
        or field.lower() in _NOT_A_NUMBER
        or _STAMP.fullmatch(field)
    )


@dataclass(frozen=True, slots=True)
class _Row:
    line: HeadLine
    fields: list[str]
    share: float  # of the fields that are not blank, how many are values

    @property
    def is_data(self) -> bool:
        return self.share >= 0.5


def _rows(lines: Sequence[HeadLine], separator: str, declared: Declarations) -> list[_Row]:
    rows = []
    for line in lines:
        fields = fields_of(line.text, separator)
        filled = [field for field in fields if field]
        values = sum(_is_value(field, declared) for field in filled)
        is_comment = line.text.lstrip().startswith(("#", "%", "//"))
        share = 0.0 if is_comment or not filled else values / len(filled)
        rows.append(_Row(line, fields, share))
    return rows


def _first_data(rows: Sequence[_Row]) -> int | None:
    """Return the first of the rows of data, or None.

    It must be followed by rows with as many fields; rows of numbers right above it with another
    count belong to the data too (they are ragged, and said to be so later).
    """
    for i, row in enumerate(rows):
        ahead = rows[i : i + 4]
        same = [r for r in ahead if r.is_data and len(r.fields) == len(row.fields)]
        if row.is_data and len(row.fields) >= 2 and len(same) >= min(3, len(ahead)):
            return next((j for j in range(i, 0, -1) if not _may_be_ragged(rows[j - 1])), 0)
    return None


def _may_be_ragged(row: _Row) -> bool:
    return row.is_data and len(row.fields) >= 2


def _best_separator(
    lines: Sequence[HeadLine], declared: Declarations
) -> tuple[str, list[_Row], int] | None:
    """Return the separator that makes most fields numbers, its rows, and the first of data."""
    best: tuple[str, list[_Row], int] | None = None
    best_score = 0.0
    asked = SEPARATORS.get(declared.separator)
    for separator in _SEPARATORS if asked is None else (asked,):
        if separator != " " and not any(separator in line.text for line in lines):
            continue
        rows = _rows(lines, separator, declared)
        start = _first_data(rows)
        if start is None:
            continue
        # Over all lines, so that a separator that fits only some of them does not win.
        score = sum(row.share for row in rows[start:] if len(row.fields) >= 2)
        if score > best_score + 1e-9:
            best, best_score = (separator, rows, start), score
        if score == len(rows) - start:
            break  # every field of every row is a number
    return best


def _no_data(lines: Sequence[HeadLine]) -> str:
    for i, line in reversed(list(enumerate(lines))):
        for separator in _SEPARATORS:
            fields = fields_of(line.text, separator)
            if len(fields) >= 2 and mentions_channel(fields) and ":" not in line.text:
                below = lines[i + 1 :]
                found = f"; line {below[0].number} is {visible(below[0].text)}" if below else ""
                what = "rows of numbers" if below else "data rows"
                return f"no {what} after the names in line {line.number}{found}"
    return f"no rows of numbers found; line {lines[0].number} is {visible(lines[0].text)}"


def _dialect(found: tuple[str, list[_Row], int], declared: Declarations, name: str) -> Dialect:
    separator, rows, start = found
    first = rows[start]
    if len(first.fields) > _MAX_COLUMNS:
        raise LogError(
            f"{name}, line {first.line.number}: {len(first.fields)} columns, more than the limit "
            f"of {_MAX_COLUMNS}"
        )
    start, names_at, units_at = _heading(rows, start)
    names = rows[names_at].fields if names_at is not None else []
    units = rows[units_at].fields if units_at is not None else []
    if names and names[0].startswith("#"):
        names = [names[0].lstrip("# "), *names[1:]]
    top = start if names_at is None else names_at
    return Dialect(
        separator=separator,
        decimal=declared.decimal or _decimal(rows[start:], separator, declared.thousands),
        names=tuple(names),
        units=tuple(unit.strip("()[] ") for unit in units),
        names_line=0 if names_at is None else rows[names_at].line.number,
        data_line=rows[start].line.number,
        data_offset=rows[start].line.offset,
        preamble=tuple(row.line.text for row in rows[:top]),
        is_short=_is_short(rows[start:], len(names)),
        hint="" if names else _odd_names(rows[:start], separator, first),
    )


def _is_short(rows: Sequence[_Row], n_names: int) -> bool:
    whole = rows[:-1] or rows  # the last row of the head may be cut
    return all(len(row.fields) == n_names - 1 for row in whole)


def _odd_names(above: Sequence[_Row], separator: str, first: _Row) -> str:
    """Say which line above the rows holds names, though not as many as there are fields."""
    for row in reversed(above):
        for mark in (separator, *(mark for mark in _SEPARATORS if mark != separator)):
            names = fields_of(row.line.text, mark)
            if len(names) >= 2 and mentions_channel(names) and ":" not in row.line.text:
                marks = [
                    f" (separator: {_NAMES[one]})" * (mark != separator)
                    for one in (mark, separator)
                ]
                return (
                    f"line {row.line.number} has {len(names)} names{marks[0]}, "
                    f"line {first.line.number} has {len(first.fields)} fields{marks[1]}"
                )
    return ""


def _heading(rows: Sequence[_Row], start: int) -> tuple[int, int | None, int | None]:
    """Return the first row of data, the names row and the units row.

    Text rows right above the numbers are names, units, or rows of data with text in them.
    """
    n = len(rows[start].fields)
    above = start
    while above > 0 and start - above < 3 and _is_heading(rows[above - 1], n):
        above -= 1
    candidates = range(above, start)
    named = [i for i in reversed(candidates) if mentions_channel(rows[i].fields)]
    # "s;V;V" may be names, but stands below them where there are others.
    named.sort(key=lambda i: _is_units_row(rows[i].fields))
    names_at = next(iter(named), None)
    if names_at is None:
        if len(candidates) > 1 and _is_units_row(rows[start - 1].fields):
            return start, start - 2, start - 1
        names_at = start - 1 if candidates else None
        return start, names_at, None
    if names_at + 1 < start and _is_units_row(rows[names_at + 1].fields):
        return names_at + 2, names_at, names_at + 1
    return names_at + 1, names_at, None


def _is_heading(row: _Row, n_fields: int) -> bool:
    is_near = abs(len(row.fields) - n_fields) <= 1
    is_entry = row.line.text.lstrip().startswith("#") and not mentions_channel(row.fields)
    return len(row.fields) >= 2 and is_near and not is_entry


def _is_units_row(fields: Sequence[str]) -> bool:
    stripped = [field.strip("()[] ") for field in fields]
    return any(is_unit(field) for field in stripped) and not mentions_channel(
        field for field in stripped if not is_unit(field)
    )


def _decimal(rows: Sequence[_Row], separator: str, thousands: str) -> str:
    """Return the decimal mark that the first rows show.

    Between commas, "1,234" in quotes has thousands or decimals. It has decimals where no number
    has a point and others, such as "0,5" or "-12,25", cannot have thousands; more than one in ten
    of them, so that a damaged field does not decide.
    """
    if thousands:
        return "," if thousands == "." else "."
    fields = [field for row in rows for field in row.fields]
    commas = sum(bool(_COMMA.fullmatch(field)) for field in fields)
    points = sum("." in field and bool(NUMBER.fullmatch(field)) for field in fields)
    if separator != ",":
        return "," if commas > points else "."
    grouped = sum(bool(_GROUPED.fullmatch(field)) for field in fields)
    return "," if not points and commas - grouped > commas / 10 else "."
