"""Results of the twenty sample runs, and of three short logs that take less."""

import shutil
from pathlib import Path

import pytest

import damperfit
from damperfit.synthetic import SampleOptions, make_samples


@pytest.fixture(scope="session")
def results(sample_results) -> Path:
    return sample_results / "results"


@pytest.fixture(scope="session")
def fitted(results) -> damperfit.Run:
    return damperfit.load(results)


@pytest.fixture(scope="session")
def short(tmp_path_factory) -> Path:
    """A folder with a log of settings 1 and 2, and `results` of both with few values in error."""
    folder = tmp_path_factory.mktemp("short")
    quiet = {"force_noise": 1.0, "displacement_noise": 2e-6}
    make_samples(folder, SampleOptions(settings=(1, 2), cycles=7.0, **quiet))
    fewer = {"free": "r_m1,r_m2,k_e", "fix": {"r_m3": 2.597e6, "f_f": "50N"}}
    logs, how = [str(folder / "setting_*.csv")], {"procedure": "plain", **fewer}
    damperfit.identify(logs, **how, out=folder / "results")
    return folder


@pytest.fixture
def edited(short, tmp_path) -> Path:
    """A copy of these results to be edited."""
    return Path(shutil.copytree(short / "results", tmp_path / "edited"))
