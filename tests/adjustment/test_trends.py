"""Trends over the settings: the paper's outlier, bands, mixed-up settings.

Courses of every shape, sound and with settings that are off, are in `test_numbers.py`.
"""

from dataclasses import replace

import numpy as np
import pytest

from damperfit.adjustment.clicks import Adjustment
from damperfit.adjustment.trends import Points, fit_curve, least_squares
from damperfit.checks import Subject, run_checks
from damperfit.identification import Status
from damperfit.uncertainty import Assessment
from tests import fakes
from tests.adjustment.false_alarms import (
    SMOOTH,
    SUBSETS,
    fitted,
    reference_trends,
    trend_of,
    trends_of,
)

ALL = SUBSETS["all 20"]
EXPONENTIAL = SMOOTH["exponential"]


def off(trend) -> list[int]:
    return [one.setting for one in trend.outliers]


@pytest.mark.parametrize("seed", range(6))
def test_setting_20_of_the_reference_set_is_off_and_no_other(seed) -> None:
    trends = reference_trends(ALL, seed=seed)
    assert off(trends["r_m1"]) == off(trends["r_m2"]) == [20]
    assert off(trends["k_e"]) == []
    assert trends["r_m1"].outliers[0].deviation == pytest.approx(0.125, abs=0.01)
    assert trends["r_m2"].outliers[0].deviation == pytest.approx(0.271, abs=0.01)
    assert "setting 20 is off the trend by +12." in trends["r_m1"].sentence
    for trend in trends.values():
        assert (trend.direction, trend.monotone) == ("rising", True)


def test_settings_that_tell_nearly_nothing_bend_no_curve_and_end_no_fit() -> None:
    """Of two values known the line goes through both; that a bend is not known is no fault."""
    settings = np.arange(8.0)
    errors = np.where(settings % 7.0 == 0.0, 1e-3, 1e9)
    curve = fit_curve(Points(settings, 0.1 * settings, errors, (0.0, 7.0)), "log", 2)
    assert curve.logs(settings[[0, -1]]) == pytest.approx([0.0, 0.7], abs=1e-6)
    assert np.all(curve.errors_of(curve.slopes(settings[[0, -1]])) < 4e-3)
    assert curve.errors_of(curve.slopes(settings[3:4]))[0] > 1e6


def test_a_parameter_without_a_sound_value_is_left_out() -> None:
    pairs = [fitted(s, {"r_m1": EXPONENTIAL[s - 1]}, {"r_m1": 1e-3}) for s in ALL]
    fit, known = pairs[4]
    pairs[4] = replace(fit, status={**fit.status, "r_m1": Status.AT_BOUND}), known
    (trend, *_) = trends_of(pairs).values()
    points = {point.setting: point for point in trend.points}
    assert points[5].found is None
    assert points[5].value == pytest.approx(EXPONENTIAL[4], rel=5e-3)


def test_the_band_covers_the_true_curve() -> None:
    truth = 5e8 + 1.2e7 * np.arange(20.0) + 8e5 * np.arange(20.0) ** 2
    inside = [
        [p.low <= y <= p.high for p, y in zip(trend.points, truth, strict=True)]
        for trend in (
            trend_of(truth, ALL, name="k_e", error=5e-3, scatter=0.1, seed=seed)
            for seed in range(100)
        )
    ]
    # 100 draws: two standard deviations of the mean are 4 %, as points of one band go together.
    assert 0.90 < np.mean(inside) < 0.99


def test_weights_far_apart_are_solved_for_as_well_as_near_ones() -> None:
    rng = np.random.default_rng(0)
    powers = np.vander(np.linspace(-1.0, 1.0, 20), 5, increasing=True)
    for spread in (1.0, 500.0, 2e3, 1e8):
        weights = np.geomspace(1.0, spread, 20)
        truth = rng.normal(size=5)
        found, covariance = least_squares(powers * weights[:, None], powers @ truth * weights)
        assert found == pytest.approx(truth, rel=1e-6, abs=1e-6)
        exact = np.linalg.inv(np.linalg.qr(powers * weights[:, None])[1])
        assert np.diag(covariance) == pytest.approx(np.diag(exact @ exact.T), rel=1e-6)


# Settings in the wrong order: neither the trend nor the outliers may be passed.

EIGHT = SUBSETS["8 spread"]


def verdicts(trends) -> tuple[bool | None, bool | None]:
    """Return what `trend_monotone` and `no_outlier_setting` say."""
    subject = Subject(
        fakes.campaign(fakes.fit(1)), Assessment(), Adjustment(trends=tuple(trends.values()))
    )
    found = {check.name: check.passed for check in run_checks(subject)}
    return found["trend_monotone"], found["no_outlier_setting"]


def swapped(settings, n, seed) -> tuple[int, ...]:
    """Exchange n pairs, none of them twice."""
    order = list(settings)
    places = np.random.default_rng(seed).permutation(len(order))[: 2 * n]
    for a, b in places.reshape(-1, 2):
        order[a], order[b] = order[b], order[a]
    return tuple(order)


def permuted(settings, seed) -> tuple[int, ...]:
    return tuple(int(s) for s in np.random.default_rng(seed).permutation(settings))


def assert_not_passed(settings, order, seed) -> None:
    monotone, outliers = verdicts(reference_trends(settings, seed=seed, order=order))
    assert monotone is False
    assert outliers is not True


@pytest.mark.parametrize("seeds", [3, pytest.param(200, marks=pytest.mark.slow)])
@pytest.mark.parametrize("settings", [ALL, EIGHT, SUBSETS["every other"]])
def test_permuted_settings_and_swapped_pairs_are_not_passed(settings, seeds) -> None:
    for seed in range(seeds):
        assert_not_passed(settings, permuted(settings, seed), seed)
        n = 1 + seed % 3
        assert_not_passed(settings, swapped(settings, n, seed), seed)
