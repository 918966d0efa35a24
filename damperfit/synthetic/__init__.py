"""Make-believe rig logs with known parameters, the paper's from an integrator that no fit uses.

``steady`` integrates the model, written out once more in plain Python, by SciPy's Radau, so that
a fit of these logs also tests the compiled core. ``logs`` simulates other models as they are
fitted, adds the instruments and writes files.
"""

from __future__ import annotations

from damperfit.synthetic.logs import SampleOptions, SimulatedCycle, make_samples, simulated_cycle
from damperfit.synthetic.steady import SteadyCycle, steady_cycle

__all__ = [
    "SampleOptions",
    "SimulatedCycle",
    "SteadyCycle",
    "make_samples",
    "simulated_cycle",
    "steady_cycle",
]
