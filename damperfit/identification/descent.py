"""The misfit of the logs of one setting and its descent, on log parameters, exact Jacobian.

The variables are u = ln y for the positive parameters and u = y/scale for an offset, so that a
step is a relative change and no positive parameter can change sign. The residual is
(f_hat - f)/(sigma sqrt(N)), f_hat filtered like f: its squared norm is eq. (22) over 100.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from damperfit.errors import FitCancelledError, SimulationError
from damperfit.identification.ends import RIGHT_ANGLE, End, falls_inside, stopped_at
from damperfit.identification.evaluation import (
    evaluate,
    n_independent,
    transformation,
    values_of,
)
from damperfit.identification.fit_facts import FitFacts
from damperfit.identification.last_step import (
    FORESEEN,
    LEAVES,
    LEAVES_TO_LOGS,
    UNSEEN,
    known_step,
    last_step,
    promised_step,
    step_among_kinks,
)
from damperfit.identification.looks import Looks, Seen
from damperfit.identification.minimiser import Minimum, Transformation, minimise
from damperfit.identification.plausible import (
    is_at_edge,
    kept_within,
)
from damperfit.identification.refinement import finer, solvers_percent
from damperfit.identification.solution import Solution
from damperfit.identification.trust_region import Stopping

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from damperfit.damper.model import Model, Values
    from damperfit.identification.settled import SettledLogs
    from damperfit.identification.solution import Earlier
    from damperfit.recording import Trace
    from damperfit.simulation import SolverOptions

    FloatArray = NDArray[np.float64]

__all__ = [
    "Misfit",
    "approach",
    "common_variables",
    "descend",
    "linearise",
]

# A relative change of the sum of squares below 1e-8 moves no parameter by 1 % of its error; a
# start for another descent needs no more than a per cent.
_FINE = Stopping(cost_tolerance=1e-8)
_ROUGH = Stopping(cost_tolerance=1e-2, rest=math.inf)
# On mean cycles a tenth of an error is near enough: the last step is taken on the logs.
_NEAR = Stopping(cost_tolerance=1e-5, step_tolerance=1e-6, rest=math.inf, least_share=1e-5)
_LIMIT = 0  # the status of a descent that ended at its limit of evaluations
# Where the misfit has kinks a descent may stop among them, at so many times the cosine that the
# promised fall would have.
_AMONG_KINKS = 1.5
_AMONG_KINKS_LEFT = 10.0  # times that share: a step that promises no more is not looked at
_LOOKED_AT = 0.1  # largest relative change of a value in a step that is taken and then looked at


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
    cycles : SettledLogs, optional
        What a descent goes down on before it ends on the logs; None: on the logs alone.
    earlier : Earlier, optional
        Where a descent with more free ended, which knows how far logs and mean cycles lie apart.
    is_followed : bool
        Whether a descent with less free follows, which takes the way between the minima from this.
    facts : FitFacts, optional
        What is asked of the traces again and again; of other traces others are made.
    """

    traces: tuple[Trace, ...]
    damper: Model
    free: tuple[str, ...]
    solver: SolverOptions
    max_evaluations: int
    cancelled: Callable[[], bool]
    cycles: SettledLogs | None = None
    earlier: Earlier | None = None
    is_followed: bool = False
    facts: FitFacts = field(default=FitFacts(()))

    def __post_init__(self) -> None:
        """See that the facts are those of the traces."""
        if self.facts.traces is not self.traces:
            object.__setattr__(self, "facts", FitFacts(self.traces))

    @property
    def whole(self) -> Misfit:
        """The same of the logs as they are."""
        return self if self.cycles is None else replace(self, cycles=None)

    @property
    def deviation(self) -> float:
        """Standard deviation of all measured forces that are compared, N."""
        return self.facts.deviation

    @property
    def scale(self) -> float:
        """What makes the sum of squares of a useless model 1."""
        return 1.0 / (self.deviation * math.sqrt(self.n_samples))

    @property
    def right_angle(self) -> float:
        """Largest cosine between residuals and Jacobian at the end of a descent."""
        return max(RIGHT_ANGLE, _AMONG_KINKS * math.sqrt(self.damper.kinks))

    @property
    def n_samples(self) -> int:
        """Samples compared."""
        return self.facts.n_samples


