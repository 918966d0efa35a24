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

`DeclaredNetwork` is a damper that is no preset: its passages are declared one by one. Each leads
from one chamber to another (1 rod side, 2 full bore, 3 gas) by one law, and has a name after which
its numbers are called; passages of one name share them::

    orifice    {name}_bleed                              needle, hole
    leak       {name}_leak                               piston ring
    long       {name}_leak, {name}_bleed                 needle at few clicks
    check      {name}_slope                              return valve
    linear     {name}_opening, {name}_slope              preloaded disc
    port       {name}_opening, {name}_slope, {name}_port     and the port behind it
    rounded    {name}_opening, {name}_slope, {name}_width    a stack that lifts gradually
    lifting    {name}_opening, {name}_slope, {name}_lift     and further, the harder it is pressed

Oil goes from ``from`` to ``to`` alone unless ``two_way`` is true. A law of its own for each
direction is two passages.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from dataclasses import asdict, dataclass, field, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from damperfit.damper import quantity as roles
from damperfit.damper.cylinder import AMBIENT, Cylinder, filling
from damperfit.damper.model import OilModel
from damperfit.damper.mounting import NONE, Friction, Mounting
from damperfit.damper.network import (
    BLEEDS,
    BLOW_OFF_PARTS,
    BLOW_OFFS,
    LINEAR,
    PARTS,
    ROOT,
    Network,
    Passage,
    Valve,
    monotube,
    through_flow,
    twin_tube,
)
from damperfit.damper.purdy.parameters import OF_OIL, OIL
from damperfit.damper.quantity import DAMPER, LOG, Quantity
from damperfit.errors import ConfigurationError, did_you_mean
from damperfit.problem import Key

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Mapping, Sequence

    from numpy.typing import ArrayLike, NDArray

    from damperfit.damper.model import Values
    from damperfit.damper.valves import ValveCharacteristic
    from damperfit.recording import Trace
    from damperfit.simulation import Motion, Response, SolverOptions

    FloatArray = NDArray[np.float64]

__all__ = [
    "AMBIENT",
    "LAWS",
    "STROKES",
    "VALVE_RANGES",
    "DeclaredNetwork",
    "DeclaredPassage",
    "Monotube",
    "ThroughFlow",
    "TwinTube",
    "ValveDamper",
    "declared_passages",
]

