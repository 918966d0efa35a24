"""One setting's fit: from several starts, on mean cycles and on the logs, and how it ended.

Fits start where somebody has said, at the model's own starts, or on a Latin cube over the
logarithms of the free parameters, a factor of ten to both sides of the first result (an offset:
300 N), the same in every run of one setting.

Where the logs repeat, the minimum of their mean cycles is found first. Noise of the displacement
drives the model in the logs and is averaged out of the mean cycle, so that the minima lie up to
half an error apart: one step of Gauss and Newton on the logs, not evaluated again, leads there.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import islice
from typing import TYPE_CHECKING
from zlib import crc32

import numpy as np

from damperfit.conditioning.noise import noise_floor
from damperfit.damper.model import Quantity, Values
from damperfit.errors import DamperfitError, FitCancelledError, SimulationError
from damperfit.identification.fit_problem import (
    Block,
    Point,
    is_at_edge,
    is_within,
    kept_within,
    values_of,
    with_values,
)
from damperfit.identification.least_squares import Minimum, Stopping, inverse_information
from damperfit.identification.logs import (
    LogFit,
    compare,
    inseparable,
    normalised_mse,
    speed_warnings,
)
from damperfit.identification.outcome import Outcome, Status
from damperfit.identification.sharing import of_settings
from damperfit.problem import Problem, warning
from damperfit.statistics import CHI_SQUARED_95, largest_of
from damperfit.tested.setting import Setting

if TYPE_CHECKING:
    from damperfit.damper.cylinder import Cavitation
    from damperfit.identification.procedures import ProcedureInput


# A relative change of the sum of squares below 1e-8 moves no parameter by 1 % of its error; a
# start for another minimisation needs no more than a per cent.
# No step changes a value by more than a factor of ten: beyond lie bounds and plateaus.
_LONGEST = math.log(10.0)
_FINE = Stopping(cost_tolerance=1e-8, longest_step=_LONGEST)
ROUGH = Stopping(cost_tolerance=1e-2, rest=math.inf, longest_step=_LONGEST)
# On mean cycles a tenth of an error is near enough: the last step is taken on the logs.
_NEAR = Stopping(
    cost_tolerance=1e-5,
    step_tolerance=1e-6,
    rest=math.inf,
    least_share=1e-5,
    longest_step=_LONGEST,
)
_LIMIT, _MET_COST = 0, 2  # endings, as `Minimum.status` has them
# The largest relative change of a value in a step that is not evaluated, and the most errors that
# it may be: what it leaves out is its square, 4e-4, a twentieth of an error of 1 %.
_SMALL = 0.02
_AN_ERROR = 1.0
# A number with a standard error above this share of itself is not found by the fit. One that all
# settings are to share must be three errors away from nothing: it bends every one of them.
NOT_DETERMINED = 0.5
NOT_FIT_TO_SHARE = 1.0 / 3.0
# Friction below this share of the force's deviation that the logs do not fix has run to zero.
_NO_FRICTION = 1e-2
# A fit that meets none of MINPACK's tests has still reached its minimum when the residual is this
# close to a right angle with every direction of the Jacobian; a misfit with kinks may stop at so
# many times the cosine that the least promised fall would have.
_RIGHT_ANGLE = 1e-3
_AMONG_KINKS = 1.5
# A fit that no step makes better, while the full step promises less than half an error, is at its
# minimum as far as anyone sees: the integrator's own error and kinks let no step lead further.
_NO_ERROR = 0.5
# MSE in per cent that the paper calls excellent; that of a wrong local minimum is about 2 %.
EXCELLENT = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class FitResult:
    """Where the fit of one setting ended, and what it says of each quantity."""

    free: tuple[str, ...]  # what moved
    values: Values  # best point found
    minimum: Minimum[Point]  # of which these are the values; the sum of squares is the MSE's share
    status: dict[str, Status] = field(default_factory=dict)
    outcome: Outcome = Outcome.CONVERGED
    # Rough, relative ones of what is free: textbook covariance with so many samples; infinite where
    # the logs say nothing.
    errors: Mapping[str, float] = field(default_factory=dict)

    @property
    def mse_percent(self) -> float:
        """Eq. (22), each segment with its weight."""
        return 100.0 * self.minimum.cost

    @property
    def evaluations(self) -> int:
        """Simulations of the whole setting."""
        return self.minimum.evaluations

    @property
    def n_independent(self) -> float:
        """Twice the residuals' sign changes."""
        # White ones change sign at every other sample; those behind a low-pass of B Hz 1.15 B times
        # a second, where 2 B samples a second are independent.
        (n,) = self.minimum.extra.n_independent.values()
        return n

    @property
    def is_sound(self) -> bool:
        """Whether it is a minimum that means something."""
        return self.outcome is Outcome.CONVERGED

    def after(self, evaluations: int, failed_trials: int = 0) -> FitResult:
        """The same with the simulations made before it."""
        counts = evaluations + self.evaluations, failed_trials + self.minimum.failed_trials
        minimum = replace(self.minimum, evaluations=counts[0], failed_trials=counts[1])
        return replace(self, minimum=minimum)

    def with_status(self, status: Mapping[str, Status]) -> FitResult:
        """The same with what another fit says of some quantities."""
        return replace(self, status={**self.status, **status})


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """One setting's parameters and how far the fit itself vouches for them."""

    setting: Setting
    parameters: Values  # SI
    status: Mapping[str, Status]  # of each parameter
    outcome: Outcome  # how the fit ended
    mse_percent: float  # eq. (22) over all logs of the setting,
    noise_floor_percent: float  # and the share that is scatter between cycles
    n_samples: int  # samples and cycles compared
    n_cycles: int
    evaluations: int  # simulations
    cavitation: Cavitation  # share of the time, lowest pressure, margins to the onset
    logs: tuple[LogFit, ...]  # fitted together
    warnings: tuple[Problem, ...] = ()


