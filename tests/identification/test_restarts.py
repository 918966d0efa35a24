"""A fit in a wrong valley starts again from elsewhere; what cannot be helped costs little."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from damperfit.conditioning import ConditionOptions, apply_filter, condition
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.identification import FitOptions, identify, multistart, restarts
from damperfit.identification.descent import Misfit, descend
from damperfit.identification.outcome import Outcome
from damperfit.identification.procedure_input import ProcedureInput
from damperfit.identification.restarts import is_suspicious, noise_percent, reconsidered
from damperfit.identification.setting import attempt, describe_fit
from damperfit.simulation import SolverOptions
from tests.identification import adjusted
from tests.identification.far_starts import fitted_from, log_of
from tests.identification.rig import trace

FREE = ("r_m1", "r_m2", "r_m3", "k_e", "f_f")
TRUTH = reference_parameters(10)


@pytest.fixture(scope="module")
def log():
    return trace(10, noise=20.0)


class Counter:
    """Asked before each evaluation, whether to stop."""

    def __init__(self):
        self.n = 0

    def __call__(self):
        self.n += 1
        return False


def misfit_of(log, cancelled=lambda: False):
    return Misfit((log,), PURDY_DAMPER, FREE, SolverOptions(tolerance=1e-2), 100, cancelled)


@pytest.mark.one_in(2)
@pytest.mark.parametrize("far", [{"r_m1": 1e6}, {"r_m1": 5e5, "k_e": 1e10}])
def test_a_wrong_valley_is_left(log, far):
    """A single descent ends there at 566 and 7147 % of the variance."""
    start = replace(TRUTH, **far)
    misfit = misfit_of(log)
    first = attempt(misfit, start, 0)
    assert first.solution.mse_percent > 10.0
    found = reconsidered(misfit, first, start)
    for name, share in zip(FREE, (0.005, 0.02, 0.03, 0.03, 0.03), strict=True):
        right = getattr(TRUTH, name)
        assert getattr(found.solution.parameters, name) == pytest.approx(right, rel=share), name
    assert found.outcome.value == "converged"
    assert found.solution.evaluations < 5 * first.solution.evaluations
    (said,) = describe_fit(10, found, misfit).warnings
    assert "the first fit ended in a local minimum" in said
    assert "started again from" in said


def test_a_fit_that_noise_explains_costs_nothing(log):
    counter = Counter()
    misfit = misfit_of(log, counter)
    first = attempt(misfit, TRUTH, 0)
    counter.n = 0
    assert reconsidered(misfit, first, TRUTH) is first
    assert counter.n == 0


@pytest.mark.parametrize(
    ("ratio", "cavitates", "is_doubted"),
    [(3.9, False, False), (4.1, False, True), (1.45, True, False), (1.55, True, True)],
)
def test_the_limits_of_suspicion(log, ratio, cavitates, is_doubted):
    misfit = misfit_of(log)
    first = attempt(misfit, TRUTH, 0)
    mse = ratio * noise_percent(misfit)
    solution = replace(first.solution, mse_percent=mse, is_cavitating=cavitates)
    assert is_suspicious(misfit, replace(first, solution=solution)) is is_doubted


@pytest.mark.parametrize(("mse", "is_doubted"), [(0.9e-3, False), (1.1e-3, True)])
def test_a_thousandth_of_a_per_cent_is_no_valley(mse, is_doubted):
    misfit = misfit_of(trace(10, noise=1.0))
    first = attempt(misfit, TRUTH, 0)
    seen = replace(first, solution=replace(first.solution, mse_percent=mse))
    assert is_suspicious(misfit, seen) is is_doubted


def with_force(log, extra):
    return replace(log, force=log.force + extra)


def test_a_flaw_that_is_known_needs_no_other_start(log):
    """Seal friction of 200 N more at low speed: one evaluation to see that, and no more."""
    at_rest = 100.0 * np.tanh(log.velocity / 1e-3) * np.exp(-np.abs(log.velocity) / 0.03)
    counter = Counter()
    misfit = misfit_of(with_force(log, 2.0 * apply_filter(log.model_filter, at_rest)), counter)
    first = attempt(misfit, TRUTH, 0)
    assert first.solution.mse_percent > 4.0 * noise_percent(misfit)
    counter.n = 0
    assert reconsidered(misfit, first, TRUTH) is first
    assert counter.n == 1


def test_what_no_start_can_help_is_bounded_and_told(log):
    """A wave of 7.5 Hz in the force, as from a rig that shakes."""
    turn = 2.0 * np.pi * 7.5 * log.interval * np.arange(len(log.force))
    misfit = misfit_of(with_force(log, 80.0 * np.sin(turn)))
    first = attempt(misfit, TRUTH, 0)
    found = reconsidered(misfit, first, TRUTH)
    assert found.solution.parameters == first.solution.parameters
    assert found.solution.evaluations <= first.solution.evaluations + 61
    (said,) = describe_fit(10, found, misfit).warnings
    # A descent among such waves is as long as it happens to be: how many fit into 60 evaluations?
    assert re.search(r"started again from [2-5] other places \((5[5-9]|60) evaluations\)", said)
    assert "found no better minimum" in said


@pytest.mark.parametrize(("most", "kept"), [(5, {5}), (11, {11}), (12, {12}), (40, {12})])
def test_other_places_keep_the_limit_of_evaluations(log, monkeypatch, most, kept):
    """A short descent has 12 at most, and no more than any descent may have."""
    turn = 2.0 * np.pi * 7.5 * log.interval * np.arange(len(log.force))
    misfit = misfit_of(with_force(log, 80.0 * np.sin(turn)))
    first = attempt(misfit, TRUTH, 0)
    seen = set()

    def counted(looked, place):
        seen.add(looked.max_evaluations)
        found = descend(looked, place)
        assert found.evaluations <= looked.max_evaluations
        return found

    monkeypatch.setattr(restarts, "descend", counted)
    reconsidered(replace(misfit, max_evaluations=most), first, TRUTH)
    assert seen == kept


def test_identify_starts_again_by_itself(log, monkeypatch):
    """Also where the closed form leads astray, and from the first pass on."""
    far = replace(TRUTH, r_m1=5e5, r_m2=1e9)
    monkeypatch.setattr(ProcedureInput, "start", lambda *_: far)
    monkeypatch.setattr(multistart, "fit_setting", lambda m, s, spent=0: attempt(m, s, spent))
    (fit,) = identify([log], PURDY_DAMPER, FitOptions(procedure="plain")).fits
    assert fit.parameters.r_m1 == pytest.approx(TRUTH.r_m1, rel=0.005)
    assert any("local minimum" in said for said in fit.warnings)


@pytest.mark.one_in(2)
@pytest.mark.parametrize("setting", [10, 20])
def test_a_damper_that_is_empty_for_most_of_the_time_is_found(setting):
    """With R_m3 ten times as large every descent from the closed form ended at 1.2 % of MSE."""
    truth = replace(reference_parameters(setting), r_m3=2.597e7)
    odd = trace(setting, truth, noise=4.0, duration=4.0)
    (fit,) = identify([odd], PURDY_DAMPER, FitOptions(procedure="plain")).fits
    assert fit.cavitation_fraction > 0.7
    for name, share in zip(FREE, (0.002, 0.005, 0.005, 0.02, 0.02), strict=True):
        assert getattr(fit.parameters, name) == pytest.approx(getattr(truth, name), rel=share), name
    assert any("local minimum" in said for said in fit.warnings)


@pytest.mark.one_in(2)
def test_a_cavitating_valley_that_a_given_start_led_to_is_left() -> None:
    """R_m1 at a hundredth and f_f at a hundred times: every short descent ended in it as well."""
    setting, truth = 20, reference_parameters(20)
    seen = condition(log_of("steps", setting), ConditionOptions(centre=0.0))
    end = fitted_from(seen, {"r_m1": 0.01 * truth.r_m1, "f_f": 100.0 * truth.f_f})
    assert end.fit.outcome is Outcome.CONVERGED
    for name in ("r_m1", "k_e", "f_f"):
        right = getattr(truth, name)
        assert getattr(end.fit.parameters, name) == pytest.approx(right, rel=0.005), name


LOST = ({"rebound_opening": 0.1, "rebound_bleed": 20.0}, {"rebound_opening": 40.0})


@pytest.mark.parametrize("factors", LOST, ids=["always open", "never open"])
def test_a_fit_of_valves_lost_by_its_start_begins_again_from_the_loop(factors, monkeypatch) -> None:
    setting = adjusted.at(14, 3)
    truth = adjusted.DAMPER.values(adjusted.numbers(setting))
    free = tuple(one.name for one in truth.quantities if one.default is None)
    misfit = Misfit(
        (adjusted.log(setting),), adjusted.DAMPER, free, SolverOptions(tolerance=1e-2), 100,
        lambda: False,
    )  # fmt: skip
    start = truth.replace({name: by * getattr(truth, name) for name, by in factors.items()})
    best = attempt(misfit, truth, 0).solution.mse_percent
    first = attempt(misfit, start, 0)
    assert first.solution.mse_percent > 1000.0 * best
    found = reconsidered(misfit, first, start)
    assert found.solution.mse_percent < 1.001 * best
    assert "the first fit ended in a local minimum" in found.said[0]
    # From the places far from its start alone it is not found as soon.
    monkeypatch.setattr(restarts, "_OWN", 0)
    far = reconsidered(misfit, first, start)
    assert far.solution.evaluations > found.solution.evaluations


def test_where_a_fit_began_is_no_other_place_to_start_from() -> None:
    seen = adjusted.log(adjusted.at(14, 3))
    own, *others = adjusted.DAMPER.start([seen], {})
    free = tuple(one.name for one in own.quantities if one.default is None)
    misfit = Misfit((seen,), adjusted.DAMPER, free, SolverOptions(), 100, lambda: False)
    found, is_elsewhere = restarts._own_starts(misfit, own)
    assert not is_elsewhere
    assert restarts._own_starts(misfit, own.replace({"f_f": 3.0 * own.f_f}))[1]
    assert len(found) == 2
    assert own not in found
    assert set(found) <= set(others)


def test_a_flaw_that_explains_a_misfit_does_not_excuse_an_end_at_an_edge(monkeypatch) -> None:
    setting = adjusted.at(14, 3)
    truth = adjusted.DAMPER.values(adjusted.numbers(setting))
    free = tuple(one.name for one in truth.quantities if one.default is None)
    misfit = Misfit(
        (adjusted.log(setting),), adjusted.DAMPER, free, SolverOptions(tolerance=1e-2), 100,
        lambda: False,
    )  # fmt: skip
    start = {name: by * getattr(truth, name) for name, by in LOST[0].items()}
    first = attempt(misfit, truth.replace(start), 0)
    assert first.outcome is Outcome.AT_BOUND
    monkeypatch.setattr(restarts, "_is_explained", lambda *_: True)
    assert is_suspicious(misfit, first)
    assert not is_suspicious(misfit, replace(first, outcome=Outcome.CONVERGED))
    met = replace(first.solution, mse_percent=3.9 * noise_percent(misfit))
    assert not is_suspicious(misfit, replace(first, solution=met))
