"""--log-file: everything that is said, and more, a line each with its time, appended."""

import re
import shutil
from pathlib import Path

import pytest

LINE = re.compile(
    r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}[+-]\d\d:\d\d (DEBUG|INFO|WARNING|ERROR) +"
    r"damperfit\[\d+\] (.+)"
)


def records(path):
    """Level and text of each record; a line of another form fails."""
    found = [LINE.fullmatch(line) for line in path.read_text(encoding="utf-8").splitlines()]
    assert all(found)
    return [(one[1], one[2]) for one in found]


def test_it_holds_what_was_said_and_what_was_done(run, logs, tmp_path) -> None:
    log, kept = logs / "setting_01.csv", tmp_path / "run.log"
    ended = run("identify", log, "nope_02.csv", "--procedure", "plain", "--log-file", kept)
    assert ended.code == 1
    told = records(kept)
    texts = [text for _, text in told]
    assert texts[0] == f"$ damperfit identify {log} nope_02.csv --procedure plain --log-file {kept}"
    for line in (ended.err + ended.out).splitlines():
        assert not line.strip() or line in texts
    assert ("ERROR", "damperfit: nope_02.csv: no such file") in told
    debug = "\n".join(text for level, text in told if level == "DEBUG")
    assert re.search(rf"{log}: \w+, setting 1, \d+ samples, \S+ s, sha256 \w{{64}}", debug)
    assert re.search(r"setting 1: MSE \S+ %, converged, \d+ evaluations", debug)
    assert re.search(r"fit took \S+ s", debug)
    assert re.search(r"written to \S*results: .*run.json", debug)
    assert re.fullmatch(r"ended with code 1 after \S+ s", texts[-1])


def test_it_is_appended_to_and_holds_usage_errors(run, tmp_path) -> None:
    kept = tmp_path / "run.log"
    assert run("config", "--quiet", "--log-file", kept).code == 0
    before = kept.read_bytes()
    assert run("inspect", "nope.csv", f"--log-file={kept}").code == 2
    assert run("identify", "--log-file", kept, "--frree", "k_e").code == 2
    assert kept.read_bytes().startswith(before)
    told = records(kept)
    assert ("ERROR", "damperfit: nope.csv: no such file") in told
    assert any(level == "ERROR" and "No such option: --frree" in text for level, text in told)
    ends = [text[16:18].strip() for _, text in told if text.startswith("ended with code")]
    assert ends == ["0", "2", "2"]


def test_a_bug_leaves_its_traceback_there_and_a_line_on_the_terminal(
    run, tmp_path, monkeypatch
) -> None:
    def broken(*_, **__):
        raise ZeroDivisionError("by\x1b nothing")

    monkeypatch.setattr("damperfit.configuration.loading.load_configuration", broken)
    kept = tmp_path / "run.log"
    ended = run("config", "--log-file", kept, "-v")
    assert ended.code == 70
    assert "Traceback" not in ended.err
    told = records(kept)
    assert ("DEBUG", "Traceback (most recent call last):") in told
    assert any(level == "DEBUG" and "test_log_file.py" in text for level, text in told)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no full device")
def test_a_full_disk_ends_no_command(run, logs) -> None:
    ended = run("inspect", logs / "setting_01.csv", "--log-file", "/dev/full")
    assert (ended.code, ended.err) == (0, "")


@pytest.mark.parametrize("text", [None, "hello\n", "2026-01-01T10:00:00 INFO other[1] a\n", " "])
def test_a_file_that_holds_anything_else_is_left_alone(run, logs, tmp_path, text) -> None:
    kept = tmp_path / "log.csv"
    if text is None:
        shutil.copy(logs / "setting_01.csv", kept)
    else:
        kept.write_text(text)
    before = kept.read_bytes()
    ended = run("inspect", logs / "setting_02.csv", "--log-file", kept)
    assert (ended.code, ended.err.count("\n")) == (2, 1)
    assert f"--log-file {kept}: is there already and does not begin as a log file" in ended.err
    assert kept.read_bytes() == before


def test_verbose_shows_the_steps_on_stderr(run, logs, tmp_path) -> None:
    """What only the log file has otherwise; what people are told stands there once."""
    log = str(logs / "setting_02.csv")
    quiet, verbose = (run("inspect", log, *more) for more in ((), ("-v",)))
    assert verbose.out == quiet.out
    steps = [line for line in verbose.err.splitlines() if line not in quiet.err.splitlines()]
    assert [log in line and "samples" in line for line in steps] == [True]
    assert run("inspect", log).err == quiet.err  # the next command is as quiet as before
