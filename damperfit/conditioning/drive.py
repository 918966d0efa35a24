"""The displacement that drives the model: its sensor noise taken off, the motion left whole.

A damper answers the displacement as it was. The filter that force and displacement pass before
they are compared takes corners off a triangle wave: a model that is not linear, driven by that,
misses a part of the force at the true parameters, and a wrong local minimum fits better. So the
drive has a filter of its own, with a corner that is chosen from the log.

What the compared filter leaves out, ``r = x - F x``, is split by frequency into motion S and noise
N. Of steady cycles the lines of r at multiples of the frequency are motion, and what stands between
them is noise, whatever its colour; where nothing repeats, noise is as strong as near half the
sample rate. A line of the mains that stands alone is hum. The corner is taken whose filter of gain
H errs least in the velocity, by::

    E = sum over f of (2 pi f)^2 (S (1 - H)^2 + N H^2)

It is never below that of the compared filter, and stays there where that takes less than 0.3 % off
the velocity: on a sine both are the same. Each segment has its own corner. Beside a break of the
motion, where one speed goes over to another, the drive is wider: a jump of the velocity must not be
smeared into what is compared.
"""

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from damperfit.conditioning.cycles import FoundSegment
from damperfit.conditioning.filters import (
    FilteredLog,
    apply_filter,
    design_filter,
    differentiate,
    fading_samples,
)
from damperfit.conditioning.options import ConditionOptions
from damperfit.conditioning.signals import FloatArray, IntArray, noise_of, parts_where
from damperfit.conditioning.timebase import UniformLog
from damperfit.recording import Drive, FilterDesign, Segment
from damperfit.statistics import mean_of, median, variance_of

# Where a motion rests: a dwell between strokes, in which noise of the displacement is no speed.
#
# What drives the model of a motion with corners is hardly filtered: at rest the noise in its speed
# would turn the friction from one sample to the next, behind the compared filter it would nearly
# vanish, and a fit has it a third too small. So within a rest the model is driven by the level, at
# no speed; what friction holds there is unknown.
#
# A part rests where its samples lie about one level as noise does, without slope and without
# bend, and where the motion comes to it and leaves it at a speed. The crest of a slow sine lies
# within noise too, but half its length further on it has gone 12 times the noise.

_SHORTEST = 0.02  # s; what is shorter turns little friction
_FEWEST = 10  # samples
_CLEAR = 3.0  # errors of a slope and of a bend, and of samples that belong to a rest
_GONE = 30.0  # times the noise, half a length beyond
_SCATTER = 4.0  # errors by which the noise of a rest may exceed that of the log
_NOISE_KNOWN = 0.1  # share to which that is known
_ROUNDING = 1e-6  # of the stroke
_TAKEN = 0.9  # of the samples differ from the one before, where steps are finer than the noise


