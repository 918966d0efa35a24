"""A joint fit that meets settings far worse than their own fits starts again from single settings.

Its start is what all settings tell of each shared value. One of them in a wrong valley, where a
weak stroke's bleed and blow-off have changed places, spoils it, and no step leads out. So each
shared value is taken from one setting instead, in every order of the settings; the start that meets
all of them best is followed.
"""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import permutations
from typing import TYPE_CHECKING

from damperfit.errors import SimulationError
from damperfit.identification.failures import SettingError
from damperfit.identification.joint_fit import fit_jointly
from damperfit.identification.law_misfit import LawMisfit
from damperfit.identification.plausible import kept_within
from damperfit.identification.unknowns import unknowns_of

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from damperfit.damper.model import Values
    from damperfit.identification.joint_fit import JointProblem, JointSolution
    from damperfit.tested.setting import Setting

__all__ = ["unstrained"]

# Times the misfit of its own fit, or the one that matters to nobody: what sharing costs where the
# law holds is less. Per cent.
_STRAINED, _ENOUGH = 4.0, 0.02
# Settings all of whose orders are looked at; of more so many are first in turn.
_FEW, _FIRST = 4, 8
_FOLLOWED = 2  # starts, to their end


def unstrained(
    problem: JointProblem,
    solution: JointSolution,
    apart: Mapping[Setting, Values],
    least: Mapping[Setting, float],
) -> JointSolution:
    """Return the joint fit, or a better one from other starts where it is strained.

    Parameters
    ----------
    problem : JointProblem
        Logs, what is free, what is shared.
    solution : JointSolution
        Where the joint fit ended.
    apart : mapping of Setting to Values
        Of each setting's own fit.
    least : mapping of Setting to float
        Eq. (22) of each, per cent.
    """
    if not _is_strained(problem, solution, least):
        return solution
    laws = {
        setting: LawMisfit(one.damper, one.traces, one.free, one.solver).on_cycles()
        for setting, one in problem.misfits.items()
    }
    starts = [_from_first(problem, apart, order) for order in _orders(problem.settings, least)]
    costs = [(_cost(laws, start), place) for place, start in enumerate(starts)]
    best, spent = solution, solution.evaluations
    tried = {cost: place for cost, place in sorted(costs, reverse=True) if math.isfinite(cost)}
    for cost in sorted(tried)[:_FOLLOWED]:
        try:
            again = fit_jointly(problem, starts[tried[cost]])
        except SettingError:
            continue
        spent += again.evaluations
        best = min(best, again, key=_missed)
    return replace(best, evaluations=spent)


def _orders(
    settings: Sequence[Setting], least: Mapping[Setting, float]
) -> Iterable[tuple[Setting, ...]]:
    """All orders of few settings; of many each first of those that are met best, the rest after."""
    if len(settings) <= _FEW:
        return permutations(settings)
    ranked = sorted(settings, key=lambda one: least[one])
    return [(one, *(two for two in ranked if two != one)) for one in ranked[:_FIRST]]


def _is_strained(
    problem: JointProblem, solution: JointSolution, least: Mapping[Setting, float]
) -> bool:
    return any(
        100.0 * square / problem.misfits[setting].deviation ** 2
        > _STRAINED * max(least[setting], _ENOUGH)
        for setting, square in solution.mean_squares.items()
    )


def _from_first(
    problem: JointProblem, apart: Mapping[Setting, Values], order: Sequence[Setting]
) -> dict[Setting, Values]:
    """Each setting's own values, what is shared from the first of the order that has it."""
    starts = {setting: apart[setting] for setting in problem.settings}
    for one in unknowns_of(problem.shared, problem.follows, problem.settings):
        having = [setting for setting in order if one.holds_at(setting)]
        value = getattr(apart[having[0]], one.name)
        for setting in having:
            starts[setting] = starts[setting].replace({one.name: value})
    return {setting: kept_within(one, problem.free) for setting, one in starts.items()}


def _cost(laws: Mapping[Setting, LawMisfit], start: Mapping[Setting, Values]) -> float:
    """The logarithms of all settings' misfits together; infinite where one cannot be simulated."""
    try:
        return sum(math.log(max(laws[one].cost(at), 1e-300)) for one, at in start.items())
    except SimulationError:
        return math.inf


def _missed(solution: JointSolution) -> float:
    return sum(math.log(max(one, 1e-300)) for one in solution.mean_squares.values())
