"""What an earlier run left in a folder, and who is at work there now."""

from __future__ import annotations

import os
import time
from contextlib import ExitStack, contextmanager, suppress
from typing import TYPE_CHECKING

from damperfit.atomic.journal import JOURNAL, read_journal
from damperfit.atomic.locking import Held, locked
from damperfit.atomic.owner import ABANDONED, owner_of
from damperfit.errors import OutputError

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from pathlib import Path

__all__ = ["explain", "recovered", "reserved", "settle"]

_LOCK = ".damperfit-lock"  # while files are exchanged
_RUN = ".damperfit-run"  # while a run is at work whose results go there
_RESULTS = ("run.json", "parameters.csv", "parameters.parquet")  # of a run, whole or damaged
_PATIENCE = 30.0  # s; an exchange takes some milliseconds
_RUN_PATIENCE = 1.0  # s; `settle` looks whether a run is at work, and holds its lock for that
_PAUSE = 0.05  # s


def settle(folder: Path) -> None:
    """Put right what a killed run left in a results folder; call it before reading there.

    Parameters
    ----------
    folder : pathlib.Path
        May be missing or read-only, as long as nothing is to be put right.

    Raises
    ------
    OutputError
        Results were being written there, and the earlier ones cannot be put back, or a run of
        another host may still be at it.
    """
    try:
        is_clean = not any(_is_ours(path.name) for path in folder.iterdir())
    except OSError:
        return  # whoever reads there says it better
    if is_clean:
        return
    try:
        with recovered(folder):
            pass
    except OSError as error:
        if os.path.lexists(folder / JOURNAL):
            raise OutputError(_interrupted(folder, error)) from error


@contextmanager
def recovered(folder: Path) -> Iterator[None]:
    """Keep other writers out of a folder in which an unfinished exchange was undone first.

    Parameters
    ----------
    folder : pathlib.Path
        It exists.

    Raises
    ------
    OutputError
        Another run exchanges files there and has not ended for `_PATIENCE`, or the earlier results
        cannot be put back.
    """
    until = time.monotonic() + _PATIENCE
    busy = (
        f"{folder}: another run has been writing there for {_PATIENCE:g} s; wait for "
        "it to end, or give another folder"
    )
    while True:
        with locked(folder / _LOCK, patience=_PATIENCE, refusal=busy) as held:
            elsewhere = _undone(folder, held)
            if not elsewhere:
                _clean(folder, held.now)
                yield
                return
        if time.monotonic() >= until:
            raise OutputError(elsewhere)
        time.sleep(_PAUSE)


def _undone(folder: Path, held: Held) -> str:
    """Undo an exchange that nobody is at any more; return what to say where one may be."""
    found = read_journal(folder)
    if found is None:
        return ""
    journal, written = found
    age = max(0.0, held.now - written)
    is_abandoned = held.is_sure and journal.writer.is_here  # or its writer had the lock
    if not is_abandoned and journal.writer.may_live(age):
        return (
            f"{folder}: writing results there was begun on another host {age / 60.0:.0f} min ago "
            "and has not ended; wait for it, or, if that run was killed, run damperfit report "
            f"there on that host, which puts the earlier results back ({ABANDONED / 3600.0:.0f} h "
            "after it was begun every host does)"
        )
    try:
        journal.undo(folder)
    except OSError as error:
        raise OutputError(_interrupted(folder, error)) from error
    for path in tuple(folder.iterdir()):
        if owner_of(path.name) == journal.writer:
            with suppress(OSError):
                path.unlink()
    return ""


def _clean(folder: Path, now: float) -> None:
    """Remove what killed runs left; a run that may be alive keeps its temporary files."""
    for path in tuple(folder.iterdir()):
        owner = owner_of(path.name)
        if owner is None or owner.is_this_process:
            continue
        with suppress(OSError):
            if not owner.may_live(now - path.lstat().st_mtime):
                path.unlink()
    if os.path.lexists(folder / _RUN):
        with suppress(OSError, OutputError), locked(folder / _RUN, patience=0.0, refusal=""):
            pass  # it goes with the lock


@contextmanager
def reserved(folder: Path) -> Iterator[None]:
    """Hold a folder for the results of a run, made if need be, from before its work to its end.

    A folder in which nothing came to stand is removed again. Reading there goes on, and so does
    writing other files.

    Parameters
    ----------
    folder : pathlib.Path
        Where the results will be.

    Raises
    ------
    OutputError
        Another run is at work for that folder, or it cannot be written to.
    """
    missing = [one for one in (folder, *folder.parents) if not os.path.lexists(one)]
    refusal = (
        f"{folder}: another run is at work there; wait for it to end, or give this "
        "one a folder of its own (--out)"
    )
    with ExitStack() as held:
        held.callback(_remove_empty, missing)
        try:
            folder.mkdir(parents=True, exist_ok=True)
            settle(folder)
            lock = locked(folder / _RUN, patience=_RUN_PATIENCE, refusal=refusal)
            held.enter_context(lock)
        except OSError as error:
            raise OutputError(explain(folder, error)) from error
        yield


def _remove_empty(folders: Iterable[Path]) -> None:
    for one in folders:
        with suppress(OSError):  # results stand in it
            one.rmdir()


def explain(folder: Path, error: OSError, names: Iterable[str] = ()) -> str:
    """Return the sentence for a folder that cannot be written to.

    Parameters
    ----------
    folder : pathlib.Path
        Where.
    error : OSError
        Why not.
    names : iterable of str
        Files that were to be written.
    """
    said = f"cannot write to {folder}: {error.strerror or error}"
    is_earlier = any(os.path.lexists(folder / name) for name in (*names, *_RESULTS))
    return f"{said}; earlier results there are untouched" if is_earlier else said


def _interrupted(folder: Path, error: OSError) -> str:
    return (
        f"{folder}: writing results was interrupted there, and the earlier ones cannot be put "
        f"back: {error.strerror or error}; make the folder writable and run the command again"
    )


def _is_ours(name: str) -> bool:
    return name in {JOURNAL, _LOCK, _RUN} or owner_of(name) is not None
