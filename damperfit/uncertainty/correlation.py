r"""How residuals are correlated, and the variance of sums of correlated numbers.

The error of a fit is linear in its scores g_t = J_t r_t (one row of the Jacobian times its
residual), so that its covariance needs the variance of their sum::

    M = sum over lags l of  w(l) sum_t g_t g_{t+l}^T,     w(l) = 1 up to m, falling to 0 at 2 m

The flat-topped window w leaves no bias where correlation ends before lag m; m is read from the
residual's own autocorrelation (Politis, "Adaptive bandwidth choice", J. Nonparametric Statistics,
2003, with Bartlett's variance of a sample autocorrelation in place of that of white noise, because
a filtered residual is far from white). No form of the correlation is assumed, and residuals that
are larger in part of the cycle than elsewhere are allowed for.

Where few samples hold most of what the log says of a parameter (a chamber that empties and fills
again), M rests on the few residuals there, which the fit has made small besides. The residuals'
autocovariance c over the whole stretch knows better how strong the noise is::

    M' = sum over lags l of  w(l) c(l) sum_t J_t J_{t+l}^T

It takes the noise to be alike everywhere; `larger` of both, direction by direction, errs least.

Numbers with the autocorrelation rho are worth n / (2 sum of rho^2 - 1) independent ones. Lags and
lengths are in samples, matrices (k, k) and positive semi-definite.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from damperfit.conditioning import apply_filter
from damperfit.identification.mean_cycle import fast_length
from damperfit.recording import FilterDesign
from damperfit.statistics import NORMAL_95, student_quantile

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]

# A sample autocorrelation within this many of its standard errors counts as none.
_NO_CORRELATION = 2.5
# Directions of less variance than this share of the largest are nothing but rounding.
_NOTHING = 1e-14
# Independent samples a parameter; with more, errors are hardly short.
_ENOUGH = 50.0
# Samples to which lengths are rounded up: what a filter keeps of an impulse ends long before.
_LIKE_LONG = 1024


def autocorrelation(residuals: FloatArray, n_lags: int) -> FloatArray:
    """Return the sample autocorrelation at lags 0 to ``n_lags``; 1, 0, 0, ... for zeros."""
    length = fast_length(len(residuals) + n_lags + 1)
    spectrum = np.fft.rfft(residuals, length)
    sums = np.fft.irfft(spectrum.real**2 + spectrum.imag**2, length)[: n_lags + 1]
    if not sums[0] > 0.0:
        return np.asarray(np.eye(1, n_lags + 1)[0])
    return np.asarray(sums / sums[0])


def independent(rho: FloatArray, n: float) -> float:
    """Return how many independent numbers n with an autocorrelation from lag 0 on are worth."""
    return n / (2.0 * float(rho @ rho) - 1.0)


def independent_samples(design: FilterDesign, n: int) -> float:
    """Return how many independent samples n of white noise behind a filter are worth."""
    sections = np.ascontiguousarray(design.sections, dtype=np.float64)
    longer = -(-n // _LIKE_LONG) * _LIKE_LONG
    return independent(_behind(sections.tobytes(), longer, design.is_zero_phase)[:n], n)


@lru_cache(maxsize=16)  # logs of one rig have one filter, and are as long to a few cycles
def _behind(sections: bytes, n: int, is_zero_phase: bool) -> FloatArray:  # noqa: FBT001
    """Autocorrelation of white noise behind a filter, (n,)."""
    design = FilterDesign(np.frombuffer(sections).reshape(-1, 6), is_zero_phase, "")
    impulse = np.zeros(2 * n + 1)
    impulse[n] = 1.0
    rho = autocorrelation(apply_filter(design, impulse), n - 1)
    rho.flags.writeable = False
    return rho


def correlation_length(residuals: FloatArray, *, longest: int) -> int:
    """Return the lag beyond which residuals are not correlated.

    `longest` where the correlation does not end before, as that of a misfit that repeats with every
    cycle never does.
    """
    n = len(residuals)
    longest = max(1, min(longest, n // 4))
    rho = autocorrelation(residuals, longest)
    # Bartlett: var(rho at a lag beyond m) is (1 + 2 sum of rho^2 up to m)/n.
    bars = _NO_CORRELATION * np.sqrt((2.0 * np.cumsum(rho * rho) - 1.0) / n)
    loud = np.flatnonzero(~(np.abs(rho[1:]) < bars[:-1])) + 1
    begins, ends = np.concatenate([[0], loud]), np.concatenate([loud, [longest + 1]])
    # Quiet for as long as the correlation itself lasted, and for five lags at least.
    is_quiet = ends - begins > np.maximum(begins, 5)
    return int(begins[np.argmax(is_quiet)]) if is_quiet.any() else longest


def score_covariance(scores: FloatArray, lag: int) -> FloatArray:
    """Return M of the scores of one stretch, (n, k), that are correlated up to a lag."""
    n = len(scores)

    def windowed(window: FloatArray) -> FloatArray:
        length = fast_length(n + len(window))
        rows = np.fft.rfft(np.ascontiguousarray(scores.T), length, axis=1).view(np.float64)
        total = (rows * _frequency_weights(window.tobytes(), length)) @ rows.T / length
        # The fit takes this share of the variance by making the sum of the scores zero.
        lost = min((2.0 * float(np.sum(window)) - 1.0) / n, 0.5)
        return np.asarray(0.5 * (total + total.T) / (1.0 - lost))

    window = _flat_topped(lag, n)
    total = windowed(window)
    if lag and not _is_positive(total):
        # A misfit that repeats with the cycle can do that; a triangle never gives a negative sum.
        total = windowed(1.0 - np.arange(len(window)) / (2.0 * lag + 1.0))
    return total


def stationary_covariance(jacobian: FloatArray, residuals: FloatArray, lag: int) -> FloatArray:
    """Return M' of one stretch: slopes (n, k) and residuals (n,) that are alike everywhere."""
    n = len(residuals)
    window = _flat_topped(lag, n)
    covariance = autocorrelation(residuals, len(window) - 1) * window
    covariance *= float(residuals @ residuals) / n
    length = fast_length(2 * n)
    # No frequency has less noise than none; the window alone would let some.
    gain = np.maximum(_gain(covariance, length), 0.0)
    seen = np.fft.rfft(jacobian, length, axis=0) * gain[:, None]
    total = jacobian.T @ np.fft.irfft(seen, length, axis=0)[:n]
    return np.asarray(0.5 * (total + total.T))


