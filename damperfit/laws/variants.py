"""Laws next to a law: with a part more or less, of another kind; each in a few words."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, cast

from damperfit.damper.mounting import FIT, NONE, Mounting
from damperfit.damper.network import Valve
from damperfit.damper.quantity import STIFFNESS
from damperfit.damper.rivals import Rival

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from damperfit.damper.model import Model
    from damperfit.damper.valve_dampers import ValveDamper

__all__ = [
    "BLEED",
    "BLOW_OFF",
    "BOTH",
    "KINDS",
    "LACKING",
    "LAMINAR",
    "ONE_STROKE",
    "PARTS",
    "RETURNS",
    "SMALLER",
    "STROKES",
    "VALVES",
    "everything",
    "has_kinds_of_valves",
    "in_words",
    "laid_out_as",
    "of_kind",
    "of_oil",
    "with_kind",
    "with_part",
    "with_parts",
    "without",
    "without_part",
    "words_of",
]

RETURNS = "return_slope"
BLEED = Valve("orifice", "none")
BLOW_OFF = Valve("none", "linear")
BOTH = Valve("orifice", "linear")
LAMINAR = Valve("leak", "none")
# Of a damper's valves, and what they are called.
STROKES = {"rebound": "rebound", "compression": "bump"}
# kind: part of a valve that it takes the place of, what may have stood there, in words
KINDS: dict[str, tuple[str, tuple[str, ...], str]] = {
    "rounded": ("blow_off", ("linear",), "blow-offs that lift gradually"),
    "lifting": ("blow_off", ("linear",), "blow-offs that lift further the harder they are pressed"),
    "port": ("blow_off", ("linear",), "a port behind the blow-offs"),
    "long": ("bleed", ("orifice", "leak"), "bleeds with a laminar part"),
}
# What a stroke's valve may lack: the stroke, its part, and the kind that is offered.
LACKING = {
    "a blow-off in rebound": ("rebound", "blow_off", "linear"),
    "a blow-off in bump": ("compression", "blow_off", "linear"),
    "a bleed in rebound": ("rebound", "bleed", "orifice"),
    "a bleed in bump": ("compression", "bleed", "orifice"),
}
# what a part of the mounting or of the friction is called, its fields, in words
PARTS = {
    "play": ("mounting", ("play",), "play"),
    "lag": ("mounting", ("lag",), "a lag of the force"),
    "moving_mass": ("mounting", ("moving_mass",), "a mass that moves with the load cell"),
    "presliding": ("friction", ("presliding",), "friction that builds up over a distance"),
    "breakaway": ("friction", ("breakaway", "stribeck_speed"), "friction that is larger at rest"),
    "seal_area": ("friction", ("seal_area",), "friction by the pressure on the seal"),
    "turning_speed": ("friction", ("turning_speed",), "friction that turns within a speed"),
}
_NOT_AT_FIRST = {"moving_mass"}
# Friction turns over a distance or within a speed.
_TURNS = {"presliding": "turning_speed", "turning_speed": "presliding"}


def everything(declared: Mounting) -> Mounting:
    """All that a mounting may have is fitted; what was measured stays.

    A moving mass is not: at low frequencies it does nothing, and at a single one it looks like a
    softer gas spring.
    """
    names = (one.name for one in dataclasses.fields(declared) if one.name not in _NOT_AT_FIRST)
    known = {name: getattr(declared, name) for name in names}
    fitted = {name: FIT for name, value in known.items() if isinstance(value, str)}
    return dataclasses.replace(declared, **fitted)


def with_parts(damper: ValveDamper, valve: Valve, mounting: Mounting) -> ValveDamper:
    """Return the damper with the same valve in both strokes, and another mounting."""
    return dataclasses.replace(damper, rebound=valve, compression=valve, mounting=mounting)


def of_kind(damper: ValveDamper, part: str, old: str, new: str) -> ValveDamper:
    """The damper with another kind of a valve's part wherever it has the usual one."""
    valves = {
        stroke: dataclasses.replace(valve, **{part: new}) if getattr(valve, part) == old else valve
        for stroke, valve in (("rebound", damper.rebound), ("compression", damper.compression))
    }
    return dataclasses.replace(damper, rebound=valves["rebound"], compression=valves["compression"])


def with_part(damper: ValveDamper, name: str) -> ValveDamper:
    """The damper with another kind of a valve's part, or a part more of valve, rig or friction.

    It is the same where it has that already, or cannot have it.
    """
    if name in KINDS:
        part, known, _ = KINDS[name]
        for old in known:
            damper = of_kind(damper, part, old, name)
        return damper
    if name in LACKING:
        stroke, part, kind = LACKING[name]
        valve = getattr(damper, stroke)
        if getattr(valve, part) != "none":
            return damper
        return dataclasses.replace(damper, **{stroke: dataclasses.replace(valve, **{part: kind})})
    owner, fields, _ = PARTS[name]
    own = getattr(damper, owner)
    more = {one: FIT for one in fields if getattr(own, one) == NONE}
    is_loose = name == "play" and damper.mounting.series_stiffness == NONE
    turns_already = name in _TURNS and getattr(damper.friction, _TURNS[name]) != NONE
    if is_loose or turns_already or not more:
        return damper
    return dataclasses.replace(damper, **{owner: dataclasses.replace(own, **more)})


def has_kinds_of_valves(damper: ValveDamper) -> bool:
    """Whether its valves may be of other kinds: those of a declared network are its passages."""
    return all(one.init for one in dataclasses.fields(damper) if one.name in STROKES)


def of_oil(model: Model) -> list[str]:
    """The quantities of a model that say how stiff its oil is."""
    return [one.name for one in model.quantities if one.role == STIFFNESS]


