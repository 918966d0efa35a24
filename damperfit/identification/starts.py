"""Where fits start: the model's own starts, what was given, neighbours, a Latin cube.

The cube lies over the logarithms of the free parameters, a factor of ten to both sides of the first
result (an offset: 300 N), the same in every run of one setting.
"""

from __future__ import annotations

import math
from collections import defaultdict
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING
from zlib import crc32

import numpy as np

from damperfit.errors import DamperfitError, FitCancelledError, SimulationError
from damperfit.identification.fit_problem import is_at_edge, kept_within
from damperfit.identification.fit_setting import (
    EXCELLENT,
    ROUGH,
    FitResult,
    descended,
    minimised,
)
from damperfit.identification.least_squares import Minimum, Stopping
from damperfit.identification.logs import inseparable
from damperfit.identification.outcome import Outcome, Status, attempted
from damperfit.identification.sharing import of_settings
from damperfit.problem import Failure
from damperfit.statistics import CHI_SQUARED_95
from damperfit.tested.setting import Setting
from damperfit.workers import executor

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from damperfit.damper.model import Values
    from damperfit.identification.fit_problem import Block
    from damperfit.identification.fit_setting import Fit
    from damperfit.identification.procedures import ProcedureInput

# Structures are compared by factors of their MSE: a fall of a few in ten thousand changes nothing.
COMPARING = Stopping(
    cost_tolerance=3e-4, step_tolerance=1e-4, max_evaluations=60, rest=math.inf, near=5e-3
)
# Starts that are followed for a few evaluations before the best is followed to its end: so many, or
# one beside those that are known.
_TRIED = 3
_SHORT = Stopping(cost_tolerance=1e-2, step_tolerance=1e-3, max_evaluations=8, rest=math.inf)
# Of the force's deviation: starts with offsets or frictions that are so far apart are two places.
_APART = 0.1
# Times the scatter between cycles: a minimum that is there needs no other start.
_AS_EXPECTED = 2.0
_OF_VALVES = ("bleed", "opening", "slope")
# A sound minimum is preferred to a cavitating one unless that one is better by this factor.
_CLEARLY_BETTER = 1.5
# Neighbours from which a setting at a bound starts again: one along each of two adjusters.
_NEIGHBOURS = 2
# Factor to both sides that the cube spreads over; of a linear quantity, in units of its size.
SPREAD = 10.0
_LINEAR_SPREAD = 3.0
_SEED = 20
_SHOWN = 4
# Two ends are one minimum when their parameters are this near, or this many standard errors.
_SAME = 0.01
_SAME_ERRORS = 1.0


# The model's own start, and what somebody has said.


def own_start(
    given: ProcedureInput, setting: Setting, block: Block, fixed: Mapping[str, float]
) -> Values:
    """Where the fit of a setting starts: as somebody has said, else the model's start.

    Of several the one that fits the first log best; with kinks, which make a descent long, where
    the best lead, followed on mean cycles as far as the motions repeat.
    """
    starts = block.model.start(block.traces, fixed)
    starts = tuple({with_given(given, setting, one, fixed): None for one in starts})
    if len(starts) == 1:
        return starts[0]
    try:
        coarse = replace(block, cycles=None)
        coarse = coarse.on_cycles() if block.model.kinks else coarse
        if coarse.cycles is not None:
            return best_of_starts(coarse, starts, is_thorough=True).extra
    except SimulationError:
        return starts[0]
    ranked = _best_fitting(replace(coarse, traces=block.traces[:1]), starts)
    return ranked[0] if ranked else starts[0]


def with_given(
    given: ProcedureInput, setting: Setting, start: Values, fixed: Mapping[str, float]
) -> Values:
    """A start with what somebody has said that the fit of a setting starts at."""
    said = given.options.start.of(setting)
    said = {name: said[name] for name in given.ordered(said) if name not in fixed}
    # What stands at its default is held there, also at nothing, beyond what a fit may find.
    moved = [name for name, x in said.items() if x != start.quantity(name).default]
    return kept_within(start.replace(said), moved)


# Further starts: from a minimum that is not sound.


