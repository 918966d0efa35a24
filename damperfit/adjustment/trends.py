"""The trend of each parameter over the settings: band, direction, settings off it, a sentence.

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

Curve and outliers are chosen together, because a curve bent enough swallows an outlier at the end,
and an outlier left in bends the curve. For every scale and degree the best none, one and two
settings to leave out are candidates; the one with the least value of this criterion wins::

    sum(ln v + r^2/v) + ln(n) (coefficients + 1 + 3 outliers) + 2 ln(scales)

(Bayesian information criterion; an outlier costs its own number and the choice among n settings,
twice; a curve that is no constant costs the choice among the scales). Then each one left out must
prove itself: Student's t of its distance to the curve of the others, errors of both included, must
pass a bound set by `_FALSE_ALARM`, and at an end it must break off, not just get steeper.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from damperfit.arrays import FloatArray
from damperfit.identification.fit_setting import Fit
from damperfit.identification.outcome import Status
from damperfit.problem import listed_names
from damperfit.statistics import median, student_quantile
from damperfit.tested.setting import ADJUSTER, Setting, SettingLine, lines_of
from damperfit.units.quantities import engineering

if TYPE_CHECKING:
    from damperfit.damper.model import Quantity
    from damperfit.uncertainty.covariance import Uncertainty

SCALES = ("linear", "log", "reciprocal", "from_first", "from_last")
_SIGN = {"linear": 1.0, "reciprocal": -1.0}  # P is y to this power; on other scales its logarithm
_HIGHEST = {"linear": 4, "log": 4, "reciprocal": 4, "from_first": 2, "from_last": 2}
# No detent and no rig repeats better than this share; the error of a clean log is far less.
LEAST_SCATTER = 3e-3
_PASSES = 3  # twice to weigh by the curve instead of by the values, which scatter
_STEPS = 30  # more than doubling tau in each, so that no scatter is out of reach
_SMALL = 1e-3  # of the degrees of freedom: tau within a thousandth
LEAST_FOR_TREND = 4
LEAST_FOR_OUTLIERS = 5
_LEAST_FOR_TWO = 8
_SETTINGS_PER_DEGREE = 3
# The third difference of an outlier at an end over that of the curve beside it.
_STEEPENING = 8.0  # the root of a distance, drawn with degree 4, has up to 6
_OUTLIER_COST = 3  # its own number, and twice the choice among n settings, in ln(n)
# Share of parameters without an outlier in which chance finds one, times the number of settings:
# 0.1 % for 20 settings, 0.4 % for 5, where Student's t with 2 degrees of freedom is hard enough.
_FALSE_ALARM = 0.02
_ERRATIC = 3.0  # scatter between settings over the errors of the values
_REMARKABLE = 0.02  # scatter below this share is no news
_TOO_UNCERTAIN = 0.2  # scatter and error without a direction beyond; the paper's K_e has 0.1
_USUAL_FROM = 8  # settings: of fewer the median residual says little
_MEDIAN_OF_NORMAL = 0.6745  # median distance from the mean, in standard deviations
_95_PERCENT = 0.05
_WIDEST_RANGE = 200.0  # of settings; beyond it they are no clicks, and gaps are not filled
_QUADRATIC_FROM = 6  # settings: three coefficients, three degrees of freedom

# A curve and its fit


class Points(NamedTuple):
    """Values of one parameter over the settings, arrays of shape (n,)."""

    settings: FloatArray  # rising
    logs: FloatArray  # ln y
    errors: FloatArray  # standard errors of ln y
    ends: tuple[float, float]  # of the adjuster's range, also of points kept from a larger set

    @property
    def n(self) -> int:
        """How many."""
        return len(self.settings)

    def without(self, places: Sequence[int]) -> Points:
        """Return the points but for those at some places."""
        settings, logs, errors = (np.delete(row, places) for row in self[:3])
        return Points(settings, logs, errors, self.ends)


class Curve(NamedTuple):
    """A fitted curve."""

    scale: str  # one of `SCALES`
    coefficients: FloatArray  # of P in powers of its argument scaled to -1..1, shape (degree + 1,)
    covariance: FloatArray
    ends: tuple[float, float]  # of the range of settings
    scatter: float  # tau
    freedom: int  # settings fitted less coefficients

    @property
    def degree(self) -> int:
        """Degree of P."""
        return len(self.coefficients) - 1

    def logs(self, settings: FloatArray) -> FloatArray:
        """Return ln y of the curve; NaN where a scale has no value."""
        rows = _powers(settings, self.scale, self.degree, self.ends)
        return _to_logs(self.scale, rows @ self.coefficients)

    def slopes(self, settings: FloatArray) -> FloatArray:
        """Return the derivative of ln y by the coefficients, shape (n, degree + 1)."""
        rows = _powers(settings, self.scale, self.degree, self.ends)
        if self.scale not in _SIGN:
            return rows
        return (_SIGN[self.scale] / (rows @ self.coefficients))[:, None] * rows

    def errors_of(self, rows: FloatArray) -> FloatArray:
        """Return the standard errors of what depends on the coefficients by rows of slopes."""
        return np.asarray(np.sqrt(np.einsum("ij,jk,ik->i", rows, self.covariance, rows)))

    def quantile(self, n: int) -> float:
        """Student's t that none of n steps exceeds by chance in 95 of 100 cases."""
        return student_quantile(max(self.freedom, 1), 1.0 - 0.5 * _95_PERCENT / n)


