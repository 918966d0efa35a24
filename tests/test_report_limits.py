"""Each sentence of the report that follows from a limit: a case just inside, one just outside."""

from __future__ import annotations

import itertools
import math
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from damperfit.adjustment import Outlier, Trend, TrendPoint
from damperfit.damper.mounting import Mounting
from damperfit.identification import Outcome
from damperfit.report import compared as comparison_sheet
from damperfit.report import page as templating
from damperfit.report.compared import NOTHING, _change
from damperfit.report.figures import setting_colours
from damperfit.report.inspection import _note_lines, finding_lines
from damperfit.report.log_figures import setting_plots
from damperfit.report.logs import evaluate_logs
from damperfit.report.markdown import escape, markdown_report
from damperfit.report.page import html_report, log_section, setting_verdict, summary
from damperfit.report.rounding import number, percent, with_interval
from damperfit.report.settings_figures import _named_speeds, _points, parameter_plots, report_plots
from damperfit.report.sheet import Sheet, sheet_width
from damperfit.report.tables import differ, grade_counts, parameter_sheet, sparkline, summary_sheet
from damperfit.results import Run
from damperfit.simulation import SpeedForce
from damperfit.tables import grade, make_tables
from damperfit.tested.setting import Setting
from damperfit.units.shown_units import SI
from tests.fakes import campaign, changed, fit
from tests.report_folder import make_results
from tests.test_report import FACTS

FINE = "every fit converged, good or better, without a flag"


def rows_of(*fits, expected=()):
    return make_tables(campaign(*fits), expected=expected).parameters.to_pylist()


def verdicts(*rows):
    shown = summary(Run(rows={"parameters": rows}), ())
    return dict(shown.listings)["Verdicts"]


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    return Run.load(make_results(tmp_path_factory.mktemp("results")))


def evaluated(results, *, record=None, **signals):
    """The log of setting 1 with other signals."""
    one = replace(results.signals[0], **signals)
    (found,) = evaluate_logs(changed(results, signals=(one,), record=record or {}))
    return found


# What is fine and what is not.


@pytest.mark.parametrize("outcome", Outcome)
def test_a_fit_is_fine_only_if_it_converged(outcome):
    (row,) = rows_of(fit(1))
    said = verdicts(row | {"outcome": outcome.value})
    if outcome is Outcome.CONVERGED:
        assert said == [FINE]
    else:
        assert said == [f"setting 1: excellent, MSE 0.0123 %; {outcome.value.replace('_', ' ')}"]


@pytest.mark.parametrize(("mse", "is_fine"), [(4.999, True), (5.0, False)])
def test_a_fit_is_fine_if_it_is_good_or_better(mse, is_fine):
    assert (verdicts(*rows_of(fit(1, mse=mse))) == [FINE]) is is_fine


@pytest.mark.parametrize("status", ["at_bound", "not_identifiable"])
def test_a_fit_with_a_flag_is_not_fine(status):
    (row,) = rows_of(fit(1))
    (said,) = verdicts(row | {"k_e_status": status})
    words = {"at_bound": "K_e at bound", "not_identifiable": "K_e not identifiable"}[status]
    assert said == f"setting 1: excellent, MSE 0.0123 %; converged; {words}"


def test_one_doubtful_setting_is_named_alone():
    rows = rows_of(fit(1), fit(2, mse=12.0), fit(3))
    assert verdicts(*rows) == ["setting 2: poor, MSE 12.0 %; converged"]
    assert verdicts() == []


def test_a_setting_without_a_fit_is_not_fine():
    rows = rows_of(fit(1), expected=(1, 2))
    assert verdicts(*rows) == ["setting 2: no grade, MSE - %; missing"]


@pytest.mark.parametrize(
    ("share", "words"), [(0.0, "converged"), (0.001, "converged; cavitates for 0.1 % of the cycle")]
)
def test_any_share_in_cavitation_is_a_flag(share, words):
    (row,) = rows_of(fit(1))
    said = setting_verdict(row | {"cavitation_fraction": share})
    assert said == f"excellent, MSE 0.0123 %; {words}"


