"""Trends over the settings: the paper's outlier is found, and nothing that is none."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from damperfit.adjustment.trends import (
    LEAST_SCATTER,
    Points,
    _worst,
    choose,
    find_trends,
    fit_curve,
    least_squares,
    scatter_of,
)
from damperfit.identification import Status
from tests.adjustment import made_up_trends
from tests.adjustment.made_up_trends import CLICKS, SMOOTH, SUBSETS, reference_trends, trend_of

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


def test_k_e_is_erratic_about_the_quadratic_of_the_paper() -> None:
    trend = reference_trends(ALL, seed=0)["k_e"]
    assert (trend.scale, trend.degree) == ("linear", 2)
    assert trend.is_erratic
    assert 0.07 < trend.scatter < 0.13
    assert "it is erratic" in trend.sentence
    assert not reference_trends(ALL, seed=0)["r_m1"].is_erratic


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
    pairs = [
        made_up_trends._fitted(s, {"k_e": value}, {"k_e": error}) for s, value in values.items()
    ]
    (trend,) = (
        one
        for one in find_trends([fit for fit, _ in pairs], {u.setting: u for _, u in pairs})
        if one.parameter == "k_e"
    )
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


def test_a_low_outlier_breaks_the_monotone_run() -> None:
    values = EXPONENTIAL.copy()
    values[9] *= 0.7
    trend = trend_of(values, ALL)
    assert off(trend) == [10]
    assert trend.direction == "rising"
    assert trend.monotone is False
    assert trend.reversals == ((9, 10),)
    assert "against the trend from setting 9 to 10" in trend.sentence


def test_settings_that_get_softer_fall() -> None:
    trend = trend_of(EXPONENTIAL[::-1], ALL)
    assert (trend.direction, trend.monotone) == ("falling", True)


def test_a_hill_is_not_monotone() -> None:
    trend = trend_of(1e4 * (2.0 - ((CLICKS - 9.5) / 12.0) ** 2), ALL)
    assert (trend.direction, trend.monotone) == ("mixed", False)
    assert "turns" in trend.sentence


def test_a_constant_is_flat_and_monotone() -> None:
    # Beyond a scatter of 2 % its values go to and fro: tests/adjustment/test_order.py.
    trends = [trend_of(SMOOTH["constant"], ALL, scatter=0.01, seed=seed) for seed in range(10)]
    # One in twenty is taken for a slope: the price of choosing among five scales.
    assert sum((t.direction, t.monotone) == ("flat", True) for t in trends) >= 9
    assert trend_of(SMOOTH["constant"], ALL).degree == 0


def test_a_parameter_without_a_sound_value_is_left_out() -> None:
    pairs = [made_up_trends._fitted(s, {"r_m1": EXPONENTIAL[s - 1]}, {"r_m1": 1e-3}) for s in ALL]
    fits = [fit for fit, _ in pairs]
    fits[4] = replace(fits[4], status={**fits[4].status, "r_m1": Status.AT_BOUND})
    (trend, *_) = find_trends(fits, {u.setting: u for _, u in pairs})
    points = {point.setting: point for point in trend.points}
    assert points[5].found is None
    assert points[5].value == pytest.approx(EXPONENTIAL[4], rel=5e-3)


def test_gaps_are_bridged_and_huge_labels_are_not() -> None:
    trend = trend_of(EXPONENTIAL[[0, 1, 2, 8, 9]], (1, 2, 3, 9, 10))
    assert [point.setting for point in trend.points] == list(range(1, 11))
    assert trend.points[4].value == pytest.approx(EXPONENTIAL[4], rel=0.02)
    far = trend_of(EXPONENTIAL[[0, 1, 2, 8, 9]], (1, 2, 3, 9, 10**6))
    assert len(far.points) == 5


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e12])
def test_the_unit_does_not_matter(scale) -> None:
    values = SMOOTH["quadratic"].copy()
    values[-1] *= 1.2
    trend = trend_of(scale * values, ALL)
    assert off(trend) == [20]
    assert trend.points[3].value == pytest.approx(scale * values[3], rel=5e-3)


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


def test_settings_that_are_words_are_said_to_be_words() -> None:
    settings = ("soft", "middle", "firm", "hard", "race")
    trend = trend_of(np.full(5, 1e4), settings, error=1e-3)
    assert trend.sentence.endswith(": the settings are words, along which there is no trend")
    assert trend.monotone is None


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
