r"""One fit over several settings with some quantities tied.

The sum of squares of every setting, each weighted by its own residual, in the loop of every fit
(`least_squares`). A setting's derivatives touch its own quantities and the shared ones only, which
is what `BorderedSystem` lives on. What follows an adjuster is shared by the settings with the same
click of it, and stands in the border with what all of them share (`sharing.Unknown`).

With a gas content (`gas_content`), K_e of a setting is no variable: V_r and K_B/C are shared in its
place, and the columns of J follow by the chain rule.

Twenty settings with sixty own parameters cost one simulation of each log per step and a few 6 x 6
factorisations. The separate fits are the start, so a handful of steps is enough.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from damperfit.identification.campaign import SettingError, SettingFailure, attempted
from damperfit.identification.fit_problem import (
    common_variables,
    is_within,
    kept_within,
    linearise,
    n_independent,
    values_of,
    with_values,
)
from damperfit.identification.gas_content import GAS_FOLLOWER, GAS_NAMES
from damperfit.identification.least_squares import (
    NO_LENGTH,
    BorderedSystem,
    Stopping,
    inverse_information,
    iterate,
    reduced,
)
from damperfit.identification.sharing import Follows, Unknown, unknown_at, unknowns_of
from damperfit.workers import executor

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from damperfit.damper.model import Values
    from damperfit.identification.fit_problem import FitProblem
    from damperfit.identification.gas_content import GasLaw
    from damperfit.identification.least_squares import LinearSystem
    from damperfit.tested.setting import Setting
    from damperfit.workers import InTurn, Threads

    FloatArray = NDArray[np.float64]

__all__ = ["JointSolution", "TiedProblem", "fit_jointly"]

# A step that promises less than this share of the cost moves no parameter by 1 % of its error.
_COST_TOLERANCE = 1e-8
_MAX_EVALUATIONS = 40
# Below this relative size a step is not tried again shorter: the integrator's own error is left.
_STEP_TOLERANCE = 1e-7
# Values are changed by a factor of two at most in one step.
_LONGEST_STEP = 0.7
# Of the endings of the loop, those at a minimum: not its limits.
_AT_MINIMUM = (1, 2, 4)
# Weighted squares are about 1: a step that promises less moves nothing by a tenth of its error.
# The integrator's own error may end the loop before it promises as little as is asked for.
_NOTHING = 0.01


class JointSolution(NamedTuple):
    """Where a fit of several settings ended; mappings are by setting, `errors` by label."""

    parameters: Mapping[Setting, Values]  # the shared ones are equal where they are one unknown
    evaluations: int  # simulations of each setting
    is_converged: bool  # no further step promised anything
    cost: float  # sum of squares, each setting's times its weight
    weights: Mapping[Setting, float]  # one over the mean square at the start, 1/N^2
    mean_squares: Mapping[Setting, float]  # of the residuals at the end, N^2
    n_independent: Mapping[Setting, float]  # twice their sign changes
    errors: Mapping[str, float]  # rough relative standard errors of the shared unknowns
    gas: GasLaw | None = None  # the law that K_e follows, where one was given


@dataclass(frozen=True, slots=True, eq=False)
class TiedProblem:
    """Settings that are fitted together, and what they share.

    Attributes
    ----------
    problems : mapping of Setting to FitProblem
        By setting; ``free`` names own and shared parameters, the same for all.
    shared : tuple of str
        Quantities that settings have in common.
    follows : mapping of str to tuple of str
        Adjusters that some of them follow; what is not named all settings have in common.
    held : frozenset of Unknown
        Unknowns that stay as the starts have them.
    gas : GasLaw or None
        Where K_e starts from, if it is to follow a gas content; K_e must then be free.
    weights : mapping of Setting to float or None
        Weights of the settings' squares; None takes those of the start.
    jobs : int
        Threads.
    """

    problems: Mapping[Setting, FitProblem]
    shared: tuple[str, ...]
    follows: Follows = field(default_factory=dict)
    held: frozenset[Unknown] = frozenset()
    gas: GasLaw | None = None
    weights: Mapping[Setting, float] | None = None
    jobs: int = 1

    @property
    def settings(self) -> tuple[Setting, ...]:
        """By rising number."""
        return tuple(sorted(self.problems))

    @property
    def free(self) -> tuple[str, ...]:
        """Values of a setting that move."""
        return self.problems[self.settings[0]].free

    @property
    def variables(self) -> tuple[str, ...]:
        """What a setting's columns are by: its parameters, but for K_e those of its law."""
        if self.gas is None:
            return self.free
        return (*(name for name in self.free if name != GAS_FOLLOWER), *GAS_NAMES)

    @property
    def is_shared(self) -> NDArray[np.bool_]:
        """Which of the variables are shared."""
        return np.array([name in {*self.shared, *GAS_NAMES} for name in self.variables])

    def at(self, setting: Setting) -> tuple[Unknown, ...]:
        """The unknowns that a setting's shared variables are, in their order."""
        shared = [n for n, mine in zip(self.variables, self.is_shared, strict=True) if mine]
        return tuple(unknown_at(name, self.follows, setting) for name in shared)

    @property
    def border(self) -> tuple[Unknown, ...]:
        """The shared unknowns that move, in the order of the variables."""
        shared = [n for n, mine in zip(self.variables, self.is_shared, strict=True) if mine]
        found = unknowns_of(shared, self.follows, self.settings)
        return tuple(one for one in found if one not in self.held)


