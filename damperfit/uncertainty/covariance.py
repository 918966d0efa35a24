r"""Standard errors and 95 % intervals of a campaign's parameters: one covariance of all of them.

At its minimum the whole problem is an arrow of blocks: each setting has its own free parameters f,
all have some unknowns theta in common. With g the summed scores of a setting and A = du/dtheta, its
errors are linear::

    D = H_ff^-1 on f, 0 elsewhere       B = (1 - D H) A
    du = D g + B dtheta                 dtheta = sum over settings of T g

so that the error of what is shared is inside the intervals of what is a setting's own. The rows T
follow how the shared parameters were found. Procedure `joint`: T = S^-1 B^T, S = sum of B^T H A,
each setting with the weight of its own residual. Procedure `paper`: f_f is the mean over settings
of fits with everything free; R_m3 comes from the lowest setting with that mean held.

The covariance is one sandwich, (D + B T) M (D + B T)^T of a setting's own scores and B T M T^T B^T
of every other one's, and M has four terms (`linearisation`): noise, lack of fit that repeats, what
was held at a default that nobody has measured, and a flaw that explains what repeats (`flaws`).
The last two are one mistake, the same at every setting: their shifts are summed over the settings
before they are squared.

What follows an adjuster is an unknown for each of its clicks, and theta holds them all: A picks
those that a setting has. Where K_e follows from a gas content, theta holds V_r and K_B/C in its
place, and A carries their errors to K_e and to the setting's own. All is built on the scale of
ln y: no interval can be negative.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from damperfit.errors import sparing
from damperfit.identification.outcome import Status
from damperfit.identification.sharing import GAS_FOLLOWER, GAS_NAMES
from damperfit.statistics import NORMAL_95

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from damperfit.errors import OnError
    from damperfit.identification import Fit, Sharing
    from damperfit.tested.setting import Setting
    from damperfit.uncertainty.linearisation import Linearisation

    FloatArray = NDArray[np.float64]

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
    # The error from the scatter between whole cycles (linearised jackknife, the setting's own logs
    # only) over the same from the residuals' autocorrelation. 1 within about
    # 1/sqrt(2 (cycles - 1)) when both are right; far below 1 where the residuals repeat with the
    # cycle; now and then far above 1 where noise of the displacement, which enters as its
    # derivative, leaves hardly more than their ends in the cycles' sums (Monte Carlo: the errors
    # given are right there). NaN for a shared parameter and for a single cycle.
    cycle_ratio: float
    # From the model's misfit: what repeats in the residual, what is held at a default that nobody
    # has measured, and flaws; 0 where there is none.
    misfit: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Uncertainty:
    """How far the parameters of one setting may be trusted."""

    setting: Setting
    intervals: Mapping[str, Interval]  # of what the logs gave, fitted or shared
    names: tuple[str, ...]  # of `covariance`: own, those of its clicks, those of all settings
    covariance: FloatArray  # of ln y (an offset: of itself, N) by noise, (k, k)
    shared: tuple[str, ...] = ()  # the last of `names`: one value for all settings, told or not
    # Openings that no log reaches, by name, and the pressure that each is above, Pa.
    unopened: Mapping[str, float] = field(default_factory=dict)

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
        one, noise = self.intervals[name], self.error(name)
        return noise * math.hypot(1.0, one.misfit / one.error) if one.error > 0.0 else noise


def make_interval(
    value: float,
    error: float,
    ratio: float = math.nan,
    *,
    is_logarithmic: bool = True,
    misfit: float = 0.0,
) -> Interval:
    """Return the 95 % interval of a value whose u has standard errors of noise and misfit."""
    reach = NORMAL_95 * math.hypot(error, misfit)
    if not is_logarithmic:
        return Interval(error, value - reach, value + reach, ratio, misfit)
    # e^700 is the largest factor that is a number; such an interval says "anything".
    factor = math.exp(min(reach, 700.0))
    return Interval(value * error, value / factor, value * factor, ratio, value * misfit)


def uncertainties(
    linearised: Sequence[Linearisation], sharing: Sharing, *, on_error: OnError | None = None
) -> tuple[Uncertainty, ...]:
    """Return errors and intervals by setting; one that meets an error is told to `on_error`."""
    both = list(zip(_shared_rows(linearised, sharing), linearised, strict=True))
    nothing = np.zeros((len(sharing.variables),) * 2)
    noise = [row @ one.scores @ row.T for row, one in both]
    misfit = [nothing if one.misfit is None else row @ one.misfit @ row.T for row, one in both]
    supposed = sum(row @ one.supposed for row, one in both if one.supposed is not None)
    flawed: dict[str, FloatArray] = {}
    repeating = sum(row @ one.repeating.T for row, one in both if one.repeating is not None)
    pulls = np.asarray(repeating), np.asarray(supposed)
    for row, one in both:
        for name, pull in one.flawed.items():
            flawed[name] = flawed.get(name, 0.0) + row @ pull
    others = zip(_sums_of_others(noise, nothing), _sums_of_others(misfit, nothing), strict=True)
    found = []
    for (row, one), of_others in zip(both, others, strict=True):
        with sparing(one.fit.setting, on_error):
            found.append(_of_setting(one, row, sharing, of_others, pulls, flawed))
    return tuple(found)


def _of_setting(
    one: Linearisation,
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
    fit, values = one.fit, one.fit.parameters
    own, shared = own_names(fit, sharing), sharing.found_at(fit.setting)
    common = tuple(name for name in shared if name in sharing.common)
    names = (*own, *(name for name in shared if name not in common), *common)
    places = one.places(names)
    whole = np.zeros((len(one.names),) * 2)
    whole[one.places(own)] = solved(one, own)
    slopes = _shared_slopes(fit, sharing)
    direct, by_shared = whole[places], (slopes - whole @ one.information @ slopes)[places]
    of_own = direct + by_shared @ rows
    noise = of_own @ one.scores @ of_own.T + by_shared @ others[0] @ by_shared.T
    misfit = np.diag(by_shared @ others[1] @ by_shared.T)
    if one.misfit is not None:
        misfit = misfit + np.diag(of_own @ one.misfit @ of_own.T)

    def shifts(of_all: FloatArray, mine: FloatArray | None) -> FloatArray:
        return by_shared @ of_all if mine is None else by_shared @ of_all + direct @ mine

    repeating, supposed = pulls
    if repeating.ndim:  # the same law misses every setting alike
        mine = None if one.repeating is None else one.repeating.T
        misfit = np.maximum(misfit, np.sum(shifts(repeating, mine) ** 2, axis=1))
    if one.supposed is not None:
        misfit = misfit + np.sum(shifts(supposed, one.supposed) ** 2, axis=1)
    for name, of_all in flawed.items():
        misfit = misfit + shifts(of_all, one.flawed.get(name)) ** 2
    by_cycles, by_lags = (
        np.diag(direct @ scores @ direct.T) for scores in (one.cycle_scores, one.scores)
    )
    with np.errstate(invalid="ignore", divide="ignore"):
        ratios = np.sqrt(by_cycles / by_lags)
    # What no log tells has a variance of rounding alone: huge, and of either sign.
    errors = np.sqrt(np.abs(noise.diagonal())).tolist()
    bends = np.sqrt(np.maximum(misfit, 0.0)).tolist()
    intervals = {
        name: make_interval(
            float(getattr(values, name)),
            error,
            ratio if name in own else math.nan,
            is_logarithmic=values.quantity(name).is_logarithmic,
            misfit=bend,
        )
        for name, error, ratio, bend in zip(names, errors, ratios.tolist(), bends, strict=True)
    }
    return Uncertainty(fit.setting, intervals, names, noise, common)


def _sums_of_others(parts: Sequence[FloatArray], nothing: FloatArray) -> list[FloatArray]:
    """Return for each part the sum of all others; a difference could turn negative by rounding."""
    before = itertools.accumulate(parts, initial=nothing)
    after = [*itertools.accumulate(reversed(parts), initial=nothing)][-2::-1]
    return [np.asarray(a + b) for a, b in zip(before, after, strict=False)]


def own_names(fit: Fit, sharing: Sharing) -> tuple[str, ...]:
    """Return what a setting's own fit found or sought, but at a bound; none beside a minimum."""
    if not fit.outcome.is_minimum:
        return ()
    shared = sharing.found_at(fit.setting)
    return tuple(
        name
        for name in fit.parameters.names
        if fit.status[name] in {Status.FITTED, Status.NOT_IDENTIFIABLE} and name not in shared
    )


