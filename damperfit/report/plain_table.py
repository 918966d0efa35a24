"""Columns and notes of a sheet as plain lines, as rich lays them out in a pipe, without loading it.

Rich takes a tenth of a second to load and some milliseconds for ten rows. What needs more than
columns side by side, such as cells that wrap or letters two places wide, is left to it.
"""

from __future__ import annotations

import re
import textwrap
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from damperfit.report.sheets.sheet import Sheet

__all__ = ["plain_columns", "plain_paragraph"]

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
