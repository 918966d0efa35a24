"""How a profile is walked: the held parameter goes along its line, the others are refitted.

sqrt(rise) runs nearly straight, so that few points do and a limit is interpolated in it. A point
of one setting costs one or two simulations: the others follow their tangent, the loop of every fit
(`identification.least_squares`) corrects them until another step promises next to nothing, and the
next point starts there. A parameter of a joint fit is walked with all settings refitted.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Protocol

import numpy as np

from damperfit.errors import SimulationError
from damperfit.identification.fit_problem import common_variables, is_at_edge, linearise
from damperfit.identification.least_squares import NO_LENGTH, DenseSystem, Stopping, iterate
from damperfit.identification.tied_problem import JointSolution, TiedProblem, fit_jointly
from damperfit.statistics import NORMAL_95
from damperfit.uncertainty.intervals import shared_curvature
from damperfit.uncertainty.profiles import (
    Bench,
    MisfitProfile,
    ProfileLine,
    ProfilePoint,
    Stride,
    interpolated_limit,
    is_doubtful,
    plausible_edges,
    profile_lines,
    signed_root,
    squared_error,
    unit_of,
    value_at,
)

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from damperfit.damper.model import Values
    from damperfit.damper.quantity import Quantity
    from damperfit.identification import Sharing
    from damperfit.identification.least_squares import LinearSystem, Step
    from damperfit.identification.sharing import Unknown
    from damperfit.tested.setting import Setting
    from damperfit.uncertainty.intervals import Uncertainty
    from damperfit.uncertainty.linearisation import Linearisation

    FloatArray = NDArray[np.float64]

__all__ = ["doubtful_profiles", "profile_jointly", "trace_profile"]

_MAX_LOOKS = 3
# The line itself may go by a factor of ten where nothing happens.
_LONGEST_STRIDE = 2.3
_LONGEST_GROWTH = 3.0
# What one more full step of the others would take from the rise.
_SETTLED, _MAX_REFITS = 0.02, 20
# Values are changed by a factor of two at most in one step of the others.
_LONGEST_STEP = 0.7
# Below this relative size a step is not tried again shorter: the integrator's own error is left.
_STEP_TOLERANCE = 1e-7
# Damping of a tangent, columns of length 1: what the logs do not see stays where it is.
_UNSEEN = 1e-12
# A look at the two limits alone: three simulations where the quadratic approximation is near.
_QUICK_STEP, _QUICK_REACH = 2.05, 1.96
# What it may cost at a setting: a share of what its fit has, which is ten simulations or more.
_QUICK_SHARE, _QUICK_LEAST = 0.7, 8


class _Walker(Protocol):
    """Something that can be refitted with one parameter held at a place along its line."""

    points: list[tuple[float, float, Mapping[Setting, Values]]]
    spent: int

    def refit(self, along: float) -> float:
        """Refit, going on from the place before; note the point, return its sqrt(rise)."""

    def restart(self) -> None:
        """Go back to the best fit."""


@dataclass(frozen=True, slots=True, eq=False)
class _State:
    """A point with what is needed to go on from it, in the variables of `linearise`."""

    variables: FloatArray
    parameters: Values
    residuals: FloatArray
    jacobian: FloatArray


@dataclass(slots=True)
class _Walk:
    """The walker of one setting."""

    line: ProfileLine
    budget: int
    least: float = 0.0
    spent: int = 0
    points: list[tuple[float, float, Mapping[Setting, Values]]] = field(default_factory=list)
    state: _State = field(init=False)
    centre: _State = field(init=False)

    def __post_init__(self) -> None:
        free, start = self.line.misfit.free, self.line.start
        values = np.array([getattr(start, name) for name in free])
        every = np.arange(len(free), dtype=np.intp)
        packed = common_variables(self.line.misfit).pack(values)
        # From the edge of its range the profiled one would leave it.
        is_stuck = is_at_edge(start, self.line.name)
        self.centre, self.least = self._settled(packed, self._others if is_stuck else every)
        self.points.append((0.0, 0.0, {self.line.setting: self.centre.parameters}))
        self.state = self.centre

    def restart(self) -> None:
        self.state = self.centre

    def refit(self, along: float) -> float:
        self.state, cost = self._settled(self._moved(along), self._others)
        root = signed_root(self.line.scale * (cost - self.least))
        self.points.append((along, root, {self.line.setting: self.state.parameters}))
        return root

    @property
    def _place(self) -> int:
        return self.line.misfit.free.index(self.line.name)

    @property
    def _others(self) -> NDArray[np.intp]:
        places = range(len(self.line.misfit.free))
        return np.array([k for k in places if k != self._place], dtype=np.intp)

    def _settled(self, start: FloatArray, moving: NDArray[np.intp]) -> tuple[_State, float]:
        """Refit the moving ones; returns the state and the least cost that is promised there."""
        misfit = self.line.misfit

        def point_at(part: FloatArray) -> tuple[DenseSystem, _State]:
            self.spent += 1
            variables = start.copy()
            variables[moving] = part
            values = common_variables(misfit).unpack(variables).tolist()
            named = dict(zip(misfit.free, values, strict=True))
            parameters = self.line.start.replace(named)
            residuals, jacobian = linearise(misfit, parameters)
            system = DenseSystem(residuals, jacobian[:, moving])
            return system, _State(variables, parameters, residuals, jacobian)

        stopping = Stopping(
            step_tolerance=_STEP_TOLERANCE,
            max_evaluations=max(1, min(_MAX_REFITS, self.budget - self.spent)),
            least_gain=_SETTLED / self.line.scale if self.line.scale > 0.0 else math.inf,
            longest_step=_LONGEST_STEP,
        )
        ended = iterate(point_at, start[moving], stopping)
        return ended.extra, ended.system.cost - _full_step(ended.system).effect

    def _moved(self, along: float) -> FloatArray:
        """Go along the line, the others along their tangent."""
        state, place, others = self.state, self._place, self._others
        moved = state.variables.copy()
        moved[place] = self.centre.variables[place] + along
        shift = moved[place] - state.variables[place]
        ahead = state.residuals + state.jacobian[:, place] * shift
        change = _full_step(DenseSystem(ahead, state.jacobian[:, others])).change
        length = float(np.max(np.abs(change), initial=0.0))
        moved[others] += change * min(1.0, 2.0 * _LONGEST_STEP / max(length, 1e-300))
        return moved


def _full_step(system: LinearSystem) -> Step:
    lengths = np.where(system.lengths > NO_LENGTH, system.lengths, 1.0)
    return system.scaled(lengths).step(_UNSEEN)


def trace_profile(line: ProfileLine, stride: Stride = Stride()) -> MisfitProfile:
    """Follow the misfit of a setting along one parameter to both sides of its best value.

    Parameters
    ----------
    line : ProfileLine
        What is profiled.
    stride : Stride
        How closely.

    Raises
    ------
    SimulationError
        The best fit itself cannot be simulated.
    FitCancelledError
        The caller asked to stop.
    """
    walk = _Walk(line, stride.budget)
    best = float(getattr(walk.centre.parameters, line.name))
    quantity = line.start.quantity(line.name)
    return _walked(walk, quantity, best, line.error, stride)[line.setting]


def doubtful_profiles(
    one: Linearisation, known: Uncertainty, sharing: Sharing, bench: Bench
) -> tuple[MisfitProfile, ...]:
    """Return short profiles of what the quadratic approximation leaves in doubt at a setting.

    Values at a bound, not identified, or with a standard error of ln y above 0.1; a shared
    R_m3 where it was taken from. Together they may cost 0.7 of what the fit has.
    """
    budget = max(_QUICK_LEAST, int(_QUICK_SHARE * one.fit.evaluations))
    found = []
    # What has failed first: the budget may not reach for all.
    positive = [q.name for q in one.fit.parameters.quantities if q.is_logarithmic]
    names = sorted(positive, key=lambda name: not one.fit.status[name].has_failed)
    for name in names:
        if budget < _QUICK_LEAST // 2 or not is_doubtful(name, one.fit, known):
            continue
        mine, its = {one.fit.setting: one}, {one.fit.setting: known}
        for line in profile_lines(name, mine, its, sharing, bench):
            if sharing.is_mean(name):
                continue  # a mean over settings has no profile in one of them
            profile = trace_profile(line, Stride(_QUICK_STEP, _QUICK_REACH, budget))
            budget -= profile.evaluations
            is_shared = name in sharing.found
            found.append(replace(profile, is_shared=is_shared, is_doubtful=True))
    return tuple(found)


@dataclass(slots=True)
class _JointWalk:
    """The walker over all settings of a joint fit."""

    problem: TiedProblem
    unknown: Unknown
    best: JointSolution
    scale: float
    spent: int = 0
    points: list[tuple[float, float, Mapping[Setting, Values]]] = field(default_factory=list)
    last: JointSolution = field(init=False)
    value: float = field(init=False)

    def __post_init__(self) -> None:
        having = [at for s, at in self.best.parameters.items() if self.unknown.holds_at(s)]
        self.value = float(getattr(having[0], self.unknown.name))
        self.last = self.best
        self.points.append((0.0, 0.0, self.best.parameters))

    def restart(self) -> None:
        self.last = self.best

    def refit(self, along: float) -> float:
        name, starts = self.unknown.name, dict(self.last.parameters)
        for setting, at in starts.items():
            if self.unknown.holds_at(setting):
                held = value_at(at.quantity(name), self.value, along)
                starts[setting] = at.replace({name: held})
        problem = replace(self.problem, gas=self.last.gas, weights=self.best.weights)
        self.last = fit_jointly(problem, starts)
        self.spent += self.last.evaluations
        root = signed_root(self.scale * (self.last.cost - self.best.cost))
        self.points.append((along, root, self.last.parameters))
        return root


def profile_jointly(
    unknown: Unknown,
    linearised: Sequence[Linearisation],
    known: Uncertainty,
    sharing: Sharing,
    bench: Bench,
    *,
    stride: Stride = Stride(),
) -> tuple[MisfitProfile, ...]:
    """Return the profile of a shared parameter of a joint fit, once for every setting that has it.

    The rise is that of all settings together.

    Parameters
    ----------
    unknown : Unknown
        One of ``sharing.unknowns``.
    linearised : sequence of Linearisation
        Of all settings.
    known : Uncertainty
        Of any setting of the joint fit that has it.
    sharing : Sharing
        What was shared.
    bench : Bench
        Damper, solver, cancellation.
    stride : Stride
        How closely.

    Raises
    ------
    SimulationError
        The best fit cannot be simulated.
    FitCancelledError
        The caller asked to stop.
    """
    fits = [
        one.fit
        for one in linearised
        if one.fit.setting in sharing.settings and one.fit.outcome.is_minimum
    ]
    start = {fit.setting: fit.parameters for fit in fits}
    whole = TiedProblem(
        {fit.setting: bench.misfit(fit, sharing.free) for fit in fits},
        sharing.jointly,
        sharing.follows,
        gas=sharing.gas,
        jobs=bench.jobs,
    )
    best = fit_jointly(whole, start)
    held = replace(whole, held=frozenset({unknown}))
    variance = squared_error(known, unknown.name)
    curvature = shared_curvature(linearised, sharing)[sharing.unknowns.index(unknown)]
    walk = _JointWalk(held, unknown, best, curvature / variance)
    quantity = fits[0].parameters.quantity(unknown.name)
    error = math.sqrt(variance) / unit_of(quantity)
    profiles = _walked(walk, quantity, walk.value, error, stride)
    return tuple(profiles[setting] for setting in sorted(profiles) if unknown.holds_at(setting))


def _walked(
    walker: _Walker, quantity: Quantity, best: float, error: float, stride: Stride
) -> dict[Setting, MisfitProfile]:
    """The profile of every setting that a walker sees on both sides; ``error`` is that of u."""
    limits, is_complete = [], True
    for side in (-1.0, 1.0):
        walker.restart()
        limit, is_known = _side(walker, side, stride, error, plausible_edges(quantity, best))
        limits.append(None if limit is None else value_at(quantity, best, limit))
        is_complete &= is_known
    name = quantity.name
    points = sorted(walker.points, key=lambda point: point[0])
    return {
        setting: MisfitProfile(
            setting=setting,
            name=name,
            points=tuple(
                ProfilePoint(float(getattr(at[setting], name)), root * abs(root), at[setting])
                for _, root, at in points
            ),
            low=limits[0],
            high=limits[1],
            is_complete=is_complete,
            evaluations=walker.spent,
        )
        for setting in points[0][2]
    }


def _side(
    walker: _Walker, side: float, stride: Stride, error: float, edges: tuple[float, float]
) -> tuple[float | None, bool]:
    """Walk one side; return where the limit is (None: not reached) and whether that is known."""
    edge, other_edge = edges[side > 0.0], edges[side < 0.0]
    if edge * side <= 0.0:
        return None, True
    along, root, limit = 0.0, 0.0, None
    step = min(stride.step * error, stride.first)
    if other_edge * side > 0.0:  # the fit ran out of the range on the other side: go to its edge
        step = max(step, abs(other_edge))
    try:
        while root < stride.reach and along != edge:
            if walker.spent >= stride.budget:
                return limit, limit is not None
            along = side * min(abs(along) + step, abs(edge))
            found = walker.refit(along)
            if limit is None and found >= NORMAL_95:
                limit = _crossing(walker, side, stride)
            step, root = _next_step(stride, step, root, found), found
    except SimulationError:
        return limit, limit is not None
    return limit, True


def _next_step(stride: Stride, step: float, before: float, found: float) -> float:
    """Aim for the wanted distance in sqrt(rise), a few times as far at most."""
    gained = max(found - before, 1e-3)
    aimed = min(stride.step, max(stride.reach - found, 0.2 * stride.step) * 1.05)
    return min(step * min(max(aimed / gained, 0.2), _LONGEST_GROWTH), _LONGEST_STRIDE)


def _crossing(walker: _Walker, side: float, stride: Stride) -> float:
    """Where sqrt(rise) passes the limit, between the outermost points around it."""
    along, is_near = interpolated_limit([point[:2] for point in walker.points], side)
    for _ in range(_MAX_LOOKS):
        if is_near or walker.spent >= stride.budget:
            break
        walker.refit(along)
        along, is_near = interpolated_limit([point[:2] for point in walker.points], side)
    return along
