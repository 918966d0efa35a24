"""The characteristics of each stretch: peak force and speed (PVP), energy, hysteresis."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

from damperfit.report.sheets.rounding import number, percent
from damperfit.report.sheets.sheet import Sheet

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from damperfit.recording import StretchFigures

__all__ = ["ComparedStretch", "compared_stretch_sheet", "measured_stretch_sheet"]

_MOST = 60  # rows
_NOTE = (
    "Mean of the cycles; where nothing repeats the extremes, and the energy of all of it. "
    "Hysteresis: opening less closing force at half of the lower peak speed."
)


class ComparedStretch(NamedTuple):
    """A stretch with what is read off both forces: s, Hz."""

    start: float
    n_cycles: int
    frequency: float
    measured: StretchFigures
    simulated: StretchFigures


def measured_stretch_sheet(entries: Sequence[Mapping[str, Any]]) -> Sheet:
    """Return a row per stretch of all logs: what was measured, and the MSE of the fit.

    Parameters
    ----------
    entries : sequence of mapping
        As in run.json, "stretches".
    """
    shown = entries[:_MOST]
    more = len(entries) - len(shown)
    return Sheet(
        headings=(
            *("setting", "log", "cycles", "freq.", "speed", "rebound", "bump", "energy"),
            *("hysteresis rebound", "hysteresis bump", "MSE"),
        ),
        units=("", "", "", "Hz", "m/s", "N", "N", "J", "N", "N", "%"),
        rows=tuple(_measured_row(one) for one in shown),
        is_number=(True, False, *(True,) * 9),
        notes=(
            _NOTE,
            *((f"{more} more stretch{'es' * (more > 1)} in run.json",) if more else ()),
        ),
    )


def _measured_row(one: Mapping[str, Any]) -> tuple[str, ...]:
    speeds = [one.get(f"peak_speed_{side}_m_per_s") for side in ("rebound", "bump")]
    numbers = [speed for speed in speeds if speed is not None]
    return (
        str(one["setting"]),
        str(one["log"]),
        str(one["cycles"]) if one.get("cycles") else "moving",
        number(one.get("frequency_Hz"), digits=3),
        number(max(numbers, default=None), digits=3),
        number(one.get("peak_force_rebound_N"), digits=4),
        number(one.get("peak_force_bump_N"), digits=4),
        number(one.get("energy_J"), digits=4),
        number(one.get("hysteresis_rebound_N"), digits=3),
        number(one.get("hysteresis_bump_N"), digits=3),
        percent(one.get("mse_percent")),
    )


def compared_stretch_sheet(rows: Sequence[ComparedStretch]) -> Sheet:
    """Return a row per stretch of one log, measured beside simulated.

    Parameters
    ----------
    rows : sequence of ComparedStretch
        Of the log.
    """
    names = ("rebound", "bump", "energy", "hyst. rebound", "hyst. bump")
    words = ("measured", "simulated")
    units = ("N", "N", "J", "N", "N")
    return Sheet(
        headings=("from, s", "cycles", "Hz", "m/s", *(name for name in names for _ in words)),
        units=(*("",) * 4, *(f"{word}, {unit}" for unit in units for word in words)),
        rows=tuple(_compared_row(one) for one in rows[:_MOST]),
        is_number=(True,) * 14,
        notes=(_NOTE,),
    )


def _compared_row(one: ComparedStretch) -> tuple[str, ...]:
    measured, simulated = one.measured, one.simulated
    cells = [
        number(value if math.isfinite(value) else None, digits=digits)
        for name, digits in (
            ("peak_force_rebound", 4),
            ("peak_force_bump", 4),
            ("energy", 4),
            ("hysteresis_rebound", 3),
            ("hysteresis_bump", 3),
        )
        for value in (getattr(measured, name), getattr(simulated, name))
    ]
    return (
        number(one.start, digits=4),
        str(one.n_cycles) if one.n_cycles else "moving",
        number(one.frequency, digits=3),
        number(max(measured.peak_speed_rebound, measured.peak_speed_bump), digits=3),
        *cells,
    )
