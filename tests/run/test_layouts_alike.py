"""Intervals of valves reach to what their numbers are in layouts that the logs do not exclude."""

import math

import numpy as np
import pytest

from damperfit.damper.valve_dampers import Monotube
from damperfit.run.record import with_other_layouts
from damperfit.tested.setting import Setting
from damperfit.uncertainty import Assessment, Interval, Uncertainty

DAMPER = Monotube(rod_diameter=0.012, piston_diameter=0.03)
OWN = Interval(1.0, 98.0, 102.0, math.nan)
NAMES = ("rebound_opening", "compression_opening", "compression_slope", "k_s")


def reaching(layouts: list[str]) -> dict[str, tuple[float, float]]:
    known = Uncertainty(Setting.of(1), dict.fromkeys(NAMES, OWN), (), np.zeros((0, 0)))
    found = with_other_layouts(Assessment((known,)), DAMPER, layouts)
    return {name: (one.low, one.high) for name, one in found.uncertainties[0].intervals.items()}


def test_intervals_hold_the_numbers_of_a_layout_that_is_alike() -> None:
    found = reaching(["through_flow"])
    area = DAMPER.annulus_area / DAMPER.piston_area  # 0.84
    assert found["compression_opening"] == pytest.approx((98.0 * area / 1.06, 102.0))
    assert found["compression_slope"] == pytest.approx((98.0 * area**2 / 1.06, 102.0))
    assert found["rebound_opening"] == pytest.approx((98.0 / 1.06, 102.0 * 1.06))  # one annulus
    assert found["k_s"] == (98.0, 102.0)
    assert reaching([]) == dict.fromkeys(NAMES, (98.0, 102.0))
    both = reaching(["through_flow", "twin_tube"])
    assert both["compression_opening"][0] == found["compression_opening"][0]
    assert both["compression_opening"][1] == pytest.approx(
        102.0 * 1.06 * DAMPER.annulus_area / DAMPER.rod_area
    )