def approach(misfit: Misfit, start: Values) -> Solution:
    """Minimise the misfit of one log roughly, for the start of a descent with all of them.

    Of several logs the one with the strongest force is taken: it tells the valves best. Mean cycles
    are few samples: all are.

    Raises
    ------
    SimulationError
        When the model cannot be integrated at the start.
    FitCancelledError
        When the caller asked to stop.
    """
    rough = misfit
    if misfit.cycles is None:
        strongest = max(misfit.traces, key=lambda one: float(np.std(one.force[one.compared])))
        rough = replace(misfit, traces=(strongest,))
    return _descended(rough, misfit.free, start, _ROUGH).solution


def descend(misfit: Misfit, start: Values) -> Solution:
    """Minimise the misfit from a start; refine with a tighter integrator if that is what is left.

    Where the logs repeat the way goes over their mean cycles, and the logs themselves have the last
    word: a step on them that is no more than an error is taken without another look.

    Raises
    ------
    SimulationError
        When the model cannot be integrated at the start.
    FitCancelledError
        When the caller asked to stop.
    """
    return _ended(misfit, start).condensed


def _ended(misfit: Misfit, start: Values) -> Solution:
    """Where a descent ends, with the Jacobian that was at hand."""
    if misfit.cycles is None or misfit.max_evaluations == 1:
        return _to_the_end(misfit.whole, start)
    try:  # one evaluation is left to the logs
        there = _on_cycles(replace(misfit, max_evaluations=misfit.max_evaluations - 1), start)
    except SimulationError:
        return _to_the_end(misfit.whole, start)
    rest = max(misfit.max_evaluations - there.evaluations, 1)
    left = replace(misfit, cycles=None, max_evaluations=rest)
    if misfit.cancelled():
        raise FitCancelledError("stopped while a fit was running.")
    ended = None
    if there.status != _LIMIT:
        least = solvers_percent(misfit)
        ended = known_step(left, there, least_percent=least)
        if ended is None:
            ended = last_step(left, there, least_percent=least)
            if ended is not None and ended.apart is not None:
                apart = None if there.is_short else ended.apart - there.promised
                ended = replace(ended, apart=apart)
    ended = ended or _to_the_end(left, there.parameters)
    return ended.after(there.evaluations, there.failed_trials)


def _on_cycles(misfit: Misfit, start: Values) -> Solution:
    """Where a descent on the mean cycles ends, the last short step without a look."""
    is_exact = misfit.is_followed or misfit.earlier is not None
    nearest = UNSEEN if is_exact else FORESEEN
    there = _minimise(misfit, start, near=nearest)
    if there.status == _LIMIT:
        return there
    stepped = promised_step(misfit, there, longest=UNSEEN, leaves=LEAVES)
    if stepped is not None:
        return stepped
    if not is_exact:
        stepped = promised_step(misfit, there, longest=FORESEEN, leaves=LEAVES_TO_LOGS)
        if stepped is not None:
            return replace(stepped, is_short=True)
    stepped = promised_step(misfit, there, longest=nearest) or there
    left = replace(misfit, max_evaluations=max(misfit.max_evaluations - there.evaluations, 1))
    return _minimise(left, stepped.parameters).after(there.evaluations, there.failed_trials)


def _to_the_end(misfit: Misfit, start: Values) -> Solution:
    """Where a descent on the logs ends."""
    spent = 0
    if misfit.damper.kinks and misfit.max_evaluations > 1:
        near = _among_kinks(misfit, _minimise(replace(misfit, max_evaluations=1), start))
        if near.status != _LIMIT:
            return near
        start, spent = near.parameters, near.evaluations
    left = replace(misfit, max_evaluations=max(misfit.max_evaluations - spent, 1))
    solution = _minimise(left, start).after(spent)
    if solution.mse_percent > solvers_percent(misfit):
        return solution
    try:
        refined = _minimise(finer(misfit, solution.mse_percent), solution.parameters)
    except SimulationError:
        # The tighter integrator has failed where the other did not: what it found stands.
        return solution.after(1, 1)
    return refined.after(solution.evaluations, solution.failed_trials)


