"""How well the cycles of a test repeat: scatter and trend of the peaks, drift of force and stroke.

Limits, and what the faults cost near them (`python -m tests.conditioning.limits`; the largest error
at settings 1, 10 and 20 of the reference set, 500 Hz, no noise):

- A force offset that drifts by 1 % of the peak force costs 1.6 % of K_e, by 3 % 5 %; a mid-stroke
  that drifts by 5 % of the amplitude 0.7 %.

Peaks that fall from the first cycle to the last are no scatter: oil that warms up does that. A
curve of second degree through them is taken off before they are said to scatter.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from damperfit.conditioning.channels import noise_of
from damperfit.conditioning.cycles import clean_cycles
from damperfit.conditioning.filters import apply_filter, settling_samples
from damperfit.problem import Option
from damperfit.recording import FilterDesign, Finding
from damperfit.statistics import mean_of, variance_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from damperfit.recording import Stretch, Trace

    FloatArray = NDArray[np.float64]
    from collections.abc import Iterator

    from damperfit.recording import Recording

__all__ = [
    "examine_repeatability",
    "noise_beside_motion",
    "noise_floor",
    "scatter_between_cycles",
    "with_noise",
]


# How much the force differs from cycle to cycle: the floor of any model's error.
#
# Cycles are laid over each other on the phase between their boundaries. At phase p, with m
# cycles::
#
#     s^2 = mean over p of  sum_j (f_j(p) - mean_j f_j(p))^2 / (m - 1)        unbiased for any m
#     floor = 100 s^2 / var(f)                                                the measure of eq. (22
#
# Reading the force between samples by a four-point cubic w averages its noise; s^2 is divided by
# what that leaves, mean of w^T R w, where R is the autocorrelation of white noise behind the
# trace's filter. A perfect model has this error or a little more: displacement noise is not in
# it.
#
# Where nothing repeats, the noise is taken for white and read from the fifth differences of what
# the filter takes off, in which the jumps of friction are few; behind it is what the filter
# passes.

_FEWEST_PHASES = 8
_TAPS = 4  # samples that a place between them is read from
_BY_CYCLES = "scatter between cycles"


def noise_floor(trace: Trace) -> float:
    """Return the noise of the compared force, percent of its variance, eq. (22).

    NaN where a stretch has but a single cycle, and where the force does not vary.
    """
    variance = variance_of(trace.force[trace.compared])
    if not variance > 0.0:
        return math.nan
    noise = sum(one.n_samples * _known(trace, one) for one in trace.stretches)
    return 100.0 * noise / trace.n_samples / variance


def _known(trace: Trace, stretch: Stretch) -> float:
    """Mean square of the noise of a stretch, N^2: by its cycles, or by what was found above them.

    A log of a single cycle and no more is not called known by its spectrum alone.
    """
    # `with_noise` has folded the cycles already; three times a log was a tenth of conditioning.
    is_told = stretch.noise_source == _BY_CYCLES and stretch.n_cycles > 1
    scatter = stretch.noise**2 if is_told else scatter_between_cycles(trace, stretch)
    is_single = stretch.n_cycles == 1 and len(trace.stretches) == 1
    return scatter if is_single or math.isfinite(scatter) else stretch.noise**2


def with_noise(trace: Trace, rest: FloatArray) -> Trace:
    """Return a trace with the noise of each stretch."""
    return replace(trace, stretches=tuple(_noisy(trace, one, rest) for one in trace.stretches))


def _noisy(trace: Trace, stretch: Stretch, rest: FloatArray) -> Stretch:
    noise = math.sqrt(scatter_between_cycles(trace, stretch))
    if math.isfinite(noise):
        return replace(stretch, noise=noise, noise_source=_BY_CYCLES)
    if not len(rest):
        return stretch
    noise = noise_of(rest[stretch.window]) * math.sqrt(
        _passed(trace.model_filter._replace(bridged=()))
    )
    return replace(stretch, noise=noise, noise_source="above the filter")


def _passed(design: FilterDesign) -> float:
    """Return the share of white noise's variance that a filter passes."""
    reach = settling_samples(design) + 1
    impulse = np.zeros(2 * reach + 1)
    impulse[reach] = 1.0
    return float(np.sum(apply_filter(design, impulse) ** 2))


