"""A grade is withheld where a low MSE cannot excuse what was found; each limit from both sides."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from damperfit.conditioning import GasFacts
from damperfit.damper.cavitation import Cavitation
from damperfit.damper.model import values_type
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.quantity import Quantity
from damperfit.identification import Fit, Status
from damperfit.recording import Finding
from damperfit.uncertainty import Assessment, Diagnosis, objections
from damperfit.uncertainty.flaws import Hint
from damperfit.uncertainty.grades import LIMITS, jump_ratio, offset_mismatch
from tests import fakes
from tests.fakes import campaign

GAS = GasFacts(
    rod_area=PURDY_DAMPER.rod_area,
    pressure=PURDY_DAMPER.gas_pressure,
    volume=PURDY_DAMPER.gas_volume,
    exponent=PURDY_DAMPER.gas_exponent,
)


def fit(setting: int) -> Fit:
    return fakes.fit(setting, mse=0.05)


def told(mse: float = 0.05, noise: float = 0.001, *, misses: bool = True) -> Diagnosis:
    return Diagnosis(1, mse, noise, misses, 0.9, 0.3, (), "")


def kinds(one: Fit, seen: Diagnosis | None = None, gas: GasFacts | None = None) -> list[str]:
    assessment = Assessment(diagnoses=() if seen is None else (replace(seen, setting=one.setting),))
    found = objections(campaign(one), assessment, gas)
    return [reason.kind for reason in found.get(one.setting, ())]


def having(**values: float) -> Fit:
    one = fit(1)
    return replace(one, parameters=replace(one.parameters, **values))


def test_a_sound_fit_keeps_its_grade() -> None:
    assert kinds(fit(1), told(0.01, 0.0099, misses=False), GAS) == []


@pytest.mark.parametrize(
    ("k_e", "is_oil"), [(2.99e7, False), (3.01e7, True), (2.99e9, True), (3.01e9, False)]
)
def test_a_bulk_modulus_that_no_oil_has(k_e: float, *, is_oil: bool) -> None:
    assert kinds(having(k_e=k_e)) == ([] if is_oil else ["beyond"])
    if not is_oil:
        one = having(k_e=k_e)
        (reason,) = objections(campaign(one), Assessment())[one.setting]
        assert "is beyond 30 to 3000 MPa: oil has 1500 MPa" in reason.sentence
    # What was held, or is not told, is no finding.
    for status in (Status.FIXED, Status.NOT_IDENTIFIABLE):
        one = having(k_e=k_e)
        assert kinds(replace(one, status={**one.status, "k_e": status})) == []


def test_a_quantity_at_its_bound_is_told_with_the_limit() -> None:
    one = having(r_m1=10.0)
    one = replace(one, status={**one.status, "r_m1": Status.AT_BOUND})
    (reason,) = objections(campaign(one), Assessment())[one.setting]
    assert (reason.kind, reason.quantity) == ("bound", "r_m1")
    assert "R_m1 is at a bound of its range (below 10 " in reason.sentence


@pytest.mark.parametrize(
    ("repeats", "noise", "is_withheld"),
    [
        (0.201, 0.201 / 30.1, True),
        (0.201, 0.201 / 29.9, False),
        (0.199, 0.199 / 100.0, False),
        (0.5, 0.0, True),
    ],
)
def test_what_repeats_many_times_the_noise(
    repeats: float, noise: float, *, is_withheld: bool
) -> None:
    assert (LIMITS.times_noise, LIMITS.misfit_percent) == (30.0, 0.2)
    found = kinds(fit(1), told(repeats + noise, noise))
    assert found == (["misfit"] if is_withheld else [])


@pytest.mark.parametrize("channel", ["force", "displacement"])
@pytest.mark.parametrize(("share", "is_withheld"), [(4.1, True), (3.9, False)])
def test_a_log_of_which_much_is_clipped(channel: str, share: float, *, is_withheld: bool) -> None:
    one = fit(1)
    log = one.logs[0]
    cut = Finding(f"{channel}_clipping", "warning", "is clipped", share, "%")
    trace = replace(log.trace, name="cut.csv", findings=(*log.trace.findings, cut))
    one = replace(one, logs=(log._replace(trace=trace),))
    assert kinds(one, told(misses=False)) == (["clipping"] if is_withheld else [])
    if is_withheld:
        (reason,) = objections(campaign(one), Assessment())[one.setting]
        assert reason.sentence == (
            f"the {channel} of cut.csv is clipped at 4.1 % of its samples: the numbers lack "
            "what was cut off"
        )


@pytest.mark.parametrize(("share", "is_withheld"), [(0.051, True), (0.049, False)])
def test_cavitation_that_nothing_speaks_for(share: float, *, is_withheld: bool) -> None:
    one = replace(fit(1), cavitation=Cavitation(fraction=share, lowest_pressure=0.0, chamber=2))
    assert kinds(one, told()) == (["cavitation"] if is_withheld else [])
    # A model that meets the log to its noise is believed; so is a low MSE whose noise is unknown.
    assert kinds(one, told(misses=False)) == []
    assert kinds(replace(one, mse_percent=0.19)) == []
    assert kinds(replace(one, mse_percent=0.21)) == (["cavitation"] if is_withheld else [])


def test_an_offset_far_from_that_of_the_log() -> None:
    one = fit(1)  # its force at no speed is that of the gas: the log shows an offset of nothing
    far, seen = offset_mismatch(having(f_0=100.0), "f_0", GAS)
    assert seen == pytest.approx(0.0, abs=3.0)
    limit = (100.0 - seen) / far
    assert 30.0 < limit < 60.0  # a quarter of the gas force and what the level may be wrong by
    assert kinds(having(f_0=seen + 1.02 * limit), told(), GAS) == ["offset"]
    assert kinds(having(f_0=seen + 0.98 * limit), told(), GAS) == []
    assert kinds(having(f_0=seen - 1.02 * limit), told(), GAS) == ["offset"]
    assert kinds(having(f_0=100.0), told(misses=False), GAS) == []
    assert kinds(having(f_0=100.0), told()) == []
    # A fit that leaves nothing to explain knows the offset better than the level does.
    nothing = LIMITS.nothing_percent
    assert kinds(replace(having(f_0=100.0), mse_percent=1.05 * nothing), told(), GAS) == ["offset"]
    assert kinds(replace(having(f_0=100.0), mse_percent=0.95 * nothing), told(), GAS) == []
    (reason,) = objections(
        campaign(having(f_0=-218.0)),
        Assessment(diagnoses=(replace(told(), setting=one.setting),)),
        GAS,
    )[one.setting]
    assert reason.sentence == f"f_0 is -218 N where the log shows {seen:.0f} N"


def rubbing(friction: float) -> Fit:
    """A fit of a log whose force has a jump of twice the friction at each reversal, no more."""
    one = fit(1)
    (log,) = one.logs
    trace = log.trace
    force = friction * np.sign(trace.velocity)
    (whole,) = trace.stretches
    long = replace(whole, first=20, stop=980)
    trace = replace(trace, force=force, stretches=(long,))
    return replace(one, logs=(log._replace(trace=trace),))


@pytest.mark.parametrize(("ratio", "is_withheld"), [(1.26, True), (1.24, False)])
def test_friction_beyond_the_jump_at_the_reversals(ratio: float, *, is_withheld: bool) -> None:
    one = rubbing(50.0 / ratio)
    assert jump_ratio(one, 50.0) == pytest.approx(ratio, rel=1e-6)
    assert kinds(one, told()) == (["friction"] if is_withheld else [])
    assert kinds(one, told(misses=False)) == []


def lagging(one: Fit, lag: float) -> Fit:
    late = Quantity("lag", "T", "", "", "s", (1e-5, 5e-2))
    values = values_type((*one.parameters.quantities, late))(*one.parameters.numbers, lag)
    return replace(one, parameters=values)


def test_a_late_jump_is_that_of_a_late_friction() -> None:
    one = rubbing(50.0)
    (log,) = one.logs
    trace = log.trace
    lag, force = 0.008, trace.force.copy()
    for k in range(1, len(force)):  # the slow twin: T g' + g = f, f a line between two samples
        before, now = trace.force[k - 1 : k + 1]
        behind = lag * (now - before) / trace.interval
        force[k] = now - behind + np.exp(-trace.interval / lag) * (force[k - 1] - before + behind)
    late = lagging(replace(one, logs=(log._replace(trace=replace(trace, force=force)),)), lag)
    assert jump_ratio(late, 50.0) == pytest.approx(1.0, rel=1e-6)
    assert jump_ratio(late, 70.0) == pytest.approx(1.4, rel=1e-6)
    for short in (0.0, 1e-6, 1e-5):  # the shortest leaves nothing of the sample before
        assert jump_ratio(lagging(one, short), 50.0) == pytest.approx(1.0, rel=1e-3)


def of_gas(name: str = "gas_volume", share: float = 0.95) -> Hint:
    return Hint(name, "position", share, 29.0, "a wrong gas or rod volume (29 N at full stroke)")


def about_dimensions(*seen: Diagnosis, assumed: str = "") -> list[tuple[object, str]]:
    fits = [replace(fakes.fit(k), mse_percent=one.mse_percent) for k, one in enumerate(seen, 1)]
    diagnoses = tuple(
        replace(one, setting=fit.setting) for one, fit in zip(seen, fits, strict=True)
    )
    found = objections(campaign(*fits), Assessment(diagnoses=diagnoses), assumed=assumed)
    return [
        (setting, one.sentence)
        for setting, why in found.items()
        for one in why
        if one.kind == "dimensions"
    ]


@pytest.mark.parametrize(
    ("mse", "noise", "hints", "is_withheld"),
    [
        (0.05, 0.001, (of_gas(),), True),
        (0.05, 0.001, (of_gas("gas_stiffness"),), True),
        (0.05, 0.001, (of_gas(share=0.89),), False),
        (0.05, 0.001, (of_gas("offset"),), False),
        (0.05, 0.001, (), False),
        (0.0201, 0.0006, (of_gas(),), True),
        (0.0199, 0.0006, (of_gas(),), False),  # too little to mind
        (0.05, 0.05 / 31.1, (of_gas(),), True),
        (0.05, 0.05 / 30.9, (of_gas(),), False),
        (0.05, float("nan"), (of_gas(),), False),
    ],
)
def test_a_misfit_of_another_gas_spring_or_rod(mse, noise, hints, *, is_withheld: bool) -> None:
    said = about_dimensions(replace(told(mse, noise), hints=hints))
    assert bool(said) is is_withheld
    if said:
        assert "the rest is as from a wrong gas or rod volume (29 N at full stroke)" in said[0][1]


ASSUMED = "[damper] is not declared, and with the dimensions of a generic damper"


@pytest.mark.parametrize(("mse", "is_withheld"), [(0.0201, True), (0.0199, False)])
def test_a_misfit_with_dimensions_that_nobody_gave(mse: float, *, is_withheld: bool) -> None:
    seen = told(mse, mse / 40.0)
    assert about_dimensions(seen) == []
    said = about_dimensions(seen, told(0.005, 0.0049, misses=False), assumed=ASSUMED)
    assert [setting for setting, _ in said] == ([1] if is_withheld else [])
    if said:
        assert said[0][1].startswith(f"{ASSUMED} the MSE is 0.02 %, of which only")
