"""Made-up dampers over their settings for the tests: fits with known values and errors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from damperfit.adjustment.trends import Trend, find_trends
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.identification import Fit
from damperfit.uncertainty import Interval, Uncertainty
from tests import fakes

OWN = ("r_m1", "r_m2", "k_e")
ERRORS = {"r_m1": 3e-4, "r_m2": 1e-3, "k_e": 5e-3}  # of ln y, as those of the sample runs or worse
PLAIN = fakes.fit(1)
CLICKS = np.arange(20.0)  # k = setting - 1

# Ways a parameter may go over twenty settings, none with an outlier.
SMOOTH: dict[str, np.ndarray] = {
    "quadratic": 1.4e4 + 700.0 * CLICKS + 45.0 * CLICKS**2,
    "exponential": 2e6 * np.exp(0.1 * CLICKS),
    "port": 3e5 / (22.0 - CLICKS),
    "port nearly shut": 3e5 / (20.5 - CLICKS),
    "logistic": 1e4 * (1.0 + 4.0 / (1.0 + np.exp(-(CLICKS - 10.0) / 2.5))),
    "root": 1e4 * np.sqrt(1.0 + CLICKS),
    "saturating": 1e4 * (4.0 - 3.0 * np.exp(-CLICKS / 5.0)),
    "flat, then steep": 1e4 * np.exp(np.maximum(0.0, CLICKS - 8.0) * 0.08),
    "faster than exponential": 1e4 * np.exp(0.02 * np.exp(0.2 * CLICKS)),
    "cubic": 1e4 * (1.0 + (CLICKS / 10.0) ** 3),
    "constant": np.full(20, 5e6),
    "line": 1e4 * (1.0 + 0.1 * CLICKS),
    "power": 1e4 * (1.0 + CLICKS) ** 1.5,
}
SUBSETS: dict[str, tuple[int, ...]] = {
    "all 20": tuple(range(1, 21)),
    "every other": tuple(range(2, 21, 2)),
    "8 spread": (1, 3, 6, 9, 12, 15, 18, 20),
    "8 highest": tuple(range(13, 21)),
    "10 with gaps": (1, 2, 3, 4, 9, 10, 11, 18, 19, 20),
    "5 spread": (1, 5, 10, 15, 20),
}


def trend_of(
    values: Sequence[float] | np.ndarray,
    settings: Sequence[int],
    *,
    name: str = "r_m1",
    error: float = 1e-3,
    scatter: float = 0.0,
    seed: int = 0,
) -> Trend:
    """Return the trend of one parameter whose values have an error and a scatter."""
    random = np.random.default_rng(seed)
    spread = np.hypot(error, scatter)
    found = np.asarray(values) * np.exp(spread * random.standard_normal(len(settings)))
    fits, known = zip(
        *(
            _fitted(setting, {name: float(value)}, {name: error})
            for setting, value in zip(settings, found, strict=True)
        ),
        strict=True,
    )
    trends = {one.parameter: one for one in find_trends(fits, {u.setting: u for u in known})}
    return trends[name]


def reference_trends(
    settings: Sequence[int], *, seed: int, order: Sequence[int] | None = None
) -> dict[str, Trend]:
    """Return the trends of the reference set with the errors of a log.

    With `order` the damper stood at those settings when the logs say `settings`.
    """
    random = np.random.default_rng(seed)
    fits, known = [], {}
    for setting, stood_at in zip(settings, order or settings, strict=True):
        truth = reference_parameters(stood_at)
        values = {
            name: getattr(truth, name) * float(np.exp(ERRORS[name] * random.standard_normal()))
            for name in OWN
        }
        fit, known[setting] = _fitted(setting, values, ERRORS)
        fits.append(fit)
    return {one.parameter: one for one in find_trends(fits, known)}


def _fitted(
    setting: int, values: Mapping[str, float], errors: Mapping[str, float]
) -> tuple[Fit, Uncertainty]:
    plain = replace(PLAIN, setting=setting)
    parameters = replace(plain.parameters, **values)
    names = tuple(errors)
    intervals = {
        name: Interval(
            errors[name] * getattr(parameters, name),
            getattr(parameters, name) * (1.0 - 2.0 * errors[name]),
            getattr(parameters, name) * (1.0 + 2.0 * errors[name]),
            1.0,
        )
        for name in names
    }
    covariance = np.diag([errors[name] ** 2 for name in names])
    return replace(plain, parameters=parameters), Uncertainty(setting, intervals, names, covariance)
