"""From the minimum of the mean cycles to that of the logs: one evaluation and one step.

Noise of the displacement drives the model in the logs and is averaged out of the mean cycle, so
that the minima lie up to half an error apart. That is far within where residuals are linear, and
the full step of Gauss and Newton ends where a descent on the logs would end.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from damperfit.errors import SimulationError
from damperfit.identification.evaluation import (
    evaluate,
    n_independent,
    transformation,
    values_of,
    with_values,
)
from damperfit.identification.plausible import is_at_edge, is_within
from damperfit.identification.solution import Solution

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from damperfit.damper.model import Values
    from damperfit.identification.descent import Misfit

    FloatArray = NDArray[np.float64]

__all__ = ["last_step"]

# Chi-squared of one error, and the largest relative change of a value: what the step leaves out is
# its square, 4e-4, which is a twentieth of an error of 1 %.
_AN_ERROR = 1.0
_SMALL = 0.02
_MET_COST = 2  # as `Solution` has it: no step makes the sum of squares smaller


def last_step(misfit: Misfit, near: Values, *, least_percent: float) -> Solution | None:
    """Return the minimum beside a point; None where one small step does not lead there.

    Parameters
    ----------
    misfit : Misfit
        Of the logs themselves.
    near : Values
        The minimum of their mean cycles.
    least_percent : float
        MSE below which the integrator's error is what is left, and no step is taken.
    """
    free = misfit.free
    if not free or any(is_at_edge(near, name) for name in free):
        return None
    try:
        residuals, slopes, is_cavitating = evaluate(misfit, near, misfit.scale)
    except SimulationError:
        return None
    variables = transformation(misfit, free)
    values = values_of(free, near)
    jacobian = slopes * variables.slopes(values)
    cost = float(residuals @ residuals)
    if not 100.0 * cost > least_percent:
        return None
    # Orthogonal factors keep the digits that J^T J would halve.
    triangle = np.asarray(np.linalg.qr(np.column_stack([jacobian, residuals]), mode="r"))
    step = np.linalg.lstsq(triangle[:, :-1], -triangle[:, -1], rcond=None)[0]
    moved = jacobian @ step
    independent = n_independent(residuals)
    if float(moved @ moved) * independent > _AN_ERROR * cost or np.max(np.abs(step)) > _SMALL:
        return None
    parameters = with_values(near, free, variables.unpack(variables.pack(values) + step))
    if not is_within(parameters, free):
        return None
    rest = residuals + moved
    left = float(rest @ rest)
    lengths = np.sqrt(np.sum(jacobian**2, axis=0) * left)
    return Solution(
        parameters=parameters,
        mse_percent=100.0 * left,
        jacobian=triangle[: len(free), : len(free)],
        evaluations=1,
        failed_trials=0,
        status=_MET_COST,
        gradient_cosine=float(np.max(np.abs(jacobian.T @ rest) / np.maximum(lengths, 1e-300))),
        n_independent=independent,
        is_cavitating=is_cavitating,
    )
