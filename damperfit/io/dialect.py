"""How a text log is written: separator, decimal mark, names row, units row, first row of data.

Found from the first lines. The first row of data is where rows of mostly numbers with one count
of fields begin; the names stand above it.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from damperfit.errors import LogError
from damperfit.io.channels import mentions_channel, visible
from damperfit.io.options import SEPARATORS, Declarations
from damperfit.units.quantities import is_unit

__all__ = ["LINE", "NUMBER", "Dialect", "fields_of", "find_dialect", "metadata_of"]

_HEAD_BYTES = 262_144
_HEAD_LINES = (40, 1_000)  # tried in turn: nearly all preambles are short
_MAX_COLUMNS = 2_000
# Blank: runs of blanks and tabs.
_SEPARATORS = {",": "comma", ";": "semicolon", "\t": "tab", "|": "bar", " ": "blanks"}
NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)
_COMMA = re.compile(r"[+-]?(?:\d+,\d*|,\d+)(?:[eE][+-]?\d+)?", re.ASCII)
# A comma that may as well part thousands. "0,125" may not: no group starts with a zero.
_GROUPED = re.compile(r"[+-]?[1-9]\d{0,2}(?:,\d{3})+", re.ASCII)
_VALUE = re.compile(
    rf"{NUMBER.pattern}|{_COMMA.pattern}|[+-]?(?i:nan|inf)|\d+[-/.:]\d+[-/.:]\d(?s:.*)", re.ASCII
)
_ENTRY = re.compile(r"[#%;\s]*(?P<key>[^:=,;\t]{1,60}?)\s*[:=]\s*(?P<value>.*?)[\s;,]*")
LINE = re.compile(rb"([^\r\n]*)(\r\n|\n|\r|\Z)")


@dataclass(frozen=True, slots=True)
class Dialect:
    """How a text log is written."""

    separator: str  # " " is any run of blanks
    decimal: str
    names: tuple[str, ...]  # above the data; empty when the log has none
    units: tuple[str, ...]
    names_line: int  # from 1; 0 without names
    data_line: int
    data_offset: int  # byte where the first row of data starts
    preamble: tuple[str, ...]  # lines above the names
    is_short: bool = False  # most rows have one field less than there are names
    hint: str = ""  # why a line that holds names was not taken for them

    def notes(self) -> tuple[str, ...]:
        """Return what differs from comma, point and '#' lines."""
        notes = []
        if self.separator != ",":
            notes.append(f"separator: {_SEPARATORS[self.separator]}")
        if self.decimal != ".":
            notes.append("decimal mark: comma")
        if foreign := sum(not line.lstrip().startswith("#") for line in self.preamble):
            notes.append(f"preamble: {foreign} line{'s' * (foreign > 1)} above the names")
        return tuple(notes)


class _Row(NamedTuple):
    """One line of the head that is not blank, parted by one separator."""

    number: int  # of the line, from 1, blank lines counted
    offset: int  # byte where it starts
    text: str
    fields: Sequence[str] = ()
    share: float = 0.0  # of the fields that are not blank, how many are values

    @property
    def is_data(self) -> bool:
        return self.share >= 0.5 and len(self.fields) >= 2

    def names_by(self, separator: str) -> list[str]:
        """Return the fields where they may be names of channels."""
        names = fields_of(self.text, separator)
        is_row = len(names) >= 2 and ":" not in self.text and mentions_channel(names)
        return names if is_row else []


def metadata_of(preamble: Iterable[str]) -> dict[str, str]:
    """Return the ``key: value`` lines of a preamble, keys in lower case.

    Examples
    --------
    >>> metadata_of(["# rig log", "# Setting: 10"])
    {'setting': '10'}
    """
    pairs = [match for line in preamble if (match := _ENTRY.fullmatch(line))]
    return {pair["key"].strip("#%\" '").lower(): pair["value"].strip('" ') for pair in pairs}


def find_dialect(data: bytes, declared: Declarations, *, name: str, first_line: int = 1) -> Dialect:
    """Return how a log in UTF-8 is written whose first line has the given number.

    Raises
    ------
    LogError
        There are no rows of numbers.
    """
    head: list[_Row] = []
    for n_lines in _HEAD_LINES:
        head = _head(data, n_lines, name, first_line)
        if best := _best_separator(head, declared):
            return _dialect(*best, declared, name)
    raise LogError(_no_data(head), code="no-rows", subject=name)


def _head(data: bytes, n_lines: int, name: str, first_line: int) -> list[_Row]:
    """Return the first lines of UTF-8 text that are not blank."""
    head: list[_Row] = []
    end = min(len(data), _HEAD_BYTES)
    for number, match in enumerate(LINE.finditer(data, 0, end), start=first_line):
        is_cut = match.end() == end < len(data)
        if is_cut and not head:
            raise LogError(
                f"{name}, line {number}: longer than {_HEAD_BYTES} bytes; this is not a log"
            )
        if is_cut or len(head) == n_lines:
            break
        text = match[1].decode("utf-8", "replace")
        if text.strip():
            head.append(_Row(number, match.start(), text))
    if not head:
        raise LogError("nothing but blank lines", subject=name)
    return head


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


def _parted(head: Sequence[_Row], separator: str, declared: Declarations) -> list[_Row]:
    rows = []
    for line in head:
        fields = fields_of(line.text, separator)
        filled = [field.replace(declared.thousands or "\0", "") for field in fields if field]
        values = sum(_VALUE.fullmatch(field) is not None for field in filled)
        is_comment = line.text.lstrip().startswith(("#", "%", "//"))
        share = 0.0 if is_comment or not filled else values / len(filled)
        rows.append(line._replace(fields=fields, share=share))
    return rows


def _first_data(rows: Sequence[_Row]) -> int | None:
    """Return the first of the rows of data, or None.

    It must be followed by rows with as many fields; rows of numbers right above it with another
    count belong to the data too (they are ragged, and said to be so later).
    """
    for i, row in enumerate(rows):
        ahead = rows[i : i + 4]
        same = [r for r in ahead if r.is_data and len(r.fields) == len(row.fields)]
        if row.is_data and len(same) >= min(3, len(ahead)):
            return next((j for j in range(i, 0, -1) if not rows[j - 1].is_data), 0)
    return None


def _best_separator(
    head: Sequence[_Row], declared: Declarations
) -> tuple[str, list[_Row], int] | None:
    """Return the separator that makes most fields numbers, its rows, and the first of data."""
    best: tuple[str, list[_Row], int] | None = None
    best_score = 0.0
    asked = SEPARATORS.get(declared.separator)
    for separator in _SEPARATORS if asked is None else (asked,):
        if separator != " " and not any(separator in line.text for line in head):
            continue
        rows = _parted(head, separator, declared)
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


def _no_data(head: Sequence[_Row]) -> str:
    for i, line in reversed(list(enumerate(head))):
        if any(line.names_by(separator) for separator in _SEPARATORS):
            below = head[i + 1 :]
            found = f"; line {below[0].number} is {visible(below[0].text)}" if below else ""
            what = "rows of numbers" if below else "data rows"
            return f"no {what} after the names in line {line.number}{found}"
    return f"no rows of numbers found; line {head[0].number} is {visible(head[0].text)}"


def _dialect(
    separator: str, rows: Sequence[_Row], start: int, declared: Declarations, name: str
) -> Dialect:
    first = rows[start]
    if len(first.fields) > _MAX_COLUMNS:
        raise LogError(
            f"{name}, line {first.number}: {len(first.fields)} columns, more than the limit "
            f"of {_MAX_COLUMNS}"
        )
    start, names_at, units_at = _heading(rows, start)
    names = [] if names_at is None else list(rows[names_at].fields)
    units = () if units_at is None else rows[units_at].fields
    if names and names[0].startswith("#"):
        names[0] = names[0].lstrip("# ")
    whole = rows[start:-1] or rows[start:]  # the last row of the head may be cut
    return Dialect(
        separator=separator,
        decimal=declared.decimal or _decimal(rows[start:], separator, declared.thousands),
        names=tuple(names),
        units=tuple(unit.strip("()[] ") for unit in units),
        names_line=0 if names_at is None else rows[names_at].number,
        data_line=rows[start].number,
        data_offset=rows[start].offset,
        preamble=tuple(row.text for row in rows[: start if names_at is None else names_at]),
        is_short=2 * sum(len(row.fields) == len(names) - 1 for row in whole) > len(whole),
        hint="" if names else _odd_names(rows[:start], separator, first),
    )


def _odd_names(above: Sequence[_Row], separator: str, first: _Row) -> str:
    """Say which line above the rows holds names, though not as many as there are fields."""
    for row in reversed(above):
        for mark in (separator, *(mark for mark in _SEPARATORS if mark != separator)):
            if names := row.names_by(mark):
                by, of_rows = (
                    f" (separator: {_SEPARATORS[one]})" * (mark != separator)
                    for one in (mark, separator)
                )
                return (
                    f"line {row.number} has {len(names)} names{by}, "
                    f"line {first.number} has {len(first.fields)} fields{of_rows}"
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
    named = [i for i in reversed(range(above, start)) if mentions_channel(rows[i].fields)]
    # "s;V;V" may be names, but stands below them where there are others.
    named.sort(key=lambda i: _is_units_row(rows[i].fields))
    if named:
        (names_at, *_), below = named, named[0] + 1
        if below < start and _is_units_row(rows[below].fields):
            return below + 1, names_at, below
        return below, names_at, None
    if start - above > 1 and _is_units_row(rows[start - 1].fields):
        return start, start - 2, start - 1
    return start, start - 1 if start > above else None, None


def _is_heading(row: _Row, n_fields: int) -> bool:
    is_near = abs(len(row.fields) - n_fields) <= 1
    is_entry = row.text.lstrip().startswith("#") and not mentions_channel(row.fields)
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
