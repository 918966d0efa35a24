"""A table of strings: what every table on the terminal, in report.md and on the page begins as."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Sheet", "sheet_width"]


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
