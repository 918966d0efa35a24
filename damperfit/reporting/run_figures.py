"""The figures of a run: of all settings (the paper's Figs 13-16) and of each log (Figs 7, 11, 12).

Displacement in mm, velocity in m/s, force in N, pressure in bar; positive in rebound. A road drawn
sample by sample is a tangle of strands: where nothing repeats, means of both branches by velocity
and of both strokes by place are drawn, with the range of the forces that the speeds spread.

A figure is a function that yields what it has of it, and a line in `FIGURES` or `LOG_FIGURES`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from damperfit.damper.model import PRESSURES
from damperfit.reporting.figures import (
    CHAMBER_COLOURS,
    CHAMBER_STYLES,
    SPEED_COLOURS,
    Line,
    Panel,
    Plot,
    plot_in_units,
    setting_colours,
    setting_names,
    setting_panel,
    setting_places,
    thin,
)
from damperfit.reporting.forces import STROKE_WORDS, sweep_sentence
from damperfit.reporting.records import findings_in, listed_in, number_in, trends_in, units_in
from damperfit.reporting.sheet import number
from damperfit.reporting.tables import is_one_for_all, scale_of
from damperfit.tested.setting import Setting, lines_of
from damperfit.units.shown_units import SI, ShownUnits

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from damperfit.adjustment.trends import Trend
    from damperfit.damper.quantity import Quantity
    from damperfit.recording import Finding
    from damperfit.reporting.forces import SweepMember
    from damperfit.results import Run
    from damperfit.simulation import Response
    from damperfit.tables.reading import LogSignals

    FloatArray = NDArray[np.float64]
    Row = Mapping[str, Any]

_BUCKETS = 500  # of one cycle: 3000 samples are drawn as they are
_LOG_BUCKETS = 200  # of a whole log: peaks of every cycle survive
_CLOUD = 800  # points of a residual plot, besides the peaks
_GAP = 1.5  # sample intervals
_BINS = 24  # of velocity, from the lowest to the highest
_FEW = 3  # samples: no mean of fewer
_FEW_IN_RANGE = 20  # no range of fewer: each end would be one sample
_RANGE = (5.0, 95.0)  # per cent of the samples that lie below
_LATE = 1e-6  # s; time stamps are rounded alike
_FEWEST = 8  # samples of a cycle
_ONE_SPEED = 0.05  # speeds within this share are one test, run again
_EVERY = 4  # settings of which one is drawn bold and labelled
_ALONG = ("dashed", "dotted")  # trends of the first adjuster, of the second, ...
_NAMED = 6  # trends along adjusters that a legend names
_FAR = 3.0  # heights of the fitted values: a value at a bound beyond it would flatten them
_STROKES = (("rebound", 1.0), ("bump", -1.0))
_BAR, _CM3 = 1e5, 1e-6
_DIRECTIONS = "rebound to the right and up, compression to the left and down"


# A log as it is looked at


@dataclass(frozen=True, eq=False)
class LogView:
    """A log with what the run tells of it.

    Attributes
    ----------
    signals : LogSignals
        All evaluated cycles.
    facts : mapping
        Its entry of the inputs in run.json.
    rows : tuple of mapping
        Its rows of the table "characteristics".
    """

    signals: LogSignals
    facts: Row
    rows: tuple[Row, ...]

    @property
    def setting(self) -> Setting:
        """Where the adjusters stand."""
        return self.signals.setting

    @cached_property
    def peaks(self) -> tuple[Row, ...]:
        """Its segments: peak speeds and forces, energy, hysteresis."""
        return tuple(row for row in self.rows if row["point"] == "peak")

    @property
    def is_moving(self) -> bool:
        """Whether nothing in it repeats."""
        return bool(self.peaks) and not any(row["cycles"] for row in self.peaks)

    @property
    def has_segments(self) -> bool:
        """Whether it is no single steady run."""
        return len(self.peaks) > 1 or self.is_moving

    @property
    def fastest(self) -> Row | None:
        """Its fastest steady segment; None where nothing repeats, or no table tells."""
        steady = [row for row in self.peaks if row["cycles"]]
        return max(steady, key=lambda row: row["speed_rebound_m_per_s"] or 0.0, default=None)

    @cached_property
    def cycles(self) -> tuple[slice, ...]:
        """The last whole cycle of each steady segment; older runs tell of one, in the entry."""
        time, found = self.signals.time, []
        told = listed_in(self.facts, "stretches") or [self.facts]
        for segment in (one for one in told if isinstance(one, dict)):
            rate = number_in(segment, "frequency_Hz")
            is_steady = segment.get("kind", "steady") == "steady"
            if not is_steady or rate is None or not rate > 0.0 or len(time) < _FEWEST:
                continue
            stop = number_in(segment, "figures_stop_s") or number_in(segment, "stop_s") or math.inf
            end = int(np.searchsorted(time, stop - _LATE))
            begin = int(np.searchsorted(time, time[end - 1] - 1.0 / rate - _LATE))
            if end - begin >= _FEWEST:
                found.append(slice(begin, end))
        return tuple(found)

    @property
    def cycle(self) -> slice:
        """The last cycle of the fastest steady segment, all samples where nothing repeats."""
        whole = slice(0, len(self.signals.time))
        return max(
            self.cycles, key=lambda part: float(np.ptp(self.signals.velocity[part])), default=whole
        )

    @property
    def frequency(self) -> float | None:
        """Hz, where it is known."""
        return number_in(self.fastest or self.facts, "frequency_Hz")

    @property
    def amplitude(self) -> float:
        """Half of the stroke, m; NaN where it is not known."""
        known = [number_in(one, "amplitude_m") for one in (*self.peaks, self.facts)]
        return max((one for one in known if one is not None), default=math.nan)

    @property
    def temperature(self) -> float | None:
        """Mean over the log, degC."""
        return number_in(self.facts, "temperature_degC")

    @property
    def notes(self) -> tuple[str, ...]:
        """How it was read."""
        return tuple(map(str, listed_in(self.facts, "notes")))

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What its data show, the gravest first."""
        return findings_in(self.facts)


