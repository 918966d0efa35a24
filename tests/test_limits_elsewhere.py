"""Limits of modules that have one or two: a case just inside, one just outside."""

from __future__ import annotations

import math
import sys
from contextlib import contextmanager
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

from damperfit.adjustment.level import Level
from damperfit.atomic import recovery
from damperfit.atomic.owner import Owner
from damperfit.checks import physical_checks
from damperfit.cli.github import append_summary
from damperfit.cli.samples import _numbers
from damperfit.comparison import cycles, measured
from damperfit.comparison.tolerance import Point
from damperfit.conditioning.measured_characteristics import branch_forces
from damperfit.configuration.damper_section import _gas_pressure
from damperfit.configuration.plain_values import not_in_mhz, not_in_mm
from damperfit.configuration.what_is_tested import check_adjusters
from damperfit.damper import valve_curves
from damperfit.damper.network import BODY_NUMBERS, Network, Passage
from damperfit.damper.purdy.cavitation import _root
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.errors import ConfigurationError, OutputError
from damperfit.handover.fmu.archive import _data
from damperfit.handover.force_table import _speeds_beyond
from damperfit.handover.provenance import _mse
from damperfit.identification import Status
from damperfit.queries.one_simulation import SimulatedTest
from damperfit.readers import write_buffers
from damperfit.report.compared import tolerance_sheet
from damperfit.report.drawing import compose, fixed_style
from damperfit.report.figures import Line, Panel, Plot, setting_axis
from damperfit.report.forces import cycle_sparklines
from damperfit.report.log_figures import _force_time
from damperfit.report.logs import _stretch
from damperfit.report.sheet import Sheet, terminal_table
from damperfit.report.tables import Scale, setting_sparklines
from damperfit.run import like_speeds, rod_area
from damperfit.run.law_choice import _softest_and_stiffest
from damperfit.samples.logs import _is_sample
from damperfit.tables import reading
from damperfit.tested.identity import _listed
from damperfit.tested.setting import parse_place
from damperfit.uncertainty import linearisation, profile_walk, withheld
from damperfit.units.quantities import _hint


def is_refused(call, *arguments, error: type[Exception] = ConfigurationError) -> bool:
    try:
        call(*arguments)
    except error:
        return True
    return False


@dataclass(frozen=True, eq=False)
class _Logs:
    fitted: tuple[SimpleNamespace, ...]
    size: float


# Writing


@pytest.mark.parametrize(("hours", "may_live"), [(23.0, True), (25.0, False)])
def test_a_file_of_another_host_is_abandoned_after_a_day(hours, may_live) -> None:
    assert Owner("0" * 12, 1, 1, 1).may_live(3600.0 * hours) is may_live


@pytest.mark.parametrize(("late", "gives_up"), [(29.0, False), (31.0, True)])
def test_an_exchange_elsewhere_is_waited_for_half_a_minute(
    late, gives_up, monkeypatch, tmp_path
) -> None:
    @contextmanager
    def locked(*_, **__):
        yield SimpleNamespace(now=0.0)

    def settle() -> None:
        with recovery.recovered(tmp_path):
            pass

    clock, ends = iter([0.0, late, 1e9]), iter(["somebody is at it", ""])
    monkeypatch.setattr(recovery, "locked", locked)
    monkeypatch.setattr(recovery, "_undone", lambda *_: next(ends))
    monkeypatch.setattr(recovery, "_clean", lambda *_: None)
    no_wait = SimpleNamespace(monotonic=lambda: next(clock), sleep=lambda _: None)
    monkeypatch.setattr(recovery, "time", no_wait)
    assert is_refused(settle, error=OutputError) is gives_up


@pytest.mark.parametrize(("length", "is_whole"), [(950_000, True), (1_050_000, False)])
def test_a_summary_of_a_megabyte_is_too_long(length, is_whole, tmp_path) -> None:
    path = tmp_path / "summary.md"
    append_summary(path, "x" * length, instead="too long")
    assert (path.stat().st_size == length) is is_whole


