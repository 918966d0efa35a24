"""Force by setting, and what a click changes: at one speed, or of one stroke at all speeds."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from damperfit.report.sheets.notes_below import (
    DAMPING_SHARE,
    FORCE_AS_MEASURED,
    MEASURED_BESIDE_MODEL,
    force_and_click_at,
    over_several_clicks,
    stroke_and_click_at,
)
from damperfit.report.sheets.rounding import NOTHING, number, with_interval
from damperfit.report.sheets.sheet import Sheet
from damperfit.statistics import NORMAL_95
from damperfit.tested.setting import Setting

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

__all__ = ["force_by_setting_sheet", "force_by_speed_sheet", "measured_force_sheet"]


def force_by_setting_sheet(
    rows: Sequence[Mapping[str, Any]], strokes: Sequence[str] = ("rebound", "bump")
) -> Sheet:
    """Return force and change by click at one speed, rebound beside bump or one of them.

    Parameters
    ----------
    rows : sequence of mapping
        Of the table "adjustment"; the fastest speed among them is shown.
    strokes : sequence of str
        Which to show.
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
        headings=("set", *(cell for stroke in strokes for cell in (stroke, change, ""))),
        units=("", *(("N", "N", "%") * len(strokes))),
        rows=tuple(
            (
                _words(setting, changed),
                *(
                    cell
                    for stroke in strokes
                    for cell in _cells(by_place[setting, changed, stroke])
                ),
            )
            for setting, changed in places
        ),
        is_number=(True,) * (1 + 3 * len(strokes)),
        notes=(
            force_and_click_at(fastest),
            *gaps,
            *_turned(places),
            DAMPING_SHARE,
            *_marks(by_place.values()),
        ),
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
    change = "change" if gaps else "click"
    return Sheet(
        headings=("set", *(f"{speed:g}" for speed in speeds), change, ""),
        units=("", *("m/s" for _ in speeds), "N", "%"),
        rows=tuple(
            (
                _words(setting, changed),
                *(_force_cell(table[setting, changed, speed], digits=4) for speed in speeds),
                *_cells(table[setting, changed, speeds[-1]])[1:],
            )
            for setting, changed in places
        ),
        is_number=(True,) * (len(speeds) + 3),
        notes=(
            stroke_and_click_at(stroke, speeds[-1], change),
            *gaps,
            *_turned(places),
            DAMPING_SHARE,
            *_marks(rows),
        ),
    )


def _places(rows: Iterable[tuple[Any, str | None, Any]]) -> list[tuple[Any, str | None]]:
    """Return settings in order; with several adjusters one for each that was turned."""
    known = {(setting, changed) for setting, changed, _ in rows}
    return sorted(known, key=lambda one: (Setting.of(one[0]), one[1] or ""))


def _words(setting: Any, changed: str | None) -> str:
    several = changed is not None and " " in str(setting)
    return f"{setting}, {changed}" if several else str(setting)


def _turned(places: Sequence[tuple[Any, str | None]]) -> tuple[str, ...]:
    """Say what the letter behind a setting means, where there is one."""
    marked = next((one for one in places if _words(*one) != str(one[0])), None)
    if marked is None:
        return ()
    said = f'"{_words(*marked)}": the change when {marked[1]} alone is turned'
    return (f"{said}; the forces of a setting are the same in its rows",)


def measured_force_sheet(rows: Sequence[Mapping[str, Any]]) -> Sheet:
    """Return the measured force beside the model's on the same cycles, with the difference.

    At the fastest speed of all settings, and wherever else the model misses the measured force.

    Parameters
    ----------
    rows : sequence of mapping
        Of the table "adjustment".
    """
    known = [row for row in rows if row.get("measured_N") is not None]
    table = {(row["setting"], row["speed_m_per_s"], row["stroke"]): row for row in known}
    fastest = max((row["speed_m_per_s"] for row in known), default=0.0)
    missed = {(row["setting"], row["speed_m_per_s"]) for row in known if _is_measured(row)}
    places = sorted(
        {(a, b) for a, b, _ in table if b == fastest or (a, b) in missed},
        key=lambda place: (Setting.of(place[0]), place[1]),
    )
    return Sheet(
        headings=("set", "speed", *("rebound",) * 3, *("bump",) * 3),
        units=("", "m/s", *("measured", "model", "diff.") * 2),
        rows=tuple(
            (
                str(setting),
                f"{speed:g}",
                *(
                    cell
                    for stroke in ("rebound", "bump")
                    for cell in _beside(table.get((setting, speed, stroke)))
                ),
            )
            for setting, speed in places
        ),
        is_number=(True,) * 8,
        notes=(MEASURED_BESIDE_MODEL, *_marks(known)),
    )


def _beside(row: Mapping[str, Any] | None) -> tuple[str, str, str]:
    if row is None:
        return (NOTHING,) * 3
    measured, difference = row["measured_N"], row["difference_N"]
    mark = " m" if _is_measured(row) else ""
    return (
        number(measured, digits=4) + mark,
        number(measured - difference, digits=4),
        f"{difference:+.1f}",
    )


def _is_measured(row: Mapping[str, Any]) -> bool:
    return row.get("told_from") == "measured"


def _force_cell(row: Mapping[str, Any], *, digits: int | None = None) -> str:
    """Return the force to show: the model's, or as measured where the model misses it."""
    force, high, mark = row["force_N"], row["force_ci_high_N"], ""
    if _is_measured(row):
        force, mark = row["measured_N"], " m"
        error = row["measured_se_N"]
        high = None if error is None else force + NORMAL_95 * error
    text = with_interval(force, high) if digits is None else number(force, digits=digits)
    return text + mark


def _marks(rows: Iterable[Mapping[str, Any]]) -> tuple[str, ...]:
    return (FORCE_AS_MEASURED,) if any(_is_measured(row) for row in rows) else ()


def _cells(row: Mapping[str, Any]) -> tuple[str, str, str]:
    """Force and change, each with half of its 95 % interval, and the change in per cent."""
    return (
        _force_cell(row),
        with_interval(row["change_N"], row["change_ci_high_N"], plus="+"),
        NOTHING if row["change_percent"] is None else f"{row['change_percent']:+.1f}",
    )
