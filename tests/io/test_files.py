"""Whatever a path names that is no file on disk: one sentence and code 2, nothing waited for."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from damperfit.io.files import MAX_TEXT, IrregularFileError, read_bytes, read_text
from tests.report_folder import make_results

pytestmark = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no FIFO")
SAMPLE = Path(__file__).parents[2] / "sample_runs" / "setting_10.csv"


def pipe(path: Path) -> None:
    os.mkfifo(path)


def device(path: Path) -> None:
    path.symlink_to("/dev/zero")


def huge(path: Path) -> None:
    with path.open("wb") as file:
        file.truncate(20 * MAX_TEXT)  # a hole on the disk


def latin(path: Path) -> None:
    path.write_bytes(b"\xff\xfenot text\n")


# What a user may name beside logs: the file, and the command that reads it.
COMMANDS = {
    "configuration": ("x.toml", ["inspect", SAMPLE, "--config", "x.toml"]),
    "list": ("x.txt", ["inspect", "@x.txt"]),
    "table of tests": ("x.csv", ["inspect", SAMPLE, "--tests", "x.csv"]),
    "start table": ("x.parquet", ["identify", SAMPLE, "--start", "x.parquet"]),
    "parameters": ("x.csv", ["simulate", "--setting", "1", "--parameters", "x.csv"]),
    "tolerance": ("x.csv", ["compare", SAMPLE, SAMPLE, "--tolerance", "x.csv"]),
}


@pytest.mark.parametrize("obstacle", [pipe, device, huge, latin])
@pytest.mark.parametrize("name", COMMANDS)
def test_what_is_no_file_is_refused_at_once(tmp_path, name, obstacle) -> None:
    file, command = COMMANDS[name]
    obstacle(tmp_path / file)
    done = subprocess.run(
        [sys.executable, "-m", "damperfit", *map(str, command)],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 2, done.stderr
    assert done.stderr.count("\n") == 1
    assert file in done.stderr


@pytest.mark.parametrize("file", ["run.json", "parameters.parquet", "parameters.csv"])
def test_a_results_folder_with_no_files_in_it_is_never_waited_for(tmp_path, file) -> None:
    make_results(tmp_path / "results", [1])
    (tmp_path / "results" / file).unlink(missing_ok=True)
    pipe(tmp_path / "results" / file)
    for command in ("report", "settings"):
        done = subprocess.run(
            [sys.executable, "-m", "damperfit", command, "results"],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            timeout=60,
            check=False,
        )
        assert done.returncode in {0, 1, 2}, done.stderr
        assert "Traceback" not in done.stderr


def test_bytes_up_to_a_limit_and_text_with_its_mark(tmp_path) -> None:
    path = tmp_path / "a"
    path.write_bytes(b"\xef\xbb\xbfabc")
    assert read_bytes(path, max_bytes=6) == b"\xef\xbb\xbfabc"
    assert read_text(path) == "abc"
    with pytest.raises(IrregularFileError, match="larger than"):
        read_bytes(path, max_bytes=5)
    with pytest.raises(IsADirectoryError):
        read_bytes(tmp_path)
