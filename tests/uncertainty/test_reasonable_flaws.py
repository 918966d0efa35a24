"""No flaw beyond reason, none of valves where nothing flows, none that contradicts another."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from damperfit.conditioning import condition
from damperfit.conditioning.gas_force import YIELDS, held_share
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.identification import FitOptions, identify
from damperfit.recording import Recording
from damperfit.uncertainty import assess, objections
from damperfit.uncertainty.flaws import (
    Hint,
    _as_stiffness,
    _is_reasonable,
)
from damperfit.uncertainty.residuals import Diagnosis, reconciled
from tests.identification.rig import recording, short_trace

PLAIN = FitOptions("plain", ("r_m1", "r_m2", "k_e", "f_f"), {"r_m3": 2.597e6})


def hint(name: str, amount: float, share: float = 0.9) -> Hint:
    return Hint(name, "", share, amount, f"{name} {amount:g}")


@pytest.mark.parametrize(
    ("name", "largest"),
    [
        ("delay", 25.0),
        ("gas_pressure", 100.0),
        ("gas_exponent", 50.0),
        ("compressibility", 300.0),
        ("offset", 700.0),
        ("gas_volume", 700.0),
        ("friction_with_speed", 700.0),
        ("valve_law_rebound", 700.0),
        ("valve_law_bump", 700.0),
        ("r_m3", 1000.0),
    ],
)
def test_an_amount_beyond_reason_is_no_cause(name: str, largest: float) -> None:
    half_range = 700.0
    for sign in (1.0, -1.0):
        assert _is_reasonable(hint(name, sign * largest), half_range)
        assert not _is_reasonable(hint(name, sign * 1.001 * largest), half_range)


@pytest.mark.parametrize(
    ("amount", "said"),
    [
        (49.0, ""),  # an exponent that a gas may have
        (51.0, "about 1.5 times as stiff"),
        (399.0, "about 5 times as stiff"),
        (401.0, ""),
        (-79.0, "about 0.21 times as stiff"),
        (-81.0, ""),
    ],
)
def test_an_exponent_that_no_gas_has_is_another_gas_spring(amount: float, said: str) -> None:
    found = _as_stiffness(hint("gas_exponent", amount))
    assert found.name == ("gas_stiffness" if said else "gas_exponent")
    assert said in found.words
    assert _is_reasonable(found, 700.0) is (bool(said) or abs(amount) < 50.0)
    assert _as_stiffness(hint("gas_volume", amount)).name == "gas_volume"


def test_a_gas_spring_of_twice_the_stiffness_is_named_and_costs_the_grade() -> None:
    short = replace(PURDY_DAMPER, gas_length=0.025)
    campaign = identify([short_trace(1, damper=short, noise=4.0)], PURDY_DAMPER, PLAIN)
    judged = assess(campaign, PURDY_DAMPER)
    (one,) = judged.diagnoses
    assert one.hints[0].name == "gas_stiffness"
    times = 1.0 + one.hints[0].amount / 100.0
    assert 1.5 < times < 2.5
    (fit,) = campaign.fits
    assert fit.mse_percent < 0.2  # excellent by the MSE, and K_e is off by a factor
    assert fit.parameters.k_e < 0.5 * reference_parameters(1).k_e
    (why,) = objections(campaign, judged)[fit.setting]
    assert why.kind == "dimensions"


def yielding(hold: float, noise: float = 2.0) -> Recording:
    """A log of what slides at 600 N once it has given by 1 mm, over a little of the speed."""
    log = recording(5, noise=noise, duration=6.0)
    angle = 2.0 * np.pi * 1.5 * log.time
    columns = np.stack([np.sin(angle), np.cos(angle)], axis=1)
    a, b = np.linalg.lstsq(columns, log.displacement, rcond=None)[0]
    x = columns @ (a, b)
    v = 2.0 * np.pi * 1.5 * (a * np.cos(angle) - b * np.sin(angle))
    held, state = np.empty(len(x)), 0.0
    for k, step in enumerate(np.diff(x, prepend=x[0])):
        state = float(np.clip(state + step / 1e-3, -1.0, 1.0))
        held[k] = state
    rest = log.force.mean()
    return replace(log, force=600.0 * (hold * held + (1.0 - hold) * v / 0.3) + rest)


def test_a_damper_that_yields_is_said_to_and_no_valve_is_blamed() -> None:
    seen = condition(yielding(0.8))
    assert held_share(seen) > 0.6
    (one,) = assess(identify([seen], PURDY_DAMPER, PLAIN), PURDY_DAMPER).diagnoses
    assert one.is_structured
    assert one.has_yielded
    assert not {"delay", "compressibility", "gas_pressure"} & {h.name for h in one.hints}
    assert "it yields before it slides" in one.sentence


def test_from_which_share_on_it_yields() -> None:
    below = held_share(condition(yielding(0.30, noise=0.0)))
    above = held_share(condition(yielding(0.37, noise=0.0)))
    assert YIELDS - 0.08 < below < YIELDS <= above < YIELDS + 0.08
    assert held_share(condition(recording(1, duration=6.0))) < 0.2
    assert math.isnan(held_share(SimpleNamespace(stretches=())))
    # Motion that does not repeat shows it too.
    seen = condition(yielding(0.8))
    moving = tuple(replace(one, cycle_starts=np.empty(0)) for one in seen.stretches)
    assert held_share(replace(seen, stretches=moving)) == held_share(seen) > 0.6


def diagnosis(setting: int, *hints: Hint, **changes: object) -> Diagnosis:
    told = Diagnosis(setting, 1.0, 0.1, True, 0.9, 0.3, hints, "")
    return replace(told, **changes)


def test_causes_of_one_run_do_not_contradict_each_other() -> None:
    late, early = hint("delay", 3.0), hint("delay", -2.0)
    valve = hint("valve_law_bump", 50.0)
    divided = reconciled([diagnosis(1, late), diagnosis(2, late), diagnosis(3, early, valve)])
    assert [one.hints for one in divided] == [(), (), (valve,)]
    assert "its cause was not found" in divided[0].sentence
    assert "as from valve_law_bump 50" in divided[2].sentence
    most = reconciled([*(diagnosis(k, late) for k in (1, 2, 3)), diagnosis(4, early)])
    assert [one.hints for one in most] == [(late,)] * 3 + [()]
    # What each setting may have for itself stands in any sign.
    own = (diagnosis(1, valve), diagnosis(2, hint("valve_law_bump", -50.0)))
    assert reconciled(own) == own
