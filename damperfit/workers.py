"""Work in parallel: threads, processes that may die, a cluster.

    with executor(jobs) as pool:        threads, or this thread where there is one job
        results = pool.map(act, items)  in the order of the items

    for item, result in Processes(2).each(act, items):      as they are done; a death costs its item
    for item, result in Cluster(address).each(act, items):  the same on a Dask cluster

Simulations and fits spend most of their time in the core, which releases the interpreter's lock.
"""

import logging
import os
import pickle
import signal
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager, suppress
from itertools import islice
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any

from damperfit.errors import ConfigurationError, InstallationError
from damperfit.own_process import child_environment
from damperfit.problem import Option

_LOGGER = logging.getLogger(__name__)
_LOOK = 0.2  # s; how often a waiting process asks whether the user wants to stop


# Threads


class InTurn:
    """An executor that works in this thread."""

    def map(self, act: Callable[..., Any], *items: Iterable[Any]) -> Iterator[Any]:
        """Yield the results in the order of the items."""
        return map(act, *items)


Threads = ThreadPoolExecutor


@contextmanager
def executor(jobs: int) -> Iterator[InTurn | Threads]:
    """Yield an executor with ``jobs`` threads; one job works in this thread."""
    if jobs <= 1:
        yield InTurn()
        return
    with Threads(jobs) as pool:
        yield pool


def available_cores() -> int:
    """Return the number of cores this process may use."""
    with suppress(AttributeError):  # macOS and Windows have no affinity
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


# Processes that may die: new interpreters that get their work through pipes, so that a death costs
# one item. A fork of a process with threads may hang.

# This damperfit, wherever it is: no folder is added to those that modules are looked for in.
_NEW = """
import importlib.util, sys
spec = importlib.util.spec_from_file_location("damperfit", sys.argv[1])
sys.modules["damperfit"] = package = importlib.util.module_from_spec(spec)
spec.loader.exec_module(package)
from damperfit.workers import serve
serve(float(sys.argv[2]))
"""
_LENGTH = struct.Struct("<Q")
_FOREVER = threading.TIMEOUT_MAX


class Died:
    """The result of a task that ended its worker."""

    def __init__(self, cause: str = "", *, is_late: bool = False) -> None:
        self.cause, self.is_late = cause, is_late  # as "SIGSEGV"; it exceeded its time


class Worker:
    """A new interpreter that does one task after the other, and ends with this process."""

    def __init__(self, *, idle: float = _FOREVER, is_quiet: bool = False) -> None:
        package = str(Path(__file__).resolve().with_name("__init__.py"))
        # Ctrl-C and a terminal that hangs up are its parent's business, from its first line.
        stops = {getattr(signal, name) for name in ("SIGINT", "SIGHUP") if os.name == "posix"}
        before = signal.pthread_sigmask(signal.SIG_BLOCK, stops) if stops else set()
        try:
            self._process = subprocess.Popen(  # noqa: S603 - our own command
                [sys.executable, "-P", "-c", _NEW, package, str(idle)],
                # More threads would each take memory from what a log may have.
                env={"OMP_NUM_THREADS": "1", **child_environment(), "OPENBLAS_NUM_THREADS": "1"},
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL if is_quiet else None,
            )
        finally:
            if stops:
                signal.pthread_sigmask(signal.SIG_SETMASK, before)

    @property
    def is_alive(self) -> bool:
        """Whether it has not ended."""
        return self._process.poll() is None

    def do(self, act: Callable[[Any], Any], item: Any, seconds: float = _FOREVER) -> Any:
        """Return the result of an act, the exception that it raised, or `Died`.

        The act is a function of a module, and the item can be pickled. `seconds` limit its time.
        """
        begun, timer = time.monotonic(), threading.Timer(seconds, self._process.kill)
        timer.start()
        to_worker: Any = self._process.stdin
        answers: Any = self._process.stdout
        try:
            _send(to_worker, pickle.dumps((act, item), protocol=5))
            answer = _received(answers)
        except BrokenPipeError:
            answer = b""
        except BaseException:
            self.end()
            raise
        finally:
            timer.cancel()
        if answer:
            try:
                return pickle.loads(answer)  # noqa: S301 - of our own process
            except Exception as error:  # noqa: BLE001 - in place of one that cannot be read
                return error
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(1.0)
        self.end()
        code: int | str = self._process.returncode
        with suppress(ValueError):
            code = signal.Signals(-int(code)).name
        is_late = time.monotonic() - begun >= seconds
        return Died(code if isinstance(code, str) else f"code {code}", is_late=is_late)

    def end(self) -> None:
        """End the process at once, from any thread; an unfinished answer is lost."""
        self._process.kill()
        self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            with suppress(OSError, ValueError):  # what is left to be written has no reader
                pipe.close()  # type: ignore[union-attr]  # both are there


