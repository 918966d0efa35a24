"""Force of a setting at a speed: the right error, shared errors that cancel, tares left out."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import damperfit
from damperfit.adjustment import between
from damperfit.adjustment.clicks import clicks, which_setting
from damperfit.adjustment.force_at import (
    Force,
    Sine,
    Stage,
    credible_forces,
    determined_speed,
    fastest_sine,
    force_at,
    open_limits,
    stage_of,
)
from damperfit.damper.purdy.parameters import PURDY_DAMPER, reference_parameters
from damperfit.damper.quasi_static import quasi_static
from damperfit.damper.rivals import Bilinear
from damperfit.errors import SimulationError
from damperfit.identification import Status
from damperfit.queries.settings import Question, tabulate_forces
from damperfit.tested.setting import Setting
from damperfit.uncertainty import SpeedForces, Uncertainty
from tests import fakes
from tests.adjustment import gap_coverage
from tests.fakes import run_of
from tests.laws.valve_logs import VALUES, damper

OWN, SHARED = ("r_m1", "r_m2", "k_e"), ("r_m3", "f_f")
TARES = (11.6, 36.6, -3.4)


def stage(setting, covariance=None, **more):
    known = (OWN, SHARED, covariance)
    return Stage(Setting.of(setting), reference_parameters(setting), *known, **more)


def covariance(seed):
    root = np.random.default_rng(seed).standard_normal((5, 5))
    root *= np.array([2e-3] * 3 + [4e-3] * 2)[:, None]
    return root @ root.T


def forces(*stages, speed=0.1):
    return force_at(stages, PURDY_DAMPER, (speed,))


SINE = Sine(0.032, 1.5)


def notes_of(stages, model, speed=0.1, sine=SINE):
    shown = tabulate_forces(run_of(tuple(stages), model, sine), Question(speed))
    return tuple(map(str, shown.notes))


@pytest.mark.parametrize("setting", [2, 18])
def test_the_error_is_that_of_the_covariance(setting) -> None:
    cov, truth = covariance(setting), reference_parameters(setting)
    for one, sign in zip(forces(stage(setting, cov), speed=0.2), (1.0, -1.0), strict=True):

        def at(name, times, sign=sign):
            values = truth.replace({name: getattr(truth, name) * times})
            return quasi_static(PURDY_DAMPER, values, sign * 0.2).forces[0]

        slopes = [(at(name, 1.001) - at(name, 0.999)) / 2e-3 for name in (*OWN, *SHARED)]
        assert one.error == pytest.approx(np.sqrt(slopes @ cov @ slopes), rel=5e-3)


@pytest.mark.parametrize("like", [(1e-2, 1e-1, 0.0), (1e-2, 1e-2, 1e-13)])
def test_errors_of_shared_parameters_cancel_between_neighbours(like) -> None:
    """Whatever rounding does to the directions of two of like error."""
    *errors, rounding = like
    found = []
    for setting, sign in ((9, 1.0), (10, -1.0)):
        cov = np.zeros((5, 5))
        cov[3:, 3:] = np.diag(errors) ** 2
        cov[3, 4] = cov[4, 3] = sign * rounding * errors[0] ** 2
        found += forces(stage(setting, cov))
    for one in found:
        assert one.rest == 0.0
        assert one.error > 0.4
    for click in clicks(found):
        assert click.high - click.change < 0.1 * 1.96 * found[0].error


def test_errors_of_the_settings_own_parameters_add_up() -> None:
    own_only = np.zeros((5, 5))
    own_only[:3, :3] = np.diag([1e-3, 1e-3, 1e-2]) ** 2
    found = forces(stage(9, own_only), stage(10, own_only), speed=0.26)
    by_place = {(one.setting, one.stroke): one for one in found}
    for click in clicks(found):
        a, b = by_place[9, click.stroke], by_place[10, click.stroke]
        assert click.change == b.force - a.force
        reach = 1.96 * np.hypot(a.error, b.error)
        assert click.high - click.change == pytest.approx(reach, rel=1e-4)
        damping = a.force + PURDY_DAMPER.rod_area * PURDY_DAMPER.gas_pressure
        assert click.percent == pytest.approx(100.0 * click.change / damping)
        share = 196.0 * np.hypot(b.error, (1.0 + click.change / damping) * a.error) / abs(damping)
        assert click.percent_high - click.percent == pytest.approx(share, rel=1e-4)
        assert click.percent > 0.0  # harder, in rebound and in bump alike


def assessed(known):
    return SimpleNamespace(uncertainties=(known,), plausible_limits=lambda *_: (None, None))


def test_a_shared_value_that_no_log_tells_is_shared_all_the_same() -> None:
    """Used to be taken for the setting's own, with the covariance of another parameter."""
    cov, plain = covariance(3), fakes.fit(1)
    known = Uncertainty(plain.setting, {}, (*OWN, *SHARED), cov, SHARED)
    for name in SHARED:
        unsound = replace(plain, status={**plain.status, name: Status.NOT_IDENTIFIABLE})
        found = stage_of(unsound, assessed(known))
        assert (found.own, found.shared) == (OWN, SHARED)
        assert found.covariance is cov


