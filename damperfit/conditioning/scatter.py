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

from damperfit.conditioning.channels import noise_of
from damperfit.conditioning.cycles import clean_cycles
from damperfit.conditioning.filters import apply_filter, settling_samples
from damperfit.recording import FilterDesign

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
    variance = float(np.var(trace.force[trace.compared]))
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
    noise = noise_of(rest[stretch.window]) * math.sqrt(_passed(trace.model_filter))
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
    n_phases = max(8, round(float(np.mean(np.diff(starts)))))
    phases = np.arange(n_phases) / n_phases
    ahead, behind = stretch.smeared
    phases = phases[(phases * n_phases >= ahead) & ((1.0 - phases) * n_phases > behind)]
    if len(phases) < _FEWEST_PHASES:
        return math.nan
    positions = starts[:-1, None] + np.diff(starts)[:, None] * phases
    weights, index = _cubic(positions, len(trace.force))
    folded = _at(trace.force, weights, index)
    scatter = float(np.mean(np.var(folded, axis=0, ddof=1)))
    design = trace.model_filter
    correlation = _autocorrelation(design.sections.tobytes(), design.is_zero_phase)
    rows = np.stack([weight.ravel() for weight in weights])
    lags = np.abs(np.subtract.outer(np.arange(4), np.arange(4)))
    kept = float(np.sum(rows @ rows.T * correlation[lags])) / rows.shape[1]
    return float(scatter / kept)


def noise_beside_motion(trace: Trace) -> float:
    """Return what is left of the fastest stretch's noise floor beside what its motion explains, %.

    The force of each cycle, less the mean cycle, is laid upon what displacement, velocity and its
    square differ by from theirs: a motion that drifts makes a force that does.
    """
    starts = clean_cycles(trace.fastest)
    variance = float(np.var(trace.force[trace.compared]))
    if len(starts) < 3 or not variance > 0.0:
        return math.nan
    n_phases = max(8, round(float(np.mean(np.diff(starts)))))
    positions = starts[:-1, None] + np.diff(starts)[:, None] * (np.arange(n_phases) / n_phases)
    weights, index = _cubic(positions, len(trace.force))

    def off_mean(values: FloatArray) -> FloatArray:
        folded = _at(values, weights, index)
        return np.asarray((folded - folded.mean(axis=0)).ravel())

    x, v, f = trace.displacement, trace.velocity, trace.force
    columns = [off_mean(x), off_mean(v), off_mean(v * np.abs(v))]
    basis = np.stack([one / max(float(np.abs(one).max()), 1e-300) for one in columns], axis=-1)
    force = off_mean(f)
    rest = force - basis @ np.linalg.lstsq(basis.T @ basis, basis.T @ force, rcond=None)[0]
    whole = float(force @ force)
    return noise_floor(trace) * (float(rest @ rest) / whole if whole > 0.0 else 1.0)


def _at(values: FloatArray, weights: list[FloatArray], index: NDArray[np.int64]) -> FloatArray:
    """Return values between samples, by the weights of four neighbours."""
    found = weights[0] * values[index]
    for k, weight in enumerate(weights[1:], start=1):
        found += weight * values[index + k]
    return np.asarray(found)


def _cubic(positions: FloatArray, n: int) -> tuple[list[FloatArray], NDArray[np.int64]]:
    """Return Lagrange weights of four neighbours and the index of the first."""
    index = np.clip(np.floor(positions).astype(np.int64), 1, n - 3) - 1
    u = positions - index - 1
    return [
        -u * (u - 1.0) * (u - 2.0) / 6.0,
        (u + 1.0) * (u - 1.0) * (u - 2.0) / 2.0,
        -(u + 1.0) * u * (u - 2.0) / 2.0,
        (u + 1.0) * u * (u - 1.0) / 6.0,
    ], index


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
