"""What holds for every test."""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

# How long an example takes says something of the machine, nothing of the code.
settings.register_profile("damperfit", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("damperfit")

BENCHMARKS = Path(__file__).parent / "benchmarks"


def pytest_ignore_collect(collection_path, config):
    """Leave the benchmarks out, unless the command line names them."""
    if collection_path != BENCHMARKS:
        return None
    asked = [Path(config.invocation_params.dir, arg.split("::")[0]) for arg in config.args]
    return None if any(BENCHMARKS in (path, *path.parents) for path in asked) else True


@pytest.fixture(scope="session")
def first_command(tmp_path_factory) -> tuple[Path, subprocess.CompletedProcess[str]]:
    """A folder with what the README's commands need after the first of them, and what it said."""
    root = Path(__file__).parents[1]
    (command,) = [
        line.partition(" && ")[2]
        for line in (root / "README.md").read_text(encoding="utf-8").splitlines()
        if line.startswith("    pip install . && ")
    ]
    folder = tmp_path_factory.mktemp("clone")
    shutil.copytree(root / "sample_runs", folder / "sample_runs")
    done = subprocess.run(
        [sys.executable, "-m", *shlex.split(command)],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(root)},
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    return folder, done


@pytest.fixture(scope="session")
def sample_results(first_command) -> Path:
    """The same folder, with `results` in it: copy it, for others read it too."""
    folder, done = first_command
    assert done.returncode == 0, done.stderr
    return folder


@pytest.fixture(scope="session", autouse=True)
def _each_steady_cycle_is_integrated_once():
    """Let make-believe logs of one damper share its steady cycle, a second of SciPy each."""
    from damperfit.samples import logs

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(logs, "steady_cycle", cache(logs.steady_cycle))
        yield
