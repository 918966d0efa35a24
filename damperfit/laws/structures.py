"""Candidate structures of a damper on its mounting, and what is one move away from each.

The table of parts: each stroke's valve has a bleed and a blow-off of some kind, the mounting and
the friction have parts or not, and quantities that the model would hold may be free. A move adds,
removes or replaces one of them, in one stroke or in both.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from damperfit.damper.mounting import FIT, NONE
from damperfit.damper.network import BLEED_WORDS, BLOW_OFF_WORDS
from damperfit.laws.variants import (
    PARTS,
    RETURNS,
    STROKES,
    has_kinds_of_valves,
    in_words,
    of_oil,
    with_part,
    without_part,
)

if TYPE_CHECKING:
    from collections.abc import Iterator

    from damperfit.damper.network import Valve
    from damperfit.damper.valve_dampers import ValveDamper

__all__ = ["Structure", "moves"]

_FREED = (RETURNS, "drag", "gas_volume", "free_gas")


@dataclass(frozen=True, slots=True)
class Structure:
    """A damper, and what of it is fitted although the model has a default for it."""

    damper: ValveDamper
    freed: tuple[str, ...] = ()

    @property
    def title(self) -> str:
        """In words."""
        return in_words(self.damper, self.freed)

    @property
    def held(self) -> dict[str, float]:
        """What stays at its default."""
        known = ((one.name, one.default) for one in self.damper.quantities)
        return {name: x for name, x in known if x is not None and name not in self.freed}

    def laid_out(self, layout: ValveDamper) -> Structure:
        """Return the same parts in another layout, without what that has not."""
        names = ("rebound", "compression", "mounting", "friction")
        damper = replace(layout, **{name: getattr(self.damper, name) for name in names})
        return Structure(damper, tuple(name for name in self.freed if name in damper.names))


def moves(structure: Structure) -> dict[str, Structure]:
    """Return the structures that are one move away, by what was changed, in words."""
    found: dict[str, Structure] = {}
    seen = {(structure.damper, frozenset(structure.freed))}
    for words, other in _all_moves(structure):
        known = other.damper, frozenset(other.freed)
        if known not in seen:
            seen.add(known)
            found[words] = other
    return found


def _all_moves(structure: Structure) -> Iterator[tuple[str, Structure]]:
    damper, freed = structure.damper, structure.freed
    if has_kinds_of_valves(damper):
        for words, valves in _other_valves(damper):
            yield words, _without_lost(replace(damper, **valves), freed)
    for name, (_, _, said) in PARTS.items():
        less, more = without_part(damper, name), with_part(damper, name)
        if name == "play" and damper.mounting.series_stiffness == NONE:
            more = damper
        if less != damper:
            yield f"without {said}", _without_lost(less, freed)
        elif more != damper:
            yield f"with {said}", Structure(more, freed)
    mounting = damper.mounting
    if mounting.series_stiffness == FIT and mounting.play == NONE:
        rigid = replace(damper, mounting=replace(mounting, series_stiffness=NONE))
        yield "without elasticity of the mounting", _without_lost(rigid, freed)
    elif mounting.series_stiffness == NONE:
        elastic = replace(damper, mounting=replace(mounting, series_stiffness=FIT))
        yield "with elasticity of the mounting", Structure(elastic, freed)
    for name in (*_FREED, *of_oil(damper)):
        if name in freed:
            label = damper.quantity(name).label
            yield f"without {label}", Structure(damper, tuple(x for x in freed if x != name))
        elif name in damper.names and damper.quantity(name).default is not None:
            yield f"with {damper.quantity(name).label}", Structure(damper, (*freed, name))


def _other_valves(damper: ValveDamper) -> Iterator[tuple[str, dict[str, Any]]]:
    valves: dict[str, Valve] = {stroke: getattr(damper, stroke) for stroke in STROKES}
    for part, kinds in (("blow_off", BLOW_OFF_WORDS), ("bleed", BLEED_WORDS)):
        for kind, (_, words) in kinds.items():
            beside = "bleed" if part == "blow_off" else "blow_off"
            usable = {
                stroke: replace(one, **{part: kind})
                for stroke, one in valves.items()
                if getattr(one, part) != kind and (kind, getattr(one, beside)) != (NONE, NONE)
            }
            for stroke, one in usable.items():
                yield f"{words} in {STROKES[stroke]}", {stroke: one}
            if len(usable) == len(valves):
                yield f"{words} in both strokes", usable


def _without_lost(damper: ValveDamper, freed: tuple[str, ...]) -> Structure:
    """A structure with less; what it has no more, or has free anyway, is freed no longer."""
    left = (name for name in freed if name in damper.names)
    return Structure(
        damper, tuple(name for name in left if damper.quantity(name).default is not None)
    )
