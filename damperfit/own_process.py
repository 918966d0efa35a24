"""What a process of ours needs before it imports anything else.

The working folder, often that of the logs, is taken off the import path: a ``struct.py`` there
would be executed. Standard streams that were closed are opened on the null device: else the first
file that is written would get what is printed.
"""

import os
import sys

_ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))  # noqa: PTH120 - no pathlib yet
CLOSED_STREAMS: set[str] = set()  # names of those that are closed: "stdout", "stderr"


def begin() -> None:
    """Make this process ours: its import path, its environment for children, its streams."""
    _open_streams()
    _, dropped = _import_path()
    is_moved = _ROOT in sys.path[:1] + dropped
    sys.path[:] = [
        folder
        for k, folder in enumerate(sys.path)
        if os.path.isabs(folder)  # noqa: PTH117
        and folder not in dropped
        and not (k == 0 and not sys.flags.safe_path and _is_here(folder))
    ]
    if is_moved:  # started in a checkout: what is there hides nothing of Python's
        sys.path[:] = [*(folder for folder in sys.path if folder != _ROOT), _ROOT]
    environment = child_environment()
    os.environ.update(environment)
    if "PYTHONPATH" not in environment:
        os.environ.pop("PYTHONPATH", None)


def child_environment() -> dict[str, str]:
    """Return the environment for a Python that this process starts."""
    kept, _ = _import_path()
    environment = {name: text for name, text in os.environ.items() if name != "PYTHONPATH"}
    return environment | {"PYTHONSAFEPATH": "1"} | ({"PYTHONPATH": kept} if kept else {})


def _import_path() -> tuple[str, list[str]]:
    """Return the part of PYTHONPATH that may stay, and the folders that may not."""
    entries = os.environ.get("PYTHONPATH", "").split(os.pathsep)
    kept = [folder for folder in entries if os.path.isabs(folder) and not _is_here(folder)]  # noqa: PTH117
    return os.pathsep.join(kept), [_absolute(folder) for folder in entries if folder not in kept]


def _is_here(folder: str) -> bool:
    try:
        return os.path.samefile(folder, os.curdir)  # noqa: PTH121
    except (OSError, ValueError):
        return False


def _absolute(folder: str) -> str:
    try:
        return os.path.abspath(folder)
    except OSError:  # the working folder is gone
        return folder


def _open_streams() -> None:
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is not None:
            continue
        CLOSED_STREAMS.add(name)
        nowhere = os.open(os.devnull, os.O_RDWR)
        try:
            os.fstat(number)
        except OSError:
            os.dup2(nowhere, number)
        if nowhere > 2:
            os.close(nowhere)
        stream = open(os.devnull, "r" if number == 0 else "w", encoding="utf-8")  # noqa: PTH123, SIM115
        setattr(sys, name, stream)
