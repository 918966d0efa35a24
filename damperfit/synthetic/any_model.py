"""A steady cycle of any model by its own integrator, and synthetic numbers of real valves.

Only the paper's model is integrated once more in plain Python (`steady`). What is made of the
others tests fits, intervals and searches for a law, not the integrator.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from damperfit.errors import ConfigurationError, SimulationError
from damperfit.problem import Option

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from damperfit.damper.model import Model, Values

    FloatArray = NDArray[np.float64]

__all__ = ["SimulatedCycle", "made_up_values", "simulated_cycle"]

_SAMPLES = 2000  # of a cycle; 0.3 ms at 1.5 Hz
_CYCLES = 8
_PERIODIC = 1e-3  # of the force's range: what the last two cycles may differ by
_TOLERANCE = 1e-3  # N a step
# At setting 0 and more for each click, N at the highest speed; bump has so much of it.
_FORCE, _CLICK, _BUMP = 250.0, 50.0, 0.6
_OPENS, _THROUGH_BLEED = 0.4, 0.5  # of the highest pressure; of the flow there
# Of the gas pressure of a monotube: with more its upper chamber would run empty in bump.
_OF_GAS = 0.6
_BESIDE = {
    "k_e": 9e8, "f_f": 20.0, "f_0": -10.0, "k_s": 4e5, "play": 5e-4, "lag": 8e-3,
    "moving_mass": 0.5, "presliding": 5e-5, "breakaway": 15.0, "stribeck_speed": 0.02,
    "seal_area": 3e-6, "turning_speed": 2e-3,
}  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class SimulatedCycle:
    """One steady cycle of a sine test, x = A sin(2 pi phase); phases are in cycles, shape (n,).

    Attributes
    ----------
    amplitude, frequency : float
        The drive: m, Hz.
    forces : numpy.ndarray
        Shape (n,), at even phases from 0, N.
    """

    amplitude: float
    frequency: float
    forces: FloatArray

    def displacement(self, phase: FloatArray) -> FloatArray:
        """Return x, m."""
        return np.asarray(self.amplitude * np.sin(2.0 * np.pi * phase))

    def force(self, phase: FloatArray) -> FloatArray:
        """Return f, N."""
        n = len(self.forces)
        return np.asarray(np.interp(phase, np.arange(n) / n, self.forces, period=1.0))


def simulated_cycle(
    values: Values, damper: Model, *, amplitude: float, frequency: float
) -> SimulatedCycle:
    """Simulate a sine test until a cycle repeats the one before.

    Parameters
    ----------
    values : Values
        Of all quantities of the model, SI.
    damper : Model
        The damper.
    amplitude, frequency : float
        The drive: m, Hz.

    Raises
    ------
    SimulationError
        The model cannot be integrated, or does not come to a steady cycle.
    """
    from damperfit.simulation import SolverOptions, simulate, sine_motion

    motion = sine_motion(amplitude, frequency, cycles=_CYCLES, sample_rate=_SAMPLES * frequency)
    force = simulate(values, damper, motion, options=SolverOptions(tolerance=_TOLERANCE)).force
    before, last = force[-2 * _SAMPLES - 1 : -_SAMPLES - 1], force[-_SAMPLES - 1 : -1]
    gap = float(np.max(np.abs(last - before)))
    if gap > _PERIODIC * float(np.ptp(last)):
        raise SimulationError(
            f"samples: {damper.name} has no steady cycle within {_CYCLES}: the force still moves "
            f"by {gap:.2g} N; check frequency and parameters"
        )
    return SimulatedCycle(amplitude, frequency, last)


def made_up_values(damper: Model, setting: int, speed: float) -> Values:
    """Return plausible numbers of a damper of real valves, stiffer from click to click.

    Parameters
    ----------
    damper : Model
        The damper.
    setting : int
        Its click.
    speed : float
        Highest speed of the test, m/s.

    Raises
    ------
    ConfigurationError
        The model is none of real valves: its numbers must be given.
    """
    from damperfit.damper.network import PARTS
    from damperfit.damper.valve_dampers import Monotube, ValveDamper

    if not isinstance(damper, ValveDamper):
        raise ConfigurationError(
            f"samples: no numbers of {damper.name} are known; give a table of its quantities by "
            "setting with {parameters}, as identify writes it",
            parameters=Option("parameters"),
        )
    force = _FORCE + _CLICK * setting
    known = {name: one for name, one in _BESIDE.items() if name in damper.names}
    strokes = zip(("rebound", "compression"), damper.pressed_areas, (1.0, _BUMP), strict=True)
    for stroke, area, share in strokes:
        highest = share * force / area
        if isinstance(damper, Monotube) and stroke == "compression":
            highest = min(highest, _OF_GAS * damper.gas_pressure)
        flow = _THROUGH_BLEED * damper.oil_density * area * speed
        opening, bleed = _OPENS * highest, math.sqrt(highest) / flow
        slope = (highest - opening) / flow
        parts = {p: one.guess(opening, slope, highest, flow) for p, one in PARTS.items()}
        known |= {f"{stroke}_{p}": number for p, number in (parts | {"bleed": bleed}).items()}
    return damper.values({name: one for name, one in known.items() if name in damper.names})
