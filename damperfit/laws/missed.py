"""What a law misses of logs: in all, and at the speed where it is off most."""

from __future__ import annotations

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

__all__ = ["Missed", "misses", "worst_force"]

# Of half the range: the least force that what is left in a stroke is held against.
_LEAST_FORCE = 0.2
# Forces are compared at as many speeds of a stroke, from a third of the highest one on.
_SPEEDS, _FROM_SPEED = 12, 4


class Missed(NamedTuple):
    """Residuals of each stretch, N; the MSE of each, of all; the force as of `LawFit`."""

    residuals: tuple[FloatArray, ...]
    stretches: tuple[float, ...]
    mse_percent: float
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
    residuals, alone, measured, forces = [], [], [], [0.0]
    for trace in traces:
        force = compare(values, trace, model, solver=solver).force
        if has_own_offsets:
            force = force + float(np.mean((trace.force - force)[trace.compared]))
        for stretch in trace.stretches:
            part = stretch.window
            residuals.append(force[part] - trace.force[part])
            alone.append(normalised_mse(trace.force[part], force[part]))
            measured.append(trace.force[part])
            if stretch.n_cycles:
                samples = np.arange(part.start, part.stop)
                cycle = np.searchsorted(stretch.cycle_starts, samples, "right")
                velocity = trace.drive.velocity[part]
                forces.append(worst_force(measured[-1], residuals[-1], velocity, cycle))
    together, rest = np.concatenate(measured), np.concatenate(residuals)
    mse = normalised_mse(together, together + rest)
    return Missed(tuple(residuals), tuple(alone), mse, max(forces))


def worst_force(
    force: FloatArray, rest: FloatArray, velocity: FloatArray, cycle: NDArray[np.intp]
) -> float:
    """Return by how much the mean force at a speed is off where it is off most.

    A speed is a twelfth of the highest of its stroke, from a third of that on; the force there is
    the mean over all cycles.

    Parameters
    ----------
    force, rest, velocity, cycle : numpy.ndarray
        Shape (n,), whole cycles: measured, N; model less measured, N; of the rod, m/s; which cycle
        it is.
    """
    least = max(_LEAST_FORCE * 0.5 * float(np.ptp(force)), 1e-300)
    cycle = cycle - np.min(cycle)
    shape = (int(np.max(cycle)) + 1, _SPEEDS)
    worst = 0.0
    for towards in (1.0, -1.0):
        speed = towards * velocity
        place = np.floor(_SPEEDS * speed / max(float(np.max(speed)), 1e-300)).astype(np.intp)
        seen = (place >= _FROM_SPEED) & (place < _SPEEDS)
        where = cycle[seen] * _SPEEDS + place[seen]
        n, of, off = (
            np.bincount(where, weights, shape[0] * _SPEEDS).reshape(shape).astype(np.float64)
            for weights in (None, force[seen], rest[seen])
        )
        passed = n.sum(axis=0) > 0
        n, of, off = n[:, passed], of[:, passed], off[:, passed]
        beside = np.maximum(np.abs(of.sum(axis=0) / n.sum(axis=0)), least)
        missed = np.abs(off.sum(axis=0) / n.sum(axis=0)) / beside
        worst = max(worst, float(np.max(missed, initial=0.0)))
    return 100.0 * worst
