"""The project's fit driver, and SciPy's, over one problem; and how many digits are right."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from damperfit.identification.minimiser import (
    Transformation,
    inverse_information,
    minimise,
)
from damperfit.identification.trust_region import Stopping
from tests.certificate.problems import Array, Problem

# Where the certificate differs from a damper's fit, all 54 cases alike. Tolerances: digits are
# asked for that no rig log holds, and the models are exact to the last bit, while a simulated force
# is not. Evaluations: these starts are as far off as a factor of a million.
STOPPING = Stopping(cost_tolerance=1e-15, step_tolerance=1e-12, max_evaluations=2000)
MOST_DIGITS = 11.0  # NIST prints that many


@dataclass(frozen=True)
class Result:
    """What a solver makes of a problem."""

    values: Array
    deviations: Array
    sum_of_squares: float
    evaluations: int


@dataclass(frozen=True)
class Digits:
    """Correct digits, the worst of each kind."""

    parameters: float
    deviations: float
    sum_of_squares: float


def correct_digits(found: Array | float, certified: Array | float) -> float:
    """Return NIST's log relative error, the smallest; 0 for a number that is not one."""
    found, certified = np.atleast_1d(found), np.atleast_1d(certified)
    with np.errstate(all="ignore"):
        error = np.max(np.abs(found - certified) / np.abs(certified))
    if not math.isfinite(error):
        return 0.0
    return min(max(-math.log10(max(error, 1e-300)), 0.0), MOST_DIGITS) + 0.0  # no -0.0


def judge(problem: Problem, result: Result) -> Digits:
    return Digits(
        correct_digits(result.values, problem.certified),
        correct_digits(result.deviations, problem.deviations),
        correct_digits(result.sum_of_squares, problem.sum_of_squares),
    )


def by_damperfit(
    problem: Problem, start: Array, *, stopping: Stopping = STOPPING, is_log: bool = False
) -> Result:
    """Fit with `minimise`, in variables of the size of the start, or in logarithms."""
    # Like a damper's misfit: a model that gives the mean has the sum of squares 1.
    unit = float(np.std(problem.response)) * math.sqrt(len(problem.response))
    transformation = Transformation(np.full(len(start), is_log), np.abs(start))

    def model(b: Array) -> tuple[Array, Array, None]:
        return problem.residuals(b) / unit, problem.jacobian(b) / unit, None

    found = minimise(model, start, transformation, stopping)
    variance = found.point.cost / problem.freedom
    errors = np.sqrt(np.diag(inverse_information(found.point.jacobian)) * variance)
    return Result(
        values=found.point.values,
        deviations=errors * transformation.slopes(found.point.values),
        sum_of_squares=found.point.cost * unit**2,
        evaluations=found.evaluations,
    )


def by_least_squares(problem: Problem, start: Array) -> Result:
    """Fit with `scipy.optimize.least_squares`, method lm, everything else at its default."""
    from scipy.optimize import least_squares

    ended = least_squares(problem.residuals, start, method="lm")
    roots = np.linalg.pinv(ended.jac, rcond=0.0)
    sum_of_squares = 2.0 * ended.cost
    errors = np.sqrt(np.sum(roots * roots, axis=1) * sum_of_squares / problem.freedom)
    return Result(ended.x, errors, sum_of_squares, ended.nfev)


def by_curve_fit(problem: Problem, start: Array) -> Result:
    """Fit with `scipy.optimize.curve_fit`, method trf, everything else at its default."""
    from scipy.optimize import curve_fit

    def model(_, *b: float) -> Array:
        return problem.residuals(np.array(b)) + problem.response

    first = problem.predictors[0]
    found, covariance, facts, *_ = curve_fit(
        model, first, problem.response, start, method="trf", full_output=True
    )
    residuals = problem.residuals(found)
    errors = np.sqrt(np.diag(covariance))
    return Result(found, errors, float(residuals @ residuals), facts["nfev"])


def attempt(fit: Callable[[Problem, Array], Result], problem: Problem, start: Array) -> Digits:
    """Return the digits a solver gets right; none when it gives up."""
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        try:
            return judge(problem, fit(problem, start))
        except (RuntimeError, ValueError, np.linalg.LinAlgError):
            return Digits(0.0, 0.0, 0.0)
