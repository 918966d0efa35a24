"""``--log-file``: what a command says and does, a line each with its time, appended to a file."""

from __future__ import annotations

import logging
import os
import re
import stat
import sys
from contextlib import suppress
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

from damperfit.errors import ConfigurationError

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["LogFile", "log_file_of", "record"]

_OPTION = "--log-file"
_LOGGER = logging.getLogger("damperfit")
# Without it a record of the library would reach stderr where no log file is asked for.
_LOGGER.addHandler(logging.NullHandler())
_open: list[LogFile] = []
# Streams that this process was given; the shell's >(gzip) is one of them.
_STREAM = re.compile(r"/dev/(stdout|stderr|fd/\d+)")
_FORMAT = "%(asctime)s.%(msecs)03d%(zone)s %(levelname)-7s damperfit[%(process)d] %(message)s"


def log_file_of(arguments: Sequence[str]) -> str | None:
    """Return the file that a command line names, however wrong the rest of it is.

    Examples
    --------
    >>> log_file_of(["identify", "a.csv", "--log-file", "a.log"]), log_file_of(["config"])
    ('a.log', None)
    >>> log_file_of(["inspect", "--log-file=b.log", "--", "--log-file"])
    'b.log'
    """
    ours = arguments[: arguments.index("--")] if "--" in arguments else arguments
    found = None
    for one, following in zip(ours, (*ours[1:], None), strict=True):
        if one == _OPTION:
            found = following
        elif one.startswith(f"{_OPTION}="):
            found = one.partition("=")[2]
    return found


def record(level: int, text: str) -> None:
    """Keep a text in the log file, if there is one, a record for each line.

    Parameters
    ----------
    level : int
        Of the module `logging`.
    text : str
        As the terminal shows it.
    """
    if _open:
        for line in text.splitlines():
            if line.strip():
                _LOGGER.log(level, "%s", line)


class LogFile:
    """A log file for as long as a command runs; without a name it does nothing.

    Parameters
    ----------
    name : str, optional
        File to append to.
    arguments : sequence of str
        The command line, for the first record.

    Raises
    ------
    ConfigurationError
        The file cannot be written, or holds something else.
    """

    def __init__(self, name: str | None, arguments: Sequence[str]) -> None:
        self._handler: logging.Handler | None = None
        self._begin = perf_counter()
        if name is None:
            return
        try:
            _refuse_others(name)
            handler = _Appended(name)
        except (OSError, ValueError) as error:
            said = getattr(error, "strerror", None) or error
            raise ConfigurationError(f"{_OPTION} {name}: cannot be written: {said}") from error
        handler.setFormatter(_Line(_FORMAT, datefmt="%Y-%m-%dT%H:%M:%S"))
        self._handler = handler
        _LOGGER.addHandler(handler)
        _LOGGER.setLevel(logging.DEBUG)
        _LOGGER.propagate = False
        _open.append(self)
        self._tell_who(arguments)

    @staticmethod
    def _tell_who(arguments: Sequence[str]) -> None:
        from damperfit import __version__

        record(logging.INFO, f"$ damperfit {' '.join(map(_quoted, arguments))}")
        record(
            logging.DEBUG,
            f"damperfit {__version__}, Python {sys.version.split()[0]} on {sys.platform}, "
            f"in {_here()}",
        )

    def close(self, exit_code: int) -> None:
        """Keep how the command ended, and close the file."""
        if self._handler is None:
            return
        spent = perf_counter() - self._begin
        record(logging.INFO, f"ended with code {exit_code} after {spent:.2f} s")
        _open.remove(self)
        _LOGGER.removeHandler(self._handler)
        self._handler.close()
        self._handler = None
        _LOGGER.setLevel(logging.NOTSET)
        _LOGGER.propagate = True


class _Appended(logging.Handler):
    """Appends each record at once and in one piece, for two runs may share the file."""

    def __init__(self, name: str) -> None:
        super().__init__()
        self._file = os.open(name, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o666)

    def emit(self, record: logging.LogRecord) -> None:
        """Append a record; a full disk ends no fit."""
        with suppress(OSError):
            os.write(self._file, f"{self.format(record)}\n".encode("utf-8", "backslashreplace"))

    def close(self) -> None:
        """Close the file."""
        with suppress(OSError):
            os.close(self._file)
        super().close()


class _Line(logging.Formatter):
    """A record on one line, its time with the zone."""

    def format(self, record: logging.LogRecord) -> str:
        import time

        offset = time.strftime("%z", time.localtime(record.created))
        record.zone = f"{offset[:3]}:{offset[3:]}"
        return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in super().format(record))


def _refuse_others(name: str) -> None:
    """Refuse what holds other things than records, or may make a writer wait for ever.

    Raises
    ------
    ConfigurationError
        The file is another one.
    OSError
        It is no file, or cannot be read.
    """
    if _STREAM.fullmatch(name):
        return
    try:
        found = Path(name).stat() if name else None
    except FileNotFoundError:
        return  # it is made, or making it says what is wrong
    if found is None or stat.S_ISDIR(found.st_mode):
        raise IsADirectoryError(None, "expected the name of a file")
    if stat.S_ISCHR(found.st_mode):
        return
    if not stat.S_ISREG(found.st_mode):
        raise OSError(None, "expected a regular file, found a pipe, a socket or a disk")
    if found.st_size:
        from damperfit.run.log_files import is_own_log_file

        if not is_own_log_file(Path(name)):
            raise ConfigurationError(
                f"{_OPTION} {name}: is there already and does not begin as a log file of "
                "damperfit; nothing was written to it, name another file"
            )


def _here() -> str:
    try:
        return str(Path.cwd())
    except OSError:
        return "a folder that is gone"


def _quoted(argument: str) -> str:
    import shlex

    return shlex.quote(argument)