def test_a_cavitating_fit_says_so_once():
    (row,) = rows_of(fit(1, outcome=Outcome.CAVITATING))
    assert setting_verdict(row) == ("excellent, MSE 0.0123 %; cavitates for 5.0 % of the cycle")
    assert setting_verdict(row | {"cavitation_fraction": None}).endswith("; cavitating")


# Grades: the sentence tells the limits that are used.


@pytest.mark.parametrize(
    ("mse", "word"), [(0.9999, "excellent"), (1.0, "good"), (4.9999, "good"), (5.0, "poor")]
)
def test_grades_are_those_that_the_sentence_tells(mse, word):
    assert grade(mse) == word
    rows = rows_of(fit(1, mse=mse))
    assert grade_counts(rows) == f"Grades: 1 {word} (excellent below 1 %, good below 5 %)."
    assert parameter_sheet(rows).rows[0][-2] == word


def test_the_figure_of_the_mse_has_its_rules_where_the_grades_change(results):
    (plot,) = (plot for plot in report_plots(results).overall if plot.name == "mse")
    assert plot.panels[0].rules == ((1.0, "1 %: excellent below"), (5.0, "5 %: good below"))
    for limit, words in plot.panels[0].rules:
        assert words.endswith(f": {grade(limit - 1e-9)} below")
        assert grade(limit) != grade(limit - 1e-9)


def test_a_noise_floor_is_told_where_one_is_drawn(results):
    bare = changed(
        results, mse=tuple(row | {"noise_floor_percent": None} for row in results.rows("mse"))
    )
    told = {}
    for name, one in (("with", results), ("without", bare)):
        (plot,) = (plot for plot in report_plots(one).overall if plot.name == "mse")
        told[name] = "Dashed" in plot.caption
        is_drawn = any(line.style == "dashed" for line in plot.panels[0].lines)
        assert is_drawn is told[name]
    assert told == {"with": True, "without": False}


def test_grades_are_counted():
    rows = rows_of(fit(1), fit(2, mse=7.0), fit(3, mse=2.0), fit(4), fit(5, mse=7.0), fit(6, mse=9))
    assert grade_counts(rows).startswith("Grades: 2 excellent, 1 good, 3 poor (")


def test_grades_and_checks_stand_out_on_the_page(results):
    record = {"checks": [{"name": w, "passed": p} for w, p in (("a", True), ("b", False))]}
    page = html_report(report_plots(changed(results, record=record)), title="x")
    assert "<td class=well>excellent</td>" in page
    assert "<td class=ill>poor</td>" in page
    assert "<td class=well>passed</td>" in page
    assert "<td class=ill>FAILED</td>" in page


def test_the_headline_names_the_best_the_worst_and_the_middle():
    rows = tuple(rows_of(fit(1, mse=0.5), fit(2, mse=0.25), fit(3, mse=4.0), expected=range(1, 5)))
    lead = summary(Run(rows={"parameters": rows}), ()).lead
    assert lead == (
        "3 settings fitted. MSE: median 0.500 %, best 0.250 % at setting 2, worst 4.00 % at "
        "setting 3. Grades: 2 excellent, 1 good (excellent below 1 %, good below 5 %)."
    )
    assert summary(Run(rows={"parameters": rows[:1]}), ()).lead.startswith("1 setting fitted.")
    assert summary(Run(), ()).lead == "The tables hold no MSE."


# The test as the page tells it.


@pytest.mark.parametrize(("told", "shown"), [(1.5 * 1.019, "1.53 Hz"), (1.5 * 1.021, "1.5 Hz")])
def test_the_frequency_told_counts_within_two_per_cent_of_that_found(results, told, shown):
    """Two cycles, so that a frequency is found; its passages are 333.3 samples apart."""
    log = results.signals[0]
    time = np.arange(1000) / 500.0
    phase = 2.0 * np.pi * 1.5 * time
    signals = {
        "time": time,
        "displacement": 0.032 * np.sin(phase),
        "velocity": 0.3 * np.cos(phase),
        "force": np.cos(phase),
        "force_measured": np.cos(phase),
        "pressures": np.ones((3, 1000)),
    }
    record = {"inputs": [{"log": log.log, "frequency_Hz": told}]}
    section = log_section(evaluated(results, record=record, **signals), [], None)
    assert section.facts.startswith(f"{shown}, amplitude 32 mm, temperature not logged, 1000 ")


