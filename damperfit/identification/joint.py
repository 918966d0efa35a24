r"""One fit over all settings with some parameters in common.

Gauss-Newton on the sum of squares of every setting, each weighted by its own residual. A setting's
sensitivities touch its own parameters u_i and the shared theta only, so that with H_i = J_i^T J_i
and the gradients g the step splits (Schur)::

    S dtheta = sum_i [g_theta - H_theta,u H_uu^-1 g_u],  S = sum_i [H_theta,theta
                                                             - H_theta,u H_uu^-1 H_u,theta]
    du_i = H_uu^-1 (g_u - H_u,theta dtheta)

With a gas content (`gas_content`), K_e of a setting is no variable: V_r and K_B/C are shared in its
place, and the columns of J follow by the chain rule.

Twenty settings with sixty own parameters cost one simulation of each log per step and a few 5 x 5
solves. The separate fits are the start, so a handful of steps is enough.
"""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from damperfit.identification.descent import linearise, stepped
from damperfit.identification.failures import SettingError, SettingFailure, attempted
from damperfit.identification.gas_content import GAS_NAMES

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from damperfit.damper.parameters import Parameters
    from damperfit.identification.descent import Misfit
    from damperfit.identification.gas_content import GasLaw

    FloatArray = NDArray[np.float64]

__all__ = ["JointProblem", "JointSolution", "fit_jointly"]

# A step that promises less than this share of the cost moves no parameter by 1 % of its error.
_COST_TOLERANCE = 1e-8
_MAX_STEPS = 20
_MAX_HALVINGS = 6
# Parameters are changed by a factor of two at most in one step.
_LONGEST_STEP = 0.7


@dataclass(frozen=True, slots=True)
class JointSolution:
    """Where a joint fit ended.

    Attributes
    ----------
    parameters : mapping of int to Parameters
        By setting; the shared ones are equal.
    evaluations : int
        Simulations of each setting.
    is_converged : bool
        Whether no further step promised anything.
    cost : float
        Sum of squares, each setting's times its weight.
    weights : mapping of int to float
        One over the mean square of each setting's residuals at the start, 1/N^2.
    mean_squares : mapping of int to float
        Mean square of each setting's residuals at the end, N^2.
    n_independent : mapping of int to float
        Independent samples among them, twice their sign changes.
    errors : mapping of str to float
        Rough relative standard errors of the shared variables, as `relative_errors` of one fit.
    gas : GasLaw or None
        The law that K_e follows, where one was given.
    """

    parameters: Mapping[int, Parameters]
    evaluations: int
    is_converged: bool
    cost: float
    weights: Mapping[int, float]
    mean_squares: Mapping[int, float]
    n_independent: Mapping[int, float]
    errors: Mapping[str, float]
    gas: GasLaw | None = None


@dataclass(frozen=True, slots=True, eq=False)
class JointProblem:
    """What is fitted together.

    Attributes
    ----------
    misfits : mapping of int to Misfit
        By setting; ``free`` names own and shared parameters, the same for all.
    shared : tuple of str
        Parameters that all settings have in common.
    gas : GasLaw or None
        Where K_e starts from, if it is to follow a gas content; K_e must then be free.
    weights : mapping of int to float or None
        Weights of the settings' squares; None takes those of the start.
    jobs : int
        Threads.
    """

    misfits: Mapping[int, Misfit]
    shared: tuple[str, ...]
    gas: GasLaw | None = None
    weights: Mapping[int, float] | None = None
    jobs: int = 1

    @property
    def settings(self) -> tuple[int, ...]:
        """By rising number."""
        return tuple(sorted(self.misfits))

    @property
    def free(self) -> tuple[str, ...]:
        """Parameters of a setting that move."""
        return self.misfits[self.settings[0]].free

    @property
    def variables(self) -> tuple[str, ...]:
        """What a setting's columns are by: its parameters, but for K_e those of its law."""
        if self.gas is None:
            return self.free
        return (*(name for name in self.free if name != "k_e"), *GAS_NAMES)

    @property
    def is_shared(self) -> NDArray[np.bool_]:
        """Which of the variables are shared."""
        return np.array([name in {*self.shared, *GAS_NAMES} for name in self.variables])


