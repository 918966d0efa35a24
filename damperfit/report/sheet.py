"""A table of strings, and how it is written: text for a terminal or a pipe, Markdown, HTML.

A cell may be the name of a log, which may hold anything: control characters and reversed writing
are shown as escapes, and what Markdown or HTML could read as markup is escaped.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from html import escape as escape_html
from typing import TYPE_CHECKING
from unicodedata import combining, east_asian_width

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

__all__ = ["Sheet", "escape", "html_table", "markdown_table", "printable", "text_table", "wrapped"]

_COLUMNS = 80
_COLOURS = {"excellent": 32, "passed": 32, "good": 33, "poor": 31, "FAILED": 31}  # ANSI
# Everything Markdown or the HTML inside it could read as markup, and no more: the report is read as
# it stands too. An underscore between letters is none; signs and numbers are lists at a start only.
_SPECIAL = re.compile(r"([\\`*\[\]<>#|~&$@]|(?<![^\W_])_|_(?![^\W_]))")
_LIST = re.compile(r"^(\d*)([-+.)])(?=\s|$|\2)")
# Nearly all cells of a table: words and numbers in which there is nothing to look for.
_PLAIN = re.compile(r"[0-9A-Za-z]+(?:\.[0-9A-Za-z]+)*")


@dataclass(frozen=True, slots=True)
class Sheet:
    """A table of strings.

    Attributes
    ----------
    headings, units : tuple of str
        One per column; units may be empty strings.
    rows : tuple of tuple of str
        Cells.
    is_number : tuple of bool
        Columns that are aligned to the right.
    notes : tuple of str
        Lines that belong below the table.
    """

    headings: tuple[str, ...]
    units: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    is_number: tuple[bool, ...]
    notes: tuple[str, ...] = ()

    def width(self, gap: int, *, folds: bool = False) -> int:
        """Return the characters of the widest row with ``gap`` blanks between columns.

        Parameters
        ----------
        gap : int
            Blanks.
        folds : bool
            Columns of text are as wide as their longest word: they may wrap.
        """
        columns = zip(self.headings, self.units, *self.rows, strict=True)
        widths = [
            max(_places(part) for cell in column for part in (cell.split() or [""]))
            if folds and not is_number
            else max(map(_places, column))
            for column, is_number in zip(columns, self.is_number, strict=True)
        ]
        return sum(widths) + gap * (len(widths) - 1)


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
    table below with the first column again: no word and no number is cut.

    Parameters
    ----------
    sheet : Sheet
        The table.
    width : int
        Characters of a line.
    colours : mapping of str to int, optional
        ANSI colours of cells, by the word in them; None: plain. What is not in it has the colour
        of a grade.
    """
    gap = 2 if sheet.width(2) <= min(_COLUMNS, width) else 1
    least = _least_widths(sheet, width, gap)
    known = None if colours is None else {**_COLOURS, **colours}
    lines: list[str] = []
    for columns in _parts(least, width, gap):
        lines += ["", *_part(sheet, columns, least, width, gap, known)]
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
    """Return a sheet as a table of HTML, every text of it escaped.

    Parameters
    ----------
    sheet : Sheet
        The table.
    caption : str
        Above it; none where it is empty.
    looks : mapping of str to str, optional
        For a page with a style: classes of cells, by the word in them. None: numbers are set to
        the right by styles of their own, for a notebook.
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


_WORD = 12  # letters of a word that a narrow column does not tear
