r"""Standard errors and 95 % intervals of a campaign's parameters: one covariance of all of them.

Each setting's fit is made linear at its end by one more simulation with every sensitivity; of its
mean cycles alone, where it was fitted on them. In u (ln y; an offset in N), with the residual
r = f - f_hat in N and its Jacobian J = d f_hat/du, both behind the filter, and the weights w of the
segments (1 where their noise is alike)::

    information  H = J^T w^2 J    scores  g_t = w_t^2 J_t r_t

A fit of any subset of the parameters has, to first order, the error H_ff^-1 (sum g)_f. At its
minimum the whole problem is an arrow of blocks: each setting has its own free parameters f, all
have some unknowns theta in common. With g the summed scores of a setting and A = du/dtheta::

    D = H_ff^-1 on f, 0 elsewhere       B = (1 - D H) A
    du = D g + B dtheta                 dtheta = sum over settings of T g

so that the error of what is shared is inside the intervals of what is a setting's own. The rows T
follow how the shared parameters were found. Procedure `joint`: T = S^-1 B^T, S = sum of B^T H A,
each setting with the weight of its own residual. Procedure `paper`: f_f is the mean over settings
of fits with everything free; R_m3 comes from the lowest setting with that mean held.

The covariance is one sandwich, (D + B T) M (D + B T)^T of a setting's own scores and B T M T^T B^T
of every other one's, and M has four terms: noise (`Linearisation.scores`), lack of fit that repeats
(`misfit`), what was held at an unmeasured default (`supposed`), and flaws that explain
what repeats (`flawed`). The last two are one mistake, the same at every setting: their shifts are
summed over the settings before they are squared.

Noise differs from cycle to cycle; what repeats does so in every one, and no number of cycles makes
it less. Had the test been another (other speeds, another stroke), it would weigh otherwise. How
much otherwise is seen inside the cycle: its blocks of phase pull the parameters to and fro, and
their pulls, which cancel at the minimum, are taken for independent::

    M = B/(B - k) sum over blocks of s_b s_b'        s_b = sum over the block of w^2 J r_repeating

A law that is not the damper's misses every log alike. Their pulls in the same block of phase are
therefore summed, over the logs and over the settings, before they are squared, too; the larger of
the two errors of each value is given.

A rig is tared before each log. Where the search has found an offset of each log beside their mean
one, J is what is left of it beside these offsets: they are as uncertain as all else.

What follows an adjuster is an unknown for each of its clicks, and theta holds them all: A picks
those that a setting has. Where K_e follows from a gas content, theta holds V_r and K_B/C in its
place, and A carries their errors to K_e and to the setting's own. All is built on the scale of
ln y: no interval can be negative.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from damperfit.arrays import FloatArray
from damperfit.conditioning.filters import apply_filter, passed_at
from damperfit.damper.model import Model, Values
from damperfit.damper.mounting import other_turns, with_pressed_seal
from damperfit.errors import SimulationError, sparing
from damperfit.identification.fit_setting import Fit
from damperfit.identification.logs import (
    LogFit,
    SimulatedLog,
    compare,
    fast_length,
    weights,
)
from damperfit.identification.outcome import Status
from damperfit.identification.procedures import Campaign
from damperfit.identification.sharing import GAS_FOLLOWER, GAS_NAMES, Sharing
from damperfit.recording import FilterDesign, Segment, Trace
from damperfit.simulation import SolverOptions, simulate
from damperfit.statistics import NORMAL_95, independent_share, student_quantile
from damperfit.tested.setting import Setting

if TYPE_CHECKING:
    from damperfit.errors import OnError


# Of the largest eigenvalue, of matrices with a diagonal of ones: what is less is rounding.
_ROUNDED_OFF = 1e-14
# At this correlation knowing the one would shrink the error of the other to a third.
_CORRELATED = 0.95


@dataclass(frozen=True, slots=True)
class Interval:
    """Standard error and 95 % interval of one parameter, SI."""

    error: float  # of noise: y times that of ln y
    # y exp(-+1.96 se(ln y)); an offset, which may be negative, has y -+ 1.96 se. The errors of
    # noise and misfit together.
    low: float
    high: float
    # From the model's misfit: what repeats in the residual, what is held at an unmeasured
    # default, and flaws; 0 where there is none.
    misfit: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Uncertainty:
    """How far the parameters of one setting may be trusted."""

    setting: Setting
    intervals: Mapping[str, Interval]  # of what the logs gave, fitted or shared
    names: tuple[str, ...]  # of `covariance`: own, those of its clicks, those of all settings
    covariance: FloatArray  # of ln y (an offset: of itself, N) by noise, (k, k)
    shared: tuple[str, ...] = ()  # the last of `names`: one value for all settings
    # Openings that no log reaches, by name, and the pressure that each is above, Pa.
    unopened: Mapping[str, float] = field(default_factory=dict)
    misfit: FloatArray | None = None  # like `covariance`, by the model's misfit

    @property
    def correlation(self) -> FloatArray:
        """Correlation matrix, shape (k, k); NaN of what the logs leave without a variance."""
        scale = np.sqrt(np.abs(np.diag(self.covariance)))
        with np.errstate(invalid="ignore"):
            return np.asarray(self.covariance / np.outer(scale, scale))

    @property
    def ties(self) -> list[tuple[str, str, float]]:
        """Pairs of names that are strongly correlated."""
        matrix = self.correlation
        return [
            (self.names[i], self.names[j], float(matrix[i, j]))
            for i, j in zip(*np.nonzero(np.abs(np.triu(matrix, 1)) > _CORRELATED), strict=True)
        ]

    def error(self, name: str) -> float:
        """Return the standard error of noise of ln y, of an offset in its unit."""
        place = self.names.index(name)
        return math.sqrt(abs(float(self.covariance[place, place])))

    def whole_error(self, name: str) -> float:
        """Return the same with the share of the misfit."""
        interval, noise = self.intervals[name], self.error(name)
        share = interval.misfit / interval.error if interval.error > 0.0 else 0.0
        return noise * math.hypot(1.0, share)


def make_interval(
    value: float,
    error: float,
    *,
    is_logarithmic: bool = True,
    misfit: float = 0.0,
) -> Interval:
    """Return the 95 % interval of a value whose u has standard errors of noise and misfit."""
    reach = NORMAL_95 * math.hypot(error, misfit)
    if not is_logarithmic:
        return Interval(error, value - reach, value + reach, misfit)
    # e^700 is the largest factor that is a number; such an interval says "anything".
    factor = math.exp(min(reach, 700.0))
    return Interval(value * error, value / factor, value * factor, value * misfit)


def uncertainties(
    linearised: Sequence[Linearisation], sharing: Sharing, *, on_error: OnError | None = None
) -> tuple[Uncertainty, ...]:
    """Return errors and intervals by setting; errors are passed to `on_error`."""
    both = list(zip(_shared_rows(linearised, sharing), linearised, strict=True))
    nothing = np.zeros((len(sharing.unknowns),) * 2)
    noise = [row @ at.scores @ row.T for row, at in both]
    misfit = [nothing if at.misfit is None else row @ at.misfit @ row.T for row, at in both]
    supposed = sum(row @ at.supposed for row, at in both if at.supposed is not None)
    flawed: dict[str, FloatArray] = {}
    repeating = sum(row @ at.repeating.T for row, at in both if at.repeating is not None)
    pulls = np.asarray(repeating), np.asarray(supposed)
    for row, linear in both:
        for name, pull in linear.flawed.items():
            flawed[name] = flawed.get(name, 0.0) + row @ pull
    whole, errors = (sum(noise, nothing), sum(misfit, nothing)), []
    for (row, linear), *own in zip(both, noise, misfit, strict=True):
        others = (whole[0] - own[0], whole[1] - own[1])
        with sparing(linear.fit.setting, on_error):
            errors.append(_of_setting(linear, row, sharing, others, pulls, flawed))
    return tuple(errors)


def _of_setting(
    linear: Linearisation,
    rows: FloatArray,
    sharing: Sharing,
    others: tuple[FloatArray, FloatArray],
    pulls: tuple[FloatArray, FloatArray],
    flawed: Mapping[str, FloatArray],
) -> Uncertainty:
    """The sandwich of one setting.

    `others` are T M T^T summed over all but it, `pulls` T of what repeats in each block of phase
    and of defaults, `flawed` T of each flaw, summed over all.
    """
    fit, values = linear.fit, linear.fit.parameters
    own, shared = own_names(fit, sharing), sharing.estimated_at(fit.setting)
    common = tuple(name for name in shared if name in sharing.common)
    names = (*own, *(name for name in shared if name not in common), *common)
    places = linear.places(names)
    whole = np.zeros((len(linear.names),) * 2)
    whole[linear.places(own)] = solved(linear, own)
    slopes = _shared_slopes(fit, sharing)
    direct, by_shared = whole[places], (slopes - whole @ linear.information @ slopes)[places]
    of_own = direct + by_shared @ rows
    noise = of_own @ linear.scores @ of_own.T + by_shared @ others[0] @ by_shared.T
    misfit = by_shared @ others[1] @ by_shared.T
    if linear.misfit is not None:
        misfit = misfit + of_own @ linear.misfit @ of_own.T

    def shifts(of_all: FloatArray, mine: FloatArray | None) -> FloatArray:
        return by_shared @ of_all if mine is None else by_shared @ of_all + direct @ mine

    repeating, supposed = pulls
    if repeating.ndim:  # the same law misses every setting alike
        alike = shifts(repeating, None if linear.repeating is None else linear.repeating.T)
        squares, own_squares = np.sum(alike**2, axis=1), misfit.diagonal()
        # Nothing but rounding is not made wider: it may be of either sign.
        is_any = own_squares > 0.0
        ratios = np.divide(squares, own_squares, out=np.ones_like(squares), where=is_any)
        wider = np.sqrt(np.maximum(ratios, 1.0))
        misfit = misfit * np.outer(wider, wider)
    if linear.supposed is not None:
        defaults = shifts(supposed, linear.supposed)
        misfit = misfit + defaults @ defaults.T
    for name, of_all in flawed.items():
        shift = shifts(of_all, linear.flawed.get(name))
        misfit = misfit + np.outer(shift, shift)
    # What no log determines has a variance of rounding alone: huge, and of either sign.
    errors = np.sqrt(np.abs(noise.diagonal())).tolist()
    bends = np.sqrt(np.maximum(misfit.diagonal(), 0.0)).tolist()
    intervals = {
        name: make_interval(
            float(getattr(values, name)),
            error,
            is_logarithmic=values.quantity(name).is_logarithmic,
            misfit=bend,
        )
        for name, error, bend in zip(names, errors, bends, strict=True)
    }
    return Uncertainty(fit.setting, intervals, names, noise, common, misfit=misfit)


def own_names(fit: Fit, sharing: Sharing) -> tuple[str, ...]:
    """Return what a setting's own fit found or sought, but at a bound; none beside a minimum."""
    if not fit.outcome.is_minimum:
        return ()
    shared = sharing.estimated_at(fit.setting)
    return tuple(
        name
        for name in fit.parameters.names
        if fit.status[name] in {Status.FITTED, Status.NOT_IDENTIFIABLE} and name not in shared
    )


