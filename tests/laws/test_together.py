"""One model of all settings is offered what single settings cannot tell; it keeps what it needs."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from damperfit.conditioning import condition
from damperfit.damper.friction import Friction
from damperfit.damper.mounting import FIT, Mounting
from damperfit.damper.network import Valve
from damperfit.damper.valve_dampers import Monotube, ThroughFlow, TwinTube
from damperfit.errors import SimulationError
from damperfit.identification.law_misfit import LawMisfit
from damperfit.identification.sharing import Unknown
from damperfit.laws import LawFit, SettingLogs, Tried, judged, law_of_all, together
from damperfit.laws.choosing import OfOneModel
from damperfit.laws.common_parts import (
    beside_each_other,
    blow_off_kinds,
    changed,
    idle_parts,
    in_place,
    lacking_parts,
    laminar_alone,
    made_of,
    other_parts,
    turning_kinds,
    without_kinds,
)
from damperfit.laws.judged_laws import Together
from damperfit.laws.law_fit import fit_at
from damperfit.laws.law_of_all import led_back, lost_with
from damperfit.laws.one_model import OneModel
from damperfit.laws.variants import BLOW_OFF, BOTH
from damperfit.recording import Recording
from damperfit.simulation import SolverOptions, simulate
from damperfit.tested.setting import Setting
from tests.laws.valve_logs import VALUES, damper, moved

PLAIN = replace(damper(), rebound=BOTH, compression=BOTH, mounting=Mounting(FIT))
PORT = replace(PLAIN, rebound=Valve("orifice", "port"))
LIFTING = replace(PLAIN, rebound=Valve("orifice", "lifting"))
SOLVER = SolverOptions(tolerance=0.01)
BLEEDS, OPENINGS = {6: 7e4, 14: 2.5e4}, {1: 2.5e5, 3: 6e5}
AT = [Setting((("l", low), ("h", high))) for low, high in ((6, 1), (6, 3), (14, 1))]


def values_at(model, setting: Setting, **more: float):
    (_, low), (_, high) = setting.places
    own = {
        "rebound_bleed": BLEEDS[low], "compression_bleed": 0.9 * BLEEDS[low],
        "rebound_opening": OPENINGS[high], "compression_opening": 0.8 * OPENINGS[high],
    }  # fmt: skip
    known = VALUES | own | {"rebound_port": 9e3} | more
    return model.values({name: known[name] for name in model.names if name in known})


def logs_of(model, **more: float) -> list[SettingLogs]:
    """1 N of noise, one speed."""
    motion, found = moved((0.14,), cycles=3), []
    for seed, setting in enumerate(AT):
        noise = np.random.default_rng(seed)
        force = simulate(values_at(model, setting, **more), model, motion).force
        time = motion.interval * np.arange(len(force))
        force = force + noise.normal(0.0, 1.0, len(force))
        log = Recording(f"{seed}.csv", "", "", setting, time, motion.displacement, force)
        found.append(SettingLogs(setting, (condition(log),)))
    return found


def follows(model, free):
    turned = {"bleed": ("l",), "leak": ("l",), "opening": ("h",)}
    found = {name: turned.get(name.partition("_")[2], ()) for name in free}
    return found | {name: ("l", "h") for name in free if model.quantity(name).is_offset}


def apart(logs: list[SettingLogs], **wrong: float) -> list[LawFit]:
    """What single settings have found of the plain law."""
    free = tuple(one.name for one in PLAIN.quantities if one.default is None)
    return [
        fit_at(
            LawMisfit(PLAIN, one.fitted, free, SOLVER),
            one, values_at(PLAIN, one.setting, **wrong), evaluations=1,
        )
        for one in logs
    ]  # fmt: skip


def with_port() -> Together:
    logs = logs_of(PORT)
    return together.told_together(apart(logs), logs, follows, solver=SOLVER, jobs=1)


def check_port(found: Together) -> None:
    """The port that all settings have in common is found, and nothing else."""
    chosen = found.chosen
    assert chosen.title == (
        "through flow: bleed and port blow-off in rebound, bleed and blow-off in bump; elastic "
        "mounting"
    )
    numbers = {fit.values.rebound_port for fit in chosen.fits}
    assert len(numbers) == 1
    assert numbers.pop() == pytest.approx(9e3, rel=0.05)
    assert chosen.mse_percent < 0.01
    assert max(fit.worst_force_percent for fit in chosen.fits) < 1.0
    changes = [one.change for one in found.laws]
    assert changes[:2] == ["one model: as it was chosen", "one model: with everything"]
    assert changes[-1] == "one model: with a port behind the blow-off in rebound"
    assert [one.change for one in found.laws if one.is_taken] == [changes[-1]]  # the chosen law
    assert found.laws[-1].gain > 10.0
    refused = found.laws[2]
    assert refused.change.startswith("one model: without ")
    assert "only; 1.1 is required" in refused.reason or "too little" in refused.reason
    assert found.n_eff >= 60.0


def test_a_part_that_all_settings_have_in_common_is_found_and_told(monkeypatch) -> None:
    monkeypatch.setattr(together, "other_parts", lambda *_: [])
    monkeypatch.setattr(together, "turning_kinds", list)
    check_port(with_port())


def test_a_stack_that_lifts_further_is_no_rounded_one(monkeypatch) -> None:
    monkeypatch.setattr(together, "other_parts", lambda *_: [])
    monkeypatch.setattr(together, "turning_kinds", list)
    logs = logs_of(LIFTING, rebound_lift=4e-6)
    found = together.told_together(apart(logs), logs, follows, solver=SOLVER, jobs=1)
    assert found.laws[-1].change == (
        "one model: with a blow-off that lifts further the harder it is pressed in rebound"
    )
    assert found.chosen.fits[0].model == LIFTING
    assert found.chosen.fits[0].values.rebound_lift == pytest.approx(4e-6, rel=0.1)
    assert max(fit.worst_force_percent for fit in found.chosen.fits) < 1.0


@pytest.mark.slow
def test_of_all_parts_only_that_is_kept_which_is_needed() -> None:
    found = with_port()
    check_port(found)
    assert len(found.laws) > 12


def test_a_law_that_leaves_nothing_is_offered_nothing() -> None:
    logs = logs_of(PLAIN)
    found = together.told_together(apart(logs, f_f=25.0), logs, follows, solver=SOLVER, jobs=1)
    assert [one.change for one in found.laws] == ["one model: as it was chosen"]
    assert found.chosen.fits[0].values.f_f == pytest.approx(20.0, rel=0.05)


def test_a_bleed_that_single_settings_did_not_need_is_found(monkeypatch) -> None:
    """They have taken friction for a preload in bump."""
    monkeypatch.setattr(together, "other_parts", lambda *_: [])
    monkeypatch.setattr(together, "turning_kinds", list)
    monkeypatch.setattr(together, "blow_off_kinds", lambda _: [])
    logs = logs_of(PLAIN)
    less = replace(PLAIN, compression=BLOW_OFF)
    free = tuple(one.name for one in less.quantities if one.default is None)
    wrong = {"f_f": 0.01, "compression_opening": 5e4, "compression_slope": 6e6}
    fits = [
        fit_at(
            LawMisfit(less, one.fitted, free, SOLVER),
            one, values_at(less, one.setting, **wrong), evaluations=1,
        )
        for one in logs
    ]  # fmt: skip
    found = together.told_together(fits, logs, follows, solver=SOLVER, jobs=1)
    assert found.laws[-1].is_taken
    assert found.laws[-1].change == "one model: with a bleed in bump"
    assert found.chosen.mse_percent < 0.01
    values = found.chosen.fits[0].values
    assert values.compression_bleed == pytest.approx(0.9 * BLEEDS[6], rel=0.03)
    assert values.f_f == pytest.approx(20.0, rel=0.05)


def test_a_part_of_single_settings_that_one_model_does_not_need_is_taken_out(monkeypatch) -> None:
    """A friction that is larger at rest has stood for the port."""

    def at_rest(damper, freed):
        return [one for one in other_parts(damper, freed) if "at rest" in one.words]

    monkeypatch.setattr(together, "other_parts", at_rest)
    monkeypatch.setattr(together, "turning_kinds", list)
    logs = logs_of(PORT)
    more = replace(PLAIN, friction=Friction(breakaway=FIT, stribeck_speed=FIT))
    free = tuple(one.name for one in more.quantities if one.default is None)
    wrong = {"breakaway": 8.0, "stribeck_speed": 0.1}
    fits = [
        fit_at(
            LawMisfit(more, one.fitted, free, SOLVER),
            one, values_at(more, one.setting, **wrong), evaluations=1,
        )
        for one in logs
    ]  # fmt: skip
    found = together.told_together(fits, logs, follows, solver=SOLVER, jobs=1)
    assert found.laws[-1].change == (
        "one model: with a port behind the blow-off in rebound, without friction that is larger at "
        "rest"
    )
    assert found.laws[-1].is_taken
    assert found.chosen.fits[0].model == PORT


@pytest.mark.parametrize(("less", "force", "is_taken"), [
    (0.109, 2.0, True), (0.111, 2.0, False), (0.109, 14.9, True), (0.109, 15.1, False),
])  # fmt: skip
def test_a_smaller_law_is_taken_that_leaves_no_more(monkeypatch, less, force, is_taken) -> None:
    """What single settings had too many is not worth a factor of 1.5, but its absence costs none.

    A tenth more is left: so little no part that one model has is worth. Forces count too.
    """
    steps = together._Course([], follows, SOLVER, 1, lambda _: None)
    steps.n_eff = 60.0
    rubbing = replace(PLAIN, friction=Friction(seal_area=FIT))
    before = law_of_all.LawOfAll(rubbing, (), SimpleNamespace(unknowns=range(9)), None)
    rich = law_of_all.LawOfAll(PLAIN, (), SimpleNamespace(unknowns=range(8)), None)
    monkeypatch.setattr(steps, "with_whole_valves", lambda *_: before)
    monkeypatch.setattr(steps, "with_all", lambda *_: rich)
    best, tried = law(less, force=force), law(0.1, force=10.0)
    for step in ("thinned", "turned", "cheaper"):
        monkeypatch.setattr(steps, step, lambda *_: (rich, best))
    monkeypatch.setattr(steps, "led_back", lambda *said: said[:2])
    monkeypatch.setattr(steps, "tried", lambda _: best)
    assert steps.enriched(before, tried)[1] is (best if is_taken else tried)
    assert steps.judged[-1].change == "one model: without friction by the pressure on the seal"


@pytest.mark.parametrize(("own", "taken"), [(0.9, "own"), (1.1, "begun"), (None, "begun")])
def test_whole_valves_are_tried_from_starts_of_their_own_where_parts_lack(
    monkeypatch, own, taken
) -> None:
    """What costs less is gone on from; a start that cannot be simulated is none."""
    steps = together._Course([], follows, SOLVER, 1, lambda _: None)
    ends = {
        name: SimpleNamespace(cost=cost, extra={AT[0]: cost})
        for name, cost in (("begun", 1.0), ("own", own))
    }
    one = SimpleNamespace(cost=lambda values: values[AT[0]])
    less = law_of_all.LawOfAll(replace(PLAIN, compression=BLOW_OFF), ("drag",), one, None)

    def begun(damper, freed, _law):
        return law_of_all.LawOfAll(damper, freed, one, ends["begun"])

    def first(fits):
        assert fits == "apart"
        return law_of_all.LawOfAll(PLAIN, ("drag",), one, ends["own"])

    def each(damper, law):
        assert (damper, law) == (PLAIN, less)
        if own is None:
            raise SimulationError("no")
        return "apart"

    for name, step in (("begun", begun), ("first", first), ("apart", each)):
        monkeypatch.setattr(steps, name, step)
    found = steps.with_whole_valves(less.damper, less)
    assert found.minimum is ends[taken]
    assert [one.words for one in found.parts] == ["a bleed in bump"]
    assert (found.damper, found.freed) == (PLAIN, ("drag",))
    whole = replace(less, damper=PLAIN)
    assert steps.with_whole_valves(PLAIN, whole) is whole


@pytest.mark.parametrize(("more", "left", "is_taken"), [
    (0, 0.99, True), (1, 0.99, False), (0, 1.01, False),
])  # fmt: skip
def test_a_law_of_as_many_numbers_is_taken_that_leaves_nothing(
    monkeypatch, more, left, is_taken
) -> None:
    """One part was worth less than another that took its place: the MSE rose from 0.005 to 0.006 %.

    A force at a speed fell from 2.7 to 0.7 %, and the law of single settings was kept.
    """
    steps = together._Course([], follows, SOLVER, 1, lambda _: None)
    steps.n_eff = 60.0
    before = law_of_all.LawOfAll(PLAIN, (), SimpleNamespace(unknowns=range(9)), None)
    rubbing = replace(PLAIN, friction=Friction(seal_area=FIT))
    _, parts = without_kinds(rubbing)
    rich = law_of_all.LawOfAll(
        rubbing, (), SimpleNamespace(unknowns=range(9 + more)), None, parts
    )  # fmt: skip
    monkeypatch.setattr(steps, "with_whole_valves", lambda *_: before)
    monkeypatch.setattr(steps, "with_all", lambda *_: rich)
    best, tried = law(0.006, force=left), law(0.005, force=2.7)
    for step in ("thinned", "turned"):
        monkeypatch.setattr(steps, step, lambda *_: (rich, best))
    monkeypatch.setattr(steps, "without", lambda *_: None)  # asked where all cost too much
    monkeypatch.setattr(steps, "led_back", lambda *said: said[:2])
    monkeypatch.setattr(steps, "tried", lambda _: best)
    assert steps.enriched(before, tried)[1] is (best if is_taken else tried)


def test_a_part_laminar_bleed_may_be_laminar_alone() -> None:
    long = replace(PLAIN, rebound=Valve("long", "linear"))
    part, other = (one for one in other_parts(PLAIN, ()) if "laminar" in one.words)
    [found] = laminar_alone(long)
    assert found.words == "a laminar bleed in rebound"
    parts = in_place(PLAIN, (), [part, other], found)
    assert parts == (other, found)
    model, _ = made_of(PLAIN, (), parts)
    assert (model.rebound.bleed, model.compression.bleed) == ("leak", "long")
    assert not list(laminar_alone(PLAIN))


def test_bleeds_of_both_strokes_become_laminar_one_after_the_other(monkeypatch) -> None:
    """The second beside what the first has left."""
    steps, asked = together._Course([], follows, SOLVER, 1, lambda _: None), []
    long = replace(PLAIN, rebound=Valve("long", "linear"), compression=Valve("long", "linear"))
    parts = tuple(one for one in other_parts(PLAIN, ()) if "laminar" in one.words)
    rich = SimpleNamespace(parts=parts, damper=long, by_looseness=lambda _: [])

    def smaller(_core, _law, _rich, left):
        asked.append([one.words for one in left])
        return SimpleNamespace(parts=tuple(left), damper=made_of(PLAIN, (), left)[0]), None

    def smaller_of(found, rich, best, word, _part):
        return found if word == "with" else (rich, best)

    monkeypatch.setattr(steps, "with_parts", smaller)
    monkeypatch.setattr(steps, "smaller_of", smaller_of)
    steps.thinned(PLAIN, SimpleNamespace(parts=()), rich, None)
    of_both = ["a laminar part of the bleed in rebound", "a laminar part of the bleed in bump"]
    alone = ["a laminar bleed in rebound", "a laminar bleed in bump"]
    gone = ["the blow-off in rebound", "the blow-off in bump"]
    # Beside another kind of bleed a blow-off may be idle, and again beside a laminar one.
    assert asked == [
        [*of_both, gone[0]], [*of_both, gone[1]], [of_both[1], alone[0]], alone,
        [*alone, gone[0]], [*alone, gone[1]],
    ]  # fmt: skip


def test_a_blow_off_may_go_whose_stroke_has_got_a_bleed() -> None:
    """It has stood for the bleed; what is a kind of it goes with it."""
    core = replace(PLAIN, rebound=BLOW_OFF)
    parts = [*lacking_parts(core), *blow_off_kinds("rebound")[:1], *other_parts(PLAIN, ())]
    damper, freed = made_of(core, (), parts)
    assert damper.rebound == Valve("long", "rounded")
    gone, bleed, in_bump = idle_parts(core, damper)
    assert gone.words == "the blow-off in rebound"
    assert bleed.words == "the bleed in rebound"  # whose blow-off has become another
    assert in_bump.words == "the blow-off in bump"  # whose bleed has become another
    bled = replace(core, rebound=Valve("orifice", "none"))
    assert [one.words for one in idle_parts(bled, PLAIN)] == ["the bleed in rebound"]
    left = in_place(core, (), parts, gone)
    assert made_of(core, (), left) == (replace(damper, rebound=Valve("long", "none")), freed)
    assert [one.words for one in parts if one not in left] == [
        "a blow-off that lifts gradually in rebound"
    ]
    assert made_of(core, (), left[1:])[0].rebound == BLOW_OFF  # which has nothing else then
    assert not list(idle_parts(core, core))
    assert not list(idle_parts(PLAIN, PLAIN))
    assert [one.words for one in idle_parts(PLAIN, PORT)] == ["the bleed in rebound"]


def test_friction_that_is_declared_is_no_part_of_the_logs() -> None:
    friction = Friction(presliding=2e-5, breakaway=FIT, stribeck_speed=FIT, seal_area=FIT)
    core, own = without_kinds(replace(PORT, friction=friction))
    assert core == replace(PLAIN, friction=Friction(presliding=2e-5))
    assert made_of(core, (), own)[0] == replace(PORT, friction=friction)
    assert len(own) == 3


def test_parts_of_what_is_taken_out_go_with_it() -> None:
    """Without the bleed there is none that could have a laminar part."""
    core = replace(PLAIN, compression=BLOW_OFF)
    bleed, *_ = lacking_parts(core)
    assert bleed.words == "a bleed in bump"
    offered = [bleed, *other_parts(PLAIN, ())]
    kept = beside_each_other(core, (), offered)
    assert list(kept) == offered
    words = {one.words for one in beside_each_other(core, (), kept[1:])}
    assert words == {one.words for one in offered[1:]} - {"a laminar part of the bleed in bump"}
    assert not lacking_parts(PLAIN)


def test_one_setting_in_a_wrong_valley_does_not_spoil_the_model() -> None:
    """In bump bleed and blow-off have changed places at one setting."""
    logs = logs_of(PLAIN)
    fits = apart(logs)
    wrong = {"compression_bleed": 4e5, "compression_opening": 2e4}
    fits[0] = replace(fits[0], values=fits[0].values.replace(wrong))
    found = together.told_together(fits, logs, follows, solver=SOLVER, jobs=1).chosen
    assert found.mse_percent < 0.02
    assert found.fits[0].values.compression_opening == pytest.approx(2e5, rel=0.05)


def law(mse: float, *, force: float = 0.5, held: float = math.nan, **more: object) -> Tried:
    fit = LawFit(
        setting=AT[0], model=PORT, values=values_at(PORT, AT[0]), free=("f_f", "rebound_port"),
        at_bound=(), mse_percent=mse, stretches=(mse,), held_out_percent=held, held_out="logs",
        residuals=(), evaluations=1, worst_force_percent=force,
    )  # fmt: skip
    return Tried("law", (replace(fit, **more), replace(fit, **more)))


@pytest.mark.parametrize(("left", "taken", "alike"), [
    (0.0199, "twin_tube", ["through_flow", "monotube"]),
    (0.0201, "through_flow", ["twin_tube", "monotube"]),
])  # fmt: skip
def test_a_layout_that_needs_no_part_more_is_taken_and_the_others_are_told(
    monkeypatch, left, taken, alike
) -> None:
    steps = together._Course([], follows, SOLVER, 1, lambda _: None)
    found = {
        name: law(mse, model=replace(kind(), rebound=BOTH, compression=BOTH))
        for name, mse, kind in (
            ("through_flow", 0.022, ThroughFlow), ("twin_tube", left, TwinTube),
            ("monotube", 0.0215, Monotube),
        )
    }  # fmt: skip
    monkeypatch.setattr(together, "effective_samples", lambda *_: 60.0)
    monkeypatch.setattr(steps, "apart", lambda damper, _: damper)
    monkeypatch.setattr(steps, "first", lambda damper: SimpleNamespace(damper=damper))
    monkeypatch.setattr(steps, "tried", lambda one: found[one.damper.name])
    first = SimpleNamespace(damper=found["through_flow"].fits[0].model)
    best = steps.laid_out(first, [found[name].fits[0].model for name in ("twin_tube", "monotube")])
    assert best.damper.name == taken
    assert steps.judged[-1].tried is found[taken]
    assert list(steps.alike) == alike


@pytest.mark.parametrize(("small", "large", "n_more", "is_taken"), [
    (law(0.149), law(0.1), 1, False),
    (law(0.151), law(0.1), 1, True),
    (law(0.0127, force=1.49), law(0.01, force=1.0), 1, False),
    (law(0.0127, force=1.51), law(0.01, force=1.0), 1, True),
    # Sixty samples are worth six numbers of half the force more, and no seven.
    (law(0.0111, force=1.51), law(0.01, force=1.0), 6, True),
    (law(0.0111, force=1.51), law(0.01, force=1.0), 7, False),
    # Noise has a force off in one stroke of many: a part that does not fit better explains none.
    (law(0.0109, force=1.51), law(0.01, force=1.0), 1, False),
    (law(0.0109, force=1.51, sure_force_percent=0.99), law(0.01, force=1.0), 1, False),
    (law(0.0092, force=1.51, sure_force_percent=1.01), law(0.01, force=1.0), 1, True),
    (law(0.009, force=1.51, sure_force_percent=1.01), law(0.01, force=1.0), 1, False),
    (law(0.2, held=0.01), law(0.1, held=0.054), 1, True),
    (law(0.2, held=0.01), law(0.1, held=0.056), 1, False),
])  # fmt: skip
def test_one_model_takes_what_an_mse_or_a_force_needs(small, large, n_more, is_taken) -> None:
    verdict = judged(small, large, 60.0, of_one_model=OfOneModel(n_more))
    assert verdict.takes_larger is is_taken


@pytest.mark.parametrize(("small", "large", "stays"), [
    (law(0.0129, force=1.1), law(0.01, force=1.1), False),
    (law(0.0129, force=1.1), law(0.01, force=1.09), True),
    (law(0.0129, force=1.1, held=0.0151), law(0.01, force=1.1, held=0.01), True),
    (law(0.0129, force=1.1, held=0.0149), law(0.01, force=1.1, held=0.01), False),
    (law(0.0149, force=1.1), law(0.01, force=1.1), False),
    (law(0.0151, force=1.1), law(0.01, force=1.1), True),  # by which a whole law is larger
    (law(0.0201), law(0.0156), True),
    # What is off beyond noise another part may better beside this one.
    (law(0.0129, force=1.1, sure_force_percent=1.01), law(0.01, force=1.1), True),
    (law(0.0129, force=1.1, sure_force_percent=0.99), law(0.01, force=1.1), False),
])  # fmt: skip
def test_a_part_of_one_model_betters_the_force_it_stays_for(small, large, stays) -> None:
    """The seals' drag stayed at 0.0006 %, for noise had a force 1.08 % off; with it 1.13."""
    verdict = judged(small, large, 60.0, of_one_model=OfOneModel(1, 1.1))
    assert verdict.takes_larger is stays


