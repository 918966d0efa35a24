r"""One fit of a campaign: who takes part, what settings share, from where, and what came out.

Which quantities follow which adjuster is declared, or from the logs. With the settings fitted
apart, residuals r_s and their derivatives J_s make the problem of any way of sharing a linear least
squares in its unknowns theta (A_s picks those of a setting)::

    X(way) = min over theta of  sum_s w_s |r_s + J_s (A_s theta - u_s)|^2  +  n_theta ln n_eff

Each w_s, one for each stroke, makes the term n_eff of the setting where that is fitted apart; but
a term below `ENOUGH_PERCENT` of the stroke's force counts as that much: a smaller misfit decides
nothing of use. Of all ways that differ in what one quantity follows the best is taken
until none is better, from everything shared and from nothing shared. A joint fit with that way is
then the point from which the sum is drawn up anew, for a straight line between settings that were
fitted apart does not reach far; it ends when the way stays as it is.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import combinations
from typing import TYPE_CHECKING, NamedTuple, cast

import numpy as np

from damperfit.arrays import FloatArray
from damperfit.damper.model import DAMPER, LOG, RIG, SETTING, Model, Values
from damperfit.identification.fit_problem import (
    Block,
    FitProblem,
    Point,
    kept_within,
    linearise,
    values_of,
    with_values,
)
from damperfit.identification.fit_setting import NOT_FIT_TO_SHARE, Fit, is_loose
from damperfit.identification.least_squares import (
    NO_LENGTH,
    Minimum,
    Quadratic,
    Stopping,
    inverse_information,
    reduced,
)
from damperfit.identification.logs import compare, effective_samples
from damperfit.identification.outcome import Outcome, SettingError, Status, attempted
from damperfit.identification.sharing import (
    GAS_FOLLOWER,
    Follows,
    GasLaw,
    Sharing,
    Unknown,
    one_by_one,
    unknown_at,
    unknowns_of,
)
from damperfit.problem import Failure, Problem, warning
from damperfit.statistics import chi_squared_quantile
from damperfit.tested.setting import Setting

if TYPE_CHECKING:
    from damperfit.damper.purdy.parameters import Damper
    from damperfit.identification.procedures import ProcedureInput

# A step that promises less than this share of the cost moves no parameter by 1 % of its error.
_COST_TOLERANCE = 1e-8
_MAX_EVALUATIONS = 40
# Below this relative size a step is not tried again shorter: the integrator's own error is left.
# Values are changed by a factor of two at most in one step.
STEP_TOLERANCE, LONGEST_STEP = 1e-7, 0.7
# Of the endings of the loop, those at a minimum: not its limits.
_AT_MINIMUM = (1, 2, 4)
# An independent square is about 1: a step that promises less moves nothing by a tenth of its error.
# The integrator's own error may end the loop before it promises as little as is asked for.
_NOTHING = 0.01
_NO_MINIMUM = warning(
    "no-minimum", "the joint fit stopped before its minimum: the shared values are the best found."
)
_WEIGHTS_MOVE = warning(
    "weights-move", "the weights of the settings had not settled when the joint fit stopped."
)
# The working pressure hardly depends on K_e: it moves by less than this in the second round.
_SAME_PRESSURE = 1e-4
_MAX_ROUNDS = 5
# Two unknowns of the gas law; a third setting is the first that can contradict it. Neither share of
# the compliance starts at less than this: a logarithm must leave its end.
_LAW_UNKNOWNS, _LEAST_SHARE = 2, 0.05
# A misfit that chance makes so large once in a thousand sets; the noise is known roughly only.
_CHANCE = 0.001

# An rms of 1.4 % of the force's deviation: what is found below changes nothing that anyone uses.
ENOUGH_PERCENT = 0.02
_MAX_DETECTIONS = 6
# What no log determines stays within a factor of e^2 of where the settings apart have it.
_NOT_DETERMINED = 0.5
# A setting that a joint fit meets this much better was in a wrong local minimum alone.
_CLEARLY_BETTER = 0.8
_NO_GAIN = 1e-9  # rounding
# Adjusters of which every combination is looked at; of more only each one, and all of them.
_FEW_ADJUSTERS = 4


# The fit of several settings.


def fit_jointly(problem: FitProblem, starts: Mapping[Setting, Values]) -> Minimum[Point]:
    """Minimise the misfit of all settings together, from starts at which what is shared is equal.

    A `SettingError`: a setting cannot be simulated at its start, or has met a bug.
    """
    problem = replace(problem, blocks={s: block.whole for s, block in problem.blocks.items()})
    n_samples = sum(block.facts.n_samples for block in problem.blocks.values())
    stopping = Stopping(
        step_tolerance=STEP_TOLERANCE,
        max_evaluations=_MAX_EVALUATIONS,
        least_gain=_COST_TOLERANCE * n_samples,  # weighted squares are about 1 each
        longest_step=LONGEST_STEP,
    )
    return problem.minimise(starts, stopping)


def _fairly_weighed(problem: FitProblem, minimum: Minimum[Point]) -> Minimum[Point]:
    """The joint fit with the weights that its own end gives the settings."""
    # Where shared values meet a setting badly at the start, what they miss is not its noise: a
    # tenth of its weight moves the minimum as a wrong law would.
    for _ in range(_MAX_ROUNDS):
        if minimum.extra.is_fairly_weighed:
            break
        again = fit_jointly(problem, minimum.extra.values)
        minimum = replace(again, evaluations=minimum.evaluations + again.evaluations)
    return minimum


# What is shared.


def declared_sharing(
    damper: Model,
    moving: tuple[str, ...],
    follows: Follows,
    adjusters: tuple[str, ...],
    untied: Sequence[str] = (),
) -> Sharing:
    """What follows which adjuster: as declared, the rest none; by scope where none is declared."""
    each = adjusters if SETTING in adjusters or not follows else ()
    whole = {name: each if damper.quantity(name).scope == SETTING else () for name in moving}
    whole |= _known(damper, moving, adjusters)
    whole |= {n: tuple(a for a in adjusters if a in follows[n]) for n in moving if n in follows}
    return _sharing(moving, whole | dict.fromkeys(untied, adjusters), adjusters)


def _sharing(
    moving: tuple[str, ...], whole: Mapping[str, tuple[str, ...]], adjusters: tuple[str, ...]
) -> Sharing:
    """What is shared where the adjusters of every quantity are known; its own has all of them."""
    jointly = tuple(name for name in moving if whole[name] != adjusters)
    return Sharing(moving, jointly, {name: whole[name] for name in jointly if whole[name]})


def _known(
    damper: Model, moving: Sequence[str], adjusters: tuple[str, ...]
) -> dict[str, tuple[str, ...]]:
    """What the model says of itself: nothing is asked of the logs there."""
    known: dict[str, tuple[str, ...]] = {}
    for name in moving:
        quantity = damper.quantity(name)
        if quantity.is_offset or quantity.scope == LOG:
            known[name] = adjusters
        elif quantity.scope in {DAMPER, RIG}:
            known[name] = ()
        elif quantity.scope != SETTING and quantity.scope in adjusters:
            known[name] = (quantity.scope,)
    return known


def detected_sharing(
    blocks: Mapping[Setting, Block],
    single: Mapping[Setting, Values],
    declared: Sharing | None = None,
    *,
    untied: Sequence[str] = (),
    jobs: int = 1,
) -> tuple[Sharing, Mapping[Setting, Values], int]:
    """What is shared as the logs show it, or as declared; where its fit starts; simulations.

    Of two settings or more with the same quantities free; `single` is each fitted by itself.
    """
    first = blocks[min(blocks)]
    adjusters, moving = min(blocks).adjusters, first.free
    search, nfev = _Search(blocks, single, None), 1
    own: dict[str, tuple[str, ...]] = dict.fromkeys(moving, adjusters)
    if declared is not None:
        shared = dict.fromkeys(declared.jointly, ()) | {**declared.follows}
        return declared, search.starts(own | shared), nfev
    known = _known(first.model, moving, adjusters)
    known |= {name: way for name, way in own.items() if name in untied}
    ends = (dict.fromkeys(moving, ()) | known, own | known)
    tried: list[dict[str, tuple[str, ...]]] = []
    results: list[tuple[float, Sharing, Mapping[Setting, Values]]] = []
    for _ in range(_MAX_DETECTIONS):
        ways = [search.improved(way, known, adjusters) for way in (*ends, *tried[-1:])]
        follows = min(ways, key=search.worth)
        if follows in tried:
            break
        tried.append(follows)
        sharing = replace(_sharing(moving, follows, adjusters), is_detected=True)
        if not sharing.jointly:
            return sharing, single, nfev
        weights, tied = search.weights, (sharing.jointly, sharing.follows)
        problem = FitProblem(blocks, *tied, weights=weights, jobs=jobs)
        minimum = fit_jointly(problem, search.starts(follows))
        nfev += minimum.evaluations + 1
        at, left = minimum.extra.values, minimum.extra.mean_squares
        if any(left[s] < _CLEARLY_BETTER * before for s, before in search.mean_squares.items()):
            results, tried = [], []
            search = _Search(blocks, at, None)
        else:
            search = _Search(blocks, at, search)
        results.append((search.cost + search.price(follows), sharing, at))
    _, sharing, at = min(results, key=lambda result: result[0])
    return sharing, at, nfev


class _Search:
    """The misfit of all settings near a point, and what ways of sharing would make of it."""

    def __init__(
        self,
        blocks: Mapping[Setting, Block],
        at: Mapping[Setting, Values],
        before: _Search | None,
    ) -> None:
        self.settings, self.at, self.blocks = sorted(blocks), at, blocks
        self.names = blocks[self.settings[0]].free
        # Weights and effective samples are those of the search before.
        self.mean_squares: dict[Setting, float] = before.mean_squares if before else {}
        self.weights: dict[Setting, float] = before.weights if before else {}
        self.rows: dict[Setting, FloatArray] = before.rows if before else {}
        self.n_eff: float = before.n_eff if before else 0.0
        k = len(self.names)
        n, self.cost = k * len(self.settings), 0.0  # at the point itself
        u, slope, curvature = np.empty(n), np.empty(n), np.zeros((n, n))
        for first, setting in enumerate(self.settings):
            block, own = blocks[setting], slice(k * first, k * (first + 1))
            residuals, jacobian = linearise(block.whole, at[setting])
            if before is None:
                self._weigh(setting, block, residuals)
            rows = self.rows[setting]
            triangle = reduced(rows * residuals, rows[:, None] * jacobian)
            rows, right = triangle[:, :-1], triangle[:, -1]
            curvature[own, own] = rows.T @ rows + _NOT_DETERMINED**2 * np.eye(k)
            slope[own] = rows.T @ right
            self.cost += float(right @ right)
            u[own] = block.common_variables.pack(values_of(self.names, at[setting]))
        self._quadratic = Quadratic(self.cost, u, slope, curvature)
        self._worths: dict[tuple[tuple[str, ...], ...], float] = {}

    def _weigh(self, setting: Setting, block: Block, residuals: FloatArray) -> None:
        n_eff, forces, strokes = 0.0, [], []
        ends = np.cumsum([trace.n_samples for trace in block.traces])
        for trace, rest in zip(block.traces, np.split(residuals, ends[:-1]), strict=True):
            for segment, place in zip(trace.segments, trace.places, strict=True):
                n_eff += effective_samples(rest[place], max(segment.n_cycles, 1))
            at_rest = block.model.filled_to(trace.gas_pressure).rest_force(trace.displacement)
            force = trace.force if at_rest is None else trace.force - at_rest
            forces.append(force[trace.compared])
            strokes.append(trace.velocity[trace.compared] > 0.0)
        force, is_rebound = np.concatenate(forces), np.concatenate(strokes)
        # Each stroke by what it carries: a weak one is not to be hidden by a strong one.
        variances = np.empty(len(residuals))
        for stroke in (is_rebound, ~is_rebound):
            if np.any(stroke):
                least = ENOUGH_PERCENT / 100.0 * float(np.mean(force[stroke] ** 2))
                variances[stroke] = max(float(np.mean(residuals[stroke] ** 2)), least)
        self.rows[setting] = np.sqrt(n_eff / len(residuals) / variances)
        self.mean_squares[setting] = float(np.mean(residuals**2))
        self.weights[setting] = float(np.mean(self.rows[setting] ** 2))
        self.n_eff += n_eff

    def improved(
        self,
        follows: Mapping[str, tuple[str, ...]],
        known: Mapping[str, tuple[str, ...]],
        adjusters: tuple[str, ...],
    ) -> dict[str, tuple[str, ...]]:
        """Change what one quantity follows until nothing is gained by it."""
        free = [name for name in self.names if name not in known]
        sizes = range(len(adjusters) + 1) if len(adjusters) <= _FEW_ADJUSTERS else (0, 1)
        some = [few for size in sizes for few in combinations(adjusters, size)]
        some += [] if adjusters in some else [adjusters]
        changes = [(name, few) for name in free for few in some]
        return one_by_one(follows, changes, self.worth, _NO_GAIN)[-1]

    def price(self, follows: Mapping[str, tuple[str, ...]]) -> float:
        """Penalty of a way for its unknowns."""
        return len({*self._unknowns(follows)}) * math.log(self.n_eff)

    def worth(self, follows: Mapping[str, tuple[str, ...]]) -> float:
        """X of a way."""
        key = tuple(follows[name] for name in self.names)
        if key not in self._worths:
            cost, _ = self._quadratic.tied(self._unknowns(follows))
            self._worths[key] = cost + self.price(follows)
        return self._worths[key]

    def starts(self, follows: Mapping[str, tuple[str, ...]]) -> dict[Setting, Values]:
        """The values of each setting at the minimum of the linear least squares."""
        starts, (_, variables) = {}, self._quadratic.tied(self._unknowns(follows))
        for setting, u in zip(self.settings, variables.reshape(-1, len(self.names)), strict=True):
            numbers = self.blocks[setting].common_variables.unpack(u)
            values = with_values(self.at[setting], self.names, numbers)
            starts[setting] = kept_within(values, self.names)
        return starts

    def _unknowns(self, follows: Mapping[str, tuple[str, ...]]) -> list[Unknown]:
        """Which unknown each quantity of each setting is."""
        return [unknown_at(name, follows, s) for s in self.settings for name in self.names]


# The joint fit of a campaign.


class JointResult(NamedTuple):
    """What a joint fit gave: where it ended, what is shared by whom and how well determined."""

    at: Point
    status: Mapping[Unknown, Status]  # of what is shared
    sharing: Sharing  # for its errors
    evaluations: int  # simulations of each setting
    warnings: tuple[Problem, ...]

    def start(self, setting: Setting, block: Block, alone: Fit | None) -> Values:
        """Where a setting's own fit starts: the joint result, or its own with what is shared."""
        if alone is None or setting in self.at.values:
            return self.at.values[setting]
        held = {
            name: getattr(values, name)
            for name in self.sharing.jointly
            for other, values in self.at.values.items()
            if unknown_at(name, self.sharing.follows, setting).holds_at(other)
        }
        parameters = alone.parameters.replace(held)
        if self.at.gas is None:
            return parameters
        law = self.at.gas._replace(pressures={setting: working_pressure(block, parameters)})
        return parameters.replace({GAS_FOLLOWER: law.modulus(setting)})


