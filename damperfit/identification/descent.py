"""The misfit of the logs of one setting and its descent, on log parameters, exact Jacobian.

The variables are u = ln y for the positive parameters and u = y/scale for an offset, so that a
step is a relative change and no positive parameter can change sign. The residual is
(f_hat - f)/(sigma sqrt(N)), f_hat filtered like f: its squared norm is eq. (22) over 100.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from damperfit.conditioning import apply_filter
from damperfit.errors import DamperfitError, SimulationError
from damperfit.identification.minimiser import Minimum, Transformation, minimise
from damperfit.identification.plausible import (
    first_edge,
    is_at_edge,
    is_within,
    kept_within,
    points_inside,
)
from damperfit.identification.trust_region import Stopping
from damperfit.identification.weights import weights
from damperfit.simulation import SolverOptions, motion_of, simulate

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from damperfit.damper.model import Model, Values
    from damperfit.recording import Trace
    from damperfit.simulation import Response

    FloatArray = NDArray[np.float64]

__all__ = [
    "RIGHT_ANGLE",
    "FitCancelledError",
    "Misfit",
    "Solution",
    "approach",
    "common_variables",
    "descend",
    "linearise",
]

# A relative change of the sum of squares below 1e-8 moves no parameter by 1 % of its error; a
# start for another descent needs no more than a per cent.
_FINE = Stopping(cost_tolerance=1e-8)
_ROUGH = Stopping(cost_tolerance=1e-2, rest=math.inf)
# A fit that meets none of MINPACK's tests has still descended when the residual is this close to
# a right angle with every direction of the Jacobian.
RIGHT_ANGLE = 1e-3
# Where the misfit has kinks a descent may stop among them, at so many times the cosine that the
# promised fall would have.
_AMONG_KINKS = 1.5
# Below this misfit (times the solver's tolerance, N) the solver's own error is what is left.
_POLISH_BELOW = 100.0
_POLISH_FACTOR = 0.003
# A force or a sensitivity, SI; a cylinder of the size of a car stays far below.
_WILD = 1e100


class FitCancelledError(DamperfitError):
    """The caller asked to stop while a fit was running."""

    exit_code = 130


@dataclass(frozen=True, slots=True, eq=False)
class Misfit:
    """What is fitted: the logs of one setting, the damper, and what is free.

    Attributes
    ----------
    traces : tuple of Trace
        Logs of one setting.
    damper : Model
        The damper's model.
    free : tuple of str
        Values that may move.
    solver : SolverOptions
        How exactly to integrate.
    max_evaluations : int
        Limit of simulations.
    cancelled : callable
        Asked before each evaluation.
    """

    traces: tuple[Trace, ...]
    damper: Model
    free: tuple[str, ...]
    solver: SolverOptions
    max_evaluations: int
    cancelled: Callable[[], bool]

    @property
    def deviation(self) -> float:
        """Standard deviation of all measured forces that are compared, N."""
        return float(np.std(np.concatenate([t.force[t.compared] for t in self.traces])))

    @property
    def right_angle(self) -> float:
        """Largest cosine between residuals and Jacobian at the end of a descent."""
        return max(RIGHT_ANGLE, _AMONG_KINKS * math.sqrt(self.damper.kinks))

    @property
    def n_samples(self) -> int:
        """Samples compared."""
        return sum(trace.n_samples for trace in self.traces)


@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """Where a descent ended.

    Attributes
    ----------
    parameters : Values
        Best point found.
    mse_percent : float
        Eq. (22) there, each stretch with its weight.
    jacobian : numpy.ndarray
        Shape (n, k): derivative of the residuals by u, in the order of the free parameters.
    evaluations, failed_trials : int
        Simulations of the whole setting, and those that could not be integrated.
    status : int
        MINPACK's ending as `scipy.optimize.least_squares` gives it: 0 is the limit, 1-4 tests met.
    gradient_cosine : float
        Largest cosine between the residuals and a column of the Jacobian.
    n_independent : float
        Independent samples among the residuals: twice their sign changes. White residuals change
        sign at every other sample; those behind a low-pass of B Hz 1.15 B times a second, where
        2 B samples a second are independent.
    is_cavitating : bool
        Whether a chamber is at zero pressure somewhere in what is compared.
    """

    parameters: Values
    mse_percent: float
    jacobian: FloatArray
    evaluations: int
    failed_trials: int
    status: int
    gradient_cosine: float
    n_independent: float
    is_cavitating: bool


def approach(misfit: Misfit, start: Values) -> Solution:
    """Minimise the misfit of one log roughly, for the start of a descent with all of them.

    Of several logs the one with the strongest force is taken: it tells the valves best.

    Raises
    ------
    SimulationError
        When the model cannot be integrated at the start.
    FitCancelledError
        When the caller asked to stop.
    """
    strongest = max(misfit.traces, key=lambda trace: float(np.std(trace.force[trace.compared])))
    rough = replace(misfit, traces=(strongest,))
    return _descended(rough, misfit.free, start, _ROUGH).solution


def descend(misfit: Misfit, start: Values) -> Solution:
    """Minimise the misfit from a start; refine with a tighter integrator if that is what is left.

    Raises
    ------
    SimulationError
        When the model cannot be integrated at the start.
    FitCancelledError
        When the caller asked to stop.
    """
    solution = _minimise(misfit, start)
    rms = math.sqrt(solution.mse_percent / 100.0) * misfit.deviation
    if rms > _POLISH_BELOW * misfit.solver.tolerance:
        return solution
    tighter = replace(misfit.solver, tolerance=_POLISH_FACTOR * misfit.solver.tolerance)
    try:
        refined = _minimise(replace(misfit, solver=tighter), solution.parameters)
    except SimulationError:
        # The tighter integrator has failed where the other did not: what it found stands.
        return replace(
            solution,
            evaluations=solution.evaluations + 1,
            failed_trials=solution.failed_trials + 1,
        )
    return replace(
        refined,
        evaluations=solution.evaluations + refined.evaluations,
        failed_trials=solution.failed_trials + refined.failed_trials,
    )


def _refuse_wild(response: Response) -> None:
    """A force whose square is no number is a failed trial: far starts get there."""
    rows = (response.force, *response.sensitivities.values())
    if not all(float(np.max(np.abs(row))) < _WILD for row in rows):  # "not <" catches NaN too
        raise SimulationError("simulation failed: the force is beyond any that could be fitted.")


def linearise(misfit: Misfit, parameters: Values) -> tuple[FloatArray, FloatArray]:
    """Return the residuals (n,), model minus measured, N, and their derivative (n, k).

    By ln y, of linear quantities in units of their size: the same variables whatever the setting's
    forces are.

    Raises
    ------
    SimulationError
        When the model cannot be integrated.
    FitCancelledError
        When the caller asked to stop.
    """
    if misfit.cancelled():
        raise FitCancelledError("stopped while a fit was running.")
    residuals, slopes, _ = _evaluate(misfit, parameters, 1.0)
    return residuals, slopes * common_variables(misfit).slopes(_values(misfit.free, parameters))


def common_variables(misfit: Misfit) -> Transformation:
    """Return the variables of `linearise`, which do not depend on a setting's forces."""
    sizes = np.array([misfit.damper.quantity(name).size for name in misfit.free])
    return replace(_transformation(misfit, misfit.free), scales=sizes)


