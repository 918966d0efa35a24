"""What is fitted: logs of settings, a model, what is free, what settings share; and its minimum.

The variables of a fit are u = ln y for positive quantities and u = y/size for linear ones, so that
a step is a relative change and no positive quantity changes its sign. Residuals are model minus
measurement, both behind the same filter, over the logs or over their mean cycles. Bounds are the
plausible ranges of the model's quantities.

A setting is a `Block` of residuals. A `FitProblem` is blocks with what they share; a setting alone
is one block that shares nothing. What follows an adjuster is shared by the settings with the same
click of it, and stands in the border of the Jacobian with what all of them share.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from damperfit.arrays import FloatArray
from damperfit.conditioning.filters import apply_filter
from damperfit.damper.model import Model, Values
from damperfit.errors import FitCancelledError, SimulationError
from damperfit.identification.least_squares import (
    LinearSystem,
    Minimum,
    Stopping,
    Transformation,
    finite_system,
    iterate,
    reduced,
)
from damperfit.identification.logs import LogFacts, SettledLogs, settled
from damperfit.identification.outcome import SettingError, attempted
from damperfit.identification.sharing import (
    GAS_FOLLOWER,
    GAS_NAMES,
    Follows,
    GasLaw,
    Unknown,
    unknown_at,
    unknowns_of,
)
from damperfit.problem import Failure
from damperfit.recording import Trace
from damperfit.simulation import Response, SolverOptions, motion_of, simulate
from damperfit.statistics import largest_of
from damperfit.tested.setting import Setting
from damperfit.workers import InTurn, Threads, executor

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
# Weights of settings beside each other that are this near those of the end move nothing.
_SAME_WEIGHT = 1.5
# What a factor of e costs of a number that logs leave open, as a share of a setting's misfit:
# its root. Without it such numbers run to where a simulation takes longest.
_HELD = 0.02
# Friction of a car damper's seals, N, and the deviation of its logarithm: 5 to 100 N are believed.
# A low preload beside several times the friction fits what a higher one does.
BELIEVED_FRICTION, FRICTION_SPREAD = 22.0, 0.75
# What a deviation from it costs, as a share of what is left at a setting: its root.
_UNBELIEVED = 0.1
_ALONE = Setting(())


class Point(NamedTuple):
    """What a fit remembers of a point, by setting."""

    values: Mapping[Setting, Values]
    mean_squares: Mapping[Setting, float]  # of the residuals, N^2
    n_independent: Mapping[Setting, float]  # twice their sign changes
    is_cavitating: bool  # a chamber is empty somewhere in what is compared
    weights: Mapping[Setting, float]  # of the squares of each setting
    gas: GasLaw | None

    @property
    def is_fairly_weighed(self) -> bool:
        """Whether the weights are those that this point gives but for what moves nothing."""
        shifts = [s * self.weights[k] for k, s in self.mean_squares.items()]
        return max(shifts) <= _SAME_WEIGHT * min(shifts)


@dataclass(frozen=True, slots=True, eq=False)
class Block:
    """The residuals of the logs of one setting."""

    model: Model  # the ranges of its quantities are the bounds
    traces: tuple[Trace, ...]
    free: tuple[str, ...]  # values that may move; the others stay as the start has them
    solver: SolverOptions
    cycles: SettledLogs | None = None  # mean cycles that stand for the logs
    cancelled: Callable[[], bool] = lambda: False  # asked before each evaluation
    max_evaluations: int = 100  # of a fit
    # Of a structure that is compared with others. What runs beyond its range stays there for good:
    # with bounds the search takes other paths (ablation "clip": of other laws 2 it loses the
    # blow-off in compression, held out 0.019 to 0.059 %). A rig's cell is zeroed anew between the
    # logs of a setting: where the offset is free, each log but the first has its own beside it,
    # which is eliminated.
    is_candidate: bool = False
    facts: LogFacts = field(default=LogFacts(()))  # of the traces; of others they are made anew

    def __post_init__(self) -> None:
        """See that the facts are those of the traces."""
        if self.facts.traces is not self.traces:
            object.__setattr__(self, "facts", LogFacts(self.traces))

    @property
    def stays_beyond(self) -> bool:
        """Whether what runs beyond its range stays there."""
        return self.is_candidate

    @property
    def offset(self) -> str | None:
        """The force offset that each log of a candidate has for itself; None where none has."""
        if not self.is_candidate or len(self.traces) < 2:
            return None
        return next((name for name in self.free if self.model.quantity(name).is_offset), None)

    @property
    def whole(self) -> Block:
        """The same of the logs as they are."""
        return self if self.cycles is None else replace(self, cycles=None)

    def on_cycles(self) -> Block:
        """The block of thinned mean cycles, for comparing, where the logs have them."""
        cycles = settled(self.traces)
        if cycles is None:
            return self
        tolerance = max(self.solver.tolerance, _COARSE * self.deviation)
        return replace(self, solver=replace(self.solver, tolerance=tolerance), cycles=cycles)

    @property
    def deviation(self) -> float:
        """Standard deviation of all measured forces that are compared, N."""
        return self.facts.deviation

    @property
    def scale(self) -> float:
        """What makes the sum of squares of a useless model 1."""
        return 1.0 / (self.deviation * math.sqrt(self.facts.n_samples))

    @property
    def scatter(self) -> float:
        """The sum of squares that no model takes away, as far as it is known, scaled."""
        return 0.0 if self.cycles is None else self.cycles.scatter * self.scale**2

    @property
    def solvers_percent(self) -> float:
        """The misfit, as an MSE, below which the integrator's error may be what is left."""
        return 100.0 * (_POLISH_BELOW * self.solver.tolerance / self.deviation) ** 2

    def refined(self, mse_percent: float) -> Block:
        """The same with a tighter integrator, for what is left at an MSE."""
        left = self.deviation * math.sqrt(mse_percent / 100.0)
        tolerance = _POLISH_FACTOR * max(self.solver.tolerance, left)
        return replace(self, solver=replace(self.solver, tolerance=tolerance))

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """The plausible ranges of what is free, (k,) each."""
        ranges = [self.model.quantity(name).plausible for name in self.free]
        return np.array([edge[0] for edge in ranges]), np.array([edge[1] for edge in ranges])

    @property
    def variables(self) -> Transformation:
        """Logarithms of what is free; an offset in units of the force's deviation."""
        quantities = [self.model.quantity(name) for name in self.free]
        return Transformation(
            np.array([quantity.is_logarithmic for quantity in quantities], dtype=bool),
            np.array([self.deviation if q.is_offset else q.size for q in quantities]),
        )

    @property
    def common_variables(self) -> Transformation:
        """The same with each linear quantity in its size, whatever the setting's forces are."""
        sizes = np.array([self.model.quantity(name).size for name in self.free])
        return self.variables._replace(scales=sizes)

    def cost(self, values: Values) -> float:
        """The scaled sum of squares at a point, without derivatives."""
        residuals = self.rows(values, ())[0] * self.scale
        return float(residuals @ residuals)

    def minimise(self, start: Values, stopping: Stopping) -> Minimum[Point]:
        """Minimise the scaled sum of squares of this setting alone."""
        return FitProblem({_ALONE: self}).minimise({_ALONE: start}, stopping)

    def descend(self, start: Values, stopping: Stopping) -> Minimum[Values]:
        """Minimise as `minimise`; of the point found only the values are kept."""
        minimum = self.minimise(start, stopping)
        return replace(minimum, extra=minimum.extra.values[_ALONE])  # type: ignore[arg-type,return-value]

    def rows(self, values: Values, names: Sequence[str]) -> FloatArray:
        """Residuals and their derivatives by some names, weighted, N: (1 + k, n)."""
        return self.evaluate(values, names)[0]

    def evaluate(self, values: Values, names: Sequence[str]) -> tuple[FloatArray, bool]:
        """The rows, and whether a chamber is empty where it counts."""
        if self.cancelled():
            raise FitCancelledError("stopped while a fit was running.", code="cancelled")
        offset = self.offset
        asked = names if offset is None or offset in names else (*names, offset)
        parts, empty = zip(*self._parts(values, asked), strict=True)
        rows = parts[0] if len(parts) == 1 else np.hstack(parts)
        if not largest_of(rows) < _WILD:  # "not <" catches NaN too
            raise SimulationError(
                "simulation failed: the force is beyond anything that could be fitted.",
                code="force-beyond",
            )
        if offset is not None:
            along = rows[1 + list(asked).index(offset)].copy()
            lengths = iter(part.shape[1] for part in parts)
            n_parts = [1 if self.cycles is None else len(trace.segments) for trace in self.traces]
            ends = np.cumsum([sum(next(lengths) for _ in range(n)) for n in n_parts])
            for first, last in pairwise(ends.tolist()):
                part, unit = rows[:, first:last], along[first:last]
                part -= np.outer(part @ unit / max(float(unit @ unit), 1e-300), unit)
        return rows[: 1 + len(names)], any(empty)

    def _parts(self, values: Values, names: Sequence[str]) -> Iterator[tuple[FloatArray, bool]]:
        """The rows of each log, or of each mean cycle, and whether a chamber is empty there."""
        law = values, self.model
        if self.cycles is None:
            for trace, weight in zip(self.traces, self.facts.weights, strict=True):
                motion = motion_of(trace)
                response = simulate(*law, motion, sensitivities=names, options=self.solver)
                rows = np.stack([response.force, *response.sensitivities.values()])
                rows = apply_filter(trace.model_filter, rows)[:, trace.compared]
                rows[0] -= trace.force[trace.compared]
                empty = _is_empty(response, trace.compared, weight)
                yield rows if weight is None else rows * weight, empty
            return
        for cycle in self.cycles.cycles:
            options = cycle.solver(self.solver)
            response = simulate(*law, cycle.motion, sensitivities=names, options=options)
            compared = slice(-len(cycle.force), None)
            yield cycle.rows(response), _is_empty(response, compared, cycle.factor)
        rest = np.zeros((1 + len(names), 1))
        rest[0] = math.sqrt(self.cycles.scatter)  # what differs between cycles
        yield rest, False

    def absent_beside(self, known: Collection[str]) -> dict[str, float]:
        """Values of what is free beside some quantities at which it does nothing to them."""
        # A bleed with its laminar share does without an orifice that is wide, not one closed.
        absent = [self.model.quantity(name) for name in self.free if name not in known]
        wide = {q.name for q in absent if q.part == "bleed" and q.beside("leak") in known}
        return {q.name: q.plausible[0] if q.name in wide else q.vanishes_at for q in absent}


