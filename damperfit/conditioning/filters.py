"""Butterworth low-pass filters, the derivative, and which filter stands where.

A Butterworth filter of order N designed for the corner fc by the bilinear transform has, with
``w(f) = tan(pi f / fs)``, the gain ``|H(f)|^2 = 1 / (1 + (w(f)/w(fc))^(2N))``.

- *causal*: one pass. -3 dB at the corner. With N = 4, fc = 30 Hz, fs = 500 Hz a 1.5 Hz sine comes
  13.704 ms late (-7.40 degrees).
- *zero_phase*: one pass forward, one backward. The phase is exactly zero, the gain |H|^2: that of
  twice the order. The two passes are designed for a higher corner fd, so that both together have
  -3 dB at fc: ``w(fd) = w(fc) / (sqrt(2) - 1)^(1/(2N))``, 33.4 Hz for 30 Hz, N = 4.
- *completed*: the forward-backward pair of a filter designed as causal: -6 dB at fc. That is what a
  rig's ordinary forward-backward filter does, and what a causal filter becomes when its
  time-reversed pass follows.

Before each forward-backward run both ends are continued by odd reflection (2 s[0] - s[k]), and each
pass starts in the steady state of its first value. What an edge does to the signal dies out with
the slowest pole; `settling_samples` says when it is gone.

The compiled core runs them: same numbers as SciPy's `sosfilt` and `sosfiltfilt` in less time, and
importing `scipy.signal` takes 0.7 s.
"""

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from damperfit.compiled_core import compiled_core
from damperfit.conditioning.cycles import fastest_frequency
from damperfit.conditioning.options import ConditionOptions
from damperfit.conditioning.signals import FloatArray
from damperfit.conditioning.timebase import UniformLog, make_uniform
from damperfit.errors import ConditioningError, ConfigurationError
from damperfit.problem import Problem, note
from damperfit.recording import FilterDesign, Recording

# An edge left over at 1e-8 of the force moves no parameter by more than 1e-6.
_SETTLED = 1e-8
# Reflected samples ahead of an edge; the start of a pass is forgotten to this share behind them.
_FADED = 1e-3
# How often a signal is run through, as the compiled core has it.
_FORWARD, _BOTH = 1, 0
_SLOW = 20.0  # samples a second; of fewer the unit of time is in doubt


def design_filter(
    kind: str,
    corner: float,
    *,
    sample_rate: float,
    order: int = 4,
    key: str = "conditioning.filter_corner",
) -> FilterDesign:
    """Return a Butterworth low-pass of the kind "zero_phase", "causal" or "none".

    "zero_phase": forward and backward, combined gain -3 dB at the corner, Hz. "causal": forward
    only, -3 dB at the corner. "none": passes everything. The order is that of one pass, the sample
    rate in Hz; `key` is what the corner is called where a user says it. A ConfigurationError: an
    unknown kind; a ConditioningError: the corner is not below half the sample rate.

    >>> design_filter("zero_phase", 30.0, sample_rate=1000.0).description
    'zero-phase Butterworth low-pass, order 4 forward and backward, -3 dB at 30 Hz'
    """
    if kind not in ("zero_phase", "causal", "none"):
        expected = "zero_phase, causal or none"
        raise ConfigurationError(f"filter: expected {expected}, found {kind!r}", code="wrong-value")
    if kind == "none":
        return FilterDesign(np.empty((0, 6)), is_zero_phase=True, description="no filter")
    if not corner < sample_rate / 2.0:
        of_time = "if the time is in another unit, declare rig.units.time; else "
        raise ConditioningError(
            f"the filter corner of {corner:g} Hz is not below half the sample rate "
            f"({sample_rate / 2.0:.4g} Hz at {sample_rate:.4g} samples per second); "
            f"{of_time * (sample_rate < _SLOW)}sample faster, "
            f"set {key} = '{float(f'{0.4 * sample_rate:.2g}'):g}Hz', which fits, or choose the "
            "filter 'none'",
            code="corner-too-high",
        )
    if kind == "causal":
        text = f"causal Butterworth low-pass, order {order}, -3 dB at {corner:g} Hz"
        return FilterDesign(np.array(_sections(order, corner, sample_rate)), False, text)
    warped = math.tan(math.pi * corner / sample_rate) / (math.sqrt(2.0) - 1.0) ** (0.5 / order)
    shifted = math.atan(warped) * sample_rate / math.pi
    text = (
        f"zero-phase Butterworth low-pass, order {order} forward and backward, "
        f"-3 dB at {corner:g} Hz"
    )
    return FilterDesign(np.array(_sections(order, shifted, sample_rate)), True, text)


