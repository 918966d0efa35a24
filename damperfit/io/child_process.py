"""Reading in a process of its own, for libraries that may take the whole program with them.

On damaged bytes asammdf ends by a segmentation fault, HDF5 takes all memory there is, and a small
workbook may be written out to gigabytes. In a child that costs one log. A child gets the bytes on
its standard input and answers with one line of JSON and bytes. It reads one log after the other,
as loading a library takes longer than reading a log, within limits of memory and time for each.

Traps. Damaged bytes may corrupt memory without ending the process: a child that has refused a log
is not used again. If a child dies or lacks memory, earlier logs may be the cause: a new one tries
again. A child ends when it is idle for a while, and with its parent.
"""

import atexit
import importlib
import importlib.util
import json
import logging
import os
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Event, Lock, Timer
from typing import Any, NamedTuple

from damperfit.errors import LogError
from damperfit.io.columns import visible
from damperfit.io.files import Source
from damperfit.io.options import ReadOptions
from damperfit.own_process import child_environment

_TIME_LIMIT = 60  # s for a log, and 1 s for each megabyte; libraries take seconds to load
_IDLE = 10.0  # s after which an idle child ends
_OWN_MEMORY = 320_000_000  # bytes that Python and the library take before they see a log
_LEAST, _UNPACKED = 100_000_000, 400  # bytes that any log may take, and each of its bytes
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


def load_library(module: str, *, extra: str, reads: str) -> Any:
    """Return a library that an extra brings, or name the command that installs it."""
    try:
        library = importlib.import_module(module)
    except ImportError as error:
        raise _missing(extra, reads) from error
    # Its own messages on stderr would hold bytes of the log.
    for logger in (module, *logging.root.manager.loggerDict):
        if logger.partition(".")[0] == module:
            logging.getLogger(logger).setLevel(logging.CRITICAL + 1)
    return library


def _missing(extra: str, reads: str) -> LogError:
    return LogError(
        f"{reads} needs one more library: pip install 'damperfit[{extra}]'",
        code="missing-library",
    )


@contextmanager
def refusing_damage(reads: str) -> Iterator[None]:
    """Turn whatever a library raises over damaged bytes into a LogError of one line."""
    try:
        yield
    except (LogError, MemoryError):
        raise
    except Exception as error:  # npTDMS alone raises five kinds, from KeyError to struct.error
        first = (str(error).splitlines() or [""])[0]
        reason = visible(first or type(error).__name__, limit=120)
        raise LogError(f"damaged {reads}: {reason}; copy the log again", code="damaged") from error


def check_size(n_bytes: int, *, limit: int, what: str) -> None:
    """Refuse more bytes than the limit, or a negative number."""
    if not 0 <= n_bytes <= limit:
        raise LogError(
            f"{what} claims {n_bytes} bytes, more than the limit of {limit} (rig.max_log_bytes)",
            code="too-large",
        )


class ChildReader(NamedTuple):
    """How a format is read by a library in a child."""

    reads: str  # the format, for messages
    extra: str  # of the package, that brings the library
    library: str  # its module
    answer: str  # ``module:function`` of (data, limit in bytes) -> `ChildAnswer`, in the child
    is_memory_safe: bool = False  # damaged bytes cannot spoil it: it goes on after a refusal


class ChildAnswer(NamedTuple):
    """What a child read from a log: `content`, which JSON can hold, and `parts`, other bytes."""

    content: Any
    parts: Sequence[bytes]


class _EndedError(Exception):
    """A child has no answer to give, and is not to be asked again."""


def ask_child(reader: ChildReader, source: Source, options: ReadOptions) -> ChildAnswer:
    """Return the answer of a child to a log."""
    with suppress(ImportError, ValueError):
        if importlib.util.find_spec(reader.library) is None:
            raise _missing(reader.extra, reader.reads)
    while True:
        child = _CHILDREN.take()
        is_kept = False
        try:
            answer = child.ask(reader, source.data, options.max_bytes)
            is_kept = True
        except LogError:
            is_kept = reader.is_memory_safe
            raise
        except _EndedError as error:
            if child.n_asked == 1 or child.is_late.is_set():  # another one would not do better
                raise LogError(f"{error}", code="damaged") from error
        else:
            return answer
        finally:
            if is_kept:
                _CHILDREN.give_back(child)
            else:
                child.end()


