"""Limits of trends, outliers and wanted forces: a case just inside and one just outside."""

from __future__ import annotations

import numpy as np
import pytest

from damperfit.adjustment.force_at import fastest_sine
from damperfit.adjustment.trends import (
    LEAST_SCATTER,
    Points,
    _worst,
    choose,
    fit_curve,
    scatter_of,
)
from tests.adjustment import made_up_trends

TWENTY = np.arange(1.0, 21.0)


def points(logs, errors=1e-3, settings=None) -> Points:
    settings = np.arange(1.0, len(logs) + 1.0) if settings is None else np.array(settings, float)
    spread = np.full(len(settings), errors)
    return Points(settings, np.asarray(logs, float), spread, settings[0], settings[-1])


@pytest.mark.parametrize(("n", "degree"), [(3, None), (4, 1), (5, 1), (6, 2)])
def test_a_trend_takes_four_settings_and_a_quadratic_six(n, degree) -> None:
    # K_e has the paper's quadratic where it leaves three degrees of freedom.
    settings = tuple(range(1, n + 1))
    trend = made_up_trends.trend_of(5e8 + 1e7 * np.arange(n) ** 2, settings, name="k_e", seed=3)
    assert trend.degree == degree
    assert ("too few for a trend (4 are needed)" in trend.sentence) is (degree is None)


def test_settings_that_are_words_are_said_to_be_words() -> None:
    settings = ("soft", "middle", "firm", "hard", "race")
    trend = made_up_trends.trend_of(np.full(5, 1e4), settings, error=1e-3)
    assert trend.sentence.endswith(": the settings are words, along which there is no trend")
    assert trend.monotone is None


@pytest.mark.parametrize(("n", "is_judged"), [(4, False), (5, True)])
def test_an_outlier_takes_five_settings(n, is_judged) -> None:
    settings = tuple(range(1, n + 1))
    trend = made_up_trends.trend_of(np.full(n, 1e4), settings, error=1e-3)
    assert trend.outliers_judged is is_judged
    assert ("too few settings to find one off the trend (5 are needed)" in trend.sentence) is (
        not is_judged
    )


@pytest.mark.parametrize("n", [1, 2])
def test_the_worst_are_those_without_which_least_squares_are_least(n) -> None:
    """Against trying every choice."""
    from itertools import combinations

    rng = np.random.default_rng(7)
    for _ in range(20):
        some = points(0.1 * rng.standard_normal(9), settings=np.sort(rng.choice(20, 9, False)))
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


@pytest.mark.parametrize(("speed", "is_near"), [(0.286, True), (0.284, False)])
def test_motions_within_five_per_cent_of_the_fastest_are_as_fast(speed, is_near) -> None:
    motions = [(0.032, 1.5, 0.3), (0.016, 3.0, speed), (0.016, 3.0, speed)]
    assert (fastest_sine(motions).amplitude == 0.016) is is_near


@pytest.mark.parametrize(("stroke", "expected"), [(0.02098, 0.02049), (0.02102, 0.02)])
def test_strokes_within_five_per_cent_are_one(stroke, expected) -> None:
    motions = [(0.02, 2.4, 0.3), (stroke, 2.4, 0.3)]
    assert fastest_sine(motions).amplitude == pytest.approx(expected)


def test_of_tests_at_one_speed_and_several_strokes_one_that_was_run_stands_for_all() -> None:
    """5.5 mm at 10 Hz beside 9 mm at 6 Hz were told as "the test's sine of 7.25 mm at 8 Hz"."""
    run = [(0.0055, 10.0, 0.3456), (0.009, 6.0, 0.3393), (0.015, 3.0, 0.2827)]
    found = fastest_sine(run)
    assert (found.amplitude, found.frequency) == (0.0055, 10.0)


@pytest.mark.parametrize(("off", "is_sine"), [(1.095, True), (1.105, False), (0.905, True)])
def test_a_motion_is_a_sine_within_a_tenth_of_its_frequency(off, is_sine) -> None:
    frequency = 0.3 / (2.0 * np.pi * 0.032)
    found = fastest_sine([(0.032, off * frequency, 0.3)])
    assert found.frequency == pytest.approx(off * frequency if is_sine else frequency)
