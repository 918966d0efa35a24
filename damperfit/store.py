"""Files that are replaced as a whole or not at all, whatever ends the run and whoever else writes.

A set of files is written into a staging folder inside its target folder and flushed to disk. One
rename of the staging folder to `_COMMITTED` commits the set; then its files are moved over their
targets. The next process that meets a committed set moves the rest of it: each step may be
repeated, and `settle` does it before results are read. The folder itself is never exchanged, for it
may be a working folder or a mount, and it may hold other people's files.

Locks of the operating system, which end with their process, exclude other writers; on a file system
without locks nothing does.
"""

import json
import logging
import os
import re
import shutil
import tempfile
import time
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

from damperfit.errors import ConfigurationError, OutputError
from damperfit.problem import Option

_LOGGER = logging.getLogger(__name__)

_OURS = ".damperfit-"
_STAGING = f"{_OURS}new-"  # prefix of staging folders
_COMMITTED = f"{_OURS}committed"
_WRITER = f"{_OURS}lock"  # held while a set is written
_RUN = f"{_OURS}run"  # held while a run is at work whose results go there
_REMOVED = ".removed"  # in a staging folder: names that go when the set appears
_PATIENCE = 30.0  # s; the largest sets take some
_RUN_PATIENCE = 1.0  # s; `settle` of another command may hold the lock of a run for a moment


class FileSet:
    """Files of one folder that are about to be replaced together; `file_set` makes it."""

    def __init__(self, folder: Path, staging: Path, *, spares_others: bool) -> None:
        self.folder, self.staging = folder, staging
        self.names: list[str] = []
        self._removed: list[str] = []
        self._spares_others = spares_others
        self._is_committed = False

    def path(self, name: str) -> Path:
        """Return the path to write ``name`` to; it becomes part of the set."""
        if Path(name).name != name or name in {"", ".", ".."} or "\0" in name:
            text = f"{name!r} is not a plain file name; no file is written elsewhere"
            raise OutputError(text, code="bad-name")
        if name not in self.names:
            self.names.append(name)
        return self.staging / name

    def without(self, name: str) -> None:
        """Let a file of an earlier set, if there is one, go when this set appears."""
        self._removed.append(name)

    def spare(self) -> None:
        """Refuse to write over files of another origin, where these are spared.

        `_commit` does it too; a writer of two sets calls it for both before either is committed.
        """
        for name in self.names if self._spares_others else ():
            target = self.folder / name
            if target.is_file() and not _is_own_file(target, self.staging / name):
                text = (
                    "is there already, and damperfit did not write it as this kind of file; "
                    "nothing was written. Give {overwrite} to replace it, or another {out}"
                )
                options = {"overwrite": Option("overwrite"), "out": Option("out")}
                raise ConfigurationError(text, subject=target, code="is-there", **options)

    def _commit(self) -> None:
        (self.staging / _REMOVED).write_text(json.dumps(self._removed), encoding="utf-8")
        for name in (*self.names, _REMOVED):
            _flush(self.staging / name, os.O_RDWR)
        _flush_folder(self.staging)
        self.spare()
        for target in (self.folder / name for name in (*self.names, *self._removed)):
            if target.exists() and not target.is_file():  # a folder, a device, a pipe
                text = f"cannot write {target}: it exists and is not a regular file"
                raise OutputError(text, code="cannot-write")
            if os.name == "nt" and target.exists():  # a file that another program has open
                os.replace(target, target)
        self.staging.rename(self.folder / _COMMITTED)
        self._is_committed = True
        _move_committed(self.folder)


@contextmanager
def file_set(folder: Path, *, spares_others: bool = False) -> Iterator[FileSet]:
    """Open a set of files in ``folder``; they replace the old ones when the block ends well.

    The folder is made when it does not exist. When the block raises, no target has changed and no
    temporary file is left. Sets of one folder are written one after the other, so that no block
    opens a second one there. With ``spares_others`` a ConfigurationError refuses to write over a
    file of another origin; an OutputError says that the folder cannot be written.
    """
    files = None
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with _writing(folder):
            staging = Path(tempfile.mkdtemp(prefix=_STAGING, dir=folder))
            try:
                files = FileSet(folder, staging, spares_others=spares_others)
                yield files
                files._commit()  # noqa: SLF001 - its own
            finally:
                shutil.rmtree(staging, ignore_errors=True)
        _LOGGER.debug("written to %s: %s", folder, ", ".join(sorted(files.names)))
    except OSError as error:
        if files is not None and files._is_committed:  # noqa: SLF001 - its own
            raise _interrupted(folder, error) from error
        raise _unwritten(folder, error, files.names if files else ()) from error


def write_text(path: Path, text: str) -> None:
    """Write one UTF-8 text file whole or not at all."""
    with file_set(path.parent) as files:
        files.path(path.name).write_text(text, encoding="utf-8", newline="\n")


