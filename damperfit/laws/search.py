"""Which law the logs tell: from the paper's model to real valves on a mounting, step by step.

    1  the paper's model; where it leaves less than `ENOUGH_PERCENT`, nothing else is looked for; of
       valves that are declared it is, for the logs may need less than they have
    2  bleed and blow-off in each stroke with everything that a mounting may have, in each layout;
       where that leaves something, with ports behind the blow-offs too
    3  of the best layout what is not needed is taken out again, the rig's parts and the valves'
       alike, by the rule of `choosing`: so no valve is invented for the rig, nor the reverse
    4  what is left over is offered to further parts, kinds of blow-offs to both strokes and then to
       each by itself (`strokes`): soft oil, gas in it, returns, rounding, ports,
       friction that drags, builds up, turns within a speed, falls with it or grows with the
       pressure; a mass that moves; play and lag too, if a wrong valley had them taken out; each
       part that was taken is asked for again beside those taken after it, and play and lag are;
       what a setting by itself has asked for is asked for again at all of them, once each has
       borrowed friction, oil and mounting that another tells unlike its own
    5  what is left is tried in the other layouts too: those that do as well cannot be told apart,
       and of those that nothing tells apart the most usual is taken; in another than the first each
       part is asked for again; friction that is larger at rest gives way to what is supposed of
       oil and returns where that is as good
    6  where the logs yield before they slide, models that yield are held against the valves

Laws are compared on settled cycles; the law that is taken ends on the whole logs.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING

from damperfit.damper.valve_dampers import ValveDamper
from damperfit.errors import SimulationError
from damperfit.identification.blas_threads import one_blas_thread
from damperfit.laws.bleeds import with_bleeds_told
from damperfit.laws.choosing import (
    GAIN,
    SEEN_APART,
    Tried,
    are_alike,
    effective_samples,
    judged,
    times_worse,
)
from damperfit.laws.course import Course, valve_damper
from damperfit.laws.elsewhere import freed_of, had_by, worst_missed
from damperfit.laws.judged_laws import JudgedLaw, LawSearch
from damperfit.laws.layout_choice import layout_taken, said_of_layout
from damperfit.laws.seals import with_turning_told
from damperfit.laws.strokes import with_strokes_told
from damperfit.laws.supposed import with_supposed_told
from damperfit.laws.variants import (
    BOTH,
    KINDS,
    LACKING,
    ONE_STROKE,
    PARTS,
    RETURNS,
    SMALLER,
    VALVES,
    everything,
    laid_out_as,
    of_oil,
    with_part,
    with_parts,
)
from damperfit.laws.yielding import YIELDING, held_against, is_open_to, unbelievable
from damperfit.simulation import SolverOptions

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from damperfit.damper.model import Model
    from damperfit.laws.law_fit import SettingLogs

__all__ = ["search_laws"]

# What is offered to what is left over, one after the other: quantities, and kinds of valves' parts.
_DECLARED = ("gas_volume",)
_FURTHER = (
    RETURNS,
    "drag",
    *KINDS,
    *PARTS,
    *LACKING,
    "free_gas",
)
# The same parts in another layout that fitted and predicted so many times worse are not fitted
# again from the law that was taken.
_FAR_WORSE = 8.0
# A mounting so many times as stiff as the oil is none: what K_e is held at may be off by as much.
_AS_RIGID = 3.0
# Settings at which parts more are looked for, each by itself.
_MOST_GROWN = 3


@one_blas_thread()
def search_laws(  # noqa: PLR0913 - what a user may ask of it
    plain: Model,
    layouts: Sequence[ValveDamper],
    evidence: Sequence[SettingLogs],
    *,
    solver: SolverOptions = SolverOptions(),
    on_law: Callable[[JudgedLaw], None] = lambda _: None,
    jobs: int = 1,
    held_share: float = math.nan,
    held_by_some: float = math.nan,
    elsewhere: Sequence[SettingLogs] = (),
) -> LawSearch:
    """Try laws from the paper's to the richest, and return which one the logs tell.

    Parameters
    ----------
    plain : Model
        The paper's damper, or one of valves as it is declared: of that too the logs may need less.
    layouts : sequence of ValveDamper
        The damper in each layout that it may have.
    evidence : sequence of SettingLogs
        Settings to compare the laws by; two or three tell as much as all.
    solver : SolverOptions
        How exactly to integrate.
    on_law : callable
        Called with every law that was judged.
    jobs : int
        Workers; the result does not depend on them.
    held_share : float
        Of their force that the logs hold down to a tenth of the speed, where they yield before they
        slide; NaN where they do not.
    held_by_some : float
        The most that one holds, where not all of them yield: a magneto-rheological damper without
        current does not. Asked where valves leave something; NaN where none yields.
    elsewhere : sequence of SettingLogs
        Other settings, asked before a part of one stroke's valve is taken out.
    """
    course = _Search(evidence, solver, on_law, jobs, held_share, elsewhere)
    offsets = (one for one in plain.quantities if one.is_offset and one.default is not None)
    simplest = course.fitted(plain, freed=tuple(one.name for one in offsets))
    has_valves = isinstance(plain, ValveDamper)
    if simplest is not None and not simplest.leaves_something and not has_valves:
        course.record(simplest, "what it leaves is too small to matter", is_taken=True)
        return course.ended(simplest)
    richest = [with_parts(layout, BOTH, everything(layout.mounting)) for layout in layouts]
    found = [one for one in course.all_fitted(richest) if one is not None]
    if not found:
        if simplest is None:
            raise SimulationError("no law can be simulated on these logs.")
        course.record(simplest, "no other law can be simulated on these logs", is_taken=True)
        return course.ended(simplest)
    lean = course.lean(course.best_layout(course.ported(found)))
    lean = with_strokes_told(course, lean, valve_damper(lean))
    offered = (*of_oil(valve_damper(lean)), *_FURTHER)
    rich = course.needed_by_some(course.enriched(lean, offered), offered)
    if _bleeds_of(rich) != _bleeds_of(lean):  # a blow-off beside other bleeds may be idle now
        rich = course.lean(rich, VALVES)
    rich = course.without_early(course.without_unseen(course.crossed(rich)))
    rich = course.in_its_layout(rich, layouts)
    turning = with_turning_told(course, rich, course.as_well)
    rich = rich if turning is rich else course.in_its_layout(turning, layouts)
    rich = with_supposed_told(course, rich)
    settled = course.declared if has_valves else course.settled
    law = rich if simplest is None else settled(simplest, rich)
    course.open_to(law, held_by_some)
    return course.ended(course.yielding(law))


class _Search(Course):
    """The steps of a search, from the layout to the law that is taken."""

    is_held_by_some = False  # whether `held_share` is of some settings alone
    doubt = ""
    as_well: tuple[Tried, ...] = ()  # the law in layouts that nobody would choose it by

    def ported(self, found: Sequence[Tried]) -> list[Tried]:
        """The layouts with ports behind their blow-offs, where those tell much more; else as found.

        A port that takes most of the pressure makes a blow-off pass for a bleed beside friction.
        """
        best = min(found, key=lambda one: one.score)
        if not best.leaves_something:
            return list(found)
        near = [one for one in found if times_worse(best, one) < _FAR_WORSE]
        models = [with_part(valve_damper(one), "port") for one in near]
        tried = [one for one in self.all_fitted(models) if one is not None]
        first = min(tried, key=lambda one: one.score, default=best)
        reason = f"MSE {best.mse_percent:.2g} to {first.mse_percent:.2g} % with a port behind each"
        if not best.mse_percent > GAIN * first.mse_percent or times_worse(first, best) < GAIN:
            if first is not best:
                little = f"{reason}: a factor of {GAIN:g} is required, of what was held out too"
                self.record(first, little, is_taken=False, change="blow-offs with a port")
            return list(found)
        self.record(best, reason, is_taken=False, change="blow-offs without a port")
        return tried

    def best_layout(self, found: Sequence[Tried]) -> Tried:
        """The layout that fits and predicts best, with the gas as the maker or the logs tell it.

        Before parts of the rig: a gas volume that nobody measured hides them, and the layout.
        """
        best = min(found, key=lambda one: one.score)
        self.n_eff = effective_samples(best, self.evidence)
        near = [one for one in found if times_worse(best, one) < SEEN_APART]
        for one in found:
            reason = said_of_layout(best, one, is_alone=len(found) == 1, is_near=one in near)
            self.record(one, reason, is_taken=one is best, change="layout")
        near = [self.enriched(self.crossed(one), _DECLARED) for one in near]
        return min(near, key=lambda one: one.score)

    def lean(self, law: Tried, parts: Sequence[str] = tuple(SMALLER)) -> Tried:
        """Take out what is not needed, until nothing can be."""
        for change in parts:
            law = self.without(law, change, SMALLER[change])
        return with_bleeds_told(self, law)

    def without_unseen(self, law: Tried) -> Tried:
        """Take out parts of one stroke, or of the mounting, that no log tells.

        Last, for what is not seen beside a part that lacks may be seen beside that.
        """
        unseen, had = law.unseen | ({"k_s"} if _is_as_rigid(law) else set()), _bleeds_of(law)
        for change, (names, smaller) in ONE_STROKE.items():
            if set(names) & unseen:
                law = self.without(law, change, smaller)
        # A blow-off with next to no preload, beside which there was a bleed, is a laminar one.
        return law if _bleeds_of(law) == had else with_bleeds_told(self, law)

    def needed_by_some(self, law: Tried, names: Sequence[str]) -> Tried:
        """What single settings need, with the kinds of blow-offs that all of them need.

        Another kind than theirs is idle where a part that came after it has led all of them on.
        """
        more = self.grown(law, names)
        return law if more is law else with_strokes_told(self, more, valve_damper(more))

    def grown(self, law: Tried, names: Sequence[str]) -> Tried:
        """What single settings need that those compared do not tell together, the worst first."""
        asked = [*self.elsewhere, *(self.evidence if len(self.evidence) > 1 else ())]
        for _ in range(_MOST_GROWN):
            found = worst_missed(law, asked, self.solver)
            if found is None:
                return law
            one, there = found
            asked.remove(one)
            seen = _Search((one,), self.solver, self.on_law, self.jobs)
            seen.n_eff, seen.laws = effective_samples(there, (one,)), self.laws
            more = seen.enriched(there, names)
            if more is there:
                continue
            fitted = self.fitted(valve_damper(more), freed=freed_of(more), near=law)
            if fitted is not None:
                self.more += seen.more
                self.of_one += seen.more
                law = self.crossed(fitted.with_better(more.fits))
                reason = f"setting {one.setting} needs it"
                self.record(law, reason, is_taken=True, change="for another setting")
        return law

    def in_its_layout(self, law: Tried, layouts: Sequence[ValveDamper]) -> Tried:
        """The law in the layout that is taken, without parts that stood for that."""
        best = self.laid_out(law, layouts)
        if valve_damper(best).name == valve_damper(law).name:
            return best
        return self.asked_again(best, self.more)

    def laid_out(self, law: Tried, layouts: Sequence[ValveDamper]) -> Tried:
        """The law in the layout that is taken; which others do as well is kept."""
        own = valve_damper(law)
        models = [laid_out_as(own, one) for one in layouts if one.name != own.name]
        known = [self.known_worse(law, model) for model in models]
        left = [model for model, one in zip(models, known, strict=True) if one is None]
        fits = self.all_fitted(left, freed=freed_of(law), near=law)
        others = [one for one in (*known, *fits) if one is not None]
        best = layout_taken(law, others)
        alike = [one for one in (law, *others) if one is not best and are_alike(best, one)]
        for one in others:
            reason = said_of_layout(best, one, is_alone=False, is_near=one in alike)
            self.record(one, reason, is_taken=one is best, change="layout")
        self.alike, self.as_well = tuple(one.fits[0].model.name for one in alike), tuple(alike)
        return best

    def known_worse(self, law: Tried, model: ValveDamper) -> Tried | None:
        """What the same law in another layout gave already, where it is far from the one taken."""
        for known in self.laws:
            one = known.tried
            is_same = one.fits[0].model == model and freed_of(one) == had_by(model, freed_of(law))
            if is_same and times_worse(law, one) > _FAR_WORSE:
                return one
        return None

    def settled(self, simplest: Tried, law: Tried) -> Tried:
        """The paper's model where the other is not worth its quantities."""
        if law.n_quantities <= simplest.n_quantities:
            chosen = min(simplest, law, key=lambda one: one.score)
            reason = (
                "fits and predicts better than the law of valves"
                if chosen is simplest
                else "the law of valves fits and predicts better with no more quantities"
            )
            self.record(simplest, reason, is_taken=chosen is simplest, change="smallest law")
            return self.without_valves(chosen) if chosen is simplest else chosen
        verdict = judged(simplest, law, self.n_eff)
        reason = (
            f"valves on a mounting are needed: {verdict.reason}"
            if verdict.takes_larger
            else verdict.reason
        )
        is_taken = not verdict.takes_larger
        self.record(simplest, reason, is_taken=is_taken, change="smallest law", verdict=verdict)
        return self.without_valves(simplest) if is_taken else law

    def without_valves(self, law: Tried) -> Tried:
        """A law that is none of valves: layouts that they fit alike in say nothing of it."""
        self.alike = ()
        return law

    def declared(self, declared: Tried, law: Tried) -> Tried:
        """Of valves as declared, and as the logs tell them, what is worth its quantities."""
        small, large = sorted((law, declared), key=lambda one: one.n_quantities)
        verdict = judged(small, large, self.n_eff)
        better = large if verdict.takes_larger else small
        if small.n_quantities == large.n_quantities:
            better = min(law, declared, key=lambda one: one.score)
        is_taken = better is declared
        self.record(
            declared, verdict.reason, is_taken=is_taken, change="as declared", verdict=verdict
        )
        return better

    def open_to(self, law: Tried, share: float) -> None:
        """Ask for what yields where some settings alone do, and valves leave something."""
        is_unasked = math.isnan(self.held_share) and not math.isnan(share)
        if is_unasked and (law.leaves_something or unbelievable(law)):
            self.held_share, self.is_held_by_some = share, True

    def yielding(self, law: Tried) -> Tried:
        """What yields before it slides, where the logs do and valves tell them less well."""
        if math.isnan(self.held_share):
            return law
        found = [one for one in self.all_fitted([kind() for kind in YIELDING]) if one is not None]
        best = min(found, key=lambda one: one.score, default=law)
        taken = law
        for one in found:
            is_better, reason = held_against(law, one, self.held_share)
            is_taken = is_better and one is best
            taken = one if is_taken else taken
            self.record(one, reason, is_taken=is_taken, change="what yields")
        if taken is not law:
            self.without_valves(taken)
        elif found and is_open_to(law, best):
            self.also = best.title
        else:
            self.doubt = unbelievable(law)
        return taken

    def ended(self, chosen: Tried) -> LawSearch:
        """What was tried, and the law to take, which is polished on the whole logs."""
        model, freed = chosen.fits[0].model, freed_of(chosen)
        polished = self.fitted(model, freed=freed, near=chosen, is_whole=True) or chosen
        laws = tuple(
            dataclasses.replace(one, tried=polished, is_taken=True)
            if one.tried is chosen
            else dataclasses.replace(one, is_taken=False)
            for one in self.laws
        )
        return LawSearch(
            laws, polished, self.n_eff, self.alike, self.held_share, self.also,
            is_held_by_some=self.is_held_by_some, doubt=self.doubt,
        )  # fmt: skip


def _bleeds_of(law: Tried) -> tuple[str, str]:
    damper = valve_damper(law)
    return damper.rebound.bleed, damper.compression.bleed


def _is_as_rigid(law: Tried) -> bool:
    """Whether the mounting gives no more than the oil's bulk modulus is uncertain by."""
    one = valve_damper(law)
    if "k_s" not in law.fits[0].free:
        return False
    softest = min(one.annulus_area / one.chamber_1_length, one.piston_area / one.chamber_2_length)
    oil = of_oil(one)[0]
    return all(fit.values.k_s > _AS_RIGID * getattr(fit.values, oil) * softest for fit in law.fits)
