"""What stands for another part in one model of all settings gives way to it."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import pytest

from damperfit.damper.friction import Friction
from damperfit.damper.mounting import FIT, Mounting
from damperfit.errors import SimulationError
from damperfit.identification.sharing import Unknown
from damperfit.laws import law_fit, thinning, together
from damperfit.laws.choosing import OfOneModel, judged
from damperfit.laws.common_parts import (
    blow_off_kinds,
    made_of,
    other_parts,
    stand_ins,
    without_kinds,
)
from damperfit.laws.friction_at_rest import with_whole_friction
from damperfit.laws.law_of_all import LawOfAll, led_back, values_of_less, values_of_more
from damperfit.laws.variants import without_part
from tests.laws.test_together import AT, LIFTING, PLAIN, PORT, SOLVER, follows, law, values_at

RUBBING = replace(PLAIN, friction=Friction(breakaway=FIT, stribeck_speed=FIT))


def test_what_rubs_at_rest_is_the_friction_of_a_law_that_has_no_more_there() -> None:
    """Beside 20 N at rest 0.001 N slid: without them no descent led back from nothing."""
    near = values_at(RUBBING, AT[0], f_f=1e-3, breakaway=20.0, stribeck_speed=0.2)
    assert with_whole_friction(near, PLAIN).f_f == pytest.approx(20.001)
    assert with_whole_friction(near, RUBBING) is near
    plain = values_at(PLAIN, AT[0], f_f=12.0)
    assert with_whole_friction(plain, PLAIN) is plain
    free = tuple(one.name for one in PLAIN.quantities if one.default is None)
    assert values_of_less(PLAIN, free, near).f_f == pytest.approx(20.001)


def test_a_law_with_another_part_for_it_starts_with_the_whole_friction(monkeypatch) -> None:
    near = values_at(RUBBING, AT[0], f_f=1e-3, breakaway=20.0, stribeck_speed=0.2)
    before = SimpleNamespace(values={AT[0]: near})
    model = SimpleNamespace(
        quantities=PLAIN.quantities, names=PLAIN.names,
        start=lambda *_: [values_at(PLAIN, AT[0], f_f=3.0)],
    )  # fmt: skip
    misfits = {AT[0]: SimpleNamespace(absent_beside=lambda _: {})}
    one = SimpleNamespace(model=model, free=("f_f", "k_s"), misfits=misfits)
    evidence = {AT[0]: SimpleNamespace(fitted=())}
    for at in values_of_more(before, one, (), evidence):
        assert at[AT[0]].f_f == pytest.approx(20.001)


def test_what_may_stand_for_what() -> None:
    """Kinds of blow-offs for each other; friction at rest for what oil and returns are held at."""
    core, own = without_kinds(replace(LIFTING, friction=RUBBING.friction), ("drag",))
    told = stand_ins(core, (), own)
    found = {part.words: [one.words for one in rivals] for part, rivals, _ in told}
    assert list(found) == [
        "friction that is larger at rest",
        "a blow-off that lifts further the harder it is pressed in rebound",
    ]
    assert list(found.values()) == [
        ["return checks", "bulk modulus of oil and chamber"],
        ["a blow-off that lifts gradually in rebound", "a port behind the blow-off in rebound"],
    ]
    assert [fewer for *_, fewer in told] == [True, False]
    freed = [one for one in other_parts(core, ()) if one.freed == ("return_slope",)]
    [(_, rivals, _)] = stand_ins(core, ("k_e",), [own[0], *freed])
    assert rivals == []  # both are fitted already
    assert stand_ins(PLAIN, (), ()) == []


def swapped(monkeypatch, parts, left: float, ends: dict[str, tuple[float, float]]) -> str:
    """Which part a law has after it, where each rival leaves an MSE and a force."""
    steps = together._Course([], follows, SOLVER, 1, lambda _: None)
    best = law(0.01, force=left)

    def with_more(_core, _law, parts):
        if parts[-1].words not in ends:
            raise SimulationError("no")
        return SimpleNamespace(parts=parts, own_freed=())

    monkeypatch.setattr(steps, "with_more", with_more)
    monkeypatch.setattr(
        steps, "tried",
        lambda one: law(ends[one.parts[-1].words][0], force=ends[one.parts[-1].words][1]),
    )  # fmt: skip
    rich = SimpleNamespace(parts=tuple(parts), own_freed=())
    found, tried = steps.swapped(PLAIN, rich, best)
    assert (tried is best) is (found is rich)
    assert all(not one.is_taken for one in steps.judged)
    return found.parts[-1].words


GRADUAL, LIFTS, BEHIND = (one.words for one in blow_off_kinds("rebound"))


@pytest.mark.parametrize(("left", "ends", "becomes"), [
    (4.0, {GRADUAL: (0.009, 4.0)}, GRADUAL), (4.0, {GRADUAL: (0.0092, 4.0)}, LIFTS),
    (4.0, {GRADUAL: (0.005, 4.07)}, GRADUAL), (4.0, {GRADUAL: (0.005, 4.09)}, LIFTS),
    (4.0, {GRADUAL: (0.005, 4.0), BEHIND: (0.004, 4.0)}, BEHIND),
    (4.0, {BEHIND: (0.005, 4.0), GRADUAL: (0.004, 4.0)}, GRADUAL),
    (0.99, {GRADUAL: (0.001, 0.1)}, LIFTS),  # nothing is left: no kind is looked for
    (4.0, {}, LIFTS),
])  # fmt: skip
def test_another_kind_of_blow_off_must_fit_a_tenth_better(monkeypatch, left, ends, becomes) -> None:
    parts = [one for one in blow_off_kinds("rebound") if one.words == LIFTS]
    assert swapped(monkeypatch, parts, left, ends) == becomes


@pytest.mark.parametrize(("left", "mse", "force", "goes"), [
    (0.5, 0.0101, 0.5, True), (0.5, 0.0103, 0.5, False),
    (2.0, 0.0101, 2.03, True), (2.0, 0.0101, 2.05, False),
])  # fmt: skip
def test_what_was_supposed_needs_fewer_numbers_and_fit_as_well(
    monkeypatch, left, mse, force, goes
) -> None:
    """Friction at rest was told for a slope of the returns: `joint_rates`, place 180."""
    [part] = (
        one for one in other_parts(PLAIN, ()) if one.words == "friction that is larger at rest"
    )
    ends = {"return checks": (mse, force)}
    becomes = swapped(monkeypatch, [part], left, ends)
    assert becomes == ("return checks" if goes else part.words)


@pytest.mark.parametrize(("held", "goes"), [(0.0549, True), (0.0551, False)])
def test_what_stands_in_predicts_what_was_held_out_no_worse(held, goes) -> None:
    best, one = law(0.01, held=0.01), law(0.005, held=held)
    assert thinning._is_better(best, one, is_fewer=True)[0] is goes
    assert thinning._is_better(best, one, is_fewer=False)[0] is goes


def test_friction_at_rest_is_whole_where_a_law_starts_from_another() -> None:
    """Log by log, and where a larger law has led one of all settings."""
    near = values_at(RUBBING, AT[0], f_f=1e-3, breakaway=20.0, stribeck_speed=0.2)
    misfit = SimpleNamespace(model=PLAIN, free=("f_f",), absent_beside=lambda _: {})
    assert law_fit._beside(misfit, near)[0]["f_f"] == pytest.approx(20.001)
    led = []
    one = SimpleNamespace(
        free=("f_f",), with_common=lambda at: led.append(at[AT[0]].f_f),
        descend=lambda _: SimpleNamespace(cost=2.0),
    )  # fmt: skip
    small = LawOfAll(PLAIN, (), one, SimpleNamespace(
        cost=1.0, extra={AT[0]: values_at(PLAIN, AT[0], f_f=12.0)}
    ))  # fmt: skip
    large = LawOfAll(RUBBING, (), one, SimpleNamespace(extra={AT[0]: near}))
    assert led_back(small, large) is small
    assert led == [pytest.approx(20.001)]


def test_the_bulk_modulus_is_asked_last() -> None:
    core, _ = without_kinds(PLAIN)
    offered = list(other_parts(PLAIN, ()))
    model, freed = made_of(core, (), offered)
    errors = {Unknown(name): 9.0 if name == "k_e" else 0.1 for name in model.names}
    one = SimpleNamespace(errors=lambda _: errors)
    found = LawOfAll(model, freed, one, None, tuple(offered)).by_looseness(core)
    assert found[-1].freed == ("k_e",)


def test_a_rigid_damper_has_its_bulk_modulus_fitted_already() -> None:
    rigid = replace(RUBBING, mounting=Mounting("none"))
    core, own = without_kinds(rigid)
    [(_, rivals, _)] = stand_ins(core, (), own)
    assert [one.words for one in rivals] == ["return checks"]
    assert all(one.freed != ("k_e",) for one in other_parts(rigid, ()))


def test_friction_at_rest_of_which_a_number_is_declared_is_no_part_of_the_logs() -> None:
    """Without the part it was refused: a Stribeck speed belongs to friction at rest."""
    half = replace(PLAIN, friction=Friction(breakaway=FIT, stribeck_speed=0.05))
    assert without_part(half, "breakaway") is half
    assert without_part(RUBBING, "breakaway") == PLAIN
    assert without_kinds(half) == (half, ())
    assert stand_ins(half, (), ()) == []


def test_steps_of_a_search_are_taken(monkeypatch) -> None:
    """What stands in for another part is looked for once the law has been thinned out."""
    steps, done = together._Course([], follows, SOLVER, 1, lambda _: None), []
    rich, best = LawOfAll(PORT, (), SimpleNamespace(unknowns=range(9)), None), law(0.1)
    for name in ("with_whole_valves", "with_all"):
        monkeypatch.setattr(steps, name, lambda *_: rich)
    for name in ("thinned", "turned", "swapped", "cheaper"):
        monkeypatch.setattr(steps, name, lambda *_, name=name: done.append(name) or (rich, best))
    monkeypatch.setattr(steps, "led_back", lambda *said: said[:2])
    monkeypatch.setattr(steps, "tried", lambda _: best)
    steps.n_eff = 60.0
    steps.enriched(rich, law(0.2))
    assert done == ["thinned", "turned", "swapped", "cheaper"]


@pytest.mark.parametrize(("small", "is_less", "takes"), [
    (0.151, True, True), (0.149, True, False),  # 1.5 times 0.1 %
    (0.151, False, False), (20.0, False, False),
])  # fmt: skip
def test_a_part_that_is_needed_is_not_absent_at_the_far_edge(small, is_less, takes) -> None:
    """Without it the law left 193 times as much, and was taken: `joint_rates`, place 214."""
    less = law(small, free=("f_f",))
    more = law(0.1, at_bound=("rebound_port",))
    price = OfOneModel(1, 1.1, is_less=is_less)
    assert judged(less, more, 200.0, of_one_model=price).takes_larger is takes
    nothing = law(0.1, at_bound=("rebound_port",), absent=("rebound_port",))
    assert not judged(
        less, nothing, 200.0, of_one_model=OfOneModel(1, 1.1, is_less=is_less)
    ).takes_larger


def test_without_a_part_a_law_is_held_against_it_as_less(monkeypatch) -> None:
    steps, asked = together._Course([], follows, SOLVER, 1, lambda _: None), []
    steps.n_eff = 60.0
    monkeypatch.setattr(thinning, "judged", lambda *_, of_one_model: asked.append(of_one_model) or (
        SimpleNamespace(takes_larger=False, gain=1.0, bic=-1.0, reason="so")
    ))  # fmt: skip
    rich, less = (LawOfAll(PORT, (), SimpleNamespace(unknowns=range(n)), None) for n in (9, 8))
    part = blow_off_kinds("rebound")[0]
    steps.smaller_of((less, law(0.1)), rich, law(0.1), "without", part)
    steps.bare_of((less, law(0.1)), rich, law(0.1), "without play")
    steps.held_against(less, law(0.1), rich, law(0.1), least_gain=1.5)
    assert [one.is_less for one in asked] == [True, True, False]
    assert math.isclose(asked[0].least_gain, 1.1)
