"""What run.json tells is read back by the class that wrote it; nothing in it is taken on trust."""

from __future__ import annotations

import json
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from damperfit.adjustment import Click, Outlier, Trend, TrendPoint
from damperfit.checks import Check
from damperfit.recording import Finding
from damperfit.report.facts import Failure
from damperfit.report.page import summary
from damperfit.report.records import (
    checks_in,
    clicks_in,
    failures_in,
    findings_in,
    held_out_in,
    number_in,
    read_back,
    sentences_in,
    to_record,
    trends_in,
)
from damperfit.results import Run
from damperfit.tested.setting import Setting

_FINITE = st.floats(allow_nan=False, allow_infinity=False)
_FLOAT = _FINITE | st.just(math.nan)
_WHOLE = st.integers(-(10**6), 10**6)
_SAID = st.text(min_size=1)
_SETTING = st.sampled_from([-3, 0, 10, 2.5, "soft", "R12 C8"]).map(Setting.of)
_KINDS = {
    Check: st.builds(Check, name=_SAID, passed=st.none() | st.booleans(), reason=st.text()),
    Click: st.builds(
        Click,
        first=_SETTING,
        second=_SETTING,
        speed=_FINITE,
        stroke=st.sampled_from(["rebound", "bump"]),
        **dict.fromkeys(
            ("change", "low", "high", "percent", "percent_low", "percent_high"), _FLOAT
        ),
    ),
    Failure: st.builds(
        Failure,
        log=st.text(),
        path=st.text(),
        setting=st.none() | _SETTING,
        kind=st.text(),
        message=_SAID,
    ),
    Finding: st.builds(
        Finding,
        name=st.text(),
        severity=st.sampled_from(["note", "warning", "refusal"]),
        sentence=_SAID,
        value=st.none() | _FINITE,
        unit=st.text(),
        is_correction=st.booleans(),
    ),
    Trend: st.builds(
        Trend,
        parameter=_SAID,
        scale=st.none() | st.text(),
        degree=st.none() | st.integers(0, 4),
        scatter=_FLOAT,
        is_erratic=st.booleans(),
        direction=st.none() | st.text(),
        monotone=st.none() | st.booleans(),
        reversals=st.lists(st.tuples(_WHOLE, _WHOLE), max_size=2).map(tuple),
        outliers=st.lists(
            st.builds(Outlier, setting=_WHOLE, value=_FLOAT, expected=_FLOAT, deviation=_FLOAT),
            max_size=2,
        ).map(tuple),
        outliers_judged=st.booleans(),
        points=st.lists(
            st.builds(
                TrendPoint,
                setting=_WHOLE,
                value=_FINITE,
                low=_FLOAT,
                high=_FLOAT,
                found=st.none() | _FINITE,
            ),
            max_size=3,
        ).map(tuple),
        sentence=st.text(),
        adjuster=_SAID,
        held=st.text(),
    ),
}
_JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.just(10**400) | st.floats() | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=8,
)


