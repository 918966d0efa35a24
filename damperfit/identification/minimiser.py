"""Levenberg-Marquardt for least squares: transformation, scaling, stopping, covariance.

It knows nothing of dampers: a model gives residuals and their derivatives by the parameters y, a
transformation says in which variables u the steps are taken. The trust region is MINPACK's, scaled
by the lengths of the Jacobian's columns. Run over the nonlinear regression problems of NIST by
``python -m tests.certificate``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Generic, TypeVar

import numpy as np

from damperfit.errors import SimulationError

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]
    _Model = Callable[[FloatArray], tuple[FloatArray, FloatArray, "Extra"]]

__all__ = [
    "Minimum",
    "Point",
    "Stopping",
    "Transformation",
    "inverse_information",
    "minimise",
]

# A cosine between residuals and Jacobian that is zero to the last digits.
_RIGHT_ANGLE = 1e-12
# Of a singular value of a Jacobian with columns of length 1.
_LAST_DIGIT = 1e-14
# A column shorter than this has a variance beyond the largest number: as good as zeros.
_NO_LENGTH = 1e-130
# A point the model cannot be evaluated at counts as this many times the larger of 1 and the best:
# finite, so that the trust region shrinks by MINPACK's rule and not at random.
_WALL = 1e3

Extra = TypeVar("Extra")


@dataclass(frozen=True, slots=True, eq=False)
class Transformation:
    """In which variables the steps are taken: u = ln y, or u = y/scale.

    With u = ln y a step is a relative change and y cannot change sign.

    Attributes
    ----------
    is_logarithmic : numpy.ndarray
        Shape (k,), of bool.
    scales : numpy.ndarray
        Shape (k,), size of each linear parameter; not used where the logarithm is.
    """

    is_logarithmic: NDArray[np.bool_]
    scales: FloatArray

    def pack(self, values: FloatArray) -> FloatArray:
        """Return u."""
        logarithms = np.log(np.where(self.is_logarithmic, values, 1.0))
        return np.where(self.is_logarithmic, logarithms, values / self.scales)

    def unpack(self, variables: FloatArray) -> FloatArray:
        """Return y; e^600 overflows nothing yet, and a model refuses it as a failed trial."""
        powers = np.exp(np.clip(variables, -600.0, 600.0))
        return np.where(self.is_logarithmic, powers, variables * self.scales)

    def slopes(self, values: FloatArray) -> FloatArray:
        """Return dy/du."""
        return np.where(self.is_logarithmic, values, self.scales)


@dataclass(frozen=True, slots=True)
class Stopping:
    """When a descent ends.

    Attributes
    ----------
    cost_tolerance : float
        Relative fall of the sum of squares, found and foreseen, below which it has.
    step_tolerance : float
        Likewise for the relative size of the steps.
    max_evaluations : int
        Limit of evaluations.
    """

    cost_tolerance: float = 1e-8
    step_tolerance: float = 1e-9
    max_evaluations: int = 100


@dataclass(frozen=True, slots=True, eq=False)
class Point(Generic[Extra]):
    """The model at one point.

    Attributes
    ----------
    values : numpy.ndarray
        Shape (k,), y.
    residuals : numpy.ndarray
        Shape (n,), model minus data, in units in which a useless model has the sum of squares 1.
    jacobian : numpy.ndarray
        Shape (n, k): derivative of the residuals by u.
    cost : float
        Sum of squares.
    extra : object
        What the model wants to be remembered of this point.
    """

    values: FloatArray
    residuals: FloatArray
    jacobian: FloatArray
    cost: float
    extra: Extra


@dataclass(frozen=True, slots=True, eq=False)
class Minimum(Generic[Extra]):
    """Where a descent ended.

    Attributes
    ----------
    point : Point
        Best point found.
    evaluations, failed_trials : int
        Evaluations of the model, and those that it refused.
    status : int
        As `scipy.optimize.least_squares` has it: 0 is the limit of evaluations, 1 to 4 are tests
        met.
    """

    point: Point[Extra]
    evaluations: int
    failed_trials: int
    status: int

    @property
    def gradient_cosine(self) -> float:
        """Largest cosine between the residuals and a column of the Jacobian; 0 at a minimum."""
        jacobian, residuals = self.point.jacobian, self.point.residuals
        lengths = np.sqrt(np.sum(jacobian**2, axis=0) * self.point.cost)
        slopes = np.abs(jacobian.T @ residuals)
        return float(np.max(slopes / np.maximum(lengths, 1e-300), initial=0.0))


def minimise(
    model: _Model[Extra],
    start: FloatArray,
    transformation: Transformation,
    stopping: Stopping = Stopping(),
) -> Minimum[Extra]:
    """Minimise a sum of squares from a start.

    Parameters
    ----------
    model : callable
        From y, shape (k,), to residuals (n,), their derivative by y (n, k), and anything to be
        remembered. It raises `SimulationError` where it cannot be evaluated; numbers that are not
        finite count as that.
    start : numpy.ndarray
        Shape (k,), y.
    transformation : Transformation
        In which variables to step.
    stopping : Stopping
        When to end.

    Raises
    ------
    SimulationError
        When the model cannot be evaluated at the start.
    """
    from scipy.optimize import least_squares

    course = _Course(model, transformation)
    variables = transformation.pack(start)
    if not len(start):
        return Minimum(course.visit(variables), course.evaluations, 0, status=1)
    ended = least_squares(
        course.residuals,
        variables,
        jac=course.jacobian,
        method="lm",
        x_scale="jac",
        ftol=stopping.cost_tolerance,
        xtol=stopping.step_tolerance,
        gtol=_RIGHT_ANGLE,
        max_nfev=stopping.max_evaluations,
    )
    return Minimum(course.best, course.evaluations, course.failed_trials, int(ended.status))


def inverse_information(jacobian: FloatArray) -> FloatArray:
    """Return (J^T J)^-1, shape (k, k), without forming J^T J, which would halve the digits.

    Times the variance of independent residuals it is the covariance of u. Directions that the
    data do not see to the last digit get a variance that says so; a column of zeros gives
    infinity on the diagonal.

    Parameters
    ----------
    jacobian : numpy.ndarray
        Shape (n, k).
    """
    lengths = np.sqrt(np.sum(jacobian * jacobian, axis=0))
    is_seen = lengths > _NO_LENGTH
    found = np.zeros((len(lengths), len(lengths)))
    found[~is_seen, ~is_seen] = math.inf
    triangle = np.linalg.qr(jacobian[:, is_seen] / lengths[is_seen], mode="r")
    _, values, directions = np.linalg.svd(triangle)
    roots = directions.T / np.maximum(values, _LAST_DIGIT) / lengths[is_seen, None]
    found[np.ix_(is_seen, is_seen)] = roots @ roots.T
    return found


class _Course(Generic[Extra]):
    """What a descent has seen: MINPACK asks for residuals and Jacobian apart."""

    def __init__(self, model: _Model[Extra], transformation: Transformation) -> None:
        self.model = model
        self.transformation = transformation
        self.evaluations = self.failed_trials = 0
        # The best and the last point; the others are not asked for again.
        self.known: dict[str, tuple[bytes, Point[Extra]]] = {}

    @property
    def best(self) -> Point[Extra]:
        """The point with the least sum of squares."""
        return self.known["best"][1]

    def visit(self, variables: FloatArray) -> Point[Extra]:
        """Evaluate the model, or remember it; raises `SimulationError` where that cannot be."""
        key = variables.tobytes()
        for known, point in self.known.values():
            if known == key:
                return point
        self.evaluations += 1
        values = self.transformation.unpack(variables)
        residuals, slopes, extra = self.model(values)
        with np.errstate(over="ignore", invalid="ignore"):
            cost = float(residuals @ residuals)
            jacobian = slopes * self.transformation.slopes(values)
            if not math.isfinite(cost + float(np.sum(jacobian))):
                raise SimulationError(f"no finite residuals or derivatives at {values}.")
        point = Point(values, residuals, jacobian, cost, extra)
        self.known["last"] = (key, point)
        if "best" not in self.known or point.cost < self.best.cost:
            self.known["best"] = (key, point)
        return point

    def residuals(self, variables: FloatArray) -> FloatArray:
        """Return the residuals, or a wall where there are none."""
        try:
            return self.visit(variables).residuals
        except SimulationError:
            if not self.known:
                raise
            self.failed_trials += 1
            n = len(self.best.residuals)
            return np.full(n, math.sqrt(_WALL * max(1.0, self.best.cost) / n))

    def jacobian(self, variables: FloatArray) -> FloatArray:
        """Return the Jacobian of a point that MINPACK has taken."""
        return self.visit(variables).jacobian
