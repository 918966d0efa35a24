"""Dampers of real valves: a bleed and a preloaded blow-off in each stroke; how they are mounted.

Three layouts, of the passages of `damperfit.damper.network`::

    twin_tube      rod | 1 ==piston valve== 2 ==base valve== gas    also a monotube with base valve
    monotube       rod | 1 ==piston valve== 2 | floating piston | gas
    through_flow   rod | 1 ==rebound valve== gas ==compression valve== 2         solid piston,
                   piggyback or remote reservoir, adjusters for each stroke

Each valve has a bleed that is always open and a blow-off that opens at p_open, D = p_open + R w;
its return check closes in its own stroke. What logs of this kind cannot tell is held unless it is
freed: the oil's bulk modulus in series with an elastic mounting, the returns, the seals' drag
beside the slopes of the blow-offs.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from damperfit.damper import quantity as roles
from damperfit.damper.cylinder import Cylinder, filling
from damperfit.damper.friction import Friction
from damperfit.damper.model import OilModel
from damperfit.damper.mounting import NONE, Mounting
from damperfit.damper.network import Network, Valve, monotube, through_flow, twin_tube
from damperfit.damper.purdy.quantities import OF_OIL, OIL
from damperfit.damper.quantity import DAMPER, LOG, Quantity

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Mapping, Sequence

    from numpy.typing import ArrayLike, NDArray

    from damperfit.damper.model import Values
    from damperfit.damper.valve_characteristics import ValveCharacteristic
    from damperfit.recording import Trace
    from damperfit.simulation import Motion, Response, SolverOptions

    FloatArray = NDArray[np.float64]

__all__ = ["AMBIENT", "VALVE_RANGES", "Monotube", "ThroughFlow", "TwinTube", "ValveDamper"]

AMBIENT = 101325.0
# What any damper has, with room to spare, in SI; what lies outside was misread.
VALVE_RANGES: dict[str, tuple[float, float, str]] = {
    "rod_diameter": (1e-3, 0.5, "m"),
    "piston_diameter": (2e-3, 1.0, "m"),
    "chamber_1_length": (2e-3, 5.0, "m"),
    "chamber_2_length": (2e-3, 5.0, "m"),
    "oil_density": (500.0, 2000.0, "kg/m3"),
    "gas_pressure": (1e4, 1e8, "Pa"),
    "gas_volume": (1e-8, 1.0, "m3"),
    "gas_exponent": (1.0, 1.67, ""),
    "ambient_pressure": (0.0, 1e7, "Pa"),
}

# Held unless freed: oil with its tube and a trace of air; the return check of a car's damper.
_OIL, _RETURN = 1e9, 2.5e5
# What they are off by where nobody has measured them, of their logarithms; seals drag with up to 30
# N s/m, none of which is known.
_OIL_IGNORANCE, _RETURN_IGNORANCE, _DRAG_IGNORANCE = 0.3, 0.3, 15.0
_ROOT, _LINEAR = "s sqrt(N)/(m kg)", "N s/(m2 kg)"
# What the compiled core calls a quantity, where it differs.
_CORE_NAMES = {"k_s": "series_stiffness"}


@dataclass(frozen=True, slots=True)
class ValveDamper(Cylinder, OilModel):
    """Geometry, oil, gas, valves and mounting of a damper with real valves.

    Attributes
    ----------
    rod_diameter, piston_diameter, chamber_1_length, chamber_2_length : float
        m; the chambers' oil at x = 0.
    oil_density : float
        kg/m3.
    gas_pressure, gas_volume, gas_exponent : float
        P_0 (absolute) and V_g0 at x = 0, Pa and m3; gamma.
    ambient_pressure : float
        On the rod, Pa.
    rebound, compression : Valve
        What the valve of each stroke is made of.
    mounting : Mounting
        Elasticity, play, moving mass, lag.
    friction : Friction
        What there is to it beside Coulomb's.

    Raises
    ------
    ConfigurationError
        A value is outside `VALVE_RANGES`, or the rod is as wide as the piston.
    """

    rod_diameter: float = 0.012
    piston_diameter: float = 0.03
    chamber_1_length: float = 0.09
    chamber_2_length: float = 0.09
    oil_density: float = 850.0
    gas_pressure: float = 5e5
    gas_volume: float = 3e-5
    gas_exponent: float = 1.3
    ambient_pressure: float = AMBIENT
    rebound: Valve = Valve()
    compression: Valve = Valve()
    mounting: Mounting = Mounting()
    friction: Friction = Friction()

    ranges: ClassVar[Mapping[str, tuple[float, float, str]]] = VALVE_RANGES
    # Openings and play. What promises less moves nothing by much more than a tenth of its error.
    kinks: ClassVar[float] = 2e-5
    determined_together: ClassVar[tuple[tuple[str, ...], ...]] = tuple(
        tuple(f"{stroke}_{part}" for part in ("opening", "slope", "port", "width", "lift"))
        for stroke in ("rebound", "compression")
    )

    @property
    def network(self) -> Network:
        """Its passages."""
        return _network(self)

    @property
    def layout(self) -> Callable[[Valve, Valve], Network]:
        """What makes its passages of the valves of rebound and compression."""
        raise NotImplementedError

    @property
    def pressed_areas(self) -> tuple[float, float]:
        """What presses oil through the rebound valve and through that of compression, m2."""
        raise NotImplementedError

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """The valves' numbers, oil, friction, mounting, offset."""
        return _quantities(self)

    @property
    def parts(self) -> dict[str, tuple[str, ...]]:
        """What each valve is made of: "rebound", "rebound.bleed", "rebound.blow_off"."""
        found: dict[str, tuple[str, ...]] = {}
        for stroke in ("rebound", "compression"):
            mine = tuple(name for name in self.names if name.startswith(f"{stroke}_"))
            found[stroke] = mine
            for part, kinds in _VALVE_PARTS.items():
                found[f"{stroke}.{part}"] = tuple(n for n in mine if n.split("_")[1] in kinds)
            found |= {
                name.replace("_", ".", 1): (name,) for name in mine if name.split("_")[1] != "bleed"
            }
        return {word: names for word, names in found.items() if names}

    @property
    def sentence(self) -> str:
        """The damper's main figures."""
        return (
            f"{self.title}; rod {1e3 * self.rod_diameter:g} mm, piston "
            f"{1e3 * self.piston_diameter:g} mm, chambers {1e3 * self.chamber_1_length:g} and "
            f"{1e3 * self.chamber_2_length:g} mm, gas {1e6 * self.gas_volume:g} cm3 at "
            f"{self.gas_pressure / 1e5:.5g} bar absolute, exponent {self.gas_exponent:g}, oil "
            f"{self.oil_density:g} kg/m3; {self.valves_said}"
        )

    @property
    def valves_said(self) -> str:
        """What its valves are, in words."""
        return ", ".join(
            f"{stroke} {valve.bleed} bleed and {valve.blow_off} blow-off".replace("none ", "no ")
            for stroke, valve in (("rebound", self.rebound), ("compression", self.compression))
        )

    def rest_force(self, displacement: ArrayLike) -> FloatArray:
        """Gas against ambient pressure on the rod, N."""
        x = np.asarray(displacement, dtype=np.float64)
        room = np.maximum(self.gas_volume + self.rod_area * x, 1e-3 * self.gas_volume)
        inside = self.gas_pressure * (self.gas_volume / room) ** self.gas_exponent
        return np.asarray(self.rod_area * (self.ambient_pressure - inside))

    def simulate(
        self,
        values: Values,
        motion: Motion,
        *,
        sensitivities: Sequence[str],
        options: SolverOptions,
    ) -> Response:
        """Integrate the network and its mounting; the force passes load cell and channel."""
        from damperfit.damper.load_cell import OF_LOAD_CELL, as_read
        from damperfit.damper.network_model import simulate_network

        numbers = {
            _CORE_NAMES.get(one, one): value
            for one, value in zip(values.names, values.numbers, strict=True)
            if one not in OF_LOAD_CELL
        }
        filled = filling(motion, self.gas_pressure)
        numbers["gas_pressure"] *= filled
        own = [one for one in sensitivities if one not in OF_LOAD_CELL]
        wanted = [_CORE_NAMES.get(one, one) for one in own]
        response = simulate_network(
            self.network, numbers, self, motion, sensitivities=wanted, options=options
        )
        if "gas_pressure" in wanted:
            response.sensitivities["gas_pressure"] *= filled
        slopes = dict(zip(own, (response.sensitivities[one] for one in wanted), strict=True))
        return as_read(replace(response, sensitivities=slopes), motion, values, sensitivities)

    def start(self, traces: Sequence[Trace], fixed: Mapping[str, float]) -> tuple[Values, ...]:
        """Start from the valves as read off the loops: `damperfit.damper.valve_starts`."""
        from damperfit.damper.valve_starts import valve_starts

        return valve_starts(self, traces, fixed)

    def valve_characteristics(
        self, values: Values, traces: Sequence[Trace]
    ) -> tuple[ValveCharacteristic, ...]:
        """Read them as `damperfit.damper.valve_characteristics` says."""
        from damperfit.damper.valve_characteristics import valve_characteristics

        return valve_characteristics(self, values, traces)


