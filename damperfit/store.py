"""Files that appear whole or not at all, whatever ends the run and whoever else writes.

A set of files is written into a staging folder inside its target folder and flushed to disk. One
rename of the staging folder to `_COMMITTED` commits the set; then its files are moved over their
targets. Whoever finds a committed set that was not moved to the end moves the rest: each step may
be repeated, and `settle` does it before results are read. The folder itself is never exchanged,
for it may be a working folder or a mount, and it may hold other people's files.

Writers are kept apart by locks of the operating system, which end with their process. On a file
system without locks nothing keeps two writers of one folder apart.
"""

from __future__ import annotations

import errno
import json
import logging
import os
import re
import secrets
import shutil
import tempfile
import time
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

from damperfit.errors import ConfigurationError, OutputError
from damperfit.problem import Option
from damperfit.units.quantities import units_of

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

_LOGGER = logging.getLogger(__name__)

_STAGING = ".damperfit-new-"  # prefix of staging folders and files
_COMMITTED = ".damperfit-committed"
_EXCHANGE = ".damperfit-lock"  # while files are exchanged
_RUN = ".damperfit-run"  # while a run is at work whose results go there
_REMOVED = ".removed"  # in a staging folder: names that go when the set appears
_ALIVE = ".alive"  # in a staging folder: locked as long as its writer lives
_RESULTS = ("run.json", "parameters.csv", "parameters.parquet")
_PATIENCE = 30.0  # s; an exchange takes some milliseconds
_RUN_PATIENCE = 1.0  # s; `settle` of another command may hold the lock of a run for a moment
_PAUSE = 0.02  # s
_HELD = {errno.EAGAIN, errno.EACCES, errno.EDEADLK}


@dataclass
class FileSet:
    """Files of one folder that are about to be replaced together."""

    folder: Path
    staging: Path
    names: list[str] = field(default_factory=list)
    removed: list[str] = field(default_factory=list)
    spares_others: bool = False
    is_committed: bool = False

    def path(self, name: str) -> Path:
        """Return the path to write ``name`` to; it becomes part of the set.

        Raises
        ------
        OutputError
            ``name`` is no plain file name.
        """
        if Path(name).name != name or name in {"", ".", ".."} or "\0" in name:
            raise OutputError(f"{name!r} is not a plain file name; no file is written elsewhere")
        if name not in self.names:
            self.names.append(name)
        return self.staging / name

    def without(self, name: str) -> None:
        """Let a file of an earlier set, if there is one, go when this set appears."""
        if name not in (*self.names, *self.removed):
            self.removed.append(name)

    def spare(self) -> None:
        """Refuse to write over files of another origin, where these are spared.

        `commit` does it too; who writes two sets asks both before either is committed.

        Raises
        ------
        ConfigurationError
            Such a file is there.
        """
        for name in self.names if self.spares_others else ():
            _refuse_others(self.folder / name, self.staging / name)

    def commit(self) -> None:
        """Exchange the files for their targets; `file_set` calls it.

        Raises
        ------
        ConfigurationError
            A file of another origin is in the way, and is spared.
        OutputError
            A target is no regular file, or another run does not end its exchange.
        """
        (self.staging / _REMOVED).write_text(json.dumps(self.removed), encoding="utf-8")
        for name in (*self.names, _REMOVED):
            _flush(self.staging / name)
        _flush_folder(self.staging)
        self.spare()
        with _exchanging(self.folder):
            for name in (*self.names, *self.removed):
                _refuse_irregular(self.folder / name)
            self.staging.rename(self.folder / _COMMITTED)
            self.is_committed = True
            _move_committed(self.folder)


@contextmanager
def file_set(folder: Path, *, spares_others: bool = False) -> Iterator[FileSet]:
    """Open a set of files in ``folder``; they replace the old ones when the block ends well.

    The folder is made when it does not exist. When the block raises, no target has changed and no
    temporary file is left. Sets of several runs are exchanged one after the other.

    Parameters
    ----------
    folder : pathlib.Path
        Where.
    spares_others : bool
        Refuse where a file of another origin would be written over.

    Raises
    ------
    ConfigurationError
        A file of another origin stands where one is to go, and is spared.
    OutputError
        The folder or a file in it cannot be written.
    """
    files = None
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with temporary_folder(_STAGING, folder) as staging:
            files = FileSet(folder, staging, spares_others=spares_others)
            yield files
            files.commit()
        _LOGGER.debug("written to %s: %s", folder, ", ".join(sorted(files.names)))
    except OSError as error:
        if files is not None and files.is_committed:
            raise OutputError(_interrupted(folder, error)) from error
        raise (_unwritten(folder, error, files.names if files else ())) from error