@pytest.mark.parametrize(("more", "lost"), [
    ({"at_bound": ("f_f",)}, "friction at setting"),
    ({"undetermined": ("f_f",)}, ""),
    ({"undetermined": ("f_f",), "values": values_at(PORT, AT[0], f_f=20.0 / 9.9)}, ""),
    ({"undetermined": ("f_f",), "values": values_at(PORT, AT[0], f_f=20.0 / 10.1)}, "friction at"),
    ({"values": values_at(PORT, AT[0], f_f=1.0)}, ""),
    ({"free": ("rebound_port",)}, ""),
])  # fmt: skip
def test_a_number_that_runs_away_beside_a_part_is_lost(more, lost) -> None:
    assert lost_with(law(0.2), law(0.1, **more)).startswith(lost)
    assert bool(lost_with(law(0.2), law(0.1, **more))) is bool(lost)


@pytest.mark.parametrize(("left", "is_lost"), [(0.299, True), (0.301, False)])
def test_a_law_that_leaves_a_third_may_lose_what_the_smaller_told_of_something_else(
    left, is_lost
) -> None:
    assert bool(lost_with(law(left), law(0.1, at_bound=("f_f",)))) is is_lost


def test_what_is_lost_already_or_to_its_own_laminar_part_is_not_lost() -> None:
    gone = law(0.1, at_bound=("f_f",))
    assert not lost_with(gone, gone)
    long = replace(PORT, rebound=Valve("long", "port"))
    free = ("rebound_bleed", "rebound_leak")
    large = law(0.1, model=long, free=free, at_bound=("rebound_bleed",))
    assert not lost_with(law(0.2, free=("rebound_bleed",)), large)


