"""How strong the harmonics of a motion are in a channel."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from damperfit.compiled_core import compiled_core
from damperfit.statistics import mean_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]

__all__ = ["harmonic_powers"]


def harmonic_powers(values: FloatArray, turns: float, n_powers: int) -> FloatArray:
    """Return the power of the harmonics of a motion in whole cycles of a channel.

    Parameters
    ----------
    values : numpy.ndarray
        Shape (n,); its mean is taken off.
    turns : float
        Turns of the motion in a sample.
    n_powers : int
        As many, from the first on; 16 at most.

    Returns
    -------
    numpy.ndarray
        Shape (n_powers,), a quarter of the square of each one's amplitude.

    Examples
    --------
    >>> angle = 2.0 * np.pi * np.arange(300) / 100
    >>> harmonic_powers(2.0 * np.sin(angle) + 0.2 * np.sin(3.0 * angle), 0.01, 3).round(6)
    array([1.  , 0.  , 0.01])
    """
    powers = np.empty(n_powers)
    samples = np.ascontiguousarray(values, np.float64)
    mean = mean_of(samples)
    compiled_core().harmonics(samples, powers, mean, 2.0 * np.pi * turns)
    return powers
