"""A law at all settings as one model: what settings have in common has one value in all of them.

For comparing laws, as `law_fit` does for single settings: on settled cycles, each setting weighed
by what is left there, so that a factor of one setting's MSE counts as much as another's.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import permutations
from typing import TYPE_CHECKING

import numpy as np

from damperfit.arrays import FloatArray
from damperfit.errors import SimulationError
from damperfit.identification.fit_problem import Block, kept_within
from damperfit.identification.least_squares import Minimum, Stopping, Transformation, minimise
from damperfit.identification.logs import FEWEST_SAMPLES
from damperfit.identification.sharing import Follows, Unknown, unknown_at, unknowns_of
from damperfit.tested.setting import Setting
from damperfit.workers import InTurn, Threads, executor

if TYPE_CHECKING:
    from damperfit.damper.model import Model, Values

# Steps are short beside numbers that logs tell to a thousandth: no step is too short to be tried.
_SHORTEST = 1e-8
_LOOK = Stopping(cost_tolerance=1e-2, step_tolerance=_SHORTEST, max_evaluations=10, rest=math.inf)
_END = Stopping(cost_tolerance=1e-3, step_tolerance=_SHORTEST, max_evaluations=50, rest=math.inf)
# Settings all of whose orders are starts; of more so many come first in turn.
_FEW, _FIRST = 3, 6
# Starts that are looked at, and those that are followed to their end.
_LOOKED_AT, _FOLLOWED = 6, 3
_NO_MISFIT = 1e-12
# What a factor of e costs of a number that no log tells, as a share of what is left at a setting:
# its root. Without it such numbers run to where a simulation takes longest.
_HELD = 0.02
# Friction of a car damper's seals, N, and the deviation of its logarithm: 5 to 100 N are believed.
# A low preload beside several times the friction fits what a higher one does.
BELIEVED_FRICTION, FRICTION_SPREAD = 22.0, 0.75
# What a deviation from it costs, as a share of what is left at a setting: its root.
_UNBELIEVED = 0.1


@dataclass(frozen=True, eq=False)
class OneModel:
    """A law, the logs of settings, and what these have in common."""

    misfits: Mapping[Setting, Block]  # with the same quantities free
    # Adjusters that quantities follow, all of them for what is each setting's own; what is not
    # named has one value at all settings.
    follows: Follows
    weights: Mapping[Setting, float]  # of the squares of each, whose sum is 1 for a useless law
    jobs: int = 1  # threads

    @cached_property
    def settings(self) -> tuple[Setting, ...]:
        """By rising setting."""
        return tuple(sorted(self.misfits))

    @property
    def model(self) -> Model:
        """The law."""
        return self.misfits[self.settings[0]].model

    @property
    def free(self) -> tuple[str, ...]:
        """What moves."""
        return self.misfits[self.settings[0]].free

    @property
    def own(self) -> tuple[str, ...]:
        """What is free, and each setting's own."""
        adjusters = self.settings[0].adjusters
        return tuple(name for name in self.free if self.follows.get(name) == adjusters)

    @cached_property
    def unknowns(self) -> tuple[Unknown, ...]:
        """What is found, quantity by quantity."""
        return unknowns_of(self.free, self.follows, self.settings)

    def weighed_at(self, at: Mapping[Setting, Values], *, least: float = _NO_MISFIT) -> OneModel:
        """Return the same with the weights that values of the settings leave them.

        What is left counts as `least` at least, and as much as the cycles differ.
        """
        found = self.misfits.items()
        left = {setting: max(one.cost(at[setting]), one.scatter, least) for setting, one in found}
        return replace(self, weights={setting: 1.0 / one for setting, one in left.items()})

    def cost(self, at: Mapping[Setting, Values]) -> float:
        """Return the weighed sum of squares; infinite where the law cannot be simulated."""
        try:
            return sum(self.weights[s] * one.cost(at[s]) for s, one in self.misfits.items())
        except SimulationError:
            return math.inf

    def with_common(self, at: Mapping[Setting, Values]) -> dict[Setting, Values]:
        """Return values with what settings have in common at the mean of theirs."""
        means = {}
        for one in self.unknowns:
            own = np.array([getattr(at[s], one.name) for s in self.settings if one.holds_at(s)])
            is_positive = self.model.quantity(one.name).is_logarithmic and own.min() > 0.0
            mean = math.exp(np.mean(np.log(own))) if is_positive else float(np.mean(own))
            means[one] = mean
        return self._with(at, means)

    def starts(self, at: Mapping[Setting, Values]) -> Iterator[dict[Setting, Values]]:
        """Yield starts: what is common at its mean, then as single settings have it, in turn.

        One setting in a wrong valley, where bleed and blow-off have changed places, spoils a mean.
        """
        yield self.with_common(at)
        settings = self.settings
        orders = (
            permutations(settings)
            if len(settings) <= _FEW
            else (
                (one, *(two for two in settings if two != one))
                for one in sorted(settings, key=lambda s: -self.weights[s])[:_FIRST]
            )
        )
        for order in orders:
            first = {
                one: getattr(at[next(s for s in order if one.holds_at(s))], one.name)
                for one in self.unknowns
            }
            yield self._with(at, first)

    def _with(
        self, at: Mapping[Setting, Values], numbers: Mapping[Unknown, float]
    ) -> dict[Setting, Values]:
        found = {}
        for s in self.settings:
            own = {name: numbers[unknown_at(name, self.follows, s)] for name in self.free}
            found[s] = kept_within(at[s].replace(own), self.free)
        return found

    def best_of(self, starts: Sequence[Mapping[Setting, Values]]) -> Minimum[dict[Setting, Values]]:
        """Where the best of some starts leads; a `SimulationError` where none can be simulated."""
        ranked = sorted(range(len(starts)), key=lambda k: self.cost(starts[k]))
        seen = []
        for k in ranked[:_LOOKED_AT]:
            try:
                seen.append(self.descend(starts[k], _LOOK))
            except SimulationError:
                continue
        if not seen:
            raise SimulationError(
                f"{self.model.name} cannot be simulated at all settings at once.",
                code="not-integrated",
            )
        seen.sort(key=lambda one: one.cost)
        ends = [self.descend(one.extra) for one in seen[:_FOLLOWED]]
        return min(ends, key=lambda one: one.cost)

    def errors(self, ended: Minimum[dict[Setting, Values]]) -> dict[Unknown, float]:
        """Return the standard errors of the logarithms, to first order; 0 of what has no logarithm.

        What a law leaves over is not white: a stretch counts as `FEWEST_SAMPLES`, not as thousands.
        """
        jacobian, cost = ended.jacobian, ended.cost
        lengths = np.maximum(np.sqrt(np.sum(jacobian**2, axis=0)), 1e-300)
        columns = jacobian / lengths
        spread = np.linalg.inv(columns.T @ columns + 1e-12 * np.eye(len(lengths)))
        traces = (trace for one in self.misfits.values() for trace in one.traces)
        n = FEWEST_SAMPLES * sum(len(trace.stretches) for trace in traces)
        errors = np.sqrt(np.diag(spread) * cost / n) / lengths
        return {
            one: error if self.model.quantity(one.name).is_logarithmic else 0.0
            for one, error in zip(self.unknowns, errors.tolist(), strict=True)
        }

    def descend(
        self, at: Mapping[Setting, Values], stopping: Stopping = _END
    ) -> Minimum[dict[Setting, Values]]:
        """Minimise from values at which what is common is equal."""
        unknowns, settings = self.unknowns, self.settings
        places = {one: k for k, one in enumerate(unknowns)}
        rows = {
            s: np.array([places[unknown_at(n, self.follows, s)] for n in self.free], dtype=np.intp)
            for s in settings
        }
        quantities = [self.model.quantity(one.name) for one in unknowns]
        low, high = (np.array([one.plausible[k] for one in quantities]) for k in (0, 1))
        start = np.empty(len(unknowns))
        for s in settings:
            start[rows[s]] = [getattr(at[s], name) for name in self.free]
        start = np.clip(start, low, high)
        is_log = np.array([one.is_logarithmic for one in quantities], dtype=bool)
        is_friction = np.array([one.is_friction for one in quantities], dtype=bool)
        pulled_to = np.where(is_friction, BELIEVED_FRICTION, np.where(is_log, start, 1.0))
        pull = np.where(is_friction, _UNBELIEVED / FRICTION_SPREAD, _HELD * is_log)
        deviation = float(np.mean([one.deviation for one in self.misfits.values()]))

        def residuals(
            numbers: FloatArray,
        ) -> tuple[FloatArray, FloatArray, dict[Setting, Values]]:
            within = np.minimum(np.maximum(numbers, low), high)
            values = {
                s: at[s].replace(dict(zip(self.free, within[rows[s]].tolist(), strict=True)))
                for s in settings
            }
            blocks = list(pool.map(lambda s: self._rows(s, values[s]), settings))
            whole = np.hstack([block[0] for block in blocks])
            slopes = np.zeros((len(whole), len(unknowns)))
            first = 0
            for s, block in zip(settings, blocks, strict=True):
                slopes[first : first + block.shape[1], rows[s]] = block[1:].T
                first += block.shape[1]
            slopes[:, within != numbers] = 0.0  # beyond the edge nothing changes any more
            positive = np.where(is_log, numbers, 1.0)
            away = np.log(positive / pulled_to)
            slopes = np.vstack([slopes, np.diag(pull / positive)])
            return np.concatenate([whole, pull * away]), slopes, values

        transformation = Transformation(is_log, np.where(is_log, 1.0, deviation))
        pool: InTurn | Threads
        with executor(self.jobs) as pool:
            return minimise(residuals, start, transformation, stopping)

    def _rows(self, setting: Setting, values: Values) -> FloatArray:
        one = self.misfits[setting]
        scale = one.scale * math.sqrt(self.weights[setting])
        return one.rows(values, self.free) * scale
