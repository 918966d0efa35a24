"""The settled mean cycle of each steady stretch, in place of a whole log.

What repeats tells a model the same in every cycle. Half a cycle, from one turn of the motion to
the next, lets the model settle, one more is compared with the mean of the measured ones. The cycle
being periodic, the filter is a factor of each harmonic. What differs from cycle to cycle stays as
one more residual that nothing moves, so that sums of squares are those of the whole log, and a
descent ends as there. With as many samples as the log has it is the work of one and a half cycles;
thinned to what the filter lets through it is less.

Friction jumps at a reversal, between two samples. Over a log whose samples fall elsewhere in every
cycle that averages out, and the mean cycle's friction is that of a sample's whole length: a dead
band that the speed crosses in one sample. Where the samples fall on the same places in every cycle,
so do those of the mean cycle.

Not for a last word: a drift, or a state that needs more than half a cycle, is for the whole log.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from damperfit.compiled_core import compiled_core
from damperfit.identification.log_facts import weights
from damperfit.simulation import Motion
from damperfit.statistics import mean_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from damperfit.recording import Stretch, Trace
    from damperfit.simulation import Response, SolverOptions

    FloatArray = NDArray[np.float64]

# s; the slowest of a damper's pressures, at 80 1/s, has settled by then to 1e-8.
_SETTLING = 0.25
# Samples of a cycle: at least these, and so many for each harmonic that the filter passes by half.
_FEWEST = 256
_PER_HARMONIC = 10
# A log that is not this much longer than its cycles is as well simulated whole.
_WORTH = 2.0
# Samples by which cycles may be out of step and still be those of one period; by which the last
# cycle's samples may fall beside the first's and still be on the same places.
_IN_STEP = 0.5
# Samples on each side of a cycle that a value between two of them is made of.
_MARGIN = 8


@dataclass(frozen=True, slots=True, eq=False)
class SettledCycle:
    """One steady stretch as half a cycle that is only simulated and one that is compared."""

    motion: Motion  # both, from a turn of the motion on
    force: FloatArray  # (n,), mean of the measured cycles, N
    gain: NDArray[np.complex128]  # of the compared filter at each line of the real transform
    # (n,): what residuals are multiplied by, so that their sum of squares is the stretch's.
    factor: FloatArray
    # Half width of the friction's dead band that a sample's length is, m/s; 0: the solver's own.
    dead_band: float = 0.0
    n_cycles: int = 1  # that it is the mean of
    # (n_cycles + 1,), where in the trace the cycles begin and the last one ends, samples.
    starts: FloatArray = field(default_factory=lambda: np.empty(0))
    turn: int = 0  # sample that a cycle's beginning is of `force`

    def solver(self, options: SolverOptions) -> SolverOptions:
        """How to integrate it: with the friction's dead band that its samples have."""
        if options.dead_band >= self.dead_band:
            return options
        return replace(options, dead_band=self.dead_band)

    def rows(self, response: Response) -> FloatArray:
        """Residuals and derivatives, behind the filter, weighed: (1 + k, n)."""
        rows = self._filtered([response.force, *response.sensitivities.values()])
        rows[0] -= self.force
        rows *= self.factor
        return rows

    def taken_by_filter(self, signal: FloatArray) -> FloatArray:
        """What the filter takes off a signal of a response in the compared cycle, (n,)."""
        return np.asarray(signal[-len(self.force) :] - self._filtered([signal])[0])

    def over(self, stretch: Stretch, signals: Sequence[FloatArray]) -> FloatArray:
        """Signals of a response behind the filter at the samples of a stretch, (k, n), by cycle."""
        rows = self._filtered(signals)
        n, starts = rows.shape[1], self.starts
        samples = stretch.first + np.arange(stretch.n_samples)
        # How many samples each cycle has; what lies before the first or behind the last is theirs.
        ends = [0, *np.searchsorted(samples, starts[1:-1]).tolist(), len(samples)]
        begins = np.repeat(np.stack([starts[:-1], np.diff(starts)]), np.diff(ends), axis=1)
        share = (samples - begins[0]) / begins[1]
        around = np.concatenate([rows[:, -_MARGIN:], rows, rows[:, :_MARGIN]], axis=1)
        at = np.mod(n * share + self.turn, n) + _MARGIN
        return between_samples(around, at[None])[:, 0]

    def _filtered(self, signals: Sequence[FloatArray]) -> FloatArray:
        """The compared cycle of signals behind the filter."""
        n = len(self.force)
        lines = np.fft.rfft(np.stack([signal[-n:] for signal in signals])) * self.gain
        return np.asarray(np.fft.irfft(lines, n))


class SettledLogs(NamedTuple):
    """The logs of a setting as settled cycles."""

    cycles: tuple[SettledCycle, ...]  # one for each stretch of each log
    scatter: float  # sum of squares that the cycles' differences from their mean add, N^2


