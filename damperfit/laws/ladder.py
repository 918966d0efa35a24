"""The ladder of laws: from the paper's model to real valves on a mounting, as far as the logs tell.

    1  the paper's model; where it leaves less than `ENOUGH_PERCENT`, nothing else is looked for
    2  bleed and blow-off in each stroke with everything that a mounting may have, in each layout
    3  of the best layout what is not needed is taken out again, the rig's parts and the valves'
       alike, by the rule of `choosing`: so no valve is invented for the rig, nor the reverse
    4  what is left over is offered to further quantities: soft oil, returns, seal drag, rounding

A layout is found by how well it fits and predicts at once; nothing but the declaration of the
damper's maker proves one.
"""

from __future__ import annotations

import dataclasses
import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TYPE_CHECKING, cast

from damperfit.damper.mounting import FIT, NONE, Mounting
from damperfit.damper.network import Valve
from damperfit.errors import SimulationError
from damperfit.laws.choosing import ENOUGH_PERCENT, Tried, effective_samples, judged
from damperfit.laws.law_fit import fit_law
from damperfit.simulation import SolverOptions

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from damperfit.damper.model import Model
    from damperfit.damper.valve_dampers import ValveDamper
    from damperfit.laws.law_fit import LawFit, SettingLogs

__all__ = ["Ladder", "Rung", "climb", "in_words"]

BLEED = Valve("orifice", "none")
BLOW_OFF = Valve("none", "linear")
BOTH = Valve("orifice", "linear")
# What is offered to what is left over, one after the other.
_DECLARED = ("gas_volume",)
_FURTHER = ("k_e", "return_slope", "drag", "")
# Two layouts whose MSE, times that of what was held out, differ by less are not told apart.
_TOLD_APART = 1.5


@dataclass(frozen=True, slots=True, eq=False)
class Rung:
    """One law that was tried.

    Attributes
    ----------
    tried : Tried
        The law with its fits.
    is_taken : bool
        Whether it was the law to go on from when it had been judged.
    reason : str
        Why, or why not, in one sentence.
    bic : float
        Against the law it was compared with, positive where it is for the larger; NaN for none.
    """

    tried: Tried
    is_taken: bool
    reason: str
    bic: float = math.nan


@dataclass(frozen=True, slots=True, eq=False)
class Ladder:
    """All laws tried, in their order, and the one to take.

    Attributes
    ----------
    rungs : tuple of Rung
        As they were tried.
    chosen : Tried
        The law that the logs tell.
    n_eff : float
        Effective samples of all settings compared.
    """

    rungs: tuple[Rung, ...]
    chosen: Tried
    n_eff: float


def climb(
    plain: Model,
    layouts: Sequence[ValveDamper],
    evidence: Sequence[SettingLogs],
    *,
    solver: SolverOptions = SolverOptions(),
    on_rung: Callable[[Rung], None] = lambda _: None,
    jobs: int = 1,
) -> Ladder:
    """Try laws from the paper's to the richest, and return which one the logs tell.

    Parameters
    ----------
    plain : Model
        The paper's damper.
    layouts : sequence of ValveDamper
        The damper in each layout that it may have.
    evidence : sequence of SettingLogs
        Settings to compare the laws by; two or three tell as much as all.
    solver : SolverOptions
        How exactly to integrate.
    on_rung : callable
        Called with every law that was judged.
    jobs : int
        Workers; the result does not depend on them.
    """
    course = _Course(evidence, solver, on_rung, jobs)
    simplest = course.fitted(plain, freed=("f_0",))
    if simplest is not None and simplest.mse_percent <= ENOUGH_PERCENT:
        course.told(simplest, "it leaves nothing that anyone would use", is_taken=True)
        return course.ended(simplest)
    richest = [_with(layout, BOTH, _everything(layout.mounting)) for layout in layouts]
    found = [one for one in course.all_fitted(richest) if one is not None]
    if not found:
        if simplest is None:
            raise SimulationError("no law can be simulated on these logs.")
        course.told(simplest, "no other law can be simulated on these logs", is_taken=True)
        return course.ended(simplest)
    best = min(found, key=lambda one: one.score)
    course.n_eff = effective_samples(best, evidence)
    for one in found:
        if one is not best:
            course.told(one, _against(best, one), is_taken=False)
    course.told(best, "the layout that fits and predicts best", is_taken=True)
    # Before parts of the rig are judged: a gas volume that nobody measured hides them.
    lean = course.lean(course.enriched(best, _DECLARED))
    rich = course.enriched(lean, _FURTHER)
    return course.ended(rich if simplest is None else course.settled(simplest, rich))


