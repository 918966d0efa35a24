"""One setting's fit: minimise on mean cycles and on the logs, and say how it ended.

Where the logs repeat, the minimum of their mean cycles is found first. Noise of the displacement
drives the model in the logs and is averaged out of the mean cycle, so that the minima lie up to
half an error apart: one step of Gauss and Newton on the logs, not evaluated again, leads there.
"""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import islice
from typing import TYPE_CHECKING

import numpy as np

from damperfit.conditioning import noise_floor
from damperfit.errors import FitCancelledError, SimulationError
from damperfit.identification.fit_problem import (
    Block,
    is_at_edge,
    is_within,
    kept_within,
    values_of,
    with_values,
)
from damperfit.identification.least_squares import Stopping, inverse_information
from damperfit.identification.logs import LogFit, SeenLog, compare, normalised_mse, said_of_speeds
from damperfit.identification.outcome import Outcome, Status
from damperfit.problem import Problem, warning
from damperfit.statistics import largest_of

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from damperfit.damper.cavitation import Cavitation
    from damperfit.damper.model import Values
    from damperfit.damper.quantity import Quantity
    from damperfit.tested.setting import Setting

    FloatArray = NDArray[np.float64]

# A relative change of the sum of squares below 1e-8 moves no parameter by 1 % of its error; a
# start for another descent needs no more than a per cent.
# No step changes a value by more than a factor of ten: beyond lie bounds and plateaus.
_LONGEST = math.log(10.0)
_FINE = Stopping(cost_tolerance=1e-8, longest_step=_LONGEST)
ROUGH = Stopping(cost_tolerance=1e-2, rest=math.inf, longest_step=_LONGEST)
# On mean cycles a tenth of an error is near enough: the last step is taken on the logs.
_NEAR = Stopping(
    cost_tolerance=1e-5,
    step_tolerance=1e-6,
    rest=math.inf,
    least_share=1e-5,
    longest_step=_LONGEST,
)
_LIMIT, _MET_COST = 0, 2  # endings, as `Minimum.status` has them
# The largest relative change of a value in a step that is not evaluated, and the most errors that
# it may be on the logs: what it leaves out is its square, 4e-4, a twentieth of an error of 1 %. On
# mean cycles it may leave so many errors times the largest change, for the logs' own step.
_SMALL = 0.02
_AN_ERROR = 1.0
_LEFT_TO_LOGS = 0.3
# A number with a standard error above this share of itself is not found by the fit. One that all
# settings are to share must be three errors away from nothing: it bends every one of them.
NOT_FOUND = 0.5
NOT_FIT_TO_SHARE = 1.0 / 3.0
# Friction below this share of the force's deviation that the logs do not fix has run to zero.
_NO_FRICTION = 1e-2
# A fit that no step makes better, while the full step promises less than half an error, is at its
# minimum as far as anyone sees: the integrator's own error and kinks let no step lead further.
_NO_ERROR = 0.5
# MSE in per cent that the paper calls excellent; that of a wrong local minimum is about 2 %.
EXCELLENT = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class FitResult:
    """Where the fit of one setting ended, and what it says of each quantity."""

    free: tuple[str, ...]  # what moved
    values: Values  # best point found
    mse_percent: float  # eq. (22) there, each stretch with its weight
    jacobian: FloatArray  # triangle R of the derivative of the residuals by u, at most (k, k)
    gradient: FloatArray  # J^T r, (k,)
    evaluations: int  # simulations of the whole setting
    failed_trials: int  # those that could not be integrated
    ending: int  # as `Minimum.status`: 0 is the limit of evaluations
    gradient_cosine: float  # largest between the residuals and a column of the Jacobian
    # Twice the residuals' sign changes: white ones change sign at every other sample; those behind
    # a low-pass of B Hz 1.15 B times a second, where 2 B samples a second are independent.
    n_independent: float
    is_cavitating: bool  # a chamber is at zero pressure somewhere in what is compared
    status: dict[str, Status] = field(default_factory=dict)
    outcome: Outcome = Outcome.CONVERGED
    # Rough, relative ones of what is free: textbook covariance with so many samples; infinite where
    # the logs say nothing.
    errors: Mapping[str, float] = field(default_factory=dict)

    @property
    def is_sound(self) -> bool:
        """Whether it is a minimum that means something."""
        return self.outcome is Outcome.CONVERGED

    def after(self, evaluations: int, failed_trials: int = 0) -> FitResult:
        """The same with the simulations made before it."""
        return replace(
            self,
            evaluations=self.evaluations + evaluations,
            failed_trials=self.failed_trials + failed_trials,
        )

    def with_status(self, status: Mapping[str, Status]) -> FitResult:
        """The same with what another fit says of some quantities."""
        return replace(self, status={**self.status, **status})


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """One setting's parameters and how far the fit itself vouches for them."""

    setting: Setting
    parameters: Values  # SI
    status: Mapping[str, Status]  # of each parameter
    outcome: Outcome  # how the fit ended
    mse_percent: float  # eq. (22) over all logs of the setting,
    noise_floor_percent: float  # and the share that is scatter between cycles
    n_samples: int  # samples and cycles compared
    n_cycles: int
    evaluations: int  # simulations spent
    cavitation: Cavitation  # share of the time, lowest pressure, margins to the onset
    logs: tuple[LogFit, ...]  # fitted together
    warnings: tuple[Problem, ...] = ()

    @property
    def cavitation_fraction(self) -> float:
        """Share of the compared time with a chamber at zero pressure."""
        return self.cavitation.fraction

    @property
    def cavitation_margin(self) -> float:
        """Fraction by which the resistance may rise that empties a chamber on this motion."""
        return self.cavitation.margin


