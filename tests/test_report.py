"""Tables and texts of reports: rounding, escaping, width, marks; and all texts as agreed."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from markdown_it import MarkdownIt

from damperfit.adjustment.clicks import Click
from damperfit.adjustment.trends import Trend
from damperfit.checks import Check
from damperfit.reporting.inspection import MANY_ROWS, inspection_sheet
from damperfit.reporting.records import (
    gaps_in,
    read_back,
    to_record,
    units_in,
)
from damperfit.reporting.sheet import (
    Sheet,
    escape,
    markdown_table,
    text_table,
    with_interval,
)
from damperfit.reporting.tables import (
    force_sheets,
    law_sentences,
    parameter_line,
    parameter_sheet,
    rival_sheet,
    tried_laws_sheet,
)
from damperfit.tables.columns import PAPER_QUANTITIES
from damperfit.tested.setting import Setting
from tests.fakes import campaign, fit, make_tables
from tests.texts import FORCES, SNAPSHOT, texts, written

SHEET = Sheet(
    headings=("log", "samples", "force", "change", "verdict"),
    units=("", "", "N", "N", ""),
    rows=(
        ("setting_01.csv", "5000", "1234.5", "+51.1 ± 0.4", "same within errors"),
        ("setting_02.csv", "5000", "-1250", "-46.0 ± 0.3", "different, perhaps by chance"),
    ),
    is_number=(False, True, True, True, False),
    notes=("a note that is longer than a narrow screen is wide, and wraps between its words",),
)


@pytest.fixture(scope="module")
def told():
    return texts()


def test_all_texts_are_as_agreed(told) -> None:
    """After a wanted change: python -m tests.texts, and read the difference."""
    assert written(told).splitlines() == SNAPSHOT.read_text(encoding="utf-8").splitlines()


# A table


@pytest.mark.parametrize("width", [100, 80, 60, 44, 32])
def test_no_number_and_no_short_word_is_cut_at_any_width(width) -> None:
    text = text_table(SHEET, width)
    assert max(map(len, text.splitlines())) <= width
    words = set(text.split())
    for part in (*SHEET.headings, *SHEET.notes, *(cell for row in SHEET.rows for cell in row)):
        for word in part.split():
            assert word in words or len(word) > width // 3, word
    assert "+51.1 ± 0.4" in text  # a number with its error stays on one line


def test_long_names_are_cut_in_the_middle_unless_two_then_look_alike() -> None:
    rows = tuple((f"{'x' * 30}{mark}_bench.csv", "12") for mark in "ab")
    cut = Sheet(("log", "n"), ("", ""), rows[:1], (False, True))
    assert text_table(cut, 30).splitlines()[1] == "xxxxxxxxx…_bench.csv 12"
    lines = text_table(Sheet(("log", "n"), ("", ""), rows, (False, True)), 30).splitlines()
    assert "".join(lines).count("x") == 60
    assert max(map(len, lines)) <= 30


def test_wide_letters_count_twice() -> None:
    sheet = Sheet(("log", "n"), ("", ""), (("xxx", "12"), ("日本", "3")), (False, True))
    lines = text_table(sheet, 30).splitlines()
    assert lines[-1].index("3") + 2 == lines[1].index("12") + 1


def test_colours_are_those_of_words_and_escape_sequences_are_shown() -> None:
    evil = Sheet(("log", "grade"), ("", ""), (("\x1b[31ma", "excellent"),), (False, False))
    plain, coloured = text_table(evil), text_table(evil, colours={})
    assert "\x1b" not in plain
    assert "\\x1b[31ma" in plain
    assert "\x1b[32mexcellent\x1b[0m" in coloured


_MARKS = st.text(alphabet="ab1_*`~<>[]()|#+-.!&;$@\\= \x1b:/", max_size=12)


@given(_MARKS)
def test_markdown_shows_any_text_as_it_is(text: str) -> None:
    # In a list, as failures and warnings stand, and in a cell, as names of logs do.
    shown = " ".join(text.split()).replace("\x1b", "\\x1b")
    reader = MarkdownIt("commonmark").enable(["table", "strikethrough"])
    for source in (f"- {escape(text)} end", f"| a |\n| --- |\n| {escape(text)} end |"):
        inline = [token for token in reader.parse(source) if token.type == "inline"]
        assert {child.type for token in inline for child in token.children} <= {"text"}
        assert "".join(c.content for c in inline[-1].children) == f"{shown} end".strip()
    assert markdown_table(Sheet(("a",), ("",), (), (False,))) == []


# Numbers


@given(st.floats(1e-6, 1e9), st.floats(1e-6, 0.3))
def test_a_value_is_shown_to_the_place_that_its_interval_tells(value, share) -> None:
    half = share * value
    shown, _, error = with_interval(value, value - half, value + half).partition(" ± ")
    assert abs(float(shown) - value) <= 0.51 * half
    assert float(error) == pytest.approx(half, rel=0.26)


def test_limits_that_are_uneven_or_missing_are_not_half_an_interval() -> None:
    assert with_interval(10.0, 5.0, 40.0) == "10 (5 to 40)"
    assert with_interval(10.0, None, 40.0) == with_interval(10.0, None, None) == "10.000"
    assert with_interval(None, 1.0, 2.0) == "-"
    assert with_interval(51.13, 50.7, 51.5, plus="+") == "+51.1 ± 0.4"


# Parameters


def rows(*fits):
    return make_tables(campaign(*fits))["parameters"].to_pylist()


def wide(setting, **cells):
    (row,) = rows(fit(setting))
    return row | cells


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [("r_m1", 10.0, "<0.01"), ("r_m1", 20.1, "0.02010"), ("k_e", 1e11, ">1e+05")],
)
def test_a_value_at_its_bound_is_the_limit_it_ran_into(name, value, said) -> None:
    (row,) = rows(fit(1, status={name: "at_bound"}))
    row[name] = value
    sheet = parameter_sheet([row, wide(2)])
    cell = sheet.rows[0][[one.name for one in PAPER_QUANTITIES].index(name) + 1 - (name == "k_e")]
    assert cell == f"{said} !"
    if said[0] in "<>":
        assert "(at bound)" in parameter_line(row)


def test_courses_that_errors_cannot_tell_apart_are_flat() -> None:
    apart = [wide(n, r_m1=1e4 * n, r_m1_se=1.0) for n in (1, 2, 3)]
    alike = [wide(n, r_m1=1e4 + n, r_m1_se=1e3) for n in (1, 2, 3)]
    courses = [parameter_sheet(known, levels="abc").notes for known in (apart, alike)]
    assert "R_m1 abc" in " ".join(courses[0])
    assert "drawn flat" in " ".join(courses[1])


# Forces


def test_a_setting_of_several_adjusters_has_a_row_for_each_that_was_turned() -> None:
    label = Setting.of("R6 C2")
    several = [row | {"setting": label, "changed": name} for row in FORCES[:4] for name in "RC"]
    sheet = force_sheets([row | {"change_N": 1.0} for row in several])[0]
    assert [row[0] for row in sheet.rows] == ["R6 C2, C", "R6 C2, R"]


def test_the_one_speed_that_was_asked_for_is_told_with_its_digits() -> None:
    asked = [row | {"speed_m_per_s": 0.12345} for row in FORCES[:2]]
    assert force_sheets(asked)[0].headings[1] == "0.12345"


# Model structures, records


def test_structures_that_were_tried_are_told_loosely() -> None:
    choice = {
        "chosen": "purdy",
        "sentences": ["it leaks"],
        "undecided": 5,
        "effective_samples": 40.0,
        "laws": [{"law": "purdy", "is_chosen": True, "free": ["r_m1"], "mse_percent": 0.00001,
                  "held_out_mse_percent": None, "bic": 12.3, "gain": "x"}, 7],
        "rivals": [{"title": "Duym", "source": "1997", "caveat": "no gas", "free": []}],
    }  # fmt: skip
    (row,) = tried_laws_sheet(choice).rows
    assert row == ("*", "purdy", "", "", "+12", "1", "1.0e-05", "-", "")
    assert law_sentences(choice) == ["The logs support purdy.", "it leaks"]
    assert rival_sheet(choice).notes == ("Duym: no gas",)
    assert law_sentences({}) == []
    assert not tried_laws_sheet({"laws": "abc"}).rows


@pytest.mark.parametrize(
    "one",
    [
        Check("no_cavitation", None, "why"),
        Click(Setting.of(1), Setting.of("R6 C2"), 0.3, "rebound", 1.0, 0.5, 1.5, 2.0, 1.0, 3.0),
    ],
)
def test_what_run_json_holds_is_read_back(one) -> None:
    record = json.loads(json.dumps(to_record(one)))
    assert read_back(type(one), record) == one


def test_what_a_trend_lacks_is_not_known() -> None:
    trend = read_back(Trend, {"parameter": "k_e", "points": [{"setting": 1, "value": 2.0}]})
    assert trend is not None
    assert np.isnan(trend.points[0].low)
    assert read_back(Trend, {"parameter": "k_e", "points": [{"setting": "x"}, 5]}) is None
    assert gaps_in({"gaps": [3, {"first": 5, "last": 6}, "x", {"first": 2}]}) == ((5, 6), (3, 3))
    assert units_in({"configuration": {"output": {"units": "furlong"}}}).is_si


@pytest.mark.parametrize(("n", "n_rows"), [(MANY_ROWS, 60), (61, 48), (500, 60)])
def test_the_table_of_many_logs_has_the_first_that_can_be_used(n, n_rows) -> None:
    logs = [{"name": f"{k}.csv", "verdict": "refused" if k % 5 == 0 else "good"} for k in range(n)]
    sheet = inspection_sheet(logs)
    assert len(sheet.rows) == n_rows
    if n > MANY_ROWS:
        assert {row[-1] for row in sheet.rows} == {"good"}
        assert sheet.notes[0].startswith(f"{n - n_rows} of {n} logs have no row here")
