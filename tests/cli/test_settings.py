"""damperfit settings, and the checks and trends that identify tells."""

import json
import shutil
from pathlib import Path

import pyarrow.parquet as pq
import pytest


@pytest.fixture(scope="module")
def samples(sample_results, tmp_path_factory) -> Path:
    """Results of the twenty sample runs."""
    folder = tmp_path_factory.mktemp("samples") / "results"
    return shutil.copytree(sample_results / "results", folder)


@pytest.fixture
def folder(results, tmp_path) -> Path:
    """A copy to be spoilt."""
    return Path(shutil.copytree(results, tmp_path / "results"))


def record(folder: Path) -> dict:
    return json.loads((folder / "run.json").read_text())


def asked(run, folder: Path, *question) -> dict:
    ended = run("settings", folder, *question, "--json")
    assert ended.code == 0, ended.err
    return json.loads(ended.out)


def test_the_sample_runs_get_what_the_paper_found_by_hand(samples) -> None:
    checks = {check["name"]: check for check in record(samples)["checks"]}
    failed = {name for name, check in checks.items() if check["passed"] is False}
    assert failed == {"no_outlier_setting"}
    assert checks["damper_declared"]["passed"] is None
    assert "setting 20 (r_m1 +12." in checks["no_outlier_setting"]["reason"]
    trends = {trend["parameter"]: trend for trend in record(samples)["trends"]}
    assert [o["setting"] for o in trends["r_m1"]["outliers"]] == [20]
    assert [o["setting"] for o in trends["r_m2"]["outliers"]] == [20]
    assert trends["k_e"]["outliers"] == []
    assert trends["k_e"]["is_erratic"]
    assert all(trend["monotone"] and trend["direction"] == "rising" for trend in trends.values())
    assert {p["setting"] for p in trends["k_e"]["points"]} == set(range(1, 21))
    report = (samples / "report.md").read_text(encoding="utf-8")
    assert "16 of 19 checks passed" in report
    assert "## Across the settings" in report


def test_a_click_is_the_difference_of_two_forces_with_its_interval_around_it(samples) -> None:
    rows = pq.read_table(samples / "adjustment.parquet").to_pylist()
    assert len(rows) == 20 * 5 * 2
    table = {(r["setting"], r["speed_m_per_s"], r["stroke"]): r for r in rows}
    for click in record(samples)["clicks"]:
        place = (click["speed_m_per_s"], click["stroke"])
        a, b = table[click["from"], *place], table[click["to"], *place]
        assert click["change_N"] == b["change_N"] == pytest.approx(b["force_N"] - a["force_N"])
        assert click["low_N"] < click["change_N"] < click["high_N"]
        assert click["change_N"] == pytest.approx(0.5 * (click["low_N"] + click["high_N"]))


@pytest.mark.parametrize(
    ("question", "stroke", "wanted", "neighbours"),
    [
        (("--force", "900N", "--velocity", "0.2m/s"), "rebound", 900.0, (12, 13)),
        (("--force", "-900N", "--velocity", "0.2m/s"), "bump", -900.0, (11, 12)),
        (("--force", "0.9kN", "--velocity", "-200mm/s"), "bump", -900.0, (11, 12)),
        (("--force=900", "--velocity=0.2", "--stroke", "bump"), "bump", -900.0, (11, 12)),
    ],
)
def test_which_setting_gives_a_force(run, samples, question, stroke, wanted, neighbours) -> None:
    document = asked(run, samples, *question)
    assert document["question"] == {"speed": 0.2, "force": wanted, "stroke": stroke}
    (answer,) = document["answers"]
    assert (answer["below"], answer["above"]) == neighbours
    assert answer["below"] < answer["low"] < answer["position"] < answer["high"] < answer["above"]
    forces = {r["setting"]: r["force_N"] for r in document["forces"] if r["stroke"] == stroke}
    between = sorted(forces[setting] for setting in neighbours)
    assert between[0] < wanted < between[1]


def test_a_speed_beyond_the_tests_is_answered_with_a_note(run, results) -> None:
    ended = run("settings", results, "--velocity", "0.5m/s", "--json")
    assert ended.code == 0
    assert "note: 0.5 m/s was never tested at settings 1-3 (tested: up to 0.302 m/s)" in ended.err
    assert {row["tested"] for row in json.loads(ended.out)["forces"]} == {"no"}
    inside = run("settings", results, "--velocity", "0.2m/s", "--json")
    assert inside.err == ""
    assert {row["tested"] for row in json.loads(inside.out)["forces"]} == {"yes"}


@pytest.mark.parametrize("damage", ["missing", "cut"])
def test_a_damaged_run_json_is_said(run, folder, damage) -> None:
    path = folder / "run.json"
    if damage == "missing":
        path.unlink()
    else:
        path.write_text("[1]" if damage == "no object" else path.read_text()[:500])
    ended = run("settings", folder, "--velocity", "0.2")
    assert ended.code == 1
    assert "the damper of the run is not known" not in ended.err  # parameters.parquet tells it
    (folder / "parameters.parquet").unlink()
    ended = run("settings", folder, "--velocity", "0.2")
    assert ended.code == 1
    assert "the damper of the run is not known" in ended.err
    assert "the motion of the test is not known" in ended.err
    assert "Traceback" not in ended.err


@pytest.mark.parametrize(
    ("gates", "code"),
    [
        (("--check", "no_cavitation,mse_below_1_percent"), 0),
        (("--check", "no_cavitation", "--check", "fits_converged"), 0),
        (("--check", "purdy2000"), 4),
        (("--check", "trend_monotone"), 4),
    ],
)
def test_a_check_asked_for_is_a_gate(run, logs, gates, code) -> None:
    ended = run("identify", logs / "setting_*.csv", "--out", "r", *gates)
    assert ended.code == code, ended.err
    assert ("check not evaluated: trend_monotone: R_m1, R_m2, K_e: 3 settings" in ended.err) is (
        code == 4
    )
    assert bool(record(Path("r"))["gates_missed"]) is (code == 4)


# Curves without time through the commands: shown, asked, and refused where time is needed.

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
    assert not run("settings", curves).out.startswith("\n")
    beyond = run("settings", curves, "--force", "-350N", "--velocity", "0.22m/s", "--quiet")
    assert "no curve gives it; the nearest is 25-4.3 with -320 N" in " ".join(beyond.out.split())
    exact = run("settings", curves, "--force", "700N", "--velocity", "0.2m/s", "--quiet")
    assert exact.out.strip() == "700 N in rebound at 0.2 m/s: 12-4.3 gives it"
