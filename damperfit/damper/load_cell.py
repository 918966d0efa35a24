"""What a load cell and its channel make of a damper's force: moving mass, then the lag.

Neither is a state of the compiled core: both stand behind the damper and its mounting. What moves
between load cell and damper takes its mass times the acceleration, f_cell = f + m a, positive in
rebound as f is. The mounting's give is left out of a: 3 % at a sixth of the frequency at which the
mass rings on it. The channel behind the cell, an amplifier's filter, is late by T df_read/dt +
f_read = f, and so is each derivative of the force. Between the samples the force is taken as a
straight line, for which the step below is exact whatever the lag is against the interval::

    g_k = a g_k-1 + b f_k + c f_k-1     q = h/T,  a = e^-q,  m = (1 - a)/q,  b = 1 - m,  c = m - a
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from damperfit.arrays import FloatArray
from damperfit.compiled_core import compiled_core
from damperfit.recording import Trace
from damperfit.simulation import Motion, Response

OF_LOAD_CELL = ("moving_mass", "lag")

# A lag of less than this share of the interval changes no sample by its last digit.
_NO_LAG = 1e-3


def behind_lag(rows: FloatArray, interval: float, lag: float) -> FloatArray:
    """Return signals, a row of (k, n) each, behind a first-order lag, at rest before the first.

    Interval and lag are in s; a lag of 0 passes everything.

    Examples
    --------
    >>> step = np.array([[0.0, 1.0, 1.0, 1.0]])
    >>> behind_lag(step, 1.0, 1.0).round(3)
    array([[0.   , 0.368, 0.767, 0.914]])
    """
    if lag <= _NO_LAG * interval:
        return rows
    rows = np.ascontiguousarray(rows, dtype=np.float64)
    late = np.empty_like(rows)
    q = interval / lag
    a, mean = math.exp(-q), -math.expm1(-q) / q
    compiled_core().behind_lag(rows, late, len(rows), a, 1.0 - mean, mean - a)
    return late


def lag_slope(
    force: FloatArray, interval: float, lag: float, *, read: FloatArray | None = None
) -> FloatArray:
    """Return the derivative of a signal behind a lag by the lag, per second, both of shape (n,).

    `read` is the same signal behind the lag, where it is at hand.
    """
    lag = max(lag, _NO_LAG * interval)
    q = interval / lag
    if read is None:
        read = behind_lag(force[None, :], interval, lag)[0]
    a = math.exp(-q)
    by_a = a * q / lag
    by_mean = (1.0 - a) / interval - by_a / q
    driven, slope = np.zeros((2, 1, len(force)))
    driven[0, 1:] = by_a * (read[:-1] - force[:-1]) - by_mean * np.diff(force)
    compiled_core().behind_lag(driven, slope, 1, a, 1.0, 0.0)
    return np.asarray(slope[0])


def acceleration(velocity: FloatArray, interval: float) -> FloatArray:
    """Return the acceleration at uniform samples of a velocity, m/s2; 0 of a single sample.

    The difference of the speeds beside a sample, so that a jump of the speed keeps its momentum.

    Examples
    --------
    >>> acceleration(np.array([0.0, 0.1, 0.4, 0.9]), 0.1).round(12)
    array([0., 2., 4., 6.])
    """
    if len(velocity) == 1:
        return np.zeros(1)
    at_ends: Literal[1, 2] = 1 if len(velocity) == 2 else 2
    return np.asarray(np.gradient(np.asarray(velocity), interval, edge_order=at_ends))


def as_read(
    response: Response,
    motion: Motion,
    sensitivities: Sequence[str],
    *,
    moving_mass: float | None = None,
    lag: float | None = None,
) -> Response:
    """Return a response with the force, and the wanted derivatives in their order, as logged.

    The response is that of the damper on its mounting, with the sensitivities that the core has;
    kg and s; None: the model has none.
    """
    force, slopes = response.force, dict(response.sensitivities)
    if moving_mass is not None:
        slopes["moving_mass"] = acceleration(motion.velocity, motion.interval)
        force = force + moving_mass * slopes["moving_mass"]
    slopes = {name: slopes[name] for name in sensitivities if name in slopes}
    if lag is not None:
        before, rows = force, np.stack([force, *slopes.values()])
        late = behind_lag(rows, motion.interval, lag)
        force, slopes = late[0], dict(zip(slopes, late[1:], strict=True))
        if "lag" in sensitivities:
            read = force if late is not rows else None
            slopes["lag"] = lag_slope(before, motion.interval, lag, read=read)
    ordered = {name: slopes[name] for name in sensitivities}
    return replace(response, force=force, sensitivities=ordered)


def before_load_cell(trace: Trace, *, moving_mass: float = 0.0, lag: float = 0.0) -> Trace:
    """Return a log with the force that the damper had, of that which was logged; kg and s."""
    force = trace.force
    if lag:
        force = force + lag * np.gradient(force, trace.interval)
    if moving_mass:
        force = force - moving_mass * acceleration(trace.velocity, trace.interval)
    return trace if force is trace.force else replace(trace, force=force)