def minimised(block: Block, start: Values, *, spent: int = 0) -> FitResult:
    """The minimum that a start leads to, judged; evaluations already spent are added."""
    result = _ended(block, start)
    variance = result.mse_percent / 100.0 / result.n_independent
    errors = np.sqrt(np.diag(inverse_information(result.jacobian)) * variance)
    by_name = dict(zip(block.free, errors.tolist(), strict=True))
    status = _statuses(block, result, by_name)
    is_minimum = result.gradient_cosine < block.right_angle or result.mse_percent < 1e-8
    is_minimum = is_minimum or _promised_errors(result) < _NO_ERROR
    outcome = Outcome.CONVERGED
    if Status.AT_BOUND in status.values():
        outcome = Outcome.AT_BOUND
    elif Status.NOT_IDENTIFIABLE in status.values():
        outcome = Outcome.NOT_IDENTIFIABLE
    elif result.is_cavitating:
        outcome = Outcome.CAVITATING
    elif not is_minimum and result.ending == _LIMIT:
        outcome = Outcome.EVALUATION_LIMIT
    elif not is_minimum:
        outcome = Outcome.NOT_FINITE if result.failed_trials else Outcome.NO_DESCENT
    return replace(result, status=status, outcome=outcome, errors=by_name).after(spent)


def _ended(block: Block, start: Values) -> FitResult:
    if block.cycles is None or block.max_evaluations == 1:
        return _on_logs(block.whole, start)
    try:  # one evaluation is left to the logs
        near = _on_cycles(replace(block, max_evaluations=block.max_evaluations - 1), start)
    except SimulationError:
        return _on_logs(block.whole, start)
    left = max(block.max_evaluations - near.evaluations, 1)
    logs = replace(block, cycles=None, max_evaluations=left)
    if block.cancelled():
        raise FitCancelledError("stopped while a fit was running.", code="cancelled")
    ended = None if near.ending == _LIMIT else _last_step(logs, near.values)
    ended = ended or _on_logs(logs, near.values)
    return ended.after(near.evaluations, near.failed_trials)