def dwells_of(displacement: FloatArray, interval: float) -> list[tuple[slice, float]]:
    """Return the parts in which a motion rests, in order of time, and the level of each, m."""
    x = displacement
    n = max(_FEWEST, math.ceil(_SHORTEST / interval))
    hop = n // 2
    starts = np.arange(0, len(x) - n + 1, hop)
    away = np.abs(x[starts + n - 1] - x[starts])
    noise = max(noise_of(x), _ROUNDING * float(np.ptp(x)))
    # Steps that a converter takes where many samples are equal are noise too.
    steps = np.abs(np.diff(x))
    taken = steps[steps > 0.0]
    if 0 < len(taken) < _TAKEN * len(steps):
        noise = max(noise, float(taken.min()) / math.sqrt(12.0))
    near = starts[away <= 2.0 * _SCATTER * noise]
    if not len(near):
        return []
    reach = np.linspace(-1.0, 1.0, n)
    forms = np.stack([reach, reach**2 - mean_of(reach**2)])
    forms /= np.linalg.norm(forms, axis=1)[:, None]
    slopes = np.abs(x[near[:, None] + np.arange(n)] @ forms.T)
    flat = near[(slopes <= _CLEAR * noise).all(axis=1)]
    still = flat[_is_level(x[flat[:, None] + np.arange(n)], noise)].tolist()
    # Looks at one level are one rest; noise alone refuses one in 200 between.
    levels = [mean_of(x[start : start + n]) for start in still]
    breaks = [
        k
        for k in range(1, len(still))
        if still[k] - still[k - 1] > 2 * n or abs(levels[k] - levels[k - 1]) > _CLEAR * noise
    ]

    def at_level(side: FloatArray, level: float) -> int:
        """How many come before two that are far: one alone is noise, once in 400."""
        far = np.abs(side - level) > _CLEAR * noise
        places = np.flatnonzero(far & np.append(far[1:], True))
        return int(places[0]) if len(places) else len(far)

    dwells = []
    for first, stop in pairwise([0, *breaks, len(still)] if still else []):
        begin, end = still[first], still[stop - 1] + n
        # With the samples beside it that lie at its level too.
        level = mean_of(x[begin:end])
        before = at_level(x[max(begin - hop, 0) : begin][::-1], level)
        rest = slice(begin - before, end + at_level(x[end : end + hop], level))
        level = mean_of(x[rest])
        # The motion comes to it and leaves it at a speed, as far as the log goes.
        half = (rest.stop - rest.start) // 2
        sides = (x[max(rest.start - half, 0) : rest.start], x[rest.stop : rest.stop + half])
        far = [bool(np.any(np.abs(side - level) >= _GONE * noise)) for side in sides if len(side)]
        if _is_level(x[rest], noise) and far and all(far):
            dwells.append((rest, level))
    return dwells


def dwell_lengths(velocity: FloatArray) -> list[int]:
    """Return how many samples each part has in which a drive is at no speed."""
    starts, stops = parts_where(velocity == 0.0)
    return [n for n in (stops - starts).tolist() if n >= _FEWEST]


def _is_level(parts: FloatArray, noise: float) -> Any:
    """Whether samples, of a part or of each row, scatter about their mean as noise does."""
    allowed = 1.0 + _NOISE_KNOWN + _SCATTER / math.sqrt(2.0 * parts.shape[-1])
    return np.std(parts, axis=-1) <= allowed * noise


# Velocity that the compared filter may take away, over all of it. A sine loses less, a triangle of
# 0.2 m/s and +-32 mm an eighth.
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
_LINES = 8.0  # enough to estimate the noise of an order
_CLEAR_DRIVE = 8.0  # a line of pure noise is so much above its mean once in 3000
# Hz; hum and what rectifiers make of it. A line there is hum where it has so many times the power
# of all that lies beside it: the orders of a motion have neighbours of their own size.
_MAINS = (50.0, 60.0)
_MULTIPLES = 6
_ALONE = 10.0
# Lines of one record: how far the taper lets one reach, and how far is looked.
_BESIDE = (4, 12)


# Power of velocity by frequency, m2/s2 a line: frequencies, the motion's, and the noise's.
_Spectrum = tuple["FloatArray", "FloatArray", "FloatArray"]


def make_drive(
    seen: FilteredLog, parts_of: Sequence[FoundSegment], options: ConditionOptions
) -> Drive:
    """Return the displacement and velocity that drive the model; at the level where it rests."""
    if options.rig_filter != "none" and options.rig_filter_corner > options.filter_corner:
        return _least_in_error(_behind_ours(seen, options), parts_of, options)
    if not options.is_ours:
        return Drive(seen.displacement, seen.velocity, math.inf)
    log = seen.log
    drive = _least_in_error(seen, parts_of, options)
    rests = [
        (part, level)
        for part, level in dwells_of(log.displacement, log.interval)
        if any(run.segment.first < part.stop and part.start < run.segment.stop for run in parts_of)
    ]
    if not rests:
        return drive
    x, v = drive.displacement.copy(), drive.velocity.copy()
    for part, level in rests:
        x[part], v[part] = level, 0.0
    return Drive(x, v, drive.corner)


