r"""One fit over all settings with some parameters in common.

The sum of squares of every setting, each weighted by its own residual, in the loop of every fit
(`trust_region`). A setting's sensitivities touch its own parameters and the shared ones only, which
is what `step_solvers.BorderedSystem` lives on. What follows an adjuster is shared by the settings
with the same click of it, and stands in the border with what all of them share (`unknowns`).

With a gas content (`gas_content`), K_e of a setting is no variable: V_r and K_B/C are shared in its
place, and the columns of J follow by the chain rule.

Twenty settings with sixty own parameters cost one simulation of each log per step and a few 6 x 6
factorisations. The separate fits are the start, so a handful of steps is enough.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from damperfit.identification.descent import common_variables, linearise
from damperfit.identification.failures import SettingError, SettingFailure, attempted
from damperfit.identification.minimiser import inverse_information
from damperfit.identification.paper.gas_content import GAS_FOLLOWER, GAS_NAMES
from damperfit.identification.plausible import is_within, kept_within
from damperfit.identification.step_solvers import NO_LENGTH, BorderedSystem, reduced
from damperfit.identification.trust_region import Ended, Stopping, iterate
from damperfit.identification.unknowns import Follows, Unknown, unknown_at, unknowns_of
from damperfit.workers import executor

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from damperfit.damper.model import Values
    from damperfit.identification.descent import Misfit
    from damperfit.identification.paper.gas_content import GasLaw
    from damperfit.tested.setting import Setting
    from damperfit.workers import InTurn, Threads

    FloatArray = NDArray[np.float64]

__all__ = ["JointProblem", "JointSolution", "fit_jointly"]

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


@dataclass(frozen=True, slots=True)
class JointSolution:
    """Where a joint fit ended.

    Attributes
    ----------
    parameters : mapping of int to Values
        By setting; the shared ones are equal where they are one unknown.
    evaluations : int
        Simulations of each setting.
    is_converged : bool
        Whether no further step promised anything.
    cost : float
        Sum of squares, each setting's times its weight.
    weights : mapping of Setting to float
        One over the mean square of each setting's residuals at the start, 1/N^2.
    mean_squares : mapping of Setting to float
        Mean square of each setting's residuals at the end, N^2.
    n_independent : mapping of Setting to float
        Independent samples among them, twice their sign changes.
    errors : mapping of str to float
        Rough relative standard errors of the shared unknowns by their labels, as `relative_errors`
        of one fit.
    gas : GasLaw or None
        The law that K_e follows, where one was given.
    """

    parameters: Mapping[Setting, Values]
    evaluations: int
    is_converged: bool
    cost: float
    weights: Mapping[Setting, float]
    mean_squares: Mapping[Setting, float]
    n_independent: Mapping[Setting, float]
    errors: Mapping[str, float]
    gas: GasLaw | None = None


@dataclass(frozen=True, slots=True, eq=False)
class JointProblem:
    """What is fitted together.

    Attributes
    ----------
    misfits : mapping of Setting to Misfit
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

    misfits: Mapping[Setting, Misfit]
    shared: tuple[str, ...]
    follows: Follows = field(default_factory=dict)
    held: frozenset[Unknown] = frozenset()
    gas: GasLaw | None = None
    weights: Mapping[Setting, float] | None = None
    jobs: int = 1

    @property
    def settings(self) -> tuple[Setting, ...]:
        """By rising number."""
        return tuple(sorted(self.misfits))

    @property
    def free(self) -> tuple[str, ...]:
        """Values of a setting that move."""
        return self.misfits[self.settings[0]].free

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

    @property
    def border(self) -> tuple[Unknown, ...]:
        """The shared unknowns that move, in the order of the variables."""
        shared = [n for n, mine in zip(self.variables, self.is_shared, strict=True) if mine]
        found = unknowns_of(shared, self.follows, self.settings)
        return tuple(one for one in found if one not in self.held)

    def at(self, setting: Setting) -> tuple[Unknown, ...]:
        """The unknowns that a setting's shared variables are, in their order."""
        shared = [n for n, mine in zip(self.variables, self.is_shared, strict=True) if mine]
        return tuple(unknown_at(name, self.follows, setting) for name in shared)


@dataclass(frozen=True, slots=True, eq=False)
class _Seen:
    """One setting at a point."""

    mean_square: float
    n: int
    n_independent: float


@dataclass(frozen=True, slots=True, eq=False)
class _At:
    """A point of the joint fit."""

    parameters: Mapping[Setting, Values]
    gas: GasLaw | None
    seen: Mapping[Setting, _Seen]


