"""Steady cycles of make-believe logs by the compiled core: 50 ms each, where SciPy takes a second.

For tests that need a log and ask nothing of the integrator; `damper/test_samples.py` holds the
samples themselves, and the core to them.
"""

import numpy as np
from scipy.interpolate import CubicSpline

from damperfit.damper.purdy.parameters import Damper, Parameters, gas_pressure
from damperfit.errors import SimulationError
from damperfit.simulation import Motion, SolverOptions, simulate
from damperfit.synthetic import SteadyCycle, cycle_of_masses, steady_cycle

_PER_CYCLE = 4000
_CYCLES = 3
_TIGHT = SolverOptions(tolerance=1e-6)


def quick_cycle(
    parameters: Parameters, damper: Damper, *, amplitude: float, frequency: float
) -> SteadyCycle:
    """Return what `steady_cycle` does, by way of the core; what that refuses, it refuses itself."""
    gas_pressure(damper, -amplitude)  # refuses a stroke with no room for the gas
    phase = np.arange(_CYCLES * _PER_CYCLE + 1) / _PER_CYCLE
    x = amplitude * np.sin(2.0 * np.pi * phase)
    v = 2.0 * np.pi * frequency * amplitude * np.cos(2.0 * np.pi * phase)
    try:
        motion = Motion(1.0 / (frequency * _PER_CYCLE), x, v)
        masses = simulate(parameters, damper, motion, options=_TIGHT).masses
    except SimulationError:
        return steady_cycle(parameters, damper, amplitude=amplitude, frequency=frequency)
    last = masses[:, -_PER_CYCLE - 1 :]
    gap = float(np.max(np.abs(last[:, -1] / last[:, 0] - 1.0)))
    if gap > 1e-9:
        return steady_cycle(parameters, damper, amplitude=amplitude, frequency=frequency)
    spline = CubicSpline(phase[: _PER_CYCLE + 1], last, axis=1)
    return cycle_of_masses(parameters, damper, amplitude, frequency, spline)
