"""The joint fit of a campaign: who takes part, from where, and what came out for each setting."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, cast

import numpy as np

from damperfit.identification.campaign import (
    ProcedureInput,
    SettingError,
    SettingFailure,
    attempted,
)
from damperfit.identification.fit_setting import NOT_FIT_TO_SHARE, is_loose, minimised
from damperfit.identification.following import Way, detected_way
from damperfit.identification.gas_content import GAS_FOLLOWER, first_law, working_pressure
from damperfit.identification.outcome import Outcome, Status
from damperfit.identification.sharing import Sharing, Unknown, unknown_at, unknowns_of
from damperfit.identification.tied_problem import JointSolution, TiedProblem, fit_jointly
from damperfit.problem import Problem, warning
from damperfit.statistics import chi_squared_quantile
from damperfit.workers import executor

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from damperfit.damper.model import Values
    from damperfit.damper.purdy.parameters import Damper
    from damperfit.identification.fit_problem import FitProblem
    from damperfit.identification.fit_setting import Fit
    from damperfit.tested.setting import Setting

__all__ = ["JointResult", "fit_from_one_model", "fit_settings_jointly"]

_NO_MINIMUM = warning(
    "no-minimum", "the joint fit stopped before its minimum: the shared values are the best found."
)
_WEIGHTS_MOVE = warning(
    "weights-move", "the weights of the settings had not settled when the joint fit stopped."
)
# The working pressure hardly depends on K_e: it moves by less than this in the second round.
_SAME_PRESSURE = 1e-4
_MAX_ROUNDS = 5
# Weights of settings beside each other that are this near those of the end move nothing.
_SAME_WEIGHT = 1.5
# Neighbours from which a setting at a bound starts again: one along each of two adjusters.
_NEIGHBOURS = 2
# Two unknowns of the law; a third setting is the first that can contradict it.
_LAW_UNKNOWNS = 2
# A misfit that chance makes so large once in a thousand sets; the noise is known roughly only.
_CHANCE = 0.001


@dataclass(frozen=True, slots=True, eq=False)
class JointResult:
    """What a joint fit gave: where it ended, what is shared by whom and how well it is told."""

    solution: JointSolution
    way: Way
    status: Mapping[Unknown, Status]  # of what is shared
    sharing: Sharing  # for its errors
    evaluations: int  # simulations of each setting
    warnings: tuple[Problem, ...]

    def start(self, fit: Fit, problem: FitProblem) -> Values:
        """Where a setting's own fit starts: the joint result, or its own with what is shared."""
        known = self.solution.parameters.get(fit.setting)
        if known is not None:
            return known
        held = {
            name: getattr(at, name)
            for name in self.sharing.jointly
            for other, at in self.solution.parameters.items()
            if self._unknown(name, other) == self._unknown(name, fit.setting)
        }
        parameters = fit.parameters.replace(held)
        if self.solution.gas is None:
            return parameters
        pressure = working_pressure(problem, parameters)
        law = self.solution.gas._replace(pressures={fit.setting: pressure})
        return parameters.replace({GAS_FOLLOWER: law.modulus(fit.setting)})

    def own_at(self, setting: Setting) -> tuple[str, ...]:
        """What is left to a setting's own fit: its own, and what follows a click of it alone."""
        lost = {*self.way.shared} - {*self.sharing.found_at(setting)}
        gas = set() if self.solution.gas is None else {GAS_FOLLOWER}
        return tuple(name for name in (*self.way.own, *lost) if name not in gas)

    def status_at(self, setting: Setting) -> dict[str, Status]:
        """The status of what a setting shares."""
        return {
            name: self.status[self._unknown(name, setting)]
            for name in self.sharing.found_at(setting)
        }

    def _unknown(self, name: str, setting: Setting) -> Unknown:
        return unknown_at(name, self.way.follows, setting)


def fit_settings_jointly(
    given: ProcedureInput, before: Sequence[Fit], way: Way | None, moving: tuple[str, ...]
) -> tuple[JointResult | None, dict[Setting, SettingFailure]]:
    """Fit the settings that have a minimum together; None where there are not two.

    Without a way of sharing the logs tell it. Where something follows an adjuster, settings take
    part too that do not tell every quantity by themselves: others tell it for them.

    A setting that cannot be simulated at the start is left out and follows the others; one that
    meets a bug is left out for good, and the second value returned tells why.

    Raises
    ------
    FitCancelledError
        When the caller asked to stop.
    """
    is_plain = way is not None and not way.follows and not way.is_general
    sound = {
        fit.setting: fit
        for fit in before
        if (fit.outcome is Outcome.CONVERGED if is_plain else fit.outcome.is_minimum)
    }
    broken: dict[Setting, SettingFailure] = {}
    said: list[Problem] = []
    while True:
        try:
            together = _fit_sound(given, sound, way, moving)
        except SettingError as error:
            failure = error.failure
            del sound[failure.setting]
            if failure.is_internal:
                broken[failure.setting] = failure
            else:
                said.append(warning("left-out-of-joint", f"left out of the joint fit: {error}"))
            continue
        if together is not None:
            together = replace(together, warnings=(*said, *together.warnings))
        return together, broken


