"""Synthetic logs."""

import csv
import dataclasses
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import butter, sosfilt

import damperfit.synthetic as logs_of_samples
from damperfit.conditioning import condition
from damperfit.damper.model import MODELS
from damperfit.damper.purdy.parameters import PURDY_DAMPER, reference_parameters
from damperfit.damper.valve_dampers import Monotube
from damperfit.errors import ConfigurationError, SimulationError
from damperfit.identification import compare, normalised_mse
from damperfit.io import read_log
from damperfit.synthetic import SampleOptions, made_up_values, make_samples, steady_cycle
from tests.oracles import model
from tests.oracles.golden import SET_M
from tests.quick_cycles import quick_cycle

CLEAN = SampleOptions(
    settings=(7,),
    force_noise=0.0,
    displacement_noise=0.0,
    force_resolution=0.0,
    displacement_resolution=0.0,
)


def read(path):
    """A log as its preamble lines and columns (SI but for the temperature)."""
    lines = path.read_text(encoding="utf-8").splitlines()
    preamble = [line for line in lines if line.startswith("#")]
    names = lines[len(preamble)].split(",")
    assert names == ["time_s", "displacement_mm", "force_N", "temperature_degC"]
    cells = [line.split(",") for line in lines[len(preamble) + 1 :]]
    rows = np.array(cells, dtype=float)
    time, displacement, force, temperature = rows.T
    return preamble, time, displacement / 1e3, force, temperature


