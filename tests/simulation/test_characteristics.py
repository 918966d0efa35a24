"""What is read off a loop, against numbers known without it."""

import math
from dataclasses import replace

import numpy as np
import pytest

from damperfit.damper.purdy.parameters import PURDY_DAMPER, Parameters
from damperfit.errors import SimulationError
from damperfit.simulation import Response, characterise, simulate, sine_motion, triangle_motion

# The middle column of the golden table (theory, section 4).
SET_M = Parameters(r_m1=1.8e4, r_m2=3.527e6, r_m3=2.597e6, k_e=3.65e8, f_f=50.0)


def _response(parameters: Parameters, *, cycles: float = 4.0, rate: float = 1000.0) -> Response:
    motion = sine_motion(0.032, 1.5, cycles=cycles, sample_rate=rate)
    return simulate(parameters, PURDY_DAMPER, motion)


def test_energy_of_a_cycle_is_the_known_loop_integral_and_friction_adds_to_it() -> None:
    # 79.211376 J from two independent integrations of the same loop.
    bare = characterise(_response(replace(SET_M, f_f=0.0), rate=5000.0), 1.5).energy
    assert bare == pytest.approx(79.211376, rel=1e-5)
    rubbed = characterise(_response(SET_M, rate=5000.0), 1.5).energy
    assert rubbed - bare == pytest.approx(4.0 * 0.032 * 50.0, rel=1e-4)


def test_a_viscous_damper_has_no_hysteresis_and_known_forces() -> None:
    time = np.arange(4001) / 2000.0
    x, v = 0.02 * np.sin(2 * np.pi * time), 0.04 * np.pi * np.cos(2 * np.pi * time)
    force = np.where(v > 0.0, 3000.0, 1000.0) * v
    found = characterise(Response(time, x, v, force, np.ones((3, 4001)), np.ones((2, 4001))), 1.0)
    assert found.peak_force_rebound == pytest.approx(3000.0 * 0.04 * math.pi, rel=1e-6)
    assert found.peak_force_bump == pytest.approx(-1000.0 * 0.04 * math.pi, rel=1e-6)
    assert found.energy == pytest.approx(2000.0 * math.pi * 0.02**2 * 2 * math.pi, rel=1e-5)
    assert found.hysteresis_rebound == pytest.approx(0.0, abs=1e-6)
    assert [f.speed for f in found.speed_forces] == [0.05, 0.1]
    assert found.speed_forces[1].rebound == pytest.approx(300.0, rel=1e-6)
    assert found.speed_forces[1].bump == pytest.approx(-100.0, rel=1e-6)


def test_the_last_whole_cycle_counts_and_one_is_enough() -> None:
    four, six = (
        characterise(_response(SET_M, cycles=cycles, rate=1500.0), 1.5).energy for cycles in (4, 6)
    )
    assert six == pytest.approx(four, rel=1e-6)
    with pytest.raises(SimulationError, match=r"lasts 0\.50 cycles .* one whole cycle"):
        characterise(_response(SET_M, cycles=0.5, rate=45.0), 1.5)
    # 1000 Hz over 1.5 Hz ends a third of a sample early; it was refused as "1.00 cycles".
    for rate in (1000.0, 1500.0):
        assert characterise(_response(SET_M, cycles=1.0, rate=rate), 1.5).peak_force_rebound > 0.0


def test_a_triangle_reaches_its_constant_speed() -> None:
    motion = triangle_motion(0.032, 1.5, cycles=4, sample_rate=1000)
    found = characterise(simulate(SET_M, PURDY_DAMPER, motion), 1.5)
    assert found.peak_speed_rebound == pytest.approx(4 * 0.032 * 1.5)
