"""Filters, slopes and values between samples; the corner that follows the motion."""

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline
from scipy.signal import butter, sosfilt, sosfilt_zi, sosfiltfilt

from damperfit.compiled_core import compiled_core
from damperfit.conditioning import (
    apply_filter,
    condition,
    design_filter,
    differentiate,
)
from damperfit.conditioning.filters import (
    complete_causal,
    completed,
    fading_samples,
)
from damperfit.errors import ConditioningError

seeds = st.integers(0, 2**31)


def noise(seed, n=400):
    return np.random.default_rng(seed).normal(size=n)


@given(seed=seeds)
def test_the_reversed_pass_completes_a_causal_one_to_zero_phase(seed):
    sections = butter(4, 30.0, fs=1000.0, output="sos")
    signal = noise(seed, 3000)
    design = design_filter("causal", 30.0, sample_rate=1000.0)
    found = complete_causal(design, sosfilt(sections, signal))
    expected = sosfiltfilt(sections, signal, padlen=2000)
    np.testing.assert_allclose(found[500:-500], expected[500:-500], rtol=0.0, atol=1e-8)


def test_no_filter_passes_everything_and_copies():
    signal = noise(3)
    passed = apply_filter(design_filter("none", 30.0, sample_rate=10.0), signal)
    assert np.array_equal(passed, signal)
    assert not np.shares_memory(passed, signal)


@pytest.mark.parametrize(
    ("rate", "offered"), [(50.0, "20Hz"), (500.0, "200Hz"), (4096.0, "1600Hz")]
)
def test_a_corner_beyond_half_the_sample_rate_is_refused_with_one_that_is_taken(rate, offered):
    refusal = rf"{0.5 * rate:g} Hz .*conditioning.filter_corner = '{offered}', which"
    with pytest.raises(ConditioningError, match=refusal):
        design_filter("zero_phase", 0.5 * rate, sample_rate=rate)
    for corner in (float(offered.removesuffix("Hz")), 0.49 * rate):
        assert design_filter("zero_phase", corner, sample_rate=rate).is_zero_phase


# The compiled filters, slopes and interpolation beside SciPy's, their slow twins.

RANDOM = np.random.default_rng(7)


@pytest.mark.parametrize("order", [1, 2, 3, 4, 5, 8])
@pytest.mark.parametrize("corner", [2.0, 30.0, 240.0])
def test_a_design_passes_what_scipys_passes(order: int, corner: float) -> None:
    ours = design_filter("causal", corner, sample_rate=500.0, order=order).sections
    theirs = butter(order, corner, fs=500.0, output="sos")
    assert ours.shape == theirs.shape
    z = np.exp(-1j * np.linspace(0.0, 0.99 * np.pi, 300))[:, None] ** np.arange(3)
    passed = [np.prod((z @ one[:, :3].T) / (z @ one[:, 3:].T), axis=1) for one in (ours, theirs)]
    assert np.allclose(*passed, rtol=1e-9, atol=1e-13)


@pytest.mark.parametrize("order", [1, 4, 8])
@pytest.mark.parametrize("shape", [(5,), (400,), (2, 3, 50)])
def test_one_pass_is_scipys(order: int, shape: tuple[int, ...]) -> None:
    design = design_filter("causal", 30.0, sample_rate=500.0, order=order)
    signal = 100.0 + RANDOM.standard_normal(shape)
    steady = sosfilt_zi(design.sections).reshape(-1, *(1,) * (len(shape) - 1), 2)
    expected = sosfilt(design.sections, signal, zi=steady * signal[..., :1])[0]
    assert np.allclose(apply_filter(design, signal), expected, rtol=0.0, atol=1e-10)


@pytest.mark.parametrize("shape", [(2,), (400,), (3, 400)])
@pytest.mark.parametrize("order", [1, 3, 4])
def test_both_passes_are_scipys(order: int, shape: tuple[int, ...]) -> None:
    design = completed(design_filter("causal", 30.0, sample_rate=500.0, order=order), 30.0, order)
    signal = 100.0 + RANDOM.standard_normal(shape)
    pad = min(fading_samples(design), shape[-1] - 1)
    expected = sosfiltfilt(design.sections, signal, padlen=pad)
    found = apply_filter(design, signal)
    assert np.allclose(found, expected, rtol=0.0, atol=1e-9)
    assert not np.shares_memory(found, signal)


@pytest.mark.parametrize("n", [4, 5, 6, 50, 3000])
def test_slopes_are_those_of_scipys_spline(n: int) -> None:
    y = np.cumsum(RANDOM.standard_normal(n))
    expected = CubicSpline(np.arange(n), y)(np.arange(n), 1) / 0.002
    assert np.allclose(differentiate(y, 0.002), expected, rtol=0.0, atol=1e-9 / 0.002)


def test_values_between_samples_are_those_of_a_polynomial() -> None:
    grid = np.arange(12.0)
    at = np.array([0.0, 0.3, 3.5, 7.25, 10.9, 11.0])
    powers = np.stack([(grid / 6.0 - 1.0) ** k for k in range(8)])
    found = np.empty((8, len(at)))
    compiled_core().between(powers, at, found, 8)
    assert np.allclose(found, [(at / 6.0 - 1.0) ** k for k in range(8)], rtol=0.0, atol=1e-12)


# Differentiation: exact on cubics, stated gain error on sines, stated noise gain.


# A corner that follows the motion, and refusals that offer the one that fits.


def offered(log, options):
    with pytest.raises(ConditioningError) as refusal:
        condition(log, options)
    key, corner = re.search(r"set ([a-z_.]+) = '([0-9.]+)Hz'", str(refusal.value)).groups()
    return key, float(corner)
