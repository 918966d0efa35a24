"""damperfit simulate: golden values, whose parameters, waves, recorded motion, files."""

import csv
import json
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from damperfit.damper.purdy.reference import reference_parameters
from tests.fakes import values_in
from tests.oracles.golden import GOLDEN, PHASES

SET_M = ["r_m1=1.8e4", "r_m2=3.527e6", "r_m3=2.597e6", "k_e=365MPa", "f_f=50N"]


def _sets(*assignments: str) -> list[str]:
    return [word for assignment in assignments for word in ("--set", assignment)]


@pytest.mark.parametrize(("parameters", "rows"), GOLDEN)
def test_golden_values_come_out_of_the_written_file(run, tmp_path, parameters, rows) -> None:
    values = [f"{n}={getattr(parameters, n)!r}" for n in ("r_m1", "r_m2", "r_m3", "k_e", "f_f")]
    ended = run("simulate", *_sets(*values), "--sample-rate", "1500Hz", "--out", "one.csv")
    assert ended.code == 0
    with (tmp_path / "one.csv").open(newline="") as file:
        table = {float(row["time_s"]): row for row in csv.DictReader(file)}
    times = np.array(sorted(table))
    for phase, expected in zip(PHASES, rows, strict=True):
        moment = times[np.argmin(np.abs(times - (3.0 + phase) / 1.5))]
        assert moment == pytest.approx((3.0 + phase) / 1.5, abs=1e-9)
        row = table[moment]
        assert float(row["force_N"]) == pytest.approx(expected[0], abs=0.05)
        for chamber in (1, 2, 3):
            pressure = float(row[f"pressure_{chamber}_Pa"]) / 1e5
            assert pressure == pytest.approx(expected[chamber], abs=2e-3)


def test_the_figures_of_json_are_si_and_signed(run) -> None:
    document = json.loads(run("simulate", *_sets(*SET_M), "--json").out)
    figures = document["characteristics"]
    assert document["parameters"]["k_e"] == 3.65e8
    assert figures["energy"] == pytest.approx(79.2114 + 6.4, abs=0.01)
    assert figures["peak_force_rebound"] > 900.0
    assert figures["peak_force_bump"] < -900.0
    assert figures["cavitation_shares"] == [0.0, 0.0, 0.0]


def test_results_beside_it_come_before_the_reference_set(run, logs, tmp_path) -> None:
    assert run("identify", logs / "setting_02.csv", "--quiet").code == 0
    ended = run("simulate", "--setting", "2", "--json")
    assert "results/parameters.parquet" in ended.err
    found = values_in(tmp_path / "results" / "parameters.parquet")[2]
    assert json.loads(ended.out)["parameters"]["r_m1"] == found.r_m1
    missing = run("simulate", "--setting", "9")
    assert missing.code == 2
    assert "no parameters of setting 9; there are 2" in missing.err


def test_a_table_and_replacements_are_told(run, logs) -> None:
    ended = run(
        *("simulate", "--setting", "3", "--parameters", logs / "truth.csv"),
        *("--set", "f_f=0", "--json"),
    )
    assert "replaced: f_f" in ended.err
    parameters = json.loads(ended.out)["parameters"]
    assert parameters["f_f"] == 0.0
    assert parameters["r_m2"] == reference_parameters(3).r_m2


def test_a_triangle_moves_at_constant_speed(run, tmp_path) -> None:
    assert run("simulate", "--setting", "1", "--wave", "triangle", "--out", "t.parquet").code == 0
    velocity = np.array(pq.read_table(tmp_path / "t.parquet")["velocity_m_per_s"])
    assert np.median(np.abs(velocity)) == pytest.approx(4 * 0.032 * 1.5)


def test_a_recorded_displacement_gives_the_force_of_the_log(run, logs, tmp_path) -> None:
    ended = run(
        *("simulate", "--setting", "2", "--parameters", logs / "truth.csv"),
        *("--displacement", logs / "setting_02.csv", "--out", "r.parquet"),
    )
    assert ended.code == 0
    assert "displacement of setting_02.csv" in ended.out
    table = pq.read_table(tmp_path / "r.parquet")
    times, force = np.array(table["time_s"]), np.array(table["force_N"])
    rows = np.genfromtxt(logs / "setting_02.csv", delimiter=",", skip_header=4)
    measured = np.interp(times, rows[:, 0], rows[:, 2])
    later = times > times[0] + 1.0 / 1.5  # the first cycle is the model's own start
    assert np.sqrt(np.mean((force - measured)[later] ** 2)) < 5.0


def test_table_and_picture_of_one_folder_are_one_set_however_it_is_spelled(run, tmp_path) -> None:
    picture = str(tmp_path / "loops.png")
    ended = run("simulate", "--setting", "5", "--out", "signals.csv", "--plot", picture)
    assert ended.code == 0
    assert {path.name for path in tmp_path.iterdir()} >= {"signals.csv", "loops.png"}


@pytest.mark.parametrize(
    ("kind", "start"),
    [
        ("svg", b"<?xml"),
        pytest.param("png", b"\x89PNG", marks=pytest.mark.slow),
        pytest.param("pdf", b"%PDF", marks=pytest.mark.slow),
    ],
)
def test_the_loops_are_drawn_in_each_format(run, tmp_path, kind, start) -> None:
    assert run("simulate", "--setting", "5", "--plot", f"loops.{kind}").code == 0
    assert (tmp_path / f"loops.{kind}").read_bytes().startswith(start)


# ``damperfit sweep`` as it is used.


def test_a_family_is_table_figure_and_sentence(run):
    ended = run("sweep", "--setting", "10", "--vary", "R_m1=0.8,1,1.2", "--figures", "svg")
    assert ended.code == 0, ended.err
    assert "r_m1 x0.8 to x1.2: peak rebound " in ended.out
    assert all(len(line) <= 120 for line in ended.out.splitlines())
    assert {path.name for path in Path("sweep").iterdir()} == {"sweep.csv", "sweep_r_m1.svg"}
    with Path("sweep/sweep.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["factor"] for row in rows] == ["0.8", "1.0", "1.2"]
    assert "r_m1 x0.8" in Path("sweep/sweep_r_m1.svg").read_text(encoding="utf-8")


def test_the_papers_figures_at_once(run, undrawn):
    ended = run("sweep", "--paper", "--out", "paper", "--json")
    assert ended.code == 0, ended.err
    assert len(json.loads(ended.out)["rows"]) == 15
    figures = sorted(path.name[:8] for path in Path("paper").glob("*.png"))
    assert figures == [f"figure_{number}" for number in range(4, 10)]
