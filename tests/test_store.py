"""Files appear whole or not at all, as a set, whatever ends the run and whoever else writes."""

import errno
import os
import shutil
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from damperfit import store
from damperfit.errors import OutputError
from damperfit.store import file_set, reserved, settle, write_text

OLD = {"a.csv": "old a", "b.csv": "old b", "extra.csv": "old extra", "run.json": "old run"}
NEW = {"a.csv": "new a", "b.csv": "new b", "c.csv": "new c", "run.json": "new run"}
# Everything that changes a folder or waits for the disk.
CALLS = ("open", "fsync", "replace", "rename", "unlink", "rmdir", "close", "mkdir")
posix = pytest.mark.skipif(os.name != "posix", reason="needs fork")


def contents(folder: Path) -> dict[str, str]:
    files = (path for path in folder.iterdir() if path.is_file() and path.name != store._WRITER)
    return {path.name: path.read_text() for path in files}


def first_set(folder: Path, old: dict[str, str]) -> None:
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    for name, text in old.items():
        (folder / name).write_text(text)


def exchange(folder: Path) -> None:
    with file_set(folder) as files:
        for name, text in NEW.items():
            files.path(name).write_text(text)
        files.without("extra.csv")


def test_a_set_replaces_what_was_there(tmp_path):
    first_set(tmp_path / "deep", OLD)
    with file_set(tmp_path / "deep") as files:
        files.path("a.csv").write_text("new a")
        files.path("c.csv").write_text("new c")
        files.without("extra.csv")
        files.without("never there")
        assert contents(tmp_path / "deep") == OLD
    left = {"a.csv": "new a", "b.csv": "old b", "c.csv": "new c", "run.json": "old run"}
    assert contents(tmp_path / "deep") == left
    assert len(list((tmp_path / "deep").iterdir())) == len(left)


@pytest.mark.parametrize("error", [ZeroDivisionError(), OSError(28, "No space left on device")])
def test_an_error_leaves_everything_as_it_was(tmp_path, error):
    first_set(tmp_path / "out", OLD)
    wanted = OutputError if isinstance(error, OSError) else type(error)
    with pytest.raises(wanted) as raised, file_set(tmp_path / "out") as files:
        files.path("a.csv").write_text("new")
        raise error
    assert ("untouched" in str(raised.value)) == isinstance(error, OSError)
    assert contents(tmp_path / "out") == OLD
    assert len(list((tmp_path / "out").iterdir())) == len(OLD)


def test_a_symbolic_link_is_replaced_and_its_target_kept(tmp_path):
    (tmp_path / "elsewhere.txt").write_text("precious")
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "a.txt").symlink_to(tmp_path / "elsewhere.txt")
    write_text(tmp_path / "out" / "a.txt", "new")
    assert contents(tmp_path) == {"elsewhere.txt": "precious"}
    assert not (tmp_path / "out" / "a.txt").is_symlink()


@pytest.mark.parametrize("name", ["../a", "/etc/a", "b/c", "..", ""])
def test_no_name_leads_out_of_the_folder(tmp_path, name):
    with pytest.raises(OutputError), file_set(tmp_path) as files:
        files.path(name)


@posix
@pytest.mark.parametrize("make", [os.mkfifo, os.mkdir])
def test_what_is_no_file_is_never_replaced(tmp_path, make):
    make(tmp_path / "a")
    (tmp_path / "b").write_text("old")
    with pytest.raises(OutputError, match="not a regular file"), file_set(tmp_path) as files:
        files.path("b").write_text("new")
        files.path("a").write_text("new")
    assert contents(tmp_path) == {"b": "old"}


# Death and errors at every call to the system


class Countdown:
    """Calls of `os` that go well until the n-th, which ends in what is asked for."""

    def __init__(self, n, ending):
        self.left, self.ending = n, ending

    def patch(self, set_attribute=setattr):
        for name in CALLS:
            set_attribute(os, name, self._counted(getattr(os, name)))

    def _counted(self, call):
        def counted(*arguments, **how):
            self.left -= 1
            if self.left == 0:
                self.ending(call, arguments, how)
            return call(*arguments, **how)

        return counted


def die_before(call, arguments, how):
    os.kill(os.getpid(), signal.SIGKILL)


