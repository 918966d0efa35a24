"""Candidate structures: what is one move away, and what is never taken out or offered."""

from __future__ import annotations

from dataclasses import replace

import pytest

from damperfit.damper.mounting import FIT, NONE, Friction, Mounting
from damperfit.damper.network import Valve
from damperfit.damper.valve_dampers import Monotube, ThroughFlow, TwinTube
from damperfit.laws.structures import BOTH, Structure, moves

WHOLE = TwinTube(rebound=BOTH, compression=BOTH, mounting=Mounting(FIT, FIT, FIT))


def test_each_move_changes_one_part_and_leads_back() -> None:
    here = Structure(replace(WHOLE, friction=Friction(presliding=FIT)), ("drag",))
    for words, there in moves(here).items():
        assert there != here
        known = {(one.damper, frozenset(one.freed)) for one in moves(there).values()}
        is_both = "both strokes" in words
        assert is_both or (here.damper, frozenset(here.freed)) in known, words


@pytest.mark.parametrize("valve", [Valve("orifice", "none"), Valve("none", "linear")])
def test_a_valve_keeps_a_way_for_the_oil(valve: Valve) -> None:
    for one in moves(Structure(replace(WHOLE, rebound=valve))).values():
        for own in (one.damper.rebound, one.damper.compression):
            assert (own.bleed, own.blow_off) != (NONE, NONE)


def test_what_was_measured_is_not_taken_out() -> None:
    measured = replace(WHOLE, mounting=Mounting(3e5, NONE, 8e-3))
    for one in moves(Structure(measured)).values():
        assert one.damper.mounting.lag == 8e-3
        assert one.damper.mounting.series_stiffness == 3e5


def test_play_needs_an_elasticity_and_friction_turns_in_one_way() -> None:
    rigid = Structure(replace(WHOLE, mounting=Mounting(NONE, NONE, NONE)))
    assert "with play" not in moves(rigid)
    turning = Structure(replace(WHOLE, friction=Friction(turning_speed=FIT)))
    assert "with friction that builds up over a distance" not in moves(turning)


def test_another_layout_has_the_parts_that_it_can_have() -> None:
    law = Structure(WHOLE, ("return_slope", "drag"))
    there = law.laid_out(Monotube())
    assert there.freed == ("drag",)  # a monotube has no return checks
    assert there.damper.mounting == WHOLE.mounting
    assert law.laid_out(ThroughFlow()).freed == law.freed


def test_what_has_a_default_is_held_unless_it_is_freed() -> None:
    assert "drag" in Structure(WHOLE).held
    assert "drag" not in Structure(WHOLE, ("drag",)).held
