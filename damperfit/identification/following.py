r"""Which quantities follow which adjuster, as the logs tell it; the others are shared.

With the settings fitted apart, residuals r_s and their derivatives J_s make the problem of any way
of sharing a linear least squares in its unknowns theta (A_s picks those of a setting)::

    X(way) = min over theta of  sum_s w_s |r_s + J_s (A_s theta - u_s)|^2  +  n_theta ln n_eff

Each w_s, one for each stroke, makes the term n_eff of the setting where that is fitted apart; but
a problem of less than `ENOUGH_PERCENT` of what the stroke's force is counts as that, for what it
could tell nobody would use. Of all ways that differ in
what one quantity follows the best is taken until none is better, from everything shared and from
nothing shared. A joint fit with that way is then the point from which the sum is drawn up anew, for
a straight line between settings that were fitted apart does not reach far; it ends when the way
stays as it is.
"""

from __future__ import annotations

import math
from itertools import combinations
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from damperfit.damper.quantity import DAMPER, LOG, RIG, SETTING
from damperfit.identification.fit_problem import common_variables, kept_within, linearise
from damperfit.identification.least_squares import reduced
from damperfit.identification.log_facts import effective_samples
from damperfit.identification.sharing import unknown_at
from damperfit.identification.tied_problem import TiedProblem, fit_jointly

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from damperfit.damper.model import Model, Values
    from damperfit.identification.fit_problem import FitProblem
    from damperfit.identification.sharing import Follows, Unknown
    from damperfit.tested.setting import Setting

    FloatArray = NDArray[np.float64]

__all__ = ["ENOUGH_PERCENT", "Detected", "Way", "declared_way", "detected_way"]

# An rms of 1.4 % of the force's deviation: what is found below changes nothing that anyone uses.
ENOUGH_PERCENT = 0.02
_MAX_ROUNDS = 6
# What no log tells stays within a factor of e^2 of where the settings apart have it.
_NOT_DETERMINED = 0.5
# A setting that a joint fit meets this much better was in a wrong local minimum alone.
_CLEARLY_BETTER = 0.8
_NO_GAIN = 1e-9  # rounding
# Adjusters of which every combination is looked at; of more only each one, and all of them.
_FEW_ADJUSTERS = 4


class Way(NamedTuple):
    """A way of sharing: quantities that are each setting's own, and the others."""

    own: tuple[str, ...]
    shared: tuple[str, ...]
    follows: Follows  # adjusters that shared quantities follow; what is not named follows none
    is_detected: bool = False  # the logs showed it
    is_general: bool = False  # for all that moves, not for some that were named


def declared_way(
    damper: Model, moving: Sequence[str], follows: Follows, adjusters: Sequence[str]
) -> Way:
    """Return the way in which what is not declared to follow an adjuster is the damper's.

    Offsets, and what the model says is each log's, stay each setting's own.

    Parameters
    ----------
    damper : Model
        The model.
    moving : sequence of str
        What is fitted.
    follows : mapping of str to tuple of str
        As declared.
    adjusters : sequence of str
        Of the settings.
    """
    own, held = [], {}
    for name in moving:
        one = damper.quantity(name)
        if name in follows:
            held[name] = tuple(a for a in adjusters if a in follows[name])
        elif one.is_offset or one.scope == LOG:
            own.append(name)
        elif one.scope in adjusters:
            held[name] = (one.scope,)
    own += [name for name, mine in held.items() if len(mine) == len(adjusters)]
    return _way(moving, {n: a for n, a in held.items() if n not in own}, own, is_detected=False)


def _way(moving: Sequence[str], follows: Follows, own: Sequence[str], *, is_detected: bool) -> Way:
    return Way(
        tuple(name for name in moving if name in own),
        tuple(name for name in moving if name not in own),
        {name: follows[name] for name in moving if follows.get(name) and name not in own},
        is_detected,
        is_general=True,
    )


class Detected(NamedTuple):
    """What the logs tell, where its fit starts (what is shared is equal already), simulations."""

    way: Way
    starts: Mapping[Setting, Values]
    evaluations: int


