"""The project's fit driver, and SciPy's, over one problem; and how many digits are right."""

import math
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from damperfit.identification.least_squares import (
    Stopping,
    Transformation,
    inverse_information,
    minimise,
)
from tests.certificate.problems import Array, Problem

# The equal settings of the table. Digits are asked for that no rig log holds, and the models are
# exact to the last bit, while a simulated force is not; these starts are as far off as a factor of
# a million. The driver's own test of the steps that are left is off: SciPy has none.
EQUAL = {"ftol": 1e-15, "xtol": 1e-12, "gtol": 1e-12}
MAX_EVALUATIONS = 2000
STOPPING = Stopping(EQUAL["ftol"], EQUAL["xtol"], MAX_EVALUATIONS, rest=math.inf)
MOST_DIGITS = 11.0  # NIST prints that many
SOLVED = 6.0


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


def _unit(problem: Problem) -> float:
    """Like a damper's misfit: a model that gives the mean has the sum of squares 1."""
    return float(np.std(problem.response)) * math.sqrt(len(problem.response))


def by_damperfit(
    problem: Problem, start: Array, *, stopping: Stopping = STOPPING, is_log: bool = False
) -> Result:
    """Fit with `minimise`, in variables of the size of the start, or in logarithms."""
    unit = _unit(problem)
    transformation = Transformation(np.full(len(start), is_log), np.abs(start))

    def model(b: Array) -> tuple[Array, Array, None]:
        return problem.residuals(b) / unit, problem.jacobian(b) / unit, None

    found = minimise(model, start, transformation, stopping)
    variance = found.cost / problem.freedom
    errors = np.sqrt(np.diag(inverse_information(found.jacobian)) * variance)
    return Result(
        values=transformation.unpack(found.variables),
        deviations=errors * transformation.slopes(transformation.unpack(found.variables)),
        sum_of_squares=found.cost * unit**2,
        evaluations=found.evaluations,
    )


def as_dampers_fit(problem: Problem, start: Array) -> Result:
    """Fit with the stopping rules of a damper's fit, its limit of 100 evaluations among them."""
    return by_damperfit(problem, start, stopping=Stopping())


def least_squares_equal(problem: Problem, start: Array, *, method: str) -> Result:
    """Fit with `scipy.optimize.least_squares` on equal terms."""
    from scipy.optimize import least_squares

    unit, size = _unit(problem), np.abs(start)
    ended = least_squares(
        lambda u: problem.residuals(u * size) / unit,
        start / size,
        jac=lambda u: problem.jacobian(u * size) * size / unit,
        method=method,
        x_scale="jac",
        max_nfev=MAX_EVALUATIONS,
        **EQUAL,
    )
    return _least_squares_result(problem, ended, unit, size)


def curve_fit_equal(problem: Problem, start: Array) -> Result:
    """Fit with `scipy.optimize.curve_fit` (its method lm) on the same equal terms."""
    size = np.abs(start)
    unit = _unit(problem)

    def model(_, *u: float) -> Array:
        return (problem.residuals(np.array(u) * size) + problem.response) / unit

    def slopes(_, *u: float) -> Array:
        return problem.jacobian(np.array(u) * size) * size / unit

    how = {"method": "lm", "jac": slopes, "maxfev": MAX_EVALUATIONS, **EQUAL}
    return _curve_fit_result(problem, model, problem.response / unit, start / size, size, how)


def least_squares_default(problem: Problem, start: Array) -> Result:
    """Fit with `scipy.optimize.least_squares`, method lm, everything else at its default."""
    from scipy.optimize import least_squares

    ended = least_squares(problem.residuals, start, method="lm")
    return _least_squares_result(problem, ended, 1.0, np.ones(len(start)))


def curve_fit_default(problem: Problem, start: Array) -> Result:
    """Fit with `scipy.optimize.curve_fit`, method trf, everything else at its default."""

    def model(_, *b: float) -> Array:
        return problem.residuals(np.array(b)) + problem.response

    size = np.ones(len(start))
    return _curve_fit_result(problem, model, problem.response, start, size, {"method": "trf"})


def _least_squares_result(problem: Problem, ended: Any, unit: float, size: Array) -> Result:
    roots = np.linalg.pinv(ended.jac, rcond=0.0)
    cost = 2.0 * ended.cost
    errors = np.sqrt(np.sum(roots * roots, axis=1) * cost / problem.freedom)
    return Result(ended.x * size, errors * size, cost * unit**2, ended.nfev)


def _curve_fit_result(
    problem: Problem,
    model: Callable[..., Array],
    response: Array,
    start: Array,
    size: Array,
    how: dict[str, Any],
) -> Result:
    from scipy.optimize import curve_fit

    first = problem.predictors[0]
    found, covariance, facts, *_ = curve_fit(model, first, response, start, full_output=True, **how)
    residuals = problem.residuals(found * size)
    errors = np.sqrt(np.diag(covariance)) * size
    return Result(found * size, errors, float(residuals @ residuals), facts["nfev"])


# The rows of the table, by name: how each fits.
EQUAL_ROWS: dict[str, Callable[[Problem, Array], Result]] = {
    "damperfit": by_damperfit,
    "least_squares lm": partial(least_squares_equal, method="lm"),
    "least_squares trf": partial(least_squares_equal, method="trf"),
    "curve_fit lm": curve_fit_equal,
}
OWN_ROWS: dict[str, Callable[[Problem, Array], Result]] = {
    "as dampers fit": as_dampers_fit,
    "least_squares lm, defaults": least_squares_default,
    "curve_fit trf, defaults": curve_fit_default,
}


def attempt(fit: Callable[[Problem, Array], Result], problem: Problem, start: Array) -> Digits:
    """Return the digits a solver gets right; none when it gives up."""
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        try:
            return judge(problem, fit(problem, start))
        except (RuntimeError, ValueError, np.linalg.LinAlgError):
            return Digits(0.0, 0.0, 0.0)
