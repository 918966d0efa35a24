"""Filters the slow way: gains by the formula and by least squares."""

import math

import numpy as np


def butterworth_gain(frequency, *, corner, sample_rate, order):
    """|H| of one pass of a Butterworth filter made by the bilinear transform."""
    ratio = math.tan(math.pi * frequency / sample_rate) / math.tan(math.pi * corner / sample_rate)
    return 1.0 / math.sqrt(1.0 + ratio ** (2 * order))


def measured_gain_and_phase(signal, *, frequency, sample_rate, window):
    """Amplitude and phase (degrees) of a sine in a window, by least squares."""
    t = np.arange(len(signal))[window] / sample_rate
    angle = 2.0 * np.pi * frequency * t
    basis = np.column_stack([np.sin(angle), np.cos(angle), np.ones_like(angle)])
    a, b, _ = np.linalg.lstsq(basis, signal[window], rcond=None)[0]
    return math.hypot(a, b), math.degrees(math.atan2(b, a))
