"""Candidate structures of a damper on its mounting, what is one move away from each, their words.

The table of parts: each stroke's valve has a bleed and a blow-off of some kind, the mounting and
the friction have parts or not, and quantities that the model would hold may be free. A move adds,
removes or replaces one of them, in one stroke or in both.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from itertools import product
from typing import Any, cast

from damperfit.damper.model import STIFFNESS, Model
from damperfit.damper.mounting import FIT, NONE, Mounting
from damperfit.damper.network import BLEEDS, BLOW_OFFS, Valve
from damperfit.damper.rivals import Rival
from damperfit.damper.valve_dampers import STROKES as PLACES
from damperfit.damper.valve_dampers import Monotube, ThroughFlow, TwinTube, ValveDamper
from damperfit.identification.sharing import Follows

# Laws next to a law: with a part more or less, of another kind; each in a few words.

BOTH = Valve("orifice", "linear")
# Of a damper's valves, and what they are called.
STROKES = {"rebound": "rebound", "compression": "bump"}
# what a part of the mounting or of the friction is called, its fields, in words
PARTS = {
    "play": ("mounting", ("play",), "play"),
    "lag": ("mounting", ("lag",), "a lag of the force"),
    "moving_mass": ("mounting", ("moving_mass",), "a mass that moves with the load cell"),
    "rubber": ("mounting", ("rubber", "rubber_bend"), "rubber in the mounting"),
    "presliding": ("friction", ("presliding",), "friction that builds up over a distance"),
    "breakaway": ("friction", ("breakaway", "stribeck_speed"), "friction that is larger at rest"),
    "seal_area": ("friction", ("seal_area",), "friction by the pressure on the seal"),
    "turning_speed": ("friction", ("turning_speed",), "friction that reverses within a speed"),
    "elasticity": ("mounting", ("series_stiffness",), "elasticity of the mounting"),
}
_NOT_AT_FIRST = {"moving_mass", "rubber", "rubber_bend"}
# Friction turns over a distance or within a speed.
_TURNS = {"presliding": "turning_speed", "turning_speed": "presliding"}


def everything(declared: Mounting) -> Mounting:
    """All that a mounting may have is fitted; what was measured stays.

    A moving mass is not: at low frequencies it does nothing, and at a single one it looks like a
    softer gas spring.
    """
    names = (field.name for field in fields(declared) if field.name not in _NOT_AT_FIRST)
    known = {name: getattr(declared, name) for name in names}
    fitted = {name: FIT for name, value in known.items() if isinstance(value, str)}
    return replace(declared, **fitted)


def with_part(damper: ValveDamper, name: str) -> ValveDamper:
    """The damper with a part more of rig or friction; as it is where it has or cannot have it."""
    owner, names, _ = PARTS[name]
    own = getattr(damper, owner)
    more = {field: FIT for field in names if getattr(own, field) == NONE}
    is_loose = name in {"play", "rubber"} and damper.mounting.series_stiffness == NONE
    turns_already = name in _TURNS and getattr(damper.friction, _TURNS[name]) != NONE
    if is_loose or turns_already or not more:
        return damper
    return replace(damper, **{owner: replace(own, **more)})


def without_part(damper: ValveDamper, name: str) -> ValveDamper:
    """The damper without a part of rig or friction that is fitted; else as it is.

    What is declared of a part is there: a part with one number declared stays, and so does the
    elasticity beside play or rubber.
    """
    owner, names, _ = PARTS[name]
    own, mounting = getattr(damper, owner), damper.mounting
    is_needed = name == "elasticity" and not mounting.play == mounting.rubber == NONE
    if is_needed or {getattr(own, field) for field in names} != {FIT}:
        return damper
    less = replace(own, **dict.fromkeys(names, NONE))
    return replace(damper, **{owner: less})


def in_words(damper: Model, freed: Sequence[str] = ()) -> str:
    """Return a law in a few words.

    Examples
    --------
    >>> from damperfit.damper.valve_dampers import TwinTube
    >>> in_words(TwinTube(), ["k_e"])
    'twin tube: bleed and blow-off; elastic mounting; also bulk modulus of oil and chamber'
    """
    if damper.name == "purdy":
        return "the paper's model"
    if isinstance(damper, Rival):
        return damper.title
    law = cast("ValveDamper", damper)
    rebound, bump = _of_valve(law.rebound), _of_valve(law.compression)
    valves = rebound if rebound == bump else f"{rebound} in rebound, {bump} in compression"
    mounting = law.mounting
    parts = (
        ("elastic mounting", mounting.series_stiffness),
        ("play", mounting.play),
        ("rubber", mounting.rubber),
        ("lag", mounting.lag),
        ("moving mass", mounting.moving_mass),
    )
    rig = ", ".join(word for word, kind in parts if kind != NONE) or "rigid mounting"
    words = [f"{law.name.replace('_', ' ')}: {valves}", rig]
    words += [text for part, text in _FRICTION.items() if getattr(law.friction, part) != NONE]
    if freed:
        words.append("also " + ", ".join(law.quantity(name).label for name in freed))
    return "; ".join(words)


def _of_valve(valve: Valve) -> str:
    words = BLEEDS[valve.bleed].words, BLOW_OFFS[valve.blow_off].words
    return " and ".join(word for word in words if word)


_FRICTION = {part: text for part, (owner, _, text) in PARTS.items() if owner == "friction"}


# A stroke with only one of the two has the other in its place: neither may be missing meanwhile.
_INSTEAD = {
    "with a plain blow-off instead of a bleed": Valve(NONE, "linear"),
    "with an orifice instead of a blow-off": Valve("orifice", NONE),
    "with a laminar bleed instead of a blow-off": Valve("leak", NONE),
}
_GIVING = ("return_slope", "gas_volume", "free_gas")
_FREED = ("drag", *_GIVING)


@dataclass(frozen=True, slots=True)
class Structure:
    """A damper, and what of it is fitted although the model has a default for it.

    `ties` are adjusters that quantities follow, where not as by their scope.
    """

    damper: ValveDamper
    freed: tuple[str, ...] = ()
    ties: tuple[tuple[str, tuple[str, ...]], ...] = ()

    @property
    def title(self) -> str:
        """In words."""
        return in_words(self.damper, self.freed)

    @property
    def held(self) -> dict[str, float]:
        """What stays at its default."""
        known = ((quantity.name, quantity.default) for quantity in self.damper.quantities)
        return {name: x for name, x in known if x is not None and name not in self.freed}

    @property
    def free(self) -> tuple[str, ...]:
        """What is fitted at a setting."""
        held = self.held
        return tuple(name for name in self.damper.names if name not in held)

    @property
    def n_needless(self) -> int:
        """Parts that a damper or its rig may well be without."""
        parts = (name for name in PARTS if name != "elasticity")
        whole = sum(without_part(self.damper, name) != self.damper for name in parts)
        return whole + sum(self.damper.quantity(name).default == 0.0 for name in self.freed)

    def strokes_beside(self, other: Structure) -> Iterator[ValveDamper]:
        """Yield the other's damper with either valve of this one, where both differ."""
        strokes = {stroke: getattr(self.damper, stroke) for stroke in STROKES}
        if all(valve != getattr(other.damper, stroke) for stroke, valve in strokes.items()):
            for stroke, valve in strokes.items():
                yield replace(other.damper, **{stroke: valve})

    def laid_out(self, layout: ValveDamper) -> Structure:
        """Return the same parts in another layout, without what that has not."""
        names = ("rebound", "compression", "mounting", "friction")
        damper = replace(layout, **{name: getattr(self.damper, name) for name in names})
        freed = tuple(name for name in self.freed if name in damper.names)
        return Structure(damper, freed, self.ties)

    def ties_of(self, other: Structure) -> tuple[tuple[str, tuple[str, ...]], ...]:
        """Return the ties of another structure, without those of parts that this one has not."""
        own = {name for number in self.free for name in (number, self._beside(number))}
        return tuple(tie for tie in other.ties if tie[0] in own)

    def _beside(self, name: str) -> str:
        """What a number of a valve follows by default."""
        quantity = self.damper.quantity(name)
        return quantity.beside(_BESIDE.get(quantity.part, ""))

    def follows(self, by_scope: Follows) -> Follows:
        """Return what each free quantity follows: by its scope, but for what is tied or untied."""
        ties, names = dict(self.ties), self.free
        follows = {}
        for name in names:
            beside = ties.get(self._beside(name), by_scope.get(name, ()))
            follows[name] = ties.get(name, beside)
        return {name: adjusters for name, adjusters in follows.items() if adjusters}


