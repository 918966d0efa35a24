"""Numbers as one line of characters, for a terminal: `sparkline`."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable

__all__ = ["ASCII_LEVELS", "BLOCK_LEVELS", "sparkline"]

BLOCK_LEVELS = "▁▂▃▄▅▆▇█"
ASCII_LEVELS = ".:-=+*#@"  # for terminals and files that know nothing else: more ink is more


def sparkline(values: Iterable[float | None], *, levels: str = BLOCK_LEVELS) -> str:
    """Return one character a value, the lowest and the highest at the ends of ``levels``.

    A value that is not known is a blank. Equal values stand in the middle.

    Examples
    --------
    >>> sparkline([1.0, 2.0, None, 3.0, 8.0])
    '▁▂ ▃█'
    >>> sparkline([5.0, 5.0], levels=ASCII_LEVELS)
    '++'
    """
    known = [math.nan if value is None else float(value) for value in values]
    finite = [value for value in known if math.isfinite(value)]
    if not finite:
        return " " * len(known)
    low, span = min(finite), max(finite) - min(finite)

    def mark(value: float) -> str:
        if not math.isfinite(value):
            return " "
        share = (value - low) / span if span > 0.0 else 0.5
        return levels[min(len(levels) - 1, int(share * len(levels)))]

    return "".join(map(mark, known))
