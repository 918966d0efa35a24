"""Every channel is (time, value); one step brings them onto the clock of the force.

Faults of clocks and channels are detected from the record alone and corrected, with a finding:

- A counter of k bits that rolls over jumps by 2^k of its steps while the motion is smooth.
- A wall clock that is set while rows run on jumps once, and the motion does not.
- A logger that writes a row only when a value changes holds its values until the next row: every
  tick between has the values of the row before.
- A channel that is slower than the rows is blank between its values, or has stamps, a start or a
  rate of its own: each value is used once, at its own time, and what was sampled at other times
  than the force is interpolated to these.

The time at which a converter's repeated value was taken is not known: that is a warning. A logger
that pauses while it writes its buffer leaves pieces of equal length, and a current or voltage that
steps is another setting: both divide a record.
"""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from damperfit.errors import LogError
from damperfit.io.formats import FloatArray, Samples
from damperfit.io.options import EXTRAS
from damperfit.problem import Problem, note, warning
from damperfit.statistics import median, percentiles

_FEWEST = 50  # rows; of fewer nothing is said
_CLOCK_BITS, _WHOLE_BYTES = range(12, 33), {16, 24, 32}
_RARE = 0.1  # of its period, the longest step of a clock that rolls over
_TICKS = (1.0, 1e-3, 1e-6)  # of a clock, in the unit in which it is written
_BITS = range(8, 33)  # of encoders and converters, the sign perhaps beside them
_FINE = 1e-6  # of the range; smaller gaps are rounding
_ROLLED = 0.75  # of the range: a step as large is a jump, or nothing rolls over
# What is left of most jumps (%) once they are taken out, of the range and of the largest other
# step: spikes leave more.
_MOST, _SMOOTH, _ALIKE = 90.0, 0.25, 2.0
_LATE = 3.0  # usual steps; where more are missing, a clock may have been set
_BLANK = 0.25  # of a channel's rows; fewer blanks are damage
_LONGEST = 20  # rows between two values; a longer blank is a hole
_REPEATED = 0.95  # of runs of one value that have one length
_STEADY = 0.05  # of the usual step, by which all others may differ where a clock was set
_MOST_SET = 3  # times that a clock is set in a log
_LIKE = 0.25  # of the motion of a row: what the row over such a jump may differ by
_HELD, _SLOW = 0.005, 0.95  # of steps longer than a tick; of these by so many quanta at most
_QUANTA = [[2.5], [10.0]]  # of motion and force, which friction turns within a tick
_DENSE = 20  # ticks a row; more is no logger that writes changes
_GAP = 4.5  # usual steps; conditioning bridges shorter ones
_FEWEST_PIECES = 3
_BLOCKS, _SHORTEST = 400, 10  # of a record, whose medians are its levels; rows of one
_STEP, _FLAT = 0.2, 0.1  # of the range: a level's least step, and what it may move by itself
_MOST_LEVELS = 20  # more is a controlled damper
_STANDS = 0.1  # of the middle half of the motion's rows: what they span in a piece at rest
_COMMON = 0.5  # of the force that the other channels must have too


def on_one_clock(samples: Samples, *, wall_clock: float = 0.0) -> Samples:
    """Return samples with counters unrolled, clocks put right and all channels at the same times.

    Time, and every clock of a channel, is in one unit; `wall_clock` is that unit in seconds of a
    clock that can be set, else 0.
    """
    if len(samples.channels["force"]) < _FEWEST:
        return _together(samples) if samples.times else samples
    with np.errstate(over="ignore", invalid="ignore"):  # what is no number is refused later
        samples = _unrolled(samples)
        if wall_clock:
            samples = _unset(samples, wall_clock)
        return _together(_unheld(samples))


def _with(samples: Samples, finding: Problem, **channels: FloatArray) -> Samples:
    """Return samples with channels replaced, and the finding."""
    channels = {**samples.channels, **channels}
    return replace(samples, channels=channels, findings=(*samples.findings, finding))


