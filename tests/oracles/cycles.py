"""What conditioning reads off motions, the slow way: arrays, a step at a time."""

from itertools import pairwise

import numpy as np


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


def at_speed(velocity, signal, speed):
    """The signal each time the velocity rises to a speed or beyond, and each time it falls."""
    found = [], []
    for v, w, a, b in zip(velocity, velocity[1:], signal, signal[1:], strict=False):
        if (v < speed) != (w < speed):
            share = (speed - v) / (w - v)
            found[int(w < speed)].append(a + share * (b - a))
    return found
