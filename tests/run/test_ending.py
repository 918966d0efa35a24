"""How a run ends: which failure, gate or interruption counts before which, and what is a gate."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

from damperfit.configuration.loading import load_configuration
from damperfit.identification import Outcome
from damperfit.run.logs import Ending, LogBatch
from damperfit.run.remarks import gates_not_met
from damperfit.run.run_json import ReportFacts, ending_of
from damperfit.tables.documents import json_pieces
from tests.fakes import campaign, failed, fit

FAILED = failed("a.csv", "a.csv", 1, "LogError", "a.csv: broken")
LEFT_OUT = failed("b.csv", "b.csv", 2, "QualityError", "b.csv: clipped")
SETTING = failed("", "", 3, "SimulationError", "setting 3: rigid")


def test_the_codes_are_those_of_the_contract() -> None:
    assert {one.name: one.value for one in Ending} == {
        "COMPLETE": 0,
        "SOME_FAILED": 1,
        "ALL_FAILED": 3,
        "GATE_MISSED": 4,
        "INTERRUPTED": 130,
    }


@pytest.mark.parametrize(
    ("fits", "failures", "gates", "stopped", "ending"),
    [
        (2, (), (), False, "COMPLETE"),
        (2, (), ("gate",), False, "GATE_MISSED"),
        (2, (FAILED,), (), False, "SOME_FAILED"),
        (2, (SETTING,), (), False, "SOME_FAILED"),
        (2, (FAILED,), ("gate",), False, "SOME_FAILED"),
        (2, (FAILED,), ("gate",), True, "INTERRUPTED"),
        (2, (LEFT_OUT,), ("strict",), False, "GATE_MISSED"),
        (2, (LEFT_OUT, FAILED), ("strict",), False, "SOME_FAILED"),
        (0, (FAILED,), (), False, "ALL_FAILED"),
        (0, (LEFT_OUT,), ("strict",), False, "GATE_MISSED"),
        (0, (LEFT_OUT, FAILED), ("strict",), False, "ALL_FAILED"),
        (0, (), (), False, "ALL_FAILED"),
        (0, (), (), True, "INTERRUPTED"),
    ],
)
def test_a_failure_counts_before_a_gate_and_an_interruption_before_both(
    fits, failures, gates, stopped, ending
) -> None:
    facts = ReportFacts("1", failures=failures, gates=gates, is_interrupted=stopped)
    done = campaign(*(fit(n + 1) for n in range(fits)))
    assert ending_of(done, facts) is Ending[ending]


@pytest.mark.parametrize(
    ("n_good", "failures", "ending"),
    [
        (3, (), "COMPLETE"),
        (3, (LEFT_OUT,), "GATE_MISSED"),
        (3, (LEFT_OUT, FAILED), "SOME_FAILED"),
        (0, (FAILED,), "ALL_FAILED"),
        (0, (LEFT_OUT,), "GATE_MISSED"),
    ],
)
def test_reading_alone_ends_alike(n_good, failures, ending) -> None:
    assert LogBatch((), (), failures, (), n_good).ending is Ending[ending]


def gates(*fits, failures=(), limit=0.0) -> list[str]:
    plain = load_configuration()
    asked = replace(plain, output=replace(plain.output, max_mse_percent=limit))
    return list(map(str, gates_not_met(asked, LogBatch((), (), failures, (), 1), campaign(*fits))))


@pytest.mark.parametrize(("mse", "is_met"), [(0.99, True), (1.0, True), (1.01, False)])
def test_the_gate_of_the_mse_is_met_up_to_its_limit(mse, *, is_met) -> None:
    said = gates(fit(3, mse=mse), limit=1.0)
    assert said == ([] if is_met else ["setting 3: MSE 1.01 % is above 1 %"])
    assert gates(fit(3, mse=mse)) == []  # nobody asked


def test_an_mse_that_is_no_number_meets_no_gate() -> None:
    assert gates(fit(3, mse=float("nan")), limit=1.0) == ["setting 3: MSE nan % is above 1 %"]


@pytest.mark.parametrize("outcome", Outcome)
def test_a_fit_without_a_minimum_is_a_gate_that_nobody_must_ask_for(outcome) -> None:
    missed = {Outcome.EVALUATION_LIMIT, Outcome.NO_DESCENT, Outcome.NOT_FINITE}
    said = gates(fit(1), fit(4, outcome=outcome))
    told = [f"setting 4: the fit did not converge ({outcome.value})"]
    assert said == (told if outcome in missed else [])


def test_what_strict_quality_left_out_is_a_gate() -> None:
    more = [replace(LEFT_OUT, log=f"{n}.csv") for n in range(2)]
    assert gates(failures=(FAILED,)) == []
    assert gates(failures=(LEFT_OUT,)) == ["strict quality: b.csv left out for warnings"]
    (one,) = gates(failures=(LEFT_OUT, more[0]))
    assert one == "strict quality: b.csv and 1 other log left out for warnings"
    (two,) = gates(failures=(LEFT_OUT, *more))
    assert two == "strict quality: b.csv and 2 other logs left out for warnings"


def test_a_document_is_laid_out_a_line_an_entry_and_reads_back() -> None:
    document = {
        "empty": {},
        "none": [],
        "one": [{}],
        "deep": {"inside": {"rows": [{"a": [1.5, None]}, {"b": '\u00e9, "quoted"\n'}]}},
        "numbers": [1, 2.5e-300, True],
        "mixed": [1, {"c": {"d": [{}]}}],
    }
    text = "".join(json_pieces(document))
    assert json.loads(text) == document
    assert text.endswith("}\n")
    lines = [line.strip() for line in text.splitlines()]
    assert '{"a": [1.5, null]},' in lines
    assert '"numbers": [1, 2.5e-300, true],' in lines
    with pytest.raises(ValueError, match="JSON"):
        list(json_pieces({"not": [{"a": "number", "b": float("nan")}]}))
