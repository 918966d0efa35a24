"""Ctrl-C, SIGTERM, SIGHUP: the first asks the run to finish what it has, the second ends it."""

from __future__ import annotations

import signal
import threading
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from damperfit.cli.console import say

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

__all__ = ["stop_on_signal"]


@contextmanager
def stop_on_signal(
    promise: str = "finished settings will be written",
) -> Iterator[Callable[[], bool]]:
    """Yield a function that says whether the user wants the run to stop.

    Parameters
    ----------
    promise : str
        What becomes of the work done so far, for the user.
    """
    if threading.current_thread() is not threading.main_thread():
        yield lambda: False  # Python delivers signals to the main thread only
        return
    stop = threading.Event()

    def handle(number: int, frame: Any) -> None:
        if stop.is_set():
            raise KeyboardInterrupt
        stop.set()
        say(f"damperfit: stopping; {promise} (again to end at once)")

    watched = [signal.SIGINT, signal.SIGTERM]
    hung_up = getattr(signal, "SIGHUP", None)  # not on Windows
    if hung_up is not None and signal.getsignal(hung_up) is not signal.SIG_IGN:  # as by nohup
        watched.append(hung_up)
    before = [signal.signal(number, handle) for number in watched]
    try:
        yield stop.is_set
    finally:
        for number, handler in zip(watched, before, strict=True):
            signal.signal(number, handler)