def detected_way(
    problems: Mapping[Setting, FitProblem],
    apart: Mapping[Setting, Values],
    declared: Way | None = None,
    *,
    jobs: int = 1,
) -> Detected:
    """Return the way of sharing that the logs tell, or one that was declared, with its start.

    Parameters
    ----------
    problems : mapping of Setting to FitProblem
        Two settings or more, with the same quantities free.
    apart : mapping of Setting to Values
        Each setting fitted by itself.
    declared : Way, optional
        Nothing is looked for then.
    jobs : int
        Threads.

    Raises
    ------
    SettingError, FitCancelledError
        As `fit_jointly`.
    """
    adjusters = min(problems).adjusters
    moving = problems[min(problems)].free
    known = _known(problems[min(problems)].model, moving, adjusters)
    at, spent = dict(apart), 1
    search = _Search(problems, at, None)
    if declared is not None:
        whole: dict[str, tuple[str, ...]] = dict.fromkeys(moving, ())
        whole |= {**declared.follows, **dict.fromkeys(declared.own, adjusters)}
        return Detected(declared, search.starts(whole), spent)
    ends = (dict.fromkeys(moving, ()) | known, dict.fromkeys(moving, adjusters) | known)
    tried: list[dict[str, tuple[str, ...]]] = []
    found: list[tuple[float, Detected]] = []
    for _ in range(_MAX_ROUNDS):
        starts = (*ends, tried[-1]) if tried else ends
        ways = [search.improved(way, known, adjusters) for way in starts]
        follows = min(ways, key=search.worth)
        if follows in tried:
            break
        tried.append(follows)
        own = [name for name in moving if follows[name] == adjusters]
        way = _way(moving, follows, own, is_detected=True)
        if not way.shared:
            return Detected(way, dict(apart), spent)
        problem = TiedProblem(problems, way.shared, way.follows, weights=search.weights, jobs=jobs)
        solution = fit_jointly(problem, search.starts(follows))
        at, spent = dict(solution.parameters), spent + solution.evaluations + 1
        seen = search.mean_squares
        if any(solution.mean_squares[s] < _CLEARLY_BETTER * seen[s] for s in seen):
            found, tried = [], []
            search = _Search(problems, at, None)
        else:
            search = _Search(problems, at, search)
        found.append((search.cost + search.price(follows), Detected(way, at, spent)))
    return min(found, key=lambda one: one[0])[1]._replace(evaluations=spent)


def _known(
    damper: Model, moving: Sequence[str], adjusters: tuple[str, ...]
) -> dict[str, tuple[str, ...]]:
    """What the model says of itself: nothing is asked of the logs there."""
    found: dict[str, tuple[str, ...]] = {}
    for name in moving:
        one = damper.quantity(name)
        if one.is_offset or one.scope == LOG:
            found[name] = adjusters
        elif one.scope in {DAMPER, RIG}:
            found[name] = ()
        elif one.scope != SETTING and one.scope in adjusters:
            found[name] = (one.scope,)
    return found


