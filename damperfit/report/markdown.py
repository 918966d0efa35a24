"""The MSE report, report.md, as Markdown; everything that came from a log is escaped."""

from __future__ import annotations

import re
from statistics import median
from typing import TYPE_CHECKING, Any

from damperfit.identification.sharing import of_runs
from damperfit.report.facts import failure_lines, short_listing
from damperfit.report.forces import (
    force_by_setting_sheet,
    measured_force_sheet,
    measured_stretch_sheet,
)
from damperfit.report.laws import law_sentences, rival_sheet, tried_laws_sheet
from damperfit.report.rounding import percent
from damperfit.report.sheet import printable
from damperfit.report.tables import (
    check_sheet,
    check_summary,
    grade_counts,
    held_out_sheet,
    mse_sheet,
    parameter_sheet,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from damperfit.report.facts import ReportFacts
    from damperfit.report.sheet import Sheet
    from damperfit.tables import Tables

__all__ = ["escape", "markdown_report", "markdown_table"]

# Everything Markdown or the HTML inside it could read as markup, and no more: the report is read as
# it stands too. An underscore between letters is none; signs and numbers are lists at a start only.
_SPECIAL = re.compile(r"([\\`*\[\]<>#|~&$@]|(?<![^\W_])_|_(?![^\W_]))")
_LIST = re.compile(r"^(\d*)([-+.)])(?=\s|$|\2)")
# Nearly all cells of a table: words and numbers in which there is nothing to look for.
_PLAIN = re.compile(r"[0-9A-Za-z]+(?:\.[0-9A-Za-z]+)*")


def escape(text: str) -> str:
    r"""Return text that Markdown shows as it is, on one line, control characters as escapes.

    Examples
    --------
    >>> print(escape("<b>|run_1 _2_\x1b[0m (+1 %)"))
    \<b\>\|run_1 \_2\_\\x1b\[0m (+1 %)
    """
    if _PLAIN.fullmatch(text):
        return text
    shown = printable(" ".join(text.split()))
    return _LIST.sub(r"\1\\\2", _SPECIAL.sub(r"\\\1", shown))


def markdown_report(tables: Tables, facts: ReportFacts) -> str:
    """Return the MSE report of a run.

    Parameters
    ----------
    tables : Tables
        Parameters and MSE.
    facts : ReportFacts
        Failures, warnings, procedure and the rest.
    """
    parameters = tables.parameters.to_pylist()
    errors = mse_sheet(tables.mse.to_pylist(), parameters, tables.quantities)
    parts: list[Iterable[str]] = [
        ["# MSE report", "", *_summary(parameters, facts)],
        _section("Parameters", markdown_table(parameter_sheet(parameters, tables.quantities))),
        _section("MSE by setting and log", markdown_table(errors)),
        _section("Which law the logs support", _law(facts)),
        _section("Models of the literature", markdown_table(rival_sheet(facts.law_choice))),
        _section(
            "Characteristics as measured", markdown_table(measured_stretch_sheet(facts.stretches))
        ),
        _section("Held out: predicted, not fitted", markdown_table(held_out_sheet(facts.held_out))),
        _section("Grades withheld", _list(facts.withheld)),
        _section("Not done", _list(_missing(facts))),
        _section("Gates not met", _list(facts.gates)),
        _section("What to do", _list(f"{word}: {advice}" for word, advice in facts.advice)),
        _section("Checks", _checks(facts)),
        _section("Across the settings", (*_list(facts.across), *_clicks(tables))),
        _section("Warnings", _list(short_listing(facts.warnings))),
        _section("Noise and lack of fit", _list(facts.trust)),
        _section("Identifiability", _list(facts.identifiability)),
        _section("Many starts", _list(facts.searches)),
        _section("Cavitation", _list(facts.cavitation)),
        _section("How it was done", _list((*facts.procedure, f"damperfit {facts.version}"))),
    ]
    return "\n".join(line for part in parts for line in part) + "\n"


def _summary(parameters: Sequence[Mapping[str, Any]], facts: ReportFacts) -> Iterator[str]:
    rows = [row for row in parameters if row["mse_percent"] is not None]
    if facts.tested:
        yield f"Tested: {escape(facts.tested)}."
        yield ""
    if facts.is_interrupted:
        yield "**Interrupted: these are the settings that were finished.**"
        yield ""
    if not rows:
        yield "No setting could be fitted."
        return
    values = {row["setting"]: row["mse_percent"] for row in rows}
    worst = max(values, key=lambda setting: values[setting])
    count = f"{len(rows)} setting{'s' if len(rows) > 1 else ''} fitted"
    yield (
        f"{count}: MSE median {percent(median(values.values()))} %, "
        f"worst {percent(values[worst])} % at setting {worst}."
    )
    yield grade_counts(rows)


def _checks(facts: ReportFacts) -> list[str]:
    if not facts.checks:
        return []
    return [check_summary(facts.checks), "", *markdown_table(check_sheet(facts.checks))]


def _law(facts: ReportFacts) -> list[str]:
    said = _list(law_sentences(facts.law_choice))
    return [*said, "", *markdown_table(tried_laws_sheet(facts.law_choice))] if said else []


def _clicks(tables: Tables) -> list[str]:
    """The force at the fastest named speed by setting, below the sentences."""
    rows = tables.adjustment.to_pylist()
    shown = [
        markdown_table(force_by_setting_sheet(rows)),
        markdown_table(measured_force_sheet(rows)),
    ]
    return [line for table in shown if table for line in ("", *table)]


def _missing(facts: ReportFacts) -> Iterator[str]:
    yield from failure_lines(facts.failures)
    if facts.gaps:
        yield f"no result for {of_runs(facts.gaps)}"


def _section(title: str, lines: Iterable[str]) -> list[str]:
    """Return a titled section, or nothing when it would be empty."""
    body = list(lines)
    return ["", f"## {title}", "", *body] if body else []


def _list(items: Iterable[str]) -> list[str]:
    return [f"- {escape(item)}" for item in items]


def markdown_table(sheet: Sheet) -> list[str]:
    """Return a sheet as the lines of a Markdown table, its notes below; nothing without rows."""
    if not sheet.rows:
        return []
    heads = [
        f"{escape(heading)}{f' {unit}' if unit else ''}"
        for heading, unit in zip(sheet.headings, sheet.units, strict=True)
    ]
    rules = ["---:" if is_number else "---" for is_number in sheet.is_number]
    cells = [[escape(cell) for cell in row] for row in sheet.rows]
    lines = [f"| {' | '.join(row)} |" for row in (heads, rules, *cells)]
    return [*lines, *(line for note in sheet.notes for line in ("", escape(note)))]
