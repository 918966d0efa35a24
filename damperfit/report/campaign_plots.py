"""The plots of all settings together: parameters, MSE, the fan, forces (Figs 13-16)."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit.characteristics import NAMED_SPEEDS
from damperfit.damper.parameters import PARAMETER_NAMES
from damperfit.report.plots import Line, Panel, Plot, thin

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from damperfit.report.views import LogView

    FloatArray = NDArray[np.float64]
    Row = Mapping[str, Any]

__all__ = ["campaign_plots"]

_SCALES = {
    "r_m1": ("R_m1", "1e3 s sqrt(N)/(m kg)", 1e-3),
    "r_m2": ("R_m2", "1e6 N s/(m2 kg)", 1e-6),
    "r_m3": ("R_m3", "1e6 N s/(m2 kg)", 1e-6),
    "k_e": ("K_e", "MPa", 1e-6),
    "f_f": ("f_f", "N", 1.0),
    "f_0": ("f_0", "N", 1.0),
}
_CYCLE_BUCKETS = 120
_TREND_POINTS = 4  # a quadratic through fewer says nothing


def campaign_plots(
    parameters: Sequence[Row],
    mse: Sequence[Row],
    views: Sequence[LogView],
    *,
    colours: Mapping[int, str],
) -> tuple[Plot, ...]:
    """Return the plots that compare settings; those without data are left out.

    Parameters
    ----------
    parameters, mse : sequence of mapping
        Rows of the tables.
    views : sequence of LogView
        Logs with their figures.
    colours : mapping of int to str
        Colour of each setting.
    """
    plots = [*_parameters(parameters, colours), *_errors(mse, colours)]
    if views:
        plots += [_fan(views, colours), _absolute(views, colours)]
    if any(view.measured for view in views):
        plots += [_peaks(views, colours)]
        plots += _named_speeds(views)
    return tuple(plots)


def _parameters(rows: Sequence[Row], colours: Mapping[int, str]) -> Iterator[Plot]:
    for name in PARAMETER_NAMES:
        known = [row for row in rows if _is_shown(row, name)]
        if not known or (name == "f_0" and not any(row[name] for row in known)):
            continue
        heading, unit, factor = _SCALES[name]
        points = [_point(row, name, factor, colours[row["setting"]]) for row in known]
        lines = (*_trend(known, name, factor), *points)
        panel = Panel("setting", "", heading, unit, lines)
        words = {str(row[f"{name}_status"] or "").replace("_", " ") for row in known}
        kind = ", ".join(sorted(words - {""}))
        bars = "" if any(line.low is not None for line in points) else " No intervals in the table."
        caption = f"{heading}: {kind}.{bars}" if kind else bars.strip()
        yield Plot(f"parameter_{name}", f"{heading} against setting", (panel,), caption)


def _is_shown(row: Row, name: str) -> bool:
    value = row[name]
    is_known = value is not None and math.isfinite(value)
    return is_known and row[f"{name}_status"] != "not_identifiable"


def _point(row: Row, name: str, factor: float, colour: str) -> Line:
    low, high = row[f"{name}_ci_low"], row[f"{name}_ci_high"]
    has_interval = low is not None and high is not None
    is_fitted = row[f"{name}_status"] in {"fitted", None}
    return Line(
        np.array([float(row["setting"])]),
        np.array([factor * row[name]]),
        f"setting {row['setting']}",
        colour,
        setting=row["setting"],
        style="points" if is_fitted else "triangles",
        in_legend=False,
        low=np.array([factor * low]) if has_interval else None,
        high=np.array([factor * high]) if has_interval else None,
    )


def _trend(rows: Sequence[Row], name: str, factor: float) -> tuple[Line, ...]:
    free = [row for row in rows if row[f"{name}_status"] in {"fitted", None}]
    x = np.array([float(row["setting"]) for row in free])
    if len(set(x.tolist())) < _TREND_POINTS:
        return ()
    y = factor * np.array([row[name] for row in free])
    middle, reach = x.mean(), np.ptp(x)  # centred: settings such as 1001 stay well conditioned
    fitted = np.polyfit((x - middle) / reach, y, 2)
    at = np.linspace(x.min(), x.max(), 50)
    curve = np.polyval(fitted, (at - middle) / reach)
    return (Line(at, curve, "least-squares quadratic", "muted", style="dashed"),)


def _errors(rows: Sequence[Row], colours: Mapping[int, str]) -> Iterator[Plot]:
    whole = [row for row in rows if not row["log"] and row["mse_percent"] is not None]
    if not whole:
        return
    lines = [
        Line(
            np.array([float(row["setting"])]),
            np.array([row["mse_percent"]]),
            f"MSE, setting {row['setting']}",
            colours[row["setting"]],
            setting=row["setting"],
            style="points",
            in_legend=False,
        )
        for row in whole
    ]
    floor = [row for row in whole if row["noise_floor_percent"] is not None]
    if floor:
        at = np.array([float(row["setting"]) for row in floor])
        values = np.array([row["noise_floor_percent"] for row in floor])
        lines.append(Line(at, values, "noise floor", "muted", style="dashed"))
    rules = ((1.0, "1 %: excellent below"), (5.0, "5 %: good below"))
    panel = Panel("setting", "", "MSE", "%", tuple(lines), rules=rules, is_log=True)
    caption = "The noise floor is the MSE that the scatter between cycles explains."
    yield Plot("mse", "MSE and noise floor against setting", (panel,), caption)


def _fan(views: Sequence[LogView], colours: Mapping[int, str]) -> Plot:
    lines = []
    for view in views:
        signals, setting = view.signals, view.signals.setting
        v = signals.velocity[view.cycle]
        for force, words, style in (
            (signals.force_measured[view.cycle], "measured", "dotted"),
            (signals.force[view.cycle], "simulated", "solid"),
        ):
            kept = thin(_CYCLE_BUCKETS, v, force)
            label = f"setting {setting}, {words}"
            is_first = style == "solid"
            lines.append(
                Line(v[kept], force[kept], label, colours[setting], setting, style, is_first)
            )
    panel = Panel("velocity", "m/s", "force", "N", tuple(lines))
    caption = "Last cycle of every log; solid: simulated, dotted: measured."
    return Plot("fan", "Force against velocity, all settings", (panel,), caption)


def _absolute(views: Sequence[LogView], colours: Mapping[int, str]) -> Plot:
    lines = []
    for view in views:
        signals, setting = view.signals, view.signals.setting
        v, force = signals.velocity[view.cycle], signals.force_measured[view.cycle]
        kept = thin(_CYCLE_BUCKETS, v, force)
        speed = np.abs(v[kept])
        label = f"setting {setting}"
        lines.append(Line(speed, force[kept], label, colours[setting], setting, "thin"))
    panel = Panel("absolute velocity", "m/s", "measured force", "N", tuple(lines))
    caption = "Rebound above, bump below; both branches of each stroke show the hysteresis."
    return Plot("absolute_velocity", "Force against absolute velocity", (panel,), caption)


def _peaks(views: Sequence[LogView], colours: Mapping[int, str]) -> Plot:
    lines = []
    for view in views:
        setting = view.signals.setting
        for figures, words, style in (
            (view.measured, "measured", "points"),
            (view.simulated, "simulated", "triangles"),
        ):
            if figures is None:
                continue
            speeds = np.array([figures.peak_speed_rebound, -figures.peak_speed_bump])
            forces = np.array([figures.peak_force_rebound, figures.peak_force_bump])
            label = f"{view.signals.log}, {words}"
            lines.append(Line(speeds, forces, label, colours[setting], setting, style, False))
    panel = Panel("peak velocity", "m/s", "peak force", "N", tuple(lines))
    caption = "One pair per log, rebound right, bump left; dots: measured, triangles: simulated."
    return Plot("peak_force", "Peak force against peak velocity", (panel,), caption)


def _named_speeds(views: Sequence[LogView]) -> Iterator[Plot]:
    lines = []
    for k, speed in enumerate(NAMED_SPEEDS):
        found: list[tuple[int, float, float]] = [
            (view.signals.setting, forces.rebound, forces.bump)
            for view in views
            for forces in (view.measured.speed_forces if view.measured else ())
            if forces.speed == speed
        ]
        if not found:
            continue
        at = np.array([float(setting) for setting, _, _ in found])
        colour = _SPEED_COLOURS[k]
        for column, word, style in ((1, "rebound", "points"), (2, "bump", "triangles")):
            values = np.array([row[column] for row in found])
            lines.append(Line(at, values, f"{word}, {speed:g} m/s", colour, None, style))
    if lines:
        panel = Panel("setting", "", "measured force", "N", tuple(lines))
        title = "Force against setting at named speeds"
        yield Plot("named_speeds", title, (panel,), "Mean of the opening and the closing branch.")


# Okabe and Ito (2008), readable on white and on black.
_SPEED_COLOURS = ("#56b4e9", "#0072b2", "#009e73", "#e69f00", "#d55e00", "#cc79a7", "#888888")