def path_of(value: object, where: Option | str, expected: str) -> Path:
    """Return a path given as text or as a path; refuse anything else."""
    is_empty = isinstance(value, str) and not value
    kind = "''" if is_empty else type(value).__name__
    text = f"found {kind}; expected {expected}"
    if "\0" in str(value):
        text = f"found {value!r}; a NUL cannot stand in a path"
    elif isinstance(value, str | os.PathLike) and not is_empty:
        return Path(os.path.expanduser(os.fspath(value)))  # noqa: PTH111 - of ~nobody it raises
    elif is_empty:
        text += ", '.' for this folder"  # it would be this one
    place: dict[str, Any] = {"subject" if isinstance(where, str) else "where": where}
    raise ConfigurationError(text, code="not-a-path", **place)


def check_writable(folder: Path | None) -> None:
    """Raise, before any work, where results could not be written; None: nothing is written."""
    if folder is None:
        return

    def refusal(code: str, reason: str, subject: object = folder) -> ConfigurationError:
        return ConfigurationError(f"cannot be written: {reason}", code=code, subject=subject)

    if re.match(r"[a-z][a-z0-9+.-]+:/", folder.as_posix()):
        address = re.sub(r":/+", "://", folder.as_posix(), count=1)
        text = "results go to a folder of this machine, not to an address; give a folder, and copy"
        raise refusal("no-address", f"{text} it there when all is done", address)
    if "\0" in str(folder):
        raise refusal("no-path", "a NUL cannot stand in a path", repr(str(folder)))
    try:
        os.getcwd()  # noqa: PTH109
    except OSError as error:
        if not folder.is_absolute():
            text = "the folder that this was started in is gone; go to one that is there (cd)"
            raise refusal("no-working-folder", text) from error
    nearest = folder
    while not os.path.lexists(nearest) and nearest != nearest.parent:
        nearest = nearest.parent
    if not nearest.is_dir():
        raise refusal("not-a-folder", f"{nearest} is not a folder")
    if not os.access(nearest, os.W_OK | os.X_OK):
        text = f"cannot be written: {nearest} is write-protected"
        raise OutputError(text, code="write-protected", subject=folder)


@contextmanager
def reserved(folder: Path) -> Iterator[None]:
    """Lock a folder, made if need be, for the results of a run during its work.

    A folder that stays empty is removed again. Reading there, and writing other files, stay
    possible.
    """
    missing = [parent for parent in (folder, *folder.parents) if not os.path.lexists(parent)]
    refusal = (
        f"{folder}: another run is at work there; wait for it to end, or give this one a folder of "
        "its own{out}"
    )
    with ExitStack() as stack:
        stack.callback(_remove_empty, missing)
        try:
            folder.mkdir(parents=True, exist_ok=True)
            settle(folder)
            stack.enter_context(_locked(folder / _RUN, patience=_RUN_PATIENCE, refusal=refusal))
        except OSError as error:
            raise _unwritten(folder, error) from error
        yield


def _remove_empty(folders: Iterable[Path]) -> None:
    for folder in folders:
        with suppress(OSError):  # results stand in it
            folder.rmdir()


def settle(folder: Path) -> None:
    """Finish what a killed run left in a results folder; call it before reading there.

    The folder may be missing or read-only, as long as nothing is left to do.
    """
    try:
        names = {path.name for path in folder.iterdir() if path.name.startswith(_OURS)}
        # The holder of the lock of a set that is not committed is at work and cleans up itself.
        if _COMMITTED in names or (names - {_RUN} and not _is_held(folder / _WRITER)):
            with _writing(folder):
                pass
        if _RUN in names:
            _is_held(folder / _RUN)
    except OSError as error:  # a folder that cannot be listed is refused when it is read
        if os.path.lexists(folder / _COMMITTED):
            raise _interrupted(folder, error) from error


def _move_committed(folder: Path) -> None:
    """Move the remaining files of a committed set over their targets."""
    committed = folder / _COMMITTED
    list_of_removed = committed / _REMOVED
    for path in sorted(committed.iterdir()):
        if path.name != _REMOVED:
            os.replace(path, folder / path.name)
    if list_of_removed.exists():  # it goes last
        for name in json.loads(list_of_removed.read_text(encoding="utf-8")):
            (folder / Path(name).name).unlink(missing_ok=True)
        _flush_folder(folder)
    list_of_removed.unlink(missing_ok=True)
    committed.rmdir()


@contextmanager
def _writing(folder: Path) -> Iterator[None]:
    """Lock a folder for writing, and remove what killed writers left."""
    busy = (
        f"{folder}: another run has been writing there for {_PATIENCE:g} s; wait for it to end, or "
        "give another folder"
    )
    with _locked(folder / _WRITER, patience=_PATIENCE, refusal=busy) as has_locks:
        if os.path.lexists(folder / _COMMITTED):
            _move_committed(folder)
        # Without locks its writer may still be at work.
        for stale in folder.glob(f"{_STAGING}*") if has_locks else ():
            shutil.rmtree(stale, ignore_errors=True)
        yield