def scatter_between_cycles(trace: Trace, stretch: Stretch) -> float:
    """Return the mean square of what the force differs by from cycle to cycle, N^2.

    NaN for a single cycle, and where the filter holds another motion through most of it.
    """
    if stretch.n_cycles < 2:
        return math.nan
    starts = stretch.cycle_starts
    n_phases = max(8, round(mean_of(np.diff(starts))))
    phases = np.arange(n_phases) / n_phases
    ahead, behind = stretch.smeared
    phases = phases[(phases * n_phases >= ahead) & ((1.0 - phases) * n_phases > behind)]
    if len(phases) < _FEWEST_PHASES:
        return math.nan
    (values,), weights = _folded(trace.force[None], starts, phases)
    scatter = float(np.mean(np.var(values, axis=0, ddof=1)))
    design = trace.model_filter
    correlation = _autocorrelation(design.sections.tobytes(), design.is_zero_phase)
    # Sums of the products of weights that stand 0, 1, 2, 3 samples apart.
    products = weights @ weights.T
    lags = np.array([(2.0 if k else 1.0) * np.trace(products, k) for k in range(_TAPS)])
    return float(scatter * weights.shape[1] / (lags @ correlation))


def noise_beside_motion(trace: Trace) -> float:
    """Return what is left of the fastest stretch's noise floor beside what its motion explains, %.

    The force of each cycle, less the mean cycle, is laid upon what displacement, velocity and its
    square differ by from theirs: a motion that drifts makes a force that does.
    """
    starts = clean_cycles(trace.fastest)
    floor = noise_floor(trace)
    if len(starts) < 3 or math.isnan(floor):
        return math.nan
    n_phases = max(8, round(mean_of(np.diff(starts))))
    v = trace.velocity
    channels = np.stack([trace.displacement, v, v * np.abs(v), trace.force])
    read, _ = _folded(channels, starts, np.arange(n_phases) / n_phases)
    off = (read - read.mean(axis=1, keepdims=True)).reshape(len(channels), -1)
    products = off @ off.T
    size = np.maximum(np.sqrt(np.diag(products)), 1e-300)
    alike = products / size / size[:, np.newaxis]
    explained = alike[:3, 3] @ np.linalg.lstsq(alike[:3, :3], alike[:3, 3], rcond=None)[0]
    return floor * max(1.0 - float(explained), 0.0)