# What a number of a valve follows where nothing is said of it: what that one is tied to.
_BESIDE = {"leak": "bleed"}


def moves(structure: Structure) -> dict[str, Structure]:
    """Return the structures that are one move away, by what was changed, in words."""
    candidates: dict[str, Structure] = {}
    seen = {(structure.damper, frozenset(structure.freed))}
    for words, other in _all_moves(structure):
        known = other.damper, frozenset(other.freed)
        if known not in seen:
            seen.add(known)
            candidates[words] = replace(other, ties=other.ties_of(structure))
    return candidates


def _all_moves(structure: Structure) -> Iterator[tuple[str, Structure]]:
    damper, freed = structure.damper, structure.freed
    # Those of a declared network are its passages.
    if all(field.init for field in fields(damper) if field.name in STROKES):
        for words, valves in _other_valves(damper):
            yield words, _without_lost(replace(damper, **valves), freed)
    for name, (_, _, text) in PARTS.items():
        less, more = without_part(damper, name), with_part(damper, name)
        if less != damper:
            yield f"without {text}", _without_lost(less, freed)
        elif more != damper:
            yield f"with {text}", Structure(more, freed)
    oil = [quantity.name for quantity in damper.quantities if quantity.role == STIFFNESS]
    for name in (*_FREED, *oil):
        if name in freed:
            label = damper.quantity(name).label
            yield f"without {label}", Structure(damper, tuple(x for x in freed if x != name))
        elif name in damper.names and damper.quantity(name).default is not None:
            yield f"with {damper.quantity(name).label}", Structure(damper, (*freed, name))


