"""Friction of seals in forms that nobody has excluded: how much it counts that they are not known.

Pressed: a lip that is pressed on the rod rubs with a_s P_1. In rebound that looks like a larger
piston, in bump like a smaller one: valves, of which only opening times area is seen, take it up
with no misfit left. So does Coulomb's friction what the gas adds at rest.

Turning: within which speed seals turn, and in what form, is seldom known: at once, in a straight
line up to a speed, or like the hyperbolic tangent of tests on seals. Slow passages tell one from
the other; elsewhere the difference looks like a drag of the seals, of the opposite sign to the
friction's.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from damperfit.damper.mounting import NONE, Friction
from damperfit.damper.temperature_law import WithTemperature

if TYPE_CHECKING:
    from damperfit.damper.model import Model, Values

# m2, one standard error: a lip of 0.5 mm on a rod of 12 mm is 19 mm2, of which oil leaves a tenth
# or two to friction.
_AREA = 3e-6
# m/s, for a friction that is taken to turn at once: seals turn within 0.5 to 5 mm/s.
_WITHIN = 1.5e-3
# A mean of straight lines up to speeds spread like this is v/v_t to tanh(v/v_0), v_t = 1.386 v_0:
# two lines at mean and spread of the density -a d/da sech^2(a/v_0)/v_0 of their ends.
_SPREAD = 0.53


def with_pressed_seal(damper: Model, values: Values) -> tuple[Model, Values] | None:
    """Return the damper with a seal that is pressed, by a `seal_area` of one standard error.

    None where the law has such a seal, or no valves.
    """
    friction = _friction_of(damper)
    if friction is None or friction.seal_area != NONE:
        return None
    return _with(damper, values, seal_area=_AREA)


def other_turns(damper: Model, values: Values) -> tuple[tuple[float, Model, Values], ...]:
    """Return the damper with a friction that turns in another form, as (weight, damper, values).

    The force of that form is the sum of these, each times its weight. Empty where there is no
    friction, or it builds up over a distance.
    """
    friction = _friction_of(damper)
    if friction is None or not values.f_f or friction.presliding != NONE:
        return ()
    if friction.turning_speed != NONE:
        ends = (values.turning_speed * (1.0 + away) for away in (-_SPREAD, _SPREAD))
        return tuple((0.5, damper, values.replace(turning_speed=end)) for end in ends)
    return ((1.0, *_with(damper, values, turning_speed=_WITHIN)),)


def _friction_of(damper: Model) -> Friction | None:
    """That of a damper of valves; their module is not loaded to learn that it is none."""
    friction = getattr(damper.plain, "friction", None)
    return friction if isinstance(friction, Friction) else None


def _with(damper: Model, values: Values, **part: float) -> tuple[Model, Values]:
    """The damper with a part of friction that is known."""
    own: Any = damper.plain
    changed: Model = replace(own, friction=replace(own.friction, **part))
    if isinstance(damper, WithTemperature):
        changed = replace(damper, damper=changed)
    return changed, changed.values({**dict(values), **part})
