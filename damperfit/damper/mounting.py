"""What stands between the rig and the damper: elasticity, play, moving mass, a late force channel.

Rod ends, frame and load cell give by 1/k_s in series with the damper (125 to 1900 N/mm are found on
rigs), joints have play (0.3 to 2 mm), and the force channel may be late (a first-order filter of 8
to 14 ms is found). Without them soft oil, friction and even a blow-off are invented to take their
place. At one frequency a lag and an elasticity look alike; several speeds part them. A load cell at
the end that moves also reads what it takes to move the mass between it and the damper: 8 N a
kilogram at 3 Hz and 22 mm, 21 N at 10 Hz and 5.4 mm. At one frequency that looks like a softer gas
spring.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from damperfit.damper.quantity import RIG, Quantity
from damperfit.errors import ConfigurationError

if TYPE_CHECKING:
    from collections.abc import Iterable

__all__ = ["FIT", "NONE", "Mounting", "check_part", "declared_quantities"]

NONE, FIT = "none", "fit"
_QUANTITIES = (
    Quantity(
        "k_s", "k_s", "series stiffness", "stiffness of rod ends, frame and load cell", "N/m",
        (1e3, 1e10), scope=RIG, power=3, shown_unit="N/mm", believable=(2e4, math.inf),
        belief="rigs have 125 to 1900 N/mm", ideal=0.0,  # the core's rigid one
        idle="above",
    ),
    Quantity(
        "play", "play", "play", "whole gap of the joints", "m", (1e-6, 1e-2), scope=RIG,
        power=-3, shown_unit="mm", believable=(0.0, 5e-3), belief="joints have 0.3 to 2 mm",
        ideal=0.0, idle="below",
    ),
    Quantity(
        "lag", "T", "lag of the force", "lag of the force channel, first order", "s",
        (1e-5, 5e-2), scope=RIG, power=-3, shown_unit="ms", believable=(0.0, 0.025),
        belief="force channels have 8 to 14 ms", ideal=0.0, idle="below",
    ),
    Quantity(
        "moving_mass", "m", "moving mass", "mass of what moves between load cell and damper", "kg",
        (1e-4, 1e3), scope=RIG, shown_unit="kg", believable=(0.0, 30.0),
        belief="rods, bodies and fixtures have 0.1 to 20 kg", ideal=0.0, idle="below",
    ),
)  # fmt: skip


def check_part(name: str, found: str | float, one: Quantity) -> None:
    """Refuse what is neither "none", "fit" nor a number that the part may have.

    Parameters
    ----------
    name : str
        Under which it is declared.
    found : str or float
        What is declared.
    one : Quantity
        Of the part, with its range.

    Raises
    ------
    ConfigurationError
        With what was found and expected.
    """
    if isinstance(found, bool) or not isinstance(found, float | int):
        if found not in (NONE, FIT):
            message = f"{name}: found {found!r}; expected a number, {NONE!r} or {FIT!r}"
            raise ConfigurationError(message)
        return
    low, high = one.plausible
    if not low <= float(found) <= high:
        raise ConfigurationError(
            f"found {float(found):g}; expected {low:g} to {high:g} {one.unit}, {NONE!r} or {FIT!r}",
            subject=name,
        )


def declared_quantities(
    parts: Iterable[str | float], known: Iterable[Quantity]
) -> tuple[Quantity, ...]:
    """Return the quantities of the parts that there are; a part that is known is held."""
    found = []
    for wanted, one in zip(parts, known, strict=True):
        if wanted == FIT:
            found.append(one)
        elif wanted != NONE:
            found.append(replace(one, default=float(wanted)))
    return tuple(found)


@dataclass(frozen=True, slots=True)
class Mounting:
    """Which of the mounting's parts there are; each is absent, found by the fit, or known.

    Attributes
    ----------
    series_stiffness : str or float
        k_s: "none" (rigid), "fit", or N/m.
    play : str or float
        Whole gap of the joints: "none", "fit", or m. Needs an elasticity.
    lag : str or float
        Of the force channel, first order: "none", "fit", or s.
    moving_mass : str or float
        Of what moves between load cell and damper, the moving part of the damper included: "none",
        "fit", or kg.
    """

    series_stiffness: str | float = FIT
    play: str | float = NONE
    lag: str | float = NONE
    moving_mass: str | float = NONE

    def __post_init__(self) -> None:
        """Refuse what no mounting is."""
        names = ("series_stiffness", "play", "lag", "moving_mass")
        for name, one in zip(names, _QUANTITIES, strict=True):
            check_part(name, getattr(self, name), one)
        if self.play != NONE and self.series_stiffness == NONE:
            raise ConfigurationError(
                "play needs a series stiffness that takes the force once the gap is closed: "
                f"set series_stiffness to {FIT!r} or to a value"
            )

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """What a fit may find of it; what was measured is held."""
        parts = (self.series_stiffness, self.play, self.lag, self.moving_mass)
        return declared_quantities(parts, _QUANTITIES)
