"""A serial of a fleet taken as results: compared, reported, exported, asked and simulated."""

import json
from pathlib import Path

import pandas as pd
import pytest

import damperfit
from damperfit.cli.main import main
from damperfit.configuration.loading import load_configuration
from damperfit.errors import ConfigurationError
from damperfit.fleets.parts import parts_in
from damperfit.fleets.run import planned, run_fleet
from damperfit.results import Run
from tests.fleet.conftest import Here, put
from tests.fleet.test_fleet_command import here, run  # noqa: F401


def compared(capsys, *paths) -> dict:
    assert main(["compare", *map(str, paths), "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_a_serial_is_compared_as_its_results_folder_is(three, tmp_path, here, capsys):  # noqa: F811
    out, results = tmp_path / "out", tmp_path / "D1"
    assert run(three, "--out", out) == 0
    assert main(["identify", str(three / "D1"), "--out", str(results), "--quiet"]) == 0
    capsys.readouterr()
    (pair,) = compared(capsys, results, out / "serial-D1")["comparisons"]
    forces = [one for one in pair["lines"] if one["kind"] == "force"]
    assert {str(one["setting"]) for one in forces} == {"1", "10"}
    assert all(one["difference"] == pytest.approx(0.0, abs=1e-6) for one in forces)
    document = compared(capsys, out, out)
    assert len(document["comparisons"]) == 3


def test_several_tests_of_one_damper_are_told_apart(three, tmp_path, here):  # noqa: F811
    out = tmp_path / "out"
    run(three, "--out", out)
    part = parts_in(out)[0]
    (part.parent / "part-other.parquet").write_bytes(part.read_bytes())
    with pytest.raises(ConfigurationError, match=r"several tests of one damper; name one of"):
        Run.load(part.parent)
    assert len(Run.load(part).rows("parameters")) == 2


@pytest.fixture(scope="module")
def taken(tmp_path_factory, texts):
    """A fleet of one damper, and the results folder of the same logs."""
    folder = tmp_path_factory.mktemp("taken")
    put(folder / "logs" / "SN 1", texts)
    configuration = load_configuration(None)
    tasks = planned(configuration, [str(folder / "logs")], folder / "fleet")
    list(run_fleet(configuration, tasks, folder / "fleet", Here()))
    logs = str(folder / "logs" / "SN 1")
    assert main(["identify", logs, "--out", str(folder / "results"), "--quiet"]) == 0
    return folder / "results", folder / "fleet" / "serial-SN%201"


def test_a_page_of_one_damper_stands_beside_the_parts_and_they_are_read_as_before(taken, capsys):
    _, part = taken
    assert main(["report", str(part), "--json"]) == 0
    (page,) = map(Path, json.loads(capsys.readouterr().out)["files"])
    assert page == part.parent / "_reports" / part.name / "report.html"
    text = page.read_text()
    assert "Damper identification: SN 1" in text
    assert "2 settings fitted" in text
    assert "a part of a fleet keeps none" in text
    assert len(pd.read_parquet(part.parent)) == 2


def test_a_part_keeps_no_measured_cycles_and_says_where_they_are(taken, capsys):
    results, part = taken
    capsys.readouterr()
    assert main(["compare", str(part), str(results), "--measured"]) == 2
    assert capsys.readouterr().err == (
        f"damperfit: {part}: a part of a fleet keeps no measured cycles; give --measured the logs, "
        "or results of damperfit identify\n"
    )


def test_a_part_is_no_folder_that_the_door_loads(taken):
    _, part = taken
    with pytest.raises(ConfigurationError, match="is a part of a fleet, which keeps no more than"):
        damperfit.load(part)


def test_what_is_asked_of_a_part_is_that_of_the_results_folder(taken, tmp_path, capsys):
    told = []
    for place in taken:
        assert main(["settings", str(place), "--json"]) == 0
        forces = json.loads(capsys.readouterr().out)["forces"]
        assert main(["simulate", "--setting", "10", "--parameters", str(place), "--json"]) == 0
        said = capsys.readouterr()
        assert "does not say whose" not in said.err
        out = tmp_path / place.name
        assert main(["export", str(place), "--to", "csv", "--out", str(out), "--quiet"]) == 0
        simulated = json.loads(said.out)["characteristics"]
        told.append((forces, simulated, (out / "damper.csv").read_text()))
    assert told[0] == told[1]
    assert main(["export", str(taken[1]), "--to", "csv", "--quiet"]) == 0
    assert (taken[1].parent / "_export" / taken[1].name / "damper.csv").exists()
    assert not list(taken[1].glob("*.csv"))


def test_a_damaged_part_is_called_so(taken, tmp_path, capsys):
    (file,) = taken[1].glob("part-*.parquet")
    damaged = tmp_path / "serial-X" / file.name
    damaged.parent.mkdir()
    damaged.write_bytes(file.read_bytes()[:-9])
    for command in (["report"], ["settings"], ["export", "--to", "csv"]):
        assert main([command[0], str(damaged.parent), *command[1:]]) == 2
        assert "damaged" in capsys.readouterr().err
