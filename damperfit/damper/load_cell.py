"""What a load cell and its channel make of a damper's force: moving mass, then the lag.

Neither is a state of the compiled core. What moves between load cell and damper takes its mass
times the acceleration, f_cell = f + m a, positive in rebound as f is. The mounting's give is left
out of a: 3 % at a sixth of the frequency at which the mass rings on it. The channel behind the cell
is late by a first-order filter: `damperfit.damper.force_channel`.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from damperfit.damper.force_channel import behind_lag, lag_slope

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from damperfit.damper.model import Values
    from damperfit.recording import Trace
    from damperfit.simulation import Motion, Response

    FloatArray = NDArray[np.float64]

__all__ = ["OF_LOAD_CELL", "acceleration", "as_read", "before_load_cell"]

OF_LOAD_CELL = ("moving_mass", "lag")


def acceleration(velocity: FloatArray, interval: float) -> FloatArray:
    """Return the acceleration at uniform samples of a velocity.

    The difference of the speeds beside a sample, so that a jump of the speed keeps its momentum.

    Parameters
    ----------
    velocity : numpy.ndarray
        Shape (n,), m/s.
    interval : float
        Between the samples, s.

    Returns
    -------
    numpy.ndarray
        Shape (n,), m/s2; 0 of a single sample.

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
    response: Response, motion: Motion, values: Values, sensitivities: Sequence[str]
) -> Response:
    """Return a response with the force, and its derivatives, as they are logged.

    Parameters
    ----------
    response : Response
        Of the damper on its mounting, with the sensitivities that the core has.
    motion : Motion
        What drives it.
    values : Values
        Of these `moving_mass` and `lag` are taken, where the model has them.
    sensitivities : sequence of str
        Which are wanted, in this order.
    """
    force, slopes = response.force, dict(response.sensitivities)
    if "moving_mass" in values.names:
        by_mass = acceleration(motion.velocity, motion.interval)
        force = force + values.moving_mass * by_mass
        if "moving_mass" in sensitivities:
            slopes["moving_mass"] = by_mass
    if "lag" in values.names:
        before, rows = force, np.stack([force, *slopes.values()])
        late = behind_lag(rows, motion.interval, values.lag)
        force, slopes = late[0], dict(zip(slopes, late[1:], strict=True))
        if "lag" in sensitivities:
            read = force if late is not rows else None
            slopes["lag"] = lag_slope(before, motion.interval, values.lag, read=read)
    return replace(response, force=force, sensitivities={one: slopes[one] for one in sensitivities})


def before_load_cell(trace: Trace, *, moving_mass: float = 0.0, lag: float = 0.0) -> Trace:
    """Return a log with the force that the damper had, of that which was logged.

    Parameters
    ----------
    trace : Trace
        The log.
    moving_mass : float
        Of what moves between load cell and damper, kg.
    lag : float
        Of the force channel, s.
    """
    force = trace.force
    if lag:
        force = force + lag * np.gradient(force, trace.interval)
    if moving_mass:
        force = force - moving_mass * acceleration(trace.velocity, trace.interval)
    return trace if force is trace.force else replace(trace, force=force)
