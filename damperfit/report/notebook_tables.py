"""Sheets of the report as text and as HTML, as objects of a notebook print themselves."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from damperfit.report.sheet import Sheet

__all__ = ["WIDTH", "html_table", "text_table"]

WIDTH = 100


def text_table(sheet: Sheet) -> str:
    """Return a sheet as lines of text with a fixed width."""
    from io import StringIO

    from rich.console import Console

    from damperfit.report.sheet import terminal_table

    lines = StringIO()
    # Rich would draw in the cell where it sees a notebook, and set bold where FORCE_COLOR asks.
    plain = Console(file=lines, width=WIDTH, color_system=None, force_jupyter=False)
    plain.print(terminal_table(sheet))
    return lines.getvalue().rstrip("\n")


def html_table(sheet: Sheet, *, caption: str = "") -> str:
    """Return a sheet as a table of HTML."""

    def row(kind: str, cells: tuple[str, ...]) -> str:
        styles = (" style='text-align:right'" if right else "" for right in sheet.is_number)
        inside = (
            f"<{kind}{style}>{escape(cell)}</{kind}>"
            for cell, style in zip(cells, styles, strict=True)
        )
        return f"<tr>{''.join(inside)}</tr>"

    head = row("th", sheet.headings) + (row("th", sheet.units) if any(sheet.units) else "")
    body = "".join(row("td", cells) for cells in sheet.rows)
    return (
        f"<table><caption>{escape(caption)}</caption><thead>{head}</thead>"
        f"<tbody>{body}</tbody></table>"
    )
