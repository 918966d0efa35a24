"""A setting that cannot be fitted, or meets a bug of ours, costs itself alone."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.errors import SimulationError
from damperfit.identification import Campaign, FitOptions, Outcome, fit_problem, identify, joint
from damperfit.identification.logs import settled
from damperfit.identification.outcome import attempted
from damperfit.recording import Trace
from damperfit.simulation import simulate
from tests.identification.rig import traces

PROCEDURES = ["paper", "joint", "plain"]
NO_REASON = SimulationError("simulation failed: no reason.")


@pytest.fixture(scope="module")
def logs() -> list[Trace]:
    return traces([2, 6, 12], noise=4.0, duration=5.0)


@pytest.fixture
def break_at(monkeypatch: pytest.MonkeyPatch) -> Callable[..., Callable[[], int]]:
    """Let the simulation of one log fail, from the n-th on; returns how many there were."""

    def arrange(log: Trace, error: Exception, *, after: int = 0) -> Callable[[], int]:
        seen, mine = 0, [log.displacement]
        if cycles := settled([log], is_thinned=False):
            mine += [one.motion.displacement for one in cycles.cycles]

        def broken(parameters, damper, motion, **kwargs):
            nonlocal seen
            if any(np.array_equal(motion.displacement, one) for one in mine):
                seen += 1
                if seen > after:
                    raise error
            return simulate(parameters, damper, motion, **kwargs)

        monkeypatch.setattr(fit_problem, "simulate", broken)
        return lambda: seen

    return arrange


def _kept(campaign: Campaign, bad: int, logs: list[Trace]) -> None:
    assert [fit.setting for fit in campaign.fits] == [s.setting for s in logs if s.setting != bad]
    assert [one.setting for one in campaign.failures] == [bad]
    for fit in campaign.fits:
        assert fit.outcome is Outcome.CONVERGED
        truth = reference_parameters(fit.setting)
        assert fit.parameters.r_m2 == pytest.approx(truth.r_m2, rel=0.02)
        assert fit.parameters.r_m3 == pytest.approx(truth.r_m3, rel=0.05)
        assert fit.status["r_m3"] == "shared" or campaign.procedure == "plain"
    assert campaign.is_complete


@pytest.mark.one_in(2)
@pytest.mark.parametrize("procedure", PROCEDURES)
@pytest.mark.parametrize("bad", [2, 6, 12])
def test_one_that_cannot_be_simulated_is_a_failure_of_its_own(
    logs, break_at, procedure: str, bad: int
) -> None:
    # At the lowest setting this used to end the run.
    break_at(next(log for log in logs if log.setting == bad), NO_REASON)
    campaign = identify(logs, PURDY_DAMPER, FitOptions(procedure))
    _kept(campaign, bad, logs)
    assert campaign.failures[0].kind == "SimulationError"
    assert campaign.failures[0].message == "simulation failed: no reason."
    is_said = "taken-from-another" in {one.code for one in campaign.warnings}
    assert is_said is (bad == 2 and procedure != "plain")


# In the first pass of the lowest setting, in the middle, in the last simulation of the highest.
STRIKES = {(2, 0.0), (2, 0.5), (12, 0.999)}


@pytest.mark.parametrize("procedure", PROCEDURES)
@pytest.mark.parametrize(
    ("bad", "share"),
    [
        pytest.param(bad, share, marks=[] if (bad, share) in STRIKES else pytest.mark.slow)
        for bad in (2, 12)
        for share in (0.0, 0.3, 0.5, 0.7, 0.999)
    ],
)
def test_a_bug_that_one_setting_meets_is_told_and_leaves_the_others(
    logs, break_at, procedure: str, bad: int, share: float
) -> None:
    # Wherever it strikes: in the first pass, the joint fit, the last simulation of all.
    log = next(log for log in logs if log.setting == bad)
    count = break_at(log, ValueError(), after=10**6)
    identify(logs, PURDY_DAMPER, FitOptions(procedure))
    break_at(log, np.linalg.LinAlgError("Singular matrix"), after=int(share * count()))
    campaign = identify(logs, PURDY_DAMPER, FitOptions(procedure), jobs=2)
    _kept(campaign, bad, logs)
    failure = campaign.failures[0]
    assert failure.is_internal
    assert failure.kind == "InternalError"
    where = "(damperfit/identification/fit_problem.py, line "
    said = f"internal error while fitting, LinAlgError: Singular matrix {where}"
    assert failure.message.startswith(said)
    assert "please report this line, with the log if it may be shown" in failure.message
    assert "Traceback" in failure.trace


@pytest.mark.parametrize("procedure", PROCEDURES)
def test_where_none_can_be_fitted_each_says_why(logs, monkeypatch, procedure: str) -> None:
    def broken(*_: object, **__: object) -> None:
        raise NO_REASON

    monkeypatch.setattr(fit_problem, "simulate", broken)
    campaign = identify(logs[:2], PURDY_DAMPER, FitOptions(procedure))
    assert campaign.fits == ()
    assert [one.setting for one in campaign.failures] == [2, 6]
    if procedure == "paper":
        said = "these are used: r_m3 2.597e+06 (identification.fallback_r_m3), f_f 50 (identif"
        assert said in str(campaign.warnings[0])


@pytest.fixture
def break_together(monkeypatch: pytest.MonkeyPatch) -> Callable[[int, Exception], None]:
    """Let a setting fail where it is fitted beside others, and not alone."""

    def arrange(bad: int, error: Exception) -> None:
        def fails() -> None:
            raise error

        def broken(setting, fit):
            return attempted(setting, fails if setting == bad else fit)

        monkeypatch.setattr(fit_problem, "attempted", broken)

    return arrange


def test_a_setting_that_fails_beside_others_alone_follows_them(logs, break_together) -> None:
    break_together(12, NO_REASON)
    campaign = identify(logs, PURDY_DAMPER, FitOptions("joint"))
    assert campaign.failures == ()
    assert [fit.setting for fit in campaign.fits] == [2, 6, 12]
    assert campaign.sharing.settings == (2, 6)
    said = "left out of the joint fit: setting 12: simulation failed: no reason."
    assert said in map(str, campaign.warnings)
    assert campaign.fits[2].parameters.r_m3 == campaign.fits[0].parameters.r_m3


@pytest.mark.parametrize("bulk_modulus", ["free", "appendix1"])
def test_a_bug_beside_one_other_leaves_the_papers_result(
    logs, break_together, bulk_modulus: str
) -> None:
    break_together(6, ValueError("shapes"))
    options = FitOptions("joint", bulk_modulus=bulk_modulus)
    campaign = identify(logs[:2], PURDY_DAMPER, options)
    assert [fit.setting for fit in campaign.fits] == [2]
    assert campaign.failures[0].is_internal
    assert any("needs two settings" in text for text in map(str, campaign.warnings))


def test_a_bug_in_the_algebra_of_the_joint_fit_leaves_the_papers_results(logs, monkeypatch) -> None:
    """It belongs to no setting, and used to end the run with code 70."""

    def broken(*_: object) -> object:
        raise np.linalg.LinAlgError("Singular matrix")

    monkeypatch.setattr(joint, "fit_jointly", broken)
    campaign = identify(logs, PURDY_DAMPER, FitOptions("joint"))
    alone = identify(logs, PURDY_DAMPER, FitOptions("paper", free=("r_m1", "r_m2", "k_e")))
    assert [fit.setting for fit in campaign.fits] == [fit.setting for fit in alone.fits]
    assert campaign.failures == ()
    assert campaign.failure.kind == "InternalError"
    said = "while fitting the settings together, LinAlgError: Singular matrix"
    assert said in campaign.failure.message
    assert any("results of procedure paper" in text for text in map(str, campaign.warnings))
    assert alone.failure is None