def test_parts_exclude_each_other_and_leave_what_is_there() -> None:
    core, own = without_kinds(PORT)
    assert core == PLAIN
    assert made_of(core, (), own) == (PORT, ())
    turning = turning_kinds()
    assert made_of(core, (), turning) == made_of(core, (), turning[:1])
    offered = list(other_parts(PLAIN, ("drag",)))
    assert all("drag" not in one.freed for one in offered)
    model, freed = made_of(core, ("drag",), offered)
    assert freed == ("drag", "return_slope", "free_gas", "k_e")
    assert (model.rebound.bleed, model.compression.bleed) == ("long", "long")


def course(monkeypatch, worth: dict[str, float], failing: str) -> together._Course:
    """A course whose laws are named parts, each of some worth."""
    steps = together._Course([], follows, SOLVER, 1, lambda _: None)
    steps.worth.update(worth)

    def without(_core, _law, rich, part):
        left = SimpleNamespace(parts=tuple(one for one in rich.parts if one is not part))
        return None if part.words == failing else (left, left)

    def held_against(_small, _less, large, _more, *, least_gain):
        assert least_gain == 1.5
        bic = sum(worth[one.words] for one in large.parts)
        return SimpleNamespace(takes_larger=False, bic=bic)

    monkeypatch.setattr(steps, "without", without)
    monkeypatch.setattr(steps, "held_against", held_against)
    return steps


