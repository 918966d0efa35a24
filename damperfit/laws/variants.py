"""Laws next to a law: with a part more or less, of another kind; each in a few words."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, cast

from damperfit.damper.mounting import FIT, NONE, Mounting
from damperfit.damper.network import BLEED_WORDS, BLOW_OFF_WORDS, Valve
from damperfit.damper.quantity import STIFFNESS
from damperfit.damper.rivals import Rival

if TYPE_CHECKING:
    from collections.abc import Sequence

    from damperfit.damper.model import Model
    from damperfit.damper.valve_dampers import ValveDamper

__all__ = [
    "BOTH",
    "PARTS",
    "RETURNS",
    "STROKES",
    "everything",
    "has_kinds_of_valves",
    "in_words",
    "of_oil",
    "with_part",
    "with_parts",
    "without_part",
]

RETURNS = "return_slope"
BOTH = Valve("orifice", "linear")
# Of a damper's valves, and what they are called.
STROKES = {"rebound": "rebound", "compression": "bump"}
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


def with_part(damper: ValveDamper, name: str) -> ValveDamper:
    """The damper with a part more of rig or friction; as it is where it has or cannot have it."""
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
    words = BLEED_WORDS[valve.bleed][0], BLOW_OFF_WORDS[valve.blow_off][0]
    return " and ".join(word for word in words if word)


_FRICTION = {part: said for part, (owner, _, said) in PARTS.items() if owner == "friction"}


def _of_rig(mounting: Mounting) -> str:
    parts = (
        ("elastic mounting", mounting.series_stiffness),
        ("play", mounting.play),
        ("lag", mounting.lag),
        ("moving mass", mounting.moving_mass),
    )
    return ", ".join(word for word, kind in parts if kind != NONE) or "rigid mounting"
