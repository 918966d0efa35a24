r"""Profile likelihood: one parameter along a line, the others refitted at every point.

With S the sum of squared residuals, least over all other parameters, and u = ln y::

    rise(u) = L (S(u) - S_min),      L = (H^-1)_uu / var(u)

In the quadratic approximation rise = (u/se)^2, so that with the printed variance of u (correlation
of the residuals and shared parameters allowed for, see `intervals`) a rise of 1.96^2 is the 95 %
limit. White-noise scaling, L = 1/s^2, would set the limits several times too near. Where a misfit
repeats, its variance (`misfit_scores`) is added to that of the noise, and so is what a value that
is held at a default and that nobody has measured may do.

Here is what a profile is, which there are, and what their limits mean; `profile_walk` has how a
line is walked. An own parameter is profiled beside the others of its setting, with the shared ones
as they are; the scale of the rise carries their errors. A shared one is profiled where the logs
gave it: R_m3 of procedure `paper` at its setting, f_f at each setting of its mean with everything
free, and those of procedure `joint` over all settings at once.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from damperfit.identification.fit_problem import FitProblem
from damperfit.identification.inactive_parts import does_nothing
from damperfit.identification.outcome import Status
from damperfit.simulation import SolverOptions
from damperfit.statistics import NORMAL_95
from damperfit.uncertainty.intervals import own_names, solved

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from damperfit.damper.model import Model, Values
    from damperfit.damper.quantity import Quantity
    from damperfit.identification import Fit, Sharing
    from damperfit.tested.setting import Setting
    from damperfit.uncertainty.intervals import Uncertainty
    from damperfit.uncertainty.linearisation import Linearisation

__all__ = [
    "Bench",
    "MisfitProfile",
    "ProfileLine",
    "ProfilePoint",
    "Stride",
    "interpolated_limit",
    "is_doubtful",
    "plausible_edges",
    "profile_lines",
    "signed_root",
    "squared_error",
    "unit_of",
    "value_at",
]

# A rise this far below zero is another, better minimum.
_BETTER = -0.5
# What is linear is followed so far, in units of its size: an offset to 10 kN.
_LINEAR_EDGE = 100.0
# A limit is interpolated between points this near to each other in sqrt(rise), or to a point this
# near to it: sqrt(rise) is then straight enough for a per cent.
_NARROW = 0.8
_NEAR = 0.25
# Above this standard error of ln y the profile's limits leave those of the quadratic approximation
# noticeably.
_DOUBTFUL = 0.1


@dataclass(frozen=True, slots=True)
class ProfilePoint:
    """One point of a profile.

    Attributes
    ----------
    value : float
        Of the profiled parameter, SI.
    rise : float
        Rise of the misfit above its minimum in units in which 1.96^2 is the 95 % limit.
    parameters : Values
        All parameters there, the free ones refitted.
    """

    value: float
    rise: float
    parameters: Values


@dataclass(frozen=True, slots=True)
class MisfitProfile:
    """How the misfit rises along one parameter.

    Attributes
    ----------
    setting : Setting
        Setting whose logs it is of.
    name : str
        Parameter.
    points : tuple of ProfilePoint
        By rising value; the best fit is among them.
    low, high : float or None
        95 % limits, SI; None where the misfit does not rise enough up to the edge of the
        plausible range: the logs set no limit on that side.
    is_complete : bool
        False when a side was given up: the budget was spent, or the model could not be simulated.
        Its limit is then None without a verdict on it.
    evaluations : int
        Simulations of the setting.
    is_shared : bool
        Of a parameter that is common to all settings.
    is_partial : bool
        Of what one setting says of a parameter that is a mean over the settings: its limits are
        not those of the mean.
    is_doubtful : bool
        Whether its limits stand for those of the quadratic approximation.
    """

    setting: Setting
    name: str
    points: tuple[ProfilePoint, ...]
    low: float | None
    high: float | None
    is_complete: bool
    evaluations: int
    is_shared: bool = False
    is_partial: bool = False
    is_doubtful: bool = False

    @property
    def shape(self) -> str:
        """closed, flat upward, flat downward, flat both ways, or not finished."""
        if not self.is_complete:
            return "not finished"
        if self.low is not None:
            return "closed" if self.high is not None else "flat upward"
        return "flat downward" if self.high is not None else "flat both ways"

    @property
    def is_flat(self) -> bool:
        """Whether the logs set no limit on a side: they do not tell the parameter."""
        return self.is_complete and (self.low is None or self.high is None)

    @property
    def better(self) -> ProfilePoint | None:
        """The lowest point when it is clearly below the fit: the fit is not the best minimum."""
        lowest = min(self.points, key=lambda point: point.rise)
        return lowest if lowest.rise < _BETTER else None


@dataclass(frozen=True, slots=True)
class Stride:
    """How closely a profile is followed.

    Attributes
    ----------
    step : float
        Wanted distance of points in sqrt(rise).
    reach : float
        Where to end in sqrt(rise).
    budget : int
        Simulations that may be spent.
    first : float
        The first step at most, in u: by a factor of two.
    """

    step: float = 0.5
    reach: float = 3.0
    budget: int = 400
    first: float = 0.7


@dataclass(frozen=True, slots=True)
class Bench:
    """What every profile of a campaign needs.

    Attributes
    ----------
    damper : Model
        The damper's model.
    solver : SolverOptions
        How exactly to integrate.
    cancelled : callable
        Asked before each simulation.
    jobs : int
        Threads.
    """

    damper: Model
    solver: SolverOptions = SolverOptions(tolerance=1e-2)
    cancelled: Callable[[], bool] = lambda: False
    jobs: int = 1

    def misfit(self, fit: Fit, free: Sequence[str]) -> FitProblem:
        """What a setting's logs say of some parameters."""
        ordered = tuple(name for name in fit.parameters.names if name in free)
        traces = tuple(log.trace for log in fit.logs)
        return FitProblem(
            self.damper,
            traces,
            ordered,
            self.solver,
            cancelled=self.cancelled,
            max_evaluations=1,
        )


