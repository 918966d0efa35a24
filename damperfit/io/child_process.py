"""Reading in a process of its own, for libraries that may take the whole program with them.

On damaged bytes asammdf ends by a segmentation fault, HDF5 takes all memory there is, and a small
workbook may be written out to gigabytes. In a child that costs one log. A child gets the bytes on
its standard input and answers with one line of JSON and bytes. It reads one log after the other,
as loading a library takes longer than reading a log, within limits of memory and time for each.

Traps. Damaged bytes may spoil memory without ending the process: a child that has refused a log is
not asked again. What a child refuses for want of memory, or dies of, may come from the logs before:
then a new one is asked. A child ends when nobody asks for a while, and with its parent.
"""

from __future__ import annotations

import atexit
import importlib
import importlib.util
import json
import logging
import os
import signal
import subprocess
import sys
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from threading import Event, Lock, Timer
from typing import IO, TYPE_CHECKING, Any

from damperfit.errors import LogError
from damperfit.io.channels import visible
from damperfit.own_process import child_environment

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from damperfit.io.files import Source
    from damperfit.io.options import ReadOptions

__all__ = [
    "ChildAnswer",
    "ChildReader",
    "ask_child",
    "check_library",
    "check_size",
    "load_library",
    "refusing_damage",
    "serve",
]


# Libraries that read foreign formats: loaded when a log needs them, and kept to one exception.


def check_library(module: str, *, extra: str, reads: str, name: str) -> None:
    """Refuse a log whose library is not installed, without loading it; as `load_library`.

    Raises
    ------
    LogError
        The library is not there; names the command that installs it.
    """
    found = None
    with suppress(ImportError, ValueError):
        found = importlib.util.find_spec(module)
    if found is None:
        raise LogError(_missing(extra, reads, name))


def _missing(extra: str, reads: str, name: str) -> str:
    return f"{name}: {reads} needs one more library: pip install 'damperfit[{extra}]'"


def load_library(module: str, *, extra: str, reads: str, name: str) -> Any:
    """Return a library that is not installed with the program itself.

    Parameters
    ----------
    module : str
        As in "nptdms".
    extra : str
        Name of the optional dependency in the package.
    reads : str
        Format, for the message.
    name : str
        Log, for the message.

    Raises
    ------
    LogError
        The library is not there; names the command that installs it.
    """
    try:
        library = importlib.import_module(module)
    except ImportError as error:
        raise LogError(_missing(extra, reads, name)) from error
    # It may tell its own story on stderr, with bytes of the log in it.
    for name_of_logger in (module, *logging.root.manager.loggerDict):
        if name_of_logger.partition(".")[0] == module:
            logging.getLogger(name_of_logger).setLevel(logging.CRITICAL + 1)
    return library


@contextmanager
def refusing_damage(reads: str, *, name: str = "") -> Iterator[None]:
    """Turn whatever a library raises over damaged bytes into one line.

    Raises
    ------
    LogError
        The block raised anything but LogError and MemoryError.
    """
    try:
        yield
    except (LogError, MemoryError):
        raise
    except Exception as error:  # npTDMS alone raises five kinds, from KeyError to struct.error
        first = (str(error).splitlines() or [""])[0]
        reason = visible(first or type(error).__name__, limit=120)
        where = f"{name}: " if name else ""
        raise LogError(f"{where}damaged {reads}: {reason}; copy the log again") from error


def check_size(n_bytes: int, *, limit: int, what: str, name: str = "") -> None:
    """Refuse what would need more memory than the limit.

    Raises
    ------
    LogError
        n_bytes is more than the limit, or negative.
    """
    if not 0 <= n_bytes <= limit:
        where = f"{name}: " if name else ""
        raise LogError(
            f"{where}{what} claims {n_bytes} bytes, more than the limit of {limit} "
            "(rig.max_log_bytes)"
        )