def fit_setting(block: Block, start: Values, *, spent: int = 0) -> FitResult:
    """Fit the free parameters of one setting.

    One that ends unsound is tried again from the model's further starts. The paper's lie below the
    onset of cavitation, and the better sound minimum is kept; where that gives neither a sound one
    nor a good one that cavitates, others lie beyond the onset.
    """
    best = minimised(block, start, spent=spent)
    if names := inseparable(block.facts, block.free, block.model.quantities):
        loose = {Status.FITTED, Status.AT_BOUND}  # at a bound one is by accident
        lost = {name: Status.NOT_IDENTIFIABLE for name in names if best.status[name] in loose}
        outcome = best.outcome
        if outcome in {Outcome.CONVERGED, Outcome.CAVITATING, Outcome.AT_BOUND}:
            outcome = Outcome.NOT_IDENTIFIABLE
        return replace(best.with_status(lost), outcome=outcome)
    # Which is too good for a wrong minimum, which an offset may hide.
    has_offset = any(block.model.quantity(name).is_offset for name in block.free)
    for further_start in block.model.further_starts(start, block.traces, block.free):
        is_cavitating = best.outcome is Outcome.CAVITATING
        is_explained = is_cavitating and best.mse_percent < EXCELLENT and not has_offset
        is_enough = is_explained or lacks_stiffness_alone(best)
        if best.is_sound or (further_start.is_last_resort and is_enough):
            break
        try:
            other = fit_in_stages(block, further_start.start, further_start.held)
        except SimulationError:
            continue
        is_much_better = other.mse_percent * _CLEARLY_BETTER < best.mse_percent
        is_much_worse = best.mse_percent * _CLEARLY_BETTER < other.mse_percent
        is_better = best.mse_percent > other.mse_percent
        if further_start.is_last_resort:
            is_better = is_much_better
        elif other.is_sound:
            is_better = not (is_much_worse and is_cavitating)
        evaluations = best.evaluations + other.evaluations
        best = replace(other if is_better else best, evaluations=evaluations)
    return best


def fit_in_stages(
    block: Block,
    start: Values,
    stages: Sequence[frozenset[str]],
    *,
    has_further_starts: bool = False,
) -> FitResult:
    """Fit after rough descents that hold some at the start, stage by stage."""
    spent, rough = 0, block
    if block.cycles is None:  # the log with the strongest force determines the valves best
        strongest = max(block.traces, key=lambda one: float(np.std(one.force[one.compared])))
        rough = replace(block, traces=(strongest,))
    for held in stages:
        free = tuple(name for name in block.free if name not in held)
        near = descended(replace(rough, free=free), start, ROUGH)
        start, spent = near.values, spent + near.evaluations
    return (fit_setting if has_further_starts else minimised)(block, start, spent=spent)


def lacks_stiffness_alone(result: FitResult) -> bool:
    """Whether a fit that does not cavitate is excellent and lacks nothing but K_e: rigid oil."""
    is_open = {one.name for one in result.values.quantities if one.is_open}
    others = all(
        status in {Status.FITTED, Status.FIXED}
        for name, status in result.status.items()
        if name not in is_open
    )
    is_lost = any(result.status[name] == Status.NOT_IDENTIFIABLE for name in is_open)
    return others and is_lost and not result.is_cavitating and result.mse_percent < EXCELLENT


# Neighbours: from what other settings have ended at.


def from_neighbours(
    blocks: Mapping[Setting, Block], fits: Mapping[Setting, Fit], *, jobs: int
) -> tuple[dict[Setting, Values], int]:
    """Each setting's values; one that ended at a bound starts again from its sound neighbours'."""
    sound = [setting for setting, fit in fits.items() if fit.outcome is Outcome.CONVERGED]
    spent = dict.fromkeys(fits, 0)

    def steps(one: Setting, other: Setting) -> int:
        return sum(one.place(adjuster) != other.place(adjuster) for adjuster in one.adjusters)

    def helped(setting: Setting) -> Values:
        best, least = fits[setting].parameters, fits[setting].mse_percent
        nearest = sorted(sound, key=lambda other: (steps(setting, other), other))
        is_lost = fits[setting].outcome is Outcome.AT_BOUND
        for other in nearest[:_NEIGHBOURS] if is_lost else ():
            lent = {n: getattr(fits[other].parameters, n) for n in blocks[other].free}
            result = attempted(setting, partial(minimised, blocks[setting], best.replace(lent)))
            if isinstance(result, Failure):
                continue
            spent[setting] += result.evaluations
            if result.mse_percent < least:
                best, least = result.values, result.mse_percent
        return best

    with executor(jobs) as pool:
        values = dict(zip(fits, pool.map(helped, fits), strict=True))
    return values, max(spent.values())


