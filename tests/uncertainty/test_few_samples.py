"""Errors of a log of few independent samples are as large as its fits scatter."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from damperfit.conditioning import apply_filter
from damperfit.conditioning.filters import design_filter
from damperfit.recording import FilterDesign
from damperfit.uncertainty import few_samples
from damperfit.uncertainty.correlated_noise import (
    autocorrelation,
    correlation_length,
    score_covariance,
)
from damperfit.uncertainty.few_samples import ENOUGH, ShortStretch, filter_correlation, widening

RATE, CORNER = 1024.0, 30.0


def slopes_of(n, frequency):
    """Five slopes such as a damper's: the motion's harmonics in both phases."""
    phase = 2.0 * np.pi * frequency * np.arange(n) / RATE
    return np.stack([np.cos(phase), np.sin(phase), np.cos(2 * phase), np.sin(3 * phase),
                     np.sign(np.cos(phase)) * np.cos(phase) ** 2], axis=1)  # fmt: skip


def held(n, frequency, *, draws=200, is_widened=True):
    """Share of 95 % intervals that hold the truth, and scatter over the errors given."""
    design = design_filter("zero_phase", CORNER, sample_rate=RATE, order=4)
    random = np.random.default_rng(4)
    slopes = slopes_of(n, frequency)
    inverse = np.linalg.inv(slopes.T @ slopes)
    correlation = filter_correlation(design, n)
    hits, off, errors = [], [], []
    for _ in range(draws):
        noise = apply_filter(design, random.standard_normal(n + 600))[300:-300]
        found = inverse @ (slopes.T @ noise)
        left = noise - slopes @ found
        lag = correlation_length(left, longest=round(0.25 * RATE / frequency))
        covariance = inverse @ score_covariance(slopes * left[:, None], lag) @ inverse
        if is_widened:
            covariance *= widening([ShortStretch(slopes, correlation, lag)])
        error = np.sqrt(np.diag(covariance))
        hits.append(np.abs(found) <= 1.96 * error)
        off.append(found)
        errors.append(error)
    ratio = np.sqrt(np.mean(np.square(off), axis=0) / np.mean(np.square(errors), axis=0))
    return float(np.mean(hits)), ratio


@pytest.mark.parametrize(("n", "frequency"), [(439, 7.0), (307, 10.0)])
def test_three_cycles_hold_95_of_100(n, frequency):
    share, ratio = held(n, frequency)
    assert 0.925 <= share <= 0.98
    assert np.all(ratio < 1.1)


def test_without_the_factor_too_few_hold():
    share, ratio = held(439, 7.0, is_widened=False)
    assert share < 0.91
    assert np.mean(ratio) > 1.1


def test_the_correlation_is_that_of_filtered_noise():
    design = design_filter("zero_phase", CORNER, sample_rate=RATE, order=4)
    noise = apply_filter(design, np.random.default_rng(1).standard_normal(400_000))
    rho = filter_correlation(design, 60)
    for lag in (0, 5, 12, 30):
        found = float(noise[: 400_000 - lag] @ noise[lag:] / (noise @ noise))
        assert rho[lag] == pytest.approx(found, abs=0.02)


def test_what_the_window_finds_is_what_it_is_expected_to_find():
    """The low-rank sums are those of the whole matrices."""
    n, lag = 200, 9
    slopes = slopes_of(n, 10.0)
    design = design_filter("zero_phase", CORNER, sample_rate=RATE, order=4)
    rho = filter_correlation(design, n)
    apart = np.abs(np.subtract.outer(np.arange(n), np.arange(n)))
    window = np.clip(2.0 - apart / lag, 0.0, 1.0)
    inverse = np.linalg.inv(slopes.T @ slopes)
    projector = np.eye(n) - slopes @ inverse @ slopes.T
    lags = np.clip(2.0 - np.arange(2 * lag + 1) / lag, 0.0, 1.0)
    expected = slopes.T @ (window * (projector @ rho[apart] @ projector)) @ slopes
    expected /= 1.0 - (2.0 * lags.sum() - 1.0) / n
    true = slopes.T @ rho[apart] @ slopes
    ratio = np.mean(np.diag(inverse @ true @ inverse) / np.diag(inverse @ expected @ inverse))
    from scipy.stats import norm, t

    freedom = n / (2.0 * (lags**2).sum() - 1.0)
    student = t.ppf(0.975, freedom) / norm.ppf(0.975)
    found = widening([ShortStretch(slopes, rho, lag)])
    assert found == pytest.approx(ratio * student**2, rel=1e-6)
    # Two stretches alike are a log twice as long: less is missed.
    assert 1.0 < widening([ShortStretch(slopes, rho, lag)] * 2) < found


@pytest.mark.parametrize(("share", "is_wider"), [(0.99, True), (1.01, False)])
def test_a_log_of_many_samples_keeps_its_errors(share, is_wider):
    slopes = slopes_of(4000, 5.0)[:, :2]
    # White noise: as many independent samples as there are.
    n = round(share * ENOUGH * 2)
    one = ShortStretch(slopes[:n], np.eye(1, n)[0], 0)
    assert (widening([one]) > 1.0) is is_wider


def test_a_fit_of_nothing_has_nothing_to_widen():
    assert widening([]) == 1.0
    assert widening([ShortStretch(np.zeros((50, 0)), np.eye(1, 50)[0], 0)]) == 1.0


@pytest.mark.parametrize("kind", ["zero_phase", "causal", "none"])
@pytest.mark.parametrize("n", [700, 1024, 1025])
def test_the_correlation_is_that_of_white_noise_behind_the_filter(kind: str, n: int) -> None:
    design = design_filter(kind, CORNER, sample_rate=RATE, order=4)
    impulse = np.zeros(2 * n + 1)
    impulse[n] = 1.0
    own = autocorrelation(apply_filter(design, impulse), n - 1)
    found = filter_correlation(design, n)
    assert found.shape == (n,)
    assert found == pytest.approx(own, abs=1e-9)


def test_logs_of_one_filter_share_its_correlation(monkeypatch: pytest.MonkeyPatch) -> None:
    """Lengths are rounded up: fifteen cycles are not as many samples in every log."""
    asked: list[float] = []

    def counted(design: FilterDesign, signal: np.ndarray) -> np.ndarray:
        asked.append(len(signal))
        return apply_filter(design, signal)

    monkeypatch.setattr(few_samples, "apply_filter", counted)
    designs = [
        design_filter("zero_phase", c, sample_rate=RATE, order=4) for c in (31.7, 31.7, 45.3)
    ]
    for design in designs[:2]:
        for n in (9001, 9013, 9100):
            filter_correlation(design, n)
    assert len(asked) == 1
    filter_correlation(designs[2], 9001)
    filter_correlation(replace(designs[0], is_zero_phase=False), 9001)
    filter_correlation(designs[0], 9300)
    assert len(asked) == 4
