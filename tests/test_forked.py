"""Many items are worked on in copies of this process: the same results, nothing hangs on one."""

from __future__ import annotations

import errno
import json
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from damperfit import forked
from damperfit import workers as parallel
from damperfit.cli import main
from damperfit.forked import copies_at_work, is_copy
from damperfit.synthetic import SampleOptions, make_samples
from damperfit.workers import apart, told_here

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="copies are made on Linux alone")
ROOT = Path(__file__).parents[1]


def in_copies(act, items, **how):
    with copies_at_work(act, items, **how) as found:
        yield from found


def own_process(_item: object) -> int:
    return os.getpid()


def _children() -> set[str]:
    """Of this process, whoever started them."""
    of_threads = Path("/proc/self/task").glob("*/children")
    return {child for path in of_threads for child in path.read_text(encoding="ascii").split()}


def _open_files() -> int:
    return len(list(Path("/proc/self/fd").iterdir()))


class PickyError(Exception):
    """Can be pickled, and made of that no more."""

    def __init__(self, one: int, other: int) -> None:
        super().__init__(one)
        self.sum = one + other


@pytest.fixture
def many_at_once(monkeypatch):
    """Let two items be many, whatever threads the test runner has; counts who asks for copies."""
    asked = []

    def noted(act, items, **more):
        asked.append(len(items))
        return copies_at_work(act, items, **more)

    monkeypatch.setattr(parallel, "_FEWEST_APART", 2)
    monkeypatch.setattr(parallel, "_may_be_copied", lambda: not is_copy())
    monkeypatch.setattr(forked, "copies_at_work", noted)
    return asked