@dataclass(frozen=True, slots=True, eq=False)
class FitProblem:
    """Settings that are fitted together, and what they share.

    With a gas content V_r and K_B/C are shared in place of K_e, by the chain rule. Of candidates
    everything is shared or follows adjusters, and is held near where it began, friction near what
    seals have.
    """

    blocks: Mapping[Setting, Block]  # with the same quantities free
    shared: tuple[str, ...] = ()  # quantities that settings have in common
    follows: Follows = field(default_factory=dict)  # adjusters that some of them follow
    held: frozenset[Unknown] = frozenset()  # unknowns that stay as the starts have them
    gas: GasLaw | None = None  # where K_e, which is free, starts from
    # Of the settings' squares; None: 1/N^2 by what the start leaves, of one setting alone by what a
    # useless model would leave; those of candidates are in units of that.
    weights: Mapping[Setting, float] | None = None
    jobs: int = 1  # threads

    @property
    def settings(self) -> tuple[Setting, ...]:
        """By rising setting."""
        return tuple(sorted(self.blocks))

    @property
    def free(self) -> tuple[str, ...]:
        """Values of a setting that move."""
        return self.blocks[self.settings[0]].free

    @property
    def variables(self) -> tuple[str, ...]:
        """What a setting's columns are by: its parameters, but for K_e those of its law."""
        if self.gas is None:
            return self.free
        return (*(name for name in self.free if name != GAS_FOLLOWER), *GAS_NAMES)

    @property
    def border(self) -> tuple[Unknown, ...]:
        """The shared unknowns that move, in the order of the variables."""
        shared = [name for name in self.variables if name in {*self.shared, *GAS_NAMES}]
        unknowns = unknowns_of(shared, self.follows, self.settings)
        return tuple(unknown for unknown in unknowns if unknown not in self.held)

    def minimise(self, starts: Mapping[Setting, Values], stopping: Stopping) -> Minimum[Point]:
        """Minimise the weighted sum of squares within the bounds.

        A start that cannot be simulated: a `SimulationError`, of several settings a `SettingError`.
        """
        with executor(self.jobs) as pool:
            stacked = _Stacked(self, starts, pool)
            try:
                return iterate(stacked.point_at, stacked.start, stopping, stacked.bounds)
            except _BugError as bug:
                raise bug.error from bug


