r"""Profile likelihood: one parameter along a line, the others refitted at every point.

With S the sum of squared residuals, least over all other parameters, and u = ln y::

    rise(u) = L (S(u) - S_min),      L = (H^-1)_uu / var(u)

In the quadratic approximation rise = (u/se)^2, so that with the variance of u of the covariance
(`covariance`; noise, misfit and what was supposed) a rise of 1.96^2 is the 95 % limit. White-noise
scaling, L = 1/s^2, would set the limits several times too near.

An own parameter is profiled beside the others of its setting, with the shared ones as they are; the
scale of the rise carries their errors. A shared one is profiled where the logs gave it: R_m3 of
procedure `paper` at its setting, f_f at each setting of its mean with everything free, and those of
procedure `joint` over all settings at once.

sqrt(rise) runs nearly straight, so that few points do and a limit is interpolated in it. A point
of one setting costs one or two simulations: the others follow their tangent, the loop of every fit
(`identification.least_squares`) corrects them until another step promises next to nothing, and the
next point starts there. A parameter of a joint fit is profiled with all settings refitted.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from damperfit.arrays import FloatArray
from damperfit.damper.model import Model, Quantity, Values
from damperfit.errors import FitCancelledError, SimulationError
from damperfit.identification.fit_problem import (
    Block,
    FitProblem,
    Point,
    does_nothing,
    is_at_edge,
    linearise,
    values_of,
    with_values,
)
from damperfit.identification.fit_setting import NOT_FIT_TO_SHARE, Fit
from damperfit.identification.joint import LONGEST_STEP, STEP_TOLERANCE, fit_jointly
from damperfit.identification.least_squares import (
    NO_LENGTH,
    LinearSystem,
    Step,
    Stopping,
    iterate,
)
from damperfit.identification.outcome import Status
from damperfit.identification.sharing import Sharing, Unknown
from damperfit.simulation import SolverOptions
from damperfit.statistics import NORMAL_95
from damperfit.tested.setting import Setting
from damperfit.uncertainty.covariance import (
    Linearisation,
    Uncertainty,
    own_names,
    shared_curvature,
    solved,
)

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
_MAX_LOOKS = 3
# The line itself may go by a factor of ten where nothing happens.
_LONGEST_STRIDE = 2.3
_LONGEST_GROWTH = 3.0
# What one more full step of the others would take from the rise.
_SETTLED, _MAX_REFITS = 0.02, 20
# Damping of a tangent, columns of length 1: what the logs do not see stays where it is.
_UNSEEN = 1e-12
# A look at the two limits alone: three simulations where the quadratic approximation is near.
_QUICK_STEP, _QUICK_REACH = 2.05, 1.96
# What it may cost at a setting: a share of what its fit has, which is ten simulations or more.
_QUICK_SHARE, _QUICK_LEAST = 0.7, 8
# A look at shared limits alone, a little beyond them; what it may cost over the fits.
_SHARED_STEP, _SHARED_REACH, _SHARED_SHARE = 1.05 * NORMAL_95, NORMAL_95, 0.7


@dataclass(frozen=True, slots=True)
class ProfilePoint:
    """One point of a profile."""

    value: float  # of the profiled parameter, SI
    rise: float  # of the misfit above its minimum; 1.96^2 is the 95 % limit
    parameters: Values  # all of them there, the free ones refitted


@dataclass(frozen=True, slots=True)
class MisfitProfile:
    """How the misfit rises along one parameter."""

    setting: Setting  # whose logs it is of
    name: str
    points: tuple[ProfilePoint, ...]  # by rising value; the best fit is among them
    # 95 % limits, SI; None where the misfit does not rise enough up to the edge of the plausible
    # range: the logs set no limit on that side.
    low: float | None
    high: float | None
    # False when a side was given up: the budget was used up, or the model could not be simulated.
    # Its limit is then None without a verdict on it.
    is_complete: bool
    evaluations: int  # simulations of the setting
    is_shared: bool = False  # of a parameter that is common to all settings
    # Of what one setting says of a parameter that is a mean over the settings: its limits are not
    # those of the mean.
    is_partial: bool = False
    is_doubtful: bool = False  # whether its limits stand for those of the quadratic approximation

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
        """Whether the logs set no limit on a side: they do not determine the parameter."""
        return self.is_complete and (self.low is None or self.high is None)

    @property
    def better(self) -> ProfilePoint | None:
        """The lowest point when it is clearly below the fit: the fit is not the best minimum."""
        lowest = min(self.points, key=lambda point: point.rise)
        return lowest if lowest.rise < _BETTER else None


class Stride(NamedTuple):
    """How closely a profile is followed, in sqrt(rise)."""

    step: float = 0.5  # wanted distance of points
    reach: float = 3.0  # where to end
    budget: int = 400  # simulations that it may take
    first: float = 0.7  # the first step at most, in u: by a factor of two


class Bench(NamedTuple):
    """What every profile of a campaign needs."""

    damper: Model
    solver: SolverOptions = SolverOptions(tolerance=1e-2)
    cancelled: Callable[[], bool] = lambda: False  # asked before each simulation
    jobs: int = 1
    sharing: Sharing = Sharing()
    known: Mapping[Setting, Uncertainty] = MappingProxyType({})  # errors by setting

    def misfit(self, fit: Fit, free: Sequence[str]) -> Block:
        """What a setting's logs say of some parameters."""
        ordered = tuple(name for name in fit.parameters.names if name in free)
        traces = tuple(log.trace for log in fit.logs)
        asked = self.cancelled
        return Block(self.damper, traces, ordered, self.solver, cancelled=asked, max_evaluations=1)

    def is_doubtful(self, name: str, fit: Fit) -> bool:
        """Whether the quadratic approximation of the misfit may not hold as far as the limits."""
        if fit.status[name].has_failed or _is_no_friction(fit, name):
            return True
        known = self.known[fit.setting]
        return name in known.names and known.error(name) > _DOUBTFUL


