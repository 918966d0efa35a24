"""What a search has taken is asked for again beside what came after it; what it found is kept."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import pytest

from damperfit.damper.friction import Friction
from damperfit.damper.mounting import FIT, Mounting
from damperfit.damper.valve_dampers import Monotube, TwinTube
from damperfit.laws import SettingLogs, Tried, course, search
from damperfit.laws.variants import BLEED, BLOW_OFF, BOTH, without_part
from damperfit.simulation import SolverOptions
from damperfit.tested.setting import Setting
from tests.laws.valve_logs import damper

PLAIN = replace(damper(), rebound=BOTH, compression=BOTH, mounting=Mounting(FIT))
TURNING = replace(PLAIN, friction=Friction(presliding=FIT))


def law(model, freed: tuple[str, ...], mse: float = 0.001) -> SimpleNamespace:
    return SimpleNamespace(
        model=model, freed=freed, mse_percent=mse, fits=(SimpleNamespace(model=model),)
    )


def asked(monkeypatch, more: list[str], needed: str = "", elsewhere: str = "", of_one=()):
    """What becomes of a law with a gas volume and friction that builds up, and what was said."""
    said: list[tuple[str, bool, str]] = []
    monkeypatch.setattr(course, "freed_of", lambda one: one.freed)

    def judged(small, large, _n_eff):
        gone = {*large.freed} - {*small.freed} or {"presliding"}
        return SimpleNamespace(takes_larger=needed in gone, reason="as judged")

    monkeypatch.setattr(course, "judged", judged)
    monkeypatch.setattr(course, "needed_at", lambda *of: elsewhere if of[2] else "")
    steps = course.Course([], SolverOptions(), lambda _: None, 1, elsewhere=["another"])
    steps.more, steps.of_one = more, [*of_one]
    monkeypatch.setattr(steps, "fitted", lambda model, **how: law(model, how["freed"]))
    monkeypatch.setattr(
        steps, "record", lambda _, why, **how: said.append((how["change"], how["is_taken"], why))
    )
    return steps.without_early(law(TURNING, ("gas_volume",))), said


def test_a_gas_volume_goes_whose_place_a_friction_takes(monkeypatch) -> None:
    """What was taken last is not asked for: it has been taken beside all else."""
    found, said = asked(monkeypatch, ["gas_volume", "presliding"])
    assert (found.model, found.freed) == (TURNING, ())
    assert said == [("without gas volume", True, "as judged")]


def test_a_friction_goes_whose_place_a_gas_volume_takes(monkeypatch) -> None:
    found, said = asked(monkeypatch, ["presliding", "gas_volume"])
    assert (found.model, found.freed) == (PLAIN, ("gas_volume",))
    assert said == [("without friction that builds up over a distance", True, "as judged")]


@pytest.mark.parametrize(("of_one", "goes"), [(["gas_volume"], True), ([], False)])
def test_what_one_setting_asked_for_last_is_asked_at_all(monkeypatch, of_one, goes) -> None:
    """Free gas led another setting to where neither needs it: `joint_rates`, place 166."""
    found, said = asked(monkeypatch, ["gas_volume"], of_one=of_one)
    assert found.freed == (() if goes else ("gas_volume",))
    assert said == ([("without gas volume", True, "as judged")] if goes else [])


def test_what_is_needed_stays(monkeypatch) -> None:
    found, said = asked(monkeypatch, ["gas_volume", "presliding"], needed="gas_volume")
    assert found.freed == ("gas_volume",)
    assert said == [("without gas volume", False, "it lacks a part that is needed: as judged")]


def test_what_another_setting_needs_stays(monkeypatch) -> None:
    why = "setting 3 needs it"
    found, said = asked(monkeypatch, ["gas_volume", "presliding"], elsewhere=why)
    assert found.freed == ("gas_volume",)
    assert said == [("without gas volume", False, why)]


@pytest.mark.parametrize(("more", "goes"), [([], False), (["k_e"], True)])
def test_a_lag_goes_that_softer_oil_has_made_needless(monkeypatch, more, goes) -> None:
    """It was told before the oil's bulk modulus was offered: `joint_rates`, place 187."""
    monkeypatch.setattr(course, "freed_of", lambda one: one.freed)
    monkeypatch.setattr(
        course, "judged", lambda *_: SimpleNamespace(takes_larger=False, reason="as judged")
    )
    monkeypatch.setattr(course, "needed_at", lambda *_: "")
    steps, said = course.Course([], SolverOptions(), lambda _: None, 1), []
    steps.more = more
    monkeypatch.setattr(steps, "fitted", lambda model, **how: law(model, how["freed"]))
    monkeypatch.setattr(steps, "record", lambda *_, **how: said.append(how["change"]))
    late = replace(PLAIN, mounting=Mounting(FIT, play=FIT, lag=FIT))
    found = steps.without_early(law(late, ("k_e",)))
    assert found.model == (replace(PLAIN, mounting=Mounting(FIT)) if goes else late)
    assert said == (["without a lag of the force", "without play"] if goes else [])


