"""A progress bar over settings: on a terminal only, on stderr."""

from __future__ import annotations

import sys
import time
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from rich.progress import Progress

__all__ = ["Bar", "fleet_progress", "progress"]

_APART = 0.1  # s


class Bar:
    """Counts finished settings; without a terminal it counts in silence."""

    def __init__(self, shown: Progress | None = None) -> None:
        self._shown = shown
        self._next = 0.0
        self._task = None if shown is None else shown.add_task("reading logs", total=None)

    def start(self, n_settings: int) -> None:
        """Say how many settings there are; from here on the bar has a length."""
        if self._shown is not None and self._task is not None:
            self._shown.update(self._task, total=n_settings, description="fitting settings")
            self._draw()

    def advance(self, _done: object) -> None:
        """Count one finished setting."""
        if self._shown is not None and self._task is not None:
            self._shown.advance(self._task)
            self._draw()

    def _draw(self) -> None:
        """Draw it, ten times a second at most: a fit of a fast model takes less than a line."""
        if self._shown is not None and time.monotonic() >= self._next:
            self._shown.refresh()
            self._next = time.monotonic() + _APART


@contextmanager
def progress(*, is_wanted: bool) -> Iterator[Bar]:
    """Yield a bar that shows itself when stderr is a terminal and it is wanted."""
    if not (is_wanted and sys.stderr.isatty()):
        yield Bar()
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    # Drawn by whoever counts: beside a thread that draws no copy of this process can be made.
    with Progress(
        *columns, console=Console(stderr=True), transient=True, auto_refresh=False
    ) as shown:
        yield Bar(shown)


@contextmanager
def fleet_progress(n_dampers: int, *, is_wanted: bool) -> Iterator[Callable[[], None]]:
    """Yield what counts a damper that is done; a bar shows the rate and the time left."""
    if not (is_wanted and sys.stderr.isatty()):
        yield lambda: None
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        ProgressColumn,
        TextColumn,
        TimeRemainingColumn,
    )
    from rich.text import Text

    class Rate(ProgressColumn):
        """Dampers a minute."""

        def render(self, task: object) -> Text:
            speed = getattr(task, "finished_speed", None) or getattr(task, "speed", None)
            return Text("" if speed is None else f"{60.0 * speed:.0f} a minute")

    columns = (
        TextColumn("dampers"),
        BarColumn(),
        MofNCompleteColumn(),
        Rate(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as shown:
        task = shown.add_task("dampers", total=n_dampers)
        yield lambda: shown.advance(task)
