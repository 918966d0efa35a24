"""Runs beside each other: what differs, and whether it is more than chance."""

from damperfit.comparison.circumstances import Circumstance, circumstances
from damperfit.comparison.comparing import ComparisonOptions, RunComparison, compare_runs
from damperfit.comparison.cycles import measured_tests
from damperfit.comparison.measured import common_tests, repeat_scatter
from damperfit.comparison.reading import SEEN, Difference, Reading, Sameness, Topic, compared
from damperfit.comparison.run import FittedRun, MeasuredTest, Run
from damperfit.comparison.words import difference_of, place_of, verdict_of

__all__ = [
    "SEEN",
    "Circumstance",
    "ComparisonOptions",
    "Difference",
    "FittedRun",
    "MeasuredTest",
    "Reading",
    "Run",
    "RunComparison",
    "Sameness",
    "Topic",
    "circumstances",
    "common_tests",
    "compare_runs",
    "compared",
    "difference_of",
    "measured_tests",
    "place_of",
    "repeat_scatter",
    "verdict_of",
]