def fit_settings_jointly(
    given: ProcedureInput, before: Sequence[Fit], sharing: Sharing | None, moving: tuple[str, ...]
) -> tuple[JointResult | None, dict[Setting, Failure]]:
    """Fit the settings that have a minimum together; None where there are not two.

    A setting that cannot be simulated at the start is left out and follows the others; one that
    meets a bug is left out for good, and the second value returned says why.
    """
    # Where something follows an adjuster, settings take part too that leave a quantity open.
    is_plain = not (given.options.is_by_scope or given.options.follows)
    outcomes = [Outcome.CONVERGED] if is_plain else [end for end in Outcome if end.is_minimum]
    sound = {fit.setting: fit for fit in before if fit.outcome in outcomes}
    broken: dict[Setting, Failure] = {}
    warnings: list[Problem] = []
    while True:
        try:
            together = _fit_sound(given, sound, sharing, moving)
        except SettingError as error:
            failure = error.failure
            del sound[failure.setting]
            if failure.is_internal:
                broken[failure.setting] = failure
            else:
                text = f"left out of the joint fit: {error}"
                warnings.append(warning("left-out-of-joint", text))
            continue
        if together is not None:
            together = together._replace(warnings=(*warnings, *together.warnings))
        return together, broken


def _fit_sound(
    given: ProcedureInput,
    sound: Mapping[Setting, Fit],
    sharing: Sharing | None,
    moving: tuple[str, ...],
) -> JointResult | None:
    options, nfev = given.options, 0
    is_gas = options.bulk_modulus == "appendix1"
    if len(sound) < 2 or not (sharing is None or sharing.jointly or is_gas):
        return None
    free = given.ordered({*moving, *((GAS_FOLLOWER,) if is_gas else ())})
    blocks = {setting: given.block(setting, free) for setting in sound}
    if sharing is None or options.is_by_scope or options.follows:
        single = {setting: fit.parameters for setting, fit in sound.items()}
        sharing, starts, more = detected_sharing(
            blocks, single, sharing, untied=options.untied, jobs=given.jobs
        )
        nfev += more
        if not sharing.jointly:
            return None
    else:
        starts = _common_starts(given, sound, sharing)
    problem = FitProblem(blocks, sharing.jointly, sharing.follows, jobs=given.jobs)
    alone = _fairly_weighed(problem, fit_jointly(problem, starts))
    if not is_gas:
        return _result(problem, alone, sharing, free, nfev)
    minimum, more = _with_gas(given, problem, alone.extra.values)
    nfev += alone.evaluations + more - minimum.evaluations
    result = _result(problem, minimum, sharing, free, nfev)
    rises = {
        setting: n * (minimum.extra.mean_squares[setting] / alone.extra.mean_squares[setting] - 1.0)
        for setting, n in alone.extra.n_independent.items()
    }
    return result._replace(
        status={Unknown(GAS_FOLLOWER): Status.SHARED, **result.status},
        sharing=replace(result.sharing, gas=minimum.extra.gas, gas_rises=rises),
        warnings=(*(w for w in result.warnings if w is _NO_MINIMUM), *_judged_law(rises)),
    )


