"""What findings say, and from where on they warn: temperature, clock, size, velocity, rate."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from damperfit.conditioning import ConditionOptions, NominalTest, motion
from damperfit.conditioning.log_to_trace import _notes
from damperfit.conditioning.quality import _temperature
from damperfit.conditioning.refusals import refuse_fast, refuse_small
from damperfit.conditioning.timebase import (
    _has_one_or_two_missing,
    _missing_finding,
    _resolution,
    make_uniform,
)
from damperfit.conditioning.velocity import check_velocity
from damperfit.errors import ConditioningError, ConfigurationError
from damperfit.recording import Recording
from tests import fakes
from tests.conditioning.test_limits_of_findings import _log, cycles

TEST = NominalTest(temperature=26.0, temperature_tolerance=1.0)


def recording(n=200, *, time=None, **more) -> Recording:
    t = np.arange(n) / 100.0 if time is None else np.asarray(time)
    wave = np.sin(2.0 * np.pi * 1.5 * t)
    return Recording("a.csv", "a.csv", "", 1, t, 0.03 * wave, 100.0 * wave, **more)


def temperatures(values, test=TEST):
    log = recording(temperature=None if values is None else np.asarray(values, float))
    return {one.name: one for one in _temperature(log, slice(None), test)}


@pytest.mark.parametrize(
    ("mean", "severity"), [(26.9, "note"), (27.1, "warning"), (25.1, "note"), (24.9, "warning")]
)
def test_a_temperature_is_outside_from_its_tolerance_on(mean, severity) -> None:
    found = temperatures(np.full(200, mean))["temperature"]
    assert (found.severity, found.value) == (severity, pytest.approx(mean))
    assert ("outside 26 +- 1 degC; forces fall as the oil warms" in found.sentence) is (
        severity == "warning"
    )


@pytest.mark.parametrize(("drift", "severity"), [(1.95, "note"), (2.15, "warning")])
def test_a_temperature_drifts_from_the_width_of_its_window_on(drift, severity) -> None:
    found = temperatures(26.0 + drift * np.linspace(-0.5, 0.5, 200) / 0.96)["temperature_drift"]
    assert found.severity == severity
    assert found.value == pytest.approx(drift, rel=0.01)
    words = "more than the window of 26 +- 1 degC; let the damper settle"
    assert (words in found.sentence) is (severity == "warning")


@pytest.mark.parametrize(
    "test",
    [
        NominalTest(),
        replace(TEST, temperature=None),
        replace(TEST, temperature_tolerance=math.inf),
    ],
)
def test_a_temperature_that_nobody_asks_for_is_a_note(test) -> None:
    found = temperatures(26.0 + 30.0 * np.linspace(-0.5, 0.5, 200), test)
    assert {one.severity for one in found.values()} == {"note"}
    assert temperatures(None, test) == {}


def test_a_temperature_that_is_asked_for_and_missing_is_a_warning() -> None:
    (found,) = temperatures(None).values()
    assert (found.name, found.severity) == ("temperature_missing", "warning")
    assert "the test asks for 26 +- 1 degC; log it" in found.sentence


def test_missing_samples_are_counted_from_the_first_of_them() -> None:
    time = np.delete(np.arange(300) / 100.0, [120, 200, 201])
    (found,) = make_uniform(recording(time=time)).findings
    assert (found.name, found.severity, found.value) == ("missing_samples", "note", 3.0)
    assert "3 missing samples put in" in found.sentence
    assert "100 Hz; the first after row 120 of the data (time 1.19 s)" in found.sentence
    alone = _missing_finding(recording(), np.array([1.0, 2.0, 1.0]), 1, 100.0)
    assert "the first after row 2 of the data" in alone.sentence


@pytest.mark.parametrize(
    ("lost", "expected"), [((), False), ((50,), True), ((50, 90), True), ((50, 90, 130), False)]
)
def test_one_or_two_samples_may_be_missing_of_exact_stamps(lost, expected) -> None:
    time = np.delete(np.arange(200) / 1000.0, lost)
    assert _has_one_or_two_missing(time) is expected
    jittered = time + 3e-4 * np.random.default_rng(1).uniform(-1.0, 1.0, len(time))
    assert not _has_one_or_two_missing(jittered)


@pytest.mark.parametrize("exponent", range(-5, 1))
def test_the_resolution_of_stamps_is_their_largest_power_of_ten(exponent) -> None:
    rng = np.random.default_rng(exponent + 10)
    stamps = np.cumsum(rng.integers(1, 30, 500)) * 10.0**exponent
    assert _resolution(stamps) == 10.0**exponent
    assert _resolution(np.sqrt(np.arange(500.0))) == 0.0


def test_a_clock_that_jitters_is_told_with_its_worst_step() -> None:
    time = np.arange(400) / 100.0
    time[137:] += 0.003  # one step 30 % too long
    (found,) = make_uniform(recording(time=time)).findings
    assert (found.name, found.severity) == ("jitter", "note")
    assert found.value == pytest.approx(30.0, abs=0.5)
    assert "vary by up to 30 % (after row 137 of the data, time 1.36 s)" in found.sentence
    assert "resampled at 99.9249 Hz" in found.sentence


@pytest.mark.parametrize(("amplitude", "is_refused"), [(1.1e-4, False), (0.9e-4, True)])
def test_a_motion_that_no_rig_makes_is_refused(amplitude, *, is_refused) -> None:
    trace = cycles(4)
    trace = replace(trace, stretches=(replace(trace.fastest, amplitude=amplitude),))
    options = ConditionOptions(min_amplitude=1e-4)
    if not is_refused:
        refuse_small(trace, options)
        return
    with pytest.raises(
        ConditioningError, match=r"swings \+-0\.09 mm, expected at least \+-0\.1 mm"
    ):
        refuse_small(trace, options)


class _At:
    """Cycles of a period in samples."""

    def __init__(self, period):
        self.period = period


@pytest.mark.parametrize(
    ("options", "corner"),
    [
        (ConditionOptions(filter_corner=30.0), 30.0),
        (ConditionOptions(filter="none", filter_corner=30.0), None),
        (ConditionOptions(filter="none", rig_filter="causal", rig_filter_corner=20.0), 20.0),
        (ConditionOptions(rig_filter="zero_phase", rig_filter_corner=20.0), 20.0),
    ],
)
def test_a_motion_above_the_corner_in_force_is_refused(options, corner) -> None:
    log = _log(cycles(4))
    for frequency in (19.0, 21.0, 29.0, 31.0):
        at = _At(300.0 / frequency)
        if corner is None or frequency < corner:
            refuse_fast(recording(), log, at, options)
            continue
        with pytest.raises(ConditioningError, match=f"not below the filter corner of {corner:g}"):
            refuse_fast(recording(), log, at, options)


def velocities(factor, *, late=0.0, reverse=False, noise=0.0):
    trace = cycles(6)
    t = trace.start_time + trace.interval * np.arange(len(trace.force))
    w = 2.0 * np.pi * 1.5
    logged = factor * 0.3 * np.cos(w * (t - trace.start_time - late))
    logged += noise * np.random.default_rng(1).standard_normal(len(t))
    log = Recording(
        "a.csv", "a.csv", "", 1, t, trace.displacement, trace.force,
        velocity=logged, reverse_displacement=reverse,
    )  # fmt: skip
    (found,) = check_velocity(trace, log)
    return found


@pytest.mark.parametrize(
    ("factor", "severity"), [(1.0, "note"), (-1.0, "note"), (1000.0, "warning"), (0.3, "warning")]
)
def test_a_logged_velocity_is_compared_with_the_slope(factor, severity) -> None:
    found = velocities(factor, late=0.002)
    assert found.severity == severity
    size = min(abs(factor), found.value) if severity == "warning" and factor > 1 else abs(factor)
    assert ("with the opposite sign" in found.sentence) is (factor < 0.0)
    assert "2.0 ms late" in found.sentence
    assert (f"is {size:.3g} times the slope" in found.sentence) or factor > 1
    assert ("a unit or the clock of the log is wrong" in found.sentence) is (severity == "warning")


def test_a_reversed_displacement_turns_the_velocity_too() -> None:
    assert "opposite" in velocities(1.0, reverse=True).sentence
    assert "opposite" not in velocities(-1.0, reverse=True).sentence
    assert "does not follow the displacement" in velocities(0.1, noise=1.0).sentence


@pytest.mark.parametrize(
    ("samples", "severity", "said"),
    [
        (10, "note", ""),  # (2 pi/n)^4/180: 0.1 % at 9.6, 1 % at 5.4 samples
        (9, "note", ": velocity is 0.13 % low; sample faster"),
        (6, "note", ": velocity is 0.67 % low; sample faster"),
        (5, "warning", ": velocity is 1.4 % low; sample faster"),
    ],
)
def test_a_rate_is_low_where_the_velocity_is(samples, severity, said) -> None:
    trace = cycles(4, interval=1.0 / (1.5 * samples))
    found = motion._sample_rate(trace, ConditionOptions(filter="none"))
    assert found.severity == severity
    rate = 1.5 * samples
    assert found.sentence == f"sampled at {rate:.4g} Hz, {samples} samples a cycle{said}"


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (ConditionOptions(filter_corner=30.0), ", 10 times the filter's corner"),
        (ConditionOptions(filter="none"), ""),
        (
            ConditionOptions(filter="none", rig_filter="causal", rig_filter_corner=100.0),
            ", 3 times the filter's corner",
        ),
        (
            ConditionOptions(rig_filter="causal", rig_filter_corner=100.0),
            ", 3 times the filter's corner",
        ),
    ],
)
def test_the_rate_is_told_beside_the_corner_in_force(options, said) -> None:
    found = motion._sample_rate(cycles(4), options)
    assert found.sentence == f"sampled at 300 Hz, 200 samples a cycle{said}"


@pytest.mark.parametrize(
    ("metadata", "keys", "dimension", "said"),
    [
        ({"frequency": "1.5"}, "frequency", "frequency", 1.5),
        ({"frequency": "1.5 Hz"}, "frequency", "frequency", 1.5),
        ({"frequency": "fast", "test frequency": "2Hz"}, "frequency", "frequency", 2.0),
        ({"frequency": "0", "test frequency": "2"}, "frequency", "frequency", 2.0),
        ({"amplitude": "32"}, "amplitude", "length", None),  # of which unit?
        ({"amplitude": "32 mm"}, "amplitude", "length", 0.032),
        ({"amplitude": "32", "amplitude_mm": "30"}, "amplitude", "length", 0.03),
        ({"amplitude": "wide", "amplitude (mm)": "30"}, "amplitude", "length", 0.03),
        ({}, "amplitude", "length", None),
    ],
)
def test_what_a_preamble_declares_is_read(metadata, keys, dimension, said) -> None:
    known = {"frequency": motion._FREQUENCY_KEYS, "amplitude": motion._AMPLITUDE_KEYS}[keys]
    found = motion._said(metadata, known, dimension)
    assert found is said if said is None else found == pytest.approx(said)


@pytest.mark.parametrize(("n", "severity"), [(1, "warning"), (2, "note")])
def test_one_cycle_tells_no_scatter(n, severity) -> None:
    found = motion._cycles(cycles(n, n_cycles_found=9))
    assert found.severity == severity
    assert found.sentence.startswith(f"{n} of 9 whole cycles evaluated")
    assert found.value == n


def test_a_fake_trace_has_whole_cycles() -> None:
    assert fakes.trace(1).n_cycles == 1


@pytest.mark.parametrize(
    "name", ["max_amplitude", "max_force", "filter_corner", "rig_filter_corner"]
)
def test_limits_of_conditioning_are_above_zero(name) -> None:
    for value in (0.0, -1.0, math.nan):
        with pytest.raises(ConfigurationError, match=name):
            ConditionOptions(**{name: value})


def test_the_least_amplitude_is_below_the_largest_and_may_be_nothing() -> None:
    assert ConditionOptions(min_amplitude=0.0, max_amplitude=0.1).min_amplitude == 0.0
    for least in (-1e-6, 0.1, 0.2):
        with pytest.raises(ConfigurationError, match="min_amplitude: found"):
            ConditionOptions(min_amplitude=least, max_amplitude=0.1)


@pytest.mark.parametrize("kind", ["causal", "zero_phase"])
def test_a_filter_of_the_rig_is_noted(kind) -> None:
    declared = ConditionOptions(rig_filter=kind, rig_filter_corner=40.0, rig_filter_order=2)
    assert _notes(declared) == (
        f"filtered in the rig as declared ({kind}, 40 Hz, order 2); no filter of our own",
    )
    assert _notes(ConditionOptions()) == ()
