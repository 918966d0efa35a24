"""Which of two laws the logs tell: the rule, with the number of samples that count.

A law with more quantities fits better always. It is taken only where all of these hold::

    n_eff ln(MSE_a/MSE_b) > (k_b - k_a) ln n_eff      its gain is more than its quantities cost
    MSE_a > 1.5 MSE_b                                 and worth having; or a force at a speed is, in
                                                      place of the MSE, which must not rise then
                                                      and, where noise may have the force off,
                                                      fall by a tenth; at a setting by itself what
                                                      is off beyond noise must fall by 1.5 too
    MSE_a > 0.02 %                                    the smaller law leaves something to explain,
                                                      or a force at a speed is off by more than 1 %,
                                                      or a held-out log by an MSE of 0.2 %
    at less than 0.02 %, for a force or a log alone   that is off by less with it, or what was held
                                                      out is predicted 1.5 times as well; of one
                                                      model where the MSE falls by less than 1.5
                                                      and noise may have the force off
    not every new part has a quantity at an edge of its range; of a part that a law is asked to do
    without (of one model: without which 1.5 times as much is left), at the edge at which it does
    nothing
    what was held out is predicted no worse

A force at a speed is the mean that was measured over all compared cycles within a twelfth of the
highest speed of its stroke, from a third of that on (`missed`). By it a part is worth having where
the smaller law is off there by more than 1 % and its stroke by more than the cycles scatter, and
where what matters most of what is left (MSE, force, held-out log, each over what is enough) falls
by 1.5. A knee is a small force, of which the MSE of a setting knows as little as that of all.

n_eff = 2 (sum p_h)^2/sum p_h^2 with p_h the power of the largest law's residual at the h-th
harmonic, at least 20 a stretch: what a law leaves over is not white, and the number of samples
would be ten times too large.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from damperfit.identification.log_facts import effective_samples as samples_of_stretch

if TYPE_CHECKING:
    from collections.abc import Sequence

    from damperfit.laws.law_fit import LawFit, SettingLogs

__all__ = [
    "AS_GOOD",
    "ENOUGH_PERCENT",
    "GAIN",
    "NO_WORSE",
    "PREDICTED_PERCENT",
    "SEEN_APART",
    "OfOneModel",
    "Tried",
    "Verdict",
    "are_alike",
    "effective_samples",
    "judged",
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
# A law with fewer numbers that leaves so many times as much is as good.
AS_GOOD = 1.02
# Numbers without which a valve's part is none.
_LEADING = ("_bleed", "_opening", "_slope")


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
    def worst_force_percent(self) -> float:
        """By how much the mean force at a speed is off, in the setting where it is off most."""
        return max(one.worst_force_percent for one in self.fits)

    @property
    def surely_misses_a_force(self) -> bool:
        """Whether a force at a speed is off by more than is enough beyond its noise."""
        return self.sure_force_percent > ENOUGH_FORCE_PERCENT

    @property
    def sure_force_percent(self) -> float:
        """The same of forces that are off beyond their noise; 0 where none is."""
        return max(one.sure_force_percent for one in self.fits)

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
    def absent(self) -> tuple[str, ...]:
        """Of these, what does nothing there in every setting."""
        names = set.intersection(*({*one.absent} for one in self.fits))
        return tuple(name for name in self.fits[0].free if name in names)

    @property
    def unseen(self) -> set[str]:
        """What no setting's logs determine."""
        return set.intersection(*({*one.at_bound, *one.undetermined} for one in self.fits))

    def with_better(self, fits: Sequence[LawFit]) -> Tried:
        """Return the law with those fits of some settings that leave less."""
        known = {one.setting: one for one in fits}
        pairs = ((one, known.get(one.setting, one)) for one in self.fits)
        return Tried(self.title, tuple(min(two, key=lambda fit: fit.mse_percent) for two in pairs))

    @property
    def score(self) -> float:
        """How well it fits and predicts at once; lower is better."""
        held = self.held_out_percent
        # Where no law can be simulated on what was held out, the fit alone ranks them.
        known = 1.0 if math.isnan(held) else min(held, _NOTHING_PREDICTED)
        return math.log(self.mse_percent) + math.log(known)


@dataclass(frozen=True, slots=True)
class Verdict:
    """Whether the larger of two laws is taken, and what decided it.

    Attributes
    ----------
    takes_larger : bool
        Whether it is.
    gain : float
        MSE of the smaller law over that of the larger.
    bic : float
        Difference of the criterion, positive where it is for the larger law.
    reason : str
        One sentence.
    """

    takes_larger: bool
    gain: float
    bic: float
    reason: str


@dataclass(frozen=True, slots=True)
class OfOneModel:
    """How one model of all settings is judged, beside a law at each setting by itself.

    What it predicts with an MSE of less than 0.05 % it predicts. A part that fits a tenth better is
    worth having by a force at a speed whether or not its stroke scatters by as much: it must suit
    all settings.

    Attributes
    ----------
    n_more : int
        Numbers that the larger has more at all settings together.
    least_gain : float
        MSE of the smaller over that of the larger from which on this is worth having.
    is_less : bool
        Whether the smaller law was made of the larger.
    """

    n_more: int
    least_gain: float = GAIN
    is_less: bool = False


