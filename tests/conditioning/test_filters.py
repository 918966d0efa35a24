"""Filters: gain, phase, delay, edges, against difference equations and SciPy."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import butter, sosfilt, sosfiltfilt

from damperfit.conditioning import apply_filter, design_filter
from damperfit.conditioning.filters import (
    complete_causal,
    completed,
    gain_at,
    settling_samples,
)
from damperfit.errors import ConditioningError
from tests.oracles import filtering

rates = st.floats(100.0, 5000.0)
orders = st.integers(1, 6)
seeds = st.integers(0, 2**31)


def noise(seed, n=400):
    return np.random.default_rng(seed).normal(size=n)


@given(rate=rates, order=orders, share=st.floats(0.05, 0.8))
def test_either_filter_has_3_db_at_its_corner(rate, order, share):
    corner = share * rate / 2.0
    for kind in ("zero_phase", "causal"):
        design = design_filter(kind, corner, sample_rate=rate, order=order)
        assert gain_at(design, corner, sample_rate=rate) == pytest.approx(0.5**0.5, rel=1e-6)


@given(rate=rates, order=orders, share=st.floats(0.01, 0.95))
def test_the_gain_is_the_formula_and_forward_backward_doubles_the_order(rate, order, share):
    frequency = share * rate / 2.0
    one = filtering.butterworth_gain(frequency, corner=30.0, sample_rate=rate, order=order)
    causal = design_filter("causal", 30.0, sample_rate=rate, order=order)
    assert gain_at(causal, frequency, sample_rate=rate) == pytest.approx(one, rel=1e-6, abs=1e-12)
    both = gain_at(completed(causal, 30.0, order), frequency, sample_rate=rate)
    assert both == pytest.approx(one**2, rel=1e-6, abs=1e-12)


def test_the_causal_filter_is_13_704_ms_late_at_500_samples_per_second():
    design = design_filter("causal", 30.0, sample_rate=500.0)
    sine = np.sin(2 * np.pi * 1.5 * np.arange(5000) / 500.0)
    gain, phase = filtering.measured_gain_and_phase(
        apply_filter(design, sine), frequency=1.5, sample_rate=500.0, window=slice(1000, 4000)
    )
    assert gain == pytest.approx(1.0, abs=1e-6)
    assert phase == pytest.approx(-7.40, abs=0.005)
    assert -phase / 360.0 / 1.5 == pytest.approx(13.704e-3, abs=1e-6)


@pytest.mark.parametrize("frequency", [1.5, 5.0, 10.0, 30.0, 45.0])
def test_the_zero_phase_filter_shifts_nothing(frequency):
    design = design_filter("zero_phase", 30.0, sample_rate=1000.0)
    sine = np.sin(2 * np.pi * frequency * np.arange(4000) / 1000.0)
    gain, phase = filtering.measured_gain_and_phase(
        apply_filter(design, sine), frequency=frequency, sample_rate=1000.0, window=slice(500, 3500)
    )
    assert phase == pytest.approx(0.0, abs=1e-6)
    assert gain == pytest.approx(gain_at(design, frequency, sample_rate=1000.0), rel=1e-7)
    if frequency == 1.5:
        assert gain == pytest.approx(1.0, abs=1e-9)


@given(seed=seeds)
def test_zero_phase_commutes_with_reversed_time_away_from_the_ends(seed):
    design = design_filter("zero_phase", 30.0, sample_rate=1000.0)
    edge = settling_samples(design)
    signal = noise(seed, 2 * edge + 300)
    middle = slice(edge, -edge)
    there = apply_filter(design, signal)[middle]
    back = apply_filter(design, signal[::-1])[::-1][middle]
    assert there == pytest.approx(back, abs=1e-7)


@given(seed=seeds, rate=st.sampled_from([300.0, 1000.0, 5000.0]))
def test_an_end_of_the_log_is_forgotten_after_the_settling_time(seed, rate):
    design = design_filter("zero_phase", 30.0, sample_rate=rate)
    edge = settling_samples(design)
    signal = noise(seed, 4 * edge)
    whole = apply_filter(design, signal)[2 * edge : 3 * edge]
    cut = apply_filter(design, signal[edge:])[edge : 2 * edge]
    assert np.abs(whole - cut).max() < 1e-6 * np.abs(signal).max()


@given(seed=seeds)
def test_the_reversed_pass_completes_a_causal_one_to_zero_phase(seed):
    sections = butter(4, 30.0, fs=1000.0, output="sos")
    signal = noise(seed, 3000)
    design = design_filter("causal", 30.0, sample_rate=1000.0)
    found = complete_causal(design, sosfilt(sections, signal))
    expected = sosfiltfilt(sections, signal, padlen=2000)
    assert found[500:-500] == pytest.approx(expected[500:-500], abs=1e-8)


def test_no_filter_passes_everything_and_copies():
    design = design_filter("none", 30.0, sample_rate=10.0)
    signal = noise(3)
    found = apply_filter(design, signal)
    assert np.array_equal(found, signal)
    assert not np.shares_memory(found, signal)


def test_a_corner_beyond_half_the_sample_rate_is_refused_with_both_numbers():
    for rate in (50.0, 60.0):
        with pytest.raises(ConditioningError, match=rf"30 Hz .*{rate / 2:g} Hz"):
            design_filter("zero_phase", 30.0, sample_rate=rate)
    design_filter("zero_phase", 30.0, sample_rate=61.0)


@pytest.mark.parametrize(
    ("rate", "offered"), [(50.0, "20Hz"), (500.0, "200Hz"), (4096.0, "1600Hz")]
)
def test_a_corner_that_is_offered_is_one_that_is_taken(rate, offered):
    """200 Hz was written 2e+02Hz."""
    with pytest.raises(
        ConditioningError, match=rf"conditioning.filter_corner = '{offered}', which"
    ):
        design_filter("zero_phase", 0.5 * rate, sample_rate=rate)
    corner = float(offered.removesuffix("Hz"))
    assert design_filter("zero_phase", corner, sample_rate=rate).is_zero_phase
