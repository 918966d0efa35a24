"""Force by setting, and what a click changes: at one speed, or of one stroke at all speeds."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from damperfit.report.rows.notes_below_tables import (
    DAMPING_SHARE,
    force_and_click_at,
    over_several_clicks,
    stroke_and_click_at,
)
from damperfit.report.rows.rounding import NOTHING, number, with_interval
from damperfit.report.rows.sheet import Sheet

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

__all__ = ["force_by_setting_sheet", "force_by_speed_sheet"]


def force_by_setting_sheet(rows: Sequence[Mapping[str, Any]]) -> Sheet:
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
    gaps = over_several_clicks(settings)
    change = "change" if gaps else "click"
    return Sheet(
        headings=("set", "rebound", change, "", "bump", change, ""),
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
        notes=(force_and_click_at(fastest), *gaps, DAMPING_SHARE),
    )


def force_by_speed_sheet(rows: Sequence[Mapping[str, Any]], stroke: str) -> Sheet:
    """Return the forces of one stroke at all speeds, and the click at the fastest."""
    speeds = sorted({row["speed_m_per_s"] for row in rows})
    table = {(row["setting"], row["speed_m_per_s"]): row for row in rows if row["stroke"] == stroke}
    settings = sorted({setting for setting, _ in table})
    gaps = over_several_clicks(settings)
    return Sheet(
        headings=("set", *(f"{speed:g}" for speed in speeds), "change" if gaps else "click", ""),
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
        notes=(stroke_and_click_at(stroke, speeds[-1]), *gaps, DAMPING_SHARE),
    )


def _cells(row: Mapping[str, Any]) -> tuple[str, str, str]:
    """Force and change, each with half of its 95 % interval, and the change in per cent."""
    return (
        with_interval(row["force_N"], row["force_ci_high_N"]),
        with_interval(row["change_N"], row["change_ci_high_N"], plus="+"),
        NOTHING if row["change_percent"] is None else f"{row['change_percent']:+.1f}",
    )
