"""Read off a loop: signals where a velocity passes given speeds, and the work of a cycle."""

from collections.abc import Sequence

import numpy as np

from damperfit.arrays import FloatArray
from damperfit.compiled_core import compiled_core


def in_both_strokes(
    velocity: FloatArray,
    signals: FloatArray,
    speeds: Sequence[float],
    *,
    signs: tuple[float, ...] = (1.0, -1.0),
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return counts, means and scatter of signals where the velocity passes rising speeds.

    Between two samples signals, shape (k, n), and velocity, shape (n,), are straight lines. The
    first index of what is returned is 0 in rebound and 1 in compression, or that of another choice
    of signs of the velocity. The second is 0 on the way up to a speed and beyond (the opening
    branch of a stroke), 1 on the way down again (the closing one).

    >>> v, signals = np.array([0.0, 2.0, 0.0]), np.array([[0.0, 4.0, 6.0]])
    >>> counts, means, _ = in_both_strokes(v, signals, [1.0], signs=(1.0,))
    >>> counts.tolist(), means.tolist()
    ([[[1.0], [1.0]]], [[[[2.0]], [[5.0]]]])
    """
    rows = np.ascontiguousarray(signals, dtype=np.float64)
    along = np.ascontiguousarray(velocity, dtype=np.float64)
    asked = np.array(speeds, dtype=np.float64)
    counts = np.empty((len(signs), 2, len(asked)))
    means, squares = np.empty((2, len(signs), 2, len(asked), len(rows)))
    for k, sign in enumerate(signs):
        compiled_core().at_speeds(along, asked, rows, counts[k], means[k], squares[k], sign)
    if not counts.all():
        means[counts == 0.0] = np.nan
    return counts, means, squares


def cycle_energies(
    velocity: FloatArray, force: FloatArray, edges: FloatArray, interval: float
) -> FloatArray:
    """Return the work that a force does in each cycle, J: the one integral behind every energy.

    The power f v is integrated from boundary to boundary, which lie between samples, interval s
    apart. On a sine this is the polygon of force over displacement with its sinc correction; other
    than the polygon it is right for other waves too.
    """
    power = velocity * force
    work = np.concatenate([[0.0], np.cumsum(0.5 * (power[1:] + power[:-1]))])
    before = np.clip(np.floor(edges).astype(np.int64), 0, len(power) - 2)
    share = edges - before
    rise = power[before + 1] - power[before]
    energies: FloatArray = interval * np.diff(
        work[before] + share * (power[before] + 0.5 * share * rise)
    )
    return energies
