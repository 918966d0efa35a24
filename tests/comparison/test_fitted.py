"""Fitted runs compared: parameters, speeds, tares, and what else differs between them."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from damperfit.adjustment.force_at import Sine, Stage
from damperfit.comparison import ComparisonOptions, Sameness, compare_runs
from damperfit.comparison.comparing import (
    circumstances,
    comparable_quantities,
    figure_lines,
    force_readings,
    freedom_of,
    parameter_readings,
)
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.damper.rivals import Bilinear
from damperfit.tested.setting import Setting
from tests.comparison.false_alarms import (
    CHANGE,
    compared_pairs,
    found,
    rig,
    shares,
)
from tests.comparison.runs import fitted, measured

SETTINGS = (Setting.of(1), Setting.of(2))
FREE = ("r_m1", "f_0")
_SAME_LOGS = (
    "both are based on the same logs (x.csv): what differs there is how they were evaluated, and "
    "the errors, which are those of two tests, are too large"
)


def _row(n_cycles: int, n_logs: int, **more: object) -> dict:
    row: dict = {"n_cycles": n_cycles, "n_logs": n_logs}
    for one in PURDY_DAMPER.quantities:
        status = "shared" if one.name in {"r_m3", "f_f"} else "fitted"
        row |= {one.name: 5.0, f"{one.name}_se": 0.1, f"{one.name}_status": status}
    return row | {"f_0_status": "fixed"} | more


ROWS = (_row(13, 1), _row(12, 2))


def run(name, tare, *, is_free=True, factor=1.0, **more):
    """Return a run of two settings whose rig adds a tare, known where it is free."""
    truth = reference_parameters(5)
    values = replace(truth, r_m1=factor * truth.r_m1, f_0=tare)
    free = FREE if is_free else FREE[:1]
    known = np.diag([1e-3, 1.0])[: len(free), : len(free)] ** 2
    row = {"n_cycles": 13, "n_logs": 1}
    for one in PURDY_DAMPER.quantities:
        status = "fitted" if one.name in free else "fixed"
        row |= {one.name: getattr(values, one.name), f"{one.name}_status": status}
        row |= {f"{one.name}_se": 1.0 if one.name == "f_0" else 1e-3 * row[one.name]}
    stages = tuple(Stage(one, values, free, (), known) for one in SETTINGS)
    return fitted(name=name, stages=stages, rows=(row, row), **more)


def test_cycles_less_one_a_log_are_the_degrees_of_freedom() -> None:
    assert [freedom_of(fitted(rows=ROWS), one) for one in SETTINGS] == [12.0, 10.0]
    assert freedom_of(fitted(rows=({}, {})), SETTINGS[0]) == math.inf


def test_what_all_share_stands_once_with_the_cycles_of_all() -> None:
    (table,) = parameter_readings([fitted(rows=ROWS)], SETTINGS)
    told = {(topic.name, topic.setting): one.freedom for topic, one in table.items()}
    assert told["r_m3", None] == 22.0
    assert told["r_m1", SETTINGS[1]] == 10.0
    assert ("f_0", SETTINGS[0]) not in told
    apart = fitted(rows=(_row(13, 1), _row(12, 2, r_m3=6.0)))
    (table,) = parameter_readings([apart], SETTINGS)
    assert {topic.setting for topic in table if topic.name == "r_m3"} == set(SETTINGS)


@pytest.mark.parametrize("status", ["at_bound", "not_identifiable"])
def test_what_the_logs_do_not_tell_is_not_compared(status) -> None:
    rows = (_row(13, 1, r_m1_status=status), _row(12, 2))
    (table,) = parameter_readings([fitted(rows=rows)], SETTINGS)
    told = {(topic.name, topic.setting): one.objection for topic, one in table.items()}
    assert told["r_m1", SETTINGS[0]]
    assert not told["r_m1", SETTINGS[1]]


@pytest.mark.parametrize(
    ("how", "speeds"),
    [
        ({}, {0.05, 0.1, 0.13}),
        ({"sine": Sine(0.032, 1.5)}, {0.05, 0.1, 0.13, 0.26, 0.3}),
        ({"speeds": (0.7,)}, {0.7}),
    ],
)
def test_speeds_are_those_that_all_tests_have_reached(how, speeds) -> None:
    slow, fast = run("a", 0.0, sine=Sine(0.02, 1.1)), run("b", 0.0, sine=Sine(0.032, 1.5))
    forces = compare_runs(slow, fast, ComparisonOptions(**how)).of("force")
    assert {line.subject.speed for line in forces} == speeds


def test_misfits_and_margins_are_told_in_per_cent() -> None:
    """A misfit is stored in per cent, a margin as a share."""
    rows = (
        {"mse_percent": 0.5, "grade": "excellent", "r_m3_cavitation_margin": 0.25},
        {"mse_percent": 0.8, "grade": "good", "r_m3_cavitation_margin": None},
    )
    first, second = (SimpleNamespace(row=lambda _, row=row: row) for row in rows)
    misfit, margin = figure_lines(first, second, [Setting.of(1)])  # type: ignore[arg-type]
    assert (misfit.first.value, misfit.second.value, misfit.words) == (
        0.5, 0.8, "excellent, now good",
    )  # fmt: skip
    assert misfit.difference == pytest.approx(0.3)
    assert (margin.first.value, margin.words) == (25.0, "both full")
    assert math.isnan(margin.second.value)


def readings(*runs):
    return force_readings(runs, SETTINGS, speeds=(0.1,))


def compared(*runs):
    found = compare_runs(*runs, ComparisonOptions(speeds=(0.1, 0.2)))
    return found.of("force"), found.notes


def test_a_tare_is_no_difference_of_forces() -> None:
    forces, notes = compared(run("a", 11.6), run("b", 36.6))
    assert len(forces) == 8
    assert all(abs(line.difference) < 1e-9 for line in forces)
    assert {line.verdict for line in forces} == {Sameness.SAME}
    said = "the rigs' force offsets, their tares, are left out of the forces (a: 11.6 N; b: 36.6 N)"
    assert said in notes


def test_a_changed_valve_is_told_whatever_the_tare() -> None:
    alike, _ = compared(run("a", 0.0), run("b", 0.0, factor=1.2))
    forces, _ = compared(run("a", 11.6), run("b", 36.6, factor=1.2))
    assert [line.percent for line in forces] == pytest.approx([line.percent for line in alike])
    assert any(line.is_sure for line in forces)


def test_where_one_run_tells_no_tare_the_other_keeps_its_own() -> None:
    forces, notes = compared(run("a", 0.0, is_free=False), run("b", 25.0))
    assert all(line.difference == pytest.approx(25.0) for line in forces)
    assert any(
        note.startswith("b: its force offset (25 N), the rig's tare, is in its forces")
        for note in notes
    )


def test_a_held_tare_is_known() -> None:
    a, b = readings(run("a", 130.0, is_free=False), run("b", 25.0))
    for topic, one in a.items():
        assert one.value == pytest.approx(b[topic].value)


def test_a_single_run_is_held_against_nominal_forces_as_its_rig_gave_them() -> None:
    (bare,), (whole,) = readings(run("a", 0.0)), readings(run("a", 25.0))
    for topic, one in whole.items():
        assert one.value - bare[topic].value == pytest.approx(25.0)


def test_beside_a_model_that_knows_no_gas_the_offsets_stay() -> None:
    model = Bilinear()
    values = model.values({"c_r": 2e3, "c_b": 1e3, "f_0": -120.0})
    stages = tuple(Stage(one, values) for one in SETTINGS)
    a, b = run("a", 25.0), fitted(name="b", damper=model, stages=stages)
    paired, _ = force_readings((a, b), SETTINGS, speeds=(0.1,))
    (alone,) = readings(a)
    for topic, one in paired.items():
        assert one.value == alone[topic].value


def _said(first, second):
    return [one.sentence for one in circumstances(first, second)]


def test_alike_runs_differ_in_nothing() -> None:
    record = {"version": "1", "configuration": {"rig": {"filter": "none"}}, "test": {"serial": "7"}}
    tests = (replace(measured(1), temperature=25.0),)
    assert _said(fitted(1, tests=tests, **record), fitted(1, name="b", tests=tests, **record)) == []


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
    assert _said(fitted(1, **a), fitted(1, name="b", **b)) == [said]
    assert _said(fitted(1, **a), fitted(1, name="b", **a))[1:] == []


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
    a, b = fitted(1, inputs=[_log(*before)]), fitted(1, name="b", inputs=[_log(*after)])
    said = f"reversed, as positive in compression: {said} the other; declare "
    assert _said(a, b) == [_SAME_LOGS, f"{said}rig.reverse_displacement and rig.reverse_force"]
    assert _said(a, fitted(1, name="b", inputs=[_log(*before)])) == [_SAME_LOGS]
    # Another log may be of a rig that counts the other way; an older run does not tell its signs.
    assert _said(a, fitted(1, name="b", inputs=[_log(*after, sha256="cd")])) == []
    unsaid = {key: one for key, one in _log().items() if key != "reversed"}
    assert _said(a, fitted(1, name="b", inputs=[unsaid])) == [_SAME_LOGS]


def test_the_gas_and_what_it_does_to_every_force() -> None:
    other = replace(PURDY_DAMPER, gas_pressure=5.6e5)
    first, second = _said(fitted(1), fitted(1, name="b", damper=other))
    assert first == "damper.gas_pressure: 460000 Pa, then 560000 Pa"
    assert second.startswith("gas force at mid-stroke: -130.4 N, then -158.8 N: -28.4 N of every")


@pytest.mark.parametrize(("ratio", "n"), [(1.049, 0), (1.051, 1)])
def test_another_motion_is_more_than_a_twentieth_off(ratio, n) -> None:
    a, b = measured(1), measured(1, frequency=ratio * 1.5)
    found = _said(fitted(1, tests=(a,)), fitted(1, name="b", tests=(b,)))
    assert len(found) == n
    assert all(one.startswith("motion: 32 mm at 1.5 Hz, then 32 mm at 1.57") for one in found)


@pytest.mark.parametrize(("warmer", "n"), [(1.9, 0), (2.1, 1)])
def test_another_temperature_is_two_degrees_off(warmer, n) -> None:
    a, b = (replace(measured(1), temperature=25.0 + t) for t in (0.0, warmer))
    assert len(_said(fitted(1, tests=(a,)), fitted(1, name="b", tests=(b,)))) == n


def test_a_quantity_in_another_unit_is_named_and_not_compared() -> None:
    first, *rest = PURDY_DAMPER.quantities
    other = fitted(1, name="b", quantities=(replace(first, unit="furlong"), *rest))
    assert _said(fitted(1), other) == [
        "unit of r_m1: s sqrt(N)/(m kg), then furlong: it is not compared"
    ]
    found = comparable_quantities([fitted(1), other])
    assert [one.name for one in found] == [one.name for one in rest]


# A few of the pairs that `python -m tests.comparison.false_alarms` counts by hundreds.


@pytest.fixture(scope="module")
def reference():
    return rig(duration=6.0)


@pytest.mark.slow
def test_noise_alone_is_not_called_a_difference(reference) -> None:
    told = shares(compared_pairs(reference, reference, 3))
    for share, _, surely in told.values():
        assert share <= 0.1
        assert surely == 0.0


def test_one_per_cent_of_a_valve_is_found_and_a_tenth_of_it_is_not_made_up(reference) -> None:
    changed = compared_pairs(reference, rig(factor=1.0 + CHANGE, duration=6.0), 1)
    assert found(changed) == 1.0
    for line in changed[0].of("parameter"):
        if line.subject.name == "r_m1":
            assert line.percent_low <= 100.0 * CHANGE <= line.percent_high
    forces = changed[0].of("force")
    assert any(line.is_sure for line in forces)
