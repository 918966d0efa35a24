"""One setting's fit: descend, come back from the cavitating valley, and judge the result."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from damperfit.conditioning import noise_floor
from damperfit.damper.parameters import PARAMETER_NAMES, Parameters
from damperfit.damper.purdy.starting import cavitation_limit
from damperfit.errors import SimulationError
from damperfit.identification.cavitation import Cavitation, examine_cavitation
from damperfit.identification.descent import (
    RIGHT_ANGLE,
    Misfit,
    Solution,
    approach,
    descend,
)
from damperfit.identification.minimiser import inverse_information
from damperfit.identification.model_versus_log import compare, normalised_mse
from damperfit.identification.one_speed import ONE_SPEED, untold
from damperfit.identification.outcome import Outcome, Status
from damperfit.identification.plausible import PLAUSIBLE

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from damperfit.recording import Trace

__all__ = [
    "CHI_SQUARED_95",
    "EXCELLENT",
    "NOT_FIT_TO_SHARE",
    "NOT_FOUND",
    "Fit",
    "Judged",
    "LogFit",
    "describe_fit",
    "fit_guided",
    "fit_setting",
    "is_sound",
    "lacks_k_e_alone",
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
# Of one degree of freedom: what noise may make of the depth of a minimum.
CHI_SQUARED_95 = 3.84
# MSE in per cent that the paper calls excellent; the wrong valley's is about 2 %.
EXCELLENT = 1.0
# Starts for a damper that cavitates, in units of `cavitation_limit`: 1.5 and 5 times the onset.
_BEYOND_ONSET = (1.9, 6.0)


@dataclass(frozen=True, slots=True, eq=False)
class LogFit:
    """How one log of a setting is met by the setting's parameters.

    Attributes
    ----------
    trace : Trace
        The log as compared.
    mse_percent : float
        Eq. (22) over the log's steady whole cycles.
    noise_floor_percent : float
        What scatter between the cycles alone costs in the same measure; NaN for a single cycle.
    stretch_mse_percent : tuple of float
        Eq. (22) over each stretch of the log alone, by the stretch's own variance.
    """

    trace: Trace
    mse_percent: float
    noise_floor_percent: float
    stretch_mse_percent: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """One setting's parameters and how far the fit itself vouches for them.

    Attributes
    ----------
    setting : int
        Adjuster setting.
    parameters : Parameters
        SI values.
    status : dict of str to Status
        For each parameter: fitted, fixed, shared, at_bound or not_identifiable.
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

    setting: int
    parameters: Parameters
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
    def r_m3_cavitation_margin(self) -> float:
        """Fraction by which R_m3 may rise before a chamber cavitates on this motion."""
        return self.cavitation.r_m3_margin


@dataclass(frozen=True, slots=True, eq=False)
class Judged:
    """A solution with its verdict and rough relative errors, before report figures are added."""

    solution: Solution
    status: dict[str, Status]
    outcome: Outcome
    errors: Mapping[str, float] = field(default_factory=dict)


def fit_setting(misfit: Misfit, start: Parameters, *, spent: int = 0) -> Judged:
    """Fit the free parameters of one setting.

    When R_m3 is free and the descent ends unsound (cavitating, at a bound, or not identifiable),
    it is tried again by continuation from R_m3 below the onset of cavitation (`fit_guided`), and
    the better sound minimum is kept. Where that ends neither at a sound minimum nor at a good one
    that cavitates, further descents start beyond the onset.

    Parameters
    ----------
    misfit : Misfit
        Logs, damper and what is free.
    start : Parameters
        Where to start.
    spent : int
        Evaluations already spent on the start, added to the count.

    Raises
    ------
    SimulationError
        When the model cannot be integrated at any start.
    """
    first = _attempt(misfit, start, spent)
    if names := untold(misfit.traces, misfit.free):
        return _unspoken(first, names)
    if is_sound(first) or "r_m3" not in misfit.free:
        return first
    limit = cavitation_limit(misfit.traces, misfit.damper)
    best = _from_below_the_onset(misfit, replace(start, r_m3=min(start.r_m3, limit)), first)
    for factor in _BEYOND_ONSET:
        if is_sound(best) or _is_explained(best) or lacks_k_e_alone(best):
            break
        # What the closed form makes of cavitation, which it does not know, is an offset.
        offset = 0.0 if "f_0" in misfit.free else start.f_0
        best = _beyond_onset(misfit, replace(start, r_m3=factor * limit, f_0=offset), best)
    return best


