"""The HTML report and the figures: from known tables, good, poor, cavitating and missing."""

from __future__ import annotations

import json
import re
import shutil

import numpy as np
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st

from damperfit.errors import ConfigurationError
from damperfit.report import draw_plot, html_report, portfolio
from damperfit.report.plots import setting_colours, thin
from damperfit.report.views import log_views
from damperfit.tables import read_results
from tests.report_folder import EVIL, damage_row_group, make_results


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return make_results(tmp_path_factory.mktemp("results"))


@pytest.fixture
def copy(folder, tmp_path):
    return shutil.copytree(folder, tmp_path / "copy")


@pytest.fixture(scope="module")
def shown(folder):
    return portfolio(read_results(folder))


@pytest.fixture(scope="module")
def page(shown):
    return html_report(shown, title="<b>my run</b>")


def document(page):
    (text,) = re.findall(r'<script type="application/json" id="data">(.*?)</script>', page)
    return json.loads(text)


def test_a_whole_folder_is_read_without_remarks(folder):
    results = read_results(folder)
    assert results.remarks == ()
    assert [row["setting"] for row in results.parameters] == [1, 2, 3, 4, 5]
    assert [log.setting for log in results.logs] == [1, 2, 3, 5]
    assert results.logs[0].pressures.shape == (3, len(results.logs[0].time))


def test_every_text_is_escaped(page):
    assert "<img" not in page[: page.index('id="data"')]
    assert "<b>my run" not in page
    assert "&lt;/script&gt;&lt;img src=x onerror=alert(1)&gt;$x_1$.csv" in page
    labels = [
        line["label"]
        for plot in document(page)["plots"]
        for p in plot["panels"]
        for line in p["lines"]
    ]
    assert any("&lt;img" in label for label in labels)  # plotly reads labels as HTML
    assert not any("<" in label for label in labels)


def test_the_page_asks_for_nothing_from_outside(page):
    own = page[: page.index('id="data"')] + page[page.rindex("<script>") :]
    assert "default-src 'none'" in own
    assert not re.search(r"https?://|//cdn|@import|<[^>]*\bsrc=|url\(", own)


def test_plots_are_complete(shown):
    names = {plot.name for plot in shown.plots}
    assert len(names) == len(shown.plots)
    for name in (
        "parameter_r_m1",
        "parameter_k_e",
        "mse",
        "fan",
        "absolute_velocity",
        "peak_force",
        "named_speeds",
    ):
        assert name in names
    for kind in ("force_velocity", "force_displacement", "force_time", "residual", "pressures"):
        assert f"setting_03_{kind}" in names
    assert "parameter_f_0" not in names


def test_parameters_show_interval_where_there_is_one_and_no_unknown_value(shown):
    (plot,) = (plot for plot in shown.overall if plot.name == "parameter_k_e")
    points = {line.setting: line for line in plot.panels[0].lines if line.setting is not None}
    assert sorted(points) == [1, 2, 3]  # 4 is missing, 5 cannot be told
    assert points[1].low == pytest.approx([490.0])
    assert points[1].high == pytest.approx([530.0])
    assert points[2].low is None


def test_cavitation_is_marked(shown):
    pressures = {plot.name: plot for plot in shown.plots if plot.name.endswith("pressures")}
    assert pressures["setting_01_pressures"].panels[0].bands == ()
    bands = pressures["setting_03_pressures"].panels[0].bands
    assert bands
    assert "chamber 2 for" in pressures["setting_03_pressures"].caption
    log = next(log for log in shown.results.logs if log.setting == 3)
    time = log.time - log.time[0]
    dry = time[(log.pressures <= 0.0).any(axis=0)]
    assert bands[0][0] == pytest.approx(dry[0], abs=0.01)


def test_the_summary_says_what_is_poor_and_missing(page):
    assert "worst 12.0 % at setting 2" in page
    assert "setting 2: poor fit, MSE 12.0 %" in page
    assert "no result for setting 4" in page
    assert "k_e not identifiable" in page


def test_frequency_and_figures_come_from_the_signals(folder):
    view = log_views(read_results(folder))[0]
    assert view.frequency == pytest.approx(1.5, rel=0.01)
    assert view.measured.peak_force_rebound == pytest.approx(2500.0 * 0.3016 - 130.0, rel=0.01)
    # The measured force is a v - b: its loop integral is a pi A (2 pi f A).
    energy = 2500.0 * np.pi * 0.032 * (2 * np.pi * 1.5 * 0.032)
    assert view.measured.energy == pytest.approx(energy, rel=0.01)


@given(st.lists(st.floats(-1e6, 1e6), min_size=300, max_size=2000), st.integers(1, 40))
def test_thinning_keeps_the_extremes_and_the_ends(values, n_buckets):
    signal = np.array(values)
    kept = thin(n_buckets, signal, -(signal**2))
    assert len(kept) <= 4 * n_buckets + 2
    assert signal[kept].max() == signal.max()
    assert signal[kept].min() == signal.min()
    assert kept[0] == 0
    assert kept[-1] == len(signal) - 1
    assert (np.diff(kept) > 0).all()


