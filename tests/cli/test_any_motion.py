"""Speed steps in one file through the commands: a table of stretches, the fastest speed."""

import json

import numpy as np
import pytest

from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.simulation import Motion, simulate
from tests.oracles.motions import MOTIONS


@pytest.fixture(scope="module")
def steps(tmp_path_factory):
    """Two settings, each 0.05 to 0.3 m/s in one file; the second is 8 % harder."""
    folder = tmp_path_factory.mktemp("steps")
    drive = MOTIONS["steps"]()
    time = np.arange(round(1000.0 * drive.duration)) / 1000.0
    x, v = (np.array([f(t) for t in time]) for f in (drive.displacement, drive.velocity))
    force = simulate(reference_parameters(10), PURDY_DAMPER, Motion(1e-3, x, v)).force
    random = np.random.default_rng(1)
    for setting, factor in ((10, 1.0), (11, 1.08)):
        f = factor * (force + 130.0) - 130.0 + 4.0 * random.standard_normal(len(x))
        rows = np.column_stack([time, 1e3 * x + 3e-3 * random.standard_normal(len(x)), f])
        np.savetxt(
            folder / f"setting_{setting}.csv",
            rows,
            fmt=("%.3f", "%.4f", "%.2f"),
            delimiter=",",
            header="time_s,displacement_mm,force_N",
            comments="",
        )
    return folder


def test_inspect_shows_the_stretches(steps, run):
    told = run("inspect", steps / "setting_10.csv")
    assert told.code == 0
    table = told.out.split("segments")[1].split("\n\n")[0].splitlines()[2:]
    assert len(table) == 4
    document = json.loads(run("inspect", steps / "setting_10.csv", "--json").out)
    stretches = document["logs"][0]["stretches"]
    speeds = [one["peak_speed_m_per_s"] for one in stretches]
    assert speeds == pytest.approx([0.05, 0.1, 0.2, 0.3], rel=0.01)
    assert all(one["peak_force_rebound_N"] > 0.0 > one["peak_force_bump_N"] for one in stretches)


def test_settings_use_the_fastest_speed_that_was_run(steps, run, tmp_path):
    out = tmp_path / "results"
    told = run("identify", steps / "setting_10.csv", "--out", out, "--procedure", "plain")
    assert told.code == 0, told.err
    inside = run("settings", out, "--velocity", "0.29m/s")
    assert inside.code == 0
    assert "never tested" not in inside.err
    beyond = run("settings", out, "--velocity", "0.31m/s")
    assert beyond.code == 0
    assert "0.31 m/s was never tested at setting 10 (tested: up to 0.3 m/s)" in beyond.err
