"""Verdicts on two numbers, each limit with a case on both sides; what people read of them."""

import math
from pathlib import Path
from xml.etree.ElementTree import fromstring

import numpy as np
import pytest
from scipy.stats import t as student

from damperfit.comparison import (
    ComparisonOptions,
    Point,
    bands_met,
    compare_runs,
    parse_bands,
    parse_tolerance,
    tolerated,
    verdict_of,
)
from damperfit.comparison.verdict import (
    Reading,
    Sameness,
    Topic,
    compared,
    difference_of,
    surely_different,
)
from damperfit.errors import ConfigurationError
from damperfit.reporting.compared import junit_report, tolerance_outcome, tolerance_sheet
from damperfit.tested.setting import Setting
from tests.comparison.runs import DAMPING, GAS, measured, run

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


@pytest.mark.parametrize(("share", "verdict"), [(0.99, "same"), (1.01, "undetermined")])
def test_same_is_said_only_where_a_difference_would_be_seen(share, verdict) -> None:
    error = share * 0.05 * 1000.0 / 1.959964
    line = compared(FORCE, _reading(1000.0, 0.0), _reading(1000.0, error))
    assert line.verdict is Sameness(verdict)
    assert ("would go unnoticed" in line.reason) == (verdict == "undetermined")


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


# Forces held against bands: at the edge, just inside and just outside.

MEASURED = ComparisonOptions(speeds=(0.13,), is_measured=True)
AT = DAMPING * 0.13 + GAS


def _table(text: str) -> str:
    path = Path("nominal.csv")
    path.write_text(text)
    return str(path)


@pytest.mark.parametrize(
    ("text", "share", "newtons"),
    [
        *(("5%", 0.05, 0.0), ("20N", 0.0, 20.0), (" 2.5 % , 0.1kN", 0.025, 100.0)),
        *(("0.5%,12.5N", 0.005, 12.5), ("0.1kN", 0.0, 100.0), ("7.5", 0.0, 7.5)),
    ],
)
def test_a_tolerance_is_per_cent_or_newtons_or_both_and_no_file(text, share, newtons) -> None:
    found = parse_bands(text)
    assert (found.share, found.newtons) == (pytest.approx(share), newtons)


@pytest.mark.parametrize("text", ["nominal.csv", "nominal.h5", "bands 2.5.csv"])
def test_what_is_named_like_a_file_is_one(text) -> None:
    with pytest.raises(ConfigurationError, match="cannot be read"):
        parse_bands(text)


@pytest.mark.parametrize("text", ["", "5 mm", "0%", "-3N", "half"])
def test_what_is_no_tolerance_is_refused(text) -> None:
    with pytest.raises(ConfigurationError, match="--tolerance"):
        parse_tolerance(text)


@pytest.mark.parametrize(("factor", "is_met"), [(1.049, True), (1.051, False)])
def test_five_per_cent_is_met_just_inside_and_missed_just_outside(factor, is_met) -> None:
    # The measured force itself: without a model the gas force is not known.
    other = 1.0 + (factor - 1.0) * AT / (DAMPING * 0.13)
    comparison = compare_runs(run(measured()), run(measured(factor=other), name="b"), MEASURED)
    rebound = next(p for p in tolerated(comparison, parse_tolerance("5%")) if p.stroke == "rebound")
    assert rebound.is_met == is_met
    assert rebound.margin == pytest.approx((1.05 - factor) * AT, abs=0.02)


def test_the_larger_of_both_counts() -> None:
    comparison = compare_runs(run(measured()), run(measured(factor=1.1), name="b"), MEASURED)
    assert not all(p.is_met for p in tolerated(comparison, parse_tolerance("5%")))
    assert all(p.is_met for p in tolerated(comparison, parse_tolerance("5%,30N")))


def test_a_setting_that_was_not_tested_is_not_met() -> None:
    a = run(measured(1), measured(2))
    (lost,) = (
        p
        for p in tolerated(compare_runs(a, run(measured(1)), MEASURED), parse_tolerance("9%"))
        if math.isnan(p.speed)
    )
    assert not lost.is_met
    assert lost.words == "not evaluated: not tested"


