"""Rod, piston, chambers and gas, as every damper with a cylinder has them."""

from __future__ import annotations

import math
from numbers import Real
from typing import TYPE_CHECKING

from damperfit.errors import ConfigurationError
from damperfit.problem import Key

if TYPE_CHECKING:
    from collections.abc import Mapping

    from damperfit.simulation import Motion

__all__ = ["AMBIENT", "Cylinder", "filling"]

AMBIENT = 101325.0  # Pa, of the air


class Cylinder:
    """What follows from the diameters and the chambers' lengths at x = 0, all in m.

    Raises
    ------
    ConfigurationError
        A value is outside `ranges`, or the rod is as wide as the piston.
    """

    __slots__ = ()

    if TYPE_CHECKING:
        rod_diameter: float
        piston_diameter: float
        chamber_1_length: float
        chamber_2_length: float
        gas_pressure: float
        gas_exponent: float
        ambient_pressure: float

        @property
        def ranges(self) -> Mapping[str, tuple[float, float, str]]: ...  # noqa: D102

        @property
        def gas_volume(self) -> float: ...  # noqa: D102

    def __post_init__(self) -> None:
        """Refuse what is no damper."""
        for name, (low, high, unit) in self.ranges.items():
            value, in_unit = getattr(self, name), f" {unit}" if unit else ""
            if not isinstance(value, Real):
                wanted = f"a number{' in' if unit else ''}{in_unit}, found {value!r}"
            elif not low <= float(value) <= high:
                wanted = f"{low:g} to {high:g}{in_unit}, found {value:g}{in_unit}"
            else:
                continue
            raise ConfigurationError(f"expected {wanted}", where=Key((name,)), code="out-of-range")
        if self.rod_diameter >= self.piston_diameter:
            raise ConfigurationError(
                f"expected less than piston_diameter, "
                f"{self.piston_diameter:g} m, found {self.rod_diameter:g} m",
                where=Key(("rod_diameter",), ("piston_diameter",)),
                code="out-of-range",
            )

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

    @property
    def chamber_lengths(self) -> tuple[float, float]:
        """l_1 and l_2, m."""
        return self.chamber_1_length, self.chamber_2_length

    @property
    def travel(self) -> float:
        """Length of the shorter chamber, m."""
        return min(self.chamber_lengths)

    @property
    def gas(self) -> tuple[float, float, float, float, float]:
        """Rod area, gas pressure, gas volume, gas exponent, ambient pressure, SI."""
        gas = self.gas_pressure, self.gas_volume, self.gas_exponent
        return self.rod_area, *gas, self.ambient_pressure


def filling(motion: Motion, declared: float) -> float:
    """Return a test's gas pressure over the declared one, Pa absolute; 1 where none is stated."""
    return 1.0 if motion.gas_pressure is None else motion.gas_pressure / declared
