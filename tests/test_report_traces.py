"""What figures and lines of the report hold, by known answers: what is drawn and how."""

from __future__ import annotations

import base64
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from damperfit.report.drawing import compose, fixed_style
from damperfit.report.figures import Line, Panel, Plot, setting_colours, thin
from damperfit.report.inspection import finding_lines
from damperfit.report.log_figures import sweep_plot
from damperfit.report.logs import EvaluatedLog, evaluate_logs
from damperfit.report.page import PlotData
from damperfit.report.settings_figures import campaign_plots, parameter_plots
from damperfit.report.tables import parameter_line
from damperfit.results import Run
from damperfit.tables import make_tables
from tests.fakes import campaign, changed, fit
from tests.report_folder import make_results


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    return Run.load(make_results(tmp_path_factory.mktemp("results")))


def sine(results, n: int, n_cycles: int) -> EvaluatedLog:
    """A log of whole cycles of 1.5 Hz, n samples each."""
    time = np.arange(n * n_cycles) / (1.5 * n)
    phase = 2.0 * np.pi * 1.5 * time
    v = np.cos(phase)
    log = replace(
        results.signals[0],
        time=time,
        displacement=0.032 * np.sin(phase),
        velocity=v,
        force=v,
        force_measured=v + 0.1 * np.sin(phase),
        pressures=np.ones((3, len(v))),
    )
    (view,) = evaluate_logs(changed(results, signals=(log,), record={}))
    return view


@pytest.mark.parametrize("n_cycles", [1, 2, 3])
def test_the_frequency_is_that_of_the_cycles_however_many_there_are(results, n_cycles) -> None:
    # One passage tells no period, two do.
    assert sine(results, 400, n_cycles).frequency == pytest.approx(1.5, rel=0.004)


# Traces thinned: 500 runs of a cycle, two signals, a lowest and a highest of each, and the ends.


@pytest.mark.parametrize(("n", "is_whole"), [(2002, True), (2003, False)])
def test_a_cycle_is_drawn_whole_up_to_what_thinning_would_leave(results, n, is_whole) -> None:
    view = sine(results, n, 1)
    assert view.cycle == slice(0, n)
    plots = {p.name: p for p in campaign_plots((), (), (view,), colours={1: "#000000"})}
    for name in ("fan", "absolute_velocity"):
        for line in plots[name].panels[0].lines:
            assert (len(line.x) == n) is is_whole


def test_each_run_of_samples_keeps_its_lowest_and_highest() -> None:
    rising = np.arange(1000.0)
    ends = [place for k in range(10) for place in (100 * k, 100 * k + 99)]
    assert thin(10, rising).tolist() == ends


# Marks, intervals and colours.


@pytest.mark.parametrize(("n", "size"), [(60, 5.0), (61, 1.0)])
def test_more_than_sixty_points_are_drawn_small(n, size) -> None:
    x = np.arange(float(n))
    plot = Plot("a", "a", (Panel("x", "", "y", "", (Line(x, x, "a", "ink", style="points"),)),))
    with fixed_style():
        (drawn,) = compose(plot).axes[0].get_lines()
    assert drawn.get_markersize() == size


@pytest.mark.parametrize("sides", [("low", "high"), ("low",), ("high",), ()])
def test_the_page_is_told_the_sides_of_an_interval_that_are_known(sides) -> None:
    ends = {"low": np.array([1.0, 2.5]), "high": np.array([7.0, 9.0])}
    line = Line(
        np.array([0.0, 1.0]), np.array([2.0, 3.0]), "a", "ink", **{k: ends[k] for k in sides}
    )
    data = PlotData()
    data.add(Plot("a", "a", (Panel("x", "", "y", "", (line,)),)))
    (told,) = data.plots[0]["panels"][0]["lines"]
    for side, end, reach in (("low", "down", [1.0, 0.5]), ("high", "up", [5.0, 6.0])):
        place = told[end]
        if side in sides:
            values = np.frombuffer(base64.b64decode(data.arrays[place]), "<f4")
            assert values.tolist() == reach
        else:
            assert place is None


def test_the_member_of_a_sweep_that_changes_nothing_has_the_colour_of_the_text(
    monkeypatch,
) -> None:
    monkeypatch.setattr("damperfit.report.log_figures.sweep_sentence", lambda *_: "")
    time = np.arange(100) / 100.0
    response = SimpleNamespace(time=time, velocity=time, force=time)
    members = [
        SimpleNamespace(factor=factor, frequency=2.0, response=response) for factor in (0.1, 1.0, 2)
    ]
    lines = sweep_plot("r_m1", members, file_name="a", title="a").panels[0].lines
    assert [line.label for line in lines] == ["r_m1 x0.1", "r_m1 x1", "r_m1 x2"]
    assert [line.colour == "ink" for line in lines] == [False, True, False]