def _shared_slopes(fit: Fit, sharing: Sharing) -> FloatArray:
    """A = du/dtheta of a setting, shape (n, k): what its u move with the shared variables."""
    names = fit.parameters.names
    slopes = np.zeros((len(names), len(sharing.variables)))
    for k, one in enumerate(sharing.unknowns):
        if one.name in names and one.holds_at(fit.setting):
            slopes[names.index(one.name), k] = 1.0
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
    by_setting = {one.fit.setting: one for one in linearised}
    tables: dict[str, dict[Setting, FloatArray]] = {}

    def row_of(one: Linearisation, free: tuple[str, ...], name: str) -> FloatArray:
        return np.asarray(solved(one, free)[free.index(name)])

    for name, settings in sharing.means.items():
        used = [by_setting[setting] for setting in settings if setting in by_setting]
        tables[name] = {
            one.fit.setting: row_of(one, sharing.free, name) / len(used) for one in used
        }
    for name, setting in sharing.taken.items():
        tables[name] = {}
        if (source := by_setting.get(setting)) is None:
            continue
        # What one setting gave has its own row, and the means that were held there move it.
        row = row_of(source, tuple(one for one in sharing.free if one not in sharing.held), name)
        moved = {setting: row}
        for held in sharing.held:
            carried = -float(row @ source.information[:, source.names.index(held)])
            for other, mean in tables.get(held, {}).items():
                moved[other] = moved.get(other, np.zeros(len(row))) + carried * mean
        tables[name] = moved
    nothing = [np.zeros(len(one.names)) for one in linearised]
    return [
        np.array([tables[name].get(one.fit.setting, none) for name in sharing.found]).reshape(
            -1, len(none)
        )
        for one, none in zip(linearised, nothing, strict=True)
    ]


def _joint_rows(
    linearised: Sequence[Linearisation], sharing: Sharing
) -> tuple[FloatArray, list[FloatArray]]:
    """S^-1 of a joint fit and S T, in which each setting has the weight of its own residual."""
    rows, complement = [], np.zeros((len(sharing.variables),) * 2)
    for one in linearised:
        own, slopes = own_names(one.fit, sharing), _shared_slopes(one.fit, sharing)
        carried = one.information[:, one.places(own)] @ solved(one, own)
        weight = one.precision if one.fit.setting in sharing.settings else 0.0
        rows.append(weight * slopes.T @ (np.eye(len(one.names)) - carried))
        complement += rows[-1] @ one.information @ slopes
    return _inverse(0.5 * (complement + complement.T)), rows


def shared_covariance(linearised: Sequence[Linearisation], sharing: Sharing) -> FloatArray:
    """Return the covariance of the logarithms of ``sharing.variables`` by noise, shape (k, k)."""
    covariance = np.zeros((len(sharing.variables),) * 2)
    for row, one in zip(_shared_rows(linearised, sharing), linearised, strict=True):
        covariance += row @ one.scores @ row.T
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
