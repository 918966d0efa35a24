"""Intervals hold: exact where the answer is known, by Monte Carlo where it is not."""

import math

import numpy as np
import pytest

from damperfit.conditioning import apply_filter, design_filter
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.identification import FitOptions, identify
from damperfit.uncertainty import linearise_settings, uncertainties
from damperfit.uncertainty.covariance import (
    autocorrelation,
    correlation_length,
    independent_samples,
    larger,
    score_covariance,
    stationary_covariance,
    widening,
)
from tests.identification.rig import short_trace
from tests.uncertainty.coverage import MadeUpCampaign, run, summary
from tests.uncertainty.motion_coverage import NAMES, covered, quickly_covered

FREE = ("r_m1", "r_m2", "k_e")
KNOWN = {"r_m3": 2.597e6, "f_f": 50.0}


def smooth_noise(rng, n, span):
    return np.convolve(rng.standard_normal(n + span - 1), np.ones(span), "valid")


def test_white_residuals_have_no_correlation_length_and_the_textbook_sum() -> None:
    r = np.random.default_rng(5).standard_normal(4000)
    assert correlation_length(r, longest=100) == 0
    scores = r[:, None] * np.array([[1.0, -2.0]])
    expected = scores.T @ scores / (1.0 - 1.0 / 4000)
    assert score_covariance(scores, 0) == pytest.approx(expected, rel=1e-5)
    slopes = np.random.default_rng(23).standard_normal((4000, 3))
    expected = float(r @ r) / 4000 * slopes.T @ slopes
    assert stationary_covariance(slopes, r, 0) == pytest.approx(expected, rel=1e-9)


def test_the_correlation_length_is_found_and_a_repeating_misfit_is_cut_off() -> None:
    rng = np.random.default_rng(7)
    found = [correlation_length(smooth_noise(rng, 6000, 20), longest=200) for _ in range(40)]
    # The triangle of a moving mean of 20 ends at lag 19; its last lags drown in noise.
    assert 15 <= np.median(found) <= 22
    cycle = np.sin(2 * np.pi * np.arange(6000) / 500)
    assert correlation_length(cycle, longest=125) == 125


@pytest.mark.parametrize("span", [1, 12])
def test_the_variance_of_a_sum_is_not_biased(span) -> None:
    # The sum of n moving means of unit noise has the variance n span^2, but for its ends.
    rng, n = np.random.default_rng(11), 3000
    shape = 1.0 + 0.5 * np.sin(2 * np.pi * np.arange(n) / 300)
    found, sums = [], []
    for _ in range(300):
        scores = (smooth_noise(rng, n, span) * shape)[:, None]
        lag = correlation_length(scores[:, 0], longest=100)
        found.append(score_covariance(scores - scores.mean(), lag)[0, 0])
        sums.append(float(scores.sum()))
    assert np.mean(found) == pytest.approx(n * 1.125 * span**2, rel=0.04)
    assert np.mean(found) == pytest.approx(np.var(sums), rel=0.3)


@pytest.mark.parametrize("span", [1, 12])
def test_a_few_samples_that_tell_a_parameter_do_not_make_its_error_too_small(span) -> None:
    rng, n = np.random.default_rng(19), 2000
    slopes = np.ones((n, 2))
    slopes[:, 1] = 0.01
    slopes[[300, 310, 1400], 1] = 5.0  # three samples tell the second parameter
    inverse = np.linalg.inv(slopes.T @ slopes)
    off, of_scores, of_both = [], [], []
    for _ in range(400):
        noise = smooth_noise(rng, n, span)
        off.append(inverse @ (slopes.T @ noise))
        left = noise - slopes @ off[-1]
        lag = correlation_length(left, longest=100)
        own = score_covariance(slopes * left[:, None], lag)
        both = larger(own, stationary_covariance(slopes, left, lag))
        of_scores.append(np.sqrt(np.diag(inverse @ own @ inverse)))
        of_both.append(np.sqrt(np.diag(inverse @ both @ inverse)))
    held = np.mean(np.abs(off) <= 1.96 * np.array(of_both), axis=0)
    assert np.all((held > 0.92) & (held < 0.985))
    assert np.mean(np.abs(off) <= 1.96 * np.array(of_scores), axis=0)[1] < 0.8


def test_the_larger_of_two_covariances_is_that_in_every_direction() -> None:
    rng = np.random.default_rng(29)
    one, other = (a @ a.T for a in rng.standard_normal((2, 4, 6)))
    found = larger(one, other)
    for each in (one, other):
        assert np.linalg.eigvalsh(found - each).min() > -1e-9
        assert np.linalg.matrix_rank(found - each, tol=1e-6) < 4
    assert found == pytest.approx(larger(other, one))
    for times in (0.1, 3.0):
        assert larger(one, times * one) == pytest.approx(max(times, 1.0) * one)
    nothing = np.diag([1.0, 4.0, 0.0])
    assert larger(nothing, np.diag([2.0, 3.0, 0.0])) == pytest.approx(np.diag([2.0, 4.0, 0.0]))


def test_autocorrelation_is_that_of_the_definition() -> None:
    r = np.random.default_rng(3).standard_normal(200)
    expected = [r[: 200 - k] @ r[k:] / (r @ r) for k in range(6)]
    assert autocorrelation(r, 5) == pytest.approx(expected, abs=1e-12)
    assert autocorrelation(np.zeros(9), 2).tolist() == [1.0, 0.0, 0.0]