@pytest.mark.parametrize("more", [[], ["gas_volume"], ["drag", "presliding"], ["port", "drag"]])
def test_what_a_law_has_not_or_kinds_of_valves_are_not_asked_for(monkeypatch, more) -> None:
    """Kinds are asked for stroke by stroke as soon as they are taken."""
    _, said = asked(monkeypatch, more)
    assert said == []


@pytest.mark.parametrize(("mse", "goes"), [(0.39, True), (0.41, False)])
def test_what_is_hopeless_without_a_part_is_not_taken_for_it(monkeypatch, mse, goes) -> None:
    """Twenty times 0.02 %: it was left before its descents, and counts as absent at an edge."""
    monkeypatch.setattr(course, "freed_of", lambda one: one.freed)
    monkeypatch.setattr(
        course, "judged", lambda *_: SimpleNamespace(takes_larger=False, reason="it is absent")
    )
    monkeypatch.setattr(course, "needed_at", lambda *_: "")
    steps, said, asked = course.Course([], SolverOptions(), lambda _: None, 1), [], []

    def fitted(model, *, freed, hopeless_percent, **_):
        asked.append(hopeless_percent)
        return law(model, freed, mse)

    monkeypatch.setattr(steps, "fitted", fitted)
    monkeypatch.setattr(
        steps, "record", lambda _, why, **how: said.append((how["change"], how["is_taken"], why))
    )
    late = replace(PLAIN, mounting=Mounting(FIT, lag=FIT))
    found = steps.asked_again(law(late, ()), ["lag"])
    assert (found.model == PLAIN) is goes
    assert asked == [pytest.approx(0.4)]
    why = "it is absent" if goes else "it lacks a part that is needed: MSE 0.41 %"
    assert said == [("without a lag of the force", goes, why)]


def test_a_law_without_it_that_cannot_be_simulated_is_none(monkeypatch) -> None:
    monkeypatch.setattr(course, "freed_of", lambda one: one.freed)
    steps = course.Course([], SolverOptions(), lambda _: None, 1)
    steps.more = ["gas_volume", "presliding"]
    monkeypatch.setattr(steps, "fitted", lambda *_, **__: None)
    before = law(TURNING, ("gas_volume",))
    assert steps.without_early(before) is before


