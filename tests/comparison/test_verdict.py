"""Verdicts on two numbers, each limit with a case on both sides; what people read of them."""

import math

import numpy as np
import pytest
from scipy.stats import t as student

from damperfit.comparison import verdict_of
from damperfit.comparison.verdict import (
    Reading,
    Sameness,
    Topic,
    compared,
    difference_of,
    surely_different,
)
from damperfit.tested.setting import Setting

FORCE = Topic("force", "force", "force", "N", Setting.of(3), 0.26, "rebound")
VALUE = Topic("parameter", "r_m1", "R_m1", "", Setting.of(3), is_logarithmic=True)


def _reading(value, error=1.0, **more):
    return Reading(value, error, **({"scale": value} | more))


@pytest.mark.parametrize(("beyond", "verdict"), [(0.999, "same"), (1.001, "different")])
def test_a_difference_counts_beyond_the_interval_of_both_errors(beyond, verdict) -> None:
    reach = 1.959964 * math.hypot(3.0, 4.0)
    line = compared(FORCE, _reading(1000.0, 3.0), _reading(1000.0 + beyond * reach, 4.0))
    assert line.verdict is Sameness(verdict)
    assert line.high - line.low == pytest.approx(2.0 * reach, rel=1e-6)


@pytest.mark.parametrize(("share", "verdict"), [(0.99, "same"), (1.01, "untold")])
def test_same_is_said_only_where_a_difference_would_be_seen(share, verdict) -> None:
    error = share * 0.05 * 1000.0 / 1.959964
    line = compared(FORCE, _reading(1000.0, 0.0), _reading(1000.0, error))
    assert line.verdict is Sameness(verdict)
    assert ("would go unnoticed" in line.reason) == (verdict == "untold")


def test_few_cycles_widen_the_interval_by_student_and_welch() -> None:
    a, b = _reading(100.0, 2.0, freedom=4.0), _reading(100.0, 1.0, freedom=9.0)
    line = compared(FORCE, a, b)
    freedom = 25.0 / (16.0 / 4.0 + 1.0 / 9.0)
    assert line.high == pytest.approx(student.ppf(0.975, freedom) * math.sqrt(5.0))
    chance = compared(FORCE, a, _reading(104.0, 1.0, freedom=9.0)).chance
    assert chance == pytest.approx(2.0 * student.sf(4.0 / math.sqrt(5.0), freedom))


def test_what_tests_of_one_setting_differ_by_is_an_error_too() -> None:
    quiet = compared(FORCE, _reading(100.0), _reading(103.0))
    loud = compared(FORCE, _reading(100.0), _reading(103.0, repeat=2.0))
    assert quiet.verdict is Sameness.DIFFERENT
    assert loud.verdict is not Sameness.DIFFERENT


def test_per_cent_is_of_the_damping_and_harder_is_positive_in_bump_too() -> None:
    bump = Topic("force", "force", "force", "N", Setting.of(3), 0.26, "bump")
    line = compared(bump, _reading(-530.0, scale=-400.0), _reading(-570.0, scale=-440.0))
    assert line.difference == pytest.approx(-40.0)
    assert line.percent == pytest.approx(10.0)


def test_a_parameter_has_its_errors_on_the_logarithm() -> None:
    line = compared(VALUE, Reading(2.0, 0.02), Reading(2.4, 0.024))
    reach = 1.959964 * math.hypot(0.01, 0.01)
    assert line.percent == pytest.approx(20.0)
    assert line.percent_low == pytest.approx(100.0 * (1.2 * math.exp(-reach) - 1.0), rel=1e-5)
    assert line.percent_high == pytest.approx(100.0 * (1.2 * math.exp(reach) - 1.0), rel=1e-5)


def test_what_a_wrong_model_misses_alike_cancels_at_one_motion_only() -> None:
    a = _reading(1000.0, 1.0, misfit=30.0, misses=25.0)
    b = _reading(1010.0, 1.0, misfit=32.0, misses=26.0)
    assert compared(FORCE, a, b, is_same_motion=True).verdict is Sameness.DIFFERENT
    assert compared(FORCE, a, b).verdict is not Sameness.DIFFERENT
    # The second model misses 20 N more there: so much of the difference is the model's.
    c = _reading(1010.0, 1.0, misfit=32.0, misses=45.0)
    assert compared(FORCE, a, c, is_same_motion=True).verdict is not Sameness.DIFFERENT


def test_parameters_of_a_wrong_model_are_off_alike() -> None:
    a, b = Reading(100.0, 0.1, misfit=5.0), Reading(102.0, 0.1, misfit=5.1)
    assert compared(VALUE, a, b, is_same_motion=True).verdict is Sameness.DIFFERENT
    assert compared(VALUE, a, b).verdict is not Sameness.DIFFERENT


