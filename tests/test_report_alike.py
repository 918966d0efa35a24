"""Hundreds of logs, parts or warnings are told by their kinds, and no kind hides another."""

from __future__ import annotations

import pytest

from damperfit.report.facts import (
    Failure,
    by_words,
    failure_lines,
    listed_names,
    shape_of,
    short_listing,
    summarised,
    with_ranges,
)
from damperfit.report.inspection import (
    MANY_ROWS,
    finding_lines,
    inspection_sheet,
    stretch_sheet,
)

CAUSES = (
    "empty file (0 bytes)",
    "line {n}: force is 'OVR{n}', expected a number",
    "no column for force; there are 't{n}', 'x'. Name it: rig.columns.force = 'NAME'",
    "{n} samples; expected at least 3 whole cycles of a steady test; record a longer log",
    "time repeats: {n}.5 s after {n}.5 s; time must increase",
    "this is JSON, damaged in line {n}, column 2: Expecting value; copy the log again",
    "the interval between values is {n}e-3 s",
)


def failure(n: int, cause: str, *, setting: int | None = None) -> Failure:
    name = f"run_{n}.csv"
    return Failure(name, f"runs/{name}", setting, "LogError", f"{name}: {cause.format(n=n)}")


def refused(n: int, cause: str) -> dict:
    found = {"name": "unreadable", "severity": "refusal", "sentence": cause.format(n=n)}
    finding = {**found, "value": None, "unit": ""}
    return {"name": f"run_{n}.csv", "verdict": "refused", "findings": [finding]}


@pytest.mark.parametrize(("per_cause", "lines"), [(2, 14), (3, 21), (4, 7), (100, 7)])
def test_refusals_of_seven_kinds_are_seven_kinds(per_cause, lines) -> None:
    failures = [failure(100 * k + i, c) for i in range(per_cause) for k, c in enumerate(CAUSES)]
    told = failure_lines(failures)
    assert len(told) == lines
    for start in ("empty", "line", "no column", "time", "this is JSON", "the interval"):
        assert any(f"csv: {start}" in line for line in told)
    if lines == 7:
        n = per_cause - 1
        more = ", run_5.csv and 94 more" if n == 99 else ""
        assert told[0].startswith(f"run_0.csv: empty file (0 bytes) (and {n} alike: run_1.csv, ")
        assert told[0].endswith(f"{more})")


@pytest.mark.parametrize(("n", "lines"), [(20, 20), (21, 1)])
def test_up_to_twenty_failures_have_a_line_each(n, lines) -> None:
    assert len(failure_lines([failure(k, CAUSES[1]) for k in range(n)])) == lines


def test_failed_settings_are_listed_by_their_numbers() -> None:
    failures = [
        Failure("", "", k, "SimulationError", f"setting {k}: does not converge after {k} steps")
        for k in range(1, 31)
    ]
    (told,) = failure_lines(failures)
    assert told == (
        "setting 1: does not converge after 1 steps (and 29 alike: setting 2, setting 3, "
        "setting 4, setting 5, setting 6 and 24 more)"
    )


@pytest.mark.parametrize(("kinds", "lines"), [(20, 20), (21, 21), (500, 21)])
def test_kinds_beyond_twenty_are_counted(kinds, lines) -> None:
    told = short_listing(f"cause {'x' * k} of {i}" for k in range(kinds) for i in range(4))
    assert len(told) == lines
    assert ("other kinds" in told[-1]) is (kinds > 20)
    if kinds > 20:
        n = kinds - 20
        assert told[-1] == f"and {4 * n} more of {n} other kinds; run.json and --json list them all"


def test_the_parts_of_a_file_that_fail_with_other_numbers_are_one_line() -> None:
    parts = [
        Failure(f"a.dat part {k}", "a.dat", 3, "LogError", f"a.dat part {k}: {900 + k} samples")
        for k in range(1, 301)
    ]
    assert failure_lines(parts) == [
        "a.dat part 1: 901 samples (and 299 other tests of this file alike)"
    ]


def test_eight_hundred_warnings_are_a_few_lines() -> None:
    warnings = [f"setting {k}: R_m1 ends at {k}e9, its bound" for k in range(800)]
    assert short_listing([*warnings, "one more"]) == [f"{warnings[0]} (and 799 alike)", "one more"]


def test_a_shape_has_no_numbers_and_no_names() -> None:
    assert shape_of("a1.csv: 'x', 'y' and 'z' at 1.5e-3 s, r_m1 -3 %", "a1.csv") == (
        ": '' at # s, r_m1 # %"
    )


def test_six_names_are_listed_and_of_seven_five() -> None:
    assert listed_names(list("abcdef")) == "a, b, c, d, e, f"
    assert listed_names(list("abcdefg")) == "a, b, c, d, e and 2 more"


# What inspect tells


def test_inspect_tells_each_kind_of_refusal() -> None:
    # Used to be one: "With other numbers in" all logs, whatever was wrong with them.
    logs = [refused(100 * k + i, c) for i in range(50) for k, c in enumerate(CAUSES)]
    told = list(finding_lines(logs))
    assert told[0] == "350 logs: 350 refused"
    assert sum("unreadable:" in line for line in told) == 7
    assert "  run_0.csv and 49 other logs: unreadable: empty file (0 bytes)" in told
    assert len(told) < 40


def test_kinds_of_refusals_beyond_twenty_are_counted() -> None:
    logs = [refused(k, f"cause {'x' * k}") for k in range(25)]
    assert list(finding_lines(logs))[-1] == "  and 5 more kinds; --json lists them all"


