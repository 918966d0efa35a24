"""A rigid mounting with oil that gives is taken where it fits better than one that is elastic."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import pytest

from damperfit.damper.mounting import FIT, NONE, Mounting
from damperfit.damper.valve_dampers import TwinTube
from damperfit.laws import Tried
from damperfit.laws.giving import with_what_gives_told
from tests.laws.test_undecided import MODEL, fit

RIGID = Mounting(NONE, NONE, FIT)


def tried(mse: float, **known: object) -> Tried:
    return Tried("law", (fit(mse_percent=mse, held_out_percent=0.01, **known),))


def told(law: Tried, other: Tried) -> tuple[Tried, list[TwinTube], list[str]]:
    """What is taken, the models that were asked for, and the reasons."""
    asked: list[TwinTube] = []
    said: list[str] = []
    course = SimpleNamespace(
        fitted=lambda model, **_: asked.append(model) or other,
        n_eff=60.0,
        record=lambda _, reason, **__: said.append(reason),
    )
    return with_what_gives_told(course, law), asked, said  # type: ignore[arg-type]


@pytest.mark.parametrize(("gain", "is_rigid"), [(1.09, False), (1.11, True)])
def test_what_gives_is_what_fits_better(gain: float, *, is_rigid: bool) -> None:
    law, other = tried(0.005 * gain), tried(0.005)
    taken, asked, said = told(law, other)
    assert taken is (other if is_rigid else law)
    assert [one.mounting for one in asked] == [RIGID]
    assert "as many quantities" in said[0] if is_rigid else "fits no better" in said[0]


@pytest.mark.parametrize(
    "law",
    [
        tried(1.0, model=replace(MODEL, mounting=Mounting(FIT, FIT, FIT))),
        tried(1.0, model=replace(MODEL, mounting=RIGID)),
        tried(1.0, model=replace(MODEL, mounting=Mounting(4e5, NONE, FIT))),
        tried(1.0, free=("k_s", "k_e")),
    ],
    ids=["play", "rigid", "measured", "both"],
)
def test_what_has_play_or_is_known_is_not_asked_about(law: Tried) -> None:
    taken, asked, _ = told(law, tried(0.001))
    assert taken is law
    assert asked == []