def _on_cycles(block: Block, start: Values) -> FitResult:
    """The minimum of the mean cycles, or where a small step from there is left to the logs."""
    near = descended(block, start, _NEAR._replace(near=_SMALL))
    if near.ending == _LIMIT:
        return near
    stepped = _stepped(block, near, left=_LEFT_TO_LOGS)
    if stepped is not None:
        return stepped
    stepped = _stepped(block, near) or near
    rest = replace(block, max_evaluations=max(block.max_evaluations - near.evaluations, 1))
    return descended(rest, stepped.values, _NEAR).after(near.evaluations, near.failed_trials)


def _on_logs(block: Block, start: Values) -> FitResult:
    """The minimum of the logs, with a tighter integrator if its error is what is left."""
    result = descended(block, start, _FINE)
    if result.mse_percent > block.solvers_percent:
        return result
    try:
        refined = descended(block.refined(result.mse_percent), result.values, _FINE)
    except SimulationError:
        # The tighter integrator has failed where the other did not: what it found stands.
        return result.after(1, 1)
    return refined.after(result.evaluations, result.failed_trials)


def _last_step(block: Block, near: Values) -> FitResult | None:
    """One step on the logs from the minimum of their mean cycles; None where that is too far."""
    with suppress(SimulationError):
        first = descended(replace(block, max_evaluations=1), near, _FINE)
        if first.mse_percent > block.solvers_percent:
            return _stepped(block, first, errors=_AN_ERROR)
    return None


def descended(block: Block, start: Values, stopping: Stopping) -> FitResult:
    """Where a descent ends, not judged yet."""
    stopping = stopping._replace(
        max_evaluations=block.max_evaluations,
        least_share=max(stopping.least_share, block.model.kinks),
    )
    ended = block.minimise(kept_within(start, block.free), stopping)
    ((setting, values),) = ended.extra.values.items()
    return FitResult(
        free=block.free,
        values=values,
        mse_percent=100.0 * ended.cost,
        jacobian=ended.jacobian,
        gradient=ended.system.gradient,
        evaluations=ended.evaluations,
        failed_trials=ended.failed_trials,
        ending=ended.status,
        gradient_cosine=ended.gradient_cosine,
        n_independent=ended.extra.n_independent[setting],
        is_cavitating=ended.extra.is_cavitating,
    )


def _stepped(
    block: Block, near: FitResult, *, errors: float = math.inf, left: float = math.inf
) -> FitResult | None:
    """Where the full step leads that is left at a point, without an evaluation there.

    None where it changes a value by more than `_SMALL`, leads out of the ranges, is more than so
    many errors, or leaves more of them: the step's times its largest change.
    """
    free, jacobian = block.free, near.jacobian
    if not free or any(is_at_edge(near.values, name) for name in free):
        return None
    information = jacobian.T @ jacobian
    try:
        step = np.linalg.solve(information, -near.gradient)
    except np.linalg.LinAlgError:
        step = np.linalg.lstsq(information, -near.gradient, rcond=None)[0]
    moved = jacobian @ step
    gain, cost, largest = float(moved @ moved), near.mse_percent / 100.0, largest_of(step)
    squared = gain * near.n_independent / cost
    if squared > errors**2 or squared * largest**2 > left**2 or not largest <= _SMALL:
        return None
    variables = block.variables
    numbers = variables.unpack(variables.pack(values_of(free, near.values)) + step)
    values = with_values(near.values, free, numbers)
    if not is_within(values, free):
        return None
    rest = near.gradient + jacobian.T @ moved
    lengths = np.sqrt(np.add.reduce(jacobian**2) * cost)
    return replace(
        near,
        values=values,
        mse_percent=100.0 * (cost - gain),
        gradient=rest,
        gradient_cosine=largest_of(rest / np.maximum(lengths, 1e-300)),
        ending=_MET_COST,
    )


def is_loose(quantity: Quantity, value: float, error: float, share: float) -> bool:
    """Whether a standard error, of the logarithm or in the size, is too large beside a value."""
    if quantity.is_logarithmic:
        return error > share
    # What is of either sign may be nothing, and has no relative error. An offset never is loose:
    # it stands beside a force that is known.
    return quantity.is_shared and error > share * max(1.0, abs(value) / quantity.size)


