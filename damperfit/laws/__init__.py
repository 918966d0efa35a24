"""Which law the logs support: laws fitted alike, compared by evidence, and put into words.

A name is looked up when it is first used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from damperfit.laws.choosing import ENOUGH_PERCENT, Tried, Verdict, effective_samples, judged
    from damperfit.laws.ladder import climb
    from damperfit.laws.law_fit import UNDETERMINED, LawFit, SettingLogs, fit_law
    from damperfit.laws.open_questions import not_told_apart, undecided
    from damperfit.laws.physics import opening_force, physics_seen
    from damperfit.laws.rivalry import rank_rivals
    from damperfit.laws.rungs import Ladder, Rung
    from damperfit.laws.variants import in_words
    from damperfit.laws.yielding import yielding_seen

__all__ = [
    "ENOUGH_PERCENT",
    "UNDETERMINED",
    "Ladder",
    "LawFit",
    "Rung",
    "SettingLogs",
    "Tried",
    "Verdict",
    "climb",
    "effective_samples",
    "fit_law",
    "in_words",
    "judged",
    "not_told_apart",
    "opening_force",
    "physics_seen",
    "rank_rivals",
    "undecided",
    "yielding_seen",
]

_LATE = {
    "ENOUGH_PERCENT": "choosing",
    "Ladder": "rungs",
    "LawFit": "law_fit",
    "Rung": "rungs",
    "SettingLogs": "law_fit",
    "Tried": "choosing",
    "UNDETERMINED": "law_fit",
    "Verdict": "choosing",
    "climb": "ladder",
    "effective_samples": "choosing",
    "fit_law": "law_fit",
    "in_words": "variants",
    "judged": "choosing",
    "not_told_apart": "open_questions",
    "opening_force": "physics",
    "physics_seen": "physics",
    "rank_rivals": "rivalry",
    "undecided": "open_questions",
    "yielding_seen": "yielding",
}


def __getattr__(name: str) -> Any:
    if name not in _LATE:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f"{__name__}.{_LATE[name]}"), name)