class Processes:
    """So many processes on this machine."""

    def __init__(self, number: int) -> None:
        self.number = number

    def each(
        self,
        act: Callable[[Any], Any],
        items: Iterable[Any],
        *,
        cancelled: Callable[[], bool] = lambda: False,
    ) -> Iterator[tuple[Any, Any]]:
        """Yield each item with its result, `Died` or the exception it raised, as they are done.

        As of `Worker.do`. Items are taken as workers become free, so that memory does not grow.
        Once `cancelled` returns True no further item is begun, and those at work are abandoned.
        """
        os.getcwd()  # noqa: PTH109 - a new process asks too, and would fail item by item
        waiting = iter(items)
        idle: list[Worker] = []
        at_work: dict[Future[Any], tuple[Worker, Any]] = {}
        with ThreadPoolExecutor(self.number) as pool:
            try:
                while not cancelled():
                    begun = list(islice(waiting, self.number - len(at_work)))
                    for item in begun:
                        try:
                            worker = idle.pop() if idle else Worker()
                        except OSError as error:  # no more processes or files
                            yield item, error
                            continue
                        at_work[pool.submit(worker.do, act, item)] = worker, item
                    if not (begun or at_work):
                        return
                    for done in wait(at_work, _LOOK, FIRST_COMPLETED).done:
                        worker, item = at_work.pop(done)
                        result = done.result()
                        idle += [] if isinstance(result, Died) else [worker]
                        yield item, result
            finally:
                for worker in (*idle, *(worker for worker, _ in at_work.values())):
                    worker.end()


def _send(pipe: Any, content: bytes) -> None:
    pipe.write(_LENGTH.pack(len(content)))
    pipe.write(content)
    pipe.flush()


def _received(pipe: Any) -> bytes:
    """Return a message; empty where the sender has ended before its end."""
    head = pipe.read(_LENGTH.size)
    (length,) = _LENGTH.unpack(head) if len(head) == _LENGTH.size else (0,)
    content: bytes = pipe.read(length)
    return content if len(content) == length else b""


def serve(idle: float) -> None:
    """Do the tasks on standard input, in the new interpreter, until it was idle for `idle` s."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # on Windows it is in its parent's group
    out = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # a library that prints would spoil the answers
    tasks: SimpleQueue[bytes] = SimpleQueue()

    def listen() -> None:
        try:
            while task := _received(sys.stdin.buffer):
                tasks.put(task)
                del task  # it may be a large log
        finally:  # the parent has ended, or there is no memory for what it sends
            os._exit(0)

    threading.Thread(target=listen, daemon=True).start()
    with suppress(Empty):
        while True:
            task = tasks.get(timeout=idle)
            try:
                act, item = pickle.loads(task)  # noqa: S301 - of the parent
                del task
                answer = pickle.dumps(act(item), protocol=5)
            except Exception as error:  # noqa: BLE001 - it is the result
                try:
                    answer = pickle.dumps(error)
                except Exception:  # noqa: BLE001 - it holds what cannot be sent
                    answer = pickle.dumps(RuntimeError(f"{type(error).__name__}: {error}"))
            _send(out, answer)
    os._exit(0)  # what a library does at exit is of no interest


# The same on a Dask cluster; nothing is kept in its scheduler but names.

_AHEAD = 4  # items given to each thread of the cluster before one is done
_ALONE = 15.0  # s without a worker


class Cluster:
    """Workers of a Dask scheduler."""

    def __init__(self, address: str) -> None:
        try:
            from distributed import Client
        except ImportError as error:
            raise InstallationError(
                "{--scheduler} needs Dask, which is not there: pip install 'damperfit[cluster]'",
                code="missing-library",
            ) from error
        try:
            self._client = Client(address, timeout="10s", set_as_default=False)
        except (OSError, ValueError) as error:
            raise ConfigurationError(
                f"no scheduler answers ({error}); start one with dask scheduler, and workers with "
                "dask worker",
                where=Option("scheduler", address),
                code="no-scheduler",
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
        """As `Processes.each`."""
        from distributed import KilledWorker, wait

        waiting = iter(items)
        at_work: dict[Any, Any] = {}
        since = time.monotonic()  # when there last was a worker
        try:
            while not cancelled():
                threads = sum(self._client.nthreads().values())
                for item in islice(waiting, max(0, _AHEAD * max(1, threads) - len(at_work))):
                    at_work[self._client.submit(act, item, pure=False)] = item
                if not at_work:
                    return
                if threads:
                    since = time.monotonic()
                elif time.monotonic() - since > _ALONE:
                    raise ConfigurationError(
                        f"no worker for {_ALONE:.0f} s; start some with dask worker",
                        where=Option("scheduler"),
                        code="no-worker",
                    )
                try:
                    with self._client.as_current():
                        outcome = wait(list(at_work), timeout=_LOOK, return_when="FIRST_COMPLETED")
                except TimeoutError:
                    continue
                for future in outcome.done:
                    error = future.exception() if future.status == "error" else None
                    if error is not None and not isinstance(error, KilledWorker):
                        result: Any = error
                    else:
                        result = future.result() if future.status == "finished" else Died()
                    yield at_work.pop(future), result
                    future.release()
        finally:
            self._client.cancel(list(at_work))
