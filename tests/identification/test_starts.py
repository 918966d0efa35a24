"""Where fits start: as somebody says, and at many places; one minimum is called one."""

from dataclasses import replace
from itertools import chain, repeat

import numpy as np
import pytest

from damperfit.damper.mounting import FIT, NONE, Friction, Mounting
from damperfit.damper.network import Valve
from damperfit.damper.purdy.parameters import PURDY_DAMPER, Parameters, reference_parameters
from damperfit.damper.rivals import BoucWen
from damperfit.errors import SimulationError
from damperfit.identification import (
    Campaign,
    Fit,
    FitOptions,
    GivenStart,
    Outcome,
    Status,
    check_options,
    identify,
)
from damperfit.identification import fit_setting as starts
from damperfit.identification.fit_problem import Block, Point, does_nothing
from damperfit.identification.fit_setting import (
    SPREAD,
    FitResult,
    describe_searches,
    fit_from,
    spread_starts,
)
from damperfit.identification.least_squares import LinearSystem, Minimum
from damperfit.identification.procedures import ProcedureInput, _part, _sentence
from damperfit.recording import Trace
from damperfit.tested.setting import Setting
from damperfit.uncertainty import assess
from damperfit.uncertainty.grades import objections
from tests.identification.rig import errors, trace
from tests.laws.valve_logs import VALUES, damper, moved, noisy_trace

FREE = ("r_m1", "r_m2", "k_e")
KNOWN = {"r_m3": 2.597e6, "f_f": 50.0}
HERE = reference_parameters(9)


def problem(free: tuple[str, ...] = FREE, setting: int = 9) -> Block:
    log = trace(setting, noise=4.0, duration=4.0)
    return Block(PURDY_DAMPER, (log,), free, FitOptions().solver)


def ended(
    parameters: Parameters, mse: float, outcome: Outcome = Outcome.CONVERGED, **status: str
) -> FitResult:
    named = dict.fromkeys(FREE, "fitted") | status
    system = LinearSystem(np.array([0.0, 0.0, 0.0, np.sqrt(0.01 * mse)]), np.eye(4, 3))
    is_cavitating = outcome is Outcome.CAVITATING
    at = Point({9: parameters}, {9: mse}, {9: 400.0}, is_cavitating, {9: 1.0}, None)
    return FitResult(
        FREE, parameters, Minimum(np.zeros(3), system, at, 10, 0, 1, np.zeros(3, dtype=bool)),
        {name: Status(word) for name, word in named.items()}, outcome, dict.fromkeys(FREE, 1e-3),
    )  # fmt: skip


@pytest.fixture
def searched(monkeypatch: pytest.MonkeyPatch):
    """A search whose fits end as told; None stands for a start that cannot be simulated."""

    def search(*ends: FitResult | None):
        left = iter(ends)

        def fit(*_args: object, **_kwargs: object) -> FitResult:
            end = next(left)
            if end is None:
                raise SimulationError("simulation failed at the start.")
            return end

        monkeypatch.setattr(starts, "fit_setting", fit)
        return fit_from(9, problem(), HERE, starts=len(ends))

    return search


def test_starts_are_spread_over_the_whole_range_and_always_the_same() -> None:
    block = problem((*FREE, "f_0"))
    found = spread_starts(block, HERE, 9, 8)
    assert found == spread_starts(block, HERE, 9, 8)
    assert found != spread_starts(block, HERE, 10, 8)
    for name in FREE:
        away = np.log([getattr(y, name) / getattr(HERE, name) for y in found]) / np.log(SPREAD)
        # One start in each eighth of the range from a tenth to ten times.
        assert sorted(np.floor((away + 1.0) * 4.0)) == list(range(8))
    assert all(y.r_m3 == HERE.r_m3 for y in found)
    assert max(abs(y.f_0) for y in found) <= 300.0
    assert min(y.f_0 for y in found) < -200.0


def test_the_way_out_of_the_cavitating_minimum_is_found_and_used(monkeypatch) -> None:
    truth = reference_parameters(18)
    local = replace(truth, r_m3=4.4e6, f_f=1.0)
    first = ended(local, 1.0, Outcome.CAVITATING, r_m3="fitted", f_f="fitted")
    fits = chain([lambda *_, **__: first], repeat(starts.fit_setting))
    monkeypatch.setattr(starts, "fit_setting", lambda *a, **k: next(fits)(*a, **k))  # noqa: PLW0108
    best, found = fit_from(18, problem((*FREE, *KNOWN), 18), local, starts=6)
    assert found.is_improved
    assert best.outcome is Outcome.CONVERGED
    assert abs(errors(best.values, truth)["r_m3"]) < 0.05
    assert "a better minimum" in found.warning
    assert len(found.minima) >= 2


def test_minima_that_fit_equally_well_are_told(searched) -> None:
    there = replace(HERE, k_e=2.0 * HERE.k_e)
    best, found = searched(ended(HERE, 0.0100), None, ended(there, 0.01001))
    assert (best.values, best.evaluations) == (HERE, 20)
    assert found.is_ambiguous
    assert not found.is_improved
    assert found.n_failed == 1
    assert found.warning == "different minima fit equally well: k_e 6.213e+08 or 1.243e+09"
    (said,) = describe_searches([found])
    assert "3 starts of which 1 could not be simulated: 2 minima, with MSE 0.01 %" in said


def started(start: GivenStart):
    options = FitOptions("plain", fixed={**KNOWN, "f_0": 0.0}, start=start)
    setting = Setting.of(9)
    logs = {setting: problem().traces}
    given = ProcedureInput(logs, PURDY_DAMPER, options, 1, lambda _: None, lambda: False)
    return starts.own_start(given, setting, given.block(setting, FREE), options.fixed)


def test_what_is_told_is_where_a_fit_starts_and_the_rest_is_the_models_start() -> None:
    own, there = started(GivenStart()), started(GivenStart({"k_e": 7e8}))
    assert there == own.replace(k_e=7e8) != own
    # A name goes before the table, what is fixed before both, and the range before all.
    table = {"r_m1": 1e4, "r_m2": 2e6, "r_m3": 1.0, "k_e": 1e30, "other": 3.0}
    there = started(GivenStart({"r_m1": 2e4}, {Setting.of(9): table}))
    assert (there.r_m1, there.r_m2, there.r_m3) == (2e4, 2e6, KNOWN["r_m3"])
    assert there.k_e == PURDY_DAMPER.quantity("k_e").plausible[1]
    # What is freed may be given a start.
    start = GivenStart({"f_0": 5.0})
    check_options(FitOptions("plain", free=(*FREE, "f_0"), start=start), PURDY_DAMPER)


# Parts of a law that do nothing at a setting are left out there; what fits as well within wins.

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
