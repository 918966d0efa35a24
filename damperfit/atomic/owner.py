"""Whose a temporary file is: host, process and the process's start, all in its name.

A process number alone says nothing on a folder that several hosts or containers share, and is given
anew to another process. What belongs to another host is taken for alive for `ABANDONED` seconds.
"""

from __future__ import annotations

import hashlib
import itertools
import os
import re
import socket
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

__all__ = ["ABANDONED", "Owner", "new_owner", "owner_of"]

ABANDONED = 24.0 * 3600.0  # s; no set of files takes a day to be written
_NAME = re.compile(
    r"\.(?P<host>[0-9a-f]{12})-(?P<pid>\d{1,10})-(?P<start>\d{1,20})-(?P<serial>\d{1,10})"
    r"(?:-\d{1,10})?\.damperfit-(?:new|old)"
)
# As versions before 0.2 named them; the host is not known.
_OLD_NAME = re.compile(r"\..+\.\d+\.damperfit-(?:new|old)")
_serial = itertools.count(1)


@dataclass(frozen=True, slots=True)
class Owner:
    """One writer of one set of files.

    Attributes
    ----------
    host : str
        Digest of host name and process namespace.
    pid : int
        Process number; 0 where it is not known.
    start : int
        When that process started, in its system's own ticks; 0 where that cannot be asked.
    serial : int
        Counts the sets of a process.
    """

    host: str
    pid: int
    start: int
    serial: int

    @property
    def text(self) -> str:
        """The owner as part of a file name."""
        return f"{self.host}-{self.pid}-{self.start}-{self.serial}"

    @property
    def is_here(self) -> bool:
        """Whether it is of this host, so that its process can be looked for."""
        return self.host == _host()

    @property
    def is_this_process(self) -> bool:
        """Whether it is of this process."""
        return self.is_here and (self.pid, self.start) == (os.getpid(), _started(os.getpid()))

    def may_live(self, age: float) -> bool:
        """Whether the writer may still be at work.

        Parameters
        ----------
        age : float
            Of what it left, s.
        """
        if not self.is_here or os.name != "posix":  # os.kill would end the process on Windows
            return age <= ABANDONED
        try:
            os.kill(self.pid, 0)
        except (ProcessLookupError, OverflowError):
            return False
        except PermissionError:
            pass  # somebody else's, and alive
        return self.start == 0 or _started(self.pid) in {0, self.start}


def new_owner() -> Owner:
    """Return a new writer in this process."""
    return Owner(_host(), os.getpid(), _started(os.getpid()), next(_serial))


def owner_of(name: str) -> Owner | None:
    """Return whose temporary file this is by its name; None where it is no temporary file."""
    if found := _NAME.fullmatch(name):
        return Owner(found["host"], *(int(found[key]) for key in ("pid", "start", "serial")))
    return Owner("", 0, 0, 0) if _OLD_NAME.fullmatch(name) else None


@lru_cache(maxsize=1)
def _host() -> str:
    name = socket.gethostname()
    with suppress(OSError):  # containers of one name number their processes apart
        name += str(Path("/proc/self/ns/pid").readlink())
    return hashlib.sha256(name.encode("utf-8", "surrogateescape")).hexdigest()[:12]


def _started(pid: int) -> int:
    """Return the start of a process in clock ticks since the host's own; 0 where unknown."""
    with suppress(OSError, ValueError, IndexError):
        # The program's name stands in brackets and may hold anything.
        return int(Path(f"/proc/{pid}/stat").read_bytes().rpartition(b")")[2].split()[19])
    return 0
