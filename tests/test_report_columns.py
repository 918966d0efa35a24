"""One number a column, known beforehand: every table of the page and of report.md.

What is shown was computed by hand from what is put in. All numbers of a row differ, so that a
swapped column, an inverted ratio, a lost factor or another unit fails.
"""

from __future__ import annotations

import json
import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from damperfit.adjustment import Click
from damperfit.checks import Check
from damperfit.damper.cavitation import Cavitation
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.report.facts import ReportFacts
from damperfit.report.forces import (
    click_sheet,
    cycle_force_sheet,
    cycle_pressure_sheet,
    force_by_setting_sheet,
    force_by_speed_sheet,
)
from damperfit.report.inspection import inspection_sheet
from damperfit.report.markdown import markdown_report
from damperfit.report.page import html_report
from damperfit.report.settings_figures import report_plots
from damperfit.report.tables import over_several_clicks, summary_sheet
from damperfit.results import Run
from damperfit.simulation import Characteristics, SpeedForce
from damperfit.tables import Tables, make_tables, table_schema
from damperfit.tested.setting import Setting
from damperfit.uncertainty import Prediction
from tests.fakes import campaign, fit, trace
from tests.report_folder import make_results

# Value and standard error, SI.
PARAMETERS = {
    "r_m1": (23951.0, 110.0),
    "r_m2": (4.9189e6, 3.9e3),
    "r_m3": (2.5962e6, 7.0e3),
    "k_e": (733.4e6, 1.4e6),
    "f_f": (49.905, 0.059),
    "f_0": (-12.5, 0.51),
}
SHOWN = {
    "set": "7",
    "R_m1 1e3": "23.95 ± 0.11",
    "R_m2 1e6": "4.9189 ± 0.0039",
    "R_m3 1e6": "2.5962 ± 0.0070",
    "K_e MPa": "733.4 ± 1.4",
    "f_f N": "49.905 ± 0.059",
    "f_0 N": "-12.50 ± 0.51",
    "MSE %": "0.432",
    "grade": "excellent",
    "outcome": "cavitating",
}
MSE_SHOWN = {
    "setting": "7",
    "log": "setting_07.csv",
    "MSE %": "0.432",
    "noise floor %": "0.0987",
    "grade": "excellent",
    "samples": "333",
    "outcome": "cavitating",
    "flags": "cavitates for 1.8 % of the cycle",
}
CHECKS = (
    Check("no_cavitation", passed=False, reason="setting 7 cavitates"),
    Check("hold_out", passed=None, reason="one log alone"),
    Check("fits_converged", passed=True, reason="all did"),
)
UNITS = "R_m1 in 1e3 s sqrt(N)/(m kg), R_m2 and R_m3 in 1e6 N s/(m2 kg)"


def parameter_row() -> dict[str, object]:
    row = {
        "setting": 7,
        "mse_percent": 0.4321,
        "grade": "excellent",
        "outcome": "cavitating",
        "n_samples": 999,
        "cavitation_fraction": 0.018,
        "r_m3_cavitation_margin": 0.16,
        "lowest_pressure": 0.59e5,
        "lowest_pressure_chamber": 2,
        "lowest_pressure_displacement": 0.007,
        "lowest_pressure_velocity": 0.29,
        "safe_gas_pressure": 3.98e5,
    }
    for name, (value, error) in PARAMETERS.items():
        row |= {name: value, f"{name}_se": error, f"{name}_status": "fitted"}
        row |= {f"{name}_ci_low": value - 2.0 * error, f"{name}_ci_high": value + 3.0 * error}
    return row


def mse_rows() -> list[dict[str, object]]:
    both = {"mse_percent": 0.4321, "noise_floor_percent": 0.0987, "n_samples": 333}
    return [
        {"setting": 7, "log": log, "grade": "excellent", "role": "fitted"} | both
        for log in ("", "setting_07.csv")
    ]


def arrow(name: str, rows: list[dict[str, object]]) -> pa.Table:
    return pa.Table.from_pylist(rows, schema=table_schema(name, {}))


