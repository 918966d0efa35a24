"""Differentiation: exact on cubics, stated gain error on sines, stated noise gain."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from damperfit.conditioning import apply_filter, design_filter, differentiate
from tests.oracles.filtering import measured_gain_and_phase

numbers = st.floats(-10.0, 10.0)


@given(st.lists(numbers, min_size=4, max_size=4), st.integers(4, 60), st.floats(1e-4, 1.0))
def test_cubics_are_exact(coefficients, n, interval):
    cubic = np.polynomial.Polynomial(coefficients)
    t = np.arange(n) * interval
    scale = np.abs(cubic(t)).max() / interval + 1e-300
    assert np.abs(differentiate(cubic(t), interval) - cubic.deriv()(t)).max() <= 1e-12 * scale


def test_quartics_are_not():
    t = np.arange(20.0)
    assert np.abs(differentiate(t**4, 1.0) - 4 * t**3).max() > 0.1


@pytest.mark.parametrize(
    ("rate", "frequency", "loss"),
    [(1000.0, 1.5, 4.4e-11), (1000.0, 10.0, 8.7e-8), (100.0, 1.5, 4.4e-7), (100.0, 10.0, 9.1e-4)],
)
def test_sines_lose_what_the_text_says(rate, frequency, loss):
    omega = 2 * np.pi * frequency
    t = np.arange(round(4 * rate)) / rate
    slope = differentiate(np.sin(omega * t), 1.0 / rate)
    gain, phase = measured_gain_and_phase(
        slope, frequency=frequency, sample_rate=rate, window=slice(60, -60)
    )
    assert 1.0 - gain / omega == pytest.approx(loss, rel=0.02, abs=2e-12)
    assert phase == pytest.approx(90.0, abs=1e-8)


def test_noise_is_amplified_as_the_text_says():
    noise = np.random.default_rng(5).normal(size=400_000)
    assert np.std(differentiate(noise, 1e-3)) == pytest.approx(1180.0, rel=0.01)
    quiet = apply_filter(design_filter("zero_phase", 30.0, sample_rate=1000.0), noise)
    assert np.std(quiet) == pytest.approx(0.245, rel=0.02)
    assert np.std(differentiate(quiet, 1e-3)) == pytest.approx(28.0, rel=0.02)
