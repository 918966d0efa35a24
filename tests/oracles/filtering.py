"""Gains of filters by the formula."""

import math


def butterworth_gain(frequency, *, corner, sample_rate, order):
    """|H| of one pass of a Butterworth filter made by the bilinear transform."""
    ratio = math.tan(math.pi * frequency / sample_rate) / math.tan(math.pi * corner / sample_rate)
    return 1.0 / math.sqrt(1.0 + ratio ** (2 * order))