@contextmanager
def _locked(path: Path, *, patience: float, refusal: str) -> Iterator[bool]:
    """Hold the lock of a file that is made for it and removed with it, where there are locks."""
    until = time.monotonic() + patience
    while True:
        with suppress(BlockingIOError), _lock_held(path) as (number, has_locks):
            # Its last holder may have removed the file that was just opened.
            if path.exists() and os.path.samestat(os.fstat(number), path.stat()):
                try:
                    yield has_locks
                    return
                finally:
                    with suppress(OSError):
                        path.unlink()
        if time.monotonic() >= until:
            raise OutputError(refusal, out=Option("out", is_aside=True), code="locked")
        time.sleep(0.02)


def _is_held(path: Path) -> bool:
    """Whether a lock is held; that of a killed process goes."""
    try:
        with _locked(path, patience=0.0, refusal=""):
            return False
    except OutputError:
        return True


@contextmanager
def _lock_held(path: Path) -> Iterator[tuple[int, bool]]:
    """Make a file and hold its lock where the file system has locks; a held one is refused."""
    no_link = getattr(os, "O_NOFOLLOW", 0)
    try:
        number = os.open(path, os.O_RDWR | os.O_CREAT | no_link, 0o666)
    except PermissionError:  # left by a killed run of another user
        number = os.open(path, os.O_RDONLY | no_link)
    try:
        has_locks = _lock(number, is_held=True)
        try:
            yield number, has_locks
        finally:  # not by closing alone: a copy of this process may have it open
            with suppress(OSError):
                _lock(number, is_held=False)
    finally:
        with suppress(OSError):  # the files are written, whatever happens to the lock
            os.close(number)


def _lock(number: int, *, is_held: bool) -> bool:
    """Lock or unlock an open file, False without locks; a BlockingIOError: it is held."""
    if os.name == "nt":
        import msvcrt

        mode = msvcrt.LK_NBLCK if is_held else msvcrt.LK_UNLCK  # type: ignore[attr-defined,unused-ignore]
        try:
            msvcrt.locking(number, mode, 1)  # type: ignore[attr-defined,unused-ignore]
        except OSError as error:
            raise BlockingIOError from error
        return True
    import fcntl

    try:
        fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB if is_held else fcntl.LOCK_UN)
    except BlockingIOError:
        raise
    except OSError:
        _LOGGER.debug("this file system has no locks")
        return False
    return True


def _flush(path: Path, flags: int) -> None:
    number = os.open(path, flags)
    try:
        os.fsync(number)
    finally:
        os.close(number)


def _flush_folder(folder: Path) -> None:
    """Make renames durable; Windows and some network file systems cannot, and need not."""
    with suppress(OSError):
        _flush(folder, os.O_RDONLY)


def _unwritten(folder: Path, error: OSError, names: Iterable[str] = ()) -> OutputError:
    is_earlier = any(os.path.lexists(folder / name) for name in (*names, "run.json"))
    note = "; earlier results there are untouched" if is_earlier else ""
    text = f"cannot be written: {error.strerror or error}{note}"
    return OutputError(text, code="cannot-write", subject=folder)


def _interrupted(folder: Path, error: OSError) -> OutputError:
    return OutputError(
        f"{folder}: results were written there, but not all files could be moved to their place: "
        f"{error.strerror or error}; make the folder writable, and the next command that looks "
        "there ends it",
        code="cannot-write",
    )


# A file is damperfit's where it begins as the new one does and holds "damperfit" near its beginning
# or its end (as pictures, archives and Parquet do), or where it is a CSV with the same columns in
# any units. Tables beside a run.json are results, which only `identify` replaces.
_HEAD, _TAIL = 16384, 65536  # bytes; the columns of a table of parameters take thousands
_FEWEST = 3  # columns of a table
_COLUMN = re.compile(rb"\"?([A-Za-z][A-Za-z0-9]*)\w*( \[[^\]]*\])?\"?")


def _is_own_file(target: Path, draft: Path) -> bool:
    """Whether a file was written by damperfit, of the kind of another one."""
    with target.open("rb") as file, draft.open("rb") as new_file:
        old, new = file.read(_HEAD), new_file.read(_HEAD)
        file.seek(max(0, file.seek(0, 2) - _TAIL))
        tail = file.read()
    columns = _columns(new)
    if (columns or new.startswith(b"PAR1")) and (target.parent / "run.json").exists():
        return False
    if columns:
        return columns == _columns(old)
    return old[:4] == new[:4] and (b"damperfit" in old or b"damperfit" in tail)


def _columns(head: bytes) -> list[bytes]:
    """Return the first words of a CSV's column names, before units; else nothing."""
    line = head.removeprefix(b"\xef\xbb\xbf").split(b"\n")[0].strip()
    matches = [_COLUMN.fullmatch(cell) for cell in re.split(rb"[,;]", line)]
    words = [match[1] for match in matches if match]
    return words if len(words) == len(matches) >= _FEWEST else []
