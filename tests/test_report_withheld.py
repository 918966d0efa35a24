"""Grades that are withheld, and values that ran into a limit, in words for people."""

from __future__ import annotations

from dataclasses import replace

import pytest

from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.report.facts import ReportFacts
from damperfit.report.forces import (
    force_by_setting_sheet,
    force_by_speed_sheet,
    measured_force_sheet,
)
from damperfit.report.markdown import markdown_report
from damperfit.report.page import setting_verdict
from damperfit.report.tables import (
    grade_counts,
    limit_text,
    parameter_line,
    parameter_sheet,
    summary_sheet,
    total_error,
)
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


def forces(**changes):
    plain = {
        "setting": 1,
        "speed_m_per_s": 0.3,
        "stroke": "rebound",
        "force_N": 900.0,
        "force_ci_low_N": 890.0,
        "force_ci_high_N": 910.0,
        "measured_N": 1000.0,
        "measured_se_N": 1.0,
        "difference_N": 95.0,
        "told_from": "measured",
        "change_N": None,
        "change_ci_high_N": None,
        "change_percent": None,
    }
    return plain | changes


def test_the_measured_force_is_told_where_the_model_misses_it() -> None:
    bump = forces(stroke="bump", force_N=-700.0, measured_N=-705.0, difference_N=-4.0)
    rows = [forces(), bump | {"told_from": "model", "force_ci_high_N": -690.0}]
    sheet = force_by_setting_sheet(rows)
    assert sheet.rows[0][1] == "1000.0 ± 2.0 m"
    assert sheet.rows[0][4] == "-700.0 ± 10.0"
    assert any(note.startswith("m measured: the model misses") for note in sheet.notes)
    beside = measured_force_sheet(rows)
    assert beside.rows == (("1", "0.3", "1000 m", "905.0", "+95.0", "-705.0", "-701.0", "-4.0"),)
    single = forces(measured_se_N=None)
    assert force_by_setting_sheet([single, rows[1]]).rows[0][1] == "1000 m"
    assert force_by_speed_sheet([single], "rebound").rows[0][1] == "1000 m"


def test_slower_speeds_stand_beside_where_the_model_misses_them() -> None:
    slow = [forces(speed_m_per_s=0.1, told_from=told) for told in ("model", "measured")]
    assert [row[1] for row in measured_force_sheet([forces(), slow[0]]).rows] == ["0.3"]
    assert [row[1] for row in measured_force_sheet([forces(), slow[1]]).rows] == ["0.1", "0.3"]


def test_results_of_before_have_no_measured_forces() -> None:
    old = forces()
    for name in ("measured_N", "measured_se_N", "difference_N", "told_from"):
        del old[name]
    assert measured_force_sheet([old]).rows == ()
    assert force_by_speed_sheet([old], "rebound").rows[0][1] == "900.0"


def test_errors_in_tables_are_of_noise_and_misfit_together() -> None:
    row = tables().parameters.to_pylist()[1]
    row |= {"r_m1_se": 30.0, "r_m1_misfit_se": 40.0}
    assert total_error(row, "r_m1") == 50.0
    assert any("what repeats in the residual" in note for note in parameter_sheet([row]).notes)
    assert total_error(row | {"r_m1_misfit_se": None}, "r_m1") == 30.0
    assert total_error(row | {"r_m1_se": None}, "r_m1") is None


def test_a_parameter_without_a_number_hides_none_behind_it() -> None:
    status = {"k_e": "not_identifiable", "f_f": "at_bound", "r_m2": "absent"}
    one = fit(1, status=status, f_0=5.0)
    one = replace(one, parameters=one.parameters.replace(f_f=2.65e-261))
    (row,) = make_tables(campaign(one)).parameters.to_pylist()
    assert parameter_line(row | {"r_m1": None}) == (
        f"no {PURDY_DAMPER.quantity('r_m2').label}, R_m3 = 2.5970e6 N s/(m2 kg) (shared), "
        "K_e cannot be determined, f_f below 0.001 N (at bound), f_0 = 5.0000 N (fixed)."
    )
