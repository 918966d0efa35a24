"""Excel workbooks, through python-calamine: the values as last saved, sheet by sheet.

The format: a ZIP archive of XML (ECMA-376), or before 2007 a compound file. Text stands once, and
cells name it by its number.

Traps. A kilobyte of the archive may unpack to gigabytes: what its directory says is checked first.
4 kB may hold one long text and 50 000 cells that name it, or two cells at two ends of a sheet,
between which the library fills in billions: so it runs in a process of its own, whose memory is
limited by the size of the file. A formula that was never computed has no value, so formulas are
counted and noted. Nothing is ever computed: formulas give the value they had, macros and links are
not looked at. Each sheet is written out as text and then read like any text log, so names, units
rows and wall-clock times are understood alike; a line number in a message is the row of the sheet.
"""

from __future__ import annotations

import datetime as dt
import importlib
import io
import re
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from damperfit.errors import LogError
from damperfit.io.channels import visible
from damperfit.io.child_process import (
    ChildAnswer,
    ChildReader,
    ask_child,
    check_size,
    refusing_damage,
)
from damperfit.io.files import Source
from damperfit.io.formats import Table
from damperfit.io.options import ReadOptions
from damperfit.io.text import read_delimited

__all__ = ["read_excel"]

_CHILD = ChildReader(  # the library is written in Rust
    "Excel", "excel", "python_calamine", f"{__name__}:sheets_in", is_memory_safe=True
)
_MAX_MEMBERS = 10_000
_FORMULA = re.compile(rb"<(?:\w+:)?f[ />]")


def read_excel(source: Source, options: ReadOptions) -> tuple[Table, ...]:
    """Return a table for each sheet that holds rows of numbers.

    Raises
    ------
    LogError
        The file is no workbook, is damaged, unpacks to more than the limit, or has no sheet that
        reads as a log; or the library is not installed.
    """
    if source.data.startswith(b"PK"):
        _check_archive(source, options)
    answer = ask_child(_CHILD, source, options)
    n_formulas = answer.said["n_formulas"]
    note = f"{n_formulas} cells hold formulas; their last saved values are read"
    tables: list[Table] = []
    refusals: list[str] = []
    for sheet, text in zip(answer.said["sheets"], answer.parts, strict=True):
        notes = [f"sheet: {visible(sheet)}"] * (len(answer.parts) > 1) + [note] * (n_formulas > 0)
        try:
            read = read_delimited(replace(source, data=text), options)
        except LogError as error:
            refusals.append(f"sheet {visible(sheet)}: {error}")
            continue
        tables += [replace(table, notes=(*notes, *table.notes)) for table in read]
    if not tables:
        raise LogError(refusals[0] if refusals else f"{source.name}: the workbook has no sheets")
    return tuple(tables)


def _check_archive(source: Source, options: ReadOptions) -> None:
    """Refuse archives that are no workbook, or too large; no member is unpacked."""
    import zipfile

    name = source.name
    with (
        refusing_damage("ZIP archive", name=name),
        zipfile.ZipFile(io.BytesIO(source.data)) as archive,
    ):
        members = archive.infolist()
    names = [member.filename for member in members]
    if not any(member.startswith("xl/workbook") for member in names):
        what = "this is a ZIP archive; unpack it and give the logs in it"
        if names and all(member.endswith(".npy") for member in names):
            what = "this is a NumPy archive without units; write CSV or Parquet"
        elif "content.xml" in names:
            what = "this is an OpenDocument file; save the sheet as .xlsx or CSV"
        raise LogError(what, subject=name)
    if len(members) > _MAX_MEMBERS:
        raise LogError(f"{len(members)} members, expected a workbook of few", subject=name)
    claimed = sum(member.file_size for member in members)
    check_size(claimed, limit=options.max_bytes, what="the workbook", name=name)


def sheets_in(data: bytes, limit: int) -> ChildAnswer:
    """Return the sheets of a workbook as text; runs in a process of its own.

    Raises
    ------
    LogError
        The file is damaged, or would be written out to more than the limit.
    """
    calamine = importlib.import_module("python_calamine")
    with refusing_damage("Excel workbook"):
        n_formulas = _count_formulas(data) if data.startswith(b"PK") else 0
        book = calamine.CalamineWorkbook.from_filelike(io.BytesIO(data))
        names = [str(name) for name in book.sheet_names]
        sheets = []
        for name in names:
            rows = book.get_sheet_by_name(name).to_python(skip_empty_area=False)
            sheets.append(_as_text(rows).encode("utf-8", "replace"))
            check_size(sum(map(len, sheets)), limit=limit, what="the workbook")
    return ChildAnswer({"sheets": names, "n_formulas": n_formulas}, sheets)


def _count_formulas(data: bytes) -> int:
    """Return how many cells hold formulas, in members that hold sheets, whatever their names."""
    import zipfile

    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        contents = map(archive.read, archive.infolist())
        return sum(len(_FORMULA.findall(one)) for one in contents if b"sheetData" in one)


def _as_text(rows: Sequence[Sequence[Any]]) -> str:
    """Return rows as tab-separated lines; columns and rows that are empty throughout stay out."""
    filled = [i for i, column in enumerate(zip(*rows, strict=False)) if any(map(_field, column))]
    lines = []
    for row in rows:
        fields = [_field(row[i]) for i in filled if i < len(row)]
        texts = [field for field in fields if field]
        is_entry = len(texts) == 2 < len(filled) and texts[0][:1].isalpha()
        lines.append(": ".join(texts) if is_entry else "\t".join(fields if texts else ()))
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
