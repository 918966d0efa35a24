"""What a run says of hundreds of logs, tests and settings is one sentence; of a few, each."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

from damperfit.configuration.loading import load_configuration
from damperfit.identification import Outcome
from damperfit.problem import failure_lines
from damperfit.run import judging
from damperfit.run.hold_out import Parted
from damperfit.run.logs import LogBatch
from damperfit.run.remarks import (
    MANY,
    gates_not_met,
    missing_logs,
    run_warnings,
    skipped_files,
)
from damperfit.run.run_json import Judgement, ending_of, record, report_facts
from damperfit.tables.rows import make_tables
from tests.fakes import campaign, failed, fit

NO_LOGS = LogBatch((), (), (), (), 0)


def _fits(n: int, **how):
    return campaign(*(fit(setting, **how) for setting in range(1, n + 1)))


def test_a_gap_of_900_000_settings_is_one_range_everywhere() -> None:
    few = [fit(setting) for setting in (1, 2, 3, 4, 6)]
    found = campaign(*few, replace(fit(20), setting=900_000))
    assert found.gaps == ((5, 5), (7, 899_999))
    configuration = load_configuration()
    facts = report_facts(configuration, NO_LOGS, found, Judgement(), is_interrupted=False)
    told = record(configuration, NO_LOGS, facts, found, Judgement(), ending=ending_of(found, facts))
    assert told["gaps"] == [{"first": 5, "last": 5}, {"first": 7, "last": 899_999}]
    assert len(json.dumps(told)) < 100_000
    assert len(make_tables(found)["parameters"]) == 6


def test_gaps_stand_in_report_and_page_whoever_wrote_them() -> None:
    from damperfit.report.records import gaps_in

    assert gaps_in({"gaps": [{"first": 6, "last": 899_999}]}) == ((6, 899_999),)
    assert gaps_in({"gaps": [4, 7]}) == ((4, 4), (7, 7))  # an earlier version
    assert gaps_in({"gaps": [{"first": 7, "last": 6}, {"first": 1}, "x", None, True]}) == ()
    assert gaps_in({"gaps": 3}) == ()


@pytest.mark.parametrize(("n", "lines"), [(MANY, MANY), (MANY + 1, 1)])
def test_gates_of_many_settings_are_one_line(n, lines) -> None:
    configuration = load_configuration(overlay={"output": {"max_mse_percent": 0.001}})
    said = list(map(str, gates_not_met(configuration, NO_LOGS, _fits(n, mse=0.5))))
    assert len(said) == lines
    assert said[0].startswith("setting 1: MSE 0.5 % is above 0.001 %")
    if lines == 1:
        assert said[0].endswith(f"(with other numbers at 2-{n})")


@pytest.mark.parametrize(("n", "lines"), [(MANY, MANY), (MANY + 1, 1)])
def test_fits_of_many_settings_that_did_not_converge_are_one_line(n, lines) -> None:
    configuration = load_configuration()
    said = list(
        map(str, gates_not_met(configuration, NO_LOGS, _fits(n, outcome=Outcome.EVALUATION_LIMIT)))
    )
    assert len(said) == lines
    assert said[0].startswith("setting 1: the fit did not converge (")


@pytest.mark.parametrize(("n", "is_by_setting"), [(MANY, True), (MANY + 1, False), (30, False)])
def test_no_setting_is_told_to_have_missed_the_gate_of_another(n, is_by_setting) -> None:
    configuration = load_configuration(overlay={"output": {"max_mse_percent": 1.0}})
    above = {setting: fit(setting, mse=2.0) for setting in range(2, n + 1, 2)}
    unsound = {
        setting: fit(setting, mse=0.5, outcome=Outcome.NO_DESCENT) for setting in range(1, n + 1, 2)
    }
    both = {**above, **unsound}
    said = list(
        map(str, gates_not_met(configuration, NO_LOGS, campaign(*(both[k] for k in sorted(both)))))
    )
    told = [f"setting {k}: MSE 2 % is above 1 %" for k in above]
    told += [f"setting {k}: the fit did not converge (no_descent)" for k in unsound]
    if is_by_setting:
        told.sort(key=lambda one: int(one.split(":")[0].split()[1]))
    assert said == told


@pytest.mark.parametrize(("n", "lines"), [(MANY, MANY), (MANY + 1, 1)])
def test_warnings_of_many_fits_are_one_line(n, lines) -> None:
    found = _fits(n)
    fits = tuple(replace(one, warnings=(f"{one.setting} trials failed.",)) for one in found.fits)
    said = list(map(str, run_warnings(NO_LOGS, replace(found, fits=fits))))
    assert len(said) == lines
    assert said[0].startswith("setting 1: 1 trials failed.")


@pytest.mark.parametrize(("n", "lines"), [(20, 20), (21, 1)])
def test_many_files_that_are_no_logs_are_one_line(n, lines) -> None:
    batch = replace(NO_LOGS, skipped=tuple(f"truth_{k}.csv" for k in range(n)))
    said = list(skipped_files(batch))
    assert len(said) == lines
    if lines == 1:
        assert said == ["truth_0.csv and 20 other files: written by damperfit, not logs; skipped"]


@pytest.mark.parametrize(("n", "lines"), [(MANY, MANY), (MANY + 1, 1)])
def test_many_settings_without_a_log_are_one_failure(n, lines) -> None:
    configuration = load_configuration(overlay={"rig": {"settings": list(range(1, n + 1))}})
    said = list(missing_logs(configuration, NO_LOGS))
    assert len(said) == lines
    assert {one.kind for one in said} == {"MissingLogError"}
    if lines == 1:
        assert said[0].line == (
            f"settings 1-{n}: no log, but the configuration expects one in rig.settings for each"
        )


@pytest.mark.parametrize(("n", "more"), [(MANY, []), (MANY + 1, ["and 1 more"])])
def test_checks_are_told_of_a_few_lost_logs_and_how_many_more(n, more, monkeypatch) -> None:
    failures = tuple(failed(f"{k}.csv", "", k, "LogError", "empty") for k in range(n))
    monkeypatch.setattr(judging, "run_checks", lambda subject: subject.missing)
    batch = replace(NO_LOGS, failures=failures)
    missing = judging._checks(load_configuration(), Parted(batch), campaign(fit(1)), None, None)
    assert list(missing) == [f"{k}.csv failed" for k in range(MANY)] + more


@pytest.mark.parametrize(("n", "lines"), [(5, 5), (6, 1), (300, 1)])
def test_the_tests_of_one_file_that_fail_alike_are_one_line(n, lines) -> None:
    def failure(k: int):
        name = f"long.dat part {k}"
        said = f"{name}: the log does not say its adjuster setting"
        return failed(name, "runs/long.dat", None, "LogError", said)

    other = failed("b.csv", "runs/b.csv", 2, "LogError", "b.csv: empty file")
    said = failure_lines([*(failure(k) for k in range(1, n + 1)), other])
    assert len(said) == lines + 1
    assert said[-1] == "b.csv: empty file"
    if lines == 1:
        assert said[0] == (
            "long.dat part 1: the log does not say its adjuster setting "
            f"(and {n - 1} other tests of this file alike)"
        )


def test_files_that_fail_alike_have_a_line_each() -> None:
    failures = [
        failed(f"{k}.csv", f"{k}.csv", None, "LogError", f"{k}.csv: empty file") for k in range(9)
    ]
    assert failure_lines(failures) == [f"{k}.csv: empty file" for k in range(9)]
