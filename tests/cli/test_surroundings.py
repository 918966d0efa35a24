"""What surrounds a command: hostile folders, closed streams, folders and links that are gone."""

import os
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from tests.fleet.conftest import Here

pytestmark = pytest.mark.skipif(os.name != "posix", reason="a POSIX shell")
PROGRAM = "import sys; from damperfit.__main__ import main; sys.exit(main())"
COMMAND = (sys.executable, "-P", "-c", PROGRAM)
FOREIGN = {"numpy", "pyarrow", "typer", "rich", "pydantic", "matplotlib", "openpyxl", "damperfit"}
# What Python itself takes before a line of a program runs, where it looks in the folder first.
FIRST = "import sys; print(*sys.modules)"


def output(command: list[str], **how) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command, capture_output=True, text=True, check=False, **how)


def hostile(folder: Path, logs: Path, spared: set[str]) -> Path:
    """Two logs, and modules that leave a mark when they are executed; return the mark."""
    from openpyxl import Workbook

    folder.mkdir()
    mark = folder.parent / "mark"
    for name in (set(sys.stdlib_module_names) | FOREIGN | {"sitecustomize"}) - spared:
        (folder / f"{name}.py").write_text(f"open({str(mark)!r}, 'a').write({name + ' '!r})\n")
    for k in (1, 2):
        (folder / f"setting_0{k}.csv").write_bytes((logs / f"setting_0{k}.csv").read_bytes())
    book = Workbook()
    for row in ("time_s", "displacement_mm", "force_N"), (0.0, 1.0, 2.0):
        book.active.append(row)
    book.save(folder / "short_s3.xlsx")  # read by a process of its own
    return mark


def loaded_first(folder: Path, *how: str, **variables: str) -> set[str]:
    """Return the modules that Python has loaded before a program's first line."""
    folder.mkdir()
    (folder / "probe.py").write_text(FIRST)
    command = [sys.executable, *how]
    return set(output(command, cwd=folder, env=os.environ | variables).stdout.split())


# Every command; what starts processes of its own does so: copies, spawned workers, child readers.
COMMANDS = (
    "inspect .",
    *(
        pytest.param(words, marks=pytest.mark.slow)
        for words in """
fleet . --jobs 1 --out ../fleet --collect
identify setting_0*.csv --jobs 2 --out ../out
simulate --setting 5 --out ../a.csv --plot ../a.png
report {results} --out ../page
compare {results} {results} --out ../compared
export {results} --to fmu2 --out ../x.fmu
models setting_01.csv
sweep --setting 5 --vary r_m1=0.5,2
settings {results}
advise {results} --for k_e
valves {results}
passport {results} --out ../passport
ride {results} --stroke setting_01.csv
compare setting_01.csv setting_01.csv --measured
samples ../made --settings 1 --cycles 4
config
init setting_01.csv --out ../damper.toml
doctor
help adjusters""".strip().splitlines()
    ),
)


@pytest.fixture(
    scope="module",
    params=["module", *(pytest.param(one, marks=pytest.mark.slow) for one in ("script", "path"))],
)
def among_hostile(request, logs, tmp_path_factory) -> tuple[Path, Path, list[str], dict]:
    """Return a folder with hostile modules, their mark, a command and its environment."""
    root = tmp_path_factory.mktemp("hostile")
    command, variables, spared = [*COMMAND], {}, set()
    if request.param == "module":  # without -P Python's own runpy looks in the folder first
        command = [sys.executable, "-m", "damperfit"]
        spared = loaded_first(root / "probe", "-m", "probe") | {"damperfit"}
    if request.param == "path":
        variables = {"PYTHONPATH": f".{os.pathsep}"}
        spared = loaded_first(root / "probe", "-P", "-c", FIRST, **variables)
        spared |= {"damperfit", "sitecustomize", "nt", "_winapi"}  # tried by an editable install
    return root / "logs", hostile(root / "logs", logs, spared), command, variables


@pytest.mark.parametrize("words", COMMANDS)
def test_no_process_of_ours_executes_what_lies_beside_the_logs(among_hostile, results, words):
    folder, mark, command, variables = among_hostile
    words = shlex.split(words.format(results=results))
    ended = output([*command, *words], cwd=folder, env=os.environ | variables)
    assert not mark.exists(), mark.read_text()
    assert ended.returncode in {0, 1}, ended.stderr  # the book is too short


@pytest.mark.slow
def test_a_dask_worker_executes_nothing_of_the_folder_that_it_is_started_in(logs, tmp_path) -> None:
    distributed = pytest.importorskip("distributed")
    mark = hostile(tmp_path / "logs", logs, set())
    (tmp_path / "logs" / "short_s3.xlsx").unlink()
    with distributed.LocalCluster(n_workers=0, dashboard_address=None) as cluster:
        address = cluster.scheduler_address
        worker = subprocess.Popen(
            [sys.executable, "-P", "-m", "distributed.cli.dask_worker", address, "--no-dashboard"],
            cwd=tmp_path / "logs",
            env=os.environ | {"PYTHONSAFEPATH": "1"},  # what starts it is Dask's
            stderr=subprocess.DEVNULL,
        )
        try:
            words = f"fleet . --out ../fleet --scheduler {address}"
            command = [*COMMAND, *shlex.split(words)]
            ended = output(command, cwd=tmp_path / "logs", timeout=120.0)
        finally:
            worker.terminate()
            worker.wait(30.0)
    assert ended.returncode == 0, ended.stderr
    assert list((tmp_path / "fleet").glob("serial-*/part-*.parquet"))
    assert not mark.exists(), mark.read_text()


