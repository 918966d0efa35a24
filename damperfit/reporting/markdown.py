"""What a run tells in words, for report.md and the page; text of logs is escaped at the end."""

from __future__ import annotations

from statistics import median
from typing import TYPE_CHECKING, Any

from damperfit.adjustment.trends import in_few_words
from damperfit.identification import Outcome
from damperfit.identification.sharing import of_runs
from damperfit.problem import failure_lines, listing
from damperfit.reporting.forces import force_sheets, measured_force_sheet, measured_segment_sheet
from damperfit.reporting.laws import law_sentences, rival_sheet, tried_laws_sheet
from damperfit.reporting.records import (
    checks_in,
    failures_in,
    gaps_in,
    law_in,
    listed_in,
    predictions_in,
    problems_in,
    sentences_in,
    trends_in,
)
from damperfit.reporting.sheet import escape, markdown_table, percent
from damperfit.reporting.tables import (
    check_sheet,
    check_summary,
    grade_counts,
    held_out_sheet,
    mse_sheet,
    parameter_sheet,
)
from damperfit.tested.identity import identity_sentence

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from damperfit.reporting.sheet import Sheet
    from damperfit.results import Run


def lead(run: Run) -> str:
    """Return how it went, in a line."""
    rows = [row for row in run.rows("parameters") if row["mse_percent"] is not None]
    if not rows:
        return "No setting could be fitted."
    known = {row["setting"]: row["mse_percent"] for row in rows}
    worst = max(known, key=known.__getitem__)
    checks = checks_in(run.record)
    said = f"; {check_summary(checks)}" if checks else ""
    return (
        f"{len(known)} setting{'s' * (len(known) > 1)} fitted, {grade_counts(rows)}; MSE median "
        f"{percent(median(known.values()))} %, worst {percent(known[worst])} % at setting "
        f"{worst}{said}."
    )


def listings(run: Run) -> dict[str, list[str]]:
    """Return what to know before believing the numbers: sentences by title."""
    record, rows = run.record, run.rows("parameters")
    gaps = gaps_in(record)
    missing = [f"no result for {of_runs(gaps)}"] if gaps else []
    trends = in_few_words(trend.sentence for trend in trends_in(record) if trend.sentence)
    return {
        "Not done": [*failure_lines(failures_in(record)), *missing],
        "Gates not met": [str(one) for one in listed_in(record, "gates_missed")],
        "What to do": sorted({one for row in rows for one in _advice(row.get("outcome"))}),
        "Grades withheld": [
            f"setting {row['setting']}: {row['grade_reason']}"
            for row in rows
            if row.get("grade_reason")
        ],
        "Warnings": listing(problems_in(record)),
        "Model structure that the logs support": law_sentences(law_in(record)),
        "Held out: predicted, not fitted": [*map(_prediction, predictions_in(record))],
        "Across the settings": [*trends, *sentences_in(record, "force_offset")],
        "Noise and lack of fit": sentences_in(record, "noise_and_lack_of_fit"),
        "Identifiability": sentences_in(record, "identifiability"),
        "Many starts": sentences_in(record, "many_starts"),
        "Cavitation": sentences_in(record, "cavitation"),
        "How it was done": [str(one) for one in listed_in(record, "procedure")],
    }


def _advice(outcome: Any) -> Iterator[str]:
    known = next((one for one in Outcome if one.value == outcome), Outcome.CONVERGED)
    if known is not Outcome.CONVERGED:
        yield f"{known.value}: {known.advice}"


def _prediction(entry: dict[str, Any]) -> str:
    """Return how one log that was held out was predicted."""
    cycles = entry.get("cycles")
    which = f"{cycles} cycles"
    if cycles == "transients":
        which = "run-up, coast-down and changes of speed"
    return (
        f"setting {entry.get('setting')}, {entry.get('log')}, {which}: MSE "
        f"{entry['mse_percent']:.3g} % ({entry['expected_mse_percent']:.3g} % expected), "
        f"{entry.get('verdict')}"
    )


def markdown_report(run: Run) -> str:
    """Return the MSE report of a run: forces first, parameters second, then what to believe."""
    record, known = run.record, listings(run)
    checks, law = checks_in(record), law_in(record)
    parameters, forces = run.rows("parameters"), run.rows("adjustment")
    known["Checks"] = [f"{check_summary(checks)}."] if checks else []
    known["Held out: predicted, not fitted"] = []  # the table says more
    known["How it was done"].append(f"damperfit {record.get('version')}")
    sections: tuple[tuple[str, Iterable[Sheet]], ...] = (
        ("Not done", ()),
        ("Gates not met", ()),
        ("Force by setting", force_sheets(forces)),
        ("Parameters", [parameter_sheet(parameters, run.quantities)]),
        ("MSE by setting and log", [mse_sheet(run.rows("mse"), parameters, run.quantities)]),
        ("Checks", [check_sheet(checks)]),
        ("What to do", ()),
        ("Grades withheld", ()),
        ("Warnings", ()),
        ("Model structure that the logs support", [tried_laws_sheet(law)]),
        ("Models of the literature", [rival_sheet(law)]),
        ("Characteristics as measured", [measured_segment_sheet(listed_in(record, "stretches"))]),
        ("Measured beside the model", [measured_force_sheet(forces)]),
        ("Held out: predicted, not fitted", [held_out_sheet(predictions_in(record))]),
        ("Across the settings", ()),
        ("Noise and lack of fit", ()),
        ("Identifiability", ()),
        ("Many starts", ()),
        ("Cavitation", ()),
        ("How it was done", ()),
    )
    identity = identity_sentence(run.identity)
    lines = ["# MSE report", "", *([f"Tested: {escape(identity)}.", ""] if identity else [])]
    if record.get("ending") == "interrupted":
        lines += ["**Interrupted: these are the settings that were finished.**", ""]
    lines.append(f"{escape(lead(run))} Excellent is an MSE below 1 %, good below 5 %.")
    for title, sheets in sections:
        parts = [[f"- {escape(one)}" for one in known.get(title, ())], *map(markdown_table, sheets)]
        text = [line for part in parts if part for line in ("", *part)]
        lines += ["", f"## {title}", *text] if text else []
    return "\n".join(lines) + "\n"
