"""Logs that hold one speed, or a few: what triangle waves cannot tell.

At constant speed a stroke shows one level of force, and two levels cannot tell R_m1, R_m2, R_m3 and
f_f. What is left are the corners, a few milliseconds in which the elasticity of the oil settles; a
descent finds a minimum there that is several of its errors away from the truth. Six levels, of
three speeds, do not tell the eight numbers of two valves, a friction and an offset either: above
the knee of both curves a friction and a preload make one level.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from damperfit.damper.quantity import GAS_AMOUNT, RIG, STIFFNESS
from damperfit.statistics import mean_of, median

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from damperfit.damper.quantity import Quantity
    from damperfit.identification.fit_facts import FitFacts
    from damperfit.recording import Trace

    FloatArray = NDArray[np.float64]

__all__ = ["holds_one_speed", "inseparable", "n_speeds", "said_of_speeds"]

_ONE_SPEED = (
    "the logs hold one speed, so that the valves and friction cannot be separated: "
    "add a log or a stretch at another speed, or hold one valve and the friction (--fix)."
)

_FEW_SPEEDS = (
    "the logs hold {} speeds: their {} levels of force do not determine {} numbers of valves, "
    "friction and offset, and only the corners separate a friction from a preload: add a test at "
    "another speed, below the knee of the force."
)

_LEVELS = 2  # of a speed, one in rebound, one in bump
_NEAR = 0.1  # of the speed
# Of the samples. A triangle has 0.96 and more, a sine 0.29; beside 10 % of another speed 0.9.
_SHARE = 0.9


def inseparable(
    facts: FitFacts, free: Sequence[str], quantities: Sequence[Quantity]
) -> tuple[str, ...]:
    """Return the free parameters that logs of one speed cannot separate; none where they can.

    Parameters
    ----------
    facts : FitFacts
        Of the logs of a setting.
    free : sequence of str
        What is fitted.
    quantities : sequence of Quantity
        Of the model. The stiffness of the oil shows in the corners.
    """
    unknown = [one for one in quantities if one.name in free and one.role != STIFFNESS]
    if len(unknown) <= _LEVELS:
        return ()
    return tuple(free) if facts.holds_one_speed else ()


def holds_one_speed(traces: Sequence[Trace]) -> bool:
    """Return whether nearly all compared samples of logs are at one speed, either way."""
    speed = np.abs(np.concatenate([trace.drive.velocity[trace.compared] for trace in traces]))
    # No band is wide enough for the slow and the fast samples. Where one speed would leave fewer
    # outside than either are, as under a sine, the answer needs no median, which takes far longer.
    mean = mean_of(speed)
    parts = speed < mean * ((1.0 - _NEAR) / (1.0 + _NEAR)) ** 2, speed > mean
    if min(map(np.count_nonzero, parts)) > (1.0 - _SHARE) * len(speed) + 1.0:
        return False
    return _speed_held(speed) is not None


def _speed_held(speed: FloatArray) -> float | None:
    """Return the speed at which nearly all samples are; None where there is none."""
    usual = median(speed)
    is_held = mean_of(np.abs(speed - usual) <= _NEAR * usual) > _SHARE
    return usual if is_held else None


def n_speeds(traces: Sequence[Trace]) -> int | None:
    """Return how many speeds the stretches of logs hold; None where one holds none."""
    speeds: list[float] = []
    for trace in traces:
        for stretch in trace.stretches:
            held = _speed_held(np.abs(trace.drive.velocity[stretch.window]))
            if held is None:
                return None
            if all(abs(held / other - 1.0) > _NEAR for other in speeds):
                speeds.append(held)
    return len(speeds)


def said_of_speeds(
    facts: FitFacts, free: Sequence[str], quantities: Sequence[Quantity]
) -> tuple[str, ...]:
    """Return what is to be said of logs that hold one speed, or too few for what is fitted.

    Parameters
    ----------
    facts : FitFacts
        Of the logs of a setting.
    free : sequence of str
        What is fitted.
    quantities : sequence of Quantity
        Of the model. Stiffness, gas and mounting show in the corners and along the stroke.
    """
    if inseparable(facts, free, quantities):
        return (_ONE_SPEED,)
    unknown = [
        one
        for one in quantities
        if one.name in free
        and (one.is_offset or one.scope != RIG)
        and one.role not in {STIFFNESS, GAS_AMOUNT}
    ]
    if len(unknown) <= 2 * _LEVELS:  # two speeds determine them, and one was asked for above
        return ()
    n = facts.n_speeds
    if n is None or _LEVELS * n >= len(unknown):
        return ()
    return (_FEW_SPEEDS.format(n, _LEVELS * n, len(unknown)),)
