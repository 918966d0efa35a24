"""``damperfit report`` and the same from ``identify``."""

import json
from pathlib import Path

import pytest

from damperfit.reporting import drawing
from tests.report_folder import make_results


@pytest.fixture
def results(tmp_path):
    return make_results(tmp_path / "results")


def test_one_command_writes_one_page(run, results):
    before = {path.name for path in results.iterdir()}
    ended = run("report", results)
    assert (ended.code, ended.out) == (0, "")
    assert "report.html written" in ended.err
    assert {path.name for path in results.iterdir()} - before == {"report.html"}
    assert (results / "report.html").stat().st_size < 8e6


def test_it_says_what_is_damaged_and_ends_with_1(run, results):
    (results / "mse.parquet").unlink()
    ended = run("report", results)
    assert ended.code == 1
    assert "mse.parquet is missing" in ended.err
    assert (results / "report.html").exists()


def test_figures_are_files(undrawn, run, results, tmp_path):
    ended = run("report", results, "--figures", "svg", "--out", tmp_path / "there", "--json")
    assert ended.code == 0
    files = [Path(name) for name in json.loads(ended.out)["files"]]
    assert tmp_path / "there" / "figures" / "fan.svg" in files
    assert all(path.is_file() for path in files)


def test_identify_does_it_in_one_go(run, logs, monkeypatch):
    draw = drawing.draw_plot  # one figure is looked at; the others are those of test_figures.py

    def only_the_fan(path, plot, **how):
        draw(path, plot, **how) if plot.name == "fan" else path.touch()

    monkeypatch.setattr("damperfit.reporting.drawing.draw_plot", only_the_fan)
    ended = run("identify", logs / "setting_01.csv", "--report", "--plots", "png")
    assert ended.code == 0, ended.err
    assert Path("results/report.html").stat().st_size < 8e6
    assert Path("results/figures/fan.png").stat().st_size > 1000
    assert run("identify", logs / "setting_01.csv", "--plots", "bmp").code == 2


def test_the_report_joins_the_summary_of_a_job(run, logs, tmp_path, monkeypatch):
    summary = tmp_path / "summary.md"
    summary.write_text("before\n", encoding="utf-8")
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(summary))
    assert run("identify", logs / "setting_01.csv", "--github-summary").code == 0
    text = summary.read_text(encoding="utf-8")
    assert text == "before\n" + Path("results/report.md").read_text(encoding="utf-8")
