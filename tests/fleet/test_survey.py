"""The page of a fleet: medians and bands, who is far off, bands of tolerance, what is shown."""

import base64
import json
import math
import re

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest

from damperfit.cli.main import main
from damperfit.comparison import Tolerance, parse_tolerance
from damperfit.comparison.tolerance import Band
from damperfit.errors import ConfigurationError
from damperfit.fleets.page import (
    MOST_LINES,
    damper_sheet,
    fleet_page,
    outlier_sheet,
    series_plots,
    trend_plots,
)
from damperfit.fleets.parts import part_path, write_part
from damperfit.fleets.survey import fleet_against_bands, survey
from tests.fleet.made_up import failed_row, fleet_table

REBOUND, BUMP = "force_rebound_260_mm_per_s_N", "force_bump_260_mm_per_s_N"


def values(found, name: str = REBOUND):
    return found.values[found.values["series"] == name]


def test_a_series_has_median_and_middle_nine_tenths_by_setting():
    found = survey(fleet_table(41))
    assert [one.name for one in found.series] == ["r_m1", REBOUND, BUMP]  # none at 1.05 m/s
    assert [(one.speed, one.stroke, one.unit) for one in found.series[:2]] == [
        *((0.0, "", "s sqrt(N)/(m kg)"), (0.26, "rebound", "N")),
    ]
    bands = values(found).drop_duplicates("setting")
    assert [str(found.settings[k]) for k in bands["setting"]] == ["1", "2", "10"]
    # Values lie evenly from 980 to 1020 N.
    first = bands.iloc[0][["n_dampers", "median", "low", "high"]].tolist()
    assert first == pytest.approx([41, 1000.0, 982.0, 1018.0])
    assert values(found)["distance"].abs().max() == pytest.approx(2.0)
    assert found.outliers.empty


@pytest.mark.parametrize(("distance", "is_far"), [(7.99, False), (8.01, True), (-8.01, True)])
def test_far_off_begins_at_eight_deviations(distance, is_far):
    usual = values(survey(fleet_table(41)))
    # The damper at the edge of that side goes a little further: median and deviation stay.
    edge = usual[usual["setting"] == 0].sort_values("value").iloc[-1 if distance > 0 else 0]
    changed = {(edge.damper, "1"): {REBOUND: 1000.0 + distance * 10.0}}
    found = survey(fleet_table(41, changed=changed))
    far = found.outliers[["damper", "series", "setting"]].to_numpy().tolist()
    assert far == ([[edge.damper, REBOUND, 0]] if is_far else [])
    line = next(one for one in found.dampers if one.damper == edge.damper)
    assert line.n_outliers == is_far
    if is_far:
        assert found.outliers["distance"].iloc[0] == pytest.approx(distance)


@pytest.mark.parametrize(("n", "is_reported"), [(7, False), (8, True)])
def test_far_off_takes_eight_dampers(n, is_reported):
    found = survey(fleet_table(n, changed={("D3", "2"): {REBOUND: 5000.0}}))
    assert found.outliers.empty is not is_reported
    # Fewer are shown one by one, without a band.
    plot = series_plots(found)[1]
    lines = plot.panels[0].lines
    assert any(line.low is not None for line in lines) is is_reported
    assert ("No setting has 8 dampers" in fleet_page(found, title="x")) is not is_reported


@pytest.mark.parametrize(("share", "is_far"), [(0.0079, False), (0.0081, True)])
def test_dampers_that_are_all_alike_do_not_make_a_rounding_error_far_off(share, is_far):
    same = {(f"D{k}", s): {REBOUND: 1000.0} for k in range(1, 10) for s in ("1", "2", "10")}
    found = survey(fleet_table(9, changed=same | {("D4", "1"): {REBOUND: 1000.0 * (1 + share)}}))
    assert (REBOUND in set(found.outliers["series"])) is is_far


def test_those_who_are_far_off_do_not_hide_each_other():
    changed = {(f"D{k}", "1"): {REBOUND: 4000.0} for k in range(1, 5)}
    found = survey(fleet_table(12, changed=changed))
    assert set(found.outliers["damper"]) == {"D1", "D2", "D3", "D4"}


def test_the_same_damper_tested_eight_times_is_one_damper():
    table = fleet_table(8, changed={("D3", "2"): {REBOUND: 5000.0}})
    for column in ("serial", "damper"):
        k = table.column_names.index(column)
        table = table.set_column(k, column, pa.array(["D1"] * table.num_rows))
    assert survey(table).outliers.empty


