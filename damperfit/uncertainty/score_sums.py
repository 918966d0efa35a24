"""Sums over the samples of a setting's logs that its errors are made of.

Each stretch gives its part of the information, of the summed scores and of their covariance; see
`damperfit.uncertainty.linearisation`. Nothing is correlated across a gap between stretches.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from damperfit.uncertainty.correlated_noise import (
    correlation_length,
    larger,
    repeated_covariance,
    score_covariance,
    stationary_covariance,
    sums_by_cycle,
)
from damperfit.uncertainty.rows import EverySample, Phases

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from damperfit.recording import Trace

    FloatArray = NDArray[np.float64]

__all__ = ["ScoreSums", "Slopes"]

# Residuals still correlated after this share of a cycle repeat with the cycle: a misfit, no noise.
_LONGEST_CORRELATION = 0.25
# s; where nothing repeats, a chamber that cavitates remembers noise for as long as it is empty.
_LONGEST_MOVING = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class Slopes:
    """Derivatives of the modelled force over one stretch.

    Attributes
    ----------
    rows : EverySample or Phases
        Where they are taken.
    place : slice
        Of the stretch among the compared samples.
    by : numpy.ndarray
        Shape (m, k), by u in the order of the model: of one cycle, where every one has the same.
    gas : numpy.ndarray
        Shape (m, c), by the logarithms of the model's conditions, such as gas pressure.
    residuals : numpy.ndarray
        Shape (cycles, m), measured minus modelled force there, N.
    """

    rows: EverySample | Phases
    place: slice
    by: FloatArray
    gas: FloatArray
    residuals: FloatArray

    def read(self, values: FloatArray) -> FloatArray:
        """Return values at the compared samples at the rows: (cycles, m)."""
        return self.rows.read(values[self.place])


@dataclass(slots=True, eq=False)
class ScoreSums:
    """What is summed, stretch by stretch.

    Attributes
    ----------
    information, pulls, covariances : list of numpy.ndarray
        Of each stretch: H, (k, k); summed scores by what is merely supposed, (k, s); covariance of
        the summed scores, (k, k).
    lags : list of int
        Correlation lengths, samples.
    gradients, cycles : list of numpy.ndarray
        Summed scores, (k,), and those of each whole cycle, (cycles, k).
    """

    information: list[FloatArray] = field(default_factory=list)
    pulls: list[FloatArray] = field(default_factory=list)
    covariances: list[FloatArray] = field(default_factory=list)
    lags: list[int] = field(default_factory=list)
    gradients: list[FloatArray] = field(default_factory=list)
    cycles: list[FloatArray] = field(default_factory=list)

    def add(
        self,
        trace: Trace,
        slopes: Slopes,
        weights: FloatArray | None,
        supposed: FloatArray | None,
    ) -> None:
        """Add a stretch.

        Parameters
        ----------
        trace : Trace
            Its log.
        slopes : Slopes
            Its derivatives, m rows of them.
        weights : numpy.ndarray or None
            Shape (n,), what the compared samples of the log count; None where all count alike.
        supposed : numpy.ndarray or None
            Shape (s, m), the force that a standard error of what is merely supposed makes.
        """
        rows, by, rest = slopes.rows, slopes.by, slopes.residuals
        lag = self._lag(trace, rows, rest)
        if weights is not None:
            # Phases are taken where the samples of a stretch count alike.
            weight = slopes.read(weights)[0]
            by, rest = by * weight[:, None], rest * weight
            supposed = None if supposed is None else supposed * weight
        times = rows.spacing * rows.n_cycles
        self.information.append(times * (by.T @ by))
        if supposed is not None:
            self.pulls.append(times * (by.T @ supposed.T))
        if isinstance(rows, Phases):
            self.cycles.append(rows.spacing * (rest @ by))
            self.gradients.append(self.cycles[-1].sum(axis=0))
            found = repeated_covariance(rest, by, lag, spacing=rows.spacing)
        else:
            scores = by * rest[0][:, None]
            edges = rows.stretch.cycle_starts - rows.stretch.first
            self.cycles.append(sums_by_cycle(scores, edges))
            self.gradients.append(scores.sum(axis=0))
            found = score_covariance(scores, lag)
            if not rows.stretch.n_cycles:
                # Cycles repeat what a few samples tell; elsewhere those few may be all there is.
                found = larger(found, stationary_covariance(by, rest[0], lag))
        self.lags.append(lag)
        self.covariances.append(found)

    @staticmethod
    def _lag(trace: Trace, rows: EverySample | Phases, residuals: FloatArray) -> int:
        """How long the residuals of a stretch are correlated, in samples."""
        stretch = rows.stretch
        is_cyclic = bool(stretch.n_cycles)
        longest = _LONGEST_CORRELATION / stretch.frequency if is_cyclic else _LONGEST_MOVING
        return correlation_length(
            residuals.ravel(), longest=round(longest / trace.interval), spacing=rows.spacing
        )
