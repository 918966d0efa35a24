"""Peak force against peak speed (PVP), what all settings share, and where the page is entered."""

from __future__ import annotations

from dataclasses import replace

import pytest

from damperfit.adjustment import Click
from damperfit.recording import StretchFigures
from damperfit.report.forces import PeakPoint, peak_sheet
from damperfit.report.logs import evaluate_logs, has_several_speeds
from damperfit.report.page import _anchors, html_report, identity_of_test, page_tables
from damperfit.report.settings_figures import _peaks, report_plots
from damperfit.report.tables import parameter_sheet, shared_sentence
from damperfit.report.units import clicks_in_units, log_in_units, rows_in_units, sheet_in_units
from damperfit.tables import PAPER_QUANTITIES, make_tables
from damperfit.tested.setting import Setting
from damperfit.units.shown_units import parse_units
from tests.fakes import campaign, changed, fit

READ = StretchFigures(812.34, -604.5, 0.3016, 0.2987, 61.25, 0.15, 20.0, -18.0)


def point(setting, speed, *, scale=0.5) -> PeakPoint:
    measured = replace(READ, peak_speed_rebound=speed)
    simulated = replace(measured, peak_force_rebound=scale * READ.peak_force_rebound)
    return PeakPoint(Setting.of(setting), "a.csv", 1.5, measured, simulated)


@pytest.mark.parametrize(("speed", "is_several"), [(0.1049, False), (0.1051, True)])
def test_two_speeds_of_a_setting_are_several_beyond_five_per_cent(speed, is_several) -> None:
    assert has_several_speeds([point(1, 0.1), point(1, speed)]) is is_several
    assert not has_several_speeds([point(1, 0.1), point(2, 0.3)])  # each setting its own


def test_a_row_of_peaks_by_setting_and_speed() -> None:
    sheet = peak_sheet([point(3, 0.3), point(3, 0.1), point(1, 0.2)])
    assert [row[0] for row in sheet.rows] == ["1", "3", "3"]
    assert [row[2] for row in sheet.rows] == ["0.200", "0.100", "0.300"]
    assert sheet.rows[0] == (
        *("1", "1.50", "0.200", "812.3", "406.2", "0.299", "-604.5", "-604.5"),
        *("1.34", "0.672", "61.25"),
    )
    assert len(sheet.headings) == len(sheet.units) == len(sheet.is_number) == 11


@pytest.mark.parametrize(("n", "n_rows", "n_notes"), [(200, 200, 1), (201, 200, 2)])
def test_very_many_are_cut_with_a_word(n, n_rows, n_notes) -> None:
    sheet = peak_sheet([point(1, 0.1 + 0.01 * k) for k in range(n)])
    assert (len(sheet.rows), len(sheet.notes)) == (n_rows, n_notes)


def test_the_table_stands_on_the_page_where_several_speeds_were_tested(results) -> None:
    titles = [title for title, _ in page_tables(results, [point(1, 0.1), point(1, 0.3)])]
    assert titles[0] == "Peak force against peak speed (PVP)"
    assert titles[0] not in [title for title, _ in page_tables(results, [point(1, 0.1)])]


@pytest.fixture
def results(tmp_path):
    from damperfit.results import Run
    from tests.report_folder import make_results

    return Run.load(make_results(tmp_path / "results"))


def test_below_the_changes_by_click_stands_what_became_of_the_offset(results) -> None:
    click = {
        "from": 1, "to": 2, "speed_m_per_s": 0.3, "stroke": "rebound", "change_N": 41.2,
        "low_N": 40.0, "high_N": 42.0, "percent": 3.0, "percent_low": 2.0, "percent_high": 4.0,
        "adjuster": "setting", "held": {},
    }  # fmt: skip
    said = "forces by setting: the force offset (12 N) is the rig's tare"
    for sentences, notes in (({"force_offset": [said]}, (said,)), ({}, ())):
        one = changed(results, record={"clicks": [click], "sentences": sentences})
        (sheet,) = (s for title, s in page_tables(one) if title == "Change of force by click")
        assert sheet.notes[1:] == notes


def test_measured_peaks_lie_on_top_and_settings_keep_their_colour() -> None:
    plot = _peaks([point(1, 0.1), point(1, 0.3)], {Setting.of(1): "#123456"})
    words = [("measured" in line.label, line.colour) for line in plot.panels[0].lines]
    assert words == [(False, "#123456")] * 2 + [(True, "ink")] * 2


def test_what_all_settings_share_is_one_line() -> None:
    rows = make_tables(campaign(fit(1), fit(2))).parameters.to_pylist()
    said = shared_sentence(rows, PAPER_QUANTITIES)
    assert said == (
        "R_m3 = 2.5970e6 N s/(m2 kg), shared by all settings; "
        "f_f = 50.000 N, shared by all settings"
    )
    rows[1]["f_f"] = 51.0
    assert "f_f" not in shared_sentence(rows, PAPER_QUANTITIES)
    assert shared_sentence(rows[:1], PAPER_QUANTITIES) == ""


