"""Friction that is larger at rest gives way to what a law supposes of oil and returns."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import pytest

from damperfit.damper.friction import Friction
from damperfit.damper.mounting import FIT, Mounting
from damperfit.laws import as_good, search_laws, supposed
from damperfit.laws.as_good import does_as_well
from damperfit.laws.choosing import AS_GOOD
from damperfit.laws.supposed import with_supposed_told
from damperfit.laws.variants import BLEED
from damperfit.run.auto_model import _softest_and_stiffest
from damperfit.simulation import SolverOptions
from tests.laws.joint_rates import drawn, evidence_of
from tests.laws.rates import known_of, verdict_on
from tests.laws.valve_logs import damper

PLAIN = replace(damper(), rebound=BLEED, compression=BLEED, mounting=Mounting(FIT))
RUBBING = replace(PLAIN, friction=Friction(breakaway=FIT, stribeck_speed=FIT))


def fit(mse: float, left: float = 0.5, model=RUBBING, free=(), held: float = math.nan):
    return SimpleNamespace(
        fits=(SimpleNamespace(model=model, free=free),), mse_percent=mse, left_over=left,
        held_out_percent=held,
        leaves_something=left > 1.0, score=math.log(mse),
    )  # fmt: skip


@pytest.mark.parametrize(("mse", "before", "left", "goes"), [
    (1.019, 0.5, 0.99, True), (1.021, 0.5, 0.99, False),
    (1.0, 2.0, 2.03, True), (1.0, 2.0, 2.05, False), (1.0, 0.5, 1.01, False),
])  # fmt: skip
def test_with_fewer_numbers_it_must_be_as_good(monkeypatch, mse, before, left, goes) -> None:
    monkeypatch.setattr(as_good, "needed_at", lambda *_: "")
    course = SimpleNamespace(elsewhere=(), solver=None)
    assert does_as_well(course, fit(1.0, before), fit(mse, left), factor=AS_GOOD)[0] is goes


@pytest.mark.parametrize(("held", "goes"), [(1.09, True), (1.11, False), (math.nan, True)])
def test_what_was_held_out_is_predicted_no_worse(monkeypatch, held, goes) -> None:
    monkeypatch.setattr(as_good, "needed_at", lambda *_: "")
    course = SimpleNamespace(elsewhere=(), solver=None)
    assert does_as_well(course, fit(1.0, held=1.0), fit(1.0, held=held))[0] is goes


def test_what_another_setting_needs_stays(monkeypatch) -> None:
    monkeypatch.setattr(as_good, "needed_at", lambda *_: "setting 4 needs it")
    course = SimpleNamespace(elsewhere=(1,), solver=None)
    assert does_as_well(course, fit(1.0), fit(0.5)) == (False, "setting 4 needs it")


def test_the_better_of_both_is_taken_and_the_rest_is_asked_again(monkeypatch) -> None:
    monkeypatch.setattr(as_good, "needed_at", lambda *_: "")
    monkeypatch.setattr(supposed, "freed_of", lambda _: ("free_gas",))
    ends = {"return_slope": 0.9, "k_e": 0.8}
    said, law = [], fit(1.0)
    course = SimpleNamespace(
        elsewhere=(), solver=None, more=["free_gas"],
        fitted=lambda model, *, freed, **_: fit(ends[freed[-1]], model=model, free=freed),
        record=lambda *_, is_taken, change: said.append((change, is_taken)),
        asked_again=lambda one, parts: (one.mse_percent, one.fits[0].free, parts),
    )  # fmt: skip
    assert with_supposed_told(course, law) == (0.8, ("free_gas", "k_e"), ["free_gas"])
    rest = "friction that is larger at rest"
    assert said == [
        (f"with return checks for {rest}", True),
        (f"with bulk modulus of oil and chamber for {rest}", True),
    ]
    ends["k_e"] = 0.95
    assert with_supposed_told(course, law)[0] == 0.9
    assert [is_taken for _, is_taken in said[2:]] == [True, False]  # the first does so better
    both = fit(1.0, free=("return_slope", "k_e"))
    assert with_supposed_told(course, both) is both
    course.fitted = lambda *_, **__: None
    assert with_supposed_told(course, law) is law
    plain = fit(1.0, model=PLAIN)
    assert with_supposed_told(course, plain) is plain


@pytest.mark.slow
@pytest.mark.parametrize("place", [112, 205])
def test_dampers_whose_oil_or_returns_are_others_have_no_friction_at_rest(place: int) -> None:
    one = drawn(place, 1)
    evidence = evidence_of(one, 1000 + place)
    compared = _softest_and_stiffest(evidence)
    elsewhere = [logs for logs in evidence if logs not in compared]
    found = search_laws(*known_of(one), compared, solver=SolverOptions(), elsewhere=elsewhere)
    assert "larger" not in verdict_on(one, found)
