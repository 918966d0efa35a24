"""Which of a run's cycles are one and the same test: a cycle that leads over to another is not.

Cycles whose neighbours are alike may still drift from one speed to another, or end with a cycle of
another frequency. So a run is cut where a cycle leaves the level of those before it, by more than
1 % of the period or 2 % of the amplitude (rigs repeat a period to 0.3 %), or by what this rig's
cycles scatter, if that is more. Parts that keep their level are the tests, where they are half of
the run and more; a part of a sweep uses up its whole allowance by drifting. A run that wanders
without levels is one test of an unsteady rig as long as it stays within twice the steadiness, else
a sweep. At last half strokes are taken off both ends that are longer, shorter, higher or lower than
the others of their direction.
"""

from __future__ import annotations

from bisect import bisect_left, insort
from typing import TYPE_CHECKING

import numpy as np

from damperfit.statistics import median

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]

__all__ = ["level_parts", "level_share", "like_halves", "off_level"]

_PERIOD, _AMPLITUDE = 0.01, 0.02
# A quarter of the second differences of normal scatter s are below 0.78 s: 4.4 of them are 3.4 s,
# which is five median deviations.
_USUAL = 4.4
_KEPT = 0.6  # of the allowance; what drifts through more is on its way
_ONE = 0.4  # of the least allowance; 0.6 / 1.5
_SHARE = 0.5  # of the run
_RECENT = 200  # half cycles that say the level; of all of them an hour's log would take minutes


def level_parts(
    period: FloatArray, amplitude: FloatArray, *, fewest: int, steadiness: float
) -> Sequence[tuple[int, int]]:
    """Return first and stop of the parts of a run that are steady tests.

    Parameters
    ----------
    period, amplitude : numpy.ndarray
        Shape (n,), of cycles that begin at each half of one.
    fewest : int
        Cycles that a part must have.
    steadiness : float
        Share within which an unsteady rig's cycles may wander.
    """
    if len(period) >= fewest and all(
        _is_one(values, min(least, steadiness))
        for values, least in ((period, _PERIOD), (amplitude, _AMPLITUDE))
    ):
        return ((0, len(period)),)
    allowed = _allowed(period, _PERIOD, steadiness), _allowed(amplitude, _AMPLITUDE, steadiness)
    whole = _trimmed(period, amplitude, 0, len(period), allowed)
    parts = [
        part
        for first, stop in _parts(period, amplitude, allowed)
        if (part := _trimmed(period, amplitude, first, stop, allowed))[1] - part[0] >= fewest
        and _keeps_level(period, *part, allowed[0])
        and _keeps_level(amplitude, *part, allowed[1])
    ]
    if sum(stop - first for first, stop in parts) >= _SHARE * len(period):
        return parts
    inside = period[slice(*whole)]
    if len(inside) < fewest or np.log(inside.max() / inside.min()) > 2.0 * steadiness:
        return ()
    return (whole,)


def like_halves(
    passages: FloatArray, turns: FloatArray, first: int, stop: int, *, near: float
) -> tuple[int, int]:
    """Take off both ends of a part the half strokes that are of another motion.

    Parameters
    ----------
    passages : numpy.ndarray
        At which cycles begin, two in a cycle, samples.
    turns : numpy.ndarray
        Displacement at the turn before each passage, and after the last, m.
    first, stop : int
        Cycles of the part; the last of them ends at passage ``stop + 1``.
    near : float
        Samples by which the filter may move a passage beside a break.
    """
    while stop - first > 1:
        halves = np.diff(passages[first : stop + 2])
        tops = turns[first + 1 : stop + 2]
        usual = _by_direction(halves)
        shorter = float(usual.min())
        is_off = np.abs(halves / usual - 1.0) > max(_PERIOD, near / shorter)
        usual = _by_direction(tops)
        swing = max(_AMPLITUDE, 2.0 * near / shorter) * 0.5 * float(np.ptp(usual))
        is_off |= np.abs(tops - usual) > swing
        if is_off[0]:
            first += 1
        elif is_off[-1]:
            stop -= 1
        else:
            break
    return first, stop


