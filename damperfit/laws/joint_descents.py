"""Where the descents of one model of all settings begin, and where they lead."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from damperfit.errors import SimulationError
from damperfit.laws.choosing import GAIN
from damperfit.laws.common_parts import beside_each_other, lacking_parts, made_of
from damperfit.laws.elsewhere import had_by
from damperfit.laws.law_fit import fit_law
from damperfit.laws.law_of_all import (
    LawOfAll,
    as_one_model,
    free_of,
    on_whole_logs,
    values_of_less,
    values_of_more,
)
from damperfit.workers import executor

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from damperfit.damper.model import Model
    from damperfit.damper.valve_dampers import ValveDamper
    from damperfit.identification.sharing import Follows
    from damperfit.laws.choosing import Tried
    from damperfit.laws.common_parts import CommonPart
    from damperfit.laws.law_fit import LawFit, SettingLogs
    from damperfit.simulation import SolverOptions

__all__ = ["JointDescents"]


class JointDescents:
    """The logs of all settings, and laws that are fitted to them as one model.

    Parameters
    ----------
    evidence : sequence of SettingLogs
        The logs.
    follows : callable
        From a law and what is free to the adjusters that each quantity follows.
    solver : SolverOptions
        How exactly to integrate.
    jobs : int
        Threads.
    """

    def __init__(
        self,
        evidence: Sequence[SettingLogs],
        follows: Callable[[Model, Sequence[str]], Follows],
        solver: SolverOptions,
        jobs: int,
    ) -> None:
        self.evidence = {one.setting: one for one in evidence}
        self.follows, self.solver, self.jobs = follows, solver, jobs

    def first(self, fits: Sequence[LawFit]) -> LawOfAll:
        """A law as one model, from its fits at single settings."""
        return as_one_model(fits, self.evidence, self.follows, self.solver, self.jobs)

    def apart(self, damper: ValveDamper, law: LawOfAll) -> list[LawFit]:
        """Another layout at each setting by itself."""
        freed = had_by(damper, law.freed)

        def fit(one: SettingLogs) -> LawFit:
            return fit_law(damper, one, freed=freed, solver=self.solver, is_whole=False)

        with executor(self.jobs) as pool:
            return list(pool.map(fit, self.evidence.values()))

    def tried(self, law: LawOfAll) -> Tried:
        """The law at every setting, on the whole logs."""
        return on_whole_logs(law, self.evidence, self.solver, self.jobs)

    def begun(self, damper: ValveDamper, freed: tuple[str, ...], law: LawOfAll) -> LawOfAll:
        """A few steps from a law, with its new numbers where they start, or small."""
        free = free_of(damper, freed)
        one = law.one.of(damper, free, self.follows(damper, free))
        ends = []
        for at in values_of_more(law, one, freed, self.evidence):
            try:
                ends.append(one.look(one.with_common(at)))
            except SimulationError:
                continue
        if not ends:
            raise SimulationError(f"{damper.name} cannot be simulated with more parts.")
        return LawOfAll(damper, freed, one, min(ends, key=lambda end: end.cost))

    def with_more(self, core: ValveDamper, law: LawOfAll, parts: Sequence[CommonPart]) -> LawOfAll:
        """The law with some parts, from where it is."""
        kept = beside_each_other(core, law.own_freed, parts)
        looked = self.begun(*made_of(core, law.own_freed, kept), law)
        return replace(looked, minimum=looked.one.descend(looked.values), parts=kept)

    def best_part(
        self,
        core: ValveDamper,
        law: LawOfAll,
        beside: Sequence[CommonPart],
        rivals: Sequence[CommonPart],
    ) -> list[CommonPart]:
        """That of some parts with which a few steps lead farthest; none where none can be had."""
        found: list[tuple[float, int]] = []
        for place, one in enumerate(rivals):
            damper, freed = made_of(core, law.freed, [*beside, one])
            if damper == made_of(core, law.freed, beside)[0]:
                continue
            try:
                found.append((self.begun(damper, freed, law).minimum.cost, place))
            except SimulationError:
                continue
        return [rivals[min(found)[1]]] if found else []

    def with_whole_valves(self, core: ValveDamper, law: LawOfAll) -> LawOfAll:
        """The law with a bleed and a blow-off in each stroke, from starts of its own too.

        A law without them may have put a preload in the place of friction: nothing leads back.
        """
        lacking = lacking_parts(core)
        if not lacking:
            return law
        parts = (*lacking, *law.parts)
        begun = replace(self.begun(*made_of(core, law.freed, parts), law), parts=parts)
        try:
            other = replace(self.first(self.apart(begun.damper, law)), parts=parts)
        except SimulationError:
            return begun
        return other if begun.one.cost(other.values) < begun.minimum.cost else begun

    def without(
        self, core: ValveDamper, law: LawOfAll, rich: LawOfAll, part: CommonPart
    ) -> tuple[LawOfAll, Tried] | None:
        """The law without a part."""
        others = [one for one in rich.parts if one is not part]
        return self.with_parts(core, law, rich, others)

    def with_parts(
        self, core: ValveDamper, law: LawOfAll, rich: LawOfAll, parts: Sequence[CommonPart]
    ) -> tuple[LawOfAll, Tried] | None:
        """The law with fewer, from where it is and, where that seems to lack some, from afar."""
        left = beside_each_other(core, rich.own_freed, parts)
        damper, freed = made_of(core, rich.own_freed, left)
        if not {*damper.names} <= {*rich.damper.names}:  # the blow-off is back without its bleed
            return None
        if (damper, {*freed}) == (rich.damper, {*rich.freed}):  # it has no such part any more
            return None
        free = free_of(damper, freed)
        one = rich.one.of(damper, free, self.follows(damper, free))
        at = {s: values_of_less(damper, free, values) for s, values in rich.values.items()}
        try:
            end = one.descend(one.with_common(at))
            if end.cost > GAIN * rich.minimum.cost and law is not rich:
                other = one.descend(self.begun(damper, freed, law).values)
                end = min(end, other, key=lambda end: end.cost)
            small = LawOfAll(damper, freed, one, end, left)
            return small, self.tried(small)
        except SimulationError:
            return None
