"""Whether a channel that stands for some samples was cut, was stuck, or did stand.

What a sensor's end cuts off would have gone on: beside a stand of L samples the signal comes in and
leaves with the speed that turns it within them. Written from the stand outwards as
``y = v t + b t^2``, a curve that is cut has v = b L on both sides, a smooth crest, a rest at the
end of the stroke and a crank that goes through its play have v = 0 on the way in. A corner (b
small) may be a cut triangle or a trapezoid's rest: at rest the force leaves its value at once.

A sensor that is stuck has to catch up when it comes free; what stood goes on from where it was.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from damperfit.statistics import median

if TYPE_CHECKING:
    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]

__all__ = ["Beside", "beside", "catches_up", "is_cut_displacement"]

_FEWEST, _MOST = 4, 60  # samples looked at on each side
_CUT = 0.4  # of b L; 0 at a rest, 1 at a cut
_LEFT = 0.3  # of what the force changes over the stand, in its first quarter
_JUMP = 3.0  # usual steps of the samples behind


class Beside(NamedTuple):
    """Speed v and bend b of a signal beside a stand, outwards, a sample; before and behind it.

    `beyond` is how far the signal would have gone on, `step` the least step there.
    """

    before: tuple[float, float]
    behind: tuple[float, float]
    beyond: float
    step: float


def beside(values: FloatArray, start: int, stop: int) -> Beside | None:
    """Return how a signal comes to a stand and leaves it; None at the ends of the log.

    Parameters
    ----------
    values : numpy.ndarray
        Shape (n,).
    start, stop : int
        Samples ``start:stop`` are equal.
    """
    length = stop - start
    n = min(max(length, _FEWEST), _MOST)
    if start < n or stop + n > len(values):
        return None
    left, right = values[start - n : start][::-1], values[stop : stop + n]
    sign = np.sign(2.0 * values[start] - left.mean() - right.mean())
    sides = [sign * (values[start] - side) for side in (left, right)]
    time = np.arange(1.0, n + 1.0)
    basis = np.stack([time, time**2], axis=-1)
    (v_1, b_1), (v_2, b_2) = (np.linalg.lstsq(basis, side, rcond=None)[0] for side in sides)
    steps = np.abs(np.diff(np.concatenate([left[::-1], right])))
    steps = steps[steps > 0.0]
    return Beside(
        before=(float(v_1), float(b_1)),
        behind=(float(v_2), float(b_2)),
        beyond=0.125 * float(v_1 + v_2) * length,
        step=float(steps.min()) if len(steps) else 0.0,
    )


def is_cut_displacement(near: Beside, force: FloatArray) -> bool:
    """Whether a displacement was cut where it stands.

    Parameters
    ----------
    near : Beside
        What is beside the stand.
    force : numpy.ndarray
        Shape (n,), over the stand.
    """
    for v, b in (near.before, near.behind):
        if not v > _CUT * max(b, 0.0) * len(force):
            return False
    if near.before[0] < 2.0 * near.before[1] * len(force):
        return True
    quarter = max(len(force) // 4, 1)
    change = abs(float(force[-quarter:].mean() - force[0]))
    return abs(float(force[:quarter].mean() - force[0])) < _LEFT * change


def catches_up(values: FloatArray, stop: int) -> bool:
    """Whether a signal leaps when its stand ends.

    Parameters
    ----------
    values : numpy.ndarray
        Shape (n,).
    stop : int
        First sample behind the stand.
    """
    steps = np.abs(np.diff(values[stop : stop + 12]))
    if not len(steps):
        return False
    return bool(abs(values[stop] - values[stop - 1]) > _JUMP * median(steps))
