"""What cannot act, cannot be done or is not to be trusted is said, and one run stands alone."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from damperfit.cli import main
from damperfit.configuration.loading import load_configuration
from damperfit.errors import ConfigurationError
from damperfit.run.identify import written

GIVEN = [
    word
    for name in ("r_m1=1.8e4", "r_m2=3.527e6", "r_m3=2.597e6", "k_e=365MPa", "f_f=50N")
    for word in ("--set", name)
]


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (
            ["identify", "LOG", "--share", "r_m3"],
            "--share r_m3 has no effect: only procedure joint",
        ),
        (
            ["identify", "LOG", "--model", "auto", "--share", "f_f"],
            "--share f_f has no effect: only procedure joint",
        ),
        (
            ["identify", "LOG", "--model", "auto", "--free", "r_m1,r_m2"],
            "--free has no effect: with --model auto the logs choose what is fitted",
        ),
        (["identify", ""], "found ''; "),
        (["identify", "--quiet", ""], "found ''; "),
        (["identify", "LOG", "--out", ""], "--out: found ''; expected the path of a folder"),
        (["identify", "LOG", "--out="], "--out: found ''; expected the path of a folder"),
        (["compare", "LOG", ""], "found ''; "),
        (["identify", "LOG", "--max-mse", "0"], "--max-mse 0: expected more than 0"),
        (["identify", "LOG", "--setting=?"], "--setting ?: expected clicks"),
        (["identify", "LOG", "--setting", "0"], "--setting 0: setting_01.csv says setting 1"),
        (["inspect", "LOG", "--setting=?"], "--setting ?: expected clicks"),
        (["simulate", "--setting=?"], "--setting ?: expected clicks"),
        (["sweep", "--setting=?", "--vary", "r_m1=1,2"], "--setting ?: expected clicks"),
        (["identify", "LOG", "--rig", "amplitude=32"], "--rig amplitude: expected at most 2 m"),
        (["inspect", "LOG", "--rig", "frequency=1500"], "--rig frequency: expected at most 500 Hz"),
        (["simulate", "--frequency", "1500"], "--frequency: expected at most 500 Hz"),
        (["identify", "LOG", "--procedure", "papre"], "--procedure: no procedure 'papre'"),
        (["identify", "LOG", "--free", "r_m1,ke"], "--free: no parameter 'ke'"),
        (["identify", "LOG", "--fix", "ke=1"], "--fix: no parameter 'ke'"),
        (["identify", "LOG", "--fix", "r_m1=1e99"], "--fix: r_m1 = 1e+99 is fixed, far from"),
        (["identify", "LOG", "--free=k_e", "--fix=k_e=1e9"], "--free: k_e is both free and fixed"),
        (
            ["identify", "LOG", "--start", "k_e=1e9", "--fix", "k_e=1e9"],
            "--start: k_e is fixed and also given a start",
        ),
        (["identify", "LOG", "--start", "k_e=1e99"], "--start: k_e = 1e+99 is given as a start"),
        (["identify", "LOG", "--start", "f_0=5"], "--start: f_0 is given a start but is not"),
        (["models", "LOG", "--start", "play=1"], "--start: play = 1 is given as a start, far from"),
        (
            ["identify", "LOG", "--procedure", "joint", "--share", "k_e", "--free", "k_e"],
            "--share: k_e is shared and also free or fixed",
        ),
        (
            ["identify", "LOG", "--bulk-modulus", "appendix1"],
            "--bulk-modulus: appendix1: one gas content for all",
        ),
        (
            ["identify", "LOG", "--model", "bouc_wen", "--covariate", "temperature"],
            "--covariate: nothing of the model 'bouc_wen' is a viscous resistance",
        ),
        (["identify", "LOG", "--hold-out", "zzz*"], "--hold-out zzz*: matches no log"),
        (["identify", "LOG", "--check", "nothing"], "--check: no check 'nothing'"),
        (["identify", "LOG", "--hold-out-cycles", "1.5"], "--hold-out-cycles: expected a share"),
        (["identify", "LOG", "--starts", "0"], "--starts: expected 1 or more"),
        (["identify", "LOG", "--skew", "2mm"], "--skew: no unit of time 'mm'"),
        (["identify", "LOG", "--rig-profile", "lab"], "--rig-profile: no profile 'lab'"),
        (["simulate", *GIVEN, "--parameters", "LOG"], "nothing is taken from it"),
        *(
            (
                ["simulate", *GIVEN, "--displacement", "LOG", option, value],
                " cannot be combined with --displacement",
            )
            for option, value in (
                ("--amplitude", "3mm"),
                ("--frequency", "1Hz"),
                ("--cycles", "3"),
                ("--sample-rate", "1kHz"),
                ("--wave", "sine"),
                ("--max-steps", "9"),
            )
        ),
    ],
)
def test_what_cannot_be_or_cannot_act_is_code_2(run, logs, tmp_path, arguments, says) -> None:
    log = str(logs / "setting_01.csv")
    ended = run(*(log if word == "LOG" else word for word in arguments))
    assert ended.code == 2
    assert says in ended.err
    assert len(ended.err.splitlines()) == 1
    assert ended.out == ""
    assert list(tmp_path.iterdir()) == []


def test_just_inside_they_act(run, logs, tmp_path) -> None:
    log = logs / "setting_01.csv"
    assert run("identify", log, "--share", "r_m3", "--procedure", "joint").code == 0
    assert run("identify", log, "--max-mse", "1e-9").code == 4
    assert run("identify", log, "--setting", "1", "--rig", "amplitude=2").code == 0
    lines = log.read_text().splitlines(keepends=True)
    (tmp_path / "bench.csv").write_text("".join(x for x in lines if "setting" not in x))
    assert run("identify", "bench.csv", "--setting", "0", "--rig", "amplitude=2").code == 0
    assert run("simulate", *GIVEN, "--displacement", log).code == 0


def test_a_mistake_in_a_file_is_told_with_its_line_also_where_values_meet(tmp_path) -> None:
    path = tmp_path / "mine.toml"
    for text, says in (
        ("[identification]\nprocedure = 'papre'\n", "mine.toml:2: identification.procedure: no "),
        ("[output]\n\nchecks = ['nothing']\n", "mine.toml:3: output.checks: no check"),
        ("[output]\n\nchecks = ['-nope']\n", "mine.toml:3: output.checks: no check '-nope'"),
        ("[damper]\npiston_diameter = '18mm'\n", "mine.toml:2: damper.rod_diameter: expected less"),
        (
            "[identification]\nfree = ['k_e']\nfix = {k_e = 1e9}\n",
            "mine.toml:2: identification.free: k_e is both free and fixed",
        ),
        (
            "[identification]\nfix = {k_e = 9}\n",
            "mine.toml:2: identification.fix: k_e = 9 is fixed",
        ),
    ):
        path.write_text(text)
        with pytest.raises(ConfigurationError) as caught:
            load_configuration(path)
        assert says in str(caught.value)
        assert "defaults.toml" not in str(caught.value)


def test_the_work_is_estimated_before_it_is_done(run) -> None:
    """0.0001 Hz ran for 29 s, unasked."""
    ended = run("simulate", *GIVEN, "--frequency", "0.0001Hz")
    assert ended.code == 2
    for words in ("4e+07 samples", "expected at most 5000000", "--max-steps 44000000"):
        assert words in ended.err
    # 4 cycles of 25 samples: the integrator takes more steps than that.
    few = ("simulate", *GIVEN, "--sample-rate", "37.5Hz", "--max-steps")
    steps = int(run(*few, "100").err.split("--max-steps ")[1])
    assert 500 < steps < 10_000
    assert run(*few, str(steps)).code == 0
    assert run(*few, str(int(steps / 1.2))).code == 2
    # The samples alone: 4 cycles of 1000.
    many = ("simulate", *GIVEN, "--frequency", "1Hz", "--sample-rate", "100kHz", "--max-steps")
    assert run(*many, "400000").code == 0
    assert run(*many, "399999").code == 2
    assert run("sweep", "--paper", "--max-steps", "100").code == 2


def test_cavitation_is_said(run) -> None:
    assert "warning" not in run("simulate", "--setting", "1").err
    ended = run("simulate", "--setting", "1", "--frequency", "15Hz", "--sample-rate", "5kHz")
    assert "chamber 2 is empty for" in ended.err
    document = run("simulate", "--setting", "1", "--frequency", "15Hz", "--json", "--quiet")
    assert len(json.loads(document.out)["warnings"]) >= 2
    assert document.err == ""


@pytest.mark.parametrize(("value", "code"), [("1e99", 2), ("1.01e7", 2), ("1e7", 0)])
def test_a_parameter_held_far_off_is_refused(run, logs, value, code) -> None:
    """At 1e99 the run went through, with a nonsense result and code 0."""
    others = ("r_m2=2e6", "r_m3=2.6e6", "k_e=5e8", "f_f=50")
    fixed = [word for one in (f"r_m1={value}", *others) for word in ("--fix", one)]
    ended = run("identify", logs / "setting_01.csv", *fixed, "--free", "f_0")
    refused = f"r_m1 = {float(value):g} is fixed, far from any damper's; expected 10 to 1e+07"
    assert (refused in ended.err) is (code == 2)
    assert (ended.code == 2) is (code == 2)


@pytest.fixture
def drawn(undrawn, run, logs, tmp_path) -> Path:
    """Results with a page and figures, and two files of somebody else's."""
    done = run("identify", logs / "setting_0[12].csv", "--report", "--plots", "svg", "--quiet")
    assert done.code == 0
    folder = tmp_path / "results"
    (folder / "figures" / "my_notes.svg").write_text("mine")
    (folder / "notes.txt").write_text("mine")
    assert (folder / "report.html").exists()
    assert len(list((folder / "figures").glob("*.svg"))) > 10
    return folder


