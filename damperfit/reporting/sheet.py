"""A table of strings, its numbers as text, and how it is written: terminal, Markdown, HTML.

A cell may be the name of a log, which may hold anything: control characters and reversed writing
are shown as escapes, and what Markdown or HTML could read as markup is escaped. Numbers are rounded
for reading: by their 95 % interval where there is one.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from html import escape as escape_html
from itertools import zip_longest
from typing import TYPE_CHECKING, Any, NamedTuple
from unicodedata import combining, east_asian_width

if TYPE_CHECKING:
    from damperfit.units.shown_units import ShownUnits

NOTHING = "-"
_COLUMNS = 80
_NAME = 20  # letters of a name that is not cut
# ANSI, of words.
COLOURS = {"excellent": 32, "passed": 32, "good": 33, "poor": 31, "FAILED": 31, "not evaluated": 2}
_WORD = 12  # letters of a word that a narrow column does not tear
# Everything Markdown or the HTML inside it could read as markup, and no more: the report is read as
# it stands too. An underscore between letters is none; signs and numbers are lists at a start only.
_SPECIAL = re.compile(r"([\\`*\[\]<>#|~&$@]|(?<![^\W_])_|_(?![^\W_]))")
_LIST = re.compile(r"^(\d*)([-+.)])(?=\s|$|\2)")
# Nearly all cells of a table: words and numbers in which there is nothing to escape.
_PLAIN = re.compile(r"[0-9A-Za-z]+(?:\.[0-9A-Za-z]+)*")
_LONG = 1e9  # nobody reads more digits
_UNEVEN, _LEAST = 1.25, 0.1
_ROUNDING = 1e-9  # of a value: a narrower interval is that of logs without noise
_TWO_DIGITS = 19  # an error of these digits or fewer shows two of them, another one


@dataclass(frozen=True, slots=True)
class Sheet:
    """A table of strings: headings, units, rows of cells; notes are lines below it.

    Numbers are aligned to the right; units may be empty strings.
    """

    headings: tuple[str, ...]
    units: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    is_number: tuple[bool, ...]
    notes: tuple[str, ...] = ()

    @property
    def heads(self) -> list[tuple[str, ...]]:
        """Headings, and units where there are any."""
        return [cells for cells in (self.headings, self.units) if any(cells)]


class Column(NamedTuple):
    """How a column of a table is made: its heading, its unit, and the cell of each row."""

    heading: str
    unit: str
    cell: Callable[[Any], str]
    is_number: bool = True

    @classmethod
    def of(
        cls, heading: str, unit: str, name: str, *, digits: int = 4, factor: float = 1.0
    ) -> Column:
        """Return a column of numbers that rows hold by name; a number that is missing is "-"."""

        def cell(row: Mapping[str, Any]) -> str:
            value = row.get(name)
            return number(None if value is None else factor * value, digits=digits)

        return cls(heading, unit, cell)

    @classmethod
    def text(cls, heading: str, name: str, *, is_number: bool = False, missing: str = "") -> Column:
        """Return a column of what rows hold by name, as it is written."""

        def cell(row: Mapping[str, Any]) -> str:
            value = row.get(name)
            return missing if value is None else str(value)

        return cls(heading, "", cell, is_number)


def laid_out(rows: Iterable[Any], columns: Sequence[Column], *notes: str) -> Sheet:
    """Return a table of rows by its columns, with notes below it."""
    headings, units, cells, is_number = zip(*columns, strict=True)
    lines = tuple(tuple(cell(row) for cell in cells) for row in rows)
    return Sheet(headings, units, lines, is_number, notes)


def first_of(rows: Sequence[Any], most: int, where: str) -> tuple[Sequence[Any], list[str]]:
    """Return the rows that a long table shows, and the note that says how many are left out."""
    n_more = len(rows) - most
    return rows[:most], [f"{n_more} more {where}"] if n_more > 0 else []


def printable(text: str) -> str:
    """Return the text with control characters and reversed writing as escapes."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)


# On a terminal


