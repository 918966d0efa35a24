r"""Profile likelihood: one parameter along a line, the others refitted at every point.

With S the sum of squared residuals, least over all other parameters, and u = ln y::

    rise(u) = L (S(u) - S_min),      L = (H^-1)_uu / var(u)

In the quadratic approximation rise = (u/se)^2, so that with the printed variance of u (correlation
of the residuals and shared parameters allowed for, see `intervals`) a rise of 1.96^2 is the 95 %
limit. White-noise scaling, L = 1/s^2, would set the limits three times too near.

A point costs one or two simulations: the others follow their tangent (H_oo^-1 H_op), one
Gauss-Newton step corrects them, and the next point starts there. sqrt(rise) runs nearly straight,
so that a limit is interpolated in it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from damperfit.errors import SimulationError
from damperfit.identification.descent import Misfit, linearise, stepped
from damperfit.identification.setting import PLAUSIBLE

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from damperfit.damper.parameters import Parameters

    FloatArray = NDArray[np.float64]

__all__ = ["ROOT_LIMIT", "Line", "Profile", "ProfilePoint", "Stride", "trace_profile"]

# 95 % of a normal distribution lie within so many standard errors.
ROOT_LIMIT = 1.959964
# What one more Gauss-Newton step of the others would take from the rise.
_SETTLED = 0.02
_MAX_STEPS = 8
# Parameters are changed by a factor of two at most in one step of the others.
_LONGEST_STEP = 0.7
# The line itself may go by a factor of ten where nothing happens.
_LONGEST_STRIDE = 2.3
# A rise this far below zero is another, better minimum.
_BETTER = -0.5
# A limit is interpolated between points this near to each other in sqrt(rise), or to a point this
# near to it: sqrt(rise) is then straight enough for a per cent.
_NARROW = 0.8
_NEAR = 0.25


@dataclass(frozen=True, slots=True)
class ProfilePoint:
    """One point of a profile.

    Attributes
    ----------
    value : float
        Of the profiled parameter, SI.
    rise : float
        Rise of the misfit above its minimum in units in which 1.96^2 is the 95 % limit.
    parameters : Parameters
        All parameters there, the free ones refitted.
    """

    value: float
    rise: float
    parameters: Parameters


@dataclass(frozen=True, slots=True)
class Profile:
    """How the misfit rises along one parameter.

    Attributes
    ----------
    setting : int
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
    """

    setting: int
    name: str
    points: tuple[ProfilePoint, ...]
    low: float | None
    high: float | None
    is_complete: bool
    evaluations: int

    @property
    def shape(self) -> str:
        """closed, flat upward, flat downward, flat both ways, or not finished."""
        if not self.is_complete:
            return "not finished"
        if self.low is not None:
            return "closed" if self.high is not None else "flat upward"
        return "flat downward" if self.high is not None else "flat both ways"

    @property
    def better(self) -> ProfilePoint | None:
        """The lowest point when it is clearly below the fit: the fit is not the best minimum."""
        lowest = min(self.points, key=lambda point: point.rise)
        return lowest if lowest.rise < _BETTER else None


@dataclass(frozen=True, slots=True)
class Line:
    """What is profiled: where, by which scale.

    Attributes
    ----------
    setting : int
        Setting.
    name : str
        Parameter; one of the misfit's free ones.
    misfit : Misfit
        Logs, damper, and what is free, the parameter among it.
    start : Parameters
        The best fit.
    scale : float
        L of the module's docstring, 1/N^2.
    error : float
        Standard error of u as printed; where nothing is known, infinity.
    """

    setting: int
    name: str
    misfit: Misfit
    start: Parameters
    scale: float
    error: float


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
    """

    step: float = 0.5
    reach: float = 3.0
    budget: int = 400


@dataclass(slots=True)
class _State:
    """A point with what is needed to go on from it, in the variables of `linearise`."""

    parameters: Parameters
    along: float
    cost: float
    slope: FloatArray
    information: FloatArray


@dataclass(slots=True)
class _Walk:
    """One profile while it is being traced."""

    line: Line
    stride: Stride
    least: float = 0.0
    spent: int = 0
    points: list[tuple[float, float, Parameters]] = field(default_factory=list)

    @property
    def place(self) -> int:
        return self.line.misfit.free.index(self.line.name)

    def at(self, parameters: Parameters, along: float) -> _State:
        self.spent += 1
        residuals, jacobian = linearise(self.line.misfit, parameters)
        return _State(
            parameters,
            along,
            float(residuals @ residuals),
            -(jacobian.T @ residuals),
            jacobian.T @ jacobian,
        )

    def settled(self, state: _State, moving: NDArray[np.intp]) -> tuple[_State, float]:
        """Refit the moving ones; returns the state and the least cost that is promised there."""
        for _ in range(_MAX_STEPS):
            step, gain = _newton(state, moving)
            if gain * self.line.scale < _SETTLED or self.spent >= self.stride.budget:
                return state, state.cost - gain
            length = float(np.max(np.abs(step)))
            step *= min(1.0, _LONGEST_STEP / length)
            for _ in range(4):
                found = self.at(
                    stepped(self.line.misfit, state.parameters, step),
                    state.along + float(step[self.place]),
                )
                if found.cost < state.cost:
                    break
                step = 0.5 * step
            else:
                return state, state.cost
            state = found
        return state, state.cost

    def moved(self, state: _State, along: float) -> _State:
        """Go along the line, the others along their tangent."""
        shift = np.zeros(len(self.line.misfit.free))
        shift[self.place] = along - state.along
        others = _others(self)
        pull = state.slope[others] - state.information[others, self.place] * shift[self.place]
        change = _solve(state.information[np.ix_(others, others)], pull)
        length = float(np.max(np.abs(change), initial=0.0))
        shift[others] = change * min(1.0, 2.0 * _LONGEST_STEP / max(length, 1e-300))
        return self.at(stepped(self.line.misfit, state.parameters, shift), along)

    def root(self, cost: float) -> float:
        """Signed square root of the rise."""
        rise = self.line.scale * (cost - self.least)
        return math.copysign(math.sqrt(abs(rise)), rise)


