"""What is held at a default that nobody has measured is in the intervals of what was fitted."""

from __future__ import annotations

import math

import pytest

from damperfit.identification import Campaign, FitOptions, identify
from damperfit.uncertainty import Uncertainty, assess
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


def test_an_interval_reaches_as_far_as_one_error_of_the_default_moves_the_fit(log) -> None:
    apart = fitted(log)
    found = judged(apart)
    one = fitted(log, drag=DRAG.ignorance)
    for name in (*VALVES, "f_f"):
        value = getattr(apart.fits[0].parameters, name)
        moved = math.log(getattr(one.fits[0].parameters, name) / value)
        bend = found.intervals[name].misfit / value
        assert bend == pytest.approx(abs(moved), rel=0.25, abs=2e-4), name
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


def test_what_somebody_has_given_leaves_no_doubt_but_of_how_friction_turns(
    log, monkeypatch
) -> None:
    campaign = fitted(log, drag=1.5 * DRAG.ignorance)
    assert all(one.misfit > 0.0 for one in judged(campaign).intervals.values())
    monkeypatch.setattr("damperfit.uncertainty.suppositions.other_turns", lambda *_: ())
    assert {one.misfit for one in judged(campaign).intervals.values()} == {0.0}


def test_it_is_wrong_by_the_same_at_all_settings() -> None:
    drag = 1.5 * DRAG.ignorance
    logs = [adjusted.log(one, drag=drag) for one in adjusted.SETTINGS]
    few, many = (fitted(*some) for some in (logs[:2], logs))
    for campaign in (few, many):
        interval = judged(campaign).intervals["rebound_slope"]
        assert interval.low < adjusted.TRUTH["rebound_slope"] < interval.high
    bends = [judged(one).intervals["rebound_slope"].misfit for one in (few, many)]
    assert bends[1] == pytest.approx(bends[0], rel=0.3)  # four settings know no more than two
