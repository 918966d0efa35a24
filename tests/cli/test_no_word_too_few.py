"""What a user met that was silent, misleading or lost: each has its sentence."""

from __future__ import annotations

import pytest

from damperfit.configuration.loading import load_configuration


@pytest.mark.parametrize("name", ["setting_01.csv", "README.md", "truth.csv"])
def test_samples_leave_a_users_file_alone(run, tmp_path, name):
    mine = tmp_path / "lab" / name
    mine.parent.mkdir()
    mine.write_text("time_s,displacement_mm,force_N\n0,0,0\n")
    ended = run("samples", "lab", "--settings", "1,2", "--cycles", "3")
    assert ended.code == 2
    assert ended.err == (
        f"damperfit: lab/{name}: is there, and was not written by samples; choose another folder, "
        "or move that file\n"
    )
    assert [path.name for path in mine.parent.iterdir()] == [name]
    assert run("samples", "other", "--settings", "1", "--cycles", "3").code == 0
    assert run("samples", "other", "--settings", "1", "--cycles", "3").code == 0  # its own


@pytest.mark.parametrize("command", [("models",), ("identify", "--model", "auto")])
def test_an_interrupted_choice_of_the_law_says_so(run, logs, monkeypatch, command):
    def stop(*_args, **_options):
        raise KeyboardInterrupt

    monkeypatch.setattr("damperfit.run.auto_model.choose_law", stop)
    ended = run(*command, logs / "setting_01.csv")
    assert ended.code == 130
    assert ended.err.splitlines()[-1] == "damperfit: interrupted"


@pytest.mark.parametrize(
    ("text", "tolerance"),
    [
        ("", 1.0),
        ("[damper]\nrod_diameter = '12mm'\n", float("inf")),
        ("[damper]\nrod_diameter = '12mm'\n[rig]\ntemperature = 30.0\n", 1.0),
        ("[damper]\nrod_diameter = '12mm'\n[rig]\ntemperature_tolerance = 3.0\n", 3.0),
        ("[damper]\nmodel = 'twin_tube'\n", float("inf")),
        ("[damper]\nmodel = 'bilinear'\n", 1.0),
        ("[damper]\nmodel = 'purdy'\n", 1.0),
    ],
)
def test_the_papers_temperature_is_asked_of_the_papers_damper(tmp_path, text, tolerance):
    path = tmp_path / "mine.toml"
    path.write_text(text)
    assert load_configuration(path).rig.temperature_tolerance == tolerance


@pytest.mark.parametrize(
    ("text", "is_said"),
    [
        ("procedure = 'plain'\nshare = ['f_f']\n", True),
        ("share = ['f_f']\n", True),
        ("procedure = 'joint'\nshare = ['f_f']\n", False),
        ("procedure = 'plain'\nshare = ['r_m3', 'f_f']\n", False),  # as config prints it
    ],
)
def test_what_is_to_be_shared_in_vain_is_said(tmp_path, text, *, is_said):
    path = tmp_path / "mine.toml"
    path.write_text(f"[identification]\n{text}")
    notes = load_configuration(path).notes
    assert any("share = ['f_f'] has no effect" in one for one in notes) is is_said


def test_columns_of_intervals_say_that_they_are_of_95_percent(run, logs):
    ended = run("identify", logs / "setting_02.csv", "--out", "out")
    lines = [line.split() for line in ended.out.splitlines()]
    assert any(line[:4] == ["1e3", "±95", "%", "1e6"] for line in lines)
    assert any(line[:1] == ["2"] and line[2:3] == ["±"] for line in lines)
