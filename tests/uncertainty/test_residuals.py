"""What the residuals say, each limit with a case just inside and one just outside."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import f as fisher

from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.identification import Sharing
from damperfit.uncertainty import assessment
from damperfit.uncertainty.covariance import Linearisation, LogLinearisation
from damperfit.uncertainty.residuals import (
    SegmentResiduals,
    diagnose,
    independent_phases,
    residual_scatter,
    seek_flaws,
    split_power,
)
from tests import fakes
from tests.uncertainty.test_verdicts import known


def even(trace, k):
    """A harmonic that no flaw has much of, of mean square one."""
    turns = 3.0 * np.pi * trace.interval * np.arange(len(trace.force))[trace.compared]
    return np.sqrt(2.0) * np.cos(k * turns)


def linearised(residuals, *, gas=None, trace=None) -> Linearisation:
    """One setting whose fit could absorb the 12th harmonic alone."""
    trace = trace or fakes.trace(1)
    fit = fakes.fit(1, status={"r_m3": "shared"})
    fit = replace(fit, logs=(fit.logs[0]._replace(trace=trace),))
    n = len(residuals)
    jacobian = np.zeros((n, 6))
    jacobian[:, 0] = even(trace, 12)
    gas = np.column_stack([np.zeros(n) if gas is None else gas, np.zeros(n)])
    rounding = ((trace.velocity[trace.compared], np.zeros(n)),)
    force, nothing = trace.force[trace.compared], np.zeros((6, 6))
    log = LogLinearisation(residuals, np.ones(n), jacobian, gas, force, rounding)
    model = PURDY_DAMPER
    of_model = {"conditions": model.conditions, "flaws": model.flaws}
    return Linearisation(fit, nothing, nothing, np.zeros(6), (log,), **of_model)


def named(residuals, **more):
    hints, _ = seek_flaws(linearised(residuals, **more), float(np.mean(residuals**2)))
    return [hint.name for hint in hints]


def partly(share):
    """An offset that is a share of what repeats."""
    rest = even(fakes.trace(1), 14)
    return math.sqrt(share) + math.sqrt(1.0 - share) * (rest - rest.mean())


@pytest.mark.parametrize(("share", "found"), [(0.48, []), (0.52, ["offset"])])
def test_a_flaw_is_named_that_explains_half_of_what_repeats(share, found) -> None:
    assert named(partly(share)) == found


@pytest.mark.parametrize(("share", "others"), [(0.83, []), (0.87, ["gas_pressure"])])
def test_a_second_flaw_is_named_that_explains_nearly_as_much(share, others) -> None:
    gas = partly(share)  # 30 % off
    assert named(np.full(len(gas), 0.3), gas=gas) == ["offset", *others]


def folded(rng, span=1, *, cycles=200, phases=400):
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


def repeating(size, *, noise, cycles=10, seed=1) -> Linearisation:
    """Residuals of white noise with a 14th harmonic of this root mean square in every cycle."""
    base, period = fakes.trace(1), 333.0
    n = 333 * cycles + 1
    angle = 2.0 * np.pi * np.arange(n) / period
    v = 0.3 * np.cos(angle)
    segment = replace(
        base.fastest,
        first=0,
        stop=n - 1,
        cycle_starts=period * np.arange(cycles + 1.0),
        frequency=1.0 / (period * base.interval),
    )
    trace = replace(
        base, displacement=0.032 * np.sin(angle), velocity=v,
        force=2500.0 * v, segments=(segment,), n_cycles_found=cycles,
    )  # fmt: skip
    wave = np.sqrt(2.0) * np.cos(14.0 * angle[:-1])
    scatter = noise * np.random.default_rng(seed).standard_normal(n - 1)
    return linearised(size * wave + scatter, trace=trace)


@pytest.mark.parametrize(("size", "is_structured"), [(0.17, False), (0.25, True)])
def test_what_repeats_is_a_misfit_where_chance_has_it_once_in_a_million(size, *, is_structured):
    # 333 phases of 10 cycles: F is 1.42 in one case of a million, so 0.42/10 of the noise repeats:
    # a root mean square of 0.205 of the noise.
    found = [diagnose(repeating(size, noise=1.0, seed=seed))[0] for seed in range(8)]
    assert {one.is_structured for one in found} == {is_structured}


@pytest.mark.parametrize(("share", "is_structured"), [(0.95e-7, False), (1.05e-7, True)])
def test_a_misfit_of_less_than_the_integrator_makes_is_none(share, *, is_structured) -> None:
    variance = 0.5 * (2500.0 * 0.3) ** 2
    found, _ = diagnose(repeating(math.sqrt(share * variance), noise=1e-4))
    assert found.is_structured is is_structured


@pytest.mark.parametrize("cycles", [1, 2])
def test_noise_is_told_from_a_misfit_from_two_cycles_on(cycles) -> None:
    found, _ = diagnose(repeating(0.0, noise=1.0, cycles=cycles))
    is_told = cycles == 2
    assert math.isfinite(found.noise_percent) is is_told
    assert (
        "a single cycle cannot separate noise from lack of fit" in found.sentence
    ) is not is_told
    assert ("% is noise" in found.sentence) is is_told


@pytest.mark.parametrize(
    ("spread", "words"),
    [((20.0, 80.0), ["f_f is shared by all settings and here too low"]), ((50.0, 50.0), [])],
)
def test_a_common_friction_is_in_doubt_where_the_settings_own_differ(monkeypatch, spread, words):
    """A misfit in the shape of the friction's own slope, at a setting that holds the common one."""
    quiet = repeating(2.0, noise=0.1)
    jacobian = quiet.logs[0].jacobian.copy()
    wave = repeating(1.0, noise=0.0).logs[0].residuals
    jacobian[:, PURDY_DAMPER.names.index("f_f")] = wave
    told = replace(quiet, logs=(quiet.logs[0]._replace(jacobian=jacobian),))
    monkeypatch.setattr(assessment, "linearise_settings", lambda *_, **__: (told,))
    monkeypatch.setattr(assessment, "uncertainties", lambda *_, **__: (known(),))
    sharing = Sharing(means={"f_f": (1, 2)}, spread=spread)
    (found,) = assessment.assess(fakes.campaign(told.fit, sharing=sharing), PURDY_DAMPER).diagnoses
    assert found.is_structured
    assert [hint.words for hint in found.hints] == words