_TIME_LIMIT = 60  # s for a log, and 1 s for each megabyte; libraries take seconds to load
_IDLE = 10.0  # s after which a child ends that nobody asks
_OWN_MEMORY = 1 << 30  # bytes that Python and the library take before they see a log
_OUT_OF_MEMORY = "memory"
# This damperfit, wherever it is: no folder is added to those that modules are looked for in.
_CHILD = """
import importlib.util, sys
spec = importlib.util.spec_from_file_location("damperfit", sys.argv[1])
sys.modules["damperfit"] = package = importlib.util.module_from_spec(spec)
spec.loader.exec_module(package)
from damperfit.io.child_process import serve
serve()
"""


@dataclass(frozen=True, slots=True)
class ChildReader:
    """How a format is read by a library in a child.

    Attributes
    ----------
    reads, extra, library : str
        Format for messages; the extra of the package that brings the library; its module.
    answer : str
        ``module:function`` of (data, limit in bytes) -> `ChildAnswer`, called in the child.
    is_memory_safe : bool
        Damaged bytes cannot spoil the child's memory, so that it goes on after a refusal.
    """

    reads: str
    extra: str
    library: str
    answer: str
    is_memory_safe: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class ChildAnswer:
    """What a child found in a log: `said`, which JSON can hold, and `parts`, which it cannot."""

    said: Any
    parts: Sequence[bytes]


def ask_child(reader: ChildReader, source: Source, options: ReadOptions) -> ChildAnswer:
    """Return what a child finds in a log.

    Raises
    ------
    LogError
        The library is not installed; the child refuses the log, or dies of it.
    """
    check_library(reader.library, extra=reader.extra, reads=reader.reads, name=source.name)
    while True:
        child = _CHILDREN.take()
        outcome = child.ask(reader.answer, source.data, options.max_bytes)
        if isinstance(outcome, ChildAnswer):
            _CHILDREN.give_back(child)
            return outcome
        if reader.is_memory_safe and outcome.is_judged:
            _CHILDREN.give_back(child)
        else:
            child.end()
        if outcome.is_judged or outcome.is_late or not child.is_worn:
            raise LogError(f"{_reason(outcome, reader.reads, child.seconds)}", subject=source.name)


@dataclass(frozen=True, slots=True)
class _Failure:
    """Why a log has no answer: the child's sentence, or how the child ended."""

    refusal: str = ""
    code: int = 0
    is_late: bool = False

    @property
    def is_judged(self) -> bool:
        """Whether the log itself was refused, and not for want of memory."""
        return self.refusal not in {"", _OUT_OF_MEMORY}


def _reason(failure: _Failure, reads: str, seconds: float) -> str:
    if failure.refusal == _OUT_OF_MEMORY:
        return f"{reads}: needs more memory than the limit (rig.max_log_bytes) allows"
    if failure.refusal:
        return failure.refusal
    if failure.is_late:
        return f"damaged {reads} file: not read in {seconds:g} s"
    ending = f"code {failure.code}"
    with suppress(ValueError):
        ending = signal.Signals(-failure.code).name
    return (
        f"damaged {reads} file: its reader ended by {ending}; copy the log again, or raise the "
        "limit of memory (rig.max_log_bytes)"
    )