def test_what_single_settings_have_told_of_is_asked_last(monkeypatch) -> None:
    """Two parts that stand for it are not left in its place because it was the looser one."""
    steps, asked = together._Course([], follows, SOLVER, 1, lambda _: None), []
    own, *more = (SimpleNamespace(words=name, is_less=False) for name in ("own", "a", "b"))
    rich = SimpleNamespace(
        parts=(own, *more), by_looseness=lambda _: [own, *more],
        damper=SimpleNamespace(rebound=BOTH, compression=BOTH),
    )  # fmt: skip
    monkeypatch.setattr(steps, "without", lambda *said: asked.append(said[-1].words))
    assert steps.thinned(PLAIN, SimpleNamespace(parts=(own,)), rich, None) == (rich, None)
    assert asked == ["a", "b", "own"]


@pytest.mark.parametrize(("going", "asked"), [
    ("b", ["a", "b", "c", "a"]), ("", ["a", "b", "c"]), ("a", ["a", "b", "c"]),
    ("bc", ["a", "b", "c", "a"]), ("c", ["a", "b", "c", "a", "b"]),
])  # fmt: skip
def test_what_stayed_is_asked_again_without_what_went_after_it(monkeypatch, going, asked) -> None:
    """A friction that was larger at rest stayed beside a drag of the seals that was not there."""
    steps, found = together._Course([], follows, SOLVER, 1, lambda _: None), []
    parts = tuple(SimpleNamespace(words=name, is_less=False) for name in "abc")
    rich = SimpleNamespace(
        parts=parts, by_looseness=lambda _: parts,
        damper=SimpleNamespace(rebound=BOTH, compression=BOTH),
    )  # fmt: skip

    def without(_core, _law, rich, part):
        found.append(part.words)
        left = tuple(one for one in rich.parts if one is not part)
        return SimpleNamespace(parts=left, damper=rich.damper), None

    def smaller_of(less, rich, best, _word, part):
        return less if part.words in going else (rich, best)

    monkeypatch.setattr(steps, "without", without)
    monkeypatch.setattr(steps, "smaller_of", smaller_of)
    left, _ = steps.thinned(PLAIN, SimpleNamespace(parts=()), rich, None)
    assert found == asked
    assert [one.words for one in left.parts] == [one for one in "abc" if one not in going]


