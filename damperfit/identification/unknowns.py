"""Whose a shared quantity is in a fit of all settings: an unknown for each value that it has.

A quantity of the damper or the rig is one unknown. One that follows an adjuster is as many as that
adjuster has clicks among the settings; one that follows several, as these have combinations.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from damperfit.tested.setting import Place, Setting

__all__ = ["Follows", "Unknown", "unknown_at", "unknowns_of"]

Follows: TypeAlias = "Mapping[str, tuple[str, ...]]"
"""Adjusters that a quantity follows; one that is not named is the damper's."""


@dataclass(frozen=True, slots=True)
class Unknown:
    """One number that settings have in common.

    Attributes
    ----------
    name : str
        Quantity.
    places : tuple of (str, Place)
        Where the adjusters stand that it follows; empty: it is the damper's.

    Examples
    --------
    >>> Unknown("r_m3").label, Unknown("rebound_bleed", (("low_speed", 6),)).label
    ('r_m3', 'rebound_bleed at low_speed 6')
    """

    name: str
    places: tuple[tuple[str, Place], ...] = ()

    @property
    def label(self) -> str:
        """For people and for mappings by name: of the damper's it is the name."""
        where = ", ".join(f"{adjuster} {place}" for adjuster, place in self.places)
        return f"{self.name} at {where}" if where else self.name

    def holds_at(self, setting: Setting) -> bool:
        """Whether a setting has it."""
        return all(setting.place(adjuster) == place for adjuster, place in self.places)


def unknown_at(name: str, follows: Follows, setting: Setting) -> Unknown:
    """Return the unknown that a quantity is at a setting."""
    return Unknown(name, tuple((one, setting.place(one)) for one in follows.get(name, ())))


def unknowns_of(
    names: Sequence[str], follows: Follows, settings: Iterable[Setting]
) -> tuple[Unknown, ...]:
    """Return the unknowns that shared quantities are at some settings, quantity by quantity.

    Examples
    --------
    >>> from damperfit.tested.setting import Setting
    >>> at = [Setting((("low", a), ("high", b))) for a in (6, 14) for b in (1, 3)]
    >>> [one.label for one in unknowns_of(["s", "k_s"], {"s": ("low",)}, at)]
    ['s at low 6', 's at low 14', 'k_s']
    """
    at = list(settings)
    return tuple(dict.fromkeys(unknown_at(name, follows, one) for name in names for one in at))
