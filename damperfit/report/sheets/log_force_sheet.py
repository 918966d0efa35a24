"""The forces of one log, measured beside simulated: at named speeds, peaks, hysteresis, ratio."""

from __future__ import annotations

from typing import TYPE_CHECKING

from damperfit.report.sheets.notes_below import BRANCHES_AND_RATIO, energy_and_temperature
from damperfit.report.sheets.rounding import number, stroke_ratio
from damperfit.report.sheets.sheet import Sheet

if TYPE_CHECKING:
    from damperfit.simulation import Characteristics

__all__ = ["measured_and_simulated_sheet"]


def measured_and_simulated_sheet(
    measured: Characteristics, simulated: Characteristics, *, temperature: float | None
) -> Sheet:
    """Return forces at named speeds, peaks, hysteresis and ratio, measured beside simulated.

    Parameters
    ----------
    measured, simulated : Characteristics
        Figures of one cycle.
    temperature : float or None
        degC, when it was logged.
    """
    rows = (
        *(
            _force_row(f"at {a.speed:g} m/s", (a.rebound, b.rebound), (a.bump, b.bump))
            for a, b in zip(measured.speed_forces, simulated.speed_forces, strict=True)
        ),
        _force_row(
            "peak",
            (measured.peak_force_rebound, simulated.peak_force_rebound),
            (measured.peak_force_bump, simulated.peak_force_bump),
        ),
        (
            f"hysteresis, {measured.hysteresis_speed:.2g} m/s",
            number(measured.hysteresis_rebound, digits=4),
            number(simulated.hysteresis_rebound, digits=4),
            number(measured.hysteresis_bump, digits=4),
            number(simulated.hysteresis_bump, digits=4),
            *("", ""),
        ),
    )
    energy = energy_and_temperature(measured.energy, simulated.energy, temperature)
    return Sheet(
        headings=("force, N", "rebound", "rebound", "bump", "bump", "ratio", "ratio"),
        units=("", *("measured", "simulated") * 3),
        rows=rows,
        is_number=(False, *(True,) * 6),
        notes=(energy, BRANCHES_AND_RATIO),
    )


def _force_row(
    name: str, rebound: tuple[float, float], bump: tuple[float, float]
) -> tuple[str, ...]:
    """Return a row; pairs are measured and simulated."""
    forces = (number(force, digits=4) for force in (*rebound, *bump))
    return (name, *forces, *map(stroke_ratio, rebound, bump))