@pytest.mark.parametrize(("n", "has_forces"), [(7, False), (8, True)])
def test_a_log_of_fewer_than_eight_samples_has_no_figures(results, n, has_forces):
    phase = 2.0 * np.pi * np.arange(n) / n
    x, v = 0.032 * np.sin(phase), 0.3 * np.cos(phase)
    log = evaluated(
        results, time=np.arange(n) / (1.5 * n), displacement=x, velocity=v, force=v,
        force_measured=v, pressures=np.ones((3, n)),
    )  # fmt: skip
    section = log_section(log, [], None)
    assert (section.forces is not None) is has_forces
    assert section.facts.startswith("1.5 Hz" if has_forces else "frequency unknown")


def test_a_log_without_figures_says_so(results):
    log = replace(results.signals[0], displacement=np.zeros_like(results.signals[0].displacement))
    page = html_report(report_plots(changed(results, signals=(log,))), title="x")
    assert page.count("No whole cycle: no figures.") == 1
    whole = html_report(report_plots(changed(results, signals=results.signals[:1])), title="x")
    assert "No whole cycle" not in whole


@pytest.mark.parametrize(("bump", "ratio"), [(-0.001, True), (0.0, False), (0.001, False)])
def test_a_ratio_needs_forces_to_both_sides(results, bump, ratio):
    log = evaluated(results)
    measured = replace(log.measured, peak_force_rebound=100.0, peak_force_bump=bump)
    section = log_section(replace(log, measured=measured), [], None)
    (peak,) = (row for row in section.forces.rows if row[0] == "peak")
    assert (peak[5] != "-") is ratio


@pytest.mark.parametrize(
    ("pressure", "words"),
    [(1.0, "No chamber cavitates."), (0.0, "Shaded: cavitation, chamber 2 for 0.3 % of the cycle")],
)
def test_a_chamber_cavitates_at_zero_pressure(results, pressure, words):
    pressures = np.full_like(results.signals[0].pressures, 1e5)
    pressures[1, 100] = pressure
    view = evaluated(results, pressures=pressures)
    caption = setting_plots(view, name="a", colour="#000000")[4].caption
    assert caption.startswith(words)
    # The table of cavitation has the lowest of all cycles.
    assert caption.endswith(f"Lowest pressure of this cycle {pressures.min() / 1e5:.3g} bar.")


def test_a_log_that_does_not_reach_a_speed_hides_no_force_of_the_others(results):
    """The picture was empty where one log of a setting was slower than the others."""
    log = evaluated(results)
    fast, slow = (
        replace(log, measured=replace(log.measured, speed_forces=(SpeedForce(0.1, *pair),)))
        for pair in ((200.0, -300.0), (math.nan, math.nan))
    )
    (plot,) = _named_speeds([fast, slow])
    assert [line.y.tolist() for line in plot.panels[0].lines] == [[200.0], [-300.0]]
    (plot,) = _named_speeds([slow])
    assert all(np.isnan(line.y).all() for line in plot.panels[0].lines)


# Parameters against setting.


def _k_e(rows):
    plots = parameter_plots(rows, setting_colours(row["setting"] for row in rows))
    return next(plot for plot in plots if plot.name == "parameter_k_e")


@pytest.mark.parametrize(("share", "is_far"), [(0.999, False), (1.001, True)])
def test_a_value_at_a_bound_is_off_the_scale_beyond_three_heights(share, is_far):
    # Fitted: 510 and 520 MPa, a height of 10; three of them above: 550.
    rows = rows_of(fit(1), fit(2), fit(3, status={"k_e": "at_bound"}))
    rows[2]["k_e"] = 520e6 + share * 30e6
    assert ("off the scale" in _k_e(rows).caption) is is_far