def minimised(block: Block, start: Values, *, nfev: int = 0) -> FitResult:
    """The minimum that a start leads to, with the evaluations made before it."""
    result = _fit(block, start)
    at, n = result.minimum, result.n_independent
    errors = np.sqrt(np.diag(inverse_information(at.system.triangle)) * (at.cost / n))
    by_name = dict(zip(block.free, errors.tolist(), strict=True))
    status = _statuses(block, result, by_name)
    # How many standard errors the full step is long that is left.
    promised = math.sqrt(at.promised() * n / max(at.cost, 1e-300))
    right_angle = max(_RIGHT_ANGLE, _AMONG_KINKS * math.sqrt(block.model.kinks))
    is_minimum = at.gradient_cosine < right_angle or result.mse_percent < 1e-8
    applies = {
        Outcome.AT_BOUND: Status.AT_BOUND in status.values(),
        Outcome.NOT_IDENTIFIABLE: Status.NOT_IDENTIFIABLE in status.values(),
        Outcome.CAVITATING: at.extra.is_cavitating,
        Outcome.CONVERGED: is_minimum or promised < _NO_ERROR,
        Outcome.EVALUATION_LIMIT: at.status == _LIMIT,
        Outcome.NOT_FINITE: at.failed_trials > 0,
        Outcome.NO_DESCENT: True,
    }
    outcome = next(outcome for outcome, is_so in applies.items() if is_so)
    return replace(result, status=status, outcome=outcome, errors=by_name).after(nfev)


def _fit(block: Block, start: Values) -> FitResult:
    if block.cycles is None or block.max_evaluations == 1:
        return _on_logs(block.whole, start)
    cycles = replace(block, max_evaluations=block.max_evaluations - 1)  # the logs have one more
    try:
        near = descended(cycles, start, _NEAR)
    except SimulationError:
        return _on_logs(block.whole, start)
    left = max(block.max_evaluations - near.evaluations, 1)
    logs = replace(block, cycles=None, max_evaluations=left)
    if block.cancelled():
        raise FitCancelledError("stopped while a fit was running.", code="cancelled")
    result = None if near.minimum.status == _LIMIT else _last_step(logs, near.values)
    result = result or _on_logs(logs, near.values)
    return result.after(near.evaluations, near.minimum.failed_trials)


