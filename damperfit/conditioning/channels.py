"""What one channel shows of its sensor and converter: rails, values that stand, steps, spikes.

q is the step of the channel, from the differences of its sorted values. A smooth signal that is
rounded to steps stays at its top value for L samples and is at most 4 q (a parabola: 3 q, and
rounding) below it L/2 samples further on; a clipped one has gone on like the motion. The same
distance separates a stuck channel from one whose steps are coarse.

What the faults cost near the limits (the largest error at settings 1, 10 and 20 of the reference
set, 500 Hz, no noise):

- clipped at 98 % of its peak the force costs 0.6 % of R_m2 and 1.7 % of K_e, at 95 % 2 and 8 %;
- rounded to 1000 steps over the stroke the displacement costs 0.4 % of K_e, to 500 steps 5 %, to
  250 6 %: it acts through the velocity and does not average out, and `displacement_noise` sees it
  too. The force costs 0.3 % at 125 steps, 0.4 % at 62; noise of half a step or more turns that into
  scatter, which intervals cover;
- one spike as large as the force's range costs 4 % of K_e, twenty of a tenth as much, five of 2 %
  of it 0.3 %.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from damperfit.conditioning.signals import BoolArray, FloatArray, IntArray, noise_of
from damperfit.problem import Problem, note, warning
from damperfit.recording import Recording
from damperfit.statistics import mean_of, median, percentiles


class _Channel:
    """Some rows of one channel of a log, and of the other one beside it."""

    def __init__(self, recording: Recording, name: str, rows: slice, period: float) -> None:
        other = "displacement" if name == "force" else "force"
        self.name, self.period = name, period  # samples in a cycle; 0 when not known
        self.values: FloatArray = getattr(recording, name)[rows]  # SI
        self.other: FloatArray = getattr(recording, other)[rows]
        self.time = recording.time[rows]
        self.first_row = (rows.start or 0) + 1  # of the data, counted from 1
        self.low, self.high = float(self.values.min()), float(self.values.max())
        self.span, self.noise = self.high - self.low, noise_of(self.values)

    def place(self, index: int) -> str:
        """Return where a sample stands."""
        return f"row {self.first_row + index} of the data, time {self.time[index]:.6g} s"

    def shown(self, value: float) -> str:
        """Return a value with its unit."""
        return f"{value:.5g} N" if self.name == "force" else f"{1e3 * value:.5g} mm"


def examine_channels(
    recording: Recording, driven: slice, compared: slice, *, period: float
) -> Iterator[Problem]:
    """Yield what is remarkable in the displacement that drives, and in the compared force."""
    for name, rows in (("displacement", driven), ("force", compared)):
        n = len(recording.time[rows])
        channel = _Channel(recording, name, rows, period) if n >= 8 else None
        if channel is None or channel.span <= 0.0:
            continue
        order = np.sort(np.asarray(channel.values, np.float64))
        # The least step, but for a few values that stand between the steps.
        steps = np.diff(order)
        steps = steps[steps > 1e-9 * channel.span]
        rank = len(steps) // 50
        step = float(np.partition(steps, rank)[rank]) if len(steps) else 0.0
        yield from _standing(channel, step)
        yield _steps(channel, step)
        yield from _spikes(channel, float(order[n - 1 - n // 100] - order[n // 100]))


# Whether a channel that stands for some samples was cut, was stuck, or did stand.
#
# What a sensor's end cuts off would have gone on: beside a stand of L samples the signal comes in
# and leaves with the speed that turns it within them. Written from the stand outwards as ``y = v
# t + b t^2``, a curve that is cut has v = b L on both sides, a smooth crest, a rest at the end of
# the stroke and a crank that goes through its play have v = 0 on the way in. A corner (b small)
# may be a cut triangle or a trapezoid's rest: at rest the force leaves its value at once.
#
# A sensor that is stuck has to catch up when it comes free; what stood goes on from where it was.

_RUN = 3  # equal samples in a row that are looked at
_FEWEST, _MOST = 4, 60  # samples looked at on each side of a stand
_CUT = 0.4  # of b L; 0 at a rest, 1 at a cut
_LEFT = 0.3  # of what the force changes over the stand, in its first quarter
_JUMP = 3.0  # usual steps of the samples behind
_LEAP = 6.0  # steps; see above
_BEYOND = 0.001  # of the range; a cut by less costs nothing
_LOCAL = 3.0  # least steps beside a stand
_STANDS = 0.02  # of a period: shorter stands move nothing


class _Runs(NamedTuple):
    """Equal samples in a row: first and stop of each, and how far the signal goes beside it."""

    start: IntArray
    stop: IntArray
    least_leap: FloatArray  # the smaller of both sides
    greatest_leap: FloatArray

    def where(self, mask: BoolArray) -> _Runs:
        return _Runs._make(values[mask] for values in self)

    @property
    def length(self) -> IntArray:
        return self.stop - self.start

    @property
    def ends(self) -> list[tuple[int, int]]:
        return list(zip(self.start.tolist(), self.stop.tolist(), strict=True))


def _runs(values: FloatArray) -> _Runs:
    """Return the runs of at least three equal samples."""
    samples = np.ascontiguousarray(values, np.float64)
    edges = np.concatenate([[0], np.flatnonzero(np.diff(samples)) + 1, [len(samples)]])
    is_run = np.diff(edges) >= _RUN
    start, stop = edges[:-1][is_run], edges[1:][is_run]
    reach = np.maximum((stop - start) // 2, 1)
    before, behind = start - reach, stop - 1 + reach
    level = values[start]
    left = np.abs(values[np.maximum(before, 0)] - level)
    right = np.abs(values[np.minimum(behind, len(values) - 1)] - level)
    left[before < 0] = right[before < 0]
    is_cut = behind > len(values) - 1
    right[is_cut] = left[is_cut]
    return _Runs(start, stop, np.minimum(left, right), np.maximum(left, right))


def _is_held(channel: _Channel, runs: _Runs) -> bool:
    """Whether a converter is slower than the rows: each value stands, not the ends alone."""
    level, values = channel.values[runs.start], channel.values
    is_between = (level > channel.low) & (level < channel.high)
    between = np.count_nonzero((values > channel.low) & (values < channel.high))
    return bool(2 * int(runs.length[is_between].sum()) > between)


def _is_clip(channel: _Channel, start: int, stop: int) -> bool:
    """Whether a channel was cut where it stands."""
    values, other = channel.values, channel.other[start:stop]
    length = stop - start
    n = min(max(length, _FEWEST), _MOST)
    is_cut = True
    if start >= n and stop + n <= len(values):
        left, right = values[start - n : start][::-1], values[stop : stop + n]
        sign = np.sign(2.0 * values[start] - left.mean() - right.mean())
        time = np.arange(1.0, n + 1.0)
        basis = np.stack([time, time**2], axis=-1)
        # Speed v and bend b outwards, a sample, before and behind; how far it would have gone on.
        sides = [
            np.linalg.lstsq(basis, sign * (values[start] - side), rcond=None)[0].tolist()
            for side in (left, right)
        ]
        beyond = 0.125 * (sides[0][0] + sides[1][0]) * length
        steps = np.abs(np.diff(np.concatenate([left[::-1], right])))
        least = float(min(steps[steps > 0.0], default=0.0))
        if beyond < max(_BEYOND * channel.span, _LOCAL * least):
            return False  # a smooth crest, in the digits of the log
        is_cut = all(v > _CUT * max(b, 0.0) * length for v, b in sides)
        if is_cut and not sides[0][0] < 2.0 * sides[0][1] * length:
            quarter = max(length // 4, 1)
            change = abs(float(other[-quarter:].mean() - other[0]))
            is_cut = abs(float(other[:quarter].mean() - other[0])) < _LEFT * change
    whole = float(np.ptp(channel.other))
    moved = float(np.ptp(other)) / max(whole, 1e-300)
    if channel.name == "displacement":
        return moved > 0.1 and is_cut  # at rest the force stands too
    # At constant speed over half a stroke a constant force is what a damper gives.
    chord = np.linspace(other[0], other[-1], len(other))
    is_straight = float(np.abs(other - chord).max()) < 0.002 * whole
    return not (moved > 0.45 and is_straight)


def _standing(channel: _Channel, step: float) -> Iterator[Problem]:
    """Rails: the lowest and the highest value, where it is no rounded peak; and what is stuck."""
    name, n, values, span = channel.name, len(channel.values), channel.values, channel.span
    runs = _runs(values)
    usual = median(runs.length) if _is_held(channel, runs) else 0.0
    is_long = (runs.length > 2.0 * usual) & (runs.least_leap > _LEAP * step)
    rails: list[float] = []
    clipped: set[int] = set()
    for rail in (channel.low, channel.high):
        at = runs.where((values[runs.start] == rail) & is_long)
        if cut := [start for start, stop in at.ends if _is_clip(channel, start, stop)]:
            rails.append(rail)
            clipped.update(cut)
    if rails:
        # A small share of all may be all of the speed whose force it takes.
        of_fastest = "of the fastest segment " * (name == "force" and channel.period > 0.0)
        share = 100.0 * sum(int(np.count_nonzero(values == rail)) for rail in rails) / n
        text = (
            f"the {name} is clipped at {' and '.join(map(channel.shown, rails))}: "
            f"{share:.2g} % of the samples {of_fastest}are there, the first of them in "
            f"{channel.place(min(clipped))}; "
            "choose a larger range of sensor or amplifier and record again"
        )
        yield warning(f"{name}_clipping", text, value=share, unit="%")

    least = max(5.0, _STANDS * channel.period, 0.001 * n if channel.period == 0.0 else 0.0)
    is_leap = runs.greatest_leap > max(_LEAP * step, 0.01 * span)
    # Chance makes a few equal samples where a nearly constant force is about to change.
    is_leap &= runs.least_leap > max(0.5 * _LEAP * step, 4.0 * channel.noise, 0.002 * span)
    leaping = runs.where(is_leap)
    held = float(leaping.length.sum()) / n
    if held > 0.5 and len(leaping.start) > 10 and _is_held(channel, leaping):
        text = (
            f"the {name} changes only every {int(median(leaping.length))} rows: its sensor "
            "or converter is slower than the log; record it at its own rate"
        )
        yield warning(f"{name}_stuck", text, value=100.0 * held, unit="%")
        return

    def is_stuck(start: int, stop: int) -> bool:
        if not float(np.ptp(channel.other[start:stop])) > 0.05 * float(np.ptp(channel.other)):
            return False
        if name == "force":
            return _is_clip(channel, start, stop)
        steps = np.abs(np.diff(values[stop : stop + 12]))  # it leaps when the stand ends
        return len(steps) > 0 and bool(abs(values[stop] - values[stop - 1]) > _JUMP * median(steps))

    stands = runs.where(is_leap & (runs.length >= least)).ends
    stuck = [ends for ends in stands if ends[0] not in clipped and is_stuck(*ends)]
    if not stuck:
        return
    share = 100.0 * sum(stop - start for start, stop in stuck) / n
    first, stop = stuck[0]
    text = (
        f"the {name} is stuck at {channel.shown(values[first])} while the rig is "
        f"moving: {len(stuck)} time{'s' * (len(stuck) > 1)}, {share:.2g} % of the samples, first "
        f"from {channel.place(first)} for {stop - first} rows; check sensor, cable, logger"
    )
    yield warning(f"{name}_stuck", text, value=share, unit="%")


_FEWEST_STEPS = {"displacement": 500.0, "force": 125.0}
_FINE = 1e6  # steps; finer than any converter
_DITHER = 0.45  # of a step: its rounding alone has 0.29, noise of half a step makes it 0.58
_SMOOTH = 0.1  # of a step


def _steps(channel: _Channel, step: float) -> Problem:
    """Say how fine the channel is; a warning when its steps are coarse and noise hides none."""
    name, noise, few = f"{channel.name}_steps", channel.noise, _FEWEST_STEPS[channel.name]
    count = channel.span / step
    # Rounding alone is noise of 0.29 steps: what is smoother has few values because it repeats.
    is_doubtful, is_stepped = count < few or noise < _SMOOTH * step, True
    if is_doubtful and count <= _FINE:
        # A triangle that repeats exactly goes on by one and the same amount.
        steps = np.abs(np.diff(channel.values)) / step
        whole = np.rint(steps)
        low, high = percentiles(whole, 5.0, 95.0)
        is_stepped = bool(high > low and mean_of(np.abs(steps - whole) < 0.1) > 0.9)
    if count > _FINE or not is_stepped:
        return note(name, f"the {channel.name} has no visible steps")
    text = f"the {channel.name} has steps of {channel.shown(step)}, {count:.0f} over its range"
    if count >= few or (channel.name == "force" and noise > _DITHER * step):
        return note(name, text, value=count)
    text += (
        f" (expected at least {few:g}): K_e may be off by some per cent; use a smaller range or a "
        "finer converter"
    )
    return warning(name, text, value=count)


_SPIKE = 0.02  # of the range
_SPIKE_NOISE = 7.0  # times the noise
_HARMLESS = 0.2  # of the range, all spikes together
_USUAL, _RARE = 6.0, 98.0  # times what one sample in 50 exceeds
_NEAR, _ALONE = 5, 2  # samples
_PART = 0.4  # of a spike; one like it
_PHASE = 0.05  # of a cycle: when play closes
_AT_TURNS = 0.25  # of the range
_OFTEN = 0.25  # of the cycles
_MOST_SPIKES = 0.02  # of the samples; more are noise
_LONGEST_DROPOUT = 20  # samples


def _spikes(channel: _Channel, usual: float) -> Iterator[Problem]:
    rows, sizes = _find_spikes(channel, usual)
    if not len(rows):
        return
    places = ", ".join(str(channel.first_row + int(row)) for row in rows[:5])
    plural = "s" * (len(rows) > 1)
    worst = int(rows[np.argmax(sizes)])
    text = (
        f"{len(rows)} spike{plural} in the {channel.name}, in row{plural} {places}"
        f"{', ...' * (len(rows) > 5)} of the data; the largest is "
        f"{channel.shown(channel.values[worst])} at time {channel.time[worst]:.6g} s; "
    )
    severity = "note"
    if float(sizes.sum()) <= _HARMLESS * usual:
        text += "too small to move a parameter"
    else:
        severity = "warning"
        text += "nothing was removed: look for loose contacts and record again, or set "
        text += "conditioning.spikes = 'bridge'"
    yield Problem(f"{channel.name}_spikes", text, severity, values={"value": float(len(rows))})


def bridge_spikes(recording: Recording, period: float) -> Recording:
    """Return the recording with its spikes replaced by straight lines, and a finding of that."""
    findings: list[Problem] = []
    bridged: dict[str, Any] = {}
    for name in ("displacement", "force"):
        channel = _Channel(recording, name, slice(None), period)
        low, high = percentiles(channel.values, 1.0, 99.0)
        rows, _ = _find_spikes(channel, high - low)
        if len(rows):
            good = np.delete(np.arange(len(channel.values)), rows)
            bridged[name] = np.interp(channel.time, channel.time[good], channel.values[good])
            text = (
                f"{len(rows)} spike{'s' * (len(rows) > 1)} in the {name} bridged as declared, the "
                f"first in {channel.place(int(rows[0]))}"
            )
            findings.append(note(f"{name}_spikes_bridged", text, value=float(len(rows))))
    return replace(recording, findings=(*recording.findings, *findings), **bridged)


def _find_spikes(channel: _Channel, usual: float) -> tuple[IntArray, FloatArray]:
    """The samples that stand out of those beside them, and not in each cycle, and how far."""
    values, period = channel.values, channel.period
    beside = np.zeros(len(values))
    if len(values) >= 5:  # a sample beside the median of five, which steps and slopes pass
        a, b, e, c, d = (values[k : len(values) - 4 + k] for k in range(5))
        low = np.maximum(np.minimum(a, b), np.minimum(c, d))
        high = np.minimum(np.maximum(a, b), np.maximum(c, d))
        middle = np.maximum(np.minimum(low, high), np.minimum(np.maximum(low, high), e))
        beside[2:-2] = np.abs(e - middle)
    size = beside.copy()
    least = max(_SPIKE, 4.0 / period if period else 0.0) * usual
    dropouts = _find_dropouts(channel, max(least, _SPIKE_NOISE * channel.noise), beside)
    if float(size.max()) <= least:
        return dropouts, beside[dropouts]
    if not period:
        # Where nothing repeats, turns and corners of the motion stand out by themselves.
        least = max(least, _USUAL * percentiles(size, _RARE)[0])
        if channel.name == "force":
            # Friction that turns twice within a few samples is such a corner.
            turns = np.flatnonzero(np.diff(np.sign(np.diff(channel.other))) != 0.0) + 1
            for reach in range(-2, 3):
                at = np.clip(turns + reach, 0, len(size) - 1)
                size[at] = np.where(size[at] < _AT_TURNS * usual, 0.0, size[at])
    rows = np.flatnonzero(size > max(least, _SPIKE_NOISE * channel.noise))
    if len(rows) > _MOST_SPIKES * len(size):
        return dropouts, beside[dropouts]
    is_spike = [
        # More than two samples in a row that stand out are a blow, as where play closes.
        np.count_nonzero(size[max(row - _NEAR, 0) : row + _NEAR + 1] > _PART * size[row]) <= _ALONE
        and not (_repeats(size, row, period) if period else _is_motion(values, row, size[row]))
        for row in rows.tolist()
    ]
    rows = np.union1d(rows[np.array(is_spike, dtype=bool)], dropouts)
    return rows, beside[rows]


def _find_dropouts(channel: _Channel, least: float, beside: FloatArray) -> IntArray:
    """Return the rows of short stands apart from both sides, as zeros; `beside` notes how far."""
    values = channel.values
    rows: list[int] = []
    for start, stop in _runs(values).ends:
        if not 2 <= start <= stop <= len(values) - 3 or stop - start > _LONGEST_DROPOUT:
            continue
        into, out = values[start - 1] - values[start], values[stop] - values[start]
        usual = max(
            abs(values[start - 1] - values[start - 2]), abs(values[stop + 1] - values[stop])
        )
        size = min(abs(into), abs(out))
        if into * out > 0.0 and size > max(least, _LEAP * usual):
            beside[start:stop] = size
            rows += range(start, stop)
    if channel.period:
        rows = [row for row in rows if not _repeats(beside, row, channel.period)]
    return np.array(rows, dtype=np.int64)


def _is_motion(values: FloatArray, row: int, size: float) -> bool:
    """Whether a sample stands out as the crest or the knee of a fast motion in a slow log does."""
    if not 3 <= row < len(values) - 3:
        return False
    near = values[row - 3 : row + 4].tolist()
    # A cubic through what lies beside, but for the next on either side, leads to a crest, a line
    # from one side to a knee; where all steps around are larger, nothing stands out.
    led = (
        0.9 * (near[1] + near[5]) - 0.4 * (near[0] + near[6]),
        2.0 * near[2] - near[1],
        2.0 * near[4] - near[5],
    )
    steps = sorted(abs(b - a) for a, b in pairwise(near))
    least = min(abs(near[3] - value) for value in led)
    return bool(least < _PART * size or size < 0.5 * (steps[2] + steps[3]))


def _repeats(size: FloatArray, row: int, period: float) -> bool:
    """Whether the cycle before or behind has one of its kind too, or many others have."""
    reach = max(2, round(_PHASE * period))
    n_cycles = math.floor(len(size) / period)
    alike = []
    for k in range(-n_cycles, n_cycles + 1):
        middle = round(row + k * period)
        near = size[max(middle - reach, 0) : max(middle + reach + 1, 0)]
        if k and len(near):
            alike.append(float(near.max()) > _PART * size[row])
    return bool(alike) and sum(alike) >= max(1.0, _OFTEN * len(alike))
