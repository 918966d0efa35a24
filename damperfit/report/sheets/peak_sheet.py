"""Peak force against peak speed (PVP), a row per test, measured beside simulated."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from damperfit.report.sheets.rounding import number, stroke_ratio
from damperfit.report.sheets.sheet import Sheet

if TYPE_CHECKING:
    from collections.abc import Sequence

    from damperfit.recording import StretchFigures
    from damperfit.simulation import Characteristics
    from damperfit.tested.setting import Setting

__all__ = ["PeakPoint", "peak_sheet"]

_MOST = 200  # rows


class PeakPoint(NamedTuple):
    """What a log, or a steady stretch of it, gives to peak force against peak speed."""

    setting: Setting
    log: str
    frequency: float
    measured: Characteristics | StretchFigures
    simulated: Characteristics | StretchFigures


def peak_sheet(points: Sequence[PeakPoint]) -> Sheet:
    """Return a row for each log or steady stretch, by setting and speed.

    Parameters
    ----------
    points : sequence of PeakPoint
        Of all logs.
    """
    ordered = sorted(points, key=lambda one: (one.setting, one.measured.peak_speed_rebound))
    more = len(ordered) - _MOST
    notes = ["Means of the cycles. Ratio: rebound force over bump force, without signs."]
    if more > 0:
        notes.append(f"{more} more in characteristics.csv")
    return Sheet(
        headings=(
            *("setting", "freq.", "speed", "rebound", "rebound", "speed", "bump", "bump"),
            *("ratio", "ratio", "energy"),
        ),
        units=(
            *("", "Hz", "m/s", "measured, N", "simulated, N", "m/s"),
            *("measured, N", "simulated, N", "measured", "simulated", "J"),
        ),
        rows=tuple(_row(one) for one in ordered[:_MOST]),
        is_number=(True,) * 11,
        notes=tuple(notes),
    )


def _row(one: PeakPoint) -> tuple[str, ...]:
    measured, simulated = one.measured, one.simulated
    return (
        str(one.setting),
        number(one.frequency, digits=3),
        number(measured.peak_speed_rebound, digits=3),
        number(measured.peak_force_rebound, digits=4),
        number(simulated.peak_force_rebound, digits=4),
        number(measured.peak_speed_bump, digits=3),
        number(measured.peak_force_bump, digits=4),
        number(simulated.peak_force_bump, digits=4),
        stroke_ratio(measured.peak_force_rebound, measured.peak_force_bump),
        stroke_ratio(simulated.peak_force_rebound, simulated.peak_force_bump),
        number(measured.energy, digits=4),
    )
