"""What one model of all settings needs that none of them tells by itself.

A law is chosen setting by setting. With one value for all settings of what is the damper's, a part
shows that hardly moves the MSE of one: what little it explains is the same in all of them. So the
law is fitted once as one model, and where that leaves something it is offered what a law may have:

    1  the law as one model, closed bleeds from both of their ways; in the other layouts too, for
       one model tells them better
    2  with everything: a bleed and a blow-off in each stroke, of each blow-off the kind that
       explains most, bleeds with a laminar part, play, lag, moving mass, friction beyond
       Coulomb's, returns, seals' drag, gas in the oil
    3  without what is not worth its numbers, the loosest first, by the rule of `choosing`, last
       what it came with; what stayed is asked again without what went after it, a blow-off beside
       another kind of bleed; what stays need not gain a factor of 1.5 by itself
    4  with friction that turns in another way, if that explains what is left beside these; with
       another kind of blow-off, or what is supposed of oil and returns, for what stood for it
    5  all of it must, beyond what the law itself leaves from where these have led, and be worth its
       numbers, or leave nothing with no more: else nothing changes
    6  at last, and where the law leaves nothing, without each part that explains nothing

Some 50 descents of ten evaluations and 60 to their end, at most twice as many, on settled cycles,
whatever the number of settings; five and four more for each other layout. Where the law leaves
nothing one for each of its parts, and for each bleed that another kind or none may stand for.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

from damperfit.errors import SimulationError
from damperfit.identification.blas_threads import one_blas_thread
from damperfit.laws.choosing import (
    GAIN,
    PREDICTED_PERCENT,
    Tried,
    are_alike,
    effective_samples,
    predicted_worse,
)
from damperfit.laws.common_parts import (
    bleeds_beside,
    blow_off_kinds,
    changed,
    in_place,
    lacking_parts,
    laminar_alone,
    other_parts,
    turning_kinds,
    without_kinds,
)
from damperfit.laws.judged_laws import JudgedLaw, Together
from damperfit.laws.law_of_all import LawOfAll, led_back
from damperfit.laws.layout_choice import is_told_as_one, said_of_layout
from damperfit.laws.thinning import SOMETHING, Thinning
from damperfit.laws.variants import has_kinds_of_valves, laid_out_as

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from damperfit.damper.model import Model
    from damperfit.damper.valve_dampers import ValveDamper
    from damperfit.identification.sharing import Follows
    from damperfit.laws.law_fit import LawFit, SettingLogs
    from damperfit.simulation import SolverOptions

__all__ = ["told_together"]


@one_blas_thread()
def told_together(  # noqa: PLR0913 - what a run knows of its settings
    fits: Sequence[LawFit],
    evidence: Sequence[SettingLogs],
    follows: Callable[[Model, Sequence[str]], Follows],
    *,
    layouts: Sequence[ValveDamper] = (),
    solver: SolverOptions,
    jobs: int,
    on_law: Callable[[JudgedLaw], None] = lambda _: None,
) -> Together:
    """Return the law that settings tell as one model.

    Parameters
    ----------
    fits : sequence of LawFit
        The law that was chosen, of valves, at each setting by itself.
    evidence : sequence of SettingLogs
        Their logs, in the same order.
    follows : callable
        From a law and what is free to the adjusters that each quantity follows.
    layouts : sequence of ValveDamper
        Others that the damper may have.
    solver : SolverOptions
        How exactly to integrate.
    jobs : int
        Threads.
    on_law : callable
        Called with every law that was judged, but for those that need a part that they had.

    Raises
    ------
    SimulationError
        The law cannot be simulated at all settings at once.
    """
    course = _Course(evidence, follows, solver, jobs, on_law)
    law = course.laid_out(course.first(fits), layouts)
    chosen = course.judged[-1].tried
    if has_kinds_of_valves(law.damper):
        chosen = course.bare(*course.enriched(law, chosen))
    last = max(place for place, one in enumerate(course.judged) if one.tried is chosen)
    laws = tuple(replace(one, is_taken=k == last) for k, one in enumerate(course.judged))
    return Together(laws, chosen, course.n_eff, course.alike)


class _Course(Thinning):
    """What has been tried so far."""

    def laid_out(self, law: LawOfAll, layouts: Sequence[ValveDamper]) -> LawOfAll:
        """The law in the layout that one model tells."""
        best, tried = law, self.tried(law)
        self.n_eff = effective_samples(tried, list(self.evidence.values()))
        seen = [tried]
        for layout in layouts if tried.leaves_something else ():
            try:
                other = self.first(self.apart(laid_out_as(law.damper, layout), law))
                one = self.tried(other)
            except SimulationError:
                continue
            seen.append(one)
            is_taken = is_told_as_one(tried, one)
            better, worse = (one, tried) if is_taken else (tried, one)
            reason = said_of_layout(better, worse, is_alone=False, is_near=are_alike(better, worse))
            self.record(worse, reason, is_taken=False, change="layout")
            best, tried = (other, one) if is_taken else (best, tried)
        self.record(
            tried, "the law as one model of all settings", is_taken=True, change="as it was chosen"
        )
        names = [(one, one.fits[0].model.name) for one in seen if one is not tried]
        self.alike = tuple(name for one, name in names if are_alike(tried, one))
        return best

    def enriched(self, law: LawOfAll, tried: Tried) -> tuple[LawOfAll, Tried]:
        """The law with what one model needs."""
        if not tried.leaves_something:
            return law, tried
        core, law = _in_parts(law)
        try:
            whole = self.with_whole_valves(core, law)
            rich = self.with_all(core, whole)
        except SimulationError:
            return law, tried
        best = self.tried(rich)
        gain = tried.mse_percent / max(best.mse_percent, 1e-300)
        reason = "what it does not need is taken out again"
        self.record(best, reason, is_taken=False, change="with everything", gain=gain)
        law, tried = self.led_back(law, tried, rich)
        if not tried.leaves_something:
            return law, tried
        rich, best = self.thinned(core, whole, rich, best)
        rich, best = self.turned(core, whole, rich, best)
        rich, best = self.swapped(core, rich, best)
        law, tried = self.led_back(law, tried, rich)
        if not tried.leaves_something:
            return law, tried
        rich, best = self.cheaper(core, law, tried, rich, best)
        change = changed(law.parts, rich.parts)
        if not change:
            return law, tried
        verdict = self.held_against(law, tried, rich, best, least_gain=GAIN)
        is_smaller = rich.n_unknowns < law.n_unknowns and best.left_over <= GAIN * tried.left_over
        if is_smaller and best.mse_percent < SOMETHING * tried.mse_percent:
            verdict = replace(verdict, takes_larger=True, reason="as good with fewer numbers")
        self.record(
            best, verdict.reason, is_taken=verdict.takes_larger, change=change,
            gain=verdict.gain, bic=verdict.bic,
        )  # fmt: skip
        return (rich, best) if verdict.takes_larger else (law, tried)

    def bare(self, law: LawOfAll, tried: Tried) -> Tried:
        """The law without what explains nothing as one model, whatever a single setting made of it.

        In a wrong valley of one setting a part stands for what all of them have moved since.
        """
        core, law = _in_parts(law)
        for part in law.by_looseness(core):
            found = self.without(core, law, law, part)
            law, tried = self.bare_of(found, law, tried, f"without {part.words}")
        for part in (*laminar_alone(law.damper), *bleeds_beside(law.damper)):
            found = self.with_parts(core, law, law, in_place(core, (), law.parts, part))
            word = "without" if part.is_less else "with"
            law, tried = self.bare_of(found, law, tried, f"{word} {part.words}")
        return tried

    def bare_of(
        self, found: tuple[LawOfAll, Tried] | None, law: LawOfAll, tried: Tried, change: str
    ) -> tuple[LawOfAll, Tried]:
        """A smaller law where the larger explains no more than its numbers do anywhere."""
        if found is None:
            return law, tried
        less = found[1]
        verdict = self.held_against(*found, law, tried, least_gain=SOMETHING, is_less=True)
        is_told = verdict.takes_larger or verdict.bic > 0.0
        is_worse = less.leaves_something and not tried.leaves_something
        if is_told or is_worse or predicted_worse(tried, less, least=PREDICTED_PERCENT):
            return law, tried
        said = {"gain": verdict.gain, "bic": verdict.bic}
        self.record(less, verdict.reason, is_taken=True, change=change, **said)
        return found

    def led_back(self, law: LawOfAll, tried: Tried, rich: LawOfAll) -> tuple[LawOfAll, Tried]:
        """The law itself from where a larger one has led, if that alone leaves less.

        What a larger law explains it does beyond this: else it is taken for its better start.
        """
        try:
            again = led_back(law, rich)
            if again.minimum.cost * SOMETHING > law.minimum.cost:
                return law, tried
            one = self.tried(again)
        except SimulationError:
            return law, tried
        gain = tried.mse_percent / max(one.mse_percent, 1e-300)
        if gain < SOMETHING or one.left_over > tried.left_over:
            return law, tried
        reason = f"MSE {tried.mse_percent:.2g} to {one.mse_percent:.2g} % from a better start"
        self.record(
            one, reason, is_taken=True, change="from where a larger law ended", gain=gain
        )  # fmt: skip
        return again, one

    def with_all(self, core: ValveDamper, law: LawOfAll) -> LawOfAll:
        """The law with all that it may have; of what excludes each other what explains most."""
        offered = lacking_parts(core)
        for kinds in (blow_off_kinds("rebound"), blow_off_kinds("compression"), turning_kinds()):
            beside = [one for one in law.parts if one not in kinds]
            offered += self.best_part(core, law, beside, kinds)
        offered += other_parts(law.damper, law.own_freed)
        offered += [one for one in law.parts if one not in offered and one.freed]
        return self.with_more(core, law, offered)

    def cheaper(
        self, core: ValveDamper, law: LawOfAll, tried: Tried, rich: LawOfAll, best: Tried
    ) -> tuple[LawOfAll, Tried]:
        """Without one part after the other, while all together cost more than they are worth.

        Each of two parts may be needed beside the other, and one of them do for both.
        """
        while added := [one for one in rich.parts if one not in law.parts and not one.is_less]:
            verdict = self.held_against(law, tried, rich, best, least_gain=GAIN)
            if verdict.takes_larger or verdict.bic > 0.0:
                break
            part = min(added, key=lambda one: self.worth.get(one.words, math.inf))
            found = self.without(core, law, rich, part)
            if found is None:
                break
            rich, best = found
        return rich, best


def _in_parts(law: LawOfAll) -> tuple[ValveDamper, LawOfAll]:
    """A law's damper without its parts, and the law with them."""
    core, own = without_kinds(law.damper, law.freed)
    return core, replace(law, parts=own)