def fit_from_one_model(
    given: ProcedureInput, sharing: Sharing, starts: Mapping[Setting, Values]
) -> JointResult:
    """Fit all settings together from where one model of them has ended already."""
    blocks = {setting: given.block(setting, sharing.free) for setting in given.settings}
    left = {s: 100.0 * block.whole.cost(starts[s]) for s, block in blocks.items()}
    if any(percent < blocks[s].solvers_percent for s, percent in left.items()):
        blocks = {s: block.refined(left[s]) for s, block in blocks.items()}
    tied = FitProblem(blocks, sharing.jointly, sharing.follows, jobs=given.jobs)
    minimum = _fairly_weighed(tied, fit_jointly(tied, starts))
    return _result(tied, minimum, sharing, sharing.free, 0)


def _result(
    tied: FitProblem,
    minimum: Minimum[Point],
    sharing: Sharing,
    free: tuple[str, ...],
    nfev: int,
) -> JointResult:
    """What a joint fit has reached, and what it has not."""
    system, at, status = minimum.system, minimum.extra, {}
    # Rough relative standard errors of what is shared.
    inflation = np.mean([tied.blocks[s].facts.n_samples / n for s, n in at.n_independent.items()])
    border = replace(tied, gas=at.gas).border
    variances = np.diag(inverse_information(system.triangle))[-len(border) :] * inflation
    errors = dict(zip(border, np.sqrt(variances).tolist(), strict=True))
    for unknown in unknowns_of(sharing.jointly, sharing.follows, sorted(at.values)):
        having = [values for s, values in at.values.items() if unknown.holds_at(s)]
        quantity, value = having[0].quantity(unknown.name), getattr(having[0], unknown.name)
        low, high = quantity.plausible
        fitted = Status.SHARED if len(having) > 1 else Status.FITTED
        status[unknown] = fitted if low < value < high else Status.AT_BOUND
        if is_loose(quantity, value, errors[unknown], NOT_FIT_TO_SHARE):
            status[unknown] = Status.NOT_IDENTIFIABLE
    steps = system.without(minimum.is_held).scaled(np.maximum(system.lengths, NO_LENGTH))
    is_converged = minimum.status in _AT_MINIMUM or steps.step(0.0).effect < _NOTHING * inflation
    checks = ((_NO_MINIMUM, is_converged), (_WEIGHTS_MOVE, at.is_fairly_weighed))
    warnings = tuple(problem for problem, is_well in checks if not is_well)
    sharing = replace(sharing, free=free, settings=tuple(sorted(at.values)))
    return JointResult(at, status, sharing, nfev + minimum.evaluations, warnings)


