"""Logs to run commands on, and ways to run them."""

import os
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import pytest

from damperfit.cli import main
from damperfit.synthetic import SampleOptions, make_samples
from tests.kept_fits import _fits_are_kept, fits_anew, kept_fits  # noqa: F401


class Ended(NamedTuple):
    """What a command left behind."""

    code: int
    out: str
    err: str


@pytest.fixture
def fitted_anew():
    """Let nothing be taken from an earlier test."""
    with fits_anew():
        yield


@pytest.fixture(scope="session")
def logs(tmp_path_factory) -> Path:
    """Three short logs of a quiet rig, settings 1 to 3."""
    folder = tmp_path_factory.mktemp("logs")
    options = SampleOptions(
        settings=(1, 2, 3), cycles=7.0, force_noise=1.0, displacement_noise=2e-6
    )
    make_samples(folder, options)
    return folder


@pytest.fixture(scope="session")
def results(logs, tmp_path_factory) -> Path:
    """What `identify` wrote of these logs; copy it to change it."""
    folder = tmp_path_factory.mktemp("three") / "results"
    with kept_fits():
        assert main(["identify", str(logs / "setting_*.csv"), "--out", str(folder), "-q"]) == 0
    return folder


@pytest.fixture
def run(capsys, monkeypatch, tmp_path):
    """Run a command in this process, in an empty folder."""
    monkeypatch.chdir(tmp_path)

    def call(*arguments) -> Ended:
        capsys.readouterr()
        code = main([str(argument) for argument in arguments])
        seen = capsys.readouterr()
        return Ended(code, seen.out, seen.err)

    return call


@pytest.fixture
def undrawn(monkeypatch):
    """Figures by name alone: a second each, and how they look is held by test_figures.py."""
    monkeypatch.setattr(
        "damperfit.reporting.drawing.draw_plot", lambda path, *_, **__: path.touch()
    )


@pytest.fixture
def spawn(tmp_path):
    """Run a command as a process of its own, as a user does."""

    def call(*arguments, **how) -> Ended:
        environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}
        done = subprocess.run(
            [sys.executable, "-m", "damperfit", *map(str, arguments)],
            check=False,
            cwd=tmp_path,
            env=environment,
            capture_output=True,
            text=True,
            timeout=120,
            **how,
        )
        return Ended(done.returncode, done.stdout, done.stderr)

    return call
