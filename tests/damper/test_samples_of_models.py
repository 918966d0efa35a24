"""Made-up logs of models other than the paper's: what they hold is what truth.csv says."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from damperfit.cli import main
from damperfit.conditioning import condition
from damperfit.damper.model import MODELS
from damperfit.damper.valve_dampers import Monotube
from damperfit.errors import ConfigurationError
from damperfit.identification import compare, normalised_mse
from damperfit.io import read_log
from damperfit.synthetic import SampleOptions, make_samples
from damperfit.synthetic.any_model import made_up_values
from tests.test_every_model import TRUTH

SHORT = {"cycles": 5.0, "settings": (2, 15)}


def truth_in(folder: Path) -> dict[int, dict[str, float]]:
    with (folder / "truth.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    return {int(row.pop("setting")): {k: float(v) for k, v in row.items()} for row in rows}


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
    for setting in (1, 20):
        values = made_up_values(Monotube(), setting, 0.3)
        highest = values.compression_opening / 0.4
        assert highest <= 0.6 * Monotube().gas_pressure * (1.0 + 1e-12)


@pytest.mark.parametrize("kind", ["kwok", "bilinear", "surace_worden_tomlinson"])
def test_a_model_of_the_literature_needs_its_numbers(tmp_path: Path, kind: str) -> None:
    damper = MODELS[kind]()
    with pytest.raises(ConfigurationError, match="--parameters"):
        make_samples(tmp_path / "a", SampleOptions(damper=damper, settings=(1,), cycles=5.0))
    values = damper.values(TRUTH[kind])
    options = SampleOptions(damper=damper, settings=(1,), cycles=5.0, amplitude=0.02)
    (log,) = make_samples(tmp_path / "b", options, parameters={1: values})
    trace = condition(read_log(log))
    force = compare(values, trace, damper).force[trace.compared]
    assert normalised_mse(trace.force[trace.compared], force) < 0.1
    assert truth_in(tmp_path / "b") == {1: dict(zip(values.names, values.numbers, strict=True))}


def test_the_command_makes_logs_of_a_model(tmp_path: Path, capsys) -> None:
    command = ["samples", str(tmp_path / "a"), "--settings", "3", "--cycles", "4", "--quiet"]
    assert main([*command, "--model", "twin_tube"]) == 0
    assert set(truth_in(tmp_path / "a")[3]) == set(MODELS["twin_tube"]().names)
    assert main([*command, "--model", "no_such"]) == 2
    assert "no_such" in capsys.readouterr().err
