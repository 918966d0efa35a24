"""Runs beside each other: what differs, and whether it is more than chance."""

from damperfit.comparison.circumstances import Circumstance, circumstances
from damperfit.comparison.comparing import ComparisonOptions, RunComparison, compare_runs
from damperfit.comparison.forces import common_tests, repeat_scatter
from damperfit.comparison.reading import (
    SEEN,
    Difference,
    Reading,
    Sameness,
    Topic,
    compared,
    difference_of,
    place_of,
    verdict_of,
)
from damperfit.comparison.run import ComparedRun, MeasuredTest, measured_tests
from damperfit.comparison.tolerance import (
    Band,
    Point,
    Tolerance,
    bands_met,
    parse_tolerance,
    read_bands,
    tolerated,
)

__all__ = [
    "SEEN",
    "Band",
    "Circumstance",
    "ComparedRun",
    "ComparisonOptions",
    "Difference",
    "MeasuredTest",
    "Point",
    "Reading",
    "RunComparison",
    "Sameness",
    "Tolerance",
    "Topic",
    "bands_met",
    "circumstances",
    "common_tests",
    "compare_runs",
    "compared",
    "difference_of",
    "measured_tests",
    "parse_tolerance",
    "place_of",
    "read_bands",
    "repeat_scatter",
    "tolerated",
    "verdict_of",
]