@pytest.mark.parametrize(("before", "is_ours"), [(150, True), (180, False)])
def test_a_made_up_log_says_so_in_its_first_200_bytes(before, is_ours, tmp_path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("#" * before + "# rig: synthetic (damperfit samples)\n" + "1" * 200)
    assert _is_sample(path) is is_ours


# What is said on the command line and in a configuration


@pytest.mark.parametrize(("last", "refused"), [(1000, False), (1001, True)])
def test_a_thousand_settings_are_made(last, refused) -> None:
    assert is_refused(_numbers, f"1-{last}") is refused


@pytest.mark.parametrize(("pressure", "asked"), [(1.95e5, True), (2.05e5, False)])
def test_a_low_gas_pressure_is_asked_what_it_counts_from(pressure, asked) -> None:
    assert is_refused(_gas_pressure, pressure, error=ValueError) is asked


@pytest.mark.parametrize(("length", "refused"), [(1.95, False), (2.05, True)])
def test_an_amplitude_of_two_metres_was_meant_in_mm(length, refused) -> None:
    assert is_refused(not_in_mm, length, error=ValueError) is refused


@pytest.mark.parametrize(("frequency", "refused"), [(490.0, False), (510.0, True)])
def test_a_test_of_500_hz_was_meant_in_mhz(frequency, refused) -> None:
    assert is_refused(not_in_mhz, frequency, error=ValueError) is refused


@pytest.mark.parametrize(("n", "refused"), [(8, False), (9, True)])
def test_a_damper_has_eight_adjusters(n, refused) -> None:
    adjusters = {f"knob_{k}": None for k in range(n)}
    assert is_refused(check_adjusters, adjusters) is refused


@pytest.mark.parametrize(
    ("text", "refused"),
    [("1000000", False), ("1000001", True), ("a" * 40, False), ("a" * 41, True)],
)
def test_a_click_is_a_million_or_a_word_of_forty_letters(text, refused) -> None:
    assert is_refused(parse_place, text, error=ValueError) is refused


@pytest.mark.parametrize(("name", "unit"), [("inchh", "inch"), ("metr", "")])
def test_a_slip_is_seen_in_a_word_of_five_letters(name, unit) -> None:
    hint = _hint(name, dict.fromkeys(("inch", "metre")))
    assert hint == (f" Did you mean {unit!r}?" if unit else "")


@pytest.mark.parametrize(("n", "more"), [(3, ""), (4, " and 1 more")])
def test_three_values_of_a_test_are_named(n, more) -> None:
    assert _listed("abcd"[:n]) == f"a, b, c{more}"


@pytest.mark.parametrize(("samples", "n"), [(195.0, 1), (205.0, 0)])
def test_a_simulated_cycle_has_two_hundred_samples(samples, n) -> None:
    full = SimpleNamespace(cavitation_shares=(0.0, 0.0))
    choice = SimpleNamespace(warnings=lambda *_: ())
    response = SimpleNamespace(velocity=np.zeros(1))
    one = SimpleNamespace(
        samples_a_cycle=samples,
        characteristics=full,
        choice=choice,
        response=response,
        temperature=None,
    )
    assert len(SimulatedTest.warnings.fget(one)) == n


# Dampers


@pytest.mark.parametrize(("n", "refused"), [(16, False), (17, True)])
def test_a_network_has_sixteen_passages(n, refused) -> None:
    assert is_refused(Network, "one", (Passage(1, 3, orifice="a"),) * n) is refused


@pytest.mark.parametrize(("n", "refused"), [(45, False), (46, True)])
def test_a_network_has_forty_five_numbers(n, refused) -> None:
    names = [f"n{k}" for k in range(n - len(BODY_NUMBERS))]
    passages = [Passage(1, 3, *names[k : k + 4]) for k in range(0, len(names), 4)]
    assert is_refused(Network, "one", tuple(passages)) is refused


@pytest.mark.parametrize(("guess", "is_known"), [(960.0, True), (1040.0, False)])
@pytest.mark.parametrize("side", [1, -1])
def test_a_margin_is_looked_for_within_a_factor_of_a_thousand(guess, is_known, side) -> None:
    guess **= side
    found = _root(lambda factor: factor - guess, guess)
    assert math.isfinite(found) is is_known


@pytest.mark.parametrize(("n", "is_reported"), [(55, False), (56, True)])
def test_a_stroke_has_four_rows_for_each_of_fourteen_knees(n, is_reported) -> None:
    loop = SimpleNamespace(force=np.ones(n), force_rate=np.ones(n), velocity=np.ones(n))
    rows = valve_curves._rows(loop, 1.0, valve_curves.Side(1.0, 0.0), 0.0, 0.0)
    assert (rows is not None) is is_reported


@pytest.mark.parametrize(("share", "opens"), [(0.1944, False), (0.2438, True)])
def test_a_valve_opens_above_a_fifth_of_its_largest_pressure(share, opens, monkeypatch) -> None:
    """The seventh and the eighth knee stand at these shares."""
    drop = np.linspace(0.01, 1.0, 99)
    knees = np.geomspace(0.05, 0.95, 14)
    turns = np.where(np.abs(knees - share) < 1e-3, 1.0, 0.0)
    assert turns.sum() == 1.0
    rows = SimpleNamespace(
        drop=drop, knees=knees, displaced=drop, drop_rate=drop,
        solve=lambda: (np.concatenate([[0.0, 0.0], turns]), 0.0),
    )  # fmt: skip
    monkeypatch.setattr(valve_curves, "_rows", lambda *_: rows)
    loop = SimpleNamespace(velocity=np.ones(5))
    curve = valve_curves._curve(loop, 1.0, valve_curves.Side(1.0, 0.0), 0.0, 0.0)
    assert bool(curve.has_knee) is opens


@pytest.mark.parametrize("n", [1, 2, 3])
def test_laws_are_told_apart_by_the_softest_and_the_stiffest_setting(n) -> None:
    def logs(size):
        one = SimpleNamespace(force=size * np.array([1.0, -1.0]), compared=slice(None))
        return _Logs((one,), size)

    found = _softest_and_stiffest([logs(size) for size in (5.0, 1.0, 3.0)[:n]])
    assert [one.size for one in found] == [5.0, 1.0][:n]


@pytest.mark.parametrize(("sample", "is_luck"), [(9, False), (10, True), (11, True), (12, False)])
def test_two_samples_of_a_refilling_are_luck(sample, is_luck, monkeypatch) -> None:
    """A chamber is full again at sample 10; a quarter of the information there counts."""
    pressures = np.ones((3, 30))
    pressures[0, 5:10] = 0.0
    slope = np.zeros(30)
    slope[sample] = 7.0
    response = SimpleNamespace(pressures=pressures, sensitivities={"r_m1": slope})
    seen = SimpleNamespace(response=response, sensitivities=None)
    monkeypatch.setattr(linearisation, "apply_filter", lambda _, rows: rows)
    trace = SimpleNamespace(stretches=(SimpleNamespace(n_cycles=0),), model_filter=None)
    (row,) = linearisation._sensitivities(trace, seen)
    assert row[sample] ** 2 == pytest.approx(0.25 * 7.0**2 if is_luck else 7.0**2)


# Comparing


TOLD = {"frequency_Hz": 1.0, "start_s": 0.0, "stop_s": 1.0}


@pytest.mark.parametrize(("n", "is_known"), [(7, False), (8, True)])
def test_eight_samples_of_a_cycle_are_compared(n, is_known) -> None:
    time = np.linspace(0.0, 0.99, n)
    rows = ("displacement", "velocity", "force_measured", "force")
    signals = SimpleNamespace(time=time, **dict.fromkeys(rows, time))
    assert (cycles._cycles(signals, TOLD) is not None) is is_known


@pytest.mark.parametrize(("ratio", "scatters"), [(6.55, False), (6.72, True)])
def test_tests_repeat_worse_than_noise_once_in_a_hundred(ratio, scatters, monkeypatch) -> None:
    """Two tests of one setting have one degree of freedom: 6.635."""
    monkeypatch.setattr(measured, "_repeated", lambda _: [(1, 2)])
    monkeypatch.setattr(measured, "_scatter_of", lambda _: [(ratio, 1.0, 10.0)])
    _, freedom = measured.repeat_scatter(None)
    assert math.isfinite(freedom) is scatters


# Reports and tables


@pytest.mark.parametrize(("n", "rows"), [(40, 40), (41, 40)])
def test_forty_lines_stand_on_a_terminal(n, rows) -> None:
    points = [Point("a", k, 0.1, "rebound", 5.0, 0.0, 10.0) for k in range(n)]
    sheet = tolerance_sheet(points, is_short=True)
    assert len(sheet.rows) == rows
    assert sheet.notes == (("1 more points pass",) if n > rows else ())


def test_a_cycle_is_drawn_by_forty_four_characters() -> None:
    time = np.linspace(0.0, 1.0, 200)
    response = SimpleNamespace(
        time=time, displacement=time, force=time, pressures=np.stack([time] * 3)
    )
    for line in cycle_sparklines(response, 1.0, levels="ab", columns=120):
        assert sum(letter in "ab" for letter in line[13:57]) == 44
        assert line[57] == " "


@pytest.mark.parametrize(("unit", "said"), [("MN/mm", "2 MN/mm"), ("N s2/m", "2e3 N s2/m")])
def test_a_unit_of_five_letters_has_its_power_in_it(unit, said) -> None:
    assert Scale("R", "", unit, 3, "").say("2") == said
    assert Scale("R", "", unit, 3, "").short_unit == (unit if len(unit) == 5 else "1e3")


@pytest.mark.parametrize(("width", "gap"), [(80, 2), (81, 1)])
def test_a_table_has_eighty_columns(width, gap, monkeypatch) -> None:
    module = sys.modules[terminal_table.__module__]
    monkeypatch.setattr(module, "sheet_width", lambda *_, **__: width)
    sheet = Sheet(headings=("a",), units=("",), rows=(("1",),), is_number=(True,), notes=())
    (table,) = terminal_table(sheet).__rich_console__(None, SimpleNamespace(max_width=200))
    assert table.padding[1] == gap


@pytest.mark.parametrize(("second", "ticks"), [(98, 2), (102, 3)])
def test_twenty_ticks_stand_on_an_axis(second, ticks) -> None:
    assert len(setting_axis([0, second, 2000])[0]) == ticks


@pytest.mark.parametrize(("n", "width"), [(6, 5.4), (7, 6.4)])
def test_seven_entries_of_a_legend_stand_beside_the_axes(n, width) -> None:
    one = np.arange(2.0)
    lines = tuple(Line(one, one, f"line {k}", "ink") for k in range(n))
    plot = Plot("name", "title", (Panel("x", "s", "y", "N", lines),), "")
    with fixed_style():
        assert compose(plot).get_size_inches()[0] == pytest.approx(width)


def signals_at(time):
    wave = np.sin(np.arange(len(time)))
    return SimpleNamespace(
        setting=1, time=np.asarray(time), velocity=wave, force=wave, force_measured=wave
    )


@pytest.mark.parametrize(("step", "is_gap"), [(1.46, False), (1.54, True)])
def test_a_line_is_broken_where_half_a_sample_is_missing(step, is_gap) -> None:
    time = np.arange(40.0)
    time[20:] += step - 1.0
    plot = _force_time(SimpleNamespace(signals=signals_at(time)), "a", "ink")
    assert bool(np.isnan(plot.panels[0].lines[0].y).any()) is is_gap


@pytest.mark.parametrize(("n", "is_known"), [(7, False), (8, True)])
def test_eight_samples_of_a_stretch_are_evaluated(n, is_known) -> None:
    time = np.arange(20.0)
    told = {"start_s": 2.0, "stop_s": 2.0 + n, "frequency_Hz": 0.1, "cycles": 0}
    assert (_stretch(signals_at(time), told) is not None) is is_known


@pytest.mark.parametrize(("n", "more"), [(6, False), (7, True)])
def test_six_missing_columns_are_named(n, more, monkeypatch, tmp_path) -> None:
    kinds = dict.fromkeys(["setting", *(f"column_{k}" for k in range(n))], float)
    monkeypatch.setattr(reading, "column_kinds", lambda *_: kinds)
    monkeypatch.setattr(reading, "_parquet_rows", lambda _: [{"setting": 1}])
    monkeypatch.setattr(reading, "_clean", lambda row, *_: row)
    remarks: list[str] = []
    reading._rows(tmp_path, "parameters", remarks)
    assert remarks[0].endswith(" and 1 more") is more


# Handed over


@pytest.mark.parametrize(("n", "said"), [(6, False), (7, True)])
def test_the_misfit_of_six_settings_is_told_one_by_one(n, said) -> None:
    tables = [SimpleNamespace(setting=k, mse_percent=0.1 * (k + 1)) for k in range(n)]
    assert (" to " in _mse(tables)) is said


@pytest.mark.parametrize(("length", "strings"), [(400, 1), (401, 2)])
def test_a_string_of_c_has_four_hundred_letters(length, strings) -> None:
    text = _data(SimpleNamespace(text="x" * length)).decode()
    assert text.count('    "') == strings


@pytest.mark.parametrize(("times", "refused"), [(4.9, False), (5.1, True)])
def test_a_table_goes_to_five_times_the_tested_speed(times, refused) -> None:
    assert is_refused(_speeds_beyond, 0.3, 0.3 * times) is refused


# Forces, grades and areas beside what was measured


@pytest.mark.parametrize(
    ("measured", "half_range", "error", "difference", "disagrees"),
    [
        (1000.0, 0.0, 0.0, 19.5, False),
        (1000.0, 0.0, 0.0, 20.5, True),
        (0.0, 1000.0, 0.0, 4.9, False),
        (0.0, 1000.0, 0.0, 5.1, True),
        (0.0, 0.0, 1.0, 2.9, False),
        (0.0, 0.0, 1.0, 3.1, True),
    ],
)
def test_a_model_may_miss_a_force_by_share_range_and_noise(
    measured, half_range, error, difference, disagrees
) -> None:
    level = Level(
        1, 0.1, "rebound", 0.0, 0.0, 0.0, np.zeros(1), is_cavitating=False, measured=measured,
        measured_error=error, difference=difference, half_range=half_range,
    )  # fmt: skip
    assert level.disagrees is disagrees


@pytest.mark.parametrize(
    ("uncertainty", "gas", "held", "off", "is_apart"),
    [
        (0.0, 100.0, 0.0, 24.0, 0), (0.0, 100.0, 0.0, 26.0, 1), (100.0, 0.0, 0.0, 146.0, 0),
        (100.0, 0.0, 0.0, 154.0, 1), (0.0, 0.0, 100.0, 99.0, 0), (0.0, 0.0, 100.0, 101.0, 1),
    ],
)  # fmt: skip
def test_an_offset_is_apart_beyond_a_quarter_of_the_gas_force(
    uncertainty, gas, held, off, is_apart, monkeypatch
) -> None:
    seen = SimpleNamespace(force=0.0, expected=0.0, uncertainty=uncertainty, held=held, doubt=0.0)
    monkeypatch.setattr(withheld, "force_level", lambda *_: seen)
    log = SimpleNamespace(trace=SimpleNamespace(n_cycles=3))
    fit = SimpleNamespace(parameters=SimpleNamespace(f_0=off), logs=(log,))
    ratio, _ = withheld.offset_mismatch(fit, "f_0", SimpleNamespace(inside=gas))
    assert (ratio > withheld.LIMITS.offset) == is_apart


def test_the_log_that_is_farthest_tells_how_far_an_offset_is(monkeypatch) -> None:
    """A log without cycles tells nothing; what stands behind it is looked at."""
    monkeypatch.setattr(
        withheld, "force_level",
        lambda trace, _: SimpleNamespace(
            force=trace.force, expected=0.0, uncertainty=0.0, held=0.0, doubt=20.0
        ),
    )  # fmt: skip
    logs = [
        SimpleNamespace(trace=SimpleNamespace(n_cycles=n, force=force))
        for n, force in ((0, 900.0), (3, 90.0), (3, math.nan), (3, 50.0), (3, 80.0))
    ]
    fit = SimpleNamespace(parameters=SimpleNamespace(f_0=100.0), logs=logs)
    found = withheld.offset_mismatch(fit, "f_0", SimpleNamespace(inside=100.0))
    assert found == (2.0, 50.0)  # 50 N are two quarters of the gas force
    fit.logs = logs[:1]
    assert withheld.offset_mismatch(fit, "f_0", SimpleNamespace(inside=100.0)) is None


@pytest.mark.parametrize(("doubt", "is_looked_at"), [(29.0, True), (31.0, False)])
def test_a_log_that_hides_the_level_half_again_as_much_does_not_tell_it(
    doubt, is_looked_at, monkeypatch
) -> None:
    monkeypatch.setattr(withheld, "force_level", lambda trace, _: trace.level)
    levels = [
        SimpleNamespace(force=force, expected=0.0, uncertainty=0.0, held=0.0, doubt=unsure)
        for force, unsure in ((0.0, 20.0), (90.0, doubt))
    ]
    logs = [SimpleNamespace(trace=SimpleNamespace(n_cycles=3, level=one)) for one in levels]
    fit = SimpleNamespace(parameters=SimpleNamespace(f_0=0.0), logs=logs)
    ratio, _ = withheld.offset_mismatch(fit, "f_0", SimpleNamespace(inside=100.0))
    assert (ratio > withheld.LIMITS.offset) == is_looked_at


@pytest.mark.parametrize(("apart", "is_reported"), [(9.6, False), (10.4, True)])
def test_pressures_a_tenth_apart_tell_the_rod(apart, is_reported, monkeypatch) -> None:
    monkeypatch.setattr(rod_area, "moves_alike", lambda *_: True)
    monkeypatch.setattr(rod_area, "_level", lambda trace, _: (trace.gas, trace.gas))
    logs = [SimpleNamespace(gas_pressure=1e5, setting=1, gas=one) for one in (100.0, 100.0 - apart)]
    assert (rod_area.rod_area_ratio(logs, None) is not None) is is_reported


def test_pairs_that_tell_nothing_leave_the_rod_to_the_others(monkeypatch) -> None:
    """Of another setting, of a pressure that nobody declared, or too near, each ahead of one."""
    monkeypatch.setattr(rod_area, "moves_alike", lambda *_: True)
    monkeypatch.setattr(rod_area, "_level", lambda trace, _: (1.2 * trace.gas, trace.gas))
    logs = [
        SimpleNamespace(gas_pressure=pressure, setting=setting, gas=gas)
        for pressure, setting, gas in (
            (1e5, 3, 100.0), (1e5, 1, 100.0), (None, 1, 100.0), (1e5, 1, 99.0), (2e5, 1, 200.0),
        )
    ]  # fmt: skip
    assert rod_area.rod_area_ratio(logs, None) == pytest.approx(1.2)


@pytest.mark.parametrize(("told", "is_said"), [(1.048, False), (1.052, True), (0.948, True)])
def test_another_rod_is_a_twentieth_off(told, is_said, monkeypatch) -> None:
    monkeypatch.setattr(rod_area, "rod_area_ratio", lambda *_: told)
    monkeypatch.setattr(rod_area, "replace", lambda _, remarks: remarks)
    batch = SimpleNamespace(traces=(), remarks=())
    assert (rod_area.with_rod_remark(batch, None) is not batch) is is_said


@pytest.mark.parametrize(
    ("share", "is_read"), [(0.74, False), (0.76, True), (0.94, True), (0.96, False)]
)
def test_speeds_meet_from_three_quarters_of_the_peak_on(share, is_read) -> None:
    v = np.repeat([share, -share], 20)
    trace = SimpleNamespace(velocity=v, compared=slice(None))
    assert (like_speeds._damping(trace, v, 1.0) is not None) is is_read


@pytest.mark.parametrize(("evaluations", "budget"), [(11, 8), (20, 14)])
def test_quick_profiles_cost_seven_tenths_of_the_fit(evaluations, budget, monkeypatch) -> None:
    budgets = []

    def traced(_, stride):
        budgets.append(stride.budget)
        return SimpleNamespace(evaluations=stride.budget)

    monkeypatch.setattr(profile_walk, "is_doubtful", lambda *_: True)
    monkeypatch.setattr(profile_walk, "profile_lines", lambda *_: ["a line"])
    monkeypatch.setattr(profile_walk, "trace_profile", traced)
    monkeypatch.setattr(profile_walk, "replace", lambda one, **_: one)
    fit = SimpleNamespace(
        parameters=reference_parameters(1), evaluations=evaluations, setting=1,
        status=dict.fromkeys(reference_parameters(1).names, Status.FITTED),
    )  # fmt: skip
    sharing = SimpleNamespace(is_mean=lambda _: False, found=())
    profile_walk.doubtful_profiles(SimpleNamespace(fit=fit), None, sharing, None)
    assert budgets == [budget]


@pytest.mark.parametrize(("n", "lines"), [(2, 0), (3, 1), (60, 1), (61, 0)])
def test_a_sparkline_is_drawn_of_three_to_sixty_settings(n, lines) -> None:
    rows = [{"mse_percent": 0.1 + 0.01 * k} for k in range(n)]
    assert len(list(setting_sparklines(rows, (), levels="ab"))) == lines


@pytest.mark.parametrize(
    ("step", "runs_on"), [(0.48, False), (0.52, True), (1.48, True), (1.52, False)]
)
def test_a_block_begins_a_step_behind_the_one_before(step, runs_on) -> None:
    before = SimpleNamespace(setting=1, time=np.arange(10.0))
    after = SimpleNamespace(setting=1, time=9.0 + step + np.arange(10.0))
    assert write_buffers._runs_on(before, after) is runs_on


@pytest.mark.parametrize(("settings", "said"), [([4], "setting 4"), ([4, 9], "settings 4, 9")])
def test_one_setting_is_no_settings(settings, said) -> None:
    assert physical_checks.of_settings(settings) == said


def test_a_speed_that_is_passed_one_way_has_one_branch() -> None:
    speed, force = np.array([0.3, 0.1]), np.array([30.0, 10.0])
    opening, closing = branch_forces(speed, force[None], [0.2])[:, 0, 0]
    assert math.isnan(opening)
    assert closing == pytest.approx(20.0)
    opening, closing = branch_forces(speed[::-1], force[None, ::-1], [0.2])[:, 0, 0]
    assert opening == pytest.approx(20.0)
    assert math.isnan(closing)
