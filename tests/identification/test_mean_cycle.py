"""The fit over mean cycles beside its slow twin, the descent on the logs alone.

Parameters within a tenth of their errors, on standard logs, logs that the rig has filtered or that
drift, several speeds, and rates of which a cycle is a whole number of samples.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest

from damperfit.conditioning import ConditionOptions, apply_filter, condition
from damperfit.conditioning.filters import design_filter
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.errors import SimulationError
from damperfit.identification import FitOptions, descent, identify
from damperfit.identification import last_step as last_step_module
from damperfit.identification.descent import Misfit, approach, descend
from damperfit.identification.evaluation import evaluate
from damperfit.identification.last_step import _back_through, last_step
from damperfit.identification.setting import relative_errors
from damperfit.identification.settled import settled
from damperfit.recording import Recording, Trace
from damperfit.simulation import Motion, simulate
from damperfit.uncertainty import assess
from tests.identification.rig import TIGHT, recording, trace

ALL = ("r_m1", "r_m2", "r_m3", "k_e", "f_f")
THREE = ("r_m1", "r_m2", "k_e")
# Of a standard error.
NEAR = 0.1


def misfit(logs: Sequence[Trace], free: tuple[str, ...] = THREE) -> Misfit:
    return Misfit(tuple(logs), PURDY_DAMPER, free, FitOptions().solver, 100, lambda: False)


def on_cycles(whole: Misfit) -> Misfit:
    cycles = settled(whole.traces, is_thinned=False)
    assert cycles is not None
    return replace(whole, cycles=cycles)


def logged(x: np.ndarray, v: np.ndarray, rate: float, setting: int = 10, seed: int = 3) -> Trace:
    """A log of a motion behind a second of it that is not in the log; 4 N and 3 um of noise."""
    lead, random = round(rate), np.random.default_rng(seed)
    force = simulate(
        reference_parameters(setting), PURDY_DAMPER, Motion(1.0 / rate, x, v), options=TIGHT
    ).force[lead:]
    n = len(force)
    return condition(
        Recording(
            name="log.csv",
            path="log.csv",
            sha256="",
            setting=setting,
            time=np.arange(n) / rate,
            displacement=x[lead:] + 3e-6 * random.standard_normal(n),
            force=force + 4.0 * random.standard_normal(n),
        ),
        ConditionOptions(centre=0.0),
    )


def drifting() -> Trace:
    """A damper that loses 4 % of its force while it is tested."""
    log = recording(10, noise=4.0)
    fade = np.linspace(1.0, 0.96, len(log.force))
    return condition(replace(log, force=log.force * fade))


def filtered_in_the_rig(kind: str) -> Trace:
    from damperfit.conditioning import apply_filter, design_filter
    from damperfit.conditioning.filters import completed

    log = recording(10, noise=4.0)
    design = design_filter("causal", 30.0, sample_rate=1000.0)
    if kind == "zero_phase":
        design = completed(design, 30.0, 4)
    x, f = apply_filter(design, np.stack([log.displacement, log.force]))
    options = ConditionOptions(rig_filter=kind, rig_filter_corner=30.0)
    return condition(replace(log, displacement=x, force=f), options)


def two_speeds() -> Trace:
    """Eight cycles at 0.1 m/s and twelve at 0.3 m/s, one after the other."""
    omega = np.where(np.arange(24_000) < 1000 + 16_085, 0.1 / 0.032, 0.3 / 0.032)
    angle = np.cumsum(omega) / 1000.0
    return logged(0.032 * np.sin(angle), 0.032 * omega * np.cos(angle), 1000.0)


def whole_cycles() -> Trace:
    """A cycle of 400 samples, which fall on the same places in all of them."""
    angle = 2.0 * np.pi * (np.arange(6600) + 0.37) / 400.0
    return logged(0.032 * np.sin(angle), 0.032 * 3.0 * np.pi * np.cos(angle), 600.0)


LOGS: dict[str, Callable[[], Sequence[Trace]]] = {
    "setting 1": lambda: [trace(1, noise=4.0)],
    "setting 10": lambda: [trace(10, noise=4.0)],
    "setting 20": lambda: [trace(20, noise=4.0, rate=500.0, seed=3)],
    "drift": lambda: [drifting()],
    "causal": lambda: [filtered_in_the_rig("causal")],
    "zero phase": lambda: [filtered_in_the_rig("zero_phase")],
    "two speeds": lambda: [two_speeds()],
    "two logs": lambda: [trace(10, noise=4.0, amplitude=a) for a in (0.032, 0.024)],
    "whole cycles": lambda: [whole_cycles()],
}


def apart(whole: Misfit, setting: int = 10) -> tuple[np.ndarray, float, float]:
    """How far both ways end apart, in errors; their misfits.

    On the logs the descent begins at the setting's truth: from afar it may end elsewhere.
    """
    start = reference_parameters(10).replace(
        {name: 1.2 * getattr(reference_parameters(10), name) for name in whole.free}
    )
    known = {name: getattr(reference_parameters(setting), name) for name in whole.free}
    slow, fast = descend(whole, start.replace(known)), descend(on_cycles(whole), start)
    errors = relative_errors(slow)
    found = [
        np.log(getattr(fast.parameters, name) / getattr(slow.parameters, name))
        for name in whole.free
    ]
    return np.abs(found) / errors, slow.mse_percent, fast.mse_percent


@pytest.mark.parametrize("free", [THREE, ALL], ids=["three", "five"])
@pytest.mark.parametrize("name", LOGS)
def test_the_parameters_are_those_of_the_logs_themselves(name: str, free: tuple[str, ...]) -> None:
    setting = int(name.removeprefix("setting ")) if name.startswith("setting") else 10
    distance, slow, fast = apart(misfit(LOGS[name](), free), setting)
    assert distance.max() < NEAR, distance
    assert fast == pytest.approx(slow, rel=1e-4)


def count_looks(seen: list[bool], monkeypatch: pytest.MonkeyPatch) -> None:
    """Note of each evaluation whether it is of the logs themselves."""

    def counted(looked: Misfit, *rest: object) -> object:
        seen.append(looked.cycles is None)
        return evaluate(looked, *rest)

    def pulled(looked: Misfit, *rest: object) -> object:
        seen.append(True)
        return step_of_logs(looked, *rest)

    step_of_logs = last_step_module._pulled
    monkeypatch.setattr("damperfit.identification.looks.evaluate", counted)
    monkeypatch.setattr(last_step_module, "_pulled", pulled)


@pytest.mark.parametrize("name", ["setting 1", "setting 10", "setting 20", "causal", "two logs"])
def test_one_look_at_the_logs_is_enough(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    one = on_cycles(misfit(LOGS[name]()))
    seen: list[bool] = []

    count_looks(seen, monkeypatch)
    truth = reference_parameters(10)
    found = descend(one, truth.replace({name: 1.5 * getattr(truth, name) for name in THREE}))
    assert sum(seen) == 1
    assert found.evaluations == len(seen)


@pytest.mark.parametrize("most", [1, 3, 5])
def test_a_limit_of_evaluations_is_kept(most: int, monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[bool] = []

    count_looks(seen, monkeypatch)
    truth = reference_parameters(10)
    one = replace(on_cycles(misfit([trace(10, noise=4.0)])), max_evaluations=most)
    found = descend(one, truth.replace({name: 3.0 * getattr(truth, name) for name in THREE}))
    assert seen == [False] * (most - 1) + [True]
    assert (found.evaluations, found.status) == (most, 0)


@pytest.mark.parametrize("name", ["setting 10", "whole cycles", "two speeds"])
def test_cycles_alone_tell_nearly_the_same(name: str) -> None:
    """Within half an error: what noise of the displacement does to a descent on the logs."""
    whole = misfit(LOGS[name](), ALL)
    start = reference_parameters(10)
    slow, rough = descend(whole, start), approach(on_cycles(whole), start)
    errors = relative_errors(slow)
    for one, error in zip(ALL, errors, strict=True):
        away = getattr(rough.parameters, one) / getattr(slow.parameters, one) - 1.0
        assert abs(away) < 0.75 * error, one


def test_a_sum_of_squares_on_the_cycles_is_that_of_the_logs() -> None:
    whole = misfit([trace(10, noise=4.0)], ALL)
    far = reference_parameters(10).replace({"r_m1": 2.6e4, "f_f": 80.0})
    slow, slopes, _ = evaluate(whole, far, 1.0)
    fast, few, _ = evaluate(on_cycles(whole), far, 1.0)
    assert fast @ fast == pytest.approx(slow @ slow, rel=1e-3)
    assert np.allclose(few.T @ few, slopes.T @ slopes, rtol=1e-2, atol=0.0)


def test_logs_that_do_not_repeat_are_fitted_as_before() -> None:
    log = trace(10, noise=4.0)
    moving = replace(log.stretches[0], kind="moving", cycle_starts=np.empty(0))
    assert settled([replace(log, stretches=(moving,))], is_thinned=False) is None


def test_cycles_that_cannot_be_simulated_leave_the_logs(monkeypatch: pytest.MonkeyPatch) -> None:
    one = on_cycles(misfit([trace(10, noise=4.0)]))

    def refused(looked: Misfit, *rest: object) -> object:
        if looked.cycles is not None:
            raise SimulationError("no")
        return evaluate(looked, *rest)

    monkeypatch.setattr("damperfit.identification.looks.evaluate", refused)
    found = descend(one, reference_parameters(10))
    assert found.parameters == descend(one.whole, reference_parameters(10)).parameters


@pytest.mark.parametrize(("away", "is_near"), [(0.0214, True), (0.0222, False)])
def test_a_step_of_two_per_cent_is_the_last(*, away: float, is_near: bool) -> None:
    """K_e is told to 30 % by a log of 200 N of noise: an error is no measure of what is linear.

    The step from 2.14 % away is 1.96 % long, from 2.22 % away 2.03 %.
    """
    whole = misfit([trace(1, noise=200.0, duration=10.0)], ("k_e",))
    slow = descend(whole, reference_parameters(1))
    near = slow.parameters.replace({"k_e": (1.0 + away) * slow.parameters.k_e})
    assert relative_errors(slow)[0] > 0.05
    found = last_step(whole, replace(slow, parameters=near), least_percent=0.0)
    assert (found is not None) is is_near


@pytest.mark.parametrize(("errors", "is_near"), [(0.97, True), (1.03, False)])
def test_a_step_of_one_error_is_the_last(*, errors: float, is_near: bool) -> None:
    whole = misfit([trace(10, noise=4.0, duration=10.0)], ("r_m1",))
    slow = descend(whole, reference_parameters(10))
    away = errors * relative_errors(slow)[0]
    near = slow.parameters.replace({"r_m1": (1.0 + away) * slow.parameters.r_m1})
    found = last_step(whole, replace(slow, parameters=near), least_percent=0.0)
    assert (found is not None) is is_near
    if found is not None:
        assert found.parameters.r_m1 == pytest.approx(slow.parameters.r_m1, rel=1e-6)


@pytest.mark.parametrize(("share", "looks"), [(0.98, 1), (1.02, 2)])
def test_a_step_of_half_a_per_cent_is_taken_unseen(share: float, looks: int) -> None:
    """K_e by so much beside the minimum of the mean cycle; the step ends within it."""
    cycles = on_cycles(misfit([trace(10, noise=4.0, duration=10.0)], ("k_e",)))
    cycles = replace(cycles, is_followed=True)
    there = descent._minimise(cycles, reference_parameters(10))
    there = descent.promised_step(cycles, there) or there
    off = there.parameters.replace({"k_e": there.parameters.k_e * math.exp(share * 0.005)})
    near = descent._on_cycles(cycles, off)
    assert near.evaluations == looks
    error = relative_errors(there)[0]
    assert abs(math.log(near.parameters.k_e / there.parameters.k_e)) < 0.05 * error


@pytest.mark.parametrize(("share", "is_unseen"), [(0.98, True), (1.02, False)])
def test_a_step_of_many_errors_is_looked_at_the_shorter_it_is_the_less(
    *, share: float, is_unseen: bool
) -> None:
    """Of a log without noise an error is so little that a step of a tenth of a per cent is far."""
    cycles = on_cycles(misfit([trace(10, noise=4.0, duration=10.0)], ("k_e",)))
    there = descent._minimise(cycles, reference_parameters(10))
    step = 3e-3
    cost = there.mse_percent / 100.0
    slope = there.jacobian[:, 0] @ there.jacobian[:, 0]
    many = (share * 0.05 / step) ** 2 * cost / (slope * step**2)
    beside = replace(there, gradient=np.array([-slope * step]), n_independent=many)
    found = last_step_module.promised_step(cycles, beside, leaves=last_step_module.LEAVES)
    assert (found is not None) is is_unseen


@pytest.mark.parametrize(("share", "looks"), [(0.97, 1), (1.03, 2)])
def test_a_step_of_two_per_cent_is_left_to_the_logs(share: float, looks: int) -> None:
    """Where no descent follows; of a log with so much noise that two per cent are no error."""
    cycles = on_cycles(misfit([trace(10, noise=200.0, duration=10.0)], ("k_e",)))
    there = descent._minimise(cycles, reference_parameters(10))
    there = descent.promised_step(cycles, there) or there
    off = there.parameters.replace({"k_e": there.parameters.k_e * math.exp(share * 0.02)})
    assert descent._on_cycles(cycles, off).evaluations == looks


@pytest.mark.parametrize(("share", "is_short"), [(0.98, True), (1.02, False)])
def test_a_third_of_an_error_is_left_to_the_logs(*, share: float, is_short: bool) -> None:
    cycles = on_cycles(misfit([trace(10, noise=4.0, duration=10.0)], ("k_e",)))
    there = descent._minimise(cycles, reference_parameters(10))
    step, cost = 0.015, there.mse_percent / 100.0
    slope = there.jacobian[:, 0] @ there.jacobian[:, 0]
    many = (share * 0.3 / step) ** 2 * cost / (slope * step**2)
    beside = replace(there, gradient=np.array([-slope * step]), n_independent=many)
    found = descent.promised_step(
        cycles, beside, longest=descent.FORESEEN, leaves=descent.LEAVES_TO_LOGS
    )
    assert (found is not None) is is_short


def test_a_way_that_is_not_known_well_is_not_handed_on() -> None:
    """A step of one per cent, some tenths of an error, is left where no descent follows."""
    cycles = on_cycles(misfit([trace(10, noise=30.0, duration=10.0)], ("k_e",)))
    there = descent._minimise(cycles, reference_parameters(10))
    off = there.parameters.replace({"k_e": there.parameters.k_e * math.exp(0.012)})
    alone, followed = descend(cycles, off), descend(replace(cycles, is_followed=True), off)
    assert alone.apart is None
    assert followed.apart is not None
    assert followed.evaluations == alone.evaluations + 1
    error = relative_errors(followed)[0]
    assert abs(math.log(alone.parameters.k_e / followed.parameters.k_e)) < 0.02 * error


def test_a_misfit_of_the_integrator_is_left_to_a_finer_one() -> None:
    whole = misfit([trace(10, noise=4.0)])
    near = descend(whole, reference_parameters(10))
    assert last_step(whole, near, least_percent=0.99 * near.mse_percent) is not None
    assert last_step(whole, near, least_percent=1.01 * near.mse_percent) is None


@pytest.mark.parametrize("procedure", ["paper", "joint", "plain"])
def test_every_procedure_gives_what_it_gives_on_logs(
    procedure: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    logs = [trace(setting, noise=4.0, rate=500.0) for setting in (1, 8, 15)]
    options = FitOptions(procedure=procedure)
    fast = identify(logs, PURDY_DAMPER, options)
    monkeypatch.setattr("damperfit.identification.campaign.settled", lambda *_, **__: None)
    slow = identify(logs, PURDY_DAMPER, options)
    known = assess(slow, PURDY_DAMPER).uncertainties
    for one, other, errors in zip(fast.fits, slow.fits, known, strict=True):
        assert one.outcome is other.outcome
        assert one.status == other.status
        assert one.mse_percent == pytest.approx(other.mse_percent, rel=1e-4)
        for name in ALL:
            away = abs(getattr(one.parameters, name) - getattr(other.parameters, name))
            interval = errors.intervals.get(name)
            size = abs(getattr(other.parameters, name))
            assert away < (1e-4 * size if interval is None else 0.5 * NEAR * interval.error), name


@pytest.mark.parametrize("name", ["setting 1", "setting 20", "causal", "zero phase", "two speeds"])
def test_the_pull_of_the_logs_is_their_residuals_times_their_derivatives(name: str) -> None:
    """The residuals back through the filter beside each derivative through it."""
    whole = misfit(LOGS[name](), ALL)
    found = last_step_module._pulled(whole, reference_parameters(10))
    residuals, slopes, is_cavitating = evaluate(whole, reference_parameters(10), whole.scale)
    assert np.allclose(found.residuals, residuals, rtol=0.0, atol=1e-12)
    sizes = np.linalg.norm(slopes, axis=0) * np.linalg.norm(residuals)
    assert np.max(np.abs(found.gradient - slopes.T @ residuals) / sizes) < 1e-4
    assert found.is_cavitating == is_cavitating


def test_the_transpose_of_a_filter_that_bridges_is_its_transpose():
    """Two bridged samples with one between, which counts for both."""
    design = replace(design_filter("zero_phase", 30.0, sample_rate=300.0), bridged=(200, 202, 350))
    random = np.random.default_rng(1)
    one, other = np.zeros((2, 600))
    one[150:450], other[150:450] = random.standard_normal((2, 300))
    forward = other @ apply_filter(design, one)
    assert one @ _back_through(design, other) == pytest.approx(forward, rel=1e-9)
