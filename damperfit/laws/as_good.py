"""Whether a law with fewer quantities, or with other ones, does as well as the one in hand."""

from __future__ import annotations

from typing import TYPE_CHECKING

from damperfit.laws.choosing import predicted_worse
from damperfit.laws.elsewhere import needed_at

if TYPE_CHECKING:
    from damperfit.laws.choosing import Tried
    from damperfit.laws.course import Course

__all__ = ["does_as_well", "leaves_more"]


def does_as_well(
    course: Course, law: Tried, one: Tried, *, factor: float = 1.0
) -> tuple[bool, str]:
    """Return whether a law with fewer quantities fits, leaves and predicts as much, and why.

    Parameters
    ----------
    course : Course
        What has been tried so far.
    law, one : Tried
        What there is, and the law with fewer.
    factor : float
        Times what the law leaves that is as much.
    """
    if more := leaves_more(law, one, factor=factor):
        return False, more
    if one.mse_percent > factor * law.mse_percent:
        return False, f"it fits no better, {one.mse_percent:.2g} after {law.mse_percent:.2g} %"
    if worse := predicted_worse(law, one) or needed_at(one, law, course.elsewhere, course.solver):
        return False, worse
    return True, f"MSE {law.mse_percent:.2g} to {one.mse_percent:.2g} % with fewer quantities"


def leaves_more(law: Tried, one: Tried, *, factor: float = 1.0) -> str:
    """Say that a law leaves something, and more than the one in hand; else nothing.

    Parameters
    ----------
    law, one : Tried
        What there is, and the other.
    factor : float
        Times what the law leaves that is no more.
    """
    if not one.leaves_something or one.left_over <= factor * law.left_over:
        return ""
    return (
        f"it leaves more than the law: {one.left_over:.2g} times what is enough after "
        f"{law.left_over:.2g}"
    )
