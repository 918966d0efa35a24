"""Parts of a damper's law that one model of all settings is offered, and how a damper gets them."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING

from damperfit.damper.mounting import NONE
from damperfit.laws.friction_at_rest import AT_REST
from damperfit.laws.variants import (
    LACKING,
    ONE_STROKE,
    PARTS,
    RETURNS,
    STROKES,
    of_oil,
    with_kind,
    with_part,
    without_part,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from damperfit.damper.valve_dampers import ValveDamper

__all__ = [
    "CommonPart",
    "beside_each_other",
    "bleeds_beside",
    "blow_off_kinds",
    "changed",
    "idle_parts",
    "in_place",
    "lacking_parts",
    "laminar_alone",
    "made_of",
    "other_parts",
    "stand_ins",
    "turning_kinds",
    "without_kinds",
]

_BLOW_OFFS = {
    "rounded": "a blow-off that lifts gradually",
    "lifting": "a blow-off that lifts further the harder it is pressed",
    "port": "a port behind the blow-off",
}
_TURNING = ("presliding", "turning_speed")
_BESIDE = ("play", "lag", "moving_mass", AT_REST, "seal_area")
_FREED = (RETURNS, "drag", "free_gas")
_GAS = "gas_volume"


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
    is_less : bool
        Whether it is a part of the law itself, which is taken out.
    """

    words: str
    put_into: Callable[[ValveDamper], ValveDamper] = field(compare=False)
    freed: tuple[str, ...] = ()
    is_less: bool = False


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


def laminar_alone(damper: ValveDamper) -> Iterator[CommonPart]:
    """Yield laminar bleeds in place of part-laminar ones.

    Parameters
    ----------
    damper : ValveDamper
        The law.
    """
    for stroke, word in STROKES.items():
        if getattr(damper, stroke).bleed == "long":
            alone = partial(with_kind, stroke=stroke, part="bleed", kind="leak")
            yield CommonPart(f"a laminar bleed in {word}", alone)


def idle_parts(core: ValveDamper, damper: ValveDamper) -> Iterator[CommonPart]:
    """Yield what a stroke may do without that has got a bleed to its blow-off, or the reverse.

    The one that it had may have stood for the other; so may a blow-off for another kind of bleed,
    and a bleed for another kind of blow-off.

    Parameters
    ----------
    core : ValveDamper
        The law without its parts.
    damper : ValveDamper
        The law with them.
    """
    for stroke, word in STROKES.items():
        had, has = getattr(core, stroke), getattr(damper, stroke)
        if NONE in {has.bleed, has.blow_off}:
            continue
        if had.bleed != has.bleed and had.blow_off != NONE:
            yield _taken_out(f"the blow-off in {word}")
        if had.blow_off != has.blow_off:
            yield _taken_out(f"the bleed in {word}")


def bleeds_beside(damper: ValveDamper) -> Iterator[CommonPart]:
    """Yield the bleeds that stand beside blow-offs, to be taken out.

    Parameters
    ----------
    damper : ValveDamper
        The law.
    """
    for stroke, word in STROKES.items():
        valve = getattr(damper, stroke)
        if NONE not in {valve.bleed, valve.blow_off}:
            yield _taken_out(f"the bleed in {word}")


def in_place(
    core: ValveDamper, freed: Sequence[str], parts: Sequence[CommonPart], new: CommonPart
) -> tuple[CommonPart, ...]:
    """Return parts with one that takes the place of others, and without what is nothing beside it.

    Parameters
    ----------
    core : ValveDamper
        The law without them.
    freed : sequence of str
        What of it is fitted although it has a default.
    parts : sequence of CommonPart
        What it has.
    new : CommonPart
        Another kind of a valve's part, or one that takes it out.
    """
    whole = made_of(core, freed, [*parts, new])
    rest = {one: [other for other in parts if other is not one] for one in parts}
    left = [one for one in parts if made_of(core, freed, [*rest[one], new]) != whole]
    return (*left, new)


def turning_kinds() -> list[CommonPart]:
    """Return the ways in which friction may turn, beside at once."""
    return [_of_damper(name) for name in _TURNING]


