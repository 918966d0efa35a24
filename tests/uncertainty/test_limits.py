"""Every limit of a verdict with a case just inside and one just outside, from synthetic data."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.stats import f as fisher

from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.identification import Sharing
from damperfit.uncertainty import (
    Prediction,
    assessment,
)
from damperfit.uncertainty.flaws import seek_flaws
from damperfit.uncertainty.linearisation import Linearisation, LogLinearisation
from damperfit.uncertainty.residuals import (
    StretchResiduals,
    diagnose,
    independent_phases,
    is_beyond_chance,
    split_power,
)
from tests import fakes
from tests.uncertainty.test_status import known

OMEGA = 2.0 * np.pi * 1.5


def even(trace, k: int) -> np.ndarray:
    """A harmonic that no flaw has much of, of mean square one."""
    turns = OMEGA * trace.interval * np.arange(len(trace.force))[trace.compared]
    return np.sqrt(2.0) * np.cos(k * turns)


def linearised(residuals, *, gas=None, trace=None, names=("setting_01.csv",)) -> Linearisation:
    """One setting whose fit could absorb the 12th harmonic alone."""
    trace = trace or fakes.trace(1)
    fit = fakes.fit(1, status={"r_m3": "shared"}, logs=names)
    fit = replace(fit, logs=(fit.logs[0]._replace(trace=trace),))
    n = len(residuals)
    jacobian = np.zeros((n, 6))
    jacobian[:, 0] = even(trace, 12)
    force = trace.force[trace.compared]
    gas = np.zeros((n, 2)) if gas is None else np.column_stack([gas, np.zeros(n)])
    untouched = ((trace.velocity[trace.compared], np.zeros(n)),)
    log = LogLinearisation(residuals, np.ones(n), jacobian, gas, force, np.ones(3), untouched)
    nothing = np.zeros((6, 6))
    return Linearisation(
        fit,
        nothing,
        nothing,
        nothing,
        np.zeros(6),
        (log,),
        PURDY_DAMPER.conditions,
        flaws=PURDY_DAMPER.flaws,
    )


def named(residuals, **more) -> list[str]:
    repeats = float(np.mean(residuals**2))
    return [hint.name for hint in seek_flaws(linearised(residuals, **more), repeats)[0]]


@pytest.mark.parametrize(("share", "is_named"), [(0.48, False), (0.52, True)])
def test_a_flaw_is_named_that_explains_half_of_what_repeats(share: float, *, is_named) -> None:
    trace = fakes.trace(1)
    rest = even(trace, 14)
    residuals = math.sqrt(share) + math.sqrt(1.0 - share) * (rest - rest.mean())
    assert named(residuals) == (["offset"] if is_named else [])


@pytest.mark.parametrize(("share", "is_tied"), [(0.83, False), (0.87, True)])
def test_a_second_flaw_is_named_that_explains_nearly_as_much(share: float, *, is_tied) -> None:
    rest = even(fakes.trace(1), 14)
    gas = math.sqrt(share) + math.sqrt(1.0 - share) * (rest - rest.mean())
    found = named(np.full(len(rest), 0.3), gas=gas)  # a gas 30 % off
    assert found == (["offset", "gas_pressure"] if is_tied else ["offset"])


def folded(rng, span: int = 1, *, cycles: int = 200, phases: int = 400) -> np.ndarray:
    noise = rng.standard_normal(cycles * phases + span - 1)
    return np.convolve(noise, np.ones(span), "valid").reshape(cycles, phases)


@pytest.mark.parametrize(("span", "expected"), [(1, 400.0), (5, 117.6)])
def test_correlated_phases_count_by_the_sum_of_squared_correlations(span, expected) -> None:
    # 400 phases; a moving mean of five: 1 + 2 (0.64 + 0.36 + 0.16 + 0.04) = 3.4.
    found = independent_phases(folded(np.random.default_rng(3), span))
    assert found == pytest.approx(expected, rel=0.05)


@pytest.mark.parametrize(("span", "quiet"), [(4, 1.0), (1, 0.2)])
def test_the_mean_square_of_a_mean_cycle_scatters_as_that_many_squares_do(span, quiet) -> None:
    """By draws: n independent squares have the relative variance 2/n."""
    rng = np.random.default_rng(5)
    shape = np.r_[np.full(200, 1.0), np.full(200, quiet)]
    powers, told = [], []
    for _ in range(1000):
        noise = folded(rng, span, cycles=12) * shape
        powers.append(np.mean(noise.mean(axis=0) ** 2))
        told.append(independent_phases(noise))
    drawn = 2.0 / (np.std(powers) / np.mean(powers)) ** 2
    # Few cycles make the correlation of noise look larger than it is: 133 for 158.
    assert np.median(told) == pytest.approx(drawn, rel=0.2)


def repeating(size: float, *, noise: float, cycles: int = 10, seed: int = 1) -> Linearisation:
    """Residuals of white noise with a 14th harmonic of this root mean square in every cycle."""
    base = fakes.trace(1)
    n, period = 333 * cycles + 1, 333.0
    v = 0.3 * np.cos(2.0 * np.pi * np.arange(n) / period)
    stretch = replace(
        base.fastest,
        first=0,
        stop=n - 1,
        cycle_starts=period * np.arange(cycles + 1.0),
        frequency=1.0 / (period * base.interval),
    )
    trace = replace(
        base, displacement=0.032 * np.sin(2.0 * np.pi * np.arange(n) / period), velocity=v,
        force=2500.0 * v, stretches=(stretch,), n_cycles_found=cycles,
    )  # fmt: skip
    rng = np.random.default_rng(seed)
    wave = np.sqrt(2.0) * np.cos(14.0 * 2.0 * np.pi * np.arange(n - 1) / period)
    return linearised(size * wave + noise * rng.standard_normal(n - 1), trace=trace)


@pytest.mark.parametrize(("size", "is_structured"), [(0.17, False), (0.25, True)])
def test_what_repeats_is_a_misfit_where_chance_has_it_once_in_a_million(size, *, is_structured):
    # 333 phases of 10 cycles: F is 1.42 in one case of a million, so 0.42/10 of the noise repeats:
    # a root mean square of 0.205 of the noise.
    found = [diagnose(repeating(size, noise=1.0, seed=seed))[0].is_structured for seed in range(8)]
    assert found == [is_structured] * 8


@pytest.mark.parametrize(("share", "is_structured"), [(0.95e-7, False), (1.05e-7, True)])
def test_a_misfit_of_less_than_the_integrator_makes_is_none(share, *, is_structured) -> None:
    variance = 0.5 * (2500.0 * 0.3) ** 2
    found, _ = diagnose(repeating(math.sqrt(share * variance), noise=1e-4))
    assert found.is_structured is is_structured


def prediction(ratio: float, **more) -> Prediction:
    plain = Prediction(3, fakes.trace(3), False, 0.2 * ratio, 0.1, 0.15, 0.2)
    return replace(plain, **more)


@pytest.mark.parametrize(
    ("ratio", "verdict"),
    [
        (1.96, "predicted as well as fitted"),
        (2.04, "worse than fitted: 2 times the expected MSE"),
        (9.8, "worse than fitted: 9.8 times the expected MSE"),
        (10.4, "not predicted: 10 times the expected MSE"),
        (108.0, "not predicted: 110 times the expected MSE"),
    ],
)
def test_a_prediction_is_worse_from_twice_and_none_from_ten_times(ratio, verdict) -> None:
    one = prediction(ratio)
    assert one.verdict == verdict
    assert one.is_failed is (ratio > 2.0)
    assert one.describe()["verdict"] == verdict


@pytest.mark.parametrize("cycles", [1, 2])
def test_noise_is_told_from_a_misfit_from_two_cycles_on(cycles: int) -> None:
    found, _ = diagnose(repeating(0.0, noise=1.0, cycles=cycles))
    is_reported = cycles == 2
    assert math.isfinite(found.noise_percent) is is_reported
    assert math.isfinite(found.runs_ratio) is is_reported
    single = f"MSE {found.mse_percent:.2g} %; a single cycle cannot separate noise from lack of fit"
    assert (found.sentence == single) is not is_reported
    assert ("% is noise" in found.sentence) is is_reported


@pytest.mark.parametrize(
    ("spread", "words"),
    [((20.0, 80.0), "f_f is shared by all settings and here too low"), ((50.0, 50.0), None)],
)
def test_a_common_friction_is_in_doubt_where_the_settings_own_differ(
    monkeypatch, spread, words
) -> None:
    """A misfit in the shape of the friction's own slope, at a setting that holds the common one."""
    quiet = repeating(2.0, noise=0.1)
    (log,) = quiet.logs
    jacobian = log.jacobian.copy()
    jacobian[:, PURDY_DAMPER.names.index("f_f")] = repeating(1.0, noise=0.0).logs[0].residuals
    told = replace(quiet, logs=(log._replace(jacobian=jacobian),))
    monkeypatch.setattr(assessment, "linearise_settings", lambda *_, **__: (told,))
    sharing = Sharing(means={"f_f": (1, 2)}, spread=spread)
    monkeypatch.setattr(assessment, "uncertainties", lambda *_, **__: (known(),))
    campaign = fakes.campaign(told.fit, sharing=sharing)
    (found,) = assessment.assess(campaign, PURDY_DAMPER).diagnoses
    assert found.is_structured
    assert [hint.words for hint in found.hints] == ([] if words is None else [words])


