"""One fit over all settings: the minimum of one big least squares; K_e from one gas content."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares

from damperfit.damper.purdy.parameters import (
    PURDY_DAMPER,
    Parameters,
    modulus_at_pressure,
    reference_parameters,
)
from damperfit.identification import Campaign, FitOptions, Outcome, compare, identify, joint
from damperfit.identification.fit_problem import Block, FitProblem, _Stacked
from damperfit.identification.joint import working_pressure
from damperfit.identification.sharing import GasLaw
from damperfit.simulation import SolverOptions
from damperfit.tested.setting import Setting
from damperfit.uncertainty import assess, linearise_settings, uncertainties
from damperfit.uncertainty.covariance import shared_covariance, shared_curvature
from damperfit.workers import InTurn
from tests.identification.rig import short_trace, trace, traces

OWN, SHARED = ("r_m1", "r_m2", "k_e"), ("r_m3", "f_f")


def test_it_is_the_minimum_of_one_big_least_squares() -> None:
    logs, settings = traces([2, 9, 17], noise=4.0, duration=4.0), (2, 9, 17)
    options = FitOptions("joint", share=SHARED)
    fits = identify(logs, PURDY_DAMPER, options).fits
    rms = [
        np.sqrt(fit.mse_percent / 100.0) * np.std(log.force[log.compared])
        for fit, log in zip(identify(logs, PURDY_DAMPER).fits, logs, strict=True)
    ]

    def residuals(u: np.ndarray) -> np.ndarray:
        parts = []
        for k, log in enumerate(logs):
            values = np.exp([*u[3 * k : 3 * k + 3], *u[9:]])
            y = fits[k].parameters.replace(dict(zip((*OWN, *SHARED), values, strict=True)))
            force = compare(y, log, PURDY_DAMPER, solver=options.solver).force
            parts.append((force - log.force)[log.compared] / rms[k])
        return np.concatenate(parts)

    truths = [reference_parameters(s) for s in settings]
    start = np.log([*(getattr(y, name) for y in truths for name in OWN), 2.597e6, 50.0])
    big = least_squares(residuals, start, diff_step=1e-4, x_scale=1e-3, xtol=1e-12, ftol=1e-12)
    found = [getattr(fit.parameters, name) for fit in fits for name in OWN]
    found = np.log([*found, *(getattr(fits[0].parameters, name) for name in SHARED)])
    # Differences of 1e-4 leave the big one that far from the minimum, in units of its errors.
    covariance = np.linalg.inv(big.jac.T @ big.jac)
    assert np.abs((found - big.x) / np.sqrt(np.diag(covariance))).max() < 0.05
    assert np.sum(residuals(found) ** 2) <= 2 * big.cost * (1 + 1e-6)


@pytest.mark.parametrize("beyond", [0, 1])
def test_beyond_the_bound_of_one_setting_a_candidate_still_moves_at_the_others(beyond) -> None:
    """The bounds of the last setting were taken for those of all."""
    logs = {Setting.of(s): short_trace(s) for s in (3, 15)}
    free = ("r_m1", "r_m2")
    blocks = {
        s: Block(PURDY_DAMPER, (one,), free, SolverOptions(), is_candidate=True)
        for s, one in logs.items()
    }
    follows = {"r_m1": next(iter(logs)).adjusters}
    problem = FitProblem(blocks, free, follows, weights=dict.fromkeys(logs, 1.0))
    stacked = _Stacked(problem, {s: reference_parameters(3) for s in logs}, InTurn())
    at = stacked.start.copy()
    at[beyond] = np.log(PURDY_DAMPER.quantity("r_m1").plausible[1]) + 1.0
    steps = 1e-6 * np.eye(len(at))
    costs = [[stacked.point_at(at + sign * one)[0].cost for sign in (1, -1)] for one in steps]
    slopes = -np.diff(costs)[:, 0] / 2e-6
    found = 2.0 * stacked.point_at(at)[0].gradient
    assert found == pytest.approx(slopes, rel=0.05, abs=1e-4 * np.max(np.abs(slopes)))


def test_what_is_shared_is_an_option() -> None:
    logs = traces([3, 12], noise=4.0, duration=5.0)
    options = FitOptions("joint", share=("f_f",), fixed={"r_m3": 2.597e6})
    fits = identify(logs, PURDY_DAMPER, options).fits
    assert fits[0].parameters.f_f == fits[1].parameters.f_f
    assert (fits[0].status["r_m3"], fits[0].status["f_f"]) == ("fixed", "shared")
    tared = [replace(reference_parameters(s), f_0=118.0) for s in (3, 12)]
    logs = [trace(s, y, noise=4.0, duration=5.0) for s, y in zip((3, 12), tared, strict=True)]
    found = identify(logs, PURDY_DAMPER, FitOptions("joint", share=(*SHARED, "f_0"))).fits
    assert found[0].parameters.f_0 == found[1].parameters.f_0 == pytest.approx(118.0, abs=0.5)


def test_a_setting_outside_of_the_joint_fit_lends_it_no_weight() -> None:
    logs = traces([1, 10, 20], noise=4.0, duration=5.0)
    three = identify(logs, PURDY_DAMPER, FitOptions("joint"))
    linearised = linearise_settings(three, PURDY_DAMPER)
    sharing = replace(three.sharing, settings=(1, 20))
    whole = shared_covariance(linearised, sharing)
    without = shared_covariance([linearised[0], linearised[2]], sharing)
    assert whole == pytest.approx(without, rel=1e-9)
    # It would have had some.
    assert not np.allclose(shared_covariance(linearised, three.sharing), without, rtol=0.1)
    curvature = shared_curvature(linearised, sharing)
    assert curvature == pytest.approx(shared_curvature([linearised[0], linearised[2]], sharing))


# K_e of all settings from one gas content: recovered where it holds, said where it does not.

VOLUME_RATIO, STIFFNESS = 0.004, 1.5e9 / 1.1
GASSY = FitOptions("joint", bulk_modulus="appendix1")
SETTINGS = (1, 8, 14, 20)


def gassy(setting: int) -> Parameters:
    """The reference set with K_e of eq. (28), at the working pressure it then has."""
    truth = reference_parameters(setting)
    for _ in range(4):
        log = trace(setting, truth, duration=4.0)
        pressure = working_pressure(Block(PURDY_DAMPER, (log,), (), GASSY.solver), truth)
        k_e = modulus_at_pressure(pressure, volume_ratio=VOLUME_RATIO, compliance=1.1)
        truth = replace(truth, k_e=float(k_e))
    return truth


@pytest.fixture(scope="module")
def truths() -> dict[int, Parameters]:
    return {setting: gassy(setting) for setting in SETTINGS}


@pytest.fixture(scope="module")
def campaign(truths) -> Campaign:
    logs = [trace(s, truth, noise=4.0, duration=10.0) for s, truth in truths.items()]
    return identify(logs, PURDY_DAMPER, GASSY, jobs=2)


def test_the_gas_content_comes_back_within_its_interval(campaign, truths) -> None:
    assert campaign.warnings == ()
    judged = assess(campaign, PURDY_DAMPER)
    gas = judged.gas
    for value, truth, interval in (
        (gas.volume_ratio, VOLUME_RATIO, gas.volume_ratio_interval),
        (gas.stiffness, STIFFNESS, gas.stiffness_interval),
    ):
        assert value == pytest.approx(truth, rel=3e-3)
        assert interval.low < truth < interval.high < 1.02 * interval.low
    assert 1.0 < max(gas.pressures.values()) / min(gas.pressures.values()) < 10.0
    assert max(gas.rises.values()) < 12.0
    logs = [log.trace for fit in campaign.fits for log in fit.logs]
    alone = assess(identify(logs, PURDY_DAMPER, FitOptions("joint")), PURDY_DAMPER).uncertainties
    for fit, known, own in zip(campaign.fits, judged.uncertainties, alone, strict=True):
        assert fit.outcome is Outcome.CONVERGED
        assert fit.status["k_e"] == fit.status["r_m3"] == "shared"
        assert known.names == ("r_m1", "r_m2", "r_m3", "f_f", "k_e")
        for name in known.names:
            interval, truth = known.intervals[name], getattr(truths[fit.setting], name)
            reach = 1.5 * (interval.high - interval.low)
            assert getattr(fit.parameters, name) == pytest.approx(truth, abs=reach)
        # One law for all knows K_e of a setting better than its own logs do.
        assert known.intervals["k_e"].error < own.intervals["k_e"].error


def test_errors_are_those_of_one_big_least_squares_with_the_law_inside(campaign) -> None:
    """The slow twin: every variable of every setting in one matrix, K_e by the chain rule."""
    linearised = linearise_settings(campaign, PURDY_DAMPER)
    law, n = campaign.sharing.gas, len(SETTINGS)
    k_e = PURDY_DAMPER.names.index("k_e")
    size, chains = 2 * n + 4, []
    information, scores = np.zeros((size, size)), np.zeros((size, size))
    for i, one in enumerate(linearised):
        chain = np.zeros((6, size))
        chain[0, 2 * i] = chain[1, 2 * i + 1] = chain[2, 2 * n] = chain[4, 2 * n + 1] = 1.0
        for j, name in enumerate(("volume_ratio", "stiffness")):
            up, down = (
                law._replace(**{name: getattr(law, name) * f}).modulus(one.fit.setting)
                for f in (1.0 + 1e-5, 1.0 - 1e-5)
            )
            chain[k_e, 2 * n + 2 + j] = np.log(up / down) / 2e-5
        residuals = np.concatenate([log.residuals for log in one.logs])
        weight = 1.0 / np.mean(residuals**2)
        information += weight * chain.T @ one.information @ chain
        scores += weight**2 * chain.T @ one.scores @ chain
        chains.append(chain)
    inverse = np.linalg.inv(information)
    whole = inverse @ scores @ inverse
    shared = np.sqrt(np.diag(shared_covariance(linearised, campaign.sharing)))
    assert shared == pytest.approx(np.sqrt(np.diag(whole)[2 * n :]), rel=1e-4)
    for chain, known in zip(chains, uncertainties(linearised, campaign.sharing), strict=True):
        places = [PURDY_DAMPER.names.index(name) for name in known.names]
        expected = np.sqrt(np.diag(chain @ whole @ chain.T)[places])
        assert np.sqrt(np.diag(known.covariance)) == pytest.approx(expected, rel=1e-3)


def test_an_erratic_bulk_modulus_is_said_not_to_follow() -> None:
    # K_e of the reference set scatters by up to 15 % about a smooth curve.
    found = identify(traces([2, 6, 11, 17], noise=4.0, duration=5.0), PURDY_DAMPER, GASSY)
    assert "K_e does not follow Appendix 1" in str(found.warnings[0])
    assert max(found.sharing.gas_rises.values()) > 100.0


def test_the_law_is_eq_28_and_starts_from_a_line() -> None:
    pressures = {1: 8e5, 2: 16e5, 3: 30e5}
    law = GasLaw(0.004, 1.5e9, 1.4, pressures)
    moduli = {setting: law.modulus(setting) for setting in pressures}
    for setting, pressure in pressures.items():
        expected = modulus_at_pressure(pressure, volume_ratio=0.004, liquid=1.5e9, compliance=1.0)
        assert moduli[setting] == pytest.approx(float(expected))
        assert law.share(setting) == pytest.approx(0.004 * moduli[setting] / 1.4 / pressure)
    found = joint.first_law(moduli, pressures, 1.4)
    assert (found.volume_ratio, found.stiffness) == pytest.approx((0.004, 1.5e9))
    # A K_e that falls with pressure has no gas to show for it; the start stays positive.
    odd = joint.first_law({1: 9e8, 2: 7e8, 3: 5e8}, pressures, 1.4)
    assert odd.volume_ratio > 0.0 < odd.stiffness
