"""A log is cut into what repeats and what moves; what leads over, rest, run-up and coast-down."""

from dataclasses import replace

import numpy as np
import pytest

from damperfit.conditioning import condition, noise_floor, transients
from damperfit.conditioning.timebase import UniformLog, continue_log
from damperfit.damper.purdy.parameters import PURDY_DAMPER, reference_parameters
from damperfit.errors import ConditioningError
from damperfit.recording import Recording
from damperfit.simulation import Motion, simulate
from damperfit.tested.setting import Setting
from tests.conditioning.logs import (
    LAW,
    RATE,
    found,
    moving,
    recording,
    sine_log,
    speeds,
    warned,
)
from tests.laws.valve_logs import VALUES, damper, moved


def seen(trace):
    return [(s.kind, round(s.frequency, 2), round(1e3 * s.amplitude, 1)) for s in trace.segments]


def steady(*parts):
    """What `seen` tells of speeds (Hz, mm)."""
    return [("steady", frequency, amplitude) for frequency, amplitude in parts]


@pytest.mark.parametrize(
    "parts",
    [
        # Three cycles of 1.5 Hz last as long as one of 0.5 Hz, and are none of it.
        ((0.5, 0.02, 6), (1.5, 0.02, 6), (3.0, 0.02, 6)),
        ((3.0, 0.02, 6), (1.5, 0.02, 6), (0.5, 0.02, 6)),
        ((0.4, 0.02, 6), (2.0, 0.02, 6)),
        # Down to a twentieth.
        ((2.0, 0.04, 5), (2.0, 0.01, 6), (2.0, 0.002, 6)),
        ((1.0, 0.02, 4), (5.0, 0.004, 3), (2.0, 0.01, 4)),
        ((1.0, 0.02, 4), (10.0, 0.004, 3), (2.0, 0.01, 4)),
    ],
)
def test_steps_without_pauses_keep_to_themselves(parts):
    trace = condition(speeds(*parts))
    assert seen(trace) == steady(*((frequency, 1e3 * size) for frequency, size, _ in parts))
    fewest = min(trace.segments, key=lambda one: one.n_cycles)
    assert fewest.n_cycles >= (1 if fewest.frequency > 9.0 else 2)
    if all(cycles == 6 for *_, cycles in parts):
        assert all(segment.noise < 4.0 for segment in trace.segments)
        assert noise_floor(trace) < 0.01


def leading_over(share, where, *, size=1.0, seed=1):
    """Six cycles at 1 Hz with one of another length or size at an end, alone or before 2 Hz."""
    one, other = (1.0, 0.03, 6), (1.0 + share, 0.03 * size, 1)
    parts = {
        "before the end": (one, other),
        "at the beginning": (other, one),
        "before another speed": (one, other, (2.0, 0.03, 6)),
        "before one as near": (one, other, (1.0 + 2.0 * share, 0.03 * size**2, 6)),
    }
    begin = 0.0 if where == "at the beginning" else 6.0
    length = 1.0 / (1.0 + share)
    trace = condition(speeds(*parts[where], seed=seed))
    compared = trace.start_time + np.arange(len(trace.force))[trace.compared] * trace.interval
    inside = (compared > begin + 0.02 * length) & (compared < begin + 0.98 * length)
    assert all(segment.kind == "steady" for segment in trace.segments)
    assert trace.n_cycles >= 4
    return float(np.mean(inside)) * trace.n_samples * trace.interval


PLACES = ("before the end", "at the beginning", "before another speed", "before one as near")


@pytest.mark.one_in(5)
@pytest.mark.parametrize("where", PLACES)
@pytest.mark.parametrize("share", [0.015, -0.015, 0.025, 0.035, -0.045, 0.055])
def test_no_cycle_that_leads_over_is_in_a_steady_run(share, where):
    # 1 % is what a cycle may be off; 5 % was.
    assert leading_over(share, where) == 0.0


@pytest.mark.parametrize(("turns", "is_used"), [(2.5, False), (5.5, True)])
def test_motion_that_does_not_repeat_needs_more_than_three_cycles(turns, is_used):
    t = np.arange(round(turns * RATE)) / RATE
    log = moving(0.03 * (1.0 - 0.12 * t) * np.sin(2.0 * np.pi * t))
    if is_used:
        assert condition(log).segments[0].kind == "moving"
    else:
        with pytest.raises(ConditioningError, match="whole steady cycles"):
            condition(log)


