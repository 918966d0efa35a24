"""Areas and volumes by hand, and which of them each stroke of a layout presses with."""

from __future__ import annotations

import math

import pytest

from damperfit.damper.purdy.parameters import Damper
from damperfit.damper.valve_dampers import Monotube, ThroughFlow, TwinTube

LENGTHS = {
    "rod_diameter": 0.02,
    "piston_diameter": 0.04,
    "chamber_1_length": 0.1,
    "chamber_2_length": 0.2,
}
ROD, PISTON = math.pi * 1e-4, math.pi * 4e-4
ANNULUS = math.pi * 3e-4


@pytest.mark.parametrize("kind", [Damper, TwinTube, Monotube, ThroughFlow])
def test_areas_and_volumes_are_those_of_circles(kind) -> None:
    damper = kind(**LENGTHS)
    areas = damper.rod_area, damper.piston_area, damper.annulus_area
    assert areas == pytest.approx((ROD, PISTON, ANNULUS))
    volumes = damper.chamber_1_volume, damper.chamber_2_volume
    assert volumes == pytest.approx((0.1 * ANNULUS, 0.2 * PISTON))


@pytest.mark.parametrize(
    ("kind", "areas"),
    [
        (TwinTube, (ANNULUS, ROD)),
        (Monotube, (ANNULUS, ANNULUS)),
        (ThroughFlow, (ANNULUS, PISTON)),
    ],
)
def test_each_stroke_presses_with_its_area(kind, areas) -> None:
    assert kind(**LENGTHS).pressed_areas == pytest.approx(areas)
