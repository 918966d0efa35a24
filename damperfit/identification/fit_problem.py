"""What is fitted at one setting: its logs, a model, what is free; residuals, derivatives.

The variables of a fit are u = ln y for positive quantities and u = y/size for linear ones, so that
a step is a relative change and no positive quantity changes its sign. Residuals are model minus
measurement, both behind the same filter, over the logs or over their mean cycles. Bounds are the
plausible ranges of the model's quantities.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import TYPE_CHECKING, ClassVar, NamedTuple

import numpy as np

from damperfit.conditioning import apply_filter
from damperfit.errors import FitCancelledError, SimulationError
from damperfit.identification.least_squares import Minimum, Stopping, Transformation, minimise
from damperfit.identification.log_facts import LogFacts
from damperfit.identification.mean_cycle import SettledLogs, settled
from damperfit.simulation import motion_of, simulate
from damperfit.statistics import largest_of

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Sequence
    from typing import Self

    from numpy.typing import NDArray

    from damperfit.damper.model import Model, Values
    from damperfit.recording import Trace
    from damperfit.simulation import Response, SolverOptions

    FloatArray = NDArray[np.float64]

__all__ = [
    "FitProblem",
    "LawMisfit",
    "Point",
    "common_variables",
    "edge_of",
    "is_at_edge",
    "is_within",
    "kept_within",
    "linearise",
    "n_independent",
    "values_of",
    "with_values",
]

# A force or a sensitivity, SI; a cylinder of the size of a car stays far below.
_WILD = 1e100
# A value that went through its logarithm and back may be this much beyond the edge it came from.
_ROUNDED = 1e-9
# Of the force's deviation: what a step of the integrator may err by while structures are compared
# on mean cycles. It moves no quantity by a third of its error.
_COARSE = 2e-4
# Below this misfit (times the integrator's tolerance, N) its own error moves what is found. It is
# then kept to this share of the misfit, or of the tolerance where less than that is left.
_POLISH_BELOW = 100.0
_POLISH_FACTOR = 0.003
# A fit that meets none of MINPACK's tests has still reached its minimum when the residual is this
# close to a right angle with every direction of the Jacobian; a misfit with kinks may stop at so
# many times the cosine that the least promised fall would have.
_RIGHT_ANGLE = 1e-3
_AMONG_KINKS = 1.5


class Point(NamedTuple):
    """What a fit remembers of a point: its values, cavitation, independent residuals."""

    values: Values
    is_cavitating: bool
    n_independent: float


@dataclass(frozen=True, slots=True, eq=False)
class FitProblem:
    """The logs of one setting, a model, and what is free.

    Attributes
    ----------
    model : Model
        The damper's model; the ranges of its quantities are the bounds.
    traces : tuple of Trace
        Logs of one setting.
    free : tuple of str
        Values that may move; the others stay as the start has them.
    solver : SolverOptions
        How exactly to integrate.
    cycles : SettledLogs, optional
        Mean cycles that stand for the logs; None: the logs themselves.
    cancelled : callable
        Asked before each evaluation.
    max_evaluations : int
        Limit of simulations of a fit.
    facts : LogFacts, optional
        What is asked of the traces again and again; of other traces others are made.
    """

    model: Model
    traces: tuple[Trace, ...]
    free: tuple[str, ...]
    solver: SolverOptions
    cycles: SettledLogs | None = None
    cancelled: Callable[[], bool] = lambda: False
    max_evaluations: int = 100
    facts: LogFacts = field(default=LogFacts(()))
    stays_beyond: ClassVar[bool] = False

    def __post_init__(self) -> None:
        """See that the facts are those of the traces."""
        if self.facts.traces is not self.traces:
            object.__setattr__(self, "facts", LogFacts(self.traces))

    @property
    def whole(self) -> Self:
        """The same of the logs as they are."""
        return self if self.cycles is None else replace(self, cycles=None)

    def on_cycles(self) -> Self:
        """Return the problem of thinned mean cycles, for comparing, where the logs have them."""
        tolerance = max(self.solver.tolerance, _COARSE * self.deviation)
        cycles = settled(self.traces)
        if cycles is None:
            return self
        return replace(self, solver=replace(self.solver, tolerance=tolerance), cycles=cycles)

    @property
    def deviation(self) -> float:
        """Standard deviation of all measured forces that are compared, N."""
        return self.facts.deviation

    @property
    def n_samples(self) -> int:
        """Samples compared."""
        return self.facts.n_samples

    @property
    def scale(self) -> float:
        """What makes the sum of squares of a useless model 1."""
        return 1.0 / (self.deviation * math.sqrt(self.n_samples))

    @property
    def scatter(self) -> float:
        """The sum of squares that no model takes away, as far as it is known, scaled."""
        return 0.0 if self.cycles is None else self.cycles.scatter * self.scale**2

    @property
    def right_angle(self) -> float:
        """Largest cosine between residuals and Jacobian at a minimum."""
        return max(_RIGHT_ANGLE, _AMONG_KINKS * math.sqrt(self.model.kinks))

    @property
    def solvers_percent(self) -> float:
        """The misfit, as an MSE, below which the integrator's error may be what is left."""
        return 100.0 * (_POLISH_BELOW * self.solver.tolerance / self.deviation) ** 2

    def refined(self, mse_percent: float) -> FitProblem:
        """Return the same with a tighter integrator, for what is left at an MSE."""
        left = self.deviation * math.sqrt(mse_percent / 100.0)
        tolerance = _POLISH_FACTOR * max(self.solver.tolerance, left)
        return replace(self, solver=replace(self.solver, tolerance=tolerance))

    def variables(self, names: Sequence[str]) -> Transformation:
        """Return logarithms; an offset in units of the force's deviation, others of their size."""
        quantities = [self.model.quantity(name) for name in names]
        return Transformation(
            np.array([one.is_logarithmic for one in quantities], dtype=bool),
            np.array([self.deviation if one.is_offset else one.size for one in quantities]),
        )

    def is_at_edge(self, values: Values, name: str) -> bool:
        """Whether a quantity has run to a bound."""
        low, high = self.model.quantity(name).plausible
        return not low < getattr(values, name) < high

    def cost(self, values: Values) -> float:
        """Return the scaled sum of squares at a point, without derivatives.

        Raises
        ------
        SimulationError
            The model cannot be simulated there.
        """
        residuals = self.rows(values, ())[0] * self.scale
        return float(residuals @ residuals)

    def minimise(self, start: Values, stopping: Stopping) -> Minimum[Point]:
        """Minimise the scaled sum of squares within the bounds.

        Raises
        ------
        SimulationError
            The model cannot be simulated at the start.
        FitCancelledError
            The caller asked to stop.
        """
        free, scale = self.free, self.scale
        ranges = [self.model.quantity(name).plausible for name in free]
        low, high = (np.array([one[side] for one in ranges]) for side in (0, 1))

        def residuals(numbers: FloatArray) -> tuple[FloatArray, FloatArray, Point]:
            within = np.clip(numbers, low, high) if self.stays_beyond else numbers
            values = with_values(start, free, within)
            rows, is_cavitating = self.evaluate(values, free)
            rows *= scale
            if self.stays_beyond:
                rows[1:][within != numbers] = 0.0  # beyond the bound nothing changes any more
            return rows[0], rows[1:].T, Point(values, is_cavitating, n_independent(rows[0]))

        numbers = np.clip(values_of(free, start), low, high)
        bounds = None if self.stays_beyond else (low, high)
        return minimise(residuals, numbers, self.variables(free), stopping, bounds)

    def descend(self, start: Values, stopping: Stopping) -> Minimum[Values]:
        """Minimise as `minimise`; of the point found only the values are kept."""
        ended = self.minimise(start, stopping)
        return replace(ended, extra=ended.extra.values)  # type: ignore[arg-type,return-value]

    def rows(self, values: Values, names: Sequence[str]) -> FloatArray:
        """Return residuals and their derivatives by some names, weighted, N: (1 + k, n)."""
        return self.evaluate(values, names)[0]

    def evaluate(self, values: Values, names: Sequence[str]) -> tuple[FloatArray, bool]:
        """Return `rows`, and whether a chamber is empty where it counts.

        Raises
        ------
        SimulationError
            The model cannot be simulated, or its force is beyond anything that could be fitted.
        FitCancelledError
            The caller asked to stop.
        """
        if self.cancelled():
            raise FitCancelledError("stopped while a fit was running.", code="cancelled")
        parts = (
            self._of_logs(values, names)
            if self.cycles is None
            else self._of_cycles(self.cycles, values, names)
        )
        blocks, empty = zip(*parts, strict=True)
        rows = blocks[0] if len(blocks) == 1 else np.hstack(blocks)
        if not largest_of(rows) < _WILD:  # "not <" catches NaN too
            raise SimulationError(
                "simulation failed: the force is beyond anything that could be fitted.",
                code="force-beyond",
            )
        return rows, any(empty)

    def _of_logs(self, values: Values, names: Sequence[str]) -> Iterable[tuple[FloatArray, bool]]:
        for trace, weight in zip(self.traces, self.facts.weights, strict=True):
            motion = motion_of(trace)
            response = simulate(
                values, self.model, motion, sensitivities=names, options=self.solver
            )
            rows = np.stack([response.force, *response.sensitivities.values()])
            rows = apply_filter(trace.model_filter, rows)[:, trace.compared]
            rows[0] -= trace.force[trace.compared]
            empty = _is_empty(response, trace.compared, weight)
            yield rows if weight is None else rows * weight, empty

    def _of_cycles(
        self, cycles: SettledLogs, values: Values, names: Sequence[str]
    ) -> Iterable[tuple[FloatArray, bool]]:
        """The mean cycles; what differs between cycles is the last residual."""
        for one in cycles.cycles:
            options = one.solver(self.solver)
            response = simulate(
                values, self.model, one.motion, sensitivities=names, options=options
            )
            yield one.rows(response), _is_empty(response, slice(-len(one.force), None), one.factor)
        rest = np.zeros((1 + len(names), 1))
        rest[0] = math.sqrt(cycles.scatter)
        yield rest, False