def test_the_figures_of_each_segment_are_those_of_its_law():
    trace = condition(speeds((1.03, 0.03, 8), (2.07, 0.03, 8), noise=0.0))
    a, b, c = LAW
    for segment in trace.segments:
        told = segment.figures
        peak = 2.0 * np.pi * segment.frequency * 0.03
        assert told.peak_speed_rebound == pytest.approx(peak, rel=2e-3)
        assert told.peak_force_rebound == pytest.approx(a * peak**2 + b * peak + c, rel=0.01)
        assert told.peak_force_bump == pytest.approx(-told.peak_force_rebound, rel=0.01)
        energy = 4.0 * 0.03 * c + np.pi * b * peak * 0.03 + 8.0 / 3.0 * a * peak**2 * 0.03
        assert told.energy == pytest.approx(energy, rel=0.01)
        assert told.hysteresis_speed == pytest.approx(0.5 * peak, rel=0.01)
        assert abs(told.hysteresis_rebound) < 5.0
        assert segment.describe(trace)["energy_J"] == told.energy


# Rest, run-up and coast-down of one steady run.


# Three cycles at 5 to 10 Hz suffice, alone and among other speeds; only what was logged counts.

FINE = 1024.0


def noisy(log, seed=1):
    random = np.random.default_rng(seed)
    n = len(log.time)
    x = log.displacement + 3e-6 * random.standard_normal(n)
    return recording(log.time, x, log.force + 4.0 * random.standard_normal(n))


def fast_log(**more):
    return sine_log(**{"frequency": 10.0, "rate": FINE, "amplitude": 0.005, **more})


@pytest.mark.one_in(5)
@pytest.mark.parametrize("frequency", [5.0, 7.0, 10.0])
@pytest.mark.parametrize("phase", [0.0, 0.7, 1.57, 3.0, 4.0, 5.5])
def test_three_cycles_alone_are_compared(frequency, phase):
    trace = condition(noisy(fast_log(frequency=frequency, cycles=3.0, phase=phase)))
    assert trace.n_cycles == 3
    assert trace.frequency == pytest.approx(frequency, rel=1e-3)
    assert trace.amplitude == pytest.approx(0.005, rel=2e-3)
    assert "continued" in found(trace)
    assert not trace.warnings
    # Compared is what was logged, to a hundredth of a cycle.
    first, stop = trace.segments[0].first, trace.segments[0].stop
    at = trace.start_time + trace.interval * np.arange(first, stop)
    assert at[0] >= -0.006 / frequency - 1.0 / FINE
    assert at[-1] <= 3.006 / frequency + 1.0 / FINE
    # The channels are those of the whole motion, up to the log's ends: noise alone is left.
    other = condition(fast_log(frequency=frequency, cycles=40.0, phase=phase))
    there = other.start_time + other.interval * np.arange(len(other.force))
    for name, off in (("displacement", 6e-6), ("force", 10.0)):
        # Friction turns between two samples: the filter's slope there.
        expected = np.interp(at + 20.0 / frequency, there, getattr(other, name))
        assert np.abs(getattr(trace, name)[first:stop] - expected).max() < off


def test_a_log_is_continued_by_what_repeats():
    n = np.arange(400)
    wave, other = (np.sin(2 * np.pi * n / 97.3 + shift) for shift in (0.4, 1.9))
    log, first, stop = continue_log(UniformLog(0.0, 1e-3, wave, other), 96.0, 98.0, reach=50)
    # The longest first cycle and the reach ahead, the reach behind.
    assert (first, stop, len(log.force)) == (149, 549, 601)
    assert log.start_time == pytest.approx(-0.149)
    at = np.arange(-149, 452)
    assert np.abs(log.displacement - np.sin(2 * np.pi * at / 97.3 + 0.4)).max() < 1e-5
    assert np.abs(log.force - np.sin(2 * np.pi * at / 97.3 + 1.9)).max() < 1e-5
    assert np.array_equal(log.force[149:549], other)


def test_what_is_asked_of_a_continued_log_is_read_in_its_own_samples():
    trace = condition(speeds((0.3, 0.03, 3), (12, 0.005, 9)))
    assert [one.n_cycles for one in trace.segments] == [2, 7]
    assert trace.segments[-1].first > 10750  # the whole log; the trace begins before it


