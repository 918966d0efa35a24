"""Fits from many starts: one minimum is called one, a better one is used, two are told apart."""

from __future__ import annotations

from dataclasses import replace
from itertools import chain, repeat

import numpy as np
import pytest

from damperfit.damper.purdy.parameters import PURDY_DAMPER, Parameters
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.errors import SimulationError
from damperfit.identification import FitOptions, Outcome, Status, identify
from damperfit.identification import starts as multistart
from damperfit.identification.fit_problem import Block
from damperfit.identification.fit_setting import FitResult
from damperfit.identification.starts import (
    SPREAD,
    describe_searches,
    fit_from,
    fit_setting,
    spread_starts,
)
from damperfit.simulation import SolverOptions
from tests.identification.rig import errors, trace, traces

FREE = ("r_m1", "r_m2", "k_e")
KNOWN = {"r_m3": 2.597e6, "f_f": 50.0}


def problem(free: tuple[str, ...] = FREE, setting: int = 9) -> Block:
    log = trace(setting, noise=4.0, duration=4.0)
    return Block(PURDY_DAMPER, (log,), free, SolverOptions(tolerance=1e-2))


def ended(
    parameters: Parameters, mse: float, outcome: Outcome = Outcome.CONVERGED, **status: str
) -> FitResult:
    named = dict.fromkeys(FREE, "fitted") | status
    return FitResult(
        free=FREE,
        values=parameters,
        mse_percent=mse,
        jacobian=np.eye(3),
        gradient=np.zeros(3),
        evaluations=10,
        failed_trials=0,
        ending=1,
        gradient_cosine=0.0,
        n_independent=400.0,
        is_cavitating=outcome is Outcome.CAVITATING,
        status={name: Status(word) for name, word in named.items()},
        outcome=outcome,
        errors=dict.fromkeys(FREE, 1e-3),
    )


def searched(monkeypatch: pytest.MonkeyPatch, first: FitResult, *others: FitResult | None):
    """A search whose further starts end as told; None stands for a start that cannot be."""
    ends = iter((first, *others))

    def fit(*_args: object, **_kwargs: object) -> FitResult:
        end = next(ends)
        if end is None:
            raise SimulationError("simulation failed at the start.")
        return end

    monkeypatch.setattr(multistart, "fit_setting", fit)
    return fit_from(9, problem(), first.values, starts=1 + len(others))


def test_starts_are_spread_over_the_whole_range_and_always_the_same() -> None:
    centre = reference_parameters(9)
    found = spread_starts(problem((*FREE, "f_0")), centre, 9, 8)
    assert found == spread_starts(problem((*FREE, "f_0")), centre, 9, 8)
    assert found != spread_starts(problem((*FREE, "f_0")), centre, 10, 8)
    for name in FREE:
        away = np.log([getattr(y, name) / getattr(centre, name) for y in found]) / np.log(SPREAD)
        # One start in each eighth of the range from a tenth to ten times.
        assert sorted(np.floor((away + 1.0) * 4.0)) == list(range(8))
    assert all(y.r_m3 == centre.r_m3 for y in found)
    assert max(abs(y.f_0) for y in found) <= 300.0
    assert min(y.f_0 for y in found) < -200.0


@pytest.mark.parametrize("setting", [3])
def test_a_sound_setting_has_one_minimum(setting: int) -> None:
    logs = traces([setting], noise=4.0, duration=4.0)
    plain = identify(logs, PURDY_DAMPER, FitOptions("plain", FREE, KNOWN))
    many = identify(logs, PURDY_DAMPER, FitOptions("plain", FREE, KNOWN, starts=5))
    assert plain.searches == ()
    (found,) = many.searches
    assert (found.n_starts, found.n_failed, len(found.minima)) == (5, 0, 1)
    assert found.minima[0].n_starts == 5
    assert many.warnings == ()
    assert many.fits[0].parameters == plain.fits[0].parameters
    assert many.fits[0].evaluations > 4 * plain.fits[0].evaluations
    assert describe_searches(many.searches) == (
        "setting 3, r_m1, r_m2, k_e free, 5 starts: all end in one minimum",
    )


def test_the_way_out_of_the_cavitating_minimum_is_found_and_used(monkeypatch) -> None:
    truth = reference_parameters(18)
    everything = problem(("r_m1", "r_m2", "r_m3", "k_e", "f_f"), 18)
    local = replace(truth, r_m3=4.4e6, f_f=1.0)
    first = ended(local, 1.0, Outcome.CAVITATING, r_m3="fitted", f_f="fitted")
    fits = chain([lambda *_, **__: first], repeat(fit_setting))
    monkeypatch.setattr(multistart, "fit_setting", lambda *a, **k: next(fits)(*a, **k))  # noqa: PLW0108
    best, found = fit_from(18, everything, local, starts=6)
    assert found.is_improved
    assert best.outcome is Outcome.CONVERGED
    assert abs(errors(best.values, truth)["r_m3"]) < 0.05
    assert "a better minimum" in found.warning
    assert len(found.minima) >= 2


def test_minima_that_fit_equally_well_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    here = reference_parameters(9)
    there = replace(here, k_e=2.0 * here.k_e)
    best, found = searched(monkeypatch, ended(here, 0.0100), None, ended(there, 0.01001))
    assert best.values == here
    assert best.evaluations == 20
    assert found.is_ambiguous
    assert not found.is_improved
    assert found.n_failed == 1
    words = "different minima fit equally well: k_e 6.213e+08 or 1.243e+09"
    assert found.warning == words
    (said,) = describe_searches([found])
    assert "3 starts of which 1 could not be simulated: 2 minima, with MSE 0.01 %" in said


def test_a_flat_minimum_is_one_minimum(monkeypatch: pytest.MonkeyPatch) -> None:
    here = reference_parameters(9)
    flat = {"k_e": "not_identifiable"}
    _, found = searched(
        monkeypatch,
        ended(here, 0.01, Outcome.NOT_IDENTIFIABLE, **flat),
        ended(replace(here, k_e=9.0 * here.k_e), 0.01, Outcome.NOT_IDENTIFIABLE, **flat),
    )
    assert len(found.minima) == 1
    assert found.warning == ""


def test_procedure_paper_searches_what_it_takes_r_m3_from_too() -> None:
    logs = traces([1, 9], noise=4.0, duration=4.0)
    campaign = identify(logs, PURDY_DAMPER, FitOptions(starts=3), jobs=2)
    # The lowest setting is searched with everything free too, for the R_m3 that all others use.
    assert [(one.setting, len(one.free)) for one in campaign.searches] == [(1, 5), (1, 3), (9, 3)]
    assert campaign.warnings == ()
