"""What an earlier run left in a results folder: what goes when another run writes there."""

import json

import pytest

from damperfit.results import forget_figures, forget_others

BESIDE = "folders_of_this_run"


def results(folder, *, beside=None):
    """A folder as a run leaves it."""
    (folder / "figures").mkdir(parents=True)
    (folder / "figures" / "mse.png").write_bytes(b"drawn")
    (folder / "parameters.csv").write_text("setting\n1\n")
    (folder / "run.json").write_text(json.dumps({} if beside is None else {BESIDE: beside}))
    return folder


def test_one_damper_s_run_leaves_no_folders_of_several(tmp_path) -> None:
    for name in ("A1", "B_2"):
        results(tmp_path / name, beside=["A1", "B_2"])
    forget_others(tmp_path, [""])
    assert not list(tmp_path.iterdir())


def test_what_another_command_put_there_stays(tmp_path) -> None:
    results(tmp_path / "mine")
    results(tmp_path / "renamed", beside=["A1", "B_2"])
    (tmp_path / "broken").mkdir()
    (tmp_path / "broken" / "run.json").write_text("[")
    (tmp_path / "list").mkdir()
    (tmp_path / "list" / "run.json").write_text("[1]")
    kept = sorted(tmp_path.rglob("*"))
    forget_others(tmp_path, [""])
    assert sorted(tmp_path.rglob("*")) == kept


def test_what_else_a_folder_holds_stays(tmp_path) -> None:
    notes = results(tmp_path / "A1", beside=["A1"]) / "notes.txt"
    notes.write_text("mine")
    forget_others(tmp_path, [""])
    assert list(notes.parent.iterdir()) == [notes]


def test_other_dampers_folders_go_and_those_of_this_command_stay(tmp_path) -> None:
    results(tmp_path)
    for name in ("A1", "B_2"):
        results(tmp_path / name, beside=["A1", "B_2"])
    forget_others(tmp_path, ["B_2", "C3"])
    assert [path.name for path in tmp_path.iterdir()] == ["B_2"]
    assert (tmp_path / "B_2" / "run.json").exists()


@pytest.mark.parametrize(
    ("name", "goes"),
    [
        ("parameter_rebound_seat.png", True),
        ("setting_R12_C8_log_2_force_time.svg", True),
        ("setting_02_valves.pdf", True),
        ("my_force_time.png", False),
        ("mse.csv", False),
    ],
)
def test_figures_go_by_the_names_that_they_are_drawn_under(tmp_path, name, goes) -> None:
    (tmp_path / "figures").mkdir()
    (tmp_path / "figures" / name).write_bytes(b"drawn")
    forget_figures(tmp_path)
    assert (tmp_path / "figures" / name).exists() is not goes