class TestInCopies:
    def test_results_come_in_the_order_of_the_items(self, tmp_path):
        def slow_first(k):
            """The first is done once another copy has been at work, however late that begins."""
            last = time.monotonic() + 60.0
            if k:
                (tmp_path / str(os.getpid())).touch()
            while k == 0 and not any(tmp_path.iterdir()) and time.monotonic() < last:
                time.sleep(0.01)
            return k, os.getpid()

        found = list(in_copies(slow_first, range(50), jobs=3))
        assert [k for k, _ in found] == list(range(50))
        assert os.getpid() not in {process for _, process in found}
        assert len({process for _, process in found}) > 1

    def test_arrays_come_back_to_the_last_bit_and_can_be_written_to(self):
        rng = np.random.default_rng(1)
        arrays = [rng.normal(size=(3, 5000)) for _ in range(4)]
        found = list(in_copies(lambda a: (a, a[:, ::2], a[:0]), arrays, jobs=2))
        for (whole, thinned, none), array in zip(found, arrays, strict=True):
            np.testing.assert_array_equal(whole, array)
            np.testing.assert_array_equal(thinned, array[:, ::2])
            assert none.shape == (0, 5000)
            whole[0, 0] = 1.0

    def test_what_the_parent_has_comes_back_as_itself(self):
        log, other = np.arange(3.0), np.arange(3.0)
        ((first, inner, second),) = in_copies(
            lambda _: (log, {"log": [log]}, other), [0], jobs=2, known=(log,)
        )
        assert first is log
        assert inner["log"][0] is log
        assert second is not other

    def test_an_error_is_raised_by_the_parent_where_its_result_would_stand(self):
        def divide(k):
            return 6 // k, os.getpid()

        results = in_copies(divide, [3, 2, 0, 1], jobs=2)
        assert [next(results)[0], next(results)[0]] == [2, 3]
        with pytest.raises(ZeroDivisionError) as caught:
            next(results)
        assert caught.traceback[-1].name == "divide"

    def test_what_cannot_be_pickled_is_found_by_the_parent(self):
        lock, number = next(in_copies(lambda k: (threading.Lock(), k), [7], jobs=2))
        assert number == 7
        assert lock.acquire(blocking=False)

    @pytest.mark.parametrize("items", [1, 40])
    def test_a_copy_that_dies_costs_nothing(self, items):
        parent = os.getpid()

        def deadly(k):
            if k == 0 and os.getpid() != parent:
                os.kill(os.getpid(), signal.SIGKILL)
            return k * k

        assert list(in_copies(deadly, range(items), jobs=2)) == [k * k for k in range(items)]

    def test_a_copy_that_dies_in_the_middle_of_its_answer_costs_nothing(self, monkeypatch):
        parent, whole = os.getpid(), os.write

        def half(where, data):
            if os.getpid() != parent and len(data) > 10_000:
                whole(where, bytes(data[:5000]))
                os._exit(0)
            return whole(where, data)

        monkeypatch.setattr(forked.os, "write", half)
        found = list(in_copies(lambda k: np.full(5000, float(k)), range(3), jobs=2))
        assert [one[-1] for one in found] == [0.0, 1.0, 2.0]

    @pytest.mark.parametrize("call", ["fork", "pipe"])
    @pytest.mark.parametrize("n_given", [0, 1])
    def test_where_the_system_has_no_more_to_give_fewer_do_it(self, monkeypatch, call, n_given):
        real, calls, before = getattr(os, call), [], _open_files()

        def scarce():
            calls.append(1)
            if len(calls) > n_given:
                raise BlockingIOError(errno.EAGAIN, "Resource temporarily unavailable")
            return real()

        monkeypatch.setattr(forked.os, call, scarce)
        assert list(in_copies(lambda k: k * k, range(9), jobs=3)) == [k * k for k in range(9)]
        assert len(calls) == n_given + 1
        assert _open_files() == before

    def test_who_ignores_the_end_of_children_has_their_results(self):
        before = signal.signal(signal.SIGCHLD, signal.SIG_IGN)
        try:
            assert list(in_copies(lambda k: -k, range(9), jobs=2)) == [-k for k in range(9)]
        finally:
            signal.signal(signal.SIGCHLD, before)

    def test_a_result_that_cannot_be_read_is_found_by_the_parent(self):
        found = list(in_copies(lambda k: PickyError(k, 1) if k % 2 else k, range(4), jobs=2))
        assert [found[0], found[1].sum, found[2], found[3].sum] == [0, 2, 2, 4]

    def test_more_items_than_a_pipe_holds_are_dealt_several_at_a_time(self):
        assert list(in_copies(lambda k: -k, range(3000), jobs=2)) == [-k for k in range(3000)]

    def test_who_wants_to_stop_waits_for_no_copy_and_the_rest_is_done_here(self):
        parent, begun = os.getpid(), time.monotonic()

        def endless(k):
            if os.getpid() != parent:
                time.sleep(60.0)
            return k

        found = list(in_copies(endless, range(4), jobs=2, cancelled=lambda: True))
        assert found == [0, 1, 2, 3]
        assert time.monotonic() - begun < 20.0

    def test_no_copy_is_left_when_the_caller_takes_no_more(self):
        results = in_copies(
            lambda k: time.sleep(60.0 if k else 0.0) or os.getpid(), [0, 1, 2], jobs=2
        )
        before = _children()
        process = next(results)
        assert len(_children() - before) == 2
        results.close()
        with pytest.raises(ProcessLookupError):
            os.kill(process, 0)
        assert _children() <= before

    def test_no_pipe_stays_open(self):
        before = _open_files()
        list(in_copies(own_process, range(10), jobs=3))
        assert _open_files() == before

    def test_a_copy_makes_no_copies(self):
        def inside(_):
            assert is_copy()
            return os.getpid(), set(in_copies(own_process, range(4), jobs=2))

        ((process, inner),) = in_copies(inside, [0], jobs=1)
        assert inner == {process}
        assert not is_copy()

    def test_ctrl_c_is_the_parents_business(self):
        def hit(k):
            os.kill(os.getpid(), signal.SIGINT)
            return k, os.getpid()

        found = list(in_copies(hit, range(3), jobs=2))
        assert [k for k, _ in found] == [0, 1, 2]
        assert os.getpid() not in {process for _, process in found}

    def test_copies_end_when_their_parent_is_killed(self, tmp_path):
        script = tmp_path / "parent.py"
        script.write_text(
            "import os, time\n"
            "from damperfit.forked import copies_at_work\n"
            "def say(k):\n"
            "    os.write(1, b'%d\\n' % os.getpid())\n"
            "    time.sleep(0.3)\n"
            "    return bytes(3_000_000)\n"
            "with copies_at_work(say, range(100), jobs=2):\n"
            "    time.sleep(60.0)\n"
        )
        with subprocess.Popen(
            [sys.executable, script], cwd=ROOT, stdout=subprocess.PIPE, text=True
        ) as parent:
            assert parent.stdout.readline() != parent.stdout.readline()  # two are at work
            parent.kill()
            parent.communicate(timeout=30.0)  # until whoever could write to it has ended