@dataclass(frozen=True, slots=True)
class TwinTube(ValveDamper):
    """A piston valve and a base valve; also a monotube with a base or reservoir valve."""

    name: ClassVar[str] = "twin_tube"
    title: ClassVar[str] = "twin tube: piston valve and base valve"

    @property
    def layout(self) -> Callable[[Valve, Valve], Network]:
        """A piston valve and a base valve."""
        return twin_tube

    @property
    def pressed_areas(self) -> tuple[float, float]:
        """The annulus; in bump the rod, whose oil leaves through the base valve."""
        return self.annulus_area, self.rod_area


@dataclass(frozen=True, slots=True)
class Monotube(ValveDamper):
    """A piston with a valve for each stroke, and a floating piston between oil and gas."""

    name: ClassVar[str] = "monotube"
    title: ClassVar[str] = "monotube: a piston valve for each stroke, floating piston"

    @property
    def layout(self) -> Callable[[Valve, Valve], Network]:
        """A piston valve for each stroke."""
        return monotube

    @property
    def pressed_areas(self) -> tuple[float, float]:
        """The annulus in both strokes: the floating piston keeps chamber 2 at the gas pressure."""
        return self.annulus_area, self.annulus_area


@dataclass(frozen=True, slots=True)
class ThroughFlow(ValveDamper):
    """A solid piston that presses through a valve for each stroke to the reservoir."""

    name: ClassVar[str] = "through_flow"
    title: ClassVar[str] = "through flow: solid piston, a valve for each stroke to the reservoir"

    @property
    def layout(self) -> Callable[[Valve, Valve], Network]:
        """Each side of the piston to the reservoir."""
        return through_flow

    @property
    def pressed_areas(self) -> tuple[float, float]:
        """Either side of the solid piston."""
        return self.annulus_area, self.piston_area