class _Child:
    """A process that reads logs, one after the other."""

    def __init__(self) -> None:
        package = str(Path(__file__).resolve().parents[1] / "__init__.py")
        self._process = subprocess.Popen(  # noqa: S603  # our own command; the log comes as bytes
            [sys.executable, "-P", "-c", _CHILD, package],
            env=child_environment(),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )
        self._n_asked = 0
        self.seconds = 0.0

    @property
    def is_alive(self) -> bool:
        return self._process.poll() is None

    def ask(self, answer: str, data: bytes, limit: int) -> ChildAnswer | _Failure:
        """Return the answer, or why there is none; then the child is not to be asked again."""
        self._n_asked += 1
        self.seconds = _TIME_LIMIT + len(data) // 1_000_000
        head = json.dumps({"answer": answer, "limit": limit, "n_bytes": len(data)})
        is_late = Event()
        timer = Timer(self.seconds, self._stop, (is_late,))
        timer.start()
        try:
            to_child = self._pipe(self._process.stdin)
            to_child.write(head.encode() + b"\n")
            to_child.write(data)
            to_child.flush()
            return self._answer()
        except (OSError, ValueError):  # it is gone
            with suppress(subprocess.TimeoutExpired):
                self._process.wait(1.0)
            self.end()
            return _Failure(code=self._process.returncode, is_late=is_late.is_set())
        finally:
            timer.cancel()

    def _stop(self, is_late: Event) -> None:
        is_late.set()
        self._process.kill()

    def _answer(self) -> ChildAnswer | _Failure:
        out = self._pipe(self._process.stdout)
        said = json.loads(out.readline())
        if "refused" in said:
            return _Failure(refusal=said["refused"])
        parts = [out.read(n) for n in said["lengths"]]
        if [len(part) for part in parts] != said["lengths"]:
            raise OSError
        return ChildAnswer(said["said"], parts)

    @staticmethod
    def _pipe(pipe: IO[bytes] | None) -> IO[bytes]:
        assert pipe is not None
        return pipe

    @property
    def is_worn(self) -> bool:
        """Whether it has read logs before this one, which may be why it failed."""
        return self._n_asked > 1

    def end(self) -> None:
        self._process.kill()
        with suppress(OSError, ValueError):
            self._process.communicate()


class _Children:
    """Children that wait to be asked, for the threads that read logs."""

    def __init__(self) -> None:
        self._idle: list[_Child] = []
        self._of_others: list[_Child] = []
        self._lock = Lock()

    def take(self) -> _Child:
        with self._lock:
            while self._idle:
                child = self._idle.pop()
                if child.is_alive:
                    return child
                child.end()
        return _Child()

    def give_back(self, child: _Child) -> None:
        with self._lock:
            self._idle.append(child)

    def end(self) -> None:
        with self._lock:
            while self._idle:
                self._idle.pop().end()

    def forget(self) -> None:
        """Leave the children to the process that has started them, in a fork of it."""
        self._of_others += self._idle
        self._idle, self._lock = [], Lock()


_CHILDREN = _Children()
atexit.register(_CHILDREN.end)
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_CHILDREN.forget)


def serve() -> None:
    """Answer what is asked on standard input, in the child."""
    out = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # a library that prints would spoil the answer
    for name in ("SIGINT", "SIGHUP"):  # the parent decides what is left undone
        with suppress(ValueError, OSError, AttributeError):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
    while True:
        # Not by a wait on the pipe, which not every system can.
        idle = Timer(_IDLE, os._exit, (0,))
        idle.daemon = True
        idle.start()
        head = sys.stdin.buffer.readline()
        idle.cancel()
        if not head:
            os._exit(0)  # what a library does at exit is of no interest
        asked = json.loads(head)
        data = sys.stdin.buffer.read(asked["n_bytes"])
        if len(data) < asked["n_bytes"]:
            os._exit(0)
        _limit_memory(_OWN_MEMORY + 3 * asked["limit"])
        _send(asked["answer"], data, asked["limit"], out)


def _send(answer: str, data: bytes, limit: int, out: IO[bytes]) -> None:
    try:
        module, _, function = answer.partition(":")
        found = getattr(importlib.import_module(module), function)(data, limit)
        said = {"said": found.said, "lengths": [len(part) for part in found.parts]}
        out.write(json.dumps(said).encode() + b"\n")
        out.writelines(found.parts)
    except LogError as error:
        out.write(json.dumps({"refused": str(error)}).encode() + b"\n")
    except MemoryError:
        out.write(json.dumps({"refused": _OUT_OF_MEMORY}).encode() + b"\n")
    out.flush()


def _limit_memory(n_bytes: int) -> None:
    with suppress(ImportError, ValueError, OSError):  # Windows has none
        import resource

        most = min(n_bytes, sys.maxsize)
        _, hard = resource.getrlimit(resource.RLIMIT_DATA)
        resource.setrlimit(resource.RLIMIT_DATA, (most, hard))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