def _behind_ours(seen: FilteredLog, options: ConditionOptions) -> FilteredLog:
    """A log that the rig has filtered, its displacement behind our filter too.

    The noise that a rig lets through up to 60 Hz turns the friction near the ends of the stroke: at
    1.4 Hz the MSE of five settings was 3.5 to 6.4 times that of noise, 1.5 to 2.5 times without it.
    """
    log = seen.log._replace(displacement=seen.displacement)
    corner, order = options.filter_corner, options.filter_order
    design = design_filter("zero_phase", corner, sample_rate=1.0 / log.interval, order=order)
    x = apply_filter(design, log.displacement)
    return seen._replace(log=log, displacement=x, velocity=differentiate(x, log.interval))


def _least_in_error(
    seen: FilteredLog, parts_of: Sequence[FoundSegment], options: ConditionOptions
) -> Drive:
    log, rate, lowest = seen.log, 1.0 / seen.log.interval, options.filter_corner
    left_out = log.displacement - seen.displacement
    corners = [_corner(left_out, seen.velocity, part.segment, options, rate) for part in parts_of]
    is_whole = all(math.isinf(part.begin) and math.isinf(part.end) for part in parts_of)
    if is_whole and max(corners) <= lowest:
        return Drive(seen.displacement, seen.velocity, lowest)
    wide = max(corners)
    if not is_whole:
        # A change of speed must reach the model as it was, and what noise does there is soon
        # forgotten: the highest corner at which the noise of the velocity is half a per cent of
        # the fastest speed.
        allowed = _NOISE_BETWEEN * float(np.abs(seen.velocity).max())
        density = 2.0 * noise_of(log.displacement) ** 2 / rate
        wide = (3.0 * allowed**2 / max(density * 4.0 * math.pi**2, 1e-300)) ** (1.0 / 3.0)
        wide = float(max(min(wide, _HIGHEST * rate), lowest))

    def design(corner: float) -> FilterDesign:
        return design_filter("zero_phase", corner, sample_rate=rate, order=options.filter_order)

    def behind(corner: float) -> tuple[FloatArray, FloatArray]:
        displacement = apply_filter(design(corner), log.displacement)
        return displacement, differentiate(displacement, log.interval)

    passed = {lowest: (seen.displacement, seen.velocity)}
    reach = fading_samples(design(lowest))
    x, v = behind(max(wide, lowest))
    for part, corner in zip(parts_of, corners, strict=True):
        if corner not in passed:
            passed[corner] = behind(corner)
        # Far enough from what went before and comes behind.
        first = max(0, math.ceil(part.begin) + reach) if math.isfinite(part.begin) else 0
        stop = math.floor(part.end) - reach if math.isfinite(part.end) else len(x)
        inside = slice(first, max(first, stop))
        x[inside], v[inside] = (channel[inside] for channel in passed[corner])
    return Drive(x, v, max(corners))


def _corner(
    left_out: FloatArray,
    velocity: FloatArray,
    segment: Segment,
    options: ConditionOptions,
    rate: float,
) -> float:
    """Return the corner of the drive that errs least over a segment, Hz."""
    if segment.n_cycles >= 2:
        frequency, motion, noise = _of_cycles(left_out, segment)
    else:
        frequency, motion, noise = _of_motion(left_out[segment.window], 1.0 / rate)
    lowest, order = options.filter_corner, options.filter_order
    if not float(np.sum(motion)) > _LOST**2 * variance_of(velocity[segment.window]):
        return lowest
    highest = max(_HIGHEST * rate, lowest)
    corners = np.geomspace(lowest, highest, math.ceil(math.log2(highest / lowest) / _STEP) + 1)
    warped = np.tan(np.pi * np.minimum(frequency, 0.499 * rate) / rate) ** (2 * order)
    bars = np.tan(np.pi * corners / rate) ** (2 * order) / (math.sqrt(2.0) - 1.0)
    gains = [1.0 / (1.0 + warped / bar) for bar in bars.tolist()]
    errors = [float(motion @ (1.0 - gain) ** 2 + noise @ gain**2) for gain in gains]
    return float(corners[int(np.argmin(errors))])