def trace_profile(line: Line, stride: Stride = Stride()) -> Profile:
    """Follow the misfit along one parameter to both sides of its best value.

    Parameters
    ----------
    line : Line
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
    walk = _Walk(line, stride)
    centre, walk.least = walk.settled(
        walk.at(line.start, 0.0), np.arange(len(line.misfit.free), dtype=np.intp)
    )
    centre.along = 0.0
    walk.points.append((0.0, 0.0, centre.parameters))
    limits, is_complete = [], True
    for side in (-1.0, 1.0):
        limit, is_done = _side(walk, centre, side)
        limits.append(None if limit is None else _value(line, centre.parameters, limit))
        is_complete &= is_done
    walk.points.sort(key=lambda point: point[0])
    return Profile(
        setting=line.setting,
        name=line.name,
        points=tuple(
            ProfilePoint(float(getattr(parameters, line.name)), root * abs(root), parameters)
            for _, root, parameters in walk.points
        ),
        low=limits[0],
        high=limits[1],
        is_complete=is_complete,
        evaluations=walk.spent,
    )


def _side(walk: _Walk, centre: _State, side: float) -> tuple[float | None, bool]:
    """Walk one side; return where the limit is (None: not reached) and whether that is known."""
    edge = _edge(walk.line, centre.parameters, side)
    if edge * side <= 0.0:
        return None, True
    state, root, limit = centre, 0.0, None
    step = min(walk.stride.step * walk.line.error, _LONGEST_STEP)
    lowest = _edge(walk.line, centre.parameters, -side)
    if lowest * side > 0.0:  # the fit ran out of the range on the other side: begin at its edge
        step = max(step, abs(lowest))
    try:
        while root < walk.stride.reach:
            if walk.spent >= walk.stride.budget:
                return limit, limit is not None
            along = side * min(abs(state.along) + step, abs(edge))
            state, cost = walk.settled(walk.moved(state, along), _others(walk))
            found = walk.root(cost)
            walk.points.append((along, found, state.parameters))
            if limit is None and found >= ROOT_LIMIT:
                limit = _crossing(walk, state, side)
            if along == edge:
                break
            step = _next_step(walk.stride, step, root, found)
            root = found
    except SimulationError:
        return limit, limit is not None
    return limit, True


def _next_step(stride: Stride, step: float, before: float, found: float) -> float:
    """Aim for the wanted distance in sqrt(rise), twice as far at most."""
    gained = max(found - before, 1e-3)
    aimed = min(stride.step, max(stride.reach - found, 0.2 * stride.step) * 1.05)
    return min(step * min(max(aimed / gained, 0.2), 2.0), _LONGEST_STRIDE)


def _crossing(walk: _Walk, state: _State, side: float) -> float:
    """Where sqrt(rise) passes the limit, between the outermost points around it."""
    along, is_near = _interpolated(walk, side)
    if not is_near and walk.spent < walk.stride.budget:
        middle, cost = walk.settled(walk.moved(state, along), _others(walk))
        walk.points.append((along, walk.root(cost), middle.parameters))
        along, _ = _interpolated(walk, side)
    return along


def _interpolated(walk: _Walk, side: float) -> tuple[float, bool]:
    """The limit between the points around it, and whether they are near enough."""
    mine = sorted((p for p in walk.points if p[0] * side >= 0.0), key=lambda p: abs(p[0]))
    after = next(k for k, p in enumerate(mine) if p[1] >= ROOT_LIMIT)
    (near, low, _), (far, high, _) = mine[after - 1], mine[after]
    share = (ROOT_LIMIT - low) / max(high - low, 1e-12)
    return near + (far - near) * share, high - low < _NARROW or high - ROOT_LIMIT < _NEAR


def _others(walk: _Walk) -> NDArray[np.intp]:
    places = range(len(walk.line.misfit.free))
    return np.array([k for k in places if k != walk.place], dtype=np.intp)


def _newton(state: _State, moving: NDArray[np.intp]) -> tuple[FloatArray, float]:
    """The Gauss-Newton step of the moving parameters and what it promises."""
    step = np.zeros(len(state.slope))
    slope = state.slope[moving]
    step[moving] = _solve(state.information[np.ix_(moving, moving)], slope)
    return step, float(slope @ step[moving])


def _solve(matrix: FloatArray, right: FloatArray) -> FloatArray:
    """Solve with unit diagonal; the shortest solution where the matrix is singular."""
    if not len(right):
        return np.zeros(0)
    scale = 1.0 / np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    scaled = matrix * np.outer(scale, scale)
    return np.asarray(scale * np.linalg.lstsq(scaled, scale * right, rcond=1e-12)[0])


def _edge(line: Line, centre: Parameters, side: float) -> float:
    """Where the plausible range ends on a side, in u from the centre."""
    if line.name == "f_0":
        return side * 1e2  # 100 times 100 N
    bounds = PLAUSIBLE[line.name]
    return math.log(bounds[side > 0.0] / getattr(centre, line.name))


def _value(line: Line, centre: Parameters, along: float) -> float:
    shift = np.zeros(len(line.misfit.free))
    shift[line.misfit.free.index(line.name)] = along
    return float(getattr(stepped(line.misfit, centre, shift), line.name))