@pytest.mark.parametrize(("cost", "mse", "force", "is_led"), [
    (0.9, 0.09, 1.9, True), (0.92, 0.09, 1.9, False), (0.9, 0.092, 1.9, False),
    (0.9, 0.09, 10.1, False),
])  # fmt: skip
def test_a_law_is_gone_on_with_from_where_a_larger_one_has_led(
    monkeypatch, cost, mse, force, is_led
) -> None:
    """By a tenth of what it leaves, of the squares and of the whole logs, and no force is worse."""
    steps = together._Course([], follows, SOLVER, 1, lambda _: None)
    before, again = (
        law_of_all.LawOfAll(PLAIN, (), None, SimpleNamespace(cost=left)) for left in (1.0, cost)
    )
    tried, one = law(0.1, force=10.0), law(mse, force=force)
    monkeypatch.setattr(together, "led_back", lambda *_: again)
    monkeypatch.setattr(steps, "tried", lambda _: one)
    assert steps.led_back(before, tried, None) == ((again, one) if is_led else (before, tried))
    assert [said.change for said in steps.judged] == [
        "one model: from where a larger law ended"
    ] * is_led


def test_a_law_that_cannot_be_simulated_there_stays_where_it_is(monkeypatch) -> None:
    def refused(*_):
        raise SimulationError("no")

    steps = together._Course([], follows, SOLVER, 1, lambda _: None)
    monkeypatch.setattr(together, "led_back", refused)
    before, tried = object(), law(0.1)
    assert steps.led_back(before, tried, None) == (before, tried)