def _of_cycles(left_out: FloatArray, segment: Segment) -> _Spectrum:
    """Lines at multiples of the frequency are motion, as far as they stand out of the others."""
    starts, n_cycles = segment.cycle_starts, segment.n_cycles
    a_cycle = max(8, round(mean_of(np.diff(starts))))
    steps = np.arange(a_cycle) / a_cycle
    positions = (starts[:-1, None] + np.diff(starts)[:, None] * steps).ravel()
    even = np.interp(positions, np.arange(len(left_out)), left_out)
    lines = np.fft.rfft(even)
    power = (2.0 / len(even) ** 2) * (lines.real**2 + lines.imag**2)
    frequency = np.arange(len(power)) * segment.frequency / n_cycles
    n_orders = (len(power) - 1) // n_cycles
    # Row k: the line at k times the frequency, then those up to the next one.
    table = power[: n_orders * n_cycles].reshape(n_orders, n_cycles)
    between = table[:, 1:].mean(axis=1)
    # Few lines between two orders do not fix the noise: two cycles have one, and a ninth of pure
    # noise would stand out of that. Those of its neighbours count too.
    reach = math.ceil(0.5 * (_LINES / (n_cycles - 1) - 1.0))
    if reach >= 1:
        sums = np.concatenate([[0.0], np.cumsum(between)])
        low = np.maximum(np.arange(n_orders) - reach, 0)
        high = np.minimum(np.arange(n_orders) + reach + 1, n_orders)
        between = (sums[high] - sums[low]) / (high - low)
    # A line of noise is exponential: above its mean by half of its own size on average.
    orders = np.maximum(table[:, 0] - between, 0.0) * (table[:, 0] > _CLEAR_DRIVE * between)
    for order in _hum(segment.frequency, n_orders):
        beside = [k for k in range(order - 2, order + 3) if k != order and 0 < k < n_orders]
        if table[order, 0] > _ALONE * max((table[k, 0] for k in beside), default=math.inf):
            orders[order] = 0.0
    motion = np.zeros(len(power))
    motion[: n_orders * n_cycles : n_cycles] = orders
    noise = np.repeat(between, n_cycles)
    noise = np.concatenate([noise, np.full(len(power) - len(noise), noise[-1])])
    speed = (2.0 * np.pi * frequency) ** 2
    return frequency, speed * motion, speed * noise