@pytest.mark.parametrize(
    ("r_m1", "has_errors"),
    [(Status.FITTED, False), (Status.FIXED, True), (Status.AT_BOUND, True)],
)
def test_a_setting_without_a_minimum_has_no_error_from_shared_values_alone(r_m1, has_errors):
    """Two of three triangle logs met no minimum; "+30.12 +- 0.01 N" was said of a click."""
    fit = fakes.fit(9)
    fit = replace(fit, status={"r_m1": r_m1, "k_e": Status.FITTED})
    known = Uncertainty(fit.setting, {}, ("k_e", "r_m3"), np.eye(2) * 1e-4, ("r_m3",))
    found = stage_of(fit, assessed(known))
    assert (found.covariance is not None) is has_errors
    assert np.isfinite(forces(found)[0].error) == has_errors


def test_clicks_beside_a_setting_without_errors_or_with_other_shared_values_have_none() -> None:
    """Used to end in a broadcasting error."""
    bare = Stage(Setting.of(10), reference_parameters(10))
    other = replace(stage(10, covariance(9)[:3, :3]), shared=())
    for second in (bare, other):
        for click in clicks(forces(stage(9, covariance(1)), second)):
            assert np.isfinite(click.change)
            assert np.isnan([click.low, click.high, click.percent_low, click.percent_high]).all()


def test_a_covariance_that_breaks_costs_its_setting_alone() -> None:
    met = []
    stages = [stage(k, covariance(k)) for k in (8, 9, 10)]
    stages[1] = replace(stages[1], covariance=covariance(9)[:4])
    found = force_at(stages, PURDY_DAMPER, (0.1,), on_error=lambda *one: met.append(one[0]))
    assert met == [9]
    assert [one.setting for one in found] == [8, 8, 10, 10]
    with pytest.raises(ValueError, match="square"):
        force_at(stages, PURDY_DAMPER, (0.1,))


# What the logs do not determine


def unopened(setting=1) -> Stage:
    """Tested to 0.05 m/s, where the bleed alone lets the oil through."""
    values = damper().values(VALUES, rebound_opening=2e6)
    limits = open_limits(values, {"rebound_opening": (4e5, None)})
    known = ("rebound_bleed", "f_f"), (), np.diag([1e-3, 1e-2]) ** 2
    return Stage(Setting.of(setting), values, *known, top_speed=0.05, open_limits=limits)


