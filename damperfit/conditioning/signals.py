"""What several steps ask of a signal: its noise, and where something lasts."""

import math

import numpy as np
from numpy.typing import NDArray

from damperfit.statistics import median

BoolArray = NDArray[np.bool_]
FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


def noise_of(values: FloatArray) -> float:
    """Return the standard deviation of white noise in a smooth signal, robustly."""
    # Fifth differences of white noise are sqrt(252) larger; of a motion with 40 samples a cycle,
    # 1e-4 of it.
    middle = median(np.abs(np.diff(np.asarray(values, np.float64), 5)))
    return middle / (0.6745 * math.sqrt(252.0))


def parts_where(is_so: BoolArray) -> tuple[IntArray, IntArray]:
    """Return first and stop of each part in which something holds."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], is_so, [False]])))
    return edges[::2], edges[1::2]