class LawMisfit(FitProblem):
    """The problem of a candidate structure on the logs of one setting, for comparing structures.

    What runs beyond its range stays there for good: with the bounds of every other fit the search
    takes other paths (ablation "clip": of other laws 2 it loses the blow-off in compression, held
    out 0.019 to 0.059 %).

    A rig's cell is zeroed anew between the logs of a setting: where the offset is free, each log
    but the first has its own beside it, which is eliminated.
    """

    __slots__ = ()
    stays_beyond: ClassVar[bool] = True

    @property
    def offset(self) -> str | None:
        """The force offset that each log has for itself; None where logs have one in common."""
        if len(self.traces) < 2:
            return None
        return next((name for name in self.free if self.model.quantity(name).is_offset), None)

    def evaluate(self, values: Values, names: Sequence[str]) -> tuple[FloatArray, bool]:
        """Return rows of residuals and derivatives, and whether a chamber is empty."""
        offset = self.offset
        if offset is None:
            return super().evaluate(values, names)
        asked = names if offset in names else (*names, offset)
        rows, is_empty = super().evaluate(values, asked)
        along = rows[1 + list(asked).index(offset)].copy()
        ends = np.cumsum(self._lengths())
        for first, last in pairwise(ends.tolist()):
            part, unit = rows[:, first:last], along[first:last]
            part -= np.outer(part @ unit / max(float(unit @ unit), 1e-300), unit)
        return rows[: 1 + len(names)], is_empty

    def _lengths(self) -> list[int]:
        """How many residuals each log has."""
        if self.cycles is None:
            return [trace.n_samples for trace in self.traces]
        lengths = iter(len(one.force) for one in self.cycles.cycles)
        return [sum(next(lengths) for _ in trace.stretches) for trace in self.traces]

    def absent_beside(self, known: Collection[str]) -> dict[str, float]:
        """Return values of what a law has beside some quantities at which it does nothing to them.

        A bleed that has its laminar share does without an orifice where that is wide, and not where
        it is closed.

        Parameters
        ----------
        known : collection of str
            What there is without it.
        """
        absent = {}
        for name in (name for name in self.free if name not in known):
            one = self.model.quantity(name)
            is_beside = one.part == "bleed" and f"{one.stroke}_leak" in known
            absent[name] = one.plausible[0] if is_beside else one.vanishes_at
        return absent


