"""The figures of a run: of all settings (the paper's Figs 13-16) and of each log (Figs 7, 11, 12).

Displacement in mm, velocity in m/s, force in N, pressure in bar; positive in rebound. A road drawn
sample by sample is a tangle of strands: where nothing repeats, means of both branches by velocity
and of both strokes by place are drawn, with the range of the forces that the speeds spread.

A figure is a function that yields what it has of it, and a line in `FIGURES` or `LOG_FIGURES`.
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit.adjustment.force_at import STROKE_WORDS
from damperfit.reporting.figures import (
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
from damperfit.reporting.records import listed_in, number_in, trends_in, units_in
from damperfit.reporting.sheet import number
from damperfit.reporting.tables import is_one_for_all, scale_of
from damperfit.tested.setting import Setting, lines_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from damperfit.adjustment.trends import Trend
    from damperfit.damper.quantity import Quantity
    from damperfit.results import Run
    from damperfit.tables.reading import LogSignals
    from damperfit.units.shown_units import ShownUnits

    FloatArray = NDArray[np.float64]
    Row = Mapping[str, Any]
    Mean = tuple[FloatArray, FloatArray, str]  # velocity, mean force, in words of what

_LOG_BUCKETS = 200  # of a whole log: peaks of every cycle survive
_CLOUD = 800  # points of a residual plot, besides the peaks
_GAP = 1.5  # sample intervals
_BINS = 24  # of velocity, from the lowest to the highest
_FEW, _FEW_IN_RANGE = 3, 20  # samples: no mean, no range of fewer: each end would be one sample
_RANGE = (5.0, 95.0)  # per cent of the samples that lie below
_LATE = 1e-6  # s; time stamps are rounded alike
_FEWEST = 8  # samples of a cycle
_ONE_SPEED = 0.05  # speeds within this share are one test, run again
_EVERY = 4  # settings of which one is drawn bold and labelled
_ALONG = ("dashed", "dotted")  # trends of the first adjuster, of the second, ...
_NAMED = 6  # trends along adjusters that a legend names
_FAR = 3.0  # heights of the fitted values: a value at a bound beyond it would flatten them
_SIGNS = {"rebound": 1.0, "bump": -1.0}
_BAR, _CM3 = 1e5, 1e-6
_DIRECTIONS = "rebound to the right and up, compression to the left and down"


class LogView:
    """A log with what the run tells of it: its signals, its entry of the inputs in run.json.

    ``rows`` are its rows of the table "characteristics".
    """

    def __init__(self, signals: LogSignals, facts: Row, rows: Sequence[Row]) -> None:
        self.signals, self.facts, self.rows = signals, facts, rows
        self.setting: Setting = signals.setting
        self.peaks = [row for row in rows if row["point"] == "peak"]  # a row a segment
        self.steady = [row for row in self.peaks if row["cycles"]]  # those that repeat
        self.is_moving = bool(self.peaks) and not self.steady
        self.has_segments = len(self.peaks) > 1 or self.is_moving
        self.fastest: Row | None = max(
            self.steady, key=lambda row: row["speed_rebound_m_per_s"] or 0.0, default=None
        )

    @cached_property
    def cycles(self) -> tuple[slice, ...]:
        """The last whole cycle of each steady segment; older runs tell of one, in the entry."""
        time, cycles = self.signals.time, []
        for segment in listed_in(self.facts, "stretches") or [self.facts]:
            if not isinstance(segment, dict) or segment.get("kind", "steady") != "steady":
                continue
            rate = number_in(segment, "frequency_Hz")
            if rate is None or not rate > 0.0 or len(time) < _FEWEST:
                continue
            stop = number_in(segment, "figures_stop_s") or number_in(segment, "stop_s") or math.inf
            end = int(np.searchsorted(time, stop - _LATE))
            begin = int(np.searchsorted(time, time[end - 1] - 1.0 / rate - _LATE))
            if end - begin >= _FEWEST:
                cycles.append(slice(begin, end))
        return tuple(cycles)

    @cached_property
    def cycle(self) -> slice:
        """The last cycle of the fastest steady segment, all samples where nothing repeats."""
        whole, velocity = slice(0, len(self.signals.time)), self.signals.velocity
        return max(self.cycles, key=lambda part: float(np.ptp(velocity[part])), default=whole)

    def line(
        self, x: FloatArray, y: FloatArray, label: str, colour: str, style: str, **more: Any
    ) -> Line:
        """Return a line of its setting, with more fields of `Line`."""
        return Line(x, y, label, colour, self.setting, style, **more)


@dataclass(frozen=True, eq=False)
class ReportPlots:
    """Everything that is drawn of ``run``, forces, speeds and displacements in ``units``."""

    run: Run
    units: ShownUnits

    @cached_property
    def logs(self) -> tuple[LogView, ...]:
        """The logs that have signals."""
        entries = listed_in(self.run.record, "inputs")
        facts = {str(one.get("log")): one for one in entries if isinstance(one, dict)}
        rows: dict[tuple[Setting, str], list[Row]] = {}
        for row in self.run.rows("characteristics"):
            rows.setdefault((row["setting"], str(row["log"])), []).append(row)
        return tuple(
            LogView(one, facts.get(one.log, {}), rows.get((one.setting, one.log), ()))
            for one in self.run.signals
        )

    @cached_property
    def colours(self) -> Mapping[Setting, str]:
        """Colour of each setting."""
        rows = (*self.run.rows("parameters"), *self.run.rows("mse"))
        return setting_colours(
            [*(row["setting"] for row in rows), *(log.setting for log in self.logs)]
        )

    @cached_property
    def overall(self) -> tuple[Plot, ...]:
        """All settings together; the force-velocity picture comes first."""
        plots = (plot for figure in FIGURES for plot in figure(self))
        return tuple(plot_in_units(plot, self.units) for plot in plots)

    @cached_property
    def by_log(self) -> tuple[tuple[LogView, tuple[Plot, ...]], ...]:
        """Each log; the valves of a setting stand with its first."""
        plots_of = []
        counts: Counter[Setting] = Counter()
        for log in self.logs:
            counts[log.setting] += 1
            n = counts[log.setting]
            name = f"setting_{log.setting.slug}" + (f"_log_{n}" if n > 1 else "")
            colour = self.colours[log.setting]
            plots = [plot for figure in LOG_FIGURES for plot in figure(log, name, colour)]
            if n == 1:
                plots += _valves(self.run.rows("valves"), log, name, colour)
            plots_of.append((log, tuple(plot_in_units(plot, self.units) for plot in plots)))
        return tuple(plots_of)

    @property
    def plots(self) -> tuple[Plot, ...]:
        """All plots in the order of the report."""
        return (*self.overall, *(plot for _, plots in self.by_log for plot in plots))


def report_plots(run: Run, units: ShownUnits | None = None) -> ReportPlots:
    """Lay out the plots of a run, in units of one's own or, for None, those of the run."""
    return ReportPlots(run, units_in(run.record) if units is None else units)


