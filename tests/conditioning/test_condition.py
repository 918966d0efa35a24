"""Recordings to traces: filters on both sides, invariances, bad input."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import butter, sosfilt, sosfiltfilt

from damperfit.conditioning import ConditionOptions, apply_filter, condition
from damperfit.damper.purdy.parameters import PURDY_DAMPER, reference_parameters
from damperfit.errors import ConditioningError, ConfigurationError
from damperfit.identification.logs import compare
from damperfit.io import read_log
from damperfit.synthetic import SampleOptions, make_samples
from tests.conditioning.logs import LAW, sine_log, static_force

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


def in_the_rig(filtered):
    """The sine log behind a rig's filter that has run for long."""
    log, long = sine_log(), sine_log(cycles=30.0, phase=1.1 - 15.0 * 2 * np.pi)
    n = len(log.time)
    x, force = (filtered(channel)[n : 2 * n] for channel in (long.displacement, long.force))
    return replace(log, displacement=x, force=force)


# What a rig does to each channel, and what is declared and done.
FILTERS = {
    "ours, zero-phase": (lambda s: s, ConditionOptions()),
    "ours, causal": (lambda s: s, ConditionOptions(filter="causal")),
    "none": (lambda s: s, ConditionOptions(filter="none")),
    "rig, causal": (lambda s: sosfilt(RIG, s), ConditionOptions(rig_filter="causal")),
    "rig, zero-phase": (
        lambda s: sosfiltfilt(RIG, s, padlen=900),
        ConditionOptions(rig_filter="zero_phase"),
    ),
}


@pytest.mark.parametrize("case", FILTERS)
def test_the_true_damper_fits_behind_every_filter(case):
    filtered, options = FILTERS[case]
    log = in_the_rig(filtered)
    trace = condition(log, options)
    assert misfit(trace) < 1e-8
    assert fitted_law(trace) == pytest.approx(LAW, rel=2e-6)
    assert trace.n_cycles >= 12
    if case == "rig, causal":  # which equals our own, and ruins the fit where it is not declared
        ours = condition(sine_log(), ConditionOptions(filter="causal"))
        expected = ours.force[ours.compared]
        np.testing.assert_allclose(trace.force[trace.compared], expected, rtol=0.0, atol=1e-5)
        assert np.array_equal(ours.model_filter.sections, trace.model_filter.sections)
        assert misfit(condition(log)) > 1e-3
    if case == "rig, zero-phase":  # left alone
        at = round(trace.start_time * 1000.0)
        assert np.array_equal(trace.force, log.force[at : at + len(trace.force)])


def test_an_analogue_filter_meets_what_happens_between_the_samples(tmp_path):
    """The jumps of friction of a fast test, as the paper's model has them behind 60 Hz."""
    test = SampleOptions(
        settings=(10,), amplitude=0.008, frequency=9.9, rig_filter=60.0,
        force_noise=0.0, displacement_noise=0.0,
    )  # fmt: skip
    log = read_log(make_samples(tmp_path, test)[0])
    off = {}
    for kind in ("analogue", "causal"):
        trace = condition(log, ConditionOptions(rig_filter=kind, rig_filter_corner=60.0))
        seen = compare(reference_parameters(10), trace, PURDY_DAMPER)
        off[kind] = float(np.std((seen.force - trace.force)[trace.compared]))
        assert trace.describe()["sample_rate_Hz"] == pytest.approx(500.0)
        assert trace.drive.corner == pytest.approx(30.0)  # noise beyond turns no friction
    assert 3.0 * off["analogue"] < off["causal"]


@given(
    frequency=st.floats(0.5, 8.0),
    rate=st.sampled_from([250.0, 300.0, 500.0, 1000.0, 2000.0, 5000.0]),
    phase=st.floats(0.0, 2 * np.pi),
    cycles=st.floats(12.0, 20.0),
)
@settings(deadline=None, max_examples=10)
def test_sines_of_any_phase_frequency_and_rate(frequency, rate, phase, cycles):
    log = sine_log(frequency=frequency, rate=rate, phase=phase, cycles=cycles)
    log = replace(log, force=np.gradient(log.displacement, log.time) * 1500.0)
    trace = condition(log)
    assert trace.frequency == pytest.approx(frequency, rel=1e-6)
    assert trace.amplitude == pytest.approx(0.032, rel=1e-4)
    assert trace.centre == pytest.approx(0.0123, abs=1e-6)
    assert abs(trace.n_cycles_found - cycles) < 1.02
    # whole cycles, and as many as run-in and edges leave
    assert trace.n_samples == pytest.approx(trace.n_cycles * rate / frequency, abs=1.0)
    lost = 2 * 0.26 * frequency + 1.0 + 2.0  # edges, run-in, alignment
    assert cycles - lost - 0.1 <= trace.n_cycles <= cycles - 1.0
    x, v = (
        np.interp(trace.fastest.cycle_starts, np.arange(len(trace.force)), channel)
        for channel in (trace.displacement, trace.velocity)
    )
    assert np.abs(x).max() < 1e-3 * 0.032
    assert (v > 0).all()