# A Latin cube around a result.


@dataclass(frozen=True, slots=True)
class LocalMinimum:
    """A minimum that some of the starts ended in."""

    parameters: Values  # the best end
    mse_percent: float  # eq. (22) there
    outcome: str  # how that descent ended
    n_starts: int  # that ended here


@dataclass(frozen=True, slots=True)
class Search:
    """What the starts of one setting found."""

    setting: Setting
    free: tuple[str, ...]  # values that the starts were spread in
    minima: tuple[LocalMinimum, ...]  # by rising MSE
    n_starts: int  # descents, the procedure's own among them,
    n_failed: int  # and those whose start could not be simulated
    is_improved: bool  # a start found a better minimum than the procedure's own; it is used
    is_ambiguous: bool  # different minima fit equally well

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
    endings: dict[str, list[Setting]] = defaultdict(list)
    for one in searches:
        many = f"{', '.join(one.free)} free, {one.n_starts} starts"
        if one.n_failed:
            many += f" of which {one.n_failed} could not be simulated"
        more = f" and {len(one.minima) - _SHOWN} more" if len(one.minima) > _SHOWN else ""
        ends = ", ".join(
            f"{end.mse_percent:.3g} % ({end.n_starts}, {end.outcome})"
            for end in one.minima[:_SHOWN]
        )
        is_one = len(one.minima) == 1
        ending = (
            "all end in one minimum" if is_one else f"{len(one.minima)} minima, with MSE {ends}"
        )
        endings[f"{many}: {ending}{more}"].append(one.setting)
    return tuple(f"{of_settings(settings)}, {words}" for words, settings in endings.items())


def fit_from(
    setting: Setting, block: Block, start: Values, *, starts: int, spent: int = 0
) -> tuple[FitResult, Search | None]:
    """Fit from a start, and from as many more as the options ask for; the best sound result."""
    first = fit_setting(block, start, spent=spent)
    if starts < 2 or not block.free:
        return first, None
    ends = [first]
    for other in spread_starts(block, first.values, setting, starts - 1):
        try:
            ends.append(fit_setting(block, other))
        except FitCancelledError:
            raise
        except DamperfitError:
            continue
    groups = _grouped(ends, block)
    best = groups[0][0]
    is_improved = first not in groups[0] and not _is_level(best, first)
    sound = [group[0] for group in groups if group[0].is_sound]
    minima = [
        LocalMinimum(one[0].values, one[0].mse_percent, one[0].outcome.value, len(one))
        for one in groups
    ]
    search = Search(
        setting=setting,
        free=block.free,
        minima=tuple(minima),
        n_starts=starts,
        n_failed=starts - len(ends),
        is_improved=is_improved,
        is_ambiguous=len(sound) > 1 and sound[0] is best and _is_level(sound[0], sound[1]),
    )
    spent = sum(end.evaluations for end in ends)
    return replace(best if is_improved else first, evaluations=spent), search


def spread_starts(
    block: Block, centre: Values, setting: Setting, number: int
) -> tuple[Values, ...]:
    """Starts spread over a Latin hypercube around a point; always the same ones of a setting."""
    from scipy.stats import qmc  # slow to import: only a search from many starts pays

    cell = Setting.of(setting).cell
    own_seed = cell if isinstance(cell, int) and cell >= 0 else crc32(str(cell).encode())
    random = np.random.default_rng([_SEED, own_seed])
    cube = qmc.LatinHypercube(len(block.free), rng=random).random(number)
    columns = {}
    for name, away in zip(block.free, 2.0 * cube.T - 1.0, strict=True):
        value, one = getattr(centre, name), centre.quantity(name)
        columns[name] = (
            value * SPREAD**away if one.is_logarithmic else value + _LINEAR_SPREAD * one.size * away
        )
    return tuple(
        centre.replace({name: float(values[k]) for name, values in columns.items()})
        for k in range(number)
    )


