"""Recordings to traces: filters on both sides, invariances, cycles, bad input."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import butter, sosfilt, sosfiltfilt

from damperfit.conditioning import ConditionOptions, apply_filter, condition
from damperfit.errors import ConditioningError, ConfigurationError
from tests.conditioning.logs import LAW, recording, sine_log, static_force

RIG = butter(4, 30.0, fs=1000.0, output="sos")


def misfit(trace):
    """Largest relative error of the true static damper, compared as an identification does."""
    force = apply_filter(trace.model_filter, static_force(trace.velocity))
    return np.abs(force - trace.force)[trace.compared].max() / np.abs(trace.force).max()


def fitted_law(trace):
    """a, b, c of the static damper by linear least squares behind the model filter."""
    v = trace.velocity
    columns = np.stack([v * np.abs(v), v, np.sign(v)])
    basis = apply_filter(trace.model_filter, columns)[:, trace.compared]
    return np.linalg.lstsq(basis.T, trace.force[trace.compared], rcond=None)[0]


def in_the_rig(log, filtered):
    """The same log behind a rig's filter that has run for long."""
    long = sine_log(cycles=30.0, phase=1.1 - 15.0 * 2 * np.pi)
    n = len(log.time)
    return replace(
        log,
        displacement=filtered(long.displacement)[n : 2 * n],
        force=filtered(long.force)[n : 2 * n],
    )


