"""Friction and gas in the oil among the laws offered: found where they are, and not invented."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from damperfit.conditioning import condition
from damperfit.damper.friction import Friction
from damperfit.damper.mounting import FIT, NONE, Mounting
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.valve_dampers import TwinTube, ValveDamper
from damperfit.laws import LawFit, LawSearch, SettingLogs, Tried, in_words, search_laws
from damperfit.laws.choosing import are_alike, effective_samples
from damperfit.laws.law_fit import fit_law, glimpsed
from damperfit.laws.search import _FURTHER, _Search
from damperfit.laws.variants import laid_out_as, with_part, words_of
from damperfit.recording import Recording, Trace
from damperfit.simulation import Motion, SolverOptions, simulate
from damperfit.tested.setting import Setting
from tests.laws.rates import TURNING, draw, parts_of
from tests.laws.rates import searched as rates_searched
from tests.laws.valve_logs import VALUES, damper, moved

SETTING = Setting.of(3)
FITTED, CHECK = moved((0.05, 0.24), cycles=3), moved((0.17,), amplitude=0.012, cycles=3)
RIGID = damper(has_play_and_lag=False)


def logged(model: ValveDamper, values: dict[str, float], motion: Motion, seed: int) -> Trace:
    """4 N and 8 um of noise."""
    force = simulate(model.values(values), model, motion).force
    chance, n = np.random.default_rng(seed), len(force)
    x = motion.displacement + chance.normal(0.0, 8e-6, n)
    time = motion.interval * np.arange(n)
    force = force + chance.normal(0.0, 4.0, n)
    return condition(Recording(f"{seed}.csv", "", "", SETTING, time, x, force))


def evidence(friction: Friction, more: dict[str, float]) -> SettingLogs:
    model = replace(RIGID, friction=friction)
    values = {name: one for name, one in VALUES.items() if name in model.names} | more
    return SettingLogs(
        SETTING, (logged(model, values, FITTED, 1),), (logged(model, values, CHECK, 2),)
    )


def searched(logs: SettingLogs) -> LawSearch:
    names = ("rod_diameter", "piston_diameter", "chamber_1_length", "chamber_2_length")
    shared = {name: getattr(RIGID, name) for name in names}
    return search_laws(replace(PURDY_DAMPER, **shared), [RIGID], [logs])


def enriched(logs: SettingLogs) -> Tried:
    """What the search makes of the law that it has found without any further part."""
    course = _Search([logs], SolverOptions(), lambda _: None, 1)
    lean = course.fitted(RIGID)
    assert lean is not None
    course.n_eff = effective_samples(lean, [logs])
    return course.enriched(lean, ("k_e", *_FURTHER))


def test_what_a_lean_law_lacks_is_found_among_all_that_it_may_lack() -> None:
    true = {"presliding": 4e-4, "f_f": 60.0}
    found = enriched(evidence(Friction(presliding=FIT), true))
    lean = "through flow: bleed and blow-off; elastic mounting"
    assert found.title == f"{lean}; friction that builds up over a distance"
    assert max(found.mse_percent, found.held_out_percent) < 0.02
    for name, number in true.items():
        assert getattr(found.fits[0].values, name) == pytest.approx(number, rel=0.1), name


@pytest.mark.parametrize(("friction", "more", "said"), [
    (Friction(presliding=FIT), {"presliding": 4e-4, "f_f": 60.0}, "friction that builds up over a"),
    (Friction(breakaway=FIT, stribeck_speed=FIT), {"breakaway": 50.0, "stribeck_speed": 0.05},
     "friction that is larger at rest"),
    (Friction(), {"free_gas": 0.02}, "also free gas"),
])  # fmt: skip
def test_what_is_in_the_logs_is_found_with_its_size(
    friction: Friction, more: dict[str, float], said: str
) -> None:
    found = searched(evidence(friction, more)).chosen
    assert found.title.startswith("through flow: bleed and blow-off; elastic mounting; ")
    assert said in found.title
    assert max(found.mse_percent, found.held_out_percent) < 0.02
    for name, true in more.items():
        assert getattr(found.fits[0].values, name) == pytest.approx(true, rel=0.1), name


def test_friction_that_turns_within_a_speed_is_offered_and_seen_in_a_few_steps() -> None:
    assert "turning_speed" in _FURTHER
    logs = evidence(Friction(turning_speed=FIT), {"turning_speed": 0.018, "f_f": 60.0})
    law = fit_law(RIGID, logs, is_whole=False)
    assert glimpsed(with_part(RIGID, "turning_speed"), logs, law) is None


@pytest.mark.slow
@pytest.mark.parametrize(("place", "is_turning"), [
    *((place, False) for place in range(9, 15)), *((place, True) for place in (0, 9, 10, 12)),
])  # fmt: skip
def test_laminar_bleeds_and_friction_that_turns_within_a_speed_are_told_apart(
    place: int, *, is_turning: bool
) -> None:
    """Each may take the other's place in a small MSE; these are dampers of `rates`."""
    one = draw(place, 1, TURNING if is_turning else "")
    found = parts_of(rates_searched(one, 1000 + 2 * place).chosen)
    assert ("turning_speed" in found) is is_turning
    assert one.model.rebound.bleed in {name.partition(" ")[2] for name in found}


