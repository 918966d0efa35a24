r"""The displacement that drives the model: its sensor noise taken off, the motion left whole.

A damper answers the displacement as it was. The filter that force and displacement pass before
they are compared would take the corners off a triangle wave before a model that is not linear
sees them: at the true parameters a part of the force is then missed, and a wrong valley fits better
than the truth. So the drive has a filter of its own, with a corner that is
chosen from the log.

What the compared filter leaves out, ``r = x - F x``, is split by frequency into motion S and noise
N. Of steady cycles the lines of r at multiples of the frequency are motion, and what stands between
them is noise, whatever its colour; where nothing repeats, noise is as strong as near half the
sample rate. A line of the mains that stands alone is hum.
A filter of gain H then errs in the velocity by::

    E = sum over f of (2 pi f)^2 (S (1 - H)^2 + N H^2)

and the corner with the least E is taken. It is never below that of the compared filter, and stays
there where that filter takes less than 0.3 % off the velocity: on a sine both are the same.

Each stretch has its own corner. Beside a break of the motion, where one speed goes over to another,
the drive is wider: a jump of the velocity must not be smeared into what is compared.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from damperfit.conditioning.channels import noise_of
from damperfit.conditioning.derivatives import differentiate
from damperfit.conditioning.filters import apply_filter, design_filter, fading_samples
from damperfit.conditioning.rests import rests_of
from damperfit.recording import Drive
from damperfit.statistics import mean_of, median, variance_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from damperfit.conditioning.options import ConditionOptions
    from damperfit.conditioning.stretches import FoundStretch
    from damperfit.conditioning.timebase import UniformLog
    from damperfit.recording import Stretch

    FloatArray = NDArray[np.float64]

__all__ = ["content_beyond", "make_drive", "unclear_turns"]

# Velocity that the compared filter may take away, over all of it. A sine loses less, a triangle of
# 0.2 m/s and +-32 mm an eighth (`tests/test_told_figures.py`).
_LOST = 3e-3
_STEP = 0.5  # octaves between the corners tried
# Of the sample rate. Above, the spline rings at a sharp corner that falls between two samples: at
# the true parameters a triangle at 1 kHz then misses more than behind 350 Hz.
_HIGHEST = 0.35
_TOP = (0.3, 0.45)  # of the sample rate, where a motion has nothing
_NOISE_BETWEEN = 0.005
_UNCLEAR = 4.0  # times the noise of the speed; a sample at so little has friction of either sign
_ON_SAMPLES = 0.004  # of the samples: 1 % cost 2 % of the friction and of R_m3
_HALF = math.log(2.0)  # median over mean of the power of noise
_LINES = 8.0  # that tell the noise of an order, near enough
_CLEAR = 8.0  # a line of pure noise is so much above its mean once in 3000


# Hz; hum and what rectifiers make of it. A line there is hum where it has so many times the power
# of all that lies beside it: the orders of a motion have neighbours of their own size.
_MAINS = (50.0, 60.0)
_MULTIPLES = 6
_ALONE = 10.0
# Lines of one record: how far the taper lets one reach, and how far is looked.
_BESIDE = (4, 12)


class _Spectrum(NamedTuple):
    """Power of velocity by frequency, m2/s2 a line: the motion's, and the noise's."""

    frequency: FloatArray
    motion: FloatArray
    noise: FloatArray


def make_drive(
    log: UniformLog,
    filtered: FloatArray,
    velocity: FloatArray,
    found: Sequence[FoundStretch],
    options: ConditionOptions,
) -> Drive:
    """Return the displacement and velocity that drive the model.

    Parameters
    ----------
    log : UniformLog
        As logged, in the project's signs.
    filtered : numpy.ndarray
        Its displacement behind the compared filter, shape (n,), m.
    velocity : numpy.ndarray
        Of that, m/s.
    found : sequence of FoundStretch
        What is compared, in samples of the log.
    options : ConditionOptions
        Filter and rig facts. What the rig has filtered cannot be had back: it drives as it is.
    """
    if options.rig_filter != "none" or options.filter == "none":
        return Drive(filtered, velocity, math.inf)
    drive = _least_in_error(log, filtered, velocity, found, options)
    return _at_rest(drive, log, [one.stretch for one in found])


def _at_rest(drive: Drive, log: UniformLog, stretches: Sequence[Stretch]) -> Drive:
    """Return the drive without noise where the compared motion rests."""
    rests = [
        (part, level)
        for part, level in rests_of(log.displacement, log.interval)
        if any(one.first < part.stop and part.start < one.stop for one in stretches)
    ]
    if not rests:
        return drive
    x, v = drive.displacement.copy(), drive.velocity.copy()
    for part, level in rests:
        x[part], v[part] = level, 0.0
    return Drive(x, v, drive.corner)


def _least_in_error(
    log: UniformLog,
    filtered: FloatArray,
    velocity: FloatArray,
    found: Sequence[FoundStretch],
    options: ConditionOptions,
) -> Drive:
    rest = log.displacement - filtered
    corners = [
        _corner(rest, velocity, one.stretch, options, interval=log.interval) for one in found
    ]
    lowest = options.filter_corner
    is_whole = all(math.isinf(one.begin) and math.isinf(one.end) for one in found)
    if is_whole and max(corners) <= lowest:
        return Drive(filtered, velocity, lowest)
    wide = max(corners) if is_whole else _between(log, velocity, options)
    x, v = _passed(log, max(wide, lowest), options)
    passed = {lowest: (filtered, velocity)}
    for one, corner in zip(found, corners, strict=True):
        if corner not in passed:
            passed[corner] = _passed(log, corner, options)
        inside = _inside(one, len(x), options, interval=log.interval)
        x[inside], v[inside] = (channel[inside] for channel in passed[corner])
    return Drive(x, v, max(corners))


def _inside(one: FoundStretch, n: int, options: ConditionOptions, *, interval: float) -> slice:
    """Return where a stretch is far enough from what went before and comes behind."""
    design = design_filter(
        "zero_phase", options.filter_corner, sample_rate=1.0 / interval, order=options.filter_order
    )
    reach = fading_samples(design)
    first = max(0, math.ceil(one.begin) + reach) if math.isfinite(one.begin) else 0
    stop = math.floor(one.end) - reach if math.isfinite(one.end) else n
    return slice(first, max(first, stop))


def _between(log: UniformLog, velocity: FloatArray, options: ConditionOptions) -> float:
    """Return the corner where one motion goes over to another, Hz.

    A change of speed must reach the model as it was, and what noise does there is soon forgotten:
    the highest corner at which the noise of the velocity is half a per cent of the fastest speed.
    """
    noise = noise_of(log.displacement)
    rate = 1.0 / log.interval
    allowed = _NOISE_BETWEEN * float(np.abs(velocity).max())
    density = 2.0 * noise**2 / rate
    corner = (3.0 * allowed**2 / max(density * 4.0 * math.pi**2, 1e-300)) ** (1.0 / 3.0)
    return float(max(min(corner, _HIGHEST * rate), options.filter_corner))


def _passed(
    log: UniformLog, corner: float, options: ConditionOptions
) -> tuple[FloatArray, FloatArray]:
    """Return displacement and velocity behind a filter of this corner."""
    design = design_filter(
        "zero_phase", corner, sample_rate=1.0 / log.interval, order=options.filter_order
    )
    displacement = apply_filter(design, log.displacement)
    return displacement, differentiate(displacement, log.interval)


def _corner(
    rest: FloatArray,
    velocity: FloatArray,
    stretch: Stretch,
    options: ConditionOptions,
    *,
    interval: float,
) -> float:
    """Return the corner of the drive that errs least over a stretch, Hz; infinite: no filter."""
    seen = _seen(rest, stretch, interval)
    lowest = options.filter_corner
    lost = float(np.sum(seen.motion))
    if not lost > _LOST**2 * variance_of(velocity[stretch.window]):
        return lowest
    rate = 1.0 / interval
    highest = max(_HIGHEST * rate, lowest)
    tried = np.geomspace(lowest, highest, math.ceil(math.log2(highest / lowest) / _STEP) + 1)
    errors = _errors(seen, tried, rate, options.filter_order)
    return float(tried[int(np.argmin(errors))])


def _errors(seen: _Spectrum, corners: FloatArray, rate: float, order: int) -> list[float]:
    """Mean square error of the velocity behind filters of these corners, m2/s2."""
    warped = np.tan(np.pi * np.minimum(seen.frequency, 0.499 * rate) / rate) ** (2 * order)
    errors = []
    for bar in (np.tan(np.pi * corners / rate) ** (2 * order) / (math.sqrt(2.0) - 1.0)).tolist():
        gain = 1.0 / (1.0 + warped / bar)
        errors.append(float(seen.motion @ (1.0 - gain) ** 2 + seen.noise @ gain**2))
    return errors


def _seen(rest: FloatArray, stretch: Stretch, interval: float) -> _Spectrum:
    """Split what the compared filter leaves out of a stretch into motion and noise."""
    if stretch.n_cycles >= 2:
        return _of_cycles(rest, stretch)
    return _of_motion(rest[stretch.window], interval)


def _of_cycles(rest: FloatArray, stretch: Stretch) -> _Spectrum:
    """Lines at multiples of the frequency are motion, as far as they stand out of the others."""
    starts, n_cycles = stretch.cycle_starts, stretch.n_cycles
    a_cycle = max(8, round(mean_of(np.diff(starts))))
    steps = np.arange(a_cycle) / a_cycle
    positions = (starts[:-1, None] + np.diff(starts)[:, None] * steps).ravel()
    even = np.interp(positions, np.arange(len(rest)), rest)
    lines = np.fft.rfft(even)
    power = (2.0 / len(even) ** 2) * (lines.real**2 + lines.imag**2)
    frequency = np.arange(len(power)) * stretch.frequency / n_cycles
    n_orders = (len(power) - 1) // n_cycles
    # Row k: the line at k times the frequency, then those up to the next one.
    table = power[: n_orders * n_cycles].reshape(n_orders, n_cycles)
    between = _between_orders(table[:, 1:])
    motion = np.zeros(len(power))
    # A line of noise is exponential: above its mean by half of its own size on average.
    motion[: n_orders * n_cycles : n_cycles] = np.maximum(table[:, 0] - between, 0.0)
    motion[: n_orders * n_cycles : n_cycles] *= table[:, 0] > _CLEAR * between
    for order in _hum(stretch.frequency, n_orders):
        beside = [k for k in range(order - 2, order + 3) if k != order and 0 < k < n_orders]
        if table[order, 0] > _ALONE * max((table[k, 0] for k in beside), default=math.inf):
            motion[order * n_cycles] = 0.0
    noise = np.repeat(between, n_cycles)
    noise = np.concatenate([noise, np.full(len(power) - len(noise), noise[-1])])
    speed = (2.0 * np.pi * frequency) ** 2
    return _Spectrum(frequency, speed * motion, speed * noise)


def _between_orders(lines: FloatArray) -> FloatArray:
    """Return the noise by order, (orders,): where few lines tell it, those of its neighbours too.

    Two cycles have one line between: a ninth of pure noise would stand out of that.
    """
    means = lines.mean(axis=1)
    n_orders, n_lines = lines.shape
    reach = math.ceil(0.5 * (_LINES / n_lines - 1.0))
    if reach < 1:
        return np.asarray(means)
    sums = np.concatenate([[0.0], np.cumsum(means)])
    low = np.maximum(np.arange(n_orders) - reach, 0)
    high = np.minimum(np.arange(n_orders) + reach + 1, n_orders)
    return np.asarray((sums[high] - sums[low]) / (high - low))


def _of_motion(rest: FloatArray, interval: float) -> _Spectrum:
    """Noise is white: as strong everywhere as near half the sample rate."""
    taper = np.hanning(len(rest) + 2)[1:-1]
    power = 2.0 * np.abs(np.fft.rfft(rest * taper)) ** 2 / (len(rest) * float(taper @ taper))
    frequency = np.fft.rfftfreq(len(rest), interval)
    top = (frequency > _TOP[0] / interval) & (frequency < _TOP[1] / interval)
    level = median(power[top]) / _HALF if top.any() else 0.0
    # In bands, so that single lines of noise do not pass for motion.
    width = max(1, len(power) // 100)
    edges = np.arange(0, len(power), width)
    widths = np.diff([*edges, len(power)])
    means = np.add.reduceat(_without_hum(power, frequency), edges) / widths
    excess = np.maximum(means - level * (1.0 + 3.0 / math.sqrt(width)), 0.0)
    motion: FloatArray = np.repeat(excess, widths).astype(np.float64)
    speed = (2.0 * np.pi * frequency) ** 2
    return _Spectrum(
        np.asarray(frequency, np.float64),
        np.asarray(speed * motion),
        np.asarray(speed * np.full(len(power), level)),
    )


def _hum(spacing: float, n_lines: int) -> list[int]:
    """Return the places of the mains and its multiples among lines that lie so far apart, Hz."""
    places = (round(k * one / spacing) for one in _MAINS for k in range(1, _MULTIPLES + 1))
    return sorted({place for place in places if 0 < place < n_lines})


def _without_hum(power: NDArray[Any], frequency: NDArray[Any]) -> NDArray[Any]:
    """Return the power of a record with what lies beside them in place of lines of the mains."""
    kept = power.copy()
    wide, far = _BESIDE
    for place in _hum(float(frequency[1]), len(power) - far):
        line = slice(max(place - wide, 0), place + wide + 1)
        beside = [*power[max(place - far, 0) : line.start], *power[line.stop : place + far + 1]]
        if power[line].max() > _ALONE * max(beside):
            kept[line] = np.mean(beside)
    return kept


def unclear_turns(drive: Drive, log: UniformLog, stretches: Sequence[Stretch]) -> list[int]:
    """Return the samples at which noise decides which way friction acts, where they are many.

    A sine of 200 samples a cycle that turns at one of them turns at all of them: its friction is
    then too small by as much as they are. Where samples fall elsewhere in each cycle there are few.

    Parameters
    ----------
    drive : Drive
        The displacement behind the compared filter.
    log : UniformLog
        As logged.
    stretches : sequence of Stretch
        What is compared, in samples of the log.
    """
    noise = noise_of(log.displacement) * math.sqrt(2.0 * drive.corner * log.interval)
    noise *= 2.0 * math.pi * drive.corner / math.sqrt(3.0)
    unclear = np.abs(drive.velocity) <= _UNCLEAR * noise
    # Of a slow turn several in a row are: there the noise is not what decides.
    alone = np.zeros(len(unclear), dtype=np.bool_)
    alone[1:-1] = unclear[1:-1] & ~unclear[:-2] & ~unclear[2:]
    n = sum(int(np.count_nonzero(alone[one.window])) for one in stretches)
    if n < _ON_SAMPLES * sum(one.n_samples for one in stretches):
        return []
    return [int(one) for one in np.flatnonzero(alone)]


def content_beyond(displacement: FloatArray, interval: float, corner: float) -> float:
    """Return the share of the velocity's deviation that lies above a frequency."""
    velocity = np.diff(displacement) / interval
    velocity = velocity - mean_of(velocity)
    power = np.abs(np.fft.rfft(velocity * np.hanning(len(velocity) + 2)[1:-1])) ** 2
    frequency = np.fft.rfftfreq(len(velocity), interval)
    return math.sqrt(float(np.sum(power[frequency > corner])) / max(float(np.sum(power)), 1e-300))
