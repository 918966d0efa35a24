"""Filters the slow way: difference equations sample by sample, and gains by the formula."""

import math

import numpy as np


def butterworth_gain(frequency, *, corner, sample_rate, order):
    """|H| of one pass of a Butterworth filter made by the bilinear transform."""
    ratio = math.tan(math.pi * frequency / sample_rate) / math.tan(math.pi * corner / sample_rate)
    return 1.0 / math.sqrt(1.0 + ratio ** (2 * order))


def run_forward(sections, signal):
    """Each section's difference equation from rest: y = b0 x + b1 x' + b2 x'' - a1 y' - a2 y''."""
    values = [float(s) for s in signal]
    for b0, b1, b2, _, a1, a2 in sections:
        x1 = x2 = y1 = y2 = 0.0
        for k, x in enumerate(values):
            y = b0 * x + b1 * x1 + b2 * x2 - a1 * y1 - a2 * y2
            values[k] = y
            x1, x2, y1, y2 = x, x1, y, y1
    return np.array(values)


def measured_gain_and_phase(signal, *, frequency, sample_rate, window):
    """Amplitude and phase (degrees) of a sine in a window, by least squares."""
    t = np.arange(len(signal))[window] / sample_rate
    angle = 2.0 * np.pi * frequency * t
    basis = np.column_stack([np.sin(angle), np.cos(angle), np.ones_like(angle)])
    a, b, _ = np.linalg.lstsq(basis, signal[window], rcond=None)[0]
    return math.hypot(a, b), math.degrees(math.atan2(b, a))