class TestApart:
    def test_beside_another_thread_no_copy_is_made(self):
        ends = threading.Event()
        other = threading.Thread(target=ends.wait)
        other.start()
        try:
            assert set(apart(own_process, range(50), jobs=2)) == {os.getpid()}
        finally:
            ends.set()
            other.join()

    @pytest.mark.parametrize("threads", [1, 2])
    def test_threads_may_be_fewer_than_copies(self, threads):
        def who(_):
            time.sleep(0.05)
            return threading.get_ident()

        assert len(set(apart(who, range(6), jobs=2, threads=threads))) == threads

    def test_whoever_is_told_of_an_error_is_told_in_the_parent(self, many_at_once):
        told = []
        take = told_here(lambda whose, error: told.append((whose, str(error))))

        def act(k):
            try:
                return 6 // k
            except ZeroDivisionError as error:
                take(k, error)
                return None

        assert list(apart(act, [1, 0, 2], jobs=2)) == [6, None, 3]
        assert told == [(0, "integer division or modulo by zero")]
        assert many_at_once == [3]


QUICK = ("--free", "r_m1,r_m2,k_e", "--fix", "r_m3=2.6e6", "--fix", "f_f=50N", "--quiet")
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


def assert_alike(found: dict[str, object], expected: dict[str, object]) -> None:
    """Tables and tracebacks are too long to be shown side by side: their names alone."""
    assert found.keys() == expected.keys()
    assert [key for key in expected if found[key] != expected[key]] == []


@pytest.mark.parametrize("more", [QUICK, ()], ids=["plain", "paper"])
def test_a_run_in_copies_is_byte_for_byte_that_in_one_thread(
    short_logs, tmp_path, many_at_once, capsys, more
):
    options = ("--procedure", "plain", *more) if more else ()
    alone = results_of(short_logs, tmp_path / "out", 1, *options)
    assert not many_at_once
    beside = results_of(short_logs, tmp_path / "out", 2, *options)
    assert len(many_at_once) >= 5
    assert_alike(beside, alone)
    assert alone["code"] == 1  # of the log that is none
    assert capsys.readouterr().err


@pytest.mark.parametrize(
    "broken",
    [
        "damperfit.run.logs.condition",
        "damperfit.identification.fit_setting._ended",
        "damperfit.uncertainty.linearisation.linearise_at_fit",
        "damperfit.tables.rows.characteristic_rows",
    ],
)
def test_a_bug_that_one_log_meets_in_a_copy_is_told_as_in_one_thread(
    short_logs, tmp_path, many_at_once, monkeypatch, capsys, broken
):
    place, name = broken.rsplit(".", 1)
    module = sys.modules[place]
    real = getattr(module, name)

    def breaks(first, *rest, **more):
        of_setting = getattr(first, "traces", (first,))[0]
        if str(getattr(of_setting, "setting", of_setting)) == "2":
            raise RuntimeError("broken at 2")
        return real(first, *rest, **more)

    monkeypatch.setattr(module, name, breaks)
    options = ("--procedure", "plain", *QUICK)
    alone = results_of(short_logs, tmp_path / "out", 1, *options)
    beside = results_of(short_logs, tmp_path / "out", 2, *options)
    assert_alike(beside, alone)
    assert "broken at 2" in json.dumps(alone["failures"])
    assert many_at_once
    capsys.readouterr()
