"""Excel workbooks, through python-calamine: the values as last saved, sheet by sheet.

The format: a ZIP archive of XML (ECMA-376), or before 2007 a compound file.

Traps. A kilobyte of the archive may unpack to gigabytes: what its directory says is checked first.
A formula that was never computed has no value, so formulas are counted and noted. Nothing is ever
computed: formulas give the value they had, macros and links are not looked at. Each sheet is
written out as text and then read like any text log, so names, units rows and wall-clock times are
understood alike; a line number in a message is the row of the sheet.
"""

from __future__ import annotations

import datetime as dt
import io
import re
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from damperfit.errors import LogError
from damperfit.readers.channels import visible
from damperfit.readers.delimited import read_delimited
from damperfit.readers.foreign import check_size, load_library, refusing_damage

if TYPE_CHECKING:
    import zipfile
    from collections.abc import Sequence

    from damperfit.readers.files import Source
    from damperfit.readers.options import ReadOptions
    from damperfit.readers.table import Table

__all__ = ["read_excel"]

_MAX_MEMBERS = 10_000
_FORMULA = re.compile(rb"<(?:\w+:)?f[ />]")
_CHUNK = 1 << 20


def read_excel(source: Source, options: ReadOptions) -> tuple[Table, ...]:
    """Return a table for each sheet that holds rows of numbers.

    Raises
    ------
    LogError
        The file is no workbook, is damaged, unpacks to more than the limit, or has no sheet that
        reads as a log; or the library is not installed.
    """
    name = source.name
    n_formulas = 0
    if source.data.startswith(b"PK"):
        n_formulas = _check_archive(source, options)
    calamine = load_library("python_calamine", extra="excel", reads="Excel", name=name)
    with refusing_damage("Excel workbook", name=name):
        book = calamine.CalamineWorkbook.from_filelike(io.BytesIO(source.data))
        sheets = [
            (str(sheet), book.get_sheet_by_name(sheet).to_python(skip_empty_area=False))
            for sheet in book.sheet_names
        ]
    note = f"{n_formulas} cells hold formulas; their last saved values are read"
    tables: list[Table] = []
    refusals: list[str] = []
    for sheet, rows in sheets:
        part = replace(source, data=_as_text(rows).encode("utf-8", "replace"))
        try:
            found = read_delimited(part, options)
        except LogError as error:
            refusals.append(f"sheet {visible(sheet)}: {error}")
            continue
        said = [f"sheet: {visible(sheet)}"] * (len(sheets) > 1) + [note] * (n_formulas > 0)
        tables += [replace(table, notes=(*said, *table.notes)) for table in found]
    if not tables:
        raise LogError(refusals[0] if refusals else f"{name}: the workbook has no sheets")
    return tuple(tables)


def _check_archive(source: Source, options: ReadOptions) -> int:
    """Return how many cells hold formulas; refuse archives that are no workbook, or too large."""
    name = source.name
    import zipfile

    opened = zipfile.ZipFile
    with refusing_damage("ZIP archive", name=name), opened(io.BytesIO(source.data)) as archive:
        members = archive.infolist()
        if not any(member.filename.startswith("xl/workbook") for member in members):
            raise LogError(f"{name}: {_other_archive([member.filename for member in members])}")
        if len(members) > _MAX_MEMBERS:
            raise LogError(f"{name}: {len(members)} members, expected a workbook of few")
        claimed = sum(member.file_size for member in members)
        check_size(claimed, limit=options.max_bytes, what="the workbook", name=name)
        sheets = [m for m in members if m.filename.startswith("xl/worksheets/sheet")]
        return sum(_count_formulas(archive, member) for member in sheets)


def _other_archive(names: Sequence[str]) -> str:
    """Return what a ZIP archive is that is no workbook. No member is ever unpacked to disk."""
    if names and all(name.endswith(".npy") for name in names):
        return "this is a NumPy archive without units; write CSV or Parquet"
    if "content.xml" in names:
        return "this is an OpenDocument file; save the sheet as .xlsx or CSV"
    return "this is a ZIP archive; unpack it and give the logs in it"


def _count_formulas(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> int:
    """Count in pieces; what a piece cuts in two is found by keeping the end of the last one."""
    total, tail = 0, b""
    with archive.open(member) as file:
        while part := file.read(_CHUNK):
            text = tail + part
            ends = [found.end() for found in _FORMULA.finditer(text)]
            total += len(ends)
            tail = text[max([len(text) - 16, 0, *ends[-1:]]) :]
    return total


def _as_text(rows: Sequence[Sequence[Any]]) -> str:
    """Return rows as tab-separated lines; columns and rows that are empty throughout stay out."""
    filled = [i for i, column in enumerate(zip(*rows, strict=False)) if any(map(_field, column))]
    lines = []
    for row in rows:
        fields = [_field(row[i]) for i in filled if i < len(row)]
        said = [field for field in fields if field]
        is_entry = len(said) == 2 < len(filled) and said[0][:1].isalpha()
        lines.append(": ".join(said) if is_entry else "\t".join(fields if said else ()))
    return "".join(f"{line}\n" for line in lines)


def _field(cell: Any) -> str:
    if isinstance(cell, bool):
        return str(cell).lower()
    if isinstance(cell, int | float):
        return repr(cell)
    if isinstance(cell, dt.datetime | dt.date | dt.time):
        return cell.isoformat(" ") if isinstance(cell, dt.datetime) else cell.isoformat()
    if isinstance(cell, dt.timedelta):
        return repr(cell.total_seconds())
    return re.sub(r"\s+", " ", str(cell)).replace('"', "'").strip()