class _Reader(HTMLParser):
    """The tables of a page by the heading before them, and the notes after each."""

    def __init__(self) -> None:
        super().__init__()
        self.tables: dict[str, list[list[str]]] = {}
        self.notes: dict[str, list[str]] = {}
        self.title = ""
        self.text: list[str] | None = None

    def handle_starttag(self, tag, attrs) -> None:
        if tag in {"h2", "h3", "td", "th"} or (tag == "p" and ("class", "note") in attrs):
            self.text = []
        if tag == "table":
            self.tables[self.title] = []
        if tag == "tr":
            self.tables[self.title].append([])

    def handle_data(self, data) -> None:
        if self.text is not None:
            self.text.append(data)

    def handle_endtag(self, tag) -> None:
        if self.text is None or tag not in {"h2", "h3", "td", "th", "p"}:
            return
        text, self.text = "".join(self.text), None
        if tag in {"h2", "h3"}:
            self.title = text
        elif tag == "p":
            self.notes.setdefault(self.title, []).append(text)
        else:
            self.tables[self.title][-1].append(text)


def named(headings: list[str], units: list[str], cells: list[str]) -> dict[str, str]:
    names = [f"{a} {b}".strip() for a, b in zip(headings, units, strict=True)]
    assert len(set(names)) == len(names)
    return dict(zip(names, cells, strict=True))


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """Setting 7 alone: its measured and its simulated force are known functions of x and v."""
    folder = make_results(tmp_path_factory.mktemp("results"))
    pq.write_table(arrow("parameters", [parameter_row()]), folder / "parameters.parquet")
    pq.write_table(arrow("mse", mse_rows()), folder / "mse.parquet")
    table = pq.read_table(folder / "responses.parquet")
    table = table.filter(pa.array([s == 1 for s in table.column("setting").to_pylist()]))
    x, v = (table.column(name).to_numpy() for name in ("displacement_m", "velocity_m_per_s"))
    new = {
        "setting": np.full(len(x), 7),
        "log": ["setting_07.csv"] * len(x),
        "force_measured_N": 2500.0 * v - 130.0 + 1000.0 * x,
        "force_N": 2000.0 * v - 110.0 + 500.0 * x,
    }
    for name, values in new.items():
        place = table.schema.get_field_index(name)
        kind = table.schema.field(place)
        table = table.set_column(place, kind, pa.array(values, type=kind.type))
    pq.write_table(table, folder / "responses.parquet")
    clicks = (
        (6, 7, 0.3, "rebound", 41.2, 2.0),
        (6, 7, 0.3, "bump", -17.5, 0.8),
        (6, 7, 0.1, "rebound", 11.1, 1.0),  # the fastest speed alone is shown
    )
    record = {
        "version": "1.2.3",
        "schema_version": 1,
        "procedure": ["Damper: rod 19 mm.", "Procedure: paper."],
        "configuration": {"rig": {"filter": "none", "centre": "gauge", "reverse_force": True}},
        "inputs": [{"log": "setting_07.csv", "temperature_degC": 26.4}],
        "checks": [{"name": c.name, "passed": c.passed, "reason": c.reason} for c in CHECKS],
        "clicks": [
            {"from": a, "to": b, "speed_m_per_s": speed, "stroke": stroke,
             "change_N": change, "low_N": change - reach, "high_N": change + reach}
            for a, b, speed, stroke, change, reach in clicks
        ],
    }  # fmt: skip
    (folder / "run.json").write_text(json.dumps(record), encoding="utf-8")
    results = Run.load(folder)
    assert results.remarks == ()
    reader = _Reader()
    reader.feed(html_report(report_plots(results), title="x"))
    return reader


def test_the_parameters_of_the_page(page):
    headings, units, cells = page.tables["Parameters"]
    assert named(headings, units, cells) == SHOWN
    assert page.notes["Parameters"] == [UNITS]


def test_the_mse_of_the_page(page):
    headings, units, cells = page.tables["MSE by setting and log"]
    assert named(headings, units, cells) == MSE_SHOWN


def test_the_cavitation_of_the_page(page):
    headings, units, cells = page.tables["How near to cavitation"]
    assert named(headings, units, cells) == {
        "setting": "7",
        "lowest pressure bar": "0.590",
        "in chamber": "2",
        "cavitates % of cycle": "1.80",
        "R_m3 margin %": "16.0",
        "gas bar at least": "3.98",
    }


def test_the_clicks_of_the_page(page):
    headings, units, cells = page.tables["Change of force by click"]
    assert named(headings, units, cells) == {
        "click": "6 to 7",
        "rebound N": "+41.2 ± 2.0",
        "bump N": "-17.5 ± 0.8",
    }
    assert page.notes["Change of force by click"] == ["At 0.3 m/s, simulated, with 95 % intervals."]


