"""What the report reads off a log of several stretches: each with its own cycle rate."""

from __future__ import annotations

import math

import numpy as np
import pytest

from damperfit.report import logs as evaluated_log
from damperfit.report.forces import measured_stretch_sheet
from damperfit.report.log_figures import mean_branches, mean_strokes, setting_plots
from damperfit.report.logs import _evaluate, _stretches
from damperfit.report.page import log_section
from damperfit.report.settings_figures import campaign_plots
from damperfit.tables import LogSignals
from damperfit.tested.setting import Setting

RATE = 1000.0
SPEEDS = ((1.0, 0.03, 4), (2.0, 0.03, 6), (5.0, 0.004, 5))
GAP = 2.0  # s, before the last


def force_of(speed):
    """100 N at 0.1 m/s, 30 N of friction."""
    return 1000.0 * speed + 30.0 * np.sign(speed)


def log(*, moving=False):
    """Signals as in responses.parquet, and what run.json tells of them."""
    at, told, parts = 1.0, [], []
    for frequency, amplitude, cycles in SPEEDS:
        at += GAP if frequency == 5.0 else 0.0
        time = at + np.arange(round(cycles / frequency * RATE)) / RATE
        turn = 2.0 * np.pi * frequency * (time - at)
        parts.append(
            (time, amplitude * np.sin(turn), 2.0 * np.pi * frequency * amplitude * np.cos(turn))
        )
        kind = "moving" if moving and frequency == 5.0 else "steady"
        told.append(
            {
                "kind": kind,
                "start_s": at,
                "stop_s": at + cycles / frequency,
                "cycles": 0 if kind == "moving" else cycles,
                "frequency_Hz": frequency,
                "figures_start_s": at,
                "figures_stop_s": at + cycles / frequency,
            }
        )
        at += cycles / frequency
    time, x, v = (np.concatenate(one) for one in zip(*parts, strict=True))
    force = force_of(v)
    pressures = np.full((3, len(time)), 4.6e5)
    signals = LogSignals(Setting.of(3), "steps.csv", time, x, v, force, 1.1 * force, pressures)
    return signals, {"log": "steps.csv", "frequency_Hz": 2.0, "stretches": told}


def test_each_stretch_has_its_own_figures():
    view = _evaluate(*log())
    for one, (frequency, amplitude, cycles) in zip(view.stretches, SPEEDS, strict=True):
        speed = 2.0 * math.pi * frequency * amplitude
        assert (one.n_cycles, one.frequency) == (cycles, frequency)
        assert one.measured.peak_speed_rebound == pytest.approx(speed, rel=1e-3)
        assert one.measured.peak_force_rebound == pytest.approx(1000.0 * speed + 30.0, rel=1e-3)
        assert one.simulated.peak_force_bump == pytest.approx(-1100.0 * speed - 33.0, rel=1e-3)
        energy = math.pi * 1000.0 * speed * amplitude + 4.0 * 30.0 * amplitude
        assert one.measured.energy == pytest.approx(energy, rel=2e-3)
        assert one.simulated.energy == pytest.approx(1.1 * energy, rel=2e-3)
        cycle = view.signals.time[one.cycle]
        assert cycle[-1] - cycle[0] == pytest.approx(1.0 / frequency, abs=2.0 / RATE)
        assert np.all(np.diff(cycle) < 1.5 / RATE)


def test_the_log_stands_by_the_fastest_stretch():
    view = _evaluate(*log())
    assert view.frequency == pytest.approx(2.0)
    speed = 2.0 * math.pi * 2.0 * 0.03
    assert view.measured.peak_force_rebound == pytest.approx(1000.0 * speed + 30.0, rel=1e-3)
    times = view.signals.time[view.cycle]
    assert times[-1] - times[0] == pytest.approx(0.5, abs=3.0 / RATE)
    assert times[-1] < 1.0 + 4.0 + 3.0


def test_one_steady_run_is_as_before():
    signals, facts = log()
    facts["stretches"] = facts["stretches"][:1]
    assert _evaluate(signals, facts).stretches == ()


@pytest.mark.parametrize(
    "facts",
    [
        {"stretches": "three"},
        {"stretches": [{"kind": "moving"}, 7, None]},
        {
            "stretches": [{"kind": "steady", "start_s": 99.0, "stop_s": 98.0, "frequency_Hz": 1.0}]
            * 2
        },
        {
            "stretches": [{"kind": "steady", "start_s": None, "stop_s": "x", "frequency_Hz": 0.0}]
            * 2
        },
    ],
)
def test_damaged_facts_are_left_out(facts):
    signals, _ = log()
    assert _evaluate(signals, facts).stretches == ()


