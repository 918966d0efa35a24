"""A sheet as a table for the terminal; at most 80 columns wide, and plain in a pipe.

A cell may be the name of a log, which may hold anything: rich obeys no markup in a `Text`, but
passes escape sequences and reversed writing on, so they are shown as escapes.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from damperfit.report.sheets.sheet import Sheet, sheet_width
from damperfit.report.text import printable

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rich.console import RenderableType

__all__ = ["terminal_table"]

_COLUMNS = 80
_COLOURS = {"excellent": "green", "good": "yellow", "poor": "red"}


def terminal_table(sheet: Sheet, *, colours: Mapping[str, str] = _COLOURS) -> RenderableType:
    """Return a rich table: headings, units, rows, notes below; cells coloured by their word."""
    from rich.console import Group
    from rich.table import Table
    from rich.text import Text

    gap = 2 if sheet_width(sheet, gap=2) <= _COLUMNS else 1
    table = Table(box=None, pad_edge=False, padding=(0, gap, 0, 0), header_style="bold")
    for heading, unit, is_number in zip(sheet.headings, sheet.units, sheet.is_number, strict=True):
        table.add_column(
            Text(f"{heading}\n{unit}" if any(sheet.units) else heading),
            justify="right" if is_number else "left",
            overflow="fold",
        )
    for row in sheet.rows:
        table.add_row(*(Text(printable(cell), style=colours.get(cell, "")) for cell in row))
    return Group(table, *(Text(printable(note), style="dim") for note in sheet.notes))
