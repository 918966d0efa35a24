"""The figures of all settings together (the paper's Figs 13-16), and the list of a run's figures.

A figure is a function that yields what it has of it, and a line in `FIGURES` or `LOG_FIGURES`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit.report.figures import (
    SPEED_COLOURS,
    Line,
    Panel,
    Plot,
    setting_axis,
    setting_colours,
    setting_names,
    setting_places,
    thin,
)
from damperfit.report.log_figures import LOG_FIGURES, mean_branches, valve_plots
from damperfit.report.logs import LogView, has_several_speeds, log_views
from damperfit.report.records import trends_in, units_in
from damperfit.report.tables import is_one_for_all, scale_of
from damperfit.report.units import plot_in_units
from damperfit.tested.setting import Setting, lines_of
from damperfit.units.shown_units import SI, ShownUnits

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from damperfit.adjustment.trends import Trend
    from damperfit.damper.quantity import Quantity
    from damperfit.results import Run

    FloatArray = NDArray[np.float64]
    Row = Mapping[str, Any]

__all__ = ["FIGURES", "ReportPlots", "report_plots"]

_BUCKETS = 500  # a cycle of 3000 samples is drawn as it is
_EVERY = 4  # settings of which one is drawn bold and labelled
_ALONG = ("dashed", "dotted")  # trends of the first adjuster, of the second, ...
_NAMED = 6  # trends along adjusters that a legend names
_FAR = 3.0  # heights of the fitted values: a value at a bound beyond it would flatten them
_STROKES = (("rebound", 1.0), ("bump", -1.0))


@dataclass(frozen=True, eq=False)
class ReportPlots:
    """Everything that is drawn from a run.

    Attributes
    ----------
    run : Run
        Whose.
    units : ShownUnits
        Of forces, speeds and displacements in the plots.
    """

    run: Run
    units: ShownUnits = SI

    @cached_property
    def logs(self) -> tuple[LogView, ...]:
        """The logs that have signals."""
        return log_views(self.run)

    @cached_property
    def colours(self) -> Mapping[Setting, str]:
        """Colour of each setting."""
        rows = (*self.run.rows("parameters"), *self.run.rows("mse"))
        return setting_colours(
            [*(row["setting"] for row in rows), *(one.setting for one in self.logs)]
        )

    @cached_property
    def overall(self) -> tuple[Plot, ...]:
        """All settings together; the force-velocity picture comes first."""
        plots = (plot for figure in FIGURES for plot in figure(self))
        return tuple(plot_in_units(plot, self.units) for plot in plots)

    @cached_property
    def by_log(self) -> tuple[tuple[LogView, tuple[Plot, ...]], ...]:
        """Each log; the valves of a setting stand with its first."""
        found = []
        counts: dict[Setting, int] = {}
        for log in self.logs:
            setting = log.setting
            counts[setting] = counts.get(setting, 0) + 1
            more = f"_log_{counts[setting]}" if counts[setting] > 1 else ""
            name, colour = f"setting_{setting.slug}{more}", self.colours[setting]
            plots = [plot for figure in LOG_FIGURES for plot in figure(log, name, colour)]
            if not more:
                plots += valve_plots(self.run.rows("valves"), setting, colour=colour)
            found.append((log, tuple(plot_in_units(plot, self.units) for plot in plots)))
        return tuple(found)

    @property
    def plots(self) -> tuple[Plot, ...]:
        """All plots in the order of the report."""
        return (*self.overall, *(plot for _, plots in self.by_log for plot in plots))


def report_plots(run: Run, units: ShownUnits | None = None) -> ReportPlots:
    """Lay out the plots of a run.

    Parameters
    ----------
    run : Run
        The run.
    units : ShownUnits or None
        Of forces, speeds and displacements; None: those of the run.
    """
    return ReportPlots(run, units_in(run.record) if units is None else units)


def _emphasis(settings: Iterable[Setting]) -> set[Setting]:
    """Return the settings that are drawn bold and labelled: every fourth from the last one down."""
    return set(sorted(settings)[::-_EVERY] if len(set(settings)) > _EVERY else settings)


def _peak_forces(shown: ReportPlots) -> Iterator[Plot]:
    """Peak force against peak velocity: measured points, curves of the model and of the damper."""
    rows = [row for log in shown.logs for row in log.peaks if row["cycles"]]
    if not has_several_speeds(rows):
        return
    settings = sorted({row["setting"] for row in rows})
    bold, lines = _emphasis(settings), []
    for setting in settings:
        style = "wide" if setting in bold else "solid"
        for stroke, sign in _STROKES:
            own = [row for row in shown.run.rows("adjustment") if row["stroke"] == stroke]
            peak = f"speed_{stroke}_m_per_s"
            for word, known, x, y, look in (
                ("damper at constant speed", own, "speed_m_per_s", "model_N", "dashed"),
                ("model", rows, peak, f"simulated_{stroke}_N", style),
                ("measured", rows, peak, f"measured_{stroke}_N", "points"),
            ):
                mine = (row for row in known if row["setting"] == setting)
                pairs = {row[x]: row[y] for row in mine if row[x] and row.get(y) is not None}
                if not pairs:
                    continue
                is_end = look == "wide" and sign > 0.0
                at = np.array(sorted(pairs))
                line = Line(
                    sign * at,
                    np.array([pairs[speed] for speed in sorted(pairs)]),
                    f"setting {setting}, {word}, {'rebound' if sign > 0.0 else 'compression'}",
                    shown.colours[setting],
                    setting,
                    look,
                    tag=setting.label if is_end else "",
                )
                lines.append(line)
    lines.sort(key=lambda line: ("dashed", "solid", "wide", "points").index(line.style))
    panel = Panel("peak velocity", "m/s", "peak force", "N", tuple(lines))
    caption = (
        "Dots: measured, the mean peak force of each segment (PVP); lines: the model at the same "
        "peaks; dashed: the damper alone at constant speed, as in the table. Rebound to the right "
        "and up, compression to the left and down."
    )
    key = (("measured", "points"), ("model", "solid"), ("damper alone", "dashed"))
    yield Plot("peak_force", "Peak force against peak velocity (PVP)", (panel,), caption, key)


def _loops(shown: ReportPlots) -> Iterator[Plot]:
    """Force against velocity: simulated loops in colour, the measured ones thin on top of them."""
    if not shown.logs:
        return
    bold = _emphasis({log.setting for log in shown.logs})
    lines: list[Line] = []
    for word in ("simulated", "measured"):
        for log in shown.logs:
            setting, is_model = log.setting, word == "simulated"
            force = log.signals.force if is_model else log.signals.force_measured
            style = "thin" if not is_model else "wide" if setting in bold else "solid"
            colour = shown.colours[setting] if is_model else "ink"
            for k, (v, f, more) in enumerate(_strands(log, force)):
                tag = setting.label if is_model and setting in bold and k == 0 else ""
                label = f"setting {setting}, {word}{more}"
                lines.append(Line(v, f, label, colour, setting, style, tag=tag))
    panel = Panel("velocity", "m/s", "force", "N", tuple(lines))
    caption = (
        "Last cycle of every log; in the setting's colour: simulated, thin and dark: measured. "
        f"Rebound to the right and up, compression to the left and down.{_means(shown.logs)}"
    )
    key = (("simulated", "solid"), ("measured", "thin"))
    yield Plot("fan", "Force against velocity, all settings", (panel,), caption, key)


def _absolute(shown: ReportPlots) -> Iterator[Plot]:
    lines = []
    for log in shown.logs:
        for v, force, more in _strands(log, log.signals.force_measured):
            # The means leap over zero: from there a line would join rebound and compression.
            for part in (v >= 0.0, v < 0.0) if more else (np.ones(len(v), dtype=bool),):
                label = f"setting {log.setting}, measured{more}"
                kept = np.abs(v[part]), force[part]
                lines.append(Line(*kept, label, shown.colours[log.setting], log.setting, "thin"))
    if not lines:
        return
    panel = Panel("absolute velocity", "m/s", "measured force", "N", tuple(lines))
    caption = (
        "Rebound above, compression below; both branches of each stroke show the hysteresis."
        f"{_means(shown.logs)}"
    )
    title = "Force against absolute velocity, measured"
    yield Plot("absolute_velocity", title, (panel,), caption, (("measured", "thin"),))


def _strands(view: LogView, force: FloatArray) -> Iterator[tuple[FloatArray, FloatArray, str]]:
    """Yield velocity and force of the last cycle, or means of both branches where none repeats."""
    v, f = view.signals.velocity[view.cycle], force[view.cycle]
    if not view.is_moving:
        kept = thin(_BUCKETS, v, f)
        yield v[kept], f[kept], ""
        return
    for branch in mean_branches(v, f):
        yield branch.velocity, branch.mean, f", mean, {branch.word} branch"


def _means(logs: Sequence[LogView]) -> str:
    """Return what is drawn of logs without a cycle, as a sentence."""
    n = sum(log.is_moving for log in logs)
    if not n:
        return ""
    whose = "the logs" if n == len(logs) else f"{n} of {len(logs)} logs"
    return (
        f" Of {whose} no cycle repeats: the mean force by velocity is drawn, of the opening and "
        "of the closing branch."
    )


def _named_speeds(shown: ReportPlots) -> Iterator[Plot]:
    rows = shown.run.rows("adjustment")
    places = setting_places({row["setting"] for row in rows})
    lines = []
    speeds = sorted({row["speed_m_per_s"] for row in rows})
    for k, speed in enumerate(speeds):
        for stroke, style in (("rebound", "dot_line"), ("bump", "triangle_line")):
            # With several adjusters a setting has a row for each that was turned.
            forces = {
                places[row["setting"]]: row["force_N"]
                for row in rows
                if row["speed_m_per_s"] == speed and row["stroke"] == stroke
            }
            at = sorted(place for place, force in forces.items() if force is not None)
            x, y = np.array(at), np.array([forces[place] for place in at])
            words = "rebound" if stroke == "rebound" else "compression"
            colour = SPEED_COLOURS[k % len(SPEED_COLOURS)]
            lines.append(Line(x, y, f"{words}, {speed:g} m/s", colour, None, style))
    if lines:
        panel = _setting_panel(places, "force", "N", tuple(lines))
        caption = "The model's, as in the table. Dots: rebound, triangles: compression."
        yield Plot("named_speeds", "Force against setting at named speeds", (panel,), caption)


def _setting_panel(
    settings: Iterable[Setting], label: str, unit: str, lines: tuple[Line, ...], **more: Any
) -> Panel:
    known = list(settings)
    ticks, x_range = setting_axis(known)
    names = setting_names(known)
    return Panel(
        "setting", "", label, unit, lines, ticks=ticks, names=names, x_range=x_range, **more
    )


def _errors(shown: ReportPlots) -> Iterator[Plot]:
    def is_positive(value: float | None) -> bool:
        return value is not None and 0.0 < value < math.inf  # the axis is logarithmic

    rows = shown.run.rows("mse")
    whole = [row for row in rows if not row["log"] and is_positive(row["mse_percent"])]
    if not whole:
        return
    places = setting_places(row["setting"] for row in whole)

    def points(rows: Sequence[Row], name: str) -> tuple[FloatArray, FloatArray]:
        at = [places[row["setting"]] for row in rows]
        return np.array(at), np.array([row[name] for row in rows])

    lines = [
        Line(
            *(*points([row], "mse_percent"), f"MSE, setting {row['setting']}"),
            *(shown.colours[row["setting"]], row["setting"], "points"),
            in_legend=False,
        )
        for row in whole
    ]
    floor = [row for row in whole if is_positive(row["noise_floor_percent"])]
    caption = "Dots: MSE, 100 % would be no better than the mean force."
    if floor:
        drawn = points(floor, "noise_floor_percent")
        lines.insert(0, Line(*drawn, "noise floor", "muted", style="dashed"))
        caption += (
            " Dashed: noise floor, the MSE that scatter of the force explains; above it: the "
            "model, or noise of the displacement."
        )
    rules = ((1.0, "1 %: excellent below"), (5.0, "5 %: good below"))
    panel = _setting_panel(places, "MSE", "%", tuple(lines), rules=rules, is_log=True)
    yield Plot("mse", "MSE and noise floor against setting", (panel,), caption)


def _parameters(shown: ReportPlots) -> Iterator[Plot]:
    """Each parameter that is known at some setting, and not one for all of them."""
    rows = shown.run.rows("parameters")
    trends = trends_in(shown.run.record)
    places = setting_places(row["setting"] for row in rows)
    is_numbered = not setting_names(places)
    for one in shown.run.quantities:
        name, scale = one.name, scale_of(one)
        known = [row for row in rows if _is_shown(row, name)]
        is_default = one.default is not None and {row[name] for row in known} == {one.default}
        if not known or is_default or (len(rows) > 1 and is_one_for_all(rows, name)):
            continue  # a sentence tells it: twenty equal bars say no more
        y_range, far = _window(known, name, scale.factor)
        mine = [trend for trend in trends if trend.parameter == name and trend.points]
        curves = (
            [_trend_line(trend, scale.factor) for trend in mine]
            if is_numbered
            else [*_along_adjusters(mine, places, scale.factor)]
        )
        off = {float(outlier.setting) for trend in mine for outlier in trend.outliers}
        rings = [
            Line(
                np.array([places[row["setting"]]]), np.array([scale.factor * row[name]]),
                "off the trend", "ink", style="rings", in_legend=False,
            )
            for row in known
            if is_numbered and row["setting"].number() in off
        ]  # fmt: skip
        points = [
            _point(row, places[row["setting"]], one, shown.colours[row["setting"]], far)
            for row in known
        ]
        lines = (*curves, *rings, *points)
        panel = _setting_panel(places, scale.symbol, scale.axis, lines, y_range=y_range)
        caption = " ".join(_caption(rows, known, name, far))
        if mine and not is_numbered:
            caption += " Broken lines: trends along one adjuster with the others held."
        named = dict.fromkeys((scale.symbol, scale.meaning))  # play is called play
        yield Plot(f"parameter_{name}", f"{', '.join(named)}, against setting", (panel,), caption)


def _is_shown(row: Row, name: str) -> bool:
    value = row[name]
    is_known = value is not None and math.isfinite(value)
    return is_known and row[f"{name}_status"] not in {"absent", "not_identifiable"}


def _window(
    rows: Sequence[Row], name: str, factor: float
) -> tuple[tuple[float, float] | None, dict[Setting, float]]:
    """Return a range of y that fits the fitted values, and where others are drawn at its edge."""
    trusted = [row for row in rows if row[f"{name}_status"] not in {"absent", "at_bound"}]
    values = [
        factor * end
        for row in trusted
        for end in (row[name], row[f"{name}_ci_low"], row[f"{name}_ci_high"])
        if end is not None and math.isfinite(end)
    ]
    if not values or len(trusted) == len(rows):
        return None, {}
    low, high = min(values), max(values)
    height = (high - low) or abs(high) or 1.0
    bound = {row["setting"]: factor * row[name] for row in rows if row not in trusted}
    is_far = {s: not low - _FAR * height < y < high + _FAR * height for s, y in bound.items()}
    if not any(is_far.values()):
        return None, {}
    near = [y for s, y in bound.items() if not is_far[s]]
    low, high = min([low, *near]), max([high, *near])
    height = (high - low) or height
    edges = low - 0.12 * height, high + 0.12 * height
    inside = low - 0.07 * height, high + 0.07 * height
    far = {s: inside[0] if bound[s] < low else inside[1] for s, is_out in is_far.items() if is_out}
    return edges, far


def _point(
    row: Row, place: float, quantity: Quantity, colour: str, far: Mapping[Setting, float]
) -> Line:
    name, factor, setting = quantity.name, scale_of(quantity).factor, row["setting"]
    value, low, high = (row[f"{name}{end}"] for end in ("", "_ci_low", "_ci_high"))
    # "<=" is also what NaN fails.
    has_interval = None not in {low, high} and low <= value <= high and setting not in far
    label = f"setting {setting}"
    style = "points" if row[f"{name}_status"] in {"fitted", None} else "triangles"
    if setting in far:
        style = "above" if factor * value > far[setting] else "below"
        label += f", off the scale at {factor * value:.3g}"
    return Line(
        np.array([place]),
        np.array([far.get(setting, factor * value)]),
        *(label, colour, setting, style),
        in_legend=False,
        low=np.array([factor * low]) if has_interval else None,
        high=np.array([factor * high]) if has_interval else None,
    )


def _trend_line(trend: Trend, factor: float) -> Line:
    x, y, low, high = (
        np.array([getattr(point, name) for point in trend.points], dtype=np.float64)
        for name in ("setting", "value", "low", "high")
    )
    has_band = bool(np.isfinite(low).all() and np.isfinite(high).all())
    return Line(
        *(x, factor * y, "trend, 95 %" if has_band else "trend", "muted"),
        style="dashed",
        low=factor * low if has_band else None,
        high=factor * high if has_band else None,
    )


def _along_adjusters(
    trends: Sequence[Trend], places: Mapping[Setting, float], factor: float
) -> Iterator[Line]:
    """Yield each trend through the settings of its line, which stand beside others on the axis."""
    adjusters = list(dict.fromkeys(one.adjuster for one in trends))
    standing = {(line.adjuster, line.held): line for line in lines_of(places)}
    for trend in trends:
        line = standing.get((trend.adjuster, trend.held))
        numbers = {} if line is None else line.numbers
        for points, is_trend in ((trend.points, True), (trend.outliers, False)):
            values = {float(point.setting): point.value for point in points}
            on = [setting for setting, clicks in numbers.items() if clicks in values]
            if not on:
                continue
            x = np.array([places[one] for one in on])
            y = factor * np.array([values[numbers[one]] for one in on])
            if is_trend:
                label = f"trend along {trend.adjuster}" + (f", {trend.held}" if trend.held else "")
                style = _ALONG[adjusters.index(trend.adjuster) % len(_ALONG)]
                yield Line(x, y, label, "muted", style=style, in_legend=len(trends) <= _NAMED)
            else:
                yield Line(x, y, "off the trend", "ink", style="rings", in_legend=False)


def _caption(
    rows: Sequence[Row],
    known: Sequence[Row],
    name: str,
    far: Mapping[Setting, float],
) -> Iterator[str]:
    fitted = [row for row in known if row[f"{name}_status"] in {"fitted", None}]
    others = (row for row in known if row not in fitted and row["setting"] not in far)
    held = {str(row[f"{name}_status"]).replace("_", " ") for row in others}
    if held:
        yield f"Open triangles: {', '.join(sorted(held))}."
    if any(row[f"{name}_ci_low"] is not None for row in known):
        yield "Bars: 95 % interval."
    if far:
        yield "Filled triangles at the edge: at a bound, off the scale."
    unknown = [str(row["setting"]) for row in rows if row[f"{name}_status"] == "not_identifiable"]
    if unknown:
        yield f"Not shown, not determined by these logs: setting {', '.join(unknown)}."


# What the page and `damperfit report --figures` draw of all settings, the first one on top.
FIGURES: tuple[Callable[[ReportPlots], Iterator[Plot]], ...] = (
    _peak_forces,
    _loops,
    _parameters,
    _errors,
    _absolute,
    _named_speeds,
)