_BLOW_OFF = ("opening", "slope", "port", "width", "lift")
_VALVE_PARTS = {"bleed": ("bleed", "leak"), "blow_off": _BLOW_OFF}
# part: symbol, in a table's row, meaning, unit, range, power of ten and unit for people, idle edges
_PARTS: dict[str, tuple[str, str, str, str, tuple[float, float], int, str, str]] = {
    "bleed": (
        "S", "bleed", "orifice of the bleed, 1/(C_d A sqrt(2 rho))", _ROOT,
        (1e2, 1e8), 3, "10³ s √N / (m kg)", "above",
    ),
    "leak": (
        "L", "leak", "laminar resistance of the bleed", _LINEAR, (1e3, 1e11), 6,
        "10⁶ N s / (m² kg)", "below",
    ),
    "opening": (
        "p", "opening", "pressure at which the blow-off opens", "Pa", (1e3, 1e8), 5, "bar",
        "above below",
    ),
    "slope": (
        "R", "slope", "resistance of the blow-off beyond its opening", _LINEAR, (1e3, 1e11), 6,
        "10⁶ N s / (m² kg)", "above below",
    ),
    "port": (
        "S_p", "port", "orifice behind the blow-off", _ROOT, (1e1, 1e8), 3, "10³ s √N / (m kg)",
        "below above",
    ),
    "width": (
        "d", "rounding", "how gradually the blow-off lifts", "Pa", (1e1, 1e7), 5, "bar", "below",
    ),
    "lift": (
        "b", "lift", "how much further the blow-off lifts, the harder it is pressed", "1/Pa",
        (1e-9, 1e-3), -5, "1/bar", "below above",
    ),
}  # fmt: skip


# A fit asks for both at every simulation.
@lru_cache(maxsize=64)
def _network(damper: ValveDamper) -> Network:
    passages = damper.layout(damper.rebound, damper.compression)
    return replace(passages, ambient_pressure=damper.ambient_pressure)