# Means where nothing repeats


def _means(
    x: FloatArray, values: FloatArray, part: NDArray[np.bool_], *, has_range: bool = False
) -> tuple[FloatArray, FloatArray, dict[str, FloatArray]]:
    """Return means of the values in a part by bins of x, and where nine of ten samples lie."""
    few = _FEW_IN_RANGE if has_range else _FEW
    if len(x) < max(few, _BINS * (not has_range)) or np.ptp(x) == 0.0:
        return np.empty(0), np.empty(0), {}
    edges = np.linspace(x.min(), x.max(), _BINS + 1)
    place = np.clip(np.digitize(x, edges) - 1, 0, _BINS - 1)
    count = np.bincount(place[part], minlength=_BINS)
    total = np.bincount(place[part], weights=values[part], minlength=_BINS)
    seen = np.flatnonzero(count >= few)
    band = {}
    if has_range:
        ends = [np.percentile(values[part & (place == k)], _RANGE) for k in seen]
        band = dict(zip(("low", "high"), np.reshape(ends, (-1, 2)).T, strict=True))
    return (0.5 * (edges[1:] + edges[:-1]))[seen], total[seen] / count[seen], band


def _branches(velocity: FloatArray, values: FloatArray) -> Iterator[Mean]:
    """Yield the means of both branches by velocity: "opening", where speed grows, and "closing"."""
    is_opening = np.gradient(np.abs(velocity)) > 0.0 if len(velocity) > 1 else velocity > 0.0
    for word, part in (("opening", is_opening), ("closing", ~is_opening)):
        at, mean, _ = _means(velocity, values, part)
        if len(at):
            yield at, mean, word