def test_a_quantity_that_is_its_own_symbol_is_named_once():
    quantities = Mounting(series_stiffness="fit", play="fit").quantities
    row = {"setting": 1}
    for one in quantities:
        row |= {one.name: 5e-4, f"{one.name}_status": "fitted"}
        row |= {f"{one.name}_ci_low": 4e-4, f"{one.name}_ci_high": 6e-4}
    plots = {one.name: one for one in parameter_plots([row], {1: "#000000"}, quantities=quantities)}
    assert plots["parameter_play"].title == "play, against setting"
    assert plots["parameter_k_s"].title == "k_s, series stiffness, against setting"


@pytest.mark.parametrize("n", [3, 4])
def test_a_quadratic_is_drawn_through_four_settings_or_more(n):
    lines = _k_e(rows_of(*(fit(k) for k in range(1, n + 1)))).panels[0].lines
    assert any(line.label == "least-squares quadratic" for line in lines) is (n == 4)


# Rows: what is rounded how, and which columns there are.


@pytest.mark.parametrize(("reach", "shown"), [(0.0501, "+41.2 ± 0.1"), (0.0499, "+41.20 ± 0.05")])
def test_an_interval_is_told_to_its_own_digit(reach, shown):
    assert with_interval(41.2, 41.2 + reach, plus="+") == shown


@pytest.mark.parametrize(
    ("value", "high", "shown"),
    [
        (None, 1.0, "-"),
        (float("nan"), 1.0, "-"),
        (41.2, None, "41.2"),
        (41.2, float("nan"), "41.2"),
    ],
)
def test_an_interval_that_is_not_known_is_not_told(value, high, shown):
    assert with_interval(value, high) == shown


def test_numbers_have_no_exponent_where_that_reads_well():
    assert [number(x) for x in (0.001, 0.000999)] == ["0.0010000", "9.9900e-04"]
    assert [number(x) for x in (99999.0, 100000.0)] == ["99999", "1.0000e+05"]
    assert [percent(x) for x in (1e-4, 0.99e-4)] == ["0.000100", "9.9e-05"]


@pytest.mark.parametrize(
    ("f_0", "status", "is_shown"),
    [(0.0, "fixed", False), (0.1, "fixed", True), (0.0, "fitted", True)],
)
def test_an_offset_has_a_column_where_it_is_part_of_the_model(f_0, status, is_shown):
    rows = rows_of(fit(1, f_0=f_0, status={"f_0": status}))
    assert ("f_0" in parameter_sheet(rows).headings) is is_shown


@pytest.mark.parametrize(("more", "is_common"), [(0.9e-12, True), (1.1e-12, False)])
def test_what_is_the_same_at_all_settings_stands_below_the_table(more, is_common):
    rows = rows_of(fit(1), fit(2))
    rows[1]["r_m3"] *= 1.0 + more
    sheet = summary_sheet(rows)
    assert ("R_m3" not in sheet.headings) is is_common
    assert any("shared by all settings" in n and n.startswith("R_m3") for n in sheet.notes) is (
        is_common
    )


def test_many_quantities_stand_below_each_other_where_they_do_not_fit_beside():
    fitted = dict.fromkeys(("r_m3", "f_f", "f_0"), "fitted")
    rows = rows_of(fit(1, status=fitted))
    beside = summary_sheet(rows, columns=1)  # nothing fits: the narrowest
    assert beside.headings == (
        *("set", "R_m1", "R_m2", "R_m3", "K_e", "f_f", "f_0", "MSE", "outcome"),
    )
    wide = sheet_width(beside, gap=1)
    below = summary_sheet(rows, columns=wide - 1)
    assert below.headings == ("set", "", "1")
    assert sheet_width(below, gap=1) < wide
    lines = {row[0]: row[1:] for row in below.rows}
    assert lines["R_m1"] == ("1e3 s sqrt(N)/(m kg)", *(row[1] for row in beside.rows))
    assert lines["K_e"] == ("MPa", *(row[4] for row in beside.rows))
    assert lines["MSE"] == ("%", *(row[7] for row in beside.rows))
    assert lines["grade"] == ("", *(row["grade"] for row in rows))
    assert lines["outcome"] == ("", *(row[8] for row in beside.rows))
    assert summary_sheet(rows, columns=wide).headings == beside.headings


# Sparklines.


def _sparks(rows, symbol):
    """The line of a parameter, and the one that belongs to it."""
    notes = summary_sheet(rows).notes
    at = next((k for k, note in enumerate(notes) if note.startswith(f"{symbol} ")), None)
    return () if at is None else notes[at : at + 2]