def _powers(settings: FloatArray, scale: str, degree: int, ends: tuple[float, float]) -> FloatArray:
    """Return the powers of P's argument, scaled to -1..1 over the range; shape (n, degree + 1)."""
    first, last = ends
    half = max(0.5 * (last - first), 1.0)
    argument = (settings - 0.5 * (first + last)) / half
    if scale in {"from_first", "from_last"}:
        clicks = settings - first if scale == "from_first" else last - settings
        argument = 2.0 * np.log1p(clicks) / math.log1p(2.0 * half) - 1.0
    return np.vander(argument, degree + 1, increasing=True)


def _from_logs(scale: str, logs: FloatArray) -> FloatArray:
    return np.exp(_SIGN[scale] * logs) if scale in _SIGN else logs


def _to_logs(scale: str, values: FloatArray) -> FloatArray:
    if scale not in _SIGN:
        return values
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(_SIGN[scale] * np.log(np.where(values > 0.0, values, np.nan)))


def fit_curve(points: Points, scale: str, degree: int) -> Curve:
    """Fit one curve by weighted least squares of relative residuals; tau is found from these."""
    rows = _powers(points.settings, scale, degree, points.ends)
    freedom = points.n - degree - 1
    targets, fitted, tau = _from_logs(scale, points.logs), points.logs, LEAST_SCATTER
    coefficients, covariance = np.zeros(degree + 1), np.zeros((degree + 1, degree + 1))
    for _ in range(_PASSES):
        weights = 1.0 / np.sqrt(points.errors**2 + tau**2)
        if scale in _SIGN:
            weights = weights * np.abs(1.0 / _from_logs(scale, fitted))
        coefficients, covariance = least_squares(rows * weights[:, None], targets * weights)
        curve = _to_logs(scale, rows @ coefficients)
        fitted = np.where(np.isfinite(curve), curve, fitted)
        tau = scatter_of(points.logs - fitted, points.errors, freedom)
    return Curve(scale, coefficients, covariance, points.ends, tau, freedom)


def scatter_of(residuals: FloatArray, errors: FloatArray, freedom: int) -> float:
    """Return tau, for which the sum of r^2/(sigma^2 + tau^2) is the degrees of freedom."""
    squares, variances = residuals * residuals, errors * errors
    if freedom < 1:
        return LEAST_SCATTER
    # The root for the largest error at all points is a lower bound of the root.
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
    """Return least squares and the covariance of its coefficients for residuals of variance one."""
    q, r = np.linalg.qr(rows)
    inverse = np.linalg.inv(r)
    return np.asarray(inverse @ (q.T @ targets)), np.asarray(inverse @ inverse.T)


# Which curve, and which settings are off it


