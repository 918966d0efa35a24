"""Workbooks: what a small file may be written out to, just inside the limit and just outside."""

from __future__ import annotations

import io
import subprocess
import sys
import zipfile
from xml.sax.saxutils import escape

import pytest

from damperfit.io import foreign

pytest.importorskip("python_calamine")

MAIN = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
OFFICE = "http://schemas.openxmlformats.org/officeDocument/2006/relationships"
PACKAGE = "http://schemas.openxmlformats.org/package/2006/relationships"
NAMES = ["time_s", "displacement_mm", "force_N"]


def workbook(rows: str, texts: list[str], *, more: tuple[str, ...] = ()) -> bytes:
    """A workbook of sheets of raw XML rows, and its shared texts."""
    sheets = (rows, *more)
    ids = range(1, len(sheets) + 1)
    relation = '<Relationship Id="r{0}" Type="{1}/{2}" Target="{3}"/>'
    relations = "".join(
        relation.format(i, OFFICE, "worksheet", f"worksheets/sheet{i}.xml") for i in ids
    )
    relations += relation.format(0, OFFICE, "sharedStrings", "sharedStrings.xml")
    listed = "".join(f'<sheet name="s{i}" sheetId="{i}" r:id="r{i}"/>' for i in ids)
    to_book = relation.format(1, OFFICE, "officeDocument", "xl/workbook.xml")
    shared = "".join(f"<si><t>{escape(text)}</t></si>" for text in texts)
    members = {
        "_rels/.rels": f'<Relationships xmlns="{PACKAGE}">{to_book}</Relationships>',
        "xl/workbook.xml": f'<workbook xmlns="{MAIN}" xmlns:r="{OFFICE}"><sheets>{listed}</sheets>'
        "</workbook>",
        "xl/_rels/workbook.xml.rels": f'<Relationships xmlns="{PACKAGE}">{relations}'
        "</Relationships>",
        "xl/sharedStrings.xml": f'<sst xmlns="{MAIN}">{shared}</sst>',
    }
    for i, sheet in zip(ids, sheets, strict=True):
        members[f"xl/worksheets/sheet{i}.xml"] = (
            f'<worksheet xmlns="{MAIN}"><sheetData>{sheet}</sheetData></worksheet>'
        )
    sink = io.BytesIO()
    with zipfile.ZipFile(sink, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return sink.getvalue()


def row(*values: float | str, place: str = "", texts: list[str] | None = None) -> str:
    """One row; texts are named by their number in the list, and put there."""
    texts = [] if texts is None else texts
    cells = []
    for value in values:
        if isinstance(value, str):
            if value not in texts:
                texts.append(value)
            cells.append(f'<c t="s"><v>{texts.index(value)}</v></c>')
        else:
            cells.append(f"<c><v>{value}</v></c>")
    return f"<row{place}>{''.join(cells)}</row>"


def log(*remarks: str) -> bytes:
    texts: list[str] = []
    rows = row(*NAMES, "remarks", texts=texts)
    rows += "".join(row(i, i, i, remark, texts=texts) for i, remark in enumerate(remarks))
    return workbook(rows, texts)


def put(tmp_path, data: bytes):
    path = tmp_path / "log_s3.xlsx"
    path.write_bytes(data)
    return path


_MEASURE = """
import resource, sys
from damperfit.errors import LogError
from damperfit.io import ReadOptions, child_process, read_logs
read_logs(sys.argv[1])
def peak():
    child_process._CHILDREN.end()
    who = (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    return max(resource.getrusage(one).ru_maxrss for one in who)
before = peak()
try:
    read_logs(sys.argv[2], ReadOptions(max_bytes=int(sys.argv[3])))
except LogError as error:
    print(error)
print((peak() - before) * (1 if sys.platform == "darwin" else 1024))
"""


def peak_of(tmp_path, data: bytes, limit: int) -> tuple[str, int]:
    """What is said, and the bytes more than a small workbook takes, of parent or child."""
    small = tmp_path / "small_s1.xlsx"
    small.write_bytes(log("a", "b", "c"))
    done = subprocess.run(
        [sys.executable, "-c", _MEASURE, small, put(tmp_path, data), str(limit)],
        capture_output=True,
        text=True,
        check=True,
        timeout=300,
    )
    *said, grown = done.stdout.splitlines()
    return "\n".join(said), int(grown)


MANY = "<row>{}</row>".format('<c t="s"><v>0</v></c>' * 1000) * 50
ONE = "<v>1</v></c>"
BOMBS = {
    "one long text in many cells": MANY,
    "far apart": f'<row r="1"><c r="A1">{ONE}</row><row r="1048576"><c r="XFD1048576">{ONE}</row>',
    "one row": f'<row><c r="A1">{ONE}<c r="XFD1048576">{ONE}</row>',
    "not all places said": f'<row><c r="XFC1">{ONE}<c>{ONE}</row><row r="1048575"/>'
    f"<row><c>{ONE}</row>",
}


@pytest.mark.skipif(sys.platform != "linux", reason="memory is limited there alone")
@pytest.mark.parametrize("cells", BOMBS.values(), ids=BOMBS)
def test_a_small_workbook_takes_little_memory(tmp_path, cells) -> None:
    # 4 kB that took 5.9 GB and 45 s.
    data = workbook(cells, ["x" * 30_000])
    assert len(data) < 6_000
    said, grown = peak_of(tmp_path, data, 500_000_000)
    assert "rig.max_log_bytes" in said
    assert grown < 450_000_000


def test_sheets_are_written_out_as_text(tmp_path) -> None:
    texts: list[str] = []
    rows = "".join(row(*["abc", "de", 1.5], texts=texts) for _ in range(9))
    data = workbook(rows, texts)
    answer = foreign.sheets_in(data, 10_000)
    assert answer.parts == [b"abc\tde\t1.5\n" * 9]
    assert answer.said == {"sheets": ["s1"], "n_formulas": 0}
