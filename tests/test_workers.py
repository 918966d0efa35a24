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

import numpy as np
import pytest
import scipy.linalg  # noqa: F401 - it brings a BLAS of its own
from threadpoolctl import threadpool_info, threadpool_limits

from damperfit import workers
from damperfit.cli import main
from damperfit.identification import blas_threads
from damperfit.identification.blas_threads import one_blas_thread
from damperfit.synthetic import SampleOptions, make_samples
from damperfit.workers import Died, Processes, executor, in_copies, raised_in_copy
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


# Copies of this process


def own_process(_item: object) -> int:
    return os.getpid()


def open_files() -> int:
    return len(list(Path("/proc/self/fd").iterdir()))


class PickyError(Exception):
    """Can be pickled, and made of that no more."""

    def __init__(self, one: int, other: int) -> None:
        super().__init__(one)
        self.sum = one + other


@pytest.fixture
def many_at_once(monkeypatch):
    """Let two items be many, whatever threads the test runner has; counts the copies."""
    made = []
    real = workers._Copies._copy

    def noted(copies, *pipes):
        made.append(len(copies._items))
        return real(copies, *pipes)

    monkeypatch.setattr(workers, "_FEWEST_APART", 1)
    monkeypatch.setattr(workers, "_may_be_copied", lambda: not workers._is_copy)
    monkeypatch.setattr(workers._Copies, "_copy", noted)
    return made