def _fit_sound(
    given: ProcedureInput,
    sound: Mapping[Setting, Fit],
    way: Way | None,
    moving: tuple[str, ...],
) -> JointResult | None:
    is_gas = given.options.bulk_modulus == "appendix1"
    if len(sound) < 2 or not (way is None or way.shared or is_gas):
        return None
    free = given.ordered({*moving, *((GAS_FOLLOWER,) if is_gas else ())})
    problems = {setting: given.problem(setting, free) for setting in sound}
    spent = 0
    if way is None or way.is_general:
        apart, spent = _helped(problems, sound, jobs=given.jobs)
        found = detected_way(problems, apart, way, jobs=given.jobs)
        way, starts, spent = found.way, found.starts, spent + found.evaluations
        if not way.shared:
            return None
    else:
        starts = _common_starts(given, sound, way)
    problem = TiedProblem(problems, way.shared, way.follows, jobs=given.jobs)
    solution = _fairly_weighed(problem, fit_jointly(problem, starts))
    result = _result(solution, way, free, spent)
    if not is_gas:
        return result
    alone = solution
    solution, more = _with_gas(given, problem, alone.parameters)
    rises = {
        setting: alone.n_independent[setting] * (solution.mean_squares[setting] / least - 1.0)
        for setting, least in alone.mean_squares.items()
    }
    status = {Unknown(GAS_FOLLOWER): Status.SHARED}
    warnings = (*(() if solution.is_converged else (_NO_MINIMUM,)), *_judged_law(rises))
    return replace(
        _result(solution, way, free, result.evaluations + more - solution.evaluations),
        status=status | _statuses(solution, way),
        sharing=replace(result.sharing, gas=solution.gas, gas_rises=rises),
        warnings=warnings,
    )


def fit_from_one_model(
    given: ProcedureInput, way: Way, moving: tuple[str, ...], starts: Mapping[Setting, Values]
) -> JointResult:
    """Fit all settings together from where one model of them has ended already.

    Raises
    ------
    SimulationError
        A setting cannot be simulated there.
    FitCancelledError
        When the caller asked to stop.
    """
    free = given.ordered(moving)
    problems = {setting: given.problem(setting, free) for setting in given.settings}
    left = {s: 100.0 * one.whole.cost(starts[s]) for s, one in problems.items()}
    if any(percent < problems[s].solvers_percent for s, percent in left.items()):
        problems = {s: one.refined(left[s]) for s, one in problems.items()}
    tied = TiedProblem(problems, way.shared, way.follows, jobs=given.jobs)
    return _result(_fairly_weighed(tied, fit_jointly(tied, starts)), way, free, 0)


def _result(solution: JointSolution, way: Way, free: tuple[str, ...], spent: int) -> JointResult:
    """What a joint fit has reached, and what it has not."""
    sharing = Sharing(
        free,
        jointly=way.shared,
        follows=way.follows,
        is_detected=way.is_detected,
        settings=tuple(sorted(solution.parameters)),
    )
    warnings = [] if solution.is_converged else [_NO_MINIMUM]
    if not _is_fairly_weighed(solution):
        warnings.append(_WEIGHTS_MOVE)
    status, spent = _statuses(solution, way), spent + solution.evaluations
    return JointResult(solution, way, status, sharing, spent, tuple(warnings))


def _statuses(solution: JointSolution, way: Way) -> dict[Unknown, Status]:
    status = {}
    for unknown in unknowns_of(way.shared, way.follows, sorted(solution.parameters)):
        having = [at for s, at in solution.parameters.items() if unknown.holds_at(s)]
        one, value = having[0].quantity(unknown.name), getattr(having[0], unknown.name)
        low, high = one.plausible
        found = Status.SHARED if len(having) > 1 else Status.FITTED
        status[unknown] = found if low < value < high else Status.AT_BOUND
        if is_loose(one, value, solution.errors[unknown.label], NOT_FIT_TO_SHARE):
            status[unknown] = Status.NOT_IDENTIFIABLE
    return status


def _fairly_weighed(problem: TiedProblem, solution: JointSolution) -> JointSolution:
    """The joint fit with the weights that its own end gives the settings.

    Weights are of the start. Where shared values meet a setting badly there, what they miss is not
    its noise: a tenth of its weight moves the minimum as a wrong law would.
    """
    for _ in range(_MAX_ROUNDS):
        if _is_fairly_weighed(solution):
            break
        again = fit_jointly(problem, solution.parameters)
        solution = again._replace(evaluations=solution.evaluations + again.evaluations)
    return solution


def _is_fairly_weighed(solution: JointSolution) -> bool:
    shifts = [s * solution.weights[k] for k, s in solution.mean_squares.items()]
    return max(shifts) <= _SAME_WEIGHT * min(shifts)


