"""Kinds of blow-offs stroke by stroke.

A kind is offered to both strokes at once, for most dampers have alike valves in both. Once one is
taken each stroke is asked for itself: whether it does without, and whether another kind explains
what is left.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from damperfit.laws.choosing import judged
from damperfit.laws.elsewhere import freed_of
from damperfit.laws.variants import STROKES, with_kind

if TYPE_CHECKING:
    from damperfit.damper.valve_dampers import ValveDamper
    from damperfit.laws.choosing import Tried
    from damperfit.laws.course import Course

__all__ = ["with_strokes_told"]

_PLAIN, _KINDS = "linear", ("rounded", "lifting", "port")


def with_strokes_told(course: Course, law: Tried, damper: ValveDamper) -> Tried:
    """Return a law with the kind of blow-off that each stroke needs, of one that has kinds.

    Parameters
    ----------
    course : Course
        What has been tried so far.
    law : Tried
        A law of valves.
    damper : ValveDamper
        The law itself.
    """
    if {damper.rebound.blow_off, damper.compression.blow_off}.isdisjoint(_KINDS):
        return law
    whole = law
    for stroke, word in STROKES.items():
        law, damper = _plain(course, law, damper, stroke, whole)
        best, model = law, damper
        for kind in _KINDS if law.leaves_something else ():
            other = with_kind(damper, stroke, "blow_off", kind)
            if other == damper:
                continue
            one = course.fitted(other, freed=freed_of(law), near=law)
            if one is None:
                continue
            verdict = judged(law, one, course.n_eff)
            is_taken = verdict.takes_larger and one.left_over < best.left_over
            change = f"with a {kind} blow-off in {word}"
            course.record(one, verdict.reason, is_taken=is_taken, change=change, verdict=verdict)
            best, model = (one, other) if is_taken else (best, model)
        whole = whole if best is law else best
        law, damper = best, model
    return law


def _plain(
    course: Course, law: Tried, damper: ValveDamper, stroke: str, whole: Tried
) -> tuple[Tried, ValveDamper]:
    """The law with a plain blow-off in a stroke that does not need more.

    However little is left: else friction that the damper has not takes the place of a port. It is
    held against the last law to which a kind was given: it was taken for what it does in both.
    """
    model = with_kind(damper, stroke, "blow_off", _PLAIN)
    one = None if model == damper else course.fitted(model, freed=freed_of(law), near=law)
    if one is None:
        return law, damper
    verdict = judged(one, whole, course.n_eff, left_percent=math.inf)
    is_taken = not verdict.takes_larger
    change = f"with a plain blow-off in {STROKES[stroke]}"
    course.record(one, verdict.reason, is_taken=is_taken, change=change, verdict=verdict)
    return (one, model) if is_taken else (law, damper)
