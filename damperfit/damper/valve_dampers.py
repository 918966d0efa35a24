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
    power      {name}_opening, {name}_slope, {name}_power    by a power of its flow

Oil goes from ``from`` to ``to`` alone unless ``two_way`` is true. A law of its own for each
direction is two passages.
"""

from __future__ import annotations

import re
from collections import ChainMap, Counter
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np

from damperfit.damper.cylinder import AMBIENT, F_0, F_F, K_E, RANGES, Cylinder
from damperfit.damper.mounting import NONE, Friction, Mounting
from damperfit.damper.network import (
    BLEEDS,
    BLOW_OFF_PARTS,
    BLOW_OFFS,
    LINEAR,
    PARTS,
    ROOT,
    SHOWN,
    Network,
    Passage,
    Valve,
)
from damperfit.damper.quantity import DAMPER, GAS_AMOUNT, LOG, VISCOUS, Quantity
from damperfit.errors import ConfigurationError, did_you_mean
from damperfit.problem import Key

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence

    from numpy.typing import ArrayLike, NDArray

    from damperfit.damper.model import Ranges, Values
    from damperfit.damper.valves import ValveCharacteristic
    from damperfit.recording import Trace

    FloatArray = NDArray[np.float64]

STROKES = ("rebound", "compression")
_OF_PISTON = {"gas_piston_diameter", "gas_length"}  # have no other damper
VALVE_RANGES = {name: bounds for name, bounds in RANGES.items() if name not in _OF_PISTON}

# Held unless freed: oil with its tube and a trace of air; the return check of a car's damper. What
# they are off by where nobody has measured them, of their logarithms, is 0.3; seals drag with up to
# 30 N s/m, none of which is known.
_OIL, _RETURN, _IGNORANCE, _DRAG_IGNORANCE = 1e9, 2.5e5, 0.3, 15.0
_RETURN_SLOPE = Quantity(
    "return_slope", "R_k", "return checks", "resistance of the return checks", LINEAR, (1e2, 1e10),
    scope=DAMPER, default=_RETURN, power=6, shown_unit="10⁶ N s / (m² kg)", ignorance=_IGNORANCE,
    role=VISCOUS, stroke="return", part="slope", idle="below",
)  # fmt: skip
_FREE_GAS = Quantity(
    "free_gas", "phi", "free gas", "share of the oil's volume that is gas at rest", "1",
    (1e-6, 0.3), scope=DAMPER, default=0.0, may_vanish=True, power=-2, shown_unit="%",
    believable=(0.0, 0.05), belief="oil that was filled with care holds less than 5 %", ideal=0.0,
    idle="below",
)  # fmt: skip
_DRAG = Quantity(
    "drag", "c", "drag of the seals", "force of the seals by the speed", "N s/m", (1e-2, 1e5),
    scope=DAMPER, default=0.0, may_vanish=True, shown_unit="N s/m", ignorance=_DRAG_IGNORANCE,
    role=VISCOUS, idle="below",
)  # fmt: skip
# At x = 0; what is declared is held.
_GAS = (
    Quantity(
        "gas_pressure", "P_0", "gas pressure", "absolute pressure of the gas at x = 0", "Pa",
        RANGES["gas_pressure"][:2], scope=DAMPER, power=5, shown_unit="bar", is_absolute=True,
    ),
    Quantity(
        "gas_volume", "V_g", "gas volume", "volume of the gas at x = 0", "m3",
        RANGES["gas_volume"][:2], scope=DAMPER, power=-6, shown_unit="cm³", role=GAS_AMOUNT,
    ),
    Quantity(
        "gas_exponent", "gamma", "gas exponent", "polytropic exponent of the gas", "1", (0.5, 3.0),
        scope=DAMPER, believable=(0.95, 1.75), belief="gases have 1.0 (slow) to 1.67",
    ),
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class ValveDamper(Cylinder):
    """Geometry, oil, gas, valves and mounting of a damper with real valves; SI."""

    rod_diameter: float = 0.012
    piston_diameter: float = 0.03
    chamber_1_length: float = 0.09  # of the oil at x = 0
    chamber_2_length: float = 0.09
    oil_density: float = 850.0
    gas_pressure: float = 5e5  # absolute, at x = 0
    gas_volume: float = 3e-5  # the same
    gas_exponent: float = 1.3
    ambient_pressure: float = AMBIENT  # on the rod
    rebound: Valve = Valve()
    compression: Valve = Valve()
    mounting: Mounting = Mounting()
    friction: Friction = Friction()  # what there is beside Coulomb's

    ranges: ClassVar[Ranges] = VALVE_RANGES
    # Openings and play. What promises less moves nothing by much more than a tenth of its error.
    kinks: ClassVar[float] = 2e-5
    determined_together: ClassVar[tuple[tuple[str, ...], ...]] = tuple(
        tuple(f"{stroke}_{part}" for part in BLOW_OFF_PARTS) for stroke in STROKES
    )
    # Chambers that the rebound valve and that of compression join.
    ways: ClassVar[tuple[tuple[int, int], tuple[int, int]]]
    # Areas that press oil through them, and that draw it through their returns in rebound and bump:
    # that costs force by the speed. A floating piston keeps chamber 2 full without returns.
    pressed: ClassVar[tuple[str, str]]
    filled: ClassVar[tuple[str, str] | None] = None

    @property
    def network(self) -> Network:
        """Its passages."""
        return _network(self)

    def _passages(self) -> Network:
        """The passages of its valves: each with a return beside it, unless a piston floats."""
        has_returns, passages = self.filled is not None, list[Passage]()
        for stroke, (start, end) in zip(STROKES, self.ways, strict=True):
            valve: Valve = getattr(self, stroke)
            passages += valve.passages(start, end, stroke, is_two_way=has_returns)
            passages += [Passage(end, start, resistance="return_slope")] * has_returns
        return Network(self.name, tuple(passages), has_floating_piston=not has_returns)

    @property
    def pressed_areas(self) -> tuple[float, float]:
        """What presses oil through the rebound valve and through that of compression, m2."""
        rebound, compression = self.pressed
        return getattr(self, rebound), getattr(self, compression)

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """The valves' numbers, oil, friction, mounting, offset."""
        return _quantities(self)

    @property
    def parts(self) -> dict[str, tuple[str, ...]]:
        """What each valve is made of: "rebound", "rebound.bleed", "rebound.blow_off"."""
        words: dict[str, tuple[str, ...]] = {}
        for stroke in STROKES:
            names = words[stroke] = tuple(n for n in self.names if n.startswith(f"{stroke}_"))
            for group in ("bleed", "blow_off"):
                own = (q for q in self.quantities if q.stroke == stroke and q.group == group)
                words[f"{stroke}.{group}"] = tuple(q.name for q in own)
            words |= {n.replace("_", ".", 1): (n,) for n in names if not n.endswith("_bleed")}
        return {word: names for word, names in words.items() if names}

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

    name = "twin_tube"
    title = "twin tube: piston valve and base valve"
    ways = ((1, 2), (2, 3))
    pressed = ("annulus_area", "rod_area")  # in bump the rod's oil leaves through the base valve
    filled = ("rod_area", "annulus_area")


