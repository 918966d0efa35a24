"""A sine test's steady cycle by SciPy's Radau on a plain Python right-hand side.

Independent of the compiled core on purpose: no law, stepper or start is shared with it. The drive
is a sine, hence the force is periodic: one cycle is integrated until it repeats, and then read at
any phase.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from damperfit.damper.purdy.closed_forms import gas_pressure
from damperfit.errors import SimulationError

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from damperfit.damper.purdy.parameters import Damper, Parameters

    FloatArray = NDArray[np.float64]

# Radau's error per step, relative to the oil mass: K_e rtol in pressure. Against rtol 1e-13 the
# force of the reference set is then right to 1e-4 N at every moment.
RTOL = 1e-10
_LONGEST_STEP = 3e-3  # in cycles; 2 ms on the standard test: no reversal is jumped over
_PERIODIC = 1e-9  # relative, of the oil mass; the solver cannot repeat itself better
_MOST_CYCLES = 30
_DEAD_BAND = 1e-4  # m/s; friction is linear inside


class SteadyCycle(NamedTuple):
    """One steady cycle of a sine test, x = A sin(2 pi phase); phases are in cycles, shape (n,)."""

    parameters: Parameters
    damper: Damper
    amplitude: float  # m
    frequency: float  # Hz
    # Phase (0 to 1) to the oil mass in chambers 1 and 2, shape (2, n), kg.
    masses: Callable[[FloatArray], FloatArray]
    gap: float  # largest change of a mass from this cycle's start to its end, relative

    def displacement(self, phase: FloatArray) -> FloatArray:
        """Return x, m."""
        return np.asarray(self.amplitude * np.sin(2.0 * np.pi * phase))

    def velocity(self, phase: FloatArray) -> FloatArray:
        """Return v, m/s."""
        speed = 2.0 * np.pi * self.frequency * self.amplitude
        return np.asarray(speed * np.cos(2.0 * np.pi * phase))

    def force(self, phase: FloatArray) -> FloatArray:
        """Return f, N, friction and offset included."""
        y, device = self.parameters, self.damper
        m_1, m_2 = self.masses(np.mod(phase, 1.0))
        x = self.displacement(phase)
        volume_1 = device.chamber_1_volume - x * device.annulus_area
        volume_2 = device.chamber_2_volume + x * device.piston_area
        p_1, p_2 = (
            np.maximum(0.0, y.k_e * (m / (device.oil_density * v) - 1.0) + device.gas_pressure)
            for m, v in ((m_1, volume_1), (m_2, volume_2))
        )
        friction = y.f_f * np.clip(self.velocity(phase) / _DEAD_BAND, -1.0, 1.0)
        oil = p_1 * device.annulus_area - p_2 * device.piston_area
        return np.asarray(oil + device.rod_area * device.ambient_pressure + friction + y.f_0)


def steady_cycle(
    parameters: Parameters, damper: Damper, *, amplitude: float, frequency: float
) -> SteadyCycle:
    """Integrate a sine test of m and Hz with SciPy's Radau until a cycle repeats the one before.

    Returns the first cycle that ends as it began, to 1e-9 of the oil mass.
    """
    from scipy.integrate import solve_ivp

    gas_pressure(damper, -amplitude)  # refuses a stroke with no room for the gas
    a_p1, a_p2 = damper.annulus_area, damper.piston_area
    v_10, v_20, v_g0 = damper.chamber_1_volume, damper.chamber_2_volume, damper.gas_volume
    rho, p_0, gamma = damper.oil_density, damper.gas_pressure, damper.gas_exponent
    r_m1, r_m2, r_m3, k_e = parameters.r_m1, parameters.r_m2, parameters.r_m3, parameters.k_e
    oil_at_rest = rho * (v_10 + v_20)
    period = 1.0 / frequency

    def rates(phase: float, masses: FloatArray) -> tuple[float, float]:
        """Return dm_1 and dm_2 per cycle, kg."""
        m_1, m_2 = float(masses[0]), float(masses[1])
        x = amplitude * math.sin(2.0 * math.pi * phase)
        p_1 = max(0.0, k_e * (m_1 / (rho * (v_10 - x * a_p1)) - 1.0) + p_0)
        p_2 = max(0.0, k_e * (m_2 / (rho * (v_20 + x * a_p2)) - 1.0) + p_0)
        gas_volume = v_g0 + (m_1 + m_2 - oil_at_rest) / rho
        if gas_volume <= 0.0:
            raise SimulationError(
                "samples: the oil fills the gas space; check stroke and gas length", code="stroke"
            )
        p_3 = p_0 * (v_g0 / gas_volume) ** gamma
        w_1 = math.copysign(math.sqrt(abs(p_1 - p_3)), p_1 - p_3) / r_m1
        w_2 = max(0.0, p_2 - p_1) / r_m2
        w_3 = max(0.0, p_3 - p_2) / r_m3
        return period * (w_2 - w_1), period * (w_3 - w_2)

    masses, gap = np.array([rho * v_10, rho * v_20]), math.inf
    for _ in range(_MOST_CYCLES):
        with np.errstate(divide="ignore", over="ignore"):  # a step without error is no trouble
            solution = solve_ivp(
                rates, (0.0, 1.0), masses, method="Radau", rtol=RTOL, atol=1e-6 * RTOL * masses,
                max_step=_LONGEST_STEP, dense_output=True,
            )  # fmt: skip
        if not solution.success or solution.sol is None:
            raise SimulationError(
                f"samples: {parameters}: {solution.message}", code="not-integrated"
            )
        end = solution.y[:, -1]
        gap = float(np.max(np.abs(end / masses - 1.0)))
        if gap <= _PERIODIC:
            return SteadyCycle(parameters, damper, amplitude, frequency, solution.sol, gap)
        masses = end
    raise SimulationError(
        f"samples: {parameters}: no steady cycle within {_MOST_CYCLES}; state still moves by "
        f"{gap:.1g}, expected {_PERIODIC:.0g}; check frequency and parameters",
        code="no-steady-cycle",
    )