def _common_starts(
    given: ProcedureInput, sound: Mapping[Setting, Fit], sharing: Sharing
) -> dict[Setting, Values]:
    """Each setting's own values, with what is shared equal: the mean, or what is known of it."""
    starts = {setting: fit.parameters for setting, fit in sound.items()}
    for unknown in unknowns_of(sharing.jointly, sharing.follows, sorted(sound)):
        name, quantity = unknown.name, given.damper.quantity(unknown.name)
        having = [fit for setting, fit in sound.items() if unknown.holds_at(setting)]
        # From a value without effect a logarithm would not come back; what may vanish is small.
        value = None if quantity.may_vanish else given.options.fallback(quantity)
        if value is None or all(f.status[name] != Status.NOT_IDENTIFIABLE for f in having):
            value = float(np.mean([getattr(fit.parameters, name) for fit in having]))
        starts |= {fit.setting: starts[fit.setting].replace({name: value}) for fit in having}
    return starts


# One gas content for all settings.


def _with_gas(
    given: ProcedureInput, problem: FitProblem, starts: Mapping[Setting, Values]
) -> tuple[Minimum[Point], int]:
    """Fit with K_e from a gas content; the working pressures are those of the fit itself."""

    def pressures_at(values: Mapping[Setting, Values]) -> dict[Setting, float]:
        pressures = {}
        for setting, block in problem.blocks.items():
            pressure = attempted(setting, partial(working_pressure, block, values[setting]))
            if isinstance(pressure, Failure):
                raise SettingError(pressure)
            pressures[setting] = pressure
        return pressures

    moduli = {setting: getattr(start, GAS_FOLLOWER) for setting, start in starts.items()}
    gas = first_law(moduli, pressures_at(starts), cast("Damper", given.damper).gas_exponent)
    best = fit_jointly(replace(problem, gas=gas), starts)
    nfev = best.evaluations + 1
    for _ in range(_MAX_ROUNDS):
        law, again = cast("GasLaw", best.extra.gas), pressures_at(best.extra.values)
        # Once more in any case: the weights of the first round are those of a rough law.
        best = fit_jointly(replace(problem, gas=law._replace(pressures=again)), best.extra.values)
        nfev += best.evaluations + 1
        if max(abs(again[s] / law.pressures[s] - 1.0) for s in again) < _SAME_PRESSURE:
            break
    return best, nfev


