"""A valve's characteristic, read off loops, lies on the law that made them and off a wrong one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from damperfit.damper.mounting import Mounting
from damperfit.damper.network import Valve, law_flow, simulate_network
from damperfit.damper.valve_dampers import Monotube, ThroughFlow, TwinTube
from damperfit.damper.valves import valve_characteristics
from damperfit.simulation import sine_motion
from tests.damper.test_valve_dampers import LAYOUTS, VALVES, damper, log


def misses(one) -> np.ndarray:
    """Measured less law, as shares of the largest flow, where the valve is open."""
    law = np.interp(one.drop, one.law_drop, one.law_flow)
    return ((one.flow - law) / one.law_flow[-1])[one.drop > 0.3 * one.drop.max()]


def truth(model, **more):
    numbers = {**VALVES, "return_slope": 2e5, "k_e": 9e8, "k_s": 4e5}
    if model.name == "twin_tube":  # the rod is small: its valve makes as much force as the piston's
        numbers |= {
            "compression_bleed": 8e4, "compression_opening": 1.5e6, "compression_slope": 2e7,
        }  # fmt: skip
    numbers |= more
    return model.values({name: numbers[name] for name in numbers if name in model.names})


@LAYOUTS
def test_what_the_loops_show_lies_on_the_law_that_made_them(kind) -> None:
    model = damper(kind, Mounting("fit", "none", "fit"))
    values = truth(model, lag=6e-3, drag=20.0)
    found = valve_characteristics(model, values, [log(model, values)])
    assert [one.stroke for one in found] == ["rebound", "bump"]
    for one, area in zip(found, model.pressed_areas, strict=True):
        # The base valve is read through the piston's return, by the small area of the rod.
        limit = 0.03 if (kind, one.stroke) == (TwinTube, "bump") else 0.01
        assert np.median(np.abs(misses(one))) < limit
        assert np.percentile(np.abs(misses(one)), 90) < 0.03
        stroke = "compression" if one.stroke == "bump" else one.stroke
        assert one.opening == getattr(values, f"{stroke}_opening")
        assert one.area == area
        assert one.opening in one.law_drop


@LAYOUTS
def test_a_wrong_law_leaves_what_the_loops_show(kind) -> None:
    model = damper(kind, Mounting("fit", "none", "none"))
    values = truth(model)
    wrong = values.replace(rebound_opening=2.5e5, compression_slope=1.5 * values.compression_slope)
    for one in valve_characteristics(model, wrong, [log(model, values)]):
        assert np.percentile(np.abs(misses(one)), 90) > 0.05


@pytest.mark.parametrize("bleed", ["none", "orifice", "leak", "long"])
@pytest.mark.parametrize("blow_off", ["none", "linear", "port", "rounded", "lifting"])
def test_the_law_is_that_of_the_core(bleed, blow_off) -> None:
    """A stiff monotube: the flow through its piston valve is what the rod side loses."""
    if bleed == blow_off == "none":
        return
    valve = Valve(bleed, blow_off)
    model = Monotube(rebound=valve, gas_pressure=2.5e6, mounting=Mounting("none"))
    own = {
        "bleed": 5e4, "leak": 2e6, "opening": 4.5e5, "slope": 5e6, "port": 6e4, "width": 1e5,
        "lift": 3e-6,
    }  # fmt: skip
    numbers = {f"rebound_{part}": value for part, value in own.items()} | VALVES | {"k_e": 5e10}
    values = model.values({name: numbers[name] for name in numbers if name in model.names})
    motion = sine_motion(0.02, 1.5, cycles=2, sample_rate=2000)
    known = dict(zip(values.names, values.numbers, strict=True))
    response = simulate_network(model.network, known, model, motion)
    drop = response.pressures[0] - response.pressures[1]
    is_late = response.time > 0.4  # the second cycle, without the start
    fastest = np.flatnonzero(is_late & (response.velocity > 0.9 * response.velocity.max()))
    parts = {name.removeprefix("rebound_"): known[name] for name in known if "rebound" in name}
    flow = law_flow(parts, drop[fastest], model.oil_density)
    assert flow == pytest.approx(model.annulus_area * response.velocity[fastest], rel=5e-3)


def test_a_valve_that_no_log_presses_is_left_out() -> None:
    model = damper(ThroughFlow)
    values = truth(model)
    made = log(model, values)
    # The load cell reads a pull throughout: nothing presses the valve of compression.
    pulled = replace(made, force=np.abs(made.force) + 50.0)
    (only,) = valve_characteristics(model, values, [pulled])
    assert only.stroke == "rebound"
