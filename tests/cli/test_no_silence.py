"""What cannot act, cannot be done or is not to be trusted is said, and one run stands alone."""

import json
import os
from pathlib import Path

import pytest

from damperfit.configuration.loading import load_configuration
from damperfit.run.identify import written

GIVEN = [
    word
    for name in ("r_m1=1.8e4", "r_m2=3.527e6", "r_m3=2.597e6", "k_e=365MPa", "f_f=50N")
    for word in ("--set", name)
]


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
