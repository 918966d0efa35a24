"""identify --hold-out: what is not fitted is predicted, and told everywhere."""

import csv
import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.simulation import Motion, simulate
from damperfit.synthetic import SampleOptions, make_samples

FORCE = {"force_noise": 1.0, "displacement_noise": 2e-6, "cycles": 7.0}


@pytest.fixture(scope="module")
def two_amplitudes(tmp_path_factory) -> Path:
    """Settings 1 and 2 at 32 mm and at 16 mm."""
    folder = tmp_path_factory.mktemp("two_amplitudes")
    for amplitude in (32, 16):
        made = folder / str(amplitude)
        options = SampleOptions(settings=(1, 2), amplitude=1e-3 * amplitude, **FORCE)
        make_samples(made, options)
        for setting in (1, 2):
            name = f"setting_{setting:02d}_{amplitude}mm.csv"
            shutil.move(made / f"setting_{setting:02d}.csv", folder / name)
    return folder


def rows(name: str) -> list[dict[str, str]]:
    with Path("results", name).open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_held_out_logs_are_predicted_and_told_everywhere(run, two_amplitudes):
    ended = run("identify", f"{two_amplitudes}/*.csv", "--hold-out", "*_16mm.csv")
    assert ended.code == 0
    assert "setting_01_16mm.csv" in ended.out
    assert "predicted as well as fitted" in ended.out
    mse = rows("mse.csv")
    assert [(row["setting"], row["log"], row["role"]) for row in mse] == [
        ("1", "", "fitted"),
        ("1", "setting_01_32mm.csv", "fitted"),
        ("1", "setting_01_16mm.csv", "held_out"),
        ("2", "", "fitted"),
        ("2", "setting_02_32mm.csv", "fitted"),
        ("2", "setting_02_16mm.csv", "held_out"),
    ]
    report = Path("results/report.md").read_text(encoding="utf-8")
    assert "## Held out: predicted, not fitted" in report
    assert r"| 1 | setting_01_16mm.csv | all | 16.0 | 1.50 |" in report
    record = json.loads(Path("results/run.json").read_text(encoding="utf-8"))
    first = record["held_out"][0]
    assert (first["setting"], first["log"], first["cycles"]) == (1, "setting_01_16mm.csv", "all")
    assert first["amplitude_m"] == pytest.approx(0.016, rel=1e-3)
    assert first["mse_percent"] == pytest.approx(float(mse[2]["mse_percent"]))
    assert first["verdict"] == "predicted as well as fitted"
    assert len(record["inputs"]) == 4
    # The parameters are those of the other logs alone.
    with_them = rows("parameters.csv")
    assert run("identify", f"{two_amplitudes}/*_32mm.csv").code == 0
    assert rows("parameters.csv") == with_them
    assert json.loads(Path("results/run.json").read_text(encoding="utf-8"))["held_out"] == []


def test_cycles_are_held_out_and_counted(run, logs):
    ended = run("identify", f"{logs}/*.csv", "--hold-out-cycles", "2")
    assert ended.code == 0
    assert "last 2" in ended.out
    held, whole = rows("mse.csv"), rows("parameters.csv")
    assert [row["role"] for row in held] == ["fitted", "fitted", "held_out"] * 3
    assert run("identify", f"{logs}/*.csv").code == 0
    for before, after in zip(rows("parameters.csv"), whole, strict=True):
        assert int(after["n_cycles"]) == int(before["n_cycles"]) - 2
        assert after["r_m1"] != before["r_m1"]


def test_a_setting_that_is_only_held_out_is_a_failure_of_that_log(run, two_amplitudes):
    ended = run("identify", f"{two_amplitudes}/*.csv", "--hold-out", "setting_01*.csv")
    assert ended.code == 1
    assert (
        "setting_01_16mm.csv: held out, but cannot be predicted: setting 1 has no fit" in ended.err
    )
    assert [row["setting"] for row in rows("parameters.csv")] == ["2"]


def test_segments_are_held_out_by_frequency_or_speed(run, two_speeds):
    ended = run("identify", two_speeds, "--hold-out", "0.4m/s-")
    assert ended.code == 0
    fitted, held = [row for row in rows("mse.csv") if row["log"]]
    assert (fitted["role"], held["role"]) == ("fitted", "held_out")
    assert float(fitted["n_samples"]) == pytest.approx(10 * 500 / 1.5, rel=0.01)  # 10 cycles
    assert float(held["n_samples"]) > 3000
    assert float(held["mse_percent"]) < 0.05  # noise at one speed decides which verdict
    by_frequency = run("identify", two_speeds, "--hold-out", "2.5Hz-10Hz", "--out", "other")
    assert by_frequency.code == 0
    assert Path("other/mse.csv").read_text() == Path("results/mse.csv").read_text()


@pytest.fixture(scope="module")
def two_speeds(tmp_path_factory) -> Path:
    """Setting 1 at 1.5 and at 3 Hz in one record."""
    t = np.arange(8000) / 500.0
    turns = np.where(t < 8.0, 1.5 * t, 12.0 + 3.0 * (t - 8.0))
    x = 0.032 * np.sin(2.0 * np.pi * turns)
    v = np.gradient(x, t)
    motion = Motion(1.0 / 500.0, x, v)
    force = simulate(reference_parameters(1), PURDY_DAMPER, motion).force
    random = np.random.default_rng(1)
    path = tmp_path_factory.mktemp("two_speeds") / "setting_1.csv"
    columns = (t, 1e3 * x, force + random.standard_normal(len(force)))
    np.savetxt(
        path,
        np.column_stack(columns),
        "%.5f",
        ",",
        header="time_s,displacement_mm,force_N",
        comments="",
    )
    return path
