"""The plots of a run: of all settings (the paper's Figs 13-16) and of each log (Figs 7, 11, 12).

A figure is a function that yields what it has of it, and a line in `FIGURES` or `LOG_FIGURES`. A
road drawn sample by sample is a tangle: where nothing repeats, means of branches and strokes are
drawn, with the range of the forces.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from damperfit.adjustment.force_at import STROKE_WORDS, offsets_in_words
from damperfit.adjustment.trends import Trend
from damperfit.arrays import FloatArray
from damperfit.damper.quasi_static import quasi_static
from damperfit.errors import ConfigurationError, SimulationError
from damperfit.reporting.plots import (
    SPEED_COLOURS,
    Line,
    Panel,
    Plot,
    loop,
    plot_in_units,
    pressure_panel,
    setting_colours,
    setting_names,
    setting_panel,
    setting_places,
    thin,
)
from damperfit.reporting.records import trends_in, units_in
from damperfit.reporting.sheet import number
from damperfit.reporting.tables import Shown, is_one_for_all
from damperfit.statistics import CHI_SQUARED_95
from damperfit.tested.setting import Setting, lines_of
from damperfit.units.shown_units import ShownUnits

if TYPE_CHECKING:
    from damperfit.results import Run
    from damperfit.settings_and_logs import LogResult
    from damperfit.tables.files import LogSignals

    Row = Mapping[str, Any]
    Mean = tuple[FloatArray, FloatArray, str]  # velocity, mean force, in words of what

_LOG_BUCKETS = 200  # of a whole log: peaks of every cycle survive
_CLOUD = 800  # points of a residual plot, besides the peaks
_GAP = 1.5  # sample intervals
_BINS = 24  # of velocity, from the lowest to the highest
_FEW, _FEW_IN_RANGE = 3, 20  # samples: no mean, no range of fewer: each end would be one sample
_RANGE = (5.0, 95.0)  # per cent of the samples that lie below
_POINTS = 60  # of a characteristic
_ONE_SPEED = 0.05  # speeds within this share are one test, run again
_EVERY = 4  # settings of which one is drawn bold and labelled
_ALONG = ("dashed", "dotted")  # trends of the first adjuster, of the second, ...
_NAMED = 6  # trends along adjusters that a legend names
_FAR = 3.0  # heights of the fitted values: a value at a bound beyond it would flatten them
_SIGNS = {"rebound": 1.0, "bump": -1.0}
_BAR, _CM3 = 1e5, 1e-6
_DIRECTIONS = "rebound to the right and up, compression to the left and down"


class DrawnLog(NamedTuple):
    """A log as it is drawn: its plots are called ``name`` and more, its model has a colour."""

    result: LogResult
    signals: LogSignals
    name: str
    colour: str

    @property
    def cycle(self) -> slice:
        """The last cycle of the fastest steady segment, all samples where nothing repeats."""
        log, velocity = slice(0, len(self.signals.time)), self.signals.velocity
        return max(
            self.result.cycles, key=lambda cycle: float(np.ptp(velocity[cycle])), default=log
        )

    @property
    def traces(self) -> tuple[tuple[str, FloatArray, str, str], ...]:
        """Word, force, colour and style: simulated in colour, measured thin on top of it."""
        return (
            ("simulated", self.signals.force, self.colour, "wide"),
            ("measured", self.signals.force_measured, "ink", "thin"),
        )

    def line(
        self, x: FloatArray, y: FloatArray, label: str, colour: str, style: str, **fields: Any
    ) -> Line:
        """Return a line of its setting, with more fields of `Line`."""
        return Line(x, y, label, colour, self.result.setting, style, **fields)

    def plot(self, name: str, title: str, caption: str, *panels: Panel) -> Plot:
        """Return a plot of the log."""
        return Plot(
            f"{self.name}_{name}", f"Setting {self.result.setting}: {title}", panels, caption
        )


@dataclass(frozen=True, eq=False)
class ReportPlots:
    """All plots of ``run``, forces, speeds and displacements in ``units``."""

    run: Run
    units: ShownUnits

    @cached_property
    def logs(self) -> tuple[DrawnLog, ...]:
        """The logs that have signals."""
        drawn: list[DrawnLog] = []
        for signals in self.run.signals:
            setting = signals.setting
            n = 1 + sum(log.result.setting == setting for log in drawn)
            name = f"setting_{setting.slug}" + (f"_log_{n}" if n > 1 else "")
            log = self.run.log_of(signals)
            drawn.append(DrawnLog(log, signals, name, self.colours[setting]))
        return tuple(drawn)

    @cached_property
    def colours(self) -> Mapping[Setting, str]:
        """Colour of each setting."""
        rows = (*self.run.rows("parameters"), *self.run.rows("mse"))
        settings = (row["setting"] for row in rows)
        return setting_colours([*settings, *(log.setting for log in self.run.signals)])

    @cached_property
    def overall(self) -> tuple[Plot, ...]:
        """All settings together; the force-velocity picture comes first."""
        plots = (plot for figure in FIGURES for plot in figure(self))
        return tuple(plot_in_units(plot, self.units) for plot in plots)

    @cached_property
    def by_log(self) -> tuple[tuple[DrawnLog, tuple[Plot, ...]], ...]:
        """The plots of each log; the valves of a setting are with its first log."""
        plots_of, with_valves = [], set()
        for log in self.logs:
            plots = [plot for figure in LOG_FIGURES for plot in figure(log)]
            if log.result.setting not in with_valves:
                plots += _valves(self.run.rows("valves"), log)
            with_valves.add(log.result.setting)
            plots_of.append((log, tuple(plot_in_units(plot, self.units) for plot in plots)))
        return tuple(plots_of)

    @property
    def plots(self) -> tuple[Plot, ...]:
        """All plots in the order of the report."""
        return (*self.overall, *(plot for _, plots in self.by_log for plot in plots))


def report_plots(run: Run, units: ShownUnits | None = None) -> ReportPlots:
    """Return the plots of a run, in some units or, for None, in those of the run."""
    return ReportPlots(run, units_in(run.record) if units is None else units)


# Means where nothing repeats


def _means(
    x: FloatArray, values: FloatArray, mask: NDArray[np.bool_], *, has_range: bool = False
) -> tuple[FloatArray, FloatArray, dict[str, FloatArray]]:
    """Return means of masked values by bins of x, and the range of nine of ten samples."""
    least = _FEW_IN_RANGE if has_range else _FEW
    if len(x) < max(least, _BINS * (not has_range)) or np.ptp(x) == 0.0:
        return np.empty(0), np.empty(0), {}
    edges = np.linspace(x.min(), x.max(), _BINS + 1)
    place = np.clip(np.digitize(x, edges) - 1, 0, _BINS - 1)
    count = np.bincount(place[mask], minlength=_BINS)
    total = np.bincount(place[mask], weights=values[mask], minlength=_BINS)
    filled = np.flatnonzero(count >= least)
    band = {}
    if has_range:
        limits = [np.percentile(values[mask & (place == k)], _RANGE) for k in filled]
        band = dict(zip(("low", "high"), np.reshape(limits, (-1, 2)).T, strict=True))
    return (0.5 * (edges[1:] + edges[:-1]))[filled], total[filled] / count[filled], band


def _branches(velocity: FloatArray, values: FloatArray) -> Iterator[Mean]:
    """Yield the means of both branches by velocity: "opening", where speed grows, and "closing"."""
    is_opening = np.gradient(np.abs(velocity)) > 0.0 if len(velocity) > 1 else velocity > 0.0
    for word, mask in (("opening", is_opening), ("closing", ~is_opening)):
        at, mean, _ = _means(velocity, values, mask)
        if len(at):
            yield at, mean, word


def _strands(log: DrawnLog, force: FloatArray) -> Iterator[Mean]:
    """Yield velocity and force of the last cycle, or means of both branches where none repeats."""
    if not log.result.is_moving:
        yield *loop(log.signals.velocity, force, log.cycle), ""
        return
    for at, mean, word in _branches(log.signals.velocity[log.cycle], force[log.cycle]):
        yield at, mean, f", mean, {word} branch"


def _of_means(logs: Sequence[DrawnLog]) -> str:
    """Return what is drawn of logs without a cycle, as a sentence."""
    n = sum(log.result.is_moving for log in logs)
    group = "the logs" if n == len(logs) else f"{n} of {len(logs)} logs"
    return (
        f" Of {group} no cycle repeats: the mean force by velocity is drawn, of the opening and "
        "of the closing branch."
    ) * bool(n)


# All settings together


def _emphasis(settings: Iterable[Setting]) -> set[Setting]:
    """Return the settings that are drawn bold and labelled: every fourth from the last one down."""
    ordered = sorted(set(settings))
    return set(ordered[::-_EVERY] if len(ordered) > _EVERY else ordered)


def _peak_forces(report: ReportPlots) -> Iterator[Plot]:
    """Peak force against peak velocity: measured points, curves of the model and of the damper."""
    rows = [row for log in report.logs for row in log.result.steady]
    speeds: dict[Setting, list[float]] = {}
    for row in rows:
        if row["speed_rebound_m_per_s"]:
            speeds.setdefault(row["setting"], []).append(row["speed_rebound_m_per_s"])
    if not any(max(values) > (1.0 + _ONE_SPEED) * min(values) for values in speeds.values()):
        return
    settings = {row["setting"] for row in rows}
    bold, lines = _emphasis(settings), []
    named_speeds = [row["speed_m_per_s"] for row in report.run.rows("adjustment")]
    for stroke, sign in _SIGNS.items():
        peak = f"speed_{stroke}_m_per_s"
        top = max((row[peak] for row in rows if row[peak]), default=0.0)
        static = []
        for fit in report.run.settings:
            at = np.union1d(np.linspace(0.0, top, _POINTS)[1:], named_speeds)
            with suppress(SimulationError, ConfigurationError):  # or a model of another version
                forces = quasi_static(report.run.damper, fit.parameters, sign * at).forces
                curve = zip(at.tolist(), forces.tolist(), strict=True)
                static += [{"setting": fit.setting, peak: v, "model": force} for v, force in curve]
        curves = (
            ("damper at constant speed", static, peak, "model", "dashed"),
            ("model", rows, peak, f"simulated_{stroke}_N", "solid"),
            ("measured", rows, peak, f"measured_{stroke}_N", "points"),
        )
        for word, table, x, y, style in curves:
            for setting in settings:
                points = (row for row in table if row["setting"] == setting)
                pairs = {row[x]: row[y] for row in points if row[x] and row.get(y) is not None}
                if not pairs:
                    continue
                at, force = np.array(sorted(pairs.items())).T
                label = f"setting {setting}, {word}, {STROKE_WORDS[stroke]}"
                is_bold = word == "model" and setting in bold
                look = "wide" if is_bold else style
                tag = setting.label if is_bold and sign > 0.0 else ""
                colour = report.colours[setting]
                lines.append(Line(sign * at, force, label, colour, setting, look, tag=tag))
    order = ("dashed", "solid", "wide", "points")
    lines.sort(key=lambda line: (order.index(line.style), line.setting, line.x[0] < 0.0))
    panel = Panel("peak velocity", "m/s", "peak force", "N", tuple(lines))
    tares = [fit.offset for fit in report.run.settings]
    has_tare = any(tares) and report.run.damper.rest_force(0.0) is not None
    tare_note = f" with the rig's tare ({offsets_in_words(tares)}) in them" if has_tare else ""
    caption = (
        "Dots: measured, the mean peak force of each segment (PVP); lines: the model at the same "
        f"peaks, both{tare_note}; dashed: the damper alone at constant speed. "
        f"{_DIRECTIONS.capitalize()}."
    )
    key = (("measured", "points"), ("model", "solid"), ("damper alone", "dashed"))
    yield Plot("peak_force", "Peak force against peak velocity (PVP)", (panel,), caption, key)


def _fan(report: ReportPlots) -> Iterator[Plot]:
    """Force against velocity: simulated loops in colour, the measured ones thin on top of them."""
    if not report.logs:
        return
    settings = {log.result.setting for log in report.logs}
    bold = _emphasis(settings)
    lines: list[Line] = []
    for k_word, looks in enumerate((("pale", "wide"), ("faint", "thin"))):
        for log in report.logs:
            word, force, colour, _ = log.traces[k_word]
            is_bold = log.result.setting in bold
            for k, (v, f, branch) in enumerate(_strands(log, force)):
                label = f"setting {log.result.setting}, {word}{branch}"
                tag = log.result.setting.label if k_word == k == 0 and is_bold else ""
                lines.append(log.line(v, f, label, colour, looks[is_bold], tag=tag))
    panel = Panel("velocity", "m/s", "force", "N", tuple(lines))
    emphasis = "Every fourth setting is bold and labelled. " * (len(bold) < len(settings))
    caption = (
        "Last cycle of every log: the model in the setting's colour, measured thin and dark. "
        f"{emphasis}{_DIRECTIONS.capitalize()}.{_of_means(report.logs)}"
    )
    key = (("simulated", "wide"), ("measured", "thin"))
    yield Plot("fan", "Force against velocity by setting", (panel,), caption, key)


def _absolute(report: ReportPlots) -> Iterator[Plot]:
    lines = []
    for log in report.logs:
        for v, force, branch in _strands(log, log.signals.force_measured):
            # The means leap over zero: from there a line would join rebound and compression.
            for side in (v >= 0.0, v < 0.0) if branch else (np.ones(len(v), dtype=bool),):
                label = f"setting {log.result.setting}, measured{branch}"
                lines.append(log.line(np.abs(v[side]), force[side], label, log.colour, "thin"))
    if lines:
        panel = Panel("absolute velocity", "m/s", "measured force", "N", tuple(lines))
        caption = (
            "Rebound above, compression below; both branches of each stroke show the hysteresis."
            f"{_of_means(report.logs)}"
        )
        title = "Force against absolute velocity, measured"
        yield Plot("absolute_velocity", title, (panel,), caption, (("measured", "thin"),))


def _named_speeds(report: ReportPlots) -> Iterator[Plot]:
    rows = [row for row in report.run.rows("adjustment") if row["force_N"] is not None]
    places = setting_places({row["setting"] for row in report.run.rows("adjustment")})
    lines = []
    for k, speed in enumerate(sorted({row["speed_m_per_s"] for row in rows})):
        for stroke, style in (("rebound", "dot_line"), ("bump", "triangle_line")):
            # With several adjusters a setting has a row for each that was turned.
            forces = {
                places[row["setting"]]: row["force_N"]
                for row in rows
                if (row["speed_m_per_s"], row["stroke"]) == (speed, stroke)
            }
            x, y = np.reshape(sorted(forces.items()), (-1, 2)).T
            label = f"{STROKE_WORDS[stroke]}, {speed:g} m/s"
            lines.append(Line(x, y, label, SPEED_COLOURS[k % len(SPEED_COLOURS)], None, style))
    if lines:
        panel = setting_panel(places, "force", "N", lines)
        caption = "The model's, as in the table. Dots: rebound, triangles: compression."
        yield Plot("named_speeds", "Force against setting at named speeds", (panel,), caption)


def _errors(report: ReportPlots) -> Iterator[Plot]:
    def positive(name: str) -> dict[Setting, float]:  # the axis is of powers
        rows = (row for row in report.run.rows("mse") if not row["log"])
        return {row["setting"]: row[name] for row in rows if 0.0 < (row[name] or 0.0) < math.inf}

    errors = positive("mse_percent")
    if not errors:
        return
    places = setting_places(errors)
    lines = []
    for setting, error in errors.items():
        point = np.array([places[setting]]), np.array([error])
        label, colour = f"MSE, setting {setting}", report.colours[setting]
        lines.append(Line(*point, label, colour, setting, "points", in_legend=False))
    caption = "Dots: MSE (100 % is no better than the mean force)."
    floors = {k: floor for k, floor in positive("noise_floor_percent").items() if k in places}
    if floors:
        at = np.array([places[setting] for setting in floors])
        floor = Line(at, np.array([*floors.values()]), "noise floor", "muted", style="dashed")
        lines.insert(0, floor)
        caption += (
            " Dashed: noise floor, the MSE from scatter of the force; the rest comes from the "
            "model, or from noise of the displacement."
        )
    rules = ((1.0, "1 %: excellent below"), (5.0, "5 %: good below"))
    panel = setting_panel(places, "MSE", "%", lines, rules=rules, is_log=True)
    yield Plot("mse", "MSE and noise floor against setting", (panel,), caption)


def _parameters(report: ReportPlots) -> Iterator[Plot]:
    """Each parameter that has a value at some setting, and not one for all of them."""
    rows, trends = report.run.rows("parameters"), trends_in(report.run.record)
    places = setting_places(row["setting"] for row in rows)
    for quantity in report.run.quantities:
        name, scale = quantity.name, Shown(quantity)
        status_of = {row["setting"]: row[f"{name}_status"] for row in rows}
        filled = [
            row
            for row in rows
            if row[name] is not None
            and math.isfinite(row[name])
            and status_of[row["setting"]] not in {"absent", "not_identifiable"}
        ]
        default = quantity.default
        is_default = default is not None and {row[name] for row in filled} == {default}
        if not filled or is_default or (len(rows) > 1 and is_one_for_all(rows, name)):
            continue  # a sentence says it: twenty equal bars say no more
        far = _far(filled, name)
        near = [row for row in filled if row not in far]
        own_trends = [trend for trend in trends if trend.parameter == name and trend.points]
        lines = list(_trends(own_trends, places, scale.factor))
        for row in near:
            setting, ends = row["setting"], (row[f"{name}_ci_low"], row[f"{name}_ci_high"])
            # "<=" is also what NaN fails.
            has_interval = None not in ends and ends[0] <= row[name] <= ends[1]
            low, high = (np.array([scale.factor * end]) if has_interval else None for end in ends)
            style = "points" if status_of[setting] in {"fitted", None} else "triangles"
            x, y = np.array([places[setting]]), np.array([scale.factor * row[name]])
            fields: Any = {"low": low, "high": high, "in_legend": False}
            label, colour = f"setting {setting}", report.colours[setting]
            lines.append(Line(x, y, label, colour, setting, style, **fields))
        panel = setting_panel(places, quantity.symbol, scale.axis, lines)
        statuses = {str(status_of[row["setting"]]) for row in near} - {"fitted", "None"}
        marks = ", ".join(sorted(status.replace("_", " ") for status in statuses))
        off = (f"setting {row['setting']} ({scale.factor * row[name]:.3g})" for row in far)
        unknown = [str(k) for k, status in status_of.items() if status == "not_identifiable"]
        captions = (
            ("Open triangles: {}.", marks),
            ("Bars: 95 % interval.", any(row[f"{name}_ci_low"] is not None for row in filled)),
            ("At a bound, off the scale: {}.", ", ".join(off)),
            ("Not shown, not determined by these logs: setting {}.", ", ".join(unknown)),
            (
                "Broken lines: trends along one adjuster with the others held.",
                own_trends and setting_names(places),
            ),
        )
        caption = " ".join(text.format(words) for text, words in captions if words)
        titles = dict.fromkeys((quantity.symbol, quantity.label))  # play is called play
        yield Plot(f"parameter_{name}", f"{', '.join(titles)}, against setting", (panel,), caption)


def _far(rows: Sequence[Row], name: str) -> list[Row]:
    """Return rows at a bound so far off that it would flatten the fitted values."""
    bound = [row for row in rows if row[f"{name}_status"] == "at_bound"]
    limits = (row[f"{name}{limit}"] for row in rows if row not in bound
            for limit in ("", "_ci_low", "_ci_high"))  # fmt: skip
    values = [limit for limit in limits if limit is not None and math.isfinite(limit)]
    if not values:
        return []
    low, high = min(values), max(values)
    reach = _FAR * ((high - low) or abs(high) or 1.0)
    return [row for row in bound if not low - reach < row[name] < high + reach]


def _trends(
    trends: Sequence[Trend], places: Mapping[Setting, float], factor: float
) -> Iterator[Line]:
    """Yield each trend with its band and what is off it; along its adjuster without a band."""
    is_numbered = not setting_names(places)
    adjusters = list(dict.fromkeys(trend.adjuster for trend in trends))
    standing = {(line.adjuster, line.held): line.numbers for line in lines_of(places)}
    for trend in trends:
        at = {float(point.setting): float(point.setting) for point in trend.points}
        if not is_numbered:
            numbers = standing.get((trend.adjuster, trend.held), {})
            at = {clicks: places[setting] for setting, clicks in numbers.items()}
        drawn = [point for point in trend.points if float(point.setting) in at]
        x = np.array([at[float(point.setting)] for point in drawn])
        y, low, high = (
            factor * np.array([getattr(point, name) for point in drawn], dtype=np.float64)
            for name in ("value", "low", "high")
        )
        band: dict[str, Any] = {}
        label, style = "trend", "dashed"
        if not is_numbered:
            label = f"trend along {trend.adjuster}" + (f", {trend.held}" if trend.held else "")
            style = _ALONG[adjusters.index(trend.adjuster) % len(_ALONG)]
        elif np.isfinite(low).all() and np.isfinite(high).all():
            label, band = "trend, 95 %", {"low": low, "high": high}
        if drawn:
            is_named = is_numbered or len(trends) <= _NAMED
            yield Line(x, y, label, "muted", style=style, in_legend=is_named, **band)
        for outlier in trend.outliers:
            if (place := at.get(float(outlier.setting))) is not None:
                ring = np.array([place]), np.array([factor * outlier.value])
                yield Line(*ring, "off the trend", "ink", style="rings", in_legend=False)


def _profiles(report: ReportPlots) -> Iterator[Plot]:
    """Each profile: the rise of the misfit as the parameter is moved."""
    points: dict[tuple[str, Setting], list[tuple[float, float]]] = {}
    for row in report.run.rows("profiles"):
        if None not in (point := (row["value"], row["misfit_rise"])):
            points.setdefault((row["parameter"], row["setting"]), []).append(point)
    for quantity in report.run.quantities:
        scale, lines = Shown(quantity), []
        for (name, setting), curve in points.items():
            if name != quantity.name:
                continue
            x, y = np.array(sorted(curve)).T * [[scale.factor], [1.0]]
            label, colour = f"setting {setting}", report.colours[setting]
            lines.append(Line(x, y, label, colour, setting, "dot_line", tag=str(setting)))
        if lines:
            rules = ((CHI_SQUARED_95, "95 % limit"),)
            axes = (quantity.symbol, scale.axis, "rise of the misfit", "")
            panel = Panel(*axes, tuple(lines), rules=rules)
            caption = (
                "Each point is a fit with the parameter held there; below the line it is inside."
            )
            yield Plot(f"profile_{quantity.name}", f"{quantity.symbol}, profile", (panel,), caption)


# What the page and `damperfit report --figures` draw of all settings, the first one on top.
FIGURES: tuple[Callable[[ReportPlots], Iterator[Plot]], ...] = (
    *(_peak_forces, _fan, _parameters, _profiles, _errors, _absolute, _named_speeds),
)


# One log


def _loops(log: DrawnLog, signal: FloatArray) -> tuple[list[Line], str]:
    """Return the last cycle of each steady segment, and what that is in words."""
    cycles = log.result.cycles or (log.cycle,)
    lines = [
        log.line(*loop(signal, force, cycle), word, ink, style, in_legend=cycle is cycles[0])
        for word, force, ink, style in log.traces
        for cycle in cycles
    ]
    which = "" if len(log.result.steady) == len(log.result.segments) else "steady "
    return lines, "Last cycle" + f" of each {which}segment" * log.result.has_segments


def _force_velocity(log: DrawnLog) -> Iterator[Plot]:
    velocity = log.signals.velocity
    if log.result.is_moving:
        lines = [
            log.line(v, mean, word, ink, style, in_legend=branch == "opening")
            for word, force, ink, style in log.traces
            for v, mean, branch in _branches(velocity, force)
        ]
        begins = "Mean of the opening and of the closing branch"
    else:
        lines, begins = _loops(log, velocity)
    panel = Panel("velocity", "m/s", "force", "N", tuple(lines))
    caption = f"{begins}; {_DIRECTIONS}."
    yield log.plot("force_velocity", "force against velocity", caption, panel)


def _force_displacement(log: DrawnLog) -> Iterator[Plot]:
    x, v, fastest = 1e3 * log.signals.displacement, log.signals.velocity, log.result.fastest
    if log.result.is_moving:
        lines = []
        for word, force, ink, style in log.traces:
            for mask, is_first in ((v > 0.0, True), (v < 0.0, False)):
                at, mean, band = _means(x, force, mask, has_range=True)
                if not len(at):
                    continue
                is_model = word == "simulated"
                shaded = band if is_model else {}
                lines.append(log.line(at, mean, word, ink, style, in_legend=is_first, **shaded))
                for end, limit in () if is_model else band.items():
                    label, is_named = "measured, 5 and 95 %", is_first and end == "low"
                    lines.append(log.line(at, limit, label, ink, "dotted", in_legend=is_named))
        caption = (
            "Mean over the samples of each stroke, rebound above and compression below; nine of "
            "ten samples lie within the shaded range, for the speeds differ that pass a place."
        )
    else:
        lines, begins = _loops(log, x)
        caption = f"{begins}."
        if fastest and not log.result.has_segments:
            energy = [number(fastest[f"{w}_energy_J"], digits=4) for w in ("measured", "simulated")]
            caption += f" Energy per cycle: {energy[0]} J measured, {energy[1]} J simulated."
    panel = Panel("displacement", "mm", "force", "N", tuple(lines))
    yield log.plot("force_displacement", "force against displacement", caption, panel)


def _peaks(log: DrawnLog) -> Iterator[Plot]:
    """Peak force against peak speed, where more than one speed was run."""
    if len(log.result.steady) < 2:
        return
    lines = []
    for stroke, sign in _SIGNS.items():
        for word, ink, style in (("simulated", log.colour, "rings"), ("measured", "ink", "points")):
            names = (f"speed_{stroke}_m_per_s", f"{word}_{stroke}_N")
            x, y = np.array(
                sorted(tuple(row[k] for k in names) for row in log.result.steady), float
            ).T
            lines.append(log.line(sign * x, y, word, ink, style, in_legend=stroke == "rebound"))
    panel = Panel("peak velocity", "m/s", "peak force", "N", tuple(lines))
    caption = "One point a segment and stroke: mean of its cycles."
    yield log.plot("peaks", "peak force against peak velocity", caption, panel)


def _force_time(log: DrawnLog) -> Iterator[Plot]:
    signals = log.signals
    residual = signals.force_measured - signals.force
    indices = thin(_LOG_BUCKETS, signals.force_measured, signals.force, residual)
    time = signals.time - signals.time[0]
    # A line across what was not compared would show a motion that was not run.
    gaps = np.flatnonzero(np.diff(time) > _GAP * float(np.median(np.diff(time)))) + 1
    indices = np.union1d(indices, np.concatenate([gaps - 1, gaps]))

    def broken(values: FloatArray) -> FloatArray:
        return np.insert(values[indices], np.searchsorted(indices, gaps), np.nan)

    time = broken(time)
    forces = [
        log.line(time, broken(force), word, ink, style) for word, force, ink, style in log.traces
    ]
    line = log.line(time, broken(residual), "residual", log.colour, "thin", in_legend=False)
    panels = (
        Panel("time", "s", "force", "N", tuple(forces)),
        Panel("time", "s", "residual", "N", (line,)),
    )
    yield log.plot("force_time", "force over time", "Below: measured less simulated.", *panels)


def _residual(log: DrawnLog) -> Iterator[Plot]:
    velocity = log.signals.velocity
    residual = log.signals.force_measured - log.signals.force
    # Peaks alone would make the cloud wider than it is.
    spaced = np.arange(0, len(residual), max(1, len(residual) // _CLOUD))
    indices = np.union1d(spaced, thin(_LOG_BUCKETS // 8, residual))
    cloud = log.line(velocity[indices], residual[indices], "residual", log.colour, "points")
    styles = {"opening": "solid", "closing": "dashed"}
    means = [
        log.line(v, mean, f"mean, {branch} branch", "ink", styles[branch])
        for v, mean, branch in _branches(velocity, residual)
    ]
    panel = Panel("velocity", "m/s", "residual", "N", (cloud, *means), rules=((0.0, ""),))
    caption = (
        "Measured less simulated. A cloud around zero is noise; where a mean leaves zero, "
        "the model lacks something."
    )
    yield log.plot("residual", "residual against velocity", caption, panel)


def _pressures(log: DrawnLog) -> Iterator[Plot]:
    signals = log.signals
    panel = pressure_panel(signals.time, signals.pressures, log.cycle, setting=log.result.setting)
    pressures = signals.pressures[:, log.cycle]
    shares = [100.0 * float(np.mean(pressure <= 0.0)) for pressure in pressures]
    dry = [f"chamber {i} for {share:.1f} %" for i, share in enumerate(shares, start=1) if share]
    caption = "No chamber cavitates."
    if dry:
        caption = f"Shaded: cavitation, {' and '.join(dry)} of the cycle."
    caption += f" Lowest pressure of this cycle {pressures.min() / _BAR:.3g} bar."
    if log.result.has_segments and log.result.cycles:
        caption = f"Last cycle of the fastest segment. {caption}"
    yield log.plot("pressures", "chamber pressures, simulated", caption, panel)


# What is drawn of each log.
LOG_FIGURES: tuple[Callable[[DrawnLog], Iterator[Plot]], ...] = (
    *(_force_velocity, _force_displacement, _peaks, _force_time, _residual, _pressures),
)


def _valves(rows: Sequence[Row], log: DrawnLog) -> Iterator[Plot]:
    """Yield a setting's valves, flow against pressure; nothing where the table has none."""
    points_of_setting = [
        row
        for row in rows
        if row["setting"] == log.result.setting and row["pressure_Pa"] is not None
    ]
    lines: list[Line] = []
    openings = []
    for stroke, sign in _SIGNS.items():
        of_stroke = [row for row in points_of_setting if row["stroke"] == stroke]
        is_first, law = not lines, np.empty((2, 0))
        for curve, ink, style in (("measured", "ink", "points"), ("law", log.colour, "wide")):
            points = [
                (row["pressure_Pa"] / _BAR, row["flow_m3_per_s"] / _CM3)
                for row in of_stroke
                if row["curve"] == curve and row["flow_m3_per_s"] is not None
            ]
            law = np.reshape(points, (-1, 2)).T  # in the end the law's
            if points:
                x, y = sign * law
                lines.append(log.line(x, y, curve, ink, style, in_legend=is_first))
        for row in of_stroke:
            if row["curve"] != "opening":
                continue
            pressure = row["pressure_Pa"] / _BAR
            is_reached = law.size > 0 and pressure <= law[0].max()
            if is_reached:
                at, label = np.array([pressure]), "blow-off opens"
                flow = sign * np.interp(at, *law)
                is_named = all(line.label != label for line in lines)
                lines.append(log.line(sign * at, flow, label, "muted", "rings", in_legend=is_named))
            if row["valve_force_N"] is not None:
                suffix = "" if is_reached else ", which these logs do not reach"
                place = f"{STROKE_WORDS[stroke]} at {pressure:.3g} bar"
                openings.append(f"{place} ({row['valve_force_N']:.3g} N){suffix}")
    if not lines:
        return
    lines.sort(key=lambda line: ("points", "wide", "rings").index(line.style))
    panel = Panel("pressure across the valve", "bar", "flow", "cm³/s", tuple(lines))
    caption = (
        f"{_DIRECTIONS.capitalize()}. Points: flow read from the loops (displaced by the piston, "
        "less elasticity) without assuming a valve law; where they leave the curve, the law does "
        "not fit."
    )
    if openings:
        caption += f" Blow-offs open in {'; in '.join(openings)}."
    yield log.plot("valves", "the valves, flow against pressure", caption, panel)