def test_a_law_is_led_by_what_both_have_free() -> None:
    """What the larger one has no more stays; what leads nowhere is left."""
    logs = logs_of(PLAIN)
    steps = together._Course(logs, follows, SOLVER, 1, lambda _: None)
    begun = steps.first(apart(logs))
    wrong = {
        s: values.replace({"f_f": 80.0, "rebound_slope": 3.0 * values.rebound_slope})
        for s, values in begun.values.items()
    }
    far = replace(begun, minimum=begun.one.look(begun.one.with_common(wrong)))
    stuck = replace(far, minimum=SimpleNamespace(cost=1e9, extra=far.minimum.extra))
    found = led_back(stuck, begun)
    assert found.values[AT[0]].f_f == pytest.approx(20.0, rel=0.05)
    best = replace(begun, minimum=SimpleNamespace(cost=0.0, extra=far.minimum.extra))
    assert led_back(best, far) is best


def turned(monkeypatch, left: float, found: Tried) -> tuple[str, list[str]]:
    """What becomes of a law with play that leaves so much, and what is offered to it."""
    steps, offered = together._Course([], follows, SOLVER, 1, lambda _: None), []
    steps.n_eff = 60.0
    more, play = turning_kinds(), next(one for one in other_parts(PLAIN, ()) if one.words == "play")
    rich = law_of_all.LawOfAll(PLAIN, (), SimpleNamespace(unknowns=range(8)), None, (play, more[1]))
    larger = law_of_all.LawOfAll(PLAIN, (), SimpleNamespace(unknowns=range(8)), None)

    def best_part(_core, _law, beside, rivals):
        offered.extend(one.words for one in (*beside, *rivals))
        return rivals[:1]

    monkeypatch.setattr(steps, "best_part", best_part)
    monkeypatch.setattr(steps, "with_more", lambda *_: larger)
    monkeypatch.setattr(steps, "tried", lambda _: found)
    monkeypatch.setattr(steps, "thinned", lambda *said: said[2:])
    taken, _ = steps.turned(PLAIN, rich, rich, law(left, force=0.5))
    return ("turned" if taken is larger else "as it was"), offered


