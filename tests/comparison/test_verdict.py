"""Verdicts on two numbers, each limit with a case on both sides; what people read of them."""

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import t as student

from damperfit.comparison.comparing import ComparisonOptions, compare_runs
from damperfit.comparison.differences import compared, surely_different
from damperfit.comparison.measured import Reading, Topic
from damperfit.comparison.tolerance import (
    bands_met,
    parse_bands,
    parse_tolerance,
    tolerated,
)
from damperfit.errors import ConfigurationError
from damperfit.tested.setting import Setting
from tests.comparison.runs import DAMPING, GAS, measured, run

FORCE = Topic("force", "force", "force", "N", Setting.of(3), 0.26, "rebound")
VALUE = Topic("parameter", "r_m1", "R_m1", "", Setting.of(3), is_logarithmic=True)
OFFSET = Topic("parameter", "f_0", "f_0", "N", Setting.of(1))
SAME, OTHER, OPEN = "same", "different", "undetermined"
REACH = 1.959964 * math.hypot(3.0, 4.0)


def force(value, error=1.0, **more):
    return Reading(value, error, **({"scale": value} | more))


LIMIT = 0.05 * 1000.0 / 1.959964  # an error in which 5 % would just be seen
WRONG = force(1000.0, 1.0, misfit=30.0, misses=25.0)
OFF = Reading(-0.1, 0.5, scale=100.0)


@pytest.mark.parametrize(
    ("topic", "first", "second", "is_one_motion", "verdict"),
    [
        # A difference counts beyond the interval of both errors.
        (FORCE, force(1000.0, 3.0), force(1000.0 + 0.999 * REACH, 4.0), False, SAME),
        (FORCE, force(1000.0, 3.0), force(1000.0 + 1.001 * REACH, 4.0), False, OTHER),
        # Same is said only where a difference would be seen.
        (FORCE, force(1000.0, 0.0), force(1000.0, 0.99 * LIMIT), False, SAME),
        (FORCE, force(1000.0, 0.0), force(1000.0, 1.01 * LIMIT), False, OPEN),
        # What tests of one setting differ by is an error too.
        (FORCE, force(100.0), force(103.0), False, OTHER),
        (FORCE, force(100.0), force(103.0, repeat=2.0), False, SAME),
        # What a wrong model misses alike cancels at one motion only.
        (FORCE, WRONG, force(1010.0, 1.0, misfit=32.0, misses=26.0), True, OTHER),
        (FORCE, WRONG, force(1010.0, 1.0, misfit=32.0, misses=26.0), False, OPEN),
        # 20 N more are missed by the second: so much of the difference is the model's.
        (FORCE, WRONG, force(1010.0, 1.0, misfit=32.0, misses=45.0), True, SAME),
        # Noise of what a model misses is no misfit.
        (FORCE, force(1000.0, misses=1.0), force(1003.5, misses=-2.0), True, OTHER),
        (VALUE, Reading(100.0, 0.1, misfit=5.0), Reading(102.0, 0.1, misfit=5.1), True, OTHER),
        (VALUE, Reading(100.0, 0.1, misfit=5.0), Reading(102.0, 0.1, misfit=5.1), False, OPEN),
        # Two numbers that were declared.
        (VALUE, Reading(50.0, 0.0), Reading(50.0, 0.0), False, SAME),
        (VALUE, Reading(50.0, 0.0), Reading(51.0, 0.0), False, OTHER),
        (OFFSET, OFF, Reading(3.0, 0.5, scale=100.0), False, OTHER),
    ],
)
def test_two_readings_are_the_same_or_not(topic, first, second, is_one_motion, verdict) -> None:
    line = compared(topic, first, second, is_same_motion=is_one_motion)
    assert line.verdict == verdict
    assert bool(line.reason) == (verdict == OPEN)