def has_several_speeds(rows: Iterable[Row]) -> bool:
    """Whether a setting was tested at more than one speed, by its rows of characteristics."""
    speeds: dict[Setting, list[float]] = {}
    for row in rows:
        if row["point"] == "peak" and row["cycles"] and row["speed_rebound_m_per_s"]:
            speeds.setdefault(row["setting"], []).append(row["speed_rebound_m_per_s"])
    return any(max(known) > (1.0 + _ONE_SPEED) * min(known) for known in speeds.values())


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
        entries = listed_in(self.run.record, "inputs")
        facts = {str(one.get("log")): one for one in entries if isinstance(one, dict)}
        rows: dict[tuple[Setting, str], list[Row]] = {}
        for row in self.run.rows("characteristics"):
            rows.setdefault((row["setting"], str(row["log"])), []).append(row)
        return tuple(
            LogView(one, facts.get(one.log, {}), tuple(rows.get((one.setting, one.log), ())))
            for one in self.run.signals
        )

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
                plots += _valves(self.run.rows("valves"), setting, colour=colour)
            found.append((log, tuple(plot_in_units(plot, self.units) for plot in plots)))
        return tuple(found)

    @property
    def plots(self) -> tuple[Plot, ...]:
        """All plots in the order of the report."""
        return (*self.overall, *(plot for _, plots in self.by_log for plot in plots))


def report_plots(run: Run, units: ShownUnits | None = None) -> ReportPlots:
    """Lay out the plots of a run, in units of one's own or, for None, those of the run."""
    return ReportPlots(run, units_in(run.record) if units is None else units)


