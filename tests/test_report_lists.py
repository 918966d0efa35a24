"""Hundreds of logs, parts or warnings are told by the code of their problem, each kind."""

from __future__ import annotations

import pytest

from damperfit.problem import Failure, Problem, failure_lines, short_listing
from damperfit.reporting.inspection import MANY_ROWS, finding_lines, inspection_sheet, stretch_sheet
from tests.fakes import failed

CAUSES = {
    "empty-file": "empty file (0 bytes)",
    "no-number": "line {n}: force is 'OVR{n}', expected a number",
    "no-column": "no column for force; there are 't{n}', 'x'",
}


def failure(n: int, code: str) -> Failure:
    name = f"run_{n}.csv"
    problem = Problem(code, CAUSES[code], subject=name, values={"n": n})
    return Failure(problem, "LogError", name, f"runs/{name}")


def log(n: int, code: str, severity: str = "refusal") -> dict:
    sentence = CAUSES[code].format(n=n)
    finding = {"name": "unreadable", "severity": severity, "sentence": sentence, "value": n}
    verdict = "refused" if severity == "refusal" else "good"
    return {"name": f"run_{n}.csv", "verdict": verdict, "code": code, "findings": [finding]}


@pytest.mark.parametrize(("per_code", "lines"), [(2, 6), (6, 18), (100, 3)])
def test_failures_of_three_codes_are_three_lines_where_there_are_many(per_code, lines) -> None:
    failures = [failure(100 * k + i, c) for i in range(per_code) for k, c in enumerate(CAUSES)]
    told = failure_lines(failures)
    assert len(told) == lines
    for start in ("empty", "line", "no column"):
        assert any(f"csv: {start}" in line for line in told)
    if lines == 3:
        assert told[0].startswith("run_0.csv: empty file (0 bytes) (and 99 alike: run_1.csv, ")
        assert told[0].endswith("and 94 more)")


def test_the_tests_of_one_file_that_fail_alike_are_one_line() -> None:
    parts = [
        failed(
            f"a.dat part {k}", "a.dat", 3, "LogError", f"a.dat part {k}: {900 + k} samples", "short"
        )
        for k in range(1, 301)
    ]
    assert failure_lines(parts) == [
        "a.dat part 1: 901 samples (and 299 other tests of this file alike)"
    ]


@pytest.mark.parametrize(("n", "last"), [(20, "19"), (21, "and 1 more"), (800, "and 780 more")])
def test_of_many_sentences_twenty_are_told_each_once(n, last) -> None:
    told = short_listing([*map(str, range(n)), "0"])
    assert len(told) == min(n, 20) + (n > 20)
    assert told[-1].startswith(last)


def test_inspect_tells_each_kind_of_refusal() -> None:
    logs = [log(100 * k + i, c) for i in range(50) for k, c in enumerate(CAUSES)]
    told = list(finding_lines(logs))
    assert told[0] == "150 logs: 150 refused"
    assert "  run_0.csv and 49 other logs: unreadable: empty file (0 bytes)" in told
    joined = " ".join(" ".join(told).split())
    assert "run_100.csv: unreadable: line 100: force is 'OVR100'" in joined
    assert joined.count("With other numbers in") == 2
    assert joined.endswith("and 44 more")


def test_a_note_of_many_logs_is_one_line_with_the_range_of_its_value() -> None:
    told = list(finding_lines([log(k, "no-number", "note") for k in range(300)]))
    joined = " ".join(" ".join(told).split())
    assert joined.endswith("(300 of 300 logs; 0 to 299)")
    assert len(told) < 10
    (alone,) = [line for line in finding_lines([log(7, "no-number", "note")]) if "OVR" in line]
    assert "logs" not in alone


@pytest.mark.parametrize(("n", "n_rows"), [(MANY_ROWS, 60), (61, 48), (500, 60)])
def test_the_table_of_many_logs_has_the_first_that_can_be_used(n, n_rows) -> None:
    logs = [{"name": f"{k}.csv", "verdict": "refused" if k % 5 == 0 else "good"} for k in range(n)]
    sheet = inspection_sheet(logs)
    assert len(sheet.rows) == n_rows
    if n > MANY_ROWS:
        assert {row[-1] for row in sheet.rows} == {"good"}
        assert sheet.notes[0].startswith(f"{n - n_rows} of {n} logs have no row here")


def test_the_segments_of_many_logs_are_the_first() -> None:
    one = {"kind": "moving", "start_s": 0.0, "cycles": 0, "frequency_Hz": 1.0, "amplitude_m": 0.01,
           "peak_speed_m_per_s": 0.1, "noise_N": 1.0, "noise_source": ""}  # fmt: skip
    sheet = stretch_sheet({"name": f"{k}.csv", "stretches": [one]} for k in range(MANY_ROWS + 1))
    assert len(sheet.rows) == MANY_ROWS
    assert any("1 more" in note for note in sheet.notes)
