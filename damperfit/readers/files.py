"""Bytes of a log: read once, within a limit, and hashed.

Traps. Opening a pipe waits for ever; a device never ends; a file may grow or be written over while
it is read; one that says it is empty may not be. The hash of a large file costs a good part of
parsing it.
"""

from __future__ import annotations

import hashlib
import os
import stat
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING

from damperfit.errors import LogError

if TYPE_CHECKING:
    from collections.abc import Callable
    from io import FileIO

__all__ = ["Source", "read_source"]

_HASHED_BESIDE = 4_000_000  # bytes; below it, starting a thread costs more than it saves


@dataclass(frozen=True, slots=True, eq=False)
class Source:
    """A file in memory.

    Attributes
    ----------
    name, path : str
        File name for messages, and the path as given.
    data : bytes
        The whole content.
    hashed : callable
        () -> SHA-256 of the file's bytes, hexadecimal.
    """

    name: str
    path: str
    data: bytes
    hashed: Callable[[], str]

    @property
    def sha256(self) -> str:
        """SHA-256 of the file's bytes, hexadecimal; waits until it is known."""
        return self.hashed()


def read_source(path: str | os.PathLike[str], *, max_bytes: int) -> Source:
    """Return a regular file's bytes.

    Raises
    ------
    LogError
        The file is missing, is not a regular file, cannot be read, is empty or too large, or
        changes while it is read.
    """
    shown = _one_line(os.fsencode(path).decode("utf-8", "backslashreplace"))
    name = Path(shown).name or shown
    try:
        # Without O_NONBLOCK, opening a FIFO waits for its writer for ever.
        flags = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
        with os.fdopen(os.open(path, flags), "rb", buffering=0) as file:
            data = _content(file, shown, max_bytes)
    except FileNotFoundError as error:
        if Path(path).is_symlink():
            there = _one_line(str(Path(path).readlink()))
            raise LogError(
                f"{shown}: a link to {there}, which is not there; link it again, or remove it"
            ) from error
        raise LogError(f"{shown}: no such file") from error
    except IsADirectoryError as error:
        raise LogError(f"{shown}: is a folder; name the logs in it") from error
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise LogError(f"{shown}: file unreadable: {reason}") from error
    return Source(name, shown, data, _hashed(data))


def _hashed(data: bytes) -> Callable[[], str]:
    """Hash a large log in a thread, as that takes a good part of the time of parsing it."""
    digest = hashlib.sha256()
    if len(data) < _HASHED_BESIDE:
        digest.update(data)
        return digest.hexdigest
    thread = Thread(target=digest.update, args=(data,), name="damperfit hash")
    thread.start()
    return partial(_digest_of, digest, thread)


def _digest_of(digest: hashlib._Hash, thread: Thread) -> str:
    thread.join()
    return digest.hexdigest()


def _one_line(text: str) -> str:
    """Return a path as it can stand in a message: control characters escaped."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def _content(file: FileIO, shown: str, max_bytes: int) -> bytes:
    before = os.fstat(file.fileno())
    if stat.S_ISDIR(before.st_mode):
        raise LogError(f"{shown}: is a folder; name the logs in it")
    if not stat.S_ISREG(before.st_mode):
        raise LogError(f"{shown}: is not a regular file (a pipe or device); give a file on disk")
    if before.st_size > max_bytes:
        raise LogError(
            f"{shown}: {before.st_size} bytes, more than the limit of {max_bytes} "
            "(rig.max_log_bytes)"
        )
    # A file that says it is empty may not be (/proc); one byte more shows a file that grows.
    data = _read_up_to(file, min(before.st_size, max_bytes) + 1)
    after = os.fstat(file.fileno())
    if len(data) != before.st_size or (before.st_size, before.st_mtime_ns) != (
        after.st_size,
        after.st_mtime_ns,
    ):
        raise LogError(f"{shown}: file changed during read; wait until the rig has written it")
    if not data:
        raise LogError(f"{shown}: empty file (0 bytes)")
    return data


def _read_up_to(file: FileIO, n_bytes: int) -> bytes:
    parts = []
    while n_bytes > 0 and (part := file.read(n_bytes)):
        parts.append(part)
        n_bytes -= len(part)
    return parts[0] if len(parts) == 1 else b"".join(parts)
