"""Friction that the pressure on the rod's seal adds, where nobody has measured it.

A lip that is pressed on the rod rubs with a_s P_1. In rebound that looks like a larger piston, in
bump like a smaller one: valves, of which only opening times area is seen, take it up with no misfit
left. So does Coulomb's friction what the gas adds at rest.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from damperfit.damper.mounting import NONE
from damperfit.damper.valve_dampers import ValveDamper
from damperfit.damper.warmed import Warmed

if TYPE_CHECKING:
    from damperfit.damper.model import Model, Values

__all__ = ["with_pressed_seal"]

# m2, one standard error: a lip of 0.5 mm on a rod of 12 mm is 19 mm2, of which oil leaves a tenth
# or two to friction.
_AREA = 3e-6
_NAME = "seal_area"


def with_pressed_seal(damper: Model, values: Values) -> tuple[Model, Values] | None:
    """Return the damper with a seal that is pressed, which nobody has excluded.

    Parameters
    ----------
    damper : Model
        With a rod's seal, or without.
    values : Values
        Of it.

    Returns
    -------
    tuple of (Model, Values) or None
        With a `seal_area` of one standard error. None where the law has one, or no valves.
    """
    own = damper.damper if isinstance(damper, Warmed) else damper
    if not isinstance(own, ValveDamper) or own.friction.seal_area != NONE:
        return None
    pressed: Model = replace(own, friction=replace(own.friction, seal_area=_AREA))
    if isinstance(damper, Warmed):
        pressed = replace(damper, damper=pressed)
    numbers = dict(zip(values.names, values.numbers, strict=True))
    return pressed, pressed.values({**numbers, _NAME: _AREA})
