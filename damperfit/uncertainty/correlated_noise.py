r"""The variance of sums of correlated numbers.

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

Of cycles that repeat J is one cycle's: products of residuals of the same phase are summed over the
cycles first. Where scores are known at every few lags alone, the lags between them are what a
windowed sinc makes of the known ones: of a band so narrow the products themselves.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from damperfit.identification.mean_cycle import fast_length

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]

__all__ = [
    "autocorrelation",
    "correlation_length",
    "cycle_covariance",
    "flat_topped",
    "lagged_products",
    "larger",
    "lost_share",
    "repeated_covariance",
    "score_covariance",
    "smoothed",
    "stationary_covariance",
    "sums_by_cycle",
]

# A sample autocorrelation within this many of its standard errors counts as none.
_NO_CORRELATION = 2.5
# Known lags on each side that a value between them is made of.
_SINC = 6
# Directions of less variance than this share of the largest are nothing but rounding.
_NOTHING = 1e-14


def autocorrelation(residuals: FloatArray, n_lags: int) -> FloatArray:
    """Return the sample autocorrelation at lags 0 to ``n_lags``; 1, 0, 0, ... for zeros."""
    length = fast_length(len(residuals) + n_lags + 1)
    spectrum = np.fft.rfft(residuals, length)
    sums = np.fft.irfft(spectrum.real**2 + spectrum.imag**2, length)[: n_lags + 1]
    if not sums[0] > 0.0:
        return np.asarray(np.eye(1, n_lags + 1)[0])
    return np.asarray(sums / sums[0])


def correlation_length(residuals: FloatArray, *, longest: int, spacing: float = 1.0) -> int:
    """Return the lag, in samples, beyond which the residuals are not correlated.

    Parameters
    ----------
    residuals : numpy.ndarray
        Shape (n,).
    longest : int
        What to return when the correlation does not end before: a misfit that repeats with every
        cycle never does.
    spacing : float
        Samples from one residual to the next, so few that nothing is lost.
    """
    n = spacing * len(residuals)
    longest = max(1, min(longest, int(n) // 4))
    if spacing == 1.0:
        rho = autocorrelation(residuals, longest)
    else:
        at, counts = _between_lags(longest + 1, _rounded(spacing))
        known = autocorrelation(residuals, int(at[-1, -1]))
        rho = np.einsum("ij,ij->j", counts, known[at])
    # Bartlett: var(rho at a lag beyond m) is (1 + 2 sum of rho^2 up to m)/n.
    bars = _NO_CORRELATION * np.sqrt((2.0 * np.cumsum(rho * rho) - 1.0) / n)
    loud = np.flatnonzero(~(np.abs(rho[1:]) < bars[:-1])) + 1
    begins, ends = np.concatenate([[0], loud]), np.concatenate([loud, [longest + 1]])
    # Quiet for as long as the correlation itself lasted, and for five lags at least.
    is_quiet = ends - begins > np.maximum(begins, 5)
    return int(begins[np.argmax(is_quiet)]) if is_quiet.any() else longest


def score_covariance(scores: FloatArray, lag: int) -> FloatArray:
    """Return the covariance of the sum of scores that are correlated up to a lag.

    Parameters
    ----------
    scores : numpy.ndarray
        Shape (n, k), one log's.
    lag : int
        Correlation length, samples of the log.

    Returns
    -------
    numpy.ndarray
        Shape (k, k), positive semi-definite.
    """
    return _covariance(lambda kernel: lagged_products(scores, kernel), lag, len(scores))


def repeated_covariance(
    residuals: FloatArray, slopes: FloatArray, lag: int, *, spacing: float
) -> FloatArray:
    """Return the covariance of the sum of scores whose slopes are the same in every cycle.

    Parameters
    ----------
    residuals : numpy.ndarray
        Shape (cycles, m).
    slopes : numpy.ndarray
        Shape (m, k); a score is its residual times these, for each of the samples it stands for.
    lag : int
        Correlation length, samples of the log.
    spacing : float
        Samples from one residual to the next, so few that nothing is lost.

    Returns
    -------
    numpy.ndarray
        Shape (k, k), positive semi-definite.
    """
    scores = (residuals[:, :, None] * slopes).reshape(residuals.size, -1)

    def products(window: FloatArray) -> FloatArray:
        kernel = _thinned(window.tobytes(), _rounded(spacing))[: residuals.size]
        return spacing * lagged_products(scores, kernel)

    return _covariance(products, lag, round(spacing * residuals.size))


def _covariance(
    products: Callable[[FloatArray], FloatArray], lag: int, n_samples: int
) -> FloatArray:
    """The covariance of a sum from what a window of lags makes of the products of its terms."""

    def windowed(window: FloatArray) -> FloatArray:
        total = products(window)
        return np.asarray(0.5 * (total + total.T) / (1.0 - lost_share(window, n_samples)))

    window = flat_topped(lag, n_samples)
    total = windowed(window)
    if lag and not _is_positive(total):
        # A misfit that repeats with the cycle can do that; a triangle never gives a negative sum.
        total = windowed(1.0 - np.arange(len(window)) / (2.0 * lag + 1.0))
    return total


def flat_topped(lag: int, n: int) -> FloatArray:
    """Return the window of lags from 0 on: 1 up to a lag, falling to 0 at its double.

    Parameters
    ----------
    lag : int
        Correlation length, samples.
    n : int
        Samples there are.
    """
    lags = np.arange(min(2 * lag + 1, n))
    return np.asarray(np.clip(2.0 - lags / max(lag, 1), 0.0, 1.0) if lag else np.ones(1))


def lost_share(window: FloatArray, n: int) -> float:
    """Return the share of the variance that the fit takes by making the sum of the scores zero."""
    return min((2.0 * float(np.sum(window)) - 1.0) / n, 0.5)


def smoothed(columns: FloatArray, kernel: FloatArray) -> FloatArray:
    """Return columns, shape (n, k), convolved with a symmetric kernel that is given from lag 0."""
    n = len(columns)
    length = fast_length(n + len(kernel))
    gain = _gain(kernel, length)
    return np.asarray(
        np.fft.irfft(np.fft.rfft(columns, length, axis=0) * gain[:, None], length, axis=0)[:n]
    )


def lagged_products(columns: FloatArray, kernel: FloatArray) -> FloatArray:
    """Return the products of columns, shape (n, k), with themselves `smoothed`, shape (k, k).

    They are sums over frequencies too, for which nothing has to be brought back.
    """
    length = fast_length(len(columns) + len(kernel))
    rows = np.fft.rfft(np.ascontiguousarray(columns.T), length, axis=1)
    parts = rows.view(np.float64)  # real and imaginary ones in turn
    return np.asarray((parts * _weights(kernel.tobytes(), length)) @ parts.T / length)


@lru_cache(maxsize=16)  # logs alike have a few lengths of correlation
def _weights(taps: bytes, length: int) -> FloatArray:
    """What real and imaginary parts count in sums over frequencies, both ways."""
    weight = 2.0 * _gain(np.frombuffer(taps), length)
    weight[0] *= 0.5
    if length % 2 == 0:
        weight[-1] *= 0.5
    return np.repeat(weight, 2)


def _gain(kernel: FloatArray, length: int) -> FloatArray:
    """What a symmetric kernel, given from lag 0, makes of each frequency."""
    reach = len(kernel)
    whole = np.zeros(length)
    whole[:reach] = kernel
    whole[length - reach + 1 :] = kernel[:0:-1]
    return np.asarray(np.fft.rfft(whole).real)


def stationary_covariance(jacobian: FloatArray, residuals: FloatArray, lag: int) -> FloatArray:
    """Return the covariance of the summed scores of noise that is alike everywhere.

    Parameters
    ----------
    jacobian : numpy.ndarray
        Shape (n, k), one stretch's.
    residuals : numpy.ndarray
        Shape (n,).
    lag : int
        Correlation length, samples.

    Returns
    -------
    numpy.ndarray
        Shape (k, k), positive semi-definite.
    """
    n = len(residuals)
    reach = min(2 * lag + 1, n)
    window = np.clip(2.0 - np.arange(reach) / max(lag, 1), 0.0, 1.0)
    covariance = autocorrelation(residuals, reach - 1) * float(residuals @ residuals) / n * window
    length = fast_length(2 * n)
    # No frequency has less noise than none; the window alone would let some.
    gain = np.maximum(_gain(covariance, length), 0.0)
    seen = np.fft.rfft(jacobian, length, axis=0) * gain[:, None]
    smooth = np.fft.irfft(seen, length, axis=0)[:n]
    total = jacobian.T @ smooth
    return np.asarray(0.5 * (total + total.T))


def larger(one: FloatArray, other: FloatArray) -> FloatArray:
    """Return the covariance that has the larger variance of two in every direction.

    Parameters
    ----------
    one, other : numpy.ndarray
        Shape (k, k), positive semi-definite.

    Returns
    -------
    numpy.ndarray
        Shape (k, k): in the directions in which both are independent, the larger of each.
    """
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


def _rounded(spacing: float) -> float:
    """To three digits, so that logs alike are one: lags are off by half a hundredth at most."""
    return float(f"{spacing:.3g}")


@lru_cache(maxsize=16)  # logs alike have a few lengths of correlation
def _thinned(taps: bytes, spacing: float) -> FloatArray:
    """Return what a window of lags becomes where products are known at every few lags alone."""
    window = np.frombuffer(taps)
    at, counts = _known_around(np.arange(1 - len(window), len(window)), spacing)
    counts *= np.concatenate([window[:0:-1], window])
    first = int(at[0, 0])  # as far before lag 0 as the last one behind it
    kernel = np.bincount((at - first).ravel(), weights=counts.ravel())[-first:]
    kernel.flags.writeable = False
    return np.asarray(kernel, dtype=np.float64)


@lru_cache(maxsize=8)  # logs alike have one; of cycles of a minute it is some 20 MB
def _between_lags(n_lags: int, spacing: float) -> tuple[NDArray[np.int64], FloatArray]:
    """Return the known lags, none below 0, that each of so many is made of, and what they count."""
    at, counts = _known_around(np.arange(n_lags), spacing)
    at = np.abs(at)
    at.flags.writeable = counts.flags.writeable = False
    return at, counts


def _known_around(lags: NDArray[np.int64], spacing: float) -> tuple[NDArray[np.int64], FloatArray]:
    """The known lags on both sides of others, and what they count for each: (known, others)."""
    apart = lags / spacing
    at = np.floor(apart).astype(np.int64) + np.arange(1 - _SINC, _SINC + 1)[:, None]
    apart = apart - at
    counts = np.sinc(apart) * np.cos(0.5 * np.pi / _SINC * apart) ** 2
    counts /= counts.sum(axis=0)
    return at, counts


def cycle_covariance(sums: Sequence[FloatArray]) -> FloatArray:
    """Return the same from sums over whole cycles: the jackknife over cycles, linearised.

    Leaving one cycle out moves the fit by the sum of its scores, to first order.

    Parameters
    ----------
    sums : sequence of numpy.ndarray
        Sums of the scores over each cycle, (cycles, k) for each stretch; none where none is whole.
    """
    table = np.concatenate(sums)
    n = len(table)
    if n < 2:
        return np.full((table.shape[1],) * 2, math.nan)
    table -= table.mean(axis=0)
    return np.asarray(table.T @ table * (n / (n - 1.0)))


def sums_by_cycle(scores: FloatArray, edges: FloatArray) -> FloatArray:
    """Return the sums of scores (n, k) over cycles, one of which may be cut: (cycles, k).

    Parameters
    ----------
    scores : numpy.ndarray
        Of a stretch.
    edges : numpy.ndarray
        Boundaries of its cycles, in scores; one alone, or none, where it has no cycle.
    """
    if len(edges) < 2:
        return np.empty((0, scores.shape[1]))
    return np.diff(_summed_up_to(scores, edges), axis=0)


def _summed_up_to(scores: FloatArray, edges: FloatArray) -> FloatArray:
    """Sums of the scores (n, k) before each edge."""
    n = len(scores)
    sums = np.zeros((scores.shape[1], n + 1))
    np.cumsum(scores.T, axis=1, out=sums[:, 1:])  # slopes lie parameter by parameter
    at = np.minimum(np.maximum(edges, 0.0), n)
    whole = np.minimum(at.astype(np.int64), n - 1)
    before = sums[:, whole].T.copy()
    return np.asarray(before + (at - whole)[:, None] * (sums[:, whole + 1].T - before))


def _is_positive(matrix: FloatArray) -> bool:
    variances = matrix.diagonal()
    if not all(one > 0.0 for one in variances.tolist()):  # NaN is not
        return False
    scale = np.sqrt(variances)
    return bool(np.linalg.eigvalsh(matrix / (scale[:, None] * scale))[0] > 0.0)