@lru_cache(maxsize=64)
def _quantities(damper: ValveDamper) -> tuple[Quantity, ...]:
    network = damper.network
    names = network.passage_numbers
    found = [_of_valve(name, names) for name in names if name != "return_slope"]
    if "return_slope" in names:
        found.append(
            Quantity(
                "return_slope", "R_k", "return checks", "resistance of the return checks", _LINEAR,
                (1e2, 1e10), scope=DAMPER, default=_RETURN, power=6, shown_unit="10⁶ N s / (m² kg)",
                ignorance=_RETURN_IGNORANCE, role=roles.VISCOUS, stroke="return", part="slope",
                idle="below",
            )
        )  # fmt: skip
    found += [
        Quantity(
            "gas_pressure", "P_0", "gas pressure", "absolute pressure of the gas at x = 0", "Pa",
            VALVE_RANGES["gas_pressure"][:2], scope=DAMPER, default=damper.gas_pressure, power=5,
            shown_unit="bar", is_absolute=True,
        ),
        Quantity(
            "gas_volume", "V_g", "gas volume", "volume of the gas at x = 0", "m3", (1e-8, 1.0),
            scope=DAMPER, default=damper.gas_volume, power=-6, shown_unit="cm³",
            role=roles.GAS_AMOUNT,
        ),
        Quantity(
            "gas_exponent", "gamma", "gas exponent", "polytropic exponent of the gas", "1",
            (0.5, 3.0), scope=DAMPER, default=damper.gas_exponent,
            believable=(0.95, 1.75), belief="gases have 1.0 (slow) to 1.67",
        ),
    ]  # fmt: skip
    is_rigid = damper.mounting.series_stiffness == NONE
    found += [
        Quantity(
            "k_e", "K_e", "bulk modulus of oil and chamber",
            "effective bulk modulus of oil, air and tube", "Pa", (1e6, 1e11),
            scope=DAMPER, default=None if is_rigid else _OIL, power=6, shown_unit="MPa",
            believable=OIL, belief=OF_OIL, ignorance=_OIL_IGNORANCE,
            role=roles.STIFFNESS, ideal=roles.RIGID,
        ),
        Quantity(
            "free_gas", "phi", "free gas", "share of the oil's volume that is gas at rest", "1",
            (1e-6, 0.3), scope=DAMPER, default=0.0, may_vanish=True, power=-2, shown_unit="%",
            believable=(0.0, 0.05), belief="oil that was filled with care holds less than 5 %",
            ideal=0.0, idle="below",
        ),
        Quantity(
            "f_f", "f_f", "friction", "Coulomb friction of seals and bearings", "N", (1e-3, 1e4),
            scope=DAMPER, may_vanish=True, shown_unit="N", role=roles.FRICTION,
        ),
        Quantity(
            "drag", "c", "drag of the seals", "force of the seals by the speed", "N s/m",
            (1e-2, 1e5), scope=DAMPER, default=0.0, may_vanish=True, shown_unit="N s/m",
            ignorance=_DRAG_IGNORANCE, role=roles.VISCOUS, idle="below",
        ),
        *damper.friction.quantities,
        *damper.mounting.quantities,
        Quantity(
            "f_0", "f_0", "force offset", "constant offset added to the force, the rig's tare",
            "N", (-math.inf, math.inf), is_logarithmic=False, size=100.0, scope=LOG, shown_unit="N",
            role=roles.OFFSET,
        ),
    ]  # fmt: skip
    return tuple(found)


def _of_valve(name: str, names: Collection[str]) -> Quantity:
    stroke, part = name.rsplit("_", 1)
    symbol, label, meaning, unit, plausible, power, shown, idle = _PARTS[part]
    if part == "bleed" and f"{stroke}_leak" in names:
        idle = "above below"  # wide open, all of its pressure is the laminar share's
    if part == "leak" and f"{stroke}_bleed" not in names:  # all that the bleed has
        idle = "above"
    return Quantity(
        name,
        f"{symbol}_{stroke[0]}",
        f"{stroke} {label}",
        f"{stroke} valve: {meaning}",
        unit,
        plausible,
        power=power,
        shown_unit=shown,
        role=roles.VISCOUS if unit == _LINEAR else "",
        stroke=stroke,
        part=part,
        idle=idle,
    )
