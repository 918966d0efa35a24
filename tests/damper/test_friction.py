"""Friction that pre-slides, is larger at rest, grows with pressure: golden values, twin, slopes."""

import dataclasses

import numpy as np
import pytest

from damperfit.configuration.loading import load_configuration
from damperfit.damper.mounting import Friction, Mounting
from damperfit.damper.network import simulate_network
from damperfit.damper.valve_dampers import ThroughFlow
from damperfit.errors import ConfigurationError
from damperfit.identification import FitOptions, identify
from damperfit.simulation import Motion, SolverOptions, sine_motion
from tests.damper.test_network import CASES, SHARP, check_by_the_twin, check_slopes, resting, run
from tests.damper.test_valve_dampers import VALVES, damper, log

RIGID = {"k_s": 0.0, "play": 0.0, "drag": 0.0}
ELASTIC = {"k_s": 1e6, "play": 0.0, "drag": 40.0}
PLAY = {"k_s": 3e5, "play": 7e-4, "drag": 40.0}
PRESLIDES = {"presliding": 3e-5}
STRIBECK = {"breakaway": 20.0, "stribeck_speed": 0.02}
PRESSED = {"seal_area": 1e-5}
TURNS = {"turning_speed": 8e-3}
ALL = {**PRESLIDES, **STRIBECK, **PRESSED}
EACH = {
    "presliding": PRESLIDES, "stribeck": STRIBECK, "pressed": PRESSED, "all": ALL, "turns": TURNS,
}  # fmt: skip

# Case b (valves.md) with more friction, 4th cycle: force N. The core and SciPy's Radau agree.
PHASES = (0.02, 0.1, 0.26, 0.3, 0.6, 0.77)
GOLDEN = {
    "presliding": (RIGID | PRESLIDES, (270.083, 258.704, 78.103, -263.214, -358.929, -16.219)),
    "all": (RIGID | ALL, (284.601, 272.642, 66.690, -270.735, -367.041, 3.853)),
    "elastic": (ELASTIC | ALL, (289.468, 276.773, 166.450, -187.871, -371.036, -151.376)),
    "play": (PLAY | ALL, (289.328, 277.030, 197.598, 0.000, -370.915, -242.454)),
}


@pytest.mark.parametrize(("numbers", "expected"), GOLDEN.values(), ids=GOLDEN)
def test_golden_values(numbers, expected):
    at = [3000 + round(1000 * q) for q in PHASES]
    assert run("b", **numbers).force[at] == pytest.approx(expected, abs=0.02)


@pytest.mark.parametrize(
    ("mounting", "more"),
    [
        pytest.param(
            mounting,
            more,
            id=f"{held}-{kind}",
            # Behind a mounting all kinds at once; one by one where nothing else gives way.
            marks=[] if mounting is RIGID or more in (ALL, TURNS) else pytest.mark.slow,
        )
        for held, mounting in (("rigid", RIGID), ("elastic", ELASTIC), ("play", PLAY))
        for kind, more in EACH.items()
    ],
)
def test_sensitivities_are_those_of_central_differences(more, mounting):
    held = {**mounting, **more}
    passed = 30 if mounting["play"] else 20 if mounting["k_s"] else 4
    check_slopes("b", resting("b") | CASES["b"][1] | held, held, passed=passed)


@pytest.mark.parametrize("name", ["b", pytest.param("e", marks=pytest.mark.slow)])
@pytest.mark.parametrize("mounting", [RIGID, pytest.param(PLAY, marks=pytest.mark.slow)])
@pytest.mark.parametrize("more", [ALL, TURNS], ids=["all", "turns"])
def test_the_slow_twin_agrees_on_a_rough_motion(name, mounting, more):
    check_by_the_twin(name, mounting, **more)


@pytest.mark.parametrize("mounting", [RIGID, ELASTIC], ids=["rigid", "elastic"])
def test_a_short_presliding_fades_to_coulombs_friction(mounting):
    sharp = run("b", cycles=2, **mounting).force
    gaps = [
        float(np.mean(np.abs(run("b", cycles=2, presliding=way, **mounting).force - sharp)))
        for way in (2e-4, 5e-5, 1.25e-5)
    ]
    # Beside a turn the way grows with the square of the time.
    assert gaps[1:] == pytest.approx([gaps[0] / 2, gaps[0] / 4], rel=0.2)


def test_presliding_is_a_spring_first_and_loses_what_it_rubs():
    """From rest it is f_f/presliding stiff; a closed loop of it turns work into heat."""
    still = sine_motion(1e-6, 1.0, cycles=1, sample_rate=1000)
    network, values, damper, _ = CASES["b"]
    some = {**values, "presliding": 5e-5}
    there = simulate_network(network, some, damper, still).force
    gone = simulate_network(network, {**values, "f_f": 0.0}, damper, still).force
    stiffness = (there - gone)[100] / still.displacement[100]
    assert stiffness == pytest.approx(values["f_f"] / 5e-5, rel=0.02)
    loop = sine_motion(2e-3, 1.0, cycles=2, sample_rate=1000)
    rubbed = (
        simulate_network(network, some, damper, loop).force
        - simulate_network(network, {**values, "f_f": 0.0}, damper, loop).force
    )[1000:]
    work = float(np.sum(rubbed * loop.velocity[1000:]) * loop.interval)
    assert 0.9 * values["f_f"] * 8e-3 < work < values["f_f"] * 8e-3


