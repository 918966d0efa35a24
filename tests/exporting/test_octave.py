"""The script and the data file for MATLAB, run by Octave where it is installed."""

from __future__ import annotations

import os
import shutil
import subprocess

import numpy as np
import pytest

from damperfit.exporting import TARGETS, ExportOptions
from damperfit.exporting.tables import force_tables

pytestmark = pytest.mark.proof

_PRINT = """
printf('%.9g ', setting); printf('\\n%.9g\\n', interp2(setting, velocity, force, 10, 0.2));
printf('%.9g ', tested_speed, interp1(gas_displacement, gas_force, 0));
"""


@pytest.fixture
def octave(handed, tmp_path):
    """What Octave prints of a few commands beside the exported files."""
    program = shutil.which("octave-cli") or pytest.skip("Octave is not installed")
    for name, content in TARGETS["matlab"].export(handed, ExportOptions()).files.items():
        (tmp_path / name).write_bytes(content)

    def run(commands: str) -> str:
        done = subprocess.run(
            [program, "--no-init-file", "--quiet", "--eval", commands],
            cwd=tmp_path,
            env=os.environ | {"HOME": str(tmp_path)},
            capture_output=True,
            text=True,
            check=False,
            timeout=120,
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    return run


@pytest.mark.parametrize("load", ["run('damper.m');", "load('damper.mat');"])
def test_octave_looks_up_force_and_gas_force(handed, octave, load) -> None:
    printed = octave(load + _PRINT).splitlines()
    settings, force, rest = ([float(word) for word in row.split()] for row in printed)
    table = force_tables(handed)[1]
    assert settings == [1.0, 10.0, 20.0]
    assert force == pytest.approx([np.interp(0.2, table.speeds, table.forces)], rel=1e-7)
    gas = np.interp(0.0, table.gas_displacements, table.gas_forces)
    assert rest == pytest.approx([table.tested_speed, gas], rel=1e-7)


def test_the_data_file_says_of_what_it_is(octave) -> None:
    assert "column 2 of force: setting 10" in octave("load('damper.mat'); disp(about)")
