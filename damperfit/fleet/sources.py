"""Where the logs of a fleet are: folders, patterns, object stores; those brought here."""

from __future__ import annotations

import fnmatch
import hashlib
import os
import queue
import re
import tempfile
import threading
import time
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any

from damperfit import __version__
from damperfit.errors import ConfigurationError, DamperfitError
from damperfit.fleet.parts import parts_in, read_facts_of
from damperfit.io.formats import LOG_SUFFIXES
from damperfit.recording import natural_order
from damperfit.run.log_paths import matches, real_path
from damperfit.run.own_tables import is_own_table
from damperfit.store import remove_abandoned, temporary_folder
from damperfit.workers import executor

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

__all__ = [
    "AT_ONCE",
    "Brought",
    "FleetLog",
    "KnownObject",
    "UnreachableError",
    "beginning_of",
    "brought_here",
    "fetched",
    "find_sources",
    "head_of",
    "is_address",
    "listed",
    "recognised",
    "stamp_of",
]


# Logs in object stores: listed, fetched, and seen to be unchanged without being fetched.
#
# A store that does not answer is asked again a few times and then given up for this run, so that
# it costs a damper a sentence and the run nothing.

_ADDRESS = re.compile(r"[a-z][a-z0-9+.-]+://")
_TRIES = 4
_PAUSE = 0.5  # s before the second try; doubled before each further one
_CONNECTED = 10.0  # s for a connection to S3
_ANSWERED = 30.0  # s in which an answer of S3 may stand still
_DEADLINE = 60.0  # s for one answer of any store
_LISTED = 1800.0  # s for a whole list; a store gives a thousand objects an answer
_PIECE = 1 << 22  # bytes asked for at once; in the deadline that is 70 kB/s


class UnreachableError(DamperfitError):
    """A log could not be fetched; that says nothing of the log, and is tried again another time."""

    exit_code = 1


class _NoAnswerError(TimeoutError):
    """The deadline passed; no refusal of the store itself."""


def is_address(text: str) -> bool:
    """Whether a text is an address, as in ``s3://bucket/runs``."""
    return _ADDRESS.match(text) is not None


@lru_cache(maxsize=16)
def _file_system(root: str) -> Any:
    """The store that an address is in; made once a process."""
    from pyarrow import fs

    try:
        store = fs.FileSystem.from_uri(root)[0]
    except Exception as error:
        raise ConfigurationError(f"no such store: {error}", subject=root) from error
    return _with_patience(store)


def _with_patience(store: Any) -> Any:
    """Return an S3 store that waits for slow answers, and does not ask a silent host for minutes.

    By itself it gives an answer 3 s, asks thirty times, and no process ends meanwhile. An address
    cannot say otherwise, so that the store is made anew from what it would be pickled as.
    """
    from pyarrow import fs

    if not isinstance(store, getattr(fs, "S3FileSystem", ())):
        return store
    pickled: Any = store.__reduce__()
    make, (options,) = pickled
    once = fs.AwsStandardS3RetryStrategy(max_attempts=1)
    own = {"connect_timeout": _CONNECTED, "request_timeout": _ANSWERED, "retry_strategy": once}
    return make(options | own)


def _opened(address: str) -> tuple[Any, str, str]:
    """Return the store, the path inside, and what stands before and behind it in the address.

    Raises
    ------
    ConfigurationError
        There is no such store; or the address holds a secret, which tables would then show.
    """
    scheme, rest = address.split("://", 1)
    path, mark, query = rest.partition("?")
    user, at, bucket = path.split("/", 1)[0].rpartition("@")
    path = path.removeprefix(user + at)
    if ":" in user:
        raise ConfigurationError(
            f"{scheme}://...@{path}: an address with a secret key in it would be written into the "
            "tables; leave it out and set AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY"
        )
    store = _file_system(f"{scheme}://{user}{at}{bucket}{mark}{query}")
    return store, path.rstrip("/"), f"{scheme}://{user}{at}{{}}{mark}{query}"


def listed(address: str, is_wanted: Callable[[str], bool]) -> list[tuple[str, str]]:
    """Return address and name of each file that an address names: one, a folder's, a pattern's.

    Parameters
    ----------
    address : str
        A question mark begins its query, so that patterns know ``*`` and ``[]`` only.
    is_wanted : callable
        Whether a file of a folder is one, by its name.

    Raises
    ------
    UnreachableError
        The store does not answer, or its list takes too long.
    """
    from pyarrow import fs

    store, path, form = _opened(address)
    parts = path.split("/")
    first = next((k for k, part in enumerate(parts) if re.search(r"[*\[]", part)), None)
    root = "/".join(parts if first is None else parts[:first])

    info = _patiently(lambda: store.get_file_info(root), address)
    if info.type == fs.FileType.File:
        return [(form.format(root), PurePosixPath(root).name)]
    wanted = fs.FileSelector(root, recursive=True, allow_not_found=True)
    return [
        (form.format(one.path), one.path[len(root) :].lstrip("/"))
        for one in _patiently(lambda: _whole_list(store, wanted, address), address, is_long=True)
        if one.type == fs.FileType.File
        and (is_wanted(one.base_name) if first is None else _fits(one.path, path))
    ]


def _whole_list(store: Any, wanted: Any, address: str) -> Any:
    """Return what a store lists; one that is too slow is not asked for all of it again."""
    try:
        return _in_time(lambda: store.get_file_info(wanted), _LISTED)
    except _NoAnswerError:
        raise UnreachableError(
            f"the list of its objects was not complete within {_LISTED:g} s; "
            "give the folders in it one by one",
            subject=address,
        ) from None


