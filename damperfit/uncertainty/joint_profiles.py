"""Profiles of the parameters that a joint fit shares: all settings are refitted at every value."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from damperfit.damper.parameters import PARAMETER_NAMES
from damperfit.identification.joint_fit import JointProblem, JointSolution, fit_jointly
from damperfit.identification.outcome import Outcome
from damperfit.uncertainty.intervals import shared_curvature
from damperfit.uncertainty.profiles import (
    OFFSET_UNIT,
    MisfitProfile,
    Stride,
    signed_root,
    walked,
)

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from damperfit.damper.parameters import Parameters
    from damperfit.identification import Sharing
    from damperfit.uncertainty.information import Evidence
    from damperfit.uncertainty.intervals import Uncertainty
    from damperfit.uncertainty.lines import Bench

__all__ = ["profile_jointly"]


@dataclass(slots=True)
class _JointWalk:
    """The walker over all settings of a joint fit."""

    problem: JointProblem
    name: str
    best: JointSolution
    scale: float
    spent: int = 0
    points: list[tuple[float, float, Mapping[int, Parameters]]] = field(default_factory=list)
    last: JointSolution = field(init=False)

    def __post_init__(self) -> None:
        self.last = self.best
        self.points.append((0.0, 0.0, self.best.parameters))

    def restart(self) -> None:
        self.last = self.best

    def refit(self, along: float) -> float:
        starts = {
            setting: _shifted(at, self.name, self.best.parameters[setting], along)
            for setting, at in self.last.parameters.items()
        }
        problem = replace(self.problem, gas=self.last.gas, weights=self.best.weights)
        self.last = fit_jointly(problem, starts)
        self.spent += self.last.evaluations
        root = signed_root(self.scale * (self.last.cost - self.best.cost))
        self.points.append((along, root, self.last.parameters))
        return root


def profile_jointly(
    name: str,
    evidence: Sequence[Evidence],
    known: Uncertainty,
    sharing: Sharing,
    bench: Bench,
    *,
    stride: Stride = Stride(),
) -> tuple[MisfitProfile, ...]:
    """Return the profile of a shared parameter of a joint fit, once for every setting in it.

    The rise is that of all settings together.

    Parameters
    ----------
    name : str
        One of ``sharing.jointly``.
    evidence : sequence of Evidence
        Of all settings.
    known : Uncertainty
        Of any setting of the joint fit.
    sharing : Sharing
        What was shared.
    bench : Bench
        Damper, solver, cancellation.
    stride : Stride
        How closely.

    Raises
    ------
    SimulationError
        The best fit cannot be simulated.
    FitCancelledError
        The caller asked to stop.
    """
    fits = [
        one.fit
        for one in evidence
        if one.fit.setting in sharing.settings and one.fit.outcome is Outcome.CONVERGED
    ]
    start = {fit.setting: fit.parameters for fit in fits}

    def problem(free: tuple[str, ...]) -> JointProblem:
        return JointProblem(
            {fit.setting: bench.misfit(fit, free) for fit in fits},
            tuple(n for n in sharing.jointly if n in free),
            gas=sharing.gas,
            jobs=bench.jobs,
        )

    whole = problem(sharing.free)
    best = fit_jointly(whole, start)
    held = problem(tuple(n for n in sharing.free if n != name))
    place = known.names.index(name)
    variance = float(known.covariance[place, place])
    curvature = shared_curvature(evidence, sharing)[sharing.variables.index(name)]
    unit = OFFSET_UNIT if name == "f_0" else 1.0
    walk = _JointWalk(held, name, best, curvature / variance)
    value = float(getattr(next(iter(best.parameters.values())), name))
    profiles = walked(walk, name, value, float(np.sqrt(variance)) / unit, stride)
    return tuple(profiles[setting] for setting in sorted(profiles))


def _shifted(at: Parameters, name: str, best: Parameters, along: float) -> Parameters:
    assert name in PARAMETER_NAMES
    value = getattr(best, name)
    moved = value + OFFSET_UNIT * along if name == "f_0" else value * float(np.exp(along))
    return replace(at, **{name: moved})
