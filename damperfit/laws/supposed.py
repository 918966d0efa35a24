"""Whether friction that is larger at rest stands for what is supposed of oil and returns.

A law holds the slope of the returns and the oil's bulk modulus at what dampers have. Where a damper
has others, a friction that is larger at rest explains what is off at little speed, with two numbers
and a sliding friction that is too low.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from damperfit.laws.as_good import does_as_well
from damperfit.laws.choosing import AS_GOOD
from damperfit.laws.course import valve_damper
from damperfit.laws.elsewhere import freed_of
from damperfit.laws.friction_at_rest import AT_REST
from damperfit.laws.variants import RETURNS, of_oil, without_part, words_of

if TYPE_CHECKING:
    from damperfit.laws.choosing import Tried
    from damperfit.laws.course import Course

__all__ = ["with_supposed_told"]


def with_supposed_told(course: Course, law: Tried) -> Tried:
    """Return the law with what was supposed in place of friction at rest, if it is as good.

    Parameters
    ----------
    course : Course
        What has been tried so far.
    law : Tried
        A law of valves.
    """
    damper = valve_damper(law)
    less = without_part(damper, AT_REST)
    if less == damper:
        return law
    best = law
    for name in (RETURNS, *of_oil(less)):
        if name not in less.names or name in law.fits[0].free:
            continue
        one = course.fitted(less, freed=(*freed_of(law), name), near=law)
        if one is None:
            continue
        is_taken, reason = does_as_well(course, law, one, factor=AS_GOOD)
        if is_taken and best is not law and one.score >= best.score:
            is_taken, reason = False, "another quantity does so too, and fits better"
        change = f"with {less.quantity(name).label} for {words_of(damper, AT_REST)}"
        course.record(one, reason, is_taken=is_taken, change=change)
        best = one if is_taken else best
    # Beside it what was taken before may be idle: free gas stands for oil that is softer.
    return law if best is law else course.asked_again(best, course.more)
