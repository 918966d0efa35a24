"""Settings in the wrong order: neither the trend nor the outliers may be passed."""

from __future__ import annotations

import numpy as np
import pytest

from damperfit.adjustment.clicks import Adjustment
from damperfit.adjustment.trends import find_trends
from damperfit.checks import Subject, run_checks
from damperfit.uncertainty import Assessment
from tests import fakes
from tests.adjustment import made_up_trends
from tests.adjustment.made_up_trends import CLICKS, SMOOTH, SUBSETS, reference_trends, trend_of

ALL = SUBSETS["all 20"]
EIGHT = SUBSETS["8 spread"]
GENTLE = 1e4 * np.exp(0.015 * CLICKS)  # 1.5 % a click


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


@pytest.mark.parametrize("settings", [ALL, EIGHT])
def test_neighbours_swapped_twice_are_not_passed(settings) -> None:
    order = list(settings)
    for place in (1, 5):
        order[place : place + 2] = order[place + 1], order[place]
    assert_not_passed(settings, order, 0)


def test_the_right_order_is_passed_without_setting_20() -> None:
    trends = reference_trends(ALL[:-1], seed=1)
    assert verdicts(trends) == (True, True)
    assert [one.direction for one in trends.values()] == ["rising"] * 3


@pytest.mark.parametrize(("swing", "is_passed"), [(0.015, True), (0.04, False)])
def test_a_sawtooth_is_not_passed(swing, is_passed) -> None:
    """Steps of 5 %: a swing of 1.5 % to both sides turns none of them, one of 4 % every other."""
    values = 1e4 * np.exp(0.05 * CLICKS + swing * (-1.0) ** CLICKS)
    trend = trend_of(values, ALL, error=3e-4)
    assert verdicts({"r_m1": trend}) == ((True, True) if is_passed else (False, None))
    assert ("are settings mixed up?" in trend.sentence) is not is_passed
    assert len(trend.reversals) == (0 if is_passed else 10)
    if not is_passed:
        assert "from setting 1 to 2, 3 to 4, 5 to 6, 7 to 8, 9 to 10 and 5 more" in trend.sentence


@pytest.mark.parametrize("pairs", [(4,), (4, 12), (2, 8, 14)])
def test_swapped_neighbours_do_not_excuse_themselves_by_their_scatter(pairs) -> None:
    """Steps of 1.5 %: what is swapped scatters by less than 2 %, and most settings do not."""
    values = GENTLE.copy()
    for place in pairs:
        values[place : place + 2] = values[place + 1], values[place]
    trend = trend_of(values, ALL, error=3e-4, seed=2)
    assert not trend.is_erratic
    assert trend.reversals == tuple((place + 1, place + 2) for place in pairs)
    assert trend.monotone is False
    assert trend_of(GENTLE, ALL, error=3e-4, seed=2).monotone is True


def test_scatter_of_all_settings_excuses_a_step_back() -> None:
    for seed in range(6):
        trend = trend_of(GENTLE, ALL, error=3e-4, scatter=0.01, seed=seed)
        assert (trend.direction, trend.monotone) == ("rising", True)


@pytest.mark.parametrize("shape", ["flat, then steep", "port nearly shut"])
@pytest.mark.parametrize("subset", ["all 20", "every other"])
def test_a_curve_that_turns_about_a_kink_is_no_turn(shape, subset) -> None:
    """Both leave the curves that so many settings allow, by up to 20 %, and rise throughout."""
    settings = SUBSETS[subset]
    trend = trend_of(SMOOTH[shape][[s - 1 for s in settings]], settings)
    assert (trend.direction, trend.monotone, trend.outliers_judged) == ("rising", True, True)


def test_a_constant_that_scatters_far_beyond_its_error_goes_to_and_fro() -> None:
    trend = trend_of(SMOOTH["constant"], ALL, error=1e-3, scatter=0.06)
    assert (trend.direction, trend.monotone, trend.outliers_judged) == ("mixed", False, False)


def test_only_k_e_may_be_erratic() -> None:
    values = 5e8 * np.exp(0.05 * CLICKS + 0.1 * (-1.0) ** CLICKS)
    k_e = trend_of(values, ALL, name="k_e", error=5e-3)
    r_m2 = trend_of(values, ALL, name="r_m2", error=5e-3)
    assert k_e.is_erratic
    assert r_m2.is_erratic
    assert (k_e.direction, k_e.monotone, k_e.outliers_judged) == ("rising", True, True)
    assert (r_m2.direction, r_m2.monotone, r_m2.outliers_judged) == ("rising", False, False)


@pytest.mark.parametrize(("swing", "is_reported"), [(0.175, True), (0.185, False)])
def test_k_e_that_scatters_by_more_than_a_fifth_has_no_trend_to_judge(
    swing, *, is_reported
) -> None:
    """Twelve settings, three coefficients: a swing of 0.18 is a scatter of 0.2."""
    rising = 5e8 * np.exp(0.2 * CLICKS[:12] + swing * (-1.0) ** CLICKS[:12])
    trend = trend_of(rising, ALL[:12], name="k_e", error=5e-3)
    assert 0.19 < trend.scatter < 0.24
    assert (trend.scatter < 0.2) is is_reported
    assert trend.direction == "rising"
    assert trend.monotone is (True if is_reported else None)


@pytest.mark.parametrize(("error", "is_reported"), [(0.19, True), (0.21, False)])
def test_a_value_with_an_error_of_a_fifth_is_not_said_to_stay(error, *, is_reported) -> None:
    pairs = [made_up_trends._fitted(one, {"k_e": 5e8}, {"k_e": error}) for one in range(1, 9)]
    found = find_trends([fit for fit, _ in pairs], {known.setting: known for _, known in pairs})
    (trend,) = (one for one in found if one.parameter == "k_e")
    assert trend.direction == ("flat" if is_reported else None)
    assert trend.monotone is (True if is_reported else None)
    assert ("does not change" in trend.sentence) is is_reported


def test_values_that_scatter_sixfold_are_not_said_to_stay() -> None:
    """As eight clicks of one measured damper: from 3.4e6 to 40e6, up and down."""
    values = [3.4e6, 18e6, 5.5e6, 33e6, 8e6, 12e6, 6e6, 40e6]
    settings = (212, 228, 244, 260, 276, 292, 308, 324)
    trend = trend_of(values, settings, name="k_e", error=0.01)
    assert (trend.direction, trend.monotone) == (None, None)
    assert trend.sentence.startswith("K_e shows no trend beyond its errors and scatter, ")
    assert verdicts({"k_e": trend})[0] is None
    also = {"r_m1": trend_of(GENTLE, ALL, error=3e-4), "k_e": trend}
    assert verdicts(also)[0] is True
    as_r_m1 = trend_of(values, settings, error=0.01)
    assert verdicts({"r_m1": as_r_m1}) == (False, None)
