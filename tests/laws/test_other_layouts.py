"""Which layout is taken where logs tell several alike; its valves' numbers in the others."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from damperfit.damper.mounting import NONE, Mounting
from damperfit.damper.network import Valve
from damperfit.damper.valve_dampers import Monotube, ThroughFlow, TwinTube, ValveDamper
from damperfit.laws.description import physics_seen
from damperfit.laws.law_fit import Tried
from damperfit.laws.structures import times_in
from damperfit.simulation import SolverOptions, simulate
from tests.laws.test_undecided import fit
from tests.laws.valve_logs import moved

GEOMETRY = {"gas_pressure": 2e6, "rod_diameter": 0.011, "mounting": Mounting(NONE, NONE, NONE)}
EXACT = SolverOptions(tolerance=1e-3)


def tried(model: ValveDamper, mse: float) -> Tried:
    return Tried("law", (replace(fit(), model=model, mse_percent=mse, held_out_percent=0.01),))


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


def test_oil_that_the_logs_told_is_said_and_oil_that_was_held_is_not() -> None:
    model = Monotube(**GEOMETRY | {"mounting": Mounting("fit", NONE, NONE)})
    numbers = {one.name: one.default or 1e5 for one in model.quantities}
    held = replace(fit(), model=model, values=model.values(numbers))
    assert "bulk modulus" not in " ".join(physics_seen([held]))
    freed = replace(held, values=model.values(numbers | {"k_e": 1.31e9, "drag": 12.0}))
    said = " ".join(physics_seen([freed]))
    assert "The bulk modulus of oil and chambers is 1.31 GPa." in said
    assert "Viscous drag of the seals is 12 N s/m." in said


def test_a_mass_between_load_cell_and_damper_is_said() -> None:
    model = TwinTube(mounting=Mounting(NONE, NONE, NONE, "fit"))
    numbers = {one.name: one.default or 1e5 for one in model.quantities} | {"moving_mass": 1.5}
    seen = replace(
        fit(), model=model, values=model.values(numbers),
        free=tuple(one.name for one in model.quantities if one.default is None),
    )  # fmt: skip
    assert "A mass of 1.5 kg moves between load cell and damper." in physics_seen([seen])
    heavy = replace(seen, values=model.values(numbers | {"moving_mass": 2.5}))
    said = physics_seen([seen, heavy])
    assert "A mass of 1.5 to 2.5 kg moves between load cell and damper." in said


def test_numbers_stand_beside_those_of_layouts_that_are_alike() -> None:
    model = Monotube(**GEOMETRY)
    numbers = {one.name: one.default or 1e5 for one in model.quantities}
    one = replace(fit(), model=model, values=model.values(numbers))
    times = model.annulus_area / model.piston_area
    said = " ".join(physics_seen([one], ["through_flow"]))
    force = 1e5 * model.annulus_area
    assert (
        f"In compression a blow-off opens at {force:.3g} N (1 bar; {times:.3g} in a through-flow "
        "damper)" in said
    )
    assert f"In rebound a blow-off opens at {force:.3g} N (1 bar)." in said
    assert "through-flow" not in " ".join(physics_seen([one]))
