"""A law at all settings as one model: what settings have in common has one value in all of them.

For comparing laws, as `law_fit` does for single settings: on settled cycles, each setting weighed
by what is left there, so that a factor of one setting's MSE counts as much as another's.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from damperfit.damper.model import Model, Values
from damperfit.errors import SimulationError
from damperfit.identification.fit_problem import FitProblem, Point, kept_within
from damperfit.identification.least_squares import Minimum, Stopping
from damperfit.identification.sharing import Unknown, unknown_at
from damperfit.tested.setting import Setting

# Steps are short beside numbers known to a thousandth: no step is too short to be tried.
_SHORTEST = 1e-8
_LOOK = Stopping(cost_tolerance=1e-2, step_tolerance=_SHORTEST, max_evaluations=10, rest=math.inf)
_END = Stopping(cost_tolerance=1e-3, step_tolerance=_SHORTEST, max_evaluations=50, rest=math.inf)
_FIRST = 6  # settings whose values are starts
# Starts that are looked at, and those that are followed to their end.
_LOOKED_AT, _FOLLOWED = 6, 3
_LEAST = 2e-6  # of what a setting leaves, per unit of its variance


@dataclass(frozen=True, slots=True, eq=False)
class OneModel(FitProblem):
    """A law, the logs of settings, and what these have in common: all that is free is in `border`.

    What is each setting's own follows all adjusters.
    """

    @property
    def model(self) -> Model:
        """The law."""
        return self.blocks[self.settings[0]].model

    @property
    def own(self) -> tuple[str, ...]:
        """What is free, and each setting's own."""
        adjusters = self.settings[0].adjusters
        return tuple(name for name in self.free if self.follows.get(name) == adjusters)

    def weighed_at(self, at: Mapping[Setting, Values]) -> OneModel:
        """Return the same with the weights that values of the settings leave them.

        What is left counts as `_LEAST` at least, and as much as the cycles differ.
        """
        blocks = self.blocks.items()
        left = {setting: max(b.cost(at[setting]), b.scatter, _LEAST) for setting, b in blocks}
        return replace(self, weights={setting: 1.0 / cost for setting, cost in left.items()})

    def cost(self, at: Mapping[Setting, Values]) -> float:
        """Return the weighed sum of squares; infinite where the law cannot be simulated."""
        weights = self.weights or {}
        try:
            return sum(weights[s] * block.cost(at[s]) for s, block in self.blocks.items())
        except SimulationError:
            return math.inf

    def with_common(self, at: Mapping[Setting, Values]) -> dict[Setting, Values]:
        """Return values with what settings have in common at the mean of theirs."""
        means = {}
        for unknown in self.border:
            name, having = unknown.name, [s for s in self.settings if unknown.holds_at(s)]
            own = np.array([getattr(at[s], name) for s in having])
            is_positive = self.model.quantity(name).is_logarithmic and own.min() > 0.0
            mean = math.exp(np.mean(np.log(own))) if is_positive else float(np.mean(own))
            means[unknown] = mean
        return self._with(at, means)

    def starts(self, at: Mapping[Setting, Values]) -> Iterator[dict[Setting, Values]]:
        """Yield starts: what is common at its mean, then as single settings have it, in turn.

        One setting in a wrong local minimum, with bleed and blow-off changed over, spoils a mean.
        """
        yield self.with_common(at)
        settings, weights = self.settings, self.weights or {}
        for setting in sorted(settings, key=lambda s: -weights[s])[:_FIRST]:
            order = setting, *(other for other in settings if other != setting)
            first = {
                unknown: getattr(at[next(s for s in order if unknown.holds_at(s))], unknown.name)
                for unknown in self.border
            }
            yield self._with(at, first)

    def _with(
        self, at: Mapping[Setting, Values], numbers: Mapping[Unknown, float]
    ) -> dict[Setting, Values]:
        values = {}
        for s in self.settings:
            own = {name: numbers[unknown_at(name, self.follows, s)] for name in self.free}
            values[s] = kept_within(at[s].replace(own), self.free)
        return values

    def best_of(self, starts: Sequence[Mapping[Setting, Values]]) -> Minimum[Point]:
        """The minimum from the best of some starts; a `SimulationError` if none can be run."""
        seen = []
        for start in sorted(starts, key=self.cost)[:_LOOKED_AT]:
            with suppress(SimulationError):
                seen.append(self.minimise(start, _LOOK))
        if not seen:
            raise SimulationError(
                f"{self.model.name} cannot be simulated at all settings at once.",
                code="not-integrated",
            )
        seen.sort(key=lambda look: look.cost)
        ends = [self.minimise(look.extra.values, _END) for look in seen[:_FOLLOWED]]
        return min(ends, key=lambda end: end.cost)
