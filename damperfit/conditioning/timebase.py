"""From a log's stamps to uniform samples; a log continued by its own cycles; a late force moved.

Three cases of stamps, tried in this order:

1. Every stamp is within its own rounding (or 1 % of an interval) of a straight line: the samples
   are uniform, and the line's slope is the interval. So are stamps rounded to 1 ms at 300 Hz.
2. The same after leaving room for a few missing samples: these are put in by a cubic spline.
3. The intervals really vary: a cubic spline through the stamps gives uniform samples.

A gap of more than 4 samples is refused in all of them.

A filter needs 0.23 s beyond each end of what is compared, and the model a cycle of run-in: of three
cycles at 10 Hz nothing would be left. Where a log begins or ends in the midst of a steady motion,
it is continued there by the nearest cycle, both channels alike, so that filter and model meet what
they would have met. Only what was logged is compared. The cycle's length is the one at which the
displacement repeats best, so that the seam is smooth. A motion that began with the log's first
sample has not repeated yet: as long as the force differs from the next cycle's by more than noise
it is run-in, and the log is continued behind it.
"""

import math
from typing import NamedTuple

import numpy as np

from damperfit.conditioning.signals import FloatArray, noise_of
from damperfit.errors import ConditioningError
from damperfit.problem import Problem, note, warning
from damperfit.recording import Recording
from damperfit.statistics import mean_of, median

_MAX_MISSING = 4  # consecutive samples; at 300 Hz, 17 ms, half a period of the 30 Hz corner
_JITTER = 0.01  # share of the interval; what the filter does not notice
_ROUNDED = 0.75  # of the rounding: half of it, and what a least-squares line may be off by itself
# Wrong stamps cost more of K_e than right ones of an uneven clock.
_ROUGHER = 1.5
_ROUND_RATE = 2e-4  # of a rate, by which a round one may be off
_MAX_FILLED = 0.05  # share of the log that may be put in before it is no measurement any more

_TRIES = 8
_NOISE = 6.0  # standard deviations of the difference of two cycles
_ALIKE = 0.02  # of the force's range; rigs repeat a peak to 1 %
_LONGEST = 0.5  # cycles; what differs for longer is no beginning
_MOST = 0.9  # of that
_GAP = 3  # samples


class UniformLog(NamedTuple):
    """Displacement and force on a uniform time base."""

    start_time: float  # s
    interval: float
    displacement: FloatArray  # shape (n,); m, N
    force: FloatArray
    findings: tuple[Problem, ...] = ()  # what the stamps were like and what had to be done
    logged_interval: float | None = None  # s; None: no samples were put in between


