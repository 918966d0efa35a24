"""Where fits start: as somebody says, and at many places; one minimum is called one."""

from __future__ import annotations

from dataclasses import replace
from itertools import chain, repeat

import numpy as np
import pytest

from damperfit.damper.purdy.parameters import PURDY_DAMPER, Parameters
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.errors import SimulationError
from damperfit.identification import (
    FitOptions,
    GivenStart,
    Outcome,
    Status,
    check_options,
    identify,
)
from damperfit.identification import fit_setting as starts
from damperfit.identification.fit_problem import Block
from damperfit.identification.fit_setting import (
    SPREAD,
    FitResult,
    describe_searches,
    fit_from,
    spread_starts,
)
from damperfit.identification.procedures import ProcedureInput
from damperfit.tested.setting import Setting
from tests.identification.rig import errors, trace, traces

FREE = ("r_m1", "r_m2", "k_e")
KNOWN = {"r_m3": 2.597e6, "f_f": 50.0}
HERE = reference_parameters(9)


def problem(free: tuple[str, ...] = FREE, setting: int = 9) -> Block:
    log = trace(setting, noise=4.0, duration=4.0)
    return Block(PURDY_DAMPER, (log,), free, FitOptions().solver)


def ended(
    parameters: Parameters, mse: float, outcome: Outcome = Outcome.CONVERGED, **status: str
) -> FitResult:
    named = dict.fromkeys(FREE, "fitted") | status
    return FitResult(
        free=FREE, values=parameters, mse_percent=mse, jacobian=np.eye(3), gradient=np.zeros(3),
        evaluations=10, failed_trials=0, ending=1, gradient_cosine=0.0, n_independent=400.0,
        is_cavitating=outcome is Outcome.CAVITATING, outcome=outcome,
        status={name: Status(word) for name, word in named.items()},
        errors=dict.fromkeys(FREE, 1e-3),
    )  # fmt: skip


@pytest.fixture
def searched(monkeypatch: pytest.MonkeyPatch):
    """A search whose fits end as told; None stands for a start that cannot be simulated."""

    def search(*ends: FitResult | None):
        left = iter(ends)

        def fit(*_args: object, **_kwargs: object) -> FitResult:
            end = next(left)
            if end is None:
                raise SimulationError("simulation failed at the start.")
            return end

        monkeypatch.setattr(starts, "fit_setting", fit)
        return fit_from(9, problem(), HERE, starts=len(ends))

    return search


def test_starts_are_spread_over_the_whole_range_and_always_the_same() -> None:
    block = problem((*FREE, "f_0"))
    found = spread_starts(block, HERE, 9, 8)
    assert found == spread_starts(block, HERE, 9, 8)
    assert found != spread_starts(block, HERE, 10, 8)
    for name in FREE:
        away = np.log([getattr(y, name) / getattr(HERE, name) for y in found]) / np.log(SPREAD)
        # One start in each eighth of the range from a tenth to ten times.
        assert sorted(np.floor((away + 1.0) * 4.0)) == list(range(8))
    assert all(y.r_m3 == HERE.r_m3 for y in found)
    assert max(abs(y.f_0) for y in found) <= 300.0
    assert min(y.f_0 for y in found) < -200.0


def test_a_sound_setting_has_one_minimum() -> None:
    logs = traces([3], noise=4.0, duration=4.0)
    plain = identify(logs, PURDY_DAMPER, FitOptions("plain", FREE, KNOWN))
    many = identify(logs, PURDY_DAMPER, FitOptions("plain", FREE, KNOWN, starts=5))
    assert plain.searches == many.warnings == ()
    (found,) = many.searches
    assert (found.n_starts, found.n_failed, len(found.minima)) == (5, 0, 1)
    assert found.minima[0].n_starts == 5
    assert many.fits[0].parameters == plain.fits[0].parameters
    assert many.fits[0].evaluations > 4 * plain.fits[0].evaluations
    (said,) = describe_searches(many.searches)
    assert said == "setting 3, r_m1, r_m2, k_e free, 5 starts: all end in one minimum"


def test_the_way_out_of_the_cavitating_minimum_is_found_and_used(monkeypatch) -> None:
    truth = reference_parameters(18)
    local = replace(truth, r_m3=4.4e6, f_f=1.0)
    first = ended(local, 1.0, Outcome.CAVITATING, r_m3="fitted", f_f="fitted")
    fits = chain([lambda *_, **__: first], repeat(starts.fit_setting))
    monkeypatch.setattr(starts, "fit_setting", lambda *a, **k: next(fits)(*a, **k))  # noqa: PLW0108
    best, found = fit_from(18, problem((*FREE, *KNOWN), 18), local, starts=6)
    assert found.is_improved
    assert best.outcome is Outcome.CONVERGED
    assert abs(errors(best.values, truth)["r_m3"]) < 0.05
    assert "a better minimum" in found.warning
    assert len(found.minima) >= 2


def test_minima_that_fit_equally_well_are_told(searched) -> None:
    there = replace(HERE, k_e=2.0 * HERE.k_e)
    best, found = searched(ended(HERE, 0.0100), None, ended(there, 0.01001))
    assert (best.values, best.evaluations) == (HERE, 20)
    assert found.is_ambiguous
    assert not found.is_improved
    assert found.n_failed == 1
    assert found.warning == "different minima fit equally well: k_e 6.213e+08 or 1.243e+09"
    (said,) = describe_searches([found])
    assert "3 starts of which 1 could not be simulated: 2 minima, with MSE 0.01 %" in said


def test_a_flat_minimum_is_one_minimum(searched) -> None:
    lost = Outcome.NOT_IDENTIFIABLE
    ends = [
        ended(replace(HERE, k_e=k * HERE.k_e), 0.01, lost, k_e="not_identifiable") for k in (1, 9)
    ]
    _, found = searched(*ends)
    assert len(found.minima) == 1
    assert found.warning == ""


def test_procedure_paper_searches_what_it_takes_r_m3_from_too() -> None:
    logs = traces([1, 9], noise=4.0, duration=4.0)
    campaign = identify(logs, PURDY_DAMPER, FitOptions(starts=3), jobs=2)
    # The lowest setting is searched with everything free too, for the R_m3 that all others use.
    assert [(one.setting, len(one.free)) for one in campaign.searches] == [(1, 5), (1, 3), (9, 3)]


def started(start: GivenStart):
    options = FitOptions("plain", fixed={**KNOWN, "f_0": 0.0}, start=start)
    setting = Setting.of(9)
    logs = {setting: problem().traces}
    given = ProcedureInput(logs, PURDY_DAMPER, options, 1, lambda _: None, lambda: False)
    return starts.own_start(given, setting, given.block(setting, FREE), options.fixed)


def test_what_is_told_is_where_a_fit_starts_and_the_rest_is_the_models_start() -> None:
    own, there = started(GivenStart()), started(GivenStart({"k_e": 7e8}))
    assert there == own.replace(k_e=7e8) != own
    # A name goes before the table, what is fixed before both, and the range before all.
    table = {"r_m1": 1e4, "r_m2": 2e6, "r_m3": 1.0, "k_e": 1e30, "other": 3.0}
    there = started(GivenStart({"r_m1": 2e4}, {Setting.of(9): table}))
    assert (there.r_m1, there.r_m2, there.r_m3) == (2e4, 2e6, KNOWN["r_m3"])
    assert there.k_e == PURDY_DAMPER.quantity("k_e").plausible[1]
    # What is freed may be given a start.
    start = GivenStart({"f_0": 5.0})
    check_options(FitOptions("plain", free=(*FREE, "f_0"), start=start), PURDY_DAMPER)