def test_plots_show_every_stretch_and_no_line_across_a_gap():
    view = _evaluate(*log())
    plots = {plot.name: plot for plot in setting_plots(view, name="setting_03", colour="#000000")}
    loops = plots["setting_03_force_velocity"].panels[0].lines
    assert [line.label for line in loops] == ["simulated"] * 3 + ["measured"] * 3
    assert sum(line.in_legend for line in loops) == 2
    peaks = plots["setting_03_peaks"].panels[0].lines
    assert [len(line.x) for line in peaks] == [3, 3, 3, 3]
    (over_time, _), (left, *_) = (panel.lines for panel in plots["setting_03_force_time"].panels)
    for line in (over_time, left):
        assert np.count_nonzero(np.isnan(line.x)) == 1
        assert not (np.diff(line.x[np.isfinite(line.x)]) > 1.9).sum() > 1
    assert plots["setting_03_force_velocity"].caption.startswith("Last cycle of each stretch")


def test_the_page_s_section_has_a_table_of_them():
    section = log_section(_evaluate(*log(moving=True)), (), None)
    assert section.facts.startswith("3 stretches, to 0.377 m/s")
    rows = section.stretches.rows
    assert [row[1] for row in rows] == ["4", "6", "moving"]
    assert rows[0][:6] == ("1.000", "4", "1.00", "0.188", "218.5", "240.3")
    assert rows[2][-1] == rows[2][-4]  # no hysteresis where nothing repeats


def test_the_report_lists_what_was_measured():
    entry = {
        "setting": Setting.of(3),
        "log": "steps.csv",
        "cycles": 4,
        "frequency_Hz": 1.0,
        "peak_speed_rebound_m_per_s": 0.1885,
        "peak_speed_bump_m_per_s": 0.19,
        "peak_force_rebound_N": 218.5,
        "peak_force_bump_N": -300.0,
        "energy_J": 21.36,
        "hysteresis_rebound_N": -43.5,
        "hysteresis_bump_N": None,
        "mse_percent": 0.0123,
    }
    sheet = measured_stretch_sheet([entry] * 61)
    told = ("3", "steps.csv", "4", "1.00", "0.190", "218.5", "-300.0", "21.36", "-43.5")
    assert sheet.rows[0][:9] == told
    assert (len(sheet.rows), sheet.notes[-1]) == (60, "1 more stretch in run.json")


# A road: what does not repeat is drawn by its means, for its strands are a tangle.


def road(n=20_000):
    """Random motion of a damper with 80 N between its branches."""
    turn = np.arange(n) / RATE
    x = 0.03 * np.sin(7.0 * turn) * np.cos(1.9 * turn) + 0.01 * np.sin(12.3 * turn)
    v = np.gradient(x, 1.0 / RATE)
    force = force_of(v) + 40.0 * np.sign(np.gradient(np.abs(v)))
    pressures = np.full((3, n), 4.6e5)
    signals = LogSignals(Setting.of(3), "road.csv", turn, x, v, force, 1.1 * force, pressures)
    told = {"kind": "moving", "start_s": 0.0, "stop_s": n / RATE, "cycles": 0, "frequency_Hz": 1.5}
    return _evaluate(signals, {"log": "road.csv", "stretches": [told]})


def all_of(*views):
    plots = campaign_plots(
        (), (), views, colours={view.signals.setting: "#123456" for view in views}
    )
    return {plot.name: plot for plot in plots}


def test_a_road_is_drawn_by_its_branches() -> None:
    view = road()
    plots, half_a_bin = all_of(view), np.ptp(view.signals.velocity) / 48.0
    lines = plots["absolute_velocity"].panels[0].lines
    assert [line.label for line in lines] == [
        f"setting 3, measured, mean, {word} branch" for word in ("opening", "closing") for _ in "rb"
    ]
    for line, (side, above) in zip(lines, [(1, 40), (-1, 40), (1, -40), (-1, -40)], strict=True):
        assert np.all(np.diff(side * line.x) > 0.0)  # a line, to the right or to the left
        inside = (
            line.x > 2.0 * half_a_bin
        )  # means of a bin that holds zero mix both signs of the friction
        wanted = side * (1000.0 * line.x + 30.0) + above
        assert line.y[inside] == pytest.approx(wanted[inside], abs=1000.0 * half_a_bin)
    assert len(plots["fan"].panels[0].lines) == 4
    for name in ("fan", "absolute_velocity"):
        assert "no cycle repeats: the mean force by velocity is drawn" in plots[name].caption


