"""Tables on narrow terminals: no word and no number is cut, and no column is lost."""

from __future__ import annotations

import io
import random

import pytest
from rich.console import Console

from damperfit.report.sheet import Sheet, fitting_columns, terminal_table

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


def shown(width: int, sheet: Sheet = SHEET) -> str:
    lines = io.StringIO()
    console = Console(file=lines, width=width, no_color=True, highlight=False, emoji=False)
    console.print(terminal_table(sheet))
    return lines.getvalue()


@pytest.mark.parametrize("width", [100, 80, 60, 44, 32])
def test_no_word_is_cut_at_any_width(width):
    text = shown(width)
    assert max(map(len, text.splitlines())) <= width
    words = set(text.split())
    for part in (*SHEET.headings, *SHEET.notes, *(cell for row in SHEET.rows for cell in row)):
        assert words >= set(part.split()), part
    # A number with its error stays on one line.
    assert "+51.1 ± 0.4" in text


@pytest.mark.parametrize(("width", "n_parts"), [(56, 1), (52, 1), (51, 2), (32, 3)])
def test_columns_that_do_not_fit_go_below_with_the_first_again(width, n_parts):
    parts = fitting_columns(SHEET, width, gap=1)
    assert len(parts) == n_parts
    assert all(part[0] == 0 for part in parts)
    assert [k for part in parts for k in part[1:]] == [1, 2, 3, 4]
    assert shown(width).count("setting_01.csv") == n_parts


def test_a_name_longer_than_the_screen_is_folded_and_nothing_else():
    sheet = Sheet(("log", "n"), ("", ""), (("x" * 50, "12"),), (False, True))
    lines = io.StringIO()
    Console(file=lines, width=30, no_color=True).print(terminal_table(sheet))
    assert "".join(lines.getvalue().split()).count("x") == 50
    assert "12" in lines.getvalue().split()


CELLS = ("a", "setting_01.csv", "1.2(3)", "-0.3", "µm", "± 0.4", "same within errors", "", "▁▃▅█")
ASKS_FOR_RICH = ("日本", "e\u0301", " leads", "x" * 40, "soft\xadhyphen")


def drawn_sheet(luck: random.Random, *, words: tuple[str, ...]) -> Sheet:
    n = luck.randint(1, 6)
    notes = tuple(
        " ".join(luck.choices(("word", "µ", "(and", "well-known", "longer"), k=luck.randint(1, 30)))
        for _ in range(luck.randint(0, 2))
    )
    return Sheet(
        tuple(luck.choices(("log", "R_m1", "force", ""), k=n)),
        tuple(luck.choices(("", "", "N", "1e3"), k=n)),
        tuple(tuple(luck.choices(words, k=n)) for _ in range(luck.randint(0, 4))),
        tuple(luck.random() < 0.5 for _ in range(n)),
        notes,
    )


def test_a_pipe_is_given_what_rich_would_write():
    luck, plain = random.Random(14), 0  # noqa: S311
    for _ in range(300):
        words = CELLS if luck.random() < 0.7 else (*CELLS, *ASKS_FOR_RICH)
        sheet, width = drawn_sheet(luck, words=words), luck.choice((24, 32, 44, 80))
        lines = terminal_table(sheet).plain_lines(width)
        if lines is not None:
            plain += 1
            assert lines == [line.rstrip() for line in shown(width, sheet).splitlines()]
    assert 100 < plain < 300


@pytest.mark.parametrize("cell", ASKS_FOR_RICH)
def test_rich_is_asked_where_a_letter_is_not_a_place(cell):
    sheet = Sheet(("log", "n"), ("", ""), ((cell, "12"),), (False, True))
    assert terminal_table(sheet).plain_lines(30) is None
