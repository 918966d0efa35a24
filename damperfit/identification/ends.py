"""Where a descent has ended, and what an edge of a plausible range has to do with it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from damperfit.identification.plausible import first_edge, points_inside

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from damperfit.identification.descent import Misfit
    from damperfit.identification.looks import Seen
    from damperfit.identification.minimiser import Minimum
    from damperfit.identification.solution import Solution

    FloatArray = NDArray[np.float64]

__all__ = ["RIGHT_ANGLE", "End", "falls_inside", "stopped_at"]

# A fit that meets none of MINPACK's tests has still descended when the residual is this close to
# a right angle with every direction of the Jacobian.
RIGHT_ANGLE = 1e-3


@dataclass(frozen=True, slots=True)
class End:
    """Where a descent ended, what moved in it, and whether it tried points out of range."""

    solution: Solution
    moving: tuple[str, ...]
    scales: FloatArray
    minimum: Minimum[Seen]
    has_tried_beyond: bool


def stopped_at(end: End) -> tuple[str, float] | None:
    """The edge that kept a descent from going on, if one did."""
    if not end.has_tried_beyond or end.solution.gradient_cosine < RIGHT_ANGLE:
        return None
    point = end.minimum.point
    step = np.linalg.lstsq(point.jacobian, -point.residuals, rcond=None)[0]
    taken = np.asarray(step, dtype=np.float64)
    return first_edge(end.solution.parameters, end.moving, taken, end.scales)


def falls_inside(misfit: Misfit, end: End) -> set[str]:
    """The held parameters whose misfit falls from the edge into the range."""
    found = set()
    point = end.minimum.point
    for place, name in enumerate(misfit.free):
        if name in end.moving:
            continue
        column = end.solution.jacobian[:, place]
        slope = float(column @ point.residuals)
        length = math.sqrt(float(column @ column) * point.cost)
        if abs(slope) > RIGHT_ANGLE * length and points_inside(point.extra.parameters, name, slope):
            found.add(name)
    return found