def test_a_blow_off_that_no_log_opens_is_in_the_interval_beyond_the_tested_speed() -> None:
    """It was exported with +154 % at 1 m/s, under the sentence of settings that are right."""
    one = unopened()
    found = force_at([one], damper(), (0.03, 0.05, 0.1, 0.4))
    rebound = {x.speed: x for x in found if x.stroke == "rebound"}
    opened, shut = (
        quasi_static(damper(), one.parameters.replace(rebound_opening=p), [0.4]).forces[0]
        for p in (4e5, 1e8)
    )
    assert rebound[0.4].low - 1e-6 <= opened < 0.7 * shut <= shut <= rebound[0.4].high + 1e-6
    assert not rebound[0.4].is_determined
    # No log shows that a law goes on as fitted: its slope may be half of that, or twice.
    (known,) = force_at([replace(one, open_limits=())], damper(), (0.4,))[:1]
    rise = known.force - rebound[0.05].force
    assert (known.force - known.low, known.high - known.force) == pytest.approx((rise / 2, rise))
    for speed in (0.03, 0.05):
        assert rebound[speed].is_determined
        assert rebound[speed].is_tested
        assert rebound[speed].high - rebound[speed].force == pytest.approx(rebound[speed].reach)
    assert all(x.is_determined for x in found if x.stroke == "bump")
    assert determined_speed(one, damper()) < 0.09
    assert determined_speed(replace(one, open_limits=()), damper()) == pytest.approx(0.25)
    assert math.isnan(determined_speed(replace(one, covariance=None), damper()))


OF_SINE = 0.3 / (2.0 * np.pi * 0.032)  # Hz, with 0.3 m/s at 32 mm


@pytest.mark.parametrize(
    ("motions", "amplitude", "frequency"),
    [
        ([(0.032, 1.5, 0.3016), (0.02, 2.0, 0.2513)], 0.032, 1.5),
        # As fast within five per cent: of these the middle stroke.
        ([(0.032, 1.5, 0.3), (0.012, 4.0, 0.286), (0.016, 3.0, 0.286)], 0.016, 3.0),
        ([(0.032, 1.5, 0.3), (0.016, 3.0, 0.284), (0.016, 3.0, 0.284)], 0.032, 1.5),
        # Strokes within five per cent are one.
        ([(0.02, 2.4, 0.3), (0.02098, 2.4, 0.3)], 0.02049, 2.4),
        ([(0.02, 2.4, 0.3), (0.02102, 2.4, 0.3)], 0.02, 2.4),
        # 5.5 mm at 10 Hz beside 9 mm at 6 Hz were told as "the sine of 7.25 mm at 8 Hz".
        ([(0.0055, 10.0, 0.3456), (0.009, 6.0, 0.3393), (0.015, 3.0, 0.2827)], 0.0055, 10.0),
        # A motion is a sine within a tenth of its frequency.
        ([(0.032, 1.095 * OF_SINE, 0.3)], 0.032, 1.095 * OF_SINE),
        ([(0.032, 1.105 * OF_SINE, 0.3)], 0.032, OF_SINE),
        ([(0.032, 0.905 * OF_SINE, 0.3)], 0.032, 0.905 * OF_SINE),
    ],
)
def test_one_sine_stands_for_the_motions_of_tests(motions, amplitude, frequency) -> None:
    found = fastest_sine(motions)
    assert found.amplitude == pytest.approx(amplitude)
    assert found.frequency == pytest.approx(frequency, rel=1e-2 if len(motions) > 1 else 1e-6)


# Tares


def tared(tares=TARES, covariance=None, settings=(5, 5, 5)):
    own = () if covariance is None else ("r_m1", "k_e", "f_0")
    return [
        Stage(Setting.of(n), replace(reference_parameters(k), f_0=tare), own, (), covariance)
        for n, (k, tare) in enumerate(zip(settings, tares, strict=True), start=1)
    ]


def of_offset(correlation):
    """Of ln r_m1, ln k_e and f_0 in N, whose error is 5 N."""
    errors, matrix = np.array([1e-2, 2e-2, 5.0]), np.eye(3)
    matrix[0, 2] = matrix[2, 0] = correlation
    return matrix * np.outer(errors, errors)


