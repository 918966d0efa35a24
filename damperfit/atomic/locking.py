"""One writer at a time: a lock of the operating system's, which ends with its process.

The lock file is removed with the lock, so a killed run leaves one at most, and the next takes it.
"""

from __future__ import annotations

import errno
import os
import time
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, NamedTuple

from damperfit.errors import OutputError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

__all__ = ["Held", "locked"]

_PAUSE = 0.02  # s
_HELD = {errno.EAGAIN, errno.EACCES, errno.EDEADLK}


class Held(NamedTuple):
    """A lock that is held."""

    now: float  # by the file system's clock, which may be another host's; s
    is_sure: bool  # False where the file system has no locks


@contextmanager
def locked(path: Path, *, patience: float, refusal: str) -> Iterator[Held]:
    """Hold the lock of a file that is made for it and removed with it.

    Where the file system has no locks, nothing is held: the journal then keeps writers apart.

    Parameters
    ----------
    path : pathlib.Path
        The lock file, in a folder that exists.
    patience : float
        How long to wait for whoever holds it, s.
    refusal : str
        What to say then.

    Raises
    ------
    OutputError
        It is held for longer.
    """
    until = time.monotonic() + patience
    while (taken := _taken(path)) is None:
        if time.monotonic() >= until:
            raise OutputError(refusal)
        time.sleep(_PAUSE)
    handle, is_sure = taken
    try:
        yield Held(_now(path), is_sure)
    finally:
        if os.name == "nt":  # no open file can be removed there
            os.close(handle)
        with suppress(OSError):
            path.unlink()
        if os.name != "nt":
            with suppress(OSError):  # what was written stands, whatever becomes of the lock
                os.close(handle)


def _taken(path: Path) -> tuple[int, bool] | None:
    """Return the lock file's handle and whether it is locked; None while another holds it."""
    no_link = getattr(os, "O_NOFOLLOW", 0)
    try:
        handle = os.open(path, os.O_RDWR | os.O_CREAT | no_link, 0o666)
    except PermissionError:  # what a killed run of somebody else left
        handle = os.open(path, os.O_RDONLY | no_link)
    try:
        is_sure = _lock(handle)
        with suppress(FileNotFoundError):
            # Whoever held it may have removed the file that was just opened.
            if os.path.samestat(os.fstat(handle), path.stat()):
                return handle, is_sure
    except BlockingIOError:
        pass
    except BaseException:
        os.close(handle)
        raise
    os.close(handle)
    return None


def _now(path: Path) -> float:
    """Return the time as the file system has it."""
    with suppress(PermissionError):
        os.utime(path)
        return path.stat().st_mtime
    return time.time()


def _lock(handle: int) -> bool:
    """Return True once it is locked, False where there are no locks."""
    try:
        if os.name == "nt":
            import msvcrt

            msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined,unused-ignore]
        else:
            import fcntl

            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        if error.errno in _HELD:
            raise BlockingIOError from error
        return False  # ENOLCK, EOPNOTSUPP and their like
    return True
