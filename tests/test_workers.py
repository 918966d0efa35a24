"""Whoever works on many things gives the same results in order, and nothing hangs on one worker."""

import errno
import json
import os
import signal
import subprocess
import sys
import threading
import time
from contextlib import ExitStack
from pathlib import Path

import pytest
import scipy.linalg  # noqa: F401 - it brings a BLAS of its own
from threadpoolctl import threadpool_info, threadpool_limits

from damperfit.cli import main
from damperfit.identification.blas_threads import one_blas_thread
from damperfit.synthetic import SampleOptions, make_samples
from damperfit.workers import Died, Processes, executor
from tests.fleet.deadly import (
    die_at_three,
    double,
    is_gone,
    refuse,
    refuse_with_a_lock,
    say_pid_and_wait,
)

on_linux = pytest.mark.skipif(sys.platform != "linux", reason="copies are made on Linux alone")
posix = pytest.mark.skipif(os.name != "posix", reason="signals")
ROOT = Path(__file__).parents[1]


@pytest.mark.parametrize("jobs", [0, 1, 3])
def test_results_come_in_the_order_of_the_items_and_one_job_needs_no_thread(jobs):
    is_second_done = threading.Event()

    def wait_for_the_second(number, text):
        if jobs > 1 and number == 0:
            assert is_second_done.wait(30.0)
        is_second_done.set()
        return f"{text}{number}", threading.get_ident()

    with executor(jobs) as pool:
        found = list(pool.map(wait_for_the_second, [0, 1, 2], "abc"))
        results = pool.map(lambda k: 6 // k, [3, 0, 1])
        assert next(results) == 2
        with pytest.raises(ZeroDivisionError):
            next(results)
    assert [text for text, _ in found] == ["a0", "b1", "c2"]
    assert ({own for _, own in found} == {threading.get_ident()}) == (jobs < 2)


QUICK = (
    *("--procedure", "plain", "--free", "r_m1,r_m2,k_e", "--fix", "r_m3=2.6e6"),
    *("--fix", "f_f=50N"),
)
SHORT = SampleOptions(settings=(1, 2, 3), cycles=5.0, force_noise=1.0, displacement_noise=2e-6)


@pytest.fixture(scope="module")
def short_logs(tmp_path_factory) -> Path:
    """Three short logs and one that is none."""
    folder = tmp_path_factory.mktemp("logs")
    make_samples(folder, SHORT)
    (folder / "setting_04.csv").write_text("time_s,displacement_mm,force_N\n0,1,2\n")
    return folder


def results_of(short_logs: Path, folder: Path, jobs: int, *more: str) -> dict[str, object]:
    given = [str(path) for path in sorted(short_logs.glob("*.csv"))]
    code = main(["identify", *given, *more, "--jobs", str(jobs), "--out", str(folder), "--quiet"])
    files = {path.name: path.read_bytes() for path in folder.iterdir() if path.name != "run.json"}
    record = json.loads((folder / "run.json").read_text(encoding="utf-8"))
    return {"code": code, **files, **{key: record[key] for key in record if key != "timings"}}


def test_a_run_in_threads_is_byte_for_byte_that_in_one(short_logs, tmp_path, monkeypatch):
    """Also where a setting breaks."""
    from damperfit.run import logs

    real = logs.condition

    def breaks(recording, *rest, **more):
        if str(recording.setting) == "2":
            raise RuntimeError("broken at 2")
        return real(recording, *rest, **more)

    monkeypatch.setattr(logs, "condition", breaks)
    alone = results_of(short_logs, tmp_path / "out", 1, *QUICK)
    beside = results_of(short_logs, tmp_path / "out", 2, *QUICK)
    # Tables and tracebacks are too long to be shown side by side: their names alone.
    assert beside.keys() == alone.keys()
    assert [key for key in alone if beside[key] != alone[key]] == []
    assert alone["code"] == 1  # of the log that is none
    assert "broken at 2" in json.dumps(alone["failures"])


# Processes that may die


def test_a_death_costs_its_item_alone_and_an_exception_is_a_result():
    found = dict(Processes(2).each(die_at_three, range(12)))
    assert isinstance(found.pop(3), Died)
    assert found == {k: k for k in range(12) if k != 3}
    ((item, error),) = Processes(1).each(refuse, [7])
    assert (item, type(error), str(error)) == (7, ValueError, "no 7")
    ((_, error),) = Processes(1).each(refuse_with_a_lock, [7])
    assert str(error) == "ValueError: no 7"


def test_a_process_that_cannot_begin_costs_its_item(monkeypatch):
    def none(*_, **__):
        raise OSError(errno.EAGAIN, "no more processes")

    monkeypatch.setattr("subprocess.Popen.__init__", none)
    found = Processes(2).each(double, [1, 2, 3])
    assert [(item, type(error)) for item, error in found] == [
        (item, BlockingIOError) for item in (1, 2, 3)
    ]


def test_items_are_taken_as_workers_become_free():
    taken = []

    def items():
        for k in range(40):
            taken.append(k)
            yield k

    found = Processes(1).each(double, items())
    assert next(found) == (0, 0)
    assert len(taken) < 10
    found.close()


def waited_for(condition, seconds: float = 60.0) -> bool:
    until = time.monotonic() + seconds
    while not condition() and time.monotonic() < until:
        time.sleep(0.05)
    return condition()


def has_text(path: Path) -> bool:
    return path.exists() and path.read_text() != ""


@posix
def test_the_wish_to_stop_ends_the_work_and_its_process(tmp_path):
    where = tmp_path / "pid"
    found = Processes(1).each(say_pid_and_wait, [str(where)], cancelled=lambda: has_text(where))
    assert list(found) == []
    assert is_gone(int(where.read_text()))


@posix
def test_workers_end_with_their_parent(tmp_path):
    where = tmp_path / "pid"
    script = tmp_path / "parent.py"
    script.write_text(
        "from damperfit.workers import Processes\n"
        "from tests.fleet.deadly import say_pid_and_wait\n"
        "if __name__ == '__main__':\n"
        f"    list(Processes(1).each(say_pid_and_wait, [{str(where)!r}]))\n"
    )
    parent = subprocess.Popen(
        [sys.executable, str(script)],
        cwd=ROOT.parent,  # the working folder itself would be kept off the import path
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stderr=subprocess.PIPE,
    )
    try:
        assert waited_for(lambda: has_text(where))
    finally:
        parent.send_signal(signal.SIGKILL)
        _, said = parent.communicate()  # until the last process that may say something has ended
    assert said == b""
    assert is_gone(int(where.read_text()))


# BLAS has its threads back when the last of several runs in one process has ended.


def threads() -> set[int]:
    return {one["num_threads"] for one in threadpool_info() if one["user_api"] == "blas"}


@pytest.fixture
def three_threads():
    """A number that is neither one nor, by chance, the machine's."""
    with threadpool_limits(3, user_api="blas"):
        assert threads() == {3}
        yield


def test_the_first_to_end_leaves_it_lowered_and_the_last_puts_it_back(three_threads) -> None:
    first, second = ExitStack(), ExitStack()
    first.enter_context(one_blas_thread())
    assert threads() == {1}
    second.enter_context(one_blas_thread())
    first.close()
    assert threads() == {1}
    second.close()
    assert threads() == {3}
