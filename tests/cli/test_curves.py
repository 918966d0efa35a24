"""Curves without time through the commands: shown, asked, and refused where time is needed."""

import json

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
