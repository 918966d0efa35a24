"""How many samples of a residual count: what a model leaves over is not white.

n_eff = 2 (sum p_h)^2/sum p_h^2 with p_h the power at the h-th harmonic of the cycle, at least 20 a
stretch; the number of samples would be ten times too large.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]

__all__ = ["FEWEST_SAMPLES", "effective_samples"]

FEWEST_SAMPLES = 20.0  # effective ones, of a stretch


def effective_samples(residuals: FloatArray, n_cycles: int) -> float:
    """Return the effective number of samples of one stretch.

    Parameters
    ----------
    residuals : numpy.ndarray
        Shape (n,), over whole cycles.
    n_cycles : int
        How many; 1 where nothing repeats.

    Examples
    --------
    A residual of one harmonic alone counts as few samples as a stretch may have.

    >>> effective_samples(np.sin(np.linspace(0.0, 40.0 * np.pi, 2000)), 20)
    20.0
    """
    power = np.abs(np.fft.rfft(residuals)) ** 2
    lines = power[n_cycles::n_cycles]
    whole = float(np.sum(lines))
    if whole <= 0.0:
        return FEWEST_SAMPLES
    return max(2.0 * whole**2 / float(np.sum(lines**2)), FEWEST_SAMPLES)