def _from_below_the_onset(misfit: Misfit, start: Parameters, first: Judged) -> Judged:
    """The better of a result and of a descent that R_m3 begins below the onset of cavitation."""
    try:
        guided = approach(_without_rebound(misfit), start)
        spent = first.solution.evaluations + guided.evaluations
        return _choose(first, _attempt(misfit, guided.parameters, spent))
    except SimulationError:
        return first


def lacks_k_e_alone(judged: Judged) -> bool:
    """Whether a fit that does not cavitate is excellent and lacks nothing but K_e: rigid oil."""
    others = all(
        s in {Status.FITTED, Status.FIXED} for name, s in judged.status.items() if name != "k_e"
    )
    is_full = not judged.solution.is_cavitating and judged.status["k_e"] == Status.NOT_IDENTIFIABLE
    return others and is_full and judged.solution.mse_percent < EXCELLENT


def _unspoken(judged: Judged, names: tuple[str, ...]) -> Judged:
    """The same, of parameters that these logs cannot tell."""
    lost = {name: Status.NOT_IDENTIFIABLE for name in names if judged.status[name] is Status.FITTED}
    outcome = judged.outcome
    if outcome in {Outcome.CONVERGED, Outcome.CAVITATING}:
        outcome = Outcome.NOT_IDENTIFIABLE
    return replace(judged, status=judged.status | lost, outcome=outcome)


def _is_explained(judged: Judged) -> bool:
    """Whether a fit that cavitates is too good for the wrong valley, which an offset may hide."""
    is_excellent = judged.solution.mse_percent < EXCELLENT
    return judged.outcome is Outcome.CAVITATING and is_excellent and "f_0" not in judged.errors


def _beyond_onset(misfit: Misfit, start: Parameters, best: Judged) -> Judged:
    """The better of a result and of a descent that starts with a cavitating chamber."""
    try:
        evaluations = 0
        stages = ({"r_m3", "f_f", "f_0"}, *([{"f_0"}] if "f_0" in misfit.free else []))
        for held in stages:
            guided = approach(_holding(misfit, held), start)
            start, evaluations = guided.parameters, evaluations + guided.evaluations
        other = _attempt(misfit, start, evaluations)
    except SimulationError:
        return best
    is_better = other.solution.mse_percent * _CLEARLY_BETTER < best.solution.mse_percent
    chosen = other if is_better else best
    spent = best.solution.evaluations + other.solution.evaluations
    return replace(chosen, solution=replace(chosen.solution, evaluations=spent))


def fit_guided(misfit: Misfit, start: Parameters) -> Judged:
    """Fit with R_m3 and f_f held at the start first, then with everything free.

    At stiff settings R_m1 carries the rebound, and a start that is off in K_e lets R_m3 run into
    cavitation before the others have settled.
    """
    guided = approach(_without_rebound(misfit), start)
    return fit_setting(misfit, guided.parameters, spent=guided.evaluations)


def _without_rebound(misfit: Misfit) -> Misfit:
    return _holding(misfit, {"r_m3", "f_f"})


def _holding(misfit: Misfit, names: set[str]) -> Misfit:
    return replace(misfit, free=tuple(name for name in misfit.free if name not in names))


def is_sound(judged: Judged) -> bool:
    """Whether a fit ended at a minimum that means something."""
    return judged.outcome is Outcome.CONVERGED