@lru_cache(maxsize=64)
def _sections(order: int, corner: float, sample_rate: float) -> tuple[tuple[float, ...], ...]:
    """Pairs of poles by rising resonance, the whole gain in the first section."""
    # s/w = (z - 1)/(z + 1)/tan(pi fc/fs) takes 1/(s^2 + 2 c s + 1), and 1/(s + 1) of an odd order,
    # to the sections below.
    w = math.tan(math.pi * corner / sample_rate)
    rows, gain = [], 1.0
    if order % 2:
        rows.append((1.0, 1.0, 0.0, 1.0, (w - 1.0) / (w + 1.0), 0.0))
        gain *= w / (w + 1.0)
    for k in range(order // 2 - 1, -1, -1):
        damping = 2.0 * math.sin(math.pi * (2 * k + 1) / (2 * order))
        whole = 1.0 + damping * w + w * w
        rows.append(
            (1.0, 2.0, 1.0, 1.0, 2.0 * (w * w - 1.0) / whole, (1.0 - damping * w + w * w) / whole)
        )
        gain *= w * w / whole
    first = rows[0]
    return ((*(gain * b for b in first[:3]), *first[3:]), *rows[1:])


def completed(design: FilterDesign, corner: float, order: int) -> FilterDesign:
    """Return the forward-backward pair of a causal design: zero phase, -6 dB at its corner."""
    text = (
        f"zero-phase Butterworth low-pass, order {order} forward and backward, "
        f"-6 dB at {corner:g} Hz (each pass -3 dB)"
    )
    return FilterDesign(design.sections, True, text)


def apply_filter(design: FilterDesign, signal: FloatArray) -> FloatArray:
    """Return a signal behind a filter along its last axis, two samples or more: new memory."""
    if not len(design.sections):
        return np.array(signal, dtype=np.float64)
    moved = np.asarray(signal, dtype=np.float64)
    if design.bridged:
        at = np.array(design.bridged)
        moved = moved.copy()
        moved[..., at] = 0.5 * (moved[..., at - 1] + moved[..., at + 1])
    if design.is_zero_phase:
        return _run(design, moved, pad=min(fading_samples(design), moved.shape[-1] - 1))
    return _run(design, moved)


def complete_causal(design: FilterDesign, signal: FloatArray) -> FloatArray:
    """Return a causally filtered signal behind the time-reversed pass: both have zero phase."""
    n = signal.shape[-1]
    pad = min(fading_samples(design), n - 1)
    behind = 2.0 * signal[..., -1:] - signal[..., -2 : -pad - 2 : -1]
    backward = _run(design, np.concatenate([signal, behind], axis=-1)[..., ::-1])
    return backward[..., ::-1][..., :n].copy()


def _run(design: FilterDesign, signal: FloatArray, *, pad: int | None = None) -> FloatArray:
    """Run forward; with a pad forward and backward, both ends continued by odd reflection."""
    rows = np.ascontiguousarray(signal, dtype=np.float64)
    n, more = rows.shape[-1], pad or 0
    result = np.empty_like(rows)
    steady = _constants(design.sections.tobytes())[0]
    compiled_core().run_filter(
        np.ascontiguousarray(design.sections), steady, rows, result, np.empty(n + 2 * more),
        rows.size // n, more, _FORWARD if pad is None else _BOTH,
    )  # fmt: skip
    return result


def settling_samples(design: FilterDesign) -> int:
    """Return after how many samples an edge is forgotten to 1e-8, from the slowest pole."""
    return _constants(design.sections.tobytes())[1]


def fading_samples(design: FilterDesign) -> int:
    """Return after how many samples an edge is forgotten to 1e-3, from the slowest pole."""
    return _constants(design.sections.tobytes())[2]


@lru_cache(maxsize=64)
def _constants(sections: bytes) -> tuple[FloatArray, int, int]:
    """Return the state of each section for a constant 1, (k, 2), and samples to 1e-8 and 1e-3."""
    table = np.frombuffer(sections).reshape(-1, 6)
    if not len(table):
        return np.empty((0, 2)), 0, 0
    slowest = max(float(np.abs(np.roots(row[3:])).max()) for row in table)
    settled, faded = (
        math.ceil(math.log(level) / math.log(slowest)) for level in (_SETTLED, _FADED)
    )
    states, level = [], 1.0
    for b0, b1, b2, _, a1, a2 in table.tolist():
        gain = (b0 + b1 + b2) / (1.0 + a1 + a2)
        late = b2 - a2 * gain
        states.append((level * (b1 - a1 * gain + late), level * late))
        level *= gain
    return np.array(states), settled, faded


def passed_at(design: FilterDesign, turns: FloatArray) -> NDArray[np.complex128]:
    """Return what passes of sines of so many turns a sample, (n,), both passes counted."""
    z = np.exp(-2j * np.pi * turns)
    powers = np.array([np.ones_like(z), z, z * z])
    over, under = np.split(design.sections, 2, axis=1)
    one_pass = np.multiply.reduce(over @ powers) / np.multiply.reduce(under @ powers)
    return np.asarray(np.abs(one_pass) ** 2 + 0j if design.is_zero_phase else one_pass)


def gain_at(design: FilterDesign, frequency: float, sample_rate: float) -> float:
    """Return the share of the amplitude of a sine that passes, both passes counted."""
    return float(np.abs(passed_at(design, np.array([frequency / sample_rate])))[0])


def impulse_of(design: FilterDesign, reach: int) -> FloatArray:
    """Return what a filter makes of an impulse in the middle of 2 reach + 1 samples."""
    return _impulse(design.sections.tobytes(), design.is_zero_phase, reach)


@lru_cache(maxsize=64)
def _impulse(sections: bytes, is_zero_phase: bool, reach: int) -> FloatArray:  # noqa: FBT001
    impulse = np.zeros(2 * reach + 1)
    impulse[reach] = 1.0
    design = FilterDesign(np.frombuffer(sections).reshape(-1, 6), is_zero_phase, "")
    return apply_filter(design, impulse)


def corner_of(design: FilterDesign, *, sample_rate: float) -> float:
    """Return where a sine's power is halved, both passes counted, Hz; infinite where nothing is."""
    turns = np.geomspace(1e-4, 0.5, 200)
    falls = np.flatnonzero(np.abs(passed_at(design, turns)) < math.sqrt(0.5))
    return float(sample_rate * turns[falls[0]]) if len(falls) else math.inf


# Velocity: the derivative of the cubic spline through the displacement samples, with not-a-knot
# ends, exact up to third degree. Inside, on a uniform grid of interval h, it differentiates a sine
# of angular frequency w with the gain (phase: none)::
#
#     G(w) = 3 sin(w h) / (w h (2 + cos(w h))) = 1 - (w h)^4/180 - ...
#
# At 1 kHz that is 1 - 4.4e-11 at 1.5 Hz and 1 - 8.7e-8 at 10 Hz; at 100 Hz, 1 - 4.4e-7 and
# 1 - 9.1e-4. White noise of s (rms, m) in the samples becomes 1.180 s/h (rms, m/s); behind the
# 30 Hz filter at 1 kHz, where that of the displacement has fallen to 0.245 s, 28.0 s. The C core
# takes x and v as cubic Hermite pieces, which are then this spline.


def differentiate(displacement: FloatArray, interval: float) -> FloatArray:
    """Return the slope of the not-a-knot cubic spline through uniform samples, m/s.

    Displacement, m, of shape (n,), n >= 4; the interval in s.

    >>> t = np.arange(6) * 0.5
    >>> np.allclose(differentiate(t**3, 0.5), 3 * t**2)
    True
    """
    samples = np.ascontiguousarray(displacement, dtype=np.float64)
    slopes = np.empty(len(samples))
    compiled_core().spline_slopes(samples, slopes, np.empty(len(samples)))
    slopes /= interval
    return slopes


# Which filter stands where (C is one causal pass, C* the same pass run backward in time, Z the
# zero-phase filter; x and f are what the rig's sensors saw)::
#
#     rig_filter   filter       displacement of the trace   force of the trace   model_filter
#     none         none         x                           f                    -
#     none         zero_phase   Z x                         Z f                  Z
#     none         causal       C* C x                      C* C f               C* C
#     zero_phase   (not used)   as logged, C* C x           as logged, C* C f    C* C
#     causal       (not used)   C* (logged)  = C* C x       C* (logged)          C* C
#     analogue     (not used)   the same, of a log with samples put in between
#
# One displacement cannot be both late (beside the late force) and in time (for the model, which
# would be delayed again). So a causal pass, the rig's or ours, is completed by its backward pass:
# both channels come back in time, and the model's force passes the completed filter.
#
# C is the bilinear design at the log's rate, as of a rig that filters what it has sampled. A filter
# that is analogue, or digital at a much higher rate, is 3 degrees off it at half a corner of 60 Hz
# and 500 Hz, and it has met the jumps of friction where they are, not at the next sample: 4 N rms
# at 10 Hz. Behind it nothing is left above half the log's rate, so that the log's own Fourier
# series says what lies between its samples; at this many in a period of the corner both are right.
_ANALOGUE = 32.0


_SPLINE_EDGE = 14  # samples; 0.268^14 = 1e-8, how an end condition fades in a cubic spline


class FilteredLog(NamedTuple):
    """A log and what is seen of it behind the filter: m, N, m/s."""

    log: UniformLog
    displacement: FloatArray
    force: FloatArray
    velocity: FloatArray
    model_filter: FilterDesign

    @property
    def fading(self) -> int:
        """Samples after which a break of the motion is forgotten to 1e-3."""
        return max(fading_samples(self.model_filter), _SPLINE_EDGE)

    @property
    def edge(self) -> int:
        """Samples after which an end of the log is forgotten to 1e-8."""
        return max(settling_samples(self.model_filter), _SPLINE_EDGE)


def passed_filter(options: ConditionOptions, sample_rate: float) -> FilterDesign:
    """Return what both channels have passed in the end, and a model's force must (table above)."""
    is_rig = options.rig_filter != "none"
    kind, corner = "causal" if is_rig else options.filter, options.declared_corner
    order = options.rig_filter_order if is_rig else options.filter_order
    key = f"{'rig' if is_rig else 'conditioning'}.filter_corner"
    design = design_filter(kind, corner, sample_rate=sample_rate, order=order, key=key)
    return completed(design, corner, order) if kind == "causal" else design


def with_samples_between(log: UniformLog, options: ConditionOptions) -> UniformLog:
    """Return a log behind an analogue filter at a rate at which the bilinear design is that."""
    corner = options.declared_corner
    is_seen = options.rig_filter == "analogue" and 2.0 * corner * log.interval < 1.0
    times = math.ceil(_ANALOGUE * corner * log.interval) if is_seen else 1
    if times == 1:
        return log
    rows = np.stack([log.displacement, log.force])
    n, ends = rows.shape[1], (rows[:, 0], rows[:, -1])
    # Less the line through its ends, and continued by odd reflection, it is periodic and smooth.
    bent = rows - np.linspace(*ends, n, axis=1)
    lines = np.fft.rfft(np.concatenate([bent, -bent[:, -2:0:-1]], axis=1))
    n = times * (n - 1) + 1
    finer = times * np.fft.irfft(lines, 2 * (n - 1))[:, :n] + np.linspace(*ends, n, axis=1)
    channels = dict(zip(("displacement", "force"), finer, strict=True))
    return log._replace(interval=log.interval / times, logged_interval=log.interval, **channels)


def behind_filter(log: UniformLog, options: ConditionOptions) -> FilteredLog:
    """Return both channels behind the filter, and the filter for the model."""
    design = passed_filter(options, 1.0 / log.interval)
    once = design._replace(is_zero_phase=False)
    channels = np.stack([log.displacement, log.force])
    is_ours = options.rig_filter == "none"
    is_causal = options.filter == "causal" if is_ours else options.rig_filter != "zero_phase"
    if is_ours:
        channels = apply_filter(once if is_causal else design, channels)
    if is_causal:
        channels = complete_causal(once, channels)
    displacement, force = channels
    return FilteredLog(log, displacement, force, differentiate(displacement, log.interval), design)


# The corner that fits the fastest motion of a log. The paper filters at 30 Hz a test of 1.5 Hz:
# twenty harmonics pass, enough for the knee of a valve and the jump of friction; at 10 Hz three
# would. The corner that follows the motion keeps the twenty; it is not below 30 Hz, which suits all
# slower tests, and not above 0.4 of the sample rate, where a filter has nothing left to do.

_HARMONICS = 20.0
_LEAST = 30.0  # Hz
_HIGHEST = 0.4  # of the sample rate


def fitting_corner(frequency: float, sample_rate: float) -> float:
    """Return the corner that fits a motion of a frequency, Hz, to two digits."""
    corner = min(max(_HARMONICS * frequency, _LEAST), _HIGHEST * sample_rate)
    return float(f"{corner:.2g}")


def with_corner(
    recording: Recording, options: ConditionOptions
) -> tuple[ConditionOptions, tuple[Problem, ...]]:
    """Return the options with the corner that fits a log, where it is to be found, and a note."""
    if not options.auto_corner or not options.is_ours:
        return options, ()
    log = make_uniform(recording)
    frequency = fastest_frequency(log.displacement, options.steadiness) / log.interval
    corner = fitting_corner(frequency, 1.0 / log.interval)
    text = f"filter corner {corner:g} Hz, to fit the fastest motion of {frequency:.3g} Hz"
    finding = note("filter_corner", text, value=corner, unit="Hz")
    return options.but(filter_corner=corner, auto_corner=False), (finding,)
