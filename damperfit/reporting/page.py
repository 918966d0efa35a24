"""A run, and comparisons of runs, as one HTML file: text and tables by us, plots by plotly.js.

Everything that may have come from a log or a configuration is escaped by the templates, and in
plot descriptions by `page_text`. The page forbids itself every network request
(Content-Security-Policy). Above all stand whose test it is, how it went in a line, the table of
forces and the force-velocity picture; what is about one log is folded.
"""

from __future__ import annotations

import base64
import json
from dataclasses import dataclass, field, replace
from functools import cache
from importlib import resources
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

from damperfit import __version__
from damperfit.errors import InstallationError
from damperfit.problem import Problem, listing, short_listing
from damperfit.reporting.compared import (
    comparison_sheets,
    difference_plots,
    loop_plots,
    tolerance_outcome,
    tolerance_sheet,
)
from damperfit.reporting.figures import plot_in_units, setting_colours
from damperfit.reporting.forces import force_sheets, log_force_sheet, segment_sheet
from damperfit.reporting.laws import rival_sheet, tried_laws_sheet
from damperfit.reporting.markdown import lead, listings
from damperfit.reporting.records import checks_in, findings_in, law_in, listed_in
from damperfit.reporting.run_figures import has_several_speeds
from damperfit.reporting.sheet import (
    Sheet,
    html_table,
    number,
    percent,
    printable,
    rows_in_units,
    sheet_in_units,
)
from damperfit.reporting.tables import (
    cavitation_sheet,
    check_sheet,
    check_summary,
    mse_sheet,
    parameter_line,
    parameter_sheet,
    remarks_on,
)
from damperfit.tested.setting import Setting

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from damperfit.comparison import Point, RunComparison
    from damperfit.reporting.figures import Line, Panel, Plot
    from damperfit.reporting.run_figures import LogView, ReportPlots
    from damperfit.units.shown_units import ShownUnits

    Row = Mapping[str, Any]

_IDENTITY = ("damper", "serial", "date", "operator", "customer", "rig")
_LOOKS = {"excellent": "well", "passed": "well", "poor": "ill", "FAILED": "ill"}
_WORDS = (
    "R_m1: restriction of valve 1, the adjuster, rod side to gas side; acts in both strokes",
    "R_m2: restriction of valve 2 in the piston, full bore to rod side; acts in compression",
    "R_m3: restriction of valve 3, gas side to full bore; acts in rebound",
    "K_e: effective bulk modulus, the stiffness of oil, air in it and tube",
    "f_f: friction of seals and guides",
    "f_0: constant force that the rig adds, as by a tare",
    "MSE: mean square of measured less simulated force, in % of the variance of the measured one",
    "grades: excellent is an MSE below 1 %, good below 5 %, poor above",
    "noise floor: the MSE that the scatter of the force between cycles gives by itself",
    "hysteresis: force on the opening branch (speed rising) less force on the closing branch",
    "ratio: rebound force over compression force, without signs",
    "±: 95 % interval, of noise and of what repeats in the residual",
    "cavitation: a chamber at zero absolute pressure in the simulation",
)


# Templates and plots


