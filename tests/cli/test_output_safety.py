"""Results stay whole whatever happens to the run or its folder; what a log says stays text."""

import csv
import json
import os
import shutil
import signal
import warnings
from pathlib import Path

import pytest

from damperfit.cli import main
from damperfit.results import Run
from damperfit.run import identify

QUICK = (
    *("--procedure", "plain", "--free", "r_m1,r_m2,k_e"),
    *("--fix", "r_m3=2.6e6", "--fix", "f_f=50N"),
)


def _contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}


def _killed_at(rename: int, log: Path) -> None:
    """Let a copy of this process end as a power cut would, at a rename; with 0 before the first."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # of threads: none of ours is at work
        child = os.fork()
    if child == 0:
        left = [rename]

        def counted(call):
            def call_or_die(source, target):
                if left[0] == 0:
                    os.kill(os.getpid(), signal.SIGKILL)
                left[0] -= 1
                call(source, target)

            return call_or_die

        os.rename, os.replace = counted(os.rename), counted(os.replace)
        main(["identify", str(log), *QUICK, "--quiet"])
        os._exit(1)
    _, status = os.waitpid(child, 0)
    assert os.waitstatus_to_exitcode(status) == -signal.SIGKILL


@pytest.fixture(scope="module")
def results(logs, tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("first") / "results"
    code = main(["identify", str(logs / "setting_01.csv"), *QUICK, "--quiet", "--out", str(folder)])
    assert code == 0
    return folder


@pytest.mark.skipif(os.name != "posix", reason="needs SIGKILL")
def test_what_a_killed_run_half_wrote_is_ended_by_whoever_comes_next(
    run, logs, results, tmp_path
) -> None:
    folder = tmp_path / "results"
    shutil.copytree(results, folder)
    before = _contents(folder)
    _killed_at(4, logs / "setting_02.csv")
    between = _contents(folder)
    assert sum(between[name] != before[name] for name in before) == 3
    ended = run("report", "results")
    assert ended.code == 0, ended.err
    assert "is not the file that the run wrote" not in ended.err
    assert json.loads((folder / "run.json").read_text())["inputs"][0]["log"] == "setting_02.csv"
    assert _contents(folder).keys() - {"report.html"} == before.keys()
    assert all(_contents(folder)[name] != before[name] for name in ("mse.csv", "run.json"))


def test_a_run_killed_before_its_first_rename_leaves_no_file_behind(
    run, logs, results, tmp_path
) -> None:
    folder = tmp_path / "results"
    shutil.copytree(results, folder)
    before = _contents(folder)
    _killed_at(0, logs / "setting_02.csv")
    left = _contents(folder)
    assert {name: left[name] for name in before} == before
    assert len(list(folder.iterdir())) > len(before)  # what the dead run had begun
    assert run("report", "results").code == 0
    assert _contents(folder).keys() - {"report.html"} == before.keys()


def test_two_runs_into_one_folder_at_once_are_refused_before_they_work(
    run, spawn, logs, results, tmp_path, monkeypatch
) -> None:
    folder = tmp_path / "results"
    shutil.copytree(results, folder)
    told = []
    fitted = identify._fits

    def meanwhile(*arguments, **how):
        told.append(spawn("identify", logs / "setting_02.csv", *QUICK))
        told.append(Run.load(folder))  # reading goes on
        return fitted(*arguments, **how)

    monkeypatch.setattr(identify, "_fits", meanwhile)
    assert run("identify", logs / "setting_01.csv", *QUICK).code == 0
    second, read = told
    assert second.code == 1
    (line,) = second.err.splitlines()
    assert line == (
        "damperfit: results: another run is at work there; wait for it to end, or "
        "give this one a folder of its own (--out)"
    )
    assert len(read.parameters) == 1
    assert _contents(folder).keys() == _contents(results).keys()


# What a log may say, and every place where it is shown

EVIL = "<script>alert(1)</script>[red]x[/red] `*_| =HYPERLINK(1) \x1b]0;owned\u202e"


def _evil_logs(logs: Path, folder: Path) -> list[Path]:
    """Two logs whose names, preambles and columns ask to be obeyed; one of them is refused."""
    text = (logs / "setting_01.csv").read_text()
    rows = text[text.index("time_s") :]
    name = "=cmd[red]'<b>`|\x1b[31m\u202e_setting_1.csv"
    header, _, body = rows.partition("\n")
    evil_header = header.replace("force_N", f'"{EVIL.replace(",", " ")} force_N"')
    good = f"# operator: {EVIL}\n# {EVIL}: x\n{evil_header}\n{body}"
    (folder / name).write_text(good)
    bad = good.replace("force_N", "forse_N")
    (folder / name.replace("_1.csv", "_2.csv")).write_text(bad)
    return [folder / name, folder / name.replace("_1.csv", "_2.csv")]


def _is_clean(text: str) -> bool:
    return not any(c in text for c in "\x1b\x07\u202e")


def test_nothing_that_a_log_says_becomes_markup(run, logs, tmp_path) -> None:
    paths = _evil_logs(logs, tmp_path)
    ended = run("inspect", *paths)
    assert ended.code == 1
    assert _is_clean(ended.out + ended.err)
    assert "[red]" in ended.out  # shown, not obeyed
    ended = run("identify", *paths, *QUICK, "--report")
    assert ended.code == 1
    assert _is_clean(ended.out + ended.err)
    folder = tmp_path / "results"
    report = (folder / "report.md").read_text()
    assert _is_clean(report)
    bare = report.replace("\\<", "").replace("\\[", "")  # what Markdown shows as it is
    assert not any(mark in bare for mark in ("<script", "<b>", "[red]"))
    page = (folder / "report.html").read_text()
    assert "<script>alert" not in page
    assert "\x1b" not in page
    with (folder / "mse.csv").open(newline="") as file:
        cells = [cell for row in csv.reader(file) for cell in row]
    assert any(cell.startswith("'=cmd") for cell in cells)
    assert not any(cell.startswith(("=", "@", "\t", "\r")) for cell in cells)
    assert {path.parent for path in tmp_path.rglob("*") if path.is_file()} == {tmp_path, folder}
    json.loads((folder / "run.json").read_text())
    assert "\x1b" not in (folder / "run.json").read_text()


# What a run leaves alone in a results folder, and what must go; how its logs were labelled.


@pytest.fixture
def one_log(logs, tmp_path):
    """The text of a short log that says nothing of itself."""
    lines = (logs / "setting_01.csv").read_text().splitlines()
    return "\n".join(x for x in lines if "setting" not in x) + "\n"


def listed(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}


def test_a_run_that_fits_nothing_keeps_the_earlier_results(run, one_log, tmp_path):
    good, bad = tmp_path / "setting_01.csv", tmp_path / "setting_02.csv"
    good.write_text(one_log)
    bad.write_text("nothing\n")
    first = run("identify", bad, "--out", "out")
    assert first.code == 3
    assert "1 failed in" in first.err
    assert run("identify", good, "--out", "out").code == 0
    before = listed(tmp_path / "out")
    ended = run("identify", bad, "--out", "out")
    assert ended.code == 3
    assert ended.err.splitlines()[-1] == (
        "damperfit: 0 settings fitted, 1 failed; nothing was written: the earlier results in out "
        "stay"
    )
    assert listed(tmp_path / "out") == before


def test_where_dampers_get_folders_the_earlier_results_of_one_go(run, one_log, repeated, tmp_path):
    for k, name in enumerate(("SN11_click01.csv", "SN12_click01.csv")):
        (tmp_path / name).write_text(repeated(one_log, k))
    out = tmp_path / "out"
    assert run("identify", "SN11_click01.csv", "--out", "out").code == 0
    (out / "mine.txt").write_text("a user's own")
    assert run("identify", "SN*.csv", "--out", "out").code == 0
    assert sorted(path.name for path in out.iterdir()) == ["11", "12", "mine.txt"]
    assert (out / "11" / "run.json").exists()
