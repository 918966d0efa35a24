"""No flaw beyond reason, none of valves where nothing flows, none that contradicts another."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from damperfit.conditioning import condition
from damperfit.conditioning.gas_force import YIELDS, _shares, held_share
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.identification import FitOptions, identify
from damperfit.recording import Finding, Recording
from damperfit.uncertainty import Assessment, assess, objections
from damperfit.uncertainty.flaws import (
    _FLAWS,
    Hint,
    _as_stiffness,
    _held_flaw,
    _is_reasonable,
    _without_amount,
    seek_flaws,
    signatures,
)
from damperfit.uncertainty.linearisation import linearise_settings
from damperfit.uncertainty.residuals import Diagnosis, _fits_skew, _sentence, _warned, reconciled
from tests.identification import adjusted
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


@pytest.mark.parametrize(("amount", "is_named"), [
    (-168.0, True), (-170.0, False), (170.0, True),
])  # fmt: skip
def test_friction_is_nowhere_less_than_none(amount: float, *, is_named: bool) -> None:
    """Of 169 N of friction "220 N less at low speed" was named."""
    found = hint("friction_with_speed", amount)
    told = _without_amount(found, 169.0)
    assert (told == found) is is_named
    assert is_named or told.words == "friction that depends on velocity (less at low speed)"
    assert _without_amount(hint("offset", amount), 0.0).words == f"offset {amount:g}"


@pytest.mark.parametrize(("friction", "words"), [
    (21.0, "friction that depends on velocity (20 N less at low speed)"),
    (19.0, "friction that depends on velocity (less at low speed)"),
])  # fmt: skip
def test_a_fall_of_the_friction_is_held_against_what_was_found(friction, words) -> None:
    log = short_trace(1, reference_parameters(1), noise=4.0)
    (one,) = linearise_settings(identify([log], PURDY_DAMPER, PLAIN), PURDY_DAMPER)
    (seen,) = one.logs
    values = replace(one.fit.parameters, f_f=friction)
    (column,) = signatures(log, seen.force)["friction_with_speed"][:1]
    residuals = -20.0 * column
    missed = replace(
        one,
        fit=replace(one.fit, parameters=values),
        logs=(replace(seen, residuals=residuals),),
    )
    hints = seek_flaws(missed, float(np.mean((20.0 * column) ** 2)))
    assert words in {one.words for one in hints}


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


@pytest.mark.parametrize(
    ("share", "mse", "is_new"),
    [(0.39, 0.5, True), (0.41, 0.5, False), (math.nan, 0.5, True), (0.41, 0.99, False),
     (0.41, 1.01, True)],
)  # fmt: skip
def test_that_a_damper_yields_is_news_where_its_model_does_not_or_misses_it(
    share, mse, *, is_new
) -> None:
    told = diagnosis(1, held_share=0.6, modelled_share=share, mse_percent=mse)
    said = _sentence(told)
    assert ("the model misses that" in said) is is_new
    assert ("so does the model;" in said) is not is_new
    assert "holds 60 % of its force" in said


@pytest.mark.parametrize(("share", "is_new"), [(0.37, False), (0.36, True)])
def test_a_model_that_holds_nearly_what_the_log_does_misses_nothing(share, *, is_new) -> None:
    told = diagnosis(1, held_share=0.405, modelled_share=share, mse_percent=0.01)
    assert ("the model misses that" in _sentence(told)) is is_new


@pytest.mark.parametrize(("mse", "is_said"), [(0.99, False), (1.01, True)])
def test_that_a_damper_yields_is_said_beside_a_flaw_where_the_logs_are_not_met(
    mse, *, is_said
) -> None:
    told = diagnosis(1, hint("offset", 70.0), held_share=0.6, mse_percent=mse)
    said = _sentence(told)
    assert "offset 70" in said
    assert ("it yields before it slides" in said) is is_said


def test_a_law_with_blow_offs_holds_its_force_as_its_damper_does() -> None:
    seen = adjusted.log(adjusted.at(14, 3))
    fit = identify([seen], adjusted.DAMPER, FitOptions("plain"))
    (one,) = assess(fit, adjusted.DAMPER).diagnoses
    assert one.modelled_share == pytest.approx(one.held_share, abs=0.02)


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


def linearised(*findings: Finding) -> SimpleNamespace:
    log = SimpleNamespace(trace=SimpleNamespace(name="a.csv", findings=findings))
    return SimpleNamespace(fit=SimpleNamespace(logs=(log,)))


def test_a_delay_does_not_contradict_the_skew_found_in_the_log() -> None:
    together = linearised(Finding("skew", "note", "", 0.2e-3, "s"))
    assert _fits_skew(together, 1.19)
    assert not _fits_skew(together, 1.21)
    late = linearised(Finding("skew", "warning", "", 4e-3, "s"))
    assert _fits_skew(late, 7.9)
    assert not _fits_skew(late, 8.1)
    taken_back = linearised(Finding("skew", "note", "", 4e-3, "s", is_correction=True))
    assert not _fits_skew(taken_back, 4.0)
    assert _fits_skew(linearised(Finding("skew", "note", "cannot be determined", None, "s")), 20.0)


def test_noise_of_the_displacement_is_blamed_where_it_makes_a_third() -> None:
    noisy = linearised(Finding("displacement_noise", "warning", "noise"))
    third = diagnosis(1, noise_percent=0.334)
    assert _warned(noisy, third) == "; see the warning displacement_noise of a.csv"
    assert _warned(noisy, diagnosis(1, noise_percent=0.332)) == ""
    other = linearised(Finding("force_clipping", "warning", "clipped"))
    assert "force_clipping" in _warned(other, diagnosis(1, noise_percent=0.01))
    assert _warned(other, diagnosis(1, is_structured=False)) == ""


@pytest.mark.parametrize(
    ("changes", "family", "is_said"),
    [({"mse_percent": 1.01}, "", True), ({"mse_percent": 0.99}, "", False),
     ({"mse_percent": 4.0, "held_share": YIELDS}, "", False),
     ({"mse_percent": 4.0, "held_share": 0.99 * YIELDS}, "", True),
     ({"mse_percent": 4.0}, "v squared", False), ({"mse_percent": 0.5}, "position", True)],
)  # fmt: skip
def test_an_untold_direction_is_pointed_to_only_where_it_may_be_the_cause(
    changes, family, *, is_said
) -> None:
    untold = linearised(Finding("direction", "warning", "no gas force tells the strokes apart"))
    hints = (replace(hint("gas_pressure", 50.0), family=family),) if family else ()
    said = _warned(untold, diagnosis(1, *hints, **changes))
    assert ("see the warning direction" in said) is is_said


def test_an_assessment_without_settings_has_nothing_to_reconcile() -> None:
    assert reconciled(Assessment().diagnoses) == ()


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("delay", "a channel delay (the force is 2 ms late against the displacement)"),
        ("gas_pressure", "a wrong gas pressure (2 % more than configured)"),
        ("gas_exponent", "a wrong gas exponent (by 2 %)"),
        ("gas_volume", "a wrong gas or rod volume (2 N at full stroke)"),
        ("offset", "a force offset that is not in the model (2 N)"),
        ("friction_with_speed", "friction that depends on velocity (2 N more at low speed)"),
        ("compressibility", "a bulk modulus that changes with pressure (by 2 % at the peak force)"),
        ("valve_law_rebound", "the valve law in rebound (2 N at peak)"),
        ("valve_law_bump", "the valve law in bump (2 N at peak)"),
    ],
)
def test_a_flaw_of_size_two_is_told_in_its_own_unit(name, words) -> None:
    assert _FLAWS[name].words(2.0) == words


@pytest.mark.parametrize(("mse", "is_named"), [(0.999, True), (1.0, False)])
def test_of_a_law_that_does_not_fit_no_held_value_is_the_cause(mse: float, *, is_named) -> None:
    """A friction held too high was said to be held too low, where the law missed by 8 %."""
    log = short_trace(1, replace(reference_parameters(1), r_m3=1e6), noise=4.0)
    fitted = identify([log], PURDY_DAMPER, FitOptions("plain", fixed={"r_m3": 2.597e6}))
    (one,) = linearise_settings(fitted, PURDY_DAMPER)
    missed = replace(one, fit=replace(one.fit, mse_percent=mse))
    residuals = one.logs[0].residuals
    hints = seek_flaws(missed, float(np.mean(residuals**2)))
    assert ("r_m3" in {hint.name for hint in hints}) is is_named


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_tenth_of_the_speed_is_that_of_the_faster_stroke(sign, monkeypatch) -> None:
    asked = []

    def passed(_, __, speeds):
        asked.append(speeds)
        return None, 30.0 * np.array([1.0, -1.0]).reshape(2, 1, 1, 1) * np.ones((2, 2, 1, 1)), None

    monkeypatch.setattr("damperfit.conditioning.gas_force.in_both_strokes", passed)
    velocity = sign * np.array([-0.1, 0.0, 0.4])
    assert _shares(velocity, np.array([[0.0, 50.0, 120.0]])) == pytest.approx(0.5)
    assert asked == [(pytest.approx(0.04),)]


@pytest.mark.parametrize(
    ("is_shared", "family", "words"),
    [
        (False, "a held parameter", "r_m3 held at a wrong value, too low"),
        (True, "a shared parameter", "r_m3 is shared by all settings and here too low"),
    ],
)
def test_a_parameter_that_was_not_fitted_is_named_with_whose_it_is(is_shared, family, words):
    flaw = _held_flaw("r_m3", is_shared=is_shared)
    assert (flaw.name, flaw.family, flaw.words(1.0)) == ("r_m3", family, words)
    assert flaw.words(-1.0) == words.replace("low", "high")