def judged(
    small: Tried,
    large: Tried,
    n_eff: float,
    *,
    left_percent: float | None = None,
    is_removed: bool = False,
    of_one_model: OfOneModel | None = None,
) -> Verdict:
    """Return whether the larger law is taken.

    Parameters
    ----------
    small, large : Tried
        The larger has more quantities.
    n_eff : float
        Effective samples of all settings compared.
    left_percent : float, optional
        What the smaller law leaves, where that is not its MSE.
    is_removed : bool
        Whether the smaller law was made of the larger: a blow-off that opens without resistance is
        at an edge, and no less needed.
    of_one_model : OfOneModel, optional
        What is different where both are one model of all settings.
    """
    left = small.mse_percent if left_percent is None else left_percent
    gain = small.mse_percent / max(large.mse_percent, 1e-300)
    n_settings = len(small.fits)
    least_gain, least_held_out, of_force = GAIN, 0.0, 1.0
    if of_one_model is None:
        own = large.n_quantities - small.n_quantities
        cost = n_settings * own * math.log(n_eff / n_settings)
    else:
        cost = of_one_model.n_more * math.log(n_eff)
        least_gain, least_held_out = of_one_model.least_gain, PREDICTED_PERCENT
    # A preload that is none stands for friction of another form: it is not kept for a force.
    is_sure = small.surely_misses_a_force and not is_removed
    # Of a setting by itself the force that is surely off must be the one that is better.
    falls = small.sure_force_percent > GAIN * large.sure_force_percent
    may_be_of_force = of_one_model is not None or (is_sure and falls)
    # Of all settings' forces noise has one off: a part that does not fit better explains none.
    least_fall = 1.0 / NO_WORSE if is_sure else NO_WORSE
    if may_be_of_force and gain >= least_fall:
        of_force = small.left_over / large.left_over
    is_of_force = of_force > GAIN
    worth = max(gain, of_force) if is_of_force else gain
    bic = n_eff * math.log(max(worth, 1e-300)) - cost
    # A law that needs a part 1.5 times has it, wherever in its range it has ended.
    is_had = of_one_model is not None and of_one_model.is_less and gain > GAIN
    new = _missing(large.absent if is_removed or is_had else large.at_bound, _more(large, small))
    held = small.held_out_percent, large.held_out_percent
    if left <= ENOUGH_PERCENT and not small.leaves_something:
        reason = (
            f"the smaller law's {left:.2g} % leave too little to matter (below "
            f"{ENOUGH_PERCENT:g} %)"
        )
    elif (
        not is_removed
        and left <= ENOUGH_PERCENT
        and (of_one_model is None or (gain < GAIN and not small.surely_misses_a_force))
        and _in_vain(small, large)
    ):
        reason = (
            f"{left:.2g} % would be enough but for a force or another log, and neither is better "
            "with it"
        )
    elif gain < least_gain and not is_of_force:
        told = _below(gain, least_gain)
        reason = f"the MSE falls by a factor of {told} only; {least_gain:g} is required"
    elif bic <= 0.0:
        reason = f"its parameters cost more than the lower MSE is worth (BIC {bic:+.0f})"
    elif new:
        reason = f"{', '.join(new)} runs to the end of its range: it is absent"
    elif worse := predicted_worse(small, large, least=least_held_out):
        reason = worse
    else:
        beside = (
            "" if not math.isfinite(held[0]) else f", held out {held[0]:.2g} to {held[1]:.2g} %"
        )
        if gain < GAIN:
            off = small.worst_force_percent, large.worst_force_percent
            beside = f", force at a speed {off[0]:.2g} to {off[1]:.2g} %{beside}"
        reason = f"MSE {small.mse_percent:.2g} to {large.mse_percent:.2g} %{beside}"
        return Verdict(True, gain, bic, reason)
    return Verdict(False, gain, bic, reason)


def _in_vain(small: Tried, large: Tried) -> bool:
    """Whether a larger law does nothing about what the smaller one is off by beside its MSE.

    Friction in another form than the laws have is fitted better by a part that is not there, which
    neither the force at a speed nor what was held out confirms.
    """
    held = small.held_out_percent, large.held_out_percent
    return large.left_over >= small.left_over and not held[0] > GAIN * held[1]  # NaN: none was


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


def _more(large: Tried, small: Tried) -> list[str]:
    """Quantities that only the larger law has free."""
    return [name for name in large.fits[0].free if name not in small.fits[0].free]


def _missing(at_edge: Sequence[str], more: Sequence[str]) -> list[str]:
    """Of what a law has more, the numbers at an edge if each of its parts has one there."""
    found: list[str] = []
    for part in dict.fromkeys(map(_part, more)):
        own = [name for name in more if _part(name) == part]
        # What has the rest of a part is there: a bleed without a laminar share is an orifice.
        leading = [name for name in own if name.endswith(_LEADING)] or own
        edge = [name for name in leading if name in at_edge]
        if not edge:
            return []
        found += edge
    return found


def _part(name: str) -> str:
    """What a quantity is of: bleed or blow-off of a stroke, or one for itself."""
    stroke, _, number = name.partition("_")
    if stroke not in {"rebound", "compression"}:
        return name
    return f"{stroke} {'bleed' if number in {'bleed', 'leak'} else 'blow-off'}"


def effective_samples(tried: Tried, evidence: Sequence[SettingLogs]) -> float:
    """Return n_eff of a law's residuals over all settings compared.

    Parameters
    ----------
    tried : Tried
        The largest law.
    evidence : sequence of SettingLogs
        What it was fitted to, in the same order.
    """
    total = 0.0
    for fit, one in zip(tried.fits, evidence, strict=True):
        stretches = [stretch for trace in one.fitted for stretch in trace.stretches]
        for rest, stretch in zip(fit.residuals, stretches, strict=True):
            total += samples_of_stretch(rest, max(stretch.n_cycles, 1))
    return total


def _below(value: float, limit: float) -> str:
    """Return a number with as many digits, two or more, as tell it from the limit above it."""
    texts = (f"{value:.{digits}f}" for digits in range(2, 16))
    return next((text for text in texts if float(text) < limit), repr(value))


def _mean(values: Sequence[float]) -> float:
    return math.exp(float(np.mean([math.log(max(one, 1e-12)) for one in values])))