def _folded(
    channels: FloatArray, starts: FloatArray, phases: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return channels at each phase of each cycle, (k, cycles, phases), by a cubic through four.

    And the weights of the four, (4, places). Beyond the ends the outermost four are read on.
    """
    at = (starts[:-1, None] + np.diff(starts)[:, None] * phases).ravel()
    first = np.clip(at, 1.0, channels.shape[1] - 3.0).astype(np.int64) - 1
    u = at - first - 1.0
    less, more, most = u - 1.0, u + 1.0, u - 2.0
    weights = np.array(
        [-u * less * most / 6.0, more * less * most / 2.0, -more * u * most / 2.0,
         more * u * less / 6.0]
    )  # fmt: skip
    rows = np.ascontiguousarray(channels.T)  # side by side, for all are read at each place
    read = weights[0, :, None] * rows[first]
    for tap in range(1, _TAPS):
        read += weights[tap, :, None] * rows[first + tap]
    return read.T.reshape(len(channels), len(starts) - 1, len(phases)), weights


@lru_cache(maxsize=64)
def _autocorrelation(sections: bytes, is_zero_phase: bool) -> FloatArray:  # noqa: FBT001
    """Return the correlation of white noise behind a filter at lags 0 to 3."""
    design = FilterDesign(np.frombuffer(sections).reshape(-1, 6).copy(), is_zero_phase, "")
    reach = settling_samples(design) + 4
    impulse = np.zeros(2 * reach + 1)
    impulse[reach] = 1.0
    answer = apply_filter(design, impulse)
    sums = np.array([answer[: len(answer) - k] @ answer[k:] for k in range(_TAPS)])
    return np.asarray(sums / sums[0])


_SCATTER = 1.0  # %
_FALL = 3.0  # %, of the peaks from the first cycle to the last; K_e is off by half of it or more
_FORCE_DRIFT = 1.0  # % of the peak force
_STROKE_DRIFT = 5.0  # % of the amplitude
_SURE = 4.0  # standard errors
_ENOUGH = 4  # cycles, to tell a trend from scatter
_JUMP, _STEPS_OVER, _MOST_STEPS = 0.05, 3.0, 20  # of the peak; times what stays level moves
_CURVED = 8  # cycles, from which on a trend may bend
_TREND = 12.0  # F, from which on peaks go with the cycle's number; scatter has it once in 300
_WARMS = 1.0  # K
_WITH_TEMPERATURE = " while the temperature"
_OF_MOTION = 0.7  # of the noise floor, below which the motion explains some of it


def examine_repeatability(recording: Recording, trace: Trace) -> Iterator[Finding]:
    """Yield how the steady cycles of a log repeat."""
    is_warming = False
    n_cycles = len(clean_cycles(trace.fastest)) - 1 if trace.fastest.n_cycles else 0
    if n_cycles >= _ENOUGH and (stepped := _stepped(trace)):
        yield stepped
    if n_cycles >= 2 and math.isfinite(floor := noise_floor(trace)):
        found = list(_scatter_repeatability(trace, _warming(recording, trace)))
        is_warming = any(_WITH_TEMPERATURE in one.sentence for one in found)
        yield from found
        yield _noise_floor(trace, floor)
    if n_cycles >= _ENOUGH:
        if float(np.ptp(trace.force[trace.compared])) > 0.0:
            yield _force_drift(trace, is_warming=is_warming)
        yield _stroke_drift(trace)


def _stepped(trace: Trace) -> Finding | None:
    """Say where the force steps from one steady cycle to the next: another setting begins."""
    peaks = np.array(_extremes(trace.force, trace))
    size = float(np.abs(peaks).max())
    jumps = np.flatnonzero(np.abs(np.diff(peaks)).max(axis=0) > _JUMP * size) + 1
    groups = np.split(np.arange(peaks.shape[1]), jumps)
    steady = [group for group in groups if len(group) > 1]  # a cycle by itself is on its way
    if not 1 < len(steady) <= _MOST_STEPS or len(jumps) >= 2 * len(steady):
        return None
    levels = [np.median(peaks[:, group], axis=1) for group in steady]
    moves = [float(np.abs(b - a).max()) for a, b in pairwise(levels)]
    inner = [group[1:-1] if len(group) > 3 else group for group in steady]  # a step takes a cycle
    wander = max(float(np.ptp(peaks[:, group], axis=1).max()) for group in inner)
    if min(moves) < max(_JUMP * size, _STEPS_OVER * wander):
        return None
    starts = clean_cycles(trace.fastest)
    times = [trace.start_time + trace.interval * starts[group[0]] for group in steady]
    forces = "; then ".join(f"{up:.4g} and {down:.4g} N" for up, down in levels)
    text = (
        f"the force steps at time {', '.join(f'{time:.4g} s' for time in times[1:])} while the "
        f"motion goes on, peaks of {forces}: {len(steady)} settings in one record are as many "
        "tests; split the log there and name each setting, or repair what changed"
    )
    return Finding("another_force", "warning", text, times[1], "s")


def _warming(recording: Recording, trace: Trace) -> tuple[float, float] | None:
    """Return the temperature of the first and of the last cycle, degC."""
    if recording.temperature is None:
        return None
    starts = clean_cycles(trace.fastest)
    ends = []
    for begin, end in (starts[:2], starts[-2:]):
        span = trace.start_time + trace.interval * np.array([begin, end])
        inside = (recording.time >= span[0]) & (recording.time <= span[1])
        ends.append(mean_of(recording.temperature[inside]))
    return ends[0], ends[1]


class _Peaks(NamedTuple):
    """Scatter of peaks about their trend, %, and the trend's ends; None where there is none."""

    scatter: float
    deviation: float
    trend: tuple[float, float] | None


def _peaks(peaks: FloatArray) -> _Peaks:
    n = len(peaks)
    mean = mean_of(peaks)
    degree = 2 if n >= _CURVED else 1
    deviation = float(np.std(peaks, ddof=1))
    trend = None
    if n >= _ENOUGH:
        basis = _polynomials(n, degree)
        line = basis @ (peaks @ basis)
        rest = float(np.sum((peaks - line) ** 2))
        gain = (float(np.sum((peaks - mean) ** 2)) - rest) / degree
        # A trend goes one way and ends elsewhere: a bend alone is none.
        goes = abs(float(line[-1] - line[0])) > 0.5 * float(np.ptp(line))
        if goes and gain > _TREND * rest / (n - 1 - degree):
            trend = float(line[0]), float(line[-1])
            deviation = math.sqrt(rest / (n - 1 - degree))
    return _Peaks(100.0 * deviation / max(abs(mean), 1e-300), deviation, trend)


@lru_cache(maxsize=64)
def _polynomials(n: int, degree: int) -> FloatArray:
    """Return polynomials over so many places, square to each other, (n, degree + 1)."""
    return np.asarray(np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, n), degree + 1))[0])