def test_a_change_over_three_clicks_says_so():
    """What lies between two tested settings was not tested, and may be uneven."""
    plain = Click(1, 4, 0.3, "rebound", 30.0, 29.0, 31.0, 5.0, 4.9, 5.1)
    steps = [plain, replace(plain, first=4, second=5)]
    rows = click_sheet(steps).rows
    assert [row[0] for row in rows] == ["1 to 4 (3 clicks)", "4 to 5"]

    def forces(*settings):
        fields = ("force_N", "force_ci_high_N", "change_N", "change_ci_high_N", "change_percent")
        return [
            {"setting": setting, "stroke": stroke, "speed_m_per_s": 0.3, **dict.fromkeys(fields, 9)}
            for setting in settings
            for stroke in ("rebound", "bump")
        ]

    said = "the change is over all clicks between two tested settings: "
    for sheet in (force_by_setting_sheet, lambda rows: force_by_speed_sheet(rows, "rebound")):
        near, apart = sheet(forces(1, 2, 3)), sheet(forces(1, 4, 5, 7))
        assert "click" in near.headings
        assert not any(note.startswith(said) for note in near.notes)
        assert "change" in apart.headings
        assert "click" not in apart.headings
        assert f"{said}1 to 4 (3 clicks), 5 to 7 (2 clicks)" in apart.notes
        assert not any("click: its change" in note for note in apart.notes)
    # Of several adjusters each one's own: R3 C5 and R6 C1 are no step.
    pairs = [Setting((("rebound", r), ("compression", c))) for r in (3, 6) for c in (1, 5)]
    (told,) = over_several_clicks(pairs)
    assert told.removeprefix(said) == (
        "R3 C1 to R6 C1 (3 clicks), R3 C5 to R6 C5 (3 clicks), R3 C1 to R3 C5 (4 clicks), "
        "R6 C1 to R6 C5 (4 clicks)"
    )
    (told,) = over_several_clicks(range(0, 14, 2))
    assert told.endswith("8 to 10 (2 clicks) and 1 more")


def test_the_forces_of_the_page(page):
    """Both forces are a v + b + c x: rebound a s + b, bump -a s + b, hysteresis -+2 c |x|."""
    headings, units, *rows = page.tables["Setting 7: forces"]
    assert headings == ["force, N", *("rebound",) * 2, *("bump",) * 2, *("ratio",) * 2]
    assert units == ["", *("measured", "simulated") * 3]
    cells = {row[0]: row[1:] for row in rows}
    assert cells["at 0.05 m/s"] == ["-5.000", "-10.00", "-255.0", "-210.0", "-", "-"]
    assert cells["at 0.26 m/s"] == ["520.0", "410.0", "-780.0", "-630.0", "0.667", "0.651"]
    peak = 0.032 * np.hypot(2500.0 * 3.0 * np.pi, 1000.0), 0.032 * np.hypot(6000.0 * np.pi, 500.0)
    expected = [peak[0] - 130.0, peak[1] - 110.0, -peak[0] - 130.0, -peak[1] - 110.0]
    # The largest sample of 333 is within 0.05 N of the peak.
    assert [float(cell) for cell in cells["peak"][:4]] == pytest.approx(expected, abs=0.1)
    ratios = [-expected[0] / expected[2], -expected[1] / expected[3]]
    assert [float(cell) for cell in cells["peak"][4:]] == pytest.approx(ratios, abs=6e-4)
    # At half of the peak speed x is 0.032 sqrt(3)/2 from the middle.
    at = 0.032 * np.sqrt(3.0)
    assert [float(cell) for cell in cells["hysteresis, 0.15 m/s"][:4]] == pytest.approx(
        [-1000.0 * at, -500.0 * at, 1000.0 * at, 500.0 * at], abs=0.02
    )
    assert cells["hysteresis, 0.15 m/s"][4:] == ["", ""]
    # pi a A^2 2 pi f; c x gives nothing over a cycle, which lasts 333.3 samples and is told as 333.
    told = page.notes["Setting 7: forces"][0]
    assert re.sub(r"\d\d\.\d\d", "#", told) == (
        "Energy per cycle: # J measured, # J simulated. Temperature: 26.4 degC."
    )
    energies = [float(one) for one in re.findall(r"\d\d\.\d\d", told)]
    exact = [np.pi * 0.032**2 * 3.0 * np.pi * a for a in (2500.0, 2000.0)]
    assert energies == pytest.approx(exact, rel=2e-3)


