"""What the endings of a simulation in the compiled core mean."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from damperfit.simulation.motion import Motion
    from damperfit.simulation.response import SolverOptions

__all__ = ["describe_ending"]

_ENDINGS = {
    1: "the state or the displacement is not a finite number",
    2: "the integrator needs more than {limit} steps between two samples",
    3: "the stroke leaves no volume in a chamber or in the gas",
    4: "a parameter or a solver option is zero, negative or not finite",
}


def describe_ending(code: int, sample: int, motion: Motion, options: SolverOptions) -> str:
    """Return the sentence of a simulation that ended with a code other than 0, at a sample."""
    what = _ENDINGS[code].format(limit=options.max_steps_per_sample)
    if sample >= len(motion.displacement):
        return f"simulation failed: {what}."
    moment = motion.start_time + sample * motion.interval
    x = motion.displacement[sample]
    return f"simulation failed at sample {sample} ({moment:.6g} s, x = {x:.6g} m): {what}."
