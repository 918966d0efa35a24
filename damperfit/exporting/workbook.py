"""An Excel workbook: one sheet a table, headings and units frozen above it; no library is needed.

Text is stored as text, so that no cell can become a formula, and the bytes depend on the results
alone: every entry of the archive has one fixed date.
"""

from __future__ import annotations

import io
import math
import zipfile
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any
from xml.sax.saxutils import escape, quoteattr

import pyarrow as pa
import pyarrow.parquet as pq

from damperfit.errors import ConfigurationError
from damperfit.exporting.header import gas_line, header_lines

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from damperfit.exporting.source import ExportedRun
    from damperfit.exporting.tables import ForceTable
    from damperfit.exporting.targets import ExportOptions
    from damperfit.units.shown_units import ShownUnits

__all__ = ["TABLE_NAMES", "PlainTable", "stored_tables", "write_xlsx"]

TABLE_NAMES = ("parameters", "mse", "adjustment", "characteristics")
_SIGN = "forces, displacement and velocity are positive in rebound (rod out)"
_DATE = (1980, 1, 1, 0, 0, 0)
_MAIN = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
_LINKS = "http://schemas.openxmlformats.org/officeDocument/2006/relationships"
_PARTS = "http://schemas.openxmlformats.org/package/2006"
_KINDS = "application/vnd.openxmlformats-officedocument.spreadsheetml"
_HEAD = '<?xml version="1.0" encoding="UTF-8" standalone="yes"?>\n'
_BOLD, _GREY = 1, 2  # places of the styles below
_FONT = '<sz val="11"/><name val="Calibri"/><family val="2"/>'
_STYLES = (
    f'{_HEAD}<styleSheet xmlns="{_MAIN}"><fonts count="3"><font>{_FONT}</font>'
    f"<font><b/>{_FONT}</font><font><i/>{_FONT}</font></fonts>"
    '<fills count="2"><fill><patternFill patternType="none"/></fill>'
    '<fill><patternFill patternType="gray125"/></fill></fills><borders count="1"><border><left/>'
    "<right/><top/><bottom/><diagonal/></border></borders>"
    '<cellStyleXfs count="1"><xf numFmtId="0" fontId="0" fillId="0" borderId="0"/></cellStyleXfs>'
    '<cellXfs count="3"><xf numFmtId="0" fontId="0" fillId="0" borderId="0" xfId="0"/>'
    '<xf numFmtId="0" fontId="1" fillId="0" borderId="0" xfId="0" applyFont="1"/>'
    '<xf numFmtId="0" fontId="2" fillId="0" borderId="0" xfId="0" applyFont="1"/></cellXfs>'
    '<cellStyles count="1"><cellStyle name="Normal" xfId="0" builtinId="0"/></cellStyles>'
    "</styleSheet>"
)


@dataclass(frozen=True, slots=True)
class PlainTable:
    """A table as columns.

    Attributes
    ----------
    name : str
        Of the table.
    headings, units : tuple of str
        One per column.
    columns : tuple of tuple
        Numbers, text, or None where nothing is known.
    """

    name: str
    headings: tuple[str, ...]
    units: tuple[str, ...]
    columns: tuple[tuple[Any, ...], ...]


def write_xlsx(
    run: ExportedRun, tables: Sequence[ForceTable], options: ExportOptions
) -> Mapping[str, bytes]:
    """Return one workbook: what it is about, force by speed, and every table of the results."""
    gas = gas_line(tables[0], place="add it to the force")
    lines = header_lines(run, tables, sign=_SIGN, gas=gas)
    about = PlainTable("about", ("about",), ("",), (tuple(lines),))
    sheets = (about, _forces(tables, options.units), *stored_tables(run, options.units))
    return {f"{options.stem}.xlsx": _archive(sheets)}


def _forces(tables: Sequence[ForceTable], shown: ShownUnits) -> PlainTable:
    """Force by speed, a column for each setting, then half the 95 % interval of each."""
    known = [table for table in tables if table.has_interval]
    halves = [0.5 * (table.high - table.low) for table in known]
    columns = [
        shown.show(tables[0].speeds, "m/s"),
        *(shown.show(one, "N") for one in (*(table.forces for table in tables), *halves)),
    ]
    return PlainTable(
        "forces",
        (
            shown.column("speed_m_per_s", "m/s"),
            *(f"setting {table.setting}" for table in tables),
            *(f"± 95 % of setting {table.setting}" for table in known),
        ),
        (shown.of("m/s"), *(shown.of("N") for _ in columns[1:])),
        tuple(tuple(column.tolist()) for column in columns),
    )


