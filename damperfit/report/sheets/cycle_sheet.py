"""One simulated cycle: forces and pressures as rows, its signals as sparklines."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from damperfit.report.sheets.notes_below import BRANCHES
from damperfit.report.sheets.rounding import number
from damperfit.report.sheets.sheet import Sheet
from damperfit.report.sheets.sparkline import BLOCK_LEVELS, sparkline

if TYPE_CHECKING:
    from damperfit.simulation import Characteristics, Response

__all__ = ["cycle_force_sheet", "cycle_pressure_sheet", "cycle_sparklines"]

_BAR = 1e5  # Pa
_CELLS, _FEWEST = 44, 16  # characters of one cycle; where the terminal is narrow
_BESIDE = 36  # name and range of a line


def cycle_force_sheet(figures: Characteristics) -> Sheet:
    """Return peak forces, hysteresis and forces at named speeds, rebound beside bump."""
    pairs = [
        ("peak force", "N", figures.peak_force_rebound, figures.peak_force_bump),
        ("peak speed", "m/s", figures.peak_speed_rebound, figures.peak_speed_bump),
        *(
            (f"force at {forces.speed:g} m/s", "N", forces.rebound, forces.bump)
            for forces in figures.speed_forces
        ),
        (
            f"hysteresis at {figures.hysteresis_speed:.3g} m/s",
            "N",
            figures.hysteresis_rebound,
            figures.hysteresis_bump,
        ),
    ]
    rows = [
        *(
            (name, unit, number(up, digits=4), number(down, digits=4))
            for name, unit, up, down in pairs
        ),
        ("energy per cycle", "J", number(figures.energy, digits=4), ""),
    ]
    return Sheet(
        headings=("", "", "rebound", "bump"),
        units=("", "", "", ""),
        rows=tuple(rows),
        is_number=(False, False, True, True),
        notes=(BRANCHES,),
    )


def cycle_pressure_sheet(figures: Characteristics) -> Sheet:
    """Return the pressure range and the share of the cycle in cavitation, by chamber."""
    low = tuple(number(p[0] / _BAR, digits=4) for p in figures.pressure_ranges)
    high = tuple(number(p[1] / _BAR, digits=4) for p in figures.pressure_ranges)
    share = tuple(f"{100.0 * part:.1f}" for part in figures.cavitation_shares)
    return Sheet(
        headings=("", "", "chamber 1", "chamber 2", "chamber 3"),
        units=("", "", "", "", ""),
        rows=(
            ("lowest pressure", "bar", *low),
            ("highest pressure", "bar", *high),
            ("cavitation", "% of cycle", *share),
        ),
        is_number=(False, False, True, True, True),
    )


def cycle_sparklines(
    response: Response, frequency: float, *, columns: int = 80, levels: str = BLOCK_LEVELS
) -> tuple[str, ...]:
    """Return the last cycle as sparklines: displacement, force and the three pressures.

    Parameters
    ----------
    response : Response
        Signals, at least one cycle.
    frequency : float
        Hz.
    columns : int
        Width that the lines must fit into.
    levels : str
        Characters from low to high.
    """
    cells = max(_FEWEST, min(_CELLS, columns - _BESIDE))
    at = response.time[-1] - (1.0 - np.arange(cells) / (cells - 1.0)) / frequency
    rows = (
        ("displacement", "mm", 1e3 * response.displacement),
        ("force", "N", response.force),
        *(
            (f"pressure {i}", "bar", pressure / _BAR)
            for i, pressure in enumerate(response.pressures, start=1)
            if np.isfinite(pressure).all()
        ),
    )
    is_inside = response.time >= at[0]
    lines = []
    for name, unit, signal in rows:
        marks = sparkline(np.interp(at, response.time, signal).tolist(), levels=levels)
        low, high = (
            number(end, digits=4) for end in (np.min(signal[is_inside]), np.max(signal[is_inside]))
        )
        lines.append(f"{name:<12} {marks} {low} to {high} {unit}")
    return tuple(lines)