def _strands(log: LogView, force: FloatArray) -> Iterator[Mean]:
    """Yield velocity and force of the last cycle, or means of both branches where none repeats."""
    if not log.is_moving:
        yield *loop(log.signals.velocity, force, log.cycle), ""
        return
    for at, mean, word in _branches(log.signals.velocity[log.cycle], force[log.cycle]):
        yield at, mean, f", mean, {word} branch"


def _of_means(logs: Sequence[LogView]) -> str:
    """Return what is drawn of logs without a cycle, as a sentence."""
    n = sum(log.is_moving for log in logs)
    whose = "the logs" if n == len(logs) else f"{n} of {len(logs)} logs"
    return (
        f" Of {whose} no cycle repeats: the mean force by velocity is drawn, of the opening and "
        "of the closing branch."
    ) * bool(n)


# All settings together


def _emphasis(settings: Iterable[Setting]) -> set[Setting]:
    """Return the settings that are drawn bold and labelled: every fourth from the last one down."""
    known = sorted(set(settings))
    return set(known[::-_EVERY] if len(known) > _EVERY else known)


def _peak_forces(shown: ReportPlots) -> Iterator[Plot]:
    """Peak force against peak velocity: measured points, curves of the model and of the damper."""
    rows = [row for log in shown.logs for row in log.steady]
    speeds: dict[Setting, list[float]] = {}
    for row in rows:
        if row["speed_rebound_m_per_s"]:
            speeds.setdefault(row["setting"], []).append(row["speed_rebound_m_per_s"])
    if not any(max(one) > (1.0 + _ONE_SPEED) * min(one) for one in speeds.values()):
        return
    settings = {row["setting"] for row in rows}
    bold, lines = _emphasis(settings), []
    for stroke, sign in _SIGNS.items():
        own = [row for row in shown.run.rows("adjustment") if row["stroke"] == stroke]
        peak = f"speed_{stroke}_m_per_s"
        curves = (
            ("damper at constant speed", own, "speed_m_per_s", "model_N", "dashed"),
            ("model", rows, peak, f"simulated_{stroke}_N", "solid"),
            ("measured", rows, peak, f"measured_{stroke}_N", "points"),
        )
        for word, known, x, y, style in curves:
            for setting in settings:
                mine = (row for row in known if row["setting"] == setting)
                pairs = {row[x]: row[y] for row in mine if row[x] and row.get(y) is not None}
                if not pairs:
                    continue
                at, force = np.array(sorted(pairs.items())).T
                label = f"setting {setting}, {word}, {STROKE_WORDS[stroke]}"
                is_bold = word == "model" and setting in bold
                look = "wide" if is_bold else style
                tag = setting.label if is_bold and sign > 0.0 else ""
                colour = shown.colours[setting]
                lines.append(Line(sign * at, force, label, colour, setting, look, tag=tag))
    order = ("dashed", "solid", "wide", "points")
    lines.sort(key=lambda line: (order.index(line.style), line.setting, line.x[0] < 0.0))
    panel = Panel("peak velocity", "m/s", "peak force", "N", tuple(lines))
    caption = (
        "Dots: measured, the mean peak force of each segment (PVP); lines: the model at the same "
        "peaks; dashed: the damper alone at constant speed, as in the table. "
        f"{_DIRECTIONS.capitalize()}."
    )
    key = (("measured", "points"), ("model", "solid"), ("damper alone", "dashed"))
    yield Plot("peak_force", "Peak force against peak velocity (PVP)", (panel,), caption, key)


