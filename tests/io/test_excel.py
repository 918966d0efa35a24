"""Workbooks: what a small file may be written out to, just inside the limit and just outside."""

from __future__ import annotations

import io
import subprocess
import sys
import zipfile
from xml.sax.saxutils import escape

import pytest

from damperfit.errors import LogError
from damperfit.io import ReadOptions, excel, read_logs

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


def refusal(path, limit: int) -> str:
    with pytest.raises(LogError) as caught:
        read_logs(path, ReadOptions(max_bytes=limit))
    message = str(caught.value)
    assert message.startswith("log_s3.xlsx: the workbook claims ")
    assert message.endswith(f"bytes, more than the limit of {limit} (rig.max_log_bytes)")
    return message


def test_text_counts_for_each_cell_that_names_it(tmp_path) -> None:
    remark = "x" * 1000
    path = put(tmp_path, log(*[remark] * 50))
    (recording,) = read_logs(path)
    assert list(recording.force) == list(range(50))
    # 51 rows of four cells; a text is counted with its marks, <si> is not.
    marks = len("<t></t></si>")
    names = sum(len(name) + marks for name in [*NAMES, "remarks"])
    last = len("</sst>")  # behind the last text
    claimed = excel._CELL * 51 * 4 + names + 50 * (1000 + marks + last)
    assert len(read_logs(path, ReadOptions(max_bytes=claimed))) == 1
    assert f"claims {claimed} bytes" in refusal(path, claimed - 1)


def test_the_longest_text_decides_whether_cells_are_looked_at() -> None:
    """One long text among short ones, named by each of fifty cells."""
    data = log(*["x" * 1000] * 50)
    with pytest.raises(LogError, match=r"claims \d{5} bytes, more than the limit of 50000"):
        excel._check_cells(data, 50_000)
    assert excel._check_cells(data, 60_000) == 0


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


@pytest.mark.skipif(sys.platform == "win32", reason="no peak of memory")
def test_one_long_text_named_by_many_cells_takes_no_memory(tmp_path) -> None:
    # 4 kB that took 5.9 GB and 45 s.
    cells = "<row>{}</row>".format('<c t="s"><v>0</v></c>' * 1000)
    data = workbook(cells * 50, ["x" * 30_000])
    assert len(data) < 6_000
    said, grown = peak_of(tmp_path, data, 500_000_000)
    assert "claims 15" in said
    assert "more than the limit of 500000000 (rig.max_log_bytes)" in said
    assert grown < 60_000_000


@pytest.mark.skipif(sys.platform == "win32", reason="no peak of memory")
def test_text_just_inside_the_limit_takes_a_few_times_the_limit(tmp_path) -> None:
    texts: list[str] = []
    rows = row(*NAMES, texts=texts)
    rows += "".join(row(i, i, i, texts=texts) for i in range(20))
    remarks = "<row>{}</row>".format(f'<c t="s"><v>{len(texts)}</v></c>' * 100) * 12
    data = workbook(rows, [*texts, "x" * 10_000], more=(remarks,))
    said, grown = peak_of(tmp_path, data, 12_600_000)
    assert said == ""
    assert grown < 10 * 12_600_000


ONE = "<v>1</v></c>"
FAR_APART = {
    "usual": f'<row r="1"><c r="A1">{ONE}</row><row r="1048576"><c r="XFD1048576">{ONE}</row>',
    "one row": f'<row><c r="A1">{ONE}<c r="XFD1048576">{ONE}</row>',
    "not all places said": f'<row><c r="XFC1">{ONE}<c>{ONE}</row><row r="1048575"/>'
    f"<row><c>{ONE}</row>",
    "odd marks": f"<row><c\n r = 'A1'>{ONE}</row><row\tr='1048576'>"
    f"<c s='1' r='xfd1048576'>{ONE}</row>",
}


@pytest.mark.parametrize("cells", FAR_APART.values(), ids=FAR_APART)
def test_two_cells_far_apart_are_counted_with_all_between(tmp_path, cells) -> None:
    # The library fills in 17 billion cells, and ends the process when they find no room.
    path = put(tmp_path, workbook(cells, []))
    assert f"claims {excel._CELL * 1_048_576 * 16_384} bytes" in refusal(path, 500_000_000)


def test_the_area_is_limited_by_its_cells(tmp_path) -> None:
    texts: list[str] = []
    rows = row(*NAMES, texts=texts)
    rows += "".join(row(i, i, i, texts=texts) for i in range(20))
    far = '<row r="40"><c r="AB40"><v>7</v></c></row>'
    path = put(tmp_path, workbook(rows, texts, more=(far,)))
    # "AB" is column 28; the sheet with the log has 21 rows of three.
    text = sum(len(name) + len("<t></t></si>") for name in NAMES) + len("</sst>")
    claimed = excel._CELL * (40 * 28 + 21 * 3) + text
    assert len(read_logs(path, ReadOptions(max_bytes=claimed))) == 1
    refusal(path, claimed - 1)


@pytest.mark.parametrize(
    "cell",
    [
        '<c t="s"><v>0</v></c>',
        "<c t='s'><v>0</v></c>",
        '<c s="1" t = "s" ><v xml:space="preserve"> 0 </v></c>',
        '<c t="s"><f>A1</f><v>0</v></c>',
        '<x:c t="s"><x:v>0</x:v></x:c>',
    ],
)
def test_no_way_of_writing_hides_a_text(tmp_path, cell) -> None:
    rows = f"<row>{cell * 100}</row>" * 10
    path = put(tmp_path, workbook(rows, ["x" * 30_000]))
    refusal(path, 20_000_000)


def test_what_is_counted_agrees_with_what_the_library_says(tmp_path) -> None:
    texts: list[str] = []
    rows = "".join(row(*["abc", "de", 1.5], texts=texts) for _ in range(9))
    data = workbook(rows, texts)
    answer = excel.sheets_in(data, 10_000)
    assert answer.parts == [b"abc\tde\t1.5\n" * 9]
    assert answer.said == {"sheets": ["s1"], "n_formulas": 0}
