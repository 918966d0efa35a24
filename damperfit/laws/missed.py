"""What a law misses of logs: in all, in the worst stroke, at the speed where it is off most."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from damperfit.identification import compare, normalised_mse

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from damperfit.damper.model import Model, Values
    from damperfit.recording import Trace
    from damperfit.simulation import SolverOptions

    FloatArray = NDArray[np.float64]

__all__ = ["Missed", "misses", "worst_force", "worst_stroke"]

# Of half the range: the least force that what is left in a stroke is held against.
_LEAST_FORCE = 0.2
# Forces are compared at as many speeds of a stroke, from a third of the highest one on.
_SPEEDS, _FROM_SPEED = 12, 4


class Missed(NamedTuple):
    """Residuals of each stretch, N; the MSE of each, of all; the rest as of `LawFit`."""

    residuals: tuple[FloatArray, ...]
    stretches: tuple[float, ...]
    mse_percent: float
    worst_stroke_percent: float
    worst_force_percent: float


def misses(
    model: Model,
    values: Values,
    traces: Sequence[Trace],
    solver: SolverOptions,
    *,
    has_own_offsets: bool = False,
) -> Missed:
    """Return what a law misses of logs.

    Parameters
    ----------
    model : Model
        The law.
    values : Values
        Its numbers.
    traces : sequence of Trace
        The logs.
    solver : SolverOptions
        How exactly to integrate.
    has_own_offsets : bool
        Each log has a force offset of its own, which is not counted: a rig is tared anew.
    """
    residuals, alone, measured, velocity, forces = [], [], [], [], [0.0]
    for trace in traces:
        force = compare(values, trace, model, solver=solver).force
        if has_own_offsets:
            force = force + float(np.mean((trace.force - force)[trace.compared]))
        for stretch in trace.stretches:
            part = stretch.window
            residuals.append(force[part] - trace.force[part])
            alone.append(normalised_mse(trace.force[part], force[part]))
            measured.append(trace.force[part])
            velocity.append(trace.drive.velocity[part])
            if stretch.n_cycles:
                forces.append(worst_force(measured[-1], residuals[-1], velocity[-1]))
    together, rest = np.concatenate(measured), np.concatenate(residuals)
    mse = normalised_mse(together, together + rest)
    worst = worst_stroke(together, rest, np.concatenate(velocity))
    return Missed(tuple(residuals), tuple(alone), mse, worst, max(forces))


def worst_stroke(force: FloatArray, rest: FloatArray, velocity: FloatArray) -> float:
    """Return what is left in the stroke that is missed most, per cent of its mean square force.

    Parameters
    ----------
    force, rest, velocity : numpy.ndarray
        Shape (n,): measured, N; model less measured, N; of the rod, m/s.
    """
    least = (_LEAST_FORCE * 0.5 * float(np.ptp(force))) ** 2
    shares = [
        float(np.mean(rest[stroke] ** 2)) / max(float(np.mean(force[stroke] ** 2)), least, 1e-300)
        for stroke in (velocity > 0.0, velocity < 0.0)
        if stroke.any()
    ]
    return 100.0 * max(shares, default=math.nan)


def worst_force(force: FloatArray, rest: FloatArray, velocity: FloatArray) -> float:
    """Return by how much the mean force at a speed is off where it is off most, per cent.

    Parameters
    ----------
    force, rest, velocity : numpy.ndarray
        Shape (n,), whole cycles: measured, N; model less measured, N; of the rod, m/s.
    """
    least = _LEAST_FORCE * 0.5 * float(np.ptp(force))
    worst = 0.0
    for towards in (1.0, -1.0):
        speed = towards * velocity
        place = np.floor(_SPEEDS * speed / max(float(np.max(speed)), 1e-300)).astype(np.intp)
        seen = (place >= _FROM_SPEED) & (place < _SPEEDS)
        n = np.bincount(place[seen], minlength=_SPEEDS)
        of = np.bincount(place[seen], force[seen], _SPEEDS) / np.maximum(n, 1)
        off = np.bincount(place[seen], rest[seen], _SPEEDS) / np.maximum(n, 1)
        worst = max(worst, float(np.max(np.abs(off) / np.maximum(np.abs(of), max(least, 1e-300)))))
    return 100.0 * worst
