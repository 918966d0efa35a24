"""How near each setting is to cavitation, one row per setting."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from damperfit.report.sheets.notes_below import ABSOLUTE_PRESSURES
from damperfit.report.sheets.rounding import NOTHING, number
from damperfit.report.sheets.sheet import Sheet

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

__all__ = ["cavitation_sheet"]

_BAR = 1e5  # Pa


def cavitation_sheet(rows: Sequence[Mapping[str, Any]]) -> Sheet:
    """Return one row per setting: lowest pressure, share of the cycle, and what may still change.

    Columns of another version may be missing; a setting that tells nothing has no row.
    """
    known = [
        row
        for row in rows
        if row.get("lowest_pressure") is not None or row.get("r_m3_cavitation_margin") is not None
    ]
    return Sheet(
        headings=("setting", "lowest pressure", "in chamber", "cavitates", "R_m3 margin", "gas"),
        units=("", "bar", "", "% of cycle", "%", "bar at least"),
        rows=tuple(
            (
                str(row["setting"]),
                number(_times(row.get("lowest_pressure"), 1.0 / _BAR), digits=3),
                str(row.get("lowest_pressure_chamber") or NOTHING),
                number(_times(row.get("cavitation_fraction"), 100.0), digits=3),
                number(_times(row.get("r_m3_cavitation_margin"), 100.0), digits=3),
                number(_times(row.get("safe_gas_pressure"), 1.0 / _BAR), digits=3),
            )
            for row in known
        ),
        is_number=(True,) * 6,
        notes=(ABSOLUTE_PRESSURES,),
    )


def _times(value: float | None, factor: float) -> float | None:
    return None if value is None else value * factor