def test_what_noise_has_once_in_a_million_repeats() -> None:
    noise = np.random.default_rng(4).standard_normal((15, 100))
    about = noise - noise.mean(axis=0)
    phases = independent_phases(about)
    bar = fisher.ppf(1.0 - 1e-6, phases, 14.0 * phases) * np.sum(about**2) / (14.0 * noise.size)
    for factor, is_more in ((1.002, True), (0.998, False)):
        folded = about + math.sqrt(factor * bar)
        part = SegmentResiduals(SimpleNamespace(n_cycles=15), 1e-3, folded.ravel(), folded, about)
        assert bool(split_power([part])[2]()) is is_more


@pytest.mark.parametrize(("power", "is_more"), [(3.9, False), (4.1, True)])
def test_where_nothing_repeats_four_times_the_noise_is_more_than_noise(power, *, is_more) -> None:
    residuals = math.sqrt(power) * np.array([1.0, -1.0] * 50)
    part = SegmentResiduals(SimpleNamespace(n_cycles=0, noise=1.0), 1e-3, residuals)
    repeats, noise, is_beyond = split_power([part])
    assert (repeats, noise) == pytest.approx((power - 1.0, 1.0))
    assert is_beyond() is is_more


def test_two_cycles_are_enough_to_scatter_and_one_is_not() -> None:
    one = fakes.trace(1).fastest
    two = replace(one, first=0, stop=666, cycle_starts=np.array([0.0, 333.0, 666.0]))
    residuals = np.repeat([1.0, -1.0], 333)
    assert residual_scatter(residuals, two) == pytest.approx(2.0)
    assert math.isnan(residual_scatter(residuals[:333], one))