def _fan(shown: ReportPlots) -> Iterator[Plot]:
    """Force against velocity: simulated loops in colour, the measured ones thin on top of them."""
    if not shown.logs:
        return
    settings = {log.setting for log in shown.logs}
    bold = _emphasis(settings)
    lines: list[Line] = []
    for word, looks in (("simulated", ("pale", "wide")), ("measured", ("faint", "thin"))):
        for log in shown.logs:
            setting, is_model = log.setting, word == "simulated"
            is_bold = setting in bold
            force = log.signals.force if is_model else log.signals.force_measured
            colour = shown.colours[setting] if is_model else "ink"
            for k, (v, f, more) in enumerate(_strands(log, force)):
                label = f"setting {setting}, {word}{more}"
                tag = setting.label if is_model and is_bold and k == 0 else ""
                lines.append(log.line(v, f, label, colour, looks[is_bold], tag=tag))
    panel = Panel("velocity", "m/s", "force", "N", tuple(lines))
    few = "Every fourth setting is bold and labelled. " * (len(bold) < len(settings))
    caption = (
        "Last cycle of every log: the model in the setting's colour, measured thin and dark. "
        f"{few}{_DIRECTIONS.capitalize()}.{_of_means(shown.logs)}"
    )
    key = (("simulated", "wide"), ("measured", "thin"))
    yield Plot("fan", "Force against velocity by setting", (panel,), caption, key)


def _absolute(shown: ReportPlots) -> Iterator[Plot]:
    lines = []
    for log in shown.logs:
        for v, force, more in _strands(log, log.signals.force_measured):
            # The means leap over zero: from there a line would join rebound and compression.
            for part in (v >= 0.0, v < 0.0) if more else (np.ones(len(v), dtype=bool),):
                label, colour = f"setting {log.setting}, measured{more}", shown.colours[log.setting]
                lines.append(log.line(np.abs(v[part]), force[part], label, colour, "thin"))
    if lines:
        panel = Panel("absolute velocity", "m/s", "measured force", "N", tuple(lines))
        caption = (
            "Rebound above, compression below; both branches of each stroke show the hysteresis."
            f"{_of_means(shown.logs)}"
        )
        title = "Force against absolute velocity, measured"
        yield Plot("absolute_velocity", title, (panel,), caption, (("measured", "thin"),))


def _named_speeds(shown: ReportPlots) -> Iterator[Plot]:
    rows = shown.run.rows("adjustment")
    places = setting_places({row["setting"] for row in rows})
    # With several adjusters a setting has a row for each that was turned.
    forces = {
        (row["speed_m_per_s"], row["stroke"], places[row["setting"]]): row["force_N"]
        for row in rows
        if row["force_N"] is not None
    }
    lines = []
    for k, speed in enumerate(sorted({row["speed_m_per_s"] for row in rows})):
        for stroke, style in (("rebound", "dot_line"), ("bump", "triangle_line")):
            points = sorted(
                (at, f) for (v, s, at), f in forces.items() if (v, s) == (speed, stroke)
            )
            x, y = np.reshape(points, (-1, 2)).T
            label = f"{STROKE_WORDS[stroke]}, {speed:g} m/s"
            lines.append(Line(x, y, label, SPEED_COLOURS[k % len(SPEED_COLOURS)], None, style))
    if lines:
        panel = setting_panel(places, "force", "N", lines)
        caption = "The model's, as in the table. Dots: rebound, triangles: compression."
        yield Plot("named_speeds", "Force against setting at named speeds", (panel,), caption)


