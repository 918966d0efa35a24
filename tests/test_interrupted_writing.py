"""Writing ended at every call to the system, by death or by an error: one set stands, whole."""

from __future__ import annotations

import errno
import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from damperfit.atomic import FileSet, file_set, reserved, settle, write_text
from damperfit.atomic import owner as owners
from damperfit.atomic.journal import JOURNAL
from damperfit.errors import OutputError

pytestmark = pytest.mark.skipif(os.name != "posix", reason="needs fork")

OLD = {"a.csv": "old a", "b.csv": "old b", "extra.csv": "old extra", "run.json": "old run"}
NEW = {"a.csv": "new a", "b.csv": "new b", "c.csv": "new c", "run.json": "new run"}
# Everything that changes a folder or waits for the disk.
CALLS = ("open", "fsync", "replace", "rename", "link", "unlink", "utime", "close", "mkdir")


def contents(folder: Path) -> dict[str, str]:
    return {path.name: path.read_text() for path in folder.iterdir()}


def but_for_the_lock(folder: Path) -> dict[str, str]:
    """A killed run leaves its lock file, which the next takes and removes."""
    return {name: text for name, text in contents(folder).items() if name != ".damperfit-lock"}


def first_set(folder: Path, old: dict[str, str]) -> None:
    folder.mkdir()
    for name, text in old.items():
        (folder / name).write_text(text)


def exchange(folder: Path) -> None:
    with file_set(folder) as files:
        for name, text in NEW.items():
            files.path(name).write_text(text)
        files.without("extra.csv")


class Countdown:
    """Calls of `os` that go well until the n-th, which ends in what is asked for."""

    def __init__(self, n: int, ending) -> None:
        self.left, self.ending, self.seen = n, ending, []

    def patch(self) -> None:
        for name in CALLS:
            setattr(os, name, self._counted(name, getattr(os, name)))

    def _counted(self, name, call):
        def counted(*arguments, **how):
            self.left -= 1
            self.seen.append(name)
            if self.left == 0:
                self.ending(call, arguments, how)
            return call(*arguments, **how)

        return counted


def die_before(call, arguments, how) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def die_after(call, arguments, how) -> None:
    try:
        call(*arguments, **how)
    finally:
        os.kill(os.getpid(), signal.SIGKILL)


def in_a_child(work, n: int, ending) -> bool:
    """Run in a process that may die on the way; return whether it came to its end."""
    child = os.fork()
    if child == 0:
        Countdown(n, ending).patch()
        try:
            work()
        except BaseException:  # noqa: BLE001 - a child must not run the tests of its parent
            os._exit(1)
        os._exit(0)
    _, status = os.waitpid(child, 0)
    if os.WIFSIGNALED(status):
        assert os.WTERMSIG(status) == signal.SIGKILL
        return False
    assert os.WEXITSTATUS(status) == 0
    return True


def deaths(work, prepare, ending, every=1):
    """Yield after each death of ``work``, at its first call, its second or a later one, ...."""
    for n in range(1, 1000, every):
        prepare()
        if in_a_child(work, n, ending):
            assert n > 20  # it was looked at
            return
        yield n
    raise AssertionError("it never came to its end")


def _written_into(folder):
    write_text(folder / "z", "z")


# Each of them once, at every sixth call; all calls, and the rest of the eight, are slow.
_KILLED = [(settle, OLD, die_before), (_written_into, {}, die_after)]
_ALSO = [*_KILLED, (settle, OLD, die_after), (settle, {}, die_before), (settle, {}, die_after)]
_ALSO += [(_written_into, OLD, die_before), (_written_into, OLD, die_after)]
_ALSO += [(_written_into, {}, die_before)]


@pytest.mark.parametrize(
    ("what_next", "old", "ending", "every"),
    [
        *((*one, 6) for one in _KILLED),
        *(pytest.param(*one, 1, marks=pytest.mark.slow) for one in _ALSO),
    ],
)
def test_a_run_killed_at_any_call_leaves_one_whole_set(
    tmp_path, ending, old, what_next, every
) -> None:
    folder = tmp_path / "results"

    def prepare() -> None:
        shutil.rmtree(folder, ignore_errors=True)
        first_set(folder, old)

    found = []
    for n in deaths(lambda: exchange(folder), prepare, ending, every):
        what_next(folder)
        left = contents(folder)
        left.pop("z", None)
        assert left in (old, NEW), n
        found.append(left)
    assert found[0] == old
    assert found[-1] == NEW
    assert found == sorted(found, key=lambda one: one == NEW)  # never back again


