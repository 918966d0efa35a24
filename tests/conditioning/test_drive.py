"""The displacement that drives the model: as filtered on a sine, with its corners on a triangle."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from damperfit.conditioning import ConditionOptions, condition
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.identification import compare, normalised_mse
from damperfit.recording import Drive
from damperfit.simulation import SolverOptions
from tests.conditioning.logs import recording, sine_log, static_force
from tests.oracles.motions import logged


def at_the_truth(trace, setting=10):
    seen = compare(
        reference_parameters(setting), trace, PURDY_DAMPER, solver=SolverOptions(tolerance=1e-3)
    )
    return normalised_mse(trace.force[trace.compared], seen.force[trace.compared])


@pytest.mark.parametrize("noise", [0.0, 3e-6, 10e-6, 60e-6])
@pytest.mark.parametrize("rate", [300.0, 1000.0, 5000.0])
def test_a_sine_drives_as_it_is_compared(noise, rate):
    log = sine_log(rate=rate, cycles=8.0)
    random = np.random.default_rng(1)
    noisy = log.displacement + noise * random.standard_normal(len(log.time))
    trace = condition(replace(log, displacement=noisy))
    assert trace.drive.corner == 30.0
    np.testing.assert_array_equal(trace.drive.displacement, trace.displacement)
    np.testing.assert_array_equal(trace.drive.velocity, trace.velocity)


def with_harmonic(share, *, order=42, rate=1000.0):
    """A sine with a wave of 63 Hz whose velocity is this share of the sine's."""
    time = np.arange(8000) / rate
    turn = 2.0 * np.pi * 1.5 * time
    x = 0.032 * (np.sin(turn) + share / order * np.sin(order * turn))
    v = 0.032 * 2.0 * np.pi * 1.5 * (np.cos(turn) + share * np.cos(order * turn))
    random = np.random.default_rng(1)
    return recording(time, x + 1e-6 * random.standard_normal(len(time)), static_force(v))


@pytest.mark.parametrize(("share", "is_raised"), [(0.0025, False), (0.0035, True), (0.05, True)])
def test_motion_beyond_the_compared_filter_is_kept_from_3_in_1000_on(share, is_raised):
    trace = condition(with_harmonic(share))
    assert (trace.drive.corner > 60.0) is is_raised
    lost = trace.drive.velocity - trace.velocity
    assert bool(np.std(lost) > 0.8 * share * 0.3 / np.sqrt(2.0)) is is_raised


def test_hum_of_the_sensor_is_no_motion():
    log = sine_log(rate=1000.0, cycles=15.0)
    hum = 2e-5 * np.sin(2.0 * np.pi * 50.0 * log.time)  # 6 mm/s, 2 % of the peak velocity
    assert condition(replace(log, displacement=log.displacement + hum)).drive.corner == 30.0


@pytest.mark.parametrize("mains", [50.0, 60.0, 100.0])
@pytest.mark.parametrize("cycles", [3.2, 4.2, 15.0])
def test_hum_at_an_order_of_the_motion_is_no_motion(mains, cycles):
    """At 2 Hz the mains are an order of the motion, and one cycle does not part them at all."""
    log = sine_log(frequency=2.0, cycles=cycles)
    hum = 1e-3 / mains * np.sin(2.0 * np.pi * mains * log.time)
    noise = 1e-6 * np.random.default_rng(1).standard_normal(len(hum))
    trace = condition(replace(log, displacement=log.displacement + hum + noise))
    assert trace.drive.corner == 30.0


@pytest.mark.parametrize(
    "options",
    [
        ConditionOptions(filter="none"),
        ConditionOptions(rig_filter="zero_phase"),
        ConditionOptions(rig_filter="causal"),
    ],
)
def test_what_is_not_ours_to_filter_drives_as_it_is(options):
    trace = condition(with_harmonic(0.05), options)
    np.testing.assert_array_equal(trace.drive.displacement, trace.displacement)


def test_a_triangle_keeps_its_corners():
    trace = condition(logged("triangle"))
    compared = Drive(trace.displacement, trace.velocity, 30.0)
    # 0.0003 % of that is the force's noise.
    assert at_the_truth(trace) < 0.0007
    assert at_the_truth(replace(trace, drive=compared)) > 0.1
    without_noise = condition(logged("triangle", force_noise=0.0, displacement_noise=0.0))
    assert at_the_truth(without_noise) < 0.0004


def noisy_sine(rate, phase, *, noise=3e-6):
    """A sine of 1.5 Hz; of 300 Hz it turns at a sample where the phase is a multiple of 1/200."""
    log = sine_log(rate=rate, phase=2.0 * np.pi * phase)
    x = log.displacement + noise * np.random.default_rng(1).standard_normal(len(log.time))
    return replace(log, displacement=x)


@pytest.mark.parametrize(
    ("rate", "phase", "is_bridged"),
    [(300.0, 0.13, True), (300.0, 0.1325, False), (500.0, 0.0, False), (1000.0, 0.0, False)],
)
def test_samples_at_which_a_sine_turns_are_bridged(rate, phase, is_bridged):
    """Noise decided their friction: at 300 Hz f_f was 2 % too small and R_m3 2 % too large."""
    trace = condition(noisy_sine(rate, phase))
    said = [one.sentence for one in trace.findings if one.name == "drive"]
    if not is_bridged:
        assert trace.model_filter.bridged == ()
        assert not said
        return
    at = np.array(trace.model_filter.bridged)
    speeds = np.abs(trace.velocity)
    assert np.max(speeds[at]) < 6e-4 < np.min(np.delete(speeds, at))
    (sentence,) = said
    assert sentence == (
        "the motion turns on its samples, where noise decides which way friction acts: "
        f"{len(at)} of them are bridged, of the measured and of the modelled force"
    )
