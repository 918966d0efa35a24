"""Work in copies of this process, for many items that need nothing but their result.

    with copies_at_work(act, items, jobs=2) as found:    in the order of the items
        ...                                              what this process does meanwhile

A copy is a fork: it has every object that its parent has, so that nothing is packed on the way to
it, and only pages that one of both writes to take memory. Each copy takes the next item from a pipe
that all share and sends the result back through one of its own: arrays as they lie in memory, the
rest pickled, objects that the parent has too by their number.

Nothing hangs on a copy. An item whose work raises an error there, whose result cannot be sent, or
whose copy dies is done by the parent, where an error then is raised with its own traceback. So is
all of it where the system has no more processes or files to give.
"""

from __future__ import annotations

import copyreg
import ctypes
import dataclasses
import fcntl
import gc
import io
import logging
import os
import pickle
import selectors
import signal
import struct
import warnings
from contextlib import contextmanager, suppress
from functools import cache, partial
from types import MemberDescriptorType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

__all__ = ["copies_at_work", "is_copy"]

_LOGGER = logging.getLogger(__name__)
_LOOK = 0.1  # s; how often a waiting parent asks whether the user wants to stop
_ROOM = 1 << 20  # bytes of a pipe: a result goes in whole, and its copy goes on
_MOST_TURNS = 1024  # the smallest pipe holds them; beyond, a copy takes several items at a time
_TURN = struct.Struct("<I")
_HEAD = struct.Struct("<qq")
_SIZE = struct.Struct("<q")
_UNTOLD = -1  # parts of a result that its parent has to find itself
_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3  # as malloc.h names them
_KEPT = 1 << 28  # bytes
_STOPS = {signal.SIGINT, signal.SIGTERM, signal.SIGHUP}

_is_copy = False


def is_copy() -> bool:
    """Whether this process is a copy, whose results are all that is left of it."""
    return _is_copy


@contextmanager
def copies_at_work(
    act: Callable[[Any], Any],
    items: Sequence[Any],
    *,
    jobs: int,
    known: Sequence[object] = (),
    cancelled: Callable[[], bool] = lambda: False,
) -> Iterator[Iterator[Any]]:
    """Let copies begin, and yield what gives the results in the order of the items.

    Results that nobody takes wait in their copies; what is left at the end of the block ends there.
    Parameters are those of `damperfit.workers.apart`.
    """
    if _is_copy:  # one is enough
        yield map(act, items)
        return
    team = _Team(act, items, known)
    try:
        team.begin(jobs)
        yield team.results(cancelled)
    finally:
        team.end()