def test_a_turn_within_a_sample_is_found():
    """A triangle whose corners lie between the samples: the way to the corner and back counts."""
    network, values, damper, _ = CASES["b"]
    some = {**values, "presliding": 2e-4, "f_f": 200.0}
    fine = sine_motion(1e-3, 3.0, cycles=2, sample_rate=24_000)
    x, v = fine.displacement[7:], fine.velocity[7:]
    coarse, shifted = Motion(fine.interval * 64, x[::64], v[::64]), Motion(fine.interval, x, v)
    one = simulate_network(network, some, damper, shifted, options=SHARP).force[::64]
    other = simulate_network(network, some, damper, coarse, options=SHARP).force
    assert np.max(np.abs(one - other)) < 0.2


def fitted(values, free=None, **friction):
    """A through-flow damper with such a friction, its log, and what a fit of it finds."""
    model = dataclasses.replace(
        damper(ThroughFlow), friction=Friction(**friction), mounting=Mounting(4e5)
    )
    truth = model.values({**VALVES, "return_slope": 2e5, **values})
    one = log(model, truth, speed=0.13)
    noise = np.random.default_rng(3).normal(0.0, 1.0, len(one.force))
    one = dataclasses.replace(one, force=one.force + noise)
    free = free or tuple(q.name for q in model.quantities if q.default is None)
    options = FitOptions("plain", free=free, solver=SolverOptions(tolerance=1e-2))
    (fit,) = identify([one], model, options).fits
    return fit


@pytest.mark.parametrize(
    ("law", "free"),
    [
        ({"presliding": 1.5e-4, "f_f": 40.0}, None),
        ({"breakaway": 40.0, "stribeck_speed": 0.03}, None),
        ({"turning_speed": 2e-2, "f_f": 40.0}, None),
        ({"free_gas": 0.01}, (*(name for name in VALVES if name != "drag"), "free_gas")),
    ],
    ids=["presliding", "stribeck", "turning", "free gas"],
)
def test_friction_and_free_gas_are_found_again(law, free):
    fit = fitted(law, free, **({} if free else dict.fromkeys(law.keys() - {"f_f"}, "fit")))
    assert {name: getattr(fit.parameters, name) for name in law} == pytest.approx(law, rel=0.1)
    assert fit.mse_percent < 3 * 100 / np.var(fit.logs[0].trace.force)


@pytest.mark.parametrize(
    ("declared", "said"),
    [
        ({"presliding": "some"}, "presliding: found 'some'; expected a number, 'none' or 'fit'"),
        ({"presliding": 0.0}, "presliding: found 0; expected 1e-07 to 0.01 m"),
        ({"presliding": 20.0}, "presliding: found 20; expected"),
        ({"breakaway": "fit"}, "stribeck_speed: found 'none'"),
        ({"stribeck_speed": 0.1}, "breakaway: found 'none'"),
        ({"presliding": "fit", "turning_speed": 2e-3}, "turning_speed: found beside presliding"),
    ],
)
def test_what_is_no_declaration_is_refused(declared, said):
    with pytest.raises(ConfigurationError, match=said):
        Friction(**declared)


def test_toml_declares_it_with_units():
    told = {"presliding": "30um", "breakaway": "12N", "stribeck_speed": "20mm/s"}
    friction = {**told, "seal_area": "4mm2"}
    made = load_configuration(overlay={"damper": {"model": "twin_tube", "friction": friction}})
    found = made.damper.friction
    assert dataclasses.astuple(found)[:4] == pytest.approx((3e-5, 12.0, 0.02, 4e-6))
    assert found.turning_speed == "none"
    turns = {"damper": {"model": "twin_tube", "friction": {"turning_speed": "2mm/s"}}}
    assert load_configuration(overlay=turns).damper.friction.turning_speed == pytest.approx(2e-3)
    with pytest.raises(ConfigurationError, match=r"unknown key 'presliding_way' in \[damper.fric"):
        load_configuration(
            overlay={"damper": {"model": "twin_tube", "friction": {"presliding_way": "fit"}}}
        )


@pytest.mark.parametrize("mounting", [RIGID, ELASTIC], ids=["rigid", "elastic"])
def test_below_the_solvers_dead_band_friction_turns_as_it_did(mounting):
    sharp, below, above = (
        run("b", cycles=1, sensitivities=("turning_speed",), turning_speed=speed, **mounting)
        for speed in (0.0, 0.9e-4, 2e-3)
    )
    np.testing.assert_array_equal(below.force, sharp.force)
    assert not below.sensitivities["turning_speed"].any()
    assert np.max(np.abs(above.force - sharp.force)) > 1.0


@pytest.mark.parametrize("mounting", [RIGID, ELASTIC, PLAY], ids=["rigid", "elastic", "play"])
def test_the_bias_of_a_usual_tolerance_is_below_it(mounting):
    usual, sharp = (
        run("b", options=options, per_cycle=300, **mounting, **ALL).force[600:]
        for options in (SolverOptions(tolerance=1e-2), SHARP)
    )
    assert np.sqrt(np.mean((usual - sharp) ** 2)) < 0.15
