"""What is held at a default that nobody has measured is in the intervals of what was fitted."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from damperfit.damper.friction import with_pressed_seal
from damperfit.damper.mounting import Friction
from damperfit.identification import Campaign, FitOptions, identify
from damperfit.uncertainty import Uncertainty, assess
from damperfit.uncertainty.linearisation import linearise_at_fit
from tests.identification import adjusted

DRAG = adjusted.DAMPER.quantity("drag")
VALVES = ("rebound_bleed", "rebound_opening", "rebound_slope", "compression_bleed")
# Beside its default by next to nothing: a number that somebody has given.
MEASURED = {"return_slope": 1.0001 * adjusted.DAMPER.quantity("return_slope").default}


def fitted(*logs, **fixed: float) -> Campaign:
    procedure = "joint" if len(logs) > 1 else "plain"
    follows = adjusted.FOLLOWS if len(logs) > 1 else {}
    options = FitOptions(procedure, fixed=MEASURED | fixed, follows=follows)
    return identify(logs, adjusted.DAMPER, options)


def judged(campaign: Campaign) -> Uncertainty:
    return assess(campaign, adjusted.DAMPER).uncertainties[0]


@pytest.fixture(scope="module")
def log():
    return adjusted.log(adjusted.at(14, 3), drag=1.5 * DRAG.ignorance)


def test_an_interval_reaches_as_far_as_one_error_of_each_supposition_moves_the_fit(log) -> None:
    apart = fitted(log)
    found = judged(apart)
    dragged = fitted(log, drag=DRAG.ignorance).fits[0].parameters
    model, _ = with_pressed_seal(adjusted.DAMPER, apart.fits[0].parameters)
    area = 3e-6
    options = FitOptions("plain", fixed={**MEASURED, "seal_area": area})
    pressed = identify([log], model, options).fits[0].parameters
    at_rest = {"f_f": area * adjusted.DAMPER.gas_pressure}
    for name in (*VALVES, "f_f"):
        value = getattr(apart.fits[0].parameters, name)
        moved = [
            math.log(getattr(dragged, name) / value),
            math.log((getattr(pressed, name) + at_rest.get(name, 0.0)) / value),
        ]
        bend = found.intervals[name].misfit / value
        assert bend == pytest.approx(math.hypot(*moved), rel=0.25, abs=2e-4), name
    bent = found.intervals["rebound_slope"]
    assert bent.misfit > 2.0 * bent.error


def test_the_truth_lies_within(log) -> None:
    truth = adjusted.numbers(adjusted.at(14, 3))
    found = judged(fitted(log))
    for name in VALVES:
        interval = found.intervals[name]
        assert interval.low < truth[name] < interval.high, name
    alone = found.intervals["rebound_slope"]
    assert abs(truth["rebound_slope"] - math.sqrt(alone.low * alone.high)) > 1.96 * alone.error


def test_what_somebody_has_given_leaves_no_doubt_but_of_the_form_of_friction(
    log, monkeypatch
) -> None:
    campaign = fitted(log, drag=1.5 * DRAG.ignorance)
    assert all(one.misfit > 0.0 for one in judged(campaign).intervals.values())
    monkeypatch.setattr("damperfit.uncertainty.linearisation.other_turns", lambda *_: ())
    assert all(one.misfit > 0.0 for one in judged(campaign).intervals.values())
    monkeypatch.setattr("damperfit.uncertainty.linearisation.with_pressed_seal", lambda *_: None)
    assert {one.misfit for one in judged(campaign).intervals.values()} == {0.0}


def test_a_seal_that_the_pressure_presses_is_within_the_intervals() -> None:
    damper = replace(adjusted.DAMPER, friction=Friction(seal_area="fit"))
    area = 5e-6
    found = judged(fitted(adjusted.log(at := adjusted.at(14, 3), damper=damper, seal_area=area)))
    at_rest = adjusted.TRUTH["f_f"] + area * damper.gas_pressure
    truth = adjusted.numbers(at) | {"f_f": at_rest}
    for name in (*VALVES, "f_f"):
        one = found.intervals[name]
        assert one.low < truth[name] < one.high, name
    opening = found.intervals["rebound_opening"]
    middle = math.sqrt(opening.low * opening.high)
    assert abs(truth["rebound_opening"] - middle) > 3.0 * opening.error


def test_a_setting_without_friction_supposes_as_many_forms_as_the_others(log) -> None:
    without = identify([log], adjusted.DAMPER, FitOptions("plain", fixed={**MEASURED, "f_f": 0.0}))
    columns = [
        linearise_at_fit(one.fits[0], adjusted.DAMPER).supposed.shape
        for one in (without, fitted(log))
    ]
    assert columns[0] == columns[1]


def test_it_is_wrong_by_the_same_at_all_settings() -> None:
    drag = 1.5 * DRAG.ignorance
    logs = [adjusted.log(one, drag=drag) for one in adjusted.SETTINGS]
    few, many = (fitted(*some) for some in (logs[:2], logs))
    for campaign in (few, many):
        interval = judged(campaign).intervals["rebound_slope"]
        assert interval.low < adjusted.TRUTH["rebound_slope"] < interval.high
    bends = [judged(one).intervals["rebound_slope"].misfit for one in (few, many)]
    assert bends[1] == pytest.approx(bends[0], rel=0.3)  # four settings know no more than two
