"""The MSE report for people, as Markdown; text from logs and configurations is escaped."""

from __future__ import annotations

from statistics import median
from typing import TYPE_CHECKING, Any

from damperfit.identification.sharing import of_runs
from damperfit.report.facts import failure_lines, short_listing
from damperfit.report.forces import (
    force_sheets,
    measured_force_sheet,
    measured_segment_sheet,
)
from damperfit.report.laws import law_sentences, rival_sheet, tried_laws_sheet
from damperfit.report.rounding import percent
from damperfit.report.sheet import escape, markdown_table
from damperfit.report.tables import (
    check_sheet,
    check_summary,
    grade_counts,
    held_out_sheet,
    mse_sheet,
    parameter_sheet,
)
from damperfit.tables.columns import PAPER_QUANTITIES

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    import pyarrow as pa

    from damperfit.damper.quantity import Quantity
    from damperfit.report.facts import ReportFacts

__all__ = ["markdown_report"]


def markdown_report(
    tables: Mapping[str, pa.Table],
    facts: ReportFacts,
    quantities: Sequence[Quantity] = PAPER_QUANTITIES,
) -> str:
    """Return the MSE report of a run: forces first, parameters second, then what to believe.

    Parameters
    ----------
    tables : mapping of str to pyarrow.Table
        Parameters, MSE and forces by setting.
    facts : ReportFacts
        Failures, warnings, procedure and the rest.
    quantities : sequence of Quantity
        Of the model.
    """
    parameters = tables["parameters"].to_pylist()
    errors = mse_sheet(tables["mse"].to_pylist(), parameters, quantities)
    forces = tables["adjustment"].to_pylist()
    missing = [*failure_lines(facts.failures)]
    missing += [f"no result for {of_runs(facts.gaps)}"] if facts.gaps else []
    law = _list(law_sentences(facts.law_choice))
    sections: tuple[tuple[str, Iterable[str]], ...] = (
        ("Not done", _list(missing)),
        ("Gates not met", _list(facts.gates)),
        ("Force by setting", _one_below_another(map(markdown_table, force_sheets(forces)))),
        ("Parameters", markdown_table(parameter_sheet(parameters, quantities))),
        ("MSE by setting and log", markdown_table(errors)),
        ("Checks", _checks(facts)),
        ("What to do", _list(f"{word}: {advice}" for word, advice in facts.advice)),
        ("Grades withheld", _list(facts.withheld)),
        ("Warnings", _list(short_listing(facts.warnings))),
        (
            "Model structure that the logs support",
            [*law, "", *markdown_table(tried_laws_sheet(facts.law_choice))] if law else [],
        ),
        ("Models of the literature", markdown_table(rival_sheet(facts.law_choice))),
        ("Characteristics as measured", markdown_table(measured_segment_sheet(facts.stretches))),
        ("Measured beside the model", markdown_table(measured_force_sheet(forces))),
        ("Held out: predicted, not fitted", markdown_table(held_out_sheet(facts.held_out))),
        ("Across the settings", _list(facts.across)),
        ("Noise and lack of fit", _list(facts.trust)),
        ("Identifiability", _list(facts.identifiability)),
        ("Many starts", _list(facts.searches)),
        ("Cavitation", _list(facts.cavitation)),
        ("How it was done", _list((*facts.procedure, f"damperfit {facts.version}"))),
    )
    lines = ["# MSE report", "", *_summary(parameters, facts)]
    for title, body in sections:
        text = list(body)
        lines += ["", f"## {title}", "", *text] if text else []
    return "\n".join(lines) + "\n"


def _summary(parameters: Sequence[Mapping[str, Any]], facts: ReportFacts) -> Iterator[str]:
    rows = [row for row in parameters if row["mse_percent"] is not None]
    if facts.tested:
        yield from (f"Tested: {escape(facts.tested)}.", "")
    if facts.is_interrupted:
        yield from ("**Interrupted: these are the settings that were finished.**", "")
    if not rows:
        yield "No setting could be fitted."
        return
    values = {row["setting"]: row["mse_percent"] for row in rows}
    worst = max(values, key=lambda setting: values[setting])
    yield (
        f"{len(rows)} setting{'s' if len(rows) > 1 else ''} fitted, {grade_counts(rows)} "
        f"(excellent below 1 %, good below 5 %); MSE median {percent(median(values.values()))} %, "
        f"worst {percent(values[worst])} % at setting {worst}."
    )


def _checks(facts: ReportFacts) -> list[str]:
    if not facts.checks:
        return []
    return [f"{check_summary(facts.checks)}.", "", *markdown_table(check_sheet(facts.checks))]


def _one_below_another(tables: Iterable[list[str]]) -> list[str]:
    return [line for table in tables if table for line in (*table, "")][:-1]


def _list(items: Iterable[str]) -> list[str]:
    return [f"- {escape(item)}" for item in items]