def test_the_caption_counts_the_logs_that_do_not_repeat() -> None:
    assert "Of 1 of 2 logs no cycle" in all_of(road(), _evaluate(*log()))["fan"].caption
    assert "cycle repeats" not in all_of(_evaluate(*log()))["fan"].caption


def test_a_road_s_own_force_against_velocity_is_of_means() -> None:
    plot = setting_plots(road(), name="setting_03", colour="#000000")[0]
    assert [line.label for line in plot.panels[0].lines] == [*["simulated"] * 2, *["measured"] * 2]
    assert max(len(line.x) for line in plot.panels[0].lines) <= 24
    assert plot.caption.startswith("Mean of the opening and of the closing branch; rebound")


def test_a_road_s_force_against_displacement_is_of_means_and_ranges() -> None:
    plot = setting_plots(road(), name="setting_03", colour="#000000")[1]
    lines = plot.panels[0].lines
    told = "measured, 5 and 95 %"
    strokes = ["measured", told, told]
    assert [line.label for line in lines] == [*["simulated"] * 2, *strokes, *strokes]
    assert [line.label for line in lines if line.in_legend] == ["simulated", "measured", told]
    assert max(len(line.x) for line in lines) <= 24
    rebound, bump = lines[:2]
    assert np.all(rebound.y > 0.0)
    assert np.all(bump.y < 0.0)
    for line in (rebound, bump):
        assert np.all((line.low <= line.y) & (line.y <= line.high))
    assert plot.caption.startswith("Mean over the samples of each stroke")


def test_a_road_beside_steady_runs_does_not_cover_their_loops() -> None:
    view = _evaluate(*log(moving=True))
    for plot in setting_plots(view, name="setting_03", colour="#000000")[:2]:
        assert len(plot.panels[0].lines) == 2 * 2
        assert plot.caption.startswith("Last cycle of each steady stretch")


def test_a_range_leaves_out_a_tenth_of_the_samples() -> None:
    x = np.tile(np.linspace(0.0, 0.024, 25)[:-1] + 5e-4, 101)
    force = np.repeat(np.arange(101.0), 24)
    (rebound,) = mean_strokes(x, np.ones(len(x)), force)
    assert rebound.word == "rebound"
    np.testing.assert_allclose(rebound.mean, 50.0)
    np.testing.assert_allclose(rebound.low, 5.0)
    np.testing.assert_allclose(rebound.high, 95.0)


@pytest.mark.parametrize(("n", "n_bins"), [(19, 0), (20, 1)])
def test_a_range_takes_twenty_samples(n, n_bins) -> None:
    x = np.concatenate([np.linspace(0.0, 1e-3, n), np.full(200, 0.1)])
    stroke, *other = mean_strokes(x, np.full(len(x), -0.1), np.ones(len(x)))
    assert stroke.word == "bump"
    assert not other
    assert int(np.sum(stroke.displacement < 0.01)) == n_bins


@pytest.mark.parametrize(("n", "n_bins"), [(2, 0), (3, 1)])
def test_a_mean_takes_three_samples(n, n_bins) -> None:
    # Rising throughout: one branch; only the first bin's number of samples changes.
    v = np.concatenate([np.linspace(1.0, 1.01, n), np.linspace(1.1, 2.0, 200)])
    opening, *closing = mean_branches(v, np.ones(len(v)))
    assert not closing
    assert int(np.sum(opening.velocity < 1.04)) == n_bins


@pytest.mark.parametrize(("n", "is_drawn"), [(23, False), (24, True)])
def test_fewer_samples_than_bins_have_no_means(n, is_drawn) -> None:
    # All but the last in the first bin.
    v = np.append(np.linspace(1.0, 1.001, n - 1), 2.0)
    assert bool(list(mean_branches(v, v))) is is_drawn


@pytest.mark.parametrize(
    ("kinds", "n"), [(["steady"], 0), (["moving"], 1), (["steady", "steady"], 2)]
)
def test_one_steady_run_is_the_log_itself(monkeypatch, kinds, n) -> None:
    monkeypatch.setattr(evaluated_log, "_stretch", lambda _, one: one["kind"])
    facts = {"stretches": [{"kind": kind} for kind in kinds]}
    assert len(_stretches(None, facts)) == n
