"""The HTML report and the figures: from known tables, good, poor, cavitating and missing."""

import json
import re
import shutil
from dataclasses import replace

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from damperfit.errors import ConfigurationError
from damperfit.reporting.drawing import draw_plot
from damperfit.reporting.figures import report_plots
from damperfit.reporting.page import PlotData, html_report
from damperfit.reporting.plots import thin
from damperfit.results import Run
from tests.report_folder import EVIL, damage_row_group, make_results


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return make_results(tmp_path_factory.mktemp("results"))


@pytest.fixture
def copy(folder, tmp_path):
    return shutil.copytree(folder, tmp_path / "copy")


@pytest.fixture(scope="module")
def shown(folder):
    return report_plots(Run.load(folder))


@pytest.fixture(scope="module")
def page(shown):
    return html_report(shown, title="<b>my run</b>")


def test_every_text_is_escaped(page):
    assert "<img" not in page[: page.index('id="data"')]
    assert "<b>my run" not in page
    assert "&lt;/script&gt;&lt;img src=x onerror=alert(1)&gt;$x_1$.csv" in page


def test_labels_of_plots_are_escaped(shown):
    """Plotly reads them as HTML."""
    plot = shown.overall[0]
    (panel,) = plot.panels
    evil = replace(panel, lines=(replace(panel.lines[0], label=EVIL),))
    data = PlotData()
    data.add(replace(plot, panels=(evil,)))
    (label,) = (
        line["label"] for line in json.loads(data.script({}))["plots"][0]["panels"][0]["lines"]
    )
    assert label == "&lt;/script&gt;&lt;img src=x onerror=alert(1)&gt;$x_1$.csv"


def test_the_page_asks_for_nothing_from_outside(page):
    own = page[: page.index('id="data"')] + page[page.rindex("<script>") :]
    assert "default-src 'none'" in own
    assert not re.search(r"https?://|//cdn|@import|<[^>]*\bsrc=|url\(", own)


def test_cavitation_is_marked(shown):
    pressures = {plot.name: plot for plot in shown.plots if plot.name.endswith("pressures")}
    assert pressures["setting_01_pressures"].panels[0].bands == ()
    bands = pressures["setting_03_pressures"].panels[0].bands
    assert bands
    assert "chamber 2 for" in pressures["setting_03_pressures"].caption
    log = next(log for log in shown.run.signals if log.setting == 3)
    time = log.time - log.time[0]
    dry = time[(log.pressures <= 0.0).any(axis=0)]
    assert bands[0][0] == pytest.approx(dry[0], abs=0.01)


@given(
    arrays(np.float64, st.integers(300, 2000), elements=st.floats(-1e6, 1e6)), st.integers(1, 40)
)
def test_thinning_keeps_the_extremes_and_the_ends(signal, n_buckets):
    kept = thin(n_buckets, signal, -(signal**2))
    assert len(kept) <= 4 * n_buckets + 2
    assert signal[kept].max() == signal.max()
    assert signal[kept].min() == signal.min()
    assert kept[0] == 0
    assert kept[-1] == len(signal) - 1
    assert (np.diff(kept) > 0).all()


def edit(copy, **entries):
    """Put entries into run.json; return what is shown then."""
    record = json.loads((copy / "run.json").read_text(encoding="utf-8")) | entries
    (copy / "run.json").write_text(json.dumps(record), encoding="utf-8")
    return report_plots(Run.load(copy))


