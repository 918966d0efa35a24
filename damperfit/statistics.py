"""Quantiles that several layers judge by.

SciPy and NumPy have them too; SciPy takes longer to load than a fit takes, and NumPy's percentiles
load its masked arrays, which `inspect` would wait for.
"""

import math
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

# Within so many standard errors lie 95 of 100 normal values.
NORMAL_95 = 1.959964
# Below lies a chi-square of one freedom in 95 of 100 cases: NORMAL_95 squared.
CHI_SQUARED_95 = 3.84

_FEW = 64  # values
# Exponents and weights of the double-exponential rule of Takahasi and Mori (1974) for integrals
# from a place on to where all is nothing: 1e-12 of them.
_STEP = 0.05
_PLACES = np.arange(-4.0, 4.0, _STEP)
_REACH = np.exp(0.5 * np.pi * np.sinh(_PLACES))
_WEIGHTS = 0.5 * np.pi * np.cosh(_PLACES) * _REACH * _STEP
_INFINITE = 1e18  # degrees of freedom, of a mean square that is known
_HALVINGS = 60  # of 1400, to the last bit of a logarithm


def independent_share(power: np.ndarray) -> float:
    """Return the share of numbers that count as independent, by their power at even places.

    Places of a spectrum: how they are correlated; of a cycle: how uneven they are (Satterthwaite).
    """
    mean = mean_of(power)
    return mean * mean / mean_of(power * power) if mean > 0.0 else 1.0


def largest_of(values: np.ndarray) -> float:
    """Return the largest size of an array's values, 0 of none; NaN where one is no number."""
    return float(np.maximum.reduce(np.abs(values), axis=None)) if values.size else 0.0


def mean_of(values: np.ndarray) -> float:
    """Return the mean of an array, as `numpy.mean` does, which first asks long what it is given."""
    return float(np.add.reduce(values, axis=None)) / values.size if values.size else math.nan


def variance_of(values: np.ndarray) -> float:
    """Return the variance of an array, as `numpy.var` does."""
    beside = values - mean_of(values)
    return mean_of(np.multiply(beside, beside, out=beside))


def median(values: ArrayLike) -> float:
    """Return the middle of finite values, as `numpy.median` does; NaN where there are none."""
    flat = np.asarray(values, dtype=np.float64).ravel()
    if not len(flat):
        return math.nan
    low, high = (len(flat) - 1) // 2, len(flat) // 2
    # So few are in order sooner than an array is parted.
    order = sorted(flat.tolist()) if len(flat) <= _FEW else np.partition(flat, (low, high))
    return 0.5 * float(order[low] + order[high])


def percentiles(values: ArrayLike, *shares: float) -> tuple[float, ...]:
    """Return what so many per cent of values stay below, as `numpy.percentile` does."""
    order = np.sort(np.asarray(values, dtype=np.float64), axis=None)
    ranks = (len(order) - 1) * np.array(shares) / 100.0
    return tuple(np.interp(ranks, np.arange(len(order)), order).tolist())


def student_quantile(freedom: float, share: float) -> float:
    """Return what Student's t stays below in a share of all cases."""
    if not (freedom > 0.0 and 0.0 < share < 1.0):
        return math.nan
    if share < 0.5:
        return -student_quantile(freedom, 1.0 - share)
    # t^2 is Fisher's F of one freedom; from the tail, for a share near 1 keeps no digits of it.
    return math.sqrt(_fisher_beyond(1.0, freedom, 2.0 * (1.0 - share)))


def chi_squared_quantile(freedom: float, share: float) -> float:
    """Return what a chi-square stays below in a share of all cases."""
    if not (freedom > 0.0 and 0.0 < share < 1.0):
        return math.nan
    return freedom * _fisher_beyond(freedom, _INFINITE, 1.0 - share)


@lru_cache(maxsize=256)
def _fisher_beyond(above: float, below: float, chance: float) -> float:
    """The ratio of two mean squares that is exceeded with a chance."""
    low, high = -700.0, 700.0
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        is_below = fisher_chance(above, below, math.exp(middle)) > chance
        low, high = (middle, high) if is_below else (low, middle)
    return math.exp(low)


def fisher_chance(above: float, below: float, ratio: float) -> float:
    """Return the chance with which the ratio of two mean squares exceeds a value."""
    if not (above > 0.0 and below > 0.0 and math.isfinite(ratio)):
        return math.nan
    if ratio <= 0.0:
        return 1.0
    a, b, z = 0.5 * above, 0.5 * below, math.log(ratio)
    tail = _tail(a, b, z, math.copysign(1.0, z))
    share = tail / (_tail(a, b, 0.0, 1.0) + _tail(a, b, 0.0, -1.0))
    return share if z >= 0.0 else 1.0 - share


@lru_cache(maxsize=256)
def _tail(a: float, b: float, start: float, side: float) -> float:
    """The integral of the density of z = ln F from a place away from its top, where it is 1.

    The top is at 0; beside it the density falls as exp(a z - (a + b) ln(1 + p (e^z - 1))) with
    p = a/(a + b), on either side without a bend back.
    """
    p = a / (a + b)
    slope = a * (1.0 - math.exp(start) / (1.0 + p * math.expm1(start)))
    length = 1.0 / max(abs(slope), math.sqrt(a * (1.0 - p)))
    at = start + side * length * _REACH
    with np.errstate(over="ignore"):
        density = np.exp(a * at - (a + b) * np.log1p(p * np.expm1(at)))
    return length * float(_WEIGHTS @ density)