@dataclass(frozen=True, slots=True, eq=False)
class _Normal:
    """Weighted normal equations of one setting: H, -gradient, cost."""

    information: FloatArray
    slope: FloatArray
    cost: float
    weight: float
    n: int
    n_independent: float


@dataclass(frozen=True, slots=True, eq=False)
class _At:
    """A point of the joint fit."""

    parameters: Mapping[int, Parameters]
    gas: GasLaw | None


def fit_jointly(problem: JointProblem, starts: Mapping[int, Parameters]) -> JointSolution:
    """Minimise the misfit of all settings together.

    Parameters
    ----------
    problem : JointProblem
        Logs, what is free, what is shared.
    starts : mapping of int to Parameters
        Separate fits, with the shared parameters already equal.

    Raises
    ------
    SettingError
        When the model cannot be integrated at a setting's start, or a setting meets a bug.
    FitCancelledError
        When the caller asked to stop.
    """
    best = _followed(problem, _At(dict(starts), problem.gas))
    with ThreadPoolExecutor(max(1, problem.jobs)) as pool:
        known = _normals(pool, problem, best, problem.weights)
        weights = {s: one.weight for s, one in zip(problem.settings, known, strict=True)}
        evaluations, is_converged = 1, False
        for _ in range(_MAX_STEPS):
            cost = sum(one.cost for one in known)
            steps, gain = _step(known, problem.is_shared)
            is_converged = gain < _COST_TOLERANCE * cost
            if is_converged:
                break
            steps *= min(1.0, _LONGEST_STEP / float(np.max(np.abs(steps))))
            for _ in range(_MAX_HALVINGS):
                trial = _moved(problem, best, steps)
                evaluations += 1
                try:
                    found = _normals(pool, problem, trial, weights)
                except SettingError as error:
                    if error.failure.is_internal:
                        raise
                    found = []
                if found and sum(one.cost for one in found) < cost:
                    best, known = trial, found
                    break
                steps = 0.5 * steps
            else:
                break
    return JointSolution(
        parameters=best.parameters,
        evaluations=evaluations,
        is_converged=is_converged,
        cost=sum(one.cost for one in known),
        weights=weights,
        mean_squares={
            setting: one.cost / one.weight / one.n
            for setting, one in zip(problem.settings, known, strict=True)
        },
        n_independent={
            setting: one.n_independent for setting, one in zip(problem.settings, known, strict=True)
        },
        errors=_errors(problem, known),
        gas=best.gas,
    )


def _normals(
    pool: ThreadPoolExecutor,
    problem: JointProblem,
    at: _At,
    weights: Mapping[int, float] | None,
) -> list[_Normal]:
    def one(setting: int) -> _Normal:
        misfit, parameters = problem.misfits[setting], at.parameters[setting]
        linear = attempted(setting, lambda: linearise(misfit, parameters))
        if isinstance(linear, SettingFailure):
            raise SettingError(linear)
        residuals, jacobian = linear
        jacobian = jacobian @ _chain(problem, at.gas, setting)
        cost = float(residuals @ residuals)
        weight = len(residuals) / max(cost, 1e-300) if weights is None else weights[setting]
        changes = np.count_nonzero(np.diff(np.signbit(residuals)))
        return _Normal(
            weight * (jacobian.T @ jacobian),
            -weight * (jacobian.T @ residuals),
            weight * cost,
            weight,
            len(residuals),
            max(2.0 * changes, 1.0),
        )

    return list(pool.map(one, problem.settings))