def _on_logs(block: Block, start: Values) -> FitResult:
    """The minimum of the logs, with a tighter integrator if its error is what is left."""
    result = descended(block, start, _FINE)
    if result.mse_percent > block.solvers_percent:
        return result
    try:
        refined = descended(block.refined(result.mse_percent), result.values, _FINE)
    except SimulationError:
        # The tighter integrator has failed where the other did not: what it found stands.
        return result.after(1, 1)
    return refined.after(result.evaluations, result.minimum.failed_trials)


def _last_step(block: Block, near: Values) -> FitResult | None:
    """The full step on the logs from the minimum of their mean cycles, not evaluated again.

    None where it changes a value by more than `_SMALL`, leads out of the ranges or is too long.
    """
    free = block.free
    if not free or any(is_at_edge(near, name) for name in free):
        return None
    try:
        first = descended(replace(block, max_evaluations=1), near, _FINE)
    except SimulationError:
        return None
    if first.mse_percent <= block.solvers_percent:
        return None
    at, system = first.minimum, first.minimum.system
    information = system.triangle.T @ system.triangle
    step = np.asarray(np.linalg.lstsq(information, -system.gradient, rcond=None)[0], np.float64)
    is_long = system.effect(step) * first.n_independent > _AN_ERROR**2 * at.cost
    if is_long or not largest_of(step) <= _SMALL:
        return None
    values = with_values(first.values, free, block.variables.unpack(at.variables + step))
    if not is_within(values, free):
        return None
    minimum = replace(at, system=system.moved(step), status=_MET_COST)
    return replace(first, values=values, minimum=minimum)


def descended(block: Block, start: Values, stopping: Stopping) -> FitResult:
    """Where a minimisation ends, not judged yet."""
    stopping = stopping._replace(
        max_evaluations=block.max_evaluations,
        least_share=max(stopping.least_share, block.model.kinks),
    )
    minimum = block.minimise(kept_within(start, block.free), stopping)
    (values,) = minimum.extra.values.values()
    return FitResult(block.free, values, minimum)


def is_loose(quantity: Quantity, value: float, error: float, share: float) -> bool:
    """Whether a standard error, of the logarithm or in the size, is too large beside a value."""
    if quantity.is_logarithmic:
        return error > share
    # What is of either sign may be nothing, and has no relative error. An offset never is loose:
    # it stands beside a force that is known.
    return quantity.is_shared and error > share * max(1.0, abs(value) / quantity.size)


def _statuses(block: Block, result: FitResult, errors: Mapping[str, float]) -> dict[str, Status]:
    status = dict.fromkeys(result.values.names, Status.FIXED)
    for name, error in errors.items():
        value = getattr(result.values, name)
        status[name] = Status.FITTED
        quantity = block.model.quantity(name)
        low, high = quantity.plausible
        if quantity.unit == "N" and quantity.is_logarithmic and error > NOT_DETERMINED:
            low = max(low, _NO_FRICTION * block.deviation)
        if quantity.is_open and value >= high:
            status[name] = Status.NOT_IDENTIFIABLE  # rigid oil is no fault: there is no upper limit
        elif not low < value < high:
            status[name] = Status.AT_BOUND
        elif is_loose(quantity, value, error, NOT_DETERMINED):
            status[name] = Status.NOT_IDENTIFIABLE
    for name in errors:  # where the logs do not open a blow-off, they determine none of its numbers
        quantity = block.model.quantity(name)
        opening = status.get(quantity.beside("opening")) if quantity.group == "blow_off" else None
        if opening is Status.NOT_IDENTIFIABLE:
            status[name] = opening
    return status


