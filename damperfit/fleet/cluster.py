"""The same work on a Dask cluster; nothing is kept in its scheduler but names."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

from damperfit.errors import ConfigurationError, InstallationError
from damperfit.parallel import Died

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

__all__ = ["Cluster"]

_AHEAD = 4  # items given to each thread of the cluster before one is done
_PATIENCE = "10s"
_LOOK = 0.2  # s
_ALONE = 60.0  # s without a worker


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
                "--scheduler needs Dask, which is not installed: pip install 'damperfit[cluster]'"
            ) from error
        try:
            self._client = Client(address, timeout=_PATIENCE, set_as_default=False)
        except (OSError, ValueError) as error:
            raise ConfigurationError(
                f"--scheduler {address}: no scheduler answers ({error}); start one with dask "
                "scheduler, and workers with dask worker"
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
        """As `damperfit.parallel.Executor.each`."""
        from distributed import wait

        waiting = iter(items)
        at_work: dict[Any, Any] = {}
        since = time.monotonic()
        try:
            while not cancelled():
                room = _AHEAD * max(1, sum(self._client.nthreads().values())) - len(at_work)
                for item in _first(waiting, room):
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
                f"--scheduler: no worker for {_ALONE:.0f} s; start some with dask worker"
            )
        return since


def _first(items: Iterator[Any], number: int) -> Iterator[Any]:
    for _ in range(max(0, number)):
        try:
            yield next(items)
        except StopIteration:
            return


def _result(future: Any) -> Any:
    from distributed import KilledWorker

    if future.status == "error":
        error = future.exception()
        return Died() if isinstance(error, KilledWorker) else error
    return Died() if future.status != "finished" else future.result()
