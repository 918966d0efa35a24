"""What a rig and the seals may have, each part absent, found by the fit, or known.

Mounting. Rod ends, frame and load cell give by 1/k_s in series with the damper (125 to 1900 N/mm
are found on rigs), joints have play (0.3 to 2 mm), and the force channel may be late (a first-order
filter of 8 to 14 ms is found). Without them soft oil, friction and even a blow-off are invented to
take their place. Rubber holds a force beside that spring, whichever way it was bent last, over 0.1
to 2 mm: a hysteresis that does not ask for the speed. At one frequency a lag and an elasticity look
alike; several speeds part them. A load cell at the end that moves also reads what it takes to move
the mass between it and the damper: 8 N a kilogram at 3 Hz and 22 mm, 21 N at 10 Hz and 5.4 mm. At
one frequency that looks like a softer gas spring.

Friction of seals and bearings beyond Coulomb's. While it slides it is
f_f + f_b exp(-(v/v_s)^2) + a_s P_1: Coulomb's, what it has more at rest (Stribeck), and what the
pressure on the rod's seal adds. It turns with the motion at once, within a speed (a film of oil
carries a part of it below), or over a distance (Dahl). The equations stand in
`damperfit.damper.network`. Loops seldom tell any of them from soft oil and bleeds: a friction that
changes with the clicks is none.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from damperfit.damper.quantity import DAMPER, RIG, Quantity
from damperfit.errors import ConfigurationError

__all__ = ["FIT", "NONE", "Friction", "Mounting"]

NONE, FIT = "none", "fit"
_OF_MOUNTING: dict[str, Quantity] = {
    "series_stiffness": Quantity(
        "k_s", "k_s", "series stiffness", "stiffness of rod ends, frame and load cell", "N/m",
        (1e3, 1e10), scope=RIG, power=3, shown_unit="N/mm", believable=(2e4, math.inf),
        belief="rigs have 125 to 1900 N/mm", ideal=0.0,  # the core's rigid one
        idle="above",
    ),
    "rubber": Quantity(
        "rubber", "f_m", "rubber of the mounting", "force that a mounting of rubber holds", "N",
        (1e-2, 1e5), scope=RIG, may_vanish=True, shown_unit="N", believable=(0.0, 2e3),
        belief="rubber of mountings holds up to a tenth of the force", ideal=0.0, idle="below",
    ),
    "rubber_bend": Quantity(
        "rubber_bend", "s_m", "bend of the rubber", "deflection over which it reverses", "m",
        (1e-6, 1e-2), scope=RIG, power=-3, shown_unit="mm", believable=(0.0, 3e-3),
        belief="rubber reverses within 0.1 to 2 mm", idle="above below",
    ),
    "play": Quantity(
        "play", "play", "play", "whole gap of the joints", "m", (1e-6, 1e-2), scope=RIG,
        power=-3, shown_unit="mm", believable=(0.0, 5e-3), belief="joints have 0.3 to 2 mm",
        ideal=0.0, idle="below",
    ),
    "lag": Quantity(
        "lag", "T", "lag of the force", "lag of the force channel, first order", "s",
        (1e-5, 5e-2), scope=RIG, power=-3, shown_unit="ms", believable=(0.0, 0.025),
        belief="force channels have 8 to 14 ms", ideal=0.0, idle="below",
    ),
    "moving_mass": Quantity(
        "moving_mass", "m", "moving mass", "mass of what moves between load cell and damper", "kg",
        (1e-4, 1e3), scope=RIG, shown_unit="kg", believable=(0.0, 30.0),
        belief="rods, bodies and fixtures have 0.1 to 20 kg", ideal=0.0, idle="below",
    ),
}  # fmt: skip
_OF_FRICTION: dict[str, Quantity] = {
    "presliding": Quantity(
        "presliding", "s_f", "presliding", "distance over which friction builds up", "m",
        (1e-7, 1e-2), scope=DAMPER, power=-6, shown_unit="µm", believable=(0.0, 1e-3),
        belief="seals slide after 5 to 500 µm", ideal=0.0, idle="below",
    ),
    "breakaway": Quantity(
        "breakaway", "f_b", "breakaway", "friction at rest above that of sliding", "N",
        (1e-3, 1e4), scope=DAMPER, may_vanish=True, shown_unit="N", believable=(0.0, 200.0),
        belief="seals of car dampers stick with less than 200 N", idle="below",
    ),
    "stribeck_speed": Quantity(
        # Below 5 mm/s a sine passes within a few samples, and any height fits beside a low speed.
        "stribeck_speed", "v_s", "Stribeck speed", "speed at which a third of it is left", "m/s",
        (5e-3, 0.2), scope=DAMPER, power=-3, shown_unit="mm/s", believable=(0.0, 0.2),
        belief="seals slide freely above 5 to 100 mm/s", idle="above below",
    ),
    "seal_area": Quantity(
        "seal_area", "a_s", "pressed friction", "friction by the pressure on the rod's seal", "m2",
        (1e-9, 1e-2), scope=DAMPER, may_vanish=True, power=-6, shown_unit="mm²",
        believable=(0.0, 5e-5),
        belief="rod seals have less than 50 mm²", idle="below",
    ),
    "turning_speed": Quantity(
        "turning_speed", "v_t", "turning speed", "speed within which friction reverses", "m/s",
        (1e-5, 0.1), scope=DAMPER, power=-3, shown_unit="mm/s", believable=(0.0, 0.02),
        belief="seals slide with all their friction from 0.1 to 20 mm/s on", idle="below",
    ),
}  # fmt: skip


class _Parts:
    """Fields that are "none", "fit" or a number; which they may be stands in a table."""

    __slots__ = ()

    def _check(self, known: dict[str, Quantity]) -> None:
        for name, quantity in known.items():
            found = getattr(self, name)
            if isinstance(found, bool) or not isinstance(found, float | int):
                if found not in (NONE, FIT):
                    raise ConfigurationError(
                        f"{name}: found {found!r}; expected a number, {NONE!r} or {FIT!r}",
                        code="not-a-number",
                    )
                continue
            low, high = quantity.plausible
            if not low <= float(found) <= high:
                raise ConfigurationError(
                    f"found {float(found):g}; expected {low:g} to {high:g} {quantity.unit}, "
                    f"{NONE!r} or {FIT!r}",
                    subject=name,
                    code="out-of-range",
                )

    def _declared(self, known: dict[str, Quantity]) -> tuple[Quantity, ...]:
        """The quantities of the parts that there are; a part that is known is held."""
        there = ((getattr(self, name), quantity) for name, quantity in known.items())
        return tuple(
            quantity if part == FIT else replace(quantity, default=float(part))
            for part, quantity in there
            if part != NONE
        )


@dataclass(frozen=True, slots=True)
class Mounting(_Parts):
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
    rubber, rubber_bend : str or float
        Force that rubber holds whichever way it was bent last, and the stretch over which it turns:
        "none", "fit", or N and m.
    """

    series_stiffness: str | float = FIT
    play: str | float = NONE
    lag: str | float = NONE
    moving_mass: str | float = NONE
    rubber: str | float = NONE
    rubber_bend: str | float = NONE

    def __post_init__(self) -> None:
        """Refuse what no mounting is."""
        self._check(_OF_MOUNTING)
        is_rubber = self.rubber != NONE
        is_held = self.series_stiffness != NONE
        if is_rubber is not (self.rubber_bend != NONE) or (is_rubber and not is_held):
            raise ConfigurationError(
                "rubber and rubber_bend are two numbers of one thing beside a series stiffness: "
                "set both, each to 'fit' or to a value, or neither",
                subject="rubber",
                code="half-a-pair",
            )
        if self.play != NONE and self.series_stiffness == NONE:
            raise ConfigurationError(
                "play needs a series stiffness that takes the force once the gap is closed: "
                f"set series_stiffness to {FIT!r} or to a value",
                code="half-a-pair",
            )

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """What a fit may find of it; what was measured is held."""
        return self._declared(_OF_MOUNTING)


