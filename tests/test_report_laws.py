"""Which law the logs support: in run.json, in report.md, on the page."""

from __future__ import annotations

import json

import pytest

from damperfit.cli import main
from damperfit.report.laws import law_sentences, rival_sheet, tried_laws_sheet

LAW = {
    "law": "through flow: bleed; elastic mounting",
    "change": "without blow-offs",
    "gain": 12.345,
    "bic": 60.4,
    "free": ["a", "b"],
    "mse_percent": 1.5,
    "held_out_mse_percent": None,
    "is_chosen": True,
    "reason": "because",
}
RIVAL = {
    "title": "Kwok",
    "source": "Kwok 2006",
    "free": ["a"],
    "mse_percent": 2.0,
    "held_out_mse_percent": 3.0,
    "caveat": "later",
}
TOLD = {
    "chosen": "the paper's model",
    "effective_samples": 60.0,
    "laws": [LAW],
    "rivals": [RIVAL, RIVAL | {"title": "Wen"}],
    "sentences": ["Seen."],
    "undecided": ["Open."],
}


def test_a_law_has_a_row_with_what_was_changed_gained_and_predicted() -> None:
    sheet = tried_laws_sheet(TOLD)
    assert sheet.headings == (
        "", "law", "changed", "factor", "BIC", "free", "MSE", "held out", "why",
    )  # fmt: skip
    assert sheet.rows == (
        ("*", LAW["law"], "without blow-offs", "12.3", "+60", "2", "1.50", "-", "because"),
    )
    assert "60 effective samples" in sheet.notes[1]
    assert tried_laws_sheet(TOLD, is_narrow=True).headings == (
        "", "law", "free", "BIC", "MSE", "held out",
    )  # fmt: skip
    # A note on a column stands below that column alone.
    assert "factor: MSE of the smaller" in sheet.notes[1]
    assert "factor" not in " ".join(tried_laws_sheet(TOLD, is_narrow=True).notes)


def test_models_of_the_literature_tell_once_what_is_not_original() -> None:
    sheet = rival_sheet(TOLD)
    assert [row[0] for row in sheet.rows] == ["Kwok", "Wen"]
    assert sheet.notes == ("Kwok, Wen: later",)
    # Numbers stand below one another; words begin at the left.
    assert sheet.is_number == tuple(cell[0].isdigit() for cell in sheet.rows[0])


def test_sentences_say_what_is_seen_and_what_is_open() -> None:
    assert law_sentences(TOLD) == ["The logs support the paper's model.", "Seen.", "Open."]


JUNK = (
    {},
    {"laws": 3, "rivals": "x", "chosen": 1},
    {"laws": [1, {"free": 2, "bic": "y"}], "rivals": [None]},
)


@pytest.mark.parametrize("junk", JUNK)
def test_what_somebody_else_wrote_there_breaks_nothing(junk: dict[str, object]) -> None:
    tried_laws_sheet(junk)
    assert rival_sheet(junk).rows == ()
    assert law_sentences(junk) == []


def test_a_run_that_let_the_logs_choose_tells_it_everywhere(tmp_path, capsys) -> None:
    assert main(["samples", str(tmp_path), "--settings", "10", "--quiet"]) == 0
    log = str(next(tmp_path.glob("*10*.csv")))
    out = tmp_path / "results"
    command = ["identify", log, "--model", "auto", "--out", str(out), "--quiet", "--report"]
    assert main(command) == 0
    told = json.loads((out / "run.json").read_text())["law_choice"]
    assert told["chosen"] == "the paper's model"
    assert [one["is_chosen"] for one in told["laws"]] == [True]
    assert told["undecided"][-1].startswith("How well the law predicts another test: nothing")
    for text in ((out / "report.md").read_text(), (out / "report.html").read_text()):
        assert "Which law the logs support" in text
        assert "The logs support the paper" in text
        assert "How well the law predicts another test" in text
    capsys.readouterr()
    assert main(["identify", log, "--out", str(out), "--quiet"]) == 0
    assert "law_choice" not in json.loads((out / "run.json").read_text())
    assert "Which law" not in (out / "report.md").read_text()
    assert main(["identify", log, "--rivals", "--out", str(out), "--quiet"]) == 2
    assert "add --model auto" in capsys.readouterr().err