def test_the_table_of_the_page_has_no_column_of_what_all_settings_share(results) -> None:
    rows = make_tables(campaign(fit(1), fit(2))).parameters.to_pylist()
    sheet = parameter_sheet(rows, PAPER_QUANTITIES, says_shared_once=True)
    assert sheet.headings == ("set", "R_m1", "R_m2", "K_e", "MSE", "grade", "outcome")
    assert sheet.notes[0] == shared_sentence(rows, PAPER_QUANTITIES)
    assert {len(row) for row in sheet.rows} == {7}
    assert not [note for note in sheet.notes if "R_m3 in" in note or note.startswith("s ")]
    rows[1]["f_f"] = 51.0
    assert "f_f" in parameter_sheet(rows, PAPER_QUANTITIES, says_shared_once=True).headings
    one = changed(results, parameters=tuple(rows))
    (shown,) = (sheet for title, sheet in page_tables(one) if title == "Parameters")
    assert "R_m3" not in shown.headings


def test_whose_test_it_is_stands_in_order_and_what_is_empty_does_not() -> None:
    record = {
        "test": {"rig": "hall 2", "colour": "red", "operator": "", "serial": 7, "damper": "D"}
    }
    assert identity_of_test(record) == (
        *(("damper", "D"), ("serial", "7"), ("rig", "hall 2"), ("colour", "red")),
    )
    assert identity_of_test({"test": "no mapping"}) == ()


def test_each_log_has_an_anchor_of_its_own() -> None:
    named = Setting((("rebound", 3), ("bump", "soft/1")))
    alike = Setting((("rebound", 3), ("bump", "soft_1")))
    settings = [Setting.of(12), Setting.of(12), Setting.of(-3), named, alike]
    found = list(_anchors(settings))
    assert found[:3] == ["setting-12", "setting-12-log-2", "setting--3"]
    assert len(set(found)) == 5


POUND = 4.4482216152605
SHOWN = parse_units("lbf,in/s,in")


def test_a_page_in_other_units_scales_curves_and_tables_alike(results) -> None:
    plain, shown = report_plots(results), report_plots(results, SHOWN)
    for before, after in zip(plain.plots, shown.plots, strict=True):
        for one, two in zip(before.panels, after.panels, strict=True):
            units = {"N": ("lbf", POUND), "m/s": ("in/s", 0.0254), "mm": ("in", 25.4)}
            for axis, unit, told in (("x", one.x_unit, two.x_unit), ("y", one.y_unit, two.y_unit)):
                name, factor = units.get(unit, (unit, 1.0))
                assert told == name
                for a, b in zip(one.lines, two.lines, strict=True):
                    assert factor * getattr(b, axis) == pytest.approx(getattr(a, axis), nan_ok=True)
    page = html_report(shown, title="x")
    words = html_report(plain, title="x")
    forces = "<th class=n>measured</th><th class=n>simulated</th>"
    assert forces in page
    assert "<th>force, lbf</th>" in page
    assert "<th>force, N</th>" in words
    assert "3.93701 in/s" in page
    assert "0.1 m/s" in words


def test_tables_of_peaks_and_clicks_carry_the_units(results) -> None:
    mine = log_in_units(evaluate_logs(results)[0], SHOWN)
    plain = evaluate_logs(results)[0]
    assert mine.measured.peak_force_bump * POUND == pytest.approx(plain.measured.peak_force_bump)
    assert mine.measured.hysteresis_speed * 0.0254 == pytest.approx(plain.measured.hysteresis_speed)
    assert mine.measured.energy == plain.measured.energy
    assert mine.simulated.peak_force_bump * POUND == pytest.approx(plain.simulated.peak_force_bump)
    bare = log_in_units(replace(plain, measured=None, simulated=None), SHOWN)
    assert (bare.measured, bare.simulated) == (None, None)
    assert mine.measured.speed_forces[0].rebound * POUND == pytest.approx(
        plain.measured.speed_forces[0].rebound
    )
    sheet = sheet_in_units(peak_sheet([point(1, 3.94)]), SHOWN)
    assert sheet.units[2:5] == ("in/s", "measured, lbf", "simulated, lbf")
    click = Click(
        Setting.of(1), Setting.of(2), 0.1, "rebound", 44.482216, 40.0, 50.0, 7.0, 6.0, 8.0
    )
    (told,) = clicks_in_units([click], SHOWN)
    assert (told.change, told.percent) == (pytest.approx(10.0), 7.0)
    assert told.speed == pytest.approx(3.93701, rel=1e-5)


def test_rows_are_scaled_by_the_end_of_their_names() -> None:
    row = {"speed_m_per_s": 0.254, "force_N": POUND, "change_percent": 3.0, "setting": 4}
    assert rows_in_units([row], SHOWN) == [
        {"speed_m_per_s": 10.0, "force_N": 1.0, "change_percent": 3.0, "setting": 4}
    ]
