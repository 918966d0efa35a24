"""The command line is there at once: no numerical library is loaded before a command runs."""

from __future__ import annotations

import subprocess
import sys

import pytest

import damperfit

HEAVY = ("numpy", "scipy", "pandas", "pyarrow", "matplotlib", "pydantic", "plotly")
CLI = [sys.executable, "-m", "damperfit"]


def run(command):
    return subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)


@pytest.mark.parametrize("module", ["damperfit", "damperfit.errors", "damperfit.cli"])
def test_importing_loads_no_heavy_library(module):
    script = f"import sys, {module}; print(*(n for n in {HEAVY!r} if n in sys.modules))"
    done = run([sys.executable, "-c", script])
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == []


def test_asking_for_help_loads_no_heavy_library():
    done = run([sys.executable, "-X", "importtime", "-m", "damperfit", "--help"])
    assert done.returncode == 0, done.stderr
    loaded = {line.split("|")[-1].strip().split(".")[0] for line in done.stderr.splitlines()}
    assert "typer" in loaded  # else the report was not understood
    assert loaded.isdisjoint(HEAVY)


def test_help_names_every_command():
    done = run([*CLI, "--help"])
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    for command in ("identify", "simulate", "samples", "config"):
        assert command in done.stdout


@pytest.mark.parametrize("command", ["identify", "simulate", "samples", "config"])
def test_every_command_explains_itself(command):
    done = run([*CLI, command, "--help"])
    assert done.returncode == 0, done.stderr
    assert f"damperfit {command}" in done.stdout


def test_version_is_that_of_the_package():
    done = run([*CLI, "--version"])
    assert done.returncode == 0, done.stderr
    assert done.stdout == f"damperfit {damperfit.__version__}\n"


def test_the_script_is_installed():
    import importlib.metadata

    (script,) = importlib.metadata.entry_points(group="console_scripts", name="damperfit")
    assert script.value == "damperfit.cli:main"
    assert importlib.metadata.version("damperfit") == damperfit.__version__