def describe_fit(setting: Setting, result: FitResult, block: Block) -> Fit:
    """The `Fit` of a result: figures of each log, cavitation."""
    values = result.values
    logs, seen, misses, floors = [], [], [], []
    cycles = iter(block.cycles.cycles if block.cycles is not None else ())
    for trace in block.traces:
        comparison = compare(values, trace, block.model, solver=block.solver)
        part = trace.compared
        measured, simulated = trace.force[part], comparison.force[part]
        mse = normalised_mse(measured, simulated)
        places = trace.places if len(trace.segments) > 1 else ()
        alone = tuple(normalised_mse(measured[at], simulated[at]) for at in places) or (mse,)
        own = tuple(islice(cycles, len(trace.segments)))
        logs.append(LogFit(trace, mse, noise_floor(trace), alone, own))
        seen.append((trace, comparison.response))
        misses.append(simulated - measured)
        floors.append(logs[-1].noise_floor_percent / 100.0 * np.var(measured) * len(measured))
    warnings = list(speed_warnings(block.facts, block.free, block.model.quantities))
    if failed_trials := result.minimum.failed_trials:
        where = ", ".join(
            f"{quantity.symbol} {getattr(values, quantity.name):.3g}"
            for quantity in values.quantities
            if quantity.is_logarithmic
        )
        text = f"{failed_trials} trial points could not be simulated, near {where}."
        warnings.insert(0, warning("failed-trials", text))
    all_misses = np.concatenate(misses)
    total = block.deviation**2 * len(all_misses)
    return Fit(
        setting=setting,
        parameters=values,
        status=result.status,
        outcome=result.outcome,
        mse_percent=float(100.0 * np.sum(all_misses**2) / total),
        noise_floor_percent=float(100.0 * np.sum(floors) / total),
        n_samples=len(all_misses),
        n_cycles=sum(trace.n_cycles for trace in block.traces),
        evaluations=result.evaluations,
        cavitation=block.model.examine(values, seen, solver=block.solver),
        logs=tuple(logs),
        warnings=tuple(warnings),
    )


