"""Parameters against setting, with intervals and the trend over the settings (Figs 14-16)."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit.report.plots.description import (
    Line,
    Panel,
    Plot,
    setting_axis,
    setting_names,
    setting_places,
)
from damperfit.report.sheets.parameter_sheet import is_one_for_all, scale_of
from damperfit.tables import PAPER_QUANTITIES
from damperfit.tested.setting import Setting, lines_of

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from damperfit.adjustment import Trend
    from damperfit.damper.quantity import Quantity

    Row = Mapping[str, Any]

__all__ = ["parameter_plots"]

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