def test_what_the_run_told_is_shown(copy):
    told = ((True, "all below 1 %"), (False, "setting 3 is off"), (None, "one log a setting"))
    outlier = {"setting": 3, "value": 5.3e8, "expected": 5e8, "deviation": 0.2}
    ends = {"low": 4.9e8, "high": 5.9e8}
    points = [{"setting": n, "value": 5e8 + 1e7 * n, **ends} for n in range(1, 6)]
    rises = "K_e rises by 10 MPa a setting."
    trend = {"parameter": "k_e", "sentence": rises, "outliers": [outlier], "points": points}
    held = {"setting": 2, "log": "b.csv", "cycles": "last 3", "mse_percent": 0.5}
    held |= {"expected_mse_percent": 0.25, "verdict": "worse than fitted"}
    findings = [
        {"name": "skew", "severity": "note", "sentence": "channels are 0.1 ms apart"},
        {"name": "clipping", "severity": "warning", "sentence": f"force is clipped {EVIL}"},
    ]
    shown = edit(
        copy,
        checks=[{"name": f"c{k}", "passed": a, "reason": b} for k, (a, b) in enumerate(told)],
        trends=[trend],
        sentences={"identifiability": ["r_m1, r_m3 strongly correlated"], "cavitation": "no list"},
        held_out=[held, 7],
        inputs=[{"log": "setting_01.csv", "findings": findings}],
    )
    page = html_report(shown, title="x").replace(" class=word", "")
    for words in (
        "1 of 3 checks passed, 1 failed, 1 not evaluated", "r_m1, r_m3 strongly correlated",
        "<td>b.csv</td><td>last 3</td>", "<td class=n>0.250</td><td>worse than fitted</td>",
        "warning: force is clipped &lt;/script&gt;",
    ):  # fmt: skip
        assert words in page
    assert page.index("setting 3 is off") < page.index("all below 1 %")  # what failed comes first
    assert page.count("channels are 0.1 ms apart") == page.count(rises) == 1  # it stands once
    (plot,) = (plot for plot in shown.overall if plot.name == "parameter_k_e")
    line, ring = plot.panels[0].lines[:2]
    assert (line.label, line.low[0], line.high[-1]) == ("trend, 95 %", 490.0, 590.0)
    assert (ring.style, ring.x.tolist()) == ("rings", [3.0])


def test_a_file_of_another_run_is_named(copy):
    (copy / "run.json").write_text('{"files": {"mse.parquet": "00"}}', encoding="utf-8")
    (problem,) = Run.load(copy).remarks
    assert str(problem) == "mse.parquet is not the file that the run wrote (see run.json)"


@pytest.mark.one_in(2)
@pytest.mark.parametrize(
    "record",
    [
        *("", "{", "[]", "[" * 100_000, '{"inputs": 3, "files": [1]}'),
        {"checks": 3, "trends": "a", "clicks": None, "inputs": [None, {"findings": [1, {}]}]},
        {"checks": [{}, 1, {"name": "a", "passed": "yes"}], "trends": [{"points": [{}]}]},
        {"trends": [{"parameter": "k_e", "points": [{"setting": 1, "value": 5e8}]}]},
        {
            "clicks": [{"from": "a"}, {"from": 1, "to": 2}],
            "gaps": ["x", None, 3.5, {"first": 2}, {"first": "2", "last": 3}],
        },
        {"configuration": 5, "procedure": [None, 3], "warnings": [{}], "failures": [1, {}]},
        {"configuration": {"rig": {"filter": [1], "centre": None, "reverse_force": "yes"}}},
        {"inputs": [{"log": "setting_01.csv", "temperature_degC": 10**400, "frequency_Hz": True}]},
        {"inputs": [{"log": ["setting_01.csv"], "findings": {"sentence": "a"}, "notes": "abc"}]},
        {"clicks": [{"from": 1, "to": 2, "speed_m_per_s": 0.3, "stroke": 5, "change_N": "a"}]},
        {"trends": [{"parameter": "r_m1", "outliers": [{"setting": 1}, 5], "points": [[1, 2]]}]},
        {"held_out": [{}, {"mse_percent": "a", "log": {}}], "gates_missed": [{"a": 1}, None]},
        {"problems": [1, {"severity": "loud"}, {"values": {"a": {"b": 1}}}], "warnings": ["w"]},
        {"sentences": {"cavitation": {"a": 1}, "identifiability": [None, 2]}, "version": ["x"]},
    ],
)
def test_what_is_told_strangely_breaks_nothing(copy, record):
    text = record if isinstance(record, str) else json.dumps(record)
    (copy / "run.json").write_text(text, encoding="utf-8")
    assert "Setting 1" in html_report(report_plots(Run.load(copy)), title="x")


def test_a_value_at_a_bound_does_not_flatten_the_others(copy):
    bound = {"k_e": 3e15, "k_e_status": "at_bound"}
    _change(copy / "parameters.parquet", lambda rows: rows[1].update(bound))
    shown = report_plots(Run.load(copy))
    (plot,) = (plot for plot in shown.overall if plot.name == "parameter_k_e")
    assert {line.setting for line in plot.panels[0].lines} == {1, 3}
    assert "At a bound, off the scale: setting 2 (3e+09)." in plot.caption


