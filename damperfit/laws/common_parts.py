"""Parts of a damper's law that one model of all settings is offered, and how a damper gets them."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING

from damperfit.damper.mounting import FIT, NONE
from damperfit.damper.quantity import STIFFNESS
from damperfit.laws.variants import LACKING, PARTS, with_kind, with_part

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from damperfit.damper.valve_dampers import ValveDamper

__all__ = [
    "CommonPart",
    "beside_each_other",
    "blow_off_kinds",
    "lacking_parts",
    "laminar_alone",
    "made_of",
    "other_parts",
    "turning_kinds",
    "without_kinds",
]

_STROKES = {"rebound": "rebound", "compression": "bump"}
_BLOW_OFFS = {
    "rounded": "a blow-off that lifts gradually",
    "lifting": "a blow-off that lifts further the harder it is pressed",
    "port": "a port behind the blow-off",
}
_TURNING = ("presliding", "turning_speed")
_BESIDE = ("play", "lag", "breakaway", "seal_area")
_FREED = ("return_slope", "drag", "free_gas")


@dataclass(frozen=True, slots=True)
class CommonPart:
    """A part that a law may have.

    Attributes
    ----------
    words : str
        What it is called.
    put_into : callable
        From a damper to the same with the part; unchanged where it has that, or cannot have it.
    freed : tuple of str
        Quantities with a default that are fitted with it.
    """

    words: str
    put_into: Callable[[ValveDamper], ValveDamper] = field(compare=False)
    freed: tuple[str, ...] = ()


def blow_off_kinds(stroke: str) -> list[CommonPart]:
    """Return the kinds that a stroke's blow-off may have beside the plain one.

    Parameters
    ----------
    stroke : str
        "rebound" or "compression".
    """
    return [_blow_off(stroke, kind) for kind in _BLOW_OFFS]


def lacking_parts(damper: ValveDamper) -> list[CommonPart]:
    """Return the bleeds and blow-offs that a damper's valves lack.

    Parameters
    ----------
    damper : ValveDamper
        The law.
    """
    return [
        CommonPart(name, partial(with_part, name=name))
        for name in LACKING
        if with_part(damper, name) != damper
    ]


def laminar_alone(
    damper: ValveDamper, parts: Sequence[CommonPart], unseen: set[str]
) -> Iterator[tuple[CommonPart, tuple[CommonPart, ...]]]:
    """Yield laminar bleeds in place of part-laminar ones whose orifice no log tells.

    Parameters
    ----------
    damper : ValveDamper
        The law.
    parts : sequence of CommonPart
        That it has.
    unseen : set of str
        Numbers that no log tells.
    """
    for stroke, word in _STROKES.items():
        if getattr(damper, stroke).bleed == "long" and f"{stroke}_bleed" in unseen:
            alone = partial(with_kind, stroke=stroke, part="bleed", kind="leak")
            one = CommonPart(f"a laminar bleed in {word}", alone)
            yield one, (*(other for other in parts if other.words != _long(stroke).words), one)


def turning_kinds() -> list[CommonPart]:
    """Return the ways in which friction may turn, beside at once."""
    return [_of_damper(name) for name in _TURNING]


def other_parts(damper: ValveDamper, freed: Sequence[str]) -> Iterator[CommonPart]:
    """Yield what may stand beside all else.

    Parameters
    ----------
    damper : ValveDamper
        The law.
    freed : sequence of str
        What of it is fitted although it has a default.
    """
    yield from map(_long, _STROKES)
    yield from map(_of_damper, _BESIDE)
    # Oil that is softer than assumed is told as friction where its own number is held.
    oil = [one.name for one in damper.quantities if one.role == STIFFNESS]
    for name in (*_FREED, *oil):
        if name in damper.names and name not in freed:
            yield CommonPart(damper.quantity(name).label, _as_it_is, (name,))


def without_kinds(damper: ValveDamper) -> tuple[ValveDamper, tuple[CommonPart, ...]]:
    """Return a damper with plain blow-offs and Coulomb's friction, and what these had beyond.

    Numbers that are declared stay: they are no parts that the logs may do without.
    """
    own, rubs = [], damper.friction
    for name in (*_TURNING, "breakaway", "seal_area"):
        fields = PARTS[name][1]
        if FIT in {getattr(rubs, one) for one in fields}:
            own.append(_of_damper(name))
            rubs = replace(rubs, **dict.fromkeys(fields, NONE))
    damper = replace(damper, friction=rubs)
    for stroke in _STROKES:
        kind = getattr(damper, stroke).blow_off
        if kind in _BLOW_OFFS:
            own.append(_blow_off(stroke, kind))
            damper = with_kind(damper, stroke, "blow_off", "linear")
    return damper, tuple(own)


def beside_each_other(
    core: ValveDamper, freed: Sequence[str], parts: Sequence[CommonPart]
) -> tuple[CommonPart, ...]:
    """Return those of some parts that a damper has not yet, and can have beside those before.

    Parameters
    ----------
    core : ValveDamper
        Without them.
    freed : sequence of str
        What of it is fitted although it has a default.
    parts : sequence of CommonPart
        One after the other.
    """
    kept: list[CommonPart] = []
    for one in parts:
        if made_of(core, freed, [*kept, one]) != made_of(core, freed, kept):
            kept.append(one)
    return tuple(kept)


def made_of(
    core: ValveDamper, freed: Sequence[str], parts: Sequence[CommonPart]
) -> tuple[ValveDamper, tuple[str, ...]]:
    """Return a damper with some parts, and what of it is fitted although it has a default.

    Parameters
    ----------
    core : ValveDamper
        Without them.
    freed : sequence of str
        What of it is.
    parts : sequence of CommonPart
        One after the other.
    """
    names = list(freed)
    for one in parts:
        core = one.put_into(core)
        names += [name for name in one.freed if name in core.names and name not in names]
    return core, tuple(names)


def _blow_off(stroke: str, kind: str) -> CommonPart:
    words = f"{_BLOW_OFFS[kind]} in {_STROKES[stroke]}"
    return CommonPart(words, partial(with_kind, stroke=stroke, part="blow_off", kind=kind))


def _long(stroke: str) -> CommonPart:
    words = f"a laminar part of the bleed in {_STROKES[stroke]}"
    return CommonPart(words, partial(with_kind, stroke=stroke, part="bleed", kind="long"))


def _of_damper(name: str) -> CommonPart:
    return CommonPart(PARTS[name][2], partial(with_part, name=name))


def _as_it_is(damper: ValveDamper) -> ValveDamper:
    return damper
