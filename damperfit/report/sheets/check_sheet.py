"""The checklist: one row per check, and how many were passed."""

from __future__ import annotations

from typing import TYPE_CHECKING

from damperfit.report.sheets.sheet import Sheet

if TYPE_CHECKING:
    from collections.abc import Sequence

    from damperfit.checks import Check

__all__ = ["CHECK_WORDS", "check_lines", "check_sheet", "check_summary"]

CHECK_WORDS = {True: "passed", False: "FAILED", None: "not evaluated"}


def check_summary(checks: Sequence[Check]) -> str:
    """Return how many checks were passed, failed and not looked at."""
    counts = {word: sum(check.passed is word for check in checks) for word in (True, False, None)}
    said = f"{counts[True]} of {len(checks)} checks passed"
    return said + (f", {counts[None]} not evaluated" if counts[None] else "")


def check_lines(checks: Sequence[Check]) -> list[str]:
    """Return the summary and each failed check with its reason, for the terminal."""
    failed = [f"FAILED {check.name}: {check.reason}" for check in checks if check.passed is False]
    return [check_summary(checks), *failed]


def check_sheet(checks: Sequence[Check]) -> Sheet:
    """Return one row per check."""
    return Sheet(
        headings=("check", "result", "reason"),
        units=("", "", ""),
        rows=tuple((check.name, CHECK_WORDS[check.passed], check.reason) for check in checks),
        is_number=(False, False, False),
    )