def test_every_damper_is_a_line():
    dates = [f"2026-03-{k:02d}" for k in range(1, 11)]
    table = failed_row(failed_row(fleet_table(10, dates=dates), "D4", "20"), "D99")
    found = survey(table)
    assert len(found.dampers) == 11
    by_name = {one.damper: one for one in found.dampers}
    assert (by_name["D4"].n_settings, by_name["D4"].n_failures) == (3, 1)
    assert by_name["D4"].date == "2026-03-04"
    assert by_name["D4"].worst_mse == pytest.approx(0.103)
    assert (by_name["D99"].n_settings, by_name["D99"].grade) == (0, "")
    assert math.isnan(by_name["D99"].worst_mse)
    sheet = damper_sheet(found.dampers, most=MOST_LINES)
    assert [row[0] for row in sheet.rows] == [*(f"D{k}" for k in range(1, 11)), "D99"]
    short = damper_sheet(found.dampers, most=3)
    assert [row[0] for row in short.rows] == ["D99", "D4", "D10"]
    assert "The worst 3 of 11" in short.notes[0]


def test_change_over_the_date_is_beside_the_median_of_the_setting():
    dates = ["2026-03-01"] * 10 + ["2026-03-11"] * 10
    later = {
        (f"D{k}", s): {REBOUND: 1100.0 * (1 + number)}
        for k in range(11, 21)
        for number, s in enumerate(("1", "2", "10"))
    }
    plots = trend_plots(survey(fleet_table(20, dates=dates, changed=later)))
    assert [plot.name for plot in plots][1] == f"fleet_trend_{REBOUND}"
    (line,) = plots[1].panels[0].lines
    assert line.x.tolist() == [0.0, 10.0]
    # The median of all lies between: one half is near 1000 N, the other at 1100 N.
    assert line.y[1] - line.y[0] == pytest.approx(10.0, abs=2.0)
    assert plots[1].panels[0].x_label == "days since 2026-03-01"
    assert trend_plots(survey(fleet_table(20))) == ()
    assert trend_plots(survey(fleet_table(20, dates=["2026-03-01"] * 20))) == ()


def test_the_page_escapes_what_a_log_says_and_keeps_every_number_of_its_pictures():
    found = survey(failed_row(fleet_table(9), "<script>D</script>"))
    page = fleet_page(found, title="<i>fleet</i>")
    assert "<script>D<" not in page
    assert "&lt;b&gt;no&lt;/b&gt; force" in page
    assert "<i>fleet" not in page
    assert "StrictUndefined" not in page
    document = json.loads(
        re.search(r'<script type="application/json" id="data">(.*?)</script>', page)[1]
    )
    assert [plot["name"] for plot in document["plots"]] == [
        f"fleet_{name}" for name in (REBOUND, BUMP, "r_m1")
    ]
    line = document["plots"][0]["panels"][0]["lines"][0]
    median = np.frombuffer(base64.b64decode(document["arrays"][line["y"]]), "<f4")
    assert median == pytest.approx([1000.0, 2000.0, 3000.0])


def test_a_damper_has_one_line_of_what_is_far_off():
    changed = {("D3", s): {REBOUND: 9000.0} for s in ("1", "2", "10")}
    sheet = outlier_sheet(survey(fleet_table(20, changed=changed)))
    (row,) = sheet.rows
    assert (row[0], row[1], row[2], row[3]) == ("D3", "force in rebound at 0.26 m/s", "1", "9000.0")
    assert row[-1] == "2"
    # Numbers stand below one another, and so do ranges; words begin at the left.
    assert sheet.is_number == tuple(cell[0] in "+-0123456789" for cell in row)


@pytest.mark.parametrize(("text", "n_missed"), [("2.05%", 0), ("1.95%", 12), ("1%,100N", 0)])
def test_a_share_is_of_the_median_of_the_setting(text, n_missed):
    # The two at the edges are 2 % off, at three settings and in both strokes.
    held = fleet_against_bands(survey(fleet_table(41)), parse_tolerance(text))
    assert (held.n_points, held.n_dampers, len(held.missed)) == (246, 41, n_missed)
    assert len(held.worst) == (2 if n_missed else 0)
    assert held.sentence.startswith("2 of 41" if n_missed else "All 41 dampers are within")


def test_a_damper_without_a_fit_is_not_within_a_tolerance():
    held = fleet_against_bands(survey(failed_row(fleet_table(5), "D9")), parse_tolerance("50%"))
    (lost,) = held.missed
    assert (lost.run, lost.words) == (
        "D9", "not evaluated: it has no force at any named speed",
    )  # fmt: skip
    assert held.sentence == (
        "1 of 6 dampers are outside the tolerance or not evaluated, at 1 of 31 points, 1 of them "
        "not evaluated."
    )


def nominal(*bands: Band) -> Tolerance:
    return Tolerance("bands.csv", bands=bands)


def test_nominal_bands_hold_for_every_damper():
    found = survey(failed_row(fleet_table(5), "D9"))
    band = Band("1", 0.26, "rebound", 990.0, 1030.0)
    held = fleet_against_bands(found, nominal(band))
    told = {point.run: point.words for point in held.missed}
    assert set(told) == {"D9", "D1"}
    assert told["D9"] == "not evaluated: the setting was not tested"
    assert told["D1"] == "FAILS, 10 N outside"
    assert held.n_points == 6
    assert held.missed[0].run == "D9"
    every = fleet_against_bands(found, nominal(Band("", 0.26, "rebound", 0.0, 1e4)))
    assert [point.words for point in every.missed] == ["not evaluated: nothing was fitted"]