def _shared_slopes(fit: Fit, sharing: Sharing) -> FloatArray:
    """A = du/dtheta of a setting, shape (n, k): what its u move with the shared variables."""
    names = fit.parameters.names
    slopes = np.zeros((len(names), len(sharing.unknowns)))
    for k, unknown in enumerate(sharing.unknowns):
        if unknown.name in names and unknown.holds_at(fit.setting):
            slopes[names.index(unknown.name), k] = 1.0
    if sharing.gas is not None and fit.setting in sharing.gas.pressures:
        share = sharing.gas.share(fit.setting)
        slopes[names.index(GAS_FOLLOWER), -len(GAS_NAMES) :] = (-share, 1.0 - share)
    return slopes


def solved(linearised: Linearisation, names: Sequence[str]) -> FloatArray:
    """Return H_ff^-1 E_f of some parameters f, shape (k, n); by a pseudo-inverse."""
    places = linearised.places(names)
    # The diagonal of H is brought to ones first.
    rows = np.zeros((len(places), len(linearised.names)))
    rows[:, places] = _inverse(linearised.information[np.ix_(places, places)])
    return rows


def _inverse(matrix: FloatArray) -> FloatArray:
    scale = 1.0 / np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    unit = np.outer(scale, scale)
    return np.asarray(np.linalg.pinv(matrix * unit, rcond=_ROUNDED_OFF, hermitian=True) * unit)


