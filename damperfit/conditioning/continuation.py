"""A short test continued by its own cycles, so that three of them suffice.

A filter needs 0.23 s beyond each end of what is compared, and the model a cycle of run-in for its
state. Of three cycles at 10 Hz nothing would be left. Where a log begins or ends in the midst of a
steady motion, that motion went on: the log is continued there by the cycle that is nearest, both
channels alike, so that filter and model meet what they would have met. Only what was logged is
compared, and the model's force passes the same filter over the same continued motion.

The cycle's length is the one at which the displacement repeats best, so that the seam is smooth. A
motion that began with the log's first sample has not repeated yet: as long as the force
differs from the next cycle's by more than noise it is run-in, and the log is continued behind it.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from damperfit.conditioning.channels import noise_of
from damperfit.conditioning.timebase import UniformLog

if TYPE_CHECKING:
    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]

__all__ = ["Continued", "continue_log"]

_TRIES = 8
_NOISE = 6.0  # standard deviations of the difference of two cycles
_ALIKE = 0.02  # of the force's range; rigs repeat a peak to 1 %
_LONGEST = 0.5  # cycles; what differs for longer is no beginning
_MOST = 0.9  # of that
_GAP = 3  # samples


class Continued(NamedTuple):
    """A log with cycles put before and behind it.

    `first` and `stop` are the samples of `log` that were logged and repeat.
    """

    log: UniformLog
    first: int
    stop: int


def continue_log(
    log: UniformLog, begin: float | None, end: float | None, *, reach: int
) -> Continued:
    """Return a log with its motion continued at the ends.

    Parameters
    ----------
    log : UniformLog
        Uniform, as logged.
    begin, end : float or None
        Samples in a cycle of the steady motion in which the log begins, and ends; None where it
        does not, and is not continued.
    reach : int
        Samples that the filter reaches; a cycle of run-in is put before them.
    """
    n = len(log.force)
    first, before, behind = 0, 0, 0
    channels = np.stack([log.displacement, log.force])
    if begin is not None:
        begin = _length(log.displacement, begin)
        first = _settled(log.force, begin)
        before = reach + math.ceil(begin) + 1
    if end is not None:
        end = _length(log.displacement[::-1], end)
        behind = reach + 2
    at = np.arange(first - before, n + behind, dtype=np.float64)
    if begin is not None:
        ahead = first - at
        at = np.where(ahead > 0.0, at + begin * np.ceil(ahead / begin), at)
    if end is not None:
        beyond = at - (n - 1.0)
        at = np.where(beyond > 0.0, at - end * np.ceil(beyond / end), at)
    x, f = _read(channels, at)
    made = replace(
        log,
        start_time=log.start_time + (first - before) * log.interval,
        displacement=x,
        force=f,
    )
    return Continued(made, before, before + n - first)


def _read(channels: FloatArray, at: FloatArray) -> FloatArray:
    """Return channels between their samples, by a cubic spline; at a sample exactly that."""
    from scipy.interpolate import CubicSpline

    whole = np.rint(at).astype(np.int64)
    is_sample = at == whole
    read = np.asarray(CubicSpline(np.arange(channels.shape[1]), channels, axis=1)(at))
    read[:, is_sample] = channels[:, whole[is_sample]]
    return read


def _length(displacement: FloatArray, guess: float) -> float:
    """Return the samples after which the first cycle of a displacement repeats best."""
    from scipy.interpolate import CubicSpline

    n = min(math.ceil(guess), len(displacement) - math.ceil(1.05 * guess) - 1)
    if n < 8:
        return guess
    spline = CubicSpline(np.arange(len(displacement)), displacement)
    here, place = displacement[:n], np.arange(n)
    length = guess
    for _ in range(_TRIES):
        slope = spline(place + length, 1)
        step = float(slope @ (here - spline(place + length)) / (slope @ slope))
        length = float(np.clip(length + step, 0.95 * guess, 1.05 * guess))
    return length


def _settled(force: FloatArray, length: float) -> int:
    """Return the sample from which on the force repeats a cycle later."""
    n = min(round(_LONGEST * length), len(force) - math.ceil(length) - 2)
    if n < 8:
        return 0
    later = np.interp(np.arange(n) + length, np.arange(len(force)), force)
    allowed = max(_NOISE * math.sqrt(2.0) * noise_of(force), _ALIKE * float(np.ptp(force)))
    off = np.flatnonzero(np.abs(force[:n] - later) > allowed)
    if not len(off):
        return 0
    block = off[: int(np.argmax(np.append(np.diff(off), n) > _GAP)) + 1]
    # Where friction turns, a sample or two differ.
    is_beginning = off[0] <= _GAP < len(block) < _MOST * n
    return int(block[-1]) + 1 if is_beginning else 0