def exchanges(structure: Structure) -> Iterator[tuple[str, str, Structure]]:
    """Yield structures in which one thing that gives stands for another, and what both are called.

    The mounting, oil and chambers, the gas, and return checks that are late look alike.
    """
    damper, freed = structure.damper, structure.freed
    oil = next(quantity for quantity in damper.quantities if quantity.role == STIFFNESS)
    rigid, elastic = without_part(damper, "elasticity"), with_part(damper, "elasticity")
    *_, words = PARTS["elasticity"]
    if rigid != damper:
        yield words, oil.label, replace(_without_lost(rigid, freed), ties=structure.ties)
    elif elastic != damper:
        yield oil.label, words, Structure(elastic, freed, structure.ties)
    giving = [n for n in (oil.name, *_GIVING) if n in damper.names]
    known = [n for n in giving if n not in freed and damper.quantity(n).default is not None]
    for name, other in product([n for n in giving if n in freed], known):
        left = (*(n for n in freed if n != name), other)
        labels = damper.quantity(name).label, damper.quantity(other).label
        yield *labels, Structure(damper, left, structure.ties)


def _other_valves(damper: ValveDamper) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield other valves in each stroke that may have them, and in both."""
    for words, usable in _usable_valves(damper):
        for stroke, valve in usable.items():
            yield f"{words} in {STROKES[stroke]}", {stroke: valve}
        if len(usable) == len(STROKES):
            yield f"{words} in both strokes", usable


def _usable_valves(damper: ValveDamper) -> Iterator[tuple[str, dict[str, Valve]]]:
    """Yield each change of a valve in words, and what it makes of the strokes that allow it."""
    valves: dict[str, Valve] = {stroke: getattr(damper, stroke) for stroke in STROKES}
    for part, kinds in (("blow_off", BLOW_OFFS), ("bleed", BLEEDS)):
        for name, kind in kinds.items():
            beside = "bleed" if part == "blow_off" else "blow_off"
            usable = {
                stroke: replace(valve, **{part: name})
                for stroke, valve in valves.items()
                if getattr(valve, part) != name and (name, getattr(valve, beside)) != (NONE, NONE)
            }
            yield kind.change, usable
    for words, other in _INSTEAD.items():
        lost = "blow_off" if other.bleed == NONE else "bleed"
        yield words, {s: other for s, valve in valves.items() if getattr(valve, lost) == NONE}


def _without_lost(damper: ValveDamper, freed: tuple[str, ...]) -> Structure:
    """A structure with less; what it has no more, or has free anyway, is freed no longer."""
    left = (name for name in freed if name in damper.names)
    return Structure(
        damper, tuple(name for name in left if damper.quantity(name).default is not None)
    )


# The numbers of a valve in layouts that the logs cannot separate from the chosen one.
#
# A stroke's force is a pressure on an area, which is another one in another layout; what flows
# through the valve is that area times the speed::
#
#     f = A p_open + R rho A^2 v + (S rho)^2 A^3 v^2
#
# so that the same force has p_open as 1/A, R as 1/A^2 and S as A^-1.5. What returns and
# compliances add is left out: some per cent.

LAYOUTS: dict[str, type[ValveDamper]] = {
    kind.name: kind for kind in (TwinTube, Monotube, ThroughFlow)
}
_CALLED = {
    "twin_tube": "twin tube", "monotube": "monotube", "through_flow": "through-flow damper",
}  # fmt: skip


def times_in(layout: str, model: ValveDamper, name: str, power: float = 1.0) -> float:
    """Return a valve's number in another layout over that of the model, for the same force.

    1 for what is none of a valve. The slope of a blow-off by a power of its flow goes as
    A^-(1 + 1/power).
    """
    quantity = model.quantity(name)
    if quantity.stroke not in PLACES:
        return 1.0
    known = {field.name: getattr(model, field.name) for field in fields(model) if field.init}
    other = LAYOUTS[layout](**known)
    place = PLACES.index(quantity.stroke)
    area_power = quantity.area_power
    if quantity.part == "slope":
        area_power += 1.0 / power - 1.0
    return float((model.pressed_areas[place] / other.pressed_areas[place]) ** area_power)


def in_other_layouts(
    layouts: Sequence[str], model: Model, name: str
) -> Iterator[tuple[str, float]]:
    """Yield layouts, in words, where a valve's number is another one, and how many times that."""
    if not isinstance(model, ValveDamper):
        return
    for layout in layouts:
        times = times_in(layout, model, name)
        if times != 1.0:
            yield _CALLED[layout], times