class _Point(NamedTuple):
    """All settings at a point: values, mean squares and independent residuals; the law of K_e."""

    parameters: Mapping[Setting, Values]
    mean_squares: Mapping[Setting, float]
    n_independent: Mapping[Setting, float]
    gas: GasLaw | None


def fit_jointly(problem: TiedProblem, starts: Mapping[Setting, Values]) -> JointSolution:
    """Minimise the misfit of all settings together.

    Where the logs of all settings repeat, first on their mean cycles and from there on the logs.

    Parameters
    ----------
    problem : TiedProblem
        Logs, what is free, what is shared.
    starts : mapping of Setting to Values
        Separate fits, with the shared parameters already equal.

    Raises
    ------
    SettingError
        When the model cannot be integrated at a setting's start, or a setting meets a bug.
    FitCancelledError
        When the caller asked to stop.
    """
    if any(one.cycles is None for one in problem.problems.values()):
        return _minimised(problem, starts)
    logs = replace(problem, problems={s: one.whole for s, one in problem.problems.items()})
    spent = 0
    if problem.weights is None:
        # Weights are of the logs at the start, whichever way the descent takes.
        weights = _minimised(logs, starts, max_evaluations=1).weights
        problem, logs, spent = replace(problem, weights=weights), replace(logs, weights=weights), 1
    try:
        near = _minimised(problem, starts)
    except SettingError:
        return _minimised(logs, starts)
    ended = _minimised(replace(logs, gas=near.gas), near.parameters)
    return ended._replace(evaluations=ended.evaluations + near.evaluations + spent)


def _minimised(
    problem: TiedProblem,
    starts: Mapping[Setting, Values],
    *,
    max_evaluations: int = _MAX_EVALUATIONS,
) -> JointSolution:
    """The minimum of what the problems have, their mean cycles or their logs."""
    n_samples = {setting: one.n_samples for setting, one in problem.problems.items()}
    stopping = Stopping(
        step_tolerance=_STEP_TOLERANCE,
        max_evaluations=max_evaluations,
        # Weighted squares are about 1 each.
        least_gain=_COST_TOLERANCE * sum(n_samples.values()),
        longest_step=_LONGEST_STEP,
    )
    with executor(problem.jobs) as pool:
        stacked = _Stacked(problem, starts, pool)
        try:
            ended = iterate(stacked.point_at, stacked.start, stopping, stacked.bounds)
        except _BugError as bug:
            raise bug.error from bug
    system, at = ended.system, ended.extra
    assert isinstance(system, BorderedSystem)
    variances = np.diag(inverse_information(system.shared_rows)).tolist()
    inflation = np.mean([n_samples[s] / at.n_independent[s] for s in problem.settings])
    return JointSolution(
        parameters=at.parameters,
        evaluations=ended.evaluations,
        is_converged=ended.status in _AT_MINIMUM or _promise(system, ended.is_held) < _NOTHING,
        cost=system.cost,
        weights=stacked.weights,
        mean_squares=at.mean_squares,
        n_independent=at.n_independent,
        errors={
            one.label: math.sqrt(variance * inflation)
            for one, variance in zip(problem.border, variances, strict=True)
        },
        gas=at.gas,
    )


def _promise(system: LinearSystem, held: NDArray[np.bool_]) -> float:
    rest = system.without(held)
    return rest.scaled(np.maximum(system.lengths, NO_LENGTH)).step(0.0).effect


class _BugError(Exception):
    """Passes through the loop, which takes a `SettingError` for a failed trial."""

    def __init__(self, error: SettingError) -> None:
        self.error = error


