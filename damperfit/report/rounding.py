"""Numbers as text, rounded for reading: by their error where there is one.

A value with a standard error is rounded by it, to two digits of the error (``1.26 ± 0.12``).
Without one, five significant digits are shown.
"""

from __future__ import annotations

import math
from typing import TypeGuard

__all__ = [
    "NOTHING",
    "number",
    "percent",
    "rounded_by_error",
    "stroke_ratio",
    "with_error",
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


def with_error(value: float | None, error: float | None, *, digits: int = 5) -> str:
    """Return value and standard error, both rounded to two digits of the error.

    Without an error, ``digits`` significant digits are shown.

    Examples
    --------
    >>> with_error(1.2634, 0.1234), with_error(45678.9, 321.0), with_error(2.0, None)
    ('1.26 ± 0.12', '45680 ± 320', '2.0000')
    """
    if value is None or not _is_error(error):
        return number(value, digits=digits)
    shown, place = _round_by(value, error), _place(error)
    return f"{shown} ± {_round_at(error, place)}"


def rounded_by_error(
    value: float | None, error: float | None, *, has_error: bool = True, digits: int = 4
) -> str:
    """Return value and standard error in few characters, the error in units of the last digit.

    Without an error, ``digits`` significant digits are shown; ``has_error`` False rounds by the
    error but leaves it out.

    Examples
    --------
    >>> rounded_by_error(14.00512, 0.0112), rounded_by_error(45678.9, 321.0)
    ('14.005(11)', '45680(320)')
    >>> rounded_by_error(14.00512, 0.0112, has_error=False), rounded_by_error(2.0, None)
    ('14.005', '2.000')
    """
    if value is None or not _is_error(error):
        return number(value, digits=digits)
    shown = _round_by(value, error)
    if not has_error:
        return shown
    place = _place(error)
    step = 10.0 ** min(place, 0)
    return f"{shown}({round(round(error / 10.0**place) * 10.0**place / step)})"


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


def with_interval(value: float | None, high: float | None, *, plus: str = "") -> str:
    """Return as in "+51.1 ± 0.4", to a digit of half the interval; four digits without one."""
    if value is None or not math.isfinite(value):
        return NOTHING
    if high is None or not math.isfinite(high):
        return f"{value:{plus}.4g}"
    reach = high - value
    decimals = 1 if reach >= 0.05 else 2
    if 0.0 < reach < 0.005:  # of kilonewtons
        decimals = -math.floor(math.log10(reach))
    return f"{value:{plus}.{decimals}f} ± {reach:.{decimals}f}"


def _is_error(error: float | None) -> TypeGuard[float]:
    return error is not None and math.isfinite(error) and error > 0.0


def _place(error: float) -> int:
    """Return the decimal place of the second digit of an error."""
    place = math.floor(math.log10(error)) - 1
    return place + 1 if round(error / 10.0**place) >= 100 else place  # 0.0996 rounds up to 0.10


def _round_at(value: float, place: int) -> str:
    step = 10.0**place
    return f"{round(value / step) * step:.{max(0, -place)}f}"


def _round_by(value: float, error: float) -> str:
    return _round_at(value, _place(error))


def _decimals(value: float, digits: int) -> int:
    """Return the decimals that show ``digits`` significant digits of the rounded value."""
    power = int(f"{value:.{digits - 1}e}".partition("e")[2])
    return max(0, digits - 1 - power)


def stroke_ratio(rebound: float, bump: float) -> str:
    """Return the force in rebound over that in bump.

    At low speed the gas pushes both strokes to one side: then there is no ratio.
    """
    return number(-rebound / bump if rebound > 0.0 > bump else None, digits=3)