# Counters.


def _unrolled(samples: Samples) -> Samples:
    time = samples.channels.get("time")
    bits, period = (0, 0.0) if time is None else _clock_period(time)
    if time is not None and bits:
        jumps = np.flatnonzero(np.diff(time) < 0.0)
        x, may_stand = samples.channels["displacement"], bits in _WHOLE_BYTES
        runs_on = [_runs_on(x, int(i), may_stand=may_stand) for i in jumps]
        if 2 * sum(runs_on) > len(jumps):  # or a test begins where the time goes back
            time = time + period * np.searchsorted(jumps, np.arange(len(time)))
            samples = _with(samples, _rolled("time: a clock", bits, len(jumps)), time=time)
    for channel in ("displacement", "force"):
        values = samples.channels[channel]
        if counter := _period(values):
            bits, quantum = counter
            period = quantum * 2.0**bits
            unrolled = np.unwrap(values, period=period)
            at = np.flatnonzero(np.abs(np.diff(values - unrolled)) > quantum)
            steps = np.diff(samples.channels.get("time", np.arange(len(values), dtype=np.float64)))
            if np.max(steps[at]) <= _LATE * median(steps):  # over a gap anything may jump
                finding = _rolled(f"{channel}: a counter", bits, len(at))
                if channel == "force":  # where it began is not known; most forces are small
                    unrolled -= period * round(median(unrolled) / period)
                samples = _with(samples, finding, **{channel: unrolled})
        if n_rows := _repeats(samples.channels[channel]):
            sentence = (
                f"{channel}: each value stands in {n_rows:g} rows, so its converter is slower than "
                f"the rows and friction and openings are doubtful; log at the converter's rate"
            )
            finding = warning("values_repeated", sentence, value=n_rows)
            samples = _with(samples, finding)
    return samples


def _rolled(subject: str, bits: int, n_jumps: int) -> Problem:
    times = "once" if n_jumps == 1 else f"{n_jumps} times"
    sentence = f"{subject} of {bits} bits rolls over {times}: corrected"
    return note("rolled_over", sentence, value=float(n_jumps), is_correction=True)


def _clock_period(time: FloatArray) -> tuple[int, float]:
    """Return the bits and the period of a clock that counts ticks and rolls over; 0 of others."""
    steps = np.diff(time)
    if not np.min(steps) < 0.0 or not np.any(steps > 0.0):
        return 0, 0.0
    back, step = steps[steps < 0.0], median(steps[steps > 0.0])
    for tick in _TICKS:
        if not np.all(np.abs(time / tick - np.rint(time / tick)) < 1e-2):
            continue
        for bits in _CLOCK_BITS:
            period = tick * 2.0**bits
            onward = back + period
            is_counted = np.max(time) < period and step < _RARE * period
            if is_counted and 0.0 < onward.min() <= onward.max() <= _LATE * step:
                return bits, period
    return 0, 0.0


def _period(values: FloatArray) -> tuple[int, float] | None:
    """Return bits and quantum of a counter that rolls over in a channel; None of any other."""
    steps = np.diff(values)
    span = float(np.max(values) - np.min(values))
    if not max(float(np.max(steps)), -float(np.min(steps))) > _ROLLED * span:  # nor of blanks
        return None
    # Two steps may differ by one where none is as small, in a short log.
    gaps = np.diff(np.sort(np.abs(steps)))
    quantum = _quantum(np.append(steps, gaps[gaps > _FINE * span]))
    bits = math.ceil(math.log2(span / quantum))
    period = quantum * 2.0**bits
    if bits not in _BITS or _ROLLED * period > span:
        return None
    unwrapped = np.abs(np.diff(np.unwrap(values, period=period)))
    is_jump = np.abs(steps) > 0.5 * period
    largest = min(_SMOOTH * period, _ALIKE * float(np.max(unwrapped[~is_jump])) + quantum)
    return (bits, quantum) if percentiles(unwrapped[is_jump], _MOST)[0] < largest else None


