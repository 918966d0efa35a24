"""What a run leaves alone in a results folder, and what must go; how its logs were labelled."""

import pytest


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
    assert "1 failed in" in first.err
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
