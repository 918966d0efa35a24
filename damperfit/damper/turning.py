"""How friction turns, where nobody has measured it: another form of the same friction.

Within which speed seals turn, and in what form, is seldom known: at once, in a straight line up to
a speed, or like the hyperbolic tangent of tests on seals. Slow passages tell one from the other;
elsewhere the difference looks like a drag of the seals, of the opposite sign to the friction's.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from damperfit.damper.mounting import NONE
from damperfit.damper.valve_dampers import ValveDamper
from damperfit.damper.warmed import Warmed

if TYPE_CHECKING:
    from damperfit.damper.model import Model, Values

__all__ = ["other_turns"]

# m/s, for a friction that is taken to turn at once: seals turn within 0.5 to 5 mm/s.
_WITHIN = 1.5e-3
# A mean of straight lines up to speeds spread like this is v/v_t to tanh(v/v_0), v_t = 1.386 v_0:
# two lines at mean and spread of the density -a d/da sech^2(a/v_0)/v_0 of their ends.
_SPREAD = 0.53
_NAME = "turning_speed"


def other_turns(damper: Model, values: Values) -> tuple[tuple[float, Model, Values], ...]:
    """Return the damper with a friction that turns in another form, which nobody has excluded.

    Parameters
    ----------
    damper : Model
        With friction of seals, or without.
    values : Values
        Of it.

    Returns
    -------
    tuple of (float, Model, Values)
        The force of that form is the sum of these, each times its weight. Empty where there is no
        friction, or it builds up over a distance.
    """
    own = damper.damper if isinstance(damper, Warmed) else damper
    if not isinstance(own, ValveDamper) or not values.f_f or own.friction.presliding != NONE:
        return ()
    if _NAME in values.names:
        speed = values.turning_speed
        return tuple(
            (0.5, damper, values.replace({_NAME: speed * (1.0 + away)}))
            for away in (-_SPREAD, _SPREAD)
        )
    turning: Model = replace(own, friction=replace(own.friction, turning_speed=_WITHIN))
    if isinstance(damper, Warmed):
        turning = replace(damper, damper=turning)
    numbers = dict(zip(values.names, values.numbers, strict=True))
    return ((1.0, turning, turning.values({**numbers, _NAME: _WITHIN})),)