def fit_jointly(problem: JointProblem, starts: Mapping[Setting, Values]) -> JointSolution:
    """Minimise the misfit of all settings together.

    Where the logs of all settings repeat, first on their mean cycles and from there on the logs.

    Parameters
    ----------
    problem : JointProblem
        Logs, what is free, what is shared.
    starts : mapping of int to Values
        Separate fits, with the shared parameters already equal.

    Raises
    ------
    SettingError
        When the model cannot be integrated at a setting's start, or a setting meets a bug.
    FitCancelledError
        When the caller asked to stop.
    """
    if any(one.cycles is None for one in problem.misfits.values()):
        return _minimised(problem, starts)
    whole = {setting: one.whole for setting, one in problem.misfits.items()}
    ends = replace(problem, misfits=whole)
    spent = 0
    if problem.weights is None:
        # Weights are of the logs at the start, whichever way the descent takes.
        weights = _minimised(ends, starts, max_evaluations=1).weights
        problem, ends, spent = replace(problem, weights=weights), replace(ends, weights=weights), 1
    try:
        there = _minimised(problem, starts)
    except SettingError:
        return _minimised(ends, starts)
    ended = _minimised(replace(ends, gas=there.gas), there.parameters)
    return replace(ended, evaluations=ended.evaluations + there.evaluations + spent)


def _minimised(
    problem: JointProblem,
    starts: Mapping[Setting, Values],
    *,
    max_evaluations: int = _MAX_EVALUATIONS,
) -> JointSolution:
    """Where a descent on what the misfits have ends, their mean cycles or their logs."""
    stopping = Stopping(
        step_tolerance=_STEP_TOLERANCE,
        max_evaluations=max_evaluations,
        # Weighted squares are about 1 each.
        least_gain=_COST_TOLERANCE * sum(one.n_samples for one in problem.misfits.values()),
        longest_step=_LONGEST_STEP,
    )
    with executor(problem.jobs) as pool:
        model = _Model(problem, starts, pool)
        try:
            ended = iterate(model.point_at, model.start, stopping)
        except _BugError as bug:
            raise bug.error from bug
    seen = ended.extra.seen
    return JointSolution(
        parameters=ended.extra.parameters,
        evaluations=ended.evaluations,
        is_converged=ended.status in _AT_MINIMUM or _promise(ended) < _NOTHING,
        cost=ended.system.cost,
        weights=model.weights,
        mean_squares={setting: one.mean_square for setting, one in seen.items()},
        n_independent={setting: one.n_independent for setting, one in seen.items()},
        errors=_errors(problem, ended),
        gas=ended.extra.gas,
    )


class _BugError(Exception):
    """Passes through the loop, which takes a `SettingError` for a failed trial."""

    def __init__(self, error: SettingError) -> None:
        self.error = error