def _is_no_friction(fit: Fit, name: str) -> bool:
    """Whether a friction was left out for it ran to none: other parts may have taken its place."""
    is_friction = fit.parameters.quantity(name).is_friction
    return is_friction and fit.status[name] == Status.ABSENT and does_nothing(fit.parameters, name)


def _unit(fit: Fit, name: str) -> float:
    """What `linearise` counts it in: a linearisation has linear quantities in their unit."""
    quantity = fit.parameters.quantity(name)
    return 1.0 if quantity.is_logarithmic else quantity.size


# A parameter is profiled along its line, at one setting or over all of a joint fit.


class _Point(NamedTuple):
    """A point of the profile: state to go on from, rise of the misfit, all values there."""

    state: Any
    rise: float
    at: Mapping[Setting, Values]
    nfev: int  # simulations


class _Line:
    """Refits with one parameter held at places along its line."""

    def __init__(
        self,
        quantity: Quantity,
        best: float,
        error: float,  # standard error of u as printed; where nothing is known, infinity
        centre: _Point,  # the best fit
        refit: Callable[[Any, float, int], _Point],  # from a state, to a place, with so many left
    ) -> None:
        self.quantity, self.best, self.error = quantity, best, error
        self.centre, self.here, self.refit, self.nfev = centre, centre, refit, centre.nfev
        self.points: list[tuple[float, float, Mapping[Setting, Values]]] = [
            (0.0, centre.rise, centre.at)
        ]

    def look(self, along: float, stride: Stride) -> float:
        """Refit, going on from the place before; return the sqrt(rise) there."""
        self.here = self.refit(self.here.state, along, stride.budget - self.nfev)
        self.nfev += self.here.nfev
        root = math.copysign(math.sqrt(abs(self.here.rise)), self.here.rise)
        self.points.append((along, root, self.here.at))
        return root

    def profiles(self, stride: Stride) -> dict[Setting, MisfitProfile]:
        """Profile both sides; return the profile of every setting."""
        low, high = self.quantity.plausible
        if self.quantity.is_logarithmic:
            edges = math.log(low / self.best), math.log(high / self.best)
        else:
            down, up = ((end - self.best) / self.quantity.size for end in (low, high))
            edges = max(down, -_LINEAR_EDGE), min(up, _LINEAR_EDGE)
        (low_at, is_low_known), (high_at, is_high_known) = (
            self._side(side, stride, edges) for side in (-1.0, 1.0)
        )
        name, points = self.quantity.name, sorted(self.points, key=lambda point: point[0])
        return {
            setting: MisfitProfile(
                setting=setting,
                name=name,
                points=tuple(
                    ProfilePoint(float(getattr(at[setting], name)), root * abs(root), at[setting])
                    for _, root, at in points
                ),
                low=None if low_at is None else _moved(self.quantity, self.best, low_at),
                high=None if high_at is None else _moved(self.quantity, self.best, high_at),
                is_complete=is_low_known and is_high_known,
                evaluations=self.nfev,
            )
            for setting in points[0][2]
        }

    def _side(
        self, side: float, stride: Stride, edges: tuple[float, float]
    ) -> tuple[float | None, bool]:
        """Profile one side; return the limit (None: not reached), and whether it is known."""
        self.here = self.centre
        edge, other_edge = edges[side > 0.0], edges[side < 0.0]
        if edge * side <= 0.0:
            return None, True
        along, root, limit = 0.0, 0.0, None
        step = min(stride.step * self.error, stride.first)
        if other_edge * side > 0.0:  # the fit ran out of the range on the other side: to its edge
            step = max(step, abs(other_edge))
        try:
            while root < stride.reach and along != edge:
                if self.nfev >= stride.budget:
                    return limit, limit is not None
                along = side * min(abs(along) + step, abs(edge))
                root_there = self.look(along, stride)
                if limit is None and root_there >= NORMAL_95:
                    # Between the outermost points around it, nearer and nearer.
                    for looks in range(_MAX_LOOKS + 1):
                        places = [point[:2] for point in self.points]
                        limit, is_near = _interpolated_limit(places, side)
                        if is_near or looks == _MAX_LOOKS or self.nfev >= stride.budget:
                            break
                        self.look(limit, stride)
                # Aim for the wanted distance in sqrt(rise), a few times as far at most.
                aimed = min(stride.step, max(stride.reach - root_there, 0.2 * stride.step) * 1.05)
                grown = aimed / max(root_there - root, 1e-3)
                step = min(step * min(max(grown, 0.2), _LONGEST_GROWTH), _LONGEST_STRIDE)
                root = root_there
        except SimulationError:
            self.nfev += 1
            return limit, limit is not None
        return limit, True