def settled(traces: Sequence[Trace], *, is_thinned: bool = True) -> SettledLogs | None:
    """The settled cycles of the logs of a setting; None where none repeats, or little is saved.

    Thinned, cycles have no more samples than the filter lets through; else the log's own.
    """
    if any(not one.n_cycles for trace in traces for one in trace.stretches):
        return None
    # Between samples the speed jumps elsewhere in each cycle.
    if any(len(trace.drive.jumps) for trace in traces):
        return None
    cycles, scatter = [], 0.0
    for trace, weight in zip(traces, weights(traces), strict=True):
        for stretch, place in zip(trace.stretches, trace.places, strict=True):
            own = None if weight is None else weight[place]
            cycle, rest = _settled(trace, stretch, own, is_thinned=is_thinned)
            cycles.append(cycle)
            scatter += rest
    simulated = sum(len(one.motion.displacement) for one in cycles)
    if sum(len(trace.force) for trace in traces) < _WORTH * simulated:
        return None
    return SettledLogs(tuple(cycles), scatter)


def _settled(
    trace: Trace, stretch: Stretch, weight: FloatArray | None, *, is_thinned: bool
) -> tuple[SettledCycle, float]:
    """A stretch's settled cycle, and its scatter as a sum of weighed squares."""
    starts, n, period, is_aligned = _laid_out(trace, stretch, is_thinned=is_thinned)
    (x, v, force), beside = _folded(trace, starts, n)
    power = np.full(n, stretch.n_samples / n)
    if weight is not None:
        positions = starts[:-1, None] + np.diff(starts)[:, None] * (np.arange(n) / n)
        at = np.clip(np.rint(positions).astype(np.int64) - stretch.first, 0, len(weight) - 1)
        power *= np.mean(weight[at] ** 2, axis=0)
    scatter = float(power @ beside) / stretch.n_cycles
    turn = -int(np.abs(x - mean_of(x)).argmax())
    force, power = (np.concatenate([one[-turn:], one[:-turn]]) for one in (force, power))
    interval = trace.interval * period / n
    lead = (n // 2) * math.ceil(_SETTLING / (0.5 * n * interval))
    before = np.arange(-turn - lead, n - turn) % n
    cycle = SettledCycle(
        Motion(
            interval,
            x[before],
            v[before],
            gas_pressure=trace.gas_pressure,
            temperature=trace.temperature,
        ),
        force,
        _gain(trace, period, n),
        np.sqrt(power),
        0.0 if is_aligned or is_thinned else _crossed(v),
        stretch.n_cycles,
        starts,
        turn,
    )
    return cycle, scatter


def _folded(trace: Trace, starts: FloatArray, n: int) -> tuple[FloatArray, FloatArray]:
    """Mean displacement, velocity and force of n samples (3, n); squares of the force beside it."""
    channels = (trace.drive.displacement, trace.drive.velocity, trace.force)
    means, beside, room = np.empty((3, n)), np.empty(n), np.empty(len(starts) - 1)
    compiled_core().fold(
        *(np.ascontiguousarray(one, dtype=np.float64) for one in channels),
        np.ascontiguousarray(starts, dtype=np.float64),
        *(means, beside, room),
    )
    return means, beside


def _laid_out(
    trace: Trace, stretch: Stretch, *, is_thinned: bool
) -> tuple[FloatArray, int, float, bool]:
    """Where cycles begin, samples of the mean one, the period, whether they are the log's own."""
    starts = stretch.cycle_starts
    counts = np.arange(len(starts)) - 0.5 * stretch.n_cycles
    period = float(counts @ starts) / float(counts @ counts)
    line = mean_of(starts) + period * counts
    own = round(period)
    is_aligned = abs(period - own) * stretch.n_cycles < _IN_STEP
    n = (
        _samples(trace, period)
        if is_thinned
        else own
        if is_aligned
        else 2 * fast_length(math.ceil(period / 2))
    )
    if np.max(np.abs(starts - line)) > _IN_STEP:
        return np.asarray(starts), n, period, False
    if is_aligned and not is_thinned:
        # To the last bit on the samples, and the last cycle as long as the others.
        return np.asarray(stretch.first + period * np.arange(len(starts))), n, period, True
    return np.asarray(line), n, period, is_aligned


def between_samples(channels: FloatArray, positions: FloatArray) -> FloatArray:
    """Channels (c, n) at fractional samples, through the eight around each: within 2e-5."""
    at = np.ascontiguousarray(positions, dtype=np.float64)
    found = np.empty((len(channels), *at.shape))
    compiled_core().between(np.ascontiguousarray(channels), at, found, len(channels))
    return found


def _crossed(velocity: FloatArray) -> float:
    """Half of what the velocity changes by in a sample at its reversals, on average, m/s."""
    after = np.append(velocity[1:], velocity[0])
    at = np.flatnonzero(np.signbit(velocity) != np.signbit(after))
    return 0.5 * mean_of(np.abs(after[at] - velocity[at]))


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
    z = np.exp(-2j * np.pi * turn)
    powers = np.array([np.ones_like(z), z, z * z])
    over, under = np.split(design.sections, 2, axis=1)
    one_pass = np.multiply.reduce(over @ powers) / np.multiply.reduce(under @ powers)
    return np.asarray(np.abs(one_pass) ** 2 + 0j if design.is_zero_phase else one_pass)


@lru_cache(maxsize=1024)
def fast_length(n: int) -> int:
    """The least length from n on with no prime factor but 2, 3 and 5."""
    best = 1 << max(n - 1, 0).bit_length()
    fives = 1
    while fives < best:
        threes = fives
        while threes < best:
            best = min(best, threes << max(-(-n // threes) - 1, 0).bit_length())
            threes *= 3
        fives *= 5
    return best
