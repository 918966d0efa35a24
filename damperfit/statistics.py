"""Quantiles that several layers judge by.

SciPy and NumPy have them too; SciPy takes longer to load than a fit takes, and NumPy's percentiles
load its masked arrays, which `inspect` would wait for.
"""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

# Within so many standard errors lie 95 of 100 normal values.
NORMAL_95 = 1.959964
# Below lies a chi-square of one freedom in 95 of 100 cases: NORMAL_95 squared.
CHI_SQUARED_95 = 3.84

_FEW = 64  # values; so many are in order sooner than an array is parted
_EXACT = 1e-15  # of a double, for series that end
_NEAR = 1e-9  # what a step of Newton leaves over is its square
_TINY = 1e-300
_STEPS = 1000  # a unit of a logarithm each; ten are enough but for chances near none
_STIRLING_FROM = 50.0  # its next term is below 1e-15
_FOREVER = 100_000  # terms; a fraction of a million freedoms needs some thousand


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
    half = len(flat) // 2
    if not len(flat):
        return math.nan
    if len(flat) <= _FEW:
        order = sorted(flat.tolist())
        return order[half] if len(order) % 2 else 0.5 * (order[half - 1] + order[half])
    if len(flat) % 2:
        return float(np.partition(flat, half)[half])
    halves = np.partition(flat, half)
    return 0.5 * (float(halves[:half].max()) + float(halves[half]))


def percentiles(values: ArrayLike, *shares: float) -> tuple[float, ...]:
    """Return what so many per cent of values stay below, as `numpy.percentile` does."""
    flat = np.asarray(values, dtype=np.float64).ravel()
    ranks = [(len(flat) - 1) * (share / 100.0) for share in shares]
    places = {int(rank) for rank in ranks} | {min(int(rank) + 1, len(flat) - 1) for rank in ranks}
    order = np.partition(flat, sorted(places))
    return tuple(_between(order, rank) for rank in ranks)


def _between(order: np.ndarray, rank: float) -> float:
    """Return what lies at a rank; from the nearer of both neighbours, to the last digit."""
    place = int(rank)
    low, high = float(order[place]), float(order[min(place + 1, len(order) - 1)])
    share = rank - place
    return low + (high - low) * share if share < 0.5 else high - (high - low) * (1.0 - share)


def student_quantile(freedom: float, share: float) -> float:
    """Return what Student's t stays below in a share of all cases."""
    if not (freedom > 0.0 and 0.0 < share < 1.0):
        return math.nan
    if share < 0.5:
        return -student_quantile(freedom, 1.0 - share)
    beyond = 2.0 * (1.0 - share)
    if beyond == 1.0:
        return 0.0
    # t^2 is Fisher's F of one freedom; from the tail, for a share near 1 keeps no digits of it.
    return math.sqrt(math.exp(_where(_fisher_tail(1.0, freedom), beyond, 0.0)))


def fisher_chance(above: float, below: float, ratio: float) -> float:
    """Return the chance with which the ratio of two mean squares exceeds a value."""
    if not (above > 0.0 and below > 0.0 and math.isfinite(ratio)):
        return math.nan
    return _fisher_tail(above, below)(math.log(ratio))[0] if ratio > 0.0 else 1.0


def chi_squared_quantile(freedom: float, share: float) -> float:
    """Return what a chi-square stays below in a share of all cases."""
    if not (freedom > 0.0 and 0.0 < share < 1.0):
        return math.nan
    half = 0.5 * freedom

    def beyond(log_x: float) -> tuple[float, float]:
        x = 0.5 * math.exp(log_x)
        power = math.exp(half * math.log(x) - x - math.lgamma(half))
        return _gamma_beyond(half, x, power), power

    return math.exp(_where(beyond, 1.0 - share, math.log(freedom)))


def _fisher_tail(above: float, below: float) -> Callable[[float], tuple[float, float]]:
    """The chance that F exceeds a value, and its slope, by the value's logarithm."""
    a, b = 0.5 * above, 0.5 * below
    whole = _gamma_ratio(b, a) - math.lgamma(a)

    def beyond(log_f: float) -> tuple[float, float]:
        ratio = math.exp(log_f) * above / below
        x, rest = ratio / (1.0 + ratio), 1.0 / (1.0 + ratio)
        power = math.exp(whole + a * math.log(x) - b * math.log1p(ratio))
        if x > (a + 1.0) / (a + b + 2.0):
            return power * _beta_fraction(b, a, rest) / b, power
        return 1.0 - power * _beta_fraction(a, b, x) / a, power

    return beyond


def _where(beyond: Callable[[float], tuple[float, float]], chance: float, start: float) -> float:
    """Return where a falling share, known with its slope, is the chance: Newton, kept bracketed."""
    low, high = -700.0, 700.0
    at = start
    for _ in range(_STEPS):
        share, slope = beyond(at)
        if share > chance:
            low = at
        else:
            high = at
        step = (share - chance) / slope if slope > _TINY else math.inf
        # From afar the logarithm of the tail is straighter than the tail.
        if share > _TINY and slope > _TINY and share < 0.5:
            step = share * math.log(share / chance) / slope
        if abs(step) < _NEAR:
            return at + step
        following = at + max(-1.0, min(step, 1.0))
        at = following if low < following < high else 0.5 * (low + high)
    return at


def _gamma_ratio(x: float, more: float) -> float:
    """Logarithm of gamma(x + more) over gamma(x), which large x would leave few digits of."""
    if x < _STIRLING_FROM:
        return math.lgamma(x + more) - math.lgamma(x)
    far = x + more
    rest = [(1.0 / 12.0 - (1.0 / 360.0 - 1.0 / (1260.0 * y * y)) / (y * y)) / y for y in (far, x)]
    return (x - 0.5) * math.log1p(more / x) + more * (math.log(far) - 1.0) + rest[0] - rest[1]


def _beta_fraction(a: float, b: float, x: float) -> float:
    """The continued fraction of the incomplete beta function, by Lentz."""
    c, d = 1.0, 1.0 / _off_zero(1.0 - (a + b) * x / (a + 1.0))
    fraction = d
    for m in range(1, _FOREVER):
        even = m * (b - m) * x / ((a + 2 * m - 1.0) * (a + 2 * m))
        odd = -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1.0))
        change = 1.0
        for term in (even, odd):
            d = 1.0 / _off_zero(1.0 + term * d)
            c = _off_zero(1.0 + term / c)
            change *= c * d
        fraction *= change
        if abs(change - 1.0) < _EXACT:
            break
    return fraction


def _gamma_beyond(a: float, x: float, power: float) -> float:
    """The share of the gamma function above x: a series below a + 1, else a fraction."""
    if x < a + 1.0:
        term = total = 1.0 / a
        for n in range(1, _FOREVER):
            term *= x / (a + n)
            total += term
            if term < _EXACT * total:
                break
        return 1.0 - power * total
    b = x + 1.0 - a
    c, d = 1.0 / _TINY, 1.0 / b
    fraction = d
    for n in range(1, _FOREVER):
        term, b = -n * (n - a), b + 2.0
        d = 1.0 / _off_zero(term * d + b)
        c = _off_zero(b + term / c)
        fraction *= c * d
        if abs(c * d - 1.0) < _EXACT:
            break
    return power * fraction


def _off_zero(value: float) -> float:
    return value if abs(value) > _TINY else _TINY
