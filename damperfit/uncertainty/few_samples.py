r"""By how much errors of a short log are too small, and what puts them right.

A fit takes out of the residuals what its k parameters can follow, and a sum over lags that are
read off those residuals misses it. Three cycles at 7 Hz behind 30 Hz are worth some 30 independent
samples: of their noise five parameters take a fifth. What is missed is known for noise that is
white ahead of the filter, of covariance R behind it: the residuals have P R P^T with the projector
P of the fit, and the summed scores are expected to have::

    found   J^T (W o P R P^T) J / (1 - lost)      true   J^T R J

with the window W of lags. The ratio of the variances that follow, the mean over the fitted
parameters, is the first factor. The second makes 1.96 errors hold 95 % of Student's t: a variance
that a window w sums over n samples has n / sum w^2 degrees of freedom.

Without it errors are too short and intervals hold the truth too seldom
(`python -m tests.uncertainty.few_cycles`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from damperfit.conditioning import apply_filter
from damperfit.recording import FilterDesign
from damperfit.statistics import student_quantile
from damperfit.uncertainty.correlated_noise import (
    autocorrelation,
    flat_topped,
    lost_share,
    smoothed,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]

__all__ = [
    "ENOUGH",
    "ShortStretch",
    "filter_correlation",
    "independent_samples",
    "is_enough",
    "widening",
]

# Independent samples a parameter; with more, errors are hardly short.
ENOUGH = 50.0
# Samples to which lengths are rounded up: what a filter keeps of an impulse ends long before.
_LIKE_LONG = 1024
_NORMAL = 1.959963984540054  # what Student's t comes to with many freedoms, at 97.5 %


@dataclass(frozen=True, slots=True, eq=False)
class ShortStretch:
    """What one stretch gives to a fit.

    Attributes
    ----------
    slopes : numpy.ndarray
        Shape (n, k), weighted, by the fitted parameters.
    correlation : numpy.ndarray
        Shape (n,), autocorrelation of white noise behind the filter, from lag 0.
    lag : int
        Correlation length that was found, samples.
    """

    slopes: FloatArray
    correlation: FloatArray
    lag: int

    @property
    def independent(self) -> float:
        """Independent samples of noise."""
        return _independent(self.correlation)


def _independent(rho: FloatArray) -> float:
    return len(rho) / (2.0 * float(rho @ rho) - 1.0)


def is_enough(independent: Iterable[float], n_fitted: int) -> bool:
    """Return whether stretches hold so much that errors are hardly short.

    Parameters
    ----------
    independent : iterable of float
        Independent samples of each stretch.
    n_fitted : int
        Parameters that were fitted.
    """
    return not n_fitted or sum(independent) > ENOUGH * n_fitted


def independent_samples(design: FilterDesign, n: int) -> float:
    """Return how many independent samples n of white noise behind a filter are worth."""
    sections = np.ascontiguousarray(design.sections, dtype=np.float64)
    return _worth(sections.tobytes(), n, is_zero_phase=design.is_zero_phase)


@lru_cache(maxsize=64)
def _worth(sections: bytes, n: int, *, is_zero_phase: bool) -> float:
    return _independent(_correlation(sections, _rounded_up(n), is_zero_phase=is_zero_phase)[:n])


def filter_correlation(design: FilterDesign, n: int) -> FloatArray:
    """Return the autocorrelation of white noise behind a filter at lags 0 to n - 1, shape (n,)."""
    sections = np.ascontiguousarray(design.sections, dtype=np.float64)
    longer = _rounded_up(n)
    return _correlation(sections.tobytes(), longer, is_zero_phase=design.is_zero_phase)[:n]


def _rounded_up(n: int) -> int:
    return -(-n // _LIKE_LONG) * _LIKE_LONG


@lru_cache(maxsize=16)  # logs of one rig have one filter, and are as long to a few cycles
def _correlation(sections: bytes, n: int, *, is_zero_phase: bool) -> FloatArray:
    design = FilterDesign(np.frombuffer(sections).reshape(-1, 6), is_zero_phase, "")
    impulse = np.zeros(2 * n + 1)
    impulse[n] = 1.0
    found = autocorrelation(apply_filter(design, impulse), n - 1)
    found.flags.writeable = False
    return found


def widening(stretches: Sequence[ShortStretch]) -> float:
    """Return the factor, 1 or more, on the covariance of the scores of a setting.

    Parameters
    ----------
    stretches : sequence of ShortStretch
        All that were fitted together.
    """
    n_fitted = stretches[0].slopes.shape[1] if stretches else 0
    if is_enough((one.independent for one in stretches), n_fitted):
        return 1.0
    inverse = np.linalg.pinv(
        np.sum([one.slopes.T @ one.slopes for one in stretches], axis=0), hermitian=True
    )
    true = np.sum([one.slopes.T @ smoothed(one.slopes, one.correlation) for one in stretches], 0)
    found = np.sum([_expected(one, inverse, true) for one in stretches], axis=0)
    variances = [np.diag(inverse @ part @ inverse) for part in (true, found)]
    is_known = (variances[0] > 0.0) & (variances[1] > 0.0)
    ratio = (
        float(np.mean(variances[0][is_known] / variances[1][is_known])) if is_known.any() else 1.0
    )
    freedom = _freedom(stretches)
    student = student_quantile(freedom, 0.975) / _NORMAL
    return max(ratio, 1.0) * student**2


def _expected(one: ShortStretch, inverse: FloatArray, true: FloatArray) -> FloatArray:
    """Return what the window finds of the residuals on average, shape (k, k).

    P R P^T is R less a b^T + b a^T with a = J H^-1 and b = R J - a J^T R J / 2.
    """
    slopes = one.slopes
    window = flat_topped(one.lag, len(slopes))
    reach = len(window)
    total = slopes.T @ smoothed(slopes, window * one.correlation[:reach])
    a = slopes @ inverse
    b = smoothed(slopes, one.correlation) - 0.5 * a @ true
    for left, right in zip(a.T, b.T, strict=True):
        crossed = (slopes * left[:, None]).T @ smoothed(slopes * right[:, None], window)
        total -= crossed + crossed.T
    return np.asarray(total / (1.0 - lost_share(window, len(slopes))))


def _freedom(stretches: Sequence[ShortStretch]) -> float:
    """Return the degrees of freedom of all, each with the weight of its samples (Satterthwaite)."""
    sizes, others = 0.0, 0.0
    for one in stretches:
        n = len(one.slopes)
        window = flat_topped(one.lag, n)
        sizes += n
        others += n * (2.0 * float(window @ window) - 1.0)
    return max(sizes * sizes / others, 1.0)