def stored_tables(run: ExportedRun, units: ShownUnits) -> Iterator[PlainTable]:
    """Yield the tables that `identify` wrote, as far as they are there.

    Raises
    ------
    ConfigurationError
        One cannot be read.
    """
    for name in TABLE_NAMES:
        path = run.folder / f"{name}.parquet"
        if not path.is_file():
            continue
        try:
            with pq.ParquetFile(path, page_checksum_verification=True) as file:
                table = file.read()
        except (OSError, ValueError, pa.ArrowException) as error:
            raise ConfigurationError(
                f"{path}: cannot be read: {error}; run damperfit identify LOGS again"
            ) from error
        yield _plain(name, table, units)


def _plain(name: str, table: pa.Table, units: ShownUnits) -> PlainTable:
    headings, shown, columns = [], [], []
    for field, column in zip(table.schema, table.columns, strict=True):
        unit = (field.metadata or {}).get(b"unit", b"").decode()
        unit = "" if unit == "1" else unit
        headings.append(units.column(field.name, unit))
        shown.append(units.of(unit))
        cells = column.to_pylist()
        if units.of(unit) != unit:
            cells = [None if cell is None else units.show(float(cell), unit) for cell in cells]
        columns.append(tuple(cells))
    return PlainTable(name, tuple(headings), tuple(shown), tuple(columns))


def _archive(sheets: Sequence[PlainTable]) -> bytes:
    numbered = list(enumerate(sheets, 1))
    names = "".join(
        f'<sheet name={quoteattr(sheet.name)} sheetId="{k}" r:id="rId{k}"/>'
        for k, sheet in numbered
    )
    links = "".join(
        f'<Relationship Id="rId{k}" Type="{_LINKS}/worksheet" Target="worksheets/sheet{k}.xml"/>'
        for k, _ in numbered
    )
    kinds = "".join(
        f'<Override PartName="/xl/worksheets/sheet{k}.xml" ContentType="{_KINDS}.worksheet+xml"/>'
        for k, _ in numbered
    )
    relationships = f'{_HEAD}<Relationships xmlns="{_PARTS}/relationships">'
    parts = {
        "[Content_Types].xml": (
            f'{_HEAD}<Types xmlns="{_PARTS}/content-types"><Default Extension="rels" '
            'ContentType="application/vnd.openxmlformats-package.relationships+xml"/>'
            '<Default Extension="xml" ContentType="application/xml"/>'
            f'<Override PartName="/xl/workbook.xml" ContentType="{_KINDS}.sheet.main+xml"/>'
            f'<Override PartName="/xl/styles.xml" ContentType="{_KINDS}.styles+xml"/>'
            f"{kinds}</Types>"
        ),
        "_rels/.rels": (
            f'{relationships}<Relationship Id="rId1" Type="{_LINKS}/officeDocument" '
            'Target="xl/workbook.xml"/></Relationships>'
        ),
        "xl/workbook.xml": (
            f'{_HEAD}<workbook xmlns="{_MAIN}" xmlns:r="{_LINKS}"><sheets>{names}</sheets>'
            "</workbook>"
        ),
        "xl/_rels/workbook.xml.rels": (
            f'{relationships}{links}<Relationship Id="rId{len(sheets) + 1}" '
            f'Type="{_LINKS}/styles" Target="styles.xml"/></Relationships>'
        ),
        "xl/styles.xml": _STYLES,
        **{f"xl/worksheets/sheet{k}.xml": _sheet(sheet) for k, sheet in numbered},
    }
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.comment = b"damperfit"
        for name, text in parts.items():
            entry = zipfile.ZipInfo(name, _DATE)
            archive.writestr(entry, text.encode("utf-8", "replace"), zipfile.ZIP_DEFLATED)
    return file.getvalue()


def _sheet(table: PlainTable) -> str:
    head = [(table.headings, _BOLD)] + ([(table.units, _GREY)] if any(table.units) else [])
    styled = [*head, *((cells, 0) for cells in zip(*table.columns, strict=True))]
    rows = "".join(
        f'<row r="{k}">{"".join(_cell(one, f"{_column(c)}{k}", style) for c, one in cells)}</row>'
        for k, (cells, style) in enumerate(((enumerate(c), style) for c, style in styled), 1)
    )
    widths = "".join(
        f'<col min="{k}" max="{k}" width="{min(max(len(name) + 2, 9), 40)}" customWidth="1"/>'
        for k, name in enumerate(table.headings, 1)
    )
    pane = (
        f'<pane ySplit="{len(head)}" topLeftCell="A{len(head) + 1}" activePane="bottomLeft" '
        'state="frozen"/>'
    )
    return (
        f'{_HEAD}<worksheet xmlns="{_MAIN}"><sheetViews><sheetView workbookViewId="0">{pane}'
        f"</sheetView></sheetViews><cols>{widths}</cols><sheetData>{rows}</sheetData></worksheet>"
    )


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
