"""Which law the logs support: laws fitted alike, compared by evidence, and put into words.

A name is looked up when it is first used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from damperfit.laws.choosing import (
        ENOUGH_PERCENT,
        PREDICTED_PERCENT,
        Tried,
    )
    from damperfit.laws.judged_laws import JudgedLaw, LawSearch
    from damperfit.laws.law_fit import UNDETERMINED, LawFit, SettingLogs, fit_law
    from damperfit.laws.open_questions import interchangeable_parts, undecided
    from damperfit.laws.physics import opening_force, physics_seen, seen_again
    from damperfit.laws.rivalry import rank_rivals
    from damperfit.laws.search import search_laws
    from damperfit.laws.variants import in_words
    from damperfit.laws.yielding import yielding_seen

__all__ = [
    "ENOUGH_PERCENT",
    "PREDICTED_PERCENT",
    "UNDETERMINED",
    "JudgedLaw",
    "LawFit",
    "LawSearch",
    "SettingLogs",
    "Tried",
    "fit_law",
    "in_words",
    "interchangeable_parts",
    "opening_force",
    "physics_seen",
    "rank_rivals",
    "search_laws",
    "seen_again",
    "undecided",
    "yielding_seen",
]

_LATE = {
    "ENOUGH_PERCENT": "choosing",
    "PREDICTED_PERCENT": "choosing",
    "LawSearch": "judged_laws",
    "LawFit": "law_fit",
    "JudgedLaw": "judged_laws",
    "SettingLogs": "law_fit",
    "Tried": "choosing",
    "UNDETERMINED": "law_fit",
    "search_laws": "search",
    "fit_law": "law_fit",
    "in_words": "variants",
    "interchangeable_parts": "open_questions",
    "opening_force": "physics",
    "physics_seen": "physics",
    "rank_rivals": "rivalry",
    "seen_again": "physics",
    "undecided": "open_questions",
    "yielding_seen": "yielding",
}


def __getattr__(name: str) -> Any:
    if name not in _LATE:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f"{__name__}.{_LATE[name]}"), name)
