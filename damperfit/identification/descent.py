"""The misfit of the logs of one setting and its descent, on log parameters, exact Jacobian.

The variables are u = ln y for the positive parameters and u = f_0/scale for the offset, so that a
step is a relative change and no parameter can change sign. The residual is
(f_hat - f)/(sigma sqrt(N)), f_hat filtered like f: its squared norm is eq. (22) over 100.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from damperfit.conditioning import apply_filter
from damperfit.errors import DamperfitError, SimulationError
from damperfit.identification.minimiser import Transformation, minimise
from damperfit.identification.model_versus_log import motion_of
from damperfit.identification.trust_region import Stopping
from damperfit.simulation import SolverOptions, simulate

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from damperfit.damper.parameters import Damper, Parameters
    from damperfit.recording import Trace
    from damperfit.simulation import Response

    FloatArray = NDArray[np.float64]

__all__ = [
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
_COST_TOLERANCE = 1e-8
_ROUGH_COST_TOLERANCE = 1e-2
# Below this misfit (times the solver's tolerance, N) the solver's own error is what is left.
_POLISH_BELOW = 100.0
_POLISH_FACTOR = 0.003
# A force or a sensitivity, SI; a cylinder of the size of a car stays far below.
_WILD = 1e100
# A force offset is about as much, N: the rod's gas force.
_OFFSET = 100.0


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
    damper : Damper
        Geometry, oil and gas.
    free : tuple of str
        Parameters that may move.
    solver : SolverOptions
        How exactly to integrate.
    max_evaluations : int
        Limit of simulations.
    cancelled : callable
        Asked before each evaluation.
    """

    traces: tuple[Trace, ...]
    damper: Damper
    free: tuple[str, ...]
    solver: SolverOptions
    max_evaluations: int
    cancelled: Callable[[], bool]

    @property
    def deviation(self) -> float:
        """Standard deviation of all measured forces in the windows, N."""
        return float(np.std(np.concatenate([t.force[t.window] for t in self.traces])))

    @property
    def n_samples(self) -> int:
        """Samples compared."""
        return sum(t.stop - t.first for t in self.traces)


@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """Where a descent ended.

    Attributes
    ----------
    parameters : Parameters
        Best point found.
    mse_percent : float
        Eq. (22) there.
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
        Whether a chamber is at zero pressure somewhere in the windows.
    """

    parameters: Parameters
    mse_percent: float
    jacobian: FloatArray
    evaluations: int
    failed_trials: int
    status: int
    gradient_cosine: float
    n_independent: float
    is_cavitating: bool


def approach(misfit: Misfit, start: Parameters) -> Solution:
    """Minimise the misfit of one log roughly, for the start of a descent with all of them.

    Of several logs the one with the strongest force is taken: it tells the valves best.

    Raises
    ------
    SimulationError
        When the model cannot be integrated at the start.
    FitCancelledError
        When the caller asked to stop.
    """
    strongest = max(misfit.traces, key=lambda trace: float(np.std(trace.force[trace.window])))
    return _minimise(
        replace(misfit, traces=(strongest,)), start, Stopping(_ROUGH_COST_TOLERANCE, rest=math.inf)
    )


def descend(misfit: Misfit, start: Parameters) -> Solution:
    """Minimise the misfit from a start; refine with a tighter integrator if that is what is left.

    Raises
    ------
    SimulationError
        When the model cannot be integrated at the start.
    FitCancelledError
        When the caller asked to stop.
    """
    solution = _minimise(misfit, start, Stopping(_COST_TOLERANCE))
    rms = math.sqrt(solution.mse_percent / 100.0) * misfit.deviation
    if rms > _POLISH_BELOW * misfit.solver.tolerance:
        return solution
    tighter = replace(misfit.solver, tolerance=_POLISH_FACTOR * misfit.solver.tolerance)
    refined = _minimise(
        replace(misfit, solver=tighter), solution.parameters, Stopping(_COST_TOLERANCE)
    )
    return replace(
        refined,
        evaluations=solution.evaluations + refined.evaluations,
        failed_trials=solution.failed_trials + refined.failed_trials,
    )