def test_a_part_that_explains_nothing_is_not_followed() -> None:
    logs = evidence(Friction(), {})
    chosen = enriched(logs)
    law = chosen.fits[0]
    assert chosen.title == "through flow: bleed and blow-off; elastic mounting"
    model = with_part(law.model, "presliding")
    seen = glimpsed(model, logs, law)
    assert seen is not None
    assert seen.mse_percent > law.mse_percent / 1.1
    assert np.isnan(seen.held_out_percent)
    stuck = evidence(Friction(presliding=FIT), {"presliding": 4e-4, "f_f": 60.0})
    assert glimpsed(model, stuck, replace(law, values=law.values)) is None


@pytest.mark.parametrize(("name", "words"), [
    ("presliding", "friction that builds up over a distance"),
    ("breakaway", "friction that is larger at rest"),
    ("seal_area", "friction by the pressure on the seal"),
])  # fmt: skip
def test_a_part_of_the_friction_is_fitted_and_named(name: str, words: str) -> None:
    more = with_part(TwinTube(), name)
    assert more.friction != Friction()
    assert name in more.names
    assert words_of(more, name) == words
    assert words in in_words(more)
    assert with_part(more, name) == more


def test_a_declared_turning_speed_is_named_and_leaves_no_presliding() -> None:
    law = replace(TwinTube(), friction=Friction(turning_speed=FIT))
    assert in_words(law).endswith("; friction that turns within a speed")
    assert with_part(law, "presliding") == law
    assert with_part(law, "seal_area").friction == Friction(seal_area=FIT, turning_speed=FIT)


def test_play_needs_an_elastic_mounting() -> None:
    loose = with_part(TwinTube(), "play")
    assert loose.mounting == Mounting(FIT, FIT, NONE)
    rigid = TwinTube(mounting=Mounting(NONE))
    assert with_part(rigid, "play") == rigid
    assert with_part(rigid, "lag").mounting == Mounting(NONE, NONE, FIT)


def test_another_layout_takes_the_parts_of_a_law() -> None:
    law = with_part(with_part(RIGID, "presliding"), "lag")
    other = laid_out_as(law, TwinTube(rod_diameter=0.011))
    assert (other.name, other.rod_diameter) == ("twin_tube", 0.011)
    for part in ("rebound", "compression", "mounting", "friction"):
        assert getattr(other, part) == getattr(law, part)


@pytest.mark.parametrize(("percent", "times", "is_alike"), [
    (0.019, 3.9, True), (0.019, 4.1, False), (0.03, 1.4, True), (0.03, 1.6, False),
])  # fmt: skip
def test_layouts_that_leave_nothing_are_told_by_more(
    percent: float, times: float, *, is_alike: bool
) -> None:
    model = TwinTube()
    values = model.values({one.name: 1.0 for one in model.quantities})

    def law(mse: float) -> Tried:
        fit = LawFit(SETTING, model, values, (), (), mse, (), float("nan"), "", (), 1)
        return Tried("", (fit,))

    assert are_alike(law(percent / times), law(percent)) is is_alike
