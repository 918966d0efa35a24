"""Whether friction that turns within a speed does without a part that has taken its place.

A film of oil carries a part of the friction below a few millimetres a second. Beside friction that
turns at once, what passes oil at next to no pressure looks the same: bleeds beside blow-offs, a
blow-off with hardly a preload or with a port, a drag. The search meets these first and leaves too
little for anything else to be asked for, or finds that turning gains little beside them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from damperfit.damper.mounting import NONE
from damperfit.laws.as_good import does_as_well, leaves_more
from damperfit.laws.bleeds import fits_better
from damperfit.laws.choosing import judged
from damperfit.laws.course import hopeless_beside, valve_damper
from damperfit.laws.elsewhere import freed_of
from damperfit.laws.variants import (
    ONE_STROKE,
    SMALLER,
    STROKES,
    VALVES,
    with_part,
    without_part,
    words_of,
)

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from damperfit.damper.valve_dampers import ValveDamper
    from damperfit.laws.choosing import Tried
    from damperfit.laws.course import Course

__all__ = ["with_turning_told"]

_TURNING = "turning_speed"
# What stands for it beside the valves.
_FRICTION = ("presliding", "breakaway")
_FREED = "drag"


def with_turning_told(course: Course, law: Tried, alike: Sequence[Tried]) -> Tried:
    """Return the law with friction that turns within a speed in place of a part, if better so.

    With fewer quantities it must fit and predict no worse, with as many it must fit better; and
    where it leaves something, no force at a speed nor anything else may be off by more than before.

    Parameters
    ----------
    course : Course
        What has been tried so far.
    law : Tried
        A law of valves.
    alike : sequence of Tried
        The same parts in layouts in which these do as well: which one it is may show without them.
    """
    best = law
    for beside in (law, *alike):
        for change, model, freed in _in_place_of_parts(valve_damper(beside), freed_of(beside)):
            one = course.fitted(
                model, freed=freed, near=beside, hopeless_percent=hopeless_beside(law)
            )
            if one is None:
                continue
            is_taken, reason = _told(course, law, one)
            if is_taken and best is not law and _of_two(course, best, one) is best:
                is_taken, reason = False, "another part does so too, and is worth more"
            said = f"with {words_of(model, _TURNING)} for {change}"
            course.record(one, reason, is_taken=is_taken, change=said)
            best = one if is_taken else best
    return best if best is law else _without_it(course, best)


def _without_it(course: Course, law: Tried) -> Tried:
    """The law without it, where the logs do not tell it either.

    What it took the place of may have been there for a wrong valley, out of which it has led.
    """
    damper = valve_damper(law)
    one = course.fitted(without_part(damper, _TURNING), freed=freed_of(law), near=law)
    if one is None:
        return law
    verdict = judged(one, law, course.n_eff)
    change = words_of(damper, _TURNING)
    if verdict.takes_larger or verdict.bic <= 0.0:
        return course.smaller_of(one, law, change, verdict, course.elsewhere)
    reason = f"the logs determine it: MSE {one.mse_percent:.2g} to {law.mse_percent:.2g} %"
    course.record(one, reason, is_taken=False, change=f"without {change}", verdict=verdict)
    return law


def _of_two(course: Course, best: Tried, one: Tried) -> Tried:
    """Of two laws that are better than the one in hand, the one that is worth its quantities."""
    if best.n_quantities == one.n_quantities:
        return min(best, one, key=lambda law: law.score)
    small, large = sorted((best, one), key=lambda law: law.n_quantities)
    return large if judged(small, large, course.n_eff).takes_larger else small


def _told(course: Course, law: Tried, one: Tried) -> tuple[bool, str]:
    """Whether a law with as many quantities or fewer is better, and why."""
    if one.n_quantities < law.n_quantities:
        return does_as_well(course, law, one)
    if more := leaves_more(law, one):
        return False, more
    return fits_better(law, one, course.n_eff)


def _in_place_of_parts(
    damper: ValveDamper, freed: tuple[str, ...]
) -> Iterator[tuple[str, ValveDamper, tuple[str, ...]]]:
    """Laws with friction that turns in place of a part, and what they free."""

    def turning(model: ValveDamper) -> ValveDamper:
        return with_part(model, _TURNING)

    if turning(without_part(damper, "presliding")) == without_part(damper, "presliding"):
        return
    for change, less in _with_less_of_valves(damper):
        yield change, turning(without_part(less, "presliding")), freed
    for part in _FRICTION:
        less = without_part(damper, part)
        if less != damper:
            yield words_of(damper, part), turning(without_part(less, "presliding")), freed
    if _FREED in freed:
        left = tuple(name for name in freed if name != _FREED)
        yield words_of(damper, _FREED), turning(without_part(damper, "presliding")), left


def _with_less_of_valves(damper: ValveDamper) -> Iterator[tuple[str, ValveDamper]]:
    """Laws without a part that both strokes have beside another, or that one of them has."""
    for change in VALVES:
        less = SMALLER[change](damper)
        if less is not None:
            yield change, less
    known = {stroke: getattr(damper, stroke) for stroke in STROKES}
    if not any(NONE in {one.bleed, one.blow_off} for one in known.values()):
        return
    for change, (_, smaller) in ONE_STROKE.items():
        less = smaller(damper)
        if less is not None and less.mounting == damper.mounting:
            yield change, less