def test_a_part_that_its_strokes_give_up_again_is_not_offered_for_ever(monkeypatch) -> None:
    """A port was worth having in both strokes and in neither alone: the search went round."""
    steps, asked = course.Course([], SolverOptions(), lambda _: None, 1), []
    before = SimpleNamespace(
        model=PLAIN, leaves_something=True, score=0.0, fits=(SimpleNamespace(model=PLAIN),)
    )
    verdict = SimpleNamespace(takes_larger=True, gain=2.0, reason="as judged")
    monkeypatch.setattr(course, "judged", lambda *_: verdict)
    monkeypatch.setattr(course, "with_strokes_told", lambda *_: before)
    monkeypatch.setattr(steps, "offered", lambda one, name: asked.append(name) or one)
    monkeypatch.setattr(steps, "back_from", lambda one, _: one)
    monkeypatch.setattr(steps, "record", lambda *_, **__: None)
    assert steps.enriched(before, ["port"]) is before
    assert asked == ["port"]


@pytest.mark.parametrize(("kind", "is_asked"), [(Monotube, True), (TwinTube, False)])
def test_in_another_layout_every_part_is_asked_for_again(monkeypatch, kind, is_asked) -> None:
    """A friction at rest that one setting needed in the wrong layout stayed in the right one."""
    steps = search._Search([], SolverOptions(), lambda _: None, 1)
    steps.more = ["breakaway"]
    taken = law(kind(), ())
    monkeypatch.setattr(steps, "laid_out", lambda *_: taken)
    monkeypatch.setattr(steps, "asked_again", lambda one, parts: (one, tuple(parts)))
    found = steps.in_its_layout(law(TwinTube(), ()), [])
    assert found == ((taken, ("breakaway",)) if is_asked else taken)


def test_a_part_that_is_declared_is_no_part_to_do_without() -> None:
    assert without_part(TURNING, "presliding") == PLAIN
    known = replace(PLAIN, friction=Friction(presliding=2e-5))
    assert without_part(known, "presliding") == known
    loose = replace(PLAIN, mounting=Mounting(FIT, FIT, FIT))
    assert without_part(loose, "play") == replace(PLAIN, mounting=Mounting(FIT, lag=FIT))
    assert without_part(PLAIN, "gas_volume") == PLAIN


@pytest.mark.parametrize(("name", "is_fitted"), [("k_e", True), ("free_gas", True),
    ("drag", False), ("gas_volume", False)])  # fmt: skip
def test_oil_is_tried_as_far_as_gas_in_it(monkeypatch, name, is_fitted) -> None:
    """In a few steps a bulk modulus 6 % lower showed nothing, and gas stood for it."""
    steps = course.Course([SettingLogs(Setting.of(1), ())], SolverOptions(), lambda _: None, 1)
    seen = []

    def glimpsed(*_, freed, **__):
        seen.append(freed)
        return SimpleNamespace(mse_percent=1.0)

    monkeypatch.setattr(course, "freed_of", lambda one: one.freed)
    monkeypatch.setattr(course, "glimpsed", glimpsed)
    monkeypatch.setattr(steps, "fitted", lambda model, **how: law(model, how["freed"]))
    before = law(PLAIN, ())
    before.fits[0].free = ()
    found = steps.offered(before, name)
    assert found is not None
    assert seen == ([] if is_fitted else [(name,)])
    assert not is_fitted or found.freed == (name,)


@pytest.mark.parametrize(("name", "valves", "is_fitted"), [
    ("long", (BOTH, BOTH), True), ("long", (BLEED, BOTH), True), ("long", (BOTH, BLOW_OFF), True),
    ("long", (BLEED, BLEED), False), ("long", (BLEED, BLOW_OFF), False),
    ("rounded", (BOTH, BOTH), False),
])  # fmt: skip
def test_a_laminar_part_that_a_wrong_valley_hides_is_fitted_to_its_end(
    monkeypatch, name, valves, is_fitted
) -> None:
    """A friction a third too low hid it for a few steps: `joint_rates`, place 286.

    Bleeds alone hide none: with a seal's drag one was told that none has, place 2 of the disturbed.
    """
    steps = course.Course([SimpleNamespace()], SolverOptions(), lambda _: None, 1)
    seen: list[str] = []
    few = SimpleNamespace(mse_percent=1.0)
    monkeypatch.setattr(course, "freed_of", lambda one: one.freed)
    monkeypatch.setattr(course, "glimpsed", lambda *_, **__: seen.append(name) or few)
    monkeypatch.setattr(steps, "fitted", lambda model, **how: law(model, how["freed"]))
    before = law(replace(PLAIN, rebound=valves[0], compression=valves[1]), ())
    before.fits[0].free = ()
    assert steps.offered(before, name) is not None
    assert seen == ([] if is_fitted else [name])


