"""Force by speed: the damper alone at constant speed, its interval and end; and spreadsheets."""

import csv
import io
from dataclasses import replace

import numpy as np
import openpyxl
import pytest

from damperfit.damper.mounting import Mounting
from damperfit.damper.valve_dampers import Monotube, ThroughFlow, TwinTube
from damperfit.errors import ConfigurationError
from damperfit.exporting.targets import (
    TARGETS,
    ExportOptions,
    force_tables,
    road_misses,
    standard_road,
)
from damperfit.settings_and_logs import SettingResult
from damperfit.synthetic import made_up_values
from damperfit.tested.setting import Setting
from damperfit.units.shown_units import parse_units
from tests.exporting.conftest import told
from tests.exporting.reading_back import READERS
from tests.exporting.units import with_friction_error
from tests.oracles.steady import purdy_force, steady_force

SPEEDS = (0.005, 0.01, 0.025, 0.05, 0.13, 0.25)  # m/s: what a dyno's report is asked for
POUND = 4.4482216152605
RIG = Mounting(series_stiffness="fit", play="fit", lag="fit")
DAMPERS = (
    TwinTube(mounting=RIG),
    Monotube(gas_pressure=2e6, mounting=RIG),
    ThroughFlow(mounting=RIG),
)
TABLES = sorted(READERS)


def of_valves(handed, damper):
    settings = tuple(SettingResult(Setting.of(n), made_up_values(damper, n, 0.3)) for n in (1, 10))
    return replace(handed, damper=damper, settings=settings)


@pytest.mark.parametrize("name", TABLES)
@pytest.mark.parametrize("damper", DAMPERS, ids=lambda one: one.name)
def test_every_target_holds_the_force_of_a_steady_solver_of_the_same_valves(
    handed, damper, name
) -> None:
    """On a rig with 1/k_s, play, 8 ms of lag and a tare, none of which is the damper's."""
    run = of_valves(handed, damper)
    curves = READERS[name](TARGETS[name].export(run).files)
    gas = float(damper.rest_force(0.0))
    for setting in run.settings:
        values = {one: getattr(setting.values, one) for one in damper.names}
        v, force = curves[setting.setting.slug]
        for speed in (*SPEEDS, *(-one for one in SPEEDS)):
            truth = steady_force(damper.network, values, damper, speed) - gas
            assert np.interp(speed, v, force) == pytest.approx(truth, rel=0.01), speed


def test_points_lie_close_where_cars_are_tuned_and_at_knees_and_straight_through_rest(handed):
    damper = DAMPERS[0]
    run = of_valves(handed, damper)
    gas = float(damper.rest_force(0.0))
    for setting, table in zip(run.settings, force_tables(run), strict=True):
        v = table.speeds
        assert sum((v >= 0.005) & (v <= 0.05)) >= 10
        assert table.forces[v.tolist().index(0.0)] == 0.0
        middle = 0.5 * (v[1:] + v[:-1])
        middle = middle[np.abs(middle) > 0.005]
        known = {one: getattr(setting.values, one) for one in damper.names}
        truth = [steady_force(damper.network, known, damper, one) - gas for one in middle]
        line = np.interp(middle, v, table.forces)
        assert line == pytest.approx(np.array(truth), rel=0.006, abs=0.2)
    for setting, table in zip(handed.settings, force_tables(handed), strict=True):
        at = table.speeds.tolist().index(0.0)
        assert table.forces[at] == 0.0
        assert table.forces[at - 1] < -45.0 < 45.0 < table.forces[at + 1]  # friction
        assert table.level == pytest.approx(-130.4, abs=0.1)
        for speed in (*SPEEDS, *(-one for one in SPEEDS)):  # the paper's closed form
            truth = purdy_force(setting.values, handed.damper, speed) - table.level
            assert np.interp(speed, table.speeds, table.forces) == pytest.approx(truth, rel=0.01)


def test_each_quantity_s_error_and_their_correlation_are_in_the_interval(handed) -> None:
    """Of friction alone the interval is that of friction; of two that cancel there is none."""
    first = handed.settings[0]

    def half(names, covariance):
        one = replace(first, own=names, shared=(), covariance=np.array(covariance))
        (table,) = force_tables(replace(handed, settings=(one,)))
        assert table.has_interval == bool(np.any(covariance))
        return table.speeds, 0.5 * (table.high - table.low)

    speeds, by_friction = half(("f_f",), [[1e-4]])
    moving = speeds != 0.0
    assert by_friction[moving] == pytest.approx(1.959964 * 0.01 * first.values.f_f, rel=1e-4)
    assert by_friction[~moving] == 0.0
    _, apart = half(("r_m1", "f_f"), [[1e-4, 0.0], [0.0, 1e-4]])
    _, against = half(("r_m1", "f_f"), [[1e-4, -1e-4], [-1e-4, 1e-4]])
    rebound = speeds > 0.0
    assert (against[rebound] < apart[rebound]).all()
    assert half(("k_e",), [[1.0]])[1].max() == 0.0  # no matter at constant speed


