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

__all__ = ["ForceMissed", "Missed", "misses", "worst_force", "worst_stroke"]

# Of half the range: the least force that what is left in a stroke is held against.
_LEAST_FORCE = 0.2
# Forces are compared at as many speeds of a stroke, from a third of the highest one on.
_SPEEDS, _FROM_SPEED = 12, 4
# A stroke is off by noise where its speeds together are by no more of their standard errors. Of 66
# strokes of twelve dampers in their true laws three were by more, 1.7 at worst, with forces within
# 0.3 %; single forces were off by up to 1.9 % (`python -m tests.laws.force_noise`).
_BY_NOISE = 1.6


class ForceMissed(NamedTuple):
    """A force that is off, and one that is off by more than noise; both as of `LawFit`."""

    worst_percent: float = 0.0
    sure_percent: float = 0.0


class Missed(NamedTuple):
    """Residuals of each stretch, N; the MSE of each, of all; the rest as of `LawFit`."""

    residuals: tuple[FloatArray, ...]
    stretches: tuple[float, ...]
    mse_percent: float
    worst_stroke_percent: float
    worst_force_percent: float
    sure_force_percent: float


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
    residuals, alone, measured, velocity, forces = [], [], [], [], [ForceMissed()]
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
                samples = np.arange(part.start, part.stop)
                cycle = np.searchsorted(stretch.cycle_starts, samples, "right")
                forces.append(worst_force(measured[-1], residuals[-1], velocity[-1], cycle))
    together, rest = np.concatenate(measured), np.concatenate(residuals)
    mse = normalised_mse(together, together + rest)
    worst = worst_stroke(together, rest, np.concatenate(velocity))
    off = (max(one[k] for one in forces) for k in (0, 1))
    return Missed(tuple(residuals), tuple(alone), mse, worst, *off)


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


def worst_force(
    force: FloatArray, rest: FloatArray, velocity: FloatArray, cycle: NDArray[np.intp]
) -> ForceMissed:
    """Return by how much the mean force at a speed is off where it is off most.

    A speed is a twelfth of the highest of its stroke, from a third of that on; the force there is
    the mean over all cycles, which errs as the forces of single cycles scatter. Whether a stroke is
    off by more than that its speeds say together: of a single one, as of a triangle, the MSE does.

    Parameters
    ----------
    force, rest, velocity, cycle : numpy.ndarray
        Shape (n,), whole cycles: measured, N; model less measured, N; of the rod, m/s; which cycle
        it is.
    """
    least = max(_LEAST_FORCE * 0.5 * float(np.ptp(force)), 1e-300)
    cycle = cycle - np.min(cycle)
    shape = (int(np.max(cycle)) + 1, _SPEEDS)
    worst, sure = 0.0, 0.0
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
        often = np.count_nonzero(n, axis=0) > 1
        if _times_noise(off[:, often], n[:, often]) > _BY_NOISE:
            sure = max(sure, float(np.max(missed[often])))
    return ForceMissed(100.0 * worst, 100.0 * sure)


def _times_noise(off: FloatArray, n: FloatArray) -> float:
    """Return by how many of their standard errors forces at the speeds of a stroke are off.

    Parameters
    ----------
    off, n : numpy.ndarray
        Shape (cycles, speeds): sum of what is off, N, and of how many samples; each speed in two
        cycles at least.

    Returns
    -------
    float
        Root of the sum of squares over that of the errors; 0 of a single speed.
    """
    passed = np.count_nonzero(n, axis=0)
    if len(passed) < 2:
        return 0.0
    means = off / np.maximum(n, 1.0)
    about = np.where(n > 0.0, means - means.sum(axis=0) / passed, 0.0)
    noise = float(np.sum(about**2 / ((passed - 1.0) * passed)))
    together = float(np.sum((off.sum(axis=0) / n.sum(axis=0)) ** 2))
    return math.sqrt(together / max(noise, 1e-300))
