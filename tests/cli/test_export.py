"""What stands where export, simulate and sweep write is replaced only where it is their own."""

import json

import pytest

from damperfit.exporting import TARGETS
from tests.report_folder import make_results

SIMULATE = ("simulate", "--setting", "10", "--cycles", "1", "-q")
SWEEP = ("sweep", "--setting", "10", "--vary", "f_f=1,2", "-q")


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    return make_results(tmp_path_factory.mktemp("over") / "results")


@pytest.mark.parametrize("target", sorted(TARGETS))
def test_an_earlier_export_is_replaced_and_another_file_is_not(
    run, results, tmp_path, target
) -> None:
    export = ("export", results, "--to", target, "--out", "there", "-q")
    assert run(*export).code in (0, 1)
    assert run(*export).code in (0, 1)
    for path in (tmp_path / "there").iterdir():
        path.write_text("kept by hand\n")
        ended = run(*export)
        assert ended.code == 2
        assert f"{path.name}: is there already" in ended.err
        assert path.read_text() == "kept by hand\n"
        assert run(*export, "--overwrite").code in (0, 1)
        assert path.read_bytes() != b"kept by hand\n"


@pytest.mark.parametrize(
    ("option", "name"),
    [("--out", "a.csv"), ("--out", "a.parquet"), ("--plot", "a.png"), ("--plot", "a.svg"),
     ("--plot", "a.pdf")],
)  # fmt: skip
def test_a_simulation_is_replaced_and_another_file_is_not(run, tmp_path, option, name) -> None:
    assert run(*SIMULATE, option, name).code == 0
    assert run(*SIMULATE, option, name).code == 0
    (tmp_path / name).write_text("time_s,displacement_mm,force_N\n0,0,0\n")
    ended = run(*SIMULATE, option, name)
    assert ended.code == 2
    assert "--overwrite" in ended.err
    assert (tmp_path / name).read_text().startswith("time_s,displacement_mm")
    assert run(*SIMULATE, option, name, "--overwrite").code == 0


def test_a_sweep_is_replaced_and_another_file_is_not(run, tmp_path) -> None:
    assert run(*SWEEP).code == 0
    assert run(*SWEEP).code == 0
    (tmp_path / "sweep" / "sweep.csv").write_text("a,b,c\n")
    ended = run(*SWEEP)
    assert ended.code == 2
    assert "sweep.csv: is there already" in ended.err
    assert run(*SWEEP, "--overwrite").code == 0


# damperfit export on the command line.


def test_a_folder_is_made_and_a_file_keeps_its_name(run, results, tmp_path) -> None:
    for out, expected in (("new/folder", "new/folder/damper.csv"), ("front.csv", "front.csv")):
        ended = run("export", results, "--to", "csv", "--out", tmp_path / out, "--json")
        assert json.loads(ended.out)["files"][0] == str(tmp_path / expected)
        assert (tmp_path / expected).read_text().startswith("setting,")


def test_remarks_end_with_one_and_are_told(run, results) -> None:
    ended = run("export", results, "--to", "csv", "--out", "there")
    assert ended.code == 1
    assert "the damper of the run is not known" in ended.err


def test_what_a_table_loses_is_told(run, results, tmp_path) -> None:
    ended = run(
        "export",
        results,
        "--to",
        "carsim",
        "--out",
        tmp_path / "there",
        "--extend",
        "0.4",
    )
    assert "on a class B road" in ended.err
    assert "the tables are untested" in ended.err
    assert ended.err.splitlines()[-1].startswith("note: force determined by the logs")