def test_a_damaged_log_costs_that_log_alone(copy):
    damage_row_group(copy / "responses.parquet", 1)
    results = Run.load(copy)
    assert [log.setting for log in results.signals] == [1, 3, 5]
    damage, consequence = map(str, results.remarks)
    assert "log 2 is damaged" in damage
    assert consequence == "setting 2: parameters but no signals, so no loops"
    assert "log 2 is damaged" in html_report(report_plots(results), title="x")


@pytest.mark.parametrize(
    "names", ["run.json", "responses.parquet", "mse.parquet mse.csv", "run.json responses.parquet"]
)
def test_what_is_left_is_shown(copy, names):
    for name in names.split():
        (copy / name).unlink()
    results = Run.load(copy)
    page = html_report(report_plots(results), title="x")
    for name in names.split():
        assert any(name in str(remark) for remark in results.remarks)
        assert f"{name} is missing" in page


@pytest.mark.parametrize("version", [3, 0, "2", 1, 2])
def test_any_other_schema_is_named_and_this_one_is_not(copy, version):
    text = json.dumps({"schema_version": version, "version": "9.9"})
    (copy / "run.json").write_text(text, encoding="utf-8")
    said = [one for one in map(str, Run.load(copy).remarks) if "schema version" in one]
    told = (
        f"the results are of schema version {version} (damperfit 9.9), this damperfit knows 2: "
        "what is not found is left out; update damperfit, or run identify again on the logs"
    )
    assert said == [told] * (version not in {1, 2})


def _change(path, change):
    """Write a Parquet table anew with changed rows, its schema kept."""
    table = pq.read_table(path)
    rows = table.to_pylist()
    pq.write_table(pa.Table.from_pylist(change(rows) or rows, schema=table.schema), path)


def test_a_setting_that_is_in_one_table_alone_is_named_and_shown(copy):
    _change(copy / "parameters.parquet", lambda rows: [r for r in rows if r["setting"] != 2])
    results = Run.load(copy)
    assert list(map(str, results.remarks)) == ["setting 2: signals but no parameters"]
    page = html_report(report_plots(results), title="x")
    assert "Setting 2: setting_02.csv" in page
    table = pq.read_table(copy / "responses.parquet")
    kept = pa.array([setting != 3 for setting in table.column("setting").to_pylist()])
    pq.write_table(table.filter(kept), copy / "responses.parquet")  # in one row group
    remarks = [*map(str, Run.load(copy).remarks)]
    assert "setting 3: parameters but no signals, so no loops" in remarks


def test_a_setting_told_twice_is_shown_once(copy):
    _change(copy / "parameters.parquet", lambda rows: rows * 2)
    results = Run.load(copy)
    assert [row["setting"] for row in results.rows("parameters")] == [1, 2, 3, 4, 5]
    assert "more than once" in str(results.remarks[0])


def test_numbers_that_cannot_be_drawn_are_left_out(copy, tmp_path):
    """An interval beside its value used to end in an internal error."""

    def spoil(rows):
        rows[0] |= {"k_e_ci_low": 9e9, "k_e_ci_high": float("nan"), "mse_percent": 0.0}
        rows[2] |= {"mse_percent": float("inf")}

    _change(copy / "parameters.parquet", spoil)
    _change(copy / "mse.parquet", lambda rows: rows[2].update(mse_percent=float("inf")))
    shown = report_plots(Run.load(copy))
    html_report(shown, title="x")
    spoiled = {one.name: one for one in shown.overall if one.name in {"parameter_k_e", "mse"}}
    for name, plot in spoiled.items():
        draw_plot(tmp_path / f"{name}.png", plot, kind="png", dpi=40)
        assert (tmp_path / f"{name}.png").exists()
    values = np.concatenate([line.y for line in spoiled["mse"].panels[0].lines])
    assert (values > 0.0).all()
    assert np.isfinite(values).all()


def test_an_empty_folder_is_one_sentence(tmp_path):
    with pytest.raises(ConfigurationError, match=r"nothing to show"):
        Run.load(tmp_path)
    with pytest.raises(ConfigurationError, match="no such folder"):
        Run.load(tmp_path / "nowhere")