# Parameters against setting.


def rows_of(*fits):
    return make_tables(campaign(*fits)).parameters.to_pylist()


def drawn(rows):
    plots = parameter_plots(rows, setting_colours(row["setting"] for row in rows))
    return {plot.name.removeprefix("parameter_"): plot for plot in plots}


def test_a_parameter_that_is_not_known_hides_no_other() -> None:
    rows = rows_of(*(fit(k, status={"r_m1": "not_identifiable"}) for k in (1, 2)))
    assert list(drawn(rows)) == ["r_m2", "k_e"]
    rows = rows_of(fit(1, f_0=-12.0), fit(2))
    assert list(drawn(rows)) == ["r_m1", "r_m2", "k_e", "f_0"]


@pytest.mark.parametrize(("share", "is_far"), [(0.999, False), (1.001, True)])
def test_a_value_below_is_off_the_scale_beyond_three_heights(share, is_far) -> None:
    # Fitted: 510 and 520 MPa, a height of 10; three of them below: 480.
    rows = rows_of(fit(1), fit(2), fit(3, status={"k_e": "at_bound"}))
    rows[2]["k_e"] = 510e6 - share * 30e6
    plot = drawn(rows)["k_e"]
    assert ("off the scale" in plot.caption) is is_far
    assert [line.style for line in plot.panels[0].lines].count("below") == is_far


# The parameters of one setting in a sentence.


@pytest.mark.parametrize(
    ("f_0", "status", "words"),
    [
        (0.0, "fixed", ""),
        (0.0, "fitted", ", f_0 = 0 N"),
        (-12.5, "fixed", ", f_0 = -12.500 N (fixed)"),
    ],
)
def test_a_setting_tells_the_offset_where_it_is_part_of_the_model(f_0, status, words) -> None:
    (row,) = rows_of(fit(1, f_0=f_0, status={"f_0": status}))
    assert parameter_line(row).endswith(f"f_f = 50.000 N (shared){words}.")


def test_a_setting_tells_each_parameter_with_what_became_of_it() -> None:
    status = {"r_m1": "not_identifiable", "k_e": "at_bound"}
    (row,) = rows_of(fit(1, status=status))
    assert parameter_line(row) == (
        "R_m1 cannot be determined, R_m2 = 2.2000e6 N s/(m2 kg), R_m3 = 2.5970e6 N s/(m2 kg) "
        "(shared), K_e = 510.00 MPa (at bound), f_f = 50.000 N (shared)."
    )
    assert "R_m3" not in parameter_line(row | {"r_m3": None})


# What inspect tells.


def finding(name: str, severity: str = "warning"):
    said = {"name": "gaps", "severity": severity, "sentence": "5 gaps", "value": 5, "unit": ""}
    return {"name": name, "verdict": "warnings", "findings": [said], "notes": ["time in ms"]}


@pytest.mark.parametrize(
    ("n", "who"), [(1, "0.csv"), (2, "0.csv and 1 other log"), (3, "0.csv and 2 other logs")]
)
def test_the_logs_that_a_sentence_is_true_of_are_counted(n, who) -> None:
    lines = list(finding_lines([finding(f"{k}.csv") for k in range(n)]))
    assert f"  {who}: gaps: 5 gaps" in lines


def test_notes_and_what_was_assumed_are_left_out_on_request() -> None:
    logs = [finding("a.csv", "note"), finding("b.csv")]
    told = list(finding_lines(logs))
    assert told[told.index("Notes") + 1] == "  gaps: 5 gaps (1 of 2 logs)"
    assert told[told.index("Read as") + 1] == "  time in ms (2 of 2 logs)"
    assert list(finding_lines(logs, has_notes=False)) == told[: told.index("Notes") - 1]


def test_few_sentences_of_one_kind_hide_no_other_kind() -> None:
    logs = [finding(f"{k}.csv") for k in range(4)]
    logs[0]["findings"].insert(0, logs[0]["findings"][0] | {"name": "tare", "sentence": "off"})
    logs[3]["findings"].append(logs[0]["findings"][0] | {"name": "spikes", "sentence": "two"})
    for log, k in zip(logs, range(4), strict=True):
        log["findings"][int(k == 0)]["sentence"] = f"{k} gaps"
    lines = list(finding_lines(logs, has_notes=False))
    assert lines[3:] == [
        "  0.csv: tare: off",
        "  0.csv: gaps: 0 gaps. With other numbers in 1.csv, 2.csv, 3.csv",
        "  3.csv: spikes: two",
    ]