def _is_empty(
    response: Response, compared: slice | NDArray[np.intp], weight: FloatArray | None
) -> bool:
    """Whether a chamber of oil is empty in a compared sample that has a weight."""
    oil = response.pressures[:2, compared]
    if not np.minimum.reduce(oil, axis=None) <= 0.0:
        return False
    is_empty = (oil <= 0.0).any(axis=0)
    return bool((is_empty if weight is None else is_empty & (weight > 0.0)).any())


def linearise(problem: FitProblem, values: Values) -> tuple[FloatArray, FloatArray]:
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
    rows = problem.rows(values, problem.free)
    slopes = common_variables(problem).slopes(values_of(problem.free, values))
    return rows[0], rows[1:].T * slopes


def common_variables(problem: FitProblem) -> Transformation:
    """Return the variables of `linearise`, which do not depend on a setting's forces."""
    sizes = np.array([problem.model.quantity(name).size for name in problem.free])
    return problem.variables(problem.free)._replace(scales=sizes)


def values_of(names: Sequence[str], values: Values) -> FloatArray:
    """Return the numbers of some names, shape (k,)."""
    return np.array([getattr(values, name) for name in names])


def with_values(values: Values, names: Sequence[str], numbers: FloatArray) -> Values:
    """Return values with other numbers of some names."""
    return values.replace(dict(zip(names, numbers.tolist(), strict=True)))


