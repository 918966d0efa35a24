"""How much each sample counts in the fit of a setting: by its stretch's noise, and not at a corner.

Where the speed jumps, as at the corners of a triangle, the force of some milliseconds follows from
the microns and microseconds of the turn, which no sensor tells: noise of a few um there bent R_m3
of two triangles. These samples are simulated, shown and in every MSE, but the fit takes no notice
of them, unless the motion is straight on both sides (`damperfit.conditioning.drive`).
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from damperfit.conditioning import apply_filter
from damperfit.recording import FilterDesign
from damperfit.statistics import median

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from damperfit.recording import Trace

    FloatArray = NDArray[np.float64]

__all__ = ["all_alike", "weights"]

# Noises within this factor of each other are one: a scatter of few cycles is no better known.
_ALIKE = 1.25
# No stretch counts more than this against the middle one, as a fit has other errors than noise.
_FARTHEST = 5.0
_OTHER_ERRORS = 1e-3  # of the force's deviation
# Of the peak speed: what the compared filter takes off the drive's velocity at a jump of it.
_JUMP = 0.5
# Before and after it nothing counts for so many widths of the filter's answer to an impulse, which
# at 30 Hz are 10 and 20 ms.
_BEFORE, _AFTER = 0.6, 1.2
_IMPULSE = 1 << 13  # samples, far longer than any filter's answer
# Where corners are more of a stretch than this, they are what it tells.
_MOST = 1.0 / 3.0


def weights(traces: Sequence[Trace]) -> tuple[FloatArray | None, ...]:
    """Return what the residuals of each log are multiplied by, over its compared samples.

    One over the noise of each stretch, nothing beside a jump of the speed; the mean square over all
    samples is 1, so that a sum of squares keeps its scale. A stretch whose noise is not known
    counts as the middle one.

    Parameters
    ----------
    traces : sequence of Trace
        The logs of a setting.

    Returns
    -------
    tuple of numpy.ndarray or None
        None for all where nothing is to be told apart.
    """
    by_noise = _by_noise(traces)
    counted = [_counted(trace) for trace in traces]
    if all(one is None for one in counted):
        return by_noise
    both = [
        (np.ones(trace.n_samples) if weight is None else weight)
        * (1.0 if one is None else one.astype(np.float64))
        for trace, weight, one in zip(traces, by_noise, counted, strict=True)
    ]
    power = sum(float(one @ one) for one in both) / sum(len(one) for one in both)
    return tuple(one / math.sqrt(power) for one in both)


@lru_cache(maxsize=16)
def all_alike(n: int) -> FloatArray:
    """Return weights of n samples that all count alike; nobody may change them."""
    ones = np.ones(n)
    ones.flags.writeable = False
    return ones


def _counted(trace: Trace) -> NDArray[np.bool_] | None:
    """Which of the compared samples lie beside no jump of the speed; None for all."""
    if trace.drive.velocity is trace.velocity or len(trace.drive.jumps):
        return None
    cut_off = np.abs(trace.drive.velocity - trace.velocity)
    counts = np.ones(len(cut_off), dtype=bool)
    width = _width(trace.model_filter.sections.tobytes(), trace.model_filter.is_zero_phase)
    for stretch in trace.stretches:
        part = stretch.window
        near = np.zeros(stretch.n_samples, dtype=bool)
        for at in np.flatnonzero(cut_off[part] > _JUMP * stretch.peak_speed).tolist():
            near[max(0, at - round(_BEFORE * width)) : at + round(_AFTER * width) + 1] = True
        if np.mean(near) <= _MOST:
            counts[part] = ~near
    return None if counts.all() else counts[trace.compared]


@lru_cache(maxsize=64)
def _width(sections: bytes, is_zero_phase: bool) -> float:  # noqa: FBT001
    """Return how long a filter's answer to an impulse lasts, in samples: 1 over its power."""
    design = FilterDesign(np.frombuffer(sections).reshape(-1, 6).copy(), is_zero_phase, "")
    impulse = np.zeros(_IMPULSE)
    impulse[_IMPULSE // 2] = 1.0
    return 1.0 / float(np.sum(apply_filter(design, impulse) ** 2))


def _by_noise(traces: Sequence[Trace]) -> tuple[FloatArray | None, ...]:
    alike: tuple[FloatArray | None, ...] = (None,) * len(traces)
    stretches = [stretch for trace in traces for stretch in trace.stretches]
    known = [stretch.noise for stretch in stretches if math.isfinite(stretch.noise)]
    if len(stretches) < 2 or not known:
        return alike
    force = np.concatenate([trace.force[trace.compared] for trace in traces])
    other = _OTHER_ERRORS * float(np.std(force))
    middle = math.hypot(median(known), other)
    sizes = [
        math.hypot(stretch.noise, other) if math.isfinite(stretch.noise) else middle
        for stretch in stretches
    ]
    if max(sizes) <= _ALIKE * min(sizes):
        return alike
    factors = np.clip(middle / np.array(sizes), 1.0 / _FARTHEST, _FARTHEST)
    counts = np.array([stretch.n_samples for stretch in stretches])
    factors /= math.sqrt(float(counts @ factors**2) / float(counts.sum()))
    rows = iter(np.repeat(factor, count) for factor, count in zip(factors, counts, strict=True))
    return tuple(np.concatenate([next(rows) for _ in trace.stretches]) for trace in traces)