@pytest.mark.parametrize(("left", "found", "becomes"), [
    (0.151, 0.1, "turned"), (0.149, 0.1, "as it was"),
])  # fmt: skip
def test_friction_that_turns_otherwise_is_looked_for_in_what_is_left(
    monkeypatch, left, found, becomes
) -> None:
    """In the place of the way in which it turns now."""
    within = "friction that turns within a speed"
    over = "friction that builds up over a distance"
    end, offered = turned(monkeypatch, left, law(found))
    assert end == becomes
    assert offered == ["play", over]
    assert within not in offered


def test_where_nothing_is_left_nothing_is_looked_for(monkeypatch) -> None:
    assert turned(monkeypatch, 0.0199, law(0.001)) == ("as it was", [])
    assert turned(monkeypatch, 0.0201, law(0.001))[0] == "turned"


def test_what_is_no_smaller_law_is_not_tried() -> None:
    """Without the bleed the blow-off is back, whose numbers the larger law has not."""
    core = replace(PLAIN, rebound=BLOW_OFF)
    bleed = lacking_parts(core)[0]
    [gone] = idle_parts(core, made_of(core, (), [bleed])[0])
    damper, freed = made_of(core, (), [bleed, gone])
    rich = law_of_all.LawOfAll(damper, freed, None, None, (bleed, gone))
    steps = together._Course([], follows, SOLVER, 1, lambda _: None)
    assert steps.without(core, rich, rich, bleed) is None


def test_a_change_is_told_with_what_is_new_and_what_is_gone() -> None:
    core = replace(PLAIN, rebound=BLOW_OFF)
    bleed = lacking_parts(core)[0]
    play, lag, *_ = (
        one for one in other_parts(PLAIN, ()) if one.words in {"play", "a lag of the force"}
    )
    [gone] = idle_parts(core, PLAIN)
    assert changed((play, lag), (lag, bleed, gone)) == (
        "with a bleed in rebound, without play, the blow-off in rebound"
    )
    assert changed((play,), (play,)) == ""


def test_play_and_lag_of_single_settings_are_asked_about_and_stay_where_they_are_known() -> None:
    core, own = without_kinds(replace(PLAIN, mounting=Mounting(FIT, FIT, FIT)))
    assert core == PLAIN
    assert [one.words for one in own] == ["play", "a lag of the force"]
    known = replace(PLAIN, mounting=Mounting(FIT, 5e-4, 8e-3))
    assert without_kinds(known) == (known, ())


@pytest.mark.parametrize(("worth", "failing", "left"), [
    ({"a": 3.0, "b": -5.0, "c": 1.0}, "", "ac"),
    ({"a": 3.0, "b": -1.0, "c": 1.0}, "", "abc"),
    ({"a": -3.0, "b": -5.0}, "", ""),
    ({"a": 3.0, "b": -5.0}, "b", "ab"),
    ({"a": -3.0, "own": -9.0}, "", "own"),
])  # fmt: skip
def test_parts_go_until_all_together_are_worth_their_numbers(
    monkeypatch, worth, failing, left
) -> None:
    parts = tuple(SimpleNamespace(words=name, is_less=False) for name in worth)
    rich = SimpleNamespace(parts=parts)
    before = SimpleNamespace(parts=tuple(one for one in parts if one.words == "own"))
    found, _ = course(monkeypatch, worth, failing).cheaper(PLAIN, before, None, rich, rich)
    assert "".join(one.words for one in found.parts) == left


def test_a_law_that_cannot_be_simulated_at_all_settings_is_said_to_be_so(monkeypatch) -> None:
    def refused(*_):
        raise SimulationError("no")

    logs = logs_of(PLAIN)
    fits = apart(logs)
    monkeypatch.setattr(OneModel, "descend", refused)
    with pytest.raises(SimulationError, match="at all settings at once"):
        together.told_together(fits, logs, follows, solver=SOLVER, jobs=1)


def test_what_single_settings_have_freed_is_asked_for_too() -> None:
    """Free gas stood for oil that is softer than assumed."""
    freed = ("free_gas", "gas_volume")
    core, own = without_kinds(PLAIN, freed)
    assert core == PLAIN
    assert [one.freed for one in own] == [("free_gas",), ("gas_volume",)]
    assert made_of(core, (), own) == (PLAIN, freed)
    assert without_kinds(PLAIN, ("f_0",)) == (PLAIN, ())
    steps = together._Course([], follows, SOLVER, 1, lambda _: None)
    law = law_of_all.LawOfAll(PLAIN, freed, None, None, own)
    assert law.own_freed == ()
    steps.best_part = lambda *_: []
    steps.with_more = lambda _core, _law, parts: parts
    offered = [one.freed for one in steps.with_all(core, law) if one.freed]
    assert offered == [("return_slope",), ("drag",), ("free_gas",), ("k_e",), ("gas_volume",)]