@pytest.mark.parametrize(
    ("second", "reason"),
    [
        (Reading(100.0), "no errors are known"),
        (
            Reading(math.nan, objection="the logs do not determine it"),
            "the logs do not determine it",
        ),
        (Reading(200.0, 0.1, objection="it ended at the edge"), "it ended at the edge"),
    ],
)
def test_what_is_not_known_is_not_judged(second, reason) -> None:
    line = compared(VALUE, Reading(100.0, 1.0), second)
    assert line.verdict is Sameness.UNDETERMINED
    assert line.reason == reason


def test_two_numbers_that_were_declared_are_the_same_or_not() -> None:
    assert compared(VALUE, Reading(50.0, 0.0), Reading(50.0, 0.0)).verdict is Sameness.SAME
    assert compared(VALUE, Reading(50.0, 0.0), Reading(51.0, 0.0)).verdict is Sameness.DIFFERENT


def test_holm_remembers_how_many_lines_there_are() -> None:
    chances = [0.001, 0.012, 0.016, 0.026, 0.9]  # 0.05 over 5, 4, 3, 2: the fourth is above 0.025
    steps = [-float(np.sqrt(2.0) * student.ppf(p / 2.0, 1e12)) for p in chances]
    lines = [compared(FORCE, _reading(1000.0), _reading(1000.0 + step)) for step in steps]
    told = surely_different(lines[::-1])[::-1]
    assert [one.is_sure for one in told] == [True, True, True, False, False]
    assert [one.verdict.value for one in told[:4]] == ["different"] * 4


def test_chance_is_told_as_often_as_it_says() -> None:
    rng = np.random.default_rng(7)
    values = rng.normal(1000.0, 1.0, (4000, 2))
    lines = [compared(FORCE, _reading(a), _reading(b)) for a, b in values]
    share = np.mean([line.verdict is Sameness.DIFFERENT for line in lines])
    assert share == pytest.approx(0.05, abs=0.01)


def test_noise_of_what_a_model_misses_is_no_misfit() -> None:
    a, b = (_reading(1000.0 + d, 1.0, misses=m) for d, m in ((0.0, 1.0), (3.5, -2.0)))
    assert compared(FORCE, a, b, is_same_motion=True).verdict is Sameness.DIFFERENT


def test_an_offset_has_newtons_and_no_per_cent() -> None:
    offset = Topic("parameter", "f_0", "f_0", "N", Setting.of(1))
    a, b = (Reading(value, 0.5, scale=100.0) for value in (-0.1, 3.0))
    line = compared(offset, a, b)
    assert line.verdict is Sameness.DIFFERENT
    assert math.isnan(line.percent)
    assert line.difference == pytest.approx(3.1)
    far = Reading(-0.1, 5.0, scale=100.0)
    assert compared(offset, far, far).reason.startswith("a difference of 14 %")


def test_the_error_of_the_first_counts_in_the_per_cent_as_often_as_the_ratio() -> None:
    line = compared(FORCE, _reading(100.0, 1.0), _reading(200.0, 0.0))
    assert line.high - line.difference == pytest.approx(1.959964)
    assert line.percent_high - line.percent == pytest.approx(2.0 * 1.959964)


def _lines(*steps: float, error: float = 1.0) -> tuple:
    return surely_different(
        [
            compared(
                Topic("force", "force", "force", "N", Setting.of(k), 0.26, "bump"),
                Reading(-1000.0, error, scale=-800.0),
                Reading(-1000.0 + step, error, scale=-800.0),
            )
            for k, step in enumerate(steps, start=1)
        ]
    )


def test_a_line_says_harder_or_softer_and_whether_it_may_be_chance() -> None:
    harder, softer, maybe = (*_lines(-80.0, 40.0), _lines(*[0.0] * 39, 3.0)[-1])
    assert verdict_of(harder) == "different: 10 % harder"
    assert verdict_of(softer) == "different: 5 % softer"
    assert verdict_of(maybe).startswith("different, perhaps by chance: 0.38 % softer")
    topic = Topic("figure", "hysteresis", "hysteresis", "N", Setting.of(3))
    nothing = compared(topic, Reading(0.0, 1.0), Reading(-9.0, 1.0))
    assert verdict_of(nothing) == "different, perhaps by chance: 9 N less"
    assert topic.place() == "setting 3, hysteresis"
    # In rebound it is negative: -54 N was "more" than -57 N, by a share of half the force's range.
    for first, second, said in ((-57.0, -54.0, "3 N narrower"), (40.0, 48.0, "8 N wider")):
        topic = Topic("figure", "hysteresis_rebound", "hysteresis, rebound", "N", Setting.of(3))
        line = compared(topic, Reading(first, 0.1, scale=600.0), Reading(second, 0.1, scale=600.0))
        assert verdict_of(line).endswith(f"the loop is {said}")
    assert difference_of(nothing).startswith("-9 N (-11.8 to -6.23)")