def test_a_folder_holds_one_run_only(run, logs, drawn) -> None:
    assert run("identify", logs / "setting_03.csv", "--quiet").code == 0
    assert not (drawn / "report.html").exists()
    assert [path.name for path in (drawn / "figures").iterdir()] == ["my_notes.svg"]
    assert (drawn / "notes.txt").exists()
    (drawn / "figures" / "my_notes.svg").unlink()
    assert run("identify", logs / "setting_03.csv", "--plots", "png", "--quiet").code == 0
    assert {path.suffix for path in (drawn / "figures").iterdir()} == {".png"}
    assert run("identify", logs / "setting_02.csv", "--quiet").code == 0
    assert not (drawn / "figures").exists()


@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="no links to devices there")
def test_results_that_cannot_be_written_are_still_shown(run, logs, monkeypatch, tmp_path) -> None:
    def full(*_args, **_how):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("damperfit.results.write_responses", full)
    ended = run("identify", logs / "setting_01.csv", "--report")
    assert ended.code == 1
    assert "No space left on device" in ended.err.splitlines()[-1]
    assert "excellent" in ended.out
    assert "results in results" not in ended.err
    assert not (tmp_path / "results").exists()  # nothing came to stand in it
    document = json.loads(run("identify", logs / "setting_01.csv", "--json").out)
    assert document["parameters"][0]["setting"] == 1
    configuration = load_configuration()
    (found,) = written(configuration, [str(logs / "setting_01.csv")])
    assert "No space left" in str(found.error)
    assert len(found.run.settings) == 1


