"""What an earlier run left in a results folder: what goes when another run writes there."""

import json

import pytest

from damperfit.tables.files import forget_others

BESIDE = ["A1", "B_2"]


def results(folder, record='{"folders_of_this_run": ["A1", "B_2"]}'):
    """A folder as a run leaves it."""
    (folder / "figures").mkdir(parents=True)
    (folder / "figures" / "mse.png").write_bytes(b"drawn")
    (folder / "parameters.csv").write_text("setting\n1\n")
    (folder / "run.json").write_text(record)


@pytest.mark.parametrize(("kept", "left"), [([""], []), (["B_2", "C3"], ["B_2"])])
def test_folders_of_several_dampers_go_and_what_another_command_put_there_stays(
    tmp_path, kept, left
) -> None:
    for name in BESIDE:
        results(tmp_path / name)
    for name, record in {"mine": "{}", "broken": "[", "list": "[1]"}.items():
        results(tmp_path / name, record)
    results(tmp_path / "renamed")
    (tmp_path / "A1" / "notes.txt").write_text("mine")
    forget_others(tmp_path, kept)
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {"mine", "broken", "list", "renamed", "A1", *left}
    assert [path.name for path in (tmp_path / "A1").iterdir()] == ["notes.txt"]
    for name in ("mine", "renamed", *left):
        assert json.loads((tmp_path / name / "run.json").read_text()) is not None
