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
from typing import TYPE_CHECKING, Protocol

import numpy as np

from damperfit.errors import SimulationError
from damperfit.identification.descent import Misfit, linearise, stepped
from damperfit.identification.setting import PLAUSIBLE

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from damperfit.damper.parameters import Parameters

    FloatArray = NDArray[np.float64]

__all__ = [
    "OFFSET_UNIT",
    "ROOT_LIMIT",
    "Line",
    "MisfitProfile",
    "ProfilePoint",
    "Stride",
    "Walker",
    "signed_root",
    "trace_profile",
    "walked",
]

# 95 % of a normal distribution lie within so many standard errors.
ROOT_LIMIT = 1.959964
# What one more Gauss-Newton step of the others would take from the rise.
_SETTLED = 0.02
_MAX_STEPS = 8
_MAX_HALVINGS = 4
_MAX_LOOKS = 3
# Parameters are changed by a factor of two at most in one step of the others.
_LONGEST_STEP = 0.7
# The line itself may go by a factor of ten where nothing happens.
_LONGEST_STRIDE = 2.3
_LONGEST_GROWTH = 3.0
# `linearise` counts f_0 in units of 100 N; it is followed to 10 kN.
OFFSET_UNIT = 100.0
_OFFSET_EDGE = 100.0
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
class MisfitProfile:
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
    is_shared : bool
        Of a parameter that is common to all settings.
    is_partial : bool
        Of what one setting says of a parameter that is a mean over the settings: its limits are
        not those of the mean.
    is_doubtful : bool
        Whether its limits stand for those of the quadratic approximation.
    """

    setting: int
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


class Walker(Protocol):
    """Something that can be refitted with one parameter held at a place along its line."""

    points: list[tuple[float, float, Mapping[int, Parameters]]]
    spent: int

    def refit(self, along: float) -> float:
        """Refit, going on from the place before; note the point, return its sqrt(rise)."""

    def restart(self) -> None:
        """Go back to the best fit."""


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
    """The walker of one setting."""

    line: Line
    budget: int
    least: float = 0.0
    spent: int = 0
    points: list[tuple[float, float, Mapping[int, Parameters]]] = field(default_factory=list)
    state: _State = field(init=False)
    centre: _State = field(init=False)

    def __post_init__(self) -> None:
        start = self._at(self.line.start, 0.0)
        every = np.arange(len(self.line.misfit.free), dtype=np.intp)
        self.centre, self.least = self._settled(start, every)
        self.centre.along = 0.0
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

    def _at(self, parameters: Parameters, along: float) -> _State:
        self.spent += 1
        residuals, jacobian = linearise(self.line.misfit, parameters)
        return _State(
            parameters,
            along,
            float(residuals @ residuals),
            -(jacobian.T @ residuals),
            jacobian.T @ jacobian,
        )

    def _settled(self, state: _State, moving: NDArray[np.intp]) -> tuple[_State, float]:
        """Refit the moving ones; returns the state and the least cost that is promised there."""
        for _ in range(_MAX_STEPS):
            step, gain = _newton(state, moving)
            if gain * self.line.scale < _SETTLED or self.spent >= self.budget:
                return state, state.cost - gain
            step *= min(1.0, _LONGEST_STEP / float(np.max(np.abs(step))))
            for _ in range(_MAX_HALVINGS):
                found = self._at(
                    stepped(self.line.misfit, state.parameters, step),
                    state.along + float(step[self._place]),
                )
                if found.cost < state.cost:
                    break
                step = 0.5 * step
            else:
                return state, state.cost
            state = found
        return state, state.cost

    def _moved(self, along: float) -> _State:
        """Go along the line, the others along their tangent."""
        state, others = self.state, self._others
        shift = np.zeros(len(self.line.misfit.free))
        shift[self._place] = along - state.along
        pull = state.slope[others] - state.information[others, self._place] * shift[self._place]
        change = _solve(state.information[np.ix_(others, others)], pull)
        length = float(np.max(np.abs(change), initial=0.0))
        shift[others] = change * min(1.0, 2.0 * _LONGEST_STEP / max(length, 1e-300))
        return self._at(stepped(self.line.misfit, state.parameters, shift), along)


def trace_profile(line: Line, stride: Stride = Stride()) -> MisfitProfile:
    """Follow the misfit of a setting along one parameter to both sides of its best value.

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
    walk = _Walk(line, stride.budget)
    best = float(getattr(walk.centre.parameters, line.name))
    return walked(walk, line.name, best, line.error, stride)[line.setting]