def test_the_speed_up_to_which_a_force_is_determined_is_told_and_rows_beyond_are_marked(
    handed,
) -> None:
    """A blow-off that no log opened may open right above, or never."""
    run = of_valves(handed, DAMPERS[0])
    values = run.settings[1].values
    wide = replace(
        run.settings[1],
        own=("f_f",),
        covariance=np.array([[1e-6]]),
        top_speed=0.06,
        open_limits=(("compression_opening", (0.9 * values.compression_opening, 1e8)),),
    )
    run = replace(run, settings=(wide,))
    (table,) = force_tables(run)
    assert table.end == table.tested == 0.06
    assert table.tested <= table.determined < 0.2
    assert np.max(table.high - table.forces) < 0.5
    (more,) = force_tables(run, extend=0.3)
    moving = more.speeds != 0.0
    v, force, low, high = (one[moving] for one in (more.speeds, more.forces, more.low, more.high))
    reach = np.maximum(high - force, force - low) / np.abs(force)
    assert np.max(reach[np.abs(v) <= table.tested]) < 0.05 < np.max(reach)
    between = "untested" if table.determined >= 0.061 else "not determined"
    ranges = [more.range_of(v) for v in (0.05, -0.061, -0.25)]
    assert ranges == ["tested", between, "not determined"]
    assert more.low[0] < 1.5 * more.forces[0]  # of the bleed alone
    export = TARGETS["carsim"].export(run, ExportOptions(extend=0.3))
    assert f"to {table.determined:.2g} m/s at setting 10" in export.determined
    assert ("no log shows" in export.determined) == (table.determined > table.tested)
    assert b"not determined" not in TARGETS["adams"].export(run).files["damper_s10.dpr"]
    content = TARGETS["adams"].export(run, ExportOptions(extend=0.3)).files["damper_s10.dpr"]
    assert b"$ NOT DETERMINED from here on" in content


def test_nothing_beyond_the_tested_speed_unless_asked_and_then_marked(handed) -> None:
    slow = replace(handed.settings[0], top_speed=0.1)
    run = replace(handed, settings=(slow, *handed.settings[1:]))
    for how, ends in (
        *(({}, [0.1, 0.301, 0.301]), ({"extend": 0.2}, [0.2, 0.301, 0.301])),
        *(({"common": True}, [0.1] * 3), ({"extend": 0.45}, [0.45] * 3)),
    ):
        tables = force_tables(run, **how)
        assert [one.end for one in tables] == pytest.approx(ends)
        assert tables[0].is_extended == ("extend" in how)
    for name in TABLES:
        files = TARGETS[name].export(handed, ExportOptions(extend=0.45)).files
        text = b"".join(files.values()).replace(b"\x00", b"").decode("utf-8", "replace")
        assert "untested" in text.lower(), name
    for speed in (0.3, 1.6):
        with pytest.raises(ConfigurationError, match=r"above the tested 0.301 m/s and up to 5"):
            force_tables(handed, extend=speed)


def test_the_road_is_the_standard_one_and_velocity_is_its_derivative() -> None:
    road = standard_road()
    x, v = road.displacement, road.velocity
    # It repeats after 8 s, so its derivative is exact by its spectrum.
    n = len(x)
    lines = np.fft.rfft(x) * 2j * np.pi * np.fft.rfftfreq(n, road.interval)
    assert np.fft.irfft(lines, n) == pytest.approx(v, abs=1e-9)
    assert 0.1 < float(np.std(v)) < 0.16


def test_how_far_dynamics_are_from_the_table_is_told_at_three_speeds(handed) -> None:
    tables = force_tables(handed)
    shares = [[one.percent for one in road_misses(handed, table)] for table in tables]
    speeds = [one.speed for one in road_misses(handed, tables[0])]
    assert speeds == pytest.approx([0.05, 0.1, 0.25])
    assert shares[0][-1] < shares[1][-1] < shares[2][-1] < 30.0
    lost = TARGETS["csv"].export(handed).lost
    assert f"{shares[2][0]:.2g} % MSE" in lost
    assert "at setting 20" in lost
    slow = replace(handed, settings=tuple(replace(one, top_speed=0.1) for one in handed.settings))
    (table, *_) = force_tables(slow)
    assert [one.speed for one in road_misses(slow, table)] == pytest.approx([0.02, 0.04, 0.1])


