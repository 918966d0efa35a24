"""The valves of each setting as a table, and as a figure of the page and as a file."""

from __future__ import annotations

import numpy as np
import pytest

from damperfit.damper.valve_characteristics import ValveCharacteristic
from damperfit.report.drawing import draw_plot
from damperfit.report.log_figures import valve_plots
from damperfit.report.settings_figures import report_plots
from damperfit.results import Run
from damperfit.tables import lay_out, valve_rows, write_table
from damperfit.tested.setting import Setting
from tests.fakes import changed
from tests.report_folder import make_results

RAMP = np.linspace(0.0, 8e5, 9)


def valve(stroke: str = "rebound", opening: float | None = 4e5) -> ValveCharacteristic:
    return ValveCharacteristic(stroke, 5e-4, RAMP, 1e-10 * RAMP, RAMP, 1.1e-10 * RAMP, opening)


def rows(*valves: ValveCharacteristic, setting: int = 1) -> list:
    return list(valve_rows(Setting.of(setting), valves))


def test_a_row_tells_pressure_flow_and_force_in_si() -> None:
    table = lay_out("valves", rows(valve()), settings=[Setting.of(1)])
    told = table.to_pylist()
    assert [row["curve"] for row in told] == ["measured"] * 9 + ["law"] * 9 + ["opening"]
    assert told[8] == {
        "setting": 1, "stroke": "rebound", "curve": "measured", "pressure_Pa": 8e5,
        "flow_m3_per_s": pytest.approx(8e-5), "valve_force_N": pytest.approx(400.0),
    }  # fmt: skip
    assert told[-1]["pressure_Pa"] == 4e5
    assert told[-1]["flow_m3_per_s"] is None


def test_bump_is_drawn_left_and_down_and_openings_are_marked_on_the_law() -> None:
    (plot,) = valve_plots(rows(valve(), valve("bump", 3e5)), Setting.of(1), colour="#123456")
    lines = plot.panels[0].lines
    assert [(line.label, line.style) for line in lines] == [
        *[("measured", "points")] * 2, *[("law", "wide")] * 2, *[("blow-off opens", "rings")] * 2,
    ]  # fmt: skip
    assert [line.in_legend for line in lines] == [True, False] * 3
    assert lines[0].x.max() == 8.0
    assert lines[1].x.min() == -8.0
    assert lines[2].y.max() == pytest.approx(88.0)
    assert lines[3].y.min() == pytest.approx(-88.0)
    ring = lines[5]
    assert (ring.x[0], ring.y[0]) == (pytest.approx(-3.0), pytest.approx(-33.0))
    assert plot.name == "setting_01_valves"
    assert "rebound at 4 bar (200 N); in bump at 3 bar (150 N)." in plot.caption


@pytest.mark.parametrize("lacking", ["pressure_Pa", "valve_force_N"])
def test_an_opening_of_which_a_table_lacks_a_number_is_not_told(lacking) -> None:
    told = rows(valve())
    (plot,) = valve_plots([*told[:-1], told[-1] | {lacking: None}], Setting.of(1), colour="#123456")
    assert "Blow-offs open" not in plot.caption
    # What else the table has of the stroke is.
    (plot,) = valve_plots([told[-1] | {lacking: None}, *told], Setting.of(1), colour="#123456")
    assert "Blow-offs open in rebound at 4 bar (200 N)." in plot.caption


@pytest.mark.parametrize(("opening", "rings"), [(8e5, 1), (8.01e5, 0)])
def test_an_opening_beyond_what_was_pressed_is_told_and_not_drawn(opening, rings) -> None:
    (plot,) = valve_plots(rows(valve(opening=opening)), Setting.of(1), colour="#123456")
    drawn = [line for line in plot.panels[0].lines if line.style == "rings"]
    assert len(drawn) == rings
    assert ("which these logs do not reach" in plot.caption) is not bool(rings)


def test_a_setting_without_valves_has_no_figure() -> None:
    assert valve_plots(rows(valve(), setting=2), Setting.of(1), colour="#123456") == ()
    (plot,) = valve_plots(rows(valve(opening=None)), Setting.of(1), colour="#123456")
    assert "Blow-offs" not in plot.caption


def test_each_setting_has_one_figure_however_many_logs_and_it_is_drawn(tmp_path) -> None:
    make_results(tmp_path)
    plain = Run.load(tmp_path)
    assert plain.rows("valves") == ()
    assert not any("valves" in plot.name for plot in report_plots(plain).plots)
    settings = sorted({log.setting for log in plain.signals})
    every = [row for one in settings for row in valve_rows(one, (valve(), valve("bump")))]
    table = lay_out("valves", every, settings=settings)
    write_table(tmp_path / "valves.parquet", table)
    results = Run.load(tmp_path)
    assert len(results.rows("valves")) == len(every)
    twice = changed(results, signals=tuple(log for one in results.signals for log in (one, one)))
    assert isinstance(twice, Run)
    plots = [plot for plot in report_plots(twice).plots if plot.name.endswith("_valves")]
    assert [plot.name for plot in plots] == [f"setting_{one.slug}_valves" for one in settings]
    draw_plot(tmp_path / "valves.png", plots[0], kind="png")
    assert (tmp_path / "valves.png").read_bytes()[:4] == b"\x89PNG"