@dataclass(frozen=True, slots=True)
class Monotube(ValveDamper):
    """A piston with a valve for each stroke, and a floating piston between oil and gas."""

    name = "monotube"
    title = "monotube: a piston valve for each stroke, floating piston"
    ways = ((1, 2), (2, 1))
    pressed = ("annulus_area", "annulus_area")  # chamber 2 stays at the gas pressure


@dataclass(frozen=True, slots=True)
class ThroughFlow(ValveDamper):
    """A solid piston that presses through a valve for each stroke to the reservoir."""

    name = "through_flow"
    title = "through flow: solid piston, a valve for each stroke to the reservoir"
    ways = ((1, 3), (2, 3))
    pressed = ("annulus_area", "piston_area")
    filled = ("piston_area", "annulus_area")


# A fit asks for both at every simulation.
@lru_cache(maxsize=64)
def _network(damper: ValveDamper) -> Network:
    return replace(damper._passages(), ambient_pressure=damper.ambient_pressure)  # noqa: SLF001


@lru_cache(maxsize=64)
def _quantities(damper: ValveDamper) -> tuple[Quantity, ...]:
    names = damper.network.passage_numbers
    is_rigid = damper.mounting.series_stiffness == NONE
    return (
        *(_of_valve(name, names) for name in names if name != "return_slope"),
        *([_RETURN_SLOPE] if "return_slope" in names else []),
        *(replace(of_gas, default=getattr(damper, of_gas.name)) for of_gas in _GAS),
        replace(K_E, scope=DAMPER, default=None if is_rigid else _OIL, ignorance=_IGNORANCE),
        _FREE_GAS,
        F_F,
        _DRAG,
        *damper.friction.quantities,
        *damper.mounting.quantities,
        replace(F_0, scope=LOG),
    )


