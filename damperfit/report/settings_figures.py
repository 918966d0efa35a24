"""The figures of all settings, of runs over one another, and the list of a report's figures."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit.comparison import common_tests
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
from damperfit.report.log_figures import is_moving, mean_branches, setting_plots, valve_plots
from damperfit.report.logs import evaluate_logs, has_several_speeds, peak_points
from damperfit.report.records import trends_in, units_in
from damperfit.report.tables import is_one_for_all, scale_of
from damperfit.report.units import plot_in_units
from damperfit.simulation import NAMED_SPEEDS
from damperfit.tables import PAPER_QUANTITIES
from damperfit.tested.setting import Setting, lines_of
from damperfit.units.shown_units import SI, ShownUnits

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from damperfit.adjustment import Trend
    from damperfit.damper.quantity import Quantity

    Row = Mapping[str, Any]
    from numpy.typing import NDArray

    from damperfit.report.forces import PeakPoint
    from damperfit.report.logs import EvaluatedLog

    FloatArray = NDArray[np.float64]
    from collections.abc import Mapping

    from damperfit.comparison import ComparedRun, MeasuredTest, RunComparison
    from damperfit.results import Run

__all__ = [
    "RUN_COLOURS",
    "ReportPlots",
    "campaign_plots",
    "difference_plots",
    "loop_plots",
    "parameter_plots",
    "report_plots",
]


# Parameters against setting, with intervals and the trend over the settings (Figs 14-16).

_TREND_POINTS = 4  # a quadratic through fewer says nothing
_ALONG = ("dashed", "dotted")  # trends of the first adjuster, of the second, ...
_NAMED = 6  # trends along adjusters that a legend names
_FAR = 3.0  # heights of the fitted values: a value at a bound beyond it would flatten them


def parameter_plots(
    rows: Sequence[Row],
    colours: Mapping[Setting, str],
    trends: Sequence[Trend] = (),
    quantities: Sequence[Quantity] = PAPER_QUANTITIES,
) -> Iterator[Plot]:
    """Yield one plot per parameter that is known at some setting, and not one for all of them.

    Parameters
    ----------
    rows : sequence of mapping
        Rows of the table of parameters.
    colours : mapping of Setting to str
        Colour of each setting.
    trends : sequence of Trend
        Trends that the run found.
    quantities : sequence of Quantity
        What the rows are of.
    """
    places = setting_places(row["setting"] for row in rows)
    names = setting_names(places)
    by_parameter = {} if names else {trend.parameter: trend for trend in trends}
    lined = [one for one in trends if one.points] if names else []
    for one in quantities:
        name, scale = one.name, scale_of(one)
        known = [row for row in rows if _is_shown(row, name)]
        if not known or (one.default is not None and {row[name] for row in known} == {one.default}):
            continue
        if is_one_for_all(rows, name):  # a sentence tells it: twenty equal bars say no more
            continue
        y_range, far = _window(known, name, scale.factor)
        points = [
            replace(
                _point(row, name, scale.factor, colours[row["setting"]], far),
                x=np.array([places[row["setting"]]]),
            )
            for row in known
        ]
        trend = by_parameter.get(name)
        curve = _trend_lines(trend, scale.factor) if trend else ()
        along = [one for one in lined if one.parameter == name]
        lines = (
            *(curve or (() if names else _quadratic(known, name, scale.factor))),
            *_along_adjusters(along, places, scale.factor),
            *_rings(trend, known, name, scale.factor),
            *points,
        )
        ticks, x_range = setting_axis(row["setting"] for row in rows)
        panel = Panel(
            *("setting", "", scale.symbol, scale.axis, lines),
            ticks=ticks,
            names=names,
            x_range=x_range,
            y_range=y_range,
        )
        caption = " ".join(_caption(rows, known, name, far, trend))
        if along:
            caption += " Broken lines: trends along one adjuster with the others held."
        named = dict.fromkeys((scale.symbol, scale.meaning))  # play is called play
        title = f"{', '.join(named)}, against setting"
        yield Plot(f"parameter_{name}", title, (panel,), caption)


def _is_shown(row: Row, name: str) -> bool:
    value = row[name]
    is_known = value is not None and math.isfinite(value)
    return is_known and row[f"{name}_status"] not in {"absent", "not_identifiable"}


def _is_fitted(row: Row, name: str) -> bool:
    return row[f"{name}_status"] in {"fitted", None}


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


def _point(row: Row, name: str, factor: float, colour: str, far: Mapping[Setting, float]) -> Line:
    setting = row["setting"]
    low, high = row[f"{name}_ci_low"], row[f"{name}_ci_high"]
    # "<=" is also what NaN fails.
    has_interval = None not in {low, high} and low <= row[name] <= high and setting not in far
    label, style = f"setting {setting}", "points" if _is_fitted(row, name) else "triangles"
    if setting in far:
        value = factor * row[name]
        style = "above" if value > far[setting] else "below"
        label = f"setting {setting}, off the scale at {value:.3g}"
    return Line(
        np.array([math.nan]),
        np.array([far.get(setting, factor * row[name])]),
        label,
        colour,
        setting=setting,
        style=style,
        in_legend=False,
        low=np.array([factor * low]) if has_interval else None,
        high=np.array([factor * high]) if has_interval else None,
    )


def _trend_lines(trend: Trend, factor: float) -> tuple[Line, ...]:
    if not trend.points:
        return ()
    x, y, low, high = (
        np.array([getattr(point, name) for point in trend.points], dtype=np.float64)
        for name in ("setting", "value", "low", "high")
    )
    has_band = bool(np.isfinite(low).all() and np.isfinite(high).all())
    return (
        Line(
            x,
            factor * y,
            "trend, 95 %" if has_band else "trend",
            "muted",
            style="dashed",
            low=factor * low if has_band else None,
            high=factor * high if has_band else None,
        ),
    )


def _along_adjusters(
    trends: Sequence[Trend], places: Mapping[Setting, float], factor: float
) -> Iterator[Line]:
    """Yield each trend through the settings of its line, which stand beside others on the axis."""
    adjusters = list(dict.fromkeys(one.adjuster for one in trends))
    standing = {(line.adjuster, line.held): line for line in lines_of(places)}
    for trend in trends:
        line = standing.get((trend.adjuster, trend.held))
        values = {float(point.setting): point.value for point in trend.points}
        numbers = {} if line is None else line.numbers
        on = [setting for setting, number in numbers.items() if number in values]
        if not on:
            continue
        x = np.array([places[one] for one in on])
        y = factor * np.array([values[numbers[one]] for one in on])
        label = f"trend along {trend.adjuster}" + (f", {trend.held}" if trend.held else "")
        style = _ALONG[adjusters.index(trend.adjuster) % len(_ALONG)]
        yield Line(x, y, label, "muted", style=style, in_legend=len(trends) <= _NAMED)
        off = {float(one.setting): one.value for one in trend.outliers}
        outside = [setting for setting, number in numbers.items() if number in off]
        if outside:
            at = np.array([places[one] for one in outside])
            found = factor * np.array([off[numbers[one]] for one in outside])
            yield Line(at, found, "off the trend", "ink", style="rings", in_legend=False)


def _rings(trend: Trend | None, rows: Sequence[Row], name: str, factor: float) -> tuple[Line, ...]:
    """Ring the settings off the trend."""
    outliers = {one.setting for one in trend.outliers} if trend is not None else set()
    places = {
        Setting.of(row["setting"]).number(): factor * row[name]
        for row in rows
        if row["setting"] in outliers
    }
    if not places:
        return ()
    x, y = np.array(list(places)), np.array(list(places.values()))
    return (Line(x, y, "off the trend", "ink", style="rings"),)


def _quadratic(rows: Sequence[Row], name: str, factor: float) -> tuple[Line, ...]:
    free = [row for row in rows if _is_fitted(row, name)]
    x = np.array([Setting.of(row["setting"]).number() for row in free])
    if len(set(x.tolist())) < _TREND_POINTS:
        return ()
    y = factor * np.array([row[name] for row in free])
    middle, reach = x.mean(), np.ptp(x)  # centred: settings such as 1001 stay well conditioned
    fitted = np.polyfit((x - middle) / reach, y, 2)
    at = np.linspace(x.min(), x.max(), 50)
    curve = np.polyval(fitted, (at - middle) / reach)
    return (Line(at, curve, "least-squares quadratic", "muted", style="dashed"),)


def _caption(
    rows: Sequence[Row],
    known: Sequence[Row],
    name: str,
    far: Mapping[Setting, float],
    trend: Trend | None,
) -> Iterator[str]:
    fitted = [row for row in known if _is_fitted(row, name)]
    held = {
        str(row[f"{name}_status"]).replace("_", " ")
        for row in known
        if row not in fitted and row["setting"] not in far
    }
    if fitted:
        yield "Dots: fitted."
    if held:
        yield f"Open triangles: {', '.join(sorted(held))}."
    if any(row[f"{name}_ci_low"] is not None for row in known):
        yield "Bars: 95 % interval."
    elif fitted:
        yield "No intervals in the table."
    if far:
        yield "Filled triangles at the edge: at a bound, off the scale."
    unknown = [str(row["setting"]) for row in rows if row[f"{name}_status"] == "not_identifiable"]
    if unknown:
        yield f"Not shown, not determined by these logs: setting {', '.join(unknown)}."
    if trend is not None and trend.sentence:
        yield trend.sentence


# The plots of all settings together: parameters, MSE, the fan, forces (Figs 13-16).

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


# Runs over one another: loops of a setting with their differences below, and all settings.

# Okabe and Ito (2008), readable on white and on black; the reference is in ink.
RUN_COLOURS = ("ink", "#d55e00", "#0072b2", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")


def loop_plots(runs: Sequence[ComparedRun], setting: Setting, *, name: str) -> tuple[Plot, ...]:
    """Return force against velocity and displacement of a setting, where all ran one motion.

    Parameters
    ----------
    runs : sequence of ComparedRun
        The reference first.
    setting : Setting
        Which.
    name : str
        What the names of the plots begin with.
    """
    groups = common_tests(runs, setting)
    if groups is None:
        return ()
    if any(not len(test.displacement) for group in groups for test in group):
        return (_points(runs, groups, setting, name),)
    loops = [_mean_loop(group) for group in groups]
    # One phase is one motion: forces are taken from each other there.
    apart = [loop[2] - loops[0][2] for loop in loops[1:]]
    plots = []
    for row, (axis, unit, factor, word) in enumerate(
        (("velocity", "m/s", 1.0, "velocity"), ("displacement", "mm", 1e3, "displacement"))
    ):
        place = 1 - row
        upper = tuple(
            Line(
                *_closed(factor * loop[place], loop[2]),
                run.name,
                _colour(k),
                setting=setting,
                style="thin" if k == 0 else "wide",
            )
            # The reference last and thin: it would else be hidden where nothing differs.
            for k, (run, loop) in reversed(list(enumerate(zip(runs, loops, strict=True))))
        )
        lower = tuple(
            Line(
                *_closed(factor * loops[0][place], difference),
                f"{run.name} less {runs[0].name}",
                _colour(k),
                setting=setting,
                style="thin",
                in_legend=False,
            )
            for k, (run, difference) in enumerate(zip(runs[1:], apart, strict=True), start=1)
        )
        panels = (
            Panel(axis, unit, "force", "N", upper),
            Panel(axis, unit, "difference", "N", lower, rules=((0.0, ""),)),
        )
        plots.append(
            Plot(
                f"{name}_force_{word}",
                f"Setting {setting}: force against {word}",
                panels,
                f"Mean measured cycles. Below: less {runs[0].name}, phase by phase.",
            )
        )
    return tuple(plots)


def _points(
    runs: Sequence[ComparedRun],
    groups: Sequence[tuple[MeasuredTest, ...]],
    setting: Setting,
    name: str,
) -> Plot:
    """Return force over velocity of curves without time."""
    lines = tuple(
        Line(
            test.velocity,
            test.force,
            run.name,
            _colour(k),
            setting=setting,
            style="points" if k == 0 else "triangles",
        )
        for k, (run, group) in enumerate(zip(runs, groups, strict=True))
        for test in group[:1]
    )
    panel = Panel("velocity", "m/s", "force", "N", lines)
    return Plot(
        f"{name}_force_velocity", f"Setting {setting}: force against velocity", (panel,), ""
    )


def _colour(k: int) -> str:
    return RUN_COLOURS[k % len(RUN_COLOURS)]


def _mean_loop(group: Sequence[MeasuredTest]) -> FloatArray:
    """Return x, v and force of the mean of several tests, begun where x passes its middle."""
    return np.asarray(np.mean([_aligned(test) for test in group], axis=0))


def _aligned(test: MeasuredTest) -> FloatArray:
    """Return x, v and force over one cycle from the rising passage of mid-stroke."""
    x = test.displacement - 0.5 * (test.displacement.max() + test.displacement.min())
    n = len(x)
    later = np.roll(x, -1)
    rises = np.flatnonzero((x < 0.0) & (later >= 0.0))
    start = 0.0
    if len(rises):
        at = int(rises[np.argmax(test.velocity[rises])])
        start = at + float(x[at] / (x[at] - later[at]))
    phases = start + np.arange(n)
    rows = (x, test.velocity, test.force)
    return np.stack([np.interp(phases, np.arange(n), row, period=n) for row in rows])


def _closed(x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    return np.append(x, x[0]), np.append(y, y[0])


def difference_plots(comparisons: Sequence[RunComparison]) -> tuple[Plot, ...]:
    """Return the difference of force over the settings, at the fastest speed of each pair.

    Parameters
    ----------
    comparisons : sequence of RunComparison
        With one reference.
    """
    plots = []
    settings = sorted({s for one in comparisons for s in one.settings})
    places = setting_places(settings)
    ticks, shown = setting_axis(settings)
    is_bare = any(one.is_without_model for one in comparisons)
    whole = "measured force" if is_bare else "damping"
    for stroke in ("rebound", "bump"):
        lines, speeds = [], []
        for k, one in enumerate(comparisons, start=1):
            known = [
                line
                for line in one.of("force")
                if line.subject.stroke == stroke and math.isfinite(line.percent)
            ]
            top = max((line.subject.speed or 0.0 for line in known), default=0.0)
            known = [line for line in known if line.subject.speed == top]
            if not known:
                continue
            speeds.append(top)
            x = np.array([places[line.subject.setting] for line in known if line.subject.setting])
            y, low, high = np.array(
                [(line.percent, line.percent_low, line.percent_high) for line in known]
            ).T
            has_errors = bool(np.isfinite(low).all())
            lines.append(
                Line(
                    x,
                    y,
                    f"{one.second.name}, {one.units.write_speed(top)}",
                    _colour(k),
                    style="points",
                    low=low if has_errors else None,
                    high=high if has_errors else None,
                )
            )
        if lines:
            panel = Panel(
                *("setting", "", "difference", f"% of {whole}", tuple(lines)),
                rules=((0.0, ""),),
                ticks=ticks,
                names=setting_names(settings),
                x_range=shown,
            )
            title = f"Difference of force in {stroke}, with 95 % intervals"
            name = comparisons[0].first.name
            at = " and ".join(map(comparisons[0].units.write_speed, dict.fromkeys(speeds)))
            caption = f"At {at}. Above zero: harder than {name}."
            plots.append(Plot(f"difference_{stroke}", title, (panel,), caption))
    return tuple(plots)


# All plots of a results folder, in the order of the report.


@dataclass(frozen=True, slots=True, eq=False)
class ReportPlots:
    """Everything that is drawn from a results folder.

    Attributes
    ----------
    run : Run
        The tables.
    colours : mapping of Setting to str
        Colour of each setting.
    overall : tuple of Plot
        All settings together.
    by_log : tuple of (EvaluatedLog, tuple of Plot)
        Each log.
    units : ShownUnits
        Of the plots; the logs are in SI.
    """

    run: Run
    colours: Mapping[Setting, str]
    overall: tuple[Plot, ...]
    by_log: tuple[tuple[EvaluatedLog, tuple[Plot, ...]], ...]
    units: ShownUnits = SI

    @property
    def plots(self) -> tuple[Plot, ...]:
        """All plots in the order of the report."""
        return (*self.overall, *(plot for _, plots in self.by_log for plot in plots))


def report_plots(run: Run, units: ShownUnits | None = None) -> ReportPlots:
    """Lay out the plots of a results folder.

    Parameters
    ----------
    run : Run
        The folder.
    units : ShownUnits or None
        Of forces, speeds and displacements; None: those of the run.
    """
    units = units_in(run.record) if units is None else units
    logs = evaluate_logs(run)
    colours = setting_colours(
        [
            *(row["setting"] for row in run.rows("parameters")),
            *(row["setting"] for row in run.rows("mse")),
            *(log.signals.setting for log in logs),
        ]
    )
    overall = campaign_plots(
        *(run.rows("parameters"), run.rows("mse"), logs),
        colours=colours,
        trends=trends_in(run.record),
        quantities=run.quantities,
    )
    by_log = []
    counts: dict[Setting, int] = {}
    for log in logs:
        setting = log.signals.setting
        counts[setting] = counts.get(setting, 0) + 1
        more = f"_log_{counts[setting]}" if counts[setting] > 1 else ""
        name = f"setting_{setting.slug}{more}"
        plots = setting_plots(log, name=name, colour=colours[setting])
        if counts[setting] == 1:  # the valves are those of all its logs
            plots = (*plots, *valve_plots(run.rows("valves"), setting, colour=colours[setting]))
        by_log.append((log, plots))
    overall = tuple(plot_in_units(plot, units) for plot in overall)
    shown = tuple((log, tuple(plot_in_units(p, units) for p in plots)) for log, plots in by_log)
    return ReportPlots(run, colours, overall, shown, units)
