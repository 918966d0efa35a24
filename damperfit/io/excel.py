"""Excel workbooks, through python-calamine: the values as last saved, sheet by sheet.

The format: a ZIP archive of XML (ECMA-376), or before 2007 a compound file. Text stands once, and
cells name it by its number.

Traps. A kilobyte of the archive may unpack to gigabytes: what its directory says is checked first.
4 kB may hold one long text and 50 000 cells that name it, which take gigabytes; or two cells at two
ends of a sheet, between which the library fills in billions: so cells are counted, and their text,
before the library sees them, and it runs in a process of its own. A formula that was never computed
has no value, so formulas are counted and noted. Nothing is ever computed: formulas give the value
they had, macros and links are not looked at. Each sheet is written out as text and then read like
any text log, so names, units rows and wall-clock times are understood alike; a line number in a
message is the row of the sheet.
"""

from __future__ import annotations

import datetime as dt
import importlib
import io
import re
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from damperfit.errors import LogError
from damperfit.io.channels import visible
from damperfit.io.child_process import (
    ChildAnswer,
    ChildReader,
    ask_child,
    check_size,
    refusing_damage,
)
from damperfit.io.text import read_delimited

if TYPE_CHECKING:
    from collections.abc import Sequence

    from damperfit.io.files import Source
    from damperfit.io.formats import Table
    from damperfit.io.options import ReadOptions

__all__ = ["read_excel"]

_CHILD = ChildReader(  # the library is written in Rust
    "Excel", "excel", "python_calamine", f"{__name__}:sheets_in", is_memory_safe=True
)

_MAX_MEMBERS = 10_000
_CELL = 32  # bytes that the library keeps for a cell, filled or not
_FORMULA = re.compile(rb"<(?:\w+:)?f[ />]")
_SHARED = re.compile(rb"<(?:\w+:)?si[ />]")  # where a text begins that cells may name
# Where nearly all programs say a cell's place.
_PLAIN_PLACE = re.compile(rb'<c r="([A-Z]{1,3})(\d{1,7})"')
# Beginning of a row or cell, with its place where it says one.
_PLACE = re.compile(
    rb"<(?:\w+:)?(?:(row)|c)\b(?:[^>]*?\br\s*=\s*[\"']([A-Za-z]{0,9})(\d{1,12})[\"'])?"
)
_IS_SHARED = re.compile(rb"\bt\s*=\s*[\"']s[\"']")
_NAMED = re.compile(
    rb"<(?:\w+:)?c\s[^>]*?\bt\s*=\s*[\"']s[\"'][^>]*>\s*<(?:\w+:)?v[^>]*>\s*(\d{1,9})\s*<"
)


def read_excel(source: Source, options: ReadOptions) -> tuple[Table, ...]:
    """Return a table for each sheet that holds rows of numbers.

    Raises
    ------
    LogError
        The file is no workbook, is damaged, unpacks to more than the limit, or has no sheet that
        reads as a log; or the library is not installed.
    """
    name = source.name
    if source.data.startswith(b"PK"):
        _check_archive(source, options)
    found = ask_child(_CHILD, source, options)
    n_formulas = found.said["n_formulas"]
    note = f"{n_formulas} cells hold formulas; their last saved values are read"
    tables: list[Table] = []
    refusals: list[str] = []
    for sheet, text in zip(found.said["sheets"], found.parts, strict=True):
        try:
            read = read_delimited(replace(source, data=text), options)
        except LogError as error:
            refusals.append(f"sheet {visible(sheet)}: {error}")
            continue
        said = [f"sheet: {visible(sheet)}"] * (len(found.parts) > 1) + [note] * (n_formulas > 0)
        tables += [replace(table, notes=(*said, *table.notes)) for table in read]
    if not tables:
        raise LogError(refusals[0] if refusals else f"{name}: the workbook has no sheets")
    return tuple(tables)


