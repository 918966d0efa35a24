"""A setting whose logs take its friction for a preload has that of the other settings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from damperfit.conditioning import condition
from damperfit.damper.mounting import FIT, Mounting
from damperfit.identification import Campaign, Fit, FitOptions, identify
from damperfit.identification.descent import Misfit
from damperfit.identification.one_friction import with_one_friction
from damperfit.identification.outcome import Status
from damperfit.recording import Recording
from damperfit.simulation import SolverOptions, simulate
from damperfit.tested.setting import Setting
from tests.laws.valve_logs import VALUES, damper, moved

MODEL = replace(damper(), mounting=Mounting(FIT))


def logged(setting: int, friction: float):
    known = {k: v for k, v in VALUES.items() if k in MODEL.names} | {"f_f": friction}
    motion = moved((0.15,), cycles=3)
    force = simulate(MODEL.values(known), MODEL, motion).force
    noise, n = np.random.default_rng(setting), len(force)
    return condition(
        Recording(
            name=f"{setting}.csv", path="", sha256="", setting=Setting.of(setting),
            time=motion.interval * np.arange(n),
            displacement=motion.displacement + noise.normal(0.0, 3e-6, n),
            force=force + noise.normal(0.0, 2.0, n),
        )
    )  # fmt: skip


@pytest.fixture(scope="module")
def fits() -> dict[int, Fit]:
    """Settings 1 to 3 of a damper with 20 N, and setting 4 of one with 60 N."""
    logs = [logged(k, 60.0 if k == 4 else 20.0) for k in (1, 2, 3, 4)]
    found = identify(logs, MODEL, FitOptions("plain"))
    return {int(fit.setting.number() or 0): fit for fit in found.fits}


def misfit_of(fit: Fit) -> Misfit:
    traces = tuple(one.trace for one in fit.logs)
    free = tuple(name for name, status in fit.status.items() if status is not Status.FIXED)
    return Misfit(traces, MODEL, free, SolverOptions(), 100, lambda: False)


def settled(*fits: Fit) -> list[Fit]:
    found = with_one_friction(Campaign("plain", fits), misfit_of, jobs=1)
    return list(found.fits)


def told(fit: Fit, friction: float, status: Status = Status.FITTED) -> Fit:
    """As if the fit had ended there under the same misfit."""
    parameters = fit.parameters.replace({"f_f": friction})
    return replace(fit, parameters=parameters, status={**fit.status, "f_f": status})


@pytest.mark.parametrize("status", [Status.FITTED, Status.ABSENT])
def test_a_friction_that_fits_as_well_is_that_of_the_others(fits, status) -> None:
    wrong = told(fits[3], 0.001, status)
    *same, found = settled(fits[1], fits[2], wrong)
    assert same == [fits[1], fits[2]]
    assert found.status["f_f"] is Status.FIXED
    assert found.parameters.f_f == pytest.approx(20.0, rel=0.05)
    assert found.parameters.rebound_opening == pytest.approx(VALUES["rebound_opening"], rel=0.03)
    assert sum("is that of the other settings, " in said for said in found.warnings) == 1


def test_a_friction_that_the_logs_tell_stays(fits) -> None:
    assert fits[4].parameters.f_f == pytest.approx(60.0, rel=0.05)
    found = settled(fits[1], fits[2], fits[4])[-1]
    assert found.status["f_f"] is Status.FITTED
    assert found.parameters.f_f == fits[4].parameters.f_f


@pytest.mark.parametrize(("times", "is_held"), [(1.49, False), (1.51, True)])
def test_frictions_that_are_alike_stay(fits, times, is_held) -> None:
    friction = fits[2].parameters.f_f
    found = settled(told(fits[1], friction), fits[2], told(fits[3], times * friction))[-1]
    assert (found.status["f_f"] is Status.FIXED) is is_held


def test_two_that_agree_are_needed_and_more_than_differ(fits) -> None:
    odd = told(fits[2], 0.5), told(fits[3], 0.001)
    assert settled(fits[1], *odd) == [fits[1], *odd]
    assert settled(fits[1], odd[0]) == [fits[1], odd[0]]
    none = told(fits[3], 0.001, Status.ABSENT)
    assert settled(fits[1], none) == [fits[1], none]
    *same, one, other = settled(fits[1], fits[2], odd[1], replace(none, setting=Setting.of(5)))
    assert [fit.status["f_f"] for fit in same] == [Status.FITTED] * 2
    assert one.status["f_f"] is other.status["f_f"] is Status.FIXED


@pytest.mark.parametrize(("times", "is_held"), [(1.155, True), (1.168, False)])
def test_a_stretch_counts_as_twenty_samples(fits, times, is_held) -> None:
    """20 ln 1.1616 is ln 20: what one quantity costs."""
    wrong = told(fits[3], 0.001)
    best = settled(fits[1], fits[2], wrong)[-1].mse_percent
    found = settled(fits[1], fits[2], replace(wrong, mse_percent=best / times))[-1]
    assert (found.status["f_f"] is Status.FIXED) is is_held
