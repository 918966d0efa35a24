"""Results stay whole whatever happens to the run or its folder; what a log says stays text."""

import csv
import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import threading
import time
import warnings
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from damperfit.cli import main
from damperfit.cli.console import stop_on_signal
from damperfit.configuration.loading import load_configuration
from damperfit.results import Run
from damperfit.run import identify
from damperfit.run.identify import Watch, written

ROOT = Path(__file__).parents[2]
LOGS = ROOT / "sample_runs"
QUICK = (
    *("--procedure", "plain", "--free", "r_m1,r_m2,k_e", "--quiet"),
    *("--fix", "r_m3=2.6e6", "--fix", "f_f=50N"),
)


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}


@pytest.fixture(scope="module")
def first(logs, tmp_path_factory) -> Path:
    """Results of setting 1."""
    folder = tmp_path_factory.mktemp("first") / "results"
    assert main(["identify", str(logs / "setting_01.csv"), *QUICK, "--out", str(folder)]) == 0
    return folder


@pytest.fixture
def folder(first, tmp_path) -> Path:
    """A copy to be written over."""
    return Path(shutil.copytree(first, tmp_path / "results"))


# Killed, interrupted, two at once, a full disk.


def killed_at(rename: int, log: Path) -> None:
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
        main(["identify", str(log), *QUICK])
        os._exit(1)
    _, status = os.waitpid(child, 0)
    assert os.waitstatus_to_exitcode(status) == -signal.SIGKILL


@pytest.mark.skipif(os.name != "posix", reason="needs SIGKILL")
@pytest.mark.parametrize("rename", [0, 4])
def test_what_a_killed_run_half_wrote_goes_or_is_ended_by_whoever_comes_next(
    run, logs, folder, rename
) -> None:
    before = contents(folder)
    killed_at(rename, logs / "setting_02.csv")
    between = contents(folder)
    assert sum(between[name] != before[name] for name in before) == max(rename - 1, 0)
    assert rename or len(list(folder.iterdir())) > len(before)  # what the dead run had begun
    ended = run("report", "results")
    assert ended.code == 0, ended.err
    assert "is not the file that the run wrote" not in ended.err
    after = contents(folder)
    assert after.keys() - {"report.html"} == before.keys()
    names = [one["log"] for one in json.loads(after["run.json"])["inputs"]]
    assert names == ["setting_02.csv" if rename else "setting_01.csv"]
    assert all((after[name] == before[name]) == (not rename) for name in ("mse.csv", "run.json"))


def test_two_runs_into_one_folder_at_once_are_refused_before_they_work(
    run, logs, first, folder, monkeypatch
) -> None:
    told = []
    fitted = identify._fits

    def meanwhile(*arguments, **how):
        told.append(run("identify", logs / "setting_02.csv", *QUICK))
        told.append(Run.load(folder))  # reading goes on
        return fitted(*arguments, **how)

    monkeypatch.setattr(identify, "_fits", meanwhile)
    assert run("identify", logs / "setting_01.csv", *QUICK).code == 0
    second, read = told
    assert second.code == 1
    (line,) = second.err.splitlines()
    assert line.startswith("damperfit: results: another run is at work there; wait for it to end")
    assert len(read.parameters) == 1
    assert contents(folder).keys() == contents(first).keys()


def test_a_full_disk_leaves_the_old_results_whole(run, logs, folder) -> None:
    before, usual = contents(folder), resource.getrlimit(resource.RLIMIT_FSIZE)
    # A limit on file sizes is the nearest to a full disk that needs no rights.
    resource.setrlimit(resource.RLIMIT_FSIZE, (60_000, usual[1]))
    try:
        ended = run("identify", logs / "setting_01.csv")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, usual)
    assert (ended.code, "Traceback" in ended.err) == (1, False)
    assert "earlier results there are untouched" in ended.err
    assert contents(folder) == before


def test_results_that_cannot_be_written_are_still_shown(run, logs, monkeypatch, tmp_path) -> None:
    def full(*_args, **_how):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("damperfit.tables.files.write_responses", full)
    log = logs / "setting_01.csv"
    ended = run("identify", log, "--report")
    assert ended.code == 1
    assert "No space left on device" in ended.err.splitlines()[-1]
    assert "excellent" in ended.out
    assert not (tmp_path / "results").exists()  # nothing came to stand in it
    assert json.loads(run("identify", log, "--json").out)["parameters"][0]["setting"] == 1


def test_finished_settings_are_written_when_the_user_stops(logs, fitted_anew, tmp_path) -> None:
    stop = threading.Event()
    settings = load_configuration(overlay={"output": {"folder": str(tmp_path / "out")}})
    watch = Watch(on_fit=lambda _fit: stop.set(), cancelled=stop.is_set)
    (result,) = written(settings, [str(logs / "setting_*.csv")], jobs=1, watch=watch)
    assert result.run.exit_code == 130
    table = pq.read_table(tmp_path / "out" / "parameters.parquet")
    assert table["setting"].to_pylist() == [1]
    record = json.loads((tmp_path / "out" / "run.json").read_text())
    assert (record["ending"], record["exit_code"]) == ("interrupted", 130)
    assert "Interrupted" in (tmp_path / "out" / "report.md").read_text()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_asks_to_stop_and_a_second_one_ends_at_once(number, capsys) -> None:
    before, stop = signal.getsignal(number), threading.Event()
    with stop_on_signal("", stop):
        assert not stop.is_set()
        os.kill(os.getpid(), number)
        assert stop.is_set()
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), number)
    assert signal.getsignal(number) is before
    assert len(capsys.readouterr().err.splitlines()) == 1


