r"""Profile likelihood: one parameter along a line, the others refitted at every point.

With S the sum of squared residuals, least over all other parameters, and u = ln y::

    rise(u) = L (S(u) - S_min),      L = (H^-1)_uu / var(u)

In the quadratic approximation rise = (u/se)^2, so that with the printed variance of u (correlation
of the residuals and shared parameters allowed for, see `intervals`) a rise of 1.96^2 is the 95 %
limit. White-noise scaling, L = 1/s^2, would set the limits three times too near.

sqrt(rise) runs nearly straight, so that few points do and a limit is interpolated in it. Here is
how a line is walked; `tracing` and `joint_profiles` refit the others.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from damperfit.errors import SimulationError
from damperfit.identification.plausible import PLAUSIBLE
from damperfit.identification.setting import NORMAL_95

if TYPE_CHECKING:
    from collections.abc import Mapping

    from damperfit.damper.parameters import Parameters

__all__ = [
    "OFFSET_UNIT",
    "MisfitProfile",
    "ProfilePoint",
    "Stride",
    "Walker",
    "signed_root",
    "walked",
]

_MAX_LOOKS = 3
# The first step on a line goes by a factor of two at most.
_FIRST_STRIDE = 0.7
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
    step = min(stride.step * error, _FIRST_STRIDE)
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
    after = next(k for k, p in enumerate(mine) if p[1] >= NORMAL_95)
    (near, low, _), (far, high, _) = mine[after - 1], mine[after]
    share = (NORMAL_95 - low) / max(high - low, 1e-12)
    grown = math.expm1(min(abs(far - near), 30.0)) * share
    is_near = high - low < _NARROW or high - NORMAL_95 < _NEAR or NORMAL_95 - low < _NEAR / 2
    return near + side * math.log1p(grown), is_near


def _edges(name: str, best: float) -> tuple[float, float]:
    """Where the plausible range ends on both sides, in u from the best value."""
    if name == "f_0":
        return -_OFFSET_EDGE, _OFFSET_EDGE
    low, high = PLAUSIBLE[name]
    return math.log(low / best), math.log(high / best)


def _moved_value(name: str, best: float, along: float) -> float:
    return best + OFFSET_UNIT * along if name == "f_0" else best * math.exp(along)
