"""The trend of each parameter over the settings: band, direction, settings off it, a sentence."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from damperfit.adjustment.curves import LEAST_SCATTER, Curve, Points
from damperfit.adjustment.selection import LEAST_FOR_OUTLIERS, LEAST_FOR_TREND, choose
from damperfit.identification import Status
from damperfit.statistics import median, student_quantile
from damperfit.tested.setting import ADJUSTER, Setting, SettingLine, lines_of
from damperfit.units.quantities import engineering

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from damperfit.damper.quantity import Quantity
    from damperfit.identification import Fit
    from damperfit.uncertainty import Uncertainty

    FloatArray = NDArray[np.float64]

__all__ = ["Outlier", "Trend", "TrendPoint", "find_trends"]

_DEGREES = ("constant", "straight line", "quadratic", "cubic", "quartic")
_ERRATIC = 3.0  # scatter between settings over the errors of the values
_REMARKABLE = 0.02  # scatter below this share is no news
_TOO_UNCERTAIN = (
    0.2  # scatter and error beyond which a trend has no direction; the paper's K_e has 0.1
)
_USUAL_FROM = 8  # settings: of fewer the median residual says little
_MEDIAN_OF_NORMAL = 0.6745  # median distance from the mean, in standard deviations
_MOST_PAIRS = 5  # named in a sentence
_95_PERCENT = 0.05
_WIDEST_RANGE = 200.0  # of settings; beyond it they are no clicks, and gaps are not filled
_QUADRATIC_FROM = 6  # settings: three coefficients, three degrees of freedom


@dataclass(frozen=True, slots=True)
class TrendPoint:
    """The trend at one setting, and the value found there.

    Attributes
    ----------
    setting : int or float
        Clicks of the adjuster: every whole number from the lowest to the highest, fitted or not,
        and what was fitted in between (the fitted ones alone where they span more than 200).
    value, low, high : float
        The trend and its pointwise 95 % band, SI. The band is that of the curve; values scatter
        about it.
    found : float or None
        The fitted value, None where there is none.
    """

    setting: int | float
    value: float
    low: float
    high: float
    found: float | None


@dataclass(frozen=True, slots=True)
class Outlier:
    """A setting off the trend of the others.

    Attributes
    ----------
    setting : int or float
        Which, by the clicks of the adjuster.
    value, expected : float
        What was fitted, and the trend there, SI.
    deviation : float
        value/expected - 1.
    """

    setting: int | float
    value: float
    expected: float
    deviation: float


@dataclass(frozen=True, slots=True)
class Trend:
    """How one parameter goes over the settings.

    Attributes
    ----------
    parameter : str
        Name.
    scale : str or None
        On which scale the trend is a polynomial: "linear", "log", "reciprocal", or "from_first",
        "from_last" (powers of the clicks from an end). None where settings are too few for one.
    degree : int or None
        Of the polynomial.
    scatter : float
        Relative scatter of the values about the trend, beyond their own errors; NaN without one.
    is_erratic : bool
        Whether they scatter far beyond their errors.
    direction : str or None
        "rising", "falling" or "flat" with the setting, "mixed" when it turns, None without trend
        and where errors and scatter hide it.
    monotone : bool or None
        Neither the trend nor a value turns back by more than errors and scatter allow. The scatter
        of erratic values allows nothing, but for K_e, whose trend is not judged where it is large.
    reversals : tuple of (int or float, int or float)
        Neighbouring settings between which the value goes against the direction.
    outliers : tuple of Outlier
        Settings off the trend.
    outliers_judged : bool
        False where there are too few settings to tell, or the values go to and fro.
    points : tuple of TrendPoint
        The curve and its band.
    sentence : str
        For people.
    adjuster : str
        Along which the settings stand.
    held : str
        Where the other adjusters stand, for people; empty where there are none.
    """

    parameter: str
    scale: str | None
    degree: int | None
    scatter: float
    is_erratic: bool
    direction: str | None
    monotone: bool | None
    reversals: tuple[tuple[int | float, int | float], ...]
    outliers: tuple[Outlier, ...]
    outliers_judged: bool
    points: tuple[TrendPoint, ...]
    sentence: str
    adjuster: str = ADJUSTER
    held: str = ""


def find_trends(
    fits: Sequence[Fit], uncertainties: Mapping[Setting, Uncertainty]
) -> tuple[Trend, ...]:
    """Return the trend of every parameter that was fitted setting by setting.

    Each runs along one adjuster with the others held.

    Parameters
    ----------
    fits : sequence of Fit
        By rising setting.
    uncertainties : mapping of Setting to Uncertainty
        By setting; a value without an interval does not count.
    """
    own = {Status.FITTED, Status.AT_BOUND, Status.NOT_IDENTIFIABLE}
    quantities = fits[0].parameters.quantities if fits else ()
    followed = [
        one
        for one in quantities
        if one.is_logarithmic and any(fit.status[one.name] in own for fit in fits)
    ]
    return tuple(
        _trend(one, _points(one.name, fits, uncertainties, line), line)
        for line in lines_of(fit.setting for fit in fits)
        for one in followed
    )


def _points(
    name: str, fits: Sequence[Fit], known: Mapping[Setting, Uncertainty], line: SettingLine
) -> Points:
    rows, numbers = [], line.numbers
    for fit in sorted(fits, key=lambda fit: numbers.get(fit.setting, 0.0)):
        if fit.setting not in numbers:
            continue
        uncertainty = known.get(fit.setting)
        interval = None if uncertainty is None else uncertainty.intervals.get(name)
        value = getattr(fit.parameters, name)
        if fit.status[name] != Status.FITTED or interval is None or not value > 0.0:
            continue
        if math.isfinite(interval.error):
            rows.append((numbers[fit.setting], math.log(value), interval.error / value))
    settings, logs, errors = np.array(rows, dtype=np.float64).reshape(-1, 3).T
    ends = (settings[0], settings[-1]) if len(settings) else (0.0, 0.0)
    return Points(settings, logs, errors, *ends)


def _trend(quantity: Quantity, points: Points, line: SettingLine) -> Trend:
    if len(points) < LEAST_FOR_TREND:
        n = len(points)
        count = f"{n} setting{'' if n == 1 else 's'} with a sound value"
        sentence = f"{quantity.symbol}: {count}, too few for a trend ({LEAST_FOR_TREND} are needed)"
        if not line.numbers:
            sentence = f"{quantity.symbol}: the settings are words, along which there is no trend"
        nan = math.nan
        if line.held:
            sentence = f"{sentence}, along {line.adjuster} with {line.held}"
        return Trend(
            *(quantity.name, None, None, nan, False, None, None, (), (), False, (), sentence),
            adjuster=line.adjuster,
            held=line.held,
        )
    families = None
    if quantity.trend_degree is not None:
        degree = quantity.trend_degree if len(points) >= _QUADRATIC_FROM else 1
        families = [("linear", min(degree, quantity.trend_degree))]
    choice = choose(points, families)
    curve = choice.curve
    outliers = tuple(_outlier(points, curve, place) for place in choice.outliers)
    inside = np.delete(np.arange(len(points)), choice.outliers)
    own = median(points.errors)
    is_erratic = curve.scatter > max(_ERRATIC * own, _REMARKABLE)
    is_wild = is_erratic and not quantity.is_open
    direction: str | None = _direction(curve, points.settings[inside])
    allowed = curve.scatter
    if not quantity.is_open:
        allowed = LEAST_SCATTER if is_wild else _usual_scatter(points, curve, inside)
        if direction == "mixed" or (is_wild and direction == "flat"):
            direction = _direction_of_values(points, curve, allowed)
    reversals = _reversals(points, curve, direction, allowed)
    has_direction = not quantity.is_open or curve.scatter <= _TOO_UNCERTAIN
    if direction == "flat" and math.hypot(curve.scatter, own) > _TOO_UNCERTAIN:
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
        outliers=outliers,
        outliers_judged=len(points) >= LEAST_FOR_OUTLIERS and not is_mixed_up,
        points=_curve_points(points, curve),
        sentence="",
        adjuster=line.adjuster,
        held=line.held,
    )
    return replace(trend, sentence=_sentence(trend, quantity, own, len(points)))


def _outlier(points: Points, curve: Curve, place: int) -> Outlier:
    at = points.settings[place]
    value = math.exp(points.logs[place])
    expected = float(_exp(curve.logs(np.array([at])))[0])
    return Outlier(_clicks(at), value, expected, value / expected - 1.0)


def _direction(curve: Curve, settings: FloatArray) -> str:
    """Which way the curve goes, by those of its steps that are beyond their errors."""
    if curve.degree == 0:
        return "flat"
    logs, slopes = curve.logs(settings), curve.slopes(settings)
    rows = np.vstack([np.diff(slopes, axis=0), slopes[-1] - slopes[0]])
    steps = np.append(np.diff(logs), logs[-1] - logs[0])
    errors = np.sqrt(np.einsum("ij,jk,ik->i", rows, curve.covariance, rows))
    sure = np.abs(steps) > _quantile(curve, len(steps)) * errors
    rises, falls = bool(np.any(steps[sure] > 0.0)), bool(np.any(steps[sure] < 0.0))
    if rises and falls:
        return "mixed"
    return "rising" if rises else "falling" if falls else "flat"


def _direction_of_values(points: Points, curve: Curve, scatter: float) -> str:
    """Which way the values themselves go: a curve may turn about a kink where no value does."""
    first, second = np.triu_indices(len(points), 1)
    variances = points.errors**2 + scatter**2
    steps = points.logs[second] - points.logs[first]
    reach = _quantile(curve, len(steps)) * np.sqrt(variances[first] + variances[second])
    rises, falls = bool(np.any(steps > reach)), bool(np.any(steps < -reach))
    return "mixed" if rises and falls else "rising" if rises else "falling" if falls else "flat"


def _usual_scatter(points: Points, curve: Curve, inside: NDArray[np.intp]) -> float:
    """Return the scatter of most settings: a few that were swapped must not excuse themselves."""
    if len(inside) < _USUAL_FROM:
        return curve.scatter
    kept = points.logs[inside] - curve.logs(points.settings[inside])
    middle = median(np.abs(kept)) / _MEDIAN_OF_NORMAL
    middle *= math.sqrt(len(inside) / curve.freedom)
    square = middle**2 - median(points.errors[inside]) ** 2
    return min(curve.scatter, math.sqrt(max(square, LEAST_SCATTER**2)))


def _clicks(number: float) -> int | float:
    return int(number) if float(number).is_integer() else float(number)


def _reversals(
    points: Points, curve: Curve, direction: str | None, allowed: float
) -> tuple[tuple[int | float, int | float], ...]:
    """Neighbours between which the value goes back by more than errors and scatter allow."""
    sign = {"rising": 1.0, "falling": -1.0}.get(direction or "")
    if sign is None:
        return ()
    variances = points.errors**2 + allowed**2
    spread = np.sqrt(variances[1:] + variances[:-1])
    steps = sign * np.diff(points.logs)
    back = np.flatnonzero(steps < -_quantile(curve, len(steps)) * spread)
    return tuple((_clicks(points.settings[k]), _clicks(points.settings[k + 1])) for k in back)


def _quantile(curve: Curve, n: int) -> float:
    """Student's t that none of n steps exceeds by chance in 95 of 100 cases."""
    return student_quantile(max(curve.freedom, 1), 1.0 - 0.5 * _95_PERCENT / n)


