"""A bug that one log or setting meets costs that one alone: told, code 1, all others written."""

from __future__ import annotations

import json
import shutil

import numpy as np
import pandas as pd
import pytest

from damperfit.cli import main
from damperfit.run import logs, record
from damperfit.synthetic import SampleOptions, make_samples
from tests.kept_fits import kept_fits

QUICK = (
    *("--procedure", "plain", "--free", "r_m1,r_m2,k_e"),
    *("--fix", "r_m3=2.6e6", "--fix", "f_f=50N"),
)


@pytest.fixture(scope="module", autouse=True)
def _fits_are_kept():
    with kept_fits():
        yield


@pytest.fixture(scope="module")
def samples(tmp_path_factory):
    """Three short logs of a quiet rig, settings 1 to 3."""
    folder = tmp_path_factory.mktemp("logs")
    options = SampleOptions(
        settings=(1, 2, 3), cycles=7.0, force_noise=1.0, displacement_noise=2e-6
    )
    make_samples(folder, options)
    return folder


class Ended:
    """What a command left behind."""

    def __init__(self, code: int, out: str, err: str) -> None:
        self.code, self.out, self.err = code, out, err


@pytest.fixture
def call(capsys, monkeypatch, tmp_path):
    """Run a command in this process, in an empty folder."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments) -> Ended:
        capsys.readouterr()
        code = main([str(argument) for argument in arguments])
        seen = capsys.readouterr()
        return Ended(code, seen.out, seen.err)

    return run


def identify(call, samples, *more) -> Ended:
    return call("identify", *sorted(samples.glob("setting_*.csv")), *QUICK, *more)


@pytest.fixture(scope="module")
def sound(samples, tmp_path_factory) -> pd.DataFrame:
    """What these logs give where nothing breaks."""
    folder = tmp_path_factory.mktemp("sound")
    logs_there = [str(path) for path in sorted(samples.glob("setting_*.csv"))]
    assert main(["identify", *logs_there, *QUICK, "--out", str(folder)]) == 0
    return pd.read_csv(folder / "parameters.csv")


def record_of(folder) -> dict:
    return json.loads((folder / "results" / "run.json").read_text())


def broken_at(function, is_hit, error=None):
    """Return the function with an error that nobody meant, where ``is_hit`` says so."""

    def broken(*arguments, **how):
        if is_hit(*arguments, **how):
            raise error or np.linalg.LinAlgError("SVD did not converge")
        return function(*arguments, **how)

    return broken


def _names_two(path, *_, **__) -> bool:
    return getattr(path, "name", "") == "setting_02.csv"


READING = {
    "reading the log": (logs, "read_logs"),
    "conditioning the log": (logs, "condition"),
}


@pytest.mark.parametrize("task", READING)
def test_a_bug_that_one_log_meets_costs_that_log(call, samples, sound, tmp_path, monkeypatch, task):
    module, name = READING[task]
    before = sound
    monkeypatch.setattr(module, name, broken_at(getattr(module, name), _names_two))
    ended = identify(call, samples)
    assert ended.code == 1
    (line,) = [line for line in ended.err.splitlines() if "internal error" in line]
    assert line.startswith("damperfit: setting_02.csv: internal error while ")
    assert f"while {task}, LinAlgError: SVD did not converge" in line
    assert "please report" in line
    assert "Traceback" not in ended.err
    (failure,) = record_of(tmp_path)["failures"]
    assert (failure["log"], failure["kind"]) == ("setting_02.csv", "InternalError")
    assert failure["message"] in line
    assert "trace" not in failure
    after = pd.read_csv(tmp_path / "results" / "parameters.csv")
    assert list(after["setting"]) == [1, 3]
    kept = before[before["setting"] != 2].reset_index(drop=True)
    pd.testing.assert_frame_equal(after, kept)


@pytest.mark.parametrize("task", READING)
def test_inspect_goes_on_too(call, samples, monkeypatch, task) -> None:
    module, name = READING[task]
    monkeypatch.setattr(module, name, broken_at(getattr(module, name), _names_two))
    ended = call("inspect", *sorted(samples.glob("setting_*.csv")), "--json")
    assert ended.code == 1
    told = json.loads(ended.out)
    assert [log["verdict"] for log in told["logs"]] == ["good", "refused", "good"]
    finding = told["logs"][1]["findings"][0]
    assert (finding["name"], finding["severity"]) == ("internal_error", "refusal")
    assert ended.err.count("internal error") == 1


def test_memory_that_one_log_lacks_is_said_so(call, samples, tmp_path, monkeypatch) -> None:
    error = MemoryError("Unable to allocate 9.00 GiB")
    monkeypatch.setattr(logs, "condition", broken_at(logs.condition, _names_two, error))
    ended = identify(call, samples)
    assert ended.code == 1
    (failure,) = record_of(tmp_path)["failures"]
    assert failure["kind"] == "MemoryError"
    assert failure["message"] == (
        "not enough memory for conditioning the log (Unable to allocate 9.00 GiB); give fewer or "
        "shorter logs at a time, or a lower --jobs"
    )


def test_whoever_wants_to_stop_is_not_held_up(call, samples, monkeypatch) -> None:
    error = KeyboardInterrupt()
    monkeypatch.setattr(logs, "condition", broken_at(logs.condition, _names_two, error))
    assert call("inspect", samples / "setting_02.csv").code == 130


# Judging: what is fitted is written


def _is_two(linearised, *_, **__) -> bool:
    fit = getattr(linearised, "fit", linearised)
    return fit.setting == 2


JUDGING = {
    "gathering": ("damperfit.uncertainty.linearisation.linearise_at_fit", _is_two),
    "diagnosing": ("damperfit.uncertainty.assessment.diagnose", _is_two),
    "intervals": ("damperfit.uncertainty.covariance._of_setting", _is_two),
    "profiles in doubt": ("damperfit.uncertainty.assessment.doubtful_profiles", _is_two),
    "forces": ("damperfit.adjustment.force_at._forces_of", lambda stage, *_: stage.setting == 2),
}


@pytest.mark.parametrize("step", JUDGING)
def test_a_setting_that_cannot_be_judged_is_written_without_it(
    call, samples, sound, tmp_path, monkeypatch, step
) -> None:
    before = sound
    name, is_hit = JUDGING[step]
    monkeypatch.setattr(name, broken_at(_found(name), is_hit))
    ended = identify(call, samples)
    assert ended.code == 1
    (line,) = [line for line in ended.err.splitlines() if "internal error" in line]
    assert "internal error while judging setting 2, LinAlgError" in line
    (failure,) = record_of(tmp_path)["failures"]
    assert (failure["setting"], failure["kind"]) == (2, "InternalError")
    after = pd.read_csv(tmp_path / "results" / "parameters.csv")
    assert list(after["setting"]) == [1, 2, 3]
    for column in ("r_m1", "r_m2", "k_e", "mse_percent"):
        np.testing.assert_array_equal(after[column], before[column])
    others = [0, 2]
    np.testing.assert_array_equal(after["r_m1_se"][others], before["r_m1_se"][others])
    assert call("report", "results").code == 0
    assert call("settings", "results").code in (0, 1)


def _found(name: str):
    from importlib import import_module

    module, _, attribute = name.rpartition(".")
    return getattr(import_module(module), attribute)


WHOLE = {
    "judging the fits": (record, "assess"),
    "comparing the settings": (record, "compare_settings"),
    "checking the run": (record, "run_checks"),
    "following profiles": (record, "profile_campaign"),
}


@pytest.mark.parametrize("task", WHOLE)
def test_a_step_over_all_settings_that_fails_leaves_the_fits(
    call, samples, tmp_path, monkeypatch, task
) -> None:
    module, name = WHOLE[task]
    monkeypatch.setattr(module, name, broken_at(getattr(module, name), lambda *_, **__: True))
    ended = identify(call, samples, "--profile", "k_e")
    assert ended.code == 1
    (failure,) = record_of(tmp_path)["failures"]
    assert (failure["log"], failure["setting"], failure["kind"]) == ("", None, "InternalError")
    assert f"internal error while {task}" in failure["message"]
    assert len(pd.read_csv(tmp_path / "results" / "parameters.csv")) == 3


def test_a_gate_that_a_bug_kept_from_being_looked_at_is_not_met(
    call, samples, tmp_path, monkeypatch
) -> None:
    monkeypatch.setattr(record, "run_checks", broken_at(record.run_checks, lambda *_: True))
    identify(call, samples, "--check", "no_cavitation")
    (gate,) = record_of(tmp_path)["gates_missed"]
    assert gate == "check not evaluated: no_cavitation: not evaluated because of an internal error"


def test_a_log_that_cannot_be_predicted_is_told(call, samples, tmp_path, monkeypatch) -> None:
    def is_two(_campaign, _assessment, traces, **_) -> bool:
        return traces[0].name == "setting_02.csv"

    monkeypatch.setattr(record, "predict", broken_at(record.predict, is_two))
    ended = identify(call, samples, "--hold-out-cycles", "2")
    assert ended.code == 1
    (failure,) = record_of(tmp_path)["failures"]
    assert failure["log"] == "setting_02.csv"
    assert "internal error while predicting setting_02.csv" in failure["message"]
    held = pd.read_csv(tmp_path / "results" / "mse.csv").query("role == 'held_out'")
    assert set(held["setting"]) == {1, 3}


def test_a_log_that_cannot_be_parted_is_told(call, samples, tmp_path, monkeypatch) -> None:
    from damperfit.run import parting

    broken = broken_at(parting.split_cycles, lambda trace, _: trace.setting == 2)
    monkeypatch.setattr(parting, "split_cycles", broken)
    assert identify(call, samples, "--hold-out-cycles", "2").code == 1
    (failure,) = record_of(tmp_path)["failures"]
    assert (failure["log"], failure["kind"]) == ("setting_02.csv", "InternalError")
    assert list(pd.read_csv(tmp_path / "results" / "parameters.csv")["setting"]) == [1, 3]


@pytest.mark.parametrize("what_is_told", ["an internal error", "a failed simulation"])
def test_a_response_that_fails_leaves_the_others(
    call, samples, tmp_path, monkeypatch, what_is_told
) -> None:
    from damperfit.errors import SimulationError
    from damperfit.identification import LogFit

    error = SimulationError("simulation failed") if "simulation" in what_is_told else None
    broken = broken_at(LogFit.compared, lambda log, *_: log.trace.setting == 2, error)
    monkeypatch.setattr(LogFit, "compared", broken)
    ended = identify(call, samples)
    assert ended.code == 1
    (failure,) = record_of(tmp_path)["failures"]
    assert failure["log"] == "setting_02.csv"
    assert failure["kind"] == ("SimulationError" if error else "InternalError")
    assert record_of(tmp_path)["exit_code"] == 1
    assert "setting_02.csv" in (tmp_path / "results" / "report.md").read_text().split("Not done")[1]
    signals = pd.read_parquet(tmp_path / "results" / "responses.parquet")
    assert set(signals["setting"]) == {1, 3}
    assert len(pd.read_csv(tmp_path / "results" / "parameters.csv")) == 3
    assert call("report", "results").code == 1  # says that one log has no loops


def test_simulating_with_a_log_that_meets_a_bug_is_one_line(call, samples, monkeypatch) -> None:
    name = "damperfit.queries.simulations.conditioned_as_tested"
    monkeypatch.setattr(name, broken_at(_found(name), lambda *_: True))
    how = ("simulate", "--setting", "1", "--displacement", samples / "setting_01.csv")
    ended = call(*how)
    assert ended.code == 1
    (line,) = ended.err.splitlines()
    assert line.startswith("damperfit: internal error while reading setting_01.csv, LinAlgError")
    assert "Traceback" in call(*how, "--debug").err


def test_settings_tell_the_one_that_meets_a_bug(call, samples, monkeypatch) -> None:
    assert identify(call, samples).code == 0
    name = "damperfit.adjustment.force_at._forces_of"
    monkeypatch.setattr(name, broken_at(_found(name), lambda stage, *_: stage.setting == 2))
    ended = call("settings", "results", "--json")
    assert ended.code == 1
    told = json.loads(ended.out)
    assert {row["setting"] for row in told["forces"]} == {1, 3}
    (remark,) = told["remarks"]
    assert "internal error while simulating setting 2, LinAlgError" in remark
    assert "Traceback" in call("settings", "results", "--debug").err


# The log that showed it


@pytest.mark.filterwarnings("error")
def test_a_dwell_in_the_only_cycle_is_no_bug(call, samples, tmp_path) -> None:
    """The end of the stroke is passed three times in one cycle: a straight line through a point."""
    shutil.copytree(samples, tmp_path / "logs")
    time = np.arange(3000) / 1000.0
    phase = np.mod(time, 1.0) - 0.25
    dwell = 32.0 * np.cos(0.1 * np.pi) + 0.02 * np.sin(16.0 * np.pi * phase)
    x = np.where(np.abs(phase) < 0.05, dwell, 32.0 * np.sin(2.0 * np.pi * time))
    v = np.gradient(x, time)
    force = 3.0 * v - 130.0 + 50.0 * np.tanh(v)
    rows = [f"{a:.4f},{b:.5f},{c:.3f}" for a, b, c in zip(time, x, force, strict=True)]
    text = "\n".join(["# setting: 4", "time_s,displacement_mm,force_N", *rows]) + "\n"
    (tmp_path / "logs" / "setting_04.csv").write_text(text)
    ended = call("inspect", *sorted((tmp_path / "logs").glob("setting_*.csv")), "--json")
    assert ended.code == 0
    verdicts = [log["verdict"] for log in json.loads(ended.out)["logs"]]
    assert verdicts[:3] == ["good"] * 3
    assert verdicts[3] in {"good", "warnings"}


def test_a_bug_of_the_joint_fit_is_told_and_leaves_the_results(
    call, samples, tmp_path, monkeypatch
):
    from damperfit.identification import joint as joint_procedure

    def broken(*_):
        raise np.linalg.LinAlgError("Singular matrix")

    monkeypatch.setattr(joint_procedure, "fit_jointly", broken)
    ended = call("identify", *sorted(samples.glob("setting_*.csv")), "--procedure", "joint")
    assert ended.code == 1
    assert "internal error while fitting the settings together, LinAlgError" in ended.err
    assert "Traceback" not in ended.err
    (failure,) = record_of(tmp_path)["failures"]
    assert (failure["log"], failure["kind"]) == ("", "InternalError")
    assert len(pd.read_csv(tmp_path / "results" / "parameters.csv")) == 3
