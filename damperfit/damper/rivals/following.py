"""The door to the compiled models with one state: elastic dashpots, Bouc and Wen's variable."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from damperfit.compiled_core import compiled_core
from damperfit.errors import SimulationError
from damperfit.simulation import describe_ending

if TYPE_CHECKING:
    from collections.abc import Sequence

    from damperfit.damper.rivals.rival import FloatArray
    from damperfit.simulation import Motion, SolverOptions

__all__ = ["follow"]

_ROUNDING = 0.01  # of the root of an orifice at no force, N


def follow(
    numbers: FloatArray, layout: Sequence[int], motion: Motion, options: SolverOptions
) -> tuple[FloatArray, FloatArray]:
    """Return the state's output and its derivatives by the numbers, shapes (n,) and (width, n).

    The layout is that of `run_state` in module.c: empty for Bouc and Wen.

    Raises
    ------
    SimulationError
        A number is negative or not finite, or the stroke is longer than the tube.
    """
    x = np.ascontiguousarray(motion.displacement, dtype=np.float64)
    v = np.ascontiguousarray(motion.velocity, dtype=np.float64)
    out, slopes = np.empty(len(x)), np.empty((len(x), len(numbers)))
    code, sample = compiled_core().follow(
        np.ascontiguousarray(numbers, dtype=np.float64),
        np.array(layout, dtype=np.intc),
        x,
        v,
        out,
        slopes,
        motion.interval,
        _ROUNDING,
    )
    if code:
        raise SimulationError(describe_ending(code, sample, motion, options))
    return out, np.ascontiguousarray(slopes.T)