def _curve_points(points: Points, curve: Curve) -> tuple[TrendPoint, ...]:
    found = {_clicks(s): math.exp(y) for s, y in zip(points.settings, points.logs, strict=True)}
    settings = points.settings
    if np.ptp(settings) <= _WIDEST_RANGE:
        between = np.arange(settings[0], settings[-1] + 0.5)
        settings = np.array(sorted({*between.tolist(), *settings.tolist()}))
    logs = curve.logs(settings)
    reach = _quantile(curve, 1) * curve.errors(settings)
    value, low, high = _exp(logs), _exp(logs - reach), _exp(logs + reach)
    return tuple(
        TrendPoint(_clicks(s), float(y), float(a), float(b), found.get(_clicks(s)))
        for s, y, a, b in zip(settings, value, low, high, strict=True)
    )


def _exp(logs: FloatArray) -> FloatArray:
    with np.errstate(over="ignore"):
        return np.asarray(np.exp(logs))


def _sentence(trend: Trend, quantity: Quantity, own: float, n: int) -> str:
    """Direction and range, scatter, outliers, reversals."""
    assert trend.degree is not None
    first, last = trend.points[0], trend.points[-1]
    by = "the setting" if trend.adjuster == ADJUSTER else trend.adjuster
    words = {
        "rising": f"rises with {by}",
        "falling": f"falls with {by}",
        "flat": f"does not change with {by} by more than its errors",
        "mixed": "turns: it neither rises nor falls throughout",
        None: "shows no trend beyond its errors and scatter",
    }[trend.direction]
    if trend.direction == "flat" and trend.degree == 0:
        words = f"does not change with {by}"
    on = {
        "linear": "",
        "log": " in its logarithm",
        "reciprocal": " in its reciprocal",
        "from_first": " of logarithms, counted from the first setting",
        "from_last": " of logarithms, counted from the last setting",
    }
    kind = f"{_DEGREES[trend.degree]}{on[trend.scale or 'linear'] if trend.degree else ''}"
    unit = f" {quantity.unit}" if quantity.unit else ""
    said = (
        f"{quantity.symbol} {words}, {engineering(first.value)}{unit} at {trend.adjuster} "
        f"{first.setting}, {engineering(last.value)}{unit} at {last.setting} ({kind})"
    )
    if trend.held:
        said += f" with {trend.held}"
    scatter = f"{100.0 * trend.scatter:.2g} %"
    if trend.is_erratic:
        said += (
            f"; it is erratic: it scatters by {scatter} from {trend.adjuster} to {trend.adjuster}, "
            f"{trend.scatter / own:.0f} times its own error"
        )
    else:
        said += f", within {scatter}"
    for one in trend.outliers:
        said += (
            f"; {trend.adjuster} {one.setting} is off the trend by {100.0 * one.deviation:+.1f} %"
        )
    if trend.reversals:
        pairs = [f"{a} to {b}" for a, b in trend.reversals]
        more = f" and {len(pairs) - _MOST_PAIRS} more" if len(pairs) > _MOST_PAIRS else ""
        said += f"; against the trend from {trend.adjuster} {', '.join(pairs[:_MOST_PAIRS])}{more}"
    if n < LEAST_FOR_OUTLIERS:
        said += f"; too few settings to find one off the trend ({LEAST_FOR_OUTLIERS} are needed)"
    elif not trend.outliers_judged:
        said += "; no curve that a setting could be off: are settings mixed up?"
    return said
