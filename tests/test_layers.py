"""Imports go one way, as pyproject.toml says, and what says so notices a breach."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
LINT = "from importlinter.cli import lint_imports_command; lint_imports_command()"


def lint(folder):
    command = [sys.executable, "-c", LINT, "--no-cache", "--no-logo"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    return done.returncode, done.stdout + done.stderr


@pytest.fixture
def copy(tmp_path):
    """The package alone, to be spoilt."""
    shutil.copytree(ROOT / "damperfit", tmp_path / "damperfit")
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    return tmp_path


def test_imports_go_one_way():
    code, said = lint(ROOT)
    assert code == 0, said
    assert "0 broken" in said


@pytest.mark.parametrize(
    ("module", "line", "complaint"),
    [
        (
            "recording.py",
            "from damperfit.configuration.loading import load_configuration",
            "Imports go one way BROKEN",
        ),
        pytest.param(
            "damper/purdy/reference.py",
            "import pandas",
            "Numerics know no tables",
            marks=pytest.mark.slow,
        ),
        pytest.param("stray.py", "", "stray", marks=pytest.mark.slow),
    ],
)
def test_a_breach_is_noticed(copy, module, line, complaint):
    path = copy / "damperfit" / module
    text = path.read_text(encoding="utf-8") if path.exists() else ""
    path.write_text(f"{text}\n{line}\n", encoding="utf-8")
    code, said = lint(copy)
    assert code == 1, said
    assert complaint in said
