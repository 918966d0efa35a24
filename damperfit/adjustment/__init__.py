"""What shows only across settings: trends, settings off them, clicks, the setting for a force."""

from damperfit.adjustment.across_settings import Adjustment, compare_settings
from damperfit.adjustment.forces import (
    Click,
    Sine,
    Stage,
    clicks,
    fastest_sine,
    levels,
    named_speeds,
    sine_of,
    stage_of,
)
from damperfit.adjustment.level import STROKES, Level
from damperfit.adjustment.measured import beside_measured, credible_forces
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
    "levels",
    "named_speeds",
    "sine_of",
    "stage_of",
    "which_setting",
]
