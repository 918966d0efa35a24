"""Velocity: the derivative of the cubic spline through the displacement samples.

With not-a-knot ends, exact for polynomials up to third degree. Inside, on a uniform grid of
interval h, the spline differentiates a sine of angular frequency w with the gain::

    G(w) = 3 sin(w h) / (w h (2 + cos(w h))) = 1 - (w h)^4/180 - ...        (phase: none)

At 1 kHz that is 1 - 4.4e-11 at 1.5 Hz and 1 - 8.7e-8 at 10 Hz; at 100 Hz, 1 - 4.4e-7 at 1.5 Hz
and 1 - 9.1e-4 at 10 Hz. White noise of s (rms, m) in the samples becomes 1.180 s/h (rms, m/s);
behind the 30 Hz filter at 1 kHz, where the displacement noise itself has fallen to 0.245 s, 28.0 s
(s in m, per second). The C core takes x and v as cubic Hermite pieces, which are then this spline.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from damperfit.compiled_core import compiled_core

if TYPE_CHECKING:
    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]

__all__ = ["differentiate"]


def differentiate(displacement: FloatArray, interval: float) -> FloatArray:
    """Return the slope of the not-a-knot cubic spline at its samples.

    Parameters
    ----------
    displacement : numpy.ndarray
        Shape (n,), n >= 4; m, uniformly sampled.
    interval : float
        s.

    Returns
    -------
    numpy.ndarray
        Shape (n,); m/s.

    Examples
    --------
    >>> import numpy as np
    >>> t = np.arange(6) * 0.5
    >>> np.allclose(differentiate(t**3, 0.5), 3 * t**2)
    True
    """
    samples = np.ascontiguousarray(displacement, dtype=np.float64)
    slopes = np.empty(len(samples))
    compiled_core().spline_slopes(samples, slopes, np.empty(len(samples)))
    slopes /= interval
    return slopes
