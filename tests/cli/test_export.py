"""damperfit export on the command line."""

import json

import pytest

from tests.report_folder import make_results


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    return make_results(tmp_path_factory.mktemp("export") / "results")


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
    ended = run("export", results, "--to", "carsim", "--out", tmp_path / "there", "--extend", "0.4")
    assert "note: on a class B road the damper's dynamics" in ended.err
    assert "the tables are untested" in ended.err
    assert ended.err.splitlines()[-1].startswith("note: force determined by the logs")
