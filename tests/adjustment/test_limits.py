"""Limits of trends, outliers and wanted forces: a case just inside and one just outside."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from damperfit.adjustment import trends
from damperfit.adjustment import trends as selection
from damperfit.adjustment.force_at import fastest_sine
from damperfit.adjustment.trends import (
    LEAST_SCATTER,
    Points,
    _Candidate,
    _is_jump,
    _is_off,
    _most_outliers,
    _third_difference,
    _usual_scatter,
    _worst,
    choose,
    find_trends,
    fit_curve,
    scatter_of,
)
from damperfit.adjustment.wanted import which_setting
from damperfit.statistics import student_quantile
from tests.adjustment import made_up_trends
from tests.adjustment.test_wanted import forces_by_click

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


@pytest.mark.parametrize(
    ("n", "degree", "most"),
    [(4, 0, 0), (5, 0, 1), (7, 1, 1), (8, 1, 2), (20, 1, 2), (5, 1, 1), (5, 2, 0), (20, 4, 2)],
)
def test_so_many_settings_may_be_left_out(n, degree, most) -> None:
    assert _most_outliers(n, degree) == most


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


def test_divided_differences_are_those_of_a_cubic() -> None:
    at = np.array([1.0, 2.0, 4.0, 7.0])
    assert _third_difference(at, 5.0 * at**3 - at**2 + 3.0) == pytest.approx(5.0)


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
            replace(curve, coefficients=curve.coefficients + sign * step).logs(TWENTY)
            for sign in (1.0, -1.0)
        )
        assert slopes[:, k] == pytest.approx((up - down) / 2e-6, abs=1e-7)
    variances = [row @ curve.covariance @ row for row in slopes]
    assert curve.errors(TWENTY) == pytest.approx(np.sqrt(variances))


def test_the_scatter_makes_the_mean_square_one() -> None:
    rng = np.random.default_rng(1)
    residuals, errors = 0.05 * rng.standard_normal(30), np.full(30, 0.02)
    tau = scatter_of(residuals, errors, 27)
    assert np.sum(residuals**2 / (errors**2 + tau**2)) == pytest.approx(27.0, rel=2e-3)
    assert scatter_of(1e-4 * residuals, errors, 27) == LEAST_SCATTER
    assert scatter_of(residuals, errors, 0) == LEAST_SCATTER


@pytest.mark.parametrize(("last", "n"), [(200, 200), (202, 5)])
def test_gaps_are_filled_over_two_hundred_clicks(last, n) -> None:
    settings = (1, 2, 3, 100, last)
    trend = made_up_trends.trend_of(np.array([1.0, 1.1, 1.2, 1.5, 1.9]), settings)
    found = [point.setting for point in trend.points]
    assert found == (list(range(1, last + 1)) if n == last else list(settings))


@pytest.mark.parametrize(("n", "is_usual"), [(7, False), (8, True)])
def test_the_scatter_of_most_settings_takes_eight_of_them(n, is_usual) -> None:
    logs = 0.02 * np.arange(n)
    logs[[1, 2]] = logs[[2, 1]]
    some = points(logs)
    curve = fit_curve(some, "log", 1)
    usual = _usual_scatter(some, curve, np.arange(n))
    assert curve.scatter > 0.008
    assert (usual < 0.7 * curve.scatter) is is_usual
    assert (usual == curve.scatter) is not is_usual


@pytest.mark.parametrize(("pairs", "words"), [(5, "13 to 14"), (6, "13 to 14 and 1 more")])
def test_five_reversals_are_named(pairs, words) -> None:
    values = 1e4 * np.exp(0.05 * STEPS)
    for place in range(0, 3 * pairs, 3):
        values[place : place + 2] = values[place + 1], values[place]
    trend = made_up_trends.trend_of(values, tuple(range(1, 21)), error=3e-4)
    assert len(trend.reversals) == pairs
    assert ("more" in trend.sentence) is (pairs > 5)
    assert words in trend.sentence


LINE = "straight line"
COUNTED = "straight line of logarithms, counted from the"
STEPS = np.arange(20.0)


@pytest.mark.parametrize(
    ("shape", "verb", "ends", "kind"),
    [
        (1.0 + 0.1 * STEPS, "rises", ("10.00e3", "29.00e3"), LINE),
        (np.exp(-0.1 * STEPS), "falls", ("10.00e3", "1.496e3"), f"{LINE} in its logarithm"),
        (1.0 / (1.0 + 0.1 * STEPS), "falls", ("10.00e3", "3.448e3"), f"{LINE} in its reciprocal"),
        ((1.0 + STEPS) ** 1.5, "rises", ("10.00e3", "894.4e3"), f"{COUNTED} first setting"),
        ((20.0 - STEPS) ** 1.5, "falls", ("894.4e3", "10.00e3"), f"{COUNTED} last setting"),
        (np.ones(20), "does not change", ("10.00e3", "10.00e3"), "constant"),
    ],
)  # fmt: skip
def test_the_sentence_names_direction_range_and_curve(shape, verb, ends, kind) -> None:
    pairs = [
        made_up_trends._fitted(s, {"r_m1": 1e4 * float(value)}, {"r_m1": 1e-3})
        for s, value in enumerate(shape, start=1)
    ]
    trends = find_trends([fit for fit, _ in pairs], {u.setting: u for _, u in pairs})
    (trend,) = (one for one in trends if one.parameter == "r_m1")
    unit = "s sqrt(N)/(m kg)"
    assert trend.sentence == (
        f"R_m1 {verb} with the setting, {ends[0]} {unit} at setting 1, {ends[1]} {unit} at 20 "
        f"({kind}), within 0.3 %"
    )


def test_only_at_an_end_may_a_setting_just_go_on_getting_steeper() -> None:
    smooth = points(0.01 * np.arange(8.0) ** 3, settings=range(1, 9))
    curve = fit_curve(smooth, "log", 3)

    def jumps(place):
        return _is_jump(smooth, _Candidate(0.0, curve, (place,)), place)

    assert [jumps(place) for place in range(8)] == [False, *[True] * 6, False]
    broken = replace(smooth, logs=smooth.logs + np.r_[np.zeros(7), 3.0])
    assert _is_jump(broken, _Candidate(0.0, curve, (7,)), 7)


def test_values_that_are_not_sound_are_passed_over_and_those_behind_them_count() -> None:
    pairs = [made_up_trends._fitted(s, {"r_m1": 1e4}, {"r_m1": 1e-3}) for s in range(1, 8)]
    fits = [fit for fit, _ in pairs]
    fits[0] = replace(fits[0], status={**fits[0].status, "r_m1": "at_bound"})
    known = {u.setting: u for _, u in pairs if u.setting != 3}
    (trend, *_) = find_trends(fits, known)
    found = {point.setting: point.found for point in trend.points}
    assert min(found) == 2
    assert max(found) == 7
    assert found[3] is None
    assert found[7] == pytest.approx(1e4)


def test_between_settings_apart_the_curve_itself_is_in_doubt() -> None:
    forces = [100.0, 200.0, 500.0]
    near = which_setting(forces_by_click(forces, error=1.0), 300.0).answers[0]
    wide = forces_by_click(forces, settings=[1, 11, 21], error=1.0)
    apart = which_setting(wide, 300.0).answers[0]
    assert (apart.below, apart.above, apart.force_below, apart.force_above) == (11, 21, 200, 500)
    assert near.high - near.low < 0.1
    assert (apart.high - apart.low) / 10.0 > 3.0 * (near.high - near.low)


def test_an_end_within_its_interval_gives_the_force() -> None:
    forces = forces_by_click([100.0, 200.0, 300.0], error=2.0)
    inside, outside = which_setting(forces, 303.8), which_setting(forces, 304.1)
    assert [one.position for one in inside.answers] == [3.0]
    assert outside.answers == ()
    assert inside.hardest == outside.hardest == (3, 300.0)
    assert inside.weakest == (1, 100.0)
    crossed = which_setting(forces, 299.5).answers
    assert [one.position for one in crossed] == pytest.approx([2.995], abs=0.01)


def test_of_curves_for_a_constant_with_scatter_one_in_twenty_is_none() -> None:
    """Choosing among five scales costs what it gains; without that price it is one in five."""
    rng = np.random.default_rng(11)
    settings = np.arange(1.0, 13.0)
    degrees = []
    for _ in range(30):
        found = choose(points(0.02 * rng.standard_normal(12), settings=settings))
        degrees.append(found.curve.degree)
    assert np.mean(np.array(degrees) > 0) < 0.2


@pytest.mark.parametrize(("gain", "degree"), [(6.0, 0), (6.5, 1)])
def test_a_slope_pays_for_its_number_and_for_the_choice_among_five_scales(gain, degree) -> None:
    """By hand: ln 20 + 2 ln 5 = 6.21 for 20 settings; the gain is what a slope takes off."""
    centred = TWENTY - TWENTY.mean()
    deviation = np.hypot(1e-2, LEAST_SCATTER)
    logs = centred * deviation * np.sqrt(gain / float(centred @ centred))
    assert choose(points(logs, errors=1e-2)).curve.degree == degree


@pytest.mark.parametrize(
    ("n", "freedom", "bound"), [(20, 18, 5.288), (20, 10, 6.757), (5, 2, 35.33)]
)
def test_a_setting_is_off_where_chance_has_it_once_in_a_thousand(
    monkeypatch, n, freedom, bound
) -> None:
    """Student's t of 0.001 over 20 settings and 0.004 over 5, on both sides, from tables."""
    one = _Candidate(0.0, SimpleNamespace(freedom=freedom), (3,))
    for distance, is_off in ((0.999 * bound, False), (1.001 * bound, True)):
        monkeypatch.setattr(selection, "_distance", lambda *_, d=distance: d)
        assert _is_off(points(np.zeros(n)), one, 3) is is_off


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
    assert (found.amplitude, found.frequency, found.was_run) == (0.0055, 10.0, True)