# Every sixth call of each state, another sixth in the next one; the others are slow.
@pytest.mark.parametrize(
    ("old", "every"),
    [
        pytest.param(OLD, 9, id="over results"),
        pytest.param(OLD, 1, id="over results, at each", marks=pytest.mark.slow),
        pytest.param({}, 1, id="into an empty folder", marks=pytest.mark.slow),
    ],
)
def test_putting_back_may_be_killed_at_any_call_too(tmp_path, old, every) -> None:
    folder, halves = tmp_path / "results", tmp_path / "halves"
    halves.mkdir()

    def prepare() -> None:
        shutil.rmtree(folder, ignore_errors=True)
        first_set(folder, old)

    # Each state of the folder in which a journal stands, once.
    for n in deaths(lambda: exchange(folder), prepare, die_before, min(every, 2)):
        if (folder / JOURNAL).exists():
            folder.rename(halves / str(n))
    known = {}
    for half in sorted(halves.iterdir()):
        state = tuple(sorted(path.name for path in half.iterdir()))
        known.setdefault(tuple(len(name) for name in state), half)
    assert len(known) >= (4 if old else 3)
    for k, half in enumerate(known.values()):
        for n in range(1 + k % every, 100, every):
            shutil.rmtree(folder, ignore_errors=True)
            _copied(half, folder)
            is_done = in_a_child(lambda: settle(folder), n, die_before)
            settle(folder)
            assert contents(folder) == old, (half.name, n)
            if is_done:
                break
        assert n > 5


def _copied(source: Path, target: Path) -> None:
    """Copy a folder with its hard links, which tell whether a file was replaced."""
    target.mkdir()
    known: dict[int, Path] = {}
    for path in source.iterdir():
        copy = target / path.name
        first = known.setdefault(path.stat().st_ino, copy)
        if first is copy:
            shutil.copy2(path, copy)
        else:
            copy.hardlink_to(first)


@pytest.mark.parametrize("old", [OLD, {}], ids=["over results", "into an empty folder"])
def test_a_call_that_fails_undoes_all(tmp_path, old, monkeypatch) -> None:
    folder = tmp_path / "results"

    def fail(call, arguments, how) -> None:
        raise OSError(errno.EIO, "Input/output error")

    n, ends = 0, []
    while True:
        n += 1
        shutil.rmtree(folder, ignore_errors=True)
        first_set(folder, old)
        with monkeypatch.context() as patched:
            for name in CALLS:
                patched.setattr(os, name, getattr(os, name))
            countdown = Countdown(n, fail)
            countdown.patch()
            error = None
            try:
                exchange(folder)
            except OutputError as raised:
                error = raised
        is_hit = countdown.left <= 0
        left = contents(folder)
        if error is not None:
            assert "Input/output error" in str(error)
            assert left == old, (n, countdown.seen)
            assert str(error).endswith("earlier results there are untouched") == bool(old)
        else:  # the disk's flush of a folder, or what is removed at the end, may fail
            shown = {name: text for name, text in left.items() if not name.startswith(".")}
            assert shown == NEW, (n, countdown.seen)
        ends.append(error is None)
        if not is_hit:
            break
    assert not all(ends)


def test_where_putting_back_fails_too_the_next_command_does_it(tmp_path, monkeypatch) -> None:
    folder = tmp_path / "results"
    first_set(folder, OLD)
    replace = os.replace

    def refuse(source, target) -> None:
        if Path(target).name == "b.csv":
            raise OSError(errno.EIO, "Input/output error")
        replace(source, target)

    monkeypatch.setattr(os, "replace", refuse)
    with pytest.raises(OutputError, match="the next command that looks there puts the earlier"):
        exchange(folder)
    monkeypatch.undo()
    assert JOURNAL in contents(folder)
    settle(folder)
    assert contents(folder) == OLD


def _interrupted(folder: Path) -> None:
    """Leave a folder in which one file of two is exchanged."""
    first_set(folder, OLD)

    class AtB(Countdown):
        def _counted(self, name, call):
            def counted(*arguments, **how):
                if name == "replace" and Path(arguments[1]).name == "b.csv":
                    die_before(call, arguments, how)
                return call(*arguments, **how)

            return counted

    child = os.fork()
    if child == 0:
        AtB(0, None).patch()
        exchange(folder)
        os._exit(0)
    os.waitpid(child, 0)
    assert (folder / "a.csv").read_text() == "new a"
    assert (folder / "b.csv").read_text() == "old b"


