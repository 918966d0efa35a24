"""Where the logs of a fleet are: folders, patterns, object stores; their bytes brought here."""

from __future__ import annotations

import fnmatch
import hashlib
import os
import re
import time
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from damperfit.errors import ConfigurationError, DamperfitError
from damperfit.readers.formats import LOG_SUFFIXES
from damperfit.recording import natural_order
from damperfit.run.log_paths import matches

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

__all__ = ["Source", "UnreachableError", "brought_here", "find_sources", "head_of"]

_ADDRESS = re.compile(r"[a-z][a-z0-9+.-]+://")
_PATTERN = re.compile(r"[*?\[]")
_TRIES = 4
_PAUSE = 0.5  # s before the second try; doubled before each further one
# Tables that stand beside run.json.
_RESULTS = frozenset(
    {"parameters", "mse", "adjustment", "characteristics", "responses", "profiles", "valves"}
)
_SHOWN = ".csv, .txt, .xlsx, .mat, .tdms"
_HEAD = 4096  # bytes of a log in which its preamble is looked for


class UnreachableError(DamperfitError):
    """A log could not be fetched; that says nothing of the log, and is tried again another time."""

    exit_code = 1


@dataclass(frozen=True, slots=True, order=True)
class Source:
    """One log of a fleet.

    Attributes
    ----------
    place : str
        Absolute path, or the address in an object store.
    name : str
        Path below the folder or pattern that was asked for, with ``/``.
    """

    place: str
    name: str

    @property
    def is_remote(self) -> bool:
        """Whether it stands in an object store."""
        return _ADDRESS.match(self.place) is not None

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


def find_sources(wanted: Iterable[str]) -> tuple[Source, ...]:
    """Return the logs that folders, files, patterns and addresses name, each once, in order.

    A folder stands for all logs in it and below: files with the suffix of a format that is read.

    Raises
    ------
    ConfigurationError
        Something names no file.
    """
    found: dict[str, Source] = {}
    files: list[Path] = []
    wanted = list(wanted)
    local = (Path(one).resolve() for one in wanted if not _ADDRESS.match(one))
    common = _common([path for path in local if path.is_dir()])
    for text in wanted:
        if not _ADDRESS.match(text) and not Path(text).is_dir():
            files += (path.resolve() for path in matches(text))
            continue
        own = Path(text).resolve()
        sources = _remote(text) if _ADDRESS.match(text) else _below(own, common or own)
        if not sources:
            raise ConfigurationError(f"{text}: no log in it; expected files such as {_SHOWN}")
        for one in sources:
            found.setdefault(one.place, one)
    # A shell makes files of a pattern: the folders that they share are left out of their names.
    root = _common([path.parent for path in files])
    for path in files:
        inside = path.relative_to(root or path.parent)
        found.setdefault(str(path), Source(str(path), inside.as_posix()))
    return tuple(sorted(found.values(), key=lambda one: (natural_order(one.name), one.place)))


def _common(folders: Sequence[Path]) -> Path | None:
    """Return the folder that all are in; None where there is none, as on two drives."""
    try:
        return Path(os.path.commonpath(folders)) if folders else None
    except ValueError:
        return None


def _below(folder: Path, root: Path) -> list[Source]:
    def refuse(error: OSError) -> None:
        raise ConfigurationError(f"{error.filename}: cannot be read: {error.strerror}") from error

    files = (
        Path(place, name)
        for place, folders, names in os.walk(folder, onerror=refuse)
        if _unhidden(folders)
        for name in names
        if _is_log(name) and not ("run.json" in names and _is_result(name))
    )
    return [Source(str(path), path.relative_to(root).as_posix()) for path in files]


def _unhidden(folders: list[str]) -> bool:
    """Keep `os.walk` out of hidden folders, and those of a fleet's parts."""
    kept = (name for name in folders if not name.startswith((".", "serial=")))
    folders[:] = sorted(kept)
    return True


def _is_result(name: str) -> bool:
    """Whether a file beside run.json is one of the results."""
    return name == "run.json" or name.partition(".")[0] in _RESULTS


