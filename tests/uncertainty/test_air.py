"""The air on the rod, which the paper's equation leaves out: said where the logs show it."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from damperfit.configuration.loading import load_configuration
from damperfit.damper.purdy.closed_forms import incompressible_force
from damperfit.damper.purdy.parameters import Damper
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.identification import identify
from damperfit.simulation import simulate, sine_motion
from damperfit.uncertainty import Assessment, assess
from damperfit.uncertainty import grades as air
from damperfit.uncertainty.grades import air_objections
from tests.identification.rig import short_trace

AIR = 101325.0
ROD = {"rod_diameter": "22mm"}
WITHOUT = Damper(rod_diameter=0.022)
WITH = replace(WITHOUT, ambient_pressure=AIR)
FORCE = WITH.rod_area * AIR


def told(damper, *, noise=4.0, declared=ROD, **identification):
    """What is said of a log of a damper by somebody who leaves the air out."""
    configuration = load_configuration(
        overlay={"damper": declared, "identification": identification} if declared else {}
    )
    traces = [short_trace(10, damper=damper, noise=noise)]
    campaign = identify(traces, configuration.damper, configuration.identification)
    assessment = assess(campaign, configuration.damper)
    return air_objections(
        campaign, assessment, configuration.damper, configuration.identification, jobs=1
    )


def test_the_air_adds_its_pressure_times_the_rod_to_every_force():
    motion, y = sine_motion(0.02, 1.0, cycles=1, sample_rate=500), reference_parameters(10)
    apart = simulate(y, WITH, motion).force - simulate(y, WITHOUT, motion).force
    assert apart == pytest.approx(FORCE, rel=1e-9)
    assert WITH.rest_force(0.01) - WITHOUT.rest_force(0.01) == pytest.approx(FORCE)
    closed = [incompressible_force(y, one, [0.01], [0.2]) for one in (WITH, WITHOUT)]
    assert closed[0] - closed[1] == pytest.approx(FORCE)
    assert pytest.approx(38.52, abs=0.01) == FORCE
    assert WITH.sentence.endswith("air at 1.013 bar")
    assert "air" not in WITHOUT.sentence


def test_where_the_logs_show_the_air_the_grade_is_withheld():
    (said,) = told(WITH).values()
    assert said.kind == "dimensions"
    assert said.sentence.startswith(
        "the logs show the air on the rod, which the paper's equation leaves out: with 1.013 bar "
        "the MSE is "
    )
    assert said.sentence.endswith(
        'set damper.ambient_pressure = "1.013bara", unless gas_pressure is declared 1 bar too high'
    )


@pytest.mark.parametrize(
    ("damper", "declared", "identification"),
    [
        (WITHOUT, ROD, {}),
        (WITH, ROD, {"free": ["r_m1", "r_m2", "k_e", "f_0"]}),  # which takes its place
    ],
)
def test_nothing_is_said_where_it_is_not_there_or_not_left_out(damper, declared, identification):
    assert told(damper, declared=declared, **identification) == {}


@pytest.mark.parametrize(("of_the_noise", "is_told"), [(1.99, True), (2.01, False)])
def test_a_model_that_misses_by_twice_its_noise_says_nothing(monkeypatch, of_the_noise, is_told):
    configuration = load_configuration(overlay={"damper": ROD})
    traces = [short_trace(10, damper=WITH, noise=4.0)]
    campaign = identify(traces, configuration.damper, configuration.identification)
    (again,) = identify(traces, WITH, configuration.identification).fits
    (fit,) = campaign.fits
    monkeypatch.setattr(
        air,
        "identify",
        lambda *_, **__: SimpleNamespace(fits=[replace(again, mse_percent=0.1 * of_the_noise)]),
    )
    noise = SimpleNamespace(setting=fit.setting, noise_percent=0.1)
    seen = replace(Assessment(), diagnoses=(noise,))
    options = configuration.identification
    told = air_objections(campaign, seen, configuration.damper, options, jobs=1)
    assert bool(told) is is_told


@pytest.mark.parametrize(("mean", "is_certain"), [(3.99, False), (4.01, True)])
def test_the_squares_fall_by_four_standard_errors(mean, is_certain):
    around = np.array([-1.0, 1.0] * 8)  # sixteen cycles
    error = float(np.std(around, ddof=1)) / 4.0
    assert air._is_certain((around + mean * error).tolist()) is is_certain