def _as_written(value: object) -> object:
    """JSON knows no NaN: run.json has null in its place."""
    if isinstance(value, dict):
        return {key: _as_written(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_as_written(item) for item in value]
    return None if isinstance(value, float) and math.isnan(value) else value


@pytest.mark.parametrize("kind", _KINDS)
@given(data=st.data())
def test_what_was_written_is_read_back(kind, data) -> None:
    one = data.draw(_KINDS[kind])
    text = json.dumps(_as_written(to_record(one)), allow_nan=False)
    assert repr(read_back(kind, json.loads(text))) == repr(one)  # NaN is equal to nothing


def test_the_keys_of_a_click_say_their_units() -> None:
    assert to_record(Click(3, 4, 0.3, "bump", -17.5, -18.0, -17.0, 4.5, 4.0, 5.0)) == {
        "from": 3,
        "to": 4,
        "speed_m_per_s": 0.3,
        "stroke": "bump",
        "change_N": -17.5,
        "low_N": -18.0,
        "high_N": -17.0,
        "percent": 4.5,
        "percent_low": 4.0,
        "percent_high": 5.0,
        "adjuster": "setting",
    }


_ALL = {
    "checks": ("checks", checks_in, {"name": "a", "passed": True, "reason": "b"}),
    "clicks": ("clicks", clicks_in, {"from": 1, "to": 2, "speed_m_per_s": 0.3, "stroke": "bump"}),
    "failures": ("failures", failures_in, {"log": "a.csv", "message": "empty"}),
    "findings": ("findings", findings_in, {"severity": "note", "sentence": "a"}),
    "trends": ("trends", trends_in, {"parameter": "k_e", "points": [{"setting": 1, "value": 5.0}]}),
}


@pytest.mark.parametrize("name", _ALL)
@pytest.mark.parametrize(
    "damage", [..., None, 3, "a", {}, [1], [None], [[]], ["{}"], [{}], [{"x": 1}, 2.5]]
)
def test_what_is_no_list_of_entries_tells_nothing(name, damage) -> None:
    key, read, _ = _ALL[name]
    assert read({} if damage is ... else {key: damage}) == ()


@pytest.mark.parametrize(
    ("name", "lost"),
    [
        ("checks", "name"),
        ("clicks", "from"),
        ("clicks", "to"),
        ("clicks", "speed_m_per_s"),
        ("failures", "message"),
        ("findings", "sentence"),
        ("trends", "parameter"),
    ],
)
@pytest.mark.parametrize("value", [..., None, ""])
def test_an_entry_without_what_it_needs_is_left_out_alone(name, lost, value) -> None:
    key, read, whole = _ALL[name]
    damaged = {k: v for k, v in whole.items() if k != lost}
    if value is not ...:
        damaged[lost] = value
    assert len(read({key: [whole, damaged, whole]})) == 2


@pytest.mark.parametrize(
    "value",
    [True, "1", "?", None, [1], pytest.param(10**400, id="1e400"), float("nan"), float("inf")],
)
def test_a_setting_that_is_no_whole_number_is_none(value) -> None:
    click = {"from": value, "to": 2, "speed_m_per_s": 0.3, "stroke": "bump"}
    assert clicks_in({"clicks": [click]}) == ()
    trend = {
        "parameter": "k_e",
        "points": [{"setting": value, "value": 1.0}, {"setting": 2, "value": 3.0}],
    }
    ((point,),) = (one.points for one in trends_in({"trends": [trend]}))
    assert (point.setting, point.value) == (2, 3.0)
    assert failures_in({"failures": [{"setting": value, "message": "a"}]})[0].setting is None


@pytest.mark.parametrize(
    "value", [True, "1", None, [1], {}, pytest.param(10**400, id="1e400"), float("nan")]
)
def test_a_number_of_another_kind_is_not_known(value) -> None:
    (click,) = clicks_in({"clicks": [_ALL["clicks"][2] | {"change_N": value}]})
    assert math.isnan(click.change)
    assert number_in({"temperature_degC": value}, "temperature_degC") is None


@pytest.mark.parametrize("value", ["yes", "false", 1, 0, None, [1]])
def test_yes_and_no_of_another_kind_is_no_and_where_it_may_be_unknown_not_known(value) -> None:
    (finding,) = findings_in({"findings": [{"sentence": "a", "is_correction": value}]})
    assert finding.is_correction is False
    (check,) = checks_in({"checks": [{"name": "a", "passed": value}]})
    assert check.passed is None


def test_what_an_older_run_lacks_is_not_known() -> None:
    (trend,) = trends_in(
        {
            "trends": [
                {
                    "parameter": "k_e",
                    "outliers": [{"setting": 3, "deviation": 0.2}],
                    "points": [{"setting": 2, "value": 6e8}, {"setting": 1, "value": 5e8}],
                }
            ]
        }
    )
    assert [(point.setting, point.value) for point in trend.points] == [(1, 5e8), (2, 6e8)]
    assert math.isnan(trend.points[0].low)
    assert trend.outliers[0].setting == 3
    assert (trend.sentence, trend.degree, trend.monotone) == ("", None, None)
    (finding,) = findings_in({"findings": [{"sentence": "a"}]})
    assert (finding.severity, finding.value) == ("", None)


def test_findings_come_gravest_first() -> None:
    told = [{"severity": s, "sentence": s} for s in ("note", "odd", "refusal", "warning")]
    assert [one.severity for one in findings_in({"findings": told})] == [
        *("refusal", "warning", "note", "odd"),
    ]


@given(st.dictionaries(
    st.sampled_from([
        "checks", "trends", "clicks", "findings", "failures", "held_out", "sentences", "gaps",
        "warnings", "gates_missed", "procedure", "configuration", "inputs", "version",
    ]),
    _JSON | st.lists(st.dictionaries(
        st.sampled_from([
            "name", "passed", "points", "outliers", "reversals", "setting", "value", "from", "to",
            "speed_m_per_s", "sentence", "findings", "log", "message", "mse_percent",
        ]), _JSON, max_size=6), max_size=3),
))  # fmt: skip
def test_no_record_breaks_the_summary(record) -> None:
    summary(Run(record), ())
    held_out_in(record)
    sentences_in(record, "cavitation")
