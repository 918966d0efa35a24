"""A serial of a fleet taken as results, and all dampers told at one temperature."""

import json
from pathlib import Path

import pandas as pd
import pytest

import damperfit
from damperfit.arguments import covaried
from damperfit.cli.main import main
from damperfit.configuration.loading import load_configuration
from damperfit.errors import ConfigurationError
from damperfit.fleets.run import planned, run_fleet
from damperfit.results import Run
from tests.fakes import log_text
from tests.fleet.conftest import Here, put, run, table_of
from tests.run.test_temperature import BETA, COLD, WARM, known_at, recording


@pytest.fixture(scope="module")
def taken(tmp_path_factory, texts):
    """A fleet of one damper, and the results folder of the same logs."""
    folder = tmp_path_factory.mktemp("taken")
    logs = folder / "logs" / "SN 1"
    put(logs, texts)
    configuration = load_configuration(None)
    tasks = planned(configuration, [str(folder / "logs")], folder / "fleet")
    list(run_fleet(configuration, tasks, folder / "fleet", Here()))
    assert main(["identify", str(logs), "--out", str(folder / "results"), "--quiet"]) == 0
    return folder / "results", folder / "fleet" / "serial-SN%201"


def test_a_serial_is_asked_and_compared_as_its_results_folder_is(taken, tmp_path, capsys):
    def asked(*words: object, code: int = 0) -> dict:
        capsys.readouterr()
        assert main([*map(str, words), "--json"]) == code
        said = capsys.readouterr()
        assert "does not say whose" not in said.err
        return json.loads(said.out)

    told = []
    for place in taken:
        forces = asked("settings", place)["forces"]
        figures = asked("simulate", "--setting", 10, "--parameters", place)["characteristics"]
        asked("export", place, "--to", "csv", "--out", tmp_path / place.name)
        told.append((forces, figures, (tmp_path / place.name / "damper.csv").read_text()))
    assert told[0] == told[1]
    results, part = taken
    (pair,) = asked("compare", results, part)["comparisons"]
    forces = [one for one in pair["lines"] if one["kind"] == "force"]
    assert {str(one["setting"]) for one in forces} == {"1", "10"}
    assert all(one["difference"] == pytest.approx(0.0, abs=1e-6) for one in forces)
    assert len(asked("compare", part.parent, part.parent)["comparisons"]) == 1
    # What is written of a part stands beside the parts, which are read as before.
    asked("export", part, "--to", "csv")
    assert (part.parent / "_export" / part.name / "damper.csv").exists()
    (page,) = map(Path, asked("report", part)["files"])
    assert page == part.parent / "_reports" / part.name / "report.html"
    for words in ("SN 1", "2 settings fitted", "a part of a fleet keeps none"):
        assert words in page.read_text()
    assert len(pd.read_parquet(part)) == 2


def test_what_a_part_cannot_be_asked_is_said(taken, tmp_path, capsys):
    results, part = taken
    assert main(["compare", str(part), str(results), "--measured"]) == 2
    assert "keeps no measured cycles; give --measured the logs, or" in capsys.readouterr().err
    with pytest.raises(ConfigurationError, match="is a part of a fleet, which keeps no more than"):
        damperfit.load(part)
    (file,) = part.glob("part-*.parquet")
    folder = tmp_path / "serial-X"
    folder.mkdir()
    for name in (file.name, "part-other.parquet"):
        (folder / name).write_bytes(file.read_bytes())
    with pytest.raises(ConfigurationError, match=r"name one of part-.*\(no date\), part-"):
        Run.load(folder)
    assert main(["compare", str(tmp_path)]) == 0  # both tests of it, of a whole fleet
    assert "part-other.parquet" in "".join(capsys.readouterr().out.split())
    assert len(Run.load(folder / file.name).rows("parameters")) == 2
    (folder / "part-other.parquet").unlink()
    (folder / file.name).write_bytes(file.read_bytes()[:-9])
    for command in (["report"], ["settings"], ["export", "--to", "csv"]):
        assert main([command[0], str(folder), *command[1:]]) == 2
        assert "damaged" in capsys.readouterr().err


# ``--covariate temperature``

DAMPERS = {"D1": (COLD, WARM), "D2": (COLD + 4.0, WARM), "D3": (COLD, COLD + 0.2)}


def test_each_damper_tells_beta_and_all_are_told_at_one_temperature(tmp_path, here):
    for name, temperatures in DAMPERS.items():
        for temperature in temperatures:
            log, facts = recording(1, temperature), ("setting: 1", f"temperature: {temperature}")
            text = log_text(log.time, log.displacement, log.force, *facts)
            put(tmp_path / "logs" / name, {log.name: ("", text)})
    out = tmp_path / "fleet"
    options = ("--covariate", "temperature", "--collect", "--quiet")
    assert run(tmp_path / "logs", "--out", out, *options) == 1  # D3 has no two temperatures
    table = table_of(out).set_index("serial")
    for name in ("D1", "D2"):
        row = table.loc[name]
        assert row["reference_temperature_degC"] == 26.0  # not the mean of its logs
        assert abs(row["beta"] - BETA) < 4.0 * row["beta_se"] < 0.2 * BETA
        assert row["r_m3"] == pytest.approx(known_at(1, 26.0).r_m3, rel=0.02)
    assert "cannot be determined over less than 3 K" in table.loc["D3", "error"]
    for asked, there in ((None, 26), ("60degC", 60)):
        found = damperfit.settings(out / "serial-D1", temperature=asked)
        assert found.source.endswith(f" and {there} degC")


REFERENCE = '[damper]\nreference_temperature = "{}"\n'


@pytest.mark.parametrize(
    ("told", "of_fleet", "there"),
    [
        *(("", False, "mean"), ("", True, 26.0)),
        *((REFERENCE.format("40degC"), is_fleet, "40degC") for is_fleet in (False, True)),
        (REFERENCE.format("mean"), True, "mean"),
        *(("[rig]\ntemperature = 31.0\n", a, b) for a, b in ((True, 31.0), (False, "mean"))),
    ],
)
def test_a_temperature_that_the_file_names_stays(tmp_path, told, of_fleet, there) -> None:
    config = tmp_path / "rig.toml"
    config.write_text(told, encoding="utf-8")
    given = {"covariate": "temperature", "config": config}
    assert covaried("fleet", given, of_fleet=of_fleet) == there