def die_after(call, arguments, how):
    try:
        call(*arguments, **how)
    finally:
        os.kill(os.getpid(), signal.SIGKILL)


def in_a_copy(work) -> int:
    """Do it in a copy of this process, which is no test runner; return which."""
    child = os.fork()
    if child == 0:
        try:
            work()
        except BaseException:  # noqa: BLE001
            os._exit(1)
        os._exit(0)
    return child


def in_a_child(work, n, ending):
    """Run in a process that may die on the way; return whether it came to its end."""
    _, status = os.waitpid(in_a_copy(lambda: (Countdown(n, ending).patch(), work())), 0)
    code = os.waitstatus_to_exitcode(status)
    assert code in {0, -signal.SIGKILL}
    return code == 0


def deaths(work, prepare, ending, every=1):
    """Yield after each death of ``work``, at its first call, a later one, ...."""
    for n in range(1, 1000, every):
        prepare()
        if in_a_child(work, n, ending):
            assert n > 12
            return
        yield n
    raise AssertionError("it never came to its end")


def write_more(folder):
    write_text(folder / "z", "z")


@posix
@pytest.mark.parametrize("every", [5, pytest.param(1, marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    ("what_next", "old", "ending"),
    [(settle, OLD, die_before), (write_more, {}, die_after), (settle, {}, die_after)],
)
def test_a_run_killed_at_any_call_leaves_one_whole_set(tmp_path, ending, old, what_next, every):
    folder, found = tmp_path / "results", []
    for n in deaths(lambda: exchange(folder), lambda: first_set(folder, old), ending, every):
        what_next(folder)
        left = contents(folder)
        left.pop("z", None)
        assert left in (old, NEW), n
        found.append(left)
    assert found[0] == old
    assert found[-1] == NEW
    assert found == sorted(found, key=lambda files: files == NEW)  # never back again
    assert not any(path.name.startswith(".") for path in folder.iterdir())


def committed(folder: Path) -> None:
    """Leave a set that was committed and not moved to its place."""

    def die_between():
        store._move_committed = lambda _: os.kill(os.getpid(), signal.SIGKILL)
        exchange(folder)

    first_set(folder, OLD)
    os.waitpid(in_a_copy(die_between), 0)
    assert (folder / store._COMMITTED).exists()
    assert contents(folder) == OLD


@posix
@pytest.mark.parametrize("every", [4, pytest.param(1, marks=pytest.mark.slow)])
def test_ending_a_killed_exchange_may_be_killed_at_any_call_too(tmp_path, every):
    folder = tmp_path / "results"
    for n in deaths(lambda: settle(folder), lambda: committed(folder), die_before, every):
        settle(folder)
        assert contents(folder) == NEW, n


@posix
@pytest.mark.parametrize("old", [OLD, {}], ids=["over results", "into an empty folder"])
def test_a_call_that_fails_leaves_one_set_to_the_next_command(tmp_path, old, monkeypatch):
    folder = tmp_path / "results"

    def fail(call, arguments, how):
        raise OSError(errno.EIO, "Input/output error")

    outcomes = []
    for n in range(1, 1000):
        first_set(folder, old)
        with monkeypatch.context() as patched:
            countdown = Countdown(n, fail)
            countdown.patch(patched.setattr)
            try:
                exchange(folder)
            except OutputError as error:
                text = str(error)
            else:
                text = ""
        is_committed = (folder / store._COMMITTED).exists()
        settle(folder)
        left = contents(folder)
        assert not text or "Input/output error" in text
        assert left == (NEW if not text or is_committed else old), n
        outcomes.append(bool(text))
        if countdown.left > 0:
            break
    assert any(outcomes)
    assert not outcomes[-1]


@posix
def test_a_folder_that_cannot_be_put_right_is_refused_in_one_sentence(tmp_path, monkeypatch):
    committed(tmp_path / "results")
    opened = os.open

    def read_only(path, flags, *more):
        if flags & os.O_CREAT:
            raise OSError(errno.EROFS, "Read-only file system")
        return opened(path, flags, *more)

    with monkeypatch.context() as patched:
        patched.setattr(os, "open", read_only)
        with pytest.raises(OutputError, match=r"Read-only.*make the folder writable"):
            settle(tmp_path / "results")
    settle(tmp_path / "results")
    assert contents(tmp_path / "results") == NEW


# Several writers


@posix
def test_leftovers_of_killed_writers_go_and_those_of_living_ones_stay(tmp_path):
    code = (
        "import os, pathlib, sys\n"
        "from damperfit.store import file_set\n"
        "with file_set(pathlib.Path(sys.argv[1])) as files:\n"
        "    files.path('a.txt').write_text('half')\n"
        "    print('ready', flush=True)\n"
        "    input()\n"
    )
    (tmp_path / ".notes.txt").write_text("a user's own dot file")
    with subprocess.Popen(
        [sys.executable, "-c", code, str(tmp_path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as process:
        process.stdout.readline()
        settle(tmp_path)
        assert len(list(tmp_path.iterdir())) == 3
        process.kill()
    settle(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == [".notes.txt"]


@posix
def test_without_locks_who_looks_leaves_a_writer_alone(tmp_path, monkeypatch):
    def none(*_):
        raise OSError(errno.ENOLCK, "no locks")

    monkeypatch.setattr("fcntl.flock", none)
    with file_set(tmp_path) as files:
        files.path("a.txt").write_text("whole")
        settle(tmp_path)
        write_text(tmp_path / "b.txt", "another's")
    assert contents(tmp_path) == {"a.txt": "whole", "b.txt": "another's"}


@posix
def test_many_writers_at_once_never_mix_their_sets(tmp_path):
    folder, names = tmp_path / "results", [f"{n}.csv" for n in range(8)]

    def write(writer):
        for turn in range(5):
            with file_set(folder) as files:
                for name in names:
                    files.path(name).write_text(f"{writer} {turn}")

    children = [in_a_copy(lambda writer=writer: write(writer)) for writer in "abc"]
    threads = [threading.Thread(target=write, args=(writer,)) for writer in "de"]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert [os.waitpid(child, 0)[1] for child in children] == [0, 0, 0]
    assert sorted(contents(folder)) == sorted(path.name for path in folder.iterdir()) == names
    assert len(set(contents(folder).values())) == 1


def test_a_writer_waits_for_another_and_gives_up_in_one_sentence(tmp_path, monkeypatch):
    (tmp_path / "a.csv").write_text("old")
    entered, leave = threading.Event(), threading.Event()

    def hold():
        with file_set(tmp_path):
            entered.set()
            leave.wait(10.0)

    thread = threading.Thread(target=hold)
    thread.start()
    entered.wait(10.0)
    monkeypatch.setattr(store, "_PATIENCE", 0.2)
    with pytest.raises(OutputError, match="another run"):
        write_text(tmp_path / "a.csv", "new")
    assert (tmp_path / "a.csv").read_text() == "old"
    threading.Timer(0.1, leave.set).start()
    monkeypatch.setattr(store, "_PATIENCE", 10.0)
    write_text(tmp_path / "a.csv", "new")
    thread.join()
    assert contents(tmp_path) == {"a.csv": "new"}


def test_a_folder_is_held_by_one_run_alone(tmp_path, monkeypatch):
    monkeypatch.setattr(store, "_RUN_PATIENCE", 0.1)
    folder = tmp_path / "deep" / "results"
    with reserved(folder):
        with pytest.raises(OutputError, match="at work there"), reserved(folder):
            raise AssertionError
        write_text(folder / "a.csv", "whole")  # its own, or another command's
        settle(folder)
        with pytest.raises(OutputError, match="at work there"), reserved(folder):
            raise AssertionError
    assert contents(folder) == {"a.csv": "whole"}
    with reserved(folder):
        pass


def test_a_folder_in_which_nothing_was_written_is_gone_again(tmp_path):
    with pytest.raises(ZeroDivisionError), reserved(tmp_path / "deep" / "results"):
        _ = 1 / 0
    assert list(tmp_path.iterdir()) == []


@posix
def test_a_killed_run_holds_nothing(tmp_path):
    folder = tmp_path / "results"

    def die_inside():
        with reserved(folder):
            os._exit(9)

    os.waitpid(in_a_copy(die_inside), 0)
    with reserved(folder):
        write_text(folder / "a.csv", "whole")
    assert [path.name for path in folder.iterdir()] == ["a.csv"]
