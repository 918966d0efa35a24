"""Reports: rounding, escaping, width, and a golden file for each state a setting can be in.

After a wanted change, write the golden files anew with:
    DAMPERFIT_WRITE_GOLDEN=1 pytest tests/test_report.py
and read the difference before committing it.
"""

from __future__ import annotations

import io
import os
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from markdown_it import MarkdownIt
from rich.console import Console

from damperfit.identification import Outcome
from damperfit.report.facts import Failure, ReportFacts
from damperfit.report.markdown import escape, markdown_report
from damperfit.report.rounding import number, percent, with_error
from damperfit.report.sheet import terminal_table
from damperfit.report.tables import ASCII_LEVELS, parameter_sheet, sparkline, summary_sheet
from damperfit.tables import make_tables
from tests.fakes import campaign, fit

GOLDEN = Path(__file__).parent / "golden"
FACTS = ReportFacts(version="1.2.3", procedure=("Procedure: paper.",))


def _advice(outcome: Outcome) -> tuple[tuple[str, str], ...]:
    return ((outcome.value, outcome.advice),)


STATES = {
    "good": (campaign(fit(1), fit(2, mse=1.5), fit(3, logs=("a.csv", "b.csv"))), FACTS, ()),
    "poor": (
        campaign(fit(1), fit(2, mse=12.34)),
        replace(FACTS, gates=("setting 2: MSE 12.3 % is above 5 %",)),
        (),
    ),
    "at_bound": (
        campaign(fit(1, outcome=Outcome.AT_BOUND, status={"k_e": "at_bound"}, mse=2.5)),
        replace(FACTS, advice=_advice(Outcome.AT_BOUND)),
        (),
    ),
    "not_identifiable": (
        campaign(fit(1, outcome=Outcome.NOT_IDENTIFIABLE, status={"k_e": "not_identifiable"})),
        replace(FACTS, advice=_advice(Outcome.NOT_IDENTIFIABLE)),
        (),
    ),
    "cavitating": (
        campaign(fit(19, outcome=Outcome.CAVITATING, f_0=-12.5, status={"f_0": "fitted"})),
        replace(FACTS, advice=_advice(Outcome.CAVITATING)),
        (),
    ),
    "missing": (
        campaign(fit(1), fit(3)),
        replace(
            FACTS,
            failures=(
                Failure("setting_02.csv", "runs/setting_02.csv", 2, "LogError", "empty file"),
            ),
            warnings=("there is no log of setting 2",),
            gaps=((2, 2),),
        ),
        (1, 2, 3),
    ),
    "nothing": (
        campaign(),
        replace(
            FACTS,
            failures=(Failure("a.csv", "a.csv", None, "LogError", "a.csv: no data rows"),),
        ),
        (),
    ),
}


def _terminal(table: object, width: int = 80) -> str:
    out = io.StringIO()
    Console(file=out, width=width, highlight=False, markup=False).print(table)
    return out.getvalue()


def _compare(name: str, text: str) -> None:
    path = GOLDEN / name
    if os.environ.get("DAMPERFIT_WRITE_GOLDEN"):
        path.write_text(text, encoding="utf-8")
    assert text == path.read_text(encoding="utf-8")


@pytest.mark.parametrize("state", STATES)
def test_the_report_of_each_state_is_as_agreed(state: str) -> None:
    done, facts, expected = STATES[state]
    _compare(f"report_{state}.md", markdown_report(make_tables(done, expected=expected), facts))


def test_several_settings_without_a_result_are_told_in_the_plural() -> None:
    text = markdown_report(make_tables(campaign(fit(4))), replace(FACTS, gaps=((1, 3),)))
    assert "- no result for settings 1-3\n" in text


@pytest.mark.parametrize("state", STATES)
def test_the_terminal_table_of_each_state_is_as_agreed(state: str) -> None:
    done, _, expected = STATES[state]
    sheet = summary_sheet(make_tables(done, expected=expected).parameters.to_pylist())
    text = _terminal(terminal_table(sheet))
    assert max(len(line) for line in text.splitlines()) <= 80
    assert "\x1b" not in text  # no colour without a terminal
    _compare(f"terminal_{state}.txt", text)


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        (23945.0, "23945"),
        (0.0123456, "0.012346"),
        (-12.5, "-12.500"),
        (1.5e9, "1.5000e+09"),
        (float("nan"), "-"),
        (float("inf"), "-"),
        (None, "-"),
        (0.0, "0"),
    ],
)
def test_numbers_have_five_digits(value: float | None, shown: str) -> None:
    assert number(value) == shown


@pytest.mark.parametrize(
    ("value", "error", "shown"),
    [
        (1.2634, 0.1234, "1.26 ± 0.12"),
        (1.2634, 0.0996, "1.26 ± 0.10"),
        (45678.9, 321.0, "45680 ± 320"),
        (-0.004321, 0.00052, "-0.00432 ± 0.00052"),
        (2.0, None, "2.0000"),
        (2.0, 0.0, "2.0000"),
        (2.0, float("nan"), "2.0000"),
        (None, 0.1, "-"),
    ],
)
def test_a_value_is_rounded_by_its_error(
    value: float | None, error: float | None, shown: str
) -> None:
    assert with_error(value, error) == shown


def test_percentages_have_three_digits() -> None:
    assert [percent(p) for p in (0.012345, 0.99999, 12.3456, 1e-6, 0.0, None)] == [
        "0.0123",
        "1.00",
        "12.3",
        "1.0e-06",
        "0",
        "-",
    ]


