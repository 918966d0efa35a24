"""Children that read logs: one lasts, a log that breaks it costs itself alone."""

import os
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import NamedTuple

import pytest

from damperfit.errors import LogError
from damperfit.io import ReadOptions, child_process
from damperfit.io.child_process import ChildReader, ask_child
from damperfit.io.files import Source
from tests.fleet.deadly import is_gone

READER = ChildReader("Fault", "none", "json", "tests.io.child_faults:answer")
LIMIT = 50_000_000
MB = 1_000_000


@pytest.fixture(scope="module", autouse=True)
def children():
    """Children of these tests alone, which go on with those of the test before."""
    with of_their_own() as pool:
        yield pool


@contextmanager
def of_their_own():
    pool = child_process._Children()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(child_process, "_CHILDREN", pool)
        yield pool
    pool.end()


class Answer(NamedTuple):
    pid: int
    n_seen: int
    parts: list[bytes]


def ask(data: bytes, limit: int = LIMIT, reader: ChildReader = READER) -> Answer:
    source = Source("log.x", "log.x", data, "")
    return Answer(*ask_child(reader, source, ReadOptions(max_bytes=limit)))


def refusal(data: bytes, limit: int = LIMIT) -> str:
    with pytest.raises(LogError) as caught:
        ask(data, limit)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_one_child_reads_all_logs_one_after_the_other() -> None:
    answers = [ask(b"log %d" % i) for i in range(5)]
    assert len({answer.pid for answer in answers}) == 1
    assert [answer.n_seen - answers[0].n_seen for answer in answers] == [0, 1, 2, 3, 4]
    assert answers[3].parts == [b"log 3", b"", bytes(5)]


@pytest.mark.parametrize(
    ("log", "says"),
    [
        (b"crash", "damaged Fault file: its reader ended by SIGSEGV; copy the log again"),
        (b"exit", "damaged Fault file: its reader ended by code 7"),
        (b"raise", "damaged Fault file: its reader ended by RuntimeError"),
        (b"refuse", "this one is refused"),
        (b"allocate 2000000000", "needs more memory than the limit (rig.max_log_bytes) allows"),
    ],
)
@pytest.mark.parametrize("n_before", [1, pytest.param(0, marks=pytest.mark.slow)])
def test_a_log_that_breaks_its_child_costs_itself_alone(log, says, n_before) -> None:
    with nullcontext() if n_before else of_their_own():
        pids = [ask(b"before").pid for _ in range(n_before)]
        assert says in refusal(log)
        answer = ask(b"after")
        # Nor is a child asked again that has refused: its memory may be spoilt.
        assert answer.pid not in pids
        assert answer.n_seen == 1


def test_a_library_that_cannot_spoil_memory_goes_on_after_a_refusal() -> None:
    safe = READER._replace(is_memory_safe=True)
    pid = ask(b"before", reader=safe).pid
    with pytest.raises(LogError, match="this one is refused"):
        ask(b"refuse", reader=safe)
    assert ask(b"after", reader=safe).pid == pid
    with pytest.raises(LogError, match=r"rig\.max_log_bytes"):
        ask(b"allocate 2000000000", reader=safe)
    assert ask(b"after", reader=safe).pid != pid


@pytest.mark.parametrize("log", [b"wears", b"leak 2000000000"])
def test_what_the_logs_before_did_to_a_child_is_not_blamed_on_the_next(log) -> None:
    first = ask(b"log")
    second = ask(log)
    assert second.pid != first.pid
    assert second.n_seen == 1


@pytest.mark.skipif(sys.platform != "linux", reason="memory is limited there alone")
@pytest.mark.parametrize(
    ("n_bytes", "limit", "asked", "is_read"),
    [
        (20, 500 * MB, 200 * MB, True),
        (20, 500 * MB, 500 * MB, False),  # a small log never needs so much, whatever the limit
        (2 * MB, 500 * MB, 500 * MB, True),
        (2 * MB, 10 * MB, 500 * MB, False),
    ],
)
def test_memory_is_limited_by_the_size_of_the_log_and_its_limit(n_bytes, limit, asked, is_read):
    log = (b"allocate %d" % asked).ljust(n_bytes)
    if is_read:
        assert ask(log, limit).parts[0] == log
    else:
        assert "rig.max_log_bytes" in refusal(log, limit)


def test_a_child_that_never_ends_is_ended(monkeypatch) -> None:
    pid = ask(b"log").pid
    monkeypatch.setattr(child_process, "_TIME_LIMIT", 0.1)
    start = time.monotonic()
    assert "damaged Fault file: not read in 0.1 s" in refusal(b"sleep")
    assert time.monotonic() - start < 20.0
    assert is_gone(pid)
    # A large log gets a second for each megabyte.
    assert "not read in 1.1 s" in refusal(b"sleep " + bytes(1_000_000))


@pytest.mark.slow
def test_a_child_that_nobody_asks_ends_and_the_next_log_gets_another(monkeypatch) -> None:
    monkeypatch.setattr(child_process, "_IDLE", 0.3)
    with of_their_own():
        pid = ask(b"log").pid
        assert is_gone(pid)
        assert ask(b"log").pid != pid


def test_a_child_that_ended_unseen_is_replaced(monkeypatch) -> None:
    pid = ask(b"log").pid
    os.kill(pid, signal.SIGKILL)
    # As if it had ended after it was looked at.
    monkeypatch.setattr(child_process.Worker, "is_alive", True)
    assert ask(b"log" + bytes(1_000_000)).pid != pid


def test_threads_have_children_of_their_own(children) -> None:
    def many(k: int) -> list[bytes]:
        return [ask(b"log %d %d" % (k, i)).parts[0] for i in range(20)]

    with ThreadPoolExecutor(2) as pool:
        found = list(pool.map(many, range(2)))
    assert found == [[b"log %d %d" % (k, i) for i in range(20)] for k in range(2)]
    assert 1 <= len(children._idle) <= 2


_PARENT = f"""
import os, sys, time
from damperfit.io import ReadOptions
from damperfit.io.child_process import ChildReader, ask_child
from damperfit.io.files import Source
def pid():
    source = Source("a", "a", b"log", "")
    return ask_child({READER!r}, source, ReadOptions())[0]
"""


def parent(code: str, **how) -> subprocess.Popen:
    root = Path(__file__).parents[2]
    return subprocess.Popen(
        [sys.executable, "-W", "error", "-c", _PARENT + code],
        cwd=root.parent,  # the working folder itself would be kept off the import path
        env=os.environ | {"PYTHONPATH": str(root)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        **how,
    )


@pytest.mark.parametrize("is_killed", [False, True])
def test_children_end_with_their_parent(is_killed) -> None:
    with parent("print(pid(), flush=True)\ntime.sleep(60.0)\n") as process:
        child = int(process.stdout.readline())
        if is_killed:
            process.kill()
        else:
            process.terminate()
    assert is_gone(child, 5.0)  # before it would end for want of logs


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork")
def test_a_fork_does_not_read_the_answers_of_its_parents_children() -> None:
    code = """
first = pid()
if os.fork() == 0:
    print(pid() != first, flush=True)
    os._exit(0)
os.wait()
print(pid() == first)
"""
    with parent(code + "print(first)") as process:
        out, err = process.communicate(timeout=60)
    *same, pid = out.split()
    assert (same, err) == (["True", "True"], "")  # nor does the parent's end say anything of it
    assert is_gone(int(pid), 5.0)
