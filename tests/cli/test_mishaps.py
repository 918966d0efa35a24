"""A bug that one log or setting meets costs that one alone: told, code 1, all others written."""

import json
from importlib import import_module

import numpy as np
import pandas as pd
import pytest

from damperfit.cli import main
from damperfit.errors import SimulationError
from tests.fakes import log_text

QUICK = (
    *("--procedure", "plain", "--free", "r_m1,r_m2,k_e"),
    *("--fix", "r_m3=2.6e6", "--fix", "f_f=50N"),
)


@pytest.fixture(scope="module")
def samples(logs) -> list[str]:
    return [str(path) for path in sorted(logs.glob("setting_*.csv"))]


@pytest.fixture(scope="module")
def sound(samples, tmp_path_factory) -> pd.DataFrame:
    """What these logs give where nothing breaks."""
    folder = tmp_path_factory.mktemp("sound")
    assert main(["identify", *samples, *QUICK, "--out", str(folder)]) == 0
    return pd.read_csv(folder / "parameters.csv", index_col="setting")


@pytest.fixture
def broken(monkeypatch):
    """Let a function raise an error that nobody meant, where ``is_hit`` says so."""

    def breaks(name, is_hit, error=None) -> None:
        path, _, attribute = name.rpartition(".")
        owner = import_module(f"damperfit.{path}")
        function = getattr(owner, attribute)

        def acts(*arguments, **how):
            if is_hit(*arguments, **how):
                raise error or np.linalg.LinAlgError("SVD did not converge")
            return function(*arguments, **how)

        monkeypatch.setattr(owner, attribute, acts)

    return breaks


def failures(folder) -> list[dict]:
    return json.loads((folder / "results" / "run.json").read_text())["failures"]


def is_file_two(path, *_, **__) -> bool:
    return getattr(path, "name", "") == "setting_02.csv"


def is_two(linearised, *_, **__) -> bool:
    return getattr(linearised, "fit", linearised).setting == 2


def is_log_two(log, *_) -> bool:
    return getattr(log, "trace", log).setting == 2


def is_predicted_two(_campaign, _assessment, traces, **_) -> bool:
    return traces[0].name == "setting_02.csv"


def is_any(*_, **__) -> bool:
    return True


