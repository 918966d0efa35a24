"""A serial of a fleet beside another: a part is a run to compare."""

from __future__ import annotations

import json

import pytest

from damperfit.cli.main import main
from damperfit.errors import ConfigurationError
from damperfit.fleet.parts import parts_in
from damperfit.queries.fleet_part import read_part
from tests.fleet.test_fleet_command import here, run  # noqa: F401


def compared(capsys, *paths) -> dict:
    assert main(["compare", *map(str, paths), "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_a_serial_is_compared_as_its_results_folder_is(three, tmp_path, here, capsys):  # noqa: F811
    out, results = tmp_path / "out", tmp_path / "D1"
    assert run(three, "--out", out) == 0
    assert main(["identify", str(three / "D1"), "--out", str(results), "--quiet"]) == 0
    capsys.readouterr()
    (pair,) = compared(capsys, results, out / "serial=D1")["comparisons"]
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
        read_part(part.parent)
    assert len(read_part(part).parameters) == 2
