"""A damper with oil in two chambers of a cylinder, a rod through one of them, and gas."""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import replace
from numbers import Real
from typing import TYPE_CHECKING, ClassVar

from damperfit.damper.model import (
    DAMPER,
    FLAWS_OF_FORCE,
    FLAWS_OF_OIL,
    FRICTION,
    OFFSET,
    PRESSURES,
    RIGID,
    STIFFNESS,
    Model,
    Quantity,
    Signal,
)
from damperfit.errors import ConfigurationError, SimulationError, did_you_mean
from damperfit.problem import Key

if TYPE_CHECKING:
    from damperfit.damper.model import Names, Values
    from damperfit.damper.network import Network
    from damperfit.simulation import Motion, Response, SolverOptions

AMBIENT = 101325.0  # Pa, of the air

# What any damper has, from a model car's to a bridge's, with room to spare, in SI. What lies
# outside was misread: mm as m, bar as Pa. Pressures are absolute, hence never nothing.
RANGES: dict[str, tuple[float, float, str]] = {
    "rod_diameter": (1e-3, 0.5, "m"),
    "piston_diameter": (2e-3, 1.0, "m"),
    "gas_piston_diameter": (2e-3, 1.0, "m"),
    "chamber_1_length": (2e-3, 5.0, "m"),
    "chamber_2_length": (2e-3, 5.0, "m"),
    "gas_length": (1e-3, 5.0, "m"),
    "oil_density": (500.0, 2000.0, "kg/m3"),
    "gas_pressure": (1e4, 1e8, "Pa"),
    "gas_volume": (1e-8, 1.0, "m3"),
    "gas_exponent": (1.0, 1.67, ""),  # slow compression of any gas, fast of one with single atoms
    "ambient_pressure": (0.0, 1e7, "Pa"),
}

K_E = Quantity(
    "k_e", "K_e", "bulk modulus of oil and chamber",
    "effective bulk modulus of oil, air and tube", "Pa", (1e6, 1e11), power=6, shown_unit="MPa",
    # Eq. (28): 2 % of free gas at 4.6 bar leave 31 MPa. No oil is stiffer than twice mineral oil.
    believable=(3e7, 3e9), belief="oil has 1500 MPa, and 30 with 2 % of free gas in it",
    role=STIFFNESS, ideal=RIGID,
)  # fmt: skip
F_F = Quantity(
    "f_f", "f_f", "friction", "Coulomb friction of seals and bearings", "N", (1e-3, 1e4),
    scope=DAMPER, may_vanish=True, shown_unit="N", role=FRICTION,
)  # fmt: skip
# A force offset is about as much as the rod's gas force.
F_0 = Quantity(
    "f_0", "f_0", "force offset", "constant offset added to the force, the rig's tare", "N",
    (-math.inf, math.inf), is_logarithmic=False, size=100.0, shown_unit="N", role=OFFSET,
)  # fmt: skip


class Cylinder(Model):
    """What follows from the diameters and the chambers' lengths at x = 0, all in m.

    Raises
    ------
    ConfigurationError
        A value is outside `ranges`, or the rod is as wide as the piston.
    """

    __slots__ = ()

    signals: ClassVar[tuple[Signal, ...]] = PRESSURES
    flaws: ClassVar[tuple[str, ...]] = (*FLAWS_OF_FORCE, *FLAWS_OF_OIL)
    rounding: ClassVar[float | None] = None  # of its orifices' roots, Pa; None: the solver's

    if TYPE_CHECKING:
        rod_diameter: float
        piston_diameter: float
        chamber_1_length: float
        chamber_2_length: float
        oil_density: float
        gas_pressure: float
        gas_exponent: float
        ambient_pressure: float

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
    @abstractmethod
    def network(self) -> Network:
        """Its passages."""

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

    def simulate(
        self, values: Values, motion: Motion, *, sensitivities: Names, options: SolverOptions
    ) -> Response:
        """Integrate the network and its mounting; the force passes load cell and channel."""
        from damperfit.damper.mounting import OF_LOAD_CELL, as_read
        from damperfit.damper.network import simulate_network

        known = (*values.names, *self.conditions)
        for name in sensitivities:
            if name not in known:
                raise SimulationError(
                    f"no sensitivity by {name!r}; there are {', '.join(known)}."
                    f"{did_you_mean(name, known)}",
                    code="unknown-quantity",
                )
        if self.rounding is not None:
            options = replace(options, rounding=self.rounding)
        # A test's gas pressure over the declared one.
        filled = 1.0 if motion.gas_pressure is None else motion.gas_pressure / self.gas_pressure
        numbers = {"gas_pressure": self.gas_pressure, **dict(values)}
        numbers["gas_pressure"] *= filled
        rig = {name: numbers.pop(name) for name in OF_LOAD_CELL if name in numbers}
        own = [name for name in sensitivities if name not in rig]
        response = simulate_network(
            self.network, numbers, self, motion, sensitivities=own, options=options
        )
        if "gas_pressure" in own:
            response.sensitivities["gas_pressure"] *= filled
        return as_read(response, motion, sensitivities, **rig) if rig else response
