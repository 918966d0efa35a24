"""The plots of all settings together: parameters, MSE, the fan, forces (Figs 13-16)."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit.report.evaluated_log import has_several_speeds, peak_points
from damperfit.report.plots.branches import is_moving, mean_branches
from damperfit.report.plots.colours import SPEED_COLOURS
from damperfit.report.plots.description import (
    Line,
    Panel,
    Plot,
    setting_axis,
    setting_names,
    setting_places,
    thin,
)
from damperfit.report.plots.parameters import parameter_plots
from damperfit.simulation import NAMED_SPEEDS
from damperfit.tables import PAPER_QUANTITIES

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from damperfit.adjustment import Trend
    from damperfit.damper.quantity import Quantity
    from damperfit.report.evaluated_log import EvaluatedLog
    from damperfit.report.sheets.peak_sheet import PeakPoint
    from damperfit.tested.setting import Setting

    FloatArray = NDArray[np.float64]
    Row = Mapping[str, Any]

__all__ = ["campaign_plots"]

_CYCLE_BUCKETS = 500  # a cycle of 3000 samples is drawn as it is
_BOTH = (("simulated", "wide"), ("measured", "dotted"))


def campaign_plots(
    parameters: Sequence[Row],
    mse: Sequence[Row],
    views: Sequence[EvaluatedLog],
    *,
    colours: Mapping[Setting, str],
    trends: Sequence[Trend] = (),
    quantities: Sequence[Quantity] = PAPER_QUANTITIES,
) -> tuple[Plot, ...]:
    """Return the plots that compare settings; those without data are left out.

    Parameters
    ----------
    parameters, mse : sequence of mapping
        Rows of the tables.
    views : sequence of EvaluatedLog
        Logs with their figures.
    colours : mapping of Setting to str
        Colour of each setting.
    trends : sequence of Trend
        Trends that the run found; where there is none, a quadratic is drawn.
    quantities : sequence of Quantity
        What the rows of parameters are of.
    """
    plots = [*parameter_plots(parameters, colours, trends, quantities), *_errors(mse, colours)]
    if views:
        plots = [_fan(views, colours), *plots, _absolute(views, colours)]
    points = peak_points(views)
    if has_several_speeds(points):
        plots.insert(1, _peaks(points, colours))
    if any(view.measured for view in views):
        plots += _named_speeds(views)
    return tuple(plots)


def _errors(rows: Sequence[Row], colours: Mapping[Setting, str]) -> Iterator[Plot]:
    whole = [row for row in rows if not row["log"] and _is_positive(row["mse_percent"])]
    if not whole:
        return
    places = setting_places(row["setting"] for row in whole)
    lines = [
        Line(
            np.array([places[row["setting"]]]),
            np.array([row["mse_percent"]]),
            f"MSE, setting {row['setting']}",
            colours[row["setting"]],
            setting=row["setting"],
            style="points",
            in_legend=False,
        )
        for row in whole
    ]
    floor = [row for row in whole if _is_positive(row["noise_floor_percent"])]
    if floor:
        at = np.array([places[row["setting"]] for row in floor])
        values = np.array([row["noise_floor_percent"] for row in floor])
        lines.insert(0, Line(at, values, "noise floor", "muted", style="dashed"))
    rules = ((1.0, "1 %: excellent below"), (5.0, "5 %: good below"))
    ticks, x_range = setting_axis(row["setting"] for row in whole)
    panel = Panel(
        *("setting", "", "MSE", "%", tuple(lines)),
        rules=rules,
        is_log=True,
        ticks=ticks,
        names=setting_names(places),
        x_range=x_range,
    )
    caption = "Dots: MSE, 100 % would be no better than the mean force."
    if floor:
        caption += (
            " Dashed: noise floor, the MSE that scatter of the force explains; above it: the "
            "model, or noise of the displacement."
        )
    yield Plot("mse", "MSE and noise floor against setting", (panel,), caption)


def _is_positive(value: float | None) -> bool:
    return value is not None and 0.0 < value < math.inf  # the axis is logarithmic


def _fan(views: Sequence[EvaluatedLog], colours: Mapping[Setting, str]) -> Plot:
    """Force against velocity: all simulated loops first, the measured ones thin on top of them."""
    lines = []
    for words, style in _BOTH:
        for view in views:
            signals, setting = view.signals, view.signals.setting
            force = signals.force if words == "simulated" else signals.force_measured
            colour = colours[setting] if words == "simulated" else "ink"
            for v, f, more in _strands(view, force):
                lines.append(
                    Line(v, f, f"setting {setting}, {words}{more}", colour, setting, style)
                )
    panel = Panel("velocity", "m/s", "force", "N", tuple(lines))
    caption = (
        "Last cycle of every log; wide in the setting's colour: simulated, dark and dotted on top "
        f"of it: measured. Rebound to the right and up, bump to the left and down.{_means(views)}"
    )
    return Plot("fan", "Force against velocity, all settings", (panel,), caption, _BOTH)


def _absolute(views: Sequence[EvaluatedLog], colours: Mapping[Setting, str]) -> Plot:
    lines = []
    for view in views:
        setting = view.signals.setting
        for v, force, more in _strands(view, view.signals.force_measured):
            # The means leap over zero: from there a line would join rebound and bump.
            for part in (v >= 0.0, v < 0.0) if more else (np.ones(len(v), dtype=bool),):
                label = f"setting {setting}, measured{more}"
                kept = np.abs(v[part]), force[part]
                lines.append(Line(*kept, label, colours[setting], setting, "thin"))
    panel = Panel("absolute velocity", "m/s", "measured force", "N", tuple(lines))
    caption = (
        "Rebound above, bump below; both branches of each stroke show the hysteresis."
        f"{_means(views)}"
    )
    title = "Force against absolute velocity, measured"
    return Plot("absolute_velocity", title, (panel,), caption, (("measured", "thin"),))


def _strands(view: EvaluatedLog, force: FloatArray) -> Iterator[tuple[FloatArray, FloatArray, str]]:
    """Yield velocity and force of the last cycle; where none repeats, the means of both branches.

    The last is a word for the label, empty for a cycle.
    """
    v, f = view.signals.velocity[view.cycle], force[view.cycle]
    if not is_moving(view):
        kept = thin(_CYCLE_BUCKETS, v, f)
        yield v[kept], f[kept], ""
        return
    for branch in mean_branches(v, f):
        yield branch.velocity, branch.mean, f", mean, {branch.word} branch"


def _means(views: Sequence[EvaluatedLog]) -> str:
    """Return what is drawn of logs without a cycle, as a sentence."""
    n = sum(map(is_moving, views))
    if not n:
        return ""
    whose = "the logs" if n == len(views) else f"{n} of {len(views)} logs"
    return (
        f" Of {whose} no cycle repeats: the mean force by velocity is drawn, of the opening and "
        "of the closing branch."
    )


def _peaks(points: Sequence[PeakPoint], colours: Mapping[Setting, str]) -> Plot:
    """Peak force of each test; tests of one setting at several speeds are joined."""
    lines = []
    for setting in sorted({one.setting for one in points}):
        mine = [one for one in points if one.setting == setting]
        for words, style in (("simulated", "triangle_line"), ("measured", "points")):
            known = [getattr(one, words) for one in mine]
            for stroke, sign in (("rebound", 1.0), ("bump", -1.0)):
                pairs = sorted(
                    (
                        sign * getattr(one, f"peak_speed_{stroke}"),
                        getattr(one, f"peak_force_{stroke}"),
                    )
                    for one in known
                )
                speeds, forces = (np.array(column) for column in zip(*pairs, strict=True))
                label = f"setting {setting}, {words}, {stroke}"
                colour = colours[setting] if words == "simulated" else "ink"
                lines.append(Line(speeds, forces, label, colour, setting, style))
    panel = Panel("peak velocity", "m/s", "peak force", "N", tuple(lines))
    caption = (
        "One pair per log, and per stretch where a log has several; rebound right, bump left; "
        "dark dots: measured, triangles: simulated. Those of one setting are joined."
    )
    key = (("measured", "points"), ("simulated", "triangles"))
    return Plot("peak_force", "Peak force against peak velocity (PVP)", (panel,), caption, key)


def _mean_of_known(pairs: Sequence[tuple[float, float]]) -> FloatArray:
    """Mean force of each stroke over the logs that reach the speed; NaN where none does."""
    forces = np.array(pairs)
    n = np.isfinite(forces).sum(axis=0)
    return np.asarray(np.where(n > 0, np.nansum(forces, axis=0) / np.maximum(n, 1), np.nan))


def _named_speeds(views: Sequence[EvaluatedLog]) -> Iterator[Plot]:
    lines = []
    places = setting_places(view.signals.setting for view in views)
    for speed, colour in zip(NAMED_SPEEDS, SPEED_COLOURS, strict=True):
        found: dict[Setting, list[tuple[float, float]]] = {}
        for view in views:
            for forces in view.measured.speed_forces if view.measured else ():
                if forces.speed == speed:
                    pair = (forces.rebound, forces.bump)
                    found.setdefault(view.signals.setting, []).append(pair)
        if not found:
            continue
        at = np.array([places[setting] for setting in sorted(found)])
        means = np.array([_mean_of_known(found[setting]) for setting in sorted(found)])
        for k, (word, style) in enumerate((("rebound", "dot_line"), ("bump", "triangle_line"))):
            label = f"{word}, {speed:g} m/s"
            lines.append(Line(at, means[:, k], label, colour, None, style))
    if lines:
        ticks, x_range = setting_axis(places)
        panel = Panel(
            *("setting", "", "measured force", "N", tuple(lines)),
            ticks=ticks,
            names=setting_names(places),
            x_range=x_range,
        )
        title = "Force against setting at named speeds"
        caption = (
            "Mean of the opening and the closing branch, and of those logs of a setting that reach "
            "the speed. "
            "Dots: rebound, triangles: bump."
        )
        yield Plot("named_speeds", title, (panel,), caption)
