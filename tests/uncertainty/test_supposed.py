"""What a fit supposes and nobody has measured is in the intervals: defaults, forms of friction."""

import math
from dataclasses import replace

import numpy as np
import pytest

from damperfit.damper.mounting import _SPREAD, Friction, with_pressed_seal
from damperfit.identification import FitOptions, identify
from damperfit.uncertainty import assess
from damperfit.uncertainty.covariance import linearise_at_fit
from tests.identification import adjusted

DAMPER = adjusted.DAMPER
DRAG = DAMPER.quantity("drag").ignorance
VALVES = ("rebound_bleed", "rebound_opening", "rebound_slope", "compression_bleed")
# Beside its default by next to nothing: a number that somebody has given.
MEASURED = {"return_slope": 1.0001 * DAMPER.quantity("return_slope").default}


def fitted(*logs, model=DAMPER, **fixed):
    is_alone = len(logs) == 1
    follows = {} if is_alone else adjusted.FOLLOWS
    how = "plain" if is_alone else "joint"
    return identify(logs, model, FitOptions(how, fixed=MEASURED | fixed, follows=follows))


def intervals(campaign):
    return assess(campaign, DAMPER).uncertainties[0].intervals


@pytest.fixture(scope="module")
def log():
    return adjusted.log(adjusted.at(14, 3), drag=1.5 * DRAG)


@pytest.fixture(scope="module")
def alone(log):
    campaign = fitted(log)
    return campaign, intervals(campaign)


def test_an_interval_reaches_as_far_as_one_error_of_each_supposition_moves_the_fit(log, alone):
    values, found = alone[0].fits[0].parameters, alone[1]
    dragged = fitted(log, drag=DRAG).fits[0].parameters
    model, area = with_pressed_seal(DAMPER, values)[0], 3e-6
    pressed = fitted(log, model=model, seal_area=area).fits[0].parameters
    at_rest = {"f_f": area * DAMPER.gas_pressure}
    for name in (*VALVES, "f_f"):
        value = getattr(values, name)
        ends = getattr(dragged, name), getattr(pressed, name) + at_rest.get(name, 0.0)
        moved = math.hypot(*(math.log(end / value) for end in ends))
        assert found[name].misfit / value == pytest.approx(moved, rel=0.25, abs=2e-4), name
    assert found["rebound_slope"].misfit > 2.0 * found["rebound_slope"].error


def test_what_somebody_has_given_leaves_no_doubt_but_of_the_form_of_friction(log, monkeypatch):
    campaign = fitted(log, drag=1.5 * DRAG)
    assert all(one.misfit > 0.0 for one in intervals(campaign).values())
    monkeypatch.setattr("damperfit.uncertainty.covariance.other_turns", lambda *_: ())
    assert all(one.misfit > 0.0 for one in intervals(campaign).values())
    monkeypatch.setattr("damperfit.uncertainty.covariance.with_pressed_seal", lambda *_: None)
    assert {one.misfit for one in intervals(campaign).values()} == {0.0}


def test_a_seal_that_the_pressure_presses_is_within_the_intervals() -> None:
    at, area = adjusted.at(14, 3), 5e-6
    damper = replace(DAMPER, friction=Friction(seal_area="fit"))
    found = intervals(fitted(adjusted.log(at, damper=damper, seal_area=area)))
    truth = adjusted.numbers(at)
    truth |= {"f_f": adjusted.TRUTH["f_f"] + area * damper.gas_pressure}
    for name in (*VALVES, "f_f"):
        assert found[name].low < truth[name] < found[name].high, name
    opening = found["rebound_opening"]
    middle = math.sqrt(opening.low * opening.high)
    assert abs(truth["rebound_opening"] - middle) > 3.0 * opening.error


def test_a_setting_without_friction_supposes_as_many_forms_as_the_others(log, alone) -> None:
    fits = fitted(log, f_f=0.0).fits[0], alone[0].fits[0]
    shapes = {linearise_at_fit(fit, DAMPER).supposed.shape for fit in fits}
    assert len(shapes) == 1


def test_transients_of_a_chamber_that_empties_and_refills_are_judged() -> None:
    low = replace(DAMPER, gas_pressure=1.2e5)
    known = {"return_slope": 8e6}
    log = adjusted.log(adjusted.at(14, 3), damper=low, speeds=(0.05, 0.2), cycles=1, **known)
    (fit,) = identify([log], low, FitOptions("plain", fixed=known)).fits
    assert fit.cavitation.fraction > 0.0
    assert not any(one.n_cycles for one in log.segments)
    assert np.isfinite(linearise_at_fit(fit, low).supposed).all()


def test_it_is_wrong_by_the_same_at_all_settings() -> None:
    logs = [adjusted.log(one, drag=1.5 * DRAG) for one in adjusted.SETTINGS]
    few, many = (intervals(fitted(*some))["rebound_slope"] for some in (logs[:2], logs))
    for interval in (few, many):
        assert interval.low < adjusted.TRUTH["rebound_slope"] < interval.high
    assert many.misfit == pytest.approx(few.misfit, rel=0.3)  # four settings know no more than two


def test_the_offset_that_each_log_has_for_itself_is_as_uncertain_as_any_other_number() -> None:
    setting = adjusted.at(14, 3)
    speeds = {"slow": (0.05, 0.1), "fast": (0.1, 0.2)}
    logs = [replace(adjusted.log(setting, speeds=v), name=name) for name, v in speeds.items()]
    (fit,) = identify(logs, DAMPER, FitOptions("plain", fixed=MEASURED)).fits
    apart = [
        one._replace(trace=replace(one.trace, tare=by))
        for one, by in zip(fit.logs, (-2.0, 2.0), strict=True)
    ]
    tied, free = (linearise_at_fit(replace(fit, logs=x), DAMPER) for x in (fit.logs, apart))
    beside = np.repeat([-1.0, 1.0], [len(one.weights) for one in tied.logs])
    found = [name for name, status in fit.status.items() if status == "fitted"]
    weights = np.concatenate([one.weights for one in tied.logs])[:, None]
    whole = weights * np.column_stack([tied.jacobian[:, tied.places(found)], beside])
    expected = np.sqrt(np.diag(np.linalg.inv(whole.T @ whole)))[:-1]
    errors, before = (
        np.sqrt(np.diag(np.linalg.inv(one.information[np.ix_(*[one.places(found)] * 2)])))
        for one in (free, tied)
    )
    assert errors == pytest.approx(expected, rel=1e-6)
    assert np.all(errors > before)


def test_two_straight_lines_lack_as_much_below_their_speeds_as_a_hyperbolic_tangent() -> None:
    v = np.linspace(0.0, 20.0, 20001)
    lines = [np.clip(v / (1.386 * (1.0 + away)), 0.0, 1.0) for away in (-_SPREAD, _SPREAD)]
    lacking, truth = 1.0 - np.mean(lines, axis=0), 1.0 - np.tanh(v)
    for power in (0, 1):  # what a slow passage shows, and its first moment
        assert np.sum(v**power * lacking) == pytest.approx(np.sum(v**power * truth), rel=0.01)
