"""Whether friction that is larger at rest stands for what is supposed of oil and returns.

A law holds the slope of the returns and the oil's bulk modulus at what dampers have. Where a damper
has others, a friction that is larger at rest explains what is off at little speed, with two numbers
and a sliding friction that is too low.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from damperfit.damper.quantity import STIFFNESS
from damperfit.laws.choosing import AS_GOOD, NO_WORSE
from damperfit.laws.course import valve_damper
from damperfit.laws.elsewhere import freed_of, needed_at
from damperfit.laws.variants import without_part, words_of

if TYPE_CHECKING:
    from damperfit.laws.choosing import Tried
    from damperfit.laws.course import Course

__all__ = ["with_supposed_told"]

_AT_REST, _RETURNS = "breakaway", "return_slope"


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
    less = without_part(damper, _AT_REST)
    if less == damper:
        return law
    oil = [one.name for one in less.quantities if one.role == STIFFNESS]
    best = law
    for name in (_RETURNS, *oil):
        if name not in less.names or name in law.fits[0].free:
            continue
        one = course.fitted(less, freed=(*freed_of(law), name), near=law)
        if one is None:
            continue
        is_taken, reason = _is_as_good(course, law, one)
        if is_taken and best is not law and one.score >= best.score:
            is_taken, reason = False, "another quantity does so too, and fits better"
        change = f"with {less.quantity(name).label} for {words_of(damper, _AT_REST)}"
        course.record(one, reason, is_taken=is_taken, change=change)
        best = one if is_taken else best
    # Beside it what was taken before may be idle: free gas stands for oil that is softer.
    return law if best is law else course.asked_again(best, course.more)


def _is_as_good(course: Course, law: Tried, one: Tried) -> tuple[bool, str]:
    """Whether a law with fewer numbers fits and leaves as much as another, and why."""
    if one.mse_percent > AS_GOOD * law.mse_percent:
        return False, f"it fits no better, {one.mse_percent:.2g} after {law.mse_percent:.2g} %"
    if one.leaves_something and one.left_over > AS_GOOD * law.left_over:
        return False, (
            f"it leaves more than the law: {one.left_over:.2g} times what is enough after "
            f"{law.left_over:.2g}"
        )
    if one.held_out_percent > NO_WORSE * law.held_out_percent:
        return False, (
            f"what was held out is predicted worse, {one.held_out_percent:.2g} % after "
            f"{law.held_out_percent:.2g} %"
        )
    if why := needed_at(one, law, course.elsewhere, course.solver):
        return False, why
    return True, f"MSE {law.mse_percent:.2g} to {one.mse_percent:.2g} % with fewer quantities"
