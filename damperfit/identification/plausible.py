"""The ranges that a car damper's parameters lie in; a fit stays within them."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    import numpy as np
    from numpy.typing import NDArray

    from damperfit.damper.parameters import Parameters

    FloatArray = NDArray[np.float64]

__all__ = ["PLAUSIBLE", "first_edge", "is_at_edge", "is_within", "kept_within", "points_inside"]

# Plausible ranges in SI, a factor of a hundred or more beyond any car damper on both sides.
PLAUSIBLE = {
    "r_m1": (1e1, 1e7),
    "r_m2": (1e3, 1e10),
    "r_m3": (1e3, 1e10),
    "k_e": (1e6, 1e11),
    "f_f": (1e-3, 1e4),
}
# A value that went through its logarithm and back may be this much beyond the edge it came from.
_ROUNDED = 1e-9


def is_within(parameters: Parameters, names: Iterable[str]) -> bool:
    """Whether the named parameters lie in their ranges, edges and rounding included."""
    for name in names:
        low, high = PLAUSIBLE.get(name, (-math.inf, math.inf))
        value = getattr(parameters, name)
        if not low * (1.0 - _ROUNDED) <= value <= high * (1.0 + _ROUNDED):
            return False
    return True


def is_at_edge(parameters: Parameters, name: str) -> bool:
    """Whether a parameter is at an edge of its range."""
    return getattr(parameters, name) in PLAUSIBLE.get(name, ())


def kept_within(parameters: Parameters, names: Iterable[str]) -> Parameters:
    """Return the parameters with the named ones brought to the edge that they are beyond."""
    brought = {}
    for name in names:
        low, high = PLAUSIBLE.get(name, (-math.inf, math.inf))
        value = getattr(parameters, name)
        if not low <= value <= high:
            brought[name] = low if value < low else high
    return replace(parameters, **brought) if brought else parameters


def first_edge(
    parameters: Parameters, names: Sequence[str], step: FloatArray
) -> tuple[str, float] | None:
    """Return the parameter that a step takes beyond its range first, and the edge it passes.

    Parameters
    ----------
    parameters : Parameters
        Within their ranges.
    names : sequence of str
        What moves.
    step : numpy.ndarray
        Shape (k,), of their logarithms.
    """
    found, least = None, 1.0
    for name, change in zip(names, step.tolist(), strict=True):
        if name not in PLAUSIBLE or change == 0.0:
            continue
        edge = PLAUSIBLE[name][change > 0.0]
        share = math.log(edge / getattr(parameters, name)) / change
        if share < least:
            found, least = (name, edge), share
    return found


def points_inside(parameters: Parameters, name: str, slope: float) -> bool:
    """Whether a misfit with this slope falls from a parameter's edge into its range."""
    low, high = PLAUSIBLE[name]
    value = getattr(parameters, name)
    return (value <= low and slope < 0.0) or (value >= high and slope > 0.0)
