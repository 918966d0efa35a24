"""Where the logs of a fleet are: folders, patterns, object stores; those fetched to this machine.

A part holds for each object of a store its stamp when it was fetched (ETag, size, time of change)
and its content's hash and owner. An object whose stamp has not changed is not fetched again. Where
a store does not answer, its dampers fail and the run goes on.
"""

import fnmatch
import hashlib
import os
import re
import shutil
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from damperfit import __version__
from damperfit.errors import ConfigurationError, DamperfitError
from damperfit.fleets.parts import parts_in, read_facts_of
from damperfit.io.formats import LOG_SUFFIXES
from damperfit.recording import natural_order
from damperfit.run.log_files import is_own_table, matches, real_path
from damperfit.workers import executor

AT_ONCE = 16  # requests; nearly all of the time is waiting
_PATIENCE = 3  # s; the last of several tries may end much later
_ADDRESS = re.compile(r"[a-z][a-z0-9+.-]+://")
_EXAMPLES = ".csv, .txt, .xlsx, .mat, .tdms"
_HEAD = 4096  # bytes of a log in which its preamble is looked for


class UnreachableError(DamperfitError):
    """A log could not be fetched; that says nothing of the log, and is tried again another time."""


class KnownObject(NamedTuple):
    """What an earlier run read from an object of a store."""

    stamp: str  # what changes with its bytes
    sha256: str
    owner: str  # by its preamble
    date: str = ""  # likewise


@dataclass(frozen=True, slots=True, order=True)
class FleetLog:
    """One log of a fleet."""

    place: str  # absolute path, or the address in an object store
    name: str  # path below the named folder or pattern, with /
    earlier: KnownObject | None = field(default=None, compare=False)  # of one that has not changed

    @property
    def is_remote(self) -> bool:
        """Whether it stands in an object store."""
        return _is_address(self.place)

    @property
    def where(self) -> str:
        """Path or address of its folder."""
        place = self.place if self.is_remote else self.place.replace("\\", "/")
        return place.rpartition("/")[0]

    @property
    def folder(self) -> str:
        """Its folders below the one that was named; else the name of that one."""
        parent = str(PurePosixPath(self.name).parent)
        place = PurePosixPath(self.place.replace("\\", "/").partition("?")[0])
        return place.parent.name if parent == "." else parent

    @property
    def file(self) -> str:
        """Its own name."""
        return PurePosixPath(self.name).name

    @property
    def fetched_to(self) -> PurePosixPath:
        """Where an object is fetched to, below a folder; logs of one name stay apart."""
        parent = self.place.rpartition("/")[0].encode()
        return PurePosixPath(hashlib.sha256(parent).hexdigest()[:12], self.name)


def _is_address(text: str) -> bool:
    return _ADDRESS.match(text) is not None


# Object stores


@lru_cache(maxsize=16)
def _file_system(root: str) -> Any:
    """Return the store of an address; made once a process."""
    from pyarrow import fs

    try:
        return fs.FileSystem.from_uri(root)[0]
    except Exception as error:
        raise ConfigurationError(
            f"no such store: {error}", subject=root, code="no-address"
        ) from error


@contextmanager
def _reached(address: str) -> Iterator[tuple[Any, str, str]]:
    """Yield the store, the path inside, and the form of an address there."""
    scheme, location = address.split("://", 1)
    path, mark, query = location.partition("?")
    user, at, bucket = path.split("/", 1)[0].rpartition("@")
    path = path.removeprefix(user + at)
    if ":" in user:
        raise ConfigurationError(
            f"{scheme}://...@{path}: an address with a secret key in it would be written into the "
            "tables; leave it out and set AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY",
            code="secret-key",
        )
    try:
        root = f"{scheme}://{user}{at}{bucket}{mark}{query}"
        if scheme in {"gs", "gcs"} and "retry_limit_seconds=" not in query:  # else for 15 minutes
            root += f"{'&' if mark else '?'}retry_limit_seconds={_PATIENCE}"
        store = _file_system(root)
        yield store, path.rstrip("/"), f"{scheme}://{user}{at}{{}}{mark}{query}"
    except OSError as error:
        reason = str(error).partition(" error_info=")[0]  # of Google's, the same once more
        raise UnreachableError(f"cannot be fetched: {reason}", subject=address) from error


def _listed(address: str) -> list[FleetLog]:
    """Return the logs that an address names: one, a folder's, a pattern's (``*`` and ``[]``)."""
    from pyarrow import fs

    with _reached(address) as (store, path, form):
        pattern = path.split("/")
        first = next((k for k, name in enumerate(pattern) if re.search(r"[*\[]", name)), None)
        root = "/".join(pattern[:first])
        if store.get_file_info(root).type == fs.FileType.File:
            return [FleetLog(form.format(root), PurePosixPath(root).name)]
        below = store.get_file_info(fs.FileSelector(root, recursive=True, allow_not_found=True))

    def is_wanted(info: Any) -> bool:
        names = info.path.split("/")
        if first is None:
            return _is_log(info.base_name)
        return len(names) == len(pattern) and all(map(fnmatch.fnmatchcase, names, pattern))

    return [
        FleetLog(form.format(info.path), info.path[len(root) :].lstrip("/"))
        for info in below
        if info.type == fs.FileType.File and is_wanted(info)
    ]


def _stamp(file: Any) -> str:
    """Return a text that changes with an object's bytes; empty where its store has no ETag."""
    head = {
        key.lower(): value.decode("latin-1") if isinstance(value, bytes) else str(value)
        for key, value in (file.metadata() or {}).items()
    }
    values = [head.get(key, "") for key in ("etag", "content-length", "last-modified")]
    return " ".join(values) if values[0] else ""


