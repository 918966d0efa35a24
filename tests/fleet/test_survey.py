"""The page of a fleet: medians, bands, who is far off, tolerances, Cp, Cpk and run rules."""

import base64
import json
import math
import re

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest
from scipy.stats import chi2

from damperfit.cli.main import main
from damperfit.comparison.tolerance import Band, Tolerance, parse_tolerance
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
from damperfit.fleets.survey import DOMINATES, capability, fleet_against_bands, run_rules, survey

SETTINGS = ("1", "2", "10")
REBOUND, BUMP = "force_rebound_260_mm_per_s_N", "force_bump_260_mm_per_s_N"
ERROR = "force_rebound_260_mm_per_s_se_N"


def table_of(rows: list[dict]) -> pa.Table:
    unit = {b"unit": b"s sqrt(N)/(m kg)"}
    fields = []
    for field in pa.Table.from_pylist(rows).schema:
        if field.name == "r_m1":
            field = field.with_metadata(unit)  # noqa: PLW2901
        is_text = pa.types.is_null(field.type)
        fields.append(pa.field(field.name, pa.string()) if is_text else field)
    return pa.Table.from_pylist(rows, pa.schema(fields))


def fleet_table(n: int, *, changed=None, dates=None) -> pa.Table:
    """As `collect` makes it, of dampers whose values lie evenly around 1000 N by up to 2 %."""
    rows = []
    for k in range(n):
        share = 1.0 + 0.04 * (((7 * k) % n) / max(n - 1, 1) - 0.5)
        for number, setting in enumerate(SETTINGS, 1):
            row = {"serial": f"D{k + 1}", "damper": f"D{k + 1}", "setting": setting} | {
                "date": None if dates is None else dates[k],
                "r_m1": 14000.0 * share * number, "r_m1_se": 10.0,
                "mse_percent": 0.1 + 0.001 * k, "grade": "excellent",
                REBOUND: 1000.0 * share * number, BUMP: -500.0 * share * number,
                "force_bump_1050_mm_per_s_N": np.nan, "error_kind": None, "error": None,
            }  # fmt: skip
            rows.append(row | (changed or {}).get((f"D{k + 1}", setting), {}))
    return table_of(rows)


def failed_row(table: pa.Table, damper: str, setting: str | None = None) -> pa.Table:
    """One failure more."""
    error = {"error_kind": "LogError", "error": f"{damper}.csv: <b>no</b> force"}
    row = {"serial": damper, "damper": damper, "setting": setting} | error
    return pa.concat_tables([table, pa.Table.from_pylist([row], table.schema)])


def surveyed(n: int, **how):
    return survey(fleet_table(n, **how))


def values(found, name: str = REBOUND):
    return found.values[found.values["series"] == name]


def days(n: int) -> list[str]:
    return [str(date)[:10] for date in pd.date_range("2026-03-01", periods=n)]