@contextmanager
def temporary_folder(prefix: str, parent: Path) -> Iterator[Path]:
    """Yield a new folder in ``parent``, which goes at the end or by `remove_abandoned`."""
    folder = Path(tempfile.mkdtemp(prefix=prefix, dir=parent))
    try:
        with _lock_held(folder / _ALIVE):
            yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


@contextmanager
def replaced(path: Path) -> Iterator[BinaryIO]:
    """Yield a file to write to, which takes the place of ``path`` when the block ends well.

    Raises
    ------
    OSError
        The file cannot be written; ``path`` is as it was.
    """
    beside = path.parent / f"{_STAGING}{secrets.token_hex(8)}"
    try:
        with beside.open("xb") as file:
            _try_lock(file.fileno())
            yield file
            file.flush()
            os.fsync(file.fileno())
            if os.name != "nt":  # before the lock ends, so that nobody takes it for abandoned
                os.replace(beside, path)
        if os.name == "nt":
            os.replace(beside, path)
        _flush_folder(path.parent)
    except BaseException:
        with suppress(OSError):
            beside.unlink()
        raise


def write_text(path: Path, text: str) -> None:
    """Write one UTF-8 text file whole or not at all.

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    with file_set(path.parent) as files:
        files.path(path.name).write_text(text, encoding="utf-8", newline="\n")


def _has_working_folder() -> bool:
    try:
        return bool(os.getcwd())  # noqa: PTH109
    except OSError:
        return False


def check_writable(folder: Path) -> None:
    """Raise before any work is done when results could never be written to ``folder``.

    Raises
    ------
    ConfigurationError
        A file stands where the folder should be.
    OutputError
        The nearest existing folder is write-protected.
    """
    text = str(folder)
    nearest = folder
    if re.match(r"[a-z][a-z0-9+.-]+:/", folder.as_posix()):
        text = re.sub(r":/+", "://", folder.as_posix(), count=1)
        code, why = (
            "no-address",
            (
                "results go to a folder of this machine, not to an address; give a folder, and "
                "copy it there when all is done"
            ),
        )
    elif "\0" in text:
        text, code, why = repr(text), "no-path", "a NUL cannot stand in a path"
    elif not (folder.is_absolute() or _has_working_folder()):
        code, why = (
            "no-working-folder",
            ("the folder that this was started in is gone; go to one that is there (cd)"),
        )
    else:
        while not os.path.lexists(nearest) and nearest != nearest.parent:
            nearest = nearest.parent
        if nearest.is_dir() and os.access(nearest, os.W_OK | os.X_OK):
            return
        if nearest.is_dir():
            why = f"cannot be written: {nearest} is write-protected"
            raise OutputError(why, code="write-protected", subject=folder)
        code, why = "not-a-folder", f"{nearest} is not a folder"
    raise ConfigurationError(f"cannot be written: {why}", code=code, subject=text)


@contextmanager
def reserved(folder: Path) -> Iterator[None]:
    """Hold a folder for the results of a run, made if need be, from before its work to its end.

    A folder that stays empty is removed again. Reading there goes on, and so does writing other
    files.

    Raises
    ------
    OutputError
        Another run is at work for that folder, or it cannot be written to.
    """
    missing = [parent for parent in (folder, *folder.parents) if not os.path.lexists(parent)]
    refusal = (
        f"{folder}: another run is at work there; wait for it to end, or give this "
        "one a folder of its own{out}"
    )
    with ExitStack() as held:
        held.callback(_remove_empty, missing)
        try:
            folder.mkdir(parents=True, exist_ok=True)
            settle(folder)
            held.enter_context(_locked(folder / _RUN, patience=_RUN_PATIENCE, refusal=refusal))
        except OSError as error:
            raise (_unwritten(folder, error)) from error
        yield


def settle(folder: Path) -> None:
    """End what a killed run left half done in a results folder; call it before reading there.

    The folder may be missing or read-only, as long as nothing is left to do.

    Raises
    ------
    OutputError
        A set was committed there and cannot be moved to its place.
    """
    try:
        names = [path.name for path in folder.iterdir()]
    except OSError:
        return  # whoever reads there says it better
    if not any(_is_ours(name) for name in names):
        return
    try:
        with _exchanging(folder):
            remove_abandoned(folder)
        if _RUN in names:
            with suppress(OutputError), _locked(folder / _RUN, patience=0.0, refusal=""):
                pass  # a killed run's lock goes with this one
    except OSError as error:
        if os.path.lexists(folder / _COMMITTED):
            raise OutputError(_interrupted(folder, error)) from error


def remove_abandoned(folder: Path, prefix: str = _STAGING) -> None:
    """Remove what killed writers left in a folder; those that are at work keep their files."""
    for path in folder.glob(f"{prefix}*"):
        with suppress(OSError):
            if path.is_dir() and _is_abandoned(path / _ALIVE):
                shutil.rmtree(path, ignore_errors=True)
            elif path.is_file() and _is_abandoned(path):
                path.unlink()


@contextmanager
def _exchanging(folder: Path) -> Iterator[None]:
    """Keep other writers out of a folder in which a committed set has been moved to its place."""
    busy = (
        f"{folder}: another run has been writing there for {_PATIENCE:g} s; wait for "
        "it to end, or give another folder"
    )
    with _locked(folder / _EXCHANGE, patience=_PATIENCE, refusal=busy):
        if os.path.lexists(folder / _COMMITTED):
            _move_committed(folder)
        yield


def _move_committed(folder: Path) -> None:
    """Move the files of a committed set over their targets, from wherever that was left off."""
    committed = folder / _COMMITTED
    list_of_removed = committed / _REMOVED
    for path in sorted(committed.iterdir()):
        if path.name not in {_REMOVED, _ALIVE}:
            os.replace(path, folder / path.name)
    if list_of_removed.exists():  # it goes last
        for name in json.loads(list_of_removed.read_text(encoding="utf-8")):
            (folder / Path(name).name).unlink(missing_ok=True)
        _flush_folder(folder)
    (committed / _ALIVE).unlink(missing_ok=True)
    list_of_removed.unlink(missing_ok=True)
    committed.rmdir()


def _refuse_irregular(target: Path) -> None:
    if target.exists() and not target.is_file():  # a folder, a device, a pipe
        raise OutputError(f"cannot write {target}: it exists and is not a regular file")
    if os.name == "nt" and target.exists():  # a file that another program has open stays
        os.replace(target, target)


def _is_abandoned(path: Path) -> bool:
    """Whether the writer that locked a file has gone."""
    try:
        number = os.open(path, os.O_RDWR)
    except FileNotFoundError:
        return time.time() - path.parent.stat().st_mtime > 1.0  # locked right after it is made
    try:
        return _try_lock(number)
    except BlockingIOError:
        return False
    finally:
        os.close(number)


@contextmanager
def _locked(path: Path, *, patience: float, refusal: str) -> Iterator[None]:
    """Hold the lock of a file that is made for it and removed with it."""
    until = time.monotonic() + patience
    while True:
        try:
            with _lock_held(path) as number:
                # Whoever held it may have removed the file that was just opened.
                if path.exists() and os.path.samestat(os.fstat(number), path.stat()):
                    try:
                        yield
                        return
                    finally:
                        with suppress(OSError):
                            path.unlink()
        except BlockingIOError:
            pass
        if time.monotonic() >= until:
            raise OutputError(refusal, out=Option("out", is_aside=True))
        time.sleep(_PAUSE)


@contextmanager
def _lock_held(path: Path) -> Iterator[int]:
    """Make a file and hold its lock where the file system has locks; a held one is refused."""
    no_link = getattr(os, "O_NOFOLLOW", 0)
    try:
        number = os.open(path, os.O_RDWR | os.O_CREAT | no_link, 0o666)
    except PermissionError:  # what a killed run of somebody else left
        number = os.open(path, os.O_RDONLY | no_link)
    try:
        is_locked = _try_lock(number)
        try:
            yield number
        finally:
            if is_locked:  # not by closing alone: a copy of this process may have it open
                _unlock(number)
    finally:
        with suppress(OSError):  # what was written stands, whatever becomes of the lock
            os.close(number)


def _try_lock(number: int) -> bool:
    """Lock an open file; False where the file system has no locks."""
    try:
        if os.name == "nt":
            import msvcrt

            msvcrt.locking(number, msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined,unused-ignore]
        else:
            import fcntl

            fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        if error.errno in _HELD:
            raise BlockingIOError from error
        return False  # ENOLCK, EOPNOTSUPP and their like
    return True


def _unlock(number: int) -> None:
    with suppress(OSError):
        if os.name == "nt":
            import msvcrt

            msvcrt.locking(number, msvcrt.LK_UNLCK, 1)  # type: ignore[attr-defined,unused-ignore]
        else:
            import fcntl

            fcntl.flock(number, fcntl.LOCK_UN)


def _flush(path: Path) -> None:
    with path.open("rb+") as file:
        os.fsync(file.fileno())


def _flush_folder(folder: Path) -> None:
    """Make renames durable; Windows and some network file systems cannot, and need not."""
    with suppress(OSError):
        number = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(number)
        finally:
            os.close(number)


def _remove_empty(folders: Iterable[Path]) -> None:
    for folder in folders:
        with suppress(OSError):  # results stand in it
            folder.rmdir()


def _unwritten(folder: Path, error: OSError, names: Iterable[str] = ()) -> OutputError:
    sentence = f"cannot be written: {error.strerror or error}"
    is_earlier = any(os.path.lexists(folder / name) for name in (*names, *_RESULTS))
    kept = "; earlier results there are untouched" if is_earlier else ""
    return OutputError(f"{sentence}{kept}", code="cannot-write", subject=folder)


def _interrupted(folder: Path, error: OSError) -> str:
    return (
        f"{folder}: results were written there, but not all files could be moved to their place: "
        f"{error.strerror or error}; make the folder writable, and the next command that looks "
        "there ends it"
    )


def _is_ours(name: str) -> bool:
    return name in {_COMMITTED, _EXCHANGE, _RUN} or name.startswith(_STAGING)


# A file is our own where it begins as the new one does and says "damperfit" near its beginning or
# its end (pictures, archives and Parquet say it there), or where it is a CSV with the same columns,
# in whichever units. Tables beside a run.json are results, which only `identify` replaces.
_MARK = b"damperfit"
_HEAD, _TAIL = 16384, 65536  # bytes; the columns of a table of parameters take thousands
_COLUMN = re.compile(rb"\"?[A-Za-z]\w*( \[[^\]]*\])?\"?")
_ALIKE = 4  # bytes: enough to tell kinds of files from each other
_PARQUET = b"PAR1"
_FEWEST = 3  # columns of a table
_UNITS = b"|".join(
    re.escape(unit.replace("/", "_per_").encode())
    for dimension in ("force", "velocity", "length")
    for unit in sorted(units_of(dimension), key=len, reverse=True)
)
_UNIT = re.compile(rb"(?:_| \[)(?:" + _UNITS + rb")\]?$")


def _refuse_others(target: Path, draft: Path) -> None:
    """Refuse to write a draft over a file of another origin."""
    if target.is_file() and not _is_own_file(target, draft):
        raise ConfigurationError(
            "is there already, and damperfit did not write it as this kind of file; "
            "nothing was written. Give {overwrite} to replace it, or another {out}",
            overwrite=Option("overwrite"),
            out=Option("out"),
            subject=target,
        )


def _is_own_file(target: Path, draft: Path) -> bool:
    """Whether a file was written by damperfit, of the kind of another one."""
    with target.open("rb") as file, draft.open("rb") as other:
        old, new = file.read(_HEAD), other.read(_HEAD)
        file.seek(max(0, file.seek(0, 2) - _TAIL))
        ends = file.read()
    columns = _columns(new)
    if (columns or new.startswith(_PARQUET)) and (target.parent / "run.json").exists():
        return False
    if columns:
        return columns == _columns(old)
    return old[:_ALIKE] == new[:_ALIKE] and (_MARK in old or _MARK in ends)


def _columns(head: bytes) -> tuple[bytes, ...]:
    """Names of a CSV's columns without units that may be chosen; else nothing."""
    line = head.removeprefix(b"\xef\xbb\xbf").split(b"\n")[0].strip()
    cells = re.split(rb"[,;]", line)
    if len(cells) < _FEWEST or not all(map(_COLUMN.fullmatch, cells)):
        return ()
    return tuple(_UNIT.sub(b"", cell.replace(b"/", b"_per_")) for cell in cells)