class _Stacked:
    """All settings as a function of one vector: own variables by setting, then the shared ones."""

    def __init__(
        self, problem: TiedProblem, starts: Mapping[Setting, Values], pool: InTurn | Threads
    ) -> None:
        self.problem, self.starts, self.pool = problem, starts, pool
        self.weights = dict(problem.weights or {})
        self.own = np.flatnonzero(~problem.is_shared)
        self.n_border = len(problem.border)
        places = {one: k for k, one in enumerate(problem.border)}
        # Of each setting: which of its shared variables move, and where they stand in the border.
        self.moving: dict[Setting, NDArray[np.intp]] = {}
        self.places: dict[Setting, NDArray[np.intp]] = {}
        shared = np.flatnonzero(problem.is_shared)
        for setting in problem.settings:
            mine = zip(shared, problem.at(setting), strict=True)
            moving = [(k, places[one]) for k, one in mine if one in places]
            columns = np.array(moving, dtype=np.intp).reshape(-1, 2)
            self.moving[setting], self.places[setting] = columns.T
        numbers = {s: values_of(problem.free, starts[s]) for s in problem.settings}
        self.packed = self._packed(numbers, problem.gas)
        ranges = [one.plausible for one in map(starts[problem.settings[0]].quantity, problem.free)]
        self.ranges = np.array([one[0] for one in ranges]), np.array([one[1] for one in ranges])
        low, high = (
            self._stacked(self._packed(dict.fromkeys(numbers, edges), None))
            for edges in self.ranges
        )
        self.start, self.bounds = self._stacked(self.packed), (low, high)
        if problem.gas is not None:  # the law's own two, last, have none
            low[-len(GAS_NAMES) :], high[-len(GAS_NAMES) :] = -math.inf, math.inf

    def _packed(
        self, numbers: Mapping[Setting, FloatArray], gas: GasLaw | None
    ) -> dict[Setting, FloatArray]:
        """The variables of each setting."""
        problem = self.problem
        law = {name: 0.0 if gas is None else math.log(getattr(gas, name)) for name in GAS_NAMES}
        packed = {}
        for setting, own in numbers.items():
            u = common_variables(problem.problems[setting]).pack(own)
            known = law | dict(zip(problem.free, u, strict=True))
            packed[setting] = np.array([known[name] for name in problem.variables])
        return packed

    def _stacked(self, packed: Mapping[Setting, FloatArray]) -> FloatArray:
        """Variables of the settings as one vector; the first that has an unknown says its value."""
        border = np.empty(self.n_border)
        for setting in reversed(self.problem.settings):
            border[self.places[setting]] = packed[setting][self.moving[setting]]
        own = [packed[setting][self.own] for setting in self.problem.settings]
        return np.concatenate([*own, border])

    def point_at(self, variables: FloatArray) -> tuple[BorderedSystem, _Point]:
        """Simulate all settings; the first point gives the weights where there are none."""
        settings = self.problem.settings
        own, border = np.split(variables, [len(settings) * len(self.own)])
        gas = self.problem.gas
        if gas is not None:
            law = np.exp(border[-len(GAS_NAMES) :]).tolist()
            gas = gas._replace(**dict(zip(GAS_NAMES, law, strict=True)))
        known = {}
        for setting, mine in zip(settings, own.reshape(len(settings), -1), strict=True):
            known[setting] = self.packed[setting].copy()
            known[setting][self.own] = mine
            known[setting][self.moving[setting]] = border[self.places[setting]]
        values = {setting: self._values(setting, known[setting], gas) for setting in settings}
        found = self.pool.map(lambda s: self._block(s, values[s], gas), settings)
        blocks, squares, independent = zip(*found, strict=True)
        mean_squares = dict(zip(settings, squares, strict=True))
        self.weights = self.weights or {s: 1.0 / max(x, 1e-300) for s, x in mean_squares.items()}
        n = dict(zip(settings, independent, strict=True))
        return BorderedSystem(blocks, self.n_border), _Point(values, mean_squares, n, gas)

    def _block(
        self, setting: Setting, values: Values, gas: GasLaw | None
    ) -> tuple[FloatArray, float, float]:
        """A setting's reduced residuals and derivatives, its mean square, independent residuals."""
        problem = self.problem.problems[setting]
        linear = attempted(setting, lambda: linearise(problem, values))
        if isinstance(linear, SettingFailure):
            # A trial that cannot be simulated is one step too far; a bug is the end.
            error = SettingError(linear)
            raise _BugError(error) if linear.is_internal else error
        residuals, jacobian = linear
        slopes = jacobian if gas is None else jacobian @ self._by_law(values, gas.share(setting))
        columns = np.zeros((len(residuals), len(self.own) + self.n_border))
        columns[:, : len(self.own)] = slopes[:, self.own]
        columns[:, len(self.own) + self.places[setting]] = slopes[:, self.moving[setting]]
        mean_square = float(residuals @ residuals) / problem.n_samples
        weight = self.weights.get(setting, 1.0 / max(mean_square, 1e-300))
        block = math.sqrt(weight) * reduced(residuals, columns)
        return block, mean_square, n_independent(residuals)

    def _values(self, setting: Setting, known: FloatArray, gas: GasLaw | None) -> Values:
        """A setting's values from its variables; K_e exactly on its law, and within its range."""
        problem = self.problem
        by_name = dict(zip(problem.variables, known, strict=True))
        packed = np.array([by_name.get(name, 0.0) for name in problem.free])
        numbers = common_variables(problem.problems[setting]).unpack(packed, self.ranges)
        values = with_values(self.starts[setting], problem.free, numbers)
        if gas is not None:
            values = values.replace({GAS_FOLLOWER: gas.modulus(setting)})
        return kept_within(values, problem.free)

    def _by_law(self, values: Values, share: float) -> FloatArray:
        """Derivative of a setting's free parameters by its variables, logarithms both."""
        of_law = dict(zip(GAS_NAMES, (-share, 1.0 - share), strict=True))
        if not is_within(values, (GAS_FOLLOWER,)):  # beyond its range nothing changes any more
            of_law = dict.fromkeys(GAS_NAMES, 0.0)
        rows = [
            [of_law.get(v, 0.0) if name == GAS_FOLLOWER else float(name == v) for v in variables]
            for variables in [self.problem.variables]
            for name in self.problem.free
        ]
        return np.array(rows)