def working_pressure(block: Block, parameters: Values) -> float:
    """The mean absolute pressure in chambers 1 and 2, which K_e is of, weighted by volume, Pa."""
    damper, work, volume = cast("Damper", block.model), 0.0, 0.0
    for trace in block.traces:
        seen = compare(parameters, trace, damper, solver=block.solver).response
        x = trace.displacement[trace.compared]
        v_1 = damper.chamber_1_volume - x * damper.annulus_area
        volumes = np.stack([v_1, damper.chamber_2_volume + x * damper.piston_area])
        work += float(np.sum(seen.pressures[:2, trace.compared] * volumes))
        volume += float(np.sum(volumes))
    return work / volume


def first_law(
    moduli: Mapping[Setting, float], pressures: Mapping[Setting, float], gas_exponent: float
) -> GasLaw:
    """The law nearest to known K_e: a line of 1/K_e over 1/(gamma P), by relative errors."""
    settings = sorted(moduli)
    k_e = np.array([moduli[setting] for setting in settings])
    softness = 1.0 / (gas_exponent * np.array([pressures[setting] for setting in settings]))
    columns = np.column_stack([softness * k_e, k_e])
    scale = np.sqrt(np.mean(columns * columns, axis=0))
    gas, oil = np.linalg.lstsq(columns / scale, np.ones(len(k_e)), rcond=None)[0] / scale
    least = _LEAST_SHARE / np.mean(columns, axis=0)
    gas, oil = max(float(gas), float(least[0])), max(float(oil), float(least[1]))
    return GasLaw(gas, 1.0 / oil, gas_exponent, dict(pressures))


def _judged_law(rises: Mapping[Setting, float]) -> list[Problem]:
    """Say so when a K_e of each setting fits better than noise explains."""
    spare = len(rises) - _LAW_UNKNOWNS
    if spare < 1:
        text = "the gas content is drawn through two settings: only a third can show whether it "
        return [warning("two-settings", f"{text}holds.")]
    if sum(rises.values()) <= chi_squared_quantile(spare, 1.0 - _CHANCE):
        return []
    of_one = chi_squared_quantile(1, 1.0 - _CHANCE)
    n_worse = sum(rise > of_one for rise in rises.values())
    worst = max(rises, key=lambda setting: rises[setting])
    text = (
        "K_e does not follow Appendix 1 with one gas content: a K_e for each setting fits better "
        f"than noise explains at {n_worse} of {len(rises)} settings, most at setting {worst}; "
        "take the gas content as a rough mean, its interval does not hold."
    )
    return [warning("gas-content", text)]
