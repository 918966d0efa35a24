"""``damperfit fleet --covariate temperature``: all dampers told at one temperature."""

from pathlib import Path

import pandas as pd
import pytest

import damperfit
from damperfit.arguments import covaried
from damperfit.cli.main import main
from tests.fleet.test_fleet_command import Here
from tests.run.test_temperature import BETA, COLD, WARM, known_at, recording

DAMPERS = {"D1": (COLD, WARM), "D2": (COLD + 4.0, WARM), "D3": (COLD, COLD + 0.2)}


@pytest.fixture(scope="module")
def fleet(tmp_path_factory):
    """Two dampers that were tested cold and warm, and one that was not."""
    folder = tmp_path_factory.mktemp("fleet")
    for name, temperatures in DAMPERS.items():
        (folder / "logs" / name).mkdir(parents=True)
        for temperature in temperatures:
            one = recording(1, temperature)
            rows = zip(one.time, 1e3 * one.displacement, one.force, strict=True)
            lines = ["# setting: 1", f"# temperature: {temperature}"]
            lines.append("time_s,displacement_mm,force_N")
            lines += [f"{t:.4f},{x:.5f},{f:.3f}" for t, x, f in rows]
            path = folder / "logs" / name / one.name
            path.write_text("\n".join([*lines, ""]), encoding="utf-8")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("damperfit.workers.Processes", Here)
        code = main(
            [
                *("fleet", str(folder / "logs"), "--out", str(folder / "fleet"), "--quiet"),
                *("--covariate", "temperature", "--collect"),
            ]
        )
    assert code == 1  # D3 has no two temperatures
    return folder / "fleet"


def test_each_damper_tells_beta_and_all_are_told_at_one_temperature(fleet: Path) -> None:
    table = pd.read_parquet(fleet / "_fleet" / "fleet.parquet").set_index("serial")
    for name in ("D1", "D2"):
        row = table.loc[name]
        assert row["reference_temperature_degC"] == 26.0  # not the mean of its logs
        assert abs(row["beta"] - BETA) < 4.0 * row["beta_se"] < 0.2 * BETA
        assert row["r_m3"] == pytest.approx(known_at(1, 26.0).r_m3, rel=0.02)
    assert "cannot be determined over less than 3 K" in table.loc["D3", "error"]


def test_a_part_is_asked_for_at_another_temperature(fleet: Path) -> None:
    cold, warm = (
        damperfit.settings(fleet / "serial-D1", temperature=asked) for asked in (None, "60degC")
    )
    assert cold.source.endswith(" and 26 degC")
    assert warm.source.endswith(" and 60 degC")


@pytest.mark.parametrize(
    ("told", "of_fleet", "there"),
    [
        ("", False, "mean"),
        ("", True, 26.0),
        ('[damper]\nreference_temperature = "40degC"\n', False, "40degC"),
        ('[damper]\nreference_temperature = "40degC"\n', True, "40degC"),
        ('[damper]\nreference_temperature = "mean"\n', True, "mean"),
        ("[rig]\ntemperature = 31.0\n", True, 31.0),
        ("[rig]\ntemperature = 31.0\n", False, "mean"),
    ],
)
def test_a_temperature_that_the_file_names_stays(tmp_path, told, of_fleet, there) -> None:
    config = tmp_path / "rig.toml"
    config.write_text(told, encoding="utf-8")
    given = {"covariate": "temperature", "config": config}
    found = covaried("fleet", given, of_fleet=of_fleet)
    assert found == there