def test_few_cycles_widen_the_interval_by_student_and_welch() -> None:
    a, b = force(100.0, 2.0, freedom=4.0), force(100.0, 1.0, freedom=9.0)
    line = compared(FORCE, a, b)
    freedom = 25.0 / (16.0 / 4.0 + 1.0 / 9.0)
    assert line.high == pytest.approx(student.ppf(0.975, freedom) * math.sqrt(5.0))
    chance = compared(FORCE, a, force(104.0, 1.0, freedom=9.0)).chance
    assert chance == pytest.approx(2.0 * student.sf(4.0 / math.sqrt(5.0), freedom))


def test_differences_and_per_cents_have_intervals() -> None:
    """Of the damping, harder positive in bump too; of a parameter on the logarithm."""
    bump = Topic("force", "force", "force", "N", Setting.of(3), 0.26, "bump")
    line = compared(bump, force(-530.0, scale=-400.0), force(-570.0, scale=-440.0))
    assert (line.difference, line.percent) == (pytest.approx(-40.0), pytest.approx(10.0))
    line = compared(VALUE, Reading(2.0, 0.02), Reading(2.4, 0.024))
    ends = [100.0 * (1.2 * math.exp(s * 1.959964 * math.hypot(0.01, 0.01)) - 1.0) for s in (-1, 1)]
    told = [line.percent_low, line.percent, line.percent_high]
    assert told == pytest.approx([ends[0], 20.0, ends[1]], rel=1e-5)
    # The error of the first counts in the per cent as often as the ratio.
    line = compared(FORCE, force(100.0, 1.0), force(200.0, 0.0))
    assert line.high - line.difference == pytest.approx(1.959964)
    assert line.percent_high - line.percent == pytest.approx(2.0 * 1.959964)
    # An offset has newtons and no per cent.
    line = compared(OFFSET, OFF, Reading(3.0, 0.5, scale=100.0))
    assert (line.difference, math.isnan(line.percent)) == (pytest.approx(3.1), True)
    far = Reading(-0.1, 5.0, scale=100.0)
    assert compared(OFFSET, far, far).reason.startswith("a difference of 14 N")


@pytest.mark.parametrize(
    ("second", "reason"),
    [
        (Reading(100.0), "no errors are known"),
        (Reading(math.nan, objection="the logs do not determine it"), "the logs do not determine"),
        (Reading(200.0, 0.1, objection="it ended at the edge"), "it ended at the edge"),
    ],
)
def test_what_is_not_known_is_not_judged(second, reason) -> None:
    line = compared(VALUE, Reading(100.0, 1.0), second)
    assert line.verdict == OPEN
    assert line.reason.startswith(reason)


def test_holm_remembers_how_many_lines_there_are_and_chance_is_told_as_often_as_it_says() -> None:
    chances = [0.001, 0.012, 0.016, 0.026, 0.9]  # 0.05 over 5, 4, 3, 2: the fourth is above 0.025
    steps = [-float(np.sqrt(2.0) * student.ppf(p / 2.0, 1e12)) for p in chances]
    lines = [compared(FORCE, force(1000.0), force(1000.0 + step)) for step in steps]
    told = surely_different(lines[::-1])[::-1]
    assert [one.is_sure for one in told] == [True, True, True, False, False]
    assert [one.verdict for one in told[:4]] == [OTHER] * 4
    values = np.random.default_rng(7).normal(1000.0, 1.0, (4000, 2))
    verdicts = [compared(FORCE, force(a), force(b)).verdict == OTHER for a, b in values]
    assert np.mean(verdicts) == pytest.approx(0.05, abs=0.01)


# Forces held against bands: at the edge, just inside and just outside.

MEASURED = ComparisonOptions(speeds=(0.13,), is_measured=True)
AT = DAMPING * 0.13 + GAS


@pytest.fixture
def bands(tmp_path, monkeypatch):
    """Read a table of bands."""
    monkeypatch.chdir(tmp_path)

    def parse(text: str):
        Path("nominal.csv").write_text(text)
        return parse_bands("nominal.csv")

    return parse


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


