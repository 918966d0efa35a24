"""Where a fit starts: the model's own starts, the best of several, a Latin cube around a result.

The cube lies over the logarithms of the free parameters, a factor of ten to both sides of the first
result (an offset: 300 N), the same in every run of one setting.
"""

from __future__ import annotations

import math
from collections import defaultdict
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING
from zlib import crc32

import numpy as np

from damperfit.errors import DamperfitError, FitCancelledError, SimulationError
from damperfit.identification.fit_setting import FitResult, fit_setting
from damperfit.identification.least_squares import Minimum, Stopping
from damperfit.identification.outcome import Status
from damperfit.identification.sharing import of_settings
from damperfit.statistics import CHI_SQUARED_95
from damperfit.tested.setting import Setting

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from damperfit.damper.model import Values
    from damperfit.identification.fit_problem import FitProblem

__all__ = [
    "COMPARING",
    "SHORT",
    "SPREAD",
    "LocalMinimum",
    "Search",
    "best_fitting",
    "best_of_starts",
    "describe_searches",
    "fit_from",
    "is_as_expected",
    "search",
    "spread_starts",
]

# Structures are compared by factors of their MSE: a fall of a few in ten thousand changes nothing.
COMPARING = Stopping(
    cost_tolerance=3e-4, step_tolerance=1e-4, max_evaluations=60, rest=math.inf, near=5e-3
)
# Starts that are followed for a few evaluations before the best is followed to its end: so many, or
# one beside those that are known.
_TRIED = 3
SHORT = Stopping(cost_tolerance=1e-2, step_tolerance=1e-3, max_evaluations=8, rest=math.inf)
# Of the force's deviation: starts with offsets or frictions that are so far apart are two places.
_APART = 0.1
# Times the scatter between cycles: a minimum that is there needs no other start.
_AS_EXPECTED = 2.0
_OF_VALVES = ("bleed", "opening", "slope")

# Factor to both sides that the starts are spread over; of a linear quantity, in units of its size.
SPREAD = 10.0
_LINEAR_SPREAD = 3.0
_SEED = 20
_SHOWN = 4
# Two ends are one minimum when their parameters are this near, or this many standard errors.
_SAME = 0.01
_SAME_ERRORS = 1.0


@dataclass(frozen=True, slots=True)
class LocalMinimum:
    """A minimum that some of the starts ended in.

    Attributes
    ----------
    parameters : Values
        The best end.
    mse_percent : float
        Eq. (22) there.
    outcome : str
        How that descent ended.
    n_starts : int
        Starts that ended here.
    """

    parameters: Values
    mse_percent: float
    outcome: str
    n_starts: int


@dataclass(frozen=True, slots=True)
class Search:
    """What the starts of one setting found.

    Attributes
    ----------
    setting : Setting
        Adjuster setting.
    free : tuple of str
        Values that the starts were spread in.
    minima : tuple of LocalMinimum
        By rising MSE.
    n_starts, n_failed : int
        Descents, the procedure's own among them, and those whose start could not be simulated.
    is_improved : bool
        Whether a start found a better minimum than the procedure's own; it is used.
    is_ambiguous : bool
        Whether different minima fit equally well.
    """

    setting: Setting
    free: tuple[str, ...]
    minima: tuple[LocalMinimum, ...]
    n_starts: int
    n_failed: int
    is_improved: bool
    is_ambiguous: bool

    @property
    def warning(self) -> str:
        """What the reader should know before believing the numbers; empty where all is well."""
        if self.is_ambiguous:
            one, two = self.minima[:2]
            apart = ", ".join(
                f"{name} {getattr(one.parameters, name):.4g} or {getattr(two.parameters, name):.4g}"
                for name in self.free
                if not _is_near(one.parameters, two.parameters, name)
            )
            return f"different minima fit equally well: {apart}"
        if self.is_improved:
            return "a better minimum than from the procedure's own start was found, and is used"
        return ""


def describe_searches(searches: Iterable[Search]) -> tuple[str, ...]:
    """Return what the starts found, for people: one sentence for each kind of ending."""
    said: dict[str, list[Setting]] = defaultdict(list)
    for one in searches:
        said[_ending(one)].append(one.setting)
    return tuple(f"{of_settings(settings)}, {words}" for words, settings in said.items())


def _ending(one: Search) -> str:
    many = f"{', '.join(one.free)} free, {one.n_starts} starts"
    if one.n_failed:
        many += f" of which {one.n_failed} could not be simulated"
    if len(one.minima) == 1:
        return f"{many}: all end in one minimum"
    ends = ", ".join(
        f"{end.mse_percent:.3g} % ({end.n_starts}, {end.outcome})" for end in one.minima[:_SHOWN]
    )
    more = f" and {len(one.minima) - _SHOWN} more" if len(one.minima) > _SHOWN else ""
    return f"{many}: {len(one.minima)} minima, with MSE {ends}{more}"