@dataclass(frozen=True, slots=True)
class ProfileLine:
    """What is profiled: where, by which scale.

    Attributes
    ----------
    setting : Setting
        Setting.
    name : str
        Parameter; one of the misfit's free ones.
    misfit : FitProblem
        Logs, damper, and what is free, the parameter among it.
    start : Values
        The best fit.
    scale : float
        L of the module's docstring, 1/N^2.
    error : float
        Standard error of u as printed; where nothing is known, infinity.
    """

    setting: Setting
    name: str
    misfit: FitProblem
    start: Values
    scale: float
    error: float


def is_doubtful(name: str, fit: Fit, known: Uncertainty) -> bool:
    """Whether the quadratic approximation of the misfit may not hold as far as the limits."""
    if fit.status[name].has_failed or _is_no_friction(fit, name):
        return True
    if name not in known.names:
        return False
    place = known.names.index(name)
    return bool(known.covariance[place, place] > _DOUBTFUL**2)


def profile_lines(
    name: str,
    linearised: Mapping[Setting, Linearisation],
    known: Mapping[Setting, Uncertainty],
    sharing: Sharing,
    bench: Bench,
) -> Iterator[ProfileLine]:
    """Yield the lines along which a parameter of a campaign can be profiled, by rising setting.

    A parameter of a joint fit yields none here; see `profile_jointly`.

    Parameters
    ----------
    name : str
        Parameter.
    linearised, known : mapping of Setting to Linearisation, Uncertainty
        By setting.
    sharing : Sharing
        How the shared parameters were found.
    bench : Bench
        Damper, solver, cancellation.
    """
    for setting in sorted(linearised):
        one = linearised[setting]
        if name in sharing.found:
            line = _shared_line(name, one, known[setting], sharing, bench)
        else:
            line = _own_line(name, one, known[setting], sharing, bench)
        if line is not None:
            yield line


def _own_line(
    name: str, one: Linearisation, known: Uncertainty, sharing: Sharing, bench: Bench
) -> ProfileLine | None:
    own = own_names(one.fit, sharing)
    is_at_bound = one.fit.status[name] == Status.AT_BOUND or _is_no_friction(one.fit, name)
    if not own or (name not in own and not is_at_bound):
        return None
    free = tuple(n for n in one.names if n in (*own, name) or one.fit.status[n] == Status.AT_BOUND)
    if is_at_bound:
        return _line(name, one, bench, free=free, beside=(*own, name))
    place = known.names.index(name)
    return _line(
        name, one, bench, free=free, beside=own, variance=float(known.covariance[place, place])
    )