def _errors(shown: ReportPlots) -> Iterator[Plot]:
    def positive(name: str) -> dict[Setting, float]:  # the axis is of powers
        rows = (row for row in shown.run.rows("mse") if not row["log"])
        return {row["setting"]: row[name] for row in rows if 0.0 < (row[name] or 0.0) < math.inf}

    errors = positive("mse_percent")
    if not errors:
        return
    places = setting_places(errors)
    lines = []
    for setting, error in errors.items():
        point = np.array([places[setting]]), np.array([error])
        label, colour = f"MSE, setting {setting}", shown.colours[setting]
        lines.append(Line(*point, label, colour, setting, "points", in_legend=False))
    caption = "Dots: MSE, 100 % would be no better than the mean force."
    floors = {k: floor for k, floor in positive("noise_floor_percent").items() if k in places}
    if floors:
        at = np.array([places[setting] for setting in floors])
        floor = Line(at, np.array([*floors.values()]), "noise floor", "muted", style="dashed")
        lines.insert(0, floor)
        caption += (
            " Dashed: noise floor, the MSE that scatter of the force explains; above it: the "
            "model, or noise of the displacement."
        )
    rules = ((1.0, "1 %: excellent below"), (5.0, "5 %: good below"))
    panel = setting_panel(places, "MSE", "%", lines, rules=rules, is_log=True)
    yield Plot("mse", "MSE and noise floor against setting", (panel,), caption)


def _parameters(shown: ReportPlots) -> Iterator[Plot]:
    """Each parameter that is known at some setting, and not one for all of them."""
    rows, trends = shown.run.rows("parameters"), trends_in(shown.run.record)
    places = setting_places(row["setting"] for row in rows)
    for one in shown.run.quantities:
        name, scale = one.name, scale_of(one)
        known = [
            row
            for row in rows
            if row[name] is not None
            and math.isfinite(row[name])
            and row[f"{name}_status"] not in {"absent", "not_identifiable"}
        ]
        is_default = one.default is not None and {row[name] for row in known} == {one.default}
        if not known or is_default or (len(rows) > 1 and is_one_for_all(rows, name)):
            continue  # a sentence tells it: twenty equal bars say no more
        far = _far(known, name)
        near = [row for row in known if row not in far]
        mine = [trend for trend in trends if trend.parameter == name and trend.points]
        points = [_point(row, one, places, shown.colours) for row in near]
        lines = (*_trends(mine, places, scale.factor), *points)
        panel = setting_panel(places, one.symbol, scale.axis, lines)
        statuses = {str(row[f"{name}_status"]) for row in near} - {"fitted", "None"}
        held = ", ".join(sorted(status.replace("_", " ") for status in statuses))
        off = (f"setting {row['setting']} ({scale.factor * row[name]:.3g})" for row in far)
        unknown = (
            str(row["setting"]) for row in rows if row[f"{name}_status"] == "not_identifiable"
        )
        captions = (
            ("Open triangles: {}.", held),
            ("Bars: 95 % interval.", any(row[f"{name}_ci_low"] is not None for row in known)),
            ("At a bound, off the scale: {}.", ", ".join(off)),
            ("Not shown, not determined by these logs: setting {}.", ", ".join(unknown)),
            (
                "Broken lines: trends along one adjuster with the others held.",
                mine and setting_names(places),
            ),
        )
        caption = " ".join(text.format(words) for text, words in captions if words)
        named = dict.fromkeys((one.symbol, one.label))  # play is called play
        yield Plot(f"parameter_{name}", f"{', '.join(named)}, against setting", (panel,), caption)


def _far(rows: Sequence[Row], name: str) -> list[Row]:
    """Return what ran to a bound so far off that it would flatten the fitted values."""
    bound = [row for row in rows if row[f"{name}_status"] == "at_bound"]
    ends = (row[f"{name}{end}"] for row in rows if row not in bound
            for end in ("", "_ci_low", "_ci_high"))  # fmt: skip
    values = [end for end in ends if end is not None and math.isfinite(end)]
    if not values:
        return []
    low, high = min(values), max(values)
    reach = _FAR * ((high - low) or abs(high) or 1.0)
    return [row for row in bound if not low - reach < row[name] < high + reach]