# Structures are compared by factors of their MSE: a fall of a few in ten thousand changes nothing.
COMPARING = Stopping(
    cost_tolerance=3e-4, step_tolerance=1e-4, max_evaluations=60, rest=math.inf, near=5e-3
)
# Starts that are followed for a few evaluations before the best is followed to its end: so many, or
# one beside those that are known.
_TRIED = 3
_SHORT = Stopping(cost_tolerance=1e-2, step_tolerance=1e-3, max_evaluations=8, rest=math.inf)
# Of the force's deviation: starts with offsets or frictions that are so far apart are two places.
_UNLIKE = 0.1
# Times the scatter between cycles: a minimum that is there needs no other start.
_AS_EXPECTED = 2.0
_OF_VALVES = ("bleed", "opening", "slope")
# A sound minimum is preferred to a cavitating one unless that one is better by this factor.
_CLEARLY_BETTER = 1.5
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

    Of several the one that fits the first log best; with kinks, which make a fit long, where
    the best lead, followed on mean cycles as far as the motions repeat.
    """
    starts = block.model.start(block.traces, fixed)
    starts = tuple({with_given(given, setting, start, fixed): None for start in starts})
    if len(starts) == 1:
        return starts[0]
    try:
        coarse = replace(block, cycles=None)
        coarse = coarse.on_cycles() if block.model.kinks else coarse
        if coarse.cycles is not None:
            return best_of_starts(coarse, starts).extra
    except SimulationError:
        return starts[0]
    ranked = _best_fitting(replace(coarse, traces=block.traces[:1]), starts)
    return ranked[0] if ranked else starts[0]


def with_given(
    given: ProcedureInput, setting: Setting, start: Values, fixed: Mapping[str, float]
) -> Values:
    """A start with what somebody has said that the fit of a setting starts at."""
    numbers = given.options.start.of(setting)
    numbers = {name: numbers[name] for name in given.ordered(numbers) if name not in fixed}
    # What stands at its default is held there, also at nothing, beyond what a fit may find.
    moved = [name for name, x in numbers.items() if x != start.quantity(name).default]
    return kept_within(start.replace(numbers), moved)


# Further starts: from a minimum that is not sound.


def fit_setting(block: Block, start: Values, *, nfev: int = 0) -> FitResult:
    """Fit the free parameters of one setting.

    One that ends unsound is tried again from the model's further starts. The paper's lie below the
    onset of cavitation, and the better sound minimum is kept; where that gives neither a sound one
    nor a good one that cavitates, others lie beyond the onset.
    """
    best = minimised(block, start, nfev=nfev)
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
        best, left = (other, best) if is_better else (best, other)
        best = best.after(left.evaluations)
    return best


def fit_in_stages(block: Block, start: Values, stages: Sequence[frozenset[str]]) -> FitResult:
    """Fit after rough descents that hold some at the start, stage by stage."""
    nfev, rough = 0, block
    if block.cycles is None:  # the log with the strongest force determines the valves best
        strongest = max(block.traces, key=lambda trace: float(np.std(trace.force[trace.compared])))
        rough = replace(block, traces=(strongest,))
    for held in stages:
        free = tuple(name for name in block.free if name not in held)
        near = descended(replace(rough, free=free), start, ROUGH)
        start, nfev = near.values, nfev + near.evaluations
    return minimised(block, start, nfev=nfev)


def lacks_stiffness_alone(result: FitResult) -> bool:
    """Whether a fit that does not cavitate is excellent and lacks nothing but K_e: rigid oil."""
    rest = dict(result.status)
    of_oil = [rest.pop(quantity.name) for quantity in result.values.quantities if quantity.is_open]
    is_alone = {*rest.values()} <= {Status.FITTED, Status.FIXED}
    is_lost = is_alone and Status.NOT_IDENTIFIABLE in of_oil
    return is_lost and not result.minimum.extra.is_cavitating and result.mse_percent < EXCELLENT


# A Latin cube around a result.


@dataclass(frozen=True, slots=True)
class LocalMinimum:
    """A minimum that some of the starts ended in."""

    parameters: Values  # the best end
    mse_percent: float  # eq. (22) there
    outcome: str  # how that minimisation ended
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
            best = [minimum.parameters for minimum in self.minima[:2]]
            pairs = ((n, *(getattr(at, n) for at in best)) for n in self.free)
            differing = [
                f"{name} {a:.4g} or {b:.4g}"
                for name, a, b in pairs
                if not math.isclose(a, b, rel_tol=_SAME)
            ]
            return f"different minima fit equally well: {', '.join(differing)}"
        if self.is_improved:
            return "a better minimum than from the procedure's own start was found, and is used"
        return ""


def describe_searches(searches: Iterable[Search]) -> tuple[str, ...]:
    """Return what the starts found, for people: one sentence for each kind of ending."""
    endings: dict[str, list[Setting]] = defaultdict(list)
    for search in searches:
        many = f"{', '.join(search.free)} free, {search.n_starts} starts"
        if search.n_failed:
            many += f" of which {search.n_failed} could not be simulated"
        ending = "all end in one minimum"
        if len(search.minima) > 1:
            ends = ", ".join(
                f"{end.mse_percent:.3g} % ({end.n_starts}, {end.outcome})"
                for end in search.minima[:_SHOWN]
            )
            ending = f"{len(search.minima)} minima, with MSE {ends}"
        more = f" and {len(search.minima) - _SHOWN} more" if len(search.minima) > _SHOWN else ""
        endings[f"{many}: {ending}{more}"].append(search.setting)
    return tuple(f"{of_settings(settings)}, {words}" for words, settings in endings.items())


def fit_from(
    setting: Setting, block: Block, start: Values, *, starts: int, nfev: int = 0
) -> tuple[FitResult, Search | None]:
    """Fit from a start, and from as many more as the options ask for; the best sound result."""
    first = fit_setting(block, start, nfev=nfev)
    if starts < 2 or not block.free:
        return first, None
    others = spread_starts(block, first.values, setting, starts - 1)
    tried = [unless_failed(partial(fit_setting, block, other)) for other in others]
    results = [first, *(result for result in tried if result is not None)]
    groups = _grouped(results, block)
    best = groups[0][0]
    is_improved = first not in groups[0] and not _is_level(best, first)
    sound = [group[0] for group in groups if group[0].is_sound]
    minima = tuple(
        LocalMinimum(group[0].values, group[0].mse_percent, group[0].outcome.value, len(group))
        for group in groups
    )
    is_ambiguous = len(sound) > 1 and sound[0] is best and _is_level(sound[0], sound[1])
    n_failed = starts - len(results)
    search = Search(setting, block.free, minima, starts, n_failed, is_improved, is_ambiguous)
    kept = best if is_improved else first
    return kept.after(sum(result.evaluations for result in results if result is not kept)), search


def unless_failed(fit: Callable[[], FitResult]) -> FitResult | None:
    """Where a fit ends; None where it meets a known error."""
    try:
        return fit()
    except FitCancelledError:
        raise
    except DamperfitError:
        return None


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
        value, quantity = getattr(centre, name), centre.quantity(name)
        linear = value + _LINEAR_SPREAD * quantity.size * away
        columns[name] = value * SPREAD**away if quantity.is_logarithmic else linear
    return tuple(
        centre.replace({name: float(values[k]) for name, values in columns.items()})
        for k in range(number)
    )


def _grouped(results: Sequence[FitResult], block: Block) -> list[list[FitResult]]:
    """Ends of one minimum together, best first; sound minima before the others."""
    groups: list[list[FitResult]] = []
    for result in sorted(results, key=lambda result: result.mse_percent):
        for group in (group for group in groups if _is_same(group[0], result, block)):
            group.append(result)
            break
        else:
            groups.append([result])
    return sorted(groups, key=lambda group: (not group[0].is_sound, group[0].mse_percent))


def _is_same(result: FitResult, other: FitResult, block: Block) -> bool:
    """Whether all parameters that the logs determine agree."""
    for name, error in result.errors.items():
        if result.status[name] != Status.FITTED and other.status[name] == result.status[name]:
            continue  # a flat direction is one minimum however far along it a fit stopped
        a, b = getattr(result.values, name), getattr(other.values, name)
        quantity = result.values.quantity(name)
        unit = block.deviation if quantity.is_offset else quantity.size
        if quantity.is_logarithmic:
            unit = max(a, b)
        if abs(a - b) > max(_SAME, _SAME_ERRORS * error) * unit:
            return False
    return True


def _is_level(best: FitResult, other: FitResult) -> bool:
    """Whether noise alone may make the difference of two misfits."""
    rise = other.mse_percent / max(best.mse_percent, 1e-300) - 1.0
    return bool(rise * best.n_independent < CHI_SQUARED_95)


# The best of several starts.


def best_of_starts(block: Block, starts: Sequence[Values], *, known: int = 0) -> Minimum[Values]:
    """Where the best of some starts leads; so many of the first are followed in any case.

    Those that fit best, with unlike offsets or frictions, are followed for a few evaluations, the
    best of them to its end; where it loses a valve's part there, the next start is followed too.
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
    nfev = sum(look.evaluations for look in looks)
    minimum = block.descend(min(looks, key=lambda look: look.cost).extra, COMPARING)
    nfev += minimum.evaluations
    # The starts that fit best may share what is wrong in them, an offset that hides a blow-off.
    if minimum.cost > expected and _lost_a_valve(block, minimum):
        for start in ranked[many : many + 1]:
            with suppress(SimulationError):
                other = block.descend(start, COMPARING)
                nfev += other.evaluations
                minimum = min(minimum, other, key=lambda end: end.cost)
    return replace(minimum, evaluations=nfev)