def test_a_band_at_a_speed_no_test_reaches_is_missed():
    held = fleet_against_bands(survey(fleet_table(2)), nominal(Band("1", 1.05, "bump", -1e4, 0.0)))
    assert {point.words for point in held.missed} == {
        "not evaluated: the test does not reach the speed"
    }


def test_a_band_at_a_speed_of_no_column_is_refused():
    with pytest.raises(ConfigurationError, match=r"no forces at 0\.27 m/s; expected its named"):
        fleet_against_bands(survey(fleet_table(2)), nominal(Band("1", 0.27, "bump", -1e4, 0.0)))


@pytest.fixture
def parts(tmp_path):
    """Ten dampers as parts, D3 far off."""
    table = fleet_table(10, changed={("D3", "2"): {REBOUND: 5000.0}})
    for k in range(10):
        rows = table.slice(3 * k, 3).drop_columns(["serial"])
        write_part(part_path(tmp_path / "out", f"D{k + 1}", "k"), rows, {"logs": [str(k)]})
    return tmp_path / "out"


def test_the_page_of_parts_that_are_there(parts, capsys):
    assert main(["fleet", "--report", "--out", str(parts)]) == 0
    said = capsys.readouterr()
    assert "fleet.html written" in said.err
    assert {path.name for path in (parts / "_fleet").iterdir()} >= {
        *("fleet.html", "fleet.parquet", "fleet.csv", "fleet_dampers.csv", "fleet_outliers.csv"),
    }
    assert (parts / "_fleet" / "fleet.html").stat().st_size < 1e6  # its script stands beside it
    assert (parts / "_fleet" / "plotly.min.js").exists()
    assert len(pd.read_csv(parts / "_fleet" / "fleet_dampers.csv")) == 10
    outliers = pd.read_csv(parts / "_fleet" / "fleet_outliers.csv")
    assert outliers[["damper", "series", "value"]].to_numpy().tolist() == [["D3", REBOUND, 5000.0]]


def test_a_fleet_out_of_its_tolerance_ends_with_4(parts, capsys):
    assert main(["fleet", "--tolerance", "5%", "--out", str(parts)]) == 4
    out = capsys.readouterr().out
    assert out.startswith("tolerance 5%: 1 of 10 dampers are outside the tolerance, at 1 of 60")
    assert "D3, setting 2, 0.26 m/s rebound: FAILS" in out
    assert not (parts / "_fleet" / "fleet.html").exists()
    arguments = ["fleet", "--tolerance", "5%", "--report", "--json", "--out", str(parts)]
    assert main(arguments) == 4
    document = json.loads(capsys.readouterr().out)
    assert document["dampers_out_of_tolerance"] == ["D3"]
    assert [point["run"] for point in document["points"]] == ["D3"]
    assert len(pd.read_csv(parts / "_fleet" / "fleet_tolerance.csv")) == 1
    assert "1 of 10 dampers are outside" in (parts / "_fleet" / "fleet.html").read_text()
    assert main(["fleet", "--tolerance", "400%", "--out", str(parts)]) == 0


def test_the_distribution_around_the_median_has_a_panel_of_its_own():
    found = survey(fleet_table(40, changed={("D7", "2"): {"r_m1": 40000.0}}))
    plots = {plot.name: plot for plot in series_plots(found)}
    shares, forces = (
        plots["fleet_r_m1"].panels[1],
        plots["fleet_force_bump_260_mm_per_s_N"].panels[1],
    )
    assert (shares.y_unit, forces.y_unit) == ("%", "N")
    wide, half, far = shares.lines
    assert list(wide.y) == list(half.y) == [0.0, 0.0, 0.0]
    # Evenly within 2 %: nine tenths lie within 1.8 %, half within 1 %.
    assert wide.high == pytest.approx([1.8] * 3, abs=0.1)
    assert half.high == pytest.approx([1.0] * 3, abs=0.1)
    assert half.low == pytest.approx([-1.0] * 3, abs=0.1)
    assert far.label == "D7, far off"
    assert far.y == pytest.approx([100.0 * (40000.0 / 28000.0 - 1.0)], abs=0.5)
    assert forces.lines[0].high == pytest.approx([9.0, 18.0, 27.0], abs=0.5)


def test_a_parameter_that_was_fitted_nowhere_is_not_drawn():
    table = fleet_table(9)
    nothing = pa.array([float("nan")] * table.num_rows)
    for values, is_drawn in (([0.0] * table.num_rows, False), (range(table.num_rows), True)):
        held = table.append_column("f_0", pa.array(values, pa.float64()))
        held = held.append_column("f_0_se", nothing)
        assert ("f_0" in {one.name for one in survey(held).series}) is is_drawn
    told = held.set_column(held.column_names.index("f_0"), "f_0", pa.array([1.0] * table.num_rows))
    errors = pa.array([0.1] * table.num_rows)
    told = told.set_column(told.column_names.index("f_0_se"), "f_0_se", errors)
    assert "f_0" in {one.name for one in survey(told).series}