def test_a_tare_is_in_no_force_and_no_effect_of_a_click() -> None:
    found, bare = forces(*tared()), forces(*tared((0.0,) * 3))
    assert [one.force for one in found] == pytest.approx([one.force for one in bare], abs=1e-9)
    whole = clicks([one.with_tare for one in found])
    for one, other in zip(clicks(found), whole, strict=True):
        same = (one.change, one.percent, other.change, other.percent)
        assert same == pytest.approx((0.0,) * 4, abs=1e-9)
    with_it, without = (
        [one.percent for one in clicks(forces(*tared(t, settings=(5, 6, 7))))]
        for t in ((12.0,) * 3, (0.0,) * 3)
    )
    assert with_it == pytest.approx(without)
    rebound = [one for one in found if one.stroke == "rebound"]
    assert which_setting(rebound, rebound[0].force + 20.0).answers == ()


@pytest.mark.parametrize("correlation", [-0.9, 0.0, 0.9])
def test_the_error_of_a_tare_is_none_of_the_damper(correlation) -> None:
    known = of_offset(correlation)
    alone = [replace(one, own=("r_m1", "k_e"), covariance=known[:2, :2]) for one in tared()]
    found, expected = forces(*tared(covariance=known)), forces(*alone)
    for one, bare in zip(found, expected, strict=True):
        assert one.error == pytest.approx(bare.error)
        assert one.with_tare.force - one.force == pytest.approx(one.tare)
        assert one.with_tare.error != pytest.approx(bare.error, rel=0.05)
        if correlation == 0.0:
            assert one.with_tare.error == pytest.approx(np.hypot(one.error, 5.0))
    for one, bare in zip(clicks(found), clicks(expected), strict=True):
        assert one.high - one.low == pytest.approx(bare.high - bare.low)


def test_measured_forces_beside_the_model_are_without_it_too() -> None:
    stages = tared(covariance=of_offset(0.0))
    rig = [
        SpeedForces(
            one.setting, one.stroke, 500.0, (0.05, 0.1), (one.with_tare.force + 80.0,) * 2,
            (0.5,) * 2, (80.0,) * 2, (0.0,) * 2, kind="pvp", rounding=(0.0, 0.0),
        )
        for one in forces(*stages)
    ]  # fmt: skip
    found = force_at(stages, PURDY_DAMPER, (0.1,), measured=rig)
    for one in found:
        assert one.measured_force == pytest.approx(one.force + 80.0)
        assert one.with_tare.measured_force == pytest.approx(one.measured_force + one.tare)
    shown = credible_forces(found)
    assert all(one.is_measured and one.model_force == one.force - 80.0 for one in shown)
    # What is taken off a measured force has an error.
    assert all(one.error == pytest.approx(np.hypot(0.5, 5.0)) for one in shown)
    assert [one.change for one in clicks(shown)] == pytest.approx([0.0] * 4, abs=1e-9)


def test_where_no_gas_is_known_the_offset_stays_in_the_force_and_out_of_the_click() -> None:
    model = Bilinear()

    def stages(second):
        numbers = ((2000.0, -120.0), (second, -95.0))
        return [
            Stage(Setting.of(n), model.values({"c_r": c_r, "c_b": 1500.0, "f_0": offset}))
            for n, (c_r, offset) in enumerate(numbers, start=1)
        ]

    found = force_at(stages(2000.0), model, (0.1,))
    by_stroke = {one.stroke: one.force for one in found if one.setting == Setting.of(1)}
    assert by_stroke == pytest.approx({"rebound": 80.0, "bump": -270.0}, abs=0.1)
    assert [one.change for one in clicks(found)] == pytest.approx([0.0, 0.0], abs=1e-9)
    rebound, _ = clicks(force_at(stages(2200.0), model, (0.1,)))
    assert rebound.percent == pytest.approx(10.0, abs=0.01)
    notes = notes_of(stages(2000.0)[:1], model)
    assert any("the model knows no gas: its force offset (-120 N)" in one for one in notes)


