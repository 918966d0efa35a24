"""Work on many things at once: the one place that says who does it, and the protocol for all.

    with executor(jobs) as pool:        threads, or this thread where there is one job
        found = pool.map(act, items)    in the order of the items

    found = apart(act, items, jobs=2)   the same, of many items in copies of this process

Work on arrays holds the interpreter's lock for a third to two thirds of its time: two threads do it
no faster than one. A copy of this process (a fork) knows the items and what is to be done with them
without a word, and sends back results alone. Fleets hand dampers out through the same protocol, to
processes that may die or to a cluster.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from concurrent.futures import (
    FIRST_COMPLETED,
    Future,
    ThreadPoolExecutor,
    wait,
)
from contextlib import contextmanager, suppress
from itertools import islice
from typing import TYPE_CHECKING, Any, Protocol

from damperfit.errors import ConfigurationError, InstallationError
from damperfit.own_process import child_environment
from damperfit.problem import Option

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
    from concurrent.futures import ProcessPoolExecutor

# Items from which on copies of this process gain more than they cost: two of them 20 to 30 ms of
# processor, as much as one log from reading to judged result.
_FEWEST_APART = 24
_LOOK = 0.2  # s; how often who waits asks whether the user wants to stop


class Died:
    """Stands for the result of work that ended its worker."""


class Executor(Protocol):
    """Who works on many things: this thread, several threads, processes, a cluster."""

    def each(
        self,
        act: Callable[[Any], Any],
        items: Iterable[Any],
        *,
        cancelled: Callable[[], bool] = ...,
    ) -> Iterator[tuple[Any, Any]]:
        """Yield each item with its result, `Died` or the exception it raised, as they are done.

        Parameters
        ----------
        act : callable
            Of a module, and what it takes can be pickled: a worker may be another process.
        items : iterable
            Taken as workers become free, so that memory does not grow.
        cancelled : callable
            Once it says True no further item is begun, and those at work are let go.
        """


class InTurn:
    """One thing after the other in this thread."""

    def map(self, act: Callable[..., Any], *items: Iterable[Any]) -> Iterator[Any]:
        """Yield the results in the order of the items."""
        return (act(*few) for few in zip(*items, strict=True))

    def each(
        self,
        act: Callable[[Any], Any],
        items: Iterable[Any],
        *,
        cancelled: Callable[[], bool] = lambda: False,
    ) -> Iterator[tuple[Any, Any]]:
        """As `Executor.each`."""
        for item in items:
            if cancelled():
                return
            try:
                found = act(item)
            except Exception as error:  # noqa: BLE001 - it is the result
                found = error
            yield item, found


class Threads:
    """Threads of this process: the compiled core and most of NumPy let others work meanwhile.

    Parameters
    ----------
    pool : concurrent.futures.ThreadPoolExecutor
        The threads.
    number : int
        How many.
    """

    def __init__(self, pool: ThreadPoolExecutor, number: int) -> None:
        self._pool, self._number = pool, number

    def map(self, act: Callable[..., Any], *items: Iterable[Any]) -> Iterator[Any]:
        """Yield the results in the order of the items; all are begun at once."""
        return self._pool.map(act, *items)

    def each(
        self,
        act: Callable[[Any], Any],
        items: Iterable[Any],
        *,
        cancelled: Callable[[], bool] = lambda: False,
    ) -> Generator[tuple[Any, Any]]:
        """As `Executor.each`."""
        waiting = iter(items)
        at_work: dict[Future[Any], Any] = {}
        try:
            while not cancelled():
                for item in islice(waiting, 2 * self._number - len(at_work)):
                    at_work[self._pool.submit(act, item)] = item
                if not at_work:
                    return
                # A wait without end hears no signal on Windows.
                for future in wait(at_work, _LOOK, return_when=FIRST_COMPLETED).done:
                    error = future.exception()
                    yield at_work.pop(future), future.result() if error is None else error
        finally:
            for future in at_work:
                future.cancel()


@contextmanager
def executor(jobs: int) -> Iterator[InTurn | Threads]:
    """Yield who does ``jobs`` things at a time in this process.

    Parameters
    ----------
    jobs : int
        From one on; below is one too.
    """
    if jobs <= 1:  # a thread costs its start, and gains nothing
        yield InTurn()
        return
    with ThreadPoolExecutor(jobs) as pool:
        yield Threads(pool, jobs)


def available_cores() -> int:
    """Return the number of cores this process may use."""
    with suppress(AttributeError):  # macOS and Windows have no affinity
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def apart(  # noqa: PLR0913 - one more than usual, for what is done beside it
    act: Callable[[Any], Any],
    items: Iterable[Any],
    *,
    jobs: int,
    known: Sequence[object] = (),
    cancelled: Callable[[], bool] = lambda: False,
    threads: int | None = None,
    beside: Callable[[], object] = lambda: None,
) -> Iterator[Any]:
    """Yield the results in the order of the items, of many items from copies of this process.

    Whatever ``act`` does beside returning its result is lost in a copy. An error that it raises
    there, or a copy that dies, costs time alone: this process does such an item itself.

    Parameters
    ----------
    act : callable
        Need not be of a module.
    items : iterable
        Of any kind.
    jobs : int
        Copies, or threads.
    known : sequence
        Objects that results may name: they come back as themselves, not as their like.
    cancelled : callable
        Once it says True copies are let go, and what they have left is done here.
    threads : int, optional
        How many where it is threads; else as many as jobs.
    beside : callable
        What this process does once the copies, or threads, have begun.
    """
    items = list(items)
    if _goes_to_copies(items, jobs):
        from damperfit.forked import copies_at_work  # POSIX alone has it

        with copies_at_work(act, items, jobs=jobs, known=known, cancelled=cancelled) as found:
            beside()
            yield from found
        return
    with executor(jobs if threads is None else threads) as pool:
        found = pool.map(act, items)
        beside()
        yield from found


def told_here(take: Callable[..., None]) -> Callable[..., None]:
    """Return what is told of errors; in a copy it raises them, so that its parent is told.

    Parameters
    ----------
    take : callable
        Called with what has met an error, and the error.
    """

    def told(whose: object, error: Exception) -> None:
        if "damperfit.forked" in sys.modules and sys.modules["damperfit.forked"].is_copy():
            raise error
        take(whose, error)

    return told


def _goes_to_copies(items: Sequence[object], jobs: int) -> bool:
    """Whether copies gain more than they cost, and can do the work."""
    return jobs > 1 and len(items) >= _FEWEST_APART and _may_be_copied()


def _may_be_copied() -> bool:
    """Whether a copy can do what this process does.

    A lock that another thread of Python holds stays locked in a copy for ever; the threads of Arrow
    and of OpenBLAS are made anew there. Libraries of macOS abort in one, Windows has none.
    """
    is_main = threading.current_thread() is threading.main_thread()
    return sys.platform == "linux" and is_main and threading.active_count() == 1


# Workers that may die: one process each, so that a death costs nobody else anything.
#
# A pool of processes is broken as a whole by the death of one; here every worker is a pool of
# one, and a thread that waits for it and makes a new one.


class Processes:
    """Processes on this machine.

    Parameters
    ----------
    number : int
        How many.
    """

    def __init__(self, number: int) -> None:
        self.number = number

    def each(
        self,
        act: Callable[[Any], Any],
        items: Iterable[Any],
        *,
        cancelled: Callable[[], bool] = lambda: False,
    ) -> Iterator[tuple[Any, Any]]:
        """As `damperfit.workers.Executor.each`."""
        os.getcwd()  # noqa: PTH109 - a new process asks too, and would fail item by item
        _hush_tracker()
        closed = threading.Event()
        mine = threading.local()
        workers: list[_Worker] = []

        def begin() -> None:
            _block_stops()  # its processes inherit that, from the first line
            mine.worker = _Worker(lambda: closed.is_set() or cancelled())
            workers.append(mine.worker)

        safe = child_environment()
        with (
            _environment({name: safe.get(name) for name in ("PYTHONPATH", "PYTHONSAFEPATH")}),
            ThreadPoolExecutor(self.number, initializer=begin) as pool,
        ):
            found = Threads(pool, self.number).each(
                lambda item: mine.worker.do(act, item), items, cancelled=cancelled
            )
            try:
                for item, result in found:
                    if not isinstance(result, _LetGo):
                        yield item, result
            finally:
                closed.set()
                found.close()
                pool.shutdown(wait=True, cancel_futures=True)
                for worker in workers:
                    worker.end()


class _LetGo:
    """Stands for the result of work that the user did not wait for."""


class _Worker:
    """One process, made anew when it has died."""

    def __init__(self, stop: Callable[[], bool]) -> None:
        self._stop = stop
        self._pool: ProcessPoolExecutor | None = None

    def do(self, act: Callable[[Any], Any], item: Any) -> Any:
        """Return the result, `Died`, or `_LetGo` where the user wants to stop."""
        from concurrent.futures.process import BrokenProcessPool

        try:
            if self._pool is None:
                self._pool = _pool()
            future = self._pool.submit(act, item)
            while not wait([future], timeout=_LOOK).done:
                if self._stop():
                    self.end()
                    return _LetGo()
            return future.result()
        except BrokenProcessPool:
            self.end()
            return Died()

    def end(self) -> None:
        """End the process at once; what it was writing was not there yet."""
        if self._pool is None:
            return
        for process in list((self._pool._processes or {}).values()):  # noqa: SLF001 - no other way
            process.kill()
        self._pool.shutdown(wait=True, cancel_futures=True)
        self._pool = None


def _block_stops() -> None:
    """Leave Ctrl-C and a terminal that hangs up to the main thread of the parent."""
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGHUP})


def _pool() -> ProcessPoolExecutor:
    import multiprocessing
    from concurrent.futures import ProcessPoolExecutor

    # A fork of a process with threads may hang; a new interpreter never does.
    return ProcessPoolExecutor(
        1, mp_context=multiprocessing.get_context("spawn"), initializer=_begin
    )


def _hush_tracker() -> None:
    """Start Python's tracker of semaphores so that it clears up after a killed run without a word.

    What it warns of, to whoever looks at a terminal long given back, is already put right.
    """
    if os.name != "posix":
        return
    from multiprocessing import resource_tracker

    before = os.environ.get("PYTHONWARNINGS")
    quiet = "ignore:resource_tracker:UserWarning"  # of several the last one counts
    with _environment({"PYTHONWARNINGS": quiet if before is None else f"{before},{quiet}"}):
        mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGHUP})
        try:
            resource_tracker.ensure_running()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)


@contextmanager
def _environment(wanted: Mapping[str, str | None]) -> Iterator[None]:
    """Let children have these variables, or None of them."""
    before = {name: os.environ.get(name) for name in wanted}
    _set(wanted)
    try:
        yield
    finally:
        _set(before)


def _set(variables: Mapping[str, str | None]) -> None:
    for name, text in variables.items():
        if text is None:
            os.environ.pop(name, None)
        else:
            os.environ[name] = text


def _begin() -> None:
    """In a new worker: Ctrl-C is its parent's business, and it ends when its parent does."""
    import multiprocessing

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    parent = multiprocessing.parent_process()

    def watch() -> None:
        if parent is not None:
            parent.join()
            os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


