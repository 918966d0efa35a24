"""The table of targets, and what stands in it."""

from __future__ import annotations

import csv
import io

import numpy as np
import pytest

from damperfit.errors import ConfigurationError
from damperfit.handover import TARGETS, ExportOptions, find_target


def test_every_target_says_units_sign_and_place() -> None:
    for name, target in TARGETS.items():
        assert target.name == name
        assert all((target.title, target.units, target.sign, target.place))
        assert "{stem}" in target.file


@pytest.mark.parametrize("name", sorted(TARGETS))
def test_every_target_writes_files_of_its_pattern(name, handed) -> None:
    target = TARGETS[name]
    files = target.write(handed, ExportOptions(stem="front"))
    slugs = [one.setting.slug for one in handed.settings]
    patterns = target.file.split(", ")
    possible = {one.format(stem="front", setting=slug) for slug in slugs for one in patterns}
    beside = {one.format(stem="front") for one in target.beside}
    assert set(files) - beside == possible
    assert all(files.values())


def test_an_unknown_target_is_refused_with_a_hint() -> None:
    with pytest.raises(ConfigurationError, match=r"csw: expected one of .*csv"):
        find_target("csw")


def test_force_by_setting_and_speed(handed) -> None:
    text = TARGETS["csv"].write(handed, ExportOptions())["damper.csv"].decode()
    rows = list(csv.DictReader(io.StringIO(text)))
    assert {row["setting"] for row in rows} == {"1", "10", "20"}
    mine = [row for row in rows if row["setting"] == "10"]
    v = np.array([float(row["speed_m_per_s"]) for row in mine])
    force = np.array([float(row["force_N"]) for row in mine])
    assert len(v) == 61
    assert (np.diff(v) > 0.0).all()
    assert (v[30], force[30]) == (0.0, 0.0)
    # Rebound is positive and the stiffer stroke; friction stays in, the gas is out.
    assert force[-1] == pytest.approx(1687.0, abs=30.0)
    assert force[0] == pytest.approx(-1217.0, abs=30.0)
    assert force[31] > 50.0
    assert force[29] < -50.0
