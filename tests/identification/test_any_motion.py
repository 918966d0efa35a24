"""Raw logs of any motion are fitted as well as a steady sine: 1 kHz, 4 N and 3 um of noise."""

from __future__ import annotations

import pytest

from damperfit.conditioning import ConditionOptions, condition
from damperfit.damper.parameters import PURDY_DAMPER
from damperfit.damper.reference import reference_parameters
from damperfit.identification import FitOptions, identify
from damperfit.uncertainty import assess
from tests.oracles.motions import logged

WITHIN = {"r_m1": 0.002, "r_m2": 0.005, "r_m3": 0.01, "k_e": 0.02, "f_f": 0.03}


def fitted(name, *, seed=1, setting=10):
    trace = condition(logged(name, setting, seed=seed), ConditionOptions(centre=0.0))
    campaign = identify([trace], PURDY_DAMPER, FitOptions(procedure="plain"))
    return trace, campaign


@pytest.mark.parametrize("name", ["steps", "sweep", "road"])
def test_the_parameters_are_found(name):
    trace, campaign = fitted(name)
    (fit,) = campaign.fits
    truth = reference_parameters(10)
    for parameter, share in WITHIN.items():
        found = getattr(fit.parameters, parameter)
        assert found == pytest.approx(getattr(truth, parameter), rel=share), parameter
        assert fit.status[parameter] == "fitted"
    assert fit.mse_percent < 0.001
    assert fit.mse_percent == pytest.approx(fit.noise_floor_percent, rel=0.4)
    assert fit.n_samples == trace.n_samples
    (diagnosis,) = assess(campaign, PURDY_DAMPER).diagnoses
    assert not diagnosis.is_structured
    assert diagnosis.noise_percent == pytest.approx(fit.mse_percent, rel=0.3)


def test_intervals_hold_for_each_motion():
    """One log in twenty may be out; three errors none is."""
    truth = reference_parameters(10)
    for name in ("steps", "sweep", "road"):
        _, campaign = fitted(name, seed=2)
        (known,) = assess(campaign, PURDY_DAMPER).uncertainties
        for parameter, interval in known.intervals.items():
            off = getattr(campaign.fits[0].parameters, parameter) - getattr(truth, parameter)
            assert abs(off) < 3.5 * interval.error, (name, parameter)


def test_a_triangle_alone_does_not_tell_and_says_so():
    _, campaign = fitted("triangle")
    (fit,) = campaign.fits
    assert {fit.status[name] for name in WITHIN} == {"not_identifiable"}
    assert any("one speed" in warning for warning in fit.warnings)
    # Two levels tell two valves.
    held = {"r_m3": 2.597e6, "f_f": 50.0}
    options = FitOptions(procedure="plain", fixed=held)
    trace = condition(logged("triangle", 10), ConditionOptions(centre=0.0))
    (fit,) = identify([trace], PURDY_DAMPER, options).fits
    truth = reference_parameters(10)
    for name in ("r_m1", "r_m2", "k_e"):
        assert fit.status[name] == "fitted"
        share = WITHIN[name]
        assert getattr(fit.parameters, name) == pytest.approx(getattr(truth, name), rel=share)


def test_a_triangle_beside_another_speed_tells():
    _, campaign = fitted("two triangles")
    (fit,) = campaign.fits
    truth = reference_parameters(10)
    (known,) = assess(campaign, PURDY_DAMPER).uncertainties
    for name, share in WITHIN.items():
        value, right = getattr(fit.parameters, name), getattr(truth, name)
        # R_m2, R_m3 and f_f are told apart by two levels less well than by a sine.
        within = max(share * right, 3.0 * known.intervals[name].error)
        assert abs(value - right) < within, name
        assert fit.status[name] == "fitted"
        assert value == pytest.approx(right, rel=3.0 * share)
