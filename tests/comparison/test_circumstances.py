"""What else differs is named: each kind with a pair that differs, and one that does not."""

from __future__ import annotations

from dataclasses import replace

import pytest

from damperfit.adjustment.force_at import Sine, Stage
from damperfit.comparison import ComparedRun
from damperfit.comparison.circumstances import circumstances
from damperfit.comparison.comparing import _comparable_quantities
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.simulation import SolverOptions
from damperfit.tested.setting import Setting
from tests.comparison.runs import measured
from tests.fakes import fitted_run as fitted_run_of

ONE = Setting.of(1)
_SAME_LOGS = (
    "both are based on the same logs (x.csv): what differs there is how they were evaluated, and "
    "the errors, which are those of two tests, are too large"
)


def _run(name="a", *, damper=PURDY_DAMPER, tests=(), quantities=PURDY_DAMPER.quantities, **record):
    fitted = fitted_run_of(
        damper,
        (Stage(ONE, reference_parameters(1)),),
        Sine(0.032, 1.5),
        (),
        {ONE: {}},
        quantities,
        SolverOptions(),
    )
    return ComparedRun(name, name, fitted, tuple(tests), record)


def _said(first, second):
    return [one.sentence for one in circumstances(first, second)]


def test_alike_runs_differ_in_nothing() -> None:
    record = {"version": "1", "configuration": {"rig": {"filter": "none"}}, "test": {"serial": "7"}}
    tests = (replace(measured(1), temperature=25.0),)
    assert _said(_run(tests=tests, **record), _run("b", tests=tests, **record)) == []


@pytest.mark.parametrize(
    ("a", "b", "said"),
    [
        ({"test": {"serial": "7"}}, {"test": {"serial": "8"}}, "serial: 7, then 8"),
        (
            {"configuration": {"conditioning": {"filter_corner": "30Hz"}}},
            {"configuration": {"conditioning": {"filter_corner": "60Hz"}}},
            "corner of damperfit's filter: 30Hz, then 60Hz",
        ),
        (
            {"configuration": {"identification": {"fix": {}}}},
            {"configuration": {"identification": {"fix": {"f_f": "50N"}}}},
            "held parameters: none, then f_f = 50N",
        ),
        ({"version": "1.0"}, {"version": "1.1"}, "damperfit: 1.0, then 1.1"),
        (
            {"inputs": [{"log": "x.csv", "sha256": "ab", "setting": 1}]},
            {"inputs": [{"log": "y.csv", "sha256": "ab", "setting": 1}]},
            _SAME_LOGS,
        ),
    ],
)
def test_a_record_that_differs_is_named(a, b, said) -> None:
    assert _said(_run(**a), _run("b", **b)) == [said]
    assert _said(_run(**a), _run("b", **a))[1:] == []


def _log(*channels, name="x.csv", sha256="ab"):
    return {"log": name, "sha256": sha256, "setting": 1, "reversed": list(channels)}


@pytest.mark.parametrize(
    ("before", "after", "said"),
    [
        (
            (),
            ("displacement", "force"),
            "nothing in a, displacement and force in b (x.csv): what is rebound in one is bump in",
        ),
        (
            ("force",),
            (),
            "force in a, nothing in b (x.csv): what is positive in one is negative in",
        ),
    ],
)
def test_the_same_logs_read_with_other_signs(before, after, said) -> None:
    a, b = _run(inputs=[_log(*before)]), _run("b", inputs=[_log(*after)])
    said = f"reversed as counted positive in bump: {said} the other; declare "
    assert _said(a, b) == [_SAME_LOGS, f"{said}rig.reverse_displacement and rig.reverse_force"]
    assert _said(a, replace(a, name="b")) == [_SAME_LOGS]
    # Another log may be of a rig that counts the other way; an older run does not tell its signs.
    assert _said(a, _run("b", inputs=[_log(*after, sha256="cd")])) == []
    unsaid = {key: one for key, one in _log().items() if key != "reversed"}
    assert _said(a, _run("b", inputs=[unsaid])) == [_SAME_LOGS]


@pytest.mark.parametrize(("settings", "said"), [((2,), "setting 2"), ((2, 4), "settings 2, 4")])
def test_settings_of_one_run_alone_are_told_in_the_plural(settings, said) -> None:
    stages = tuple(Stage(Setting.of(k), reference_parameters(k)) for k in (1, *settings))
    more = _run("b")
    vars(more.fitted)["settings"] = tuple(stages)
    assert _said(_run(), more) == [f"{said} only in b: not compared"]


def test_the_gas_and_what_it_does_to_every_force() -> None:
    other = replace(PURDY_DAMPER, gas_pressure=5.6e5)
    first, second = _said(_run(), _run("b", damper=other))
    assert first == "damper.gas_pressure: 460000 Pa, then 560000 Pa"
    assert second.startswith("gas force at mid-stroke: -130.4 N, then -158.8 N: -28.4 N of every")


@pytest.mark.parametrize(("ratio", "n"), [(1.049, 0), (1.051, 1)])
def test_another_motion_is_more_than_a_twentieth_off(ratio, n) -> None:
    a, b = measured(1), measured(1, frequency=ratio * 1.5)
    found = _said(_run(tests=(a,)), _run("b", tests=(b,)))
    assert len(found) == n
    assert all(one.startswith("motion: 32 mm at 1.5 Hz, then 32 mm at 1.57") for one in found)


@pytest.mark.parametrize(("warmer", "n"), [(1.9, 0), (2.1, 1)])
def test_another_temperature_is_two_degrees_off(warmer, n) -> None:
    a, b = (replace(measured(1), temperature=25.0 + t) for t in (0.0, warmer))
    assert len(_said(_run(tests=(a,)), _run("b", tests=(b,)))) == n


def test_a_quantity_in_another_unit_is_named_and_not_compared() -> None:
    first, *rest = PURDY_DAMPER.quantities
    other = _run("b", quantities=(replace(first, unit="furlong"), *rest))
    assert _said(_run(), other) == [
        "unit of r_m1: s sqrt(N)/(m kg), then furlong: it is not compared"
    ]
    found = _comparable_quantities([_run().fitted, other.fitted])
    assert [one.name for one in found] == [one.name for one in rest]