def fit_from(
    setting: Setting, problem: FitProblem, start: Values, *, starts: int, spent: int = 0
) -> tuple[FitResult, Search | None]:
    """Fit from a start, and from as many more as the options ask for."""
    first = fit_setting(problem, start, spent=spent)
    if starts < 2 or not problem.free:
        return first, None
    return search(setting, problem, first, n_starts=starts)


def search(
    setting: Setting, problem: FitProblem, first: FitResult, *, n_starts: int
) -> tuple[FitResult, Search]:
    """Fit from further starts; returns the best sound result and what was found.

    Parameters
    ----------
    setting : Setting
        Adjuster setting; it also seeds the starts.
    problem : FitProblem
        Logs, damper and what is free.
    first : FitResult
        Result from the procedure's own start.
    n_starts : int
        Descents in all, the first among them.

    Raises
    ------
    FitCancelledError
        When the caller asked to stop.
    """
    ends = [first]
    for start in spread_starts(problem, first.values, setting, n_starts - 1):
        try:
            ends.append(fit_setting(problem, start))
        except FitCancelledError:
            raise
        except DamperfitError:
            continue
    groups = _grouped(ends, problem)
    spent = sum(end.evaluations for end in ends)
    best = groups[0][0]
    is_improved = first not in groups[0] and not _is_level(best, first)
    chosen = best if is_improved else first
    sound = [group[0] for group in groups if group[0].is_sound]
    found = Search(
        setting=setting,
        free=problem.free,
        minima=tuple(
            LocalMinimum(
                group[0].values,
                group[0].mse_percent,
                group[0].outcome.value,
                len(group),
            )
            for group in groups
        ),
        n_starts=n_starts,
        n_failed=n_starts - len(ends),
        is_improved=is_improved,
        is_ambiguous=len(sound) > 1 and sound[0] is best and _is_level(sound[0], sound[1]),
    )
    return replace(chosen, evaluations=spent), found


def _seed_of(setting: Setting) -> int:
    """A number of the setting's own, the same in every run; whole clicks are their own."""
    cell = Setting.of(setting).cell
    return cell if isinstance(cell, int) and cell >= 0 else crc32(str(cell).encode())


def spread_starts(
    problem: FitProblem, centre: Values, setting: Setting, number: int
) -> tuple[Values, ...]:
    """Return starts spread over a Latin hypercube around a point; always the same ones."""
    from scipy.stats import qmc  # slow to import: only a search from many starts pays

    random = np.random.default_rng([_SEED, _seed_of(setting)])
    cube = qmc.LatinHypercube(len(problem.free), rng=random).random(number)
    columns = {}
    for name, away in zip(problem.free, 2.0 * cube.T - 1.0, strict=True):
        value = getattr(centre, name)
        one = centre.quantity(name)
        columns[name] = (
            value * SPREAD**away if one.is_logarithmic else value + _LINEAR_SPREAD * one.size * away
        )
    return tuple(
        centre.replace({name: float(values[k]) for name, values in columns.items()})
        for k in range(number)
    )


def _grouped(ends: Sequence[FitResult], problem: FitProblem) -> list[list[FitResult]]:
    """Ends of one minimum together, best first; sound minima before the others."""
    groups: list[list[FitResult]] = []
    for end in sorted(ends, key=lambda one: one.mse_percent):
        for group in groups:
            if _is_same(group[0], end, problem):
                group.append(end)
                break
        else:
            groups.append([end])
    return sorted(groups, key=lambda group: (not group[0].is_sound, group[0].mse_percent))


def _is_same(one: FitResult, other: FitResult, problem: FitProblem) -> bool:
    """Whether all parameters that the logs tell agree."""
    for name, error in one.errors.items():
        if one.status[name] != Status.FITTED and other.status[name] == one.status[name]:
            continue  # a flat direction is one minimum however far along it a descent stopped
        a, b = one.values, other.values
        quantity = a.quantity(name)
        if not quantity.is_logarithmic:
            unit = problem.deviation if quantity.is_offset else quantity.size
            apart = abs(getattr(a, name) - getattr(b, name))
            if apart > max(_SAME * quantity.size, _SAME_ERRORS * error * unit):
                return False
        elif not _is_near(a, b, name, max(_SAME, _SAME_ERRORS * error)):
            return False
    return True


def _is_near(a: Values, b: Values, name: str, limit: float = _SAME) -> bool:
    one, other = getattr(a, name), getattr(b, name)
    return bool(abs(one - other) <= limit * max(abs(one), abs(other), 1e-300))