# Residuals of a setting and their derivatives by its variables, or a triangle that stands for them.
_Part = tuple[FloatArray, FloatArray]


class _BugError(Exception):
    """Passes through the loop, which takes a `SettingError` for a failed trial."""

    def __init__(self, error: SettingError) -> None:
        self.error = error


class _Stacked:
    """All settings as a function of one vector: own variables by setting, then the shared ones."""

    def __init__(
        self, problem: FitProblem, starts: Mapping[Setting, Values], pool: InTurn | Threads
    ) -> None:
        self.problem, self.starts, self.pool = problem, starts, pool
        settings, names, border = problem.settings, problem.variables, problem.border
        first = problem.blocks[settings[0]]
        self.is_alone = len(settings) == 1 and not border
        self.is_dense = first.is_candidate and not self.is_alone
        self.stays_beyond = first.stays_beyond
        self.weights = dict(problem.weights or {})
        if self.is_alone and not self.weights:
            self.weights = {settings[0]: first.scale**2}
        self.transformation = first.variables if self.is_alone else first.common_variables
        if self.is_dense:
            deviation = np.mean([block.deviation for block in problem.blocks.values()])
            self.transformation = first.variables._replace(scales=np.full(len(names), deviation))
        shared = {*problem.shared, *GAS_NAMES}
        keys: dict[Setting, list[Unknown | tuple[str, Setting]]] = {
            s: [unknown_at(n, problem.follows, s) if n in shared else (n, s) for n in names]
            for s in settings
        }
        own = (key for mine in keys.values() for key in mine if not isinstance(key, Unknown))
        self.place = {key: k for k, key in enumerate((*own, *border))}
        # Of each setting: which of its variables move, and where they stand in the vector.
        self.moving = {s: np.array([k in self.place for k in keys[s]], dtype=bool) for s in keys}
        self.places = {
            s: np.array([self.place[k] for k in mine if k in self.place], dtype=np.intp)
            for s, mine in keys.items()
        }
        self.ranges = first.bounds
        numbers = {s: np.clip(values_of(problem.free, starts[s]), *self.ranges) for s in settings}
        self.packed = self._packed(numbers, problem.gas)
        self.start = self._stacked(self.packed)
        edges = (self._packed(dict.fromkeys(numbers, edge), None) for edge in self.ranges)
        low, high = map(self._stacked, edges)
        if problem.gas is not None:  # the law's own two, last, have none
            low[-len(GAS_NAMES) :], high[-len(GAS_NAMES) :] = -math.inf, math.inf
        self.bounds = None if self.stays_beyond else (low, high)
        # Of the border: what it is held at, and how strongly; 0 of what has no logarithm.
        tied = [first.model.quantity(unknown.name) for unknown in border] if self.is_dense else []
        is_log = np.array([quantity.is_logarithmic for quantity in tied], dtype=bool)
        is_friction = np.array([quantity.is_friction for quantity in tied], dtype=bool)
        began = np.where(is_log, self._stacked(numbers), 1.0) if tied else np.empty(0)
        self.held_at = np.where(is_friction, BELIEVED_FRICTION, began)
        self.pull = np.where(is_friction, _UNBELIEVED / FRICTION_SPREAD, _HELD * is_log)

    def _packed(
        self, numbers: Mapping[Setting, FloatArray], gas: GasLaw | None
    ) -> dict[Setting, FloatArray]:
        """The variables of each setting."""
        law = {name: 0.0 if gas is None else math.log(getattr(gas, name)) for name in GAS_NAMES}
        free, packed = self.problem.free, {}
        for setting, own in numbers.items():
            known = law | dict(zip(free, self.transformation.pack(own), strict=True))
            packed[setting] = np.array([known[name] for name in self.problem.variables])
        return packed

    def _stacked(self, packed: Mapping[Setting, FloatArray]) -> FloatArray:
        """Variables of the settings as one vector; the first that has an unknown says its value."""
        variables = np.empty(len(self.place))
        for setting in reversed(self.problem.settings):
            variables[self.places[setting]] = packed[setting][self.moving[setting]]
        return variables

    def point_at(self, variables: FloatArray) -> tuple[LinearSystem, Point]:
        """Simulate all settings; the first point gives the weights where there are none."""
        settings, gas = self.problem.settings, self.problem.gas
        if gas is not None:
            law = np.exp(variables[-len(GAS_NAMES) :]).tolist()
            gas = gas._replace(**dict(zip(GAS_NAMES, law, strict=True)))
        values: dict[Setting, Values] = {}
        beyond: dict[Setting, NDArray[np.bool_] | None] = {}
        for setting in settings:
            known = self.packed[setting].copy()
            known[self.moving[setting]] = variables[self.places[setting]]
            values[setting], beyond[setting] = self._values(setting, known, gas)

        def block_of(setting: Setting) -> tuple[_Part, float, float, bool]:
            block = self.problem.blocks[setting]
            evaluate = partial(block.evaluate, values[setting], block.free)
            is_whole = self.is_alone or self.is_dense
            seen = evaluate() if is_whole else attempted(setting, evaluate)
            if isinstance(seen, Failure):
                # A trial that cannot be simulated is one step too far; a bug is the end.
                error = SettingError(seen)
                raise _BugError(error) if seen.is_internal else error
            rows, is_cavitating = seen
            if (is_beyond := beyond[setting]) is not None:
                rows[1:][is_beyond] = 0.0  # beyond the bound nothing changes any more
            mean_square, independent = (
                rows[0] @ rows[0] / block.facts.n_samples,
                n_independent(rows[0]),
            )
            unit = block.scale if self.is_dense else 1.0
            rows *= unit * math.sqrt(self.weights.get(setting, 1.0 / max(mean_square, 1e-300)))
            part = self._linear(rows, values[setting], None if gas is None else gas.share(setting))
            return part, mean_square, independent, is_cavitating

        parts, squares, independent, empty = zip(*self.pool.map(block_of, settings), strict=True)
        mean_squares = dict(zip(settings, squares, strict=True))
        self.weights = self.weights or {s: 1.0 / max(x, 1e-300) for s, x in mean_squares.items()}
        n = dict(zip(settings, independent, strict=True))
        point = Point(values, mean_squares, n, any(empty), self.weights, gas)
        return self._system(parts, variables), point

    def _system(self, parts: Sequence[_Part], variables: FloatArray) -> LinearSystem:
        """One block of all settings; of candidates, and of what their unknowns are held by."""
        if self.is_alone:
            return finite_system(*parts[0])
        held = np.empty(0)
        if self.is_dense:
            numbers = np.where(self.pull > 0.0, np.exp(np.clip(variables, -600.0, 600.0)), 1.0)
            held = self.pull * np.log(numbers / self.held_at)
        residuals = np.concatenate([*(rest for rest, _ in parts), held])
        jacobian, first = np.zeros((len(residuals), len(variables))), 0
        for setting, (rest, columns) in zip(self.problem.settings, parts, strict=True):
            last = first + len(rest)
            jacobian[first:last, self.places[setting]] = columns[:, self.moving[setting]]
            first = last
        if self.is_dense:
            jacobian[first:] = np.diag(self.pull)
        return finite_system(residuals, jacobian)

    def _linear(self, rows: FloatArray, values: Values, gas_share: float | None) -> _Part:
        """A setting's residuals and derivatives by its variables."""
        free = self.problem.free
        with np.errstate(over="ignore", invalid="ignore"):
            jacobian = rows[1:].T * self.transformation.slopes(values_of(free, values))
        if self.is_alone or self.is_dense:
            return rows[0], jacobian
        if gas_share is not None:  # by the law's two, logarithms both
            by_law = np.array(
                [[float(name == by) for by in self.problem.variables] for name in free]
            )
            if is_within(values, (GAS_FOLLOWER,)):  # beyond its range nothing changes any more
                by_law[free.index(GAS_FOLLOWER), -len(GAS_NAMES) :] = (-gas_share, 1.0 - gas_share)
            jacobian = jacobian @ by_law
        triangle = reduced(rows[0], jacobian)
        return triangle[:, -1], triangle[:, :-1]

    def _values(
        self, setting: Setting, known: FloatArray, gas: GasLaw | None
    ) -> tuple[Values, NDArray[np.bool_] | None]:
        """A setting's values within the ranges, K_e on its law; of a candidate what is beyond."""
        free, variables = self.problem.free, known
        if gas is not None:
            by_name = dict(zip(self.problem.variables, known, strict=True))
            variables = np.array([by_name.get(name, 0.0) for name in free])
        if self.stays_beyond:
            numbers = self.transformation.unpack(variables)
            within = np.clip(numbers, *self.ranges)
            return with_values(self.starts[setting], free, within), within != numbers
        numbers = self.transformation.unpack(variables, self.ranges)
        values = with_values(self.starts[setting], free, numbers)
        if gas is not None:
            values = values.replace({GAS_FOLLOWER: gas.modulus(setting)})
        return kept_within(values, free), None