# All settings together


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
                at = sorted(pairs)
                line = Line(
                    sign * np.array(at),
                    np.array([pairs[speed] for speed in at]),
                    f"setting {setting}, {word}, {STROKE_WORDS[stroke]}",
                    shown.colours[setting],
                    setting,
                    look,
                    tag=setting.label if look == "wide" and sign > 0.0 else "",
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


def _fan(shown: ReportPlots) -> Iterator[Plot]:
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
    for branch in _branches(v, f):
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
    for k, speed in enumerate(sorted({row["speed_m_per_s"] for row in rows})):
        for stroke, style in (("rebound", "dot_line"), ("bump", "triangle_line")):
            # With several adjusters a setting has a row for each that was turned.
            forces = {
                places[row["setting"]]: row["force_N"]
                for row in rows
                if row["speed_m_per_s"] == speed and row["stroke"] == stroke
            }
            at = sorted(place for place, force in forces.items() if force is not None)
            label = f"{STROKE_WORDS[stroke]}, {speed:g} m/s"
            colour = SPEED_COLOURS[k % len(SPEED_COLOURS)]
            y = np.array([forces[place] for place in at])
            lines.append(Line(np.array(at), y, label, colour, None, style))
    if lines:
        panel = setting_panel(places, "force", "N", lines)
        caption = "The model's, as in the table. Dots: rebound, triangles: compression."
        yield Plot("named_speeds", "Force against setting at named speeds", (panel,), caption)


def _errors(shown: ReportPlots) -> Iterator[Plot]:
    def positive(rows: Iterable[Row], name: str) -> list[Row]:
        return [row for row in rows if 0.0 < (row[name] or 0.0) < math.inf]  # the axis is of powers

    rows = (row for row in shown.run.rows("mse") if not row["log"])
    whole = positive(rows, "mse_percent")
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
    caption = "Dots: MSE, 100 % would be no better than the mean force."
    if floor := positive(whole, "noise_floor_percent"):
        drawn = points(floor, "noise_floor_percent")
        lines.insert(0, Line(*drawn, "noise floor", "muted", style="dashed"))
        caption += (
            " Dashed: noise floor, the MSE that scatter of the force explains; above it: the "
            "model, or noise of the displacement."
        )
    rules = ((1.0, "1 %: excellent below"), (5.0, "5 %: good below"))
    panel = setting_panel(places, "MSE", "%", lines, rules=rules, is_log=True)
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
        curves = _trends(mine, places, scale.factor, is_numbered=is_numbered)
        points = [
            _point(row, places[row["setting"]], one, shown.colours[row["setting"]], far)
            for row in known
        ]
        lines = (*curves, *points)
        panel = setting_panel(places, scale.symbol, scale.axis, lines, y_range=y_range)
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
    ends = (row[f"{name}{end}"] for row in trusted for end in ("", "_ci_low", "_ci_high"))
    values = [factor * end for end in ends if end is not None and math.isfinite(end)]
    if not values:
        return None, {}
    reach = _FAR * ((max(values) - min(values)) or abs(max(values)) or 1.0)
    bounds = {row["setting"]: factor * row[name] for row in rows if row not in trusted}
    near = [y for y in bounds.values() if min(values) - reach < y < max(values) + reach]
    if len(near) == len(bounds):
        return None, {}
    low, high = min([*values, *near]), max([*values, *near])
    height = (high - low) or reach / _FAR
    far = {
        setting: low - 0.07 * height if y < low else high + 0.07 * height
        for setting, y in bounds.items()
        if y not in near
    }
    return (low - 0.12 * height, high + 0.12 * height), far


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


def _trends(
    trends: Sequence[Trend], places: Mapping[Setting, float], factor: float, *, is_numbered: bool
) -> Iterator[Line]:
    """Yield each trend with its band and what is off it.

    Where settings stand beside one another each is drawn along its adjuster, without its band.
    """
    adjusters = list(dict.fromkeys(one.adjuster for one in trends))
    standing = {(line.adjuster, line.held): line for line in lines_of(places)}
    for trend in trends:
        at = {float(point.setting): float(point.setting) for point in trend.points}
        if not is_numbered:
            line = standing.get((trend.adjuster, trend.held))
            numbers = {} if line is None else line.numbers
            at = {clicks: places[setting] for setting, clicks in numbers.items()}
        known = [point for point in trend.points if float(point.setting) in at]
        x = np.array([at[float(point.setting)] for point in known])
        y, low, high = (
            factor * np.array([getattr(point, name) for point in known], dtype=np.float64)
            for name in ("value", "low", "high")
        )
        band: Any = {}
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


def _caption(
    rows: Sequence[Row], known: Sequence[Row], name: str, far: Mapping[Setting, float]
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
    _fan,
    _parameters,
    _errors,
    _absolute,
    _named_speeds,
)


# One log


class _Branch(NamedTuple):
    """Means of one branch: "opening", where the speed grows, or "closing"."""

    word: str
    velocity: FloatArray
    mean: FloatArray


def _branches(velocity: FloatArray, values: FloatArray) -> Iterator[_Branch]:
    """Yield the means of both branches by velocity, at the middles of the bins."""
    if len(velocity) < _BINS or np.ptp(velocity) == 0.0:
        return
    middle, place = _binned(velocity)
    is_opening = np.gradient(np.abs(velocity)) > 0.0
    for part, word in ((is_opening, "opening"), (~is_opening, "closing")):
        count = np.bincount(place[part], minlength=_BINS)
        total = np.bincount(place[part], weights=values[part], minlength=_BINS)
        seen = count >= _FEW
        if seen.any():
            yield _Branch(word, middle[seen], total[seen] / count[seen])


def _binned(signal: FloatArray) -> tuple[FloatArray, NDArray[np.intp]]:
    """Return the middles of the bins, and the bin of each sample."""
    edges = np.linspace(signal.min(), signal.max(), _BINS + 1)
    return 0.5 * (edges[1:] + edges[:-1]), np.clip(np.digitize(signal, edges) - 1, 0, _BINS - 1)


def _both(view: LogView, colour: str) -> Iterator[tuple[str, FloatArray, str, str]]:
    """Yield word, force, colour and style: simulated in colour, measured thin on top of it."""
    yield "simulated", view.signals.force, colour, "wide"
    yield "measured", view.signals.force_measured, "ink", "thin"


def _loops(view: LogView, signal: FloatArray, colour: str) -> Iterator[Line]:
    """Yield the last cycle of each steady segment."""
    cycles = view.cycles or (view.cycle,)
    for word, force, ink, style in _both(view, colour):
        for cycle in cycles:
            x, y = signal[cycle], force[cycle]
            kept = thin(_BUCKETS, x, y)
            is_first = cycle is cycles[0]
            yield Line(x[kept], y[kept], word, ink, view.setting, style, in_legend=is_first)


def _last_cycle(view: LogView) -> str:
    if not view.has_segments:
        return "Last cycle"
    is_steady = all(row["cycles"] for row in view.peaks)
    return "Last cycle of each segment" if is_steady else "Last cycle of each steady segment"


def _force_velocity(view: LogView, name: str, colour: str) -> Iterator[Plot]:
    if view.is_moving:
        lines = [
            Line(
                *(branch.velocity, branch.mean, word, ink, view.setting, style),
                in_legend=branch.word == "opening",
            )
            for word, force, ink, style in _both(view, colour)
            for branch in _branches(view.signals.velocity, force)
        ]
        begins = "Mean of the opening and of the closing branch"
    else:
        lines, begins = [*_loops(view, view.signals.velocity, colour)], _last_cycle(view)
    panel = Panel("velocity", "m/s", "force", "N", tuple(lines))
    title = f"Setting {view.setting}: force against velocity"
    yield Plot(f"{name}_force_velocity", title, (panel,), f"{begins}; {_DIRECTIONS}.")


def _force_displacement(view: LogView, name: str, colour: str) -> Iterator[Plot]:
    fastest = view.fastest
    if view.is_moving:
        lines = [*_stroke_forces(view, colour)]
        caption = (
            "Mean over the samples of each stroke, rebound above and compression below; nine of "
            "ten samples lie within the shaded range, for the speeds differ that pass a place."
        )
    else:
        lines = [*_loops(view, 1e3 * view.signals.displacement, colour)]
        caption = f"{_last_cycle(view)}."
        if fastest and not view.has_segments:
            energy = [number(fastest[f"{w}_energy_J"], digits=4) for w in ("measured", "simulated")]
            caption += f" Energy per cycle: {energy[0]} J measured, {energy[1]} J simulated."
    panel = Panel("displacement", "mm", "force", "N", tuple(lines))
    title = f"Setting {view.setting}: force against displacement"
    yield Plot(f"{name}_force_displacement", title, (panel,), caption)


def _stroke_forces(view: LogView, colour: str) -> Iterator[Line]:
    """Yield mean and range of the force by place: a band simulated, dotted lines measured."""
    x, v = 1e3 * view.signals.displacement, view.signals.velocity
    if len(x) < _FEW_IN_RANGE or np.ptp(x) == 0.0:
        return
    middle, place = _binned(x)
    for word, force, ink, style in _both(view, colour):
        for part, is_first in ((v > 0.0, True), (v < 0.0, False)):
            groups = [force[part & (place == k)] for k in range(_BINS)]
            seen = [k for k, group in enumerate(groups) if len(group) >= _FEW_IN_RANGE]
            if not seen:
                continue
            low, high = np.array([np.percentile(groups[k], _RANGE) for k in seen]).T
            at, mean = middle[seen], np.array([groups[k].mean() for k in seen])
            band = {"low": low, "high": high} if word == "simulated" else {}
            yield Line(at, mean, word, ink, view.setting, style, in_legend=is_first, **band)
            for end in () if band else (low, high):
                label, is_named = "measured, 5 and 95 %", is_first and end is low
                yield Line(at, end, label, ink, view.setting, "dotted", in_legend=is_named)


def _peaks(view: LogView, name: str, colour: str) -> Iterator[Plot]:
    """Peak force against peak speed, where more than one speed was run."""
    steady = [row for row in view.peaks if row["cycles"]]
    if len(steady) < 2:
        return
    lines = []
    for stroke, sign in _STROKES:
        for word, ink, style in (("simulated", colour, "rings"), ("measured", "ink", "points")):
            names = (f"speed_{stroke}_m_per_s", f"{word}_{stroke}_N")
            x, y = np.array(sorted(tuple(row[one] for one in names) for row in steady), float).T
            is_first = stroke == "rebound"
            lines.append(Line(sign * x, y, word, ink, view.setting, style, in_legend=is_first))
    panel = Panel("peak velocity", "m/s", "peak force", "N", tuple(lines))
    caption = "One point a segment and stroke: mean of its cycles."
    title = f"Setting {view.setting}: peak force against peak velocity"
    yield Plot(f"{name}_peaks", title, (panel,), caption)


def _force_time(view: LogView, name: str, colour: str) -> Iterator[Plot]:
    signals = view.signals
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
        Line(time, simulated, "simulated", colour, view.setting, "wide"),
        Line(time, measured, "measured", "ink", view.setting, "thin"),
    )
    left = Line(time, residual, "residual", colour, view.setting, "thin", in_legend=False)
    panels = (
        Panel("time", "s", "force", "N", forces),
        Panel("time", "s", "residual", "N", (left,)),
    )
    title = f"Setting {view.setting}: force over time"
    yield Plot(f"{name}_force_time", title, panels, "Below: measured less simulated.")