def _moved(quantity: Quantity, best: float, along: float) -> float:
    """A parameter at a place along its line."""
    return best * math.exp(along) if quantity.is_logarithmic else best + quantity.size * along


def _interpolated_limit(places: Sequence[tuple[float, float]], side: float) -> tuple[float, bool]:
    """The limit between points, (place, sqrt(rise)), one beyond it; whether they are near."""
    # On the scale that grows outwards, y upwards and 1/y downwards, where the misfit is flat and
    # then steep, its root is straight; near the best value it makes no difference.
    mine = sorted((p for p in places if p[0] * side >= 0.0), key=lambda p: abs(p[0]))
    after = next(k for k, p in enumerate(mine) if p[1] >= NORMAL_95)
    (near, low), (far, high) = mine[after - 1], mine[after]
    share = (NORMAL_95 - low) / max(high - low, 1e-12)
    grown = math.expm1(min(abs(far - near), 30.0)) * share
    is_near = high - low < _NARROW or high - NORMAL_95 < _NEAR or NORMAL_95 - low < _NEAR / 2
    return near + side * math.log1p(grown), is_near


class _State(NamedTuple):
    """A point with what is needed to go on from it, in the variables of `linearise`."""

    variables: FloatArray
    parameters: Values
    residuals: FloatArray
    jacobian: FloatArray


