"""Make-believe rig logs with known parameters, from an integrator that no fit uses.

``steady`` integrates the model, written out once more in plain Python, by SciPy's Radau, so that
a fit of these logs also tests the compiled core. ``logs`` adds the instruments and writes files.
"""

from __future__ import annotations

from damperfit.samples.logs import SampleOptions, make_samples
from damperfit.samples.steady import SteadyCycle, steady_cycle

__all__ = ["SampleOptions", "SteadyCycle", "make_samples", "steady_cycle"]
