"""The linear algebra library on one thread, for as long as anybody has threads of his own.

BLAS threads spin between small products and take the core that another setting or log needs. Their
number belongs to the process: where two runs overlap in it, the first lowers it, the last puts it
back. Each by itself would put back what it found, and leave one thread for good.
"""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any

_lock = threading.Lock()
_usual: dict[str, tuple[Any, int]] = {}  # libraries by their files, and threads they had
_holders: list[object] = []


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Keep BLAS at one thread; the last of those who overlap gives it its threads back."""
    holder, changed = object(), list[tuple[Any, int]]()
    with _lock:
        _holders.append(holder)
        for library in _libraries():
            usual = library, library.get_num_threads()
            if getattr(library, "threading_layer", "") == "openmp":  # each thread has its own
                changed.append(usual)
            else:
                _usual.setdefault(library.filepath, usual)
            _set(library, 1)
    try:
        yield
    finally:
        with _lock:
            _holders.remove(holder)
            if not _holders:
                changed += _usual.values()
                _usual.clear()
            for library, threads in changed:
                _set(library, threads)


@cache
def _libraries() -> tuple[Any, ...]:
    """Return what does the products of NumPy, and of SciPy where it is loaded by then."""
    from threadpoolctl import ThreadpoolController

    return tuple(ThreadpoolController().select(user_api="blas").lib_controllers)


def _set(library: Any, threads: int) -> None:
    """Set the number of a library's threads from whatever thread this is."""
    # Newer threadpoolctl lets only the thread that was first to ask; the last to end may be
    # another.
    clear = getattr(library, "clear_controlling_thread", lambda **_: None)
    clear(force=True)
    library.set_num_threads(threads)
    clear(force=True)
