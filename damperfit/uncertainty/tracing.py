r"""A setting's misfit along one parameter, the others refitted by predictor and corrector.

A point costs one or two simulations: the others follow their tangent (H_oo^-1 H_op), one
Gauss-Newton step corrects them, and the next point starts there.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from damperfit.identification.descent import Misfit, linearise, stepped
from damperfit.identification.plausible import is_at_edge
from damperfit.uncertainty.profiles import MisfitProfile, Stride, signed_root, walked

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from damperfit.damper.parameters import Parameters

    FloatArray = NDArray[np.float64]

__all__ = ["Line", "trace_profile"]

# What one more Gauss-Newton step of the others would take from the rise.
_SETTLED = 0.02
_MAX_STEPS = 8
_MAX_HALVINGS = 4
# Parameters are changed by a factor of two at most in one step of the others.
_LONGEST_STEP = 0.7


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
        # From the edge of its range the profiled one would leave it.
        is_stuck = is_at_edge(self.line.start, self.line.name)
        every = np.arange(len(self.line.misfit.free), dtype=np.intp)
        self.centre, self.least = self._settled(start, self._others if is_stuck else every)
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