def _own_line(fit: Fit, name: str, misfit: Block, scale: float, error: float, budget: int) -> _Line:
    """The line at one setting: along one of the misfit's free parameters; L is in 1/N^2."""
    free, packing, quantity = misfit.free, misfit.common_variables, fit.parameters.quantity(name)
    bounds = [packing.pack(edges) for edges in misfit.bounds]
    place, every = free.index(name), np.arange(len(free), dtype=np.intp)
    others = np.delete(every, place)

    def settled(
        start: FloatArray, moving: NDArray[np.intp], left: int
    ) -> tuple[_State, float, int]:
        """Refit the moving ones: the state, the least cost that is promised there, simulations."""

        def point_at(part: FloatArray) -> tuple[LinearSystem, _State]:
            variables = start.copy()
            variables[moving] = part
            parameters = with_values(fit.parameters, free, packing.unpack(variables))
            residuals, jacobian = linearise(misfit, parameters)
            system = LinearSystem(residuals, jacobian[:, moving])
            return system, _State(variables, parameters, residuals, jacobian)

        stopping = Stopping(
            step_tolerance=STEP_TOLERANCE,
            max_evaluations=max(1, min(_MAX_REFITS, left)),
            least_gain=_SETTLED / scale if scale > 0.0 else math.inf,
            longest_step=LONGEST_STEP,
        )
        best = iterate(point_at, start[moving], stopping, (bounds[0][moving], bounds[1][moving]))
        system = best.system.without(best.is_held) if best.is_held.any() else best.system
        cost = best.system.cost - _full_step(system).effect
        return best.extra, cost, best.evaluations

    # From the edge of its range the profiled one would leave it.
    moving = others if is_at_edge(fit.parameters, name) else every
    centre, least, nfev = settled(packing.pack(values_of(free, fit.parameters)), moving, budget)

    def refit(state: _State, along: float, left: int) -> _Point:
        """Go along the line, the others along their tangent, and settle there."""
        moved = state.variables.copy()
        moved[place] = centre.variables[place] + along
        shift = moved[place] - state.variables[place]
        ahead = state.residuals + state.jacobian[:, place] * shift
        change = _full_step(LinearSystem(ahead, state.jacobian[:, others])).change
        length = float(np.max(np.abs(change), initial=0.0))
        moved[others] += change * min(1.0, 2.0 * LONGEST_STEP / max(length, 1e-300))
        minimum, cost, nfev = settled(moved, others, left)
        return _Point(minimum, scale * (cost - least), {fit.setting: minimum.parameters}, nfev)

    best = float(getattr(centre.parameters, name))
    start = _Point(centre, 0.0, {fit.setting: centre.parameters}, nfev)
    return _Line(quantity, best, error, start, refit)


def _full_step(system: LinearSystem) -> Step:
    lengths = np.where(system.lengths > NO_LENGTH, system.lengths, 1.0)
    return system.scaled(lengths).step(_UNSEEN)


def profile_at(
    name: str, linear: Linearisation, bench: Bench, stride: Stride = Stride()
) -> MisfitProfile | None:
    """Return the profile of a parameter at a setting; None where it is not identifiable there.

    One of a joint fit has none here. A SimulationError: the best fit cannot be simulated; a
    FitCancelledError: the caller asked to stop.
    """
    fit, setting, sharing = linear.fit, linear.fit.setting, bench.sharing
    own, known = own_names(fit, sharing), bench.known[setting]
    variance = known.error(name) ** 2 if name in known.names else None
    if name not in sharing.estimated:
        at_bound = {n for n in linear.names if fit.status[n] == Status.AT_BOUND}
        is_at_bound = name in at_bound or _is_no_friction(fit, name)
        if not own or (name not in own and not is_at_bound):
            return None
        free, beside = {*own, name, *at_bound}, {*own, name}
        variance = None if is_at_bound else variance
    elif sharing.jointly:
        return None
    elif setting == sharing.taken.get(name):
        free = beside = {*sharing.free} - {*sharing.held}
    elif setting in sharing.means.get(name, ()):
        free, beside, variance = {*sharing.free}, {*sharing.free}, None
    else:
        return None
    # The scale belongs to the variance of noise as printed, else to that of the sandwich here.
    ordered = tuple(n for n in linear.names if n in beside)
    row = solved(linear, ordered)[ordered.index(name)]
    if variance is None:
        variance = float(row @ linear.scores @ row)
    if linear.misfit is not None:
        variance += float(row @ linear.misfit @ row)
    if linear.supposed is not None:
        variance += float(np.sum((row @ linear.supposed) ** 2))
    scale, error = 0.0, math.inf
    if variance > 0.0 and math.isfinite(variance):
        scale = float(row[linear.names.index(name)]) / variance
        error = math.sqrt(variance) / _unit(fit, name)
    misfit = bench.misfit(fit, tuple(free))
    line = _own_line(fit, name, misfit, scale, error, stride.budget)
    return replace(
        line.profiles(stride)[setting],
        is_shared=name in sharing.estimated,
        is_partial=sharing.is_mean(name),
        is_doubtful=bench.is_doubtful(name, fit),
    )


