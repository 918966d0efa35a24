"""Numbers as text, rounded for reading: by their 95 % interval where there is one."""

from __future__ import annotations

import math

__all__ = [
    "NOTHING",
    "number",
    "percent",
    "stroke_ratio",
    "with_interval",
]

NOTHING = "-"


def number(value: float | None, *, digits: int = 5) -> str:
    """Return a number with ``digits`` significant digits and no exponent where that reads well.

    Examples
    --------
    >>> number(23.9451234), number(0.0), number(None), number(1234567.0)
    ('23.945', '0', '-', '1.2346e+06')
    """
    if value is None or not math.isfinite(value):
        return NOTHING
    if value == 0.0:
        return "0"
    if not 1e-3 <= abs(value) < 10.0**digits:
        return f"{value:.{digits - 1}e}"
    return f"{value:.{_decimals(value, digits)}f}"


def with_interval(
    value: float | None,
    low: float | None,
    high: float | None,
    *,
    digits: int = 5,
    plus: str = "",
    has_error: bool = True,
) -> str:
    """Return a value and half of its interval, both to the place that the interval tells.

    Where the limits are not as far below as above, they stand behind it. Without limits
    ``digits`` significant digits are shown.

    Parameters
    ----------
    value, low, high : float or None
        The value and its limits.
    digits : int
        Significant digits of a value without limits.
    plus : str
        "+" for changes, which show their sign.
    has_error : bool
        False rounds by the interval but leaves it out.

    Examples
    --------
    >>> with_interval(14.0049, 13.9842, 14.0257), with_interval(45678.9, 45300.0, 46050.0)
    ('14.00 ± 0.02', '45700 ± 400')
    >>> with_interval(0.631, 0.134, 2.963), with_interval(2.0, None, None)
    ('0.6 (0.1 to 3.0)', '2.0000')
    """
    if value is None or not math.isfinite(value):
        return NOTHING
    ends = [end for end in (low, high) if end is not None and math.isfinite(end)]
    if len(ends) < 2 or not ends[0] <= value <= ends[1] or ends[0] == ends[1]:
        return number(value, digits=digits) if not plus else f"{value:+.{digits - 1}g}"
    below, above = value - ends[0], ends[1] - value
    half = 0.5 * (ends[1] - ends[0])
    is_even = max(below, above) <= _UNEVEN * min(below, above)
    place = _place(half if is_even else max(min(below, above), _LEAST * half))
    shown = _round_at(value, place, plus)
    if not has_error:
        return shown
    if is_even:
        return f"{shown} ± {_round_at(half, place)}"
    return f"{shown} ({_round_at(ends[0], place)} to {_round_at(ends[1], place)})"


_UNEVEN, _LEAST = 1.25, 0.1
_TWO_DIGITS = 19  # an error of these digits or fewer shows two of them, another one


def percent(value: float | None) -> str:
    """Return a percentage with three significant digits.

    Examples
    --------
    >>> percent(0.012345), percent(12.3456), percent(None)
    ('0.0123', '12.3', '-')
    """
    if value is None or not math.isfinite(value):
        return NOTHING
    if value == 0.0:
        return "0"
    if abs(value) < 1e-4:
        return f"{value:.1e}"
    return f"{value:.{_decimals(value, 3)}f}"


def _place(error: float) -> int:
    """Return the decimal place of the last digit that an error tells."""
    place = math.floor(math.log10(error)) - 1
    return place if round(error / 10.0**place) <= _TWO_DIGITS else place + 1


def _round_at(value: float, place: int, plus: str = "") -> str:
    step = 10.0**place
    return f"{round(value / step) * step + 0.0:{plus}.{max(0, -place)}f}"


def _decimals(value: float, digits: int) -> int:
    """Return the decimals that show ``digits`` significant digits of the rounded value."""
    power = int(f"{value:.{digits - 1}e}".partition("e")[2])
    return max(0, digits - 1 - power)


def stroke_ratio(rebound: float, bump: float) -> str:
    """Return the force in rebound over that in bump.

    At low speed the gas pushes both strokes to one side: then there is no ratio.
    """
    return number(-rebound / bump if rebound > 0.0 > bump else None, digits=3)