def test_the_facts_of_the_page(page):
    assert dict(page.tables["Summary"]) == {
        "damper": "rod 19 mm",
        "rig": "filter in the rig none, x = 0 at gauge, signs reversed: force",
        "test": "1 log, 1.50 Hz, amplitude 32.0 mm, 26.4 degC",
        "procedure": "paper",
        "made by": "damperfit 1.2.3",
    }


def test_the_checks_of_the_page(page):
    assert page.tables["Checks: 1 passed, 1 failed, 1 not evaluated"] == [
        ["check", "result", "reason"],
        ["no cavitation", "FAILED", "setting 7 cavitates"],
        ["hold out", "not evaluated", "one log alone"],
        ["fits converged", "passed", "all did"],
    ]


def test_every_table_of_the_page_is_looked_at_here(page):
    assert set(page.tables) == {
        "Summary",
        "Checks: 1 passed, 1 failed, 1 not evaluated",
        "Parameters",
        "MSE by setting and log",
        "Change of force by click",
        "How near to cavitation",
        "Setting 7: forces",
    }


def adjustment_rows() -> list[dict[str, object]]:
    """Force, half of its interval, change, half of its interval, change in per cent."""
    numbers = {
        ("rebound", 0.3, 6): (571.1, 1.4, None, None, None),
        ("rebound", 0.3, 7): (612.3, 1.5, 41.2, 2.0, 7.2),
        ("bump", 0.3, 6): (-387.6, 1.0, None, None, None),
        ("bump", 0.3, 7): (-405.1, 1.1, -17.5, 0.8, 4.5),
        ("rebound", 0.1, 7): (101.25, 0.3, 11.1, 1.0, 3.3),
    }
    return [
        {
            "setting": setting, "speed_m_per_s": speed, "stroke": stroke,
            "force_N": force, "force_se_N": 0.5 * reach,
            "force_ci_low_N": force - 2.0 * reach, "force_ci_high_N": force + reach,
            "change_N": change,
            "change_ci_low_N": None if change is None else change - 3.0 * change_reach,
            "change_ci_high_N": None if change is None else change + change_reach,
            "change_percent": percent, "change_percent_ci_low": -99.0,
            "change_percent_ci_high": 99.0,
        }
        for (stroke, speed, setting), (force, reach, change, change_reach, percent)
        in numbers.items()
    ]  # fmt: skip


def _other_motion(log):
    """The same log at another stroke and frequency."""
    return replace(log, stretches=(replace(log.fastest, amplitude=0.0201, frequency=2.25),))


@pytest.fixture(scope="module")
def sections():
    """report.md as its lines by section."""
    held_out = Prediction(
        setting=7,
        trace=_other_motion(trace(7, "b.csv")),
        is_part=True,
        mse_percent=0.625,
        noise_floor_percent=0.1,
        fitted_mse_percent=0.375,
        expected_mse_percent=0.25,
    )
    tables = Tables(
        arrow("parameters", [parameter_row()]),
        arrow("mse", mse_rows()),
        arrow("adjustment", adjustment_rows()),
    )
    facts = ReportFacts(version="1.2.3", checks=CHECKS, held_out=(held_out,))
    found: dict[str, list[str]] = {}
    for line in markdown_report(tables, facts).splitlines():
        if line.startswith("#"):
            lines = found.setdefault(line.lstrip("# "), [])
        elif line:
            lines.append(line)
    return found


def cells_of(lines: list[str]) -> list[list[str]]:
    """The rows of a section's table, its heading first, without the rule below it."""
    rows = [line[2:-2].split(" | ") for line in lines if line.startswith("|")]
    return [[cell.replace("\\", "") for cell in row] for row in (rows[0], *rows[2:])]


def test_the_parameters_of_the_report(sections):
    headings, cells = cells_of(sections["Parameters"])
    assert dict(zip(headings, cells, strict=True)) == SHOWN
    assert sections["Parameters"][-1] == UNITS


