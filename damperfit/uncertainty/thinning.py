"""How many samples of a log stand for one where sums over them are wanted.

Compared signals lie behind a low-pass. A log of 1 kHz has some sixteen samples for each that is
independent behind 30 Hz, and sums over every third are those over all of them: products of four
signals of the band (scores beside scores of another moment) hold nothing that so few would mistake
for something slower. Of an odd number the middle one is taken, so that none of the log's ends
counts more than before. What has corners of its own, such as weights beside a jump of the speed,
takes every sample, and so does what does not repeat.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from damperfit.conditioning.filters import gain_at
from damperfit.recording import FilterDesign

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from damperfit.recording import Trace

    FloatArray = NDArray[np.float64]

__all__ = ["middles", "stride_of"]

# The band ends where the filter passes so little; behind 30 Hz that is at 59 Hz.
_PASSED = 1e-2
# Samples in a period of the band's end. Errors move by less than a thousandth
# (`tests/uncertainty/test_thinning.py`).
_IN_A_PERIOD = 4
_HALVINGS = 40  # of the frequencies among which the end is looked for


def stride_of(trace: Trace, weight: FloatArray | None) -> int:
    """Return of how many samples one is enough for sums over the compared ones.

    Parameters
    ----------
    trace : Trace
        The log.
    weight : numpy.ndarray or None
        What its compared samples count; None where all count alike.
    """
    if not all(stretch.n_cycles for stretch in trace.stretches):
        return 1
    if weight is not None and not weight.all():
        return 1
    sections = np.ascontiguousarray(trace.model_filter.sections, dtype=np.float64)
    return _stride(sections.tobytes(), is_zero_phase=trace.model_filter.is_zero_phase)


@lru_cache(maxsize=64)
def _stride(sections: bytes, *, is_zero_phase: bool) -> int:
    design = FilterDesign(np.frombuffer(sections).reshape(-1, 6), is_zero_phase, "")
    low, high = 0.0, 0.5  # turns of a sample
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        if gain_at(design, middle, sample_rate=1.0) < _PASSED:
            high = middle
        else:
            low = middle
    most = int(1.0 / (_IN_A_PERIOD * high))
    return max(1, most - (most + 1) % 2)


@lru_cache(maxsize=64)
def middles(n: int, stride: int) -> tuple[NDArray[np.int64], FloatArray]:
    """Return the middle of every few of n samples, and how many it stands for.

    The last one stands for what is left.

    Parameters
    ----------
    n : int
        Samples.
    stride : int
        Odd.

    Examples
    --------
    >>> places, counts = middles(7, 3)
    >>> places.tolist(), counts.tolist()
    ([1, 4, 6], [3.0, 3.0, 1.0])
    """
    begins = np.arange(0, n, stride)
    counts = np.minimum(n - begins, stride)
    found = begins + counts // 2, counts.astype(np.float64)
    for one in found:
        one.flags.writeable = False
    return found
