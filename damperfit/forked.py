"""Work in copies of this process, for many items that need nothing but their result.

    with copies_at_work(act, items, jobs=2) as found:    in the order of the items
        ...                                              what this process does meanwhile

A copy is a fork: it has every object that its parent has, so that nothing is packed on the way to
it, and only pages that one of both writes to take memory. Each copy takes the next item from a pipe
that all share and sends the result, pickled, through one of its own; objects that the parent has
too go by their number. It pays: 200 logs take threads 1.3 to 1.6 times as long on two idle cores,
for work on arrays holds the interpreter's lock half of its time.

Nothing hangs on a copy. An item whose work raises an error there, whose result cannot be sent, or
whose copy dies is done by the parent, where an error then is raised with its own traceback. So is
all of it where the system has no more processes or files to give.
"""

from __future__ import annotations

import ctypes
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
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

_LOGGER = logging.getLogger(__name__)
_LOOK = 0.1  # s; how often a waiting parent asks whether the user wants to stop
_ROOM = 1 << 20  # bytes of a pipe: a result goes in whole, and its copy goes on
_MOST_TURNS = 1024  # the smallest pipe holds them; beyond, a copy takes several items at a time
_TURN = struct.Struct("<I")
_HEAD = struct.Struct("<qq")  # place of the item, bytes of its result; 0: its parent has to find it
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
        self._copies: dict[int, int] = {}  # process by the pipe that it answers through
        self._pipes = selectors.DefaultSelector()

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
        source, sink = os.pipe()
        self._pipes.register(source, selectors.EVENT_READ)
        with suppress(OSError):
            fcntl.fcntl(sink, getattr(fcntl, "F_SETPIPE_SZ", 1031), _ROOM)
        # A signal between the fork and the copy's own handlers would run those of its parent.
        before = signal.pthread_sigmask(signal.SIG_BLOCK, _STOPS)
        try:
            with warnings.catch_warnings():
                # From 3.12 on it warns of any thread; those that are left mend themselves.
                warnings.simplefilter("ignore", DeprecationWarning)
                process = os.fork()
            if process == 0:
                self._live(turns, (deal, source), sink, step, before)
            self._copies[source] = process
        except OSError:
            self._pipes.unregister(source)
            os.close(source)
            raise
        finally:
            os.close(sink)
            signal.pthread_sigmask(signal.SIG_SETMASK, before)

    def _live(
        self, turns: int, others: tuple[int, ...], sink: int, step: int, mask: set[Any]
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
                    answer = self._answer(place)
                    for part in (_HEAD.pack(place, len(answer)), answer):
                        left = memoryview(part)
                        while left:
                            left = left[os.write(sink, left) :]
            code = 0
        finally:
            os._exit(code)

    def _answer(self, place: int) -> bytes | memoryview:
        """Return a result as what goes through a pipe; nothing where the parent has to find it."""
        text = io.BytesIO()
        try:
            pickler = pickle.Pickler(text, protocol=5)
            if self._known:  # else each object would be asked for
                pickler = _KnowingPickler(text, protocol=5)
                pickler.places = self._places
            pickler.dump(self._act(self._items[place]))
        except Exception:
            _LOGGER.debug("a copy leaves item %d to its parent", place, exc_info=True)
            return b""
        return text.getbuffer()

    def results(self, cancelled: Callable[[], bool]) -> Iterator[Any]:
        """Yield the results in the order of the items; what no copy can do is done here."""
        found: dict[int, Any] = {}
        for place, item in enumerate(self._items):
            while place not in found and self._copies:
                found.update(self._received())
                if cancelled():
                    self.end()
            yield found.pop(place) if place in found else self._act(item)

    def _received(self) -> Iterator[tuple[int, Any]]:
        """Yield the places and results that have come, after a short wait at most."""
        for key, _ in self._pipes.select(_LOOK):
            try:
                place, size = _HEAD.unpack(_bytes(key.fd, _HEAD.size))
                answer = _bytes(key.fd, size)
            except EOFError:
                self._forget(key.fd)
                continue
            try:
                unpickler = _Unpickler(io.BytesIO(answer))
                unpickler.known = self._known
                yield place, unpickler.load()
            except Exception:
                _LOGGER.debug("there is no result of item %d", place, exc_info=True)

    def _forget(self, pipe: int) -> None:
        """Take leave of a copy that has closed its pipe."""
        self._pipes.unregister(pipe)
        os.close(pipe)
        process, status = self._copies.pop(pipe), 0
        with suppress(ChildProcessError):  # who ignores SIGCHLD has no children to wait for
            _, status = os.waitpid(process, 0)
        if status:
            _LOGGER.debug("a copy ended with status %d; what it left is done here", status)

    def end(self) -> None:
        """Let all copies go, whatever they are doing."""
        for process in self._copies.values():
            with suppress(ProcessLookupError):
                os.kill(process, signal.SIGKILL)
        for pipe in list(self._copies):
            self._forget(pipe)
        self._pipes.close()


def _keep_memory() -> None:
    """Let a copy keep the memory that it has freed: it wants as much for its next item.

    The C library gives arrays of more than 128 kB back to the system at once: each of them comes
    with its pages anew, a tenth of the time that a fit takes.
    """
    with suppress(OSError, AttributeError):  # of GNU's C library
        adjust = ctypes.CDLL(None).mallopt
        adjust(_TRIM_THRESHOLD, _KEPT)
        adjust(_MMAP_THRESHOLD, _KEPT // 8)  # no more than 32 MB


class _KnowingPickler(pickle.Pickler):
    """Pickles a result; what the parent has too goes by its place among the known objects."""

    places: dict[int, int]

    def persistent_id(self, one: object) -> int | None:
        return self.places.get(id(one))


class _Unpickler(pickle.Unpickler):
    """Reads a result in the process that has what it names."""

    known: Sequence[object]

    def persistent_load(self, place: int) -> object:
        return self.known[place]


def _bytes(pipe: int, n_bytes: int) -> bytearray:
    """Return so many bytes of a pipe."""
    taken = bytearray(n_bytes)
    left = memoryview(taken)
    while left:
        n = os.readv(pipe, [left])
        if n == 0:
            raise EOFError
        left = left[n:]
    return taken