def _refuse_wild(response: Response) -> None:
    """A force whose square is no number is a failed trial: far starts get there."""
    rows = (response.force, *response.sensitivities.values())
    if not max(float(np.max(np.abs(row))) for row in rows) < _WILD:
        raise SimulationError("simulation failed: the force is beyond any that could be fitted.")


def linearise(misfit: Misfit, parameters: Parameters) -> tuple[FloatArray, FloatArray]:
    """Return the residuals (n,), model minus measured, N, and their derivative (n, k).

    By ln y, and by f_0 in units of 100 N: the same variables whatever the setting's forces are.

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
    return residuals, slopes * common_variables(misfit).slopes(_values(misfit, parameters))


def common_variables(misfit: Misfit) -> Transformation:
    """Return the variables of `linearise`, which do not depend on a setting's forces."""
    return replace(_transformation(misfit), scales=np.full(len(misfit.free), _OFFSET))


def _minimise(misfit: Misfit, start: Parameters, stopping: Stopping) -> Solution:
    scale = 1.0 / (misfit.deviation * math.sqrt(misfit.n_samples))

    def model(values: FloatArray) -> tuple[FloatArray, FloatArray, _Seen]:
        if misfit.cancelled():
            raise FitCancelledError("stopped while a fit was running.")
        return _evaluate(misfit, _with(misfit, start, values), scale)

    stopping = replace(stopping, max_evaluations=misfit.max_evaluations)
    ended = minimise(model, _values(misfit, start), _transformation(misfit), stopping)
    point = ended.point
    return Solution(
        parameters=point.extra.parameters,
        mse_percent=100.0 * point.cost,
        jacobian=point.jacobian,
        evaluations=ended.evaluations,
        failed_trials=ended.failed_trials,
        status=ended.status,
        gradient_cosine=ended.gradient_cosine,
        n_independent=max(2.0 * np.count_nonzero(np.diff(np.signbit(point.residuals))), 1.0),
        is_cavitating=point.extra.is_cavitating,
    )


@dataclass(frozen=True, slots=True)
class _Seen:
    parameters: Parameters
    is_cavitating: bool


def _evaluate(
    misfit: Misfit, parameters: Parameters, scale: float
) -> tuple[FloatArray, FloatArray, _Seen]:
    """Return residuals (n,) and their derivative by the free parameters (n, k), both scaled."""
    parts = []
    is_cavitating = False
    for trace in misfit.traces:
        response = simulate(
            parameters,
            misfit.damper,
            motion_of(trace),
            sensitivities=misfit.free,
            options=misfit.solver,
        )
        _refuse_wild(response)
        rows = np.stack([response.force, *response.sensitivities.values()])
        rows = apply_filter(trace.model_filter, rows)[:, trace.window]
        rows[0] -= trace.force[trace.window]
        parts.append(rows * scale)
        is_cavitating |= bool((response.pressures[:2, trace.window] <= 0.0).any())
    whole = parts[0] if len(parts) == 1 else np.hstack(parts)
    return whole[0], whole[1:].T, _Seen(parameters, is_cavitating)


def _transformation(misfit: Misfit) -> Transformation:
    """Logarithms of the positive parameters; the offset in units of the force's deviation."""
    return Transformation(
        np.array([name != "f_0" for name in misfit.free], dtype=bool),
        np.full(len(misfit.free), misfit.deviation),
    )


def _values(misfit: Misfit, parameters: Parameters) -> FloatArray:
    return np.array([getattr(parameters, name) for name in misfit.free])


def _with(misfit: Misfit, parameters: Parameters, values: FloatArray) -> Parameters:
    return replace(parameters, **dict(zip(misfit.free, values.tolist(), strict=True)))