@pytest.mark.skipif(not Path("/proc/self/maps").exists(), reason="needs /proc")
@pytest.mark.parametrize(
    ("number", "jobs"),
    [
        (signal.SIGINT, 1),
        pytest.param(signal.SIGTERM, 1, marks=pytest.mark.slow),
        # In copies of the process; as a lost terminal sends it.
        pytest.param(signal.SIGHUP, 2, marks=pytest.mark.slow),
    ],
)
def test_the_command_ends_with_130_and_no_temporary_file(tmp_path, number, jobs) -> None:
    process = subprocess.Popen(  # enough work for a signal to arrive in the middle of it
        [sys.executable, "-m", "damperfit", "identify", str(LOGS), "--jobs", str(jobs)],
        cwd=tmp_path,
        start_new_session=True,
        preexec_fn=lambda: signal.signal(number, signal.SIG_DFL),  # noqa: PLW1509 - under nohup it is ignored
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    with process:
        deadline = time.monotonic() + 30.0
        while "damperfit/damper/_core" not in Path(f"/proc/{process.pid}/maps").read_text():
            assert process.poll() is None
            assert time.monotonic() < deadline
            time.sleep(0.01)
        os.killpg(process.pid, number)  # as a terminal does
        _, err = process.communicate(timeout=60)
    assert process.returncode == 130
    assert err.count("stopping") <= 1
    assert "Traceback" not in err
    results = tmp_path / "results"
    assert [p.name for p in results.glob(".*")] == []
    assert not results.exists() or json.loads((results / "run.json").read_text())


# What a run leaves alone in a results folder, and what must go.


def test_a_folder_holds_one_run_only(undrawn, run, logs, tmp_path) -> None:
    """A page and figures go with the next run; two files of somebody else's stay."""
    both = logs / "setting_0[12].csv"
    assert run("identify", both, "--report", "--plots", "svg", "--quiet").code == 0
    folder = tmp_path / "results"
    figures = folder / "figures"
    assert (folder / "report.html").exists()
    assert len(list(figures.glob("*.svg"))) > 10
    for place in (figures, folder):
        (place / "my_notes.svg").write_text("mine")
    log = logs / "setting_03.csv"
    assert run("identify", log, "--quiet").code == 0
    assert not (folder / "report.html").exists()
    assert [path.name for path in figures.iterdir()] == ["my_notes.svg"]
    assert (folder / "my_notes.svg").exists()
    for name in ("parameters", "mse", "responses"):
        assert set(pq.read_table(folder / f"{name}.parquet")["setting"].to_pylist()) == {3}
    (figures / "my_notes.svg").unlink()
    assert run("identify", log, "--quiet").code == 0
    assert not figures.exists()


def test_a_run_that_fits_nothing_keeps_the_earlier_results(run, first, folder):
    Path("setting_02.csv").write_text("nothing\n")
    ended = run("identify", "setting_02.csv", "--out", "results")
    assert ended.code == 3
    assert "nothing was written: the earlier results in results stay" in ended.err
    assert contents(folder) == contents(first)


# What a log may say, and every place where it is shown.

EVIL = "<script>alert(1)</script>[red]x[/red] `*_| =HYPERLINK(1) \x1b]0;owned\u202e"


def is_clean(text: str) -> bool:
    return not any(c in text for c in "\x1b\x07\u202e")


def test_nothing_that_a_log_says_becomes_markup(run, logs, tmp_path) -> None:
    """Names, preambles and columns ask to be obeyed; one of the logs is refused."""
    header, _, rows = (logs / "setting_01.csv").read_text().partition("time_s")[2].partition("\n")
    header = f"time_s{header}".replace("force_N", f'"{EVIL.replace(",", " ")} force_N"')
    good = f"# operator: {EVIL}\n# {EVIL}: x\n{header}\n{rows}"
    paths = [tmp_path / f"=cmd[red]'<b>`|\x1b[31m\u202e_setting_{k}.csv" for k in (1, 2)]
    paths[0].write_text(good)
    paths[1].write_text(good.replace("force_N", "forse_N"))
    shown = run("inspect", *paths)
    assert "[red]" in shown.out  # shown, not obeyed
    for ended in (shown, run("identify", *paths, *QUICK, "--report")):
        assert (ended.code, is_clean(ended.out + ended.err)) == (1, True)
    folder = tmp_path / "results"
    report = (folder / "report.md").read_text()
    bare = report.replace("\\<", "").replace("\\[", "")  # what Markdown shows as it is
    assert not any(mark in bare for mark in ("<script", "<b>", "[red]"))
    page = (folder / "report.html").read_text()
    assert "<script>alert" not in page
    assert is_clean(report)
    assert "\x1b" not in page + (folder / "run.json").read_text()
    with (folder / "mse.csv").open(newline="") as file:
        cells = [cell for row in csv.reader(file) for cell in row]
    assert any(cell.startswith("'=cmd") for cell in cells)
    assert not any(cell.startswith(("=", "@", "\t", "\r")) for cell in cells)
    assert {path.parent for path in tmp_path.rglob("*") if path.is_file()} == {tmp_path, folder}
