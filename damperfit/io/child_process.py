"""Reading in a child process, for libraries that may crash the whole program.

On damaged bytes asammdf ends by a segmentation fault, HDF5 takes all memory, and a small workbook
may unpack to gigabytes. In a child that costs one log. A child reads several logs, as loading a
library takes longer than reading a log, within limits of memory and time for each.

Traps. Damaged bytes may corrupt memory without ending the process: a child that has refused a log
is not used again. If a child dies or lacks memory, earlier logs may be the cause: a new one tries
again. A child ends when it is idle for a while, and with its parent.
"""

import atexit
import importlib
import importlib.util
import logging
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from threading import Lock
from typing import Any, NamedTuple

from damperfit.errors import LogError
from damperfit.io.columns import visible
from damperfit.io.files import Source
from damperfit.io.options import ReadOptions
from damperfit.workers import Died, Worker

_TIME_LIMIT = 60  # s for a log, and 1 s for each megabyte; libraries take seconds to load
_IDLE = 10.0  # s after which an idle child ends
_OWN_MEMORY = 320_000_000  # bytes that Python and the library take before they see a log
_LEAST, _UNPACKED = 100_000_000, 400  # bytes that any log may take, and each of its bytes


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
    """Turn any exception of a library on damaged bytes into a LogError of one line."""
    try:
        yield
    except (LogError, MemoryError):
        raise
    except Exception as error:  # npTDMS alone raises five kinds, from KeyError to struct.error
        line = (str(error).splitlines() or [""])[0]
        reason = visible(line or type(error).__name__, limit=120)
        raise LogError(f"damaged {reads}: {reason}; copy the log again", code="damaged") from error


def check_size(n_bytes: int, *, limit: int, subject: str) -> None:
    """Refuse more bytes than the limit, or a negative number."""
    if not 0 <= n_bytes <= limit:
        raise LogError(
            f"{subject} claims {n_bytes} bytes, more than the limit of {limit} (rig.max_log_bytes)",
            code="too-large",
        )


class ChildReader(NamedTuple):
    """How a format is read by a library in a child."""

    reads: str  # the format, for messages
    extra: str  # of the package, that brings the library
    library: str  # its module
    answer: str  # ``module:function`` of (data, limit in bytes), in the child
    is_memory_safe: bool = False  # damaged bytes cannot corrupt it: it is used after a refusal


def ask_child(reader: ChildReader, source: Source, options: ReadOptions) -> Any:
    """Return the answer of a reader in a child to a log, or raise its LogError."""
    with suppress(ImportError, ValueError):
        if importlib.util.find_spec(reader.library) is None:
            raise _missing(reader.extra, reader.reads)
    seconds = _TIME_LIMIT + len(source.data) // 1_000_000
    task = reader.answer, source.data, options.max_bytes
    while True:
        child, is_new = _CHILDREN.take()
        answer = child.do(_answered, task, seconds)
        is_read = not isinstance(answer, Exception | Died)
        if is_read or (isinstance(answer, LogError) and reader.is_memory_safe):
            _CHILDREN.give_back(child)
        else:
            child.end()
        if is_read:
            return answer
        if isinstance(answer, LogError):
            raise answer
        is_late = isinstance(answer, Died) and answer.is_late
        if is_new or is_late:  # another child would fail too
            reason = answer.cause if isinstance(answer, Died) else type(answer).__name__
            text = (
                f"damaged {reader.reads} file: its reader ended by {reason}; copy the log again, "
                "or raise the limit of memory (rig.max_log_bytes)"
            )
            if is_late:
                text = f"damaged {reader.reads} file: not read in {seconds:g} s"
            elif isinstance(answer, MemoryError):
                text = f"{reader.reads}: needs more memory than the limit "
                text += "(rig.max_log_bytes) allows"
            raise LogError(text, code="damaged")


def _answered(task: tuple[str, bytes, int]) -> Any:
    """Return what a reader's function returns of a log, in the child, within limits of memory."""
    answer, data, limit = task
    most = _OWN_MEMORY + min(3 * limit, max(_LEAST, _UNPACKED * len(data)))
    with suppress(ImportError, ValueError, OSError):  # Windows has none
        import resource

        _, hard = resource.getrlimit(resource.RLIMIT_DATA)
        resource.setrlimit(resource.RLIMIT_DATA, (min(most, sys.maxsize), hard))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    module, _, function = answer.partition(":")
    return getattr(importlib.import_module(module), function)(data, limit)


class _Children:
    """Idle children, for the threads that read logs."""

    def __init__(self) -> None:
        self._idle: list[Worker] = []
        self._of_others: list[Worker] = []
        self._lock = Lock()

    def take(self) -> tuple[Worker, bool]:
        """Return a child, and whether it is a new one."""
        with self._lock:
            while self._idle:
                child = self._idle.pop()
                if child.is_alive:
                    return child, False
                child.end()
        return Worker(idle=_IDLE, is_quiet=True), True

    def give_back(self, child: Worker) -> None:
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