def _quantum(steps: FloatArray) -> float:
    """Return the smallest step other than 0; 0 where there is none."""
    sizes = np.abs(steps[steps != 0.0])
    return float(f"{np.min(sizes):.9g}") if len(sizes) else 0.0


def _repeats(values: FloatArray) -> float:
    """Return the rows that share a value of a converter slower than the rows; or 0."""
    is_new = values[1:] != values[:-1]
    if 2 * np.count_nonzero(is_new) > len(values):
        return 0.0
    runs = np.diff(np.flatnonzero(np.concatenate(([True], is_new))))
    length = int(median(runs)) if len(runs) else 0
    if not 2 <= length <= _LONGEST:
        return 0.0
    if float(np.mean(runs % length == 0)) >= _REPEATED:
        return float(length)
    # Two rows and three in turn; a coarse converter at one speed does so too, by single steps.
    steps = np.diff(values)[is_new]
    rows = float(np.mean(runs))
    is_near = float(np.mean(np.abs(runs - rows) < 1.0)) >= _REPEATED
    is_coarse = float(median(np.abs(steps))) < 1.5 * _quantum(steps)
    return float(f"{rows:.2g}") if is_near and not is_coarse else 0.0


# Clocks.


def _unset(samples: Samples, unit: float) -> Samples:
    """Take out the jumps of a clock that was set while rows and motion ran on."""
    time, x = samples.channels["time"], samples.channels["displacement"]
    steps = np.diff(time)
    step = median(steps)
    jumps = np.flatnonzero(np.abs(steps / step - 1.0) > _STEADY) if step > 0.0 else np.empty(0)
    if not 0 < len(jumps) <= _MOST_SET or not all(_runs_on(x, int(i)) for i in jumps):
        return samples
    time = time.copy()
    listed = []
    for i in map(int, jumps):
        direction = "on" if steps[i] > 0.0 else "back"
        listed.append(f"by {unit * abs(steps[i]):.4g} s {direction} after {samples.place(i)}")
        time[i + 1 :] -= steps[i] - step
    sentence = (
        f"the clock was set {', '.join(listed)}, while rows and motion run on every "
        f"{unit * step:.4g} s: corrected; declare rig.sample_rate = "
        f"'{1.0 / (unit * step):.4g}Hz' to confirm it, or split the log there if it paused"
    )
    finding = warning("clock_set", sentence, value=float(len(jumps)), is_correction=True)
    return _with(samples, finding, time=time)


def _runs_on(x: FloatArray, i: int, *, may_stand: bool = False) -> bool:
    """Say whether the step of a motion from row i to the next is like its neighbours.

    Where it stands or turns it shows nothing, which is enough with ``may_stand``.
    """
    nearby = np.diff(x[max(i - 5, 0) : i + 7])
    at = min(i, 5)
    neighbours = np.delete(nearby, at)
    speed, noise = median(neighbours), 2.0 * float(np.std(neighbours))
    is_like = abs(nearby[at] - speed) <= _LIKE * abs(speed) + noise
    return is_like and (may_stand or abs(speed) > noise)


