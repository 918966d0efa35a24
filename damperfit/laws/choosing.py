"""A structure with its fits at several settings, and how well it fits and predicts.

A force at a speed is the mean that was measured over all compared cycles within a twelfth of the
highest speed of its stroke, from a third of that on (`missed`): a knee is a small force, of which
the MSE of a setting knows little.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from damperfit.laws.law_fit import LawFit

__all__ = [
    "ENOUGH_PERCENT",
    "GAIN",
    "PREDICTED_PERCENT",
    "SEEN_APART",
    "Tried",
    "are_alike",
    "predicted_worse",
    "times_worse",
]

GAIN = 1.5
ENOUGH_PERCENT = 0.02
# A law whose MSE is below that may still have a force at a speed off by some per cent, for a small
# force weighs little; or predict another speed badly.
ENOUGH_FORCE_PERCENT = 1.0
ENOUGH_HELD_OUT_PERCENT = 0.2
# Two layouts whose MSE, times that of what was held out, differ by less cannot be told apart.
SEEN_APART = 1.5
# The same where the worse of them leaves and mispredicts nothing that anyone would use: twice each.
_NOTHING_APART = 4.0
# A tenth of what is asked of a prediction: below it none predicts worse, and no verdict asks less.
PREDICTED_PERCENT = 0.05
_NOTHING_PREDICTED = 100.0  # per cent: a law that predicts nothing, or cannot be simulated there
# Two predictions this near each other differ by noise.
NO_WORSE = 1.1


@dataclass(frozen=True, slots=True, eq=False)
class Tried:
    """One law with its fits, pooled over the settings that are compared.

    Attributes
    ----------
    title : str
        In words.
    fits : tuple of LawFit
        One a setting.
    """

    title: str
    fits: tuple[LawFit, ...]

    @property
    def mse_percent(self) -> float:
        """Geometric mean over the settings of eq. (22)."""
        return _mean([one.mse_percent for one in self.fits])

    @property
    def held_out_percent(self) -> float:
        """Likewise of what was predicted; NaN without any."""
        known = [x.held_out_percent for x in self.fits if not math.isnan(x.held_out_percent)]
        return _mean(known) if known else math.nan

    @property
    def left_over(self) -> float:
        """What it leaves, times what is enough: MSE, a force at a speed, a held-out log."""
        forces = [one.worst_force_percent / ENOUGH_FORCE_PERCENT for one in self.fits]
        logs = [one.held_out_percent for one in self.fits if one.held_out == "logs"]
        logs = [one / ENOUGH_HELD_OUT_PERCENT for one in logs]
        # NaN, of what was not looked at, is less than anything.
        known = [one for one in (*forces, *logs) if not math.isnan(one)]
        return max([self.mse_percent / ENOUGH_PERCENT, *known])

    @property
    def leaves_something(self) -> bool:
        """Whether it leaves enough for a larger law to be looked for."""
        return self.left_over > 1.0

    @property
    def n_quantities(self) -> int:
        """Free quantities of one setting."""
        return len(self.fits[0].free)

    @property
    def at_bound(self) -> tuple[str, ...]:
        """What ran into an edge of its range in every setting."""
        names = set(self.fits[0].at_bound).intersection(*(one.at_bound for one in self.fits[1:]))
        return tuple(name for name in self.fits[0].free if name in names)

    @property
    def freed(self) -> tuple[str, ...]:
        """What is free although the model has a default for it."""
        one = self.fits[0]
        return tuple(name for name in one.free if one.model.quantity(name).default is not None)

    @property
    def score(self) -> float:
        """How well it fits and predicts at once; lower is better."""
        held = self.held_out_percent
        # Where no law can be simulated on what was held out, the fit alone ranks them.
        known = 1.0 if math.isnan(held) else min(held, _NOTHING_PREDICTED)
        return math.log(self.mse_percent) + math.log(known)


def predicted_worse(before: Tried, after: Tried, *, least: float = 0.0) -> str:
    """Say that a law predicts worse than before, and than least, per cent; else nothing."""
    held = before.held_out_percent, after.held_out_percent
    if not held[1] > NO_WORSE * max(held[0], least):  # NaN: none was
        return ""
    return f"what was held out is predicted worse, {held[1]:.2g} % after {held[0]:.2g} %"


def times_worse(best: Tried, other: Tried) -> float:
    """Return how many times worse a law fits and predicts than another."""
    return math.exp(other.score - best.score)


def are_alike(best: Tried, other: Tried) -> bool:
    """Return whether nobody would choose a layout by what the two fit and predict.

    Parameters
    ----------
    best, other : Tried
        The same parts in two layouts.
    """
    held = other.held_out_percent
    left = max(other.mse_percent, 0.0 if math.isnan(held) else held)
    return times_worse(best, other) < (SEEN_APART if left > ENOUGH_PERCENT else _NOTHING_APART)


def _mean(values: Sequence[float]) -> float:
    return math.exp(float(np.mean([math.log(max(one, 1e-12)) for one in values])))
