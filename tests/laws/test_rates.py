"""What is wrong with a law that was chosen, as `rates` and `joint_rates` count it."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import pytest

from damperfit.damper.network import Valve
from tests.laws.rates import Drawn, draw, verdict_on

PLAIN = draw(6, 1)


def verdict(true: Valve, found: Valve) -> tuple[str, ...]:
    """Of a damper whose both valves are so, told as others."""
    one, told = (replace(PLAIN.model, rebound=valve, compression=valve) for valve in (true, found))
    fit = SimpleNamespace(model=told, free=())
    search = SimpleNamespace(chosen=SimpleNamespace(fits=(fit,)), alike=())
    return verdict_on(Drawn(one, PLAIN.values), search)


@pytest.mark.parametrize(("true", "found", "wrong"), [
    (Valve("long", "rounded"), Valve("long", "rounded"), ()),
    (Valve("long", "rounded"), Valve("leak", "linear"), ("missed",)),
    (Valve("long", "port"), Valve("orifice", "linear"), ("missed",)),
    (Valve("long", "none"), Valve("none", "linear"), ("larger", "missed")),
    (Valve("leak", "linear"), Valve("long", "linear"), ("larger", "missed")),
    (Valve("leak", "linear"), Valve("orifice", "linear"), ("larger", "missed")),
    (Valve("none", "rounded"), Valve("none", "power"), ("larger", "missed")),
    (Valve("none", "linear"), Valve("leak", "linear"), ("larger",)),
    (Valve("none", "power"), Valve("orifice", "linear"), ("larger", "missed")),
    (Valve("leak", "linear"), Valve("none", "linear"), ("missed",)),
])  # fmt: skip
def test_a_kind_that_lacks_a_number_of_the_true_one_is_no_larger_law(true, found, wrong) -> None:
    assert verdict(true, found) == wrong