def _point(
    row: Row, quantity: Quantity, places: Mapping[Setting, float], colours: Mapping[Setting, str]
) -> Line:
    name, factor, setting = quantity.name, scale_of(quantity).factor, row["setting"]
    value, low, high = (row[f"{name}{end}"] for end in ("", "_ci_low", "_ci_high"))
    # "<=" is also what NaN fails.
    has_interval = None not in {low, high} and low <= value <= high
    return Line(
        np.array([places[setting]]),
        np.array([factor * value]),
        f"setting {setting}",
        colours[setting],
        setting,
        "points" if row[f"{name}_status"] in {"fitted", None} else "triangles",
        in_legend=False,
        low=np.array([factor * low]) if has_interval else None,
        high=np.array([factor * high]) if has_interval else None,
    )


def _trends(
    trends: Sequence[Trend], places: Mapping[Setting, float], factor: float
) -> Iterator[Line]:
    """Yield each trend with its band and what is off it; along its adjuster without a band."""
    is_numbered = not setting_names(places)
    adjusters = list(dict.fromkeys(one.adjuster for one in trends))
    standing = {(line.adjuster, line.held): line.numbers for line in lines_of(places)}
    for trend in trends:
        at = {float(point.setting): float(point.setting) for point in trend.points}
        if not is_numbered:
            numbers = standing.get((trend.adjuster, trend.held), {})
            at = {clicks: places[setting] for setting, clicks in numbers.items()}
        known = [point for point in trend.points if float(point.setting) in at]
        x = np.array([at[float(point.setting)] for point in known])
        y, low, high = (
            factor * np.array([getattr(point, name) for point in known], dtype=np.float64)
            for name in ("value", "low", "high")
        )
        band: dict[str, Any] = {}
        label, style = "trend", "dashed"
        if not is_numbered:
            label = f"trend along {trend.adjuster}" + (f", {trend.held}" if trend.held else "")
            style = _ALONG[adjusters.index(trend.adjuster) % len(_ALONG)]
        elif np.isfinite(low).all() and np.isfinite(high).all():
            label, band = "trend, 95 %", {"low": low, "high": high}
        if known:
            is_named = is_numbered or len(trends) <= _NAMED
            yield Line(x, y, label, "muted", style=style, in_legend=is_named, **band)
        for one in trend.outliers:
            if (place := at.get(float(one.setting))) is not None:
                ring = np.array([place]), np.array([factor * one.value])
                yield Line(*ring, "off the trend", "ink", style="rings", in_legend=False)


# What the page and `damperfit report --figures` draw of all settings, the first one on top.
FIGURES: tuple[Callable[[ReportPlots], Iterator[Plot]], ...] = (
    *(_peak_forces, _fan, _parameters, _errors, _absolute, _named_speeds),
)


# One log


def _both(log: LogView, colour: str) -> Iterator[tuple[str, FloatArray, str, str]]:
    """Yield word, force, colour and style: simulated in colour, measured thin on top of it."""
    yield "simulated", log.signals.force, colour, "wide"
    yield "measured", log.signals.force_measured, "ink", "thin"


def _loops(log: LogView, signal: FloatArray, colour: str) -> tuple[list[Line], str]:
    """Return the last cycle of each steady segment, and what that is in words."""
    cycles = log.cycles or (log.cycle,)
    lines = [
        log.line(*loop(signal, force, cycle), word, ink, style, in_legend=cycle is cycles[0])
        for word, force, ink, style in _both(log, colour)
        for cycle in cycles
    ]
    which = "" if len(log.steady) == len(log.peaks) else "steady "
    return lines, "Last cycle" + f" of each {which}segment" * log.has_segments