@pytest.mark.parametrize("text", ["", "5 mm", "0%", "-3N", "half", "nominal.h5", "bands 2.5.csv"])
def test_what_is_no_tolerance_is_refused_and_what_is_named_like_a_file_is_one(text) -> None:
    parse, says = (parse_bands, "no such file") if "." in text else (parse_tolerance, "--tolerance")
    with pytest.raises(ConfigurationError, match=says):
        parse(text)


@pytest.mark.parametrize(("factor", "is_met"), [(1.049, True), (1.051, False)])
def test_five_per_cent_is_met_just_inside_and_missed_just_outside(factor, is_met) -> None:
    # The measured force itself: without a model the gas force is not known.
    other = 1.0 + (factor - 1.0) * AT / (DAMPING * 0.13)
    comparison = compare_runs(run(measured()), run(measured(factor=other), name="b"), MEASURED)
    rebound = next(p for p in tolerated(comparison, parse_tolerance("5%")) if p.stroke == "rebound")
    assert (rebound.is_met, rebound.margin) == (
        is_met,
        pytest.approx((1.05 - factor) * AT, abs=0.02),
    )
    # The larger of both counts.
    assert all(p.is_met for p in tolerated(comparison, parse_tolerance("5%,30N")))


def test_a_setting_that_was_not_tested_is_not_met() -> None:
    found = compare_runs(run(measured(1), measured(2)), run(measured(1)), MEASURED)
    (lost,) = (p for p in tolerated(found, parse_tolerance("9%")) if math.isnan(p.speed))
    assert (lost.is_met, lost.words) == (False, "not evaluated: not tested")


def test_nominal_forces_hold_by_setting_speed_and_stroke(bands) -> None:
    known = bands(
        "# from the drawing\nSetting,speed,Stroke,force_N,tolerance\n"
        f"1,130mm/s,rebound,{AT:.3f},1N\n,0.13,compression,{DAMPING * 0.13 - GAS:.3f},1%\n"
        "7,0.13,bump,300,5%\n1,0.5,rebound,900,5%\n"
    )
    found = bands_met(run(measured(1), measured(2)), known, MEASURED)
    assert [(str(p.setting), p.stroke, p.reason or p.is_met) for p in found] == [
        *(("1", "rebound", True), ("1", "bump", True), ("2", "bump", True)),
        ("7", "bump", "the setting was not tested"),
        ("1", "rebound", "the test does not reach the speed"),
    ]
    assert found[1].low < GAS - DAMPING * 0.13 < found[1].high  # positive in the file
    known = bands(
        f"speed,stroke,low_N,high_N\n0.13,rebound,{AT - 0.5},{AT + 0.5}\n0.13,bump,390,1e3\n"
    )
    assert (known.bands[1].low, known.bands[1].high) == (-1000.0, -390.0)
    for factor, is_met in ((1.0, True), (1.004, False)):
        assert bands_met(run(measured(factor=factor)), known, MEASURED)[0].is_met == is_met


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("speed,force\n1,2\n", "expected the columns speed, stroke"),
        ("", "found nothing"),
        ("speed,stroke,low,high\n", "no row below the headings"),
        ("speed,stroke,low,high\n0.1,rebound,5,x\n", "row 2: 'x' cannot be read as force"),
        ("speed,stroke,low,high\n0.1,up,5,9\n", "stroke 'up': expected rebound or compression"),
        ("speed,stroke,low,high\n0,bump,5,9\n", "speed 0"),
        ("speed,stroke,low,high\n0.1,rebound,9,5\n", "low 9 N is above high 5 N"),
        ("speed,stroke,force,tolerance\n0.1,rebound,9,\n", "row 2"),
    ],
)
def test_a_table_that_is_none_is_refused_in_one_sentence(bands, text, said) -> None:
    with pytest.raises(ConfigurationError, match=r"--tolerance nominal.csv") as caught:
        bands(text)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)
