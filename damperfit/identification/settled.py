"""The settled mean cycle of each steady stretch, in place of a whole log.

What repeats tells a model the same in every cycle. Half a cycle, from one turn of the motion to
the next, lets the model settle, one more is compared with the mean of the measured ones, thinned to
what the filter lets through: a tenth of the work of a log of three speeds. The cycle being
periodic, the filter is a factor of each harmonic. What differs from cycle to cycle stays as one
more residual that nothing moves, so that sums of squares are those of the whole log, and a descent
ends as there.

Not for a last word: a drift, or a state that needs more than half a cycle, is for the whole log.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from damperfit.identification.weights import weights
from damperfit.simulation import Motion

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from damperfit.recording import Stretch, Trace
    from damperfit.simulation import Response

    FloatArray = NDArray[np.float64]

__all__ = ["SettledCycle", "SettledLogs", "settled"]

# Samples of a cycle: at least these, and so many for each harmonic that the filter passes by half.
_FEWEST = 256
_PER_HARMONIC = 10
# A log that is not this much longer than its cycles is as well simulated whole.
_WORTH = 2.0


@dataclass(frozen=True, slots=True, eq=False)
class SettledCycle:
    """One steady stretch as half a cycle that is only simulated and one that is compared.

    Attributes
    ----------
    motion : Motion
        Both, from a turn of the motion on.
    force : numpy.ndarray
        Shape (n,), mean of the measured cycles, N.
    gain : numpy.ndarray
        What the compared filter makes of each harmonic, one for each line of the real transform.
    factor : numpy.ndarray
        Shape (n,): what residuals are multiplied by, so that their sum of squares is the stretch's.
    """

    motion: Motion
    force: FloatArray
    gain: NDArray[np.complex128]
    factor: FloatArray

    def rows(self, response: Response) -> FloatArray:
        """Return residuals and derivatives, behind the filter, weighed: (1 + k, n)."""
        rows = np.stack([response.force, *response.sensitivities.values()])
        n = len(self.force)
        rows = np.fft.irfft(np.fft.rfft(rows[:, -n:], axis=1) * self.gain, n, axis=1)
        rows[0] -= self.force
        return np.asarray(rows * self.factor)


@dataclass(frozen=True, slots=True, eq=False)
class SettledLogs:
    """The logs of a setting as settled cycles.

    Attributes
    ----------
    cycles : tuple of SettledCycle
        One for each stretch of each log.
    scatter : float
        Sum of squares that the cycles' differences from their mean add, N^2.
    """

    cycles: tuple[SettledCycle, ...]
    scatter: float


def settled(traces: Sequence[Trace]) -> SettledLogs | None:
    """Return the settled cycles of logs; None where motions do not repeat, or little is saved.

    Parameters
    ----------
    traces : sequence of Trace
        Logs of one setting.
    """
    if any(not one.n_cycles for trace in traces for one in trace.stretches):
        return None
    cycles, scatter = [], 0.0
    for trace, weight in zip(traces, weights(traces), strict=True):
        whole = np.ones(trace.n_samples) if weight is None else weight
        for stretch, place in zip(trace.stretches, trace.places, strict=True):
            cycle, rest = _settled(trace, stretch, whole[place])
            cycles.append(cycle)
            scatter += rest
    simulated = sum(len(one.motion.displacement) for one in cycles)
    if sum(len(trace.force) for trace in traces) < _WORTH * simulated:
        return None
    return SettledLogs(tuple(cycles), scatter)


def _settled(trace: Trace, stretch: Stretch, weight: FloatArray) -> tuple[SettledCycle, float]:
    """A stretch's settled cycle, and its scatter as a sum of weighed squares."""
    from scipy.interpolate import CubicSpline

    starts = stretch.cycle_starts
    period = float(starts[-1] - starts[0]) / stretch.n_cycles  # in samples
    n = _samples(trace, period)
    positions = starts[:-1, None] + np.diff(starts)[:, None] * (np.arange(n) / n)
    first = max(math.floor(starts[0]) - 2, 0)
    stop = min(math.ceil(starts[-1]) + 3, len(trace.force))
    channels = np.stack([trace.drive.displacement, trace.drive.velocity, trace.force])
    spline = CubicSpline(np.arange(first, stop), channels[:, first:stop], axis=1)
    folded = spline(positions)
    x, v, force = folded.mean(axis=1)
    at = np.clip(np.rint(positions).astype(np.int64) - stretch.first, 0, len(weight) - 1)
    power = np.mean(weight[at] ** 2, axis=0) * (stretch.n_samples / n)
    scatter = float(power @ np.mean((folded[2] - force) ** 2, axis=0))
    turn = -int(np.argmax(np.abs(x - x.mean())))
    x, v, force, power = (np.roll(one, turn) for one in (x, v, force, power))
    lead = n // 2
    motion = Motion(
        trace.interval * period / n,
        np.concatenate([x[n - lead :], x]),
        np.concatenate([v[n - lead :], v]),
        gas_pressure=trace.gas_pressure,
    )
    return SettledCycle(motion, force, _gain(trace, period, n), np.sqrt(power)), scatter


def _samples(trace: Trace, period: float) -> int:
    """Samples of a cycle, even; as many as the log has where nothing is filtered."""
    own = 2 * math.ceil(0.5 * period)
    gain = np.abs(_gain(trace, period, own))
    passed = int(np.argmax(gain < 0.5)) if np.any(gain < 0.5) else own
    return min(own, max(_FEWEST, 2 * math.ceil(0.5 * _PER_HARMONIC * passed)))


def _gain(trace: Trace, period: float, n: int) -> NDArray[np.complex128]:
    """The filter at the harmonics of a period in samples."""
    design = trace.model_filter
    # What lies beyond the log's own highest frequency is not in it.
    turn = np.minimum(np.arange(n // 2 + 1) / period, 0.5)
    z = np.exp(-2j * np.pi * turn[:, None] * np.arange(3))
    one_pass = np.prod(
        (z @ design.sections[:, :3].T) / (z @ design.sections[:, 3:].T), axis=1, initial=1.0
    )
    return np.asarray(np.abs(one_pass) ** 2 + 0j if design.is_zero_phase else one_pass)
