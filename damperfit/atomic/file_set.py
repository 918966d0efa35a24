"""Write a set of files whole or not at all.

Every file is first written completely beside its target under a temporary name and flushed to
disk. Only when all of them stand are they renamed over their targets, under a lock and a journal of
what stood there before. A full disk or a failed rename puts the old files back; after a crash or a
power cut the next command that looks into the folder does. `os.replace` replaces a symbolic link
instead of writing through it.
"""

from __future__ import annotations

import logging
import os
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from damperfit.atomic.journal import Journal, draft, flush, keep_copy, temporary
from damperfit.atomic.own_files import refuse_others
from damperfit.atomic.owner import Owner, new_owner
from damperfit.atomic.recovery import explain, recovered
from damperfit.errors import ConfigurationError, OutputError

if TYPE_CHECKING:
    from collections.abc import Iterator

__all__ = ["FileSet", "check_writable", "file_set", "write_text"]

_LOGGER = logging.getLogger(__name__)


@dataclass
class FileSet:
    """Files of one folder that are about to be replaced together, in the order they were added."""

    folder: Path
    names: list[str] = field(default_factory=list)
    gone: list[str] = field(default_factory=list)
    owner: Owner = field(default_factory=new_owner)
    spares_others: bool = False  # files of another origin are not written over
    is_open: bool = False  # an exchange has begun and was neither ended nor undone

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
            raise OutputError(f"{name!r} is not a plain file name; no file is written elsewhere")
        if name not in self.names:
            self.names.append(name)
        return self._temporary(self.names.index(name), "new")

    def without(self, name: str) -> None:
        """Make a file of an earlier set go when this one appears, if it is there.

        Parameters
        ----------
        name : str
            File name inside the folder, without any folder part.
        """
        if name not in (*self.names, *self.gone):
            self.gone.append(name)

    def _temporary(self, number: int, kind: str) -> Path:
        return temporary(self.folder, self.owner.text, number, kind)

    def spare(self) -> None:
        """Refuse where a file of another origin is in the way and is spared.

        `commit` does it too; who writes two sets asks both before either is exchanged.

        Raises
        ------
        ConfigurationError
            Such a file is there.
        """
        for number, name in enumerate(self.names if self.spares_others else ()):
            refuse_others(self.folder / name, self._temporary(number, "new"))

    def commit(self) -> None:
        """Flush all files and exchange them for their targets; `file_set` calls it."""
        for number in range(len(self.names)):
            flush(self._temporary(number, "new"))
        self.spare()
        with recovered(self.folder):
            journal = self._prepared()
            try:
                journal.begin(self.folder)
            except FileExistsError as error:  # only where the file system has no locks
                raise OutputError(
                    f"cannot write to {self.folder}: another run is writing there; earlier "
                    "results there are untouched"
                ) from error
            self.is_open = True
            try:
                for number, name in enumerate(self.names):
                    os.replace(self._temporary(number, "new"), self.folder / name)
                for name in self.gone:
                    (self.folder / name).unlink(missing_ok=True)
                journal.end(self.folder)
            except BaseException:
                journal.undo(self.folder)
                raise
            finally:
                self.is_open = journal.stands(self.folder)

    def _prepared(self) -> Journal:
        """Keep what stands there under second names, and return what tells of it."""
        replaced, created = {}, {}
        for number, name in enumerate((*self.names, *self.gone)):
            target = self.folder / name
            if target.exists() and not target.is_file():  # a folder, a device, a pipe
                raise OutputError(f"cannot write {target}: it exists and is not a regular file")
            if os.path.lexists(target):
                keep_copy(target, self._temporary(number, "old"))
                replaced[name] = number
            elif name in self.names:
                created[name] = number
        return Journal(self.owner.text, replaced, created)

    def discard(self) -> None:
        """Remove what is left of temporary files; `file_set` calls it.

        Where an exchange could not be undone they are kept: the next run needs them.
        """
        if self.is_open:
            return
        for number in range(len(self.names) + len(self.gone)):
            for kind in ("new", "old"):
                with suppress(OSError):
                    self._temporary(number, kind).unlink(missing_ok=True)
        with suppress(OSError):
            draft(self.folder, self.owner.text).unlink(missing_ok=True)


@contextmanager
def file_set(folder: Path, *, spares_others: bool = False) -> Iterator[FileSet]:
    """Open a set of files in ``folder``; they replace the old ones when the block ends well.

    The folder is made when it does not exist. When the block raises, no target has changed and
    no temporary file is left. Sets of several runs are exchanged one after the other.

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
    files = FileSet(folder, spares_others=spares_others)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        yield files
        files.commit()
        _LOGGER.debug("written to %s: %s", folder, ", ".join(sorted(files.names)))
    except OSError as error:
        if files.is_open:
            raise OutputError(
                f"cannot write to {folder}: {error.strerror or error}; the next command that "
                "looks there puts the earlier results back"
            ) from error
        raise OutputError(explain(folder, error, files.names)) from error
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
