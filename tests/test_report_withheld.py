"""Grades that are withheld, and values that ran into a limit, in words for people."""

from __future__ import annotations

from dataclasses import replace

import pytest

from damperfit.damper.parameters import PURDY_DAMPER
from damperfit.report import ReportFacts, markdown_report
from damperfit.report.page.summary import setting_verdict
from damperfit.report.rows.identify_summary_table import summary_sheet
from damperfit.report.rows.mse_table import grade_counts
from damperfit.report.rows.parameter_table import limit_text, parameter_line, parameter_sheet
from damperfit.tables import make_tables
from damperfit.uncertainty import Assessment, Objection
from tests.fakes import campaign, fit

WHY = Objection("bound", "f_f", "f_f ran to the edge of its range (below 0.001 N)")


def tables():
    one = fit(1, status={"f_f": "at_bound"})
    one = replace(one, parameters=one.parameters.replace(f_f=2.65e-261))
    return make_tables(
        campaign(one, fit(2)), assessment=Assessment(objections={one.setting: (WHY,)})
    )


def test_a_value_at_the_edge_is_printed_as_the_limit_it_ran_into() -> None:
    rows = tables().parameters.to_pylist()
    assert "<0.001 !" in parameter_sheet(rows).rows[0]
    assert any("<0.001 !" in row for row in summary_sheet(rows).rows)
    assert "f_f below 0.001 N (at bound)" in parameter_line(rows[0])
    everything = f"{parameter_sheet(rows)} {summary_sheet(rows)} {parameter_line(rows[0])}"
    assert "e-261" not in everything


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("r_m1", 10.0, "<0.01"),
        ("r_m1", 19.9, "<0.02"),
        ("r_m1", 20.1, ""),
        ("k_e", 1e11, ">1e+05"),
        ("k_e", 4.9e10, ""),
        ("f_0", -218.0, ""),
    ],
)
def test_how_near_to_an_edge_a_value_is_the_edge(name: str, value: float, said: str) -> None:
    factor = {"r_m1": 1e-3, "k_e": 1e-6}.get(name, 1.0)
    assert limit_text(PURDY_DAMPER.quantity(name), value, factor) == said


def test_the_report_says_why_a_grade_is_withheld() -> None:
    made = tables()
    rows = made.parameters.to_pylist()
    assert grade_counts(rows).startswith("Grades: 1 excellent, 1 withheld")
    facts = ReportFacts(version="0", withheld=(f"setting 1: {WHY.sentence}",))
    report = markdown_report(made, facts)
    assert "## Grades withheld\n\n- setting 1: f_f ran to the edge" in report
    assert "| withheld |" in report
    verdict = setting_verdict(rows[0])
    assert verdict.startswith("withheld, MSE 0.0123 %")
    assert f"withheld because {WHY.sentence}" in verdict
    assert "## Grades withheld" not in markdown_report(made, ReportFacts(version="0"))
