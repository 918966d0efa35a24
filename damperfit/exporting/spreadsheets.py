"""Spreadsheets: CSV files, and an Excel workbook for which no library is needed.

Text of the workbook is stored as text, so that no cell can become a formula, and the bytes depend
on the results alone: every entry of the archive has one fixed date.
"""

from __future__ import annotations

import csv
import io
import math
import zipfile
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any
from xml.sax.saxutils import escape

import pyarrow as pa
import pyarrow.parquet as pq

from damperfit.errors import ConfigurationError
from damperfit.exporting.header import gas_line, header_lines
from damperfit.exporting.writers import rendered
from damperfit.tables.files import safe_cell

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from damperfit.exporting.source import ExportedRun
    from damperfit.exporting.tables import ForceTable
    from damperfit.exporting.targets import ExportOptions
    from damperfit.units.shown_units import ShownUnits

__all__ = ["TABLE_NAMES", "csv_files", "write_xlsx"]

TABLE_NAMES = ("parameters", "mse", "adjustment", "characteristics")
_SIGN = "forces, displacement and velocity are positive in rebound (rod out)"
_DATE = (1980, 1, 1, 0, 0, 0)
_MAIN = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
_HEAD = '<?xml version="1.0" encoding="UTF-8" standalone="yes"?>\n'
_BOLD, _GREY = 1, 2  # places in templates/xlsx_styles.xml
_PARTS = {
    "[Content_Types].xml": "xlsx_types.xml",
    "_rels/.rels": "xlsx_rels.xml",
    "xl/workbook.xml": "xlsx_workbook.xml",
    "xl/_rels/workbook.xml.rels": "xlsx_workbook_rels.xml",
    "xl/styles.xml": "xlsx_styles.xml",
}


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
        path = run.run.folder / f"{name}.parquet"
        if not path.is_file():
            continue
        try:
            with pq.ParquetFile(path, page_checksum_verification=True) as file:
                table = file.read()
        except (OSError, ValueError, pa.ArrowException) as error:
            raise ConfigurationError(
                f"cannot be read: {error}; run damperfit identify LOGS again", subject=path
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
    parts = {name: rendered(template, sheets=sheets) for name, template in _PARTS.items()}
    parts |= {f"xl/worksheets/sheet{k}.xml": _sheet(one) for k, one in enumerate(sheets, 1)}
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


def csv_files(
    run: ExportedRun, tables: Sequence[ForceTable], options: ExportOptions
) -> Mapping[str, bytes]:
    """Return a row for each setting and speed, every table of the results, and what it is about.

    With a decimal comma the cells stand between semicolons, as spreadsheets of those countries read
    and write them. What other targets say in a comment stands in a text file: CSV has no comments.
    """
    shown, mark, stem = options.units, options.decimal, options.stem
    columns = ("force_N", "force_ci_low_N", "force_ci_high_N")
    rows = []
    for table in tables:
        forces = [shown.show(one, "N") for one in (table.forces, table.low, table.high)]
        speeds = zip(table.speeds, shown.show(table.speeds, "m/s"), *forces, strict=True)
        for at, speed, force, *ends in speeds:
            numbers = [f"{speed:.6g}", f"{force:.3f}", *(f"{end:.3f}" for end in ends)]
            numbers = [one.replace(".", mark) for one in numbers]
            ends_known = numbers[2:] if table.has_interval else ["", ""]
            rows.append([str(table.setting), *numbers[:2], table.range_of(at), *ends_known])
    force, *ends = (shown.column(name, "N") for name in columns)
    head = ("setting", shown.column("speed_m_per_s", "m/s"), force, "range", *ends)
    gas = gas_line(tables[0], place="add it to the force")
    about = "\n".join(header_lines(run, tables, sign=_SIGN, gas=gas)) + "\n"
    files = {
        f"{stem}.csv": _csv(head, rows, mark),
        f"{stem}_about.txt": about.encode("utf-8", "backslashreplace"),
    }
    for stored in stored_tables(run, shown):
        named = [_heading(*pair) for pair in zip(stored.headings, stored.units, strict=True)]
        cells = ([_csv_cell(one, mark) for one in row] for row in zip(*stored.columns, strict=True))
        files[f"{stem}_{stored.name}.csv"] = _csv(named, cells, mark)
    return files


def _csv(head: Sequence[str], rows: Iterable[Sequence[str]], mark: str) -> bytes:
    text = io.StringIO()
    writer = csv.writer(text, delimiter=";" if mark == "," else ",", lineterminator="\n")
    writer.writerow(head)
    writer.writerows([_safe(cell) for cell in row] for row in rows)
    return text.getvalue().encode("utf-8", "backslashreplace")


def _heading(name: str, unit: str) -> str:
    """Return the name with its unit, where it does not end with it already."""
    is_said = not unit or name.endswith("_" + unit.replace("/", "_per_"))
    return name if is_said else f"{name} [{unit}]"


def _csv_cell(cell: Any, mark: str) -> str:
    if cell is None or (isinstance(cell, float) and not math.isfinite(cell)):
        return ""
    return repr(cell).replace(".", mark) if isinstance(cell, float) else str(cell)


def _safe(cell: str) -> str:
    """Return a cell that no spreadsheet takes for a formula; numbers stay numbers."""
    try:
        float(cell.replace(",", "."))
    except ValueError:
        return safe_cell(cell)
    return cell
