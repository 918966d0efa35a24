"""Workers die, refuse and are stopped; nobody else notices."""

from __future__ import annotations

import os
import signal
import threading
import time
from pathlib import Path

import pytest

from damperfit.workers import Died, Processes
from tests.fleet.deadly import die_at_three, double, refuse, say_pid_and_wait


def test_each_item_comes_back_with_its_result_once():
    found = dict(Processes(2).each(double, range(12)))
    assert found == {k: 2 * k for k in range(12)}


def test_a_death_costs_the_item_alone():
    found = dict(Processes(1).each(die_at_three, range(6)))
    assert isinstance(found.pop(3), Died)
    assert found == {k: k for k in (0, 1, 2, 4, 5)}


def test_an_exception_is_the_result_of_its_item():
    ((item, error),) = Processes(1).each(refuse, [7])
    assert item == 7
    assert isinstance(error, ValueError)
    assert str(error) == "no 7"


def test_items_are_taken_as_workers_become_free():
    taken = []

    def items():
        for k in range(40):
            taken.append(k)
            yield k

    found = Processes(1).each(double, items())
    next(found)
    # One is done, and beside it no more wait than fit.
    assert len(taken) < 10
    found.close()


def alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    state = Path(f"/proc/{pid}/stat")
    return not state.exists() or state.read_text().rpartition(")")[2].split()[0] != "Z"


def waited_for(condition, seconds: float = 60.0) -> bool:
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        if condition():
            return True
        time.sleep(0.05)
    return False


def has_text(path: Path) -> bool:
    return path.exists() and path.read_text() != ""


@pytest.mark.skipif(os.name != "posix", reason="signals")
def test_the_wish_to_stop_ends_the_work_and_its_process(tmp_path):
    where = tmp_path / "pid"
    stop = threading.Event()

    def stop_when_it_works():
        waited_for(lambda: has_text(where))
        stop.set()

    threading.Thread(target=stop_when_it_works, daemon=True).start()
    found = list(Processes(1).each(say_pid_and_wait, [str(where)], cancelled=stop.is_set))
    assert found == []
    pid = int(where.read_text())
    assert waited_for(lambda: not alive(pid))


@pytest.mark.skipif(os.name != "posix", reason="signals")
def test_workers_end_with_their_parent(tmp_path):
    import subprocess
    import sys

    where = tmp_path / "pid"
    code = (
        "from damperfit.workers import Processes\n"
        "from tests.fleet.deadly import say_pid_and_wait\n"
        "if __name__ == '__main__':\n"
        f"    list(Processes(1).each(say_pid_and_wait, [{str(where)!r}]))\n"
    )
    script = tmp_path / "parent.py"
    script.write_text(code)
    root = Path(__file__).parents[2]
    parent = subprocess.Popen(
        [sys.executable, str(script)],
        env={**os.environ, "PYTHONPATH": str(root)},
        stderr=subprocess.PIPE,
    )
    try:
        assert waited_for(lambda: has_text(where))
    finally:
        parent.send_signal(signal.SIGKILL)
        _, said = parent.communicate()  # until the last process that may say something has ended
    assert said == b""
    pid = int(where.read_text())
    assert waited_for(lambda: not alive(pid))
