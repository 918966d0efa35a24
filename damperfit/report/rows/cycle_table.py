"""One damper cycle for people: forces and pressures as rows, the two loops as a figure."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from damperfit.errors import InstallationError
from damperfit.report.figures import FIXED_METADATA, fixed_style
from damperfit.report.rows import Sheet, number
from damperfit.report.spark import BLOCK_LEVELS, sparkline

if TYPE_CHECKING:
    from pathlib import Path

    from damperfit.characteristics import Characteristics
    from damperfit.simulation import Response

__all__ = ["cycle_lines", "draw_loops", "force_sheet", "pressure_sheet"]

_BAR = 1e5  # Pa
_CELLS = 44  # characters of one cycle


def force_sheet(figures: Characteristics) -> Sheet:
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
        notes=("force at a speed: mean of both branches; hysteresis: opening less closing branch",),
    )


def pressure_sheet(figures: Characteristics) -> Sheet:
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


def cycle_lines(
    response: Response, frequency: float, *, levels: str = BLOCK_LEVELS
) -> tuple[str, ...]:
    """Return the last cycle as sparklines: displacement, force and the three pressures.

    Parameters
    ----------
    response : Response
        Signals, at least one cycle.
    frequency : float
        Hz.
    levels : str
        Characters from low to high.
    """
    at = response.time[-1] - (1.0 - np.arange(_CELLS) / (_CELLS - 1.0)) / frequency
    rows = (
        ("displacement", "mm", 1e3 * response.displacement),
        ("force", "N", response.force),
        *(
            (f"pressure {i}", "bar", pressure / _BAR)
            for i, pressure in enumerate(response.pressures, start=1)
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


def draw_loops(
    path: Path, response: Response, frequency: float, *, kind: str, title: str = ""
) -> None:
    """Draw force against displacement and against velocity over the last cycle.

    Parameters
    ----------
    path : pathlib.Path
        Where to write.
    response : Response
        Signals, at least one cycle.
    frequency : float
        Hz.
    kind : str
        "png", "svg" or "pdf".
    title : str
        Above both.

    Raises
    ------
    InstallationError
        matplotlib is not installed.
    """
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError as error:
        raise InstallationError(
            "--plot needs matplotlib; install it with: pip install matplotlib"
        ) from error
    with fixed_style():
        figure = Figure(figsize=(10.0, 4.5), layout="constrained")
        FigureCanvasAgg(figure)
        left, right = figure.subplots(1, 2, sharey=True)
        last = response.time >= response.time[-1] - (1.0 + 1e-9) / frequency
        figure.suptitle(title, parse_math=False)
        left.plot(1e3 * response.displacement[last], response.force[last])
        left.set_xlabel("displacement, mm (positive: rebound)")
        left.set_ylabel("force, N (positive: rebound)")
        right.plot(response.velocity[last], response.force[last])
        right.set_xlabel("velocity, m/s (positive: rebound)")
        for axes in (left, right):
            axes.grid(visible=True, alpha=0.3)
        figure.savefig(path, format=kind, metadata=FIXED_METADATA[kind])