LOG, HELD = "setting_02.csv", ("--hold-out-cycles", "2")
# What breaks, at whom; what was being done; the log and the setting that it costs; which settings
# still have parameters; what else is asked of the command.
FAULTS = {
    "run.logs.read_logs": (is_file_two, "reading the log", LOG, None, [1, 3], ()),
    "run.logs.condition": (is_file_two, "conditioning the log", LOG, 2, [1, 3], ()),
    "run.identify.split_cycles": (is_log_two, "holding out cycles of", LOG, 2, [1, 3], HELD),
    "run.record.predict": (is_predicted_two, "predicting setting_02.csv", LOG, 2, [1, 2, 3], HELD),
    "tables.rows.characteristic_rows": (
        lambda setting, *_: setting == 2, "simulating the response of", LOG, 2, [1, 2, 3], (),
    ),
    **{
        name: (is_two, "judging setting 2", "", 2, [1, 2, 3], ())
        for name in (
            "uncertainty.covariance.linearise_at_fit",
            "uncertainty.assessment.diagnose",
            "uncertainty.covariance._of_setting",
            "uncertainty.assessment.doubtful_profiles",
            "adjustment.force_at._forces_of",
        )
    },
    **{
        f"run.record.{name}": (is_any, task, "", None, [1, 2, 3], ("--profile", "k_e"))
        for name, task in {
            "assess": "judging the fits",
            "compare_settings": "comparing the settings",
            "run_checks": "checking the run",
            "profile_campaign": "following profiles",
        }.items()
    },
    "identification.joint.fit_jointly": (
        is_any, "fitting the settings together", "", None, [1, 2, 3], None,
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", FAULTS)
def test_a_bug_costs_what_it_meets_and_nothing_else(
    run, samples, sound, tmp_path, broken, name
) -> None:
    is_hit, task, log, setting, left, more = FAULTS[name]
    broken(name, is_hit)
    how = ("--procedure", "joint") if more is None else (*QUICK, *more)
    code, _, err = run("identify", *samples, *how)
    assert code == 1
    (line,) = [line for line in err.splitlines() if "internal error" in line]
    assert f"internal error while {task}" in line
    assert "LinAlgError: SVD did not converge" in line
    assert "Traceback" not in err
    (failure,) = failures(tmp_path)
    assert (failure["log"], failure["kind"]) == (log, "InternalError")
    assert failure["setting"] == (2 if log else setting)
    assert "trace" not in failure
    after = pd.read_csv(tmp_path / "results" / "parameters.csv", index_col="setting")
    assert list(after.index) == left
    if not more and more is not None:
        for column in ("r_m1", "r_m2", "k_e", "mse_percent"):
            np.testing.assert_array_equal(after[column], sound.loc[left, column])
    assert list(after["r_m1_se"].drop(2, errors="ignore").notna()) == [name[-6:] != "assess"] * 2
    assert run("report", "results")[0] in {0, 1}  # a log without loops is said
    assert run("settings", "results")[0] in {0, 1}


@pytest.mark.parametrize(
    "error", [SimulationError("stiff."), np.linalg.LinAlgError("SVD did not converge")]
)
def test_a_setting_that_cannot_be_fitted_costs_itself_alone(
    run, samples, tmp_path, broken, error
) -> None:
    broken("identification.procedures.fit_from", lambda setting, *_, **__: setting == 2, error)
    how = (*QUICK, "--fix", "f_0=1N")  # fits that no other test has made
    code, _, err = run("identify", *samples, *how)
    assert code == 1
    assert "2 settings fitted, 1 failed" in err
    assert "Traceback" not in err
    (failure,) = failures(tmp_path)
    is_bug = not isinstance(error, SimulationError)
    kind = "InternalError" if is_bug else "SimulationError"
    assert (failure["setting"], failure["kind"]) == (2, kind)
    assert ("please report" in failure["message"]) is is_bug
    after = pd.read_csv(tmp_path / "results" / "parameters.csv")
    assert after["setting"].tolist() == [1, 3]
    assert str(error) in (tmp_path / "results" / "report.md").read_text().split("Not done")[1]
    assert run("identify", samples[1], *how)[0] == 3


def test_inspect_goes_on_and_lets_whoever_wants_stop(run, samples, tmp_path, broken) -> None:
    broken("run.logs.condition", is_file_two)
    code, out, err = run("inspect", *samples, "--json")
    assert (code, err.count("internal error")) == (1, 1)
    told = json.loads(out)["logs"]
    assert [log["verdict"] for log in told] == ["good", "refused", "good"]
    finding = told[1]["findings"][0]
    assert (finding["name"], finding["severity"]) == ("internal_error", "refusal")
    broken("run.logs.condition", is_file_two, MemoryError("Unable to allocate 9.00 GiB"))
    assert run("identify", *samples, *QUICK)[0] == 1
    (failure,) = failures(tmp_path)
    assert failure["kind"] == "MemoryError"
    assert "(Unable to allocate 9.00 GiB); give fewer or shorter logs" in failure["message"]
    broken("run.logs.condition", is_file_two, KeyboardInterrupt())
    assert run("inspect", samples[1])[0] == 130


@pytest.mark.slow
def test_a_gate_that_a_bug_kept_from_being_looked_at_is_not_met(
    run, samples, tmp_path, broken
) -> None:
    broken("run.record.run_checks", is_any)
    run("identify", *samples, *QUICK, "--check", "no_cavitation")
    record = json.loads((tmp_path / "results" / "run.json").read_text())
    assert [one.split(":")[:2] for one in record["gates_missed"]] == [
        ["check not evaluated", " no_cavitation"]
    ]


def test_commands_on_results_and_logs_tell_a_bug_in_one_line(run, samples, broken) -> None:
    assert run("identify", *samples, *QUICK)[0] == 0
    broken("adjustment.force_at._forces_of", lambda stage, *_: stage.setting == 2)
    code, out, _ = run("settings", "results", "--json")
    assert code == 1
    assert {row["setting"] for row in json.loads(out)["forces"]} == {1, 3}
    assert "internal error while simulating setting 2" in json.loads(out)["remarks"][0]
    broken("queries.simulations.conditioned_as_tested", is_any)
    how = ("simulate", "--setting", "1", "--displacement", samples[0])
    code, _, err = run(*how)
    assert code == 1
    assert err.startswith("damperfit: internal error while reading setting_01.csv, LinAlgError")
    assert len(err.splitlines()) == 1
    assert "Traceback" in run(*how, "--debug")[2]


def test_a_dwell_in_the_only_cycle_is_no_bug(run, tmp_path) -> None:
    """The end of the stroke is passed three times in one cycle: a straight line through a point."""
    time = np.arange(3000) / 1000.0
    phase = np.mod(time, 1.0) - 0.25
    dwell = 32.0 * np.cos(0.1 * np.pi) + 0.02 * np.sin(16.0 * np.pi * phase)
    x = np.where(np.abs(phase) < 0.05, dwell, 32.0 * np.sin(2.0 * np.pi * time))
    v = np.gradient(x, time)
    text = log_text(time, 1e-3 * x, 3.0 * v - 130.0 + 50.0 * np.tanh(v))
    (tmp_path / "setting_04.csv").write_text(text)
    assert run("inspect", tmp_path / "setting_04.csv")[0] == 0