def _of_valve(name: str, names: Collection[str]) -> Quantity:
    stroke, _, part = name.rpartition("_")
    law = PARTS[part]
    idle = law.idle
    if part == "bleed" and f"{stroke}_leak" in names:
        idle = "above below"  # wide open, all of its pressure is the laminar share's
    if part == "leak" and f"{stroke}_bleed" not in names:  # all that the bleed has
        idle = "above"
    power, shown_unit = SHOWN.get(law.unit, (0, ""))
    return Quantity(
        name, f"{law.symbol}_{stroke[0]}", f"{stroke} {law.label}",
        f"{stroke} valve: {law.meaning}", law.unit, law.plausible, power=power,
        shown_unit=shown_unit, role=VISCOUS if law.unit == LINEAR else "", stroke=stroke,
        part=part, group="blow_off" if part in BLOW_OFF_PARTS else "bleed",
        area_power=law.area_power, idle=idle,
    )  # fmt: skip


# The numbers of each law of a declared passage.
LAWS: dict[str, tuple[str, ...]] = {
    law: parts for law, parts in (BLEEDS | {"check": ("slope",)} | BLOW_OFFS).items() if parts
}
_KEYS = {"from": "start", "to": "end", "name": "name", "law": "law", "two_way": "is_two_way"}
_STROKE_OF = dict(enumerate(STROKES, start=1))


class DeclaredPassage(NamedTuple):
    """One passage."""

    start: int  # chambers; ``from`` and ``to`` in TOML
    end: int
    name: str  # its numbers are called after it
    law: str  # a name of `LAWS`
    is_two_way: bool = False  # whether the law holds backwards too; ``two_way`` in TOML

    @property
    def passage(self) -> Passage:
        """As the network has it."""
        return Passage.of_parts(
            self.start, self.end, self.name, LAWS[self.law], is_two_way=self.is_two_way
        )

    @property
    def table(self) -> dict[str, Any]:
        """As it stands in TOML."""
        return dict(zip(_KEYS, self, strict=True))


def declared_passages(tables: Iterable[Mapping[str, Any]]) -> tuple[DeclaredPassage, ...]:
    """Return the passages that a configuration declares; refuses the first that is none."""
    passages = []
    for place, table in enumerate(tables, start=1):
        for code, fault in _faults(table):
            raise ConfigurationError(f"passage {place}: {fault}", subject="passages", code=code)
        passages.append(DeclaredPassage(**{_KEYS[key]: number for key, number in table.items()}))
    return tuple(passages)


