"""One fit over all settings: the minimum of one big least squares, in a few steps."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import least_squares

from damperfit.conditioning import condition
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.identification import Campaign, FitOptions, Outcome, compare, identify
from damperfit.identification import joint as joint_procedure
from damperfit.identification.joint import JointSolution, fit_jointly
from damperfit.io import read_log
from damperfit.tested.setting import Setting
from damperfit.uncertainty import assess, linearise_settings
from damperfit.uncertainty.covariance import shared_covariance, shared_curvature
from tests.identification.rig import trace, traces

SAMPLES = Path(__file__).parents[2] / "sample_runs"
OWN = ("r_m1", "r_m2", "k_e")
SHARED = ("r_m3", "f_f")


@pytest.mark.parametrize(
    ("settings", "share"),
    [((1, 8, 20), 0.9), pytest.param(tuple(range(1, 21)), 0.6, marks=pytest.mark.slow)],
)
def test_the_sample_runs_give_what_is_shared_at_the_cost_of_a_few_steps(settings, share) -> None:
    logs = [condition(read_log(SAMPLES / f"setting_{one:02d}.csv")) for one in settings]
    joint = identify(logs, PURDY_DAMPER, FitOptions("joint"))
    assert len(joint.fits) == len(settings)
    assert joint.warnings == ()
    first = joint.fits[0].parameters
    assert first.r_m3 == pytest.approx(2.597e6, rel=3e-3)
    assert first.f_f == pytest.approx(50.0, rel=1e-2)
    for fit in joint.fits:
        assert fit.outcome is Outcome.CONVERGED
        assert (fit.parameters.r_m3, fit.parameters.f_f) == (first.r_m3, first.f_f)
        assert fit.status["r_m3"] == fit.status["f_f"] == "shared"
        assert fit.parameters.r_m1 == pytest.approx(
            reference_parameters(fit.setting).r_m1, rel=1.5e-3
        )
    paper = identify(logs, PURDY_DAMPER)
    spent = [sum(fit.evaluations for fit in one.fits) for one in (paper, joint)]
    assert spent[1] - spent[0] < 10 * len(settings)  # what the paper's needed alone, once
    # One setting alone cannot know R_m3 as well as all of them together.
    errors = [
        assess(one, PURDY_DAMPER).uncertainties[0].intervals["r_m3"].error for one in (paper, joint)
    ]
    assert errors[1] < share * errors[0]


def test_it_is_the_minimum_of_one_big_least_squares() -> None:
    logs = traces([2, 9, 17], noise=4.0, duration=4.0)
    options = FitOptions("joint")
    fits = identify(logs, PURDY_DAMPER, options).fits
    separate = identify(logs, PURDY_DAMPER).fits
    rms = [
        np.sqrt(fit.mse_percent / 100.0) * np.std(log.force[log.compared])
        for fit, log in zip(separate, logs, strict=True)
    ]

    def residuals(u: np.ndarray) -> np.ndarray:
        parts = []
        for k, log in enumerate(logs):
            values = np.exp([*u[3 * k : 3 * k + 3], *u[9:]])
            named = dict(zip((*OWN, *SHARED), values, strict=True))
            y = replace(fits[k].parameters, **named)
            force = compare(y, log, PURDY_DAMPER, solver=options.solver).force
            parts.append((force - log.force)[log.compared] / rms[k])
        return np.concatenate(parts)

    start = [np.log(getattr(reference_parameters(s), name)) for s in (2, 9, 17) for name in OWN] + [
        np.log(2.597e6),
        np.log(50.0),
    ]
    big = least_squares(residuals, start, diff_step=1e-4, x_scale=1e-3, xtol=1e-12, ftol=1e-12)
    found = [np.log(getattr(fit.parameters, name)) for fit in fits for name in OWN]
    found += [np.log(getattr(fits[0].parameters, name)) for name in SHARED]
    # Differences of 1e-4 leave the big one that far from the minimum, in units of its errors.
    covariance = np.linalg.inv(big.jac.T @ big.jac)
    assert np.abs((np.array(found) - big.x) / np.sqrt(np.diag(covariance))).max() < 0.05
    assert np.sum(residuals(np.array(found)) ** 2) <= 2 * big.cost * (1 + 1e-6)


def test_what_is_shared_is_an_option() -> None:
    logs = traces([3, 12], noise=4.0, duration=5.0)
    options = FitOptions("joint", share=("f_f",), fixed={"r_m3": 2.597e6})
    fits = identify(logs, PURDY_DAMPER, options).fits
    assert fits[0].parameters.f_f == fits[1].parameters.f_f
    assert fits[0].status["r_m3"] == "fixed"
    assert fits[0].status["f_f"] == "shared"
    everything = FitOptions("joint", share=("r_m3", "f_f", "f_0"))
    tared = [
        trace(s, replace(reference_parameters(s), f_0=118.0), noise=4.0, duration=5.0)
        for s in (3, 12)
    ]
    found = identify(tared, PURDY_DAMPER, everything).fits
    assert found[0].parameters.f_0 == found[1].parameters.f_0 == pytest.approx(118.0, abs=0.5)


def test_what_is_not_shared_is_the_settings_own() -> None:
    # Friction used to be held at the mean, "fixed", and R_m3 had half its error.
    frictions = {1: 30.0, 8: 50.0, 14: 70.0}
    logs = [
        trace(setting, replace(reference_parameters(setting), f_f=f_f), noise=4.0)
        for setting, f_f in frictions.items()
    ]
    campaign = identify(logs, PURDY_DAMPER, FitOptions("joint", share=("r_m3",)))
    for fit in campaign.fits:
        assert fit.status["r_m3"] == "shared"
        assert fit.status["f_f"] == "fitted"
        assert fit.parameters.f_f == pytest.approx(frictions[fit.setting], rel=0.02)


@pytest.fixture(scope="module")
def three() -> Campaign:
    logs = traces([1, 10, 20], noise=4.0, duration=5.0)
    return identify(logs, PURDY_DAMPER, FitOptions("joint"))


def test_rough_errors_of_the_joint_fit_are_those_of_the_judging(monkeypatch) -> None:
    """They say which shared parameter the logs do not tell; a third of them would tell all."""
    solutions = []

    def kept(*arguments):
        solutions.append(fit_jointly(*arguments))
        return solutions[-1]

    monkeypatch.setattr(joint_procedure, "fit_jointly", kept)
    campaign = identify(traces([1, 20], noise=4.0, duration=5.0), PURDY_DAMPER, FitOptions("joint"))
    (solution,) = solutions
    judged = assess(campaign, PURDY_DAMPER).uncertainties[0].intervals
    for name in SHARED:
        relative = judged[name].error / getattr(campaign.fits[0].parameters, name)
        # By sign changes and by the autocorrelation: alike within a third.
        assert solution.errors[name] == pytest.approx(relative, rel=0.4)


def test_a_setting_outside_of_the_joint_fit_lends_it_no_weight(three) -> None:
    linearised = linearise_settings(three, PURDY_DAMPER)
    sharing = replace(three.sharing, settings=(1, 20))
    whole = shared_covariance(linearised, sharing)
    without = shared_covariance([linearised[0], linearised[2]], sharing)
    assert whole == pytest.approx(without, rel=1e-9)
    # It would have had some.
    assert not np.allclose(shared_covariance(linearised, three.sharing), without, rtol=0.1)
    curvature = shared_curvature(linearised, sharing)
    assert curvature == pytest.approx(shared_curvature([linearised[0], linearised[2]], sharing))


@pytest.mark.parametrize(("shift", "n_fits"), [(1.49, 0), (1.51, 1), (10.0, 1)])
def test_a_joint_fit_is_weighed_by_what_its_end_leaves(monkeypatch, shift, n_fits) -> None:
    """A weight of a bad start drew a damper's drag to twice what it was, as a wrong valley would.

    Of settings whose weights shift by less than half beside each other nothing moves.
    """
    first = JointSolution(
        parameters={},
        evaluations=4,
        is_converged=True,
        cost=1.0,
        weights={Setting.of(1): 1.0, Setting.of(2): 1.0 / shift},
        mean_squares={Setting.of(1): 1.0, Setting.of(2): 1.0},
        n_independent={},
        errors={},
    )
    settled = {Setting.of(1): 1.0, Setting.of(2): 1.0}
    asked = []

    def fit(problem, starts):
        asked.append(problem)
        return first._replace(weights=settled, evaluations=3)

    monkeypatch.setattr(joint_procedure, "fit_jointly", fit)
    ended = joint_procedure._fairly_weighed("problem", first)
    assert asked == ["problem"] * n_fits
    assert ended.evaluations == 4 + 3 * n_fits
    assert joint_procedure._is_fairly_weighed(ended)
