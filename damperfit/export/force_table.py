"""Force by speed of one setting, from the model on the tested motion."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from damperfit.simulation import simulate, sine_motion

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from damperfit.export.handed_over import HandedOver, HandedSetting
    from damperfit.setting import Setting

    FloatArray = NDArray[np.float64]

__all__ = ["ForceTable", "force_table"]

_CYCLES = 3  # the last counts: the steady cycle is reached within one
_SAMPLES = 2000  # a cycle


@dataclass(frozen=True, slots=True, eq=False)
class ForceTable:
    """Mean of the opening and the closing branch, without gas force and tare.

    Attributes
    ----------
    setting : Setting
        Which.
    speeds, forces : numpy.ndarray
        Rising, through 0 0; m/s and N, positive in rebound.
    """

    setting: Setting
    speeds: FloatArray
    forces: FloatArray


def force_table(handed: HandedOver, one: HandedSetting, *, points: int = 30) -> ForceTable:
    """Return force by speed up to the tested speed, ``points`` a side.

    Raises
    ------
    SimulationError
        The model cannot be integrated over the tested motion.
    """
    sine = handed.motion
    rate = _SAMPLES * sine.frequency
    motion = sine_motion(sine.amplitude, sine.frequency, cycles=_CYCLES, sample_rate=rate)
    response = simulate(one.values, handed.damper, motion, options=handed.solver)
    x, v = response.displacement[-_SAMPLES:], response.velocity[-_SAMPLES:]
    at_rest = handed.damper.rest_force(x)
    force = response.force[-_SAMPLES:] - (0.0 if at_rest is None else at_rest)
    force = force - sum(getattr(one.values, q.name) for q in one.values.quantities if q.is_offset)
    opening = np.gradient(v) > 0.0
    side = np.linspace(0.0, float(np.abs(v).max()), points + 1)
    grid = np.concatenate([-side[:0:-1], side])
    rise, fall = (_branch(v[part], force[part], grid) for part in (opening, ~opening))
    mean = 0.5 * (rise + fall)
    mean[points] = 0.0
    return ForceTable(one.setting, grid, mean)


def _branch(v: FloatArray, force: FloatArray, grid: FloatArray) -> FloatArray:
    order = np.argsort(v, kind="stable")
    return np.asarray(np.interp(grid, v[order], force[order]))
