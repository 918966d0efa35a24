"""The lag of the force channel against its exact answers and its derivative by differences."""

from __future__ import annotations

import numpy as np
import pytest

from damperfit.damper.load_cell import behind_lag, lag_slope

INTERVAL = 1e-3


def ramp(n=400):
    """A force that stands, climbs, and stands: pieces of straight lines, as the lag takes them."""
    return np.interp(np.arange(n), [0, 100, 200, n], [-30.0, -30.0, 470.0, 470.0])


@pytest.mark.parametrize("lag", [2e-4, 8e-3, 5e-2])
def test_a_ramp_comes_late_by_the_lag_and_is_met_exactly(lag):
    t = np.arange(100) * INTERVAL
    exact = -30.0 + 5e3 * (t - lag * (1.0 - np.exp(-t / lag)))
    np.testing.assert_allclose(
        behind_lag(ramp()[None], INTERVAL, lag)[0, 100:200], exact, rtol=1e-12
    )


def test_a_sine_is_late_and_lower_as_first_order_is():
    t, lag, omega = np.arange(4000) * 1e-4, 8e-3, 2 * np.pi * 5
    read = behind_lag(np.sin(omega * t)[None], 1e-4, lag)[0]
    gain = 1 / np.hypot(1, omega * lag)
    exact = gain * np.sin(omega * t - np.arctan(omega * lag))
    np.testing.assert_allclose(read[2000:], exact[2000:], atol=2e-6)


@pytest.mark.parametrize("lag", [3e-6, 2e-4, 8e-3, 5e-2])
def test_the_slope_by_the_lag_is_that_of_differences(lag):
    force = ramp() + 20 * np.sin(np.arange(400) / 7.0)
    step = 1e-5 * lag
    high, low = (behind_lag(force[None], INTERVAL, lag + d)[0] for d in (step, -step))
    slope = lag_slope(force, INTERVAL, lag)
    np.testing.assert_allclose(slope, (high - low) / (2 * step), atol=2e-6 * np.max(np.abs(slope)))


@pytest.mark.parametrize("rows", [1, 3, 4, 5, 9])
def test_each_of_some_signals_is_what_a_general_filter_makes_of_it(rows):
    from scipy.signal import lfilter

    force = np.random.default_rng(rows).normal(size=(rows, 50))
    q = INTERVAL / 8e-3
    a, mean = np.exp(-q), -np.expm1(-q) / q
    start = mean * force[:, :1]  # at rest before the first sample
    slow = lfilter([1 - mean, mean - a], [1.0, -a], force, axis=1, zi=start)[0]
    np.testing.assert_allclose(behind_lag(force, INTERVAL, 8e-3), slow, rtol=1e-12, atol=1e-14)
