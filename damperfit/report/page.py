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
from statistics import median
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

from damperfit import __version__
from damperfit.adjustment.trends import in_few_words
from damperfit.errors import InstallationError
from damperfit.identification.sharing import of_runs
from damperfit.report.compared import comparison_sheets, tolerance_outcome, tolerance_sheet
from damperfit.report.compared_figures import difference_plots, loop_plots
from damperfit.report.facts import failure_lines, grouped, short_listing
from damperfit.report.figures import setting_colours
from damperfit.report.forces import force_sheets, log_force_sheet, segment_sheet
from damperfit.report.laws import law_sentences, rival_sheet, tried_laws_sheet
from damperfit.report.logs import has_several_speeds
from damperfit.report.records import (
    checks_in,
    failures_in,
    findings_in,
    gaps_in,
    held_out_in,
    law_in,
    listed_in,
    sentences_in,
    trends_in,
)
from damperfit.report.rounding import number, percent
from damperfit.report.sheet import Sheet, html_table, printable
from damperfit.report.tables import (
    cavitation_sheet,
    check_sheet,
    check_summary,
    grade_counts,
    mse_sheet,
    parameter_line,
    parameter_sheet,
    remarks_on,
)
from damperfit.report.units import plot_in_units, rows_in_units, sheet_in_units
from damperfit.tested.setting import Setting

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from damperfit.comparison import Point, RunComparison
    from damperfit.report.figures import Line, Panel, Plot
    from damperfit.report.logs import LogView
    from damperfit.report.settings_figures import ReportPlots
    from damperfit.units.shown_units import ShownUnits

    Row = Mapping[str, Any]

__all__ = [
    "Figure",
    "PlotData",
    "asset",
    "comparison_page",
    "draw",
    "html_report",
    "page_text",
    "plotly_script",
]

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
    place = resources.files("damperfit.report") / "assets" / name
    return _verbatim(place.read_text(encoding="utf-8"))


def _verbatim(text: str) -> Markup:
    return Markup(text)  # noqa: S704 - for what is escaped or ours


