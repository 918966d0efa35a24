"""Whatever a path names that is no file on disk: one sentence and code 2, nothing waited for."""

import io
import os
import signal
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from damperfit.cli import main
from damperfit.errors import LogError
from damperfit.io.files import MAX_TEXT, read_source
from tests.report_folder import make_results

SAMPLE = Path(__file__).parents[2] / "sample_runs" / "setting_10.csv"
OBSTACLES = {
    "pipe": os.mkfifo if hasattr(os, "mkfifo") else None,
    "device": lambda path: path.symlink_to("/dev/zero"),
    "huge": lambda path: path.touch() or os.truncate(path, 20 * MAX_TEXT),  # a hole on the disk
    "latin": lambda path: path.write_bytes(b"\xff\xfenot text\n"),
}
# What a user may name beside logs: the file, and the command that reads it.
COMMANDS = {
    "configuration.toml": "config --config",
    "list.txt": "inspect",
    "table.csv": f"inspect {SAMPLE} --tests",
    "start.parquet": f"inspect {SAMPLE} --start",
    "parameters.csv": "simulate --setting 1 --parameters",
    "tolerance.csv": f"compare {SAMPLE} {SAMPLE} --tolerance",
}


@pytest.fixture
def ended(tmp_path, monkeypatch, capsys):
    """Code and errors of a command, which a deadline guards."""
    monkeypatch.chdir(tmp_path)

    def late(*_):
        raise AssertionError("it waits")

    def run(*words) -> tuple[int, str]:
        kept = signal.signal(signal.SIGALRM, late)
        signal.alarm(60)
        try:
            code = main([str(word) for word in words])
        finally:
            signal.alarm(0)
            signal.signal(signal.SIGALRM, kept)
        return code, capsys.readouterr().err

    return run


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no FIFO")
@pytest.mark.parametrize("name", COMMANDS)
def test_what_is_no_file_is_refused_at_once(ended, tmp_path, name) -> None:
    for kind, make in OBSTACLES.items():
        file = f"{kind}_{name}"
        make(tmp_path / file)
        words = [*COMMANDS[name].split(), "@" * name.startswith("list") + file]
        if "--start" in words:
            words[0] = "identify"
        code, err = ended(*words)
        assert (code, err.count("\n"), file in err) == (2, 1, True), (words, err)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no FIFO")
@pytest.mark.parametrize("file", ["run.json", "parameters.parquet", "parameters.csv"])
def test_a_results_folder_with_no_files_in_it_is_never_waited_for(ended, tmp_path, file) -> None:
    folder = make_results(tmp_path / "results", [1])
    (folder / file).unlink(missing_ok=True)
    os.mkfifo(folder / file)
    for command in ("report", "settings"):
        assert ended(command, folder)[0] in {0, 1, 2}


def test_of_a_log_above_the_limit_nothing_is_read(tmp_path, monkeypatch) -> None:
    path = tmp_path / "a.csv"
    path.write_bytes(b"time_s,force_N\n")
    monkeypatch.setattr("damperfit.io.files._read_up_to", None)
    with pytest.raises(LogError, match="15 bytes, more than the limit of 14"):
        read_source(path, max_bytes=14)


# Workbooks: what a small file may be written out to takes little memory.

MAIN = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
OFFICE = "http://schemas.openxmlformats.org/officeDocument/2006/relationships"
PACKAGE = "http://schemas.openxmlformats.org/package/2006/relationships"
RELATION = '<Relationship Id="r{0}" Type="' + OFFICE + '/{1}" Target="{2}"/>'


def workbook(rows: str, text: str) -> bytes:
    """A workbook of one sheet of raw XML rows, and one text that cells name by its number."""
    members = {
        "_rels/.rels": RELATION.format(1, "officeDocument", "xl/workbook.xml"),
        "xl/_rels/workbook.xml.rels": RELATION.format(1, "worksheet", "worksheets/sheet1.xml")
        + RELATION.format(0, "sharedStrings", "sharedStrings.xml"),
        "xl/workbook.xml": f'<workbook xmlns="{MAIN}" xmlns:r="{OFFICE}"><sheets>'
        '<sheet name="s1" sheetId="1" r:id="r1"/></sheets></workbook>',
        "xl/sharedStrings.xml": f'<sst xmlns="{MAIN}"><si><t>{text}</t></si></sst>',
        "xl/worksheets/sheet1.xml": f'<worksheet xmlns="{MAIN}"><sheetData>{rows}</sheetData>'
        "</worksheet>",
    }
    sink = io.BytesIO()
    with zipfile.ZipFile(sink, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        for name, content in members.items():
            is_list = name.endswith(".rels")
            whole = f'<Relationships xmlns="{PACKAGE}">{content}</Relationships>'
            archive.writestr(name, whole if is_list else content)
    return sink.getvalue()


def row(*cells: str) -> str:
    return f"<row>{''.join(f'<c{cell}</c>' for cell in cells)}</row>"


NUMBERS = "".join(row(*(f"><v>{i}</v>" for _ in range(3))) for i in range(3))
NAMES = row(*(f' t="inlineStr"><is><t>{one}</t></is>' for one in ("time_s", "x_mm", "force_N")))
MEASURE = """
import resource, sys
from damperfit.errors import LogError
from damperfit.io import ReadOptions, child_process, read_logs
read_logs(sys.argv[1])
def peak():
    child_process._CHILDREN.end()
    who = (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    return max(resource.getrusage(one).ru_maxrss for one in who)
before = peak()
for bomb in sys.argv[2:]:
    try:
        read_logs(bomb, ReadOptions(max_bytes=500_000_000))
        print("read")
    except LogError as error:
        print(error)
print((peak() - before) * 1024)
"""
ONE = "><v>1</v>"
BOMBS = {
    "one long text in many cells": row(*[' t="s"><v>0</v>'] * 1000) * 50,
    "not all places said": row(f' r="XFC1"{ONE}', ONE) + f'<row r="1048575"/>{row(ONE)}',
    "far apart": f'<row r="1"><c r="A1"{ONE}</c></row>'
    f'<row r="1048576"><c r="XFD1048576"{ONE}</c></row>',
    "one row": row(f' r="A1"{ONE}', f' r="XFD1048576"{ONE}'),
}


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="memory is limited there alone")
def test_a_small_workbook_takes_little_memory(tmp_path) -> None:
    pytest.importorskip("python_calamine")
    # 4 kB that took 5.9 GB and 45 s.
    small = tmp_path / "small_s1.xlsx"
    small.write_bytes(workbook(NAMES + NUMBERS, ""))
    bombs = []
    for k, cells in enumerate(BOMBS.values()):
        bombs.append(tmp_path / f"log_s{k}.xlsx")
        bombs[-1].write_bytes(workbook(cells, "x" * 30_000))
        assert bombs[-1].stat().st_size < 6_000
    done = subprocess.run(
        [sys.executable, "-c", MEASURE, small, *bombs],
        capture_output=True,
        text=True,
        check=True,
        timeout=300,
    )
    *refused, grown = done.stdout.splitlines()
    assert ["rig.max_log_bytes" in line for line in refused] == [True] * len(BOMBS)
    assert int(grown) < 450_000_000
