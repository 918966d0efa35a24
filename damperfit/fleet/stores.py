"""Logs in object stores: listed, fetched, and seen to be unchanged without being fetched.

A store that does not answer is asked again a few times and then given up for this run, so that it
costs a damper a sentence and the run nothing.
"""

from __future__ import annotations

import fnmatch
import queue
import re
import threading
import time
from functools import lru_cache
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any

from damperfit.errors import ConfigurationError, DamperfitError

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = [
    "UnreachableError",
    "beginning_of",
    "fetched",
    "is_address",
    "listed",
    "stamp_of",
]

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
        raise ConfigurationError(f"{root}: no such store: {error}") from error
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
            f"{address}: the list of its objects was not complete within {_LISTED:g} s; "
            "give the folders in it one by one"
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
                    f"{address}: cannot be fetched, tried {_TRIES} times: {error}"
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
