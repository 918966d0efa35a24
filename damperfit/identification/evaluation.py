"""Residuals of a misfit and their derivatives, of the logs or of their mean cycles."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from damperfit.conditioning import apply_filter
from damperfit.errors import SimulationError
from damperfit.identification.minimiser import Transformation
from damperfit.identification.model_versus_log import SETTLING
from damperfit.simulation import motion_of, simulate
from damperfit.statistics import largest_of

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from damperfit.damper.model import Values
    from damperfit.identification.descent import Misfit
    from damperfit.identification.settled import SettledLogs
    from damperfit.recording import Trace
    from damperfit.simulation import Response

    FloatArray = NDArray[np.float64]

__all__ = [
    "LogResponse",
    "evaluate",
    "is_empty_where_it_counts",
    "n_independent",
    "simulated_logs",
    "transformation",
    "values_of",
    "with_values",
]

# A force or a sensitivity, SI; a cylinder of the size of a car stays far below.
_WILD = 1e100
_BEYOND = "simulation failed: the force is beyond anything that could be fitted."


def evaluate(
    misfit: Misfit, parameters: Values, scale: float
) -> tuple[FloatArray, FloatArray, bool]:
    """Return residuals (n,), their derivative by what is free (n, k), both scaled; cavitation."""
    if misfit.cycles is not None:
        return _on_cycles(misfit, misfit.cycles, parameters, scale)
    parts = []
    is_cavitating = False
    for one in simulated_logs(misfit, parameters):
        trace, response = one.trace, one.response
        rows = np.stack([response.force, *response.sensitivities.values()])
        rows = apply_filter(trace.model_filter, rows)[:, trace.compared]
        rows[0] -= trace.force[trace.compared]
        parts.append(rows * (scale * one.factor))
        is_cavitating |= one.is_cavitating
    whole = parts[0] if len(parts) == 1 else np.hstack(parts)
    return whole[0], whole[1:].T, is_cavitating


@dataclass(frozen=True, slots=True, eq=False)
class LogResponse:
    """A log's simulation.

    Attributes
    ----------
    trace : Trace
        The log.
    response : Response
        With the derivatives by what is free, before the filter.
    factor : numpy.ndarray or float
        What its residuals are multiplied by, over its compared samples.
    is_cavitating : bool
        Whether a chamber is empty where the log counts.
    """

    trace: Trace
    response: Response
    factor: FloatArray | float
    is_cavitating: bool


def simulated_logs(misfit: Misfit, parameters: Values) -> Iterator[LogResponse]:
    """Simulate every log of a misfit whole, one at a time.

    Parameters
    ----------
    misfit : Misfit
        Logs, damper, what is free, solver.
    parameters : Values
        Where.

    Raises
    ------
    SimulationError
        The model cannot be integrated, or its force is beyond anything that could be fitted.
    """
    for trace, weight in zip(misfit.traces, misfit.facts.weights, strict=True):
        response = simulate(
            parameters,
            misfit.damper,
            motion_of(trace),
            sensitivities=misfit.free,
            options=replace(misfit.solver, settling=SETTLING),
        )
        _refuse_wild(response)
        is_cavitating = is_empty_where_it_counts(response, trace, weight)
        yield LogResponse(trace, response, 1.0 if weight is None else weight, is_cavitating)


def is_empty_where_it_counts(
    response: Response, trace: Trace, weight: FloatArray | None = None
) -> bool:
    """Whether a chamber of oil is empty in a compared sample of a log that has a weight."""
    if response.pressures[:2].min() > 0.0:
        return False
    is_empty = (response.pressures[:2, trace.compared] <= 0.0).any(axis=0)
    return bool((is_empty if weight is None else is_empty & (weight > 0.0)).any())


def _on_cycles(
    misfit: Misfit, cycles: SettledLogs, parameters: Values, scale: float
) -> tuple[FloatArray, FloatArray, bool]:
    """The same on the mean cycles; what differs between cycles is the last residual."""
    samples = sum(len(one.force) for one in cycles.cycles)
    whole = np.zeros((1 + len(misfit.free), samples + 1))
    whole[0, -1] = scale * math.sqrt(cycles.scatter)
    is_cavitating, first = False, 0
    for one in cycles.cycles:
        solver = one.solver(misfit.solver)
        response = simulate(
            parameters, misfit.damper, one.motion, sensitivities=misfit.free, options=solver
        )
        rows = one.rows(response)
        if not largest_of(rows) < _WILD:  # "not <" catches NaN too
            raise SimulationError(_BEYOND)
        last = first + len(one.force)
        np.multiply(rows, scale, out=whole[:, first:last])
        first = last
        oil = response.pressures[:2, -len(one.force) :]
        if np.minimum.reduce(oil, axis=None) <= 0.0:
            is_cavitating |= bool(((oil <= 0.0).any(axis=0) & (one.factor > 0.0)).any())
    return whole[0], whole[1:].T, is_cavitating


def transformation(misfit: Misfit, names: tuple[str, ...]) -> Transformation:
    """Logarithms; an offset in units of the force's deviation, what else is linear in its size."""
    quantities = [misfit.damper.quantity(name) for name in names]
    return Transformation(
        np.array([one.is_logarithmic for one in quantities], dtype=bool),
        np.array([misfit.deviation if one.is_offset else one.size for one in quantities]),
    )


def values_of(names: tuple[str, ...], parameters: Values) -> FloatArray:
    """Return the values of some names, shape (k,)."""
    return np.array([getattr(parameters, name) for name in names])


def with_values(parameters: Values, names: tuple[str, ...], values: FloatArray) -> Values:
    """Return parameters with other values of some names."""
    return parameters.replace(dict(zip(names, values.tolist(), strict=True)))


def n_independent(residuals: FloatArray) -> float:
    """Return how many independent samples residuals are worth: twice their sign changes."""
    signs = np.signbit(residuals)
    return max(2.0 * float(np.count_nonzero(signs[1:] != signs[:-1])), 1.0)


def _refuse_wild(response: Response) -> None:
    """A force whose square is no number is a failed trial: far starts get there."""
    rows = (response.force, *response.sensitivities.values())
    with np.errstate(over="ignore", invalid="ignore"):
        if not all(float(row @ row) < _WILD**2 for row in rows):  # "not <" catches NaN too
            raise SimulationError(_BEYOND)
