"""Candidate structures: what is one move away, and what is never taken out or offered."""

from dataclasses import replace

import numpy as np
import pytest

from damperfit.damper.mounting import FIT, NONE, Friction, Mounting
from damperfit.damper.network import Valve
from damperfit.damper.valve_dampers import Monotube, ThroughFlow, TwinTube, ValveDamper
from damperfit.laws.law_fit import Candidate
from damperfit.laws.structures import BOTH, Structure, moves, times_in
from damperfit.simulation import SolverOptions, simulate
from tests.laws.test_undecided import fit
from tests.laws.valve_logs import moved

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


# Which layout is taken where logs tell several alike; its valves' numbers in the others.

GEOMETRY = {"gas_pressure": 2e6, "rod_diameter": 0.011, "mounting": Mounting(NONE, NONE, NONE)}
EXACT = SolverOptions(tolerance=1e-3)


def tried(model: ValveDamper, mse: float) -> Candidate:
    return Candidate("law", (replace(fit(), model=model, mse_percent=mse, held_out_percent=0.01),))


@pytest.mark.parametrize("valve", [Valve("orifice", "linear"), Valve("leak", "none")])
@pytest.mark.parametrize("layout", ["monotube", "twin_tube"])
def test_the_numbers_of_another_layout_give_the_same_force(layout: str, valve: Valve) -> None:
    own = ThroughFlow(**GEOMETRY, rebound=valve, compression=valve)
    other = {"monotube": Monotube, "twin_tube": TwinTube}[layout](
        **GEOMETRY, rebound=valve, compression=valve
    )
    numbers = {
        "rebound_opening": 8e5, "rebound_bleed": 6e4, "rebound_slope": 4e6, "rebound_leak": 9e6,
        "compression_opening": 3e5, "compression_bleed": 3e4, "compression_slope": 2e6,
        "compression_leak": 4e6, "f_f": 20.0, "f_0": 0.0, "k_e": 1e10, "return_slope": 1e3,
    }  # fmt: skip
    known = {name: one for name, one in numbers.items() if name in own.names}
    there = {name: one * times_in(layout, own, name) for name, one in known.items()}
    assert there != known
    motion = moved((0.2,), rate=1000.0, cycles=2)
    force = [
        simulate(
            one.values({name: given[name] for name in one.names if name in given}),
            one, motion, options=EXACT,
        ).force
        for one, given in ((own, known), (other, there))
    ]  # fmt: skip
    # Beside the turns, where the oil's compression differs with the layout.
    moves = np.abs(motion.velocity) > 0.5 * np.max(np.abs(motion.velocity))
    assert np.max(np.abs(force[0] - force[1])[moves]) < 0.01 * np.ptp(force[0])
