"""What a run leaves alone in a results folder, and what must go; how its logs were labelled."""

from __future__ import annotations

import pytest

TWO = '[adjusters]\nrebound = ""\ncompression = ""\n'


@pytest.fixture
def one_log(logs, tmp_path):
    """The text of a short log that says nothing of itself."""
    lines = (logs / "setting_01.csv").read_text().splitlines()
    return "\n".join(x for x in lines if "setting" not in x) + "\n"


def listed(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}


def test_a_run_that_fits_nothing_keeps_the_earlier_results(run, one_log, tmp_path):
    good, bad = tmp_path / "setting_01.csv", tmp_path / "setting_02.csv"
    good.write_text(one_log)
    bad.write_text("nothing\n")
    first = run("identify", bad, "--out", "out")
    assert first.code == 3
    assert "1 failed; results in out" in first.err
    assert run("identify", good, "--out", "out").code == 0
    before = listed(tmp_path / "out")
    ended = run("identify", bad, "--out", "out")
    assert ended.code == 3
    assert ended.err.splitlines()[-1] == (
        "damperfit: 0 settings fitted, 1 failed; nothing was written: the earlier results in out "
        "stay"
    )
    assert listed(tmp_path / "out") == before


def test_where_dampers_get_folders_the_earlier_results_of_one_go(run, one_log, repeated, tmp_path):
    for k, name in enumerate(("SN11_click01.csv", "SN12_click01.csv")):
        (tmp_path / name).write_text(repeated(one_log, k))
    out = tmp_path / "out"
    assert run("identify", "SN11_click01.csv", "--out", "out").code == 0
    (out / "mine.txt").write_text("a user's own")
    assert run("identify", "SN*.csv", "--out", "out").code == 0
    assert sorted(path.name for path in out.iterdir()) == ["11", "12", "mine.txt"]
    assert (out / "11" / "run.json").exists()


def test_which_of_several_numbers_is_taken_is_said(run, one_log, tmp_path):
    name = "t1_2_2_24_24_s5_100psi.csv"
    (tmp_path / name).write_text(one_log)
    ended = run("identify", name, "--out", "out")
    assert (
        f"warning: {name}: of the numbers in its name the one after 's', 5, is taken for "
        "the setting; if it is another, name what precedes it: "
        r"--rig 'setting_pattern=s(?P<setting>\d+)'"
    ) in ended.err
    same = run("identify", name, "--out", "out", "--rig", r"setting_pattern=s(?P<setting>\d+)")
    assert same.code == 0
    assert "of the numbers" not in same.err


def test_clicks_beside_a_speed_are_asked_about_once(run, one_log, repeated, tmp_path):
    """s1 and s5 were taken for settings 1 and 5, whatever the clicks."""
    names = [f"t1_{low}_{high}_s{s}.csv" for low, high in ((2, 24), (2, 12)) for s in (1, 5)]
    for k, name in enumerate(names):
        (tmp_path / name).write_text(repeated(one_log, k))
    ended = run("identify", "t1_*.csv", "--out", "out")
    assert ended.code == 3
    assert ended.err.count("does not say its adjuster setting") == 1
    assert "(and 3 alike: " in ended.err
    assert "[adjusters] b = " not in ended.err
    assert '[adjusters] a = "", b = ""' in ended.err
    inspected = run("inspect", "t1_*.csv")
    assert inspected.code == 0
    assert "is taken for the setting" not in inspected.err
    (tmp_path / "two.toml").write_text('[adjusters]\na = ""\nb = ""\n')
    pattern = r"setting_pattern=^t\d+_(?P<a>\d+)_(?P<b>\d+)"
    said = run("inspect", "t1_*.csv", "--config", "two.toml", "--rig", pattern)
    assert "A2 B12" in said.out


def test_a_configuration_for_the_law_that_logs_choose_is_one_to_inspect_with(
    run, one_log, tmp_path
):
    (tmp_path / "setting_05.csv").write_text(one_log)
    (tmp_path / "valves.toml").write_text('[damper]\nrod_diameter = "10mm"\ngas_volume = "21cm3"\n')
    inspected = run("inspect", "setting_05.csv", "--config", "valves.toml")
    assert (inspected.code, inspected.err) == (0, "")
    assert run("identify", "setting_05.csv", "--config", "valves.toml").code == 2


def test_clicks_with_their_letters_behind_are_understood(run, one_log, repeated, tmp_path):
    (tmp_path / "two.toml").write_text(TWO)
    (tmp_path / "12r_8c.csv").write_text(one_log)
    ended = run("identify", "12r_8c.csv", "--config", "two.toml", "--out", "out")
    assert ended.code == 0
    assert (tmp_path / "out" / "parameters.csv").read_text().splitlines()[1].startswith("R12 C8,")


def test_made_up_logs_of_valves_are_fitted_by_their_folder(run, tmp_path) -> None:
    made = run("samples", "valves", "--model", "twin_tube", "--settings", "3", "--cycles", "5")
    assert made.code == 0
    ended = run("inspect", "valves")
    assert ended.code == 0
    assert "truth.csv: written by damperfit, not a log; skipped" in ended.err
