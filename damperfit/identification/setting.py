"""One setting's fit: descend, come back from the cavitating valley, and judge the result."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import islice
from typing import TYPE_CHECKING

import numpy as np

from damperfit.conditioning import noise_floor
from damperfit.errors import SimulationError
from damperfit.identification.descent import (
    Misfit,
    approach,
    descend,
)
from damperfit.identification.log_fit import LogFit, SeenLog
from damperfit.identification.minimiser import inverse_information
from damperfit.identification.model_versus_log import compare, normalised_mse
from damperfit.identification.one_speed import inseparable, said_of_speeds
from damperfit.identification.outcome import Outcome, Status
from damperfit.identification.solution import Solution

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from damperfit.damper.cavitation import Cavitation
    from damperfit.damper.detour import Detour
    from damperfit.damper.model import Values
    from damperfit.damper.quantity import Quantity
    from damperfit.tested.setting import Setting

__all__ = [
    "EXCELLENT",
    "NOT_FIT_TO_SHARE",
    "NOT_FOUND",
    "Fit",
    "Judged",
    "LogFit",
    "attempt",
    "describe_fit",
    "fit_guided",
    "fit_setting",
    "is_loose",
    "is_sound",
    "lacks_stiffness_alone",
    "relative_errors",
]

# A number with a standard error above this share of itself is not found by the fit. One that all
# settings are to share must be three errors away from nothing: it bends every one of them.
NOT_FOUND = 0.5
NOT_FIT_TO_SHARE = 1.0 / 3.0
# Friction below this share of the force's deviation that the logs do not fix has run to zero.
_NO_FRICTION = 1e-2
# A sound minimum is preferred to a cavitating one unless that one is better by this factor.
_CLEARLY_BETTER = 1.5
# MSE in per cent that the paper calls excellent; the wrong valley's is about 2 %.
EXCELLENT = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """One setting's parameters and how far the fit itself vouches for them.

    Attributes
    ----------
    setting : Setting
        Adjuster setting.
    parameters : Values
        SI values.
    status : dict of str to Status
        For each parameter: fitted, fixed, shared, at_bound, not_identifiable or absent.
    outcome : Outcome
        How the fit ended.
    mse_percent, noise_floor_percent : float
        Eq. (22) over all logs of the setting, and the share that is scatter between cycles.
    n_samples, n_cycles, evaluations : int
        Samples and cycles compared; simulations spent.
    cavitation : Cavitation
        Share of the time, lowest pressure, margins to the onset.
    logs : tuple of LogFit
        The logs fitted together.
    warnings : tuple of str
        One plain sentence each.
    """

    setting: Setting
    parameters: Values
    status: Mapping[str, Status]
    outcome: Outcome
    mse_percent: float
    noise_floor_percent: float
    n_samples: int
    n_cycles: int
    evaluations: int
    cavitation: Cavitation
    logs: tuple[LogFit, ...]
    warnings: tuple[str, ...] = ()

    @property
    def cavitation_fraction(self) -> float:
        """Share of the compared time with a chamber at zero pressure."""
        return self.cavitation.fraction

    @property
    def cavitation_margin(self) -> float:
        """Fraction by which the resistance may rise that empties a chamber on this motion."""
        return self.cavitation.margin


@dataclass(frozen=True, slots=True, eq=False)
class Judged:
    """A solution with its verdict and rough relative errors, before report figures are added.

    What was done beside the ordinary to find it stands in `said`.
    """

    solution: Solution
    status: dict[str, Status]
    outcome: Outcome
    errors: Mapping[str, float] = field(default_factory=dict)
    said: tuple[str, ...] = ()


def fit_setting(misfit: Misfit, start: Values, *, spent: int = 0) -> Judged:
    """Fit the free parameters of one setting.

    A descent that ends unsound (cavitating, at a bound, or not identifiable) is tried again by the
    model's detours. The paper's continue from R_m3 below the onset of cavitation, and the better
    sound minimum is kept; where that ends neither at a sound minimum nor at a good one that
    cavitates, further descents start beyond the onset.

    Parameters
    ----------
    misfit : Misfit
        Logs, damper and what is free.
    start : Values
        Where to start.
    spent : int
        Evaluations already spent on the start, added to the count.

    Raises
    ------
    SimulationError
        When the model cannot be integrated at any start.
    """
    first = attempt(misfit, start, spent)
    if names := inseparable(misfit.facts, misfit.free, misfit.damper.quantities):
        return _unspoken(first, names)
    if is_sound(first):
        return first
    best = first
    for detour in misfit.damper.detours(start, misfit.traces, misfit.free):
        is_enough = is_sound(best) or _is_explained(best) or lacks_stiffness_alone(best)
        if detour.is_last_resort and is_enough:
            break
        best = _over(detour, misfit, best)
    return best


def _over(detour: Detour, misfit: Misfit, best: Judged) -> Judged:
    """The better of a result and of a descent that goes another way."""
    try:
        other = attempt(misfit, *_approached(misfit, detour.start, detour.held))
    except SimulationError:
        return best
    if detour.is_last_resort:
        is_better = other.solution.mse_percent * _CLEARLY_BETTER < best.solution.mse_percent
    else:
        is_better = _is_preferred(other, best)
    chosen = other if is_better else best
    spent = best.solution.evaluations + other.solution.evaluations
    return replace(chosen, solution=replace(chosen.solution, evaluations=spent))


def fit_guided(misfit: Misfit, start: Values, held: frozenset[str]) -> Judged:
    """Fit with some held at the start first, then with everything free."""
    there, spent = _approached(misfit, start, (held,))
    return fit_setting(misfit, there, spent=spent)


def _approached(
    misfit: Misfit, start: Values, stages: Sequence[frozenset[str]]
) -> tuple[Values, int]:
    """Where rough descents lead that hold some, stage by stage, and the simulations they cost."""
    spent = 0
    for held in stages:
        guided = approach(_holding(misfit, held), start)
        start, spent = guided.parameters, spent + guided.evaluations
    return start, spent


def lacks_stiffness_alone(judged: Judged) -> bool:
    """Whether a fit that does not cavitate is excellent and lacks nothing but K_e: rigid oil."""
    is_open = {one.name for one in judged.solution.parameters.quantities if one.is_open}
    others = all(
        s in {Status.FITTED, Status.FIXED}
        for name, s in judged.status.items()
        if name not in is_open
    )
    is_lost = any(judged.status[name] == Status.NOT_IDENTIFIABLE for name in is_open)
    is_full = not judged.solution.is_cavitating
    return others and is_lost and is_full and judged.solution.mse_percent < EXCELLENT


def _unspoken(judged: Judged, names: tuple[str, ...]) -> Judged:
    """The same, of parameters that these logs cannot separate; at a bound one is by accident."""
    loose = {Status.FITTED, Status.AT_BOUND}
    lost = {name: Status.NOT_IDENTIFIABLE for name in names if judged.status[name] in loose}
    outcome = judged.outcome
    if outcome in {Outcome.CONVERGED, Outcome.CAVITATING, Outcome.AT_BOUND}:
        outcome = Outcome.NOT_IDENTIFIABLE
    return replace(judged, status=judged.status | lost, outcome=outcome)


def _is_explained(judged: Judged) -> bool:
    """Whether a fit that cavitates is too good for the wrong valley, which an offset may hide."""
    is_excellent = judged.solution.mse_percent < EXCELLENT
    values = judged.solution.parameters
    has_offset = any(values.quantity(name).is_offset for name in judged.errors)
    return judged.outcome is Outcome.CAVITATING and is_excellent and not has_offset


def _holding(misfit: Misfit, names: frozenset[str]) -> Misfit:
    return replace(misfit, free=tuple(name for name in misfit.free if name not in names))


def is_sound(judged: Judged) -> bool:
    """Whether a fit ended at a minimum that means something."""
    return judged.outcome is Outcome.CONVERGED


def _is_preferred(second: Judged, first: Judged) -> bool:
    """Whether the second is to be kept: sound, or else better."""
    if is_sound(second):
        much_better = (
            first.solution.mse_percent * _CLEARLY_BETTER < second.solution.mse_percent
            and first.outcome is Outcome.CAVITATING
        )
        return not much_better
    return first.solution.mse_percent > second.solution.mse_percent


def attempt(misfit: Misfit, start: Values, spent: int) -> Judged:
    """Return where one descent from a start ends, judged.

    Parameters
    ----------
    misfit : Misfit
        Logs, damper and what is free.
    start : Values
        Where to start.
    spent : int
        Evaluations to add to the count.
    """
    solution = descend(misfit, start)
    solution = replace(solution, evaluations=solution.evaluations + spent)
    errors = dict(zip(misfit.free, relative_errors(solution).tolist(), strict=True))
    status = _statuses(misfit, solution, errors)
    return Judged(solution, status, _outcome(solution, status, misfit.right_angle), errors)


def relative_errors(solution: Solution) -> NDArray[np.float64]:
    """Return rough relative standard errors of the free parameters, shape (k,).

    Textbook covariance with the number of samples replaced by twice the number of sign changes of
    the residual, which for white residuals is the number of samples and for residuals behind a
    low-pass the number of independent ones. Infinite where the logs say nothing.
    """
    jacobian = solution.jacobian
    if jacobian.shape[1] == 0:
        return np.empty(0)
    # In units of u: the sum of squares is MSE/100 over n_independent samples.
    variance = solution.mse_percent / 100.0 / solution.n_independent
    return np.asarray(np.sqrt(np.diag(inverse_information(jacobian)) * variance))


def is_loose(quantity: Quantity, value: float, error: float, share: float) -> bool:
    """Whether a standard error is too large for a number to be called found.

    Parameters
    ----------
    quantity : Quantity
        Which.
    value : float
        What was found, in its unit.
    error : float
        Of its logarithm, or in its `size`: what is of either sign may be nothing, and then has no
        relative error. An offset stands beside a force that is known; it is never too loose.
    share : float
        The largest error, of the value or of what such a quantity is in a damper.
    """
    if quantity.is_logarithmic:
        return error > share
    return quantity.is_shared and error > share * max(1.0, abs(value) / quantity.size)


def _statuses(misfit: Misfit, solution: Solution, errors: Mapping[str, float]) -> dict[str, Status]:
    status = dict.fromkeys(solution.parameters.names, Status.FIXED)
    for name, error in errors.items():
        value = getattr(solution.parameters, name)
        status[name] = Status.FITTED
        one = misfit.damper.quantity(name)
        low, high = one.plausible
        if one.unit == "N" and one.is_logarithmic and error > NOT_FOUND:
            low = max(low, _NO_FRICTION * misfit.deviation)
        if one.is_open and value >= high:
            status[name] = Status.NOT_IDENTIFIABLE  # rigid oil is no fault: there is no upper limit
        elif not low < value < high:
            status[name] = Status.AT_BOUND
        elif is_loose(one, value, error, NOT_FOUND):
            status[name] = Status.NOT_IDENTIFIABLE
    for first, *others in misfit.damper.determined_together:
        if status.get(first) is Status.NOT_IDENTIFIABLE:
            status |= {name: status[first] for name in others if name in misfit.free}
    return status


def _outcome(solution: Solution, status: Mapping[str, Status], right_angle: float) -> Outcome:
    if Status.AT_BOUND in status.values():
        return Outcome.AT_BOUND
    if Status.NOT_IDENTIFIABLE in status.values():
        return Outcome.NOT_IDENTIFIABLE
    if solution.is_cavitating:
        return Outcome.CAVITATING
    descended = solution.gradient_cosine < right_angle or solution.mse_percent < 1e-8
    if solution.status == 0:
        return Outcome.CONVERGED if descended else Outcome.EVALUATION_LIMIT
    if not descended:
        return Outcome.NOT_FINITE if solution.failed_trials else Outcome.NO_DESCENT
    return Outcome.CONVERGED


def describe_fit(setting: Setting, judged: Judged, misfit: Misfit) -> Fit:
    """Return the `Fit` of a judged solution: figures per log, cavitation."""
    parameters = judged.solution.parameters
    logs, seen, misses, floors = [], [], [], []
    cycles = iter(misfit.cycles.cycles if misfit.cycles is not None else ())
    compared = judged.solution.seen or tuple(
        compare(parameters, trace, misfit.damper, solver=misfit.solver) for trace in misfit.traces
    )
    for trace, comparison in zip(misfit.traces, compared, strict=True):
        part = trace.compared
        measured, simulated = trace.force[part], comparison.force[part]
        mse = normalised_mse(measured, simulated)
        places = trace.places if len(trace.stretches) > 1 else ()
        alone = tuple(normalised_mse(measured[at], simulated[at]) for at in places) or (mse,)
        kept = SeenLog(
            parameters,
            trace,
            misfit.damper,
            misfit.solver,
            comparison.force.copy(),  # not a view that keeps more
            comparison.response.pressures.astype(np.float32),
            tuple(islice(cycles, len(trace.stretches))),
        )
        logs.append(LogFit(trace, mse, noise_floor(trace), alone, kept))
        seen.append((trace, comparison.response))
        misses.append(simulated - measured)
        floors.append(logs[-1].noise_floor_percent / 100.0 * np.var(measured) * len(measured))
    all_misses = np.concatenate(misses)
    total = misfit.deviation**2 * len(all_misses)
    return Fit(
        setting=setting,
        parameters=parameters,
        status=judged.status,
        outcome=judged.outcome,
        mse_percent=float(100.0 * np.sum(all_misses**2) / total),
        noise_floor_percent=float(100.0 * np.sum(floors) / total),
        n_samples=len(all_misses),
        n_cycles=sum(trace.n_cycles for trace in misfit.traces),
        evaluations=judged.solution.evaluations,
        cavitation=misfit.damper.examine(parameters, seen, solver=misfit.solver),
        logs=tuple(logs),
        warnings=(
            *_warnings(judged.solution),
            *judged.said,
            *said_of_speeds(misfit.facts, misfit.free, misfit.damper.quantities),
        ),
    )


def _warnings(solution: Solution) -> tuple[str, ...]:
    if not solution.failed_trials:
        return ()
    values = solution.parameters
    where = ", ".join(
        f"{one.symbol} {getattr(values, one.name):.3g}"
        for one in values.quantities
        if one.is_logarithmic
    )
    return (f"{solution.failed_trials} trial points could not be simulated, near {where}.",)