def _stamp_of(address: str) -> str:
    """Return the stamp of an object: one request, which carries nothing of the object itself."""
    with _reached(address) as (store, path, _), store.open_input_file(path) as file:
        return _stamp(file)


def _fetched(address: str, path: Path) -> str:
    """Write an object to a file, and return its stamp; empty where it changed meanwhile."""
    with (
        _reached(address) as (store, inside, _),
        store.open_input_stream(inside) as source,
        path.open("wb") as file,
    ):
        stamp = _stamp(source)
        shutil.copyfileobj(source, file, 1 << 22)
    return stamp if stamp and stamp == _stamp_of(address) else ""


# Finding logs


def find_sources(names: Iterable[str]) -> tuple[FleetLog, ...]:
    """Return the logs that folders, files, patterns and addresses name, each once, in order.

    A folder stands for all logs in it and below: files with the suffix of a format that is read.
    """
    logs: dict[str, FleetLog] = {}
    files: list[Path] = []
    names = list(names)
    local = (real_path(text) for text in names if not _is_address(text))
    common = _common([path for path in local if path.is_dir()])
    for text in names:
        if not _is_address(text) and not Path(text).is_dir():
            files += (path for path in map(real_path, matches(text)) if not is_own_table(path))
            continue
        folder = real_path(text)
        sources = _listed(text) if _is_address(text) else _below(folder, common or folder)
        if not sources:
            raise ConfigurationError(
                f"no log in it; expected files such as {_EXAMPLES}", subject=text, code="no-log"
            )
        for log in sources:
            logs.setdefault(log.place, log)
    if not logs and not files:
        raise ConfigurationError(
            f"{', '.join(names)}: no log there, but results of damperfit; give the logs",
            code="no-log",
        )
    # A shell makes files of a pattern: the folders that they share are left out of their names.
    root = _common([path.parent for path in files])
    for path in files:
        inside = path.relative_to(root or path.parent)
        logs.setdefault(str(path), FleetLog(str(path), inside.as_posix()))
    return tuple(sorted(logs.values(), key=lambda log: (natural_order(log.name), log.place)))


def _common(folders: Sequence[Path]) -> Path | None:
    """Return the folder that holds all; None without one, as on two drives."""
    try:
        return Path(os.path.commonpath(folders)) if folders else None
    except ValueError:
        return None


def _below(folder: Path, root: Path) -> list[FleetLog]:
    """Return the logs in a folder; hidden ones, our own tables and those of parts left out."""

    def refuse(error: OSError) -> None:
        raise ConfigurationError(
            f"cannot be read: {error.strerror}", subject=error.filename, code="unreadable"
        ) from error

    logs = []
    for place, folders, names in os.walk(folder, onerror=refuse):
        folders[:] = sorted(
            name for name in folders if not name.startswith((".", "serial-", "serial="))
        )
        paths = [Path(place, name) for name in names if _is_log(name)]
        logs += [path for path in paths if not is_own_table(path)]
    return [FleetLog(str(path), path.relative_to(root).as_posix()) for path in logs]


def _is_log(name: str) -> bool:
    return name.lower().endswith(LOG_SUFFIXES) and not name.startswith(".")


def head_of(source: FleetLog) -> bytes:
    """Return the first bytes of a log, with its preamble; none if it cannot be read."""
    try:
        if source.is_remote:
            with _reached(source.place) as (store, path, _), store.open_input_file(path) as file:
                return bytes(file.read(_HEAD))
        if not Path(source.place).is_file():  # opening a pipe waits for its writer
            return b""
        with Path(source.place).open("rb") as file:
            return file.read(_HEAD)
    except (OSError, UnreachableError):
        return b""


@contextmanager
def brought_here(
    sources: Sequence[FleetLog],
) -> Iterator[tuple[dict[FleetLog, Path], dict[FleetLog, str]]]:
    """Fetch logs from their stores into a temporary folder, each under its own name.

    Local logs are not copied. Yields the path of each, and the stamps of those from a store; empty
    where one is not known. An `UnreachableError`: a log cannot be fetched.
    """
    paths = {source: Path(source.place) for source in sources}
    stamps: dict[FleetLog, str] = {}
    if not any(source.is_remote for source in sources):
        yield paths, stamps
        return
    with TemporaryDirectory(prefix="damperfit-logs-", ignore_cleanup_errors=True) as folder:
        for source in sources:
            if source.is_remote:
                paths[source] = Path(folder, source.fetched_to)
                paths[source].parent.mkdir(parents=True, exist_ok=True)
                stamps[source] = _fetched(source.place, paths[source])
        yield paths, stamps


def recognised(sources: Sequence[FleetLog], folder: Path) -> tuple[FleetLog, ...]:
    """Return sources with the `earlier` of objects that have not changed since an earlier run.

    Those read by another version are not used: it may have read another owner.
    """
    if not any(source.is_remote for source in sources):
        return tuple(sources)
    objects: dict[str, KnownObject] = {}
    for path in parts_in(folder):
        facts = read_facts_of(path)
        stored: Any = facts.get("seen") if facts.get("version") == __version__ else None
        for place, earlier in stored.items() if isinstance(stored, dict) else ():
            objects[place] = KnownObject(*map(str, earlier))

    def renewed(source: FleetLog) -> FleetLog:
        earlier = objects.get(source.place)
        try:
            is_same = earlier is not None and _stamp_of(source.place) == earlier.stamp
        except UnreachableError:  # fetching it raises again
            return source
        return replace(source, earlier=earlier) if is_same else source

    with executor(AT_ONCE) as pool:
        return tuple(pool.map(renewed, sources))