def test_nominal_forces_hold_by_setting_speed_and_stroke(tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    bands = parse_bands(
        _table(
            "# from the drawing\nSetting,speed,Stroke,force_N,tolerance\n"
            f"1,130mm/s,rebound,{AT:.3f},1N\n,0.13,bump,{DAMPING * 0.13 - GAS:.3f},1%\n"
            "7,0.13,bump,300,5%\n1,0.5,rebound,900,5%\n"
        )
    )
    found = bands_met(run(measured(1), measured(2)), bands, MEASURED)
    assert [(str(p.setting), p.stroke, p.is_met) for p in found] == [
        ("1", "rebound", True),
        ("1", "bump", True),
        ("2", "bump", True),
        ("7", "bump", False),
        ("1", "rebound", False),
    ]
    assert [p.reason for p in found[3:]] == [
        "the setting was not tested",
        "the test does not reach the speed",
    ]
    assert found[1].low < GAS - DAMPING * 0.13 < found[1].high  # positive in the file


def test_edges_may_be_given_themselves(tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    table = f"speed,stroke,low_N,high_N\n0.13,rebound,{AT - 0.5},{AT + 0.5}\n0.13,bump,390,1e3\n"
    bands = parse_bands(_table(table))
    assert bands.bands[1].low == -1000.0
    assert bands.bands[1].high == -390.0
    for factor, is_met in ((1.0, True), (1.004, False)):
        points = bands_met(run(measured(factor=factor)), bands, MEASURED)
        assert points[0].is_met == is_met


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("speed,force\n1,2\n", "expected the columns speed, stroke"),
        ("", "found nothing"),
        ("speed,stroke,low,high\n", "no row below the headings"),
        ("speed,stroke,low,high\n0.1,rebound,5,x\n", "row 2: 'x' cannot be read as force"),
        ("speed,stroke,low,high\n0.1,up,5,9\n", "stroke 'up': expected rebound or bump"),
        ("speed,stroke,low,high\n0,bump,5,9\n", "speed 0"),
        ("speed,stroke,low,high\n0.1,rebound,9,5\n", "low 9 N is above high 5 N"),
        ("speed,stroke,force,tolerance\n0.1,rebound,9,\n", "row 2"),
    ],
)
def test_a_table_that_is_none_is_refused_in_one_sentence(tmp_path, monkeypatch, text, said) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ConfigurationError, match=r"--tolerance nominal.csv") as caught:
        parse_bands(_table(text))
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def _point(force: float, reach: float = 1.0, **more: str) -> Point:
    return Point("b\x1b", "3", 0.26, "rebound", force, 90.0, 110.0, reach, **more)


def test_the_words_say_how_far_and_whether_that_is_sure() -> None:
    assert _point(100.0).words == "passes, 10 N inside"
    assert _point(112.0).words == "FAILS, 2 N outside"
    assert _point(109.5).words == "passes, 0.5 N inside, no further than its error"
    assert _point(110.0).is_met
    points = [_point(100.0), _point(112.0), _point(math.nan, reason="not tested")]
    assert tolerance_outcome(points) == (
        "1 of 3 points within the tolerance, 1 outside, by up to 2 N, 1 not evaluated"
    )
    assert tolerance_outcome(points[:1]) == (
        "1 of 1 points within the tolerance; the nearest limit is 10 N away"
    )
    assert [row[-1] for row in tolerance_sheet(points).rows] == [
        "not evaluated: not tested",
        "FAILS, 2 N outside",
        "passes, 10 N inside",
    ]


def test_junit_has_a_case_a_point_and_every_miss_is_a_failure() -> None:
    points = [_point(100.0), _point(112.0), _point(math.nan, reason="not tested")]
    root = fromstring(junit_report(points, source="<5%>"))  # noqa: S314 - ours
    assert (root.get("tests"), root.get("failures")) == ("3", "2")
    cases = root.findall("./testsuite/testcase")
    kinds = [case.find("failure") for case in cases]
    assert [None if one is None else one.get("type") for one in kinds] == [
        None,
        "out of tolerance",
        "not evaluated",
    ]
    assert cases[0].get("name") == "setting 3, rebound, 0.26 m/s"
    assert "\x1b" not in (cases[0].get("classname") or "")