CASES = {
    "ours, zero-phase": (sine_log(), ConditionOptions()),
    "ours, causal": (sine_log(), ConditionOptions(filter="causal")),
    "none": (sine_log(), ConditionOptions(filter="none")),
    "rig, causal": (
        in_the_rig(sine_log(), lambda s: sosfilt(RIG, s)),
        ConditionOptions(rig_filter="causal"),
    ),
    "rig, zero-phase": (
        in_the_rig(sine_log(), lambda s: sosfiltfilt(RIG, s, padlen=900)),
        ConditionOptions(rig_filter="zero_phase"),
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_the_true_damper_fits_behind_every_filter(case):
    trace = condition(*CASES[case])
    assert misfit(trace) < 1e-8
    assert fitted_law(trace) == pytest.approx(LAW, rel=2e-6)
    assert trace.n_cycles >= 12


def test_our_causal_filter_equals_one_in_the_rig():
    ours = condition(*CASES["ours, causal"])
    rigs = condition(*CASES["rig, causal"])
    assert ours.force[ours.compared] == pytest.approx(rigs.force[rigs.compared], abs=1e-5)
    assert np.array_equal(ours.model_filter.sections, rigs.model_filter.sections)


def test_a_causal_rig_filter_that_is_not_declared_ruins_the_fit():
    trace = condition(CASES["rig, causal"][0])
    assert misfit(trace) > 1e-3  # so the tests above can fail


def test_another_corner_and_order_in_the_rig():
    sections = butter(2, 50.0, fs=1000.0, output="sos")
    log = in_the_rig(sine_log(), lambda s: sosfilt(sections, s))
    options = ConditionOptions(rig_filter="causal", rig_filter_corner=50.0, rig_filter_order=2)
    # 1/(1 + (1.5/50)^4) takes 8e-7 off the motion
    assert misfit(condition(log, options)) < 2e-6
    wrong = ConditionOptions(rig_filter="causal", rig_filter_corner=30.0)
    assert misfit(condition(log, wrong)) > 1e-3


def test_data_that_the_rig_filtered_without_delay_are_left_alone():
    log, options = CASES["rig, zero-phase"]
    trace = condition(log, options)
    at = round(trace.start_time * 1000.0)
    assert np.array_equal(trace.force, log.force[at : at + len(trace.force)])


@given(
    frequency=st.floats(0.5, 8.0),
    rate=st.sampled_from([250.0, 300.0, 500.0, 1000.0, 2000.0, 5000.0]),
    phase=st.floats(0.0, 2 * np.pi),
    cycles=st.floats(12.0, 20.0),
)
@settings(deadline=None)
def test_sines_of_any_phase_frequency_and_rate(frequency, rate, phase, cycles):
    log = sine_log(frequency=frequency, rate=rate, phase=phase, cycles=cycles)
    log = replace(log, force=np.gradient(log.displacement, log.time) * 1500.0)
    trace = condition(log)
    assert trace.frequency == pytest.approx(frequency, rel=1e-6)
    assert trace.amplitude == pytest.approx(0.032, rel=1e-4)
    assert trace.centre == pytest.approx(0.0123, abs=1e-6)
    assert abs(trace.n_cycles_found - cycles) < 1.02
    # whole cycles, and as many as run-in and edges leave
    n_window = trace.n_samples
    assert n_window == pytest.approx(trace.n_cycles * rate / frequency, abs=1.0)
    lost = 2 * 0.26 * frequency + 1.0 + 2.0  # edges, run-in, alignment
    assert cycles - lost - 0.1 <= trace.n_cycles <= cycles - 1.0
    at_starts = np.interp(
        trace.fastest.cycle_starts, np.arange(len(trace.force)), trace.displacement
    )
    assert np.abs(at_starts).max() < 1e-3 * 0.032
    assert (
        np.interp(trace.fastest.cycle_starts, np.arange(len(trace.force)), trace.velocity) > 0
    ).all()


@pytest.mark.parametrize(
    ("frequency", "rate", "cycles", "expected"),
    [
        (0.05, 100.0, 4.5, 2),
        (1.4, 500.0, 7.0, 4),
        (20.0, 1000.0, 40.0, 28),
        (20.0, 100.0, 60.0, 30),
    ],
)
def test_slow_short_and_fast_tests(frequency, rate, cycles, expected):
    trace = condition(sine_log(frequency=frequency, rate=rate, cycles=cycles, amplitude=0.002))
    assert trace.n_cycles >= expected
    assert trace.frequency == pytest.approx(frequency, rel=1e-5)
    assert trace.n_cycles_found == int(cycles)


def test_the_notes_say_how_many_cycles_of_how_many():
    trace = condition(sine_log())
    (one,) = (one for one in trace.findings if one.name == "cycles")
    assert one.sentence.startswith(f"{trace.n_cycles} of 15 whole cycles evaluated")
    assert one.value == trace.n_cycles


def with_rest():
    """Rest, run-up of the speed, 15 s of steady crank motion, coast-down, rest; noise on top."""
    t = np.arange(25 * 500) / 500.0
    speed = 1.5 * np.clip((t - 3.0) / 1.5, 0.0, 1.0) * np.clip((21.5 - t) / 2.0, 0.0, 1.0)
    angle = 2 * np.pi * np.cumsum(speed) / 500.0
    x = 0.05 - 0.02 * np.cos(angle) - 0.0006 * np.cos(2 * angle)
    x += np.random.default_rng(2).normal(0.0, 8e-6, len(t))
    return recording(t, x, static_force(np.gradient(x, t)))


def test_rest_run_up_and_coast_down_are_left_out():
    trace = condition(with_rest())
    begin = trace.start_time + trace.interval * trace.fastest.cycle_starts[0]
    end = trace.start_time + trace.interval * trace.fastest.cycle_starts[-1]
    assert begin > 4.5
    assert end < 19.5
    assert 18 <= trace.n_cycles <= 21 < trace.n_cycles_found
    assert trace.frequency == pytest.approx(1.5, rel=1e-4)
    # mid-stroke of the crank: its second harmonic is the same at both ends
    assert trace.centre == pytest.approx(0.05 - 0.0006, abs=2e-6)
    assert trace.amplitude == pytest.approx(0.02, abs=5e-6)


def test_a_ramp_from_a_far_parking_position_does_not_move_mid_stroke():
    t = np.arange(10_000) / 500.0
    x = np.where(t < 3.0, -0.1 + 0.1 * t / 3.0, 0.0)
    x += 0.032 * np.sin(2 * np.pi * 1.37 * (t - 3.0)) * ((t > 3.0) & (t < 3.0 + 19 / 1.37))
    trace = condition(recording(t, x, static_force(np.gradient(x, t))))
    assert trace.centre == pytest.approx(0.0, abs=1e-8)
    assert misfit(trace) < 1e-4
    assert trace.fastest.cycle_starts[0] * trace.interval + trace.start_time > 3.0 + 1.0 / 1.37
    assert trace.n_cycles >= 15


def test_a_triangle_wave():
    t = np.arange(10_000) / 500.0
    x = 0.032 * 2 / np.pi * np.arcsin(np.sin(2 * np.pi * 1.5 * t + 0.3))
    trace = condition(recording(t, x, static_force(np.gradient(x, t))))
    assert trace.frequency == pytest.approx(1.5, rel=1e-6)
    assert trace.n_cycles >= 26
    assert trace.centre == pytest.approx(0.0, abs=5e-6)
    assert 0.95 * 0.032 < trace.amplitude < 0.032  # the filter rounds the tips


def test_a_declared_centre_is_taken():
    trace = condition(sine_log(), ConditionOptions(centre=0.01))
    assert trace.centre == 0.01
    middle = 0.5 * (trace.displacement.max() + trace.displacement.min())
    assert middle == pytest.approx(0.0023, abs=1e-6)


@pytest.mark.parametrize("shift", [1.0, -17.3, 1e6])
def test_shifted_time_changes_nothing(shift):
    here, there = condition(sine_log()), condition(sine_log(start=shift))
    assert here.compared == there.compared
    for name in ("displacement", "velocity", "force"):
        a, b = getattr(here, name), getattr(there, name)
        assert np.abs(a - b).max() <= 1e-9 * np.abs(a).max()
    assert there.start_time - here.start_time == pytest.approx(shift, abs=1e-9)


def test_whole_cycles_dropped_from_the_start_change_nothing():
    log = sine_log(cycles=18.0)
    later = replace(
        log, time=log.time[2000:], displacement=log.displacement[2000:], force=log.force[2000:]
    )
    assert fitted_law(condition(later)) == pytest.approx(fitted_law(condition(log)), rel=1e-9)


def test_the_sample_rate_does_not_matter():
    laws = [fitted_law(condition(sine_log(rate=rate))) for rate in (300.0, 1000.0, 5000.0)]
    for law in laws:
        assert law == pytest.approx(LAW, rel=1e-5)


def test_temperature_is_the_mean_over_the_window():
    log = sine_log()
    ramp = 20.0 + log.time
    trace = condition(replace(log, temperature=ramp))
    middle = trace.start_time + 0.5 * (trace.fastest.first + trace.fastest.stop) * trace.interval
    assert trace.temperature == pytest.approx(20.0 + middle, abs=2e-3)
    assert condition(log).temperature is None


def test_arrays_are_contiguous_doubles_of_one_length():
    trace = condition(with_rest())
    for name in ("displacement", "velocity", "force"):
        channel = getattr(trace, name)
        assert channel.flags.c_contiguous
        assert channel.dtype == np.float64
        assert channel.shape == trace.force.shape
    assert 0 < trace.fastest.first < trace.fastest.stop < len(trace.force)


def test_the_filters_loss_at_a_fast_test_is_said():
    trace = condition(sine_log(frequency=20.0, cycles=60.0, amplitude=0.002))
    assert any("filter takes 1.6 % off" in warning for warning in trace.warnings)


LOG = sine_log()
NOISE = np.random.default_rng(7).normal(size=len(LOG.time))
BAD = {
    "constant displacement": (replace(LOG, displacement=0.0 * LOG.time + 0.01), {}, "is constant"),
    "constant force": (replace(LOG, force=0.0 * LOG.time), {}, "the force is constant"),
    "only noise": (replace(LOG, displacement=8e-6 * NOISE), {}, "found 0 whole steady cycles"),
    "a walk": (replace(LOG, displacement=1e-4 * np.cumsum(NOISE)), {}, "whole steady cycles"),
    "two cycles": (sine_log(cycles=2.5), {}, r"found 2 whole .* at least 3 \(2 s\)"),
    "a dozen samples": (sine_log(rate=50.0, cycles=0.4), {}, "13 samples"),
    "rate below the filter": (sine_log(rate=50.0), {}, r"30 Hz .*\(25 Hz"),
    "mm read as m": (sine_log(amplitude=32.0), {}, "32 m, .* mm read as m"),
    "kN read twice": (replace(LOG, force=1e3 * LOG.force), {}, "N, expected .* N read as kN"),
    "beyond chamber 1": (
        sine_log(amplitude=0.14),
        {"chamber_lengths": (0.133, 0.2)},
        r"x reaches 0\.14 m, expected below l_1 \(l_1 = 0\.133 m, l_2 = 0\.2 m",
    ),
    "beyond chamber 2": (
        sine_log(),
        {"chamber_lengths": (0.133, 0.133), "centre": 0.12},
        r"x reaches -0\.139\d m, expected above -l_2",
    ),
    "reversed force": (replace(LOG, force=-LOG.force), {}, "delivers 7.* J per cycle .* reversed"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_logs_are_refused_in_one_line(case):
    log, options, message = BAD[case]
    with pytest.raises(ConditioningError, match=message) as caught:
        condition(log, ConditionOptions(**options))
    assert str(caught.value).startswith("log.csv: ")
    assert "\n" not in str(caught.value)


def test_a_motion_too_small_for_any_rig_is_refused_unless_allowed() -> None:
    log = sine_log()
    small = replace(log, displacement=log.displacement / 1000.0)
    with pytest.raises(ConditioningError, match="was m read as mm"):
        condition(small)
    assert condition(small, ConditionOptions(min_amplitude=0.0)).amplitude < 2e-4


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"filter": "zerophase"}, "Did you mean 'zero_phase'"),
        ({"rig_filter": "yes"}, "expected zero_phase, causal, none"),
        ({"filter_order": 0}, "filter_order: found 0"),
        ({"rig_filter_corner": -30.0}, "rig_filter_corner: found -30 Hz"),
        ({"filter_corner": float("nan")}, "filter_corner"),
        ({"steadiness": 0.0}, "steadiness"),
        ({"centre": float("inf")}, "centre"),
        ({"max_force": 0.0}, "max_force"),
        ({"min_amplitude": 2.0}, "min_amplitude: found 2 m"),
    ],
)
def test_options_without_meaning_are_refused(options, message):
    with pytest.raises(ConfigurationError, match=message):
        ConditionOptions(**options)