def _helped(
    problems: Mapping[Setting, FitProblem], fits: Mapping[Setting, Fit], *, jobs: int
) -> tuple[dict[Setting, Values], int]:
    """Each setting's values; one that ended at a bound starts again from its sound neighbours'.

    A weak stroke may be read as a blow-off that is always open where its bleed is all that acts.
    """
    sound = [setting for setting, fit in fits.items() if fit.outcome is Outcome.CONVERGED]
    spent = dict.fromkeys(fits, 0)

    def helped(setting: Setting) -> Values:
        best, least = fits[setting].parameters, fits[setting].mse_percent
        nearest = sorted(sound, key=lambda other: (_steps(setting, other), other))
        is_lost = fits[setting].outcome is Outcome.AT_BOUND
        for other in nearest[:_NEIGHBOURS] if is_lost else ():
            start = best.replace(
                {n: getattr(fits[other].parameters, n) for n in problems[other].free}
            )
            found = attempted(setting, partial(minimised, problems[setting], start))
            if isinstance(found, SettingFailure):
                continue
            spent[setting] += found.evaluations
            if found.mse_percent < least:
                best, least = found.values, found.mse_percent
        return best

    with executor(jobs) as pool:
        found = dict(zip(fits, pool.map(helped, fits), strict=True))
    return found, max(spent.values())


def _steps(one: Setting, other: Setting) -> int:
    """How many adjusters stand elsewhere."""
    return sum(one.place(adjuster) != other.place(adjuster) for adjuster in one.adjusters)


def _common_starts(
    given: ProcedureInput, sound: Mapping[Setting, Fit], way: Way
) -> dict[Setting, Values]:
    """Each setting's own values, with what is shared equal already."""
    starts = {setting: fit.parameters for setting, fit in sound.items()}
    for one in unknowns_of(way.shared, way.follows, sorted(sound)):
        having = [setting for setting in sound if one.holds_at(setting)]
        value = _common(one.name, given, [sound[setting] for setting in having])
        for setting in having:
            starts[setting] = starts[setting].replace({one.name: value})
    return starts


def _common(name: str, given: ProcedureInput, fits: Sequence[Fit]) -> float:
    """Where a shared parameter starts: the mean, or its fallback where it was not determined.

    From a value without effect a logarithm would not come back; what may vanish is small there.
    """
    one = given.damper.quantity(name)
    known = None if one.may_vanish else given.options.fallback(one)
    if known is not None and any(f.status[name] == Status.NOT_IDENTIFIABLE for f in fits):
        return known
    return float(np.mean([getattr(fit.parameters, name) for fit in fits]))


def _with_gas(
    given: ProcedureInput, problem: TiedProblem, starts: Mapping[Setting, Values]
) -> tuple[JointSolution, int]:
    """Fit with K_e from a gas content; the working pressures are those of the fit itself."""
    moduli = {setting: getattr(start, GAS_FOLLOWER) for setting, start in starts.items()}
    pressures = _pressures(problem, starts)
    gas = first_law(moduli, pressures, cast("Damper", given.damper).gas_exponent)
    solution = fit_jointly(replace(problem, gas=gas), starts)
    spent = solution.evaluations + 1
    for _ in range(_MAX_ROUNDS):
        assert solution.gas is not None
        again = _pressures(problem, solution.parameters)
        moved = max(abs(again[s] / solution.gas.pressures[s] - 1.0) for s in again)
        # Once more in any case: the weights of the first round are those of a rough law.
        gas = solution.gas._replace(pressures=again)
        solution = fit_jointly(replace(problem, gas=gas), solution.parameters)
        spent += solution.evaluations + 1
        if moved < _SAME_PRESSURE:
            break
    return solution, spent


def _pressures(problem: TiedProblem, at: Mapping[Setting, Values]) -> dict[Setting, float]:
    found = {}
    for setting in problem.settings:
        one = problem.problems[setting]
        pressure = attempted(setting, partial(working_pressure, one, at[setting]))
        if isinstance(pressure, SettingFailure):
            raise SettingError(pressure)
        found[setting] = pressure
    return found


def _judged_law(rises: Mapping[Setting, float]) -> list[Problem]:
    """Say so when a K_e of each setting fits better than noise explains."""
    spare = len(rises) - _LAW_UNKNOWNS
    if spare < 1:
        text = (
            "the gas content is drawn through two settings: only a third can tell whether it holds."
        )
        return [warning("two-settings", text)]
    if sum(rises.values()) <= chi_squared_quantile(spare, 1.0 - _CHANCE):
        return []
    of_one = chi_squared_quantile(1, 1.0 - _CHANCE)
    worse = {setting: rise for setting, rise in rises.items() if rise > of_one}
    worst = max(rises, key=lambda setting: rises[setting])
    said = (
        "K_e does not follow Appendix 1 with one gas content: a K_e for each setting fits better "
        f"than noise explains at {len(worse)} of {len(rises)} settings, most at setting {worst}; "
        "take the gas content as a rough mean, its interval does not hold."
    )
    return [warning("gas-content", said)]
