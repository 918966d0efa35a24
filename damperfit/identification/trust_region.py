"""Levenberg-Marquardt for least squares: the one loop of all fits.

It knows nothing of dampers: a model gives residuals with their Jacobian as a `LinearSystem`, which
solves for the steps. The trust region is MINPACK's, scaled by the lengths of the Jacobian's columns
(J. J. More, "The Levenberg-Marquardt algorithm: implementation and theory", 1978): the fit of one
setting (`descent`), of all together (`joint_fit`) and of what a profile leaves free
(`damperfit.uncertainty.profile_walk`) differ in their stopping rules and in their system alone.
Run over the nonlinear regression problems of NIST by ``python -m tests.certificate``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Generic, TypeVar

import numpy as np

from damperfit.errors import SimulationError
from damperfit.identification.step_solvers import NO_LENGTH
from damperfit.statistics import largest_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from damperfit.identification.step_solvers import LinearSystem, Step, StepSolver

    FloatArray = NDArray[np.float64]

__all__ = ["Ended", "Stopping", "iterate"]

# A cosine between residuals and Jacobian that is zero to the last digits.
_RIGHT_ANGLE = 1e-12
# MINPACK's numbers: the first trust region, how near to it a step must end, within how many trials
# of lambda, the least share of the fall foreseen that takes a step, and a sum of squares so much
# higher that nothing is read off it. A point that the model cannot be evaluated at counts as that.
_FIRST_RADIUS = 100.0
_NEAR = 0.1
_MAX_TRIALS = 10
_LEAST_RATIO = 1e-4
_TOO_HIGH = 100.0
_DWARF = float(np.finfo(np.float64).tiny)
_LAST_BIT = float(np.finfo(np.float64).eps)
# How a descent ended, as `scipy.optimize.least_squares` has it.
_LIMIT, _MET_GRADIENT, _MET_COST, _MET_STEP, _MET_BOTH = 0, 1, 2, 3, 4

Extra = TypeVar("Extra")


@dataclass(frozen=True, slots=True)
class Stopping:
    """When a descent ends, and how far it may go at once.

    Attributes
    ----------
    cost_tolerance : float
        Relative fall of the sum of squares, found and foreseen, below which it has.
    step_tolerance : float
        Likewise for the relative size of the steps.
    max_evaluations : int
        Limit of evaluations.
    rest : float
        Relative length of the full step that may be left when the cost has ceased to fall: where
        the steps become shorter slowly, the descent goes on; infinity asks for nothing. A damper's
        descents end below 2e-9 by themselves (61 of the sample runs).
    least_gain : float
        Fall of the sum of squares that a full step must promise to be tried at all.
    least_share : float
        The same as a share of the sum of squares.
    longest_step : float
        Largest change of a variable in one step.
    near : float
        Largest change of a variable in a full step that is left to the caller to take unseen.
    """

    cost_tolerance: float = 1e-8
    step_tolerance: float = 1e-9
    max_evaluations: int = 100
    rest: float = 1e-8
    least_gain: float = 0.0
    least_share: float = 0.0
    longest_step: float = math.inf
    near: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Ended(Generic[Extra]):
    """Where `iterate` ended.

    Attributes
    ----------
    variables : numpy.ndarray
        Shape (k,), u of the best point found.
    system : LinearSystem
        Residuals and Jacobian there.
    extra : object
        What the model remembered of it.
    evaluations, failed_trials, status : int
        As of `Minimum`.
    """

    variables: FloatArray
    system: LinearSystem
    extra: Extra
    evaluations: int
    failed_trials: int
    status: int


def iterate(
    point_at: Callable[[FloatArray], tuple[LinearSystem, Extra]],
    start: FloatArray,
    stopping: Stopping,
) -> Ended[Extra]:
    """Minimise a sum of squares in the variables u themselves; the loop behind every fit.

    Parameters
    ----------
    point_at : callable
        From u, shape (k,), to residuals with Jacobian as a `LinearSystem`, and anything to be
        remembered. It raises `SimulationError` where the model cannot be evaluated.
    start : numpy.ndarray
        Shape (k,), u.
    stopping : Stopping
        When to end.

    Raises
    ------
    SimulationError
        When the model cannot be evaluated at the start.
    """
    course = _Course(point_at, start, stopping)
    if not len(start):
        return course.ended(_MET_GRADIENT)
    while True:
        status = course.turned()
        if status is None:
            status = course.advanced()
        if status is not None:
            return course.ended(status)


class _Course(Generic[Extra]):
    """Where a descent is: MINPACK's lmder, step by step, with a `StepSolver` in place of its QR."""

    def __init__(
        self,
        point_at: Callable[[FloatArray], tuple[LinearSystem, Extra]],
        start: FloatArray,
        stopping: Stopping,
    ) -> None:
        self.point_at = point_at
        self.stopping = stopping
        self.evaluations, self.failed_trials = 1, 0
        self.variables = start
        self.system, self.extra = point_at(start)
        # The least sum of squares seen, also where the fall was too small for a step.
        self.best = (self.system, self.extra, start)
        self.scale = np.where(self.system.lengths > NO_LENGTH, self.system.lengths, 1.0)
        self.radius = self.damping = 0.0
        self.is_first = True
        self.is_ending = False
        self.steps = self.system.scaled(self.scale)

    def ended(self, status: int) -> Ended[Extra]:
        system, extra, variables = self.best
        return Ended(variables, system, extra, self.evaluations, self.failed_trials, status)

    @property
    def size(self) -> float:
        """Length of u in the units of the trust region."""
        return _length(self.scale * self.variables)

    def turned(self) -> int | None:
        """Look around at a new point; returns a status where it is the last."""
        system, stopping = self.system, self.stopping
        if _cosine(system) <= _RIGHT_ANGLE:
            return _MET_GRADIENT
        scale = np.maximum(self.scale, system.lengths)
        if not self.is_first or (scale != self.scale).any():
            self.scale = scale
            self.steps = system.scaled(scale)
        if self.is_first:
            self.radius = _FIRST_RADIUS * self.size or _FIRST_RADIUS
        least = max(stopping.least_gain, stopping.least_share * system.cost)
        if least > 0.0 or stopping.near > 0.0 or self.is_ending:
            full = self.steps.step(0.0)
            if full.effect < least or largest_of(full.change) < stopping.near:
                return _MET_COST
            if self.is_ending and full.length <= stopping.rest * self.size:
                return _MET_COST
        return None

    def advanced(self) -> int | None:
        """Try steps until one is taken; returns a status where the descent ends."""
        stopping, cost = self.stopping, self.system.cost
        while self.evaluations < stopping.max_evaluations:
            pull = _length(self.system.gradient / self.scale)
            self.damping, step = _damped(self.steps, pull, self.radius, self.damping)
            share = min(1.0, stopping.longest_step / max(largest_of(step.change), 1e-300))
            length = share * step.length
            if self.is_first:
                self.radius = min(self.radius, length)
            trial = self.variables + share * step.change
            found = self.tried(trial)
            # Where there is no model, a wall of finite height: the region shrinks by a rule.
            is_far = found is None or found[0].cost >= _TOO_HIGH * cost
            fall = -1.0 if found is None or is_far else 1.0 - found[0].cost / cost
            slope = step.effect + self.damping * step.length**2
            foreseen = share * (2.0 * slope - share * step.effect) / cost
            ratio = fall / foreseen if foreseen > 0.0 else 0.0
            self.adapt(ratio, 0.1 if is_far else _shrunk(fall, share * slope / cost), length)
            is_taken = found is not None and ratio >= _LEAST_RATIO
            if is_taken and found is not None:
                self.system, self.extra = found
                self.variables, self.is_first = trial, False
            status = self.met(fall, foreseen, ratio)
            if status == _MET_COST and stopping.rest < math.inf and is_taken:
                self.is_ending, status = True, None
            elif self.is_ending and not is_taken:
                status = _MET_COST
            if status is not None or is_taken:
                return status
        return _LIMIT

    def tried(self, variables: FloatArray) -> tuple[LinearSystem, Extra] | None:
        """Evaluate a trial; None where the model cannot be."""
        self.evaluations += 1
        try:
            system, extra = self.point_at(variables)
        except SimulationError:
            self.failed_trials += 1
            return None
        if system.cost < self.best[0].cost:
            self.best = (system, extra, variables)
        return system, extra

    def adapt(self, ratio: float, factor: float, length: float) -> None:
        """Make the trust region smaller or larger, as the trial has met what was foreseen."""
        if ratio <= 0.25:
            self.radius = factor * min(self.radius, length / 0.1)
            self.damping /= factor
        elif self.damping == 0.0 or ratio >= 0.75:
            self.radius = 2.0 * length
            self.damping *= 0.5

    def met(self, fall: float, foreseen: float, ratio: float) -> int | None:
        """Which of MINPACK's tests are met."""
        tolerance = self.stopping.cost_tolerance
        is_flat = abs(fall) <= tolerance and foreseen <= tolerance and ratio <= 2.0
        is_short = self.radius <= self.stopping.step_tolerance * self.size
        if is_flat or is_short:
            return _MET_BOTH if is_flat and is_short else _MET_COST if is_flat else _MET_STEP
        if abs(fall) <= _LAST_BIT and foreseen <= _LAST_BIT and ratio <= 2.0:
            return _MET_COST
        return _MET_STEP if self.radius <= _LAST_BIT * self.size else None


