"""The journal of a set that is being exchanged: what stood there before, and how to put it back.

It stands from before the first rename until after the last one, which is what makes a set appear at
once: while it stands the old set is what counts, and whoever finds it puts that back. Each step of
putting back may be done twice, so it may be interrupted too.
"""

from __future__ import annotations

import json
import os
import shutil
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from damperfit.atomic.owner import Owner, owner_of
from damperfit.errors import OutputError

__all__ = ["JOURNAL", "Journal", "draft", "flush", "keep_copy", "read_journal", "temporary"]

JOURNAL = ".damperfit-journal"
_FORMAT = 1


@dataclass(frozen=True, slots=True)
class Journal:
    """What is exchanged in a folder.

    Attributes
    ----------
    owner : str
        Who does it, as in the names of the temporary files.
    replaced : dict of str to int
        Files that stood there before, and the numbers of their copies.
    created : dict of str to int
        Files that did not, and the numbers of what is to become of them.
    """

    owner: str
    replaced: dict[str, int]
    created: dict[str, int]

    @property
    def writer(self) -> Owner:
        """Who does it."""
        return owner_of(draft(Path(), self.owner).name) or Owner("", 0, 0, 0)

    def begin(self, folder: Path) -> None:
        """Let the journal stand, durably and whole; from here on the exchange can be undone.

        Raises
        ------
        FileExistsError
            Another exchange has begun meanwhile.
        """
        path = draft(folder, self.owner)
        path.write_text(json.dumps({"format": _FORMAT, **asdict(self)}), encoding="utf-8")
        flush(path)
        _flush_folder(folder)  # the copies are found there if the journal is
        try:
            os.link(path, folder / JOURNAL)  # where one stands, this fails
        except FileExistsError:
            raise
        except (OSError, NotImplementedError, AttributeError):  # file systems without hard links
            os.replace(path, folder / JOURNAL)

    def stands(self, folder: Path) -> bool:
        """Whether the exchange is neither ended nor undone."""
        return os.path.lexists(folder / JOURNAL)

    def end(self, folder: Path) -> None:
        """Take the journal away: what stands now counts."""
        _flush_folder(folder)
        (folder / JOURNAL).unlink()
        _flush_folder(folder)

    def undo(self, folder: Path) -> None:
        """Put back what stood there before, and take the journal away; nothing once it is gone."""
        if not self.stands(folder):
            return
        for name, number in self.replaced.items():
            with suppress(FileNotFoundError):  # is put back already
                os.replace(temporary(folder, self.owner, number, "old"), folder / name)
        for name, number in self.created.items():
            if os.path.lexists(temporary(folder, self.owner, number, "new")):
                continue  # was never put there; what has this name is somebody else's
            with suppress(FileNotFoundError):
                (folder / name).unlink()
        self.end(folder)


def draft(folder: Path, owner: str) -> Path:
    """Return where a journal is written before it stands."""
    return folder / f".{owner}.damperfit-new"


def temporary(folder: Path, owner: str, number: int, kind: str) -> Path:
    """Return the path of a temporary file: ``kind`` is new or old."""
    return folder / f".{owner}-{number}.damperfit-{kind}"


def read_journal(folder: Path) -> tuple[Journal, float] | None:
    """Return the journal that stands in a folder, and when it was written; None without one.

    Raises
    ------
    OutputError
        It is none of damperfit's, or damaged.
    OSError
        It cannot be read.
    """
    path = folder / JOURNAL
    try:
        text, written = path.read_bytes(), path.stat().st_mtime
    except (FileNotFoundError, NotADirectoryError):
        return None
    try:
        return _parsed(json.loads(text)), written
    except (ValueError, TypeError, KeyError, RecursionError) as error:
        raise OutputError(
            f"{folder}: writing results was interrupted there, and {JOURNAL}, which says how to "
            f"put the earlier ones back, cannot be read ({error}); run again into another folder, "
            "or remove that file to keep the files there, which may come from two runs"
        ) from error


def _parsed(record: Any) -> Journal:
    """Return a journal from its document, of which nothing is taken on trust."""
    if record["format"] != _FORMAT:
        raise ValueError("of another version")
    replaced, created = dict(record["replaced"]), dict(record["created"])
    if not all(_is_plain(name) for name in (*replaced, *created)):
        raise ValueError("a name leads out of the folder")
    if not all(type(one) is int for one in (*replaced.values(), *created.values())):
        raise ValueError("a number is none")
    if owner_of(draft(Path(), record["owner"]).name) is None:
        raise ValueError("the writer is not named")
    return Journal(record["owner"], replaced, created)


def _is_plain(name: object) -> bool:
    is_name = isinstance(name, str) and name not in {"", ".", ".."} and "\0" not in name
    return is_name and Path(str(name)).name == name


def flush(path: Path) -> None:
    """Let what was written to a file reach the disk."""
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


def keep_copy(target: Path, old: Path) -> None:
    """Keep a file under a second name until its successor stands."""
    try:
        os.link(target, old, follow_symlinks=False)
    except (OSError, NotImplementedError):  # file systems without hard links
        shutil.copy2(target, old, follow_symlinks=False)
        if not old.is_symlink():
            flush(old)
