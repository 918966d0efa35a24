"""How often a setting is called off the trend that is not, and how often one that is, is found.

    python -m tests.adjustment.false_alarms --draws 100

Every shape of `SMOOTH`, also turned round, over every subset of settings, with an error of 0.1 %
and a scatter of 0 to 10 %; then the reference set with its setting 20. The made-up trends serve the
tests too.
"""

import argparse
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from damperfit.adjustment.trends import Trend, find_trends
from damperfit.damper.purdy.parameters import reference_parameters
from damperfit.identification import Fit
from damperfit.uncertainty import Interval, Uncertainty
from tests import fakes

SCATTERS = (0.0, 0.005, 0.02, 0.1)
ORDERLY = (0.0, 0.005, 0.01)  # well below the 2 % beyond which values count as mixed up


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
    error: float | np.ndarray = 1e-3,
    scatter: float = 0.0,
    seed: int = 0,
) -> Trend:
    """Return the trend of one parameter whose values have an error, or one each, and a scatter."""
    random = np.random.default_rng(seed)
    spread = np.hypot(error, scatter)
    found = np.asarray(values) * np.exp(spread * random.standard_normal(len(settings)))
    errors = np.broadcast_to(error, found.shape)
    return trends_of(
        [
            fitted(setting, {name: float(value)}, {name: float(own)})
            for setting, value, own in zip(settings, found, errors, strict=True)
        ]
    )[name]


def trends_of(pairs: Sequence[tuple[Fit, Uncertainty]]) -> dict[str, Trend]:
    """Return the trends of fits and what is known of them, by parameter."""
    known = {one.setting: one for _, one in pairs}
    return {one.parameter: one for one in find_trends([fit for fit, _ in pairs], known)}


def reference_trends(
    settings: Sequence[int], *, seed: int, order: Sequence[int] | None = None
) -> dict[str, Trend]:
    """Return the trends of the reference set with the errors of a log.

    With `order` the damper stood at those settings when the logs say `settings`.
    """
    random = np.random.default_rng(seed)
    pairs = []
    for setting, stood_at in zip(settings, order or settings, strict=True):
        truth = reference_parameters(stood_at)
        values = {
            name: getattr(truth, name) * float(np.exp(ERRORS[name] * random.standard_normal()))
            for name in OWN
        }
        pairs.append(fitted(setting, values, ERRORS))
    return trends_of(pairs)


def fitted(
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
        )
        for name in names
    }
    covariance = np.diag([errors[name] ** 2 for name in names])
    return replace(plain, parameters=parameters), Uncertainty(setting, intervals, names, covariance)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--draws", type=int, default=20)
    draws = parser.parse_args().draws
    alarms, shapes = Counter(), Counter()
    cells = [(subset, scatter) for subset in SUBSETS for scatter in SCATTERS]
    for subset, scatter in cells:
        places = [setting - 1 for setting in SUBSETS[subset]]
        for shape, values in SMOOTH.items():
            for seed in range(draws):
                found = trend_of(
                    (values if seed % 2 else values[::-1])[places],
                    SUBSETS[subset],
                    scatter=scatter,
                    seed=seed,
                )
                alarms[subset, scatter] += bool(found.outliers)
                shapes[shape] += bool(found.outliers)
    n = draws * len(SMOOTH)
    print("False alarms, per cent of parameters, by subset and scatter")
    for subset in SUBSETS:
        row = (f"{100.0 * alarms[subset, scatter] / n:6.2f}" for scatter in SCATTERS)
        print(f"  {subset:14}", *row)
    for shape, count in shapes.items():
        print(f"  {shape:24} {100.0 * count / (draws * len(cells)):6.2f}")
    print(f"  all {100.0 * alarms.total() / (n * len(cells)):.2f}")
    print("Smooth shapes whose order is not passed, per cent, by subset, for scatter", *ORDERLY)
    for subset, settings in SUBSETS.items():
        places = [setting - 1 for setting in settings]
        row = []
        for scatter in ORDERLY:
            found = (
                trend_of(values[::sign][places], settings, scatter=scatter, seed=seed).monotone
                for values in SMOOTH.values()
                for seed in range(draws)
                for sign in (1, -1)
            )
            row.append(f"{100.0 * sum(one is not True for one in found) / (2 * n):6.2f}")
        print(f"  {subset:14}", *row)
    print("Setting 20 found, per cent, by parameter and subset, for scatter", *SCATTERS[:3])
    for name in ("r_m1", "r_m2"):
        for subset, settings in SUBSETS.items():
            values = [getattr(reference_parameters(setting), name) for setting in settings]
            row = []
            for scatter in SCATTERS[:3]:
                trends = (
                    trend_of(values, settings, name=name, scatter=scatter, seed=seed)
                    for seed in range(draws)
                )
                hits = sum([o.setting for o in trend.outliers] == [20] for trend in trends)
                row.append(f"{100.0 * hits / draws:6.0f}")
            print(f"  {name} {subset:14}", *row)


if __name__ == "__main__":
    main()
