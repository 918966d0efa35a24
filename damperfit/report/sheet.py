"""A table of strings, and how it is written: for a terminal, a pipe, Markdown, HTML."""

from __future__ import annotations

import re
import textwrap
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from rich.console import Console, ConsoleOptions, RenderResult
    from rich.table import Table

__all__ = [
    "Sheet",
    "TerminalTable",
    "fitting_columns",
    "plain_columns",
    "plain_paragraph",
    "printable",
    "sheet_width",
    "terminal_table",
]


# A table of strings: what every table on the terminal, in report.md and on the page begins as.


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


def sheet_width(sheet: Sheet, *, gap: int) -> int:
    """Return the characters of the widest row with ``gap`` blanks between columns."""
    columns = zip(sheet.headings, sheet.units, *sheet.rows, strict=True)
    widths = [max(len(cell) for cell in column) for column in columns]
    return sum(widths) + gap * (len(widths) - 1)


# Text of logs and configurations as it may be shown: `printable`.


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


# Columns and notes of a sheet as plain lines, as rich lays them out in a pipe, without loading it.
#
# Rich takes a tenth of a second to load and some milliseconds for ten rows. What needs more than
# columns side by side, such as cells that wrap or letters two places wide, is left to it.

# One place wide: ASCII, Latin, Greek and Cyrillic letters and signs, lines, bars, one blank.
_NARROW = re.compile("[ -~\u00a1-\u00ac\u00ae-\u02ff\u0370-\u0482\u2500-\u25fc]*")


def plain_columns(
    sheet: Sheet, columns: Sequence[int], widths: Sequence[int], *, gap: int, width: int
) -> list[str] | None:
    """Return headings, units and rows as lines, None where rich has to say how they are laid out.

    Parameters
    ----------
    sheet : Sheet
        The table.
    columns : sequence of int
        Which of its columns.
    widths : sequence of int
        The least width of each column of the sheet.
    gap : int
        Blanks between columns.
    width : int
        Characters of a line.
    """
    shown = []
    for k in columns:
        cells = [sheet.headings[k], *([sheet.units[k]] if any(sheet.units) else [])]
        cells += [row[k] for row in sheet.rows]
        if not all(_NARROW.fullmatch(cell) and cell == cell.strip() for cell in cells):
            return None
        wide = max(widths[k], *map(len, cells))
        shown.append([f"{cell:{'>' if sheet.is_number[k] else '<'}{wide}}" for cell in cells])
    if sum(len(column[0]) + gap for column in shown) - gap > width:
        return None
    return [(" " * gap).join(line).rstrip() for line in zip(*shown, strict=True)]


def plain_paragraph(text: str, width: int) -> list[str] | None:
    """Return a note as lines, None where rich has to say where it breaks."""
    words = text.split(" ")
    if not _NARROW.fullmatch(text) or "" in words or max(map(len, words)) > width:
        return None
    return textwrap.wrap(text, width, break_long_words=False, break_on_hyphens=False)


# A sheet as a table for the terminal; at most 80 columns wide, and plain in a pipe.
#
# A cell may be the name of a log, which may hold anything: rich obeys no markup in a `Text`, but
# passes escape sequences and reversed writing on, so they are shown as escapes.

_COLUMNS = 80
_COLOURS = {"excellent": "green", "good": "yellow", "poor": "red"}


def terminal_table(sheet: Sheet, *, colours: Mapping[str, str] = _COLOURS) -> TerminalTable:
    """Return a table for rich or for a pipe: headings, units, rows, notes below.

    On a terminal cells are coloured by their word. Where the screen is too narrow, text wraps
    between words and the columns that are left go into a table below with the first column again:
    no word and no number is cut.
    """
    return TerminalTable(sheet, colours)


@dataclass(frozen=True)
class TerminalTable:
    """A table that looks at the width of the screen when it is printed.

    Attributes
    ----------
    sheet : Sheet
        What it shows.
    colours : mapping of str to str
        Of cells, by the word in them.
    """

    sheet: Sheet
    colours: Mapping[str, str]

    def plain_lines(self, width: int) -> list[str] | None:
        """Return the lines of a pipe, None where only rich can lay them out."""
        lines: list[str] = []
        gap, widths, parts = self._layout(width)
        for number, columns in enumerate(parts):
            part = plain_columns(self.sheet, columns, widths, gap=gap, width=width)
            if part is None:
                return None
            lines += ["", *part] if number else part
        for note in self.sheet.notes:
            told = plain_paragraph(note, width)
            if told is None:
                return None
            lines += told
        return lines

    def __rich_console__(self, _: Console, options: ConsoleOptions) -> RenderResult:
        """Yield the table, or its parts one below the other, and the notes."""
        from rich.text import Text

        gap, widths, parts = self._layout(options.max_width)
        for number, columns in enumerate(parts):
            if number:
                yield ""
            yield self._table(columns, widths, gap)
        for note in self.sheet.notes:
            yield Text(printable(note), style="dim")

    def _layout(self, width: int) -> tuple[int, list[int], list[list[int]]]:
        """Return the blanks between columns, the least width of each, and what is side by side."""
        gap = 2 if sheet_width(self.sheet, gap=2) <= min(_COLUMNS, width) else 1
        return (
            gap,
            _least_widths(self.sheet, width, gap),
            fitting_columns(self.sheet, width, gap=gap),
        )

    def _table(self, columns: Sequence[int], widths: Sequence[int], gap: int) -> Table:
        from rich.table import Table
        from rich.text import Text

        sheet = self.sheet
        table = Table(box=None, pad_edge=False, padding=(0, gap, 0, 0), header_style="bold")
        for k in columns:
            heading, unit = sheet.headings[k], sheet.units[k]
            table.add_column(
                Text(f"{heading}\n{unit}" if any(sheet.units) else heading),
                justify="right" if sheet.is_number[k] else "left",
                overflow="fold",
                min_width=widths[k],
            )
        for row in sheet.rows:
            cells = (printable(row[k]) for k in columns)
            table.add_row(*(Text(cell, style=self.colours.get(cell, "")) for cell in cells))
        return table


def _least_width(sheet: Sheet, column: int) -> int:
    """Return the width in which nothing of a column is cut: its longest word, or number."""
    cells = [printable(row[column]) for row in sheet.rows]
    words = [*sheet.headings[column].split(), *sheet.units[column].split()]
    words += cells if sheet.is_number[column] else [word for cell in cells for word in cell.split()]
    return max(map(len, words), default=0)


def _least_widths(sheet: Sheet, width: int, gap: int) -> list[int]:
    """Return the least widths as far as the screen has room for the first column and another."""
    first, *others = (_least_width(sheet, k) for k in range(len(sheet.headings)))
    room = width - gap - max(others, default=0)
    first = min(first, max(width // 3, room))
    return [first, *(min(one, width - gap - first) for one in others)]


def fitting_columns(sheet: Sheet, width: int, *, gap: int) -> list[list[int]]:
    """Return which columns stand side by side; the first one leads each part.

    Parameters
    ----------
    sheet : Sheet
        The table.
    width : int
        Characters of the screen.
    gap : int
        Blanks between columns.
    """
    first, *others = _least_widths(sheet, width, gap)
    parts, used = [[0]], first
    for k, least in enumerate(others, start=1):
        if used + gap + least > width and len(parts[-1]) > 1:
            parts.append([0])
            used = first
        parts[-1].append(k)
        used += gap + least
    return parts
