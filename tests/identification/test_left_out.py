"""Parts of a law that do nothing at a setting are left out there; what fits as well within wins."""

from __future__ import annotations

from dataclasses import replace

import pytest

from damperfit.damper.mounting import FIT, NONE, Friction, Mounting
from damperfit.damper.network import Valve
from damperfit.damper.rivals import BoucWen
from damperfit.identification import Campaign, Fit, FitOptions, identify
from damperfit.identification import procedures as left_out
from damperfit.identification.fit_problem import does_nothing
from damperfit.identification.outcome import Outcome, Status
from damperfit.recording import Trace
from damperfit.uncertainty import assess
from damperfit.uncertainty.grades import objections
from tests.laws.valve_logs import VALUES, damper, moved, noisy_trace

WITH_PLAY = replace(damper(), mounting=Mounting(FIT, FIT, NONE))


@pytest.fixture(scope="module")
def log() -> Trace:
    """Of a damper without play."""
    truth = damper(has_play_and_lag=False)
    motion = moved((0.06, 0.2), cycles=3)
    known = {name: value for name, value in VALUES.items() if name in truth.names}
    return noisy_trace(truth, known, motion, seed=1, force_noise=2.0, jitter=3e-6)


def fitted(log: Trace, *, is_leaving_out: bool) -> Fit:
    options = FitOptions("plain", is_leaving_out=is_leaving_out)
    (fit,) = identify([log], WITH_PLAY, options).fits
    return fit


@pytest.fixture(scope="module")
def strained(log: Trace) -> Fit:
    return fitted(log, is_leaving_out=False)


@pytest.fixture(scope="module")
def lean(log: Trace) -> Fit:
    return fitted(log, is_leaving_out=True)


def test_play_that_is_not_there_is_left_out(strained: Fit, lean: Fit) -> None:
    assert strained.outcome is Outcome.AT_BOUND
    lost = {name for name, status in lean.status.items() if status is Status.ABSENT}
    assert lost == {n for n, s in strained.status.items() if s is Status.AT_BOUND} == {"play"}
    assert lean.outcome is Outcome.CONVERGED
    assert lean.mse_percent == pytest.approx(strained.mse_percent, rel=1e-3)
    assert lean.parameters.rebound_opening == pytest.approx(VALUES["rebound_opening"], rel=0.02)
    assert [one.code for one in lean.warnings] == ["left-out"]


def test_the_grade_stands_where_nothing_strains_against_an_edge(strained: Fit, lean: Fit) -> None:
    for fit, is_withheld in ((strained, True), (lean, False)):
        campaign = Campaign("plain", (fit,))
        assert bool(objections(campaign, assess(campaign, WITH_PLAY))) is is_withheld


def test_a_port_that_lets_nothing_through_closes_its_blow_off(lean: Fit) -> None:
    model = replace(WITH_PLAY, rebound=Valve("orifice", "port"))
    values = model.values({one.name: 1.0 for one in model.quantities})
    for edge, part in zip(
        model.quantity("rebound_port").plausible,
        (["rebound_port"], ["rebound_opening", "rebound_slope", "rebound_port"]),
        strict=True,
    ):
        at = values.replace({"rebound_port": edge})
        assert does_nothing(at, "rebound_port")
        fit = replace(lean, parameters=at, status=dict.fromkeys(model.names, Status.FITTED))
        assert left_out._part(fit, "rebound_port") == part
    assert not does_nothing(values.replace({"rebound_port": 1e4}), "rebound_port")


