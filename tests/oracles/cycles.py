"""What `core/cycles.c` reads off motions, the slow way: arrays, a step at a time."""

from __future__ import annotations

from itertools import pairwise

import numpy as np


def crossings(offset, velocity, hysteresis):
    """Fractional positions where the offset rises through zero, from -h to +h."""
    outside = np.flatnonzero(np.abs(offset) > hysteresis)
    is_above = offset[outside] > 0.0
    reached = outside[1:][is_above[1:] & ~is_above[:-1]]
    below = offset < 0.0
    candidates = np.flatnonzero(below[:-1] & ~below[1:])
    before = candidates[np.searchsorted(candidates, reached) - 1] if len(reached) else reached
    y0, y1, v0, v1 = offset[before], offset[before + 1], velocity[before], velocity[before + 1]
    c2, c3 = 3.0 * (y1 - y0) - 2.0 * v0 - v1, 2.0 * (y0 - y1) + v0 + v1
    chord = y1 - y0
    u = -y0 / chord
    for _ in range(4):
        slope = v0 + u * (2.0 * c2 + 3.0 * c3 * u)
        slope = np.where(slope > 0.2 * chord, slope, chord)
        u = np.clip(u - (y0 + u * (v0 + u * (c2 + c3 * u))) / slope, 0.0, 1.0)
    return before + u


def tops(offset, velocity, boundaries):
    """The top of each cycle: that of the Hermite piece beside its highest sample."""
    cuts = np.ceil(boundaries).astype(np.int64)
    highest = np.array(
        [start + np.argmax(offset[start : max(stop, start + 1)]) for start, stop in pairwise(cuts)]
    )
    left = np.clip(np.where(velocity[highest] > 0.0, highest, highest - 1), 0, len(offset) - 2)
    y0, y1, v0, v1 = offset[left], offset[left + 1], velocity[left], velocity[left + 1]
    c2, c3 = 3.0 * (y1 - y0) - 2.0 * v0 - v1, 2.0 * (y0 - y1) + v0 + v1
    root = np.sqrt(np.maximum(c2 * c2 - 3.0 * c3 * v0, 0.0)) - c2
    u = np.clip(np.divide(v0, root, out=np.zeros_like(v0), where=root > 0.0), 0.0, 1.0)
    return np.maximum(offset[highest], y0 + u * (v0 + u * (c2 + c3 * u)))


def turning_points(x, reach):
    """Samples at which the motion turns, valleys and peaks by turns, looked at one by one."""
    turns = []
    low = high = rising = 0
    for k, value in enumerate(x.tolist()):
        high = k if value > x[high] else high
        low = k if value < x[low] else low
        if rising >= 0 and x[high] - value > reach:
            turns.append(high)
            rising, low, high = -1, k, k
        elif rising <= 0 and value - x[low] > reach:
            turns.append(low)
            rising, low, high = 1, k, k
    return np.array(turns, dtype=np.int64)


def passages(x, turns):
    """Where each way from turn to turn passes its middle."""
    found = []
    for begin, end in pairwise(turns.tolist()):
        sign = 1.0 if x[end] > x[begin] else -1.0
        stroke = sign * (x[begin : end + 1] - 0.5 * (x[begin] + x[end]))
        at = int(np.argmax(stroke >= 0.0))
        found.append(begin + at - stroke[at] / (stroke[at] - stroke[at - 1]))
    return np.array(found)


def folded(values, starts, phases):
    """Values at each phase of each cycle by the cubic through four samples, and the weights."""
    positions = starts[:-1, None] + np.diff(starts)[:, None] * phases
    index = np.clip(np.floor(positions).astype(np.int64), 1, len(values) - 3) - 1
    u = positions - index - 1
    weights = [
        -u * (u - 1.0) * (u - 2.0) / 6.0,
        (u + 1.0) * (u - 1.0) * (u - 2.0) / 2.0,
        -(u + 1.0) * u * (u - 2.0) / 2.0,
        (u + 1.0) * u * (u - 1.0) / 6.0,
    ]
    return sum(weight * values[index + k] for k, weight in enumerate(weights)), weights


def beside(x, v, f, starts, n_phases):
    """Products of what x, v, its square and f of each cycle differ by from the mean cycle."""
    phases = np.arange(n_phases) / n_phases
    rows = np.stack([folded(values, starts, phases)[0] for values in (x, v, v * np.abs(v), f)])
    off = (rows - rows.mean(axis=1, keepdims=True)).reshape(4, -1)
    return off @ off.T


def cycle_means(values, starts):
    """Mean of the straight lines through samples between boundaries."""
    total = np.concatenate([[0.0], np.cumsum(0.5 * (values[1:] + values[:-1]))])
    at = np.clip(np.floor(starts).astype(np.int64), 0, len(values) - 2)
    u = starts - at
    reached = total[at] + u * values[at] + 0.5 * u**2 * (values[at + 1] - values[at])
    return np.diff(reached) / np.diff(starts)


def equal_runs(values, fewest):
    """First and stop of each row of equal samples."""
    edges = [0, *(np.flatnonzero(np.diff(values) != 0.0) + 1).tolist(), len(values)]
    return [run for run in pairwise(edges) if run[1] - run[0] >= fewest]


def without_smooth(lag, force, reach, kink):
    """A smooth curve of the lag, taken out of a force by its columns made square to each other."""
    z = lag / reach
    columns = [np.ones_like(z), z, z**2, z**3]
    if kink is not None:
        bent = z - kink / reach
        columns += [np.abs(bent), bent * np.abs(bent)]
    basis = np.linalg.qr(np.stack(columns, axis=-1))[0]
    return basis, force - basis @ (basis.T @ force)


def steps_left(lag, basis, rest, delays, width):
    """What steps leave of the power of a rest, and their heights, one delay at a time."""
    left, heights = [], []
    for delay in delays:
        step = np.tanh((lag - delay) / width) if width else np.sign(lag - delay)
        step = step - basis @ (basis.T @ step)
        height = (step @ rest) / (step @ step)
        heights.append(height)
        left.append(np.sum((rest - height * step) ** 2))
    return left, heights


def outstanding(values):
    """Each sample less the median of the five around it; 0 at the ends."""
    result = np.zeros_like(values)
    for k in range(2, len(values) - 2):
        result[k] = values[k] - np.median(values[k - 2 : k + 3])
    return result


def harmonic_powers(values, mean, angle, n_powers):
    """Squares of the means of a signal turned by k angles a sample."""
    wave = np.exp(1j * angle * np.arange(len(values)))
    return [abs(np.mean((values - mean) * wave**k)) ** 2 for k in range(1, n_powers + 1)]


def at_speed(velocity, signal, speed):
    """The signal each time the velocity rises to a speed or beyond, and each time it falls."""
    found = [], []
    for v, w, a, b in zip(velocity, velocity[1:], signal, signal[1:], strict=False):
        if (v < speed) != (w < speed):
            share = (speed - v) / (w - v)
            found[int(w < speed)].append(a + share * (b - a))
    return found
