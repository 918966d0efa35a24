"""The sections of a report of a run, sentences and tables, for report.md and for the page.

A sentence is shown once, in the first section that has it. Text of logs is escaped where the
sections are written.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from statistics import median
from typing import TYPE_CHECKING, Any, NamedTuple

from damperfit.adjustment.trends import in_few_words
from damperfit.errors import ConfigurationError
from damperfit.identification.outcome import Outcome
from damperfit.identification.sharing import of_runs
from damperfit.problem import counted, failure_lines, findings_in, listing, short_listing
from damperfit.reporting import records, tables
from damperfit.reporting.sheet import (
    Sheet,
    escape,
    markdown_table,
    percent,
    rows_in_units,
    sheet_in_units,
)
from damperfit.tested.identity import identity_sentence
from damperfit.units.shown_units import SI, ShownUnits

if TYPE_CHECKING:
    from damperfit.results import Run
    from damperfit.settings_and_logs import Tested


class Section(NamedTuple):
    """A part of a report: sentences, and tables below them.

    ``place`` is where the page has it: "alarm", "top", "checks", "words", "parameters", or, folded,
    "tables" and "folded".
    """

    title: str
    place: str
    sentences: Sequence[str] = ()
    sheets: Sequence[Sheet] = ()


def lead(run: Run) -> str:
    """Return the result of a run in a line."""
    rows = [row for row in run.rows("parameters") if row["mse_percent"] is not None]
    if not rows:
        return "No setting could be fitted."
    errors = {row["setting"]: row["mse_percent"] for row in rows}
    worst = max(errors, key=errors.__getitem__)
    checks = records.checks_in(run.record)
    checked = f"; {tables.check_summary(checks)}" if checks else ""
    return (
        f"{counted(len(errors), 'setting')} fitted, {tables.grade_counts(rows)}; "
        f"MSE median {percent(median(errors.values()))} %, worst {percent(errors[worst])} % at "
        f"setting {worst}{checked}."
    )


def report_sections(run: Run, units: ShownUnits = SI) -> list[Section]:
    """Return the parts of a report in their order; those without content are left out."""
    written: set[str] = set()
    sections = []
    for title, place, sentences, sheets in _sections(run, units):
        fresh = [sentence for sentence in dict.fromkeys(sentences) if sentence not in written]
        written.update(fresh)
        filled = [sheet for sheet in sheets if sheet.rows]
        if fresh or filled:
            sections.append(Section(title, place, fresh, filled))
    return sections


def _of_results(run: Run) -> Iterator[Section]:
    for title, is_note in (("These results are incomplete", False), ("Which test this is", True)):
        problems = [str(p) for p in run.remarks if (p.severity == "note") is is_note]
        yield Section(title, "alarm", problems)


def _sections(run: Run, units: ShownUnits) -> Iterator[Section]:
    record, parameters = run.record, run.rows("parameters")
    checks, law, gaps = records.checks_in(record), records.law_in(record), records.gaps_in(record)
    forces = rows_in_units(run.rows("adjustment"), units)
    segments = rows_in_units(run.rows("characteristics"), units)
    outcomes = {row.get("outcome") for row in parameters} - {Outcome.CONVERGED.value}
    advice = (f"{o.value}: {o.advice}" for o in Outcome if o.value in outcomes)
    errors = {
        (str(row.get("setting")), row["log"], records.number_in(row, "start_s")): row
        for row in records.entries_in(record, "stretches")
        if isinstance(row.get("log"), str)
    }

    def table(title: str, place: str, *sheets: Sheet, scaled: bool = False) -> Section:
        in_units = [sheet_in_units(sheet, units) if scaled else sheet for sheet in sheets]
        return Section(title, place, sheets=in_units)

    def words(title: str, subject: str) -> Section:
        return Section(title, "words", records.sentences_in(record, subject))

    missing = [f"no result for {of_runs(gaps)}"] if gaps else []
    yield Section("Not done", "alarm", [*failure_lines(records.failures_in(record)), *missing])
    yield from _of_results(run)
    yield Section("Gates not met", "alarm", [*map(str, records.listed_in(record, "gates_missed"))])
    yield table("Force by setting", "top", *tables.force_sheets(forces), scaled=True)
    yield Section("Model structure that the logs support", "words", tables.law_sentences(law))
    yield Section(
        "What these logs leave open", "words", [*map(str, records.listed_in(law, "undecided"))]
    )
    fitted = tables.parameter_sheet(parameters, run.quantities, units=units)
    yield table("Parameters", "parameters", fitted)
    errors_by_log = tables.mse_sheet(run.rows("mse"), parameters, run.quantities)
    yield table("MSE by setting and log", "tables", errors_by_log)
    summary = [tables.check_summary(checks)] if checks else []
    yield Section("Checks", "checks", summary, [tables.check_sheet(checks)])
    yield Section("Warnings", "words", listing(records.problems_in(record)))
    yield Section("What to do", "words", sorted(advice))
    yield Section("Verdicts", "words", verdicts(run))
    held_out = tables.held_out_sheet(records.entries_in(record, "held_out"))
    yield table("Held out: predicted, not fitted", "words", held_out)
    trends = in_few_words(trend for trend in records.trends_in(record) if trend.sentence)
    offset = records.sentences_in(record, "force_offset")
    yield Section("Across the settings", "words", [*trends, *offset])
    yield words("Noise and lack of fit", "noise_and_lack_of_fit")
    yield words("Identifiability", "identifiability")
    yield words("Many starts", "many_starts")
    yield words("Cavitation", "cavitation")
    findings = (  # notes are shown with their log
        replace(finding, subject=str(log.get("log", "log")))
        for log in records.entries_in(record, "inputs")
        for finding in findings_in(log)
        if finding.severity != "note"
    )
    yield Section("Warnings of each log", "folded", listing(findings))
    peaks = tables.segment_sheet(segments, has_setting=True, errors=errors)
    yield table("Peak force against peak speed (PVP)", "tables", peaks, scaled=True)
    measured = tables.measured_force_sheet(forces)
    yield table("Measured beside the model", "tables", measured, scaled=True)
    if run.declared_damper is not None:  # the paper's would be assumed, and remarked on
        with suppress(ConfigurationError):  # a model without such valves
            valves = run.valves()
            title = "Valves as parts, at a discharge coefficient of 0.7"
            yield Section(title, "tables", valves.remarks, valves.sheets())
    yield table("Model structures that were tried", "tables", tables.tried_laws_sheet(law))
    yield table("Models of the literature", "tables", tables.rival_sheet(law))
    yield table("How near to cavitation", "tables", tables.cavitation_sheet(parameters))
    yield Section("How it was done", "folded", list(_procedure(run, units)))


def withheld(run: Run) -> list[str]:
    """Return which grades are withheld, and why."""
    return [
        f"setting {row['setting']}: {row['grade_reason']}"
        for row in run.rows("parameters")
        if row.get("grade_reason")
    ]


def verdicts(run: Run) -> list[str]:
    """Return verdicts on fits that are less than good, without what checks and tables mark."""
    marked = {None, "converged", "at_bound", "not_identifiable"}
    return short_listing(
        f"setting {row['setting']}: {verdict(row, run)}"
        for row in run.rows("parameters")
        if row["grade"] not in {"excellent", "good"} or row.get("outcome") not in marked
    )


def verdict(row: Any, run: Run) -> str:
    """Return the verdict on the fit of one setting, in words."""
    words = row["grade"] or "no grade"
    if row["mse_percent"] is not None:
        words += f", MSE {percent(row['mse_percent'])} %"
    remarks = tables.remarks_on(row, run.quantities)
    reason = f"withheld because {row['grade_reason']}" if row.get("grade_reason") else ""
    return "; ".join(text for text in (words, remarks, reason) if text)


def _procedure(run: Run, units: ShownUnits) -> Iterator[str]:
    """Yield how it was done, how the rig was declared, what was tested, what made the results."""
    yield from map(str, records.listed_in(run.record, "procedure"))
    rig = records.inside(run.record, "configuration", "rig")
    if isinstance(rig, dict):
        turned = [key for key in ("displacement", "force") if rig.get(f"reverse_{key}") is True]
        yield (
            f"Rig: filter in the rig {rig.get('filter', 'unknown')}, x = 0 at "
            f"{rig.get('centre', 'unknown')}, signs reversed: {' and '.join(turned) or 'none'}."
        )
    if run.tested.n_logs:
        yield f"Test: {tested_range(run.tested, units)}."
    if run.record.get("version"):
        yield f"Made by damperfit {run.record['version']}."


def tested_range(tested: Tested, units: ShownUnits) -> str:
    """Return the range of the tests in words, as far as it is known."""
    items = [counted(tested.n_logs, "log")] if tested.n_logs else []
    if tested.stroke is not None:
        items.append(f"amplitude to {units.write_length(tested.stroke, '.4g')}")
    if tested.speed is not None:
        items.append(f"speed to {tested.speed:.4g} m/s")
    for limits, unit in ((tested.frequencies, "Hz"), (tested.temperatures, "degC")):
        if limits is not None:
            items.append(f"{' to '.join(dict.fromkeys(f'{limit:.4g}' for limit in limits))} {unit}")
    if tested.temperatures is None:
        items.append("temperature not logged")
    return ", ".join(items)


# As Markdown


def markdown_report(run: Run) -> str:
    """Return the MSE report of a run: forces first, parameters second, then what to believe."""
    identity = identity_sentence(run.identity)
    lines = [f"Tested: {identity}."] if identity else []
    if run.record.get("ending") == "interrupted":
        lines.append("Interrupted: these are the settings that were finished.")
    lines.append(f"{lead(run)} Excellent is an MSE below 1 %, good below 5 %.")
    return markdown("MSE report", lines, report_sections(run))


def markdown(title: str, paragraphs: Iterable[str], sections: Iterable[Section]) -> str:
    """Return sections below a title as a document of Markdown, everything escaped."""
    lines = [f"# {title}"]
    for paragraph in paragraphs:
        lines += ["", escape(paragraph)]
    for section in sections:
        level = "###" if section.place == "below" else "##"
        lines += ["", f"{level} {escape(section.title)}"]
        if section.sentences:
            lines += ["", *(f"- {escape(sentence)}" for sentence in section.sentences)]
        for sheet in section.sheets:
            lines += ["", *markdown_table(sheet)]
    return "\n".join(lines) + "\n"
