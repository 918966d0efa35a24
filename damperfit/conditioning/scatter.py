"""How much the force differs from cycle to cycle: the floor of any model's error.

Cycles are laid over each other on the phase between their boundaries. At phase p, with m cycles::

    s^2 = mean over p of  sum_j (f_j(p) - mean_j f_j(p))^2 / (m - 1)        unbiased for any m
    floor = 100 s^2 / var(f)                                                the measure of eq. (22)

Reading the force between samples by a four-point cubic w averages its noise; s^2 is divided by what
that leaves, mean of w^T R w, where R is the autocorrelation of white noise behind the trace's
filter. A perfect model has this error or a little more: displacement noise is not in it.

Where nothing repeats, the noise is taken for white and read from the fifth differences of what the
filter takes off, in which the jumps of friction are few; behind it is what the filter passes.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from damperfit.compiled_core import compiled_core
from damperfit.conditioning.channels import noise_of
from damperfit.conditioning.cycles import clean_cycles
from damperfit.conditioning.filters import apply_filter, settling_samples
from damperfit.recording import FilterDesign
from damperfit.statistics import mean_of, variance_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from damperfit.recording import Stretch, Trace

    FloatArray = NDArray[np.float64]

__all__ = ["noise_beside_motion", "noise_floor", "scatter_between_cycles", "with_noise"]

_FEWEST_PHASES = 8
_BY_CYCLES = "scatter between cycles"


def noise_floor(trace: Trace) -> float:
    """Return the noise of the compared force, percent of its variance, eq. (22).

    NaN where a stretch has but a single cycle, and where the force does not vary.
    """
    variance = variance_of(trace.force[trace.compared])
    if not variance > 0.0:
        return math.nan
    noise = sum(one.n_samples * _known(trace, one) for one in trace.stretches)
    return 100.0 * noise / trace.n_samples / variance


def _known(trace: Trace, stretch: Stretch) -> float:
    """Mean square of the noise of a stretch, N^2: by its cycles, or by what was found above them.

    A log of a single cycle and no more is not called known by its spectrum alone.
    """
    # `with_noise` has folded the cycles already; three times a log was a tenth of conditioning.
    is_told = stretch.noise_source == _BY_CYCLES and stretch.n_cycles > 1
    scatter = stretch.noise**2 if is_told else scatter_between_cycles(trace, stretch)
    is_single = stretch.n_cycles == 1 and len(trace.stretches) == 1
    return scatter if is_single or math.isfinite(scatter) else stretch.noise**2


def with_noise(trace: Trace, rest: FloatArray) -> Trace:
    """Return a trace with the noise of each stretch.

    Parameters
    ----------
    trace : Trace
        Its stretches do not know their noise yet.
    rest : numpy.ndarray
        Shape (n,), N: what the filter has taken off the force, empty where the rig has filtered.
    """
    return replace(trace, stretches=tuple(_noisy(trace, one, rest) for one in trace.stretches))


def _noisy(trace: Trace, stretch: Stretch, rest: FloatArray) -> Stretch:
    noise = math.sqrt(scatter_between_cycles(trace, stretch))
    if math.isfinite(noise):
        return replace(stretch, noise=noise, noise_source=_BY_CYCLES)
    if not len(rest):
        return stretch
    noise = noise_of(rest[stretch.window]) * math.sqrt(
        _passed(replace(trace.model_filter, bridged=()))
    )
    return replace(stretch, noise=noise, noise_source="above the filter")


def _passed(design: FilterDesign) -> float:
    """Return the share of white noise's variance that a filter passes."""
    reach = settling_samples(design) + 1
    impulse = np.zeros(2 * reach + 1)
    impulse[reach] = 1.0
    return float(np.sum(apply_filter(design, impulse) ** 2))


def scatter_between_cycles(trace: Trace, stretch: Stretch) -> float:
    """Return the mean square of what the force differs by from cycle to cycle, N^2.

    NaN for a single cycle, and where the filter holds another motion through most of it.
    """
    if stretch.n_cycles < 2:
        return math.nan
    starts = stretch.cycle_starts
    n_phases = max(8, round(mean_of(np.diff(starts))))
    phases = np.arange(n_phases) / n_phases
    ahead, behind = stretch.smeared
    phases = phases[(phases * n_phases >= ahead) & ((1.0 - phases) * n_phases > behind)]
    if len(phases) < _FEWEST_PHASES:
        return math.nan
    scatter, lags = _scatter(trace.force, starts, phases)
    design = trace.model_filter
    correlation = _autocorrelation(design.sections.tobytes(), design.is_zero_phase)
    kept = float(lags @ correlation) / (stretch.n_cycles * len(phases))
    return float(scatter / kept)


def noise_beside_motion(trace: Trace) -> float:
    """Return what is left of the fastest stretch's noise floor beside what its motion explains, %.

    The force of each cycle, less the mean cycle, is laid upon what displacement, velocity and its
    square differ by from theirs: a motion that drifts makes a force that does.
    """
    starts = clean_cycles(trace.fastest)
    floor = noise_floor(trace)
    if len(starts) < 3 or math.isnan(floor):
        return math.nan
    n_phases = max(8, round(mean_of(np.diff(starts))))
    products = _beside(trace, starts, n_phases)
    size = np.maximum(np.sqrt(np.diag(products)), 1e-300)
    alike = products / size / size[:, np.newaxis]
    explained = alike[:3, 3] @ np.linalg.lstsq(alike[:3, :3], alike[:3, 3], rcond=None)[0]
    return floor * max(1.0 - float(explained), 0.0)


def _scatter(force: FloatArray, starts: FloatArray, phases: FloatArray) -> tuple[float, FloatArray]:
    """Return the variance of the cycles, mean over the phases, read by a cubic through four.

    And the sums of the products of its weights that stand 0, 1, 2, 3 samples apart.
    """
    folded, lags = np.empty((len(starts) - 1, len(phases))), np.empty(4)
    found = compiled_core().scatter(np.ascontiguousarray(force), starts, phases, folded, lags)
    return found, lags


def _beside(trace: Trace, starts: FloatArray, n_phases: int) -> FloatArray:
    """Return products of what x, v, v |v| and f of cycles differ by from their mean, (4, 4)."""
    channels = (trace.displacement, trace.velocity, trace.force)
    products, room = np.empty((4, 4)), np.empty((len(starts) - 1 + len(trace.force), 4))
    compiled_core().beside(
        *(np.ascontiguousarray(channel) for channel in channels), starts, products, room, n_phases
    )
    return products


@lru_cache(maxsize=64)
def _autocorrelation(sections: bytes, is_zero_phase: bool) -> FloatArray:  # noqa: FBT001
    """Return the correlation of white noise behind a filter at lags 0 to 3."""
    design = FilterDesign(np.frombuffer(sections).reshape(-1, 6).copy(), is_zero_phase, "")
    reach = settling_samples(design) + 4
    impulse = np.zeros(2 * reach + 1)
    impulse[reach] = 1.0
    answer = apply_filter(design, impulse)
    sums = np.array([answer[: len(answer) - k] @ answer[k:] for k in range(4)])
    return np.asarray(sums / sums[0])