@on_linux
@pytest.mark.usefixtures("many_at_once")
class TestInCopies:
    def test_what_the_parent_has_comes_back_as_itself(self):
        log, other = np.arange(3.0), np.arange(3.0)
        ((first, inner, second),) = in_copies(
            lambda _: (log, {"log": [log]}, other), [0], jobs=2, known=(log,)
        )
        assert first is log
        assert inner["log"][0] is log
        assert second is not other

    def test_an_error_is_raised_by_the_parent_where_its_result_would_stand(self):
        results = in_copies(lambda k: 6 // k, [3, 2, 0, 1], jobs=2)
        assert [next(results), next(results)] == [2, 3]
        with pytest.raises(ZeroDivisionError) as caught:
            next(results)
        assert caught.traceback[-1].name == "<lambda>"

    def test_what_cannot_be_pickled_or_read_is_found_by_the_parent(self):
        def answer(k):
            return (threading.Lock(), k, PickyError(k, 1))[k % 3]

        found = list(in_copies(answer, range(6), jobs=2))
        assert [found[1], found[4]] == [1, 4]
        assert [found[2].sum, found[5].sum] == [3, 6]
        assert found[0].acquire(blocking=False)

    @pytest.mark.parametrize("items", [1, 40, 3000])
    @pytest.mark.parametrize("is_answering", [False, True])
    def test_a_copy_that_dies_costs_nothing(self, items, is_answering, monkeypatch):
        parent, whole = os.getpid(), os.write

        def deadly(k):
            if k == 0 and os.getpid() != parent and not is_answering:
                os.kill(os.getpid(), signal.SIGKILL)
            return np.full(5000, float(k)) if k == 0 else k

        def half(where, data):
            if os.getpid() != parent and len(data) > 10_000:
                whole(where, bytes(data[:5000]))
                os._exit(0)
            return whole(where, data)

        if is_answering:
            monkeypatch.setattr(os, "write", half)
        found = list(in_copies(deadly, range(items), jobs=2))
        assert found[0][-1] == 0.0
        assert found[1:] == list(range(1, items))

    @pytest.mark.parametrize("call", ["fork", "pipe"])
    @pytest.mark.parametrize("n_given", [0, 1])
    def test_where_the_system_has_no_more_to_give_fewer_do_it(self, monkeypatch, call, n_given):
        real, calls, before = getattr(os, call), [], open_files()

        def scarce():
            calls.append(1)
            if len(calls) > n_given:
                raise BlockingIOError(errno.EAGAIN, "Resource temporarily unavailable")
            return real()

        monkeypatch.setattr(os, call, scarce)
        assert list(in_copies(lambda k: k * k, range(9), jobs=3)) == [k * k for k in range(9)]
        assert len(calls) == n_given + 1
        assert open_files() == before

    def test_who_wants_to_stop_waits_for_no_copy_and_the_rest_is_done_here(self):
        parent, begun = os.getpid(), time.monotonic()

        def endless(k):
            if os.getpid() != parent:
                time.sleep(60.0)
            return k

        assert list(in_copies(endless, range(4), jobs=2, cancelled=lambda: True)) == [0, 1, 2, 3]
        assert time.monotonic() - begun < 20.0

    def test_no_copy_is_left_when_the_caller_takes_no_more(self):
        results = in_copies(
            lambda k: time.sleep(60.0 if k else 0.0) or os.getpid(), [0, 1, 2], jobs=2
        )
        process = next(results)
        results.close()
        with pytest.raises(ProcessLookupError):
            os.kill(process, 0)

    def test_a_copy_makes_no_copies_and_ctrl_c_is_the_parents_business(self):
        def inside(_):
            os.kill(os.getpid(), signal.SIGINT)
            return os.getpid(), set(in_copies(own_process, range(4), jobs=1))

        ((process, inner),) = in_copies(inside, [0], jobs=2)
        assert inner == {process} != {os.getpid()}

    def test_whoever_is_told_of_an_error_is_told_in_the_parent(self):
        told = []
        take = raised_in_copy(lambda whose, error: told.append((whose, str(error))))

        def act(k):
            try:
                return 6 // k
            except ZeroDivisionError as error:
                take(k, error)
                return None

        assert list(in_copies(act, [1, 0, 2], jobs=2)) == [6, None, 3]
        assert told == [(0, "integer division or modulo by zero")]


@on_linux
def test_copies_end_when_their_parent_is_killed(tmp_path):
    script = tmp_path / "parent.py"
    script.write_text(
        "import os, time\n"
        "from damperfit.workers import in_copies\n"
        "def say(k):\n"
        "    os.write(1, b'%d\\n' % os.getpid())\n"
        "    time.sleep(0.3)\n"
        "    return bytes(3_000_000)\n"
        "list(in_copies(say, range(100), jobs=2, meanwhile=lambda: time.sleep(60.0)))\n"
    )
    with subprocess.Popen(
        [sys.executable, script], cwd=ROOT, stdout=subprocess.PIPE, text=True
    ) as parent:
        assert parent.stdout.readline() != parent.stdout.readline()  # two are at work
        parent.kill()
        parent.communicate(timeout=30.0)  # until whoever could write to it has ended


@pytest.mark.parametrize("threads", [1, 2])
def test_beside_another_thread_no_copy_is_made_and_threads_may_be_fewer(threads):
    def who(_):
        time.sleep(0.02)
        return os.getpid(), threading.get_ident()

    ends = threading.Event()
    other = threading.Thread(target=ends.wait)
    other.start()
    try:
        found = set(in_copies(who, range(50), jobs=2, threads=threads))
    finally:
        ends.set()
        other.join()
    assert {process for process, _ in found} == {os.getpid()}
    assert len(found) == threads


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


@on_linux
def test_a_run_in_copies_is_byte_for_byte_that_in_one_thread(
    short_logs, tmp_path, many_at_once, monkeypatch
):
    """Also where a setting breaks."""
    from damperfit.run import logs

    real = logs.condition

    def breaks(recording, *rest, **more):
        if str(recording.setting) == "2":
            raise RuntimeError("broken at 2")
        return real(recording, *rest, **more)

    monkeypatch.setattr(logs, "condition", breaks)
    alone = results_of(short_logs, tmp_path / "out", 1, *QUICK)
    assert not many_at_once
    beside = results_of(short_logs, tmp_path / "out", 2, *QUICK)
    assert many_at_once
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
def three_threads(monkeypatch):
    """A number that is neither one nor, by chance, the machine's; libraries are looked for anew."""
    monkeypatch.setattr(blas_threads, "_found", {})
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
