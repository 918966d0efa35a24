"""A results folder of known numbers, no fit, and what is handed over of it."""

import fcntl
import json
import shutil
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from damperfit.damper.purdy.parameters import reference_parameters
from damperfit.exporting import fmu as libraries
from damperfit.exporting.fmu_build import build
from damperfit.exporting.targets import ExportedRun, exported_run
from damperfit.results import Run
from damperfit.tables.files import write_table
from tests.fakes import campaign, fit, make_tables

SETTINGS = (1, 10, 20)


def log_of(setting: int, speed: float = 0.30159) -> dict:
    """A log as run.json has it: a fast segment and a slow one."""
    fast = {"amplitude_m": 0.032, "frequency_Hz": 1.5, "peak_speed_m_per_s": speed}
    slow = {"amplitude_m": 0.01, "frequency_Hz": 0.5, "peak_speed_m_per_s": 0.0314}
    return {
        "log": f"setting_{setting:02d}.csv",
        "setting": setting,
        "temperature_degC": 25.0 + 0.1 * setting,
        "stretches": [one | {"kind": "steady"} for one in (fast, slow)],
    }


def told(handed: ExportedRun, **record: object) -> ExportedRun:
    """The same with other entries in run.json."""
    rows = {"parameters": handed.run.rows("parameters")}
    run = Run({**handed.run.record, **record}, rows, quantities=handed.run.quantities)
    return replace(handed, run=run)


@pytest.fixture(scope="session")
def results(tmp_path_factory) -> Path:
    """Settings 1, 10 and 20 of the reference set, as identify would have written them."""
    folder = tmp_path_factory.mktemp("handed") / "results"
    folder.mkdir()
    fits = [replace(fit(n), parameters=reference_parameters(n)) for n in SETTINGS]
    tables = make_tables(campaign(*fits))
    for suffix in (".parquet", ".csv"):
        write_table(folder / f"parameters{suffix}", tables["parameters"])
    record = {
        "version": "0.1.0",
        "schema_version": 2,
        "test": {"damper": "front left", "serial": 'A <7> & "8"', "rig": "synthetic"},
        "configuration": {"damper": {"model": "purdy", "gas_pressure": "4.6bara"}},
        "inputs": [log_of(n) for n in SETTINGS],
    }
    (folder / "run.json").write_text(json.dumps(record), encoding="utf-8")
    return folder


@pytest.fixture(scope="session")
def handed(results):
    return exported_run(results)


@pytest.fixture
def folder(results, tmp_path) -> Path:
    """A copy to be spoilt."""
    return Path(shutil.copytree(results, tmp_path / "results"))


@pytest.fixture(scope="session", autouse=True)
def _library_is_built() -> None:
    """Of these very sources, once, whichever worker comes first."""
    here = next(one for one in libraries.PLATFORMS if one.name == "x86_64-linux")
    if sys.platform != "linux" or here in libraries.built():
        return
    libraries.BINARIES.mkdir(exist_ok=True)
    with (libraries.BINARIES / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if here not in libraries.built():
            build(here)