def _scatter_repeatability(
    trace: Trace, warming: tuple[float, float] | None = None
) -> Iterator[Finding]:
    tops, bottoms = _extremes(trace.force, trace)
    up, down = _peaks(tops), _peaks(bottoms)
    # A peak much smaller than the other one scatters more in per cent without being worse.
    size = max(abs(mean_of(tops)), abs(mean_of(bottoms)))
    worst = 100.0 * max(up.deviation, down.deviation) / size
    text = (
        f"peak force scatters by {up.scatter:.2g} % (rebound) and {down.scatter:.2g} % (bump) over "
        "the cycles"
    )
    if up.trend or down.trend:
        text += ", their trend taken off"
    # The standard deviation of n cycles is itself uncertain by 1/sqrt(2(n-1)).
    sure = _SCATTER * (1.0 + 2.0 / math.sqrt(2.0 * (len(tops) - 1)))
    if worst <= sure:
        yield Finding("cycle_scatter", "note", text, worst, "%")
    else:
        text += f"; a good rig has {_SCATTER:g} % or less: check play, temperature, air in the oil"
        yield Finding("cycle_scatter", "warning", text, worst, "%")
    # Both peaks move the same way where the zero drifts.
    ends = [trend or (0.0, 0.0) for trend in (up.trend, down.trend)]
    fall = 0.5 * abs(ends[0][1] - ends[0][0] - ends[1][1] + ends[1][0])
    if 100.0 * fall / size > _FALL:
        yield _trend_of_peaks(up, down, warming)


def _trend_of_peaks(up: _Peaks, down: _Peaks, warming: tuple[float, float] | None) -> Finding:
    """Say that the damper itself changed during the test."""
    ends = [
        f"from {peaks.trend[0]:.3g} to {peaks.trend[1]:.3g} N ({word})"
        for peaks, word in ((up, "rebound"), (down, "bump"))
        if peaks.trend
    ]
    first, last = max(
        (peaks.trend for peaks in (up, down) if peaks.trend), key=lambda ends: abs(ends[0])
    )
    share = 100.0 * (abs(last) - abs(first)) / max(abs(first), 1e-300)
    text = f"the peak force goes {' and '.join(ends)} over the cycles"
    is_warming = warming is not None and abs(warming[1] - warming[0]) >= _WARMS
    if warming is not None and is_warming:
        text += f"{_WITH_TEMPERATURE} goes from {warming[0]:.3g} to {warming[1]:.3g} degC"
    text += ": a trend, not scatter; the parameters are a mean over it: let the damper settle, or "
    text += "fit shorter parts of the log"
    if is_warming:
        text += ", all of them at once with {covariate}"
    covariate = Option("covariate", "temperature")
    return Finding("force_trend", "warning", text, share, "%", values={"covariate": covariate})


