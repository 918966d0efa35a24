"""Where the logs of a fleet are: folders, patterns, object stores; those brought here."""

from __future__ import annotations

import hashlib
import os
import tempfile
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING

from damperfit.errors import ConfigurationError
from damperfit.fleet.stores import (
    UnreachableError,
    beginning_of,
    fetched,
    is_address,
    listed,
)
from damperfit.readers.formats import LOG_SUFFIXES
from damperfit.recording import natural_order
from damperfit.run.log_paths import matches
from damperfit.run.own_tables import is_own_table
from damperfit.store import remove_abandoned, temporary_folder

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

__all__ = ["Brought", "FleetLog", "KnownObject", "brought_here", "find_sources", "head_of"]

_SHOWN = ".csv, .txt, .xlsx, .mat, .tdms"
_FETCHED = "damperfit-logs-"  # prefix of temporary folders
_HEAD = 4096  # bytes of a log in which its preamble is looked for


@dataclass(frozen=True, slots=True)
class KnownObject:
    """What an earlier run found in an object of a store.

    Attributes
    ----------
    stamp : str
        What changes with its bytes.
    sha256 : str
        Of the bytes.
    owner : str
        Whose log it says it is, in its preamble.
    """

    stamp: str
    sha256: str
    owner: str


@dataclass(frozen=True, slots=True, order=True)
class FleetLog:
    """One log of a fleet.

    Attributes
    ----------
    place : str
        Absolute path, or the address in an object store.
    name : str
        Path below the folder or pattern that was asked for, with ``/``.
    seen : KnownObject, optional
        What is known of an object that has not changed since.
    """

    place: str
    name: str
    seen: KnownObject | None = field(default=None, compare=False)

    @property
    def is_remote(self) -> bool:
        """Whether it stands in an object store."""
        return is_address(self.place)

    @property
    def folder(self) -> str:
        """The folders that it stands in, below what was asked for; else the one that was."""
        parent = str(PurePosixPath(self.name).parent)
        place = PurePosixPath(self.place.replace("\\", "/").partition("?")[0])
        return place.parent.name if parent == "." else parent

    @property
    def file(self) -> str:
        """Its own name."""
        return PurePosixPath(self.name).name

    @property
    def fetched_to(self) -> PurePosixPath:
        """Where an object is put, below a folder: two folders may hold logs of one name."""
        parent = self.place.rpartition("/")[0].encode()
        return PurePosixPath(hashlib.sha256(parent).hexdigest()[:12], self.name)


def find_sources(wanted: Iterable[str]) -> tuple[FleetLog, ...]:
    """Return the logs that folders, files, patterns and addresses name, each once, in order.

    A folder stands for all logs in it and below: files with the suffix of a format that is read.

    Raises
    ------
    ConfigurationError
        Something names no file.
    """
    found: dict[str, FleetLog] = {}
    files: list[Path] = []
    wanted = list(wanted)
    local = (Path(one).resolve() for one in wanted if not is_address(one))
    common = _common([path for path in local if path.is_dir()])
    for text in wanted:
        if not is_address(text) and not Path(text).is_dir():
            files += _without_own(path.resolve() for path in matches(text))
            continue
        own = Path(text).resolve()
        if is_address(text):
            sources = [FleetLog(*one) for one in listed(text, _is_log)]
        else:
            sources = _below(own, common or own)
        if not sources:
            raise ConfigurationError(f"{text}: no log in it; expected files such as {_SHOWN}")
        for one in sources:
            found.setdefault(one.place, one)
    if not found and not files:
        raise ConfigurationError(
            f"{', '.join(wanted)}: no log there, but results of damperfit; give the logs"
        )
    # A shell makes files of a pattern: the folders that they share are left out of their names.
    root = _common([path.parent for path in files])
    for path in files:
        inside = path.relative_to(root or path.parent)
        found.setdefault(str(path), FleetLog(str(path), inside.as_posix()))
    return tuple(sorted(found.values(), key=lambda one: (natural_order(one.name), one.place)))


def _common(folders: Sequence[Path]) -> Path | None:
    """Return the folder that all are in; None where there is none, as on two drives."""
    try:
        return Path(os.path.commonpath(folders)) if folders else None
    except ValueError:
        return None


def _below(folder: Path, root: Path) -> list[FleetLog]:
    def refuse(error: OSError) -> None:
        raise ConfigurationError(f"{error.filename}: cannot be read: {error.strerror}") from error

    files = (
        Path(place, name)
        for place, folders, names in os.walk(folder, onerror=refuse)
        if _unhidden(folders)
        for name in names
        if _is_log(name)
    )
    return [FleetLog(str(path), path.relative_to(root).as_posix()) for path in _without_own(files)]


def _unhidden(folders: list[str]) -> bool:
    """Keep `os.walk` out of hidden folders, and those of a fleet's parts."""
    kept = (name for name in folders if not name.startswith((".", "serial=")))
    folders[:] = sorted(kept)
    return True


def _without_own(files: Iterable[Path]) -> Iterator[Path]:
    """Leave out what damperfit wrote itself: the results of a run may lie among its logs."""
    return (path for path in files if not is_own_table(path))


def _is_log(name: str) -> bool:
    return name.lower().endswith(LOG_SUFFIXES) and not name.startswith(".")


def head_of(source: FleetLog) -> bytes:
    """Return the first bytes of a log, in which its preamble stands; none if it cannot be read."""
    try:
        if source.is_remote:
            return beginning_of(source.place, _HEAD)
        if not Path(source.place).is_file():  # whoever opens a pipe waits for somebody to write
            return b""
        with Path(source.place).open("rb") as file:
            return file.read(_HEAD)
    except (OSError, UnreachableError):
        return b""


@dataclass(frozen=True, slots=True)
class Brought:
    """Logs as files of this machine.

    Attributes
    ----------
    paths : dict of FleetLog to pathlib.Path
        Where each stands.
    stamps : dict of FleetLog to str
        Of those from a store: what changes with the bytes; empty where that is not known.
    """

    paths: dict[FleetLog, Path]
    stamps: dict[FleetLog, str]


@contextmanager
def brought_here(sources: Sequence[FleetLog]) -> Iterator[Brought]:
    """Fetch logs from their stores into a temporary folder, each under its own name.

    Local logs stay where they are. The folder goes when the work is done.

    Raises
    ------
    UnreachableError
        A store does not give one of them.
    """
    paths = {source: Path(source.place) for source in sources}
    if not any(source.is_remote for source in sources):
        yield Brought(paths, {})
        return
    stamps: dict[FleetLog, str] = {}
    place = Path(tempfile.gettempdir())
    remove_abandoned(place, _FETCHED)
    with temporary_folder(_FETCHED, place) as folder:
        for source in sources:
            if source.is_remote:
                paths[source] = folder.joinpath(*source.fetched_to.parts)
                paths[source].parent.mkdir(parents=True, exist_ok=True)
                stamps[source] = fetched(source.place, paths[source])
        yield Brought(paths, stamps)