def _is_empty(
    response: Response, compared: slice | NDArray[np.intp], weight: FloatArray | None
) -> bool:
    """Whether a chamber of oil is empty in a compared sample that has a weight."""
    empty = response.pressures[:2, compared] <= 0.0
    return bool((empty if weight is None else empty & (weight > 0.0)).any())


def linearise(block: Block, values: Values) -> tuple[FloatArray, FloatArray]:
    """Residuals (n,), model minus measured, N, and their derivative (n, k) by common variables."""
    rows = block.rows(values, block.free)
    slopes = block.common_variables.slopes(values_of(block.free, values))
    return rows[0], rows[1:].T * slopes


def values_of(names: Sequence[str], values: Values) -> FloatArray:
    """The numbers of some names, (k,)."""
    return np.array([getattr(values, name) for name in names])


def with_values(values: Values, names: Sequence[str], numbers: FloatArray) -> Values:
    """Values with other numbers of some names."""
    return values.replace(dict(zip(names, numbers.tolist(), strict=True)))


def n_independent(residuals: FloatArray) -> float:
    """How many independent samples residuals are worth: twice their sign changes."""
    signs = np.signbit(residuals)
    return max(2.0 * float(np.count_nonzero(signs[1:] != signs[:-1])), 1.0)


def is_within(values: Values, names: Iterable[str]) -> bool:
    """Whether the named quantities lie in their ranges, edges and rounding included."""
    ranges = ((getattr(values, name), *values.quantity(name).plausible) for name in names)
    return all(
        low - _ROUNDED * abs(low) <= value <= high + _ROUNDED * abs(high)
        for value, low, high in ranges
    )


