"""The numbers of a valve in layouts that the logs cannot tell from the one that was taken.

A stroke's force is a pressure on an area, which is another one in another layout; what flows
through the valve is that area times the speed::

    f = A p_open + R rho A^2 v + (S rho)^2 A^3 v^2

so that the same force has p_open as 1/A, R as 1/A^2 and S as A^-1.5. What returns and compliances
add is left out: some per cent.
"""

from __future__ import annotations

from dataclasses import fields
from typing import TYPE_CHECKING

from damperfit.damper.valve_dampers import STROKES, Monotube, ThroughFlow, TwinTube, ValveDamper

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from damperfit.damper.model import Model

__all__ = ["LAYOUTS", "in_other_layouts", "times_in"]

LAYOUTS: dict[str, type[ValveDamper]] = {
    kind.name: kind for kind in (TwinTube, Monotube, ThroughFlow)
}
_CALLED = {
    "twin_tube": "twin tube", "monotube": "monotube", "through_flow": "through-flow damper",
}  # fmt: skip


def times_in(layout: str, model: ValveDamper, name: str) -> float:
    """Return a valve's number in another layout over that of the model, for the same force.

    Parameters
    ----------
    layout : str
        Name of a damper of valves.
    model : ValveDamper
        The damper in the layout that was taken.
    name : str
        Of a quantity; 1 for what is none of a valve.
    """
    quantity = model.quantity(name)
    if quantity.stroke not in STROKES:
        return 1.0
    known = {one.name: getattr(model, one.name) for one in fields(model) if one.init}
    other = LAYOUTS[layout](**known)
    place = STROKES.index(quantity.stroke)
    return float((model.pressed_areas[place] / other.pressed_areas[place]) ** quantity.area_power)


def in_other_layouts(
    layouts: Sequence[str], model: Model, name: str
) -> Iterator[tuple[str, float]]:
    """Yield layouts, in words, in which a valve's number is another one, and how many times that.

    Parameters
    ----------
    layouts : sequence of str
        Names of dampers of valves.
    model : Model
        In the layout that was taken.
    name : str
        Of a quantity.
    """
    if not isinstance(model, ValveDamper):
        return
    for layout in layouts:
        times = times_in(layout, model, name)
        if times != 1.0:
            yield _CALLED[layout], times