def test_the_mse_of_the_report(sections):
    headings, cells = cells_of(sections["MSE by setting and log"])
    assert dict(zip(headings, cells, strict=True)) == MSE_SHOWN


def test_what_was_held_out_in_the_report(sections):
    headings, cells = cells_of(sections["Held out: predicted, not fitted"])
    assert dict(zip(headings, cells, strict=True)) == {
        "set": "7",
        "held out": "b.csv",
        "cycles": "last 1",
        "ampl. mm": "20.1",
        "freq. Hz": "2.25",
        "MSE %": "0.625",
        "fitted %": "0.375",
        "verdict": "worse than fitted: 2.5 times the expected MSE",
    }


def test_the_checks_of_the_report(sections):
    assert sections["Checks"][0] == "1 of 3 checks passed, 1 not evaluated"
    assert cells_of(sections["Checks"]) == [
        ["check", "result", "reason"],
        ["no_cavitation", "FAILED", "setting 7 cavitates"],
        ["hold_out", "not evaluated", "one log alone"],
        ["fits_converged", "passed", "all did"],
    ]


def test_force_by_setting_in_the_report(sections):
    assert cells_of(sections["Across the settings"]) == [
        ["set", "rebound N", "click N", " %", "bump N", "click N", " %"],
        ["6", "571.1 ± 1.4", "-", "-", "-387.6 ± 1.0", "-", "-"],
        ["7", "612.3 ± 1.5", "+41.2 ± 2.0", "+7.2", "-405.1 ± 1.1", "-17.5 ± 0.8", "+4.5"],
    ]
    assert (
        "force at 0.3 m/s and its change by click, with 95 % intervals"
        in (sections["Across the settings"])
    )


def test_every_table_of_the_report_is_looked_at_here(sections):
    found = {title for title, lines in sections.items() if any(x.startswith("|") for x in lines)}
    assert found == {
        "Parameters",
        "MSE by setting and log",
        "Held out: predicted, not fitted",
        "Checks",
        "Across the settings",
    }


def test_the_summary_of_the_report(sections):
    assert sections["MSE report"] == [
        "1 setting fitted: MSE median 0.432 %, worst 0.432 % at setting 7.",
        "Grades: 1 excellent (excellent below 1 %, good below 5 %).",
    ]


def test_the_table_that_identify_ends_with():
    sheet = summary_sheet([parameter_row()], columns=120)
    assert named(list(sheet.headings), list(sheet.units), list(sheet.rows[0])) == {
        "set": "7",
        "R_m1 1e3": "23.95(11)",
        "R_m2 1e6": "4.9189(39)",
        "R_m3 1e6": "2.5962(70)",
        "K_e MPa": "733.4(14)",
        "f_f N": "49.905(59)",
        "f_0 N": "-12.50(51)",
        "MSE %": "0.432",
        "grade": "excellent",
        "outcome": "cavitating",
        "flags": "cav. 2 %",
    }


def test_the_table_of_one_stroke():
    rows = [row for row in adjustment_rows() if row["setting"] == 7]
    sheet = force_by_speed_sheet(rows, "rebound")
    assert named(list(sheet.headings), list(sheet.units), list(sheet.rows[0])) == {
        "set": "7",
        "0.1 m/s": "101.2",
        "0.3 m/s": "612.3",
        "click N": "+41.2 ± 2.0",
        "%": "+7.2",
    }


def test_the_tables_of_one_cycle():
    figures = Characteristics(
        peak_force_rebound=812.3,
        peak_force_bump=-604.5,
        peak_speed_rebound=0.3016,
        peak_speed_bump=0.2987,
        energy=61.25,
        hysteresis_speed=0.15,
        hysteresis_rebound=-21.5,
        hysteresis_bump=13.75,
        pressure_ranges=((3.1e5, 9.2e5), (0.6e5, 8.3e5), (4.2e5, 5.6e5)),
        cavitation_shares=(0.0, 0.123, 0.004),
        speed_forces=(SpeedForce(0.1, 222.2, -333.3),),
    )
    sheet = cycle_force_sheet(figures)
    assert (sheet.headings, sheet.rows) == (
        ("", "", "rebound", "bump"),
        (
            ("peak force", "N", "812.3", "-604.5"),
            ("peak speed", "m/s", "0.3016", "0.2987"),
            ("force at 0.1 m/s", "N", "222.2", "-333.3"),
            ("hysteresis at 0.15 m/s", "N", "-21.50", "13.75"),
            ("energy per cycle", "J", "61.25", ""),
        ),
    )
    sheet = cycle_pressure_sheet(figures)
    assert (sheet.headings, sheet.rows) == (
        ("", "", "chamber 1", "chamber 2", "chamber 3"),
        (
            ("lowest pressure", "bar", "3.100", "0.6000", "4.200"),
            ("highest pressure", "bar", "9.200", "8.300", "5.600"),
            ("cavitation", "% of cycle", "0.0", "12.3", "0.4"),
        ),
    )