def sheets_in(data: bytes, limit: int) -> ChildAnswer:
    """Return the sheets of a workbook as text; runs in a process of its own.

    Raises
    ------
    LogError
        The file is damaged, or would be written out to more than the limit.
    """
    calamine = importlib.import_module("python_calamine")
    with refusing_damage("Excel workbook"):
        n_formulas = _check_cells(data, limit) if data.startswith(b"PK") else 0
        book = calamine.CalamineWorkbook.from_filelike(io.BytesIO(data))
        names = [str(name) for name in book.sheet_names]
        sheets = []
        for name in names:
            rows = book.get_sheet_by_name(name).to_python(skip_empty_area=False)
            sheets.append(_as_text(rows).encode("utf-8", "replace"))
            check_size(sum(map(len, sheets)), limit=limit, what="the workbook")
    return ChildAnswer({"sheets": names, "n_formulas": n_formulas}, sheets)


def _check_archive(source: Source, options: ReadOptions) -> None:
    """Refuse archives that are no workbook, or too large."""
    name = source.name
    import zipfile

    opened = zipfile.ZipFile
    with refusing_damage("ZIP archive", name=name), opened(io.BytesIO(source.data)) as archive:
        members = archive.infolist()
        if not any(member.filename.startswith("xl/workbook") for member in members):
            raise LogError(
                f"{_other_archive([member.filename for member in members])}", subject=name
            )
        if len(members) > _MAX_MEMBERS:
            raise LogError(f"{len(members)} members, expected a workbook of few", subject=name)
        claimed = sum(member.file_size for member in members)
        check_size(claimed, limit=options.max_bytes, what="the workbook", name=name)


def _other_archive(names: Sequence[str]) -> str:
    """Return what a ZIP archive is that is no workbook. No member is ever unpacked to disk."""
    if names and all(name.endswith(".npy") for name in names):
        return "this is a NumPy archive without units; write CSV or Parquet"
    if "content.xml" in names:
        return "this is an OpenDocument file; save the sheet as .xlsx or CSV"
    return "this is a ZIP archive; unpack it and give the logs in it"


def _check_cells(data: bytes, limit: int) -> int:
    """Return how many cells hold formulas; refuse what would be written out to too much.

    Any member may hold sheets or texts, as their names are free; content tells.
    """
    import zipfile

    lengths: list[int] = []
    sheets = []
    claimed = n_formulas = n_marks = 0
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        for member in archive.infolist():
            content = archive.read(member)
            if b"<sst" in content or b":sst" in content:
                lengths += [len(text) for text in _SHARED.split(content)[1:]]
            elif b"sheetData" in content:
                sheets.append(member)
                claimed += _CELL * _area(content)
                n_formulas += sum(1 for _ in _FORMULA.finditer(content))
                n_marks += content.count(b'"s"') + content.count(b"'s'")
        # Which text each cell names is looked at only where the longest for all is too much.
        if claimed + n_marks * max(lengths, default=0) > limit:
            claimed += sum(_named_text(archive.read(sheet), lengths) for sheet in sheets)
    check_size(claimed, limit=limit, what="the workbook")
    return n_formulas


def _area(sheet: bytes) -> int:
    """Return how many cells there are from the first to the last, filled or not."""
    plain = _PLAIN_PLACE.findall(sheet)
    inside = sheet[sheet.find(b"sheetData") :]
    inside = inside[: inside.find(b"/sheetData")]
    if len(plain) == inside.count(b"<c") and b":c" not in inside and b":row" not in inside:
        if not plain:
            return 0
        width = max(map(_column, {letters for letters, _ in plain}))
        return width * max(map(int, {number for _, number in plain}))
    # A row or cell that does not say its place stands behind the one before.
    row = column = width = height = 0
    for is_row, letters, number in _PLACE.findall(sheet):
        if is_row:
            row, column = int(number or row + 1), 0
        else:
            row = int(number or row)
            column = _column(letters) if letters else column + 1
        width, height = max(width, column), max(height, row)
    return width * height


def _named_text(sheet: bytes, lengths: Sequence[int]) -> int:
    """Return the bytes of text in the cells that name one by its number."""
    named = [int(number) for number in _NAMED.findall(sheet)]
    n_all = sum(1 for _ in _IS_SHARED.finditer(sheet))
    # What is written in a way that is not understood here may name the longest.
    n_others = max(n_all - len(named), 0)
    known = sum(lengths[number] for number in named if number < len(lengths))
    return known + n_others * max(lengths, default=0)


def _column(letters: bytes) -> int:
    """Return the number of a column from 1: AB is 28."""
    number = 0
    for letter in letters.upper():
        number = 26 * number + letter - 64
    return number


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
