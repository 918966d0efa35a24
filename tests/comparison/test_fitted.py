"""Fitted runs compared: parameters, speeds, tares, and what else differs between them."""

import math
from dataclasses import replace

import numpy as np
import pytest

from damperfit.adjustment.force_at import Sine, Stage
from damperfit.comparison.circumstances import circumstances
from damperfit.comparison.comparing import (
    ComparisonOptions,
    compare_runs,
    force_readings,
    freedom_of,
    parameter_readings,
)
from damperfit.damper.purdy.parameters import PURDY_DAMPER, reference_parameters
from damperfit.damper.rivals import Bilinear
from damperfit.tested.setting import Setting
from tests.comparison.false_alarms import CHANGE, compared_pairs, found, rig, shares
from tests.comparison.runs import fitted, measured

SETTINGS = (Setting.of(1), Setting.of(2))
FREE = ("r_m1", "f_0")


def _row(n_cycles: int, n_logs: int, **more: object) -> dict:
    row: dict = {"n_cycles": n_cycles, "n_logs": n_logs}
    for one in PURDY_DAMPER.quantities:
        status = "shared" if one.name in {"r_m3", "f_f"} else "fitted"
        row |= {one.name: 5.0, f"{one.name}_se": 0.1, f"{one.name}_status": status}
    return row | {"f_0_status": "fixed"} | more


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


# Parameters and figures


def parameters(*rows) -> dict:
    (table,) = parameter_readings([fitted(rows=rows)], SETTINGS)
    return {(topic.name, topic.setting): one for topic, one in table.items()}


def test_what_all_share_stands_once_with_the_cycles_of_all() -> None:
    rows = (_row(13, 1), _row(12, 2))
    # Cycles less one a log are the degrees of freedom.
    assert [freedom_of(fitted(rows=rows), one) for one in SETTINGS] == [12.0, 10.0]
    assert freedom_of(fitted(rows=({}, {})), SETTINGS[0]) == math.inf
    told = parameters(*rows)
    assert (told["r_m3", None].freedom, told["r_m1", SETTINGS[1]].freedom) == (22.0, 10.0)
    assert ("f_0", SETTINGS[0]) not in told
    apart = parameters(rows[0], _row(12, 2, r_m3=6.0))
    assert {setting for name, setting in apart if name == "r_m3"} == set(SETTINGS)
    for status in ("at_bound", "not_identifiable"):  # what the logs do not tell is not compared
        told = parameters(_row(13, 1, r_m1_status=status), rows[1])
        assert [bool(told["r_m1", one].objection) for one in SETTINGS] == [True, False]


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


# Tares


def readings(*runs) -> list[np.ndarray]:
    tables = force_readings(runs, SETTINGS, speeds=(0.1,))
    return [np.array([one.value for one in table.values()]) for table in tables]


def compared(*runs):
    return compare_runs(*runs, ComparisonOptions(speeds=(0.1, 0.2)))


def test_a_tare_is_no_difference_of_forces_and_a_changed_valve_is() -> None:
    done = compared(run("a", 11.6), run("b", 36.6))
    forces = done.of("force")
    assert [line.difference for line in forces] == pytest.approx([0.0] * 8, abs=1e-9)
    assert {line.verdict for line in forces} == {"same"}
    said = "the rigs' force offsets, their tares, are left out of the forces (a: 11.6 N; b: 36.6 N)"
    assert said in map(str, done.notes)
    alike, tared = (
        compared(run("a", a), run("b", b, factor=1.2)).of("force")
        for a, b in ((0.0, 0.0), (11.6, 36.6))
    )
    assert [one.percent for one in tared] == pytest.approx([one.percent for one in alike])
    assert any(line.is_sure for line in tared)


def test_a_tare_that_one_run_cannot_tell_stays_in_the_other() -> None:
    done = compared(run("a", 0.0, is_free=False), run("b", 25.0))
    assert [line.difference for line in done.of("force")] == pytest.approx([25.0] * 8)
    begin = "b: its forces include its rig's tare (25 N)"
    assert any(str(note).startswith(begin) for note in done.notes)
    held, free = readings(run("a", 130.0, is_free=False), run("b", 25.0))  # a held one is known
    assert held == pytest.approx(free)
    # A single run is held against nominal forces as its rig gave them.
    (bare,), (whole,) = readings(run("a", 0.0)), readings(run("a", 25.0))
    assert whole - bare == pytest.approx(25.0)
    # Beside a model that knows no gas the offsets stay.
    model = Bilinear()
    values = model.values({"c_r": 2e3, "c_b": 1e3, "f_0": -120.0})
    stages = tuple(Stage(one, values) for one in SETTINGS)
    paired, _ = readings(run("a", 25.0), fitted(name="b", damper=model, stages=stages))
    assert paired == pytest.approx(whole)


# What else differs; of other records, dampers and signs it is in `texts.py`.


def _said(first, second, **more):
    """What is told of two runs: their records, and what the second has."""
    pair = fitted(1, **first), fitted(1, name="b", **(second | more))
    return [one.sentence for one in circumstances(*pair)]


@pytest.mark.parametrize(
    ("changed", "begins"),
    [
        ({}, []),
        ({"frequency": 1.049 * 1.5}, []),
        ({"frequency": 1.051 * 1.5}, ["motion: 32 mm at 1.5 Hz, then 32 mm at 1.57"]),
        ({"temperature": 26.9}, []),
        ({"temperature": 27.1}, ["temperature"]),
    ],
)
def test_another_motion_or_temperature_is_named_beyond_a_limit(changed, begins) -> None:
    how = {"frequency": 1.5, "temperature": 25.0} | changed
    first = replace(measured(1), temperature=25.0)
    second = replace(measured(1, frequency=how["frequency"]), temperature=how["temperature"])
    told = _said({"tests": (first,)}, {"tests": (second,)})
    assert len(told) == len(begins)
    assert all(begin in one for one, begin in zip(told, begins, strict=True))


# A few of the pairs that `python -m tests.comparison.false_alarms` counts by hundreds.


@pytest.fixture(scope="module")
def reference():
    return rig(duration=6.0)


@pytest.mark.slow
def test_noise_alone_is_not_called_a_difference(reference) -> None:
    for share, _, surely in shares(compared_pairs(reference, reference, 3)).values():
        assert share <= 0.1
        assert surely == 0.0


def test_one_per_cent_of_a_valve_is_found_and_a_tenth_of_it_is_not_made_up(reference) -> None:
    changed = compared_pairs(reference, rig(factor=1.0 + CHANGE, duration=6.0), 1)
    assert found(changed) == 1.0
    for line in changed[0].of("parameter"):
        if line.subject.name == "r_m1":
            assert line.percent_low <= 100.0 * CHANGE <= line.percent_high
    assert any(line.is_sure for line in changed[0].of("force"))