def without_part(damper: ValveDamper, name: str) -> ValveDamper:
    """The damper without a part of rig or friction that is fitted; else as it is.

    What is declared of a part is there: a part with one number declared stays.
    """
    owner, fields, _ = PARTS.get(name, ("mounting", (), ""))
    own = getattr(damper, owner)
    if {getattr(own, one) for one in fields} != {FIT}:
        return damper
    less = dataclasses.replace(own, **dict.fromkeys(fields, NONE))
    return dataclasses.replace(damper, **{owner: less})


def with_kind(damper: ValveDamper, stroke: str, part: str, kind: str) -> ValveDamper:
    """The damper with another kind of one part of one stroke's valve, where it has that part."""
    valves = {"rebound": damper.rebound, "compression": damper.compression}
    if getattr(valves[stroke], part) == NONE:
        return damper
    valves[stroke] = dataclasses.replace(valves[stroke], **{part: kind})
    return dataclasses.replace(damper, rebound=valves["rebound"], compression=valves["compression"])


def laid_out_as(law: ValveDamper, layout: ValveDamper) -> ValveDamper:
    """Another layout with the valves, the mounting and the friction of a law."""
    names = ("rebound", "compression", "mounting", "friction")
    return dataclasses.replace(layout, **{name: getattr(law, name) for name in names})


def words_of(damper: ValveDamper, name: str) -> str:
    """Return what is offered to a law, in a few words."""
    known = {**KINDS, **PARTS}
    if name in LACKING:
        return name
    return known[name][2] if name in known else damper.quantity(name).label


def without(part: str) -> Callable[[ValveDamper], ValveDamper | None]:
    """Return what takes a part of the mounting out of a damper, where it is fitted there."""

    def smaller(damper: ValveDamper) -> ValveDamper | None:
        if getattr(damper.mounting, part) != FIT:
            return None
        return dataclasses.replace(
            damper, mounting=dataclasses.replace(damper.mounting, **{part: NONE})
        )

    return smaller


def _less(part: str) -> Callable[[ValveDamper], ValveDamper | None]:
    def smaller(damper: ValveDamper) -> ValveDamper | None:
        valves = {"rebound": damper.rebound, "compression": damper.compression}
        if any("none" in {one.bleed, one.blow_off} for one in valves.values()):
            return None
        less = {name: dataclasses.replace(one, **{part: "none"}) for name, one in valves.items()}
        return dataclasses.replace(damper, rebound=less["rebound"], compression=less["compression"])

    return smaller


# The valves first, while everything that a rig may have stands beside them.
SMALLER: dict[str, Callable[[ValveDamper], ValveDamper | None]] = {
    "blow-offs": _less("blow_off"),
    "bleeds": _less("bleed"),
    "lag": without("lag"),
    "play": without("play"),
}
VALVES = ("blow-offs", "bleeds")


def _lacking(stroke: str, part: str) -> Callable[[ValveDamper], ValveDamper | None]:
    def smaller(damper: ValveDamper) -> ValveDamper | None:
        valve = getattr(damper, stroke)
        if "none" in {valve.bleed, valve.blow_off}:
            return None
        less = dataclasses.replace(valve, **{part: "none"})
        return dataclasses.replace(damper, **{stroke: less})

    return smaller


def _rigid(damper: ValveDamper) -> ValveDamper | None:
    mounting = damper.mounting
    if mounting.series_stiffness != FIT or mounting.play != NONE:
        return None
    return dataclasses.replace(
        damper, mounting=dataclasses.replace(mounting, series_stiffness=NONE)
    )


# A part of one stroke's valve or of the mounting, and a quantity of it: asked for where no log
# tells that quantity.
ONE_STROKE: dict[str, tuple[tuple[str, ...], Callable[[ValveDamper], ValveDamper | None]]] = {
    "the blow-off in rebound": (
        ("rebound_opening", "rebound_slope"), _lacking("rebound", "blow_off"),
    ),
    "the blow-off in bump": (
        ("compression_opening", "compression_slope"), _lacking("compression", "blow_off"),
    ),
    "the bleed in rebound": (("rebound_bleed", "rebound_leak"), _lacking("rebound", "bleed")),
    "the bleed in bump": (
        ("compression_bleed", "compression_leak"), _lacking("compression", "bleed"),
    ),
    "elasticity of the mounting": (("k_s",), _rigid),
}  # fmt: skip


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
    valves = rebound if rebound == bump else f"{rebound} in rebound, {bump} in bump"
    words = [f"{law.name.replace('_', ' ')}: {valves}", _of_rig(law.mounting)]
    words += [said for part, said in _FRICTION.items() if getattr(law.friction, part) != NONE]
    if freed:
        words.append("also " + ", ".join(law.quantity(name).label for name in freed))
    return "; ".join(words)


def _of_valve(valve: Valve) -> str:
    blow_off = {"none": "", "linear": "blow-off"}.get(valve.blow_off, f"{valve.blow_off} blow-off")
    return " and ".join(word for word in (_BLEEDS[valve.bleed], blow_off) if word)


_BLEEDS = {"none": "", "orifice": "bleed", "leak": "laminar bleed", "long": "part-laminar bleed"}


_FRICTION = {part: said for part, (owner, _, said) in PARTS.items() if owner == "friction"}


def _of_rig(mounting: Mounting) -> str:
    parts = (
        ("elastic mounting", mounting.series_stiffness),
        ("play", mounting.play),
        ("lag", mounting.lag),
        ("moving mass", mounting.moving_mass),
    )
    return ", ".join(word for word, kind in parts if kind != NONE) or "rigid mounting"