def make_uniform(recording: Recording) -> UniformLog:
    """Return the channels of a recording on a uniform time base; a gap is refused with its row."""
    elapsed = recording.time - recording.time[0]
    steps = np.diff(elapsed)
    rounding = _resolution(recording.time)
    offset, interval, off = _line(np.arange(len(elapsed), dtype=np.float64), elapsed)
    is_even = off <= _JITTER * interval
    is_rounded = off <= _JITTER * interval + _ROUNDED * rounding
    if is_rounded and not is_even:
        # At 1 kHz, stamps in whole ms with one row lost look like a slightly lower rate, rounded.
        # More missing rows than two are not spread evenly enough for that.
        counts = np.rint(steps / median(steps))
        _, own, rest = _line(np.concatenate([[0.0], np.cumsum(counts)]), elapsed)
        is_rounded = not (0 < int(counts.sum()) - len(counts) <= 2 and rest <= _JITTER * own)
    if is_even or is_rounded:
        start = float(recording.time[0]) + offset
        text = f"time stamps are rounded to {rounding:g} s; sampled at {1.0 / interval:.6g} Hz"
        findings = () if is_even else (note("rounded_time", text, value=rounding, unit="s"),)
        return UniformLog(start, interval, recording.displacement, recording.force, findings)

    from scipy.interpolate import CubicSpline

    typical = median(steps)
    # Rounded stamps make the median step up to half a rounding wrong: take the mean of its likes.
    typical = mean_of(steps[np.abs(steps - typical) <= 1.01 * rounding + 0.3 * typical])
    counts = np.maximum(np.rint(steps / typical), 1.0)
    widest = int(np.argmax(counts))
    if counts[widest] > _MAX_MISSING + 1:
        raise ConditioningError(
            f"gap of {steps[widest]:.4g} s after row {widest + 1} of the data "
            f"(time {recording.time[widest]:.6g} s); the samples are {typical:.4g} s apart and at "
            f"most {_MAX_MISSING} may be missing; split the log there or log without pauses",
            subject=recording.name,
            code="gap",
        )
    knots = np.concatenate([[0.0], np.cumsum(counts)])
    offset, interval, off = _line(knots, elapsed)
    is_regular = off <= _JITTER * interval + _ROUNDED * rounding
    if not is_regular:
        offset, interval = 0.0, float(elapsed[-1]) / len(steps)
        knots = elapsed / interval
    missing, n_expected = int(counts.sum()) - len(counts), int(counts.sum()) + 1
    first_missing = int(np.argmax(counts > 1))
    if is_regular and missing > _MAX_FILLED * n_expected:
        raise ConditioningError(
            f"{missing} of {n_expected} samples are missing, first after row {first_missing + 1} "
            f"of the data; expected at most {100.0 * _MAX_FILLED:.0f} %; check the logger",
            subject=recording.name,
            code="missing-samples",
        )
    grid = np.arange(round(float(knots[-1])) + 1, dtype=np.float64)
    channels = np.stack([recording.displacement, recording.force])
    displacement, force = np.ascontiguousarray(CubicSpline(knots, channels, axis=-1)(grid))
    if is_regular:
        text = (
            f"{missing} missing sample{'s' * (missing != 1)} put in by a cubic spline; "
            f"{1.0 / interval:.6g} Hz; the first after row {first_missing + 1} of the data (time "
            f"{recording.time[first_missing]:.6g} s)"
        )
        finding = note("missing_samples", text, value=float(missing))
    else:
        finding = _jitter(recording, steps / typical, displacement, 1.0 / interval)
    start = float(recording.time[0]) + offset
    return UniformLog(start, interval, displacement, force, (finding,))


def _jitter(
    recording: Recording, steps: FloatArray, displacement: FloatArray, rate: float
) -> Problem:
    """Say how the steps vary; a warning where the samples are smoother without their stamps."""
    worst = int(np.argmax(np.abs(steps - 1.0)))
    spread = 100.0 * abs(float(steps[worst]) - 1.0)
    text = (
        f"time steps vary by up to {spread:.0f} % (after row {worst + 1} of the data, time "
        f"{recording.time[worst]:.6g} s); resampled at {rate:.6g} Hz by a cubic spline"
    )
    by_stamp, by_count = (
        median(np.abs(np.diff(values, 3))) for values in (displacement, recording.displacement)
    )
    if by_stamp <= _ROUGHER * by_count:
        return note("jitter", text, value=spread, unit="%")
    short = float(f"{rate:.3g}")
    known = short if abs(short / rate - 1.0) < _ROUND_RATE else rate
    text += (
        f"; but the displacement is {by_stamp / max(by_count, 1e-300):.2g} times smoother without "
        "the stamps: they are those of the computer, not of the samples; declare "
        f"rig.sample_rate = '{known:.6g}Hz'"
    )
    return warning("jitter", text, value=spread, unit="%")


def _line(index: FloatArray, elapsed: FloatArray) -> tuple[float, float, float]:
    """Return intercept, slope and largest residual of the straight line through the stamps."""
    mean = float(index.mean())
    middle = index - mean
    slope = float(middle @ elapsed) / float(middle @ middle)
    offset = float(elapsed.mean()) - slope * mean
    offset *= abs(offset) > 1e-9 * slope  # a table is to begin at 0 s, not at -7e-15
    return offset, slope, float(np.abs(elapsed - offset - slope * index).max())


