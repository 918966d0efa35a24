"""The compiled filters, slopes and interpolation beside SciPy's, their slow twins."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.signal import butter, sosfiltfilt

from damperfit.compiled_core import compiled_core
from damperfit.conditioning import apply_filter, design_filter
from damperfit.conditioning.filters import completed, differentiate, fading_samples

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


@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("run_filter", (np.ones(7), np.ones(2), np.ones(9), np.ones(9), np.ones(9), 1, 0, 0)),
        ("run_filter", (np.ones(6), np.ones(3), np.ones(9), np.ones(9), np.ones(9), 1, 0, 0)),
        ("run_filter", (np.ones(6), np.ones(2), np.ones(9), np.ones(8), np.ones(9), 1, 0, 0)),
        ("run_filter", (np.ones(6), np.ones(2), np.ones(9), np.ones(9), np.ones(9), 2, 0, 0)),
        ("run_filter", (np.ones(6), np.ones(2), np.ones(9), np.ones(9), np.ones(9), 0, 0, 0)),
        ("run_filter", (np.ones(6), np.ones(2), np.ones(9), np.ones(9), np.ones(9), 1, 9, 0)),
        ("run_filter", (np.ones(6), np.ones(2), np.ones(9), np.ones(9), np.ones(9), 1, 1, 0)),
        ("run_filter", (np.ones(198), np.ones(66), np.ones(9), np.ones(9), np.ones(9), 1, 0, 1)),
        ("behind_lag", (np.ones(5), np.ones(5), 2, 0.5, 0.3, 0.2)),
        ("behind_lag", (np.ones(6), np.ones(5), 2, 0.5, 0.3, 0.2)),
        ("behind_lag", (np.ones(6), np.ones(6), -2, 0.5, 0.3, 0.2)),
        ("lag_slope", (np.ones(5), np.ones(4), np.ones(5), 0.5, 0.1, 0.1)),
        ("lag_slope", (np.ones(5), np.ones(5), np.ones(4), 0.5, 0.1, 0.1)),
        ("spline_slopes", (np.ones(3), np.ones(3), np.ones(3))),
        ("spline_slopes", (np.ones(5), np.ones(4), np.ones(5))),
        ("spline_slopes", (np.ones(5), np.ones(5), np.ones(4))),
        ("between", (np.ones(7), np.ones(2), np.ones(2), 1)),
        ("between", (np.ones(16), np.ones(2), np.ones(2), 2)),
        ("between", (np.ones(17), np.ones(2), np.ones(4), 2)),
    ],
)
def test_buffers_of_another_size_are_refused(name: str, arguments: tuple[object, ...]) -> None:
    with pytest.raises(ValueError, match=name):
        getattr(compiled_core(), name)(*arguments)
