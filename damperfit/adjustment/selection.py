"""Which curve runs through a parameter's settings, and which settings are off it.

Curve and outliers are chosen together, because a curve bent enough swallows an outlier at the end,
and an outlier left in bends the curve. For every scale and degree the best none, one and two
settings to leave out are found; of all these the least value wins of::

    sum(ln v + r^2/v) + ln(n) (coefficients + 1 + 3 outliers) + 2 ln(scales)

(Bayesian information criterion; an outlier costs its own number and the choice among n settings,
twice; a curve that is no constant costs the choice among the scales). Then each one left out must
prove itself: Student's t of its distance to the curve of the others, errors of both included, must
pass a bound set by `_FALSE_ALARM`, and at an end it must break off, not just get steeper.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from damperfit.adjustment.curves import (
    LEAST_SCATTER,
    SCALES,
    Curve,
    Points,
    fit_curve,
    least_squares,
    powers,
)
from damperfit.statistics import student_quantile

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]

__all__ = ["LEAST_FOR_OUTLIERS", "LEAST_FOR_TREND", "Choice", "choose"]

LEAST_FOR_TREND = 4
LEAST_FOR_OUTLIERS = 5
_LEAST_FOR_TWO = 8
_DEGREES = {"linear": 4, "log": 4, "reciprocal": 4, "from_first": 2, "from_last": 2}
_SETTINGS_PER_DEGREE = 3
_LEAST_FREEDOM = 2  # of the curve that judges an outlier
# The third difference of an outlier at an end over that of the curve beside it.
_STEEPENING = 8.0  # the root of a distance, drawn with degree 4, has up to 6
_FEW = 60  # settings of which every pair is looked at sooner than it is told which may be left
_OUTLIER_COST = 3  # its own number, and twice the choice among n settings, in ln(n)
# Share of parameters without an outlier in which chance finds one, times the number of settings:
# 0.1 % for 20 settings, 0.4 % for 5, where Student's t with 2 degrees of freedom is hard enough.
_FALSE_ALARM = 0.02


@dataclass(frozen=True, slots=True, eq=False)
class Choice:
    """The curve of the settings that follow it, and those that do not.

    Attributes
    ----------
    curve : Curve
        Through all settings but the outliers.
    outliers : tuple of int
        Places among the points.
    """

    curve: Curve
    outliers: tuple[int, ...]


@dataclass(frozen=True, slots=True, eq=False)
class _Candidate:
    criterion: float
    curve: Curve
    left_out: tuple[int, ...]


def choose(points: Points, families: Sequence[tuple[str, int]] | None = None) -> Choice:
    """Return curve and outliers.

    Parameters
    ----------
    points : Points
        `LEAST_FOR_TREND` or more.
    families : sequence of (str, int), optional
        Scales and degrees to choose from; all that the number of settings allows by default.
    """
    if families is None:
        highest = (len(points) - 1) // _SETTINGS_PER_DEGREE
        families = [("log", 0)]
        families += [(s, d) for s in SCALES for d in range(1, min(highest, _DEGREES[s]) + 1)]
    candidates = sorted(
        itertools.chain.from_iterable(_candidates(points, *family) for family in families),
        key=lambda one: one.criterion,
    )
    for one in candidates:
        if all(_is_off(points, one, p) and _is_jump(points, one, p) for p in one.left_out):
            return Choice(one.curve, one.left_out)
    raise AssertionError("a curve without outliers is always among the candidates")


def _candidates(points: Points, scale: str, degree: int) -> Iterator[_Candidate]:
    """Yield the best curve of a family for each number of settings left out."""

    # The worst are mostly the same ones again.
    @cache
    def fitted(left_out: tuple[int, ...]) -> Curve:
        return fit_curve(_without(points, left_out), scale, degree)

    @cache
    def worst(tau: float, n: int) -> tuple[int, ...]:
        return _worst(points, scale, degree, tau=tau, n=n)

    yield _judged(points, fitted(()), ())
    most = _most_outliers(len(points), degree)
    if most == 0:
        return
    tau = LEAST_SCATTER
    for _ in range(2):  # with the scatter that is left when the worst are out
        tau = fitted(worst(tau, most)).scatter
    for n in range(1, most + 1):
        left_out = worst(tau, n)
        yield _judged(points, fitted(left_out), left_out)


def _most_outliers(n: int, degree: int) -> int:
    if n < LEAST_FOR_OUTLIERS:
        return 0
    allowed = 2 if n >= _LEAST_FOR_TWO else 1
    return max(0, min(allowed, n - degree - 1 - _LEAST_FREEDOM))


def _worst(points: Points, scale: str, degree: int, *, tau: float, n: int) -> tuple[int, ...]:
    """Return the n points without which the sum of squares is least, from one fit of all.

    Leaving out the points S takes e_S (I - H)_SS^-1 e_S off it, with residuals e and hat matrix H.
    """
    rows, targets = _weighted(points, scale, degree, tau)
    coefficients, covariance = least_squares(rows, targets)
    residuals = targets - rows @ coefficients
    half = rows @ covariance
    leverages = np.einsum("ij,ij->i", half, rows)
    if n == 1:
        return (int(np.argmax(residuals**2 / np.maximum(1.0 - leverages, 1e-12))),)
    near = np.arange(len(points))
    if len(points) > _FEW:
        near = _of_the_best_pair(rows, half, leverages, residuals)
    gains = _gains(rows[near], half[near], residuals[near])
    gains = np.where(_above_the_diagonal(len(near)), gains, -1.0)
    first, second = np.unravel_index(int(np.argmax(gains)), gains.shape)
    return (int(near[first]), int(near[second]))


def _of_the_best_pair(
    rows: FloatArray, half: FloatArray, leverages: FloatArray, residuals: FloatArray
) -> NDArray[np.intp]:
    """Return the points that may be of the best pair, rising.

    A pair takes off no more than (e_i^2 + e_j^2)/(1 - h_i - h_j), for the trace of H_SS bounds its
    eigenvalues; the best one no less than the two best points together.
    """
    squares = residuals**2
    two = np.argsort(squares / np.maximum(1.0 - leverages, 1e-12))[-2:]
    least = float(_gains(rows[two], half[two], residuals[two])[0, 1])
    room = 1.0 - leverages - leverages.max()
    return np.flatnonzero((room <= 0.0) | (squares + squares.max() >= least * room))


def _gains(rows: FloatArray, half: FloatArray, residuals: FloatArray) -> FloatArray:
    """What leaving out two of some points takes off the sum of squares, shape (m, m)."""
    left = np.eye(len(rows)) - half @ rows.T
    own = np.maximum(np.diag(left), 1e-12)
    determinant = np.outer(own, own)
    determinant -= left * left
    np.maximum(determinant, 1e-12, out=determinant)
    squares = np.outer(residuals**2, own)
    left *= np.outer(-2.0 * residuals, residuals)
    left += squares
    left += squares.T
    left /= determinant
    return left


@cache
def _above_the_diagonal(n: int) -> NDArray[np.bool_]:
    return np.triu(np.ones((n, n), dtype=np.bool_), k=1)


def _weighted(points: Points, scale: str, degree: int, tau: float) -> tuple[FloatArray, FloatArray]:
    """Rows and targets of the least squares, weighed by the values themselves."""
    logs = points.logs - points.logs.mean()
    deviation = np.sqrt(points.errors**2 + tau**2)
    values = {"linear": np.exp(logs), "reciprocal": np.exp(-logs)}.get(scale)
    slopes = np.ones(len(points)) if values is None else values
    targets = logs if values is None else values
    rows = powers(points.settings, scale, degree, ends=(points.first, points.last))
    weights = 1.0 / (slopes * deviation)
    return rows * weights[:, None], targets * weights


def _judged(points: Points, curve: Curve, left_out: tuple[int, ...]) -> _Candidate:
    kept = _without(points, left_out)
    residuals = kept.logs - curve.logs(kept.settings)
    variances = points.errors**2 + curve.scatter**2
    inside = kept.errors**2 + curve.scatter**2
    misfit = float(np.sum(np.log(variances)) + np.sum(residuals**2 / inside))
    cost = math.log(len(points)) * (curve.degree + 2 + _OUTLIER_COST * len(left_out))
    if curve.degree:
        cost += 2.0 * math.log(len(SCALES))
    total = misfit + cost
    return _Candidate(total if math.isfinite(total) else math.inf, curve, left_out)


def _is_off(points: Points, one: _Candidate, place: int) -> bool:
    choices = math.comb(len(points), len(one.left_out))
    share = 1.0 - 0.5 * _FALSE_ALARM / len(points) / choices
    bound = student_quantile(one.curve.freedom, share)
    return _distance(points, one.curve, place) > bound


def _is_jump(points: Points, one: _Candidate, place: int) -> bool:
    """Whether a setting at an end breaks off, and does not just go on getting steeper.

    A curve that grows without bound towards its end, such as the root of the distance to it, is no
    polynomial on any scale. There the third divided difference of ln y grows from setting to
    setting, threefold at most with ln; at a jump it comes from nothing.
    """
    kept = [k for k in range(len(points)) if k not in one.left_out]
    if kept[0] < place < kept[-1] or len(kept) < 4:
        return True
    near = kept[:4] if place < kept[0] else kept[:-5:-1]
    settings = points.settings[near]
    smooth = one.curve.logs(settings)
    own = _third_difference(
        np.append(points.settings[place], settings[:3]),
        np.append(points.logs[place], smooth[:3]),
    )
    return abs(own) > _STEEPENING * abs(_third_difference(settings, smooth))


def _third_difference(settings: FloatArray, values: FloatArray) -> float:
    """Divided difference of four values."""
    for k in range(1, 4):
        values = np.diff(values) / (settings[k:] - settings[:-k])
    return float(values[0])


def _distance(points: Points, curve: Curve, place: int) -> float:
    """Distance of a point to the curve of others, in standard deviations of that distance."""
    at = points.settings[place : place + 1]
    distance = float(abs(points.logs[place] - curve.logs(at)[0]))
    variance = float(points.errors[place]) ** 2 + curve.scatter**2 + float(curve.errors(at)[0]) ** 2
    return distance / math.sqrt(variance) if math.isfinite(distance) else 0.0


def _without(points: Points, places: tuple[int, ...]) -> Points:
    mask = np.ones(len(points), dtype=np.bool_)
    mask[list(places)] = False
    return points.kept(mask)