@pytest.mark.parametrize(("n", "end"), [(20, "20.csv"), (21, "5.csv and 16 more")])
def test_up_to_twenty_logs_with_other_numbers_are_named(n, end) -> None:
    logs = [refused(k, CAUSES[1]) for k in range(n + 1)]
    told = " ".join(" ".join(finding_lines(logs)).split())
    assert told.endswith(f"run_{end}")


def test_notes_with_other_numbers_are_one_line() -> None:
    def log(k: int) -> dict:
        notes = [f"temperature: left out; {k} of 500 values are missing", "time in ms"]
        return {"name": f"{k}.csv", "verdict": "good", "findings": [], "notes": notes}

    told = list(finding_lines([log(k) for k in range(300)]))
    assert " ".join(" ".join(told[told.index("Read as") + 1 :]).split()) == (
        "temperature: left out; 0 of 500 values are missing (300 of 300 logs, with other names or "
        "numbers) time in ms (300 of 300 logs)"
    )
    few = list(finding_lines([log(k) for k in range(3)]))
    assert sum("temperature" in line for line in few) == 3


@pytest.mark.parametrize(("n", "n_rows"), [(MANY_ROWS, 60), (MANY_ROWS + 1, 60), (500, 60)])
def test_the_table_of_many_logs_has_the_first_that_can_be_used(n, n_rows) -> None:
    logs = [{"name": f"{k}.csv", "verdict": "refused" if k % 5 == 0 else "good"} for k in range(n)]
    sheet = inspection_sheet(logs)
    if n == 61:
        assert len(sheet.rows) == 48
    else:
        assert len(sheet.rows) == n_rows
    if n == MANY_ROWS:
        assert not sheet.notes
        return
    assert {row[-1] for row in sheet.rows} == {"good"}
    assert sheet.notes == (
        f"{n - len(sheet.rows)} of {n} logs have no row here; --json lists them all",
    )


@pytest.mark.parametrize(("n", "n_rows"), [(MANY_ROWS, 60), (MANY_ROWS + 1, 5)])
def test_the_table_of_many_refused_logs_is_short(n, n_rows) -> None:
    sheet = inspection_sheet({"name": f"{k}.csv", "verdict": "refused"} for k in range(n))
    assert len(sheet.rows) == n_rows


@pytest.mark.parametrize(("n", "is_whole"), [(MANY_ROWS, True), (MANY_ROWS + 1, False)])
def test_the_stretches_of_many_logs_are_the_first(n, is_whole) -> None:
    one = {"kind": "moving", "start_s": 0.0, "cycles": 0, "frequency_Hz": 1.0, "amplitude_m": 0.01}
    more = {"peak_speed_m_per_s": 0.1, "noise_N": 1.0, "noise_source": "above the filter"}
    sheet = stretch_sheet({"name": f"{k}.csv", "stretches": [one | more]} for k in range(n))
    assert len(sheet.rows) == MANY_ROWS
    assert any("1 more stretches" in note for note in sheet.notes) is not is_whole


@pytest.mark.parametrize(("length", "n", "lines"), [(199, 4, 4), (200, 4, 1), (200, 3, 3)])
def test_long_sentences_that_differ_in_the_name_alone_are_said_once(length, n, lines) -> None:
    sentences = [(f"{k}.csv", f"{k}.csv: ".ljust(length, "x")) for k in range(n)]
    other = ("9.csv", "9.csv: empty file")
    said = list(summarised([sentences[0], other, *sentences[1:]]))
    assert len(said) == lines + 1
    assert said[1] == other[1]
    assert said[0].endswith("x (and 3 alike: 1.csv, 2.csv, 3.csv)") is (lines == 1)


def test_sentences_that_differ_in_numbers_are_one_with_their_ranges() -> None:
    said = [
        "at zero velocity the force is -132 +- 6 N; the gas force alone is -130 N",
        "at zero velocity the force is -128.5 +- 6 N; the gas force alone is -130 N",
        "at zero velocity the force is 9 +- 21 N; the gas force alone is -130 N",
        "the force has 'no 2' steps",
        "the force has 'no 3' steps",
        "version 1.2.3 of 4 files",
        "version 1.2.4 of 5 files",
    ]
    level, steps, version = by_words(said)
    assert with_ranges(level) == (
        "at zero velocity the force is between -132 and 9 N (uncertain by 6 to 21 N); "
        "the gas force alone is -130 N"
    )
    late = (
        ["2.1 +- 0.1 ms late", "2.1 +- 0.2 ms late"],
        ["2.1 +- 0.1 ms late", "2.3 +- 0.1 ms late"],
    )
    assert [with_ranges(one) for one in (*late, late[0][:1])] == [
        "2.1 ms (uncertain by 0.1 to 0.2 ms) late",
        "between 2.1 and 2.3 ms (uncertain by 0.1 ms) late",
        "2.1 +- 0.1 ms late",
    ]
    assert with_ranges(steps) == "the force has 'no 2 to 3' steps"
    assert with_ranges(version) == "version 1.2.3 of 4 to 5 files"
    assert with_ranges(["3.0 mm", "3 mm"]) == "3.0 mm"


@pytest.mark.parametrize(("n", "is_cut"), [(5, False), (6, True)])
def test_five_kinds_of_notes_of_a_name_are_shown(n: int, *, is_cut: bool) -> None:
    kinds = "abcdef"[:n]
    logs = [
        {"name": f"{kind}.csv", "findings": [{"name": "skew", "severity": "note",
         "sentence": f"late as in {kind}", "value": 1.0, "unit": "s"}]}
        for kind in kinds
    ]  # fmt: skip
    lines = [line for line in finding_lines(logs) if "skew" in line]
    assert len(lines) == n
    assert ("skew: other notes on 1 of 6 logs" in lines[-1]) is is_cut
