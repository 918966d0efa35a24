"""What is wrong with a log and its missing setting are told in one run, not one after the other."""

from __future__ import annotations

import shutil

import pytest

EITHER = ". Nor does the log say its adjuster setting: give --setting N too"
COLUMNS = "Load (kX),Zt,Displacement\n0.0,1,2\n0.1,2,3\n0.2,1,3\n"
SHORT = "time_s,displacement_mm,force_N\n0.0,1,2\n0.1,2,3\n0.2,1,3\n"


@pytest.mark.parametrize("command", ["inspect", "identify"])
@pytest.mark.parametrize("text", [COLUMNS, SHORT])
def test_a_missing_setting_is_told_beside(run, tmp_path, command, text) -> None:
    # Used to be told in another run, once the columns were put right.
    (tmp_path / "bench.csv").write_text(text)
    told = run(command, "bench.csv")
    assert told.code == 3
    line = told.err.splitlines()[0]
    # A log is inspected without a setting, and then lacks none.
    assert line.endswith(EITHER) is (command == "identify")
    assert ("Nor does" in told.err) is (command == "identify")
    assert ("3 things are wrong" in line) is (text == COLUMNS)


@pytest.mark.parametrize("text", [COLUMNS, SHORT])
@pytest.mark.parametrize(
    ("name", "head", "more"),
    [
        ("bench.csv", "", ("--setting", "3")),
        ("bench_s3.csv", "", ()),
        ("bench.csv", "# setting: 3\n", ()),
        ("bench.csv", "", ("--rig", "part_settings=[3]")),
    ],
)
def test_a_setting_that_is_told_is_not_missed(run, tmp_path, text, name, head, more) -> None:
    (tmp_path / name).write_text(head + text)
    told = run("inspect", name, *more)
    assert told.code == 3
    assert "Nor does" not in told.err


def test_a_good_log_without_a_setting_lacks_that_alone(run, logs, tmp_path) -> None:
    lines = (logs / "setting_01.csv").read_text().splitlines(keepends=True)
    (tmp_path / "bench.csv").write_text("".join(x for x in lines if "setting" not in x))
    told = run("identify", "bench.csv")
    assert told.code == 3
    assert "bench.csv: the log does not say its adjuster setting" in told.err
    assert "Nor does" not in told.err


def test_an_unreadable_file_is_not_asked_for_its_setting(run, logs, tmp_path) -> None:
    (tmp_path / "bench.csv").write_text("")
    shutil.copy(logs / "setting_01.csv", tmp_path)
    told = run("inspect", "bench.csv", "setting_01.csv")
    assert told.err.strip() == "damperfit: bench.csv: empty file (0 bytes)"
