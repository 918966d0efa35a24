"""A logged velocity is read where it is one, and never keeps a log from being read."""

from __future__ import annotations

import numpy as np
import pytest

from damperfit.errors import ConfigurationError
from damperfit.io import ReadOptions, read_log


def _log(tmp_path, name, values, *, other="temperature_degC,"):
    lines = [f"{other}time_s,displacement_mm,force_N,{name}"]
    lines += [
        f"{'26,' if other else ''}{0.01 * i:.2f},{i},{10 * i},{value}"
        for i, value in enumerate(values)
    ]
    path = tmp_path / "log_s1.csv"
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.mark.parametrize(
    ("name", "factor"),
    [
        ("velocity_mm/s", 1e-3),
        ("Velocity (m/s)", 1.0),
        ("Axial Velocity (in/s)", 0.0254),
        ("v (cm/s)", 0.01),
        ("speed [m/s]", 1.0),
    ],
)
def test_names_and_units(tmp_path, name, factor) -> None:
    log = read_log(_log(tmp_path, name, [1.0, 2.0, -3.5]))
    assert log.velocity == pytest.approx(factor * np.array([1.0, 2.0, -3.5]))
    assert log.temperature is not None


@pytest.mark.parametrize(
    ("name", "values", "note"),
    [
        ("velocity", [1.0, 2.0, 3.0], "velocity: left out; it has no unit"),
        ("speed (rpm)", [90, 90, 90], "velocity: left out; column 'speed (rpm)'"),
        ("velocity_m/s", [1.0, "nan", 3.0], "velocity: left out; 1 of 3 values are missing"),
        ("velocity_m/s,speed_m/s", ["1,1", "2,2", "3,3"], "velocity: left out; it could be column"),
    ],
)
def test_a_velocity_that_is_none_is_left_out_aloud(tmp_path, name, values, note) -> None:
    log = read_log(_log(tmp_path, name, values))
    assert log.velocity is None
    assert any(note in one for one in log.notes), log.notes
    assert log.force.tolist() == [0.0, 10.0, 20.0]


def test_it_can_be_declared(tmp_path) -> None:
    path = _log(tmp_path, "CH3", [1.0, 2.0, 3.0])
    options = ReadOptions(columns={"velocity": "CH3"}, units={"velocity": "mm/s"})
    assert read_log(path, options).velocity == pytest.approx([1e-3, 2e-3, 3e-3])


def test_what_was_declared_of_signs_goes_with_the_log(tmp_path) -> None:
    path = _log(tmp_path, "velocity_m/s", [1.0, 2.0, 3.0])
    nobody = read_log(path)
    assert (nobody.reverse_force, nobody.reverse_displacement) == (None, None)
    said = read_log(path, ReadOptions(reverse_force=True, reverse_displacement=False))
    assert (said.reverse_force, said.reverse_displacement) == (True, False)
    assert said.force.tolist() == [-0.0, -10.0, -20.0]
    assert said.velocity.tolist() == [1.0, 2.0, 3.0]  # as logged
    with pytest.raises(ConfigurationError, match="reverse_force: found 'yes', expected true"):
        ReadOptions(reverse_force="yes")
