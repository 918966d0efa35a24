"""Two small numerical methods of a start and of a margin, whose libraries take longer to load.

Least squares without negative values (Lawson and Hanson, "Solving Least Squares Problems", 1974,
chapter 23), and a root between two points (Brent, "Algorithms for Minimization without
Derivatives", 1973, chapter 4).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]

__all__ = ["nonnegative_least_squares", "root_between"]

# A slope that is zero to the last digits, beside columns and values of length 1.
_FLAT = 1e-12
_MOST_ROUNDS = 100


def nonnegative_least_squares(columns: FloatArray, values: FloatArray) -> FloatArray:
    """Return x >= 0 that makes |columns x - values| least.

    Parameters
    ----------
    columns : numpy.ndarray
        Shape (n, k), of about the same length each.
    values : numpy.ndarray
        Shape (n,).

    Examples
    --------
    >>> nonnegative_least_squares(np.eye(2), np.array([3.0, -1.0])).tolist()
    [3.0, 0.0]
    """
    triangle = np.asarray(np.linalg.qr(np.column_stack([columns, values]), mode="r"))
    a, b = triangle[:, :-1], triangle[:, -1]
    least = _FLAT * float(np.linalg.norm(a, axis=0).max(initial=0.0) * np.linalg.norm(b))
    found = np.zeros(a.shape[1])
    is_free = np.zeros(a.shape[1], dtype=bool)
    for _ in range(_MOST_ROUNDS):
        slope = np.where(is_free, -np.inf, a.T @ (b - a @ found))
        best = int(np.argmax(slope))
        if not slope[best] > least:
            break
        is_free[best] = True
        trial = _unbounded(a, b, is_free)
        while np.any(is_free & (trial <= 0.0)):
            # As far as the first that would turn negative; it is held at nothing from there on.
            out = np.flatnonzero(is_free & (trial <= 0.0))
            share = float(np.min(found[out] / np.maximum(found[out] - trial[out], 1e-300)))
            found += share * (trial - found)
            is_free &= found > _FLAT * float(found.max())
            found[~is_free] = 0.0
            trial = _unbounded(a, b, is_free)
        found = trial
    return found


def _unbounded(a: FloatArray, b: FloatArray, is_free: NDArray[np.bool_]) -> FloatArray:
    found = np.zeros(a.shape[1])
    if is_free.any():
        found[is_free] = np.linalg.lstsq(a[:, is_free], b, rcond=None)[0]
    return found


def root_between(
    function: Callable[[float], float], low: float, high: float, *, tolerance: float
) -> float:
    """Return where a function is zero, between two points where its signs differ.

    Parameters
    ----------
    function : callable
        Of one number.
    low, high : float
        Where it has different signs, or is zero.
    tolerance : float
        Distance from the root that will do.

    Examples
    --------
    >>> round(root_between(lambda x: x * x - 2.0, 0.0, 2.0, tolerance=1e-12), 9)
    1.414213562
    """
    a, b = low, high
    at_a, at_b = function(a), function(b)
    c, at_c = a, at_a
    step = before = b - a
    for _ in range(_MOST_ROUNDS):
        if at_b * at_c > 0.0:
            c, at_c = a, at_a
            step = before = b - a
        if abs(at_c) < abs(at_b):
            a, b, c = b, c, b
            at_a, at_b, at_c = at_b, at_c, at_b
        half = 0.5 * (c - b)
        if abs(half) <= tolerance or at_b == 0.0:
            break
        if abs(before) >= tolerance and abs(at_a) > abs(at_b):
            p, q = _interpolated((a, at_a), (b, at_b), (c, at_c))
            is_inside = 2.0 * p < min(3.0 * half * q - abs(tolerance * q), abs(before * q))
            before, step = (step, p / q) if is_inside else (half, half)
        else:
            before = step = half
        a, at_a = b, at_b
        b += step if abs(step) > tolerance else (tolerance if half > 0.0 else -tolerance)
        at_b = function(b)
    return b


def _interpolated(
    a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]
) -> tuple[float, float]:
    """The step p/q from b to the zero of a parabola in y through three points, or of a chord."""
    s = b[1] / a[1]
    half = 0.5 * (c[0] - b[0])
    if a[0] == c[0]:
        p, q = 2.0 * half * s, 1.0 - s
    else:
        q, r = a[1] / c[1], b[1] / c[1]
        p = s * (2.0 * half * q * (q - r) - (b[0] - a[0]) * (r - 1.0))
        q = (q - 1.0) * (r - 1.0) * (s - 1.0)
    return (p, -q) if p > 0.0 else (-p, q)
