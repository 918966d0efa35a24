"""A figure in the units that people want: its axes scaled and named."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from damperfit.report.plots.description import Line, Panel, Plot
    from damperfit.units.shown_units import ShownUnits

__all__ = ["plot_in_units"]


def plot_in_units(plot: Plot, units: ShownUnits) -> Plot:
    """Return a figure with forces, speeds and displacements scaled; other axes stay."""
    if units.is_si:
        return plot
    return replace(plot, panels=tuple(_panel(panel, units) for panel in plot.panels))


def _panel(panel: Panel, units: ShownUnits) -> Panel:
    (x, x_unit), (y, y_unit) = (_scale(unit, units) for unit in (panel.x_unit, panel.y_unit))
    return replace(
        panel,
        x_unit=x_unit,
        y_unit=y_unit,
        lines=tuple(_line(line, x, y) for line in panel.lines),
        rules=tuple((y * at, word) for at, word in panel.rules),
        bands=tuple((x * begin, x * end) for begin, end in panel.bands),
        ticks=tuple(x * tick for tick in panel.ticks),
        x_range=panel.x_range and (x * panel.x_range[0], x * panel.x_range[1]),
        y_range=panel.y_range and (y * panel.y_range[0], y * panel.y_range[1]),
    )


def _scale(unit: str, units: ShownUnits) -> tuple[float, str]:
    """Return the factor and the unit of an axis; figures have displacements in mm."""
    if unit == "mm":
        chosen = units.of("m")
        return (1.0, unit) if chosen == "m" else (1e-3 * units.show(1.0, "m"), chosen)
    return units.show(1.0, unit), units.of(unit)


def _line(line: Line, x: float, y: float) -> Line:
    return replace(
        line,
        x=x * line.x,
        y=y * line.y,
        low=None if line.low is None else y * line.low,
        high=None if line.high is None else y * line.high,
    )