@dataclass(frozen=True, slots=True)
class _Seen:
    """What is remembered of a point: with the derivatives by all that is free, held or not."""

    parameters: Values
    is_cavitating: bool
    slopes: FloatArray


@dataclass(frozen=True, slots=True)
class _End:
    """Where a descent ended, what moved in it, and whether it tried points out of range."""

    solution: Solution
    moving: tuple[str, ...]
    scales: FloatArray
    minimum: Minimum[_Seen]
    has_tried_beyond: bool


def _minimise(misfit: Misfit, start: Values) -> Solution:
    """Descend within the plausible ranges.

    A parameter that is at an edge of its range, or runs into it, is left there while the others
    go on, and let go once, should the misfit then fall into the range.
    """
    start = kept_within(start, misfit.free)
    moving = tuple(name for name in misfit.free if not is_at_edge(start, name))
    best = _descended(misfit, moving, start, _FINE)
    let_go: set[str] = set()
    while best.solution.status != 0:
        at, moving = best.solution.parameters, best.moving
        edge = _stopped_at(best)
        if edge is not None:
            at = at.replace(dict([edge]))
            moving = tuple(name for name in moving if name != edge[0])
        else:
            inwards = _falls_inside(misfit, best) - let_go
            if not inwards:
                break
            let_go |= inwards
            moving = tuple(name for name in misfit.free if name in inwards or name in moving)
        try:
            other = _descended(misfit, moving, at, _FINE)
        except SimulationError:
            break
        better = other if other.solution.mse_percent <= best.solution.mse_percent else best
        spent = best.solution.evaluations + other.solution.evaluations
        failed = best.solution.failed_trials + other.solution.failed_trials
        solution = replace(better.solution, evaluations=spent, failed_trials=failed)
        is_done = better is best
        best = replace(better, solution=solution)
        if is_done:
            break
    return best.solution