@cache
def _environment() -> Environment:
    made = Environment(
        loader=PackageLoader("damperfit.report", "assets"),
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


class Listing(NamedTuple):
    """A titled list of sentences; not shown when it is empty."""

    title: str
    items: Sequence[object]


class LogSection(NamedTuple):
    """One log on the page; its template is `log.html`.

    The anchor is where the page can be entered: ``setting-12``, a second log of the setting has
    ``setting-12-log-2``.
    """

    setting: Setting
    anchor: str
    log: str
    verdict: str
    parameters: str
    facts: str
    findings: tuple[str, ...]
    details: tuple[Listing, ...]
    figures: tuple[Figure, ...]
    forces: Sheet | None
    segments: Sheet | None


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
    run, data = shown.run, PlotData()
    record = run.record
    overall = [data.add(plot) for plot in shown.overall]
    logs = list(_log_sections(shown, data))
    checks = checks_in(record)
    forces = rows_in_units(run.rows("adjustment"), shown.units)
    return draw(
        "page.html",
        title=title,
        version=__version__,
        style=asset("page.css"),
        colours=shown.colours,
        places=list(dict.fromkeys(section.setting for section in logs)),
        entries={section.setting: section.anchor for section in reversed(logs)},
        identity=_identity(record),
        lead=_lead(shown),
        forces=[sheet_in_units(sheet, shown.units) for sheet in force_sheets(forces)],
        first=overall[0] if overall else None,
        facts=_facts(shown),
        alarms=(
            Listing("These results are incomplete", run.remarks),
            Listing("Not done", list(_not_done(record))),
            Listing("Gates not met", listed_in(record, "gates_missed")),
        ),
        checks_title=f"Checks: {check_summary(checks)}",
        failed=[check for check in checks if check.passed is False],
        checks=check_sheet(checks),
        listings=tuple(_listings(shown)),
        details_below=(
            Listing("Warnings of each log", _log_findings(record)),
            Listing("How it was done", listed_in(record, "procedure")),
            Listing("What the words mean", _WORDS),
        ),
        parameters=parameter_sheet(run.rows("parameters"), run.quantities),
        overall=overall[1:],
        tables=_tables(shown),
        logs=logs,
        data=data.script(shown.colours),
        plotly=plotly_script(),
        script=asset("page.js"),
    )


def _identity(record: Row) -> tuple[tuple[str, str], ...]:
    """Return whose test it is, as far as the run tells: damper, serial, date, operator first."""
    test = record.get("test")
    known = {str(k): str(value) for k, value in (test if isinstance(test, dict) else {}).items()}
    order = [*(key for key in _IDENTITY if key in known), *known]
    return tuple((key, known[key]) for key in dict.fromkeys(order) if known[key])


def _lead(shown: ReportPlots) -> str:
    """Return how it went, in a line."""
    rows = [row for row in shown.run.rows("parameters") if row["mse_percent"] is not None]
    if not rows:
        return "The tables hold no MSE."
    known = {row["setting"]: row["mse_percent"] for row in rows}
    worst = max(known, key=known.__getitem__)
    checks = checks_in(shown.run.record)
    failed = f"; {check_summary(checks)}" if checks else ""
    return (
        f"{len(known)} setting{'s' * (len(known) > 1)} fitted, {grade_counts(rows)}; MSE median "
        f"{percent(median(known.values()))} %, worst {percent(known[worst])} % at setting "
        f"{worst}{failed}."
    )


def _facts(shown: ReportPlots) -> Sheet | None:
    """Return damper, rig, test and procedure as a small table."""
    record = shown.run.record
    procedure = [str(line) for line in listed_in(record, "procedure")]

    def told(word: str) -> str:
        line = next((one for one in procedure if one.startswith(f"{word}: ")), "")
        return line.removeprefix(f"{word}: ").rstrip(".")

    rows = (
        ("damper", told("Damper")),
        ("rig", _rig(record)),
        ("test", shown.units.say_lengths(_test(shown.logs))),
        ("procedure", told("Procedure")),
        ("made by", f"damperfit {record.get('version')}" if record.get("version") else ""),
    )
    known = tuple(row for row in rows if row[1])
    return Sheet(("", ""), ("", ""), known, (False, False)) if known else None


def _rig(record: Row) -> str:
    configuration = record.get("configuration")
    rig = configuration.get("rig") if isinstance(configuration, dict) else None
    if not isinstance(rig, dict):
        return ""
    turned = [key for key in ("displacement", "force") if rig.get(f"reverse_{key}") is True]
    return (
        f"filter in the rig {rig.get('filter', 'unknown')}, x = 0 at "
        f"{rig.get('centre', 'unknown')}, signs reversed: {' and '.join(turned) or 'none'}"
    )


def _test(logs: Sequence[LogView]) -> str:
    def spread(values: Sequence[float]) -> str:
        low, high = number(min(values), digits=3), number(max(values), digits=3)
        return low if low == high else f"{low} to {high}"

    if not logs:
        return ""
    rates = [log.frequency for log in logs if log.frequency == log.frequency]
    warmth = [log.temperature for log in logs if log.temperature is not None]
    parts = [f"{len(logs)} log{'s' if len(logs) > 1 else ''}"]
    parts += [f"{spread(rates)} Hz"] if rates else []
    parts.append(f"amplitude {spread([1e3 * log.amplitude for log in logs])} mm")
    parts.append(f"{spread(warmth)} degC" if warmth else "temperature not logged")
    return ", ".join(parts)


def _not_done(record: Row) -> Iterator[str]:
    yield from failure_lines(failures_in(record))
    if gaps := gaps_in(record):
        yield f"no result for {of_runs(gaps)}"


def _listings(shown: ReportPlots) -> Iterator[Listing]:
    """Yield what to know before believing the numbers; a sentence stands once."""
    record = shown.run.record
    rows = shown.run.rows("parameters")
    doubtful = [
        f"setting {row['setting']}: {_verdict(row, shown)}"
        for row in rows
        if row["grade"] not in {"excellent", "good"} or remarks_on(row, shown.run.quantities)
    ]
    if rows and not doubtful:
        doubtful = ["every fit converged, good or better, without a remark"]
    trends = in_few_words(trend.sentence for trend in trends_in(record) if trend.sentence)
    listings = (
        Listing("Warnings", short_listing(listed_in(record, "warnings"))),
        Listing("Verdicts", short_listing(doubtful)),
        Listing("Model structure that the logs support", law_sentences(law_in(record))),
        Listing("Held out: predicted, not fitted", held_out_in(record)),
        Listing("Across the settings", [*trends, *sentences_in(record, "force_offset")]),
        Listing("Noise and lack of fit", sentences_in(record, "noise_and_lack_of_fit")),
        Listing("Identifiability", sentences_in(record, "identifiability")),
        Listing("Many starts", sentences_in(record, "many_starts")),
        Listing("Cavitation", sentences_in(record, "cavitation")),
    )
    seen: set[str] = set()
    for one in listings:
        new = [item for item in map(str, one.items) if item not in seen]
        seen.update(new)
        yield Listing(one.title, new)


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
    names = [str(entry.get("log", "log")) for entry in inputs]
    return list(
        grouped(
            (finding.name, name, f"{name}: {finding.sentence}")
            for name, entry in zip(names, inputs, strict=True)
            for finding in findings_in(entry)
            if finding.severity != "note"
        )
    )


def _tables(shown: ReportPlots) -> list[tuple[str, Sheet]]:
    """Return the tables that are folded, by title; those without rows are left out."""
    run, units = shown.run, shown.units
    rows = run.rows("parameters")
    settings = {row["setting"] for row in rows}
    errors = [row for row in run.rows("mse") if row["setting"] in settings]
    law = law_in(run.record)
    characteristics = rows_in_units(run.rows("characteristics"), units)
    several = has_several_speeds(characteristics)
    peaks = [row for row in characteristics if several]
    sheets = (
        ("Peak force against peak speed (PVP)", segment_sheet(peaks, has_setting=True)),
        ("MSE by setting and log", mse_sheet(errors, rows, run.quantities)),
        ("Model structures that were tried", tried_laws_sheet(law)),
        ("Models from the literature on the same logs", rival_sheet(law)),
        ("How near to cavitation", cavitation_sheet(rows)),
    )
    return [(title, sheet_in_units(sheet, units)) for title, sheet in sheets if sheet.rows]


def _log_sections(shown: ReportPlots, data: PlotData) -> Iterator[LogSection]:
    rows = {row["setting"]: row for row in shown.run.rows("parameters")}
    seen: dict[str, int] = {}
    for log, plots in shown.by_log:
        name = str(log.setting.cell) if isinstance(log.setting.cell, int) else log.setting.slug
        seen[name] = seen.get(name, 0) + 1
        row = rows.get(log.setting)
        own = rows_in_units(log.rows, shown.units)
        fastest = log.fastest and [one for one in own if one["stretch"] == log.fastest["stretch"]]
        findings = log.findings
        notes = [one.sentence for one in findings if one.severity == "note"]
        yield LogSection(
            setting=log.setting,
            anchor=f"setting-{name}" + (f"-log-{seen[name]}" if seen[name] > 1 else ""),
            log=log.signals.log,
            verdict=_verdict(row, shown) if row else "",
            parameters=parameter_line(row, shown.run.quantities) if row else "",
            facts=_log_facts(log, shown.units),
            findings=tuple(f"{f.severity}: {f.sentence}" for f in findings if f.severity != "note"),
            details=(
                Listing("Notes on the log", notes),
                Listing("How the log was read", [one for one in log.notes if one not in notes]),
            ),
            figures=tuple(data.add(plot) for plot in plots),
            forces=sheet_in_units(log_force_sheet(fastest), shown.units) if fastest else None,
            segments=sheet_in_units(segment_sheet(own, has_setting=False), shown.units)
            if log.has_segments
            else None,
        )


def _log_facts(log: LogView, units: ShownUnits) -> str:
    frequency = f"{log.frequency:.3g} Hz" if log.frequency == log.frequency else "frequency unknown"
    if log.has_segments:
        fastest = max(row["speed_rebound_m_per_s"] or 0.0 for row in log.peaks)
        n = len(log.peaks)
        frequency = f"{n} segment{'s' * (n > 1)}, to {units.write(fastest, 'm/s', '.3g')}"
    amplitude = units.say_lengths(f"amplitude {1e3 * log.amplitude:.3g} mm")
    warmth = log.temperature
    temperature = "temperature not logged" if warmth is None else f"{warmth:.1f} degC"
    return f"{frequency}, {amplitude}, {temperature}, {len(log.signals.time)} samples evaluated."


# Runs beside one another


class _Section(NamedTuple):
    """One setting of the runs that have one reference."""

    setting: Setting
    title: str
    figures: tuple[Figure, ...]


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
        groups.setdefault(one.first.place, []).append(one)
    colours = setting_colours(sorted({s for one in comparisons for s in one.settings}))
    overall: list[Figure] = []
    sections: list[_Section] = []
    for k, group in enumerate(groups.values()):
        more = f"_{k + 1}" if len(groups) > 1 else ""
        whose = f" ({group[0].first.name})" if len(groups) > 1 else ""
        overall += [
            data.add(replace(plot, name=plot.name + more, title=plot.title + whose))
            for plot in difference_plots(group)
        ]
        runs = [group[0].first, *(one.second for one in group)]
        for setting in sorted({setting for one in group for setting in one.settings}):
            having = [run for run in runs if setting in run.settings]
            plots = loop_plots(having, setting, name=f"setting_{setting.slug}{more}")
            figures = tuple(data.add(plot_in_units(plot, group[0].units)) for plot in plots)
            sections.append(_Section(setting, f"Setting {setting}{whose}", figures))
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