def _as_of(folder: Path, age: float, *, host: str = "0123456789ab") -> None:
    """Let a broken exchange be that of another host, and so old."""
    journal = folder / JOURNAL
    told = json.loads(journal.read_text())
    mine = told["owner"]
    other = f"{host}-{mine.partition('-')[2]}"
    for path in list(folder.iterdir()):
        if mine in path.name:
            path.rename(folder / path.name.replace(mine, other))
    journal.write_text(json.dumps(told | {"owner": other}))
    written = time.time() - age
    os.utime(journal, (written, written))


@pytest.mark.parametrize(("age", "is_put_back"), [(24 * 3600 - 60, False), (24 * 3600 + 60, True)])
def test_another_hosts_exchange_is_left_alone_for_a_day(
    tmp_path, monkeypatch, age, is_put_back
) -> None:
    monkeypatch.setattr("damperfit.atomic.recovery._PATIENCE", 0.1)
    folder = tmp_path / "results"
    _interrupted(folder)
    _as_of(folder, age)
    before = but_for_the_lock(folder)
    if is_put_back:
        settle(folder)
        assert contents(folder) == OLD
        return
    for work in (settle, exchange):
        with pytest.raises(OutputError, match="begun on another host 1439 min ago"):
            work(folder)
        assert contents(folder) == before


def test_a_journal_that_is_none_is_refused_and_nothing_is_lost(tmp_path) -> None:
    folder = tmp_path / "results"
    _interrupted(folder)
    told = json.loads((folder / JOURNAL).read_text())
    for damaged in (
        "",
        "{}",
        "[]",
        json.dumps(told | {"format": 2}),
        json.dumps(told | {"created": {"../a": 1}}),
        json.dumps(told | {"replaced": {"a": "../b"}}),
        json.dumps(told | {"owner": "../../x"}),
    ):
        (folder / JOURNAL).write_text(damaged)
        before = but_for_the_lock(folder)
        for work in (settle, exchange):
            with pytest.raises(OutputError, match=r"cannot be read .*; run again into another"):
                work(folder)
        assert contents(folder) == before


def test_what_somebody_put_there_since_is_not_taken_for_a_file_of_the_set(tmp_path) -> None:
    folder = tmp_path / "results"
    _interrupted(folder)
    (folder / "c.csv").write_text("my own")  # the killed run had not come to this one
    settle(folder)
    assert contents(folder) == OLD | {"c.csv": "my own"}


def test_a_folder_that_cannot_be_put_right_is_refused_in_one_sentence(
    tmp_path, monkeypatch
) -> None:
    folder = tmp_path / "results"
    _interrupted(folder)
    opened = os.open

    def read_only(path, flags, *more):
        if flags & os.O_CREAT:
            raise OSError(errno.EROFS, "Read-only file system")
        return opened(path, flags, *more)

    monkeypatch.setattr(os, "open", read_only)
    with pytest.raises(OutputError, match=r"interrupted there.*Read-only.*; make the folder"):
        settle(folder)
    (folder / JOURNAL).unlink()
    settle(folder)  # with nothing to put back there is nothing to say


# Temporary files of others


def _left_behind(folder: Path, owner: str, age: float) -> Path:
    path = folder / f".{owner}-0.damperfit-new"
    path.write_text("half")
    written = time.time() - age
    os.utime(path, (written, written))
    return path


@pytest.mark.parametrize(("age", "stays"), [(24 * 3600 - 60, True), (24 * 3600 + 60, False)])
@pytest.mark.parametrize("name", [None, ".parameters.csv.4242.damperfit-new"])
def test_files_of_another_host_stay_for_a_day(tmp_path, age, stays, name) -> None:
    path = _left_behind(tmp_path, "0123456789ab-1-1-1", age)
    if name:
        path = path.rename(tmp_path / name)  # as earlier versions named them
    write_text(tmp_path / "b.txt", "whole")
    assert path.exists() == stays


def test_files_of_this_host_stay_as_long_as_their_process(tmp_path) -> None:
    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE) as process:
        mine = owners.new_owner()
        started = owners._started(process.pid)
        alive = _left_behind(tmp_path, f"{mine.host}-{process.pid}-{started}-1", 48 * 3600)
        # The same number, given to another process since.
        reused = _left_behind(tmp_path, f"{mine.host}-{process.pid}-{started + 1}-1", 0.0)
        write_text(tmp_path / "b.txt", "whole")
        assert alive.exists()
        assert not reused.exists() or started == 0
        process.communicate(b"\n")
    write_text(tmp_path / "b.txt", "whole")
    assert not alive.exists()


