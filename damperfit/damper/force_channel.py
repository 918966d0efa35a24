"""The lag of the force channel: an amplifier's filter, first order, T df_read/dt + f_read = f.

It stands behind the damper and its mounting, so it is no state of the compiled core: the simulated
force passes it, and so does each of its derivatives. Between the samples the force is taken as a
straight line, for which the step below is exact whatever the lag is against the interval::

    g_k = a g_k-1 + b f_k + c f_k-1     q = h/T,  a = e^-q,  m = (1 - a)/q,  b = 1 - m,  c = m - a
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from damperfit.compiled_core import compiled_core

if TYPE_CHECKING:
    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]

__all__ = ["behind_lag", "lag_slope"]

# A lag of less than this share of the interval changes no sample by its last digit.
_NO_LAG = 1e-3


def behind_lag(rows: FloatArray, interval: float, lag: float) -> FloatArray:
    """Return signals behind a first-order lag, at rest before the first sample.

    Parameters
    ----------
    rows : numpy.ndarray
        Shape (k, n), one signal a row.
    interval : float
        Between the samples, s.
    lag : float
        T, s; 0 passes everything.

    Examples
    --------
    >>> step = np.array([[0.0, 1.0, 1.0, 1.0]])
    >>> behind_lag(step, 1.0, 1.0).round(3)
    array([[0.   , 0.368, 0.767, 0.914]])
    """
    if lag <= _NO_LAG * interval:
        return rows
    rows = np.ascontiguousarray(rows, dtype=np.float64)
    found = np.empty_like(rows)
    compiled_core().behind_lag(rows, found, len(rows), *_coefficients(interval / lag))
    return found


def lag_slope(
    force: FloatArray, interval: float, lag: float, *, read: FloatArray | None = None
) -> FloatArray:
    """Return the derivative of a signal behind a lag by the lag, per second.

    Parameters
    ----------
    force : numpy.ndarray
        Shape (n,), before the lag.
    interval, lag : float
        As of `behind_lag`, the lag above 0.
    read : numpy.ndarray, optional
        Shape (n,), the same behind the lag, where it is at hand.
    """
    lag = max(lag, _NO_LAG * interval)
    q = interval / lag
    force = np.ascontiguousarray(force, dtype=np.float64)
    if read is None:
        read = behind_lag(force[None, :], interval, lag)[0]
    a = math.exp(-q)
    by_a = a * q / lag
    by_mean = (1.0 - a) / interval - by_a / q
    found = np.empty_like(force)
    compiled_core().lag_slope(force, np.ascontiguousarray(read), found, a, by_a, by_mean)
    return found


def _coefficients(q: float) -> tuple[float, float, float]:
    a = math.exp(-q)
    mean = -math.expm1(-q) / q
    return a, 1.0 - mean, mean - a
