"""From the minimum of the mean cycles to that of the logs: one evaluation and one step.

Noise of the displacement drives the model in the logs and is averaged out of the mean cycle, so
that the minima lie up to half an error apart. That is far within where residuals are linear, and
the full step of Gauss and Newton ends where a descent on the logs would end.

How far the minima lie apart hardly changes as some of what was free is held a little aside: with
D the way from the cycles' minimum to the logs' and H = J^T J of the logs, all of a descent with
more free, it is then D_f + H_ff^-1 H_fh D_h. One look without derivatives tells the misfit there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from damperfit.conditioning import apply_filter
from damperfit.errors import SimulationError
from damperfit.identification.evaluation import (
    is_empty_where_it_counts,
    n_independent,
    simulated_logs,
    transformation,
    values_of,
    with_values,
)
from damperfit.identification.minimiser import inverse_information
from damperfit.identification.model_versus_log import compare
from damperfit.identification.plausible import is_at_edge, is_within
from damperfit.identification.solution import Solution
from damperfit.statistics import largest_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from damperfit.damper.model import Values
    from damperfit.identification.descent import Misfit
    from damperfit.identification.model_versus_log import SimulatedLog
    from damperfit.recording import FilterDesign

    FloatArray = NDArray[np.float64]

__all__ = [
    "FORESEEN",
    "LEAVES",
    "LEAVES_TO_LOGS",
    "UNSEEN",
    "beside_earlier",
    "known_step",
    "last_step",
    "promised_step",
    "step_among_kinks",
]

# Chi-squared of one error, and the largest relative change of a value: what the step leaves out is
# its square, 4e-4, which is a twentieth of an error of 1 %.
_AN_ERROR = 1.0
_SMALL = 0.02
# Relative change of a value from a descent to the next from which on the way between the minima is
# found anew: it changes by as much of itself, and is half an error.
_NEAR = 0.1
# On the mean cycles a step that changes no value by more is taken without a look. Derivatives
# change by as much as the largest relative change; so much of the step, in errors, may be left.
UNSEEN = 5e-3
LEAVES = 0.05
# Where the logs' own step follows, which takes what is left, but for the relative change of the
# derivatives. The way between the minima is then not known well enough for another descent.
FORESEEN = _SMALL
LEAVES_TO_LOGS = 0.3
# Relative error of a value that is told, as `not_identifiable` has it.
_TOLD = 0.5
_MET_COST = 2  # as `Solution` has it: no step makes the sum of squares smaller


def last_step(misfit: Misfit, there: Solution, *, least_percent: float) -> Solution | None:
    """Return the minimum beside a point; None where one small step does not lead there.

    The pull of the logs is their own. How far it leads is told by the mean cycles' Jacobian, which
    noise does not change by a thousandth.

    Parameters
    ----------
    misfit : Misfit
        Of the logs themselves.
    there : Solution
        The minimum of their mean cycles.
    least_percent : float
        MSE below which the integrator's error is what is left, and no step is taken.
    """
    free, near = misfit.free, there.parameters
    if not free or any(is_at_edge(near, name) for name in free):
        return None
    variables = transformation(misfit, free)
    values = values_of(free, near)
    jacobian = there.condensed.jacobian
    try:
        pulled = _pulled(misfit, near)
        gradient = pulled.gradient * variables.slopes(values)
        turned = np.linalg.solve(jacobian.T, -gradient)
        step = np.linalg.solve(jacobian, turned)
    except (SimulationError, np.linalg.LinAlgError):
        return None
    residuals = pulled.residuals
    cost, gain = float(residuals @ residuals), float(turned @ turned)
    independent = n_independent(residuals)
    if not 100.0 * cost > least_percent:
        return None
    if gain * independent > _AN_ERROR * cost or not largest_of(step) <= _SMALL:
        return None
    parameters = with_values(near, free, variables.unpack(variables.pack(values) + step))
    if not is_within(parameters, free):
        return None
    rest = gradient + jacobian.T @ (jacobian @ step)
    found = (parameters, cost - gain, jacobian)
    return _ended(found, rest, independent, is_cavitating=pulled.is_cavitating, apart=step)


@dataclass(frozen=True, slots=True, eq=False)
class _Pulled:
    """The logs' residuals, scaled as a misfit's, and J^T r by what is free."""

    residuals: FloatArray
    gradient: FloatArray
    is_cavitating: bool


def _pulled(misfit: Misfit, parameters: Values) -> _Pulled:
    """One simulation of each log; the residuals go back through the filter, not each derivative."""
    parts = []
    gradient = np.zeros(len(misfit.free))
    is_cavitating = False
    for one in simulated_logs(misfit, parameters):
        trace, response, part = one.trace, one.response, one.trace.compared
        factor = misfit.scale * one.factor
        force = apply_filter(trace.model_filter, response.force)
        residuals = factor * (force[part] - trace.force[part])
        back = np.zeros(len(force))
        back[part] = factor * residuals
        back = _back_through(trace.model_filter, back)
        gradient += [float(row @ back) for row in response.sensitivities.values()]
        is_cavitating |= one.is_cavitating
        parts.append(residuals)
    return _Pulled(np.concatenate(parts), gradient, is_cavitating)


def _back_through(design: FilterDesign, signal: FloatArray) -> FloatArray:
    """Return what the transpose of a filter makes of a signal that is zero at its ends."""
    if design.is_zero_phase and not design.bridged:  # its own transpose
        return apply_filter(design, signal)
    if design.is_zero_phase:  # but for the samples that are bridged before it
        back = apply_filter(replace(design, bridged=()), signal)
        at = np.array(design.bridged, dtype=np.int64)
        share = 0.5 * back[at]
        back[at] = 0.0
        np.add.at(back, at - 1, share)
        np.add.at(back, at + 1, share)
        return back
    return np.ascontiguousarray(apply_filter(design, np.ascontiguousarray(signal[::-1]))[::-1])


def beside_earlier(misfit: Misfit, start: Values) -> Values:
    """Return a start moved to where the mean cycles should end with some held that was free before.

    By the derivatives of the descent before; the start as it is where none has ended there.
    """
    earlier, free = misfit.earlier, misfit.free
    if earlier is None or not free or not set(free) < set(earlier.free):
        return start
    first, triangle = earlier.solution, earlier.solution.jacobian
    if first.apart is None or triangle.shape != (len(earlier.free), len(earlier.free)):
        return start
    variables = transformation(misfit, earlier.free)
    ended = variables.pack(values_of(earlier.free, first.parameters))
    begun = variables.pack(values_of(earlier.free, start))
    own = [earlier.free.index(name) for name in free]
    held = [place for place, name in enumerate(earlier.free) if name not in free]
    if np.max(np.abs(begun - ended)) > _NEAR or np.any(begun[own] != ended[own]):
        return start
    there = ended - first.apart  # the minimum of the mean cycles
    moved = begun - there
    follows = np.linalg.lstsq(triangle[:, own], triangle[:, held] @ moved[held], rcond=None)[0]
    there[own] -= follows
    moved_to = with_values(start, free, variables.unpack(there)[own])
    return moved_to if np.max(np.abs(follows)) <= _NEAR and is_within(moved_to, free) else start


def known_step(misfit: Misfit, there: Solution, *, least_percent: float) -> Solution | None:
    """Return the minimum beside that of the mean cycles, by the way that an earlier descent knows.

    None where no descent with more free ended near.

    Parameters
    ----------
    misfit : Misfit
        Of the logs themselves.
    there : Solution
        The end of the descent on their mean cycles.
    least_percent : float
        MSE below which the integrator's error is what is left, and no step is taken.
    """
    step = _way(misfit, there)
    free, near = misfit.free, there.parameters
    if step is None or there.gradient is None or np.max(np.abs(step)) > _SMALL:
        return None
    jacobian = there.condensed.jacobian
    moved = jacobian @ step
    if float(moved @ moved) * there.n_independent > _AN_ERROR * there.mse_percent / 100.0:
        return None
    variables = transformation(misfit, free)
    moved_to = variables.unpack(variables.pack(values_of(free, near)) + step)
    parameters = with_values(near, free, moved_to)
    if not is_within(parameters, free):
        return None
    try:
        looked = _looked(misfit, parameters)
    except SimulationError:
        return None
    cost = float(looked.residuals @ looked.residuals)
    if not 100.0 * cost > least_percent:
        return None
    rest = there.gradient + jacobian.T @ (jacobian @ there.promised)
    found = _ended(
        (parameters, cost, jacobian),
        rest,
        n_independent(looked.residuals),
        is_cavitating=looked.is_cavitating,
    )
    return replace(found, seen=looked.seen)


def promised_step(
    misfit: Misfit,
    there: Solution,
    *,
    longest: float = _SMALL,
    most: float = math.inf,
    leaves: float = math.inf,
) -> Solution | None:
    """Return where the full step leads that a descent has left, without another look.

    None where it leads too far, or out of the plausible range.

    Parameters
    ----------
    misfit : Misfit
        Of the logs themselves or of their mean cycles.
    there : Solution
        The end of the descent on it.
    longest : float
        Largest relative change of a value.
    most : float
        Most errors squared.
    leaves : float
        Most errors times the largest relative change.
    """
    free, near, jacobian = misfit.free, there.parameters, there.jacobian
    if there.gradient is None or not free or any(is_at_edge(near, name) for name in free):
        return None
    step = there.promised
    moved = jacobian @ step
    gain, cost = float(moved @ moved), there.mse_percent / 100.0
    largest, squared = largest_of(step), gain * there.n_independent
    if squared > most * cost or squared * largest**2 > leaves**2 * cost or not largest <= longest:
        return None
    variables = transformation(misfit, free)
    moved_to = variables.unpack(variables.pack(values_of(free, near)) + step)
    parameters = with_values(near, free, moved_to)
    if not is_within(parameters, free):
        return None
    rest = there.gradient + jacobian.T @ moved
    lengths = np.sqrt(np.add.reduce(jacobian**2) * cost)
    return replace(
        there,
        parameters=parameters,
        mse_percent=100.0 * (cost - gain),
        gradient=rest,
        gradient_cosine=largest_of(rest / np.maximum(lengths, 1e-300)),
    )


def step_among_kinks(misfit: Misfit, there: Solution) -> Solution | None:
    """Return where the full step leads that a descent among kinks has left: less than an error.

    Another look would not tell whether it is right: a misfit among kinks jumps by as much. None
    where the logs do not tell a value, by rough errors; it may be on its way to an edge.
    """
    if there.status != _MET_COST or not misfit.free:
        return None
    variance = there.mse_percent / 100.0 / there.n_independent
    if not np.max(variance * np.diag(inverse_information(there.jacobian))) < _TOLD**2:
        return None
    return promised_step(misfit, there, most=_AN_ERROR)


def _ended(
    found: tuple[Values, float, FloatArray],
    gradient: FloatArray,
    independent: float,
    *,
    is_cavitating: bool,
    apart: FloatArray | None = None,
) -> Solution:
    """What one look at the logs has found, with what is left of the gradient."""
    parameters, cost, jacobian = found
    lengths = np.sqrt(np.add.reduce(jacobian**2) * cost)
    return Solution(
        parameters=parameters,
        mse_percent=100.0 * cost,
        jacobian=jacobian,
        evaluations=1,
        failed_trials=0,
        status=_MET_COST,
        gradient_cosine=largest_of(gradient / np.maximum(lengths, 1e-300)),
        n_independent=independent,
        is_cavitating=is_cavitating,
        apart=apart,
    )


def _way(misfit: Misfit, there: Solution) -> FloatArray | None:
    """The step in u from the end of a descent on cycles to the logs' minimum, if it is known."""
    free, near, earlier = misfit.free, there.parameters, misfit.earlier
    if earlier is None or earlier.solution.apart is None or there.gradient is None:
        return None
    if not free or not set(free) < set(earlier.free) or any(is_at_edge(near, one) for one in free):
        return None
    first, triangle, apart = earlier.solution, earlier.solution.jacobian, earlier.solution.apart
    fixed = tuple(name for name in near.names if name not in earlier.free)
    is_same = all(getattr(near, one) == getattr(first.parameters, one) for one in fixed)
    if not is_same or triangle.shape != (len(earlier.free), len(earlier.free)):
        return None
    variables = transformation(misfit, earlier.free)
    here, before = (
        variables.pack(values_of(earlier.free, one)) for one in (near, first.parameters)
    )
    if np.max(np.abs(here - before)) > _NEAR:
        return None
    own = [earlier.free.index(name) for name in free]
    held = [place for place, name in enumerate(earlier.free) if name not in free]
    follows = np.linalg.lstsq(triangle[:, own], triangle[:, held] @ apart[held], rcond=None)[0]
    return np.asarray(there.promised + apart[own] + follows)


@dataclass(frozen=True, slots=True, eq=False)
class _Look:
    """The logs beside the model, without derivatives; residuals scaled as a misfit's."""

    residuals: FloatArray
    is_cavitating: bool
    seen: tuple[SimulatedLog, ...]


def _looked(misfit: Misfit, parameters: Values) -> _Look:
    parts, seen = [], []
    is_cavitating = False
    for trace, weight in zip(misfit.traces, misfit.facts.weights, strict=True):
        part = trace.compared
        one = compare(parameters, trace, misfit.damper, solver=misfit.solver)
        residuals = misfit.scale * (one.force[part] - trace.force[part])
        parts.append(residuals if weight is None else residuals * weight)
        is_cavitating |= is_empty_where_it_counts(one.response, trace, weight)
        seen.append(one)
    return _Look(np.concatenate(parts), is_cavitating, tuple(seen))
