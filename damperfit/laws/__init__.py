"""Which law the logs support: laws fitted alike, compared by evidence, and told in words."""

from damperfit.laws.choosing import ENOUGH_PERCENT, Tried, Verdict, effective_samples, judged
from damperfit.laws.ladder import Ladder, Rung, climb
from damperfit.laws.law_fit import UNTOLD, LawFit, SettingLogs, fit_law
from damperfit.laws.open_questions import undecided
from damperfit.laws.physics import opening_force, physics_seen
from damperfit.laws.rivalry import rank_rivals
from damperfit.laws.variants import in_words

__all__ = [
    "ENOUGH_PERCENT",
    "UNTOLD",
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
    "opening_force",
    "physics_seen",
    "rank_rivals",
    "undecided",
]
