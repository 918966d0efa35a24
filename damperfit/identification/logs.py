"""The logs of a setting as a fit sees them: what they show, mean cycles, the model beside them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from damperfit.arrays import FloatArray
from damperfit.compiled_core import compiled_core
from damperfit.conditioning.filters import apply_filter, impulse_of, passed_at
from damperfit.damper.model import GAS_AMOUNT, RIG, STIFFNESS, Model, Quantity, Values
from damperfit.problem import Problem, warning
from damperfit.recording import Segment, Trace
from damperfit.simulation import Motion, Response, SolverOptions, motion_of, simulate
from damperfit.statistics import mean_of, median, variance_of

# What a fit asks of its logs: how much each sample counts, how many count, what they can show.

FEWEST_SAMPLES = 20.0  # effective ones, of a segment


def effective_samples(residuals: FloatArray, n_cycles: int) -> float:
    """The effective number of samples of one segment, (n,) over whole cycles.

    A residual of one harmonic alone counts as few samples as a segment may have.

    >>> effective_samples(np.sin(np.linspace(0.0, 40.0 * np.pi, 2000)), 20)
    20.0
    """
    power = np.abs(np.fft.rfft(residuals)) ** 2
    lines = power[n_cycles::n_cycles]
    whole = float(np.sum(lines))
    if whole <= 0.0:
        return FEWEST_SAMPLES
    return max(2.0 * whole**2 / float(np.sum(lines**2)), FEWEST_SAMPLES)


# How much each sample counts in the fit of a setting: by its segment's noise, and not at a corner.
#
# Where the speed jumps, as at the corners of a triangle, the force of some milliseconds follows
# from the microns and microseconds of the turn, which no sensor shows: noise of a few um there
# bent R_m3 of two triangles. These samples are simulated, shown and in every MSE, but the fit
# takes no notice of them, unless the motion is straight on both sides (`conditioning.drive`).

# Noises within this factor of each other are one: a scatter of few cycles is no better known.
_ALIKE = 1.25
# No segment counts more than this against the middle one, as a fit has other errors than noise.
_FARTHEST = 5.0
_OTHER_ERRORS = 1e-3  # of the force's deviation
# Of the peak speed: what the compared filter takes off the drive's velocity at a jump of it.
_JUMP = 0.5
# Before and after it nothing counts for so many widths of the filter's answer to an impulse, which
# at 30 Hz are 10 and 20 ms.
_BEFORE, _AFTER = 0.6, 1.2
_IMPULSE = 1 << 12  # samples to both sides, far longer than any filter's answer
# Where corners are more of a segment than this, they are what it shows.
_MOST = 1.0 / 3.0


def weights(traces: Sequence[Trace]) -> tuple[FloatArray | None, ...]:
    """What the residuals of each log are multiplied by, over its compared samples; mean square 1.

    One over the noise of each segment (the middle one's, where none is known), nothing beside a
    jump of the speed. None for all where no sample differs.
    """
    counted = [_counted(trace) for trace in traces]
    segments = [segment for trace in traces for segment in trace.segments]
    noises, counts = ([getattr(x, n) for x in segments] for n in ("noise", "n_samples"))
    known, factors = [noise for noise in noises if math.isfinite(noise)], np.ones(len(segments))
    if len(segments) > 1 and known:
        force = np.concatenate([trace.force[trace.compared] for trace in traces])
        other = _OTHER_ERRORS * float(np.std(force))
        middle = math.hypot(median(known), other)
        sizes = [math.hypot(noise, other) if math.isfinite(noise) else middle for noise in noises]
        if max(sizes) > _ALIKE * min(sizes):
            factors = np.clip(middle / np.array(sizes), 1.0 / _FARTHEST, _FARTHEST)
            factors /= math.sqrt(float(counts @ factors**2) / sum(counts))
    if np.all(factors == 1.0) and all(mask is None for mask in counted):
        return (None,) * len(traces)
    ends = np.cumsum([trace.n_samples for trace in traces])[:-1]
    rows = np.split(np.repeat(factors, counts), ends)
    if any(mask is not None for mask in counted):
        pairs = zip(rows, counted, strict=True)
        rows = [row if mask is None else row * mask for row, mask in pairs]
        power = sum(float(row @ row) for row in rows) / sum(len(row) for row in rows)
        rows = [row / math.sqrt(power) for row in rows]
    return tuple(rows)


def _counted(trace: Trace) -> NDArray[np.bool_] | None:
    """Which of the compared samples lie beside no jump of the speed; None for all."""
    if trace.drive.velocity is trace.velocity or len(trace.drive.jumps):
        return None
    cut_off = np.abs(trace.drive.velocity - trace.velocity)
    counts = np.ones(len(cut_off), dtype=bool)
    # How long the filter's answer to an impulse lasts, in samples: 1 over its power.
    width = 1.0 / float(np.sum(impulse_of(trace.model_filter, _IMPULSE) ** 2))
    for segment in trace.segments:
        part = segment.window
        near = np.zeros(segment.n_samples, dtype=bool)
        for at in np.flatnonzero(cut_off[part] > _JUMP * segment.peak_speed).tolist():
            near[max(0, at - round(_BEFORE * width)) : at + round(_AFTER * width) + 1] = True
        if np.mean(near) <= _MOST:
            counts[part] = ~near
    return None if counts.all() else counts[trace.compared]


# Logs that hold one speed, or a few: what triangle waves cannot show.
#
# At constant speed a stroke shows one level of force, and two levels cannot give R_m1, R_m2, R_m3
# and f_f. What is left are the corners, a few milliseconds in which the elasticity of the oil
# settles; a fit finds a minimum there that is several of its errors away from the truth. Six
# levels, of three speeds, do not give the eight numbers of two valves, a friction and an offset
# either: above the knee of both curves a friction and a preload make one level.

_ONE_SPEED = (
    "the logs hold one speed, so that the valves and friction cannot be separated: "
    "add a log or a segment at another speed, or hold one valve and the friction."
)
_FEW_SPEEDS = (
    "the logs hold {} speeds: their {} levels of force do not determine {} numbers of valves, "
    "friction and offset, and only the corners separate a friction from a preload: add a test at "
    "another speed, below the knee of the force."
)
_LEVELS = 2  # of a speed, one in rebound, one in bump
_NEAR = 0.1  # of the speed
# Of the samples. A triangle has 0.96 and more, a sine 0.29; beside 10 % of another speed 0.9.
_SHARE = 0.9


class LogFacts:
    """Properties of the logs of one setting that a fit needs often, each computed once."""

    def __init__(self, traces: tuple[Trace, ...]) -> None:
        self.traces = traces

    @cached_property
    def deviation(self) -> float:
        """Standard deviation of all measured forces that are compared, N."""
        forces = [trace.force[trace.compared] for trace in self.traces]
        return math.sqrt(variance_of(forces[0] if len(forces) == 1 else np.concatenate(forces)))

    @cached_property
    def n_samples(self) -> int:
        """Samples compared."""
        return sum(trace.n_samples for trace in self.traces)

    @cached_property
    def weights(self) -> tuple[FloatArray | None, ...]:
        """What the residuals of each log are multiplied by, as `weights` has it."""
        return weights(self.traces)

    @cached_property
    def holds_one_speed(self) -> bool:
        """Whether nearly all samples are at one speed, either way."""
        speeds = [np.abs(trace.drive.velocity[trace.compared]) for trace in self.traces]
        return _speed_held(np.concatenate(speeds)) is not None

    @cached_property
    def n_speeds(self) -> int | None:
        """How many speeds the segments hold; None where one holds none."""
        places = ((log.drive.velocity, part) for log in self.traces for part in log.segments)
        each = [_speed_held(np.abs(velocity[segment.window])) for velocity, segment in places]
        speeds: list[float] = []
        for held in each:
            if held is not None and all(abs(held / other - 1.0) > _NEAR for other in speeds):
                speeds.append(held)
        return None if None in each else len(speeds)


def _speed_held(speed: FloatArray) -> float | None:
    """The speed at which nearly all samples are; None where there is none."""
    usual = median(speed)
    is_held = mean_of(np.abs(speed - usual) <= _NEAR * usual) > _SHARE
    return usual if is_held else None


def inseparable(
    facts: LogFacts, free: Sequence[str], quantities: Sequence[Quantity]
) -> tuple[str, ...]:
    """The free parameters that logs of one speed cannot separate; none where they can."""
    # The stiffness of the oil shows in the corners.
    unknown = [q for q in quantities if q.name in free and q.role != STIFFNESS]
    return tuple(free) if len(unknown) > _LEVELS and facts.holds_one_speed else ()


def speed_warnings(
    facts: LogFacts, free: Sequence[str], quantities: Sequence[Quantity]
) -> tuple[Problem, ...]:
    """Warnings about logs that hold one speed, or too few for what is fitted."""
    if inseparable(facts, free, quantities):
        return (warning("one-speed", _ONE_SPEED),)
    # Stiffness, gas and mounting show in the corners and along the stroke.
    n_unknown = sum(
        (q.is_offset or q.scope != RIG) and q.role not in {STIFFNESS, GAS_AMOUNT}
        for q in quantities
        if q.name in free
    )
    # Two speeds determine four, and one was asked for above.
    n = facts.n_speeds if n_unknown > 2 * _LEVELS else None
    if n is None or _LEVELS * n >= n_unknown:
        return ()
    return (warning("few-speeds", _FEW_SPEEDS.format(n, _LEVELS * n, n_unknown)),)


# The settled mean cycle of each steady segment, in place of a whole log.
#
# What repeats shows a model the same in every cycle. Half a cycle, from one turn of the motion to
# the next, lets the model settle, one more is compared with the mean of the measured ones. The
# cycle being periodic, the filter is a factor of each harmonic. What differs from cycle to cycle
# stays as one more residual that nothing moves, so that sums of squares are those of the whole
# log, and a fit ends as there. With as many samples as the log has it is the work of one and
# a half cycles; thinned to what the filter lets through it is less.
#
# Friction jumps at a reversal, between two samples. Over a log whose samples fall elsewhere in
# every cycle that averages out, and the mean cycle's friction is that of a sample's whole length:
# a dead band that the speed crosses in one sample. Where the samples fall on the same places in
# every cycle, so do those of the mean cycle.
#
# Not for a last word: a drift, or a state that needs more than half a cycle, is for the whole
# log.

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
    """One steady segment as half a cycle that is only simulated and one that is compared."""

    motion: Motion  # both, from a turn of the motion on
    force: FloatArray  # (n,), mean of the measured cycles, N
    gain: NDArray[np.complex128]  # of the compared filter at each line of the real transform
    # (n,): what residuals are multiplied by, so that their sum of squares is the segment's.
    factor: FloatArray
    # Half width of the friction's dead band that a sample's length is, m/s; 0: the solver's own.
    dead_band: float = 0.0
    n_cycles: int = 1  # that it is the mean of
    # (n_cycles + 1,), where in the trace the cycles begin and the last one ends, samples.
    starts: FloatArray = field(default_factory=lambda: np.empty(0))
    turn: int = 0  # sample that a cycle's beginning is of `force`

    def solver(self, options: SolverOptions) -> SolverOptions:
        """How to integrate it: with the friction's dead band that its samples have."""
        is_wide = options.dead_band >= self.dead_band
        return options if is_wide else replace(options, dead_band=self.dead_band)

    def rows(self, response: Response) -> FloatArray:
        """Residuals and derivatives, behind the filter, weighed: (1 + k, n)."""
        rows = self._filtered([response.force, *response.sensitivities.values()])
        rows[0] -= self.force
        rows *= self.factor
        return rows

    def taken_by_filter(self, signal: FloatArray) -> FloatArray:
        """What the filter takes off a signal of a response in the compared cycle, (n,)."""
        return np.asarray(signal[-len(self.force) :] - self._filtered([signal])[0])

    def over(self, segment: Segment, signals: Sequence[FloatArray]) -> FloatArray:
        """Signals of a response behind the filter at the samples of a segment, (k, n), by cycle."""
        rows = self._filtered(signals)
        n, starts = rows.shape[1], self.starts
        samples = segment.first + np.arange(segment.n_samples)
        # How many samples each cycle has; what lies before the first or behind the last is theirs.
        ends = [0, *np.searchsorted(samples, starts[1:-1]).tolist(), len(samples)]
        begins = np.repeat(np.stack([starts[:-1], np.diff(starts)]), np.diff(ends), axis=1)
        at = np.mod(n * ((samples - begins[0]) / begins[1]) + self.turn, n) + _MARGIN
        # Through the eight samples around each: within 2e-5.
        around = np.concatenate([rows[:, -_MARGIN:], rows, rows[:, :_MARGIN]], axis=1)
        between = np.empty((len(rows), len(at)))
        compiled_core().between(around, np.ascontiguousarray(at), between, len(rows))
        return between

    def _filtered(self, signals: Sequence[FloatArray]) -> FloatArray:
        """The compared cycle of signals behind the filter."""
        n = len(self.force)
        lines = np.fft.rfft(np.stack([signal[-n:] for signal in signals])) * self.gain
        return np.asarray(np.fft.irfft(lines, n))


class SettledLogs(NamedTuple):
    """The logs of a setting as settled cycles."""

    cycles: tuple[SettledCycle, ...]  # one for each segment of each log
    scatter: float  # sum of squares that the cycles' differences from their mean add, N^2


def settled(traces: Sequence[Trace], *, is_thinned: bool = True) -> SettledLogs | None:
    """The settled cycles of the logs of a setting; None where none repeats, or little is saved.

    Thinned, cycles have no more samples than the filter lets through; else the log's own.
    """
    if any(not segment.n_cycles for trace in traces for segment in trace.segments):
        return None
    # Between samples the speed jumps elsewhere in each cycle.
    if any(len(trace.drive.jumps) for trace in traces):
        return None
    cycles, scatter = [], 0.0
    for trace, weight in zip(traces, weights(traces), strict=True):
        for segment, place in zip(trace.segments, trace.places, strict=True):
            own = None if weight is None else weight[place]
            cycle, rest = _settled(trace, segment, own, is_thinned=is_thinned)
            cycles.append(cycle)
            scatter += rest
    simulated = sum(len(cycle.motion.displacement) for cycle in cycles)
    if sum(len(trace.force) for trace in traces) < _WORTH * simulated:
        return None
    return SettledLogs(tuple(cycles), scatter)


def _settled(
    trace: Trace, segment: Segment, weight: FloatArray | None, *, is_thinned: bool
) -> tuple[SettledCycle, float]:
    """A segment's settled cycle, and its scatter as a sum of weighed squares."""
    starts, n_cycles = segment.cycle_starts, segment.n_cycles
    counts = np.arange(len(starts)) - 0.5 * n_cycles
    period = float(counts @ starts) / float(counts @ counts)
    line = mean_of(starts) + period * counts
    n = round(period)
    is_aligned = abs(period - n) * n_cycles < _IN_STEP
    if is_thinned:
        n = 2 * math.ceil(0.5 * period)  # as many as the log has where nothing is filtered
        gain = np.abs(_gain(trace, period, n))
        passed = int(np.argmax(gain < 0.5)) if np.any(gain < 0.5) else n
        n = min(n, max(_FEWEST, 2 * math.ceil(0.5 * _PER_HARMONIC * passed)))
    elif not is_aligned:
        n = 2 * fast_length(math.ceil(period / 2))
    if np.max(np.abs(starts - line)) > _IN_STEP:
        line, is_aligned = starts, False
    elif is_aligned and not is_thinned:
        # To the last bit on the samples, and the last cycle as long as the others.
        line = segment.first + period * np.arange(len(starts))
    starts = np.ascontiguousarray(line, dtype=np.float64)
    means, beside, room = np.empty((3, n)), np.empty(n), np.empty(len(starts) - 1)
    channels = (trace.drive.displacement, trace.drive.velocity, trace.force)
    rows = (np.ascontiguousarray(channel, dtype=np.float64) for channel in channels)
    compiled_core().fold(*rows, starts, means, beside, room)
    x, v, force = means
    power = np.full(n, segment.n_samples / n)
    if weight is not None:
        positions = starts[:-1, None] + np.diff(starts)[:, None] * (np.arange(n) / n)
        at = np.clip(np.rint(positions).astype(np.int64) - segment.first, 0, len(weight) - 1)
        power *= np.mean(weight[at] ** 2, axis=0)
    scatter = float(power @ beside) / n_cycles
    turn = -int(np.abs(x - mean_of(x)).argmax())
    force, power = (np.concatenate([row[-turn:], row[:-turn]]) for row in (force, power))
    interval = trace.interval * period / n
    lead = (n // 2) * math.ceil(_SETTLING / (0.5 * n * interval))
    before = np.arange(-turn - lead, n - turn) % n
    dead_band = 0.0
    if not (is_aligned or is_thinned):
        # Half of what the velocity changes by in a sample at its reversals, on average.
        after = np.append(v[1:], v[0])
        at = np.flatnonzero(np.signbit(v) != np.signbit(after))
        dead_band = 0.5 * mean_of(np.abs(after[at] - v[at]))
    motion = Motion(interval, x[before], v[before], 0.0, trace.gas_pressure, trace.temperature)
    gain, factor = _gain(trace, period, n), np.sqrt(power)
    return SettledCycle(motion, force, gain, factor, dead_band, n_cycles, starts, turn), scatter


def _gain(trace: Trace, period: float, n: int) -> NDArray[np.complex128]:
    """The filter at the harmonics of a period in samples."""
    # What lies beyond the log's own highest frequency is not in it.
    return passed_at(trace.model_filter, np.minimum(np.arange(n // 2 + 1) / period, 0.5))


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


# The model beside a log: simulate, filter alike, subtract; and how a fit meets it.


class SimulatedLog(NamedTuple):
    """A response and its force as compared with the measured one."""

    response: Response  # as simulated, unfiltered
    force: FloatArray  # (n,), N, and sensitivities as asked for, (k, n), behind the model filter
    sensitivities: FloatArray


def compare(
    parameters: Values,
    trace: Trace,
    damper: Model,
    *,
    sensitivities: Sequence[str] = (),
    solver: SolverOptions = SolverOptions(),
) -> SimulatedLog:
    """Simulate the displacement of a trace and filter the force as the measured one was.

    Filtering both sides alike keeps the parameters right: a raw model against filtered data costs
    5 % of the friction, a causal filter on one side most of the bulk modulus.
    """
    response = simulate(
        parameters, damper, motion_of(trace), sensitivities=sensitivities, options=solver
    )
    rows = np.stack([response.force, *response.sensitivities.values()])
    rows = apply_filter(trace.model_filter, rows)
    return SimulatedLog(response, rows[0], rows[1:])


def normalised_mse(measured: FloatArray, simulated: FloatArray) -> float:
    """Return the normalised mean-square error in per cent, eq. (22).

    100/(N var(f)) sum (f - f_hat)^2; predicting the mean gives exactly 100.

    >>> f = np.array([1.0, 2.0, 3.0, 4.0])
    >>> normalised_mse(f, np.full(4, f.mean()))
    100.0
    """
    misfit = measured - simulated
    # In NumPy's numbers: of a force that does not vary it is infinite.
    return float(np.float64(100.0 * mean_of(misfit * misfit)) / variance_of(measured))


class LogFit(NamedTuple):
    """How one log of a setting is met by the setting's parameters."""

    trace: Trace
    mse_percent: float  # eq. (22) over the log's steady whole cycles,
    noise_floor_percent: float  # and of the scatter between them alone; NaN for a single cycle
    segment_mse_percent: tuple[float, ...] = ()  # of each segment, by its own variance
    cycles: tuple[SettledCycle, ...] = ()  # of each segment, where the fit has gone down on them
