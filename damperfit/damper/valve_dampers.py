"""Dampers of real valves: a bleed and a preloaded blow-off in each stroke; how they are mounted.

Three layouts, of the passages of `damperfit.damper.network`::

    twin_tube      rod | 1 ==piston valve== 2 ==base valve== gas    also a monotube with base valve
    monotube       rod | 1 ==piston valve== 2 | floating piston | gas
    through_flow   rod | 1 ==rebound valve== gas ==compression valve== 2         solid piston,
                   piggyback or remote reservoir, adjusters for each stroke

Each valve has a bleed that is always open and a blow-off that opens at p_open, D = p_open + R w;
its return check closes in its own stroke. What such logs cannot determine is held unless it is
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

import math
import re
from collections import ChainMap, Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import product
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from damperfit.arrays import FloatArray
from damperfit.damper.cylinder import AMBIENT, F_0, F_F, K_E, RANGES, Cylinder
from damperfit.damper.model import DAMPER, GAS_AMOUNT, LOG, VISCOUS, Model, Quantity
from damperfit.damper.mounting import NONE, OF_LOAD_CELL, Friction, Mounting, before_load_cell
from damperfit.damper.network import (
    BLEEDS,
    BLOW_OFF_PARTS,
    BLOW_OFFS,
    LINEAR,
    PARTS,
    ROOT,
    SHOWN,
    Kind,
    Network,
    Passage,
    Valve,
    law_flow,
)
from damperfit.errors import ConfigurationError, did_you_mean
from damperfit.problem import Key

if TYPE_CHECKING:
    from damperfit.damper.model import Ranges, Values
    from damperfit.recording import Trace


STROKES = ("rebound", "compression")
_OF_PISTON = {"gas_piston_diameter", "gas_length"}  # have no other damper
VALVE_RANGES = {name: bounds for name, bounds in RANGES.items() if name not in _OF_PISTON}

# Held unless freed: oil with its tube and a trace of air; the return check of a car's damper. What
# they are off by if not measured, of their logarithms, is 0.3; seals drag with up to
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
    procedures: ClassVar[tuple[str, ...]] = ("joint", "plain")  # a damper has one friction
    # Openings and play. What promises less moves nothing by much more than a tenth of its error.
    kinks: ClassVar[float] = 2e-5
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
        """Areas that press oil through the rebound and the compression valve, m2."""
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
            f"{self.oil_density:g} kg/m3; {self.valves_in_words}"
        )

    @property
    def valves_in_words(self) -> str:
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

    def start(
        self,
        traces: Sequence[Trace],
        fixed: Mapping[str, float],
        readings: Sequence[ValveReading] = (),
    ) -> tuple[Values, ...]:
        """Start from the valves as the loops show them, by `read_loops` where that is known."""
        points = valve_points(self, traces, fixed, readings)
        return tuple(within_plausible(self, point, fixed) for point in points)

    def valve_characteristics(
        self, values: Values, traces: Sequence[Trace]
    ) -> tuple[ValveCharacteristic, ...]:
        """Return the valves by the logs of a setting; one that these hardly press is left out."""
        numbers = dict(values)
        of_cell = {name: numbers[name] for name in OF_LOAD_CELL if name in numbers}
        loops = [
            loop_of(before_load_cell(trace, **of_cell), self.rest_force(trace.displacement))
            for trace in traces
        ]
        both = [Side(side.area, side.drag + numbers["drag"]) for side in _sides(self, numbers)]
        reading = read_valves(loops, *both, offset=numbers["f_0"], friction=numbers["f_f"])
        read = []
        for stroke, side in zip(STROKES, both, strict=True):
            curve: ValveCurve = getattr(reading, stroke)
            valve: Valve = getattr(self, stroke)
            if curve.highest <= 0.0:
                continue
            own = {part: numbers[f"{stroke}_{part}"] for part in valve.parts}
            # A bleed rises steeply from nothing: most points stand there.
            drop = curve.highest * np.linspace(0.0, 1.0, _POINTS) ** 2
            opening = own.get("opening")
            if opening is not None and opening < curve.highest:
                drop = np.sort(np.append(drop, opening))
            read.append(
                ValveCharacteristic(
                    stroke="bump" if stroke == "compression" else stroke,
                    area=side.area,
                    drop=curve.drop,
                    flow=curve.flow,
                    law_drop=drop,
                    law_flow=law_flow(own, drop, self.oil_density),
                    opening=opening,
                )
            )
        return tuple(read)


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
    unfelt = ("chamber_2_length",)


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
_KINDS = BLEEDS | {"check": Kind(("slope",))} | BLOW_OFFS
LAWS: dict[str, tuple[str, ...]] = {law: kind.parts for law, kind in _KINDS.items() if kind.parts}
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
        ends, code, fault = [{p.start, p.end} for p in self.passages], "bad-passage", ""
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
    def valves_in_words(self) -> str:
        """Its passages in words."""
        return ", ".join(
            f"{p.start} to {p.end}{' and back' * p.is_two_way} {p.name} ({p.law})"
            for p in self.passages
        )

    @property
    def _preset(self) -> ValveDamper:
        """The preset that presses alike: from its loops the valves are read."""
        joins_both = any({passage.start, passage.end} == {1, 2} for passage in self.passages)
        kind = Monotube if self.floating_piston else TwinTube if joins_both else ThroughFlow
        return kind(
            **{name: getattr(self, name) for name in (*VALVE_RANGES, "mounting", "friction")}
        )

    def start(
        self,
        traces: Sequence[Trace],
        fixed: Mapping[str, float],
        readings: Sequence[ValveReading] = (),
    ) -> tuple[Values, ...]:
        """Start from the valves of the preset that presses alike, shared out among the passages."""
        del readings  # of its own preset
        opens = {passage.start for passage in self.passages if passage.law in BLOW_OFFS}
        points: list[list[dict[str, float]]] = []
        for kind in (law for law in BLOW_OFFS if law not in {"none", "linear"}):
            pair = [Valve("long", kind if chamber in opens else "none") for chamber in _STROKE_OF]
            made = replace(self._preset, rebound=pair[0], compression=pair[1])
            points.append(valve_points(made, traces, fixed))
        alike = (ChainMap(*reversed(many)) for many in zip(*points, strict=True))
        return tuple(self._from_point(point, fixed) for point in alike)

    def _from_point(self, point: Mapping[str, float], fixed: Mapping[str, float]) -> Values:

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

    # Which passage a stroke presses is not said.
    valve_characteristics = Model.valve_characteristics


# Valves read off the loops: flow against pressure without a law of the valve, and what follows.
#
# In each stroke one valve is pressed through, by a piston of area a, so that its pressure is the
# force itself, D = f'/a with f' the force without gas, offset and friction. What the piston
# displaces goes through the valve or is taken up by what gives way (oil, hoses, rod ends: a
# compliance C)::
#
#     a |v| - C dD/dt = c sqrt(D) + sum_j c_j max(0, D - p_j)
#
# Non-negative least squares on a row of knees p_j gives all of them at once, without a start and
# without a second minimum. The left side against D is the valve's characteristic: a bleed is its
# root, a blow-off the knee where it turns upwards. Friction and offset are tried on a grid, which
# is made finer once about the best; beside a fit they are the fit's, as are moving mass, the lag
# of the force channel and the drag of the seals. Where the characteristic and the law part, the
# law is wrong. The readings, and guesses beside them, are where a fit of valves starts.

# Shares of half the force's range. Seals have 1 to 15 %; a tare is about the rod's gas force.
_FRICTIONS = (0.005, 0.02, 0.05, 0.1, 0.16)
_OFFSETS = (-0.3, -0.15, -0.05, 0.0, 0.05, 0.15, 0.3)
_FINER = (-0.5, -0.25, 0.0, 0.25, 0.5)  # of the distance to the grid's neighbours
# Rows a stroke and log; a few hundred fix sixteen numbers.
_ROWS = 500
_KNEES = 14
_LOWEST_KNEE, _HIGHEST_KNEE = 0.05, 0.95
_AT = np.geomspace(_LOWEST_KNEE, _HIGHEST_KNEE, _KNEES)
# Knees below this share of the largest D are the bleed's: they bend it towards a straight line.
_OPENING_FROM = 0.2
# Without a knee: a blow-off from three quarters of the largest D on, with a tenth of the flow.
_UNSEEN_OPENING, _UNSEEN_SHARE = 0.75, 0.1
# A port through which less of the largest flow could go, without an opening before it, is none.
_LEAST_PORT = 0.05

_POINTS = 120  # of a law's curve

# Openings tried beside those read, in shares of the largest pressure: rebound, compression.
_GUESSES = ((0.35, 0.35), (0.75, 0.35), (0.35, 0.75), (0.75, 0.75))
_HALF = 0.5  # of the flow at the opening goes through the bleed, in a guess
# A bleed never starts with less than this share of its stroke's flow, and a blow-off's conductance
# never with less than this share of what would carry all of it: what is absent at the start cannot
# be found by a minimisation.
_LEAST = 0.1
# A blow-off whose port was read off the loops: share of the port's pressure at the largest flow.
_BESIDE_A_PORT = 0.1
_FRICTION = 0.01  # of the force's standard deviation, at least
# What few logs show, where it is freed. A few steps from a turning speed of 1 mm/s do not show one
# of 18 mm/s, for friction that turns so early hardly changes with it.
_RARE = {
    "play": 3e-4, "lag": 5e-3, "moving_mass": 0.5, "drag": 10.0,
    "free_gas": 5e-3, "presliding": 3e-5, "breakaway": 10.0, "stribeck_speed": 0.02,
    "seal_area": 3e-6, "turning_speed": 1e-2, "rubber": 20.0, "rubber_bend": 3e-4,
}  # fmt: skip
# Offset, N, and share of half the force's range that is friction, at which the loops are read. Of
# themselves they take hardly any friction, with which a weak stroke is read wrong: seals have 3 to
# 8 %, at soft settings 15. Without an offset it is the one at which they fit best, but behind a
# nearly closed bleed the preload of one stroke passes for an offset, a fifth of the force.
_READ_AT = ((None, 0.05), (None, 0.025), (0.0, 0.05), (0.0, 0.025), (0.0, 0.15))
# Softest and stiffest mounting, N/m, and oil, Pa, that a start has.
_STIFFNESS, _OIL_VALVES = (5e4, 5e6), (5e7, 3e9)


class Side(NamedTuple):
    """The piston behind a valve."""

    area: float  # displaces the oil and carries the pressure, m2
    drag: float = 0.0  # force by the speed that other passages cost in this stroke, N s/m


class Loop(NamedTuple):
    """Samples of a log that are compared, without the gas's and the ambient pressure's force."""

    force: FloatArray  # shape (n,), N
    force_rate: FloatArray  # N/s
    velocity: FloatArray  # m/s


@dataclass(frozen=True, slots=True, eq=False)
class ValveCurve:
    """One valve as read off the loops."""

    drop: FloatArray  # shape (n,), D at the samples of its stroke, Pa
    flow: FloatArray  # a |v| - C dD/dt there, m3/s
    compliance: float  # C, m3/Pa
    root: float  # c, of the bleed, m3/(s sqrt(Pa))
    # p_open of the blow-off, Pa, and its conductance beyond, m3/(s Pa); without a knee a place to
    # start from.
    opening: float
    conductance: float

    @property
    def highest(self) -> float:
        """Largest pressure across the valve, Pa."""
        return float(np.max(self.drop))

    @property
    def ported(self) -> tuple[float, float, float] | None:
        """The same flow as that of a bleed and of a port behind the opening: c, p_open and c_p.

        a |v| - C dD/dt = c sqrt(D) + sum_j c_j sqrt(max(0, D - p_j)), c_p the sum of the c_j. None
        where no port shows.
        """
        knees = self.highest * _AT
        columns = np.sqrt(np.maximum(self.drop[:, None] - np.append(0.0, knees), 0.0))
        root, *roots = _nonnegative(columns, self.flow)[0]
        port = float(np.sum(roots))
        if not port * math.sqrt(self.highest) > _LEAST_PORT * float(self.flow.max()):
            return None
        return float(root), float(roots @ knees) / port, port


class ValveReading(NamedTuple):
    """Both valves, and the friction and offset, N, at which they explain the loops best."""

    rebound: ValveCurve
    compression: ValveCurve
    friction: float
    offset: float


def loop_of(trace: Trace, level: FloatArray) -> Loop:
    """Return the compared samples of a log.

    The level, shape (n,), N, is what gas and ambient pressure alone do to the force at its samples.
    """
    force = trace.force - level
    rate = np.gradient(force, trace.interval)
    at = np.arange(len(force))[trace.compared]
    at = at[:: max(1, len(at) // (4 * _ROWS))]
    return Loop(force[at], rate[at], trace.velocity[at])


def read_valves(
    loops: Sequence[Loop],
    rebound: Side,
    compression: Side,
    *,
    offset: float | None = None,
    friction: float | None = None,
) -> ValveReading:
    """Return both valves of a setting, with the friction and offset at which its logs fit best.

    Offset and friction are given where they are known, N. A loop shows little of the friction
    beside a blow-off.
    """
    whole = Loop(*map(np.concatenate, zip(*loops, strict=True)))
    half = 0.5 * float(np.ptp(whole.force))
    sides = ((1.0, rebound), (-1.0, compression))

    def misfit(at: tuple[float, float]) -> tuple[float, float, float]:
        """That of the flows, each stroke's in units of its own."""
        rows = [_rows(whole, sign, side, *at) for sign, side in sides]
        return (sum(math.inf if of is None else of.solve()[1] for of in rows), *at)

    def best_of(frictions: Sequence[float], offsets: Sequence[float]) -> tuple[float, float]:
        return min(map(misfit, product(frictions, offsets)))[1:]

    offsets = [half * share for share in _OFFSETS] if offset is None else [offset]
    frictions = [half * share for share in _FRICTIONS] if friction is None else [friction]
    best, width = best_of(frictions, offsets), np.array(_FINER)
    if friction is None:
        frictions = (best[0] * (1.0 + width)).tolist()
    if offset is None:
        offsets = (best[1] + 0.1 * half * width).tolist()
    best = best_of(frictions, offsets)
    curves = [_curve(whole, sign, side, *best) for sign, side in sides]
    return ValveReading(curves[0], curves[1], *best)