def _choose(first: Judged, second: Judged) -> Judged:
    spent = second.solution.evaluations
    first = replace(first, solution=replace(first.solution, evaluations=spent))
    if is_sound(second):
        much_better = (
            first.solution.mse_percent * _CLEARLY_BETTER < second.solution.mse_percent
            and first.outcome is Outcome.CAVITATING
        )
        return first if much_better else second
    return first if first.solution.mse_percent <= second.solution.mse_percent else second


def _attempt(misfit: Misfit, start: Parameters, spent: int) -> Judged:
    solution = descend(misfit, start)
    solution = replace(solution, evaluations=solution.evaluations + spent)
    status = _statuses(misfit, solution)
    errors = dict(zip(misfit.free, relative_errors(solution).tolist(), strict=True))
    return Judged(solution, status, _outcome(solution, status), errors)


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


def _statuses(misfit: Misfit, solution: Solution) -> dict[str, Status]:
    status = dict.fromkeys(PARAMETER_NAMES, Status.FIXED)
    errors = relative_errors(solution)
    for name, error in zip(misfit.free, errors, strict=True):
        value = getattr(solution.parameters, name)
        status[name] = Status.FITTED
        if name == "f_0":
            continue
        low, high = PLAUSIBLE[name]
        if name == "f_f":
            low = max(low, _NO_FRICTION * misfit.deviation if error > NOT_FOUND else low)
        if name == "k_e" and value >= high:
            status[name] = Status.NOT_IDENTIFIABLE  # rigid oil is no fault: there is no upper limit
        elif not low < value < high:
            status[name] = Status.AT_BOUND
        elif error > NOT_FOUND:
            status[name] = Status.NOT_IDENTIFIABLE
    return status


def _outcome(solution: Solution, status: Mapping[str, Status]) -> Outcome:
    if Status.AT_BOUND in status.values():
        return Outcome.AT_BOUND
    if Status.NOT_IDENTIFIABLE in status.values():
        return Outcome.NOT_IDENTIFIABLE
    if solution.is_cavitating:
        return Outcome.CAVITATING
    descended = solution.gradient_cosine < RIGHT_ANGLE or solution.mse_percent < 1e-8
    if solution.status == 0:
        return Outcome.CONVERGED if descended else Outcome.EVALUATION_LIMIT
    if not descended:
        return Outcome.NOT_FINITE if solution.failed_trials else Outcome.NO_DESCENT
    return Outcome.CONVERGED


def describe_fit(setting: int, judged: Judged, misfit: Misfit) -> Fit:
    """Return the `Fit` of a judged solution: figures per log, cavitation."""
    parameters = judged.solution.parameters
    logs, seen, misses, floors = [], [], [], []
    for trace in misfit.traces:
        comparison = compare(parameters, trace, misfit.damper, solver=misfit.solver)
        part = trace.compared
        measured, simulated = trace.force[part], comparison.force[part]
        alone = tuple(normalised_mse(measured[at], simulated[at]) for at in trace.places)
        mse = normalised_mse(measured, simulated)
        logs.append(LogFit(trace, mse, noise_floor(trace), alone))
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
        cavitation=examine_cavitation(parameters, seen, misfit.damper, solver=misfit.solver),
        logs=tuple(logs),
        warnings=(
            *_warnings(judged.solution),
            *((ONE_SPEED,) if untold(misfit.traces, misfit.free) else ()),
        ),
    )


def _warnings(solution: Solution) -> tuple[str, ...]:
    if not solution.failed_trials:
        return ()
    p = solution.parameters
    where = f"R_m1 {p.r_m1:.3g}, R_m2 {p.r_m2:.3g}, R_m3 {p.r_m3:.3g}, K_e {p.k_e:.3g}"
    return (f"{solution.failed_trials} trial points could not be simulated, near {where}.",)
