"""Noise: how much the force differs from cycle to cycle, and whether a rig has filtered a channel.

The floor of any model's error: cycles are laid over each other on the phase between their
boundaries. At phase p, with m cycles::

    s^2 = mean over p of  sum_j (f_j(p) - mean_j f_j(p))^2 / (m - 1)        unbiased for any m
    floor = 100 s^2 / var(f)                                                the measure of eq. (22)

Reading the force between samples by a four-point cubic w averages its noise; s^2 is divided by
what that leaves, mean of w^T R w, where R is the autocorrelation of white noise behind the
trace's filter. A perfect model has this error or a little more: displacement noise is not in it.

Where nothing repeats, the noise is taken for white and read from the fifth differences of what
the filter takes off, in which the jumps of friction are few; behind it is what the filter passes.
"""

import math
from dataclasses import replace
from functools import lru_cache

import numpy as np

from damperfit.conditioning.filters import impulse_of, settling_samples
from damperfit.conditioning.signals import FloatArray, IntArray, noise_of
from damperfit.recording import Segment, Trace
from damperfit.statistics import mean_of, median, variance_of

_FEWEST_PHASES = 8
_TAPS = 4  # samples that a place between them is read from


def noise_floor(trace: Trace) -> float:
    """Return the noise of the compared force, percent of its variance, eq. (22).

    NaN where a segment has but a single cycle, and where the force does not vary.
    """
    variance = variance_of(trace.force[trace.compared])
    if not variance > 0.0:
        return math.nan
    # A log of a single cycle and no more is not called known by its spectrum alone.
    if len(trace.segments) == 1 and trace.n_cycles == 1:
        return math.nan
    noise = sum(segment.n_samples * segment.noise**2 for segment in trace.segments)
    return 100.0 * noise / trace.n_samples / variance


def with_noise(trace: Trace, left_out: FloatArray) -> Trace:
    """Return a trace with the noise of each segment, of some by what the filter has left out."""
    segments, design = [], trace.model_filter
    for segment in trace.segments:
        noise, source = math.sqrt(_scatter_between_cycles(trace, segment)), "scatter between cycles"
        if not math.isfinite(noise) and len(left_out):
            passed = float(np.sum(impulse_of(design, settling_samples(design) + 1) ** 2))
            noise = noise_of(left_out[segment.window]) * math.sqrt(passed)
            source = "above the filter"
        is_known = math.isfinite(noise) or len(left_out)
        noisy = replace(segment, noise=noise, noise_source=source)
        segments.append(noisy if is_known else segment)
    return replace(trace, segments=tuple(segments))


def _scatter_between_cycles(trace: Trace, segment: Segment) -> float:
    """The mean square of what the force differs by from cycle to cycle, N^2; NaN: not known."""
    if segment.n_cycles < 2:
        return math.nan
    starts = segment.cycle_starts
    n_phases = max(8, round(mean_of(np.diff(starts))))
    phases = np.arange(n_phases) / n_phases
    ahead, behind = segment.smeared
    phases = phases[(phases * n_phases >= ahead) & ((1.0 - phases) * n_phases > behind)]
    if len(phases) < _FEWEST_PHASES:
        return math.nan
    values, weights = _folded(trace.force, starts, phases)
    scatter = float(np.mean(np.var(values, axis=0, ddof=1)))
    answer = impulse_of(trace.model_filter, settling_samples(trace.model_filter) + _TAPS)
    sums = np.array([answer[: len(answer) - k] @ answer[k:] for k in range(_TAPS)])
    # Sums of the products of weights that stand 0, 1, 2, 3 samples apart.
    products = weights @ weights.T
    lags = np.array([(2.0 if k else 1.0) * np.trace(products, k) for k in range(_TAPS)])
    return float(scatter * weights.shape[1] / (lags @ (sums / sums[0])))