def kept_within(values: Values, names: Iterable[str]) -> Values:
    """Values with the named ones brought to the edge that they are beyond."""
    ranges = ((name, values.quantity(name).plausible) for name in names)
    return values.replace(
        {name: min(max(getattr(values, name), low), high) for name, (low, high) in ranges}
    )


def is_at_edge(values: Values, name: str) -> bool:
    """Whether a quantity has run to a bound."""
    return bool(values.quantity(name).edge_at(getattr(values, name)))


def edge_of(values: Values, name: str) -> tuple[str, float]:
    """On which side a quantity ran out of its range, "below" or "above", and where."""
    low, high = values.quantity(name).plausible
    value = getattr(values, name)
    if value < 0.99 * high:  # a friction within its range that is nothing beside the noise, too
        return "below", max(value, low)
    return "above", min(value, high)


def does_nothing(values: Values, name: str) -> bool:
    """Whether a quantity is at an edge of its range where its part of the model does nothing."""
    quantity = values.quantity(name)
    return quantity.edge_at(getattr(values, name)) in quantity.idle_edges


def is_nothing(values: Values, name: str) -> bool:
    """Whether a quantity that ran to an edge is none, as is a friction beside the noise."""
    is_low = edge_of(values, name)[0] == "below"
    is_from_below = values.quantity(name).idle_edges[:1] == ("below",)
    return does_nothing(values, name) or (is_low and is_from_below)