def _is_level(best: FitResult, other: FitResult) -> bool:
    """Whether noise alone may make the difference of two misfits."""
    rise = other.mse_percent / max(best.mse_percent, 1e-300) - 1.0
    return bool(rise * best.n_independent < CHI_SQUARED_95)


def is_as_expected(problem: FitProblem, ended: Minimum[Values]) -> bool:
    """Whether a descent has left about what differs by cycle, and needs no other start.

    Parameters
    ----------
    problem : FitProblem
        What is fitted.
    ended : Minimum
        Where it has ended.
    """
    return ended.cost <= _AS_EXPECTED * problem.scatter


def best_of_starts(
    problem: FitProblem,
    starts: Sequence[Values],
    *,
    known: int = 0,
    hopeless: float = math.inf,
    is_thorough: bool = False,
) -> Minimum[Values]:
    """Return where the best of some starts leads.

    Those that fit best, with unlike offsets or frictions, are followed for a few evaluations, the
    best of them to its end; where it loses a bleed or a blow-off there, the next start is followed
    too.

    Parameters
    ----------
    problem : FitProblem
        What is fitted.
    starts : sequence of Values
        Where to start from.
    known : int
        So many of the first starts are followed however badly they fit.
    hopeless : float
        Where the few evaluations leave more than this, nothing is followed to its end.
    is_thorough : bool
        Whether the others are followed to their ends too, until one leaves about what differs by
        cycle: after a few evaluations a wrong minimum may look better than the right one.

    Raises
    ------
    SimulationError
        The law cannot be simulated at any of them.
    """
    ranked = [*starts[:known], *_in_turn(problem, best_fitting(problem, starts[known:]))]
    looks: list[Minimum[Values]] = []
    many = known + 1 if known else _TRIED
    for start in ranked[:many]:
        with suppress(SimulationError):
            looks.append(problem.descend(start, SHORT))
            if is_as_expected(problem, looks[-1]):
                break
    if not looks:
        raise SimulationError(
            f"{problem.model.name} cannot be simulated from any of its starts.", code="no-start"
        )
    spent = sum(one.evaluations for one in looks)
    best, *others = sorted(looks, key=lambda one: one.cost)
    if best.cost > hopeless:
        return replace(best, evaluations=spent)
    ended = problem.descend(best.extra, COMPARING)
    spent += ended.evaluations
    for look in others if is_thorough else ():
        if is_as_expected(problem, ended):
            break
        with suppress(SimulationError):
            other = problem.descend(look.extra, COMPARING)
            spent += other.evaluations
            ended = min(ended, other, key=lambda one: one.cost)
    left = ranked[many:]
    if left and _lost_a_valve(problem, ended):
        last = _descended(problem, left[0])
        if last is not None:
            spent += last.evaluations
            ended = min(ended, last, key=lambda one: one.cost)
    return replace(ended, evaluations=spent)


def _in_turn(problem: FitProblem, ranked: list[Values]) -> list[Values]:
    """Starts in the order in which they are followed: the best, then the best that is none of it.

    An offset or a friction that hides a preload fits best at the start and leads nowhere else.
    """
    if len(ranked) < 2:
        return ranked
    of = {name: problem.model.quantity(name) for name in problem.free}
    forces = [name for name, one in of.items() if one.is_offset or one.is_friction]
    least = _APART * problem.deviation

    def is_apart(one: Values, other: Values) -> bool:
        return any(abs(getattr(one, name) - getattr(other, name)) > least for name in forces)

    first: list[Values] = []
    for one in ranked:
        if all(is_apart(one, other) for other in first):
            first.append(one)
    return [*first, *(one for one in ranked if one not in first)]


def _lost_a_valve(problem: FitProblem, ended: Minimum[Values]) -> bool:
    """Whether a bleed or a blow-off ran out of its range, and more is left than differs by cycle.

    The starts that fit best may share what is wrong in them, an offset that hides a blow-off.
    """
    if is_as_expected(problem, ended):
        return False
    return any(
        problem.model.quantity(name).part in _OF_VALVES and problem.is_at_edge(ended.extra, name)
        for name in problem.free
    )


def _descended(problem: FitProblem, start: Values) -> Minimum[Values] | None:
    try:
        return problem.descend(start, COMPARING)
    except SimulationError:
        return None


def best_fitting(problem: FitProblem, starts: Sequence[Values]) -> list[Values]:
    """Return starts by how well they fit, the best first; what cannot be simulated is left out."""
    if len(starts) < 2:
        return list(starts)
    found = []
    for place, start in enumerate(starts):
        try:
            found.append((problem.cost(start), place, start))
        except SimulationError:
            continue
    return [start for _, _, start in sorted(found, key=lambda one: one[:2])]
