"""What a search has tried so far, and its two steps: a part less, and a part more."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, cast

from damperfit.damper.mounting import NONE
from damperfit.errors import SimulationError
from damperfit.laws.choosing import ENOUGH_PERCENT, GAIN, Tried, Verdict, judged
from damperfit.laws.elsewhere import freed_of, had_by, lent, needed_at
from damperfit.laws.judged_laws import JudgedLaw
from damperfit.laws.law_fit import fit_law, glimpsed
from damperfit.laws.strokes import with_strokes_told
from damperfit.laws.variants import (
    KINDS,
    LACKING,
    ONE_STROKE,
    PARTS,
    in_words,
    of_oil,
    with_part,
    without_part,
    words_of,
)
from damperfit.workers import executor

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from damperfit.damper.model import Model
    from damperfit.damper.valve_dampers import ValveDamper
    from damperfit.laws.law_fit import LawFit, SettingLogs
    from damperfit.simulation import SolverOptions

__all__ = ["Course", "hopeless_beside", "valve_damper"]

# A law without a part that leaves so many times as much after a few steps lacks what is needed: it
# is left there, before its descents.
_LACKING = 20.0
# What the rig has, which is told before what valves and oil have is offered.
_OF_RIG = ("lag", "play")
# A part that lowers the MSE by less is not offered again once another part has been taken.
_SOMETHING = 1.1

# What a law without it has in a wrong valley, friction taken for a preload or for soft oil, so that
# a few steps from there show nothing. So has the oil's bulk modulus: gas in the oil stands for it
# where that alone is fitted to its end.
_HIDDEN = ("lifting", "port", "breakaway", "free_gas")
# Likewise, but beside a blow-off alone: without one the loops tell both ways of a bleed.
_HIDDEN_BESIDE_BLOW_OFFS = "long"


class Course:
    """What has been tried so far."""

    def __init__(
        self,
        evidence: Sequence[SettingLogs],
        solver: SolverOptions,
        on_law: Callable[[JudgedLaw], None],
        jobs: int,
        held_share: float = math.nan,
        elsewhere: Sequence[SettingLogs] = (),
    ) -> None:
        self.evidence, self.solver, self.elsewhere = evidence, solver, elsewhere
        self.on_law, self.jobs = on_law, jobs
        self.laws: list[JudgedLaw] = []
        self.more: list[str] = []  # parts that were taken, one after the other
        self.of_one: list[str] = []  # of these, what a setting by itself has asked for
        self.n_eff = math.nan
        self.alike: tuple[str, ...] = ()
        self.held_share, self.also = held_share, ""

    def fitted(
        self,
        model: Model,
        *,
        freed: tuple[str, ...] = (),
        near: Tried | None = None,
        is_whole: bool = False,
        hopeless_percent: float = math.inf,
    ) -> Tried | None:
        """Fit a law to every setting; None where it cannot be simulated."""
        return self.all_fitted(
            [model], freed=freed, near=near, is_whole=is_whole, hopeless_percent=hopeless_percent
        )[0]

    def all_fitted(
        self,
        models: Sequence[Model],
        *,
        freed: tuple[str, ...] = (),
        near: Tried | None = None,
        is_whole: bool = False,
        hopeless_percent: float = math.inf,
    ) -> list[Tried | None]:
        """Fit laws to every setting, several fits at a time; each frees what it has of `freed`."""

        def fit(job: tuple[Model, int]) -> LawFit | None:
            model, place = job
            start = None if near is None else near.fits[place].values
            try:
                return fit_law(
                    model,
                    self.evidence[place],
                    freed=had_by(model, freed),
                    near=start,
                    solver=self.solver,
                    is_whole=is_whole,
                    hopeless_percent=hopeless_percent,
                )
            except SimulationError:
                return None

        places = range(len(self.evidence))
        with executor(self.jobs) as pool:
            fits = list(pool.map(fit, [(model, k) for model in models for k in places]))
        found: list[Tried | None] = []
        for row, model in enumerate(models):
            own = [one for one in fits[row * len(places) :][: len(places)] if one is not None]
            is_all = len(own) == len(places)
            title = in_words(model, had_by(model, freed))
            found.append(Tried(title, tuple(own)) if is_all else None)
        return found

    def crossed(self, law: Tried) -> Tried:
        """Each setting fitted again from what is the damper's or the rig's at another, if better.

        At one speed a friction and a preload look alike, so do a lag and an elasticity.
        """

        def best(place: int) -> LawFit:
            return lent(law.fits[place], self.evidence[place], law.fits, self.solver)

        with executor(self.jobs) as pool:
            fits = tuple(pool.map(best, range(len(law.fits))))
        return (
            law
            if all(a is b for a, b in zip(fits, law.fits, strict=True))
            else Tried(law.title, fits)
        )

    def record(
        self,
        tried: Tried,
        reason: str,
        *,
        is_taken: bool,
        change: str = "",
        verdict: Verdict | None = None,
    ) -> None:
        """Keep a law that was judged, and say it to who waits for it."""
        bic, gain = (math.nan, math.nan) if verdict is None else (verdict.bic, verdict.gain)
        judged_law = JudgedLaw(tried, is_taken, reason, bic, change, gain)
        self.laws.append(judged_law)
        self.on_law(judged_law)

    def without(
        self, law: Tried, change: str, smaller: Callable[[ValveDamper], ValveDamper | None]
    ) -> Tried:
        """The law without a part, where it does not need it."""
        model = smaller(valve_damper(law))
        if model is None:
            return law
        one = self.fitted(
            model, freed=freed_of(law), near=law, hopeless_percent=hopeless_beside(law)
        )
        if one is None:
            return law
        verdict = judged(one, law, self.n_eff, is_removed=True)
        asked = self.elsewhere if change in ONE_STROKE else ()
        return self.smaller_of(one, law, change, verdict, asked)

    def smaller_of(
        self, one: Tried, law: Tried, change: str, verdict: Verdict, asked: Sequence[SettingLogs]
    ) -> Tried:
        """The smaller of two laws where no setting, compared or not, needs the larger."""
        needed = "it lacks a part that is needed: " if verdict.takes_larger else ""
        is_taken, reason = not verdict.takes_larger, f"{needed}{verdict.reason}"
        if why := needed_at(one, law, asked if is_taken else (), self.solver):
            is_taken, reason = False, why
        self.record(one, reason, is_taken=is_taken, change=f"without {change}", verdict=verdict)
        return one if is_taken else law

    def without_early(self, law: Tried) -> Tried:
        """The law without parts that another, taken after them, stands for better.

        A gas volume explains some of what a friction does that has not been offered yet, and a lag
        of what softer oil does: lag and play are asked for as soon as any part was taken. What a
        setting by itself has asked for may have led others to where none of them needs it.
        """
        return self.asked_again(law, (*self.more[:-1], *self.of_one, *_OF_RIG) if self.more else ())

    def asked_again(self, law: Tried, parts: Sequence[str]) -> Tried:
        """The law without those of some parts that it does not need as it is now."""
        for name in dict.fromkeys(parts):
            damper, freed = valve_damper(law), freed_of(law)
            model, left = without_part(damper, name), tuple(one for one in freed if one != name)
            if (model, left) == (damper, freed):
                continue
            one = self.fitted(model, freed=left, near=law, hopeless_percent=hopeless_beside(law))
            if one is None:
                continue
            if one.mse_percent > hopeless_beside(law):  # it was left there, before its descents
                reason = f"it lacks a part that is needed: MSE {one.mse_percent:.2g} %"
                change = f"without {words_of(damper, name)}"
                self.record(one, reason, is_taken=False, change=change)
                continue
            verdict = judged(one, law, self.n_eff)
            law = self.smaller_of(one, law, words_of(damper, name), verdict, self.elsewhere)
        return law

    def enriched(self, law: Tried, names: Sequence[str]) -> Tried:
        """Offer what is left over to further parts: the one that explains most, and so on."""
        left = list(names)
        while left and law.leaves_something:
            offered = [(name, one) for name in left if (one := self.offered(law, name)) is not None]
            if not offered:
                return law
            verdicts = {name: judged(law, one, self.n_eff) for name, one in offered}
            better = self.back_from(
                law,
                [
                    one
                    for name, one in offered
                    if verdicts[name].gain > GAIN or verdicts[name].takes_larger
                ],
            )
            if better is not law:
                law = better
                continue
            offered.sort(key=lambda pair: pair[1].score)
            best: Tried | None = None
            for name, one in offered:
                verdict = verdicts[name]
                is_taken = verdict.takes_larger and best is None
                reason = verdict.reason
                if verdict.takes_larger and best is not None:
                    reason = "another part explains more of what was left"
                change = f"with {words_of(valve_damper(law), name)}"
                self.record(one, reason, is_taken=is_taken, change=change, verdict=verdict)
                if is_taken:
                    best = one
                    self.more.append(name)
                if is_taken or verdict.gain < _SOMETHING:  # else it may explain the rest later
                    left.remove(name)
            if best is None:
                return law
            law = with_strokes_told(self, best, valve_damper(best))
        return law

    def back_from(self, law: Tried, larger: Sequence[Tried]) -> Tried:
        """The law itself from where a larger one got: what it lacks may be a better start alone.

        Of its MSE, or what matters most of what is left, the factor of a larger law must be gone.
        """
        if not larger:
            return law
        best = min(larger, key=lambda one: one.mse_percent)
        again = self.fitted(valve_damper(law), freed=freed_of(law), near=best)
        if again is None:
            return law
        one = law.with_better(again.fits)
        if law.mse_percent < GAIN * one.mse_percent and law.left_over < GAIN * one.left_over:
            return law
        reason = f"MSE {law.mse_percent:.2g} to {one.mse_percent:.2g} % from a better start"
        self.record(one, reason, is_taken=True, change="from where a larger law ended")
        return one

    def offered(self, law: Tried, name: str) -> Tried | None:
        """A law with a part more; None where it has that already, or cannot have it."""
        model, freed = valve_damper(law), freed_of(law)
        if name in KINDS or name in PARTS or name in LACKING:
            model = with_part(model, name)
            if model == valve_damper(law):
                return None
        elif name not in model.names or name in law.fits[0].free:
            return None
        else:
            freed = (*freed, name)
        if _is_hidden(name, model):
            return self.fitted(model, freed=freed, near=law)
        try:
            seen = [
                glimpsed(model, one, fit, freed=freed, solver=self.solver)
                for one, fit in zip(self.evidence, law.fits, strict=True)
            ]
        except SimulationError:
            return None
        hardly = tuple(one for one in seen if one is not None)
        if len(hardly) == len(seen):
            return Tried(in_words(model, freed), hardly)
        return self.fitted(model, freed=freed, near=law)


def _is_hidden(name: str, model: ValveDamper) -> bool:
    """Whether a few steps from a law may not show a part, of the law with it."""
    if name == _HIDDEN_BESIDE_BLOW_OFFS:
        valves = (model.rebound, model.compression)
        return any(one.bleed == name and one.blow_off != NONE for one in valves)
    return name in _HIDDEN or name in of_oil(model)


def hopeless_beside(law: Tried) -> float:
    """What a law in place of another leaves after a few steps where it lacks what is needed, %."""
    return _LACKING * max(law.mse_percent, ENOUGH_PERCENT)


def valve_damper(law: Tried) -> ValveDamper:
    """Return the damper of a law that is one of valves."""
    return cast("ValveDamper", law.fits[0].model)
