"""Least squares of one block of residuals: transformation, minimum, covariance.

It knows nothing of dampers: a model gives residuals and their derivatives by the parameters y, a
transformation says in which variables u `trust_region` takes its steps.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Generic, TypeVar

import numpy as np

from damperfit.errors import SimulationError
from damperfit.identification.step_solvers import NO_LENGTH, DenseSystem
from damperfit.identification.trust_region import Stopping, iterate
from damperfit.statistics import largest_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from damperfit.identification.step_solvers import LinearSystem

    FloatArray = NDArray[np.float64]
    _Model = Callable[[FloatArray], tuple[FloatArray, FloatArray, "Extra"]]

__all__ = [
    "DescentPoint",
    "Minimum",
    "Transformation",
    "inverse_information",
    "minimise",
]

# Of a singular value of a Jacobian with columns of length 1.
_LAST_DIGIT = 1e-14

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
        powers = np.exp(np.minimum(np.maximum(variables, -600.0), 600.0))
        return np.where(self.is_logarithmic, powers, variables * self.scales)

    def slopes(self, values: FloatArray) -> FloatArray:
        """Return dy/du."""
        return np.where(self.is_logarithmic, values, self.scales)


@dataclass(frozen=True, slots=True, eq=False)
class DescentPoint(Generic[Extra]):
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
    system : DenseSystem
        Both as the steps are found from.
    extra : object
        What the model wants to be remembered of this point.
    """

    values: FloatArray
    residuals: FloatArray
    jacobian: FloatArray
    cost: float
    system: DenseSystem
    extra: Extra


@dataclass(frozen=True, slots=True, eq=False)
class Minimum(Generic[Extra]):
    """Where a descent ended.

    Attributes
    ----------
    point : DescentPoint
        Best point found.
    evaluations, failed_trials : int
        Evaluations of the model, and those that it refused.
    status : int
        As `scipy.optimize.least_squares` has it: 0 is the limit of evaluations, 1 to 4 are tests
        met.
    """

    point: DescentPoint[Extra]
    evaluations: int
    failed_trials: int
    status: int

    @property
    def gradient_cosine(self) -> float:
        """Largest cosine between the residuals and a column of the Jacobian; 0 at a minimum."""
        system = self.point.system
        lengths = system.lengths * math.sqrt(self.point.cost)
        return largest_of(system.gradient / np.maximum(lengths, 1e-300))


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

    def point_at(variables: FloatArray) -> tuple[LinearSystem, DescentPoint[Extra]]:
        values = transformation.unpack(variables)
        residuals, slopes, extra = model(values)
        with np.errstate(over="ignore", invalid="ignore"):
            cost = float(residuals @ residuals)
            jacobian = slopes * transformation.slopes(values)
            system = DenseSystem(residuals, jacobian)
            # A number that is none is in every sum after it.
            if not math.isfinite(cost + float(np.add.reduce(system.triangle, axis=None))):
                raise SimulationError(f"no finite residuals or derivatives at {values}.")
        return system, DescentPoint(values, residuals, jacobian, cost, system, extra)

    ended = iterate(point_at, transformation.pack(start), stopping)
    return Minimum(ended.extra, ended.evaluations, ended.failed_trials, ended.status)


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
    is_seen = lengths > NO_LENGTH
    if is_seen.all():
        return _inverted(jacobian, lengths)
    found = np.zeros((len(lengths), len(lengths)))
    found[~is_seen, ~is_seen] = math.inf
    found[np.ix_(is_seen, is_seen)] = _inverted(jacobian[:, is_seen], lengths[is_seen])
    return found


def _inverted(jacobian: FloatArray, lengths: FloatArray) -> FloatArray:
    """The same of columns that all have a length."""
    scaled = jacobian / lengths
    if len(scaled) > scaled.shape[1]:
        scaled = np.asarray(np.linalg.qr(scaled, mode="r"))
    _, values, directions = np.linalg.svd(scaled)
    roots = directions.T / np.maximum(values, _LAST_DIGIT) / lengths[:, None]
    return np.asarray(roots @ roots.T)