class _Search:
    """The misfit of all settings near a point, and what ways of sharing would make of it."""

    def __init__(
        self,
        problems: Mapping[Setting, FitProblem],
        at: Mapping[Setting, Values],
        before: _Search | None,
    ) -> None:
        self.settings = sorted(problems)
        self.at, self.problems = at, problems
        self.names = problems[self.settings[0]].free
        self.mean_squares: dict[Setting, float] = {}
        self.weights: dict[Setting, float] = {}
        self.rows: dict[Setting, FloatArray] = {}
        self.n_eff = 0.0
        self._curvatures, self._slopes, self._costs, self._u = [], [], [], []
        for setting in self.settings:
            problem = problems[setting]
            residuals, jacobian = linearise(problem.whole, at[setting])
            self._weigh(setting, problem, residuals)
            if before is not None:
                self.weights[setting] = before.weights[setting]
                self.rows[setting] = before.rows[setting]
                self.mean_squares[setting] = before.mean_squares[setting]
            rows = self.rows[setting]
            triangle = reduced(rows * residuals, rows[:, None] * jacobian)
            rows, right = triangle[:, :-1], triangle[:, -1]
            self._curvatures.append(rows.T @ rows + _NOT_DETERMINED**2 * np.eye(len(self.names)))
            self._slopes.append(rows.T @ right)
            self._costs.append(float(right @ right))
            numbers = np.array([getattr(at[setting], name) for name in self.names])
            self._u.append(common_variables(problem).pack(numbers))
        if before is not None:
            self.n_eff = before.n_eff
        self._middle = np.mean(self._u, axis=0)
        self._worths: dict[tuple[tuple[str, ...], ...], float] = {}

    def _weigh(self, setting: Setting, problem: FitProblem, residuals: FloatArray) -> None:
        n_eff, first = 0.0, 0
        for trace in problem.traces:
            for stretch, place in zip(trace.stretches, trace.places, strict=True):
                rest = residuals[first : first + trace.n_samples][place]
                n_eff += effective_samples(rest, max(stretch.n_cycles, 1))
            first += trace.n_samples
        # Each stroke by what it carries: a weak one is not to be hidden by a strong one.
        variances = np.empty(len(residuals))
        force, is_rebound = _forces(problem)
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
        way = dict(follows)
        open_ = [name for name in self.names if name not in known]
        while True:
            others = [
                way | {name: some}
                for name in open_
                for some in _combinations(adjusters)
                if some != way[name]
            ]
            best = min(others, key=self.worth, default=way)
            if self.worth(best) >= self.worth(way) - _NO_GAIN:
                return way
            way = best

    @property
    def cost(self) -> float:
        """The misfit at the point itself."""
        return sum(self._costs)

    def price(self, follows: Mapping[str, tuple[str, ...]]) -> float:
        """What the unknowns of a way cost."""
        return self._places(follows)[1] * math.log(self.n_eff)

    def worth(self, follows: Mapping[str, tuple[str, ...]]) -> float:
        """X of a way."""
        key = tuple(follows[name] for name in self.names)
        if key not in self._worths:
            _, cost, n = self._solved(follows)
            self._worths[key] = cost + n * math.log(self.n_eff)
        return self._worths[key]

    def starts(self, follows: Mapping[str, tuple[str, ...]]) -> dict[Setting, Values]:
        """The values of each setting at the minimum of the linear least squares."""
        variables, _, _ = self._solved(follows)
        found = {}
        for setting, u in zip(self.settings, variables, strict=True):
            numbers = common_variables(self.problems[setting]).unpack(u).tolist()
            values = self.at[setting].replace(dict(zip(self.names, numbers, strict=True)))
            found[setting] = kept_within(values, self.names)
        return found

    def _places(self, follows: Mapping[str, tuple[str, ...]]) -> tuple[NDArray[np.intp], int]:
        """Which unknown each quantity of each setting is, and how many there are."""
        numbers: dict[Unknown, int] = {}
        rows = [
            [
                numbers.setdefault(unknown_at(name, follows, setting), len(numbers))
                for name in self.names
            ]
            for setting in self.settings
        ]
        return np.array(rows, dtype=np.intp), len(numbers)

    def _solved(self, follows: Mapping[str, tuple[str, ...]]) -> tuple[FloatArray, float, int]:
        """The variables of each setting, the cost there, the number of unknowns."""
        places, n = self._places(follows)
        whole, right, cost = np.zeros((n, n)), np.zeros(n), 0.0
        for row, curvature, slope, u, own in zip(
            places, self._curvatures, self._slopes, self._u, self._costs, strict=True
        ):
            away = self._middle - u
            whole[np.ix_(row, row)] += curvature
            right += np.bincount(row, slope + curvature @ away, n)
            cost += own + float(away @ (2.0 * slope + curvature @ away))
        # Every unknown stands for a quantity of one middle.
        theta = np.linalg.solve(whole, -right)
        return self._middle + theta[places], cost + float(right @ theta), n


def _forces(problem: FitProblem) -> tuple[FloatArray, NDArray[np.bool_]]:
    """What is compared: force above that at rest, and whether the rod goes out."""
    forces, strokes = [], []
    for trace in problem.traces:
        rest = problem.model.filled_to(trace.gas_pressure).rest_force(trace.displacement)
        force = trace.force if rest is None else trace.force - rest
        forces.append(force[trace.compared])
        strokes.append(trace.velocity[trace.compared] > 0.0)
    return np.concatenate(forces), np.concatenate(strokes)


def _combinations(adjusters: tuple[str, ...]) -> list[tuple[str, ...]]:
    sizes = range(len(adjusters) + 1) if len(adjusters) <= _FEW_ADJUSTERS else (0, 1)
    found = [some for size in sizes for some in combinations(adjusters, size)]
    return found if adjusters in found else [*found, adjusters]