def _fits(path: str, pattern: str) -> bool:
    own, wanted = path.split("/"), pattern.split("/")
    return len(own) == len(wanted) and all(map(fnmatch.fnmatchcase, own, wanted))


def stamp_of(address: str) -> str:
    """Return what changes with the bytes of an object; empty where its store tells no ETag.

    One request, which carries nothing of the object itself.

    Raises
    ------
    UnreachableError
        The store does not answer.
    """
    store, path, _ = _opened(address)

    def ask() -> str:
        with store.open_input_file(path) as file:
            return _stamp(file)

    said: str = _patiently(ask, address)
    return said


def _stamp(file: Any) -> str:
    head = {
        key.lower(): value.decode("latin-1") if isinstance(value, bytes) else str(value)
        for key, value in (file.metadata() or {}).items()
    }
    known = [head.get(key, "") for key in ("etag", "content-length", "last-modified")]
    return " ".join(known) if known[0] else ""


def beginning_of(address: str, size: int) -> bytes:
    """Return the first bytes of an object.

    Raises
    ------
    UnreachableError
        The store does not give them.
    """
    store, path, _ = _opened(address)

    def read() -> bytes:
        with store.open_input_file(path) as file:
            return bytes(file.read(size))

    found: bytes = _patiently(read, address)
    return found


def fetched(address: str, path: Path) -> str:
    """Write an object to a file, and return its stamp; empty where it changed meanwhile.

    Raises
    ------
    UnreachableError
        The store does not give it.
    """
    stamp: str = _patiently(lambda: _written(address, path), address, is_long=True)
    return stamp if stamp and stamp == stamp_of(address) else ""


def _written(address: str, path: Path) -> str:
    store, inside, _ = _opened(address)
    source = _in_time(lambda: store.open_input_stream(inside))
    stamp: str = _in_time(lambda: _stamp(source))
    with path.open("wb") as file:
        while piece := _in_time(lambda: source.read(_PIECE)):
            file.write(piece)
    source.close()  # not where a read still hangs in it
    return stamp


def _patiently(act: Callable[[], Any], address: str, *, is_long: bool = False) -> Any:
    """Try again what a network refused or left unanswered, a few times; then tell it."""
    for k in range(_TRIES):
        try:
            return act() if is_long else _in_time(act)
        except OSError as error:
            if k + 1 == _TRIES:
                raise UnreachableError(
                    f"cannot be fetched, tried {_TRIES} times: {error}", subject=address
                ) from error
            time.sleep(_PAUSE * 2**k)
    raise AssertionError


def _in_time(act: Callable[[], Any], deadline: float | None = None) -> Any:
    """Return what an act gives; after the deadline, by itself that of one answer, it is left alone.

    Raises
    ------
    _NoAnswerError
        It gives nothing in time.
    """
    patience = _DEADLINE if deadline is None else deadline
    given: queue.SimpleQueue[tuple[Any, BaseException | None]] = queue.SimpleQueue()

    def work() -> None:
        try:
            given.put((act(), None))
        except BaseException as error:  # noqa: BLE001 - it is raised by whoever waits
            given.put((None, error))

    threading.Thread(target=work, daemon=True).start()
    try:
        found, error = given.get(timeout=patience)
    except queue.Empty:
        raise _NoAnswerError(f"no answer within {patience:g} s") from None
    if error is not None:
        raise error
    return found


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
    local = (real_path(one) for one in wanted if not is_address(one))
    common = _common([path for path in local if path.is_dir()])
    for text in wanted:
        if not is_address(text) and not Path(text).is_dir():
            files += _without_own(map(real_path, matches(text)))
            continue
        own = real_path(text)
        if is_address(text):
            sources = [FleetLog(*one) for one in listed(text, _is_log)]
        else:
            sources = _below(own, common or own)
        if not sources:
            raise ConfigurationError(f"no log in it; expected files such as {_SHOWN}", subject=text)
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
        raise ConfigurationError(
            f"cannot be read: {error.strerror}", subject=error.filename
        ) from error

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


# Objects of a store that have not changed since an earlier run, seen without fetching them.
#
# A part says of each object what its store told when it was fetched (ETag, size, time of change)
# and what was found in it. Where the store tells the same today, the object is taken for the
# same. What another version found is not trusted: it may have read otherwise whose a log is.

AT_ONCE = 16  # requests; nearly all of the time is waiting


def recognised(sources: Sequence[FleetLog], folder: Path) -> tuple[FleetLog, ...]:
    """Return sources with what is known of those that have not changed since an earlier run.

    Parameters
    ----------
    sources : sequence of FleetLog
        Logs and tables of tests, in stores or not.
    folder : pathlib.Path
        Of the fleet.
    """
    if not any(one.is_remote for one in sources):
        return tuple(sources)
    known = _seen_in(folder)

    def one(source: FleetLog) -> FleetLog:
        seen = known.get(source.place) if source.is_remote else None
        if seen is None:
            return source
        try:
            is_same = stamp_of(source.place) == seen.stamp
        except UnreachableError:  # whoever fetches it says so
            return source
        return replace(source, seen=seen) if is_same else source

    with executor(AT_ONCE) as pool:
        return tuple(pool.map(one, sources))


def _seen_in(folder: Path) -> dict[str, KnownObject]:
    found: dict[str, KnownObject] = {}
    for path in parts_in(folder):
        facts = read_facts_of(path)
        seen_before: Any = facts.get("seen") if facts.get("version") == __version__ else None
        for place, seen in seen_before.items() if isinstance(seen_before, dict) else ():
            found[place] = KnownObject(*map(str, seen))
    return found
