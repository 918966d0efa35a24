"""Each stroke's blow-off has the kind that it needs, of those that both were given."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import pytest

from damperfit.damper.network import Valve
from damperfit.damper.valve_dampers import TwinTube, ValveDamper
from damperfit.laws import LawFit, Tried
from damperfit.laws.course import valve_damper
from damperfit.laws.strokes import with_strokes_told
from damperfit.tested.setting import Setting


def damper(rebound: str, bump: str) -> ValveDamper:
    return TwinTube(rebound=Valve("orifice", rebound), compression=Valve("orifice", bump))


def law(model: ValveDamper, mse: float, force: float) -> Tried:
    free = tuple(one.name for one in model.quantities if one.default is None)
    return Tried("law", (LawFit(
        setting=Setting.of(1), model=model, values=model.values(dict.fromkeys(model.names, 1.0)),
        free=free, at_bound=(), mse_percent=mse, stretches=(mse,), held_out_percent=0.1,
        held_out="", residuals=(), evaluations=1, worst_force_percent=force,
        sure_force_percent=force,
    ),))  # fmt: skip


def told(left: dict[tuple[str, str], tuple[float, float]], first: tuple[str, str]):
    """From one kind a stroke to the next; left: MSE and force of what a fit may end with."""
    asked = []

    def fitted(model: ValveDamper, **_: object) -> Tried | None:
        kinds = model.rebound.blow_off, model.compression.blow_off
        asked.append(kinds)
        return law(model, *left[kinds]) if kinds in left else None

    course = SimpleNamespace(fitted=fitted, n_eff=60.0, record=lambda *_, **__: None)
    model = damper(*first)
    found = valve_damper(with_strokes_told(course, law(model, *left[first]), model))
    return (found.rebound.blow_off, found.compression.blow_off), asked


def test_a_stroke_that_needs_no_kind_has_a_plain_blow_off() -> None:
    left = {
        ("port", "port"): (0.01, 0.5), ("linear", "port"): (0.0105, 2.0),
        ("port", "linear"): (0.0105, 0.9),
    }  # fmt: skip
    kinds, asked = told(left, ("port", "port"))
    assert kinds == ("port", "linear")
    assert asked == [("linear", "port"), ("port", "linear")]  # nothing is left for other kinds


@pytest.mark.parametrize(("both", "bump"), [(0.0149, "linear"), (0.0151, "port")])
def test_a_kind_stays_in_a_stroke_where_neither_needs_it_but_both_do(both, bump) -> None:
    """1.45 times in one and 1.2 in the other: it went from both, was offered again, and so on."""
    left = {
        ("port", "port"): (0.01, 0.5), ("linear", "port"): (0.0125, 0.5),
        ("linear", "linear"): (both, 0.5),
    }  # fmt: skip
    assert told(left, ("port", "port"))[0] == ("linear", bump)


@pytest.mark.parametrize(("plain", "bump"), [(0.0149, "linear"), (0.0151, "port")])
def test_a_stroke_is_held_against_the_other_kind_that_its_fellow_got(plain, bump) -> None:
    """A plain blow-off that leaves less than both ports did may leave more than what came next."""
    left = {
        ("port", "port"): (0.1, 5.0), ("linear", "port"): (0.1, 5.0),
        ("lifting", "port"): (0.01, 0.5), ("lifting", "linear"): (plain, 0.5),
    }  # fmt: skip
    assert told(left, ("port", "port"))[0] == ("lifting", bump)


@pytest.mark.parametrize(("mse", "bump"), [(0.00149, "linear"), (0.00151, "port")])
def test_a_kind_that_lowers_the_mse_by_the_factor_stays_however_little_is_left(mse, bump) -> None:
    """Without a port friction that turns within a speed was taken, and another layout."""
    left = {
        ("port", "port"): (0.001, 0.5), ("linear", "port"): (0.003, 0.9),
        ("port", "linear"): (mse, 0.6),
    }  # fmt: skip
    assert told(left, ("port", "port"))[0] == ("port", bump)


def test_each_stroke_is_offered_the_other_kinds_while_something_is_left() -> None:
    """Rebound lifts further, bump has a port: one kind for both leaves 3 % of a force."""
    left = {
        ("lifting", "lifting"): (0.01, 3.0), ("linear", "lifting"): (0.02, 6.0),
        ("rounded", "lifting"): (0.015, 4.0), ("port", "lifting"): (0.012, 3.5),
        ("lifting", "linear"): (0.0101, 3.0), ("lifting", "rounded"): (0.01, 1.9),
        ("lifting", "port"): (0.009, 0.8),
    }  # fmt: skip
    assert told(left, ("lifting", "lifting"))[0] == ("lifting", "port")


@pytest.mark.parametrize(("force", "kinds"), [
    (1.99, ("lifting", "port")), (2.01, ("lifting", "lifting")),
])  # fmt: skip
def test_a_kind_of_as_many_numbers_must_be_worth_it(force, kinds) -> None:
    left = {
        ("lifting", "lifting"): (0.01, 3.0), ("lifting", "linear"): (0.01, 6.0),
        ("lifting", "port"): (0.01, force),
    }  # fmt: skip
    assert told(left, ("lifting", "lifting"))[0] == kinds


def test_where_both_are_plain_nothing_is_asked() -> None:
    assert told({("linear", "linear"): (0.1, 9.0)}, ("linear", "linear")) == (
        ("linear", "linear"), []
    )  # fmt: skip
    model = replace(damper("linear", "linear"), rebound=Valve("orifice", "none"))
    bare = law(model, 0.1, 9.0)
    assert with_strokes_told(SimpleNamespace(), bare, model) is bare