class _Child:
    """A process that reads logs, one after the other."""

    def __init__(self) -> None:
        package = str(Path(__file__).resolve().parents[1] / "__init__.py")
        self._process = subprocess.Popen(  # noqa: S603  # our own command; the log comes as bytes
            [sys.executable, "-P", "-c", _CHILD, package],
            # Its threads would each take memory from what a log may have.
            env={**child_environment(), "OPENBLAS_NUM_THREADS": "1"},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )
        self.n_asked = 0
        self.is_late = Event()

    @property
    def is_alive(self) -> bool:
        return self._process.poll() is None

    def ask(self, reader: ChildReader, data: bytes, limit: int) -> ChildAnswer:
        """Return the answer; raises the LogError that the child met, or _EndedError."""
        self.n_asked += 1
        seconds = _TIME_LIMIT + len(data) // 1_000_000
        head = json.dumps({"answer": reader.answer, "limit": limit, "n_bytes": len(data)})
        timer = Timer(seconds, self._stop)
        timer.start()
        try:
            to_child, out = self._process.stdin, self._process.stdout
            assert to_child is not None
            assert out is not None
            to_child.write(head.encode() + b"\n")
            to_child.write(data)
            to_child.flush()
            reply = json.loads(out.readline())
            parts = [out.read(n) for n in reply.get("lengths", ())]
            is_whole = [len(part) for part in parts] == reply.get("lengths", [])
        except (OSError, ValueError):
            reply, parts, is_whole = {}, [], False
        finally:
            timer.cancel()
        if not is_whole:  # it is gone
            with suppress(subprocess.TimeoutExpired):
                self._process.wait(1.0)
            self.end()
            reason = f"not read in {seconds:g} s"
            if not self.is_late.is_set():
                code = self._process.returncode
                with suppress(ValueError):
                    code = signal.Signals(-code).name
                reason = (
                    f"its reader ended by {code if isinstance(code, str) else f'code {code}'}; "
                    "copy the log again, or raise the limit of memory (rig.max_log_bytes)"
                )
            raise _EndedError(f"damaged {reader.reads} file: {reason}")
        if reply.get("refused") == _OUT_OF_MEMORY:
            what = f"{reader.reads}: needs more memory than the limit (rig.max_log_bytes) allows"
            raise _EndedError(what)
        if "refused" in reply:
            raise LogError(reply["refused"], code=reply.get("code", "damaged"))
        return ChildAnswer(reply["content"], parts)

    def _stop(self) -> None:
        self.is_late.set()
        self._process.kill()

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
        asked = json.loads(head or "{}")
        data = sys.stdin.buffer.read(asked.get("n_bytes", 0))
        if not head or len(data) < asked["n_bytes"]:
            os._exit(0)  # what a library does at exit is of no interest
        limit = asked["limit"]
        most = _OWN_MEMORY + min(3 * limit, max(_LEAST, _UNPACKED * len(data)))
        with suppress(ImportError, ValueError, OSError):  # Windows has none
            import resource

            _, hard = resource.getrlimit(resource.RLIMIT_DATA)
            resource.setrlimit(resource.RLIMIT_DATA, (min(most, sys.maxsize), hard))
            resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        reply: dict[str, Any] = {}
        parts: Sequence[bytes] = ()
        try:
            module, _, function = asked["answer"].partition(":")
            content, parts = getattr(importlib.import_module(module), function)(data, limit)
            reply = {"content": content, "lengths": [len(part) for part in parts]}
        except LogError as error:
            reply = {"refused": str(error), "code": error.problem.code}
        except MemoryError:
            reply = {"refused": _OUT_OF_MEMORY}
        out.write(json.dumps(reply).encode() + b"\n")
        out.writelines(parts)
        out.flush()