class _Rows(NamedTuple):
    """The linear system of one stroke."""

    drop: FloatArray
    drop_rate: FloatArray
    displaced: FloatArray
    knees: FloatArray

    def solve(self) -> tuple[FloatArray, float]:
        """Return C, c and the c_j, and the misfit as a share of the flow's mean square."""
        beyond = np.maximum(self.drop[:, None] - self.knees, 0.0)
        columns = np.column_stack([self.drop_rate, np.sqrt(self.drop), beyond])
        weights, rest = _nonnegative(columns, self.displaced)
        return weights, rest**2 / float(self.displaced @ self.displaced)


def _nonnegative(columns: FloatArray, flow: FloatArray) -> tuple[FloatArray, float]:
    """Non-negative least squares: what each column takes, and the length of what is left."""
    from scipy.optimize import nnls

    lengths = np.sqrt(np.maximum(np.einsum("ij,ij->j", columns, columns), 1e-300))
    columns /= lengths
    weights, rest = nnls(columns, flow)
    return weights / lengths, float(rest)


def _rows(loop: Loop, sign: float, side: Side, friction: float, offset: float) -> _Rows | None:
    """Return the rows of a stroke; None where it presses hardly anywhere."""
    moved = loop.force - offset - friction * np.sign(loop.velocity)
    drop = sign * moved / side.area - side.drag * np.maximum(sign * loop.velocity, 0.0) / side.area
    at = np.flatnonzero(drop > 0.0)
    at = at[:: max(1, len(at) // _ROWS)]
    if len(at) < 4 * _KNEES:
        return None
    drop = drop[at]
    rate, displaced = sign * loop.force_rate[at] / side.area, side.area * sign * loop.velocity[at]
    return _Rows(drop, rate, displaced, float(drop.max()) * _AT)


def _curve(loop: Loop, sign: float, side: Side, friction: float, offset: float) -> ValveCurve:
    """Return the valve of a stroke at a friction and offset."""
    rows = _rows(loop, sign, side, friction, offset)
    if rows is None:
        nothing = np.zeros(1)
        return ValveCurve(nothing, nothing, 0.0, 0.0, 0.0, 0.0)
    weights, _ = rows.solve()
    compliance, root, turns = weights[0], weights[1], weights[2:]
    knees, top = rows.knees, float(np.max(rows.drop))
    is_opening = knees > _OPENING_FROM * top
    conductance = float(turns[is_opening].sum())
    if conductance > 0.0:
        opening = float(turns[is_opening] @ knees[is_opening]) / conductance
    else:
        opening = _UNSEEN_OPENING * top
        flow = side.area * float(np.max(np.abs(loop.velocity)))
        conductance = _UNSEEN_SHARE * flow / (top - opening)
    # Up to the opening the lower knees are the bleed's too.
    low = float(turns[~is_opening] @ np.maximum(0.0, opening - knees[~is_opening]))
    return ValveCurve(
        drop=rows.drop,
        flow=rows.displaced - compliance * rows.drop_rate,
        compliance=float(compliance),
        root=float(root) + low / math.sqrt(opening),
        opening=opening,
        conductance=conductance,
    )


class ValveCharacteristic(NamedTuple):
    """One valve of a setting."""

    stroke: str  # "rebound" or "bump"
    area: float  # what presses oil through it, m2: a pressure times this is its force
    drop: FloatArray  # shape (n,), as measured, Pa
    flow: FloatArray  # shape (n,), m3/s
    law_drop: FloatArray  # shape (k,), the fitted law from nothing to the largest pressure measured
    law_flow: FloatArray
    opening: float | None  # p_open of its blow-off, Pa; None without one


def valve_points(
    damper: ValveDamper,
    traces: Sequence[Trace],
    fixed: Mapping[str, float],
    readings: Sequence[ValveReading] = (),
) -> list[dict[str, float]]:
    """Return where a fit of a setting may start, by name, that of the loops first.

    Whatever of it the damper has.
    """
    readings = readings or read_loops(damper, traces, fixed)
    speed = max(float(np.max(np.abs(t.velocity[t.compared]))) for t in traces)
    force = np.concatenate([trace.force[trace.compared] for trace in traces])
    least_friction = _FRICTION * float(np.std(force))
    area, length = damper.annulus_area, damper.chamber_1_length
    oil = length / (area * 1e9)  # what the oil alone gives, m/N

    def valves(reading: ValveReading, guess: Sequence[float | None]) -> dict[str, float]:
        numbers: dict[str, float] = {}
        for stroke, side, share in zip(STROKES, _sides(damper, {}), guess, strict=True):
            valve, curve = getattr(damper, stroke), getattr(reading, stroke)
            parts = _parts(valve, curve, side.area * speed, damper.oil_density, share)
            numbers |= {f"{stroke}_{part}": value for part, value in parts.items()}
        return numbers

    points = []
    for reading in readings:
        give = max(reading.rebound.compliance / area**2, 1e-12)
        stiffness = 1.0 / max(give - oil, 0.1 * give)
        beside = {
            "f_f": max(reading.friction, least_friction),
            "f_0": reading.offset,
            "k_e": float(np.clip(length / (area * give), *_OIL_VALVES)),
            "k_s": float(np.clip(stiffness, *_STIFFNESS)),
        }
        points.append(beside | _RARE | valves(reading, (None, None)))
    return points + [points[0] | valves(readings[0], guess) for guess in _GUESSES]


def read_loops(
    damper: ValveDamper, traces: Sequence[Trace], fixed: Mapping[str, float]
) -> list[ValveReading]:
    """Return the valves as the loops show them: the same for every kind of valve in a layout."""
    mass = damper.mounting.moving_mass
    known = 0.0 if isinstance(mass, str) else float(mass)
    loops = []
    for trace in traces:
        level = damper.filled_to(trace.gas_pressure).rest_force(trace.displacement)
        loops.append(loop_of(before_load_cell(trace, moving_mass=known), level))
    half = 0.5 * max(float(np.ptp(loop.force)) for loop in loops)
    at = ((fixed.get("f_0", offset), fixed.get("f_f", share * half)) for offset, share in _READ_AT)
    return [
        read_valves(loops, *_sides(damper, fixed), offset=offset, friction=friction)
        for offset, friction in dict.fromkeys(at)
    ]


def _sides(damper: ValveDamper, fixed: Mapping[str, float]) -> tuple[Side, Side]:
    """Return what presses through the rebound valve and through that of compression."""
    drags = [0.0, 0.0]
    if damper.filled is not None:
        resistance = fixed.get("return_slope", damper.quantity("return_slope").default or 0.0)
        by_area = resistance * damper.oil_density
        drags = [by_area * getattr(damper, area) ** 2 for area in damper.filled]
    rebound, compression = map(Side, damper.pressed_areas, drags)
    return rebound, compression


def _parts(
    valve: Valve, curve: ValveCurve, most: float, density: float, share: float | None
) -> dict[str, float]:
    """Return the numbers of a valve's parts; the largest flow is in m3/s."""
    top = max(curve.highest, 1e4)
    opening = curve.opening if share is None else share * top
    opening = min(max(opening, 0.02 * top), top)
    root, conductance = curve.root, curve.conductance
    if share is not None:
        root = _HALF * most / math.sqrt(opening)
        conductance = _HALF * most / max(top - opening, 0.1 * top)
    least_root = _LEAST * most / math.sqrt(top)
    if valve.blow_off == "none":  # the bleed carries all
        root, opening = most / math.sqrt(top), top
    elif valve.bleed == "none":
        conductance = most / max(top - opening, 0.1 * top)
    root, conductance = max(root, least_root), max(conductance, _LEAST * most / top)
    slope, flow = 1.0 / (density * conductance), density * most
    leak = math.sqrt(opening) / (density * root)
    own = {"bleed": 1.0 / (density * root), "leak": leak if valve.bleed == "leak" else 0.3 * leak}
    if valve.blow_off == "port" and share is None and (ported := curve.ported):
        through, opening, behind = ported
        own["bleed"] = 1.0 / (density * max(through, least_root))
        own["port"] = 1.0 / (density * behind)
        slope = _BESIDE_A_PORT * own["port"] ** 2 * density * most
    return {
        part: own[part] if part in own else PARTS[part].guess(opening, slope, top, flow)
        for part in valve.parts
    }


def within_plausible(
    damper: ValveDamper, point: Mapping[str, float], fixed: Mapping[str, float]
) -> Values:
    """Return values within the plausible ranges; what the damper has not is left out."""
    known = {q.name: q.default for q in damper.quantities if q.default is not None}
    for quantity in damper.quantities:
        if quantity.name in point:
            known[quantity.name] = float(np.clip(point[quantity.name], *quantity.plausible))
    own = {name: value for name, value in fixed.items() if name in damper.names}
    return damper.values(known | own)  # fixed also at 0, where a part is absent
