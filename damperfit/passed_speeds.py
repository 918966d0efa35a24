"""What signals are where a velocity passes given speeds, by the compiled core."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from damperfit.compiled_core import compiled_core

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]

__all__ = ["at_speeds"]


def at_speeds(
    velocity: FloatArray, signals: FloatArray, speeds: Sequence[float], *, sign: float = 1.0
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return counts, means and scatter of signals where the velocity passes speeds.

    Between two samples signals and velocity are straight lines. The first index of what is
    returned is 0 on the way up to a speed and beyond (the opening branch of a stroke), 1 on the
    way down again (the closing one).

    Parameters
    ----------
    velocity : numpy.ndarray
        Shape (n,), n of one at least.
    signals : numpy.ndarray
        Shape (k, n).
    speeds : sequence of float
        Rising.
    sign : float
        -1 for the speeds of the other stroke.

    Returns
    -------
    counts : numpy.ndarray
        Shape (2, number of speeds): how often each was passed.
    means : numpy.ndarray
        Shape (2, number of speeds, k); NaN where a speed was never passed so.
    squares : numpy.ndarray
        Same shape, sums of squares about the means.

    Examples
    --------
    >>> counts, means, _ = at_speeds(np.array([0.0, 2.0, 0.0]), np.array([[0.0, 4.0, 6.0]]), [1.0])
    >>> counts.tolist(), means.tolist()
    ([[1.0], [1.0]], [[[2.0]], [[5.0]]])
    """
    rows = np.ascontiguousarray(signals, dtype=np.float64)
    counts = np.empty((2, len(speeds)))
    means, squares = np.empty((2, 2, len(speeds), len(rows)))
    compiled_core().at_speeds(
        np.ascontiguousarray(velocity, dtype=np.float64),
        np.array(speeds, dtype=np.float64), rows, counts, means, squares, sign,
    )  # fmt: skip
    if not counts.all():
        means[counts == 0.0] = np.nan
    return counts, means, squares
