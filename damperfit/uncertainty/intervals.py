r"""Standard errors and 95 % intervals of a campaign's parameters.

With s the summed scores of a setting (covariance M, see `linearisation`), f its own free parameters
and theta the shared ones, the errors are linear::

    own       du = H_ff^-1 (s_f - H_f,theta dtheta)
    shared    dtheta = sum over settings of T s

The rows T follow how the shared parameters were found. Procedure `paper`: f_f is the mean over
settings of fits with everything free; R_m3 comes from the lowest setting with that mean held.
Procedure `joint`: T = S^-1 (E_theta - H_theta,f H_ff^-1 E_f) with the Schur complement S. So the
error of a shared parameter is inside the intervals of the setting's own. They are built on the
scale of ln y and can never be negative.

What follows an adjuster is an unknown for each of its clicks, and theta holds them all: A of a
setting, du/dtheta (`shared_slopes`), picks those that it has. Where K_e follows from a gas content,
theta holds V_r and K_B/C in its place, and A carries their errors to K_e and to the setting's own.
"""

from __future__ import annotations

import itertools
import math
from contextlib import suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from damperfit.errors import SimulationError, sparing
from damperfit.simulation import SolverOptions
from damperfit.statistics import NORMAL_95
from damperfit.uncertainty.linearisation import Linearisation, linearise_at_fit
from damperfit.uncertainty.settings_alike import (
    ROUNDED_OFF,
    Errors,
    Kind,
    by_kind,
    own_names,
    shared_slopes,
    solved,
)
from damperfit.workers import executor

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from damperfit.damper.model import Model
    from damperfit.errors import OnError
    from damperfit.identification import Campaign, Fit, Sharing
    from damperfit.tested.setting import Setting

    FloatArray = NDArray[np.float64]

__all__ = [
    "Interval",
    "Uncertainty",
    "linearise_settings",
    "make_interval",
    "own_names",
    "shared_covariance",
    "shared_curvature",
    "shared_slopes",
    "solved",
    "uncertainties",
]


@dataclass(frozen=True, slots=True)
class Interval:
    """Standard error and 95 % interval of one parameter, SI.

    Attributes
    ----------
    error : float
        Standard error of noise: y times that of ln y.
    low, high : float
        y exp(-+1.96 se(ln y)); an offset, which may be negative, has y -+ 1.96 se. The errors of
        noise and misfit together.
    cycle_ratio : float
        The error from the scatter between whole cycles (linearised jackknife, the setting's own
        logs only) over the same from the residuals' autocorrelation. 1 within about
        1/sqrt(2 (cycles - 1)) when both are right; far below 1 where the residuals repeat with
        the cycle; now and then far above 1 where noise of the displacement, which enters as its
        derivative, leaves hardly more than their ends in the cycles' sums (Monte Carlo: the
        errors given are right there). NaN for a shared parameter and for a single cycle.
    misfit : float
        Standard error from the model's misfit: from what repeats in the residual, and from what is
        held at a default that nobody has measured; 0 where there is neither.
    """

    error: float
    low: float
    high: float
    cycle_ratio: float
    misfit: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Uncertainty:
    """How far the parameters of one setting may be trusted.

    Attributes
    ----------
    setting : Setting
        Adjuster setting.
    intervals : dict of str to Interval
        For every fitted or shared parameter that the logs gave.
    names : tuple of str
        Order of `covariance`: the setting's own, those of its clicks, those of all settings.
    covariance : numpy.ndarray
        Of ln y (an offset: of itself, N), shape (k, k).
    shared : tuple of str
        The last of `names`: one value for all settings, also where the logs do not determine it.
    unopened : mapping of str to float
        Openings that no log reaches, by name, and the pressure that each is above, Pa.
    """

    setting: Setting
    intervals: Mapping[str, Interval]
    names: tuple[str, ...]
    covariance: FloatArray
    shared: tuple[str, ...] = ()
    unopened: Mapping[str, float] = field(default_factory=dict)

    @property
    def correlation(self) -> FloatArray:
        """Correlation matrix, shape (k, k)."""
        scale = np.sqrt(np.abs(np.diag(self.covariance)))
        return np.asarray(self.covariance / np.outer(scale, scale))