def _lost_a_valve(block: Block, minimum: Minimum[Values]) -> bool:
    """Whether a bleed or a blow-off ran out of its range."""
    return any(
        block.model.quantity(name).part in _OF_VALVES and is_at_edge(minimum.extra, name)
        for name in block.free
    )


def _in_turn(block: Block, ranked: list[Values]) -> list[Values]:
    """Starts in the order in which they are followed: the best, then the best unlike it."""
    # An offset or a friction that hides a preload fits best at the start and leads nowhere else.
    own = [block.model.quantity(name) for name in block.free]
    forces = [quantity.name for quantity in own if quantity.is_offset or quantity.is_friction]
    least = _UNLIKE * block.deviation
    first: list[Values] = []
    for start in ranked:
        here = values_of(forces, start)
        if all(np.any(np.abs(here - values_of(forces, other)) > least) for other in first):
            first.append(start)
    return [*first, *(start for start in ranked if start not in first)]


def _best_fitting(block: Block, starts: Sequence[Values]) -> list[Values]:
    """Starts by how well they fit, the best first; what cannot be simulated is left out."""
    if len(starts) < 2:
        return list(starts)
    costs = []
    for place, start in enumerate(starts):
        with suppress(SimulationError):
            costs.append((block.cost(start), place))
    return [starts[place] for _, place in sorted(costs)]