def test_a_blow_off_without_a_straight_part_is_held_there(lean: Fit) -> None:
    """It opened in one setting by a hair, and its lift was at a bound there."""
    model = replace(WITH_PLAY, rebound=Valve("orifice", "lifting"))
    values = model.values({one.name: 1.0 for one in model.quantities})
    low, high = model.quantity("rebound_lift").plausible
    for edge, said in (
        (low, "does nothing here"),
        (high, "one above 100 1/bar, at which it is held"),
    ):
        at = values.replace({"rebound_lift": edge})
        assert does_nothing(at, "rebound_lift")
        assert said in left_out._sentence(at, "rebound_lift")
        fit = replace(lean, parameters=at, status=dict.fromkeys(model.names, Status.FITTED))
        assert left_out._part(fit, "rebound_lift") == ["rebound_lift"]
    assert not does_nothing(values.replace({"rebound_lift": 0.999 * high}), "rebound_lift")


@pytest.mark.parametrize(
    ("name", "side", "is_idle", "said"),
    [
        ("k_e", 1, True, "do not show the oil give: it is taken as rigid here"),
        ("k_e", 0, False, ""),
        ("gas_volume", 1, True, "gas pressure change with the stroke: it is taken as constant"),
        ("gas_volume", 0, False, ""),
        (
            "stribeck_speed",
            0,
            True,
            "the logs do not determine one below 5 mm/s, at which it is held",
        ),
        ("stribeck_speed", 1, True, "does nothing here"),
        ("breakaway", 0, True, "does nothing here"),
        ("breakaway", 1, False, ""),
    ],
)
def test_what_the_logs_do_not_show_is_held_and_said(lean: Fit, name, side, is_idle, said) -> None:
    model = replace(WITH_PLAY, friction=Friction(breakaway=FIT, stribeck_speed=FIT))
    values = model.values({one.name: 1.0 for one in model.quantities})
    values = values.replace({name: model.quantity(name).plausible[side]})
    assert does_nothing(values, name) is is_idle
    if is_idle:
        assert said in left_out._sentence(values, name)
    if name in {"stribeck_speed", "breakaway"}:
        fit = replace(lean, parameters=values, status=dict.fromkeys(model.names, Status.FITTED))
        is_low = (name, side) == ("stribeck_speed", 0)
        part = ["stribeck_speed"] if is_low else ["breakaway", "stribeck_speed"]
        assert left_out._part(fit, name) == part


def test_a_blow_off_that_never_opens_has_no_slope(strained: Fit) -> None:
    """Its preload at the edge says nothing of its resistance: both are left out together."""
    fit = strained
    closed = fit.parameters.replace(
        {"rebound_opening": fit.parameters.quantity("rebound_opening").plausible[1]}
    )
    part = left_out._part(replace(fit, parameters=closed), "rebound_opening")
    assert part == ["rebound_opening", "rebound_slope"]
    loose = fit.parameters.replace(
        {"rebound_slope": fit.parameters.quantity("rebound_slope").plausible[0]}
    )
    part = left_out._part(replace(fit, parameters=loose), "rebound_slope")
    assert part == ["rebound_slope"]


def test_a_turn_at_an_edge_is_held_there_and_keeps_its_grade() -> None:
    """Back on a straight line, sigma = 1/2, and n = 1: what most publications take."""
    truth, motion = BoucWen(), moved((0.06, 0.2), cycles=4, rate=1000.0)
    numbers = {"alpha": 500.0, "rho": 1.5e3, "sigma": 0.5, "n": 1.0, "c_r": 900.0, "c_b": 900.0}
    numbers |= {"k": 0.0, "f_0": 5.0}
    log = noisy_trace(truth, numbers, motion, seed=2, force_noise=4.0, jitter=8e-6)
    campaign = identify([log], truth, FitOptions("plain", is_leaving_out=True))
    (fit,) = campaign.fits
    assert Status.FIXED in {fit.status["sigma"], fit.status["n"]}
    assert Status.AT_BOUND not in fit.status.values()
    assert fit.outcome is Outcome.CONVERGED
    assert fit.parameters.alpha == pytest.approx(500.0, rel=0.01)
    assert "left-out" in {one.code for one in fit.warnings}
    assert objections(campaign, assess(campaign, truth)) == {}
