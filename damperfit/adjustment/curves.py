r"""Smooth curves of one parameter over the setting, with errors that scatter allows for.

A curve is a polynomial P of the setting s, which runs from a to b, on one of these scales::

    linear       y = P(s)                 the paper's quadratic for K_e
    log          y = exp(P(s))            every click changes y by nearly the same share
    reciprocal   y = 1/P(s)               a port whose area is a polynomial of s, R_m1 ~ 1/area
    from_first   y = exp(P(ln(1 + s - a)))     a power of the clicks from the first setting,
    from_last    y = exp(P(ln(1 + b - s)))     or from the last one: steepest there

Residuals are relative, r = ln y - ln y_curve, on every scale, so that curves of all scales compete
by one likelihood. Their variance is v = sigma^2 + tau^2: the error of the fitted value and the
scatter between settings, which the logs of one setting cannot know. tau makes the mean square of
r/sqrt(v) one; it is never below `LEAST_SCATTER`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]

__all__ = [
    "LEAST_SCATTER",
    "SCALES",
    "Curve",
    "Points",
    "fit_curve",
    "least_squares",
    "powers",
    "scatter_of",
]

SCALES = ("linear", "log", "reciprocal", "from_first", "from_last")
_BENT = {"linear", "reciprocal"}  # scales on which P is no logarithm

# No detent and no rig repeats better than this share; the error of a clean log is far less.
LEAST_SCATTER = 3e-3
# Twice to weigh by the curve instead of by the values, which scatter.
_PASSES = 3
_STEPS = 30  # more than doubling tau in each, so that no scatter is out of reach
_WIDE = 1e3  # weights further apart are solved for by QR
_SMALL = 1e-3  # of the degrees of freedom: tau within a thousandth


@dataclass(frozen=True, slots=True, eq=False)
class Points:
    """Values of one parameter over the settings.

    Attributes
    ----------
    settings : numpy.ndarray
        Shape (n,), rising.
    logs : numpy.ndarray
        Shape (n,), ln y.
    errors : numpy.ndarray
        Shape (n,), standard errors of ln y.
    first, last : float
        Ends of the adjuster's range, also of points kept from a larger set.
    """

    settings: FloatArray
    logs: FloatArray
    errors: FloatArray
    first: float
    last: float

    def __len__(self) -> int:
        return len(self.settings)

    def kept(self, mask: NDArray[np.bool_]) -> Points:
        """Return the points where the mask is True."""
        return Points(
            self.settings[mask], self.logs[mask], self.errors[mask], self.first, self.last
        )


@dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """A fitted curve.

    Attributes
    ----------
    scale : str
        One of `SCALES`.
    coefficients : numpy.ndarray
        Shape (degree + 1,), of P in powers of its argument scaled to -1..1.
    covariance : numpy.ndarray
        Of the coefficients.
    first, last : float
        Ends of the range of settings.
    scatter : float
        tau.
    freedom : int
        Settings fitted less coefficients.
    """

    scale: str
    coefficients: FloatArray
    covariance: FloatArray
    first: float
    last: float
    scatter: float
    freedom: int

    @property
    def degree(self) -> int:
        """Degree of P."""
        return len(self.coefficients) - 1

    def logs(self, settings: FloatArray) -> FloatArray:
        """Return ln y of the curve; NaN where a scale has no value."""
        return _to_logs(self.scale, self.basis(settings) @ self.coefficients)

    def slopes(self, settings: FloatArray) -> FloatArray:
        """Return the derivative of ln y by the coefficients, shape (n, degree + 1)."""
        rows = self.basis(settings)
        return _log_slope(self.scale, rows @ self.coefficients)[:, None] * rows

    def errors(self, settings: FloatArray) -> FloatArray:
        """Return standard errors of ln y of the curve."""
        rows = self.slopes(settings)
        return np.asarray(np.sqrt(np.einsum("ij,jk,ik->i", rows, self.covariance, rows)))

    def basis(self, settings: FloatArray) -> FloatArray:
        """Return the powers of the scaled setting, shape (n, degree + 1)."""
        return powers(settings, self.scale, self.degree, ends=(self.first, self.last))


def fit_curve(points: Points, scale: str, degree: int, *, scatter: float | None = None) -> Curve:
    """Fit one curve by weighted least squares of relative residuals.

    Parameters
    ----------
    points : Points
        More of them than coefficients.
    scale : str
        One of `SCALES`.
    degree : int
        Of the polynomial.
    scatter : float, optional
        tau; found from the residuals by default.
    """
    ends = (points.first, points.last)
    rows = powers(points.settings, scale, degree, ends=ends)
    freedom = len(points) - degree - 1
    tau = LEAST_SCATTER if scatter is None else scatter
    # Values of one parameter may be 1e11; the level keeps every scale near one.
    level = float(np.mean(points.logs))
    level_logs = points.logs - level
    is_bent = scale in _BENT
    targets = _from_logs(scale, level_logs)
    about, squares = level_logs, points.errors**2
    coefficients, covariance = np.zeros(degree + 1), np.zeros((degree + 1, degree + 1))
    for _ in range(_PASSES):
        weights = 1.0 / np.sqrt(squares + tau**2)
        if is_bent:
            weights *= np.abs(_log_slope(scale, _from_logs(scale, about)))
        coefficients, covariance = least_squares(rows * weights[:, None], targets * weights)
        found = _to_logs(scale, rows @ coefficients)
        about = np.where(np.isfinite(found), found, about) if is_bent else found
        if scatter is None:
            tau = scatter_of(level_logs - about, points.errors, freedom)
    if is_bent:
        factor = math.exp(level if scale == "linear" else -level)
        coefficients, covariance = coefficients * factor, covariance * factor**2
    else:
        coefficients = coefficients + level * np.eye(degree + 1)[0]
    return Curve(scale, coefficients, covariance, *ends, tau, freedom)


def powers(
    settings: FloatArray, scale: str, degree: int, *, ends: tuple[float, float]
) -> FloatArray:
    """Return the powers of P's argument, scaled to -1..1 over the range; shape (n, degree + 1)."""
    first, last = ends
    half = max(0.5 * (last - first), 1.0)
    argument = (settings - 0.5 * (first + last)) / half
    if scale in {"from_first", "from_last"}:
        clicks = settings - first if scale == "from_first" else last - settings
        argument = 2.0 * np.log1p(clicks) / math.log1p(2.0 * half) - 1.0
    return np.vander(argument, degree + 1, increasing=True)


