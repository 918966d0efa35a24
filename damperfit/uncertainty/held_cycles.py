"""Steady cycles or segments of a log, parted from those that are fitted."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from damperfit.errors import ConfigurationError, LogError
from damperfit.units.quantities import parse_quantity

if TYPE_CHECKING:
    from damperfit.recording import Stretch, Trace

__all__ = ["SegmentRange", "split_cycles"]


@dataclass(frozen=True, slots=True)
class SegmentRange:
    """The segments of a log that have a frequency, or a peak speed, within limits.

    Attributes
    ----------
    dimension : str
        "frequency" or "velocity".
    low, high : float
        Limits, both included, Hz or m/s.
    """

    dimension: str
    low: float
    high: float

    @classmethod
    def parse(cls, text: str) -> SegmentRange | None:
        """Return the range that a text says, as in "4Hz-10Hz" or "0.2m/s-"; None: it says none.

        Raises
        ------
        ConfigurationError
            The upper limit lies below the lower one.

        Examples
        --------
        >>> SegmentRange.parse("0.2m/s-")
        SegmentRange(dimension='velocity', low=0.2, high=inf)
        >>> SegmentRange.parse("run-2.csv") is None
        True
        """
        number = r"(?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?"
        for dimension, units in (("frequency", "k?Hz"), ("velocity", "m?m/s|in/s")):
            limit = f"({number} ?(?:{units}))?"
            found = re.fullmatch(f"{limit} ?- ?{limit}", text.strip(), re.IGNORECASE)
            if found is None or not any(found.groups()):
                continue
            low, high = (
                parse_quantity(end, dimension) if end else default
                for end, default in zip(found.groups(), (0.0, math.inf), strict=True)
            )
            if low > high:
                raise ConfigurationError(
                    f"{text}: the upper limit lies below the lower one; expected as in 4Hz-10Hz"
                )
            return cls(dimension, low, high)
        return None

    def holds(self, segment: Stretch) -> bool:
        """Whether a segment lies within the limits."""
        is_speed = self.dimension == "velocity"
        return self.low <= (segment.peak_speed if is_speed else segment.frequency) <= self.high

    def split(self, trace: Trace) -> tuple[Trace | None, Trace | None]:
        """Return a log without the segments within the limits, and with these alone.

        None stands for a part without a segment.
        """
        parts = []
        for is_held in (False, True):
            kept = tuple(part for part in trace.stretches if self.holds(part) is is_held)
            parts.append(replace(trace, stretches=kept) if kept else None)
        return parts[0], parts[1]


def split_cycles(trace: Trace, cycles: float) -> tuple[Trace, Trace]:
    """Return a log without its last steady cycles, and with these alone.

    The last ones of each stretch, in one piece: where a log drifts, from warming or gas, it shows
    there, and the filter's memory joins the two parts at one place only. A stretch with too few
    cycles to part is fitted whole.

    Parameters
    ----------
    trace : Trace
        A log.
    cycles : float
        Whole number of cycles, or below 1 a share of them (one at least).

    Raises
    ------
    LogError
        No cycle would be left to fit.

    Examples
    --------
    15 cycles with ``cycles=0.2`` or 3: twelve are fitted, three predicted.
    """
    fitted, held_out = [], []
    for stretch in trace.stretches:
        n = stretch.n_cycles
        held = max(1, round(cycles * n)) if cycles < 1.0 else round(cycles)
        if held < n:
            edge, starts = round(float(stretch.cycle_starts[n - held])), stretch.cycle_starts
            ahead, behind = stretch.smeared
            inner = starts[: n - held + 1]
            fitted.append(replace(stretch, stop=edge, cycle_starts=inner, smeared=(ahead, 0)))
            outer = starts[n - held :]
            held_out.append(replace(stretch, first=edge, cycle_starts=outer, smeared=(0, behind)))
        else:
            fitted.append(stretch)
    if not held_out:
        n = max(stretch.n_cycles for stretch in trace.stretches)
        held = max(1, round(cycles))
        raise LogError(
            f"{n} steady cycle{'s' if n > 1 else ''}, of which {held} are to be held "
            "out: none is left to fit; hold out fewer, or give a longer log",
            subject=trace.name,
        )
    return replace(trace, stretches=tuple(fitted)), replace(trace, stretches=tuple(held_out))
