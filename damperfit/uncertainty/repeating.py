"""What of residuals repeats with the cycle, and whether noise can be all of it.

The residual is laid over itself cycle by cycle. What differs between cycles is noise (of both
channels); what repeats is lack of fit. With C cycles of scatter s^2 the mean residual of pure noise
has the power s^2/C, which is taken off::

    repeating = mean over phases of (mean residual)^2 - s^2/C
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from damperfit.statistics import fisher_chance, mean_of
from damperfit.uncertainty.correlated_noise import autocorrelation
from damperfit.uncertainty.rows import Phases

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from numpy.typing import NDArray

    from damperfit.recording import Stretch
    from damperfit.uncertainty.linearisation import Linearisation

    FloatArray = NDArray[np.float64]

__all__ = [
    "StretchResiduals",
    "cycle_correlation",
    "independent_phases",
    "is_beyond_chance",
    "residual_scatter",
    "residuals_by_stretch",
    "runs_ratio",
    "split_power",
]

# The repeating power of pure noise over its scatter is F-distributed; beyond the bar once in as
# many settings.
_CHANCE = 1e-6
# Misfit over noise where nothing repeats: noise of the displacement may double it.
_MUCH = 4.0


@dataclass(frozen=True, slots=True, eq=False)
class StretchResiduals:
    """The residuals of one stretch, 0 where none counts; of two cycles or more laid over.

    Attributes
    ----------
    stretch : Stretch
        Which.
    interval : float
        Sample interval, s.
    residuals : numpy.ndarray
        Shape (n,), N.
    folded, about : numpy.ndarray or None
        Shape (cycles, phases): the cycles, and what each differs from their mean by.
    """

    stretch: Stretch
    interval: float
    residuals: FloatArray
    folded: FloatArray | None = None
    about: FloatArray | None = None


def _scatter(about: FloatArray) -> float:
    """Mean square of what differs from cycle to cycle."""
    n_cycles, n_phases = about.shape
    return float(np.sum(about**2) / (n_phases * (n_cycles - 1)))


def split_power(parts: Sequence[StretchResiduals]) -> tuple[float, float, Callable[[], bool]]:
    """Return repeating and scattered mean squares, N^2, and whether noise cannot be all of it."""
    repeats, noise, expected, n_samples = 0.0, 0.0, 0.0, 0
    for part in parts:
        if part.folded is None or part.about is None:
            continue
        n, n_cycles, scatter = len(part.residuals), part.stretch.n_cycles, _scatter(part.about)
        n_samples += n
        mean_power = float(np.mean(part.folded.mean(axis=0) ** 2))
        repeats += n * (mean_power - scatter / n_cycles)
        expected += n * scatter / n_cycles
        noise += n * scatter
    if not n_samples:
        return _unrepeated(parts)
    ratio = 1.0 + repeats / max(expected, 1e-300)
    return repeats / n_samples, noise / n_samples, lambda: is_beyond_chance(parts, ratio)


def is_beyond_chance(parts: Sequence[StretchResiduals], ratio: float) -> bool:
    """Whether the power of the mean cycles over what noise has is beyond chance."""
    phases, others = 0.0, 0.0
    for part in parts:
        if part.about is not None:
            independent = independent_phases(part.about)
            phases += independent
            others += independent * (part.stretch.n_cycles - 1)
    return fisher_chance(phases, others, ratio) < _CHANCE


def _unrepeated(parts: Sequence[StretchResiduals]) -> tuple[float, float, Callable[[], bool]]:
    """The same where nothing repeats: misfit and noise by what was found above the filter's band.

    Noise of the displacement is not in that; it makes less than the force's in a usual log.
    """
    if any(part.stretch.n_cycles for part in parts):
        return math.nan, math.nan, lambda: False
    n = sum(len(part.residuals) for part in parts)
    noise = sum(len(part.residuals) * part.stretch.noise**2 for part in parts) / n
    whole = sum(float(part.residuals @ part.residuals) for part in parts) / n
    return whole - noise, noise, lambda: whole / max(noise, 1e-300) > _MUCH


def independent_phases(scatter: FloatArray) -> float:
    """Return how many independent squares the mean square of one cycle's noise is worth.

    From the scatter about the mean cycle, in which nothing repeats: n over the sum of its squared
    autocorrelation, and fewer where the noise is larger in part of the cycle (Satterthwaite).

    Parameters
    ----------
    scatter : numpy.ndarray
        Residuals about their mean cycle, shape (cycles, phases), at least two cycles.
    """
    n_cycles, n_phases = scatter.shape
    rho = autocorrelation(scatter.ravel(), n_phases // 2)
    power = np.einsum("ij,ij->j", scatter, scatter)
    # A variance from few cycles is itself uneven, by 2/(n - 1).
    uneven = n_phases * float(power @ power) / max(float(np.sum(power)) ** 2, 1e-300)
    uneven = max(uneven / (1.0 + 2.0 / (n_cycles - 1)), 1.0)
    return float(max(n_phases / (2.0 * float(rho @ rho) - 1.0) / uneven, 1.0))


def residuals_by_stretch(linearised: Linearisation) -> Iterator[StretchResiduals]:
    """Yield the residuals of each stretch."""
    for log, seen in zip(linearised.fit.logs, linearised.logs, strict=True):
        for slopes in seen.slopes:
            stretch, interval = slopes.rows.stretch, log.trace.interval
            counts = seen.weights[slopes.place] > 0.0
            residuals = seen.residuals[slopes.place]
            residuals = residuals if counts.all() else np.where(counts, residuals, 0.0)
            if stretch.n_cycles < 2:
                yield StretchResiduals(stretch, interval, residuals)
                continue
            is_folded = isinstance(slopes.rows, Phases)
            folded = slopes.residuals if is_folded else _fold(residuals, stretch)
            about = folded - np.add.reduce(folded) / len(folded)
            yield StretchResiduals(stretch, interval, residuals, folded, about)


def residual_scatter(residuals: FloatArray, stretch: Stretch) -> float:
    """Return the mean square of what differs from cycle to cycle, N^2: noise of both channels.

    Parameters
    ----------
    residuals : numpy.ndarray
        Shape (n,), over the stretch.
    stretch : Stretch
        Steady cycles; NaN for a single one.
    """
    if stretch.n_cycles < 2:
        return math.nan
    return float(np.mean(np.var(_fold(residuals, stretch), axis=0, ddof=1)))


def _fold(residuals: FloatArray, stretch: Stretch) -> FloatArray:
    """Residuals over cycles and phases, shape (cycles, phases)."""
    starts = stretch.cycle_starts - stretch.first
    lengths = np.diff(starts)
    n_phases = max(8, round(mean_of(lengths)))
    nearest = lengths[:, None] * (np.arange(n_phases) / n_phases)
    nearest += starts[:-1, None]
    np.rint(nearest, out=nearest)
    # Beyond an end it is the last sample.
    return residuals.take(nearest.astype(np.intp), mode="clip")


def cycle_correlation(parts: Sequence[StretchResiduals]) -> float:
    """Autocorrelation at a lag of one cycle, the largest of the stretches."""
    values = []
    for part in parts:
        residuals = part.residuals
        period = round(1.0 / (part.stretch.frequency * part.interval))
        if 2 * period < len(residuals):
            n, power = len(residuals), float(residuals @ residuals)
            rho = float(residuals[:-period] @ residuals[period:]) / power if power > 0.0 else 0.0
            values.append(rho * n / (n - period))
    return max(values, default=math.nan)


def runs_ratio(parts: Sequence[StretchResiduals]) -> float:
    """Sign changes of the residual over those of its scatter about the mean cycle."""
    found, expected = 0, 0
    for part in parts:
        if part.folded is not None and part.about is not None:
            found += _sign_changes(part.folded)
            expected += _sign_changes(part.about)
    return found / expected if expected else math.nan


def _sign_changes(rows: FloatArray) -> int:
    negative = np.signbit(rows)
    return int(np.count_nonzero(negative[:, 1:] != negative[:, :-1]))
