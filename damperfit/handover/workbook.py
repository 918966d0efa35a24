"""An Excel workbook: one sheet a table, headings and units frozen above it; no library is needed.

Text is stored as text, so that no cell can become a formula, and the bytes depend on the results
alone: every entry of the archive has one fixed date.
"""

from __future__ import annotations

import io
import math
import zipfile
from typing import TYPE_CHECKING, Any
from xml.sax.saxutils import escape, quoteattr

from damperfit.handover.force_table import force_tables
from damperfit.handover.plain_tables import PlainTable, forces_by_setting, stored_tables
from damperfit.handover.provenance import gas_line, provenance_lines

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from damperfit.handover.handed_over import HandedOver
    from damperfit.handover.targets import ExportOptions

__all__ = ["write_xlsx"]

_SIGN = "forces, displacement and velocity are positive in rebound (rod out)"
_DATE = (1980, 1, 1, 0, 0, 0)
_MAIN = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
_LINKS = "http://schemas.openxmlformats.org/officeDocument/2006/relationships"
_PARTS = "http://schemas.openxmlformats.org/package/2006"
_KINDS = "application/vnd.openxmlformats-officedocument.spreadsheetml"
_HEAD = '<?xml version="1.0" encoding="UTF-8" standalone="yes"?>\n'
_BOLD, _GREY = 1, 2  # places of the styles below
_STYLES = (
    f'{_HEAD}<styleSheet xmlns="{_MAIN}"><fonts count="3"><font><sz val="11"/></font>'
    '<font><b/><sz val="11"/></font><font><i/><sz val="11"/></font></fonts>'
    '<fills count="2"><fill><patternFill patternType="none"/></fill>'
    '<fill><patternFill patternType="gray125"/></fill></fills><borders count="1"><border/>'
    '</borders><cellStyleXfs count="1"><xf/></cellStyleXfs><cellXfs count="3"><xf/>'
    '<xf fontId="1" applyFont="1"/><xf fontId="2" applyFont="1"/></cellXfs></styleSheet>'
)


def write_xlsx(handed: HandedOver, options: ExportOptions) -> Mapping[str, bytes]:
    """Return one workbook: what it is about, force by speed, and every table of the results."""
    tables = force_tables(handed, extend=options.extend)
    gas = gas_line(tables[0], place="add it to the force")
    lines = provenance_lines(handed, tables, sign=_SIGN, gas=gas)
    about = PlainTable("about", ("about",), ("",), (tuple(lines),))
    sheets = (about, forces_by_setting(handed, options), *stored_tables(handed, options.units))
    return {f"{options.stem}.xlsx": _archive(sheets)}


def _archive(sheets: Sequence[PlainTable]) -> bytes:
    numbers = range(1, len(sheets) + 1)
    names = "".join(
        f'<sheet name={quoteattr(sheet.name)} sheetId="{k}" r:id="rId{k}"/>'
        for k, sheet in zip(numbers, sheets, strict=True)
    )
    links = "".join(
        f'<Relationship Id="rId{k}" Type="{_LINKS}/worksheet" Target="worksheets/sheet{k}.xml"/>'
        for k in numbers
    )
    kinds = "".join(
        f'<Override PartName="/xl/worksheets/sheet{k}.xml" ContentType="{_KINDS}.worksheet+xml"/>'
        for k in numbers
    )
    last = len(sheets) + 1
    parts = {
        "[Content_Types].xml": (
            f'{_HEAD}<Types xmlns="{_PARTS}/content-types"><Default Extension="rels" '
            'ContentType="application/vnd.openxmlformats-package.relationships+xml"/>'
            f'<Override PartName="/xl/workbook.xml" ContentType="{_KINDS}.sheet.main+xml"/>'
            f'<Override PartName="/xl/styles.xml" ContentType="{_KINDS}.styles+xml"/>'
            f"{kinds}</Types>"
        ),
        "_rels/.rels": (
            f'{_HEAD}<Relationships xmlns="{_PARTS}/relationships"><Relationship Id="rId1" '
            f'Type="{_LINKS}/officeDocument" Target="xl/workbook.xml"/></Relationships>'
        ),
        "xl/workbook.xml": (
            f'{_HEAD}<workbook xmlns="{_MAIN}" xmlns:r="{_LINKS}"><sheets>{names}</sheets>'
            "</workbook>"
        ),
        "xl/_rels/workbook.xml.rels": (
            f'{_HEAD}<Relationships xmlns="{_PARTS}/relationships">{links}<Relationship '
            f'Id="rId{last}" Type="{_LINKS}/styles" Target="styles.xml"/></Relationships>'
        ),
        "xl/styles.xml": _STYLES,
        **{
            f"xl/worksheets/sheet{k}.xml": _sheet(sheet)
            for k, sheet in zip(numbers, sheets, strict=True)
        },
    }
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.comment = b"damperfit"
        for name, text in parts.items():
            archive.writestr(
                zipfile.ZipInfo(name, _DATE),
                text.encode("utf-8", "replace"),
                compress_type=zipfile.ZIP_DEFLATED,
            )
    return file.getvalue()


def _sheet(table: PlainTable) -> str:
    head = [(table.headings, _BOLD)] + ([(table.units, _GREY)] if any(table.units) else [])
    rows = "".join(
        f'<row r="{k}">{_cells(cells, k, style)}</row>' for k, (cells, style) in enumerate(head, 1)
    )
    first = len(head) + 1
    rows += "".join(
        f'<row r="{k}">{_cells(cells, k, 0)}</row>'
        for k, cells in enumerate(zip(*table.columns, strict=True), first)
    )
    widths = "".join(
        f'<col min="{k}" max="{k}" width="{min(max(len(name) + 2, 9), 40)}" customWidth="1"/>'
        for k, name in enumerate(table.headings, 1)
    )
    pane = (
        f'<pane ySplit="{len(head)}" topLeftCell="A{first}" activePane="bottomLeft" '
        'state="frozen"/>'
    )
    return (
        f'{_HEAD}<worksheet xmlns="{_MAIN}"><sheetViews><sheetView workbookViewId="0">{pane}'
        f"</sheetView></sheetViews><cols>{widths}</cols><sheetData>{rows}</sheetData></worksheet>"
    )


def _cells(cells: Sequence[Any], row: int, style: int) -> str:
    return "".join(_cell(cell, f"{_column(k)}{row}", style) for k, cell in enumerate(cells))


def _cell(cell: Any, place: str, style: int) -> str:
    look = f' s="{style}"' if style else ""
    if isinstance(cell, int | float) and not isinstance(cell, bool):
        return f'<c r="{place}"{look}><v>{cell!r}</v></c>' if math.isfinite(cell) else ""
    if cell is None or cell == "":
        return ""
    text = escape("".join(one if one.isprintable() else " " for one in str(cell)))
    return f'<c r="{place}"{look} t="inlineStr"><is><t xml:space="preserve">{text}</t></is></c>'


def _column(place: int) -> str:
    """Return the letters of a column counted from 0: A, Z, AA."""
    letters = ""
    place += 1
    while place:
        place, rest = divmod(place - 1, 26)
        letters = chr(ord("A") + rest) + letters
    return letters
