"""How much each stretch counts in the fit of a setting: by its own noise."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from damperfit.recording import Trace

    FloatArray = NDArray[np.float64]

__all__ = ["weights"]

# Noises within this factor of each other are one: a scatter of few cycles is no better known.
_ALIKE = 1.25
# No stretch counts more than this against the middle one, as a fit has other errors than noise.
_FARTHEST = 5.0
_OTHER_ERRORS = 1e-3  # of the force's deviation


def weights(traces: Sequence[Trace]) -> tuple[FloatArray | None, ...]:
    """Return what the residuals of each log are multiplied by, over its compared samples.

    One over the noise of each stretch; the mean square over all samples is 1, so that a sum of
    squares keeps its scale. A stretch whose noise is not known counts as the middle one.

    Parameters
    ----------
    traces : sequence of Trace
        The logs of a setting.

    Returns
    -------
    tuple of numpy.ndarray or None
        None for all where nothing is to be told apart.
    """
    alike: tuple[FloatArray | None, ...] = (None,) * len(traces)
    stretches = [stretch for trace in traces for stretch in trace.stretches]
    known = [stretch.noise for stretch in stretches if math.isfinite(stretch.noise)]
    if len(stretches) < 2 or not known:
        return alike
    force = np.concatenate([trace.force[trace.compared] for trace in traces])
    other = _OTHER_ERRORS * float(np.std(force))
    middle = math.hypot(float(np.median(known)), other)
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
