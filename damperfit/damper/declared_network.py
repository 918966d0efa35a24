"""A damper that is no preset: its passages declared one by one.

Each passage leads from one chamber to another (1 rod side, 2 full bore, 3 gas) by one law, and has
a name after which its numbers are called; passages of one name share them::

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

import re
from collections import Counter
from dataclasses import asdict, dataclass, field, replace
from typing import TYPE_CHECKING, Any, ClassVar

from damperfit.damper.cylinder import Cylinder
from damperfit.damper.network import Network, Passage, Valve
from damperfit.damper.valve_dampers import Monotube, ThroughFlow, TwinTube, ValveDamper
from damperfit.errors import ConfigurationError, did_you_mean
from damperfit.problem import Key

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from damperfit.damper.model import Values
    from damperfit.damper.valve_characteristics import ValveCharacteristic
    from damperfit.recording import Trace

__all__ = ["LAWS", "DeclaredNetwork", "DeclaredPassage", "declared_passages"]

# The parts of each law, as network.Passage calls them.
LAWS: dict[str, dict[str, str]] = {
    "orifice": {"orifice": "bleed"},
    "leak": {"resistance": "leak"},
    "long": {"orifice": "bleed", "resistance": "leak"},
    "check": {"resistance": "slope"},
    "linear": {"opening": "opening", "resistance": "slope"},
    "port": {"opening": "opening", "resistance": "slope", "orifice": "port"},
    "rounded": {"opening": "opening", "resistance": "slope", "width": "width"},
    "lifting": {"opening": "opening", "resistance": "slope", "lift": "lift"},
}
_BLOW_OFFS = ("linear", "port", "rounded", "lifting")
_OF_PRESSURE = ("opening", "width", "lift")
_CHAMBERS = (1, 2, 3)
_KEYS = {"from": "start", "to": "end", "name": "name", "law": "law", "two_way": "is_two_way"}
_NAME = re.compile(r"[a-z][a-z0-9_]*")
# Where checks start, and what leads from the gas: as the return of a car's damper.
_ELSEWHERE = {
    "slope": 2.5e5, "leak": 2.5e5, "bleed": 1e4, "opening": 1e4, "port": 1e4, "width": 1e3,
    "lift": 1e-6,
}  # fmt: skip
_STROKES = {1: "rebound", 2: "compression"}


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
        numbers = {part: f"{self.name}_{said}" for part, said in LAWS[self.law].items()}
        return Passage(self.start, self.end, is_two_way=self.is_two_way, **numbers)

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
                f"{where} has no key {key!r}; there are {', '.join(_KEYS)}.{near}"
            )
    missing = [key for key in _KEYS if key not in table and key != "two_way"]
    if missing:
        raise ConfigurationError(f"{where} lacks {', '.join(missing)}")
    for key in ("from", "to"):
        if table[key] not in _CHAMBERS or isinstance(table[key], bool | float):
            raise ConfigurationError(
                f"{key} = {table[key]!r}; expected chamber 1 (rod side), 2 (full bore) or 3 (gas)",
                subject=where,
            )
    if table["from"] == table["to"]:
        raise ConfigurationError(f"{where} leads from chamber {table['from']} to itself")
    law, name, two_way = table["law"], table["name"], table.get("two_way", False)
    if not isinstance(law, str) or law not in LAWS:
        near = did_you_mean(str(law), LAWS)
        raise ConfigurationError(
            f"no law {law!r}; there are {', '.join(LAWS)}.{near}", subject=where
        )
    if not isinstance(name, str) or not _NAME.fullmatch(name):
        raise ConfigurationError(
            f"name = {name!r}; expected small letters, digits and _, as in 'base_valve'",
            subject=where,
        )
    if not isinstance(two_way, bool):
        raise ConfigurationError(f"two_way = {two_way!r}; expected true or false", subject=where)
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
                )
        if not any(1 in (one.start, one.end) for one in self.passages):
            raise ConfigurationError(
                "none leads to or from chamber 1, the rod side", where=Key(("passages",))
            )
        _ = self.network  # refuses too many

    @property
    def layout(self) -> Callable[[Valve, Valve], Network]:
        """The passages as they are declared."""
        passages = tuple(one.passage for one in self.passages)

        def declared(_rebound: Valve, _compression: Valve) -> Network:
            return Network(self.name, passages, has_floating_piston=self.floating_piston)

        return declared

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
        from damperfit.damper.valve_starts import valve_points

        preset = self._preset
        laws = {
            number: {one.law for one in self.passages if one.start == number} for number in _STROKES
        }
        found: dict[str, list[dict[str, float]]] = {}
        for kind in ("port", "rounded", "lifting"):
            valves = {
                stroke: Valve("long", kind if laws[number] & set(_BLOW_OFFS) else "none")
                for number, stroke in _STROKES.items()
            }
            made = replace(preset, rebound=valves["rebound"], compression=valves["compression"])
            found[kind] = valve_points(made, traces, fixed)
        alike = zip(*found.values(), strict=True)
        return tuple(self._from_point(a | b | c, fixed) for a, b, c in alike)

    def _from_point(self, point: Mapping[str, float], fixed: Mapping[str, float]) -> Values:
        from damperfit.damper.valve_starts import within_plausible

        valves = [one for one in self.passages if one.law != "check" and one.start in _STROKES]
        sharing = Counter((one.start, one.law in _BLOW_OFFS) for one in valves)
        own = dict(point)
        for one in self.passages:
            for part in LAWS[one.law].values():
                number = f"{one.name}_{part}"
                if one not in valves:
                    own[number] = _ELSEWHERE[part]
                    continue
                # Passages beside each other share the flow, at one pressure.
                n = 1 if part in _OF_PRESSURE else sharing[one.start, one.law in _BLOW_OFFS]
                own[number] = n * point[f"{_STROKES[one.start]}_{part}"]
        return within_plausible(self, own, fixed)

    def valve_characteristics(
        self,
        values: Values,  # noqa: ARG002
        traces: Sequence[Trace],  # noqa: ARG002
    ) -> tuple[ValveCharacteristic, ...]:
        """Return none: which passage a stroke presses is not said."""
        return ()