def test_a_law_that_a_setting_needs_keeps_what_it_had_there(monkeypatch) -> None:
    """From the valley of the smaller law it had ended in another, and the others borrow its own."""
    one, two = Setting.of(1), Setting.of(2)

    def fit(setting: Setting, mse: float) -> SimpleNamespace:
        return SimpleNamespace(setting=setting, mse_percent=mse, model=PLAIN, free=())

    logs = [SettingLogs(one, ()), SettingLogs(two, ())]
    steps = search._Search(logs, SolverOptions(), lambda _: None, 1)
    alone = Tried("more", (fit(two, 0.001),))
    asked = [(logs[1], Tried("less", (fit(two, 0.5),))), None]
    monkeypatch.setattr(search, "worst_missed", lambda *_: asked.pop(0))
    monkeypatch.setattr(search, "effective_samples", lambda *_: 60.0)

    def enriched(seen, *_):
        seen.more.append("drag")
        return alone

    monkeypatch.setattr(search._Search, "enriched", enriched)
    again = Tried("more", (fit(one, 0.1), fit(two, 0.4)))
    monkeypatch.setattr(steps, "fitted", lambda *_, **__: again)
    monkeypatch.setattr(steps, "crossed", lambda found: Tried("crossed", found.fits))
    found = steps.grown(Tried("less", (fit(one, 0.6), fit(two, 0.5))), ["drag"])
    assert found.title == "crossed"
    assert steps.more == ["drag"]  # asked for again beside what comes after it, as any part
    assert steps.of_one == ["drag"]  # and at all settings, whatever comes after it
    assert found.fits == (again.fits[0], alone.fits[0])


@pytest.mark.parametrize("is_more", [True, False])
def test_kinds_that_one_setting_asked_for_are_asked_at_all(monkeypatch, is_more) -> None:
    """Shims that lift further were left beside bleeds that had ended elsewhere: place 214."""
    steps, told = search._Search([], SolverOptions(), lambda _: None, 1), []
    before, more = law(PLAIN, ()), law(TURNING, ())
    monkeypatch.setattr(steps, "grown", lambda one, _: more if is_more else one)
    monkeypatch.setattr(search, "with_strokes_told", lambda *of: told.append(of) or "told")
    found = steps.needed_by_some(before, ["lifting"])
    assert found == ("told" if is_more else before)
    assert told == ([(steps, more, TURNING)] if is_more else [])


@pytest.mark.parametrize("is_unseen", [True, False])
def test_a_blow_off_that_has_lost_its_bleed_may_be_a_laminar_one(monkeypatch, is_unseen) -> None:
    """With next to no preload it was told so beside the bleed alone: `joint_rates`, place 155."""
    steps, asked = search._Search([], SolverOptions(), lambda _: None, 1), []
    before = law(PLAIN, ())
    before.unseen = {"compression_bleed"} if is_unseen else set()
    monkeypatch.setattr(search, "_is_as_rigid", lambda _: False)
    monkeypatch.setattr(steps, "without", lambda one, _change, less: law(less(one.model), ()))
    monkeypatch.setattr(search, "with_bleeds_told", lambda _, one: asked.append(one) or "told")
    found = steps.without_unseen(before)
    if not is_unseen:
        assert (found, asked) == (before, [])
        return
    assert found == "told"
    assert [one.model.compression for one in asked] == [BLOW_OFF]