class _Model:
    """All settings as a function of one vector: own variables by setting, then the shared ones."""

    def __init__(
        self, problem: JointProblem, starts: Mapping[Setting, Values], pool: InTurn | Threads
    ) -> None:
        self.problem, self.starts, self.pool = problem, starts, pool
        self.weights = dict(problem.weights or {})
        self.own = np.flatnonzero(~problem.is_shared)
        self.theta = np.flatnonzero(problem.is_shared)
        self.border = problem.border
        places = {one: k for k, one in enumerate(self.border)}
        # Of each setting: which of its shared variables move, and where they stand in the border.
        self.moving: dict[Setting, NDArray[np.intp]] = {}
        self.places: dict[Setting, NDArray[np.intp]] = {}
        for setting in problem.settings:
            mine = list(zip(self.theta, problem.at(setting), strict=True))
            moving = [(k, places[one]) for k, one in mine if one in places]
            columns = np.array(moving, dtype=np.intp).reshape(-1, 2)
            self.moving[setting], self.places[setting] = columns.T
        self.packed = self._packed()

    @property
    def start(self) -> FloatArray:
        """The starts as one vector."""
        border = np.empty(len(self.border))
        # The first setting that has an unknown says where it starts.
        for setting, row in zip(reversed(self.problem.settings), self.packed[::-1], strict=True):
            border[self.places[setting]] = row[self.moving[setting]]
        return np.concatenate([self.packed[:, self.own].ravel(), border])

    def _packed(self) -> FloatArray:
        """The variables of each setting at the starts, shape (settings, variables)."""
        problem, gas = self.problem, self.problem.gas
        law = {} if gas is None else {name: math.log(getattr(gas, name)) for name in GAS_NAMES}
        rows = []
        for setting in problem.settings:
            packed = common_variables(problem.misfits[setting]).pack(
                np.array([getattr(self.starts[setting], name) for name in problem.free])
            )
            known = {**dict(zip(problem.free, packed, strict=True)), **law}
            rows.append([known[name] for name in problem.variables])
        return np.array(rows)

    def point_at(self, variables: FloatArray) -> tuple[BorderedSystem, _At]:
        """Simulate all settings; the first point gives the weights where there are none."""
        problem = self.problem
        own, theta = np.split(variables, [len(problem.settings) * len(self.own)])
        own = own.reshape(len(problem.settings), -1)
        gas = self._gas(theta)
        at = {}
        for setting, mine, start in zip(problem.settings, own, self.packed, strict=True):
            known = start.copy()
            known[self.own], known[self.moving[setting]] = mine, theta[self.places[setting]]
            at[setting] = self._parameters(setting, known, gas)

        def one(setting: Setting) -> tuple[FloatArray, _Seen]:
            values, is_free = at[setting]
            linear = attempted(setting, lambda: linearise(problem.misfits[setting], values))
            if isinstance(linear, SettingFailure):
                # A trial that cannot be simulated is one step too far; a bug is the end.
                error = SettingError(linear)
                raise _BugError(error) if linear.is_internal else error
            residuals, jacobian = linear
            slopes = (jacobian * is_free) @ _slopes_by_variables(problem, gas, setting)
            jacobian = np.zeros((len(residuals), len(self.own) + len(self.border)))
            jacobian[:, : len(self.own)] = slopes[:, self.own]
            jacobian[:, len(self.own) + self.places[setting]] = slopes[:, self.moving[setting]]
            n = problem.misfits[setting].n_samples
            mean_square = float(residuals @ residuals) / n
            weight = self.weights.get(setting, 1.0 / max(mean_square, 1e-300))
            changes = np.count_nonzero(np.diff(np.signbit(residuals)))
            seen = _Seen(mean_square, n, max(2.0 * changes, 1.0))
            return math.sqrt(weight) * reduced(residuals, jacobian), seen

        blocks, seen = zip(*self.pool.map(one, problem.settings), strict=True)
        by_setting = dict(zip(problem.settings, seen, strict=True))
        self.weights = self.weights or {
            setting: 1.0 / max(one.mean_square, 1e-300) for setting, one in by_setting.items()
        }
        return BorderedSystem(blocks, len(self.border)), _At(
            {setting: values for setting, (values, _) in at.items()}, gas, by_setting
        )

    def _gas(self, theta: FloatArray) -> GasLaw | None:
        if self.problem.gas is None:
            return None
        values = np.exp(theta[-len(GAS_NAMES) :]).tolist()
        return replace(self.problem.gas, **dict(zip(GAS_NAMES, values, strict=True)))

    def _parameters(
        self, setting: Setting, known: FloatArray, gas: GasLaw | None
    ) -> tuple[Values, NDArray[np.bool_]]:
        """A setting's values, and which of the free ones are not beyond their ranges.

        What is beyond stays at the edge, and beyond it nothing changes any more.
        """
        problem = self.problem
        by_name = dict(zip(problem.variables, known, strict=True))
        # K_e of every setting exactly on its law.
        follower = {} if gas is None else {GAS_FOLLOWER: gas.modulus(setting)}
        packed = np.array([by_name.get(name, 0.0) for name in problem.free])
        values = common_variables(problem.misfits[setting]).unpack(packed).tolist()
        named = dict(zip(problem.free, values, strict=True))
        found = self.starts[setting].replace({**named, **follower})
        is_free = [is_within(found, (name,)) for name in problem.free]
        return kept_within(found, problem.free), np.array(is_free, dtype=bool)


def _slopes_by_variables(problem: JointProblem, gas: GasLaw | None, setting: Setting) -> FloatArray:
    """Derivative of a setting's free parameters by its variables, logarithms both."""
    if gas is None:
        return np.eye(len(problem.free))
    share = gas.share(setting)
    of_follower = dict(zip(GAS_NAMES, (-share, 1.0 - share), strict=True))
    return np.array(
        [
            [
                of_follower.get(v, 0.0) if name == GAS_FOLLOWER else float(name == v)
                for v in problem.variables
            ]
            for name in problem.free
        ]
    )


def _promise(ended: Ended[_At]) -> float:
    scale = np.maximum(ended.system.lengths, NO_LENGTH)
    return ended.system.scaled(scale).step(0.0).effect


def _errors(problem: JointProblem, ended: Ended[_At]) -> dict[str, float]:
    assert isinstance(ended.system, BorderedSystem)
    variances = np.diag(inverse_information(ended.system.shared_rows))
    inflation = float(np.mean([one.n / one.n_independent for one in ended.extra.seen.values()]))
    return {
        one.label: math.sqrt(float(variance) * inflation)
        for one, variance in zip(problem.border, variances, strict=True)
    }