def _k_e_rows(values, errors):
    rows = rows_of(*(fit(n) for n in range(1, len(values) + 1)))
    for row, value, error in zip(rows, values, errors, strict=True):
        row |= {"k_e": value, "k_e_se": error}
    return rows


FLAT = "     drawn flat: no two settings differ by more than their standard errors"
# 3 and 4 MPa: the difference of the first and the last has an error of 5 MPa.
ERRORS = (3e6, 9e6, 4e6)


@pytest.mark.parametrize("levels", ["▁▂▃▄▅▆▇█"])
def test_values_that_differ_by_less_than_their_errors_are_drawn_flat(levels):
    line, told = _sparks(_k_e_rows((500e6, 502e6, 504.99e6), ERRORS), "K_e")
    assert line == f"K_e  {levels[4] * 3}  500.0 to 505.0 MPa"
    assert told == FLAT


def test_values_that_differ_by_more_than_their_errors_fill_the_height():
    line, after = _sparks(_k_e_rows((500e6, 502e6, 505.01e6), ERRORS), "K_e")
    assert line == "K_e  ▁▄█  500.0 to 505.0 MPa"
    assert after != FLAT


def test_one_pair_that_differs_is_enough():
    """The widest pair may be the worst known: 500.0 and 500.5 are apart, whatever 490 is."""
    values, errors = (490e6, 500e6, 500.5e6, 512e6), (30e6, 0.1e6, 0.1e6, 30e6)
    line, _ = _sparks(_k_e_rows(values, errors), "K_e")
    assert line.startswith("K_e  ▁▄▄█")
    assert differ(values, errors)
    assert not differ((490e6, 500e6, 500.1e6, 512e6), errors)


@pytest.mark.parametrize("error", [None, float("nan"), 0.0])
def test_without_errors_any_difference_is_drawn(error):
    rows = _k_e_rows((500e6, 500.001e6, 500.002e6), (error,) * 3)
    assert _sparks(rows, "K_e")[0].startswith("K_e  ▁▅█")


def test_equal_values_are_flat_and_need_no_word():
    line, after = _sparks(_k_e_rows((500e6,) * 3, (1e6,) * 3), "K_e")
    assert line.startswith("K_e  ▅▅▅  500.0 to 500.0")
    assert after != FLAT


def test_an_unknown_value_stays_a_blank_on_a_flat_line():
    rows = _k_e_rows((500e6, 502e6, 900e6, 503e6), (3e6,) * 4)
    rows[2]["k_e_status"] = "at_bound"
    assert _sparks(rows, "K_e")[0].startswith("K_e  ▅▅ ▅  500.0 to 503.0 MPa")


@pytest.mark.parametrize(("n", "is_drawn"), [(2, False), (3, True), (60, True), (61, False)])
def test_sparklines_are_drawn_of_three_to_sixty_settings(n, is_drawn):
    assert bool(_sparks(rows_of(*(fit(k) for k in range(1, n + 1))), "K_e")) is is_drawn


def test_levels_are_reached_at_equal_steps():
    assert sparkline(range(8)) == "▁▂▃▄▅▆▇█"
    assert sparkline([0.0, 0.1249, 0.1251, 0.8749, 0.8751, 1.0]) == "▁▁▂▇██"


# Inspect.


@pytest.mark.parametrize("n", [3, 4])
def test_up_to_three_sentences_of_a_kind_are_told_one_by_one(n):
    logs = [
        {
            "name": f"{k}.csv",
            "verdict": "warnings",
            "findings": [
                {"name": "gaps", "severity": "warning", "sentence": f"{k} gaps", "value": k}
            ],
        }
        for k in range(1, n + 1)
    ]
    lines = list(finding_lines(logs))
    assert lines[0] == f"{n} logs: {n} usable with warnings"
    told = [line for line in lines if "gaps:" in line]
    assert len(told) == (3 if n == 3 else 1)
    if n == 4:
        assert told == ["  1.csv: gaps: 1 gaps. With other numbers in 2.csv, 3.csv, 4.csv"]


# report.md.