def _chain(problem: JointProblem, gas: GasLaw | None, setting: int) -> FloatArray:
    """Derivative of a setting's free parameters by its variables, logarithms both."""
    if gas is None:
        return np.eye(len(problem.free))
    share = gas.share(setting)
    of_k_e = dict(zip(GAS_NAMES, (-share, 1.0 - share), strict=True))
    return np.array(
        [
            [of_k_e.get(v, 0.0) if name == "k_e" else float(name == v) for v in problem.variables]
            for name in problem.free
        ]
    )


def _moved(problem: JointProblem, at: _At, steps: FloatArray) -> _At:
    gas = at.gas
    if gas is not None:
        by = dict(zip(problem.variables, steps[0], strict=True))
        gas = replace(
            gas, **{name: getattr(gas, name) * math.exp(float(by[name])) for name in GAS_NAMES}
        )
    parameters = {
        setting: stepped(
            problem.misfits[setting],
            at.parameters[setting],
            _chain(problem, at.gas, setting) @ step,
        )
        for setting, step in zip(problem.settings, steps, strict=True)
    }
    return _followed(problem, _At(parameters, gas))


def _followed(problem: JointProblem, at: _At) -> _At:
    """K_e of every setting exactly on its law."""
    if at.gas is None:
        return at
    moduli = {setting: at.gas.modulus(setting) for setting in problem.settings}
    return _At({s: replace(at.parameters[s], k_e=k_e) for s, k_e in moduli.items()}, at.gas)


def _errors(problem: JointProblem, known: Sequence[_Normal]) -> dict[str, float]:
    theta, own = np.flatnonzero(problem.is_shared), np.flatnonzero(~problem.is_shared)
    complement = np.zeros((len(theta),) * 2)
    for one in known:
        complement += one.information[np.ix_(theta, theta)] - _eliminate(one, own, theta)[:, :-1]
    variances = np.diag(_solve(complement, np.eye(len(theta))))
    inflation = float(np.mean([one.n / one.n_independent for one in known]))
    return {
        problem.variables[place]: math.sqrt(max(float(variance), 0.0) * inflation)
        for place, variance in zip(theta, variances, strict=True)
    }


def _step(known: Sequence[_Normal], is_shared: NDArray[np.bool_]) -> tuple[FloatArray, float]:
    """Return the Gauss-Newton step of every setting, (settings, free), and what it promises."""
    theta, own = np.flatnonzero(is_shared), np.flatnonzero(~is_shared)
    complement, slope = np.zeros((len(theta),) * 2), np.zeros(len(theta))
    for one in known:
        eliminated = _eliminate(one, own, theta)
        complement += one.information[np.ix_(theta, theta)] - eliminated[:, :-1]
        slope += one.slope[theta] - eliminated[:, -1]
    common = _solve(complement, slope[:, None])[:, 0]
    steps = np.zeros((len(known), len(is_shared)))
    gain = 0.0
    for step, one in zip(steps, known, strict=True):
        step[theta] = common
        left = one.slope[own] - one.information[np.ix_(own, theta)] @ common
        step[own] = _solve(one.information[np.ix_(own, own)], left[:, None])[:, 0]
        gain += float(one.slope @ step)
    return steps, gain


def _eliminate(one: _Normal, own: NDArray[np.intp], theta: NDArray[np.intp]) -> FloatArray:
    """H_theta,u H_uu^-1 [H_u,theta, g_u]."""
    right = np.column_stack([one.information[np.ix_(own, theta)], one.slope[own]])
    return np.asarray(
        one.information[np.ix_(theta, own)] @ _solve(one.information[np.ix_(own, own)], right)
    )


def _solve(matrix: FloatArray, right: FloatArray) -> FloatArray:
    """Solve with unit diagonal; the least-squares solution where the matrix is singular."""
    if not len(matrix):
        return np.zeros(right.shape)
    scale = 1.0 / np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    scaled = matrix * np.outer(scale, scale)
    solution = np.linalg.lstsq(scaled, scale[:, None] * right, rcond=1e-12)[0]
    return np.asarray(scale[:, None] * solution)
