"""Areas and volumes of rod, piston and chambers, as every damper with a cylinder has them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from damperfit.simulation import Motion

__all__ = ["Cylinder", "filling"]


class Cylinder:
    """What follows from the diameters and the chambers' lengths at x = 0, all in m."""

    __slots__ = ()

    if TYPE_CHECKING:
        rod_diameter: float
        piston_diameter: float
        chamber_1_length: float
        chamber_2_length: float

    @property
    def piston_area(self) -> float:
        """a_p2, full bore, m2."""
        return math.pi / 4.0 * self.piston_diameter**2

    @property
    def rod_area(self) -> float:
        """a_r, m2."""
        return math.pi / 4.0 * self.rod_diameter**2

    @property
    def annulus_area(self) -> float:
        """a_p1 = a_p2 - a_r, m2."""
        return self.piston_area - self.rod_area

    @property
    def chamber_1_volume(self) -> float:
        """V_10, rod side at x = 0, m3."""
        return self.chamber_1_length * self.annulus_area

    @property
    def chamber_2_volume(self) -> float:
        """V_20, full-bore side at x = 0, m3."""
        return self.chamber_2_length * self.piston_area


def filling(motion: Motion, declared: float) -> float:
    """Return what a test's gas pressure is over the declared one; 1 where none is told.

    Parameters
    ----------
    motion : Motion
        The test.
    declared : float
        Gas pressure of the damper, Pa absolute.
    """
    return 1.0 if motion.gas_pressure is None else motion.gas_pressure / declared
