"""Where in a steady stretch derivatives are taken, and sums over its samples with them.

The compared signals have passed a low-pass filter. One of 30 Hz passes a hundredth at 59 Hz, the
39th harmonic of a cycle at 1.5 Hz, and 208 phases of that cycle, in place of its 667 samples at
1 kHz, are enough for sums of four such signals (scores beside scores of another moment). The mean
cycle's derivatives are those of every cycle: a stretch has them once at each of its `Phases`,
beside the residuals that each cycle has there. `EverySample` is taken where a signal has corners of
its own, such as weights beside a jump of the speed, where nothing repeats, where a cycle has no
more samples than it needs phases, and where no low-pass has smoothed the residuals: a log that the
rig has filtered forward and backward is compared as it is, with the steps in which it was written.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from damperfit.conditioning.filters import gain_at
from damperfit.identification.mean_cycle import between_samples, fast_length
from damperfit.recording import FilterDesign

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from damperfit.identification.mean_cycle import SettledCycle
    from damperfit.recording import Stretch, Trace

    FloatArray = NDArray[np.float64]

__all__ = ["BLOCKS", "EverySample", "Phases", "phases_of"]

# Blocks of a cycle, which `misfit_scores` takes for independent. Misfits behind a 30 Hz filter at
# 1.5 Hz have some 20 independent values.
BLOCKS = 16

# The band ends where the filter passes so little; behind 30 Hz that is at 59 Hz.
_PASSED = 1e-2
# Phases in a period of the band's end. Errors move by four thousandths at most, by what lies at the
# ends of a stretch (`tests/uncertainty/test_rows.py`).
_IN_A_PERIOD = 5
# Share of the residuals' power that may lie beyond the band: errors by phases are too large by a
# third of it.
_BEYOND = 0.01
# Phases of a cycle, as many in each of its blocks.
_FEWEST = 128
_HALVINGS = 40  # of the frequencies among which the end is looked for
# Samples by which whole cycles may be longer or shorter than the stretch.
_LEFT_OVER = 1.5


@dataclass(frozen=True, slots=True, eq=False)
class EverySample:
    """Every sample of a stretch.

    Attributes
    ----------
    stretch : Stretch
        Which.
    """

    stretch: Stretch

    @property
    def n_cycles(self) -> int:
        """How often the rows are those of the stretch."""
        return 1

    @property
    def spacing(self) -> float:
        """How many samples a row stands for."""
        return 1.0

    def seen(self, cycle: SettledCycle, signals: Sequence[FloatArray]) -> FloatArray:
        """Return signals of a settled cycle behind the filter, (k, m)."""
        return cycle.over(self.stretch, signals)

    def read(self, values: FloatArray) -> FloatArray:
        """Return values at the samples of the stretch, (n,), at the rows: (cycles, m)."""
        return values[None, :]


@dataclass(frozen=True, slots=True, eq=False)
class Phases:
    """Some phases of each cycle of a stretch.

    Attributes
    ----------
    stretch : Stretch
        Which.
    at : numpy.ndarray
        Shape (cycles, m), samples from the stretch's first, rising.
    """

    stretch: Stretch
    at: FloatArray

    @property
    def n_cycles(self) -> int:
        """How often the rows are those of the stretch."""
        return len(self.at)

    @property
    def spacing(self) -> float:
        """How many samples a row stands for."""
        return self.stretch.n_samples / self.at.size

    def seen(self, cycle: SettledCycle, signals: Sequence[FloatArray]) -> FloatArray:
        """Return signals of a settled cycle behind the filter, (k, m)."""
        return cycle.at_phases(signals, self.at.shape[1])

    def read(self, values: FloatArray) -> FloatArray:
        """Return values at the samples of the stretch, (n,), at the rows: (cycles, m)."""
        return np.asarray(between_samples(values[None, :], self.at)[0])


def phases_of(
    trace: Trace,
    stretch: Stretch,
    cycle: SettledCycle,
    *,
    weight: FloatArray | None,
    residuals: FloatArray,
) -> Phases | EverySample:
    """Return the phases at which the sums over a stretch are taken, or every sample.

    Parameters
    ----------
    trace : Trace
        The log.
    stretch : Stretch
        Of steady cycles.
    cycle : SettledCycle
        Its mean one.
    weight : numpy.ndarray or None
        What the samples of the stretch count; None where all count alike.
    residuals : numpy.ndarray
        Shape (n,), measured minus modelled force at the samples of the stretch.
    """
    starts = cycle.starts - stretch.first
    ends = (abs(float(starts[0])), abs(float(starts[-1]) - stretch.n_samples))
    if max(ends) > _LEFT_OVER or not (weight is None or weight.all()):
        return EverySample(stretch)
    period = stretch.n_samples / stretch.n_cycles
    end = _end_of(trace.model_filter)
    n = max(_FEWEST, BLOCKS * math.ceil(_IN_A_PERIOD * end * period / BLOCKS))
    if n >= period:
        return EverySample(stretch)
    if trace.is_filtered_by_rig and _share_beyond(residuals, end) > _BEYOND:
        return EverySample(stretch)
    n = min(n, BLOCKS * (len(cycle.force) // BLOCKS))
    middles = (np.arange(n) + 0.5) / n
    return Phases(stretch, starts[:-1, None] + np.diff(starts)[:, None] * middles)


def _share_beyond(residuals: FloatArray, end: float) -> float:
    """Share of their power that lies beyond a frequency, in turns of a sample."""
    n = len(residuals)
    length = fast_length(n)
    # Without a step from the last to the first, which has all frequencies.
    lines = np.fft.rfft(residuals - np.linspace(residuals[0], residuals[-1], n), length)
    beyond = lines[math.ceil(end * length) :]
    power = 0.5 * length * n * float(np.var(residuals))
    return float(np.vdot(beyond, beyond).real) / max(power, 1e-300)


def _end_of(design: FilterDesign) -> float:
    """Where the filter passes little, in turns of a sample."""
    sections = np.ascontiguousarray(design.sections, dtype=np.float64)
    return _band_end(sections.tobytes(), is_zero_phase=design.is_zero_phase)


@lru_cache(maxsize=64)
def _band_end(sections: bytes, *, is_zero_phase: bool) -> float:
    design = FilterDesign(np.frombuffer(sections).reshape(-1, 6), is_zero_phase, "")
    low, high = 0.0, 0.5
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        if gain_at(design, middle, sample_rate=1.0) < _PASSED:
            high = middle
        else:
            low = middle
    return high
