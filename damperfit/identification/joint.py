r"""One fit over all settings with some parameters in common.

Gauss-Newton on the sum of squares of every setting, each weighted by its own residual. A setting's
sensitivities touch its own parameters u_i and the shared theta only, so that with H_i = J_i^T J_i
and the gradients g the step splits (Schur)::

    S dtheta = sum_i [g_theta - H_theta,u H_uu^-1 g_u],  S = sum_i [H_theta,theta
                                                             - H_theta,u H_uu^-1 H_u,theta]
    du_i = H_uu^-1 (g_u - H_u,theta dtheta)

Twenty settings with sixty own parameters cost one simulation of each log per step and a few 5 x 5
solves. The separate fits are the start, so a handful of steps is enough.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from damperfit.errors import SimulationError
from damperfit.identification.descent import linearise, stepped

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from damperfit.damper.parameters import Parameters
    from damperfit.identification.descent import Misfit

    FloatArray = NDArray[np.float64]

__all__ = ["JointSolution", "fit_jointly"]

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
    """

    parameters: Mapping[int, Parameters]
    evaluations: int
    is_converged: bool


@dataclass(frozen=True, slots=True, eq=False)
class _Normal:
    """Weighted normal equations of one setting: H, -gradient, cost."""

    information: FloatArray
    slope: FloatArray
    cost: float


def fit_jointly(
    misfits: Mapping[int, Misfit],
    starts: Mapping[int, Parameters],
    shared: Sequence[str],
    *,
    jobs: int = 1,
) -> JointSolution:
    """Minimise the misfit of all settings together.

    Parameters
    ----------
    misfits : mapping of int to Misfit
        By setting; ``free`` names own and shared parameters.
    starts : mapping of int to Parameters
        Separate fits, with the shared parameters already equal.
    shared : sequence of str
        Parameters that all settings have in common.
    jobs : int
        Threads.

    Raises
    ------
    SimulationError
        When the model cannot be integrated at a start.
    FitCancelledError
        When the caller asked to stop.
    """
    settings = sorted(misfits)
    is_shared = np.array([name in shared for name in misfits[settings[0]].free])
    weights: dict[int, float] = {}

    with ThreadPoolExecutor(max(1, jobs)) as pool:

        def normals(at: Mapping[int, Parameters]) -> list[_Normal]:
            def one(setting: int) -> _Normal:
                residuals, jacobian = linearise(misfits[setting], at[setting])
                cost = float(residuals @ residuals)
                weight = weights.setdefault(setting, len(residuals) / max(cost, 1e-300))
                return _Normal(
                    weight * (jacobian.T @ jacobian),
                    -weight * (jacobian.T @ residuals),
                    weight * cost,
                )

            return list(pool.map(one, settings))

        def moved(at: Mapping[int, Parameters], steps: FloatArray) -> dict[int, Parameters]:
            return {
                setting: stepped(misfits[setting], at[setting], step)
                for setting, step in zip(settings, steps, strict=True)
            }

        best = dict(starts)
        known = normals(best)
        evaluations = 1
        for _ in range(_MAX_STEPS):
            cost = sum(one.cost for one in known)
            steps, gain = _step(known, is_shared)
            if gain < _COST_TOLERANCE * cost:
                return JointSolution(best, evaluations, is_converged=True)
            steps *= min(1.0, _LONGEST_STEP / float(np.max(np.abs(steps))))
            for _ in range(_MAX_HALVINGS):
                trial = moved(best, steps)
                evaluations += 1
                try:
                    found = normals(trial)
                except SimulationError:
                    found = []
                if found and sum(one.cost for one in found) < cost:
                    best, known = trial, found
                    break
                steps = 0.5 * steps
            else:
                return JointSolution(best, evaluations, is_converged=False)
    return JointSolution(best, evaluations, is_converged=False)


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
    scale = 1.0 / np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    scaled = matrix * np.outer(scale, scale)
    solution = np.linalg.lstsq(scaled, scale[:, None] * right, rcond=1e-12)[0]
    return np.asarray(scale[:, None] * solution)