def _faults(table: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Code and text of what is wrong with a declared passage; only the first is good for any."""
    for key in (key for key in table if key not in _KEYS):
        known = f"there are {', '.join(_KEYS)}.{did_you_mean(key, _KEYS)}"
        yield "unknown-key", f"no key {key!r}; {known}"
    if missing := [key for key in _KEYS if key not in table and key != "two_way"]:
        yield "missing-key", f"lacks {', '.join(missing)}"
    law, name, two_way = table["law"], table["name"], table.get("two_way", False)
    for key in ("from", "to"):
        if table[key] not in (1, 2, 3) or isinstance(table[key], bool | float):
            wanted = "expected chamber 1 (rod side), 2 (full bore) or 3 (gas)"
            yield "bad-passage", f"{key} = {table[key]!r}; {wanted}"
    if table["from"] == table["to"]:
        yield "bad-passage", f"leads from chamber {table['from']} to itself"
    if not isinstance(law, str) or law not in LAWS:
        known = f"there are {', '.join(LAWS)}.{did_you_mean(str(law), LAWS)}"
        yield "unknown-law", f"no law {law!r}; {known}"
    if not isinstance(name, str) or not re.fullmatch(r"[a-z][a-z0-9_]*", name):
        wanted = "expected small letters, digits and _, as in 'base_valve'"
        yield "bad-passage", f"name = {name!r}; {wanted}"
    if not isinstance(two_way, bool):
        yield "bad-passage", f"two_way = {two_way!r}; expected true or false"


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
    """A damper of any passages; geometry, oil, gas, mounting and friction as of the presets."""

    rebound: Valve = field(default=Valve(), init=False, repr=False)
    compression: Valve = field(default=Valve(), init=False, repr=False)
    passages: tuple[DeclaredPassage, ...] = _TWIN_TUBE  # sixteen at most
    # Chamber 2 is at the gas pressure: passages join 1 with it.
    floating_piston: bool = False

    name = "network"
    title = "network: passages declared one by one"

    def __post_init__(self) -> None:
        """Refuse what is no damper."""
        Cylinder.__post_init__(self)
        ends, code, fault = [{one.start, one.end} for one in self.passages], "bad-passage", ""
        if self.floating_piston and {2, 3} in ends:
            place = ends.index({2, 3}) + 1
            fault = f"passage {place} joins 2 and 3, which are one behind a floating piston"
        elif not any(1 in both for both in ends):
            code, fault = "no-passage", "none leads to or from chamber 1, the rod side"
        if fault:
            raise ConfigurationError(fault, where=Key(("passages",)), code=code)
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
        joins_both = any({one.start, one.end} == {1, 2} for one in self.passages)
        kind = Monotube if self.floating_piston else TwinTube if joins_both else ThroughFlow
        return kind(
            **{name: getattr(self, name) for name in (*VALVE_RANGES, "mounting", "friction")}
        )

    def start(self, traces: Sequence[Trace], fixed: Mapping[str, float]) -> tuple[Values, ...]:
        """Start from the valves of the preset that presses alike, shared out among the passages."""
        from damperfit.damper.valves import valve_points

        opens = {passage.start for passage in self.passages if passage.law in BLOW_OFFS}
        points: list[list[dict[str, float]]] = []
        for kind in (law for law in BLOW_OFFS if law not in {"none", "linear"}):
            pair = [Valve("long", kind if chamber in opens else "none") for chamber in _STROKE_OF]
            made = replace(self._preset, rebound=pair[0], compression=pair[1])
            points.append(valve_points(made, traces, fixed))
        alike = (ChainMap(*reversed(many)) for many in zip(*points, strict=True))
        return tuple(self._from_point(point, fixed) for point in alike)

    def _from_point(self, point: Mapping[str, float], fixed: Mapping[str, float]) -> Values:
        from damperfit.damper.valves import within_plausible

        valves = [p for p in self.passages if p.law != "check" and p.start in _STROKE_OF]
        beside = Counter((p.start, p.law in BLOW_OFFS) for p in valves)
        own = dict(point)
        for passage in self.passages:
            for part in LAWS[passage.law]:
                number = PARTS[part].elsewhere
                if passage in valves:
                    # Passages beside each other share the flow, at one pressure.
                    is_flow = PARTS[part].unit in {ROOT, LINEAR}
                    n = beside[passage.start, passage.law in BLOW_OFFS] if is_flow else 1
                    number = n * point[f"{_STROKE_OF[passage.start]}_{part}"]
                own[f"{passage.name}_{part}"] = number
        return within_plausible(self, own, fixed)

    def valve_characteristics(
        self, values: Values, traces: Sequence[Trace]
    ) -> tuple[ValveCharacteristic, ...]:
        """Return none: which passage a stroke presses is not said."""
        del values, traces
        return ()
