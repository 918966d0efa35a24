"""Forces held against bands: at the edge, just inside and just outside."""

import math
from pathlib import Path
from xml.etree.ElementTree import fromstring

import pytest

from damperfit.comparison import (
    ComparisonOptions,
    Point,
    bands_met,
    compare_runs,
    parse_bands,
    parse_tolerance,
    tolerated,
)
from damperfit.errors import ConfigurationError
from damperfit.reporting.compared import junit_report, tolerance_outcome, tolerance_sheet
from tests.comparison.runs import DAMPING, GAS, measured, run

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
        "1 of 1 points within the tolerance; the nearest edge is 10 N away"
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


def test_in_a_table_the_larger_of_per_cent_and_newtons_counts_too(tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    rows = '0.13,rebound,100,"1%,30N"\n0.2,rebound,100,"40%,30N"\n'
    bands = parse_bands(_table("speed,stroke,force,tolerance\n" + rows)).bands
    assert [(one.low, one.high) for one in bands] == [(70.0, 130.0), (60.0, 140.0)]