def _statuses(block: Block, result: FitResult, errors: Mapping[str, float]) -> dict[str, Status]:
    status = dict.fromkeys(result.values.names, Status.FIXED)
    for name, error in errors.items():
        value = getattr(result.values, name)
        status[name] = Status.FITTED
        one = block.model.quantity(name)
        low, high = one.plausible
        if one.unit == "N" and one.is_logarithmic and error > NOT_FOUND:
            low = max(low, _NO_FRICTION * block.deviation)
        if one.is_open and value >= high:
            status[name] = Status.NOT_IDENTIFIABLE  # rigid oil is no fault: there is no upper limit
        elif not low < value < high:
            status[name] = Status.AT_BOUND
        elif is_loose(one, value, error, NOT_FOUND):
            status[name] = Status.NOT_IDENTIFIABLE
    for first, *others in block.model.determined_together:
        if status.get(first) is Status.NOT_IDENTIFIABLE:
            status |= {name: status[first] for name in others if name in block.free}
    return status


def _promised_errors(result: FitResult) -> float:
    """How many standard errors the full step is long that is left at a point."""
    lengths = np.maximum(np.sqrt(np.sum(result.jacobian**2, axis=0)), 1e-300)
    columns, pull = result.jacobian / lengths, result.gradient / lengths
    along = np.linalg.lstsq(columns.T, pull, rcond=None)[0]
    cost = max(result.mse_percent / 100.0, 1e-300)
    return math.sqrt(float(along @ along) * result.n_independent / cost)


def describe_fit(setting: Setting, result: FitResult, block: Block) -> Fit:
    """The `Fit` of a result: figures of each log, cavitation."""
    values = result.values
    logs, seen, misses, floors = [], [], [], []
    cycles = iter(block.cycles.cycles if block.cycles is not None else ())
    for trace in block.traces:
        comparison = compare(values, trace, block.model, solver=block.solver)
        part = trace.compared
        measured, simulated = trace.force[part], comparison.force[part]
        mse = normalised_mse(measured, simulated)
        places = trace.places if len(trace.stretches) > 1 else ()
        alone = tuple(normalised_mse(measured[at], simulated[at]) for at in places) or (mse,)
        kept = SeenLog(
            values,
            trace,
            block.model,
            block.solver,
            comparison.force.copy(),  # not a view that keeps more
            comparison.response.pressures.astype(np.float32),
            tuple(islice(cycles, len(trace.stretches))),
        )
        logs.append(LogFit(trace, mse, noise_floor(trace), alone, kept))
        seen.append((trace, comparison.response))
        misses.append(simulated - measured)
        floors.append(logs[-1].noise_floor_percent / 100.0 * np.var(measured) * len(measured))
    warnings = list(said_of_speeds(block.facts, block.free, block.model.quantities))
    if result.failed_trials:
        positive = [one for one in values.quantities if one.is_logarithmic]
        where = ", ".join(f"{one.symbol} {getattr(values, one.name):.3g}" for one in positive)
        text = f"{result.failed_trials} trial points could not be simulated, near {where}."
        warnings.insert(0, warning("failed-trials", text))
    all_misses = np.concatenate(misses)
    total = block.deviation**2 * len(all_misses)
    return Fit(
        setting=setting,
        parameters=values,
        status=result.status,
        outcome=result.outcome,
        mse_percent=float(100.0 * np.sum(all_misses**2) / total),
        noise_floor_percent=float(100.0 * np.sum(floors) / total),
        n_samples=len(all_misses),
        n_cycles=sum(trace.n_cycles for trace in block.traces),
        evaluations=result.evaluations,
        cavitation=block.model.examine(values, seen, solver=block.solver),
        logs=tuple(logs),
        warnings=tuple(warnings),
    )
