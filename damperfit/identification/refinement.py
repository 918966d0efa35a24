"""When the integrator's error is what is left of a misfit, and how exact it is to be from there."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from damperfit.identification.descent import Misfit

__all__ = ["finer", "solvers_percent"]

# Below this misfit (times the solver's tolerance, N) the solver's own error moves what is found.
# It is then kept to this share of the misfit, or of the tolerance where less than that is left.
_POLISH_BELOW = 100.0
_POLISH_FACTOR = 0.003


def solvers_percent(misfit: Misfit) -> float:
    """Return the misfit, as an MSE, below which the integrator's error may be what is left."""
    return 100.0 * (_POLISH_BELOW * misfit.solver.tolerance / misfit.deviation) ** 2


def finer(misfit: Misfit, mse_percent: float) -> Misfit:
    """Return the same misfit with a tighter integrator, for what is left at an MSE."""
    left = misfit.deviation * math.sqrt(mse_percent / 100.0)
    tolerance = _POLISH_FACTOR * max(misfit.solver.tolerance, left)
    return replace(misfit, solver=replace(misfit.solver, tolerance=tolerance))