def walked(
    walker: Walker, name: str, best: float, error: float, stride: Stride
) -> dict[int, MisfitProfile]:
    """Return the profile of every setting that a walker sees, walking both sides of its start.

    Parameters
    ----------
    walker : Walker
        At the best fit, which is its first point.
    name : str
        Parameter.
    best : float
        Its best value, SI.
    error : float
        Standard error of its u.
    stride : Stride
        How closely.
    """
    limits, is_complete = [], True
    for side in (-1.0, 1.0):
        walker.restart()
        limit, is_known = _side(walker, side, stride, error, _edges(name, best))
        limits.append(None if limit is None else _moved_value(name, best, limit))
        is_complete &= is_known
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


def signed_root(rise: float) -> float:
    """Return the square root of a rise, with its sign."""
    return math.copysign(math.sqrt(abs(rise)), rise)


def _side(
    walker: Walker, side: float, stride: Stride, error: float, edges: tuple[float, float]
) -> tuple[float | None, bool]:
    """Walk one side; return where the limit is (None: not reached) and whether that is known."""
    edge, other_edge = edges[side > 0.0], edges[side < 0.0]
    if edge * side <= 0.0:
        return None, True
    along, root, limit = 0.0, 0.0, None
    step = min(stride.step * error, _LONGEST_STEP)
    if other_edge * side > 0.0:  # the fit ran out of the range on the other side: go to its edge
        step = max(step, abs(other_edge))
    try:
        while root < stride.reach and along != edge:
            if walker.spent >= stride.budget:
                return limit, limit is not None
            along = side * min(abs(along) + step, abs(edge))
            found = walker.refit(along)
            if limit is None and found >= ROOT_LIMIT:
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


def _crossing(walker: Walker, side: float, stride: Stride) -> float:
    """Where sqrt(rise) passes the limit, between the outermost points around it."""
    along, is_near = _interpolated(walker, side)
    for _ in range(_MAX_LOOKS):
        if is_near or walker.spent >= stride.budget:
            break
        walker.refit(along)
        along, is_near = _interpolated(walker, side)
    return along


def _interpolated(walker: Walker, side: float) -> tuple[float, bool]:
    """The limit between the points around it, and whether they are near enough.

    On the scale that grows outwards, y upwards and 1/y downwards: where the misfit is flat and then
    steep, its root is straight in that; near the best value it makes no difference.
    """
    mine = sorted((p for p in walker.points if p[0] * side >= 0.0), key=lambda p: abs(p[0]))
    after = next(k for k, p in enumerate(mine) if p[1] >= ROOT_LIMIT)
    (near, low, _), (far, high, _) = mine[after - 1], mine[after]
    share = (ROOT_LIMIT - low) / max(high - low, 1e-12)
    grown = math.expm1(min(abs(far - near), 30.0)) * share
    is_near = high - low < _NARROW or high - ROOT_LIMIT < _NEAR or ROOT_LIMIT - low < _NEAR / 2
    return near + side * math.log1p(grown), is_near


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


def _edges(name: str, best: float) -> tuple[float, float]:
    """Where the plausible range ends on both sides, in u from the best value."""
    if name == "f_0":
        return -_OFFSET_EDGE, _OFFSET_EDGE
    low, high = PLAUSIBLE[name]
    return math.log(low / best), math.log(high / best)


def _moved_value(name: str, best: float, along: float) -> float:
    return best + OFFSET_UNIT * along if name == "f_0" else best * math.exp(along)
