"""What stands between the rig and the damper: elasticity, play, and the lag of the force channel.

Rod ends, frame and load cell give by 1/k_s in series with the damper (125 to 1900 N/mm are found on
rigs), joints have play (0.3 to 2 mm), and the force channel may be late (a first-order filter of 8
to 14 ms is found). Without them soft oil, friction and even a blow-off are invented to take their
place. At one frequency a lag and an elasticity look alike; several speeds part them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from damperfit.errors import ConfigurationError

__all__ = ["FIT", "NONE", "Mounting"]

NONE, FIT = "none", "fit"


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
    """

    series_stiffness: str | float = FIT
    play: str | float = NONE
    lag: str | float = NONE

    def __post_init__(self) -> None:
        """Refuse what no mounting is."""
        for name in ("series_stiffness", "play", "lag"):
            found = getattr(self, name)
            is_number = isinstance(found, float | int) and not isinstance(found, bool)
            if is_number and not (found > 0.0 and math.isfinite(found)):
                raise ConfigurationError(
                    f"{name}: found {found:g}; expected a number above 0, {NONE!r} or {FIT!r}"
                )
            if not is_number and found not in (NONE, FIT):
                raise ConfigurationError(
                    f"{name}: found {found!r}; expected a number, {NONE!r} or {FIT!r}"
                )
        if self.play != NONE and self.series_stiffness == NONE:
            raise ConfigurationError(
                "play needs a series stiffness that takes the force once the gap is closed: "
                f"set series_stiffness to {FIT!r} or to a value"
            )