def test_forces_are_shown_at_the_speeds_that_are_asked_for(tmp_path) -> None:
    run = damperfit.identify(
        ["sample_runs/setting_10.csv"], velocity=["0.1m/s", "10mm/s"], out=tmp_path
    )
    answered = damperfit.settings(tmp_path).forces
    assert [one.speed for one in answered] == [0.01, 0.01, 0.1, 0.1]
    for rows in (run.forces, damperfit.load(tmp_path).forces):
        assert rows["speed_m_per_s"].tolist() == [0.01, 0.01, 0.1, 0.1]
    loops = run.characteristics
    assert set(loops["speed_rebound_m_per_s"][loops["point"] == "speed"]) == {0.01, 0.1}


# Which setting gives a force: between clicks, exactly, twice, never.


def forces_by_click(forces, *, settings=None, error=0.5, stroke="rebound"):
    settings = settings or range(1, len(forces) + 1)
    return [
        Force(setting, 0.2, stroke, float(force), error, error, np.zeros(0))
        for setting, force in zip(settings, forces, strict=True)
    ]


@pytest.mark.parametrize(
    ("forces", "wanted", "positions", "words"),
    [
        ([100, 200, 300], 200.0, [2.0], "setting 2 (95 % within 0.01), which gives 200 N"),
        ([100, 200, 300], 500.0, [], "more than the hardest, setting 3 with 300 N"),
        ([100, 200, 300], 50.0, [], "less than the weakest"),
        ([-100, -200, -300], -150.0, [1.5], ""),
        ([-100, -200, -300], -400.0, [], "more than the hardest, setting 3"),
        ([-100, -200, -300], -10.0, [], "less than the weakest, setting 1"),
        ([400, 300, 200, 100], 250.0, [2.5], ""),
        ([100, 300, 150, 400], 200.0, [1.5, 2.5, 3.5], "3 answers"),
        ([100, 200, 300], 300.9, [3.0], ""),  # beyond the last, but within its interval
    ],
)
def test_a_force_is_found_wherever_the_curve_passes_it_or_out_of_reach(
    forces, wanted, positions, words
) -> None:
    stroke = "bump" if forces[0] < 0 else "rebound"
    found = which_setting(forces_by_click(forces, stroke=stroke), wanted)
    assert [one.position for one in found.answers] == pytest.approx(positions, abs=0.25)
    assert words in found.sentence
    for one in found.answers:
        assert one.low <= one.position <= one.high
        assert one.below <= one.position <= one.above


def test_two_settings_tell_no_curve_between_them() -> None:
    """The interval was 0.01 clicks wide; 3 of 1000 such held the truth."""
    wanted = which_setting(forces_by_click([100, 200], settings=(2, 10)), 150.0)
    (answer,) = wanted.answers
    assert (answer.low, answer.position, answer.high) == (2.0, pytest.approx(6.0), 10.0)
    assert "setting 6.00 (anywhere from 2 to 10: two settings do not show how" in wanted.sentence
    beside = which_setting(forces_by_click([100, 110], error=50.0), 105.0)
    assert (beside.answers[0].low, beside.answers[0].high) == (1.0, 2.0)
    assert "setting 1.50 (95 % from 1.00 to 2.00)" in beside.sentence  # no setting between them
    (beside,) = which_setting(forces_by_click([100, 200], settings=(2, 3)), 150.0).answers
    assert beside.high - beside.low < 0.03


def test_intervals_over_gaps_hold_the_setting_that_was_left_out() -> None:
    for count in (3, 5, 10):
        held, asked = gap_coverage.covered(count, draws=8)
        assert 0.93 <= held / asked <= 0.99, count


