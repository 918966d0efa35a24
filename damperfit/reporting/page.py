"""A run, and comparisons of runs, as one HTML file: text and tables by us, plots by plotly.js.

Everything that may have come from a log or a configuration is escaped by the templates, and in
plot descriptions by `page_text`. The page forbids itself every network request
(Content-Security-Policy). At the top are the identity of the test, its result in a line, the table
of forces and the force-velocity picture; what belongs to one log is folded.
"""

from __future__ import annotations

import base64
import json
import math
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import cache
from importlib import resources
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape
from numpy.typing import NDArray

from damperfit import __version__
from damperfit.errors import InstallationError
from damperfit.problem import counted, findings_in
from damperfit.reporting.compared import (
    comparison_sheets,
    difference_plots,
    loop_plots,
    tolerance_outcome,
    tolerance_sheet,
)
from damperfit.reporting.figures import ReportPlots
from damperfit.reporting.plots import Line, Plot, plot_in_units, setting_colours
from damperfit.reporting.records import checks_in, listed_in, number_in
from damperfit.reporting.report import Section, lead, report_sections, verdict
from damperfit.reporting.sheet import html_table, printable, rows_in_units, sheet_in_units
from damperfit.reporting.tables import log_force_sheet, parameter_line, segment_sheet
from damperfit.tested.setting import Setting
from damperfit.units.shown_units import ShownUnits

if TYPE_CHECKING:
    from damperfit.comparison.comparing import RunComparison
    from damperfit.queries.compared import Comparison
    from damperfit.settings_and_logs import LogResult

_IDENTITY = ("damper", "serial", "date", "operator", "customer", "rig")
_LOOKS = {"excellent": "well", "passed": "well", "poor": "ill", "FAILED": "ill"}


# Templates and plots


def draw(template: str, **values: object) -> str:
    """Return a template of `reporting/assets` with these parts, escaped but for `Markup`."""
    return _environment().get_template(template).render(values)


def _page(template: str, data: PlotData, colours: Mapping[Setting, str], **values: object) -> str:
    return draw(
        template,
        version=__version__,
        style=asset("page.css"),
        colours=colours,
        data=data.script(colours),
        plotly=plotly_script(),
        script=asset("page.js"),
        **values,
    )


def page_text(text: object) -> Markup:
    r"""Return text that a page and a plot show as it is, control characters as escapes.

    Plots need it where they are described, for plotly reads labels as a small HTML of its own.

    Examples
    --------
    >>> print(page_text("<b>run_1\x1b[0m"))
    &lt;b&gt;run_1\x1b[0m
    """
    return text if isinstance(text, Markup) else escape(printable(str(text)))


def asset(name: str) -> Markup:
    """Return the page's style or script."""
    place = resources.files("damperfit.reporting") / "assets" / name
    return _verbatim(place.read_text(encoding="utf-8"))


def _verbatim(text: str) -> Markup:
    return Markup(text)  # noqa: S704 - for what is escaped or ours