def part(residuals: np.ndarray, n_cycles: int, noise: float = 1.0) -> StretchResiduals:
    """Residuals of a stretch, laid over itself where it has cycles."""
    stretch: Any = SimpleNamespace(n_cycles=n_cycles, noise=noise)
    if not n_cycles:
        return StretchResiduals(stretch, 1e-3, residuals)
    folded = residuals.reshape(n_cycles, -1)
    return StretchResiduals(stretch, 1e-3, residuals, folded, folded - folded.mean(axis=0))


@pytest.mark.parametrize(("share", "repeats"), [(1.002, True), (0.998, False)])
def test_what_noise_has_once_in_a_million_repeats(share: float, *, repeats: bool) -> None:
    parts = [part(np.random.default_rng(4).standard_normal(1500), 15)]
    phases = independent_phases(parts[0].about)
    bar = fisher.ppf(1.0 - 1e-6, phases, 14.0 * phases)
    assert is_beyond_chance(parts, share * bar) is repeats


@pytest.mark.parametrize(("power", "is_more"), [(3.9, False), (4.1, True)])
def test_where_nothing_repeats_four_times_the_noise_is_more_than_noise(
    power: float, *, is_more: bool
) -> None:
    residuals = math.sqrt(power) * np.array([1.0, -1.0] * 50)
    repeats, noise, is_beyond = split_power([part(residuals, 0)])
    assert (repeats, noise) == pytest.approx((power - 1.0, 1.0))
    assert is_beyond() is is_more