STROKES = ("rebound", "compression")
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
        tuple(f"{stroke}_{part}" for part in BLOW_OFF_PARTS) for stroke in STROKES
    )

    @property
    def network(self) -> Network:
        """Its passages."""
        return _network(self)

    def _passages(self) -> Network:
        """The passages of its valves."""
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
        for stroke in STROKES:
            names = tuple(name for name in self.names if name.startswith(f"{stroke}_"))
            own = [q for q in self.quantities if q.stroke == stroke]
            found[stroke] = names
            for group in ("bleed", "blow_off"):
                found[f"{stroke}.{group}"] = tuple(q.name for q in own if q.group == group)
            found |= {
                name.replace("_", ".", 1): (name,) for name in names if not name.endswith("_bleed")
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
        from damperfit.damper.network import simulate_network

        filled = filling(motion, self.gas_pressure)
        numbers = dict(values)
        rig = {name: numbers.pop(name) for name in OF_LOAD_CELL if name in numbers}
        numbers["gas_pressure"] *= filled
        own = [name for name in sensitivities if name not in OF_LOAD_CELL]
        response = simulate_network(
            self.network, numbers, self, motion, sensitivities=own, options=options
        )
        if "gas_pressure" in own:
            response.sensitivities["gas_pressure"] *= filled
        return as_read(response, motion, sensitivities, **rig)

    def start(self, traces: Sequence[Trace], fixed: Mapping[str, float]) -> tuple[Values, ...]:
        """Start from the valves as read off the loops: `damperfit.damper.valves`."""
        from damperfit.damper.valves import valve_starts

        return valve_starts(self, traces, fixed)

    def valve_characteristics(
        self, values: Values, traces: Sequence[Trace]
    ) -> tuple[ValveCharacteristic, ...]:
        """Read them as `damperfit.damper.valves` says."""
        from damperfit.damper.valves import valve_characteristics

        return valve_characteristics(self, values, traces)


@dataclass(frozen=True, slots=True)
class TwinTube(ValveDamper):
    """A piston valve and a base valve; also a monotube with a base or reservoir valve."""

    name: ClassVar[str] = "twin_tube"
    title: ClassVar[str] = "twin tube: piston valve and base valve"

    def _passages(self) -> Network:
        return twin_tube(self.rebound, self.compression)

    @property
    def pressed_areas(self) -> tuple[float, float]:
        """The annulus; in bump the rod, whose oil leaves through the base valve."""
        return self.annulus_area, self.rod_area


@dataclass(frozen=True, slots=True)
class Monotube(ValveDamper):
    """A piston with a valve for each stroke, and a floating piston between oil and gas."""

    name: ClassVar[str] = "monotube"
    title: ClassVar[str] = "monotube: a piston valve for each stroke, floating piston"

    def _passages(self) -> Network:
        return monotube(self.rebound, self.compression)

    @property
    def pressed_areas(self) -> tuple[float, float]:
        """The annulus in both strokes: the floating piston keeps chamber 2 at the gas pressure."""
        return self.annulus_area, self.annulus_area


@dataclass(frozen=True, slots=True)
class ThroughFlow(ValveDamper):
    """A solid piston that presses through a valve for each stroke to the reservoir."""

    name: ClassVar[str] = "through_flow"
    title: ClassVar[str] = "through flow: solid piston, a valve for each stroke to the reservoir"

    def _passages(self) -> Network:
        return through_flow(self.rebound, self.compression)

    @property
    def pressed_areas(self) -> tuple[float, float]:
        """Either side of the solid piston."""
        return self.annulus_area, self.piston_area


# A fit asks for both at every simulation.
@lru_cache(maxsize=64)
def _network(damper: ValveDamper) -> Network:
    return replace(damper._passages(), ambient_pressure=damper.ambient_pressure)  # noqa: SLF001


@lru_cache(maxsize=64)
def _quantities(damper: ValveDamper) -> tuple[Quantity, ...]:
    network = damper.network
    names = network.passage_numbers
    found = [_of_valve(name, names) for name in names if name != "return_slope"]
    if "return_slope" in names:
        found.append(
            Quantity(
                "return_slope", "R_k", "return checks", "resistance of the return checks", LINEAR,
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
    stroke, _, part = name.rpartition("_")
    law = PARTS[part]
    idle = law.idle
    if part == "bleed" and f"{stroke}_leak" in names:
        idle = "above below"  # wide open, all of its pressure is the laminar share's
    if part == "leak" and f"{stroke}_bleed" not in names:  # all that the bleed has
        idle = "above"
    power, shown_unit = law.shown
    return Quantity(
        name,
        f"{law.symbol}_{stroke[0]}",
        f"{stroke} {law.label}",
        f"{stroke} valve: {law.meaning}",
        law.unit,
        law.plausible,
        power=power,
        shown_unit=shown_unit,
        role=roles.VISCOUS if law.unit == LINEAR else "",
        stroke=stroke,
        part=part,
        group="blow_off" if part in BLOW_OFF_PARTS else "bleed",
        area_power=law.area_power,
        idle=idle,
    )


# The numbers of each law of a declared passage.
LAWS: dict[str, tuple[str, ...]] = {
    law: parts for law, parts in (BLEEDS | {"check": ("slope",)} | BLOW_OFFS).items() if parts
}
_CHAMBERS = (1, 2, 3)
_KEYS = {"from": "start", "to": "end", "name": "name", "law": "law", "two_way": "is_two_way"}
_NAME = re.compile(r"[a-z][a-z0-9_]*")
_STROKE_OF = dict(enumerate(STROKES, start=1))


@dataclass(frozen=True, slots=True)
class DeclaredPassage:
    """One passage.

    Attributes
    ----------
    start, end : int
        Chambers; ``from`` and ``to`` in TOML.
    name : str
        Its numbers are called after it.
    law : str
        A name of `LAWS`.
    is_two_way : bool
        Whether the law holds backwards too; ``two_way`` in TOML.
    """

    start: int
    end: int
    name: str
    law: str
    is_two_way: bool = False

    @property
    def passage(self) -> Passage:
        """As the network has it."""
        return Passage.of_parts(
            self.start, self.end, self.name, LAWS[self.law], is_two_way=self.is_two_way
        )

    @property
    def table(self) -> dict[str, Any]:
        """As it stands in TOML."""
        own = asdict(self)
        return {key: own[name] for key, name in _KEYS.items()}


def declared_passages(tables: Iterable[Mapping[str, Any]]) -> tuple[DeclaredPassage, ...]:
    """Return the passages that a configuration declares.

    Raises
    ------
    ConfigurationError
        A key or value is wrong; the message tells which passage, counted from 1.
    """
    return tuple(_declared(table, place) for place, table in enumerate(tables, start=1))


def _declared(table: Mapping[str, Any], place: int) -> DeclaredPassage:
    where = f"passages: passage {place}"
    for key in table:
        if key not in _KEYS:
            near = did_you_mean(key, _KEYS)
            raise ConfigurationError(
                f"{where} has no key {key!r}; there are {', '.join(_KEYS)}.{near}",
                code="unknown-key",
            )
    missing = [key for key in _KEYS if key not in table and key != "two_way"]
    if missing:
        raise ConfigurationError(f"{where} lacks {', '.join(missing)}", code="missing-key")
    for key in ("from", "to"):
        if table[key] not in _CHAMBERS or isinstance(table[key], bool | float):
            raise ConfigurationError(
                f"{key} = {table[key]!r}; expected chamber 1 (rod side), 2 (full bore) or 3 (gas)",
                subject=where,
                code="bad-passage",
            )
    if table["from"] == table["to"]:
        raise ConfigurationError(
            f"{where} leads from chamber {table['from']} to itself", code="bad-passage"
        )
    law, name, two_way = table["law"], table["name"], table.get("two_way", False)
    if not isinstance(law, str) or law not in LAWS:
        near = did_you_mean(str(law), LAWS)
        raise ConfigurationError(
            f"no law {law!r}; there are {', '.join(LAWS)}.{near}", subject=where, code="unknown-law"
        )
    if not isinstance(name, str) or not _NAME.fullmatch(name):
        raise ConfigurationError(
            f"name = {name!r}; expected small letters, digits and _, as in 'base_valve'",
            subject=where,
            code="bad-passage",
        )
    if not isinstance(two_way, bool):
        raise ConfigurationError(
            f"two_way = {two_way!r}; expected true or false", subject=where, code="bad-passage"
        )
    return DeclaredPassage(table["from"], table["to"], name, law, two_way)


# Where nothing is declared: a twin tube.
_TWIN_TUBE = (
    DeclaredPassage(1, 2, "rebound", "orifice", is_two_way=True),
    DeclaredPassage(1, 2, "rebound", "linear"),
    DeclaredPassage(2, 1, "return", "check"),
    DeclaredPassage(2, 3, "compression", "orifice", is_two_way=True),
    DeclaredPassage(2, 3, "compression", "linear"),
    DeclaredPassage(3, 2, "return", "check"),
)


@dataclass(frozen=True, slots=True)
class DeclaredNetwork(ValveDamper):
    """A damper of any passages; geometry, oil, gas, mounting and friction as of the presets.

    Attributes
    ----------
    passages : tuple of DeclaredPassage
        Sixteen at most.
    floating_piston : bool
        Chamber 2 is at the gas pressure: passages join 1 with it.
    """

    rebound: Valve = field(default=Valve(), init=False, repr=False)
    compression: Valve = field(default=Valve(), init=False, repr=False)
    passages: tuple[DeclaredPassage, ...] = _TWIN_TUBE
    floating_piston: bool = False

    name: ClassVar[str] = "network"
    title: ClassVar[str] = "network: passages declared one by one"

    def __post_init__(self) -> None:
        """Refuse what is no damper."""
        Cylinder.__post_init__(self)
        for place, one in enumerate(self.passages, start=1):
            if self.floating_piston and {one.start, one.end} == {2, 3}:
                raise ConfigurationError(
                    f"passage {place} joins 2 and 3, which are one behind a floating piston",
                    where=Key(("passages",)),
                    code="bad-passage",
                )
        if not any(1 in (one.start, one.end) for one in self.passages):
            raise ConfigurationError(
                "none leads to or from chamber 1, the rod side",
                where=Key(("passages",)),
                code="no-passage",
            )
        _ = self.network  # refuses too many

    def _passages(self) -> Network:
        passages = tuple(declared.passage for declared in self.passages)
        return Network(self.name, passages, has_floating_piston=self.floating_piston)

    @property
    def pressed_areas(self) -> tuple[float, float]:
        """Of the preset that is most like it."""
        return self._preset.pressed_areas

    @property
    def valves_said(self) -> str:
        """Its passages in words."""
        return ", ".join(
            f"{one.start} to {one.end}{' and back' * one.is_two_way} {one.name} ({one.law})"
            for one in self.passages
        )

    @property
    def _preset(self) -> ValveDamper:
        """The preset that presses alike: from its loops the valves are read."""
        kind: type[ValveDamper] = ThroughFlow
        if self.floating_piston:
            kind = Monotube
        elif any({one.start, one.end} == {1, 2} for one in self.passages):
            kind = TwinTube
        shared = ("rod_diameter", "piston_diameter", "chamber_1_length", "chamber_2_length")
        own = (*shared, "oil_density", "gas_pressure", "gas_volume", "gas_exponent")
        more = (*own, "ambient_pressure", "mounting", "friction")
        return kind(**{name: getattr(self, name) for name in more})

    def start(self, traces: Sequence[Trace], fixed: Mapping[str, float]) -> tuple[Values, ...]:
        """Start from the valves of the preset that presses alike, shared out among the passages."""
        from damperfit.damper.valves import valve_points

        preset = self._preset
        opens = {passage.start for passage in self.passages if passage.law in BLOW_OFFS}
        points: list[list[dict[str, float]]] = []
        for kind in (law for law in BLOW_OFFS if law not in {"none", "linear"}):
            pair = [Valve("long", kind if chamber in opens else "none") for chamber in _STROKE_OF]
            made = replace(preset, rebound=pair[0], compression=pair[1])
            points.append(valve_points(made, traces, fixed))
        alike = (
            {k: v for one in many for k, v in one.items()} for many in zip(*points, strict=True)
        )
        return tuple(self._from_point(point, fixed) for point in alike)

    def _from_point(self, point: Mapping[str, float], fixed: Mapping[str, float]) -> Values:
        from damperfit.damper.valves import within_plausible

        def place(passage: DeclaredPassage) -> tuple[int, bool]:
            return passage.start, passage.law in BLOW_OFFS

        valves = [p for p in self.passages if p.law != "check" and p.start in _STROKE_OF]
        beside = Counter(map(place, valves))
        own = dict(point)
        for passage in self.passages:
            for part in LAWS[passage.law]:
                number = PARTS[part].elsewhere
                if passage in valves:
                    # Passages beside each other share the flow, at one pressure.
                    is_flow = PARTS[part].unit in {ROOT, LINEAR}
                    n = beside[place(passage)] if is_flow else 1
                    number = n * point[f"{_STROKE_OF[passage.start]}_{part}"]
                own[f"{passage.name}_{part}"] = number
        return within_plausible(self, own, fixed)

    def valve_characteristics(
        self,
        values: Values,  # noqa: ARG002
        traces: Sequence[Trace],  # noqa: ARG002
    ) -> tuple[ValveCharacteristic, ...]:
        """Return none: which passage a stroke presses is not said."""
        return ()