def ended(shell: str, folder: Path) -> tuple[int, str, str]:
    program = " ".join(map(shlex.quote, COMMAND))
    command = ["bash", "-c", shell.replace("damperfit", program, 1)]
    done = output(command, cwd=folder, env=os.environ | {"HOME": str(folder)})
    return done.returncode, done.stdout, done.stderr


@pytest.mark.parametrize(
    ("streams", "code"),
    [(">&- 2>&- <&-", 0), (">/dev/full 2>/dev/full", 1)],
)
def test_results_are_written_whatever_becomes_of_the_streams_and_the_working_folder(
    logs, results, tmp_path, streams, code
) -> None:
    (tmp_path / "gone").mkdir()
    words = f"identify {logs / 'setting_01.csv'} --out {tmp_path / 'out'} {streams}"
    assert ended(f"cd gone; rmdir ../gone; exec damperfit {words}", tmp_path)[0] == code
    assert {one.name for one in results.iterdir()} == {
        one.name for one in (tmp_path / "out").iterdir()
    }


@pytest.mark.parametrize("words", [pytest.param("config", marks=pytest.mark.slow), "--help"])
def test_an_answer_that_stdout_does_not_take_is_a_failure_with_a_word(tmp_path, words) -> None:
    for streams in (">&-", ">/dev/full"):
        code, _, said = ended(f"damperfit {words} {streams}", tmp_path)
        assert code == 1
        assert len(said.splitlines()) == 1
    shell = f"(damperfit {words}; echo $? >&2) | true"
    assert ended(shell, tmp_path)[2].split() == ["0"]


@pytest.mark.parametrize(
    ("words", "code"),
    [
        ("identify {log}", 2),
        ("inspect {log}", 0),
        ("report {results} --out page", 2),
    ],
)
def test_a_working_folder_that_is_gone_is_one_sentence(
    run, logs, results, tmp_path, monkeypatch, words, code
) -> None:
    (tmp_path / "gone").mkdir()
    monkeypatch.chdir(tmp_path / "gone")
    (tmp_path / "gone").rmdir()
    ended = run(*words.format(log=logs / "setting_01.csv", results=results).split())
    assert ended.code == code
    assert code == 0 or len(ended.err.splitlines()) == 1


@pytest.mark.slow
def test_a_loop_of_links_costs_itself_alone(run, logs, tmp_path, monkeypatch) -> None:
    monkeypatch.setattr("damperfit.workers.Processes", Here)
    (tmp_path / "setting_01.csv").write_bytes((logs / "setting_01.csv").read_bytes())
    (tmp_path / "setting_02.csv").symlink_to("setting_02.csv")
    assert run("identify", ".", "--out", "out", "--quiet").code == 1
    assert run("fleet", ".", "--out", "fleet", "--quiet").code == 1
    assert (tmp_path / "out" / "run.json").exists()
    assert run("identify", "setting_01.csv", "--out", "setting_02.csv").code == 2
    assert run("identify", "setting_01.csv", "--config", "setting_02.csv").code == 2


def test_a_nul_in_a_name_costs_that_log_alone(run, logs, tmp_path) -> None:
    log = logs / "setting_01.csv"
    (tmp_path / "list.txt").write_text(f"{log}\na\0b.csv\n")
    ended = run("identify", "@list.txt", "--out", "out", "--quiet")
    assert (ended.code, len(ended.err.splitlines())) == (1, 1)
    assert (tmp_path / "out" / "parameters.parquet").exists()
    for key in ("output.folder", "test.table", "identification.start"):
        (tmp_path / "c.toml").write_text(f'{key} = "a\\u0000b"\n')
        ended = run("identify", log, "--config", "c.toml")
        assert (ended.code, len(ended.err.splitlines())) == (2, 1)


@pytest.mark.slow
def test_the_home_folder_is_found_where_the_shell_leaves_its_sign(
    run, logs, monkeypatch, tmp_path
) -> None:
    home = tmp_path / "home"
    home.mkdir()
    monkeypatch.setenv("HOME", str(home))
    (home / "setting_01.csv").write_bytes((logs / "setting_01.csv").read_bytes())
    (tmp_path / "c.toml").write_text('output.folder = "~/configured"\n')
    assert run("identify", "~/setting_01.csv", "--out=~/a", "--quiet").code == 0
    assert run("identify", "~/*.csv", "--config", "c.toml", "--quiet").code == 0
    assert run("simulate", "--setting", "5", "--out", "~/b.csv").code == 0
    assert {one.name for one in home.iterdir()} >= {"a", "b.csv", "configured"}
    assert not (tmp_path / "~").exists()
