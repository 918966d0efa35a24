"""The plausible ranges of a model's quantities; a fit stays within them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    import numpy as np
    from numpy.typing import NDArray

    from damperfit.damper.model import Values

    FloatArray = NDArray[np.float64]

__all__ = ["edge_of", "first_edge", "is_at_edge", "is_within", "kept_within", "points_inside"]

# A value that went through its logarithm and back may be this much beyond the edge it came from.
_ROUNDED = 1e-9


def is_within(parameters: Values, names: Iterable[str]) -> bool:
    """Whether the named parameters lie in their ranges, edges and rounding included."""
    for name in names:
        low, high = parameters.quantity(name).plausible
        value = getattr(parameters, name)
        if not low - _ROUNDED * abs(low) <= value <= high + _ROUNDED * abs(high):
            return False
    return True


def is_at_edge(parameters: Values, name: str) -> bool:
    """Whether a parameter is at an edge of its range."""
    return getattr(parameters, name) in parameters.quantity(name).plausible


def edge_of(parameters: Values, name: str) -> tuple[str, float]:
    """Return on which side a parameter ran out of its range, "below" or "above", and where.

    Examples
    --------
    A friction of 2.65e-261 N that may be 0.001 N at least: ``("below", 0.001)``.
    """
    low, high = parameters.quantity(name).plausible
    value = getattr(parameters, name)
    if value < 0.99 * high:  # a friction within its range that is nothing beside the noise, too
        return "below", max(value, low)
    return "above", min(value, high)


def kept_within(parameters: Values, names: Iterable[str]) -> Values:
    """Return the parameters with the named ones brought to the edge that they are beyond."""
    brought = {}
    for name in names:
        low, high = parameters.quantity(name).plausible
        value = getattr(parameters, name)
        if not low <= value <= high:
            brought[name] = low if value < low else high
    return parameters.replace(brought) if brought else parameters


def first_edge(
    parameters: Values, names: Sequence[str], step: FloatArray, scales: FloatArray
) -> tuple[str, float] | None:
    """Return the parameter that a step takes beyond its range first, and the edge it passes.

    Parameters
    ----------
    parameters : Values
        Within their ranges.
    names : sequence of str
        What moves.
    step : numpy.ndarray
        Shape (k,), of their logarithms; of linear quantities in units of their scales.
    scales : numpy.ndarray
        Shape (k,), of the linear ones.
    """
    found, least = None, 1.0
    for name, change, scale in zip(names, step.tolist(), scales.tolist(), strict=True):
        one = parameters.quantity(name)
        edge, value = one.plausible[change > 0.0], getattr(parameters, name)
        if change == 0.0 or math.isinf(edge):
            continue
        away = math.log(edge / value) if one.is_logarithmic else (edge - value) / scale
        share = away / change
        if share < least:
            found, least = (name, edge), share
    return found


def points_inside(parameters: Values, name: str, slope: float) -> bool:
    """Whether a misfit with this slope falls from a parameter's edge into its range."""
    low, high = parameters.quantity(name).plausible
    value = getattr(parameters, name)
    return (value <= low and slope < 0.0) or (value >= high and slope > 0.0)
