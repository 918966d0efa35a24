"""Looking on while a command works: a progress bar on a terminal, and signals that end it.

Ctrl-C, SIGTERM and SIGHUP: the first asks the run to finish what it has, the second ends it.
"""

from __future__ import annotations

import signal
import sys
import threading
import time
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING, Any

from damperfit.cli.console import say

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from damperfit.run.identify import Watch

_APART = 0.1  # s; a fit of a fast model takes less than to draw a line


@contextmanager
def stop_on_signal(
    promise: str = "finished settings will be written", stop: threading.Event | None = None
) -> Iterator[Callable[[], bool]]:
    """Yield what says whether the user wants the run to stop; the first signal sets the event.

    The promise says what becomes of the work done so far.
    """
    if threading.current_thread() is not threading.main_thread():
        yield lambda: False  # Python delivers signals to the main thread only
        return
    stop = stop or threading.Event()

    def handle(number: int, frame: Any) -> None:
        if stop.is_set():
            raise KeyboardInterrupt
        stop.set()
        say(f"damperfit: stopping; {promise} (again to end at once)")

    watched = [signal.SIGINT, signal.SIGTERM]
    hung_up = getattr(signal, "SIGHUP", None)  # not on Windows
    if hung_up is not None and signal.getsignal(hung_up) is not signal.SIG_IGN:  # as by nohup
        watched.append(hung_up)
    before = {number: signal.signal(number, handle) for number in watched}
    try:
        yield stop.is_set
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def looking_on(*, is_quiet: bool, of_fleet: bool = False, **more: Any) -> Watch:
    """Return who looks on while a command works; of a fleet dampers are counted, not settings.

    Further fields of `Watch` may be given.
    """
    from damperfit.run.identify import Watch

    first, words = ("dampers", "dampers") if of_fleet else ("reading logs", "fitting settings")
    stop = threading.Event()
    bars: list[Any] = []
    drawn = 0.0

    @contextmanager
    def working() -> Iterator[None]:
        how: Any = {"promise": "dampers that are done are kept"} if of_fleet else {}
        with stop_on_signal(**how, stop=stop), ExitStack() as stack:
            if not is_quiet and sys.stderr.isatty():
                bars.append(stack.enter_context(_bar(of_fleet=of_fleet)))
                bars[0].add_task(first, total=None)
            yield

    def draw(how: str, **what: Any) -> None:
        nonlocal drawn
        for bar in bars:
            getattr(bar, how)(bar.task_ids[0], **what)
            if time.monotonic() >= drawn:
                bar.refresh()
                drawn = time.monotonic() + _APART

    return Watch(
        on_start=lambda number: draw("update", total=number, description=words),
        on_fit=lambda _: draw("advance"),
        cancelled=stop.is_set,
        during_work=working,
        **more,
    )


def _bar(*, of_fleet: bool) -> Any:
    from rich import progress
    from rich.console import Console
    from rich.text import Text

    class Rate(progress.ProgressColumn):
        """Dampers a minute."""

        def render(self, task: Any) -> Text:
            speed = task.finished_speed or task.speed
            return Text("" if speed is None else f"{60.0 * speed:.0f} a minute")

    columns: list[Any] = [progress.TextColumn("{task.description}"), progress.BarColumn()]
    columns += [progress.MofNCompleteColumn()]
    columns += [Rate(), progress.TimeRemainingColumn()] if of_fleet else []
    # Drawn by whoever counts: beside a thread that draws no copy of this process can be made.
    console = Console(stderr=True)
    return progress.Progress(*columns, console=console, transient=True, auto_refresh=of_fleet)