def _unheld(samples: Samples) -> Samples:
    """Fill in the rows that a logger left out because no value had changed."""
    time = samples.channels.get("time")
    if time is None or samples.times:
        return samples
    steps = np.diff(time)
    if not (len(steps) and np.min(steps) > 0.0):
        return samples
    tick = float(np.min(steps))
    ticks = np.rint(steps / tick)
    n_ticks, is_long = int(np.sum(ticks)), ticks > 1.0
    share = float(np.mean(is_long))
    if share < _HELD or n_ticks > _DENSE * len(time) or np.max(np.abs(steps / tick - ticks)) > 0.1:
        return samples
    measured = [samples.channels[name] for name in ("displacement", "force")]
    changes = np.abs(np.diff(measured))
    quanta = np.array([[_quantum(row)] for row in changes])
    if not (np.all(quanta > 0.0) and np.all(changes.sum(axis=0) > 0.0)):
        return samples
    if np.mean(np.max(changes[:, is_long] / quanta / _QUANTA, axis=0) <= 1.0) < _SLOW:
        return samples
    rows = np.repeat(np.arange(len(time)), np.append(ticks, 1.0).astype(np.int64))
    sentence = (
        f"values are held until the next row, which is written when one changes by "
        f"{quanta[1, 0]:.3g} or {quanta[0, 0]:.3g} as logged: {n_ticks + 1 - len(time)} of "
        f"{n_ticks + 1} rows bridged"
    )
    finding = note("values_held", sentence, value=share, is_correction=True)
    bridged = {name: values[rows] for name, values in samples.channels.items()}
    bridged["time"] = time[0] + tick * np.arange(n_ticks + 1)
    place = samples.place
    return replace(_with(samples, finding, **bridged), place=lambda i: place(int(rows[i])))


def rate_of_stamps(time: FloatArray) -> str:
    """Return the rows a second where several rows share a stamp, in as few digits as it is known.

    Empty where stamps do not only repeat.
    """
    steps = np.diff(time)
    ahead = steps[steps > 0.0]
    if not len(ahead) or float(np.min(steps)) < 0.0:
        return ""
    span = float(time[-1] - time[0])
    rate, doubt = len(steps) / span, 2.0 * float(np.min(ahead)) / span
    texts = (f"{rate:.{digits}g}" for digits in range(1, 8))
    return next((f"{float(text):g}" for text in texts if abs(float(text) / rate - 1) <= doubt), "")


# Pieces of a record.


def buffer_ends(time: FloatArray) -> list[int]:
    """Return the rows after which a logger pauses at equal distances, as it writes its buffer."""
    steps = np.diff(time)
    if len(steps) < _FEWEST or not np.max(steps) > _GAP * float(np.mean(steps)):
        return []
    late = np.flatnonzero(steps > _GAP * median(steps))
    pieces = np.diff(np.concatenate(([-1], late)))
    is_steady = len(late) >= _FEWEST_PIECES and np.all(pieces == pieces[0])
    return late.tolist() if is_steady and len(time) - 1 - late[-1] <= pieces[0] else []