# Spreadsheets: every table, its units, what a spreadsheet makes of them.


def workbook(handed, **options):
    content = TARGETS["xlsx"].export(handed, ExportOptions(**options)).files["damper.xlsx"]
    return openpyxl.load_workbook(io.BytesIO(content))  # a warning of its would be an error here


def rows_of(files, name, mark=","):
    return list(csv.reader(io.StringIO(files[name].decode()), delimiter=mark))


def heads_of(sheet, row=1):
    return [cell.value for cell in sheet[row]]


@pytest.mark.parametrize(
    ("text", "newtons", "metres"), [("", 1.0, 1.0), ("lbf,in/s", POUND, 0.0254)]
)
def test_one_sheet_a_table_with_units_and_a_frozen_heading(handed, text, newtons, metres) -> None:
    run = with_friction_error(handed, 1e-4)
    book = workbook(run, **({"units": parse_units(text)} if text else {}))
    force, speed = text.split(",") if text else ("N", "m/s")
    assert book.sheetnames == ["about", "forces", "parameters"]
    forces = book["forces"]
    assert (forces.freeze_panes, forces["A1"].font.b) == ("A3", True)
    settings = [f"setting {n}" for n in (1, 10, 20)]
    halves = [f"± 95 % of {one}" for one in settings]
    assert heads_of(forces) == [f"speed_{speed.replace('/', '_per_')}", *settings, *halves]
    assert heads_of(forces, 2) == [speed, *[force] * 6]
    table = force_tables(handed, common=True)[1]
    rows = np.array(list(forces.iter_rows(min_row=3, values_only=True)), dtype=float)
    assert newtons * rows[:, 2] == pytest.approx(table.forces)
    assert metres * rows[:, 0] == pytest.approx(table.speeds)
    assert newtons * rows[0, 4] == pytest.approx(1.959964 * 0.01 * 50.0, rel=1e-4)
    heads, units = heads_of(book["parameters"]), heads_of(book["parameters"], 2)
    assert (units[heads.index("k_e")], units[heads.index("f_f")]) == ("Pa", force)
    assert "rebound" in " ".join(str(row[0].value) for row in book["about"].rows)


def test_text_cannot_become_a_formula_and_bytes_are_the_same_each_time(handed) -> None:
    evil = workbook(told(handed, test={"damper": "=1+1\x07<&"}))
    assert "identity: damper =1+1 <&" in [str(row[0].value) for row in evil["about"].rows]
    cells = [cell for sheet in evil for row in sheet.rows for cell in row]
    assert all(cell.data_type != "f" for cell in cells)
    first, second = (TARGETS["xlsx"].export(handed, ExportOptions()).files for _ in range(2))
    assert first == second


def test_a_decimal_comma_comes_with_semicolons(handed) -> None:
    options = ExportOptions(decimal=",", units=parse_units("daN"))
    files = TARGETS["csv"].export(handed, options).files
    head, first, *_ = rows_of(files, "damper.csv", ";")
    ends = ["force_ci_low_daN", "force_ci_high_daN"]
    assert head == ["setting", "speed_m_per_s", "force_daN", "range", *ends]
    table = force_tables(handed, common=True)[0]
    assert float(first[2].replace(",", ".")) == pytest.approx(table.forces[0] / 10, abs=1e-3)
    assert b"." not in files["damper.csv"]
    head, first, *_ = rows_of(files, "damper_parameters.csv", ";")
    assert float(first[head.index("f_f [daN]")].replace(",", ".")) == pytest.approx(5.0)


@pytest.mark.parametrize("units", ["N", "lbf,in/s"])
def test_csv_says_of_each_row_whether_its_speed_was_tested(handed, units) -> None:
    tested = force_tables(handed)[0].tested
    options = ExportOptions(extend=2.0 * tested, units=parse_units(units))
    files = TARGETS["csv"].export(handed, options).files
    head, *rows = rows_of(files, "damper.csv")
    assert head[3] == "range"
    assert {row[3] for row in rows} == {"tested", "untested"}
    edge = tested * (1.0 if options.units.is_si else 1.0 / 0.0254)
    for row in rows:
        assert (row[3] == "tested") == (abs(float(row[1])) <= 1.0001 * edge)
    assert "UNTESTED" in files["damper_about.txt"].decode()