def _length(vector: FloatArray) -> float:
    """Length of a few numbers; NumPy's norm takes as long again to find out what they are."""
    return math.sqrt(float(vector @ vector))


def _shrunk(fall: float, slope: float) -> float:
    """Factor for a trust region that was too large: where a parabola has its minimum."""
    return 0.5 if fall >= 0.0 else max(0.5 * slope / (slope - 0.5 * fall), 0.1)


def _cosine(system: LinearSystem) -> float:
    """Largest cosine between the residuals and a column of the Jacobian."""
    lengths = np.maximum(system.lengths, 1e-300) * math.sqrt(system.cost)
    return largest_of(system.gradient / np.maximum(lengths, 1e-300))


def _damped(steps: StepSolver, slope: float, radius: float, damping: float) -> tuple[float, Step]:
    """Return lambda and the step that is as long as the radius within a tenth (lmpar).

    ``slope`` is the length of the scaled gradient, D^-1 J^T r; ``damping`` the lambda before.
    """
    step = steps.step(0.0)
    excess = step.length - radius
    if excess <= _NEAR * radius:
        return 0.0, step
    low = excess / radius / step.shrinkage if steps.is_full_rank else 0.0
    high = slope / radius or _DWARF / min(radius, 0.1)
    damping = min(max(damping, low), high) or slope / step.length
    for trial in range(1, _MAX_TRIALS + 1):
        damping = damping or max(_DWARF, 1e-3 * high)
        step, before = steps.step(damping), excess
        excess = step.length - radius
        is_falling = low == 0.0 and excess <= before < 0.0
        if abs(excess) <= _NEAR * radius or is_falling or trial == _MAX_TRIALS:
            break
        if excess > 0.0:
            low = max(low, damping)
        else:
            high = min(high, damping)
        damping = max(low, damping + excess / radius / step.shrinkage)
    return damping, step