def steps_of_level(values: FloatArray, x: FloatArray) -> tuple[list[int], list[float]]:
    """Return the rows before which a signal steps to another level, and its levels; none elsewhere.

    A signal that drifts, swings or is noise has none. Levels at which the motion x stands are none
    of a test: a trigger, or a current that is off before and after it.
    """
    size = max(_SHORTEST, len(values) // _BLOCKS)
    n_blocks = len(values) // size
    if n_blocks < 4 or not np.isfinite(values.sum()):
        return [], []
    blocks = values[: n_blocks * size].reshape(n_blocks, size)
    level, noise = np.median(blocks, axis=1), median(np.std(blocks, axis=1))
    span = float(np.ptp(level))
    if not span > max(5.0 * noise, _FLAT * float(np.max(np.abs(level)))):
        return [], []
    jumps = np.flatnonzero(np.abs(np.diff(level)) > _STEP * span)
    jumps = jumps[np.diff(jumps, prepend=-3) > 2]  # one step may stand in two
    pieces = np.split(level, jumps + 1)
    inner = [piece[1:-1] if len(piece) > 4 else piece for piece in pieces]
    if not 0 < len(jumps) < _MOST_LEVELS or max(map(np.ptp, inner)) > _FLAT * span:
        return [], []
    starts = [int(k + np.argmax(np.abs(np.diff(values[k : k + 3 * size])))) for k in jumps * size]
    edges = [0, *(start + 1 for start in starts), len(values)]
    levels = [float(median(piece)) for piece in pieces]
    widths = [float(np.ptp(percentiles(x[i:stop], 25.0, 75.0))) for i, stop in pairwise(edges)]
    kept: list[int] = []
    for k, width in enumerate(widths):
        is_other = not kept or abs(levels[k] - levels[kept[-1]]) > _FLAT * span
        if width > _STANDS * max(widths) and is_other:
            kept.append(k)
    return [edges[k] for k in kept[1:]], [levels[k] for k in kept]


# One clock for all.


def _together(samples: Samples) -> Samples:
    """Return each channel at the times of the force: its own rows, interpolated where needed."""
    channels = samples.channels
    time = channels.get("time", np.arange(len(channels["force"]), dtype=np.float64))
    measured = [name for name in ("force", "displacement", *EXTRAS) if name in channels]
    times = {name: samples.times.get(name, time) for name in measured}
    own_rows = {name: _own_rows(channels[name], times[name]) for name in measured}
    for slow, fast in (("force", "displacement"), ("displacement", "force")):
        values = channels[fast]  # between two of its own rows, a row of the slow one alone
        if own_rows[fast].all() and len(values) == len(own_rows[slow]):
            own_rows[fast] = ~(np.isnan(values) & own_rows[slow] & ~own_rows[slow].all())
    force = times["force"]
    resampled = [
        name
        for name, t in times.items()
        if not own_rows[name].all() or not (t is force or np.array_equal(t, force))
    ]
    if not resampled:
        return samples
    if not samples.times and all(np.array_equal(x, own_rows["force"]) for x in own_rows.values()):
        resampled = []  # rows that are blank in all channels
    stamps = {name: times[name][own_rows[name]] for name in measured}
    if not all(len(t) > 1 and np.all(np.diff(t) > 0.0) for t in stamps.values()):
        return samples if not samples.times else replace(samples, times={})
    needed = [stamps[name] for name in measured if name not in EXTRAS]
    slack = 1e-6 * float(np.min(np.diff(stamps["force"])))  # starts are differences of stamps
    start, end = max(t[0] for t in needed) - slack, min(t[-1] for t in needed) + slack
    is_kept = own_rows["force"] & (force >= start) & (force <= end)
    if samples.times and np.count_nonzero(is_kept) < _COMMON * np.count_nonzero(own_rows["force"]):
        spans = ", ".join(f"{name} from {t[0]:g} to {t[-1]:g} s" for name, t in stamps.items())
        text = f"channels of different rate or start: {spans}; log them together"
        raise LogError(text, code="bad-clock")
    at = np.flatnonzero(is_kept)
    together = {name: values[at] for name, values in channels.items() if len(values) == len(time)}
    for name in resampled:
        together[name] = np.interp(force[at], stamps[name], channels[name][own_rows[name]])
    if "time" in channels:
        together["time"] = force[at]
    findings = []
    for name in resampled:
        t, n = stamps[name], len(own_rows[name])
        sentence = f"a value of its own in {len(t)} of {n} rows"
        if len(t) == n:
            sentence = f"a clock of its own, every {median(np.diff(t)):.6g} s from {t[0]:.6g} s"
        sentence = f"{name}: {sentence}; each value is used once, at the times of the force"
        findings.append(note("own_rows", sentence, value=len(t) / n, is_correction=True))
    return Samples(
        together,
        lambda i: samples.place(int(at[i])),
        findings=(*samples.findings, *findings),
        notes=samples.notes,
    )


def _own_rows(values: FloatArray, time: FloatArray) -> NDArray[np.bool_]:
    """Return the rows in which a slow channel has a value of its own; all of any other channel."""
    every, is_own = np.ones(len(values), dtype=np.bool_), ~np.isnan(values)
    at = np.flatnonzero(is_own)
    if np.isfinite(values.sum()) or len(at) < 2:
        return every
    # A shorter channel beside a longer one ends in rows without time and value.
    n_there = int(np.flatnonzero(is_own | ~np.isnan(time))[-1]) + 1
    is_tail = n_there == len(at) < len(values)
    is_slow = len(at) <= (1.0 - _BLANK) * len(values) and int(np.max(np.diff(at))) <= _LONGEST
    return is_own if is_slow or is_tail else every