def _stopped_at(end: _End) -> tuple[str, float] | None:
    """The edge that kept a descent from going on, if one did."""
    if not end.has_tried_beyond or end.solution.gradient_cosine < RIGHT_ANGLE:
        return None
    point = end.minimum.point
    step = np.linalg.lstsq(point.jacobian, -point.residuals, rcond=None)[0]
    taken = np.asarray(step, dtype=np.float64)
    return first_edge(end.solution.parameters, end.moving, taken, end.scales)


def _falls_inside(misfit: Misfit, end: _End) -> set[str]:
    """The held parameters whose misfit falls from the edge into the range."""
    found = set()
    point = end.minimum.point
    for place, name in enumerate(misfit.free):
        if name in end.moving:
            continue
        column = end.solution.jacobian[:, place]
        slope = float(column @ point.residuals)
        length = math.sqrt(float(column @ column) * point.cost)
        if abs(slope) > RIGHT_ANGLE * length and points_inside(point.extra.parameters, name, slope):
            found.add(name)
    return found


def _descended(misfit: Misfit, moving: tuple[str, ...], start: Values, stopping: Stopping) -> _End:
    """Minimise over what moves; a trial point out of the plausible range is a failed trial."""
    scale = 1.0 / (misfit.deviation * math.sqrt(misfit.n_samples))
    start = kept_within(start, misfit.free)
    places = [misfit.free.index(name) for name in moving]
    beyond = 0

    def model(values: FloatArray) -> tuple[FloatArray, FloatArray, _Seen]:
        nonlocal beyond
        if misfit.cancelled():
            raise FitCancelledError("stopped while a fit was running.")
        parameters = _with(start, moving, values)
        if not is_within(parameters, moving):
            beyond += 1
            raise SimulationError("a parameter is out of its plausible range.")
        parameters = kept_within(parameters, moving)
        residuals, slopes, is_cavitating = _evaluate(misfit, parameters, scale)
        seen = _Seen(parameters, is_cavitating, slopes)
        return residuals, slopes if moving == misfit.free else slopes[:, places], seen

    stopping = replace(
        stopping,
        max_evaluations=misfit.max_evaluations,
        least_share=misfit.damper.kinks,
    )
    transformation = _transformation(misfit, moving)
    ended = minimise(model, _values(moving, start), transformation, stopping)
    point = ended.point
    jacobian = point.jacobian
    if moving != misfit.free:
        values = _values(misfit.free, point.extra.parameters)
        jacobian = point.extra.slopes * _transformation(misfit, misfit.free).slopes(values)
    solution = Solution(
        parameters=point.extra.parameters,
        mse_percent=100.0 * point.cost,
        jacobian=jacobian,
        evaluations=ended.evaluations - beyond,
        failed_trials=ended.failed_trials - beyond,
        status=ended.status,
        gradient_cosine=ended.gradient_cosine,
        n_independent=max(2.0 * np.count_nonzero(np.diff(np.signbit(point.residuals))), 1.0),
        is_cavitating=point.extra.is_cavitating,
    )
    return _End(solution, moving, transformation.scales, ended, beyond > 0)


def _evaluate(
    misfit: Misfit, parameters: Values, scale: float
) -> tuple[FloatArray, FloatArray, bool]:
    """Return residuals (n,), their derivative by what is free (n, k), both scaled; cavitation."""
    parts = []
    is_cavitating = False
    for trace, weight in zip(misfit.traces, weights(misfit.traces), strict=True):
        response = simulate(
            parameters,
            misfit.damper,
            motion_of(trace),
            sensitivities=misfit.free,
            options=misfit.solver,
        )
        _refuse_wild(response)
        rows = np.stack([response.force, *response.sensitivities.values()])
        rows = apply_filter(trace.model_filter, rows)[:, trace.compared]
        rows[0] -= trace.force[trace.compared]
        parts.append(rows * (scale if weight is None else scale * weight))
        is_empty = (response.pressures[:2, trace.compared] <= 0.0).any(axis=0)
        is_cavitating |= bool((is_empty if weight is None else is_empty & (weight > 0.0)).any())
    whole = parts[0] if len(parts) == 1 else np.hstack(parts)
    return whole[0], whole[1:].T, is_cavitating


def _transformation(misfit: Misfit, names: tuple[str, ...]) -> Transformation:
    """Logarithms; an offset in units of the force's deviation, what else is linear in its size."""
    quantities = [misfit.damper.quantity(name) for name in names]
    return Transformation(
        np.array([one.is_logarithmic for one in quantities], dtype=bool),
        np.array([misfit.deviation if one.is_offset else one.size for one in quantities]),
    )


def _values(names: tuple[str, ...], parameters: Values) -> FloatArray:
    return np.array([getattr(parameters, name) for name in names])


def _with(parameters: Values, names: tuple[str, ...], values: FloatArray) -> Values:
    return parameters.replace(dict(zip(names, values.tolist(), strict=True)))
