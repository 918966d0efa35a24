"""Three cycles at 5 to 10 Hz suffice, alone and among other speeds; only what was logged counts."""

from __future__ import annotations

import math

import numpy as np
import pytest

from damperfit.conditioning import condition
from damperfit.conditioning.timebase import UniformLog, continue_log
from tests.conditioning.logs import LAW, recording, sine_log, static_force

RATE = 1024.0
FREQUENCIES = (0.2, 0.3, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)


def noisy(log, seed=1):
    random = np.random.default_rng(seed)
    n = len(log.time)
    x = log.displacement + 3e-6 * random.standard_normal(n)
    return recording(log.time, x, log.force + 4.0 * random.standard_normal(n))


def names(trace):
    return {one.name for one in trace.findings}


@pytest.mark.one_in(5)
@pytest.mark.parametrize("frequency", [5.0, 7.0, 10.0])
@pytest.mark.parametrize("phase", [0.0, 0.7, 1.57, 3.0, 4.0, 5.5])
def test_three_cycles_alone_are_compared(frequency, phase):
    log = sine_log(frequency=frequency, cycles=3.0, rate=RATE, amplitude=0.005, phase=phase)
    trace = condition(noisy(log))
    assert trace.n_cycles == 3
    assert trace.frequency == pytest.approx(frequency, rel=1e-3)
    assert trace.amplitude == pytest.approx(0.005, rel=2e-3)
    assert "continued" in names(trace)
    assert not trace.warnings
    # Compared is what was logged, to a hundredth of a cycle.
    first, stop = trace.stretches[0].first, trace.stretches[0].stop
    begin = trace.start_time + first * trace.interval
    end = trace.start_time + stop * trace.interval
    assert begin >= -0.006 / frequency - 1.0 / RATE
    assert end <= 3.006 / frequency + 2.0 / RATE
    # The channels are those of the whole motion, up to the log's ends: noise alone is left.
    whole = sine_log(frequency=frequency, cycles=40.0, rate=RATE, amplitude=0.005, phase=phase)
    other = condition(whole)
    at = trace.start_time + trace.interval * np.arange(first, stop)
    there = other.start_time + other.interval * np.arange(len(other.force))
    inside = at + 20.0 / frequency
    for seen, expected, off in (
        (trace.displacement, other.displacement, 6e-6),
        (trace.force, other.force, 10.0),
    ):
        # Friction turns between two samples: the filter's slope there.
        assert np.abs(seen[first:stop] - np.interp(inside, there, expected)).max() < off


def relaxing(time_constant, *, frequency=10.0, cycles=3.0):
    """A log that begins with the motion: its force builds up."""
    log = sine_log(frequency=frequency, cycles=cycles, rate=RATE, amplitude=0.005, phase=0.3)
    built = 1.0 - np.exp(-log.time / time_constant)
    return noisy(recording(log.time, log.displacement, log.force * built))


def test_a_beginning_of_the_motion_is_run_in():
    trace = condition(relaxing(3e-3))
    assert trace.n_cycles == 2
    begin = trace.start_time + trace.stretches[0].first * trace.interval
    assert begin > 5 * 3e-3
    # What is compared is the settled motion.
    settled = condition(noisy(sine_log(frequency=10.0, rate=RATE, amplitude=0.005)))
    for name in ("peak_force_rebound", "peak_force_bump"):
        found, expected = (getattr(t.stretches[0].figures, name) for t in (trace, settled))
        assert found == pytest.approx(expected, rel=0.01)


def test_rest_ahead_and_motion_to_the_end():
    log = sine_log(frequency=8.0, cycles=4.0, rate=RATE, amplitude=0.005, phase=0.0, centre=0.0)
    still = np.zeros(900)
    x, f = (np.concatenate([still, part]) for part in (log.displacement, log.force))
    trace = condition(noisy(recording(np.arange(len(x)) / RATE, x, f)))
    (stretch,) = trace.stretches
    assert stretch.n_cycles == 3
    assert trace.start_time + stretch.first * trace.interval > 900 / RATE
    told = next(one for one in trace.findings if one.name == "continued")
    assert "at the end of the log" in told.sentence


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


def several_speeds(cycles, *, blend, seed=1):
    """A rest, 13 speeds without a pause, a slow ramp out and back, at 1024 Hz."""
    parts = [np.zeros(2048)]
    for frequency in FREQUENCIES:
        t = np.arange(round(cycles(frequency) / frequency * RATE)) / RATE
        parts.append(min(0.02, 0.06 / frequency) * np.sin(2.0 * np.pi * frequency * t))
    ramp = np.linspace(0.0, 0.02, 4096)
    x = np.concatenate([*parts, ramp, ramp[::-1]])
    if blend:
        window = np.hanning(round(blend * RATE) + 2)
        padded = np.pad(x, len(window), mode="edge")
        x = np.convolve(padded, window / window.sum(), "same")[len(window) : -len(window)]
    v = np.gradient(x, 1.0 / RATE)
    return noisy(recording(np.arange(len(x)) / RATE, x, static_force(v)), seed)


@pytest.mark.parametrize("blend", [0.0, 0.03])
@pytest.mark.parametrize("cycles", [3, 4])
def test_thirteen_speeds_without_a_pause_are_thirteen_stretches(cycles, blend):
    trace = condition(several_speeds(lambda _: cycles, blend=blend))
    assert [one.kind for one in trace.stretches] == ["steady"] * 13
    for stretch, frequency in zip(trace.stretches, FREQUENCIES, strict=True):
        assert stretch.frequency == pytest.approx(frequency, rel=3e-3)
        # A rest takes the first half cycle, and the last; between speeds all are compared.
        at_rest = frequency in {FREQUENCIES[0], FREQUENCIES[-1]}
        assert stretch.n_cycles == cycles - at_rest
        amplitude = min(0.02, 0.06 / frequency)
        if not blend:
            assert stretch.amplitude == pytest.approx(amplitude, rel=5e-3)
            speed = 2.0 * math.pi * frequency * amplitude
            assert stretch.peak_speed == pytest.approx(speed, rel=0.01)
            assert stretch.figures.peak_speed_rebound == pytest.approx(speed, rel=0.01)
            a, b, c = LAW  # 30 Hz takes 1.6 % off its third harmonic at 10 Hz
            force = a * speed**2 + b * speed + c
            assert stretch.figures.peak_force_rebound == pytest.approx(
                force, abs=0.02 * force + 5.0
            )
    assert not trace.warnings


@pytest.mark.parametrize("speed", [0.13, 0.18])
def test_five_cycles_between_rests_are_compared_but_for_their_run_in(speed):
    """A window behind run-in and the filter's edges held one cycle at 0.13 m/s, four at 0.18."""
    line = np.arange(1, round(RATE * 0.02 / speed) + 1) * speed / RATE
    once = np.concatenate([line, line[::-1], -line, -line[::-1]])
    rest = np.zeros(round(0.4 * RATE))
    x = np.concatenate([rest, np.tile(once, 5), rest])
    v = np.gradient(x, 1.0 / RATE)
    trace = condition(noisy(recording(np.arange(len(x)) / RATE, x, static_force(v))))
    assert trace.n_cycles >= 4
    assert "cycles" not in names(trace)
