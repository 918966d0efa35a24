"""Reading in a process of its own, for libraries that may take the whole program with them.

On damaged bytes, asammdf ends by a segmentation fault and HDF5 takes all memory there is. Apart,
that is one log that cannot be read. The child gets the bytes on its standard input and answers
with one line of JSON and the arrays as float64.
"""

from __future__ import annotations

import importlib
import importlib.util
import json
import os
import signal
import subprocess
import sys
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit.errors import LogError
from damperfit.readers.grouping import Group, GroupChannel

if TYPE_CHECKING:
    import io
    from collections.abc import Sequence

    from damperfit.readers.files import Source
    from damperfit.readers.options import ReadOptions

__all__ = ["answer", "read_groups_in_child"]

_TIME_LIMIT = 60.0  # s; the slowest of the libraries takes 2 s to load
_OWN_MEMORY = 1 << 30  # bytes that Python and the library take before they see a log
# The folder of a log, which may be the working folder, must not be looked in for modules.
_CHILD = """
import sys
sys.path.insert(0, sys.argv[1])
from damperfit.readers.child_process import answer
answer()
"""


def read_groups_in_child(
    module: str, library: str, source: Source, options: ReadOptions
) -> list[Group]:
    """Return the groups that ``read_groups`` of a module finds in a log.

    Parameters
    ----------
    module : str
        As in "damperfit.readers.mdf".
    library : str
        Module it needs, as in "asammdf".
    source, options
        As for the readers.

    Raises
    ------
    LogError
        The library is not installed; the child refuses the log, or dies of it.
    """
    reader = importlib.import_module(module)
    _check_library(library, reader.EXTRA, reader.READS, source.name)
    root = str(Path(__file__).resolve().parents[2])
    command = [sys.executable, "-P", "-c", _CHILD, root, module, str(options.max_bytes)]
    try:
        done = subprocess.run(  # noqa: S603  # our own command; the log comes as bytes
            command, input=source.data, capture_output=True, timeout=_TIME_LIMIT, check=False
        )
    except subprocess.TimeoutExpired as error:
        raise LogError(
            f"{source.name}: damaged {reader.READS} file: not read in {_TIME_LIMIT:g} s"
        ) from error
    head, _, body = done.stdout.partition(b"\n")
    if done.returncode != 0 or not head:
        raise LogError(
            f"{source.name}: damaged {reader.READS} file: its reader ended by "
            f"{_ending(done.returncode)}; copy the log again"
        )
    said = json.loads(head)
    if "refused" in said:
        raise LogError(f"{source.name}: {said['refused']}")
    return _unpacked(said["groups"], body)


def _check_library(library: str, extra: str, reads: str, name: str) -> None:
    found = None
    with suppress(ImportError, ValueError):
        found = importlib.util.find_spec(library)
    if found is None:
        raise LogError(f"{name}: {reads} needs one more library: pip install 'damperfit[{extra}]'")


def _ending(code: int) -> str:
    if code < 0:
        with suppress(ValueError):
            return signal.Signals(-code).name
    return f"code {code}"


def _unpacked(groups: Sequence[Any], body: bytes) -> list[Group]:
    values = np.frombuffer(body, dtype=np.float64)
    found, at = [], 0
    for group in groups:
        channels = []
        for name, unit, length in group["channels"]:
            part = values[at : at + length]
            at += length
            channels.append(GroupChannel(name, unit, length, partial(np.asarray, part)))
        found.append(Group(group["name"], tuple(channels), group["metadata"]))
    return found


def answer() -> None:
    """Read what stands on standard input, in the child."""
    module, limit = sys.argv[2], int(sys.argv[3])
    out = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # a library that prints would spoil the answer
    _limit_memory(_OWN_MEMORY + 3 * limit)
    try:
        groups = importlib.import_module(module).read_groups(sys.stdin.buffer.read(), limit)
    except LogError as error:
        out.write(json.dumps({"refused": str(error)}).encode() + b"\n")
    except MemoryError:
        out.write(b'{"refused": "needs more memory than the limit (rig.max_log_bytes) allows"}\n')
    else:
        _send(groups, out)
    out.flush()
    os._exit(0)  # what a library does at exit is of no interest


def _send(groups: Sequence[Group], out: io.BufferedWriter) -> None:
    said = [
        {
            "name": group.name,
            "channels": [(c.name, c.unit, c.length) for c in group.channels],
            "metadata": dict(group.metadata),
        }
        for group in groups
    ]
    out.write(json.dumps({"groups": said}).encode() + b"\n")
    for group in groups:
        out.writelines(channel.load().tobytes() for channel in group.channels)


def _limit_memory(n_bytes: int) -> None:
    with suppress(ImportError, ValueError, OSError):  # Windows has none
        import resource

        resource.setrlimit(resource.RLIMIT_DATA, (n_bytes, n_bytes))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