def _force_velocity(log: LogView, name: str, colour: str) -> Iterator[Plot]:
    velocity = log.signals.velocity
    if log.is_moving:
        lines = [
            log.line(v, mean, word, ink, style, in_legend=branch == "opening")
            for word, force, ink, style in _both(log, colour)
            for v, mean, branch in _branches(velocity, force)
        ]
        begins = "Mean of the opening and of the closing branch"
    else:
        lines, begins = _loops(log, velocity, colour)
    panel = Panel("velocity", "m/s", "force", "N", tuple(lines))
    title = f"Setting {log.setting}: force against velocity"
    yield Plot(f"{name}_force_velocity", title, (panel,), f"{begins}; {_DIRECTIONS}.")


def _force_displacement(log: LogView, name: str, colour: str) -> Iterator[Plot]:
    x, v, fastest = 1e3 * log.signals.displacement, log.signals.velocity, log.fastest
    if log.is_moving:
        lines = []
        for word, force, ink, style in _both(log, colour):
            for part, is_first in ((v > 0.0, True), (v < 0.0, False)):
                at, mean, band = _means(x, force, part, has_range=True)
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
        lines, begins = _loops(log, x, colour)
        caption = f"{begins}."
        if fastest and not log.has_segments:
            energy = [number(fastest[f"{w}_energy_J"], digits=4) for w in ("measured", "simulated")]
            caption += f" Energy per cycle: {energy[0]} J measured, {energy[1]} J simulated."
    panel = Panel("displacement", "mm", "force", "N", tuple(lines))
    title = f"Setting {log.setting}: force against displacement"
    yield Plot(f"{name}_force_displacement", title, (panel,), caption)


def _peaks(log: LogView, name: str, colour: str) -> Iterator[Plot]:
    """Peak force against peak speed, where more than one speed was run."""
    if len(log.steady) < 2:
        return
    lines = []
    for stroke, sign in _SIGNS.items():
        for word, ink, style in (("simulated", colour, "rings"), ("measured", "ink", "points")):
            names = (f"speed_{stroke}_m_per_s", f"{word}_{stroke}_N")
            x, y = np.array(sorted(tuple(row[k] for k in names) for row in log.steady), float).T
            lines.append(log.line(sign * x, y, word, ink, style, in_legend=stroke == "rebound"))
    panel = Panel("peak velocity", "m/s", "peak force", "N", tuple(lines))
    title = f"Setting {log.setting}: peak force against peak velocity"
    caption = "One point a segment and stroke: mean of its cycles."
    yield Plot(f"{name}_peaks", title, (panel,), caption)


def _force_time(log: LogView, name: str, colour: str) -> Iterator[Plot]:
    signals = log.signals
    residual = signals.force_measured - signals.force
    kept = thin(_LOG_BUCKETS, signals.force_measured, signals.force, residual)
    time = signals.time - signals.time[0]
    # A line across what was not compared would show a motion that nobody ran.
    gaps = np.flatnonzero(np.diff(time) > _GAP * float(np.median(np.diff(time)))) + 1
    kept = np.union1d(kept, np.concatenate([gaps - 1, gaps]))
    time, simulated, measured, residual = (
        np.insert(values[kept], np.searchsorted(kept, gaps), np.nan)
        for values in (time, signals.force, signals.force_measured, residual)
    )
    forces = (
        log.line(time, simulated, "simulated", colour, "wide"),
        log.line(time, measured, "measured", "ink", "thin"),
    )
    left = log.line(time, residual, "residual", colour, "thin", in_legend=False)
    panels = (
        Panel("time", "s", "force", "N", forces),
        Panel("time", "s", "residual", "N", (left,)),
    )
    title = f"Setting {log.setting}: force over time"
    yield Plot(f"{name}_force_time", title, panels, "Below: measured less simulated.")