def _shared_rows(linearised: Sequence[Linearisation], sharing: Sharing) -> list[FloatArray]:
    """T for every setting, shape (number shared, number of quantities)."""
    if sharing.jointly:
        inverse, rows = _joint_rows(linearised, sharing)
        return [np.asarray(inverse @ row) for row in rows]
    by_setting = {linear.fit.setting: linear for linear in linearised}
    tables: dict[str, dict[Setting, FloatArray]] = {}

    def row_of(linear: Linearisation, free: tuple[str, ...], name: str) -> FloatArray:
        return np.asarray(solved(linear, free)[free.index(name)])

    for name, settings in sharing.means.items():
        used = [by_setting[setting] for setting in settings if setting in by_setting]
        tables[name] = {
            linear.fit.setting: row_of(linear, sharing.free, name) / len(used) for linear in used
        }
    for name, setting in sharing.taken.items():
        tables[name] = {}
        if (source := by_setting.get(setting)) is None:
            continue
        # What one setting gave has its own row, and the means that were held there move it.
        row = row_of(source, tuple(name for name in sharing.free if name not in sharing.held), name)
        moved = {setting: row}
        for held in sharing.held:
            carried = -float(row @ source.information[:, source.names.index(held)])
            for other, mean in tables.get(held, {}).items():
                moved[other] = moved.get(other, np.zeros(len(row))) + carried * mean
        tables[name] = moved
    nothing = [np.zeros(len(linear.names)) for linear in linearised]
    return [
        np.array(
            [tables[name].get(linear.fit.setting, none) for name in sharing.estimated]
        ).reshape(-1, len(none))
        for linear, none in zip(linearised, nothing, strict=True)
    ]


def _joint_rows(
    linearised: Sequence[Linearisation], sharing: Sharing
) -> tuple[FloatArray, list[FloatArray]]:
    """S^-1 of a joint fit and S T, in which each setting has the weight of its own residual."""
    rows, complement = [], np.zeros((len(sharing.unknowns),) * 2)
    for linear in linearised:
        own, slopes = own_names(linear.fit, sharing), _shared_slopes(linear.fit, sharing)
        carried = linear.information[:, linear.places(own)] @ solved(linear, own)
        weight = linear.precision if linear.fit.setting in sharing.settings else 0.0
        rows.append(weight * slopes.T @ (np.eye(len(linear.names)) - carried))
        complement += rows[-1] @ linear.information @ slopes
    return _inverse(0.5 * (complement + complement.T)), rows


def shared_covariance(linearised: Sequence[Linearisation], sharing: Sharing) -> FloatArray:
    """Return the covariance of the logarithms of ``sharing.unknowns`` by noise, shape (k, k)."""
    covariance = np.zeros((len(sharing.unknowns),) * 2)
    for row, linear in zip(_shared_rows(linearised, sharing), linearised, strict=True):
        covariance += row @ linear.scores @ row.T
    return covariance