def test_samples_leave_no_log_that_truth_does_not_know(run, tmp_path) -> None:
    few = ("--cycles", "3", "--quiet")
    assert run("samples", "s", "--settings", "1-3", *few).code == 0
    (tmp_path / "s" / "setting_09.csv").write_text("# rig: Bench 7\n")
    assert run("samples", "s", "--settings", "2", *few).code == 0
    names = sorted(path.name for path in (tmp_path / "s").iterdir())
    assert names == ["README.md", "setting_02.csv", "setting_09.csv", "truth.csv"]


def test_a_rig_without_temperature_is_not_failed_by_a_list(logs, tmp_path, capsys) -> None:
    rows = (logs / "setting_01.csv").read_text().splitlines()
    cut = [row if row.startswith("#") else row.rpartition(",")[0] for row in rows]
    (tmp_path / "cold_s1.csv").write_text("\n".join(cut) + "\n")
    log, out = str(tmp_path / "cold_s1.csv"), str(tmp_path / "r")
    config = tmp_path / "c.toml"
    config.write_text('[rig]\ntemperature_tolerance = inf\n[output]\nchecks = ["purdy2000"]\n')

    def missed(*more: str) -> str:
        capsys.readouterr()
        main(["identify", log, "--out", out, *more])
        return capsys.readouterr().err

    gate = "check not evaluated: temperature_in_window"
    told = missed("--check", "purdy2000")
    assert gate in told
    assert "rig.temperature_tolerance = inf" in told
    assert gate not in missed("--check", "purdy2000,-temperature_in_window")
    assert gate not in missed("--config", str(config))
    assert gate in missed("--config", str(config), "--check", "temperature_in_window")
