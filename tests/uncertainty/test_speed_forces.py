"""Measured forces beside the model's, and errors for a wrong model, apart from those of noise."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from damperfit.adjustment import (
    Level,
    Sine,
    beside_measured,
    compare_settings,
    credible_forces,
    levels,
    stage_of,
)
from damperfit.conditioning import condition
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.identification import FitOptions, identify
from damperfit.identification.given_start import GivenStart
from damperfit.recording import Recording
from damperfit.simulation import Motion, simulate
from damperfit.tested.setting import Setting
from damperfit.uncertainty import SpeedForces, assess
from damperfit.uncertainty.speed_forces import _at_speeds, speed_forces
from tests.identification.rig import AMPLITUDE, FREQUENCY, TIGHT, recording
from tests.uncertainty.drag_coverage import NAMES, SHARP, TRUTH
from tests.uncertainty.flaws import speed

PLAIN = FitOptions("plain", ("r_m1", "r_m2", "k_e"), {"r_m3": 2.597e6, "f_f": 50.0})


def bent(log: Recording) -> Recording:
    """The same with a knee at 0.1 m/s that no valve of the model has."""
    v = speed(log)
    knee = 120.0 * np.clip(np.abs(v) - 0.1, 0.0, 0.05) / 0.05 * np.sign(v)
    return replace(log, force=log.force + knee)


@pytest.fixture(scope="module")
def both():
    """A sound log and one with a knee that the model has not, fitted, judged, levelled."""
    sound = recording(10, noise=4.0, duration=6.0)
    found = []
    for log in (sound, bent(sound)):
        campaign = identify([condition(log)], PURDY_DAMPER, PLAIN)
        known = assess(campaign, PURDY_DAMPER)
        found.append((condition(log), known, compare_settings(campaign, known, PURDY_DAMPER)))
    return found


def test_forces_of_a_sound_log_agree_and_have_no_error_of_the_model(both) -> None:
    _, known, levels = both[0]
    assert {one.stroke for one in known.forces} == {"rebound", "bump"}
    for level in levels.levels:
        assert level.misfit == 0.0
        assert not level.disagrees
        assert level.measured == pytest.approx(level.force, abs=8.0)  # the filter at the ends
        assert level.high - level.force == pytest.approx(1.959964 * level.error)
    assert credible_forces(levels.levels) == levels.levels
    assert all(one.misfit == 0.0 for one in known.uncertainties[0].intervals.values())


def test_the_measured_force_is_the_mean_of_all_cycles_at_the_speed(both) -> None:
    trace, known, _ = both[1]
    (rebound,) = (one for one in known.forces if one.stroke == "rebound")
    measured, error, *_ = rebound.at(0.2)
    v, f = trace.velocity[trace.compared], trace.force[trace.compared]
    at = np.flatnonzero((v[:-1] < 0.2) != (v[1:] < 0.2))
    assert len(at) >= 2 * (trace.n_cycles - 1)
    share = (0.2 - v[at]) / (v[at + 1] - v[at])
    there = f[at] + share * (f[at + 1] - f[at])
    rises = v[at + 1] > v[at]
    mean = 0.5 * (there[rises].mean() + there[~rises].mean())
    assert measured == pytest.approx(mean, rel=2e-3)  # read off a table over the speed
    assert 0.0 < error < 2.0


def test_a_model_that_misses_has_intervals_that_hold_the_measured_force(both) -> None:
    _, known, levels = both[1]
    assert known.diagnoses[0].is_structured
    missed = [level for level in levels.levels if level.disagrees]
    assert missed
    for level in levels.levels:
        assert level.misfit > level.error
        # On the cycles of the log: the level's own sine has another filter.
        assert abs(level.difference) < 1.96 * math.hypot(level.misfit, level.error) + 1.0
    told = {(one.speed, one.stroke): one for one in credible_forces(levels.levels)}
    for level in missed:
        one = told[level.speed, level.stroke]
        assert one.is_measured
        assert (one.force, one.error) == (level.measured, level.measured_error)
        assert one.misfit == abs(level.measured - level.difference - level.force)
    for interval in known.uncertainties[0].intervals.values():
        assert interval.misfit > interval.error > 0.0
        assert interval.high > interval.low


def test_intervals_for_a_wrong_model_hold_what_another_stroke_finds(both) -> None:
    """Noise alone would have it that the two strokes are two dampers."""
    log = bent(recording(10, noise=4.0, duration=6.0, amplitude=0.028))
    campaign = identify([condition(log)], PURDY_DAMPER, PLAIN)
    other = assess(campaign, PURDY_DAMPER).uncertainties[0].intervals
    one = both[1][1].uncertainties[0].intervals
    for name in PLAIN.free:
        a, b = one[name], other[name]
        at = [math.sqrt(x.low * x.high) for x in (a, b)]
        apart = abs(math.log(at[1] / at[0]))
        noise = math.hypot(a.error / at[0], b.error / at[1])
        whole = math.hypot(noise, a.misfit / at[0], b.misfit / at[1])
        assert apart < 1.96 * whole
        assert apart > 1.2 * noise


def test_the_error_at_a_speed_is_that_of_the_mean_of_both_branches() -> None:
    """Passed four times each way, by the mean of the samples before and behind."""
    velocity = np.array([-1.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
    missed = np.array([0.0, 2.0, 2.0, -4.0, 0.0, 2.0, 2.0, -4.0, 0.0])  # 1, 2, -1, -2 twice
    part: Any = (None, velocity, 100.0 + missed, missed)
    at_rest, never = np.transpose(_at_speeds(part, (0.0, 3.0))[0])
    error = 0.5 * math.sqrt((4.0 / 3.0 + 16.0 / 3.0) / 4.0)
    assert at_rest.tolist() == pytest.approx([100.0, error, 0.0])
    assert np.isnan(never).all()


@pytest.mark.parametrize(("first", "top"), [(0.2599, 0.2469), (0.26002, 0.247019)])
def test_a_speed_that_the_first_sample_alone_has_is_none(monkeypatch, first, top) -> None:
    """0.26 m/s is passed in bump, and in rebound before the first sample only."""
    turn = np.cos(np.linspace(0.0, 12.0 * np.pi, 2000, endpoint=False))
    velocity = np.where(turn > 0.0, 0.2599, 0.2603) * turn
    velocity[0] = first
    stretch = SimpleNamespace(amplitude=0.02, frequency=2.0)
    part = (stretch, velocity, 1000.0 * velocity, np.zeros(2000))
    monkeypatch.setattr("damperfit.uncertainty.speed_forces._fastest", lambda _: iter([part]))
    fit = SimpleNamespace(setting=Setting.of(1))
    for one in speed_forces(SimpleNamespace(fit=fit), is_structured=False):
        assert one.speeds[-1] == pytest.approx(top, abs=1e-4)
        assert np.isfinite(one.measured).all()
        assert len(one.speeds) == len(one.measured) == len(one.difference) == len(one.misfit)


@pytest.mark.parametrize("speed", [0.1, 0.13, 0.2, 0.3])
def test_between_two_speeds_forces_lie_on_a_line(speed: float) -> None:
    speeds = (0.1, 0.2, 0.3)
    rows = [(100.0, 140.0, 150.0), (1.0, 2.0, math.nan), (3.0, 4.0, 9.0), (0.0, 1.0, 0.0)]
    known = SpeedForces(Setting.of(1), "bump", 0.03, 1.5, 1.0, speeds, *rows)
    found = known.at(speed)
    expected = [np.interp(speed, speeds, row) for row in rows]
    assert found == pytest.approx(expected, nan_ok=True)
    assert known.at(0.0999) is known.at(0.3001) is None


def level(difference: float, *, measured: float = 1000.0, error: float = 0.0, **more) -> Level:
    plain = Level(Setting.of(1), 0.1, "rebound", 900.0, 1.0, 1.0, np.zeros(0), is_cavitating=False)
    return replace(
        plain,
        measured=measured,
        measured_error=error,
        difference=difference,
        half_range=1500.0,
        **more,
    )


def test_by_how_much_a_model_may_miss_the_measured_force() -> None:
    assert level(20.1).disagrees
    assert not level(19.9).disagrees
    # Near its passage through zero half a per cent of half the range counts.
    assert level(7.6, measured=3.0).disagrees
    assert not level(7.4, measured=3.0).disagrees
    # And three standard errors, where they are known.
    assert not level(22.9, error=1.0).disagrees
    assert level(23.1, error=1.0).disagrees
    assert level(20.1, error=math.nan).disagrees
    assert not level(math.nan, measured=math.nan).disagrees
    assert level(math.nan, measured=math.nan).as_measured.force == 900.0


def test_where_one_setting_disagrees_all_are_told_as_measured() -> None:
    agrees = replace(level(1.0), setting=Setting.of(2))
    elsewhere = replace(agrees, speed=0.2)
    told = credible_forces((level(100.0), agrees, elsewhere))
    assert [one.is_measured for one in told] == [True, True, False]


def test_what_a_filter_takes_off_a_knee_is_in_the_interval_of_the_measured_force() -> None:
    numbers = SHARP.values(TRUTH)
    angle = 2.0 * math.pi * FREQUENCY * np.arange(6000) / 1000.0
    x, v = AMPLITUDE * np.sin(angle), AMPLITUDE * 2.0 * math.pi * FREQUENCY * np.cos(angle)
    force = simulate(numbers, SHARP, Motion(1e-3, x, v), options=TIGHT).force
    noise = np.random.default_rng(1).normal(0.0, 1.0, len(force))
    log = Recording(
        name="knee.csv", path="", sha256="", setting=Setting.of(1),
        time=np.arange(6000) / 1000.0, displacement=x, force=force + noise,
    )  # fmt: skip
    free = (*NAMES, "f_0")
    fixed = {name: TRUTH[name] for name in TRUTH if name not in free}
    start = GivenStart({name: TRUTH[name] for name in free})
    options = FitOptions("plain", free=free, fixed=fixed, start=start)
    campaign = identify([condition(log)], SHARP, options)
    judged = assess(campaign, SHARP)
    speeds, sine = [0.01 * k for k in range(3, 29)], Sine(AMPLITUDE, FREQUENCY)
    (fit,) = campaign.fits
    stage = stage_of(fit, judged.uncertainties[0])
    found = levels([stage], SHARP, sine, speeds=speeds)
    truth = levels([replace(stage, parameters=numbers)], SHARP, sine, speeds=speeds)
    shown = [one.as_measured for one in beside_measured(found, judged.forces, sine)]
    apart = [abs(a.force - b.force) for a, b in zip(shown, truth, strict=True)]
    alone = [1.96 * one.error for one in shown]
    assert max(off / abs(b.force) for off, b in zip(apart, truth, strict=True)) > 2e-3
    assert any(off > reach for off, reach in zip(apart, alone, strict=True))
    assert all(one.low <= b.force <= one.high for one, b in zip(shown, truth, strict=True))


KNOWN = SpeedForces(
    setting=Setting.of(1),
    stroke="rebound",
    amplitude=AMPLITUDE,
    frequency=FREQUENCY,
    half_range=1500.0,
    speeds=(0.05, 0.2),
    measured=(100.0, 400.0),
    measured_se=(1.0, 1.0),
    difference=(5.0, 15.0),
    misfit=(7.0, 10.0),
)


@pytest.mark.parametrize(("ratio", "is_same"), [(1.049, True), (1.051, False)])
def test_the_measured_force_stands_at_the_motion_of_the_test_alone(
    ratio: float, *, is_same: bool
) -> None:
    plain = Level(Setting.of(1), 0.1, "rebound", 190.0, 1.0, 1.0, np.zeros(0), is_cavitating=False)
    (seen,) = beside_measured([plain], [KNOWN], Sine(AMPLITUDE / ratio, FREQUENCY))
    assert seen.misfit == pytest.approx(8.0)
    assert math.isfinite(seen.measured) is is_same
    if is_same:
        assert (seen.measured, seen.difference) == (pytest.approx(200.0), pytest.approx(25.0 / 3.0))
    assert (
        beside_measured([replace(plain, stroke="bump")], [KNOWN], Sine(AMPLITUDE, 1.5))[0].misfit
        == 0.0
    )
    assert KNOWN.at(0.21) is None


def test_an_error_for_the_wrong_model_holds_what_another_stroke_moves() -> None:
    """The figures that CONTRIBUTING tells of a knee that the model has not."""
    seen = {}
    for amplitude in (0.032, 0.028, 0.022):
        log = bent(recording(10, noise=4.0, duration=6.0, amplitude=amplitude))
        campaign = identify([condition(log)], PURDY_DAMPER, PLAIN)
        values = campaign.fits[0].parameters
        (known,) = assess(campaign, PURDY_DAMPER).uncertainties
        seen[amplitude] = values, known.intervals
    (values, intervals), (shorter, _), (shortest, _) = seen.values()
    moved = shorter.k_e / values.k_e - 1.0
    assert moved == pytest.approx(0.07, abs=0.01)
    assert 3.0 < moved / (intervals["k_e"].error / values.k_e) < 5.0
    assert intervals["k_e"].misfit / values.k_e == pytest.approx(0.23, abs=0.02)
    # It knows nothing of what the parameters absorb.
    assert shortest.r_m1 - values.r_m1 > 5.0 * intervals["r_m1"].misfit