@pytest.mark.parametrize(("n", "frequency"), [(439, 7.0), (307, 10.0)])
def test_intervals_of_three_cycles_hold_95_of_100(n, frequency) -> None:
    """Noise behind a filter, and five slopes such as a damper's; without the factor too few."""
    rate, random = 1024.0, np.random.default_rng(4)
    design = design_filter("zero_phase", 30.0, sample_rate=rate, order=4)
    phase = 2.0 * np.pi * frequency * np.arange(n) / rate
    bent = np.abs(np.cos(phase)) * np.cos(phase)
    waves = np.cos(phase), np.sin(phase), np.cos(2 * phase), np.sin(3 * phase), bent
    slopes = np.stack(waves, axis=1)
    inverse, worth = np.linalg.inv(slopes.T @ slopes), independent_samples(design, n)
    off, errors, factors = [], [], []
    for _ in range(200):
        noise = apply_filter(design, random.standard_normal(n + 600))[300:-300]
        off.append(inverse @ (slopes.T @ noise))
        left = noise - slopes @ off[-1]
        lag = correlation_length(left, longest=round(0.25 * rate / frequency))
        covariance = inverse @ score_covariance(slopes * left[:, None], lag) @ inverse
        errors.append(np.sqrt(np.diag(covariance)))
        factors.append(np.sqrt(widening([(n, worth, lag)], 5)))
    sizes = np.abs(off) / np.array(errors)
    assert 0.925 <= np.mean(sizes <= 1.96 * np.array(factors)[:, None]) <= 0.98
    assert np.mean(sizes <= 1.96) < 0.91


@pytest.mark.parametrize(("worth", "is_wider"), [(97, True), (103, False)])
def test_fifty_independent_samples_a_parameter_are_enough(worth, is_wider) -> None:
    assert (widening([(4000, worth, 1)], 2) > 1.0) is is_wider
    assert widening([(4000, worth, 1)], 0) == 1.0


# Of fits


def test_errors_of_white_residuals_are_those_of_the_textbook() -> None:
    log = short_trace(8, noise=4.0, duration=10.0)
    campaign = identify([log], PURDY_DAMPER, FitOptions("plain", FREE, KNOWN))
    linearised = linearise_settings(campaign, PURDY_DAMPER)
    places = [PURDY_DAMPER.names.index(name) for name in FREE]
    jacobian = linearised[0].logs[0].jacobian[:, places]
    noise = 4.0 * np.random.default_rng(17).standard_normal((len(jacobian), 400))
    values = np.linalg.lstsq(jacobian, noise, rcond=None)[0]
    textbook = 4.0 * np.sqrt(np.diag(np.linalg.inv(jacobian.T @ jacobian)))
    assert np.std(values, axis=1) == pytest.approx(textbook, rel=0.12)
    # Behind the filter the honest error is more than twice what the textbook makes of it.
    found = uncertainties(linearised, campaign.sharing)[0].intervals
    naive = float(np.std(linearised[0].logs[0].residuals)) / 4.0 * textbook
    for name, small in zip(FREE, naive, strict=True):
        assert found[name].error / getattr(campaign.fits[0].parameters, name) > 2.0 * small


@pytest.mark.parametrize(
    ("made_up", "n"),
    [
        (MadeUpCampaign(), 30),
        pytest.param(MadeUpCampaign(), 100, marks=pytest.mark.slow),
        pytest.param(MadeUpCampaign(is_white=True), 100, marks=pytest.mark.slow),
    ],
)
def test_intervals_cover_the_truth_through_the_whole_procedure(made_up, n) -> None:
    # Campaigns of three settings; 1000 by hand: python -m tests.uncertainty.coverage.
    held, width, bias = summary(run(made_up, n))
    # Three standard deviations of a binomial at 95 %, and of the scatter's own estimate.
    assert held.min() > 0.95 - 3 * math.sqrt(0.95 * 0.05 / n)
    assert 0.93 <= held[:, :3].mean() <= 0.98
    assert np.abs(width - 1.0).max() < 3 / math.sqrt(2 * n)
    assert np.abs(bias).max() < 3 / math.sqrt(n)


def test_intervals_hold_on_a_road_that_cavitates() -> None:
    """Neither a refilling that one sample happens to see nor few residuals make an error too small.

    With the slopes and scores as they were 39 intervals of R_m3 held, and 219 of the 250. With 400
    campaigns 382 to 391 hold; 322 of R_m3 where all that a sample sees of a refilling counts.
    """
    hits, ratio, bias = quickly_covered(50)
    assert np.all(hits >= 43), dict(zip(NAMES, hits, strict=True))
    assert 0.92 <= hits.sum() / (50 * len(NAMES)) <= 0.985
    assert np.all(ratio > 0.85)
    assert np.all(np.abs(bias) < 0.001)


@pytest.mark.slow
@pytest.mark.parametrize(
    "motion", ["steps", "sweep", "road", "rough road", "rounded triangles", "two triangles"]
)
def test_intervals_of_other_motions_cover_90_to_98_of_100(motion) -> None:
    # The parameters of a campaign err together: 50 campaigns are 50 draws and no 250. Of the
    # first 50 of the rounded triangles 44 hold, of 400 (as of 1000) 92 to 95 of 100.
    n = 400 if motion == "rounded triangles" else 50
    hits, ratio, bias = covered(motion, n, jobs=2)
    # 45 to 49 of 50, and what chance makes of that: fewer than 41 come once in a thousand.
    assert np.all(hits >= (0.9 if n > 50 else 0.82) * n), dict(zip(NAMES, hits, strict=True))
    assert 0.90 <= hits.sum() / (n * len(NAMES)) <= 0.99
    assert np.all(ratio > 0.7)
    # A speed that jumps between two samples is in no log: K_e is 0.35 % low, without noise too.
    limits = np.where(np.equal(NAMES, "k_e") & (motion == "two triangles"), 0.005, 0.001)
    assert np.all(np.abs(bias) < limits), dict(zip(NAMES, bias, strict=True))
