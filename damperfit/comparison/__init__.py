"""Runs beside each other: what differs, and whether it is more than chance."""

from damperfit.comparison.comparing import (
    ComparisonOptions,
    Point,
    RunComparison,
    Tolerance,
    bands_met,
    compare_runs,
    parse_bands,
    parse_tolerance,
    tolerated,
)
from damperfit.comparison.measured import MeasuredTest, common_tests, measured_tests
from damperfit.comparison.verdict import Difference, Sameness, verdict_of

__all__ = [
    "ComparisonOptions",
    "Difference",
    "MeasuredTest",
    "Point",
    "RunComparison",
    "Sameness",
    "Tolerance",
    "bands_met",
    "common_tests",
    "compare_runs",
    "measured_tests",
    "parse_bands",
    "parse_tolerance",
    "tolerated",
    "verdict_of",
]