def _grouped(ends: Sequence[FitResult], block: Block) -> list[list[FitResult]]:
    """Ends of one minimum together, best first; sound minima before the others."""
    groups: list[list[FitResult]] = []
    for end in sorted(ends, key=lambda one: one.mse_percent):
        same = next((group for group in groups if _is_same(group[0], end, block)), None)
        if same is None:
            groups.append([end])
        else:
            same.append(end)
    return sorted(groups, key=lambda group: (not group[0].is_sound, group[0].mse_percent))


def _is_same(one: FitResult, other: FitResult, block: Block) -> bool:
    """Whether all parameters that the logs tell agree."""
    for name, error in one.errors.items():
        if one.status[name] != Status.FITTED and other.status[name] == one.status[name]:
            continue  # a flat direction is one minimum however far along it a descent stopped
        a, b = one.values, other.values
        quantity = a.quantity(name)
        if not quantity.is_logarithmic:
            unit = block.deviation if quantity.is_offset else quantity.size
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


# The best of several starts.


def best_of_starts(
    block: Block, starts: Sequence[Values], *, known: int = 0, is_thorough: bool = False
) -> Minimum[Values]:
    """Where the best of some starts leads; so many of the first are followed in any case.

    Those that fit best, with unlike offsets or frictions, are followed for a few evaluations, the
    best of them to its end; where it loses a valve's part there, the next start is followed too.
    Thoroughly, the others are followed until one leaves about what differs by cycle.
    """
    ranked = [*starts[:known], *_in_turn(block, _best_fitting(block, starts[known:]))]
    looks: list[Minimum[Values]] = []
    expected = _AS_EXPECTED * block.scatter  # then no other start is needed
    many = known + 1 if known else _TRIED
    for start in ranked[:many]:
        with suppress(SimulationError):
            looks.append(block.descend(start, _SHORT))
            if looks[-1].cost <= expected:
                break
    if not looks:
        raise SimulationError(
            f"{block.model.name} cannot be simulated from any of its starts.", code="no-start"
        )
    spent = sum(one.evaluations for one in looks)
    best, *others = sorted(looks, key=lambda one: one.cost)
    ended = block.descend(best.extra, COMPARING)
    spent += ended.evaluations
    further = [(look.extra, False) for look in others] if is_thorough else []

    for start, is_next in (*further, *((one, True) for one in ranked[many : many + 1])):
        # The starts that fit best may share what is wrong in them, an offset that hides a blow-off.
        if ended.cost <= expected or (is_next and not _lost_a_valve(block, ended)):
            break
        with suppress(SimulationError):
            other = block.descend(start, COMPARING)
            spent += other.evaluations
            ended = min(ended, other, key=lambda one: one.cost)
    return replace(ended, evaluations=spent)


def _lost_a_valve(block: Block, ended: Minimum[Values]) -> bool:
    """Whether a bleed or a blow-off ran out of its range."""
    return any(
        block.model.quantity(name).part in _OF_VALVES and is_at_edge(ended.extra, name)
        for name in block.free
    )


def _in_turn(block: Block, ranked: list[Values]) -> list[Values]:
    """Starts in the order in which they are followed: the best, then the best unlike it."""
    # An offset or a friction that hides a preload fits best at the start and leads nowhere else.
    of = {name: block.model.quantity(name) for name in block.free}
    forces = [name for name, one in of.items() if one.is_offset or one.is_friction]
    least = _APART * block.deviation
    first: list[Values] = []
    for one in ranked:
        apart = (
            any(abs(getattr(one, name) - getattr(other, name)) > least for name in forces)
            for other in first
        )
        if all(apart):
            first.append(one)
    return [*first, *(one for one in ranked if one not in first)]


def _best_fitting(block: Block, starts: Sequence[Values]) -> list[Values]:
    """Starts by how well they fit, the best first; what cannot be simulated is left out."""
    if len(starts) < 2:
        return list(starts)
    costs = []
    for place, start in enumerate(starts):
        with suppress(SimulationError):
            costs.append((block.cost(start), place))
    return [starts[place] for _, place in sorted(costs)]
