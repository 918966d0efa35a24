"""The settings beside each other for people: force by setting and click, and the checklist."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from damperfit.report.rows import NOTHING, Sheet, number

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from damperfit.checks import Check

__all__ = [
    "check_lines",
    "check_sheet",
    "check_summary",
    "ladder_sheet",
    "stroke_sheet",
    "with_reach",
]

_WORDS = {True: "passed", False: "FAILED", None: "not looked at"}
_GAS = "% of the damping: of the force less the gas force at mid-stroke"


def check_summary(checks: Sequence[Check]) -> str:
    """Return how many checks were passed, failed and not looked at."""
    counts = {word: sum(check.passed is word for check in checks) for word in (True, False, None)}
    said = f"{counts[True]} of {len(checks)} checks passed"
    return said + (f", {counts[None]} not looked at" if counts[None] else "")


def check_lines(checks: Sequence[Check]) -> list[str]:
    """Return the summary and each failed check with its reason, for the terminal."""
    failed = [f"FAILED {check.name}: {check.reason}" for check in checks if check.passed is False]
    return [check_summary(checks), *failed]


def check_sheet(checks: Sequence[Check]) -> Sheet:
    """Return one row per check."""
    return Sheet(
        headings=("check", "result", "reason"),
        units=("", "", ""),
        rows=tuple((check.name, _WORDS[check.passed], check.reason) for check in checks),
        is_number=(False, False, False),
    )


def ladder_sheet(rows: Sequence[Mapping[str, Any]]) -> Sheet:
    """Return force and change by click at one speed, rebound beside bump.

    Parameters
    ----------
    rows : sequence of mapping
        Of the table "adjustment"; the fastest speed among them is shown.
    """
    fastest = max((row["speed_m_per_s"] for row in rows), default=0.0)
    by_place = {
        (row["setting"], row["stroke"]): row for row in rows if row["speed_m_per_s"] == fastest
    }
    settings = sorted({setting for setting, _ in by_place})
    return Sheet(
        headings=("set", "rebound", "click", "", "bump", "click", ""),
        units=("", "N", "N", "%", "N", "N", "%"),
        rows=tuple(
            (
                str(setting),
                *(
                    cell
                    for stroke in ("rebound", "bump")
                    for cell in _cells(by_place[setting, stroke])
                ),
            )
            for setting in settings
        ),
        is_number=(True,) * 7,
        notes=(f"force at {fastest:g} m/s and its change by click, with 95 % intervals", _GAS),
    )


def stroke_sheet(rows: Sequence[Mapping[str, Any]], stroke: str) -> Sheet:
    """Return the forces of one stroke at all speeds, and the click at the fastest."""
    speeds = sorted({row["speed_m_per_s"] for row in rows})
    table = {(row["setting"], row["speed_m_per_s"]): row for row in rows if row["stroke"] == stroke}
    settings = sorted({setting for setting, _ in table})
    return Sheet(
        headings=("set", *(f"{speed:g}" for speed in speeds), "click", ""),
        units=("", *("m/s" for _ in speeds), "N", "%"),
        rows=tuple(
            (
                str(setting),
                *(number(table[setting, speed]["force_N"], digits=4) for speed in speeds),
                *_cells(table[setting, speeds[-1]])[1:],
            )
            for setting in settings
        ),
        is_number=(True,) * (len(speeds) + 3),
        notes=(f"{stroke}: force in N; click: its change at {speeds[-1]:g} m/s", _GAS),
    )


def _cells(row: Mapping[str, Any]) -> tuple[str, str, str]:
    """Force and change, each with half of its 95 % interval, and the change in per cent."""
    return (
        with_reach(row["force_N"], row["force_ci_high_N"]),
        with_reach(row["change_N"], row["change_ci_high_N"], plus="+"),
        NOTHING if row["change_percent"] is None else f"{row['change_percent']:+.1f}",
    )


def with_reach(value: float | None, high: float | None, *, plus: str = "") -> str:
    """Return as in "+51.1 ± 0.4", to a digit of half the interval; four digits without one."""
    if value is None:
        return NOTHING
    if high is None:
        return f"{value:{plus}.4g}"
    reach = high - value
    decimals = 1 if reach >= 0.05 else 2
    return f"{value:{plus}.{decimals}f} ± {reach:.{decimals}f}"
