"""Whatever a path names that is no file on disk: one sentence and code 2, nothing waited for."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from damperfit.io.files import MAX_TEXT, IrregularFileError, read_bytes, read_text
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
    "configuration": (".toml", ["inspect", SAMPLE, "--config"]),
    "list": (".txt", ["inspect"]),
    "table of tests": (".csv", ["inspect", SAMPLE, "--tests"]),
    "start table": (".parquet", ["identify", SAMPLE, "--start"]),
    "parameters": (".csv", ["simulate", "--setting", "1", "--parameters"]),
    "tolerance": (".csv", ["compare", SAMPLE, SAMPLE, "--tolerance"]),
}
RUN = """
import contextlib, io, json, sys
from damperfit.cli import main
for line in sys.stdin:
    err, out = io.StringIO(), io.StringIO()
    with contextlib.redirect_stderr(err), contextlib.redirect_stdout(out):
        code = main(json.loads(line))
    print(json.dumps([code, err.getvalue()]), flush=True)
"""


def ended(folder, commands) -> list[tuple[int, str]]:
    """Code and errors of each command, in one process that a deadline guards."""
    done = subprocess.run(
        [sys.executable, "-c", RUN], input="\n".join(json.dumps(one) for one in commands),
        cwd=folder, capture_output=True, text=True, timeout=100, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return [json.loads(line) for line in done.stdout.splitlines()]


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no FIFO")
def test_what_is_no_file_is_refused_at_once(tmp_path) -> None:
    commands = {}
    for name, (suffix, command) in COMMANDS.items():
        for kind, make in OBSTACLES.items():
            path = tmp_path / f"{name.replace(' ', '_')}_{kind}{suffix}"
            make(path)
            commands[path.name] = [*map(str, command), "@" * (name == "list") + path.name]
    for (file, command), (code, err) in zip(
        commands.items(), ended(tmp_path, commands.values()), strict=True
    ):
        assert (code, err.count("\n"), file in err) == (2, 1, True), (command, err)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no FIFO")
def test_a_results_folder_with_no_files_in_it_is_never_waited_for(tmp_path) -> None:
    commands = []
    for file in ("run.json", "parameters.parquet", "parameters.csv"):
        folder = tmp_path / file.replace(".", "_")
        make_results(folder, [1])
        (folder / file).unlink(missing_ok=True)
        os.mkfifo(folder / file)
        commands += [["report", folder.name], ["settings", folder.name]]
    for command, (code, err) in zip(commands, ended(tmp_path, commands), strict=True):
        assert code in {0, 1, 2}, (command, err)
        assert "Traceback" not in err


def test_bytes_up_to_a_limit_and_text_with_its_mark(tmp_path) -> None:
    path = tmp_path / "a"
    path.write_bytes(b"\xef\xbb\xbfabc")
    assert read_bytes(path, max_bytes=6) == b"\xef\xbb\xbfabc"
    assert read_text(path) == "abc"
    with pytest.raises(IrregularFileError, match="larger than"):
        read_bytes(path, max_bytes=5)
    with pytest.raises(IsADirectoryError):
        read_bytes(tmp_path)