def _shared_line(
    name: str, one: Linearisation, known: Uncertainty, sharing: Sharing, bench: Bench
) -> ProfileLine | None:
    if sharing.jointly:
        return None
    setting = one.fit.setting
    if setting == sharing.taken.get(name):
        free = tuple(n for n in sharing.free if n not in sharing.held)
        place = known.names.index(name)
        variance = float(known.covariance[place, place])
        return _line(name, one, bench, free=free, beside=free, variance=variance)
    if setting in sharing.means.get(name, ()):
        return _line(name, one, bench, free=sharing.free, beside=sharing.free)
    return None


def _line(
    name: str,
    one: Linearisation,
    bench: Bench,
    *,
    free: tuple[str, ...],
    beside: tuple[str, ...],
    variance: float | None = None,
) -> ProfileLine:
    """The line with the scale that belongs to a variance; the sandwich of `beside` by default."""
    ordered = tuple(n for n in one.names if n in beside)
    row = solved(one, ordered)[ordered.index(name)]
    if variance is None:
        variance = float(row @ one.scores @ row)
    if one.misfit is not None:
        variance += float(row @ one.misfit @ row)
    if one.supposed is not None:
        variance += float(np.sum((row @ one.supposed) ** 2))
    curvature = float(row[one.names.index(name)])
    unit = unit_of(one.fit.parameters.quantity(name))
    is_known = variance > 0.0 and math.isfinite(variance)
    return ProfileLine(
        setting=one.fit.setting,
        name=name,
        misfit=bench.misfit(one.fit, free),
        start=one.fit.parameters,
        scale=curvature / variance if is_known else 0.0,
        error=math.sqrt(variance) / unit if is_known else math.inf,
    )


def _is_no_friction(fit: Fit, name: str) -> bool:
    """Whether a friction was left out for it ran to none: other parts may have taken its place."""
    is_friction = fit.parameters.quantity(name).is_friction
    return is_friction and fit.status[name] == Status.ABSENT and does_nothing(fit.parameters, name)


def interpolated_limit(places: Sequence[tuple[float, float]], side: float) -> tuple[float, bool]:
    """Return the limit between the points around it, and whether they are near enough.

    Parameters
    ----------
    places : sequence of (float, float)
        Place along the line and sqrt(rise) of each point, one beyond the limit among them.
    side : float
        -1 or 1.

    On the scale that grows outwards, y upwards and 1/y downwards: where the misfit is flat and then
    steep, its root is straight in that; near the best value it makes no difference.
    """
    mine = sorted((p for p in places if p[0] * side >= 0.0), key=lambda p: abs(p[0]))
    after = next(k for k, p in enumerate(mine) if p[1] >= NORMAL_95)
    (near, low), (far, high) = mine[after - 1], mine[after]
    share = (NORMAL_95 - low) / max(high - low, 1e-12)
    grown = math.expm1(min(abs(far - near), 30.0)) * share
    is_near = high - low < _NARROW or high - NORMAL_95 < _NEAR or NORMAL_95 - low < _NEAR / 2
    return near + side * math.log1p(grown), is_near


def plausible_edges(quantity: Quantity, best: float) -> tuple[float, float]:
    """Return where the plausible range ends on both sides, in u from the best value."""
    low, high = quantity.plausible
    if quantity.is_logarithmic:
        return math.log(low / best), math.log(high / best)
    ends = ((low - best) / quantity.size, (high - best) / quantity.size)
    return max(ends[0], -_LINEAR_EDGE), min(ends[1], _LINEAR_EDGE)


def value_at(quantity: Quantity, best: float, along: float) -> float:
    """Return the parameter at a place along its line."""
    return best * math.exp(along) if quantity.is_logarithmic else best + quantity.size * along


def unit_of(quantity: Quantity) -> float:
    """Return what `linearise` counts it in: a linearisation has linear quantities in their unit."""
    return 1.0 if quantity.is_logarithmic else quantity.size


def squared_error(known: Uncertainty, name: str) -> float:
    """Return what noise, misfit and what was supposed leave of ln y, of an offset itself."""
    one, place = known.intervals[name], known.names.index(name)
    noise = float(known.covariance[place, place])
    return noise * (1.0 + (one.misfit / one.error) ** 2) if one.error > 0.0 else noise


def signed_root(rise: float) -> float:
    """Return the square root of a rise, with its sign."""
    return math.copysign(math.sqrt(abs(rise)), rise)
