r"""Smooth curves of one parameter over the setting, with errors that scatter allows for.

A curve is a polynomial P of the setting on one of three scales::

    linear       y = P(s)          the paper's quadratic for K_e
    log          y = exp(P(s))     every click changes y by nearly the same share
    reciprocal   y = 1/P(s)        a port whose area is a polynomial of the setting, R_m1 ~ 1/area

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

__all__ = ["LEAST_SCATTER", "SCALES", "Curve", "Points", "fit_curve", "scatter_of"]

SCALES = ("linear", "log", "reciprocal")

# No detent and no rig repeats better than this share; the error of a clean log is ten times less.
LEAST_SCATTER = 3e-3
# Twice to weigh by the curve instead of by the values, which scatter.
_PASSES = 3
_STEPS = 16  # of a bisection over e^7: tau within 1e-4 of itself


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
    """

    settings: FloatArray
    logs: FloatArray
    errors: FloatArray

    def __len__(self) -> int:
        return len(self.settings)

    def kept(self, mask: NDArray[np.bool_]) -> Points:
        """Return the points where the mask is True."""
        return Points(self.settings[mask], self.logs[mask], self.errors[mask])


@dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """A fitted curve.

    Attributes
    ----------
    scale : str
        One of `SCALES`.
    coefficients : numpy.ndarray
        Shape (degree + 1,), of P in powers of (s - centre)/half.
    covariance : numpy.ndarray
        Of the coefficients.
    centre, half : float
        Middle and half of the range of settings fitted.
    scatter : float
        tau.
    freedom : int
        Settings fitted less coefficients.
    """

    scale: str
    coefficients: FloatArray
    covariance: FloatArray
    centre: float
    half: float
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
        return _basis(settings, self.centre, self.half, self.degree)


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
    low, high = float(points.settings.min()), float(points.settings.max())
    centre, half = 0.5 * (low + high), max(0.5 * (high - low), 1.0)
    rows = _basis(points.settings, centre, half, degree)
    freedom = len(points) - degree - 1
    tau = LEAST_SCATTER if scatter is None else scatter
    # Values of one parameter may be 1e11; the level keeps every scale near one.
    level = float(np.mean(points.logs))
    level_logs = points.logs - level
    targets = _from_logs(scale, level_logs)
    about = level_logs
    coefficients, covariance = np.zeros(degree + 1), np.zeros((degree + 1, degree + 1))
    for _ in range(_PASSES):
        variances = points.errors**2 + tau**2
        weights = np.abs(_log_slope(scale, _from_logs(scale, about))) / np.sqrt(variances)
        coefficients, covariance = _solve(rows * weights[:, None], targets * weights)
        found = _to_logs(scale, rows @ coefficients)
        about = np.where(np.isfinite(found), found, about)
        residuals = level_logs - about
        if scatter is None:
            tau = scatter_of(residuals, points.errors, freedom)
    factor = math.exp(level) if scale == "linear" else math.exp(-level)
    if scale == "log":
        shift = np.zeros(degree + 1)
        shift[0] = level
        return Curve(scale, coefficients + shift, covariance, centre, half, tau, freedom)
    return Curve(scale, coefficients * factor, covariance * factor**2, centre, half, tau, freedom)


def scatter_of(residuals: FloatArray, errors: FloatArray, freedom: int) -> float:
    """Return tau, for which the sum of r^2/(sigma^2 + tau^2) is the degrees of freedom."""
    squares, variances = residuals**2, errors**2

    def excess(tau: float) -> float:
        return float(np.sum(squares / (variances + tau * tau))) - freedom

    if freedom < 1 or excess(LEAST_SCATTER) <= 0.0:
        return LEAST_SCATTER
    low, high = math.log(LEAST_SCATTER), math.log(1.0 + math.sqrt(float(np.sum(squares))))
    for _ in range(_STEPS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if excess(math.exp(middle)) > 0.0 else (low, middle)
    return math.exp(high)


def _solve(rows: FloatArray, targets: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Least squares and the covariance of its coefficients for residuals of variance one."""
    q, r = np.linalg.qr(rows)
    inverse = np.linalg.inv(r)
    return np.asarray(inverse @ (q.T @ targets)), np.asarray(inverse @ inverse.T)


def _basis(settings: FloatArray, centre: float, half: float, degree: int) -> FloatArray:
    return np.vander((settings - centre) / half, degree + 1, increasing=True)


def _from_logs(scale: str, logs: FloatArray) -> FloatArray:
    if scale == "log":
        return logs
    return np.exp(logs if scale == "linear" else -logs)


def _to_logs(scale: str, values: FloatArray) -> FloatArray:
    if scale == "log":
        return values
    with np.errstate(invalid="ignore", divide="ignore"):
        logs = np.log(np.where(values > 0.0, values, np.nan))
    return logs if scale == "linear" else -logs


def _log_slope(scale: str, values: FloatArray) -> FloatArray:
    """Derivative of ln y by P."""
    if scale == "log":
        return np.ones_like(values)
    return 1.0 / values if scale == "linear" else -1.0 / values