def draw(template: str, **parts: object) -> str:
    """Return a template of `report/assets` with these parts in it.

    Parameters
    ----------
    template : str
        File name.
    **parts : object
        By the names that the template has for them; text is escaped, but for what is `Markup`.
    """
    return _environment().get_template(template).render(parts)


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
    made = Environment(
        loader=PackageLoader("damperfit.reporting", "assets"),
        autoescape=True,
        finalize=page_text,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    made.globals["html_table"] = lambda sheet: _verbatim(html_table(sheet, looks=_LOOKS))
    return made


class Figure(NamedTuple):
    """Where a plot stands on the page: its number in the data, and its texts, not yet escaped."""

    place: int
    name: str
    title: str
    caption: str
    is_tall: bool


@dataclass(slots=True)
class PlotData:
    """Arrays of the page, each once, and the plots that point to them."""

    arrays: list[str] = field(default_factory=list)
    places: dict[bytes, int] = field(default_factory=dict)
    plots: list[dict[str, Any]] = field(default_factory=list)

    def add(self, plot: Plot) -> Figure:
        """Keep a plot, and return where it is drawn."""
        self.plots.append(
            {
                "name": plot.name,
                "title": page_text(plot.title),
                "panels": [self._panel(panel) for panel in plot.panels],
                "keyed": bool(plot.key),
            }
        )
        place = len(self.plots) - 1
        return Figure(place, plot.name, plot.title, plot.caption, len(plot.panels) > 1)

    def script(self, colours: Mapping[Setting, str]) -> Markup:
        """Return everything as JSON that cannot end the script element it stands in."""
        document = {
            "arrays": self.arrays,
            "plots": self.plots,
            "colours": {str(setting): colour for setting, colour in colours.items()},
        }
        text = json.dumps(document, ensure_ascii=True, allow_nan=False, separators=(",", ":"))
        return _verbatim(text.replace("<", "\\u003c"))

    def _array(self, values: NDArray[np.float64] | None) -> int | None:
        """Return the place of an array, kept as base64 of 32-bit floats: 7 digits, no loss seen."""
        if values is None:
            return None
        data = np.ascontiguousarray(values, dtype="<f4").tobytes()
        if data not in self.places:
            self.places[data] = len(self.arrays)
            self.arrays.append(base64.b64encode(data).decode("ascii"))
        return self.places[data]

    def _panel(self, panel: Panel) -> dict[str, Any]:
        return {
            "x": [panel.x_label, panel.x_unit],
            "y": [panel.y_label, panel.y_unit],
            "rules": panel.rules,
            "bands": panel.bands,
            "log": panel.is_log,
            "ticks": panel.ticks,
            **({"names": panel.names, "labels": panel.tick_labels} if panel.names else {}),
            "xrange": panel.x_range,
            "yrange": panel.y_range,
            "lines": [self._line(line) for line in panel.lines],
        }

    def _line(self, line: Line) -> dict[str, Any]:
        return {
            "x": self._array(line.x),
            "y": self._array(line.y),
            "label": page_text(line.label),
            "colour": line.colour,
            "setting": None if line.setting is None else Setting.of(line.setting).cell,
            "style": line.style,
            "legend": line.in_legend,
            "up": self._array(None if line.high is None else line.high - line.y),
            "down": self._array(None if line.low is None else line.y - line.low),
            **({"tag": page_text(line.tag)} if line.tag else {}),
        }


def plotly_script() -> Markup:
    """Return plotly.js out of the Python package, which need not be imported for it.

    Raises
    ------
    InstallationError
        plotly is not installed.
    """
    spec = find_spec("plotly")
    for place in spec.submodule_search_locations or () if spec else ():
        path = Path(place) / "package_data" / "plotly.min.js"
        if path.is_file():
            text = path.read_text(encoding="utf-8")
            return _verbatim(text.replace("</script", "<\\/script"))
    raise InstallationError("the report needs plotly; install it with: pip install plotly")


# A run


def html_report(shown: ReportPlots, *, title: str) -> str:
    """Return a run as one self-contained HTML page.

    Parameters
    ----------
    shown : ReportPlots
        What to show.
    title : str
        Heading, as a rule the name of the folder; escaped here.

    Raises
    ------
    InstallationError
        plotly is not installed.
    """
    run, units, data = shown.run, shown.units, PlotData()
    overall = [data.add(plot) for plot in shown.overall]
    logs = list(_log_sections(shown, data))
    checks, known = checks_in(run.record), listings(run)
    procedure = [*known.pop("How it was done"), *_tests(shown)]
    alarms = {name: known.pop(name) for name in ("Not done", "Gates not met")}
    del known["Grades withheld"]  # the verdicts say why
    warnings = known.pop("Warnings")
    identity = run.identity
    return draw(
        "page.html",
        title=title,
        version=__version__,
        style=asset("page.css"),
        colours=shown.colours,
        places=list(dict.fromkeys(section["setting"] for section in logs)),
        identity=[
            (key, identity[key])
            for key in dict.fromkeys((*_IDENTITY, *identity))
            if key in identity
        ],
        lead=lead(run),
        forces=_in_units(force_sheets(rows_in_units(run.rows("adjustment"), units)), units),
        first=overall[0] if overall else None,
        alarms={"These results are incomplete": run.remarks, **alarms},
        checks_title=f"Checks: {check_summary(checks)}",
        failed=[check for check in checks if check.passed is False],
        checks=check_sheet(checks),
        listings=_each_once({"Warnings": warnings, "Verdicts": _verdicts(shown), **known}),
        details_below={
            "Warnings of each log": _log_findings(run.record),
            "How it was done": procedure,
            "What the words mean": _WORDS,
        },
        parameters=parameter_sheet(run.rows("parameters"), run.quantities),
        overall=overall[1:],
        tables=_tables(shown),
        logs=logs,
        data=data.script(shown.colours),
        plotly=plotly_script(),
        script=asset("page.js"),
    )


def _in_units(sheets: Sequence[Sheet], units: ShownUnits) -> list[Sheet]:
    return [sheet_in_units(sheet, units) for sheet in sheets]


def _each_once(known: Mapping[str, Sequence[str]]) -> dict[str, list[str]]:
    """Return the listings without what stands in an earlier one."""
    seen: set[str] = set()
    new = {}
    for title, items in known.items():
        new[title] = [item for item in items if item not in seen]
        seen.update(items)
    return new


def _tests(shown: ReportPlots) -> Iterator[str]:
    """Yield how the rig was declared, what was tested, and what made the results."""
    record, logs = shown.run.record, shown.logs
    configuration = record.get("configuration")
    rig = configuration.get("rig") if isinstance(configuration, dict) else None
    if isinstance(rig, dict):
        turned = [key for key in ("displacement", "force") if rig.get(f"reverse_{key}") is True]
        yield (
            f"Rig: filter in the rig {rig.get('filter', 'unknown')}, x = 0 at "
            f"{rig.get('centre', 'unknown')}, signs reversed: {' and '.join(turned) or 'none'}."
        )
    if logs:
        rates = [log.frequency for log in logs if log.frequency is not None]
        heats = [log.temperature for log in logs if log.temperature is not None]
        parts = [f"{len(logs)} log{'s' if len(logs) > 1 else ''}"]
        parts += [f"{_spread(rates)} Hz"] if rates else []
        parts.append(f"amplitude {_spread([1e3 * log.amplitude for log in logs])} mm")
        parts.append(f"{_spread(heats)} degC" if heats else "temperature not logged")
        yield f"Test: {shown.units.say_lengths(', '.join(parts))}."
    if record.get("version"):
        yield f"Made by damperfit {record['version']}."


def _spread(values: Sequence[float]) -> str:
    low, high = number(min(values), digits=3), number(max(values), digits=3)
    return low if low == high else f"{low} to {high}"


def _verdicts(shown: ReportPlots) -> list[str]:
    """Return how the fits went that are less than good, or need a remark."""
    rows = shown.run.rows("parameters")
    doubtful = [
        f"setting {row['setting']}: {_verdict(row, shown)}"
        for row in rows
        if row["grade"] not in {"excellent", "good"} or remarks_on(row, shown.run.quantities)
    ]
    if rows and not doubtful:
        return ["every fit converged, good or better, without a remark"]
    return short_listing(doubtful)


def _verdict(row: Row, shown: ReportPlots) -> str:
    """Return how the fit of one setting went, in words."""
    words = row["grade"] or "no grade"
    if row["mse_percent"] is not None:
        words += f", MSE {percent(row['mse_percent'])} %"
    remarks = remarks_on(row, shown.run.quantities)
    reason = f"withheld because {row['grade_reason']}" if row.get("grade_reason") else ""
    return "; ".join(part for part in (words, remarks, reason) if part)


def _log_findings(record: Row) -> list[str]:
    """Return the findings that matter; mere notes stand with their log."""
    inputs = [entry for entry in listed_in(record, "inputs") if isinstance(entry, dict)]
    findings = ((str(one.get("log", "log")), seen) for one in inputs for seen in findings_in(one))
    return listing(
        Problem(seen.name, seen.sentence, seen.severity, subject=name)
        for name, seen in findings
        if seen.severity != "note"
    )


def _tables(shown: ReportPlots) -> list[tuple[str, Sheet]]:
    """Return the tables that are folded, by title; those without rows are left out."""
    run, rows, law = shown.run, shown.run.rows("parameters"), law_in(shown.run.record)
    settings = {row["setting"] for row in rows}
    errors = [row for row in run.rows("mse") if row["setting"] in settings]
    known = rows_in_units(run.rows("characteristics"), shown.units)
    peaks = known if has_several_speeds(known) else []
    sheets = (
        ("Peak force against peak speed (PVP)", segment_sheet(peaks, has_setting=True)),
        ("MSE by setting and log", mse_sheet(errors, rows, run.quantities)),
        ("Model structures that were tried", tried_laws_sheet(law)),
        ("Models from the literature on the same logs", rival_sheet(law)),
        ("How near to cavitation", cavitation_sheet(rows)),
    )
    return [(title, sheet_in_units(sheet, shown.units)) for title, sheet in sheets if sheet.rows]


def _log_sections(shown: ReportPlots, data: PlotData) -> Iterator[dict[str, Any]]:
    """Yield what `log.html` shows of each log.

    The anchor is where the page can be entered: ``setting-12``, a second log of the setting has
    ``setting-12-log-2``.
    """
    rows = {row["setting"]: row for row in shown.run.rows("parameters")}
    seen: dict[str, int] = {}
    for log, plots in shown.by_log:
        name = str(log.setting.cell) if isinstance(log.setting.cell, int) else log.setting.slug
        seen[name] = seen.get(name, 0) + 1
        row, fastest = rows.get(log.setting), log.fastest
        own = rows_in_units(log.rows, shown.units)
        at_best = [one for one in own if fastest and one["stretch"] == fastest["stretch"]]
        findings = log.findings
        notes = [one.sentence for one in findings if one.severity == "note"]
        forces = [log_force_sheet(at_best)] if at_best else []
        segments = [segment_sheet(own, has_setting=False)] if log.has_segments else []
        yield {
            "setting": log.setting,
            "anchor": f"setting-{name}" + (f"-log-{seen[name]}" if seen[name] > 1 else ""),
            "log": log.signals.log,
            "verdict": _verdict(row, shown) if row else "",
            "parameters": parameter_line(row, shown.run.quantities) if row else "",
            "facts": _log_facts(log, shown.units),
            "findings": [f"{f.severity}: {f.sentence}" for f in findings if f.severity != "note"],
            "details": {
                "Notes on the log": notes,
                "How the log was read": [one for one in log.notes if one not in notes],
            },
            "figures": [data.add(plot) for plot in plots],
            "forces": _in_units(forces, shown.units),
            "segments": _in_units(segments, shown.units),
        }


def _log_facts(log: LogView, units: ShownUnits) -> str:
    frequency = "frequency unknown" if log.frequency is None else f"{log.frequency:.3g} Hz"
    if log.has_segments:
        fastest = max(row["speed_rebound_m_per_s"] or 0.0 for row in log.peaks)
        n = len(log.peaks)
        frequency = f"{n} segment{'s' * (n > 1)}, to {units.write(fastest, 'm/s', '.3g')}"
    amplitude = units.say_lengths(f"amplitude {1e3 * log.amplitude:.3g} mm")
    heat = log.temperature
    temperature = "temperature not logged" if heat is None else f"{heat:.1f} degC"
    return f"{frequency}, {amplitude}, {temperature}, {len(log.signals.time)} samples evaluated."


# Runs beside one another


def comparison_page(
    comparisons: Sequence[RunComparison],
    points: Sequence[Point] = (),
    *,
    source: str = "",
    alone: Sequence[str] = (),
) -> str:
    """Return comparisons, and forces held against bands, as one self-contained HTML page.

    Parameters
    ----------
    comparisons : sequence of RunComparison
        One a pair.
    points : sequence of Point
        Forces held against bands.
    source : str
        The bands, as they were given.
    alone : sequence of str
        What has no partner.

    Raises
    ------
    InstallationError
        plotly is not installed.
    """
    data = PlotData()
    groups: dict[str, list[RunComparison]] = {}
    for one in comparisons:
        groups.setdefault(one.first.shown_as, []).append(one)
    colours = setting_colours(sorted({s for one in comparisons for s in one.settings}))
    overall: list[Figure] = []
    sections: list[dict[str, Any]] = []
    for k, group in enumerate(groups.values()):
        more = f"_{k + 1}" if len(groups) > 1 else ""
        whose = f" ({group[0].first.name})" if len(groups) > 1 else ""
        overall += [
            data.add(replace(plot, name=plot.name + more, title=plot.title + whose))
            for plot in difference_plots(group)
        ]
        runs = [group[0].first, *(one.second for one in group)]
        for setting in sorted({setting for one in group for setting in one.settings}):
            having = [run for run in runs if setting in {test.setting for test in run.tests}]
            plots = loop_plots(having, setting, name=f"setting_{setting.slug}{more}")
            figures = tuple(data.add(plot_in_units(plot, group[0].units)) for plot in plots)
            sections.append(
                {"setting": setting, "title": f"Setting {setting}{whose}", "figures": figures}
            )
    titles = [f"{one.second.name} beside {one.first.name}" for one in comparisons]
    return draw(
        "comparison.html",
        title=" | ".join(titles[:3]) or "tolerance",
        version=__version__,
        style=asset("page.css"),
        colours=colours,
        pairs=list(zip(titles, comparisons, map(comparison_sheets, comparisons), strict=True)),
        tolerance=(tolerance_outcome(points), tolerance_sheet(points)) if points else None,
        source=source,
        alone=list(alone),
        overall=overall,
        sections=sections,
        data=data.script(colours),
        plotly=plotly_script(),
        script=asset("page.js"),
    )