@dataclass(frozen=True, slots=True)
class Friction(_Parts):
    """Which parts there are beside Coulomb's; each is absent, found by the fit, or known.

    Attributes
    ----------
    presliding : str or float
        Distance over which it builds up: "none", "fit", or m.
    breakaway : str or float
        What it has more at rest: "none", "fit", or N. Needs a Stribeck speed.
    stribeck_speed : str or float
        "none", "fit", or m/s.
    seal_area : str or float
        What the pressure above the piston adds, per Pa: "none", "fit", or m2.
    turning_speed : str or float
        Speed up to which it grows from nothing: "none", "fit", or m/s. Not beside presliding.
    """

    presliding: str | float = NONE
    breakaway: str | float = NONE
    stribeck_speed: str | float = NONE
    seal_area: str | float = NONE
    turning_speed: str | float = NONE

    def __post_init__(self) -> None:
        """Refuse what is no friction."""
        self._check(_OF_FRICTION)
        if NONE not in {self.presliding, self.turning_speed}:
            raise ConfigurationError(
                "turning_speed: found beside presliding; friction turns over a distance or within "
                "a speed: set one of the two and leave the other at 'none'",
                code="not-together",
            )
        if (self.breakaway == NONE) is not (self.stribeck_speed == NONE):
            missing = "stribeck_speed" if self.stribeck_speed == NONE else "breakaway"
            raise ConfigurationError(
                "found 'none'; breakaway and stribeck_speed are two numbers of one "
                "thing: set both, each to 'fit' or to a value, or neither",
                subject=missing,
                code="half-a-pair",
            )

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """What a fit may find of it; what was measured is held."""
        return self._declared(_OF_FRICTION)
