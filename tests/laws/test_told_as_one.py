"""When a law is told as one model, what follows which adjuster then, where joint fits start."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import pytest

from damperfit.configuration.loading import load_configuration
from damperfit.damper.network import Valve
from damperfit.damper.valve_dampers import Monotube, TwinTube
from damperfit.errors import SimulationError
from damperfit.identification import GivenStart
from damperfit.identification.following import Way
from damperfit.identification.joint import _as_one_model
from damperfit.laws import LawSearch, Tried
from damperfit.run import auto_model as one_law
from damperfit.run.auto_model import told_as_one
from damperfit.tested.setting import Setting

LAYOUT = TwinTube()
LONG = replace(LAYOUT, rebound=Valve("long", "port"))
AT = [Setting((("l", low), ("h", 1))) for low in (6, 14)]
ADJUSTERS = {"l": ["rebound.bleed"], "h": ["rebound.opening"]}


def search(model=LAYOUT, **more: object) -> LawSearch:
    fits = tuple(
        SimpleNamespace(setting=one, model=model, values=None, free=("f_0",)) for one in AT
    )
    return LawSearch((), Tried("law", fits), 30.0, alike=("monotube",), **more)


def configuration(
    procedure: str = "joint",
    adjusters: object = ADJUSTERS,
    *,
    is_open: bool = False,
    **more: object,
):
    overlay = {"identification": {"procedure": procedure, **more}}
    if procedure == "joint":
        overlay["adjusters"] = adjusters
    if not is_open:
        overlay["damper"] = {"model": "twin_tube"}
    return load_configuration(None, overlay=overlay, is_law_open=is_open)


def asked(monkeypatch, found: LawSearch, config, n: int = 2, taken=None):
    """What is asked of one model, and what comes of it."""
    said = []

    def told(fits, logs, follows, **more):
        said.append((fits, logs, follows, more))
        own = [SimpleNamespace(setting=one.setting, model=taken or one.model) for one in fits]
        return SimpleNamespace(
            laws=("rung",), chosen=Tried("richer", tuple(own)), alike=("twin_tube",)
        )

    monkeypatch.setattr(one_law, "told_together", told)
    evidence = [SimpleNamespace(setting=one) for one in reversed(AT)]
    layouts = [SimpleNamespace(name=name) for name in ("monotube", "twin_tube", "through_flow")]
    fits = found.chosen.fits[:n]
    result = told_as_one(
        config, found, fits, evidence, layouts=layouts, jobs=1, on_law=lambda _: None
    )
    return result, said


def test_the_law_of_one_model_takes_the_place_of_that_of_settings(monkeypatch) -> None:
    (found, fits), said = asked(monkeypatch, search(), configuration())
    assert found.chosen.title == "richer"
    assert found.laws == ("rung",)
    assert found.is_of_one_model
    assert [one.setting for one in fits] == AT
    [(_, logs, follows, more)] = said
    assert [one.setting for one in logs] == AT
    # Those too that single settings have told apart: each of them may lie in a wrong valley.
    assert [one.name for one in more["layouts"]] == ["monotube", "through_flow"]
    free = ("rebound_leak", "rebound_bleed", "rebound_opening", "rebound_port", "f_f", "f_0")
    assert follows(LONG, free) == {
        "rebound_leak": ("l",), "rebound_bleed": ("l",), "rebound_opening": ("h",),
        "f_0": ("l", "h"),
    }  # fmt: skip


@pytest.mark.parametrize(("taken", "alike"), [(None, "monotube"), (Monotube(), "twin_tube")])
def test_layouts_alike_are_those_beside_the_one_that_is_taken(monkeypatch, taken, alike) -> None:
    (found, _), _ = asked(monkeypatch, search(), configuration(), taken=taken)
    assert found.alike == (alike,)


@pytest.mark.parametrize("adjusters", [ADJUSTERS, {"l": "", "h": ""}])
def test_a_damper_whose_model_nobody_has_named_has_one_too(monkeypatch, adjusters) -> None:
    """Nothing of the paper's model follows an adjuster of valves, and it shares two quantities."""
    config = configuration(adjusters=adjusters, is_open=True)
    assert config.damper.name == "purdy"
    monkeypatch.setattr(one_law, "_told", lambda *_, **__: Way((), (), {}))
    assert asked(monkeypatch, search(), config)[0][0].is_of_one_model


def test_where_the_logs_tell_the_way_new_parts_follow_those_beside_them(monkeypatch) -> None:
    way = Way(("f_0",), ("rebound_bleed", "rebound_slope"), {
        "rebound_bleed": ("l",), "rebound_slope": ("h",)
    })  # fmt: skip
    monkeypatch.setattr(one_law, "_told", lambda *_, **__: way)
    _, said = asked(monkeypatch, search(), configuration(adjusters={"l": "", "h": ""}))
    free = ("rebound_leak", "rebound_slope", "rebound_port", "f_f", "f_0")
    assert said[0][2](LONG, free) == {
        "rebound_leak": ("l",), "rebound_slope": ("h",), "rebound_port": ("h",), "f_0": ("l", "h"),
    }  # fmt: skip


@pytest.mark.parametrize(("found", "config", "n"), [
    (search(), configuration("plain"), 2),
    (search(), configuration(adjusters={"l": "", "h": ""}, share=["f_f"]), 2),
    (search(), configuration(), 1),
    (search(also="Bouc-Wen"), configuration(), 2),
    (search(load_configuration(None).damper), configuration(), 2),
])  # fmt: skip
def test_else_the_law_stays_as_it_is(monkeypatch, found, config, n) -> None:
    (left, fits), said = asked(monkeypatch, found, config, n)
    assert left is found
    assert len(fits) == n
    assert not said


def test_a_law_that_is_no_one_model_stays_as_it_is(monkeypatch) -> None:
    def refused(*_, **__):
        raise SimulationError("no")

    found = search()
    monkeypatch.setattr(one_law, "_follows", refused)
    assert asked(monkeypatch, found, configuration())[0][0] is found


def test_a_joint_fit_starts_where_one_model_has_ended() -> None:
    way = Way((), ("f_f",), {}, is_general=True)
    values = LAYOUT.values({one.name: 1.0 for one in LAYOUT.quantities})
    fits = {one: SimpleNamespace(parameters=values) for one in AT}

    def start(frictions: tuple[float, ...], *, is_of_one_model: bool = True):
        told = {one: {"f_f": x, "k_e": 9.0} for one, x in zip(AT, frictions, strict=False)}
        own = GivenStart(by_setting=told, is_of_one_model=is_of_one_model)
        given = SimpleNamespace(options=SimpleNamespace(start=own))
        return _as_one_model(given, fits, way, ("f_f",))

    assert [one.f_f for one in start((20.0, 20.0)).values()] == [20.0, 20.0]
    assert {one.k_e for one in start((20.0, 20.0)).values()} == {1.0}
    assert start((20.0, 21.0)) == {}
    assert start((20.0,)) == {}
    assert start((20.0, 20.0), is_of_one_model=False) == {}