def _by_direction(values: FloatArray) -> FloatArray:
    """Return the median of the half strokes of each one's direction."""
    usual = np.empty(len(values))
    for k in (0, 1):
        usual[k::2] = median(values[k::2])
    return usual


def off_level(values: FloatArray, kind: str, steadiness: float) -> NDArray[np.bool_]:
    """Return which cycles are off the level of the others.

    Parameters
    ----------
    values : numpy.ndarray
        Shape (n,), periods or amplitudes of cycles one after the other.
    kind : str
        "period" or "amplitude".
    steadiness : float
        Share that is never allowed to be exceeded.
    """
    least = _PERIOD if kind == "period" else _AMPLITUDE
    middle = median(values)
    allowed = _allowed(values, least, steadiness, lag=1)
    return np.asarray(np.abs(values - middle) > allowed * middle)


def level_share(periods: FloatArray, steadiness: float) -> float:
    """Return the share by which cycles one after the other may differ in period, and be one test.

    Parameters
    ----------
    periods : numpy.ndarray
        Shape (n,).
    steadiness : float
        Share that is never allowed to be exceeded.
    """
    return _allowed(periods, _PERIOD, steadiness, lag=1)


def _is_one(values: FloatArray, least: float) -> bool:
    """Whether values lie so near to each other that nothing below cuts, trims or tilts them.

    All differ from any of their medians by less than the least allowance; a line through them
    goes over 1.5 times their range at most, and 0.6 of the allowance is what it may.
    """
    return float(values.max() - values.min()) <= _ONE * least * float(values.min())


def _allowed(values: FloatArray, least: float, steadiness: float, *, lag: int = 2) -> float:
    """Return the share by which a cycle may be off the others; steps and drifts do not widen it."""
    bent = values[2 * lag :] - 2.0 * values[lag:-lag] + values[: -2 * lag]
    if not len(bent):
        return least
    rank = (len(bent) - 1) // 4
    scatter = float(np.partition(np.abs(bent), rank)[rank]) / median(values)
    return min(max(least, _USUAL * scatter), steadiness)


def _parts(
    period: FloatArray, amplitude: FloatArray, allowed: tuple[float, float]
) -> list[tuple[int, int]]:
    """Cut a run where a cycle is off the median of the last ones since the last cut."""
    channels = list(zip((period.tolist(), amplitude.tolist()), allowed, strict=True))
    # In order at all times: a median sought anew for each cycle takes far longer.
    recent: list[list[float]] = [[values[0]] for values, _ in channels]
    parts, first = [], 0
    for k in range(1, len(period) + 1):
        if k < len(period) and all(
            abs(values[k] / _middle(order) - 1.0) <= share
            for (values, share), order in zip(channels, recent, strict=True)
        ):
            for (values, _), order in zip(channels, recent, strict=True):
                insort(order, values[k])
                if k - first >= _RECENT:
                    del order[bisect_left(order, values[k - _RECENT])]
            continue
        parts.append((first, k))
        first = k
        recent = [values[k : k + 1] for values, _ in channels]
    return parts


def _middle(order: list[float]) -> float:
    """Return the median of values in order."""
    half = len(order) // 2
    return order[half] if len(order) % 2 else 0.5 * (order[half - 1] + order[half])


def _trimmed(
    period: FloatArray,
    amplitude: FloatArray,
    first: int,
    stop: int,
    allowed: tuple[float, float],
) -> tuple[int, int]:
    """Take cycles off both ends of a run that are not like those inside."""
    is_off = np.zeros(stop - first, dtype=bool)
    for values, share in zip((period, amplitude), allowed, strict=True):
        middle = median(values[first:stop])
        is_off |= np.abs(values[first:stop] - middle) > share * middle
    while stop > first and is_off[0]:
        first, is_off = first + 1, is_off[1:]
    while stop > first and is_off[-1]:
        stop, is_off = stop - 1, is_off[:-1]
    return first, stop


def _keeps_level(values: FloatArray, first: int, stop: int, allowed: float) -> bool:
    """Whether a straight line through a part stays within its allowance."""
    part = values[first:stop]
    place = np.arange(len(part)) - 0.5 * (len(part) - 1)
    slope = float(place @ part) / float(place @ place)
    return abs(slope) * (len(part) - 1) <= _KEPT * allowed * median(part)