def shared_curvature(linearised: Sequence[Linearisation], sharing: Sharing) -> FloatArray:
    """Return the variances of a joint fit's variables, (k,), by white noise: those of S^-1."""
    return np.asarray(np.diag(_joint_rows(linearised, sharing)[0]))


@dataclass(frozen=True, slots=True)
class GasContent:
    """Trapped gas and stiffness of the oil that K_e of a joint fit follows from, eq. (28)."""

    volume_ratio: float  # V_r, trapped gas over oil at the working pressure, dimensionless
    stiffness: float  # K_B/C, bulk modulus of oil and tube without gas, Pa
    volume_ratio_interval: Interval
    stiffness_interval: Interval
    correlation: float  # of their logarithms
    pressures: Mapping[Setting, float]  # mean working pressure by setting, absolute, Pa
    # Misfit above that with a K_e of each setting's own, in units of the noise: 1 on average where
    # the law holds.
    rises: Mapping[Setting, float]

    @property
    def sentence(self) -> str:
        """For people."""
        gas, oil = self.volume_ratio_interval, self.stiffness_interval
        return (
            f"gas content: V_r = {100.0 * self.volume_ratio:.3g} % of the oil's volume (95 % from "
            f"{100.0 * gas.low:.3g} to {100.0 * gas.high:.3g} %) at the working pressure, K_B/C = "
            f"{self.stiffness / 1e6:.4g} MPa ({oil.low / 1e6:.4g} to {oil.high / 1e6:.4g} MPa)"
        )


def gas_content(linearised: Sequence[Linearisation], sharing: Sharing) -> GasContent | None:
    """Return the gas content of a campaign; None where K_e was not to follow from one."""
    law = sharing.gas
    if law is None:
        return None
    covariance = shared_covariance(linearised, sharing)[-len(GAS_NAMES) :, -len(GAS_NAMES) :]
    errors = np.sqrt(np.diag(covariance))
    return GasContent(
        volume_ratio=law.volume_ratio,
        stiffness=law.stiffness,
        volume_ratio_interval=make_interval(law.volume_ratio, float(errors[0])),
        stiffness_interval=make_interval(law.stiffness, float(errors[1])),
        correlation=float(covariance[0, 1] / np.prod(errors)),
        pressures=dict(law.pressures),
        rises=dict(sharing.gas_rises),
    )


# How residuals are correlated, and the variance of sums of correlated numbers.
#
# The error of a fit is linear in its scores g_t = J_t r_t (one row of the Jacobian times its
# residual), so that its covariance needs the variance of their sum::
#
#     M = sum over lags l of  w(l) sum_t g_t g_{t+l}^T,     w(l) = 1 up to m, falling to 0 at 2 m
#
# The flat-topped window w leaves no bias where correlation ends before lag m; m is read from the
# residual's own autocorrelation (Politis, "Adaptive bandwidth choice", J. Nonparametric
# Statistics, 2003, with Bartlett's variance of a sample autocorrelation in place of that of white
# noise, because a filtered residual is far from white). No form of the correlation is assumed,
# and residuals that are larger in part of the cycle than elsewhere are allowed for.
#
# Where few samples hold most of what the log says of a parameter (a chamber that empties and
# fills again), M rests on the few residuals there, which the fit has made small besides. The
# residuals' autocovariance c over the whole segment knows better how strong the noise is::
#
#     M' = sum over lags l of  w(l) c(l) sum_t J_t J_{t+l}^T
#
# It takes the noise to be alike everywhere; `larger` of both, direction by direction, errs least.
#
# Lags and lengths are in samples, matrices (k, k) and positive semi-definite.

# A sample autocorrelation within this many of its standard errors counts as none.
_NO_CORRELATION = 2.5
# Directions of less variance than this share of the largest are nothing but rounding.
_NOTHING = 1e-14
# Independent samples a parameter; with more, errors are hardly short.
_ENOUGH = 50.0


def autocorrelation(residuals: FloatArray, n_lags: int) -> FloatArray:
    """Return the sample autocorrelation at lags 0 to ``n_lags``; 1, 0, 0, ... for zeros."""
    length = fast_length(len(residuals) + n_lags + 1)
    spectrum = np.fft.rfft(residuals, length)
    sums = np.fft.irfft(spectrum.real**2 + spectrum.imag**2, length)[: n_lags + 1]
    if not sums[0] > 0.0:
        return np.asarray(np.eye(1, n_lags + 1)[0])
    return np.asarray(sums / sums[0])


