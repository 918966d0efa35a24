"""Another way to a minimum."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from damperfit.damper.model import Values

__all__ = ["Detour"]


@dataclass(frozen=True, slots=True)
class Detour:
    """Another way to a minimum, for a fit that has ended in a wrong valley.

    Attributes
    ----------
    start : Values
        Where it begins.
    held : tuple of frozenset of str
        Quantities that rough descents hold, one after the other, before all are free.
    is_last_resort : bool
        Taken only where what came before is neither sound nor explained; it must then be clearly
        better. Otherwise it is always taken, and a sound end is preferred.
    """

    start: Values
    held: tuple[frozenset[str], ...]
    is_last_resort: bool = False
