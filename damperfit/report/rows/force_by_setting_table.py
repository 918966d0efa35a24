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
from damperfit.setting import Setting

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

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
        (row["setting"], row.get("changed"), row["stroke"]): row
        for row in rows
        if row["speed_m_per_s"] == fastest
    }
    places = _places(by_place)
    gaps = over_several_clicks([setting for setting, _ in places])
    change = "change" if gaps else "click"
    return Sheet(
        headings=("set", "rebound", change, "", "bump", change, ""),
        units=("", "N", "N", "%", "N", "N", "%"),
        rows=tuple(
            (
                _words(setting, changed),
                *(
                    cell
                    for stroke in ("rebound", "bump")
                    for cell in _cells(by_place[setting, changed, stroke])
                ),
            )
            for setting, changed in places
        ),
        is_number=(True,) * 7,
        notes=(force_and_click_at(fastest), *gaps, DAMPING_SHARE),
    )


def force_by_speed_sheet(rows: Sequence[Mapping[str, Any]], stroke: str) -> Sheet:
    """Return the forces of one stroke at all speeds, and the click at the fastest."""
    speeds = sorted({row["speed_m_per_s"] for row in rows})
    table = {
        (row["setting"], row.get("changed"), row["speed_m_per_s"]): row
        for row in rows
        if row["stroke"] == stroke
    }
    places = _places(table)
    gaps = over_several_clicks([setting for setting, _ in places])
    return Sheet(
        headings=("set", *(f"{speed:g}" for speed in speeds), "change" if gaps else "click", ""),
        units=("", *("m/s" for _ in speeds), "N", "%"),
        rows=tuple(
            (
                _words(setting, changed),
                *(number(table[setting, changed, speed]["force_N"], digits=4) for speed in speeds),
                *_cells(table[setting, changed, speeds[-1]])[1:],
            )
            for setting, changed in places
        ),
        is_number=(True,) * (len(speeds) + 3),
        notes=(stroke_and_click_at(stroke, speeds[-1]), *gaps, DAMPING_SHARE),
    )


def _places(rows: Iterable[tuple[Any, str | None, Any]]) -> list[tuple[Any, str | None]]:
    """Return settings in order; with several adjusters one for each that was turned."""
    known = {(setting, changed) for setting, changed, _ in rows}
    return sorted(known, key=lambda one: (Setting.of(one[0]), one[1] or ""))


def _words(setting: Any, changed: str | None) -> str:
    several = changed is not None and " " in str(setting)
    return f"{setting}, {changed}" if several else str(setting)


def _cells(row: Mapping[str, Any]) -> tuple[str, str, str]:
    """Force and change, each with half of its 95 % interval, and the change in per cent."""
    return (
        with_interval(row["force_N"], row["force_ci_high_N"]),
        with_interval(row["change_N"], row["change_ci_high_N"], plus="+"),
        NOTHING if row["change_percent"] is None else f"{row['change_percent']:+.1f}",
    )
