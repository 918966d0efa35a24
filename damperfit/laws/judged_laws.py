"""What a search has tried, law by law, and the one that it took."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping

    from damperfit.laws.choosing import Tried

__all__ = ["JudgedLaw", "LawSearch"]


@dataclass(frozen=True, slots=True, eq=False)
class JudgedLaw:
    """One law that was tried.

    Attributes
    ----------
    tried : Tried
        The law with its fits.
    is_taken : bool
        Whether it was the law to go on from when it had been judged.
    reason : str
        Why, or why not, in one sentence.
    bic : float
        Against the law it was compared with, positive where it is for the larger; NaN for none.
    change : str
        What it has more or less than the law it was compared with, in words.
    gain : float
        MSE of the smaller of the two over that of the larger; NaN where it was compared with none.
    """

    tried: Tried
    is_taken: bool
    reason: str
    bic: float = math.nan
    change: str = ""
    gain: float = math.nan


@dataclass(frozen=True, slots=True, eq=False)
class LawSearch:
    """All laws tried, in their order, and the one to take.

    Attributes
    ----------
    laws : tuple of JudgedLaw
        As they were tried.
    chosen : Tried
        The law that the logs tell.
    n_eff : float
        Effective samples of all settings compared.
    alike : tuple of str
        Layouts that fit and predict hardly worse than the one that was taken.
    held_share : float
        Of their force that the logs hold down to a tenth of the speed, where they yield before they
        slide; NaN where they do not.
    is_held_by_some : bool
        Whether that is the most that a setting holds, and others do not yield.
    doubt : str
        What of the law of valves that was taken no damper has, where logs yield; empty for nothing.
    also : str
        What yields and tells the logs about as well as the law that was taken; empty for none.
    is_of_one_model : bool
        Whether the law was taken as one model, at all settings: what these have in common is equal.
    offsets : mapping of str to float
        By name of a log, N: by how much its force lies beside that of the other logs of its
        setting, whose offset is fitted. A cell is zeroed anew.
    """

    laws: tuple[JudgedLaw, ...]
    chosen: Tried
    n_eff: float
    alike: tuple[str, ...] = ()
    held_share: float = math.nan
    also: str = ""
    is_of_one_model: bool = False
    is_held_by_some: bool = False
    doubt: str = ""
    offsets: Mapping[str, float] = field(default_factory=dict)