def test_math_of_a_name_is_no_math_in_the_report():
    """GitHub and many editors read dollars as mathematics, which CommonMark's tests do not see."""
    assert escape("$x_1$ and a$b$") == "\\$x_1\\$ and a\\$b\\$"
    text = markdown_report(make_tables(campaign(fit(1, logs=("$x_1$.csv",)))), FACTS)
    assert "| \\$x_1\\$.csv |" in text


@pytest.mark.parametrize("char", list("\\`*[]<>#|~&$@"))
def test_every_mark_is_escaped(char):
    assert escape(f"a{char}b") == f"a\\{char}b"


def test_the_report_counts_settings_in_words():
    for n, words in ((1, "1 setting fitted:"), (2, "2 settings fitted:")):
        text = markdown_report(make_tables(campaign(*(fit(k + 1) for k in range(n)))), FACTS)
        assert words in text


@pytest.mark.parametrize(
    ("passed", "said"),
    [
        ((True, True), "2 of 2 checks passed"),
        ((True, False), "1 of 2 checks passed"),
        ((True, None), "1 of 2 checks passed, 1 not evaluated"),
    ],
)
def test_checks_that_nobody_looked_at_are_not_passed(passed, said):
    from damperfit.checks import Check

    checks = tuple(Check(f"c{k}", p, "") for k, p in zip(itertools.count(), passed))
    text = markdown_report(make_tables(campaign(fit(1))), replace(FACTS, checks=checks))
    assert f"\n{said}\n" in text


# Several adjusters: trends along one with the others held.


def _two(rebound, compression):
    return Setting((("rebound", rebound), ("compression", compression)))


def _along(adjuster, held, values, *, outliers=()):
    points = tuple(TrendPoint(k, value, math.nan, math.nan, None) for k, value in values.items())
    off = tuple(Outlier(k, value, value, 0.2) for k, value in outliers)
    return Trend(
        *("k_e", "linear", 1, 0.0, False, "rising", True, (), off, True, points, "said"),
        adjuster=adjuster,
        held=held,
    )


def _k_e_of_two(trends, *, n=2):
    settings = [_two(r, c) for r in (2, 4) for c in range(8, 8 + n)]
    rows = rows_of(*(fit(k + 1) for k in range(len(settings))))
    for row, setting in zip(rows, settings, strict=True):
        row["setting"] = setting
    plots = parameter_plots(rows, setting_colours(settings), trends)
    return next(plot for plot in plots if plot.name == "parameter_k_e")


@pytest.mark.parametrize(("sentence", "end"), [("It rises.", " It rises."), ("", "table.")])
def test_a_caption_ends_with_what_is_known_of_the_trend(sentence, end):
    """A results folder of somebody else may not tell it."""
    rows = rows_of(*(fit(k) for k in (1, 2, 3)))
    trend = replace(_along("adjuster", "", {1: 6e8, 2: 7e8, 3: 8e8}), sentence=sentence)
    plots = parameter_plots(rows, setting_colours(row["setting"] for row in rows), (trend,))
    assert {plot.name: plot for plot in plots}["parameter_k_e"].caption.endswith(end)


def test_trends_run_along_each_adjuster_with_the_others_held():
    plot = _k_e_of_two(
        (
            _along("rebound", "compression 8", {2: 5e8, 3: 5.5e8, 4: 6e8}),
            _along("compression", "rebound 4", {8: 6e8, 9: 7e8}, outliers=[(9, 7.5e8)]),
            _along("compression", "rebound 99", {8: 1e8, 9: 1e8}),
        )
    )
    lines = {line.label: line for line in plot.panels[0].lines if line.colour == "muted"}
    # On the axis: R2 C8, R2 C9, R4 C8, R4 C9.
    rebound, compression = lines.values()
    assert list(lines) == [
        "trend along rebound, compression 8",
        "trend along compression, rebound 4",
    ]
    assert (rebound.x.tolist(), rebound.y.tolist()) == ([1.0, 3.0], [500.0, 600.0])
    assert (compression.x.tolist(), compression.y.tolist()) == ([3.0, 4.0], [600.0, 700.0])
    assert rebound.style != compression.style
    (ring,) = (line for line in plot.panels[0].lines if line.style == "rings")
    assert (ring.x.tolist(), ring.y.tolist()) == ([4.0], [750.0])
    assert "Broken lines: trends along one adjuster" in plot.caption
    assert "Broken lines" not in _k_e_of_two(()).caption