def doubtful_profiles(linear: Linearisation, bench: Bench) -> tuple[MisfitProfile, ...]:
    """Return short profiles of what the quadratic approximation leaves in doubt at a setting."""
    fit, budget = linear.fit, max(_QUICK_LEAST, int(_QUICK_SHARE * linear.fit.evaluations))
    profiles = []
    # What has failed first: the budget may not reach for all.
    positive = [q.name for q in fit.parameters.quantities if q.is_logarithmic]
    for name in sorted(positive, key=lambda name: not fit.status[name].has_failed):
        # A mean over settings has no profile in one of them.
        if bench.sharing.is_mean(name) or not bench.is_doubtful(name, fit):
            continue
        if budget < _QUICK_LEAST // 2:
            break
        profile = profile_at(name, linear, bench, Stride(_QUICK_STEP, _QUICK_REACH, budget))
        if profile is not None:
            budget -= profile.evaluations
            profiles.append(profile)
    return tuple(profiles)


def profile_jointly(
    unknown: Unknown, linearised: Sequence[Linearisation], bench: Bench, stride: Stride = Stride()
) -> tuple[MisfitProfile, ...]:
    """Return the profile of a shared parameter of a joint fit, once for every setting that has it.

    The rise is that of all settings. Errors as of `profile_at`.
    """
    sharing, name = bench.sharing, unknown.name
    fits = [
        linear.fit
        for linear in linearised
        if linear.fit.setting in sharing.settings and linear.fit.outcome.is_minimum
    ]
    whole = FitProblem(
        {fit.setting: bench.misfit(fit, sharing.free) for fit in fits},
        sharing.jointly,
        sharing.follows,
        gas=sharing.gas,
        jobs=bench.jobs,
    )
    centre = fit_jointly(whole, {fit.setting: fit.parameters for fit in fits})
    at = centre.extra.values
    held = replace(whole, held=frozenset({unknown}), weights=centre.extra.weights)
    first = next(values for setting, values in at.items() if unknown.holds_at(setting))
    quantity, best = first.quantity(name), float(getattr(first, name))
    having = (linear.fit.setting for linear in linearised if unknown.holds_at(linear.fit.setting))
    error = bench.known[next(having)].whole_error(name)
    scale = shared_curvature(linearised, sharing)[sharing.unknowns.index(unknown)] / error**2

    def refit(state: Point, along: float, left: int) -> _Point:
        del left  # a joint fit is not cut short
        there = {name: _moved(quantity, best, along)}
        starts = {
            s: x.replace(there) if unknown.holds_at(s) else x for s, x in state.values.items()
        }
        minimum = fit_jointly(replace(held, gas=state.gas), starts)
        rise = scale * (minimum.cost - centre.cost)
        return _Point(minimum.extra, rise, minimum.extra.values, minimum.evaluations)

    begin = _Point(centre.extra, 0.0, at, centre.evaluations)
    profiles = _Line(quantity, best, error / _unit(fits[0], name), begin, refit).profiles(stride)
    mine = [setting for setting in sorted(profiles) if unknown.holds_at(setting)]
    return tuple(replace(profiles[setting], is_shared=True) for setting in mine)


def shared_limits(linearised: Sequence[Linearisation], bench: Bench) -> Iterator[MisfitProfile]:
    """Yield short profiles of what a joint fit shares and its logs do not determine.

    A mounting that no log shows give ends at the upper edge of its range, where a change of it does
    nothing: the quadratic approximation then excludes no value. Softer ones do fit worse, and a
    short profile with all settings refitted says from where on.
    """
    budget = int(_SHARED_SHARE * sum(linear.fit.evaluations for linear in linearised))
    # The law of K_e has numbers of the gas, which are none of a setting.
    for unknown in (u for u in bench.sharing.unknowns if u.name in bench.sharing.jointly):
        name = unknown.name
        having = [linear.fit for linear in linearised if unknown.holds_at(linear.fit.setting)]
        if not having or not having[0].parameters.quantity(name).is_logarithmic:
            continue
        own = bench.known[having[0].setting]
        if own.error(name) <= NOT_FIT_TO_SHARE and not having[0].status[name].has_failed:
            continue
        # By as much of 1/y as an error of it: a value at its edge is far from where it matters.
        first = math.log1p(_SHARED_STEP * own.whole_error(name))
        stride = Stride(_SHARED_STEP, _SHARED_REACH, budget, first)
        with suppress(SimulationError, FitCancelledError):
            profiles = profile_jointly(unknown, linearised, bench, stride)
            by_setting = {profile.setting: profile for profile in profiles}
            for fit in having:  # also one that was no part of it, for it has the same value
                profile = by_setting.get(fit.setting, profiles[0])
                yield replace(profile, setting=fit.setting, is_doubtful=True)