class _Course:
    """What has been tried so far."""

    def __init__(
        self,
        evidence: Sequence[SettingLogs],
        solver: SolverOptions,
        on_rung: Callable[[Rung], None],
        jobs: int,
    ) -> None:
        self.evidence, self.solver = evidence, solver
        self.on_rung, self.jobs = on_rung, jobs
        self.rungs: list[Rung] = []
        self.n_eff = math.nan
        self.freed: tuple[str, ...] = ()  # although it has a default

    def fitted(
        self, model: Model, *, freed: tuple[str, ...] = (), near: Tried | None = None
    ) -> Tried | None:
        """Fit a law to every setting; None where it cannot be simulated."""
        return self.all_fitted([model], freed=freed, near=near)[0]

    def all_fitted(
        self, models: Sequence[Model], *, freed: tuple[str, ...] = (), near: Tried | None = None
    ) -> list[Tried | None]:
        """Fit laws to every setting, several fits at a time."""

        def fit(job: tuple[Model, int]) -> LawFit | None:
            model, place = job
            start = None if near is None else near.fits[place].values
            try:
                return fit_law(
                    model, self.evidence[place], freed=freed, near=start, solver=self.solver
                )
            except SimulationError:
                return None

        places = range(len(self.evidence))
        with ThreadPoolExecutor(max_workers=self.jobs) as pool:
            fits = list(pool.map(fit, [(model, k) for model in models for k in places]))
        found: list[Tried | None] = []
        for row, model in enumerate(models):
            own = [one for one in fits[row * len(places) :][: len(places)] if one is not None]
            is_whole = len(own) == len(places)
            found.append(Tried(in_words(model, freed), tuple(own)) if is_whole else None)
        return found

    def told(self, tried: Tried, reason: str, *, is_taken: bool, bic: float = math.nan) -> None:
        rung = Rung(tried, is_taken, reason, bic)
        self.rungs.append(rung)
        self.on_rung(rung)

    def lean(self, law: Tried) -> Tried:
        """Take out what is not needed, until nothing can be."""
        for smaller in _SMALLER:
            model = smaller(_valve_damper(law))
            one = None if model is None else self.fitted(model, freed=self.freed, near=law)
            if one is None:
                continue
            verdict = judged(one, law, self.n_eff)
            reason = (
                f"what it lacks is needed: {verdict.reason}"
                if verdict.takes_larger
                else verdict.reason
            )
            self.told(one, reason, is_taken=not verdict.takes_larger, bic=verdict.bic)
            if not verdict.takes_larger:
                law = one
        return law

    def enriched(self, law: Tried, names: Sequence[str]) -> Tried:
        """Offer what is left over to further quantities; "" is a blow-off that lifts gradually."""
        for name in names:
            model = _valve_damper(law)
            if law.mse_percent <= ENOUGH_PERCENT:
                return law
            if not name:
                model = _rounded(model)
                if model == _valve_damper(law):  # there is no blow-off
                    continue
            elif name not in model.names or name in law.fits[0].free:
                continue
            wanted = (*self.freed, name) if name else self.freed
            one = self.fitted(model, freed=wanted, near=law)
            if one is None:
                continue
            verdict = judged(law, one, self.n_eff)
            self.told(one, verdict.reason, is_taken=verdict.takes_larger, bic=verdict.bic)
            if verdict.takes_larger:
                law, self.freed = one, wanted
        return law

    def settled(self, simplest: Tried, law: Tried) -> Tried:
        """The paper's model where the other is not worth its quantities."""
        if law.n_quantities <= simplest.n_quantities:
            chosen = min(simplest, law, key=lambda one: one.score)
            reason = (
                "fits and predicts better than the law of valves"
                if chosen is simplest
                else "the law of valves fits and predicts better with no more quantities"
            )
            self.told(simplest, reason, is_taken=chosen is simplest)
            return chosen
        verdict = judged(simplest, law, self.n_eff)
        reason = (
            f"valves on a mounting are needed: {verdict.reason}"
            if verdict.takes_larger
            else verdict.reason
        )
        self.told(simplest, reason, is_taken=not verdict.takes_larger, bic=verdict.bic)
        return law if verdict.takes_larger else simplest

    def ended(self, chosen: Tried) -> Ladder:
        rungs = tuple(dataclasses.replace(one, is_taken=one.tried is chosen) for one in self.rungs)
        return Ladder(rungs, chosen, self.n_eff)