def _resolution(time: FloatArray) -> float:
    """The largest power of ten that all stamps are multiples of, s; 0 if below 1e-7 s."""
    elapsed = time - time[0]  # stamps that were converted or carry an offset keep it there
    blur = 4.0 * float(np.spacing(np.abs(time).max()))
    for exponent in range(0, -8, -1):
        unit = 10.0**exponent
        # Most candidates fail on the first few stamps.
        if blur < 0.01 * unit and all(
            np.abs(multiples - np.rint(multiples)).max() <= 0.01
            for multiples in (elapsed[:64] / unit, elapsed / unit)
        ):
            return unit
    return 0.0


def continue_log(
    log: UniformLog, begin: float | None, end: float | None, *, reach: int
) -> tuple[UniformLog, int, int]:
    """Return a log with its motion continued, and which samples of that were logged and repeat.

    `begin` and `end` are the samples in a cycle of the motion in which the log begins and ends. A
    cycle of run-in is put before the samples that the filter reaches.
    """
    from scipy.interpolate import CubicSpline

    n = len(log.force)
    first, before, behind = 0, 0, 0
    if begin is not None:
        begin = _length(log.displacement, begin)
        first = _settled(log.force, begin)
        before = reach + math.ceil(begin) + 1
    if end is not None:
        end = _length(log.displacement[::-1], end)
        behind = reach + 2
    at = np.arange(first - before, n + behind, dtype=np.float64)
    if begin is not None:
        ahead = first - at
        at = np.where(ahead > 0.0, at + begin * np.ceil(ahead / begin), at)
    if end is not None:
        beyond = at - (n - 1.0)
        at = np.where(beyond > 0.0, at - end * np.ceil(beyond / end), at)
    channels = np.stack([log.displacement, log.force])
    read = np.asarray(CubicSpline(np.arange(n), channels, axis=1)(at))
    whole = np.rint(at).astype(np.int64)
    is_sample = at == whole
    read[:, is_sample] = channels[:, whole[is_sample]]
    start = log.start_time + (first - before) * log.interval
    continued = log._replace(start_time=start, displacement=read[0], force=read[1])
    return continued, before, before + n - first


def _length(displacement: FloatArray, guess: float) -> float:
    """Return the samples after which the first cycle of a displacement repeats best."""
    from scipy.interpolate import CubicSpline

    n = min(math.ceil(guess), len(displacement) - math.ceil(1.05 * guess) - 1)
    if n < 8:
        return guess
    spline = CubicSpline(np.arange(len(displacement)), displacement)
    here, place = displacement[:n], np.arange(n)
    length = guess
    for _ in range(_TRIES):
        slope = spline(place + length, 1)
        step = float(slope @ (here - spline(place + length)) / (slope @ slope))
        length = float(np.clip(length + step, 0.95 * guess, 1.05 * guess))
    return length


def _settled(force: FloatArray, length: float) -> int:
    """Return the sample from which on the force repeats a cycle later."""
    n = min(round(_LONGEST * length), len(force) - math.ceil(length) - 2)
    if n < 8:
        return 0
    later = np.interp(np.arange(n) + length, np.arange(len(force)), force)
    allowed = max(_NOISE * math.sqrt(2.0) * noise_of(force), _ALIKE * float(np.ptp(force)))
    off = np.flatnonzero(np.abs(force[:n] - later) > allowed)
    if not len(off):
        return 0
    block = off[: int(np.argmax(np.append(np.diff(off), n) > _GAP)) + 1]
    # Where friction turns, a sample or two differ.
    is_beginning = off[0] <= _GAP < len(block) < _MOST * n
    return int(block[-1]) + 1 if is_beginning else 0


def without_delay(log: UniformLog, delay: float) -> UniformLog:
    """Return the log with the force moved so many seconds ahead; what has no partner is out."""
    from scipy.interpolate import CubicSpline

    samples = np.arange(len(log.force), dtype=np.float64)
    wanted = samples + delay / log.interval
    is_there = (wanted >= 0.0) & (wanted <= samples[-1])
    return log._replace(
        start_time=log.start_time + int(np.argmax(is_there)) * log.interval,
        displacement=log.displacement[is_there],
        force=np.ascontiguousarray(CubicSpline(samples, log.force)(wanted[is_there])),
    )
