"""Where a descent ended."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from damperfit.damper.model import Values
    from damperfit.identification.model_versus_log import SimulatedLog

    FloatArray = NDArray[np.float64]

__all__ = ["Earlier", "Solution"]


@dataclass(frozen=True, eq=False)
class Solution:
    """Where a descent ended.

    Attributes
    ----------
    parameters : Values
        Best point found.
    mse_percent : float
        Eq. (22) there, each stretch with its weight.
    jacobian : numpy.ndarray
        The triangle R, at most (k, k), of the derivative J of the residuals by u, in the order of
        the free parameters: R^T R = J^T J, and J is as long as the logs, of which a run keeps many.
        J itself, (n, k), where some were held at an edge, until the descent has ended.
    evaluations, failed_trials : int
        Simulations of the whole setting, and those that could not be integrated.
    status : int
        MINPACK's ending as `scipy.optimize.least_squares` gives it: 0 is the limit, 1-4 tests met.
    gradient_cosine : float
        Largest cosine between the residuals and a column of the Jacobian.
    n_independent : float
        Independent samples among the residuals: twice their sign changes. White residuals change
        sign at every other sample; those behind a low-pass of B Hz 1.15 B times a second, where
        2 B samples a second are independent.
    is_cavitating : bool
        Whether a chamber is at zero pressure somewhere in what is compared.
    gradient : numpy.ndarray or None
        Shape (k,): J^T r at the end of a descent; None where one step was taken from it.
    apart : numpy.ndarray or None
        Shape (k,): in u, from the minimum of the mean cycles to that of the logs; None where the
        descent was on the logs.
    is_short : bool
        Whether the minimum of the mean cycles was left a part of an error away, for the logs' step.
    seen : tuple of SimulatedLog
        The logs beside the model at `parameters`, where the end was looked at just there.
    """

    parameters: Values
    mse_percent: float
    jacobian: FloatArray
    evaluations: int
    failed_trials: int
    status: int
    gradient_cosine: float
    n_independent: float
    is_cavitating: bool
    gradient: FloatArray | None = None
    apart: FloatArray | None = None
    is_short: bool = False
    seen: tuple[SimulatedLog, ...] = ()

    @cached_property
    def promised(self) -> FloatArray:
        """The step in u that is left on the mean cycles, shape (k,)."""
        assert self.gradient is not None
        # The gradient is small beside what the rounding of J^T J leaves of its digits.
        information = self.jacobian.T @ self.jacobian
        try:
            return np.asarray(np.linalg.solve(information, -self.gradient))
        except np.linalg.LinAlgError:
            return np.asarray(np.linalg.lstsq(information, -self.gradient, rcond=None)[0])

    def after(self, evaluations: int, failed_trials: int = 0) -> Solution:
        """Return the same with what was spent before it."""
        return replace(
            self,
            evaluations=self.evaluations + evaluations,
            failed_trials=self.failed_trials + failed_trials,
        )

    @property
    def condensed(self) -> Solution:
        """The same with no more of the Jacobian than its triangle."""
        n, k = self.jacobian.shape
        if n <= k:
            return self
        triangle = np.asarray(np.linalg.qr(self.jacobian, mode="r"))
        return replace(self, jacobian=triangle)


@dataclass(frozen=True, slots=True, eq=False)
class Earlier:
    """Where a descent on the same logs has ended that had more free.

    Attributes
    ----------
    free : tuple of str
        What was free, in the order of the solution's derivatives.
    solution : Solution
        Where it ended.
    """

    free: tuple[str, ...]
    solution: Solution