def linearise_settings(
    campaign: Campaign,
    damper: Model,
    *,
    solver: SolverOptions = SolverOptions(tolerance=1e-2),
    jobs: int = 1,
    on_error: OnError | None = None,
) -> tuple[Linearisation, ...]:
    """Linearise the fit of every setting, by rising setting; one simulation for each log.

    A setting that cannot be simulated at its fitted point is left out. So is one with another
    error, where ``on_error`` is there to be told of it.
    """

    def one(fit: Fit) -> Linearisation | None:
        with sparing(fit.setting, on_error), suppress(SimulationError):
            return linearise_at_fit(fit, damper, solver=solver)
        return None

    with executor(jobs) as pool:
        found = pool.map(one, campaign.fits)
        return tuple(linearised for linearised in found if linearised is not None)


def uncertainties(
    linearised: Sequence[Linearisation], sharing: Sharing, *, on_error: OnError | None = None
) -> tuple[Uncertainty, ...]:
    """Return errors and intervals for every setting.

    Parameters
    ----------
    linearised : sequence of Linearisation
        Of all settings of the campaign.
    sharing : Sharing
        How the shared parameters were found.
    on_error : callable, optional
        Told of a setting and the error that it met; the setting is then left out.
    """
    rows = _shared_rows(linearised, sharing)
    parts = [row @ one.scores @ row.T for row, one in zip(rows, linearised, strict=True)]
    nothing = np.zeros((len(sharing.variables),) * 2)
    others = _sums_of_others(parts, nothing)
    bent = [
        nothing if one.misfit is None else row @ one.misfit @ row.T
        for row, one in zip(rows, linearised, strict=True)
    ]
    supposed = [
        row @ one.supposed
        for row, one in zip(rows, linearised, strict=True)
        if one.supposed is not None
    ]
    of_all = np.asarray(sum(supposed))
    places = by_kind(linearised, sharing)
    bent_by_others = _sums_of_others(bent, nothing)
    found: dict[int, Uncertainty] = {}

    def told(few: Sequence[int]) -> None:
        together = Kind.of([linearised[k] for k in few], sharing, [rows[k] for k in few])
        noise, misfit = (np.stack([of[k] for k in few]) for of in (others, bent_by_others))
        errors = together.errors(noise, misfit, of_all)
        for k, own in zip(few, zip(*errors, strict=True), strict=True):
            with sparing(linearised[k].fit.setting, on_error):
                found[k] = _of_setting(linearised[k], together.names, together.common, own)

    for alike in places:
        try:
            told(alike)
        except Exception:
            if on_error is None:
                raise
            for k in alike:  # whose it is shows one by one
                with sparing(linearised[k].fit.setting, on_error):
                    told([k])
    return tuple(found[k] for k in sorted(found))


def _sums_of_others(parts: Sequence[FloatArray], nothing: FloatArray) -> list[FloatArray]:
    """Return for each part the sum of all others; a difference could turn negative by rounding."""
    before = itertools.accumulate(parts, initial=nothing)
    after = [*itertools.accumulate(reversed(parts), initial=nothing)][-2::-1]
    return [np.asarray(a + b) for a, b in zip(before, after, strict=False)]


def shared_covariance(linearised: Sequence[Linearisation], sharing: Sharing) -> FloatArray:
    """Return the covariance of the logarithms of ``sharing.variables``, shape (k, k)."""
    rows = _shared_rows(linearised, sharing)
    parts = [row @ one.scores @ row.T for row, one in zip(rows, linearised, strict=True)]
    return np.asarray(np.sum([np.zeros((len(sharing.variables),) * 2), *parts], axis=0))


def shared_curvature(linearised: Sequence[Linearisation], sharing: Sharing) -> FloatArray:
    """Return the variances of a joint fit's variables, (k,), by white noise: those of S^-1."""
    return np.asarray(np.diag(_joint_rows(linearised, sharing)[0]))