def _folded(
    signal: FloatArray, starts: FloatArray, phases: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return a signal at each phase of each cycle, (cycles, phases), and weights of samples."""
    at = (starts[:-1, None] + np.diff(starts)[:, None] * phases).ravel()
    first = np.clip(at, 1.0, len(signal) - 3.0).astype(np.int64) - 1
    u = at - first - 1.0
    less, more, most = u - 1.0, u + 1.0, u - 2.0
    weights = np.array(
        [-u * less * most / 6.0, more * less * most / 2.0, -more * u * most / 2.0,
         more * u * less / 6.0]
    )  # fmt: skip
    read = weights[0] * signal[first]
    for tap in range(1, _TAPS):
        read += weights[tap] * signal[first + tap]
    return read.reshape(len(starts) - 1, len(phases)), weights


# Whether a log looks as if the rig had filtered it.
#
# Sensor noise is about as strong just above the motion as near half the sample rate; a low-pass in
# the rig takes it away up there. Of steady cycles noise is what differs from cycle to cycle. The
# ratio of its two levels, as medians over the lines of the spectrum, is 0.1 to 9 in
# unfiltered logs, of real rigs too. A 30 or 60 Hz filter makes it 80 to 25 000 in the force and 4
# to 1700 in the displacement, by the last digit of the log; a running mean over 50 ms 50.
#
# Where nothing repeats, the noise is looked at in two bands far above the motion, the upper one
# twice as high, of which a low-pass leaves less: of the force at least 47 times, mostly a thousand
# times. Of a raw road or sweep the force has up to 5 times as much in the lower one (its friction
# jumps), the displacement 1.4 times; where speeds jump, or turn within 20 ms, the force up to 34.

_NEAR = (10.0, 25.0)  # Hz, below any low-pass that a damper rig uses
_BEYOND_MOTION = 3.0  # times its frequency
_FAR = (0.3, 0.45)  # of the sample rate
_LEAST_FAR = 60.0  # Hz
_FEWEST_LINES = 5
_LOUD = 20.0  # times the median power of half a cycle
_LOWER, _UPPER = (0.15, 0.2), (0.4, 0.45)  # of the sample rate
_MORE_DISPLACEMENT, _MORE_FORCE = 4.0, 40.0  # by how much the lower band has more
_FEWEST_OF_NOISE = 50  # lines of each band


def noise_ratio(
    signal: FloatArray,
    starts: FloatArray,
    interval: float,
    *,
    beyond: tuple[float, float] | None = None,
) -> float:
    """Return the noise just above the motion over that in a band far above; NaN: not known."""
    if len(starts) < 3:
        return math.nan
    unlike, begins, period = _unlike_cycles(signal, starts)
    # A half cycle that is far louder than most holds a blow, which is no noise.
    lengths = np.diff([*begins, len(unlike)])
    power = np.add.reduceat(unlike * unlike, begins) / lengths
    unlike[np.repeat(power > _LOUD * median(power), lengths)] = 0.0
    low = max(_NEAR[0], _BEYOND_MOTION / (period * interval))
    near = (low, low + _NEAR[1] - _NEAR[0])
    far = beyond or (max(_LEAST_FAR, _FAR[0] / interval), _FAR[1] / interval)
    if near[1] >= far[0]:
        return math.nan
    return _ratio_of_bands(unlike, interval, near, far, fewest=_FEWEST_LINES)


def _unlike_cycles(signal: FloatArray, starts: FloatArray) -> tuple[FloatArray, IntArray, float]:
    """Difference of a signal from one cycle to the next, its half cycles, and a cycle."""
    # What is another level or size of each half cycle is taken off: it is no noise.
    period = float(starts[-1] - starts[0]) / (len(starts) - 1)
    at = np.arange(math.ceil(starts[0]), math.floor(starts[-1] - period))
    unlike = np.interp(at + period, np.arange(len(signal)), signal) - signal[at]
    begins = np.arange(0, len(unlike), round(period / 2.0))
    lengths = np.diff([*begins, len(unlike)])

    def level(values: FloatArray) -> FloatArray:
        return np.repeat(np.add.reduceat(values, begins) / lengths, lengths)

    unlike -= level(unlike)
    form = signal[at] - level(signal[at])
    power = np.maximum(np.add.reduceat(form * form, begins), 1e-300)
    unlike -= np.repeat(np.add.reduceat(form * unlike, begins) / power, lengths) * form
    return unlike, begins, period


def falls_off(displacement: FloatArray, force: FloatArray, interval: float) -> bool:
    """Whether the noise of both channels falls off far above a motion that does not repeat."""
    if _LOWER[0] / interval < _LEAST_FAR:
        return False
    bands = [(low / interval, high / interval) for low, high in (_LOWER, _UPPER)]
    return all(
        _ratio_of_bands(signal, interval, *bands, fewest=_FEWEST_OF_NOISE) > more
        for signal, more in ((displacement, _MORE_DISPLACEMENT), (force, _MORE_FORCE))
    )


def _ratio_of_bands(
    signal: FloatArray,
    interval: float,
    below: tuple[float, float],
    above: tuple[float, float],
    *,
    fewest: int,
) -> float:
    """Return the level of a signal in one band over that in another, Hz; NaN where not known."""
    n = len(signal)
    length = n * interval
    lines = [_lines(*band, length, n) for band in (below, above)]
    if min(map(len, lines)) < fewest:
        return math.nan
    spectrum = np.fft.rfft((signal - mean_of(signal)) * _window(n))
    lower, upper = (median(np.abs(spectrum[some]) ** 2) for some in lines)
    return lower / upper if upper > 0.0 else math.nan


def _lines(above: float, below: float, length: float, n: int) -> IntArray:
    """Return the lines of the spectrum of a log between two frequencies."""
    some = np.arange(int(above * length), min(math.ceil(below * length), n // 2) + 1)
    return some[(some / length > above) & (some / length < below)]


@lru_cache(maxsize=2)
def _window(n: int) -> FloatArray:
    """Blackman's: logs of one rig are of one length, and its cosines cost more than a spectrum."""
    return np.blackman(n)


# A line of the spectrum that is no harmonic of the motion: hum of the mains, a pump, a loose
# fixture. What repeats cancels in the difference of one cycle to the next. The highest of a hundred
# lines of white noise is 8 times their median; a tone of 1 % of the force, 8 cycles of 300 lines
# and noise of 0.3 % is 400 times.
_TONE, _TONE_BESIDE = 60.0, 3
_FEWEST_OF_TONES = 20  # lines
_TONE_SEEN = 0.35  # of its size, at least, is in that difference


def tone(
    signal: FloatArray, starts: FloatArray, interval: float, corner: float
) -> tuple[float, float]:
    """Return frequency, Hz, and amplitude of a line off the harmonics; zeros for none."""
    unlike, _, period = _unlike_cycles(signal, starts)
    n = len(unlike)
    window = _window(n)
    spectrum = np.abs(np.fft.rfft((unlike - mean_of(unlike)) * window))
    lines = _lines(_BEYOND_MOTION / (period * interval), corner, n * interval, n)
    if len(lines) < _FEWEST_OF_TONES:
        return 0.0, 0.0
    peak = int(lines[np.argmax(spectrum[lines])])
    others = lines[np.abs(lines - peak) > _TONE_BESIDE]
    # Between two lines both have a part of it: the top of a parabola through three.
    below, at, above = np.log(np.maximum(spectrum[peak - 1 : peak + 2], 1e-300)).tolist()
    bend = below - 2.0 * at + above
    off = min(max(0.5 * (below - above) / bend, -0.5), 0.5) if bend < 0.0 else 0.0
    frequency = (peak + off) / (n * interval)
    seen = 2.0 * abs(math.sin(math.pi * frequency * period * interval))
    is_clear = spectrum[peak] ** 2 > _TONE * median(spectrum[others] ** 2)
    if not is_clear or seen < _TONE_SEEN:
        return 0.0, 0.0
    top = math.exp(at - 0.25 * (below - above) * off)
    return frequency, 2.0 * top / float(window.sum()) / seen
