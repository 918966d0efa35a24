"""A table of strings, its numbers as text, and how it is written: terminal, Markdown, HTML.

A cell may be the name of a log, which may hold anything: control characters and reversed writing
are shown as escapes, and what Markdown or HTML could read as markup is escaped. Numbers are rounded
for reading: by their 95 % interval where there is one.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, replace
from html import escape as escape_html
from typing import TYPE_CHECKING, Any, NamedTuple
from unicodedata import combining, east_asian_width

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    from damperfit.damper.quantity import Quantity
    from damperfit.units.shown_units import ShownUnits

NOTHING = "-"
_COLUMNS = 80
# ANSI, of words.
COLOURS = {
    "excellent": 32,
    "passed": 32,
    "good": 33,
    "poor": 31,
    "FAILED": 31,
    "not evaluated": 2,
}
_WORD = 12  # letters of a word that a narrow column does not tear
# Everything Markdown or the HTML inside it could read as markup, and no more: the report is read as
# it stands too. An underscore between letters is none; signs and numbers are lists at a start only.
_SPECIAL = re.compile(r"([\\`*\[\]<>#|~&$@]|(?<![^\W_])_|_(?![^\W_]))")
_LIST = re.compile(r"^(\d*)([-+.)])(?=\s|$|\2)")
# Nearly all cells of a table: words and numbers in which there is nothing to look for.
_PLAIN = re.compile(r"[0-9A-Za-z]+(?:\.[0-9A-Za-z]+)*")
_UNEVEN, _LEAST = 1.25, 0.1
_TWO_DIGITS = 19  # an error of these digits or fewer shows two of them, another one
_OF_A_PARAMETER = ("", "_se", "_ci_low", "_ci_high", "_misfit_se")


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
    return Sheet(
        headings, units, tuple(tuple(cell(row) for cell in cells) for row in rows), is_number, notes
    )


def printable(text: str) -> str:
    r"""Return the text with control characters and reversed writing as escapes.

    Examples
    --------
    >>> print(printable("run_1\x1b[0m"))
    run_1\x1b[0m
    """
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)


def text_table(
    sheet: Sheet, width: int = _COLUMNS, *, colours: Mapping[str, int] | None = None
) -> str:
    """Return a table as lines of text: headings, units, rows, notes below.

    Where the width does not do, text wraps between words and the columns that are left go into a
    table below with the first column again: no word and no number is cut. ``colours`` are ANSI
    colours of cells by the word in them, besides those of grades; None: plain.
    """
    columns = zip(sheet.headings, sheet.units, *sheet.rows, strict=True)
    whole = sum(max(map(_places, column)) + 2 for column in columns) - 2
    gap = 2 if whole <= min(_COLUMNS, width) else 1
    least = _least_widths(sheet, width, gap)
    known = None if colours is None else {**COLOURS, **colours}
    lines: list[str] = []
    for part in _parts(least, width, gap):
        lines += ["", *_part(sheet, part, least, width, gap, known)]
    for note in sheet.notes:
        said = wrapped(printable(note), width)
        lines += said if known is None else [f"\x1b[2m{line}\x1b[0m" for line in said]
    return "\n".join(lines[1:])


def _part(
    sheet: Sheet,
    columns: Sequence[int],
    least: Sequence[int],
    width: int,
    gap: int,
    colours: Mapping[str, int] | None,
) -> Iterator[str]:
    """Yield the lines of some columns side by side."""
    heads = [sheet.headings, *([sheet.units] if any(sheet.units) else [])]
    cells = [[printable(row[k]) for k in columns] for row in (*heads, *sheet.rows)]
    widths = [max(least[k], *(_places(row[at]) for row in cells)) for at, k in enumerate(columns)]
    while sum(widths) + gap * (len(columns) - 1) > width:
        spare = [wide - least[k] for k, wide in zip(columns, widths, strict=True)]
        if not any(one > 0 for one in spare):
            break
        widths[max(range(len(columns)), key=lambda at: (spare[at] > 0, widths[at]))] -= 1
    for number, row in enumerate(cells):
        folded = [wrapped(cell, wide) for cell, wide in zip(row, widths, strict=True)]
        for line in range(max(map(len, folded))):
            shown = []
            for at, k in enumerate(columns):
                text = folded[at][line] if line < len(folded[at]) else ""
                blanks = " " * (widths[at] - _places(text))
                if colours is not None and text:
                    code = 1 if number < len(heads) else colours.get(row[at])
                    text = f"\x1b[{code}m{text}\x1b[0m" if code else text
                shown.append(blanks + text if sheet.is_number[k] else text + blanks)
            yield (" " * gap).join(shown).rstrip()


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


def _least_widths(sheet: Sheet, width: int, gap: int) -> list[int]:
    """Return widths that cut no word and no number, as far as the first column leaves room."""

    def least(k: int) -> int:
        cells = [printable(row[k]) for row in sheet.rows]
        words = [*sheet.headings[k].split(), *sheet.units[k].split()]
        words += cells if sheet.is_number[k] else [word for cell in cells for word in cell.split()]
        return max(map(_places, words), default=0)

    first, *others = map(least, range(len(sheet.headings)))
    room = width - gap - max(others, default=0)
    first = min(first, max(width // 3, room))
    return [first, *(min(one, width - gap - first) for one in others)]


def _parts(least: Sequence[int], width: int, gap: int) -> list[list[int]]:
    """Return which columns stand side by side; the first one leads each part."""
    parts, used = [[0]], least[0]
    for k, wide in enumerate(least[1:], start=1):
        if used + gap + wide > width and len(parts[-1]) > 1:
            parts.append([0])
            used = least[0]
        parts[-1].append(k)
        used += gap + wide
    return parts


def escape(text: str) -> str:
    r"""Return text that Markdown shows as it is, on one line, control characters as escapes.

    Examples
    --------
    >>> print(escape("<b>|run_1 _2_\x1b[0m (+1 %)"))
    \<b\>\|run_1 \_2\_\\x1b\[0m (+1 %)
    """
    if _PLAIN.fullmatch(text):
        return text
    shown = printable(" ".join(text.split()))
    return _LIST.sub(r"\1\\\2", _SPECIAL.sub(r"\\\1", shown))


def markdown_table(sheet: Sheet) -> list[str]:
    """Return a sheet as the lines of a Markdown table, its notes below; nothing without rows."""
    if not sheet.rows:
        return []
    heads = [
        f"{escape(heading)}{f' {unit}' if unit else ''}"
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

    def cell(kind: str, text: str, *, is_number: bool) -> str:
        how = ""
        if looks is None:
            how = " style='text-align:right'" if is_number else ""
        elif is_number:
            how = " class=n"
        elif text in looks:
            how = f" class={looks[text]}"
        elif kind == "td" and len(text) <= _WORD and text.isalpha():
            how = " class=word"
        return f"<{kind}{how}>{escape_html(printable(text))}</{kind}>"

    def row(kind: str, cells: Iterable[str]) -> str:
        pairs = zip(cells, sheet.is_number, strict=True)
        return f"<tr>{''.join(cell(kind, text, is_number=right) for text, right in pairs)}</tr>"

    heads = [row("th", cells) for cells in (sheet.headings, sheet.units) if any(cells)]
    body = "\n".join(row("td", cells) for cells in sheet.rows)
    title = f"<caption>{escape_html(printable(caption))}</caption>" if caption else ""
    return f"<table>{title}<thead>{''.join(heads)}</thead><tbody>\n{body}</tbody></table>"


# Numbers


def number(value: float | None, *, digits: int = 5) -> str:
    """Return a number with ``digits`` significant digits and no exponent where that reads well.

    Examples
    --------
    >>> number(23.9451234), number(0.0), number(None), number(1234567.0)
    ('23.945', '0', '-', '1.2346e+06')
    """
    if value is None or not math.isfinite(value):
        return NOTHING
    if value == 0.0:
        return "0"
    if not 1e-3 <= abs(value) < 10.0**digits:
        return f"{value:.{digits - 1}e}"
    return f"{value:.{_decimals(value, digits)}f}"


def with_interval(
    value: float | None,
    low: float | None,
    high: float | None,
    *,
    digits: int = 5,
    plus: str = "",
) -> str:
    """Return a value and half of its interval, both to the place that the interval tells.

    Where the limits are not as far below as above, they stand behind it. Without limits
    ``digits`` significant digits are shown. ``plus`` is "+" for changes, which show their sign.

    Examples
    --------
    >>> with_interval(14.0049, 13.9842, 14.0257), with_interval(45678.9, 45300.0, 46050.0)
    ('14.00 ± 0.02', '45700 ± 400')
    >>> with_interval(0.631, 0.134, 2.963), with_interval(2.0, None, None)
    ('0.6 (0.1 to 3.0)', '2.0000')
    """
    if value is None or not math.isfinite(value):
        return NOTHING
    ends = [end for end in (low, high) if end is not None and math.isfinite(end)]
    if len(ends) < 2 or not ends[0] <= value <= ends[1] or ends[0] == ends[1]:
        return number(value, digits=digits) if not plus else f"{value:+.{digits - 1}g}"
    below, above = value - ends[0], ends[1] - value
    half = 0.5 * (ends[1] - ends[0])
    is_even = max(below, above) <= _UNEVEN * min(below, above)
    place = _place(half if is_even else max(min(below, above), _LEAST * half))
    shown = _round_at(value, place, plus)
    if is_even:
        return f"{shown} ± {_round_at(half, place)}"
    return f"{shown} ({_round_at(ends[0], place)} to {_round_at(ends[1], place)})"


def percent(value: float | None) -> str:
    """Return a percentage with three significant digits.

    Examples
    --------
    >>> percent(0.012345), percent(12.3456), percent(None)
    ('0.0123', '12.3', '-')
    """
    if value is None or not math.isfinite(value):
        return NOTHING
    if value == 0.0:
        return "0"
    if abs(value) < 1e-4:
        return f"{value:.1e}"
    return f"{value:.{_decimals(value, 3)}f}"


def _place(error: float) -> int:
    """Return the decimal place of the last digit that an error tells."""
    place = math.floor(math.log10(error)) - 1
    return place if round(error / 10.0**place) <= _TWO_DIGITS else place + 1


def _round_at(value: float, place: int, plus: str = "") -> str:
    step = 10.0**place
    return f"{round(value / step) * step + 0.0:{plus}.{max(0, -place)}f}"


def _decimals(value: float, digits: int) -> int:
    """Return the decimals that show ``digits`` significant digits of the rounded value."""
    power = int(f"{value:.{digits - 1}e}".partition("e")[2])
    return max(0, digits - 1 - power)


def stroke_ratio(rebound: float, bump: float) -> str:
    """Return the force in rebound over that in bump.

    At low speed the gas pushes both strokes to one side: then there is no ratio.
    """
    return number(-rebound / bump if rebound > 0.0 > bump else None, digits=3)


# Units of people


def sheet_in_units(sheet: Sheet, units: ShownUnits) -> Sheet:
    """Return a table whose forces and speeds are scaled already with the names of the units.

    Names stand in the headings, the units, the first column and the notes.
    """
    if units.is_si:
        return sheet
    speed = units.of("m/s")
    return replace(
        sheet,
        headings=tuple(map(units.say, sheet.headings)),
        units=tuple(map(units.say, sheet.units)),
        # "hysteresis at 5.9 m/s"; a setting may be called N.
        rows=tuple((row[0].replace(" m/s", f" {speed}"), *row[1:]) for row in sheet.rows),
        notes=tuple(map(units.say, sheet.notes)),
    )


def rows_in_units(rows: Iterable[Mapping[str, Any]], units: ShownUnits) -> list[dict[str, Any]]:
    """Return rows whose columns end in ``_N`` and ``_m_per_s`` with these numbers scaled."""
    return [{name: _scaled(name, cell, units) for name, cell in row.items()} for row in rows]


def _scaled(name: str, cell: Any, units: ShownUnits) -> Any:
    if isinstance(cell, float):
        for end, unit in (("_N", "N"), ("_m_per_s", "m/s")):
            if name.endswith(end):
                return units.show(cell, unit)
    return cell


def parameters_in_units(
    rows: Sequence[Mapping[str, Any]], quantities: Sequence[Quantity], units: ShownUnits
) -> tuple[list[dict[str, Any]], tuple[Quantity, ...]]:
    """Return rows of parameters with what is a force scaled, and the quantities as they are shown.

    What has units of its own, as R_m1 does, keeps them.
    """
    forces = [one.name for one in quantities if one.unit == "N" and units.of("N") != "N"]
    names = {f"{name}{end}" for name in forces for end in _OF_A_PARAMETER}

    def cell(name: str, value: Any) -> Any:
        is_force = name in names and value is not None
        return units.show(float(value), "N") if is_force else value

    shown = tuple(
        replace(
            one,
            unit=units.of("N"),
            shown_unit="",
            plausible=(units.show(one.plausible[0], "N"), units.show(one.plausible[1], "N")),
            size=units.show(one.size, "N"),
        )
        if one.name in forces
        else one
        for one in quantities
    )
    return [{name: cell(name, value) for name, value in row.items()} for row in rows], shown
