"""Where a motion rests: a dwell between strokes, in which noise of the displacement is no speed.

What drives the model of a motion with corners is hardly filtered, and at rest the noise in its
speed turns the friction from one sample to the next. Behind the compared filter that friction is
nearly none, with a scatter: a fit has it a third too small, and all that goes with it.

A part rests where its samples lie about one level as noise does, without slope and without bend,
and where the motion comes to it and leaves it at a speed. The crest of a slow sine lies within
noise too, but half its length further on it has gone three times as far as its ends are: 12 times
the noise. Within a rest the model is driven by the level, at no speed; what friction holds there
nobody knows.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from damperfit.conditioning.channels import noise_of
from damperfit.statistics import mean_of

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]

__all__ = ["rests_of", "samples_at_rest"]

_SHORTEST = 0.02  # s; what is shorter turns little friction
_FEWEST = 10  # samples
_CLEAR = 3.0  # errors of a slope and of a bend, and of samples that belong to a rest
_GONE = 30.0  # times the noise, half a length beyond
_SCATTER = 4.0  # errors by which the noise of a rest may exceed that of the log
_NOISE_KNOWN = 0.1  # share to which that is known
_ROUNDING = 1e-6  # of the stroke
_TAKEN = 0.9  # of the samples differ from the one before, where steps are finer than the noise


def rests_of(displacement: FloatArray, interval: float) -> list[tuple[slice, float]]:
    """Return the parts in which a motion rests, in order of time, and the level of each, m.

    Parameters
    ----------
    displacement : numpy.ndarray
        As logged, shape (n,), m.
    interval : float
        s.
    """
    n = max(_FEWEST, math.ceil(_SHORTEST / interval))
    hop = n // 2
    starts = np.arange(0, len(displacement) - n + 1, hop)
    away = np.abs(displacement[starts + n - 1] - displacement[starts])
    noise = max(noise_of(displacement), _ROUNDING * float(np.ptp(displacement)))
    noise = max(noise, _of_steps(displacement))
    near = starts[away <= 2.0 * _SCATTER * noise]
    if not len(near):
        return []
    reach = np.linspace(-1.0, 1.0, n)
    forms = np.stack([reach, reach**2 - mean_of(reach**2)])
    forms /= np.linalg.norm(forms, axis=1)[:, None]
    slopes = np.abs(displacement[near[:, None] + np.arange(n)] @ forms.T)
    flat = near[(slopes <= _CLEAR * noise).all(axis=1)].tolist()
    still = [start for start in flat if _is_level(displacement[start : start + n], noise)]
    found = []
    for begin, end in _joined(displacement, still, n, noise):
        rest = _widened(displacement, begin, end, noise, hop)
        level = mean_of(displacement[rest])
        if _is_level(displacement[rest], noise) and _is_left(displacement, rest, level, noise):
            found.append((rest, level))
    return found


def samples_at_rest(velocity: FloatArray) -> list[int]:
    """Return how many samples each part has in which a drive is at no speed.

    Parameters
    ----------
    velocity : numpy.ndarray
        Of what drives the model, shape (n,), m/s.
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[False], velocity == 0.0, [False]])))
    return [int(n) for n in edges[1::2] - edges[::2] if n >= _FEWEST]


def _of_steps(x: FloatArray) -> float:
    """Return the noise of the steps that a converter takes where many samples are equal, m."""
    steps = np.abs(np.diff(x))
    taken = steps[steps > 0.0]
    is_coarse = 0 < len(taken) < _TAKEN * len(steps)
    return float(taken.min()) / math.sqrt(12.0) if is_coarse else 0.0


def _is_level(part: FloatArray, noise: float) -> bool:
    """Whether samples scatter about their mean as noise does."""
    allowed = 1.0 + _NOISE_KNOWN + _SCATTER / math.sqrt(2.0 * len(part))
    return float(np.std(part)) <= allowed * noise


def _is_left(x: FloatArray, part: slice, level: float, noise: float) -> bool:
    """Whether the motion comes to a rest and leaves it at a speed, as far as the log goes."""
    half = (part.stop - part.start) // 2
    sides = (x[max(part.start - half, 0) : part.start], x[part.stop : part.stop + half])
    far = [bool(np.any(np.abs(side - level) >= _GONE * noise)) for side in sides if len(side)]
    return bool(far) and all(far)


def _joined(x: FloatArray, starts: list[int], n: int, noise: float) -> Iterator[tuple[int, int]]:
    """Yield the parts that looks at one level make; noise alone refuses one in 200 between."""
    levels = [mean_of(x[start : start + n]) for start in starts]
    breaks = [
        k
        for k in range(1, len(starts))
        if starts[k] - starts[k - 1] > 2 * n or abs(levels[k] - levels[k - 1]) > _CLEAR * noise
    ]
    for first, stop in pairwise([0, *breaks, len(starts)]):
        if stop > first:
            yield starts[first], starts[stop - 1] + n


def _widened(x: FloatArray, begin: int, end: int, noise: float, hop: int) -> slice:
    """Return a part with the samples beside it that lie at its level too."""
    level = mean_of(x[begin:end])
    before = np.abs(x[max(begin - hop, 0) : begin][::-1] - level) > _CLEAR * noise
    behind = np.abs(x[end : end + hop] - level) > _CLEAR * noise
    return slice(begin - _before_two(before), end + _before_two(behind))


def _before_two(far: NDArray[np.bool_]) -> int:
    """Return how many come before two that are far: one alone is noise, once in 400."""
    places = np.flatnonzero(far & np.append(far[1:], True))
    return int(places[0]) if len(places) else len(far)
