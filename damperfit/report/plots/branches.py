"""Force where nothing repeats: means of both branches by velocity, of both strokes by place.

A road drawn sample by sample is a tangle of strands; what the damper does at a velocity is the mean
of those that pass there, faster on one branch and slower on the other. At a place of the stroke the
speeds that pass spread the forces, so that a range stands beside their mean.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from damperfit.report.evaluated_log import EvaluatedLog

    FloatArray = NDArray[np.float64]

__all__ = ["Branch", "Stroke", "is_moving", "mean_branches", "mean_strokes"]

_BINS = 24  # of velocity, from the lowest to the highest
_FEW = 3  # samples: no mean of fewer
_FEW_IN_RANGE = 20  # no range of fewer: each end would be one sample
_RANGE = (5.0, 95.0)  # per cent of the samples that lie below


class Branch(NamedTuple):
    """Means of one branch: "opening", where the speed grows, or "closing"."""

    word: str
    velocity: FloatArray
    mean: FloatArray


class Stroke(NamedTuple):
    """Forces of one stroke by place: "rebound", where the rod comes out, or "bump".

    Nine of ten samples lie between `low` and `high`.
    """

    word: str
    displacement: FloatArray
    mean: FloatArray
    low: FloatArray
    high: FloatArray


def is_moving(view: EvaluatedLog) -> bool:
    """Whether nothing in a log repeats.

    Parameters
    ----------
    view : EvaluatedLog
        The log.
    """
    return bool(view.stretches) and not any(one.n_cycles for one in view.stretches)


def mean_branches(velocity: FloatArray, values: FloatArray) -> Iterator[Branch]:
    """Yield the means of both branches by velocity, at the middles of the bins.

    Parameters
    ----------
    velocity, values : numpy.ndarray
        Shape (n,), samples in order of time.
    """
    if len(velocity) < _BINS or np.ptp(velocity) == 0.0:
        return
    edges = np.linspace(velocity.min(), velocity.max(), _BINS + 1)
    place = np.clip(np.digitize(velocity, edges) - 1, 0, _BINS - 1)
    middle = 0.5 * (edges[1:] + edges[:-1])
    is_opening = np.gradient(np.abs(velocity)) > 0.0
    for part, word in ((is_opening, "opening"), (~is_opening, "closing")):
        count = np.bincount(place[part], minlength=_BINS)
        total = np.bincount(place[part], weights=values[part], minlength=_BINS)
        seen = count >= _FEW
        if seen.any():
            yield Branch(word, middle[seen], total[seen] / count[seen])


def mean_strokes(
    displacement: FloatArray, velocity: FloatArray, values: FloatArray
) -> Iterator[Stroke]:
    """Yield mean and range of both strokes by displacement, at the middles of the bins.

    Parameters
    ----------
    displacement, velocity, values : numpy.ndarray
        Shape (n,).
    """
    if len(displacement) < _FEW_IN_RANGE or np.ptp(displacement) == 0.0:
        return
    edges = np.linspace(displacement.min(), displacement.max(), _BINS + 1)
    place = np.clip(np.digitize(displacement, edges) - 1, 0, _BINS - 1)
    middle = 0.5 * (edges[1:] + edges[:-1])
    for part, word in ((velocity > 0.0, "rebound"), (velocity < 0.0, "bump")):
        groups = [values[part & (place == k)] for k in range(_BINS)]
        seen = [k for k, group in enumerate(groups) if len(group) >= _FEW_IN_RANGE]
        if seen:
            low, high = np.array([np.percentile(groups[k], _RANGE) for k in seen]).T
            mean = np.array([groups[k].mean() for k in seen])
            yield Stroke(word, middle[seen], mean, low, high)
