"""Parts of a law that do nothing at a setting are left out there; what fits as well within wins."""

from __future__ import annotations

from dataclasses import replace

import pytest

from damperfit.damper.mounting import FIT, NONE, Friction, Mounting
from damperfit.damper.network import Valve
from damperfit.damper.rivals import BoucWen
from damperfit.identification import Campaign, Fit, FitOptions, Outcome, Status, identify
from damperfit.identification.fit_problem import does_nothing
from damperfit.identification.procedures import _part, _sentence
from damperfit.recording import Trace
from damperfit.uncertainty import assess
from damperfit.uncertainty.grades import objections
from tests.laws.valve_logs import VALUES, damper, moved, noisy_trace

WITH_PLAY = replace(damper(), mounting=Mounting(FIT, FIT, NONE))


@pytest.fixture(scope="module")
def log() -> Trace:
    """Of a damper without play."""
    truth = damper(has_play_and_lag=False)
    known = {name: value for name, value in VALUES.items() if name in truth.names}
    motion = moved((0.06, 0.2), cycles=3)
    return noisy_trace(truth, known, motion, seed=1, force_noise=2.0, jitter=3e-6)


def fitted(log: Trace, *, is_leaving_out: bool) -> Fit:
    options = FitOptions("plain", is_leaving_out=is_leaving_out)
    return identify([log], WITH_PLAY, options).fits[0]


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
    # The grade stands where nothing strains against an edge.
    for fit, is_withheld in ((strained, True), (lean, False)):
        campaign = Campaign("plain", (fit,))
        assert bool(objections(campaign, assess(campaign, WITH_PLAY))) is is_withheld


VALVE = {
    "bare": Valve("orifice"),
    "port": Valve("orifice", "port"),
    "power": Valve("orifice", "power"),
}
AT_REST = ["breakaway", "stribeck_speed"]


@pytest.mark.parametrize(
    ("valve", "name", "side", "said", "part"),
    [
        # A port that lets nothing through closes its blow-off.
        ("port", "rebound_port", 0, "does nothing here", ["rebound_port"]),
        ("port", "rebound_port", 1, "does nothing here",
         ["rebound_opening", "rebound_slope", "rebound_port"]),
        ("power", "rebound_power", 0, "", []),
        ("power", "rebound_power", 1, "", []),
        # The preload of a blow-off that never opens says nothing of its resistance.
        ("bare", "rebound_opening", 1, "does nothing here", ["rebound_opening", "rebound_slope"]),
        ("bare", "rebound_slope", 0, "does nothing here", ["rebound_slope"]),
        ("bare", "k_e", 1, "do not show the oil give: it is taken as rigid here", ["k_e"]),
        ("bare", "k_e", 0, "", []),
        ("bare", "gas_volume", 1, "gas pressure change with the stroke: it is taken as constant",
         ["gas_volume"]),
        ("bare", "gas_volume", 0, "", []),
        ("bare", "stribeck_speed", 0, "not determine one below 5 mm/s, at which it is held",
         ["stribeck_speed"]),
        ("bare", "stribeck_speed", 1, "does nothing here", AT_REST),
        ("bare", "breakaway", 0, "does nothing here", AT_REST),
        ("bare", "breakaway", 1, "", []),
    ],
)  # fmt: skip
def test_what_does_nothing_at_an_edge_is_left_out_with_its_part_and_said(
    lean: Fit, valve, name, side, said, part
) -> None:
    friction = Friction(breakaway=FIT, stribeck_speed=FIT)
    model = replace(WITH_PLAY, rebound=VALVE[valve], friction=friction)
    edge = model.quantity(name).plausible[side]
    values = model.values({one.name: 1.0 for one in model.quantities} | {name: edge})
    assert does_nothing(values, name) is bool(said)
    if said:
        assert said in _sentence(values, name)
        fit = replace(lean, parameters=values, status=dict.fromkeys(model.names, Status.FITTED))
        assert _part(fit, name) == part
    within = values.replace({name: edge * 0.999 if side else edge * 1.001})
    assert not does_nothing(within, name)


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
