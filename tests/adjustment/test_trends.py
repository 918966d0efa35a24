"""Trends over the settings: the paper's outlier is found, and nothing that is none."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from damperfit.adjustment.clicks import Adjustment
from damperfit.adjustment.trends import (
    LEAST_SCATTER,
    Points,
    _worst,
    choose,
    fit_curve,
    least_squares,
    scatter_of,
)
from damperfit.checks import Subject, run_checks
from damperfit.identification import Status
from damperfit.uncertainty import Assessment
from tests import fakes
from tests.adjustment.false_alarms import (
    CLICKS,
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


@pytest.mark.parametrize("subset", SUBSETS)
def test_setting_20_is_found_in_subsets_of_the_settings(subset) -> None:
    trends = reference_trends(SUBSETS[subset], seed=3)
    assert off(trends["r_m2"]) == [20]
    # Five settings leave too little to tell a jump of 12 % in R_m1 from a bend.
    assert off(trends["r_m1"]) == ([] if subset == "5 spread" else [20])
    assert off(trends["k_e"]) == []


def test_without_it_nothing_is_off() -> None:
    assert [off(trend) for trend in reference_trends(ALL[:-1], seed=1).values()] == [[], [], []]


@pytest.mark.parametrize(
    ("error", "swing", "is_erratic"),
    [
        (0.01, 0.028, False),  # the scatter is three errors at 0.0293
        (0.01, 0.031, True),
        (0.001, 0.0175, False),  # and two per cent at 0.0185
        (0.001, 0.0195, True),
    ],
)
def test_a_parameter_is_erratic_from_three_errors_and_two_per_cent_on(error, swing, *, is_erratic):
    values = {s: 5e8 * float(np.exp(swing * (-1.0) ** s)) for s in ALL}
    pairs = [fitted(s, {"k_e": value}, {"k_e": error}) for s, value in values.items()]
    trend = trends_of(pairs)["k_e"]
    assert trend.is_erratic is is_erratic
    times = f"{trend.scatter / error:.0f} times its own error"
    assert (f"it is erratic: it scatters by {100 * trend.scatter:.2g} %" in trend.sentence) is (
        is_erratic
    )
    assert (times in trend.sentence) is is_erratic


@pytest.mark.one_in(2)
@pytest.mark.parametrize("shape", SMOOTH)
def test_smooth_shapes_have_no_outlier(shape) -> None:
    for seed, scatter in enumerate((0.0, 0.05)):
        up = trend_of(SMOOTH[shape], ALL, scatter=scatter, seed=seed)
        down = trend_of(SMOOTH[shape][::-1], ALL, scatter=scatter, seed=seed)
        assert off(up) == off(down) == []


@pytest.mark.one_in(5)
@pytest.mark.parametrize("places", [(0,), (9,), (19,), (5, 6), (9, 15), (18, 19), (0, 19)])
@pytest.mark.parametrize("shape", ["quadratic", "exponential", "port", "constant"])
def test_one_and_two_outliers_are_found_wherever_they_are(shape, places) -> None:
    values = SMOOTH[shape].copy()
    values[list(places)] *= 1.25
    found = trend_of(values, ALL, scatter=3e-3, seed=5)
    mirrored = trend_of(values[::-1], ALL, scatter=3e-3, seed=6)
    assert off(found) == [place + 1 for place in places]
    assert sorted(off(mirrored)) == sorted(20 - place for place in places)
    for one in found.outliers:
        assert one.deviation == pytest.approx(0.25, abs=0.05)


def test_settings_that_tell_nearly_nothing_bend_no_curve_and_end_no_fit() -> None:
    """Of two values known the line goes through both; that a bend is not known is no fault."""
    settings = np.arange(8.0)
    errors = np.where(settings % 7.0 == 0.0, 1e-3, 1e9)
    curve = fit_curve(Points(settings, 0.1 * settings, errors, (0.0, 7.0)), "log", 2)
    assert curve.logs(settings[[0, -1]]) == pytest.approx([0.0, 0.7], abs=1e-6)
    assert np.all(curve.errors_of(curve.slopes(settings[[0, -1]])) < 4e-3)
    assert curve.errors_of(curve.slopes(settings[3:4]))[0] > 1e6


def test_a_constant_is_flat_and_monotone() -> None:
    # Beyond a scatter of 2 % its values go to and fro.
    trends = [trend_of(SMOOTH["constant"], ALL, scatter=0.01, seed=seed) for seed in range(10)]
    # One in twenty is taken for a slope: the price of choosing among five scales.
    assert sum((t.direction, t.monotone) == ("flat", True) for t in trends) >= 9
    assert trend_of(SMOOTH["constant"], ALL).degree == 0


def test_a_parameter_without_a_sound_value_is_left_out() -> None:
    pairs = [fitted(s, {"r_m1": EXPONENTIAL[s - 1]}, {"r_m1": 1e-3}) for s in ALL]
    fit, known = pairs[4]
    pairs[4] = replace(fit, status={**fit.status, "r_m1": Status.AT_BOUND}), known
    (trend, *_) = trends_of(pairs).values()
    points = {point.setting: point for point in trend.points}
    assert points[5].found is None
    assert points[5].value == pytest.approx(EXPONENTIAL[4], rel=5e-3)


def test_gaps_are_bridged_and_huge_labels_are_not() -> None:
    trend = trend_of(EXPONENTIAL[[0, 1, 2, 8, 9]], (1, 2, 3, 9, 10))
    assert [point.setting for point in trend.points] == list(range(1, 11))
    assert trend.points[4].value == pytest.approx(EXPONENTIAL[4], rel=0.02)
    far = trend_of(EXPONENTIAL[[0, 1, 2, 8, 9]], (1, 2, 3, 9, 10**6))
    assert len(far.points) == 5


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


# Limits, a case just inside and one just outside, and the numerics of curves

TWENTY = np.arange(1.0, 21.0)


def points(logs, errors=1e-3, settings=TWENTY) -> Points:
    spread = np.full(len(settings), errors)
    return Points(settings, np.asarray(logs), spread, (settings[0], settings[-1]))


@pytest.mark.parametrize(("n", "degree"), [(3, None), (4, 1), (5, 1), (6, 2)])
def test_a_trend_takes_four_settings_an_outlier_five_and_a_quadratic_six(n, degree) -> None:
    # K_e has the paper's quadratic where it leaves three degrees of freedom.
    settings = tuple(range(1, n + 1))
    trend = trend_of(5e8 + 1e7 * np.arange(n) ** 2, settings, name="k_e", seed=3)
    assert trend.degree == degree
    assert ("too few for a trend (4 are needed)" in trend.sentence) is (degree is None)
    trend = trend_of(np.full(n, 1e4), settings)
    assert trend.outliers_judged is (n >= 5)
    assert ("one off the trend (5 are needed)" in trend.sentence) is (n == 4)


@pytest.mark.parametrize("n", [1, 2])
def test_the_worst_are_those_without_which_least_squares_are_least(n) -> None:
    """Against trying every choice."""
    rng = np.random.default_rng(7)
    for _ in range(20):
        settings = np.sort(rng.choice(20, 9, False)).astype(float)
        some = points(0.1 * rng.standard_normal(9), settings=settings)
        found = _worst(some, "log", 1, tau=0.01, n=n)
        rest = {}
        for left in combinations(range(9), n):
            kept = np.setdiff1d(np.arange(9), left)
            fit = np.polyfit(some.settings[kept], some.logs[kept], 1)
            rest[left] = np.sum((some.logs[kept] - np.polyval(fit, some.settings[kept])) ** 2)
        assert found == min(rest, key=rest.get)


@pytest.mark.parametrize("scale", ["linear", "log", "reciprocal", "from_first", "from_last"])
def test_a_curve_of_each_scale_is_found_again(scale) -> None:
    s = TWENTY
    argument = {
        "from_first": np.log(s),
        "from_last": np.log(21.0 - s),
    }.get(scale, s / 20.0)
    values = 2.0 + 0.7 * argument
    truth = {"linear": values, "reciprocal": 1.0 / values}.get(scale, np.exp(values))
    curve = fit_curve(points(np.log(1e8 * truth)), scale, 1)
    assert curve.logs(s) == pytest.approx(np.log(1e8 * truth), abs=1e-9)
    assert curve.scatter == LEAST_SCATTER
    assert (curve.degree, curve.freedom) == (1, 18)


@pytest.mark.parametrize("scale", ["linear", "log", "reciprocal", "from_first", "from_last"])
def test_slopes_of_a_curve_are_those_by_differences(scale) -> None:
    curve = fit_curve(points(0.1 * np.sqrt(TWENTY)), scale, 2)
    slopes = curve.slopes(TWENTY)
    for k in range(3):
        step = 1e-6 * np.eye(3)[k]
        up, down = (
            curve._replace(coefficients=curve.coefficients + sign * step).logs(TWENTY)
            for sign in (1.0, -1.0)
        )
        assert slopes[:, k] == pytest.approx((up - down) / 2e-6, abs=1e-7)
    variances = [row @ curve.covariance @ row for row in slopes]
    assert curve.errors_of(curve.slopes(TWENTY)) == pytest.approx(np.sqrt(variances))


def test_the_scatter_makes_the_mean_square_one() -> None:
    rng = np.random.default_rng(1)
    residuals, errors = 0.05 * rng.standard_normal(30), np.full(30, 0.02)
    tau = scatter_of(residuals, errors, 27)
    assert np.sum(residuals**2 / (errors**2 + tau**2)) == pytest.approx(27.0, rel=2e-3)
    assert scatter_of(1e-4 * residuals, errors, 27) == LEAST_SCATTER
    assert scatter_of(residuals, errors, 0) == LEAST_SCATTER


@pytest.mark.parametrize(("gain", "degree"), [(6.0, 0), (6.5, 1)])
def test_a_slope_pays_for_its_number_and_for_the_choice_among_five_scales(gain, degree) -> None:
    """By hand: ln 20 + 2 ln 5 = 6.21 for 20 settings; the gain is what a slope takes off."""
    centred = TWENTY - TWENTY.mean()
    deviation = np.hypot(1e-2, LEAST_SCATTER)
    logs = centred * deviation * np.sqrt(gain / float(centred @ centred))
    assert choose(points(logs, errors=1e-2))[0].degree == degree


# Settings in the wrong order: neither the trend nor the outliers may be passed.

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
    pairs = [fitted(one, {"k_e": 5e8}, {"k_e": error}) for one in range(1, 9)]
    trend = trends_of(pairs)["k_e"]
    assert trend.direction == ("flat" if is_reported else None)
    assert trend.monotone is (True if is_reported else None)
    assert ("does not change" in trend.sentence) is is_reported