def _flat_topped(lag: int, n: int) -> FloatArray:
    """The window of lags from 0 on, at most n: 1 up to a lag, falling to 0 at its double."""
    lags = np.arange(min(2 * lag + 1, n))
    return np.asarray(np.clip(2.0 - lags / max(lag, 1), 0.0, 1.0) if lag else np.ones(1))


def _gain(kernel: FloatArray, length: int) -> FloatArray:
    """What a symmetric kernel, given from lag 0, makes of each frequency."""
    reach = len(kernel)
    whole = np.zeros(length)
    whole[:reach] = kernel
    whole[length - reach + 1 :] = kernel[:0:-1]
    return np.asarray(np.fft.rfft(whole).real)


@lru_cache(maxsize=16)  # logs alike have a few lengths of correlation
def _frequency_weights(taps: bytes, length: int) -> FloatArray:
    """What real and imaginary parts count in sums over frequencies, both ways."""
    weight = 2.0 * _gain(np.frombuffer(taps), length)
    weight[0] *= 0.5
    if length % 2 == 0:
        weight[-1] *= 0.5
    return np.repeat(weight, 2)


def _is_positive(matrix: FloatArray) -> bool:
    variances = matrix.diagonal()
    if not all(variance > 0.0 for variance in variances.tolist()):  # NaN is not
        return False
    scale = np.sqrt(variances)
    return bool(np.linalg.eigvalsh(matrix / (scale[:, None] * scale))[0] > 0.0)


def larger(one: FloatArray, other: FloatArray) -> FloatArray:
    """Return the larger of two covariances in each direction in which both are independent."""
    scale = np.sqrt(np.maximum(np.diag(one), np.diag(other)))
    scale = np.where(scale > 0.0, scale, 1.0)
    unit = np.outer(scale, scale)
    values, vectors = np.linalg.eigh(other / unit)
    is_known = values > _NOTHING * max(float(values[-1]), 1e-300)
    if not is_known.any():
        return one
    root = vectors[:, is_known] * np.sqrt(values[is_known])
    inverse = vectors[:, is_known] / np.sqrt(values[is_known])
    ratios, turned = np.linalg.eigh(inverse.T @ (one / unit) @ inverse)
    axes = root @ turned
    # What `one` has beyond the other is added to it, so that nothing of it is lost.
    more = (axes * np.maximum(1.0 - ratios, 0.0)) @ axes.T
    return np.asarray(one + unit * more)


def cycle_covariance(sums: Sequence[FloatArray]) -> FloatArray:
    """Return M from the sums of the scores over whole cycles, (cycles, k) for each stretch.

    It is the jackknife over cycles, linearised: leaving one out moves the fit by the sum of its
    scores. NaN for less than two cycles.
    """
    table = np.concatenate(sums)
    n = len(table)
    if n < 2:
        return np.full((table.shape[1],) * 2, math.nan)
    table -= table.mean(axis=0)
    return np.asarray(table.T @ table * (n / (n - 1.0)))


def sums_by_cycle(scores: FloatArray, edges: FloatArray) -> FloatArray:
    """Return the sums of scores (n, k) between edges of cycles, in samples: (cycles, k)."""
    if len(edges) < 2:
        return np.empty((0, scores.shape[1]))
    n = len(scores)
    before = np.vstack([np.zeros(scores.shape[1]), np.cumsum(scores, axis=0)])
    at = np.clip(edges, 0.0, n)
    whole = np.minimum(at.astype(np.int64), n - 1)
    inside = (at - whole)[:, None] * (before[whole + 1] - before[whole])
    return np.asarray(np.diff(before[whole] + inside, axis=0))


def widening(stretches: Sequence[tuple[int, float, int]], n_fitted: int) -> float:
    """Return the factor, 1 or more, on the covariance of the scores of a short log.

    A fit takes out of the residuals what its parameters can follow: of N independent samples k
    parameters take k/N of the noise. And a variance that a window w sums over n samples has only
    n / sum w^2 degrees of freedom: the factor makes 1.96 errors hold 95 % of Student's t
    (`python -m tests.uncertainty.few_cycles`). Of each stretch samples, independent ones among them
    and correlation length.
    """
    n_independent = sum(worth for _, worth, _ in stretches)
    if not n_fitted or n_independent > _ENOUGH * n_fitted:
        return 1.0
    sizes, spread = 0, 0.0
    for n, _, lag in stretches:
        window = _flat_topped(lag, n)
        sizes += n
        spread += n * (2.0 * float(window @ window) - 1.0)
    student = student_quantile(max(sizes * sizes / spread, 1.0), 0.975) / NORMAL_95
    return student**2 * n_independent / max(n_independent - n_fitted, 0.5 * n_independent)