def _residual(view: LogView, name: str, colour: str) -> Iterator[Plot]:
    signals = view.signals
    residual = signals.force_measured - signals.force
    # Peaks alone would make the cloud wider than it is.
    some = np.arange(0, len(residual), max(1, len(residual) // _CLOUD))
    kept = np.union1d(some, thin(_LOG_BUCKETS // 8, residual))
    cloud = Line(
        *(signals.velocity[kept], residual[kept], "residual", colour, view.setting, "points")
    )
    styles = {"opening": "solid", "closing": "dashed"}
    means = [
        Line(
            *(branch.velocity, branch.mean, f"mean, {branch.word} branch", "ink"),
            *(view.setting, styles[branch.word]),
        )
        for branch in _branches(signals.velocity, residual)
    ]
    panel = Panel("velocity", "m/s", "residual", "N", (cloud, *means), rules=((0.0, ""),))
    caption = (
        "Measured less simulated. A cloud around zero is noise; where a mean leaves zero, "
        "the model lacks something."
    )
    title = f"Setting {view.setting}: residual against velocity"
    yield Plot(f"{name}_residual", title, (panel,), caption)


def _pressures(view: LogView, name: str, _: str) -> Iterator[Plot]:
    signals = view.signals
    time = signals.time[view.cycle] - signals.time[view.cycle.start]
    pressures = signals.pressures[:, view.cycle]
    panel = _pressure_panel(time, pressures, setting=view.setting)
    shares = [100.0 * float(np.mean(pressure <= 0.0)) for pressure in pressures]
    dry = [f"chamber {i} for {share:.1f} %" for i, share in enumerate(shares, start=1) if share]
    caption = "No chamber cavitates."
    if dry:
        caption = f"Shaded: cavitation, {' and '.join(dry)} of the cycle."
    caption += f" Lowest pressure of this cycle {pressures.min() / _BAR:.3g} bar."
    if view.has_segments and view.cycles:
        caption = f"Last cycle of the fastest segment. {caption}"
    title = f"Setting {view.setting}: chamber pressures, simulated"
    yield Plot(f"{name}_pressures", title, (panel,), caption)


def _pressure_panel(
    time: FloatArray, pressures: FloatArray, *, setting: Setting | None = None
) -> Panel:
    """Return the chamber pressures over one cycle, cavitation shaded."""
    kept = thin(_BUCKETS, *pressures)
    looks = zip(PRESSURES, pressures, CHAMBER_COLOURS, CHAMBER_STYLES, strict=True)
    lines = tuple(
        Line(time[kept], pressure[kept] / _BAR, one.label, colour, setting=setting, style=style)
        for one, pressure, colour, style in looks
    )
    is_dry = np.concatenate(([False], np.any(pressures <= 0.0, axis=0), [False]))
    begins = np.flatnonzero(~is_dry[:-1] & is_dry[1:])
    ends = np.flatnonzero(is_dry[:-1] & ~is_dry[1:]) - 1
    bands = tuple((float(time[a]), float(time[b])) for a, b in zip(begins, ends, strict=True))
    return Panel("time", "s", "absolute pressure", "bar", lines, bands=bands)


# What is drawn of each log, with the first part of the figure's name and the setting's colour.
LOG_FIGURES: tuple[Callable[[LogView, str, str], Iterator[Plot]], ...] = (
    _force_velocity,
    _force_displacement,
    _peaks,
    _force_time,
    _residual,
    _pressures,
)


# Valves of a setting


def _valves(rows: Sequence[Row], setting: Setting, *, colour: str) -> tuple[Plot, ...]:
    """Return a setting's valves, flow against pressure, or nothing where the table has none."""
    own = [row for row in rows if row["setting"] == setting]
    lines: list[Line] = []
    openings = []
    for stroke, sign in _STROKES:
        is_first = not lines
        law = _curve(own, stroke, "law")
        for curve, ink, style in (("measured", "ink", "points"), ("law", colour, "wide")):
            x, y = sign * _curve(own, stroke, curve)
            if len(x):
                lines.append(Line(x, y, curve, ink, setting, style, in_legend=is_first))
        for row in own:
            is_opening = row["stroke"] == stroke and row["curve"] == "opening"
            if not is_opening or row["pressure_Pa"] is None:
                continue
            pressure = row["pressure_Pa"] / _BAR
            is_reached = len(law[0]) > 0 and pressure <= law[0].max()
            if is_reached:
                at, label = np.array([pressure]), "blow-off opens"
                flow = sign * np.interp(at, *law)
                is_named = all(line.label != label for line in lines)
                lines.append(
                    Line(sign * at, flow, label, "muted", setting, "rings", in_legend=is_named)
                )
            if row["valve_force_N"] is not None:
                more = "" if is_reached else ", which these logs do not reach"
                where = f"{STROKE_WORDS[stroke]} at {pressure:.3g} bar"
                openings.append(f"{where} ({row['valve_force_N']:.3g} N){more}")
    if not lines:
        return ()
    order = {"points": 0, "wide": 1, "rings": 2}
    lines.sort(key=lambda line: order[line.style])
    panel = Panel("pressure across the valve", "bar", "flow", "cm³/s", tuple(lines))
    caption = (
        f"{_DIRECTIONS.capitalize()}. Points: what the piston displaces less what gives way, read "
        "off the loops without a law of the valve; where they leave the law, the law lacks "
        "something."
    )
    if openings:
        caption += f" Blow-offs open in {'; in '.join(openings)}."
    title = f"Setting {setting}: the valves, flow against pressure"
    return (Plot(f"setting_{setting.slug}_valves", title, (panel,), caption),)


def _curve(rows: Sequence[Row], stroke: str, curve: str) -> FloatArray:
    """Return pressure in bar and flow in cm3/s, shape (2, n)."""
    points = [
        (row["pressure_Pa"] / _BAR, row["flow_m3_per_s"] / _CM3)
        for row in rows
        if row["stroke"] == stroke and row["curve"] == curve
        if row["pressure_Pa"] is not None and row["flow_m3_per_s"] is not None
    ]
    return np.array(points, dtype=np.float64).reshape(-1, 2).T


# A simulated cycle, and a sweep


def cycle_plot(response: Response, frequency: float, *, title: str = "") -> Plot:
    """Return force against displacement and velocity over the last cycle, of ``frequency`` Hz."""
    last = response.time >= response.time[-1] - (1.0 + 1e-9) / frequency
    force = response.force[last]
    panels = (
        Panel("displacement (positive: rebound)", "mm", "force", "N",
              (Line(1e3 * response.displacement[last], force, "force", "#0072b2"),)),
        Panel("velocity (positive: rebound)", "m/s", "force", "N",
              (Line(response.velocity[last], force, "force", "#0072b2"),)),
    )  # fmt: skip
    return Plot("cycle", title, panels)


def sweep_plot(name: str, members: Sequence[SweepMember], *, file_name: str, title: str) -> Plot:
    """Return the force-velocity loops of a sweep's members; x1 in the text colour."""
    colours = tuple(setting_colours(range(len(members))).values())
    lines = []
    for member, colour in zip(members, colours, strict=True):
        cycle = _last_cycle_of(member)
        v, f = member.response.velocity[cycle], member.response.force[cycle]
        kept = thin(_BUCKETS, v, f)
        ink = "ink" if member.factor == 1.0 else colour
        lines.append(Line(v[kept], f[kept], f"{name} x{member.factor:g}", ink))
    panel = Panel("velocity", "m/s", "force", "N", tuple(lines))
    return Plot(file_name, title, (panel,), sweep_sentence(name, members))


def sweep_pressure_plot(member: SweepMember, *, file_name: str, title: str) -> Plot:
    """Return the chamber pressures of one member, cavitation shaded."""
    cycle = _last_cycle_of(member)
    time = member.response.time[cycle] - member.response.time[cycle.start]
    panel = _pressure_panel(time, member.response.pressures[:, cycle])
    return Plot(file_name, title, (panel,), "Shaded: cavitation." if panel.bands else "")


def _last_cycle_of(member: SweepMember) -> slice:
    time = member.response.time
    start = time[-1] - 1.0 / member.frequency
    return slice(max(0, int(np.searchsorted(time, start)) - 1), len(time))