@pytest.mark.parametrize("is_refused", [False, True])
def test_one_model_leaves_a_closed_bleed_that_has_lost_its_laminar_half(
    monkeypatch, is_refused
) -> None:
    """At nothing a number has no slope: no step led back from an orifice."""
    long = replace(PLAIN, rebound=Valve("long", "linear"))
    logs = logs_of(long, rebound_leak=1.2e9, rebound_bleed=2e5)
    free = tuple(one.name for one in long.quantities if one.default is None)
    fits = [
        fit_at(
            LawMisfit(long, one.fitted, free, SOLVER), one,
            values_at(long, one.setting, rebound_leak=1e3, rebound_bleed=1.2e6), evaluations=1,
        )
        for one in logs
    ]  # fmt: skip
    descend = OneModel.descend

    def descended(self, at, *stopping):
        if is_refused and all(one.rebound_leak > 1e6 for one in at.values()):
            raise SimulationError("not from both ways")
        return descend(self, at, *stopping)

    monkeypatch.setattr(OneModel, "descend", descended)
    steps = together._Course(logs, follows, SOLVER, 1, lambda _: None)
    found = steps.first(fits).values[AT[0]]
    if is_refused:  # it stays where it was led before
        assert found.rebound_leak < 1e6
    else:
        assert found.rebound_leak == pytest.approx(1.2e9, rel=0.2)


def test_the_returns_are_asked_first() -> None:
    core, _ = without_kinds(PLAIN)
    offered = list(other_parts(PLAIN, ()))
    model, freed = made_of(core, (), offered)
    errors = {Unknown(name): 9.0 if name == "drag" else 0.1 for name in model.names}
    one = SimpleNamespace(errors=lambda _: errors)
    found = law_of_all.LawOfAll(model, freed, one, None, tuple(offered)).by_looseness(core)
    assert [part.freed for part in found[:2]] == [("return_slope",), ("drag",)]


def test_of_few_settings_every_order_is_a_start_of_many_each_first() -> None:
    free = ("rebound_bleed", "f_0")
    for n, starts in ((3, 7), (4, 5), (9, 7)):
        at = [Setting((("l", low), ("h", 1))) for low in range(n)]
        model = OneModel(
            dict.fromkeys(at, SimpleNamespace(model=PLAIN, free=free)), {"f_0": ("l", "h")},
            {one: float(place) for place, one in enumerate(at)},
        )  # fmt: skip
        values = {
            one: values_at(PLAIN, AT[0], rebound_bleed=1e4 * (k + 1)) for k, one in enumerate(at)
        }
        found = [next(iter(one.values())).rebound_bleed for one in model.starts(values)]
        assert len(found) == starts
        if n > 3:  # those that are met best come first
            assert found[1:] == [1e4 * k for k in range(n, 0, -1)][: starts - 1]


def test_a_blow_off_that_no_log_opens_is_preloaded_as_little_as_they_allow() -> None:
    """Which is seen where the squares are a thousandth more, at 10 bar; a lower one stays."""
    asked = []

    def cost(values) -> float:
        asked.append(values.rebound_opening)
        if values.compression_opening < 5e5:
            return 2.0
        return 1.0 + 1e-3 * math.log(1e8 / values.rebound_opening) / math.log(100.0)

    free = ("rebound_bleed", "rebound_opening", "compression_opening")
    one = SimpleNamespace(model=PLAIN, free=free, cost=cost)
    model = OneModel(dict.fromkeys(AT, one), follows(PLAIN, free), dict.fromkeys(AT, 1.0))
    at = {s: values_at(PLAIN, s, rebound_opening=1e8, compression_opening=6e5) for s in AT}
    found = model.with_least_openings(at)
    assert {one.rebound_bleed for one in found.values()} == set(BLEEDS.values())
    assert {one.compression_opening for one in found.values()} == {6e5}
    for setting in AT:
        assert 1.0 <= found[setting].rebound_opening / 1e6 < 1.02
    assert found[AT[0]].rebound_opening == found[AT[2]].rebound_opening  # both at h 1
    assert len(set(asked)) == 12


@pytest.mark.parametrize(("times", "n_weighed"), [(3.99, 2), (4.01, 1)])
@pytest.mark.parametrize("own", [0.001, 0.05])
def test_a_setting_in_another_valley_keeps_its_weight(monkeypatch, own, times, n_weighed) -> None:
    """Weighed by what is left there it would count least."""
    weighed = []

    class Model:
        def __init__(self, misfits, *_) -> None:
            self.misfits = misfits

        def weighed_at(self, *_, **said):
            weighed.append(said)
            return self

        def starts(self, apart):
            return [apart]

        def best_of(self, starts):
            return SimpleNamespace(extra=starts[0])

        def descend(self, at):
            return self.best_of([at])

    left = times * max(own, 0.02) / 100.0
    misfit = SimpleNamespace(cost=lambda _: left)
    monkeypatch.setattr(law_of_all, "OneModel", Model)
    monkeypatch.setattr(
        law_of_all, "LawMisfit", lambda *_: SimpleNamespace(on_cycles=lambda: misfit)
    )
    logs = [SettingLogs(AT[0], ())]
    steps = together._Course(logs, follows, SOLVER, 1, lambda _: None)
    steps.first([law(own).fits[0]])
    assert weighed == [{"least": 2e-4}, {}][:n_weighed]
