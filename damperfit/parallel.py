"""Work on many things at once: the one place that says who does it, and the protocol for all.

    with executor(jobs) as pool:        threads, or this thread where there is one job
        found = pool.map(act, items)    in the order of the items

Fleets hand dampers out through the same protocol, to processes that may die or to a cluster.
"""

from __future__ import annotations

from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

__all__ = ["Died", "Executor", "InTurn", "Threads", "executor"]


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
    ) -> Iterator[tuple[Any, Any]]:
        """As `Executor.each`."""
        waiting = iter(items)
        at_work: dict[Future[Any], Any] = {}
        try:
            while not cancelled():
                for _ in range(2 * self._number - len(at_work)):
                    try:
                        item = next(waiting)
                    except StopIteration:
                        break
                    at_work[self._pool.submit(act, item)] = item
                if not at_work:
                    return
                for future in wait(at_work, return_when=FIRST_COMPLETED).done:
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