LOG = sine_log()
NOISE = np.random.default_rng(7).normal(size=len(LOG.time))
LONG = {"frequency": 29.0, "amplitude": 0.002, "cycles": 90.0, "rate": 500.0}
# The log, the options, and what the refusal says; None: it is taken.
BAD = {
    "constant displacement": (replace(LOG, displacement=0.0 * LOG.time + 0.01), {}, "is constant"),
    "constant force": (replace(LOG, force=0.0 * LOG.time), {}, "the force is constant"),
    "only noise": (replace(LOG, displacement=8e-6 * NOISE), {}, "found 0 whole steady cycles"),
    "a walk": (replace(LOG, displacement=1e-4 * np.cumsum(NOISE)), {}, "whole steady cycles"),
    "two cycles": (sine_log(cycles=2.5), {}, r"found 2 whole .* at least 3 \(2 s\)"),
    "a dozen samples": (sine_log(rate=50.0, cycles=0.4), {}, "13 samples"),
    "rate below the filter": (sine_log(rate=50.0), {}, r"30 Hz .*\(25 Hz"),
    "mm read as m": (sine_log(amplitude=32.0), {}, "32 m, .* mm read as m"),
    "nearly so": (sine_log(amplitude=0.99, frequency=0.2, rate=100.0), {}, None),
    "a little more": (sine_log(amplitude=1.01, frequency=0.2, rate=100.0), {}, "mm read as m"),
    "m read as mm": (sine_log(amplitude=1.9e-4), {}, "was m read as mm"),
    "hardly": (sine_log(amplitude=2.1e-4), {}, None),
    "allowed": (sine_log(amplitude=3.2e-5), {"min_amplitude": 0.0}, None),
    "kN read twice": (replace(LOG, force=1e3 * LOG.force), {}, "N, expected .* N read as kN"),
    "force as allowed": (LOG, {"max_force": 800.0}, None),
    "force beyond": (LOG, {"max_force": 700.0}, "was N read as kN"),
    "beyond chamber 1": (
        sine_log(amplitude=0.14),
        {"chamber_lengths": (0.013, 0.2)},
        r"x reaches 0\.14 m, expected below l_1 \(l_1 = 0\.013 m, l_2 = 0\.2 m.*right unit",
    ),
    "beyond chamber 2": (
        sine_log(),
        {"chamber_lengths": (0.133, 0.133), "centre": 0.12},
        r"x reaches -0\.139\d m, expected above -l_2",
    ),
    "within both": (LOG, {"chamber_lengths": (0.033, 0.033)}, None),
    "just beyond 1": (LOG, {"chamber_lengths": (0.031, 0.033)}, "stroke beyond the chamber"),
    "just beyond 2": (LOG, {"chamber_lengths": (0.033, 0.031)}, "stroke beyond the chamber"),
    "as fast as the filter lets": (sine_log(**LONG), {}, None),
    "faster": (sine_log(**{**LONG, "frequency": 31.0}), {}, "not below the filter"),
    "reversed force": (replace(LOG, force=-LOG.force), {}, "delivers 7.* J per cycle .* reversed"),
}

# Options that a caller in Python gives, and the refusal: nothing stands in for them in silence.
WRONG = {
    "filter": ("zerophase", "filter: .* Did you mean 'zero_phase'"),
    "rig_filter": ("butter", "rig_filter: expected 'none' or 'causal' or 'zero_phase'"),
    "filter_order": (0, "filter_order: expected 1 or more, found 0"),
    "rig_filter_corner": (-3.0, "rig_filter_corner: expected more than 0, found -3"),
    "skew": (0.2, "skew: expected at most 0.1, found 0.2"),
    "centre": (float("nan"), "centre: .*finite number, found nan"),
    "spikes": ("drop", "spikes: expected 'keep' or 'bridge'"),
    "min_amplitude": (2.0, "min_amplitude: found 2 m, expected less than max_amplitude"),
}


@pytest.mark.parametrize("name", WRONG)
def test_wrong_options_are_refused(name):
    value, message = WRONG[name]
    with pytest.raises(ConfigurationError, match=message):
        ConditionOptions(**{name: value})


@pytest.mark.parametrize("case", BAD)
def test_bad_logs_are_refused_in_one_line(case):
    log, options, message = BAD[case]
    if message is None:
        assert condition(log, ConditionOptions(**options)).n_cycles
        return
    with pytest.raises(ConditioningError, match=message) as caught:
        condition(log, ConditionOptions(**options))
    assert str(caught.value).startswith("log.csv: ")
    assert "\n" not in str(caught.value)
