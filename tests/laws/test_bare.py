"""What explains nothing as one model of all settings goes, whatever a single setting made of it."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from damperfit.conditioning import condition
from damperfit.damper.declared_network import DeclaredNetwork
from damperfit.damper.friction import Friction
from damperfit.damper.mounting import FIT, Mounting
from damperfit.damper.network import Valve
from damperfit.identification.law_misfit import LawMisfit
from damperfit.laws import seals, together
from damperfit.laws.choosing import Verdict
from damperfit.laws.common_parts import bleeds_beside, without_kinds
from damperfit.laws.law_fit import LawFit, SettingLogs, fit_at
from damperfit.laws.law_of_all import LawOfAll
from damperfit.laws.variants import BLEED, BLOW_OFF, has_kinds_of_valves
from damperfit.recording import Recording
from damperfit.simulation import SolverOptions, simulate
from tests.laws.test_together import AT, PLAIN, PORT, follows, logs_of, values_at
from tests.laws.valve_logs import moved

SOLVER = SolverOptions(tolerance=0.01)


def fits_of(model, logs: list[SettingLogs], **wrong: float) -> list[LawFit]:
    """A law of single settings where they have ended."""
    free = tuple(one.name for one in model.quantities if one.default is None)
    return [
        fit_at(
            LawMisfit(model, one.fitted, free, SOLVER), one,
            values_at(model, one.setting, **wrong), evaluations=1,
        )
        for one in logs
    ]  # fmt: skip


def told(model, logs: list[SettingLogs], **wrong: float):
    fits = fits_of(model, logs, **wrong)
    return together.told_together(fits, logs, follows, solver=SOLVER, jobs=1)


@pytest.mark.parametrize(("more", "change"), [
    ({"friction": Friction(turning_speed=FIT)}, "without friction that turns within a speed"),
    ({"mounting": Mounting(FIT, lag=FIT)}, "without a lag of the force"),
    ({"rebound": Valve("long", "linear")}, "with a laminar bleed in rebound"),
])  # fmt: skip
def test_what_is_not_there_goes_where_the_law_leaves_nothing(more, change) -> None:
    true = replace(PLAIN, rebound=Valve("leak", "linear")) if "rebound" in more else PLAIN
    numbers = {"turning_speed": 1e-4, "lag": 1e-5, "rebound_leak": 4e7}
    logs = logs_of(true, **numbers)
    found = told(replace(PLAIN, **more), logs, **numbers, **{"rebound_bleed": 1e3} if
                 "rebound" in more else {})  # fmt: skip
    assert found.chosen.fits[0].model == true
    assert found.laws[-1].change == f"one model: {change}"
    assert found.laws[-1].is_taken
    assert found.laws[-1].tried is found.chosen


@pytest.mark.parametrize(("more", "numbers"), [
    ({"friction": Friction(turning_speed=FIT)}, {"turning_speed": 0.02}),
    ({"mounting": Mounting(FIT, lag=FIT)}, {"lag": 2e-3}),
    ({"rebound": Valve("orifice", "port")}, {}),
    ({"rebound": Valve("long", "linear")}, {"rebound_leak": 4e7}),
])  # fmt: skip
def test_what_is_there_stays(more, numbers) -> None:
    model = replace(PLAIN, **more)
    found = told(model, logs_of(model, **numbers), **numbers)
    assert found.chosen.fits[0].model == model


@pytest.mark.parametrize(("is_itself", "descents"), [(True, 1), (False, 2)])
def test_from_afar_is_from_another_law(monkeypatch, is_itself, descents) -> None:
    """A law that is made of itself alone has no other place to begin at."""
    steps, done = together._Course([], follows, SOLVER, 1, lambda _: None), []
    end = SimpleNamespace(cost=9.0, extra={})
    one = SimpleNamespace(with_common=dict, descend=lambda at: done.append(at) or end)
    one.of = lambda *_: one
    core, parts = without_kinds(PORT)
    first = SimpleNamespace(cost=1.0, extra={})
    rich = LawOfAll(PORT, (), one, first, parts)
    monkeypatch.setattr(steps, "begun", lambda *_: LawOfAll(PLAIN, (), one, first))
    monkeypatch.setattr(steps, "tried", lambda _: "tried")
    steps.without(core, rich if is_itself else replace(rich), rich, parts[0])
    assert len(done) == descents


def law(mse: float, *, held: float = math.nan, leaves: bool = False):
    return SimpleNamespace(mse_percent=mse, held_out_percent=held, leaves_something=leaves)


@pytest.mark.parametrize(("takes", "bic", "held", "goes"), [
    (False, 0.0, 0.054, True), (False, 0.1, 0.054, False), (True, -1.0, 0.054, False),
    (False, -5.0, 0.0549, True), (False, -5.0, 0.0551, False),  # 1.1 times 0.05 %
    (False, -5.0, math.nan, True),
])  # fmt: skip
def test_only_what_explains_nothing_goes(monkeypatch, takes, bic, held, goes) -> None:
    """By its numbers' price alone, and not where another log was predicted better with it."""
    steps = together._Course([], follows, SOLVER, 1, lambda _: None)
    verdict = Verdict(takes, 1.0, bic, "so")
    monkeypatch.setattr(steps, "held_against", lambda *_, **__: verdict)
    monkeypatch.setattr(steps, "record", lambda *_, **__: None)
    large, small = object(), object()
    tried, less = law(0.001, held=0.01), law(0.001, held=held)
    found = steps.bare_of((small, less), large, tried, "without play")
    assert found == ((small, less) if goes else (large, tried))
    assert steps.bare_of(None, large, tried, "without play") == (large, tried)


