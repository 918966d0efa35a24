"""Valves read off loops of dampers whose valves are known; the loops are the compiled network's."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from damperfit.damper.network import monotube, simulate_network, through_flow, twin_tube
from damperfit.damper.purdy.closed_forms import gas_pressure
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.valves import Loop, Side, read_valves
from damperfit.simulation import sine_motion

AMBIENT = 101325.0
DAMPER = dataclasses.replace(
    PURDY_DAMPER,
    rod_diameter=0.0101,
    piston_diameter=0.0248,
    oil_density=850.0,
    gas_pressure=7.28e5,
)
VALUES = {
    "rebound_bleed": 5e4, "rebound_opening": 4.5e5, "rebound_slope": 5e6,
    "compression_bleed": 4e4, "compression_opening": 3.6e5, "compression_slope": 4e6,
    "k_e": 9e8, "f_f": 20.0,
}  # fmt: skip
STIFFNESS = 4e5


def loops(layout, values, *, speeds=(0.13, 0.26), keep=1.0):
    """The third of three cycles at each speed, 20 mm, as the rig's cell reads it."""
    network = dataclasses.replace(layout, ambient_pressure=AMBIENT)
    found = []
    for speed in speeds:
        frequency = speed / (2 * np.pi * 0.02)
        motion = sine_motion(0.02, frequency, cycles=3, sample_rate=1000)
        values = values | {"k_s": STIFFNESS, "f_0": -12.0}
        force = simulate_network(network, values, DAMPER, motion).force
        level = DAMPER.rod_area * (AMBIENT - gas_pressure(DAMPER, motion.displacement))
        part = slice(round(2000 / frequency), None)
        rate = np.gradient(force - level, motion.interval)
        found.append(Loop((force - level)[part] * keep, rate[part], motion.velocity[part]))
    return found


def sides(layout, values):
    bore, rod, annulus = DAMPER.piston_area, DAMPER.rod_area, DAMPER.annulus_area
    if layout.name == "twin_tube":
        return Side(annulus), Side(rod, values["return_slope"] * 850.0 * annulus**2)
    return Side(annulus), Side(bore if layout.name == "through_flow" else annulus)


@pytest.mark.parametrize(
    "layout", [through_flow(), monotube(), twin_tube()], ids=lambda one: one.name
)
def test_bleed_opening_and_slope_are_read_off_the_loops(layout):
    values = dict(VALUES)
    if layout.name != "monotube":
        values["return_slope"] = 2e5
    if layout.name == "twin_tube":  # the rod alone presses through the base valve
        values |= {"compression_bleed": 2e5, "compression_slope": 2e7}
    reading = read_valves(loops(layout, values), *sides(layout, values))
    for stroke in ("rebound", "compression"):
        curve = getattr(reading, stroke)
        assert curve.has_knee
        found = {
            "bleed": 1 / (850.0 * curve.root),
            "opening": curve.opening,
            "slope": 1 / (850.0 * curve.conductance),
        }
        for name, value in found.items():
            assert value == pytest.approx(values[f"{stroke}_{name}"], rel=0.45), (stroke, name)
    assert reading.rebound.opening == pytest.approx(4.5e5, rel=0.3)


def test_the_compliance_is_that_of_oil_and_mounting():
    curve = read_valves(loops(through_flow(), VALUES | {"return_slope": 2e5}),
                        *sides(through_flow(), VALUES), offset=-12.0).rebound  # fmt: skip
    chamber = DAMPER.chamber_1_length / (DAMPER.annulus_area * 9e8)
    give = curve.compliance / DAMPER.annulus_area**2
    assert give == pytest.approx(chamber + 1 / STIFFNESS, rel=0.15)


def test_the_curve_is_the_valves_characteristic():
    reading = read_valves(loops(through_flow(), VALUES | {"return_slope": 2e5}),
                          *sides(through_flow(), VALUES), offset=-12.0)  # fmt: skip
    curve = reading.rebound
    # Friction that was not told stands in the pressure.
    drop = curve.drop - (20.0 - reading.friction) / DAMPER.annulus_area
    at = drop > 1e5
    law = np.sqrt(drop[at]) / (850.0 * 5e4) + np.maximum(0, drop[at] - 4.5e5) / (850.0 * 5e6)
    assert np.sqrt(np.mean((curve.flow[at] - law) ** 2)) < 0.03 * np.max(law)


def test_a_valve_that_never_opens_has_no_knee_but_a_place_to_start_from():
    values = VALUES | {"return_slope": 2e5, "rebound_opening": 1e9}
    curve = read_valves(loops(through_flow(), values, speeds=(0.08,)),
                        *sides(through_flow(), VALUES), offset=-12.0).rebound  # fmt: skip
    total = curve.root * np.sqrt(curve.highest)
    opened = curve.conductance * max(0.0, curve.highest - curve.opening)
    assert opened < 0.25 * total
    assert 0.0 < curve.opening < curve.highest