@pytest.mark.slow
def test_intervals_hold_untested_clicks_of_valves() -> None:
    click, position, low, high, gap = gap_coverage.covered_of_valves(20).T
    assert len(click) > 100
    assert np.mean((low <= click) & (click <= high)) >= 0.97
    assert np.nanmedian(np.abs(position - click) / gap) < 0.02
    assert np.nanmedian((high - low) / gap) < 0.5


@pytest.mark.parametrize("side", ["rebound", "compression"])
@pytest.mark.parametrize("is_tied", [False, True])
def test_a_valve_that_opens_between_clicks_bends_the_force_there(side, is_tied) -> None:
    """640 N of such a damper was put at click 8.7 (8.2 to 9.4) for 7.2."""
    model, stroke = gap_coverage.DAMPER, "bump" if side == "compression" else "rebound"

    def numbers(click):
        bleed = 4e4 / (1.0 - 0.065 * click)
        return VALUES | {f"{side}_bleed": bleed, f"{side}_opening": 1.7e6, f"{side}_slope": 1.2e7}

    tied = ["rebound", "compression"] if is_tied else []
    speed = 0.05 if stroke == "rebound" else 0.04  # the whole bore presses there
    stages = [gap_coverage.stage_at(n, numbers(n), top=speed, tied=tied) for n in (2, 6, 10, 14)]
    signed = speed if stroke == "rebound" else -speed
    truth = quasi_static(model, model.values(numbers(8)), [signed]).forces[0]
    # What the valve of the other stroke leaves open moves no force of this one.
    other = "rebound_opening" if side == "compression" else "compression_opening"
    values = stages[1].parameters.replace({other: 1.2 * VALUES[other]})
    limits = (*stages[1].open_limits, (other, (1e5, 1e8)))
    stages[1] = replace(stages[1], parameters=values, open_limits=limits)
    run = run_of(tuple(stages), model, SINE)
    found = tabulate_forces(run, Question(speed, float(truth), stroke))
    (answer,) = found.wanted[0].answers
    by_force = which_setting([one for one in found.forces if one.stroke == stroke], truth).answers
    assert abs(by_force[0].position - 8.0) > 1.0  # where the forces alone put it
    # Tied, by other curves of the values; else also by what the closed valve may have been.
    assert answer.high == pytest.approx(8.95 if is_tied else 9.78, abs=0.05)
    assert answer.low == pytest.approx(7.14 if is_tied or side == "compression" else 7.0, abs=0.02)
    assert abs(answer.position - 8.0) < 0.7
    assert (answer.undetermined != ()) == (not is_tied)
    assert all(side in one for one in answer.undetermined)
    assert ("not determined there" in found.sentence) == (not is_tied)


def test_where_a_damper_between_cannot_be_solved_the_forces_alone_are_interpolated(
    monkeypatch,
) -> None:
    """The curve of a gap was the damper's up to there and jumped to that of the forces."""

    def solved_up_to_r_m1(damper, values, speeds, **asked):
        if 1.9e4 < values.r_m1 < 2.3e4:
            raise SimulationError("no pressures found", code="not-integrated")
        return quasi_static(damper, values, speeds, **asked)

    stages = [gap_coverage.STAGES[k] for k in (2, 9, 14)]
    mine = [one for one in force_at(stages, PURDY_DAMPER, (0.2,)) if one.stroke == "rebound"]
    monkeypatch.setattr(between, "quasi_static", solved_up_to_r_m1)
    known = {"stages": stages, "damper": PURDY_DAMPER}
    for wanted in (mine[0].force + 10.0, 550.0, mine[1].force - 10.0):
        (alone,), (found,) = (which_setting(mine, wanted, **k).answers for k in ({}, known))
        assert found.position == pytest.approx(alone.position)


def test_without_errors_there_is_no_interval() -> None:
    wanted = which_setting(forces_by_click([100, 200], error=math.nan), 150.0)
    assert math.isnan(wanted.answers[0].low)
    assert "95 %" not in wanted.sentence