# The same work on a Dask cluster; nothing is kept in its scheduler but names.

_AHEAD = 4  # items given to each thread of the cluster before one is done
_PATIENCE = "10s"
_ALONE = 15.0  # s without a worker


class Cluster:
    """Workers of a Dask scheduler.

    Parameters
    ----------
    address : str
        Of the scheduler, as in ``tcp://10.0.0.1:8786``.

    Raises
    ------
    InstallationError
        The extra ``cluster`` is not installed.
    ConfigurationError
        No scheduler answers there.
    """

    def __init__(self, address: str) -> None:
        try:
            from distributed import Client
        except ImportError as error:
            raise InstallationError(
                "{scheduler} needs Dask, which is not installed: pip install 'damperfit[cluster]'",
                scheduler=Option("scheduler"),
            ) from error
        try:
            self._client = Client(address, timeout=_PATIENCE, set_as_default=False)
        except (OSError, ValueError) as error:
            raise ConfigurationError(
                f"no scheduler answers ({error}); start one with dask "
                "scheduler, and workers with dask worker",
                where=Option("scheduler", address),
            ) from error

    def close(self) -> None:
        """Leave the cluster; its workers go on with other people's work."""
        self._client.close()

    def each(
        self,
        act: Callable[[Any], Any],
        items: Iterable[Any],
        *,
        cancelled: Callable[[], bool] = lambda: False,
    ) -> Iterator[tuple[Any, Any]]:
        """As `damperfit.workers.Executor.each`."""
        from distributed import wait

        waiting = iter(items)
        at_work: dict[Any, Any] = {}
        since = time.monotonic()
        try:
            while not cancelled():
                room = _AHEAD * max(1, sum(self._client.nthreads().values())) - len(at_work)
                for item in islice(waiting, max(0, room)):
                    at_work[self._client.submit(act, item, pure=False)] = item
                if not at_work:
                    return
                since = self._refuse_to_wait_for_nobody(since)
                try:
                    with self._client.as_current():
                        found = wait(list(at_work), timeout=_LOOK, return_when="FIRST_COMPLETED")
                except TimeoutError:
                    continue
                for future in found.done:
                    yield at_work.pop(future), _result(future)
                    future.release()
        finally:
            self._client.cancel(list(at_work))

    def _refuse_to_wait_for_nobody(self, since: float) -> float:
        """Return when there last was a worker."""
        if self._client.nthreads():
            return time.monotonic()
        if time.monotonic() - since > _ALONE:
            raise ConfigurationError(
                f"no worker for {_ALONE:.0f} s; start some with dask worker",
                where=Option("scheduler"),
            )
        return since


def _result(future: Any) -> Any:
    from distributed import KilledWorker

    if future.status == "error":
        error = future.exception()
        return Died() if isinstance(error, KilledWorker) else error
    return Died() if future.status != "finished" else future.result()