def test_the_table_of_inspect():
    log = {
        "name": "a.csv", "setting": 7, "n_samples_read": 9876, "sample_rate_Hz": 512.5,
        "cycles_used": 12, "cycles_found": 14, "frequency_Hz": 1.525, "amplitude_m": 0.03215,
        "temperature_degC": 26.4, "verdict": "warnings",
    }  # fmt: skip
    sheet = inspection_sheet([log])
    assert named(list(sheet.headings), list(sheet.units), list(sheet.rows[0])) == {
        "log": "a.csv",
        "set": "7",
        "samples": "9876",
        "rate Hz": "512.5",
        "cycles used": "12 of 14",
        "freq. Hz": "1.525",
        "ampl. mm": "32.15",
        "temp. degC": "26.4",
        "verdict": "warnings",
    }


AXES = {
    "r_m1": ("R_m1", "10³ s √N / (m kg)", 23.951),
    "r_m2": ("R_m2", "10⁶ N s / (m² kg)", 4.9189),
    "r_m3": ("R_m3", "10⁶ N s / (m² kg)", 2.5962),
    "k_e": ("K_e", "MPa", 733.4),
    "f_f": ("f_f", "N", 49.905),
    "f_0": ("f_0", "N", -12.5),
}


@pytest.mark.parametrize("name", PURDY_DAMPER.names)
def test_a_parameter_is_drawn_in_the_unit_of_its_axis(name):
    from damperfit.report.settings_figures import parameter_plots

    plots = {plot.name: plot for plot in parameter_plots([parameter_row()], {7: "#000000"})}
    (panel,) = plots[f"parameter_{name}"].panels
    symbol, unit, value = AXES[name]
    assert (panel.y_label, panel.y_unit) == (symbol, unit)
    (point,) = (line for line in panel.lines if line.setting == 7)
    factor = value / PARAMETERS[name][0]
    error = factor * PARAMETERS[name][1]
    assert point.y == pytest.approx([value])
    assert (point.low, point.high) == (
        pytest.approx([value - 2.0 * error]),
        pytest.approx([value + 3.0 * error]),
    )


def test_the_columns_of_cavitation_are_those_of_the_fit():
    cavitation = Cavitation(
        fraction=0.018,
        lowest_pressure=5.9e4,
        chamber=2,
        displacement=0.007,
        velocity=0.29,
        r_m3_margin=0.16,
        safe_gas_pressure=3.98e5,
    )
    (row,) = make_tables(campaign(replace(fit(7), cavitation=cavitation))).parameters.to_pylist()
    names = [name for name in parameter_row() if "cavitation" in name or "pressure" in name]
    assert {name: row[name] for name in names} == {name: parameter_row()[name] for name in names}
    assert len(names) == 7


def test_a_letter_behind_a_setting_is_explained_once_below() -> None:
    fields = ("force_N", "force_ci_high_N", "change_N", "change_ci_high_N", "change_percent")
    rows = [
        {"setting": "L14 H3", "changed": changed, "stroke": stroke, "speed_m_per_s": 0.3}
        | dict.fromkeys(fields, 9)
        for changed in ("h", "l")
        for stroke in ("rebound", "bump")
    ]
    single = [{**row, "setting": 3, "changed": "setting"} for row in rows]
    for sheet in (force_by_setting_sheet, lambda told: force_by_speed_sheet(told, "rebound")):
        found = sheet(rows)
        assert [row[0] for row in found.rows] == ["L14 H3, h", "L14 H3, l"]
        said = [note for note in found.notes if "alone is turned" in note]
        (one,) = said
        assert one.startswith('"L14 H3, h": the change when h alone is turned; the forces of a ')
        assert not [note for note in sheet(single).notes if "alone is turned" in note]