@pytest.mark.parametrize(("before", "after", "goes"), [
    (False, False, True), (False, True, False), (True, True, True), (True, False, True),
])  # fmt: skip
def test_no_law_without_a_part_leaves_something_where_nothing_was_left(
    monkeypatch, before, after, goes
) -> None:
    steps = together._Course([], follows, SOLVER, 1, lambda _: None)
    monkeypatch.setattr(steps, "held_against", lambda *_, **__: Verdict(False, 1.0, -5.0, "so"))
    monkeypatch.setattr(steps, "record", lambda *_, **__: None)
    large, small = object(), object()
    tried, less = law(0.001, leaves=before), law(0.001, leaves=after)
    found = steps.bare_of((small, less), large, tried, "without play")
    assert found == ((small, less) if goes else (large, tried))


def test_a_bleed_that_is_none_goes() -> None:
    """Beside a blow-off at next to no flow: one model asks for each bleed."""
    true = replace(PLAIN, compression=BLOW_OFF)
    found = told(PLAIN, logs_of(true), compression_bleed=5e6)
    assert found.chosen.fits[0].model == true
    assert found.laws[-1].change == "one model: without the bleed in bump"


def test_a_declared_network_is_told_as_it_is() -> None:
    """Its valves are its passages, of which there are no other kinds: replacing them raised."""
    network = DeclaredNetwork(mounting=Mounting(FIT))
    assert not has_kinds_of_valves(network)
    assert has_kinds_of_valves(PLAIN)
    known = values_at(PLAIN, AT[0])
    start = network.values({name: getattr(known, name) for name in network.names})
    free = tuple(one.name for one in network.quantities if one.default is None)
    logs = []
    for number, setting in enumerate(AT):
        motion = moved((0.14,), cycles=3)
        force = simulate(start, network, motion).force
        noise = np.random.default_rng(number).normal(0.0, 1.0, len(force))
        time = motion.interval * np.arange(len(force))
        log = Recording(f"{number}.csv", "", "", setting, time, motion.displacement, force + noise)
        logs.append(SettingLogs(setting, (condition(log),)))
    fits = [
        fit_at(LawMisfit(network, one.fitted, free, SOLVER), one, start, evaluations=1)
        for one in logs
    ]
    found = together.told_together(
        fits, logs, lambda _, free: dict.fromkeys(free, ("l", "h")), solver=SOLVER, jobs=1
    )
    assert [one.change for one in found.laws] == ["one model: as it was chosen"]
    assert found.chosen.fits[0].model == network


def test_bleeds_are_asked_about_beside_blow_offs_alone() -> None:
    assert [one.words for one in bleeds_beside(PORT)] == [
        "the bleed in rebound", "the bleed in bump",
    ]  # fmt: skip
    alone = replace(PLAIN, rebound=BLEED, compression=BLOW_OFF)
    assert not list(bleeds_beside(alone))
    [gone] = bleeds_beside(replace(PLAIN, compression=BLOW_OFF))
    assert gone.put_into(PLAIN).rebound == BLOW_OFF


def test_friction_that_took_a_place_is_asked_about(monkeypatch) -> None:
    turning, asked = SimpleNamespace(n_quantities=3, mse_percent=0.1), []
    monkeypatch.setattr(seals, "valve_damper", lambda _: PLAIN)
    monkeypatch.setattr(seals, "freed_of", lambda _: ())
    monkeypatch.setattr(seals, "_told", lambda *_: (True, "so"))
    monkeypatch.setattr(seals, "_of_two", lambda _course, best, _one: best)
    monkeypatch.setattr(seals, "_without_it", lambda _, one: asked.append(one) or "less")
    course = SimpleNamespace(fitted=lambda *_, **__: turning, record=lambda *_, **__: None)
    law = SimpleNamespace(mse_percent=0.1)
    assert seals.with_turning_told(course, law, ()) == "less"
    assert asked == [turning]
    monkeypatch.setattr(seals, "_told", lambda *_: (False, "so"))
    assert seals.with_turning_told(course, law, ()) is law


@pytest.mark.parametrize(("takes", "bic", "goes"), [
    (False, 0.0, True), (False, 0.1, False), (True, 0.1, False),
])  # fmt: skip
def test_friction_that_took_a_place_stays_where_the_logs_tell_it(
    monkeypatch, takes, bic, goes
) -> None:
    """A bleed stood for nothing but a wrong valley; so does what fits as well in its place."""
    model = replace(PLAIN, friction=Friction(turning_speed=FIT))
    turning, less = (
        SimpleNamespace(fits=(SimpleNamespace(model=one, free=()),), mse_percent=0.001)
        for one in (model, PLAIN)
    )
    said = []
    course = SimpleNamespace(
        fitted=lambda one, **_: less if one == PLAIN else None, n_eff=60.0, elsewhere=(),
        smaller_of=lambda one, law, _change, verdict, _asked: law if verdict.takes_larger else one,
        record=lambda *_, **told: said.append(told["is_taken"]),
    )  # fmt: skip
    monkeypatch.setattr(seals, "judged", lambda *_: Verdict(takes, 1.0, bic, "so"))
    monkeypatch.setattr(seals, "freed_of", lambda _: ())
    assert seals._without_it(course, turning) is (less if goes else turning)
    assert said == ([False] if bic > 0.0 and not takes else [])
    course.fitted = lambda *_, **__: None  # it cannot be simulated
    assert seals._without_it(course, turning) is turning
