"""A results folder, and comparisons, as one HTML file."""

from __future__ import annotations

import base64
import json
import math
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
from damperfit.adjustment import in_few_words
from damperfit.errors import InstallationError
from damperfit.identification.sharing import of_runs
from damperfit.report.compared import (
    comparison_figure_sheet,
    comparison_force_sheet,
    comparison_parameter_sheet,
    tolerance_outcome,
    tolerance_sheet,
)
from damperfit.report.facts import failure_lines, short_listing, summarised
from damperfit.report.figures import setting_colours
from damperfit.report.forces import (
    ComparedStretch,
    click_sheet,
    compared_stretch_sheet,
    measured_and_simulated_sheet,
    peak_sheet,
)
from damperfit.report.laws import law_sentences, rival_sheet, tried_laws_sheet
from damperfit.report.logs import has_several_speeds, peak_points
from damperfit.report.records import (
    checks_in,
    clicks_in,
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
from damperfit.report.settings_figures import difference_plots, loop_plots
from damperfit.report.sheet import Sheet, printable
from damperfit.report.tables import (
    CHECK_WORDS,
    cavitation_sheet,
    flags,
    grade_counts,
    mse_sheet,
    parameter_line,
    parameter_sheet,
    shared_sentence,
)
from damperfit.report.units import clicks_in_units, log_in_units, plot_in_units, sheet_in_units
from damperfit.tables import PAPER_QUANTITIES
from damperfit.tested.setting import Setting
from damperfit.units.shown_units import SI, ShownUnits

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from damperfit.comparison import Point, RunComparison
    from damperfit.damper.quantity import Quantity
    from damperfit.report.figures import Line, Panel, Plot
    from damperfit.report.forces import PeakPoint
    from damperfit.report.logs import EvaluatedLog
    from damperfit.report.settings_figures import ReportPlots
    from damperfit.results import Run
    from damperfit.units.shown_units import ShownUnits

__all__ = [
    "Figure",
    "Listing",
    "LogSection",
    "PlotData",
    "Summary",
    "asset",
    "comparison_page",
    "draw",
    "html_report",
    "identity_of_test",
    "log_section",
    "page_tables",
    "page_text",
    "plotly_script",
    "setting_verdict",
    "summary",
    "verbatim",
]


# Templates filled in; every text is made printable and escaped here, and nowhere else.


def draw(template: str, **parts: object) -> str:
    """Return a template of `report/assets` with these parts in it.

    Parameters
    ----------
    template : str
        File name.
    **parts : object
        By the names that the template has for them; text is escaped, but for what `verbatim` marks.
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


def verbatim(text: str) -> Markup:
    """Return text that stands on the page as it is: scripts and styles of ours, never of a log."""
    return Markup(text)  # noqa: S704 - for what is escaped or ours


def asset(name: str) -> Markup:
    """Return the page's style or script."""
    place = resources.files("damperfit.report") / "assets" / name
    return verbatim(place.read_text(encoding="utf-8"))


@cache
def _environment() -> Environment:
    return Environment(
        loader=PackageLoader("damperfit.report", "assets"),
        autoescape=True,
        finalize=page_text,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )


# Plots as the page's script reads them: descriptions, and each array once.


@dataclass(frozen=True, slots=True)
class Figure:
    """Where a plot stands on the page.

    Attributes
    ----------
    place : int
        Number of the plot in the data.
    name, title, caption : str
        Of the plot, not yet escaped.
    is_tall : bool
        It has more than one panel.
    """

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
        panels = [self._panel(panel) for panel in plot.panels]
        self.plots.append(
            {
                "name": plot.name,
                "title": page_text(plot.title),
                "panels": panels,
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
        return verbatim(text.replace("<", "\\u003c"))

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
            return verbatim(text.replace("</script", "<\\/script"))
    raise InstallationError("the report needs plotly; install it with: pip install plotly")


# The upper part of the page: what was tested, how it went, what to believe.

_IDENTITY = ("damper", "serial", "date", "operator", "customer", "rig")

_SYMBOLS = (
    "R_m1: restriction of valve 1, the adjuster, rod side to gas side; acts in bump and rebound",
    "R_m2: restriction of valve 2 in the piston, full bore to rod side; acts in bump",
    "R_m3: restriction of valve 3, gas side to full bore; acts in rebound",
    "K_e: effective bulk modulus, the stiffness of oil, air in it and tube",
    "f_f: friction of seals and guides",
    "f_0: constant force that the rig adds, as by a tare",
    "MSE: mean square of measured less simulated force, in % of the variance of the measured one",
    "noise floor: the MSE that the scatter of the force between cycles gives by itself",
    "hysteresis: force on the opening branch (speed rising) less force on the closing branch",
    "ratio: rebound force over bump force, without signs",
    "interval: 95 % confidence, of noise and of what repeats in the residual",
    "cavitation: a chamber at zero absolute pressure in the simulation",
)


class Listing(NamedTuple):
    """A titled list of sentences; not shown when it is empty."""

    title: str
    items: Sequence[object]


@dataclass(frozen=True, slots=True)
class Summary:
    """The upper part of the page; its template is `summary.html`.

    Attributes
    ----------
    lead : str
        The first sentences.
    facts : Sheet or None
        Damper, rig, test and procedure.
    alarms : tuple of Listing
        What is missing or was not met.
    checks_title : str
        How the checks went, in numbers.
    checks : Sheet or None
        The checks, those that failed first.
    listings, details : tuple of Listing
        Shown openly, and on demand.
    """

    lead: str
    facts: Sheet | None
    alarms: tuple[Listing, ...]
    checks_title: str
    checks: Sheet | None
    listings: tuple[Listing, ...]
    details: tuple[Listing, ...]


def summary(run: Run, logs: Sequence[EvaluatedLog], units: ShownUnits = SI) -> Summary:
    """Return headline, alarms, checks, verdicts, trends, warnings and how it was done."""
    record = run.record
    checks_title, checks = _checks(record)
    trends = in_few_words(trend.sentence for trend in trends_in(record) if trend.sentence)
    return Summary(
        lead=" ".join(_headline(run)),
        facts=_facts(run, logs, units),
        alarms=(
            Listing("These results are incomplete", run.remarks),
            Listing("Not done", list(_not_done(record))),
            Listing("Gates not met", listed_in(record, "gates_missed")),
        ),
        checks_title=checks_title,
        checks=checks,
        listings=(
            Listing("Verdicts", short_listing(_verdicts(run))),
            Listing("Which law the logs support", law_sentences(law_in(record))),
            Listing("Held out: predicted, not fitted", held_out_in(record)),
            Listing("Across the settings", trends),
            Listing("Noise and lack of fit", sentences_in(record, "noise_and_lack_of_fit")),
            Listing("Identifiability", sentences_in(record, "identifiability")),
            Listing("Many starts", sentences_in(record, "many_starts")),
            Listing("Cavitation", sentences_in(record, "cavitation")),
            Listing("Warnings", short_listing(listed_in(record, "warnings"))),
        ),
        details=(
            Listing("Warnings of each log", _log_findings(record)),
            Listing("How it was done", [*listed_in(record, "procedure"), *_rig(record)]),
            Listing("What the words mean", _SYMBOLS),
        ),
    )


def _not_done(record: Mapping[str, Any]) -> Iterator[str]:
    yield from failure_lines(failures_in(record))
    if gaps := gaps_in(record):
        yield f"no result for {of_runs(gaps)}"


def _verdicts(run: Run) -> Iterator[str]:
    """Yield the settings that are less than fine, or that none is."""
    doubtful = [row for row in run.rows("parameters") if not _is_fine(row)]
    yield from (f"setting {row['setting']}: {setting_verdict(row)}" for row in doubtful)
    if run.rows("parameters") and not doubtful:
        yield "every fit converged, good or better, without a flag"


def setting_verdict(row: Mapping[str, Any]) -> str:
    """Return how the fit of one setting went, in words."""
    outcome = str(row["outcome"] or "outcome unknown").replace("_", " ")
    words = [f"{row['grade'] or 'no grade'}, MSE {percent(row['mse_percent'])} %"]
    marks = flags(row)
    if outcome != "cavitating" or "cavitates" not in marks:  # the flag says it, with how long
        words.append(outcome)
    if marks:
        words.append(marks)
    if row.get("grade_reason"):
        words.append(f"withheld because {row['grade_reason']}")
    return "; ".join(words)


def _is_fine(row: Mapping[str, Any]) -> bool:
    is_good = row["grade"] in {"excellent", "good"}
    return is_good and row["outcome"] == "converged" and not flags(row)


def _headline(run: Run) -> Iterator[str]:
    known = {
        row["setting"]: row["mse_percent"]
        for row in run.rows("parameters")
        if row["mse_percent"] is not None
    }
    if not known:
        yield "The tables hold no MSE."
        return
    best, worst = min(known, key=known.__getitem__), max(known, key=known.__getitem__)
    yield f"{len(known)} setting{'s' if len(known) > 1 else ''} fitted."
    yield f"MSE: median {percent(median(known.values()))} %,"
    yield f"best {percent(known[best])} % at setting {best},"
    yield f"worst {percent(known[worst])} % at setting {worst}."
    yield grade_counts(run.rows("parameters"))


def identity_of_test(record: Mapping[str, Any]) -> tuple[tuple[str, str], ...]:
    """Return whose test it is, as far as the run tells: damper, serial, date, operator first."""
    test = record.get("test")
    known = {
        str(key): str(value) for key, value in (test if isinstance(test, dict) else {}).items()
    }
    order = [*(key for key in _IDENTITY if key in known), *known]
    return tuple((key, known[key]) for key in dict.fromkeys(order) if known[key])


def _facts(run: Run, logs: Sequence[EvaluatedLog], units: ShownUnits) -> Sheet | None:
    """Return damper, rig, test and procedure as a small table."""
    record = run.record
    procedure = next(
        (str(line) for line in listed_in(record, "procedure") if str(line).startswith("Procedure")),
        "",
    )
    rows = [
        ("damper", _damper(record)),
        ("rig", "; ".join(line.removeprefix("Rig: ").rstrip(".") for line in _rig(record))),
        ("test", units.say_lengths(_test(logs))),
        ("procedure", procedure.removeprefix("Procedure: ").rstrip(".")),
        ("made by", f"damperfit {record.get('version')}" if record.get("version") else ""),
    ]
    known = tuple(row for row in rows if row[1])
    return Sheet(("", ""), ("", ""), known, (False, False)) if known else None


def _damper(record: Mapping[str, Any]) -> str:
    sentence = next(
        (str(x) for x in listed_in(record, "procedure") if str(x).startswith("Damper")), ""
    )
    return sentence.removeprefix("Damper: ").rstrip(".")


def _test(logs: Sequence[EvaluatedLog]) -> str:
    if not logs:
        return ""
    rates = [log.frequency for log in logs if log.frequency == log.frequency]
    strokes = [1e3 * log.amplitude for log in logs]
    warmth = [log.temperature for log in logs if log.temperature is not None]
    parts = [f"{len(logs)} log{'s' if len(logs) > 1 else ''}"]
    if rates:
        parts.append(f"{_range(rates)} Hz")
    parts.append(f"amplitude {_range(strokes)} mm")
    parts.append(f"{_range(warmth)} degC" if warmth else "temperature not logged")
    return ", ".join(parts)


def _range(values: Sequence[float]) -> str:
    low, high = number(min(values), digits=3), number(max(values), digits=3)
    return low if low == high else f"{low} to {high}"


def _rig(record: Mapping[str, Any]) -> Iterator[str]:
    configuration = record.get("configuration")
    rig = configuration.get("rig") if isinstance(configuration, dict) else None
    if isinstance(rig, dict):
        turned = [key for key in ("displacement", "force") if rig.get(f"reverse_{key}") is True]
        yield (
            f"Rig: filter in the rig {rig.get('filter', 'unknown')}, "
            f"x = 0 at {rig.get('centre', 'unknown')}, "
            f"signs reversed: {' and '.join(turned) or 'none'}."
        )


def _checks(record: Mapping[str, Any]) -> tuple[str, Sheet | None]:
    """Return the counts in words, and the checks, those that failed first."""
    checks = checks_in(record)
    if not checks:
        return "", None
    failed = sum(check.passed is False for check in checks)
    passed = sum(check.passed is True for check in checks)
    title = (
        f"Checks: {passed} passed, {failed} failed, {len(checks) - passed - failed} not evaluated"
    )
    order = sorted(checks, key=lambda check: check.passed is not False)
    rows = tuple(
        (check.name.replace("_", " "), CHECK_WORDS[check.passed], check.reason) for check in order
    )
    return title, Sheet(("check", "result", "reason"), ("", "", ""), rows, (False, False, False))


def _log_findings(record: Mapping[str, Any]) -> list[str]:
    """Return the findings that matter; mere notes stand with their log."""
    notable = (
        (str(entry.get("log", "log")), f"{entry.get('log', 'log')}: {finding.sentence}")
        for entry in listed_in(record, "inputs")
        if isinstance(entry, dict)
        for finding in findings_in(entry)
        if finding.severity != "note"
    )
    return list(summarised(notable))


# Which tables stand on the page, and under which title; each is laid out in `report/sheets`.


def page_tables(
    run: Run, points: Sequence[PeakPoint] = (), units: ShownUnits = SI
) -> list[tuple[str, Sheet]]:
    """Return the tables of a results folder by title, those without rows left out.

    Parameters
    ----------
    run : Run
        The folder.
    points : sequence of PeakPoint
        What its logs give to peak force against peak speed, in these units.
    units : ShownUnits
        Of forces and speeds.
    """
    rows = [row | {"outcome": row["outcome"] or "unknown"} for row in run.rows("parameters")]
    settings = {row["setting"] for row in rows}
    errors = [row for row in run.rows("mse") if row["setting"] in settings]
    clicks = clicks_in_units(clicks_in(run.record), units)
    of_offset = sentences_in(run.record, "force_offset")
    sheets = [
        *(
            [("Peak force against peak speed (PVP)", sheet_in_units(peak_sheet(points), units))]
            if has_several_speeds(points)
            else []
        ),
        ("Parameters", parameter_sheet(rows, run.quantities, says_shared_once=True)),
        ("MSE by setting and log", mse_sheet(errors, rows, run.quantities)),
        ("Laws that were tried", tried_laws_sheet(law_in(run.record))),
        ("Models from the literature on the same logs", rival_sheet(law_in(run.record))),
        ("Change of force by click", sheet_in_units(click_sheet(clicks, of_offset), units)),
        ("How near to cavitation", cavitation_sheet(run.rows("parameters"))),
    ]
    return [(title, sheet) for title, sheet in sheets if sheet.rows]


# What the page says of one log: its verdict, its findings, its figures and its forces.


@dataclass(frozen=True, slots=True)
class LogSection:
    """One log on the page; its template is `log.html`.

    Attributes
    ----------
    setting : Setting
        Adjuster setting.
    anchor : str
        Where the page can be entered: ``setting-12``; a second log has ``setting-12-log-2``.
    log : str
        Name of the log.
    verdict : str
        How the fit of the setting went; empty where there is none.
    facts : str
        The test in a sentence.
    findings, notes, reading : tuple of str
        What matters, what is good to know, and how the log was read.
    figures : tuple of Figure
        Where its plots stand.
    forces : Sheet or None
        None when the log has no whole cycle.
    stretches : Sheet or None
        None when the log is one steady run.
    """

    setting: Setting
    anchor: str
    log: str
    verdict: str
    facts: str
    findings: tuple[str, ...]
    notes: tuple[str, ...]
    reading: tuple[str, ...]
    figures: tuple[Figure, ...]
    forces: Sheet | None
    stretches: Sheet | None = None


def log_section(
    log: EvaluatedLog,
    figures: Sequence[Figure],
    row: Mapping[str, Any] | None,
    quantities: Sequence[Quantity] = PAPER_QUANTITIES,
    *,
    anchor: str = "",
    units: ShownUnits = SI,
) -> LogSection:
    """Return the section of a log.

    Parameters
    ----------
    log : EvaluatedLog
        The log.
    figures : sequence of Figure
        Where its plots stand.
    row : mapping or None
        Parameters of its setting, if known.
    quantities : sequence of Quantity
        What the row is of.
    anchor : str
        Where the page can be entered here.
    units : ShownUnits
        Of its tables.
    """
    verdict = ""
    if row:
        verdict = f"Fit of the setting: {setting_verdict(row)}. {parameter_line(row, quantities)}"
    read = log_in_units(log, units)
    return LogSection(
        setting=log.signals.setting,
        anchor=anchor,
        log=log.signals.log,
        verdict=verdict,
        facts=_facts_log_section(log, units),
        findings=tuple(f"{f.severity}: {f.sentence}" for f in log.findings if f.severity != "note"),
        notes=tuple(f.sentence for f in log.findings if f.severity == "note"),
        reading=log.notes,
        figures=tuple(figures),
        forces=_forces(read, units),
        stretches=_stretches(read, units),
    )


def _stretches(log: EvaluatedLog, units: ShownUnits) -> Sheet | None:
    if not log.stretches:
        return None
    sheet = compared_stretch_sheet(
        [
            ComparedStretch(one.start, one.n_cycles, one.frequency, one.measured, one.simulated)
            for one in log.stretches
        ]
    )
    return sheet_in_units(sheet, units)


def _facts_log_section(log: EvaluatedLog, units: ShownUnits) -> str:
    frequency = f"{log.frequency:.3g} Hz" if math.isfinite(log.frequency) else "frequency unknown"
    amplitude = units.say_lengths(f"amplitude {1e3 * log.amplitude:.3g} mm")
    if log.stretches:
        fastest = max(one.measured.peak_speed_rebound for one in log.stretches)
        n = len(log.stretches)
        frequency = f"{n} stretch{'es' * (n > 1)}, to {units.write(fastest, 'm/s', '.3g')}"
    warmth = log.temperature
    temperature = "temperature not logged" if warmth is None else f"{warmth:.1f} degC"
    samples = f"{len(log.signals.time)} samples evaluated"
    return f"{frequency}, {amplitude}, {temperature}, {samples}."


def _forces(log: EvaluatedLog, units: ShownUnits) -> Sheet | None:
    if log.measured is None or log.simulated is None:
        return None
    warmth = log.temperature
    sheet = measured_and_simulated_sheet(log.measured, log.simulated, temperature=warmth)
    return sheet_in_units(sheet, units)


# The report as one HTML file: text and tables by us, plots by plotly.js, everything inlined.
#
# Everything that may have come from a log or a configuration is escaped by the templates, and in
# plot descriptions by `page_text`. The page forbids itself every network request
# (Content-Security-Policy).

_FIRST = "fan"  # force against velocity: what a damper engineer looks for


def html_report(shown: ReportPlots, *, title: str) -> str:
    """Return the report as one self-contained HTML page.

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
    data = PlotData()
    overall = [data.add(plot) for plot in shown.overall]
    rows = {row["setting"]: row for row in shown.run.rows("parameters")}
    anchors = _anchors([log.signals.setting for log, _ in shown.by_log])
    logs = [
        log_section(
            log,
            [data.add(plot) for plot in plots],
            rows.get(log.signals.setting),
            shown.run.quantities,
            anchor=anchor,
            units=shown.units,
        )
        for (log, plots), anchor in zip(shown.by_log, anchors, strict=True)
    ]
    views = [log for log, _ in shown.by_log]
    firsts = [one for one in overall if one.name == _FIRST]
    return draw(
        "page.html",
        title=title,
        version=__version__,
        style=asset("page.css"),
        colours=shown.colours,
        places=list(dict.fromkeys(section.setting for section in logs)),
        entries={section.setting: section.anchor for section in reversed(logs)},
        identity=identity_of_test(shown.run.record),
        summary=summary(shown.run, views, shown.units),
        first=firsts,
        shared=shared_sentence(shown.run.rows("parameters"), shown.run.quantities),
        overall=[one for one in overall if one not in firsts],
        tables=page_tables(
            shown.run,
            peak_points([log_in_units(view, shown.units) for view in views]),
            shown.units,
        ),
        logs=logs,
        data=data.script(shown.colours),
        plotly=plotly_script(),
        script=asset("page.js"),
    )


def _anchors(settings: Sequence[Setting]) -> Iterator[str]:
    """Yield where each log is found: ``setting-12``, a second of the setting ``setting-12-log-2``.

    Settings whose labels differ in signs alone count on likewise.
    """
    seen: dict[str, int] = {}
    for setting in settings:
        name = str(setting.cell) if isinstance(setting.cell, int) else setting.slug
        seen[name] = seen.get(name, 0) + 1
        yield f"setting-{name}" + (f"-log-{seen[name]}" if seen[name] > 1 else "")


# Comparisons as one HTML file: verdicts and tables, and the runs' loops over one another.


@dataclass(frozen=True, slots=True)
class _Pair:
    """What the page tells of one comparison."""

    title: str
    comparison: RunComparison
    tables: tuple[tuple[str, Sheet], ...]


@dataclass(frozen=True, slots=True)
class _Section:
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
    groups = _by_reference(comparisons)
    settings = sorted({setting for one in comparisons for setting in one.settings})
    colours = setting_colours(settings)
    overall: list[Figure] = []
    sections: list[_Section] = []
    for k, group in enumerate(groups):
        more = f"_{k + 1}" if len(groups) > 1 else ""
        whose = f" ({group[0].first.name})" if len(groups) > 1 else ""
        overall += [
            data.add(replace(plot, name=plot.name + more, title=plot.title + whose))
            for plot in difference_plots(group)
        ]
        sections += _sections(group, data, more=more, whose=whose)
    return draw(
        "comparison.html",
        title=" | ".join(_title(one) for one in comparisons[:3]) or "tolerance",
        version=__version__,
        style=asset("page.css"),
        colours=colours,
        pairs=[_pair(one) for one in comparisons],
        tolerance=(tolerance_outcome(points), tolerance_sheet(points)) if points else None,
        source=source,
        alone=list(alone),
        overall=overall,
        sections=sections,
        data=data.script(colours),
        plotly=plotly_script(),
        script=asset("page.js"),
    )


def _sections(
    group: Sequence[RunComparison], data: PlotData, *, more: str, whose: str
) -> Iterator[_Section]:
    """Yield the settings of the runs that have one reference."""
    runs = [group[0].first, *(one.second for one in group)]
    for setting in sorted({setting for one in group for setting in one.settings}):
        having = [run for run in runs if setting in run.settings]
        plots = loop_plots(having, setting, name=f"setting_{setting.slug}{more}")
        units = group[0].units
        figures = tuple(data.add(plot_in_units(plot, units)) for plot in plots)
        yield _Section(setting, f"Setting {setting}{whose}", figures)


def _by_reference(comparisons: Sequence[RunComparison]) -> list[list[RunComparison]]:
    groups: dict[str, list[RunComparison]] = {}
    for one in comparisons:
        groups.setdefault(one.first.place, []).append(one)
    return list(groups.values())


def _title(one: RunComparison) -> str:
    return f"{one.second.name} beside {one.first.name}"


def _pair(one: RunComparison) -> _Pair:
    tables = (
        (one.forces_title[0].upper() + one.forces_title[1:], comparison_force_sheet(one)),
        ("Parameters", comparison_parameter_sheet(one)),
        ("Energy, hysteresis, MSE, cavitation", comparison_figure_sheet(one)),
    )
    return _Pair(_title(one), one, tuple((name, sheet) for name, sheet in tables if sheet.rows))
