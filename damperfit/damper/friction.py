"""Friction of seals and bearings beyond Coulomb's: it builds up, is larger at rest, is pressed.

While it slides it is f_f + f_b exp(-(v/v_s)^2) + a_s P_1: Coulomb's, what it has more at rest
(Stribeck), and what the pressure on the rod's seal adds. It turns with the motion at once, within a
speed (a film of oil carries a part of it below), or over a distance (Dahl). The equations stand in
`damperfit.damper.network`. Loops seldom tell any of them from soft oil and bleeds: a
friction that changes with the clicks is none.
"""

from __future__ import annotations

from dataclasses import dataclass

from damperfit.damper.mounting import NONE, check_part, declared_quantities
from damperfit.damper.quantity import DAMPER, Quantity
from damperfit.errors import ConfigurationError

__all__ = ["Friction"]

_QUANTITIES = (
    Quantity(
        "presliding", "s_f", "presliding", "distance over which friction builds up", "m",
        (1e-7, 1e-2), scope=DAMPER, power=-6, shown_unit="µm", believable=(0.0, 1e-3),
        belief="seals slide after 5 to 500 µm", ideal=0.0, idle="below",
    ),
    Quantity(
        "breakaway", "f_b", "breakaway", "friction at rest above that of sliding", "N",
        (1e-3, 1e4), scope=DAMPER, may_vanish=True, shown_unit="N", believable=(0.0, 200.0),
        belief="seals of car dampers stick with less than 200 N", idle="below",
    ),
    Quantity(
        # Below 5 mm/s a sine passes within a few samples, and any height fits beside a low speed.
        "stribeck_speed", "v_s", "Stribeck speed", "speed at which a third of it is left", "m/s",
        (5e-3, 0.2), scope=DAMPER, power=-3, shown_unit="mm/s", believable=(0.0, 0.2),
        belief="seals slide freely above 5 to 100 mm/s", idle="above below",
    ),
    Quantity(
        "seal_area", "a_s", "pressed friction", "friction by the pressure on the rod's seal", "m2",
        (1e-9, 1e-2), scope=DAMPER, may_vanish=True, power=-6, shown_unit="mm²",
        believable=(0.0, 5e-5),
        belief="rod seals have less than 50 mm²", idle="below",
    ),
    Quantity(
        "turning_speed", "v_t", "turning speed", "speed up to which friction turns", "m/s",
        (1e-5, 0.1), scope=DAMPER, power=-3, shown_unit="mm/s", believable=(0.0, 0.02),
        belief="seals slide with all their friction from 0.1 to 20 mm/s on", idle="below",
    ),
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Friction:
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
        for one in _QUANTITIES:
            check_part(one.name, getattr(self, one.name), one)
        if NONE not in {self.presliding, self.turning_speed}:
            raise ConfigurationError(
                "turning_speed: found beside presliding; friction turns over a distance or within "
                "a speed: set one of the two and leave the other at 'none'"
            )
        if (self.breakaway == NONE) is not (self.stribeck_speed == NONE):
            missing = "stribeck_speed" if self.stribeck_speed == NONE else "breakaway"
            raise ConfigurationError(
                "found 'none'; breakaway and stribeck_speed are two numbers of one "
                "thing: set both, each to 'fit' or to a value, or neither",
                subject=missing,
            )

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """What a fit may find of it; what was measured is held."""
        parts = (
            self.presliding,
            self.breakaway,
            self.stribeck_speed,
            self.seal_area,
            self.turning_speed,
        )
        return declared_quantities(parts, _QUANTITIES)
