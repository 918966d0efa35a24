"""Who looks on while a run goes, and how long each part takes."""

from __future__ import annotations

import logging
import time
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from contextlib import AbstractContextManager

    from damperfit.configuration.options import Configuration
    from damperfit.run.auto_model import LawChoice

__all__ = ["Clock", "Watch"]

_LOGGER = logging.getLogger(__name__)


@dataclass(slots=True)
class Clock:
    """Seconds spent in each part of a run."""

    laps: dict[str, float] = field(default_factory=dict)
    started: float = field(default_factory=time.perf_counter)

    @contextmanager
    def lap(self, name: str) -> Iterator[None]:
        """Add the time spent inside to a part."""
        begin = time.perf_counter()
        try:
            yield
        finally:
            spent = time.perf_counter() - begin
            _LOGGER.debug("%s took %.3f s", name.removesuffix("_s"), spent)
            self.laps[name] = round(self.laps.get(name, 0.0) + spent, 4)

    def read(self) -> dict[str, float]:
        """Return the seconds of each part, and of all."""
        return self.laps | {"total_s": round(time.perf_counter() - self.started, 4)}


@dataclass(frozen=True, slots=True)
class Watch:
    """Who looks on while a run goes: progress, and the wish to stop.

    Attributes
    ----------
    on_start : callable
        Called with the number of settings when all logs are read.
    on_fit : callable
        Called with each `Fit`, log or damper when it is done, from any thread.
    cancelled : callable
        Asked now and then; once it says True, finished settings are written and the run ends.
    on_law : callable
        Called with the name of each law that was tried, where the logs choose it.
    on_choice : callable
        Called with the choice, what was asked for, and what is fitted.
    during_work : callable
        Makes a context that is entered while logs are read and fitted.
    """

    on_start: Callable[[int], None] = lambda _: None
    on_fit: Callable[[object], None] = lambda _: None
    cancelled: Callable[[], bool] = lambda: False
    on_law: Callable[[str], None] = lambda _: None
    on_choice: Callable[[LawChoice, Configuration, Configuration], None] = lambda *_: None
    during_work: Callable[[], AbstractContextManager[object]] = nullcontext
