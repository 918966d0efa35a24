"""Where the core's equations have solutions on paper: after a step with the rod held.

With a gas spring so long that P_3 stays put, valve 1 empties chamber 1 by
sqrt(D) = sqrt(D_0) - k_1 t/(2 R_m1) until the flow ends, and valve 3 fills chamber 2 by
D = D_0 exp(-k_2 t/R_m3); k_i = K_e/(rho_0 V_i). They take the place of a manufactured solution,
for which the kernel would need a source term.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from damperfit.damper.purdy.closed_forms import incompressible_force
from damperfit.damper.purdy.parameters import PURDY_DAMPER, Parameters
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.simulation import Motion, SolverOptions, simulate, sine_motion

DAMPER = replace(PURDY_DAMPER)
object.__setattr__(DAMPER, "gas_length", 1e5)  # so much gas as no damper may be declared with
Y = Parameters(r_m1=3e4, r_m2=4e6, r_m3=2.597e6, k_e=4e8, f_f=0.0)
STEP, INTERVAL = 2e-5, 1e-5


def _held_after_a_step(n: int, tolerance: float):
    x = np.full(n, STEP)
    x[0] = 0.0
    motion = Motion(INTERVAL, x, np.zeros(n))
    return simulate(Y, DAMPER, motion, options=SolverOptions(tolerance=tolerance))


@pytest.mark.parametrize("tolerance", [1e-3, 1e-6])
def test_valve_1_empties_a_chamber_by_a_parabola(tolerance: float) -> None:
    response = _held_after_a_step(400, tolerance)
    d = response.pressures[0] - response.pressures[2]
    assert d[1] > 1e4
    k_1 = Y.k_e / (DAMPER.oil_density * (DAMPER.chamber_1_volume - STEP * DAMPER.annulus_area))
    t = INTERVAL * np.arange(400)
    root = np.sqrt(d[1]) - k_1 * (t - t[1]) / (2.0 * Y.r_m1)
    flows = (t >= t[1]) & (root > 0.05 * np.sqrt(d[1]))
    assert 5 < np.count_nonzero(flows) < 395
    error = (d - root**2)[flows] * DAMPER.annulus_area
    # Every step may add its tolerance; nothing is forgotten before the flow ends.
    assert np.max(np.abs(error)) < tolerance * np.count_nonzero(flows)


@pytest.mark.parametrize("tolerance", [1e-3, 1e-6])
def test_valve_3_fills_a_chamber_by_an_exponential(tolerance: float) -> None:
    response = _held_after_a_step(400, tolerance)
    d = response.pressures[2] - response.pressures[1]
    assert d[1] > 1e4
    k_2 = Y.k_e / (DAMPER.oil_density * (DAMPER.chamber_2_volume + STEP * DAMPER.piston_area))
    t = INTERVAL * np.arange(400)
    exact = d[1] * np.exp(-k_2 * (t - t[1]) / Y.r_m3)
    error = (d - exact)[1:] * DAMPER.piston_area
    # Every step may add its tolerance, and the flow forgets at this rate.
    assert np.max(np.abs(error)) < 1.1 * tolerance / (k_2 * INTERVAL / Y.r_m3)


def test_locked_oil_is_a_spring() -> None:
    # Valves as good as shut: the masses stay, and the pressures follow the volumes, eq. (7).
    y = Parameters(r_m1=1e12, r_m2=1e18, r_m3=1e18, k_e=4e8, f_f=0.0)
    t = INTERVAL * np.arange(2000)
    x = 1e-4 * np.sin(2 * np.pi * 100 * t)
    v = 1e-4 * 2 * np.pi * 100 * np.cos(2 * np.pi * 100 * t)
    response = simulate(y, PURDY_DAMPER, Motion(INTERVAL, x, v))
    v_1 = PURDY_DAMPER.chamber_1_volume - x * PURDY_DAMPER.annulus_area
    v_2 = PURDY_DAMPER.chamber_2_volume + x * PURDY_DAMPER.piston_area
    p_1 = y.k_e * (PURDY_DAMPER.chamber_1_volume / v_1 - 1.0) + PURDY_DAMPER.gas_pressure
    p_2 = y.k_e * (PURDY_DAMPER.chamber_2_volume / v_2 - 1.0) + PURDY_DAMPER.gas_pressure
    np.testing.assert_allclose(response.pressures[0], np.maximum(p_1, 0.0), rtol=1e-6)
    np.testing.assert_allclose(response.pressures[1], np.maximum(p_2, 0.0), rtol=1e-6)


@pytest.mark.parametrize("setting", [1, 10, 20])
@pytest.mark.parametrize("amplitude", [0.032, 0.003, 0.0003])
@pytest.mark.parametrize("k_e", [4e12, 5e12, 1e13, 1e14, 1e15])
def test_oil_as_stiff_as_may_be_gives_the_incompressible_force(
    setting: int, amplitude: float, k_e: float
) -> None:
    # Newton's goal of 1e-3 Pa lay below the rounding of K_e from 4.5e12 Pa on: step limit.
    y = replace(reference_parameters(setting), k_e=k_e)
    motion = sine_motion(amplitude, 1.5, cycles=3, sample_rate=1000)
    options = SolverOptions(tolerance=1e-2)
    response = simulate(y, PURDY_DAMPER, motion, sensitivities=["k_e"], options=options)
    expected = incompressible_force(y, PURDY_DAMPER, motion.displacement, motion.velocity)
    # Inside the dead band and in the first instants the two have different friction.
    is_moving = (np.abs(motion.velocity) > 3e-4) & (np.arange(len(motion.displacement)) > 200)
    error = np.abs(response.force - expected)[is_moving]
    # What is left is the oil's give, 1e12 N Pa/K_e at setting 20, and two steps' tolerance.
    assert np.max(error) < 2e-2 + 1e12 / k_e
    # f_inf - f goes with 1/K_e, so that K_e df/dK_e is f_inf - f: no digits are lost in it.
    give = np.max(np.abs(k_e * response.sensitivities["k_e"][200:]))
    assert give < 1.5 * 0.9e12 / k_e + 1e-3
    assert response.work.newton_iterations < 6 * response.work.steps