@pytest.mark.parametrize(("off", "is_sine"), [(1.095, True), (1.105, False), (0.905, True)])
def test_a_motion_is_a_sine_within_a_tenth_of_its_frequency(off, is_sine) -> None:
    frequency = 0.3 / (2.0 * np.pi * 0.032)
    found = fastest_sine([(0.032, off * frequency, 0.3)])
    assert found.frequency == pytest.approx(off * frequency if is_sine else frequency)
    assert found.was_run is is_sine


@pytest.mark.parametrize(("times", "is_jump"), [(7.8, False), (8.2, True), (-7.8, False)])
def test_a_jump_bends_eight_times_as_much_as_the_curve_beside_it(times, is_jump) -> None:
    # The third divided difference of a cubic is its leading number everywhere.
    smooth = points(0.01 * np.arange(8.0) ** 3, settings=range(1, 9))
    curve = fit_curve(smooth, "log", 3)
    bent = replace(smooth, logs=smooth.logs + np.r_[np.zeros(7), 0.06 * (times - 1.0)])
    assert _is_jump(bent, _Candidate(0.0, curve, (7,)), 7) is is_jump


@pytest.mark.parametrize(
    ("n", "highest"), [(4, 1), (6, 1), (7, 2), (9, 2), (10, 3), (13, 4), (16, 4)]
)
def test_a_degree_of_a_trend_takes_three_settings_more(monkeypatch, n, highest) -> None:
    tried = []

    def candidates(given, scale, degree):
        tried.append((scale, degree))
        yield _Candidate(0.0, fit_curve(given, "log", 0), ())

    monkeypatch.setattr(selection, "_candidates", candidates)
    choose(points(np.zeros(n)))
    for scale in ("linear", "log", "reciprocal"):
        assert max(degree for one, degree in tried if one == scale) == highest
    assert max(degree for one, degree in tried if one == "from_last") == min(highest, 2)
    assert len(tried) == len(set(tried))


