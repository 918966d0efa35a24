"""The first pass starts settings between others that are known, and ends where it would anyway."""

from __future__ import annotations

from dataclasses import replace

import pytest

from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.errors import SimulationError
from damperfit.identification import FitOptions
from damperfit.identification.given_start import GivenStart
from damperfit.identification.outcome import Outcome
from damperfit.identification.paper import free_everywhere as module
from damperfit.identification.paper.free_everywhere import free_everywhere
from damperfit.identification.procedure_input import ProcedureInput
from damperfit.identification.setting import Judged, fit_setting
from damperfit.identification.settled import settled
from damperfit.tested.setting import Setting
from tests.identification.rig import trace

ALL = ("r_m1", "r_m2", "r_m3", "k_e", "f_f")
SETTINGS = [Setting.of(one) for one in (6, 7, 8, 9, 10, 11)]  # 6 and 10 first, 11 is beyond


@pytest.fixture(scope="module")
def given() -> ProcedureInput:
    logs = {one: (trace(one.cell, noise=4.0, duration=4.0, rate=500.0),) for one in SETTINGS}
    return ProcedureInput(
        logs,
        PURDY_DAMPER,
        FitOptions(),
        1,
        lambda _fit: None,
        lambda: False,
        {one: settled(traces, is_thinned=False) for one, traces in logs.items()},
    )


def everywhere(given: ProcedureInput) -> dict[Setting, Judged]:
    found = free_everywhere(given, ALL, {"f_0": 0.0}, reference_parameters(6), SETTINGS)
    assert all(isinstance(one, Judged) for one in found.values())
    assert list(found) == SETTINGS
    return found  # type: ignore[return-value]


@pytest.fixture(scope="module")
def fits(given: ProcedureInput) -> dict[Setting, Judged]:
    return everywhere(given)


@pytest.fixture(scope="module")
def one_by_one(given: ProcedureInput) -> dict[Setting, Judged]:
    """The slow twin: each from its closed form."""
    found = {}
    for one in SETTINGS:
        alone = free_everywhere(given, ALL, {"f_0": 0.0}, reference_parameters(6), [one])[one]
        assert isinstance(alone, Judged)
        found[one] = alone
    return found


def test_they_end_where_each_would_from_its_closed_form(
    fits: dict[Setting, Judged], one_by_one: dict[Setting, Judged]
) -> None:
    for setting, one in fits.items():
        twin = one_by_one[setting]
        assert one.outcome is twin.outcome is Outcome.CONVERGED
        for name in ALL:
            value, other = (getattr(fit.solution.parameters, name) for fit in (one, twin))
            assert abs(value / other - 1.0) < 0.01 * twin.errors[name], (setting, name)


def test_those_between_need_fewer_simulations(
    fits: dict[Setting, Judged], one_by_one: dict[Setting, Judged]
) -> None:
    between = SETTINGS[1:4]
    spent, alone = (
        sum(known[one].solution.evaluations for one in between) for known in (fits, one_by_one)
    )
    assert spent <= 0.7 * alone
    for one in (SETTINGS[0], SETTINGS[4], SETTINGS[5]):
        assert fits[one].solution.parameters == one_by_one[one].solution.parameters


def test_a_start_between_that_leads_astray_is_left(
    given: ProcedureInput, one_by_one: dict[Setting, Judged], monkeypatch: pytest.MonkeyPatch
) -> None:
    def astray(*arguments: object) -> Judged:
        return replace(fit_setting(*arguments), outcome=Outcome.AT_BOUND)  # type: ignore[arg-type]

    monkeypatch.setattr(module, "fit_setting", astray)
    for setting, one in everywhere(given).items():
        assert one.solution.parameters == one_by_one[setting].solution.parameters


def test_between_fits_that_are_not_sound_nothing_starts(
    given: ProcedureInput, monkeypatch: pytest.MonkeyPatch
) -> None:
    def unsound(*arguments: object) -> Judged:
        return replace(guided(*arguments), outcome=Outcome.CAVITATING)  # type: ignore[arg-type]

    def refused(*_: object) -> None:
        pytest.fail("a start between fits that are not sound")

    guided = module.fit_guided
    monkeypatch.setattr(module, "fit_guided", unsound)
    monkeypatch.setattr(module, "fit_setting", refused)
    everywhere(given)


def test_what_somebody_has_said_to_start_at_is_kept(
    given: ProcedureInput, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(*_: object) -> None:
        pytest.fail("a start that somebody gave is not begun at")

    said = FitOptions(start=GivenStart({"r_m1": 2.0e4}))
    monkeypatch.setattr(module, "fit_setting", refused)
    everywhere(replace(given, options=said))


def test_what_cannot_be_simulated_between_is_tried_from_its_closed_form(
    given: ProcedureInput, one_by_one: dict[Setting, Judged], monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(*_: object) -> None:
        raise SimulationError("no")

    monkeypatch.setattr(module, "fit_setting", refused)
    for setting, one in everywhere(given).items():
        assert one.solution.parameters == one_by_one[setting].solution.parameters