class _Team:
    """The copies at work, as their parent sees them."""

    def __init__(
        self, act: Callable[[Any], Any], items: Sequence[Any], known: Sequence[object]
    ) -> None:
        self._act, self._items, self._known = act, items, known
        self._places = {id(one): place for place, one in enumerate(known)}
        self._pickler: Callable[..., pickle.Pickler] = (
            partial(_KnowingPickler, places=self._places) if known else _Pickler
        )
        self._copies: dict[int, int] = {}  # process by the pipe that it answers through
        self._ears = selectors.DefaultSelector()

    @property
    def is_at_work(self) -> bool:
        """Whether an answer may still come."""
        return bool(self._copies)

    def begin(self, jobs: int) -> None:
        """Make the copies, as many as the system allows, and let them begin."""
        step = -(-len(self._items) // _MOST_TURNS)
        pipes: list[int] = []
        try:
            pipes += os.pipe()
            turns, deal = pipes
            os.write(deal, b"".join(map(_TURN.pack, range(0, len(self._items), step))))
            for _ in range(min(jobs, len(self._items))):
                self._copy(turns, deal, step)
        except OSError as error:  # no more processes, files or memory
            _LOGGER.debug("%d copies, for there are no more: %s", len(self._copies), error)
        finally:
            for pipe in pipes:
                os.close(pipe)

    def _copy(self, turns: int, deal: int, step: int) -> None:
        ear, mouth = os.pipe()
        self._ears.register(ear, selectors.EVENT_READ)
        with suppress(OSError):
            fcntl.fcntl(mouth, getattr(fcntl, "F_SETPIPE_SZ", 1031), _ROOM)
        # A signal between the fork and the copy's own handlers would run those of its parent.
        before = signal.pthread_sigmask(signal.SIG_BLOCK, _STOPS)
        try:
            with warnings.catch_warnings():
                # From 3.12 on it warns of any thread; those that are left mend themselves.
                warnings.simplefilter("ignore", DeprecationWarning)
                process = os.fork()
            if process == 0:
                self._live(turns, (deal, ear), mouth, step, before)
            self._copies[ear] = process
        except OSError:
            self._ears.unregister(ear)
            os.close(ear)
            raise
        finally:
            os.close(mouth)
            signal.pthread_sigmask(signal.SIG_SETMASK, before)

    def _live(
        self, turns: int, others: tuple[int, ...], mouth: int, step: int, mask: set[Any]
    ) -> None:
        """Do what a copy does; it ends in here, and nothing of its parent ends with it."""
        global _is_copy  # noqa: PLW0603 - what a process is it is altogether
        code = 1
        try:
            _is_copy = True
            gc.freeze()  # a collection would write to every page that is shared
            _keep_memory()
            for of_all in (signal.SIGINT, signal.SIGHUP):  # its parent's business
                signal.signal(of_all, signal.SIG_IGN)
            signal.signal(signal.SIGTERM, signal.SIG_DFL)
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)
            # Once its parent is gone nobody may be left that seems to listen.
            for other in (*others, *self._copies):
                os.close(other)
            while turn := os.read(turns, _TURN.size):
                (first,) = _TURN.unpack(turn)
                for place in range(first, min(first + step, len(self._items))):
                    _send(mouth, place, self._parts(place))
            code = 0
        finally:
            os._exit(code)

    def _parts(self, place: int) -> list[Any] | None:
        """Return a result as what goes through a pipe; None where the parent has to find it."""
        buffers: list[pickle.PickleBuffer] = []
        text = io.BytesIO()
        try:
            result = self._act(self._items[place])
            self._pickler(text, buffers).dump(result)
            return [text.getbuffer(), *(one.raw() for one in buffers)]
        except Exception:
            _LOGGER.debug("a copy leaves item %d to its parent", place, exc_info=True)
            return None

    def results(self, cancelled: Callable[[], bool]) -> Iterator[Any]:
        """Yield the results in the order of the items; what no copy can do is done here."""
        found: dict[int, Any] = {}
        for place, item in enumerate(self._items):
            while place not in found and self.is_at_work:
                found.update(self.heard())
                if cancelled():
                    self.end()
            yield found.pop(place) if place in found else self._act(item)

    def heard(self) -> Iterator[tuple[int, Any]]:
        """Yield the places and results that have come, after a short wait at most."""
        for key, _ in self._ears.select(_LOOK):
            ear = key.fd
            try:
                place, parts = _received(ear)
            except EOFError:
                self._forget(ear)
                continue
            if parts is None:
                continue
            text, *buffers = parts
            try:
                result = _Unpickler(io.BytesIO(text), self._known, buffers).load()
            except Exception:
                _LOGGER.debug("what a copy says of item %d cannot be read", place, exc_info=True)
                continue
            yield place, result

    def _forget(self, ear: int) -> None:
        """Take leave of a copy that has closed its pipe."""
        self._ears.unregister(ear)
        os.close(ear)
        process, status = self._copies.pop(ear), 0
        with suppress(ChildProcessError):  # who ignores SIGCHLD has no children to wait for
            _, status = os.waitpid(process, 0)
        if status:
            _LOGGER.debug("a copy ended with status %d; what it left is done here", status)

    def end(self) -> None:
        """Let all copies go, whatever they are doing."""
        for process in self._copies.values():
            with suppress(ProcessLookupError):
                os.kill(process, signal.SIGKILL)
        for ear in list(self._copies):
            self._forget(ear)
        self._ears.close()