def _noise_floor(trace: Trace, floor: float) -> Finding:
    text = f"the force differs from cycle to cycle by {floor:.2g} % of its variance"
    beside = noise_beside_motion(trace)
    if beside < _OF_MOTION * floor:
        text += (
            f", but the motion differs too: beside that it is {beside:.2g} %, and a right model, "
            "driven by the motion as it was, would reach about that MSE"
        )
    else:
        text += ": a right model would reach about this MSE"
    return Finding("noise_floor", "note", text, floor, "%")


def _force_drift(trace: Trace, *, is_warming: bool = False) -> Finding:
    tops, bottoms = _extremes(trace.force, trace)
    half = 0.5 * (mean_of(tops) - mean_of(bottoms))
    drift, error = _trend(_cycle_means(trace.force, clean_cycles(trace.fastest)))
    share = 100.0 * drift / half
    text = (
        f"the mean force drifts by {drift:+.3g} N over the cycles, {abs(share):.2g} % of the peak"
    )
    if abs(share) <= _FORCE_DRIFT or abs(drift) <= _SURE * error:
        return Finding("force_drift", "note", text, share, "%")
    if is_warming:
        text += ", as the peaks change with the temperature"
        return Finding("force_drift", "note", text, share, "%")
    text += "; K_e is off by about as much; check amplifier and temperature"
    return Finding("force_drift", "warning", text, share, "%")


def _stroke_drift(trace: Trace) -> Finding:
    tops, bottoms = _extremes(trace.displacement, trace)
    middle, middle_error = _trend(0.5 * (tops + bottoms))
    swing, swing_error = _trend(0.5 * (tops - bottoms))
    text = (
        f"mid-stroke drifts by {1e3 * middle:+.2g} mm and the amplitude by {1e3 * swing:+.2g} mm "
        "over the cycles"
    )
    drift, error = max((middle, middle_error), (swing, swing_error), key=lambda pair: abs(pair[0]))
    share = 100.0 * drift / trace.amplitude
    if abs(share) <= _STROKE_DRIFT or abs(drift) <= _SURE * error:
        return Finding("stroke_drift", "note", text, share, "%")
    text += f", {abs(share):.2g} % of the amplitude; check the sensor's fixing"
    return Finding("stroke_drift", "warning", text, share, "%")


def _extremes(values: FloatArray, trace: Trace) -> tuple[FloatArray, FloatArray]:
    """Return the highest and the lowest value of each cycle."""
    edges = np.rint(clean_cycles(trace.fastest)).astype(np.int64)
    inside = values[: edges[-1]]
    return np.maximum.reduceat(inside, edges[:-1]), np.minimum.reduceat(inside, edges[:-1])


def _cycle_means(values: FloatArray, starts: FloatArray) -> FloatArray:
    """Return the mean of each cycle between its fractional boundaries."""
    total = np.concatenate([[0.0], np.cumsum(0.5 * (values[:-1] + values[1:]))])
    at = np.clip(np.floor(starts).astype(np.int64), 0, len(values) - 2)
    u = starts - at
    area = total[at] + u * values[at] + 0.5 * u * u * (values[at + 1] - values[at])
    return np.asarray(np.diff(area) / np.diff(starts))


def _trend(values: FloatArray) -> tuple[float, float]:
    """Return how far the straight line through the values goes over all, and its error."""
    n = len(values)
    place = np.arange(n) - 0.5 * (n - 1)
    slope = float(place @ values) / float(place @ place)
    rest = values - mean_of(values) - slope * place
    error = math.sqrt(float(rest @ rest) / max(n - 2, 1) / float(place @ place))
    return slope * (n - 1), error * (n - 1)