def test_a_setting_has_its_own_colour():
    colours = setting_colours(range(1, 21))
    assert len(set(colours.values())) == 20
    assert setting_colours([7])[7].startswith("#")


@pytest.mark.parametrize("kind", ["png", "svg", "pdf"])
def test_figures_are_the_same_bytes_each_time(shown, tmp_path, kind):
    for plot in (shown.overall[0], shown.by_log[-1][1][1], shown.plots[5]):
        paths = tmp_path / f"a.{kind}", tmp_path / f"b.{kind}"
        for path in paths:
            draw_plot(path, plot, kind=kind)
        first, second = (path.read_bytes() for path in paths)
        assert first == second
        assert len(first) > 2000


def test_figures_do_not_heed_the_readers_own_style(shown, tmp_path):
    import matplotlib as mpl

    draw_plot(tmp_path / "a.svg", shown.overall[0], kind="svg")
    with mpl.rc_context({"font.size": 20.0, "axes.facecolor": "red"}):
        draw_plot(tmp_path / "b.svg", shown.overall[0], kind="svg")
        assert mpl.rcParams["font.size"] == 20.0
    assert (tmp_path / "a.svg").read_bytes() == (tmp_path / "b.svg").read_bytes()


def test_svg_shows_the_axes_with_units(shown, tmp_path):
    (plot,) = (plot for plot in shown.plots if plot.name == "setting_01_force_velocity")
    draw_plot(tmp_path / "a.svg", plot, kind="svg")
    text = (tmp_path / "a.svg").read_text(encoding="utf-8")
    assert "velocity, m/s" in text
    assert "force, N" in text


def test_a_damaged_log_costs_that_log_alone(copy):
    damage_row_group(copy / "responses.parquet", 1)
    results = read_results(copy)
    assert [log.setting for log in results.logs] == [1, 3, 5]
    assert len(results.remarks) == 1
    assert "log 2 is damaged" in results.remarks[0]
    assert "log 2 is damaged" in html_report(portfolio(results), title="x")


def test_csv_stands_in_for_damaged_parquet(copy):
    (copy / "parameters.parquet").write_bytes(b"PAR1 no more")
    results = read_results(copy)
    assert results.parameters == read_results(copy.parent / "copy").parameters
    assert results.parameters[0]["k_e"] == 5.1e8
    assert results.parameters[3]["k_e"] is None
    assert any("parameters.parquet cannot be read" in remark for remark in results.remarks)


@pytest.mark.parametrize(
    "names",
    [
        ("run.json",),
        ("responses.parquet",),
        ("mse.parquet", "mse.csv"),
        ("parameters.parquet", "parameters.csv"),
        ("run.json", "responses.parquet", "mse.parquet", "mse.csv"),
    ],
)
def test_what_is_left_is_shown(copy, names):
    for name in names:
        (copy / name).unlink()
    results = read_results(copy)
    page = html_report(portfolio(results), title="x")
    for name in names:
        assert any(name in remark for remark in results.remarks)
        assert f"{name} is missing" in page


@pytest.mark.parametrize("text", ["", "{", "[]", "[" * 100_000, '{"inputs": 3, "files": [1]}'])
def test_a_broken_record_breaks_nothing(copy, text):
    (copy / "run.json").write_text(text, encoding="utf-8")
    assert "Setting 1" in html_report(portfolio(read_results(copy)), title="x")


def test_an_older_schema_is_named_and_what_it_has_is_shown(copy):
    table = pq.read_table(copy / "parameters.parquet")
    old = table.drop_columns(["grade", "outcome", "k_e_ci_low", "cavitation_fraction"])
    pq.write_table(old, copy / "parameters.parquet")
    (copy / "run.json").write_text('{"schema_version": 0, "version": "0.0.1"}', encoding="utf-8")
    results = read_results(copy)
    assert "schema version 0 (damperfit 0.0.1)" in results.remarks[0]
    assert "k_e_ci_low" in results.remarks[1]
    assert "parameter_k_e" in html_report(portfolio(results), title="x")


def test_a_file_of_another_run_is_named(copy):
    (copy / "run.json").write_text('{"files": {"mse.parquet": "00"}}', encoding="utf-8")
    assert read_results(copy).remarks == (
        "mse.parquet is not the file that the run wrote (see run.json)",
    )


def test_an_empty_folder_is_one_sentence(tmp_path):
    with pytest.raises(ConfigurationError, match=r"nothing to show.*run damperfit identify"):
        read_results(tmp_path)
    with pytest.raises(ConfigurationError, match="no such folder"):
        read_results(tmp_path / "nowhere")


def test_the_vile_name_is_really_there(folder):
    assert read_results(folder).logs[-1].log == EVIL