def _is_log(name: str) -> bool:
    return name.lower().endswith(LOG_SUFFIXES) and not name.startswith(".")


@lru_cache(maxsize=16)
def _file_system(root: str) -> tuple[Any, str]:
    """The store that an address is in, and the path there; made once a process."""
    from pyarrow import fs

    try:
        store, path = fs.FileSystem.from_uri(root)
    except Exception as error:
        raise ConfigurationError(f"{root}: no such store: {error}") from error
    return store, path


def _opened(address: str) -> tuple[Any, str, str]:
    """Return the store, the path inside, and what stands before and behind it in the address."""
    scheme, rest = address.split("://", 1)
    path, mark, query = rest.partition("?")
    bucket = path.split("/", 1)[0]
    store, _ = _file_system(f"{scheme}://{bucket}{mark}{query}")
    return store, path.rstrip("/"), f"{scheme}://{{}}{mark}{query}"


def _remote(address: str) -> list[Source]:
    from pyarrow import fs

    # A question mark is the query of an address, so that patterns there know * and [] only.
    store, path, form = _opened(address)
    parts = path.split("/")
    first = next((k for k, part in enumerate(parts) if re.search(r"[*\[]", part)), None)
    root = "/".join(parts if first is None else parts[:first])

    def listed() -> list[Source]:
        info = store.get_file_info(root)
        if info.type == fs.FileType.File:
            return [Source(form.format(root), PurePosixPath(root).name)]
        found = store.get_file_info(fs.FileSelector(root, recursive=True, allow_not_found=True))
        return [
            Source(form.format(one.path), one.path[len(root) :].lstrip("/"))
            for one in found
            if one.type == fs.FileType.File
            and (_is_log(one.base_name) if first is None else _fits(one.path, path))
        ]

    found: list[Source] = _patiently(listed, address)
    return found


def _fits(path: str, pattern: str) -> bool:
    own, wanted = path.split("/"), pattern.split("/")
    return len(own) == len(wanted) and all(map(fnmatch.fnmatchcase, own, wanted))


def _patiently(act: Any, address: str) -> Any:
    """Try again what a network refused, a few times; what it still refuses is told."""
    for k in range(_TRIES):
        try:
            return act()
        except OSError as error:
            if k + 1 == _TRIES:
                raise UnreachableError(
                    f"{address}: cannot be fetched, tried {_TRIES} times: {error}"
                ) from error
            time.sleep(_PAUSE * 2**k)
    raise AssertionError


def head_of(source: Source) -> bytes:
    """Return the first bytes of a log; none where it cannot be read."""

    def read() -> bytes:
        if not source.is_remote:
            with Path(source.place).open("rb") as file:
                return file.read(_HEAD)
        store, path, _ = _opened(source.place)
        with store.open_input_file(path) as file:
            return bytes(file.read(_HEAD))

    try:
        return _patiently(read, source.place) if source.is_remote else read()
    except (OSError, UnreachableError):
        return b""


@contextmanager
def brought_here(sources: Sequence[Source]) -> Iterator[dict[Source, Path]]:
    """Fetch logs from their stores into a temporary folder, each under its own name.

    Local logs stay where they are. The folder goes when the work is done.

    Raises
    ------
    UnreachableError
        A store does not give one of them.
    """
    if not any(source.is_remote for source in sources):
        yield {source: Path(source.place) for source in sources}
        return
    with TemporaryDirectory(prefix="damperfit-logs-") as folder:
        here: dict[Source, Path] = {}
        for source in sources:
            here[source] = Path(source.place)
            if source.is_remote:
                # Two folders of stores may hold logs of one name.
                parent = source.place.rpartition("/")[0].encode()
                inside = hashlib.sha256(parent).hexdigest()[:12]
                path = Path(folder, inside, *PurePosixPath(source.name).parts)
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_bytes(_patiently(lambda one=source: _bytes(one), source.place))
                here[source] = path
        yield here


def _bytes(source: Source) -> bytes:
    store, path, _ = _opened(source.place)
    with store.open_input_stream(path) as file:
        return bytes(file.read())
