"""Workers that may die: one process each, so that a death costs nobody else anything.

A pool of processes is broken as a whole by the death of one; here every worker is a pool of one,
and a thread that waits for it and makes a new one.
"""

from __future__ import annotations

import multiprocessing
import os
import queue
import signal
import threading
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from typing import TYPE_CHECKING, Any

from damperfit.parallel import Died

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

__all__ = ["Processes"]

_LOOK = 0.2  # s; how often a waiting thread asks whether the user wants to stop


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
        """As `damperfit.parallel.Executor.each`."""
        waiting = iter(items)
        _hush_tracker()
        guard = threading.Lock()
        done: queue.Queue[tuple[Any, Any] | None] = queue.Queue(maxsize=2 * self.number)
        closed = threading.Event()

        def stop() -> bool:
            return closed.is_set() or cancelled()

        def serve() -> None:
            worker = _Worker()
            if hasattr(
                signal, "pthread_sigmask"
            ):  # its processes inherit that, from the first line
                signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
            try:
                while not stop():
                    with guard:
                        item = next(waiting, None)
                    if item is None:
                        return
                    result = worker.do(act, item, stop)
                    if result is not None:
                        _put(done, (item, result), closed)
            finally:
                worker.end()
                _put(done, None, closed)

        threads = [threading.Thread(target=serve, daemon=True) for _ in range(self.number)]
        for thread in threads:
            thread.start()
        try:
            busy = len(threads)
            while busy:
                try:
                    found = done.get(timeout=_LOOK)  # a wait without end hears no signal on Windows
                except queue.Empty:
                    continue
                if found is None:
                    busy -= 1
                else:
                    yield found
        finally:
            closed.set()
            for thread in threads:
                thread.join()


def _put(done: queue.Queue[Any], found: Any, closed: threading.Event) -> None:
    while not closed.is_set():
        try:
            done.put(found, timeout=_LOOK)
        except queue.Full:
            continue
        return


class _Worker:
    """One process, made anew when it has died."""

    def __init__(self) -> None:
        self._pool: ProcessPoolExecutor | None = None

    def do(self, act: Callable[[Any], Any], item: Any, stop: Callable[[], bool]) -> Any:
        """Return the result, the exception or `Died`; None where the user wants to stop."""
        try:
            if self._pool is None:
                self._pool = _pool()
            future = self._pool.submit(act, item)
            while True:
                try:
                    return future.result(timeout=_LOOK)
                except TimeoutError:
                    if future.done() and (error := future.exception()) is not None:
                        return error
                    if stop():
                        self.end()
                        return None
        except BrokenProcessPool:
            self.end()
            return Died()
        except Exception as error:  # noqa: BLE001 - it is the result
            return error

    def end(self) -> None:
        """End the process at once; what it was writing was not there yet."""
        if self._pool is None:
            return
        for process in list((self._pool._processes or {}).values()):  # noqa: SLF001 - no other way
            process.kill()
        self._pool.shutdown(wait=True, cancel_futures=True)
        self._pool = None


def _pool() -> ProcessPoolExecutor:
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
    os.environ["PYTHONWARNINGS"] = quiet if before is None else f"{before},{quiet}"
    try:
        resource_tracker.ensure_running()
    finally:
        if before is None:
            del os.environ["PYTHONWARNINGS"]
        else:
            os.environ["PYTHONWARNINGS"] = before


def _begin() -> None:
    """In a new worker: Ctrl-C is its parent's business, and it ends when its parent does."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    parent = multiprocessing.parent_process()

    def watch() -> None:
        if parent is not None:
            parent.join()
            os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
