"""Numbers as one line of characters, for a terminal: `sparkline`; parameters by setting as such.

Values that their standard errors cannot tell apart are drawn flat: scaled to the height of a line,
chance would look like a course.
"""

from __future__ import annotations

import math
from itertools import combinations
from typing import TYPE_CHECKING, Any

from damperfit.report.sheets.parameter_sheet import scale_of
from damperfit.report.sheets.rounding import number, percent

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from damperfit.damper.quantity import Quantity

    Row = Mapping[str, Any]

__all__ = ["ASCII_LEVELS", "BLOCK_LEVELS", "differ", "setting_sparklines", "sparkline"]

BLOCK_LEVELS = "▁▂▃▄▅▆▇█"
ASCII_LEVELS = ".:-=+*#@"  # for terminals and files that know nothing else: more ink is more
_WITHOUT_VALUE = {"absent", "at_bound", "not_identifiable"}
_FEWEST, _MOST = 3, 60  # settings that a sparkline is drawn of


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


def differ(values: Sequence[float], errors: Sequence[float]) -> bool:
    """Return whether any two values differ by more than the standard error of their difference.

    Parameters
    ----------
    values, errors : sequence of float
        Values and their standard errors, 0 where one is not known.

    Examples
    --------
    >>> differ([5.0, 5.4, 5.2], [0.3, 0.3, 0.3]), differ([5.0, 5.5, 5.2], [0.3, 0.3, 0.3])
    (False, True)
    """
    pairs = combinations(zip(values, errors, strict=True), 2)
    return any(abs(a - b) > math.hypot(e, f) for (a, e), (b, f) in pairs)


def setting_sparklines(
    rows: Sequence[Row], shown: Sequence[Quantity], levels: str
) -> Iterator[str]:
    """Yield each parameter over the settings as one line, and the MSE, which spans decades.

    Parameters
    ----------
    rows : sequence of mapping
        Rows of the table of parameters.
    shown : sequence of Quantity
        Parameters that are drawn.
    levels : str
        Characters from low to high.
    """
    fitted = [row for row in rows if row["mse_percent"] is not None]
    if len(fitted) < _FEWEST or len(rows) > _MOST:
        return
    for one in shown:
        yield from _parameter(rows, one, levels)
    errors = [row["mse_percent"] for row in rows]
    logs = [math.log10(error) if error else None for error in errors]
    seen = [error for error in errors if error is not None]
    ends = f"{percent(min(seen))} to {percent(max(seen))} %, on a scale of decades"
    yield f"{'MSE':<4} {sparkline(logs, levels=levels)}  {ends}"


def _parameter(rows: Sequence[Row], quantity: Quantity, levels: str) -> Iterator[str]:
    """Yield one parameter as a line, and a second one where it says nothing of its course."""
    name, scale = quantity.name, scale_of(quantity)
    shown = [None if row[f"{name}_status"] in _WITHOUT_VALUE else row[name] for row in rows]
    known = [value for value in shown if value is not None]
    if len(known) < _FEWEST:
        return
    places = [k for k, value in enumerate(shown) if value is not None]
    is_flat = not differ(known, [_error(rows[k][f"{name}_se"]) for k in places])
    heights = [None if value is None else 0.0 for value in shown] if is_flat else shown
    ends = " to ".join(number(scale.factor * end, digits=4) for end in (min(known), max(known)))
    yield f"{scale.symbol:<4} {sparkline(heights, levels=levels)}  {ends} {scale.short_unit}"
    if is_flat and min(known) < max(known):
        yield f"{'':<4} drawn flat: no two settings differ by more than their standard errors"


def _error(error: float | None) -> float:
    return error if error is not None and math.isfinite(error) else 0.0
