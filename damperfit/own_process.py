"""What a process of ours needs before it imports anything else.

The folder that it is started in, and with it the logs' folder, is no place to look for modules: a
``struct.py`` beside the logs would be executed. Standard streams that were closed are opened on
nothing: else the first file that is written would get what is printed.
"""

import os
import sys

_ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))  # noqa: PTH120 - no pathlib yet
CLOSED_STREAMS: set[str] = set()  # names of those that nobody reads: "stdout", "stderr"


def begin() -> None:
    """Make this process ours: its import path, its environment for children, its streams."""
    _open_streams()
    _, dropped = _import_path()
    is_moved = _ROOT in sys.path[:1] + dropped
    sys.path[:] = [
        one
        for k, one in enumerate(sys.path)
        if os.path.isabs(one)  # noqa: PTH117
        and one not in dropped
        and not (k == 0 and not sys.flags.safe_path and _is_here(one))
    ]
    if is_moved:  # started in a checkout: what is there hides nothing of Python's
        sys.path[:] = [*(one for one in sys.path if one != _ROOT), _ROOT]
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
    """Return what may stay of PYTHONPATH, and the folders that may not."""
    entries = os.environ.get("PYTHONPATH", "").split(os.pathsep)
    kept = [one for one in entries if os.path.isabs(one) and not _is_here(one)]  # noqa: PTH117
    return os.pathsep.join(kept), [_absolute(one) for one in entries if one not in kept]


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