def _of_motion(left_out: FloatArray, interval: float) -> _Spectrum:
    """Noise is white: as strong everywhere as near half the sample rate."""
    taper = np.hanning(len(left_out) + 2)[1:-1]
    power = 2.0 * np.abs(np.fft.rfft(left_out * taper)) ** 2
    power /= len(left_out) * float(taper @ taper)
    frequency = np.asarray(np.fft.rfftfreq(len(left_out), interval), np.float64)
    top = (frequency > _TOP[0] / interval) & (frequency < _TOP[1] / interval)
    level = median(power[top]) / _HALF if top.any() else 0.0
    # Lines of the mains have the power of what lies beside them.
    kept = power.copy()
    wide, far = _BESIDE
    for place in _hum(float(frequency[1]), len(power) - far):
        line = slice(max(place - wide, 0), place + wide + 1)
        beside = [*power[max(place - far, 0) : line.start], *power[line.stop : place + far + 1]]
        if power[line].max() > _ALONE * max(beside):
            kept[line] = np.mean(beside)
    # In bands, so that single lines of noise do not pass for motion.
    width = max(1, len(power) // 100)
    edges = np.arange(0, len(power), width)
    widths = np.diff([*edges, len(power)])
    means = np.add.reduceat(kept, edges) / widths
    excess = np.maximum(means - level * (1.0 + 3.0 / math.sqrt(width)), 0.0)
    speed = (2.0 * np.pi * frequency) ** 2
    return frequency, speed * np.repeat(excess, widths), speed * level


def _hum(spacing: float, n_lines: int) -> list[int]:
    """Return the places of the mains and its multiples among lines that lie so far apart, Hz."""
    places = (round(k * mains / spacing) for mains in _MAINS for k in range(1, _MULTIPLES + 1))
    return sorted({place for place in places if 0 < place < n_lines})


def unclear_turns(drive: Drive, log: UniformLog, segments: Sequence[Segment]) -> list[int]:
    """Return the samples at which noise decides which way friction acts, where they are many."""
    # A sine of 200 samples a cycle that turns at one of them turns at all of them: its friction is
    # then too small by as much as they are. Where samples fall elsewhere in each there are few.
    noise = noise_of(log.displacement) * math.sqrt(2.0 * drive.corner * log.interval)
    noise *= 2.0 * math.pi * drive.corner / math.sqrt(3.0)
    unclear = np.abs(drive.velocity) <= _UNCLEAR * noise
    # Of a slow turn several in a row are: there the noise is not what decides.
    alone = np.zeros(len(unclear), dtype=np.bool_)
    alone[1:-1] = unclear[1:-1] & ~unclear[:-2] & ~unclear[2:]
    n = sum(int(np.count_nonzero(alone[segment.window])) for segment in segments)
    if n < _ON_SAMPLES * sum(segment.n_samples for segment in segments):
        return []
    return np.flatnonzero(alone).tolist()


def content_beyond(displacement: FloatArray, interval: float, corner: float) -> float:
    """Return the share of the velocity's deviation that lies above a frequency."""
    velocity = np.diff(displacement) / interval
    velocity = velocity - mean_of(velocity)
    power = np.abs(np.fft.rfft(velocity * np.hanning(len(velocity) + 2)[1:-1])) ** 2
    frequency = np.fft.rfftfreq(len(velocity), interval)
    return math.sqrt(float(np.sum(power[frequency > corner])) / max(float(np.sum(power)), 1e-300))


# A motion of straight lines: at even speeds, with corners that are sharp between two samples.
#
# At the corners of a triangle the force shows most of K_e, and a speed that jumps between two
# samples is in no sample. But where the motion is straight on both sides within its noise, the
# lines cross where it turned: to a thousandth of a sample, of 128 samples with 3 um of noise that
# turn by 0.5 m/s. What drives the model is then these lines, and a jump of the speed there.
#
# It is taken for straight only as a whole: lines whose samples, and corners whose nearest samples
# lie off them by no more than noise does. A turn that a rig takes 0.5 ms for at 1 kHz lies 30 um
# off its lines and drives the model as any motion does.

_LEVERS = (4e-3, 16e-3)  # s; a turn is looked for in samples so far apart; noise needs the longer
_CLEAR_STRAIGHT = 10.0  # times the noise of that look
_FARTHEST = 5.0  # times the noise, of the samples beside a corner
_BESIDE_STRAIGHT = 1.5  # samples between where it is seen to turn and where the lines cross
_AT_SAMPLE = 5.0  # errors of where the lines cross: nearer to a sample than that, it is there
_LENGTHENED = 2  # times that a part is lengthened, by what shows a turn and a line behind it
_AT_REST = 5.0  # errors of a slope: a line that rises by less rests


def drive_of_lines(displacement: FloatArray, interval: float, part: slice) -> Drive | None:
    """Return the drive of a log that moves in lines over a part; None where it does not."""
    # With a few samples beside it, where a line would be too short.
    first, stop, _ = part.indices(len(displacement))
    for seconds in _LEVERS:
        lever = max(2, round(seconds / interval))
        for times in range(_LENGTHENED + 1):
            more = times * (lever + _FEWEST)
            begin, end = max(first - more, 0), min(stop + more, len(displacement))
            x = displacement[begin:end]
            noise = max(noise_of(x), _ROUNDING * float(np.ptp(x)))
            turns = _turns(x, lever, noise)
            if turns is None:
                break
            # Noise moves the top of a long look: they turn where lines that keep off them cross.
            lines = _lines(x, turns, lever // 2)
            if lines is not None:
                moved = _beside(lines, turns)
                turns = np.rint(turns + np.where(np.abs(moved) <= lever, moved, 0.0)).astype(int)
            lines = _lines(x, turns, 1, noise)
            jumps = None if lines is None else _crossings(x, turns, lines, noise)
            if lines is None or jumps is None:
                continue
            whole, speed = displacement.copy(), np.zeros(len(displacement))
            # A sample at which it turns has the speed after it.
            edges = [0, *np.ceil(jumps[:, 0]).astype(np.int64).tolist(), end - begin]
            for line, (low, high) in zip(lines.T, pairwise(edges), strict=True):
                whole[begin + low : begin + high] = _at(line, np.arange(low, high))
                speed[begin + low : begin + high] = line[2] / interval
            jumps[:, 0] += begin
            jumps[:, 2:] /= interval
            return Drive(whole, speed, math.inf, jumps)
    return None


def _turns(x: FloatArray, lever: int, noise: float) -> IntArray | None:
    """Return the samples nearest to where the motion turns; None where it bends or none does."""
    if len(x) < 4 * lever + _FEWEST:
        return None
    bend = np.abs(x[: -2 * lever] - 2.0 * x[lever:-lever] + x[2 * lever :])
    over = np.flatnonzero(bend > _CLEAR_STRAIGHT * math.sqrt(6.0) * noise)
    runs = np.split(over, np.flatnonzero(np.diff(over) > lever) + 1)
    # A sharp corner is seen over two levers, a bend over its own length too.
    if not len(over) or max(map(len, runs)) > 2 * lever + 1:
        return None
    return np.array([int(run[np.argmax(bend[run])]) + lever for run in runs])


def _lines(
    x: FloatArray, turns: IntArray, margin: int, noise: float = math.inf
) -> FloatArray | None:
    """The lines before, between and behind turns, off them; None where one is not straight.

    Rows: their middles, where they are there, slopes, samples, and their squared reach.
    """
    lines = []
    for before, behind in pairwise([-margin - 1, *turns.tolist(), len(x) + margin]):
        at = np.arange(before + margin + 1, behind - margin)
        n = len(at)
        if n < _FEWEST:
            return None
        middle = 0.5 * float(at[0] + at[-1])
        reach = at - middle
        power = float(reach @ reach)
        level, slope = float(np.mean(x[at])), float(reach @ x[at]) / power
        rest = x[at] - level - slope * reach
        allowed = 1.0 + _NOISE_KNOWN + _SCATTER / math.sqrt(2.0 * n)
        if math.sqrt(float(rest @ rest) / n) > allowed * noise:
            return None
        # A line that only seems to rise is level: friction would slide one way.
        is_level = math.isfinite(noise) and abs(slope) <= _AT_REST * noise / math.sqrt(power)
        lines.append((middle, level, 0.0 if is_level else slope, n, power))
    return np.array(lines).T


def _at(lines: FloatArray, sample: Any) -> FloatArray:
    return np.asarray(lines[1] + lines[2] * (sample - lines[0]))


def _beside(lines: FloatArray, turns: IntArray) -> FloatArray:
    """Return how far behind turns each line crosses the next; infinite: nowhere."""
    step = np.diff(lines[2])
    gap = _at(lines[:, :-1], turns) - _at(lines[:, 1:], turns)
    nowhere = np.full(len(step), math.inf)
    return np.asarray(np.divide(gap, step, out=nowhere, where=step != 0.0))


def _crossings(
    x: FloatArray, turns: IntArray, lines: FloatArray, noise: float
) -> FloatArray | None:
    """Where each line crosses the next, as in `Motion.jumps`; None where no motion turns there."""
    pair = lines[:, :-1], lines[:, 1:]
    at = turns + _beside(lines, turns)
    if not np.all(np.abs(at - turns) < _BESIDE_STRAIGHT):
        return None
    near = turns + np.arange(-1, 2)[:, None]
    there = np.where(near < at, *(_at(line, near) for line in pair))
    if np.max(np.abs(x[near] - there)) > _FARTHEST * noise:
        return None
    # For a noise of 1 a line has this variance there.
    variance = sum(1.0 / line[3] + (at - line[0]) ** 2 / line[4] for line in pair)
    error = noise * np.sqrt(variance) / np.abs(np.diff(lines[2]))
    at = np.where(np.abs(at - np.rint(at)) <= _AT_SAMPLE * error, np.rint(at), at)
    level = 0.5 * (_at(pair[0], at) + _at(pair[1], at))
    return np.stack([at, level, pair[0][2], pair[1][2]], axis=1)
