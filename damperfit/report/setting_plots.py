"""The plots of one log: the two loops, force and residual, pressures (the paper's Figs 7, 11, 12).

Displacement in mm, velocity in m/s, force in N, pressure in bar; positive in rebound.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from damperfit.report.plots import CHAMBER_COLOURS, Line, Panel, Plot, thin

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from damperfit.report.views import LogView

    FloatArray = NDArray[np.float64]

__all__ = ["cavitation_bands", "setting_plots"]

_BUCKETS = 200  # of a whole log: peaks of every cycle survive
_CYCLE_BUCKETS = 120  # of one cycle: finer than a screen shows
_BAR = 1e5  # Pa


def setting_plots(view: LogView, *, name: str, colour: str) -> tuple[Plot, ...]:
    """Return the plots of one log.

    Parameters
    ----------
    view : LogView
        The log.
    name : str
        Prefix of the plots' names.
    colour : str
        Colour of the setting.
    """
    return (
        _force_velocity(view, name, colour),
        _force_displacement(view, name, colour),
        _force_time(view, name, colour),
        _residual(view, name, colour),
        _pressures(view, name),
    )


def _title(view: LogView, words: str) -> str:
    return f"Setting {view.signals.setting}: {words}"


def _loops(view: LogView, signal: FloatArray, colour: str) -> tuple[Line, Line]:
    """Return the last cycle: simulated in the setting's colour, measured thin on top of it."""
    signals = view.signals
    x, f = signal[view.cycle], signals.force[view.cycle]
    measured = signals.force_measured[view.cycle]
    part = thin(_CYCLE_BUCKETS, x, f, measured)
    setting = signals.setting
    return (
        Line(x[part], f[part], "simulated", colour, setting=setting, style="wide"),
        Line(x[part], measured[part], "measured", "ink", setting=setting, style="thin"),
    )


def _force_velocity(view: LogView, name: str, colour: str) -> Plot:
    panel = Panel("velocity", "m/s", "force", "N", _loops(view, view.signals.velocity, colour))
    return Plot(f"{name}_force_velocity", _title(view, "force against velocity"), (panel,))


def _force_displacement(view: LogView, name: str, colour: str) -> Plot:
    lines = _loops(view, 1e3 * view.signals.displacement, colour)
    panel = Panel("displacement", "mm", "force", "N", lines)
    caption = ""
    if view.measured and view.simulated:
        caption = (
            f"Energy per cycle: {view.measured.energy:.4g} J measured, "
            f"{view.simulated.energy:.4g} J simulated."
        )
    title = _title(view, "force against displacement")
    return Plot(f"{name}_force_displacement", title, (panel,), caption)


def _force_time(view: LogView, name: str, colour: str) -> Plot:
    signals = view.signals
    residual = signals.force_measured - signals.force
    kept = thin(_BUCKETS, signals.force_measured, signals.force, residual)
    time = (signals.time - signals.time[0])[kept]
    setting = signals.setting
    forces = (
        Line(time, signals.force[kept], "simulated", colour, setting=setting, style="wide"),
        Line(time, signals.force_measured[kept], "measured", "ink", setting=setting, style="thin"),
    )
    left = Line(
        time, residual[kept], "residual", colour, setting=setting, style="thin", in_legend=False
    )
    panels = (
        Panel("time", "s", "force", "N", forces),
        Panel("time", "s", "residual", "N", (left,)),
    )
    caption = "Residual: measured less simulated."
    return Plot(f"{name}_force_time", _title(view, "force over time"), panels, caption)


def _residual(view: LogView, name: str, colour: str) -> Plot:
    signals = view.signals
    residual = signals.force_measured - signals.force
    kept = thin(_BUCKETS, signals.velocity, residual)
    line = Line(
        signals.velocity[kept],
        residual[kept],
        "residual",
        colour,
        setting=signals.setting,
        style="points",
    )
    panel = Panel("velocity", "m/s", "residual", "N", (line,), rules=((0.0, ""),))
    caption = "A pattern here is what the model does not know; a cloud is noise."
    return Plot(f"{name}_residual", _title(view, "residual against velocity"), (panel,), caption)


def _pressures(view: LogView, name: str) -> Plot:
    signals = view.signals
    time = signals.time[view.cycle] - signals.time[view.cycle.start]
    pressures = signals.pressures[:, view.cycle]
    kept = thin(_CYCLE_BUCKETS, *pressures)
    lines = tuple(
        Line(time[kept], pressure[kept] / _BAR, f"chamber {i}", colour, setting=signals.setting)
        for i, (pressure, colour) in enumerate(
            zip(pressures, CHAMBER_COLOURS, strict=True), start=1
        )
    )
    bands = cavitation_bands(time, pressures)
    caption = "No chamber cavitates."
    if bands:
        parts = [
            f"chamber {i} for {100.0 * float(np.mean(pressure <= 0.0)):.1f} %"
            for i, pressure in enumerate(pressures, start=1)
            if (pressure <= 0.0).any()
        ]
        caption = f"Shaded: cavitation, {' and '.join(parts)} of the cycle."
    panel = Panel("time", "s", "absolute pressure", "bar", lines, bands=bands)
    title = _title(view, "chamber pressures, simulated")
    return Plot(f"{name}_pressures", title, (panel,), caption)


def cavitation_bands(time: FloatArray, pressures: FloatArray) -> tuple[tuple[float, float], ...]:
    """Return begin and end of each stretch with a chamber at zero pressure.

    Parameters
    ----------
    time : numpy.ndarray
        Shape (n,).
    pressures : numpy.ndarray
        Shape (3, n).
    """
    is_inside = np.any(pressures <= 0.0, axis=0)
    padded = np.concatenate(([False], is_inside, [False]))
    begins = np.flatnonzero(~padded[:-1] & padded[1:])
    ends = np.flatnonzero(padded[:-1] & ~padded[1:]) - 1
    return tuple((float(time[a]), float(time[b])) for a, b in zip(begins, ends, strict=True))