def _of_setting(
    linearised: Linearisation, names: tuple[str, ...], common: tuple[str, ...], errors: Errors
) -> Uncertainty:
    """Intervals of one setting from its covariance, variances of misfit, and ratios by cycles."""
    covariance, misfit, ratios = errors
    # What no log tells has a variance of rounding alone: huge, and of either sign.
    noise = np.sqrt(np.abs(covariance.diagonal())).tolist()
    bends = np.sqrt(np.maximum(misfit, 0.0)).tolist()
    values = linearised.fit.parameters
    intervals = {
        name: make_interval(
            float(getattr(values, name)),
            error,
            ratio,
            is_logarithmic=values.quantity(name).is_logarithmic,
            misfit=bend,
        )
        for name, error, ratio, bend in zip(names, noise, ratios.tolist(), bends, strict=True)
    }
    return Uncertainty(linearised.fit.setting, intervals, names, covariance, common)


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


def _shared_rows(linearised: Sequence[Linearisation], sharing: Sharing) -> list[FloatArray]:
    """T for every setting, shape (number shared, number of quantities)."""
    if sharing.jointly:
        inverse, rows = _joint_rows(linearised, sharing)
        return [np.asarray(inverse @ row) for row in rows]
    by_setting = {one.fit.setting: one for one in linearised}
    tables: dict[str, dict[Setting, FloatArray]] = {}
    for name, settings in sharing.means.items():
        used = [setting for setting in settings if setting in by_setting]
        tables[name] = {
            setting: _row(by_setting[setting], sharing.free, name) / len(used) for setting in used
        }
    for name, setting in sharing.taken.items():
        source = by_setting.get(setting)
        tables[name] = {} if source is None else _taken_rows(name, source, sharing, tables)
    found = []
    for one in linearised:
        nothing = np.zeros(len(one.names))
        mine = [tables[name].get(one.fit.setting, nothing) for name in sharing.found]
        found.append(np.array(mine).reshape(-1, len(one.names)))
    return found


def _taken_rows(
    name: str,
    source: Linearisation,
    sharing: Sharing,
    means: Mapping[str, Mapping[Setting, FloatArray]],
) -> dict[Setting, FloatArray]:
    """T of what one setting gave: its own row, and how the means that were held move it."""
    row = _row(source, tuple(one for one in sharing.free if one not in sharing.held), name)
    rows = {source.fit.setting: row}
    for held in sharing.held:
        carried = -float(row @ source.information[:, source.names.index(held)])
        for setting, other in means.get(held, {}).items():
            rows[setting] = rows.get(setting, np.zeros(len(row))) + carried * other
    return rows


def _joint_rows(
    linearised: Sequence[Linearisation], sharing: Sharing
) -> tuple[FloatArray, list[FloatArray]]:
    """S^-1 of a joint fit and S T, in which each setting has the weight of its own residual."""
    slopes = [shared_slopes(one.fit, sharing) for one in linearised]
    rows = []
    for one, slope in zip(linearised, slopes, strict=True):
        own = own_names(one.fit, sharing)
        carried = one.information[:, one.places(own)] @ solved(one, own)
        is_in = one.fit.setting in sharing.settings
        weight = one.precision if is_in else 0.0
        rows.append(slope.T @ (np.eye(len(one.names)) - carried) * weight)
    complement = np.sum(
        [
            row @ one.information @ slope
            for row, one, slope in zip(rows, linearised, slopes, strict=True)
        ],
        axis=0,
    )
    scale = 1.0 / np.sqrt(np.maximum(np.diag(complement), 1e-300))
    inverse = np.linalg.pinv(complement * np.outer(scale, scale), rcond=ROUNDED_OFF)
    return np.asarray(inverse * np.outer(scale, scale)), rows


def _row(linearised: Linearisation, free: tuple[str, ...], name: str) -> FloatArray:
    return np.asarray(solved(linearised, free)[free.index(name)])
