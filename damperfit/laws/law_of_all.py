"""A law as one model of all settings, with the parts that it was offered; two of them compared."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, cast

from damperfit.errors import SimulationError
from damperfit.identification.law_misfit import LawMisfit
from damperfit.laws.both_ways import with_both_ways
from damperfit.laws.choosing import ENOUGH_PERCENT, Tried
from damperfit.laws.common_parts import made_of
from damperfit.laws.elsewhere import freed_of
from damperfit.laws.friction_at_rest import with_whole_friction
from damperfit.laws.law_fit import UNDETERMINED, fit_at
from damperfit.laws.one_model import OneModel
from damperfit.laws.variants import RETURNS, in_words, of_oil
from damperfit.workers import executor

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from damperfit.damper.model import Model, Values
    from damperfit.damper.valve_dampers import ValveDamper
    from damperfit.identification.least_squares import Minimum
    from damperfit.identification.sharing import Follows
    from damperfit.laws.common_parts import CommonPart
    from damperfit.laws.law_fit import LawFit, SettingLogs
    from damperfit.simulation import SolverOptions
    from damperfit.tested.setting import Setting

__all__ = [
    "LawOfAll",
    "as_one_model",
    "free_of",
    "led_back",
    "lost_with",
    "on_whole_logs",
    "values_of_less",
    "values_of_more",
]

# Times the misfit of its own fit, or what matters to nobody: a setting that one model meets worse
# lies in another valley.
_STRAINED, _ENOUGH = 4.0, ENOUGH_PERCENT / 100.0
# Times the value that a smaller law tells: what is so far off, and not told, is anywhere.
_FAR = 10.0
# Times what the larger of two laws leaves: the numbers of a smaller that leaves so much are those
# of something else.
_TELLS_ANOTHER = 3.0


@dataclass(frozen=True, slots=True, eq=False)
class LawOfAll:
    """A law as one model, where a descent on settled cycles has ended.

    Attributes
    ----------
    damper : ValveDamper
        The law.
    freed : tuple of str
        What of it is fitted although it has a default.
    one : OneModel
        With the logs.
    minimum : Minimum
        The values of the settings, and the slopes there.
    parts : tuple of CommonPart
        What it has of that which it was offered.
    """

    damper: ValveDamper
    freed: tuple[str, ...]
    one: OneModel
    minimum: Minimum[dict[Setting, Values]]
    parts: tuple[CommonPart, ...] = ()

    @property
    def values(self) -> dict[Setting, Values]:
        """Of each setting; what is common is equal."""
        return self.minimum.extra

    @property
    def own_freed(self) -> tuple[str, ...]:
        """What is freed but not as one of its parts."""
        return tuple(n for n in self.freed if all(n not in one.freed for one in self.parts))

    @property
    def n_unknowns(self) -> int:
        """Numbers of all settings together."""
        return len(self.one.unknowns)

    def by_looseness(self, core: ValveDamper) -> list[CommonPart]:
        """Return its parts, that first of which the best known number is known worst.

        Before them the returns: freed they run along valleys, and take the place of what is there.
        Behind them the oil's bulk modulus: it is there, and what is held at a value that it has not
        is told as friction that is larger at rest.

        Parameters
        ----------
        core : ValveDamper
            The law without its parts.
        """
        errors = self.one.errors(self.minimum)

        def error(part: CommonPart) -> float:
            left = made_of(core, (), [one for one in self.parts if one is not part])[0]
            mine = {*part.freed, *self.damper.names} - ({*left.names} - {*part.freed})
            return min((e for u, e in errors.items() if u.name in mine), default=math.inf)

        oil = {*of_oil(self.damper)}

        def order(part: CommonPart) -> tuple[bool, bool, float]:
            return RETURNS in part.freed, oil.isdisjoint(part.freed), error(part)

        return sorted(self.parts, key=order, reverse=True)


def free_of(damper: ValveDamper, freed: Sequence[str]) -> tuple[str, ...]:
    """Return what is fitted of a damper.

    Parameters
    ----------
    damper : ValveDamper
        The law.
    freed : sequence of str
        What of it is, although it has a default.
    """
    return tuple(q.name for q in damper.quantities if q.default is None or q.name in freed)


def values_of_less(damper: ValveDamper, free: Sequence[str], values: Values) -> Values:
    """Return values of a law with fewer parts: what is freed no longer is at its default.

    Parameters
    ----------
    damper : ValveDamper
        The law with fewer.
    free : sequence of str
        What is fitted of it.
    values : Values
        Of the law with more.
    """
    values = with_whole_friction(values, damper)
    numbers = {
        q.name: getattr(values, q.name) if q.name in free or q.default is None else q.default
        for q in damper.quantities
    }
    return damper.values_type(**numbers)


def as_one_model(
    fits: Sequence[LawFit],
    evidence: Mapping[Setting, SettingLogs],
    follows: Callable[[Model, Sequence[str]], Follows],
    solver: SolverOptions,
    jobs: int,
) -> LawOfAll:
    """Return a law as one model, from its fits at single settings.

    Parameters
    ----------
    fits : sequence of LawFit
        A law of valves at each setting by itself.
    evidence : mapping of Setting to SettingLogs
        Their logs.
    follows : callable
        From a law and what is free to the adjusters that each quantity follows.
    solver : SolverOptions
        How exactly to integrate.
    jobs : int
        Threads.

    Raises
    ------
    SimulationError
        It cannot be simulated at all settings at once.
    """
    own, freed = fits[0], freed_of(Tried("", tuple(fits)))
    misfits = {
        fit.setting: LawMisfit(
            own.model, evidence[fit.setting].fitted, own.free, solver
        ).on_cycles()
        for fit in fits
    }
    apart = {fit.setting: fit.values for fit in fits}
    one = OneModel(misfits, follows(own.model, own.free), {}, jobs)
    one = one.weighed_at(apart, least=_ENOUGH)
    found = one.best_of(list(one.starts(apart)))
    values = found.extra
    strained = [
        100.0 * misfits[fit.setting].cost(values[fit.setting])
        > _STRAINED * max(fit.mse_percent, ENOUGH_PERCENT)
        for fit in fits
    ]
    if not any(strained):  # else the setting that is met worst would count least
        one = one.weighed_at(values)
        found = one.descend(values)
    damper = cast("ValveDamper", own.model)
    both = {setting: with_both_ways(damper, at) for setting, at in found.extra.items()}
    if both != found.extra:
        with suppress(SimulationError):  # what was found stays
            other = one.descend(one.with_common(both))
            found = min(found, other, key=lambda end: end.cost)
    return LawOfAll(damper, freed, one, found)


def on_whole_logs(
    law: LawOfAll, evidence: Mapping[Setting, SettingLogs], solver: SolverOptions, jobs: int
) -> Tried:
    """Return a law at every setting, judged on the whole logs.

    Parameters
    ----------
    law : LawOfAll
        As one model.
    evidence : mapping of Setting to SettingLogs
        The logs.
    solver : SolverOptions
        How exactly to integrate.
    jobs : int
        Threads.

    Raises
    ------
    SimulationError
        It cannot be simulated there.
    """
    errors = law.one.errors(law.minimum)
    values = law.one.with_least_openings(law.values)

    def at(setting: Setting) -> LawFit:
        return fit_at(
            replace(law.one.misfits[setting], solver=solver, cycles=None),
            evidence[setting],
            values[setting],
            evaluations=law.minimum.evaluations,
            undetermined=tuple(
                one.name
                for one, error in errors.items()
                if one.holds_at(setting) and error > math.log(UNDETERMINED)
            ),
        )

    with executor(jobs) as pool:
        fits = tuple(pool.map(at, law.one.settings))
    return Tried(in_words(law.damper, law.freed), fits)


def values_of_more(
    law: LawOfAll, one: OneModel, freed: Sequence[str], evidence: Mapping[Setting, SettingLogs]
) -> tuple[dict[Setting, Values], dict[Setting, Values]]:
    """Return values of a law with more parts: with these where they start, and small.

    Parameters
    ----------
    law : LawOfAll
        The law with fewer.
    one : OneModel
        The law with more.
    freed : sequence of str
        What of it is fitted although it has a default.
    evidence : mapping of Setting to SettingLogs
        Whose loops show where it starts.
    """
    quantities = one.model.quantities
    held = {q.name: q.default for q in quantities if q.default is not None and q.name not in freed}
    full, small = {}, {}
    for s, own in law.values.items():
        near = with_whole_friction(own, one.model)
        start = one.model.start(evidence[s].fitted, held)[0]
        known = {n: getattr(near, n) for n in near.names if n in one.model.names}
        # What stands at nothing was held: from there no descent would find it.
        new = [n for n in one.free if not known.get(n)]
        known = {n: x for n, x in known.items() if n not in new}
        absent = one.misfits[s].absent_beside(known)
        little = {n: math.sqrt(low * getattr(start, n)) for n, low in absent.items()}
        full[s], small[s] = start.replace(known), start.replace(known | little)
    return full, small


def led_back(law: LawOfAll, larger: LawOfAll) -> LawOfAll:
    """Return a law descended from where a larger one has led, or as it is where that costs less.

    Parameters
    ----------
    law : LawOfAll
        What a larger law was made of.
    larger : LawOfAll
        With parts more; what it has no more stays where it is.

    Raises
    ------
    SimulationError
        The law cannot be simulated there.
    """
    names = [name for name in law.one.free if name in larger.one.free]
    led = {s: with_whole_friction(at, law.damper) for s, at in larger.values.items()}
    at = {
        setting: values.replace({name: getattr(led[setting], name) for name in names})
        for setting, values in law.values.items()
    }
    end = law.one.descend(law.one.with_common(at))
    return replace(law, minimum=end) if end.cost < law.minimum.cost else law


def lost_with(less: Tried, more: Tried) -> str:
    """Return a quantity of the smaller of two laws that has no value any more in the larger.

    It has run to an edge of its range, or so far towards it that no log tells it. A bleed may be
    lost to its own laminar part, for both are the bleed; and anything may to a law that leaves a
    third, for what the smaller one told stood in the place of what it lacks.

    Parameters
    ----------
    less, more : Tried
        Two laws at the same settings.
    """
    if less.mse_percent > _TELLS_ANOTHER * more.mse_percent:
        return ""
    for small, large in zip(less.fits, more.fits, strict=True):
        for name in small.free:
            if (
                name in large.free
                and not _has_own_leak(large, name)
                and _is_gone(small, large, name)
            ):
                return f"{small.model.quantity(name).label} at setting {small.setting}"
    return ""


def _is_gone(small: LawFit, large: LawFit, name: str) -> bool:
    if name in small.at_bound or name in small.undetermined:
        return False
    before, after = getattr(small.values, name), getattr(large.values, name)
    is_far = name in large.undetermined and not 1.0 / _FAR < after / before < _FAR
    return name in large.at_bound or is_far


def _has_own_leak(fit: LawFit, name: str) -> bool:
    stroke, _, part = name.partition("_")
    return part in {"bleed", "leak"} and {f"{stroke}_bleed", f"{stroke}_leak"} <= {*fit.free}
