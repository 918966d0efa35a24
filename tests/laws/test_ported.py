"""Ports that take most of the pressure: read off the loops, and told by the search for a law."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from damperfit.conditioning import condition
from damperfit.damper.mounting import Mounting
from damperfit.damper.network import Valve
from damperfit.damper.valve_curves import ValveCurve
from damperfit.damper.valve_dampers import Monotube
from damperfit.identification import FitOptions, identify
from damperfit.laws import SettingLogs, search_laws
from damperfit.laws.course import valve_damper
from damperfit.laws.search import _Search
from damperfit.recording import Recording, Trace
from damperfit.simulation import SolverOptions, simulate
from damperfit.tested.setting import Setting
from tests.laws.valve_logs import moved

PORTED = Valve("orifice", "port")
GEOMETRY = {
    "rod_diameter": 0.011, "piston_diameter": 0.030, "oil_density": 850.0, "gas_pressure": 1.5e6,
}  # fmt: skip
TRUTH = {
    "rebound_bleed": 7e4, "rebound_opening": 4e5, "rebound_slope": 1e6, "rebound_port": 1.1e4,
    "compression_bleed": 6e4, "compression_opening": 3e5, "compression_slope": 1e6,
    "compression_port": 9e3, "k_e": 1e9, "f_f": 20.0, "f_0": 0.0,
}  # fmt: skip


def damper(valve: Valve = PORTED, mounting: Mounting = Mounting("none")) -> Monotube:
    return Monotube(rebound=valve, compression=valve, mounting=mounting, **GEOMETRY)


@pytest.fixture(scope="module")
def log() -> Trace:
    motion = moved((0.1, 0.35), cycles=4, rate=500.0)
    truth = {name: TRUTH[name] for name in damper().names if name in TRUTH}
    force = simulate(damper().values(truth), damper(), motion).force
    chance, n = np.random.default_rng(5), len(force)
    x = motion.displacement + chance.normal(0.0, 3e-6, n)
    time = motion.interval * np.arange(n)
    own = force + chance.normal(0.0, 2.0, n)
    return condition(Recording("1.csv", "", "", Setting.of(1), time, x, own))


def curve(port: float) -> ValveCurve:
    """A bleed, and a port behind an opening of 0.4 MPa, of which no flow is linear."""
    drop = np.linspace(1e3, 3e6, 400)
    flow = 3e-8 * np.sqrt(drop) + port * np.sqrt(np.maximum(drop - 4e5, 0.0))
    return ValveCurve(drop, flow, 0.0, 0.0, 0.0, 0.0, has_knee=False)


def test_a_port_is_read_off_the_flow_beside_a_bleed() -> None:
    bleed, opening, port = curve(8e-8).ported or (0.0, 0.0, 0.0)
    assert bleed == pytest.approx(3e-8, rel=0.05)
    assert opening == pytest.approx(4e5, rel=0.1)
    assert port == pytest.approx(8e-8, rel=0.05)
    assert curve(0.0).ported is None


@pytest.mark.parametrize(("share", "is_read"), [(0.052, True), (0.048, False)])
def test_a_port_takes_a_twentieth_of_the_flow(*, share: float, is_read: bool) -> None:
    """Of a bleed's flow and its own: a knee at 0.4 MPa lets it read within a tenth."""
    port = share / (1.0 - share * np.sqrt(1.0 - 4e5 / 3e6)) * 3e-8
    assert (curve(port).ported is not None) is is_read


def test_ports_that_are_declared_are_found_from_the_loops(log: Trace) -> None:
    """From a start with small ports the fit ended at 0.1 %, with a friction of 100 N."""
    (fit,) = identify([log], damper(), FitOptions("plain")).fits
    assert fit.mse_percent < 0.01
    for name in ("rebound_opening", "compression_opening", "rebound_port", "compression_port"):
        assert getattr(fit.parameters, name) == pytest.approx(TRUTH[name], rel=0.03), name


def test_a_port_is_not_taken_for_a_bleed_beside_friction(log: Trace) -> None:
    """Linear blow-offs gain little and are thinned out, and the friction is that of the preload."""
    bare = damper(Valve("orifice", "linear"), Mounting("fit", "fit", "fit"))
    found = search_laws(bare, (bare,), [SettingLogs(Setting.of(1), (log,))])
    law = valve_damper(found.chosen)
    assert (law.rebound.blow_off, law.compression.blow_off) == ("port", "port")
    values = found.chosen.fits[0].values
    assert values.f_f == pytest.approx(20.0, abs=3.0)
    assert values.rebound_opening == pytest.approx(4e5, rel=0.05)
    said = [one for one in found.laws if one.change == "blow-offs without a port"]
    assert len(said) == 1
    assert "with a port behind each" in said[0].reason


def tried(mse: float, *, held: float = 1.0, leaves: bool = True) -> SimpleNamespace:
    fit = SimpleNamespace(model=damper(Valve("orifice", "linear")))
    score = math.log(mse * held)
    return SimpleNamespace(fits=(fit,), mse_percent=mse, score=score, leaves_something=leaves)


@pytest.mark.parametrize(
    ("bare", "ported", "is_taken"),
    [
        (tried(0.151), tried(0.1), True),
        (tried(0.149), tried(0.1), False),
        (tried(0.15, held=1.01), tried(0.09, held=1.1), True),  # of both 1.53
        (tried(0.15), tried(0.09, held=1.15), False),  # what was held out is predicted worse: 1.45
        (tried(0.151, leaves=False), tried(0.1), False),
    ],
)
def test_ports_are_tried_where_they_fit_and_predict_better_by_half(
    *, bare: SimpleNamespace, ported: SimpleNamespace, is_taken: bool, monkeypatch
) -> None:
    asked = []
    course = _Search([], SolverOptions(), lambda _: None, 1)
    monkeypatch.setattr(course, "all_fitted", lambda models: asked.append(models) or [ported])
    assert course.ported([bare]) == [ported if is_taken else bare]
    assert len(asked) == bare.leaves_something
    told = [(one.tried, one.change) for one in course.laws]
    refused = [(ported, "blow-offs with a port")] if bare.leaves_something else []
    assert told == ([(bare, "blow-offs without a port")] if is_taken else refused)
    assert not any(one.is_taken for one in course.laws)


@pytest.mark.parametrize(("times", "n"), [(7.9, 2), (8.1, 1)])
def test_ports_are_tried_in_layouts_that_are_not_far_worse(times: float, n: int, monkeypatch):
    asked = []
    course = _Search([], SolverOptions(), lambda _: None, 1)
    monkeypatch.setattr(course, "all_fitted", lambda models: asked.extend(models) or [])
    found = [tried(0.1), tried(0.1 * times)]
    assert course.ported(found) == found
    assert len(asked) == n
    assert all(one.rebound.blow_off == "port" for one in asked)