def independent_samples(design: FilterDesign, n: int) -> float:
    """Return how many independent samples n of white noise behind a filter are worth."""
    turns = np.linspace(0.0, 0.5, n // 2 + 1)
    return n * independent_share(np.abs(passed_at(design, turns)) ** 2)


def correlation_length(residuals: FloatArray, *, longest: int) -> int:
    """Return the lag beyond which residuals are not correlated, at most the longest."""
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
    """Return M of the scores of one segment, (n, k), that are correlated up to a lag."""
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
    scale = np.sqrt(np.maximum(total.diagonal(), 0.0))
    is_positive = bool(np.all(scale > 0.0))  # NaN is not
    if lag and not (is_positive and np.linalg.eigvalsh(total / np.outer(scale, scale))[0] > 0.0):
        # A misfit that repeats with the cycle can do that; a triangle never gives a negative sum.
        total = windowed(1.0 - np.arange(len(window)) / (2.0 * lag + 1.0))
    return total


def stationary_covariance(jacobian: FloatArray, residuals: FloatArray, lag: int) -> FloatArray:
    """Return M' of one segment: slopes (n, k) and residuals (n,) that are alike everywhere."""
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
    """Gain of a symmetric kernel, given from lag 0, at each frequency."""
    reach = len(kernel)
    whole = np.zeros(length)
    whole[:reach] = kernel
    whole[length - reach + 1 :] = kernel[:0:-1]
    return np.asarray(np.fft.rfft(whole).real)


@lru_cache(maxsize=16)  # logs alike have a few lengths of correlation
def _frequency_weights(taps: bytes, length: int) -> FloatArray:
    """Weights of real and imaginary parts in sums over frequencies."""
    weight = 2.0 * _gain(np.frombuffer(taps), length)
    weight[0] *= 0.5
    if length % 2 == 0:
        weight[-1] *= 0.5
    return np.repeat(weight, 2)


def larger(own: FloatArray, other: FloatArray) -> FloatArray:
    """Return the larger of two covariances in each direction in which both are independent."""
    scale = np.sqrt(np.maximum(np.diag(own), np.diag(other)))
    scale = np.where(scale > 0.0, scale, 1.0)
    unit = np.outer(scale, scale)
    values, vectors = np.linalg.eigh(other / unit)
    is_known = values > _NOTHING * max(float(values[-1]), 1e-300)
    if not is_known.any():
        return own
    root = vectors[:, is_known] * np.sqrt(values[is_known])
    inverse = vectors[:, is_known] / np.sqrt(values[is_known])
    ratios, turned = np.linalg.eigh(inverse.T @ (own / unit) @ inverse)
    axes = root @ turned
    # What `own` has beyond the other is added to it, so that nothing of it is lost.
    more = (axes * np.maximum(1.0 - ratios, 0.0)) @ axes.T
    return np.asarray(own + unit * more)


def widening(segments: Sequence[tuple[int, float, int]], n_fitted: int) -> float:
    """Return the factor, 1 or more, on the covariance of the scores of a short log.

    Of each segment samples, independent ones among them and correlation length.
    """
    n_independent = sum(worth for _, worth, _ in segments)
    if not n_fitted or n_independent > _ENOUGH * n_fitted:
        return 1.0
    # A variance that a window w sums over n samples has only n / sum w^2 degrees of freedom: the
    # factor makes 1.96 errors hold 95 % of Student's t.
    sizes, spread = 0, 0.0
    for n, _, lag in segments:
        window = _flat_topped(lag, n)
        sizes += n
        spread += n * (2.0 * float(window @ window) - 1.0)
    student = student_quantile(max(sizes * sizes / spread, 1.0), 0.975) / NORMAL_95
    # A fit takes out of the residuals what its parameters follow: k/N of N independent samples.
    return student**2 * n_independent / max(n_independent - n_fitted, 0.5 * n_independent)


# Blocks of a cycle whose pulls are taken for independent. Misfits behind a 30 Hz filter at 1.5 Hz
# have some 20 independent values.
_BLOCKS = 16
# Residuals still correlated after this share of a cycle repeat with the cycle: a misfit, no noise.
_LONGEST_CORRELATION = 0.25
# s; where nothing repeats, a chamber that cavitates remembers noise for as long as it is empty.
_LONGEST_MOVING = 1.0
# Samples in which a chamber that was empty is full again.
_REFILLING = 2
# Of that, the share of the information that counts: with all or half of it too few intervals of
# R_m3 hold on a road that cavitates, with none too many
# (`python -m tests.uncertainty.motion_coverage --motions "rough road"`).
_SEEN = 0.25
# Cycles, to separate a drift from scatter.
_SEEN_TO_DRIFT = 4
_SURE = 4.0  # standard errors
_FOUND = frozenset({Status.FITTED, Status.NOT_IDENTIFIABLE})


class LogLinearisation(NamedTuple):
    """One log at the fitted point, over its compared samples, n of them; SI."""

    residuals: FloatArray  # (n,), measured minus modelled force
    weights: FloatArray  # (n,), what the fit multiplied them by
    jacobian: FloatArray  # (n, k), of the modelled force by u, in the order of the model
    gas: FloatArray  # (n, c), by the logarithms of the model's conditions, such as gas pressure
    force: FloatArray  # (n,), modelled, behind the filter
    # Of each segment velocity, and what the filter takes off the model's force there; of what
    # repeats in one cycle.
    rounding: tuple[tuple[FloatArray, ...], ...] = ()
    # Of the chambers, (3, samples of the trace), Pa; None where the model has none.
    pressures: NDArray[np.floating[Any]] | None = None


@dataclass(frozen=True, eq=False)  # no slots: what is asked for again is kept
class Linearisation:
    """The fit of one setting, made linear at its end; matrices are (k, k) in the model's order."""

    fit: Fit
    information: FloatArray  # H, N^2
    scores: FloatArray  # covariance of the summed scores, correlation allowed for, N^4
    gradient: FloatArray  # (k,), sum of the scores
    logs: tuple[LogLinearisation, ...]
    conditions: tuple[str, ...] = ()  # of the columns of each log's `gas`
    # In place of `scores` what a misfit that repeats does; None where nothing repeats.
    misfit: FloatArray | None = None
    # What pulls in each block of phase, (B, k), all segments summed; None likewise.
    repeating: FloatArray | None = None
    # Summed scores by what is held at an unmeasured default, each column for one
    # standard error of that, and by other forms of the friction; None where there is none.
    supposed: FloatArray | None = None
    flaws: tuple[str, ...] = ()  # which its residuals may be said to show
    precision: float = math.nan  # one over the mean square of the weighed residuals, 1/N^2
    # Highest pressure across each blow-off in the compared samples, Pa, by its opening's name.
    pressed: Mapping[str, float] = field(default_factory=dict)
    # Summed scores, (k,), by the flaws that its residuals do show, by name; of several that cannot
    # be separated each by the root of its share in the doubt.
    flawed: Mapping[str, FloatArray] = field(default_factory=dict)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the rows and columns: the model's quantities, in its order."""
        return self.fit.parameters.names

    @cached_property
    def counts(self) -> FloatArray:
        """Of the samples of all logs, (n,): 1, or 0 beside a jump of the speed."""
        return np.concatenate([(seen.weights > 0.0).astype(np.float64) for seen in self.logs])

    @cached_property
    def residuals(self) -> FloatArray:
        """Of all logs, (n,), 0 where none counts."""
        return np.asarray(self.counts * np.concatenate([seen.residuals for seen in self.logs]))

    @cached_property
    def force(self) -> FloatArray:
        """Modelled, of all logs, (n,)."""
        return np.concatenate([seen.force for seen in self.logs])

    @cached_property
    def jacobian(self) -> FloatArray:
        """Of all logs, (n, k)."""
        return np.vstack([seen.jacobian for seen in self.logs])

    def pull(self, column: FloatArray) -> FloatArray:
        """What a force over all logs, (n,) or (n, m), adds to the summed scores: (k,) or (k, m)."""
        squares = np.concatenate([seen.weights for seen in self.logs]) ** 2
        return np.asarray((self.jacobian * squares[:, None]).T @ column)

    def places(self, names: Sequence[str]) -> NDArray[np.intp]:
        """Return the rows of some quantities."""
        return np.array([self.names.index(name) for name in names], dtype=np.intp)

    def segments(self) -> Iterator[tuple[Segment, FloatArray, FloatArray, FloatArray]]:
        """Yield each segment with its residuals, squared weights and Jacobian."""
        for log, seen in zip(self.fit.logs, self.logs, strict=True):
            for segment, place in zip(log.trace.segments, log.trace.places, strict=True):
                squares = seen.weights[place] ** 2
                yield segment, seen.residuals[place], squares, seen.jacobian[place]

    def summed(
        self, *, is_structured: bool, pulls: Mapping[str, FloatArray] = MappingProxyType({})
    ) -> Linearisation:
        """Return the same with what its misfit does, without curves, which fill the memory.

        `pulls`, (k,) each, are those of the flaws that explain it.
        """
        misfit, repeating = _misfit_scores(self) if is_structured else (None, None)
        flawed = {name: np.asarray(pull / math.sqrt(len(pulls))) for name, pull in pulls.items()}
        flawed["drift"] = _drift_pull(self)
        return replace(self, logs=(), misfit=misfit, repeating=repeating, flawed=flawed)


def linearise_settings(
    campaign: Campaign,
    damper: Model,
    *,
    solver: SolverOptions = SolverOptions(tolerance=1e-2),
    on_error: OnError | None = None,
) -> tuple[Linearisation, ...]:
    """Return the linearised fits, by rising setting; one simulation for each log.

    One that cannot be simulated is left out, another error is passed to `on_error`, or raised.
    """
    linearised = []
    for fit in campaign.fits:
        with sparing(fit.setting, on_error), suppress(SimulationError):
            linearised.append(linearise_at_fit(fit, damper, solver=solver))
    return tuple(linearised)


def linearise_at_fit(  # noqa: PLR0915 - log by log and segment by segment, best read whole
    fit: Fit, damper: Model, *, solver: SolverOptions = SolverOptions()
) -> Linearisation:
    """Take the derivative of a fit's logs by every parameter, on mean cycles where they repeat."""
    values = fit.parameters
    own = [getattr(values, q.name) if q.is_logarithmic else 1.0 for q in values.quantities]
    scales = np.array([*own, *(getattr(damper, name) for name in damper.conditions)])
    n, errors = len(own), np.zeros(len(own))
    # One standard error of what stands at an unmeasured default.
    for row, quantity in enumerate(values.quantities):
        value = getattr(values, quantity.name)
        if fit.status[quantity.name] is Status.FIXED and value == quantity.default:
            errors[row] = quantity.ignorance * (1.0 if quantity.may_vanish else value)
    seen_logs: list[LogLinearisation] = []
    unknowns: list[list[FloatArray]] = []  # of each log and segment, what was not measured
    network = getattr(damper.plain, "network", None)
    passages = () if network is None else network.passages
    # One that lifts gradually lets oil through below its opening.
    pressed = {p.opening: 0.0 for p in passages if p.opening and not p.width}
    for log, weight in zip(fit.logs, weights([log.trace for log in fit.logs]), strict=True):
        trace, part = log.trace, log.trace.compared
        names = (*damper.names, *damper.conditions)
        force, pressures, rows, rounding = _responses(log, values, damper, solver, names)
        others = _other_frictions(log, values, damper, solver, rows)
        for passage in (passage for passage in passages if passage.opening in pressed):
            here = pressures[passage.start - 1, part] - pressures[passage.end - 1, part]
            pressed[passage.opening] = max(float(here.max()), pressed[passage.opening])
        is_known = others is None and not errors.any()
        unknown = [] if is_known else [errors[:, None] * slopes[1 : n + 1] for slopes in rows]
        if others is not None:
            unknown = [np.vstack(pair) for pair in zip(unknown, others, strict=True)]
        unknowns.append(unknown)
        slopes, gas = np.split(
            np.vstack([(slopes[1:] * scales[:, None]).T for slopes in rows]), [n], axis=1
        )
        own_weights = np.ones(trace.n_samples) if weight is None else weight
        signals = trace.force[part] - force[part], own_weights, slopes, gas, force[part]
        inside = pressures if pressures.size else None
        seen_logs.append(LogLinearisation(*signals, tuple(rounding), inside))
    if any(log.trace.tare for log in fit.logs):
        seen_logs = _beside_own_offsets(seen_logs)
    information, covariance, gradient = np.zeros((n, n)), np.zeros((n, n)), np.zeros(n)
    supposed: FloatArray | None = None
    counted: list[tuple[int, float, int]] = []
    squares = 0.0
    for log, seen_log, unknown in zip(fit.logs, seen_logs, unknowns, strict=True):
        trace = log.trace
        for k, (segment, place) in enumerate(zip(trace.segments, trace.places, strict=True)):
            own_weights = seen_log.weights[place]
            jacobian = seen_log.jacobian[place] * own_weights[:, None]
            rest = seen_log.residuals[place] * own_weights
            squares += float(rest @ rest)
            if unknown:
                pull = jacobian.T @ (unknown[k] * own_weights).T
                supposed = pull if supposed is None else supposed + pull
            is_cyclic = bool(segment.n_cycles)
            longest = _LONGEST_CORRELATION / segment.frequency if is_cyclic else _LONGEST_MOVING
            lag = correlation_length(rest, longest=round(longest / trace.interval))
            scores = jacobian * rest[:, None]
            noise = score_covariance(scores, lag)
            if not is_cyclic:
                # Cycles repeat what a few samples show; elsewhere those few may be all there is.
                noise = larger(noise, stationary_covariance(jacobian, rest, lag))
            information += jacobian.T @ jacobian
            covariance += noise
            gradient += scores.sum(axis=0)
            counted.append((len(rest), independent_samples(trace.model_filter, len(rest)), lag))
    wider = widening(counted, sum(status in _FOUND for status in fit.status.values()))
    return Linearisation(
        fit=fit,
        information=information,
        scores=wider * covariance,
        gradient=gradient,
        logs=tuple(seen_logs),
        conditions=damper.conditions,
        supposed=supposed,
        flaws=damper.flaws,
        precision=sum(size for size, *_ in counted) / max(squares, 1e-300),
        pressed=pressed,
    )


def _beside_own_offsets(logs: Sequence[LogLinearisation]) -> list[LogLinearisation]:
    """The logs of a setting without what an offset of each beside their mean one takes up."""
    linearised = []
    counts = [float(seen.weights @ seen.weights) for seen in logs]
    means = [seen.weights**2 @ seen.jacobian / n for seen, n in zip(logs, counts, strict=True)]
    common = sum(means) / sum(1.0 / n for n in counts)
    for seen, n, mean in zip(logs, counts, means, strict=True):
        linearised.append(seen._replace(jacobian=seen.jacobian - (mean - common / n)))
    return linearised


def _responses(
    log: LogFit,
    values: Values,
    damper: Model,
    solver: SolverOptions,
    names: Sequence[str] = (),
) -> tuple[FloatArray, FloatArray, list[FloatArray], list[tuple[FloatArray, ...]]]:
    """Force and pressures of a log, of each segment force and sensitivities, and the `rounding`.

    Of the mean cycles that the fit went down on, where it did: their sensitivities, (k, n), differ
    from those of the log by what noise of the displacement does, and cost far less.
    """
    trace = log.trace
    rows: list[FloatArray] = []
    rounding: list[tuple[FloatArray, ...]] = []
    if log.cycles:
        seen = compare(values, trace, damper, solver=solver)
        for cycle, segment in zip(log.cycles, trace.segments, strict=True):
            options = cycle.solver(solver)
            response = simulate(values, damper, cycle.motion, sensitivities=names, options=options)
            signals = [response.force, *response.sensitivities.values()]
            rows.append(cycle.over(segment, signals))
            taken = cycle.taken_by_filter(response.force)
            rounding.append((cycle.motion.velocity[-len(taken) :], taken))
        return seen.force, seen.response.pressures, rows, rounding
    seen = compare(values, trace, damper, sensitivities=names, solver=solver)
    whole, taken = np.vstack([seen.force, _slopes(trace, seen)]), seen.response.force - seen.force
    for segment in trace.segments:
        rows.append(whole[:, segment.window])
        rounding.append((trace.velocity[segment.window], taken[segment.window]))
    return seen.force, seen.response.pressures, rows, rounding


def _slopes(trace: Trace, seen: SimulatedLog) -> FloatArray:
    """The sensitivities behind the filter, with part of what a sample sees of a refilling.

    A chamber that has been empty fills within a millisecond. Whether a sample falls into that, and
    then shows the moment to some microseconds, changes with the parameters by less than their
    errors: the slope of that one point promises too much, and without it too little is promised.
    """
    empty = seen.response.pressures[:2] <= 0.0
    filled = np.flatnonzero((empty[:, :-1] & ~empty[:, 1:]).any(axis=0)) + 1
    slopes = seen.response.sensitivities
    if not (slopes and len(filled)) or all(segment.n_cycles for segment in trace.segments):
        return seen.sensitivities  # cycles meet a refilling at other moments of it
    rows = np.stack(list(slopes.values()))
    luck = np.unique(np.add.outer(filled, np.arange(_REFILLING)))
    luck = luck[luck < rows.shape[1] - 1]
    known = np.setdiff1d(np.arange(rows.shape[1]), luck)
    for row in rows:
        beside = np.interp(luck, known, row[known])
        row[luck] = beside + math.sqrt(_SEEN) * (row[luck] - beside)
    return apply_filter(trace.model_filter, rows)


def _other_frictions(
    log: LogFit,
    values: Values,
    damper: Model,
    solver: SolverOptions,
    here: Sequence[FloatArray],
) -> list[FloatArray] | None:
    """What the force would be more than `here` with a friction of another form, (2, n) a segment.

    One that turns otherwise; one that the pressure on the seal adds to, as large as the fitted one
    at the pressure of the gas at rest. None for a damper of which no other form is doubted.
    """
    turns, pressed = other_turns(damper, values), with_pressed_seal(damper, values)
    if not turns and pressed is None:
        return None
    more = [np.zeros((2, rows.shape[1])) for rows in here]
    for share, law, at in turns:
        for into, there in zip(more, _responses(log, at, law, solver)[2], strict=True):
            into[0] += share * there[0]
    for into, now in zip(more, here, strict=True):
        into[0] -= now[0] if turns else 0.0
    if pressed is not None:
        own = next(place for place, q in enumerate(values.quantities) if q.is_friction)
        at_rest = pressed[1].seal_area * values.gas_pressure
        seen = _responses(log, pressed[1], pressed[0], solver)[2]
        for into, there, now in zip(more, seen, here, strict=True):
            into[1] = there[0] - now[0] - at_rest * now[1 + own]
    return more


def _misfit_scores(linearised: Linearisation) -> tuple[FloatArray, FloatArray]:
    """The matrix M of a setting's repeating misfit, and its pulls; see the module's docstring."""
    pulls: list[FloatArray] = []
    for segment, residuals, squares, jacobian in linearised.segments():
        n = len(residuals)
        block, repeating = np.arange(n) * _BLOCKS // n, residuals
        if segment.n_cycles > 1:  # without what differs between cycles
            starts = segment.cycle_starts - segment.first
            phase = np.interp(np.arange(n), starts, np.arange(len(starts))) % 1.0
            n_bins = max(_BLOCKS, round(float(np.mean(np.diff(starts)))))
            bins = np.minimum((phase * n_bins).astype(np.int64), n_bins - 1)
            counts = np.maximum(np.bincount(bins, minlength=n_bins), 1)
            mean = np.bincount(bins, weights=residuals, minlength=n_bins) / counts
            block, repeating = bins * _BLOCKS // n_bins, mean[bins]
        scores = jacobian * (squares * repeating)[:, None]
        pulls.extend(scores[block == k].sum(axis=0) for k in range(_BLOCKS))
    table = np.array(pulls)
    few = len(table) / max(len(table) - len(linearised.names), 1)
    by_phase = table.reshape(-1, _BLOCKS, table.shape[1]).sum(axis=0)
    return np.asarray(few * table.T @ table), np.asarray(math.sqrt(few) * by_phase)


def _drift_pull(linearised: Linearisation) -> FloatArray:
    """Summed scores by a zero that moves: as much as a log drifts by may be in its mean force."""
    pull = np.zeros(len(linearised.names))
    for segment, residuals, squares, jacobian in linearised.segments():
        if segment.n_cycles < _SEEN_TO_DRIFT:
            continue
        starts = np.rint(segment.cycle_starts - segment.first).astype(np.intp)
        starts = np.clip(starts, 0, len(residuals))
        means = np.add.reduceat(residuals[: starts[-1]], starts[:-1]) / np.diff(starts)
        phase = np.linspace(-0.5, 0.5, len(means))
        power = phase @ phase
        drift = float(phase @ means / power)
        rest = means - means.mean() - drift * phase
        if abs(drift) > _SURE * math.sqrt(float(rest @ rest / power) / (len(means) - 2)):
            pull += drift * (jacobian.T @ squares)
    return pull