def test_a_cycle_at_the_end_ends_where_another_speed_begins():
    with pytest.raises(ConditioningError, match="no whole steady cycle is left"):
        condition(speeds((2.0, 0.03, 2), (1.82, 0.03, 1)))


def test_steady_cycles_beyond_a_break_are_told():
    few = warned(speeds((1.5, 0.03, 6), (0, 0.0, 0.6), (1.5, 0.03, 2.2)))["unsteady_cycles"]
    assert few.values["value"] == 2.0


# Run-up, coast-down and changes of speed as what is predicted.


def conditioned(x, *, noise=0.0):
    """A displacement on the paper's damper at setting 10, as a trace; noise 1: 4 N and 8 um."""
    motion = Motion(1.0 / RATE, x, np.gradient(x, 1.0 / RATE))
    force = simulate(reference_parameters(10), PURDY_DAMPER, motion).force
    chance = np.random.default_rng(3)
    x = x + noise * chance.normal(0.0, 8e-6, len(x))
    force = force + noise * chance.normal(0.0, 4.0, len(x))
    time = np.arange(len(x)) / RATE
    return condition(Recording("a.csv", "a.csv", "", Setting.of(10), time, x, force))


def run_up(seconds=1.5, *, rest=0.6, cycles=6.0, start=0.0):
    """Rest, a motor that runs up to 1.5 Hz and 32 mm, cycles, down again, rest."""
    ramp = np.linspace(0.0, 1.5, round(seconds * RATE))
    still = np.zeros(round(rest * RATE))
    steady = np.full(round(cycles / 1.5 * RATE), 1.5)
    speed = np.concatenate([still, ramp, steady, ramp[::-1], still])
    return 0.032 * np.sin(start + 2.0 * np.pi * np.cumsum(speed) / RATE)


@pytest.fixture(scope="module")
def two_speeds():
    """All that was logged of two speeds, nothing of it cut."""
    motion = moved((0.06, 0.24))
    force = simulate(damper().values(VALUES), damper(), motion).force
    time = motion.interval * np.arange(len(force))
    log = Recording("a.csv", "a.csv", "", Setting.of(3), time, motion.displacement, force)
    return condition(log).whole


def test_the_change_of_speed_is_what_lies_between(two_speeds) -> None:
    first, second = two_speeds.segments
    up, between, down = transients(two_speeds).segments
    assert up.stop <= first.first
    assert second.stop <= down.first
    assert between.kind == "moving"
    assert first.stop <= between.first < between.stop <= second.first
    # Half a second of sweep, and what of the slow motion no whole cycle holds.
    assert between.n_samples * two_speeds.interval == pytest.approx(0.5, abs=0.4)
    assert between.peak_speed > 0.06
    assert between.amplitude == pytest.approx(0.02, rel=0.05)
    whole = replace(first, first=0, stop=len(two_speeds.force))
    assert transients(replace(two_speeds, segments=(whole,))) is None


def test_run_up_and_coast_down_pass_through_conditioning() -> None:
    cut = conditioned(run_up())
    beside = transients(cut)
    # Rest is none of it, nor is the first steady cycle or what the filter reaches.
    ends = [end for one in beside.segments for end in (one.first, one.stop)]
    assert ends == pytest.approx([600, 2100, 6100, 7600], abs=400)
    # What is fitted is what it was: a cycle of run-in, and no more.
    assert len(cut.force) < 0.7 * len(beside.force)
    (own,), (same,) = cut.segments, cut.whole.segments
    shift = same.first - own.first
    assert np.array_equal(cut.force, cut.whole.force[shift : shift + len(cut.force)])
    assert cut.whole.start_time + shift / RATE == pytest.approx(cut.start_time)


@pytest.mark.parametrize("rest", [0.6, 0.05])
def test_steady_cycles_that_begin_and_end_at_once_are_no_test(rest) -> None:
    still = np.zeros(round(rest * RATE))
    x = 0.032 * np.sin(2.0 * np.pi * 1.5 * np.arange(round(6.0 / 1.5 * RATE)) / RATE)
    cut = conditioned(np.concatenate([still, x, still]))
    assert transients(cut) is None
    assert cut.whole is None
