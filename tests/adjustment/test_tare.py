"""A rig is tared before each test: its offset is no force of the damper, no effect of a click."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from damperfit.adjustment import (
    Adjustment,
    Sine,
    Stage,
    beside_measured,
    clicks,
    credible_forces,
    levels,
    which_setting,
)
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.damper.rivals.linear import Bilinear
from damperfit.queries.adjuster_results import AdjusterResults
from damperfit.queries.force_by_setting import Question, tabulate_forces
from damperfit.simulation import SolverOptions
from damperfit.tested.setting import Setting
from damperfit.uncertainty import SpeedForces

SINE = Sine(0.032, 1.5)
TARES = (11.6, 36.6, -3.4)
OWN = ("r_m1", "k_e", "f_0")
AT = {"speeds": (0.1,)}


def stages(tares=TARES, covariance=None, settings=(5, 5, 5)):
    own = () if covariance is None else OWN
    return [
        Stage(Setting.of(n), replace(reference_parameters(k), f_0=tare), own, (), covariance)
        for n, (k, tare) in enumerate(zip(settings, tares, strict=True), start=1)
    ]


def covariance(correlation):
    """Of ln r_m1, ln k_e and f_0 in N, whose error is 5 N."""
    errors = np.array([1e-2, 2e-2, 5.0])
    matrix = np.eye(3)
    matrix[0, 2] = matrix[2, 0] = correlation
    return matrix * np.outer(errors, errors)


def test_a_tare_changes_no_force_and_is_no_effect_of_a_click() -> None:
    found = levels(stages(), PURDY_DAMPER, SINE, **AT)
    bare = levels(stages((0.0,) * 3), PURDY_DAMPER, SINE, **AT)
    assert [one.force for one in found] == pytest.approx([one.force for one in bare], abs=1e-9)
    for click in clicks(found, PURDY_DAMPER):
        assert click.change == pytest.approx(0.0, abs=1e-9)
        assert click.percent == pytest.approx(0.0, abs=1e-9)


def test_a_constant_tare_is_no_damping() -> None:
    different = (5, 6, 7)
    found, bare = (
        clicks(levels(stages(tares, settings=different), PURDY_DAMPER, SINE, **AT), PURDY_DAMPER)
        for tares in ((12.0,) * 3, (0.0,) * 3)
    )
    assert [one.percent for one in found] == pytest.approx([one.percent for one in bare])


@pytest.mark.parametrize("correlation", [-0.9, 0.0, 0.9])
def test_the_error_of_a_tare_is_none_of_the_damper(correlation) -> None:
    known = covariance(correlation)
    alone = [Stage(one.setting, one.parameters, OWN[:2], (), known[:2, :2]) for one in stages()]
    found = levels(stages(covariance=known), PURDY_DAMPER, SINE, **AT)
    expected = levels(alone, PURDY_DAMPER, SINE, **AT)
    for one, bare in zip(found, expected, strict=True):
        assert one.error == pytest.approx(bare.error)
        assert one.whole.error != pytest.approx(bare.error, rel=0.05)
    for one, bare in zip(clicks(found, PURDY_DAMPER), clicks(expected, PURDY_DAMPER), strict=True):
        assert one.high - one.low == pytest.approx(bare.high - bare.low)


def test_the_whole_force_has_the_tare_and_its_error() -> None:
    known = covariance(0.0)
    for one in levels(stages(covariance=known), PURDY_DAMPER, SINE, **AT):
        assert one.whole.force - one.force == pytest.approx(one.tare)
        assert one.whole.error == pytest.approx(np.hypot(one.error, 5.0))
        whole = one.whole
        assert whole.whole is whole


def test_no_setting_gives_a_force_by_its_tare() -> None:
    found = [one for one in levels(stages(), PURDY_DAMPER, SINE, **AT) if one.stroke == "rebound"]
    assert which_setting(found, found[0].force + 20.0).answers == ()


def measured(found, *, difference):
    """As a rig tells them, tare and all."""
    return [
        SpeedForces(
            one.setting, one.stroke, SINE.amplitude, SINE.frequency, 500.0,
            (0.05, 0.1), (one.whole.force + difference,) * 2, (0.5,) * 2, (difference,) * 2,
            (0.0,) * 2,
        )
        for one in found
    ]  # fmt: skip


def test_measured_forces_beside_the_model_are_without_it_too() -> None:
    modelled = levels(stages(covariance=covariance(0.0)), PURDY_DAMPER, SINE, **AT)
    found = beside_measured(modelled, measured(modelled, difference=80.0), SINE)
    for one in found:
        assert one.measured == pytest.approx(one.force + 80.0)
        assert one.rounding == pytest.approx(0.0, abs=1e-9)
    told = credible_forces(found)
    assert all(one.is_measured for one in told)
    # What is taken off a measured force has an error.
    assert all(one.error == pytest.approx(np.hypot(0.5, 5.0)) for one in told)
    for click in clicks(told, PURDY_DAMPER):
        assert click.change == pytest.approx(0.0, abs=1e-9)
    whole = beside_measured(
        [one.whole for one in modelled], measured(modelled, difference=80.0), SINE
    )
    for one, bare in zip(whole, found, strict=True):
        assert one.measured == pytest.approx(bare.measured + bare.tare)
        assert bare.whole.measured == pytest.approx(one.measured)


def test_where_no_gas_is_known_the_offset_stays_in_the_force_and_out_of_the_click() -> None:
    model = Bilinear()
    told = [
        Stage(Setting.of(n), model.values({"c_r": 2000.0, "c_b": 1500.0, "f_0": offset}))
        for n, offset in enumerate((-120.0, -95.0), start=1)
    ]
    found = levels(told, model, SINE, **AT)
    by_stroke = {one.stroke: one.force for one in found if one.setting == Setting.of(1)}
    assert by_stroke == pytest.approx({"rebound": 80.0, "bump": -270.0}, abs=0.1)
    for click in clicks(found, model):
        assert click.change == pytest.approx(0.0, abs=1e-9)
    harder = [
        replace(one, parameters=one.parameters.replace(c_r=2000.0 * factor))
        for one, factor in zip(told, (1.0, 1.1), strict=True)
    ]
    rebound, _ = clicks(levels(harder, model, SINE, **AT), model)
    assert rebound.percent == pytest.approx(10.0, abs=0.01)


@pytest.mark.parametrize(
    ("tares", "said"),
    [
        ((0.0, 0.0, 0.0), None),
        ((12.0, 12.0, 12.0), "the force offset (12 N) is the rig's tare"),
        (TARES, "the force offset (-3.4 to 36.6 N) is the rig's tare"),
    ],
)
def test_one_line_says_that_a_tare_is_left_out(tares, said) -> None:
    adjuster = AdjusterResults(
        tuple(stages(tares)), PURDY_DAMPER, SINE, "the test's sine", SolverOptions(), ()
    )
    notes = tabulate_forces(adjuster, Question(0.1)).notes
    if said is None:
        assert not any("offset" in note for note in notes)
    else:
        assert sum(note.startswith(said) for note in notes) == 1


def test_an_offset_that_holds_the_gas_force_is_told_otherwise() -> None:
    model = Bilinear()
    told = Stage(Setting.of(1), model.values({"c_r": 2e3, "c_b": 1e3, "f_0": -120.0}))
    adjuster = AdjusterResults((told,), model, SINE, "the test's sine", SolverOptions(), ())
    (note,) = tabulate_forces(adjuster, Question(0.1)).notes
    assert note.startswith("the model knows no gas: its force offset (-120 N)")


def test_the_report_says_that_tares_are_left_out() -> None:
    found = levels(stages(), PURDY_DAMPER, SINE, **AT)
    (said,) = Adjustment(levels=found).sentences
    assert said.startswith("forces by setting: the force offset (-3.4 to 36.6 N) is the rig's tare")
    bare = levels(stages((0.0,) * 3), PURDY_DAMPER, SINE, **AT)
    assert Adjustment(levels=bare).sentences == ()
    assert Adjustment(levels=found).of_offset == (said,)  # run.json keeps it for the page


def test_what_stands_beside_the_measured_force_has_the_tare() -> None:
    """The table of forces is that of the logs, its clicks are those of the damper."""
    bare = levels(stages(), PURDY_DAMPER, SINE, **AT)
    whole = [one.whole for one in bare]
    for one, other in zip(bare, whole, strict=True):
        assert other.force == pytest.approx(one.force + one.tare)
    for one, other in zip(clicks(bare, PURDY_DAMPER), clicks(whole, PURDY_DAMPER), strict=True):
        assert one.change == pytest.approx(other.change, abs=1e-9)
        assert one.percent == pytest.approx(other.percent, abs=1e-9)
