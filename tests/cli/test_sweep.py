"""``damperfit sweep`` as it is used."""

import csv
import json
from pathlib import Path


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
