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
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from damperfit.identification.settled import fast_length

if TYPE_CHECKING:
    from collections.abc import Sequence

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
    "score_covariance",
    "smoothed",
    "stationary_covariance",
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


def correlation_length(residuals: FloatArray, *, longest: int) -> int:
    """Return the lag, in samples, beyond which the residuals are not correlated.

    Parameters
    ----------
    residuals : numpy.ndarray
        Shape (n,).
    longest : int
        What to return when the correlation does not end before: a misfit that repeats with every
        cycle never does.
    """
    longest = max(1, min(longest, len(residuals) // 4))
    rho = autocorrelation(residuals, longest)
    # Bartlett: var(rho at a lag beyond m) is (1 + 2 sum of rho^2 up to m)/n.
    bars = _NO_CORRELATION * np.sqrt((2.0 * np.cumsum(rho * rho) - 1.0) / len(residuals))
    loud = np.flatnonzero(~(np.abs(rho[1:]) < bars[:-1])) + 1
    begins, ends = np.concatenate([[0], loud]), np.concatenate([loud, [longest + 1]])
    # Quiet for as long as the correlation itself lasted, and for five lags at least.
    is_quiet = ends - begins > np.maximum(begins, 5)
    return int(begins[np.argmax(is_quiet)]) if is_quiet.any() else longest


def score_covariance(scores: FloatArray, lag: int, *, stride: int = 1) -> FloatArray:
    """Return the covariance of the sum of scores that are correlated up to a lag.

    Parameters
    ----------
    scores : numpy.ndarray
        Shape (n, k), one log's.
    lag : int
        Correlation length, samples of the log.
    stride : int
        Samples of the log that each score is the sum of, so few that nothing is lost.

    Returns
    -------
    numpy.ndarray
        Shape (k, k), positive semi-definite.
    """
    n = stride * len(scores)
    window = flat_topped(lag, n)
    total = _windowed(scores, window, stride)
    if lag and not _is_positive(total):
        # A misfit that repeats with the cycle can do that; a triangle never gives a negative sum.
        total = _windowed(scores, 1.0 - np.arange(len(window)) / (2.0 * lag + 1.0), stride)
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


def _windowed(scores: FloatArray, window: FloatArray, stride: int) -> FloatArray:
    """Sum over lags of window times lagged products; the window holds the samples' lags from 0."""
    kernel = window if stride == 1 else _thinned(window.tobytes(), stride)
    total = lagged_products(scores, kernel[: len(scores)]) / stride
    lost = lost_share(window, stride * len(scores))
    return np.asarray(0.5 * (total + total.T) / (1.0 - lost))


@lru_cache(maxsize=64)  # logs alike have a few lengths of correlation
def _thinned(taps: bytes, stride: int) -> FloatArray:
    """Return what a window of lags becomes where products are known at every few lags alone.

    Between them they are what a windowed sinc makes of the known ones: of a band so narrow the
    products themselves.
    """
    window = np.frombuffer(taps)
    lags = np.arange(1 - len(window), len(window))
    reach = len(window) // stride + _SINC
    apart = lags / stride - np.arange(reach + 1)[:, None]
    taper = np.cos(0.5 * np.pi * np.clip(apart / _SINC, -1.0, 1.0)) ** 2
    return np.asarray((np.sinc(apart) * taper) @ window[np.abs(lags)])


def cycle_covariance(scores: Sequence[FloatArray], starts: Sequence[FloatArray]) -> FloatArray:
    """Return the same from sums over whole cycles: the jackknife over cycles, linearised.

    Leaving one cycle out moves the fit by the sum of its scores, to first order.

    Parameters
    ----------
    scores : sequence of numpy.ndarray
        One array (n_i, k) per log.
    starts : sequence of numpy.ndarray
        Boundaries of the cycles, in scores; one may be cut.
    """
    sums = [
        np.diff(_summed_up_to(part, edges), axis=0)
        for part, edges in zip(scores, starts, strict=True)
        if len(edges) > 1
    ]
    table = np.concatenate(sums) if sums else np.empty((0, scores[0].shape[1]))
    n = len(table)
    if n < 2:
        return np.full((scores[0].shape[1],) * 2, math.nan)
    table -= table.mean(axis=0)
    return np.asarray(table.T @ table * (n / (n - 1.0)))


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