def n_independent(residuals: FloatArray) -> float:
    """Return how many independent samples residuals are worth: twice their sign changes."""
    signs = np.signbit(residuals)
    return max(2.0 * float(np.count_nonzero(signs[1:] != signs[:-1])), 1.0)


def is_within(values: Values, names: Iterable[str]) -> bool:
    """Whether the named quantities lie in their ranges, edges and rounding included."""
    for name in names:
        low, high = values.quantity(name).plausible
        value = getattr(values, name)
        if not low - _ROUNDED * abs(low) <= value <= high + _ROUNDED * abs(high):
            return False
    return True


def is_at_edge(values: Values, name: str) -> bool:
    """Whether a quantity is at an edge of its range."""
    return getattr(values, name) in values.quantity(name).plausible


def edge_of(values: Values, name: str) -> tuple[str, float]:
    """Return on which side a quantity ran out of its range, "below" or "above", and where.

    Examples
    --------
    A friction of 2.65e-261 N that may be 0.001 N at least: ``("below", 0.001)``.
    """
    low, high = values.quantity(name).plausible
    value = getattr(values, name)
    if value < 0.99 * high:  # a friction within its range that is nothing beside the noise, too
        return "below", max(value, low)
    return "above", min(value, high)


def kept_within(values: Values, names: Iterable[str]) -> Values:
    """Return values with the named ones brought to the edge that they are beyond."""
    brought = {}
    for name in names:
        low, high = values.quantity(name).plausible
        value = getattr(values, name)
        if not low <= value <= high:
            brought[name] = low if value < low else high
    return values.replace(brought) if brought else values
