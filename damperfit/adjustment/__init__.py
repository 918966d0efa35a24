"""What shows only across settings: trends, settings off them, clicks, the setting for a force.

A name is looked up when it is first used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from damperfit.adjustment.across_settings import Adjustment, compare_settings
    from damperfit.adjustment.click_changes import Click, clicks
    from damperfit.adjustment.forces import Sine, fastest_sine, levels, named_speeds, sine_of
    from damperfit.adjustment.level import STROKES, Level, offset_sentence, said_offsets
    from damperfit.adjustment.measured import beside_measured, credible_forces
    from damperfit.adjustment.stage import Stage, has_lost_errors, stage_of
    from damperfit.adjustment.trend_words import in_few_words
    from damperfit.adjustment.trends import Outlier, Trend, TrendPoint, find_trends
    from damperfit.adjustment.wanted import Answer, Wanted, which_setting

__all__ = [
    "STROKES",
    "Adjustment",
    "Answer",
    "Click",
    "Level",
    "Outlier",
    "Sine",
    "Stage",
    "Trend",
    "TrendPoint",
    "Wanted",
    "beside_measured",
    "clicks",
    "compare_settings",
    "credible_forces",
    "fastest_sine",
    "find_trends",
    "has_lost_errors",
    "in_few_words",
    "levels",
    "named_speeds",
    "offset_sentence",
    "said_offsets",
    "sine_of",
    "stage_of",
    "which_setting",
]

_LATE = {
    "Adjustment": "across_settings",
    "Answer": "wanted",
    "Click": "click_changes",
    "Level": "level",
    "Outlier": "trends",
    "STROKES": "level",
    "Sine": "forces",
    "Stage": "stage",
    "Trend": "trends",
    "TrendPoint": "trends",
    "Wanted": "wanted",
    "beside_measured": "measured",
    "clicks": "click_changes",
    "compare_settings": "across_settings",
    "credible_forces": "measured",
    "fastest_sine": "forces",
    "find_trends": "trends",
    "has_lost_errors": "stage",
    "in_few_words": "trend_words",
    "levels": "forces",
    "named_speeds": "forces",
    "offset_sentence": "level",
    "said_offsets": "level",
    "sine_of": "forces",
    "stage_of": "stage",
    "which_setting": "wanted",
}


def __getattr__(name: str) -> Any:
    if name not in _LATE:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f"{__name__}.{_LATE[name]}"), name)
