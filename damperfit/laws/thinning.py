"""What a law of all settings does without, and which part stands for another: steps of a search."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

from damperfit.errors import SimulationError
from damperfit.laws.as_good import leaves_more
from damperfit.laws.choosing import (
    AS_GOOD,
    GAIN,
    PREDICTED_PERCENT,
    OfOneModel,
    Tried,
    Verdict,
    judged,
    predicted_worse,
)
from damperfit.laws.common_parts import (
    idle_parts,
    in_place,
    laminar_alone,
    stand_ins,
    turning_kinds,
)
from damperfit.laws.joint_descents import JointDescents
from damperfit.laws.judged_laws import JudgedLaw
from damperfit.laws.law_of_all import lost_with

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from damperfit.damper.model import Model
    from damperfit.damper.valve_dampers import ValveDamper
    from damperfit.identification.sharing import Follows
    from damperfit.laws.common_parts import CommonPart
    from damperfit.laws.law_fit import SettingLogs
    from damperfit.laws.law_of_all import LawOfAll
    from damperfit.simulation import SolverOptions

__all__ = ["SOMETHING", "Thinning"]

# By what a part must lower the MSE of one model to stay in it, beside what its numbers cost.
SOMETHING = 1.1


class Thinning(JointDescents):
    """What has been tried so far, and the steps from the law with everything to what it needs."""

    def __init__(
        self,
        evidence: Sequence[SettingLogs],
        follows: Callable[[Model, Sequence[str]], Follows],
        solver: SolverOptions,
        jobs: int,
        on_law: Callable[[JudgedLaw], None],
    ) -> None:
        super().__init__(evidence, follows, solver, jobs)
        self.on_law = on_law
        self.judged: list[JudgedLaw] = []
        self.n_eff, self.worth = math.nan, dict[str, float]()
        self.alike: tuple[str, ...] = ()

    def record(
        self, tried: Tried, reason: str, *, is_taken: bool, change: str, **said: float
    ) -> None:
        """Keep a law that was judged, and say it to who waits for it."""
        self.judged.append(
            JudgedLaw(tried, is_taken, reason, change=f"one model: {change}", **said)
        )
        self.on_law(self.judged[-1])

    def thinned(
        self, core: ValveDamper, law: LawOfAll, rich: LawOfAll, best: Tried
    ) -> tuple[LawOfAll, Tried]:
        """Without what is not worth its numbers, the loosest part first."""
        # What single settings have told of is asked last: many others may stand for it together.
        parts = sorted(rich.by_looseness(core), key=lambda one: one in law.parts)
        rich, best, again = self.without_idle(core, law, rich, best, parts)
        rich, best, _ = self.without_idle(core, law, rich, best, again)
        rich, best = self.put_in(core, law, rich, best, "without", idle_parts(core, rich.damper))
        had = rich.damper
        rich, best = self.put_in(core, law, rich, best, "with", laminar_alone(had))
        if rich.damper == had:
            return rich, best
        return self.put_in(core, law, rich, best, "without", idle_parts(had, rich.damper))

    def put_in(
        self, core: ValveDamper, law: LawOfAll, rich: LawOfAll, best: Tried, word: str,
        parts: Iterable[CommonPart],
    ) -> tuple[LawOfAll, Tried]:  # fmt: skip
        """With parts in the place of others, where the law is not worse than it was."""
        for part in parts:
            found = self.with_parts(core, law, rich, in_place(core, (), rich.parts, part))
            rich, best = self.smaller_of(found, rich, best, word, part)
        return rich, best

    def without_idle(
        self, core: ValveDamper, law: LawOfAll, rich: LawOfAll, best: Tried,
        parts: Sequence[CommonPart],
    ) -> tuple[LawOfAll, Tried, list[CommonPart]]:  # fmt: skip
        """Without those of some parts that are not worth their numbers.

        With it those that stayed beside another that went after them: they may have been needed
        beside that alone.
        """
        stayed: list[CommonPart] = []
        beside: list[CommonPart] = []
        for part in parts:
            if part in rich.parts:  # a laminar part goes with its bleed
                found = self.without(core, law, rich, part)
                less, tried = self.smaller_of(found, rich, best, "without", part)
                if less is rich:
                    stayed.append(part)
                else:
                    beside = list(stayed)
                rich, best = less, tried
        return rich, best, beside

    def turned(
        self, core: ValveDamper, law: LawOfAll, rich: LawOfAll, best: Tried
    ) -> tuple[LawOfAll, Tried]:
        """With friction that turns in another way, where that explains what is left.

        Beside parts that stood for it, or valves that had too many, a few steps did not show it.
        """
        kinds = turning_kinds()
        others = [one for one in rich.parts if one not in kinds]
        rivals = [one for one in kinds if one not in rich.parts]
        found = self.best_part(core, rich, others, rivals) if best.leaves_something else []
        if not found:
            return rich, best
        turning = self.in_its_place(core, rich, [*others, *found])
        if turning is None:
            return rich, best
        more, one = turning
        verdict = self.held_against(rich, best, more, one, least_gain=GAIN)
        self.record(
            one, verdict.reason, is_taken=False, change=f"with {found[0].words}",
            gain=verdict.gain, bic=verdict.bic,
        )  # fmt: skip
        return self.thinned(core, law, more, one) if verdict.takes_larger else (rich, best)

    def swapped(self, core: ValveDamper, rich: LawOfAll, best: Tried) -> tuple[LawOfAll, Tried]:
        """With another part in the place of one that stood for it.

        A few steps beside all others may show the wrong one; without either too much is left.
        """
        for part, rivals, is_fewer in stand_ins(core, rich.own_freed, rich.parts):
            if not (is_fewer or best.leaves_something):
                continue
            others = [one for one in rich.parts if one is not part]
            better = [(rich, best)]
            for rival in rivals:
                found = self.in_its_place(core, rich, (*others, rival))
                if found is None:
                    continue
                change, gain = f"with {rival.words} for {part.words}", _times(best, found[1])
                is_better, reason = _is_better(best, found[1], is_fewer=is_fewer)
                self.record(found[1], reason, is_taken=False, change=change, gain=gain)
                better += [found] if is_better else []
            rich, best = min(better[1:] or better, key=lambda pair: pair[1].mse_percent)
        return rich, best

    def in_its_place(
        self, core: ValveDamper, rich: LawOfAll, parts: Sequence[CommonPart]
    ) -> tuple[LawOfAll, Tried] | None:
        """The law with some parts, where it can be simulated."""
        try:
            found = self.with_more(core, rich, parts)
            return found, self.tried(found)
        except SimulationError:
            return None

    def smaller_of(
        self, found: tuple[LawOfAll, Tried] | None, rich: LawOfAll, best: Tried, word: str,
        part: CommonPart,
    ) -> tuple[LawOfAll, Tried]:  # fmt: skip
        """A smaller law where the larger is not worth its numbers."""
        if found is None:
            return rich, best
        verdict = self.held_against(*found, rich, best, least_gain=SOMETHING, is_less=True)
        change, said = f"{word} {part.words}", {"gain": verdict.gain, "bic": verdict.bic}
        self.record(found[1], verdict.reason, is_taken=False, change=change, **said)
        self.worth[part.words] = verdict.bic
        return (rich, best) if verdict.takes_larger else found

    def held_against(
        self, small: LawOfAll, less: Tried, large: LawOfAll, more: Tried, *, least_gain: float,
        is_less: bool = False,
    ) -> Verdict:  # fmt: skip
        """Whether the larger of two laws is taken: it must not lose what the smaller one tells.

        Where the smaller one was made of it, a part is not absent for being at the far edge.
        """
        price = OfOneModel(large.n_unknowns - small.n_unknowns, least_gain, is_less=is_less)
        verdict = judged(less, more, self.n_eff, of_one_model=price)
        if price.n_more <= 0 and less.leaves_something and not more.leaves_something:
            verdict = replace(verdict, takes_larger=True, reason="no more numbers, nothing is left")
        lost = lost_with(less, more)
        if not verdict.takes_larger or not lost:
            return verdict
        return replace(
            verdict, takes_larger=False, reason=f"with it the logs no longer determine {lost}"
        )


def _times(best: Tried, one: Tried) -> float:
    return best.mse_percent / max(one.mse_percent, 1e-300)


def _is_better(best: Tried, one: Tried, *, is_fewer: bool) -> tuple[bool, str]:
    """Whether a law fits better, or with fewer numbers as well, and leaves no more; and why."""
    if worse := predicted_worse(best, one, least=PREDICTED_PERCENT):
        return False, worse
    if more := leaves_more(best, one, factor=AS_GOOD):
        return False, more
    if _times(best, one) <= (1.0 / AS_GOOD if is_fewer else SOMETHING):
        return False, f"it fits no better, {one.mse_percent:.3g} after {best.mse_percent:.3g} %"
    beside = "with fewer numbers" if is_fewer else "with as many numbers"
    return True, f"MSE {best.mse_percent:.3g} to {one.mse_percent:.3g} % {beside}"