def test_two_sets_of_one_process_have_files_of_their_own(tmp_path) -> None:
    first, second = FileSet(tmp_path), FileSet(tmp_path)
    assert first.path("a.csv") != second.path("a.csv")
    first.path("a.csv").write_text("first")
    second.path("a.csv").write_text("second")
    first.commit()
    assert second.path("a.csv").read_text() == "second"  # alive, if of this process
    second.commit()
    first.discard()
    second.discard()
    assert contents(tmp_path) == {"a.csv": "second"}


# Several writers


def test_many_writers_at_once_never_mix_their_sets(tmp_path) -> None:
    folder = tmp_path / "results"
    names = [f"{n}.csv" for n in range(8)]

    def write(who: str) -> None:
        for turn in range(5):
            with file_set(folder) as files:
                for name in names:
                    files.path(name).write_text(f"{who} {turn}")

    children = []
    for who in "abc":
        child = os.fork()
        if child == 0:
            try:
                write(who)
            except BaseException:  # noqa: BLE001
                os._exit(1)
            os._exit(0)
        children.append(child)
    threads = [threading.Thread(target=write, args=(who,)) for who in "de"]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert [os.waitpid(child, 0)[1] for child in children] == [0, 0, 0]
    written = contents(folder)
    assert sorted(written) == names
    assert len(set(written.values())) == 1


def test_a_writer_waits_for_another_and_says_so_when_it_takes_too_long(
    tmp_path, monkeypatch
) -> None:
    from damperfit.atomic.recovery import recovered

    (tmp_path / "a.csv").write_text("old")
    entered, leave = threading.Event(), threading.Event()

    def hold() -> None:
        with recovered(tmp_path):
            entered.set()
            leave.wait(10.0)

    thread = threading.Thread(target=hold)
    thread.start()
    entered.wait(10.0)
    monkeypatch.setattr("damperfit.atomic.recovery._PATIENCE", 0.2)
    with pytest.raises(OutputError, match=r"another run .* writing there for 0.2 s; wait"):
        write_text(tmp_path / "a.csv", "new")
    assert (tmp_path / "a.csv").read_text() == "old"
    threading.Timer(0.1, leave.set).start()
    monkeypatch.setattr("damperfit.atomic.recovery._PATIENCE", 10.0)
    write_text(tmp_path / "a.csv", "new")
    thread.join()
    assert contents(tmp_path) == {"a.csv": "new"}


def test_a_folder_is_held_by_one_run_alone(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr("damperfit.atomic.recovery._RUN_PATIENCE", 0.1)
    folder = tmp_path / "deep" / "results"
    with reserved(folder):
        at_work = r"another run .* at work there; wait for it"
        with pytest.raises(OutputError, match=at_work), reserved(folder):
            raise AssertionError
        write_text(folder / "a.csv", "whole")  # its own, or another command's
        settle(folder)
        with pytest.raises(OutputError, match="at work there"), reserved(folder):
            raise AssertionError
    assert contents(folder) == {"a.csv": "whole"}
    with reserved(folder):
        pass


def test_a_folder_in_which_nothing_came_to_stand_is_gone_again(tmp_path) -> None:
    with pytest.raises(ZeroDivisionError), reserved(tmp_path / "deep" / "results"):
        _ = 1 / 0
    assert list(tmp_path.iterdir()) == []


def test_a_killed_run_holds_nothing(tmp_path) -> None:
    folder = tmp_path / "results"
    child = os.fork()
    if child == 0:
        with reserved(folder):
            os._exit(9)
    os.waitpid(child, 0)
    assert list(contents(folder)) == [".damperfit-run"]
    with reserved(folder):
        write_text(folder / "a.csv", "whole")
    assert contents(folder) == {"a.csv": "whole"}


# Every fifth call; each of them is slow.
@pytest.mark.parametrize("every", [7, pytest.param(1, marks=pytest.mark.slow)])
@pytest.mark.parametrize("lacking", ["locks", "links"])
def test_a_file_system_without_locks_or_links_keeps_the_promise(
    tmp_path, monkeypatch, every, lacking
) -> None:
    import fcntl

    def refuse(*_, **__):
        raise OSError(errno.ENOTSUP, "Operation not supported")

    monkeypatch.setattr(*((fcntl, "flock") if lacking == "locks" else (os, "link")), refuse)
    folder = tmp_path / "results"

    def prepare() -> None:
        shutil.rmtree(folder, ignore_errors=True)
        first_set(folder, OLD)

    for n in deaths(lambda: exchange(folder), prepare, die_before, every):
        settle(folder)
        assert contents(folder) in (OLD, NEW), n