def _among_kinks(misfit: Misfit, first: Solution) -> Solution:
    """Go on from a first look at a law with kinks; where that ended, or may be gone on from.

    What needs the tighter integrator has it from the next look on. The last step is not looked at.
    """
    stepped = promised_step(misfit, first, longest=_LOOKED_AT) or first
    if first.mse_percent > solvers_percent(misfit):
        return stepped
    left = replace(finer(misfit, first.mse_percent), max_evaluations=misfit.max_evaluations - 1)
    try:
        near = _minimise(left, stepped.parameters, share=_AMONG_KINKS_LEFT * misfit.damper.kinks)
    except SimulationError:
        return stepped
    ended = step_among_kinks(misfit, near)
    return stepped.after(near.evaluations) if ended is None else ended.after(1)


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
    residuals, slopes, _ = evaluate(misfit, parameters, 1.0)
    return residuals, slopes * common_variables(misfit).slopes(values_of(misfit.free, parameters))


def common_variables(misfit: Misfit) -> Transformation:
    """Return the variables of `linearise`, which do not depend on a setting's forces."""
    sizes = np.array([misfit.damper.quantity(name).size for name in misfit.free])
    return replace(transformation(misfit, misfit.free), scales=sizes)


def _minimise(misfit: Misfit, start: Values, *, share: float = 0.0, near: float = 0.0) -> Solution:
    """Descend within the plausible ranges, until a step is short or promises little.

    A parameter that is at an edge of its range, or runs into it, is left there while the others
    go on, and let go once, should the misfit then fall into the range.
    """
    start = kept_within(start, misfit.free)
    moving = tuple(name for name in misfit.free if not is_at_edge(start, name))
    stopping = _FINE if misfit.cycles is None else _NEAR
    stopping = replace(stopping, least_share=max(stopping.least_share, share), near=near)
    best = _descended(misfit, moving, start, stopping)
    let_go: set[str] = set()
    while best.solution.status != _LIMIT:
        at, moving = best.solution.parameters, best.moving
        edge = stopped_at(best)
        if edge is not None:
            at = at.replace(dict([edge]))
            moving = tuple(name for name in moving if name != edge[0])
        else:
            inwards = falls_inside(misfit, best) - let_go
            if not inwards:
                break
            let_go |= inwards
            moving = tuple(name for name in misfit.free if name in inwards or name in moving)
        try:
            other = _descended(misfit, moving, at, stopping)
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


def _descended(misfit: Misfit, moving: tuple[str, ...], start: Values, stopping: Stopping) -> End:
    """Minimise over what moves; a trial point out of the plausible range is a failed trial."""
    start = kept_within(start, misfit.free)
    look = Looks(misfit, moving, start)
    stopping = replace(
        stopping,
        max_evaluations=misfit.max_evaluations,
        least_share=max(stopping.least_share, misfit.damper.kinks),
    )
    variables = transformation(misfit, moving)
    ended = _minimised(look, values_of(moving, start), variables, stopping)
    point = ended.point
    jacobian, gradient = point.system.triangle, point.system.gradient
    if moving != misfit.free:
        values = values_of(misfit.free, point.extra.parameters)
        jacobian = point.extra.slopes * transformation(misfit, misfit.free).slopes(values)
        gradient = jacobian.T @ point.residuals
    solution = Solution(
        parameters=point.extra.parameters,
        mse_percent=100.0 * point.cost,
        jacobian=jacobian,
        evaluations=ended.evaluations - look.beyond,
        failed_trials=ended.failed_trials - look.beyond,
        status=ended.status,
        gradient_cosine=ended.gradient_cosine,
        n_independent=n_independent(point.residuals),
        is_cavitating=point.extra.is_cavitating,
        gradient=gradient,
    )
    return End(solution, moving, variables.scales, ended, look.beyond > 0)


def _minimised(
    look: Looks, start: FloatArray, variables: Transformation, stopping: Stopping
) -> Minimum[Seen]:
    """Minimise; an end that was seen roughly is looked at closely, and gone on from."""
    ended = minimise(look, start, variables, stopping)
    if not ended.point.extra.is_rough or ended.status == _LIMIT:
        return ended
    left = max(stopping.max_evaluations - ended.evaluations, 1)
    look.look_closely()
    again = minimise(look, ended.point.values, variables, replace(stopping, max_evaluations=left))
    return replace(
        again,
        evaluations=again.evaluations + ended.evaluations,
        failed_trials=again.failed_trials + ended.failed_trials,
    )