def scatter_of(residuals: FloatArray, errors: FloatArray, freedom: int) -> float:
    """Return tau, for which the sum of r^2/(sigma^2 + tau^2) is the degrees of freedom."""
    squares, variances = residuals * residuals, errors * errors
    if freedom < 1:
        return LEAST_SCATTER
    # With the largest error for all the root is known, and no other errors have theirs left of it.
    square = max(LEAST_SCATTER**2, float(squares.sum()) / freedom - float(variances.max()))
    # Newton from the left climbs to the root of a falling, convex function without passing it.
    for _ in range(_STEPS):
        weights = 1.0 / (variances + square)
        excess = float(squares @ weights) - freedom
        if excess <= _SMALL * freedom:
            break
        square += excess / float(squares @ (weights * weights))
    return math.sqrt(square)


def least_squares(rows: FloatArray, targets: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Least squares and the covariance of its coefficients for residuals of variance one.

    Powers of -1 to 1 leave the inverse of the normal equations ten digits, and what is left over,
    solved for once more, gives the coefficients theirs; a QR factorisation takes three times as
    long, and a choice of a trend is a hundred of these. Where weights are far apart it is taken.

    Parameters
    ----------
    rows : numpy.ndarray
        Shape (n, k), weighed powers from 1 on: the weights are the first column.
    targets : numpy.ndarray
        Shape (n,), weighed alike.
    """
    weights = rows[:, 0]
    if not float(weights.max()) < _WIDE * float(weights.min()):
        q, r = np.linalg.qr(rows)
        inverse = np.linalg.inv(r)
        return np.asarray(inverse @ (q.T @ targets)), np.asarray(inverse @ inverse.T)
    turned = rows.T
    covariance = np.asarray(np.linalg.inv(turned @ rows), dtype=np.float64)
    coefficients = covariance @ (turned @ targets)
    coefficients = coefficients + covariance @ (turned @ (targets - rows @ coefficients))
    return coefficients, covariance


def _from_logs(scale: str, logs: FloatArray) -> FloatArray:
    if scale == "linear":
        return np.exp(logs)
    return np.exp(-logs) if scale == "reciprocal" else logs


def _to_logs(scale: str, values: FloatArray) -> FloatArray:
    if scale not in _BENT:
        return values
    with np.errstate(invalid="ignore", divide="ignore"):
        logs = np.log(np.where(values > 0.0, values, np.nan))
    return logs if scale == "linear" else -logs


def _log_slope(scale: str, values: FloatArray) -> FloatArray:
    """Derivative of ln y by P."""
    if scale not in _BENT:
        return np.ones_like(values)
    return 1.0 / values if scale == "linear" else -1.0 / values
