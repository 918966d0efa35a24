"""A model and a displacement to the damper's response; the only door to the compiled core."""

from damperfit.simulation.characteristics import (
    NAMED_SPEEDS,
    Characteristics,
    SpeedForce,
    characterise,
    mean_figures,
    signals_at_speeds,
)
from damperfit.simulation.motion import (
    Motion,
    motion_of,
    refuse_amplitude,
    sine_motion,
    triangle_motion,
)
from damperfit.simulation.response import Response, SolverOptions, Work
from damperfit.simulation.simulate import simulate

__all__ = [
    "NAMED_SPEEDS",
    "Characteristics",
    "Motion",
    "Response",
    "SolverOptions",
    "SpeedForce",
    "Work",
    "characterise",
    "mean_figures",
    "motion_of",
    "refuse_amplitude",
    "signals_at_speeds",
    "simulate",
    "sine_motion",
    "triangle_motion",
]