@cache
def _environment() -> Environment:
    environment = Environment(
        loader=PackageLoader("damperfit.reporting", "assets"),
        autoescape=True,
        finalize=page_text,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.globals["html_table"] = lambda sheet: _verbatim(html_table(sheet, looks=_LOOKS))
    return environment


class PlotData:
    """Arrays of the page, each once, and the plots that point to them."""

    def __init__(self) -> None:
        self.arrays: dict[bytes, int] = {}
        self.plots: list[dict[str, Any]] = []

    def add(self, plot: Plot) -> dict[str, Any]:
        """Keep a plot, and return its place in the data, and its texts, not yet escaped."""
        panels = [
            {
                "x": [panel.x_label, panel.x_unit],
                "y": [panel.y_label, panel.y_unit],
                "rules": panel.rules,
                "bands": panel.bands,
                "log": panel.is_log,
                "ticks": panel.ticks,
                **({"names": panel.names, "labels": panel.tick_labels} if panel.names else {}),
                "xrange": panel.x_range,
                "lines": list(map(self._line, panel.lines)),
            }
            for panel in plot.panels
        ]
        title = page_text(plot.title)
        entry = {"name": plot.name, "title": title, "panels": panels, "keyed": bool(plot.key)}
        self.plots.append(entry)
        words = {"name": plot.name, "title": plot.title, "caption": plot.caption}
        return {"place": len(self.plots) - 1, "is_tall": len(plot.panels) > 1, **words}

    def script(self, colours: Mapping[Setting, str]) -> Markup:
        """Return everything as JSON that cannot end the script element it stands in."""
        document = {
            "arrays": [base64.b64encode(data).decode("ascii") for data in self.arrays],
            "plots": self.plots,
            "colours": {str(setting): colour for setting, colour in colours.items()},
        }
        text = json.dumps(document, ensure_ascii=True, allow_nan=False, separators=(",", ":"))
        return _verbatim(text.replace("<", "\\u003c"))

    def _array(self, values: NDArray[np.float64]) -> int:
        """Return the place of an array, kept as 32-bit floats: 7 digits, no loss seen."""
        with np.errstate(over="ignore"):  # of an edited table: infinite
            data = np.ascontiguousarray(values, dtype="<f4").tobytes()
        return self.arrays.setdefault(data, len(self.arrays))

    def _line(self, line: Line) -> dict[str, Any]:
        return {
            "x": self._array(line.x),
            "y": self._array(line.y),
            "label": page_text(line.label),
            "colour": line.colour,
            "setting": None if line.setting is None else Setting.of(line.setting).cell,
            "style": line.style,
            "legend": line.in_legend,
            "up": None if line.high is None else self._array(line.high - line.y),
            "down": None if line.low is None else self._array(line.y - line.low),
            **({"tag": page_text(line.tag)} if line.tag else {}),
        }


def plotly_script() -> Markup:
    """Return plotly.js out of the Python package, which need not be imported for it."""
    spec = find_spec("plotly")
    for place in spec.submodule_search_locations or () if spec else ():
        path = Path(place) / "package_data" / "plotly.min.js"
        if path.is_file():
            text = path.read_text(encoding="utf-8")
            return _verbatim(text.replace("</script", "<\\/script"))
    raise InstallationError(
        "the report needs plotly; install it with: pip install plotly", code="missing-library"
    )


# A run


def html_report(plots: ReportPlots, *, title: str) -> str:
    """Return a run as one self-contained HTML page below a heading, which is escaped here."""
    run, data = plots.run, PlotData()
    overall = [data.add(plot) for plot in plots.overall]
    logs = list(_log_sections(plots, data))
    keys = dict.fromkeys((*_IDENTITY, *run.identity))
    by_place: dict[str, list[Section]] = defaultdict(list)
    for section in report_sections(run, plots.units):
        by_place[section.place].append(section)
    return _page(
        "page.html",
        data,
        plots.colours,
        title=title,
        places=list(dict.fromkeys(log["setting"] for log in logs)),
        identity=[(key, run.identity[key]) for key in keys if key in run.identity],
        lead=lead(run),
        of=by_place,
        failed=[check for check in checks_in(run.record) if check.passed is False],
        figures=overall,
        logs=logs,
    )


def _log_sections(report: ReportPlots, data: PlotData) -> Iterator[dict[str, Any]]:
    """Yield what the page shows of each log; its anchor is ``setting-12``, ``setting-12-log-2``."""
    run, units = report.run, report.units
    rows = {row["setting"]: row for row in run.rows("parameters")}
    counts: Counter[str] = Counter()
    for drawn, plots in report.by_log:
        log, n_samples = drawn.result, len(drawn.signals.time)
        name = str(log.setting.cell) if isinstance(log.setting.cell, int) else log.setting.slug
        counts[name] += 1
        row, fastest = rows.get(log.setting), log.fastest
        points = rows_in_units(log.rows, units)
        at_best = [point for point in points if fastest and point["stretch"] == fastest["stretch"]]
        forces = [log_force_sheet(at_best)] if at_best else []
        segments = [segment_sheet(points, has_setting=False)] if log.has_segments else []
        notes, findings = [], []
        for finding in findings_in(log.facts):
            if finding.severity == "note":
                notes.append(finding.message())
            else:
                findings.append(f"{finding.severity}: {finding.message()}")
        reading = [note for note in map(str, listed_in(log.facts, "notes")) if note not in notes]
        yield {
            "setting": log.setting,
            "anchor": f"setting-{name}" + (f"-log-{counts[name]}" if counts[name] > 1 else ""),
            "log": log.name,
            "verdict": verdict(row, run) if row else "",
            "parameters": parameter_line(row, run.quantities, units) if row else "",
            "facts": f"{_log_facts(log, units)}, {n_samples} samples evaluated.",
            "findings": findings,
            "details": {"Notes on the log": notes, "How the log was read": reading},
            "figures": [data.add(plot) for plot in plots],
            "forces": [sheet_in_units(sheet, units) for sheet in forces],
            "segments": [sheet_in_units(sheet, units) for sheet in segments],
        }


def _log_facts(log: LogResult, units: ShownUnits) -> str:
    rate = number_in(log.fastest or log.facts, "frequency_Hz")
    motion = "frequency unknown" if rate is None else f"{rate:.3g} Hz"
    if log.has_segments:
        fastest = max(row["speed_rebound_m_per_s"] or 0.0 for row in log.segments)
        segments = counted(len(log.segments), "segment")
        motion = f"{segments}, to {units.write(fastest, 'm/s', '.3g')}"
    amplitudes = (number_in(entry, "amplitude_m") for entry in (*log.segments, log.facts))
    largest = max((size for size in amplitudes if size is not None), default=math.nan)
    amplitude = f"amplitude {units.write_length(largest, '.3g')}"
    celsius = number_in(log.facts, "temperature_degC")
    temperature = "temperature not logged" if celsius is None else f"{celsius:.1f} degC"
    return f"{motion}, {amplitude}, {temperature}"


# Runs beside one another


def comparison_page(done: Comparison) -> str:
    """Return comparisons, and forces checked against bands, as one self-contained HTML page."""
    comparisons, points = done.comparisons, done.points
    data = PlotData()
    groups: dict[str, list[RunComparison]] = defaultdict(list)
    for pair in comparisons:
        groups[pair.first.shown_as].append(pair)
    overall: list[dict[str, Any]] = []
    settings_of: list[dict[str, Any]] = []
    for k, group in enumerate(groups.values()):
        suffix = f"_{k + 1}" if len(groups) > 1 else ""
        owner = f" ({group[0].first.name})" if len(groups) > 1 else ""
        overall += [
            data.add(replace(plot, name=plot.name + suffix, title=plot.title + owner))
            for plot in difference_plots(group)
        ]
        runs = [group[0].first, *(pair.second for pair in group)]
        for setting in sorted({setting for pair in group for setting in pair.settings}):
            tested = [run for run in runs if setting in {test.setting for test in run.tests}]
            plots = loop_plots(tested, setting, name=f"setting_{setting.slug}{suffix}")
            figures = [data.add(plot_in_units(plot, group[0].units)) for plot in plots]
            title = f"Setting {setting}{owner}"
            settings_of.append({"setting": setting, "title": title, "figures": figures})
    titles = [f"{pair.second.name} beside {pair.first.name}" for pair in comparisons]
    return _page(
        "comparison.html",
        data,
        setting_colours(sorted({s for pair in comparisons for s in pair.settings})),
        title=" | ".join(titles[:3]) or "tolerance",
        pairs=list(zip(titles, comparisons, map(comparison_sheets, comparisons), strict=True)),
        tolerance=(tolerance_outcome(points), tolerance_sheet(points)) if points else None,
        source=done.tolerance,
        alone=list(done.alone),
        overall=overall,
        sections=settings_of,
    )
