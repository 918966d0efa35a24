"""A model and a displacement to the damper's response; the only door to the compiled core."""

from damperfit.simulation.characteristics import (
    NAMED_SPEEDS,
    Characteristics,
    SpeedForce,
    characterise,
)
from damperfit.simulation.motion import (
    Motion,
    motion_of,
    refuse_amplitude,
    sine_motion,
    triangle_motion,
)
from damperfit.simulation.response import Response, SolverOptions, Work, describe_ending, simulate

__all__ = [
    "NAMED_SPEEDS",
    "Characteristics",
    "Motion",
    "Response",
    "SolverOptions",
    "SpeedForce",
    "Work",
    "characterise",
    "describe_ending",
    "motion_of",
    "refuse_amplitude",
    "simulate",
    "sine_motion",
    "triangle_motion",
]