def written(table: pa.Table, folder) -> None:
    """The parts of such a table, three settings each."""
    for k in range(table.num_rows // 3):
        rows = table.slice(3 * k, 3).drop_columns(["serial"])
        write_part(part_path(folder, f"D{k + 1}", "k"), rows, {"logs": [str(k)]})


# Medians, and who is far off


def test_a_series_has_median_and_middle_nine_tenths_by_setting():
    found = surveyed(41)
    assert [one.name for one in found.series] == ["r_m1", REBOUND, BUMP]  # none at 1.05 m/s
    told = [(one.speed, one.stroke, one.unit) for one in found.series[:2]]
    assert told == [(0.0, "", "s sqrt(N)/(m kg)"), (0.26, "rebound", "N")]
    bands = values(found).drop_duplicates("setting")
    assert [str(found.settings[k]) for k in bands["setting"]] == [*SETTINGS]
    # Values lie evenly from 980 to 1020 N.
    first = bands.iloc[0][["n_dampers", "median", "low", "high"]].tolist()
    assert first == pytest.approx([41, 1000.0, 982.0, 1018.0])
    assert values(found)["distance"].abs().max() == pytest.approx(2.0)
    assert found.outliers.empty


@pytest.mark.parametrize(("distance", "is_far"), [(7.99, False), (8.01, True), (-8.01, True)])
def test_far_off_begins_at_eight_deviations(distance, is_far):
    usual = values(surveyed(41))
    # The damper at the edge of that side goes a little further: median and deviation stay.
    edge = usual[usual["setting"] == 0].sort_values("value").iloc[-1 if distance > 0 else 0]
    found = surveyed(41, changed={(edge.damper, "1"): {REBOUND: 1000.0 + distance * 10.0}})
    far = found.outliers[["damper", "series", "setting"]].to_numpy().tolist()
    assert far == ([[edge.damper, REBOUND, 0]] if is_far else [])
    line = next(one for one in found.dampers if one.damper == edge.damper)
    assert line.n_outliers == is_far
    assert found.outliers["distance"].tolist() == pytest.approx([distance] * is_far)


@pytest.mark.parametrize(("n", "is_reported"), [(7, False), (8, True)])
def test_far_off_takes_eight_dampers(n, is_reported):
    found = surveyed(n, changed={("D3", "2"): {REBOUND: 5000.0}})
    assert found.outliers.empty is not is_reported
    # Fewer are shown one by one, without a band.
    lines = series_plots(found)[1].panels[0].lines
    assert any(line.low is not None for line in lines) is is_reported
    assert ("No setting has 8 dampers" in fleet_page(found, title="x")) is not is_reported


@pytest.mark.parametrize(("share", "is_far"), [(0.0079, False), (0.0081, True)])
def test_dampers_that_are_all_alike_do_not_make_a_rounding_error_far_off(share, is_far):
    same = {(f"D{k}", s): {REBOUND: 1000.0} for k in range(1, 10) for s in SETTINGS}
    found = surveyed(9, changed=same | {("D4", "1"): {REBOUND: 1000.0 * (1 + share)}})
    assert (REBOUND in set(found.outliers["series"])) is is_far


def test_those_who_are_far_off_do_not_hide_each_other_and_each_is_one_damper():
    changed = {(f"D{k}", "1"): {REBOUND: 4000.0} for k in range(1, 5)}
    assert set(surveyed(12, changed=changed).outliers["damper"]) == {"D1", "D2", "D3", "D4"}
    rows = fleet_table(8, changed={("D3", "2"): {REBOUND: 5000.0}}).to_pylist()
    alone = [row | {"serial": "D1", "damper": "D1"} for row in rows]
    assert survey(table_of(alone)).outliers.empty


def test_every_damper_is_a_line():
    table = failed_row(failed_row(fleet_table(10, dates=days(10)), "D4", "20"), "D99")
    found = survey(table)
    by_name = {one.damper: one for one in found.dampers}
    four, lost = by_name["D4"], by_name["D99"]
    assert (four.n_settings, four.n_failures, four.date) == (3, 1, "2026-03-04")
    assert four.worst_mse == pytest.approx(0.103)
    assert (lost.n_settings, lost.grade, math.isnan(lost.worst_mse)) == (0, "", True)
    sheet = damper_sheet(found.dampers, most=MOST_LINES)
    assert [row[0] for row in sheet.rows] == [*(f"D{k}" for k in range(1, 11)), "D99"]
    short = damper_sheet(found.dampers, most=3)
    assert [row[0] for row in short.rows] == ["D99", "D4", "D10"]
    assert "The worst 3 of 11" in short.notes[0]
    far = surveyed(20, changed={("D3", s): {REBOUND: 9000.0} for s in SETTINGS})
    (row,) = outlier_sheet(far).rows  # one for each damper
    assert row[:4] == ("D3", "force in rebound at 0.26 m/s", "1", "9000.0")
    assert row[-1] == "2"


def test_change_over_the_date_is_beside_the_median_of_the_setting():
    dates = ["2026-03-01"] * 10 + ["2026-03-11"] * 10
    later = {
        (f"D{k}", s): {REBOUND: 1100.0 * number}
        for k in range(11, 21)
        for number, s in enumerate(SETTINGS, 1)
    }
    plots = trend_plots(surveyed(20, dates=dates, changed=later))
    assert plots[1].name == f"fleet_trend_{REBOUND}"
    (line,) = plots[1].panels[0].lines
    assert line.x.tolist() == [0.0, 10.0]
    # The median of all lies between: one half is near 1000 N, the other at 1100 N.
    assert line.y[1] - line.y[0] == pytest.approx(10.0, abs=2.0)
    assert plots[1].panels[0].x_label == "days since 2026-03-01"
    for none in (None, ["2026-03-01"] * 20):
        assert trend_plots(surveyed(20, dates=none)) == ()


def test_the_page_escapes_what_a_log_says_and_keeps_every_number_of_its_pictures():
    found = survey(failed_row(fleet_table(9), "<script>D</script>"))
    page = fleet_page(found, title="<i>fleet</i>")
    assert "&lt;b&gt;no&lt;/b&gt; force" in page
    assert not any(one in page for one in ("<script>D<", "<i>fleet", "StrictUndefined"))
    data = re.search(r'<script type="application/json" id="data">(.*?)</script>', page)[1]
    document = json.loads(data)
    names = [plot["name"] for plot in document["plots"]]
    assert names == [f"fleet_{name}" for name in (REBOUND, BUMP, "r_m1")]
    line = document["plots"][0]["panels"][0]["lines"][0]
    median = np.frombuffer(base64.b64decode(document["arrays"][line["y"]]), "<f4")
    assert median == pytest.approx([1000.0, 2000.0, 3000.0])


def test_the_distribution_around_the_median_has_a_panel_of_its_own():
    found = surveyed(40, changed={("D7", "2"): {"r_m1": 40000.0}})
    plots = {plot.name: plot.panels[1] for plot in series_plots(found)}
    shares, forces = plots["fleet_r_m1"], plots[f"fleet_{BUMP}"]
    assert (shares.y_unit, forces.y_unit) == ("%", "N")
    wide, half, far = shares.lines
    # Evenly within 2 %: nine tenths lie within 1.8 %, half within 1 %.
    assert wide.high == pytest.approx([1.8] * 3, abs=0.1)
    assert (*half.high, *-half.low) == pytest.approx([1.0] * 6, abs=0.1)
    assert far.label == "D7, far off"
    assert far.y == pytest.approx([100.0 * (40000.0 / 28000.0 - 1.0)], abs=0.5)
    assert forces.lines[0].high == pytest.approx([9.0, 18.0, 27.0], abs=0.5)


@pytest.mark.parametrize(
    ("told", "error", "is_drawn"),
    [([0.0] * 27, None, False), (range(27), None, True), ([1.0] * 27, 0.1, True)],
)
def test_a_parameter_that_was_fitted_nowhere_is_not_drawn(told, error, is_drawn):
    errors = [error or math.nan] * 27
    held = fleet_table(9).append_column("f_0", pa.array(told, pa.float64()))
    held = held.append_column("f_0_se", pa.array(errors, pa.float64()))
    assert ("f_0" in {one.name for one in survey(held).series}) is is_drawn


# Tolerances


def nominal(*edges) -> Tolerance:
    return Tolerance("bands.csv", bands=(Band(*edges),))


@pytest.mark.parametrize(("text", "n_missed"), [("2.05%", 0), ("1.95%", 12), ("1%,100N", 0)])
def test_a_share_is_of_the_median_of_the_setting(text, n_missed):
    # The two at the edges are 2 % off, at three settings and in both strokes.
    held = fleet_against_bands(surveyed(41), parse_tolerance(text))
    assert (held.n_points, held.n_dampers, len(held.missed)) == (246, 41, n_missed)
    assert held.sentence.startswith("2 of 41" if n_missed else "All 41 dampers are within")


def test_nominal_bands_hold_for_every_damper_and_one_without_a_fit_is_not_within():
    found = survey(failed_row(fleet_table(5), "D9"))
    for band, n_points, told in (
        (parse_tolerance("50%"), 31, {"D9": "it has no force at any named speed"}),
        (nominal("1", 0.26, "rebound", 990.0, 1030.0), 6,
         {"D9": "the setting was not tested", "D1": "FAILS, 10 N outside"}),
        (nominal("", 0.26, "rebound", 0.0, 1e4), 16, {"D9": "nothing was fitted"}),
    ):  # fmt: skip
        held = fleet_against_bands(found, band)
        words = {one.run: one.words.removeprefix("not evaluated: ") for one in held.missed}
        assert (words, held.n_points) == (told, n_points)
    held = fleet_against_bands(found, parse_tolerance("50%"))
    assert held.sentence == (
        "1 of 6 dampers are outside the tolerance or not evaluated, at 1 of 31 points, 1 of them "
        "not evaluated."
    )
    beyond = fleet_against_bands(found, nominal("1", 1.05, "bump", -1e4, 0.0))
    assert {one.words for one in beyond.missed if one.run != "D9"} == {
        "not evaluated: the test does not reach the speed"
    }
    with pytest.raises(ConfigurationError, match=r"no forces at 0\.27 m/s; expected its named"):
        fleet_against_bands(found, nominal("1", 0.27, "bump", -1e4, 0.0))


# Cp, Cpk and run rules of fleets whose answers are known


def of_force(forces, error: float = 0.0, dates=None) -> pa.Table:
    """One force of setting 1 over dampers in order, everything else all alike."""
    alike = {REBOUND: 1000.0, BUMP: -500.0, ERROR: error}
    rows = fleet_table(len(forces), dates=dates).to_pylist()
    own = {f"D{k}": {REBOUND: force} for k, force in enumerate(forces, 1)}
    return table_of([r | alike | (own[r["damper"]] if r["setting"] == "1" else {}) for r in rows])


def capable(forces, error=0.0):
    found = survey(of_force(forces, error))
    return capability(
        found, fleet_against_bands(found, nominal("1", 0.26, "rebound", 940.0, 1030.0))
    )


def spread(n: int, mean: float, s: float) -> np.ndarray:
    drawn = np.random.default_rng(1).normal(size=n)
    return mean + s * (drawn - drawn.mean()) / drawn.std(ddof=1)


@pytest.mark.parametrize("error", [0.0, 6.0])
def test_the_measurement_is_taken_out_of_cp_and_cpk(error):
    # Dampers scatter by 8 N whatever the measurement adds to that.
    n, total = 30, math.hypot(8.0, error)
    (row,) = capable(spread(n, 1000.0, total), error)
    assert (row["s_N"], row["measurement_s_N"]) == (pytest.approx(8.0), pytest.approx(error))
    assert (row["cp"], row["cpk"]) == (pytest.approx(90 / 48), pytest.approx(30 / 24))
    variances = total**2 * (n - 1) / chi2.ppf([0.025, 0.975], n - 1) - error**2
    ends = 90.0 / (6.0 * np.sqrt(variances))
    assert [row["cp_ci_low"], row["cp_ci_high"]] == pytest.approx(ends.tolist(), rel=1e-6)
    if not error:  # Bissell's own formula
        reach = 1.959964 * math.sqrt(1 / (9 * n) + 1.25**2 / (2 * (n - 1)))
        assert row["cpk_ci_high"] - row["cpk"] == pytest.approx(reach)


def test_where_the_measurement_scatters_more_or_dampers_are_few_there_is_no_index():
    (row,) = capable(spread(12, 1000.0, 5.0), 5.1)
    assert (row["s_N"], row["cp"], row["cpk"], row["note"]) == (0.0, None, None, DOMINATES)
    # Little more than it: from this side no end can be told.
    (row,) = capable(spread(12, 1000.0, 6.0), 5.1)
    assert (row["cp"] > row["cp_ci_low"], row["cp_ci_high"]) == (True, None)
    assert len(capable(spread(10, 1000.0, 5.0))) == 1
    assert capable(spread(9, 1000.0, 5.0)) == capable(spread(20, 1000.0, 5.0), math.nan) == []


# Sigma by the moving range is 1.048 N: half the steps are of 1 N, as 0 1 0 -1 makes them.
QUIET = [1000.0 + (0, 1, 0, -1)[k % 4] for k in range(20)]


@pytest.mark.parametrize(
    ("changed", "rules", "ends"),
    [
        ({}, None, None),
        ({9: 1003.0}, None, None),
        ({9: 1003.2}, "1", (10, 10)),
        ({9: 997.8, 11: 997.8}, "2", (10, 12)),
        ({8: 1002.0, 9: 1001.2, 11: 1001.2, 12: 1001.2}, "3", (9, 13)),
        ({5: 1000.0} | dict.fromkeys(range(6, 14), 1000.9), "4", (7, 14)),
        ({5: 1000.0} | dict.fromkeys(range(6, 13), 1000.9) | {13: 999.0}, None, None),
    ],
)
def test_each_rule_names_the_dampers_of_its_own(changed, rules, ends):
    forces = [changed.get(k, force) for k, force in enumerate(QUIET)]
    # The median stays 1000 N and the moving range 1 N beside what is asked for.
    forces = [*QUIET, *forces, *QUIET]
    sentences, rows = run_rules(survey(of_force(forces, dates=days(len(forces)))))
    found = [(row["rules"], row["first_damper"], row["last_damper"]) for row in rows]
    assert found == ([(rules, *(f"D{k + 20}" for k in ends))] if rules else [])
    assert not rules or f"D{ends[0] + 20} (2026-0" in sentences[0]


# The command, on parts that are there


def test_a_page_and_a_tolerance_of_parts(tmp_path, capsys):
    written(fleet_table(10, changed={("D3", "2"): {REBOUND: 5000.0}}), tmp_path)
    out, there = ("--out", str(tmp_path)), tmp_path / "_fleet"
    assert main(["fleet", "--tolerance", "5%", *out]) == 4
    told = capsys.readouterr().out
    assert told.startswith("tolerance 5%: 1 of 10 dampers are outside the tolerance, at 1 of 60")
    assert "D3, setting 2, 0.26 m/s rebound: FAILS" in told
    assert not (there / "fleet.html").exists()
    assert main(["fleet", "--tolerance", "5%", "--report", "--json", *out]) == 4
    assert json.loads(capsys.readouterr().out)["dampers_out_of_tolerance"] == ["D3"]
    assert "1 of 10 dampers are outside" in (there / "fleet.html").read_text()
    assert (there / "fleet.html").stat().st_size < 1e6  # its script stands beside it
    assert (there / "plotly.min.js").exists()
    assert main(["fleet", "--tolerance", "400%", *out]) == 0