def stand_ins(
    core: ValveDamper, freed: Sequence[str], parts: Sequence[CommonPart]
) -> list[tuple[CommonPart, list[CommonPart], bool]]:
    """Return parts that may stand for others, these others, and whether they need fewer numbers.

    A kind of blow-off stands for another, friction that is larger at rest for what is supposed of
    oil and returns.

    Parameters
    ----------
    core : ValveDamper
        The law without its parts.
    freed : sequence of str
        What of it is fitted although it has a default.
    parts : sequence of CommonPart
        What it has.
    """
    has = made_of(core, freed, parts)[1]
    supposed = [one for one in (RETURNS, *_oil(core)) if one in core.names and one not in has]
    found = [
        (one, [_freed(core, name) for name in supposed], True)
        for one in parts
        if one == _of_damper(AT_REST)
    ]
    for stroke in STROKES:
        kinds = blow_off_kinds(stroke)
        found += [(one, [k for k in kinds if k != one], False) for one in parts if one in kinds]
    return found


def other_parts(damper: ValveDamper, freed: Sequence[str]) -> Iterator[CommonPart]:
    """Yield what may stand beside all else.

    Parameters
    ----------
    damper : ValveDamper
        The law.
    freed : sequence of str
        What of it is fitted although it has a default.
    """
    yield from map(_long, STROKES)
    yield from map(_of_damper, _BESIDE)
    for name in _may_be_freed(damper):
        if name not in freed:
            yield _freed(damper, name)


def without_kinds(
    damper: ValveDamper, freed: Sequence[str] = ()
) -> tuple[ValveDamper, tuple[CommonPart, ...]]:
    """Return a damper with plain blow-offs, Coulomb's friction, without play, lag or moving mass.

    Beside it what these had beyond, and what is fitted although it has a default. Numbers that are
    declared stay: they are no parts that the logs may do without.

    Parameters
    ----------
    damper : ValveDamper
        The law.
    freed : sequence of str
        What of it is fitted although it has a default.
    """
    own: list[CommonPart] = []
    for name in (*_TURNING, *_BESIDE):
        less = without_part(damper, name)
        if less != damper:
            own.append(_of_damper(name))
            damper = less
    for stroke in STROKES:
        kind = getattr(damper, stroke).blow_off
        if kind in _BLOW_OFFS:
            own.append(_blow_off(stroke, kind))
            damper = with_kind(damper, stroke, "blow_off", "linear")
    own += [_freed(damper, name) for name in (*_may_be_freed(damper), _GAS) if name in freed]
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


def changed(own: Sequence[CommonPart], parts: Sequence[CommonPart]) -> str:
    """Return with which parts, and without which, a law is another; nothing where it is not.

    Parameters
    ----------
    own : sequence of CommonPart
        That it had.
    parts : sequence of CommonPart
        That it has.
    """
    more = [one.words for one in parts if one not in own and not one.is_less]
    less = [one.words for one in own if one not in parts]
    less += [one.words for one in parts if one.is_less]
    return ", ".join(
        f"{word} {', '.join(said)}" for word, said in (("with", more), ("without", less)) if said
    )


def _blow_off(stroke: str, kind: str) -> CommonPart:
    words = f"{_BLOW_OFFS[kind]} in {STROKES[stroke]}"
    return CommonPart(words, partial(with_kind, stroke=stroke, part="blow_off", kind=kind))


def _long(stroke: str) -> CommonPart:
    words = f"a laminar part of the bleed in {STROKES[stroke]}"
    return CommonPart(words, partial(with_kind, stroke=stroke, part="bleed", kind="long"))


def _may_be_freed(damper: ValveDamper) -> list[str]:
    """What may be fitted although it has a default: held, soft oil is told as friction."""
    return [name for name in (*_FREED, *_oil(damper)) if name in damper.names]


def _oil(damper: ValveDamper) -> list[str]:
    return [name for name in of_oil(damper) if damper.quantity(name).default is not None]


def _freed(damper: ValveDamper, name: str) -> CommonPart:
    return CommonPart(damper.quantity(name).label, _as_it_is, (name,))


def _of_damper(name: str) -> CommonPart:
    return CommonPart(PARTS[name][2], partial(with_part, name=name))


def _taken_out(words: str) -> CommonPart:
    return CommonPart(words, partial(_without, words=words), is_less=True)


def _as_it_is(damper: ValveDamper) -> ValveDamper:
    return damper


def _without(damper: ValveDamper, words: str) -> ValveDamper:
    return ONE_STROKE[words][1](damper) or damper