EVIL = "<script>alert(1)</script>|[b](http://x)`_*\x1b[31m\nset #1.csv"


def test_nothing_in_a_log_name_is_markup_in_the_report() -> None:
    done = campaign(fit(1, logs=(EVIL,)))
    facts = replace(
        FACTS, warnings=(EVIL,), failures=(Failure(EVIL, EVIL, None, "LogError", EVIL),)
    )
    text = markdown_report(make_tables(done), facts)
    assert "\x1b" not in text
    assert "<script>" not in text.replace("\\<", "")
    rows = [line for line in text.splitlines() if "script" in line and line.startswith("|")]
    assert len(rows) == 1
    assert rows[0].replace("\\|", "").count("|") == 9


def test_escape_shows_control_characters() -> None:
    assert escape("a\x00b\x1b") == "a\\\\x00b\\\\x1b"


def test_rich_markup_in_a_cell_is_shown_not_obeyed() -> None:
    sheet = parameter_sheet(make_tables(campaign(fit(1))).parameters.to_pylist())
    evil = replace(sheet, rows=(("[red]x[/red]", *sheet.rows[0][1:]),))
    assert "[red]x[/red]" in _terminal(terminal_table(evil), width=120)


def test_intervals_are_shown_once_the_table_has_them() -> None:
    import pyarrow as pa

    table = make_tables(campaign(fit(1))).parameters
    place = table.schema.get_field_index("k_e_se")
    with_se = table.set_column(place, table.schema.field(place), pa.array([3.21e6]))
    row = parameter_sheet(with_se.to_pylist()).rows[0]
    assert row[4] == "510.0 ± 3.2"


def _with_errors(done, share: float):
    """Return the parameters of a campaign with standard errors of a share of each value."""
    import pyarrow as pa

    table = make_tables(done).parameters
    for name in ("r_m1", "r_m2", "r_m3", "k_e", "f_f"):
        place = table.schema.get_field_index(f"{name}_se")
        values = [share * value for value in table.column(name).to_pylist()]
        table = table.set_column(place, table.schema.field(place), pa.array(values))
    return table


def test_the_closing_table_rounds_by_the_errors_and_shows_the_settings_at_a_glance() -> None:
    table = _with_errors(campaign(*(fit(n) for n in range(1, 21))), 0.00123)
    text = _terminal(terminal_table(summary_sheet(table.to_pylist())))
    assert "R_m3 = 2.5970(32)e6 N s/(m2 kg), shared by all settings" in text
    _compare("terminal_errors.txt", text)


@pytest.mark.parametrize("n_free", [3, 5, 6])
def test_the_closing_table_fits_80_columns_however_many_are_free(n_free: int) -> None:
    free = dict.fromkeys(("r_m1", "r_m2", "k_e", "r_m3", "f_f", "f_0")[:n_free], "fitted")
    many = (fit(n, status=free, f_0=-12.5 if n_free == 6 else 0.0) for n in (1, 12, 20))
    table = _with_errors(campaign(*many), 2.5e-5)
    text = _terminal(terminal_table(summary_sheet(table.to_pylist())), width=200)
    assert max(len(line) for line in text.splitlines()) <= 80
    assert ("(" in text.splitlines()[2]) == (n_free == 3)  # the errors go before the digits


def test_the_closing_table_is_ascii_where_that_is_asked() -> None:
    table = _with_errors(campaign(*(fit(n) for n in range(1, 5))), 0.001)
    sheet = summary_sheet(table.to_pylist(), levels=ASCII_LEVELS)
    assert _terminal(terminal_table(sheet)).isascii()


def test_a_sparkline_leaves_out_what_is_not_known() -> None:
    assert sparkline([0.0, None, float("nan"), 7.0]) == "▁  █"
    assert sparkline([]) == ""
    assert sparkline([None]) == " "


def test_a_setting_of_one_log_has_one_row_of_mse() -> None:
    text = markdown_report(make_tables(campaign(fit(1), fit(3, logs=("a.csv", "b.csv")))), FACTS)
    rows = text[text.index("## MSE by") :].splitlines()
    cells = [line.split(" | ")[:2] for line in rows if line.startswith("| ") and "csv" in line]
    assert cells == [["| 1", "setting_01.csv"], ["| ", "a.csv"], ["| ", "b.csv"]]


_MARKS = st.text(alphabet="ab1_*`~<>[]()|#+-.!&;$@\\= \x1b:/", max_size=12)


@given(_MARKS)
def test_markdown_shows_any_text_as_it_is(text: str) -> None:
    # In a list, as failures and warnings stand, and in a cell, as names of logs do.
    shown = " ".join(text.split()).replace("\x1b", "\\x1b")
    reader = MarkdownIt("commonmark").enable(["table", "strikethrough"])
    for source in (f"- {escape(text)} end", f"| a |\n| --- |\n| {escape(text)} end |"):
        inline = [token for token in reader.parse(source) if token.type == "inline"]
        assert {child.type for token in inline for child in token.children} <= {"text"}
        assert inline[-1].content
        assert "".join(c.content for c in inline[-1].children) == f"{shown} end".strip()


def test_the_markdown_reads_well_as_it_stands() -> None:
    assert escape("setting_01.csv (+1.2 %, r_m1), 26 +- 1") == (
        "setting_01.csv (+1.2 %, r_m1), 26 +- 1"
    )
    assert [escape(text) for text in ("_a_", "- a", "12. a", "+", "-605.1", "1.5 N")] == [
        "\\_a\\_", "\\- a", "12\\. a", "\\+", "-605.1", "1.5 N",
    ]  # fmt: skip
