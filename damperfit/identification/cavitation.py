"""How far R_m3 is from the onset of cavitation in chamber 2."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from damperfit.errors import SimulationError
from damperfit.identification.comparison import motion_of
from damperfit.simulation import Motion, SolverOptions, simulate

if TYPE_CHECKING:
    from collections.abc import Callable

    from damperfit.damper.parameters import Damper, Parameters
    from damperfit.recording import Trace

__all__ = ["cavitation_margin"]

_WIDEST_FACTOR = 1e3
# The paper's own statement is "about 15 %": a tenth of a per cent is plenty.
_MARGIN_TOLERANCE = 1e-3


def cavitation_margin(
    parameters: Parameters,
    trace: Trace,
    damper: Damper,
    *,
    solver: SolverOptions = SolverOptions(),
) -> float:
    """Return the fraction by which R_m3 may rise before chamber 2 cavitates on a trace's motion.

    Negative when it must fall; NaN where no factor from 1/1000 to 1000 is at the edge.
    The lowest pressure of chamber 2 in the last steady cycle falls almost in a straight line with
    R_m3, so that its zero takes a few simulations of two cycles.
    """
    from scipy.optimize import brentq

    period = round((trace.stop - trace.first) / trace.n_cycles)
    part = slice(max(0, trace.stop - 2 * period), trace.stop)
    whole = motion_of(trace)
    motion = Motion(whole.interval, whole.displacement[part], whole.velocity[part])

    def lowest(factor: float) -> float:
        trial = replace(parameters, r_m3=factor * parameters.r_m3)
        p_2 = simulate(trial, damper, motion, options=solver).pressures[1, -period:]
        # The pressure is clamped at zero; the share of time spent there gives the root a slope.
        empty = int(np.count_nonzero(p_2 <= 0.0))
        return -damper.gas_pressure * empty / period if empty else float(np.min(p_2))

    try:
        near, far = _bracket(lowest)
        if math.isnan(far):
            return math.nan
        return float(brentq(lowest, near, far, xtol=_MARGIN_TOLERANCE * min(near, far))) - 1.0
    except SimulationError:
        return math.nan


def _bracket(lowest: Callable[[float], float]) -> tuple[float, float]:
    """Return factors on both sides of the onset, the far one NaN when there is none in range."""
    is_full = lowest(1.0) > 0.0
    step = 2.0 if is_full else 0.5
    near, far = 1.0, step
    while (lowest(far) > 0.0) == is_full:
        near, far = far, far * step
        if not 1.0 / _WIDEST_FACTOR <= far <= _WIDEST_FACTOR:
            return near, math.nan
    return near, far
