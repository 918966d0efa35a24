"""Write a set of files whole or not at all.

Every file is first written completely beside its target under a temporary name and flushed to
disk. Only when all of them stand are they renamed over their targets, the last one last, and the
folder is flushed. A crash, a full disk or a failed rename leaves the old files as they were.
`os.replace` replaces a symbolic link instead of writing through it.
"""

from __future__ import annotations

import os
import re
import shutil
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from damperfit.errors import ConfigurationError, OutputError

if TYPE_CHECKING:
    from collections.abc import Iterator

__all__ = ["FileSet", "check_writable", "file_set", "write_text"]

_TEMPORARY = re.compile(r"\.(?P<name>.+)\.(?P<pid>\d+)\.damperfit-(?:new|old)")


@dataclass
class FileSet:
    """Files of one folder that are about to be replaced together, in the order they were added."""

    folder: Path
    names: list[str] = field(default_factory=list)
    gone: list[str] = field(default_factory=list)

    def path(self, name: str) -> Path:
        """Return the temporary path to write ``name`` to; it becomes part of the set.

        Parameters
        ----------
        name : str
            File name inside the folder, without any folder part.

        Raises
        ------
        OutputError
            ``name`` points out of the folder.
        """
        if Path(name).name != name or name in {"", ".", ".."} or "\0" in name:
            raise OutputError(f"{name!r} is no plain file name; no file is written elsewhere")
        if name not in self.names:
            self.names.append(name)
        return self._temporary(name, "new")

    def without(self, name: str) -> None:
        """Make a file of an earlier set go when this one appears, if it is there.

        Parameters
        ----------
        name : str
            File name inside the folder, without any folder part.
        """
        if name not in self.names and os.path.lexists(self.folder / name):
            self.gone.append(name)

    def _temporary(self, name: str, kind: str) -> Path:
        return self.folder / f".{name}.{os.getpid()}.damperfit-{kind}"

    def commit(self) -> None:
        """Flush all files and rename them over their targets; `file_set` calls it."""
        for name in self.names:
            _flush(self._temporary(name, "new"))
            target = self.folder / name
            if target.exists() and not target.is_file():  # a folder, a device, a pipe
                raise OutputError(f"cannot write {target}: it exists and is not a regular file")
        for name in (*self.names, *self.gone):
            _keep_copy(self.folder / name, self._temporary(name, "old"))
        done: list[str] = []
        try:
            for name in self.names:
                os.replace(self._temporary(name, "new"), self.folder / name)
                done.append(name)
            for name in self.gone:
                (self.folder / name).unlink(missing_ok=True)
                done.append(name)
        except BaseException:
            for name in done:
                self._take_back(name)
            raise
        _flush_folder(self.folder)

    def _take_back(self, name: str) -> None:
        old = self._temporary(name, "old")
        if os.path.lexists(old):
            os.replace(old, self.folder / name)
        else:
            (self.folder / name).unlink(missing_ok=True)

    def discard(self) -> None:
        """Remove what is left of temporary files; `file_set` calls it."""
        for name in (*self.names, *self.gone):
            for kind in ("new", "old"):
                with suppress(OSError):
                    self._temporary(name, kind).unlink(missing_ok=True)


@contextmanager
def file_set(folder: Path) -> Iterator[FileSet]:
    """Open a set of files in ``folder``; they replace the old ones when the block ends well.

    The folder is made when it does not exist. When the block raises, no target has changed and
    no temporary file is left.

    Raises
    ------
    OutputError
        The folder or a file in it cannot be written.
    """
    files = FileSet(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        _remove_leftovers(folder)
        yield files
        files.commit()
    except OSError as error:
        raise OutputError(_explain(folder, error)) from error
    finally:
        files.discard()


def write_text(path: Path, text: str) -> None:
    """Write one UTF-8 text file whole or not at all.

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    with file_set(path.parent) as files:
        files.path(path.name).write_text(text, encoding="utf-8", newline="\n")


def check_writable(folder: Path) -> None:
    """Raise before any work is done when results could never be written to ``folder``.

    Raises
    ------
    ConfigurationError
        A file stands where the folder should be.
    OutputError
        The nearest existing folder is write-protected.
    """
    nearest = folder
    while not os.path.lexists(nearest) and nearest != nearest.parent:
        nearest = nearest.parent
    if not nearest.is_dir():
        raise ConfigurationError(f"cannot write to {folder}: {nearest} is not a folder")
    if not os.access(nearest, os.W_OK | os.X_OK):
        raise OutputError(f"cannot write to {folder}: {nearest} is write-protected")


def _explain(folder: Path, error: OSError) -> str:
    reason = error.strerror or str(error)
    return f"cannot write to {folder}: {reason}; earlier results there are untouched"


def _flush(path: Path) -> None:
    with path.open("rb+") as file:
        os.fsync(file.fileno())


def _flush_folder(folder: Path) -> None:
    """Make renames durable; Windows and some network file systems cannot, and need not."""
    with suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def _keep_copy(target: Path, old: Path) -> None:
    old.unlink(missing_ok=True)
    if not os.path.lexists(target):
        return
    try:
        os.link(target, old, follow_symlinks=False)
    except (OSError, NotImplementedError):  # file systems without hard links
        shutil.copy2(target, old, follow_symlinks=False)


def _remove_leftovers(folder: Path) -> None:
    """Remove what a killed run left; a run that is still alive keeps its temporary files."""
    for path in folder.iterdir():
        found = _TEMPORARY.fullmatch(path.name)
        if found and not _is_running(int(found["pid"])):
            with suppress(OSError):
                path.unlink()


def _is_running(pid: int) -> bool:
    if pid == os.getpid() or os.name != "posix":  # os.kill would end the process on Windows
        return True
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except (PermissionError, OverflowError):
        return True
    return True
