"""Whether the mounting gives, or nothing but the oil.

Beside an elastic mounting the oil's bulk modulus is held, on a rigid one it is found: as many
quantities. Oil that is held too stiff or too soft makes an elasticity out of what a rigid rig has
not, with a lag that is off by as much, and from there a few steps lead nowhere: so both are fitted.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from damperfit.damper.quantity import STIFFNESS
from damperfit.laws.bleeds import fits_better
from damperfit.laws.course import valve_damper
from damperfit.laws.elsewhere import freed_of
from damperfit.laws.variants import ONE_STROKE

if TYPE_CHECKING:
    from damperfit.laws.choosing import Tried
    from damperfit.laws.course import Course

__all__ = ["with_what_gives_told"]


def with_what_gives_told(course: Course, law: Tried) -> Tried:
    """Return the law with a rigid mounting and the oil's own elasticity, where that fits better.

    Parameters
    ----------
    course : Course
        What has been tried so far.
    law : Tried
        A law of valves.
    """
    _, rigid = ONE_STROKE["elasticity of the mounting"]
    known = law.fits[0]
    model = rigid(valve_damper(law))
    if model is None or any(known.model.quantity(one).role == STIFFNESS for one in known.free):
        return law
    one = course.fitted(model, freed=freed_of(law), near=law)
    if one is None:
        return law
    is_taken, reason = fits_better(law, one, course.n_eff)
    change = "with the oil's elasticity for that of the mounting"
    course.record(one, reason, is_taken=is_taken, change=change)
    return one if is_taken else law