def with_scatter(monkeypatch, scatter: float, error: float, name: str = "r_m1"):
    """The trend of eight equal values whose curve is said to leave this scatter."""

    def chosen(points, families=None):
        found = choose(points, families)
        return replace(found, curve=replace(found.curve, scatter=scatter))

    monkeypatch.setattr(trends, "choose", chosen)
    value = 5e8 if name == "k_e" else 1e4
    return made_up_trends.trend_of(np.full(8, value), tuple(range(1, 9)), name=name, error=error)


@pytest.mark.parametrize(
    ("scatter", "error", "is_erratic"),
    [(0.019, 1e-3, False), (0.021, 1e-3, True), (0.029, 0.01, False), (0.031, 0.01, True)],
)
def test_a_scatter_of_three_errors_and_two_per_cent_is_erratic(
    monkeypatch, scatter, error, is_erratic
) -> None:
    trend = with_scatter(monkeypatch, scatter, error)
    assert trend.is_erratic is is_erratic


@pytest.mark.parametrize(("scatter", "direction"), [(0.19, "flat"), (0.21, None)])
def test_no_direction_is_told_of_what_scatters_by_a_fifth(monkeypatch, scatter, direction) -> None:
    assert with_scatter(monkeypatch, scatter, 0.1 * scatter, name="k_e").direction == direction


@pytest.mark.parametrize(
    ("steps", "direction"),
    [
        ([0.98], "flat"),
        ([1.02], "rising"),
        ([-0.98], "flat"),
        ([-1.02], "falling"),
        ([1.02, -1.02], "mixed"),
        ([0.7, 0.7], "rising"),  # from the first to the last
        ([-0.7, -0.7], "falling"),
    ],
)
def test_values_rise_or_fall_by_what_chance_makes_once_in_twenty(steps, direction) -> None:
    logs = np.cumsum([0.0, *steps])
    n = len(logs)
    reach = student_quantile(10.0, 1.0 - 0.025 / (n * (n - 1) / 2)) * math.hypot(0.5, 0.5)
    points = Points(np.arange(1.0, n + 1), logs * reach, np.full(n, 0.4), 1.0, float(n))
    found = trends._direction_of_values(points, SimpleNamespace(freedom=10), scatter=0.3)
    assert found == direction


def test_a_curve_is_drawn_at_whole_clicks_and_at_the_settings_and_ends_with_the_last() -> None:
    curve = SimpleNamespace(logs=lambda at: 0.1 * at, errors=lambda at: 0.0 * at, freedom=3)
    tested = points([0.1, 0.2, 0.3, 0.4, 0.55], settings=[1, 2, 3, 4, 5.5])
    drawn = trends._curve_points(tested, curve)
    assert [one.setting for one in drawn] == [1, 2, 3, 4, 5, 5.5]
    assert [one.found is None for one in drawn] == [False] * 4 + [True, False]