def text_table(
    sheet: Sheet, width: int = _COLUMNS, *, colours: Mapping[str, int] | None = None
) -> str:
    """Return a table as lines of text: headings, units, rows, notes below.

    In a narrow width long names are cut in the middle, text wraps between words, and the remaining
    columns go into a table below with the first column again: no number is cut.
    ``colours`` are ANSI colours of cells by the word in them, besides those of grades; None: plain.
    """
    n_heads = len(sheet.heads)
    columns = [list(map(printable, cells)) for cells in zip(*sheet.heads, *sheet.rows, strict=True)]
    total = sum(max(map(_places, column)) + 2 for column in columns) - 2
    if total > width:
        longest = max(width // 3, _NAME)
        kinds = zip(columns, sheet.is_number, strict=True)
        columns = [column if is_number else _cut(column, longest) for column, is_number in kinds]
    gap = 2 if total <= min(_COLUMNS, width) else 1
    least = []  # widths that cut no word and no number, as far as the first column leaves room
    for column, is_number in zip(columns, sheet.is_number, strict=True):
        split = column[:n_heads] if is_number else column
        words = [*(word for cell in split for word in cell.split()), *column[len(split) :]]
        least.append(max(map(_places, words), default=0))
    room = width - gap - max(least[1:], default=0)
    least[0] = min(least[0], max(width // 3, room))
    least[1:] = [min(wide, width - gap - least[0]) for wide in least[1:]]
    tables, filled = [[0]], least[0]
    for k, wide in enumerate(least[1:], start=1):
        if filled + gap + wide > width and len(tables[-1]) > 1:
            tables.append([0])
            filled = least[0]
        tables[-1].append(k)
        filled += gap + wide
    codes = None if colours is None else {**COLOURS, **colours}
    lines: list[str] = []
    for table in tables:
        lines.append("")
        widths = {k: max(least[k], *map(_places, columns[k])) for k in table}
        while sum(widths.values()) + gap * (len(table) - 1) > width:  # narrow the widest
            spare = [k for k in table if widths[k] > least[k]]
            if not spare:
                break
            widths[max(spare, key=widths.__getitem__)] -= 1
        for n in range(n_heads + len(sheet.rows)):
            folded = [wrapped(columns[k][n], widths[k]) for k in table]
            for texts in zip_longest(*folded, fillvalue=""):
                cells = []
                for k, text in zip(table, texts, strict=True):
                    blanks = " " * (widths[k] - _places(text))
                    code = 0 if codes is None else 1 if n < n_heads else codes.get(columns[k][n], 0)
                    cell = f"\x1b[{code}m{text}\x1b[0m" if code and text else text
                    cells.append(blanks + cell if sheet.is_number[k] else cell + blanks)
                lines.append((" " * gap).join(cells).rstrip())
    for note in sheet.notes:
        note_lines = wrapped(printable(note), width)
        lines += note_lines if codes is None else [f"\x1b[2m{line}\x1b[0m" for line in note_lines]
    return "\n".join(lines[1:])


def _cut(texts: list[str], width: int) -> list[str]:
    """Return texts with long words cut in the middle, unless two of them then look alike."""
    half = width // 2

    def shorter(word: str) -> str:
        return word if len(word) <= width else f"{word[: half - 1]}…{word[-half:]}"

    shortened = [" ".join(map(shorter, text.split(" "))) for text in texts]
    return shortened if len(set(shortened)) == len(set(texts)) else texts


def wrapped(text: str, width: int) -> list[str]:
    """Return text as lines of so many places; a word that is longer is folded."""
    lines = [""]
    for word in text.split(" "):
        joined = f"{lines[-1]} {word}" if lines[-1] else word
        if _places(joined) <= width:
            lines[-1] = joined
            continue
        lines += [""] if lines[-1] else []
        for letter in word:
            if lines[-1] and _places(lines[-1] + letter) > width:
                lines.append("")
            lines[-1] += letter
    return lines


def _places(text: str) -> int:
    """Return the places of a screen that text takes."""
    if text.isascii():
        return len(text)
    return sum(0 if combining(c) else 1 + (east_asian_width(c) in "WF") for c in text)


# In Markdown and HTML


def escape(text: str) -> str:
    """Return text that Markdown shows as it is, on one line, control characters as escapes."""
    if _PLAIN.fullmatch(text):
        return text
    line = printable(" ".join(text.split()))
    return _LIST.sub(r"\1\\\2", _SPECIAL.sub(r"\\\1", line))


def markdown_table(sheet: Sheet) -> list[str]:
    """Return a sheet as the lines of a Markdown table, its notes below; nothing without rows."""
    if not sheet.rows:
        return []
    heads = [
        f"{escape(heading)} {unit}".rstrip()
        for heading, unit in zip(sheet.headings, sheet.units, strict=True)
    ]
    rules = ["---:" if is_number else "---" for is_number in sheet.is_number]
    cells = [[escape(cell) for cell in row] for row in sheet.rows]
    lines = [f"| {' | '.join(row)} |" for row in (heads, rules, *cells)]
    return [*lines, *(line for note in sheet.notes for line in ("", escape(note)))]


def html_table(sheet: Sheet, *, caption: str = "", looks: Mapping[str, str] | None = None) -> str:
    """Return a sheet as a table of HTML, every text of it escaped, below its caption.

    ``looks`` are classes of cells by the word in them, for a page with a style; None: numbers are
    set to the right by styles of their own, for a notebook.
    """

    def cell(kind: str, text: str, is_number: bool) -> str:  # noqa: FBT001 - a cell's alignment
        style = ""
        if looks is None:
            style = " style='text-align:right'" * is_number
        elif is_number:
            style = " class=n"
        elif text in looks:
            style = f" class={looks[text]}"
        elif kind == "td" and len(text) <= _WORD and text.isalpha():
            style = " class=word"
        return f"<{kind}{style}>{escape_html(printable(text))}</{kind}>"

    def row(kind: str, cells: Iterable[str]) -> str:
        pairs = zip(cells, sheet.is_number, strict=True)
        return f"<tr>{''.join(cell(kind, *pair) for pair in pairs)}</tr>"

    heads = "".join(row("th", cells) for cells in sheet.heads)
    body = "\n".join(row("td", cells) for cells in sheet.rows)
    title = f"<caption>{escape_html(printable(caption))}</caption>" if caption else ""
    return f"<table>{title}<thead>{heads}</thead><tbody>\n{body}</tbody></table>"


# Numbers


def number(value: float | None, *, digits: int = 5) -> str:
    """Return a number with ``digits`` significant digits and no exponent where that reads well."""
    if value is None or not math.isfinite(value):
        return NOTHING
    if value == 0.0:
        return "0"
    if not 1e-3 <= abs(value) < 1e5:
        return f"{value:.{digits - 1}e}"
    return f"{value:.{_decimals(value, digits)}f}"


def percent(value: float | None) -> str:
    """Return a percentage with three significant digits."""
    if value is None or not math.isfinite(value):
        return NOTHING
    if value == 0.0:
        return "0"
    return f"{value:.1e}" if abs(value) < 1e-4 else f"{value:.{_decimals(value, 3)}f}"


def _decimals(value: float, digits: int) -> int:
    """Return the decimals that show ``digits`` significant digits of the rounded value."""
    power = int(f"{value:.{digits - 1}e}".partition("e")[2])
    return max(0, digits - 1 - power)


def with_interval(
    value: float | None, low: float | None, high: float | None, *, digits: int = 5, plus: str = ""
) -> str:
    """Return a value and half of its interval, both to the decimal place of the interval.

    Limits that are not as far below as above, but for rounding, follow in brackets. Without limits
    ``digits`` significant digits are shown. ``plus`` is "+" for changes, with their sign.

    Examples
    --------
    >>> with_interval(14.0049, 13.9842, 14.0257), with_interval(45678.9, 45300.0, 46050.0)
    ('14.00 ± 0.02', '45700 ± 400')
    >>> with_interval(0.631, 0.134, 2.963), with_interval(2.0, None, None)
    ('0.6 (0.1 to 3.0)', '2.0000')
    >>> with_interval(11.97, 9.70, 14.7), with_interval(100.0, 90.0, 112.0)
    ('12 ± 3', '100 (90 to 112)')
    """
    if value is None or not math.isfinite(value):
        return NOTHING
    low, high = (math.nan if limit is None else limit for limit in (low, high))
    half = 0.5 * (high - low)
    if not (math.isfinite(half) and low <= value <= high and half > _ROUNDING * abs(value)):
        return number(value, digits=digits) if not plus else f"{value:+.{digits - 1}g}"
    below, above = value - low, high - value
    larger, smaller = max(below, above), min(below, above)
    is_even = larger <= _UNEVEN * smaller
    error = larger if is_even else max(smaller, _LEAST * half)
    place = math.floor(math.log10(error)) - 1  # of the last significant digit
    place += round(error / 10.0**place) > _TWO_DIGITS
    step = 10.0**place

    def rounded(x: float, plus: str = "") -> str:
        if abs(x) >= _LONG:  # an error that grows without limit beyond the tested speeds
            return f"{x:{plus}.1e}"
        return f"{round(x / step) * step + 0.0:{plus}.{max(0, -place)}f}"

    if is_even and larger - smaller <= step:
        return f"{rounded(value, plus)} ± {rounded(larger)}"
    return f"{rounded(value, plus)} ({rounded(low)} to {rounded(high)})"


# Units of people


def sheet_in_units(sheet: Sheet, units: ShownUnits) -> Sheet:
    """Return a table of scaled forces and speeds with the names of their units."""
    if units.is_si:
        return sheet
    speed = f" {units.of('m/s')}"
    return replace(
        sheet,
        headings=tuple(map(units.say, sheet.headings)),
        units=tuple(map(units.say, sheet.units)),
        # "hysteresis at 5.9 m/s"; a setting may be called N.
        rows=tuple((row[0].replace(" m/s", speed), *row[1:]) for row in sheet.rows),
        notes=tuple(map(units.say, sheet.notes)),
    )


def rows_in_units(rows: Iterable[Mapping[str, Any]], units: ShownUnits) -> list[dict[str, Any]]:
    """Return rows whose columns end in ``_N`` and ``_m_per_s`` with these numbers scaled."""

    def scaled(name: str, cell: Any) -> Any:
        unit = "N" if name.endswith("_N") else "m/s" if name.endswith("_m_per_s") else ""
        return units.show(cell, unit) if unit and isinstance(cell, float) else cell

    return [{name: scaled(name, cell) for name, cell in row.items()} for row in rows]