def choose(
    points: Points, families: Sequence[tuple[str, int]] | None = None
) -> tuple[Curve, tuple[int, ...]]:
    """Return the curve of the settings that follow it, and the places of those that do not."""
    n = points.n
    if families is None:
        families = [("log", 0)]
        for scale in SCALES:
            highest = min((n - 1) // _SETTINGS_PER_DEGREE, _HIGHEST[scale])
            families += [(scale, degree) for degree in range(1, highest + 1)]
    allowed = 0 if n < LEAST_FOR_OUTLIERS else 2 if n >= _LEAST_FOR_TWO else 1
    candidates = []
    for scale, degree in families:
        worst = _worst(points, scale, degree, LEAST_SCATTER)
        # With the scatter that is left when the worst are out.
        tau = fit_curve(points.without(worst[allowed]), scale, degree).scatter
        for outliers in _worst(points, scale, degree, tau)[: allowed + 1]:
            curve = fit_curve(points.without(outliers), scale, degree)
            candidates.append((_criterion(points, curve, outliers), curve, outliers))
    for _, curve, outliers in sorted(candidates, key=lambda candidate: candidate[0]):
        share = 1.0 - 0.5 * _FALSE_ALARM / n / math.comb(n, len(outliers))
        if all(
            _distance(points, curve, place) > student_quantile(curve.freedom, share)
            and _is_jump(points, curve, place, outliers)
            for place in outliers
        ):
            return curve, outliers
    raise AssertionError("a curve without outliers is always among the candidates")


def _worst(points: Points, scale: str, degree: int, tau: float) -> list[tuple[int, ...]]:
    """None, the point and the two without which the sum of squares is least, from one fit."""
    # Leaving out the points S takes e_S (I - H)_SS^-1 e_S off it, with residuals e, hat matrix H.
    values = _from_logs(scale, points.logs)
    weights = 1.0 / np.sqrt(points.errors**2 + tau**2)
    if scale in _SIGN:  # weighed by the values themselves
        weights = weights / values
    rows = _powers(points.settings, scale, degree, points.ends) * weights[:, None]
    coefficients, covariance = least_squares(rows, values * weights)
    residuals = values * weights - rows @ coefficients
    complement = np.eye(len(rows)) - rows @ covariance @ rows.T
    diagonal = np.maximum(np.diag(complement), 1e-12)
    first = int(np.argmax(residuals**2 / diagonal))
    determinants = np.maximum(np.outer(diagonal, diagonal) - complement**2, 1e-12)
    squares = np.outer(residuals**2, diagonal)
    gains = (squares + squares.T - 2.0 * complement * np.outer(residuals, residuals)) / determinants
    gains[np.tril_indices(len(rows))] = -1.0
    i, j = np.unravel_index(int(np.argmax(gains)), gains.shape)
    return [(), (first,), (int(i), int(j))]


def _criterion(points: Points, curve: Curve, outliers: Sequence[int]) -> float:
    inliers = points.without(outliers)
    residuals = inliers.logs - curve.logs(inliers.settings)
    variances = points.errors**2 + curve.scatter**2
    inside = inliers.errors**2 + curve.scatter**2
    misfit = float(np.sum(np.log(variances)) + np.sum(residuals**2 / inside))
    cost = math.log(points.n) * (curve.degree + 2 + _OUTLIER_COST * len(outliers))
    if curve.degree:
        cost += 2.0 * math.log(len(SCALES))
    return misfit + cost if math.isfinite(misfit + cost) else math.inf


def _is_jump(points: Points, curve: Curve, place: int, outliers: Sequence[int]) -> bool:
    """Whether a setting at an end breaks off, and does not just go on getting steeper."""
    # A curve that grows without bound towards its end is no polynomial on any scale. There the
    # third divided difference of ln y grows, threefold at most with ln; at a jump from nothing.

    def third_difference(settings: FloatArray, values: FloatArray) -> float:
        for k in range(1, 4):
            values = np.diff(values) / (settings[k:] - settings[:-k])
        return abs(float(values[0]))

    inliers = [k for k in range(points.n) if k not in outliers]
    if inliers[0] < place < inliers[-1] or len(inliers) < 4:
        return True
    end = points.settings[inliers[:4] if place < inliers[0] else inliers[:-5:-1]]
    smooth = curve.logs(end)
    at_jump = np.append(points.settings[place], end[:3]), np.append(points.logs[place], smooth[:3])
    return third_difference(*at_jump) > _STEEPENING * third_difference(end, smooth)


def _distance(points: Points, curve: Curve, place: int) -> float:
    """Distance of a point to the curve of others, in standard deviations of that distance."""
    at = points.settings[place : place + 1]
    distance = float(abs(points.logs[place] - curve.logs(at)[0]))
    curve_error = float(curve.errors_of(curve.slopes(at))[0])
    variance = float(points.errors[place]) ** 2 + curve.scatter**2 + curve_error**2
    return distance / math.sqrt(variance) if math.isfinite(distance) else 0.0


# The trend of a parameter


@dataclass(frozen=True, slots=True)
class TrendPoint:
    """The trend at one setting, with its pointwise 95 % band, and the fitted value, SI.

    The band is that of the curve; values scatter about it.
    """

    # Clicks: every whole number from the lowest to the highest, fitted or not, and what was fitted
    # in between (the fitted ones alone where they span more than 200).
    setting: int | float
    value: float
    low: float
    high: float
    found: float | None  # None: there is none


@dataclass(frozen=True, slots=True)
class Outlier:
    """A setting off the trend of the others."""

    setting: int | float  # by the clicks of the adjuster
    value: float  # what was fitted, SI
    expected: float  # the trend there
    deviation: float  # value/expected - 1


@dataclass(frozen=True, slots=True)
class Trend:
    """How one parameter changes over the settings; without a trend, where they are too few."""

    parameter: str
    scale: str | None = None  # of `SCALES`; None without a trend
    degree: int | None = None
    scatter: float = math.nan  # of the values about the trend, beyond their own errors, relative
    is_erratic: bool = False  # whether they scatter far beyond their errors
    # "rising", "falling" or "flat" with the setting, "mixed" when it turns, None without trend and
    # where errors and scatter hide it.
    direction: str | None = None
    # Neither the trend nor a value turns back by more than errors and scatter allow. The scatter
    # of erratic values allows nothing, but for K_e, whose trend is not judged where it is large.
    monotone: bool | None = None
    # Neighbouring settings between which the value goes against the direction.
    reversals: tuple[tuple[int | float, int | float], ...] = ()
    outliers: tuple[Outlier, ...] = ()
    outliers_judged: bool = False  # False: too few settings, or erratic values
    points: tuple[TrendPoint, ...] = ()
    sentence: str = ""
    adjuster: str = ADJUSTER  # along which the settings stand
    held: str = ""  # where the other adjusters stand, for people; empty where there are none
    symbol: str = ""  # of the parameter
    why: str = ""  # there is no trend; empty where there is one


def find_trends(
    fits: Sequence[Fit], uncertainties: Mapping[Setting, Uncertainty]
) -> tuple[Trend, ...]:
    """Return the trend of every parameter that was fitted setting by setting, by adjuster."""
    free = {Status.FITTED, Status.AT_BOUND, Status.NOT_IDENTIFIABLE}
    trends = []
    for line in lines_of(fit.setting for fit in fits):
        for quantity in fits[0].parameters.quantities:
            name, rows = quantity.name, []
            if not quantity.is_logarithmic or all(fit.status[name] not in free for fit in fits):
                continue
            for fit in fits:
                uncertainty = uncertainties.get(fit.setting)
                interval = uncertainty.intervals.get(name) if uncertainty else None
                value = getattr(fit.parameters, name)
                is_fitted = fit.status[name] == Status.FITTED and fit.setting in line.numbers
                if is_fitted and interval and math.isfinite(interval.error) and value > 0.0:
                    number = line.numbers[fit.setting]
                    rows.append((number, math.log(value), interval.error / value))
            trends.append(_trend(quantity, sorted(rows), line))
    return tuple(trends)


def _trend(
    quantity: Quantity, known: Sequence[tuple[float, float, float]], line: SettingLine
) -> Trend:
    """The trend of known values: settings, ln y and its errors."""
    n = len(known)
    if n < LEAST_FOR_TREND:
        count = f"determined at {n or 'no'} setting{'' if n < 2 else 's'}"
        reason = f"{count}, too few for a trend ({LEAST_FOR_TREND} are needed)"
        if not line.numbers:
            reason = "the settings are words, along which there is no trend"
        reason += f", along {line.adjuster} with {line.held}" if line.held else ""
        trend = Trend(quantity.name, adjuster=line.adjuster, held=line.held, why=reason)
        return replace(trend, symbol=quantity.symbol, sentence=f"{quantity.symbol}: {reason}")
    settings, logs, errors = np.array(known, dtype=np.float64).T
    points = Points(settings, logs, errors, (settings[0], settings[-1]))
    families = None
    if quantity.trend_degree is not None:
        families = [("linear", quantity.trend_degree if n >= _QUADRATIC_FROM else 1)]
    curve, places = choose(points, families)
    inliers, outliers = points.without(places), []
    for at, log in zip(points.settings[[*places]], points.logs[[*places]], strict=True):
        value, expected = math.exp(log), float(_exp(curve.logs(np.array([at])))[0])
        outliers.append(Outlier(_clicks(at), value, expected, value / expected - 1.0))
    error = median(points.errors)
    is_erratic = curve.scatter > max(_ERRATIC * error, _REMARKABLE)
    is_wild = is_erratic and not quantity.is_open
    direction: str | None = "flat"
    if curve.degree:  # by those of its steps that are beyond their errors
        logs, slopes = curve.logs(inliers.settings), curve.slopes(inliers.settings)
        rows = np.vstack([np.diff(slopes, axis=0), slopes[-1] - slopes[0]])
        steps = np.append(np.diff(logs), logs[-1] - logs[0])
        direction = _direction_of(steps, curve.quantile(len(steps)) * curve.errors_of(rows))
    allowed = LEAST_SCATTER if is_wild else curve.scatter
    if not quantity.is_open:
        if not is_wild and inliers.n >= _USUAL_FROM:
            # That of most settings: a few that were swapped must not excuse themselves.
            off = median(np.abs(inliers.logs - curve.logs(inliers.settings))) / _MEDIAN_OF_NORMAL
            square = off**2 * inliers.n / curve.freedom - median(inliers.errors) ** 2
            allowed = min(allowed, math.sqrt(max(square, LEAST_SCATTER**2)))
        if direction == "mixed" or (is_wild and direction == "flat"):
            # By the values themselves: a curve may turn about a kink where no value does.
            first, second = np.triu_indices(n, 1)
            variances = points.errors**2 + allowed**2
            spread = np.sqrt(variances[first] + variances[second])
            steps = points.logs[second] - points.logs[first]
            direction = _direction_of(steps, curve.quantile(len(steps)) * spread)
    # Neighbours between which the value goes back by more than errors and scatter allow.
    variances = points.errors**2 + allowed**2
    spread = np.sqrt(variances[1:] + variances[:-1])
    steps = {"rising": 1.0, "falling": -1.0}.get(direction or "", 0.0) * np.diff(points.logs)
    back = np.flatnonzero(steps < -curve.quantile(len(steps)) * spread)
    reversals = tuple((_clicks(points.settings[k]), _clicks(points.settings[k + 1])) for k in back)
    has_direction = not quantity.is_open or curve.scatter <= _TOO_UNCERTAIN
    if direction == "flat" and math.hypot(curve.scatter, error) > _TOO_UNCERTAIN:
        direction, has_direction = None, False
    monotone = direction != "mixed" and not reversals if has_direction else None
    is_mixed_up = is_wild and not monotone and not outliers
    trend = Trend(
        parameter=quantity.name,
        scale=curve.scale,
        degree=curve.degree,
        scatter=curve.scatter,
        is_erratic=is_erratic,
        direction=direction,
        monotone=monotone,
        reversals=reversals,
        outliers=tuple(outliers),
        outliers_judged=n >= LEAST_FOR_OUTLIERS and not is_mixed_up,
        points=_curve_points(points, curve),
        adjuster=line.adjuster,
        held=line.held,
        symbol=quantity.symbol,
    )
    return replace(trend, sentence=_sentence(trend, quantity, error, n))


def _direction_of(steps: FloatArray, reach: FloatArray) -> str:
    rises, falls = bool(np.any(steps > reach)), bool(np.any(steps < -reach))
    return "mixed" if rises and falls else "rising" if rises else "falling" if falls else "flat"


def _curve_points(points: Points, curve: Curve) -> tuple[TrendPoint, ...]:
    fitted = {_clicks(s): math.exp(y) for s, y in zip(points.settings, points.logs, strict=True)}
    settings = points.settings
    if np.ptp(settings) <= _WIDEST_RANGE:
        between = np.arange(settings[0], settings[-1] + 0.5)
        settings = np.array(sorted({*between.tolist(), *settings.tolist()}))
    logs = curve.logs(settings)
    reach = curve.quantile(1) * curve.errors_of(curve.slopes(settings))
    value, low, high = (_exp(row).tolist() for row in (logs, logs - reach, logs + reach))
    places = map(_clicks, settings)
    return tuple(
        TrendPoint(place, at, least, most, fitted.get(place))
        for place, at, least, most in zip(places, value, low, high, strict=True)
    )


def _clicks(number: float) -> int | float:
    return int(number) if float(number).is_integer() else float(number)


def _exp(logs: FloatArray) -> FloatArray:
    with np.errstate(over="ignore"):
        return np.asarray(np.exp(logs))


_DEGREE_NAMES = ("constant", "straight line", "quadratic", "cubic", "quartic")
_ON = {
    "linear": "",
    "log": " in its logarithm",
    "reciprocal": " in its reciprocal",
    "from_first": " of logarithms, counted from the first setting",
    "from_last": " of logarithms, counted from the last setting",
}


def _sentence(trend: Trend, quantity: Quantity, error: float, n: int) -> str:
    """Direction and range, scatter, outliers, reversals."""
    first, last, adjuster = trend.points[0], trend.points[-1], trend.adjuster
    by = "the setting" if adjuster == ADJUSTER else adjuster
    words = {
        "rising": f"rises with {by}",
        "falling": f"falls with {by}",
        "flat": f"does not change with {by}" + " by more than its errors" * bool(trend.degree),
        "mixed": "turns: it neither rises nor falls throughout",
        None: "shows no trend beyond its errors and scatter",
    }[trend.direction]
    kind = f"{_DEGREE_NAMES[trend.degree or 0]}{_ON[trend.scale or ''] if trend.degree else ''}"
    scale, unit = quantity.shown
    scatter = f"{100.0 * trend.scatter:.2g} %"
    text = (
        f"{quantity.symbol} {words}, {engineering(scale * first.value)}{unit} at {adjuster} "
        f"{first.setting}, {engineering(scale * last.value)}{unit} at {last.setting} ({kind})"
    )
    if trend.held:
        text += f" with {trend.held}"
    if trend.is_erratic:
        text += f"; it is erratic: it scatters by {scatter} from {adjuster} to {adjuster}, "
        text += f"{trend.scatter / error:.0f} times its own error"
    else:
        text += f", within {scatter}"
    for outlier in trend.outliers:
        share = f"{100.0 * outlier.deviation:+.1f} %"
        text += f"; {adjuster} {outlier.setting} is off the trend by {share}"
    if trend.reversals:
        pairs = listed_names([f"{a} to {b}" for a, b in trend.reversals])
        text += f"; against the trend from {adjuster} {pairs}"
    if n < LEAST_FOR_OUTLIERS:
        text += f"; too few settings to find one off the trend ({LEAST_FOR_OUTLIERS} are needed)"
    elif not trend.outliers_judged:
        text += "; no curve that a setting could be off: are settings mixed up?"
    return text


def in_few_words(trends: Iterable[Trend]) -> tuple[str, ...]:
    """Return a sentence a trend, and one for all that are missing for the same reason.

    >>> missing = [Trend(name, symbol=name, why="no trend") for name in ("a", "b")]
    >>> in_few_words([*missing, Trend("c", sentence="c rises")])
    ('a, b: no trend', 'c rises')
    """
    texts: dict[str, list[str]] = {}
    for trend in trends:
        symbol, why = trend.symbol, trend.why
        if trend.degree is None and not why:  # of a folder from before the reason stood alone
            symbol, _, why = trend.sentence.partition(": ")
        texts.setdefault(why or trend.sentence, []).append(symbol if why else "")
    return tuple(
        f"{', '.join(symbols)}: {words}" if symbols[0] else words
        for words, symbols in texts.items()
    )