def _residual(log: LogView, name: str, colour: str) -> Iterator[Plot]:
    velocity = log.signals.velocity
    residual = log.signals.force_measured - log.signals.force
    # Peaks alone would make the cloud wider than it is.
    some = np.arange(0, len(residual), max(1, len(residual) // _CLOUD))
    kept = np.union1d(some, thin(_LOG_BUCKETS // 8, residual))
    cloud = log.line(velocity[kept], residual[kept], "residual", colour, "points")
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
    title = f"Setting {log.setting}: residual against velocity"
    yield Plot(f"{name}_residual", title, (panel,), caption)


def _pressures(log: LogView, name: str, _: str) -> Iterator[Plot]:
    signals = log.signals
    panel = pressure_panel(signals.time, signals.pressures, log.cycle, setting=log.setting)
    pressures = signals.pressures[:, log.cycle]
    shares = [100.0 * float(np.mean(pressure <= 0.0)) for pressure in pressures]
    dry = [f"chamber {i} for {share:.1f} %" for i, share in enumerate(shares, start=1) if share]
    caption = "No chamber cavitates."
    if dry:
        caption = f"Shaded: cavitation, {' and '.join(dry)} of the cycle."
    caption += f" Lowest pressure of this cycle {pressures.min() / _BAR:.3g} bar."
    if log.has_segments and log.cycles:
        caption = f"Last cycle of the fastest segment. {caption}"
    title = f"Setting {log.setting}: chamber pressures, simulated"
    yield Plot(f"{name}_pressures", title, (panel,), caption)


# What is drawn of each log, with the first part of the figure's name and the setting's colour.
LOG_FIGURES: tuple[Callable[[LogView, str, str], Iterator[Plot]], ...] = (
    *(_force_velocity, _force_displacement, _peaks, _force_time, _residual, _pressures),
)


def _valves(rows: Sequence[Row], log: LogView, name: str, colour: str) -> Iterator[Plot]:
    """Yield a setting's valves, flow against pressure; nothing where the table has none."""
    own = [row for row in rows if row["setting"] == log.setting and row["pressure_Pa"] is not None]
    lines: list[Line] = []
    openings = []
    for stroke, sign in _SIGNS.items():
        curves = {
            curve: np.array(
                [
                    (row["pressure_Pa"] / _BAR, row["flow_m3_per_s"] / _CM3)
                    for row in own
                    if (row["stroke"], row["curve"]) == (stroke, curve)
                    and row["flow_m3_per_s"] is not None
                ]
            ).reshape(-1, 2).T
            for curve in ("measured", "law")
        }  # fmt: skip
        law, is_first = curves["law"], not lines
        for curve, ink, style in (("measured", "ink", "points"), ("law", colour, "wide")):
            x, y = sign * curves[curve]
            if len(x):
                lines.append(log.line(x, y, curve, ink, style, in_legend=is_first))
        for row in own:
            if (row["stroke"], row["curve"]) != (stroke, "opening"):
                continue
            pressure = row["pressure_Pa"] / _BAR
            is_reached = law.size > 0 and pressure <= law[0].max()
            if is_reached:
                at, label = np.array([pressure]), "blow-off opens"
                flow = sign * np.interp(at, *law)
                is_named = all(line.label != label for line in lines)
                lines.append(log.line(sign * at, flow, label, "muted", "rings", in_legend=is_named))
            if row["valve_force_N"] is not None:
                more = "" if is_reached else ", which these logs do not reach"
                where = f"{STROKE_WORDS[stroke]} at {pressure:.3g} bar"
                openings.append(f"{where} ({row['valve_force_N']:.3g} N){more}")
    if not lines:
        return
    lines.sort(key=lambda line: ("points", "wide", "rings").index(line.style))
    panel = Panel("pressure across the valve", "bar", "flow", "cm³/s", tuple(lines))
    caption = (
        f"{_DIRECTIONS.capitalize()}. Points: flow read from the loops (displaced by the piston, "
        "less elasticity) without assuming a valve law; where they leave the curve, the law lacks "
        "something."
    )
    if openings:
        caption += f" Blow-offs open in {'; in '.join(openings)}."
    title = f"Setting {log.setting}: the valves, flow against pressure"
    yield Plot(f"{name}_valves", title, (panel,), caption)
