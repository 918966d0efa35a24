"""How often a log is simulated as a whole, and what is taken from its mean cycle instead.

After the fit a log is simulated once: describing, judging and writing share that. Errors from the
mean cycle's derivatives stay beside those of the log's own.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from damperfit.damper.purdy import cavitation
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.identification import Campaign, FitOptions, identify
from damperfit.identification.model_versus_log import SETTLING
from damperfit.recording import Trace
from damperfit.simulation import SolverOptions, motion_of, simulate
from damperfit.uncertainty import assess
from damperfit.uncertainty.linearisation import linearise_at_fit
from tests.identification.rig import trace
from tests.identification.test_mean_cycle import LOGS

ALL = ("r_m1", "r_m2", "r_m3", "k_e", "f_f")
SOLVER = FitOptions().solver


@pytest.fixture(scope="module")
def logs() -> list[Trace]:
    return [trace(setting, noise=4.0, rate=500.0) for setting in (1, 8, 15)]


@pytest.fixture(scope="module")
def campaign(logs: list[Trace]) -> Campaign:
    return identify(logs, PURDY_DAMPER)


def without_seen(campaign: Campaign) -> Campaign:
    """The same as if nothing had been kept of the fits' last look."""
    fits = (
        replace(fit, logs=tuple(replace(log, seen=None) for log in fit.logs))
        for fit in campaign.fits
    )
    return replace(campaign, fits=tuple(fits))


@pytest.fixture
def lengths(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Samples of each simulation."""
    from damperfit.damper.purdy import integration

    own, found = integration.integrate, []

    def counted(values: Any, damper: Any, motion: Any, **rest: Any) -> Any:
        found.append(len(motion.displacement))
        return own(values, damper, motion, **rest)

    monkeypatch.setattr(integration, "integrate", counted)
    return found


def whole(lengths: Sequence[int], logs: Sequence[Trace]) -> int:
    return sum(n in {len(log.force) for log in logs} for n in lengths)


def test_a_fit_looks_at_its_log_once_for_each_pass(logs: list[Trace], lengths: list[int]) -> None:
    """Two passes of the paper's procedure; the lowest setting has a third, and four starts.

    The second pass's look is the one that describes the fit.

    What else there is, on cycles: at most a dozen for the fits, two for the margins.
    """
    identify(logs, PURDY_DAMPER)
    assert whole(lengths, logs) == 2 * len(logs) + 1 + 4
    assert len(lengths) - whole(lengths, logs) <= 14 * len(logs)


def test_judging_simulates_a_cycle_of_each_log_and_writing_nothing(
    logs: list[Trace], campaign: Campaign, lengths: list[int]
) -> None:
    assess(campaign, PURDY_DAMPER, solver=SOLVER)
    assert (len(lengths), whole(lengths, logs)) == (len(logs), 0)
    seen = [fit.logs[0].compared(fit.parameters, PURDY_DAMPER, SOLVER) for fit in campaign.fits]
    assert len(lengths) == len(logs)
    for fit, one in zip(campaign.fits, seen, strict=True):
        motion = motion_of(fit.logs[0].trace)
        in_parts = replace(SOLVER, settling=SETTLING)
        anew = simulate(fit.parameters, PURDY_DAMPER, motion, options=in_parts)
        kept = anew.pressures.astype(np.float32)  # in single precision, an empty chamber as zero
        assert np.array_equal(one.response.pressures, kept)
        assert np.array_equal(one.response.time, anew.time)


@pytest.mark.parametrize(
    "changed",
    [
        lambda log, values: (replace(log, trace=replace(log.trace)), values, SOLVER),
        lambda log, values: (log, values.replace({"k_e": 1.01 * values.k_e}), SOLVER),
        lambda log, values: (log, values, SolverOptions(tolerance=2e-2)),
    ],
    ids=["trace", "values", "solver"],
)
def test_what_was_seen_of_something_else_is_simulated_anew(
    campaign: Campaign, lengths: list[int], changed: Callable[..., Any]
) -> None:
    (fit, *_) = campaign.fits
    log, values, solver = changed(fit.logs[0], fit.parameters)
    log.compared(values, PURDY_DAMPER, solver)
    assert len(lengths) == 1
    fit.logs[0].compared(fit.parameters, PURDY_DAMPER, SOLVER)
    assert len(lengths) == 1


@pytest.mark.parametrize("name", ["setting 10", "drift", "causal", "two speeds", "whole cycles"])
def test_errors_from_the_mean_cycle_are_those_from_the_log(name: str) -> None:
    """Within 2 %: a twentieth of what errors from fifteen cycles scatter by."""
    found = identify(LOGS[name](), PURDY_DAMPER, FitOptions(procedure="plain", free=ALL))
    fast = assess(found, PURDY_DAMPER, solver=SOLVER)
    slow = assess(without_seen(found), PURDY_DAMPER, solver=SOLVER)
    assert fast.diagnoses[0].is_structured == slow.diagnoses[0].is_structured
    for one in ALL:
        error, other = (each.uncertainties[0].intervals[one].error for each in (fast, slow))
        assert error == pytest.approx(other, rel=0.02), one


def test_derivatives_of_the_mean_cycle_lie_on_those_of_the_log() -> None:
    """Where a cycle is a whole number of samples, but for the noise of the displacement."""
    found = identify(LOGS["whole cycles"](), PURDY_DAMPER, FitOptions(procedure="plain", free=ALL))
    fast = linearise_at_fit(found.fits[0], PURDY_DAMPER, solver=SOLVER).logs[0]
    (slow,) = linearise_at_fit(without_seen(found).fits[0], PURDY_DAMPER, solver=SOLVER).logs
    # By the gas pressure the log is not simulated in parts: other steps, within their tolerance.
    assert np.std(fast.residuals - slow.residuals) < SOLVER.tolerance
    (phases,), (whole,) = fast.slopes, slow.slopes
    there = np.stack([phases.read(column).ravel() for column in whole.by.T], axis=1)
    apart = np.linalg.norm(fast.jacobian - there, axis=0)
    assert len(fast.jacobian) < len(whole.by)
    assert np.all(apart < 0.02 * np.linalg.norm(there, axis=0))


@pytest.mark.parametrize("factor", [0.3, 1.0, 1.3])
@pytest.mark.parametrize("setting", [1, 20])
def test_margins_follow_a_line_to_a_thousandth(
    setting: int, factor: float, lengths: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    damper = replace(PURDY_DAMPER, gas_pressure=1.4 * PURDY_DAMPER.gas_pressure)
    truth = reference_parameters(setting)
    values = truth.replace({"r_m3": factor * truth.r_m3})
    log = trace(setting, noise=4.0, duration=5.0)
    response = simulate(values, damper, motion_of(log), options=SOLVER)
    lengths.clear()
    found = cavitation.examine_cavitation(values, [(log, response)], damper, solver=SOLVER)
    assert len(lengths) == 2
    monkeypatch.setattr(cavitation, "_TOLERANCE", 1e-6)
    bracketed = cavitation._root
    monkeypatch.setattr(cavitation, "_root", lambda lowest, guess, _: bracketed(lowest, guess))
    exact = cavitation.examine_cavitation(values, [(log, response)], damper, solver=SOLVER)
    assert len(lengths) > 10
    assert 1.0 + found.r_m3_margin == pytest.approx(1.0 + exact.r_m3_margin, rel=1e-3)
    assert found.safe_gas_pressure == pytest.approx(exact.safe_gas_pressure, rel=1e-3)
