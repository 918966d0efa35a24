"""Curves without time through the commands: shown, asked, and refused where time is needed."""

from __future__ import annotations

import json
import shutil

import pytest

CURVES = """(25-4.3) V-C,C,V-R,R,(12-4.3) V-C,C,V-R,R
mm/s,N,mm/s,N,mm/s,N,mm/s,N
50,100,50,200,50,80,50,150
100,180,100,420,100,150,100,330
200,300,200,900,200,260,200,700
400,500,400,1600,400,450,400,1300
"""


@pytest.fixture
def curves(tmp_path):
    path = tmp_path / "curves.csv"
    path.write_text(CURVES)
    return path


def test_inspect_shows_them_as_a_table(run, curves) -> None:
    told = run("inspect", curves)
    assert told.code == 0
    assert not told.err
    rows = [" ".join(line.split()) for line in told.out.splitlines()]
    assert "25-4.3 rebound 4 0.400 1600 200.0 420.0 564.0 1110 -" in rows
    assert "compression 4 0.400 -450.0 -80.00 -150.0 -183.0 -317.0 -" in rows
    assert "1 log: 1 curves without time, which cannot be fitted" in told.out
    assert max(map(len, told.out.splitlines())) <= 80


def test_inspect_gives_their_points_as_json(run, curves, logs, tmp_path) -> None:
    shutil.copy(logs / "setting_01.csv", tmp_path)
    told = run("inspect", curves, "setting_01.csv", "--json", "--quiet")
    assert told.code == 0
    document = json.loads(told.out)
    facts = next(log for log in document["logs"] if log["log"] == "curves.csv")
    assert facts["verdict"] == "curves"
    assert facts["curves"][0]["label"] == "25-4.3"
    assert facts["curves"][0]["velocity_m_per_s"][:2] == [-0.05, -0.1]
    assert facts["curves"][0]["force_N"][:2] == [-100.0, -180.0]
    assert len(facts["sha256"]) == 64
    assert document["failures"] == []


def test_curves_of_several_files_have_their_names(run, curves, tmp_path) -> None:
    (tmp_path / "pvp.csv").write_text("speed_m/s,Rebound (N)\n0.1,200\n0.2,300\n0.3,400\n")
    told = run("inspect", curves, "pvp.csv")
    table = told.out.split("\n\n")[1]
    assert table.count("curves.csv:") == 2
    assert "\npvp.csv  " in table


def test_identify_says_that_it_needs_time(run, curves, tmp_path) -> None:
    told = run("identify", curves, "--out", "out")
    assert told.code == 3
    first, *_ = told.err.splitlines()
    assert first == (
        "damperfit: curves.csv: speed and force without time, and a fit needs force and "
        "displacement over time; damperfit inspect shows the curves, damperfit settings curves.csv "
        "finds a force among them"
    )
    (failure,) = json.loads((tmp_path / "out" / "run.json").read_text())["failures"]
    assert failure["kind"] == "TimelessError"


def test_settings_finds_a_force_among_them(run, curves) -> None:
    told = run("settings", curves, "--force", "900N", "--velocity", "0.22m/s", "--quiet")
    assert told.code == 0
    assert " ".join(told.out.split()) == (
        "900 N in rebound at 0.22 m/s: between 12-4.3 with 760 N and 25-4.3 with 970 N; nearest is "
        "25-4.3 (+70 N)"
    )
    beyond = run("settings", curves, "--force", "-350N", "--velocity", "0.22m/s", "--quiet")
    assert "no curve gives it; the nearest is 25-4.3 with -320 N" in " ".join(beyond.out.split())
    exact = run("settings", curves, "--force", "700N", "--velocity", "0.2m/s", "--quiet")
    assert exact.out.strip() == "700 N in rebound at 0.2 m/s: 12-4.3 gives it"


def test_settings_takes_several_files_and_what_the_rig_declares(run, tmp_path) -> None:
    for name, force in (("soft", 2.0), ("hard", 3.0)):
        rows = "".join(f"{v},{1000 * force * v}\n" for v in (0.1, 0.2, 0.3))
        (tmp_path / f"{name}.csv").write_text(f"speed_m/s,Rebound\n{rows}")
    asked = ("--force", "500N", "--velocity", "0.2m/s", "--quiet")
    told = run("settings", "soft.csv", "hard.csv", "--rig", "units.force=N", *asked)
    assert told.code == 0
    said = " ".join(told.out.split())
    assert "between soft.csv" in said
    assert "with 400 N and hard.csv" in said
    weaker = run("settings", "soft.csv", "hard.csv", "--rig", "units.force=lbf", *asked)
    assert "no curve gives it; the nearest is soft.csv" in " ".join(weaker.out.split())
    (tmp_path / "results").mkdir()
    mixed = run("settings", "soft.csv", "results")
    assert mixed.code == 2
    assert "expected one results folder, or files of measured curves alone" in mixed.err
    useless = run("settings", "results", "--rig", "units.force=N")
    assert useless.code == 2
    assert "--rig units.force=N has no effect: results holds results" in useless.err


def test_settings_shows_the_forces(run, curves) -> None:
    told = run("settings", curves)
    assert told.code == 0
    rows = [" ".join(line.split()) for line in told.out.splitlines()]
    assert "12-4.3 rebound 4 0.400 1300 150.0 330.0 441.0 880.0 1000" in rows
    document = json.loads(run("settings", curves, "--velocity", "0.2m/s", "--json").out)
    assert document["question"] is None
    assert document["forces"][0] == {
        "curve": "25-4.3",
        "stroke": "rebound",
        "speed_m_per_s": 0.2,
        "force_N": 900.0,
    }
    assert len(document["forces"]) == 4


@pytest.mark.parametrize(
    ("arguments", "code", "says"),
    [
        (("--velocity", "0.5m/s"), 2, "0.5 m/s: no curve of curves.csv has points on both sides"),
        (("--amplitude", "20mm"), 2, "--amplitude 20mm has no effect: the forces of "),
        (("--frequency", "2Hz"), 2, "--frequency 2Hz has no effect"),
    ],
)
def test_what_settings_cannot_do_with_them(run, curves, arguments, code, says) -> None:
    told = run("settings", curves, *arguments)
    assert told.code == code
    assert says in told.err
    assert len(told.err.splitlines()) == 1


def test_settings_of_a_log_says_what_to_do(run, logs) -> None:
    told = run("settings", logs / "setting_01.csv")
    assert told.code == 1
    assert (
        "has a time column, so it is a log, not a curve; fit it by damperfit identify" in told.err
    )


def test_a_bug_that_curves_meet_costs_their_file(run, curves, logs, tmp_path, monkeypatch) -> None:
    def broken(*_):
        raise KeyError("stroke")

    monkeypatch.setattr("damperfit.run.logs.read_curves", broken)
    shutil.copy(logs / "setting_01.csv", tmp_path)
    told = run("inspect", curves, "setting_01.csv")
    assert told.code == 1
    (line,) = told.err.splitlines()
    assert line.startswith("damperfit: curves.csv: internal error while reading the curves, KeyErr")
    assert "1 good, 1 refused" in told.out
