"""Two runs whose rigs were tared differently are of one damper."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from damperfit.adjustment.force_at import Sine, Stage
from damperfit.comparison import ComparedRun, ComparisonOptions, Sameness, compare_runs
from damperfit.comparison.comparing import _tare_notes, force_readings
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.damper.rivals import Bilinear
from damperfit.simulation import SolverOptions
from damperfit.tested.setting import Setting
from tests.fakes import fitted_run as fitted_run_of

SETTINGS = (Setting.of(1), Setting.of(2))
SINE = Sine(0.032, 1.5)
FREE = ("r_m1", "f_0")


def fitted(tare, *, is_free=True, factor=1.0):
    truth = reference_parameters(5)
    values = replace(truth, r_m1=factor * truth.r_m1, f_0=tare)
    free = FREE if is_free else FREE[:1]
    known = np.diag([1e-3, 1.0])[: len(free), : len(free)] ** 2
    row = {"n_cycles": 13, "n_logs": 1}
    for one in PURDY_DAMPER.quantities:
        status = "fitted" if one.name in free else "fixed"
        row |= {one.name: getattr(values, one.name), f"{one.name}_status": status}
        row |= {f"{one.name}_se": 1.0 if one.name == "f_0" else 1e-3 * row[one.name]}
    return fitted_run_of(
        PURDY_DAMPER,
        tuple(Stage(one, values, free, (), known) for one in SETTINGS),
        SINE,
        (),
        dict.fromkeys(SETTINGS, row),
        PURDY_DAMPER.quantities,
        SolverOptions(),
    )


def run(name, tare, **how):
    return ComparedRun(name, name, fitted(tare, **how), (), {})


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


def test_nobody_speaks_of_tares_that_there_are_not() -> None:
    runs = [run(name, 0.0, is_free=False) for name in "ab"]
    assert list(_tare_notes(runs, SETTINGS)) == []


def test_a_single_run_is_held_against_nominal_forces_as_its_rig_gave_them() -> None:
    (bare,), (whole,) = readings(run("a", 0.0)), readings(run("a", 25.0))
    for topic, one in whole.items():
        assert one.value - bare[topic].value == pytest.approx(25.0)


def test_beside_a_model_that_knows_no_gas_the_offsets_stay() -> None:
    model = Bilinear()
    values = model.values({"c_r": 2e3, "c_b": 1e3, "f_0": -120.0})
    plain = fitted(0.0)
    vars(plain)["settings"] = tuple(Stage(one, values) for one in SETTINGS)
    plain.configuration.damper = model
    a, b = run("a", 25.0), ComparedRun("b", "b", plain, (), {})
    paired, _ = force_readings((a, b), SETTINGS, speeds=(0.1,))
    (alone,) = readings(a)
    for topic, one in paired.items():
        assert one.value == alone[topic].value