def _against(best: Tried, other: Tried) -> str:
    """How far the other layout is behind."""
    factor = math.exp(other.score - best.score)
    if factor < _TOLD_APART:
        return "these logs hardly tell it from the one that is taken; declare the layout"
    held = math.isnan(best.held_out_percent)
    what = "fits" if held else "fits and predicts"
    return f"{best.fits[0].model.name.replace('_', ' ')} {what} better"


def _everything(declared: Mounting) -> Mounting:
    """All that a mounting may have is fitted; what was measured stays."""
    wanted = {one.name: getattr(declared, one.name) for one in dataclasses.fields(declared)}
    return Mounting(**{k: FIT if isinstance(v, str) else v for k, v in wanted.items()})


def _with(damper: ValveDamper, valve: Valve, mounting: Mounting) -> ValveDamper:
    return dataclasses.replace(damper, rebound=valve, compression=valve, mounting=mounting)


def _valve_damper(law: Tried) -> ValveDamper:
    return cast("ValveDamper", law.fits[0].model)


def _rounded(damper: ValveDamper) -> ValveDamper:
    kinds = {"linear": "rounded"}
    valves = {
        stroke: Valve(valve.bleed, kinds.get(valve.blow_off, valve.blow_off))
        for stroke, valve in (("rebound", damper.rebound), ("compression", damper.compression))
    }
    return dataclasses.replace(damper, rebound=valves["rebound"], compression=valves["compression"])


def _without(part: str) -> Callable[[ValveDamper], ValveDamper | None]:
    def smaller(damper: ValveDamper) -> ValveDamper | None:
        if getattr(damper.mounting, part) != FIT:
            return None
        return dataclasses.replace(
            damper, mounting=dataclasses.replace(damper.mounting, **{part: NONE})
        )

    return smaller


def _only(valve: Valve) -> Callable[[ValveDamper], ValveDamper | None]:
    def smaller(damper: ValveDamper) -> ValveDamper | None:
        if (damper.rebound, damper.compression) != (BOTH, BOTH):
            return None
        return dataclasses.replace(damper, rebound=valve, compression=valve)

    return smaller


# The valves first, while everything that a rig may have stands beside them.
_SMALLER: tuple[Callable[[ValveDamper], ValveDamper | None], ...] = (
    _only(BLEED),
    _only(BLOW_OFF),
    _without("lag"),
    _without("play"),
)


def in_words(damper: Model, freed: Sequence[str] = ()) -> str:
    """Return a law in a few words.

    Examples
    --------
    >>> from damperfit.damper.valve_dampers import TwinTube
    >>> in_words(TwinTube(), ["k_e"])
    'twin tube: bleed and blow-off; elastic mounting; also bulk modulus of oil and chamber'
    """
    if damper.name == "purdy":
        return "the paper's model"
    law = cast("ValveDamper", damper)
    words = [f"{law.name.replace('_', ' ')}: {_of_valve(law.rebound)}", _of_rig(law.mounting)]
    if freed:
        words.append("also " + ", ".join(law.quantity(name).label for name in freed))
    return "; ".join(words)


def _of_valve(valve: Valve) -> str:
    blow_off = {"none": "", "linear": "blow-off"}.get(valve.blow_off, f"{valve.blow_off} blow-off")
    return " and ".join(word for word in ("bleed" * (valve.bleed != "none"), blow_off) if word)


def _of_rig(mounting: Mounting) -> str:
    parts = (
        ("elastic mounting", mounting.series_stiffness),
        ("play", mounting.play),
        ("lag", mounting.lag),
    )
    return ", ".join(word for word, kind in parts if kind != NONE) or "rigid mounting"
