"""K_e of all settings from one gas content: recovered where it holds, said where it does not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from damperfit.damper.purdy.appendices import modulus_at_pressure
from damperfit.damper.purdy.parameters import PURDY_DAMPER, Parameters
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.identification import Campaign, FitOptions, Outcome, identify
from damperfit.identification.fit_problem import Block
from damperfit.identification.joint import first_law, working_pressure
from damperfit.identification.sharing import GasLaw
from damperfit.simulation import SolverOptions
from damperfit.uncertainty import assess, linearise_settings, uncertainties
from damperfit.uncertainty.covariance import shared_covariance
from tests.identification.rig import trace, traces

VOLUME_RATIO, STIFFNESS = 0.004, 1.5e9 / 1.1
OPTIONS = FitOptions("joint", bulk_modulus="appendix1")
SETTINGS = (1, 8, 14, 20)
SOLVER = SolverOptions(tolerance=1e-2)


def gassy(setting: int) -> Parameters:
    """The reference set with K_e of eq. (28), at the working pressure it then has."""
    truth = reference_parameters(setting)
    for _ in range(4):
        log = trace(setting, truth, duration=4.0)
        problem = Block(PURDY_DAMPER, (log,), (), SOLVER, max_evaluations=1)
        k_e = modulus_at_pressure(
            working_pressure(problem, truth), volume_ratio=VOLUME_RATIO, compliance=1.1
        )
        truth = replace(truth, k_e=float(k_e))
    return truth


@pytest.fixture(scope="module")
def truths() -> dict[int, Parameters]:
    return {setting: gassy(setting) for setting in SETTINGS}


@pytest.fixture(scope="module")
def campaign(truths) -> Campaign:
    logs = [trace(s, truth, noise=4.0, duration=10.0) for s, truth in truths.items()]
    return identify(logs, PURDY_DAMPER, OPTIONS, jobs=2)


def test_the_gas_content_comes_back_within_its_interval(campaign, truths) -> None:
    assert campaign.warnings == ()
    judged = assess(campaign, PURDY_DAMPER)
    found = judged.gas
    assert found is not None
    for value, truth, interval in (
        (found.volume_ratio, VOLUME_RATIO, found.volume_ratio_interval),
        (found.stiffness, STIFFNESS, found.stiffness_interval),
    ):
        assert value == pytest.approx(truth, rel=3e-3)
        assert interval.low < truth < interval.high
        assert interval.high / interval.low < 1.02
    assert 1.0 < max(found.pressures.values()) / min(found.pressures.values()) < 10.0
    assert max(found.rises.values()) < 12.0
    for fit, known in zip(campaign.fits, judged.uncertainties, strict=True):
        assert fit.outcome is Outcome.CONVERGED
        assert fit.status["k_e"] == fit.status["r_m3"] == "shared"
        assert known.names == ("r_m1", "r_m2", "r_m3", "f_f", "k_e")
        for name in known.names:
            interval = known.intervals[name]
            reach = 1.5 * (interval.high - interval.low)
            assert getattr(fit.parameters, name) == pytest.approx(
                getattr(truths[fit.setting], name), abs=reach
            )
        # One law for all knows K_e of a setting better than its own logs do.
    alone = identify(
        [log.trace for fit in campaign.fits for log in fit.logs], PURDY_DAMPER, FitOptions("joint")
    )
    by_itself = assess(alone, PURDY_DAMPER).uncertainties
    for known, own in zip(judged.uncertainties, by_itself, strict=True):
        assert known.intervals["k_e"].error < own.intervals["k_e"].error


def test_errors_are_those_of_one_big_least_squares_with_the_law_inside(campaign) -> None:
    """The slow twin: every variable of every setting in one matrix, K_e by the chain rule."""
    linearised = linearise_settings(campaign, PURDY_DAMPER)
    law, n = campaign.sharing.gas, len(SETTINGS)
    k_e = PURDY_DAMPER.names.index("k_e")
    size = 2 * n + 4
    information, scores = np.zeros((size, size)), np.zeros((size, size))
    chains = []
    for i, one in enumerate(linearised):
        chain = np.zeros((6, size))
        chain[0, 2 * i] = chain[1, 2 * i + 1] = 1.0
        chain[2, 2 * n] = 1.0
        chain[4, 2 * n + 1] = 1.0
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
    shared = shared_covariance(linearised, campaign.sharing)
    assert np.sqrt(np.diag(shared)) == pytest.approx(np.sqrt(np.diag(whole)[2 * n :]), rel=1e-4)
    for chain, known in zip(chains, uncertainties(linearised, campaign.sharing), strict=True):
        expected = chain @ whole @ chain.T
        places = [PURDY_DAMPER.names.index(name) for name in known.names]
        assert np.sqrt(np.diag(known.covariance)) == pytest.approx(
            np.sqrt(np.diag(expected)[places]), rel=1e-3
        )


def test_an_erratic_bulk_modulus_is_said_not_to_follow() -> None:
    # K_e of the reference set scatters by up to 15 % about a smooth curve.
    found = identify(traces([2, 6, 11, 17], noise=4.0, duration=5.0), PURDY_DAMPER, OPTIONS)
    (said,) = map(str, found.warnings)
    assert said.startswith("K_e does not follow Appendix 1 with one gas content")
    assert "of 4 settings, most at setting 11" in said
    assert max(found.sharing.gas_rises.values()) > 100.0


def test_the_law_is_eq_28_and_starts_from_a_line() -> None:
    pressures = {1: 8e5, 2: 16e5, 3: 30e5}
    law = GasLaw(0.004, 1.5e9, 1.4, pressures)
    for setting, pressure in pressures.items():
        expected = modulus_at_pressure(pressure, volume_ratio=0.004, liquid=1.5e9, compliance=1.0)
        assert law.modulus(setting) == pytest.approx(float(expected))
        assert law.share(setting) == pytest.approx(0.004 * law.modulus(setting) / 1.4 / pressure)
    moduli = {setting: law.modulus(setting) for setting in pressures}
    found = first_law(moduli, pressures, 1.4)
    assert (found.volume_ratio, found.stiffness) == pytest.approx((0.004, 1.5e9))
    # A K_e that falls with pressure has no gas to show for it; the start stays positive.
    odd = first_law({1: 9e8, 2: 7e8, 3: 5e8}, pressures, 1.4)
    assert odd.volume_ratio > 0.0 < odd.stiffness