def _keep_memory() -> None:
    """Let a copy keep the memory that it has freed: it wants as much for its next item.

    The C library gives arrays of more than 128 kB back to the system at once: each of them comes
    with its pages anew, a tenth of the time that a fit takes.
    """
    with suppress(OSError, AttributeError):  # of GNU's C library
        adjust = ctypes.CDLL(None).mallopt
        adjust(_TRIM_THRESHOLD, _KEPT)
        adjust(_MMAP_THRESHOLD, _KEPT // 8)  # no more than 32 MB


class _Pickler(pickle.Pickler):
    """Pickles a result."""

    def __init__(self, file: io.BytesIO, buffers: list[pickle.PickleBuffer]) -> None:
        super().__init__(file, protocol=5, buffer_callback=buffers.append)

    def reducer_override(self, one: object) -> Any:
        """Take a frozen dataclass with slots by its values.

        As Python does; but that asks for the names of the fields object by object, on both sides.
        """
        kind: Any = type(one)
        slots = _slots_of(kind)
        if slots is None:
            return NotImplemented
        values = tuple([slot.__get__(one) for slot in slots])
        return copyreg.__newobj__, (kind,), values, None, None, _fill  # type: ignore[attr-defined]


class _KnowingPickler(_Pickler):
    """Pickles a result; what the parent has too goes by its place. Each number is asked for."""

    def __init__(
        self, file: io.BytesIO, buffers: list[pickle.PickleBuffer], places: Mapping[int, int]
    ) -> None:
        self._places = places
        super().__init__(file, buffers)

    def persistent_id(self, one: object) -> int | None:
        return self._places.get(id(one))


@cache
def _slots_of(kind: Any) -> tuple[MemberDescriptorType, ...] | None:
    """Return where the values of a dataclass lie; None where it goes another way, or is none."""
    ways = (getattr(kind, name, None) for name in ("__getstate__", "__setstate__"))
    if any(getattr(way, "__module__", "") != dataclasses.__name__ for way in ways):
        return None
    slots = [getattr(kind, field.name) for field in dataclasses.fields(kind)]
    return tuple(slots) if all(isinstance(one, MemberDescriptorType) for one in slots) else None


def _fill(one: object, values: Sequence[object]) -> None:
    kind: Any = type(one)
    for slot, value in zip(_slots_of(kind) or (), values, strict=True):
        slot.__set__(one, value)


class _Unpickler(pickle.Unpickler):
    """Reads what `_Pickler` has written, in the process that has what it names."""

    def __init__(
        self, file: io.BytesIO, known: Sequence[object], buffers: Sequence[bytearray]
    ) -> None:
        super().__init__(file, buffers=buffers)
        self._known = known

    def persistent_load(self, place: int) -> object:
        return self._known[place]


def _send(mouth: int, place: int, parts: Sequence[Any] | None) -> None:
    sizes = [] if parts is None else [_SIZE.pack(one.nbytes) for one in parts]
    head = _HEAD.pack(place, _UNTOLD if parts is None else len(sizes))
    for part in (b"".join((head, *sizes)), *(parts or ())):
        left = memoryview(part)
        while left:
            left = left[os.write(mouth, left) :]


def _received(ear: int) -> tuple[int, list[bytearray] | None]:
    """Return the place of an item and the parts of its result.

    Raises
    ------
    EOFError
        The copy has ended.
    """
    place, n_parts = _HEAD.unpack(_bytes(ear, _HEAD.size))
    if n_parts == _UNTOLD:
        return place, None
    sizes = _bytes(ear, n_parts * _SIZE.size)
    return place, [_bytes(ear, size) for (size,) in _SIZE.iter_unpack(sizes)]


def _bytes(ear: int, n_bytes: int) -> bytearray:
    taken = bytearray(n_bytes)
    left = memoryview(taken)
    while left:
        n = os.readv(ear, [left])
        if n == 0:
            raise EOFError
        left = left[n:]
    return taken