@pytest.mark.parametrize(("n", "is_named"), [(6, True), (7, False)])
def test_six_trends_have_a_legend(n, is_named):
    trends = [_along("rebound", f"compression {8 + k}", {2: 5e8, 4: 6e8}) for k in range(n)]
    lines = [line for line in _k_e_of_two(trends, n=n).panels[0].lines if line.colour == "muted"]
    assert [line.in_legend for line in lines] == [is_named] * n


def test_notes_that_differ_in_numbers_are_one_with_their_range() -> None:
    logs = [
        {
            "name": f"{k}.csv",
            "findings": [{"name": "skew", "severity": "note", "sentence": f"{k + 1} ms late"}],
        }
        for k in range(3)
    ]
    *_, line = _note_lines(logs)
    assert line.strip() == "skew: 1 to 3 ms late (3 of 3 logs)"


def test_a_change_in_units_has_its_interval_from_low_to_high() -> None:
    line = SimpleNamespace(
        percent=math.nan, difference=1.2, low=-3.1, high=5.5, subject=SimpleNamespace(unit="N")
    )
    assert _change(line) == ("+1.2 N", "-3.1 to +5.5")
    line.low = math.nan
    assert _change(line) == ("+1.2 N", NOTHING)


def test_numbers_of_compared_figures_stand_below_one_another(monkeypatch) -> None:
    monkeypatch.setattr(comparison_sheet, "verdict_of", lambda *_: "different")
    subject = SimpleNamespace(setting=3, label="energy", unit="J")
    line = SimpleNamespace(
        subject=subject, difference=1.5, high=2.0,
        first=SimpleNamespace(value=10.0), second=SimpleNamespace(value=11.5),
    )  # fmt: skip
    sheet = comparison_sheet.comparison_figure_sheet(SimpleNamespace(of=lambda _: [line], units=SI))
    ((*cells,),) = sheet.rows
    assert sheet.is_number == tuple(cell.lstrip("+")[0].isdigit() for cell in cells)


def test_curves_without_time_are_force_over_velocity() -> None:
    test = SimpleNamespace(velocity=np.arange(3.0), force=5.0 * np.arange(3.0))
    plot = _points([SimpleNamespace(name="A")], [(test,)], Setting.of(3), "a")
    (panel,) = plot.panels
    assert (panel.x_label, panel.x_unit, panel.y_label, panel.y_unit) == (
        "velocity", "m/s", "force", "N",
    )  # fmt: skip


@pytest.mark.parametrize(
    ("value", "reach", "said"),
    [
        (51.13, 0.37, "+51.1 ± 0.4"),
        (0.512, 0.0051, "+0.51 ± 0.01"),
        (0.5123, 0.0049, "+0.512 ± 0.005"),
        (0.00021, 0.0003, "+0.0002 ± 0.0003"),
        (0.0, 0.0, "+0.00 ± 0.00"),
    ],
)
def test_an_interval_in_kilonewtons_is_not_rounded_to_nothing(value, reach, said) -> None:
    assert with_interval(value, value + reach, plus="+") == said


def test_a_short_word_in_a_table_is_marked_as_one_that_is_not_torn() -> None:
    sheet = Sheet(
        headings=("setting", "grade", "log"),
        units=("", "", ""),
        rows=(
            ("3", "withheld", "a_very_long_name_of_a_log.csv"),
            ("4", "twelveletter", "thirteenlette"),
        ),
        is_number=(True, False, False),
    )
    macros = templating._environment().get_template("parts.html").module
    html = str(macros.table(sheet))
    assert "<td class=word>withheld</td>" in html
    assert "<td class=word>twelveletter</td>" in html
    assert "<td>thirteenlette</td>" in html
    assert "<td>a_very_long_name_of_a_log.csv</td>" in html
    assert re.search(r"td\.word[^{]*{ overflow-wrap: normal; }", str(templating.asset("page.css")))