def truth_in(folder: Path) -> dict[int, dict[str, float]]:
    with (folder / "truth.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    return {int(row.pop("setting")): {k: float(v) for k, v in row.items()} for row in rows}


by_radau = cache(steady_cycle)


def purdy_cycle(parameters):
    return by_radau(parameters, PURDY_DAMPER, amplitude=0.032, frequency=1.5)


@pytest.fixture
def by_scipy(monkeypatch):
    """Integrate as `damperfit samples` does."""
    monkeypatch.setattr(logs_of_samples, "steady_cycle", by_radau)


@pytest.mark.parametrize("setting", [1, pytest.param(20, marks=pytest.mark.slow)])
def test_steady_cycle_is_the_oracle_s(setting):
    """Two right-hand sides written apart: 1e-3 N at every phase, reversals included."""
    phases = np.arange(1200) / 1200
    time = np.concatenate([[0.0], (1 + phases) / 1.5])
    parameters = reference_parameters(setting)
    twin = model.solve(parameters, PURDY_DAMPER, model.sine(0.032, 1.5), time, rtol=1e-11)
    assert np.max(np.abs(purdy_cycle(parameters).force(phases) - twin.force[1:])) < 1e-3
    quick = quick_cycle(parameters, PURDY_DAMPER, amplitude=0.032, frequency=1.5)
    # What the other tests make their logs with: 2e-5 of the largest force.
    largest = np.max(np.abs(twin.force))
    assert np.max(np.abs(quick.force(phases) - twin.force[1:])) < 2e-5 * largest


def test_the_twenty_logs(tmp_path, monkeypatch):
    """15 cycles at 500 Hz in the project's dialect, small, each from another phase."""
    cycle = quick_cycle(reference_parameters(7), PURDY_DAMPER, amplitude=0.032, frequency=1.5)
    monkeypatch.setattr(logs_of_samples, "steady_cycle", lambda *_, **__: cycle)
    seen = []
    logs = make_samples(tmp_path, on_log=lambda path: seen.append(path.name))
    assert [log.name for log in logs] == [f"setting_{s:02d}.csv" for s in range(1, 21)] == seen
    rows = [log.read_text(encoding="utf-8").splitlines()[4] for log in logs]
    starts = [float(row.split(",")[1]) / 1e3 for row in rows]
    assert len(set(starts)) == 20
    assert np.ptp(starts) > 0.04
    preamble, time, x, force, temperature = read(logs[8])
    rig = "# rig: synthetic (damperfit samples)"
    assert preamble == ["# damperfit rig log", "# setting: 9", rig]
    np.testing.assert_allclose(time, np.arange(5000) / 500, rtol=0, atol=1e-12)
    assert np.max(np.abs(temperature - 26)) <= 1.0
    assert np.ptp(temperature) > 0.1
    assert 0.0319 < np.max(np.abs(x)) < 0.0321
    assert np.ptp(force) > 500
    assert logs[8].stat().st_size < 250_000
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {*seen, "README.md", "truth.csv"}


@pytest.mark.parametrize(
    "setting", [7, *(pytest.param(k, marks=pytest.mark.slow) for k in (1, 20))]
)
def test_logs_in_the_repository_are_what_samples_writes(by_scipy, tmp_path, setting):
    """To one step of the log, which is what another machine's rounding may move."""
    stored = Path(__file__).parents[2] / "sample_runs"
    [log] = make_samples(tmp_path, SampleOptions(settings=(setting,)))
    ours, theirs = read(log), read(stored / log.name)
    assert ours[0] == theirs[0]
    for mine, other, step in zip(ours[1:], theirs[1:], (0.0, 1e-6, 0.1, 0.1), strict=True):
        assert np.max(np.abs(mine - other)) <= step * (1 + 1e-6)
    made = (tmp_path / "truth.csv").read_text(encoding="utf-8").splitlines()
    kept = (stored / "truth.csv").read_text(encoding="utf-8").splitlines()
    assert len(kept) == 21
    assert set(made) <= set(kept)


def test_noise_and_steps_are_as_asked(tmp_path):
    noisy = SampleOptions(settings=(7,))
    [clean_log], [log] = make_samples(tmp_path / "a", CLEAN), make_samples(tmp_path / "b", noisy)
    _, _, x, force, _ = read(clean_log)
    _, _, noisy_x, noisy_force, _ = read(log)
    for gap, rms in ((noisy_force - force, 4.0), (noisy_x - x, 8e-6)):
        assert np.std(gap) == pytest.approx(rms, rel=0.05)
        assert abs(np.mean(gap)) < 4 * rms / np.sqrt(5000)
        correlation = np.corrcoef(gap[1:], gap[:-1])[0, 1]
        assert abs(correlation) < 0.06
    assert np.max(np.abs(noisy_force * 10 - np.round(noisy_force * 10))) < 1e-9
    assert np.max(np.abs(noisy_x * 1e6 - np.round(noisy_x * 1e6))) < 1e-7


def test_rig_filter_is_a_causal_butterworth_on_both_channels(tmp_path):
    """Against the same filter run over 30 000 samples a cycle for three cycles."""
    options = dataclasses.replace(CLEAN, rig_filter=30.0)
    [log] = make_samples(tmp_path, options)
    _, _, x, force, _ = read(log)
    [plain] = make_samples(tmp_path / "plain", CLEAN)
    plain_x = read(plain)[2]
    phase = np.arctan2(
        plain_x[0], (plain_x[1] - plain_x[0] * np.cos(6e-3 * np.pi)) / np.sin(6e-3 * np.pi)
    )
    per_cycle, run_in = 30_000, 3
    grid = phase / (2 * np.pi) + (np.arange(5 * per_cycle) - run_in * per_cycle) / per_cycle
    cycle = purdy_cycle(reference_parameters(7))
    sections = butter(4, 30.0, fs=1.5 * per_cycle, output="sos")
    for channel, found, bar in ((cycle.displacement, x, 1e-7), (cycle.force, force, 0.02)):
        slow = sosfilt(sections, channel(grid))[run_in * per_cycle :: 90]
        assert np.max(np.abs(found[: len(slow)] - slow)) < bar


@pytest.mark.parametrize(
    "change",
    [
        {"cycles": 0.0}, {"sample_rate": float("nan")}, {"force_noise": -1.0}, {"settings": ()},
        {"displacement_resolution": float("inf")}, {"settings": (3, 3)}, {"amplitude": 0.14},
        {"rig_filter": 300.0}, {"seed": -1},
    ],
)  # fmt: skip
def test_options_that_make_no_log_are_refused(change):
    with pytest.raises(ConfigurationError, match=next(iter(change)).replace("_", ".")):
        dataclasses.replace(CLEAN, **change)


def test_what_cannot_be_made_leaves_nothing(tmp_path):
    tight = dataclasses.replace(PURDY_DAMPER, gas_length=0.005)
    with pytest.raises(ConfigurationError, match=r"no parameters given for settings \[7\]"):
        make_samples(tmp_path, CLEAN, parameters={1: SET_M})
    with pytest.raises(ConfigurationError, match="1 to 20"):
        make_samples(tmp_path, dataclasses.replace(CLEAN, settings=(21,)))
    with pytest.raises(SimulationError, match="gas"):
        make_samples(tmp_path, dataclasses.replace(CLEAN, damper=tight))
    assert list(tmp_path.iterdir()) == []


# Made-up logs of models other than the paper's: what they hold is what truth.csv says.

SHORT = {"cycles": 5.0, "settings": (2, 15)}


@pytest.mark.parametrize("name", ["twin_tube", "monotube", "through_flow"])
def test_the_truth_simulates_the_logs_of_valves(tmp_path: Path, name: str) -> None:
    damper = MODELS[name]()
    logs = make_samples(tmp_path, SampleOptions(damper=damper, **SHORT))
    truth = truth_in(tmp_path)
    peaks = []
    for log, (setting, values) in zip(logs, truth.items(), strict=True):
        trace = condition(read_log(log))
        assert trace.setting == setting
        force = compare(damper.values(values), trace, damper).force[trace.compared]
        assert normalised_mse(trace.force[trace.compared], force) < 0.01
        peaks.append(float(np.max(trace.force[trace.compared])))
    assert peaks[1] > 1.5 * peaks[0]  # stiffer from setting to setting
    readme = (tmp_path / "README.md").read_text()
    assert f"Model: {name}" in readme
    assert "Radau" not in readme


def test_a_monotube_does_not_run_empty_in_bump() -> None:
    values = made_up_values(Monotube(), 20, 0.3)
    assert values.compression_opening / 0.4 <= 0.6 * Monotube().gas_pressure * (1.0 + 1e-12)
